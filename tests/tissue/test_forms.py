"""A user's weak forms: forces by hand, tangents, the tissue as a form; forms and laws in runs."""

import numpy as np
import pytest
from tools.grids import assembled, bend, columns_of, rectangle, tangent_of, wavy
from tools.laws import LAWS, LMBDA, MU
from tools.refusals import refuses

import evfem as ev
from evfem.mesh.mesh import Mesh
from evfem.tensor import ddot, dot, grad, trace
from evfem.tissue.assembly import Integral
from evfem.tissue.userforms import make_term

NEO_HOOKEAN = LAWS["neo_hookean"]
#: one element per kind of cell; the shares of an edge's nodes (start, end, middle)
SHARES = {"q1": [1 / 2, 1 / 2], "q2p1": [1 / 6, 1 / 6, 4 / 6], "p2": [1 / 6, 1 / 6, 4 / 6]}
every_kind = pytest.mark.parametrize("element", list(SHARES))


@ev.form
def nail_bed(u, v, w):
    return 0.02 * dot(u, v)


@ev.form
def crooked(u, v, w):
    """Nonlinear, without potential, with values, gradients and places."""
    H = grad(u)
    return (
        np.sin(3 * u[0]) * v[1]
        + u[1] ** 2 * H[0, 1] * grad(v)[1, 0]
        + w.x[0] * trace(H) * dot(u, v)
        + np.exp(H[1, 1]) * v[0]
    )


@every_kind
def test_nail_bed_by_hand(element):
    """A bed of 0.02 MPa/mm moved by (0.3, -0.1) mm: every edge of 0.5 mm shares 0.01 (0.3, -0.1)
    N/mm among its nodes, by halves or 1/6, 4/6, 1/6, and no other node feels it."""
    space = rectangle(element, (4, 3), size=(2.0, 1.0))
    term = make_term(space, nail_bed, "top", boundary=True)
    u = np.tile([0.3, -0.1], (space.size, 1))
    expected = np.zeros_like(u)
    for edge in space.mesh.sides_of("top"):
        expected[edge] += 0.5 * 0.02 * np.outer(SHARES[element], [0.3, -0.1])
    np.testing.assert_allclose(term.forces(u), expected, atol=1e-16)
    # a linear field: work 0.02 int u^2 over the edge, u = (x, 1), from 0 to 2
    u = np.column_stack([space.mesh.points[:, 0], np.ones(space.size)])
    assert np.sum(term.forces(u) * u) == pytest.approx(0.02 * (8.0 / 3.0 + 2.0), rel=1e-13)


@every_kind
def test_region_form_acts_on_its_region_only(element):
    """Weight of the upper half of 2 x 1 mm: f = rho g times its area, spread over its cells' nodes."""
    space = rectangle(element, (2, 4), size=(2.0, 1.0), split=lambda x, y: y > 0.5)
    weight = ev.form(lambda u, v, w: 9.81e-3 * v[1])
    forces = make_term(space, weight, "upper", boundary=False).forces(np.zeros((space.size, 2)))
    np.testing.assert_allclose(forces.sum(axis=0), [0.0, 9.81e-3], rtol=1e-12, atol=1e-18)
    assert not forces[space.mesh.points[:, 1] < 0.5 - 1e-9].any()


@every_kind
@pytest.mark.parametrize(("on", "boundary"), [("upper", False), ("left", True), ("outline", True)])
def test_tangent_is_the_derivative_of_the_forces(element, on, boundary):
    """Complex step against central differences for a form that is neither linear nor symmetric;
    the solver's matrix gets the symmetric part, also where a cell has two edges on the
    boundary."""
    space = rectangle(element, (2, 2), warp=bend, split=lambda x, y: y > 0.5)
    term = make_term(space, crooked, on, boundary)
    u = wavy(space.mesh.points)
    symmetric = tangent_of(space, u, term).toarray()
    K = assembled(space, Integral.cell_tangents(term, u), term.points.cells).toarray()
    np.testing.assert_allclose(symmetric, 0.5 * (K + K.T), atol=1e-15)
    columns = columns_of(term.forces, u)
    np.testing.assert_allclose(K, columns, atol=1e-8 * np.abs(K).max())
    assert np.abs(K - K.T).max() > 1e-2 * np.abs(K).max()


def test_unknown_places_are_refused():
    space = rectangle("q1", (2, 2))
    space.mesh.node_sets["corners"] = np.array([0, 8])
    for on, boundary, said in (
        ("nail", True, "bottom"),
        ("skin", False, "lower"),
        ("corners", True, "outer edge"),
    ):
        refuses(said, make_term, space, nail_bed, on, boundary)


def block_scene(law=NEO_HOOKEAN, element="q2", friction=0.0, **motion):
    """A block of 2 x 1 mm of one law, pressed onto a plane (by 0.1 mm, unless `motion` says otherwise)."""
    base = rectangle("q1", (6, 3), size=(2.0, 1.0)).mesh
    sets = {"pad": base.node_sets["bottom"], "bone": base.node_sets["top"], "side": base.node_sets["left"]}
    mesh = Mesh(base.points, base.cells, "quad", base.region, {"tissue": 0}, sets)
    press = ev.Press(steps=2, **(motion or {"indentation": 0.1}))
    solver = ev.Solver(element=element, tolerance=1e-10)
    return ev.Scene(
        ev.MeshedFinger(mesh, {"tissue": law}), ev.Flat(friction=friction), motion=(press,), solver=solver
    )


@ev.form
def material(u, v, w):
    """The default tissue, in the split form."""
    F = grad(u) + np.eye(2)[:, :, None, None]
    return MU * ddot(F, grad(v)) + (LMBDA * u.theta - MU) * v.theta


def test_form_as_a_material_knows_the_place_and_nothing_but_gradients():
    """Stiffness that grows along x carries the mean; a material cannot depend on the displacement itself."""

    def graded(u, v, w):
        return (0.5 + 0.5 * w.x[0]) * material(u, v, w)

    even, uneven = (ev.simulate(block_scene(ev.form(law))) for law in (material, graded))
    assert uneven.applied_force[-1] == pytest.approx(even.applied_force[-1], rel=0.1)
    ratios = [result.stored_energy[-1] / result.external_work[-1] for result in (uneven, even)]
    assert ratios[0] == pytest.approx(ratios[1], rel=1e-2)
    refuses("grad", ev.simulate, block_scene(ev.form(lambda u, v, w: material(u, v, w) + u[0] * v.theta)))


def test_plan_says_where_a_form_has_no_potential():
    held = block_scene(material).with_term(ev.form(lambda u, v, w: 0.2 * u[1] * v[1]), on=ev.Boundary("side"))
    assert "potential" not in str(ev.plan(held))
    assert "material, plane strain, shear modulus 0.7 MPa" in str(ev.plan(held))
    pushed = block_scene().with_term(ev.form(lambda u, v, w: 0.05 * u[1] * v[0]), on=ev.Region("tissue"))
    assert "on tissue (no potential: only the symmetric" in " ".join(str(ev.plan(pushed)).split())
    crooked_law = ev.form(lambda u, v, w: material(u, v, w) + 0.1 * grad(u)[0, 1] * grad(v)[1, 1])
    assert "(no potential: " in str(ev.plan(block_scene(crooked_law)))

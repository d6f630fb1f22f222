"""Internal forces and tangents of every element, plane and solid: patch test, derivatives, independent
twins, compiled loops, geometry.
"""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest
import skfem
from tools import grids, solids
from tools.grids import CELLS, SHAPES, fine_points, grid_of, mixed_tangent_of, rectangle, tangent_of
from tools.laws import LAWS as BUILT_IN
from tools.laws import LMBDA, MU, SteepVolume, neo_hookean_stress
from tools.refusals import refuses
from tools.solids import SOLIDS, box

import evfem as ev
from evfem.mesh.faces import node_places
from evfem.mesh.mesh import CELLS as CELLS_OF
from evfem.tensor import det
from evfem.tissue.dynamics import Dynamics
from evfem.tissue.space import ELEMENTS, make_space, quadrature, shape_functions
from evfem.tissue.weakform import Tissue, check_laws


@ev.form
def neo_hookean_form(u, v, w):
    """The neo-Hookean law as a user's form."""
    F = np.eye(len(u.grad))[:, :, None, None] + u.grad
    return MU * np.sum(F * v.grad, axis=(0, 1)) + (LMBDA * u.theta - MU) * v.theta


LAWS = BUILT_IN | {"form": neo_hookean_form}
plane_element = pytest.mark.parametrize("element", list(CELLS))
every_element = pytest.mark.parametrize("element", [*CELLS, *SOLIDS])
every_law = pytest.mark.parametrize("law", list(LAWS))
STRETCH = np.array([[0.12, 0.2, 0.05], [-0.07, -0.05, 0.1], [0.03, -0.08, 0.06]])


def space_of(element, divisions, bent=False, split=None, jitter=0.0):
    """The space of an element on a unit square or cube, its cells in the first rows of `divisions`."""
    make, tools = (box, solids) if element in SOLIDS else (rectangle, grids)
    warp = tools.bend if bent else None
    return make(element, divisions[: 3 if element in SOLIDS else 2], warp=warp, split=split, jitter=jitter)


def wavy(space, size=0.06):
    return (solids if space.dim == 3 else grids).wavy(space.mesh.points, size)


def sums_to(most):
    """Cells beyond a line, in the plane and in space."""
    return lambda *place: place[0] + place[1] > most


def stress_of(law, F):
    """P (3, 3) at F (3, 3): the law's own, or the neo-Hookean law's for those that are it."""
    if isinstance(law, SteepVolume):
        J, G = np.linalg.det(F), np.linalg.inv(F).T
        return MU * (F - G) + LMBDA / 4.0 * (J**2 - J**-2) * (J**2 + J**-2) * G
    return law.P(F) if hasattr(law, "P") else neo_hookean_stress(F, MU, LMBDA)


@every_law
@every_element
@pytest.mark.parametrize("shape", ["distorted", "curved"])
def test_patch(element, law, shape):
    """Affine displacements give the law's own stress in every cell and no force on an inner node.

    Origin: P(F) of the law at the constant F; a forgotten Jacobian, wrong node order or a theta
    other than the one the law means breaks it. Curved edges map affine fields exactly too
    (isoparametric), but 27 points do not integrate the Jacobian of a curved hexahedron exactly.
    """
    space = space_of(element, (3, 3, 2), shape == "curved", jitter=0.25 * (shape == "distorted"))
    tissue, dim = Tissue(space, {"lower": LAWS[law]}), space.dim
    points, sets = space.mesh.points, space.mesh.node_sets
    stretch = STRETCH[:dim, :dim]
    u, F = points @ stretch.T, np.eye(3)
    F[:dim, :dim] += stretch
    J, P = np.linalg.det(F), stress_of(LAWS[law], F)
    forces = tissue.forces(u)
    inner = np.setdiff1d(np.arange(space.size), sets["outline" if dim == 2 else "outside"])
    if shape == "distorted" or element != "hex27p1":
        assert np.abs(forces[inner]).max() < 1e-13
    # the boundary forces hold P: sum of f X over the outline = P times the area
    np.testing.assert_allclose(forces.T @ points, P[:dim, :dim] * space.weight.sum(), atol=1e-12)
    stress, volume = tissue.cell_stress(u)
    np.testing.assert_allclose(volume, J, rtol=1e-12)
    sigma = P if law == "linear_elastic" else P @ F.T / J
    expected = sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]][: stress.shape[1]]
    told = [0, 1, 3] if law == "form" and dim == 2 else slice(None)  # a form tells no stress out of the plane
    np.testing.assert_allclose(stress[:, told], np.tile(expected[told], (len(stress), 1)), atol=1e-12)


@every_law
@every_element
def test_forces_are_the_derivative_of_the_energy_and_tangents_of_the_forces(element, law):
    """Differences along random directions; two regions, so groups mix. Of a law that has its stress alone the
    energy is work along a path, exact to quadrature.
    """
    space = space_of(element, (2, 2, 1), True, split=lambda *place: place[0] > 0.5)
    tissue = Tissue(space, {"lower": LAWS[law], "upper": ev.Yeoh(c1=0.3, c2=0.2, nu=0.3)})
    u = wavy(space)
    f, K = tissue.forces(u), tangent_of(space, u, tissue)
    scale, h = abs(K).max(), 1e-4
    for direction in np.random.default_rng(3).normal(size=(3, *u.shape)):
        ends = [tissue.energy(u + s * h * direction) for s in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
        assert slope == pytest.approx(np.sum(f * direction), rel=2e-8)
        ends = [tissue.forces(u + s * h * direction) for s in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
        np.testing.assert_allclose(K @ direction.ravel(), slope.ravel(), atol=5e-9 * scale)
    assert abs(K - K.T).max() < 1e-9 * scale


# -- reference cells: scikit-fem's ----------------------------------------------------------------------

REFERENCE = SHAPES | {"hexahedron": skfem.ElementHex1, "hexahedron27": skfem.ElementHex2}


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_shape_functions_and_quadrature_are_those_of_scikit_fem(element):
    kind, order, _ = ELEMENTS[element]
    theirs, dim = REFERENCE[kind](), CELLS_OF[kind].dimension
    ours = 0.5 * (node_places(CELLS_OF[kind].nodes, dim) + 1.0)
    number = (ours[:, None] == theirs.doflocs).all(axis=2).argmax(axis=1)
    places = np.random.default_rng(2).random((7, dim))
    value, slope = shape_functions(kind, places)
    for node, i in enumerate(number):
        own, by_place = theirs.lbasis(places.T, i)
        np.testing.assert_allclose(value[:, node], np.broadcast_to(own, 7), rtol=0, atol=2e-14)
        np.testing.assert_allclose(slope[:, node].T, np.broadcast_to(by_place, (dim, 7)), rtol=0, atol=2e-14)
    for facet, domain in ((False, theirs.refdom), (True, theirs.refdom.brefdom)):
        expected = np.vstack(skfem.quadrature.get_quadrature(domain, order))
        found = np.column_stack(quadrature(element, facet)).T
        assert sorted(map(tuple, found.T.round(14))) == sorted(map(tuple, expected.T.round(14)))


# -- twins ----------------------------------------------------------------------------------------------


def twin_energy(space, u):
    """Neo-Hookean energy of the element, safe for complex u, on scikit-fem's own shapes.

    theta: ln J pointwise, at the centroid, or its weighted least-squares plane over the points of the cell.
    """
    kind, intorder, sampling = ELEMENTS[space.element]
    x, dx, _, gradient, nodes = fine_points(space, intorder)
    F = np.einsum("ajeq,eai->ijeq", gradient, u[nodes]) + np.eye(2)[:, :, None, None]
    theta = np.log(det(F))
    if sampling == "centroid":
        centre = (np.array([[0.5], [0.5]]), np.array([1.0]))
        basis = skfem.Basis(grid_of(space.mesh), SHAPES[kind](), quadrature=centre)
        middle = np.stack([basis.basis[a][0].grad for a in range(basis.Nbfun)])
        F0 = np.einsum("ajeq,eai->ijeq", middle, u[nodes]) + np.eye(2)[:, :, None, None]
        theta = np.log(det(F0)) + 0.0 * theta
    if sampling == "linear":
        planes = []
        for X, Y, w, value in zip(*x, dx, theta, strict=True):
            A, root = np.column_stack([np.ones_like(X), X, Y]), np.sqrt(w)
            parts = np.column_stack([value.real, value.imag])
            fit = np.linalg.lstsq(A * root[:, None], parts * root[:, None], rcond=None)[0]
            planes.append(A @ (fit @ [1.0, 1j]))
        theta = np.array(planes)
    psi = 0.5 * MU * (np.sum(F * F, axis=(0, 1)) - 2.0 - 2.0 * theta) + 0.5 * LMBDA * theta**2
    return np.sum(psi * dx)


@plane_element
@pytest.mark.parametrize("compiled", [True, False])
def test_forces_equal_the_complex_step_of_an_independent_energy(element, compiled):
    """One energy written from its formula gives energy and forces of every element, compiled or not."""
    space = rectangle(element, (2, 1), warp=grids.bend)
    tissue = Tissue(space, {"lower": LAWS["neo_hookean"]})
    if not compiled:
        tissue.loops = None
    u = wavy(space).astype(complex)
    forces = np.empty(u.shape)
    for index in np.ndindex(u.shape):
        u[index] += 1e-30j
        forces[index] = twin_energy(space, u).imag / 1e-30
        u[index] = u[index].real
    u = u.real
    assert tissue.energy(u) == pytest.approx(twin_energy(space, u.astype(complex)).real, rel=1e-13)
    np.testing.assert_allclose(tissue.forces(u), forces, atol=2e-14)


@every_element
def test_compiled_loops_are_the_form(element):
    """Blocks of cells, the last one not full, two regions, curved edges: whatever is asked of a tissue."""
    space = space_of(element, (6, 3, 1) if element in CELLS else (3, 3, 1), True, sums_to(1.0))
    laws = {"lower": ev.NeoHookean(E=0.8, nu=0.3), "upper": ev.NeoHookean(E=3.0, nu=0.4999)}
    fast, plain = Tissue(space, laws), Tissue(space, laws)
    plain.loops = None
    u, du = wavy(space), wavy(space, 0.04)[::-1]
    q = np.random.default_rng(4).uniform(-0.2, 0.1, space.weight.shape)
    for of in (
        lambda tissue: tissue.forces(u),
        lambda tissue: tangent_of(space, u, tissue).toarray(),
        lambda tissue: mixed_tangent_of(tissue, u, q).toarray(),
        lambda tissue: tissue.pressure(u),
        lambda tissue: tissue.pressure_change(u, du),
        lambda tissue: tissue.pressure_forces(u, q),
        lambda tissue: np.array([tissue.energy(u), tissue.smallest_J(u)]),
        lambda tissue: tissue.energies(u, du, np.array([0.0, 0.05, 0.1])),
        lambda tissue: np.column_stack(tissue.cell_stress(u)),
    ):
        expected = of(plain)
        np.testing.assert_allclose(of(fast), expected, atol=2e-12 * np.abs(expected).max())


@every_element
def test_compiled_loops_are_the_form_of_the_viscosity(element):
    """And its dissipation, in cells of different viscosity, one of which has none."""
    space = space_of(element, (5, 4, 1), True)
    start, u = wavy(space), wavy(space, 0.08)
    eta = np.linspace(0.0, 0.3, len(space.nodes))
    fast, plain = Dynamics(space, eta, None), Dynamics(space, eta, None)
    plain.loops = None
    for term in (fast, plain):
        term.begin_from(start, 0 * u, 2e-3)
    forces, K = plain.forces(u), tangent_of(space, u, plain).toarray()
    np.testing.assert_allclose(fast.forces(u), forces, atol=1e-12 * np.abs(forces).max())
    np.testing.assert_allclose(tangent_of(space, u, fast).toarray(), K, atol=1e-12 * np.abs(K).max())
    assert fast.damping(u) == pytest.approx(plain.damping(u), rel=1e-12)


@pytest.mark.parametrize(("element", "built"), [("q1", "loops"), ("hex8", "solids")])
def test_compiled_loops_are_used_where_they_were_built(element, built):
    tissue = Tissue(space_of(element, (1, 1, 1)), {"lower": LAWS["neo_hookean"]})
    assert (tissue.loops is None) == (find_spec(f"evfem.tissue.kernels.{built}") is None)


@plane_element
def test_tangled_cells_are_refused(element):
    """A corner pulled over the opposite edge: scikit-fem would take the absolute determinant."""
    space = rectangle(element, (2, 2))
    points = space.mesh.points.copy()
    middle = np.argmin(np.hypot(*(points - 0.5).T))
    points[middle] = [1.3, 1.3]
    refuses("tangled", make_space, replace(space.mesh, points=points), element)


@every_element
@pytest.mark.parametrize("compiled", [True, False])
def test_inverted_states_are_seen(element, compiled):
    """A state turned inside out has negative J and forces that are not numbers, never a finite answer."""
    space = space_of(element, (2, 2, 1))
    for law in ("neo_hookean", "yeoh"):
        tissue = Tissue(space, {"lower": LAWS[law]})
        tissue.loops = tissue.loops if compiled else None
        u = space.mesh.points * ([-2.0] + [0.0] * (space.dim - 1))
        assert tissue.smallest_J(u) == pytest.approx(-1.0)
        assert np.isnan(tissue.forces(u)).any()


def test_wrong_elements_and_laws_are_refused():
    quads = rectangle("q1", (1, 1)).mesh
    refuses("quad9", make_space, quads, "q2")
    refuses("no material for region lower", check_laws, quads, {})
    refuses("bone", check_laws, quads, {"lower": LAWS["yeoh"], "bone": LAWS["yeoh"]})

"""The engine of all weak forms: fluxes, derivatives and theta against formulae and against the
fast ways.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import skfem
from tools.grids import CELLS, rectangle, tangent_of

import evfem as ev
from evfem.errors import InputError
from evfem.tensor import det
from evfem.tissue import forms
from evfem.tissue.assembly import Integral, Points, VolumeMeasure, points_of, volume_change
from evfem.tissue.dynamics import Dynamics
from evfem.tissue.fields import Parts, fluxes, fluxes_at_once
from evfem.tissue.laws import LinearElastic, NeoHookean, Ogden, Yeoh
from evfem.tissue.space import nodes_at, shape_gradients, shape_values
from evfem.tissue.userforms import make_term, tried
from evfem.tissue.weakform import Tissue

MU, LMBDA = 0.7, 1.9
NEO_HOOKEAN = NeoHookean(E=MU * (3 * LMBDA + 2 * MU) / (LMBDA + MU), nu=LMBDA / (2 * (LMBDA + MU)))
LAWS = {
    "neo_hookean": NEO_HOOKEAN,
    "yeoh": Yeoh(c1=0.35, c2=0.1, c3=0.02, nu=0.4),
    "ogden": Ogden(mu=[0.9, -0.2], alpha=[2.5, -1.5], bulk=2.0),
    "linear_elastic": LinearElastic(E=0.8, nu=0.3),
}
every_element = pytest.mark.parametrize("element", list(CELLS))
rng = np.random.default_rng(4)


def bend(x, y):
    """A warp that curves every edge."""
    return x + 0.06 * np.sin(2.0 * y + x), y + 0.08 * np.sin(2.5 * x)


def wavy(points, size=0.08):
    """A smooth displacement field."""
    x, y = points.T
    return size * np.column_stack([np.sin(2 * x + y) + y * y, np.cos(3 * x - y) + x * y])


def region(element, law):
    """The integral that a tissue of one law is, on bent cells, and displacements."""
    space = rectangle(element, (3, 2), warp=bend)
    tissue = Tissue(space, {"lower": law})
    tissue.loops = None
    ((_, integral),) = tissue.regions
    return tissue, integral, wavy(space.mesh.points)


# -- fast ways and forms ---------------------------------------------------------------------------------


@every_element
@pytest.mark.parametrize("law", list(LAWS))
def test_moduli_written_by_hand_are_the_complex_steps_of_the_form(element, law):
    _, integral, u = region(element, LAWS[law])
    assert integral.moduli is not None
    stepped = replace(integral, moduli=None).cell_tangents(u)
    np.testing.assert_allclose(integral.cell_tangents(u), stepped, atol=1e-12 * np.abs(stepped).max())


@every_element
def test_default_tissue_is_the_form_of_its_law(element):
    """mu F : grad v + (lambda theta - mu) dtheta(v) is S : grad v + q dtheta(v) of the neo-Hookean
    law.
    """
    _, integral, u = region(element, NEO_HOOKEAN)
    assert integral.form is forms.neo_hookean
    general = replace(integral, form=forms.hyperelastic)
    np.testing.assert_allclose(integral.forces(u), general.forces(u), atol=1e-15)


@every_element
def test_compiled_loops_are_the_form_of_the_tissue(element):
    space = rectangle(element, (5, 4), warp=bend)
    u = wavy(space.mesh.points)
    tissue = Tissue(space, {"lower": NEO_HOOKEAN})
    w = SimpleNamespace(mu=MU, lmbda=LMBDA)
    points = points_of(space, np.arange(len(space.nodes)))
    form = Integral(forms.neo_hookean, points, Parts(2, grad=True, theta=True), w)
    np.testing.assert_allclose(tissue.forces(u), form.forces(u), atol=1e-14)
    K = tangent_of(space, u, form).toarray()
    np.testing.assert_allclose(tangent_of(space, u, tissue).toarray(), K, atol=1e-13 * np.abs(K).max())


@every_element
def test_compiled_loops_are_the_form_of_the_viscosity(element):
    """And its dissipation, in cells of different viscosity, one of which has none."""
    space = rectangle(element, (5, 4), warp=bend)
    start, u = wavy(space.mesh.points), wavy(space.mesh.points, 0.11)
    eta = np.linspace(0.0, 0.3, len(space.nodes))
    fast, plain = Dynamics(space, eta, None), Dynamics(space, eta, None)
    plain.loops = None
    for term in (fast, plain):
        term.begin(start, 0 * u, 2e-3)
    tangents = [tangent_of(space, u, term).toarray() for term in (fast, plain)]
    forces = plain.forces(u)
    np.testing.assert_allclose(fast.forces(u), forces, atol=1e-13 * np.abs(forces).max())
    np.testing.assert_allclose(*tangents, atol=1e-13 * np.abs(tangents).max())
    assert fast.dissipation(u) == pytest.approx(plain.dissipation(u), rel=1e-12)


@pytest.mark.parametrize("form", [forms.neo_hookean, forms.kelvin_voigt, forms.mass])
def test_all_test_functions_at_once_are_one_after_the_other(form):
    parts = Parts(2, value=True, grad=True, theta=True)
    x = rng.uniform(-0.2, 0.2, (7, 4, 3))
    strain0 = rng.uniform(-0.1, 0.1, (2, 2, 4, 3))
    w = SimpleNamespace(mu=0.7, lmbda=1.9, eta=np.ones((4, 1)), step=0.1, density=2.0, strain0=strain0)
    one = fluxes(form, parts, x, w)
    w.strain0 = strain0[:, :, None]
    np.testing.assert_allclose(fluxes_at_once(form, parts, x, w), one, rtol=1e-15, atol=1e-16)
    assert np.abs(one).max() > 0.01


def test_fluxes_stand_before_the_parts_of_the_test_function():
    """2 v_x + 3 dv_x/dY + 5 dv_y/dX + 7 theta(v): the gradient runs through the directions first."""

    def form(u, v, w):
        return 2.0 * v[0] + 3.0 * v.grad[0, 1] + 5.0 * v.grad[1, 0] + 7.0 * v.theta

    parts = Parts(2, value=True, grad=True, theta=True)
    s = fluxes(form, parts, np.zeros((7, 1, 1)), None)[:, 0, 0]
    np.testing.assert_array_equal(s, [2.0, 0.0, 0.0, 5.0, 3.0, 0.0, 7.0])
    np.testing.assert_array_equal(parts.field(s).grad, [[0.0, 3.0], [5.0, 0.0]])
    np.testing.assert_array_equal(parts.stacked(parts.field(s).grad, s[-1:])[:, 0], s[2:])


# -- theta in a user's form ------------------------------------------------------------------------------


@ev.form
def tissue_by_theta(u, v, w):
    F = ev.grad(u) + np.eye(2)[:, :, None, None]
    return w.law.mu * ev.ddot(F, ev.grad(v)) + (w.law.lmbda * u.theta - w.law.mu) * v.theta


@every_element
def test_default_tissue_as_a_users_form_over_regions(element):
    """theta is the element's own measure, w.law the region's law: forces and tangents of two
    tissues.
    """
    space = rectangle(element, (4, 4), warp=bend, split=lambda x, y: x + y > 1.0)
    laws = {"lower": NEO_HOOKEAN, "upper": NeoHookean(E=3.0, nu=0.49)}
    u = wavy(space.mesh.points)
    tissue = Tissue(space, laws)
    terms = [make_term(space, tissue_by_theta, name, False, law) for name, law in laws.items()]
    K = tangent_of(space, u, tissue).toarray()
    np.testing.assert_allclose(sum(term.forces(u) for term in terms), tissue.forces(u), atol=1e-14)
    np.testing.assert_allclose(tangent_of(space, u, *terms).toarray(), K, atol=1e-12 * np.abs(K).max())


@every_element
def test_form_of_value_gradient_and_theta_has_its_tangent(element):
    """Everything coupled with everything, without potential: central differences of the forces."""

    @ev.form
    def coupled(u, v, w):
        H = ev.grad(u)
        shear = np.sin(u[0] + 2.0 * u.theta) * ev.grad(v)[0, 1] + H[1, 0] * u.theta**2 * v[1]
        return shear + (u[1] * H[0, 0] + np.exp(u.theta)) * v.theta

    space = rectangle(element, (1, 1), warp=bend)
    term = make_term(space, coupled, "lower", False)
    u = wavy(space.mesh.points)
    exact = np.zeros((len(u) * 2, len(u) * 2))
    unknown = (2 * space.nodes[:, :, None] + [0, 1]).reshape(len(space.nodes), -1)
    for cell, K in zip(unknown, Integral.cell_tangents(term, u), strict=True):
        exact[np.ix_(cell, cell)] += K
    columns = []
    for unit in np.eye(u.size):
        step = 1e-5 * unit.reshape(u.shape)
        columns.append((term.forces(u + step) - term.forces(u - step)).ravel() / 2e-5)
    np.testing.assert_allclose(exact, np.array(columns).T, atol=1e-8 * np.abs(exact).max())


def test_theta_is_refused_where_it_has_no_meaning():
    space = rectangle("q1", (2, 2))
    with pytest.raises(InputError, match="a use of theta where it is not known"):
        make_term(space, ev.form(lambda u, v, w: u.theta * v[0]), "top", True)


def test_a_form_that_changes_what_it_uses_is_refused():
    """Gradients only beyond a displacement that the trial does not reach."""
    space = rectangle("q1", (2, 2))

    @ev.form
    def late(u, v, w):
        return ev.grad(v)[0, 0] if np.max(np.real(u)) > 1.0 else v[0]

    term = make_term(space, late, "lower", False)
    term.forces(np.zeros((9, 2)))
    with pytest.raises(InputError, match="the same parts"):
        term.forces(np.full((9, 2), 2.0))


@pytest.mark.parametrize(
    ("integrand", "on", "grad", "theta", "potential"),
    [
        (lambda u, v, w: 0.3 * v[1], "lower", False, False, True),
        (lambda u, v, w: (1.0 + w.x[0]) * ev.dot(u, v), "lower", False, False, True),
        (lambda u, v, w: u[1] * v[0], "lower", False, False, False),
        (lambda u, v, w: ev.ddot(ev.grad(u), ev.grad(v)), "lower", True, False, True),
        (lambda u, v, w: u.theta * v.theta, "lower", False, True, True),
        (lambda u, v, w: u.theta * v[0], "lower", False, True, False),
        (lambda u, v, w: ev.dot(w.n, u) * ev.dot(w.n, v), "top", False, False, True),
        (lambda u, v, w: ev.dot(w.n, u) * v[0], "top", False, False, False),
    ],
)
def test_trial_finds_what_a_form_uses_and_whether_it_has_a_potential(integrand, on, grad, theta, potential):
    mesh = rectangle("q1", (3, 2), warp=bend).mesh
    trial = tried(mesh, ev.form(integrand), on, boundary=on == "top")
    assert (trial.parts.grad, trial.parts.theta, trial.has_potential) == (grad, theta, potential)


REFUSED = {
    "no v": (lambda u, v, w: 1e-3, "not linear in v"),
    "a constant beside v": (lambda u, v, w: v[1] + 1e-5, "not linear in v"),
    "twice v": (lambda u, v, w: ev.dot(v, v), "not linear in v"),
    "magnitude of v": (lambda u, v, w: np.abs(v[1]), "not linear in v"),
    "vectors for tensors": (lambda u, v, w: ev.ddot(u, v), r"an integrand of shape \(1,\)"),
    "whole v": (lambda u, v, w: 1e-5 * v, "an integrand of shape"),
    "nothing": (lambda u, v, w: None, "no integrand; allowed: a number for every point"),
    "no such place": (lambda u, v, w: w.t * v[1], "that raises AttributeError"),
    "two arguments": (lambda u, v: u[0] * v[0], "that raises TypeError"),
    "infinite at rest": (lambda u, v, w: v[1] / u[1], "infinite or no number"),
    "steep at rest": (lambda u, v, w: np.sqrt(u[1] ** 2 + 0j).real * v[1], "lost in a complex step"),
    "magnitude of u": (lambda u, v, w: np.abs(u[1]) * v[1], "lost in a complex step"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_a_form_that_no_run_could_use_is_refused_with_one_sentence(kind):
    integrand, said = REFUSED[kind]
    with pytest.raises(ev.InputError, match=said) as caught:
        tried(rectangle("q1", (3, 2), warp=bend).mesh, ev.form(integrand), "lower", boundary=False)
    assert str(caught.value).startswith("form <lambda>: given ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "integrand",
    [
        lambda u, v, w: 0.0 * v[0],
        lambda u, v, w: 10.0 * ev.positive_part(-u[1]) * v[1],
        lambda u, v, w: 1e-9 * ev.ddot(ev.grad(u), ev.grad(v)),
        lambda u, v, w: (1.0 + ev.dot(u, u)) ** 2 * ev.dot(u, v) + 1e6 * u.theta * v.theta,
    ],
)
def test_a_form_without_mistakes_is_taken(integrand):
    tried(rectangle("q1", (3, 2), warp=bend).mesh, ev.form(integrand), "lower", boundary=False)


def test_trial_sees_places_and_outward_normals():
    """The lid of a unit square: y = 1, normal upwards; the middle of a region lies inside."""
    seen = []

    @ev.form
    def looking(u, v, w):
        seen.append((w.x, w.n))
        return v[0]

    mesh = rectangle("q2", (3, 2)).mesh
    tried(mesh, looking, "top", boundary=True)
    tried(mesh, looking, "lower", boundary=False)
    (x, n), (inside, nowhere) = seen[0], seen[-1]
    np.testing.assert_allclose(x[1], 1.0)
    np.testing.assert_allclose(n[:, :, 0], np.tile([[0.0], [1.0]], 3))
    assert nowhere is None
    assert ((inside > 0.1) & (inside < 0.9)).all()


# -- three dimensions, and refusals ----------------------------------------------------------------------


@pytest.mark.parametrize("dim", [2, 3])
def test_volume_change_keeps_its_digits(dim):
    H = rng.uniform(-0.3, 0.3, (dim, dim, 5))
    F = np.eye(dim)[:, :, None] + H
    np.testing.assert_allclose(volume_change(H), det(F) - 1.0, atol=1e-15)
    np.testing.assert_allclose(volume_change(1e-20 * H), 1e-20 * np.trace(H), rtol=1e-14)


@pytest.mark.parametrize("samples", ["points", "mean"])
def test_engine_in_three_dimensions(samples):
    """Two distorted hexahedra of neo-Hookean tissue: forces are the complex step of the energy
    written out, tangents central differences of the forces. theta is ln J of the point, or the
    cell's mean of it."""
    mesh = skfem.MeshHex.init_tensor(np.array([0.0, 1.0, 2.0]), *[np.array([0.0, 1.0])] * 2)
    mesh = type(mesh)(mesh.p + rng.uniform(-0.1, 0.1, mesh.p.shape), mesh.t)
    basis = skfem.Basis(mesh, skfem.ElementHex1(), intorder=2)
    gradient, weight = shape_gradients(basis), np.asarray(basis.dx)
    Pi = None
    if samples == "mean":
        Pi = np.repeat((weight / weight.sum(axis=1, keepdims=True))[:, None], weight.shape[1], axis=1)
    nodes = basis.element_dofs.T
    x = np.asarray(basis.global_coordinates())
    points = Points(
        np.arange(2), nodes, shape_values(basis), gradient, weight, x, VolumeMeasure(gradient, Pi, False)
    )
    w = SimpleNamespace(mu=MU, lmbda=LMBDA)
    integral = Integral(forms.neo_hookean, points, Parts(3, grad=True, theta=True), w, at_once=True)

    def energy(u):
        F = np.einsum("cni,cqnj->ijcq", u[nodes], gradient) + np.eye(3)[:, :, None, None]
        theta = np.log(det(F)) if Pi is None else np.einsum("cqs,cs->cq", Pi, np.log(det(F)))
        return np.sum(
            weight * (0.5 * MU * (np.sum(F * F, axis=(0, 1)) - 3 - 2 * theta) + 0.5 * LMBDA * theta**2)
        )

    u = rng.uniform(-0.1, 0.1, (mesh.p.shape[1], 3))
    z, expected = u.astype(complex), np.empty_like(u)
    for index in np.ndindex(u.shape):
        z[index] += 1e-30j
        expected[index] = energy(z).imag / 1e-30
        z[index] = u[index]
    np.testing.assert_allclose(integral.forces(u), expected, atol=1e-14)
    column, step = 5, np.zeros_like(u)
    step.flat[column] = 1e-5
    K = np.zeros((u.size, u.size))
    for cell, block in zip(nodes, integral.cell_tangents(u), strict=True):
        unknown = (3 * cell[:, None] + [0, 1, 2]).ravel()
        K[np.ix_(unknown, unknown)] += block
    change = (integral.forces(u + step) - integral.forces(u - step)).ravel() / 2e-5
    np.testing.assert_allclose(K[:, column], change, atol=1e-8)


def test_a_node_without_a_counterpart_is_an_error():
    """scikit-fem's unknowns must lie on nodes of ours: the nearest is not good enough."""
    points = rng.uniform(size=(8, 2))
    assert nodes_at(points, points[[5, 2]]).tolist() == [5, 2]
    with pytest.raises(RuntimeError, match="away from the nearest"):
        nodes_at(points, points[[5, 2]] + [[0.0, 0.0], [1e-6, 0.0]])

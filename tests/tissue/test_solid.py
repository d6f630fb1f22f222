"""Hexahedra: patch test, derivatives, rigid motion, convergence, and plane strain as a special
case.
"""

import importlib.util
from functools import cache

import numpy as np
import pytest
from tools.grids import mixed_tangent_of, order, rectangle, solve, tangent_of
from tools.laws import LAWS as EVERY_LAW
from tools.laws import LMBDA, MU, SteepVolume, neo_hookean_stress
from tools.solids import box

from evfem.tissue.dynamics import Dynamics
from evfem.tissue.forms import form
from evfem.tissue.laws import NeoHookean, Yeoh
from evfem.tissue.userforms import make_term
from evfem.tissue.weakform import Tissue


@form
def neo_hookean_form(u, v, w):
    """The neo-Hookean law as a user's form."""
    F = np.eye(3)[:, :, None, None] + u.grad
    return MU * np.sum(F * v.grad, axis=(0, 1)) + (LMBDA * u.theta - MU) * v.theta


LAWS = EVERY_LAW | {"form": neo_hookean_form}
#: the plane element that each hexahedron is, extruded
PLANE = {"hex8": "q1_fbar", "hex27p1": "q2p1"}
every_element = pytest.mark.parametrize("element", list(PLANE))
every_law = pytest.mark.parametrize("law", list(LAWS))
STRETCH = np.array([[0.12, 0.2, 0.05], [-0.07, -0.05, 0.1], [0.03, -0.08, 0.06]])


def bend(x, y, z):
    """A warp that curves every edge and twists every face."""
    return (
        x + 0.06 * np.sin(2.0 * y + x - z),
        y + 0.08 * np.sin(2.5 * x + 0.7 * z),
        z + 0.07 * np.sin(2.0 * x * y + 1.5 * z),
    )


def wavy(points, size=0.06):
    """A smooth displacement field, far from affine."""
    x, y, z = points.T
    waves = np.sin(2 * x + y - z) + y * z, np.cos(3 * x - y) + x * z, np.sin(2 * z - x) + x * y
    return size * np.column_stack(waves)


def stress_of(law, F):
    """P (3, 3) at F (3, 3): the law's own, or the neo-Hookean law's for those that are it."""
    if isinstance(law, SteepVolume):
        J, G = np.linalg.det(F), np.linalg.inv(F).T
        return MU * (F - G) + LMBDA / 4.0 * (J**2 - J**-2) * (J**2 + J**-2) * G
    return law.P(F) if hasattr(law, "P") else neo_hookean_stress(F, MU, LMBDA)


# -- patch test -----------------------------------------------------------------------------------------


@every_law
@every_element
@pytest.mark.parametrize("shape", ["distorted", "curved"])
def test_patch(element, law, shape):
    """Affine displacements give the law's own stress in every cell and no force on an inner node.

    ln J at the centroid leaves forces of 1e-4 here (see the next test). Curved cells map affine
    fields exactly too, but 27 points do not integrate their Jacobian exactly.
    """
    distortion = {"jitter": 0.25} if shape == "distorted" else {"warp": bend}
    space = box(element, (3, 2, 2), **distortion)
    tissue = Tissue(space, {"lower": LAWS[law]})
    points, outside = space.mesh.points, space.mesh.node_sets["outside"]
    u = points @ STRETCH.T
    F = np.eye(3) + STRETCH
    J, P = np.linalg.det(F), stress_of(LAWS[law], F)
    forces = tissue.forces(u)
    inner = np.setdiff1d(np.arange(space.size), outside)
    if shape == "distorted" or element == "hex8":
        assert np.abs(forces[inner]).max() < 1e-14
    np.testing.assert_allclose(forces.T @ points, P * space.weight.sum(), atol=1e-12)
    stress, volume = tissue.cell_stress(u)
    np.testing.assert_allclose(volume, J, rtol=1e-12)
    sigma = P if law == "linear_elastic" else P @ F.T / J
    expected = np.tile(sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], (len(stress), 1))
    np.testing.assert_allclose(stress, expected, atol=1e-12)


# -- derivatives ----------------------------------------------------------------------------------------


@every_law
@every_element
def test_forces_are_the_derivative_of_the_energy_and_tangents_of_the_forces(element, law):
    """Central differences along random directions; two regions, so groups mix."""
    space = box(element, (2, 1, 1), warp=bend, split=lambda x, y, z: x > 0.5)
    tissue = Tissue(space, {"lower": LAWS[law], "upper": Yeoh(c1=0.3, c2=0.2, nu=0.3)})
    u = wavy(space.mesh.points)
    f, K = tissue.forces(u), tangent_of(space, u, tissue)
    scale = abs(K).max()
    for direction in np.random.default_rng(3).normal(size=(3, *u.shape)):
        h = 1e-4
        ends = [tissue.energy(u + s * h * direction) for s in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
        assert slope == pytest.approx(np.sum(f * direction), rel=2e-8)
        ends = [tissue.forces(u + s * h * direction) for s in (1, -1, 2, -2)]
        slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
        np.testing.assert_allclose(K @ direction.ravel(), slope.ravel(), atol=2e-9 * scale)
    cells = tissue.regions[0][1].cell_tangents(u)
    assert np.abs(cells - np.swapaxes(cells, 1, 2)).max() < 1e-9 * np.abs(cells).max()


# -- compiled loops --------------------------------------------------------------------------------------


def test_loops_of_hexahedra_are_used_where_they_were_built():
    tissue = Tissue(box("hex8", (1, 1, 1)), {"lower": LAWS["neo_hookean"]})
    built = importlib.util.find_spec("evfem.tissue.kernels.solids") is not None
    assert (tissue.loops is not None) == built


@every_element
def test_compiled_tissue_is_the_form(element):
    """Nine cells of two regions: forces, energy, tangents, pressures and their changes."""
    space = box(element, (3, 3, 1), warp=bend, split=lambda x, y, z: x + y > 1.0)
    laws = {"lower": NeoHookean(E=0.8, nu=0.3), "upper": NeoHookean(E=3.0, nu=0.4999)}
    fast, plain = Tissue(space, laws), Tissue(space, laws)
    plain.loops = None
    u, du = wavy(space.mesh.points), wavy(space.mesh.points[:, ::-1])
    q = np.random.default_rng(4).uniform(-0.2, 0.1, space.weight.shape)
    for of in (
        lambda tissue: tissue.forces(u),
        lambda tissue: tangent_of(space, u, tissue).toarray(),
        lambda tissue: mixed_tangent_of(tissue, u, q).toarray(),
        lambda tissue: tissue.pressure(u),
        lambda tissue: tissue.pressure_change(u, du),
        lambda tissue: tissue.pressure_forces(u, q),
        lambda tissue: np.array([tissue.energy(u), tissue.smallest_J(u)]),
        lambda tissue: np.column_stack(tissue.cell_stress(u)),
    ):
        expected = of(plain)
        np.testing.assert_allclose(of(fast), expected, atol=2e-12 * np.abs(expected).max())


@every_element
def test_compiled_viscosity_is_the_form(element):
    """And its dissipation, in cells of different viscosity, one of which has none."""
    space = box(element, (3, 3, 1), warp=bend)
    start, u = wavy(space.mesh.points), wavy(space.mesh.points, 0.08)
    eta = np.linspace(0.0, 0.3, len(space.nodes))
    fast, plain = Dynamics(space, eta, None), Dynamics(space, eta, None)
    plain.loops = None
    for term in (fast, plain):
        term.begin(start, 0 * u, 2e-3)
    forces, K = plain.forces(u), tangent_of(space, u, plain).toarray()
    np.testing.assert_allclose(fast.forces(u), forces, atol=1e-12 * np.abs(forces).max())
    np.testing.assert_allclose(tangent_of(space, u, fast).toarray(), K, atol=1e-12 * np.abs(K).max())
    assert fast.dissipation(u) == pytest.approx(plain.dissipation(u), rel=1e-12)


@every_element
def test_inverted_states_are_seen(element):
    """A state turned inside out has negative J and forces that are not numbers."""
    space = box(element, (2, 1, 1))
    u = space.mesh.points * [-2.0, 0.0, 0.0]
    for tissue in (Tissue(space, {"lower": LAWS[law]}) for law in ("neo_hookean", "yeoh")):
        assert tissue.smallest_J(u) == pytest.approx(-1.0)
        assert np.isnan(tissue.forces(u)).any()


# -- convergence ----------------------------------------------------------------------------------------


def swell(x, y, z):
    """A smooth displacement with volume changes, and F: (3, ...), (3, 3, ...)."""
    s = [np.sin(2 * x + y + z), np.cos(3 * y - z), np.sin(x - 2 * z)]
    c = [np.cos(2 * x + y + z), -np.sin(3 * y - z), np.cos(x - 2 * z)]
    zero = np.zeros_like(x)
    H = np.array([[2 * c[0], c[0], c[0]], [zero, 3 * c[1], -c[1]], [c[2], zero, -2 * c[2]]])
    return 0.06 * np.array(s), 0.06 * H + np.eye(3).reshape((3, 3) + (1,) * np.ndim(x))


def isochoric(x, y, z):
    """Three shears, one after the other: J = 1 everywhere."""
    X = x + 0.15 * np.sin(2.0 * y)
    Y = y + 0.12 * np.sin(2.0 * z + X)
    Z = z + 0.15 * np.sin(2.5 * X)
    zero, one = np.zeros_like(x), np.ones_like(x)
    dX = np.array([one, 0.3 * np.cos(2.0 * y), zero])
    slope = 0.12 * np.cos(2.0 * z + X)
    dY = np.array([zero, one, zero]) + slope * (dX + np.array([zero, zero, 2.0 * one]))
    dZ = np.array([zero, zero, one]) + 0.375 * np.cos(2.5 * X) * dX
    return np.array([X - x, Y - y, Z - z]), np.array([dX, dY, dZ])


@cache
def manufactured_error(element, field, nu, n):
    """L2 error on n x n x n cells for the load int P(F) : grad v of `field` and its values
    outside.
    """
    law = NeoHookean(E=1.0, nu=nu)
    space = box(element, (n, n, n), warp=bend)
    exact = field(*space.mesh.points.T)[0].T
    _, F = field(*space.points)
    P = neo_hookean_stress(F, law.mu, law.lmbda)
    load = np.zeros((space.size, 3))
    np.add.at(load, space.nodes, np.einsum("ijeq,eqaj,eq->eai", P, space.gradient, space.weight))
    free = np.ones_like(exact, dtype=bool)
    free[space.mesh.node_sets["outside"]] = False
    u = solve(Tissue(space, {"lower": law}), exact, free, load)
    difference = np.einsum("qa,eai->ieq", space.value, u[space.nodes]) - field(*space.points)[0]
    return float(np.sqrt(np.sum(difference**2 * space.weight)))


def errors_of(element, field, nu):
    return [manufactured_error(element, field, nu, n) for n in ((4, 8) if element == "hex8" else (2, 4))]


@every_element
def test_order_of_convergence_and_no_locking(element):
    """2 and 3 (less what coarse meshes cost), and at nu = 0.4999 nearly the same errors as at 0.3."""
    assert order(errors_of(element, swell, 0.3)) >= (1.75 if element == "hex8" else 2.6)
    soft, stiff = (errors_of(element, isochoric, nu)[-1] for nu in (0.3, 0.4999))
    assert stiff == pytest.approx(soft, rel=0.25)


# -- plane strain as a special case ---------------------------------------------------------------------


@every_element
def test_strip_between_fixed_sides_is_plane_strain(element):
    """Half as deep as wide, z held: displacements and forces per depth are the plane element's."""

    def flat(x, y):
        return x + 0.06 * np.sin(2.0 * y + x), y + 0.08 * np.sin(2.5 * x)

    plane = rectangle(PLANE[element], (4, 3), warp=flat)
    depth = 0.5
    strip = box(element, (4, 3, 1), (1.0, 1.0, depth), warp=lambda x, y, z: (*flat(x, y), z))
    law = {"lower": NeoHookean(E=0.05, nu=0.48)}
    found = []
    for space in (plane, strip):
        sets, tissue = space.mesh.node_sets, Tissue(space, law)
        u = np.zeros((space.size, space.dim))
        u[:, :2] = space.mesh.points[:, :2] @ [[0.17, 0.0], [0.1, -0.15]]
        free = np.ones_like(u, dtype=bool)
        free[np.union1d(sets["top"], sets["bottom"])] = False
        free[:, 2:] = False
        u = solve(tissue, u, free)
        found.append((u, tissue.forces(u), tissue))
    (u2, f2, tissue2), (u3, f3, tissue3) = found
    distance = np.linalg.norm(strip.mesh.points[:, None, :2] - plane.mesh.points[None], axis=2)
    below = distance.argmin(axis=1)
    np.testing.assert_allclose(u3[:, :2], u2[below], atol=1e-12)
    summed = np.stack([np.bincount(below, f3[:, i], plane.size) for i in range(2)], axis=1)
    np.testing.assert_allclose(summed, depth * f2, atol=1e-12)
    assert tissue3.energy(u3) == pytest.approx(depth * tissue2.energy(u2), rel=1e-10)
    stress, J = tissue3.cell_stress(u3)
    assert np.abs(stress[:, 4:]).max() < 1e-12
    assert sorted(J) == pytest.approx(sorted(tissue2.cell_stress(u2)[1]), rel=1e-10)


# -- time, user's forms, the body ------------------------------------------------------------------------


@every_element
def test_traction_on_a_boundary_is_force_per_area(element):
    """A user's form over faces: a traction along the normal sums to the closed surface's zero, on
    one flat side to its area.
    """

    @form
    def pull(u, v, w):
        return -2.0 * np.sum(w.n * v, axis=0)

    flat = box(element, (2, 3, 2), (1.0, 2.0, 1.5), jitter=0.2)
    u = np.zeros((flat.size, 3))
    side = make_term(flat, pull, "right", boundary=True).forces(u)
    np.testing.assert_allclose(side.sum(axis=0), [-2.0 * 3.0, 0.0, 0.0], atol=1e-13)
    pulled = np.flatnonzero(np.abs(side[:, 0]) > 1e-12)
    assert pulled.tolist() == flat.mesh.node_sets["right"].tolist()
    bent = box(element, (2, 2, 2), warp=bend)
    closed = make_term(bent, pull, "outside", boundary=True).forces(np.zeros((bent.size, 3)))
    assert np.abs(closed).max() > 1e-2
    # the area vectors of quadratic faces are of higher degree than the quadrature
    np.testing.assert_allclose(closed.sum(axis=0), 0.0, atol=1e-14 if element == "hex8" else 1e-5)

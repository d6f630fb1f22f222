"""Internal forces and tangents of every element: patch test, derivatives, independent twins,
geometry.
"""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from tools.grids import CELLS, SHAPES, bend, columns_of, fine_points, grid_of, rectangle, tangent_of, wavy
from tools.laws import LAWS, LMBDA, MU

from evfem.errors import InputError
from evfem.tensor import det
from evfem.tissue.forms import embed
from evfem.tissue.laws import NeoHookean, Yeoh
from evfem.tissue.space import ELEMENTS, make_space
from evfem.tissue.weakform import Tissue, check_laws

every_element = pytest.mark.parametrize("element", list(CELLS))
every_law = pytest.mark.parametrize("law", list(LAWS))
STRETCH = np.array([[0.12, 0.2], [-0.07, -0.05]])


def full_stress(law, F):
    """P (3, 3) at in-plane F (2, 2) from the law's public P, or its psi by central differences."""
    if hasattr(law, "P"):
        return law.P(embed(F))
    h, P = 1e-6, np.empty((3, 3))
    for index in np.ndindex(3, 3):
        step = np.zeros((3, 3))
        step[index] = h
        P[index] = (law.psi(embed(F) + step) - law.psi(embed(F) - step)) / (2 * h)
    return P


# -- patch test -----------------------------------------------------------------------------------------


@every_law
@every_element
@pytest.mark.parametrize("shape", ["distorted", "curved"])
def test_patch(element, law, shape):
    """Affine displacements give the law's own stress in every cell and no force on an inner node.

    Origin: P(F) of the law at the constant F; a forgotten Jacobian, wrong node order or a theta
    other than the one the law means breaks it. Curved edges map affine fields exactly too
    (isoparametric).
    """
    distortion = {"jitter": 0.25} if shape == "distorted" else {"warp": bend}
    space = rectangle(element, (3, 3), **distortion)
    tissue = Tissue(space, {"lower": LAWS[law]})
    points, outline = space.mesh.points, space.mesh.node_sets["outline"]
    u = points @ STRETCH.T
    F = np.eye(2) + STRETCH
    J, P = np.linalg.det(F), full_stress(LAWS[law], F)
    forces = tissue.forces(u)
    inner = np.setdiff1d(np.arange(space.size), outline)
    assert np.abs(forces[inner]).max() < 1e-13
    # the boundary forces hold P: sum of f X over the outline = P times the area
    np.testing.assert_allclose(forces.T @ points, P[:2, :2] * space.weight.sum(), atol=2e-9)
    stress, volume = tissue.cell_stress(u)
    np.testing.assert_allclose(volume, J, rtol=1e-13)
    sigma = P if law == "linear_elastic" else P @ embed(F).T / J
    expected = np.tile(sigma[[0, 1, 2, 0], [0, 1, 2, 1]], (len(stress), 1))
    np.testing.assert_allclose(stress, expected, atol=2e-9)


# -- derivatives ----------------------------------------------------------------------------------------


@every_law
@every_element
def test_forces_are_the_derivative_of_the_energy_and_tangents_of_the_forces(element, law):
    """Central differences in a random direction and along single unknowns; two regions, so groups
    mix.
    """
    space = rectangle(element, (2, 2), jitter=0.2, split=lambda x, y: y > 0.5)
    tissue = Tissue(space, {"lower": LAWS[law], "upper": Yeoh(c1=0.3, c2=0.2, nu=0.3)})
    u = wavy(space.mesh.points)
    f, K = tissue.forces(u), tangent_of(space, u, tissue).toarray()
    scale = np.abs(K).max()
    # P only: the energy is work along a path, exact to quadrature
    direction = np.random.default_rng(3).normal(size=u.shape)
    h = 1e-4
    ends = [tissue.energy(u + s * h * direction) for s in (1, -1, 2, -2)]
    slope = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * h)
    assert slope == pytest.approx(np.sum(f * direction), rel=2e-8)
    columns = columns_of(tissue.forces, u, 2e-5)
    np.testing.assert_allclose(K, columns, atol=2e-7 * scale)
    np.testing.assert_allclose(K, K.T, atol=1e-9 * scale)


# -- twins ----------------------------------------------------------------------------------------------


def twin_energy(space, u):
    """Neo-Hookean energy of the element, safe for complex u, on scikit-fem's own shapes.

    theta: ln J pointwise, at the centroid, or its weighted least-squares plane over the points of
    the cell.
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


@every_element
@pytest.mark.parametrize("compiled", [True, False])
def test_forces_equal_the_complex_step_of_an_independent_energy(element, compiled):
    """One energy written from its formula gives energy and forces of every element, compiled or
    not.
    """
    space = rectangle(element, (2, 1), warp=bend)
    tissue = Tissue(space, {"lower": LAWS["neo_hookean"]})
    if not compiled:
        tissue.loops = None
    u = wavy(space.mesh.points).astype(complex)
    forces = np.empty(u.shape)
    for index in np.ndindex(u.shape):
        u[index] += 1e-30j
        forces[index] = twin_energy(space, u).imag / 1e-30
        u[index] = u[index].real
    u = u.real
    assert tissue.energy(u) == pytest.approx(twin_energy(space, u.astype(complex)).real, rel=1e-13)
    np.testing.assert_allclose(tissue.forces(u), forces, atol=2e-14)


@every_element
def test_compiled_kernels_equal_the_plain_path(element):
    space = rectangle(element, (4, 3), warp=bend, split=lambda x, y: x + y > 1.0)
    laws = {"lower": NeoHookean(E=0.8, nu=0.3), "upper": NeoHookean(E=3.0, nu=0.4999)}
    fast, plain = Tissue(space, laws), Tissue(space, laws)
    plain.loops = None
    u = wavy(space.mesh.points)
    forces, K = plain.forces(u), tangent_of(space, u, plain).toarray()
    np.testing.assert_allclose(fast.forces(u), forces, atol=1e-12 * np.abs(forces).max())
    np.testing.assert_allclose(tangent_of(space, u, fast).toarray(), K, atol=1e-12 * np.abs(K).max())
    assert fast.smallest_J(u) == pytest.approx(plain.smallest_J(u), rel=1e-13)
    assert fast.energy(u) == pytest.approx(plain.energy(u), rel=1e-12)
    for found, expected in zip(fast.cell_stress(u), plain.cell_stress(u), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())


def test_compiled_loops_are_used_where_they_were_built():
    import importlib.util

    tissue = Tissue(rectangle("q1", (1, 1)), {"lower": LAWS["neo_hookean"]})
    built = importlib.util.find_spec("evfem.tissue.kernels.loops") is not None
    assert (tissue.loops is not None) == built


# -- geometry and refusals -------------------------------------------------------------------------------


@pytest.mark.parametrize("element", list(CELLS))
def test_tangled_cells_are_refused(element):
    """A corner pulled over the opposite edge: scikit-fem would take the absolute determinant."""
    space = rectangle(element, (2, 2))
    points = space.mesh.points.copy()
    middle = np.argmin(np.hypot(*(points - 0.5).T))
    points[middle] = [1.3, 1.3]
    with pytest.raises(InputError, match="tangled"):
        make_space(replace(space.mesh, points=points), element)


@every_element
@pytest.mark.parametrize("compiled", [True, False])
def test_inverted_states_are_seen(element, compiled):
    """A state turned inside out has negative J and forces that are not numbers, never a finite
    answer.
    """
    space = rectangle(element, (2, 2))
    tissue = Tissue(space, {"lower": LAWS["neo_hookean"]})
    if not compiled:
        tissue.loops = None
    u = space.mesh.points * [-2.0, 0.0]
    assert tissue.smallest_J(u) == pytest.approx(-1.0)
    assert np.isnan(tissue.forces(u)).any()


def test_wrong_elements_and_laws_are_refused():
    quads = rectangle("q1", (1, 1)).mesh
    with pytest.raises(InputError, match="quad9"):
        make_space(quads, "q2")
    with pytest.raises(InputError, match="no material for region lower"):
        check_laws(quads, {})
    with pytest.raises(InputError, match="bone"):
        check_laws(quads, {"lower": LAWS["yeoh"], "bone": LAWS["yeoh"]})

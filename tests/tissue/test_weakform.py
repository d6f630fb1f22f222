"""Internal forces and tangents of every element: patch test, derivatives, independent twins,
geometry.
"""

from dataclasses import replace

import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree
from skfem.helpers import ddot, grad
from tools.grids import CELLS, SHAPES, fine_points, grid_of, order, quarter_ring, rectangle, solve, tangent_of
from tools.laws import StressOnly, neo_hookean_stress

from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.tensor import det, inv, transpose
from evfem.tissue.elements import ELEMENTS
from evfem.tissue.laws import LinearElastic, NeoHookean, Ogden, Yeoh
from evfem.tissue.space import make_space
from evfem.tissue.splitlaw import embed
from evfem.tissue.weakform import Tissue, check_laws

MU, LMBDA = 0.7, 1.9
YOUNG = MU * (3 * LMBDA + 2 * MU) / (LMBDA + MU)
POISSON = LMBDA / (2 * (LMBDA + MU))


class EnergyOnly:
    """A user's law, energy only: neo-Hookean with lambda/8 (J^2 - 1/J^2)^2 / 2 instead of (ln
    J)^2.
    """

    def psi(self, F):
        J = det(F)
        volume = LMBDA / 16.0 * (J**2 - J**-2) ** 2
        return 0.5 * MU * (np.sum(F * F, axis=(0, 1)) - 3.0 - 2.0 * np.log(J)) + volume


LAWS = {
    "neo_hookean": NeoHookean(E=YOUNG, nu=POISSON),
    "yeoh": Yeoh(c1=0.35, c2=0.1, c3=0.02, nu=0.4),
    "ogden": Ogden(mu=[0.9, -0.2], alpha=[2.5, -1.5], bulk=2.0),
    "linear_elastic": LinearElastic(E=YOUNG, nu=POISSON),
    "psi_only": EnergyOnly(),
    "P_only": StressOnly(MU, LMBDA),
}
every_element = pytest.mark.parametrize("element", list(CELLS))
every_law = pytest.mark.parametrize("law", list(LAWS))
STRETCH = np.array([[0.12, 0.2], [-0.07, -0.05]])


def bend(x, y):
    """A warp that curves every edge."""
    return x + 0.06 * np.sin(2.0 * y + x), y + 0.08 * np.sin(2.5 * x)


def wavy(points, size=0.08):
    """A smooth displacement field, far from affine."""
    x, y = points.T
    return size * np.column_stack([np.sin(2 * x + y) + y * y, np.cos(3 * x - y) + x * y])


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


@every_element
def test_patch_is_found_by_newton(element):
    """From nothing but the outline's displacements the inner nodes find the affine field."""
    space = rectangle(element, (3, 3), jitter=0.25)
    tissue = Tissue(space, {"lower": LAWS["neo_hookean"]})
    exact = space.mesh.points @ STRETCH.T
    free = np.ones_like(exact, dtype=bool)
    free[space.mesh.node_sets["outline"]] = False
    u = solve(tissue, np.where(free, 0.5 * exact, exact), free)
    np.testing.assert_allclose(u, exact, atol=1e-12)


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
    columns = np.empty_like(K)
    for i in range(u.size):
        step = np.zeros(u.size)
        step[i] = 2e-5
        step = step.reshape(u.shape)
        columns[:, i] = (tissue.forces(u + step) - tissue.forces(u - step)).ravel() / 4e-5
    np.testing.assert_allclose(K, columns, atol=2e-7 * scale)
    np.testing.assert_allclose(K, K.T, atol=1e-9 * scale)


@every_element
def test_tangent_of_built_in_laws_is_symmetric_to_rounding(element):
    space = rectangle(element, (2, 2), jitter=0.2)
    for law in ("neo_hookean", "yeoh", "ogden", "linear_elastic"):
        ((_, integral),) = Tissue(space, {"lower": LAWS[law]}).regions
        cells = integral.cell_tangents(wavy(space.mesh.points))
        assert np.abs(cells - np.swapaxes(cells, 1, 2)).max() < 2e-13 * np.abs(cells).max()


@every_element
def test_linear_elastic_tissue_is_linear(element):
    """Half the displacements, half the forces, and the tangent is the same everywhere: theta is tr
    e here.
    """
    space = rectangle(element, (2, 2), jitter=0.2)
    tissue = Tissue(space, {"lower": LAWS["linear_elastic"]})
    u = wavy(space.mesh.points)
    np.testing.assert_allclose(tissue.forces(0.5 * u), 0.5 * tissue.forces(u), atol=1e-14)
    K = tangent_of(space, u, tissue)
    np.testing.assert_allclose(K.toarray(), tangent_of(space, 0 * u, tissue).toarray(), atol=1e-13)
    np.testing.assert_allclose(K @ u.ravel(), tissue.forces(u).ravel(), atol=1e-13)
    assert 0.5 * np.sum(u * tissue.forces(u)) == pytest.approx(tissue.energy(u), rel=1e-12)


@every_element
def test_rigid_motion_costs_nothing(element):
    """A rotation by 50 degrees and a shift: no energy, no forces; the tangent knows them
    (objectivity).
    """
    space = rectangle(element, (2, 2), warp=bend)
    for law in ("neo_hookean", "yeoh", "ogden", "psi_only", "P_only"):
        tissue = Tissue(space, {"lower": LAWS[law]})
        c, s = np.cos(0.87), np.sin(0.87)
        u = space.mesh.points @ (np.array([[c, -s], [s, c]]) - np.eye(2)).T + [0.3, -2.0]
        assert np.abs(tissue.forces(u)).max() < 1e-13
        assert abs(tissue.energy(u)) < 1e-13


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


@pytest.mark.parametrize("element", ["q1", "q2", "p2"])
def test_plain_elements_equal_scikit_fem_forms(element):
    """The residual and its linearisation as readable scikit-fem forms, on scikit-fem's own vector
    element.
    """
    space = rectangle(element, (3, 2), warp=bend)
    tissue = Tissue(space, {"lower": LAWS["neo_hookean"]})
    u = wavy(space.mesh.points)
    kind, intorder, _ = ELEMENTS[element]
    basis = skfem.Basis(grid_of(space.mesh), skfem.ElementVector(SHAPES[kind]()), intorder=intorder)
    _, node = cKDTree(space.mesh.points).query(basis.doflocs.T)
    component = np.array([name.endswith("^2") for name in _dof_names(basis)]).astype(int)

    def gradient(w):
        return grad(w["u"]) + np.eye(2)[:, :, None, None]

    @skfem.LinearForm
    def residual(v, w):
        F = gradient(w)
        return ddot(neo_hookean_stress(F, MU, LMBDA), grad(v))

    @skfem.BilinearForm
    def stiffness(du, v, w):
        F = gradient(w)
        G, dF = transpose(inv(F)), grad(du)
        turned = np.einsum("ij...,kj...,kl...->il...", G, dF, G)
        change = MU * dF + LMBDA * ddot(G, dF) * G - (LMBDA * np.log(det(F)) - MU) * turned
        return ddot(change, grad(v))

    field = basis.interpolate(u[node, component])
    here = 2 * node + component
    np.testing.assert_allclose(residual.assemble(basis, u=field), tissue.forces(u).ravel()[here], atol=1e-14)
    ours = tangent_of(space, u, tissue).toarray()[np.ix_(here, here)]
    np.testing.assert_allclose(
        stiffness.assemble(basis, u=field).toarray(), ours, atol=1e-12 * np.abs(ours).max()
    )


def _dof_names(basis):
    """`u^1` or `u^2` of every unknown of a scikit-fem vector basis."""
    names = np.empty(basis.N, dtype=object)
    for table, titles in (
        (basis.nodal_dofs, basis.elem.dofnames[: len(basis.nodal_dofs)]),
        (basis.facet_dofs, None),
        (basis.interior_dofs, None),
    ):
        for row, dofs in enumerate(table):
            names[dofs] = titles[row] if titles else f"u^{row + 1}"
    return names


def test_fbar_is_de_souza_netos():
    """int (J/J0)^(1/2) P(Fbar) : grad v with Fbar = (J0/J)^(1/2) F in the plane, from P alone.

    Pull-back of int sigma(Fbar) : grad_x v dv (10.1016/0020-7683(95)00259-6). Equal to the
    potential form for the neo-Hookean law because the cofactor of a bilinear cell integrates to
    its value at the centroid.
    """
    space = rectangle("q1_fbar", (3, 3), jitter=0.25)
    u = wavy(space.mesh.points)
    _, dx, _, gradient, nodes = fine_points(space, 3)
    basis = skfem.Basis(
        grid_of(space.mesh), skfem.ElementQuad1(), quadrature=(np.array([[0.5], [0.5]]), np.array([1.0]))
    )
    middle = np.stack([basis.basis[a][0].grad for a in range(4)])
    F, F0 = (
        np.einsum("ajeq,eai->ijeq", g, u[nodes]) + np.eye(2)[:, :, None, None] for g in (gradient, middle)
    )
    ratio = det(F) / det(F0)
    P = LAWS["P_only"].P(embed(F / np.sqrt(ratio)))[:2, :2]
    fe = np.einsum("eq,ijeq,ajeq->eai", dx * np.sqrt(ratio), P, gradient)
    expected = np.zeros_like(u)
    np.add.at(expected, nodes, fe)
    law = LAWS["neo_hookean"]
    np.testing.assert_allclose(Tissue(space, {"lower": law}).forces(u), expected, atol=1e-14)


# -- geometry and refusals -------------------------------------------------------------------------------


@pytest.mark.parametrize(("element", "rate"), [("q2p1", 4.0), ("p2", 4.0), ("q1", 2.0)])
def test_area_of_a_ring(element, rate):
    """Curved cells hold a quarter of a ring's area to fourth order, straight ones to second."""
    exact = 0.25 * np.pi * 3.0
    errors = []
    for n in (4, 8, 16):
        weight = rectangle(element, (n, n), warp=quarter_ring(1.0, 2.0)).weight
        errors.append(abs(weight.sum() - exact))
    assert order(errors) == pytest.approx(rate, abs=0.1)


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


def test_orientation_of_all_cells_does_not_matter():
    """Cells numbered clockwise give the same forces (Gmsh writes either)."""
    mesh = rectangle("q1", (2, 2), jitter=0.2).mesh
    turned = Mesh(
        mesh.points, mesh.cells[:, [0, 3, 2, 1]], "quad", mesh.region, mesh.region_names, mesh.node_sets
    )
    u = wavy(mesh.points)
    a, b = (Tissue(make_space(m, "q1"), {"lower": LAWS["yeoh"]}).forces(u) for m in (mesh, turned))
    np.testing.assert_allclose(a, b, atol=1e-15)

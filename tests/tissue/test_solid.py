"""Hexahedra: convergence, plane strain as a special case, and tractions on their faces."""

from functools import cache

import numpy as np
import pytest
from tools.grids import order, rectangle, solve
from tools.laws import neo_hookean_stress
from tools.solids import bend, box

from evfem.tissue.forms import form
from evfem.tissue.laws import NeoHookean
from evfem.tissue.userforms import make_term
from evfem.tissue.weakform import Tissue

#: the plane element that each hexahedron is, extruded
PLANE = {"hex8": "q1_fbar", "hex27p1": "q2p1"}
every_element = pytest.mark.parametrize("element", list(PLANE))


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
    """L2 error on n x n x n cells for the load int P(F) : grad v of `field` and its values outside."""
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

"""Faces of hexahedra as surfaces: their shape functions, and how thick a layer is below them.

A face has 4 corners, and on quadratic cells 4 middles of its edges and its centre, counter-clockwise
seen from outside; its two coordinates go from -1 to 1.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh, interface_of

#: corners, middles of the edges and centre of a face, in the order of its nodes
PLACES = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)], dtype=float)
#: starts of the search for the nearest place of a face, so many each way; the nearest that are tried
STARTS, TRIED, ITERATIONS = 5, 8, 15


def shape_functions(nodes: int, places: Floats) -> tuple[Floats, Floats]:
    """Values (..., m) and derivatives (..., m, 2) of the m = 4 or 9 shape functions at places (...,
    2).

    >>> value, slope = shape_functions(9, PLACES)
    >>> bool(np.allclose(value, np.eye(9))), bool(np.allclose(slope.sum(axis=1), 0.0))
    (True, True)
    """

    def along(t: Floats, at: Floats) -> tuple[Floats, Floats]:
        if nodes == 4:
            return 0.5 * (1.0 + t * at), 0.5 * at + 0.0 * t
        middle = at == 0.0
        value = np.where(middle, 1.0 - t**2, 0.5 * t * (t + at))
        return value, np.where(middle, -2.0 * t, t + 0.5 * at)

    (a, da), (b, db) = (along(places[..., i, None], PLACES[:nodes, i]) for i in (0, 1))
    return a * b, np.stack([da * b, a * db], axis=-1)


def layer_thickness(mesh: Mesh, region: str, nodes: Ints) -> Floats:
    """Distance (mm) of each of `nodes` from the inner interface of a region of hexahedra: the
    thickness of that layer there. `evfem.mesh.mesh.layer_thickness` is the same in the plane.

    The interface is every face that a cell of `region` shares with a cell of another region. Raises
    `InputError` if there is no such region or interface.
    """
    return _distance(mesh.points[nodes], mesh.points[interface_of(mesh, region)])


def _distance(points: Floats, patches: Floats) -> Floats:
    """Smallest distance of points (P, 3) from faces (K, m, 3): Gauss and Newton's method from the
    nearest of some places on every face.
    """
    from scipy.spatial import cKDTree

    m = patches.shape[1]
    starts = np.array(list(product(np.linspace(-1.0, 1.0, STARTS), repeat=2)))
    samples = np.einsum("sm,kmc->ksc", shape_functions(m, starts)[0], patches).reshape(-1, 3)
    _, nearest = cKDTree(samples).query(points, min(TRIED, len(samples)))
    face, at = patches[nearest // len(starts)], starts[nearest % len(starts)]
    for _ in range(ITERATIONS):
        value, slope = shape_functions(m, at)
        away = points[:, None] - np.einsum("ptm,ptmc->ptc", value, face)
        ways = np.einsum("ptma,ptmc->ptac", slope, face)
        normal = np.einsum("ptac,ptbc->ptab", ways, ways)
        pull = np.einsum("ptac,ptc->pta", ways, away)
        at = np.clip(at + np.linalg.solve(normal, pull[..., None])[..., 0], -1.0, 1.0)
    away = points[:, None] - np.einsum("ptm,ptmc->ptc", shape_functions(m, at)[0], face)
    return np.asarray(np.linalg.norm(away, axis=2).min(axis=1))

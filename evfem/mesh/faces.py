"""Sides of cells, edges and faces: their shape functions, and how thick a layer is below them.

An edge has 2 ends, and on quadratic cells a middle. A face has 4 corners, and on quadratic cells 4
middles of its edges and its centre, counter-clockwise seen from outside. Coordinates go from -1 to 1.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh, interface_of

#: corners, middles of the edges and centre of a face, in the order of its nodes; the same of an edge
PLACES = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)], dtype=float)
LINE = np.array([[-1.0], [1.0], [0.0]])
#: starts of the search for the nearest place of a face, so many each way; the nearest that are tried; most
#: iterations, and the change of a place that ends them
STARTS, TRIED, ITERATIONS, CLOSE = 5, 8, 30, 1e-9


def shape_functions(nodes: int, places: Floats) -> tuple[Floats, Floats]:
    """Values (..., m) and derivatives (..., m, d) at places (..., d) of the m = 4 or 9 shape functions
    of a face (d = 2), or 2 or 3 of an edge (d = 1).

    >>> value, slope = shape_functions(9, PLACES)
    >>> bool(np.allclose(value, np.eye(9))), bool(np.allclose(slope.sum(axis=1), 0.0))
    (True, True)
    """
    corners = PLACES if places.shape[-1] == 2 else LINE

    def along(t: Floats, at: Floats) -> tuple[Floats, Floats]:
        if nodes in (2, 4):
            return 0.5 * (1.0 + t * at), 0.5 * at + 0.0 * t
        middle = at == 0.0
        value = np.where(middle, 1.0 - t**2, 0.5 * t * (t + at))
        return value, np.where(middle, -2.0 * t, t + 0.5 * at)

    (a, da), *other = (along(places[..., i, None], corner) for i, corner in enumerate(corners[:nodes].T))
    if not other:
        return a, da[..., None]
    ((b, db),) = other
    return a * b, np.stack([da * b, a * db], axis=-1)


def layer_thickness(mesh: Mesh, region: str, nodes: Ints) -> Floats:
    """Distance (mm) of each of `nodes` from the inner interface of a region: the thickness of that
    layer there.

    The interface is every edge (in space: face) that a cell of `region` shares with a cell of another
    region. Raises `InputError` if there is no such region or interface. Gauss and Newton's method
    searches from the nearest of some places on every one.
    """
    points, patches = mesh.points[nodes], mesh.points[interface_of(mesh, region)]
    m, dim = patches.shape[1:]
    starts = np.array(list(product(np.linspace(-1.0, 1.0, STARTS), repeat=dim - 1)))
    samples = np.einsum("sm,kmc->ksc", shape_functions(m, starts)[0], patches).reshape(-1, dim)
    nearest = _nearest(points, samples)
    patch, at = patches[nearest // len(starts)], starts[nearest % len(starts)]
    for _ in range(ITERATIONS):
        value, slope = shape_functions(m, at)
        away = points[:, None] - np.einsum("ptm,ptmc->ptc", value, patch)
        ways = np.einsum("ptma,ptmc->ptac", slope, patch)
        normal = np.einsum("ptac,ptbc->ptab", ways, ways)
        pull = np.einsum("ptac,ptc->pta", ways, away)
        before, at = at, np.clip(at + np.linalg.solve(normal, pull[..., None])[..., 0], -1.0, 1.0)
        if np.abs(at - before).max() < CLOSE:
            break
    away = points[:, None] - np.einsum("ptm,ptmc->ptc", shape_functions(m, at)[0], patch)
    return np.asarray(np.linalg.norm(away, axis=2).min(axis=1))


def _nearest(points: Floats, samples: Floats) -> Ints:
    """Numbers of the samples (S, d) that are nearest to each of the points (P, d)."""
    most = min(TRIED, len(samples))
    if points.shape[1] == 3:
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(samples).query(points, most)[1])
    chunks = np.array_split(points, len(points) // 256 + 1)  # so few need no tree, whose import is slow
    away = (((chunk[:, None] - samples) ** 2).sum(axis=-1) for chunk in chunks)
    return np.concatenate([np.argpartition(one, most - 1, axis=1)[:, :most] for one in away])

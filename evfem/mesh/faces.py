"""Sides of cells, edges and faces: their shape functions, how thick a layer is below them, and where
vertical lines cross them.

An edge has 2 ends, and on quadratic cells a middle. A face has 4 corners, and on quadratic cells 4
middles of its edges and its centre, counter-clockwise seen from outside. Coordinates go from -1 to 1.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints, linalg
from evfem.mesh.hexahedron import PLACES as HEXAHEDRON
from evfem.mesh.mesh import Mesh, interface_of

#: corners, middles of the edges and centre of a face, in the order of its nodes
PLACES = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0)], dtype=float)
#: the same of an edge, and of a hexahedron, by dimensions; and of a triangle
NODES = {1: np.array([[-1.0], [1.0], [0.0]]), 2: PLACES, 3: HEXAHEDRON.astype(float)}
TRIANGLE = np.array([(-1, -1), (1, -1), (-1, 1), (0, -1), (0, 0), (-1, 0)], dtype=float)
#: closest-point search on a face: number of starting points along each axis, of starting points that are
#: iterated, largest number of iterations, and the change of coordinates that ends them
STARTS, TRIED, ITERATIONS, CLOSE = 5, 8, 30, 1e-9
#: tolerance, in reference coordinates, within which a point outside a side or cell belongs to it
ON = 1e-8
#: distance from the centre, in reference coordinates, at which a search is abandoned
FAR = 10.0

Shape = Callable[[Floats], tuple[Floats, Floats]]


def node_places(nodes: int, dim: int) -> Floats:
    """Places (m, d) of the nodes of an edge (2, 3), a triangle (3, 6), a quad (4, 9) or a cube (8, 27)."""
    return (TRIANGLE if dim == 2 and nodes in (3, 6) else NODES[dim])[:nodes]


def shape_functions(nodes: int, points: Floats) -> tuple[Floats, Floats]:
    """Values (..., m) and derivatives (..., m, d) at points (..., d) of the shape functions of such nodes.

    >>> value, slope = shape_functions(9, PLACES)
    >>> bool(np.allclose(value, np.eye(9))), bool(np.allclose(slope.sum(axis=1), 0.0))
    (True, True)
    """
    if points.shape[-1] == 2 and nodes in (3, 6):
        return _of_a_triangle(nodes, points)
    t, at = points[..., None], NODES[points.shape[-1]][:nodes].T
    if nodes == 2 ** len(at):
        value, slope = 0.5 * (1.0 + t * at), 0.5 * at + 0.0 * t
    else:
        middle = at == 0.0
        value = np.where(middle, 1.0 - t**2, 0.5 * t * (t + at))
        slope = np.where(middle, -2.0 * t, t + 0.5 * at)
    along = np.eye(len(at), dtype=bool)[..., None]
    factors = np.where(along, slope[..., None, :, :], value[..., None, :, :])
    return value.prod(axis=-2), np.swapaxes(factors.prod(axis=-2), -1, -2)


def _of_a_triangle(nodes: int, points: Floats) -> tuple[Floats, Floats]:
    """The same by area coordinates."""
    area = 0.5 * np.concatenate([-points.sum(axis=-1, keepdims=True), 1.0 + points], axis=-1)
    slope = np.broadcast_to([[-0.5, -0.5], [0.5, 0.0], [0.0, 0.5]], (*area.shape, 2))
    if nodes == 3:
        return area, slope
    after, along, a = np.roll(area, -1, axis=-1), np.roll(slope, -1, axis=-2), area[..., None]
    slopes = [(4.0 * a - 1.0) * slope, 4.0 * (after[..., None] * slope + a * along)]
    return np.concatenate([area * (2.0 * area - 1.0), 4.0 * area * after], -1), np.concatenate(slopes, -2)


def layer_thickness(mesh: Mesh, region: str, nodes: Ints) -> Floats:
    """Distance (mm) of each of `nodes` from the inner interface of a region: the thickness of that
    layer there.

    The interface is every edge (in space: face) that a cell of `region` shares with a cell of another
    region. Raises `InputError` if there is no such region or interface. Gauss and Newton's method
    iterations from the nearest of some points on every one.
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
        tangents = np.einsum("ptma,ptmc->ptac", slope, patch)
        normal = np.einsum("ptac,ptbc->ptab", tangents, tangents)
        pull = np.einsum("ptac,ptc->pta", tangents, away)
        before, at = at, np.clip(at + np.linalg.solve(normal, pull[..., None])[..., 0], -1.0, 1.0)
        if np.abs(at - before).max() < CLOSE:
            break
    away = points[:, None] - np.einsum("ptm,ptmc->ptc", shape_functions(m, at)[0], patch)
    return np.asarray(np.linalg.norm(away, axis=2).min(axis=1))


def _nearest(points: Floats, samples: Floats) -> Ints:
    """Numbers of the samples (S, d) that are nearest to each of the points (P, d)."""
    most = min(TRIED, len(samples))
    if points.shape[1] == 3:
        linalg()  # before scipy.spatial brings its BLAS
        from scipy.spatial import cKDTree

        return np.asarray(cKDTree(samples).query(points, most)[1])
    chunks = np.array_split(points, len(points) // 256 + 1)  # so few need no tree, whose import is slow
    away = (((chunk[:, None] - samples) ** 2).sum(axis=-1) for chunk in chunks)
    return np.concatenate([np.argpartition(one, most - 1, axis=1)[:, :most] for one in away])


def inverted(shape: Shape, nodes: Floats, target: Floats, start: Floats) -> Floats:
    """Places (C, d) where patches with nodes (C, n, d) reach a target (d,), by Newton's method; inf where
    it does not come there.
    """
    xi = np.tile(start, (len(nodes), 1))
    with np.errstate(all="ignore"):  # a point that is not found is nan
        for _ in range(ITERATIONS):
            value, slope = shape(xi)
            away = target - np.einsum("cn,cnk->ck", value, nodes)
            jacobian = np.einsum("cnk,cnl->ckl", nodes, slope)
            lost = ~((np.abs(np.linalg.det(jacobian)) > 0.0) & (np.abs(xi - start) < FAR).all(axis=1))
            jacobian[lost], away[lost] = np.eye(len(target)), np.nan
            step = np.linalg.solve(jacobian, away[..., None])[..., 0]
            xi = xi + step
            if not np.any(np.abs(step) > CLOSE):
                break
    return np.where(np.abs(step) <= CLOSE, xi, np.inf)


def crossings(mesh: Mesh, region: str | None, level: Floats) -> list[Floats]:
    """Heights, from below, at which the boundary of a region (None: of all tissue) is crossed by vertical
    lines at x (and z), level (P, d - 1).
    """
    sides, (_, number) = mesh.cell_sides, mesh.sides
    if region is not None:
        inside = mesh.region == mesh.region_names[region]
        sides, number = sides[inside], number[inside]
    patches = mesh.points[sides[np.bincount(number.ravel())[number] == 1]]
    flat = np.delete(patches, 1, axis=2)
    margin = 0.2 * np.ptp(flat, axis=1)
    low, high = flat.min(axis=1) - margin, flat.max(axis=1) + margin

    shape = partial(shape_functions, patches.shape[1])
    found = []
    for sought in level:
        near = np.flatnonzero(((low <= sought) & (sought <= high)).all(axis=1))
        xi = inverted(shape, flat[near], sought, np.zeros(len(sought)))
        on = (np.abs(xi) <= 1.0 + ON).all(axis=1)
        y = np.sort(np.einsum("cn,cn->c", shape(xi[on])[0], patches[near[on], :, 1]))
        # a line through the end of two sides meets both
        found.append(y[np.diff(y, prepend=-np.inf) > 1e-9 * np.ptp(mesh.points)])
    return found

"""Shape of cells: the scaled Jacobian."""

from __future__ import annotations

import numpy as np

from evfem.mesh import Floats, Mesh

#: Corner, mid-edge and middle nodes of a quad in -1..1, and of a triangle in 0..1, in VTK order.
SQUARE = ((-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0), (0, 0))
TRIANGLE = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5))


def scaled_jacobian(mesh: Mesh) -> Floats:
    """Smallest scaled Jacobian of each cell, (E,), over all its nodes: 1 for a square or equilateral
    triangle.

    det(t1, t2) / (|t1| |t2|) with the tangents of the cell's own, possibly curved, coordinate lines at the
    node; in triangles the longest two of the three directions count, and sin 60 degrees is divided out.
    Zero or less: the cell is degenerate or turned inside out.

    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> square = Mesh(corners, np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, dtype=int), {"skin": 0})
    >>> scaled_jacobian(square).tolist()
    [1.0]
    """
    slopes_at = _square_slopes if mesh.corners == 4 else _triangle_slopes
    x = mesh.points[mesh.cells]
    smallest = np.full(len(x), np.inf)
    for place in (SQUARE if mesh.corners == 4 else TRIANGLE)[: mesh.cells.shape[1]]:
        t = slopes_at(place, mesh.order) @ x
        det = t[:, 0, 0] * t[:, 1, 1] - t[:, 0, 1] * t[:, 1, 0]
        first, second = np.hypot(t[:, 0, 0], t[:, 0, 1]), np.hypot(t[:, 1, 0], t[:, 1, 1])
        lengths = first * second
        if mesh.corners == 3:
            third = np.hypot(*(t[:, 1] - t[:, 0]).T)
            lengths = np.maximum(lengths, third * np.maximum(first, second)) * np.sqrt(0.75)
        smallest = np.minimum(smallest, det / np.maximum(lengths, 1e-300))
    return smallest


def _square_slopes(place: tuple[float, float], order: int) -> Floats:
    """Derivatives (2, nodes) of a quad's shape functions at a place."""
    (f, df), (g, dg) = (_line(s, order) for s in place)
    i, j = (np.array(SQUARE[: (order + 1) ** 2]).T + 1) // (3 - order)
    return np.array([df[i] * g[j], f[i] * dg[j]])


def _line(s: float, order: int) -> tuple[Floats, Floats]:
    """Shape functions of a line at s, in rising order of their nodes, and their derivatives."""
    if order == 1:
        return np.array([1.0 - s, 1.0 + s]) / 2.0, np.array([-0.5, 0.5])
    return np.array([s * (s - 1.0) / 2.0, 1.0 - s * s, s * (s + 1.0) / 2.0]), np.array(
        [s - 0.5, -2.0 * s, s + 0.5]
    )


def _triangle_slopes(place: tuple[float, float], order: int) -> Floats:
    """Derivatives (2, nodes) of a triangle's shape functions at a place."""
    d = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
    if order == 1:
        return d
    area = np.array([1.0 - place[0] - place[1], *place])
    following = np.roll(np.arange(3), -1)
    return np.hstack([d * (4.0 * area - 1.0), 4.0 * (d * area[following] + area * d[:, following])])

r"""Blocks of hexahedra in parameters: columns (u, v) of a surface patch, rows r inwards, columns
merged three to one on the way.

A row either has the same columns above and below, or merges three columns of one direction by the
template of `evfem.finger.lattice` in the plane of that direction and r, swept along the other one:

    o0---o1---o2---o3      outside
     |   p1---p2    |
     | /         \\  |
    i0-------------i1      inside
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from evfem.common.arrays import Floats
from evfem.finger.lattice import MIDDLE
from evfem.mesh.mesh import Mesh, raised

#: parameters of the cells' corners count as the same if they agree to this many digits
DIGITS = 9
#: corners (u in thirds of the merged column, r) of the template's four cells
TEMPLATE = np.array(
    [
        [(1, 0), (2, 0), (2, MIDDLE), (1, MIDDLE)],
        [(0, 0), (1, 0), (1, MIDDLE), (0, 1)],
        [(2, 0), (3, 0), (3, 1), (2, MIDDLE)],
        [(1, MIDDLE), (2, MIDDLE), (3, 1), (0, 1)],
    ]
)
PLAIN = np.array([[(0, 0), (1, 0), (1, 1), (0, 1)]])


def block(columns: tuple[int, int], rows: int, merging: Sequence[Sequence[int]], order: int) -> Mesh:
    """Hexahedra with points (u, v, r): u and v from 0 to 1, r from 0 to `rows`; `region` is the row.

    `columns` are those of the last row in u and in v; in the rows `merging[0]` three columns in u
    become one, in `merging[1]` in v.

    >>> mesh = block((2, 1), 2, [[0], []], order=1)
    >>> np.bincount(mesh.region).tolist(), len(mesh.points)
    ([8, 2], 34)
    """
    cells = [_row(columns, r, merging) for r in range(rows)]
    corners = np.concatenate(cells).round(DIGITS)
    points, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    region = np.repeat(np.arange(rows), [len(row) for row in cells])
    mesh = Mesh(points, number.reshape(-1, 8), "hexahedron", region, {})
    return raised(mesh) if order == 2 else mesh


def _row(columns: tuple[int, int], r: int, merging: Sequence[Sequence[int]]) -> Floats:
    """Corners (E, 8, 3) of the cells of a row."""
    below = [n * 3 ** sum(row > r for row in rows) for n, rows in zip(columns, merging, strict=True)]
    merged = [r in rows for rows in merging]
    if all(merged):
        raise ValueError("a row merges columns of one direction alone")
    across = 1 if merged[1] else 0
    quads = _quads(below[across], r, merged[across])
    count = below[1 - across]
    swept = np.empty((len(quads), count, 8, 3))
    swept[..., across] = np.tile(quads[..., 0], 2)[:, None]
    swept[..., 2] = np.tile(quads[..., 1], 2)[:, None]
    place = np.arange(count)[:, None] + np.repeat([0, 1], 4)
    swept[..., 1 - across] = place / count
    return swept.reshape(-1, 8, 3)


def _quads(count: int, r: int, merged: bool) -> Floats:
    """Corners (K, 4, 2) of the cells of a row in one direction and r; `count` columns below it."""
    shape = TEMPLATE / [3.0, 1.0] if merged else PLAIN
    cells = np.array([[(i + u, r + s) for u, s in cell] for i, cell in product(range(count), shape)])
    return cells / [count, 1.0]

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

import numpy as np

from evfem.common.arrays import Floats
from evfem.finger.lattice import quads
from evfem.mesh.mesh import Mesh, raised

#: parameters of the cells' corners count as the same if they agree to this many digits
DIGITS = 9


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
    starts = np.arange(below[across]) / below[across]
    cells = quads(starts, np.full_like(starts, 1.0 / below[across]), r, merged[across])
    count = below[1 - across]
    swept = np.empty((len(cells), count, 8, 3))
    swept[..., across] = np.tile(cells[..., 0], 2)[:, None]
    swept[..., 2] = np.tile(cells[..., 1], 2)[:, None]
    place = np.arange(count)[:, None] + np.repeat([0, 1], 4)
    swept[..., 1 - across] = place / count
    return swept.reshape(-1, 8, 3)

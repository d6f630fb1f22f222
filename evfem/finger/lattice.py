"""A ring of quadrilaterals in parameters: columns around, rows inwards, columns merged three to
one on the way.

The parameters of a node are its column u (in base columns, from 0 to their number, the ring
closing there) and its row r (0 at the outline). A base column starts as 1, 3 or 9 columns. A
transition row merges three columns into one:

    o0---o1---o2---o3      outline
     |   p1---p2    |
     | /         \\  |
    i0-------------i1      inside
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints

#: how far down a transition row (from 0 to 1) the nodes p1, p2 lie
MIDDLE = 0.5
#: corners (u as a fraction of the merged column, r) of the four cells of a transition, and of a plain row's
TEMPLATE = np.array(
    [
        [(1 / 3, 0), (2 / 3, 0), (2 / 3, MIDDLE), (1 / 3, MIDDLE)],
        [(0, 0), (1 / 3, 0), (1 / 3, MIDDLE), (0, 1)],
        [(2 / 3, 0), (1, 0), (1, 1), (2 / 3, MIDDLE)],
        [(1 / 3, MIDDLE), (2 / 3, MIDDLE), (1, 1), (0, 1)],
    ]
)
PLAIN = np.array([[(0, 0), (1, 0), (1, 1), (0, 1)]])
#: parts of a base column that all nodes of linear cells stand at
UNITS = 9


@dataclass(frozen=True, eq=False)
class Lattice:
    """Nodes with parameters u, r (N,), cells (E, 4 or 9), and for each cell its row and its base
    column (E,)."""

    u: Floats
    r: Floats
    cells: Ints
    row: Ints
    column: Ints


def ring(splits: Ints, rows: int, transitions: tuple[int, ...], order: int) -> Lattice:
    """The closed ring with `splits` (1, 3 or 9 columns per base column) and `rows` rows, numbered
    from outside.

    In the rows `transitions` base columns of nine become columns of three, then those of three become one.

    >>> mesh = ring(np.array([1, 3, 3, 1]), 3, (1,), 1)
    >>> len(mesh.u), np.bincount(mesh.row).tolist()
    (28, [8, 10, 4])
    """
    cells, column = [], []
    for r in range(rows):
        above, below = (np.minimum(splits, 3 ** sum(t >= line for t in transitions)) for line in (r, r + 1))
        own = np.repeat(np.arange(len(splits)), below)
        part = np.arange(len(own)) - np.repeat(np.cumsum(below) - below, below)
        width = UNITS // below[own]
        for chosen, merged in ((above == below, False), (above > below, True)):
            here = chosen[own]
            corners = quads((UNITS * own + width * part)[here], width[here], r, merged)
            cells.append(corners)
            column.append(np.repeat(own[here], len(corners) // max(here.sum(), 1)))
    nodes = np.concatenate(cells)
    if order == 2:
        middles = 0.5 * (nodes + np.roll(nodes, -1, axis=1))
        nodes = np.concatenate([nodes, middles, nodes.mean(axis=1, keepdims=True)], axis=1)
    u, r_of = nodes[..., 0] % (UNITS * len(splits)), nodes[..., 1]
    (r_of, u), number = np.unique(np.stack([r_of.ravel(), u.ravel()]), axis=1, return_inverse=True)
    row = np.repeat(np.repeat(np.arange(rows), 2), [len(corners) for corners in cells])
    return Lattice(u / UNITS, r_of, number.reshape(nodes.shape[:2]), row, np.concatenate(column))


def quads(start: Floats | Ints, width: Floats | Ints, r: int, merged: bool) -> Floats:
    """Corners (K, 4, 2) of the cells of row r below columns (C,) that begin at `start`; three columns above
    each if they are `merged`.
    """
    shape = TEMPLATE if merged else PLAIN
    u = start[:, None, None] + width[:, None, None] * shape[..., 0]
    return np.stack([u, np.broadcast_to(r + shape[..., 1], u.shape)], axis=-1).reshape(-1, 4, 2)

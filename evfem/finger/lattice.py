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
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh, raised

#: How far down a transition row (from 0 to 1) the nodes p1, p2 lie.
MIDDLE = 0.5


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
    tops = [3 ** (len(transitions) - sum(t < line for t in transitions)) for line in range(rows + 1)]
    lines, nodes = [], 0
    for top in tops:
        split = np.minimum(splits, top)
        lines.append(_Line(split, nodes))
        nodes += lines[-1].size
    blocks, extra = [], [np.empty((0, 2))]
    for r, (upper, lower) in enumerate(pairwise(lines)):
        if upper.size == lower.size:
            blocks.append(_plain(upper, lower))
            continue
        block, new = _transition(upper, lower, nodes)
        nodes += len(new)
        blocks.append(block)
        extra.append(np.column_stack([new, np.full(len(new), r + MIDDLE)]))
    on_lines = [np.column_stack([line.u, np.full(line.size, float(r))]) for r, line in enumerate(lines)]
    cells = np.vstack([cells for cells, _ in blocks])
    row = np.repeat(np.arange(rows), [len(cells) for cells, _ in blocks])
    column = np.concatenate([column for _, column in blocks])
    return _closed(np.vstack(on_lines + extra), cells, row, column, order)


class _Line:
    """The nodes of one line of the open ring: `u`, and the number of the first node of each base column."""

    def __init__(self, split: Ints, start: int) -> None:
        column = np.repeat(np.arange(len(split)), split)
        first = np.concatenate([[0], np.cumsum(split)])
        part = np.arange(len(column)) - first[column]
        self.split, self.column, self.part = split, column, part
        self.start, self.first = start, start + first
        self.u = np.append(column + part / split[column], float(len(split)))
        self.size = len(self.u)


def _plain(upper: _Line, lower: _Line) -> tuple[Ints, Ints]:
    o, i = upper.start + np.arange(upper.size - 1), lower.start + np.arange(lower.size - 1)
    return np.column_stack([o, o + 1, i + 1, i]), upper.column


def _transition(upper: _Line, lower: _Line, nodes: int) -> tuple[tuple[Ints, Ints], Floats]:
    ratio = (upper.split // lower.split)[lower.column]
    o = upper.first[lower.column] + ratio * lower.part
    i = lower.start + np.arange(len(o))
    merged = ratio == 3
    plain = np.column_stack([o, o + 1, i + 1, i])[~merged]
    o, i = o[merged], i[merged]
    p = nodes + 2 * np.arange(len(o))
    new = upper.u[np.column_stack([o + 1, o + 2]) - upper.start].ravel()
    templates = [
        (o + 1, o + 2, p + 1, p),
        (o, o + 1, p, i),
        (o + 2, o + 3, i + 1, p + 1),
        (p, p + 1, i + 1, i),
    ]
    cells = np.vstack([plain, *(np.column_stack(t) for t in templates)])
    column = np.concatenate([lower.column[~merged], np.tile(lower.column[merged], 4)])
    return (cells, column), new


def _closed(parameters: Floats, cells: Ints, row: Ints, column: Ints, order: int) -> Lattice:
    """Raise to the order and join the two ends of the ring."""
    mesh = Mesh(parameters, cells, "quad", row, {})
    mesh = raised(mesh) if order == 2 else mesh
    u, r = mesh.points.T
    last = np.flatnonzero(u == u.max())
    first = np.flatnonzero(u == 0.0)
    target = np.arange(len(u))
    target[last[np.argsort(r[last])]] = first[np.argsort(r[first])]
    keep: NDArray[np.bool_] = np.ones(len(u), dtype=bool)
    keep[last] = False
    number = np.cumsum(keep) - 1
    return Lattice(u[keep], r[keep], number[target[mesh.cells]], row, column)

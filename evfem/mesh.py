"""The finite element mesh: points, cells of one kind, named regions and named sets of nodes.

Nodes keep the order of the file they came from; cells are in VTK order, counter-clockwise. Lengths in mm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]

#: kind -> (number of corners, order); the local edges of a cell are (corner i, corner i+1[, mid-node i])
KINDS: Mapping[str, tuple[int, int]] = {
    "quad": (4, 1),
    "quad9": (4, 2),
    "triangle": (3, 1),
    "triangle6": (3, 2),
}


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points (N, 2), cells (E, n) in VTK order, an integer region per cell, and named sets.

    `region_names` maps a name to its number in `region`; `node_sets` maps `pad`, `bone`, `nail` ... to sorted node numbers.
    """

    points: Floats
    cells: Ints
    kind: str
    region: Ints
    region_names: Mapping[str, int]
    node_sets: Mapping[str, Ints] = field(default_factory=dict)

    @property
    def order(self) -> int:
        """Polynomial order of the cells: 1 or 2."""
        return KINDS[self.kind][1]

    @property
    def corners(self) -> int:
        """Number of corners of a cell: 3 or 4."""
        return KINDS[self.kind][0]

    def cells_of(self, name: str) -> Ints:
        """Numbers of the cells in the region `name`."""
        return np.flatnonzero(self.region == self.region_names[name])

    @cached_property
    def outer_edges(self) -> Ints:
        """Edges that belong to one cell only, (K, 2) or (K, 3): start, end[, middle], the body on the left."""
        m = self.corners
        i = np.arange(m)
        columns = [i, (i + 1) % m] + ([m + i] if self.order == 2 else [])
        edges = self.cells[:, np.array(columns).T].reshape(-1, len(columns))
        ends = np.sort(edges[:, :2], axis=1)
        _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
        return edges[np.sort(first[count == 1])]

    def edges_of(self, name: str) -> Ints:
        """Outer edges all of whose nodes are in the set `name`, same columns as `outer_edges`."""
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.node_sets[name]] = True
        return self.outer_edges[inside[self.outer_edges].all(axis=1)]

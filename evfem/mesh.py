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

    `region_names` maps a name to its number in `region`; `node_sets` maps `pad`, `bone`, `nail` ... to sorted
    node numbers.
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
        """Edges of one cell only, (K, 2) or (K, 3): start, end[, middle], the body on the left."""
        m = self.corners
        i = np.arange(m)
        columns = [i, (i + 1) % m] + ([m + i] if self.order == 2 else [])
        edges = self.cells[:, np.array(columns).T].reshape(-1, len(columns))
        ends = np.sort(edges[:, :2], axis=1)
        _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
        return edges[np.sort(first[count == 1])]

    @cached_property
    def edges(self) -> tuple[Ints, Ints]:
        """All edges once, (K, 2) corner nodes in rising order, and the edges of each cell, (E, corners)."""
        m = self.corners
        i = np.arange(m)
        ends = np.sort(self.cells[:, np.array([i, (i + 1) % m]).T], axis=2).reshape(-1, 2)
        unique, inverse = np.unique(ends, axis=0, return_inverse=True)
        return unique, inverse.reshape(-1, m)

    def edges_of(self, name: str) -> Ints:
        """Outer edges all of whose nodes are in the set `name`, same columns as `outer_edges`."""
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.node_sets[name]] = True
        return self.outer_edges[inside[self.outer_edges].all(axis=1)]


def raised(mesh: Mesh) -> Mesh:
    """The quadratic mesh on the same cells: straight edges, new nodes halfway.

    New nodes are numbered after the old ones. The new node of an outer edge belongs to every set that holds
    both ends of that edge; other new nodes belong to none.

    >>> square = Mesh(np.array([[0., 0.], [1., 0.], [1., 1.], [0., 1.]]), np.array([[0, 1, 2, 3]]), "quad",
    ...               np.zeros(1, int), {"skin": 0}, {"pad": np.array([0, 1])})
    >>> raised(square).kind, raised(square).points[4].tolist(), raised(square).node_sets["pad"].tolist()
    ('quad9', [0.5, 0.0], [0, 1, 4])
    """
    if mesh.order == 2:
        return mesh
    edges, of_cell = mesh.edges
    first = len(mesh.points)
    points = [mesh.points, mesh.points[edges].mean(axis=1)]
    columns = [mesh.cells, first + of_cell]
    if mesh.corners == 4:
        points.append(mesh.points[mesh.cells].mean(axis=1))
        columns.append(first + len(edges) + np.arange(len(mesh.cells))[:, None])
    outer = np.bincount(of_cell.ravel(), minlength=len(edges)) == 1
    sets = {name: _with_middles(nodes, edges, outer, first) for name, nodes in mesh.node_sets.items()}
    kind = "quad9" if mesh.corners == 4 else "triangle6"
    return Mesh(np.vstack(points), np.hstack(columns), kind, mesh.region, mesh.region_names, sets)


def _with_middles(nodes: Ints, edges: Ints, outer: NDArray[np.bool_], first: int) -> Ints:
    both = np.isin(edges, nodes).all(axis=1) & outer
    return np.union1d(nodes, first + np.flatnonzero(both))

"""The finite element mesh: points, cells of one kind, named regions and named sets of nodes.

Nodes keep the order of the file they came from; cells are in VTK order, counter-clockwise in the
plane (hexahedra: `evfem.mesh.hexahedron`). Lengths in mm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.hexahedron import EDGES, face_nodes


class CellKind(NamedTuple):
    """A kind of cell: dimension, numbers of corners and nodes, order."""

    dimension: int
    corners: int
    nodes: int
    order: int


#: kinds of cells in mesh files, by meshio's names
CELLS: Mapping[str, CellKind] = {
    "vertex": CellKind(0, 1, 1, 1),
    "line": CellKind(1, 2, 2, 1),
    "line3": CellKind(1, 2, 3, 2),
    "triangle": CellKind(2, 3, 3, 1),
    "triangle6": CellKind(2, 3, 6, 2),
    "quad": CellKind(2, 4, 4, 1),
    "quad8": CellKind(2, 4, 8, 2),
    "quad9": CellKind(2, 4, 9, 2),
    "tetra": CellKind(3, 4, 4, 1),
    "hexahedron": CellKind(3, 8, 8, 1),
    "hexahedron20": CellKind(3, 8, 20, 2),
    "hexahedron27": CellKind(3, 8, 27, 2),
}
#: the kinds that a finger can be made of, in the plane and in space
KINDS = ("quad", "quad9", "triangle", "triangle6", "hexahedron", "hexahedron27")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Points (N, dim), cells (E, n) in VTK order, an integer region per cell, and named sets.

    `region_names` maps a name to its number in `region`; `node_sets` maps `pad`, `bone`, `nail`
    ... to sorted node numbers.
    """

    points: Floats
    cells: Ints
    kind: str
    region: Ints
    region_names: Mapping[str, int]
    node_sets: Mapping[str, Ints] = field(default_factory=dict)

    def __repr__(self) -> str:
        """Its size, regions and sets."""
        names = f"regions {', '.join(self.region_names)}; sets {', '.join(self.node_sets) or 'none'}"
        return f"Mesh of {len(self.points)} nodes, {len(self.cells)} cells ({self.kind}); {names}"

    @property
    def dim(self) -> int:
        """Number of coordinates of a point: 2 in the plane, 3 in space."""
        return self.points.shape[1]

    @property
    def order(self) -> int:
        """Polynomial order of the cells: 1 or 2."""
        return CELLS[self.kind].order

    @property
    def corners(self) -> int:
        """Number of corners of a cell: 3, 4 or 8."""
        return CELLS[self.kind].corners

    def cells_of(self, name: str) -> Ints:
        """Numbers of the cells in the region `name`."""
        return np.flatnonzero(self.region == self.region_names[name])

    @property
    def centres(self) -> Floats:
        """The point in the middle of each cell (E, dim) in mm, of its own coordinates where it is bent."""
        if self.kind in ("quad9", "hexahedron27"):
            return self.points[self.cells[:, -1]]
        corners, middles = np.split(self.points[self.cells], [self.corners], axis=1)
        if self.order == 1:
            return corners.mean(axis=1)
        return (4.0 * middles.sum(axis=1) - corners.sum(axis=1)) / 9.0  # of a triangle

    def cells_at(self, points: Floats | Sequence[Sequence[float]]) -> Ints:
        """Numbers of the cells (k,) in which points (k, 2) of the plane lie, -1 outside of the mesh.

        A cell is the polygon through the nodes around it; of two cells that share an edge exactly one
        has its points. A ray to the right crosses the polygon of the cell that it starts in an odd
        number of times. Raises InputError for a mesh in space.

        >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
        >>> one = Mesh(corners, np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, int), {"tissue": 0})
        >>> one.cells_at([[0.5, 0.5], [1.5, 0.5]]).tolist()
        [0, -1]
        """
        query = np.asarray(points, dtype=float)
        if self.dim != 2 or query.ndim != 2 or query.shape[1] != 2:
            raise InputError("points", f"shape {query.shape} in {self.dim} dimensions", "(k, 2) in the plane")
        around = self.points[self.cell_sides[..., [0, 2, 1] if self.order == 2 else [0, 1]]]
        low, high = around.min(axis=(1, 2)), around.max(axis=(1, 2))
        edges = np.stack([around[:, :, :-1], around[:, :, 1:]], axis=3).reshape(len(around), -1, 2, 2)
        edges = np.take_along_axis(edges, edges[..., 1:].argsort(axis=2), axis=2)  # the lower end first
        found = np.full(len(query), -1)
        for i, (x, y) in enumerate(query):
            near = np.flatnonzero(((low <= query[i]) & (query[i] <= high)).all(axis=1))
            (x0, y0), (x1, y1) = np.moveaxis(edges[near], (2, 3), (0, 1))
            passed = (y0 <= y) & (y < y1)
            fraction = np.divide(y - y0, y1 - y0, out=np.zeros_like(y0), where=passed)
            inside = near[(passed & (x < x0 + fraction * (x1 - x0))).sum(axis=1) % 2 == 1]
            found[i] = inside[0] if inside.size else -1
        return found

    # -- sides: edges in the plane, faces in space

    @property
    def local_sides(self) -> Ints:
        """Local nodes (m, k) of a cell's m sides: start, end[, middle] of the edges of a triangle or quad,
        counter-clockwise; the faces of a hexahedron as quads or quad9s that are seen so from outside.
        """
        return sides_of(self.kind)

    @property
    def cell_sides(self) -> Ints:
        """The nodes of the sides of each cell, (E, m, k)."""
        return self.cells[:, self.local_sides]

    @cached_property
    def sides(self) -> tuple[Ints, Ints]:
        """All sides once, (K, 2 or 4) corner nodes in rising order, and the sides of each cell, (E, m)."""
        return once(self.cell_sides[..., : 2 * self.dim - 2])

    @cached_property
    def is_outer(self) -> Any:
        """Which sides of each cell belong to no other one, (E, m) bool."""
        _, of_cell = self.sides
        return np.bincount(of_cell.ravel())[of_cell] == 1

    @property
    def outer_sides(self) -> Ints:
        """Sides of one cell only, (K, k), the body on the left of edges, the normals of faces outwards."""
        return self.cell_sides[self.is_outer]

    def in_set(self, name: str) -> Any:
        """Which sides of each cell are outer ones all of whose nodes are in the set `name`, (E, m) bool."""
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.node_sets[name]] = True
        return self.is_outer & inside[self.cell_sides].all(axis=2)

    def sides_of(self, name: str) -> Ints:
        """Outer sides all of whose nodes are in the set `name`, same columns as `outer_sides`."""
        return self.cell_sides[self.in_set(name)]


def sides_of(kind: str) -> Ints:
    """Local nodes (m, k) of the sides of a kind of cell, as `Mesh.local_sides` has them; (0, 1) where no
    finger is made of it. Twenty nodes have the sides of eight.

    >>> sides_of("triangle6").tolist(), sides_of("hexahedron").tolist()[2]
    ([[0, 1, 3], [1, 2, 4], [2, 0, 5]], [0, 1, 5, 4])
    """
    if kind not in CELLS or CELLS[kind].dimension < 2 or kind.startswith("tetra"):
        return np.empty((0, 1), dtype=np.int64)
    if CELLS[kind].dimension == 3:
        return face_nodes(CELLS[kind].order if kind != "hexahedron20" else 1)
    i, m = np.arange(CELLS[kind].corners), CELLS[kind].corners
    return np.array([i, (i + 1) % m, m + i][: CELLS[kind].order + 1]).T


def once(parts: Ints) -> tuple[Ints, Ints]:
    """Edges or faces (E, m, k) of cells once, (K, k) corners in rising order, and their numbers in
    each cell, (E, m).
    """
    ordered = np.sort(parts, axis=2).reshape(-1, parts.shape[2])
    order = np.lexsort(ordered.T[::-1])
    new = np.concatenate([[True], (np.diff(ordered[order], axis=0) != 0).any(axis=1)])
    number = np.empty(len(ordered), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return ordered[order[new]], number.reshape(parts.shape[:2])


def joined(rows: Ints) -> Ints:
    """Which rows of numbers (K, m) hang together by numbers that they share: the first row of each one's
    part, (K,).

    >>> joined(np.array([[0, 1], [5, 6], [2, 1]])).tolist()
    [0, 1, 0]
    """
    first, before = np.arange(len(rows)), None
    while before is None or (first != before).any():
        before, of_number = first, np.full(rows.max(initial=-1) + 1, len(rows))
        np.minimum.at(of_number, rows, before[:, None])
        first = of_number[rows].min(axis=1)
        first = first[first]  # twice as far each time
    return first


def raised(mesh: Mesh) -> Mesh:
    """The quadratic mesh on the same cells: straight edges, new nodes halfway.

    New nodes are numbered after the old ones. The new node of an outer edge belongs to every set
    that holds both ends of that edge, those of an outer face to every set that holds its corners;
    other new nodes belong to none.

    >>> square = Mesh(np.array([[0., 0.], [1., 0.], [1., 1.], [0., 1.]]), np.array([[0, 1, 2, 3]]), "quad",
    ...               np.zeros(1, int), {"skin": 0}, {"pad": np.array([0, 1])})
    >>> raised(square).kind, raised(square).points[4].tolist(), raised(square).node_sets["pad"].tolist()
    ('quad9', [0.5, 0.0], [0, 1, 4])
    """
    if mesh.order == 2:
        return mesh
    (sides, of_cell), first = mesh.sides, len(mesh.points)
    new = [(sides, of_cell)]  # corners of what gets a node in its middle, numbers of that in each cell
    if mesh.dim == 3:
        new.insert(0, once(mesh.cells[:, EDGES]))
    if mesh.corners > 3:
        new.append((mesh.cells, np.arange(len(mesh.cells))[:, None]))
    points, columns = [mesh.points], [mesh.cells]
    for parts, number in new:
        points.append(mesh.points[parts].mean(axis=1))
        columns.append(first + number)
        first += len(parts)
    kind = {3: "triangle6", 4: "quad9", 8: "hexahedron27"}[mesh.corners]
    fine = Mesh(np.vstack(points), np.hstack(columns), kind, mesh.region, mesh.region_names)
    outer = fine.cell_sides[mesh.is_outer]
    corners = outer[:, : 2 * mesh.dim - 2]
    sets = {name: np.union1d(nodes, outer[np.isin(corners, nodes).all(axis=1)])
            for name, nodes in mesh.node_sets.items()}  # fmt: skip
    return replace(fine, node_sets=sets)


def interface_of(mesh: Mesh, region: str) -> Ints:
    """Nodes (K, ...) of every side that cells of two given regions share; raises `InputError` without one."""
    if region not in mesh.region_names:
        raise InputError("region", describe_value(region), " | ".join(mesh.region_names))
    inside = mesh.region == mesh.region_names[region]
    sides, of_cell = mesh.sides
    own, other = (np.bincount(of_cell[cells].ravel(), minlength=len(sides)) for cells in (inside, ~inside))
    shared = (own > 0) & (other > 0)
    interface = mesh.cell_sides[inside][shared[of_cell[inside]]]
    if not len(interface):
        raise InputError("region", describe_value(region), "a region that has another one below it")
    return interface

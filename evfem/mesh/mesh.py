"""The finite element mesh: points, cells of one kind, named regions and named sets of nodes.

Nodes keep the order of the file they came from; cells are in VTK order, counter-clockwise in the
plane (hexahedra: `evfem.mesh.hexahedron`). Lengths in mm.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, quoted
from evfem.mesh.hexahedron import EDGES, FACES, face_nodes


class CellKind(NamedTuple):
    """A kind of cell: dimension, numbers of corners and nodes, order.

    The local edges of a triangle or quad are (corner i, corner i+1[, mid-node i]).
    """

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
        given = np.asarray(points, dtype=float)
        if self.dim != 2 or given.ndim != 2 or given.shape[1] != 2:
            raise InputError("points", f"shape {given.shape} in {self.dim} dimensions", "(k, 2) in the plane")
        around = self.points[self.cell_edges[..., [0, 2, 1] if self.order == 2 else [0, 1]]]
        low, high = around.min(axis=(1, 2)), around.max(axis=(1, 2))
        edges = np.stack([around[:, :, :-1], around[:, :, 1:]], axis=3).reshape(len(around), -1, 2, 2)
        return np.array([_cell_around(point, edges, low, high) for point in given], dtype=int)

    @cached_property
    def outer_edges(self) -> Ints:
        """Edges of one cell only, (K, 2) or (K, 3): start, end[, middle], the body on the left."""
        _, of_cell = self.edges
        alone = np.bincount(of_cell.ravel())[of_cell] == 1
        return self.cell_edges[alone]

    @property
    def cell_edges(self) -> Ints:
        """The edges of each cell, (E, corners, 2) or (E, corners, 3): start, end[, middle],
        counter- clockwise.
        """
        m = self.corners
        i = np.arange(m)
        columns = [i, (i + 1) % m] + ([m + i] if self.order == 2 else [])
        return self.cells[:, np.array(columns).T]

    @cached_property
    def edges(self) -> tuple[Ints, Ints]:
        """All edges once, (K, 2) corner nodes in rising order, and the edges of each cell, (E, corners)."""
        ends = np.sort(self.cell_edges[..., :2], axis=2).reshape(-1, 2)
        code, inverse = np.unique(ends[:, 0] * len(self.points) + ends[:, 1], return_inverse=True)
        return np.column_stack(np.divmod(code, len(self.points))), inverse.reshape(-1, self.corners)

    def edges_of(self, name: str) -> Ints:
        """Outer edges all of whose nodes are in the set `name`, same columns as `outer_edges`."""
        return self._within(self.outer_edges, name)

    def _within(self, facets: Ints, name: str) -> Ints:
        inside = np.zeros(len(self.points), dtype=bool)
        inside[self.node_sets[name]] = True
        return facets[inside[facets].all(axis=1)]

    # -- in space
    # ----------------------------------------------------------------------------------------------------

    @property
    def cell_faces(self) -> Ints:
        """The faces of each hexahedron, (E, 6, 4) or (E, 6, 9): quads or quad9s that are seen
        counter-clockwise from outside.
        """
        return self.cells[:, face_nodes(self.order)]

    @cached_property
    def faces(self) -> tuple[Ints, Ints]:
        """All faces of hexahedra once, (K, 4) corner nodes in rising order, and the faces of each
        cell, (E, 6).
        """
        return once(self.cells[:, FACES])

    @cached_property
    def outer_faces(self) -> Ints:
        """Faces of one cell only, (K, 4) or (K, 9), their normals outwards."""
        _, of_cell = self.faces
        alone = np.bincount(of_cell.ravel())[of_cell] == 1
        return self.cell_faces[alone]

    def faces_of(self, name: str) -> Ints:
        """Outer faces all of whose nodes are in the set `name`, same columns as `outer_faces`."""
        return self._within(self.outer_faces, name)


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
    if mesh.dim == 3:
        return _raised_hexahedra(mesh)
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


def _raised_hexahedra(mesh: Mesh) -> Mesh:
    """The same in space: new nodes in the middles of edges, faces and cells."""
    edges, edges_of_cell = once(mesh.cells[:, EDGES])
    faces, faces_of_cell = mesh.faces
    starts = len(mesh.points) + np.cumsum([0, len(edges), len(faces)])
    points = [mesh.points] + [mesh.points[part].mean(axis=1) for part in (edges, faces, mesh.cells)]
    columns = [mesh.cells, starts[0] + edges_of_cell, starts[1] + faces_of_cell]
    columns.append(starts[2] + np.arange(len(mesh.cells))[:, None])
    solid = Mesh(np.vstack(points), np.hstack(columns), "hexahedron27", mesh.region, mesh.region_names)
    outer = solid.outer_faces
    for name, nodes in mesh.node_sets.items():
        whole = np.isin(outer[:, :4], nodes).all(axis=1)
        solid = replace(solid, node_sets={**solid.node_sets, name: np.union1d(nodes, outer[whole])})
    return solid


def _with_middles(nodes: Ints, edges: Ints, outer: np.ndarray, first: int) -> Ints:
    both = np.isin(edges, nodes).all(axis=1) & outer
    return np.union1d(nodes, first + np.flatnonzero(both))


def interface_of(mesh: Mesh, region: str) -> Ints:
    """Nodes (K, ...) of every side that cells of two given regions share; raises `InputError` without one."""
    if region not in mesh.region_names:
        raise InputError("region", quoted(region), " | ".join(mesh.region_names))
    inside = mesh.region == mesh.region_names[region]
    sides, of_cell = mesh.edges if mesh.dim == 2 else mesh.faces
    own, other = (np.bincount(of_cell[cells].ravel(), minlength=len(sides)) for cells in (inside, ~inside))
    shared = (own > 0) & (other > 0)
    of_cells = mesh.cell_edges if mesh.dim == 2 else mesh.cell_faces
    interface = of_cells[inside][shared[of_cell[inside]]]
    if not len(interface):
        raise InputError("region", quoted(region), "a region that has another one below it")
    return interface


def _cell_around(point: Floats, edges: Floats, low: Floats, high: Floats) -> int:
    """The cell whose edges (E, n, 2 ends, 2) go round a point, -1 for none; `low` and `high` (E, 2)
    are the corners of a box around each.
    """
    near = np.flatnonzero(((low <= point) & (point <= high)).all(axis=1))
    ends = edges[near]
    rising = (ends[:, :, 0, 1] <= ends[:, :, 1, 1])[..., None]
    (x0, y0), (x1, y1) = (
        np.moveaxis(np.where(rising, ends[:, :, i], ends[:, :, 1 - i]), -1, 0) for i in (0, 1)
    )
    passed = (y0 <= point[1]) & (point[1] < y1)
    share = np.divide(point[1] - y0, y1 - y0, out=np.zeros_like(y0), where=passed)
    crossings = np.sum(passed & (point[0] < x0 + share * (x1 - x0)), axis=1)
    inside = near[crossings % 2 == 1]
    return int(inside[0]) if inside.size else -1

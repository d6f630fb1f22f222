"""What a mesh of hexahedra must fulfil, in the order in which `evfem.mesh.quality` asks; every fault
becomes one sentence.

Whether two bodies overlap is found where a node of the surface lies on another cell's face (which also finds
nodes that hang on a larger neighbour); bodies that run through each other elsewhere are not found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, linalg
from evfem.mesh.hexahedron import MIRRORED, face_nodes
from evfem.mesh.mesh import Mesh

Refuse = Callable[[str, str], None]  # (fault, what is allowed): raises InputError
#: a node lies on a face if it is nearer to it than this part of the face's size
ON_FACE = 1e-6
#: triangles of a quad around its middle, by its corners
_AROUND = ((0, 1), (1, 2), (2, 3), (3, 0))


def some(numbers: Ints) -> str:
    """The first of the numbers, and how many more there are.

    >>> some(np.array([3, 5, 8, 9]))
    '3, 5, 8 and 1 more'
    """
    listed = ", ".join(str(n) for n in numbers[:3])
    return listed + (f" and {len(numbers) - 3} more" if len(numbers) > 3 else "")


def oriented(mesh: Mesh, refuse: Refuse) -> Mesh:
    """Each cell right-handed."""
    corner = mesh.points[mesh.cells[:, :8]]
    middles = corner[:, face_nodes(1)].mean(axis=2)
    volume = np.linalg.det(middles[:, 1::2] - middles[:, ::2])
    return turned(mesh, volume, MIRRORED[: mesh.cells.shape[1]], refuse)


def turned(mesh: Mesh, size: Floats, order: Any, refuse: Refuse) -> Mesh:
    """Cells of negative size (E,), area or volume, with their nodes in another order."""
    bad = np.flatnonzero(size == 0.0)
    if len(bad):
        refuse(f"empty cells (cell {some(bad)})", "cells with an area or a volume")
    if (size > 0.0).all():
        return mesh
    return replace(mesh, cells=np.where(size[:, None] < 0.0, mesh.cells[:, order], mesh.cells))


def listed(nodes: Ints) -> str:
    """Numbers in a sentence."""
    return ", ".join(map(str, nodes[:-1])) + f" and {nodes[-1]}"


def surface(mesh: Mesh, refuse: Refuse) -> None:
    """Refuse a surface that touches itself: nodes on a face of a cell that has them not."""
    linalg()  # before scipy.spatial brings its BLAS
    from scipy.spatial import cKDTree

    faces = mesh.outer_sides
    if not len(faces):
        refuse("no outer face", "a body with a surface")
    corner = mesh.points[faces[:, :4]]
    middle = corner.mean(axis=1)
    size = np.linalg.norm(corner - middle[:, None], axis=2).max(axis=1)
    nodes = np.unique(faces)
    near = cKDTree(mesh.points[nodes]).query_ball_point(middle, size)
    face = np.repeat(np.arange(len(faces)), [len(found) for found in near])
    node = nodes[np.concatenate(near).astype(int)]
    strange = (faces[face] != node[:, None]).all(axis=1)
    face, node = face[strange], node[strange]
    on = np.zeros(len(face), dtype=bool)
    for a, b in _AROUND:
        triangle = np.stack([middle[face], corner[face, a], corner[face, b]], axis=1)
        on |= _on_triangle(mesh.points[node], triangle, ON_FACE * size[face])
    if on.any():
        first = np.argmax(on)
        nodes_of_face = listed(faces[face[first], :4])
        fault = f"a surface that touches itself: node {node[first]} on the face of nodes {nodes_of_face}"
        refuse(fault, "cells that do not overlap, and no node on another cell's face")


def _on_triangle(points: Floats, triangle: Floats, near: Floats) -> Floats:
    """Whether each of the points (K, 3) lies on its triangle (K, 3, 3), by a distance `near` (K,)."""
    away, u, v = points - triangle[:, 0], triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    normal = np.cross(u, v)
    square = (normal**2).sum(axis=1)
    first = (np.cross(away, v) * normal).sum(axis=1) / square
    second = (np.cross(u, away) * normal).sum(axis=1) / square
    height = np.abs((away * normal).sum(axis=1)) / np.sqrt(square)
    return np.asarray((height < near) & (first > -1e-9) & (second > -1e-9) & (first + second < 1.0 + 1e-9))


def with_sets(mesh: Mesh, refuse: Refuse) -> Mesh:
    """The mesh with its set `pad` reduced to whole edges of the outline, or outer faces."""
    plane, bone = mesh.dim == 2, len(mesh.node_sets["bone"])
    least, words = (2, "two") if plane else (3, "three")
    if bone < least:
        refuse(f"a bone of {bone} nodes", f"a bone of at least {words} nodes, so that the finger cannot turn")
    pad = np.unique(mesh.sides_of("pad")).astype(np.int64)
    if not len(pad):
        part, parts = ("an edge of the outline", "edges") if plane else ("a face of the surface", "faces")
        refuse(f"a pad without {part}", f"a pad of whole {parts}: all their nodes in `pad`")
    if np.isin(pad, mesh.node_sets["bone"]).all():
        refuse("a pad that lies on the bone", "a pad with nodes that can move")
    return replace(mesh, node_sets={**mesh.node_sets, "pad": pad})

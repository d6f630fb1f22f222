"""Meshes that are their own mirror image about a vertical line, and their right halves."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh

#: points count as mirror images of each other within this share of the mesh's width
CLOSE = 1e-9
#: places are told apart by this share, no round number: those of meshes are not in between
GRID = 0.7320508e-6


@dataclass(frozen=True, eq=False)
class Half:
    """The right half of a symmetric mesh: its `mesh`, the numbers `nodes` (n,) of its nodes in the
    whole one, those of their mirror images `images` (n,), and which are on the line, `middle` (n,)
    bool.
    """

    mesh: Mesh
    nodes: Ints
    images: Ints
    middle: Ints


def right_half(mesh: Mesh) -> Half | None:
    """The right half of a plane mesh; None where it is not symmetric or cells cross the line.

    >>> points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]])
    >>> two = Mesh(points, np.array([[0, 1, 4, 3], [1, 2, 5, 4]]), "quad", np.zeros(2, int), {"all": 0})
    >>> half = right_half(two)
    >>> half.nodes.tolist(), half.images.tolist(), half.middle.tolist()
    ([1, 2, 4, 5], [1, 0, 4, 3], [True, False, True, False])
    >>> right_half(replace(two, region=np.array([0, 1]), region_names={"left": 0, "right": 1})) is None
    True
    """
    x = mesh.points[:, 0] - 0.5 * (mesh.points[:, 0].min() + mesh.points[:, 0].max())
    image = _images(np.column_stack([x, mesh.points[:, 1]]))
    if image is None or not _same_parts(mesh, image):
        return None
    middle = image == np.arange(len(x))
    right = (x > 0.0) | middle
    inside = right[mesh.cells].all(axis=1)
    if 2 * inside.sum() != len(mesh.cells):
        return None
    nodes = np.flatnonzero(right)
    number = np.full(len(x), -1)
    number[nodes] = np.arange(nodes.size)
    sets = {name: number[some[right[some]]] for name, some in mesh.node_sets.items()}
    cells, region = number[mesh.cells[inside]], mesh.region[inside]
    half = replace(mesh, points=mesh.points[nodes], cells=cells, region=region, node_sets=sets)
    return Half(half, nodes, image[nodes], middle[nodes])


def _images(points: Floats) -> Ints | None:
    """The number of each point's mirror image about x = 0; None where one has none."""
    width = float(np.ptp(points[:, 0]))
    mirrored = points * np.array([-1.0, 1.0])
    # in order of rounded places, in which points and their images come alike
    order, other = (np.lexsort(np.rint(some / (GRID * width)).T) for some in (points, mirrored))
    if np.abs(points[order] - mirrored[other]).max() > CLOSE * width:
        return None
    image = np.empty(len(points), dtype=np.int64)
    image[order] = other
    return image if np.array_equal(image[image], np.arange(len(points))) else None


def _same_parts(mesh: Mesh, image: Ints) -> bool:
    """Whether the images of cells are cells of the same region, and those of a set are in it."""
    sets = (np.array_equal(np.sort(image[some]), np.sort(some)) for some in mesh.node_sets.values())
    cells, images = _listed(mesh.cells, mesh.region), _listed(image[mesh.cells], mesh.region)
    return np.array_equal(cells, images) and all(sets)


def _listed(cells: Ints, region: Ints) -> Ints:
    """Cells (E, n) as sorted rows with their region behind, in an order of their own."""
    rows = np.column_stack([np.sort(cells, axis=1), region])
    return rows[np.lexsort(rows.T)]

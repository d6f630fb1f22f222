"""A mesh whose regions share no node: fields that jump from layer to layer have a value on either side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.mesh import Mesh


def split(mesh: Mesh) -> tuple[Mesh, Ints]:
    """The mesh with nodes of its own in each region, in the order of the regions, and the node (V,) of the
    given mesh that each of them is. It has no sets of nodes.

    >>> from evfem import FingerPad
    >>> mesh = FingerPad(resolution="coarse").mesh()
    >>> apart, nodes = split(mesh)
    >>> len(np.unique(nodes)) == len(mesh.points) < len(apart.points)
    True
    """
    count = len(mesh.points)
    owned, cells = np.unique(mesh.cells + count * mesh.region[:, None], return_inverse=True)
    nodes = owned % count
    return replace(
        mesh, points=mesh.points[nodes], cells=cells.reshape(mesh.cells.shape), node_sets={}
    ), nodes


def nodal_means(mesh: Mesh, values: Floats, weights: Floats | float = 1.0) -> Floats:
    """Means (N, ...) of the values (E, ...) of the cells around each node, with `weights` (E,)."""
    nodes = mesh.cells.ravel()
    weight = np.repeat(np.broadcast_to(weights, len(mesh.cells)), mesh.cells.shape[1])
    columns = np.repeat(values.reshape(len(values), -1), mesh.cells.shape[1], axis=0).T
    total = np.array([np.bincount(nodes, weight * column, len(mesh.points)) for column in columns])
    means = total / np.bincount(nodes, weight, len(mesh.points))
    return np.asarray(means.T.reshape(-1, *values.shape[1:]))

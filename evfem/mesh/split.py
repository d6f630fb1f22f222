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


def nodal_means(mesh: Mesh, values: Floats) -> Floats:
    """Means (N, ...) of the values (E, ...) of the cells around each node."""
    total = np.zeros((len(mesh.points), *values.shape[1:]))
    np.add.at(total, mesh.cells.ravel(), np.repeat(values, mesh.cells.shape[1], axis=0))
    number = np.bincount(mesh.cells.ravel(), minlength=len(mesh.points))
    return np.asarray(total / number.reshape(-1, *[1] * (values.ndim - 1)))

"""The nodes of a pad's outline in their order."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh


def outline_nodes(mesh: Mesh) -> Ints:
    """Mesh numbers (P,) of the nodes on `pad` along the outline, in growing x on the side that
    faces down.

    On quadratic meshes ends and middles of edges alternate. Raises InputError where the pad is not
    one open line.

    >>> from evfem.finger.fingerpad import FingerPad
    >>> mesh = FingerPad(resolution="coarse").mesh(order=2)
    >>> nodes = outline_nodes(mesh)
    >>> len(nodes) == len(mesh.node_sets["pad"]), bool(mesh.points[nodes[0], 0] < 0)
    (True, True)
    """
    if mesh.dim == 3:
        raise InputError("finger.mesh", "a finger in three dimensions", "a plane finger")
    edges = mesh.edges_of("pad")
    follow = {int(edge[0]): [int(node) for node in (*edge[2:], edge[1])] for edge in edges}
    starts = set(follow) - {nodes[-1] for nodes in follow.values()}
    if len(starts) != 1:
        raise InputError("finger.mesh", f"a pad with {len(starts)} beginnings", "a pad that is one open line")
    nodes = list(starts)
    while nodes[-1] in follow:
        nodes += follow[nodes[-1]]
    return np.array(nodes, dtype=np.int64)

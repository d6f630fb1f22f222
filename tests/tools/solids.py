"""Blocks of hexahedra and sheets of their skin, for tests of the third dimension."""

import numpy as np

from evfem.mesh import faces
from evfem.mesh.hexahedron import PLACES
from evfem.mesh.mesh import Mesh, raised
from evfem.surface.skin import Skin
from evfem.tissue.space import ELEMENTS, make_space

SIDES = ("left", "right", "bottom", "top", "back", "front")  # -x, +x, -y, +y, -z, +z
SOLIDS = ("hex8", "hex27p1")


def bend(x, y, z):
    """A warp that curves every edge and twists every face."""
    return (
        x + 0.06 * np.sin(2.0 * y + x - z),
        y + 0.08 * np.sin(2.5 * x + 0.7 * z),
        z + 0.07 * np.sin(2.0 * x * y + 1.5 * z),
    )


def wavy(points, size=0.06):
    """A smooth displacement field, far from affine."""
    x, y, z = points.T
    waves = np.sin(2 * x + y - z) + y * z, np.cos(3 * x - y) + x * z, np.sin(2 * z - x) + x * y
    return size * np.column_stack(waves)


def block(divisions, size=(1.0, 1.0, 1.0), jitter=0.0, split=None):
    """[0, w] x [0, h] x [0, d] in nx x ny x nz hexahedra; node sets are its six sides and `outside`.

    `jitter` moves inner nodes at random by that share of a cell; `split(x, y, z)` at the centre of a cell is
    True in region `upper`, the rest is `lower`.
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


def sheet(n, m, place):
    """A skin of n x n faces with m nodes, its normal down, and the positions place(p, q) of its
    nodes on the unit square.
    """
    step = 2 if m == 9 else 1
    t = np.linspace(0.0, 1.0, step * n + 1)
    number = np.arange(t.size**2).reshape(t.size, t.size)
    corner = step * np.stack(np.meshgrid(range(n), range(n), indexing="ij"), axis=-1).reshape(-1, 2)
    at = corner[:, None] + ((faces.PLACES[:m] + 1) * step / 2).astype(int)
    sides = number[at[..., 0], at[..., 1]]
    q, p = np.meshgrid(t, t)
    points = np.stack([c.ravel() for c in place(p, q)], axis=1)
    return Skin(np.arange(len(points)), sides, np.ones(len(points), bool)), points


def bent(p, q):
    """A sheet that is curved, sheared, and turns up at one side."""
    return 3.0 * p + 0.4 * q - 1.2 * p**2, 0.3 * p**2 + 0.1 * q, 2.0 * q + 0.3 * p * q

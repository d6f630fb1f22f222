"""The press-and-slide problem that other finite element packages solve too: its meshes.

Lower half between two concentric ellipses, x = A cos(theta), y = B sin(theta), theta from pi to 2
pi: bone contour (3.0, 2.5), interface between tissue and skin (7.96, 6.015), outer contour (8.34,
6.395), in mm. Nodes uniform in theta, linear along the straight lines from the bone to the
interface and from there to the outer contour.
"""

import numpy as np

from evfem.common.arrays import Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.mesh import Mesh, raised

#: Semi-axes (A, B) in mm of the bone, the interface and the outer contour.
BONE, INTERFACE, OUTER = (3.0, 2.5), (7.96, 6.015), (8.34, 6.395)
#: level -> cells around, across the tissue, across the skin; 793, 3025, 23253 and 46657 nodes.
LEVELS = {0: (60, 10, 2), 1: (120, 20, 4), 2: (336, 56, 12), 3: (480, 80, 16)}


def benchmark_mesh(level: int, order: int = 1, *, same_nodes: bool = False) -> Mesh:
    """Mesh L0 ... L3: regions `tissue`, `skin`; sets `pad` (outer contour), `bone` (with both cut edges).

    `order` 2: quadratic cells with straight edges on the outline of the linear mesh (as many cells); with
    `same_nodes` instead each block of 2 x 2 linear cells becomes one cell through the same nodes.

    >>> [len(benchmark_mesh(level).points) for level in LEVELS]
    [793, 3025, 23253, 46657]
    >>> benchmark_mesh(0, 2).kind, len(benchmark_mesh(0, 2, same_nodes=True).cells)
    ('quad9', 180)

    """
    if level not in LEVELS:
        raise InputError("level", describe_value(level), "0, 1, 2 or 3")
    return divided_mesh(LEVELS[level], order, same_nodes=same_nodes)


def divided_mesh(divisions: tuple[int, int, int], order: int = 1, *, same_nodes: bool = False) -> Mesh:
    """The same with so many linear cells around, across the tissue and across the skin.

    >>> len(divided_mesh((30, 5, 1)).points)
    217
    """
    around, tissue, skin = divisions
    across = tissue + skin
    theta = np.pi * (1.0 + np.arange(around + 1) / around)
    circle = np.column_stack([np.cos(theta), np.sin(theta)])
    bone, middle, outer = (np.array(axes) * circle for axes in (BONE, INTERFACE, OUTER))
    bone[[0, -1], 1] = middle[[0, -1], 1] = outer[[0, -1], 1] = 0.0
    s, t = np.arange(tissue) / tissue, np.arange(skin + 1) / skin
    lines = [(1 - v) * bone + v * middle for v in s] + [(1 - v) * middle + v * outer for v in t]
    node = np.arange((across + 1) * (around + 1)).reshape(across + 1, around + 1)
    sets = {"pad": node[-1], "bone": np.unique(np.concatenate([node[0], node[:, 0], node[:, -1]]))}
    names = {"tissue": 0, "skin": 1}
    if order == 2 and same_nodes:
        cells, rows, kind = _blocks(node), np.arange(across // 2) >= tissue // 2, "quad9"
    else:
        cells, rows, kind = _quads(node), np.arange(across) >= tissue, "quad"
    region = np.repeat(rows.astype(np.int64), len(cells) // len(rows))
    mesh = Mesh(np.vstack(lines), cells, kind, region, names, sets)
    return raised(mesh) if order == 2 else mesh


def _quads(node: Ints) -> Ints:
    corners = [node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]]
    return np.stack([c.ravel() for c in corners], axis=1)


def _blocks(node: Ints) -> Ints:
    rows, columns = node.shape[0] - 2, node.shape[1] - 2
    n = [[node[i : rows + i : 2, j : columns + j : 2].ravel() for j in range(3)] for i in range(3)]
    ring = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    return np.stack([n[i][j] for i, j in ring], axis=1)

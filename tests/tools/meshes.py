"""Meshes of the tests: cells between rows of points, blocks, what is fine near a contact, and pads without
a body.
"""

import numpy as np

from evfem.mesh.mesh import Mesh
from evfem.studies.stability.scenes import block as block
from evfem.surface.pad import Pad

KINDS = ("quad", "quad9", "triangle", "triangle6")
#: kind -> corners (row, column) of the cells in a square of points, in the order of the kind
CORNERS = {
    "quad": ["00 01 11 10"],
    "triangle": ["00 01 11", "00 11 10"],
    "quad9": ["00 02 22 20 01 12 21 10 11"],
    "triangle6": ["00 02 22 01 12 11", "00 22 20 11 21 10"],
}


def cells_between(node, kind="quad"):
    """Cells of a kind on the numbers `node` (rows, columns) of points, row by row."""
    size = 2 if kind in ("quad9", "triangle6") else 1
    rows, columns = node.shape[0] - size, node.shape[1] - size
    cells = []
    for text in CORNERS[kind]:
        places = [(int(row), int(column)) for row, column in text.split()]
        corners = [node[i : rows + i : size, j : columns + j : size].ravel() for i, j in places]
        cells.append(np.stack(corners, axis=1))
    return np.stack(cells, axis=1).reshape(-1, len(places))


def between(x, y, kind="quad"):
    """Cells on points x, y (rows, columns), both growing; sets bottom, top, left and right, one region 0."""
    node = np.arange(x.size).reshape(x.shape)
    cells = cells_between(node, kind)
    sets = {"bottom": node[0], "top": node[-1], "left": node[:, 0], "right": node[:, -1]}
    points = np.column_stack([x.ravel(), y.ravel()])
    return Mesh(points, cells, kind, np.zeros(len(cells), dtype=int), {"tissue": 0}, sets)


def held(mesh, pad=None, bone=None, region=None, names=None):
    """The mesh with the sets `pad` (the bottom) and `bone` (the top) alone, and perhaps regions by name."""
    sets = {
        "pad": mesh.node_sets["bottom"] if pad is None else pad,
        "bone": mesh.node_sets["top"] if bone is None else bone,
    }
    region = mesh.region if region is None else region
    sets = {name: nodes.copy() for name, nodes in sets.items()}
    return Mesh(mesh.points, mesh.cells, mesh.kind, region, names or mesh.region_names, sets)


def square_mesh(kind="quad"):
    """[-1, 1] x [0, 2] in cells of one kind, two regions, the lower side `pad`, the upper side `bone`."""
    n = 5 if kind in ("quad9", "triangle6") else 3
    mesh = between(*np.meshgrid(np.linspace(-1, 1, n), np.linspace(0, 2, n)), kind)
    upper = np.arange(len(mesh.cells)) >= len(mesh.cells) // 2
    return held(mesh, region=upper.astype(int), names={"soft": 0, "hard": 1})


def graded(fine, size, end, growth):
    """Places 0 ... end: steps of `size` up to `fine`, then steps that grow by the factor `growth`."""
    uniform = np.linspace(0.0, fine, round(fine / size) + 1)
    steps = [size * growth]
    while sum(steps) < end - fine:
        steps.append(steps[-1] * growth)
    return np.concatenate([uniform, fine + np.cumsum(steps) * (end - fine) / sum(steps)])


def both_sides(places):
    """The places and their mirror images."""
    return np.concatenate([-places[:0:-1], places])


def parabola(radius, flat=np.inf):
    """x^2/(2 radius), which levels off beyond abs(x) of about `flat`; 0.5 (x/flat)^4 off before."""
    return lambda x: x**2 / (2.0 * radius) / np.sqrt(1.0 + (x / flat) ** 4)


def contact_block(x, y, pad, lower=np.zeros_like, quadratic=True):
    """quad9 (or quad) cells with corners on x, y (y from 0 up), the lower side moved up by lower(x).

    `pad`: nodes of the lower side in abs(x) <= pad; `bone`: the upper side.
    """
    if quadratic:
        x, y = (np.sort(np.concatenate([s, 0.5 * (s[1:] + s[:-1])])) for s in (x, y))
    across, up = np.meshgrid(x, y)
    mesh = between(across, up + lower(across) * (1.0 - up / y[-1]), "quad9" if quadratic else "quad")
    return held(mesh, pad=np.flatnonzero(np.abs(x) <= pad + 1e-12))


def arc(number, radius, width, quadratic=True):
    """A pad like the bottom of a cylinder, its nodes from left to right."""
    x = np.linspace(-0.5 * width, 0.5 * width, 2 * number + 1)
    points = np.stack([x, radius - np.sqrt(radius**2 - x**2)], axis=1)
    start = 2 * np.arange(number)
    edges = np.stack([start, start + 2, start + 1], axis=1)
    if not quadratic:
        start = np.arange(2 * number)
        edges = np.stack([start, start + 1], axis=1)
    return Pad(np.arange(x.size), edges, np.ones(x.size, bool)), points

"""Meshes of the tests: cells between rows of points, blocks, half a finger, what is fine near a
contact, and pads without a body.
"""

import numpy as np

from evfem.mesh.mesh import Mesh
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


def block(columns=8, rows=4, width=4.0, height=2.0, sag=0.0):
    """A block with its lower side at y = 0 in the middle and `sag` mm higher at both ends."""
    x, t = np.meshgrid(np.linspace(-width / 2, width / 2, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    low = sag * (2.0 * x / width) ** 2
    return held(between(x, low + t * (height - low)))


def square_mesh(kind="quad"):
    """[-1, 1] x [0, 2] in cells of one kind, two regions, the lower side `pad`, the upper side `bone`."""
    n = 5 if kind in ("quad9", "triangle6") else 3
    mesh = between(*np.meshgrid(np.linspace(-1, 1, n), np.linspace(0, 2, n)), kind)
    upper = np.arange(len(mesh.cells)) >= len(mesh.cells) // 2
    return held(mesh, region=upper.astype(int), names={"soft": 0, "hard": 1})


def half_finger(around=60, tissue=10, skin=2):
    """Half a finger between two ellipses, the press-and-slide benchmark's: lines from the bone to the skin.

    `tissue` and `skin` are numbers of cells across them.
    """
    theta = np.pi * (1.0 + np.arange(around + 1) / around)
    circle = np.stack([np.cos(theta), np.sin(theta)])
    circle[1, [0, -1]] = 0.0
    bone, middle, outer = (
        np.array(axes)[:, None] * circle for axes in ((3.0, 2.5), (7.96, 6.015), (8.34, 6.395))
    )
    lines = [bone + s * (middle - bone) for s in np.arange(tissue) / tissue]
    lines += [middle + s * (outer - middle) for s in np.arange(skin + 1) / skin]
    x, y = np.stack(lines[::-1], axis=1)  # from the skin up
    mesh = between(x, y)
    in_skin = np.arange(len(mesh.cells)) < skin * around
    return held(
        mesh,
        bone=np.unique(np.concatenate([mesh.node_sets[side] for side in ("top", "left", "right")])),
        region=in_skin.astype(int),
        names={"tissue": 0, "skin": 1},
    )


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

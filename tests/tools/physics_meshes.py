"""Quadratic blocks graded towards a contact, to compare with closed forms of contacts on large bodies."""

import numpy as np

from evfem.mesh.mesh import Mesh


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


def block(x, y, pad, lower=np.zeros_like):
    """quad9 cells with corners on x, y (y from 0 up), the lower side moved up by lower(x).

    `pad`: nodes of the lower side in abs(x) <= pad; `bone`: the upper side.
    """
    x, y = (np.sort(np.concatenate([s, 0.5 * (s[1:] + s[:-1])])) for s in (x, y))
    gx, gy = np.meshgrid(x, y, indexing="ij")
    points = np.stack([gx, gy + lower(gx) * (1.0 - gy / y[-1])], axis=-1).reshape(-1, 2)
    node = np.arange(gx.size).reshape(gx.shape)
    local = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1), (1, 1)]
    last = np.array(gx.shape) - 2
    cells = [node[i : i + last[0] : 2, j : j + last[1] : 2].ravel() for i, j in local]
    sets = {"pad": node[np.abs(x) <= pad + 1e-12, 0], "bone": node[:, -1]}
    region = np.zeros(len(cells[0]), dtype=int)
    return Mesh(points, np.stack(cells, axis=1), "quad9", region, {"tissue": 0}, sets)


def pad_state(result, k=-1):
    """Of frame k along the pad: x relative to the bone, current tributary lengths, fields by name.

    The nodes of a quadratic edge carry 1/6, 4/6, 1/6 of its length.
    """
    frame, pad = result.frames[k], result.mesh.node_sets["pad"]
    pad = pad[np.argsort(result.mesh.points[pad, 0])]
    x = result.mesh.points[pad, 0] + frame.displacement[pad, 0] - frame.position
    length = np.zeros(len(pad))
    edge = x[2::2] - x[:-2:2]
    length[1::2] += edge * 4.0 / 6.0
    length[:-2:2] += edge / 6.0
    length[2::2] += edge / 6.0
    names = ("contact_pressure", "shear_traction", "contact_status", "gap")
    return x, length, {name: getattr(frame, name)[pad] for name in names}

"""A square of four cells that is pressed and slid: its mesh, a scene file, and a small made-up result."""

import numpy as np

from evfem.mesh.mesh import Mesh
from evfem.simulation.result import COLUMNS, Frame, Result

KINDS = ("quad", "quad9", "triangle", "triangle6")
#: a scene file but for its motion, beside `square_mesh` in square.vtu
SQUARE_SCENE = """
version = 1
[finger]
mesh = "square.vtu"
[finger.materials.soft]
law = "neo_hookean"
E = 0.05
nu = 0.4
[finger.materials.hard]
law = "neo_hookean"
E = 0.1
nu = 0.3
[surface]
kind = "flat"
friction = 0.2
"""


def square_mesh(kind="quad"):
    """[-1, 1] x [0, 2] in cells of one kind, two regions, the lower side `pad`, the upper side `bone`."""
    n = 5 if kind in ("quad9", "triangle6") else 3
    x, y = np.meshgrid(np.linspace(-1, 1, n), np.linspace(0, 2, n))
    number = np.arange(n * n).reshape(n, n)
    step = 2 if n == 5 else 1
    cells, region = [], []
    for j in range(0, n - 1, step):
        for i in range(0, n - 1, step):
            block = number[j : j + step + 1, i : i + step + 1]
            new = _cells(block, kind)
            cells += new
            region += [int(j > 0)] * len(new)
    sets = {"pad": number[0], "bone": number[-1]}
    points = np.column_stack([x.ravel(), y.ravel()])
    names = {"soft": 0, "hard": 1}
    return Mesh(
        points, np.array(cells), kind, np.array(region), names, {k: v.copy() for k, v in sets.items()}
    )


def _cells(b, kind):
    if kind == "quad":
        return [[b[0, 0], b[0, 1], b[1, 1], b[1, 0]]]
    if kind == "triangle":
        return [[b[0, 0], b[0, 1], b[1, 1]], [b[0, 0], b[1, 1], b[1, 0]]]
    if kind == "quad9":
        return [[b[0, 0], b[0, 2], b[2, 2], b[2, 0], b[0, 1], b[1, 2], b[2, 1], b[1, 0], b[1, 1]]]
    lower = [b[0, 0], b[0, 2], b[2, 2], b[0, 1], b[1, 2], b[1, 1]]
    return [lower, [b[0, 0], b[2, 2], b[2, 0], b[1, 1], b[2, 1], b[1, 0]]]


def fake_row(step):
    """Two steps of press, then slide; every number different and not representable in few digits."""
    row = {name: (step + i) / 7.0 for i, name in enumerate(COLUMNS)}
    pressing = step <= 2
    row |= {"step": step, "motion_index": int(not pressing), "motion": "press" if pressing else "slide"}
    return row | {
        "time": 0.0,
        "position": 0.0 if pressing else 0.1 * (step - 2),
        "substeps": 1,
        "newton_iterations": 3,
    }


def fake_frame(mesh, step):
    """Fields with the properties of real ones: NaN gap and no traction off the pad."""
    n, e = len(mesh.points), len(mesh.cells)
    pad = np.isin(np.arange(n), mesh.node_sets["pad"])
    x, y = mesh.points.T
    u = 0.01 * step * np.column_stack([1 + y, -y * (1 + x**2)])
    pressure = np.where(pad, 0.02 * (1 - x**2), 0.0)
    values = np.arange(e) + 0.1 * step
    return Frame(
        step=step,
        time=0.0,
        position=fake_row(step)["position"],
        displacement=u,
        gap=np.where(pad, 0.1 * x**2, np.nan),
        contact_pressure=pressure,
        shear_traction=0.3 * pressure,
        electrostatic_traction=np.where(pad, 1e-3, 0.0),
        contact_status=np.where(pad & (np.abs(x) < 0.9), 2, 0),
        von_mises=values,
        cauchy_stress=np.outer(values, [1.0, 2.0, 3.0, 4.0]),
        J=1.0 + 0.01 * values,
    )


def fake_result(kind="quad", steps=4, provenance=None):
    """Every second step has a frame."""
    mesh = square_mesh(kind)
    rows = [fake_row(step) for step in range(1, steps + 1)]
    frames = [fake_frame(mesh, step) for step in range(2, steps + 1, 2)]
    return Result.from_rows(
        rows, frames, mesh, provenance or {"scene": {"name": "fake", "total_steps": steps}}
    )

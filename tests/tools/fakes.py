"""A square of four cells that is pressed and slid: a scene file, and a small made-up result."""

import numpy as np

from evfem.simulation.result import COLUMNS, Frame, Result
from tools.meshes import square_mesh

#: a scene file but for its motion, beside `meshes.square_mesh` in square.vtu
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
#: it is pressed and slides
PRESS_AND_SLIDE = """
[[motion]]
kind = "press"
indentation = 0.2
steps = 2
[[motion]]
kind = "slide"
distance = 0.5
steps = 3
"""


def lines_of(ax):
    """The lines of a picture by their labels."""
    return {line.get_label(): line for line in ax.get_lines()}


def bar_of(ax):
    """The bar of its colours."""
    (bar,) = [one for one in ax.figure.axes if one.get_label() == "<colorbar>"]
    return bar


def fake_row(step, rooms=()):
    """Two steps of press, then slide; every number different and not representable in few digits; with
    further columns of these names.
    """
    row = {name: (step + i) / 7.0 for i, name in enumerate((*COLUMNS, *rooms))}
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
        surface_sink=np.zeros(len(mesh.points)),
        contact_status=np.where(pad & (np.abs(x) < 0.9), 2, 0),
        von_mises=values,
        cauchy_stress=np.outer(values, [1.0, 2.0, 3.0, 4.0]),
        J=1.0 + 0.01 * values,
    )


def fake_result(kind="quad", steps=4, provenance=None, rooms=()):
    """Every second step has a frame."""
    mesh = square_mesh(kind)
    rows = [fake_row(step, rooms) for step in range(1, steps + 1)]
    frames = [fake_frame(mesh, step) for step in range(2, steps + 1, 2)]
    return Result.from_rows(
        rows, frames, mesh, provenance or {"scene": {"name": "fake", "total_steps": steps}}
    )

"""Pictures of results and meshes with matplotlib: functions that return the Axes they drew on.

Figures are made without pyplot, so nothing stays open and no global state changes: save one with
`forces(result).figure.savefig("forces.png")`. Colours are told apart with any colour vision (Okabe
and Ito, 2008).
"""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.simulation.result import POINT_FIELDS, Frame, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILION = "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00"
REGION_COLORS = (SKY, ORANGE, BLUE, GREEN, VERMILION, "#CC79A7", "#F0E442")
FORCES = {
    "normal_force": ("normal (contact)", BLUE, "-"),
    "tangential_force": ("tangential (contact)", VERMILION, "-"),
    "applied_force": ("applied on the bone", BLACK, ":"),
    "electrostatic_force": ("electrostatic", GREEN, "--"),
}
ABSCISSAE = {
    "step": "step",
    "position": "position of the bone (mm)",
    "time": "time (s)",
    "indentation": "indentation (mm)",
    "voltage": "voltage (V)",
}
STRESSES = tuple(f"cauchy_stress_{c}" for c in ("xx", "yy", "zz", "xy"))
UNITS = {"displacement": "mm", "gap": "mm", "contact_status": "0 open, 1 stick, 2 slip", "J": "1"}
FIELDS = ("von_mises", *STRESSES, "J", "displacement", *POINT_FIELDS)


def forces(result: Result, over: str | None = None, ax: Axes | None = None) -> Axes:
    """Normal, tangential, applied and electrostatic force (N/mm, of a total N) over `over`.

    `over` is step, position, time, indentation or voltage; None takes the position if it changes
    in every step, the time if the finger waits, else the step, with the motions marked. A force
    that is 0 throughout is left out.
    """
    if over is None:
        over = "time" if "wait" in result.motion else "step"
        over = "position" if _advances(result.position) else over
    if over not in ABSCISSAE:
        raise InputError("over", over, " | ".join(ABSCISSAE))
    ax = _axes(ax)
    x = getattr(result, over)
    marker = "o" if len(x) < 3 else None
    for name, (label, color, style) in FORCES.items():
        y = getattr(result, name)
        if name == "applied_force" or np.any(y != 0.0):
            ax.plot(x, y, linestyle=style, color=color, label=label, marker=marker)
    if over == "step":
        _mark_motions(ax, result)
    ax.set_xlabel(ABSCISSAE[over])
    unit = result.units["normal_force"]
    ax.set_ylabel("force (N)" if unit == "N" else f"force per depth ({unit})")
    ax.grid(alpha=0.3)
    ax.legend()
    return ax


def deformed(result: Result, field: str = "von_mises", frame: int = -1, ax: Axes | None = None) -> Axes:
    """The deformed finger of a frame, coloured by a field (see `FIELDS`), in true proportions.

    Cell fields fill their cells, nodal fields are interpolated; curved edges of quadratic cells
    are drawn through their middle nodes. Region borders are thin lines.
    """
    if field not in FIELDS:
        raise InputError("field", field, " | ".join(FIELDS))
    shown = _frame(result, frame)
    ax = _axes(ax)
    points = result.mesh.points + shown.displacement
    if field == "displacement":
        colors = _by_node(ax, result.mesh, points, np.hypot(*shown.displacement.T))
    elif field in POINT_FIELDS:
        colors = _by_node(ax, result.mesh, points, np.nan_to_num(getattr(shown, field)))
    else:
        colors = _by_cell(ax, result.mesh, points, _cell_values(shown, field))
    _draw_borders(ax, result.mesh, points)
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")
    ax.set_title(f"step {shown.step}, position {shown.position:.4g} mm", fontsize="medium")
    name = field.replace("_", " ").replace("mises", "Mises")
    ax.figure.colorbar(colors, ax=ax, label=f"{name} ({UNITS.get(field, 'MPa')})", shrink=0.8)
    return ax


def regions(mesh: Mesh, ax: Axes | None = None) -> Axes:
    """The cells of an undeformed mesh, each region in a colour of its own:
    `regions(finger.mesh())`.
    """
    from matplotlib.collections import PolyCollection

    ax = _axes(ax)
    outlines = mesh.points[_outline(mesh)]
    for (name, number), color in zip(mesh.region_names.items(), cycle(REGION_COLORS), strict=False):
        cells, label = list(outlines[mesh.region == number]), name.replace("_", " ")
        ax.add_collection(
            PolyCollection(cells, facecolors=color, edgecolors="white", linewidths=0.2, label=label)
        )
    ax.set_aspect("equal")
    ax.autoscale_view()
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("y (mm)")
    left, right = ax.get_xlim()
    ax.set_xlim(left, right + 0.45 * (right - left))  # the legend stands beside the mesh
    ax.legend(loc="upper right")
    return ax


def contact_pressure(result: Result, frame: int = -1, ax: Axes | None = None) -> Axes:
    """Contact pressure, shear and electrostatic traction (MPa) of the pad over its current x (mm)."""
    shown = _frame(result, frame)
    ax = _axes(ax)
    pad = np.flatnonzero(np.isfinite(shown.gap))
    x = result.mesh.points[pad, 0] + shown.displacement[pad, 0]
    pad, x = pad[np.argsort(x)], np.sort(x)
    lines = (("contact_pressure", BLUE, "-"), ("shear_traction", VERMILION, "-"))
    for name, color, style in (*lines, ("electrostatic_traction", GREEN, "--")):
        values = getattr(shown, name)[pad]
        if name == "contact_pressure" or np.any(values != 0.0):
            ax.plot(x, values, linestyle=style, color=color, label=name.replace("_", " "))
    touching = x[shown.contact_status[pad] > 0]
    if len(touching):
        margin = 0.25 * (touching[-1] - touching[0]) + 0.2
        ax.set_xlim(touching[0] - margin, touching[-1] + margin)
    ax.set_xlabel("x (mm)")
    ax.set_ylabel("traction (MPa)")
    ax.set_title(f"step {shown.step}, position {shown.position:.4g} mm", fontsize="medium")
    ax.grid(alpha=0.3)
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.35 * (high - low))  # the legend stands above the peaks of the ridges
    ax.legend(loc="upper left")
    return ax


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    from matplotlib.figure import Figure

    return Figure(figsize=(7.0, 4.5), layout="constrained").add_subplot()


def _frame(result: Result, number: int) -> Frame:
    if not -len(result.frames) <= number < len(result.frames):
        raise InputError("frame", number, f"the number of one of the {len(result.frames)} frames kept")
    return result.frames[number]


def _advances(values: Floats) -> bool:
    return len(values) > 1 and bool(np.all(np.diff(values) > 0.0))


def _mark_motions(ax: Axes, result: Result) -> None:
    """A thin line where a motion ends, and its name above."""
    ends = [*np.flatnonzero(np.diff(result.motion_index)).tolist(), len(result.step) - 1]
    start = 0
    for end in ends:
        if end < 0:
            return
        if end < len(result.step) - 1:
            ax.axvline(result.step[end] + 0.5, color="0.6", linewidth=0.8)
        middle = 0.5 * (result.step[start] + result.step[end])
        ax.annotate(result.motion[end], (middle, 1.01), xycoords=ax.get_xaxis_transform(), ha="center")
        start = end + 1


def _cell_values(frame: Frame, field: str) -> Floats:
    if field in STRESSES:
        return frame.cauchy_stress[:, STRESSES.index(field)]
    return getattr(frame, field)


def _outline(mesh: Mesh) -> Ints:
    """Nodes of each cell once around, middle nodes between their corners."""
    m = mesh.corners
    if mesh.order == 1:
        return mesh.cells
    return mesh.cells[:, np.column_stack([np.arange(m), m + np.arange(m)]).ravel()]


def _by_cell(ax: Axes, mesh: Mesh, points: Floats, values: Floats):  # type: ignore[no-untyped-def]
    from matplotlib.collections import PolyCollection

    outlines = points[_outline(mesh)]
    cells = PolyCollection(list(outlines), array=values, cmap="viridis", edgecolors="face", linewidths=0.5)
    return ax.add_collection(cells)


def _by_node(ax: Axes, mesh: Mesh, points: Floats, values: Floats):  # type: ignore[no-untyped-def]
    from matplotlib.tri import Triangulation

    around = _outline(mesh)
    n = around.shape[1]
    if mesh.kind == "quad9":  # a fan around the middle node
        fans = [np.column_stack([mesh.cells[:, 8], around[:, i], around[:, (i + 1) % n]]) for i in range(n)]
    elif mesh.kind == "triangle6":  # three corners and the triangle of middle nodes
        fans = [mesh.cells[:, nodes] for nodes in ([0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5])]
    else:
        fans = [np.column_stack([around[:, 0], around[:, i], around[:, i + 1]]) for i in range(1, n - 1)]
    triangles = Triangulation(points[:, 0], points[:, 1], np.concatenate(fans))
    return ax.tripcolor(triangles, values, shading="gouraud", cmap="viridis")


def _draw_borders(ax: Axes, mesh: Mesh, points: Floats) -> None:
    """The outer outline and the lines between regions."""
    from matplotlib.collections import LineCollection

    m = mesh.corners
    columns = [np.arange(m), (np.arange(m) + 1) % m] + ([m + np.arange(m)] if mesh.order == 2 else [])
    edges = mesh.cells[:, np.array(columns).T].reshape(-1, len(columns))
    owner = np.repeat(mesh.region, m)
    ends = np.sort(edges[:, :2], axis=1)
    _, first, number, count = np.unique(
        ends, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    number = number.ravel()
    low, high = np.full(len(count), np.inf), np.full(len(count), -np.inf)
    np.minimum.at(low, number, owner)
    np.maximum.at(high, number, owner)
    border = edges[first[(count == 1) | (low < high)]]
    order = [0, 2, 1] if mesh.order == 2 else [0, 1]
    ax.add_collection(LineCollection(list(points[border[:, order]]), colors="0.2", linewidths=0.4))

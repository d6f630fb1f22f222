"""The deformed finger over its surface, coloured by a field; several beside each other on one scale."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError, quoted
from evfem.mesh.mesh import Mesh
from evfem.plotting.fields import (
    TRACTIONS,
    Height,
    Scale,
    Window,
    areas,
    check_field,
    draw_arrows,
    draw_outline,
    frame_of,
    height_of,
    patches,
    rounds,
    scale_of,
    shown_values,
    values_of,
    within,
)
from evfem.plotting.figures import (
    EDGE,
    GROUND,
    STATUS,
    WIDTH,
    Panels,
    add_colorbar,
    axes_or_new,
    new_figure,
    styled,
)
from evfem.plotting.labels import field_label, named
from evfem.simulation.result import POINT_FIELDS, Frame, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Near = Literal["contact"] | Window | None
#: what is shown below the surface and beside the finger, as a share of the picture or the finger
BELOW, MARGIN = 0.16, 0.03
#: width of a close-up over that of the contact; its height over its width, for the tissue and the pad
WIDER, OF_TISSUE, OF_PAD = 1.2, 0.42, 0.3
ACROSS = 3.3  # inches for each of several fingers beside each other


def deformed(
    result: Result,
    field: str = "von_mises",
    frame: int = -1,
    ax: Axes | None = None,
    *,
    near: Near = None,
    vmin: float | None = None,
    vmax: float | None = None,
    smooth: bool = True,
) -> Axes:
    """The deformed finger of a frame over its surface, coloured by a field (see `FIELDS`), in true
    proportions.

    Parameters
    ----------
    result
        A result of a plane finger.
    field
        A field of the tissue (stress, `J`, `displacement`) fills the finger. A field of the pad
        (`contact_pressure`, `shear_traction`, `electrostatic_traction`, `gap`, `contact_status`,
        `surface_sink`)
        colours its outline; tractions are arrows too, the longest where they are largest.
    frame
        Index in `result.frames`.
    ax
        Axes to draw in; None: new ones.
    near
        "contact": a close-up of the contact, or of the smallest gap. A window (left, right, bottom,
        top) in mm. None: the whole finger.
    vmin, vmax
        Range of the colours; None: that of the values shown.
    smooth
        Nodal averages in each region, or one colour per cell. Thin lines are borders of regions.

    Returns
    -------
    Axes
        The axes of the picture.

    Raises
    ------
    InputError
        Another field or frame, or a finger in three dimensions.
    """
    check_field(field)
    check_plane(result.mesh)
    return picture(View(result, frame_of(result, frame), field, smooth), near, (vmin, vmax), ax)


def picture(view: Any, near: Near, limits: tuple[float | None, float | None], ax: Axes | None) -> Axes:
    """A view (`View`, or that of a skin) with its title and colour bar."""
    window = view.window(near)
    scale = scale_of(view.scaled_as, view.shown(window), *limits)
    ax = axes_or_new(ax, figure_height(window))
    mapped = view.draw(ax, window, scale)
    ax.set_title(told(view.result, view.frame), fontsize="medium")
    label_bar(add_colorbar(mapped, ax, field_label(view.field), scale.extend), view.field)
    return ax


def side_by_side(
    results: Mapping[str, Result],
    field: str = "von_mises",
    frame: int = -1,
    *,
    near: Near = "contact",
    vmin: float | None = None,
    vmax: float | None = None,
) -> Panels:
    """The deformed fingers of several results by their names: whole above, close-ups below.

    All are coloured by one field on one scale, as `deformed` does it; `near=None` leaves out the
    close-ups. The panels come row by row.
    """
    check_field(field)
    views = {name: View(one, frame_of(one, frame), field) for name, one in named(results).items()}
    rows = [[view.window(None) for view in views.values()]]
    if near is not None:
        rows.append([view.window(near) for view in views.values()])
    shown = [
        shown_values(view.result.mesh, view.frame, field, window)
        for row in rows
        for view, window in zip(views.values(), row, strict=True)
    ]
    scale = scale_of(field, np.concatenate(shown), vmin, vmax)
    tall = [max(_height(window) for window in row) for row in rows]
    figure = new_figure(sum(tall) + 0.75 * len(rows), ACROSS * len(views) + 1.0)
    axes = figure.subplots(len(rows), len(views), squeeze=False, height_ratios=tall)
    for panels, row in zip(axes, rows, strict=True):
        for ax, view, window in zip(panels, views.values(), row, strict=True):
            mapped = view.draw(ax, window, scale)
            ax.set_title(told(view.result, view.frame), fontsize="x-small")
    for ax, name in zip(axes[0], views, strict=True):
        ax.set_title(name, fontsize="medium")
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
    for ax in axes[:-1].ravel():
        ax.set_xlabel("")
    bar = figure.colorbar(mapped, ax=axes, label=field_label(field), shrink=0.8, extend=scale.extend)
    label_bar(bar, field)
    return Panels(axes.ravel())


def _height(window: Window) -> float:
    """Inches of a window that is as wide as its finger's place."""
    left, right, bottom, top = window
    return (ACROSS - 0.7) * (top - bottom) / (right - left)


@dataclass(frozen=True, eq=False)
class View:
    """A frame of a result, and the field that it is coloured by, `smooth` or cell by cell."""

    result: Result
    frame: Frame
    field: str
    smooth: bool = True

    @property
    def points(self) -> Floats:
        """Current positions (N, 2) of the nodes in mm."""
        return self.result.mesh.points + self.frame.displacement

    def window(self, near: Near) -> Window:
        """What is shown: left, right, bottom and top in mm."""
        if near is None:
            return _whole(self.points, height_of(self.result, self.frame))
        if isinstance(near, str):
            if near != "contact":
                raise InputError(
                    "near", quoted(near), "contact, or a window (left, right, bottom, top) in mm"
                )
            flat = OF_PAD if self.field in POINT_FIELDS else OF_TISSUE
            return _close(self.points, self.frame, height_of(self.result, self.frame), flat)
        return checked_window(near)

    @property
    def scaled_as(self) -> str:
        """The field whose scale it has."""
        return self.field

    def shown(self, window: Window) -> Floats:
        """The values inside a window."""
        return shown_values(self.result.mesh, self.frame, self.field, window)

    def draw(self, ax: Axes, window: Window, scale: Scale) -> Any:
        """Draw the view into axes, and return what a colour bar needs."""
        mesh, points = self.result.mesh, self.points
        height = height_of(self.result, self.frame)
        if self.field in POINT_FIELDS:
            mapped = draw_outline(ax, mesh, self.frame, self.field, scale)
        else:
            mapped = _draw_tissue(ax, mesh, points, values_of(self.frame, self.field), scale, self.smooth)
        _draw_borders(ax, mesh, points)
        _name_bone(ax, mesh, points, window)
        _draw_surface(ax, height, window)
        _mark_probes(ax, self.result, self.frame, window)
        if self.field in TRACTIONS:
            draw_arrows(ax, mesh, self.frame, self.field, height, window)
        ax.set(xlim=window[:2], ylim=window[2:], aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
        return mapped


def check_plane(mesh: Mesh) -> None:
    """Raises InputError for a mesh in three dimensions."""
    if mesh.dim == 3:
        allowed = "a plane finger; footprint(result) and evfem.export.paraview show one in three dimensions"
        raise InputError("mesh", "a finger in three dimensions", allowed)


def checked_window(window: Any) -> Window:
    """A window of four numbers, left before right and bottom before top."""
    allowed = "contact, or a window (left, right, bottom, top) in mm"
    try:
        left, right, bottom, top = (float(value) for value in window)
    except (TypeError, ValueError) as error:
        raise InputError("near", quoted(window), allowed) from error
    if not (left < right and bottom < top and np.isfinite([left, right, bottom, top]).all()):
        raise InputError("near", quoted(window), allowed)
    return left, right, bottom, top


def _whole(points: Floats, height: Height) -> Window:
    """The whole finger and the surface below it."""
    (left, lowest), (right, top) = points.min(axis=0), points.max(axis=0)
    x = np.linspace(left, right, 500)
    aside, tall = MARGIN * (right - left), top - lowest
    ground = max(float(height(x).min()), lowest - tall)
    return left - aside, right + aside, ground - 0.6 * BELOW * tall, top + MARGIN * tall


def _close(points: Floats, frame: Frame, height: Height, flat: float) -> Window:
    """What touches, or the node with the smallest gap; `flat` is the window's height over its width."""
    touching = frame.contact_status > 0
    if not touching.any():
        touching = frame.gap == np.nanmin(frame.gap)
    left, right = points[touching, 0].min(), points[touching, 0].max()
    least = max(0.05 * np.ptp(points[:, 0]), 2.0 * float(np.nanmin(frame.gap)))
    middle, half = 0.5 * (left + right), max(0.5 * WIDER * (right - left), least)
    x = np.linspace(middle - half, middle + half, 500)
    tall = 2.0 * half * flat
    bottom = float(height(x).min()) - BELOW * tall
    return middle - half, middle + half, bottom, bottom + tall


def figure_height(window: Window) -> float:
    """Height in inches of a figure that a window fills, with its labels and a colour bar."""
    left, right, bottom, top = window
    return float(np.clip((WIDTH - 1.3) * (top - bottom) / (right - left) + 0.85, 2.2, 9.0))


def told(result: Result, frame: Frame) -> str:
    """Where the finger of a frame is, in a line."""
    rows = np.flatnonzero(result.step == frame.step)
    text = f"step {frame.step}: position {frame.position + 0.0:.4g} mm"
    if rows.size:
        row = rows[0]
        text += f", load {result.applied_force[row] + 0.0:.3g} {result.units['applied_force']}"
        text += f", {result.voltage[row]:.4g} V" if np.any(result.voltage != 0.0) else ""
    return text


def label_bar(bar: Any, field: str) -> None:
    """The statuses by their names."""
    if field == "contact_status":
        bar.set_ticks(range(len(STATUS)), labels=list(STATUS))
        bar.ax.tick_params(length=0)


def _draw_tissue(ax: Axes, mesh: Mesh, points: Floats, values: Floats, scale: Scale, smooth: bool) -> Any:
    """Every cell in its colour, or colours that change from node to node."""
    of_cells = len(values) == len(mesh.cells)
    outlines = points[rounds(mesh)]
    if not smooth:
        from matplotlib.collections import PolyCollection

        array = values if of_cells else values[mesh.cells].mean(axis=1)
        mapped: Any = PolyCollection(list(outlines), array=array, edgecolors="face", linewidths=0.3)
        ax.add_collection(mapped)
    else:
        from matplotlib.tri import Triangulation

        pieces = patches(mesh)
        array = pieces.averages(values, areas(outlines)) if of_cells else values[pieces.nodes]
        x, y = points[pieces.nodes].T
        mapped = ax.tripcolor(Triangulation(x, y, pieces.triangles), array, shading="gouraud")
    scale.apply(mapped)
    mapped.set_rasterized(True)
    return mapped


def _draw_borders(ax: Axes, mesh: Mesh, points: Floats) -> None:
    """The outer outline and the lines between regions."""
    from matplotlib.collections import LineCollection

    edges = mesh.cell_sides.reshape(-1, mesh.order + 1)
    owner = np.repeat(mesh.region, mesh.corners)
    number = mesh.sides[1].ravel()
    low, high = np.full(number.max() + 1, np.inf), np.full(number.max() + 1, -np.inf)
    np.minimum.at(low, number, owner)
    np.maximum.at(high, number, owner)
    first = np.unique(number, return_index=True)[1]
    border = edges[first[(np.bincount(number) == 1) | (low < high)]]
    order = [0, 2, 1] if mesh.order == 2 else [0, 1]
    ax.add_collection(LineCollection(list(points[border[:, order]]), colors=EDGE, linewidths=0.5))


def _name_bone(ax: Axes, mesh: Mesh, points: Floats, window: Window) -> None:
    """What the hole in the middle is, where the tissue has one around the bone."""
    edges = mesh.sides_of("bone")[:, :2] if "bone" in mesh.node_sets else np.zeros((0, 2), dtype=int)
    around, count = np.unique(edges, return_counts=True)
    if not count.size or np.any(count != 2):
        return
    middle = 0.5 * (points[around].min(axis=0) + points[around].max(axis=0))
    if within(middle[None], window)[0]:
        ax.text(middle[0], middle[1], "bone", ha="center", va="center", color="0.5", fontsize="small")


def _mark_probes(ax: Axes, result: Result, frame: Frame, window: Window) -> None:
    """The probes' points where the tissue has them, in the colours of their histories, and their names."""
    for probe, look in styled(result.probes):
        moved = probe.displacement[result.step == frame.step]
        shown = [place for place in (probe.position + moved).reshape(-1, 2) if within(place[None], window)[0]]
        for place in shown:
            ax.plot(*place, "o", color=look["color"], markersize=6.0, markeredgecolor="white", zorder=3.0)
        if shown:
            box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
            at: dict[str, Any] = {
                "textcoords": "offset points",
                "va": "center",
                "fontsize": "small",
                "zorder": 3.0,
            }
            ax.annotate(look["label"], shown[-1], (6.0, 0.0), color=look["color"], bbox=box, **at)


def _draw_surface(ax: Axes, height: Height, window: Window) -> None:
    """The surface, filled down to the lower end of the window."""
    x = np.linspace(window[0], window[1], 2001)
    y = height(x)
    ax.fill_between(x, y, min(window[2], y.min()), color=GROUND, linewidth=0.0, zorder=0.5)
    ax.plot(x, y, color="black", linewidth=0.8, zorder=2.5)

"""The deformed finger over its surface, coloured by a field; several beside each other on one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice
from evfem.errors import InputError, describe_value
from evfem.mesh.mesh import Mesh
from evfem.mesh.split import nodal_means
from evfem.plotting import fields, figures
from evfem.plotting.labels import check_result, field_label, field_unit, named, shown_in
from evfem.plotting.solid import SolidView
from evfem.simulation.result import POINT_FIELDS, Frame, Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Near = Literal["contact"] | fields.Window | None
#: what is shown below the surface and beside the finger, as a fraction of the picture or the finger
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
        A result; of a finger in three dimensions the half behind its middle is shown, without its surface.
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
        Range of the colours, the same for panels beside each other, in MPa or mm; None: that of the values
        shown.
    smooth
        Nodal averages in each region, or one colour per cell. Thin lines are borders of regions.

    Returns
    -------
    Axes
        The axes of the picture.

    Raises
    ------
    InputError
        Another field or frame, or a close-up in three dimensions, which `footprint` has.
    """
    check_result(result)
    choice("field", field, fields.FIELDS)
    kind = SolidView if result.mesh.dim == 3 else View
    return picture(kind(result, fields.frame_of(result, frame), field, smooth), near, (vmin, vmax), ax)


def picture(view: Any, near: Near, limits: tuple[float | None, float | None], ax: Axes | None) -> Axes:
    """A view (`View`, or that of a skin) with its title and colour bar."""
    window = view.window(near)
    scale = fields.scale_of(view.scaled_as, view.shown(window), *limits)
    if ax is None:  # the layout that keeps room for the labels of a narrow window
        ax = figures.axes_or_new(None, figure_height(window))
        figures.whole_figure(ax).set_layout_engine("compressed")
    mapped = view.draw(ax, window, scale)
    label_bar(figures.add_colorbar(mapped, ax, "", scale.extend), view.field, scale)
    return figures.add_title(ax, told(view.result, view.frame))


def side_by_side(
    results: Mapping[str, Result] | Result,
    field: str = "von_mises",
    frame: int | Sequence[int] = -1,
    *,
    near: Near = "contact",
    vmin: float | None = None,
    vmax: float | None = None,
) -> figures.Panels:
    """The deformed fingers of several results by their names: whole above, close-ups below. With several
    frames, those of each result beside each other.

    All are coloured by one field on one scale, as `deformed` does it; within a row all show the same window,
    with arrows as long for as large a traction. `near=None` leaves out the close-ups. The panels come row by
    row.
    """
    choice("field", field, fields.FIELDS)
    views = _views(named(results), field, frame)
    levels = [None] if near is None else [None, near]
    rows = [[_joined([view.window(level) for view in views.values()])] * len(views) for level in levels]
    pairs = (pair for row in rows for pair in zip(views.values(), row, strict=True))
    scale = fields.scale_of(field, np.concatenate([view.shown(window) for view, window in pairs]), vmin, vmax)
    shapes = [[(top - bottom) / (right - left) for left, right, bottom, top in row] for row in rows]
    tall = [(ACROSS - 0.7) * max(row) for row in shapes]
    figure = figures.new_figure(sum(tall) + 0.75 * len(rows), ACROSS * len(views) + 1.0)
    figure.set_layout_engine("compressed")
    axes = figure.subplots(len(rows), len(views), squeeze=False, height_ratios=tall)
    for panels, row in zip(axes, rows, strict=True):
        reach = min(view.reach(window) for view, window in zip(views.values(), row, strict=True))
        for ax, view, window in zip(panels, views.values(), row, strict=True):
            mapped = view.draw(ax, window, scale, reach)
            ax.set_title(told(view.result, view.frame), fontsize="x-small")
    for ax in axes[:, 1:].ravel():
        ax.set_ylabel("")
        ax.tick_params(labelleft=False)
    for ax in axes[:-1].ravel():
        ax.set_xlabel("")
    label_bar(figure.colorbar(mapped, ax=axes, shrink=0.8, extend=scale.extend), field, scale)
    for ax, (name, view) in zip(axes[0], views.items(), strict=True):
        figures.add_title(ax, name if near else f"{name}, {told(view.result, view.frame)}")
    for ax in axes[1:].ravel():
        figures.add_title(ax, ax.get_title(), "x-small")
    return figures.Panels(axes.ravel())


def _views(found: Mapping[str, Result], field: str, frame: int | Sequence[int]) -> dict[str, View]:
    """What each panel shows, by its title."""
    if isinstance(frame, Sequence):
        each = [
            (name, View(one, fields.frame_of(one, k), field)) for name, one in found.items() for k in frame
        ]
        return {", ".join(filter(None, (name, f"step {view.frame.step}"))): view for name, view in each}
    return {name: View(one, fields.frame_of(one, frame), field) for name, one in found.items()}


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

    def window(self, near: Near) -> fields.Window:
        """What is shown: left, right, bottom and top in mm."""
        if near is None:
            return _whole(self.points, fields.height_of(self.result, self.frame))
        if near == "contact":
            flat = OF_PAD if self.field in POINT_FIELDS else OF_TISSUE
            return _close(self.points, self.frame, fields.height_of(self.result, self.frame), flat)
        return checked_window(near)

    @property
    def scaled_as(self) -> str:
        return self.field

    def shown(self, window: fields.Window) -> Floats:
        """The values inside a window (left, right, bottom, top in mm): of cells, nodes or pad's nodes."""
        place, values = self.points, fields.values_of(self.frame, self.field)
        if self.field in fields.CELL_FIELDS:
            return values[fields.within(place[self.result.mesh.cells].mean(axis=1), window)]
        there = fields.within(place, window)
        return values[there & np.isfinite(self.frame.gap)] if self.field in POINT_FIELDS else values[there]

    def reach(self, window: fields.Window) -> float:
        """Length of the longest arrow as a fraction of a window's width."""
        return fields.reach_of(fields.height_of(self.result, self.frame), window)

    def draw(self, ax: Axes, window: fields.Window, scale: fields.Scale, reach: float = 0.0) -> Any:
        """Draw the view into axes, with arrows of a `reach` (0: its own); returns what a colour bar needs."""
        mesh, points = self.result.mesh, self.points
        height = fields.height_of(self.result, self.frame)
        if self.field in POINT_FIELDS:
            mapped = fields.draw_outline(ax, mesh, self.frame, self.field, scale)
        else:
            mapped = _draw_tissue(
                ax, mesh, points, fields.values_of(self.frame, self.field), scale, self.smooth
            )
        _draw_borders(ax, mesh, points)
        _name_bone(ax, mesh, points, window)
        _draw_surface(ax, height, window)
        _mark_probes(ax, self.result, self.frame, window)
        if self.field in fields.TRACTIONS:
            longest = reach or self.reach(window)
            fields.draw_arrows(ax, mesh, self.frame, self.field, height, window, scale, longest)
        ax.set(xlim=window[:2], ylim=window[2:], aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
        return mapped


def check_plane(mesh: Mesh) -> None:
    """Raises InputError for a mesh in three dimensions."""
    if mesh.dim == 3:
        allowed = "a plane finger; deformed(result) and footprint(result) show one in three dimensions"
        raise InputError("mesh", "a finger in three dimensions", allowed)


def checked_window(window: Any) -> fields.Window:
    """A window of four numbers, left before right and bottom before top."""
    with suppress(TypeError, ValueError):
        left, right, bottom, top = (float(value) for value in window)
        if left < right and bottom < top and np.isfinite([left, right, bottom, top]).all():
            return left, right, bottom, top
    raise InputError("near", describe_value(window), "contact, or a window (left, right, bottom, top) in mm")


def _whole(points: Floats, height: fields.Height) -> fields.Window:
    (left, lowest), (right, top) = points.min(axis=0), points.max(axis=0)
    x = np.linspace(left, right, 500)
    aside, tall = MARGIN * (right - left), top - lowest
    ground = max(float(height(x).min()), lowest - tall)
    return left - aside, right + aside, ground - 0.6 * BELOW * tall, top + MARGIN * tall


def _close(points: Floats, frame: Frame, height: fields.Height, flat: float) -> fields.Window:
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


def _joined(windows: Sequence[fields.Window]) -> fields.Window:
    """The window around several ones."""
    left, right, bottom, top = zip(*windows, strict=True)
    return min(left), max(right), min(bottom), max(top)


def figure_height(window: fields.Window) -> float:
    """Height in inches of a figure that a window fills, with its labels and a colour bar."""
    left, right, bottom, top = window
    return float(np.clip((figures.WIDTH - 1.3) * (top - bottom) / (right - left) + 0.85, 2.2, 9.0))


def told(result: Result, frame: Frame) -> str:
    """Where the finger of a frame is, in a line."""
    text = f"step {frame.step}: position {frame.position + 0.0:.4g} mm"
    for row in np.flatnonzero(result.step == frame.step)[:1]:
        text += f", z {along:.4g} mm" if (along := float(result.position_z[row])) else ""
        text += f", load {result.applied_force[row] + 0.0:.3g} {result.units['applied_force']}"
        text += f", {result.voltage[row]:.4g} V" if np.any(result.voltage != 0.0) else ""
    return text


def label_bar(bar: Any, field: str, scale: fields.Scale) -> None:
    """What a bar's colours are, with its unit; the statuses by their names."""
    unit, factor = shown_in(field_unit(field), [scale.low, scale.high])
    bar.set_label(field_label(field, unit))
    if factor != 1.0:
        bar.ax.yaxis.set_major_formatter(lambda value, _: f"{factor * value:g}")
    if field == "contact_status":
        bar.set_ticks(range(len(figures.STATUS)), labels=list(figures.STATUS))
        bar.ax.tick_params(length=0)


def _draw_tissue(
    ax: Axes, mesh: Mesh, points: Floats, values: Floats, scale: fields.Scale, smooth: bool
) -> Any:
    """Every cell in its colour, or colours that change from node to node."""
    of_cells = len(values) == len(mesh.cells)
    outlines = points[fields.rounds(mesh)]
    if not smooth:
        from matplotlib.collections import PolyCollection

        array = values if of_cells else values[mesh.cells].mean(axis=1)
        mapped: Any = PolyCollection(list(outlines), array=array, edgecolors="face", linewidths=0.3)
        ax.add_collection(mapped)
    else:
        pieces = fields.patches(mesh)
        array = nodal_means(pieces.mesh, values, fields.areas(outlines)) if of_cells else values[pieces.nodes]
        mapped = figures.shaded(ax, points[pieces.nodes], pieces.triangles, array)
    scale.apply(mapped)
    mapped.set_rasterized(True)
    return mapped


def _draw_borders(ax: Axes, mesh: Mesh, points: Floats) -> None:
    from matplotlib.collections import LineCollection

    edges = mesh.cell_sides.reshape(-1, mesh.order + 1)
    owner, number = np.repeat(mesh.region, mesh.corners), mesh.sides[1].ravel()
    _, first, count = np.unique(number, return_index=True, return_counts=True)
    border = edges[first[(count == 1) | (np.bincount(number, owner) != count * owner[first])]]
    order = [0, 2, 1] if mesh.order == 2 else [0, 1]
    ax.add_collection(LineCollection(list(points[border[:, order]]), colors=figures.EDGE, linewidths=0.5))


def _name_bone(ax: Axes, mesh: Mesh, points: Floats, window: fields.Window) -> None:
    """What the hole in the middle is, where the tissue has one around the bone."""
    edges = mesh.sides_of("bone")[:, :2] if "bone" in mesh.node_sets else np.zeros((0, 2), dtype=int)
    around, count = np.unique(edges, return_counts=True)
    if not count.size or np.any(count != 2):
        return
    middle = 0.5 * (points[around].min(axis=0) + points[around].max(axis=0))
    if fields.within(middle[None], window)[0]:
        ax.text(middle[0], middle[1], "bone", ha="center", va="center", color="0.5", fontsize="small")


def _mark_probes(ax: Axes, result: Result, frame: Frame, window: fields.Window) -> None:
    """The probes' points where the tissue has them, in the colours of their histories, and their names."""
    for name, probe, (look, *_) in figures.probe_looks(result.probes):
        moved = probe.displacement[result.step == frame.step]
        shown = [
            place
            for place in (probe.position + moved).reshape(-1, 2)
            if fields.within(place[None], window)[0]
        ]
        for place in shown:
            ax.plot(*place, look["marker"], color=look["color"], markersize=6.0, mec="white", zorder=3.0)
        if shown:
            box = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
            text = ax.annotate(name, shown[-1], (6.0, 0.0), textcoords="offset points", bbox=box)
            text.set(color=look["color"], va="center", fontsize="small", zorder=3.0)


def _draw_surface(ax: Axes, height: fields.Height, window: fields.Window) -> None:
    x = np.linspace(window[0], window[1], 2001)
    y = height(x)
    ax.fill_between(x, y, min(window[2], y.min()), color=figures.GROUND, linewidth=0.0, zorder=0.5)
    ax.plot(x, y, color="black", linewidth=0.8, zorder=2.5)

"""Curves of the history: forces, any columns, one or several results.

A result is drawn per mm of depth, `result.total` over the whole depth: in N, mm² and mJ.

`over` is the column along the abscissa: any column that grows or falls, by default the one that
the motions change (`abscissa`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError, quoted
from evfem.plotting.colours import BLACK, BLUE, CURVES, GREEN, ORANGE, PURPLE, SKY, STYLES, VERMILION
from evfem.plotting.figures import Panels, axes_or_new, new_panels
from evfem.plotting.labels import Units, axis_label, column_label, column_text, kind_of, values_of
from evfem.simulation.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Results = Result | Mapping[str, Result]
FORCES = {
    "normal_force": ("normal (contact)", BLUE, "-"),
    "tangential_force": ("tangential (contact)", VERMILION, "-"),
    "applied_force": ("applied on the bone", BLACK, ":"),
    "electrostatic_force": ("electrostatic", GREEN, "--"),
}
ENERGIES = {
    "external_work": ("work of the bone", BLACK, ":"),
    "electrostatic_work": ("work of the attraction", GREEN, "--"),
    "stored_energy": ("stored in the tissue", BLUE, "-"),
    "friction_dissipation": ("lost to friction", VERMILION, "-"),
    "viscous_dissipation": ("lost to viscosity", ORANGE, "-."),
    "kinetic_energy": ("kinetic", SKY, "-."),
    "snap_dissipation": ("lost in snaps", PURPLE, "-."),
}
ZERO = 1e-9  # what is smaller than the largest by so much is nothing but rounding
#: width of a letter of a motion's name in inches, and height of its line in points
LETTER, HIGH = 0.085, 12.0
OVER = ("step", "position", "position_z", "time", "indentation", "voltage", "applied_force")


def abscissa(result: Result) -> str:
    """The column that a picture is drawn over: what all motions change, the time if the finger
    waits, else the step.

    Presses are drawn over the indentation, slides over the position (along the finger over
    `position_z`), voltage ramps over the voltage.
    """
    kinds = set(result.motion)
    wished = {"press": "indentation", "voltage": "voltage"}
    name = wished.get(next(iter(kinds)), "position") if len(kinds) == 1 else "position"
    if name == "position" and result.in_space and not np.ptp(result.position):
        name = "position_z"
    if _changes(result[name]):
        return name
    return "time" if "wait" in kinds else "step"


def _changes(values: Floats) -> bool:
    """Whether every step goes on in the same direction."""
    steps, least = np.diff(values), ZERO * float(np.abs(values).max(initial=0.0))
    return steps.size > 0 and bool(np.all(steps > least) or np.all(steps < -least))


def forces(result: Result, over: str | None = None, ax: Axes | None = None) -> Axes:
    """Normal, tangential, applied and electrostatic force (N/mm) over `over`.

    `over` is step, position, time, indentation, voltage or applied_force; None takes what all
    motions change: the indentation for presses alone, the position for slides, the voltage for
    ramps; the time if the finger waits, else the step, with the motions marked. A force that is 0
    throughout is left out.
    """
    return _draw_columns(ax, result, FORCES, "applied_force", over)


def energies(result: Result, over: str | None = None, ax: Axes | None = None) -> Axes:
    """Works, stored energy and dissipations (N) over `over`, as in `forces`."""
    return _draw_columns(ax, result, ENERGIES, "external_work", over)


def _draw_columns(
    ax: Axes | None, result: Result, lines: Mapping[str, tuple[str, str, str]], always: str, over: str | None
) -> Axes:
    """Lines of columns of one kind; those that are 0 throughout only if they must `always` be
    there.
    """
    over = checked_over(over, result)
    ax = axes_or_new(ax)
    x, drawn = along(result, over, over), {name: along(result, name, over) for name in lines}
    least = ZERO * max((float(np.abs(y).max(initial=0.0)) for y in drawn.values()), default=0.0)
    for name, (label, colour, style) in lines.items():
        y = drawn[name]
        if name == always or np.any(np.abs(y) > least):
            ax.plot(x, y, style, color=colour, label=label, marker=_marker(x))
    finish(ax, result, over, axis_label(always, result.units))
    ax.legend()
    return ax


def checked_over(over: str | None, result: Result) -> str:
    """The name of the abscissa."""
    if over is None:
        return abscissa(result)
    allowed = [name for name in OVER if name in result.columns]
    if over not in allowed:
        raise InputError("over", quoted(over), " | ".join(allowed))
    return over


def along(result: Result, name: str, over: str) -> Any:
    """A column as it is drawn over another one; over the time, of the steps that take none only the
    last.
    """
    values = values_of(result, name)
    if over != "time" or not len(values):
        return values
    return values[np.append(np.diff(result.time) > 0.0, True)]


def finish(ax: Axes, result: Result, over: str, label: str) -> None:
    """Labels, grid, and over the steps the motions."""
    if over == "step":
        _mark_motions(ax, result)
    ax.set_xlabel(column_label(over, result.units))
    ax.set_ylabel(label)
    ax.grid(alpha=0.3)


def _marker(x: Any) -> str | None:
    """Few points are marked, one alone would not be seen."""
    return "o" if len(x) < 3 else None


def _mark_motions(ax: Axes, result: Result) -> None:
    """A thin line where a motion ends, and its name above; names that would run into each other
    stand in rows.
    """
    ends = [*np.flatnonzero(np.diff(result.motion_index)).tolist(), len(result.step) - 1]
    letter = LETTER * ax.figure.dpi * float(np.ptp(ax.get_xlim())) / ax.get_window_extent().width
    rows: list[float] = []  # where the last name of each row ends
    start = 0
    for end in ends:
        if end < 0:
            return
        if end < len(result.step) - 1:
            ax.axvline(result.step[end] + 0.5, color="0.6", linewidth=0.8)
        middle = 0.5 * (result.step[start] + result.step[end])
        half = 0.5 * letter * (len(result.motion[end]) + 1)
        row = next((row for row, last in enumerate(rows) if last <= middle - half), len(rows))
        rows[row:] = [middle + half, *rows[row + 1 :]]
        ax.annotate(
            result.motion[end],
            (middle, 1.0),
            (0.0, 2.0 + HIGH * row),
            xycoords=ax.get_xaxis_transform(),
            textcoords="offset points",
            ha="center",
        )
        start = end + 1


def history(result: Result, columns: Sequence[str], over: str | None = None) -> Panels:
    """Any columns of the history over `over` (see `forces`), a panel for each kind of quantity.

    Raises InputError for what is no column of numbers.
    """
    if isinstance(columns, str) or not columns:
        raise InputError("columns", quoted(columns), "a list of at least one column of the history")
    over = checked_over(over, result)
    kinds: dict[tuple[str, str], list[str]] = {}
    for name in columns:
        values_of(result, name)
        kinds.setdefault(kind_of(name, result.units), []).append(name)
    panels = new_panels(len(kinds), 1.0 + 1.9 * len(kinds))
    x = along(result, over, over)
    for ax, names in zip(panels, kinds.values(), strict=True):
        for name, colour, style in zip(names, cycle(CURVES), cycle(STYLES), strict=False):
            ax.plot(
                x,
                along(result, name, over),
                style,
                color=colour,
                label=column_text(name, result.units[name]),
                marker=_marker(x),
            )
        label = column_label if len(names) == 1 else axis_label
        ax.set_ylabel(label(names[0], result.units))
        ax.grid(alpha=0.3)
        if len(names) > 1:
            ax.legend()
    if over == "step":
        _mark_motions(panels[0], result)
    panels[-1].set_xlabel(column_label(over, result.units))
    return panels


def compare(
    results: Mapping[str, Result], column: str, over: str | None = None, ax: Axes | None = None
) -> Axes:
    """The same column of several results, each by its name, over `over` (see `forces`)."""
    found = named(results)
    over = checked_over(over, next(iter(found.values())))
    for result in found.values():
        values_of(result, column)
    ax = axes_or_new(ax)
    for (name, result), colour, style in styled(found):
        x = along(result, over, over)
        ax.plot(x, along(result, column, over), style, color=colour, label=name, marker=_marker(x))
    units = units_of(found)
    ax.set(xlabel=column_label(over, units), ylabel=column_label(column, units))
    ax.grid(alpha=0.3)
    ax.legend()
    return ax


def named(results: Results) -> dict[str, Result]:
    """Results by their names; one alone has none."""
    found = {"": results} if isinstance(results, Result) else dict(results)
    if not found:
        raise InputError("results", "nothing", "a result, or {name: result, ...}")
    if any(result.units != units_of(found) for result in found.values()):
        raise InputError("results", "some per mm of depth, some in total", "all of them alike")
    return found


def units_of(found: Mapping[str, Result]) -> Units:
    """The units that all of these results have."""
    return next(iter(found.values())).units


def styled(found: Mapping[str, Any]) -> Any:
    """Name and what stands behind it, colour, style of each curve."""
    return zip(found.items(), cycle(CURVES), cycle(STYLES), strict=False)

"""Curves: columns of the history of one result or several, tractions of a frame, residuals of a fit.

A result is drawn per mm of depth, `result.total` over the whole depth: in N, mm² and mJ. `over` is the column
along the abscissa: any column that grows or falls, by default the one that the motions change (`abscissa`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.calibration.result import FitResult
from evfem.common.checks import choice
from evfem.errors import InputError, describe_value
from evfem.plotting import figures, labels
from evfem.plotting.fields import frame_of
from evfem.plotting.finger import check_plane, told
from evfem.plotting.waveform import with_edges
from evfem.simulation import spectrum as spectra
from evfem.simulation.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FORCES = {
    "normal_force": ("normal (contact)", figures.BLUE, "-"),
    "tangential_force": ("tangential (contact)", figures.VERMILION, "-"),
    "applied_force": ("applied on the bone", figures.BLACK, ":"),
    "electrostatic_force": ("electrostatic", figures.GREEN, "--"),
}
ENERGIES = {
    "external_work": ("work of the bone", figures.BLACK, ":"),
    "electrostatic_work": ("work of the attraction", figures.GREEN, "--"),
    "stored_energy": ("stored", figures.BLUE, "-"),
    "friction_dissipation": ("lost to friction", figures.VERMILION, "-"),
    "viscous_dissipation": ("lost to viscosity", figures.ORANGE, "-."),
    "kinetic_energy": ("kinetic", figures.SKY, "-."),
    "snap_dissipation": ("lost in snaps", figures.PURPLE, "-."),
}
TRACTIONS = {
    "contact_pressure": (figures.BLUE, "-"),
    "shear_traction": (figures.VERMILION, "-"),
    "electrostatic_traction": (figures.GREEN, "--"),
}
ZERO = 1e-9  # what is smaller than the largest by so much is nothing but rounding
#: width of a letter of a motion's name in inches, and height of its line in points
LETTER, HIGH = 0.085, 13.0
OVER = ("step", "position", "position_z", "time", "indentation", "voltage", "applied_force")
#: so many frequencies are lines from 0, more are a curve; points: a line in front of another is thinner
FEW, THICK = 100, 4.0
TWO = 2.0  # standard deviations: the band that residuals of the given sd rarely leave


def abscissa(result: Result) -> str:
    """What a picture is drawn over: what all motions change, the time if the finger waits, or the step."""
    kinds = set(result.motion)
    changed = {"press": "indentation", "voltage": "voltage"}
    name = changed.get(next(iter(kinds)), "position") if len(kinds) == 1 else "position"
    if name == "position" and result.in_space and not np.ptp(result.position):
        name = "position_z"
    steps, least = np.diff(result[name]), ZERO * float(np.abs(result[name]).max(initial=0.0))
    if steps.size and (np.all(steps > least) or np.all(steps < -least)):
        return name
    return "time" if "wait" in kinds else "step"


def forces(
    result: Result,
    over: str | None = None,
    ax: Axes | None = None,
    sd: Mapping[str, Any] | None = None,
) -> Axes:
    """Normal, tangential, applied and electrostatic force (N/mm) over `over`.

    Parameters
    ----------
    result
        A result; a force that is 0 throughout is left out.
    over
        step, position, time, indentation, voltage or applied_force. None: the quantity that all
        motions change (presses: indentation, slides: position, ramps: voltage), the time if the
        finger waits, else the step, with the motions marked.
    ax
        Axes to draw in; None: new ones.
    sd
        Standard deviations of columns (steps,), as `evfem.uncertainty` gives: bands of one around them.

    Returns
    -------
    Axes
        The axes of the curves.

    Raises
    ------
    InputError
        Another `over`.
    """
    return _of_one_kind(ax, result, FORCES, "applied_force", over, sd or {})


def energies(result: Result, over: str | None = None, ax: Axes | None = None) -> Axes:
    """Works, stored energy and dissipations (N) over `over`, as in `forces`."""
    return _of_one_kind(ax, result, ENERGIES, "external_work", over, {})


def _of_one_kind(
    ax: Axes | None,
    result: Result,
    texts: Mapping[str, tuple[str, str, str]],
    always: str,
    over: str | None,
    sd: Mapping[str, Any],
) -> Axes:
    """Lines of columns of one kind, with bands of `sd`; only one of zeros must `always` be there."""
    over = checked_over(over, result)
    x, drawn = along(result, over, over), {name: along(result, name, over) for name in texts}
    sizes = {name: float(np.abs(y).max(initial=0.0)) for name, y in drawn.items()}
    lines = [
        (x, drawn[name], {"label": label, "color": colour, "linestyle": style})
        for name, (label, colour, style) in texts.items()
        if name == always or sizes[name] > ZERO * max(sizes.values())
    ]
    ax = _marked(
        figures.curves(ax, lines, "", labels.axis_label(always, result.units), legend=False), over, result
    )
    for name in (name for name in texts if name in sd):
        wide = np.asarray(sd[name])[_drawn(result, over)]
        ends = drawn[name] - wide, drawn[name] + wide
        ax.fill_between(x, *ends, color=texts[name][1], alpha=0.2, linewidth=0)
    return figures.add_legend(ax)


def checked_over(over: str | None, result: Result) -> str:
    """The name of the abscissa."""
    labels.check_result(result)
    if over is None:
        return abscissa(result)
    return choice("over", over, [name for name in OVER if name in result.columns])


def along(result: Result, name: str, over: str) -> Any:
    """A column as it is drawn over another one; over the time, of steps that take none only the last."""
    return labels.values_of(result, name)[_drawn(result, over)]


def curve(result: Result, name: str, over: str) -> tuple[Any, Any]:
    """A column as it is drawn over another one, x and y; a voltage with the edges of its waveform."""
    x, y = along(result, over, over), along(result, name, over)
    return with_edges(result, name, _drawn(result, over), np.asarray(x, dtype=float), np.asarray(y))


def _drawn(result: Result, over: str) -> Any:
    if over != "time" or not len(result.time):
        return slice(None)
    return np.append(np.diff(result.time) > 0.0, True)


def _marked(ax: Axes, over: str, first: Result, *others: Result) -> Axes:
    """The axes with their abscissa, and over the steps with the motions, if all have the same."""
    ax.set_xlabel(labels.effective(over, (first, *others)) + labels.column_label(over, first.units))
    if over == "step" and all(np.array_equal(first.motion, other.motion) for other in others):
        _mark_motions(ax, first)
    return ax


def _mark_motions(ax: Axes, result: Result) -> None:
    """A thin line where a motion ends, its name above; names that would collide stand in rows."""
    for last in np.flatnonzero(np.diff(result.motion_index)):
        ax.axvline(result.step[last] + 0.5, color="0.6", linewidth=0.8)
    letter = LETTER * ax.figure.dpi * float(np.ptp(ax.get_xlim())) / ax.get_window_extent().width
    rows: list[float] = []  # where the last name of each row ends
    for name, group in groupby(zip(result.motion, result.step, strict=True), key=itemgetter(0)):
        steps = [step for _, step in group]
        middle, half = 0.5 * (steps[0] + steps[-1]), 0.5 * letter * (len(name) + 1)
        row = next((row for row, last in enumerate(rows) if last <= middle - half), len(rows))
        rows[row:] = [middle + half, *rows[row + 1 :]]
        place, above = ax.get_xaxis_transform(), (0.0, 2.0 + HIGH * row)
        text = ax.annotate(name, (middle, 1.0), above, xycoords=place, textcoords="offset points")
        text.set(ha="center", va="bottom")


def history(
    result: Result,
    columns: Sequence[str],
    over: str | None = None,
    ax: Axes | Sequence[Axes] | None = None,
    log: str = "",
) -> figures.Panels:
    """Columns of the history over `over` (see `forces`), a panel for each kind of quantity.

    Parameters
    ----------
    result
        A result.
    columns
        Columns of its history; those of one kind and unit share a panel.
    over
        As in `forces`.
    ax
        Axes to draw in, as many as there are kinds, in their order; None: new ones.
    log
        "x", "y" or "xy": axes with logarithmic scales, on which all numbers must be above 0.

    Returns
    -------
    Panels
        The axes of the curves, from the top.

    Raises
    ------
    InputError
        Another column or `over`, another number of axes, or numbers that have no logarithm.
    """
    if isinstance(columns, str) or not columns:
        raise InputError("columns", describe_value(columns), "a list of at least one column of the history")
    over = checked_over(over, result)
    kinds: dict[tuple[str, str], dict[str, Any]] = {}
    for name in columns:
        kinds.setdefault(labels.kind_of(name, result.units), {})[name] = curve(result, name, over)
    drawn = [y for kind in kinds.values() for _, y in kind.values()]
    figures.check_log(log, x=along(result, over, over), y=np.concatenate(drawn))
    panels = figures.panels_or_new(ax, len(kinds), 1.0 + 1.9 * len(kinds))
    for panel, ((text, unit), lines) in zip(panels, kinds.items(), strict=True):
        unit, factor = labels.shown_in(unit, *(y for _, y in lines.values()))
        texts = {labels.column_text(name, result.units[name]): line for name, line in lines.items()}
        text = next(iter(texts)) if len(texts) == 1 else text
        looks = [(x, factor * y, look) for (x, y), look in figures.styled(texts)]
        figures.curves(panel, looks, "", labels.on_lines(labels.with_unit(text, unit)))
        panel.set(**{f"{axis}scale": "log" for axis in log})
    _marked(panels[0], over, result).set_xlabel("")
    panels[-1].set_xlabel(labels.column_label(over, result.units))
    return panels


def probes(
    result: Result, quantity: str = "von_mises", over: str | None = None, ax: Axes | None = None
) -> Axes:
    """A `quantity` of a `ProbeHistory`, or a component (`cauchy_stress_yy`, `principal_stretches_1`), a line
    for each point of all probes, over `over` (see `forces`).
    """
    labels.check_result(result)
    if not result.probes:
        raise InputError("result", "a run without probes", "a run of a scene with Output(probes=...)")
    over = checked_over(over, result)
    rows, x, lines = _drawn(result, over), along(result, over, over), []
    values = {name: probe.component(quantity)[rows] for name, probe in result.probes.items()}
    unit, factor = labels.shown_in(labels.field_unit(quantity), *values.values())
    for name, probe, looks in figures.probe_looks(result.probes):
        for place, y, look in zip(probe.position, values[name].T, looks, strict=True):
            label = f"{name} at ({', '.join(f'{at + 0.0:.3g}' for at in place)}) mm"
            lines.append((x, factor * y, look | {"label": label}))
    ax = figures.curves(ax, lines, "", labels.field_label(quantity, unit), legend=False)
    return figures.add_legend(_marked(ax, over, result))


def compare(
    results: Mapping[str, Result], column: str, over: str | None = None, ax: Axes | None = None
) -> Axes:
    """The same column of several results, each by its name, over `over` (see `forces`)."""
    found, over = _over(results, over)
    return figures.add_legend(_column(ax, found, column, over, ""))


def force_indentation(results: labels.Results, ax: Axes | None = None) -> Axes:
    """Applied force over indentation, of the presses of one result or of several by their names."""
    found, columns = labels.named(results), ("indentation", "applied_force")
    lines = [(*_of_presses(one, *columns), look | {"marker": "."}) for one, look in figures.styled(found)]
    units = labels.units_of(found)
    return figures.curves(
        ax, lines, labels.column_label("indentation", units), labels.axis_label("applied_force", units)
    )


def contact_area(results: labels.Results, ax: Axes | None = None) -> Axes:
    """Contact width (in total: area) over the applied force of the presses: outer and real."""
    found, lines = labels.named(results), []
    for result, look in figures.styled(found):
        width = "contact_area" if result.mesh.dim == 3 else "contact_width"
        for column, text, style in ((width, "edge to edge", "-"), (f"real_{width}", "touching", "--")):
            label = f"{look['label']}, {text}".removeprefix(", ")
            own = look | {"label": label, "linestyle": style, "marker": "."}
            lines.append((*_of_presses(result, "applied_force", column), own))
    units = labels.units_of(found)
    return figures.curves(
        ax, lines, labels.column_label("applied_force", units), labels.axis_label(width, units)
    )


def friction(
    results: labels.Results, over: str | None = None, ax: Axes | None = None, *, start: float | None = None
) -> Axes:
    """Tangential over normal force on the bone, of steps with a load, over `over` (see `forces`), from its
    value `start` on: without one, the beginning of a slide fills most of the picture.
    """
    found, over = _over(results, over)
    lines = []
    for result, look in figures.styled(found):
        load = along(result, "applied_force", over)
        rows = load > ZERO * float(np.abs(load).max(initial=0.0))
        rows &= along(result, over, over) >= (-np.inf if start is None else start)
        ratio = along(result, "applied_tangential_force", over)[rows] / load[rows]
        lines.append((along(result, over, over)[rows], ratio, look))
    ax = figures.curves(ax, lines, "", "apparent friction coefficient")
    return _marked(ax, over, *found.values())


def signal(results: labels.Results, over: str | None = None) -> figures.Panels:
    """Voltage above, with vertical edges where its waveform jumps, friction force on the bone below, over
    `over` (see `forces`).
    """
    found, over = _over(results, over)
    panels = figures.new_panels(2, 4.8)
    _column(panels[0], found, "voltage", over, "voltage").set_xlabel("")
    _column(panels[1], found, "applied_tangential_force", over, "friction force")
    if len(found) > 1:
        figures.add_legend(panels[0])
    return panels


def spectrum(
    results: labels.Results,
    column: str = "tangential_force",
    ax: Axes | None = None,
    *,
    start: float | None = None,
    stop: float | None = None,
    window: str = "none",
) -> Axes:
    """Amplitudes of a column over the frequency (Hz) without the mean, of one result or of several by their
    names, as `ev.spectrum` finds them.
    """
    found, ax, lines = labels.named(results), figures.axes_or_new(ax), []
    for number, (result, look) in enumerate(figures.styled(found)):
        f, a = (x[1:] for x in spectra.spectrum(result, column, start=start, stop=stop, window=window))
        look |= {"linewidth": 1.0}
        if len(f) <= FEW:
            ax.vlines(f, 0.0, a, colors=look["color"], linewidth=THICK / (1.0 + number))
            look |= {"linestyle": "none", "marker": "oxs^v"[number % 5], "markersize": 4}
        lines.append((f, a, look))
    return figures.curves(
        ax, lines, "frequency (Hz)", f"amplitude of {labels.column_label(column, labels.units_of(found))}"
    )


def contact_pressure(result: Result, frame: int = -1, ax: Axes | None = None) -> Axes:
    """Contact pressure, and shear and attraction if there is any, of the pad over its x (mm)."""
    labels.check_result(result)
    check_plane(result.mesh)
    shown = frame_of(result, frame)
    pad = np.flatnonzero(np.isfinite(shown.gap))
    x = result.mesh.points[pad, 0] + shown.displacement[pad, 0]
    pad, x = pad[np.argsort(x)], np.sort(x)
    lines = [
        (x, y, {"label": name.replace("_", " "), "color": colour, "linestyle": style, "linewidth": 1.2})
        for name, (colour, style) in TRACTIONS.items()
        if np.any((y := getattr(shown, name)[pad]) != 0.0) or name == "contact_pressure"
    ]
    unit, factor = labels.shown_in("MPa", *(y for _, y, _ in lines))
    lines = [(x, factor * y, look) for x, y, look in lines]
    ax = figures.curves(ax, lines, "x (mm)", labels.with_unit("traction", unit), legend=False)
    touching = x[shown.contact_status[pad] > 0]
    if len(touching):
        margin = 0.25 * (touching[-1] - touching[0]) + 0.2
        ax.set_xlim(touching[0] - margin, touching[-1] + margin)
    ax.set_title(told(result, shown), fontsize="medium")
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + 0.35 * (high - low))  # the legend stands above the peaks of the ridges
    ax.legend(loc="upper left")
    return ax


def residuals(fit: FitResult, ax: Axes | None = None) -> Axes:
    """Computed minus measured for each measured value of a fit: in standard deviations where the data have
    them, with a band of two, else in percent of their root mean square. Good ones have no pattern.
    """
    from matplotlib.ticker import MaxNLocator

    ax = figures.axes_or_new(ax)
    in_sd = bool(fit.provenance.get("sd"))
    values = fit.residuals * (1.0 if in_sd else 100.0)
    number = np.arange(1, len(values) + 1)
    kinds = np.array([name.split(" at ")[0].split(",")[0].split(".")[0] for name in fit.names])
    if in_sd:
        ax.axhspan(-TWO, TWO, color="0.92", label="two standard deviations")
    ax.axhline(0.0, color="0.4", linewidth=0.8)
    lines = []
    for own, look in figures.styled(
        {labels.column_text(kind): kinds == kind for kind in dict.fromkeys(kinds.tolist())}
    ):
        ax.vlines(number[own], 0.0, values[own], color=look["color"], linewidth=1.2)
        lines.append((number[own], values[own], look | {"linestyle": "none", "marker": "o"}))
    unit = "sd" if in_sd else "% of root mean square"
    figures.curves(ax, lines, "measured value", f"computed - measured ({unit})", legend=False).legend()
    ax.set_xlim(0.4, len(values) + 0.6)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    return ax


def _over(results: labels.Results, over: str | None) -> tuple[dict[str, Result], str]:
    """Results by their names, and the abscissa of the first."""
    found = labels.named(results)
    return found, checked_over(over, next(iter(found.values())))


def _column(ax: Axes | None, found: Mapping[str, Result], column: str, over: str, text: str) -> Axes:
    """A line for each result, beside the text, or without one the name of the column."""
    drawn = [curve(one, column, over) for one in found.values()]
    unit, factor = labels.shown_in(labels.units_of(found)[column], *(y for _, y in drawn))
    looks, text = (look for _, look in figures.styled(found)), text or labels.column_text(column, unit)
    lines = [(x, factor * y, look) for (x, y), look in zip(drawn, looks, strict=True)]
    text = labels.effective(column, found.values()) + text
    ax = figures.curves(ax, lines, "", labels.with_unit(text, unit), legend=False)
    largest = max(float(np.abs(labels.values_of(one, "normal_force")).max()) for one in found.values())
    if column.endswith("force") and all(np.abs(y).max() <= ZERO * largest for _, y, _ in lines):
        ax.set_ylim(-largest, largest)  # what rounding leaves is no curve
    return _marked(ax, over, *found.values())


def _of_presses(result: Result, *columns: str) -> list[Any]:
    rows = np.flatnonzero(result.motion == "press")
    if not rows.size:
        raise InputError("results", f"a run of {', '.join(sorted(set(result.motion)))}", "a run with a press")
    return [labels.values_of(result, column)[rows] for column in columns]

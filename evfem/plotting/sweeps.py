"""The table of a sweep: an output over a key, or over two, and how samples spread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.errors import InputError, describe_value
from evfem.plotting import figures
from evfem.plotting.labels import key_label, key_unit
from evfem.sweeps.file import FIRST, LAST

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from evfem.sweeps.table import SweepResult

#: steps of a grid are uneven where the largest is so many times the smallest
UNEVEN = 3.0
#: so many places have their number on an axis
FEW = 8


def sweep(
    table: SweepResult, x: str, y: str, by: str | None = None, ax: Axes | None = None, log: str = ""
) -> Axes:
    """Column `y` of a sweep over its column `x`, a line with its own markers for each value of column `by`.

    `log` is "x", "y" or "xy": axes with logarithmic scales, on which all numbers must be above 0. Samples,
    and what is varied beside `x` and `by`, are points without lines; points without a number are left out.
    Names on the abscissa stand in the order of the table.
    """
    rows = _done(table, x, y, *([by] if by else []))
    names = _names(rows, x)
    figures.check_log(log, x=_numbers(rows, x), y=_numbers(rows, y))
    groups, lines = ({row[by]: row[by] for row in rows} if by else {None: None}), []
    for (value, look), marker in zip(figures.styled(groups), cycle(figures.MARKERS), strict=False):
        chosen = [row for row in rows if by is None or row[by] == value]
        across = np.array([names.index(row[x]) if names else row[x] for row in chosen])
        up, order = np.array([row[y] for row in chosen]), np.argsort(across, kind="stable")
        if names or table.provenance.get("samples") is not None or np.unique(across).size < across.size:
            look["linestyle"] = "none"
        lines.append((across[order], up[order], look | {"label": _value(table, by, value), "marker": marker}))
    ax = figures.curves(ax, lines, key_label(x, table.units), key_label(y, table.units), legend=False)
    ax.set(**{f"{axis}scale": "log" for axis in log})
    if "x" in log and (places := np.unique(np.concatenate([line[0] for line in lines]))).size <= FEW:
        ax.set_xticks(places, [f"{tick:g}" for tick in places])
        ax.set_xticks([], minor=True)
    if names:
        ax.set_xticks(range(len(names)), [str(name).replace("_", " ") for name in names])
        ax.margins(x=0.15)
    return ax if by is None else figures.add_legend(ax)


def sweep_histogram(table: SweepResult, column: str, ax: Axes | None = None) -> Axes:
    """How often a column of a sweep has which values, with its mean, deviation and the middle 90 % of it.

    Cells are as wide as Freedman and Diaconis or Sturges take them, whichever is less (numpy's "auto").
    Raises InputError for a column without numbers.
    """
    found = [row[column] for row in _done(table, column)]
    if not all(type(value) in (int, float) for value in found):
        raise InputError("column", describe_value(column), "a column of numbers")
    values, ax = np.array(found, dtype=float), figures.axes_or_new(ax)
    ax.hist(values, bins="auto", color=figures.SKY, edgecolor="white")
    low, high = np.quantile(values, [0.05, 0.95])
    unit = key_unit(column, table.units).replace("mm2", "mm²")
    deviation = np.std(values, ddof=1) if values.size > 1 else 0.0
    mean = f"mean {values.mean():.4g} {unit}".rstrip() + f", deviation {deviation:.4g} {unit}".rstrip()
    ends = f"90 % of the points: {low:.4g} to {high:.4g} {unit}".rstrip()
    ax.axvline(values.mean(), color=figures.BLUE, label=mean)
    ax.axvspan(low, high, color=figures.ORANGE, alpha=0.25, zorder=0, label=ends)
    ax.set(xlabel=key_label(column, table.units), ylabel=f"points of {values.size}")
    ax.set_ylim(0.0, 1.35 * ax.get_ylim()[1])  # room for the legend
    ax.legend(loc="upper right")
    return ax


def sweep_scatter(table: SweepResult, column: str, over: Sequence[str] | None = None) -> figures.Panels:
    """Column of a sweep over each of the columns of numbers that are varied, in panels side by side, with the
    rank correlation (Spearman 1904): of 1 or -1 where one always rises or falls with the other.

    `over` names other columns. Raises InputError where none is varied.
    """
    names = list(_varied(table) if over is None else over)
    if not names:
        raise InputError("table", "no column of numbers that is varied", "a sweep of numbers")
    panels = figures.new_panels(1, 3.2, len(names))
    for ax, name in zip(panels, names, strict=True):
        rows = _done(table, name, column)
        x, y = (np.array([row[key] for row in rows]) for key in (name, column))
        ax.plot(x, y, "o", color=figures.BLUE, markersize=4, alpha=0.7)
        ax.set(xlabel=key_label(name, table.units), title=f"rank correlation {_ranked(x, y):.2f}")
        ax.grid(alpha=0.3)
    panels[0].set_ylabel(key_label(column, table.units))
    return panels


def _varied(table: SweepResult) -> list[str]:
    """Columns of several numbers that no run computed."""
    computed = {*FIRST, *LAST, *table.provenance.get("outputs", ())}
    found = (name for name in table.columns if name not in computed)
    return [name for name in found if not isinstance(table[name], list) and np.unique(table[name]).size > 1]


def _ranked(x: Any, y: Any) -> float:
    """Spearman's rank correlation, NaN where one does not change; equal values share the mean rank."""
    from scipy.stats import rankdata

    if not (np.ptp(x) and np.ptp(y)):
        return math.nan
    return float(np.corrcoef(rankdata(x), rankdata(y))[0, 1])


def _numbers(rows: Sequence[dict[str, Any]], key: str) -> list[float]:
    """A column, with NaN for what is no number."""
    return [row[key] if type(row[key]) in (int, float) else math.nan for row in rows]


def sweep_map(table: SweepResult, x: str, y: str, value: str, ax: Axes | None = None) -> Axes:
    """Column `value` of a sweep of a grid as colours over its columns `x` and `y`, of numbers or of names.

    Points without a number stay white. An axis of few numbers has its ticks there. Where the numbers along
    an axis are far from evenly spaced, as 0.001, 0.01, 0.1, their cells are all of one width, with the
    numbers below them. Raises InputError where two points have the same x and y.
    """
    rows = _done(table, x, y, value)
    places = [(row[x], row[y]) for row in rows]
    if len(set(places)) < len(places):
        raise InputError("x, y", f"{x}, {y} with several points at one place", "the two keys of a grid")
    across, up = (_names(table.rows, key) or sorted({row[key] for row in table.rows}) for key in (x, y))
    cells = np.full((len(up), len(across)), np.nan)
    for row in rows:
        cells[up.index(row[y]), across.index(row[x])] = row[value]
    ax = figures.axes_or_new(ax)
    mapped = ax.pcolormesh(_sides(across, ax.xaxis), _sides(up, ax.yaxis), cells, cmap=figures.ONE_SIGN)
    ax.set(xlabel=key_label(x, table.units), ylabel=key_label(y, table.units))
    figures.add_colorbar(mapped, ax, key_label(value, table.units))
    return ax


def _done(table: SweepResult, *columns: str) -> list[dict[str, Any]]:
    """The rows in which these columns have a value; InputError for other columns, or none left."""
    for name in columns:
        if name not in table.columns:
            raise InputError("column", describe_value(name), ", ".join(table.columns))
    rows = [row for row in table.rows if all(row[name] is not None for name in columns)]
    if not rows:
        raise InputError("table", f"no point with {' and '.join(columns)}", "a sweep with results")
    return rows


def _names(rows: Sequence[dict[str, Any]], x: str) -> list[Any]:
    """The values of a column that are no numbers, each once; nothing for a column of numbers."""
    values = [row[x] for row in rows]
    return [] if all(type(v) in (int, float) for v in values) else list(dict.fromkeys(values))


def _value(table: SweepResult, by: str | None, value: Any) -> str:
    """What a line is called: `voltage 100 V`."""
    if by is None:
        return ""
    text, _, unit = key_label(by, table.units).removesuffix(")").partition(" (")
    shown = f"{value:.4g}" if type(value) is float else str(value).replace("_", " ")
    return f"{text} {shown} {unit}".rstrip()


def _sides(values: list[Any], axis: Any) -> Any:
    """Borders of the cells of numbers or names along an axis, which gets its ticks."""
    if any(isinstance(value, str) for value in values):
        axis.set_ticks(range(len(values)), [str(value).replace("_", " ") for value in values])
        return _edges(np.arange(len(values)))
    places = np.array(values, dtype=float)
    steps = np.diff(places)
    if steps.size == 0 or steps.max() <= UNEVEN * steps.min():
        if places.size <= FEW:
            axis.set_ticks(places, _short(places), fontsize="small" if places.size > 5 else None)
        return _edges(places)
    some = range(0, places.size, -(-places.size // FEW))
    axis.set_ticks(some, [_short(places)[k] for k in some])
    return _edges(np.arange(places.size))


def _short(places: Any) -> list[str]:
    """Numbers with as few digits, from three on, as tell them apart.

    >>> _short(np.array([0.0140845, 0.028169])), _short(np.array([1000.0, 1001.0]))
    (['0.0141', '0.0282'], ['1000', '1001'])
    """
    each = ([f"{place:.{digits}g}" for place in places] for digits in range(3, 17))
    return next((found for found in each if len(set(found)) == len(found)), [f"{one:g}" for one in places])


def _edges(places: Any) -> Any:
    """Borders of cells around places; one alone has a cell of width 1."""
    if places.size == 1:
        return places[0] + np.array([-0.5, 0.5])
    middles = 0.5 * (places[1:] + places[:-1])
    return np.r_[2.0 * places[0] - middles[0], middles, 2.0 * places[-1] - middles[-1]]

"""The table of a sweep: an output over a key, or over two."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.errors import InputError, quoted
from evfem.plotting.figures import ONE_SIGN, add_colorbar, axes_or_new, curves, styled
from evfem.plotting.labels import key_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from evfem.sweeps.run import SweepResult

#: steps of a grid are uneven where the largest is so many times the smallest
UNEVEN = 3.0


def sweep(table: SweepResult, x: str, y: str, by: str | None = None, ax: Axes | None = None) -> Axes:
    """Column `y` of a sweep over its column `x`, a line for each value of the column `by`.

    Points without a number are left out. Samples, which have no value of `x` twice but also no
    order, and everything that is varied beside `x` and `by` are points without lines. Names on the
    abscissa stand in the order of the table.
    """
    rows = _done(table, x, y, *([by] if by else []))
    groups = {row[by]: row[by] for row in rows} if by else {None: None}
    names, lines = _names(rows, x), []
    for value, look in styled(groups):
        chosen = [row for row in rows if by is None or row[by] == value]
        across = np.array([names.index(row[x]) if names else row[x] for row in chosen])
        up, order = np.array([row[y] for row in chosen]), np.argsort(across, kind="stable")
        if names or table.provenance.get("samples") is not None or np.unique(across).size < across.size:
            look["linestyle"] = "none"
        lines.append((across[order], up[order], look | {"label": _value(table, by, value), "marker": "o"}))
    ax = curves(ax, lines, key_label(x, table.units), key_label(y, table.units))
    if names:
        ax.set_xticks(range(len(names)), [str(name) for name in names])
        ax.margins(x=0.15)
    if by is not None:
        ax.legend()
    return ax


def sweep_map(table: SweepResult, x: str, y: str, value: str, ax: Axes | None = None) -> Axes:
    """Column `value` of a sweep of a grid as colours over its columns `x` and `y` of numbers.

    Points without a number stay white. Where the numbers along an axis are far from evenly spaced,
    as 0.001, 0.01, 0.1, their cells are all of one width, with the numbers below them. Raises
    InputError where two points have the same x and y.
    """
    rows = _done(table, x, y, value)
    if not all(isinstance(row[key], (int, float)) for row in rows for key in (x, y)):
        raise InputError("x, y", f"{x}, {y}", "two columns of numbers")
    places = [(row[x], row[y]) for row in rows]
    if len(set(places)) < len(places):
        raise InputError("x, y", f"{x}, {y} with several points at one place", "the two keys of a grid")
    across, up = (np.unique([row[key] for row in table.rows]) for key in (x, y))
    cells = np.full((up.size, across.size), np.nan)
    for row in rows:
        cells[np.searchsorted(up, row[y]), np.searchsorted(across, row[x])] = row[value]
    ax = axes_or_new(ax)
    mapped = ax.pcolormesh(_sides(across, ax.xaxis), _sides(up, ax.yaxis), cells, cmap=ONE_SIGN)
    ax.set(xlabel=key_label(x, table.units), ylabel=key_label(y, table.units))
    add_colorbar(mapped, ax, key_label(value, table.units))
    return ax


def _done(table: SweepResult, *columns: str) -> list[dict[str, Any]]:
    """The rows in which these columns have a value; InputError for other columns, or none left."""
    for name in columns:
        if name not in table.columns:
            raise InputError("column", quoted(name), ", ".join(table.columns))
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
    shown = f"{value:g}" if type(value) is float else str(value)
    return f"{text} {shown} {unit}".rstrip()


def _sides(places: Any, axis: Any) -> Any:
    """Borders of the cells along an axis."""
    steps = np.diff(places)
    if steps.size == 0 or steps.max() <= UNEVEN * steps.min():
        return _edges(places)
    axis.set_ticks(range(places.size), [f"{place:g}" for place in places])
    return _edges(np.arange(places.size))


def _edges(places: Any) -> Any:
    """Borders of cells around places; one alone has a cell of width 1."""
    if places.size == 1:
        return places[0] + np.array([-0.5, 0.5])
    middles = 0.5 * (places[1:] + places[:-1])
    return np.concatenate([[2.0 * places[0] - middles[0]], middles, [2.0 * places[-1] - middles[-1]]])

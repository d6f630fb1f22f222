"""The picture of the study of stability: a row per case, in two columns of groups."""

import numpy as np

from ..plots import COLOURS, Axes, Figure, new_figure
from .case import Found

#: outcome -> marker, colour, label
MARKS = {
    "passed": ("o", COLOURS["kaczmarek"], "passed"),
    "wrong": ("P", "#D55E00", "physics not as expected"),
    "not converged": ("X", "#D55E00", "not converged"),
    "error": ("v", "#D55E00", "error"),
}
BAD = "#D55E00"
ROW = 0.155  # inches
#: widths of names, iterations, cuts and seconds
WIDTHS = [1.5, 1.0, 0.7, 0.16]


def draw(found: list[Found]) -> Figure:
    """Two columns of groups, about equally long."""
    columns = _columns(found)
    rows = max(_height(column) for column in columns)
    figure = new_figure(ROW * rows + 1.2, 6.5 * len(columns))
    grid = figure.add_gridspec(1, len(WIDTHS) * len(columns), width_ratios=WIDTHS * len(columns))
    for place, column in enumerate(columns):
        axes = [figure.add_subplot(grid[len(WIDTHS) * place + i]) for i in range(len(WIDTHS))]
        _column(axes, column, rows)
    _legend(figure, found)
    return figure


def _columns(found: list[Found]) -> list[list[Found]]:
    """The cases split between two groups, so that both halves are about as long."""
    starts = [i for i in range(1, len(found)) if found[i].group != found[i - 1].group]
    if not starts or len(found) < 20:
        return [found]
    cut = min(starts, key=lambda i: abs(_height(found[:i]) - _height(found[i:])))
    return [found[:cut], found[cut:]]


def _height(column: list[Found]) -> int:
    """Rows of the cases, a heading for each group, and a gap before it."""
    return len(column) + 2 * len({one.group for one in column})


def _column(axes: list[Axes], column: list[Found], rows: int) -> None:
    names, iterations, cuts, seconds = axes
    y, previous = -1.0, ""
    for one in column:
        y += 1.0
        if one.group != previous:
            group = [each for each in column if each.group == one.group]
            good = sum(each.good for each in group)
            y += 1.0 if previous else 0.0
            look = {"fontsize": 8, "fontweight": "bold", "va": "center"}
            colour = "black" if good == len(group) else BAD
            names.text(0.0, y, f"{one.group}: {good} of {len(group)}", color=colour, **look)
            y, previous = y + 1.0, one.group
        marker, colour, _ = MARKS[one.outcome]
        names.plot(0.04, y, marker, color=colour, markersize=5 if one.good else 6, clip_on=False)
        names.text(0.08, y, one.name, fontsize=7, va="center", color="black" if one.good else BAD)
        bar = COLOURS["kaczmarek"] if one.good else BAD
        # a run that never got to the end of a step has spent everything on the first one
        iterations.barh(y, one.iterations / max(one.steps, 1), height=0.62, color=bar, alpha=0.55)
        cuts.barh(y, one.cuts, height=0.62, color=COLOURS["neutral"])
        look = {"fontsize": 6.5, "va": "center", "ha": "right", "color": COLOURS["neutral"]}
        seconds.text(1.0, y, f"{one.cpu_s:.1f}", **look)
    for ax in axes:
        ax.set(ylim=(rows - 0.3, -0.8), yticks=[])
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.tick_params(labelsize=7)
        ax.set_axisbelow(True)
    for ax in (names, seconds):
        ax.set(xlim=(0.0, 1.0), xticks=[])
        ax.spines["bottom"].set_visible(False)
    _scale(iterations, "iterations per step")
    _scale(cuts, "cuts")
    seconds.set_xlabel("CPU s", fontsize=8)


def _scale(ax: Axes, label: str) -> None:
    ticks = [0, 1, 3, 10, 30, 100]
    ax.set_xscale("symlog", linthresh=1.0)
    ax.set_xlim(0.0, 1.3 * max(ticks[-1], ax.dataLim.x1 if np.isfinite(ax.dataLim.x1) else 0.0))
    ax.set_xticks(ticks, [str(tick) for tick in ticks])
    ax.grid(axis="x", color="#DDDDDD", linewidth=0.5)
    ax.set_xlabel(label, fontsize=8)


def _legend(figure: Figure, found: list[Found]) -> None:
    from matplotlib.lines import Line2D

    seen = [mark for name, mark in MARKS.items() if any(one.outcome == name for one in found)]
    handles = [
        Line2D([], [], marker=marker, color=colour, linestyle="", label=label)
        for marker, colour, label in seen
    ]
    title = f"{sum(one.good for one in found)} of {len(found)} cases end as they should"
    place = {"loc": "outside upper center", "ncols": len(seen), "frameon": False}
    figure.legend(handles=handles, fontsize=7.5, title=title, **place)

"""The picture of the study of stability: a row per case, in two columns of groups."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .common import COLOURS, new_figure
from .stability_case import Found

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: outcome -> marker, colour, label
MARKS = {
    "passed": ("o", COLOURS["kaczmarek"], "passed"),
    "refused": ("s", COLOURS["fe"], "refused with a sentence, as expected"),
    "stopped": ("D", COLOURS["fe"], "stopped with a sentence, as expected"),
    "wrong": ("X", "#D55E00", "physics not as expected"),
    "not converged": ("X", "#D55E00", "not converged"),
    "error": ("X", "#D55E00", "error"),
}
BAD = "#D55E00"
ROW = 0.155  # inches


def draw(found: list[Found]) -> Figure:
    """Two columns with as many rows each as nearly as groups allow."""
    columns = _columns(found)
    rows = max(_height(column) for column in columns)
    figure = new_figure(ROW * rows + 1.1, 13.0)
    grid = figure.add_gridspec(1, 2 * len(columns), width_ratios=[1.0, 1.0] * len(columns))
    for place, column in enumerate(columns):
        first = figure.add_subplot(grid[2 * place])
        second = figure.add_subplot(grid[2 * place + 1])
        _column(first, second, column, rows)
    _legend(figure, found)
    return figure


def _columns(found: list[Found]) -> list[list[Found]]:
    """The cases split between two groups, so that both halves are about as long."""
    starts = [i for i in range(1, len(found)) if found[i].group != found[i - 1].group]
    if not starts or len(found) < 30:
        return [found]
    cut = min(starts, key=lambda i: abs(_height(found[:i]) - _height(found[i:])))
    return [found[:cut], found[cut:]]


def _height(column: list[Found]) -> int:
    """Rows of the cases, a heading for each group, and a gap before it."""
    return len(column) + 2 * len({one.group for one in column})


def _column(left: Axes, right: Axes, column: list[Found], rows: int) -> None:
    y, labels, previous = 0.0, [], ""
    for one in column:
        if one.group != previous:
            y += 1.0 if previous else 0.0
            members = [each for each in column if each.group == one.group]
            good = sum(each.good for each in members)
            title = f"{one.group}: {good} of {len(members)}"
            colour = "black" if good == len(members) else BAD
            left.text(
                0.0, y, title, fontsize=8, fontweight="bold", color=colour, va="center",
                transform=left.get_yaxis_transform(),
            )  # fmt: skip
            y, previous = y + 1.0, one.group
        _row(left, right, one, y)
        labels.append((y, one))
        y += 1.0
    for ax in (left, right):
        ax.set_ylim(rows - 0.3, -0.8)
        ax.set_yticks([])
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.tick_params(labelsize=7)
    left.set_xlim(-0.02, 1.0)
    left.set_xticks([])
    left.spines["bottom"].set_visible(False)
    right.set_xscale("symlog", linthresh=1.0)
    right.set_xlim(0.0, 600.0)
    right.set_xticks([0, 1, 3, 10, 30, 100, 300], ["0", "1", "3", "10", "30", "100", "300"])
    right.grid(axis="x", color="#DDDDDD", linewidth=0.5)
    right.set_axisbelow(True)
    right.set_xlabel("iterations per step; cuts; CPU seconds", fontsize=8)


def _row(left: Axes, right: Axes, one: Found, y: float) -> None:
    marker, colour, _ = MARKS[one.outcome]
    left.plot(0.03, y, marker, color=colour, markersize=5 if one.good else 6, clip_on=False)
    left.text(0.07, y, one.name, fontsize=7, va="center", color="black" if one.good else BAD)
    if one.steps:
        right.barh(y, one.iterations / one.steps, height=0.62, color=COLOURS["kaczmarek"], alpha=0.45)
    if one.cuts:
        right.plot(one.cuts, y, "|", color="black", markersize=7, markeredgewidth=1.8)
    right.plot(np.maximum(one.cpu_s, 1e-3), y, ".", color=COLOURS["strong_troxel"], markersize=5)


def _legend(figure: Figure, found: list[Found]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    seen = [name for name in MARKS if any(one.outcome == name for one in found)]
    handles: list[Line2D | Patch] = [
        Line2D([], [], marker=MARKS[name][0], color=MARKS[name][1], linestyle="", label=MARKS[name][2])
        for name in seen
    ]
    handles += [
        Patch(color=COLOURS["kaczmarek"], alpha=0.45, label="iterations per step"),
        Line2D([], [], marker="|", color="black", linestyle="", markeredgewidth=1.8, label="cut attempts"),
        Line2D([], [], marker=".", color=COLOURS["strong_troxel"], linestyle="", label="CPU seconds"),
    ]
    good = sum(one.good for one in found)
    figure.legend(
        handles=handles, loc="outside upper center", ncols=4, fontsize=7.5, frameon=False,
        title=f"{good} of {len(found)} cases end as they should",
    )  # fmt: skip

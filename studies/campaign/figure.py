"""The picture of a campaign: how scenes end, and iterations and time against their size."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from evfem.common.arrays import Floats

from ..common import COLOURS, new_figure
from .ending import OUTCOMES, Ending

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAD = "#D55E00"
#: outcome -> marker and colour
MARKS = {
    "equilibrium": (".", COLOURS["kaczmarek"]),
    "explained": ("D", COLOURS["fe"]),
    "not_converged": ("X", BAD),
    "invariants_broken": ("P", COLOURS["measured"]),
    "timeout": ("s", COLOURS["strong_troxel"]),
    "refused": ("v", COLOURS["neutral"]),
    "error": ("^", "black"),
}
#: times so many times the median are drawn as a line
SLOW = 30.0


def draw(ends: list[Ending], slowness: Floats) -> Figure:
    """Counts of the classes above, iterations and CPU time of each scene below."""
    figure = new_figure(6.0, 9.0)
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 2.2])
    _counts(figure.add_subplot(grid[0, :]), ends)
    iterations = [max(one.iterations, 1) for one in ends]
    _scatter(figure.add_subplot(grid[1, 0]), ends, iterations, "iterations")
    times = figure.add_subplot(grid[1, 1])
    _scatter(times, ends, [max(one.cpu_s, 1e-2) for one in ends], "CPU time in s")
    _median(times, ends, slowness)
    return figure


def _counts(ax: Axes, ends: list[Ending]) -> None:
    counts = [sum(one.outcome == name for one in ends) for name in OUTCOMES]
    seen = [i for i, count in enumerate(counts) if count]
    names = [OUTCOMES[i] for i in seen]
    bars = ax.barh(names, [counts[i] for i in seen], color=[MARKS[name][1] for name in names])
    ax.bar_label(bars, padding=3, fontsize=8)
    ax.set(xscale="log", xlim=(0.7, 2.0 * max(len(ends), 1)))
    ax.set_xlabel(f"scenes of {len(ends)}")
    ax.invert_yaxis()
    ax.spines[["top", "right"]].set_visible(False)


def _scatter(ax: Axes, ends: list[Ending], values: list[float] | list[int], label: str) -> None:
    for name, (marker, colour) in MARKS.items():
        chosen = [i for i, one in enumerate(ends) if one.outcome == name]
        if chosen:
            steps = [max(ends[i].requested, 1) for i in chosen]
            ax.plot(steps, [values[i] for i in chosen], marker, color=colour, alpha=0.7, label=name)
    ax.set(xscale="log", yscale="log", xlabel="requested steps", ylabel=label)
    ax.grid(color="#DDDDDD", linewidth=0.5)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _median(ax: Axes, ends: list[Ending], slowness: Floats) -> None:
    """The median time of scenes of the same size, and `SLOW` times that."""
    points = sorted(
        (max(one.requested, 1), one.cpu_s / slow)
        for one, slow in zip(ends, slowness, strict=True)
        if slow > 0.0
    )
    if points:
        steps, medians = np.array(points).T
        ax.plot(steps, medians, color="black", linewidth=1.0, label="median")
        ax.plot(steps, SLOW * medians, "--", color="black", linewidth=1.0, label=f"{SLOW:g} medians")
    ax.legend(fontsize=7, frameon=False)

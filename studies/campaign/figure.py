"""The picture of a campaign: how scenes end, and iterations and time against their size."""

from collections import Counter

import numpy as np

from evfem.common.arrays import Floats

from ..plots import COLOURS, Axes, Figure, new_figure, plain_ticks
from .ending import OUTCOMES, Ending

BAD = "#D55E00"
#: outcome -> marker, colour and name; told apart by shape as well
MARKS = {
    "equilibrium": ("o", COLOURS["kaczmarek"], "equilibrium"),
    "explained": ("D", COLOURS["fe"], "no equilibrium, explained"),
    "not_converged": ("X", BAD, "not converged"),
    "invariants_broken": ("P", COLOURS["measured"], "an invariant broken"),
    "timeout": ("s", COLOURS["strong_troxel"], "over the time limit"),
    "refused": ("v", COLOURS["neutral"], "refused"),
    "error": ("^", "black", "an error"),
}
#: times so many times the median are drawn as a line
SLOW = 30.0


def draw(ends: list[Ending], slowness: Floats) -> Figure:
    """Counts of the classes above, iterations and CPU time of each scene below."""
    figure = new_figure(6.4, 9.0)
    kinds = len({one.outcome for one in ends})
    grid = figure.add_gridspec(2, 2, height_ratios=[0.3 + 0.15 * kinds, 2.6])
    _counts(figure.add_subplot(grid[0, :]), ends)
    iterations = figure.add_subplot(grid[1, 0])
    _scatter(iterations, ends, [one.iterations for one in ends], "iterations")
    times = figure.add_subplot(grid[1, 1])
    _scatter(times, ends, [max(one.cpu_s, 1e-2) for one in ends], "CPU time in s")
    _median(times, ends, slowness)
    return figure


def _counts(ax: Axes, ends: list[Ending]) -> None:
    """How many scenes end how, with their shares."""
    counts = Counter(one.outcome for one in ends)
    seen = [name for name in OUTCOMES if counts[name]]
    names, colours = [MARKS[name][2] for name in seen], [MARKS[name][1] for name in seen]
    bars = ax.barh(names, [counts[name] for name in seen], color=colours, height=0.7)
    labels = [f"{counts[name]}  ({counts[name] / len(ends):.1%})" for name in seen]
    ax.bar_label(bars, labels, padding=3, fontsize=8)
    for place, name in enumerate(seen):  # the marker of the panels below
        ax.plot(0.78, place, MARKS[name][0], color="white", markersize=5, markeredgewidth=0.0)
    ax.set(xscale="log", xlim=(0.7, 4.0 * max(len(ends), 1)), xlabel=f"of {len(ends)} scenes")
    ax.set_ylim(len(seen) - 0.5, -0.5)
    ax.tick_params(axis="y", length=0)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter("")
    ax.spines[["top", "right"]].set_visible(False)


def _scatter(ax: Axes, ends: list[Ending], values: list[float] | list[int], label: str) -> None:
    """What scenes cost over their size; those without a value are left out."""
    for name, (marker, colour, _) in MARKS.items():
        chosen = [i for i, one in enumerate(ends) if one.outcome == name and values[i] > 0]
        look = {"markersize": 3 if name == "equilibrium" else 7, "alpha": 0.75, "markeredgewidth": 0.0}
        steps = [max(ends[i].requested, 1) for i in chosen]
        ax.plot(steps, [values[i] for i in chosen], marker, color=colour, **look)
    ax.set(xscale="log", yscale="log", xlabel="requested steps", ylabel=label)
    plain_ticks(ax)


def _median(ax: Axes, ends: list[Ending], slowness: Floats) -> None:
    """The median time of scenes of the same size, and `SLOW` times that, named beside the panel."""
    found = zip(ends, slowness, strict=True)
    points = sorted((max(one.requested, 1), one.cpu_s / slow) for one, slow in found if slow > 0.0)
    if not points:
        return
    steps, medians = np.array(points).T
    for factor, style, text in ((1.0, "-", "median"), (SLOW, "--", f"{SLOW:g} times\nthe median")):
        ax.plot(steps, factor * medians, style, color="black", linewidth=1.0)
        place = (1.0, factor * medians[-1]), (4, 0), ("axes fraction", "data"), "offset points"
        ax.annotate(text, *place, fontsize=8, va="center")

"""What others measured on fingers beside predictions in which nothing is fitted to the number compared.

Each row has its source, the conditions that are known and those that were assumed, the prediction with
its own error (three meshes, and to first order what was assumed), the measured value with its scatter, the
ratio of both, and why they differ. Where a publication states a direction without a number that was read, a
row has the predicted change alone. Rows that agree and rows that do not stand side by side.
"""

from functools import partial

import numpy as np

from ..common import Series, Study
from ..plots import COLOURS, LABELS, Axes, Figure
from . import hovering, moving, pressed, touching
from .table import Experiment, Row, numbers_of

#: publications without a row, and why
LEFT_OUT = {
    "Gueorguiev et al. (2017), doi:10.1098/rsif.2017.0641": "the Weber fraction of a change of friction, "
    "0.11, is a property of people; it is the input of the thresholds",
    "Guo et al. (2019), doi:10.1109/TOH.2019.2897768": "attraction grows as the load rises from 0.5 "
    "to 4.5 N at constant area, which a constant gap cannot give; the power of the load, by which "
    "`ev.PowerRoughness` would, is their fit and was not to be read in the abstract",
    "Dzidek et al. (2017), doi:10.1073/pnas.1706233114": "the time in which the real area saturates is the "
    "input of `ev.AgeingFriction`",
    "Monnoyer et al. (2023), doi:10.1098/rsif.2022.0718": "strain is released within 20 ms of a drop of "
    "friction; how fast a finger does that here is a viscosity that would have to be assumed",
    "Pawluk and Howe (1999), doi:10.1115/1.2835100; Pataky et al. (2005), "
    "doi:10.1016/j.jbiomech.2004.07.004": "relaxation times are inputs of `relaxation`",
}
ASSUMPTIONS = {
    "nothing is fitted to the number compared": "what is fitted to another number says so under `fitted`",
    "errors": "one standard deviation of the logarithm: mesh, what was assumed to first order",
}


def main(quick: bool = False) -> Study:
    """All experiments; `quick` has coarse meshes, two loads, and leaves out modes and first-order errors."""
    hover, more = hovering.experiment(quick)
    area, at = pressed.areas(quick)
    found = [hover, touching.thresholds(at), area, touching.meyer()]
    found += [moving.modulated(quick), *pressed.slips(quick), touching.clutch()]
    found += [touching.sliding(), touching.leaking()]
    found += [] if quick else [moving.modes()]
    told = {"experiments": [one.told() for one in found], "left_out": LEFT_OUT}
    rows = [row for one in found for row in one.rows]
    series = [
        Series("ratio", [row.name for row in rows], [row.ratio for row in rows], "predicted over measured"),
        Series("error", [row.name for row in rows], [row.error for row in rows], "relative"),
    ]
    numbers = numbers_of(found) | more
    return Study("measured", numbers, {}, ASSUMPTIONS | told, series, partial(draw, found))


def draw(found: list[Experiment]) -> Figure:
    """Every ratio on one axis, laws by colour, with the errors of prediction and the measured scatter."""
    from evfem.plotting.figures import WIDTH, new_figure

    kept = [one for one in found if one.rows]
    count = sum(len(one.rows) for one in kept) + len(kept)
    figure = new_figure(0.155 * count + 0.8, WIDTH)
    ax, place, ticks = figure.subplots(), 0, {}
    for one in kept:
        ticks[place] = one.title
        ax.axhline(place, color="0.9", lw=6.0, zorder=0)
        for row in one.rows:
            place += 1
            ticks[place] = words(row)
            _point(ax, place, row)
        place += 1
    ax.axvline(1.0, color="black", lw=0.8, zorder=0)
    ax.set_yticks(list(ticks), list(ticks.values()), fontsize=6)
    for label, title in zip(ax.get_yticklabels(), ticks.values(), strict=True):
        if any(title == one.title for one in kept):
            label.set_fontweight("bold")
    ax.set(xscale="log", xlabel="predicted over measured", ylim=(place, -1.0), xlim=(0.01, 2000.0))
    ax.set_xticks([0.01, 0.1, 0.5, 1.0, 2.0, 10.0, 100.0, 1000.0],
                  ["0.01", "0.1", "0.5", "1", "2", "10", "100", "1000"])  # fmt: skip
    ax.minorticks_off()
    ax.tick_params(axis="y", length=0)
    _legend(ax)
    return figure


def words(row: Row) -> str:
    """The name of a row without its law, which is its colour."""
    return row.name.replace(f".{row.law}" if row.law else "", "").replace("_", " ").replace(".", ", ", 1)


def _point(ax: Axes, place: float, row: Row) -> None:
    colour = COLOURS.get(row.law, COLOURS["neutral"])
    ends = row.ratio * np.exp([-row.error, row.error])
    if np.isfinite(row.low):
        scatter = [row.predicted / row.high, row.predicted / row.low]
        ax.plot(scatter, [place] * 2, color=colour, lw=4.0, alpha=0.25, solid_capstyle="butt")
    ax.plot(ends, [place] * 2, color=colour, lw=1.2)
    ax.plot(row.ratio, place, "o", color=colour, ms=3.5)


def _legend(ax: Axes) -> None:
    looks = {LABELS[law]: {"color": COLOURS[law]} for law in LABELS} | {
        "both laws, or none": {"color": "0.33"}
    }
    for label, look in looks.items():
        ax.plot([], [], "o", ms=3.5, label=label, **look)
    ax.plot([], [], "-", color="0.33", lw=1.2, label="error of the prediction")
    ax.plot([], [], "-", color="0.33", lw=4.0, alpha=0.25, label="measured scatter")
    ax.legend(fontsize=6, loc="lower right")

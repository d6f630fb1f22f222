"""How Fig. 11 is drawn: the paper's panels; in the full study calibration, mesh and sensitivities too."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats

from .plots import COLOURS, Axes, Figure, new_figure, panel_letter

PAPER_FIT = {"with_ridges": (0.17, 0.49), "without_ridges": (0.03, 0.65)}
#: marker, name and colour of the two pads
STYLES = {
    "with_ridges": ("o", "with ridges", COLOURS["strong_troxel"]),
    "without_ridges": ("s", "without ridges", COLOURS["kaczmarek"]),
}
AREAS = {"gross": "-", "ridge": "--"}
CRESTS = {
    "crest_exponent_5": ("exponent 5", "#9ECAE1"),
    "crest_exponent_6": ("exponent 6", "#6BAED6"),
    "base": ("exponent 7 (base)", COLOURS["kaczmarek"]),
    "crest_exponent_8": ("exponent 8", "#08306B"),
    "flat_crest": ("flat crests", COLOURS["strong_troxel"]),
}
MESHES = {12: ("mesh_coarse", "nodal_edge_coarse"), 24: ("base", "nodal_edge")}
MESHES[48] = ("mesh_fine", "nodal_edge_fine")
LOAD_LABEL = "applied load $F_n$ (N/mm)"


@dataclass(frozen=True)
class Shown:
    """What is drawn: answers by pad and by (variant, pad), labels of the variants, ratios of areas."""

    loads: tuple[float, ...]
    answers: Mapping[str, Any]
    varied: Mapping[tuple[str, str], Any]
    labels: Mapping[str, str]
    ratios: Mapping[str, Floats]
    adams: Floats
    plate_loads: Floats
    plates: Mapping[str, Floats]


def draw(shown: Shown) -> Figure:
    """The figure; without variants only the paper's panels."""
    if not shown.varied:
        figure = new_figure(3.7)
        left, right = figure.subplots(1, 2)
    else:
        figure = new_figure(9.6)
        upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(3.6, 6.0)).ravel()
        left, right = upper.subplots(1, 2)
        small, table = lower.subfigures(1, 2, squeeze=False, width_ratios=(1.0, 1.25)).ravel()
        above, below = small.subplots(2, 1)
        _calibration(above, shown)
        _meshes(below, shown)
        _sensitivities(table.subplots(1, 2, sharey=True), shown)
    _contribution(left, shown)
    _forces(right, shown)
    return figure


def _contribution(ax: Axes, shown: Shown) -> None:
    fine = np.linspace(0.009, 0.103, 200)
    for pad, one in shown.answers.items():
        marker, name, colour = STYLES[pad]
        alpha, beta = one.fit.k, -one.fit.m
        label = f"{name}: $\\alpha$ = {alpha:.3f}, $\\beta$ = {beta:.2f}"
        ax.plot(shown.loads, one.ratio, marker, color=colour, label=label)
        ax.plot(fine, alpha * fine**-beta, color=COLOURS["fe"], linewidth=1.3, zorder=1)
        alpha, beta = PAPER_FIT[pad]
        label = f"the paper's fit: {alpha:g}, {beta:g}"
        ax.plot(fine, alpha * fine**-beta, ":", color=colour, linewidth=1.3, label=label)
    ax.set(xlabel=LOAD_LABEL, ylabel="air layer over contact, (9b)/(10) − 1", xlim=(0, 0.105), ylim=(0, None))
    ax.plot([], [], color=COLOURS["fe"], linewidth=1.3, label="fits of (11)")
    ax.legend(fontsize="x-small")
    panel_letter(ax, "a")


def _forces(ax: Axes, shown: Shown) -> None:
    for pad, one in shown.answers.items():
        marker, name, _ = STYLES[pad]
        for what, force, colour in (
            ("with air (9b)", one.total, COLOURS["strong_troxel"]),
            ("contact only (10)", one.contact, COLOURS["kaczmarek"]),
        ):
            face = colour if marker == "o" else "none"
            ax.plot(shown.loads, 1e3 * force, marker, color=colour, mfc=face, label=f"{what}, {name}")
    for name, force in shown.plates.items():
        label = f"(7), Adams' {name} area"
        ax.plot(shown.plate_loads, 1e3 * force, AREAS[name], color=COLOURS["fe"], label=label)
    ax.set(xlabel=LOAD_LABEL, ylabel="electrostatic force (mN/mm)", xlim=(0, 0.105), ylim=(0, 6.4))
    ax.legend(fontsize="x-small", loc="upper left")
    panel_letter(ax, "b")


def _calibration(ax: Axes, shown: Shown) -> None:
    for name, (label, colour) in CRESTS.items():
        ax.plot(shown.loads, shown.ratios[name], ".-", color=colour, linewidth=1.0, markersize=4, label=label)
    ax.plot(shown.loads, shown.adams, color=COLOURS["measured"], linewidth=2.2, label="Adams")
    ax.set(xlabel=LOAD_LABEL, ylabel="ridge over gross contact", xlim=(0, 0.105), ylim=(0.2, 0.63))
    ax.legend(fontsize="x-small", ncols=2, loc="lower right")
    panel_letter(ax, "c")


def _meshes(ax: Axes, shown: Shown) -> None:
    every = {("base", pad): one for pad, one in shown.answers.items()} | dict(shown.varied)
    nodes = list(MESHES)
    for pad, (marker, name, colour) in STYLES.items():
        for column, (style, how) in ((0, ("-", "edge interpolated")), (1, (":", "nodal"))):
            alpha = [every[names[column], pad].fit.k for names in MESHES.values()]
            ax.plot(nodes, alpha, marker + style, color=colour, markersize=4, label=f"{name}, {how}")
    ax.set(xscale="log", xlabel="nodes per ridge", ylabel=r"$\alpha$", ylim=(0, 0.46), xticks=nodes)
    ax.set_xticks(nodes, [str(count) for count in nodes])
    ax.minorticks_off()
    ax.legend(fontsize="x-small", ncols=1, loc="upper left")
    panel_letter(ax, "d")


def _sensitivities(axes: Any, shown: Shown) -> None:
    rows = ["base", *shown.labels]
    fits = ((lambda f: f.k, r"$\alpha$"), (lambda f: -f.m, r"$\beta$"))
    for paper, (ax, (of, name)) in enumerate(zip(axes, fits, strict=True)):
        for pad, (marker, _, colour) in STYLES.items():
            found = {n: one for (n, p), one in shown.varied.items() if p == pad}
            found |= {"base": shown.answers[pad]}
            places = [i for i, row in enumerate(rows) if row in found]
            ax.plot([of(found[rows[i]].fit) for i in places], places, marker, color=colour, markersize=4.5)
            ax.axvline(of(shown.answers[pad].fit), color=colour, linewidth=0.8, alpha=0.6)
            ax.axvline(PAPER_FIT[pad][paper], color=colour, linewidth=1.0, linestyle=":")
        ax.grid(axis="y", linewidth=0.3)
        ax.set_xlabel(name)
    axes[0].set(xscale="log", ylim=(len(rows) - 0.5, -0.5))
    axes[0].set_yticks(range(len(rows)), ["base", *shown.labels.values()], fontsize="x-small")
    axes[0].set_xticks([0.03, 0.1, 0.3], ["0.03", "0.1", "0.3"])
    axes[0].minorticks_off()
    panel_letter(axes[0], "e")
    axes[1].set_title("dotted: the paper, thin: base", loc="right", fontsize="x-small")

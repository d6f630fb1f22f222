"""The picture of `work_precision`: a panel for each problem, one for growth, one for shares."""

from collections.abc import Mapping, Sequence

from ..common import Series
from ..plots import COLOURS, Axes, Figure, new_figure, plain_ticks
from .evaluation import Reference
from .growth import Size
from .scenes import PROBLEMS
from .shares import PARTS, PHASES

#: element -> label, colour, marker, line
ELEMENTS = {
    "q1": ("Q1", COLOURS["strong_troxel"], "s", "-"),
    "q1_fbar": ("F-bar", COLOURS["measured"], "^", "-"),
    "q2": ("Q2", COLOURS["fe"], "D", "-"),
    "q2p1": ("Q2-P1", COLOURS["kaczmarek"], "o", "-"),
}
#: what is not a curve over the meshes: label and marker
POINTS = {
    "q2p1_penalty_100": ("penalty 100 N/mm³", "x"),
    "q2p1_penalty_10000": ("penalty 10 000 N/mm³", "+"),
    "q2p1_rigid": ("rigid outline", "*"),
    "outline_quadrature": ("quadrature of the outline", "P"),
    "closed_form_plate": ("plate, closed form", "X"),
}
STEPS = "Q2-P1 on L0, steps 0.3 to 0.025 mm, against their limit"
#: part of a step -> colour
HUES = ("#0072B2", "#E69F00", "#009E73", "#B04A85", "#56B4E9", "#BBBBBB")
PART_COLOURS = dict(zip(PARTS, HUES, strict=True))
SMALLEST = 1e-4  # %, below which no error is drawn


def draw(
    series: Sequence[Series],
    known: Mapping[str, Reference],
    sizes: Sequence[Size],
    numbers: Mapping[str, float],
) -> Figure:
    """Panels for the problems that were computed, three in a row."""
    shown = [problem for problem in PROBLEMS if problem in known]
    rows = -(-(len(shown) + 2) // 3)
    figure = new_figure(2.75 * rows + 1.3, 9.5)
    axes = figure.subplots(rows, 3, squeeze=False).ravel()
    for ax, problem in zip(axes, shown, strict=False):
        mine = [one for one in series if one.name.split()[0] == problem]
        _problem(ax, PROBLEMS[problem], mine, known[problem].uncertainty)
    for ax in axes[0 : len(shown) : 3]:
        ax.set_ylabel("largest error (%)", fontsize="small")
    _growth(axes[len(shown)], sizes, numbers)
    _shares(axes[len(shown) + 1], numbers)
    for ax in axes[len(shown) + 2 :]:
        ax.set_axis_off()
    found: dict[str, object] = {}
    for ax in axes[: len(shown)]:
        found |= {label: handle for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)}
    place = {"loc": "outside lower center", "ncols": 4, "fontsize": "small", "frameon": False}
    figure.legend(list(found.values()), list(found), **place)
    return figure


def _problem(ax: Axes, title: str, curves: Sequence[Series], uncertain: float) -> None:
    for curve in curves:
        variant, y = curve.name.split()[1], [max(value, SMALLEST) for value in curve.y]
        if variant in ELEMENTS:
            label, colour, marker, line = ELEMENTS[variant]
            face = "white" if line == "--" else colour
            look = {"color": colour, "marker": marker, "markersize": 4.5, "markerfacecolor": face}
            ax.plot(curve.x, y, line, label=label, **look)
        elif variant in POINTS:
            label, marker = POINTS[variant]
            ax.plot(curve.x, y, linestyle="", color="black", marker=marker, markersize=7, label=label)
        elif variant == "steps":
            ax.plot(curve.x, y, ":", color="black", marker=".", label=STEPS)
    look = {"color": COLOURS["neutral"], "alpha": 0.15, "linewidth": 0.0, "label": "reference uncertain"}
    ax.axhspan(SMALLEST, max(uncertain, SMALLEST), **look)
    ax.set(xscale="log", yscale="log")
    drawn = [max(value, SMALLEST) for curve in curves for value in curve.y]
    ax.set_ylim(bottom=0.4 * min([uncertain, *drawn]))
    _titled(ax, title, "CPU seconds")
    plain_ticks(ax)


def _growth(ax: Axes, sizes: Sequence[Size], numbers: Mapping[str, float]) -> None:
    nodes = [one.nodes for one in sizes]
    for name, label, colour, marker in (
        ("press_s", "press step, CPU s", COLOURS["kaczmarek"], "o"),
        ("slide_s", "slide step, CPU s", COLOURS["strong_troxel"], "s"),
    ):
        power = numbers[f"growth.exponent.{name}"]
        y, label = [getattr(one, name) for one in sizes], f"{label} ~ nodes$^{{{power:.2f}}}$"
        ax.plot(nodes, y, color=colour, marker=marker, markersize=4.5, label=label)
    memory = [one.peak_MB / 1024.0 for one in sizes]
    ax.plot(nodes, memory, "--", color=COLOURS["fe"], marker="^", markersize=4.5, label="peak memory, GB")
    ax.set(xscale="log", yscale="log")
    _titled(ax, "growth of a step", "nodes")
    ax.legend(fontsize="x-small", frameon=False)
    plain_ticks(ax)


def _shares(ax: Axes, numbers: Mapping[str, float]) -> None:
    names = [phase.replace("_", " ") for phase in PHASES]
    left = [0.0] * len(names)
    for part in PARTS:
        width = [100.0 * numbers[f"shares.{phase}.share.{part}"] for phase in PHASES]
        ax.barh(names, width, left=left, color=PART_COLOURS[part], label=part, height=0.55)
        for place, (start, share) in enumerate(zip(left, width, strict=True)):
            if share > 9.0:
                ax.text(start + 0.5 * share, place, f"{share:.0f}", ha="center", va="center", fontsize=7)
        left = [start + share for start, share in zip(left, width, strict=True)]
    ax.set(xlim=(0.0, 100.0), ylim=(len(names) - 0.5, -1.5))
    _titled(ax, f"a step's time, {numbers['shares.nodes']:,.0f} nodes", "share of CPU time (%)")
    ax.legend(ncols=3, fontsize="x-small", frameon=False, loc="upper center")
    ax.tick_params(labelsize="small")


def _titled(ax: Axes, title: str, label: str) -> None:
    ax.set_title(title, loc="left", fontsize="medium")
    ax.set_xlabel(label, fontsize="small")
    ax.spines[["top", "right"]].set_visible(False)

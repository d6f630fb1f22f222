"""How the study `peers` is shown: its table, its Markdown page, its figure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ..common import COLOURS, Series, new_figure
from .evaluation import JUDGED, Run, series
from .problem import GIVEN, UNCERTAINTY, errors

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEAD = (
    "scene",
    "level",
    "package",
    "element",
    "CPU s",
    "with imports",
    "wall s",
    "iterations",
    "factorisations",
    "peak MB",
    "largest error %",
)
#: name, colour and marker of a package
STYLE = {
    "evfem": ("evfem", COLOURS["kaczmarek"], "o"),
    "felupe": ("FElupe", COLOURS["strong_troxel"], "s"),
    "fenicsx": ("FEniCSx", COLOURS["fe"], "^"),
    "getfem": ("GetFEM", COLOURS["measured"], "D"),
}


def table(runs: list[Run], failed: Mapping[str, str]) -> list[str]:
    """The runs, and what could not be run, as lines of a Markdown table."""
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for run in runs:
        m = run.measured
        element = run.element if run.way == GIVEN else f"{run.element}, {run.way} steps"
        cells = [run.scene, f"L{run.level}", run.package, element]
        cells += [f"{m[name]:.2f}" for name in ("cpu_s", "process_cpu_s", "wall_s")]
        cells += [str(m["iterations"]), str(m["factorisations"])]
        cells.append(f"{m['peak_MB']:.0f}")
        cells.append(f"{run.error():.3f}" if errors(run.scene, run.forces) else "-")
        lines.append(f"| {' | '.join(cells)} |")
    done = {run.key for run in runs}
    for key, why in failed.items():
        if key not in done:
            scene, level, who = key.split(".")
            cells = [scene, level, *who.split("_"), f"not done: {why}", *["-"] * (len(HEAD) - 5)]
            lines.append(f"| {' | '.join(cells)} |")
    return lines


def page(result: Mapping[str, Any]) -> str:
    """The table with its date, versions and ratios, as Markdown."""
    said, made, numbers = result["assumptions"], result["provenance"], result["numbers"]
    versions = ", ".join(f"{name} {number}" for name, number in (made["versions"] | said["peers"]).items())
    lines = [
        "# evfem beside its peers",
        "",
        f"{made['date']}; {versions}; one thread.",
        "",
        *said["table"],
        "",
    ]
    lines += [f"Missing: {name}.\n" for name in said["missing"]]
    lines += [f"Failed: {name}: {why}.\n" for name, why in said["failed"].items()]
    lines += _block("CPU seconds of a first run that compiles its forms", numbers, ".cold_cpu_s", ".1f")
    lines += _block("A peer's CPU seconds over evfem's", numbers, "_over_evfem", ".1f", ending=".cpu_s")
    lines += _block("The same with imports", numbers, "_over_evfem", ".1f", ending=".process_cpu_s")
    lines += _block("CPU seconds of the race to 0.1 %", numbers, "race.", ".3g")
    lines += _block("Packages apart, same element, %", numbers, ".apart_percent.", ".4f")
    return "\n".join(lines) + "\n"


def _block(title: str, numbers: Mapping[str, float], part: str, how: str, *, ending: str = "") -> list[str]:
    """The numbers whose names have this part and this ending, as a table of two columns."""
    rows = {key: value for key, value in numbers.items() if part in key and key.endswith(ending)}
    if not rows:
        return []
    lines = [f"| {key.removesuffix('.cpu_s')} | {value:{how}} |" for key, value in rows.items()]
    return [f"| {title} | |", "|---|---|", *lines, ""]


def draw(runs: list[Run]) -> Figure:
    """A panel for each scene with a reference; inside the grey band its uncertainty hides the
    error.
    """
    scenes = [scene for scene in JUDGED if any(run.scene == scene for run in runs)]
    figure = new_figure(4.2)
    curves = series(runs)
    axes = figure.subplots(1, len(scenes), sharey=True, squeeze=False)[0]
    for ax, scene in zip(axes, scenes, strict=True):
        _panel(ax, scene, [one for one in curves if one.name.startswith(f"{scene} ")])
    axes[0].set_ylabel("largest error of the forces (%)")
    axes[0].set_ylim(bottom=1e-2)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize="small")
    return figure


def _panel(ax: Axes, scene: str, curves: list[Series]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter

    for curve in curves:
        _, package, element = curve.name.split()
        name, colour, marker = STYLE[package]
        style, face = ("--", "white") if element == "q1" else ("-", colour)
        label = f"{name} {element.upper().replace('Q2P1', 'Q2-P1')}"
        ax.plot(curve.x, curve.y, style, color=colour, marker=marker, markerfacecolor=face, label=label)
    ax.axhspan(1e-4, UNCERTAINTY[scene], color=COLOURS["neutral"], alpha=0.15, label="reference uncertain")
    ax.set(xscale="log", yscale="log", xlabel="CPU seconds")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())  # its labels would overlap where the axis is short
    ax.tick_params(axis="x", labelsize="small")
    ax.set_title(f"Scene {scene}", loc="left", fontsize="medium")

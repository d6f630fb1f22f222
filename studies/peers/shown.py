"""How the study `peers` is shown: its tables and its figure."""

from collections.abc import Mapping

from ..common import Series, markdown
from ..plots import COLOURS, Axes, Figure, new_figure, plain_ticks
from .evaluation import JUDGED, Run, series
from .problem import GIVEN, UNCERTAINTY, errors

HEAD = ("scene", "level", "package", "element", "CPU s", "with imports", "wall s", "iterations")
HEAD += ("factorisations", "peak MB", "largest error %")
#: title, part and ending of the names of numbers, how they are written
BLOCKS = (
    ("CPU seconds of a first run that compiles its forms", "", ".cold_cpu_s", ".1f"),
    ("A peer's CPU seconds over evfem's", "_over_evfem", ".cpu_s", ".1f"),
    ("The same with imports", "_over_evfem", ".process_cpu_s", ".1f"),
    ("CPU seconds of the race to 0.1 %", "race.", "", ".3g"),
    ("Packages apart, same element, %", ".apart_percent.", "", ".4f"),
)
#: name, colour and marker of a package
STYLE = {
    "evfem": ("evfem", COLOURS["kaczmarek"], "o"),
    "felupe": ("FElupe", COLOURS["strong_troxel"], "s"),
    "fenicsx": ("FEniCSx", COLOURS["fe"], "^"),
    "getfem": ("GetFEM", COLOURS["measured"], "D"),
    "ngsolve": ("NGSolve", COLOURS["neutral"], "v"),
}


def tables(runs: list[Run], failed: Mapping[str, str], numbers: Mapping[str, float]) -> dict[str, list[str]]:
    """The runs, and what could not be run, and ratios, as tables of Markdown by their titles."""
    rows = []
    for run in runs:
        m = run.measured
        element = run.element if run.way == GIVEN else f"{run.element}, {run.way} steps"
        cells = [run.scene, f"L{run.level}", run.package, element]
        cells += [f"{m[name]:.2f}" for name in ("cpu_s", "process_cpu_s", "wall_s")]
        cells += [str(m["iterations"]), str(m["factorisations"]), f"{m['peak_MB']:.0f}"]
        rows.append([*cells, f"{run.error():.3f}" if errors(run.scene, run.forces) else "-"])
    done = {run.key for run in runs}
    for key in (key for key in failed if key not in done):
        scene, level, who = key.split(".")
        cells = [scene, level, *who.split("_"), f"not done: {failed[key]}"]
        rows.append([*cells, *["-"] * (len(HEAD) - len(cells))])
    found = {"Runs": markdown(HEAD, rows)}
    for title, part, ending, how in BLOCKS:
        chosen = {key: value for key, value in numbers.items() if part in key and key.endswith(ending)}
        rows = [[key.removesuffix(".cpu_s"), f"{value:{how}}"] for key, value in chosen.items()]
        found |= {title: markdown((title, ""), rows)} if rows else {}
    return found


def draw(runs: list[Run]) -> Figure:
    """A panel for each scene with a reference, whose uncertainty is a grey band."""
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
    for curve in curves:
        _, package, element = curve.name.split()
        name, colour, marker = STYLE[package]
        style, face = ("--", "white") if element == "q1" else ("-", colour)
        label = f"{name} {element.upper().replace('Q2P1', 'Q2-P1')}"
        ax.plot(curve.x, curve.y, style, color=colour, marker=marker, markerfacecolor=face, label=label)
    ax.axhspan(1e-4, UNCERTAINTY[scene], color=COLOURS["neutral"], alpha=0.15, label="reference uncertain")
    ax.set(xscale="log", yscale="log", xlabel="CPU seconds")
    plain_ticks(ax)
    ax.set_title(f"Scene {scene}", loc="left", fontsize="medium")

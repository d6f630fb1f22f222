"""evfem beside FElupe: time, iterations, memory and error in the press-and-slide benchmark, measured here.

Same nodes, laws, steps and tolerance (the largest free residual over the largest force on the bone), one
thread, PARDISO for both. Every run has a process of its own; the packages alternate, and the least of several
rounds counts. Only the ratios mean anything on another machine. Beside json, csv and picture the table is
written as peers.md.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.storage import write_text

from .common import COLOURS, Series, Study, make_folder, new_figure
from .peers_problem import TOLERANCE, UNCERTAINTY, errors, quantities

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: package and element, in the order in which they take turns
CONTENDERS = (("evfem", "q1"), ("felupe", "q1"), ("evfem", "q2p1"), ("felupe", "q2"))
#: what a package needs to take part
NEEDS = {"evfem": (), "felupe": ("felupe", "pypardiso")}
#: level -> scenes and rounds
FULL: Mapping[int, tuple[str, int]] = {0: ("ABC", 3), 1: ("ABC", 3), 2: ("AB", 2)}
QUICK: Mapping[int, tuple[str, int]] = {0: ("A", 1)}
#: what is measured of a run, and the head of the table
MEASURED = (
    "cpu_s",
    "slowest_cpu_s",
    "wall_s",
    "iterations",
    "factorisations",
    "imported_MB",
    "peak_MB",
)
HEAD = ("scene", "level", "package", "element", "CPU s", "wall s", "iterations", "factorisations", "peak MB")
#: errors at which the fastest run is looked for, %
GOALS = (1.0, 0.3, 0.1)
#: what a scene is judged by there: the beginning of the names of its forces
JUDGED = {"A": "Fn", "B": "Ft"}
ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)
ASSUMPTIONS = {
    "reference": "exact contact, extrapolated from quadratic elements of two packages that agree; within "
    "0.04 % (A), 0.2 % (B); there is none for C",
    "cpu_s": "least of the rounds, process time of all threads, set-up included, imports left out",
    "peak_MB": "largest resident memory of the process, interpreter and imports (imported_MB) included",
    "contact": "evfem exact; FElupe nodal penalty of 1000 N/mm per mm, below 0.1 um of penetration",
    "elements": "q1: 2 x 2 points; q2, q2p1: cells of 2 x 2 linear ones through the same nodes",
    "Ft_mean_2_to_3": "plain mean of the eleven values at 2.0 ... 3.0 mm; the source does not say which "
    "mean. Of four readings (trapezoidal rule +0.4 %, without the first value +1.5 %, without the last "
    "-0.6 %) it is the one that quadratic cells on L2 reproduce (-0.02 %): its error is no independent check",
    "equal_error": "CPU seconds between the levels of a curve, straight in the logarithms; a goal that the "
    "coarsest level already meets costs that level; no extrapolation to finer ones",
    "tolerance": TOLERANCE,
    "threads": 1,
}
STYLE = {"evfem": (COLOURS["kaczmarek"], "o"), "felupe": (COLOURS["strong_troxel"], "s")}


@dataclass(frozen=True)
class Run:
    """A contender in a scene on a level: its best round."""

    package: str
    element: str
    scene: str
    level: int
    measured: Mapping[str, Any]

    @property
    def key(self) -> str:
        """Begin of its names among the numbers."""
        return f"{self.scene}.L{self.level}.{self.package}_{self.element}"

    @property
    def forces(self) -> dict[str, float]:
        """What is compared, N/mm."""
        return quantities(self.scene, self.measured["history"])

    def error(self, of: str = "") -> float:
        """The largest deviation of forces whose names begin so from the reference, in per cent."""
        found = errors(self.scene, self.forces)
        return max(abs(value) for key, value in found.items() if key.startswith(of))


def missing() -> list[str]:
    """Packages that cannot take part here."""
    return [name for name, needs in NEEDS.items() if not all(find_spec(need) for need in needs)]


def run_once(package: str, element: str, scene: str, level: int) -> dict[str, Any]:
    """One measured run in a new process of this interpreter; {"failed": its last words} if it fails."""
    path = os.pathsep.join(p for p in sys.path if p)
    words = [sys.executable, "-P", "-m", f"{__package__}.peers_run", package, element, scene, str(level)]
    environment = os.environ | ONE_THREAD | {"PYTHONPATH": path}
    done = subprocess.run(words, env=environment, capture_output=True, text=True)
    if done.returncode:
        return {"failed": (done.stderr.strip().splitlines() or [f"status {done.returncode}"])[-1]}
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def compete(
    plan: Mapping[int, tuple[str, int]], present: Iterable[tuple[str, str]]
) -> tuple[list[Run], dict[str, str]]:
    """Every contender in turn, round after round: the best runs, and why others failed."""
    contenders = list(present)
    runs, failed = [], {}
    for level, (scenes, rounds) in plan.items():
        for scene in scenes:
            tries = [[run_once(*who, scene, level) for who in contenders] for _ in range(rounds)]
            for who, found in zip(contenders, zip(*tries, strict=True), strict=True):
                good = [one for one in found if "failed" not in one]
                if len(good) < rounds:
                    name = f"{scene}.L{level}.{who[0]}_{who[1]}"
                    failed[name] = next(one["failed"] for one in found if "failed" in one)
                if good:
                    best = min(good, key=lambda one: one["cpu_s"])
                    worst = max(one["cpu_s"] for one in good)
                    runs.append(Run(*who, scene, level, best | {"slowest_cpu_s": worst}))
    return runs, failed


def main(quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """All runs, their numbers, table and figure; a package that is not installed is named and left out."""
    absent = missing()
    for name in absent:
        print(f"study peers: {name} is not installed (pip install evfem[peers]), left out", file=sys.stderr)
    present = [who for who in CONTENDERS if who[0] not in absent]
    if not quick:  # compiled code is cached, files have been read
        for who in present:
            run_once(*who, "B", 0)
    runs, failed = compete(QUICK if quick else FULL, present)
    versions = {name: version(name) for name in ("felupe", "pypardiso") if find_spec(name)}
    said = ASSUMPTIONS | {"missing": absent, "failed": failed, "peers": versions, "table": table(runs)}
    curves = series(runs) + histories(runs)
    study = Study("peers", numbers(runs), {}, said, curves, lambda: draw(runs))
    result = study.finish(out, quick)
    if out is not None:
        write_text(make_folder(out) / "peers.md", page(result))
    return result


def numbers(runs: list[Run]) -> dict[str, float]:
    """Cost, forces and errors of every run, ratios on the same nodes and at the same error."""
    found: dict[str, float] = {}
    for run in runs:
        for name in (
            "cpu_s",
            "slowest_cpu_s",
            "wall_s",
            "iterations",
            "factorisations",
            "imported_MB",
            "peak_MB",
        ):
            found[f"{run.key}.{name}"] = run.measured[name]
        found |= {f"{run.key}.{name}": value for name, value in run.forces.items()}
        deviations = errors(run.scene, run.forces)
        found |= {f"{run.key}.error_percent.{name}": value for name, value in deviations.items()}
    by_key = {run.key: run for run in runs}
    for run in runs:
        peer = by_key.get(run.key.replace("evfem", "felupe").replace("q2p1", "q2"))
        if run.package == "evfem" and peer:
            place = f"{run.scene}.L{run.level}.felupe_over_evfem.{run.element}"
            for name in ("cpu_s", "peak_MB", "iterations"):
                found[f"{place}.{name}"] = peer.measured[name] / run.measured[name]
    return found | at_equal_error(runs)


def at_equal_error(runs: list[Run]) -> dict[str, float]:
    """CPU seconds at which each package, with its better element, is as good as each goal."""
    found: dict[str, float] = {}
    for scene, judged in JUDGED.items():
        for goal in GOALS:
            key = f"{scene}.{judged}_to_{goal}_percent"
            fastest: dict[str, float] = {}
            for package, element in CONTENDERS:
                its = [r for r in runs if (r.package, r.element, r.scene) == (package, element, scene)]
                cost = cost_of(goal, [(r.measured["cpu_s"], r.error(judged)) for r in its])
                if cost is not None:
                    fastest[package] = min(cost, fastest.get(package, cost))
            found |= {f"{key}.{package}.cpu_s": cost for package, cost in fastest.items()}
            if len(fastest) == len(NEEDS):
                found[f"{key}.felupe_over_evfem.cpu_s"] = fastest["felupe"] / fastest["evfem"]
    return found


def cost_of(goal: float, curve: list[tuple[float, float]]) -> float | None:
    """CPU seconds of an error on a curve of (CPU s, error %) from coarse to fine; None if it stays above."""
    before: tuple[float, float] | None = None
    for cpu, error in curve:
        if error <= goal:
            if before is None:
                return cpu
            share = np.log(before[1] / goal) / np.log(before[1] / error)
            return float(before[0] * (cpu / before[0]) ** share)
        before = (cpu, error)
    return None


def table(runs: list[Run]) -> list[str]:
    """The runs as lines of a Markdown table."""
    lines = [f"| {' | '.join((*HEAD, 'largest error %'))} |", "|---" * (len(HEAD) + 1) + "|"]
    for run in runs:
        m = run.measured
        cells = [run.scene, f"L{run.level}", run.package, run.element]
        cells += [
            f"{m['cpu_s']:.2f}",
            f"{m['wall_s']:.2f}",
            str(m["iterations"]),
            str(m["factorisations"]),
            f"{m['peak_MB']:.0f}",
        ]
        cells.append(f"{run.error():.3f}" if errors(run.scene, run.forces) else "-")
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def page(result: Mapping[str, Any]) -> str:
    """The table with its date, versions and ratios, as Markdown."""
    said, made = result["assumptions"], result["provenance"]
    versions = ", ".join(f"{name} {number}" for name, number in (made["versions"] | said["peers"]).items())
    lines = [
        "# evfem beside its peers",
        "",
        f"{made['date']}; {versions}; one thread.",
        "",
        *said["table"],
        "",
    ]
    lines += [f"Missing: {name}." for name in said["missing"]]
    lines += [f"Failed: {name}: {why}." for name, why in said["failed"].items()]
    ratios = {k: v for k, v in result["numbers"].items() if "felupe_over_evfem" in k and k.endswith("cpu_s")}
    if ratios:
        lines += ["| FElupe's CPU seconds over evfem's | |", "|---|---|"]
        lines += [f"| {key.removesuffix('.cpu_s')} | {value:.1f} |" for key, value in ratios.items()]
    return "\n".join(lines) + "\n"


def series(runs: list[Run]) -> list[Series]:
    """Largest error against CPU seconds: a curve over the levels for each scene and contender."""
    found = []
    for scene in JUDGED:
        for package, element in CONTENDERS:
            mine = [r for r in runs if (r.package, r.element, r.scene) == (package, element, scene)]
            if mine:
                x, y = [r.measured["cpu_s"] for r in mine], [r.error() for r in mine]
                found.append(Series(f"{scene} {package} {element}", x, y, "% over CPU s"))
    return found


def histories(runs: list[Run]) -> list[Series]:
    """Every run's forces over its steps, so that other quantities can be read off without a new run."""
    found = []
    for run in runs:
        forces = np.array(run.measured["history"]).T
        for name, force in zip(("normal", "tangential", "electrostatic"), forces, strict=True):
            found.append(Series(f"{run.key} {name}", np.arange(1, force.size + 1), force, "N/mm over step"))
    return found


def draw(runs: list[Run]) -> Figure:
    """A panel for each scene with a reference; below the grey line its uncertainty hides the error."""
    scenes = [scene for scene in JUDGED if any(run.scene == scene for run in runs)]
    figure = new_figure(3.4)
    for place, scene in enumerate(scenes):
        ax = figure.add_subplot(1, len(scenes), place + 1)
        _panel(ax, scene, [one for one in series(runs) if one.name.startswith(f"{scene} ")])
    return figure


def _panel(ax: Axes, scene: str, curves: list[Series]) -> None:
    for curve in curves:
        _, package, element = curve.name.split()
        colour, marker = STYLE[package]
        style, face = ("--", "white") if element == "q1" else ("-", colour)
        label = f"{package} {element}"
        ax.plot(curve.x, curve.y, style, color=colour, marker=marker, markerfacecolor=face, label=label)
    ax.axhspan(1e-4, UNCERTAINTY[scene], color=COLOURS["neutral"], alpha=0.15, label="reference uncertain")
    ax.set(xscale="log", yscale="log", xlabel="CPU seconds", ylabel="largest error of the forces (%)")
    ax.set_ylim(bottom=1e-2)
    ax.set_title(f"Scene {scene}", loc="left", fontsize="medium")
    ax.legend(fontsize="x-small")

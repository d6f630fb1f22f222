"""The runs of the study `peers` and what follows from them: errors, ratios, cost of an error, curves.

The race to 0.1 %: each package with its better element and its own best number of steps. Fewer
steps are cheaper and, for what does not remember the way, as exact: the normal force of the press
without friction and, once all slips, the friction force.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..common import Series
from .problem import GIVEN, Way, errors, quantities

#: with whom evfem is compared
PEERS = ("felupe", "fenicsx", "getfem", "ngsolve")
#: elements that are compared with each other: evfem's and the peers'
ELEMENTS = {"q1": "q1", "q2p1": "q2"}
#: package and element, in the order in which they take turns
CONTENDERS = tuple(
    who for own, its in ELEMENTS.items() for who in (("evfem", own), *((peer, its) for peer in PEERS))
)
#: what is measured of a run
MEASURED = ("cpu_s", "slowest_cpu_s", "wall_s", "process_cpu_s", "iterations", "factorisations")
MEASURED += ("imported_MB", "peak_MB")
#: errors at which the fastest run is looked for, %
GOALS = (1.0, 0.3, 0.1)
#: what a scene is judged by there: the beginning of the names of its forces
JUDGED = {"A": "Fn", "B": "Ft"}
#: the same of the race, its goal in %, and steps and tolerances beside the given ones
RACED, GOAL = {"A": "Fn", "B": "Ft_after_3.0"}, 0.1
FEWER = (Way(5, 10, 1e-6), Way(3, 6, 1e-6))


@dataclass(frozen=True)
class Run:
    """A contender in a scene on a level: its best round."""

    package: str
    element: str
    scene: str
    level: int
    measured: Mapping[str, Any]
    way: Way = GIVEN

    @property
    def key(self) -> str:
        """Begin of its names among the numbers."""
        steps = "" if self.way == GIVEN else f"_{self.way}_steps"
        return f"{self.scene}.L{self.level}.{self.package}_{self.element}{steps}"

    @property
    def forces(self) -> dict[str, float]:
        """What is compared, N/mm."""
        return quantities(self.scene, self.measured["history"], self.way)

    def error(self, of: str = "") -> float:
        """The largest deviation of forces whose names begin so from the reference, in per cent."""
        found = errors(self.scene, self.forces)
        return max(abs(value) for key, value in found.items() if key.startswith(of))


def numbers(runs: list[Run], cold: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Cost, forces and errors of every run, ratios on the same nodes and at the same error.

    `cold` is what first runs cost that had to compile, by the key of the run.
    """
    found: dict[str, float] = {}
    for run in runs:
        found |= {f"{run.key}.{name}": run.measured[name] for name in MEASURED}
        found |= {f"{run.key}.{name}": value for name, value in run.forces.items()}
        deviations = errors(run.scene, run.forces)
        found |= {f"{run.key}.error_percent.{name}": value for name, value in deviations.items()}
    found |= {f"{key}.{name}": value for key, costs in cold.items() for name, value in costs.items()}
    given = [run for run in runs if run.way == GIVEN]
    return found | on_the_same_nodes(given) | agreement(given) | at_equal_error(given)


def on_the_same_nodes(runs: list[Run]) -> dict[str, float]:
    """CPU seconds, memory and iterations of each peer over evfem's, and CPU seconds of the fastest."""
    found: dict[str, float] = {}
    for own in (run for run in runs if run.package == "evfem"):
        place, where = f"{own.scene}.L{own.level}", (own.scene, own.level, ELEMENTS[own.element])
        others = [r for r in runs if r.package in PEERS and (r.scene, r.level, r.element) == where]
        for run in others:
            for name in ("cpu_s", "process_cpu_s", "peak_MB", "iterations"):
                ratio = run.measured[name] / own.measured[name]
                found[f"{place}.{run.package}_over_evfem.{own.element}.{name}"] = ratio
        if others:
            ratio = min(run.measured["cpu_s"] for run in others) / own.measured["cpu_s"]
            found[f"{place}.fastest_over_evfem.{own.element}.cpu_s"] = ratio
    return found


def agreement(runs: list[Run]) -> dict[str, float]:
    """Largest range of a force over its mean, in %, of packages that use the same element."""
    found: dict[str, float] = {}
    for scene, level, element in dict.fromkeys((run.scene, run.level, run.element) for run in runs):
        same = [r.forces for r in runs if (r.scene, r.level, r.element) == (scene, level, element)]
        if len(same) > 1:
            forces = np.array([list(one.values()) for one in same])
            apart = np.ptp(forces, axis=0) / np.abs(forces.mean(axis=0))
            found[f"{scene}.L{level}.apart_percent.{element}"] = float(100.0 * apart.max())
    return found


def at_equal_error(runs: list[Run]) -> dict[str, float]:
    """CPU seconds at which each package is as good as each goal."""
    found: dict[str, float] = {}
    for scene, judged in JUDGED.items():
        for goal in GOALS:
            found |= named(f"{scene}.{judged}_to_{goal}_percent", costs_to(goal, runs, scene, judged))
    return found


def race(runs: list[Run]) -> dict[str, float]:
    """CPU seconds to the race's goal with every number of steps and with the best."""
    found: dict[str, float] = {}
    for scene, judged in RACED.items():
        best: dict[str, tuple[float, int]] = {}
        for way in (GIVEN, *FEWER):
            costs = costs_to(GOAL, [run for run in runs if run.way == way], scene, judged)
            found |= named(f"race.{scene}.{way}_steps", costs)
            for name, cost in costs.items():
                best[name] = min(best.get(name, (cost, way.press)), (cost, way.press))
        found |= named(f"race.{scene}.best", {name: cost for name, (cost, _) in best.items()})
        found |= {f"race.{scene}.best.{name}.press_steps": float(n) for name, (_, n) in best.items()}
    return found


def costs_to(goal: float, runs: list[Run], scene: str, judged: str) -> dict[str, float]:
    """CPU seconds at which each package, with its better element, is as good as the goal (%)."""
    costs: dict[str, float] = {}
    for package, element in CONTENDERS:
        its = [r for r in runs if (r.package, r.element, r.scene) == (package, element, scene)]
        cost = cost_of(goal, [(r.measured["cpu_s"], r.error(judged)) for r in its])
        if cost is not None:
            costs[package] = min(cost, costs.get(package, cost))
    return costs


def named(key: str, costs: Mapping[str, float]) -> dict[str, float]:
    """The costs, those of the peers over evfem's, and the fastest peer's over evfem's."""
    found = {f"{key}.{name}.cpu_s": cost for name, cost in costs.items()}
    others = {name: cost for name, cost in costs.items() if name in PEERS}
    if others and "evfem" in costs:
        others["fastest"] = min(others.values())
        found |= {f"{key}.{name}_over_evfem.cpu_s": cost / costs["evfem"] for name, cost in others.items()}
    return found


def cost_of(goal: float, curve: list[tuple[float, float]]) -> float | None:
    """CPU seconds of an error on a curve of (CPU s, error %), coarse to fine; None if it stays above."""
    before: tuple[float, float] | None = None
    for cpu, error in curve:
        if error <= goal:
            if before is None:
                return cpu
            share = np.log(before[1] / goal) / np.log(before[1] / error)
            return float(before[0] * (cpu / before[0]) ** share)
        before = (cpu, error)
    return None


def series(runs: list[Run]) -> list[Series]:
    """Largest error against CPU seconds: a curve over the levels for each scene and contender."""
    found = []
    for scene in JUDGED:
        for package, element in CONTENDERS:
            who = (package, element, scene, GIVEN)
            mine = [r for r in runs if (r.package, r.element, r.scene, r.way) == who]
            if mine:
                x, y = [r.measured["cpu_s"] for r in mine], [r.error() for r in mine]
                found.append(Series(f"{scene} {package} {element}", x, y, "% over CPU s"))
    return found

"""The race to 0.1 %: each package with its better element and its own best number of steps.

Fewer steps are cheaper and, for what does not remember the way, as exact: the normal force of the
press without friction and, once all slips, the friction force. What is judged is interpolated
between the levels as at equal error (`evaluation.cost_of`).
"""

from __future__ import annotations

from collections.abc import Mapping

from .evaluation import CONTENDERS, PEERS, Run, cost_of
from .problem import GIVEN, Way

#: what is judged of a scene: the beginning of the names of its forces
JUDGED = {"A": "Fn", "B": "Ft_after_3.0"}
GOAL = 0.1  # %
#: steps and tolerances beside the given ones
FEWER = (Way(5, 10, 1e-6), Way(3, 6, 1e-6))
#: level -> scenes and rounds
LEVELS: Mapping[int, tuple[str, int]] = {0: ("AB", 3), 1: ("AB", 3), 2: ("AB", 1)}


def numbers(runs: list[Run]) -> dict[str, float]:
    """CPU seconds to the goal with every number of steps and with the best, and the fastest peer's
    over evfem's.
    """
    found: dict[str, float] = {}
    for scene in JUDGED:
        best: dict[str, tuple[float, int]] = {}
        for way in (GIVEN, *FEWER):
            costs = _costs(runs, scene, way)
            found |= _named(f"race.{scene}.{way}_steps", costs)
            for name, cost in costs.items():
                best[name] = min(best.get(name, (cost, way.press)), (cost, way.press))
        found |= _named(f"race.{scene}.best", {name: cost for name, (cost, _) in best.items()})
        found |= {f"race.{scene}.best.{name}.press_steps": float(n) for name, (_, n) in best.items()}
    return found


def _costs(runs: list[Run], scene: str, way: Way) -> dict[str, float]:
    """CPU seconds to the goal of each package that gets there."""
    costs: dict[str, float] = {}
    for package, element in CONTENDERS:
        who = (package, element, scene, way)
        its = [run for run in runs if (run.package, run.element, run.scene, run.way) == who]
        cost = cost_of(GOAL, [(run.measured["cpu_s"], run.error(JUDGED[scene])) for run in its])
        if cost is not None:
            costs[package] = min(cost, costs.get(package, cost))
    return costs


def _named(key: str, costs: Mapping[str, float]) -> dict[str, float]:
    """The costs, and the fastest peer's over evfem's own."""
    found = {f"{key}.{name}.cpu_s": cost for name, cost in costs.items()}
    others = [cost for name, cost in costs.items() if name in PEERS]
    if others and "evfem" in costs:
        found[f"{key}.fastest_over_evfem.cpu_s"] = min(others) / costs["evfem"]
    return found

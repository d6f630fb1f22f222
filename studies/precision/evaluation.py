"""What follows from the runs of the study `work_precision`: references, errors, the cheapest way to an error.

The reference of a problem is extrapolated from the finest two meshes with Q2-P1, second order in the width of
a cell; its uncertainty is the whole difference between the two, because nodal contact makes forces jump a
little from mesh to mesh.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..common import Series, markdown
from .runs import STEPS, Run
from .scenes import PROBLEMS, Case

Models = Mapping[str, tuple[float, float]]
#: %, for which the cheapest way is looked for
GOALS = (1.0, 0.1, 0.01)


@dataclass(frozen=True)
class Reference:
    """Extrapolated values and how uncertain each is, in the values' units."""

    values: Mapping[str, float]
    uncertain: Mapping[str, float]

    @property
    def uncertainty(self) -> float:
        """The largest relative uncertainty, %."""
        return max(100.0 * abs(self.uncertain[key] / value) for key, value in self.values.items())

    def error(self, forces: Mapping[str, float]) -> float:
        """The largest deviation from the reference, %; only of what both have."""
        common = self.values.keys() & forces.keys()
        return max(100.0 * abs(forces[key] / self.values[key] - 1.0) for key in common)


def extrapolated(
    coarse: Mapping[str, float], fine: Mapping[str, float], ratio: float, order: int
) -> Reference:
    """From two computations whose cells or steps differ by `ratio`, with an error of this order."""
    common = [key for key in fine if key in coarse]
    gain = 1.0 / (ratio**order - 1.0)
    values = {key: fine[key] + gain * (fine[key] - coarse[key]) for key in common}
    return Reference(values, {key: abs(fine[key] - coarse[key]) for key in common})


def references(runs: Sequence[Run]) -> dict[str, Reference]:
    """Of every problem with two meshes of one family; `paper` spreads its cells otherwise."""
    found = {}
    for problem in PROBLEMS:
        mine = [r for r in runs if r.case.problem == problem and r.case == Case(problem, r.case.level)]
        family = sorted((r for r in mine if r.case.level != "paper"), key=lambda r: r.nodes)
        if len(family) > 1:
            coarse, fine = family[-2:]
            ratio = float(np.sqrt(fine.nodes / coarse.nodes))
            found[problem] = extrapolated(coarse.forces, fine.forces, ratio, 2)
    return found


def step_runs(runs: Sequence[Run]) -> list[Run]:
    """Scene B on one mesh with ever shorter steps of the slide."""
    level = min((r.case.level for r in runs if r.case.steps != 30), default=None, key=str)
    cases = [Case("B", level, steps=steps) for steps in STEPS] if level is not None else []
    return [r for case in cases for r in runs if r.case == case]


def step_reference(runs: Sequence[Run]) -> Reference | None:
    """The limit of short steps on that mesh, first order in the step."""
    family = step_runs(runs)
    if len(family) < 2:
        return None
    ratio = family[-1].case.steps / family[-2].case.steps
    return extrapolated(family[-2].forces, family[-1].forces, ratio, 1)


def error(run: Run, known: Mapping[str, Reference]) -> float | None:
    """Against the problem's reference, %."""
    return known[run.case.problem].error(run.forces) if run.case.problem in known else None


def numbers(runs: Sequence[Run], models: Models) -> dict[str, float]:
    """Costs and errors of the runs, references, ratios, the cheapest way to every goal."""
    known, found = references(runs), {}
    for problem, one in known.items():
        found |= {f"reference.{problem}.{key}": value for key, value in one.values.items()}
        found[f"reference.{problem}.uncertainty_percent"] = one.uncertainty
    for run in runs:
        key = run.case.key
        found |= {f"{key}.cpu_s": run.cpu_s, f"{key}.nodes": run.nodes}
        found |= {f"{key}.iterations": run.iterations, f"{key}.factorisations": run.factorisations}
        found |= {f"{key}.{name}": value for name, value in run.forces.items()}
        deviation = error(run, known)
        found |= {} if deviation is None else {f"{key}.error_percent": deviation}
    for key, (cpu_s, force) in models.items():
        found |= {f"hover.{key}.cpu_s": cpu_s, f"hover.{key}.Fe": force}
        if "hover" in known:
            found[f"hover.{key}.error_percent"] = known["hover"].error({"Fe": force})
    for problem in PROBLEMS:
        for goal in GOALS:
            if best := cheapest(runs, problem, goal):
                found[f"{problem}.to_{goal:g}_percent.cpu_s"] = best.cpu_s
    return found | compared(runs) | step_errors(runs)


def compared(runs: Sequence[Run]) -> dict[str, float]:
    """Every variant beside the usual way on the same mesh: ratio of CPU, largest change of a force."""
    found: dict[str, float] = {}
    for run in runs:
        usual = next((r for r in runs if r.case == Case(run.case.problem, run.case.level)), None)
        if run.case.variant.startswith("q2p1_") and run.case.steps == 30 and usual:
            found[f"{run.case.key}.cpu_over_usual"] = run.cpu_s / usual.cpu_s
            nothing = dict.fromkeys(usual.forces, 0.0)
            found[f"{run.case.key}.change_percent"] = Reference(usual.forces, nothing).error(run.forces)
    return found


def step_errors(runs: Sequence[Run]) -> dict[str, float]:
    """Errors of the step size alone."""
    limit = step_reference(runs)
    if limit is None:
        return {}
    found = {f"B.steps_{r.case.steps}.error_percent": limit.error(r.forces) for r in step_runs(runs)}
    return found | {"reference.B_steps.uncertainty_percent": limit.uncertainty}


def cheapest(runs: Sequence[Run], problem: str, goal: float) -> Run | None:
    """The cheapest measured run, as recommended but for element and mesh, that reaches the goal (%)."""
    known = references(runs)
    usual = [run for run in runs if run.case == Case(problem, run.case.level, run.case.element)]
    good = [run for run in usual if problem in known and known[problem].error(run.forces) <= goal]
    return min(good, key=lambda run: run.cpu_s, default=None)


def recommended(runs: Sequence[Run]) -> list[str]:
    """The cheapest way to every goal, as a table; a star where the reference is not so certain."""
    rows = []
    for problem, one in references(runs).items():
        cells = [PROBLEMS[problem]]
        for goal in GOALS:
            best = cheapest(runs, problem, goal)
            cells.append("none" if best is None else _told(best) + " *" * (one.uncertainty > goal))
        rows.append([*cells, f"{one.uncertainty:.2g} %"])
    return markdown(("problem", *(f"to {goal:g} %" for goal in GOALS), "reference uncertain by"), rows)


def variants(found: Mapping[str, float]) -> list[str]:
    """Ratio of CPU time and change of the forces of everything that is not as recommended."""
    ending = ".cpu_over_usual"
    ratios = {key.removesuffix(ending): ratio for key, ratio in found.items() if key.endswith(ending)}
    rows = [[key, f"{r:.2f}", f"{found[f'{key}.change_percent']:.1g}"] for key, r in ratios.items()]
    return markdown(("run", "CPU over the usual", "largest change %"), rows)


def _told(run: Run) -> str:
    element = run.case.element.replace("q2p1", "q2-p1").replace("q1_fbar", "f-bar").upper()
    return f"{run.case.mesh_name} {element} ({run.cpu_s:.2g} s)"


def series(runs: Sequence[Run], models: Models) -> list[Series]:
    """Error against CPU seconds: a curve over the meshes for each problem and variant."""
    known, found, unit = references(runs), [], "% over CPU s"
    for problem in known:
        for variant in dict.fromkeys(r.case.variant for r in runs if r.case.problem == problem):
            mine = [r for r in runs if (r.case.problem, r.case.variant) == (problem, variant)]
            mine.sort(key=lambda r: r.nodes)
            y = [known[problem].error(r.forces) for r in mine]
            found.append(Series(f"{problem} {variant}", [r.cpu_s for r in mine], y, unit))
    if "hover" in known:
        for key, (cpu_s, force) in models.items():
            found.append(Series(f"hover {key}", [cpu_s], [known["hover"].error({"Fe": force})], unit))
    limit = step_reference(runs)
    if limit is not None:
        mine = step_runs(runs)
        y = [limit.error(r.forces) for r in mine]
        found.append(Series("B steps", [r.cpu_s for r in mine], y, unit))
    return found

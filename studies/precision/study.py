"""Error against CPU seconds: elements, meshes, contact schemes, couplings, steps, back ends,
models.

Also what `plan` saves by leaving terms out, how time and memory of a step grow with the nodes, and
where a step's time goes. Beside json, csv and picture the tables are written as work_precision.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evfem.common.storage import write_text

from ..common import Study, make_folder
from ..peers.problem import TOLERANCE
from . import growth, shares
from . import plan as savings
from .apart import answer
from .evaluation import numbers, recommended, references, series
from .figure import draw
from .growth import Size
from .models import Model, models
from .plan import Saving
from .runs import ROUNDS, Run, full, measure, quick, warm_up, without_fast

ASSUMPTIONS = {
    "problems": "A, B, C: half a finger between two ellipses, pressed 1.5 mm, slid 3 mm, pressed at 1000 V; "
    "hover: 0.25 mm above the display at 2000 V; ramp: pressed 0.5 mm, then up to 2000 V in ten steps; "
    "smooth, ridged: Table 2's finger pressed to 0.05 N/mm at 1000 V and slid 0.5 mm, friction 0.3",
    "error": "largest deviation of a problem's forces (for the pads the indentation too) from the reference",
    "reference": "Q2-P1 on the finest two meshes (L1 and L2; medium and fine), extrapolated at second order; "
    "uncertainty: the whole difference between the two. The finest mesh is judged by an extrapolation that "
    "contains it",
    "steps": "the step size of B is judged on its mesh by its own limit, first order from the two shortest",
    "cpu_s": "process time from the mesh to the last step, imports and compilation left out, one thread, "
    "in a process that has run before; least of three for runs below a second",
    "recommended": "exact contact, monolithic; the cheapest measured run; a star where the reference is less "
    "certain than the goal",
    "plain": "pypardiso cannot be imported: SuperLU",
    "growth": "scene B's finger, four press and four slide steps of 0.1 mm; the first press step counts as "
    "set-up; memory is the largest resident of a process, interpreter and imports included",
    "factorisations": "CPU of a step over CPU of one LDL^T factorisation of the same tangent without Schur "
    "complement (PARDISO, mtype -2, float64, analysis left out), same process",
    "tolerance": TOLERANCE,
    "threads": 1,
}


@dataclass(frozen=True)
class Measured:
    """Everything the study has measured."""

    runs: list[Run]
    models: list[Model]
    savings: list[Saving]
    sizes: list[Size]
    shares: dict[str, float]


def main(quick: bool = False, out: Path | None = None) -> dict[str, Any]:
    """All measurements, their numbers, tables and figure."""
    return report(measured(quick), quick, out)


def measured(only_quick: bool) -> Measured:
    """The runs with evfem[fast], then those without, then the rest."""
    cases = quick() if only_quick else full()
    warm_up()
    runs = [measure(case, 1 if only_quick else ROUNDS) for case in cases if case.fast]
    runs += without_fast([case for case in cases if not case.fast])
    parts: dict[str, float] = shares.measured(0) if only_quick else answer("shares", [2])[0]
    return Measured(
        runs,
        models(),
        savings.measured(only_quick),
        growth.measured(only_quick),
        {f"shares.{key}": value for key, value in parts.items()},
    )


def report(found: Measured, quick: bool, out: Path | None) -> dict[str, Any]:
    """Numbers, tables and figure of what was measured."""
    curves, known = series(found.runs, found.models), references(found.runs)
    all_numbers = numbers(found.runs, found.models) | savings.numbers(found.savings)
    all_numbers |= growth.numbers(found.sizes) | found.shares
    tables = {
        "The cheapest way to an error": recommended(found.runs),
        "Beside the recommended way, on the same mesh": variants(all_numbers),
        "What leaving out saves": savings.table(found.savings),
        "Growth": growth.table(all_numbers, found.sizes),
        "A step at that many nodes": shares.table(all_numbers),
    }
    study = Study(
        "work_precision",
        all_numbers,
        {},
        ASSUMPTIONS | {"tables": tables},
        curves + growth.series(found.sizes),
        lambda: draw(curves, known, found.sizes, all_numbers),
    )
    result = study.finish(out, quick)
    text = page(result)
    print(text)
    if out is not None:
        write_text(make_folder(out) / "work_precision.md", text)
    return result


def variants(found: Mapping[str, float]) -> list[str]:
    """Ratio of CPU time and change of the forces of everything that is not as recommended."""
    lines = ["| run | CPU over the usual | largest change % |", "|---|---|---|"]
    ending = ".cpu_over_usual"
    for key, ratio in found.items():
        if key.endswith(ending):
            name = key.removesuffix(ending)
            lines.append(f"| {name} | {ratio:.2f} | {found[f'{name}.change_percent']:.1g} |")
    return lines


def page(result: Mapping[str, Any]) -> str:
    """The tables with date and versions, as Markdown."""
    made = result["provenance"]
    versions = ", ".join(f"{name} {number}" for name, number in made["versions"].items())
    lines = ["# Error against time", "", f"{made['date']}; {versions}; one thread; CPU seconds.", ""]
    for title, table in result["assumptions"]["tables"].items():
        lines += [f"## {title}", "", *table, ""]
    share = 100.0 * result["numbers"]["shares.setup_share_of_a_20_step_press"]
    lines.append(f"Set-up before the first step: {share:.1f} % of a 20-step press.")
    return "\n".join(lines) + "\n"

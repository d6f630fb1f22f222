"""Hard cases: does it converge to the right physics, or say why not, and what does it cost?

Every case states its expected physics and is judged by a number; one that does not converge is
listed with its message. Outcomes: passed; wrong; not converged; error. Beside json, csv and picture the
table is written as stability.md.
"""

from collections import Counter
from collections.abc import Mapping

from ..common import Series, Study, markdown, side_by_side
from . import contact, electric, same, tissue
from .case import Case, Found, judge
from .figure import draw

GROUPS = tuple(group for module in (tissue, electric, contact, same) for group in module.GROUPS)
CASES: Mapping[str, Case] = {case.key: case for group in GROUPS for case in group.cases}
HEAD = (
    "group",
    "case",
    "outcome",
    "steps",
    "parts",
    "cuts",
    "iterations",
    "CPU s",
    "force",
    "energy",
    "found",
)
ASSUMPTIONS = {
    "outcomes": "passed; wrong; not converged; error",
    "steps": "requested steps; parts: as many as were accepted; cuts: attempts that failed and were halved",
    "force": "largest sum of all forces in any step over the largest force; left out with inertia",
    "energy": "largest energy of any step that no column has, over the largest column of that step",
    "cpu_s": "process time, without imports and compilation; two processes at a time",
    "meshes": "coarse ones; the physics judged here does not need finer ones",
}
MEASURED = ("steps", "substeps", "cuts", "iterations", "cpu_s", "force_error", "energy_error")


def main(quick: bool = False) -> Study:
    """Judge all cases, or the quick ones, in two processes; numbers, table and figure."""
    chosen = [key for key, case in CASES.items() if case.quick or not quick]
    found = side_by_side(judge_by_key, chosen, 1 if quick else 2)
    said = {one.key: {"expected": one.expected, "outcome": one.outcome, "found": one.said} for one in found}
    rest = ASSUMPTIONS | {"cases": said, "groups": by_group(found)}
    return Study(
        "stability", numbers(found), {}, rest, series(found), lambda: draw(found), tables=tables(found)
    )


def judge_by_key(key: str) -> Found:
    """Judge the case of that name; for other processes."""
    return judge(CASES[key])


def numbers(found: list[Found]) -> dict[str, float]:
    """Costs and balances of every case, counts of every group and of all."""
    result: dict[str, float] = {}
    for one in found:
        result[f"{one.key}.good"] = float(one.good)
        result |= {f"{one.key}.{name}": float(getattr(one, name)) for name in MEASURED}
    for name, (good, all_of_it) in by_group(found).items():
        key = f"groups.{name}".replace(" ", "_")
        result |= {f"{key}.good": float(good), f"{key}.cases": float(all_of_it)}
    result["good"], result["cases"] = float(sum(one.good for one in found)), float(len(found))
    result["cpu_s"] = sum(one.cpu_s for one in found)
    return result


def by_group(found: list[Found]) -> dict[str, tuple[int, int]]:
    """Group -> cases with the expected outcome, and all of them."""
    good, every = Counter(one.group for one in found if one.good), Counter(one.group for one in found)
    return {name: (good[name], count) for name, count in every.items()}


def series(found: list[Found]) -> list[Series]:
    """What the bars of the figure show, by case."""
    names = [one.key.replace(",", "") for one in found]
    units = {"cpu_s": "s", "cuts": "1", "iterations": "1", "steps": "1"}
    return [Series(name, names, [float(getattr(one, name)) for one in found], units[name]) for name in units]


def tables(found: list[Found]) -> dict[str, list[str]]:
    """Counts by group, and the cases, those that failed with what was expected."""
    groups = [[name, str(good), str(count)] for name, (good, count) in by_group(found).items()]
    rows = []
    for one in found:
        said = one.said if one.good else f"{one.said}; expected: {one.expected}"
        cells = [one.group, one.name, one.outcome if one.good else f"**{one.outcome}**"]
        cells += [str(n) for n in (one.steps, one.substeps, one.cuts, one.iterations)]
        cells += [f"{one.cpu_s:.1f}", f"{one.force_error:.0e}", f"{one.energy_error:.0e}"]
        rows.append([*cells, said.replace("|", "/")])
    return {"Groups": markdown(("group", "as expected", "cases"), groups), "Cases": markdown(HEAD, rows)}

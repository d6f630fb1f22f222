"""Never stuck, never silently wrong: scenes that nobody chose, their invariants, their ends and times.

Each scene is drawn from its seed and number, run in a process of its own with a limit of CPU time, and its
invariants are checked in every row. Ends: equilibrium; explained, a step without any equilibrium that says
so; not_converged; invariants_broken; timeout; refused, a mistake of the generator; error. Beside json, csv
and picture the folder `campaign` has the table of all ends and every scene that failed.
"""

from collections import Counter
from pathlib import Path

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.pools import cores

from .. import Sample
from ..common import Series, Study, make_folder
from .ending import OUTCOMES, Ending
from .figure import draw as figure_of
from .run import run

#: scenes unless said otherwise, and in the quick study
SCENES, QUICK = 300, 6
#: how many scenes of about the same size a scene's time is compared with
NEIGHBOURS = 21
TIME = (
    "CPU seconds of a scene alone, at most {}, relative to the median of the "
    f"{NEIGHBOURS} scenes nearest in requested steps"
)
ASSUMPTIONS = {
    "outcomes": "equilibrium; explained: no equilibrium exists, and the sentence says why; not_converged; "
    "invariants_broken; timeout; refused: a mistake of the generator; error",
    "remainder": "works less stored, kinetic and dissipated energy over the largest of them, in any row",
    "meshes": "coarse ones of any size, with 6,000 displacement unknowns or so",
}


def main(quick: bool, out: Path | None, sample: Sample) -> Study:
    """Run the scenes in processes; numbers, table, failed scenes and figure."""
    count = sample.scenes or (QUICK if quick else SCENES)
    keys = [(sample.seed, number) for number in range(count)]
    folder = None if out is None else make_folder(out) / "campaign"
    ends = run(keys, folder, min(sample.workers or cores(), count), float(sample.limit))
    kinds = Counter(f"{one.outcome}: {one.kind}" for one in ends if not one.good)
    said = ASSUMPTIONS | {"time": TIME.format(sample.limit), "kinds": dict(kinds.most_common())}
    given = {"scenes": count, "seed": sample.seed, "limit": sample.limit}
    return Study(
        "campaign", numbers(ends), {}, said, series(ends), lambda: figure_of(ends, slowness(ends)), given
    )


def numbers(ends: list[Ending]) -> dict[str, float]:
    """How many scenes there are of each class of ends, the slowest and the worst remainder."""
    counts = Counter(one.outcome for one in ends)
    return {
        "scenes": float(len(ends)),
        **{name: float(counts[name]) for name in OUTCOMES},
        "slowest_over_median": float(slowness(ends).max(initial=0.0)),
        "largest_remainder": max((one.remainder for one in ends), default=0.0),
        "cpu_s": sum(one.cpu_s for one in ends),
    }


def slowness(ends: list[Ending]) -> Floats:
    """CPU time of every scene over the median of those nearest in requested steps (scenes,)."""
    spent = np.array([one.cpu_s for one in ends])
    size = np.log([max(one.requested, 1) for one in ends])
    near = [np.argsort(np.abs(size - own), kind="stable")[:NEIGHBOURS] for own in size]
    medians = np.array([np.median(spent[neighbours]) for neighbours in near])
    return np.divide(spent, medians, out=np.zeros_like(spent), where=medians > 0.0)


def series(ends: list[Ending]) -> list[Series]:
    """Times, iterations and remainders of every class of ends over the requested steps."""
    found = []
    for outcome in OUTCOMES:
        ours = [one for one in ends if one.outcome == outcome]
        steps = [one.requested for one in ours]
        for name, unit in (("cpu_s", "s"), ("iterations", "1"), ("remainder", "1")):
            values = [float(getattr(one, name)) for one in ours]
            found.append(Series(f"{outcome}.{name}", np.array(steps, dtype=float), np.array(values), unit))
    return found

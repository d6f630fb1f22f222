"""Error against CPU seconds: elements, meshes, contact schemes, steps, back ends, models.

Also how time and memory of a step grow with the nodes, and where a step's time goes. Beside json, csv and
picture the tables are written as work_precision.md.
"""

from functools import partial

from ..common import Study, alone
from ..peers.problem import TOLERANCE
from . import growth, shares
from .evaluation import numbers, recommended, references, series, variants
from .figure import draw
from .runs import ROUNDS, full, models
from .runs import measured as measured_runs
from .runs import quick as quick_cases

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
    "recommended": "exact contact; the cheapest measured run; a star where the reference is less "
    "certain than the goal",
    "growth": "scene B's finger, four press and four slide steps of 0.1 mm; the first press step counts as "
    "set-up; memory is the largest resident of a process, interpreter and imports included",
    "factorisations": "CPU of a step over CPU of one LDL^T factorisation of the same tangent without Schur "
    "complement (PARDISO, mtype -2, float64, analysis left out), same process",
    "tolerance": TOLERANCE,
    "threads": 1,
}


def main(quick: bool = False) -> Study:
    """All measurements, their numbers, tables and figure."""
    runs = measured_runs(quick_cases() if quick else full(), 1 if quick else ROUNDS)
    parts = shares.measured(0) if quick else alone(shares.measured_alone, 2)
    forms, sizes = models(), growth.measured(quick)
    found = numbers(runs, forms) | growth.numbers(sizes)
    found |= {f"shares.{key}": value for key, value in parts.items()}
    curves, known = series(runs, forms), references(runs)
    tables = {
        "The cheapest way to an error": recommended(runs),
        "Beside the recommended way, on the same mesh": variants(found),
        "Growth": growth.table(found, sizes),
        "A step at that many nodes": shares.table(found),
    }
    picture = partial(draw, curves, known, sizes, found)
    series_of_all = curves + growth.series(sizes)
    return Study("work_precision", found, {}, ASSUMPTIONS, series_of_all, picture, tables=tables)

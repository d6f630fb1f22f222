"""evfem beside FElupe, FEniCSx, GetFEM and NGSolve: time, memory, error in the press-and-slide benchmark.

Same nodes, laws, steps and tolerance (the largest free residual over the largest force on the bone), one
thread. Every run has a process of its own, in the interpreter that has the package; the packages alternate,
and the least of the rounds counts; the finest level has one. A package that is not there is named and left
out. Only the ratios mean anything on another machine. Beside json, csv and picture the table is written as
peers.md.
"""

import sys
from collections.abc import Iterable, Mapping
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ..common import Study
from .evaluation import CONTENDERS, FEWER, Run, numbers, race, series
from .hosts import PACKAGES, missing, run_once
from .problem import GIVEN, TOLERANCE, Way
from .shown import draw, tables

#: level -> scenes and rounds
FULL: Mapping[int, tuple[str, int]] = {0: ("ABC", 3), 1: ("ABC", 3), 2: ("ABC", 1)}
RACE: Mapping[int, tuple[str, int]] = {0: ("AB", 3), 1: ("AB", 3), 2: ("AB", 1)}
#: the finest level of a package that is several times slower than the others there
FINEST: Mapping[str, int] = {"getfem": 1}
QUICK: Mapping[int, tuple[str, int]] = {0: ("A", 1)}
#: runs after which everything must be compiled: FEniCSx needs up to three, because the name of a form depends
#: on what was compiled before it
MOST_WARM_UPS = 5
COMPILED = 0.1  # CPU seconds for forms, below which nothing was compiled
ASSUMPTIONS = {
    "reference": "exact contact, extrapolated from quadratic elements of two packages that agree; within "
    "0.04 % (A), 0.2 % (B); there is none for C",
    "cpu_s": "least of the rounds (three, one on L2), process time of all threads, set-up included, imports "
    "left out; FEniCSx with its forms compiled before, except in the quick version; cold_cpu_s: its first "
    "run, which compiles them, and form_cpu_s what of it went into the forms",
    "process_cpu_s": "of the same round, from the start of the interpreter, imports included",
    "peak_MB": "largest resident memory of the process, interpreter and imports (imported_MB) included",
    "contact": "evfem exact; peers: penalty of 1000 N/mm per mm at every node, below 0.1 um of penetration, "
    "the same spring for sticking friction; GetFEM's own brick, an augmented Lagrangian, takes as many "
    "iterations in A on larger matrices, and full Newton steps with it did not converge in B",
    "solver": "evfem and FElupe PARDISO; FEniCSx MUMPS with the ordering PORD (A on L2 12 CPU s, with what "
    "MUMPS chooses 16, with PETSc's own Cholesky 24, SuperLU_DIST 39; B 46 and 51); NGSolve PARDISO of the "
    "wheel mkl (A on L2 21 CPU s, with its own sparse Cholesky 30, UMFPACK 45); GetFEM its own interface to "
    "MUMPS, which analyses every matrix anew, with the system's BLAS, which should be an optimised one "
    "(libopenblas0-pthread); symmetric where the tangent is (A)",
    "elements": "q1: 2 x 2 points; q2, q2p1: cells of 2 x 2 linear ones through the same nodes, 3 x 3 points",
    "pull": "C: FEniCSx, GetFEM and NGSolve integrate with the nodes as points, so q1 is the same sum as "
    "evfem's; on quadratic edges evfem and FElupe project the chord, they the edge at its nodes",
    "Ft_mean_2_to_3": "plain mean of the eleven values at 2.0 ... 3.0 mm; the source does not say which "
    "mean. Of four readings (trapezoidal rule +0.4 %, without the first value +1.5 %, without the last "
    "-0.6 %) it is the one that quadratic cells on L2 reproduce (-0.02 %): its error is no independent check",
    "equal_error": "CPU seconds between the levels of a curve, straight in the logarithms; a goal that the "
    "coarsest level already meets costs that level; no extrapolation to finer ones",
    "race": "F_n of A and F_t after 3 mm of B to 0.1 %: each package with the fastest of 15+30 steps (press "
    "and slide) at a tolerance of 1e-8 and of 5+10 and 3+6 at 1e-6, interpolated between the levels",
    "tolerance": TOLERANCE,
    "finest": f"no runs above these levels, where they take several times as long as others: {dict(FINEST)}",
    "threads": 1,
}


def compete(
    plan: Mapping[int, tuple[str, int]],
    present: Iterable[tuple[str, str]],
    compiled: Path | None = None,
    way: Way = GIVEN,
) -> tuple[list[Run], dict[str, str]]:
    """Every contender in turn, round after round: the best runs, and why others failed."""
    present = list(present)
    runs, failed = [], {}
    for level, (scenes, rounds) in plan.items():
        able = [who for who in present if level <= FINEST.get(who[0], level)]
        for scene in scenes:
            tries = [[run_once(*who, scene, level, compiled, way) for who in able] for _ in range(rounds)]
            for who, found in zip(able, zip(*tries, strict=True), strict=True):
                good = [one for one in found if "failed" not in one]
                if len(good) < rounds:
                    name = Run(*who, scene, level, {}, way).key
                    failed[name] = next(one["failed"] for one in found if "failed" in one)
                if good:
                    best = min(good, key=lambda one: one["cpu_s"])
                    worst = max(one["cpu_s"] for one in good)
                    runs.append(Run(*who, scene, level, best | {"slowest_cpu_s": worst}, way))
    return runs, failed


def warm_up(
    scenes: str, level: int, present: Iterable[tuple[str, str]], compiled: Path
) -> dict[str, dict[str, float]]:
    """Runs that are not timed, until files have been read and forms are compiled; what the first ones cost.

    The cost is kept of packages that say what they compile, by the key of the run.
    """
    cold: dict[str, dict[str, float]] = {}
    for who in present:
        for scene in scenes:
            first = found = run_once(*who, scene, level, compiled)
            if "form_cpu_s" not in first:
                break  # nothing to compile for the other scenes
            key = Run(*who, scene, level, first).key
            cold[key] = {"cold_cpu_s": first["cpu_s"], "form_cpu_s": first["form_cpu_s"]}
            for _ in range(MOST_WARM_UPS - 1):
                if found.get("form_cpu_s", 0.0) < COMPILED:
                    break
                found = run_once(*who, scene, level, compiled)
    return cold


def main(quick: bool = False) -> Study:
    """All runs, their numbers, tables and figure; a package that is not installed is named."""
    absent = missing()
    for name in absent:
        how = PACKAGES[name].install
        print(f"study peers: {name} is not installed ({how}), left out", file=sys.stderr)
    present = [who for who in CONTENDERS if who[0] not in absent]
    with TemporaryDirectory() as folder:
        compiled = Path(folder)
        cold = {} if quick else warm_up("BAC", min(FULL), present, compiled)
        runs, failed = compete(QUICK if quick else FULL, present, compiled)
        for way in () if quick else FEWER:
            more, lost = compete(RACE, present, compiled, way)
            runs, failed = runs + more, failed | lost
    said = {"missing": absent, "failed": failed, "peers": versions(runs)}
    found = numbers(runs, cold) | ({} if quick else race(runs))
    curves, shown = series(runs), tables(runs, failed, found)
    return Study("peers", found, {}, ASSUMPTIONS | said, curves, lambda: draw(runs), tables=shown)


def versions(runs: Iterable[Run]) -> dict[str, str]:
    """Versions of the peers: of this interpreter's packages, and as the others' runs say."""
    found = {name: version(name) for name in ("felupe", "pypardiso") if find_spec(name)}
    for run in runs:
        found |= run.measured.get("versions", {})
    return found

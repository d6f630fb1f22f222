"""Do drawn scenes still end as they did? Changes that take no other iterations are compared to 1e-11.

    python tests/tools/same_ends.py record BEFORE.csv --seed 77 --scenes 270 [--variant steps] [--limit 60]
    python tests/tools/same_ends.py compare BEFORE.csv AFTER.csv [--tolerance 1e-6]
    python tests/tools/same_ends.py table BEFORE.csv AFTER.csv... --out docs/results/variants.csv

`record` runs scenes of `evfem study campaign`, each in a process of its own with a limit of CPU
time, and writes how each ends: forces and indentation of the last row, counts and CPU seconds.
`compare` lists the scenes that end elsewhere, or not, and the sums; `table` has a row for each AFTER, by
the name of its file, for the page on verification. A force differs relative to
the largest force of its scene. `tests/tools/ends.csv` holds the ends that a change is judged by.
Scenes that run out of time in either are left out of all but their count.

A variant should have the same ends: no tangent is `kept`; nothing is `predicted` from the last step; the
other sparse `solver`; no `compiled` code; an `input` changed by 1e-9; twice the `steps`.
`--without` switches off one of the solver's safeguards (`tools.safeguards`).
"""

import argparse
import csv
import os
import resource
import signal
import subprocess
import sys
import time
import warnings
from contextlib import nullcontext
from datetime import date
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

VARIANTS = ("kept", "predicted", "solver", "compiled", "input", "steps")
#: so many times the steps
FACTORS = {"steps": 2, "steps4": 4, "steps8": 8}
TIMEOUT = "timeout"
#: counts that tell scenes in which a variant acts, and what it costs there
COSTS = ("iterations", "factorisations")
#: compiled modules, without which the readable forms run
COMPILED = ("loops", "solids", "contact", "cholesky")
FORCES = ("applied_force", "normal_force", "tangential_force", "electrostatic_force")
COLUMNS = ("seed", "scene", "end", "requested", "rows", "substeps", "iterations", "factorisations", "cuts",
           "cpu_s", "indentation", *FORCES)  # fmt: skip
LIMIT_S = 300.0
Row = dict[str, str]


def varied(scene, variant: str):
    """The scene as the variant has it."""
    import safeguards  # beside this file; imports the package

    from evfem.sweeps.check import more_steps, perturbed

    safeguards.SAFEGUARDS.get(variant, lambda: None)()
    if variant in safeguards.STRATEGIES:
        return safeguards.of_scene(scene, **safeguards.STRATEGIES[variant])
    if variant == "input":
        return perturbed(scene) or scene
    return more_steps(scene, FACTORS[variant]) if variant in FACTORS else scene


def run(key: tuple[int, int], variant: str = "", limit: float = LIMIT_S) -> Row:
    """The row of one scene, whose process dies beyond `limit` CPU seconds."""
    for name in COMPILED if variant == "compiled" else ():
        sys.modules[f"evfem.tissue.kernels.{name}"] = None  # type: ignore[assignment]
    from evfem.errors import InputError, NotConverged
    from evfem.newton.condensation import other_solver
    from evfem.scene.file import loads
    from evfem.simulation.run import simulate
    from evfem.studies.campaign.drawing import draw
    from evfem.studies.campaign.tables import text_of, with_files

    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + limit), resource.RLIM_INFINITY))
    begin, row = time.process_time(), {"end": "equilibrium"}
    with TemporaryDirectory() as folder:
        try:
            scene = varied(loads(text_of(with_files(draw(*key), Path(folder))), Path(folder)), variant)
            row["requested"] = str(scene.total_steps)
            with other_solver() if variant == "solver" else nullcontext():
                result = simulate(scene)
        except NotConverged as error:
            explained = "there is no equilibrium" in error.advice
            row["end"], result = "explained" if explained else "not_converged", error.result
        except InputError as error:
            row["end"], result = f"refused: {error.key}", None
    row["cpu_s"] = f"{time.process_time() - begin:.2f}"
    if result is not None and len(result.step):
        counts = result.provenance["solver"]
        row |= {
            name: str(counts[name]) for name in ("iterations", "factorisations", "cuts") if name in counts
        }
        row |= {"rows": str(len(result.step)), "substeps": str(int(result.substeps.sum()))}
        row |= {name: f"{getattr(result, name)[-1]:.12g}" for name in ("indentation", *FORCES)}
    return row


def record(path: Path, keys: list[tuple[int, int]], workers: int, variant: str, limit: float) -> int:
    """Run the scenes and write their rows."""
    from evfem.common.pools import processes

    one = partial(run, variant=variant, limit=limit)
    with processes(workers) as pool, path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
        table.writeheader()
        for (seed, number), row in pool(one, {key: key for key in keys}):
            if isinstance(row, Exception):
                status = getattr(row, "status", None)
                row = {"end": TIMEOUT if status == -signal.SIGXCPU else f"died: {status or row}"}
            table.writerow({"seed": seed, "scene": number, **row})
            file.flush()
            print(seed, number, *row.values(), flush=True)
    return 0


def read(path: Path) -> dict[tuple[str, str], Row]:
    with path.open(newline="") as file:
        return {(row["seed"], row["scene"]): row for row in csv.DictReader(file)}


def difference(one: Row, other: Row) -> float:
    """Largest difference of the last row: of forces relative to the largest one, of the indentation."""
    done = [bool(row["rows"]) and row["rows"] == row["requested"] for row in (one, other)]
    if not one["rows"] or (one["rows"] != other["rows"] and not all(done)):
        return 0.0 if one["rows"] == other["rows"] else float("inf")
    scale = max(*(abs(float(row[name])) for row in (one, other) for name in FORCES), 1e-9)
    worst = max(abs(float(one[name]) - float(other[name])) for name in FORCES) / scale
    depth = max(abs(float(one["indentation"])), abs(float(other["indentation"])), 1e-3)
    return max(worst, abs(float(one["indentation"]) - float(other["indentation"])) / depth)


def common(first: dict[Any, Row], second: dict[Any, Row]) -> tuple[list[Any], list[Any]]:
    """Scenes of both, and those of them that end within the limit of time in both."""
    both = [key for key in first if key in second]
    return both, [key for key in both if TIMEOUT not in (first[key]["end"], second[key]["end"])]


def compare(before: Path, after: Path, tolerance: float) -> int:
    """Print the scenes that end elsewhere and the sums; 1 if any ends worse than before."""
    first, second = read(before), read(after)
    both, keys = common(first, second)
    worse = [key for key in keys if first[key]["end"] == "equilibrium" != second[key]["end"]]
    other = [key for key in keys if difference(first[key], second[key]) > tolerance]
    for key in sorted({*worse, *other}, key=keys.index):
        one, two = first[key], second[key]
        ends = f"{one['end']:>13} -> {two['end']:<13} {difference(one, two):8.1e}"
        parts = f"{one['substeps']:>5} -> {two['substeps']:>5} parts"
        print(f"{'/'.join(key):>12} {ends}  {one['cpu_s']:>7} -> {two['cpu_s']:>7} s  {parts}")
    print(f"{len(keys)} scenes: {len(keys) - len(other)} the same to {tolerance:g}, {len(worse)} end worse")
    for name, table in {"before": first, "after": second}.items():
        late = [key for key in both if key not in keys and table[key]["end"] == TIMEOUT]
        print(f"out of time {name}: {len(late)}", *("/".join(key) for key in late))
    for name in ("cpu_s", "iterations", "factorisations", "cuts", "substeps"):
        sums = [sum(float(table[key][name] or 0.0) for key in keys) for table in (first, second)]
        print(f"{name:<15} {sums[0]:10.0f} -> {sums[1]:10.0f}")
    return 1 if worse else 0


def summed(before: Path, after: Path, tolerance: float) -> Row:
    """What a table has of the scenes that end within the limit of time in both."""
    first, second = read(before), read(after)
    both, keys = common(first, second)
    apart = [difference(first[key], second[key]) for key in keys]
    ends = [first[key]["end"] == "equilibrium" != second[key]["end"] for key in keys]
    found = {"variant": after.stem, "seed": keys[0][0], "scenes": len(both), "compared": len(keys)}
    found |= {"worse": sum(ends), "elsewhere": sum(one > tolerance for one in apart)}
    found |= {"largest": f"{max((one for one in apart if one < float('inf')), default=0.0):.2g}"}
    acts = [key for key in keys if any(first[key][name] != second[key][name] for name in COSTS)]
    found["acts"] = len(acts)
    for name in COSTS:
        sums = [sum(float(table[key][name] or 0.0) for key in acts) for table in (first, second)]
        found[name] = f"{sums[1] / sums[0]:.3g}" if acts else 1
    return {name: str(value) for name, value in found.items()}


def tabulate(before: Path, after: list[Path], out: Path, tolerance: float) -> int:
    """Write a row for each recording, with date and commit."""
    rows = [summed(before, one, tolerance) for one in after]
    asked = ["git", "log", "-1", "--format=%h"]
    commit = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    with out.open("w", newline="") as file:
        table = csv.DictWriter(file, [*rows[0], "date", "commit"], lineterminator="\n")
        table.writeheader()
        table.writerows(row | {"date": date.today().isoformat(), "commit": commit} for row in rows)
    return 0


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="run the scenes and write their ends")
    recording.add_argument("out", type=Path)
    recording.add_argument("--seed", type=int, default=77)
    recording.add_argument("--scenes", type=int, default=270)
    recording.add_argument("--only", type=int, nargs="*", help="numbers of the scenes")
    recording.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    recording.add_argument(
        "--variant", "--without", default="", help=f"{', '.join(VARIANTS)}, or a safeguard"
    )
    recording.add_argument("--limit", type=float, default=LIMIT_S, help="CPU seconds of a scene")
    comparing = commands.add_parser("compare", help="compare two recordings")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--tolerance", type=float, default=1e-6)
    writing = commands.add_parser("table", help="a row for each of several recordings")
    writing.add_argument("before", type=Path)
    writing.add_argument("after", type=Path, nargs="+")
    writing.add_argument("--out", type=Path, required=True)
    writing.add_argument("--tolerance", type=float, default=1e-3)
    given = parser.parse_args()
    if given.command == "record":
        numbers = given.only if given.only else range(given.scenes)
        keys = [(given.seed, number) for number in numbers]
        return record(given.out, keys, given.workers, given.variant, given.limit)
    if given.command == "table":
        return tabulate(given.before, given.after, given.out, given.tolerance)
    return compare(given.before, given.after, given.tolerance)


if __name__ == "__main__":
    sys.exit(main())

"""Are the numbers still the same? For changes of the code that must not change any result.

    python tests/tools/same_numbers.py record BEFORE.json     with the evfem before the change
    python tests/tools/same_numbers.py record AFTER.json      with the changed one, all else equal
    python tests/tools/same_numbers.py compare BEFORE.json AFTER.json [--tolerance 1e-12]

`record` runs small scenes that together go through every branch of the model (contact, friction,
attraction, time, own parts, elements, laws, encoding, resuming, sweeps), a minute
in all, and closed forms. It keeps every column of the histories but `seconds`, sums and extremes
of the last fields, and the solver's counts, with every digit. `record OUT.json --only WORD` runs
scenes with that word in their names.

`compare` prints, per scene, the largest relative differences of forces, widths, works, fields and
of all other columns, whether iterations and other counts are equal, and whether everything is
equal to the last bit. A difference is relative to the largest magnitude of its column in the run,
but at least to SHARE of the largest of its group and to FLOOR, so that the noise of what is zero
does not count. Exit status: 0 the same, 1 not.

Only the public interface of evfem is used, so that the tool outlives changes of what is inside.
"""

import argparse
import json
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from recorded import FORCES, STEPS, WIDTHS, WORKS, Numbers, runs, size

import evfem as ev

SHARE, FLOOR = 1e-3, 1e-9


def versions() -> dict[str, str]:
    """What computes, as far as it is installed."""
    found = {}
    for package in ("numpy", "scipy", "scikit-fem", "pypardiso", "mkl"):
        with suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def record(path: Path, only: str) -> int:
    """Run the scenes and write their numbers."""
    print(f"evfem {ev.__version__} in {Path(ev.__file__).parent}")
    scenes, begin = {}, time.perf_counter()
    for name, run in runs().items():
        if only not in name:
            continue
        start = time.perf_counter()
        scenes[name] = made = run()
        iterations, cuts = (made["counts"].get(key, 0) for key in ("iterations", "cuts"))
        seconds = time.perf_counter() - start
        print(f"{name:<36} {seconds:6.1f} s {iterations:6d} iterations {cuts:3d} cuts", flush=True)
    path.write_text(json.dumps({"versions": versions(), "scenes": scenes}, indent=0) + "\n")
    print(f"{len(scenes)} scenes, {time.perf_counter() - begin:.0f} s")
    return 0


# -- comparing -------------------------------------------------------------------------------------------


def chosen(columns: dict[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Columns with one of these names; those of a sweep have more behind a dot."""
    return {key: values for key, values in columns.items() if key.split(".")[0] in names}


def difference(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Largest relative difference of a group of columns; infinite where they are not of the same
    shape.
    """
    if set(one) != set(other):
        return np.inf
    worst, largest = 0.0, max((peak(values) for values in one.values()), default=0.0)
    for name in one:
        a, b = np.array(one[name], dtype=float), np.array(other[name], dtype=float)
        if a.shape != b.shape or not np.array_equal(np.isfinite(a), np.isfinite(b)):
            return np.inf
        scale = max(peak(one[name]), SHARE * largest, FLOOR)
        apart = np.abs(a - b)[np.isfinite(a)]
        worst = max(worst, float(apart.max(initial=0.0)) / scale)
    return worst


def peak(values: Any) -> float:
    return size(np.array(values, dtype=float))[2]


def field_difference(one: dict[str, Any], other: dict[str, Any]) -> float:
    """Largest relative difference of sums (relative to the sum of magnitudes) and of extremes."""
    if set(one) != set(other):
        return np.inf
    worst = 0.0
    for name, a in one.items():
        scale = np.maximum([a[1], a[1], a[2]], FLOOR)
        worst = max(worst, float(np.max(np.abs(np.subtract(a, other[name])) / scale)))
    return worst


def compared(one: Numbers, other: Numbers) -> tuple[list[float], bool, bool]:
    """Differences of forces, widths, works, fields and the rest; equal counts; equal to the last
    bit.
    """
    a, b = one["columns"], other["columns"]
    named = (*FORCES, *WIDTHS, *WORKS, *STEPS)
    rest = [key for key in {*a, *b} if key.split(".")[0] not in named]
    found = [difference(chosen(a, names), chosen(b, names)) for names in (FORCES, WIDTHS, WORKS)]
    found.append(field_difference(one["fields"], other["fields"]))
    found.append(difference({k: a[k] for k in rest if k in a}, {k: b[k] for k in rest if k in b}))
    counts = one["counts"] == other["counts"] and chosen(a, STEPS) == chosen(b, STEPS)
    return found, counts, json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def compare(before: Path, after: Path, tolerance: float) -> int:
    """Print the table; 1 if anything differs by more than `tolerance` or takes other iterations."""
    first, second = (json.loads(path.read_text()) for path in (before, after))
    if first["versions"] != second["versions"]:
        print(f"other versions: {first['versions']}\n                {second['versions']}")
    print(f"{'scene':<36}{'forces':>9}{'widths':>9}{'works':>9}{'fields':>9}{'others':>9}  counts  bits")
    good = True
    for name in {**first["scenes"], **second["scenes"]}:
        one, other = (recording["scenes"].get(name) for recording in (first, second))
        if one is None or other is None:
            good = False
            print(f"{name:<36} only in {before if other is None else after}")
            continue
        found, counts, bits = compared(one, other)
        good &= counts and max(found) <= tolerance
        shown = "".join(f"{value:9.1e}" if value else f"{'0':>9}" for value in found)
        print(f"{name:<36}{shown}  {'equal ' if counts else 'DIFFER'}  {'equal' if bits else 'differ'}")
    print("the same" if good else f"NOT the same within {tolerance:g}")
    return 0 if good else 1


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="run the scenes and write their numbers")
    recording.add_argument("out", type=Path)
    recording.add_argument("--only", default="", help="scenes with this word in their names")
    comparing = commands.add_parser("compare", help="compare two recordings")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("--tolerance", type=float, default=1e-12)
    given = parser.parse_args()
    if given.command == "record":
        return record(given.out, given.only)
    return compare(given.before, given.after, given.tolerance)


if __name__ == "__main__":
    sys.exit(main())

"""Are the derivatives of drawn scenes those of differences of their runs?

    python tests/tools/derivatives.py --seed 43 --scenes 100 [--out ROWS.csv]

Scenes of `evfem study campaign`, each motion in at most two steps and solved to 1e-11; of each three
numbers of its file are drawn. Compared are normal, tangential and electrostatic force, before the first
step whose nodes have other statuses, or which has other parts, in a run beside. Central differences
are over 2e-4 of a parameter; where they disagree, those over 1e-4 bring them to fourth order, and where both
are apart by more than 1e-5 the difference itself is not known that well. Errors are shares of the derivative,
or of a hundredth of the largest force over the parameter where that is more: 1e-7 of forces is rounding.
"""

import argparse
import csv
import signal
import sys
import time
import warnings
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from evfem.errors import InputError, NotConverged
from evfem.response.lines import STEP
from evfem.response.parameters import parameter_of
from evfem.response.sensitivities import sensitivities
from evfem.scene.file import loads
from evfem.scene.options import Output
from evfem.simulation.run import simulate
from evfem.studies.campaign.drawing import draw
from evfem.studies.campaign.tables import text_of, with_files

FORCES = ("normal_force", "tangential_force", "electrostatic_force")
TABLES = ("finger", "surface", "electrostatics", "adhesion", "hand", "motion")
#: shares of a parameter between the runs, agreement asked for, and CPU seconds of a scene
SHARES, AGREE, LIMIT = (2e-4, 1e-4), 1e-5, 120.0
STEPS, PARAMETERS = 2, 3
COLUMNS = ("seed", "scene", "key", "found", "steps", "of", "difference", "known_to")


def scene_of(seed, number, folder):
    """The scene, in fewer steps that are as long in runs beside, and solved further, and its tables."""
    tables = draw(seed, number)
    for motion in tables["motion"]:
        motion["steps"] = min(motion["steps"], STEPS)
    scene = loads(text_of(with_files(tables, folder)), folder)
    solver = replace(scene.solver, tolerance=1e-11, strategy=replace(scene.solver.strategy, steps="given"))
    scene = replace(scene, solver=solver, output=Output(every=1))
    return scene, tables


def keys_of(tables, path=()):
    """Dotted keys of all real numbers of a scene's tables."""
    entries = tables.items() if isinstance(tables, dict) else enumerate(tables)
    for name, value in entries:
        key = (*path, str(name))
        if isinstance(value, (dict, list)):
            yield from keys_of(value, key)
        elif isinstance(value, float):
            yield ".".join(key)


def drawn_keys(scene, tables, random):
    """Numbers of the scene that are parameters and may change a little, in random order."""
    keys = list(keys_of({name: tables[name] for name in TABLES if name in tables}))
    for key in map(str, random.permutation(keys)):
        with suppress(InputError):
            one = parameter_of(scene, key)
            for sign in (2.0, -2.0):
                one.applied(scene, sign * STEP * one.size)
            yield key


def same(run, base):
    """Steps (steps,) bool up to the first with other statuses or parts."""
    equal = [
        np.array_equal(one.contact_status, other.contact_status)
        for one, other in zip(run.frames, base.frames, strict=True)
    ]
    parts = (run.substeps == base.substeps) & (run.relaxations == base.relaxations)
    return np.logical_and.accumulate(np.array(equal) & parts)


def compared(scene, key, found):
    """How many steps are compared, the largest difference of a force and how well that is known."""
    one, kept, slopes = parameter_of(scene, key), np.ones(len(found.result.step), dtype=bool), []
    exact = np.array([found[name, key] for name in FORCES])
    kept &= np.isfinite(exact).all(axis=0)
    usual = max(1e-2 * max(np.abs(found.result[name]).max() for name in FORCES) / one.size, 1e-300)
    for share in SHARES:
        way = share * one.size
        ends = [simulate(one.applied(scene, sign * way)) for sign in (1.0, -1.0)]
        for run in ends:
            kept &= same(run, found.result)
        if not kept.any():
            return 0, np.nan, np.nan
        slopes.append([(ends[0][name] - ends[1][name]) / (2.0 * way) for name in FORCES])
        differences = np.array(slopes[-1])
        if len(slopes) > 1:
            differences = differences + (differences - slopes[0]) / 3.0
        size = np.maximum(np.abs(differences[:, kept]).max(axis=1), usual)[:, None]
        apart = float((np.abs(exact - differences)[:, kept] / size).max())
        if apart <= AGREE:
            return int(kept.sum()), apart, np.nan
    known = np.abs(np.subtract(*slopes))[:, kept] / size / 3.0
    return int(kept.sum()), apart, float(known.max())


def rows_of(seed, number):
    """A row for each parameter of a scene."""
    random = np.random.default_rng([seed, number, PARAMETERS])
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene, tables = scene_of(seed, number, Path(folder))
        keys = list(drawn_keys(scene, tables, random))
        while True:
            try:
                found = sensitivities(scene, keys[:PARAMETERS], FORCES)
            except InputError as error:  # of a parameter that changes the cells, or of the whole scene
                key = error.key.removeprefix("parameters.")
                if key not in keys:
                    return [{"key": "", "found": f"refused: {error}"}]
                keys.remove(key)
            except NotConverged:
                return [{"key": "", "found": "no equilibrium"}]
            else:
                return [{"key": key, **row_of(scene, key, found)} for key in keys[:PARAMETERS]]


def row_of(scene, key, found):
    """How a derivative stands beside differences."""
    try:
        steps, apart, known = compared(scene, key, found)
    except NotConverged:
        return {"found": "no equilibrium beside"}
    said = "agrees" if apart <= AGREE else "differs" if known <= AGREE else "difference unknown"
    if not steps:
        said = f"nothing to compare: {found.reasons.get(key) or 'statuses change'}"
    of = len(found.result.step)
    return {"found": said, "steps": steps, "of": of, "difference": apart, "known_to": known}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, default=43)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--only", type=int, nargs="*", help="numbers of the scenes")
    parser.add_argument("--out", type=Path)
    given, rows = parser.parse_args(), []
    signal.signal(signal.SIGPROF, _late)
    for number in given.only or range(given.scenes):
        begin = time.process_time()
        signal.setitimer(signal.ITIMER_PROF, LIMIT)
        try:
            found = rows_of(given.seed, number)
        except TimeoutError:
            found = [{"key": "", "found": f"not done in {LIMIT:g} CPU s"}]
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        for row in found:
            rows.append({"seed": given.seed, "scene": number, **row})
            print(f"{time.process_time() - begin:6.1f} s", *rows[-1].values(), flush=True)
    kinds = [row["found"] for row in rows]
    for kind in sorted(set(kinds)):
        print(f"{kinds.count(kind):5d}  {kind}")
    if given.out:
        with given.out.open("w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
            table.writeheader()
            table.writerows(rows)
    return int("differs" in kinds)


def _late(number, frame):
    raise TimeoutError


if __name__ == "__main__":
    sys.exit(main())

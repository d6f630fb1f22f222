"""Runs that are killed: `kill -9` at random moments, again and again, must lose nothing.

`kills(count, seed, out)` starts `evfem run` in processes of their own, kills each at a random
moment, looks at what is on disk, and goes on with `--resume`. After every fifth kill the run is
left to finish and its history is compared with that of a run nobody touched.
"""

from __future__ import annotations

import csv
import json
import os
import resource
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from random import Random
from xml.etree import ElementTree

import numpy as np

from evfem.common.storage import load_arrays
from evfem.mesh import file as meshfile
from evfem.scene.file import load
from evfem.simulation.result import CHECKPOINT_FORMAT, COLUMNS

from .scenes import block


def head(mesh: str, more: str = "") -> str:
    """The beginning of a scene: its finger from a mesh with the region `tissue`, and further keys
    of it.
    """
    return f"""version = 1
[finger]
mesh = "{mesh}"
{more}
[finger.materials.tissue]
law = "neo_hookean"
E = 0.05
nu = 0.45
[finger.electrical]
stratum_corneum_thickness = 0.3
"""


VOLTAGE = """[electrostatics]
law = "kaczmarek"
voltage = 400.0
insulator_thickness = 0.09
insulator_eps_r = 3.35
"""
#: name -> scene: attraction and a held force, viscosity on a texture, inertia and a held force
SCENES: Mapping[str, str] = {
    "force": head("block.vtu")
    + '[surface]\nkind = "flat"\nfriction = 0.3\n'
    + VOLTAGE
    + '[[motion]]\nkind = "press"\nforce = 0.02\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = 1.0\nsteps = 16\nhold = "force"\n',
    "viscous": head("block.vtu", "viscosity = 1e-3")
    + '[surface]\nkind = "sinusoid"\nfriction = 0.2\n[solver]\ndynamics = "viscous"\n'
    + '[[motion]]\nkind = "press"\nindentation = 0.2\nspeed = 5.0\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = -1.0\nsteps = 16\nspeed = 20.0\n',
    "inertial": head("block.vtu", "viscosity = 1e-4")
    + '[surface]\nkind = "flat"\nfriction = 0.2\n[solver]\ndynamics = "inertial"\n'
    + '[[motion]]\nkind = "press"\nindentation = 0.2\nspeed = 5.0\nsteps = 4\n'
    + '[[motion]]\nkind = "slide"\ndistance = 1.0\nsteps = 16\nspeed = 20.0\nhold = "force"\n',
}
FORCES = tuple(name for name in COLUMNS if "force" in name)
#: kills before a run is left to finish
IN_A_ROW = 5


def prepare(folder: Path, name: str) -> list[str]:
    """Mesh and scene in `folder`; the command that runs it there, without options."""
    folder.mkdir(parents=True, exist_ok=True)
    meshfile.write(block(24, 6, sag=0.3), folder / "block.vtu")
    (folder / f"{name}.toml").write_text(SCENES[name])
    return [sys.executable, "-m", "evfem.cli", "run", f"{name}.toml", "--no-plots"]


def environment() -> dict[str, str]:
    """The packages of this process, and one thread."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "OMP_NUM_THREADS": "1"}


def finish(folder: Path, command: list[str]) -> None:
    """Run a command to its end in `folder`; raises RuntimeError with its last words if it fails."""
    done = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"exit status {done.returncode}: {done.stderr[-500:]}")


def kill(folder: Path, command: list[str], wait: float, watched: Path | None = None) -> bool:
    """Start a command in `folder` and kill it `wait` seconds later, counted from when it first
    writes the `watched` file if one is given; whether it was still running.
    """
    quiet = subprocess.DEVNULL
    before = _written(watched)
    with subprocess.Popen(command, cwd=folder, env=environment(), stdout=quiet, stderr=quiet) as process:
        while watched is not None and _written(watched) == before and process.poll() is None:
            time.sleep(0.001)
        time.sleep(wait)
        running = process.poll() is None
        process.kill()
    return running


def _written(path: Path | None) -> int:
    """When a file was written last, 0 if it is not there."""
    return path.stat().st_mtime_ns if path is not None and path.exists() else 0


def history(path: Path) -> dict[str, list[str]]:
    """Columns of a history.csv, as text."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return {name: [row[name] for row in rows] for name in COLUMNS}


def broken(out: Path) -> list[str]:
    """Files in the folder of a run, under the names that a user knows, that are not whole."""
    checks = {
        "history.csv": lambda p: [float(x) for name in FORCES for x in history(p)[name]],
        "checkpoint.npz": lambda p: load_arrays(p, "checkpoint", CHECKPOINT_FORMAT),
        "summary.json": lambda p: json.loads(p.read_text()),
        "fields.pvd": lambda p: [
            meshfile.parts(p.parent / e.attrib["file"]) for e in ElementTree.parse(p).iter("DataSet")
        ],
    }
    found = []
    for path in sorted(out.iterdir()) if out.exists() else ():
        if path.name.startswith("."):
            continue
        check = checks.get(path.name, meshfile.parts)
        try:
            check(path)
            whole = path.suffix != ".csv" or path.read_bytes().endswith(b"\n")
        except Exception:  # whatever a reader trips over: the file is not whole
            whole = False
        if not whole:
            found.append(path.name)
    return found


def difference(one: Path, other: Path) -> tuple[float, bool]:
    """Largest difference of a force between two histories over the largest force, and whether
    everything but the time a step took is the same to the last digit; infinite if they have not
    the same steps.
    """
    first, second = history(one / "history.csv"), history(other / "history.csv")
    if first["step"] != second["step"]:
        return float("inf"), False
    a, b = (np.array([h[name] for name in FORCES], dtype=float) for h in (first, second))
    same = all(first[name] == second[name] for name in COLUMNS if name != "seconds")
    return float(np.abs(a - b).max() / np.abs(b).max()), same


def kills(count: int, seed: int, out: Path) -> dict[str, float]:
    """`count` kills that hit a running process, the scenes taking turns, in folders below `out`.

    Returns numbers: kills, rounds (runs left to finish), files found broken after a kill, fields
    missing or broken at the end, rounds that are the same to the last digit, the largest
    difference of a force over the largest force, kills before the first step was stored, and CPU
    seconds.
    """
    rng, begin = Random(seed), _cpu_seconds()
    lengths: dict[str, tuple[float, float]] = {}
    numbers = dict.fromkeys(("kills", "rounds", "broken", "fields_lost", "same_to_the_last_digit"), 0.0)
    numbers |= {"largest_difference": 0.0, "before_the_first_step": 0.0}
    while numbers["kills"] < count:
        name = list(SCENES)[int(numbers["rounds"]) % len(SCENES)]
        if name not in lengths:
            lengths[name] = _whole(out, name)
        _round(out, name, (rng, *lengths[name], count), numbers)
    return numbers | {"cpu_s": _cpu_seconds() - begin}


def _whole(out: Path, name: str) -> tuple[float, float]:
    """Run a scene that nobody touches: seconds of it all, and from its first file to its last."""
    command, whole, start = prepare(out, name), out / f"{name}-whole", time.perf_counter()
    finish(out, [*command, "--out", whole.name])
    seconds = time.perf_counter() - start
    return seconds, 1e-9 * (_written(whole / "summary.json") - _written(whole / "fields_00001.vtu"))


def _round(out: Path, name: str, plan: tuple[Random, float, float, int], numbers: dict[str, float]) -> None:
    """Kill a run until it has been hit `IN_A_ROW` times or is done, let it finish, compare."""
    rng, length, computing, count = plan
    folder = out / f"{name}-{int(numbers['rounds'])}"
    run = [*prepare(out, name), "--out", folder.name]
    for _ in range(IN_A_ROW):
        resume = ["--resume"] if (folder / ".evfem-files").exists() else []
        if rng.random() < 0.25:  # at any moment, else once it computes
            hit = kill(out, run + resume, rng.uniform(0.0, length))
        else:
            hit = kill(out, run + resume, rng.uniform(0.0, 0.6 * computing), folder / "history.csv")
        numbers["kills"] += hit
        numbers["broken"] += len(broken(folder))
        numbers["before_the_first_step"] += hit and not (folder / "checkpoint.npz").exists()
        if not hit or numbers["kills"] >= count:
            break
    finish(out, run + (["--resume"] if (folder / ".evfem-files").exists() else []))
    _judge(out, name, folder, numbers)


def _judge(out: Path, name: str, folder: Path, numbers: dict[str, float]) -> None:
    apart, same = difference(folder, out / f"{name}-whole")
    steps = range(1, load(out / f"{name}.toml").total_steps + 1)
    lost = [step for step in steps if not (folder / f"fields_{step:05d}.vtu").exists()]
    left = [p for p in folder.iterdir() if p.name.endswith(".tmp")]
    numbers["rounds"] += 1
    numbers["fields_lost"] += len(lost) + len(left) + len(broken(folder))
    numbers["same_to_the_last_digit"] += same
    numbers["largest_difference"] = max(numbers["largest_difference"], apart)


def _cpu_seconds() -> float:
    """Of this process and its children."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)

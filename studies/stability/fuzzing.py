"""Hostile files: every format that evfem reads, damaged at random, must be read or refused with
one sentence.

`fuzz(count, seed)` makes `count` files per format and counts what became of them; `try_file` is
one of them. Scenes go through `evfem plan`; profiles, voltage files and meshes through `evfem run`
of one step on a small square; checkpoints through `evfem run --resume`; saved results through
`Result.load`. A failure is anything but exit status 0, 2 or 3, a message of more than one line, a
warning, anything left behind by a refused file, more than `LONGEST` CPU seconds, or a file that a
pickled object would have made. The other half, runs that are killed, is in `killing`.
"""

from __future__ import annotations

import contextlib
import io
import os
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from types import FrameType

import numpy as np

from evfem import cli
from evfem.common.storage import save_arrays
from evfem.electrostatics.signalfile import Playback, write_signal
from evfem.electrostatics.signals import VoltageProfile
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.scene import file as scenefile
from evfem.simulation.result import load
from evfem.simulation.run import simulate

from .killing import head, kills
from .mutations import mutated, mutated_arrays, mutated_text
from .scenes import block

__all__ = ["FORMATS", "Outcome", "fuzz", "kills", "try_file"]

#: CPU seconds that one file may take
LONGEST = 60.0
PAD = """version = 1
[finger]
resolution = "coarse"
width = 16.0
height = 12.0
ridges = true
ridge_height = 0.15
ridge_phase = 0.25
viscosity = 0.001
[finger.materials.dermis]
law = "ogden"
mu = [0.03, -0.01]
alpha = [2.0, -2.0]
nu = 0.45
"""
FLAT = '[surface]\nkind = "flat"\nfriction = [[0.0, 0.3], [1.0, 0.4]]\n'
SINUSOID = (
    '[surface]\nkind = "sinusoid"\nfriction = 0.2\nterms = [[0.02, 6.0, 0.0], [0.01, 12.0, 1.5]]\ny = -9.0\n'
)
PROFILE = '[surface]\nkind = "profile"\nfile = "scan.csv"\nfriction = 0.2\n'
VOLTAGE = """[electrostatics]
law = "kaczmarek"
{voltage}
insulator_thickness = 0.09
insulator_eps_r = 3.35
air_layer = true
direction = "vertical"
coupling = "monolithic"
"""
SOLVER = '[solver]\nelement = "q1"\ntolerance = 1e-8\nthreads = 1\n[output]\nevery = 2\n'
PRESS = '[[motion]]\nkind = "press"\nindentation = 0.1\nsteps = 1\n'
MOTIONS = PRESS + '[[motion]]\nkind = "slide"\ndistance = -0.5\nsteps = 3\nhold = "force"\nspeed = 20.0\n'
RAMP = '[[motion]]\nkind = "hover"\ngap = 0.2\n[[motion]]\nkind = "voltage"\nvoltage = 50.0\nsteps = 2\n'
SCAN = "x,height\n" + "".join(f"{0.1 * k - 2.0!r},{0.01 * (k % 3)!r}\n" for k in range(41))
SIGNAL = "position,voltage\n" + "".join(f"{0.2 * k!r},{20.0 * (k % 5)!r}\n" for k in range(12))


@dataclass(frozen=True)
class Outcome:
    """What became of a file: exit status, and what was wrong with that ("" for nothing)."""

    status: int
    fault: str


def square() -> Mesh:
    """[-1, 1] x [0, 2] in four quadrilaterals, the lower side `pad`, the upper side `bone`."""
    return block(2, 2, width=2.0, height=2.0)


def _scene(folder: Path, rng: Random) -> list[str]:
    finger = rng.choice([PAD, head("square.vtu")])
    surface, motion = rng.choice([FLAT, SINUSOID, PROFILE]), rng.choice([MOTIONS, RAMP])
    laws = ["voltage = 100.0", 'voltage_file = "signal.csv"', "voltage_profile = [[0.0, 1.0]]"]
    law = laws[0] if motion == RAMP else rng.choice(laws)
    text = finger + surface + VOLTAGE.format(voltage=law) + SOLVER + motion
    meshfile.write(square(), folder / "square.vtu")
    (folder / "scan.csv").write_text(SCAN)
    (folder / "signal.csv").write_text(SIGNAL)
    (folder / "scene.toml").write_bytes(mutated_text(text, rng))
    return ["plan", "scene.toml"]


def _run(folder: Path, surface: str, law: str = "", mesh: str = "vtu") -> list[str]:
    text = head(f"square.{mesh}") + surface + law + SOLVER + PRESS
    (folder / "scene.toml").write_text(text)
    return ["run", "scene.toml", "--no-plots", "--no-fields"]


def _profile(folder: Path, rng: Random) -> list[str]:
    meshfile.write(square(), folder / "square.vtu")
    (folder / "scan.csv").write_bytes(mutated_text(SCAN, rng))
    return _run(folder, PROFILE)


def _voltage(folder: Path, rng: Random) -> list[str]:
    meshfile.write(square(), folder / "square.vtu")
    (folder / "signal.csv").write_bytes(mutated_text(SIGNAL, rng))
    return _run(folder, FLAT, VOLTAGE.format(voltage='voltage_file = "signal.csv"'))


def _voltage_wav(folder: Path, rng: Random) -> list[str]:
    meshfile.write(square(), folder / "square.vtu")
    profile = VoltageProfile([0.0, 0.5, 1.0], [0.0, 100.0, 50.0])
    write_signal(folder / "signal.wav", profile, Playback(full_scale=100.0, speed=20.0, rate=400))
    (folder / "signal.wav").write_bytes(mutated((folder / "signal.wav").read_bytes(), rng))
    return _run(folder, FLAT, VOLTAGE.format(voltage='voltage_file = "signal.wav"'))


def _plain_vtu(mesh: Mesh) -> str:
    """The mesh as a .vtu file in which every number can be read."""

    def array(kind: str, name: str, values: np.ndarray, columns: int = 1) -> str:
        head = f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{columns}" format="ascii">'
        return head + " ".join(map(str, values.ravel().tolist())) + "</DataArray>\n"

    n, (cells, corners) = len(mesh.points), mesh.cells.shape
    points = np.column_stack([mesh.points, np.zeros(n)])
    on = {name: np.isin(np.arange(n), nodes).astype(int) for name, nodes in mesh.node_sets.items()}
    parts = {
        "Points": array("Float64", "Points", points, 3),
        "Cells": array("Int64", "connectivity", mesh.cells)
        + array("Int64", "offsets", corners * np.arange(1, cells + 1))
        + array("UInt8", "types", np.full(cells, 9)),
        "PointData": "".join(array("UInt8", name, values) for name, values in on.items()),
        "CellData": array("Int32", "region", mesh.region),
    }
    body = "".join(f"<{tag}>\n{text}</{tag}>\n" for tag, text in parts.items())
    names = "<FieldData>\n" + array("Int32", "region:tissue", np.zeros(1, int)) + "</FieldData>\n"
    piece = f'<Piece NumberOfPoints="{n}" NumberOfCells="{cells}">\n{body}</Piece>\n'
    grid = f"<UnstructuredGrid>\n{names}{piece}</UnstructuredGrid>\n"
    return f'<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">\n{grid}</VTKFile>\n'


def _mesh(kind: str) -> Callable[[Path, Random], list[str]]:
    def make(folder: Path, rng: Random) -> list[str]:
        path = folder / f"square.{kind}"
        meshfile.write(square(), path)
        if kind == "msh":
            path.write_bytes(mutated_text(path.read_text(), rng))
        elif rng.random() < 0.6:
            path.write_bytes(mutated_text(_plain_vtu(square()), rng))
        else:
            path.write_bytes(mutated(path.read_bytes(), rng))
        return _run(folder, FLAT, mesh=kind)

    return make


@cache
def _finished_run() -> Mapping[str, bytes]:
    """A scene and everything a run of it leaves. Made once: another run has other times in its
    files, whose lengths differ then."""
    with tempfile.TemporaryDirectory(prefix="evfem-fuzz-") as name:
        folder = Path(name)
        meshfile.write(square(), folder / "square.vtu")
        status, _, error = _called(folder, _run(folder, FLAT))
        assert status == 0, error
        simulate(scenefile.load(folder / "scene.toml")).save(folder / "run.npz")
        return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def _copy_run(folder: Path) -> None:
    for name, content in _finished_run().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)


def _checkpoint(folder: Path, rng: Random) -> list[str]:
    _copy_run(folder)
    _damage(folder / "scene-out" / "checkpoint.npz", rng)
    return [*_run(folder, FLAT), "--resume"]


def _result(folder: Path, rng: Random) -> list[str]:
    _copy_run(folder)
    _damage(folder / "run.npz", rng)
    return ["load", "run.npz"]


def _damage(path: Path, rng: Random) -> None:
    """Bytes of the archive, or arrays in an archive that is itself whole."""
    if rng.random() < 0.5:
        path.write_bytes(mutated(path.read_bytes(), rng))
        return
    with np.load(path, allow_pickle=False) as archive:
        arrays = mutated_arrays({name: archive[name] for name in archive.files}, rng)
    if rng.random() < 0.5:
        with contextlib.suppress(InputError):  # objects: as numpy would write them
            save_arrays(path, arrays)
            return
    writer = rng.choice([np.savez, np.savez_compressed])
    with open(path, "wb") as file:
        writer(
            file, **{name.replace("/", "_") if rng.random() < 0.05 else name: a for name, a in arrays.items()}
        )


FORMATS: Mapping[str, Callable[[Path, Random], list[str]]] = {
    "scene": _scene,
    "profile": _profile,
    "voltage": _voltage,
    "voltage_wav": _voltage_wav,
    "mesh_vtu": _mesh("vtu"),
    "mesh_msh": _mesh("msh"),
    "result": _result,
    "checkpoint": _checkpoint,
}


@cache
def _compiled() -> None:
    """Whole input first, without a limit: the loops over cells are compiled where no one has done
    so.
    """
    with tempfile.TemporaryDirectory(prefix="evfem-fuzz-") as name:
        folder = Path(name)
        meshfile.write(square(), folder / "square.vtu")
        _run(folder, FLAT)
        simulate(scenefile.load(folder / "scene.toml"))


def try_file(kind: str, rng: Random) -> Outcome:
    """Make one file of a format in a folder of its own, use it, and judge what happens."""
    _compiled()
    with tempfile.TemporaryDirectory(prefix="evfem-fuzz-") as name:
        folder = Path(name)
        words = FORMATS[kind](folder, rng)
        before = _listing(folder)
        status, _, error = _called(folder, words)
        return Outcome(status, _fault(status, error, before == _listing(folder)))


def _fault(status: int, error: str, untouched: bool) -> str:
    if status not in (0, 2, 3):
        return f"exit status {status}: {error[-2000:]}"
    if "Traceback" in error or "Warning" in error:
        return error[-2000:]
    if status == 2 and (error.count("\n") != 1 or len(error) > 2000):
        return f"not one sentence: {error[-2000:]}"
    if status == 2 and not untouched:
        return "a refused file changed the folder"
    return ""


def _listing(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


class _TooLong(BaseException):
    """The time of one file is over."""


def _called(folder: Path, words: list[str]) -> tuple[int, str, str]:
    """Exit status and output of the command, called in this process; -1 for an exception, -2 for
    too long.
    """
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error), _standing_in(folder), _limit():
        try:
            status = _load(words[1]) if words[0] == "load" else cli.main(words)
        except _TooLong:
            return -2, out.getvalue(), f"more than {LONGEST:g} CPU s"
        except (Exception, SystemExit) as wrong:  # what is hunted here
            return -1, out.getvalue(), f"{type(wrong).__name__}: {wrong}"
    if (folder / "owned").exists():
        return -3, out.getvalue(), "code in the file was executed"
    return status, out.getvalue(), error.getvalue()


def _load(name: str) -> int:
    try:
        load(name)
    except InputError as error:
        print(f"evfem: {error}", file=sys.stderr)
        return 2
    return 0


@contextlib.contextmanager
def _standing_in(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            yield
    finally:
        os.chdir(before)


@contextlib.contextmanager
def _limit() -> Iterator[None]:
    def stop(number: int, frame: FrameType | None) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)


def fuzz(count: int, seed: int) -> dict[str, dict[str, float]]:
    """For each format: how many of `count` files were accepted, refused with a sentence, stopped
    because a step did not converge, and failed; CPU seconds, the slowest file's, and the process's
    peak memory so far in MB.

    Failures are described on the terminal with the seed that makes them again.
    """
    return {kind: _fuzz_one(kind, count, seed) for kind in FORMATS}


def _fuzz_one(kind: str, count: int, seed: int) -> dict[str, float]:
    numbers = dict.fromkeys(("inputs", "accepted", "refused", "not_converged", "failed"), 0.0)
    begin, slowest = time.process_time(), 0.0
    for k in range(count):
        start = time.process_time()
        outcome = try_file(kind, Random(f"{kind} {seed} {k}"))
        slowest = max(slowest, time.process_time() - start)
        numbers["inputs"] += 1
        names = {0: "accepted", 2: "refused", 3: "not_converged"}
        numbers["failed" if outcome.fault else names[outcome.status]] += 1
        if outcome.fault:
            print(f"{kind} {seed} {k}: {outcome.fault}", file=sys.stderr)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return numbers | {"cpu_s": time.process_time() - begin, "slowest_s": slowest, "peak_MB": peak}

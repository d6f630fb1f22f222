"""The command `evfem`: arguments in, exit status out. What is heavy is imported by the command
that needs it.

Exit status: 0 done, 2 bad input, 3 a step did not converge, 4 disk or folder failed, 130
interrupted.
"""

from __future__ import annotations

import argparse
import importlib
import os
import re
import signal
import sys
import warnings
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

import evfem
from evfem.common import notices
from evfem.errors import InputError, NotConverged, StorageError, quoted

if TYPE_CHECKING:
    from evfem.protocols import Observer
    from evfem.runfolder import RunFolder
    from evfem.scene.scene import Scene
    from evfem.simulation.result import Row

DONE, BAD_INPUT, NOT_CONVERGED, DISK_FAILED, INTERRUPTED = 0, 2, 3, 4, 130
STATUS = "exit status: 0 done, 2 bad input, 3 a step did not converge, 4 disk failed, 130 interrupted"
#: what a shell completes an argument with, as shtab wants it: `shtab --shell bash evfem.cli.parser`
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}
FOLDERS = {"bash": "_shtab_compgen_dirs", "zsh": "_files -/", "tcsh": "d"}


class _Parser(argparse.ArgumentParser):
    """A parser that reports a mistake in one sentence."""

    def error(self, message: str) -> NoReturn:
        text = f"{self.prog}: {message}{_meant(message)} (see {self.prog} --help)"
        self.exit(BAD_INPUT, notices.wrapped(text, sys.stderr) + "\n")


def _meant(message: str) -> str:
    """A guess at a misspelt choice from argparse's "invalid choice: 'rnu' (choose from 'run',
    ...)".
    """
    found = re.search(r"invalid choice: '(.*)' \(choose from (.*)\)", message)
    close = get_close_matches(found[1], re.findall(r"\w+", found[2]), 1) if found else []
    return f"; did you mean {close[0]}?" if close else ""


def _complete(argument: argparse.Action, how: dict[str, str]) -> None:
    argument.complete = how  # type: ignore[attr-defined]


def parser() -> argparse.ArgumentParser:
    """All commands and options."""
    top = _Parser(
        prog="evfem",
        description="A finger pad on an electrovibration display, by finite elements.",
        epilog=f"`evfem run` alone computes a built-in scene; `evfem COMMAND --help` says more. {STATUS}",
    )
    top.add_argument("--version", action="version", version=f"evfem {evfem.__version__}")
    commands = top.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)
    top.set_defaults(function=_help)
    for name, does, options, function in (
        ("run", "run a scene and write history, fields, summary and picture", _run_options, _run),
        ("plan", "print terms, unknowns and solver of a scene; compute nothing", _scene_argument, _plan),
        ("study", "run studies and write their numbers, series and pictures", _study_options, _study),
        ("sweep", "run many scenes side by side and write one table of all", _sweep_options, _sweep),
        ("mesh", "write the finger's mesh as .vtu or .msh", _mesh_options, _mesh),
        ("signal", "write a voltage signal as .wav, .png, .hjif or .csv", _signal_options, _signal),
    ):
        command = commands.add_parser(name, help=does, description=f"{does[0].upper()}{does[1:]}.")
        options(command)
        command.set_defaults(function=function)
    return top


def _scene_argument(command: argparse.ArgumentParser) -> None:
    file = command.add_argument(
        "scene", nargs="?", type=Path, metavar="SCENE.toml", help="default: the built-in scene"
    )
    _complete(file, FILES)


def _run_options(run: argparse.ArgumentParser) -> None:
    _scene_argument(run)
    _results(run)
    _again(run, "go on with the interrupted run in the folder", "replace what an earlier run left there")
    run.add_argument("--no-fields", action="store_true", help="do not write fields.pvd and its .vtu files")
    run.add_argument("--no-plots", action="store_true", help="do not draw forces.png")


def _study_options(study: argparse.ArgumentParser) -> None:
    study.add_argument("names", nargs="+", metavar="NAME", help=_study_names())
    out = study.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder; default: here")
    _complete(out, FOLDERS)
    study.add_argument("--quick", action="store_true", help="coarser and shorter")
    drawn = study.add_argument_group("campaign alone", "scenes drawn at random")
    drawn.add_argument("--scenes", type=int, metavar="N", help="how many; default: 300, 6 with --quick")
    drawn.add_argument("--seed", type=int, metavar="S", help="which ones; default: 0")
    drawn.add_argument("--workers", type=int, metavar="N", help="processes; default: one for each core")


def _mesh_options(mesh: argparse.ArgumentParser) -> None:
    _scene_argument(mesh)
    target = mesh.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="file to write, .vtu or .msh"
    )
    _complete(target, FILES)


def _results(command: argparse.ArgumentParser) -> None:
    out = command.add_argument(
        "--out", type=Path, metavar="DIR", help="folder for the results; default: ./NAME-out"
    )
    _complete(out, FOLDERS)


def _again(command: argparse.ArgumentParser, resume: str, overwrite: str) -> None:
    """What to do with what an earlier run left in the folder: at most one of the two."""
    either = command.add_mutually_exclusive_group()
    either.add_argument("--resume", action="store_true", help=resume)
    either.add_argument("--overwrite", action="store_true", help=overwrite)


def _study_names() -> str:
    """Help on the names of studies; a checkout that is not installed has none."""
    try:
        return f"{', '.join(_studies().NAMES)}, or all (all but {' and '.join(_studies().APART)})"
    except InputError:
        return "name of a study, or all"


def _sweep_options(sweep: argparse.ArgumentParser) -> None:
    file = sweep.add_argument(
        "sweep", type=Path, metavar="SWEEP.toml", help="what is varied, and in which scene"
    )
    _complete(file, FILES)
    _results(sweep)
    _again(sweep, "keep the points of another sweep in the folder", "remove all points that are there")
    sweep.add_argument("--workers", type=int, metavar="N", help="processes; default: one for each core")
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster, tcp://HOST:PORT; local starts one"
    )


def _signal_options(voltage: argparse.ArgumentParser) -> None:
    file = voltage.add_argument("file", type=Path, metavar="VOLTAGE", help="signal to read, .csv or .wav")
    out = voltage.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="file to write; its ending says as what"
    )
    for path in (file, out):
        _complete(path, FILES)
    voltage.add_argument("--full-scale", type=float, metavar="V", help="largest voltage the file can hold")
    voltage.add_argument("--speed", type=float, metavar="MM/S", help="sliding speed, for .wav and .hjif")
    voltage.add_argument(
        "--friction",
        type=float,
        nargs=2,
        metavar=("MU0", "MU1"),
        help="coefficients at 0 V and at full scale, for .hjif",
    )
    voltage.add_argument("--rate", type=int, default=48_000, metavar="HZ", help="of the .wav; default: 48000")
    voltage.add_argument("--carrier", type=float, metavar="HZ", help="sine that the .wav modulates")
    voltage.add_argument("--pixel", type=float, default=0.1, metavar="MM", help="of the .png; default: 0.1")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    try:
        given = parser().parse_args(arguments)
    except SystemExit as done:
        return int(done.code or 0)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for number in before:
            signal.signal(number, signal.default_int_handler)
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            # what one package tells another's developers is not for who runs a command
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.showwarning = _warn
            with notices.shown():
                return _status(given)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _status(given: argparse.Namespace) -> int:
    """Run the command; its exit status, with the message of what went wrong."""
    try:
        return given.function(given)
    except InputError as error:
        return _refuse(error)
    except NotConverged as error:
        return _say(error, NOT_CONVERGED)
    except BrokenPipeError:  # the reader of our output has gone
        _silence()
        return DONE
    except OSError as error:
        if not isinstance(error, StorageError):  # our output cannot be written
            _silence()
        return _say(error, DISK_FAILED)
    except MemoryError:
        return _say("not enough memory for this input; try a coarser one", BAD_INPUT)
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)


def _warn(
    message: Warning | str,
    category: object,
    filename: str,
    lineno: int,
    file: object = None,
    line: object = None,
) -> None:
    """One line for a person, without the place in the code."""
    notices.tell(f"warning: {message}")


def _silence() -> None:
    """Throw away what is left to print, so that the interpreter does not try once more when it
    ends.
    """
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(error: InputError) -> int:
    """One line for a person, or one for each mistake in a terminal; elsewhere it stays one line."""
    if len(error.mistakes) == 1 or not sys.stderr.isatty():
        return _say(error, BAD_INPUT)
    _say(f"{len(error.mistakes)} mistakes", BAD_INPUT)
    for mistake in error.mistakes:
        _say(mistake, BAD_INPUT)
    return BAD_INPUT


def _say(message: object, status: int) -> int:
    notices.tell(str(message))
    return status


def _scene(path: Path | None) -> Scene:
    if path is None:
        from evfem.scene.scene import default_scene

        return default_scene()
    from evfem.scene.file import load

    return load(path)


def _help(given: argparse.Namespace) -> int:
    parser().print_help()
    return DONE


def _run(given: argparse.Namespace) -> int:
    scene = _scene(given.scene)
    from evfem.common.storage import alone_in
    from evfem.runfolder import RunFolder, finished, kept, saved

    path = given.out or Path(f"{scene.name}-out")
    with alone_in(path):
        resume = None
        if not given.overwrite:
            resume = (saved if given.resume else kept)(path, scene)
        folder = RunFolder(path, scene, not given.no_fields, not given.no_plots, resume)
        if resume is not None and finished(path, scene, resume):
            notices.tell(f"the run in {path} is complete, nothing is left to compute")
            return _report(folder.path, resume.rows, scene)
        return _simulate(folder)


def _simulate(folder: RunFolder) -> int:
    """Run the scene of a folder, which keeps whatever has converged."""
    from evfem.simulation.run import simulate

    scene, path, progress = folder.scene, folder.path, sys.stderr.isatty()
    observers: list[Observer] = [folder] if progress else [folder, _Milestones()]
    try:
        result = simulate(scene, progress=progress, observers=observers, resume=folder.resume)
    except NotConverged as error:
        _finish(folder, error.result)
        raise
    except KeyboardInterrupt:
        if not folder.begun:
            raise
        _finish(folder, None)
        return _say(f"interrupted; {len(folder.rows)} steps are in {path}, go on with --resume", INTERRUPTED)
    return _finish(folder, result)


def _finish(folder: RunFolder, result: object) -> int:
    """Write what is left to write and print the table; a second Ctrl-C does not tear the files."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folder.close(result)  # type: ignore[arg-type]
    return _report(folder.path, folder.rows, folder.scene)


def _report(path: Path, rows: Sequence[Row], scene: Scene) -> int:
    """Print the table of a run, how far it came, and where its results are."""
    from evfem.runfolder import table

    if rows:
        print(table(rows, depth=scene.depth))
    seconds = sum(float(row["seconds"]) for row in rows)
    print(f"{len(rows)} of {scene.total_steps} steps in {seconds:.1f} s; results in {path}", flush=True)
    return DONE


class _Milestones:
    """Progress where a bar has no place: a line for every tenth of the steps."""

    def started(self, mesh: object, scene: object, total_steps: int) -> None:
        self.total = total_steps

    def step(self, row: dict[str, object], frame: object, checkpoint: object) -> None:
        notices.milestone("step", int(str(row["step"])), self.total)


def _plan(given: argparse.Namespace) -> int:
    from evfem.scene.plan import plan

    scene = _scene(given.scene)
    with notices.status("building the mesh"):
        needed = str(plan(scene))
    print(needed, flush=True)
    return DONE


def _study(given: argparse.Namespace) -> int:
    studies = _studies()
    names: list[str] = []
    for name in given.names:
        names += [n for n in studies.NAMES if n not in studies.APART] if name == "all" else [name]
    for name in names:
        if name not in studies.NAMES:
            raise InputError("study", quoted(name), f"{', '.join(studies.NAMES)}, all")
    sample = _sample(given)
    for name in dict.fromkeys(names):
        print(f"study {name}", file=sys.stderr, flush=True)
        with notices.status(name):
            studies.run(name, given.quick, given.out, sample)
        print(given.out / f"{name}.json", flush=True)
    return DONE


def _sample(given: argparse.Namespace) -> Any:
    """Which scenes are drawn; None where nothing is said."""
    said = {name: getattr(given, name) for name in ("scenes", "seed", "workers")}
    said = {name: value for name, value in said.items() if value is not None}
    return _studies().Sample(**said) if said else None


def _studies() -> ModuleType:
    try:
        return importlib.import_module("evfem.studies")
    except ModuleNotFoundError as error:
        if error.name != "evfem.studies":
            raise
        raise InputError("study", "a checkout", "an installed evfem: pip install .") from error


def _sweep(given: argparse.Namespace) -> int:
    from evfem.sweeps.file import load
    from evfem.sweeps.folder import TABLE
    from evfem.sweeps.run import sweep, told

    plan = load(given.sweep)
    path = given.out or Path(f"{plan.name}-out")
    try:
        result = sweep(
            plan,
            path,
            resume=given.resume,
            overwrite=given.overwrite,
            workers=given.workers,
            scheduler=given.scheduler,
            progress=True,
        )
    except KeyboardInterrupt:
        return _say(
            f"interrupted; finished points are in {path}, the same command goes on there", INTERRUPTED
        )
    wrong = [row for row in result.rows if row["status"] != "done"]
    for row in wrong[:3]:
        notices.tell(f"point {row['point']}: {row['message']}")
    points = result.provenance["points"]
    print(f"{points['requested']} points: {told(points)}; table in {path / TABLE}", flush=True)
    return NOT_CONVERGED if wrong else DONE


def _mesh(given: argparse.Namespace) -> int:
    scene = _scene(given.scene)
    from evfem.mesh.file import write
    from evfem.scene.plan import scene_mesh

    with notices.status("building the mesh"):
        mesh, _ = scene_mesh(scene)
        write(mesh, given.out)
    regions = ", ".join(mesh.region_names)
    print(
        f"{len(mesh.points)} nodes, {len(mesh.cells)} cells ({mesh.kind}); {regions}; in {given.out}",
        flush=True,
    )
    return DONE


def _signal(given: argparse.Namespace) -> int:
    from evfem.electrostatics.signalfile import Playback, read_signal, write_signal

    playback = None
    if given.full_scale is not None:
        playback = Playback(
            given.full_scale, given.speed, given.friction, given.rate, given.carrier, given.pixel
        )
    profile = read_signal(given.file)
    write_signal(given.out, profile, playback)
    start, stop = profile.position[0], profile.position[-1]
    largest = max(abs(profile.voltage))
    print(f"{start:g} to {stop:g} mm, at most {largest:g} V; in {given.out}", flush=True)
    return DONE


if __name__ == "__main__":
    sys.exit(main())

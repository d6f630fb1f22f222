"""The command `evfem`: runs one command line and returns its exit status; heavy imports are lazy.

Exit status: 0 done, 1 checked ends differ or a voltage at its limit, 2 bad input, 3 a step did not
converge, 4 disk or folder failed, 130 interrupted.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import signal
import sys
import tomllib
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evfem.arguments import BAD_INPUT as BAD_INPUT
from evfem.arguments import FILES as FILES  # which a shell's completion asks for here
from evfem.arguments import FOLDERS as FOLDERS
from evfem.arguments import parser, studies
from evfem.common import notices
from evfem.errors import InputError, NotConverged, StorageError, describe_value

if TYPE_CHECKING:
    from evfem.protocols import Observer
    from evfem.runfolder import RunFolder
    from evfem.scene.scene import Scene
    from evfem.simulation.result import Row

DONE, DIFFERENT, NOT_CONVERGED, DISK_FAILED, INTERRUPTED = 0, 1, 3, 4, 130
#: errno of a failed write to standard output; a failed write to a file is a `StorageError`
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    try:
        options = parser(sys.argv if arguments is None else arguments).parse_args(arguments)
    except SystemExit as done:
        return int(done.code or 0)
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for number in before:
            signal.signal(number, signal.default_int_handler)
        with warnings.catch_warnings():
            warnings.simplefilter("always", UserWarning)
            # what one package tells another's developers is not for who runs a command
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.showwarning = _warner(_file(options))
            with notices.shown():
                return _status(options)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _status(options: argparse.Namespace) -> int:
    """Run the command; its exit status, with the message of what went wrong."""
    try:
        return _command(options.command)(options) or DONE
    except InputError as error:
        return _refuse(error, _file(options))
    except NotConverged as error:
        return _say(_of(_file(options), error), NOT_CONVERGED)
    except BrokenPipeError:  # the reader of our output has gone
        _silence()
        return DONE
    except OSError as error:
        if isinstance(error, StorageError) or error.filename is not None or error.errno not in FULL:
            return _say(error, DISK_FAILED)
        _silence()
        return _say(f"cannot write the output: {error.strerror or error}", DISK_FAILED)
    except MemoryError:
        return _say("not enough memory for this input; try a coarser one", BAD_INPUT)
    except KeyboardInterrupt:
        return _say("interrupted", INTERRUPTED)


def _file(options: argparse.Namespace) -> Path | None:
    """The scene or sweep file of a command."""
    return getattr(options, "scene", None) or getattr(options, "sweep", None)


def _of(file: Path | None, message: object) -> str:
    """A message with the file that it comes from, once; an option's comes from no file."""
    text = str(message)
    return text if file is None or str(file) in text or text.startswith("--") else f"{file}: {text}"


def _warner(file: Path | None) -> Callable[..., None]:
    return lambda message, *place, **more: notices.tell(f"warning: {_of(file, message)}")


def _silence() -> None:
    """Throw away what is left to print, so that the interpreter does not try once more when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _refuse(error: InputError, file: Path | None) -> int:
    """One line for a person, or one for each mistake in a terminal; elsewhere it stays one line."""
    if len(error.mistakes) == 1 or not sys.stderr.isatty():
        return _say(_of(file, error), BAD_INPUT)
    _say(_of(file, f"{len(error.mistakes)} mistakes"), BAD_INPUT)
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

    try:
        return load(path)
    except InputError:
        if _kind(path) == "sweep":
            is_one = f"{path}, a sweep"
            raise InputError("scene", is_one, f"a scene; evfem sweep {path} runs this one") from None
        raise


def _kind(path: Path) -> str:
    """What a file is by the keys at its top: "scene", "sweep", or nothing where they say neither."""
    from evfem.scene.file import read_text

    with suppress(InputError, StorageError, ValueError, RecursionError):
        keys = set(tomllib.loads(read_text("scene", path)))
        scene = not keys.isdisjoint(("surface", "motion"))
        if scene is keys.isdisjoint(("scene", "grid", "samples")):
            return "scene" if scene else "sweep"
    return ""


def _command(name: str | None) -> Callable[[argparse.Namespace], int | None]:
    """Runs a command of `evfem.arguments.parser`; None is done."""
    return {
        None: lambda options: parser().print_help(),
        "run": _run,
        "init": _init,
        "plan": _plan,
        "check": _check,
        "report": _page,
        "sensitivities": _sensitivities,
        "impedance": _impedance,
        "electrical-impedance": _impedance,
        "study": _study,
        "sweep": _sweep,
        "mesh": _mesh,
        "signal": _signal,
        "texture": _texture,
        "studio": _studio,
        "schema": _schema,
    }[name]


def _init(options: argparse.Namespace) -> None:
    from evfem.templates import write

    path = options.file or Path(f"{options.template}.toml")
    written = write(options.template, path)
    print(f"{', '.join(map(str, written))} written; evfem run {path} runs it", flush=True)


def _schema(options: argparse.Namespace) -> None:
    from evfem.scene import schema as scenes
    from evfem.sweeps import file as sweeps

    found = scenes.schema() if options.of == "scene" else sweeps.schema()
    text = json.dumps(found, indent=2)
    if options.out is None:
        print(text, flush=True)
        return
    from evfem.common.storage import write_text

    write_text(options.out, text + "\n")
    print(options.out, flush=True)


def _run(options: argparse.Namespace) -> int:
    scene = _scene(options.scene)
    from evfem.common.storage import alone_in
    from evfem.reporting.log import logged
    from evfem.runfolder import RunFolder, finished, kept, saved

    path = options.out or Path(f"{scene.name}-out")
    with alone_in(path), logged(path, options.verbose) as telling:
        resume = None
        if not options.overwrite:
            resume = (saved if options.resume else kept)(path, scene)
        folder = RunFolder(path, scene, not options.no_fields, not options.no_plots, resume)
        if resume is not None and finished(path, scene, resume):
            notices.tell(folder.completed())
            return _report(folder.path, resume.rows, scene)
        return _simulate(folder, telling)


def _simulate(folder: RunFolder, telling: Sequence[Observer]) -> int:
    """Run the scene of a folder, which keeps whatever has converged."""
    from evfem.reporting.log import Milestones
    from evfem.simulation.run import simulate

    scene, path, progress = folder.scene, folder.path, sys.stderr.isatty()
    observers: list[Observer] = [folder, *telling, _Interruption()]
    if not progress:
        observers.append(Milestones())
    try:
        result = simulate(scene, progress=progress, observers=observers, resume=folder.resume)
    except NotConverged as error:
        _finish(folder, error.result)
        raise
    except KeyboardInterrupt:
        if not folder.begun:
            raise
        _finish(folder, None)
        return _say(
            f"interrupted; {len(folder.rows)} steps are in {path}, continue with --resume", INTERRUPTED
        )
    return _finish(folder, result)


def _finish(folder: RunFolder, result: object) -> int:
    """Write what is left to write and print the table; a second Ctrl-C does not tear the files."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    folder.close(result)  # type: ignore[arg-type]
    return _report(folder.path, folder.rows, folder.scene)


def _report(path: Path, rows: Sequence[Row], scene: Scene) -> int:
    """Print the table of a run, what its result warns of, how far it came, and where its results are."""
    from evfem.reporting.page import per_depth
    from evfem.runfolder import HISTORY, SUMMARY
    from evfem.simulation.history import DRIFT, MOST, chosen, load_drift, table

    if rows:
        print(table(rows, depth=scene.depth))
    if (shown := len(chosen(rows, MOST))) < len(rows):
        print(f"{len(rows) - shown} of {len(rows)} steps are left out here; all are in {path / HISTORY}")
    if (drift := load_drift(rows)) > DRIFT:
        print(f'the load drifted by {drift:.1%} at a held indentation; hold = "force" keeps it')
    found = json.loads((path / SUMMARY).read_text(encoding="utf-8")).get("warnings", [])
    for warning in (*found, *per_depth(found, scene.depth)):
        print(f"warning: {warning}")
    cost = f"{len(rows)} of {scene.total_steps} steps in {sum(float(row['seconds']) for row in rows):.1f} s"
    print(f"{cost}; results of every step in {path}", flush=True)
    return DONE


class _Interruption:
    """Ctrl-C ends the run at once, or with the step where Python drops what is raised (in a `__del__`)."""

    def __init__(self) -> None:
        self.met = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._meet)

    def _meet(self, number: int, frame: object) -> None:
        self.met = True
        raise KeyboardInterrupt

    def started(self, mesh: object, scene: object, total_steps: int) -> None:
        """Nothing to do."""

    def step(self, row: object, frame: object, checkpoint: object) -> None:
        if self.met:
            raise KeyboardInterrupt


def _plan(options: argparse.Namespace) -> None:
    from evfem.export import FieldFiles
    from evfem.planning.plan import plan_on, scene_mesh

    scene = _scene(options.scene)
    with notices.status("building the mesh"):
        mesh, element = scene_mesh(scene)
        needed = plan_on(scene, mesh, element)
    files = FieldFiles.of(scene, mesh)
    print(f"{needed}\n\nFiles of a run\n  {files}", flush=True)


def _check(options: argparse.Namespace) -> int:
    from evfem.sweeps.check import check

    found = check(_scene(options.scene), options.outputs, mesh=not options.no_mesh)
    print(found, flush=True)
    return DONE if found.agrees else DIFFERENT


def _page(options: argparse.Namespace) -> None:
    from evfem.loading import load
    from evfem.reporting.page import told
    from evfem.runfolder import write_report

    text = told(load(options.path), options.check)
    print(write_report(text, options.path, options.out), flush=True)


def _sensitivities(options: argparse.Namespace) -> None:
    from evfem.common.storage import alone_in
    from evfem.response.file import load
    from evfem.response.sensitivities import sensitivities
    from evfem.runfolder import write_sensitivities

    scene, by, columns = (_scene(options.scene), options.by, None) if options.by else load(options.scene)
    folder = options.out or Path(f"{options.scene.stem}-out")
    with alone_in(folder):
        found = sensitivities(scene, by, columns, progress=True)
        for key in (key for key in columns or () if key in found.reasons):
            notices.tell(f"{key}: {found.reasons[key]}")
        print(f"{found}\ntable in {write_sensitivities(found, folder)}", flush=True)


def _impedance(options: argparse.Namespace) -> None:
    """The mechanical one, or what an amplifier sees."""
    from evfem.common.storage import alone_in
    from evfem.response import electrical, impedance
    from evfem.runfolder import write_impedance

    scene, folder = _scene(options.scene), options.out or Path(f"{options.scene.stem}-out")
    with alone_in(folder):
        found: Any
        if options.command == "impedance":
            found = impedance.impedance(scene, options.frequencies, options.axis)
        else:
            found = electrical.electrical_impedance(scene, options.frequencies)
        print(f"{found}\ntable in {write_impedance(found, folder, options.command)}", flush=True)


def _study(options: argparse.Namespace) -> None:
    known = studies()
    names: list[str] = []
    for name in options.names:
        names += [n for n in known.NAMES if n not in known.APART] if name == "all" else [name]
    for name in names:
        if name not in known.NAMES:
            raise InputError("study", describe_value(name), f"{', '.join(known.NAMES)}, all")
    sample = _sample(options)
    for name in dict.fromkeys(names):
        print(f"study {name}: {known.expected(name, options.quick)}", file=sys.stderr, flush=True)
        with notices.status(name):
            result = known.run(name, options.quick, options.out, sample)
        print(known.beside_the_paper(result), end="")
        print(options.out / f"{name}.json", flush=True)
    if "all" in options.names:
        print(*known.report(options.out), sep="\n")


def _sample(options: argparse.Namespace) -> Any:
    said = {name: getattr(options, name) for name in ("scenes", "seed", "workers", "limit")}
    said = {name: value for name, value in said.items() if value is not None}
    return studies().Sample(**said) if said else None


def _sweep(options: argparse.Namespace) -> int:
    from evfem.sweeps.file import load
    from evfem.sweeps.folder import TABLE
    from evfem.sweeps.run import sweep
    from evfem.sweeps.table import told

    try:
        plan = load(options.sweep)
    except InputError:
        if _kind(options.sweep) == "scene":
            is_one = f"{options.sweep}, a scene"
            raise InputError("sweep", is_one, f"a sweep; evfem run {options.sweep} runs this one") from None
        raise
    path = options.out or Path(f"{plan.name}-out")
    try:
        result = sweep(
            plan,
            path,
            resume=options.resume,
            overwrite=options.overwrite,
            workers=options.workers,
            scheduler=options.scheduler,
            progress=True,
        )
    except KeyboardInterrupt:
        return _say(
            f"interrupted; finished points are in {path}, the same command goes on there", INTERRUPTED
        )
    for remark in result.remarks():
        notices.tell(remark)
    points = result.provenance["points"]
    print(f"{points['requested']} points: {told(points)}; table in {path / TABLE}", flush=True)
    for name, over in result.provenance.get("means", {}).items():
        print(f"{name}: the mean over {' or '.join(over)}", flush=True)
    return NOT_CONVERGED if any(row["status"] != "done" for row in result.rows) else DONE


def _mesh(options: argparse.Namespace) -> None:
    scene = _scene(options.scene)
    from evfem.mesh.file import write
    from evfem.planning.plan import scene_mesh

    with notices.status("building the mesh"):
        mesh, _ = scene_mesh(scene)
        write(mesh, options.out)
    regions = ", ".join(mesh.region_names)
    print(
        f"{len(mesh.points)} nodes, {len(mesh.cells)} cells ({mesh.kind}); {regions}; in {options.out}",
        flush=True,
    )


def _signal(options: argparse.Namespace) -> None:
    from evfem.circuit.signalfile import Playback, read_signal, write_signal
    from evfem.common.views import plus
    from evfem.textures.texture import spared

    spared("--out", options.out)
    playback = None
    if options.full_scale is not None:
        names = ("full_scale", "speed", "friction", "rate", "carrier", "pixel", "bits", "second")
        playback = Playback(*(getattr(options, name) for name in names))
    profile = read_signal(options.file)
    write_signal(options.out, profile, playback)
    start, stop, largest = profile.position[0], profile.position[-1], max(abs(profile.voltage))
    print(f"{plus(start):g} to {plus(stop):g} mm, at most {largest:g} V; in {options.out}", flush=True)


def _texture(options: argparse.Namespace) -> int | None:
    from evfem.estimate.commands import run

    return run(options)


def _studio(options: argparse.Namespace) -> None:
    from evfem.studio.server import serve

    serve(options.port, not options.no_browser)


if __name__ == "__main__":
    sys.exit(main())

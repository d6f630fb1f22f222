"""The folder of a run: history, fields, summary, picture and checkpoint, complete after every step.

Every file is replaced in one step, so that a run killed at any moment leaves whole files and a checkpoint to
go on from; what it was writing stays behind under a temporary name and is removed by the next run. Histories
grow by a line at a time, which costs as much at the end of a long run as at its begin; a run that goes on
first writes them whole, as its checkpoint has them. Only files that evfem wrote are ever replaced or removed:
the folder's `.evfem-files` lists their names (`evfem.sweeps.manifest`). `kept` and `saved` say what of an
earlier run is there to go on from.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.notices import LOG
from evfem.common.storage import (
    GrowingText,
    alone_in,
    check_ending,
    disk,
    refuse_others,
    replacing,
    write_text,
)
from evfem.errors import InputError
from evfem.export import FieldFiles, ParaViewSeries, frame_in
from evfem.mesh.mesh import Mesh
from evfem.scene.scene import Scene
from evfem.simulation.checkpoint import ANOTHER, Checkpoint, rows_of
from evfem.simulation.checkpoint import PROBES as AT_PROBES
from evfem.simulation.doubtful import doubtful
from evfem.simulation.history import columns_of, csv_header, csv_line, read_rows
from evfem.simulation.provenance import sound
from evfem.simulation.result import Frame, Result, Row, Saved, provenance
from evfem.sweeps.manifest import Manifest

if TYPE_CHECKING:
    from evfem.response.electrical import ElectricalImpedance
    from evfem.response.impedance import Impedance
    from evfem.response.sensitivities import Sensitivities

#: what a picture of derivatives shows if it can, the first first
FORCES = ("tangential_force", "normal_force", "electrostatic_force")
#: bytes of fields that are said before they are written
WORTH_TELLING = 100_000_000
MANIFEST = ".evfem-files"
HISTORY, PROBES, SUMMARY, REPORT = "history.csv", "probes.csv", "summary.json", "report.html"
FIELDS, PICTURE, STATE = "fields.pvd", "forces.png", "checkpoint.npz"
#: of a finger in three dimensions: its skin alone, beside the fields of the solid
SKIN = "skin.pvd"
OURS = re.compile(
    r"history\.csv|probes\.csv|summary\.json|report\.html|(fields|skin)\.pvd|(fields|skin)_\d+\.vtu"
    r"|forces\.png|checkpoint\.npz|\.checkpoint\.rows"
)
#: what a killed run was writing
LEFT = re.compile(rf"\.({OURS.pattern}|\.evfem-files)\.\d+\.tmp")


@dataclass
class RunFolder:
    """An observer of `evfem.simulation.run` that keeps a folder up to date; it writes from the first step on.

    `fields` and `plots` False leave the .vtu series and the picture out. `resume` is what `saved` returned.
    """

    path: Path
    scene: Scene
    fields: bool = True
    plots: bool = True
    resume: Saved | None = None
    rows: list[Row] = field(default_factory=list, init=False)
    mesh: Mesh | None = field(default=None, init=False)
    opened: bool = field(default=False, init=False)
    files: FieldFiles | None = field(default=None, init=False)
    _series: tuple[ParaViewSeries, ...] = field(default=(), init=False)
    _digest: str = field(default="", init=False)
    _pending: tuple[Row, Frame | None, Callable[[], dict[str, Any]]] | None = field(default=None, init=False)

    def started(self, mesh: Mesh, scene: Scene, total_steps: int) -> None:
        """The mesh is known: refuse a folder in which files of others are in the way."""
        self.mesh = mesh
        self.rows = list(self.resume.rows) if self.resume else []
        self._digest = self.scene.digest()
        _refuse_others(self.path)

        if self.fields:
            self.files = FieldFiles.of(scene, mesh)
            thinned = self.files.every > 1 and scene.output.every is None
            if thinned or self.files.size > WORTH_TELLING:
                LOG.info("%s%s", self.files, "; every = 1 in [output] keeps all" if thinned else "")

    def step(self, row: Row, frame: Frame | None, checkpoint: Callable[[], dict[str, Any]]) -> None:
        """A step has converged: fields, checkpoint and history go to disk.

        Interrupted in the middle, it is done again by `close`.
        """
        self._pending = (row, frame, checkpoint)
        self._commit()

    @cached_property
    def _checkpoint(self) -> Checkpoint:
        return Checkpoint(self.path / STATE)

    @cached_property
    def _manifest(self) -> Manifest:
        return Manifest(self.path / MANIFEST, OURS)

    @cached_property
    def _history(self) -> GrowingText:
        return GrowingText(self.path / HISTORY)

    @cached_property
    def _probes(self) -> GrowingText:
        return GrowingText(self.path / PROBES)

    @property
    def begun(self) -> bool:
        """Whether a step has converged, so that there is something to keep."""
        return self.opened or self._pending is not None

    def _commit(self) -> None:
        if self._pending is None:
            return
        row, frame, checkpoint = self._pending
        if not self.opened:
            self._open()
        shown = frame is not None and self._wants(row)
        if frame is not None and shown:
            self._add(row, frame)
        state = checkpoint()
        if not self.rows or self.rows[-1]["step"] != row["step"]:
            self._write_checkpoint(state, [*self.rows, row])
            self.rows.append(row)
        self._write_probes(state.get(AT_PROBES))
        self._write_history()
        if shown:
            self._write_index(self._series)
        self._pending = None

    def _write_checkpoint(self, state: dict[str, Any], rows: Sequence[Row]) -> None:
        with self._manifest.writing(rows_of(self.path / STATE)):
            self._checkpoint.add_rows(state, rows)
        with self._manifest.writing(self.path / STATE):
            self._checkpoint.write(self._digest, state, rows)

    def _add(self, row: Row, frame: Frame) -> None:
        assert self.mesh is not None
        for series in self._series:
            with self._manifest.writing(series.frame_path(row["step"])):
                series.add(row, frame, self.mesh)

    def _write_index(self, several: Sequence[ParaViewSeries]) -> None:
        for series in several:
            with self._manifest.writing(series.path):
                series.write_index()

    def _wants(self, row: Row) -> bool:
        return self.files is not None and self.files.wants(row["step"])

    def _write_history(self) -> None:
        rows = self.rows
        header = csv_header(columns_of(rows[0])) if rows else csv_header()
        with self._manifest.writing(self.path / HISTORY):
            self._history.write(header, len(rows), lambda k: csv_line(rows[k]))

    def _write_probes(self, values: Floats | None) -> None:
        """What was found at the probes' points (S, P, K) after every step, where the scene has some."""
        if values is None or self.mesh is None:
            return
        from evfem.scene import probes

        wanted, rows = self.scene.output.probes, self.rows
        with self._manifest.writing(self.path / PROBES):
            lines = lambda k: probes.csv_lines(wanted, rows[k], values[k])  # noqa: E731
            self._probes.write(probes.csv_header(self.mesh.dim), len(rows), lines)

    def close(self, result: Result | None) -> dict[str, Any]:
        """Write history, summary and picture of what has converged; returns the summary.

        `result` None means interrupted: it is made of the rows so far.
        """
        self._commit()
        if not self.opened:
            self._open()
        self._write_history()
        if result is not None:
            self._write_last(result)
        result = result or self._of_rows()
        summary = self._write_summary(result)
        if self.plots and self.rows:
            self._draw(result)
        return summary

    def _of_rows(self) -> Result:
        """The result that the rows so far make: without fields, and without what the solver did."""
        assert self.mesh is not None
        about = provenance(self.scene, self.mesh, {}) | {"warnings": doubtful(self.scene, self.rows)}
        return Result.from_rows(self.rows, [], self.mesh, about, simulated=self.scene)

    def _write_summary(self, result: Result) -> dict[str, Any]:
        summary = result.summary()
        with self._manifest.writing(self.path / SUMMARY):
            write_text(self.path / SUMMARY, json.dumps(summary, indent=2, allow_nan=False) + "\n")
        return summary

    def _draw(self, result: Result) -> None:
        from evfem.plotting.curves import forces

        with self._manifest.writing(self.path / PICTURE):
            _save(forces(result if result.depth is None else result.total).figure, self.path / PICTURE)

    def completed(self) -> str:
        """Write what is missing in a finished run's folder, as far as its checkpoint has it; says what."""
        without = _without_fields(self.path) if self.fields else ""
        told = [f"the run in {self.path} is complete"]
        if written := self._complete():
            verb = "is" if len(written) == 1 else "are"
            told.append(f"{' and '.join(written)} {verb} written from its checkpoint")
        if without:
            told.append(f"but it was {without}; --overwrite computes them")
        return ", ".join(told if len(told) > 1 else [*told, "nothing is left to compute"])

    def _complete(self) -> list[str]:
        """Names of the files that were missing, and are written now."""
        from evfem.planning.plan import scene_mesh

        assert self.resume is not None
        names = [HISTORY, *([PROBES] if self.scene.output.probes else []), SUMMARY]
        names += [PICTURE] if self.plots else []
        missing = [name for name in names if not (self.path / name).exists()]
        if not missing:
            return []
        _refuse_others(self.path)
        with disk(f"use {self.path}"):
            _remove_left(self.path)
        self.rows, (self.mesh, _) = list(self.resume.rows), scene_mesh(self.scene)
        if PROBES in missing or SUMMARY in missing:
            self._write_probes(self.resume.arrays.get(AT_PROBES))
        if HISTORY in missing or SUMMARY in missing:  # a kill before the end leaves them a row behind
            self._write_history()
            series = [ParaViewSeries(self.path / name, self.rows) for name in (FIELDS, SKIN)]
            self._write_index([one for one in series if one.path.exists()])
        if SUMMARY in missing:
            self._write_summary(self._of_rows())
        if PICTURE in missing:
            self._draw(self._of_rows())
        return missing

    def _write_last(self, result: Result) -> None:
        """The fields of the last good step, where a run ended between two that are written."""
        last = result.frames[-1] if result.frames else None
        if last is not None and last.step == self.rows[-1]["step"] and not self._wants(self.rows[-1]):
            self._add(self.rows[-1], last)
            self._write_index(self._series)

    def _open(self) -> None:
        """Make the folder, remove an earlier run's files (or go on from them), start the history."""
        with disk(f"use {self.path}"):
            self.path.mkdir(parents=True, exist_ok=True)
            self._manifest = Manifest(self.path / MANIFEST, OURS)  # anew, where a first try was interrupted
            if not self.resume:
                self._manifest.remove()
            self._manifest.begin()
            _remove_left(self.path)
        self._series = self._paraview()
        self._write_history()
        if self.resume:  # a kill leaves the index a step behind
            self._write_index(self._series)
        self.opened = True

    def _paraview(self) -> tuple[ParaViewSeries, ...]:
        """The series of the fields, and in three dimensions that of the skin."""
        if self.files is None or self.mesh is None:
            return ()
        single, compressed = self.files.single, self.files.compressed
        return tuple(
            ParaViewSeries(
                self.path / name, self.rows, single=single, compressed=compressed, skin=name == SKIN
            )
            for name in ((FIELDS, SKIN) if self.mesh.dim == 3 else (FIELDS,))
        )


def saved(path: Path, scene: Scene) -> Saved | None:
    """The checkpoint of an interrupted run of `scene` in the folder `path`; None if a run began
    there, but was killed before its first step was stored.

    Raises InputError where no run began, and for a damaged checkpoint or one of another scene or version.
    """
    if (path / STATE).is_file():
        try:
            return Checkpoint(path / STATE).read(scene.digest())
        except InputError as error:
            allowed = f"{error.allowed}; --overwrite begins the run anew"
            raise InputError("--resume", _told(path, error), allowed) from error
    if (path / MANIFEST).is_file() and _without_a_row(path / HISTORY):
        return None
    raise InputError("--resume", f"{path} without {STATE}", "a folder with a run that was interrupted")


def kept(path: Path, scene: Scene) -> Saved | None:
    """The finished run of `scene` in the folder `path`; None where nothing is there that could be lost.

    Raises InputError where results of another scene are, or of a run of this one that is not finished.
    """
    _refuse_others(path)
    if not (path / STATE).is_file() and _without_a_row(path / HISTORY):
        return None
    try:
        found = Checkpoint(path / STATE).read(scene.digest())
    except InputError as error:
        raise InputError(
            "--out", _told(path, error), "another folder, or --overwrite to replace it"
        ) from error
    if not finished(path, scene, found):
        done = f"{path}, where {len(found.rows)} of {scene.total_steps} steps of this scene are done"
        raise InputError("--out", done, "--resume to go on there, or --overwrite to begin anew")
    return found


def _told(path: Path, error: InputError) -> object:
    """What is wrong with a checkpoint; where it is another scene's, so is all of the folder."""
    return f"{path}, {ANOTHER}" if str(error.given).endswith(ANOTHER) else error.given


def finished(path: Path, scene: Scene, found: Saved) -> bool:
    """Whether a run has come to its end, and no summary in the folder says otherwise."""
    if len(found.rows) != scene.total_steps:
        return False
    if not (path / SUMMARY).exists():
        return True
    with suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        return json.loads((path / SUMMARY).read_text(encoding="utf-8"))["complete"] is True
    return False


def result_in(path: Path) -> Result:
    """The result of a run that has ended, from what it left in its folder: the history, the fields
    that were written, the mesh of its scene.

    Raises InputError for another folder, a run that has not ended, or damaged files.
    """
    allowed = "a folder that `evfem run` left, at its end"
    from evfem.planning.plan import scene_mesh
    from evfem.scene.file import loads
    from evfem.scene.probes import read_csv

    if not (path / SUMMARY).is_file() or not (path / HISTORY).is_file():
        raise InputError("path", f"{path}, without {SUMMARY} or {HISTORY}", allowed)
    try:
        with disk(f"read {path}"):
            origin = sound(json.loads((path / SUMMARY).read_text(encoding="utf-8"))["provenance"])
            rows = read_rows((path / HISTORY).read_text(encoding="utf-8"))
            found = (path / PROBES).read_text(encoding="utf-8") if (path / PROBES).is_file() else ""
        parameters = _with_files_beside(origin["parameters"], path)
        scene, series = loads(parameters), ParaViewSeries(path / FIELDS, rows)
        mesh, _ = scene_mesh(scene)
        frames = [frame_in(series.frame_path(row["step"]), row, mesh) for row in series.rows]
        probes = read_csv(found, scene.output.probes, mesh.dim, len(rows)) if found else {}
        return Result.from_rows(rows, frames, mesh, origin, probes, scene)
    except (ValueError, KeyError, TypeError, IndexError, RecursionError) as error:
        raise InputError("path", f"{path}, damaged: {error}", allowed) from error


def _with_files_beside(text: str, path: Path) -> str:
    """The text of a scene in which a file that is gone is the one of its name beside the run's folder, if
    there is one: the mesh of a project that was moved or copied.
    """

    def found(name: re.Match[str]) -> str:
        file, beside = Path(name[1]), path.resolve().parent / Path(name[1]).name
        return json.dumps(beside.as_posix()) if not file.exists() and beside.is_file() else name[0]

    return re.sub(r'"(/[^"\n]+)"', found, text)


def _without_fields(path: Path) -> str:
    """What is missing of the fields, in words; nothing where they are there."""
    if not (path / FIELDS).is_file():
        return "without fields"
    with disk(f"read {path / FIELDS}"):
        index = (path / FIELDS).read_text(encoding="utf-8", errors="replace")
    lost = [name for name in re.findall(r'file="([^"]+)"', index) if not (path / name).is_file()]
    return f"without the fields in {lost[0]}" if lost else ""


def _without_a_row(history: Path) -> bool:
    with disk(f"use {history}"):
        return not history.exists() or history.stat().st_size <= len(csv_header())


def _refuse_others(path: Path) -> None:
    """InputError where a file has a name that a run writes, and evfem did not write it."""
    manifest = Manifest(path / MANIFEST, OURS).path  # what a kill left open in it is decided
    with disk(f"use {path}"):
        here = sorted(p.name for p in path.iterdir() if OURS.fullmatch(p.name)) if path.exists() else []
    refuse_others(manifest, here, "evfem")


def _remove_left(path: Path) -> None:
    for left in [p for p in path.iterdir() if LEFT.fullmatch(p.name)]:
        left.unlink()


def write_report(text: str, path: Path, out: Path | None) -> Path:
    """Write the page about a run, the folder or saved result `path`: to `out`, or there; returns its path."""
    if out is None and path.is_dir():
        with alone_in(path), Manifest(path / MANIFEST, OURS).writing(path / REPORT):
            write_text(path / REPORT, text)
        return path / REPORT
    out = out or path.with_suffix(".html")
    check_ending(out, ".html")
    write_text(out, text)
    return out


def write_sensitivities(found: Sensitivities, folder: Path) -> Path:
    """Write `sensitivities.csv` and a picture of the last step into a folder; returns the table's path."""
    from evfem.plotting.response import tornado

    found.to_csv(table := folder / "sensitivities.csv")
    for column in (*FORCES, *found.columns):
        if column in found.columns and np.isfinite(list(found.effects(column)[0].values())).any():
            _save(tornado(found, column).figure, folder / "sensitivities.png")
            break
    return table


def write_impedance(found: Impedance | ElectricalImpedance, folder: Path, name: str) -> Path:
    """Write a table, NAME.csv, and its picture into a folder; returns the table's path."""
    from evfem.plotting.response import impedance

    found.to_csv(table := folder / f"{name}.csv")
    _save(impedance(found).figure, folder / f"{name}.png")
    return table


def _save(figure: Any, path: Path) -> None:
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=150)

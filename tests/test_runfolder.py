"""The folder of a run is whole after every step, whatever interrupts the writing."""

import json
import logging
import os
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tools.fakes import fake_frame, fake_row
from tools.meshes import square_mesh

from evfem import export
from evfem.common import notices
from evfem.common.storage import GrowingText
from evfem.errors import InputError, StorageError
from evfem.export import FieldFiles
from evfem.finger.fingerpad import FingerPad
from evfem.runfolder import RunFolder, saved
from evfem.scene.scene import Output, default_scene
from evfem.simulation.checkpoint import Checkpoint
from evfem.simulation.result import Result
from evfem.sweeps import folder

SCENE = default_scene()
MESH, FINGER = square_mesh("quad"), FingerPad().mesh(2)


def state(step):
    return lambda: {"u": np.full(3, float(step))}


def started(path, **options):
    folder = RunFolder(path, SCENE, **options)
    folder.started(MESH, SCENE, SCENE.total_steps)
    return folder


def take(folder, *steps):
    for step in steps:
        folder.step(fake_row(step), fake_frame(MESH, step), state(step))


def steps_on_disk(path):
    """Step numbers in the history, of the .vtu files, in the index and in the checkpoint."""
    rows = [int(line.split(",")[0]) for line in (path / "history.csv").read_text().splitlines()[1:]]
    series = sorted(int(p.stem[-5:]) for p in path.glob("*.vtu"))
    index = [int(part[:5]) for part in (path / "fields.pvd").read_text().split('file="fields_')[1:]]
    point = Checkpoint(path / "checkpoint.npz").read(SCENE.digest())
    assert point.arrays["u"].tolist() == [float(len(point.rows))] * 3
    return rows, series, index, [row["step"] for row in point.rows]


@pytest.mark.parametrize(
    "place",
    [
        "export.write_frame",
        "runfolder.Checkpoint.write",
        "runfolder.csv_line",
        "export.ParaViewSeries.write_index",
    ],
)
def test_a_step_whose_writing_was_interrupted_is_written_at_the_end(tmp_path, monkeypatch, place):
    folder = started(tmp_path, plots=False)
    take(folder, 1, 2)

    def interrupt(*arguments, **more):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"evfem.{place}", interrupt)
    with pytest.raises(KeyboardInterrupt):
        take(folder, 3)
    monkeypatch.undo()
    summary = folder.close(None)
    assert steps_on_disk(tmp_path) == ([1, 2, 3],) * 4
    assert (summary["steps"], summary["complete"]) == (3, False)
    assert json.loads((tmp_path / "summary.json").read_text())["last"]["step"] == 3


def test_an_interruption_in_the_very_first_step_loses_nothing(tmp_path, monkeypatch):
    folder = started(tmp_path, plots=False)
    assert not folder.begun
    monkeypatch.setattr(RunFolder, "_open", lambda self: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        take(folder, 1)
    monkeypatch.undo()
    assert folder.begun
    folder.close(None)
    assert steps_on_disk(tmp_path) == ([1],) * 4


def test_a_file_that_comes_into_the_place_of_one_while_the_run_is_at_work_is_left_alone(tmp_path):
    folder = started(tmp_path, fields=False)
    take(folder, 1)
    (tmp_path / "forces.png").write_text("mine")
    with pytest.raises(StorageError, match=r"forces\.png: a file that evfem did not write is in its place"):
        folder.close(None)
    assert (tmp_path / "forces.png").read_text() == "mine"


class Killed(BaseException):
    """As a kill: nothing after it is done, so that what is on disk stays as it is."""


@pytest.fixture
def kill(monkeypatch):
    """Lets so many changes of the disk by the list and its files pass; at the next, a kill."""

    def at(room):
        def counted(change):
            def wrapped(*words, **more):
                nonlocal room
                room -= 1
                if room < 0:
                    raise Killed
                return change(*words, **more)

            return wrapped

        changes = {Path: ("touch", "unlink", "write_text", "write_bytes"), os: ("replace",)}
        changes |= {folder.Manifest: ("_append",), GrowingText: ("_append",)}
        for owner, names in changes.items():
            for name in names:
                monkeypatch.setattr(owner, name, counted(getattr(owner, name)))

    return at


@pytest.fixture
def torn(monkeypatch):
    """Lets so many lines pass that are added to files; a kill comes in the middle of the next."""

    def at(room):
        added = GrowingText._append

        def half(self, data):
            nonlocal room
            room -= 1
            if room < 0:
                with self.path.open("ab") as file:
                    file.write(data[: len(data) // 2])
                raise Killed
            added(self, data)

        monkeypatch.setattr(GrowingText, "_append", half)

    return at


@pytest.mark.parametrize("room", range(6))
def test_a_run_killed_within_a_line_goes_on_as_if_that_had_not_been_begun(tmp_path, monkeypatch, torn, room):
    """Of each step a line of the checkpoint is added, and one of the history, each but for the first ones."""
    torn(room)
    with suppress(Killed):
        take(started(tmp_path, plots=False), 1, 2, 3, 4)
    monkeypatch.undo()
    left = saved(tmp_path, SCENE)
    done = len(left.rows)
    assert done == 1 + room // 2  # a line of the history comes after the checkpoint, which counts
    assert left.arrays["u"].tolist() == [float(done)] * 3
    take(started(tmp_path, plots=False, resume=left), *range(done + 1, 5))
    assert steps_on_disk(tmp_path) == ([1, 2, 3, 4],) * 4
    take(started(tmp_path / "whole", plots=False), 1, 2, 3, 4)
    for name in ("history.csv", ".checkpoint.rows"):
        assert (tmp_path / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_fields_from_before_a_kill_are_in_the_index_at_once(tmp_path, monkeypatch):
    take(folder := started(tmp_path, plots=False), 1)
    monkeypatch.setattr(export.ParaViewSeries, "write_index", lambda self: (_ for _ in ()).throw(Killed))
    with suppress(Killed):
        take(folder, 2)
    monkeypatch.undo()
    again = started(tmp_path, plots=False, resume=saved(tmp_path, SCENE))
    again.step(fake_row(3), None, state(3))
    assert steps_on_disk(tmp_path) == ([1, 2, 3], [1, 2], [1, 2], [1, 2, 3])


def test_a_step_writes_as_much_however_many_there_were(tmp_path):
    folder, names = started(tmp_path, fields=False), ("history.csv", ".checkpoint.rows", "checkpoint.npz")
    sizes = []
    for step in range(1, 100):
        take(folder, step)
        sizes.append([(tmp_path / name).stat().st_size for name in names])
        if step == 2:
            begun = [(tmp_path / name).stat().st_ino for name in names[:2]]
    assert [(tmp_path / name).stat().st_ino for name in names[:2]] == begun  # added to, not replaced
    grown = np.diff(sizes, axis=0)
    assert (
        grown[1:, :2].max(axis=0) < 1.2 * grown[1:, :2].min(axis=0)
    ).all()  # a row, with more or fewer digits
    assert not grown[:, 2].any()


def test_a_history_that_somebody_changed_is_written_whole(tmp_path):
    folder = started(tmp_path, fields=False)
    take(folder, 1, 2)
    (tmp_path / "history.csv").write_text("mine")
    take(folder, 3)
    (tmp_path / "history.csv").unlink()
    take(folder, 4)
    rows = (tmp_path / "history.csv").read_text().splitlines()[1:]
    assert [row.split(",")[0] for row in rows] == ["1", "2", "3", "4"]


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("room", range(60))
def test_whenever_a_kill_comes_it_is_known_whose_a_file_is(tmp_path, monkeypatch, kill, room, before):
    """Ours are taken for ours, and a file that is put where none of ours is, is not."""
    out = tmp_path / "out"
    if before:
        take(started(out, plots=False), 1, 2)
    with suppress(Killed):
        kill(room)
        take(started(out, plots=False), 1)
    monkeypatch.undo()
    names = ["checkpoint.npz", "fields.pvd", "fields_00001.vtu", "fields_00002.vtu", "history.csv"]
    names.append(".checkpoint.rows")
    for name in [name for name in names if out.exists() and not (out / name).exists()]:
        there = shutil.copytree(out, tmp_path / name)
        (there / name).write_text("mine")
        with pytest.raises(InputError, match=f"{name} was not written by evfem"):
            started(there, plots=False)
    take(started(out, plots=False), 1)
    assert steps_on_disk(out) == ([1],) * 4
    assert not list(out.glob(".*.tmp"))


def test_a_list_from_anywhere_names_no_file_of_others(tmp_path):
    take(started(tmp_path), 1)
    (tmp_path / "notes.md").write_text("mine")
    with (tmp_path / ".evfem-files").open("a") as file:
        file.write("notes.md\n../notes.md\n\0\n")
    take(started(tmp_path), 1)
    assert (tmp_path / "notes.md").read_text() == "mine"


def test_a_run_that_ends_between_two_written_steps_leaves_the_fields_of_its_last(tmp_path, monkeypatch):
    """As where a step does not converge: the pictures of what went wrong are there."""
    monkeypatch.setattr(export, "MOST", 40 * export.frame_size(MESH, single=True))
    folder = started(tmp_path)
    take(folder, *range(1, 8))
    written = [3, 6]  # of 110 steps 36 and the two ends of motions are the most that fit
    assert steps_on_disk(tmp_path)[1:3] == (written, written)
    rows = [fake_row(step) for step in range(1, 8)]
    frames = [fake_frame(MESH, step) for step in range(1, 8)]
    folder.close(Result.from_rows(rows, frames, MESH, {"scene": {"name": "x", "total_steps": 110}}))
    assert steps_on_disk(tmp_path)[1:3] == ([*written, 7],) * 2


def told(tmp_path, scene, **options):
    """What a folder says at the start of a run."""
    heard = []
    handler = logging.Handler()
    handler.emit = lambda record: heard.append(record.getMessage())
    with notices.listening(handler, logging.INFO):
        RunFolder(tmp_path, scene, **options).started(FINGER, scene, scene.total_steps)
    return heard


def test_what_will_take_much_room_is_said_before(tmp_path):
    """Fields that are left out, or take more than 100 MB."""
    assert told(tmp_path, SCENE) == [f"{FieldFiles.of(SCENE, FINGER)}; every = 1 in [output] keeps all"]
    assert told(tmp_path, SCENE, fields=False) == []
    every = {n: replace(SCENE, output=Output(every=n, precision="double")) for n in (1, 2)}
    size = 110 * export.frame_size(FINGER) / 1e6
    assert size > 100.0
    assert told(tmp_path, every[1]) == [f"fields of every step, double precision: 110 files, {size:.0f} MB"]
    assert told(tmp_path, every[2]) == []

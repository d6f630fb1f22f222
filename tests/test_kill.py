"""Nothing is lost: runs that are killed, disks that are full, checkpoints damaged or of other scenes."""

import errno
import json
import os
import shutil
import time
import zlib
from importlib import import_module
from pathlib import Path
from random import Random

import numpy as np
import pytest
from tools import kills
from tools.builders import resumed
from tools.commands import called, contents, run_process

import evfem
from evfem import runfolder
from evfem.arguments import studies
from evfem.common.storage import load_arrays, packed, save_arrays, unpacked
from evfem.errors import StorageError
from evfem.scene.file import load
from evfem.simulation.checkpoint import CHECKPOINT_FORMAT, rows_of
from evfem.simulation.history import csv_header
from evfem.simulation.result import COLUMNS
from evfem.simulation.run import simulate
from evfem.textures import texture
from evfem.textures.texture import Texture


@pytest.mark.parametrize(
    ("name", "more"),
    [("force", False), *(pytest.param(name, True, marks=pytest.mark.slow) for name in kills.SCENES)],
)
def test_kills_at_random_moments_lose_nothing(name, more, tmp_path, pytestconfig):
    kills.prepare(tmp_path, name)
    count = pytestconfig.getoption("kills") if more else 3
    words, rng, hits, number = ["run", f"{name}.toml", "--no-plots", "--out"], Random(20), 0, 0
    begin = time.time()
    assert run_process(tmp_path, *words, "whole")[0] == 0
    length, end = time.time() - begin, kills.written(tmp_path / "whole" / "summary.json")
    computing = end - kills.written(tmp_path / "whole" / "fields_00001.vtu")
    while hits < count:
        out, number = tmp_path / f"killed-{number}", number + 1
        hit = True
        while hit and hits < min(count, 5 * number):  # then the run is left to finish
            resume = ["--resume"] if (out / ".evfem-files").exists() else []
            if rng.random() < 0.25:  # at any moment, else once it computes
                hit = kills.kill(tmp_path, [*words, out, *resume], rng.uniform(0.0, length))
            else:
                wait = rng.uniform(0.0, 0.6 * computing)
                hit = kills.kill(tmp_path, [*words, out, *resume], wait, out / "history.csv")
            hits += hit
            assert kills.broken(out) == []
        resume = ["--resume"] if (out / ".evfem-files").exists() else []
        assert run_process(tmp_path, *words, out, *resume)[0] == 0
        assert kills.broken(out) == []
        assert len(list(out.glob("fields_*.vtu"))) == 20
        assert not list(out.glob("*.tmp"))
        assert kills.difference(out, tmp_path / "whole") < 1e-9


@pytest.mark.parametrize("name", kills.SCENES)
@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_a_run_resumed_after_any_step_repeats_the_uninterrupted_one_to_the_last_bit(name, tmp_path):
    kills.prepare(tmp_path, name)
    whole, *others = resumed(load(tmp_path / f"{name}.toml"), 1, 4, 9, 19)
    assert max(whole.newton_iterations) > 1
    for again in others:
        for column in set(COLUMNS) - {"seconds", "motion"}:
            np.testing.assert_array_equal(again[column], whole[column], err_msg=column)
        np.testing.assert_array_equal(again.frames[-1].displacement, whole.frames[-1].displacement)


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory):
    """A folder with the scene `force`, and its run as it was after seven steps, in `stopped`."""
    folder = tmp_path_factory.mktemp("interrupted")
    kills.prepare(folder, "force")
    number = 0

    class Stop(runfolder.RunFolder):
        def step(self, row, frame, checkpoint):
            nonlocal number
            super().step(row, frame, checkpoint)
            number += 1
            if number == 7:
                raise ZeroDivisionError  # as sudden as a kill: nothing is closed

    scene = load(folder / "force.toml")
    with pytest.raises(ZeroDivisionError):
        simulate(scene, observers=[Stop(folder / "stopped", scene)])
    return folder


@pytest.fixture(scope="module")
def whole(interrupted):
    """The folder of the same run from its first step to its last."""
    assert called(interrupted, "run", "force.toml", "--no-plots", "--no-fields", "--out", "whole")[0] == 0
    return interrupted / "whole"


@pytest.fixture
def place(interrupted, tmp_path):
    """A copy of that folder."""
    return shutil.copytree(interrupted, tmp_path / "place", ignore=shutil.ignore_patterns("whole"))


def run(place, *more):
    status, _, error = called(place, "run", "force.toml", "--out", "stopped", "--no-plots", *more)
    return status, error


def replaced(path, state=None, **changes):
    """The same checkpoint with some arrays, or some of its state, changed or, where None, left out; its
    checksums right.
    """
    arrays = load_arrays(path, "checkpoint", CHECKPOINT_FORMAT) | changes
    arrays |= packed({name: a for name, a in (unpacked(arrays) | (state or {})).items() if a is not None})
    save_arrays(path, arrays)


def rows_replaced(path, lines):
    """Its rows are these lines, and it counts them."""
    data = "".join(f"{line}\n" for line in lines).encode()
    rows_of(path).write_bytes(data)
    replaced(path, rows=np.array([len(lines), len(data), zlib.crc32(data)]))


def row_changed(path, change):
    rows = [json.loads(line)[0] for line in rows_of(path).read_text().splitlines()]
    change(rows)
    rows_replaced(path, [json.dumps([row, []]) for row in rows])


def flipped(path, at):
    data = bytearray(path.read_bytes())
    data[int(at * len(data))] ^= 16
    path.write_bytes(bytes(data))


NOT_OURS = f"written by evfem '0.0.1', not by '{evfem.__version__}'"
DAMAGES = {
    "empty": (lambda p: p.write_bytes(b""), "cut off"),
    "cut off": (lambda p: p.write_bytes(p.read_bytes()[:-200]), "cut off"),
    "half": (lambda p: p.write_bytes(p.read_bytes()[: p.stat().st_size // 2]), "cut off"),
    "flipped at 0.1": (lambda p: flipped(p, 0.1), "checkpoint"),
    "flipped at 0.5": (lambda p: flipped(p, 0.5), "checkpoint"),
    "flipped at 0.8": (lambda p: flipped(p, 0.8), "checkpoint"),
    "no archive": (lambda p: p.write_text("mine"), "another kind"),
    "another format": (lambda p: save_arrays(p, {"format": np.array("evfem-result-1")}), "another format"),
    "another format of another version": (
        lambda p: save_arrays(p, {"format": np.array("evfem-checkpoint-1"), "version": np.array("0.0.1")}),
        f"another format, {NOT_OURS}",
    ),
    "another version": (lambda p: replaced(p, version=np.array("0.0.1")), NOT_OURS),
    "another scene": (lambda p: replaced(p, scene=np.array("0" * 64)), "another scene"),
    "no state": (lambda p: replaced(p, {"u": np.zeros(0)}), "no usable u"),
    "lacking": (lambda p: replaced(p, {"reaction": None}), "no usable reaction"),
    "another kind": (lambda p: replaced(p, {"status": np.zeros(25)}), "no usable status"),
    "node -1": (lambda p: replaced(p, {"candidates": np.array([-1, 2])}), "no usable candidates"),
    "text": (lambda p: replaced(p, {"time": np.array("now")}), "no plain array time"),
    "not finite": (lambda p: replaced(p, {"time": np.array(np.nan)}), "no usable time"),
    "nodes elsewhere": (lambda p: replaced(p, {"candidates": np.array([3, 9999])}), "no usable candidates"),
    "nodes twice": (lambda p: replaced(p, {"candidates": np.array([3, 3, 5])}), "no usable candidates"),
    "status 7": (lambda p: replaced(p, {"status": np.full(25, 7)}), "no usable status"),
    "part 0": (lambda p: replaced(p, {"substep": np.array(0.0)}), "no usable substep"),
    "part 1.5": (lambda p: replaced(p, {"substep": np.array(1.5)}), "no usable substep"),
    "column lost": (
        lambda p: row_changed(p, lambda rows: [row.pop("min_gap") for row in rows]),
        "of another version: without the columns min_gap;",
    ),
    "column too many": (
        lambda p: row_changed(p, lambda rows: [row.update(extra=1.0) for row in rows]),
        "no usable rows",
    ),
    "columns of a row": (lambda p: row_changed(p, lambda rows: rows[1].pop("min_gap")), "columns of row 2"),
    "no rows": (lambda p: row_changed(p, list.clear), "damaged"),
    "row lost": (lambda p: row_changed(p, lambda rows: rows.pop(2)), "damaged"),
    "row not finite": (lambda p: row_changed(p, lambda rows: rows[6].update(position=1e999)), "damaged"),
    "row of text": (lambda p: row_changed(p, lambda rows: rows[1].update(time="x")), "damaged"),
    "rows of another kind": (lambda p: rows_replaced(p, ["{}"] * 7), "damaged"),
    "rows too deep": (lambda p: rows_replaced(p, ["[" * 99999]), "damaged"),
    "rows uncounted": (lambda p: replaced(p, rows=np.array("{}")), "damaged"),
    "rows miscounted": (lambda p: replaced(p, rows=np.array([1, 2, 3])), "damaged: the rows in .check"),
    "rows lost": (lambda p: rows_of(p).unlink(), "damaged: the rows in .checkpoint.rows"),
    "rows cut off": (lambda p: os.truncate(rows_of(p), 99), "damaged: the rows in .checkpoint.rows"),
    "rows flipped": (lambda p: flipped(rows_of(p), 0.5), "damaged: the rows in .checkpoint.rows"),
    "no layout": (
        lambda p: save_arrays(p, load_arrays(p, "p", CHECKPOINT_FORMAT) | {"layout": np.array("[1]")}),
        "damaged",
    ),
    "more rows than steps": (
        lambda p: row_changed(p, lambda rows: rows.extend([rows[-1] | {"step": k} for k in range(8, 99)])),
        "98 steps",
    ),
}


@pytest.mark.parametrize("more", [(), ("--resume",)])
@pytest.mark.parametrize("case", DAMAGES)
def test_a_checkpoint_that_cannot_be_used_is_one_sentence_and_nothing_is_touched(place, case, more):
    damage, words = DAMAGES[case]
    damage(place / "stopped" / "checkpoint.npz")
    before = contents(place / "stopped")
    status, error = run(place, *more)
    assert status == 2, error
    assert words in error if more else "--overwrite" in error
    assert error.count("\n") == 1
    assert contents(place / "stopped") == before


@pytest.mark.parametrize("more", [(), ("--resume",)])
@pytest.mark.parametrize("written", [[], ["history.csv"], ["history.csv", "fields_00001.vtu"]])
def test_a_run_killed_before_its_first_step_was_stored_begins_again(place, written, more):
    for path in (place / "stopped").iterdir():
        if path.name not in (".evfem-files", *written):
            path.unlink()
    if written:
        (place / "stopped" / "history.csv").write_text(csv_header())
    (place / "stopped" / ".history.csv.123.tmp").write_text("half")
    status, error = run(place, "--no-fields", *more)
    assert status == 0, error
    names = [".checkpoint.rows", ".evfem-files", "checkpoint.npz", "history.csv", "summary.json"]
    assert sorted(contents(place / "stopped")) == names


def test_a_history_without_its_checkpoint_is_not_overwritten(place):
    (place / "stopped" / "checkpoint.npz").unlink()
    before = contents(place / "stopped")
    for more, words in (
        (("--resume",), "without checkpoint.npz"),
        ((), "checkpoint.npz, which does not exist"),
    ):
        status, error = run(place, *more)
        assert status == 2
        assert words in error
        assert contents(place / "stopped") == before


def test_what_a_killed_run_was_writing_is_removed_by_the_next_and_nothing_else(place):
    left = [".checkpoint.npz.77.tmp", ".fields_00008.vtu.77.tmp", "..evfem-files.77.tmp"]
    mine = [".notes.md.77.tmp", "fields.tmp", ".fields_00008.vtu.swp"]
    for name in left + mine:
        (place / "stopped" / name).write_text("half")
    assert run(place, "--resume")[0] == 0
    names = contents(place / "stopped")
    assert not set(left) & set(names)
    assert set(mine) <= set(names)


class Full:
    """Lets `room` writes of files pass, then the disk is full: half of what was to be written is on it."""

    def __init__(self, room, monkeypatch):
        self.room = room
        self.real = {"write_text": Path.write_text, "write": np.lib.format.write_array}
        self.real |= {"write_bytes": Path.write_bytes, "open": Path.open}
        monkeypatch.setattr(Path, "write_text", lambda *a, **k: self.text(*a, **k))
        monkeypatch.setattr(Path, "write_bytes", lambda path, data: self.bytes(path, data))
        monkeypatch.setattr(Path, "open", lambda path, mode="r", *a, **k: self.opened(path, mode, *a, **k))
        monkeypatch.setattr(np.lib.format, "write_array", lambda *a, **k: self.array(*a, **k))
        monkeypatch.setattr("meshio.vtu._vtu.write", self.fields(__import__("meshio").vtu._vtu.write))

    def take(self):
        self.room -= 1
        return self.room >= 0

    def text(self, path, text, **more):
        if self.take():
            return self.real["write_text"](path, text, **more)
        self.real["write_text"](path, text[: len(text) // 2], **more)
        raise OSError(errno.ENOSPC, "No space left on device")

    def bytes(self, path, data):
        if self.take():
            return self.real["write_bytes"](path, data)
        self.real["write_bytes"](path, data[: len(data) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    def opened(self, path, mode, *words, **more):
        if mode != "ab" or self.take():
            return self.real["open"](path, mode, *words, **more)
        half = self.real["open"](path, mode, *words, **more)
        half.write(b"1,2,pre")
        half.close()
        raise OSError(errno.ENOSPC, "No space left on device")

    def array(self, file, array, **more):
        if not self.take():
            file.write(b"\x93NUMPY")
            raise OSError(errno.ENOSPC, "No space left on device")
        return self.real["write"](file, array, **more)

    def fields(self, write):
        def wrapped(path, grid, **more):
            write(path, grid, **more)
            if not self.take():
                os.truncate(path, os.path.getsize(path) // 2)
                raise OSError(errno.ENOSPC, "No space left on device")

        return wrapped


@pytest.mark.parametrize("room", [*range(14), 20, 23, 29, 50])
def test_a_disk_that_is_full_at_any_write_is_exit_status_4_and_the_run_goes_on_later(
    place, whole, monkeypatch, room
):
    before = kills.history(place / "stopped")
    Full(room, monkeypatch)
    status, error = run(place, "--resume")
    monkeypatch.undo()
    assert status == 4
    assert "No space left" in error.splitlines()[-1]
    assert "Traceback" not in error
    assert kills.broken(place / "stopped") == []
    assert not list((place / "stopped").glob(".*.tmp"))
    now = kills.history(place / "stopped")
    assert {name: column[:7] for name, column in now.items()} == before
    assert run(place, "--resume")[0] == 0
    # the last digits may differ: PARDISO's depend on where its memory lies
    assert kills.difference(place / "stopped", whole) < 1e-12


@pytest.mark.parametrize("room", [0, 1])
def test_a_texture_stays_whole_where_the_disk_is_full_under_the_next(tmp_path, monkeypatch, room):
    """Its rows are in a file of their own; those of another texture under its name would be a third one."""
    texture.write(Texture("one", "drawn", [0.0, 1.0], [0.0, 0.01], "CC0-1.0"), tmp_path / "a.json")
    before = contents(tmp_path)
    other = Texture("two", "drawn", [0.0, 1.0], [0.02, 0.0], "CC0-1.0")
    Full(room, monkeypatch)
    with pytest.raises(StorageError, match=r"cannot write .*a\.(csv|json): No space left"):
        texture.write(other, tmp_path / "a.json")
    monkeypatch.undo()
    assert contents(tmp_path) == before


@pytest.mark.parametrize("room", [0, 1])
def test_a_template_that_the_disk_refused_is_written_later(tmp_path, monkeypatch, room):
    Full(room, monkeypatch)
    status, out, err = called(tmp_path, "init", "--template", "mesh")
    monkeypatch.undo()
    assert (status, out, "No space left" in err) == (4, "", True)
    assert contents(tmp_path) == {}
    assert called(tmp_path, "init", "--template", "mesh")[0] == 0


@pytest.mark.parametrize("case", ["below a file", "read-only"])
def test_a_study_whose_folder_cannot_be_written_computes_nothing(tmp_path, monkeypatch, case):
    (tmp_path / "file").touch()
    out = "file/out" if case == "below a file" else "out"
    told = {"below a file": "create the folder file/out: Not", "read-only": "write into out: Read"}

    def refuse(dir):
        raise OSError(errno.EROFS, "Read-only file system")

    if case == "read-only":
        monkeypatch.setattr(import_module(f"{studies().__name__}.common"), "TemporaryFile", refuse, False)
    monkeypatch.setattr(studies(), "module", None)
    status, _, error = called(tmp_path, "study", "section321", "--quick", "--out", out)
    assert status == 4
    assert error.splitlines()[-1].startswith(f"evfem: cannot {told[case]}")
    assert contents(tmp_path) == {"file": b""}
    assert not (tmp_path / "out").exists()

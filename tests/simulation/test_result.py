"""Results and checkpoints come back from disk as they were, and damaged files get a sentence."""

import csv
import io
import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from tools.fakes import fake_result, fake_row
from tools.meshes import KINDS
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError, StorageError
from evfem.simulation.history import MEANINGS, ROOM_COLUMNS, csv_header, csv_line, no_column, read_rows
from evfem.simulation.result import COLUMNS, INTEGERS, NEEDED, UNITS, Result, load

#: the promised columns, and their order in history.csv
CONTRACT = (
    "step, motion_index, motion, time, position, indentation, voltage, applied_force, "
    "applied_tangential_force, normal_force, tangential_force, electrostatic_force, "
    "electrostatic_force_x, contact_width, real_contact_width, "
    "min_gap, peak_contact_pressure, mean_contact_pressure, external_work, "
    "electrostatic_work, stored_energy, friction_dissipation, viscous_dissipation, "
    "kinetic_energy, integrator_dissipation, snap_dissipation, "
    "substeps, newton_iterations, relaxations, jumps, seconds"
)
#: those that follow where the scene has friction, adhesion, an elastic surface, a drive, a voltage, one found
OF_ROOMS = (
    "friction, stick_share, slip_share, apparent_friction, "
    "adhesive_force, adhesive_force_x, adhesive_force_z, adhesive_work, surface_sink, source_work, "
    "leakage_dissipation, stretch_work, field_energy, charge, current_rms, power, breakdown, breakdown_x, "
    "missed_force, missed_gap"
)
PLANE_ROOMS = tuple(name for name in ROOM_COLUMNS if not name.endswith("_z"))


def test_columns_are_those_of_the_contract_in_its_order():
    assert ", ".join(COLUMNS) == CONTRACT
    assert ", ".join(ROOM_COLUMNS) == OF_ROOMS


MOIST = ev.Dugdale(stress=0.002, reach=0.02)
SOLVED = ev.Drive(resolved=True)
LOAD = ("charge", "current_rms", "power")
AIR = ("breakdown", "breakdown_x")
RUBBING = ("friction", "stick_share", "slip_share")
SMOOTH, ROUGH = ev.Display(friction=0.0), ev.Display(friction=0.3)
SOFT = ev.Display(friction=0.0, elastic=ev.ElasticLayer(E=1.0, nu=0.4, thickness=1.0))


@pytest.mark.parametrize(
    ("given", "further"),
    [
        ({}, ()),
        ({"adhesion": MOIST}, ("adhesive_force", "adhesive_force_x", "adhesive_work")),
        ({"surface": SOFT}, ("surface_sink",)),
        ({"surface": ROUGH}, RUBBING),
        ({"surface": ROUGH, "law": ev.StrongTroxel(), "voltage": 9.0}, (*RUBBING, *AIR, "apparent_friction")),
        (
            {"law": ev.StrongTroxel(), "voltage": ev.Sine(50.0, 9.0), "drive": SOLVED},
            ("source_work", "leakage_dissipation", "stretch_work", "field_energy", *LOAD, *AIR),
        ),
        ({"law": ev.StrongTroxel(), "voltage": 9.0}, AIR),
        ({"law": ev.StrongTroxel(), "voltage": 9.0, "drive": ev.Drive(50.0)}, (*LOAD, *AIR)),
    ],
    ids=["base", "adhesion", "elastic surface", "friction", "friction felt", "charges", "voltage", "drive"],
)
def test_a_run_has_the_columns_of_the_rooms_of_its_scene(given, further):
    """The others are 0 where they are asked for, or unknown, but are no columns."""
    finger, surface = ev.FingerPad(ridges=False, resolution="coarse"), given.pop("surface", SMOOTH)
    motion = [ev.Press(indentation=0.1, steps=1), ev.Wait(1e-3, steps=1)]
    result = ev.simulate(ev.Scene(finger, surface, motion=motion, **given))
    assert result.columns == (*COLUMNS, *further)
    for name in ROOM_COLUMNS:
        if name in further:
            assert result[name] is result.in_rooms[name] is getattr(result, name)
        else:
            nought = float("nan") if name in RUBBING[1:] else 0.0  # shares of what was not looked at
            np.testing.assert_allclose(result[name], [nought, nought], atol=1e-12)
            np.testing.assert_array_equal(getattr(result, name), result[name])
    named = tuple(name for name in further if name.endswith(("_force", "_sink", "_energy")))
    assert all(result[name].any() for name in named)


def test_columns_of_rooms_are_saved_and_a_history_of_an_older_version_has_them(tmp_path):
    """Columns that the package has a meaning for, and one of a room of one's own."""
    result = fake_result(rooms=(*PLANE_ROOMS, "film_force"))
    result.save(tmp_path / "run.npz")
    back = load(tmp_path / "run.npz")
    assert back.rows == result.rows
    assert back.columns == (*COLUMNS, *PLANE_ROOMS, "film_force")
    result.to_csv(tmp_path / "history.csv")
    text = (tmp_path / "history.csv").read_text()
    assert text.splitlines()[0] == ",".join(back.columns)
    assert read_rows(text) == result.rows
    # 0.3 wrote them all, elsewhere in the line
    head, *lines = csv.reader(io.StringIO(text))
    moved = [head.index(name) for name in sorted(head)]
    old = "\n".join(",".join(line[i] for i in moved) for line in (head, *lines))
    assert [{**row} for row in read_rows(old)] == result.rows


@pytest.mark.parametrize("kind", KINDS)
def test_a_saved_result_comes_back_bit_by_bit(kind, tmp_path):
    result = fake_result(kind)
    result.save(tmp_path / "run.npz")
    back = load(tmp_path / "run.npz")
    assert back.rows == result.rows
    assert back.provenance == result.provenance
    assert back.mesh.kind == kind
    assert back.mesh.region_names == {"soft": 0, "hard": 1}
    np.testing.assert_array_equal(back.mesh.points, result.mesh.points)
    np.testing.assert_array_equal(back.mesh.cells, result.mesh.cells)
    np.testing.assert_array_equal(back.mesh.node_sets["pad"], result.mesh.node_sets["pad"])
    assert [frame.step for frame in back.frames] == [2, 4]
    for old, new in zip(result.frames, back.frames, strict=True):
        for name in vars(old):
            np.testing.assert_array_equal(getattr(new, name), getattr(old, name))


def test_a_result_without_frames_comes_back(tmp_path):
    result = Result.from_rows([], [], fake_result().mesh, {})
    result.save(tmp_path / "empty.npz")
    back = load(tmp_path / "empty.npz")
    assert (back.frames, back.rows, back.summary()["steps"]) == ([], [], 0)


def test_the_name_of_another_format_is_refused_with_what_writes_it(tmp_path):
    refuses(r"\.npz: to_csv writes the history", fake_result().save, tmp_path / "run.csv")
    assert not list(tmp_path.iterdir())


def test_rows_with_a_missing_column_or_one_that_is_no_name_are_refused():
    row = fake_row(1)
    with pytest.raises(InputError, match="'time'"):
        Result.from_rows([{k: v for k, v in row.items() if k != "time"}], [], fake_result().mesh, {})
    refuses("'extra force'", Result.from_rows, [row | {"extra force": 1}], [], fake_result().mesh, {})


@pytest.mark.parametrize("lacking", COLUMNS)
def test_a_result_of_a_version_with_fewer_columns_is_read_or_refused_as_such(lacking, tmp_path):
    result = fake_result()
    result.save(tmp_path / "run.npz")
    with np.load(tmp_path / "run.npz") as archive:
        arrays = {name: archive[name] for name in archive.files}
    del arrays[f"history/{lacking}"]
    np.savez(tmp_path / "old.npz", **arrays)
    if lacking in NEEDED:
        refuses(f"of another version: without history/{lacking};", load, tmp_path / "old.npz")
        return
    old = load(tmp_path / "old.npz")
    np.testing.assert_array_equal(getattr(old, lacking), np.full(4, 0 if lacking in INTEGERS else np.nan))
    for name in {*COLUMNS} - {lacking}:
        np.testing.assert_array_equal(getattr(old, name), getattr(result, name))


def test_a_disk_that_refuses_leaves_the_old_file_alone(tmp_path, monkeypatch):
    path = tmp_path / "run.npz"
    fake_result().save(path)
    before = path.read_bytes()

    def full(*arguments, **more):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array", full)
    with pytest.raises(StorageError, match="No space left"):
        fake_result(steps=6).save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]
    monkeypatch.undo()
    with pytest.raises(StorageError, match="cannot write"):
        fake_result().save(tmp_path / "no folder" / "run.npz")


def test_history_csv_keeps_every_digit():
    result = fake_result()
    text = csv_header() + "".join(map(csv_line, result.rows))
    assert text.splitlines()[0] == CONTRACT.replace(" ", "")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == 4
    for read, row in zip(rows, result.rows, strict=True):
        assert read["step"] == str(row["step"])
        assert read["motion"] == row["motion"]
        assert all(float(read[name]) == row[name] for name in COLUMNS if name != "motion")


def test_a_column_is_found_by_its_name_and_a_misspelt_one_is_guessed():
    result = fake_result()
    for name in COLUMNS:
        assert result[name] is getattr(result, name)
    for given, meant in {"normal_forse": "normal_force", "shear_force": "tangential_force"}.items():
        with pytest.raises(InputError, match=f'column: given "{given}", no column; allowed: {meant}\\?'):
            result[given]
    # a fingertip has areas, and widths that stay empty
    assert str(no_column("column", "area", ["contact_width", "contact_area"])).count("allowed: contact_area?")
    with pytest.raises(InputError, match="allowed: step, motion_index, motion"):
        result["qqq"]


def test_a_written_history_is_that_of_a_run_folder(tmp_path):
    result = fake_result()
    result.to_csv(tmp_path / "mine.csv")
    assert (tmp_path / "mine.csv").read_text() == csv_header() + "".join(map(csv_line, result.rows))


def test_the_table_has_every_column_without_pandas_and_with_it(monkeypatch):
    """`pandas` stands for a module with a DataFrame made of columns."""
    result = fake_result()
    monkeypatch.setattr("evfem.common.tables.find_spec", lambda name: None)
    records = result.table()
    assert records.dtype.names == COLUMNS
    assert [tuple(row.values()) for row in result.rows] == records.tolist()
    assert records.step.dtype.kind == "i"
    monkeypatch.setattr("evfem.common.tables.find_spec", lambda name: name == "pandas")
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=lambda columns: ("frame", columns)))
    kind, columns = result.table()
    assert kind == "frame"
    assert tuple(columns) == COLUMNS
    np.testing.assert_array_equal(columns["voltage"], result.voltage)


def test_every_column_has_a_unit_and_a_meaning():
    units = {"", "s", "mm", "V", "N/mm", "N", "MPa", "C/mm", "A/mm", "W/mm"}
    every = (*COLUMNS, *ROOM_COLUMNS)
    assert tuple(UNITS) == tuple(MEANINGS) == every
    assert set(UNITS.values()) == units
    assert all(MEANINGS.values())
    assert {UNITS[name] for name in every if name.endswith("_force")} == {"N/mm"}
    assert {UNITS[name] for name in every if name.endswith(("_work", "_energy", "_dissipation"))} == {"N"}


def test_summary_is_plain_json_with_the_last_row_and_the_peaks():
    result = fake_result()
    result.min_gap[-1] = np.inf
    summary = json.loads(json.dumps(result.summary(), allow_nan=False))
    assert summary["last"]["min_gap"] is None
    assert (summary["steps"], summary["requested_steps"], summary["complete"]) == (4, 4, True)
    assert summary["last"]["normal_force"] == result.normal_force[-1]
    result.tangential_force[1] = -7.0  # of a slide towards -x
    assert result.summary()["largest"]["tangential_force"] == 7.0
    assert summary["newton_iterations"] == 12
    assert (summary["nodes"], summary["cells"], summary["kind"]) == (9, 4, "quad")


PER_MM = ("C/mm", "A/mm", "W/mm")


def with_depth(depth=10.0):
    scene = {"name": "fake", "total_steps": 4, "depth": depth}
    return fake_result(provenance={"scene": scene}, rooms=PLANE_ROOMS)


def test_a_total_has_the_same_names_over_the_depth(tmp_path):
    result = with_depth(8.0)
    total = result.total
    per_depth = {name for name in result.columns if name.endswith(("_force", "_force_x", "_width"))}
    per_depth |= {name for name in result.columns if name.endswith(("_work", "_energy", "_dissipation"))}
    per_depth |= {"charge", "current_rms", "power"}
    assert len(per_depth) == 27
    for name in result.columns:
        factor = 8.0 if name in per_depth else 1.0
        assert total.rows[2][name] == (
            factor * result.rows[2][name] if factor != 1.0 else result.rows[2][name]
        )
        units = (
            {"N/mm": "N", "N": "mJ", "mm": "mm2", **dict(zip(PER_MM, "CAW", strict=True))}
            if name in per_depth
            else {}
        )
        assert total.units[name] == units.get(result.units[name], result.units[name])
    assert total.total is total
    assert total.frames == result.frames
    np.testing.assert_array_equal(result.contact_area, 8.0 * result.contact_width)
    np.testing.assert_array_equal(total.real_contact_area, 8.0 * result.real_contact_width)
    total.save(tmp_path / "total.npz")
    back = load(tmp_path / "total.npz")
    assert (back.rows, back.units["normal_force"]) == (total.rows, "N")
    assert back.total is back


@pytest.mark.parametrize("name", ["total", "contact_area", "real_contact_area"])
def test_without_a_depth_there_is_no_total(name):
    for result in (fake_result(), with_depth(None)):
        assert result.depth is None
        refuses(r"depth: missing; allowed: a depth in mm, by Scene\(depth=...\)", getattr, result, name)
        assert "total" not in result.summary()


def test_the_summary_says_the_end_over_the_depth_too():
    result = with_depth()
    summary = json.loads(json.dumps(result.summary()))
    assert summary["last"]["normal_force"] == result.normal_force[-1]
    assert summary["units"]["force"] == "N/mm"
    total = summary["total"]
    assert (total["depth"], total["last"]["normal_force"]) == (10.0, 10.0 * result.normal_force[-1])
    assert total["largest"]["contact_width"] == 10.0 * result.contact_width.max()
    assert total["largest"]["peak_contact_pressure"] == summary["largest"]["peak_contact_pressure"]
    assert (total["units"]["force"], total["units"]["energy"], total["units"]["stress"]) == ("N", "mJ", "MPa")
    whole = result.total.summary()
    assert whole["units"]["force"] == "N"
    assert "total" not in whole


def test_columns_of_rooms_that_a_scene_has_not_read_nought():
    """Scripts of 0.3 read them from rows and results; the files do not have them."""
    result = fake_result()
    assert result.rows[0]["adhesive_force"] == result["adhesive_force"][0] == result.adhesive_force[0] == 0.0
    assert "adhesive_force" not in result.rows[0]
    assert "adhesive_force" not in result.columns
    with pytest.raises(KeyError):
        result.rows[0]["adhesion"]

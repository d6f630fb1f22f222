"""`ev.load` and the paths that `simulate` and `plan` take: one way in for every file."""

import shutil
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from tools.commands import called
from tools.fakes import SQUARE_SCENE, fake_result
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.common.storage import save_arrays
from evfem.mesh import file as meshfile
from evfem.simulation.checkpoint import Checkpoint

WRITTEN = Path(__file__).parent / "mesh/written"

PRESS = f"{SQUARE_SCENE}\n[[motion]]\nkind = 'press'\nindentation = 0.1\nsteps = 2\n"
SWEEP = "version = 1\nscene = 'square.toml'\n[grid]\nsurface.friction = [0.1, 0.2]\n"
SETS = """*NODE
1, 0, 0
2, 4, 0
3, 4, 4
4, 0, 4
*ELEMENT, TYPE=CPE4H, ELSET=tissue
1, 1, 2, 3, 4
*NSET, NSET=pad
1, 2
*NSET, NSET=bone
3, 4
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    meshfile.write(square_mesh("quad9"), tmp_path / "square.vtu")
    (tmp_path / "square.toml").write_text(PRESS)
    (tmp_path / "two.toml").write_text(SWEEP)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_voltage_has_the_units_of_its_header(tmp_path):
    """One file, through each door."""
    path = tmp_path / "signal.csv"
    path.write_text("time [ms],voltage [kV]\n0,0\n0.1,0.002\n0.2,0.003\n")
    motion = "[[motion]]\nkind = 'press'\nindentation = 0.1\nspeed = 10.0\n"
    drawn = f"version = 1\n{motion}[surface]\nkind = 'flat'\n"
    drawn += "[electrostatics]\nlaw = 'kaczmarek'\ninsulator = 'film'\n"
    (tmp_path / "scene.toml").write_text(f"{drawn}voltage_file = 'signal.csv'\n")
    for signal in (ev.load(path), ev.Sampled.from_csv(path), ev.load(tmp_path / "scene.toml").voltage):
        assert (signal(1e-4), signal.rate) == (pytest.approx(2.0), pytest.approx(1e4))
    path.write_text("position,voltage\num,kV\n0,0\n500,0.2\n")
    (tmp_path / "scene.toml").write_text(f"{drawn}voltage_file = 'signal.csv'\n")
    for signal in (ev.load(path), ev.VoltageProfile.from_csv(path), ev.load(tmp_path / "scene.toml").voltage):
        assert signal(0.25) == pytest.approx(100.0)
    path.write_text("time [ms],voltage [furlong]\n0,0\n1,2\n")
    refuses("voltage: given voltage in furlong; allowed: V | mV | kV", ev.load, path)


def test_each_file_is_known_by_what_is_in_it(place):
    signal = ev.VoltageProfile([0.0, 1.0], [0.0, 300.0])
    signal.to_csv("ramp.csv")
    ev.write_signal("ramp.wav", signal, ev.Playback(400.0, speed=10.0, rate=8000))
    result = fake_result()
    result.save("no.ending")
    meshfile.write(square_mesh("quad"), "square.msh")
    assert repr(ev.load("ramp.csv")) == repr(signal)
    assert ev.load("ramp.wav")(0.5) == pytest.approx(150.0, abs=0.1)
    np.testing.assert_array_equal(ev.load("no.ending").normal_force, result.normal_force)
    ev.Sampled([1.0, 2.0], rate=10.0).to_csv("recorded.csv")
    assert ev.load("recorded.csv")(0.05) == pytest.approx(1.5)
    assert ev.load("square.toml") == ev.scenefile.load("square.toml")
    assert isinstance(ev.load(place / "two.toml"), ev.Sweep)
    assert ev.load("square.vtu").kind == "quad9"
    assert ev.load("square.msh").kind == "quad"
    (place / "sets.inp").write_text(SETS)
    assert sorted(ev.load("sets.inp").node_sets) == ["bone", "pad"]


@pytest.mark.parametrize("ending", ["bdf", "fem", "nas", "meshb", "su2", "MED"])
def test_a_mesh_is_known_by_the_ending_of_its_format(tmp_path, ending):
    """Formats without names ask for them."""
    as_written = {"fem": "bdf", "nas": "bdf", "meshb": "mesh"}.get(ending, ending.lower())
    path = shutil.copy(WRITTEN / f"gmsh_quad.{as_written}", tmp_path / f"finger.{ending}")
    if ending == "MED":
        np.testing.assert_array_equal(ev.load(path).cells, meshfile.read(path).cells)
    else:
        refuses("finger.meshb" if ending == "meshb" else f"no name for .* of finger.{ending}", ev.load, path)


def test_what_is_no_file_of_ours_gets_a_sentence(place):
    (place / "notes.txt").write_text("mine")
    (place / "empty.npz").write_text("")
    (place / "sweep.parquet").write_bytes(b"PAR1")
    fake_result().to_csv(place / "history.csv")
    (place / "buzz.ahap").write_text("{}")
    Checkpoint(place / "checkpoint.npz").write("digest", {}, [])
    save_arrays("pad.npz", {"format": np.array("evfem-reduced-1")})  # as FastModel.save of 0.2 did
    cases = {
        "notes.txt": "notes.txt, of another kind; allowed: the folder of a run or a sweep, a result",
        "buzz.ahap": "heights of other files: `evfem texture import`, haptic patterns: `ev.Sampled",
        "none.npz": "none.npz, which does not exist",
        "empty.npz": "empty.npz, cut off or of another kind",
        "checkpoint.npz": "the checkpoint of a run; allowed: `evfem run --resume`",
        "pad.npz": "a fast model; allowed: other files: the fast model is gone since 0.3, `ev.simulate`",
        "square.toml": "frictoin",
        "history.csv": "the history of a run; allowed: the run's folder, or its .npz; `pandas.read_csv`",
        "sweep.parquet": "for other programs; allowed: the sweep's folder,",
        "scan.csv": "path: given scan.csv, which starts with 'x,height'; allowed: a voltage (position,",
    }
    (place / "scan.csv").write_text("x,height\n0,1\n1,2\n")
    (place / "square.toml").write_text(PRESS.replace("friction", "frictoin"))
    for name, words in cases.items():
        assert words in str(refuses("allowed", ev.load, name))
    refuses("path: given 3; allowed: the path of the folder", ev.load, 3)


@pytest.mark.parametrize("output", ["", "precision = 'single'", "compression = true", "every = 2"])
def test_the_folder_of_a_run_is_its_result(place, output):
    """What `evfem run` left is what `simulate` returns, as far as fields were written."""
    (place / "square.toml").write_text(f"{PRESS}\n[output]\n{output}\n")
    assert called(place, "run", "square.toml", "--no-plots")[0] == 0
    found, computed = ev.load("square-out"), ev.simulate("square.toml")
    for name in ev.result.COLUMNS[:-1]:  # the last one is the time it took
        np.testing.assert_array_equal(found[name], computed[name])
    assert found.provenance["scene"] == computed.provenance["scene"]
    np.testing.assert_array_equal(found.mesh.cells, computed.mesh.cells)
    assert found.mesh.node_sets.keys() == computed.mesh.node_sets.keys()
    assert [frame.step for frame in found.frames] == ([2] if "every" in output else [1, 2])
    one, other = found.frames[-1], computed.frames[-1]
    close = 1e-6 if "single" in output else 0.0
    for spec in fields(ev.result.Frame):
        np.testing.assert_allclose(getattr(one, spec.name), getattr(other, spec.name), rtol=close, atol=close)
    assert called(place, "run", "square.toml", "--overwrite", "--no-fields", "--no-plots")[0] == 0
    assert ev.load("square-out").frames == []


def test_a_folder_that_is_no_result_gets_a_sentence(place):
    assert called(place, "run", "square.toml", "--no-plots")[0] == 0
    folder = place / "square-out"
    history, fields_of_2 = folder / "history.csv", folder / "fields_00002.vtu"
    kept = {path: path.read_bytes() for path in (history, fields_of_2, folder / "summary.json")}
    wrong = {
        history: [b"", b"step,motion\n1,press\n", kept[history].replace(b"press", b"press,1")],
        fields_of_2: [b"", kept[fields_of_2].replace(b"gap", b"gab"), kept[fields_of_2][:2000]],
        folder / "summary.json": [b"{}", b"[", b'{"provenance": {"parameters": "version = 3"}}'],
    }
    for path, contents in wrong.items():
        for content in contents:
            path.write_bytes(content)
            sentence = r"path: given .*square-out, damaged: .*allowed: a folder that"
            refuses(sentence, ev.load, folder)
        path.write_bytes(kept[path])
    (folder / "summary.json").unlink()
    refuses(r"without summary\.json or history\.csv", ev.load, folder)


def test_a_scene_is_simulated_and_planned_by_its_path(place):
    by_path, by_scene = ev.simulate("square.toml"), ev.simulate(ev.load("square.toml"))
    np.testing.assert_array_equal(by_path.normal_force, by_scene.normal_force)
    assert by_path.provenance["scene"]["name"] == "square"
    assert str(ev.plan(place / "square.toml")).startswith("Scene square: 2 steps, ")
    for wrong in (3, None, {"version": 1}):
        refuses("allowed: a Scene, or the path of a scene file", ev.simulate, wrong)
        refuses("allowed: a Scene, or the path of a scene file", ev.plan, wrong)

"""What versions 0.1, 0.2 and 0.3 wrote is still read: `tests/data` has a press and a slide by each, a scene,
results and sweep. The forces are theirs, those of another code.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest
from tools.commands import called
from tools.refusals import refuses

import evfem as ev

VERSIONS = ["0.1.0", "0.2.0", "0.3.0"]
FORCES = ("applied_force", "normal_force", "tangential_force", "electrostatic_force", "stored_energy")


@pytest.fixture(params=VERSIONS)
def place(request, tmp_path):
    """A copy of what a version wrote in /data, where its run finds the mesh."""
    copy = Path(shutil.copytree(Path(__file__).parent / "data" / request.param, tmp_path / request.param))
    summary = copy / "run/summary.json"
    summary.write_text(summary.read_text().replace(f"/data/{request.param}/", f"{copy}/"))
    return copy


def history(place):
    """Columns of the table that the version wrote, read without evfem."""
    found = np.genfromtxt(place / "run/history.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert list(found["motion"]) == ["press", "slide"]
    return found


def test_results_are_read(place):
    table = history(place)
    for result in (ev.load(place / "run"), ev.load(place / "result.npz")):
        assert result.provenance["versions"]["evfem"] == place.name
        for name in FORCES:
            np.testing.assert_allclose(result[name], table[name], rtol=1e-12, atol=1e-15)
        assert [frame.step for frame in result.frames] == [1, 2]
        assert result.frames[1].displacement.shape == result.mesh.points.shape


def test_its_scene_gives_the_same_forces(place):
    result, table = ev.simulate(place / "scene.toml"), history(place)
    for name in FORCES:
        np.testing.assert_allclose(result[name], table[name], rtol=1e-7, atol=1e-9 * table[name].max())
    assert result.tangential_force[-1] > 1e-4


def test_its_sweep_is_read_and_goes_on(place):
    before = ev.load(place / "sweep")
    assert list(before["electrostatics.voltage"]) == [0.0, 1000.0]
    points = {path.name for path in (place / "sweep/points").iterdir()}
    status, _, _ = called(place, "sweep", "sweep.toml", "--out", "sweep", "--workers", "1", "--resume")
    assert status == 0
    after = ev.load(place / "sweep")
    np.testing.assert_allclose(after["tangential_force.last"], before["tangential_force.last"], rtol=1e-7)
    assert points <= {path.name for path in (place / "sweep/points").iterdir()}


@pytest.mark.parametrize("place", VERSIONS[-1:], indirect=True)
def test_its_run_is_not_continued_and_says_what_to_do(place):
    status, _, err = called(place, "run", "scene.toml", "--out", "run", "--resume")
    assert status == 2
    assert "written by evfem '0.3.0'" in err
    assert "--overwrite begins the run anew" in err
    refuses("the checkpoint of a run; allowed: `evfem run --resume`", ev.load, place / "run/checkpoint.npz")


@pytest.mark.parametrize("name", ["history.csv", "fields.pvd", "fields_00002.vtu"])
def test_one_file_of_a_run_leads_to_its_folder(place, name):
    refuses(r"one file of a run; allowed: the run's folder, .*run", ev.load, place / "run" / name)

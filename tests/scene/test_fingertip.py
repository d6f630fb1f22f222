"""A whole pad in scene files: the kind, its keys, paths, participants, and back to the file."""

import meshio
import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.cli import main
from evfem.errors import InputError
from evfem.scene.file import dump, loads

REST = """
[surface]
kind = "flat"
[[motion]]
kind = "press"
indentation = 0.2
"""


def scene(finger, folder="."):
    return loads(f"version = 1\n[finger]\n{finger}{REST}", folder)


def test_kind_chooses_the_finger():
    assert isinstance(scene('kind = "fingertip"').finger, ev.Fingertip)
    for text in ("", 'kind = "pad"'):
        assert isinstance(scene(text).finger, ev.FingerPad)
    with pytest.raises(InputError, match=r"finger.kind: given .toe.; allowed: pad \| fingertip"):
        scene('kind = "toe"')


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('kind = "fingertip"\nnail_breadth = 11.0', "finger.nail_breadth"),
        ('kind = "fingertip"\nridge_scan = "scan.csv"', "finger.ridge_scan"),
        ('kind = "fingertip"\nridges = "nowhere.csv"', "finger.ridges"),
        ('kind = "fingertip"\nrim = "loose"', "finger.rim"),
        ('kind = "fingertip"\n[finger.materials.nail]\nE = 17.0', "finger.materials.nail"),
        ('kind = "pad"\nlength = 22.5', "finger.length"),
        ('kind = "pad"\nridges = "whorl"', "finger.ridges"),
        ('kind = "fingertip"\nmesh = "pad.vtu"', "finger.kind"),
    ],
)
def test_mistakes_name_their_key(text, key):
    assert refuses("allowed", scene, text).key == key


def test_scenes_come_back_from_the_file(tmp_path):
    x = np.linspace(-3.0, 3.0, 7)
    print_ = 0.05 * np.random.default_rng(3).random((7, 7))
    fingers = [
        ev.Fingertip(ridges="loop", posture=20.0, materials={"dermis": ev.Yeoh(c1=0.01, nu=0.45)}),
        ev.Fingertip(ridges=False, resolution="coarse", electrical=ev.Electrical(0.3, 1000.0)),
        ev.Fingertip(ridges=ev.HeightMap(x, x, print_), resolution="coarse"),
    ]
    for finger in fingers:
        one = ev.Scene(finger, ev.Flat(), motion=ev.Press(indentation=0.2))
        assert loads(dump(one), tmp_path).digest() == one.digest()


def test_paths_are_relative_to_the_file(tmp_path):
    (tmp_path / "print.csv").write_text("x,z,height\n-1,-1,0\n1,-1,0\n-1,1,0.1\n1,1,0.1\n")
    finger = scene('kind = "fingertip"\nridges = "print.csv"\nresolution = "coarse"', tmp_path).finger
    assert finger.ridges.height.tolist() == [[0.0, 0.0], [0.1, 0.1]]


def test_a_run_leaves_what_can_be_loaded(tmp_path, capsys):
    """Columns of three dimensions with their names in `history.csv`, fields of the solid."""
    lines = 'kind = "fingertip"\nridges = "none"\nresolution = "coarse"\n'
    text = f"version = 1\n[finger]\n{lines}{REST}steps = 1\n".replace("0.2", "0.1")
    (tmp_path / "tip.toml").write_text(text)
    folder = tmp_path / "out"
    assert main(["run", str(tmp_path / "tip.toml"), "--out", str(folder), "--no-plots"]) == 0
    header, row = (folder / "history.csv").read_text().splitlines()
    assert len(header.split(",")) == len(row.split(","))
    result = ev.load(folder)
    assert result["contact_area"][-1] > 1.0
    assert result.frames[-1].displacement.shape == (len(result.mesh.points), 3)
    assert result.normal_force[-1] == pytest.approx(result.applied_force[-1], rel=1e-6)
    skin = meshio.read(folder / "skin_00001.vtu")
    assert len(skin.points) == len(result.mesh.node_sets["pad"])
    pressure = skin.point_data["contact_pressure"]
    assert float(np.nanmax(pressure)) == np.nanmax(result.frames[-1].contact_pressure)
    names = (folder / ".evfem-files").read_text().split()
    assert {"skin.pvd", "skin_00001.vtu", "fields.pvd"} <= set(names)

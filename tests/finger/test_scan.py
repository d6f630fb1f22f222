"""Scanned ridges: reliefs and outlines against the formulas they were made from, files, refused input."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.finger.fingerpad import FingerPad
from evfem.finger.outline import Ellipse, Ridges
from evfem.finger.scan import RidgeScan, ScannedRidges
from evfem.mesh.quality import check
from evfem.scene import file as scenefile
from evfem.textures.importers import Table

FINGER = FingerPad(resolution="coarse", ridge_height=0.1, ridge_exponent=2.0, ridge_phase=0.2)
OUTER = Ellipse(8.34, 6.395)
RIDGES = Ridges(0.1, 0.5, 2.0, 0.2, 0.0, 0.0, 0.72 * 8.34, 0.79 * 8.34)
X = np.arange(-1_320, 1_321) / 200.0  # with the bottoms of the grooves


def outline(x):
    """Points (N, 2) of the pad's outline above the feet x on the ellipse."""
    angle = -np.arccos(x / OUTER.a)
    return OUTER.point(angle) - RIDGES.depth(x)[:, None] * OUTER.normal(angle)


@pytest.fixture
def relief(tmp_path):
    """The ridges of `FINGER` as a file of heights above some other level."""
    np.savetxt(
        tmp_path / "relief.csv",
        np.column_stack([X, 0.7 - RIDGES.depth(X)]),
        delimiter=",",
        header="x,height",
        comments="",
    )
    return tmp_path / "relief.csv"


def test_a_relief_of_the_formula_gives_the_outline_of_the_formula(relief):
    """Every node of the pad lies on the curve that the relief was taken from."""
    curve = outline(np.arange(-70_000, 70_001) / 10_000.0)  # with the bottoms of the grooves
    for pad, error in ((FINGER, 1e-8), (FingerPad(resolution="coarse", ridge_scan=relief), 2e-5)):
        mesh = check(pad.mesh(1))
        points = mesh.points[mesh.node_sets["pad"]]
        points = points[np.abs(points[:, 0]) < 5.9]  # further out ridges fade, and scanned ones do again
        assert len(points) > 150
        np.testing.assert_allclose(points[:, 1], np.interp(points[:, 0], *curve.T), atol=error)


def test_an_outline_is_measured_along_the_normals_of_the_ellipse():
    """From points of the outline, shifted in y, back to the depths that made them."""
    points = outline(X)
    feet, below = RidgeScan(points[:, 0], y=points[:, 1] + 3.0).depths(OUTER)
    np.testing.assert_allclose(feet, X, atol=1e-9)
    np.testing.assert_allclose(below, RIDGES.depth(X), atol=1e-9)


def test_beyond_its_ends_a_scan_comes_back_to_the_crest_line():
    ridges = ScannedRidges(np.array([-1.0, 0.0, 1.0]), np.array([0.1, 0.0, 0.1]), 0.5, 6.0, 6.6)
    places = np.array([-1.25, -1.125, -1.0, 0.5, 1.0, 1.125, 1.25, 3.0])
    np.testing.assert_allclose(ridges.depth(places), [0.0, 0.05, 0.1, 0.05, 0.1, 0.05, 0.0, 0.0], atol=1e-15)
    assert (ridges.height, ridges.steepest) == (0.1, 0.1)
    # nodes 0.8 apart meet neither end nor the crest's neighbours exactly, nodes at samples miss nothing
    assert ridges.missed(0.5) == pytest.approx(0.0, abs=1e-15)
    deep = ScannedRidges(np.array([0.0, 0.05, 0.1, 0.3]), np.array([0.0, 0.1, 0.0, 0.0]), 0.5, 6.0, 6.6)
    assert deep.missed(0.1) == pytest.approx(0.1)


def test_a_scene_with_a_scan_is_written_and_read_back(relief, tmp_path):
    text = (
        'version = 1\n[finger]\nresolution = "coarse"\nridge_scan = "relief.csv"\n[surface]\nkind = "flat"\n'
    )
    scene = scenefile.loads(text + '[[motion]]\nkind = "press"\nforce = 0.02\nsteps = 2\n', relief.parent)
    assert scene.finger.ridge_scan.x.shape == X.shape
    again = scenefile.loads(scenefile.dump(scene), tmp_path / "elsewhere")
    assert again.digest() == scene.digest()
    assert repr(scene.finger).startswith(
        "FingerPad(resolution='coarse', ridge_scan=RidgeScan(2641 points, x -6.6 to 6.6 mm, height 0.6"
    )
    touching = ev.simulate(scene)
    # crests touch, grooves do not
    assert touching.real_contact_width[-1] < 0.8 * touching.contact_width[-1]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("x,z\n0,1\n1,2\n2,3\n", "with the header 'x,z'; allowed: a csv file with the header x,height or"),
        ("y,x\n0,1\n1,2\n2,3\n", "with the header 'y,x'"),
        ("x,height\n0,1\n", "given 1 values of x, 1 of height; allowed: 3 to 100000 points"),
        ("x,height\n0,1\n0,2\n1,2\n", r"given x 0, then 0 \(points 1, 2\); allowed: increasing x, in mm"),
        ("x,height\n0,1\n1,high\n2,2\n", r"finger\.ridge_scan: given scan\.csv, line 3: '1,high'"),
        ("x,y\n-9,0\n0,-6\n9,0\n", "x from -9 to 9 mm; allowed: an outline within 8.34 mm, half of"),
        ("x,height\n-1,0\n0,0.4\n1,0\n", r"finger\.ridge_scan: given 0.4.*0.7 times the stratum corneum"),
        (
            "x,height\n-1,0\n0,0.1\n0.01,0\n1,0\n",
            r"given slopes up to 10\.1, and .*allowed: slopes up to 4\.88",
        ),
        ("x,y\n-3,-6.2\n0,-6\n3,-6.2\n", r"finger\.ridge_scan: given .* times the stratum corneum"),
    ],
)
def test_scans_that_cannot_be_are_refused_with_one_sentence(tmp_path, text, sentence):
    (tmp_path / "scan.csv").write_text(text)
    refuses(sentence, FingerPad, resolution="coarse", ridge_scan=tmp_path / "scan.csv")


def test_a_formula_beside_a_scan_is_refused():
    scan = RidgeScan([-1.0, 0.0, 1.0], height=[0.0, 0.1, 0.0])
    with pytest.raises(
        InputError, match=r"finger\.ridge_exponent: given ridge_exponent = 3\.0 beside a scan"
    ):
        FingerPad(ridge_scan=scan, ridge_exponent=3.0)
    refuses(r"finger\.ridges: given ridges = False beside a scan", FingerPad, ridge_scan=scan, ridges=False)
    for wrong in (3, {"x": [0, 1, 2]}, []):
        refuses(r"finger\.ridge_scan: given .* a RidgeScan, or a csv file", FingerPad, ridge_scan=wrong)
    with pytest.raises(InputError, match="given height and y; allowed: one of the two"):
        RidgeScan([0.0, 1.0, 2.0], height=[0.0, 1.0, 2.0], y=[0.0, 1.0, 2.0])
    refuses("No such file", FingerPad, ridge_scan="none.csv")


def test_depth_between_two_nodes_is_refused_on_a_coarse_mesh_alone():
    """A groove 0.05 mm wide: between the nodes of the coarse mesh, seen by those of the fine one."""
    x = np.arange(-1.0, 1.0001, 0.0125)
    height = np.where(np.abs(x - 0.02) < 0.026, -0.04 * (1.0 + np.cos((x - 0.02) * np.pi / 0.025)) / 2, 0.0)
    scan = RidgeScan(x, height=height)
    with pytest.raises(
        InputError, match=r"mm of depth between two nodes; allowed: .*finer finger\.resolution"
    ):
        FingerPad(resolution="coarse", ridge_scan=scan)
    FingerPad(resolution="fine", ridge_scan=scan)


def test_a_texture_of_heights_gives_ridges_below_the_middle(relief):
    """What `evfem texture import` makes of the file of a scan begins at 0: shifted back it is that scan."""
    texture = Table(licence="CC0-1.0", level="none")(relief)
    pad = FingerPad(resolution="coarse", ridges=texture)
    np.testing.assert_allclose(pad.ridge_scan.x, X, atol=1e-12)
    wanted = FingerPad(resolution="coarse", ridge_scan=relief)
    np.testing.assert_allclose(pad.mesh(1).points, wanted.mesh(1).points, atol=1e-12)
    assert FingerPad(resolution="coarse", ridges=wanted.ridge_scan) == wanted
    scene = ev.Scene(pad, ev.Flat(), motion=ev.Press(force=0.05))
    assert scenefile.loads(scenefile.dump(scene)).digest() == scene.digest()
    slippery = ev.Texture("a", "measured", [0.0, 1.0], [0.3, 0.4], "CC0-1.0", quantity="friction")
    refuses("ridges: given a texture of friction; allowed: a texture of", FingerPad, ridges=slippery)
    refuses(r'^finger\.ridges: given "yes"; allowed: true \| false; patterns', FingerPad, ridges="yes")

"""What a finger in three dimensions is refused, where slides go, and the memory that is announced."""

import numpy as np
import pytest
from tools.domes import Dome, dome, dome_scene
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.meshes.benchmark import divided_mesh
from evfem.planning.plan import plan
from evfem.scene import spatial
from evfem.scene.file import dump, loads
from evfem.scene.spatial import needed_memory
from evfem.simulation.model import make_model

PRESS = ev.Press(indentation=0.1)


def refusals():
    penalty = ev.Solver(element="hex8", contact="penalty", penalty_normal=1.0, penalty_tangential=1.0)
    return {
        "solver.contact": dome_scene(PRESS, solver=penalty),
        "electrostatics.field": dome_scene(PRESS, law=ev.StrongTroxel(), field="full"),
        "depth": dome_scene(PRESS, depth=10.0),
    }


@pytest.mark.parametrize("key", refusals())
def test_what_is_not_possible_yet_is_refused_by_the_plan(key):
    assert str(refuses("three dimensions", plan, refusals()[key])).startswith(key)


def test_a_finger_in_the_plane_slides_along_x():
    flat = ev.Scene(ev.FingerPad(resolution="coarse"), ev.Flat(), motion=[PRESS, ev.Slide(1.0, angle=10.0)])
    refuses(r"motion\[1\].angle: given 10 degrees with a finger in the plane", plan, flat)


def test_a_force_is_told_in_the_units_of_both():
    said = r"given -1; allowed: a force in N/mm, N over the mm of depth \(of a fingertip in N\), from 0 to"
    refuses(said, ev.Press, force=-1)


FOUR = [0.0, 1.0, 2.0, 3.0]
ACROSS = {
    "turned": ev.Sinusoid(angle=180.0),
    "term": ev.Sinusoid(terms=[[0.02, 6.0, 0.0, 90.0]]),
    "profile": ev.Profile(FOUR, FOUR, angle=90.0),
    "grating": ev.Grating(1.0, 0.1, angle=1.0),
    "relief": ev.Relief(FOUR, FOUR, [FOUR] * 4),
    "map": ev.Flat(friction=ev.FrictionMap([0.0, 1.0], [0.0, 1.0], [[0.1, 0.2], [0.3, 0.4]])),
}


@pytest.mark.parametrize("name", ACROSS)
def test_a_finger_in_the_plane_knows_no_surface_that_differs_along_z(name):
    """Plane strain would not be; in a file as in Python, where a solid takes each of them."""
    pad = ev.Scene(ev.FingerPad(resolution="coarse"), ACROSS[name], motion=[PRESS])
    refuses(r"^surface: given heights or friction over x and z with a finger in", plan, pad)
    scene = ev.Scene(ev.Fingertip(resolution="coarse", ridges="none"), ACROSS[name], motion=[PRESS])
    again = loads(dump(scene))
    assert again.digest() == scene.digest()
    assert type(again.surface) is type(ACROSS[name])


def test_a_relief_may_be_in_a_file_of_its_own(tmp_path):
    rows = "".join(f"{x},{z},{0.01 * x * z}\n" for x in range(4) for z in range(5))
    (tmp_path / "scan.csv").write_text("x,z,height\n" + rows)
    text = "version = 1\n[finger]\nkind = 'fingertip'\n[surface]\nkind = 'relief'\n{}friction = {}\n"
    text += "[[motion]]\nkind = 'press'\nindentation = 0.1\n"
    table = "{x = [0, 1], z = [0, 1], friction = [[0.1, 0.2], [0.3, 0.4]]}"
    surface = loads(text.format("file = 'scan.csv'\n", table), tmp_path).surface
    assert (surface.samples.shape, surface.samples[2, 3]) == ((5, 4), 0.06)
    assert surface.friction.at(np.array([[0.5, 0.5]])).tolist() == [0.25]
    for keys, given in (
        ("", "missing"),
        ("file = 'scan.csv'\nx = [0.0]\n", "file and x"),
        ("x = [0]\n", "x"),
    ):
        with pytest.raises(InputError, match=rf"surface\.file: (given )?{given}; allowed: the path of a csv"):
            loads(text.format(keys, 0.3), tmp_path)
    with pytest.raises(
        InputError, match=r"surface\.friction: given a table of x; allowed: x, z and friction"
    ):
        loads(text.format("file = 'scan.csv'\n", "{x = [0, 1]}"), tmp_path)


def test_the_plan_says_what_a_whole_finger_needs():
    needed = plan(dome_scene(PRESS, finger=Dome(shape=dome((8, 4, 8)))))
    text = " ".join(str(needed).split())
    assert needed.unknowns == 3 * (5 * 81 - 81) + 3
    assert "three dimensions" in text
    assert "plane strain" not in text
    assert "a run takes about 0.14 GB of memory and 0.3 to 2 s of CPU time" in text
    assert "sparse Cholesky factors;" in text


@pytest.mark.parametrize(
    ("resolution", "ridges", "peak"),
    [
        ("medium", "none", 0.488),
        ("fine", "none", 1.53),
        ("coarse", "along", 0.765),
        ("medium", "along", 1.24),
    ],
)
def test_the_memory_said_is_that_of_runs(resolution, ridges, peak):
    """Peaks (GB) of presses to 1 N under 1000 V and 3 mm of slide, measured once (fine: 0.3 N)."""
    mesh = ev.Fingertip(resolution=resolution, ridges=ridges).mesh()
    assert needed_memory(mesh) == pytest.approx(1e9 * peak, rel=0.25)


@pytest.mark.parametrize(
    ("mesh", "peak"),
    [
        (lambda: ev.FingerPad(resolution="coarse", ridges=False).mesh(), 0.119),
        (lambda: ev.FingerPad(resolution="medium").mesh(), 0.193),
        (lambda: ev.FingerPad(resolution="fine").mesh(), 0.533),
        (lambda: divided_mesh((240, 40, 8)), 0.144),
        (lambda: divided_mesh((480, 80, 16)), 0.293),
        (lambda: divided_mesh((1000, 166, 34)), 1.04),
        (lambda: divided_mesh((1560, 260, 56)), 2.54),
    ],
)
def test_the_memory_said_is_that_of_runs_in_the_plane(mesh, peak):
    """Peaks (GB) of a press and a slide, of pads under 1000 V and of the benchmark, measured once."""
    assert 1.0 / 1.4 < needed_memory(mesh()) / (1e9 * peak) < 1.4


def test_a_finger_that_no_memory_holds_is_refused_before_it_is_solved(monkeypatch):
    """405 nodes, on a machine with a megabyte."""
    scene = dome_scene(PRESS, finger=Dome(shape=dome((8, 4, 8))))
    monkeypatch.setattr(spatial, "physical_memory", lambda: 1e6)
    refused = refuses(r"405 nodes, whose direct solver needs about 0.14 GB", make_model, scene)
    assert "fits into the 0.001 GB of this machine" in str(refused)
    monkeypatch.undo()
    assert spatial.physical_memory() > 1e8
    make_model(scene)

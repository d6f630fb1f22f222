"""What a finger in three dimensions is refused, where slides go, and the memory that is announced."""

import pytest
from tools.domes import Dome, dome, dome_scene

import evfem as ev
from evfem.errors import InputError
from evfem.planning.plan import plan
from evfem.scene import spatial
from evfem.scene.spatial import needed_memory
from evfem.simulation.model import make_model

PRESS = ev.Press(indentation=0.1)


def refusals():
    jump = ev.Flat(friction=[[0.0, 0.2], [1.0, 0.2], [1.0, 0.5]])
    across = [PRESS, ev.Slide(1.0, angle=90.0)]
    follow = ev.FollowForce([0.0, 1.0], [0.01, 0.01])
    penalty = ev.Solver(element="hex8", contact="penalty", penalty_normal=1.0, penalty_tangential=1.0)
    rough = ev.PowerRoughness(gap=0.001, pressure=0.01, exponent=0.5, open_gap=0.006)
    fast = ev.RateFriction(speed=5.0, exponent=0.5)
    return {
        "electrostatics.roughness_gap": dome_scene(PRESS, roughness_gap=rough),
        "surface.friction_law": dome_scene(ev.Press(indentation=0.1, speed=1.0), friction_law=fast),
        "hand": dome_scene(*across, hand=ev.Hand(0.1)),
        "surface.friction": dome_scene(PRESS, surface=jump, law=None, voltage=0.0),
        "solver.contact": dome_scene(PRESS, solver=penalty),
        "electrostatics.direction": dome_scene(PRESS, direction="normal"),
        "depth": dome_scene(PRESS, depth=10.0),
        "electrostatics.voltage": dome_scene(*across, voltage=follow),
    }


@pytest.mark.parametrize("key", refusals())
def test_what_is_not_possible_yet_is_refused_by_the_plan(key):
    with pytest.raises(InputError, match=r"three dimensions|across x") as refused:
        plan(refusals()[key])
    assert str(refused.value).startswith(key)


def test_a_finger_in_the_plane_slides_along_x():
    flat = ev.Scene(ev.FingerPad(resolution="coarse"), ev.Flat(), motion=[PRESS, ev.Slide(1.0, angle=10.0)])
    with pytest.raises(InputError, match=r"motion\[1\].angle: given 10 degrees with a finger in the plane"):
        plan(flat)


def test_the_plan_says_what_a_whole_finger_needs():
    needed = plan(dome_scene(PRESS, finger=Dome(shape=dome((8, 4, 8)))))
    text = " ".join(str(needed).split())
    assert needed.unknowns == 3 * (5 * 81 - 81) + 3
    assert "three dimensions" in text
    assert "plane strain" not in text
    assert "a run takes about 0.14 GB of memory" in text


@pytest.mark.parametrize(
    ("resolution", "ridges", "peak"),
    [("medium", "none", 0.465), ("fine", "none", 1.53), ("coarse", "along", 1.20), ("medium", "along", 1.80)],
)
def test_the_memory_said_is_that_of_runs(resolution, ridges, peak):
    """Peaks (GB) of presses to 1 N under 1000 V and 3 mm of slide, measured once (fine: 0.3 N)."""
    mesh = ev.Fingertip(resolution=resolution, ridges=ridges).mesh()
    assert needed_memory(mesh) == pytest.approx(1e9 * peak, rel=0.25)


def test_a_finger_that_no_memory_holds_is_refused_before_it_is_solved(monkeypatch):
    """405 nodes, on a machine with a megabyte."""
    scene = dome_scene(PRESS, finger=Dome(shape=dome((8, 4, 8))))
    monkeypatch.setattr(spatial, "physical_memory", lambda: 1e6)
    with pytest.raises(InputError, match=r"405 nodes, whose direct solver needs about 0.14 GB") as refused:
        make_model(scene)
    assert "fits into the 0.001 GB of this machine" in str(refused.value)
    monkeypatch.undo()
    assert spatial.physical_memory() > 1e8
    make_model(scene)

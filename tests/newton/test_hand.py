"""A spring, a damper and a mass between drive and bone, against what they do by themselves."""

import numpy as np
import pytest
from tools.builders import coarse_pad, finger, left_over
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.planning.plan import plan
from evfem.scene.file import dump, loads

#: hardly deforms: 4 mm on 0.02 mm of 50 MPa
SLAB = finger(block(2, 1, width=4.0, height=0.02), E=50.0, nu=0.0)
N, K, M = 0.04, 0.02, 1e-6
OMEGA = np.sqrt(K / M)
OUTPUT = ev.Output(every=100_000)


def slab(hand, *slides, mu=0.4, **more):
    motion = [ev.Press(force=N, steps=1), *slides]
    return ev.Scene(SLAB, ev.Flat(friction=mu), motion=motion, hand=hand, output=OUTPUT, **more)


def slid(distance, steps, speed=1.0, hold="force"):
    return ev.Slide(distance, steps=steps, hold=hold, speed=speed)


@pytest.mark.parametrize("hold", ["force", "indentation"])
def test_behind_a_spring_the_bone_sticks_until_it_is_stretched_and_then_lags_behind(hold):
    """The stretch of full slip is mu N / k = 0.8 mm, forwards and, 1.6 mm later, backwards."""
    hand = ev.Hand(K)
    result = ev.simulate(slab(hand, slid(1.2, 6, None, hold), slid(-2.0, 5, None, hold)))
    drive = np.append(0.0, np.concatenate([np.linspace(0.2, 1.2, 6), np.linspace(0.8, -0.8, 5)]))
    lag = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.8, 0.8, 0.4, 0.0, -0.4, -0.8, -0.8])
    np.testing.assert_allclose(result.position, drive - lag, atol=2e-4)
    np.testing.assert_allclose(result.applied_tangential_force, K * (drive - result.position), atol=1e-10)
    assert left_over(result) < 1e-9
    # the drive has stretched the spring, and friction has taken the way of the bone
    friction = 0.4 * N * np.abs(np.diff(result.position)).sum()
    assert result.friction_dissipation[-1] == pytest.approx(friction, rel=2e-3)
    assert result.external_work[4] == pytest.approx(0.5 * K * 0.8**2, rel=2e-3)


@pytest.mark.parametrize("damping", [0.0, 4e-5])
def test_without_friction_the_bone_swings_about_the_drive(damping):
    """e'' + (c/m) e' + (k/m) e = 0 with the drive's speed at the start; the error of backward Euler
    falls with the step.
    """
    decay = 0.5 * damping / M
    omega = np.sqrt(OMEGA**2 - decay**2)
    errors = []
    for steps in (100, 200):
        result = ev.simulate(slab(ev.Hand(K, damping, M), slid(0.02, steps), mu=0.0))
        t = result.time
        stretch = np.exp(-decay * t) * np.sin(omega * t) / omega
        errors.append(np.abs(result.position - (t - stretch)).max() * omega)
        assert left_over(result) < 1e-6  # the work is small, and the residuals are relative to the load
    assert errors[1] < 0.1
    assert 1.7 < errors[0] / errors[1] < 2.3
    assert (result.viscous_dissipation[-1] > 0.0) == (damping > 0.0)


def test_the_books_know_the_energies_of_the_hand():
    """By themselves: the spring's from the stretch, the mass's from the steps of the bone."""
    hand = ev.Hand(K, 4e-5, M)
    result = ev.simulate(slab(hand, slid(0.01, 50), mu=0.0))
    steps = np.diff(result.position)
    speed = steps / np.diff(result.time)
    drive = np.append(0.0, np.linspace(0.0002, 0.01, 50))
    stretch = drive - result.position
    assert result.kinetic_energy[-1] == pytest.approx(0.5 * M * speed[-1] ** 2, rel=1e-9)
    pressed = result.stored_energy[0]
    np.testing.assert_allclose(result.stored_energy - pressed, 0.5 * K * stretch**2, atol=1e-8 * K)
    damped = np.cumsum(4e-5 * np.diff(stretch) ** 2 / np.diff(result.time))
    np.testing.assert_allclose(result.viscous_dissipation[1:], damped, rtol=1e-9)


def test_a_scene_file_says_it_and_what_cannot_be_is_refused():
    scene = ev.Scene(
        coarse_pad(), ev.Flat(), motion=[ev.Press(force=0.05), slid(1.0, 5)], hand=ev.Hand(0.1, mass=1e-7)
    )
    again = loads(dump(scene))
    assert again == scene
    assert "159 Hz" in next(term.reason for term in plan(scene).terms if term.name == "hand")
    refuses(r"hand\.stiffness", loads, dump(scene).replace("stiffness = 0.1", "stiffness = 0.0"))
    refuses(r"motion\[1\].speed", slab, ev.Hand(K, mass=M), slid(1.0, 5, None))
    with pytest.raises(InputError, match="target friction force"):
        ev.Scene(
            SLAB, ev.Display(), ev.Kaczmarek(), ev.FollowForce([0.0, 1.0], [0.0, 0.01], 100.0),
            [ev.Press(force=N), slid(1.0, 5)], hand=ev.Hand(K),
        )  # fmt: skip
    refuses("hand", slab, 0.1, slid(1.0, 5))


def test_the_hand_of_a_finger_has_the_published_slopes():
    """4.04 N/m, 3.23e-5 kg and 13.8 Hz for every mm/s, arXiv:2505.11162; over a depth of 8 mm."""
    hand = ev.Hand.of_finger(50.0, depth=8.0)
    assert hand.stiffness * 8.0 == pytest.approx(4.04e-3 * 50.0)  # N/mm
    assert hand.mass * 8.0 == pytest.approx(3.23e-5 * 1e-3 * 50.0)  # t
    assert hand.stiffness / (2.0 * np.pi * hand.damping) == pytest.approx(13.8 * 50.0)
    refuses("speed", ev.Hand.of_finger, 0.0)


@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_a_mass_that_moves_for_a_tenth_of_a_microsecond_is_balanced_to_its_rounding():
    """A kilonewton per millimetre at x = 1 mm: half a digit of it is 200 times the tolerance."""
    result = ev.simulate(slab(ev.Hand(K, 0.0, M), slid(1.0, 1), slid(1e-7, 1), mu=0.0))
    assert result.substeps.tolist() == [1, 1, 1]
    assert result.position[-1] == pytest.approx(result.position[-2], abs=1e-6)

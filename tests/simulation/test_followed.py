"""A voltage that is found from a wished friction force: what is met, and what is said to be missed."""

import numpy as np
import pytest

import evfem as ev

MU, LOAD = 0.4, 0.05


def slid(wish, steps, largest=10_000.0, distance=3.0, law=None, **surface):
    """A smooth pad on film, held, whose slide wishes one friction force (N/mm) everywhere."""
    return ev.simulate(
        ev.Scene(
            ev.FingerPad(resolution="coarse", ridges=False),
            ev.Display(friction=MU, **surface),
            law or ev.Kaczmarek(),
            ev.FollowForce([0.0, distance], [wish, wish], largest),
            [ev.Press(force=LOAD, steps=2), ev.Slide(distance=distance, steps=steps)],
        )
    )


@pytest.mark.parametrize(("wish", "steps"), [(0.032, 6), (0.035, 4), (0.035, 6), (0.04, 2), (0.04, 8)])
def test_a_friction_force_within_reach_is_met_whatever_the_steps(wish, steps):
    """In full slip friction is mu times load and attraction, and a given voltage has that attraction too."""
    result = slid(wish, steps)
    assert result.applied_tangential_force[-1] == pytest.approx(wish, rel=1e-7)
    assert result.missed_force[-1] == 0.0
    pressed = result.applied_force[-1] + result.electrostatic_force[-1]
    assert MU * pressed == pytest.approx(wish, rel=1e-7)
    given = ev.simulate(
        ev.Scene(
            ev.FingerPad(resolution="coarse", ridges=False),
            ev.Display(friction=MU),
            ev.Kaczmarek(),
            float(result.voltage[-1]),
            [ev.Press(indentation=float(result.indentation[-1]), steps=4), ev.Slide(distance=3.0, steps=2)],
        )
    )
    assert given.applied_tangential_force[-1] == pytest.approx(wish, rel=1e-6)


@pytest.mark.parametrize(
    ("wish", "steps", "largest", "voltage"), [(0.019, 2, 10_000.0, 0.0), (0.035, 2, 2000.0, 2000.0)]
)
def test_a_friction_force_out_of_reach_is_said_to_be_missed(wish, steps, largest, voltage):
    """Below the friction without a voltage, and beyond the largest one."""
    result = slid(wish, steps, largest)
    assert result.voltage[-1] == voltage
    pressed = result.applied_force[-1] + result.electrostatic_force[-1]
    assert result.applied_tangential_force[-1] == pytest.approx(MU * pressed, rel=1e-7)
    missed = wish - result.applied_tangential_force
    np.testing.assert_allclose(result.missed_force[2:], missed[2:], rtol=1e-12)
    assert (result.missed_force[:2] == 0.0).all()
    said = [one for one in result.warnings if "wished" in one]
    assert len(said) == steps
    reached = f"{result.applied_tangential_force[-1]:.3g}"
    assert said[-1] == f"step {2 + steps}: wished {wish}, reached {reached} N/mm at {voltage:.4g} V"


def test_while_the_pad_sticks_it_is_said_too_and_the_wish_comes_later():
    result = slid(0.035, 6)
    missed = np.flatnonzero(result.missed_force)
    assert missed.tolist() == [2, 3]
    assert [one.split(":")[0] for one in result.warnings if "wished" in one] == ["step 3", "step 4"]
    assert result.voltage[2] == 0.0
    assert result.voltage[3] > result.voltage[4]
    assert result.applied_tangential_force[3] < 0.035


def test_a_run_whose_voltage_is_given_has_no_such_column():
    scene = ev.Scene(
        ev.FingerPad(resolution="coarse", ridges=False), ev.Display(), motion=[ev.Press(force=LOAD, steps=1)]
    )
    result = ev.simulate(scene)
    assert "missed_force" not in result.columns
    assert (result.missed_force == 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("surface", [{}, {"roughness_gap": 0.002}])
def test_strong_and_troxels_attraction_on_a_touchscreen_is_found_in_few_iterations(surface):
    result = ev.simulate(
        ev.Scene(
            ev.FingerPad(resolution="coarse", ridges=False),
            ev.Display(friction=MU, insulator=ev.TOUCHSCREEN),
            ev.StrongTroxel(),
            ev.FollowForce([0.0, 3.0], [0.035, 0.035]),
            [ev.Press(force=LOAD, steps=2), ev.Slide(distance=3.0, steps=6)],
            **surface,
        )
    )
    assert result.missed_force[-1] == 0.0
    assert result.newton_iterations.max() < 200

"""A voltage that is found from a wished friction force: what is met, and what is said to be missed."""

import numpy as np
import pytest
from tools.builders import resumed, small_finger

import evfem as ev

MU, LOAD = 0.4, 0.05


def slid(wish, steps, largest=10_000.0):
    """A smooth pad on film, held, whose slide wishes one friction force (N/mm) everywhere."""
    return ev.simulate(
        ev.Scene(
            ev.FingerPad(resolution="coarse", ridges=False),
            ev.Display(friction=MU),
            ev.Kaczmarek(),
            ev.FollowForce([0.0, 3.0], [wish, wish], largest),
            [ev.Press(force=LOAD, steps=2), ev.Slide(distance=3.0, steps=steps)],
        )
    )


@pytest.mark.parametrize(("wish", "numbers"), [(0.032, [6]), (0.035, [4, 6]), (0.04, [3, 8])])
def test_a_friction_force_within_reach_is_met_whatever_the_steps(wish, numbers):
    """In full slip friction is mu times load and attraction, and a given voltage has that attraction too."""
    results = [slid(wish, steps) for steps in numbers]
    for result in results:
        assert result.applied_tangential_force[-1] == pytest.approx(wish, rel=1e-7)
        assert result.missed_force[-1] == 0.0
        pressed = result.applied_force[-1] + result.electrostatic_force[-1]
        assert MU * pressed == pytest.approx(wish, rel=1e-7)
        assert result.voltage[-1] == pytest.approx(results[0].voltage[-1], rel=1e-6)
    given = ev.simulate(
        ev.Scene(
            ev.FingerPad(resolution="coarse", ridges=False),
            ev.Display(friction=MU),
            ev.Kaczmarek(),
            float(result.voltage[-1]),
            [ev.Press(indentation=float(result.indentation[-1]), steps=1), ev.Slide(distance=3.0, steps=1)],
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
    said = [one for one in result.warnings if "target" in one]
    assert len(said) == steps
    reached = f"{result.applied_tangential_force[-1]:.3g}"
    assert said[-1] == f"step {2 + steps}: target {wish}, reached {reached} N/mm at {voltage:.4g} V"


def test_while_the_pad_sticks_it_is_said_too_and_the_wish_comes_later():
    result = slid(0.035, 6)
    missed = np.flatnonzero(result.missed_force)
    assert missed.tolist() == [2, 3]
    said = [one for one in result.warnings if "target" in one]
    assert [one.split(":")[0] for one in said] == ["step 3", "step 4"]
    assert all(one.endswith(" V, part of the contact sticks") for one in said)
    assert result.voltage[2] == 0.0
    assert result.voltage[3] > result.voltage[4]
    assert result.applied_tangential_force[3] < 0.035


FILE = """
version = 1
[finger]
ridges = false
resolution = "coarse"
[surface]
kind = "flat"
friction = 0.4
[electrostatics]
law = "kaczmarek"
insulator = "film"
voltage = {kind = "follow_force", position = [0, 3], tangential_force = [0.03, 0.035]}
[[motion]]
kind = "press"
force = 0.05
steps = 2
[[motion]]
kind = "slide"
distance = 3.0
steps = 2
"""


def test_a_run_that_is_resumed_misses_the_same():
    text = FILE.replace("[0.03, 0.035]", "[0.035, 0.035]").replace("steps = 2", "steps = 4")
    whole, again = resumed(ev.scenefile.loads(text), 4)
    np.testing.assert_array_equal(again.missed_force, whole.missed_force)
    told = [[one for one in run.warnings if "target" in one] for run in (whole, again)]
    assert told[0] == told[1]
    assert np.flatnonzero(whole.missed_force).tolist() == [4]


def test_a_sweep_varies_what_is_wished(tmp_path):
    """The rows of the wish, and friction; the wish of 0.03 at the start does not count at the end."""
    (tmp_path / "scene.toml").write_text(FILE, encoding="utf-8")
    end = "electrostatics.voltage.tangential_force.1"
    outputs = ("voltage.last", "missed_force.last", "applied_tangential_force.last", "applied_force.last")
    grid = {end: [0.019, 0.03]}
    rows = ev.sweep(ev.Sweep(tmp_path / "scene.toml", grid, outputs=outputs), workers=1).rows
    below, met = rows
    assert below["voltage.last"] == 0.0
    assert below["missed_force.last"] == pytest.approx(0.019 - MU * below["applied_force.last"], rel=1e-7)
    assert met["missed_force.last"] == 0.0
    assert met["applied_tangential_force.last"] == pytest.approx(0.03, rel=1e-7)
    python = slid(0.03, 2).voltage[-1]
    assert met["voltage.last"] == pytest.approx(python, rel=1e-6)


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ("position = [0, 3], tangential_force = [0.03]", "tangential_force"),
        ("position = [3, 0], tangential_force = [0.03, 0.03]", "position"),
        ("position = [0, 3]", "tangential_force"),
        ("position = [0, 3], tangential_force = [0.03, 0.03], largest_voltage = 0", "largest_voltage"),
        ("position = [0, 3], force = [0.03, 0.03]", "force"),
    ],
)
def test_a_mistake_in_the_file_names_its_key(line, key):
    told = 'voltage = {kind = "follow_force", ' + line + "}"
    with pytest.raises(ev.InputError) as error:
        ev.scenefile.loads(FILE.replace(FILE.splitlines()[11], told))
    assert error.value.key == f"electrostatics.voltage.{key}"


def test_a_scene_with_a_wish_is_written_and_read():
    scene = ev.scenefile.loads(FILE.replace("0.035]", "0.035], largest_voltage = 4000.0"))
    again = ev.scenefile.loads(ev.scenefile.dump(scene))
    assert type(again.voltage) is ev.FollowForce
    assert again.voltage.position.tolist() == [0.0, 3.0]
    assert again.voltage.tangential_force.tolist() == [0.03, 0.035]
    assert again.voltage.largest_voltage == 4000.0


def test_a_run_whose_voltage_is_given_has_no_such_column():
    scene = ev.Scene(
        ev.FingerPad(resolution="coarse", ridges=False), ev.Display(), motion=[ev.Press(force=LOAD, steps=1)]
    )
    result = ev.simulate(scene)
    assert not {"missed_force", "missed_gap"} & set(result.columns)
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


def test_an_unloaded_finger_is_pulled_until_its_friction_is_the_wished_one():
    """From the first step on; nothing but the attraction presses it."""
    display = ev.Display(ev.Layer(0.05, 3.5, strength=1e8), friction=0.5)
    wish = ev.FollowForce([0.0, 0.6], [0.002, 0.002], 3000.0)
    motion = [ev.Press(indentation=0.0, steps=1), ev.Slide(0.6, steps=3, hold="force")]
    scene = ev.Scene(small_finger(), display, ev.StrongTroxel(), wish, motion, breakdown="off")
    result = ev.simulate(scene)
    np.testing.assert_allclose(result.applied_force, 0.0, atol=1e-10)
    np.testing.assert_allclose(result.tangential_force[1:], 0.002, rtol=1e-7)
    np.testing.assert_allclose(result.electrostatic_force[2:], 0.004, rtol=1e-7)  # all of it slips

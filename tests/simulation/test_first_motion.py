"""What a scene begins from: a finger that hovers first comes from afar, one that is pressed from touch."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from tools.builders import finger
from tools.meshes import block

import evfem as ev

#: a plate of nu = 0 on its column (MPa, mm), and the gap to which it comes
MODULUS, HEIGHT, GAP = 0.05, 2.0, 0.1
DISPLAY = ev.Display(ev.Layer(0.01, 3.0), friction=0.0)
SKIN = ev.Electrical(0.2, 100.0)
LAYERS = ev.Layers.of(ev.Layer(0.2, 100.0), DISPLAY.insulator).reduced
PULL_IN = np.sqrt(8.0 * MODULUS / HEIGHT * (GAP + LAYERS) ** 3 / 27.0 / ev.eps_0)


def plate(voltage, *motion):
    law = {"tissue": ev.LinearElastic(E=MODULUS, nu=0.0)}
    body = ev.MeshedFinger(block(4, 4, width=2.0, height=HEIGHT), law, electrical=SKIN)
    return ev.Scene(body, DISPLAY, ev.StrongTroxel(), voltage, motion)


def open_gap(voltage):
    """The gap on the stable branch that comes from afar: k x = eps_0/2 U^2/(s + g - x)^2."""
    stiffness = MODULUS / HEIGHT
    found = brentq(
        lambda x: stiffness * x - 0.5 * ev.eps_0 * voltage**2 / (LAYERS + GAP - x) ** 2,
        0.0,
        (GAP + LAYERS) / 3.0,
        xtol=1e-15,
    )
    return GAP - found


WAYS = {
    "at once": [ev.Hover(GAP)],
    "in two steps": [ev.Hover(GAP, steps=2)],
    "in eight steps": [ev.Hover(GAP, steps=8)],
    "from afar": [ev.Hover(0.6), ev.Hover(GAP, steps=6)],
}


@pytest.mark.parametrize("share", [0.5, 0.9, 0.98])
@pytest.mark.parametrize("way", WAYS)
def test_a_finger_that_hovers_first_is_open_below_its_pull_in_voltage(way, share):
    """Between release and pull-in one from first touch would be shut."""
    result = ev.simulate(plate(share * PULL_IN, *WAYS[way]))
    assert result.min_gap[-1] == pytest.approx(open_gap(share * PULL_IN), rel=1e-6)
    assert not result.jumps.any()


def test_its_steps_are_all_there():
    result = ev.simulate(plate(0.9 * PULL_IN, *WAYS["in eight steps"]))
    np.testing.assert_allclose(result.indentation, -GAP, rtol=1e-14)
    np.testing.assert_allclose(result.min_gap, result.min_gap[0], rtol=1e-9)


@pytest.mark.parametrize("steps", [1, 4])
def test_a_pull_in_on_the_way_from_afar_is_counted(steps):
    result = ev.simulate(plate(1.05 * PULL_IN, ev.Hover(GAP, steps=steps)))
    assert result.min_gap[-1] < 1e-9
    assert result.jumps[0] > 0
    assert result.snap_dissipation[0] > 0.1 * result.stored_energy[-1]
    assert any("the finger snaps" in said for said in result.warnings)


def test_a_loop_begins_where_a_scene_does():
    steps = ev.loop(replace(plate(0.9 * PULL_IN, *WAYS["at once"]), motion=[]))
    row = steps.step(indentation=-GAP)
    assert row.min_gap == pytest.approx(open_gap(0.9 * PULL_IN), rel=1e-6)


def test_a_check_goes_the_other_way_too():
    """Shut from first touch where it is open from afar; below the release voltage it is open from both."""
    release = np.sqrt(2.0 * MODULUS / HEIGHT * GAP * LAYERS**2 / ev.eps_0)
    found = ev.check(plate(0.98 * PULL_IN, *WAYS["at once"]))
    off = {row["way"]: row["difference"] for row in found.rows}
    assert off.pop("from first touch") > 1.0
    assert max(off.values()) < 1e-3
    assert not found.agrees
    assert ev.check(plate(0.8 * release, *WAYS["at once"])).agrees


def test_a_check_lets_a_pressed_finger_come_from_afar():
    """Only where something attracts it from the first row on."""
    body = finger(block(8, 3, sag=0.1))
    press = ev.Press(indentation=0.1, steps=2)
    wet = ev.Scene(body, ev.Flat(friction=0.0), motion=press, adhesion=ev.Dugdale(0.002, 0.01))
    found = ev.check(wet)
    assert found.agrees
    assert "from afar" in [row["way"] for row in found.rows]
    dry = ev.check(replace(wet, adhesion=None))
    assert "from afar" not in [row["way"] for row in dry.rows]


def test_the_derivative_by_the_first_gap_is_that_of_the_branch():
    """p = eps_0/2 U^2/(s + d)^2 on 2 mm; d(d)/d(g) = k/(k + p'(d))."""
    voltage = 0.9 * PULL_IN
    scene = plate(voltage, ev.Hover(GAP, steps=2))
    found = ev.sensitivities(scene, "motion.0.gap", "electrostatic_force")
    stiffness, slope = MODULUS / HEIGHT, -ev.eps_0 * voltage**2 / (LAYERS + open_gap(voltage)) ** 3
    expected = 2.0 * slope * stiffness / (stiffness + slope)
    np.testing.assert_allclose(found["electrostatic_force", "motion.0.gap"], expected, rtol=1e-6)

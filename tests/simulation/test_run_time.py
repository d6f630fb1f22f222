"""Runs in which time passes: waiting, voltages over time, and going on in the middle of one."""

import numpy as np
import pytest
from tools.builders import balance, finger
from tools.meshes import block

import evfem as ev
from evfem.simulation.run import Run

#: steps are long on purpose: equal ones are compared with each other
pytestmark = pytest.mark.filterwarnings("ignore:motion . has .* steps in a period of the voltage")

ROUND = finger(block(8, 3, sag=0.4))
PRESS = ev.Press(force=0.02, steps=3)
HUM = ev.Sine(50.0, amplitude=2000.0, bias=300.0)


def run(*motion, voltage=HUM, body=ROUND, friction=0.3, **options):
    return ev.simulate(scene(*motion, voltage=voltage, body=body, friction=friction), **options)


def scene(*motion, voltage=HUM, body=ROUND, friction=0.3, **options):
    return ev.Scene(body, ev.Display(friction=friction), ev.Kaczmarek(), voltage, motion, **options)


@pytest.mark.parametrize("hold", ["indentation", "force"])
def test_a_waiting_finger_feels_the_voltage_of_the_moment(hold):
    result = run(PRESS, ev.Wait(0.02, steps=40, hold=hold), ev.Slide(0.2, steps=4, speed=20.0, hold=hold))
    step = np.concatenate([np.zeros(3), np.full(40, 0.02 / 40), np.full(4, 0.2 / 20.0 / 4)])
    np.testing.assert_allclose(result.time, np.cumsum(step), rtol=1e-12)
    np.testing.assert_allclose(result.voltage, HUM(result.time), rtol=1e-12, atol=1e-9)
    assert result.motion[3] == "wait"
    assert not result.position[:43].any()
    assert balance(result).max() < 1e-7
    kept = result.applied_force if hold == "force" else result.indentation
    free = result.indentation if hold == "force" else result.applied_force
    np.testing.assert_allclose(kept[3:], kept[2], rtol=1e-8)
    assert np.ptp(free[3:43]) > 1e-4 * abs(free[2])
    # the attraction goes with the square of the voltage: at its largest, a quarter of a period on
    assert int(np.argmax(result.electrostatic_force[3:43])) == 9
    assert result.electrostatic_force[12] / result.electrostatic_force[2] > (2300.0 / 300.0) ** 2


def test_a_loose_finger_stays_at_its_height_until_a_voltage_acts():
    """It has no force at any height: that of the moment before, zero, would hold it at none."""
    hold = {"steps": 3, "hold": "force"}
    motion = [ev.Press(indentation=-0.05, steps=1), ev.Slide(0.2, speed=20.0, **hold)]
    motion += [ev.Wait(0.1, **hold), ev.VoltageRamp(1500.0, **hold)]
    for dynamics in ("quasistatic", "viscous", "inertial"):
        body = finger(block(8, 3, sag=0.4), viscosity=5e-3 * (dynamics != "quasistatic"))
        result = ev.simulate(scene(*motion, voltage=0.0, body=body, solver=ev.Solver(dynamics=dynamics)))
        assert result.indentation[:7].tolist() == [-0.05] * 7
        assert np.abs(result.applied_force[:7]).max() < 1e-9
        assert result.contact_width[7] > 0.0  # nothing holds it against an attraction


@pytest.mark.parametrize("along", [ev.Wait(0.1, steps=8, hold="force"), ev.Slide(0.4, 8, 4.0, "force")])
def test_a_loose_finger_is_lifted_by_the_tissue_that_recovers_below_it(along):
    """Without a force the tissue creeps back at its own rate, and the bone stands as high as that needs: once
    little is left of the indentation, it falls in each step of backward Euler by 1 + dt / tau, where that
    was not cut.
    """
    body, tau = finger(block(8, 3, sag=0.4), viscosity=5e-3), 5e-3
    motion = [ev.Press(indentation=0.4, steps=4, speed=20.0), ev.Press(indentation=0.2, steps=4, speed=400.0)]
    motion.append(along)
    result = ev.simulate(scene(*motion, voltage=0.0, body=body, solver=ev.Solver(dynamics="viscous")))
    assert np.abs(result.applied_force[4:]).max() < 1e-12
    left = result.indentation[7:]
    assert left[0] == 0.2
    factor = (left[5:] / left[4:-1])[result.substeps[-4:] == 1]
    assert factor.size
    np.testing.assert_allclose(factor, 1.0 / (1.0 + 0.1 / 8 / tau), rtol=1e-3)


def test_a_loose_finger_is_lifted_by_crests_and_stays_there():
    """It slides from a trough over the crest, halfway, and on: no step goes down again."""
    wave = ev.Sinusoid(terms=[[0.1, 2.0 * np.pi / 3.0, -0.5 * np.pi]], friction=0.0)
    lifted = [ev.Press(indentation=0.1, steps=2), ev.Press(indentation=-0.005, steps=1)]
    body = finger(block(8, 3, sag=0.4))
    over = [*lifted, ev.Slide(2.4, steps=16, hold="force"), ev.Slide(0.6, steps=4, hold="force")]
    result = ev.simulate(ev.Scene(body, wave, motion=over))
    assert np.abs(result.applied_force[3:]).max() < 1e-12
    assert result.min_gap.min() > -1e-9
    assert (np.diff(result.indentation[2:]) < 1e-12).all()  # nothing pulls it down again
    assert result.indentation[-1] == result.indentation[12] < result.indentation[4] < -0.005


def test_a_finger_that_just_touches_is_loose():
    """Its force is rounding, which would be held in the next motion."""
    going = Run(scene(PRESS, ev.Wait(0.1), voltage=0.0), None)
    row = dict.fromkeys(
        ("position", "indentation", "applied_force", "voltage", "electrostatic_force", "adhesive_force"), 0.0
    )
    for force, loose in ((0.0, True), (1e-17, True), (-1e-17, True), (1e-8, False)):
        going.rows = [row | {"normal_force": force}]
        assert going.start_of(1)["loose"] == loose


@pytest.mark.filterwarnings("ignore:motion . has steps of")
def test_a_bone_that_stops_has_no_speed_left_of_the_part_before():
    """Backward differences of second order would give it r/(1 + r) of the speed before, backwards."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    motion = [ev.Press(indentation=0.3, steps=4, speed=10.0), ev.Wait(duration=0.03, steps=3)]
    at_speed = ev.Scene(pad, ev.Flat(), motion=motion, solver=ev.Solver(dynamics="inertial"))
    going, speeds = Run(at_speed, None), []
    bone = going.model.mesh.node_sets["bone"][0]
    for request in going.requests():
        going.advance(request)
        speeds.append(float(going.state.memory["velocity"][bone, 1]))
    assert speeds == pytest.approx([-10.0] * 4 + [0.0] * 3, abs=1e-9)

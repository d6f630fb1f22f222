"""Derivatives of a voltage that is found from a wished friction force, beside differences of whole runs."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tools.builders import small_finger

import evfem as ev

WISH, MU, LOAD = 0.03, 0.4, 0.05
ROWS = ["electrostatics.voltage.tangential_force.0", "electrostatics.voltage.tangential_force.1"]
KEYS = ["surface.friction", "electrostatics.insulator_thickness", "motion.0.force"]
#: changes of the parameters for differences of runs, and where `followed` has them
STEPS = {"surface.friction": ("mu", 1e-4), "motion.0.force": ("load", 1e-5), "wish": ("wish", 1e-6)}


def followed(mu=MU, load=LOAD, wish=WISH, steps=2, largest=10_000.0):
    return ev.Scene(
        small_finger(),
        ev.Display(friction=mu),
        ev.Kaczmarek(),
        ev.FollowForce([0.0, 3.0], [wish, wish], largest),
        [ev.Press(force=load, steps=2), ev.Slide(distance=3.0, steps=steps)],
        solver=ev.Solver(tolerance=1e-11),
    )


@cache
def differences(name, column, **given):
    """The derivative (steps,) of a column by differences of runs."""
    key, step = STEPS[name]
    centre = followed(**given)
    usual = {"mu": MU, "load": LOAD, "wish": float(centre.voltage.tangential_force[0])}[key]
    runs = [ev.simulate(followed(**{**given, key: usual + side * step})) for side in (1.0, -1.0)]
    return (runs[0][column] - runs[1][column]) / (2.0 * step)


def test_the_voltage_of_a_force_has_the_derivatives_of_runs_and_of_coulombs_law():
    found = ev.sensitivities(followed(), [*KEYS, *ROWS], ["voltage", "missed_force", "electrostatic_force"])
    for key in ("surface.friction", "motion.0.force"):
        np.testing.assert_allclose(found["voltage", key], differences(key, "voltage"), rtol=1e-5)
    by_rows = sum(found["voltage", row] for row in ROWS)
    np.testing.assert_allclose(by_rows, differences("wish", "voltage"), rtol=1e-5)
    # mu (N + F_e) = F, and the indentation is held: dF_e/dF = 1/mu - dN/dF
    pressed = found.result.applied_force[-1] + found.result.electrostatic_force[-1]
    assert MU * pressed == pytest.approx(WISH, rel=1e-8)
    assert all((found["missed_force", key] == 0.0).all() for key in KEYS)


@pytest.mark.slow
def test_while_the_pad_sticks_the_voltage_at_which_it_would_slip_has_a_derivative_too():
    """Steps 3 and 4 miss the wish: the first keeps 0 V, the second has the bound of friction."""
    given = {"wish": 0.035, "steps": 6}
    found = ev.sensitivities(followed(**given), KEYS[::2], ["voltage", "missed_force"])
    assert np.flatnonzero(found.result.missed_force).tolist() == [2, 3]
    for key in KEYS[::2]:
        for column in ("voltage", "missed_force"):
            known = differences(key, column, **given)
            np.testing.assert_allclose(found[column, key], known, rtol=1e-5, atol=1e-6)


def test_at_its_bounds_the_voltage_has_no_derivative_but_the_missed_force_has():
    for given, bound in (({"wish": 0.019}, 0.0), ({"largest": 2000.0}, 2000.0)):
        found = ev.sensitivities(followed(**given), ["surface.friction"], ["voltage", "missed_force"])
        assert found.result.voltage[-1] == bound
        np.testing.assert_allclose(found["voltage", "surface.friction"], 0.0, atol=1e-4)
        pressed = found.result.missed_force[-1]
        assert pressed != 0.0
        known = differences("surface.friction", "missed_force", **given)
        np.testing.assert_allclose(found["missed_force", "surface.friction"], known, rtol=1e-5, atol=1e-9)
    # a wish that falls below what there is without a voltage, after one that was met
    falling = ev.FollowForce([0.0, 2.0, 2.0, 3.0], [0.03, 0.03, 0.015, 0.015])
    found = ev.sensitivities(replace(followed(), voltage=falling), ["surface.friction"], ["voltage"])
    assert found.result.missed_force[2] == 0.0 < found.result.voltage[2]
    assert found.result.voltage[3] == 0.0
    assert found["voltage", "surface.friction"][-1] == 0.0
    found = ev.sensitivities(
        followed(largest=2000.0), ["electrostatics.voltage.largest_voltage"], ["voltage"]
    )
    assert found["voltage", "electrostatics.voltage.largest_voltage"][-1] == pytest.approx(1.0, rel=1e-9)


def test_a_derivative_holds_until_the_voltage_comes_to_a_bound():
    """Nothing but its upper bound depends on the largest voltage: they meet at the voltage that is found."""
    most = "electrostatics.voltage.largest_voltage"
    found = ev.sensitivities(followed(), [most], ["voltage"])
    reach = 10_000.0 - found.result.voltage[2:]
    np.testing.assert_allclose(found.valid_to[most][2:], reach, rtol=1e-6)


def test_the_voltage_for_more_friction_has_an_interval():
    """Contributions are derivatives times standard deviations, and one run says how true they are."""
    sd = {"surface.friction": 0.004, "motion.0.force": 0.001}
    sure = ev.uncertainty(followed(), sd, ["voltage"])
    parts = [differences(key, "voltage")[-1] * sd[key] for key in sd]
    assert sure.sd["voltage"][-1] == pytest.approx(np.hypot(*parts), rel=1e-5)
    assert sure.checked.key == "motion.0.force"
    assert sure.checked.by_run == pytest.approx(sure.checked.by_derivative, rel=0.05)

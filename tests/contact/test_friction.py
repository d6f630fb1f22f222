"""Coulomb's law and its return map: the three states by hand, derivatives by differences, dissipation."""

import numpy as np
import pytest

from evfem.contact.friction import cone_excess, return_map
from evfem.tensor import complex_step

MU, PENALTY = 0.3, 50.0
rng = np.random.default_rng(3)


def test_stick_slip_and_open_by_hand():
    # limit mu p = 0.6; trials -50 * 0.01 = -0.5 (stick), -50 * 0.02 = -1 (slip), slip the other way, open
    slip = np.array([0.01, 0.02, -0.02, 0.02])
    pressure = np.array([2.0, 2.0, 2.0, 0.0])
    result = return_map(slip, np.zeros(4), pressure, MU, PENALTY)
    np.testing.assert_allclose(result.shear, [-0.5, -0.6, 0.6, 0.0], rtol=1e-14)
    # the stick under the limit is 0.6 / 50 = 0.012 long
    np.testing.assert_allclose(result.history, [0.0, 0.008, -0.008, 0.02], atol=1e-16)
    assert result.slipping.tolist() == [False, True, True, False]


def test_shear_opposes_the_motion():
    result = return_map(np.array([1.0, -1.0]), np.zeros(2), np.ones(2), MU, PENALTY)
    assert np.sign(result.shear).tolist() == [-1.0, 1.0]


def test_the_cone_is_never_left_and_is_met_in_slip():
    slip, history, pressure = rng.uniform(-0.05, 0.05, (3, 200))
    result = return_map(slip, history, pressure, MU, PENALTY)
    excess = cone_excess(result.shear, pressure, MU)
    assert excess.max() <= 1e-15
    np.testing.assert_allclose(excess[result.slipping], 0.0, atol=1e-15)
    assert not result.shear[pressure < 0.0].any()


def test_derivatives_are_those_of_the_traction():
    slip, history = rng.uniform(-0.05, 0.05, (2, 200))
    pressure = rng.uniform(-1.0, 4.0, 200)
    result = return_map(slip, history, pressure, MU, PENALTY)
    assert 20 < result.slipping.sum() < 180
    by_slip = complex_step(lambda s: return_map(s, history, pressure, MU, PENALTY).shear, slip)
    by_pressure = complex_step(lambda p: return_map(slip, history, p, MU, PENALTY).shear, pressure)
    np.testing.assert_allclose(result.by_slip, by_slip, rtol=1e-14)
    np.testing.assert_allclose(result.by_pressure, by_pressure, rtol=1e-14)
    h = 1e-7
    ahead, behind = (return_map(slip + s * h, history, pressure, MU, PENALTY).shear for s in (1, -1))
    np.testing.assert_allclose(result.by_slip, (ahead - behind) / (2 * h), rtol=1e-6, atol=1e-6)


def test_an_open_point_has_no_stiffness_even_at_rest():
    result = return_map(np.zeros(1), np.zeros(1), np.zeros(1), MU, PENALTY)
    assert result.by_slip == result.by_pressure == result.shear == 0.0


def test_committing_the_history_changes_no_traction():
    slip, history = rng.uniform(-0.05, 0.05, (2, 100))
    pressure = rng.uniform(0.5, 4.0, 100)
    first = return_map(slip, history, pressure, MU, PENALTY)
    again = return_map(slip, first.history, pressure, MU, PENALTY)
    np.testing.assert_allclose(again.shear, first.shear, rtol=1e-12)


def test_a_closed_cycle_dissipates_the_area_of_its_loop():
    # amplitude a, limit T: four straights of rigid-plastic slip less the stick's length 2 T/k: 4 T (a - T/k)
    a, pressure, limit = 0.1, np.array(2.0), 0.6
    path = np.concatenate([np.linspace(0, a, 200), np.linspace(a, -a, 400), np.linspace(-a, a, 400)])
    history, work, shear = np.zeros(()), 0.0, 0.0
    for i in range(1, len(path)):
        step = return_map(path[i : i + 1][0], history, pressure, MU, PENALTY)
        if i >= 200:
            work -= 0.5 * (shear + step.shear) * (path[i] - path[i - 1])
        history, shear = step.history, step.shear
    assert work == pytest.approx(4.0 * limit * (a - limit / PENALTY), rel=2e-3)


def test_friction_per_point_and_without_friction():
    slip = np.array([0.1, 0.1])
    result = return_map(slip, np.zeros(2), np.ones(2), np.array([0.0, 0.5]), PENALTY)
    np.testing.assert_allclose(result.shear, [0.0, -0.5], atol=1e-16)

"""Layers that relax: charges and polarisations against a matrix exponential and the phasor."""

import numpy as np
import pytest

import evfem as ev
from evfem.electrostatics.dielectrics import debye_layer, seen_at
from evfem.electrostatics.laws import eps_0
from evfem.electrostatics.relaxation import Sandwich

#: two poles in the skin, one slower and one faster than a cycle, and one in the film
SKIN = ev.Layer(0.30, ev.Dielectric(80.0, [(900.0, 2e-3, 0.0), (300.0, 2e-5, 0.0)], 2e-4))
FILM = ev.Layer(0.001, ev.Dielectric(3.0, [(0.9, 5e-4, 0.0)], 1e-10))
LEAK = 1e-8
STACK = Sandwich.of(SKIN, FILM, frequency=None, gap_conductivity=LEAK, gap_eps_r=1.0)
GAPS = np.array([0.0, 1e-3, 5e-3])


def system(gap):
    """The equations of motion of (x_1, x_2, p, p, p) as they stand in the head of the file."""
    thickness, low = np.array([0.30, gap, 0.001]), np.array([80.0, 1.0, 3.0])
    kappa = np.array([2e-4, LEAK, 1e-10]) / eps_0
    owner, strength, tau = np.array([0, 0, 2]), np.array([900.0, 300.0, 0.9]), np.array([2e-3, 2e-5, 5e-4])

    def rate(x, volts):
        # D_1 = D - x_1, D_3 = D + x_2, E = (D - p) / eps_inf, and their voltages add up
        offset = np.array([-x[0], 0.0, x[1]])
        np.subtract.at(offset, owner, x[2:])
        D = (volts - np.sum(thickness / low * offset)) / np.sum(thickness / low)
        E = (D + offset) / low
        J = kappa * E
        return np.concatenate([[J[0] - J[1], J[1] - J[2]], (strength * E[owner] - x[2:]) / tau])

    matrix = np.stack([rate(e, 0.0) for e in np.eye(5)], axis=1)
    return matrix, rate(np.zeros(5), 1.0)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("seconds", [1e-6, 3e-4, 2e-2])
def test_the_state_after_a_ramp_is_that_of_a_matrix_exponential(gap, seconds):
    from scipy.linalg import expm

    matrix, push = system(gap)
    whole = np.zeros((7, 7))
    whole[:5, :5], whole[:5, 5], whole[5, 6] = matrix, push, 1.0 / seconds
    start = np.array([4e3, -9e2, 2e4, -1e3, 5e2])
    expected = (expm(seconds * whole) @ [*start, 20.0, 80.0])[:5]
    found = STACK.after(gap, start, 20.0, 100.0, seconds)
    np.testing.assert_allclose(found, expected, atol=1e-11 * np.abs(expected).max())


def test_no_rate_of_the_layers_is_above_the_fastest():
    rates = [-np.linalg.eigvals(system(gap)[0]).real for gap in (*GAPS, 10.0)]
    assert np.max(rates) < STACK.fastest < 5.0 * np.max(rates)


def test_without_poles_and_without_seconds_it_is_the_sandwich():
    skin = ev.Layer(0.30, ev.Dielectric(1136.0, (), 2e-4))
    plain = Sandwich.of(skin, ev.TOUCHSCREEN, frequency=75.0, gap_conductivity=LEAK, gap_eps_r=1.2)
    faint = ev.Layer(0.30, ev.Dielectric(1136.0, [(1e-11, 1e-3, 0.0)], 2e-4))
    same = Sandwich.of(faint, ev.TOUCHSCREEN, frequency=75.0, gap_conductivity=LEAK, gap_eps_r=1.2)
    assert (plain.states, same.states) == (2, 3)
    both = (
        np.array([[4e3, 1e3, -50.0], [-9e2, 2e4, 30.0]]),
        np.array([[4e3, 1e3, -50.0], [-9e2, 2e4, 30.0], [0.0] * 3]),
    )
    np.testing.assert_array_equal(same.after(GAPS, both[1], 5.0, 9.0, 0.0), both[1])
    ends = [
        one.after(GAPS, start, 20.0, 100.0, 1e-3)[:2] for one, start in zip((plain, same), both, strict=True)
    ]
    np.testing.assert_allclose(ends[1], ends[0], atol=1e-11 * np.abs(ends[0]).max())
    for name in ("effective", "energy", "loss", "crossing", "fields"):
        one, other = (
            getattr(stack, name)(GAPS, 70.0, start) for stack, start in zip((plain, same), both, strict=True)
        )
        np.testing.assert_allclose(other, one, rtol=1e-11)


def test_what_becomes_a_sum_of_debye_poles():
    dry = ev.Layer(0.30, ev.electrostatics.SKINS["gabriel_dry"])
    assert debye_layer(SKIN, 75.0) is SKIN
    assert debye_layer(ev.TOUCHSCREEN, 75.0) is ev.TOUCHSCREEN
    fitted = debye_layer(dry, 1e6)  # the band is widened to ten times the frequency
    f = np.geomspace(1.0, 1e7, 50)
    found = np.asarray(fitted.eps_r.permittivity(f))
    np.testing.assert_allclose(found, dry.eps_r.permittivity(f), rtol=3e-3)
    assert seen_at(SKIN, None) == (1280.0, 2e-4)
    assert seen_at(dry, 1000.0)[0] == pytest.approx(1135.62, abs=5e-3)

    class Own:
        def permittivity(self, frequency):
            return 5.0 + 0.0 * frequency

    with pytest.raises(ev.InputError, match="a Dielectric or a DielectricTable"):
        debye_layer(ev.Layer(0.1, Own()), 75.0)

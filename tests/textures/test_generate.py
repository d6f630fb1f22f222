"""Generators: the spectra, sizes and shapes that their definitions give."""

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.textures.generate import PERIODS, Knobs, make


def amplitudes(texture):
    """Amplitude of each whole number of waves in the period."""
    return 2.0 * np.abs(np.fft.rfft(texture.values)) / texture.values.size


@pytest.mark.parametrize("kind", ["sinusoids", "self_affine", "spectral"])
@pytest.mark.parametrize("irregularity", [0.0, 0.4, 1.0])
def test_amplitude_is_that_of_the_sine_with_the_same_rms(kind, irregularity):
    texture = make(kind, Knobs(0.5, 0.02, irregularity, seed=3))
    assert np.std(texture.values) == pytest.approx(0.02 / np.sqrt(2.0), rel=1e-9)
    assert texture.period == PERIODS / 0.5


def test_sinusoids_without_irregularity_are_two_waves():
    found = amplitudes(make("sinusoids", Knobs(0.5, 0.02, second=0.25, phase=0.3)))
    assert found[PERIODS] == pytest.approx(0.02)
    assert found[2 * PERIODS] == pytest.approx(0.005)
    found[[PERIODS, 2 * PERIODS]] = 0.0
    assert found.max() < 1e-12


def test_the_phase_of_the_second_harmonic_is_that_of_the_formula():
    texture = make("sinusoids", Knobs(0.5, 0.02, second=0.25, phase=0.3))
    q = 2.0 * np.pi * 0.5
    formula = 0.02 * (np.sin(q * texture.x) + 0.25 * np.sin(2.0 * q * texture.x + 0.3))
    np.testing.assert_allclose(texture.values, formula, atol=1e-14)


@pytest.mark.parametrize(
    ("kind", "knobs", "exponent"),
    [
        ("self_affine", Knobs(0.5, 0.02, hurst=0.8), 2.6),
        ("self_affine", Knobs(0.5, 0.02, irregularity=0.5), 2.0),
        ("spectral", Knobs(0.5, 0.02, beta=1.5), 1.5),
        ("spectral", Knobs(0.5, 0.02, irregularity=1.0), 0.0),
    ],
)
def test_power_falls_with_the_exponent_within_the_band_and_is_nothing_beside_it(kind, knobs, exponent):
    power = amplitudes(make(kind, knobs)) ** 2
    band = np.arange(PERIODS, 8 * PERIODS + 1)
    slope = np.polyfit(np.log(band), np.log(power[band]), 1)[0]
    assert slope == pytest.approx(-exponent, abs=1e-6)
    beside = np.delete(power, band)
    assert beside.max() < 1e-20


def test_a_regular_grating_repeats_and_is_twice_the_amplitude_deep():
    texture = make("grating", Knobs(0.5, 0.02))
    one = texture.values.reshape(PERIODS, -1)
    np.testing.assert_allclose(one, one[:1] * np.ones((PERIODS, 1)), atol=1e-12)
    assert np.ptp(texture.values) == pytest.approx(0.04)


def test_an_irregular_grating_has_no_jumps_and_uneven_grooves():
    texture = make("grating", Knobs(0.5, 0.02, 1.0, seed=5))
    depths = -texture.values.reshape(PERIODS, -1).min(axis=1)
    assert np.ptp(depths) > 0.1 * 0.04
    assert depths.min() >= 0.5 * 0.04 * (1.0 - 1e-9)
    assert depths.max() <= 1.5 * 0.04
    steps = np.abs(np.diff(np.append(texture.values, texture.values[0])))
    assert steps.max() < 0.06 * np.pi / 2.0 / 0.5 * texture.x[1] * 1.01  # steepest slope of a wall


def test_the_seed_says_which_one_it_is():
    one, same, other = (make("spectral", Knobs(irregularity=0.5, seed=s)).values for s in (1, 1, 2))
    assert one.tolist() == same.tolist()
    assert np.abs(one - other).max() > 1e-3


@pytest.mark.parametrize(
    ("key", "value"), [("frequency", 0.0), ("irregularity", 1.5), ("hurst", -0.1), ("seed", -1)]
)
def test_knobs_out_of_range_are_refused(key, value):
    with pytest.raises(InputError, match=key):
        Knobs(**{key: value})

"""What a law sees of an alternating voltage: mean over the cycle, harmonics, envelopes."""

import numpy as np
import pytest

import evfem as ev
from evfem.electrostatics import alternating_pressure, square_wave_pressure
from evfem.electrostatics.drive import CycleMean, harmonics, mean_law

SOLIDS = (ev.Layer(0.30, ev.electrostatics.SKINS["gabriel_dry"]), ev.TOUCHSCREEN)
GAPS = np.array([0.0, 1e-3, 0.02])


def test_the_mean_law_of_a_sine_is_the_closed_form():
    drive = ev.Drive(frequency=75.0, skin="gabriel_dry", gap_conductivity=1e-8)
    law, layers = mean_law(ev.StrongTroxel(), drive, 75.0, SOLIDS)
    given = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
    expected = alternating_pressure(GAPS, 70.0, 75.0, **given, gap_conductivity=1e-8)
    np.testing.assert_allclose(law.traction(GAPS, 70.0, layers), expected, rtol=1e-14)


@pytest.mark.parametrize(("frequency", "error"), [(15.0, 2e-6), (60.0, 1e-7), (1920.0, 1e-9)])
def test_the_mean_law_of_a_square_wave_is_its_closed_form(frequency, error):
    drive = ev.Drive(frequency=frequency, waveform="square", gap_conductivity=1e-8)
    law, layers = mean_law(ev.StrongTroxel(), drive, frequency, (ev.TOUCHSCREEN,))
    exact = square_wave_pressure(frequency, 1e-3, 100.0, insulator=ev.TOUCHSCREEN, gap_conductivity=1e-8)
    assert law.traction(1e-3, drive.peak(100.0), layers) == pytest.approx(exact, rel=error)


def test_harmonics_are_those_of_a_square_wave():
    order, weight = harmonics()
    np.testing.assert_allclose(weight[:5], 8.0 / (np.pi * np.array([1, 3, 5, 7, 9])) ** 2, rtol=1e-14)
    assert weight.sum() == pytest.approx(1.0, abs=1e-14)
    assert (np.diff(order) > 0.0).all()


@pytest.mark.parametrize("law", [ev.StrongTroxel(), ev.Kaczmarek()])
def test_the_mean_over_harmonics_has_its_own_potential_and_derivative(law):
    drive = ev.Drive(frequency=60.0, waveform="square", gap_conductivity=1e-8)
    skin = ev.Layer(np.full(3, 0.30), ev.electrostatics.SKINS["gabriel_dry"])
    mean, layers = mean_law(law, drive, 60.0, (skin, ev.TOUCHSCREEN))
    assert isinstance(mean, CycleMean)
    step = 1e-30
    pressure = mean.traction(GAPS, 70.0, layers)
    assert pressure.shape == GAPS.shape
    np.testing.assert_allclose(
        mean.potential(GAPS + 1j * step, 70.0, layers).imag / step, pressure, rtol=1e-9
    )
    slope = mean.traction(GAPS + 1j * step, 70.0, layers).imag / step
    np.testing.assert_allclose(mean.traction_derivative(GAPS, 70.0, layers), slope, rtol=1e-10)


def test_amplitude_modulation_of_the_mean():
    """p / p0 = 1 + m^2/2 + 2 m cos W t + (m^2/2) cos 2 W t, with the carrier's mean."""
    m, low, U = 0.5, 5.0, 100.0
    envelope = ev.Sine(low, m * U, bias=U, phase=np.pi / 2.0)
    carrier = ev.Carrier(10_000.0, envelope, resolved=False)
    t = np.linspace(0.0, 0.4, 37)
    p0 = ev.StrongTroxel().traction(1e-3, U / np.sqrt(2.0), ev.Layers.of(ev.TOUCHSCREEN))
    found = ev.StrongTroxel().traction(1e-3, carrier(t), ev.Layers.of(ev.TOUCHSCREEN)) / p0
    wt = 2.0 * np.pi * low * t
    expected = 1.0 + m**2 / 2.0 + 2.0 * m * np.cos(wt) + m**2 / 2.0 * np.cos(2.0 * wt)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_peaks_and_signals():
    assert ev.Drive(50.0).peak(100.0) == pytest.approx(141.4213562)
    assert ev.Drive(50.0, "square").peak(100.0) == 100.0
    assert ev.Drive(50.0, resolved=True).signal(100.0) == ev.Sine(50.0, 100.0 * np.sqrt(2.0))
    assert ev.Drive(50.0, "square", resolved=True).signal(-100.0) == ev.Square(50.0, 100.0)
    assert ev.Drive(resolved=True).signal(-100.0) == -100.0


def test_a_square_wave_flips_at_the_time_of_the_step_that_ends_there():
    square = ev.Square(75.0, 100.0)
    steps = np.arange(1, 41) / 40 * 2 / 75.0
    expected = np.where((np.arange(1, 41) // 10) % 2 == 0, 100.0, -100.0)
    np.testing.assert_array_equal(square(steps), expected)
    assert square.largest == 100.0
    assert square.highest_frequency == 75.0


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"frequency": 0.0}, "frequency: given 0"),
        ({"frequency": 5.0, "waveform": "saw"}, "waveform"),
        ({"frequency": 5.0, "skin": "leather"}, "skin"),
        ({"frequency": 5.0, "skin": 0.5}, "skin: given 0.5"),
        ({"frequency": 5.0, "skin": [1.0]}, "skin"),
        ({"frequency": 5.0, "gap_conductivity": -1.0}, "gap_conductivity"),
        ({"frequency": 5.0, "resolved": 1}, "resolved"),
    ],
)
def test_drives_that_cannot_be_are_refused(given, message):
    with pytest.raises(ev.InputError, match=message):
        ev.Drive(**given)

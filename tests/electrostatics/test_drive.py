"""What a law sees of an alternating voltage: mean over the cycle, harmonics, envelopes."""

import numpy as np
import pytest

import evfem as ev
from evfem.electrostatics import alternating_pressure, square_wave_pressure
from evfem.electrostatics.drive import CycleMean, mean_law, powers
from evfem.electrostatics.laws import eps_0

SOLIDS = (ev.Layer(0.30, ev.electrostatics.SKINS["gabriel_dry"]), ev.TOUCHSCREEN)
GAPS = np.array([0.0, 1e-3, 0.02])
#: of each of these gaps
NODES = (ev.Layer(np.full(3, 0.30), ev.electrostatics.SKINS["gabriel_dry"]), ev.TOUCHSCREEN)


def test_the_mean_law_of_a_sine_is_the_closed_form():
    drive = ev.Drive(frequency=75.0, skin="gabriel_dry", gap_conductivity=1e-8)
    law, layers = mean_law(ev.StrongTroxel(), drive, 75.0, SOLIDS)
    given = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
    expected = alternating_pressure(GAPS, 70.0, 75.0, **given, gap_conductivity=1e-8)
    np.testing.assert_allclose(law.traction(GAPS, 70.0, layers), expected, rtol=1e-14)


@pytest.mark.parametrize(
    ("frequency", "error"),
    [(1e-3, 5e-5), (0.01, 2e-5), (0.1, 2e-5), (1.0, 2e-5), (15.0, 2e-6), (60.0, 1e-7), (1920.0, 1e-9)],
)
def test_the_mean_law_of_a_square_wave_is_its_closed_form(frequency, error):
    drive = ev.Drive(frequency=frequency, waveform="square", gap_conductivity=1e-8)
    law, layers = mean_law(ev.StrongTroxel(), drive, frequency, (ev.TOUCHSCREEN,))
    exact = square_wave_pressure(frequency, 1e-3, 100.0, insulator=ev.TOUCHSCREEN, gap_conductivity=1e-8)
    assert law.traction(1e-3, drive.peak(100.0), layers) == pytest.approx(exact, rel=error)


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


@pytest.mark.parametrize("leak", [0.0, 1e-8])
def test_the_mean_of_a_sine_with_a_bias_is_a_direct_and_an_alternating_part(leak):
    """Without leak the skin is shorted under the bias; a leaking gap over glass has no direct field."""
    wave = ev.Sine(75.0, 100.0, bias=60.0)
    drive = ev.Drive(skin="gabriel_dry", gap_conductivity=leak)
    effective = powers(wave)[0]
    assert effective == pytest.approx(np.sqrt(60.0**2 + 5000.0))
    law, layers = mean_law(ev.StrongTroxel(), drive, 75.0, NODES, wave)
    given = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
    expected = alternating_pressure(GAPS, 100.0 / np.sqrt(2.0), 75.0, **given, gap_conductivity=leak)
    if leak == 0.0:
        expected = expected + ev.StrongTroxel().traction(GAPS, 60.0, ev.Layers.of(ev.TOUCHSCREEN))
    np.testing.assert_allclose(law.traction(GAPS, effective, layers), expected, rtol=1e-12)


def test_the_direct_part_divides_as_resistances_do():
    """A film that conducts too: E_g = U / (g + sigma_g sum d / sigma)."""
    film = ev.Layer(0.001, ev.Dielectric(3.9, (), 1e-9))
    skin = ev.Layer(np.full(3, 0.30), ev.Dielectric(1136.0, (), 2e-4))
    drive = ev.Drive(gap_conductivity=1e-8)
    law, layers = mean_law(ev.StrongTroxel(), drive, 75.0, (skin, film), ev.Sine(75.0, 0.0, bias=60.0))
    field = 60.0 / (GAPS + 1e-8 * (0.30 / 2e-4 + 0.001 / 1e-9))
    np.testing.assert_allclose(law.traction(GAPS, 60.0, layers), 0.5 * eps_0 * field**2, rtol=1e-12)


def test_the_mean_of_samples_that_repeat():
    """A triangle by its samples: with two of them, 8 A^2 / (pi n)^4 of its odd harmonics; its mean
    without losses is that of its effective voltage.
    """
    triangle = ev.Sampled([100.0, -100.0], rate=150.0, repeat=True)
    effective, order, share = powers(triangle)
    assert effective == pytest.approx(100.0 / np.sqrt(3.0), rel=1e-12)
    n = order[:4]
    np.testing.assert_array_equal(n, [1.0, 3.0, 5.0, 7.0])
    np.testing.assert_allclose(
        share[:4] * effective**2, 0.5 * (8.0 * 100.0 / (np.pi * n) ** 2) ** 2, rtol=1e-12
    )
    assert share.sum() == pytest.approx(1.0, abs=1e-12)
    drive = ev.Drive()
    film = ev.Layer(np.full(3, 0.001), 3.9)
    law, layers = mean_law(ev.StrongTroxel(), drive, 75.0, (film,), triangle)
    plain = ev.StrongTroxel().traction(GAPS, effective, ev.Layers.of(ev.TOUCHSCREEN))
    np.testing.assert_allclose(law.traction(GAPS, effective, layers), plain, rtol=1e-12)
    assert powers(ev.Sampled([1.0, 2.0], rate=5.0)) is None
    fine = ev.Sampled(60.0 + 100.0 * np.sin(2.0 * np.pi * np.arange(256) / 256.0), 256.0 * 75.0, repeat=True)
    leaky = ev.Drive(skin="gabriel_dry", gap_conductivity=1e-8)
    sampled, exact = (
        mean_law(ev.StrongTroxel(), leaky, 75.0, NODES, one)
        for one in (fine, ev.Sine(75.0, 100.0, bias=60.0))
    )
    volts = powers(fine)[0], powers(ev.Sine(75.0, 100.0, bias=60.0))[0]
    one, other = (
        law.traction(GAPS, U, layers) for (law, layers), U in zip((sampled, exact), volts, strict=True)
    )
    np.testing.assert_allclose(one, other, rtol=1e-3)


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

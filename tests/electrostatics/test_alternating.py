"""Plates under alternating, stepped and square voltage: printed numbers, limits, other methods.

The numbers were computed with the electric constant of CODATA 2018, 7e-10 above that of 2022, which
their tenth digit shows.
"""

from itertools import pairwise

import numpy as np
import pytest

import evfem as ev
from evfem.electrostatics import (
    alternating_pressure,
    complex_length,
    corner_frequencies,
    square_wave_pressure,
    step_pressure,
    step_rates,
)
from evfem.electrostatics.laws import eps_0
from evfem.electrostatics.relaxation import Relaxing, Sandwich

CODATA_2018 = 8.8541878128e-12 / eps_0
FREQUENCIES = np.array([1.0, 10.0, 30.0, 75.0, 250.0, 1e3, 1e4, 1e5])
PEAK = 100.0
RMS = PEAK / np.sqrt(2.0)
DRY = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
#: (gap in mm, conductivity of the gap) -> mean pressures in Pa at FREQUENCIES, 100 V peak
TABLE = {
    (0.001, 0.0): "14022.5 14022.4 14021.9 14018.9 13982.2 13455.5 9864.52 9540.86",
    (0.001, 1e-8): "10.4123 968.639 5576.23 11138.6 13435.2 13214.5 9851.92 9540.57",
    (0.001, 1e-7): ".104201 10.4106 93.0152 557.427 4140.66 10105.8 9708.7 9537.64",
    (0.005, 1e-8): "10.2857 451.528 734.396 786.07 795.347 789.788 732.338 725.637",
}
#: constants of dry skin at 1 kHz, as a step takes them
SKIN = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.30}
LEAKING = {"insulator": ev.TOUCHSCREEN, "gap_conductivity": 1e-8}


@pytest.mark.parametrize("case", TABLE)
def test_the_thirty_two_pressures(case):
    gap, sigma = case
    printed = TABLE[case].split()
    found = 1e6 * alternating_pressure(gap, RMS, FREQUENCIES, **DRY, gap_conductivity=sigma)
    for text, pressure in zip(printed, found, strict=True):
        digit = 10.0 ** -len(text.split(".")[1])
        assert pressure == pytest.approx(float(text), abs=0.52 * digit)  # 725.63751 is printed as 725.637


def test_length_angle_and_potential_at_1_kilohertz():
    z = complex_length(1000.0, **DRY, gap_conductivity=1e-8)
    assert z.real == pytest.approx(2.940001796e-4, rel=1e-8)
    assert z.imag == pytest.approx(2.546135583e-5, rel=2e-8)
    assert np.angle(1.0 / (0.001 + z)) == pytest.approx(-0.0196739, abs=5e-8)
    layers = ev.Layers(z.real, 0.301, z.imag)
    # printed as -.01710404; from the printed z, and by quadrature of the pressure, it is -.017104027
    assert 1e3 * ev.StrongTroxel().potential(0.001, RMS, layers) == pytest.approx(-0.01710404, abs=1.5e-8)


def test_corner_frequencies():
    gap, skin = corner_frequencies(0.001, **SKIN, **LEAKING)
    assert gap == pytest.approx(36.68388 * CODATA_2018, abs=5e-6)
    assert skin == pytest.approx(2614.987 * CODATA_2018, abs=5e-4)


def test_the_conductivity_that_puts_the_corner_at_250_hertz():
    sigma = 6.815e-8
    corner = corner_frequencies(0.001, **SKIN, insulator=ev.TOUCHSCREEN, gap_conductivity=sigma)[0]
    assert corner == pytest.approx(250.0, abs=250.0 * 0.5e-11 / sigma)


def test_limits_of_low_and_high_frequency():
    """Without a leak the skin is shorted at low frequency; with one the pressure falls as f^2."""
    film = ev.TOUCHSCREEN
    shorted = ev.StrongTroxel().traction(0.001, RMS, ev.Layers.of(film))
    assert alternating_pressure(0.001, RMS, 1e-4, **DRY) == pytest.approx(shorted, rel=1e-8)
    low = alternating_pressure(0.001, RMS, np.array([1e-3, 2e-3]), **DRY, gap_conductivity=1e-8)
    assert low[1] / low[0] == pytest.approx(4.0, rel=1e-6)
    number = alternating_pressure(0.0, 2000.0, 50.0, skin=1650.0, skin_thickness=0.38, insulator=ev.FILM)
    static = ev.StrongTroxel().traction(0.0, 2000.0, ev.Layers.of(ev.Layer(0.38, 1650.0), ev.FILM))
    assert number == static


def test_arguments_broadcast_and_may_be_names_numbers_dielectrics_and_files(tmp_path):
    gaps = np.array([0.0, 0.001])[:, None]
    leaks = np.array([0.0, 1e-8, 1e-7])
    together = alternating_pressure(gaps, RMS, 75.0, **DRY, gap_conductivity=leaks)
    assert together.shape == (2, 3)
    for i in range(2):
        for j in range(3):
            one = alternating_pressure(float(gaps[i, 0]), RMS, 75.0, **DRY, gap_conductivity=float(leaks[j]))
            assert together[i, j] == pytest.approx(one, rel=1e-14)
            assert type(one) is float
    (tmp_path / "skin.csv").write_text("frequency,eps_r,conductivity\n50,900,1e-4\n")
    table = alternating_pressure(0.001, RMS, 75.0, **DRY | {"skin": tmp_path / "skin.csv"})
    same = alternating_pressure(0.001, RMS, 75.0, **DRY | {"skin": ev.Dielectric(900.0, (), 1e-4)})
    assert table == pytest.approx(same, rel=1e-13)


def test_time_averages_of_the_resolved_field():
    """p(t) = eps_0 E^2 / 2 of the phasor, its mean, and its swing 1 + cos(2 w t + 2 arg E)."""
    z = complex_length(250.0, **DRY, gap_conductivity=1e-8)
    phase = 2.0 * np.pi * np.arange(64) / 64.0
    field = np.sqrt(2.0) * RMS * np.real(np.exp(1j * phase) / (0.001 + z))
    mean = alternating_pressure(0.001, RMS, 250.0, **DRY, gap_conductivity=1e-8)
    assert np.mean(0.5 * eps_0 * field**2) == pytest.approx(mean, rel=1e-13)
    swing = mean * (1.0 + np.cos(2.0 * phase + 2.0 * np.angle(1.0 / (0.001 + z))))
    np.testing.assert_allclose(0.5 * eps_0 * field**2, swing, rtol=1e-12, atol=1e-14)


def test_step_response():
    fast, slow = step_rates(0.001, **SKIN, **LEAKING)
    assert fast == pytest.approx(16588.77756 * CODATA_2018, abs=5e-6)
    assert slow == pytest.approx(228.2917857 * CODATA_2018, abs=5e-8)
    times = np.array([0.0, 1e-5, 5e-5, 1e-4, 1e-3, 10.0])
    found = 1e6 * step_pressure(times, 0.001, 100.0, **SKIN, **LEAKING)
    np.testing.assert_allclose(found[:1], 19149.122, atol=5e-4)
    np.testing.assert_allclose(found[1:3], [20238.37, 23166.27], atol=5e-3)
    np.testing.assert_allclose(found[3:5], [24709.932, 17508.159], atol=5.1e-4)
    assert found[5] == pytest.approx(0.0, abs=1e-300)


@pytest.mark.parametrize("gap", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize(
    "sigmas", [(2e-4, 1e-8, 1e-9), (2e-4, 1e-8, 0.0), (2e-4, 0.0, 0.0), (0.0, 1e-8, 0.0)]
)
def test_step_response_is_that_of_the_charges_by_a_matrix_exponential(gap, sigmas):
    """The three layers written as a system of three equations, by scipy's matrix exponential."""
    from scipy.linalg import expm

    film = ev.Layer(0.001, ev.Dielectric(3.9, (), sigmas[2]))
    given = SKIN | {"skin_conductivity": sigmas[0], "insulator": film, "gap_conductivity": sigmas[1]}
    s = np.array([0.30 / 1136.0, gap, 0.001 / 3.9])
    k = np.array(sigmas) / (eps_0 * np.array([1136.0, 1.0, 3.9]))

    def displacements(x, U):
        D = (U - x[0] * (s[1] + s[2]) - x[1] * s[2]) / s.sum()
        return np.array([D, D + x[0], D + x[0] + x[1]])

    def rate(x, U):
        J = k * displacements(x, U)
        return np.array([J[0] - J[1], J[1] - J[2]])

    system = np.zeros((3, 3))
    system[:2, 2] = rate(np.zeros(2), 100.0)
    system[:2, :2] = np.stack([rate(e, 0.0) for e in np.eye(2)], axis=1)
    for time in (1e-5, 3e-4, 4e-3):
        x = expm(system * time)[:2, 2]
        expected = 0.5 * eps_0 * displacements(x, 100.0)[1] ** 2
        found = step_pressure(time, gap, 100.0, **given)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_charges_under_a_ramp_are_those_of_many_small_steps():
    skin, film = Relaxing(0.30, 1136.0, 2e-4 / eps_0), Relaxing(0.001, 3.9, 0.0)
    stack = Sandwich(skin, film, 1e-8 / eps_0, 0.30 / 1136.0 + 0.001 / 3.9)
    gap = np.array([0.0, 1e-3, 0.05])
    start = np.array([[1e3, -2e3, 5e2], [1e2, 3e3, -7e2]])
    whole = stack.after(gap, start, 20.0, 100.0, 2e-3)
    parts, n = start, 64
    for i in range(n):
        before, after = (20.0 + 80.0 * share / n for share in (i, i + 1))
        parts = stack.after(gap, parts, before, after, 2e-3 / n)
    np.testing.assert_allclose(whole, parts, rtol=1e-11)
    np.testing.assert_array_equal(stack.after(gap, start, 5.0, 9.0, 0.0), start)


def test_time_domain_against_the_phasor():
    """A sine in 4000 straight parts of its period, which begins as it ends."""
    frequency, parts = 75.0, 4000
    skin = ev.Dielectric(1136.0, (), 2e-4)
    stack = Sandwich.of(ev.Layer(0.30, skin), ev.TOUCHSCREEN, frequency=frequency, gap_conductivity=1e-8)
    gap = np.array([0.0, 1e-3, 5e-3])
    time = np.arange(parts + 1) / (parts * frequency)
    volts = PEAK * np.sin(2.0 * np.pi * frequency * time)
    # from no charge with the voltage, and from either charge without: the period is linear in its start
    charges, driven = np.zeros((2, 3, 3)), np.array([1.0, 0.0, 0.0])[:, None]
    charges[0, 1], charges[1, 2] = 1.0, 1.0
    effective = []
    for before, after in pairwise(volts):
        charges = stack.after(gap, charges, before * driven, after * driven, time[1])
        effective.append(stack.effective(gap, after * driven, charges))
    for i in range(3):
        start = np.linalg.solve(np.eye(2) - charges[:, 1:, i], charges[:, 0, i])
        periodic = np.array(effective)[:, :, i] @ [1.0, *start]
        field = periodic / (gap[i] + stack.reference)
        mean = alternating_pressure(gap[i], RMS, frequency, skin=skin, skin_thickness=0.30, **LEAKING)
        # a straight part has less of the sine's amplitude than the sine: (w h)^2 / 6 = 4e-7 of the square
        assert np.mean(0.5 * eps_0 * field**2) == pytest.approx(mean, rel=1e-6)


@pytest.mark.parametrize(
    ("frequency", "square", "sine"),
    [(15.0, 0.260073, 0.071624), (60.0, 0.775157, 0.363952), (1920.0, 0.999700, 0.499818)],
)
def test_square_wave_beside_the_sine_of_the_same_amplitude(frequency, square, sine):
    full = ev.StrongTroxel().traction(0.001, PEAK, ev.Layers.of(ev.TOUCHSCREEN))
    assert square_wave_pressure(frequency, 0.001, PEAK, **LEAKING) / full == pytest.approx(square, abs=6e-7)
    tau = 4.338552e-3
    wt = 2.0 * np.pi * frequency * tau
    metal = {"skin": 1.0, "skin_thickness": 0.0, **LEAKING}
    mean = alternating_pressure(0.001, RMS, frequency, **metal) / full
    assert mean == pytest.approx(0.5 * wt**2 / (1.0 + wt**2), rel=1e-6)
    assert mean == pytest.approx(sine, abs=6e-7)


def test_square_wave_is_the_mean_of_its_resolved_field():
    """Between two flips the field decays from its jump; the mean by many sums."""
    tau = eps_0 * (1.0 + 0.001 * 3.9 / 0.001) / 1e-8
    half = 0.5 / 15.0
    t = (np.arange(20000) + 0.5) / 20000 * half
    field = 2.0 / (1.0 + np.exp(-half / tau)) * np.exp(-t / tau) * PEAK / (0.001 + 0.001 / 3.9)
    found = square_wave_pressure(15.0, 0.001, PEAK, **LEAKING)
    assert found == pytest.approx(np.mean(0.5 * eps_0 * field**2), rel=1e-7)
    still = square_wave_pressure(15.0, 0.001, PEAK, insulator=ev.TOUCHSCREEN, gap_conductivity=0.0)
    assert still == ev.StrongTroxel().traction(0.001, PEAK, ev.Layers.of(ev.TOUCHSCREEN))


def test_square_wave_is_the_sum_of_its_harmonics():
    n = np.arange(1, 200001, 2)
    metal = {"skin": 1.0, "skin_thickness": 0.0, **LEAKING}
    parts = alternating_pressure(0.001, 4.0 * PEAK / (np.pi * n * np.sqrt(2.0)), 60.0 * n, **metal)
    assert parts.sum() == pytest.approx(square_wave_pressure(60.0, 0.001, PEAK, **LEAKING), rel=1e-5)


def test_no_snap_in_bound():
    """The pressure weakens at most by 0.3247595 eps_0 U^2 / z''^3, at g + z' = z'' / sqrt(3)."""
    a = np.linspace(1e-4, 0.1, 200001)
    slope = -ev.StrongTroxel().traction_derivative(0.0, RMS, ev.Layers(a, 1.0, 0.02)) / (eps_0 * RMS**2)
    assert slope.max() * 0.02**3 == pytest.approx(0.3247595, abs=5e-8)
    assert a[np.argmax(slope)] == pytest.approx(0.02 / np.sqrt(3.0), rel=1e-4)


def test_what_cannot_be_is_refused():
    with pytest.raises(ev.InputError, match="gap"):
        alternating_pressure(-0.1, RMS, 10.0, **DRY)
    with pytest.raises(ev.InputError, match="frequency"):
        alternating_pressure(0.1, RMS, 0.0, **DRY)
    with pytest.raises(ev.InputError, match='skin: given "leather"'):
        alternating_pressure(0.1, RMS, 10.0, **DRY | {"skin": "leather"})
    with pytest.raises(ev.InputError, match="insulator"):
        alternating_pressure(0.1, RMS, 10.0, **DRY | {"insulator": 0.001})
    with pytest.raises(ev.InputError, match="gap_conductivity"):
        square_wave_pressure(10.0, 0.1, RMS, insulator=ev.TOUCHSCREEN, gap_conductivity=-1.0)
    with pytest.raises(ev.InputError, match="time"):
        step_pressure(-1.0, 0.1, RMS, **SKIN, **LEAKING)
    film = ev.Layer(0.001, ev.electrostatics.SKINS["raicu"])
    with pytest.raises(ev.InputError, match="without poles"):
        step_pressure(1.0, 0.1, RMS, **SKIN, insulator=film, gap_conductivity=0.0)


#: Rauf and Follmer (2025), doi:10.1016/j.eml.2025.102382: shear capacity in kPa of an electroadhesive clutch
CLUTCH = {"100 Hz": (1.96, 4.00, 5.04, 6.25), "10 kHz": (1.27, 2.47, 3.28, 3.94)}


def test_the_published_clutch_loses_the_same_share_at_every_voltage():
    """Electrostatics with losses is quadratic in the voltage: the ratio of two frequencies does not
    depend on it. Rauf and Follmer measure 0.62 to 0.65.
    """
    measured = np.divide(CLUTCH["10 kHz"], CLUTCH["100 Hz"])
    assert measured.min() > 0.6145
    assert measured.max() < 0.655
    volts = np.array([150.0, 200.0, 250.0, 300.0])
    ratios = [
        alternating_pressure(0.001, volts, 1e4, **DRY) / alternating_pressure(0.001, volts, 100.0, **DRY)
    ]
    np.testing.assert_allclose(ratios[0], ratios[0][0], rtol=1e-14)

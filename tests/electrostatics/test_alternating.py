"""Plates under alternating, stepped and square voltage: printed numbers, limits, other methods.

The numbers were computed with the electric constant of CODATA 2018, 7e-10 above that of 2022, which
their tenth digit shows.
"""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.electrostatics import (
    alternating_pressure,
    corner_frequencies,
    square_wave_pressure,
    step_pressure,
    step_rates,
)
from evfem.electrostatics.laws import eps_0

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


def test_corner_frequencies():
    gap, skin = corner_frequencies(0.001, **SKIN, **LEAKING)
    assert gap == pytest.approx(36.68388 * CODATA_2018, abs=5e-6)
    assert skin == pytest.approx(2614.987 * CODATA_2018, abs=5e-4)


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


def test_step_response():
    fast, slow = step_rates(0.001, **SKIN, **LEAKING)
    assert fast == pytest.approx(16588.77756 * CODATA_2018, abs=5e-6)
    assert slow == pytest.approx(228.2917857 * CODATA_2018, abs=5e-8)
    times = np.array([0.0, 1e-5, 5e-5, 1e-4, 1e-3, 10.0])
    found = 1e6 * step_pressure(times, 0.001, 100.0, **SKIN, **LEAKING)
    np.testing.assert_allclose(found[:1], 19149.122, atol=5e-4)
    np.testing.assert_allclose(found[1:3], [20238.37, 23166.27], atol=5e-3)
    np.testing.assert_allclose(found[3:5], [24709.932, 17508.159], atol=5.1e-4)
    assert found[5] == pytest.approx(0.0, abs=1e-20)


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


def test_what_cannot_be_is_refused():
    refuses("gap", alternating_pressure, -0.1, RMS, 10.0, **DRY)
    refuses("frequency", alternating_pressure, 0.1, RMS, 0.0, **DRY)
    refuses('skin: given "leather"', alternating_pressure, 0.1, RMS, 10.0, **DRY | {"skin": "leather"})
    refuses("insulator", alternating_pressure, 0.1, RMS, 10.0, **DRY | {"insulator": 0.001})
    with pytest.raises(ev.InputError, match="gap_conductivity"):
        square_wave_pressure(10.0, 0.1, RMS, insulator=ev.TOUCHSCREEN, gap_conductivity=-1.0)
    refuses("time", step_pressure, -1.0, 0.1, RMS, **SKIN, **LEAKING)
    film = ev.Layer(0.001, ev.electrostatics.SKINS["raicu"])
    refuses("without poles", step_pressure, 1.0, 0.1, RMS, **SKIN, insulator=film, gap_conductivity=0.0)


def test_the_impedance_of_a_plate():
    """Values found twice elsewhere, 1 cm2 under 100 V peak; current and power of the impedance."""
    given = {"skin": "gabriel_dry", "skin_thickness": 0.3, "insulator": ev.TOUCHSCREEN}
    Z = ev.electrostatics.contact_impedance(0.001, 100.0, [1000.0, 75.0], **given, gap_conductivity=1e-8)
    assert abs(Z) == pytest.approx([228.973190e3, 1301.001450e3], rel=1e-8)
    assert np.degrees(np.angle(Z)) == pytest.approx([-78.6826, -48.2264], abs=5e-5)
    current = 100.0 / 2**0.5 / abs(Z[0])
    assert 1e6 * current == pytest.approx(308.8164, rel=1e-6)
    assert 1e6 * current**2 * Z[0].real == pytest.approx(4285.2998, rel=1e-7)


def test_an_impedance_without_losses_is_a_capacitor():
    """Lossless layers: eps_0 A/(g + s) at any frequency, without a real part; areas and gaps broadcast."""
    given = {"skin": 1650.0, "skin_thickness": 0.2, "insulator": ev.TOUCHSCREEN}
    s = 0.2 / 1650.0 + 0.001 / 3.9
    gap, area = np.array([0.0, 0.001]), np.array([[100.0], [50.0]])
    Z = ev.electrostatics.contact_impedance(gap, area, 250.0, **given)
    farad = 1e-3 * ev.eps_0 * area / (gap + s)
    assert pytest.approx(1.0 / (2j * np.pi * 250.0 * farad), rel=1e-12) == Z
    assert not Z.real.any()
    refuses("area: given 0", ev.electrostatics.contact_impedance, 0.001, 0.0, 250.0, **given)


def test_the_power_of_an_impedance_is_that_of_its_layers():
    """What skin, gap and insulator dissipate, each by its own field: U^2 Re(1/Z) is their sum."""
    gap, f, sigma = 0.003, 400.0, 2e-8
    skin, film = ev.electrostatics.SKINS["gabriel_dry"], ev.TOUCHSCREEN
    given = {"skin": skin, "skin_thickness": 0.3, "insulator": film, "gap_conductivity": sigma}
    Z = ev.electrostatics.contact_impedance(gap, 100.0, f, **given)
    omega = 2.0 * np.pi * f
    current = 50.0 / Z / 1e-4  # A/m2
    power = 0.0
    for thickness, eps in (
        (0.3, complex(skin.permittivity(f))), (gap, 1.0 + sigma / (1j * omega * ev.eps_0)), (0.001, 3.9)
    ):  # fmt: skip
        field = current / (1j * omega * ev.eps_0 * eps)
        power += 1e-4 * 1e-3 * thickness * omega * ev.eps_0 * -np.imag(eps) * abs(field) ** 2
    assert 50.0**2 * (1.0 / Z).real == pytest.approx(power, rel=1e-12)

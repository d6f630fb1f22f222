"""Permittivities over the frequency: published values, tables, and sums of Debye poles."""

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.electrostatics.dielectrics import SKINS, dielectric
from evfem.electrostatics.laws import eps_0

#: real permittivity and conductivity (S/m) at 1 kHz, as far as they are printed
AT_1_KHZ = {
    "gabriel_dry": (1135.62, 2.001e-4),
    "gabriel_wet": (32134.5, 6.574e-4),
    "raicu": (10772.3, 2.398e-4),
}


@pytest.mark.parametrize("name", AT_1_KHZ)
def test_skins_have_their_published_values(name):
    """Computed independently from the published parameters, Gabriel 1996 and Raicu 2000."""
    eps_r, sigma = AT_1_KHZ[name]
    assert SKINS[name].permittivity(1000.0).real == pytest.approx(eps_r, rel=1.6e-6)
    assert SKINS[name].conductivity_at(1000.0) == pytest.approx(sigma, rel=2.5e-4)


def test_permittivity_is_the_sum_written_out():
    f = np.array([1.0, 250.0, 3e6])
    iw = 2j * np.pi * f
    cole = ev.Dielectric(4.0, [(1100.0, 32.48e-9, 0.2)], 2e-4)
    expected = 4.0 + 1100.0 / (1.0 + (iw * 32.48e-9) ** 0.8) + 2e-4 / (iw * eps_0)
    np.testing.assert_allclose(cole.permittivity(f), expected, rtol=1e-14)
    x = 1j * f / 2.51e6
    raicu = 61.0 + 2200.0 / (x**0.21 + x**0.848) + 3.2e-5 / (iw * eps_0)
    np.testing.assert_allclose(SKINS["raicu"].permittivity(f), raicu, rtol=1e-13)
    assert type(cole.permittivity(50.0)) is complex


@pytest.mark.parametrize("name", [*AT_1_KHZ])
@pytest.mark.parametrize("tolerance", [2e-2, 2e-3, 1e-4])
def test_debye_poles_follow_a_skin_over_its_band(name, tolerance):
    found = SKINS[name].debye(1.0, 1e5, tolerance)
    f = np.geomspace(1.0, 1e5, 777)
    assert np.abs(found.permittivity(f) / SKINS[name].permittivity(f) - 1.0).max() <= 1.02 * tolerance
    assert all(len(pole) == 3 and pole[0] > 0.0 and pole[2] == 0.0 for pole in found.poles)
    if tolerance == 2e-3:
        assert len(found.poles) <= 12


def test_no_debye_poles_for_what_is_not_passive():
    """A permittivity that grows with the frequency needs negative weights."""
    odd = ev.DielectricTable([1.0, 1e3], [10.0, 1e4], [1e-9, 1e-9])
    refuses("error that Debye poles can reach", odd.debye, 1.0, 1e3, 1e-2)


@pytest.mark.parametrize(
    "head",
    [
        "frequency [kHz],eps_r,conductivity [S/cm]",
        "frequency:kHz,eps_r [-],conductivity (S/cm)",
        "frequency,eps_r,conductivity\nkHz,-,S/cm",
    ],
)
def test_tables_have_the_units_of_their_header(tmp_path, head):
    path = tmp_path / "skin.csv"
    path.write_text(f"{head}\n0.01,4000,1e-6\n1,1000,1e-5\n")
    skin = dielectric(str(path))
    assert skin.permittivity(100.0).real == pytest.approx(2000.0, rel=1e-13)
    assert skin.conductivity_at(100.0) == pytest.approx(10**-3.5, rel=1e-13)
    path.write_text("frequency [Hz],eps_r,conductivity [S]\n1,2,3\n")
    refuses(r"skin.conductivity: given conductivity in S; allowed: S/m \|", dielectric, str(path))


def test_tables_are_straight_on_logarithmic_scales_and_go_through_files(tmp_path):
    path = tmp_path / "skin.csv"
    path.write_text("frequency,eps_r,conductivity\n10,4000,1e-4\n1000,1000,1e-3\n")
    skin = dielectric(str(path))
    assert skin.permittivity(100.0).real == pytest.approx(2000.0, rel=1e-13)
    assert skin.conductivity_at(100.0) == pytest.approx(10**-3.5, rel=1e-13)
    np.testing.assert_allclose(np.real(skin.permittivity([1.0, 1e6])), [4000.0, 1000.0], rtol=1e-13)
    np.testing.assert_allclose(skin.conductivity_at(np.array([1.0, 1e6])), [1e-4, 1e-3], rtol=1e-13)
    dry = SKINS["gabriel_dry"]
    f = np.geomspace(1.0, 1e5, 400)
    fine = ev.DielectricTable(f, np.real(dry.permittivity(f)), dry.conductivity_at(f))
    assert fine.permittivity(333.0) == pytest.approx(dry.permittivity(333.0), rel=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.5,), "eps_inf: given 0.5; allowed: a relative permittivity of at least 1"),
        ((2.0, [(1.0, 0.0, 0.0)]), "poles\\[0\\]"),
        ((2.0, [(1.0, 1.0, 0.0), (1.0, 1.0, 1.0)]), "poles\\[1\\]"),
        ((2.0, [(1.0, 1.0)]), "poles\\[0\\]"),
        ((2.0, (), -1.0), "conductivity: given -1.0"),
    ],
)
def test_impossible_dielectrics_are_refused(arguments, message):
    refuses(message, ev.Dielectric, *arguments)


def test_impossible_questions_are_refused():
    for frequency in (0.0, -1.0, [1.0, np.nan]):
        refuses("frequency", SKINS["gabriel_dry"].permittivity, frequency)
    refuses("frequencies in Hz that grow", ev.DielectricTable, [10.0, 1.0], [2.0, 2.0], [0.0, 0.0])
    refuses("equally many", ev.DielectricTable, [10.0, 11.0], [2.0], [0.0, 0.0])
    refuses('skin: given "dry"; allowed: gabriel_dry', dielectric, "dry")
    refuses("f_high", SKINS["raicu"].debye, 10.0, 1.0)


def test_layers_know_their_dielectrics_only_at_a_frequency():
    skin = ev.Layer(0.3, SKINS["gabriel_dry"])
    refuses("frequency: missing", ev.Layers.of, skin)
    refuses("frequency: missing", ev.Layers.of, ev.TOUCHSCREEN, gap_conductivity=1e-8)
    assert ev.Layers.of(ev.TOUCHSCREEN, frequency=50.0) == ev.Layers.of(ev.TOUCHSCREEN)
    many = ev.Layers.of(skin, ev.TOUCHSCREEN, frequency=np.array([1.0, 1e3, 1e5]))
    assert many.reduced.shape == many.loss.shape == (3,)

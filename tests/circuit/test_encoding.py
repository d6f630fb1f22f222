"""Rendering in closed form: the paper's voltages, areas and ranges as recomputed, and the fits."""

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.circuit.encoding import (
    AreaLaw,
    Encoding,
    fit_area_to_friction,
    fit_power,
    required_attraction,
    share_not_renderable,
)
from evfem.electrostatics.forces import plate_force
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel

FILM = Layer(0.09, 3.35)
LAWS = [StrongTroxel(), Kaczmarek()]


def display(d_sc=0.20, law=None, friction=0.5):
    return Encoding(law or Kaczmarek(), Layers.of(Layer(d_sc, 1650.0), FILM), AreaLaw(112.0), friction)


def test_voltage_of_the_friction_step():
    # notes, 3.3.1: 1776.73 V with 0.20 mm of stratum corneum, 2266.5 V with Table 2's 0.38 mm
    assert round(display().voltage_for_friction(0.6), 2) == 1776.73
    assert round(display(0.38).voltage_for_friction(0.6), 1) == 2266.5


@pytest.mark.parametrize("law", LAWS)
def test_rendering_and_encoding_are_inverse(law):
    wanted = np.linspace(0.5, 1.4, 7)
    for area in (AreaLaw(112.0), AreaLaw(107.626, 0.52)):
        device = Encoding(law, display().layers, area, friction=0.5)
        voltage = device.voltage_for_friction(wanted, normal_force=0.3)
        np.testing.assert_allclose(device.tangential_force(0.3, voltage), wanted * 0.3, rtol=1e-13)


def test_ranges_of_figures_7_and_8():
    # notes: (5) 0.036-0.360 N, (3) 6.0-602 N; Fig. 8 by (5) 0.24 ... 0.029 N at 140 V
    sc, film = np.meshgrid(np.logspace(3, 4, 11), np.linspace(1.0, 10.0, 11))
    layers = Layers.of(Layer(0.2, sc), Layer(0.001, film))
    kaczmarek, troxel = (plate_force(law, 100.0, 0.0, 140.0, layers) for law in (Kaczmarek(), StrongTroxel()))
    assert (round(kaczmarek.min(), 3), round(kaczmarek.max(), 3)) == (0.036, 0.360)
    assert (round(troxel.min(), 1), int(troxel.max())) == (6.0, 602)  # 602.6
    skin = Layers.of(Layer(np.array([0.1, 0.5]), 1650.0), Layer(0.001, 3.35))
    force = plate_force(Kaczmarek(), 100.0, 0.0, 140.0, skin)
    assert [round(force[0], 2), round(force[1], 3)] == [0.24, 0.029]
    # Table 2's insulator instead: about 1 mN
    thick = plate_force(Kaczmarek(), 100.0, 0.0, 140.0, Layers.of(Layer(0.1, 1650.0), FILM))
    assert thick == pytest.approx(1.7e-3, rel=0.05)


def test_slippery_surfaces_cannot_be_rendered():
    assert required_attraction(0.4, 0.5, 1.0) == 0.0
    assert display().voltage_for_friction(np.array([0.4, 0.5, 0.6]))[:2].tolist() == [0.0, 0.0]
    # below 0.5 from 0 to 1 mm (rising through it at 1) and at the constant 0.4 from 3 to 4
    share = share_not_renderable([0.0, 2.0, 3.0, 3.0, 4.0], [0.4, 0.6, 0.6, 0.4, 0.4], 0.5)
    assert share == pytest.approx(2.0 / 4.0, rel=1e-14)
    assert share_not_renderable([0.0, 1.0], [0.5, 0.5], 0.5) == 0.0
    refuses("do not fall", share_not_renderable, [1.0, 0.0], [0.5, 0.5], 0.5)


@pytest.mark.parametrize("relative", [True, False])
def test_standard_errors_are_the_scatter_of_repeated_fits(relative):
    random = np.random.default_rng(7)
    x = np.linspace(0.1, 1.0, 20)
    exact = 63.0 * x**0.68
    fits = []
    for _ in range(300):
        noise = random.normal(size=x.size)
        fits.append(
            fit_power(x, exact * np.exp(0.05 * noise) if relative else exact + noise, relative=relative)
        )
    for name, true in (("k", 63.0), ("m", 0.68)):
        found = np.array([getattr(f, name) for f in fits])
        stated = np.array([getattr(f, f"{name}_error") for f in fits])
        # 300 repetitions know a deviation to 1 / sqrt(600) = 4 %: three of these
        assert np.std(found) == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.13)
        assert abs(found.mean() - true) < 4.0 * stated.mean() / np.sqrt(300)


@pytest.mark.parametrize("law", LAWS)
def test_area_law_behind_measured_friction(law):
    layers = Layers.of(Layer(0.1, 1650.0), Layer(0.001, 3.35))
    device = Encoding(law, layers, AreaLaw(80.0, 0.489), friction=0.3)
    force = np.linspace(0.1, 1.0, 9)
    fit = fit_area_to_friction(force, device.tangential_force(force, 140.0), 140.0, device)
    assert (fit.k, fit.m) == (pytest.approx(80.0, rel=1e-7), pytest.approx(0.489, rel=1e-7))
    assert fit_power([1.0, 2.0], [3.0, 5.0]).k_error == np.inf


def test_line_closest_to_an_area_law():
    # design notes: Adams' ridge law up to 0.2 N gives 111-118 mm2/N, the paper's k' = 112
    law = AreaLaw(63.0, 0.68)
    force = np.linspace(0.0, 0.2, 100_001)
    expected = np.sum(force * law(force)) / np.sum(force**2)
    assert law.linearised(0.2).k == pytest.approx(expected, rel=1e-4)
    assert law.linearised(0.2).m == 1.0


def test_scalars_give_floats_and_impossible_input_is_refused():
    assert type(display().voltage_for_friction(0.6)) is float
    assert type(display().tangential_force(0.6, 100.0)) is float
    assert display().tangential_force(np.ones(3), 100.0).shape == (3,)
    for wrong, says in (
        (lambda: AreaLaw(-1.0), "k: given"),
        (lambda: display(friction=0.0), "friction: given"),
        (lambda: display().voltage_for_friction(-0.1), "not negative"),
        (lambda: display().voltage_for_attraction(1.0, 0.0), "above zero"),
        (lambda: fit_power([1.0, 1.0], [1.0, 2.0]), "two different x"),
        (lambda: fit_power([1.0, 2.0], [1.0, -2.0]), "above zero"),
        (lambda: Encoding(Kaczmarek(), Layers.of(), AreaLaw(1.0), 0.5), "infinite"),
    ):
        refuses(says, wrong)

    class Linear:
        def traction(self, gap, voltage, layers):
            return 1e-3 * voltage

    refuses("square of the voltage", display, law=Linear())


@pytest.mark.parametrize("waveform", ["sine", "square"])
def test_encoding_through_what_conducts_gives_back_the_friction(waveform):
    """Effective and peak voltage by the mean of the drive, checked with the mean pressure itself."""
    import evfem as ev

    drive = ev.Drive(250.0, waveform, "gabriel_dry", 1e-8)
    solids = (ev.Layer(0.30, 1650.0), ev.TOUCHSCREEN)
    display = Encoding.driven(ev.StrongTroxel(), drive, solids, AreaLaw(112.0), friction=0.5)
    voltage = display.voltage_for_friction(0.6)
    assert display.tangential_force(0.7, voltage) == pytest.approx(0.6 * 0.7, rel=1e-12)
    assert display.peak(voltage) == pytest.approx(voltage * (2**0.5 if waveform == "sine" else 1.0))
    if waveform == "sine":
        given = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
        pressure = ev.electrostatics.alternating_pressure(0.0, voltage, 250.0, **given, gap_conductivity=1e-8)
        assert pressure * 112.0 == pytest.approx(0.2, rel=1e-12)
    with pytest.raises(ev.InputError, match="resolved"):
        Encoding.driven(
            ev.StrongTroxel(), ev.Drive(250.0, resolved=True), solids, AreaLaw(112.0), friction=0.5
        )

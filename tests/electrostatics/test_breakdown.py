"""Paschen's law, the voltage that first breaks air down over layers, and a law whose field it limits.

Values of the curve are the formula by hand: 365 * 76 * g / (ln(15 * 76 * g) - ln ln 101) of g in mm; those of
the paper's plates are 2000 g / (g + 0.0270960) over it (Table 2: gaps of 0.25 and 0.5 mm, 1414 and 2000 V).
"""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from tools.refusals import refuses

import evfem as ev
from evfem.electrostatics.breakdown import Limited, across_gap

breakdown_voltage, inception_voltage = (
    ev.electrostatics.breakdown_voltage,
    ev.electrostatics.inception_voltage,
)
PAPER = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.FILM)


def test_the_curve_by_hand_and_its_minimum_below():
    by_hand = 365 * 760 * 0.025 / (np.log(15 * 760 * 0.025) - np.log(np.log(101)))
    assert breakdown_voltage(0.25) == pytest.approx(by_hand, rel=1e-14)
    # textbooks' form of the minimum: the gap e ln(1 + 1 / gamma) / (A p), and e ln(1 + 1 / gamma) B / A
    lowest = np.e * np.log(101) * 365 / 15
    assert lowest == pytest.approx(305.2665, rel=1e-6)
    assert breakdown_voltage([0.0, 0.001, 0.011]) == pytest.approx([lowest] * 3, rel=1e-12)
    assert np.e * np.log(101) / (15 * 76) == pytest.approx(0.0110046, rel=1e-5)
    assert breakdown_voltage(0.0110047) > breakdown_voltage(0.0110046)
    refuses("gap: given -1", breakdown_voltage, -1.0)


@pytest.mark.parametrize("reduced", [0.0, 3.776e-4, 0.0270960, 0.5, 1e3])
def test_the_first_gap_to_break_down_is_the_minimum_over_all(reduced):
    voltage, gap = inception_voltage(ev.Layers(reduced, 1.0))
    found = minimize_scalar(
        lambda t: breakdown_voltage(np.exp(t)) * (1.0 + reduced / np.exp(t)),
        bounds=(-4.6, 9.0),
        method="bounded",
    )
    assert voltage == pytest.approx(found.fun, rel=1e-9)
    assert breakdown_voltage(gap) * (gap + reduced) / gap == pytest.approx(voltage, rel=1e-9)


def test_the_papers_film_and_its_plates():
    assert inception_voltage(PAPER) == pytest.approx((790.2422, 0.0284875), rel=2e-6)
    assert inception_voltage([ev.Layer(0.38, 1650.0), ev.FILM]) == inception_voltage(PAPER)
    refuses("layers: given 3", inception_voltage, 3.0)
    voltage, gap = np.array([2000.0, 2000.0, 1414.0]), np.array([0.25, 0.5, 0.25])
    over = voltage * across_gap(gap, PAPER, 1.0) / breakdown_voltage(gap)
    assert over == pytest.approx([1.073, 0.659, 0.758], abs=6e-4)


@pytest.mark.parametrize("law", [ev.StrongTroxel(), ev.Kaczmarek()])
def test_a_limited_law_holds_the_field_of_gaps_that_break_down(law):
    limited, gap = Limited(law), np.array([0.005, 0.0119, 0.0121, 0.0285, 0.0805, 0.0812, 0.3])
    ratio = np.asarray(limited.traction(gap, 1000.0, PAPER)) / law.traction(gap, 1000.0, PAPER)
    assert (ratio < 1.0).tolist() == [False, False, True, True, True, False, False]
    worst = inception_voltage(PAPER)[0] / 1000.0
    assert ratio[3] == pytest.approx(worst**2, rel=1e-6)
    field = breakdown_voltage(0.0285) / 0.0285
    if isinstance(law, ev.StrongTroxel):
        assert limited.traction(0.0285, 1000.0, PAPER) == pytest.approx(0.5 * ev.eps_0 * field**2, rel=1e-12)
    # a sine of 1000 V at its peak breaks the same gaps down
    effective = Limited(law, 2**0.5).traction(gap, 1000.0 / 2**0.5, PAPER)
    assert 2.0 * np.asarray(effective) == pytest.approx(limited.traction(gap, 1000.0, PAPER), rel=1e-12)


@pytest.mark.parametrize("law", [ev.StrongTroxel(), ev.Kaczmarek()])
@pytest.mark.parametrize("loss", [0.0, 0.004])
def test_its_potential_has_its_traction_as_slope(law, loss):
    limited, layers = Limited(law), ev.Layers(PAPER.reduced, PAPER.thickness, loss)
    gap, h = np.array([0.002, 0.0105, 0.02, 0.05, 0.3, 1.0]), 1e-6
    for voltage in (500.0, 1777.0):
        up, down = (np.asarray(limited.potential(gap + s * h, voltage, layers)) for s in (1.0, -1.0))
        assert (up - down) / (2.0 * h) == pytest.approx(limited.traction(gap, voltage, layers), rel=1e-6)
    assert limited.potential(1e3, 1777.0, layers) == law.potential(1e3, 1777.0, layers)


GAP, SOLIDS, SIGMA = 0.05, 0.38 / 1650.0 + 0.001 / 3.9, 1e-7


def hovering(voltage, **drive):
    """The largest share of Paschen's voltage below a finger 50 um above a touchscreen."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    drive = ev.Drive(**drive) if drive else None
    motion = [ev.Hover(GAP), ev.Wait(0.01, steps=1)]
    result = ev.simulate(
        ev.Scene(pad, ev.Display(insulator=ev.TOUCHSCREEN), ev.StrongTroxel(), voltage, motion, drive=drive)
    )
    return result.breakdown[0]


def by_hand(volts):
    return volts * GAP / (GAP + SOLIDS) / breakdown_voltage(GAP)


@pytest.mark.parametrize(("frequency", "sigma"), [(50.0, SIGMA), (50.0, 10.0 * SIGMA), (5000.0, SIGMA)])
def test_a_gap_that_leaks_has_up_to_twice_a_square_wave(frequency, sigma):
    """It is charged through the layers with tau = (1 + g / s) eps_0 / sigma: 2 / (1 + exp(-T / 2 tau)) of the
    share of a gap that holds, where the voltage flips.
    """
    tau = (1.0 + GAP / SOLIDS) * ev.eps_0 / sigma
    found = hovering(40.0, frequency=frequency, waveform="square", gap_conductivity=sigma)
    assert found == pytest.approx(by_hand(80.0 / (1.0 + np.exp(-0.5 / frequency / tau))), rel=0.02)


def test_a_bias_leaves_a_gap_that_leaks_no_field():
    """Of 30 V and a sine of 60 V at 50 Hz the sine alone, by what the stack of gap and layers leaves it."""
    held = 1.0 / (1.0 + SIGMA / (2j * np.pi * 50.0 * ev.eps_0))
    share = GAP * held / (GAP * held + SOLIDS)
    wanted = 60.0 * abs(share) / breakdown_voltage(GAP)
    assert hovering(ev.Sine(50.0, 60.0, bias=30.0), gap_conductivity=SIGMA) == pytest.approx(wanted, rel=2e-3)
    holds = hovering(ev.Sine(50.0, 60.0, bias=30.0), frequency=None)
    assert holds == pytest.approx(by_hand(90.0), rel=2e-3)


def test_an_averaged_carrier_has_its_peak_without_a_drive_too():
    assert hovering(ev.Carrier(1e4, 40.0, resolved=False)) == pytest.approx(by_hand(40.0), rel=2e-3)


def test_an_averaged_carrier_is_a_sine_whatever_the_drive_would_be():
    """Beside a leak the share of a square wave's gap ended in a TypeError, and the pad was pulled by the
    harmonics of a square wave.
    """
    carrier = ev.Carrier(2000.0, ev.Sine(20.0, 10.0, bias=60.0), resolved=False)
    pad, motion = ev.FingerPad(resolution="coarse", ridges=False), [ev.Hover(GAP), ev.Wait(0.01, steps=4)]
    found = []
    for waveform in ("square", "sine"):
        drive = ev.Drive(waveform=waveform, skin="gabriel_dry", gap_conductivity=SIGMA)
        scene = ev.Scene(
            pad, ev.Display(insulator=ev.TOUCHSCREEN), ev.StrongTroxel(), carrier, motion, drive=drive
        )
        found.append(ev.simulate(scene))
    for name in ("breakdown", "electrostatic_force", "current_rms", "power"):
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-12)
        assert (found[0][name] != 0.0).any()

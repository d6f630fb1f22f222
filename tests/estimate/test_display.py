"""From friction to feeling: voltages, limits, and the errors of a rendering."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import evfem as ev
from evfem.estimate.display import BANDS, Device, ExactCurve, playback, render, render_exact
from evfem.estimate.touch import FrictionCurve, Touch
from evfem.planning.plan import plan

X = np.arange(400) * 0.02  # 8 mm, at 20 mm/s 0.4 s
TOUCH = Touch(load=0.05)


def curve(*waves, mean=0.4):
    """Friction with sines of (amplitude, Hz) at 20 mm/s."""
    mu = mean + 0.0 * X + sum(a * np.sin(2.0 * np.pi * f * X / 20.0) for a, f in waves)
    return FrictionCurve(X, mu, "made up")


def test_what_can_be_rendered_is_felt_without_an_error():
    found = render(curve((0.02, 10.0)), TOUCH, Device(friction=0.3))
    assert not found.lost.any()
    assert max(found.force_error, found.change_error, found.spectrum_error) < 1e-9
    np.testing.assert_allclose(found.felt, found.curve.friction)


def test_the_voltage_is_that_of_equation_20a():
    device = Device(friction=0.3)
    found = render(curve(), TOUCH, device)
    pressure = device.encoding.law.traction(0.0, 1.0, device.encoding.layers)
    wanted = np.sqrt((0.4 / 0.3 - 1.0) / (112.0 * pressure))
    assert found.signal.profile(3.0) == pytest.approx(wanted)
    assert np.isnan(found.change_error)


def test_friction_below_the_displays_own_is_lost_and_marked():
    found = render(curve((0.1, 10.0)), TOUCH, Device(friction=0.4))
    np.testing.assert_array_equal(found.lost, found.curve.friction < 0.4 - 1e-5)
    below = np.minimum(found.curve.friction - 0.4, 0.0)
    wanted = np.linalg.norm(below) / np.linalg.norm(found.curve.friction)
    assert found.force_error == pytest.approx(wanted, rel=1e-6)


def test_an_amplifier_that_is_too_weak_loses_what_is_above_it():
    free = render(curve((0.05, 10.0)), TOUCH, Device(friction=0.3))
    cut = render(curve((0.05, 10.0)), TOUCH, Device(friction=0.3, voltage_max=free.signal.largest * 0.9))
    assert cut.signal.largest == pytest.approx(free.signal.largest * 0.9)
    assert 0.1 < cut.lost.mean() < 0.6
    np.testing.assert_array_equal(cut.lost, free.signal.profile(X) > free.signal.largest * 0.9 * (1 + 1e-5))


def test_bands_hold_the_power_of_their_frequencies_and_the_error_of_a_slow_amplifier():
    found = render(curve((0.02, 10.0), (0.01, 100.0)), TOUCH, Device(friction=0.3, slew=3e4))
    share = {(low, high): power for low, high, _, power in found.bands}
    assert share[5.0, 15.0] == pytest.approx(0.8, abs=0.01)
    assert share[50.0, 150.0] == pytest.approx(0.2, abs=0.01)
    assert list(pairwise(BANDS)) == [band[:2] for band in found.bands]
    error = {(low, high): error for low, high, error, _ in found.bands}
    assert error[50.0, 150.0] > 3.0 * error[5.0, 15.0]


def test_a_file_has_a_round_full_scale_and_both_frictions():
    found = render(curve((0.02, 10.0)), TOUCH, Device(friction=0.3))
    told = playback(found.signal.profile, TOUCH, Device(friction=0.3))
    assert told.full_scale >= found.signal.largest
    assert f"{told.full_scale:e}"[0] in "125"
    assert told.full_scale < 2.51 * found.signal.largest
    natural, largest = told.friction
    assert natural == 0.3
    share = (found.signal.largest / told.full_scale) ** 2
    assert natural + share * (largest - natural) == pytest.approx(found.curve.friction.max())


def test_a_voltage_that_was_found_is_compared_like_one_of_the_closed_forms():
    """The closed form's own voltage and friction, given as the model's."""
    wish, device = curve((0.02, 10.0)), Device(friction=0.39)
    form = render(wish, TOUCH, device)
    given = ExactCurve(wish.x, form.signal.profile(wish.x), form.felt)
    found = render_exact(wish, given, TOUCH, device)
    for name in ("force_error", "change_error", "spectrum_error"):
        assert getattr(found, name) == pytest.approx(getattr(form, name)), name
        assert getattr(found, name) > 0.01
    np.testing.assert_allclose(found.bands, form.bands, rtol=1e-9)
    assert found.signal.largest == pytest.approx(form.signal.largest)
    assert found.signal.rms == pytest.approx(form.signal.rms, rel=0.02)
    assert found.signal.carrier == pytest.approx(form.signal.carrier)
    assert found.signal.share_not_renderable == pytest.approx(form.signal.share_not_renderable, abs=0.02)


SCREEN = {"friction": 0.3, "law": "strong_troxel", "insulator": "touchscreen"}
#: sum of thickness over permittivity (mm) of stratum corneum and touchscreen
REDUCED = 0.38 / 1650.0 + 0.001 / 3.9


def test_air_between_rough_faces_takes_more_voltage():
    """(g + s) / s times the voltage of smooth faces: eps_0 U^2 / (2 (g + s)^2) is the same attraction."""
    smooth, rough = (render(curve(), TOUCH, Device(**SCREEN, roughness_gap=gap)) for gap in (0.0, 0.005))
    ratio = (0.005 + REDUCED) / REDUCED
    assert rough.signal.largest / smooth.signal.largest == pytest.approx(ratio, rel=1e-9)
    assert rough.force_error < 1e-9


def test_a_display_is_doubted_as_a_plan_doubts_a_scene():
    (said,) = Device(**SCREEN).doubts(15.9)
    left = (REDUCED / (0.005 + REDUCED)) ** 2
    assert f"leave {left:.2%} of the attraction of smooth ones" in said
    assert Device(**SCREEN, roughness_gap=0.005).doubts(100.0) == ()
    assert Device(**{**SCREEN, "law": "kaczmarek"}).doubts(15.9) == ()  # its fit has the air already
    field = 1e-3 * 1000.0 / (3.9 * REDUCED)
    broken, air, pulled = Device(**SCREEN).doubts(1000.0)
    least, _ = ev.electrostatics.inception_voltage(ev.Layers.of(ev.Layer(0.38, 1650.0), ev.TOUCHSCREEN))
    assert f"air breaks down from {least:.3g} V on" in air
    assert [len(Device().doubts(volts)) for volts in (790.0, 791.0)] == [0, 1]  # over a film of 90 um
    assert f"a field of {field:.3g} V/um in the insulator" in broken
    rough = Device(**SCREEN, roughness_gap=0.005).doubts(1000.0)
    assert not [one for one in rough if "V/um in the" in one]  # 47 V/um
    press = [ev.Press(force=0.05)]
    pad = ev.FingerPad(ridges=False, resolution="coarse")
    scene = ev.Scene(pad, ev.Display(ev.TOUCHSCREEN), ev.StrongTroxel(), 1000.0, press)
    assert set(plan(scene).warnings) == {broken, pulled}
    assert plan(replace(scene, voltage=15.9)).warnings == (said,)


def test_a_voltage_at_its_limit_is_lost_there():
    """Half of the slide at 100 V, its limit, with too little friction; the other half as wished."""
    wish = curve((0.02, 10.0))
    cut = X < 4.0
    felt = np.where(cut, 0.3, wish.friction)
    given = ExactCurve(X, np.where(cut, 100.0, 90.0), felt)
    found = render_exact(wish, given, TOUCH, Device(friction=0.3, voltage_max=100.0))
    assert found.signal.share_limited == pytest.approx(0.5, abs=0.01)
    assert found.share_lost == pytest.approx(0.5, abs=0.01)
    (said,) = found.losses
    assert said.startswith("50% of the slide is beyond the limits of the voltage")
    free = render_exact(wish, given, TOUCH, Device(friction=0.3, voltage_max=200.0))
    assert free.signal.share_limited == 0.0


def test_shares_are_of_the_path_and_not_of_the_rows():
    """Friction that falls below the display's own at 1 of 2 mm, with most rows on the first mm."""
    x = np.concatenate([np.linspace(0.0, 1.0, 901), np.linspace(1.0, 2.0, 101)[1:]])
    wish = FrictionCurve(x, np.where(x < 1.0, 0.4, 0.2), "made up")
    assert render(wish, TOUCH, Device(friction=0.3)).share_lost == pytest.approx(0.5, abs=0.01)

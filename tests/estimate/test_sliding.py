"""The pad that yields linearly: closed forms of its friction, what is remembered of it, and how a texture
becomes a slide.
"""

import numpy as np
import pytest

import evfem as ev
from evfem.estimate.correction import corrected, corrections, importance
from evfem.estimate.database import linear_curve, shipped
from evfem.estimate.pressed import FRICTIONS, LOADS, PressedPad, remember, shipped_pad
from evfem.estimate.sliding import slid
from evfem.estimate.touch import friction_of, from_texture, touch_scene
from evfem.plotting.fields import height_of
from evfem.textures.library import reference

POSITIONS = np.arange(1, 41) * 0.05


class Slope:
    """A plane that rises."""

    def __init__(self, rise):
        self.rise = rise

    def height(self, x):
        return self.rise * x

    def slope(self, x):
        return np.full_like(x, self.rise)


def springs(n=40, load=0.05):
    """A round pad of springs side by side, each with its own compliance."""
    x = np.linspace(-4.0, 4.0, n)
    compliance = np.diag(np.concatenate([np.linspace(80.0, 120.0, n), np.full(n, 30.0)]))
    force = np.concatenate([np.full(n, load / n), np.zeros(n)])
    return PressedPad(x, x**2 / 60.0, np.zeros(2 * n), compliance, force, load)


@pytest.mark.parametrize("ridged", [False, True])
@pytest.mark.parametrize("rise", [-0.2, 0.0, 0.1])
def test_on_a_slope_friction_is_that_of_a_block(ridged, rise):
    pad = shipped_pad(ridged).at(0.05, 0.3)
    found = slid(pad, Slope(rise), 0.3, POSITIONS, 20.0)
    np.testing.assert_allclose(found, (0.3 + rise) / (1.0 - 0.3 * rise), rtol=1e-6)


def test_what_is_elastic_loses_nothing_over_a_period_and_what_lags_does():
    wave = ev.Sinusoid(terms=[[0.02, np.pi, 0.0]])
    still, slow, fast = (slid(springs(), wave, 0.0, POSITIONS, v).mean() for v in (1e-6, 20.0, 100.0))
    assert abs(still) < 1e-3 * np.ptp(slid(springs(), wave, 0.0, POSITIONS, 1e-6))
    assert 3.0 < fast / slow < 7.0
    assert slow > 0.0


def test_springs_that_do_not_know_each_other_share_the_load_by_their_depths():
    """With touching springs alone: sum of p / c = load gives the bone, p the slope's average."""
    pad, wave = springs(), ev.Sinusoid(terms=[[0.01, 2.0, 0.0]])
    found = slid(pad, wave, 0.0, POSITIONS[:2], 1e-9)[1]
    x, slope = pad.x + POSITIONS[1], wave.slope(pad.x + POSITIONS[1])
    stiffness = 1.0 / np.diag(pad.compliance)[:40]
    low, high = -1.0, 1.0
    for _ in range(60):
        bone = 0.5 * (low + high)
        press = np.maximum(wave.height(x) - pad.y - bone, 0.0) * stiffness
        low, high = (bone, high) if press.sum() > pad.load else (low, bone)
    assert found == pytest.approx(-np.sum(press * -slope) / press.sum(), rel=0.02)


@pytest.mark.parametrize("ridged", [False, True])
def test_on_a_flat_surface_the_remembered_pad_is_where_it_was(ridged):
    stored = shipped_pad(ridged)
    pad = stored.at(float(LOADS[2]), float(FRICTIONS[1]))
    n = pad.x.size
    assert pad.force[:n].sum() == pytest.approx(LOADS[2], rel=1e-6)
    assert -pad.force[n:].sum() == pytest.approx(FRICTIONS[1] * LOADS[2], rel=1e-6)
    low = pad.y + (pad.base + pad.compliance @ pad.force)[:n]
    assert np.ptp(low[pad.force[:n] > 0.0]) < 1e-5  # mm, with what half precision leaves
    found = slid(pad, ev.Flat(), float(FRICTIONS[1]), POSITIONS, 20.0)
    np.testing.assert_allclose(found, FRICTIONS[1], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("ridged", [False, True])
def test_what_is_shipped_is_what_the_model_is_asked_for(ridged):
    """Half precision changes curves by less than they differ from the model's."""
    fresh, database = remember(ridged), shipped(ridged)
    for i in (20, 60, 100):
        curve, whole = linear_curve(database.textures[i], fresh), database.friction[i]
        changed, wrong = (np.sqrt(np.mean((curve - other) ** 2)) for other in (database.linear[i], whole))
        assert changed < 0.2 * wrong + 2e-6


@pytest.mark.parametrize("ridged", [False, True])
def test_the_shipped_linear_curves_are_those_of_the_shipped_pad(ridged):
    database = shipped(ridged)
    for i in (5, 150):
        curve = linear_curve(database.textures[i], shipped_pad(ridged))
        np.testing.assert_allclose(curve, database.linear[i], atol=2e-5)


def test_a_correction_that_was_made_is_found_and_undone():
    x = np.arange(1, 25) / 24 * 1.2
    wave = 0.3 + 0.02 * np.sin(2 * np.pi * x / 1.2) + 0.005 * np.cos(4 * np.pi * x / 1.2)
    changed = corrected(x, wave, np.array([0.1, 0.8, 0.05]), 0.06, 1.2)
    one, slope = np.array([1.2]), np.array([0.06])
    found = corrections(changed[None], wave[None], one, slope)[0]
    np.testing.assert_allclose(found, [0.1, 0.8, 0.05], atol=0.01)
    step = 1e-3
    for k, unit in enumerate(np.eye(3) * step):
        other = corrected(x, wave, np.array([0.0, 1.0, 0.0]) + unit, 0.06, 1.2)
        size = np.sqrt(np.mean((other - wave) ** 2)) / np.ptp(wave) / step
        assert importance(wave[None], wave[None], one, slope)[0, k] == pytest.approx(size, rel=0.05)


X = np.arange(0.0, 2.0, 0.05)
WAVE = ev.Texture("a b/ö", "drawn", X, 0.01 * np.sin(np.pi * X), "CC0-1.0", period=2.0)


def test_the_bone_passes_the_beginning_of_the_texture_with_the_second_slide():
    scene = touch_scene(WAVE, ev.Touch(load=0.05, friction=0.3))
    begin = scene.motion[1].distance
    x = begin + np.array([0.0, 0.5, 1.5])
    np.testing.assert_allclose(scene.surface.height(x), [0.0, 0.01, -0.01], atol=1e-12)
    np.testing.assert_allclose(scene.surface.height(x - 4.0), [0.0, 0.01, -0.01], atol=1e-12)
    assert scene.name == "a-b--"


def test_friction_lies_on_a_level_surface():
    scene = touch_scene(reference("friction-ramps"), ev.Touch())
    x = scene.motion[1].distance + np.array([0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(scene.surface.friction_coefficient(x), [0.3, 0.45, 0.6, 0.45], atol=1e-9)
    assert scene.surface.is_flat


def test_a_spectrum_has_no_surface():
    spectrum = ev.Texture("s", "recorded", [1.0, 2.0], [0.6, 0.8], "CC0-1.0", "friction_spectrum")
    with pytest.raises(ev.InputError, match="heights or friction over x"):
        touch_scene(spectrum, ev.Touch())


class Slid:
    motion_index = np.array([0, 1, 2, 2])
    position = np.array([0.0, 2.0, 2.5, 3.0])
    applied_force = np.array([0.1, 0.1, 0.1, 0.2])
    applied_tangential_force = np.array([0.0, 0.02, 0.03, 0.08])


def test_friction_is_that_of_the_second_slide_from_its_beginning():
    curve = friction_of(Slid())
    assert curve.x.tolist() == [0.5, 1.0]
    assert curve.friction.tolist() == pytest.approx([0.3, 0.4])


def test_pictures_of_a_slide_stand_where_its_curve_does():
    """The last frame is at the curve's last x, and the texture below it at its own heights."""
    touch = ev.Touch(ridged=False, load=0.02, length=0.5)
    result = ev.simulate(touch_scene(WAVE, touch, every=4))
    shown, curve = from_texture(result), friction_of(result)
    assert shown.frames[-1].position == pytest.approx(curve.x[-1])
    assert curve.x[-1] == pytest.approx(0.5)
    x = np.linspace(-0.5, 1.5, 9)  # below the finger
    height = height_of(shown, shown.frames[-1])(x)
    np.testing.assert_allclose(height - height[2], 0.01 * np.sin(np.pi * x), atol=3e-4)

"""From a texture to a slide: where the texture lies under the finger, and what is refused."""

import numpy as np
import pytest

import evfem as ev
from evfem.errors import InputError
from evfem.estimate.touch import Touch, friction_of, from_texture, touch_scene
from evfem.plotting.fields import height_of
from evfem.textures.library import reference
from evfem.textures.texture import Texture

WAVE = Texture("a b/ö", "drawn", np.arange(0.0, 2.0, 0.05), 0.01 * np.sin(np.pi * np.arange(0.0, 2.0, 0.05)),
               "CC0-1.0", period=2.0)  # fmt: skip


def test_the_bone_passes_the_beginning_of_the_texture_with_the_second_slide():
    scene = touch_scene(WAVE, Touch(load=0.05, friction=0.3))
    begin = scene.motion[1].distance
    x = begin + np.array([0.0, 0.5, 1.5])
    np.testing.assert_allclose(scene.surface.height(x), [0.0, 0.01, -0.01], atol=1e-12)
    np.testing.assert_allclose(scene.surface.height(x - 4.0), [0.0, 0.01, -0.01], atol=1e-12)
    assert scene.name == "a-b--"


def test_friction_lies_on_a_level_surface():
    scene = touch_scene(reference("friction-ramps"), Touch())
    x = scene.motion[1].distance + np.array([0.0, 1.0, 2.0, 3.0])
    np.testing.assert_allclose(scene.surface.friction_coefficient(x), [0.3, 0.45, 0.6, 0.45], atol=1e-9)
    assert scene.surface.is_flat


def test_a_spectrum_has_no_surface():
    spectrum = Texture("s", "recorded", [1.0, 2.0], [0.6, 0.8], "CC0-1.0", "friction_spectrum")
    with pytest.raises(InputError, match="heights or friction over x"):
        touch_scene(spectrum, Touch())


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
    touch = Touch(ridged=False, load=0.02, length=0.5)
    result = ev.simulate(touch_scene(WAVE, touch, every=4))
    shown, curve = from_texture(result), friction_of(result)
    assert shown.frames[-1].position == pytest.approx(curve.x[-1])
    assert curve.x[-1] == pytest.approx(0.5)
    x = np.linspace(-0.5, 1.5, 9)  # below the finger
    height = height_of(shown, shown.frames[-1])(x)
    np.testing.assert_allclose(height - height[2], 0.01 * np.sin(np.pi * x), atol=3e-4)

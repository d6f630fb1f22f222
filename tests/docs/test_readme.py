"""The example of the README, run as it stands there but on a coarse mesh."""

import contextlib
import io
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem.scene.file import loads
from evfem.scene.scene import default_scene

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
FINGER = ev.FingerPad(ridges=False, resolution="coarse")
MOTION = (ev.Press(force=0.05, steps=3), ev.Slide(distance=1.2, steps=6, hold="force"))


def block(kind):
    """The README's only block of that kind."""
    (text,) = re.findall(rf"^```{kind}\n(.*?)^```$", README, re.M | re.S)
    return text


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The README's Python, its simulation on a coarse mesh and with few steps: its names, what it
    prints, and its folder.
    """
    folder, printed, simulate = tmp_path_factory.mktemp("readme"), io.StringIO(), ev.simulate
    names, here = {}, Path.cwd()

    def coarse(scene, progress):
        short = replace(scene, finger=FINGER, motion=MOTION, name="slide")
        return simulate(short, progress=progress)

    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(ev, "simulate", coarse)
        os.chdir(folder)
        try:
            exec(compile(block("python"), "README.md", "exec"), names)
        finally:
            os.chdir(here)
    return names, printed.getvalue(), folder


def test_the_readmes_two_scenes_are_the_same_and_the_built_in_one_with_held_load_and_a_depth(example):
    names, printed, _ = example
    press, slide = default_scene().motion
    held = replace(default_scene(), motion=(press, replace(slide, hold="force")), depth=10.0)
    assert names["scene"].digest() == loads(block("toml")).digest() == held.digest()
    assert str(ev.plan(names["scene"])) in printed


def test_the_readmes_example_leaves_the_files_that_it_names(example):
    _, _, folder = example
    named = set(re.findall(r'"(\w+\.\w+)"', block("python")))
    assert named == {"slide.pvd", "forces.png", "slide.npz"}
    assert named <= {path.name for path in folder.iterdir()}


def test_the_readmes_two_commands_stand():
    assert re.search(
        r'^```sh\npip install \. && evfem run\npip install "\.\[test\]" && pytest\n```$', README, re.M
    )


def test_the_forces_are_those_of_a_press_and_full_slip(example):
    result = example[0]["result"]
    assert result.motion.tolist() == ["press"] * 3 + ["slide"] * 6
    np.testing.assert_allclose(result.applied_force[:3], [0.05 / 3, 0.1 / 3, 0.05], rtol=1e-7)
    np.testing.assert_allclose(result.applied_force[3:], 0.05, rtol=1e-7)
    assert result.tangential_force[-1] == pytest.approx(0.3 * result.normal_force[-1], rel=1e-7)
    balance = result.applied_force - (result.normal_force - result.electrostatic_force)
    np.testing.assert_allclose(balance, 0.0, atol=1e-7 * result.normal_force.max())
    assert np.all(result.electrostatic_force > 0.0)

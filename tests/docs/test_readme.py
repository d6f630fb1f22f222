"""The example of the README, run as it stands there but on a coarse mesh."""

import contextlib
import io
import os
import re
import runpy
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import evfem as ev
from evfem.scene.file import loads
from evfem.scene.scene import default_scene

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
FINGER = ev.FingerPad(ridges=False, resolution="coarse")
MOTION = (ev.Press(force=0.05, steps=3), ev.Slide(distance=1.2, steps=6, hold="force"))


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
PICTURE = ROOT / "studies" / "pictures" / "slide.png"


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


def test_badges_say_what_the_project_file_says():
    shown = dict(re.findall(r"shields\.io/badge/(\w+)-([\w.+]+)-", README))
    classifiers = " ".join(PROJECT["classifiers"]).lower()
    assert shown["python"] == PROJECT["requires-python"].removeprefix(">=") + "+"
    assert shown["licence"] == PROJECT["license"]
    assert f":: {shown['tested'].lower()}" in classifiers
    assert f"- {shown['status']}" in classifiers
    assert len(shown) == README.count("img.shields.io") == 4


def test_its_picture_is_small_and_wide_enough_for_two_screens():
    import matplotlib.image

    high, wide, _ = matplotlib.image.imread(PICTURE).shape
    assert PICTURE.stat().st_size < 200_000
    assert wide >= 800
    assert wide / high > 2.5  # one row


def test_its_picture_shows_the_friction_of_both_slides_and_the_skin_while_some_of_it_slips(tmp_path):
    """The voltage's part of friction is the attraction times the coefficient, by Amontons and Coulomb."""
    make = runpy.run_path(str(PICTURE.with_name("make.py")))
    results = make["touchscreen_slides"](finger=ev.Fingertip(resolution="coarse", ridges="none"))
    off, on = (results[name] for name in ("0 V", "150 V"))
    panels = make["draw_story"](results, tmp_path / "slide.png")
    curves = {line.get_label(): line.get_ydata() for line in panels[0].get_lines()}
    assert off.applied_force[-1] == pytest.approx(0.3, rel=1e-7)
    assert curves["0 V"][-1] == pytest.approx(0.4, rel=1e-6)
    assert curves["150 V"][-1] == pytest.approx(0.4 * (1.0 + on.electrostatic_force[-1] / 0.3), rel=1e-6)
    statuses = panels[1].collections[-1].get_array()
    assert 0.25 < np.mean(statuses[statuses > 0.0] == 2.0) < 0.75
    assert (tmp_path / "slide.png").stat().st_size < 200_000

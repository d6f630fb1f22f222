"""The example of the README, run as it stands there but on a coarse mesh; with a law and a weak
form of the user's own.
"""

import contextlib
import io
import os
import re
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import evfem as ev
from evfem import export, plotting
from evfem.scene.file import loads
from evfem.scene.scene import default_scene
from evfem.simulation.result import load

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
FINGER = ev.FingerPad(ridges=False, resolution="coarse")
DISPLAY = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)
MOTION = (ev.Press(force=0.05, steps=3), ev.Slide(distance=1.2, steps=6, hold="force"))


class RoughGap:
    """A user's own law: any object with the right method."""

    def traction(self, gap, voltage, layers):
        return 0.5 * ev.eps_0 * (voltage / (layers.reduced + gap + 2e-3)) ** 2


@ev.form
def nail_bed(u, v, w):
    return 2.0e-2 * ev.dot(u, v)


def block(kind):
    """The README's only block of that kind."""
    (text,) = re.findall(rf"^```{kind}\n(.*?)^```$", README, re.M | re.S)
    return text


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The README's Python, its simulation on a coarse mesh and with few steps: its names, what it
    prints, its folder, and a series that was written while it ran.
    """
    folder, printed, simulate = tmp_path_factory.mktemp("readme"), io.StringIO(), ev.simulate
    series = export.ParaViewSeries(folder / "live.pvd")
    names, here = {}, Path.cwd()

    def coarse(scene, progress):
        short = replace(scene, finger=FINGER, motion=MOTION, name="slide")
        return simulate(short, progress=progress, observers=[series])

    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed):
        patch.setattr(ev, "simulate", coarse)
        os.chdir(folder)
        try:
            exec(compile(block("python"), "README.md", "exec"), names)
        finally:
            os.chdir(here)
    return names, printed.getvalue(), folder, series.path


@pytest.fixture(scope="module")
def scene():
    return ev.Scene(FINGER, DISPLAY, ev.Kaczmarek(), 1000.0, MOTION, name="slide", depth=10.0)


@pytest.fixture(scope="module")
def result(example):
    """The result, with a series that was written while it ran."""
    names, _, _, live = example
    return names["result"], live


def test_the_readmes_two_scenes_are_the_same_and_the_built_in_one_with_held_load_and_a_depth(example):
    names, printed, _, _ = example
    press, slide = default_scene().motion
    held = replace(default_scene(), motion=(press, replace(slide, hold="force")), depth=10.0)
    assert names["scene"].digest() == loads(block("toml")).digest() == held.digest()
    assert str(ev.plan(names["scene"])) in printed


def test_the_readmes_example_leaves_the_files_that_it_names(example):
    _, _, folder, _ = example
    named = set(re.findall(r'"(\w+\.\w+)"', block("python")))
    assert named == {"slide.pvd", "forces.png", "slide.npz"}
    assert named <= {path.name for path in folder.iterdir()}


def test_the_readmes_two_commands_stand():
    assert re.search(
        r'^```sh\npip install \. && evfem run\npip install "\.\[test\]" && pytest\n```$', README, re.M
    )


def test_the_forces_are_those_of_a_press_and_full_slip(result):
    result, _ = result
    assert result.motion.tolist() == ["press"] * 3 + ["slide"] * 6
    np.testing.assert_allclose(result.applied_force[:3], [0.05 / 3, 0.1 / 3, 0.05], rtol=1e-7)
    np.testing.assert_allclose(result.applied_force[3:], 0.05, rtol=1e-7)
    assert result.tangential_force[-1] == pytest.approx(0.3 * result.normal_force[-1], rel=1e-7)
    balance = result.applied_force - (result.normal_force - result.electrostatic_force)
    np.testing.assert_allclose(balance, 0.0, atol=1e-7 * result.normal_force.max())
    assert np.all(result.electrostatic_force > 0.0)


def test_the_series_of_the_run_is_that_of_the_result(result, tmp_path):
    result, live = result
    export.paraview(result, tmp_path / "slide.pvd")
    assert live.read_text() == (tmp_path / "slide.pvd").read_text().replace("slide", "live")
    for step in range(1, 10):
        late = meshio.read(tmp_path / f"slide_{step:05d}.vtu")
        early = meshio.read(live.with_name(f"live_{step:05d}.vtu"))
        for name in late.point_data:
            np.testing.assert_array_equal(late.point_data[name], early.point_data[name])


def test_the_result_is_saved_plotted_and_knows_its_scene(scene, result, tmp_path):
    result, _ = result
    result.save(tmp_path / "slide.npz")
    back = load(tmp_path / "slide.npz")
    np.testing.assert_array_equal(back.normal_force, result.normal_force)
    assert back.provenance["scene"]["digest"] == scene.digest()
    assert loads(back.provenance["parameters"]).digest() == scene.digest()
    plotting.forces(back).figure.savefig(tmp_path / "forces.png")
    plotting.deformed(back).figure.savefig(tmp_path / "deformed.png")
    plotting.contact_pressure(back).figure.savefig(tmp_path / "pressure.png")


def test_the_plan_says_what_is_in(scene):
    text = str(ev.plan(scene))
    assert "Kaczmarek" in text
    assert "+ friction" in text


def test_a_law_and_a_weak_form_of_the_users_own_change_the_answer_as_they_should(scene, result):
    """A rough gap attracts less than Strong-Troxel; springs on the nail carry part of the applied
    force.
    """
    result, _ = result
    short = {"motion": MOTION[:1]}
    rough = ev.simulate(replace(scene, law=RoughGap(), **short))
    smooth = ev.simulate(replace(scene, law=ev.StrongTroxel(), **short))
    held = ev.simulate(replace(scene, **short).with_term(nail_bed, on=ev.Boundary("nail")))
    assert 0.0 < rough.electrostatic_force[-1] < smooth.electrostatic_force[-1]
    assert held.indentation[-1] < result.indentation[2]
    assert rough.provenance["parameters"].startswith("Scene(")

"""Insulators that break down: fields of plates in series, U / |eps_i (g / eps_g + sum of d / eps)|."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev

FINGER = ev.FingerPad(resolution="coarse", ridges=False)
SKIN = FINGER.stratum_corneum_thickness
#: V/mm, of a film of 90 um and 3.35
STRENGTH = 20e3
FILM = ev.Layer(0.09, 3.35, strength=STRENGTH)
PRESS = ev.Press(indentation=0.05, steps=1)


def scene(voltage, insulator=FILM, motion=PRESS, **more):
    return ev.Scene(FINGER, ev.Display(insulator), ev.StrongTroxel(), voltage, motion, **more)


def told(sentences, what="the insulator"):
    return [one for one in sentences if what in one and "breaks down" in one]


def test_a_plan_compares_each_layer_with_its_own_strength():
    """Touching skin: eps_i E = U / sum of d / eps."""
    edge = STRENGTH * 3.35 * (0.09 / 3.35 + SKIN / 1650.0)
    assert not told(ev.plan(scene(0.999 * edge)).warnings)
    (said,) = told(ev.plan(scene(1.001 * edge)).warnings)
    assert "20 V/um in the insulator, which breaks down above 20 V/um" in said
    assert f"from {edge:.3g} V on" in said
    assert not told(ev.plan(scene(1.001 * edge, ev.FILM)).warnings)
    coat = ev.Layer(0.03, 2.5)
    (said,) = told(ev.plan(scene(2.0 * edge, [coat, FILM])).warnings)
    assert "in the insulator's layer 2" in said
    # the peak of a sine is what counts
    sine = ev.Drive(frequency=1e3)
    assert not told(ev.plan(scene(0.999 * edge / 2**0.5, drive=sine)).warnings)
    assert told(ev.plan(scene(1.001 * edge / 2**0.5, drive=sine)).warnings)


def test_what_conducts_shares_the_voltage_by_its_complex_permittivity():
    """At 100 Hz eps* = eps - i sigma / (w eps_0); where skin touches a gap that leaks changes nothing."""
    skin, film = ev.Dielectric(4.0, conductivity=2e-8), ev.Dielectric(3.35, conductivity=1e-8)
    eps, own = (a - 1j * b / (200.0 * np.pi * ev.eps_0) for a, b in ((4.0, 2e-8), (3.35, 1e-8)))
    edge = STRENGTH * abs(0.09 + own * SKIN / eps) / 2**0.5
    leaking = ev.Layer(0.09, film, strength=STRENGTH)
    for leak in (0.0, 1e-6):
        drive = ev.Drive(frequency=100.0, skin=skin, gap_conductivity=leak)
        found = [bool(told(ev.plan(scene(k * edge, leaking, drive=drive)).warnings)) for k in (0.999, 1.001)]
        assert found == [False, True]


def run(*args, **more):
    """A run, whose plan warns only of skin that touches."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "where skin touches")
        return ev.simulate(scene(*args, **more))


@pytest.mark.parametrize("leak", [0.0, 1e-7])
def test_a_run_takes_the_gap_that_it_has(leak):
    """A finger that hovers: eps_i E = U / |g / eps_g* + sum of d / eps|, eps_g* = 1 - i sigma / (w eps_0)."""
    more = {} if leak == 0.0 else {"drive": ev.Drive(frequency=1e3, gap_conductivity=leak)}
    peak = 700.0 if leak == 0.0 else 700.0 * 2**0.5
    air = 1.0 - 1j * leak / (2e3 * np.pi * ev.eps_0)
    hover = ev.Hover(gap=0.05)
    gap = run(700.0, ev.FILM, hover, **more).min_gap[-1]
    assert 0.01 < gap < 0.05
    field = peak / abs(3.35 * (gap / air + 0.09 / 3.35 + SKIN / 1650.0))
    holds, fails = (ev.Layer(0.09, 3.35, strength=k * field) for k in (1.001, 0.8))
    assert not told(run(700.0, holds, hover, **more).warnings)
    (said,) = told(run(700.0, fails, hover, **more).warnings)
    least = f"from {0.8 * peak:.3g} V on"
    assert said == f"the insulator breaks down {least}, at 1.25 times its {0.8e-3 * field:g} V/um in step 1"


def test_rough_faces_keep_air_above_an_insulator():
    """Of a plan and of a run."""
    volts, rough = 700.0, 0.02
    field = volts / (3.35 * (rough + 0.09 / 3.35 + SKIN / 1650.0))
    for k, fails in ((0.999, True), (1.001, False)):
        weak = ev.Layer(0.09, 3.35, strength=k * field)
        assert bool(told(ev.plan(scene(volts, weak, roughness_gap=rough)).warnings)) is fails
        assert bool(told(run(volts, weak, roughness_gap=rough).warnings)) is fails


def test_a_scene_file_has_a_strength():
    coat = ev.Layer(0.02, 2.5)
    for insulator, line in ((FILM, "insulator_strength = 20000.0"), ([coat, FILM], "300000.0,\n    20000.0")):
        text = ev.scenefile.dump(scene(900.0, insulator))
        assert line in text
        assert ev.scenefile.loads(text) == scene(900.0, insulator)
    assert ev.scenefile.loads(text) != scene(900.0, [coat, ev.FILM])
    assert "strength" not in ev.scenefile.dump(scene(900.0, [coat, ev.FILM]))
    short = text.replace("300000.0,\n    20000.0", "20000.0")
    refuses("insulator_strength: given 1 beside 2 of insulator_thickness", ev.scenefile.loads, short)
    named = ev.scenefile.dump(scene(900.0, FILM))
    named = named.replace("insulator_thickness = 0.09\ninsulator_eps_r = 3.35", 'insulator = "film"')
    assert ev.scenefile.loads(named).surface.insulator == replace(ev.FILM, strength=STRENGTH)
    refuses("electrostatics.insulator_strength: given 0", ev.scenefile.loads, named.replace("20000.0", "0.0"))


@pytest.mark.parametrize("given", [0.0, -1.0, float("nan"), "much", True])
def test_a_strength_is_a_field(given):
    refuses(
        "layer strength: given .*; allowed: a field in V/mm, larger", ev.Layer, 0.09, 3.35, strength=given
    )

"""What rough faces keep between them: the laws, and the attraction that depends on it."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import benchmark_finger, coarse_pad, left_over
from tools.refusals import refuses
from tools.scenes import PRESS, head

import evfem as ev
from evfem.electrostatics.roughness import roughness_of, separation_derivative
from evfem.scene.file import dump, loads

POWER = ev.PowerRoughness(gap=0.001, pressure=0.01, exponent=0.3, open_gap=0.004)
EXPONENTIAL = ev.ExponentialRoughness(decay=0.0008, pressure=1.0, open_gap=0.006)
FALLING = pytest.mark.parametrize("law", [POWER, EXPONENTIAL], ids=["power", "exponential"])


class Own:
    """A law of one's own without a derivative; it drops imaginary parts."""

    def separation(self, pressure):
        return 0.003 / (1.0 + np.abs(pressure) / 0.02)


def test_the_laws_are_those_of_their_sources():
    p = np.array([0.002, 0.01, 0.3])
    np.testing.assert_allclose(POWER.separation(p), 0.001 * (p / 0.01) ** -0.3, rtol=1e-14)
    np.testing.assert_allclose(EXPONENTIAL.separation(p), 0.0008 * np.log(1.0 / p), rtol=1e-14)
    assert EXPONENTIAL.separation(2.0) == 0.0
    assert ev.ConstantRoughness(0.002).separation(0.01) == 0.002


@FALLING
def test_open_nodes_are_bounded_and_the_laws_are_smooth_where_the_tangent_begins(law):
    """By hand: the tangent at p_c reaches `open_gap` at no pressure."""
    if law is POWER:
        at = 0.004 / 1.3
        least = 0.01 * (0.001 / at) ** (1.0 / 0.3)
    else:
        at, least = 0.006 - 0.0008, np.exp(-(0.006 - 0.0008) / 0.0008)
    assert law.separation(0.0) == pytest.approx(law.open_gap, rel=1e-14)
    assert law.separation(least) == pytest.approx(at, rel=1e-12)
    sides = [separation_derivative(law, least * (1.0 + s)) for s in (-1e-9, 1e-9)]
    assert sides[0] == pytest.approx(sides[1], rel=1e-7)
    assert law.separation(0.5 * least) == pytest.approx(0.5 * (law.open_gap + at), rel=1e-12)


@pytest.mark.parametrize("law", [POWER, EXPONENTIAL, ev.ConstantRoughness(0.001), Own()])
def test_derivatives_are_those_of_the_separation(law):
    p = np.array([1e-5, 1e-3, 0.02, 0.5])
    h = 1e-6 * p
    expected = (law.separation(p + h) - law.separation(p - h)) / (2.0 * h)
    np.testing.assert_allclose(separation_derivative(law, p), expected, rtol=1e-7, atol=1e-9)


def test_what_is_no_gap_is_refused():
    for given in (-0.001, 2.0, "rough", None, True, POWER.__class__):
        refuses("roughness_gap", roughness_of, given)
    refuses("open_gap", ev.ExponentialRoughness, decay=0.001, pressure=1.0, open_gap=0.001)
    with pytest.raises(ev.InputError, match="only with a law"):
        ev.Scene(coarse_pad(), ev.Flat(), motion=ev.Press(force=0.01), roughness_gap=0.001)


MOTION = [ev.Press(force=0.05, steps=2), ev.Slide(0.4, steps=2)]


def touchscreen(rough, core="auto"):
    surface, output = ev.Display(ev.TOUCHSCREEN), ev.Output(every=4)
    return ev.Scene(
        benchmark_finger(), surface, ev.StrongTroxel(), 100.0, MOTION,
        output=output, roughness_gap=rough, solver=ev.Solver(core=core),
    )  # fmt: skip


def test_a_rough_touchscreen_converges_as_a_smooth_one_and_obeys_the_law_at_every_node():
    smooth, rough = (ev.simulate(touchscreen(faces, core="off")) for faces in (0.0, POWER))
    assert rough.provenance["solver"]["cuts"] == 0
    assert rough.newton_iterations.sum() < 1.5 * smooth.newton_iterations.sum()
    frame = rough.frames[-1]
    pad = rough.mesh.node_sets["pad"]
    gap, pressure = np.maximum(frame.gap[pad], 0.0), np.maximum(frame.contact_pressure[pad], 0.0)
    skin = ev.Layers.of(ev.Layer(0.38, 1650.0), ev.TOUCHSCREEN)
    apart = np.where(frame.contact_status[pad] > 0, 0.0, gap) + POWER.separation(pressure)
    expected = ev.StrongTroxel().traction(apart, 100.0, skin)
    found = frame.electrostatic_traction[pad]
    facing = found > 0.0
    assert (frame.contact_status[pad][facing] > 0).sum() > 20
    np.testing.assert_allclose(found[facing], expected[facing], rtol=1e-9)


@FALLING
def test_the_books_close_between_rough_faces(law):
    assert left_over(ev.simulate(touchscreen(law))) < 1e-7


def test_a_constant_gap_is_a_thicker_layer_of_air():
    """Strong-Troxel's law knows the sum of gap and layers alone: 1 um of air instead."""
    rough = ev.simulate(touchscreen(0.001))
    stack = ev.Display(ev.Layer(0.001 * (1.0 + 1.0 / 3.9), 1.0))
    air = ev.simulate(replace(touchscreen(0.0), surface=stack))
    for name in ("applied_force", "electrostatic_force", "tangential_force"):
        np.testing.assert_allclose(rough[name], air[name], rtol=1e-7, atol=1e-9)


TABLE = head('law = "kaczmarek"\nvoltage = 100.0\ninsulator = "touchscreen"\nROUGH') + PRESS


@pytest.mark.parametrize(
    ("text", "law"),
    [
        ("roughness_gap = 0.002", 0.002),
        ('[electrostatics.roughness_gap]\nlaw = "constant"\ngap = 0.002', ev.ConstantRoughness(0.002)),
        (
            '[electrostatics.roughness_gap]\nlaw = "power"\ngap = 0.001\npressure = 0.01\n'
            "exponent = 0.3\nopen_gap = 0.004",
            POWER,
        ),
        (
            '[electrostatics.roughness_gap]\nlaw = "exponential"\ndecay = 0.0008\npressure = 1.0\n'
            "open_gap = 0.006",
            EXPONENTIAL,
        ),
    ],
)
def test_a_scene_file_says_it_and_a_dumped_one_too(text, law):
    scene = loads(TABLE.replace("ROUGH", text))
    assert scene.roughness_gap == law
    assert loads(dump(scene)) == scene
    assert "rough faces" in next(
        term.reason for term in ev.plan(scene).terms if term.name == "electrostatics"
    )

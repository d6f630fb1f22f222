"""Adaptive steps end where what is prescribed turns: nothing is passed over between their ends."""

from functools import cache

import numpy as np
import pytest
from tools.domes import Dome, dome, dome_scene
from tools.meshes import block

import evfem as ev
from evfem.planning.resolution import path_depth, slip_scale

PULSE = ev.VoltageProfile([0.0, 1.1, 1.2, 1.3, 4.0], [0.0, 0.0, 3000.0, 0.0, 0.0])
RUBBER = ev.Display(friction=0.3)
AUTO = ev.Solver(strategy=ev.Strategy(steps="auto", path_error=2e-4))


def scene(steps, surface=RUBBER, solver=AUTO, slip=4.0, speed=None, width=4.0, **options):
    """A block that slips all the time under 0.02 N/mm."""
    law, skin = {"tissue": ev.NeoHookean(E=0.5, nu=0.3)}, ev.Electrical(0.2, 100.0)
    body = ev.MeshedFinger(block(12, 4, width=width, height=2.0), law, electrical=skin)
    options.setdefault("law", ev.Kaczmarek())
    motion = [ev.Press(force=0.02, steps=2), ev.Slide(slip, steps=steps, hold="force", speed=speed)]
    return ev.Scene(body, surface, motion=motion, solver=solver, **options)


def slid(*arguments, **options):
    return ev.simulate(scene(*arguments, **options))


@pytest.mark.parametrize("steps", [1, 5])
def test_a_pulse_over_the_position_is_not_passed_over(steps):
    """As 200 prescribed steps have it, 400 to 3e-4."""
    assert slid(steps, voltage=PULSE).friction_dissipation[-1] == pytest.approx(expected(), rel=4e-3)


@cache
def expected():
    return slid(200, voltage=PULSE, solver=ev.Solver()).friction_dissipation[-1]


@pytest.mark.filterwarnings("ignore:motion 1 has .* steps in a period")
def test_a_pulse_over_time_is_not_passed_over():
    """At 10 mm/s the same voltages in hundredths of a second, in samples."""
    samples = np.zeros(41)
    samples[12] = 3000.0
    signal = ev.Sampled(samples, rate=100.0, start=-0.0)
    found = slid(1, voltage=signal, speed=10.0)
    assert found.friction_dissipation[-1] == pytest.approx(expected(), rel=4e-3)


def test_friction_narrower_than_a_step_is_not_passed_over():
    """A stripe 0.3 mm wide of twice the friction, below a block 1 mm wide."""
    edges = [-9.0, 5.2, 5.2, 5.5, 5.5, 99.0]
    stripe = ev.Flat(friction=[[x, mu] for x, mu in zip(edges, [0.1, 0.1, 0.2, 0.2, 0.1, 0.1], strict=True)])
    ways = (160, ev.Solver()), (1, AUTO)
    fine, coarse = (slid(n, stripe, slip=8.0, width=1.0, law=None, solver=one) for n, one in ways)
    assert coarse.friction_dissipation[-1] == pytest.approx(fine.friction_dissipation[-1], rel=2e-3)


def test_rows_that_do_not_show_a_pulse_are_told():
    told = " ".join(str(ev.plan(scene(5, voltage=PULSE))).split())
    assert (
        "motion 1 has rows 0.8 mm apart, and between them what is prescribed over the position varies" in told
    )
    assert "motion 1 has rows" not in " ".join(str(ev.plan(scene(40, voltage=PULSE))).split())


DOME = Dome(dome((8, 2, 8)))


def on_dome(surface, angle=90.0):
    """4 mm wide and long, with nodes 0.5 mm apart, that slides by 2 mm."""
    motion = ev.Press(indentation=0.1, steps=1), ev.Slide(2.0, steps=1, angle=angle)
    return dome_scene(*motion, finger=DOME, surface=surface, law=None, voltage=0.0), DOME.mesh(1)


def test_friction_beside_the_middle_counts_for_how_far_a_pad_may_slip_at_once():
    """Maps from 0.2 to 0.6 over 2 mm of z, and over 2 mm of x and of z in one corner alone."""
    along_z = ev.FrictionMap([-9.0, 9.0], [-9.0, 1.0, 3.0, 9.0], [[0.2] * 2] * 2 + [[0.6] * 2] * 2)
    beside = [[0.2] * 4, [0.2] * 4, [0.2, 0.2, 0.6, 0.6], [0.2, 0.2, 0.6, 0.6]]
    beyond = ev.FrictionMap([-9.0, 1.0, 3.0, 9.0], [-9.0, 0.0, 2.0, 9.0], beside)
    assert slip_scale(*on_dome(ev.Flat(friction=along_z))) == pytest.approx(2.0, rel=0.01)
    assert slip_scale(*on_dome(ev.Flat(friction=along_z), angle=180.0)) < 1.1  # half of it, or two spacings
    assert slip_scale(*on_dome(ev.Flat(friction=beyond), angle=0.0)) == pytest.approx(2.0, rel=0.01)
    assert slip_scale(*on_dome(ev.Flat(friction=0.3))) == np.inf


def test_a_bump_beside_the_middle_is_part_of_the_depth():
    x = np.linspace(-3.0, 3.0, 61)
    height = 0.1 * np.exp(-4.0 * (x**2 + (x[:, None] - 1.5) ** 2))
    scene, mesh = on_dome(ev.Relief(x, x, height, friction=0.0), angle=0.0)
    assert path_depth(scene, mesh, 0.02) == pytest.approx(0.1, rel=0.01)
    assert slip_scale(scene, mesh) == pytest.approx(1.01, rel=0.01)  # two spacings

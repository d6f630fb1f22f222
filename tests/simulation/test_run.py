"""Whole scenes: the benchmark, symmetry, balances of forces and energies, history and checkpoints."""

from functools import cache

import numpy as np
import pytest
from tools.builders import INSULATOR, balance, benchmark_scene, coarse_pad, finger, resumed
from tools.meshes import block

from evfem import ElasticLayer, Hand
from evfem.electrostatics.laws import Kaczmarek, StrongTroxel
from evfem.finger.fingerpad import MeshedFinger
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp, Wait
from evfem.scene.scene import Output, Scene, Solver
from evfem.simulation.result import COLUMNS
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tissue.laws import NeoHookean

ROUND = finger(block(8, 3, sag=0.4))
PRESS_AND_SLIDE = (Press(indentation=0.3, steps=3), Slide(0.4, steps=4))
IN_TIME = (
    Press(indentation=0.2, steps=2, speed=100.0),
    Slide(0.3, steps=3, speed=50.0, hold="force"),
    Wait(0.02, steps=2, spacing="log", hold="force"),
)

# Reference values of the benchmark (N/mm): F_n at 0.5, 1.0, 1.5 mm, and in B after a slide of 3 mm: F_n, F_t;
# F_t at slides of 0.1 and 0.5 mm; extrapolated from quadratic elements of two other packages that agree
TABLE_A = np.array([0.07098, 0.24112, 0.54337])
TABLE_B = np.array([0.0721, 0.2556, 0.6017, 0.5214, 0.1564, 0.00687, 0.03364])


def run(surface, *motion, body=ROUND, law=None, voltage=0.0, **options):
    return simulate(Scene(body, surface, law, voltage, motion or PRESS_AND_SLIDE, **options))


def numbers_of(kind, result):
    presses = result.normal_force[[4, 9, 14]]
    if kind == "A":
        return presses
    slides = result.tangential_force[[15, 19]]
    return np.array([*presses, result.normal_force[-1], result.tangential_force[-1], *slides])


def columns(result, *names):
    return np.array([getattr(result, name) for name in names])


# -- the benchmark ---------------------------------------------------------------------------------


@cache
def benchmark(kind, level, element=None):
    return simulate(benchmark_scene(kind, level, element))


def benchmark_error(kind, level, element=None):
    """Relative errors of the benchmark's numbers."""
    table = TABLE_A if kind == "A" else TABLE_B
    return numbers_of(kind, benchmark(kind, level, element)) / table - 1.0


@pytest.mark.parametrize("kind", ["A", "B"])
@pytest.mark.parametrize(
    ("level", "error"), [(0, 5e-3), pytest.param(1, 3e-3, marks=pytest.mark.slow)], ids=["first", "second"]
)
def test_benchmark_with_the_default_element(kind, level, error):
    assert np.abs(benchmark_error(kind, level)).max() < error
    assert balance(benchmark(kind, level)).max() < 1e-7


def test_plain_linear_quads_are_too_stiff_by_the_square_of_their_size():
    coarse, fine = (benchmark_error("A", level, "q1") for level in (0, 1))
    assert (fine > 0.007).all()
    assert (fine < 0.012).all()
    assert (coarse > 3.2 * fine).all()
    assert (coarse < 4.2 * fine).all()
    # with friction a coarse mesh errs by as much in the shear forces
    errors = benchmark_error("B", 0, "q1")
    assert (errors > 0.015).all()
    assert (errors < 0.05).all()


def test_full_slip_has_exactly_the_friction_coefficient():
    result = benchmark("B", 0)
    assert result.tangential_force[-1] == pytest.approx(0.3 * result.normal_force[-1], rel=1e-9)
    assert (result.tangential_force <= 0.3 * result.normal_force * (1.0 + 1e-9)).all()
    # reached only near 2.6 mm, whatever the mesh
    full = np.isclose(result.tangential_force, 0.3 * result.normal_force, rtol=1e-7)
    assert 2.2 < result.position[full].min() < 2.9


# -- symmetry --------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [{}, {"law": Kaczmarek(), "voltage": 3000.0}], ids=["plain", "attracted"])
def test_sliding_the_other_way_is_the_mirror_image(options):
    forth, back = (
        run(Display(), Press(indentation=0.3, steps=3), Slide(d, steps=6), **options) for d in (0.6, -0.6)
    )
    same = (
        "applied_force",
        "normal_force",
        "electrostatic_force",
        "contact_width",
        "stored_energy",
        "min_gap",
    )
    np.testing.assert_allclose(columns(back, *same), columns(forth, *same), rtol=1e-7, atol=1e-9)
    signed = ("tangential_force", "applied_tangential_force", "electrostatic_force_x", "position")
    np.testing.assert_allclose(columns(back, *signed), -columns(forth, *signed), atol=1e-9)
    assert (forth.tangential_force[3:] > 0).all()


# -- balances --------------------------------------------------------------------------------------

BALANCED = {
    "flat": {"surface": Display(friction=0.5)},
    "vertical": {"surface": Display(), "law": Kaczmarek(), "voltage": 3000.0},
    "normal": {"surface": Display(), "law": Kaczmarek(), "voltage": 3000.0, "direction": "normal"},
    "no_air": {"surface": Display(), "law": StrongTroxel(), "voltage": 500.0, "air_layer": False},
    "sinusoid": {"surface": Sinusoid(friction=0.2, terms=[[0.02, 3.0, 0.0]])},
    "steep": {"surface": Sinusoid(friction=0.6, terms=[[0.08, 4.0, 0.0]])},
    "texture": {
        "surface": Sinusoid(0.2, [[0.02, 3.0, 0.0]], None, INSULATOR),
        "law": Kaczmarek(),
        "voltage": 2000.0,
        "direction": "normal",
    },
}


@pytest.mark.parametrize("options", BALANCED.values(), ids=BALANCED.keys())
@pytest.mark.parametrize("hold", ["indentation", "force"])
def test_forces_balance_as_vectors_in_every_row(options, hold):
    options = dict(options)
    result = run(options.pop("surface"), *_holding(hold), **options)
    assert balance(result).max() < 1e-7
    if hold == "force":
        np.testing.assert_allclose(result.applied_force[2:], 0.03, rtol=1e-7)
    else:
        np.testing.assert_allclose(result.indentation[3:], result.indentation[2], rtol=1e-14)


def _holding(hold):
    return Press(force=0.03, steps=3), Slide(0.5, steps=5, hold=hold)


# -- history and checkpoints -----------------------------------------------------------------------


def test_rows_are_numbered_by_step_and_motion():
    there = Hover(0.1), Press(indentation=0.2, steps=2), Slide(-0.3, steps=3, speed=10.0)
    result = run(Flat(), *there, Press(force=0.01, steps=1), output=Output(every=3))
    assert result.step.tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert result.motion_index.tolist() == [0, 1, 1, 2, 2, 2, 3]
    assert result.motion.tolist() == ["hover", "press", "press", "slide", "slide", "slide", "press"]
    np.testing.assert_allclose(result.indentation[:6], [-0.1, 0.05, 0.2, 0.2, 0.2, 0.2], rtol=1e-12)
    np.testing.assert_allclose(result.position, [0.0, 0.0, 0.0, -0.1, -0.2, -0.3, -0.3], atol=1e-15)
    np.testing.assert_allclose(result.time, [0.0, 0.0, 0.0, 0.01, 0.02, 0.03, 0.03], rtol=1e-12)
    assert [frame.step for frame in result.frames] == [3, 6, 7]
    assert (result.tangential_force[3:6] < 0).all()
    assert result.applied_force[-1] == pytest.approx(0.01, rel=1e-7)


def in_time():
    """Heavy tissue with branches behind a hand, and probes."""
    law = NeoHookean(E=0.1, nu=0.4, density=1e-6, relaxation=((0.5, 2e-3),))
    body = MeshedFinger(block(8, 3, sag=0.4), {"tissue": law}, viscosity=1e-3)
    output, solver = Output(probes={"two": [[-0.7, 0.6], [0.7, 0.6]]}), Solver(dynamics="inertial")
    hand = Hand(0.2, 1e-4, 1e-7)
    return Scene(body, Flat(friction=0.4), motion=IN_TIME, solver=solver, hand=hand, output=output)


SOFT = Display(elastic=ElasticLayer(E=0.2, nu=0.48, thickness=2.0))
RESUMED = {
    "time": in_time(),
    "nearly incompressible": Scene(finger(block(8, 3, sag=0.4), nu=0.49999), Flat(), motion=PRESS_AND_SLIDE),
    "elastic surface": Scene(coarse_pad(), SOFT, StrongTroxel(), 800.0, PRESS_AND_SLIDE),
}


@pytest.mark.parametrize("after", [1, 4, 5])
@pytest.mark.parametrize("name", RESUMED)
@pytest.mark.filterwarnings("ignore:motion . has steps of", "ignore:probes have")
def test_a_resumed_run_repeats_itself(name, after, tmp_path):
    """In the middle of a motion and between two."""
    whole, again = resumed(RESUMED[name], after, tmp_path)
    for column in set(COLUMNS) - {"motion", "seconds"}:
        np.testing.assert_allclose(again[column], whole[column], rtol=1e-11, atol=1e-15, err_msg=column)
    for found, expected in zip(again.probes.values(), whole.probes.values(), strict=True):
        np.testing.assert_allclose(found.cauchy_stress, expected.cauchy_stress, rtol=1e-9, atol=1e-15)


def test_a_motion_begins_where_the_last_one_ended():
    """Slides are relative; presses, voltages and gaps are absolute and reached in equal parts."""
    motion = [
        Hover(0.2),
        Slide(0.3, steps=2),
        Slide(-0.1, steps=1),
        VoltageRamp(100.0, steps=2),
        VoltageRamp(40.0, steps=2),
        Press(indentation=0.1, steps=2),
        Hover(0.1, steps=1),
    ]
    result = run(Display(), *motion, law=Kaczmarek(), voltage=20.0)
    slid = [0.0, 0.15, 0.3] + [0.2] * 8
    np.testing.assert_allclose(result.position, slid, atol=1e-15)
    np.testing.assert_allclose(result.voltage, [20, 20, 20, 20, 60, 100, 70, 40, 40, 40, 40], rtol=1e-14)
    np.testing.assert_allclose(result.indentation, [-0.2] * 8 + [-0.05, 0.1, -0.1], rtol=1e-13)

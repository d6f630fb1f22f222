"""Whole scenes: the benchmark, symmetry, balances of forces and energies, history and checkpoints."""

import gc
from functools import cache

import numpy as np
import pytest
from tools.builders import (
    INSULATOR,
    balance,
    benchmark_finger,
    benchmark_scene,
    coarse_pad,
    finger,
    resumed,
    small_finger,
)
from tools.meshes import block

import evfem as ev
from evfem import Dugdale, ElasticLayer, Hand
from evfem.circuit.signals import VoltageProfile
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel
from evfem.finger.fingerpad import MeshedFinger
from evfem.newton.condensation import Condensation
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


@pytest.mark.parametrize("options", [{}, {"law": Kaczmarek(), "voltage": 3000.0}], ids=["plain", "attracted"])
def test_sliding_the_other_way_is_the_mirror_image(options):
    forth, back = (
        run(Display(), Press(indentation=0.3, steps=3), Slide(d, steps=6), **options) for d in (0.6, -0.6)
    )
    same = ["applied_force", "normal_force", "electrostatic_force"]
    same += ["contact_width", "stored_energy", "min_gap"]
    np.testing.assert_allclose(columns(back, *same), columns(forth, *same), rtol=1e-7, atol=1e-9)
    signed = ("tangential_force", "applied_tangential_force", "electrostatic_force_x", "position")
    np.testing.assert_allclose(columns(back, *signed), -columns(forth, *signed), atol=1e-9)
    assert (forth.tangential_force[3:] > 0).all()


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


COMES_OFF = (Press(indentation=0.1, steps=2), Press(indentation=-0.25, steps=4))
SOFT = Display(elastic=ElasticLayer(E=0.2, nu=0.48, thickness=2.0))
RESUMED = {
    "time": in_time(),
    "nearly incompressible": Scene(finger(block(8, 3, sag=0.4), nu=0.49999), Flat(), motion=PRESS_AND_SLIDE),
    "elastic surface": Scene(small_finger(), SOFT, StrongTroxel(), 800.0, PRESS_AND_SLIDE),
    "came off": Scene(coarse_pad(), Flat(friction=0.0), motion=COMES_OFF, adhesion=Dugdale(0.01, 0.01)),
}


@pytest.mark.parametrize("name", RESUMED)
@pytest.mark.filterwarnings("ignore:motion . has steps of", "ignore:probes have")
def test_a_resumed_run_repeats_itself(name, tmp_path):
    """In the middle of a motion and between two."""
    steps = (1, 4, 5)
    whole, *runs = resumed(RESUMED[name], *steps, folder=tmp_path)
    assert any("came off" in said for said in whole.warnings) is (name == "came off")
    for after, again in zip(steps, runs, strict=True):
        for column in set(COLUMNS) - {"motion", "seconds"}:
            place = f"{column} after step {after}"
            np.testing.assert_allclose(again[column], whole[column], rtol=1e-11, atol=1e-15, err_msg=place)
        assert again.warnings == whole.warnings, after
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


@pytest.mark.parametrize("direction", ["vertical", "normal"])
def test_load_contact_and_attraction_are_in_balance(direction):
    result = run(Display(), law=Kaczmarek(), voltage=2500.0, direction=direction)
    assert balance(result).max() < 1e-7


def direct_force(mesh, displacement, gap_to, voltage):
    """Quadrature of (8b) over the deformed outline: vertical traction per projected length, edge by edge."""
    s, weight = np.polynomial.legendre.leggauss(12)
    shape = np.array([0.5 * s * (s - 1.0), 0.5 * s * (s + 1.0), 1.0 - s**2])
    slope = np.array([s - 0.5, s + 0.5, -2.0 * s])
    edges = mesh.sides_of("pad")
    place = (mesh.points + displacement)[edges]
    x_s, y = np.einsum("nq,kn->kq", slope, place[..., 0]), np.einsum("nq,kn->kq", shape, place[..., 1])
    gap, reduced, whole = y - gap_to, 0.38 / 1650.0 + 0.09 / 3.35, 0.47
    pressure = 0.5 * 8.8541878128e-12 * voltage**2 / ((gap + reduced) * (gap + whole))
    return float(np.sum(pressure * np.maximum(x_s, 0.0) * weight))


@pytest.mark.parametrize(("gap", "rise"), [(0.25, 0.0084), (0.5, 0.0019)])
def test_hover_force_is_the_integral_over_the_deformed_outline(gap, rise):
    result = run(Display(), Hover(gap), body=benchmark_finger(1), law=Kaczmarek(), voltage=2000.0)
    deformed = direct_force(result.mesh, result.frames[0].displacement, -6.395, 2000.0)
    raised = np.broadcast_to([0.0, gap], result.mesh.points.shape)
    rigid = direct_force(result.mesh, raised, -6.395, 2000.0)
    assert result.electrostatic_force[0] == pytest.approx(deformed, rel=1e-3)
    # exact for the ellipse: 0.40356 and 0.19761 mN/mm; the rise by the tissue giving way: linear elasticity
    assert rigid == pytest.approx({0.25: 0.40356e-3, 0.5: 0.19761e-3}[gap], rel=2e-3)
    assert deformed / rigid - 1.0 == pytest.approx(rise, rel=0.15)
    assert result.normal_force[0] == 0.0
    assert result.applied_force[0] == pytest.approx(-result.electrostatic_force[0], rel=1e-7)
    assert 0.9 * gap < result.min_gap[0] < gap
    assert result.indentation[0] == -gap


def test_without_air_layer_only_the_contact_attracts():
    full = run(Display(), law=Kaczmarek(), voltage=2000.0)
    contact = run(Display(), law=Kaczmarek(), voltage=2000.0, air_layer=False)
    assert (contact.electrostatic_force < full.electrostatic_force).all()
    assert contact.electrostatic_force[0] == 0.0  # nothing touched before the first step
    # eq. (10) with the nodes that touched in the row before, at their present lengths
    assert contact.substeps.tolist() == [1] * 7
    pressure = Kaczmarek().traction(0.0, 2000.0, Layers.of(Layer(0.38, 1650.0), INSULATOR))
    for before, frame, force in zip(
        contact.frames, contact.frames[1:], contact.electrostatic_force[1:], strict=False
    ):
        touching = before.contact_status > 0
        gap = np.maximum(frame.gap[touching], 0.0)
        length = tributary(contact.mesh, frame.displacement)[touching]
        expected = np.sum(
            length * Kaczmarek().traction(gap, 2000.0, Layers.of(Layer(0.38, 1650.0), INSULATOR))
        )
        assert force == pytest.approx(expected, rel=1e-7)
        assert force == pytest.approx(pressure * length.sum(), rel=0.1)
    with pytest.warns(UserWarning, match="nothing touches, and nothing is attracted"):
        hover = run(Display(), Hover(0.1), law=Kaczmarek(), voltage=2000.0, air_layer=False)
    assert hover.electrostatic_force[0] == 0.0


def tributary(mesh, displacement):
    x = (mesh.points + displacement)[:, 0]
    length = np.zeros(len(x))
    for start, end, middle in mesh.sides_of("pad"):
        length[[start, end, middle]] += max(x[end] - x[start], 0.0) * np.array([1.0, 1.0, 4.0]) / 6.0
    return length


def test_a_voltage_profile_follows_the_bone():
    profile = VoltageProfile([0.0, 0.2, 0.2, 0.4], [0.0, 1000.0, 2000.0, 2000.0])
    result = run(Display(), law=Kaczmarek(), voltage=profile)
    np.testing.assert_allclose(result.voltage, [0.0, 0.0, 0.0, 500.0, 2000.0, 2000.0, 2000.0], rtol=1e-12)
    assert result.electrostatic_force[:3].tolist() == [0.0, 0.0, 0.0]
    constant = run(Display(), law=Kaczmarek(), voltage=2000.0)
    assert result.electrostatic_force[-1] == pytest.approx(constant.electrostatic_force[-1], rel=0.05)


def test_a_jump_holds_where_a_way_back_ends_at_it():
    """Steps of -0.1 mm from 0.7 mm arrive at 0.29999999999999993 mm, and beyond it the voltage is 0."""
    profile = VoltageProfile([0.0, 0.3, 0.3, 1.0], [0.0, 0.0, 1000.0, 1000.0])
    back = Press(0.1, steps=1), Slide(0.7, steps=7), Slide(-0.4, steps=4), Slide(-0.1, steps=1)
    result = run(Display(), *back, law=Kaczmarek(), voltage=profile)
    assert result.position[-2] < 0.3 == pytest.approx(result.position[-2], rel=1e-12)
    assert result.voltage.tolist() == [0.0] * 3 + [1000.0] * 9 + [0.0]


def test_a_finished_run_leaves_no_factors_to_the_garbage_collector():
    """They may take most of a run's memory, and many runs follow each other in a sweep or a notebook."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    scene = ev.Scene(pad, ev.Display(), ev.Kaczmarek(), 100.0, ev.Press(force=0.02, steps=1))

    def factors():
        return [one for one in gc.get_objects() if isinstance(one, Condensation)]

    gc.collect()
    before = len(factors())  # of what other tests keep
    gc.disable()
    try:
        ev.simulate(scene)
        assert len(factors()) <= before
    finally:
        gc.enable()

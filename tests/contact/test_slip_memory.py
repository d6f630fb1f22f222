"""Friction that slip renews: a stiff slab under a voltage against closed forms, and fingers that obey it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tools.builders import coarse_pad, finger, left_over, resumed, small_finger, watched
from tools.domes import dome_scene
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.planning.plan import plan
from evfem.scene.file import dump, loads
from evfem.surface.friction import STEEPEST, Renewing

#: the slab is stiffer than tissue, so that its nodes move with the bone
pytestmark = pytest.mark.filterwarnings("ignore:the shear modulus of tissue")

#: 13.8 Hz per mm/s as a length in mm (arXiv:2505.11162)
LENGTH = 1.0 / (2.0 * np.pi * 13.8)
LOAD, MU, WIDTH = 0.04, 0.3, 4.0  # N/mm, 1, mm
SLAB = finger(block(4, 1, width=WIDTH, height=0.02), E=1e6, nu=0.0)
FINE = ev.Solver(tolerance=1e-10)


def slab(law, *motion, voltage=0.0, **more):
    """A slab pressed by LOAD whose nodes move with the bone."""
    settings = {"solver": FINE, "friction_law": law} | more
    pressed = ev.Press(force=LOAD, steps=1), *motion
    display = ev.Display(insulator=ev.Layer(0.001, 3.9), friction=MU)
    return ev.Scene(SLAB, display, ev.StrongTroxel(), voltage, pressed, **settings)


def slid(distance, steps=1, speed=None):
    return ev.Slide(distance, steps=steps, hold="force", speed=speed)


def turned(voltage):
    return ev.VoltageRamp(voltage, steps=1)


@pytest.mark.parametrize(
    ("frequency", "size", "degrees"),
    [(30.0, 0.9941444631, -6.203448), (276.0, 0.7071067812, -45.0), (1000.0, 0.2660525531, -74.570)],
)
def test_the_gain_is_that_of_first_order(frequency, size, degrees):
    """At 20 mm/s; 276 Hz is the cut-off that was measured."""
    gain = ev.forces.slip_memory_gain(frequency, 20.0, LENGTH)
    assert abs(gain) == pytest.approx(size, abs=1e-10)
    assert np.degrees(np.angle(gain)) == pytest.approx(degrees, abs=1e-3)


def test_a_voltage_shows_in_slip_only_and_over_the_length():
    """Switched on at rest it changes nothing; the shares after 5 and 20 um are those of the page."""
    law = ev.SlipMemory(ev.Coulomb(), LENGTH)
    settled = slid(40.0 * LENGTH, steps=40)
    scene = slab(law, turned(0.0), settled, turned(60.0), slid(0.005), slid(0.015, steps=3), settled)
    result = ev.simulate(scene)
    force, normal = result.tangential_force, result.normal_force
    before, on = 41, 42
    assert normal[on] > 2.0 * normal[before]
    assert force[before] == pytest.approx(MU * LOAD, rel=1e-8)
    assert force[on] == pytest.approx(force[before], rel=1e-6)
    share = (force - force[before]) / (MU * normal[on] - force[before])
    assert share[[on + 1, on + 4]] == pytest.approx([0.3517894977, 0.8234514103], abs=3e-8)
    lost = np.diff(result.friction_dissipation)[on : on + 4].sum()
    follows = LENGTH * -np.expm1(-0.02 / LENGTH)
    rise = MU * normal[on] - force[before]
    assert lost == pytest.approx(force[before] * 0.02 + rise * (0.02 - follows), rel=1e-7)


def test_a_square_wave_of_the_voltage_swings_by_its_half_period():
    """At 20 mm/s and 276 Hz, half a period has 36 um of slip: tanh(v/(4 f L)) of the whole swing."""
    half = 20.0 / (2.0 * 276.0)
    law, cycle = ev.SlipMemory(MU, LENGTH), [turned(60.0), slid(half, 2, 20.0), turned(0.0)]
    cycle.append(slid(half, 2, 20.0))
    result = ev.simulate(slab(law, *cycle * 6))
    force, normal = result.tangential_force, MU * result.normal_force
    swing = (force[-4] - force[-1]) / (normal[-4] - normal[-1])
    assert swing == pytest.approx(0.9171523357, abs=1e-8)


def test_a_cosine_of_the_voltage_has_the_gain():
    """The squared voltage follows a cosine. A step sees the pressure of its end, so that the steps have the
    gain of a staircase, which is half a step early: its size is that of the cosine but for (pi / steps)^2.
    """
    frequency, speed, steps, cycles = 276.0, 20.0, 40, 4
    way = cycles * speed / frequency
    wave = ev.Sine(0.5 * frequency, amplitude=60.0)
    law, slide = ev.SlipMemory(MU, LENGTH), slid(way, cycles * steps, speed)
    result = ev.simulate(slab(law, slide, voltage=wave, solver=ev.Solver()))
    assert result.newton_iterations.max() <= 4  # a falling bound is no barrier
    last = slice(-steps, None)
    turn = np.exp(-2j * np.pi * frequency * result.time[last])
    force, drive = ((each[last] * turn).mean() for each in (result.tangential_force, result.normal_force))
    kept = np.exp(-way / (cycles * steps) / LENGTH)
    staircase = (1.0 - kept) / (1.0 - kept * np.exp(-2j * np.pi / steps))
    found, gain = force / (MU * drive), ev.forces.slip_memory_gain(frequency, speed, LENGTH)
    assert found == pytest.approx(staircase, rel=1e-5)
    assert abs(found) == pytest.approx(abs(gain), rel=(np.pi / steps) ** 2)


@pytest.mark.filterwarnings("ignore:motion 1 slides at 0.1 mm")
def test_without_a_time_nothing_depends_on_the_speed():
    law = ev.SlipMemory(ev.LoadIndexFriction(0.005, 0.7), 0.02)
    still, *fast = (ev.simulate(slab(law, slid(0.05, 5, v))).tangential_force for v in (None, 0.1, 90.0))
    for one in fast:
        np.testing.assert_allclose(one, still, rtol=1e-9, atol=1e-12)


def test_at_rest_friction_follows_over_a_time():
    """After a wait of 1.5 s the slab has 1 - exp(-1.5/2) of its friction at once; slip adds the rest."""
    law, wait = ev.SlipMemory(MU, 0.02, time=2.0), ev.Wait(1.5, steps=3)
    result = ev.simulate(slab(law, wait, slid(0.01, 2, speed=5.0)))
    passed = 1.5 / 2.0 + np.array([1.0, 2.0]) * (0.005 / 0.02 + 0.001 / 2.0)
    np.testing.assert_allclose(result.tangential_force[-2:], -MU * LOAD * np.expm1(-passed), rtol=1e-6)


@pytest.mark.filterwarnings("ignore:motion 4 slides at 0.01 mm")
def test_a_slab_that_touches_anew_is_weak():
    again = ev.Hover(0.1, steps=1), ev.Press(force=LOAD, steps=1)
    result = ev.simulate(slab(ev.SlipMemory(MU, 0.01), slid(0.1, 4), *again, slid(0.005)))
    assert result.tangential_force[4] == pytest.approx(MU * LOAD, rel=1e-4)
    assert result.tangential_force[-1] == pytest.approx(-MU * LOAD * math.expm1(-0.5), rel=1e-6)


LAWS = [
    ev.SlipMemory(MU, 0.02, 1.0),
    ev.SlipMemory(ev.Coulomb(), 0.02),
    ev.SlipMemory(ev.LoadIndexFriction(0.005, 0.7), 0.02, 1.0),
    ev.SlipMemory(ev.AdhesiveFriction(0.004), 0.02),
    ev.SlipMemory(ev.RateFriction(5.0, ratio=0.4), 0.02, 1.0),
    ev.SlipMemory(ev.AgeingFriction(0.2, 6.7), 0.02, 1.0),
]
every_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law.friction).__name__)


def nodes(p, before, speed=2.0, mu=0.3, length=0.25, seconds=0.005):
    p = np.asarray(p, dtype=float)
    same = np.ones(p.size)
    at = (p * length, length * same, mu * same, speed * same, 1.5 * same)
    return Renewing(*at, before=np.asarray(before), seconds=seconds)


@every_law
@pytest.mark.parametrize("seconds", [0.005, 0.0])
def test_what_the_active_set_sees_is_the_tangent(law, seconds):
    """Of nodes below, near and above their equilibrium, and one whose pressure has almost gone."""
    p, before = np.array([0.002, 0.006, 0.03, 1e-4]), np.array([0.0, 0.002, 0.02, 0.01])
    speed = 2.0 if seconds else 0.01  # without time a slip in mm

    def at(p=p, **more):
        return nodes(p, before, **{"seconds": seconds, "speed": speed} | more)

    seen, force = at().linearised(law), p * 0.25
    h = 1e-6 * force
    ahead, behind = (at((force + s * h) / 0.25).bound(law) for s in (1, -1))
    np.testing.assert_allclose(seen.slope, (ahead - behind) / (2.0 * h), rtol=1e-6)
    np.testing.assert_allclose(seen.slope * force + seen.offset, at().bound(law), rtol=1e-12)
    faster, slower = (at(speed=speed * (1.0 + s)).bound(law) for s in (1e-5, -1e-5))
    np.testing.assert_allclose(seen.by_speed, (faster - slower) / (2e-5 * speed), rtol=1e-6, atol=1e-9)
    rougher, smoother = (at(mu=0.3 + s).bound(law) for s in (1e-6, -1e-6))
    np.testing.assert_allclose(seen.by_mu, (rougher - smoother) / 2e-6, rtol=1e-6, atol=1e-12)
    assert at().bound(law)[-1] == pytest.approx(STEEPEST * 1e-4 * 0.25, rel=1e-12)


def test_the_update_of_a_node_has_the_shares_of_the_page():
    """From 0 over 5, and 15 um more, of slip; and the square wave that comes back after 36 um."""
    law, there = ev.SlipMemory(MU, LENGTH), 0.01 * MU
    first = nodes([0.01], [0.0], speed=1.0, seconds=0.005).renewed(law)
    second = nodes([0.01], first, speed=3.0, seconds=0.005).renewed(law)
    assert [first[0] / there, second[0] / there] == pytest.approx([0.3517894977, 0.8234514103], abs=1e-10)
    low = np.zeros(1)
    for _ in range(20):
        high = nodes([0.01], low, speed=20.0, seconds=0.5 / 276.0).renewed(law)
        low = nodes([0.0], high, speed=20.0, seconds=0.5 / 276.0).renewed(law)
    assert (high - low)[0] / there == pytest.approx(0.9171523357, abs=1e-10)


@every_law
def test_the_mean_of_a_step_is_that_of_many(law):
    """What a step loses to friction over the slips of a thousand parts of it."""
    p, before, parts = np.array([0.006]), np.array([0.02]), 1000
    now, lost = before, 0.0
    for _ in range(parts):
        one = nodes(p, now, seconds=0.005 / parts)
        now, lost = one.renewed(law), lost + one.resistance(law)[0] / parts
    whole = nodes(p, before)
    assert whole.renewed(law) == pytest.approx(now, rel=1e-10)
    assert whole.resistance(law)[0] == pytest.approx(lost, rel=1e-10)


#: of 40 columns, so that nodes stick, slip and open one by one
SOFT = small_finger(40, 3)
FOLLOWED = [
    ev.Press(force=0.05, steps=2),
    ev.Slide(0.4, steps=4, hold="force"),
    ev.VoltageRamp(0.0, steps=1),
    ev.Slide(-0.3, steps=3, hold="force"),
]


def pressed(law, motion=FOLLOWED, **more):
    display = ev.Display(friction=0.5)
    return ev.Scene(SOFT, display, ev.StrongTroxel(), 100.0, motion, friction_law=law, **more)


def test_the_shorter_the_length_the_nearer_is_coulomb():
    coulomb = ev.simulate(pressed(ev.Coulomb())).tangential_force
    for length, near in ((1e-5, 1e-4 * coulomb.max()), (1e-9, 1e-8)):
        found = ev.simulate(pressed(ev.SlipMemory(0.5, length))).tangential_force
        np.testing.assert_allclose(found, coulomb, atol=near, err_msg=f"length {length}")


def test_nodes_that_open_let_go_of_a_bound_that_lags():
    """At the edge pressures vanish before bounds do: a node that can neither close nor open has no step."""
    motion = [ev.Press(force=0.1, steps=4), ev.Slide(2.0, steps=20, hold="force")]
    scene = ev.Scene(coarse_pad(), ev.Flat(friction=0.5), motion=motion, friction_law=ev.SlipMemory(0.5, 1.0))
    result = ev.simulate(scene)
    assert result.substeps.max() == 1
    assert left_over(result) < 1e-6


def test_every_node_of_a_finger_obeys():
    law = ev.SlipMemory(ev.LoadIndexFriction(0.01, 0.7), 0.05)
    result, kept = watched(pressed(law))
    for k in range(3, len(kept)):
        frame, before, pad = result.frames[k], result.frames[k - 1], result.mesh.node_sets["pad"]
        slips = (frame.contact_status[pad] == 2) & (result.substeps[k] == 1)
        moved = np.abs((frame.displacement - before.displacement)[pad][:, 0])
        p, shear = frame.contact_pressure[pad], np.abs(frame.shear_traction[pad])
        there, old = law.bound(np.maximum(p, 0.0), 0.5, 0.0, 0.0), kept[k - 1]["memory.friction_bound"]
        bound = there + (old - there) * np.exp(-moved / 0.05)
        plain = slips & (p > 0.05 * p.max())
        assert shear[plain] == pytest.approx(bound[plain], rel=1e-5)
        assert (kept[k]["memory.friction_bound"][frame.contact_status[pad] == 0] == 0.0).all()


def test_every_node_of_a_skin_in_space_obeys():
    """A dome that slides at an angle: the shear of a slipping node is its remembered bound, which is what
    the update makes of the last one, its pressure and the size of its slip; an open node has none.
    """
    law = ev.SlipMemory(0.3, 0.05)
    press, slide = ev.Press(indentation=0.3, steps=2), ev.Slide(0.3, steps=3, angle=30.0)
    result, kept = watched(dome_scene(press, slide, friction_law=law))
    assert result.substeps.max() == 1
    pad = result.mesh.node_sets["pad"]
    for k in range(2, len(kept)):
        frame, before = result.frames[k], result.frames[k - 1]
        slips = frame.contact_status[pad] == 2
        moved = np.linalg.norm((frame.displacement - before.displacement)[pad][:, ::2], axis=1)
        there = 0.3 * frame.contact_pressure[pad]
        old, new = (kept[i]["memory.friction_bound"] for i in (k - 1, k))
        bound = there + (old - there) * np.exp(-moved / 0.05)
        assert slips.sum() > 8
        assert new[slips] == pytest.approx(bound[slips], rel=1e-6, abs=1e-9)
        assert frame.shear_traction[pad][slips] == pytest.approx(bound[slips], rel=1e-5, abs=1e-8)
        assert (new[frame.contact_status[pad] == 0] == 0.0).all()


def test_the_books_close_faster_than_the_steps_fall():
    """What is left falls with the square of the step."""
    law, left = ev.SlipMemory(MU, 0.05), []
    soft = finger(block(8, 2), E=0.05, nu=0.3)
    for steps in (10, 20):
        motion = [ev.Press(force=0.004, steps=2), slid(0.2, steps), slid(0.2, steps)]
        scene = ev.Scene(soft, ev.Flat(friction=MU), motion=motion, friction_law=law)
        result = ev.simulate(scene)
        left.append(np.diff(result.integrator_dissipation[[1 + steps, -1]])[0])
        assert left_over(result) < 1e-6
    assert left[0] / left[1] == pytest.approx(4.0, rel=0.25)


def test_a_run_that_is_resumed_remembers_its_friction():
    whole, again = resumed(slab(ev.SlipMemory(MU, 0.01), turned(60.0), slid(0.02, 5)), 4)
    np.testing.assert_array_equal(again.tangential_force, whole.tangential_force)


AGEING = ev.AgeingFriction(0.2)
TEXT = """
version = 1
[surface]
kind = "flat"
friction = 0.4
[surface.friction_law]
kind = "slip_memory"
{}
[[motion]]
kind = "press"
force = 0.05
[[motion]]
kind = "slide"
distance = 1.0
speed = 10.0
steps = 50
"""


def test_a_scene_file_says_what_is_followed():
    for keys, law in {
        "friction = 0.3": ev.SlipMemory(0.3),
        "friction = { kind = 'rate', speed = 3.0 }\ntime = 2.0": ev.SlipMemory(
            ev.RateFriction(3.0), time=2.0
        ),
        "friction = { kind = 'coulomb' }\nlength = 0.05\ntime = inf": ev.SlipMemory(ev.Coulomb(), 0.05),
    }.items():
        scene = loads(TEXT.format(keys))
        assert scene.friction_law == law
        assert loads(dump(scene)) == scene


def test_a_node_that_closes_again_does_not_wedge():
    """A finger that begins to slide fast under an attraction opens nodes at its rear for an iterate. With the
    bound of no force, 20 p, they wedged one after the other: 739 iterations in a step, or no end.
    """
    pad = ev.FingerPad(resolution="coarse", ridges=False, viscosity=0.0168)
    display = ev.Display(ev.Layer(0.178, 10.3), friction=0.77)
    motion = [ev.Press(indentation=0.18, steps=2), ev.Slide(0.4, steps=3, speed=130.0, hold="force")]
    settings = {
        "friction_law": ev.SlipMemory(0.5, 0.2),
        "solver": ev.Solver(element="q1_fbar", dynamics="viscous"),
    }
    result = ev.simulate(ev.Scene(pad, display, ev.Kaczmarek(), 2600.0, motion, breakdown="off", **settings))
    assert result.newton_iterations.max() <= 10
    assert result.substeps.max() == 1


def test_the_plan_says_whether_the_steps_see_it():
    scene = loads(TEXT.format("friction = 0.3"))
    told = next(term.reason for term in plan(scene).terms if term.name == "friction")
    assert "follows the coefficient 0.3 over 0.0115 mm of slip" in told
    assert "up to 0.02 mm, 1.74 lengths: such a step sees the coefficient 0.3" in told
    fine = replace(scene, friction_law=ev.SlipMemory(0.3, 0.1))
    assert "lengths" not in next(term.reason for term in plan(fine).terms if term.name == "friction")


def test_what_cannot_be_is_refused():
    refuses("friction: given SlipMemory", ev.SlipMemory, ev.SlipMemory(0.3))
    refuses("friction: given the class Coulomb", ev.SlipMemory, ev.Coulomb)
    refuses("friction: given -0.1", ev.SlipMemory, -0.1)
    refuses("length: given 0", ev.SlipMemory, 0.3, 0.0)
    refuses("time: given -inf", ev.SlipMemory, 0.3, 0.01, -math.inf)
    refuses("frequency", ev.forces.slip_memory_gain, -1.0, 20.0, LENGTH)
    refuses(r"motion\[1\].speed", slab, ev.SlipMemory(0.3, time=1.0), slid(0.1))
    refuses("slip renews", ev.impedance, slab(ev.SlipMemory(0.3), slid(0.1)), 10.0)

    class Pulling:
        def bound(self, pressure, mu, speed, age):
            return mu * pressure - 0.01

    refuses("not negative", plan, slab(ev.SlipMemory(Pulling()), slid(0.1)))

"""Laws of friction: their formulas, what the active set sees of them, and a slab that obeys them."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import benchmark_finger, finger, left_over, resumed
from tools.meshes import block
from tools.refusals import refuses

import evfem as ev
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.planning.plan import plan
from evfem.protocols import FrictionLaw
from evfem.scene.file import dump, loads
from evfem.surface.friction import KINDS, Renewing, Slipping
from evfem.terms.slipping import OscillatingNodes, speed_under

LOAD_INDEX = ev.LoadIndexFriction(pressure=0.005, index=0.7)
ADHESIVE = ev.AdhesiveFriction(strength=0.004)
STRIBECK = ev.RateFriction(speed=5.0, ratio=0.4)
POWER = ev.RateFriction(speed=5.0, exponent=0.25)
AGEING = ev.AgeingFriction(fresh=0.2, time=6.7)
LAWS = [ev.Coulomb(), LOAD_INDEX, ADHESIVE, STRIBECK, POWER, AGEING]
every_law = pytest.mark.parametrize(
    "law", LAWS, ids=["coulomb", "load_index", "adhesive", "stribeck", "power", "ageing"]
)


class Own:
    """A bound that saturates; it drops imaginary parts."""

    def bound(self, pressure, mu, speed, age):
        return mu * 0.01 * np.tanh(np.abs(pressure) / 0.01)


def nodes(p, mu=0.3, speed=2.0, age=1.5, length=0.25):
    p = np.asarray(p, dtype=float)
    same = np.ones(p.size)
    return Slipping(p * length, length * same, mu * same, speed * same, age * same)


def test_the_bounds_are_the_formulas_of_the_page():
    p, v, t = 0.008, 2.0, 1.5
    expected = [
        0.3 * p,
        0.3 * 0.005 * (p / 0.005) ** 0.7,
        0.004 + 0.3 * p,
        0.3 * p * (0.4 + 0.6 * np.exp(-v / 5.0)),
        0.3 * p * (v / 5.0) ** 0.25,
        0.3 * p * (1.0 - 0.8 * np.exp(-t / 6.7)),
    ]
    for law, value in zip(LAWS, expected, strict=True):
        assert law.bound(p, 0.3, v, t) == pytest.approx(value, rel=1e-14)
        assert isinstance(law, FrictionLaw)
    assert LOAD_INDEX.bound(1e-6, 0.3, v, t) == pytest.approx(0.3 * 1e-6 * 0.01**-0.3, rel=1e-14)
    assert ADHESIVE.bound(0.001, 0.3, v, t) == pytest.approx(1.3 * 0.001, rel=1e-14)
    assert POWER.bound(p, 0.3, 0.0, t) == pytest.approx(0.3 * p * 0.01**0.25, rel=1e-14)
    assert AGEING.bound(p, 1.0, v, 20.0) == pytest.approx(p * (1.0 - 0.8 * np.exp(-20.0 / 6.7)), rel=1e-14)


@pytest.mark.parametrize("law", [*LAWS, Own()])
def test_what_the_active_set_sees_is_the_tangent(law):
    """Slope and offset by differences of the bound in N/mm by the contact force in N/mm."""
    p = np.array([0.002, 0.006, 0.03])
    seen = nodes(p).linearised(law)
    force = p * 0.25
    h = 1e-6 * force
    ahead, behind = (nodes((force + s * h) / 0.25).bound(law) for s in (1, -1))
    np.testing.assert_allclose(seen.slope, (ahead - behind) / (2.0 * h), rtol=1e-6)
    np.testing.assert_allclose(seen.slope * force + seen.offset, nodes(p).bound(law), rtol=1e-12)
    faster, slower = (nodes(p, speed=2.0 + s).bound(law) for s in (1e-5, -1e-5))
    np.testing.assert_allclose(seen.by_speed, (faster - slower) / 2e-5, rtol=1e-6, atol=1e-9)
    rougher, smoother = (nodes(p, mu=0.3 + s).bound(law) for s in (1e-6, -1e-6))
    np.testing.assert_allclose(seen.by_mu, (rougher - smoother) / 2e-6, rtol=1e-6)


def test_a_law_that_grows_faster_than_the_load_has_its_chord():
    law = ev.LoadIndexFriction(pressure=0.005, index=1.5)
    seen = nodes([0.02]).linearised(law)
    assert seen.offset[0] == 0.0
    assert seen.slope[0] == pytest.approx(0.3 * 2.0, rel=1e-12)  # mu (p / p0)^(n - 1)


SLAB = block(20, 1, width=4.0, height=0.02)
N, P = 0.04, 0.01  # N/mm on 4 mm


def slab(law, *slides, mu=0.3, **more):
    motion = [ev.Press(force=N, steps=1), *slides]
    return ev.Scene(
        finger(SLAB, E=5.0, nu=0.0), ev.Flat(friction=mu), motion=motion, friction_law=law, **more
    )


def slid(speed=None, distance=0.05, steps=3):
    return ev.Slide(distance, steps=steps, hold="force", speed=speed)


@pytest.mark.parametrize(
    ("law", "ratio", "near"),
    [
        (ev.Coulomb(), 0.3, 1e-9),
        (LOAD_INDEX, 0.3 * (P / 0.005) ** -0.3, 1e-4),
        (ev.LoadIndexFriction(0.005, 1.5), 0.3 * (P / 0.005) ** 0.5, 3e-4),
        (ADHESIVE, 0.3 + 0.004 / P, 1e-4),
    ],
    ids=["coulomb", "load index", "load index above 1", "adhesive"],
)
def test_a_slab_slides_with_the_force_of_its_uniform_pressure(law, ratio, near):
    """The law of the whole slab is that of its nodes up to the roll of a pad 200 times as wide as high."""
    for sign in (1.0, -1.0):
        result = ev.simulate(slab(law, slid(distance=sign * 0.05)))
        assert result.tangential_force[-1] == pytest.approx(sign * ratio * N, rel=near)
        assert result.newton_iterations.max() <= 8
        assert left_over(result) < 1e-9
        # the last two steps are full slip all the way
        way = np.diff(result.position)[-1] * sign
        assert np.diff(result.friction_dissipation)[-1] == pytest.approx(ratio * N * way, rel=near)


@pytest.mark.filterwarnings("ignore:friction falls with the speed")
@pytest.mark.parametrize("speed", [1.0, 30.0])
@pytest.mark.parametrize(
    ("law", "ratio"),
    [
        (STRIBECK, lambda v: 0.3 * (0.4 + 0.6 * np.exp(-v / 5.0))),
        (POWER, lambda v: 0.3 * (v / 5.0) ** 0.25),
        (ev.RateFriction(5.0, exponent=-0.25), lambda v: 0.3 * (v / 5.0) ** -0.25),
    ],
    ids=["stribeck", "power", "weakening power"],
)
def test_a_slab_slides_with_the_force_of_its_speed(law, ratio, speed):
    result = ev.simulate(slab(law, slid(speed, steps=5)))
    np.testing.assert_allclose(result.tangential_force[-2:], ratio(speed) * N, rtol=1e-8)
    assert left_over(result) < 1e-9


def test_what_depends_on_the_speed_converges_quadratically():
    """A soft block under friction that grows fast with the speed: without its derivative by the slip
    the iterations do not settle.
    """
    soft = ev.Scene(
        finger(block(8, 2), E=0.05, nu=0.3),
        ev.Flat(friction=0.1),
        motion=[ev.Press(force=0.004, steps=1), slid(1.0, distance=0.06, steps=6)],
        friction_law=ev.RateFriction(0.5, ratio=3.0),
    )
    result = ev.simulate(soft)
    assert result.substeps.tolist() == [1] * 7
    assert result.newton_iterations.max() <= 8


def test_friction_that_rises_steeply_from_rest_neither_cuts_nor_stops_a_step():
    """Its tangent, extrapolated back to rest, holds nodes there which the friction of rest does not:
    they would slip and stick by turns, at any length of a part.
    """
    soft = ev.Scene(
        finger(block(8, 2), E=0.05, nu=0.3),
        ev.Flat(friction=0.3),
        motion=[ev.Press(force=0.02, steps=1), slid(1.0, distance=0.02)],
        friction_law=ev.RateFriction(1.35, ratio=1.45, exponent=0.13),
    )
    result = ev.simulate(soft)
    assert result.substeps.tolist() == [1] * 4
    assert result.newton_iterations.max() <= 30


def test_a_node_that_sticks_again_slips_along_the_chord_from_rest():
    seen = nodes([0.01, 0.01, 0.01], speed=np.array([0.0, 2.0, 40.0]))
    rest = nodes([0.01] * 3, speed=np.zeros(3)).bound(POWER)
    np.testing.assert_allclose(rest + seen.chord(POWER) * seen.speed, seen.bound(POWER), rtol=1e-12)
    assert seen.chord(POWER)[0] == 0.0
    returned = OscillatingNodes(4)
    returned.watch(np.array([0, 1, 3]), np.array([STICK, FORWARD, BACKWARD]), np.zeros(3))
    returned.watch(np.array([0, 1, 3]), np.array([FORWARD, STICK, OPEN]), np.zeros(3))
    assert returned.nodes.tolist() == [False, True, False, False]


@pytest.mark.parametrize(
    ("speeds", "returned"),
    [((1.0, 3.0, 1.1, 2.9), True), ((1.0, 3.0, 2.5, 2.55), False), ((1.0, 2.0, 3.0, 4.0), False)],
)
def test_a_node_whose_speed_goes_to_and_fro_has_returned(speeds, returned):
    nodes, one = OscillatingNodes(1), np.array([0])
    for speed in speeds:
        nodes.watch(one, np.array([BACKWARD]), np.array([speed]))
    assert nodes.nodes.tolist() == [returned]


def test_the_slope_of_friction_of_a_node_that_sticks_again_is_the_steepest_until_it_is_near():
    """Node 0 has never stuck; node 1 has: chord, tangent and its last slope, and that alone at rest."""
    returned, both = OscillatingNodes(2), np.array([0, 1])
    returned.watch(both, np.array([FORWARD, FORWARD]), np.zeros(2))
    returned.watch(both, np.array([FORWARD, STICK]), np.zeros(2))

    def slopes(slip, tangent, chord):
        return returned.slopes(both, np.full(2, slip), np.full(2, tangent), np.full(2, chord)).tolist()

    assert slopes(0.0, 9.0, 9.0) == [0.0, 0.0]
    assert slopes(1.0, 2.0, 5.0) == [2.0, 5.0]
    assert slopes(0.0, 9.0, 9.0) == [0.0, 5.0]
    assert slopes(0.5, 3.0, 1.0) == [3.0, 5.0]
    assert slopes(1.0, 7.0, 6.0) == [7.0, 7.0]
    assert slopes(0.9, 1.0, 6.0) == [1.0, 1.0]


@pytest.mark.parametrize("stiffness", [1e-9, 1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("beyond", [1.0001, 1.01, 1.5])
@pytest.mark.parametrize("start", [0.3, 1.2, 30.0])
def test_a_node_that_has_returned_finds_its_speed_around_the_kink_of_a_law(stiffness, beyond, start):
    """A spring F0 - S v against friction that is flat up to 0.05 mm/s and a power of the speed beyond,
    with a slight slope below: equilibrium at `beyond` times the kink, iterations from elsewhere.
    """
    law, one = ev.RateFriction(speed=5.0, ratio=1.1, exponent=0.25), np.array([0])
    kink = 0.05

    def bound(v):
        return float(nodes([0.01], speed=v).bound(law)[0])

    given = bound(beyond * kink) + stiffness * beyond * kink
    returned = OscillatingNodes(1)
    for status in (FORWARD, STICK):
        returned.watch(one, np.array([status]), np.zeros(1))
    misfits = []
    for v in (40.0 * kink, start * kink):
        returned.linearised(law, nodes([0.01], speed=v), one, np.array([FORWARD]), np.array([given]))
    force = given - stiffness * v
    for _ in range(12):
        misfits.append(abs(force - bound(v)) / force)
        status = np.array([FORWARD if v > 0.0 else STICK])
        seen = returned.linearised(law, nodes([0.01], speed=v), one, status, np.array([force]))
        held = seen.slope[0] * 0.01 * 0.25 + seen.offset[0]
        v = max(v + (given - stiffness * v - held) / (stiffness + seen.by_speed[0]), 0.0)
        force = given - stiffness * v
    assert misfits[-1] < 1e-12
    assert v == pytest.approx(beyond * kink, rel=1e-6)


@pytest.mark.parametrize(
    ("lifted", "solution"), [(-0.3, "slips"), (0.5, "slips"), (0.99, "slips"), (1.001, "open"), (1.3, "open")]
)
def test_a_node_that_its_own_friction_presses_opens_where_that_holds_it_no_longer(lifted, solution):
    """N = k T - N0 under a remembered bound S: T = S is a solution up to N0 = S (k - 1/20), and open one from
    N0 = 0 on. The iterate of the contact problem is the root of the tangent; open, where that is none.
    """
    S, k, law = 3e-4, 0.07, ev.SlipMemory(0.5, length=1.0)
    away = lifted * S * (k - 1.0 / 20.0)
    oscillating, one = OscillatingNodes(1), np.array([0])
    T, N, status = S, k * S - min(away, 0.0), FORWARD
    for _ in range(12):
        plain = nodes([N / 0.25], speed=1e-9)
        node, at = Renewing(**vars(plain), before=np.array([S / 0.25])), np.array([status])
        at = np.where(oscillating.wedges(law, node, one, at), OPEN, at)
        seen = oscillating.linearised(law, node, one, at, np.array([T]))
        slope, offset = float(seen.slope[0]), float(seen.offset[0])
        begins_open = at[0] == OPEN and away >= 0.0
        N = 0.0 if begins_open else max((k * offset - away) / (1.0 - k * slope), 0.0)
        status, T = (FORWARD, slope * N + offset) if N > 0.0 else (OPEN, 0.0)
    assert (status == FORWARD) == (solution == "slips")
    assert pytest.approx(S if status == FORWARD else 0.0, rel=1e-6) == T


def test_the_speed_under_a_force_is_that_of_the_law_or_none():
    """Rest bears the first force, the second is that of 2 mm/s, the last one is beyond the fastest."""
    seen = nodes([0.01] * 4, speed=np.array([7.0, 7.0, 0.0, 1.0]))
    at = [replace(seen, speed=np.full(4, v)).bound(POWER)[0] for v in (0.0, 2.0, 9.0)]
    found = speed_under(POWER, seen, np.array([at[0], at[1], at[1], at[2]]), np.full(4, 8.0))
    np.testing.assert_allclose(found, [0.0, 2.0, 2.0, 0.0], rtol=1e-12)


def test_friction_around_the_kink_of_its_law_is_found_without_many_cuts():
    """A pad turned round, whose nodes slip around the slowest speed of the law, where its slope jumps."""
    fast = ev.Slide(1.0, steps=2, speed=96.0, hold="force")
    motion = [ev.Press(force=0.08, steps=1), fast, replace(fast, distance=-0.15, speed=105.0)]
    law = ev.RateFriction(speed=4.25651, ratio=1.17422, exponent=0.166983)
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    result = ev.simulate(ev.Scene(pad, ev.Flat(friction=0.6), motion=motion, friction_law=law))
    assert result.substeps.max() <= 2
    assert result.newton_iterations.max() <= 40


@pytest.mark.filterwarnings("ignore:motion 3 slides at 0.01 mm")
def test_a_slab_that_rests_ages_and_one_that_touches_anew_is_fresh():
    wait = ev.Wait(10.0, steps=2)
    again = [ev.Hover(0.1, steps=1), ev.Press(indentation=4e-5, steps=1)]
    scene = slab(AGEING, wait, slid(1.0), slid(0.01), *again, slid(1.0, distance=0.01))
    result = ev.simulate(scene)
    old = 0.3 * N * (1.0 - 0.8 * np.exp(-result.time / 6.7))
    np.testing.assert_allclose(result.tangential_force[3:9], old[3:9], rtol=1e-9)
    since = result.time[-3:] - result.time[-4]
    young = 0.3 * result.normal_force[-3:] * (1.0 - 0.8 * np.exp(-since / 6.7))
    np.testing.assert_allclose(result.tangential_force[-3:], young, rtol=1e-9)


@pytest.mark.parametrize("law", [LOAD_INDEX, ADHESIVE], ids=["load index", "adhesive"])
def test_every_node_of_a_finger_obeys(law):
    scene = ev.Scene(
        benchmark_finger(),
        ev.Display(friction=[[0.0, 0.2], [0.5, 0.4]]),
        ev.Kaczmarek(),
        800.0,
        [ev.Press(force=0.03, steps=2), slid(distance=0.5)],
        friction_law=law,
    )
    result = ev.simulate(scene)
    frame, pad = result.frames[-1], result.mesh.node_sets["pad"]
    x = (result.mesh.points[:, 0] + frame.displacement[:, 0])[pad]
    p, shear, status = (
        values[pad] for values in (frame.contact_pressure, frame.shear_traction, frame.contact_status)
    )
    bound = law.bound(np.maximum(p, 0.0), scene.surface.friction_coefficient(x), 0.0, 0.0)
    facing = (p > 1e-3 * p.max()) & (status > 0)
    slips = facing & (status == 2)
    assert slips.sum() > 3
    np.testing.assert_allclose(np.abs(shear[slips]), bound[slips], rtol=1e-6)
    assert (np.abs(shear) <= bound + 1e-6 * bound.max())[facing].all()
    assert left_over(result) < 1e-6


def test_a_wished_friction_force_is_found_under_a_law():
    """The voltage of a slab whose friction grows with the power 0.7 of the load, in closed form."""
    wish = ev.FollowForce([0.0, 0.05], [0.02, 0.02], 3000.0)
    scene = ev.Scene(
        finger(SLAB, E=5.0, nu=0.0),
        ev.Display(friction=0.3),
        ev.StrongTroxel(),
        wish,
        [ev.Press(force=N, steps=1), slid(steps=4)],
        friction_law=LOAD_INDEX,
    )
    result = ev.simulate(scene)
    np.testing.assert_allclose(result.applied_tangential_force[-2:], 0.02, rtol=1e-7)
    load = 4.0 * 0.005 * (0.02 / 4.0 / (0.3 * 0.005)) ** (1.0 / 0.7)
    assert result.normal_force[-1] == pytest.approx(load, rel=1e-3)


def test_a_run_that_is_resumed_remembers_how_old_its_contact_is():
    whole, again = resumed(slab(AGEING, ev.Wait(10.0, steps=2), slid(1.0)), 3)
    np.testing.assert_array_equal(again.tangential_force, whole.tangential_force)


TEXT = """
version = 1
[finger]
resolution = "coarse"
[surface]
kind = "flat"
LAW
[[motion]]
kind = "press"
force = 0.05
[[motion]]
kind = "slide"
distance = 1.0
speed = 10.0
"""


@every_law
def test_a_scene_file_says_it_and_a_dumped_one_too(law):
    keys = "\n".join(f"{name} = {value}" for name, value in vars(law).items() if value is not None)
    scene = loads(TEXT.replace("LAW", f'[surface.friction_law]\nkind = "{law.kind}"\n{keys}'))
    assert scene.friction_law == law
    assert loads(dump(scene)) == scene
    reason = next(term.reason for term in plan(scene).terms if term.name == "friction")
    assert reason.startswith(type(law).__name__)
    assert KINDS[law.kind] is type(law)


def test_what_cannot_be_is_refused():
    refuses(r"motion\[1\].speed", slab, STRIBECK, slid())
    refuses("friction_law", slab, 0.3, slid())
    refuses("for a file", dump, slab(Own(), slid()))

    class Pulling:
        def bound(self, pressure, mu, speed, age):
            return mu * pressure - 0.01

    refuses("not negative", plan, slab(Pulling(), slid()))

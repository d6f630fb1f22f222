"""Where skin and surface meet: slips and forces on a slope, and states that break the laws."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.domes import LINEAR, Dome, dome, dome_scene
from tools.steps import begin_under

import evfem as ev
from evfem.common import constants
from evfem.common.constants import WEAK
from evfem.contact.condensed import Candidates
from evfem.contact.follower import FollowerStiffness
from evfem.contact.signorini import OPEN, SLIP, STICK
from evfem.newton.linearisation import Linearisation
from evfem.simulation.model import make_model
from evfem.surface.pad import surface_state

RAMP = ev.Sinusoid(terms=[[0.4, 1.0, 0.0]], friction=0.3)


def touching(surface, force, moved, status):
    """The interface of a dome and a state before and after its lowest node (free, on the surface)
    has moved by (x, z) and stayed on it, under this contact force.
    """
    model = make_model(dome_scene(ev.Press(indentation=0.1), surface=surface, law=None, voltage=0.0))
    interface = model.equilibrium.interface
    rest = model.equilibrium.rest(model.bone(0.0, 0.0), 0.0)
    node = int(np.argmin(surface_state(interface.surface, interface.points).gap))

    def on_surface(shift):
        place = rest.u.copy()
        place[interface.pad.nodes[node], ::2] += shift
        state = replace(rest, u=place)
        place[interface.pad.nodes[node], 1] -= surface_state(
            interface.surface, interface.positions(state.u)
        ).gap[node]
        forces, statuses = np.zeros_like(rest.contact_force), rest.status.copy()
        forces[node], statuses[node] = force, status
        return replace(state, contact_force=forces, status=statuses)

    return interface, on_surface(np.zeros(2)), on_surface(np.asarray(moved)), node


FLAT = ev.Flat(friction=0.5)


def test_a_face_that_touches_and_turns_up_is_a_fold():
    interface, old, _, node = touching(FLAT, [10.0, 0.0, 0.0], [0.0, 0.0], STICK)
    assert interface.fold(replace(old, status=np.full_like(old.status, STICK))) is None
    over = old.u.copy()
    over[interface.pad.nodes[node], 0] += 3.0
    place = interface.fold(replace(old, u=over, status=np.full_like(old.status, STICK)))
    assert place is not None
    assert abs(place) < 2.0


def known(x, force):
    """One slipping candidate at x on a curved ramp whose friction grows."""
    x = np.array([x])
    surface = surface_state(RAMP.shifted(0.0), np.column_stack([x, RAMP.height(x), 0.0 * x]))
    zero, one = np.zeros(1), np.array([0.3 + 0.1 * x[0]])
    return Candidates(surface, np.zeros((1, 2)), np.array([force]), np.array([SLIP]), one,
                             np.zeros((1, 3)), zero, zero, np.array([[0.1, 0.0]]))  # fmt: skip


def test_a_force_turns_with_its_node_and_grows_with_friction():
    """The derivative of lam_n n + mu(x) lam_n (cos a t1 + sin a t2), a held, is that of differences."""

    def force(x):
        mu = 0.3 + 0.1 * x
        return np.einsum(
            "a,ak->k", [2.0, 2.0 * mu * 0.6, 2.0 * mu * 0.8], known(x, [0.0, 0.0, 0.0]).surface.axes[0]
        )

    at, h = 0.7, 1e-5
    mu = 0.3 + 0.1 * at
    found = known(at, [2.0, 2.0 * mu * 0.6, 2.0 * mu * 0.8]).follower_rate(np.zeros((1, 2)))[0, :, 0]
    assert_allclose(found, (force(at + h) - force(at - h)) / (2 * h), atol=1e-8)


def test_friction_that_grows_against_the_force_never_pushes_a_node_on():
    """Friction that pushes ahead and grows by 0.12 N/mm takes a compliance of 100 mm/N away; one that
    holds is a spring, also for a node that only its neighbours hold: its own compliance is negative.
    """
    for ahead, own, kept in (
        (0.6, 100.0, False),
        (0.6, 1.0, True),
        (-0.6, 100.0, True),
        (-0.6, -100.0, True),
    ):
        force = [2.0, ahead, 0.8]
        free, found = (known(0.7, force).follower_rate(np.array([[c, c]]))[0] for c in (0.0, own))
        assert (found == free).all() == kept


def test_turning_forces_are_part_of_the_body():
    """u = C (f + T u) for the compliance that comes back, and for motions that come from outside."""
    rng = np.random.default_rng(3)
    A, rate = rng.normal(size=(9, 9)), np.zeros((3, 3, 2))
    C, rate[[0, 2]] = np.eye(9) + 0.1 * A @ A.T, 0.1 * rng.normal(size=(2, 3, 2))
    rate[2, :, 1] = 0.0  # a node on a slope along x alone
    turning, W = FollowerStiffness.of(rate), rng.normal(size=(9, 1))
    T = np.zeros((9, 9))
    for node in range(3):
        T[3 * node : 3 * node + 3, 3 * node + 1 : 3 * node + 3] = rate[node]
    whole = np.linalg.inv(np.eye(9) - C @ T)
    found = turning.apply(C, W)
    assert_allclose(found[0], whole @ C)
    assert_allclose(found[1], whole @ W)
    assert_allclose(turning.force(W[:, 0]), T @ W[:, 0])
    assert_allclose(turning.transposed(W.T), W.T @ T)


TISSUE = ev.NeoHookean(E=0.1, nu=0.45)


def at_rest(voltage=0.0, surface=None, divisions=(12, 2, 12), tissue=TISSUE):
    """Solver, model and state of a dome of many nodes just above the surface."""
    law = ev.Kaczmarek() if voltage else None
    given = {"surface": surface or ev.Flat(friction=0.3), "law": law, "voltage": voltage}
    given["solver"] = replace(LINEAR, core="off")  # the law itself
    finger = Dome(shape=dome(divisions), law=tissue)
    model = make_model(dome_scene(ev.Press(force=0.1), finger=finger, **given))
    state = model.equilibrium.rest(model.bone(0.0, 0.0), voltage)
    return model.equilibrium.body, model, state


def sunk(state, depth):
    """The same, moved down with its bone."""
    down = np.array([0.0, -depth, 0.0])
    return replace(state, u=state.u + down, bone=state.bone + down)


def test_candidates_grow_within_a_step_and_what_has_left_is_let_go_in_the_next():
    body, model, state = at_rest()
    linear, free = body.linearisation, int(model.pad.free.sum())
    linear.begin(state)
    linear.choose_candidates(state, 0.0)
    few = linear.candidates
    assert 0 < few.size < 0.2 * free
    deep = sunk(state, 0.15)
    linear.choose_candidates(deep, 0.0)
    gap = surface_state(model.surface, model.equilibrium.interface.positions(deep.u)).gap
    assert set(np.flatnonzero(gap <= 0.0)) <= set(linear.candidates)
    assert few.size < linear.candidates.size < free
    # a node of the rim touches too: within the step it joins, in the next one the others may go
    rim = int(np.argmax(np.where(model.pad.free, gap, -np.inf)))
    touches = replace(state, status=np.where(np.arange(gap.size) == rim, STICK, OPEN))
    wide = linear.candidates
    linear.choose_candidates(touches, 0.0)
    assert set(linear.candidates) >= {rim, *wide}
    linear.begin(state)
    linear.candidates = wide
    linear.choose_candidates(touches, 0.0)
    assert rim in linear.candidates
    assert linear.candidates.size < wide.size


def test_many_candidates_are_kept_beside_what_touches_where_they_cost_little(monkeypatch):
    """2.5 times as many as touch, or as many as may have m^3 operations in 10 n^2, at least 1.5 times, which
    are those of a small body.
    """
    body, model, state = at_rest()
    linear, deep, large = body.linearisation, sunk(state, 0.05), body.body.pattern.size
    monkeypatch.setattr(constants, "LARGE_BODY", large)
    gap = surface_state(model.surface, model.equilibrium.interface.positions(deep.u)).gap
    sunken = int((gap <= 0.0).sum())
    cases = [(True, 1e3, 2.5), (True, 1e-9, 1.5), (False, 1e3, 1.5), (True, None, 2.0), (True, 1e3, 1.5)]
    for touches, cheap, most in cases:
        if (touches, cheap, most) == cases[-1]:
            monkeypatch.setattr(constants, "LARGE_BODY", large + 1)
        found = 2.0 * sunken
        few = (3.0 * found) ** 3 / (10.0 * large**2) * (1.0 + 1e-9)
        monkeypatch.setattr(constants, "CHEAP", few if cheap is None else cheap)
        linear.begin(replace(state, status=np.full_like(state.status, STICK if touches else OPEN)))
        linear.candidates = linear.candidates[:0]
        linear.choose_candidates(deep, 0.0)
        assert set(np.flatnonzero(gap <= 0.0)) <= set(linear.candidates)
        # neighbours as deep, by symmetry, come together
        assert most * sunken <= linear.candidates.size <= most * sunken + 9


def test_equilibria_do_not_depend_on_what_is_kept_and_for_how_long(monkeypatch):
    """Pressed and slid: other candidates, other rules of renewal, the whole feedback of the attraction."""
    monkeypatch.setattr(constants, "LARGE_BODY", 1)
    made, factorise = [], Linearisation.factorise
    monkeypatch.setattr(Linearisation, "factorise", lambda *given: made.append(1) or factorise(*given))
    motion = [ev.Press(force=0.3, steps=5), ev.Slide(0.05, steps=3, hold="force")]

    def run(**changes):
        made.clear()
        for name, value in changes.items():
            monkeypatch.setattr(constants, name, value)
        finger = Dome(shape=dome((12, 2, 12)), law=TISSUE)
        found = ev.simulate(dome_scene(*motion, finger=finger))
        return np.stack([found.normal_force, found.tangential_force_x]), len(made)

    (forces, few), (others, many) = run(), run(KEPT=1.5, RATES=1)
    monkeypatch.setitem(WEAK, 3, 1e-12)
    assert_allclose(others, forces, atol=1e-7 * np.abs(forces).max())
    assert_allclose(run()[0], others, atol=1e-7 * np.abs(forces).max())
    assert few < many


@pytest.mark.parametrize(("stiff", "many"), [(0.1, False), (1e-3, True)])
@pytest.mark.filterwarnings("ignore:at .* V touching skin")
def test_what_is_attracted_more_than_a_body_holds_is_a_candidate(stiff, many):
    """Ten times the shear modulus over the height, 2 mm, on a node's area."""
    display = ev.Display(y=-0.005, insulator=ev.Layer(thickness=0.01, eps_r=3.35), friction=0.3)
    body, model, state = at_rest(2500.0, display, tissue=ev.NeoHookean(E=stiff, nu=0.45))
    linear = body.linearisation
    linear.begin(state)
    linear.choose_candidates(state, 0.0)
    area = model.pad.tributary(model.equilibrium.interface.positions(state.u))
    most = 10.0 * model.scene.finger.law.shear_modulus / 2.0 * area
    steep = np.flatnonzero(model.pad.free & (linear.weakening(state) > most))
    assert set(steep) <= set(linear.candidates)
    assert (steep.size > 0.2 * model.pad.free.sum()) == many


LAWS = {
    "coulomb": None,
    "load index": ev.LoadIndexFriction(pressure=0.3, index=0.7),
    "adhesive": ev.AdhesiveFriction(strength=0.2),
    "ageing": ev.AgeingFriction(fresh=0.4, time=1.0),
    "rate": ev.RateFriction(speed=1.0, exponent=0.3),
}
MOVED, AT_REST, ASKEW = (0.003, 0.004), (0.0, 0.0), (0.6, 0.8)


def turned(angle):
    """Unit vector against `MOVED`, turned by an angle (rad)."""
    c, s = np.cos(angle), np.sin(angle)
    return -np.array([[c, -s], [s, c]]) @ np.array(MOVED) / 0.005


#: motion (mm) and status of a node, way of its shear and share of the law's bound, height above the
#: surface (mm), and whether it obeys
UNDER_LAWS = {
    "slips": (MOVED, SLIP, turned(0.0), 1.0, 0.0, True),
    "below": (MOVED, SLIP, turned(0.0), 0.999, 0.0, False),
    "beyond": (MOVED, SLIP, turned(0.0), 1.001, 0.0, False),
    "turned a little": (MOVED, SLIP, turned(0.01), 1.0, 0.0, False),
    "turned a little back": (MOVED, SLIP, turned(-0.01), 1.0, 0.0, False),
    "slips nowhere": (AT_REST, SLIP, ASKEW, 1.0, 0.0, True),
    "slips nowhere, below": (AT_REST, SLIP, ASKEW, 0.9, 0.0, False),
    "slips nowhere, beyond": (AT_REST, SLIP, ASKEW, 1.1, 0.0, False),
    "sticks": (AT_REST, STICK, ASKEW, 0.99, 0.0, True),
    "sticks beyond": (AT_REST, STICK, ASKEW, 1.001, 0.0, False),
    "sticks and goes along x": ((1e-5, 0.0), STICK, ASKEW, 0.9, 0.0, False),
    "sticks and goes along z": ((0.0, 1e-5), STICK, ASKEW, 0.9, 0.0, False),
    "lifted": (MOVED, SLIP, turned(0.0), 1.0, 1e-5, False),
    "sunk": (MOVED, SLIP, turned(0.0), 1.0, -1e-5, False),
}


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("case", UNDER_LAWS)
def test_a_state_obeys_every_law_or_not(case, law):
    moved, status, way, share, lift, obeys = UNDER_LAWS[case]
    interface, old, new, node = touching(FLAT, [10.0, 0.0, 0.0], moved, status)
    begin_under(LAWS[law], interface, 0.5)
    # open before, so that contact is fresh
    old = replace(old, status=np.full_like(old.status, OPEN))
    old = old.remembering({"contact_time": np.full(old.status.size, 0.2)})
    limit = 0.5 * 10.0
    if LAWS[law] is not None:
        area = interface.tributary(new)[node]
        speed = 0.005 / 0.5 if moved == MOVED else 0.0
        limit = float(LAWS[law].bound(10.0 / area, 0.5, speed, 0.0) * area)
    force, u = new.contact_force.copy(), new.u.copy()
    force[node, 1:] = share * limit * np.asarray(way)
    u[interface.pad.nodes[node], 1] += lift
    assert interface.obeyed(old, replace(new, u=u, contact_force=force)) is obeys


@pytest.mark.parametrize(("normal", "obeys"), [(1.0, True), (-1e-3, False)])
def test_contact_does_not_pull(normal, obeys):
    """Without friction, so that no cone is broken beside it."""
    interface, old, new, _ = touching(ev.Flat(friction=0.0), [normal, 0.0, 0.0], MOVED, SLIP)
    assert interface.obeyed(old, new) is obeys

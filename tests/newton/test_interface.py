"""Jumps of friction where pad and surface meet: who keeps crossing one is pinned to its rougher side."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

from evfem.common.constants import CHANGES, PIN_OFFSET
from evfem.contact.signorini import OPEN, STICK
from evfem.newton.interface import FrictionJumps
from evfem.scene.motion import Press
from evfem.scene.scene import Scene, Solver
from evfem.simulation.model import make_model
from evfem.surface.surfaces import Flat

ROUND = finger(block(8, 3, sag=0.4))


def interface_and_state(surface, statuses, solver=None):
    """The interface of a pad about 0.1 mm above the surface, and a state whose nodes have these statuses."""
    model = make_model(Scene(ROUND, surface, motion=[Press(indentation=0.1)], solver=solver or Solver()))
    state = model.equilibrium.rest(np.zeros(2), 0.0)
    status = np.resize(statuses, state.status.size)
    return model.equilibrium.interface, replace(state, status=status)


JUMPS = {"rougher": [[-9.0, 0.2], [0.3, 0.2], [0.3, 0.6]], "smoother": [[-9.0, 0.6], [0.3, 0.6], [0.3, 0.2]]}
jumps = pytest.mark.parametrize("table", JUMPS.values(), ids=JUMPS.keys())


def crossing(table, times, smoother=True):
    """FrictionJumps of three nodes: one crosses the jump so many times, one does so in the air, one stays
    away; the first two begin on the smoother side of it, or on the other one.
    """
    surface = Flat(friction=table)
    touching = np.array([True, False, True])
    begin, beyond = (0.2, 0.4) if (table[-1][1] == 0.6) == smoother else (0.4, 0.2)
    pins = FrictionJumps(surface.friction_steps(0.0), np.array([[begin], [begin], [-1.0]]))
    for k in range(times):
        x = beyond if k % 2 == 0 else begin
        pins.watch(np.array([[x], [x], [-1.0]]), touching)
    return surface, pins


@jumps
def test_a_node_that_keeps_crossing_a_jump_is_pinned_to_its_rougher_side(table):
    assert not crossing(table, CHANGES - 1)[1].held.any()
    surface, pins = crossing(table, CHANGES)
    assert pins.held.tolist() == [True, False, False]
    assert abs(pins.place[0, 0] - 0.3) <= 1.001 * PIN_OFFSET
    assert surface.friction_at(pins.place[:1]).tolist() == [0.6]
    assert pins.lower[0] == 0.2


@jumps
def test_a_pinned_node_is_let_go_below_the_lower_limit_and_for_good(table):
    """0.2 of 5 N/mm; it keeps up to 3 N/mm in either direction."""
    _, pins = crossing(table, CHANGES)
    normal = np.full(3, 5.0)
    for shear, weak, free in ((1.1, 0.0, False), (-1.1, 0.0, False), (0.95, 0.1, False), (-0.95, 0.0, True)):
        assert pins.release(pins.lower * normal, np.full(3, shear), weak) == free
        assert pins.held[0] != free
    for x in (0.4, 0.2, 0.4, 0.2, 0.4):
        pins.watch(np.array([[x], [0.2], [-1.0]]), np.full(3, True))
    assert not pins.held[0]
    begin = 0.2 if table[-1][1] == 0.6 else 0.4
    pins.begin(np.full((3, 1), begin))
    for x in (0.6 - begin, begin, 0.6 - begin):
        pins.watch(np.array([[x], [0.2], [-1.0]]), np.full(3, True))
    assert pins.held[0]  # in the next step it may be pinned again


@jumps
def test_contact_takes_a_pinned_node_at_its_jump(table):
    """There it sticks, with the rougher coefficient, wherever it was before the step."""
    interface, old = interface_and_state(Flat(friction=table, y=-0.1), [STICK])
    x = interface.positions(old.u)[:, 0]
    node = int(np.argmin(np.abs(x - 0.3)))
    place = 0.3 + (PIN_OFFSET if table[-1][1] == 0.6 else -PIN_OFFSET)
    interface.jumps.place[node], interface.jumps.lower[node] = place, 0.2
    u = old.u.copy()
    u[interface.pad.nodes, 0] = 0.25
    c, nothing = np.arange(x.size), np.zeros(x.size)
    known = interface.candidates(old, replace(old, u=u), c, nothing, nothing)
    others = c != node
    assert known.slip[node, 0] == pytest.approx(x[node] + 0.25 - place, abs=1e-12)
    np.testing.assert_allclose(known.slip[others], 0.25, atol=1e-12)
    assert known.friction[node] == 0.6
    expected = interface.surface.friction_coefficient(x + 0.25)
    np.testing.assert_array_equal(known.friction[others], expected[others])
    # and so does the check of an iterate, which lets it go where its shear force is below the lower limit
    status, force = np.where(others, OPEN, STICK), np.zeros((x.size, 2))
    u = old.u.copy()
    u[interface.pad.nodes[node]] += [place - x[node], -0.1 - interface.positions(old.u)[node, 1]]
    for shear, obeyed in ((-2.5, True), (3.5, False), (0.5, False)):
        force[node] = [5.0, shear]
        assert interface.obeyed(old, replace(old, u=u, status=status, contact_force=force)) == obeyed
    assert not interface.jumps.held.any()


@jumps
@pytest.mark.parametrize(("shear", "obeyed"), [(2.0, False), (0.9, False), (-2.0, True)])
def test_a_pinned_node_does_not_yield_to_where_nothing_holds_it(table, shear, obeyed):
    """Friction of 0.6 times 5 N/mm holds 2 N/mm on the rougher side; those that push the node through
    the yielding interface on to the smoother one, 0.2 times 5 do not. Nor do 0.9 N/mm, below these 1,
    keep it pinned.
    """
    penalty = Solver(contact="penalty", penalty_normal=1e3, penalty_tangential=1e3)
    interface, old = interface_and_state(Flat(friction=table, y=-0.1), [STICK], penalty)
    position, rougher = interface.positions(old.u), 1.0 if table[-1][1] == 0.6 else -1.0
    node = int(np.argmin(np.abs(position[:, 0] - 0.3)))
    place, force = 0.3 + rougher * PIN_OFFSET, np.array([5.0, rougher * shear])
    interface.jumps.place[node], interface.jumps.lower[node] = place, 0.2
    give = interface.compliance(old)[node]
    u, every = old.u.copy(), np.zeros_like(old.contact_force)
    u[interface.pad.nodes[node]] += [place - give[1] * force[1], -0.1 - give[0] * force[0]] - position[node]
    every[node] = force
    status = np.where(np.arange(len(position)) == node, STICK, OPEN)
    state = replace(old, u=u, status=status, contact_force=every)
    assert interface.obeyed(old, state) == obeyed
    assert interface.jumps.held[node] == obeyed


def test_short_ramps_of_friction_are_jumps_at_their_rougher_end():
    table = [[0.0, 0.2], [1.0, 0.2], [1.01, 0.6], [2.0, 0.6], [2.0, 0.3], [3.0, 0.3], [3.01, 0.1], [5.0, 0.4]]
    surface = Flat(friction=table)
    for short, expected in (
        (0.05, [[1.01, 0.2, 0.6], [2.0, 0.6, 0.3], [3.0, 0.3, 0.1]]),
        (0.005, surface.friction_jumps),
    ):
        (found,) = surface.friction_steps(short)
        assert found.axis == 0
        np.testing.assert_allclose(
            np.column_stack([found.place, found.before, found.behind]), expected, rtol=1e-15
        )

"""Where pad and surface meet: touching nodes rest on the surface, forces follow its normal and
tangent.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

from evfem.common.constants import CHANGES, HAIR
from evfem.contact.signorini import FORWARD, OPEN, STICK
from evfem.scene.motion import Press
from evfem.scene.scene import Scene, Solver
from evfem.simulation.model import make_model
from evfem.solver.interface import Pins, steps_of_friction
from evfem.surface.surfaces import Flat, Sinusoid

ROUND = finger(block(8, 3, sag=0.4))
SURFACES = [Flat(y=-0.1), Sinusoid(terms=[[0.02, 2.0, 0.4]], y=-0.1)]
surfaces = pytest.mark.parametrize("surface", SURFACES, ids=["flat", "sinusoid"])


def interface_and_state(surface, statuses, solver=None):
    """The interface of a pad about 0.1 mm above the surface, and a state whose nodes have these
    statuses.
    """
    model = make_model(Scene(ROUND, surface, motion=[Press(indentation=0.1)], solver=solver or Solver()))
    state = model.equilibrium.rest(np.zeros(2), 0.0)
    status = np.resize(statuses, state.status.size)
    return model.equilibrium.interface, replace(state, status=status)


@surfaces
def test_touching_nodes_rest_on_the_surface_whatever_their_gap(surface):
    """The attraction of a touching node must not depend on the rounding of its gap."""
    interface, state = interface_and_state(surface, [OPEN, STICK, FORWARD])
    here, rest = interface.positions(state.u), interface.resting(state)
    touching = state.status != OPEN
    np.testing.assert_array_equal(rest[:, 0], here[:, 0])
    np.testing.assert_array_equal(rest[~touching], here[~touching])
    height = surface.y + surface.height(here[:, 0])
    np.testing.assert_allclose(rest[touching, 1], height[touching], atol=1e-15)
    assert (here[touching, 1] > height[touching] + 0.01).all()


@surfaces
def test_contact_forces_keep_their_size_and_press_along_the_normal(surface):
    interface, state = interface_and_state(surface, [STICK])
    force = np.random.default_rng(1).normal(size=state.contact_force.shape)
    found = interface.contact_forces(replace(state, contact_force=force))
    angle = np.arctan(surface.slope(interface.points[:, 0]))
    normal, shear = force.T
    expected = shear * np.array([np.cos(angle), np.sin(angle)]) + normal * np.array(
        [-np.sin(angle), np.cos(angle)]
    )
    np.testing.assert_allclose(found, expected.T, atol=1e-14)


# -- jumps of friction

JUMPS = {"rougher": [[-9.0, 0.2], [0.3, 0.2], [0.3, 0.6]], "smoother": [[-9.0, 0.6], [0.3, 0.6], [0.3, 0.2]]}
jumps = pytest.mark.parametrize("table", JUMPS.values(), ids=JUMPS.keys())


def crossing(table, times, smoother=True):
    """Pins of three nodes: one crosses the jump so many times, one does so in the air, one stays
    away; the first two begin on the smoother side of it, or on the other one.
    """
    surface = Flat(friction=table)
    pins, touching = Pins(surface.friction_jumps, 3), np.array([True, False, True])
    begin, beyond = (0.2, 0.4) if (table[-1][1] == 0.6) == smoother else (0.4, 0.2)
    pins.begin(np.array([begin, begin, -1.0]))
    for k in range(times):
        x = beyond if k % 2 == 0 else begin
        pins.watch(np.array([x, x, -1.0]), touching)
    return surface, pins


@jumps
def test_a_node_that_keeps_crossing_a_jump_is_pinned_to_its_rougher_side(table):
    assert not crossing(table, CHANGES - 1)[1].held.any()
    surface, pins = crossing(table, CHANGES)
    assert pins.held.tolist() == [True, False, False]
    assert abs(pins.x[0] - 0.3) <= 1.001 * HAIR
    assert surface.friction_coefficient(pins.x[:1]).tolist() == [0.6]
    assert pins.lower[0] == 0.2


@jumps
def test_a_node_that_leaves_the_rougher_side_is_not_pinned(table):
    """Beyond the jump less friction holds it: it slides on until that does, or stays where it was."""
    assert not crossing(table, 5 * CHANGES, smoother=False)[1].held.any()


@jumps
def test_a_pinned_node_is_let_go_below_the_lower_limit_and_for_good(table):
    """0.2 of 5 N/mm; it keeps up to 3 N/mm in either direction."""
    _, pins = crossing(table, CHANGES)
    normal = np.full(3, 5.0)
    for shear, weak, free in ((1.1, 0.0, False), (-1.1, 0.0, False), (0.95, 0.1, False), (-0.95, 0.0, True)):
        assert pins.release(pins.lower * normal, np.full(3, shear), weak) == free
        assert pins.held[0] != free
    for x in (0.4, 0.2, 0.4, 0.2, 0.4):
        pins.watch(np.array([x, 0.2, -1.0]), np.full(3, True))
    assert not pins.held[0]
    begin = 0.2 if table[-1][1] == 0.6 else 0.4
    pins.begin(np.full(3, begin))
    for x in (0.6 - begin, begin, 0.6 - begin):
        pins.watch(np.array([x, 0.2, -1.0]), np.full(3, True))
    assert pins.held[0]  # in the next step it may be pinned again


@jumps
def test_contact_takes_a_pinned_node_at_its_jump(table):
    """There it sticks, with the rougher coefficient, wherever it was before the step."""
    interface, old = interface_and_state(Flat(friction=table, y=-0.1), [STICK])
    x = interface.positions(old.u)[:, 0]
    node = int(np.argmin(np.abs(x - 0.3)))
    place = 0.3 + (HAIR if table[-1][1] == 0.6 else -HAIR)
    interface.pins.x[node], interface.pins.lower[node] = place, 0.2
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
    assert not interface.pins.held.any()


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
    place, force = 0.3 + rougher * HAIR, np.array([5.0, rougher * shear])
    interface.pins.x[node], interface.pins.lower[node] = place, 0.2
    give = interface.compliance(old)[node]
    u, every = old.u.copy(), np.zeros_like(old.contact_force)
    u[interface.pad.nodes[node]] += [place - give[1] * force[1], -0.1 - give[0] * force[0]] - position[node]
    every[node] = force
    status = np.where(np.arange(len(position)) == node, STICK, OPEN)
    state = replace(old, u=u, status=status, contact_force=every)
    assert interface.obeyed(old, state) == obeyed
    assert interface.pins.held[node] == obeyed


def test_short_ramps_of_friction_are_jumps_at_their_rougher_end():
    table = [[0.0, 0.2], [1.0, 0.2], [1.01, 0.6], [2.0, 0.6], [2.0, 0.3], [3.0, 0.3], [3.01, 0.1], [5.0, 0.4]]
    surface = Flat(friction=table)
    found = steps_of_friction(surface, 0.05)
    np.testing.assert_allclose(found, [[1.01, 0.2, 0.6], [2.0, 0.6, 0.3], [3.0, 0.3, 0.1]])
    np.testing.assert_array_equal(steps_of_friction(surface, 0.005), surface.friction_jumps)


def test_the_surface_is_evaluated_once_for_an_iterate_and_anew_for_the_next():
    asked = []

    class Counted(Flat):
        is_flat = False

        def height(self, x):
            asked.append(x)
            return 0.01 * np.sin(x)

        def slope(self, x):
            return 0.01 * np.cos(x)

        def curvature(self, x):
            return -0.01 * np.sin(x)

    model = make_model(Scene(finger(block(4, 2)), Counted(), motion=Press(indentation=0.01, steps=1)))
    interface, state = model.equilibrium.interface, model.equilibrium.rest(np.zeros(2), 0.0)
    moved = replace(state, u=state.u + np.array([0.3, 0.0]))
    asked.clear()
    here = [interface.surface_at(one) for one in (state, replace(state, voltage=1.0), moved, state)]
    assert here[0] is here[1] is here[3]
    assert len(asked) == 2
    assert here[2].slope == pytest.approx(0.01 * np.cos(interface.positions(moved.u)[:, 0]), abs=1e-15)

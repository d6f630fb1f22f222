"""The dense contact solver under an attraction: scaled where the body cannot hold it, snaps, soft
interfaces, and rough faces whose attraction grows with the contact force.
"""

from dataclasses import replace

import numpy as np
import pytest

from evfem.contact.byforce import ByForce
from evfem.contact.signorini import (
    FORWARD,
    OPEN,
    STICK,
    AttractionStiffness,
    ContactProblem,
    ExtraUnknowns,
)
from evfem.contact.solve import solve_with_attraction


def lost(gap, fall=30.0, closing=12.0):
    """A node of compliance 0.1 mm per N/mm at the gap 1 mm, drawn to `gap` by an attraction it
    cannot hold: its fall times the compliance is 3, so what it moves returns to it threefold.
    """
    problem = ContactProblem(np.array([gap, 0.0]), 0.1 * np.eye(2), np.zeros(1))
    return problem, AttractionStiffness(np.array([fall]), np.array([1.0]), np.array([closing]))


@pytest.mark.parametrize("drift", [-0.02, 0.02])
def test_a_node_that_cannot_be_held_moves_the_right_way(drift):
    problem, pull = lost(gap=1.0 + drift)
    found = solve_with_attraction(problem, pull, np.array([OPEN]))
    # with the fall reduced to nine tenths of what can be held the way is ten times the free one
    assert found.reduced
    assert found.status.tolist() == [OPEN]
    assert found.state[0] == pytest.approx(1.0 + drift / (1.0 - 0.9), rel=1e-12)


def test_an_attraction_that_can_be_held_is_taken_whole_and_a_closed_node_feels_all_of_it():
    problem, pull = lost(gap=0.98, fall=5.0)
    held = solve_with_attraction(problem, pull, np.array([OPEN]))
    assert not held.reduced
    assert held.state[0] == pytest.approx(1.0 - 0.02 / (1.0 - 0.5), rel=1e-12)
    pressed = solve_with_attraction(problem, pull, np.array([FORWARD]))
    assert pressed.status.tolist() == [FORWARD]
    assert pressed.force[0] == pytest.approx(12.0 - 0.98 / 0.1, rel=1e-12)


def test_an_interface_gives_way_to_contact_forces_alone():
    """Attraction does not press it: an open node is held, and moves, as by the body alone."""
    problem, pull = lost(gap=0.98, fall=5.0)
    soft = replace(problem, give=np.array([2.0, 0.0]))
    held = solve_with_attraction(soft, pull, np.array([OPEN]))
    assert not held.reduced
    assert held.state[0] == pytest.approx(1.0 - 0.02 / (1.0 - 0.5), rel=1e-12)
    pressed = solve_with_attraction(soft, pull, np.array([FORWARD]))
    assert pressed.force[0] == pytest.approx((0.1 * 12.0 - 0.98) / (0.1 + 2.0), rel=1e-12)


@pytest.mark.parametrize(("give", "reduced"), [(0.0, False), (2.0, True)])
def test_a_neighbour_on_an_interface_that_gives_way_holds_less(give, reduced):
    """The other node's compliance of 0.1 is 0.1 - 0.09^2 / 0.1 beside a held one, 0.1 - 0.09^2 / 2.1
    beside that one; times the fall of 15 it is 0.285 or 1.44.
    """
    compliance = np.kron([[0.1, 0.09], [0.09, 0.1]], np.eye(2))
    lifted = 0.09 * 0.5 / (0.1 + give)
    problem = ContactProblem(np.array([1.02 - lifted, 0.0, -0.5, 0.0]), compliance, np.zeros(2))
    problem = replace(problem, give=np.array([0.0, 0.0, give, 0.0]))
    pull = AttractionStiffness(np.array([15.0, 0.0]), np.array([1.0, 0.0]), np.zeros(2))
    found = solve_with_attraction(problem, pull, np.array([OPEN, FORWARD]))
    assert found.status.tolist() == [OPEN, FORWARD]
    assert found.reduced == reduced


def test_an_attraction_that_closed_nodes_cannot_hold_moves_its_node_towards_the_surface():
    # the closed node 1 holds a body whose own compliance is negative: feedback on node 0 is 8, alone it is -1
    compliance = np.zeros((4, 4))
    compliance[::2, ::2] = [[-1.0, 3.0], [3.0, -1.0]]
    problem = ContactProblem(np.array([-2.53, 0.0, 1.0, 0.0]), compliance, np.zeros(2))
    pull = AttractionStiffness(np.array([1.0, 0.0]), np.array([0.5, 0.0]), np.zeros(2))
    found = solve_with_attraction(problem, pull, np.array([OPEN, FORWARD]))
    # under the present attraction it would drift by -0.03; the fall is reduced to a feedback of 0.9
    assert found.reduced
    assert found.state[0] == pytest.approx(0.5 - 0.03 / (1.0 - 0.9))


def test_an_attraction_is_scaled_for_nodes_that_open_as_well_as_for_those_that_are_held():
    """Closed, node 0 holds its neighbour: feedback 30 (0.1 - 0.09^2 / 0.1) = 0.57. But it lets go, and two
    open nodes have 30 (0.1 + 0.09) = 5.7: scaled to 0.9 they move ten times their free way of 0.02.
    """
    compliance = np.zeros((4, 4))
    compliance[::2, ::2] = [[0.1, 0.09], [0.09, 0.1]]
    problem = ContactProblem(np.array([1.02, 0.0, 1.02, 0.0]), compliance, np.zeros(2))
    pull = AttractionStiffness(np.full(2, 30.0), np.ones(2), np.zeros(2))
    found = solve_with_attraction(problem, pull, np.array([FORWARD, OPEN]))
    assert found.reduced
    assert found.status.tolist() == [OPEN, OPEN]
    np.testing.assert_allclose(found.state[::2], 1.0 + 0.02 / (1.0 - 0.9), rtol=1e-12)


def test_an_attraction_is_scaled_to_what_the_closed_nodes_hold_where_they_stay():
    """Node 0, pressed, holds its neighbour at 100 x 0.011 = 1.1; without it, 100 x 1.011 = 101 return. Scaled
    to 0.9 of the first the neighbour moves ten times its free way of 0.02, of the other 1.01 times.
    """
    compliance = np.zeros((4, 4))
    compliance[::2, ::2] = [[1.0, 1.0], [1.0, 1.011]]
    problem = ContactProblem(np.array([-50.0, 0.0, 1.02 - 50.0, 0.0]), compliance, np.zeros(2))
    pull = AttractionStiffness(np.array([0.0, 100.0]), np.ones(2), np.zeros(2))
    found = solve_with_attraction(problem, pull, np.array([FORWARD, OPEN]))
    assert found.reduced
    assert found.status.tolist() == [FORWARD, OPEN]
    assert found.state[2] == pytest.approx(1.0 + 0.02 / (1.0 - 0.9), rel=1e-9)


def rough_node(gap, gain, loss=0.0, aside=(0.0, 0.0)):
    """A node of compliance 0.1 mm per N/mm whose attraction grows with its contact force beyond 2 N/mm,
    where it is stronger by 2 gains; `aside`: gain and loss along the tangent.
    """
    problem = ContactProblem(np.array([gap, 0.02]), 0.1 * np.eye(2), np.array([0.5]))
    gains, losses = np.array([[gain, aside[0]]]), np.array([[loss, aside[1]]])
    rough = ByForce(gains, losses, np.array([2.0]))
    return problem, AttractionStiffness(np.zeros(1), np.zeros(1), np.array([2.0 * gain]), rough)


def test_a_rough_node_presses_with_what_its_own_attraction_leaves():
    """Closing it takes -gap / C = 4 N/mm in all, and 0.6 of the contact force are attraction."""
    problem, pull = rough_node(gap=-0.4, gain=0.6)
    found = solve_with_attraction(problem, pull, np.array([STICK]))
    assert found.force[0] == pytest.approx(0.4 / 0.1 / (1.0 - 0.6), rel=1e-12)
    assert found.attraction_drop[0] == pytest.approx(-0.6 * found.force[0], rel=1e-12)
    assert found.state[0] == pytest.approx(0.0, abs=1e-15)
    # friction goes with the contact force, not with what is left of it
    sliding = replace_start(problem, [-0.4, 9.0])
    slipped = solve_with_attraction(sliding, pull, np.array([STICK]))
    assert slipped.status.tolist() == [FORWARD]
    assert slipped.force[1] == pytest.approx(-0.5 * found.force[0], rel=1e-12)


def test_on_a_slope_a_rough_node_is_pulled_sideways_by_what_presses_it():
    """Its 10 N/mm of contact force are 8 more than at present and pull 2.4 N/mm to the side: friction
    holds them against the 0.02 mm / C that it has slipped, or loses 3 N/mm of them as it opens.
    """
    problem, pull = rough_node(gap=-0.4, gain=0.6, aside=(0.3, 0.0))
    held = solve_with_attraction(problem, pull, np.array([STICK]))
    assert held.force[0] == pytest.approx(10.0, rel=1e-12)
    assert held.attraction_drop[1] == pytest.approx(-0.3 * 8.0, rel=1e-12)
    assert held.force[1] == pytest.approx(2.4 - 0.02 / 0.1, rel=1e-12)
    sliding = replace_start(problem, [-0.4, 9.0])
    slipped = solve_with_attraction(sliding, pull, np.array([STICK]))
    assert slipped.state[1] == pytest.approx(9.0 + 0.1 * (-5.0 - 2.4), rel=1e-12)
    problem, pull = rough_node(gap=1.0, gain=0.6, aside=(0.3, 3.0))
    opened = solve_with_attraction(problem, pull, np.array([STICK]))
    assert opened.state[1] == pytest.approx(0.02 + 0.1 * 3.0, rel=1e-12)


def replace_start(problem, start):
    return ContactProblem(np.array(start), problem.compliance, problem.friction)


def test_a_rough_node_that_opens_loses_what_its_contact_force_gained():
    """Drawn off by 1 mm / C it cannot stay; then 3 N/mm of attraction are gone too."""
    problem, pull = rough_node(gap=1.0, gain=0.5, loss=3.0)
    found = solve_with_attraction(problem, pull, np.array([STICK]))
    assert found.status.tolist() == [OPEN]
    assert found.state[0] == pytest.approx(1.0 + 0.1 * 3.0, rel=1e-12)


def test_the_bone_carries_the_attraction_that_contact_forces_add():
    """A force of 2 N/mm on a body: 2 = (1 - kappa) lam."""
    problem, pull = rough_node(gap=0.0, gain=0.75)
    extra = ExtraUnknowns(np.array([[1.0], [0.0]]), np.array([[1.0, 0.0]]), np.zeros((1, 1)), np.array([2.0]))
    whole = ContactProblem(problem.start, problem.compliance, problem.friction, extra)
    found = solve_with_attraction(whole, pull, np.array([STICK]))
    assert found.force[0] == pytest.approx(2.0 / 0.25, rel=1e-12)

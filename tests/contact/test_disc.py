"""Coulomb's disc in three dimensions: the laws themselves, closed forms, and turned frames."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from evfem.contact.signorini import OPEN, SLIP, STICK, ContactNotSolved, ContactProblem
from evfem.contact.solve import solve_contact


def solved(problem, force):
    """From contact forces, and sticking where they are in the cone."""
    normal, *shear = force.reshape(-1, 3).T
    slips = np.hypot(*shear) >= problem.friction * normal
    return solve_contact(problem, np.where(normal > 0.0, np.where(slips, SLIP, STICK), OPEN), force)


def random_problem(seed, k, friction):
    """A random SPD compliance with strong coupling of neighbours and of all directions."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(3 * k, 3 * k))
    return ContactProblem(rng.normal(size=3 * k), np.eye(3 * k) + 0.6 * A @ A.T / k, np.full(k, friction))


def half_space(n, friction, shift=(0.0, 0.0), twist=0.0, push=0.3, nu=0.45):
    """n x n nodes of an elastic half space (shear modulus 1) below a sphere, which has moved by
    `shift` and turned by `twist`: the solutions of Boussinesq and Cerruti (Johnson, Contact
    Mechanics, doi:10.1017/CBO9781139171731, ch. 3), the distance kept from 0.
    """
    place = np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, n)]), axis=-1).reshape(-1, 2)
    k = n * n
    way = place[:, None] - place[None]
    r = np.sqrt((way**2).sum(axis=-1) + (0.9 / n) ** 2)
    C = np.zeros((k, 3, k, 3))
    C[:, 0, :, 0] = (1 - nu) / r
    for a in (0, 1):
        for b in (0, 1):
            C[:, 1 + a, :, 1 + b] = (1 - nu) * (a == b) / r + nu * way[..., a] * way[..., b] / r**3
        C[:, 1 + a, :, 0] = -(0.5 - nu) * way[..., a] / r**2
        C[:, 0, :, 1 + a] = (0.5 - nu) * way[..., a] / r**2
    start = np.zeros((k, 3))
    start[:, 0] = 0.5 * (place**2).sum(axis=1) - push
    start[:, 1:] = shift + twist * np.column_stack([-place[:, 1], place[:, 0]])
    return ContactProblem(start.ravel(), C.reshape(3 * k, 3 * k) / (2 * np.pi), np.full(k, friction)), place


def squeezed(seed, n, friction=0.7, pressure=100.0):
    """n x n nodes of the same half space below an attraction of this `pressure` on closed gaps, which
    grows with the areas between the nodes, and forces (k, 3) under which all of them stick.
    """
    plane, _ = half_space(n, friction)
    k, spacing, index = n * n, 2.0 / (n - 1), np.arange(n * n).reshape(n, n)
    growth = np.zeros((k, 3, k, 3))
    for a, rows in ((1, index.T), (2, index)):  # central differences of the displacements
        for i in range(n):
            growth[rows[i], 0, rows[min(i + 1, n - 1)], a] -= 0.5 * pressure * spacing
            growth[rows[i], 0, rows[max(i - 1, 0)], a] += 0.5 * pressure * spacing
    C = np.linalg.inv(np.linalg.inv(plane.compliance) - growth.reshape(3 * k, 3 * k))
    rng = np.random.default_rng(seed)
    held = np.column_stack([np.ones(k), 0.5 * friction * rng.uniform(-1, 1, (k, 2))])
    held *= pressure * spacing**2 * rng.uniform(0.5, 1.5, (k, 1))
    return ContactProblem(-C @ held.ravel(), C, plane.friction), held


def missed(problem, found):
    """By how much forces, gaps and slips miss the laws of Signorini and Coulomb, without any
    projection: sizes of what must be positive, zero or opposite.
    """
    force, state = found.force.reshape(-1, 3), found.state.reshape(-1, 3)
    normal, shear, gap, slip = force[:, 0], force[:, 1:], state[:, 0], state[:, 1:]
    limit, size, way = problem.friction * normal, np.hypot(*shear.T), np.hypot(*slip.T)
    against = np.abs(shear * way[:, None] + slip * size[:, None]).max(axis=1)
    return max(
        (-normal).max(), (-gap).max(), np.abs(normal * gap).max(), (size - limit).max(),
        np.abs(way * (limit - size))[normal > 0].max(initial=0.0), against[normal > 0].max(initial=0.0),
    )  # fmt: skip


def test_one_node_sticks_below_the_cone_and_slips_against_its_motion_beyond():
    """Unit compliance, 1 mm deep: it presses with 1 and holds slips of 0.3; (3, 4) pulls it along."""
    for slip, force, status in (([0.0, 0.29], [0.0, -0.29], STICK), ([3.0, 4.0], [-0.18, -0.24], SLIP)):
        found = solved(ContactProblem(np.array([-1.0, *slip]), np.eye(3), np.array([0.3])), np.zeros(3))
        assert found.status.tolist() == [status]
        assert_allclose(found.force, [1.0, *force], atol=1e-12)


def test_cohesion_widens_the_disc_of_what_touches():
    """Unit compliance: pressed with 1, mu = 0.3 and c = 0.2 hold slips up to 0.5; open nodes have neither."""
    cohesion, start = np.full(3, 0.2), np.array([-1.0, 0.0, 0.49, -1.0, 3.0, 4.0, 1.0, 3.0, 4.0])
    for friction, held in ((0.3, 0.5), (0.0, 0.2)):
        start[2] = held - 0.01
        problem = ContactProblem(start, np.eye(9), np.full(3, friction), cohesion=cohesion)
        found = solved(problem, np.zeros(9))
        assert found.status.tolist() == [STICK, SLIP, OPEN]
        expected = [1.0, 0.0, 0.01 - held, 1.0, -0.6 * held, -0.8 * held, 0.0, 0.0, 0.0]
        assert_allclose(found.force, expected, atol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("k", [1, 6, 25])
def test_random_problems_are_solved_from_nothing_and_from_anything(k, friction):
    for seed in range(8):
        problem = random_problem(seed, k, friction)
        cold = solved(problem, np.zeros(3 * k))
        warm = solved(problem, np.random.default_rng(seed + 100).normal(size=3 * k))
        for found in (cold, warm):
            assert missed(problem, found) < 1e-9
            assert_allclose(found.state, problem.start + problem.compliance @ found.force, atol=1e-12)
        if friction < 1.0:  # where it is unique
            assert_allclose(cold.force, warm.force, atol=1e-8)


@pytest.mark.parametrize("friction", [0.3, 1.0])
@pytest.mark.parametrize("motion", [((0.02, 0.0), 0.0), ((0.05, -0.05), 0.3), ((0.0, 0.0), 0.1)])
def test_a_sphere_that_slides_and_turns_has_stick_and_slip_in_all_directions(friction, motion):
    problem, _ = half_space(14, friction, *motion)
    found = solved(problem, np.zeros(3 * problem.size))
    assert missed(problem, found) < 1e-10
    assert set(found.status.tolist()) > {OPEN}
    assert (found.status != OPEN).sum() > 20


@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize("seed", range(6))
def test_areas_that_follow_the_nodes_under_a_strong_attraction(seed, n):
    """The pressure is 100 shear moduli: some of the nodes' own compliances are negative. Half of the
    nodes touched before, without friction.
    """
    problem, held = squeezed(seed, n)
    assert np.diagonal(problem.compliance)[::3].min() < 0.0
    before = np.zeros_like(held)
    before[:, 0] = np.where(np.random.default_rng(seed).uniform(size=n * n) < 0.5, held[:, 0], 0.0)
    assert missed(problem, solved(problem, before.ravel())) < 1e-11 * held.max()


def test_statuses_at_hand_are_taken_first():
    """All nodes stuck, and stick again: one solve."""
    for seed in range(6):
        problem, held = squeezed(seed, 6)
        assert solved(problem, 0.9 * held.ravel()).solves == 1


def test_from_slips_that_lead_nowhere_all_nodes_that_touched_stick_first():
    """Forces beyond what friction holds, from nodes that touched without it."""
    problem, held = squeezed(17, 5, 0.3, 30.0)
    assert np.diagonal(problem.compliance).min() < 0.0
    rng = np.random.default_rng(17)
    pushed = held * np.array([1.0, *2 * [rng.uniform(0, 4)]])
    problem = replace(problem, start=-problem.compliance @ pushed.ravel())
    before = np.zeros_like(held)
    before[:, 0] = np.where(rng.uniform(size=25) < 0.5, held[:, 0], 0.0)
    assert missed(problem, solved(problem, before.ravel())) < 1e-11 * held.max()


def test_nodes_of_no_compliance_of_their_own_are_closed_to_rounding():
    """Eight of nine nodes open each other's gaps alone, skew-symmetrically: a gap of rounding would be
    a force of any size in terms of what a node gives way itself.
    """
    rng = np.random.default_rng(5)
    C, normal, held = np.eye(27), rng.normal(size=(8, 8)), np.zeros(27)
    C[:24:3, :24:3] = normal - normal.T + 1e-9 * np.eye(8)
    held[::3] = rng.uniform(1.0, 2.0, 9)
    found = solved(ContactProblem(-C @ held, C, np.full(9, 0.3)), 0.9 * held)
    assert found.status.tolist() == [STICK] * 9
    assert_allclose(found.force, held, atol=1e-12)


def test_what_has_no_solution_is_said_not_to_be_solved():
    """A body that gives way the more, the more it is pressed."""
    with pytest.raises(ContactNotSolved, match="1 of 1 nodes keep changing"):
        solved(ContactProblem(np.array([-1.0, 0.0, 0.0]), -np.eye(3), np.array([0.3])), np.zeros(3))

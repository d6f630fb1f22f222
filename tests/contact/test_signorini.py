"""The dense contact solver against enumeration, non-negative least squares and its own conditions."""

from itertools import product

import numpy as np
import pytest
from scipy.optimize import nnls

from evfem.common.constants import ACTIVE_SET_LIMIT
from evfem.contact import solve
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    ContactNotSolved,
    ContactProblem,
    ExtraUnknowns,
)
from evfem.contact.solve import solve_contact


def random_problem(seed, k, friction):
    """A random SPD compliance with strong coupling of neighbours and of normal and tangential directions."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(2 * k, 2 * k))
    compliance = np.eye(2 * k) + 0.6 * A @ A.T / k
    return ContactProblem(rng.normal(size=2 * k), compliance, np.full(k, friction))


def half_plane(k, friction, push=0.02, shift=0.01):
    """Compliance like that of a half plane under a parabolic punch: logarithmic decay, odd coupling."""
    x = np.linspace(-1.0, 1.0, k)
    distance = np.abs(np.subtract.outer(x, x))
    direct = np.log(4.0 / (distance + 0.6 / k))
    odd = 0.1 * np.sign(np.subtract.outer(x, x)) * (1.0 - np.exp(-10.0 * distance))
    compliance = np.array([[direct, odd], [odd.T, direct]]) * 0.1
    start = np.stack([0.1 * x**2 - push, np.full(k, shift) * (1.0 + 0.3 * x)], axis=1)
    by_node = compliance.transpose(2, 0, 3, 1).reshape(2 * k, 2 * k)
    return ContactProblem(start.ravel(), by_node, np.full(k, friction))


def closed(k):
    return np.full(k, STICK)


def violation(problem, force, state, status=None):
    """Largest violation of Signorini's and Coulomb's conditions, from forces, gaps and slips alone."""
    (normal, shear), (gap, slip) = force.reshape(-1, 2).T, state.reshape(-1, 2).T
    limit = problem.friction * normal
    touching = normal > 1e-9
    slipping = touching & (np.abs(slip) > 1e-9)
    return max(
        (-normal).max(),
        (-gap).max(),
        np.abs(normal * gap).max(),
        (np.abs(shear) - limit).max(),
        np.abs(shear + np.sign(slip) * limit)[slipping].max(initial=0.0),
    )


def enumerate_solutions(problem):
    """Every solution of a small problem, by trying all statuses in the full system of equations."""
    k, mu, found = problem.size, problem.friction, []
    for status in product((OPEN, STICK, FORWARD, BACKWARD), repeat=k):
        matrix, right = np.zeros((2 * k, 2 * k)), np.zeros(2 * k)
        for i, s in enumerate(status):
            n, t = 2 * i, 2 * i + 1
            if s == OPEN:
                matrix[n, n] = 1.0
            else:
                matrix[n], right[n] = problem.compliance[n], -problem.start[n]
            if s == STICK:
                matrix[t], right[t] = problem.compliance[t], -problem.start[t]
            else:
                matrix[t, t] = 1.0
                matrix[t, n] = {OPEN: 0.0, FORWARD: mu[i], BACKWARD: -mu[i]}[s]
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        force = np.linalg.solve(matrix, right)
        state = problem.start + problem.compliance @ force
        if violation(problem, force, state) < 1e-9:
            found.append(force)
    return found


def distinct(forces):
    kept = []
    for force in forces:
        if not any(np.allclose(force, other, atol=1e-8) for other in kept):
            kept.append(force)
    return kept


#: slip without friction (the node is 1 mm deep), first status, last status, and how many solves that takes
WAYS = {
    "open enters slipping forwards": (5.0, OPEN, FORWARD, 2),
    "open enters slipping backwards": (-5.0, OPEN, BACKWARD, 2),
    "open enters sticking where it does not move": (0.0, OPEN, STICK, 2),
    "stick slips against its force": (5.0, STICK, FORWARD, 2),
    "stick slips against its force backwards": (-5.0, STICK, BACKWARD, 2),
    "slip turns by sticking": (5.0, BACKWARD, FORWARD, 3),
    "slip turns by sticking backwards": (-5.0, FORWARD, BACKWARD, 3),
    "slip sticks": (0.05, BACKWARD, STICK, 2),
    "stick stays": (0.05, STICK, STICK, 1),
}


@pytest.mark.parametrize("way", WAYS)
def test_a_status_changes_as_the_head_of_the_file_says(way):
    """One node of unit compliance, friction 0.1: it presses with 1, and can hold a slip of 0.1."""
    slip, first, last, solves = WAYS[way]
    problem = ContactProblem(np.array([-1.0, slip]), np.eye(2), np.array([0.1]))
    found = solve_contact(problem, np.array([first]))
    assert (found.status.tolist(), found.solves) == ([last], solves)
    np.testing.assert_allclose(found.force, [1.0, -np.clip(slip, -0.1, 0.1)], atol=1e-15)


@pytest.mark.parametrize("k", [1, 2, 3])
@pytest.mark.parametrize("friction", [0.0, 0.2, 0.5])
def test_finds_the_one_solution_that_enumeration_finds(k, friction):
    unique = 0
    for seed in range(20):
        problem = random_problem(seed, k, friction)
        solutions = distinct(enumerate_solutions(problem))
        if len(solutions) != 1:
            continue
        unique += 1
        for start in (np.full(k, OPEN), closed(k), np.full(k, BACKWARD)):
            found = solve_contact(problem, start)
            np.testing.assert_allclose(found.force, solutions[0], atol=1e-9)
            np.testing.assert_allclose(
                found.state, problem.start + problem.compliance @ found.force, atol=1e-12
            )
    assert unique >= 15


def test_with_large_friction_finds_one_of_the_solutions_of_four_nodes_or_says_so():
    solved = 0
    for seed in range(20):
        problem = random_problem(seed, 4, 4.0)
        solutions = distinct(enumerate_solutions(problem))
        try:
            found = solve_contact(problem, closed(4))
        except ContactNotSolved:
            continue
        solved += 1
        assert any(np.allclose(found.force, force, atol=1e-8) for force in solutions)
    assert solved >= 14


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("shift", [0.0, 0.002, 0.02, -0.02])
def test_conditions_hold_on_two_hundred_nodes(friction, shift):
    problem = half_plane(200, friction, shift=shift)
    found = solve_contact(problem, np.full(200, OPEN))
    np.testing.assert_allclose(found.state, problem.start + problem.compliance @ found.force, atol=1e-14)
    assert violation(problem, found.force, found.state) < 1e-11
    statuses = set(found.status.tolist())
    assert OPEN in statuses
    assert len(statuses) > 1


def test_without_friction_the_pressures_are_those_of_non_negative_least_squares():
    # minimise lam C lam / 2 + g0 lam over lam >= 0: a non-negative least squares problem
    problem = half_plane(200, 0.0)
    k = problem.size
    root = np.linalg.cholesky(problem.compliance[::2, ::2])
    expected, _ = nnls(root.T, np.linalg.solve(root, -problem.start[::2]))
    found = solve_contact(problem, np.full(k, OPEN))
    np.testing.assert_allclose(found.force[::2], expected, atol=1e-10)
    assert not found.force[1::2].any()
    assert (expected > 0).sum() > 20


def punch(k=80, friction=0.2):
    problem = half_plane(k, friction)
    return problem, np.tile([-1.0, 0.0], k), np.tile([1.0, 0.0], k)


def bordered(effect, row, pivot, value):
    """One extra unknown."""
    return ExtraUnknowns(effect[:, None], row[None, :], np.array([[pivot]]), np.array([value]))


def test_the_border_may_depend_on_shear_and_on_its_own_unknown():
    problem, effect, row = punch()
    k = problem.size
    effect = effect + np.tile([0.0, 0.1], k)
    row = row + np.tile([0.0, 0.25], k)
    extra_unknowns = bordered(effect, row, 3.0, 0.7)
    found = solve_contact(
        ContactProblem(problem.start, problem.compliance, problem.friction, extra_unknowns), closed(k)
    )
    assert row @ found.force + 3.0 * found.extra[0] == pytest.approx(0.7, rel=1e-12)
    np.testing.assert_allclose(
        found.state, problem.start + problem.compliance @ found.force + effect * found.extra[0], atol=1e-13
    )
    assert violation(problem, found.force, found.state) < 1e-11
    assert np.abs(found.force[1::2]).sum() > 0.01


def test_friction_may_differ_from_node_to_node():
    problem = half_plane(100, 0.3, shift=0.05)
    table = np.where(np.arange(100) < 50, 0.1, 0.6)
    varied = ContactProblem(problem.start, problem.compliance, table)
    found = solve_contact(varied, closed(100))
    assert violation(varied, found.force, found.state) < 1e-11
    slipping = found.status == FORWARD
    ratio = -found.force[1::2][slipping] / found.force[::2][slipping]
    np.testing.assert_allclose(ratio, table[slipping], rtol=1e-12)
    assert set(ratio.round(9)) == {0.1, 0.6}


def test_statuses_that_go_round_in_a_circle_are_not_followed_for_ever(monkeypatch):
    asked = []
    solved = solve.linearised
    monkeypatch.setattr(solve, "linearised", lambda *known: asked.append(known) or solved(*known))
    k = 200  # the impossible node among others that are held
    compliance = np.diag(np.append(-1.0, np.ones(2 * k - 1)))
    problem = ContactProblem(np.tile([-1.0, 0.0], k), compliance, np.zeros(k))
    with pytest.raises(ContactNotSolved, match="1 of 200 nodes keep changing"):
        solve_contact(problem, np.full(k, OPEN))
    assert len(asked) < ACTIVE_SET_LIMIT // 2  # one at a time, the node opens and closes: a circle


def test_a_circle_of_all_violated_nodes_is_left_through_the_worst_one():
    """Three nodes of which two touch by turns, as long as all that violate their statuses change: I. Ben
    Gharbia and J. C. Gilbert, Math. Program. 134 (2012) 349, doi:10.1007/s10107-010-0439-6, with alpha = 2.
    """
    compliance = np.kron([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]], np.eye(2))
    problem = ContactProblem(np.tile([-1.0, 0.0], 3), compliance, np.zeros(3))
    found = solve_contact(problem, np.array([FORWARD, OPEN, OPEN]))
    np.testing.assert_allclose(found.force[::2], 1.0 / 3.0, rtol=1e-12)


def test_a_node_that_can_neither_slip_nor_open_sticks():
    """Painleve: under a steep bound of friction slip pulls the node into the surface."""
    compliance = np.array([[1.0, 0.9], [0.9, 1.0]])
    problem = ContactProblem(np.array([-1.0, 0.5]), compliance, np.array([8.0]))
    for status in (OPEN, STICK, FORWARD, BACKWARD):
        found = solve_contact(problem, np.array([status]))
        assert found.status[0] == STICK
        assert found.force == pytest.approx(-np.linalg.solve(compliance, problem.start))


@pytest.mark.parametrize("status", [OPEN, STICK, FORWARD, BACKWARD])
def test_a_steep_law_of_friction_is_solved_from_every_status(status):
    """The tangent of a bound that bends up, 2 p - 0.5: p + t / 2 = 1 and p / 2 + t = 0.5 at p = 1, t = 0.
    Where the node slips, the bound is negative, and statuses go round in a circle.
    """
    compliance = np.array([[1.0, 0.5], [0.5, 1.0]])
    start, bound = np.array([-1.0, -0.5]), {"friction": np.array([2.0]), "cohesion": np.array([-0.5])}
    found = solve_contact(ContactProblem(start, compliance, **bound), np.array([status]))
    np.testing.assert_allclose(found.force, [1.0, 0.0], atol=1e-15)


def adhering(slip, cohesion=0.5):
    """A node pressed with 2 N/mm, of compliance 0.1, friction 0.3 and a shear force without load."""
    start = np.array([-0.2, slip])
    return ContactProblem(start, 0.1 * np.eye(2), np.array([0.3]), cohesion=np.array([cohesion]))


@pytest.mark.parametrize(("slip", "status"), [(0.1, STICK), (0.12, FORWARD), (-0.12, BACKWARD)])
def test_a_node_that_adheres_sticks_up_to_its_cohesion_more(slip, status):
    """It sticks up to 0.3 2 + 0.5 = 1.1 N/mm, and slips with that."""
    found = solve_contact(adhering(slip), np.array([STICK]))
    assert found.status.tolist() == [status]
    assert found.force[0] == pytest.approx(2.0, rel=1e-12)
    assert found.force[1] == pytest.approx(
        -slip / 0.1 if status == STICK else -np.sign(slip) * 1.1, rel=1e-12
    )


def test_cohesion_alone_is_friction_and_an_open_node_has_none():
    alone = ContactProblem(np.array([-0.2, 0.04]), 0.1 * np.eye(2), np.zeros(1), cohesion=np.array([0.5]))
    found = solve_contact(alone, np.array([FORWARD]))
    assert found.status.tolist() == [STICK]
    assert found.force[1] == pytest.approx(-0.4, rel=1e-12)
    lifted = ContactProblem(np.array([0.2, 0.5]), 0.1 * np.eye(2), np.zeros(1), cohesion=np.array([0.5]))
    opened = solve_contact(lifted, np.array([FORWARD]))
    assert opened.status.tolist() == [OPEN]
    assert not opened.force.any()


def test_extra_unknowns_feel_the_cohesion():
    """lam_t - 2 d = 3 with the lam_t = 0.3 2 + 0.5 of a backward slip."""
    extra = ExtraUnknowns(
        np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]]), np.array([[-2.0]]), np.array([3.0])
    )
    problem = adhering(0.0)
    whole = ContactProblem(
        problem.start, problem.compliance, problem.friction, extra, cohesion=problem.cohesion
    )
    found = solve_contact(whole, np.array([STICK]))
    assert found.status.tolist() == [BACKWARD]
    assert found.force[1] == pytest.approx(1.1, rel=1e-12)
    assert found.extra[0] == pytest.approx((1.1 - 3.0) / 2.0, rel=1e-12)


def test_a_body_gives_way_where_its_compliance_is_not_positive():
    start, mu = np.zeros(4), np.zeros(2)
    turned = np.diag([1.0, 1.0, 1.0, -0.5])
    for compliance, give, gives_way in (
        (np.eye(4), None, False),
        (turned, None, True),
        (turned, np.array([0.0, 0.0, 0.0, 1.0]), False),  # the interface takes it up
        (np.eye(4) + 3.0 * np.eye(4, k=1), None, True),  # its symmetric part is not
    ):
        assert ContactProblem(start, compliance, mu, give=give).gives_way == gives_way

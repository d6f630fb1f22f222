"""Dense systems in single precision, refined to the numbers of double precision, and solved so where not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import evfem as ev
from evfem.common import arrays
from evfem.common.arrays import DenseSolver, inverse
from evfem.contact.condensed import CondensedTangent, ExtraUnknown, LinearContactStep
from evfem.contact.follower import Candidates
from evfem.contact.signorini import FORWARD, OPEN, SLIP, STICK, Forces, Projected, side
from evfem.contact.solve import solve_contact
from evfem.contact.statuses import solve_statuses
from evfem.surface.pad import surface_state
from tests.contact.test_disc import half_space, missed

N = 400


def system(seed, spread=0.0):
    """A matrix that is not symmetric, with units apart by powers of ten, and right-hand sides."""
    rng = np.random.default_rng(seed)
    unit = 10.0 ** (spread * rng.uniform(-1.0, 1.0, N))
    return unit[:, None] * (np.eye(N) + 0.3 * rng.normal(size=(N, N)) / np.sqrt(N)) * unit, rng.normal(
        size=(N, 3)
    )


@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_refined_solutions_are_those_of_double_precision(spread, monkeypatch):
    """By factors of its own and, a changed matrix later, by kept ones; double ones would fail."""
    (matrix, right), (other, _) = system(0, spread), system(1, spread)
    solver, unit = DenseSolver(), np.sqrt(np.abs(np.diagonal(matrix)))[:, None]
    expected = [np.linalg.solve(one, right) for one in (matrix, matrix + 1e-2 * other)]
    monkeypatch.setattr(np.linalg, "solve", None)
    for one, x in zip((matrix, matrix + 1e-2 * other), expected, strict=True):
        found = solver.solve(one, right, "the same unknowns")
        assert_allclose(found * unit, x * unit, atol=1e-11 * np.abs(x * unit).max())
        kept = solver._factors
    assert solver._factors is kept


def test_new_unknowns_have_new_factors():
    solver, (matrix, right) = DenseSolver(), system(2)
    solver.solve(matrix, right, "these")
    first = solver._factors
    assert_allclose(matrix[::-1] @ solver.solve(matrix[::-1], right, "others"), right, atol=1e-11)
    assert solver._factors is not first
    # by the same name, but fewer
    fewer, known = matrix[1:, 1:], right[1:]
    assert_allclose(fewer @ solver.solve(fewer, known, "others"), known, atol=1e-11)


def test_a_matrix_beyond_single_precision_is_solved_in_double():
    """Condition 1e12, which no scaling mends: the factors of single precision lead nowhere."""
    rng = np.random.default_rng(3)
    Q = np.linalg.qr(rng.normal(size=(N, N)))[0]
    matrix, right = Q * np.geomspace(1.0, 1e-12, N) @ Q.T, rng.normal(size=(N, 1))
    assert_array_equal(DenseSolver().solve(matrix, right), np.linalg.solve(matrix, right))
    with pytest.raises(np.linalg.LinAlgError):
        DenseSolver().solve(np.zeros((N, N)), right)


@pytest.mark.parametrize(("real", "error"), [(np.float32, 1e-5), (float, 1e-12)])
def test_the_inverse_has_the_precision_of_its_matrix(real, error):
    """Larger than one block of rows; positive definite, and indefinite by LU."""
    matrix = system(4)[0]
    indefinite = matrix + matrix.T - 2.0 * np.eye(N) * (np.arange(N) % 2)
    for one, own in ((matrix @ matrix.T, real), (indefinite, float)):
        kept = one.astype(real)
        found = inverse(kept if one[1, 1] > 0.0 else one, symmetric=True)
        assert found.dtype == own
        assert_allclose(found @ one, np.eye(N), atol=100 * error)
        assert_array_equal(kept, one.astype(real))


def held(n):
    """A half space below a sphere that moves and turns: nodes of every status, and forces to begin with."""
    problem, _ = half_space(n, 0.3, shift=(0.05, 0.02), twist=0.05)
    return problem, np.full(n * n, STICK), np.zeros(3 * n * n)


def test_contact_in_single_precision_is_contact(monkeypatch):
    """484 nodes: the forces are those of dense systems in double precision, and obey the laws."""
    problem, status, force = held(22)
    fast = solve_contact(problem, status, force)
    monkeypatch.setattr(arrays, "LARGE_SYSTEM", 10**9)
    exact = solve_contact(replace(problem, dense=DenseSolver()), status, force)
    assert set(fast.status) == {OPEN, STICK, SLIP}
    assert_array_equal(fast.status, exact.status)
    assert_allclose(fast.force, exact.force, atol=1e-11 * np.abs(exact.force).max())
    assert missed(problem, fast) < 1e-10


def test_nodes_that_stick_and_slip_have_factors_of_their_own(monkeypatch):
    """In the plane the same components act with the unknowns of both."""
    monkeypatch.setattr(arrays, "LARGE_SYSTEM", 1)
    problem, _ = half_space(6, 0.3)
    plane = np.flatnonzero(np.arange(3 * 36) % 3 < 2)
    compliance = problem.compliance[np.ix_(plane, plane)]
    problem = replace(problem, start=problem.start[plane], compliance=compliance)
    for status in (np.full(36, one) for one in (STICK, FORWARD)):
        found, alone = (
            solve_statuses(one, status, side(status)).contact
            for one in (problem, replace(problem, dense=DenseSolver()))
        )
        assert_allclose(found, alone, atol=1e-11 * np.abs(alone).max())


def test_contact_is_solved_to_its_tolerance():
    problem, status, force = held(10)
    exact, loose = (solve_contact(replace(problem, tolerance=t), status, force) for t in (1e-12, 0.02))
    assert loose.solves < exact.solves
    error = np.abs(loose.force - exact.force).max() / np.abs(exact.force).max()
    assert 1e-9 < error < 0.1
    assert (
        Projected.of(problem, Forces(loose.force, loose.attraction_drop, loose.extra)).miss.max()
        <= 0.02 + 1e-12
    )


def pressed(real, dim=3, k=120):
    """A step of the condensed body in space: a flat surface, nodes that touch, and the force on the bone."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(dim * k + dim, 2 * dim * k))
    schur = (np.eye(len(A)) + A @ A.T / k).astype(real)
    place = np.column_stack([rng.uniform(size=(k, 2)), np.zeros(k)])[:, [0, 2, 1]]
    touching = rng.uniform(size=k) < 0.5
    surface = surface_state(ev.Flat().shifted(0.0), place - np.outer(0.1 * ~touching, [0.0, -1.0, 0.0]))
    normal, zero = np.where(touching, rng.uniform(0.01, 0.02, k), 0.0), np.zeros(k)
    force, status = np.outer(normal, [1.0, 0.1, 0.05]), np.where(touching, STICK, OPEN)
    known = Candidates(
        surface, np.zeros((k, 2)), force, status, zero + 0.3, np.zeros((k, 3)), zero, zero, np.zeros((k, 2))
    )
    body = CondensedTangent.make(schur, None, dim)
    extra = (ExtraUnknown(-schur[:, 1 - dim].astype(float), 1, -2.0),)
    return LinearContactStep(body, known, rng.normal(size=len(A)), np.zeros(dim), extra)


def test_a_compliance_of_single_precision_is_kept_so_and_taken_as_exact():
    """The motion and the forces on it are those on the same numbers in double precision."""
    step = pressed(np.float32)
    body = step.body
    assert body.compliance.dtype == np.float32
    assert CondensedTangent.make(body.schur, None, 2).compliance.dtype == float
    exact = CondensedTangent(body.schur.astype(float), body.compliance.astype(float), 3)
    assert_allclose(body.bone_rows, exact.bone_rows, rtol=0, atol=1e-13)
    found, expected = step.solve(), replace(step, body=exact).solve()
    assert {OPEN, STICK} < set(found.status)
    for one, other in ((found.force, expected.force), (found.moved, expected.moved)):
        assert_allclose(one, other, atol=1e-11 * np.abs(other).max())
    # of other candidates, and of the first again: the memory is the same
    some, all_of = np.arange(5, 70), np.arange(120)
    for nodes in (all_of, some, all_of):
        rows = body.rows(nodes)
        assert_array_equal(body.among(nodes), body.compliance[np.ix_(rows, rows)])

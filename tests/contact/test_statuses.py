"""Linear equations of given statuses: the matrix that is never made against the one that is, the same with a
compliance of single precision, and the memory that is taken.
"""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from evfem.common import arrays
from evfem.common.arrays import DenseSolver, Memory, block, product
from evfem.contact.byforce import ByForce
from evfem.contact.signorini import OPEN, SLIP, STICK, AttractionStiffness, ContactProblem
from evfem.contact.solve import solve_contact
from evfem.contact.statuses import Equations, Sums, solve_statuses
from tests.contact.test_disc import half_space

K = 49


def posed(real=float, dim=3):
    """Equations of nodes of every status under an attraction that some of them feel, with everything that the
    laws of contact may add, and the problem they are of.
    """
    rng, n = np.random.default_rng(0), dim
    half, _ = half_space(7, 0.3)
    some = np.flatnonzero(np.arange(3 * K) % 3 < n)
    status = rng.integers(0, 3, K)
    rate = np.where(rng.uniform(size=K) > 0.5, rng.uniform(0.1, 1.0, K), 0.0)
    by_force = ByForce(*rng.uniform(0.0, 0.3, (2, K, n)), rng.uniform(size=K))
    problem = ContactProblem(
        half.start.reshape(K, 3)[:, :n].ravel(),
        half.compliance[np.ix_(some, some)].astype(real),
        rng.uniform(0.2, 0.4, K),
        attraction=AttractionStiffness(rate, rng.uniform(size=K), rng.uniform(size=K), by_force),
        cohesion=rng.uniform(size=K),
        give=rng.uniform(0.1, 0.2, n * K),
    )
    angle = rng.uniform(0.0, 6.0, K)
    along = np.column_stack([np.cos(angle), np.sin(angle)][: n - 1])
    return problem, status, along, rng.uniform(0.2, 0.9, K) if n == 3 else None


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("real", [np.float32, float])
def test_rows_diagonal_and_products_are_those_of_the_matrix(real, dim, monkeypatch):
    """And that is what one unknown after the other does to gaps and slips, as the problem finds them."""
    problem, *given = posed(real, dim)
    system = Equations(problem, *given)
    matrix, x = np.asarray(system), np.random.default_rng(1).normal(size=(len(system), 2))
    assert matrix.dtype == float
    assert_allclose(system @ x, matrix @ x, rtol=1e-12, atol=1e-13)
    assert_allclose(system.diagonal(), np.diagonal(matrix), rtol=1e-13)
    rows, own = system[5:21], np.eye(len(system), dtype=bool)[5:21]
    assert rows.dtype == real
    assert_allclose(rows[~own], matrix[5:21][~own], rtol=0, atol=1e-12 if real is float else 1e-7)
    expected = np.linalg.solve(matrix, x)
    monkeypatch.setattr(arrays, "LARGE_SYSTEM", 1)
    monkeypatch.setattr(np.linalg, "solve", None)
    assert_allclose(DenseSolver().solve(system, x), expected, rtol=1e-9, atol=1e-11)
    none, give = system.forces(np.zeros(len(system)), np.zeros(0)), problem.give
    for i, unit in enumerate(np.eye(len(system))):
        one = system.forces(unit, np.zeros(0))
        moved = (problem.state(one) - problem.state(none)).reshape(K, dim)
        whole = system.row.of(moved.reshape(-1, 1))[:, 0]
        loss = (one.attraction_loss - none.attraction_loss)[::dim]
        *_, drop, across = system.split(whole)
        rates = problem.attraction.negative_stiffness[system.attracted]
        drop -= loss[system.attracted] / rates
        if across.size:  # turned by the force across alone, and its own compliance does not give
            m, force = given[2][system.turned], (one.contact - none.contact).reshape(K, dim)
            turned = give.reshape(K, dim) * force
            across -= np.sum(system.row.weights[-across.size :] * turned[system.turned], axis=1)
            across += (1.0 - m) * system.split(unit)[3]
        assert_allclose(matrix[:, i], whole, atol=1e-12)


@pytest.mark.parametrize("turning", [1, -1])
def test_a_sum_begins_where_its_first_component_counts(turning):
    """A slip along the first tangent turns along the second one alone."""
    weights = np.array([[0.0, 0.0, 2.0], [1.0, 0.5, -0.5], [0.0, 0.0, 0.0]])[::turning]
    spans = (slice(0, 2), slice(2, 3))
    sums, v = Sums(np.array([2, 0, 1]), weights, spans), np.random.default_rng(2).normal(size=(9, 4))
    expected = np.einsum("ua,uaq->uq", weights, v.reshape(3, 3, 4)[sums.node])
    assert_allclose(sums.of(v), expected, rtol=1e-14)
    assert_allclose(sums.of_columns(v.T), expected.T, rtol=1e-14)
    assert_allclose(np.sum(sums.spread(v[:3], 3) * v), np.sum(v[:3] * expected), rtol=1e-13)


def test_products_have_double_precision_whatever_the_matrix():
    rng = np.random.default_rng(3)
    matrix, x = rng.normal(size=(150, 90)).astype(np.float32), rng.normal(size=(90, 2))
    for one in (matrix, matrix.astype(float)):
        assert_allclose(product(one, x), matrix.astype(float) @ x, rtol=0, atol=1e-14)
        assert_allclose(product(one.T, np.arange(150.0)), np.arange(150.0) @ one.astype(float), rtol=1e-12)
    rows, columns = rng.permutation(150)[:140], rng.permutation(90)[:33]
    kept = np.full((140, 33), np.nan, np.float32)
    assert block(matrix, rows, columns, kept) is kept
    assert_array_equal(kept, matrix[np.ix_(rows, columns)])


def slipping(real=float):
    """484 nodes that stick and slip, with forces to begin with."""
    problem, _ = half_space(22, 0.3, shift=(0.05, 0.02), twist=0.05)
    k = problem.size
    compliance = problem.compliance.astype(np.float32).astype(real)
    return replace(problem, compliance=compliance), np.full(k, STICK), np.zeros(3 * k)


def test_contact_on_a_compliance_of_single_precision_is_exact():
    """Its numbers are taken as they are: forces as on the same numbers in double precision."""
    (single, *start), (double, *_) = slipping(np.float32), slipping()
    found, expected = solve_contact(single, *start), solve_contact(double, *start)
    assert set(found.status) == {OPEN, STICK, SLIP}
    assert_array_equal(found.status, expected.status)
    assert_allclose(found.force, expected.force, atol=1e-12 * np.abs(expected.force).max())


def test_large_systems_are_solved_without_their_matrix_in_memory_that_is_kept(monkeypatch):
    """A second one takes less than half of its matrix in single precision."""
    monkeypatch.setattr(arrays, "LARGE_SYSTEM", 1)
    problem, status, _ = slipping(np.float32)
    along = np.tile([1.0, 0.0], (problem.size, 1))
    solve_statuses(problem, status, along)
    other = replace(problem, compliance=2.0 * problem.compliance)
    tracemalloc.start()
    solve_statuses(other, status, along)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1.5 * (3 * problem.size) ** 2


def test_memory_is_taken_anew_for_what_is_larger_alone():
    memory = Memory()
    first = memory.array("one", (20, 3))
    assert np.shares_memory(memory.array("one", (3, 20), np.float32), first)
    assert not np.shares_memory(memory.array("other", (20, 3)), first)
    assert memory.array("one", (21, 3)).shape == (21, 3)
    assert DenseSolver(memory)._memory is memory

"""One factorisation for many sets of statuses, against all equations of each of them at once."""

import numpy as np
import pytest

from evfem.contact import updated
from evfem.contact.elimination import Motions
from evfem.contact.updated import ClosedNodes, Factorised, Relations

OPEN, STICK, FORWARD, BACKWARD = range(4)
FRICTION = 0.4


def motions(k, p, seed=1):
    """Motions of k nodes with p extra unknowns; the compliance is not symmetric."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(2 * k, 2 * k))
    compliance = np.eye(2 * k) + 0.3 * A @ A.T / k + 0.02 * A
    border = rng.normal(size=(2 * k, p)), rng.normal(size=(p, 2 * k)), 3.0 * np.eye(p), rng.normal(size=p)
    return Motions(rng.normal(size=2 * k), compliance, *border)


def relations(status):
    against = (status == BACKWARD).astype(float) - (status == FORWARD)
    constant = against * np.linspace(0.0, 0.3, status.size)
    return Relations(status != OPEN, status == STICK, FRICTION * against, constant)


def all_equations(known, now):
    """Forces and extra unknowns from the two equations of every node and those of the extra unknowns."""
    k, p = now.closed.size, known.right.size
    matrix, right = np.zeros((2 * k + p, 2 * k + p)), np.zeros(2 * k + p)
    for row in range(2 * k):
        node, tangential = row % k, row >= k
        if now.stick[node] if tangential else now.closed[node]:
            matrix[row] = np.concatenate([known.compliance[row], known.columns[row]])
            right[row] = -known.start[row]
        else:
            matrix[row, row] = 1.0
            if tangential:
                matrix[row, node] -= now.ratio[node]
                right[row] = now.constant[node]
    matrix[2 * k :] = np.hstack([known.rows, known.pivot])
    right[2 * k :] = known.right
    x = np.linalg.solve(matrix, right)
    return x[: 2 * k], x[2 * k :]


@pytest.mark.parametrize("p", [0, 1, 2])
def test_every_set_of_statuses_on_the_way_is_solved(p, monkeypatch):
    """Four of thirty nodes change at a time, in all ways; the shares are those of one factorisation for
    all, of one now and then, and of one for each."""
    rng, known = np.random.default_rng(p), motions(30, p)
    for share in (10.0, 0.3, 0.0):
        monkeypatch.setattr(updated, "UPDATED", share)
        nodes, status = ClosedNodes(known), rng.integers(0, 4, 30)
        for _ in range(20):
            now = relations(status)
            for found, expected in zip(nodes.solved(now), all_equations(known, now), strict=True):
                np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
            status = status.copy()
            status[rng.integers(0, 30, 4)] = rng.integers(0, 4, 4)


def test_few_changes_need_no_factorisation(monkeypatch):
    made, make = [], Factorised.__init__
    monkeypatch.setattr(Factorised, "__init__", lambda self, *known: made.append(1) or make(self, *known))
    nodes, status = ClosedNodes(motions(30, 1)), np.full(30, STICK)
    for node in range(3):
        status = status.copy()
        status[node] = OPEN
        nodes.solved(relations(status))
    assert len(made) == 1
    nodes.solved(relations(np.full(30, FORWARD)))
    assert len(made) == 2


def test_nodes_that_are_all_open_are_a_reference_too():
    known, status = motions(4, 0), np.full(4, OPEN)
    nodes = ClosedNodes(known)
    assert not nodes.solved(relations(status))[0].any()
    status = np.array([STICK, OPEN, FORWARD, OPEN])
    expected = all_equations(known, relations(status))[0]
    np.testing.assert_allclose(nodes.solved(relations(status))[0], expected, rtol=1e-12, atol=1e-13)


def test_statuses_without_a_solution_are_refused_and_the_next_ones_solved(monkeypatch):
    known = motions(4, 0)
    known.compliance[0] = known.compliance[:, 0] = 0.0
    status = np.array([OPEN, STICK, STICK, STICK])
    for share in (10.0, 0.0):
        monkeypatch.setattr(updated, "UPDATED", share)
        nodes = ClosedNodes(known)
        expected = nodes.solved(relations(status))[0]
        with pytest.raises(np.linalg.LinAlgError):
            nodes.solved(relations(np.full(4, STICK)))
        np.testing.assert_allclose(nodes.solved(relations(status))[0], expected, rtol=1e-12)

"""Which nodes change in an active set, on statuses that follow from each other as given."""

import numpy as np

from evfem.common.constants import ACTIVE_SET_LIMIT
from evfem.contact.changes import Changes

VIOLATION = np.array([1.0, 3.0, 2.0])


def followed(transitions, start, most=200):
    """Nodes picked at each of the statuses that are met from `start`, until none is: `transitions`
    says which nodes of a status are violated; a node that changes goes from 0 to 1 or back.
    """
    changes, status, met = Changes(), np.array(start), []
    for _ in range(most):
        violated = np.array(transitions[tuple(status.tolist())])
        picked = changes.picked(status, violated, VIOLATION)
        if not picked.size:
            return met
        met.append(picked.tolist())
        status = status.copy()
        status[picked] = 1 - status[picked]
    raise AssertionError("followed for ever")


def test_two_statuses_that_lead_to_each_other_by_one_node_are_left_at_once():
    to_and_fro = {(0, 0, 0): [0], (1, 0, 0): [0]}
    assert followed(to_and_fro, (0, 0, 0)) == [[0], [0]]


def test_a_circle_of_worst_nodes_is_left_through_the_first_one():
    # both at once to and fro; the worst one to and fro; then the first one, and there it ends
    ways = {(0, 0, 0): [0, 1], (1, 1, 0): [0, 1], (0, 1, 0): [1], (1, 0, 0): []}
    assert followed(ways, (0, 0, 0)) == [[0, 1], [0, 1], [1], [1], [0]]


def test_a_circle_of_first_nodes_has_no_end():
    ways = {(0, 0, 0): [0, 1], (0, 1, 0): [0, 1], (1, 0, 0): [0, 1], (1, 1, 0): [0, 1]}
    found = followed(ways, (0, 0, 0))
    assert found[-2:] == [[0], [0]]
    assert len(found) < ACTIVE_SET_LIMIT // 3


def test_a_path_that_leaves_a_circle_through_its_worst_node_is_followed():
    # all violated nodes at once go to and fro; the worst one alone leads on
    ways = {(0, 0, 0): [0, 1], (1, 1, 0): [0, 1], (0, 1, 0): [2], (0, 1, 1): [1], (0, 0, 1): []}
    assert followed(ways, (0, 0, 0)) == [[0, 1], [0, 1], [1], [2], [1]]


def test_after_many_solves_one_node_changes_at_a_time():
    changes, violated = Changes(), np.array([0, 1, 2])
    picked = [
        changes.picked(np.array([i, 0, 0]), violated, VIOLATION).tolist() for i in range(ACTIVE_SET_LIMIT)
    ]
    many = ACTIVE_SET_LIMIT // 3
    assert picked[:many] == [[0, 1, 2]] * many
    assert picked[many:-1] == [[1]] * (ACTIVE_SET_LIMIT - many - 1)
    assert picked[-1] == [0]

"""Anderson's mixing: linear contractions end after few steps, and what else a state carries follows."""

from dataclasses import replace

import numpy as np
import pytest

from evfem.common.constants import KILOVOLT
from evfem.contact.signorini import OPEN, STICK
from evfem.newton.anderson import Anderson
from evfem.newton.state import State

NODES = 2


def state(u, force=0.0, bone=0.0, squared=0.0, status=OPEN):
    """A state of two nodes, the first of them the pad, at displacements u (4,); voltage squared in kV^2."""
    zero = np.zeros((NODES, 2))
    return State(
        u=np.reshape(u, (NODES, 2)),
        contact_force=np.broadcast_to(force, (1, 2)).astype(float),
        status=np.array([status]),
        bone=np.broadcast_to(bone, 2).astype(float),
        voltage=KILOVOLT * np.sqrt(squared),
        attraction=zero[:1],
        reaction=zero[0],
        last_increment=zero,
    )


def contraction(dimension, seed=0):
    """Fixed point x (4,) and matrix M (4, 4) of g = x + M (. - x), whose error has `dimension` directions."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(4, 4)))[0]
    rates = np.zeros(4)
    rates[:dimension] = np.linspace(0.9, 0.5, dimension) * (-1.0) ** np.arange(dimension)
    return rng.normal(size=4), basis @ np.diag(rates) @ basis.T


def mixed(dimension, steps, start):
    """Errors (steps + 1,) of the iterates, the first that of the start."""
    point, M = contraction(dimension)
    mixing, now = Anderson(), state(start)
    errors = [np.abs(now.u.ravel() - point).max()]
    for _ in range(steps):
        now = mixing.next_iterate(now, state(point + M @ (now.u.ravel() - point)))
        errors.append(np.abs(now.u.ravel() - point).max())
    return errors


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_linear_contraction_ends_after_one_step_more_than_it_has_dimensions(dimension):
    """The first image lies in the contraction's directions; with d differences the least squares
    are met exactly, as in GMRES (Walker and Ni, doi:10.1137/10078356X)."""
    start = np.array([3.0, -1.0, 2.0, 0.5])
    errors = mixed(dimension, dimension + 2, start)
    assert errors[dimension + 2] < 1e-9 * errors[0]
    # from a start that has no other directions one step less
    point, M = contraction(dimension)
    errors = mixed(dimension, dimension + 1, point + M @ start)
    assert errors[dimension + 1] < 1e-9 * errors[0]
    assert errors[dimension] > 1e-3 * errors[0]


def test_forces_bone_and_squared_voltage_keep_their_linear_relations():
    """What is a linear function of u in every image is the same function of the mixture."""
    point, M = contraction(2)
    mixing, now = Anderson(), state(np.array([3.0, -1.0, 2.0, 0.5]))
    for _ in range(3):
        u = point + M @ (now.u.ravel() - point)
        after = state(u, force=[u[0] - 2.0, 3.0 * u[1]], bone=[u[2], -u[3]], squared=20.0 + u[0])
        now = mixing.next_iterate(now, after)
    u = now.u.ravel()
    assert np.abs(u - after.u.ravel()).max() > 1e-3  # it is a mixture
    np.testing.assert_allclose(now.contact_force, [[u[0] - 2.0, 3.0 * u[1]]], rtol=1e-12)
    np.testing.assert_allclose(now.bone, [u[2], -u[3]], rtol=1e-12)
    assert (now.voltage / KILOVOLT) ** 2 == pytest.approx(20.0 + u[0], rel=1e-12)


def test_a_squared_voltage_below_zero_is_none():
    """Steps 1 and 1/2 lead to the fixed point 2, where 1 - u is -1."""
    mixing = Anderson()
    first, second, third = (np.array([x, 0.0, 0.0, 0.0]) for x in (0.0, 1.0, 1.5))
    mixing.next_iterate(state(first), state(second, squared=0.5))
    found = mixing.next_iterate(state(second), state(third, squared=0.1))
    np.testing.assert_allclose(found.u.ravel(), [2.0, 0.0, 0.0, 0.0], rtol=1e-12)
    assert found.voltage == 0.0


def test_memory_that_one_iteration_keeps_and_the_next_changes_begins_anew():
    """The pressure stays where the tangent is no older one's; with it a vector has other numbers."""
    mixing, q = Anderson(), np.zeros((1, 3))
    keeps = [state(np.full(4, x)).remembering({"pressure": q}) for x in (0.0, 1.0)]
    mixing.next_iterate(*keeps)
    changes = [state(np.full(4, x)).remembering({"pressure": q + x}) for x in (1.0, 1.5, 1.75)]
    assert mixing.next_iterate(*changes[:2]) is changes[1]
    found = mixing.next_iterate(*changes[1:])
    np.testing.assert_allclose(found.memory["pressure"], 2.0, rtol=1e-12)
    again = state(np.full(4, 3.0)).remembering({"pressure": changes[2].memory["pressure"]})
    assert mixing.next_iterate(changes[2], again).memory["pressure"].shape == q.shape


@pytest.mark.parametrize("how", ["status", "reset"])
def test_another_map_begins_anew(how):
    mixing = Anderson()
    first, second = state(np.zeros(4)), state(np.ones(4))
    mixing.next_iterate(first, second)
    if how == "reset":
        mixing.reset()
    else:
        touched = replace(second, status=np.array([STICK]))
        assert mixing.next_iterate(second, touched) is touched
    after = state(1.5 * np.ones(4))
    assert mixing.next_iterate(second, after) is after
    assert mixing.next_iterate(after, state(1.75 * np.ones(4))) is not after

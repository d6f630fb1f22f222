"""Follower stiffness against closed forms of one node, and where it is scaled down."""

import numpy as np
import pytest

from evfem.common.constants import STABLE
from evfem.contact.follower import FollowerStiffness
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK

#: compliance of one node, y before x, in mm per N/mm
A, B, C = 0.10, 0.03, 0.20
ONE = np.array([[A, B], [B, C]])
LEVEL = np.array([[[0.0, 1.0], [1.0, 0.0]]])
MU = 0.4


def weaker(rate, status, axes=LEVEL, friction=0.0, compliance=ONE):
    stiffness = FollowerStiffness.of(np.atleast_2d(rate))
    found = stiffness.weaker(compliance, axes, np.atleast_1d(status), np.atleast_1d(friction))
    return [one.rate[:, :1] / stiffness.rate[:, :1] for one in found]


@pytest.mark.parametrize(("status", "ratio"), [(FORWARD, -MU), (BACKWARD, MU)])
def test_a_slipping_node_is_held_by_the_closed_gap_and_its_friction(status, ratio):
    """A force f along x on a node whose gap stays closed: A lam + B (f + ratio lam) = 0, it moves
    by B lam + C (f + ratio lam). The stiffness pushes it by (rx - ratio ry) per mm, since what it
    lifts the node by lessens its pressing force.
    """
    rate = np.array([20.0, 5.0])
    lam = -B / (A + B * ratio)
    moved = B * lam + C * (1.0 + ratio * lam)
    critical = moved * (rate[0] - ratio * rate[1])
    assert critical > 1.0
    held = weaker(rate, status, friction=MU)[0]
    np.testing.assert_allclose(held, STABLE / critical, rtol=1e-12)


def test_a_free_node_is_held_by_the_tissue_alone():
    rate = np.array([20.0, 5.0])
    np.testing.assert_allclose(weaker(rate, OPEN), [[[STABLE / (C * 20.0 + B * 5.0)]]], rtol=1e-12)


def test_the_held_node_comes_before_the_free_one():
    held, free = weaker([20.0, 0.0], FORWARD)
    np.testing.assert_allclose(held[0, 0], STABLE / (20.0 * (C - B * B / A)), rtol=1e-12)
    np.testing.assert_allclose(free[0, 0], STABLE / (20.0 * C), rtol=1e-12)


def test_a_slope_turns_what_holds_the_node():
    """On a slope a, without friction, the node moves along t and its stiffness pushes along t."""
    a = 0.3
    axes = np.array([[[-np.sin(a), np.cos(a)], [np.cos(a), np.sin(a)]]])
    n, t = axes[0]
    xy = ONE[::-1, ::-1]
    along = t @ xy @ t - (t @ xy @ n) ** 2 / (n @ xy @ n)
    rate = np.array([20.0, 5.0])
    expected = STABLE / (along * t[0] * (rate @ t))
    np.testing.assert_allclose(weaker(rate, FORWARD, axes)[0][0, 0], expected, rtol=1e-12)


def test_what_the_body_holds_is_not_scaled():
    assert weaker([1.0, 0.0], FORWARD) == []
    assert weaker([-50.0, 0.0], FORWARD) == []  # a trough holds its node
    assert weaker([0.0, 0.0], FORWARD) == []
    assert len(weaker([20.0, 0.0], STICK)) == 1  # only as a free one


def test_a_node_that_nothing_holds_is_left_to_the_tissue():
    """Friction so large that a pressing force opens the gap: A + B ratio = 0."""
    found = weaker([20.0, 0.0], BACKWARD, friction=1.0, compliance=np.array([[B, -B], [-B, C]]))
    np.testing.assert_allclose(found, [[[STABLE / (20.0 * C)]]])

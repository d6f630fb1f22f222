"""Estimators: exact where they must be, and errors that are what the definition says."""

import numpy as np
import pytest

from evfem.estimate.estimators import Estimator, best_kernel

DRAW = np.random.default_rng(3)
POINTS = np.concatenate([DRAW.random((40, 3)), np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T])
SCALE = np.array([2.0, 1.0, 0.5])
LINEAR = POINTS @ np.array([[1.0, -2.0], [0.5, 3.0], [2.0, 0.0]]) + 0.7


def test_what_is_linear_is_found_exactly():
    estimator = Estimator(POINTS, LINEAR, SCALE)
    place = np.array([0.3, 0.8, 0.6])
    wanted = place @ np.array([[1.0, -2.0], [0.5, 3.0], [2.0, 0.0]]) + 0.7
    np.testing.assert_allclose(estimator(place), wanted, atol=1e-7)


def test_a_point_that_is_left_out_does_not_know_itself():
    values = DRAW.random((len(POINTS), 1))
    changed = values.copy()
    changed[3] += 100.0
    one, other = (Estimator(POINTS, v, SCALE).left_out()[3] for v in (values, changed))
    assert one == pytest.approx(other)


def test_corners_hold_their_cube_and_nothing_beside_it():
    estimator = Estimator(POINTS, LINEAR, SCALE)
    assert estimator.holds(np.array([0.99, 0.01, 0.5]))
    assert not estimator.holds(np.array([1.01, 0.5, 0.5]))


def test_points_nearby_count_by_gaussian_weights():
    estimator = Estimator(np.array([[0.0], [1.0]]), np.zeros((2, 1)), np.array([2.0]))
    weight = np.exp(-0.5 * np.array([0.5**2, 1.5**2]))
    np.testing.assert_allclose(estimator.near(np.array([0.25])), weight / weight.sum())


def test_the_search_stretches_the_axis_along_which_the_response_changes():
    points = np.random.default_rng(5).random((60, 2))
    values = np.sin(np.outer(9.0 * points[:, 0], [1.0, 0.7]))
    scale, smoothing = best_kernel(points, values, np.full((60, 2), 0.5))
    assert scale[0] > 4.0 * scale[1]
    assert smoothing < 0.1


def test_what_does_not_count_does_not_guide_the_search():
    points = np.random.default_rng(5).random((60, 2))
    values = np.sin(9.0 * points)  # the first changes along the first axis, the second along the other
    scale, _ = best_kernel(points, values, np.tile([0.5, 0.0], (60, 1)))
    assert scale[0] > 4.0 * scale[1]

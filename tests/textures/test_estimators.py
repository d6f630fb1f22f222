"""Estimators: exact where they must be, and errors that are what the definition says."""

import numpy as np
import pytest

from evfem.errors import InputError
from evfem.textures.estimators import (
    METHODS,
    Estimator,
    best_kernel,
    best_width,
    hull_weights,
    kernel,
    left_out,
)

DRAW = np.random.default_rng(3)
POINTS = np.concatenate([DRAW.random((40, 3)), np.array(np.meshgrid(*[[0.0, 1.0]] * 3)).reshape(3, -1).T])
SCALE = np.array([2.0, 1.0, 0.5])
ONES = np.ones((len(POINTS), 1))
LINEAR = POINTS @ np.array([[1.0, -2.0], [0.5, 3.0], [2.0, 0.0]]) + 0.7


@pytest.mark.parametrize("method", ["linear", "rbf"])
def test_what_is_linear_is_found_exactly(method):
    estimator = Estimator(POINTS, LINEAR, 0.2, SCALE)
    place = np.array([0.3, 0.8, 0.6])
    wanted = place @ np.array([[1.0, -2.0], [0.5, 3.0], [2.0, 0.0]]) + 0.7
    np.testing.assert_allclose(estimator(place, method), wanted, atol=1e-7)


@pytest.mark.parametrize("method", ["linear", "rbf"])
def test_points_are_met(method):
    values = DRAW.random((len(POINTS), 2))
    np.testing.assert_allclose(Estimator(POINTS, values, 0.2, SCALE)(POINTS[7], method), values[7], atol=1e-6)


def test_linear_weights_are_those_of_the_delaunay_simplex():
    from scipy.spatial import Delaunay

    triangulation = Delaunay(POINTS)
    place = np.array([0.41, 0.37, 0.62])
    corners = triangulation.simplices[triangulation.find_simplex(place)]
    assert sorted(np.flatnonzero(hull_weights(POINTS, place) > 1e-9)) == sorted(corners)


def test_the_average_is_that_of_gaussian_weights_by_hand():
    points = np.array([[0.0], [1.0]])
    weight = np.exp(-0.5 * np.array([0.25**2, 0.75**2]) / 0.5**2)
    weight /= weight.sum()
    np.testing.assert_allclose(kernel(points, np.array([0.25]), 0.5), weight)
    found = Estimator(points, np.array([[1.0], [3.0]]), 0.5, np.ones(1))(np.array([0.25]), "average")
    assert found[0] == pytest.approx(weight @ [1.0, 3.0])


def test_the_width_has_the_smallest_error_of_points_left_out():
    values = np.sin(5.0 * POINTS[:, :1])
    best = best_width(POINTS * SCALE, values, ONES)
    errors = {}
    for width in (best, best * 1.15, best / 1.15):
        wrong = left_out(Estimator(POINTS, values, width, SCALE), "average") - values
        errors[width] = np.mean(np.minimum(np.abs(wrong), 1.0))
    assert min(errors, key=errors.get) == best


@pytest.mark.parametrize("method", METHODS)
def test_a_point_that_is_left_out_does_not_know_itself(method):
    values = DRAW.random((len(POINTS), 1))
    changed = values.copy()
    changed[3] += 100.0
    one, other = (left_out(Estimator(POINTS, v, 0.3, SCALE), method)[3] for v in (values, changed))
    assert one == pytest.approx(other)


def test_corners_that_are_left_out_are_outside_the_hull_of_the_others():
    found = left_out(Estimator(POINTS, LINEAR, 0.2, SCALE), "linear")
    assert np.isnan(found[40:]).all()
    assert np.isfinite(found[:40]).any()


def test_linear_interpolation_refuses_a_place_outside():
    with pytest.raises(InputError, match="outside the hull"):
        Estimator(POINTS, LINEAR, 0.2, SCALE)(np.array([1.1, 0.5, 0.5]), "linear")


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


def test_errors_of_points_left_out_by_the_formula_are_those_of_solving_again():
    """What the search is guided by: (A^-1 r)_i / (A^-1)_ii, here against leaving each point out."""
    points, values = POINTS[:12], np.sin(3.0 * POINTS[:12, :1])
    matrix = np.exp(-0.5 * np.sum((points[:, None] - points[None]) ** 2, axis=2)) + 0.1 * np.eye(12)
    inverse = np.linalg.inv(matrix)
    formula = inverse @ values / np.diag(inverse)[:, None]
    others = np.arange(12) != 4
    again = matrix[4, others] @ np.linalg.solve(matrix[np.ix_(others, others)], values[others])
    assert formula[4, 0] == pytest.approx(values[4, 0] - again[0])

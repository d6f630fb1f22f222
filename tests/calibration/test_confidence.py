"""Intervals against scipy's curve_fit and a closed form, coverage, and what is not determined."""

from itertools import combinations, groupby

import numpy as np
import pytest
from scipy.optimize import curve_fit

from evfem.calibration.confidence import confidence, few_runs

X = np.linspace(0.0, 2.0, 12)


def test_errors_and_correlation_are_those_of_another_code():
    """scipy's curve_fit on a curve, its Jacobian by hand."""
    y = 1.3 * np.exp(-0.8 * X) + 0.01 * np.random.default_rng(5).normal(size=X.size)
    best, covariance = curve_fit(lambda x, a, b: a * np.exp(-b * x), X, y, p0=(1.0, 1.0), xtol=1e-12)
    a, b = best
    jacobian = np.column_stack([np.exp(-b * X), -a * X * np.exp(-b * X)])
    known = confidence(jacobian, a * np.exp(-b * X) - y, ["a", "b"])
    np.testing.assert_allclose(known.errors, np.sqrt(np.diag(covariance)), rtol=1e-5)
    share = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    assert known.correlation[0, 1] == pytest.approx(share, rel=1e-4)
    assert known.warnings == ()


def test_a_parameter_that_changes_nothing_is_named():
    known = confidence(np.column_stack([X, np.zeros(12)]), np.ones(12), ["slope", "colour"])
    assert known.warnings == ("colour changes nothing that was measured",)
    assert np.isfinite(known.errors[0])
    assert np.isinf(known.errors[1])
    assert known.singular_values[1] == 0.0


def test_parameters_that_only_act_together_are_named():
    jacobian = np.column_stack([X, 3.0 * X, np.ones(12), 2.0 * X])
    known = confidence(jacobian, np.ones(12), ["a", "b", "height", "c"])
    assert known.warnings[0].startswith("the data do not tell a, b and c apart")
    assert len(known.warnings) == 2  # two directions of three parameters
    assert np.isfinite(known.errors).tolist() == [False, False, True, False]


def test_strong_correlation_is_said_with_its_sign():
    known = confidence(np.column_stack([X, X + 0.01 * X**2]), np.ones(12), ["a", "b"])
    (warning,) = known.warnings
    assert warning.startswith(f"a and b are correlated by {known.correlation[0, 1]:.3f}: ")
    assert known.correlation[0, 1] < -0.99
    assert np.isfinite(known.errors).all()


@pytest.mark.parametrize("signs", ["+++---", "+-+-+-", "++-++--+", "+---++++++", "-+", "++++"])
def test_the_probability_of_few_runs_is_that_of_all_orders(signs):
    """Every order of the same signs, one by one."""
    numbers = np.array([1.0 if sign == "+" else -1.0 for sign in signs])
    runs = len(list(groupby(signs)))
    places = combinations(range(len(signs)), signs.count("+"))
    orders = [["+" if i in chosen else "-" for i in range(len(signs))] for chosen in map(set, places)]
    few = sum(len(list(groupby(order))) <= runs for order in orders)
    assert few_runs(numbers) == few / len(orders)

r"""Estimators of the friction curve from the database, and how wrong they are.

All three give weighted sums of the database's responses ``r_i(x) = (mu_i(x) - friction_i) / slope_i``
for a point p of the box (`parametric`):

- conditional average, the paper's tool, with a Gaussian kernel (Nadaraya 1964,
  doi:10.1137/1109020)::

      r(p) = sum_i k_i r_i / sum_i k_i,   k_i = exp(-|p - p_i|^2 / (2 width^2))

  with the width that has the smallest sum of squares when each point is left out in turn;
- linear interpolation between the corners of the Delaunay simplex that holds p. Its weights w solve
  ``min sum_i w_i |p_i|^2`` with ``sum_i w_i p_i = p, sum_i w_i = 1, w >= 0``, the lower hull of the
  points lifted to a paraboloid; where nothing solves it, p is outside the hull of the points;
- radial basis functions |r|^3 with a linear polynomial (scipy's `RBFInterpolator`).

Each point's error is what the other points say of it. A prediction carries the errors of the points
near it, weighted by the kernel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice
from evfem.errors import InputError

METHODS = ("average", "linear", "rbf")
#: kernel widths that are tried, and that which weighs the errors of neighbours
WIDTHS, NEAR = tuple(0.05 * 1.15**k for k in range(20)), 0.25


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimates responses (SAMPLES,) at places in the box from points (N, 6) and their responses
    (N, SAMPLES); `width` is the kernel's.
    """

    points: Floats
    responses: Floats
    width: float

    def __call__(self, place: Floats, method: str) -> Floats:
        """The response (SAMPLES,) at a place (6,)."""
        choice("method", method, METHODS)
        if method == "rbf":
            return np.asarray(self._surface(place[None])[0])
        if method == "average":
            return kernel(self.points, place, self.width) @ self.responses
        weights = hull_weights(self.points, place)
        if weights is None:
            raise InputError("point", "outside the hull", "a point inside the hull of the database")
        return weights @ self.responses

    @cached_property
    def _surface(self) -> Any:
        from scipy.interpolate import RBFInterpolator

        return RBFInterpolator(self.points, self.responses, kernel="cubic", degree=1)

    def without(self, i: int) -> Estimator:
        """The same without point i."""
        return Estimator(np.delete(self.points, i, 0), np.delete(self.responses, i, 0), self.width)


def kernel(points: Floats, place: Floats, width: float) -> Floats:
    """Normalised Gaussian weights (N,) of points around a place."""
    square = np.sum((points - place) ** 2, axis=1)
    weight = np.exp(-0.5 * (square - square.min()) / width**2)
    return weight / weight.sum()


def hull_weights(points: Floats, place: Floats) -> Floats | None:
    """Weights (N,) of linear interpolation at a place, None outside the hull of the points.

    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    >>> abs(hull_weights(square, np.array([0.25, 0.0]))).round(9).tolist()
    [0.75, 0.25, 0.0, 0.0]
    >>> hull_weights(square, np.array([1.5, 0.5])) is None
    True
    """
    from scipy.optimize import linprog

    lifted = np.sum((points - place) ** 2, axis=1)  # the same simplex from wherever it is measured
    equations = np.concatenate([points.T, np.ones((1, len(points)))])
    found = linprog(lifted, A_eq=equations, b_eq=np.append(place, 1.0), method="highs")
    return np.asarray(found.x) if found.status == 0 else None


def best_width(points: Floats, responses: Floats) -> float:
    """The kernel width with the smallest sum of squares when each point is left out in turn."""
    square = np.sum((points[:, None] - points[None]) ** 2, axis=2)
    np.fill_diagonal(square, np.inf)
    nearest = square.min(axis=1, keepdims=True)
    errors = []
    for width in WIDTHS:
        weight = np.exp(-0.5 * (square - nearest) / width**2)
        guess = weight @ responses / weight.sum(axis=1, keepdims=True)
        errors.append(np.sum((guess - responses) ** 2))
    return float(WIDTHS[int(np.argmin(errors))])


def left_out(estimator: Estimator, method: str) -> Floats:
    """What the other points say of each point's response, (N, SAMPLES); NaN where it lies outside
    their hull, which `linear` cannot leave.
    """
    found = np.full(estimator.responses.shape, np.nan)
    for i, place in enumerate(estimator.points):
        others = estimator.without(i)
        if method != "linear" or hull_weights(others.points, place) is not None:
            found[i] = others(place, method)
    return found

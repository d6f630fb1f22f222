r"""Estimators of the friction curve from the database, and how wrong they are.

All three give weighted sums of the database's responses r_i (`correction`) for a point p of the box
(`parametric`), whose axes are stretched by `scale` first: responses change faster along some
parameters than along others. An error of a response counts by `weights`, as it changes the curve.

- conditional average, the paper's tool, with a Gaussian kernel (Nadaraya 1964,
  doi:10.1137/1109020)::

      r(p) = sum_i k_i r_i / sum_i k_i,   k_i = exp(-|p - p_i|^2 / (2 width^2))

  with the width that has the smallest mean error when each point is left out in turn;
- linear interpolation between the corners of the Delaunay simplex that holds p. Its weights w solve
  ``min sum_i w_i |p_i|^2`` with ``sum_i w_i p_i = p, sum_i w_i = 1, w >= 0``, the lower hull of the
  points lifted to a paraboloid; where nothing solves it, p is outside the hull of the points;
- radial basis functions ``exp(-|r|^2 / 2)`` with a linear polynomial and `smoothing` on the
  diagonal (scipy's `RBFInterpolator`).

The scale and the smoothing are those with the smallest mean error when each point is left out in
turn, which is known without solving again: ``e_i = (A^-1 r)_i / (A^-1)_ii`` (Rippa 1999,
doi:10.1023/A:1018975909870).

Each point's error is what the other points say of it. A prediction carries the errors of the points
near it, weighted by the kernel.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice
from evfem.errors import InputError

METHODS = ("average", "linear", "rbf")
#: kernel widths that are tried, and that which weighs the errors of neighbours, both in stretched axes
WIDTHS, NEAR = tuple(0.1 * 1.15**k for k in range(25)), 1.0
#: where the search for scale and smoothing begins, and how many it may try
FIRST_SCALE, FIRST_SMOOTHING, MOST_TRIES = 2.0, 0.1, 600


@dataclass(frozen=True, eq=False)
class Estimator:
    """Estimates responses (SAMPLES,) at places in the box from points (N, 6) and their responses
    (N, M); `width` is that of the conditional average, `scale` (6,) stretches the axes,
    `smoothing` is that of the radial basis functions.
    """

    points: Floats
    responses: Floats
    width: float
    scale: Floats
    smoothing: float = 0.0

    def __call__(self, place: Floats, method: str) -> Floats:
        """The response (M,) at a place (6,)."""
        choice("method", method, METHODS)
        if method == "rbf":
            return np.asarray(self._surface((place * self.scale)[None])[0])
        if method == "average":
            return self.near(place, self.width) @ self.responses
        weights = hull_weights(self.points * self.scale, place * self.scale)
        if weights is None:
            raise InputError("point", "outside the hull", "a point inside the hull of the database")
        return weights @ self.responses

    def near(self, place: Floats, width: float) -> Floats:
        """Weights (N,) of the points around a place."""
        return kernel(self.points * self.scale, place * self.scale, width)

    @cached_property
    def _surface(self) -> Any:
        from scipy.interpolate import RBFInterpolator

        return RBFInterpolator(
            self.points * self.scale,
            self.responses,
            kernel="gaussian",
            epsilon=np.sqrt(0.5),
            smoothing=self.smoothing,
            degree=1,
        )

    def without(self, i: int) -> Estimator:
        """The same without point i."""
        points, responses = np.delete(self.points, i, 0), np.delete(self.responses, i, 0)
        return Estimator(points, responses, self.width, self.scale, self.smoothing)


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


def best_width(points: Floats, responses: Floats, weights: Floats) -> float:
    """The kernel width with the smallest mean error when each point is left out in turn."""
    square = np.sum((points[:, None] - points[None]) ** 2, axis=2)
    np.fill_diagonal(square, np.inf)
    nearest = square.min(axis=1, keepdims=True)
    errors = []
    for width in WIDTHS:
        weight = np.exp(-0.5 * (square - nearest) / width**2)
        guess = weight @ responses / weight.sum(axis=1, keepdims=True)
        errors.append(_mean_error(guess - responses, weights))
    return float(WIDTHS[int(np.argmin(errors))])


def _mean_error(errors: Floats, weights: Floats) -> float:
    """Mean size of weighted errors (N, M), each of which counts as 1 where it is larger."""
    return float(np.mean(np.minimum(np.sqrt(np.sum((weights * errors) ** 2, axis=1)), 1.0)))


def left_out(estimator: Estimator, method: str) -> Floats:
    """What the other points say of each point's response, (N, M); NaN where it lies outside
    their hull, which `linear` cannot leave.
    """
    found = np.full(estimator.responses.shape, np.nan)
    for i, place in enumerate(estimator.points):
        with suppress(InputError):
            found[i] = estimator.without(i)(place, method)
    return found


def best_kernel(points: Floats, responses: Floats, weights: Floats) -> tuple[Floats, float]:
    """The scale (6,) of the axes and the smoothing with the smallest mean error of points left out."""
    from scipy.optimize import minimize

    linear = np.column_stack([np.ones(len(points)), points])
    rest = responses - linear @ np.linalg.lstsq(linear, responses, rcond=None)[0]

    def error(logarithms: Floats) -> float:
        stretched = points * np.exp(logarithms[:-1])
        square = np.sum((stretched[:, None] - stretched[None]) ** 2, axis=2)
        matrix = np.exp(-0.5 * square) + np.exp(logarithms[-1]) * np.eye(len(points))
        inverse = np.linalg.inv(matrix)
        return _mean_error(inverse @ rest / np.diag(inverse)[:, None], weights)

    begin = np.append(np.full(points.shape[1], np.log(FIRST_SCALE)), np.log(FIRST_SMOOTHING))
    found = minimize(error, begin, method="Nelder-Mead", options={"maxfev": MOST_TRIES})
    return np.exp(found.x[:-1]), float(np.exp(found.x[-1]))

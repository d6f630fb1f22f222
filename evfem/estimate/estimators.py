r"""The estimator of the friction curve from the database, and how wrong it is.

It gives a weighted sum of the database's responses r_i (`correction`) for a point p of the box
(`parametric`), whose axes are stretched by `scale` first: responses change faster along some parameters than
along others. The weights are those of radial basis functions ``exp(-|r|^2 / 2)`` with a linear polynomial and
`smoothing` on the diagonal (scipy's `RBFInterpolator`). The conditional average of the paper and linear
interpolation were as good: medians of the errors 3.4 to 4.4 % of the range of a curve.

The scale and the smoothing are those with the smallest mean error when each point is left out in
turn, which is known without solving again: ``e_i = (A^-1 r)_i / (A^-1)_ii`` (Rippa 1999,
doi:10.1023/A:1018975909870). An error of a response counts by `weights`, as it changes the curve.

Each point's error is what the other points say of it. A prediction carries the errors of the points
near it, with Gaussian weights.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats

#: where the search for scale and smoothing begins, and how many it may try
FIRST_SCALE, FIRST_SMOOTHING, MOST_TRIES = 2.0, 0.1, 600


@dataclass(frozen=True, eq=False)
class Estimator:
    """Responses (M,) at places from those (N, M) of points (N, 6); `scale` (6,) stretches the axes."""

    points: Floats
    responses: Floats
    scale: Floats
    smoothing: float = 0.0

    def __call__(self, location: Floats) -> Floats:
        """The response (M,) at a place (6,)."""
        return np.asarray(self._surface((location * self.scale)[None])[0])

    def near(self, location: Floats) -> Floats:
        """Weights (N,) of the points around a place, of sum 1."""
        square = np.sum(((self.points - location) * self.scale) ** 2, axis=1)
        weight = np.exp(-0.5 * (square - square.min()))
        return np.asarray(weight / weight.sum())

    def holds(self, location: Floats) -> bool:
        """Whether a place is inside the hull of the points: a mean with weights that are not negative."""
        from scipy.optimize import linprog

        equations = np.concatenate([self.points.T, np.ones((1, len(self.points)))])
        found = linprog(np.zeros(len(self.points)), A_eq=equations, b_eq=np.append(location, 1.0))
        return found.status == 0

    @cached_property
    def _surface(self) -> Any:
        from scipy.interpolate import RBFInterpolator

        kernel: Any = {"kernel": "gaussian", "epsilon": np.sqrt(0.5), "degree": 1}
        return RBFInterpolator(self.points * self.scale, self.responses, smoothing=self.smoothing, **kernel)

    def left_out(self) -> Floats:
        """Leave-one-out prediction of each point's response, (N, M)."""
        return np.array([self.without(i)(location) for i, location in enumerate(self.points)])

    def without(self, i: int) -> Estimator:
        """The same without point i."""
        points, responses = np.delete(self.points, i, 0), np.delete(self.responses, i, 0)
        return Estimator(points, responses, self.scale, self.smoothing)


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
        sizes = np.linalg.norm(weights * (inverse @ rest) / np.diag(inverse)[:, None], axis=1)
        return float(np.mean(np.minimum(sizes, 1.0)))

    begin = np.append(np.full(points.shape[1], np.log(FIRST_SCALE)), np.log(FIRST_SMOOTHING))
    found = minimize(error, begin, method="Nelder-Mead", options={"maxfev": MOST_TRIES})
    return np.exp(found.x[:-1]), float(np.exp(found.x[-1]))

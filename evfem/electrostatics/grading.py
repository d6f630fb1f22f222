"""Places of cells along a line that are small where they must be and grow from there."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats


def spread(x: Floats, values: Floats, growth: float) -> Floats:
    """The smallest of `values` + growth * distance over all points of ascending `x`, at each point: the
    highest curve below the values that is nowhere steeper than `growth`.

    >>> spread(np.array([0.0, 1.0, 2.0]), np.array([5.0, 1.0, 9.0]), 2.0).tolist()
    [3.0, 1.0, 3.0]
    """
    left = growth * x + np.minimum.accumulate(values - growth * x)
    right = np.minimum.accumulate((values + growth * x)[::-1])[::-1] - growth * x
    return np.asarray(np.minimum(values, np.minimum(left, right)))


def spread_around(x: Floats, values: Floats, growth: float) -> Floats:
    """`spread` over one period, from the first to the last `x`, of values that repeat."""
    ends = values.copy()
    for _ in range(2):  # the smallest value may stand right before the seam
        ends = spread(x, ends, growth)
        ends[[0, -1]] = ends[[0, -1]].min()
    return spread(x, ends, growth)


def graded(a: float, b: float, sizes: tuple[float, float], growth: float, most: float, least: int) -> Floats:
    """Places from `a` to `b`: cells of about `sizes` at the two ends grow by `growth` per length, to
    at most `most`; at least `least` cells.

    >>> np.round(graded(0.0, 1.0, (0.1, 1.0), 1.0, 1.0, 1), 3).tolist()
    [0.0, 0.123, 0.396, 1.0]
    """
    length = b - a
    small = [min(size, most, length) for size in sizes]
    if least == 1 and min(small) >= length:
        return np.array([a, b])
    half = [np.append(0.0, np.geomspace(1e-2 * size, length, 200)) for size in small]
    t = np.unique(np.concatenate([half[0], length - half[1]]).clip(0.0, length))
    width = np.minimum(np.minimum(small[0] + growth * t, small[1] + growth * (length - t)), most)
    number = np.append(0.0, np.cumsum(np.diff(t) * 0.5 * (1.0 / width[1:] + 1.0 / width[:-1])))
    cells = max(least, int(np.ceil(number[-1] - 1e-9)))
    places = a + np.interp(np.linspace(0.0, number[-1], cells + 1), number, t)
    places[0], places[-1] = a, b
    return places

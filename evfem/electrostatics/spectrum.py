"""Orders and shares of the harmonics of a voltage that repeats."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats

#: odd harmonics of a square wave that count one by one, groups of those above, and the highest one
SINGLE, GROUPS, HIGHEST = 16, 32, 1_000_001
#: orders of samples that repeat: at least so many, and so many times the samples of a period
SMOOTH, PERIODS = 4096, 8


def square_harmonics() -> tuple[Floats, Floats]:
    """Orders and weights of the harmonics of a square wave, the sum of the weights being 1.

    >>> order, weight = square_harmonics()
    >>> order[:3].tolist(), weight[:2].round(4).tolist(), round(float(weight.sum()), 12)
    ([1.0, 3.0, 5.0], [0.8106, 0.0901], 1.0)
    """
    order = np.arange(1.0, HIGHEST, 2.0)
    weight = 8.0 / (np.pi * order) ** 2
    weight[-1] += 1.0 - weight.sum()
    return grouped(order, weight)


def grouped(order: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """The first `SINGLE` of these orders as they are, those above in at most `GROUPS` groups: orders
    that grow, from 1 on, and weights, of the same total.
    """
    if order.size <= SINGLE:
        return order, weight
    ends = np.unique(np.geomspace(SINGLE, order.size, GROUPS + 1).astype(int))[:-1]
    begins = np.concatenate([np.arange(SINGLE), ends])
    sums = np.add.reduceat(weight, begins)
    mean = np.exp(np.add.reduceat(weight * np.log(order), begins) / np.where(sums > 0.0, sums, 1.0))
    return np.concatenate([order[:SINGLE], mean[SINGLE:]]), sums


def shares(order: Floats, square: Floats) -> tuple[float, Floats, Floats]:
    """Effective voltage (V) of squared ones (V^2) of some orders, and the orders with their shares of it."""
    total = float(square.sum())
    kept = square > 0.0
    return float(np.sqrt(total)), order[kept], square[kept] / (total if total > 0.0 else 1.0)

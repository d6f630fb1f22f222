"""Gauss points on a straight way: eight, or more, dense where what acts on the way changes fast."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats


def gauss(points: int) -> tuple[Floats, Floats]:
    """Places and weights on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(points)
    return 0.5 + 0.5 * x, 0.5 * weight


def _along(ends: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Places and weights (with their derivative), eight between `ends`, dense where attraction changes."""
    at, weight = gauss(8)
    begin, length = np.array(ends[:-1])[:, None], np.diff(ends)[:, None]
    at, weight = (begin + length * at).ravel(), (length * weight).ravel()
    return at**2 * (3.0 - 2.0 * at), 6.0 * at * (1.0 - at) * weight


#: where the attraction is taken on the way, and where it is if that does not resolve it: the layers below a
#: thin insulator's nodes are thinner than their ways by orders
WAY, SHARE = _along((0.0, 1.0))
FINE_WAY, FINE_SHARE = _along((0.0, 1 / 64, 1 / 16, *np.linspace(1 / 8, 7 / 8, 7), 15 / 16, 63 / 64, 1.0))
#: the places see an integrand whose highest Legendre coefficients are below this share of the largest
SEEN = 1e-3
#: its two ends
ENDS = np.array([0.0, 1.0])
#: Legendre coefficients (8,) over the way from the values at the places `WAY`
LEGENDRE = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * WAY - 1.0, WAY.size - 1))
#: and where the friction coefficient is
SLIDE, PART = gauss(4)

"""Gauss quadrature of the work of the attraction and of friction along a straight path of displacements."""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats


def gauss(points: int) -> tuple[Floats, Floats]:
    """Nodes and weights on (0, 1)."""
    x, weight = np.polynomial.legendre.leggauss(points)
    return 0.5 + 0.5 * x, 0.5 * weight


def _along(ends: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Nodes and weights (with the derivative of the map), eight between `ends`, clustered at both ends."""
    at, weight = gauss(8)
    begin, length = np.array(ends[:-1])[:, None], np.diff(ends)[:, None]
    at, weight = (begin + length * at).ravel(), (length * weight).ravel()
    return at**2 * (3.0 - 2.0 * at), 6.0 * at * (1.0 - at) * weight


#: nodes and weights of the work of the attraction, and finer ones if these do not resolve it: thin insulators
#: are thinner than displacements by orders of magnitude
WAY, SHARE = _along((0.0, 1.0))
FINE_WAY, FINE_SHARE = _along((0.0, 1 / 64, 1 / 16, *np.linspace(1 / 8, 7 / 8, 7), 15 / 16, 63 / 64, 1.0))
#: an integrand is resolved if its highest Legendre coefficients are below this fraction of the largest
SEEN = 1e-3
#: the two ends of the path
ENDS = np.array([0.0, 1.0])
#: matrix from values at the nodes `WAY` to Legendre coefficients (8,)
LEGENDRE = np.linalg.inv(np.polynomial.legendre.legvander(2.0 * WAY - 1.0, WAY.size - 1))
#: nodes and weights of the friction work
SLIDE, PART = gauss(4)

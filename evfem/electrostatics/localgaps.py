r"""What rough faces attract on average: local gaps differ, and the small ones count most.

Rough faces with the mean gap U = s(p) (`evfem.electrostatics.roughness`) attract with the mean of the force
law over their local gaps u, more than the law does at U (Jensen). At the *equivalent gap* the law
attracts as much as on average. Where a law of roughness has a `distribution`, this is the separation that an
attraction gets, so that nothing else has to know of local gaps. By Strong and Troxel's law it is

.. math:: \langle (u + \sigma)^{-2} \rangle^{-1/2} - \sigma, \qquad \sigma = \sum d / \varepsilon,

and with :math:`x = \sigma / U`

- ``exponential`` gaps have :math:`\langle (u + \sigma)^{-2} \rangle = e^x E_2(x) / (x U^2) = [1/\sigma - e^x
  E_1(x) / U] / U` (NIST Digital Library of Mathematical Functions, 8.19);
  elastic contacts have them under load (Prodanov et al. 2014, doi:10.1007/s11249-013-0282-z);
- ``gaussian`` gaps are those of faces whose rms height is U/3. The tail u < 0, 0.13 % of the area that would
  overlap, is cut off and attracts nothing: over thick layers 0.13 % of the force are missing.

All gaps fall in proportion to U. Open nodes keep the equivalent gap of no pressure above their own one. For
other laws that go with the square of the voltage, those of drives with losses and harmonics among them, the
mean is taken by Gauss's rule and its gap by Newton's method (`SpreadGaps`).

Units: mm, MPa.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, above, at_least, choice, to_python
from evfem.electrostatics.laws import StrongTroxel, traction_derivative
from evfem.electrostatics.roughness import (
    DISTRIBUTIONS,
    NONE,
    distribution_of,
    roughness_of,
    separation_derivative,
)
from evfem.errors import InputError, describe_value
from evfem.protocols import ForceLaw, RoughnessLaw

#: Gauss points from 0 to 1, closer where gaps are small, and their weights
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(80)
_POINTS, _WEIGHTS = (0.5 + 0.5 * _POINTS) ** 5, 2.5 * (0.5 + 0.5 * _POINTS) ** 4 * _WEIGHTS
#: the largest exponential gap that counts, in means, and how far Gaussian ones are from the mean, in rms
LARGEST, FARTHEST = 45.0, 9.0
#: mean gap of Gaussian gaps over the rms height, unless given
APART = 3.0
#: where the exponential integral is a series of so many terms
LARGE, TERMS = 50.0, 20
#: steps for an equivalent gap, of which Strong and Troxel's law needs one
STEPS = 4


def local_gaps(distribution: str, apart: Values = APART) -> tuple[Floats, Floats]:
    """Local gaps over their mean (K, ...), and shares; `apart` is the mean of Gaussian ones over the rms."""
    r = np.asarray(apart)
    points, weights = (one.reshape(-1, *(1,) * r.ndim) for one in (_POINTS, _WEIGHTS))
    if distribution == "exponential":
        x = LARGEST * points
        return x, LARGEST * weights * np.exp(-x)
    least, largest = np.maximum(1.0 - FARTHEST / r, 0.0), 1.0 + FARTHEST / r
    x = least + (largest - least) * points
    density = r / np.sqrt(2.0 * np.pi) * np.exp(-0.5 * (r * (x - 1.0)) ** 2)
    return x, (largest - least) * weights * density


def equivalent_gap(
    mean: Values, reduced: Values, distribution: str = "exponential", rms: Values | None = None
) -> Values:
    """The one gap (mm) that attracts as rough faces with the `mean` gap U (mm) do on average, by Strong and
    Troxel's law over layers of the `reduced` thickness s (mm): <(u + s)^-2>^(-1/2) - s. All broadcast.

    `distribution` is exponential or gaussian, `rms` (mm) the rms height of gaussian gaps, U/3 unless given;
    those below 0, a share of Phi(-U/rms), attract nothing. Raises InputError for what is no such length, and
    for an rms height above U/2, where more than 2.3 % would.

    >>> stack = 0.001 / 3.9 + 0.2 / 1650.0
    >>> (1e3 * equivalent_gap([0.001, 0.003, 0.005], stack)).round(4).tolist()                      # um
    [0.4213, 0.836, 1.1301]
    """
    choice("distribution", distribution, DISTRIBUTIONS)
    U = np.asarray(at_least("mean", mean, 0.0, "a length in mm, not negative"))
    s = np.asarray(at_least("reduced", reduced, 0.0, "a length in mm, not negative"))
    if rms is not None and distribution != "gaussian":
        raise InputError("rms", rms, "only that of gaussian gaps: of exponential ones it is the mean")
    height = U / APART if rms is None else above("rms", rms, 0.0, "a length in mm above zero")
    if np.any(2.0 * height > U * (1.0 + 1e-12)):
        raise InputError("rms", describe_value(rms), "up to half the mean gap: rougher faces overlap")
    away = (s > 0.0) & (U > 0.0)  # otherwise a gap of none attracts without bound, or is all there is
    U, s, height = (np.where(away, one, 1.0) for one in (U, s, height))
    if distribution == "exponential":
        found = U * _exponential_gap(s / U)
    else:
        x, share = local_gaps(distribution, U / height)
        found = np.sum(share / (U * x + s) ** 2, axis=0) ** -0.5 - s
    return to_python(np.where(away, found, 0.0))


def _exponential_gap(x: Floats) -> Floats:
    """Equivalent gap over the mean gap, x the reduced thickness over it."""
    from scipy.special import expn

    few, many = np.minimum(x, LARGE), np.maximum(x, LARGE)
    near = few * ((few * np.exp(few) * expn(2, few)) ** -0.5 - 1.0)
    if (x < LARGE).all():
        return np.asarray(near)
    terms = np.cumprod([-(k + 1) / many for k in range(1, TERMS)], axis=0)
    return np.where(x < LARGE, near, many * np.expm1(-0.5 * np.log1p(terms.sum(axis=0))))


@dataclass(frozen=True)
class SpreadGaps:
    """Rough faces as a force `law` over `layers` sees them: with the equivalent gaps of a `distribution`
    whose means are the separations of `roughness`. For laws that go with the square of the voltage.

    >>> from evfem import ConstantRoughness
    >>> from evfem.electrostatics.laws import Layers
    >>> faces = SpreadGaps(ConstantRoughness(0.001), "exponential", StrongTroxel(), Layers(3.776e-4, 0.2))
    >>> round(faces.separation(0.0), 7)
    0.0004213
    """

    roughness: RoughnessLaw
    distribution: str
    law: Any
    layers: Any

    def separation(self, pressure: Values) -> Values:
        """Equivalent gap (mm) at contact pressures (..., P) in MPa."""
        return to_python(self._equivalent(np.asarray(self.roughness.separation(pressure))))

    def separation_derivative(self, pressure: Values) -> Values:
        """Its derivative (mm/MPa)."""
        U = np.asarray(self.roughness.separation(pressure))
        slope = np.asarray(self._slope(self._equivalent(U)))
        rate = self._sum(lambda x: x * self._slope(U * x)) / np.where(slope != 0.0, slope, 1.0)
        return to_python(rate * separation_derivative(self.roughness, pressure))

    def mean(self, of: Any, gap: Values, pressure: Values) -> Any:
        """Mean of a quantity of the gap, each local gap wider by `gap` (mm)."""
        U = np.asarray(self.roughness.separation(pressure))
        return self._sum(lambda x: np.asarray(of(gap + U * x)))

    def _equivalent(self, U: Floats) -> Floats:
        if type(self.law) is StrongTroxel and not np.any(self.layers.loss):
            return np.asarray(equivalent_gap(U, self.law.gap_eps_r * self.layers.reduced, self.distribution))
        if U.ndim > 1:  # harmonics have an axis of their own before the nodes
            return np.stack([self._equivalent(row) for row in U])
        pull, gap = self._sum(lambda x: self._traction(U * x)), U
        for _ in range(STEPS):  # Newton's for the root of 1 / traction, about straight in the gap
            own, slope = self._traction(gap), self._slope(gap)
            there = (pull > 0.0) & (slope < 0.0)
            step = 2.0 * own / np.where(there, slope, 1.0) * (1.0 - np.sqrt(own / np.where(there, pull, 1.0)))
            gap = np.maximum(gap + np.where(there, step, 0.0), 0.0)
        return gap

    def _sum(self, of: Any) -> Any:
        """Mean of values at local gaps over their mean."""
        return sum(share * of(x) for x, share in zip(*local_gaps(self.distribution), strict=True))

    def _traction(self, gap: Floats) -> Floats:
        return np.asarray(self.law.traction(gap, 1.0, self.layers))

    def _slope(self, gap: Floats) -> Any:
        return np.asarray(traction_derivative(self.law, gap, 1.0, self.layers))


def over_gaps(rough: RoughnessLaw | None, of: Any, gap: Values, pressure: Values) -> Any:
    """Mean of a quantity of the gap over the local gaps of rough faces that are `gap` (mm) beyond the
    separation at a pressure (MPa): what is no attraction has another mean than at the equivalent gap.
    """
    if isinstance(rough, SpreadGaps):
        return rough.mean(of, gap, pressure)
    return of(gap if rough is None else gap + rough.separation(pressure))


def roughness_below(law: ForceLaw, layers: Any, given: Any) -> RoughnessLaw | None:
    """The roughness of a scene as a force law over layers sees it: with its equivalent gaps."""
    found, distribution = roughness_of(given), distribution_of(given)
    if found is None or distribution == NONE:
        return found
    return SpreadGaps(found, distribution, law, layers)

r"""Breakdown of the air between skin and display: Paschen's law, and the smallest voltage that can spark.

A gap g of air at the pressure p breaks down at

.. math:: V_B(g) = \frac{B p g}{\ln(A p g) - C}, \qquad C = \ln\ln(1 + 1/\gamma),

with A = 15 and B = 365 V per cm and Torr, :math:`\gamma = 0.01` and p = 760 Torr. Below the gap
:math:`g_0 = e^{1 + C}/(A p)` of its minimum, 305.3 V at 11.00 um, it is the minimum: a discharge takes a
longer way beside the shortest one. The constants are those of
https://www.vcalc.com/wiki/EmilyB/Paschen%27s+Law for air, 112.501 and 2737.50 V per kPa cm; software rounds
them to 11 and 274 per Pa m after E. Nasser (1971, Fundamentals of gaseous ionization and plasma electronics).
Metals in gaps below some 4 um break down by field emission at less than the minimum, which is not in here.

Over layers of the reduced thickness s the gap has :math:`U g/(g + s)` of a voltage U, so that
:math:`V_B (g + s)/g` breaks it down. The least of that is :math:`B p g` at the gap with
:math:`\ln(g/g_0) = s/g`.

Lengths in mm, V.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, at_least, to_python
from evfem.electrostatics.laws import Layer, Layers, stacked
from evfem.errors import InputError, describe_value

#: of air at one atmosphere, per mm: A p (1/mm), B p (V/mm), and C
IONISATION, FIELD, SECONDARY = 15.0 * 76.0, 365.0 * 76.0, float(np.log(np.log1p(1.0 / 0.01)))
#: gap (mm) of the minimum
LOWEST = float(np.exp(1.0 + SECONDARY)) / IONISATION
#: halvings of an interval, Newton iterations for a gap, Gauss points of an integral over the gap
HALVINGS, ITERATIONS, POINTS = 60, 30, 16
#: what scenes do about a gap whose voltage exceeds Paschen's
MODES = ("warn", "limit", "off")


def breakdown_voltage(gap: Values) -> Values:
    """Voltage (V) at which a `gap` (mm) of air breaks down; below the minimum of Paschen's curve this.

    >>> [round(breakdown_voltage(gap), 1) for gap in (0.001, 0.011, 0.1)]
    [305.3, 305.3, 865.0]
    """
    return to_python(_paschen(np.asarray(at_least("gap", gap, 0.0, "an air gap in mm, not negative"))))


def _paschen(gap: Any) -> Any:
    """The same of gaps that may be complex, or slightly negative."""
    wide = np.where(np.real(gap) > LOWEST, gap, LOWEST)
    return FIELD * wide / (np.log(IONISATION * wide) - SECONDARY)


def inception_voltage(layers: Any) -> tuple[Values, Values]:
    """The smallest voltage (V) that breaks down any gap over solid `layers`, and that gap (mm).

    `layers` is a `Layers`, a `Layer` or a list of them. Raises InputError for anything else.

    >>> from evfem import Layer
    >>> voltage, gap = inception_voltage([Layer(0.38, 1650.0), Layer(0.09, 3.35)])
    >>> round(voltage, 4), round(1e3 * gap, 4)
    (790.2422, 28.4875)
    """
    found = stacked(layers)
    if isinstance(found, Layer):
        found = Layers.of(found)
    if not isinstance(found, Layers):
        raise InputError("layers", describe_value(layers), "a Layers, a Layer or a list of them")
    gap = _weakest(np.asarray(found.reduced))
    return to_python(FIELD * gap), to_python(gap)


def _weakest(reduced: Any) -> Any:
    """The gap (mm) that breaks down first over layers of this reduced thickness (mm)."""
    ratio = reduced / LOWEST
    t = np.log1p(ratio)
    for _ in range(ITERATIONS):  # t e^t = ratio
        pushed = ratio * np.exp(-t)
        t = t - (t - pushed) / (1.0 + pushed)
    return LOWEST * np.exp(t)


def across_gap(gap: Any, layers: Layers, gap_eps_r: float) -> Any:
    """Fraction of the voltage that the gap has; of harmonics in the first axis the largest."""
    near = gap + gap_eps_r * np.asarray(layers.reduced)
    apart = np.sqrt(near**2 + (gap_eps_r * np.asarray(layers.loss)) ** 2)
    found = gap / apart
    return found.max(axis=0) if found.ndim > np.ndim(gap) else found


@dataclass(frozen=True)
class Limited:
    """A force law whose field in the gap is held at that of Paschen's law: where a gap has r times the
    voltage at which it breaks down its traction is 1/r^2 of that of `law`. `crest` is the peak of the
    voltage over its effective value.
    """

    law: Any
    crest: float = 1.0

    @property
    def gap_eps_r(self) -> float:
        """Relative permittivity of what fills the gap."""
        return float(getattr(self.law, "gap_eps_r", 1.0))

    def _kept(self, gap: Any, voltage: Any, layers: Layers) -> Any:
        """Fraction of the traction that is left, 1/r^2 up to 1."""
        gap = np.asarray(gap)
        near = gap + self.gap_eps_r * np.asarray(layers.reduced)
        square = near**2 + (self.gap_eps_r * np.asarray(layers.loss)) ** 2
        volts = np.abs(np.asarray(voltage)) * self.crest * gap
        over = np.real(volts) > np.real(np.sqrt(square)) * np.real(_paschen(gap))
        return np.where(over, square * (_paschen(gap) / np.where(over, volts, 1.0)) ** 2, 1.0)

    def traction(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Attraction in MPa."""
        whole = np.asarray(self.law.traction(gap, voltage, layers))
        return to_python(whole * self._kept(gap, voltage, layers))

    def potential(self, gap: Values, voltage: Values, layers: Layers) -> Values:
        """Its potential per area in N/mm, zero at infinite gap: that of the law and the traction that is lost
        from the gap on.
        """
        shape = np.broadcast(gap, voltage, layers.reduced)
        first, last = self.sparking(np.broadcast_to(voltage, shape.shape), layers)
        begin = np.clip(np.asarray(gap), first, last)
        x, w = np.polynomial.legendre.leggauss(POINTS)
        lost, middle = 0.0, np.clip(LOWEST, begin, last)  # where the curve has a kink
        for low, high in ((begin, middle), (middle, last)):
            decades = np.log(high / low)
            for at, weight in zip(0.5 * (1.0 + x), 0.5 * w, strict=True):
                g = low * np.exp(at * decades)
                missing = 1.0 - self._kept(g, voltage, layers)
                lost = lost + weight * decades * g * missing * self.law.traction(g, voltage, layers)
        return to_python(np.asarray(self.law.potential(gap, voltage, layers)) + lost)

    def sparking(self, voltage: Any, layers: Layers) -> tuple[Floats, Floats]:
        """From which gap to which (mm) the air breaks down; the same where it does not."""
        volts = self.crest * np.abs(voltage)
        worst = _weakest(self.gap_eps_r * np.hypot(layers.reduced, layers.loss)) + 0.0 * volts

        def over(gap: Any) -> Any:
            return volts * across_gap(gap, layers, self.gap_eps_r) > _paschen(gap)

        there, ends = over(worst), []
        for far in (0.0 * worst, worst + volts / FIELD * 50.0):
            inside, outside = worst, far
            for _ in range(HALVINGS):
                middle = 0.5 * (inside + outside)
                sparks = over(middle)
                inside, outside = np.where(sparks, middle, inside), np.where(sparks, outside, middle)
            ends.append(np.where(there, inside, worst))
        return ends[0], ends[1]

r"""A force law with a linear core: below a gap a straight line of the same work takes its place.

Under a strong attraction each node of a mesh snaps by itself where the traction p(g) falls faster with
the gap than the mesh resolves. The work of adhesion is what counts then, not the strength [1]_ [2]_.
With :math:`g_0` the gap of closed faces, :math:`e = g_0 + h^*` and the potential :math:`\Pi`,

.. math:: p'(g) = p(e) + m\,(e - g) \quad (g_0 \le g < e), \qquad p'(g) = p(g) \quad (g \ge e),

.. math:: m = 2\,\frac{\Pi(e) - \Pi(g_0) - h^* p(e)}{h^{*2}} .

The work from :math:`g_0` to any gap beyond e is that of the law, and m is the steepest slope. No law of
the same work that is nowhere steeper and differs from p only below a gap differs from it less far. For
given m, :math:`h^*` is the only root, found by Newton's method between bounds; it depends on the
voltage, and is nothing where the law is not steeper than m. Below :math:`g_0`, where pressed rough faces
come closer, the traction grows as the law's does.

.. [1] K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324 (1971) 301,
   doi:10.1098/rspa.1971.0141.
.. [2] A. Turon, C. G. Davila, P. P. Camanho, J. Costa, Eng. Fract. Mech. 74 (2007) 1665,
   doi:10.1016/j.engfracmech.2006.08.025 (strength lowered, work kept).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, plain
from evfem.electrostatics.laws import traction_derivative
from evfem.protocols import ForceLaw

#: iterations for the length of a core, and its relative error
ITERATIONS, CLOSE = 60, 1e-14
#: a gap (mm) beyond the reach of any attraction
FAR = 1e3
#: Gauss points of the work of a law without a potential
_AT, _SHARE = np.polynomial.legendre.leggauss(64)


class Line(NamedTuple):
    """A core: where it ends (mm), the traction there and at closed faces (MPa), its slope (MPa/mm)."""

    end: Floats
    traction: Floats
    closed: Floats
    slope: Floats


class Cored:
    """`law` with a core no steeper than `steepest` (MPa/mm), or of the `length` (mm) that is given, for
    faces that are closed at the gap `closed` (mm).
    """

    def __init__(self, law: ForceLaw, closed: Values, steepest: Values, length: float | None = None) -> None:
        self.law, self.closed = law, np.asarray(closed, dtype=float)
        self.steepest, self.length = np.asarray(steepest, dtype=float), length
        self._known: tuple[Any, ...] = (None, None, None)

    def line(self, voltage: Values, layers: Any) -> Line:
        """The core at a voltage (V)."""
        if self._known[:2] != (voltage, id(layers)):
            self._known = (voltage, id(layers), self._line(voltage, layers))
        return self._known[2]

    def _line(self, voltage: Values, layers: Any) -> Line:
        long = self._length(voltage, layers)
        end = self.closed + long
        ends = np.asarray(self.law.traction(end, voltage, layers))
        rest = self._work(end, voltage, layers) - long * ends
        none = long == 0.0
        slope = np.where(none, 0.0, 2.0 * rest / np.where(none, 1.0, long) ** 2)
        return Line(end, ends, ends + slope * long, slope)

    def _length(self, voltage: Values, layers: Any) -> Floats:
        """h* (mm) of each node."""
        closed, m = self.closed, self.steepest
        p = np.asarray(self.law.traction(closed, voltage, layers))
        if self.length is not None:
            return np.full(p.shape, self.length)
        steep = -np.asarray(traction_derivative(self.law, closed, voltage, layers)) > m
        low, high = np.zeros(p.shape), 2.0 * p / m
        long = high.copy()
        for _ in range(ITERATIONS):
            ends = np.asarray(self.law.traction(closed + long, voltage, layers))
            rest = self._work(closed + long, voltage, layers) - long * ends - 0.5 * m * long**2
            low, high = np.where(rest > 0.0, long, low), np.where(rest > 0.0, high, long)
            slope = long * (m + np.asarray(traction_derivative(self.law, closed + long, voltage, layers)))
            following = long + rest / np.where(slope > 0.0, slope, 1.0)
            inside = (slope > 0.0) & (following >= low) & (following <= high)
            following = np.where(inside, following, 0.5 * (low + high))
            moved, long = np.abs(following - long), following
            if not (steep & (moved > CLOSE * long)).any():
                break
        return np.where(steep, long, 0.0)

    def _work(self, end: Floats, voltage: Values, layers: Any) -> Floats:
        """Work (N/mm) of the law from closed faces to the gap `end` (mm)."""
        potential: Any = getattr(self.law, "potential", None)
        if potential is not None:
            return np.asarray(potential(end, voltage, layers) - potential(self.closed, voltage, layers))
        # gaps go with the cube: the law is steepest at closed faces
        root, way = 0.5 * (1.0 + _AT), np.asarray(end - self.closed)
        at = (
            0.5 * share * 3.0 * r**2 * self.law.traction(self.closed + way * r**3, voltage, layers)
            for r, share in zip(root, _SHARE, strict=True)
        )
        return np.asarray(sum(at) * way)

    def adhesion(self, voltage: float, layers: Any) -> Floats:
        """Work of adhesion (N/mm), from closed faces to beyond all reach."""
        return np.asarray(self._work(self.closed + FAR, voltage, layers))

    def withheld(self, voltage: float, layers: Any) -> tuple[Floats, Floats]:
        """By how much the core's traction on closed faces falls short of the law's, and the core's (MPa)."""
        at = self.line(voltage, layers)
        return np.asarray(self.law.traction(self.closed, voltage, layers)) - at.closed, at.closed

    def traction(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Attraction in MPa for `gap` in mm, `voltage` in V."""
        at, gap = self.line(voltage, layers), np.asarray(gap)
        outside = np.where(gap.real < at.end, at.end, gap)
        found = self.law.traction(outside, voltage, layers) + at.slope * (outside - gap)
        if not (deeper := gap.real < self.closed).any():
            return plain(found)
        pressed = np.where(deeper, gap, self.closed)
        more = np.asarray(self.law.traction(pressed, voltage, layers))
        more = more - self.law.traction(self.closed, voltage, layers)
        return plain(found - at.slope * (self.closed - pressed) + more)

    def traction_derivative(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """dp/dg in MPa/mm."""
        at, gap = self.line(voltage, layers), np.asarray(gap)
        outer = np.asarray(traction_derivative(self.law, gap, voltage, layers))
        return plain(np.where((gap.real >= self.closed) & (gap.real < at.end), -at.slope, outer))

    def potential(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Pi in N/mm, that of the law beyond the core."""
        at, gap = self.line(voltage, layers), np.asarray(gap)
        law: Any = self.law
        inside = np.where(gap.real < at.end, at.end - np.maximum(gap, self.closed), 0.0)
        found = law.potential(np.where(gap.real < at.end, at.end, gap), voltage, layers)
        found = found - inside * (at.traction + 0.5 * at.slope * inside)
        if not (deeper := gap.real < self.closed).any():
            return plain(found)
        pressed = np.where(deeper, gap, self.closed)
        more = law.potential(pressed, voltage, layers) - law.potential(self.closed, voltage, layers)
        short = np.asarray(law.traction(self.closed, voltage, layers)) - at.closed
        return plain(found + more + short * (self.closed - pressed))

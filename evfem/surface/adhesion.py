r"""Adhesion: an attractive traction between skin and surface that depends on the gap, without a voltage.

A law gives the traction p (MPa, positive where it attracts) at a gap g, and its potential :math:`\Pi` per
area (N/mm), with :math:`p = d\Pi/dg` and :math:`\Pi = 0` far away, so that the work of adhesion is
:math:`-\Pi(0)`.

============  ====================================================  ===========================
law           p                                                     work
============  ====================================================  ===========================
`Dugdale`     stress for g < reach                                  stress reach
`Capillary`   2 gamma cos(theta) / film for g < film                2 gamma cos(theta)
============  ====================================================  ===========================

At the reach the traction drops as a cubic over a tenth of it, centred so that the work is unchanged. The
second is the Laplace pressure of a meniscus as high as the film, without evaporation or viscosity.

A law that falls faster with the gap than the mesh resolves is replaced around its steepest point by a linear
one of the same work (`Softened`), as the electrostatic law is near contact
(`evfem.electrostatics.roughness.Cored`).

Sources: D. Maugis, J. Colloid Interface Sci. 150 (1992) 243, doi:10.1016/0021-9797(92)90285-T (Dugdale's zone
in adhesion); B. N. J. Persson, A. Kovalev, S. N. Gorb, Tribol. Lett. 50 (2013) 17,
doi:10.1007/s11249-012-0053-2 (capillary bridges of a finger).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Named, Values, Within, number, to_python
from evfem.electrostatics.laws import GAP_STEP
from evfem.errors import InputError, describe_value
from evfem.protocols import AdhesionLaw
from evfem.tensor import derivative

#: width of the drop at the reach, as a fraction of the reach
EDGE = 0.1
#: sampled gaps in the search for the steepest point, bisections for the ends of the linear law, a gap (mm)
#: beyond the reach of any law
LOOKED, HALVINGS, BEYOND = 4000, 80, 1e3
#: the smallest sampled gap (mm)
NEAREST = 1e-7
#: the strength that laws of adhesion take instead of a voltage
ON = 1.0
ADHESION = "Dugdale, Capillary, or an object with traction(gap) and potential(gap); None for none"

_STRESS = number("a traction in MPa, larger than 0, up to 1e3", Within(0.0, 1e3, above=True), "MPa")
_REACH = number("a length in mm, larger than 0, up to 10", Within(0.0, 10.0, above=True), "mm")
_TENSION = number("a tension in N/m, larger than 0, up to 10", Within(0.0, 10.0, above=True), "N/m")
_ANGLE = number("an angle in degrees from 0 to below 90", Within(0.0, 90.0, below=True), "degrees")


class NamedAdhesion(Named):
    """A law with a name in scene files: a `stress` up to a `reach`, whose edge is smooth."""

    stress: float
    reach: float

    def _share(self, gap: Values) -> Any:
        """1 below the edge, 0 above, linear across it."""
        width, gap = EDGE * self.reach, np.asarray(gap)
        depth = (self.reach + 0.5 * width - gap) / width
        return np.where(depth.real > 1.0, 1.0, np.where(depth.real < 0.0, 0.0, depth))

    def traction(self, gap: Values) -> Values:
        """Attraction in MPa at gaps in mm."""
        depth = self._share(gap)
        return to_python(self.stress * depth**2 * (3.0 - 2.0 * depth))

    def traction_derivative(self, gap: Values) -> Values:
        """dp/dg in MPa/mm."""
        depth = self._share(gap)
        return to_python(-6.0 * self.stress * depth * (1.0 - depth) / (EDGE * self.reach))

    def potential(self, gap: Values) -> Values:
        """Potential in N/mm, 0 beyond the reach."""
        depth, width = self._share(gap), EDGE * self.reach
        below = np.minimum(np.asarray(gap) - (self.reach - 0.5 * width), 0.0)
        return to_python(self.stress * (below - width * depth**3 * (1.0 - 0.5 * depth)))


@dataclass(frozen=True)
class Dugdale(NamedAdhesion, kind="dugdale"):
    """A constant traction, `stress` in MPa, up to a gap, `reach` in mm.

    >>> law = Dugdale(stress=0.01, reach=0.005)
    >>> law.traction(np.array([0.0, 0.004, 0.005, 0.006])).round(12).tolist()
    [0.01, 0.01, 0.005, 0.0]
    >>> law.potential(0.0), law.potential(1.0)
    (-5e-05, 0.0)
    """

    stress: Annotated[float, _STRESS, "traction within its reach"]
    reach: Annotated[float, _REACH, "gap up to which it acts"]
    _table = "adhesion."


@dataclass(frozen=True)
class Capillary(NamedAdhesion, kind="capillary"):
    """Menisci of a liquid as high as its `film` (mm): Laplace's pressure of `surface_tension` (N/m) and
    `contact_angle` (degrees).

    >>> water = Capillary(surface_tension=0.0728, contact_angle=0.0, film=0.001)
    >>> round(water.stress, 12), round(-water.potential(0.0), 12)      # MPa, N/mm
    (0.1456, 0.0001456)
    """

    surface_tension: Annotated[float, _TENSION, "of the liquid; 0.0728 of water at 20 C"]
    contact_angle: Annotated[float, _ANGLE, "of the liquid on skin and surface"]
    film: Annotated[float, _REACH, "height of the menisci"]
    _table = "adhesion."

    @property
    def stress(self) -> float:  # type: ignore[override]
        """Laplace's pressure in MPa."""
        return 2e-3 * self.surface_tension * float(np.cos(np.radians(self.contact_angle))) / self.film

    @property
    def reach(self) -> float:  # type: ignore[override]
        """Height of the menisci in mm."""
        return self.film


ADHESIONS = NamedAdhesion.kinds


def adhesion_of(key: str, value: Any) -> Any:
    """A law of adhesion, or None; InputError for anything else."""
    if value is not None and (isinstance(value, type) or not isinstance(value, AdhesionLaw)):
        raise InputError(key, describe_value(value), ADHESION)
    return value


class Softened:
    """`law` for contact at the gap `closed` (mm), replaced by a linear law of the same work where it falls
    faster than `steepest` (MPa/mm, a number or one for each node). Its methods take a strength (`ON`) instead
    of a voltage.
    """

    def __init__(self, law: Any, closed: float, steepest: Values) -> None:
        self.law, self.closed = law, closed
        of = {float(each): _line(law, closed, float(each)) for each in np.unique(steepest)}
        each = np.vectorize(lambda one: of[one], otypes=[float, float])
        #: gaps (mm) between which the linear law is used; equal where the law itself is resolved
        self.begin, self.end = each(np.asarray(steepest, dtype=float))
        self.slope = np.where(self.end > self.begin, steepest, 0.0)

    @property
    def _at_end(self) -> Floats:
        return np.asarray(self.law.traction(self.end))

    @property
    def short(self) -> Floats:
        """By how much (MPa) the line's traction on closed faces falls short of the law's."""
        line = self._at_end + self.slope * (self.end - self.closed)
        short = np.asarray(self.law.traction(self.closed)) - line
        return np.where((self.begin > self.closed) | (self.slope == 0.0), 0.0, short)

    def traction(self, gap: Values, voltage: Values = ON, layers: Any = None) -> Values:
        """Attraction in MPa at gaps in mm."""
        gap = np.asarray(gap)
        found = np.asarray(self.law.traction(gap))
        inside = (gap.real >= self.begin) & (gap.real < self.end)
        found = np.where(inside, self._at_end + self.slope * (self.end - gap), found)
        found = np.where(gap.real < self.closed, found - self.short, found)
        return to_python(np.asarray(voltage) ** 2 * found)

    def traction_derivative(self, gap: Values, voltage: Values = ON, layers: Any = None) -> Values:
        """dp/dg in MPa/mm."""
        gap = np.asarray(gap)
        inside = (gap.real >= self.begin) & (gap.real < self.end)
        return to_python(np.asarray(voltage) ** 2 * np.where(inside, -self.slope, _derivative(self.law, gap)))

    def potential(self, gap: Values, voltage: Values = ON, layers: Any = None) -> Values:
        """Potential in N/mm, 0 far away."""
        gap, law = np.asarray(gap), self.law
        found, distance = np.asarray(law.potential(gap)), self.end - np.maximum(gap, self.begin)
        line = law.potential(self.end) - distance * (self._at_end + 0.5 * self.slope * distance)
        deeper = line + found - law.potential(self.begin) - self.short * (gap - self.begin)
        found = np.where(gap.real >= self.end, found, np.where(gap.real >= self.begin, line, deeper))
        return to_python(np.asarray(voltage) ** 2 * found)

    def withheld(self, voltage: Values = ON, layers: Any = None) -> tuple[Floats, Floats]:
        """What the line withholds of the traction of closed faces, and leaves (MPa)."""
        return self.short, np.asarray(self.law.traction(self.closed)) - self.short


def _derivative(law: Any, gap: Any) -> Any:
    own = getattr(law, "traction_derivative", None)
    return np.asarray(derivative(law.traction, gap, GAP_STEP) if own is None else own(gap))


def _line(law: Any, closed: float, steepest: float) -> tuple[float, float]:
    """Gaps (mm) between which a linear law of slope `steepest` (MPa/mm) and equal work replaces the law."""
    gaps = closed + np.append(0.0, np.geomspace(NEAREST, BEYOND, LOOKED))
    slope, traction = -_derivative(law, gaps), np.asarray(law.traction(gaps))
    if slope.max() <= steepest:
        return closed, closed
    low, high = float(gaps[int(np.argmax(slope))]) - closed, BEYOND
    for _ in range(HALVINGS):
        middle = closed + (np.sqrt(max(low, NEAREST) * high) if high > 2.0 * low else 0.5 * (low + high))
        begin, end = _begin(law, middle, steepest, gaps, traction), float(law.traction(middle))
        work, distance = float(law.potential(middle)) - float(law.potential(begin)), middle - begin
        if work > distance * (end + 0.5 * steepest * distance):
            low = middle - closed
        else:
            high = middle - closed
    return _begin(law, closed + high, steepest, gaps, traction), closed + high


def _begin(law: Any, end: float, steepest: float, gaps: Floats, traction: Floats) -> float:
    """Where a line that ends at a gap (mm) comes to the law (`traction` at `gaps`), or closed faces."""
    last = float(law.traction(end))
    above = np.flatnonzero((traction > last + steepest * (end - gaps)) & (gaps < end))
    if not above.size or above[0] == 0:
        return float(gaps[0]) if above.size else end
    low, high = gaps[above[0] - 1], gaps[above[0]]
    for _ in range(HALVINGS // 2):
        middle = 0.5 * (low + high)
        over = float(law.traction(middle)) > last + steepest * (end - middle)
        low, high = (low, middle) if over else (middle, high)
    return float(low)

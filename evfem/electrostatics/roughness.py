r"""What a force law becomes on faces that touch: rough ones keep a gap, a core keeps its steepest part.

**Rough faces** keep an air gap between them, in series with the solid layers.

Skin and glass touch at their highest asperities; the mean separation s of their mean planes falls as the
contact pressure p grows. A force law then sees the gap g + s (`evfem.terms.attraction`). Without it a node
that touches an insulator of 1 um at 100 V is pulled by some 190 kPa, which no finger shows.

==========================  ============================  ==========================================
law                         s above p_c                   source
==========================  ============================  ==========================================
`ConstantRoughness`         gap
`PowerRoughness`            gap (p / pressure)^-exponent  Guo et al., doi:10.1109/TOH.2019.2897768
`ExponentialRoughness`      decay ln(pressure / p)        Persson, doi:10.1103/PhysRevLett.99.125502
`TableRoughness`            rows; of a scan or spectrum   the same (`evfem.electrostatics.persson`)
==========================  ============================  ==========================================

The falling laws grow without bound as the load vanishes, while faces that just touch are apart by
no more than their highest asperities, `open_gap`: also the separation of nodes that are still open.
Below the pressure p_c the tangent of the law at p_c therefore takes its place, with p_c such that
it reaches `open_gap` at p = 0. Every law has a continuous derivative, and all but tables are convex.
Where Persson's law ends, at p = `pressure`, contact is complete and s = 0.

A part of one's own needs `separation(pressure)` (`evfem.protocols.RoughnessLaw`). Units: mm, MPa.

With a `distribution` these are means of local gaps, and the attraction sees another one
(`evfem.electrostatics.localgaps`).

**A linear core** of a force law (`Cored`): below a gap a straight line of the same work takes its place.

Where the traction falls faster than the mesh resolves, the work of adhesion counts, not the strength [1]_
[2]_ (docs, Theory, a strong attraction on a mesh, has the equations). No law of the same work that is nowhere
steeper and differs from p only below a gap differs from it less far. For given slope m, :math:`h^*` is the
only root, found by Newton's method between bounds; it depends on the voltage, and is nothing where the law is
not steeper than m. Below :math:`g_0`, where pressed rough faces come closer, the traction grows as the law's
does.

.. [1] K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324 (1971) 301,
   doi:10.1098/rspa.1971.0141.
.. [2] A. Turon, C. G. Davila, P. P. Camanho, J. Costa, Eng. Fract. Mech. 74 (2007) 1665,
   doi:10.1016/j.engfracmech.2006.08.025 (strength lowered, work kept).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import (
    Checked,
    Values,
    Within,
    among,
    check_fields,
    choice,
    number,
    real,
    several,
    to_python,
)
from evfem.electrostatics import persson
from evfem.electrostatics.laws import traction_derivative
from evfem.errors import InputError
from evfem.protocols import ForceLaw, RoughnessLaw
from evfem.tensor import derivative

#: step of differences of a law by its pressure (MPa)
PRESSURE_STEP = 1e-7
WIDEST = 1.0
_GAP = number(f"a length in mm from 0 to {WIDEST:g}", Within(0.0, WIDEST), "mm")
_OPEN = number(f"a length in mm, larger than 0, up to {WIDEST:g}", Within(0.0, WIDEST, above=True), "mm")
_PRESSURE = number("a pressure in MPa, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "MPa")
_EXPONENT = number("an exponent, larger than 0, up to 10", Within(0.0, 10.0, above=True))
OpenGap = Annotated[float, _OPEN, "at no pressure, where the law itself has no bound"]
#: rows of a table: what its lists may be
_LOADS, _FALLING = "pressures in MPa that grow from 0, two to 1000", "as many lengths in mm that do not grow"
_LOADED = several(_LOADS, Within(0.0, 1e6), "MPa") | {"type": list[float]}
_APART = several(_FALLING, Within(0.0, WIDEST), "mm") | {"type": list[float]}
MOST_ROWS = 1000
#: distributions of local gaps; without one all are the mean gap
NONE, DISTRIBUTIONS = "none", ("exponential", "gaussian")
Distribution = Annotated[str, among((NONE, *DISTRIBUTIONS)), "of the local gaps around their mean"]


@dataclass(frozen=True)
class ConstantRoughness(Checked):
    """The same separation whatever the pressure.

    >>> ConstantRoughness(0.001).separation(np.array([0.0, 0.02])).tolist()
    [0.001, 0.001]
    """

    gap: Annotated[float, _GAP, "at every pressure"]
    distribution: Distribution = NONE
    law = "constant"

    def separation(self, pressure: Values) -> Values:
        """Separation in mm at contact pressures in MPa."""
        return to_python(np.full(np.shape(pressure), self.gap))


@dataclass(frozen=True)
class PowerRoughness(Checked):
    """The separation falls with the power -`exponent` of the contact pressure, from `open_gap` at none.

    >>> law = PowerRoughness(gap=0.001, pressure=0.01, exponent=0.5, open_gap=0.006)
    >>> law.separation(np.array([0.0, 0.01, 0.04])).tolist()
    [0.006, 0.001, 0.0005]
    """

    gap: Annotated[float, _OPEN, "at that pressure"]
    pressure: Annotated[float, _PRESSURE, "contact pressure of that gap"]
    exponent: Annotated[float, _EXPONENT, "gap (p / pressure)^-exponent"]
    open_gap: OpenGap
    distribution: Distribution = NONE
    law = "power"

    @property
    def _tangent(self) -> tuple[float, float]:
        """Pressure p_c below which the tangent holds, and the separation there."""
        at = self.open_gap / (1.0 + self.exponent)
        return self.pressure * (self.gap / at) ** (1.0 / self.exponent), at

    def separation(self, pressure: Values) -> Values:
        """Separation in mm at contact pressures in MPa."""
        p, (least, at) = np.asarray(pressure), self._tangent
        law = self.gap * (np.where(p.real > least, p, least) / self.pressure) ** -self.exponent
        return to_python(np.where(p.real > least, law, self.open_gap - self.exponent * at * p / least))


@dataclass(frozen=True)
class ExponentialRoughness:
    """The separation falls by `decay` for every factor e of the contact pressure, from `open_gap` at none to
    nothing at `pressure`: Persson's u0 and beta E*.

    >>> law = ExponentialRoughness(decay=0.001, pressure=1.0, open_gap=0.008)
    >>> law.separation(np.array([0.0, np.exp(-2.0), 2.0])).round(12).tolist()
    [0.008, 0.002, 0.0]
    """

    decay: Annotated[float, _OPEN, "by which it falls for every factor e of the pressure"]
    pressure: Annotated[float, _PRESSURE, "contact pressure of full contact"]
    open_gap: OpenGap
    distribution: Distribution = NONE
    law = "exponential"

    def __post_init__(self) -> None:
        check_fields(self)
        if self.open_gap <= self.decay:
            raise InputError("open_gap", self.open_gap, f"a length above decay, {self.decay:g} mm")

    @property
    def _least(self) -> float:
        """Pressure p_c below which the tangent holds."""
        return float(self.pressure * np.exp(1.0 - self.open_gap / self.decay))

    def separation(self, pressure: Values) -> Values:
        """Separation in mm at contact pressures in MPa."""
        p, least = np.asarray(pressure), self._least
        inside = np.where(p.real < self.pressure, p, self.pressure)
        law = self.decay * np.log(self.pressure / np.where(p.real > least, inside, least))
        return to_python(np.where(p.real > least, law, self.open_gap - self.decay * p / least))


@dataclass(frozen=True)
class TableRoughness:
    """The separation at contact pressures, from none on; monotone cubics between the rows, level beyond them.

    `from_map` and `from_spectrum` make the rows of measured roughness.

    >>> law = TableRoughness(pressure=[0.0, 0.01, 0.1], gap=[0.004, 0.002, 0.001])
    >>> law.separation(np.array([0.0, 0.01, 0.5])).round(12).tolist()
    [0.004, 0.002, 0.001]
    """

    pressure: Annotated[Sequence[float], _LOADED, "of the rows"]
    gap: Annotated[Sequence[float], _APART, "separation of the rows"]
    distribution: Distribution = NONE
    law = "table"

    def __post_init__(self) -> None:
        check_fields(self)
        if not 2 <= len(self.pressure) <= MOST_ROWS or self.pressure[0] != 0.0:
            raise InputError("pressure", f"{len(self.pressure)} from {self.pressure[:1]}", _LOADS)
        if np.any(np.diff(self.pressure) <= 0.0):
            raise InputError("pressure", "pressures that do not grow", _LOADS)
        if len(self.gap) != len(self.pressure) or np.any(np.diff(self.gap) > 0.0):
            raise InputError("gap", f"{len(self.gap)} for {len(self.pressure)} pressures", _FALLING)

    @classmethod
    def from_map(
        cls, heights: Any, pixel: float, modulus: float, *, periodic: bool = False, **more: Any
    ) -> TableRoughness:
        """That of scanned heights (m, n) in mm on squares of `pixel` (mm), pressed against a soft plane of
        the `modulus` E* = E / (1 - nu^2) in MPa, by Persson's theory (`evfem.electrostatics.persson`).

        Open faces are apart by the `open_gap` (mm), that of the highest summit above the mean plane unless
        given; the `distribution` is gaussian. A map that is not `periodic` is levelled and windowed.
        Raises InputError for what is no such map.
        """
        return cls._of_waves(persson.waves_of_map(heights, pixel, periodic), modulus, **more)

    @classmethod
    def from_spectrum(cls, q: Any, C: Any, modulus: float, **more: Any) -> TableRoughness:
        """That of roughness with the isotropic spectrum C (n,) in mm^4, <h^2> = 2 pi int q C dq, at wave
        numbers q (n,) in 1/mm, 2 pi over the wavelength; as `from_map`, with three rms heights as `open_gap`.
        """
        return cls._of_waves(persson.waves_of_spectrum(q, C), modulus, **more)

    @classmethod
    def _of_waves(
        cls,
        waves: persson.Waves,
        modulus: float,
        open_gap: float | None = None,
        distribution: str = "gaussian",
    ) -> TableRoughness:
        return cls(*persson.rows(waves, modulus, open_gap), distribution)

    @cached_property
    def _cubics(self) -> Floats:
        """Coefficients (4, n) of the cubics from each row on, with 0 for the last."""
        from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

        slopes = PchipInterpolator(self.pressure, self.gap).derivative()(self.pressure)
        slopes[-1] = 0.0
        found = CubicHermiteSpline(self.pressure, self.gap, slopes).c
        return np.column_stack([found, [0.0, 0.0, 0.0, self.gap[-1]]])

    def _at(self, pressure: Values) -> tuple[Values, Floats]:
        """How far pressures are beyond their rows, and the cubics there."""
        p = np.asarray(pressure)
        row = np.clip(np.searchsorted(self.pressure, p.real, side="right") - 1, 0, None)
        return np.where(p.real > 0.0, p - np.asarray(self.pressure)[row], p - p.real), self._cubics[:, row]

    def separation(self, pressure: Values) -> Values:
        """Separation in mm at contact pressures in MPa."""
        d, (a, b, c, row) = self._at(pressure)
        return to_python(((a * d + b) * d + c) * d + row)

    def separation_derivative(self, pressure: Values) -> Values:
        """Its derivative in mm/MPa."""
        d, (a, b, c, _) = self._at(pressure)
        return to_python((3.0 * a * d + 2.0 * b) * d + c)


LAWS = {cls.law: cls for cls in (ConstantRoughness, PowerRoughness, ExponentialRoughness, TableRoughness)}
ALLOWED = f"a length in mm from 0 to {WIDEST:g}, a table with a law, or an object with separation(pressure)"


def roughness_of(given: Any, key: str = "roughness_gap") -> RoughnessLaw | None:
    """The law of a scene: a length (mm) is that of constant roughness, 0 none at all.

    >>> roughness_of(0.0), roughness_of(0.001)
    (None, ConstantRoughness(gap=0.001, distribution='none'))
    """
    if isinstance(given, type) and hasattr(given, "separation"):
        raise InputError(key, f"the class {given.__name__}", "an object of it")
    if isinstance(given, RoughnessLaw):
        return given
    gap = _length(key, given)
    return ConstantRoughness(gap) if gap != 0.0 else None


def _length(key: str, given: Any) -> float:
    return real(key, given, ALLOWED, Within(0.0, WIDEST), "mm")


def distribution_of(given: Any, key: str = "roughness_gap") -> str:
    """How the local gaps of a scene's roughness are distributed; without a law all are the mean.

    >>> distribution_of(0.001), distribution_of(ConstantRoughness(0.001, "gaussian"))
    ('none', 'gaussian')
    """
    return choice(f"{key}.distribution", getattr(given, "distribution", NONE), (NONE, *DISTRIBUTIONS))


def _gap(key: str, given: Any) -> Any:
    distribution_of(given, key)
    return given if roughness_of(given, key) is given else _length(key, given)


RoughnessGap = Annotated[
    float | RoughnessLaw,
    {
        "allowed": ALLOWED,
        "check": _gap,
        "type": float | dict,
        "kinds": lambda: LAWS,
        "tag": "law",
        "unit": "mm",
    },
    "what rough skin keeps between itself and the insulator in contact",
]


def separation_derivative(law: RoughnessLaw, pressure: Values) -> Values:
    """ds/dp in mm/MPa of any law: its own, a complex step, or a difference over `PRESSURE_STEP`."""
    own = getattr(law, "separation_derivative", None)
    if own is not None:
        return own(pressure)
    return to_python(derivative(law.separation, np.asarray(pressure), PRESSURE_STEP))


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
    """`law` with a core no steeper than `steepest` (MPa/mm), or of `length` (mm), shut at `closed` (mm)."""

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
            return to_python(found)
        pressed = np.where(deeper, gap, self.closed)
        more = np.asarray(self.law.traction(pressed, voltage, layers))
        more = more - self.law.traction(self.closed, voltage, layers)
        return to_python(found - at.slope * (self.closed - pressed) + more)

    def traction_derivative(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """dp/dg in MPa/mm."""
        at, gap = self.line(voltage, layers), np.asarray(gap)
        outer = np.asarray(traction_derivative(self.law, gap, voltage, layers))
        return to_python(np.where((gap.real >= self.closed) & (gap.real < at.end), -at.slope, outer))

    def potential(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Pi in N/mm, that of the law beyond the core."""
        at, gap = self.line(voltage, layers), np.asarray(gap)
        law: Any = self.law
        inside = np.where(gap.real < at.end, at.end - np.maximum(gap, self.closed), 0.0)
        found = law.potential(np.where(gap.real < at.end, at.end, gap), voltage, layers)
        found = found - inside * (at.traction + 0.5 * at.slope * inside)
        if not (deeper := gap.real < self.closed).any():
            return to_python(found)
        pressed = np.where(deeper, gap, self.closed)
        more = law.potential(pressed, voltage, layers) - law.potential(self.closed, voltage, layers)
        short = np.asarray(law.traction(self.closed, voltage, layers)) - at.closed
        return to_python(found + more + short * (self.closed - pressed))

r"""What rough faces keep between them where they touch: an air gap in series with the solid layers.

Skin and glass touch at their highest asperities; the mean separation s of their mean planes falls
as the contact pressure p grows. A force law then sees the gap g + s (`evfem.contact.attraction`).
Without it a node that touches an insulator of 1 um at 100 V is pulled by some 80 kPa, which no
finger shows.

==========================  ============================  ==========================================
law                         s above p_c                   source
==========================  ============================  ==========================================
`ConstantRoughness`         gap
`PowerRoughness`            gap (p / pressure)^-exponent  Guo et al., doi:10.1109/TOH.2019.2897768
`ExponentialRoughness`      decay ln(pressure / p)        Persson, doi:10.1103/PhysRevLett.99.125502
==========================  ============================  ==========================================

Both falling laws grow without bound as the load vanishes, while faces that just touch are apart by
no more than their highest asperities, `open_gap`: also the separation of nodes that are still open.
Below the pressure p_c the tangent of the law at p_c therefore takes its place, with p_c such that
it reaches `open_gap` at p = 0. Every law is convex and has a continuous derivative. Where Persson's
law ends, at p = `pressure`, contact is complete and s = 0.

A part of one's own needs `separation(pressure)` (`evfem.protocols.RoughnessLaw`). Units: mm, MPa.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evfem.common.checks import Checked, Values, Within, check_fields, number, plain, real
from evfem.errors import InputError
from evfem.protocols import RoughnessLaw
from evfem.tensor import derivative

#: step of differences of a law by its pressure (MPa)
PRESSURE_STEP = 1e-7
WIDEST = 1.0
_GAP = number(f"a length in mm from 0 to {WIDEST:g}", Within(0.0, WIDEST), "mm")
_OPEN = number(f"a length in mm, larger than 0, up to {WIDEST:g}", Within(0.0, WIDEST, above=True), "mm")
_PRESSURE = number("a pressure in MPa, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "MPa")
_EXPONENT = number("an exponent, larger than 0, up to 10", Within(0.0, 10.0, above=True))
OpenGap = Annotated[float, _OPEN, "at no pressure, where the law itself has no bound"]


@dataclass(frozen=True)
class ConstantRoughness(Checked):
    """The same separation whatever the pressure.

    >>> ConstantRoughness(0.001).separation(np.array([0.0, 0.02])).tolist()
    [0.001, 0.001]
    """

    gap: Annotated[float, _GAP, "at every pressure"]
    law = "constant"

    def separation(self, pressure: Values) -> Values:
        """Separation in mm at contact pressures in MPa."""
        return plain(np.full(np.shape(pressure), self.gap))

    def separation_derivative(self, pressure: Values) -> Values:
        """ds/dp in mm/MPa."""
        return plain(np.zeros(np.shape(pressure)))


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
        return plain(np.where(p.real > least, law, self.open_gap - self.exponent * at * p / least))

    def separation_derivative(self, pressure: Values) -> Values:
        """ds/dp in mm/MPa."""
        p, (least, _) = np.asarray(pressure), self._tangent
        within = np.maximum(p, least)
        return plain(-self.exponent * self.gap * (within / self.pressure) ** -self.exponent / within)


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
        return plain(np.where(p.real > least, law, self.open_gap - self.decay * p / least))

    def separation_derivative(self, pressure: Values) -> Values:
        """ds/dp in mm/MPa."""
        p = np.asarray(pressure)
        return plain(np.where(p < self.pressure, -self.decay / np.maximum(p, self._least), 0.0))


LAWS = {cls.law: cls for cls in (ConstantRoughness, PowerRoughness, ExponentialRoughness)}
ALLOWED = f"a length in mm from 0 to {WIDEST:g}, a table with a law, or an object with separation(pressure)"


def roughness_of(given: Any, key: str = "roughness_gap") -> RoughnessLaw | None:
    """The law of a scene: a length (mm) is that of constant roughness, 0 none at all.

    >>> roughness_of(0.0), roughness_of(0.001)
    (None, ConstantRoughness(gap=0.001))
    """
    if isinstance(given, type) and hasattr(given, "separation"):
        raise InputError(key, f"the class {given.__name__}", "an object of it")
    if isinstance(given, RoughnessLaw):
        return given
    gap = real(key, given, ALLOWED, Within(0.0, WIDEST))
    return ConstantRoughness(gap) if gap != 0.0 else None


def _gap(key: str, given: Any) -> Any:
    return given if roughness_of(given, key) is given else float(given)


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
    """ds/dp in mm/MPa of any law: its own, else a complex step on `separation`, or a difference
    over `PRESSURE_STEP`.
    """
    own = getattr(law, "separation_derivative", None)
    if own is not None:
        return own(pressure)
    return plain(derivative(law.separation, np.asarray(pressure), PRESSURE_STEP))

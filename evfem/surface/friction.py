r"""Friction that depends on more than the place: the largest shear traction of a node.

Coulomb's bound is :math:`\mu(x)\,p`, with the contact pressure p of the node and the coefficient of
the surface at its place. A law replaces it by :math:`\tau(p, \mu, v, t)`, with the speed v at which
the node slips and the time t since it touched; a node sticks up to :math:`\tau(p, \mu, 0, t)`.

====================  ==================================================================  ===========
law                   tau                                                                 kind
====================  ==================================================================  ===========
`Coulomb`             mu p                                                                coulomb
`LoadIndexFriction`   mu p (p / pressure)^(index - 1)                                     load_index
`AdhesiveFriction`    strength min(1, p / full) + mu p                                    adhesive
`RateFriction`        mu p (ratio + (1 - ratio) exp(-v / speed)) (v / speed)^exponent     rate
`AgeingFriction`      mu p (1 - (1 - fresh) exp(-t / time))                               ageing
`SlipMemory`          follows one of these over a length of slip                          slip_memory
====================  ==================================================================  ===========

`SlipMemory` remembers the bound :math:`S` of every node. It follows that of the law in it, its equilibrium
:math:`S_e`, over a length L of slip, and a time T where that is finite,

.. math:: \dot S = (|v|/L + 1/T)(S_e - S), \qquad S_1 = S_e + (S_0 - S_e)\,e^{-\Delta s/L - \Delta t/T},

the second in a step that slips by :math:`\Delta s`, with the equilibrium of its end: exact while that stays,
stable at any step, and the law itself where L vanishes. A node that is open has S = 0.

`Linearised` is what the active set needs of a law at an iterate: per node the bound's derivative by
the contact force, b', and what is left of it at no force, c, so that a slipping node carries
:math:`\lambda_t = \mp(b'\lambda_n + c)`; its derivative by the slip of a time step, and by the place.
Where the tangent would be negative without a load (a law that grows faster than the load), the
chord from there takes its place.

Sources: skin on smooth glass, load and ageing: doi:10.1098/rsif.2016.0935,
doi:10.1073/pnas.1706233114 (the real area saturates within 20 s, taken as 95 %). Friction under a modulated
voltage of first order, with a cut-off of 13.8 Hz per mm/s of speed: arXiv:2505.11162; read as a length it is
1/(2 pi 13.8) mm = 11.5 um. Units: mm, MPa, s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Named, Values, Within, number, real, to_python
from evfem.protocols import FrictionLaw
from evfem.tensor import derivative

#: share of a law's own pressure and speed below which its power stays as it is, unless it is given: where
#: friction rises without bound as the load vanishes, nodes at the edge of contact would wedge
LOWEST = 0.01
#: contact pressure from which on all that a core withholds counts, as a share of the core's own traction
FULL = 0.05
#: largest shear traction over the pressure of a node whose bound lags: one that opens would else be pulled
#: along by a shear that neither an open nor a closed node has
STEEPEST = 20.0
#: steps of differences of a law that drops imaginary parts: in MPa, of a coefficient, in mm/s
PRESSURE_STEP, COEFFICIENT_STEP, SPEED_STEP = 1e-7, 1e-6, 1e-5
_PRESSURE = number("a pressure in MPa, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "MPa")
_SPEED = number("a speed in mm/s, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "mm/s")
_SHARE = number("a fraction from 0 to 1", Within(0.0, 1.0))
_INDEX = number("an exponent from 0.1 to 3", Within(0.1, 3.0))
_RATIO = number("a ratio from 0 to 100", Within(0.0, 100.0))
_EXPONENT = number("an exponent from -2 to 2", Within(-2.0, 2.0))
_TIME = number("a time in s, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "s")
_SLIP = number("a length in mm, larger than 0, up to 1000", Within(0.0, 1e3, above=True), "mm")
_COEFFICIENT = Within(0.0)
_INNER = "a coefficient, not negative, or a law of friction without a memory"
_AT_REST = "a time in s, larger than 0, up to 1e6, or inf"


class NamedFriction(Named):
    """A law with a name in scene files."""


@dataclass(frozen=True)
class Coulomb(NamedFriction, kind="coulomb"):
    """Coulomb's law, which a scene has without any; its coefficient is the `friction` of the surface.

    >>> Coulomb().bound(0.01, 0.3, 5.0, 0.0)
    0.003
    """

    timed = False

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa."""
        return mu * pressure


@dataclass(frozen=True)
class LoadIndexFriction(NamedFriction, kind="load_index"):
    """The force grows with a power of the load; the coefficient is that of the surface at one pressure.

    >>> law = LoadIndexFriction(pressure=0.01, index=0.7)
    >>> round(float(law.bound(0.02, 0.3, 0.0, 0.0) / law.bound(0.01, 0.3, 0.0, 0.0)), 12) == round(2**0.7, 12)
    True
    """

    pressure: Annotated[float, _PRESSURE, "contact pressure at which the coefficient is that of the surface"]
    index: Annotated[float, _INDEX, "the force grows with this power of the load"]
    lowest: Annotated[
        float | None, _PRESSURE, "below it the coefficient stays; without it a hundredth of the pressure"
    ] = None
    timed = False

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa."""
        lowest = LOWEST * self.pressure if self.lowest is None else self.lowest
        return to_python(mu * pressure * (_at_least(pressure, lowest) / self.pressure) ** (self.index - 1.0))


@dataclass(frozen=True)
class AdhesiveFriction(NamedFriction, kind="adhesive"):
    """Every place in real contact resists with a shear strength besides mu p; contact grows in proportion to
    the pressure until it is complete.

    >>> AdhesiveFriction(strength=0.004).bound(np.array([0.002, 0.01]), 0.3, 0.0, 0.0).tolist()
    [0.0026, 0.007]
    """

    strength: Annotated[float, _PRESSURE, "shear strength of the real contact, added to mu p"]
    full: Annotated[
        float | None, _PRESSURE, "contact pressure at which real contact is complete; without it the strength"
    ] = None
    timed = False

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa."""
        share = np.asarray(pressure) / (self.strength if self.full is None else self.full)
        return to_python(self.strength * np.where(share.real < 1.0, share, 1.0) + mu * pressure)


@dataclass(frozen=True)
class RateFriction(NamedFriction, kind="rate"):
    """Friction of sliding: it falls from mu to `ratio` mu around `speed`, and goes with a power of the speed.

    >>> stribeck = RateFriction(speed=5.0, ratio=0.5)
    >>> stribeck.bound(0.01, 0.4, np.array([0.0, 1e9]), 0.0).tolist()
    [0.004, 0.002]
    >>> power = RateFriction(speed=10.0, exponent=0.5)
    >>> power.bound(0.01, 0.4, np.array([10.0, 40.0]), 0.0).tolist()
    [0.004, 0.008]
    """

    speed: Annotated[float, _SPEED, "at which friction of sliding differs from that of sticking"]
    ratio: Annotated[float, _RATIO, "friction of fast sliding over that of sticking"] = 1.0
    exponent: Annotated[float, _EXPONENT, "friction goes with this power of speed over that speed"] = 0.0
    slowest: Annotated[
        float | None, _SPEED, "below it that power stays; without it a hundredth of the speed"
    ] = None
    timed = True

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa."""
        slowest = LOWEST * self.speed if self.slowest is None else self.slowest
        stribeck = self.ratio + (1.0 - self.ratio) * np.exp(-np.asarray(speed) / self.speed)
        power = (_at_least(speed, slowest) / self.speed) ** self.exponent
        return to_python(mu * pressure * stribeck * power)


@dataclass(frozen=True)
class AgeingFriction(NamedFriction, kind="ageing"):
    """A place that has just touched resists with a share of mu p; the rest comes with its real area of
    contact, of first order with the time, sliding or not.

    >>> law = AgeingFriction(fresh=0.2, time=6.7)
    >>> law.bound(0.01, 0.5, 0.0, np.array([0.0, 20.0])).round(5).tolist()
    [0.001, 0.0048]
    """

    fresh: Annotated[float, _SHARE, "fraction of its friction that a node has when it touches"]
    time: Annotated[float, _TIME, "time constant of the rest"] = 6.7
    timed = True

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa."""
        return to_python(mu * pressure * (1.0 - (1.0 - self.fresh) * np.exp(-np.asarray(age) / self.time)))


def _inner(key: str, value: Any) -> Any:
    """A coefficient as a float, or a law without a memory of its own."""
    if isinstance(value, (SlipMemory, type)) or not isinstance(value, FrictionLaw):
        return real(key, value, _INNER, _COEFFICIENT)
    return value


def _at_rest(key: str, value: Any) -> float:
    endless = isinstance(value, float) and value == math.inf
    return math.inf if endless else real(key, value, _AT_REST, _TIME["test"])


_INNER_LAW = {"allowed": _INNER, "check": _inner, "type": float | dict, "kinds": lambda: NamedFriction.kinds}
_REST = {"allowed": _AT_REST, "check": _at_rest, "test": Within(0.0, above=True), "unit": "s"}


@dataclass(frozen=True)
class SlipMemory(NamedFriction, kind="slip_memory"):
    """Friction that slip renews: the bound of a node follows what `friction` gives, over a length of its
    slip, and a time where that is finite. `bound` is the equilibrium; `Renewing` has what a step ends with.

    >>> law = SlipMemory(0.5)
    >>> law.bound(0.01, 0.3, 5.0, 0.0), law.timed
    (0.005, False)
    """

    friction: Annotated[
        Any,
        _INNER_LAW,
        "what it follows: a law, or a coefficient instead of the surface's",
    ]
    length: Annotated[float, _SLIP, "of slip over which friction follows"] = 0.0115
    time: Annotated[
        float,
        _REST,
        "over which it follows at rest; inf: at rest it stays",
    ] = math.inf

    @property
    def timed(self) -> bool:
        """Whether it depends on speed or time."""
        return self.time < math.inf or bool(getattr(self.friction, "timed", False))

    def bound(self, pressure: Values, mu: Values, speed: Values, age: Values) -> Values:
        """Largest shear traction in MPa after a long slip."""
        if isinstance(self.friction, float):
            return self.friction * pressure
        return self.friction.bound(pressure, mu, speed, age)


KINDS = NamedFriction.kinds


def with_core(pressure: Floats, withheld: Values, left: Values) -> Floats:
    """Pressure (MPa) that a core takes from nodes under `pressure`; all of it from the fraction `FULL` on."""
    return np.asarray(withheld * np.clip(pressure / (FULL * np.asarray(left)), 0.0, 1.0))


def _at_least(value: Values, least: float) -> Any:
    """The value, or `least` where it is below."""
    value = np.asarray(value)
    return np.where(value.real > least, value, least)


@dataclass(frozen=True)
class Slipping:
    """Arguments of a law at k nodes: contact forces (k,) in N/mm, tributary lengths (k,) in mm,
    coefficients of the surface (k,), speeds (k,) in mm/s and ages (k,) in s. Of the pressure that a core
    of the attraction withholds (`Attraction.restored`), `withheld` and `left` (k,) in MPa.
    """

    normal: Floats
    length: Floats
    mu: Floats
    speed: Floats
    age: Floats
    withheld: Floats | float = 0.0
    left: Floats | float = 1.0

    @property
    def pressure(self) -> Floats:
        """Contact pressure (k,) in MPa, with what a core withholds."""
        p = np.maximum(self.normal, 0.0) / self.length
        return p + with_core(p, self.withheld, self.left)

    @property
    def _at(self) -> dict[str, Floats]:
        return {"pressure": self.pressure, "mu": self.mu, "speed": self.speed, "age": self.age}

    def bound(self, law: FrictionLaw) -> Floats:
        """Largest shear forces (k,) in N/mm."""
        return np.asarray(law.bound(**self._at) * self.length)

    def resistance(self, law: FrictionLaw) -> Floats:
        """The same in the mean over the slip of a step, (k,)."""
        return self.bound(law)

    def capped(self, law: FrictionLaw) -> Any:
        """Whether nodes (k,) are at a bound that is proportional to the pressure instead of the law's."""
        return np.zeros(self.normal.shape, dtype=bool)

    def linearised(self, law: FrictionLaw) -> Linearised:
        """Derivatives by contact force, speed and coefficient."""
        normal = np.maximum(self.normal, 0.0)
        force = self.bound(law)
        slope = self._derivative(law, "pressure") * self._growth
        offset = force - slope * normal
        over = offset < 0.0
        slope = np.where(over, force / np.where(over, normal, 1.0), slope)
        by_speed = self._derivative(law, "speed") * self.length
        by_mu = self._derivative(law, "mu") * self.length
        return Linearised(slope, np.where(over, 0.0, offset), by_speed, by_mu)

    @property
    def _growth(self) -> Floats | float:
        """Derivative of the pressure by what the contact force alone makes of it."""
        full = FULL * np.asarray(self.left)
        rising = np.maximum(self.normal, 0.0) / self.length < full
        return 1.0 + np.where(rising, self.withheld / full, 0.0)

    def chord(self, law: FrictionLaw) -> Floats:
        """Growth of the largest shear forces from rest to their speeds, (k,) in N/mm per mm/s."""
        moving = self.speed > 0.0
        growth = self.bound(law) - replace(self, speed=np.zeros_like(self.speed)).bound(law)
        return np.where(moving, growth / np.where(moving, self.speed, 1.0), 0.0)

    def _derivative(self, law: FrictionLaw, by: Literal["pressure", "mu", "speed"]) -> Floats:
        at = self._at
        step = {"pressure": PRESSURE_STEP, "mu": COEFFICIENT_STEP, "speed": SPEED_STEP}[by]
        found = derivative(lambda value: law.bound(**(at | {by: value})), at[by], step)
        return np.broadcast_to(np.asarray(found, dtype=float), self.normal.shape)


@dataclass(frozen=True)
class Renewing(Slipping):
    """The same of nodes under a `SlipMemory`, which began a step of so many `seconds` with the bounds
    `before` (k,) in MPa. Without time the speed is the slip in mm over 1 s, and the law in it is at rest.
    """

    before: Floats = field(default_factory=lambda: np.zeros(0))
    seconds: float = 0.0

    @property
    def _at(self) -> dict[str, Floats]:
        return super()._at | ({} if self.seconds > 0.0 else {"speed": np.zeros_like(self.speed)})

    @property
    def unit(self) -> float:
        """Seconds by which slips are divided."""
        return self.seconds or 1.0

    def _passed(self, law: Any) -> Floats:
        """Slip over length plus time over time, (k,)."""
        return np.asarray(self.speed * self.unit / law.length + self.seconds / law.time)

    def renewed(self, law: Any) -> Floats:
        """Bounds (k,) in MPa at the end of the step."""
        there = law.bound(**self._at)
        return np.asarray(there + (self.before - there) * np.exp(-self._passed(law)))

    def _borne(self, bound: Floats) -> Floats:
        """What nodes resist with of a bound (k,) in MPa: where the pressure has almost gone, less."""
        most = STEEPEST * self.pressure
        return np.asarray(np.where(np.real(bound) < np.real(most), bound, most) * self.length)

    def bound(self, law: Any) -> Floats:
        return self._borne(self.renewed(law))

    def capped(self, law: Any) -> Any:
        return self.renewed(law) >= STEEPEST * self.pressure

    def resistance(self, law: Any) -> Floats:
        there, passed = law.bound(**self._at), self._passed(law)
        some = passed > 0.0
        kept = np.where(some, -np.expm1(-passed) / np.where(some, passed, 1.0), 1.0)
        return self._borne(there + (self.before - there) * kept)

    def _derivative(self, law: Any, by: Literal["pressure", "mu", "speed"]) -> Floats:
        kept, found = np.exp(-self._passed(law)), super()._derivative(law, by)
        found = found * (1.0 - kept)
        if by == "speed":
            follows = (law.bound(**self._at) - self.before) * kept * self.unit / law.length
            found = found * (self.seconds > 0.0) + follows
        return np.asarray(np.where(self.capped(law), STEEPEST if by == "pressure" else 0.0, found))


@dataclass(frozen=True)
class Linearised:
    """The bound of k nodes near an iterate: `slope` (k,) times the contact force plus `offset` (k,)
    in N/mm; its derivatives by speed, `by_speed` (k,) in N/mm per mm/s, and by the coefficient of
    the surface, `by_mu` (k,) in N/mm.
    """

    slope: Floats
    offset: Floats
    by_speed: Floats
    by_mu: Floats

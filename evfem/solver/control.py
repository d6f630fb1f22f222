r"""What is prescribed in a step: the bone's height or the force on it, the voltage or the friction
force.

A control says which part of the step is known; where a force is prescribed instead, it gives the
extra unknown with the equation that settles it (`evfem.contact.condensed.ExtraUnknown`), its share
of the residual, and its bounds:

==================  ===========================  ============================  ====================
control             known                        unknown                       equation
==================  ===========================  ============================  ====================
`Indentation`       height of the bone                                         none
`Force`                                          travel of the bone            F_y = -force
`Loose`             height of the bone           travel of the bone            F_y = 0, if touched
`GivenVoltage`      voltage                                                    none
`KeptCharge`        charge of the electrode      voltage                       found by the stepper
`FollowFriction`    voltage at either bound      squared voltage between them  F_x = force
==================  ===========================  ============================  ====================

Attraction is proportional to the squared voltage, so that this unknown enters linearly. A control
of one's own (a spring behind the bone, a prescribed charge) is a class with the methods of
`HeightControl` or `VoltageControl`; `docs/howto/extend.md` builds one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import KILOVOLT
from evfem.contact.condensed import CondensedTangent, ExtraUnknown, LinearContactStep, StepSolution
from evfem.contact.signorini import STICK
from evfem.solver.hand import Grip
from evfem.solver.state import State

#: the voltage of `FollowFriction`: at its lower or upper bound, or an unknown settled by the friction force
AT_ZERO, AT_LIMIT, UNKNOWN = "at zero", "at limit", "unknown"


class HeightControl(Protocol):
    """How high the bone stands: prescribed, or settled by an equation."""

    @property
    def free(self) -> bool:
        """Whether the bone's height is an unknown of the step."""

    def known(self, height: float) -> float:
        """The prescribed height (mm), or the present `height` where it is an unknown."""

    def missing(self, height: float, reaction: Floats) -> float:
        """Upward force (N/mm) on the bone that the equation lacks at a height and reactions (2,)."""

    def unknowns(self, tangent: CondensedTangent, height: float) -> tuple[ExtraUnknown, ...]:
        """The extra unknown, the bone's travel from `height` in mm, or nothing."""

    def towards(self, end: HeightControl, fraction: float) -> HeightControl:
        """The control at `fraction` of the way to another one of its kind."""


@dataclass(frozen=True)
class Indentation:
    """The bone stands at `height` (mm)."""

    height: float
    free = False

    def known(self, height: float) -> float:
        return self.height

    def missing(self, height: float, reaction: Floats) -> float:
        return 0.0

    def unknowns(self, tangent: CondensedTangent, height: float) -> tuple[ExtraUnknown, ...]:
        return ()

    def towards(self, end: HeightControl, fraction: float) -> HeightControl:
        assert isinstance(end, Indentation)
        return Indentation(self.height + fraction * (end.height - self.height))


@dataclass(frozen=True)
class Force:
    """The bone carries the downward `force` (N/mm)."""

    force: float
    free = True

    def known(self, height: float) -> float:
        return height

    def missing(self, height: float, reaction: Floats) -> float:
        return float(-self.force - reaction[1])

    def unknowns(self, tangent: CondensedTangent, height: float) -> tuple[ExtraUnknown, ...]:
        return (ExtraUnknown(-tangent.schur[:, 1 - tangent.dim], 1, -self.force),)

    def towards(self, end: HeightControl, fraction: float) -> Force:
        if isinstance(end, Loose):
            return self
        assert isinstance(end, Force)
        return Force(self.force + fraction * (end.force - self.force))


class Loose(Indentation):
    """A finger that carries no force and that nothing touches stays at `height`, where it is when a step
    begins; touched on the way, by a crest or by tissue that recovers, it gives way
    (`Equilibrium.step`).

    >>> Loose(0.3).towards(Force(0.0), 0.5)
    Force(force=0.0)
    """

    def towards(self, end: HeightControl, fraction: float) -> HeightControl:
        return end


@dataclass(frozen=True)
class VoltageProblem:
    """What a voltage control may ask for in one iteration: the present squared voltage (kV^2), a
    solved contact problem, and what one kV^2 more does: the state for the backward solve and the
    condensed forces.
    """

    squared: float
    solve: Callable[[LinearContactStep], StepSolution]
    unit: Callable[[], tuple[Floats, Floats]]


@dataclass(frozen=True)
class DrivenStep:
    """A solved contact step, the change of the squared voltage (kV^2) in it, and the state for the
    backward solve per kV^2 where it has changed.
    """

    solution: StepSolution
    change: float = 0.0
    unit: Floats | float = 0.0


class VoltageControl(Protocol):
    """What the voltage is: prescribed, or settled by an equation between bounds."""

    @property
    def follows(self) -> bool:
        """Whether an equation may settle the voltage."""

    @property
    def voltage(self) -> float:
        """The prescribed voltage (V), or the largest allowed one."""

    @property
    def free(self) -> bool:
        """Whether the voltage is an unknown of the present iteration."""

    def begin(self, old: State) -> None:
        """A step from `old` begins."""

    def guess(self, voltage: float) -> float:
        """Voltage at which the iterations of a step begin that comes from `voltage`."""

    def missing(self, reaction: Floats) -> float:
        """Force on the bone along x (N/mm) that the control's equation lacks at these reactions
        (2,).
        """

    def solve(self, step: LinearContactStep, drive: VoltageProblem) -> DrivenStep:
        """Contact, together with the voltage where it is an unknown."""

    def accepts(self, forward: float, reaction: Floats, slack: float) -> bool:
        """Whether the equation, or its bound, holds for a bone that moves `forward` (+1 or -1)."""

    def fallback(self, old: State, found: State | None) -> VoltageControl | None:
        """Another control where the step with this one failed (None) or has no sensible answer."""


@dataclass(frozen=True)
class GivenVoltage:
    """The voltage is `voltage` (V)."""

    voltage: float
    free = follows = False

    def begin(self, old: State) -> None:
        pass

    def guess(self, voltage: float) -> float:
        return self.voltage

    def missing(self, reaction: Floats) -> float:
        return 0.0

    def solve(self, step: LinearContactStep, drive: VoltageProblem) -> DrivenStep:
        return DrivenStep(drive.solve(step))

    def accepts(self, forward: float, reaction: Floats, slack: float) -> bool:
        return True

    def fallback(self, old: State, found: State | None) -> None:
        return None


@dataclass(frozen=True)
class KeptCharge(GivenVoltage):
    """The electrode has the `charge` over eps_0 (V), or None keeps the one that it had; `voltage` (V)
    is that of its source, long ago. The stepper finds the voltage (`evfem.solver.stepping`).
    """

    charge: float | None = None


@dataclass
class FollowFriction:
    """The voltage, from 0 to `voltage` (V), makes the bone's force along x `force` (N/mm).

    Friction hardly depends on the voltage of a pad that sticks: there the wish has no sensible
    answer, and the voltage stays as it was.
    """

    force: float
    voltage: float
    _mode: str = field(default=UNKNOWN, repr=False, compare=False)
    follows = True

    @property
    def free(self) -> bool:
        """Whether the voltage is between its bounds."""
        return self._mode == UNKNOWN

    def begin(self, old: State) -> None:
        self._mode = AT_ZERO if old.voltage == 0.0 else UNKNOWN

    def guess(self, voltage: float) -> float:
        return voltage

    def missing(self, reaction: Floats) -> float:
        return float(self.force - reaction[0]) if self.free else 0.0

    def solve(self, step: LinearContactStep, drive: VoltageProblem) -> DrivenStep:
        if not self.free:
            return DrivenStep(drive.solve(step))
        unit, push = drive.unit()
        found = drive.solve(replace(step, unknowns=(*step.unknowns, ExtraUnknown(push, 0, self.force))))
        most, change = (self.voltage / KILOVOLT) ** 2, float(found.extra[-1])
        if not 0.0 <= drive.squared + change <= most:
            self._mode = AT_ZERO if drive.squared + change < 0.0 else AT_LIMIT
            change = (0.0 if self._mode == AT_ZERO else most) - drive.squared
            found = drive.solve(replace(step, residual=step.residual + change * push))
        return DrivenStep(found, change, unit)

    def accepts(self, forward: float, reaction: Floats, slack: float) -> bool:
        """At a bound the force may miss the wish in the direction that the bound forbids to
        correct; else the voltage becomes an unknown again.
        """
        if self.free:
            return True
        lacking = forward * (self.force - reaction[0])
        if lacking > slack if self._mode == AT_ZERO else lacking < -slack:
            self._mode = UNKNOWN
            return False
        return True

    def fallback(self, old: State, found: State | None) -> VoltageControl | None:
        if found is not None and not (self._mode == AT_LIMIT and sticks(found)):
            return None
        return GivenVoltage(old.voltage)


def sticks(state: State) -> bool:
    """Whether any node sticks."""
    return bool((state.status == STICK).any())


@dataclass(frozen=True)
class Target:
    """Where a step goes: x of the bone (mm), what settles its height and the voltage, its seconds,
    in three dimensions z of the bone (mm), and the `hand` between drive and bone: x is then that of
    the drive, and the bone's an unknown.
    """

    x: float
    height: HeightControl
    drive: VoltageControl
    duration: float = 0.0
    z: float | None = None
    hand: Grip | None = None

    @classmethod
    def held(cls, bone: Floats, voltage: float) -> Target:
        """The bone at a given translation (dim,), under a given voltage.

        >>> Target.held(np.array([0.5, -0.1, 2.0]), 100.0).bone(np.zeros(3)).tolist()
        [0.5, -0.1, 2.0]
        """
        z = float(bone[2]) if len(bone) == 3 else None
        return cls(float(bone[0]), Indentation(float(bone[1])), GivenVoltage(voltage), z=z)

    def bone(self, present: Floats) -> Floats:
        """Translation of the bone (dim,) as far as it is known; the `present` one where it is not."""
        x = self.x if self.hand is None else float(present[0])
        along = [] if self.z is None else [self.z]
        return np.array([x, self.height.known(float(present[1])), *along])

    def way(self, present: Floats) -> Floats:
        """How far the bone is likely to go from its `present` translation (dim,)."""
        way = self.bone(present) - present
        if self.hand is not None:
            way[0] = self.hand.way
        return way

    def begun(self, old: State) -> Target:
        """The target of a step that starts from `old`."""
        if self.hand is None:
            return self
        return replace(self, hand=self.hand.begun(old, self.x, self.duration))

    def reached(self, bone: Floats) -> bool:
        """Whether the bone's translation is, to the last digit, what is known of it."""
        return bool((self.bone(bone) == bone).all())

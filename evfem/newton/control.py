r"""Controls of a step: the bone's height or the force on it, the voltage or the friction force.

A control prescribes one quantity. Where that is a force, it gives the extra unknown and its equation
(`evfem.contact.condensed.ExtraUnknown`), the residual of that equation, and bounds:

==================  ===========================  ============================  ====================
control             known                        unknown                       equation
==================  ===========================  ============================  ====================
`Indentation`       height of the bone                                         none
`Force`                                          travel of the bone            F_y = -force
`Unsupported`             height of the bone           travel of the bone            F_y = 0, if touched
`GivenVoltage`      voltage                                                    none
`KeptCharge`        charge of the electrode      voltage                       Q = charge
`GivenGap`          smallest gap of the pad      squared voltage               g = gap
`FollowFriction`    voltage at either bound      squared voltage between them  F_x = force
==================  ===========================  ============================  ====================

Without charges between the layers attraction is proportional to the squared voltage, so that this unknown
enters linearly. `docs/howto/extend.md` shows a user-defined control.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import KILOVOLT
from evfem.contact.condensed import CondensedTangent, Condition, ExtraUnknown, LinearContactStep
from evfem.newton.search import Trials, VoltageProblem, VoltageStep, Wish, sticks, strength
from evfem.newton.state import OutOfReach, State, StepFailed
from evfem.terms.hand import RIGID, Drive
from evfem.terms.traction import PadPath, PadState, Reading, smallest_gap

#: a voltage (V) that is none
TINY = 1e-300
#: a prescribed speed jumps if it changes by more than this fraction of the larger one
JUMP = 0.25
#: why no voltage makes a gap (mm)
TOO_WIDE = "no voltage makes a smallest gap of {:.4g} mm: without one it is {:.4g} mm"
#: the voltage of `FollowFriction`: at its lower or upper bound, or an unknown found from the friction force
AT_ZERO, AT_LIMIT, UNKNOWN = "at zero", "at limit", "unknown"
#: a wish is met if less is missed than so many tolerances of the largest force on the bone, or of the gap
MET = 100.0


class HeightControl:
    """Control of the bone's height: prescribed, here, or an unknown (`free`) with an equation."""

    free = False

    def known(self, height: float) -> float:
        """The prescribed height (mm), or the present `height` where it is an unknown."""
        return height

    def missing(self, height: float, reaction: Floats) -> float:
        """Force residual (N/mm) of the equation at a height and reactions (2,): upward force still needed."""
        return 0.0

    def unknowns(self, tangent: CondensedTangent, height: float) -> tuple[ExtraUnknown, ...]:
        """The extra unknown, the bone's travel from `height` in mm, or nothing."""
        return ()


@dataclass(frozen=True)
class Indentation(HeightControl):
    """The bone stands at `height` (mm)."""

    height: float

    def known(self, height: float) -> float:
        return self.height


@dataclass(frozen=True)
class Force(HeightControl):
    """The bone carries the downward `force` (N/mm)."""

    force: float
    free = True

    def missing(self, height: float, reaction: Floats) -> float:
        return float(-self.force - reaction[1])

    def unknowns(self, tangent: CondensedTangent, height: float) -> tuple[ExtraUnknown, ...]:
        return (ExtraUnknown(-tangent.schur[:, 1 - tangent.dim], 1, -self.force),)


class Unsupported(Indentation):
    """Unloaded finger: without contact it stays at `height`, where it is when a step begins; touched during
    the step, by a crest or by tissue that recovers, it moves away without force (`Equilibrium.step`).
    """


class VoltageControl:
    """Control of the voltage: `voltage` (V), prescribed or the largest; `free`: it is an unknown."""

    free: Any = False
    #: whether it is found from the state of the pad
    sought = False
    voltage: float = 0.0

    def raised(self, end: VoltageControl, fraction: float) -> VoltageControl:
        """The control at a fraction of a first step whose `end` has the full voltage."""
        return self

    def held(self, state: State) -> VoltageControl:
        """The control during pseudo-transient continuation (`evfem.solver.relaxation`)."""
        return self

    def begin(self, old: State, attraction: Any) -> None:
        """A step from `old` begins."""

    def guess(self, voltage: float) -> float:
        """Voltage at which the iterations of a step begin that comes from `voltage`."""
        return voltage

    def missing(self, reaction: Floats) -> float:
        """Force residual (N/mm) of the control's equation at these reactions (dim,)."""
        return 0.0

    def lacking(self, attraction: Any, pad: PadState) -> float:
        """Relative residual of the control's equation where that is no balance of forces."""
        return 0.0

    def after(self, voltage: float, change: float) -> float:
        """The updated voltage (V), its sign kept, after a change of its unknown, here its square (kV^2)."""
        squared = (voltage / KILOVOLT) ** 2 + change
        return float(np.copysign(KILOVOLT * np.sqrt(max(squared, 0.0)), voltage))

    def solve(self, step: LinearContactStep, problem: VoltageProblem) -> VoltageStep:
        """Contact, together with the voltage where it is an unknown."""
        return VoltageStep(problem.solve(step))

    def unknowns(self, step: LinearContactStep, problem: VoltageProblem) -> tuple[ExtraUnknown, ...]:
        """The voltage as an extra unknown where the state of the pad determines it, or nothing."""
        return ()

    def accepts(self, travel: Floats, reaction: Floats, slack: float) -> bool:
        """Whether the equation, or its bound, holds for a bone that moves along the display by (d,)."""
        return True

    def along(self, attraction: Any, way: list[PadState]) -> Floats:
        """Voltages (W,) in the states of a `way` whose last one is accepted, under its loads."""
        return np.array([pad.voltage for pad in way])

    def apart(self, traction: Any, path: PadPath) -> float:
        """Work (N mm) of a traction in the books of a substep that is not on its path."""
        return 0.0

    def find(self, trials: Trials) -> State:
        """The equilibrium of a step. Raises `StepFailed`."""
        return trials.solve(self)

    def misses(self, row: Mapping[str, Any], state: State, tolerance: float) -> dict[str, float]:
        """Wished less reached, by its column, of an accepted state and its row; 0 where the wish is met."""
        return {}


@dataclass(frozen=True)
class GivenVoltage(VoltageControl):
    """The voltage is `voltage` (V)."""

    voltage: float

    def guess(self, voltage: float) -> float:
        return self.voltage

    def raised(self, end: VoltageControl, fraction: float) -> VoltageControl:
        return end if end.free else GivenVoltage(fraction * end.voltage)


class ConstrainedVoltage(VoltageControl):
    """The voltage is an unknown, and a quantity of the state has a prescribed value: one more equation,
    linear in voltage and displacements, regular where a prescribed voltage has no equilibrium.
    """

    free = sought = True

    def read(self, attraction: Any, pad: PadState) -> tuple[Reading, float]:
        """The quantity and its prescribed value."""
        raise NotImplementedError

    def unit(self, attraction: Any, pad: PadState) -> Floats:
        """Forces (P, dim) on the pad nodes per unit of the voltage's unknown."""
        raise NotImplementedError

    def unknown(self, step: LinearContactStep, problem: VoltageProblem) -> tuple[ExtraUnknown, Floats]:
        """The unknown, and the state for the backward solve of a unit of it."""
        reading, prescribed = self.read(problem.attraction, problem.pad)
        saved, push = problem.pushed(self.unit(problem.attraction, problem.pad))
        row, still, own = problem.measured(reading.by_position, saved)
        travels = [row[unknown.axis - step.body.dim] for unknown in step.unknowns]
        gains = np.array([*travels, reading.by_voltage + own])
        return ExtraUnknown(push, 0, 0.0, Condition(row, gains, prescribed - reading.value - still)), saved

    def unknowns(self, step: LinearContactStep, problem: VoltageProblem) -> tuple[ExtraUnknown, ...]:
        return (self.unknown(step, problem)[0],)

    def solve(self, step: LinearContactStep, problem: VoltageProblem) -> VoltageStep:
        unknown, saved = self.unknown(step, problem)
        found = problem.solve(replace(step, unknowns=(*step.unknowns, unknown)))
        return VoltageStep(found, float(found.extra[-1]), saved)


@dataclass(frozen=True)
class KeptCharge(ConstrainedVoltage):
    """The electrode has `charge` over eps_0 (V, in space V mm), None: as before. Unknown: voltage in kV."""

    charge: float | None = None

    def begin(self, old: State, attraction: Any) -> None:
        attraction.parts[0].charging.keep(self._kept(attraction.parts[0].charging))

    def _kept(self, charging: Any) -> float:
        return float(charging.electrode_charge(charging.old)) if self.charge is None else self.charge

    def read(self, attraction: Any, pad: PadState) -> tuple[Reading, float]:
        electrode = attraction.parts[0]
        return electrode.electrode_charge(pad), self._kept(electrode.charging)

    def unit(self, attraction: Any, pad: PadState) -> Floats:
        """It is quadratic in the voltage."""
        volts = (pad.voltage + KILOVOLT, pad.voltage - KILOVOLT)
        more, less = (attraction.forces(replace(pad, voltage=each)) for each in volts)
        return np.asarray(0.5 * (more - less))

    def lacking(self, attraction: Any, pad: PadState) -> float:
        reading, kept = self.read(attraction, pad)
        wanted = self.after(pad.voltage, (kept - reading.value) / reading.by_voltage)
        return abs(wanted - pad.voltage) / max(abs(wanted), abs(pad.voltage), TINY)

    def after(self, voltage: float, change: float) -> float:
        return voltage + KILOVOLT * change

    def along(self, attraction: Any, way: list[PadState]) -> Floats:
        return np.asarray(attraction.parts[0].of_one_charge(way))

    def apart(self, traction: Any, path: PadPath) -> float:
        return float(traction.work_apart(path))


@dataclass(frozen=True)
class GivenGap(ConstrainedVoltage):
    """The smallest gap of the deformed pad is `gap` (mm). The unknown is the squared voltage (kV^2)."""

    gap: float

    def raised(self, end: VoltageControl, fraction: float) -> VoltageControl:
        return end

    def read(self, attraction: Any, pad: PadState) -> tuple[Reading, float]:
        return smallest_gap(pad), self.gap

    def unit(self, attraction: Any, pad: PadState) -> Floats:
        return np.asarray(attraction.parts[0].unit(pad))

    def lacking(self, attraction: Any, pad: PadState) -> float:
        return abs(smallest_gap(pad).value / self.gap - 1.0)

    def solve(self, step: LinearContactStep, problem: VoltageProblem) -> VoltageStep:
        found = super().solve(step, problem)
        if problem.squared == 0.0 and found.change < 0.0:
            raise OutOfReach(TOO_WIDE.format(self.gap, smallest_gap(problem.pad).value), [])
        return found

    def find(self, trials: Trials) -> State:
        """With the voltage as an unknown, or without one where the gap is never so wide."""
        try:
            return trials.solve(self)
        except OutOfReach:
            return trials.solve(GivenVoltage(0.0))

    def misses(self, row: Mapping[str, Any], state: State, tolerance: float) -> dict[str, float]:
        found = self.gap - row["min_gap"]
        return {"missed_gap": found if abs(found) > MET * tolerance * self.gap else 0.0}


@dataclass
class FollowFriction(VoltageControl):
    """The voltage, from 0 to `voltage` (V), makes the bone's force along a `direction`, x[, z] of a unit
    vector, `force` (N/mm); where none does, the nearest force (`evfem.newton.search`).
    """

    force: float
    voltage: float
    direction: tuple[float, ...] = (1.0,)
    _mode: str = field(default=UNKNOWN, repr=False, compare=False)
    sought = True

    def held(self, state: State) -> VoltageControl:
        return GivenVoltage(state.voltage)

    @property
    def free(self) -> bool:
        """Whether the voltage is between its bounds."""
        return self._mode == UNKNOWN

    def begin(self, old: State, attraction: Any) -> None:
        self._mode = AT_ZERO if old.voltage == 0.0 else UNKNOWN

    def missing(self, reaction: Floats) -> float:
        return self._force_residual(reaction) if self.free else 0.0

    def _force_residual(self, reaction: Floats) -> float:
        return float(self.force - reaction[::2] @ np.array(self.direction))

    def solve(self, step: LinearContactStep, problem: VoltageProblem) -> VoltageStep:
        if not self.free:
            return VoltageStep(problem.solve(step))
        unit, push = problem.unit()
        along = np.zeros(step.bone.size)
        along[::2] = self.direction
        unknown = ExtraUnknown(push, 0, self.force, along=along)
        found = problem.solve(replace(step, unknowns=(*step.unknowns, unknown)))
        most, change = (self.voltage / KILOVOLT) ** 2, float(found.extra[-1])
        if not 0.0 <= problem.squared + change <= most:
            self._mode = AT_ZERO if problem.squared + change < 0.0 else AT_LIMIT
            change = (0.0 if self._mode == AT_ZERO else most) - problem.squared
            found = problem.solve(replace(step, residual=step.residual + change * push))
        return VoltageStep(found, change, unit)

    def accepts(self, travel: Floats, reaction: Floats, slack: float) -> bool:
        """At a bound the force may miss `force` in its direction; else the voltage is unknown again."""
        if self.free:
            return True
        lacking = self.wish(travel).lacking(reaction)
        if lacking > slack if self._mode == AT_ZERO else lacking < -slack:
            self._mode = UNKNOWN
            return False
        return True

    def find(self, trials: Trials) -> State:
        """With the voltage as an unknown, or, where that fails or sticks at its limit, by a search."""
        with suppress(StepFailed):
            found = trials.solve(self)
            if not (self._mode == AT_LIMIT and sticks(found)):
                return found
        return trials.nearest(self.wish(trials.travel), GivenVoltage)

    def wish(self, travel: Floats) -> Wish:
        """What is wished of a bone that moves by (d,) along the display."""
        direction = np.array(self.direction)
        forward = float(np.sign(travel @ direction)) or 1.0
        return Wish(forward * self.force, forward * direction, self.voltage)

    def missed(self, state: State, tolerance: float) -> float:
        """Wished less reached force (N/mm)."""
        found = self._force_residual(state.reaction)
        return found if abs(found) > MET * tolerance * strength(state) else 0.0

    def misses(self, row: Mapping[str, Any], state: State, tolerance: float) -> dict[str, float]:
        return {"missed_force": self.missed(state, tolerance)}


@dataclass(frozen=True)
class Target:
    """Target of a step: x of the bone (mm), controls of its height and of the voltage, duration (s), in space
    (z,) (mm); with a hand x and z are those of the `drive`, not of the bone.
    """

    x: float
    height: HeightControl
    voltage: VoltageControl
    duration: float = 0.0
    z: tuple[float, ...] = ()
    drive: Drive = RIGID

    @classmethod
    def held(cls, bone: Floats, voltage: float) -> Target:
        """The bone at a prescribed translation (dim,), under a prescribed voltage.

        >>> Target.held(np.array([0.5, -0.1, 2.0]), 100.0).bone(np.zeros(3)).tolist()
        [0.5, -0.1, 2.0]
        """
        z = tuple(bone[2:].tolist())
        return cls(float(bone[0]), Indentation(float(bone[1])), GivenVoltage(voltage), z=z)

    def bone(self, present: Floats) -> Floats:
        """Prescribed translation of the bone (dim,); the `present` one in unknown components."""
        bone = np.array(present, dtype=float)
        bone[1] = self.height.known(float(present[1]))
        bone[::2] = self.drive.known(self.place, bone[::2])
        return bone

    @property
    def free(self) -> Any:
        """Components of the bone's translation that are unknowns, (dim,) bool."""
        free = np.full(2 + len(self.z), self.drive.free)
        free[1] = self.height.free
        return free

    @property
    def place(self) -> Floats:
        """x[, z] of the drive (d,)."""
        return np.array([self.x, *self.z])

    def increment(self, present: Floats) -> Floats:
        """Expected displacement of the bone from its `present` translation (dim,)."""
        increment = self.bone(present) - present
        increment[::2] = self.drive.travel(increment[::2])
        return increment

    def unknowns(self, tangent: CondensedTangent, bone: Floats) -> tuple[ExtraUnknown, ...]:
        """The unknown components of the bone's travel from its translation (dim,)."""
        return (*self.height.unknowns(tangent, float(bone[1])), *self.drive.unknowns(tangent, bone))

    def at_once(self, bone: Floats) -> Target:
        """The target without time: the bone (dim,) keeps its position along the display."""
        return replace(self, x=float(bone[0]), z=tuple(bone[2:].tolist()), duration=0.0, drive=RIGID)

    def begun(self, old: State) -> Target:
        """The target of a step that starts from `old`."""
        return replace(self, drive=self.drive.begun(old, self.place, self.duration))

    def reached(self, bone: Floats) -> bool:
        """Whether the bone's translation is the prescribed one, to the last digit."""
        return bool((self.bone(bone) == bone).all())

    def speed_jumps(self, old: State, before: Floats) -> bool:
        """Whether the prescribed speed of bone or drive from `old` on differs from that `before` (dim,)."""
        if self.duration == 0.0:
            return False
        now = (self.bone(old.bone) - old.bone) / self.duration
        pairs = list(zip(before.tolist(), now.tolist(), strict=True))
        pairs[::2] = self.drive.prescribed_speeds(old, self.place, self.duration, pairs[::2])
        if self.height.free:
            del pairs[1]
        return any(abs(b - a) > JUMP * max(abs(a), abs(b)) for a, b in pairs)

r"""The hand behind the finger: a spring, a damper and a mass between drive and bone.

Without one the bone is moved by the drive itself. With one its x is an unknown of every step, with
the force that the bone needs, its reaction R, as the equation: over a step of :math:`\Delta t` from
the drive's :math:`X_0` and the bone's :math:`x_0` with the velocity :math:`v_0`

.. math:: R = k (X - x) + c\,\frac{(X - X_0) - (x - x_0)}{\Delta t}
          - \frac{m}{\Delta t}\Bigl(\frac{x - x_0}{\Delta t} - v_0\Bigr),

by backward Euler; beside tissue with mass by its differences of second order
(`evfem.tissue.dynamics`), over the previous substep too. Where no time passes the spring alone acts. In
three dimensions the same holds along z. The motion prescribes the bone's height.

Values for a finger (`Hand.of_finger`): Balasubramanian, Pool, Vardar, arXiv:2505.11162, ten fingers that slid
with 20 to 100 mm/s. For every mm/s the stiffness grew by 4.04 N/m, the moving mass by 3.23e-5 kg, and the
cut-off frequency of the friction by 13.8 Hz. In the plane all three are per mm of depth.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, above, check_fields, number
from evfem.common.rooms import Room
from evfem.contact.condensed import CondensedTangent, ExtraUnknown
from evfem.errors import InputError, describe_value
from evfem.tissue.dynamics import Difference

#: an accepted state, or an iterate (`evfem.newton.state.State`)
State = Any

#: of a sliding finger for every mm/s: stiffness (N/mm), moving mass (t), cut-off frequency (Hz)
STIFFER, HEAVIER, FASTER = 4.04e-3, 3.23e-8, 13.8
_STIFFNESS = number("a stiffness in N/mm, larger than 0, up to 1e9", Within(0.0, 1e9, above=True), "N/mm")
_DAMPING = number("a damping in N s/mm, not negative, up to 1e9", Within(0.0, 1e9), "N s/mm")
_MASS = number("a mass in t, not negative, up to 1e3", Within(0.0, 1e3), "t")


@dataclass(frozen=True)
class Hand(Room):
    """Spring (N/mm), damper (N s/mm) and mass (t) between drive and bone, in the plane per mm
    of depth.

    >>> Hand(stiffness=0.1)
    Hand(stiffness=0.1, damping=0.0, mass=0.0)
    """

    stiffness: Annotated[float, _STIFFNESS, "of the spring, in the plane per mm of depth"]
    damping: Annotated[float, _DAMPING, "of the damper beside it, in the plane per mm of depth"] = 0.0
    mass: Annotated[float, _MASS, "that moves with the bone, in the plane per mm of depth"] = 0.0

    def __post_init__(self) -> None:
        check_fields(self)

    @classmethod
    def of_finger(cls, speed: float, depth: float = 10.0) -> Hand:
        """The hand of a finger that slides with `speed` (mm/s) and is `depth` mm deep; InputError where one
        is not above 0. Spring and mass are proportional to the speed. The damper is our reading: with the
        spring it is a first-order system, whose cut-off frequency is k / (2 pi c).

        >>> hand = Hand.of_finger(20.0)
        >>> round(hand.stiffness, 9), round(hand.mass, 12), round(hand.damping, 9)
        (0.00808, 6.46e-08, 4.659e-06)
        """
        above("speed", speed, 0.0, "a speed in mm/s above 0")
        above("depth", depth, 0.0, "a depth in mm above 0")
        stiffness = STIFFER * speed / depth
        return cls(stiffness, stiffness / (2.0 * np.pi * FASTER * speed), HEAVIER * speed / depth)

    @property
    def control(self) -> HandControl:
        """What it is in a step."""
        return HandControl(self)

    @property
    def timed(self) -> bool:
        """Whether it knows of time."""
        return self.damping > 0.0 or self.mass > 0.0

    def stored(self, state: State) -> float:
        """Energy of the spring in N mm."""
        return 0.5 * self.stiffness * float(np.sum((state.memory["hand"][0] - state.bone[::2]) ** 2))

    def kinetic(self, state: State) -> float:
        """Energy of the mass in N mm."""
        return 0.5 * self.mass * float(np.sum(state.memory["hand"][1] ** 2))

    def work(self, old: State, new: State) -> float:
        """Work of the actuator beyond that on the bone, between two states, in N mm."""
        before, after = old.memory["hand"], new.memory["hand"]
        drive = 0.5 * (before[2] + after[2]) * (after[0] - before[0])
        bone = 0.5 * (old.reaction + new.reaction) * (new.bone - old.bone)
        return float(np.sum(drive - bone[::2]))

    def dissipation(self, old: State, new: State, duration: float) -> float:
        """Dissipation of the damper in so many seconds, in N mm."""
        if duration == 0.0:
            return 0.0
        stretched = (new.memory["hand"][0] - old.memory["hand"][0]) - (new.bone - old.bone)[::2]
        return float(self.damping * np.sum(stretched**2) / duration)

    def potential(self, old: State, new: State, fractions: Floats) -> Floats:
        """Energy of the spring beyond the constant force of the end, at the fractions `fractions` (w,)."""
        square = float(np.sum((new.bone - old.bone)[::2] ** 2))
        return 0.5 * self.stiffness * square * ((1.0 - fractions) ** 2 - (1.0 - fractions[0]) ** 2)

    def takes_time(self, seconds: float) -> bool:
        """Whether speeds count in a substep of so many seconds."""
        return self.timed and seconds > 0.0


@dataclass(frozen=True)
class Drive(Room):
    """What moves the bone along the display, here rigidly: its x[, z] is that of the drive.

    `free`: whether the bone's position along the display is an unknown.
    """

    free = False
    #: further terms of the energy balance
    books: ClassVar[tuple[Any, ...]] = ()

    def begun(self, old: State, drive: Floats, duration: float) -> Drive:
        """In the step from `old` that takes the drive to x[, z] = `drive` (d,)."""
        return self

    def known(self, drive: Floats, present: Floats) -> Floats:
        """Prescribed x[, z] of the bone (d,), or the `present` one where it is an unknown."""
        return drive

    def travel(self, ahead: Floats) -> Floats:
        """Predicted displacement of the bone (d,) in mm; `ahead` is that of the drive."""
        return ahead

    def unknowns(self, tangent: CondensedTangent, bone: Floats) -> tuple[ExtraUnknown, ...]:
        """The extra unknowns: the bone's travels along x[, z], or nothing."""
        return ()

    def residual(self, bone: Floats, drive: Floats, reaction: Floats) -> Floats:
        """Residual along x[, z] (d,) of the bone at (dim,): of its position in mm, or of the force, N/mm."""
        return np.asarray(bone[::2] - drive)

    def unbalanced(self, x: Any, reaction: Floats) -> float:
        """The largest force residual of the bone in N/mm."""
        return 0.0

    def own_stiffness(self, axis: int) -> float | None:
        """Stiffness at the bone along an axis (N/mm per mm), None where its position is prescribed."""
        return None

    def prescribed_speeds(
        self, old: State, drive: Floats, duration: float, bone: Any
    ) -> list[tuple[Any, Any]]:
        """Speeds (mm/s) that are prescribed along x[, z] before and now; `bone`: those of the bone."""
        return list(bone)

    def begin_at(self, start: dict[str, float], travelled: tuple[float, float]) -> dict[str, float]:
        """Where a motion starts, from where the bone is and how far the drive has `travelled` (mm)."""
        return start

    def place(self, state: State) -> dict[str, float]:
        """Where the drive is if not at the bone."""
        return {}


RIGID = Drive()


def drive_of(hand: Hand | None) -> Drive:
    """The drive of a scene: a hand, or rigid. InputError for a control that is that of another hand."""
    if hand is None:
        return RIGID
    control = hand.control
    if getattr(control, "hand", None) is not hand:
        raise InputError(
            f"{type(hand).__name__}.control", describe_value(control), "a HandControl of this hand"
        )
    return control


@dataclass(frozen=True)
class HandControl(Drive):
    """A hand in one step: drive's x[, z] at its end (d,), seconds; before: those of drive and bone (mm), its
    velocity (mm/s), and their mean rates over the substep before, for the step's `difference`.
    """

    hand: Hand
    drive: Any = 0.0
    free = True
    duration: float = 0.0
    before: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)
    rates: tuple[Any, Any, Any] = (0.0, 0.0, 0.0)
    difference: Difference = field(default_factory=Difference)

    def takes_time(self, seconds: float) -> bool:
        return self.hand.takes_time(seconds)

    @property
    def books(self) -> tuple[Any, ...]:  # type: ignore[override]
        return (self.hand,)

    def memory(self, state: State) -> dict[str, Floats]:
        return {"hand": np.zeros((6, state.bone.size - 1))}

    def known(self, drive: Floats, present: Floats) -> Floats:
        return present

    def travel(self, ahead: Floats) -> Floats:
        return np.asarray(self.before[2] * self.duration)

    def residual(self, bone: Floats, drive: Floats, reaction: Floats) -> Floats:
        return self.missing(bone[::2], reaction)

    def own_stiffness(self, axis: int) -> float | None:
        return self.stiffness if axis != 1 else None

    def prescribed_speeds(
        self, old: State, drive: Floats, duration: float, bone: Any
    ) -> list[tuple[Any, Any]]:
        kept = old.memory["hand"]
        return list(zip(kept[3].tolist(), ((drive - kept[0]) / duration).tolist(), strict=True))

    def begin_at(self, start: dict[str, float], travelled: tuple[float, float]) -> dict[str, float]:
        return start | dict(zip(("position", "position_z"), travelled, strict=True))

    def place(self, state: State) -> dict[str, float]:
        return dict(zip(("position", "position_z"), state.memory["hand"][0].tolist(), strict=False))

    def begun(self, old: State, drive: Floats, duration: float) -> HandControl:
        kept = old.memory["hand"]
        before, (along, moved, faster) = (kept[0], old.bone[::2], kept[1]), kept[3:]
        difference = Difference.over(duration, float(old.memory.get("seconds", 0.0)))
        rates = along, moved, faster
        return replace(
            self, drive=drive, duration=duration, before=before, rates=rates, difference=difference
        )

    def _rate(self, number: int, end: Any) -> Any:
        """Rate at the end of the step, (d,), of one of the three that were `before`."""
        mean = (end - self.before[number]) / self.duration
        return self.difference.share * mean - self.difference.lag * self.rates[number]

    @property
    def stiffness(self) -> float:
        """Stiffness of the hand at the bone, N/mm per mm."""
        if self.duration == 0.0:
            return self.hand.stiffness
        rate = self.difference.share / self.duration
        return self.hand.stiffness + rate * (self.hand.damping + rate * self.hand.mass)

    def velocity(self, x: Any) -> Any:
        """Velocity of the bone at the end of the step, (d,) in mm/s."""
        return self._rate(1, x) if self.duration > 0.0 else 0.0 * x

    def drive_force(self, x: Any) -> Any:
        """Force of the drive (d,) in N/mm, that of spring and damper, at the bone's x[, z] (d,)."""
        force = self.hand.stiffness * (self.drive - x)
        if self.duration > 0.0:
            force += self.hand.damping * (self._rate(0, self.drive) - self._rate(1, x))
        return force

    def force(self, x: Any) -> Any:
        """Force on the bone (d,) in N/mm: that of the drive minus the inertia of the mass."""
        force = self.drive_force(x)
        if self.duration > 0.0:
            force -= self.hand.mass * self._rate(2, self.velocity(x))
        return force

    def missing(self, x: Any, reaction: Floats) -> Floats:
        """Force residuals of the bone along x[, z] (d,) in N/mm, at reactions (dim,)."""
        return np.asarray(self.force(x) - reaction[::2])

    def unbalanced(self, x: Any, reaction: Floats) -> float:
        """The largest force residual beyond the rounding of the four positions, not negative."""
        largest = max(float(np.max(np.abs(position))) for position in (x, self.drive, *self.before[:2]))
        rounding = 2.0 * float(np.finfo(float).eps) * self.stiffness * largest
        return max(float(np.abs(self.missing(x, reaction)).max()) - rounding, 0.0)

    def unknowns(self, tangent: CondensedTangent, bone: Floats) -> tuple[ExtraUnknown, ...]:
        """The bone's travels along x[, z] from its translation (dim,), in mm."""
        found = []
        for axis, force in zip((0, 2), self.force(bone[::2]).tolist(), strict=False):
            rate = -tangent.schur[:, axis - bone.size]
            rate[axis - bone.size] -= self.stiffness
            found.append(ExtraUnknown(rate, axis, force))
        return tuple(found)

    def accept(self, old: State, new: State) -> dict[str, Floats]:
        """Along x[, z], (6, d): the drive's position (mm), the bone's velocity (mm/s), the drive's force
        (N/mm), mean rates of both positions and that velocity.
        """
        x = new.bone[::2]
        ends = np.stack([self.drive, x, self.velocity(x)])
        changes = ends - self.before
        rates = changes / self.duration if self.duration > 0.0 else 0.0 * changes
        return {"hand": np.stack([self.drive, ends[2], self.drive_force(x), *rates])}

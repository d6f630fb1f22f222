"""Motions of the finger (mm, N/mm, V, s); each one defines its displacement programme, a `Course`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from evfem.common.checks import Named, Within, number, one_of, whole
from evfem.errors import InputError, describe_value
from evfem.surface.ways import ANGLE, direction

Hold = Literal["indentation", "force"]

#: decades spanned by the times of a wait with logarithmic steps
DECADES = 3.0
#: estimate (V) of a voltage that is an unknown of the run
UNKNOWN_VOLTAGE = 10_000.0

# Admissible values of fields, in words and as a check; they are also the keys of scene files.
FORCE = number(
    "a force in N/mm, N over the mm of depth (of a fingertip in N), from 0 to 1e4", Within(0.0, 1e4), "N/mm"
)
INDENTATION = number("an indentation in mm between -200 and 200", Within(-200.0, 200.0), "mm")
_DISTANCE = number(
    "a distance in mm, not 0, at most 1000 either way", Within(-1000.0, 1000.0, not_zero=True), "mm"
)
_SPEED = number("a speed in mm/s, larger than 0", Within(0.0, above=True), "mm/s")
_GAP = number("a gap in mm from 0 to 200", Within(0.0, 200.0), "mm")
_NARROWED = number("a gap in mm, larger than 0, up to 200", Within(0.0, 200.0, above=True), "mm")
VOLTAGE = number("a voltage in V between -1e6 and 1e6", Within(-1e6, 1e6), "V")
_DURATION = number("a time in s, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "s")
Steps = Annotated[int, whole(), "number of equal steps"]
Held = Annotated[Hold, one_of(*get_args(Hold)), "kept constant: the indentation, or the applied force"]


@dataclass(frozen=True, kw_only=True)
class Course:
    """Targets of a motion at its end; `None` leaves a quantity unchanged.

    `distance` (mm) towards `angle` (degrees from +x); `indentation` (mm) or applied `force` (N/mm); without
    either, `hold` is kept constant. `voltage` (V), or the smallest `gap` (mm) of the deformed pad that the
    voltage must produce. Time passes by a `speed` (mm/s) or a `duration` (s). A motion that `hovers` leaves
    no load to hold.

    >>> Course(distance=2.0, angle=90.0).travel
    (0.0, 2.0)
    """

    distance: float = 0.0
    angle: float = 0.0
    indentation: float | None = None
    force: float | None = None
    hovers: bool = False
    hold: Hold = "indentation"
    voltage: float | None = None
    gap: float | None = None
    speed: float | None = None
    duration: float = 0.0

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector (x, z) at `angle`; quarter turns are exact."""
        return direction(self.angle)

    @property
    def travel(self) -> tuple[float, float]:
        """Displacement along x and along z, in mm."""
        x, z = self.direction
        return self.distance * x + 0.0, self.distance * z + 0.0

    @property
    def depth(self) -> float | None:
        """Indentation (mm) at the end; None if unchanged, infinite if set by a force (always in contact)."""
        return self.indentation if self.force is None else math.inf

    @property
    def lift(self) -> float:
        """Gap (mm) of the undeformed outline at the end of a motion that hovers, else 0: first touch."""
        return -self.indentation if self.hovers and self.indentation is not None else 0.0

    @property
    def presses(self) -> bool:
        """Whether the motion ends with a load that a later one can hold."""
        return self.depth is not None and not self.hovers

    @property
    def largest_voltage(self) -> float | None:
        """Largest voltage (V) of a ramp for estimates; `UNKNOWN_VOLTAGE` if a gap is the target."""
        return self.voltage if self.gap is None else UNKNOWN_VOLTAGE

    @property
    def takes_time(self) -> bool:
        """Whether any time passes."""
        return self.speed is not None or self.duration > 0.0

    def seconds(self, steps: float = 1, start: float = 0.0) -> float:
        """Duration (s) of each of `steps` equal steps, from the indentation `start` (mm).

        >>> Course(indentation=1.5, speed=2.0).seconds(steps=10, start=0.5)
        0.05
        """
        if self.speed is None:
            return self.duration / steps
        deeper = 0.0 if self.indentation is None else self.indentation - start
        return abs(self.distance or deeper) / steps / self.speed


class Motion(Named):
    """Base of motions: a dataclass with `steps` and the `course` (targets) that its fields define."""

    steps: int

    @property
    def course(self) -> Course:
        """The targets at the end of the motion."""
        raise NotImplementedError

    @property
    def takes_time(self) -> bool:
        """Whether any time passes."""
        return self.course.takes_time

    def part(self, step: int) -> tuple[float, float, float]:
        """Fractions (0 to 1) of the motion before and after a step (from 1 on), and the number of steps if
        all were of this length.
        """
        return (step - 1) / self.steps, step / self.steps, self.steps

    def _check_one_of(self, *names: str) -> None:
        prescribed = [name for name in names if getattr(self, name) is not None]
        if len(prescribed) != 1:
            found = " and ".join(prescribed) or "neither " + " nor ".join(names)
            raise InputError(names[0], found, "exactly one of the two")


@dataclass(frozen=True)
class Press(Motion, kind="press"):
    """Press to a force on the bone or to an indentation, both absolute, in equal steps.

    Without a `speed` the press takes no time and is quasi-static. Raises InputError unless exactly one target
    is given.

    >>> Press(force=0.05).steps
    10
    >>> Press()
    Traceback (most recent call last):
    evfem.errors.InputError: force: given neither force nor indentation; allowed: exactly one of the two
    """

    force: Annotated[float | None, FORCE, "load on the bone at the end; this or indentation"] = None
    indentation: Annotated[float | None, INDENTATION, "travel of the bone beyond first touch at the end"] = (
        None
    )
    steps: Steps = 10
    speed: Annotated[float | None, _SPEED, "of a press to an indentation; without it no time passes"] = None

    def __post_init__(self) -> None:
        self._check_one_of("force", "indentation")
        if self.force is not None and self.speed is not None:
            allowed = "no speed with a press to a force, only to an indentation"
            raise InputError("speed", describe_value(self.speed), allowed)
        super().__post_init__()

    @property
    def course(self) -> Course:
        return Course(force=self.force, indentation=self.indentation, speed=self.speed)


@dataclass(frozen=True)
class Slide(Motion, kind="slide"):
    """Slide over the surface in equal steps.

    `hold` keeps constant the last applied force, as in experiments, or the indentation, at which the
    load drifts (`evfem.planning.loaddrift`). A finger that touches nothing and is not attracted has
    no force at any height: in every motion with `hold` an unloaded finger keeps its height, and moves
    freely when the surface touches it. `speed` sets the duration.

    >>> Slide(distance=5.0).steps
    100
    """

    distance: Annotated[float, _DISTANCE, "from where it is, negative towards -x"]
    steps: Steps = 100
    speed: Annotated[float | None, _SPEED, "needed with dynamics other than quasistatic"] = None
    hold: Held = "indentation"
    angle: Annotated[float, ANGLE, "from +x, of a fingertip; 90 is along the finger"] = 0.0

    @property
    def course(self) -> Course:
        return Course(distance=self.distance, angle=self.angle, speed=self.speed, hold=self.hold)


@dataclass(frozen=True)
class Hover(Motion, kind="hover"):
    """Hold the bone so that the undeformed outline is above the surface by a gap: `indentation = -gap`.

    The tissue is free to move under the attraction. Going there takes no time. A scene's first motion is
    there from the beginning, as a finger that comes from afar: all of its steps are at the gap.
    """

    gap: Annotated[float, _GAP, "of the undeformed outline to the surface"]
    steps: Steps = 1

    @property
    def course(self) -> Course:
        return Course(indentation=-self.gap, hovers=True)


@dataclass(frozen=True)
class VoltageRamp(Motion, kind="voltage"):
    """Ramp the voltage from its present value to another, or to that at which the smallest gap of the
    deformed pad has a prescribed value, in equal steps.

    With a prescribed gap the voltage is an unknown, so that unstable equilibria beyond pull-in can be
    followed. Raises InputError unless exactly one of the two is given.

    >>> VoltageRamp(gap=0.05).course.largest_voltage
    10000.0
    """

    voltage: Annotated[float | None, VOLTAGE, "at the end, from the present one; this or gap"] = None
    steps: Steps = 10
    hold: Held = "indentation"
    gap: Annotated[float | None, _NARROWED, "smallest gap of the deformed pad at the end"] = None

    def __post_init__(self) -> None:
        self._check_one_of("voltage", "gap")
        super().__post_init__()

    @property
    def course(self) -> Course:
        return Course(voltage=self.voltage, gap=self.gap, hold=self.hold)


@dataclass(frozen=True)
class Wait(Motion, kind="wait"):
    """Rest for some time: for a voltage that changes with time, and for tissue that creeps.

    >>> Wait(duration=0.1).steps
    100
    """

    duration: Annotated[float, _DURATION, "how long it stays"]
    steps: Steps = 100
    hold: Held = "indentation"
    spacing: Annotated[
        str,
        one_of("even", "log"),
        "log: steps that grow, from 1/1000 of it on, for tissue that relaxes",
    ] = "even"

    @property
    def course(self) -> Course:
        return Course(duration=self.duration, hold=self.hold)

    def part(self, step: int) -> tuple[float, float, float]:
        if self.spacing == "even":
            return super().part(step)
        ends = [10.0 ** (DECADES * (k / self.steps - 1.0)) for k in (step - 1, step)]
        begun, reached = ends if step > 1 else (0.0, ends[1])
        return begun, reached, 1.0 / (reached - begun)


MOTIONS = Motion.kinds

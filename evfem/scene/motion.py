"""What the finger does: press, slide, hover, wait, and voltage ramps; frozen and validated (mm,
N/mm, V, s).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from evfem.common.checks import Checked, Within, check_fields, number, one_of, whole
from evfem.errors import InputError, quoted

Hold = Literal["indentation", "force"]

#: a voltage (V) that is not known before the run
UNKNOWN_VOLTAGE = 10_000.0

# What a field may be, in words and as a check; scene files take their keys from the fields too.
_FORCE = number("a force in N/mm, not negative", Within(0.0), "N/mm")
_INDENTATION = number("an indentation in mm between -200 and 200", Within(-200.0, 200.0), "mm")
_DISTANCE = number(
    "a distance in mm, not 0, at most 1000 either way", Within(-1000.0, 1000.0, not_zero=True), "mm"
)
_SPEED = number("a speed in mm/s, larger than 0", Within(0.0, above=True), "mm/s")
_GAP = number("a gap in mm from 0 to 200", Within(0.0, 200.0), "mm")
_NARROWED = number("a gap in mm, larger than 0, up to 200", Within(0.0, 200.0, above=True), "mm")
VOLTAGE = number("a voltage in V between -1e6 and 1e6", Within(-1e6, 1e6), "V")
_DURATION = number("a time in s, larger than 0, up to 1e6", Within(0.0, 1e6, above=True), "s")
_ANGLE = number("an angle in degrees from -360 to 360", Within(-360.0, 360.0), "degrees")
Steps = Annotated[int, whole(), "in how many equal parts"]
Held = Annotated[Hold, one_of(*get_args(Hold)), "what stays as it was: the indentation, or the applied force"]


@dataclass(frozen=True)
class Press:
    """Press to a force on the bone or to an indentation, both absolute, in equal parts.

    Without a `speed` the press takes no time and is quasi-static. Raises InputError unless exactly one target
    is given.

    >>> Press(force=0.05).steps
    10
    >>> Press()
    Traceback (most recent call last):
    evfem.errors.InputError: force: given neither force nor indentation; allowed: exactly one of the two
    """

    force: Annotated[float | None, _FORCE, "load on the bone at the end; this or indentation"] = None
    indentation: Annotated[float | None, _INDENTATION, "travel of the bone beyond first touch at the end"] = (
        None
    )
    steps: Steps = 10
    speed: Annotated[float | None, _SPEED, "of a press to an indentation; without it no time passes"] = None
    kind = "press"

    def __post_init__(self) -> None:
        if (self.force is None) == (self.indentation is None):
            given = "neither force nor indentation" if self.force is None else "force and indentation"
            raise InputError("force", given, "exactly one of the two")
        if self.force is not None and self.speed is not None:
            allowed = "no speed with a press to a force, only to an indentation"
            raise InputError("speed", quoted(self.speed), allowed)
        check_fields(self)


@dataclass(frozen=True)
class Slide(Checked):
    """Slide over the surface in equal parts.

    `hold` keeps the applied force of the moment before, as experiments do, or the indentation, at
    which the load drifts (`evfem.planning.drift`). A finger that touches nothing and is not attracted has
    no force at any height: in every motion with `hold` it stays where it is, and gives way to what
    touches it. `speed` sets how much time passes.

    >>> Slide(distance=5.0).steps
    100
    >>> Slide(distance=2.0, angle=90.0).way
    (0.0, 2.0)
    """

    distance: Annotated[float, _DISTANCE, "from where it is, negative towards -x"]
    steps: Steps = 100
    speed: Annotated[float | None, _SPEED, "needed with dynamics other than quasistatic"] = None
    hold: Held = "indentation"
    angle: Annotated[float, _ANGLE, "from +x, of a fingertip; 90 is along the finger"] = 0.0
    kind = "slide"

    @property
    def direction(self) -> tuple[float, float]:
        """Where its angle points, x and z of a unit vector; quarter turns are exact."""
        quarters, rest = divmod(self.angle, 90.0)
        x, z = math.cos(math.radians(rest)), math.sin(math.radians(rest))
        for _ in range(int(quarters) % 4):
            x, z = -z, x
        return x, z

    @property
    def way(self) -> tuple[float, float]:
        """How far it goes along x and along z, in mm."""
        x, z = self.direction
        return self.distance * x + 0.0, self.distance * z + 0.0


@dataclass(frozen=True)
class Hover(Checked):
    """Hold the bone so that the undeformed outline is off the surface: `indentation = -gap`.

    The tissue is free to move under the attraction. Going there takes no time.
    """

    gap: Annotated[float, _GAP, "of the undeformed outline to the surface"]
    steps: Steps = 1
    kind = "hover"


@dataclass(frozen=True)
class VoltageRamp:
    """Take the voltage from its present value to another, or to where the smallest gap of the deformed pad
    is a given one, in equal parts.

    A gap is followed where a given voltage pulls the pad in, and back; the voltage is what it takes. Raises
    InputError unless exactly one of the two is given.

    >>> VoltageRamp(gap=0.05).largest
    10000.0
    """

    voltage: Annotated[float | None, VOLTAGE, "at the end, from the present one; this or gap"] = None
    steps: Steps = 10
    hold: Held = "indentation"
    gap: Annotated[float | None, _NARROWED, "smallest gap of the deformed pad at the end"] = None
    kind = "voltage"

    def __post_init__(self) -> None:
        if (self.voltage is None) == (self.gap is None):
            given = "neither voltage nor gap" if self.gap is None else "voltage and gap"
            raise InputError("voltage", given, "exactly one of the two")
        check_fields(self)

    @property
    def largest(self) -> float:
        """Voltage (V) that counts in estimates: how much a gap takes is found."""
        return UNKNOWN_VOLTAGE if self.voltage is None else self.voltage


@dataclass(frozen=True)
class Wait(Checked):
    """Stay where it is for some time: for a voltage that changes with time, and for tissue that creeps.

    >>> Wait(duration=0.1).steps
    100
    """

    duration: Annotated[float, _DURATION, "how long it stays"]
    steps: Steps = 100
    hold: Held = "indentation"
    kind = "wait"


Motion = Press | Slide | Hover | VoltageRamp | Wait
MOTIONS: Mapping[str, type] = {cls.kind: cls for cls in get_args(Motion)}


def follows_gap(motion: Motion) -> bool:
    """Whether the voltage of a motion is what makes a gap.

    >>> follows_gap(VoltageRamp(100.0)), follows_gap(VoltageRamp(gap=0.1))
    (False, True)
    """
    return isinstance(motion, VoltageRamp) and motion.gap is not None


def takes_time(motion: Motion) -> bool:
    """Whether any time passes in a motion.

    >>> takes_time(Slide(1.0)), takes_time(Slide(1.0, speed=20.0)), takes_time(Wait(0.1))
    (False, True, True)
    """
    return isinstance(motion, Wait) or getattr(motion, "speed", None) is not None

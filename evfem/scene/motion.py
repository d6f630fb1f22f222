"""What the finger does: press, slide, hover, wait, and voltage ramps; frozen and validated (mm,
N/mm, V, s).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

from evfem.common.checks import Within, check_fields, number, one_of, whole
from evfem.errors import InputError, quoted

Hold = Literal["indentation", "force"]

# What a field may be, in words and as a check. Scene files take their keys from these fields too
# (`evfem.scene.keys`).
_FORCE = number("a force in N/mm, not negative", Within(0.0))
_INDENTATION = number("an indentation in mm between -200 and 200", Within(-200.0, 200.0))
_DISTANCE = number("a distance in mm, not 0, at most 1000 either way", Within(-1000.0, 1000.0, not_zero=True))
_SPEED = number("a speed in mm/s, larger than 0", Within(0.0, above=True))
_GAP = number("a gap in mm from 0 to 200", Within(0.0, 200.0))
_VOLTAGE = number("a voltage in V between -1e6 and 1e6", Within(-1e6, 1e6))
_DURATION = number("a time in s, larger than 0, up to 1e6", Within(0.0, 1e6, above=True))
_ANGLE = number("an angle in degrees from -360 to 360", Within(-360.0, 360.0))
_STEPS, _HOLD = whole(), one_of(*get_args(Hold))


@dataclass(frozen=True)
class Press:
    """Press to a `force` (N/mm, on the bone) or an `indentation` (mm), absolute, in `steps` equal
    parts.

    `speed` (mm/s, only with `indentation`) sets how much time passes; without it the press takes
    no time and is quasi-static. Raises InputError unless exactly one target is given.

    >>> Press(force=0.05).steps
    10
    >>> Press()
    Traceback (most recent call last):
    evfem.errors.InputError: force: given neither force nor indentation; allowed: exactly one of the two
    """

    force: float | None = field(default=None, metadata=_FORCE)
    indentation: float | None = field(default=None, metadata=_INDENTATION)
    steps: int = field(default=10, metadata=_STEPS)
    speed: float | None = field(default=None, metadata=_SPEED)
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
class Slide:
    """Slide by `distance` (mm, negative towards -x) in `steps` equal parts.

    `hold` keeps the applied force of the moment before, as experiments do, or the indentation, at
    which the load drifts (`evfem.scene.drift`). A finger that touches nothing and is not attracted has
    no force at any height: in every motion with `hold` it stays where it is, and gives way to what
    touches it. `speed` (mm/s) sets how much time passes; it is needed with `dynamics` other than
    quasistatic. A finger in three dimensions slides at an `angle`, in degrees from +x in the plane of
    the display, 90 being +z.

    >>> Slide(distance=5.0).steps
    100
    >>> Slide(distance=2.0, angle=90.0).way
    (0.0, 2.0)
    """

    distance: float = field(metadata=_DISTANCE)
    steps: int = field(default=100, metadata=_STEPS)
    speed: float | None = field(default=None, metadata=_SPEED)
    hold: Hold = field(default="indentation", metadata=_HOLD)
    angle: float = field(default=0.0, metadata=_ANGLE)
    kind = "slide"

    def __post_init__(self) -> None:
        check_fields(self)

    @property
    def way(self) -> tuple[float, float]:
        """How far it goes along x and along z, in mm; quarter turns are exact."""
        quarters, rest = divmod(self.angle, 90.0)
        x, z = math.cos(math.radians(rest)), math.sin(math.radians(rest))
        for _ in range(int(quarters) % 4):
            x, z = -z, x
        return self.distance * x + 0.0, self.distance * z + 0.0


@dataclass(frozen=True)
class Hover:
    """Hold the bone so that the undeformed outline is `gap` (mm) off the surface:
    `indentation = -gap`.

    The tissue is free to move under the attraction. Going there takes no time.
    """

    gap: float = field(metadata=_GAP)
    steps: int = field(default=1, metadata=_STEPS)
    kind = "hover"

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class VoltageRamp:
    """Take the voltage (V) from its present value to `voltage` in `steps` equal parts.

    `hold` keeps the indentation or the applied force of the moment before.
    """

    voltage: float = field(metadata=_VOLTAGE)
    steps: int = field(default=10, metadata=_STEPS)
    hold: Hold = field(default="indentation", metadata=_HOLD)
    kind = "voltage"

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True)
class Wait:
    """Stay where it is for `duration` (s), in `steps` equal parts: for a voltage that changes with
    time, and for tissue that creeps.

    `hold` keeps the indentation or the applied force of the moment before.

    >>> Wait(duration=0.1).steps
    100
    """

    duration: float = field(metadata=_DURATION)
    steps: int = field(default=100, metadata=_STEPS)
    hold: Hold = field(default="indentation", metadata=_HOLD)
    kind = "wait"

    def __post_init__(self) -> None:
        check_fields(self)


Motion = Press | Slide | Hover | VoltageRamp | Wait


def takes_time(motion: Motion) -> bool:
    """Whether any time passes in a motion.

    >>> takes_time(Slide(1.0)), takes_time(Slide(1.0, speed=20.0)), takes_time(Wait(0.1))
    (False, True, True)
    """
    return isinstance(motion, Wait) or getattr(motion, "speed", None) is not None

"""What the finger does: press, slide, hover, and voltage ramps; frozen and validated (mm, N/mm, V, s)."""

from __future__ import annotations

from dataclasses import dataclass

from evfem.common.checks import choice, count, real, set_frozen
from evfem.errors import InputError

HOLDS = ("indentation", "force")


def _speed(value: object) -> float | None:
    return None if value is None else real("speed", value, "a speed in mm/s, larger than 0", lambda v: v > 0)


@dataclass(frozen=True)
class Press:
    """Press to a `force` (N/mm, on the bone) or an `indentation` (mm), absolute, in `steps` equal parts.

    `speed` (mm/s, only with `indentation`) sets how much time passes; without it the press takes no time
    and is quasi-static. Raises InputError unless exactly one target is given.

    >>> Press(force=0.05).steps
    10
    >>> Press()
    Traceback (most recent call last):
    evfem.errors.InputError: force: given neither force nor indentation; allowed: exactly one of the two
    """

    force: float | None = None
    indentation: float | None = None
    steps: int = 10
    speed: float | None = None
    kind = "press"

    def __post_init__(self) -> None:
        if (self.force is None) == (self.indentation is None):
            given = "neither force nor indentation" if self.force is None else "force and indentation"
            raise InputError("force", given, "exactly one of the two")
        if self.force is not None:
            set_frozen(
                self, force=real("force", self.force, "a force in N/mm, not negative", lambda f: f >= 0)
            )
            if self.speed is not None:
                raise InputError(
                    "speed", self.speed, "no speed with a press to a force, only to an indentation"
                )
        else:
            allowed = "an indentation in mm between -200 and 200"
            set_frozen(
                self, indentation=real("indentation", self.indentation, allowed, lambda d: abs(d) <= 200)
            )
        set_frozen(self, steps=count("steps", self.steps), speed=_speed(self.speed))


@dataclass(frozen=True)
class Slide:
    """Slide by `distance` (mm, negative towards -x) in `steps` equal parts.

    `hold` keeps the indentation or the applied force of the moment before. `speed` (mm/s) sets how much time
    passes; it is needed with `dynamics` other than quasistatic.

    >>> Slide(distance=5.0).steps
    100
    """

    distance: float
    steps: int = 100
    speed: float | None = None
    hold: str = "indentation"
    kind = "slide"

    def __post_init__(self) -> None:
        allowed = "a distance in mm, not 0, at most 1000 either way"
        set_frozen(
            self,
            distance=real("distance", self.distance, allowed, lambda d: 0 < abs(d) <= 1000),
            steps=count("steps", self.steps),
            speed=_speed(self.speed),
            hold=choice("hold", self.hold, HOLDS),
        )


@dataclass(frozen=True)
class Hover:
    """Hold the bone so that the undeformed outline is `gap` (mm) off the surface: `indentation = -gap`.

    The tissue is free to move under the attraction. Going there takes no time.
    """

    gap: float
    steps: int = 1
    kind = "hover"

    def __post_init__(self) -> None:
        gap = real("gap", self.gap, "a gap in mm from 0 to 200", lambda g: 0 <= g <= 200)
        set_frozen(self, gap=gap, steps=count("steps", self.steps))


@dataclass(frozen=True)
class VoltageRamp:
    """Take the voltage (V) from its present value to `voltage` in `steps` equal parts.

    `hold` keeps the indentation or the applied force of the moment before.
    """

    voltage: float
    steps: int = 10
    hold: str = "indentation"
    kind = "voltage"

    def __post_init__(self) -> None:
        allowed = "a voltage in V between -1e6 and 1e6"
        voltage = real("voltage", self.voltage, allowed, lambda u: abs(u) <= 1e6)
        set_frozen(
            self, voltage=voltage, steps=count("steps", self.steps), hold=choice("hold", self.hold, HOLDS)
        )


Motion = Press | Slide | Hover | VoltageRamp

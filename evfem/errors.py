"""Exceptions of the package; an input error has the key, the value given and the admissible values.

The command line maps them to its exit status: `InputError` 2, `NotConverged` 3, `StorageError` 4.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import Enum
from typing import Any

#: most letters of a value, and of a text, in a message
LONGEST_VALUE, LONGEST_TEXT = 200, 500
#: letters after which no further mistake is told
LONGEST_LIST = 800
#: words that people try -> the keys and kinds that they may mean
MEANT = {
    "mu": "friction",
    "friction_coefficient": "friction",
    "tilt": "posture",
    "pitch": "ridge_width",
    "modulus": "E",
    "youngs_modulus": "E",
    "young": "E",
    "poisson": "nu",
    "load": "force",
    "depth": "indentation",
    "velocity": "speed",
    "length": "distance",
    "wavelength": "period terms",
    "amplitude": "terms",
    "thickness": "insulator_thickness",
    "eps_r": "insulator_eps_r",
    "permittivity": "insulator_eps_r eps_r",
    "roughness": "roughness_gap",
    "move": "slide",
    "sine": "sinusoid",
    **dict.fromkeys(("stratum_corneum", "epidermis", "dermis", "hypodermis", "skin"), "materials"),
}


class EvfemError(Exception):
    """Base of every exception that evfem raises on purpose."""


class Absent(Enum):
    """Marks a missing value; an enumeration, so that it is identical in every process."""

    ABSENT = "missing"


ABSENT = Absent.ABSENT


def readable(value: object) -> str:
    """A value as it is shown to the user: on one line, a text in quotes, cut to a readable length, an object
    without its address.

    >>> print(readable("two\\nlines"), len(readable([1.0] * 1000)), readable(object()))
    "two\\nlines" 200 <object object>
    """
    if isinstance(value, str):
        start = value[: LONGEST_VALUE + 1]  # a file of 4 MB may be one text
        return _cut(json.dumps(start, ensure_ascii=not start.isprintable()), LONGEST_VALUE)
    if isinstance(value, type):
        return f"the class {value.__name__}"
    try:
        said = re.sub(r" at 0x[0-9a-fA-F]+>", ">", repr(value))
        return _cut(re.sub(r"\bnp\.\w+\((.*?)\)", r"\1", said), LONGEST_VALUE)  # np.float64(1.0): 1.0
    except (ValueError, RecursionError):  # an integer of too many digits, lists in lists
        return f"{type(value).__name__} too large to show"


def describe_value(value: object) -> object:
    """A value of a user's for `InputError`, to which a text is words of ours unless it has quotes.

    >>> raise InputError("finger.width", describe_value("500"), "12 to 24 mm")
    Traceback (most recent call last):
    evfem.errors.InputError: finger.width: given "500"; allowed: 12 to 24 mm
    """
    return readable(value) if isinstance(value, str) else value


def _line(text: str) -> str:
    """A text on one line, cut to a readable length."""
    start = text[: LONGEST_TEXT + 1]
    return _cut("".join(c if c.isprintable() else ascii(c)[1:-1] for c in start), LONGEST_TEXT)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


class InputError(EvfemError, ValueError):
    """Invalid input: names the key, the value given and the admissible values.

    `given` is a value, or words (`quoted` makes a value of a text), or `ABSENT`. Of the names that are
    allowed, the one that a text may have meant comes first.

    >>> raise InputError("finger.width", -3.0, "a length between 1 and 200 mm")
    Traceback (most recent call last):
    evfem.errors.InputError: finger.width: given -3.0; allowed: a length between 1 and 200 mm
    >>> raise InputError("motion[0].speed", ABSENT, "a speed in mm/s")
    Traceback (most recent call last):
    evfem.errors.InputError: motion[0].speed: missing; allowed: a speed in mm/s
    """

    def __init__(self, key: str, given: object, allowed: str) -> None:
        if isinstance(given, str) and given[:1] == given[-1:] == '"' and "? (" not in allowed:
            names = [name for name in re.split(r" \| |, ", allowed) if " " not in name]
            close = closest_name(given[1:-1], names)
            if close and close[0] != given[1:-1] and len(close[0]) > 2:
                allowed = f"{close[0]}? ({allowed})"
        self.key, self.given, self.allowed = key, given, allowed
        said = _line(given) if isinstance(given, str) else readable(given)
        text = "missing" if given is ABSENT else f"given {said}"
        super().__init__(f"{_line(key)}: {text}; allowed: {allowed}")

    @property
    def mistakes(self) -> tuple[InputError, ...]:
        """This mistake, as one of those that were found together (`InputErrors`)."""
        return (self,)

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.key, self.given, self.allowed)


class InputErrors(InputError):
    """Several mistakes of one input, numbered; `key`, `given` and `allowed` are the first's."""

    def __init__(self, mistakes: Sequence[InputError]) -> None:
        first = mistakes[0]
        super().__init__(first.key, first.given, first.allowed)
        self._mistakes = tuple(mistakes)
        text = f"{len(mistakes)} mistakes:"
        for i, mistake in enumerate(mistakes, 1):
            if i > 1 and len(text) > LONGEST_LIST:
                text += f" and {len(mistakes) - i + 1} more"
                break
            text += f" ({i}) {mistake}"
        self.args = (text,)

    @property
    def mistakes(self) -> tuple[InputError, ...]:
        """All of them, in the order in which they were found."""
        return self._mistakes

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self._mistakes,)


def unknown(key: str, name: str, known: Sequence[str], what: str = "an unknown key") -> InputError:
    """The error for a name that does not exist, with the one that may have been meant.

    >>> raise unknown("surface.frictoin", "frictoin", ["kind", "friction"])
    Traceback (most recent call last):
    evfem.errors.InputError: surface.frictoin: given an unknown key; allowed: friction? (kind, friction)
    """
    close = closest_name(name, known)
    return InputError(key, what, f"{close[0]}? ({', '.join(known)})" if close else ", ".join(known))


def closest_name(name: str, known: Sequence[str]) -> list[str]:
    """The name that may have been meant, by its meaning or its letters, if there is one.

    >>> closest_name("tilt", ["width", "posture"]), closest_name("widht", ["width", "posture"])
    (['posture'], ['width'])
    >>> closest_name("depth", ["phase", "groove_depth"])
    ['groove_depth']
    >>> closest_name("fig3", ["fig13", "fig03"])
    ['fig03']
    """
    from difflib import get_close_matches

    if same := [one for one in known if _without_zeros(one) == _without_zeros(name)]:
        return same[:1]
    small = {one.lower(): one for one in known}
    if meant := [one for one in MEANT.get(name.lower(), "").split() if one in known]:
        return meant[:1]
    if len(parts := [one for one in known if name.lower() in one.split("_")]) == 1:
        return parts
    return [small[one] for one in get_close_matches(name[:40].lower(), small, n=1)]


def _without_zeros(name: str) -> str:
    """A name in small letters, its numbers without leading zeros."""
    return re.sub(r"(?<!\d)0+(?=\d)", "", name.lower())


def combine(mistakes: Sequence[InputError]) -> InputError:
    """One error for one mistake or several."""
    return InputErrors(mistakes) if len(mistakes) > 1 else mistakes[0]


class Mistakes:
    """Collects the mistakes of parts that can be judged apart, to report them at once.

    >>> mistakes = Mistakes()
    >>> for name, value in {"width": -3.0, "height": 12.0, "bone": "no"}.items():
    ...     with mistakes.of_a_part():
    ...         if value != 12.0:
    ...             raise InputError(name, describe_value(value), "12 mm")
    >>> mistakes.report()
    Traceback (most recent call last):
    evfem.errors.InputErrors: 2 mistakes: (1) width: given -3.0; allowed: 12 mm \
(2) bone: given "no"; allowed: 12 mm
    """

    def __init__(self) -> None:
        self.found: list[InputError] = []

    @contextmanager
    def of_a_part(self) -> Iterator[None]:
        """Keeps what is raised inside; what follows the raising line inside is left out."""
        try:
            yield
        except InputError as error:
            self.found += error.mistakes

    def report(self) -> None:
        """Raise what was found, if anything was, without the lines that found it."""
        if self.found:
            raise combine(self.found).with_traceback(None) from None


class NotConverged(EvfemError, RuntimeError):
    """A step was not solved; everything up to the last good step is kept in `result`.

    `step` counts from 1; `residuals` is the history of the last attempt (relative to the largest reaction).
    """

    def __init__(self, step: int, residuals: list[float], advice: str, result: object = None) -> None:
        self.step, self.residuals, self.advice, self.result = step, residuals, advice, result
        last = ", ".join(f"{r:.1e}" for r in residuals[-4:])
        tail = f" (last residuals: {last})" if last else ""
        super().__init__(f"step {step} did not converge{tail}; {advice}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.step, self.residuals, self.advice, self.result)


class Unresolved(EvfemError):
    """The finger's mesh does not resolve a field; inside a run it ends as `NotConverged`."""


class StopRun(EvfemError):
    """Raised by an observer's `step` to end a run after that step; the result so far is returned.

    The text says why, and stands in the result's provenance under `stopped`.
    """


class StorageError(EvfemError, OSError):
    """A file or folder could not be read or written; data written before are untouched."""

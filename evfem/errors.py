"""Exceptions of the package; each carries what was given and what is allowed.

The command line maps them to its exit status: `InputError` 2, `NotConverged` 3, `StorageError` 4.
"""

from __future__ import annotations

from typing import Any

#: most letters of a value, and of a text, in a message
LONGEST_VALUE, LONGEST_TEXT = 200, 500


class EvfemError(Exception):
    """Base of every exception that evfem raises on purpose."""


def readable(value: object) -> str:
    """A value as it is shown to the user: on one line, cut to a readable length.

    >>> readable("two\\nlines"), len(readable([1.0] * 1000))
    ("'two\\\\nlines'", 200)
    """
    try:
        return _cut(repr(value), LONGEST_VALUE)
    except (ValueError, RecursionError):  # an integer of too many digits, lists in lists
        return f"{type(value).__name__} too large to show"


def _line(text: str) -> str:
    """A text on one line, cut to a readable length."""
    start = text[: LONGEST_TEXT + 1]
    return _cut("".join(c if c.isprintable() else ascii(c)[1:-1] for c in start), LONGEST_TEXT)


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else text[: most - 3] + "..."


class InputError(EvfemError, ValueError):
    """Input that cannot be used: names the key, what was given and what is allowed.

    >>> raise InputError("finger.width", -3.0, "a length between 1 and 200 mm")
    Traceback (most recent call last):
    evfem.errors.InputError: finger.width: given -3.0; allowed: a length between 1 and 200 mm
    """

    def __init__(self, key: str, given: object, allowed: str) -> None:
        self.key, self.given, self.allowed = key, given, allowed
        text = _line(given) if isinstance(given, str) else readable(given)
        super().__init__(f"{_line(key)}: given {text}; allowed: {allowed}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.key, self.given, self.allowed)


class NotConverged(EvfemError, RuntimeError):
    """A step was not solved; everything up to the last good step is kept in `result`.

    `step` counts from 1; `residuals` is the history of the last attempt (relative to the largest
    reaction).
    """

    def __init__(self, step: int, residuals: list[float], advice: str, result: object = None) -> None:
        self.step, self.residuals, self.advice, self.result = step, residuals, advice, result
        tail = ", ".join(f"{r:.1e}" for r in residuals[-4:])
        super().__init__(f"step {step} did not converge (last residuals: {tail}); {advice}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.step, self.residuals, self.advice, self.result)


class StopRun(EvfemError):
    """Raised by an observer's `step` to end a run after that step; the result so far is returned.

    The text says why, and stands in the result's provenance under `stopped`.
    """


class StorageError(EvfemError, OSError):
    """A file or folder could not be read or written; data written before are untouched."""

"""Exceptions of the package; each carries what was given and what is allowed.

The command line maps them to its exit status: `InputError` 2, `NotConverged` 3, `StorageError` 4.
"""

from __future__ import annotations

from typing import Any


class EvfemError(Exception):
    """Base of every exception that evfem raises on purpose."""


class InputError(EvfemError, ValueError):
    """Input that cannot be used: names the key, what was given and what is allowed.

    >>> raise InputError("finger.width", -3.0, "a length between 1 and 200 mm")
    Traceback (most recent call last):
    evfem.errors.InputError: finger.width: given -3.0; allowed: a length between 1 and 200 mm
    """

    def __init__(self, key: str, given: object, allowed: str) -> None:
        self.key, self.given, self.allowed = key, given, allowed
        text = given if isinstance(given, str) else repr(given)
        super().__init__(f"{key}: given {text}; allowed: {allowed}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.key, self.given, self.allowed)


class NotConverged(EvfemError, RuntimeError):
    """A step was not solved; everything up to the last good step is kept in `result`.

    `step` counts from 1; `residuals` is the history of the last attempt (relative to the largest reaction).
    """

    def __init__(self, step: int, residuals: list[float], advice: str, result: object = None) -> None:
        self.step, self.residuals, self.advice, self.result = step, residuals, advice, result
        tail = ", ".join(f"{r:.1e}" for r in residuals[-4:])
        super().__init__(f"step {step} did not converge (last residuals: {tail}); {advice}")

    def __reduce__(self) -> tuple[Any, ...]:
        """For pickle, so that the error reaches another process."""
        return type(self), (self.step, self.residuals, self.advice, self.result)


class StorageError(EvfemError, OSError):
    """A file or folder could not be read or written; data written before are untouched."""

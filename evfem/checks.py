"""Checks of single values of a user's input; each returns the clean value or raises InputError."""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Integral, Real

from evfem.errors import InputError

MOST_STEPS = 1_000_000


def real(key: str, value: object, allowed: str, test: Callable[[float], bool] = lambda x: True) -> float:
    """`value` as a finite float that passes `test`.

    >>> real("gap", 1, "a gap in mm, not negative", lambda gap: gap >= 0)
    1.0
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(key, value, allowed)
    try:
        number = float(value)
    except OverflowError:  # an integer beyond all floats
        number = math.inf
    if not (math.isfinite(number) and test(number)):
        raise InputError(key, value, allowed)
    return number


def count(key: str, value: object, most: int = MOST_STEPS) -> int:
    """`value` as a whole number from 1 to `most`.

    >>> count("steps", 2.5)
    Traceback (most recent call last):
    evfem.errors.InputError: steps: given 2.5; allowed: a whole number from 1 to 1000000
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not 1 <= int(value) <= most:
        raise InputError(key, value, f"a whole number from 1 to {most}")
    return int(value)


def choice(key: str, value: object, names: tuple[str, ...]) -> str:
    """`value` if it is one of `names`."""
    if not isinstance(value, str) or value not in names:
        raise InputError(key, value, " | ".join(names))
    return value


def put(target: object, **values: object) -> None:
    """Store checked values in a frozen dataclass under construction."""
    for name, value in values.items():
        object.__setattr__(target, name, value)

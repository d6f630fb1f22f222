"""Checks of a user's input; each returns the clean value or raises InputError.

First checks of single values (`real`, `count`, `choice`), then of numbers or arrays of numbers
(`above`, `at_least`, `finite`), then rules that the fields of a dataclass carry and `check_fields`
applies.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any

import numpy as np

from evfem.errors import InputError, Mistakes, quoted

MOST_STEPS = 1_000_000
Values = Any  # a number, or an array of numbers: real, or complex in a complex step


def real(key: str, value: object, allowed: str, test: Callable[[float], bool] = lambda x: True) -> float:
    """`value` as a finite float that passes `test`.

    >>> real("gap", 1, "a gap in mm, not negative", lambda gap: gap >= 0)
    1.0
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        raise InputError(key, quoted(value), allowed)
    try:
        number = float(value)
    except OverflowError:  # an integer beyond all floats
        number = math.inf
    if not (math.isfinite(number) and test(number)):
        raise InputError(key, quoted(value), allowed)
    return number


def count(key: str, value: object, most: int = MOST_STEPS) -> int:
    """`value` as a whole number from 1 to `most`.

    >>> count("steps", 2.5)
    Traceback (most recent call last):
    evfem.errors.InputError: steps: given 2.5; allowed: a whole number from 1 to 1000000
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or not 1 <= int(value) <= most:
        raise InputError(key, quoted(value), f"a whole number from 1 to {most}")
    return int(value)


def choice(key: str, value: object, names: tuple[str, ...]) -> str:
    """`value` if it is one of `names`."""
    if not isinstance(value, str) or value not in names:
        raise InputError(key, quoted(value), " | ".join(names))
    return value


def plain(value: Values) -> Values:
    """A Python number for a single value, the array itself otherwise.

    >>> plain(np.array(2.5))
    2.5
    """
    return value.item() if isinstance(value, (np.ndarray, np.generic)) and value.ndim == 0 else value


def above(key: str, given: Values, lowest: float, allowed: str) -> Values:
    """`given` as float or array of floats, all finite and (by their real part) > `lowest`.

    >>> above("area", -1.0, 0.0, "an area in mm2 above zero")
    Traceback (most recent call last):
    evfem.errors.InputError: area: given -1.0; allowed: an area in mm2 above zero
    """
    value = finite(key, given, allowed)
    if not np.all(np.real(value) > lowest):
        raise InputError(key, _worst(given), allowed)
    return value


def at_least(key: str, given: Values, lowest: float, allowed: str) -> Values:
    """As `above`, with `lowest` itself allowed."""
    value = finite(key, given, allowed)
    if not np.all(np.real(value) >= lowest):
        raise InputError(key, _worst(given), allowed)
    return value


def finite(key: str, given: Values, allowed: str) -> Values:
    """`given` as float or array of floats (complex if it was), all finite."""
    try:
        value = np.asarray(given)
    except ValueError as error:  # rows of different length
        raise InputError(key, quoted(given), allowed) from error
    if value.dtype.kind not in "iufc" or not np.all(np.isfinite(value)):
        raise InputError(key, quoted(given), allowed)
    return plain(value * 1.0)


def _worst(given: Values) -> Values:
    """The smallest of the values, so that a long array does not flood the message."""
    return float(np.min(np.real(given)))


def set_frozen(target: object, **values: object) -> None:
    """Store checked values in a frozen dataclass under construction."""
    for name, value in values.items():
        object.__setattr__(target, name, value)


@dataclass(frozen=True)
class Within:
    """The test of a number from `low` to `high`; `low` itself is out where it is `above`, and 0
    where it is `not_zero`.

    >>> Within(0.0, 200.0)(0.0), Within(0.0, above=True)(0.0), Within(-1.0, 1.0, not_zero=True)(0.0)
    (True, False, False)
    """

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    not_zero: bool = False

    def __call__(self, value: float) -> bool:
        inside = (self.low < value if self.above else self.low <= value) and value <= self.high
        return inside and not (self.not_zero and value == 0.0)


def number(allowed: str, test: Callable[[float], bool]) -> dict[str, Any]:
    """Metadata of a field that is a finite float and passes `test`; `allowed` says so in words."""
    check = lambda key, value: real(key, value, allowed, test)  # noqa: E731
    return {"allowed": allowed, "check": check, "test": test}


def whole(most: int = MOST_STEPS) -> dict[str, Any]:
    """Metadata of a field that is a whole number from 1 to `most`."""
    check = lambda key, value: count(key, value, most)  # noqa: E731
    return {"allowed": f"a whole number from 1 to {most}", "check": check, "test": Within(1, most)}


def one_of(*names: str) -> dict[str, Any]:
    """Metadata of a field that is one of `names`."""
    check = lambda key, value: choice(key, value, names)  # noqa: E731
    return {"allowed": " | ".join(names), "check": check, "names": names}


def yes_or_no() -> dict[str, Any]:
    """Metadata of a field that is True or False."""
    return {"allowed": "true | false", "check": truth}


def truth(key: str, value: object) -> bool:
    """`value` if it is True or False."""
    if not isinstance(value, bool):
        raise InputError(key, quoted(value), "true | false")
    return value


def switch() -> dict[str, Any]:
    """Metadata of a field that is on or off."""
    return {"allowed": "true | false", "check": _on_or_off}


def _on_or_off(key: str, value: object) -> bool:
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(key, value, "true | false")
    return bool(value)


def check_fields(target: Any) -> None:
    """Check and store every field of a frozen dataclass that has a rule; a default None may stay
    None. All mistakes are reported at once.

    >>> from dataclasses import dataclass, field
    >>> @dataclass(frozen=True)
    ... class Hover:
    ...     gap: float = field(metadata=number("a gap in mm, not negative", lambda gap: gap >= 0))
    ...
    ...     def __post_init__(self):
    ...         check_fields(self)
    >>> Hover(1).gap
    1.0
    >>> Hover(-1)
    Traceback (most recent call last):
    evfem.errors.InputError: gap: given -1; allowed: a gap in mm, not negative
    """
    mistakes = Mistakes()
    for spec in fields(target):
        value = getattr(target, spec.name)
        if "check" in spec.metadata and not (value is None and spec.default is None):
            with mistakes.of_a_part():
                set_frozen(target, **{spec.name: spec.metadata["check"](spec.name, value)})
    mistakes.report()

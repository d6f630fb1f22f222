"""Observers for every day: what ends a run when enough is known."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping
from typing import Any

from evfem.common.checks import count
from evfem.errors import InputError, StopRun, describe_value
from evfem.simulation.history import COLUMNS, ROOM_COLUMNS, SPATIAL, Values, no_column

#: signs of a comparison, the longer ones first
SIGNS: Mapping[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    "==": operator.eq,
    ">": operator.gt,
    "<": operator.lt,
}
ALLOWED = 'a comparison of a column with a number, as "tangential_force >= 0.02", or a function of a row'
COMPARISON = re.compile(rf"\s*(\w+)\s*({'|'.join(SIGNS)})\s*(\S+)\s*")
NUMBERS = tuple(name for name in (*COLUMNS, *ROOM_COLUMNS, *SPATIAL) if name != "motion")


class StopWhen:
    """Observer that ends a run after the first step of which a condition is true.

    Parameters
    ----------
    condition
        A column of the history compared with a number: "tangential_force >= 0.02", "slip_share == 1"; in the
        plane forces are in N/mm. Or a function of the row, which is a mapping of the columns.
    motion
        Number of the motion, from 0, in which it counts; None: in all of them.

    Raises
    ------
    InputError
        Another condition, or a column that does not exist.

    Examples
    --------
    >>> stop = StopWhen("indentation > 0.3")
    >>> stop.step({"step": 2, "motion_index": 0, "indentation": 0.25})
    >>> stop.step({"step": 3, "motion_index": 0, "indentation": 0.5})
    Traceback (most recent call last):
    evfem.errors.StopRun: indentation > 0.3 in step 3
    """

    def __init__(
        self, condition: str | Callable[[Mapping[str, Any]], Any], motion: int | None = None
    ) -> None:
        self.motion = motion if motion is None else count("motion", motion, least=0)
        self.true = condition if callable(condition) else _comparison(condition)
        self.words = "a condition is met" if callable(condition) else " ".join(condition.split())

    def __repr__(self) -> str:
        where = "" if self.motion is None else f", motion={self.motion}"
        return f"StopWhen({self.words!r}{where})"

    def step(self, row: Mapping[str, Any], frame: Any = None, checkpoint: Any = None) -> None:
        """A step has converged: raise `StopRun` where the condition is true."""
        if self.motion in (None, row["motion_index"]) and self.true(Values(row)):
            raise StopRun(f"{self.words} in step {row['step']}")


def _comparison(text: Any) -> Callable[[Mapping[str, Any]], bool]:
    """The function of a row that a text says; nothing of it is evaluated as code."""
    found = COMPARISON.fullmatch(text) if isinstance(text, str) else None
    if found is None:
        raise InputError("condition", describe_value(text), ALLOWED)
    name, sign, number = found.groups()
    if name not in NUMBERS:
        raise no_column("condition", name, NUMBERS)
    try:
        value = float(number)
    except ValueError:
        raise InputError("condition", describe_value(text), ALLOWED) from None
    return lambda row: SIGNS[sign](float(row[name]), value)

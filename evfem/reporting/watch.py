"""Observers for every day: what ends a run when enough is known."""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from evfem.common.checks import count
from evfem.common.notices import warn
from evfem.errors import InputError, StopRun, describe_value, readable
from evfem.simulation.history import COLUMNS, ROOM_COLUMNS, SPATIAL, WIDTHS, Values, no_column

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
#: dimension -> columns of the other one, which this one has not or leaves empty, and where it is
ELSEWHERE: Mapping[int, tuple[Sequence[str], str]] = {2: (tuple(SPATIAL), "the plane"), 3: (WIDTHS, "space")}
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
        Another condition, a column that does not exist, or, as a run begins, one of the other dimension:
        `contact_area` in the plane, `contact_width` in space.

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
        found = ("", condition) if callable(condition) else _comparison(condition)
        self.column: str = found[0]
        self.true: Callable[[Mapping[str, Any]], Any] = found[1]
        self.words = "a condition is met" if callable(condition) else " ".join(condition.split())

    def __repr__(self) -> str:
        where = "" if self.motion is None else f", motion={self.motion}"
        return f"StopWhen({self.words!r}{where})"

    def started(self, mesh: Any, scene: Any = None, total_steps: int = 0) -> None:
        """A run begins: raise InputError where its finger has not the column."""
        _there(self.column, mesh.dim)

    def step(self, row: Mapping[str, Any], frame: Any = None, checkpoint: Any = None) -> None:
        """A step has converged: raise `StopRun` where the condition is true."""
        dimension = 3 if "position_z" in row else 2
        _there(self.column, dimension)
        try:
            met = self.motion in (None, row["motion_index"]) and self.true(Values(row))
        except KeyError as error:  # of a function
            for name in error.args[:1]:
                _there(name, dimension)
            raise
        if met:
            raise StopRun(f"{self.words} in step {row['step']}")

    def finished(self, result: Any) -> None:
        """The run has reached its end: a warning if the column had no value in any step that counts."""
        counts = result.motion_index == self.motion if self.motion is not None else result.step > 0
        if self.column and counts.any() and not np.isfinite(result[self.column][counts]).any():
            warn(f"{self!r} could not stop the run: {self.column} was empty in every step that counts")


def _there(name: Any, dimension: int) -> None:
    """InputError for a column of the other dimension, with one of this that is like it."""
    others, where = ELSEWHERE[dimension]
    if name in others:
        likely = no_column("condition", name, [one for one in NUMBERS if one not in others]).allowed
        raise InputError("condition", f"{readable(name)}, no column of a finger in {where}", likely)


def _comparison(text: Any) -> tuple[str, Callable[[Mapping[str, Any]], bool]]:
    """The column, and the function of a row that a text says; nothing of it is evaluated as code."""
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
    return name, lambda row: SIGNS[sign](float(row[name]), value)

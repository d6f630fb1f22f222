"""Limits of the step control: lengths of substeps and numbers of their iterations.

A step is first tried as one substep; a substep that fails is halved, and after easy ones substeps grow again.
If short substeps fail too, the next equilibrium is sought by pseudo-transient continuation, called release
(`evfem.solver.relaxation`). With steps "auto" the error of step doubling controls the length of substeps
(`evfem.solver.path`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evfem.common.checks import Within, check_fields, number, one_of, whole, yes_or_no
from evfem.common.constants import FALLING, STUCK

_COUNT = whole(10_000)
_PATIENCE = number("a number of iterations, not negative", Within(0.0))
_PART = number("a fraction of a step, above 0, at most 1", Within(0.0, 1.0, above=True))
_GROWTH = number("a factor from 1 to 10", Within(1.0, 10.0))
_ERROR = number("a fraction of a force, above 0, at most 1", Within(0.0, 1.0, above=True))
_RATE = number("a rate, larger than 0, at most 1e3", Within(0.0, 1e3, above=True))
_REACH = number("a factor from 0 to 10", Within(0.0, 10.0))


@dataclass(frozen=True)
class Strategy:
    """How hard steps are tried; the defaults need no tuning in any scene of `evfem study stability`.

    >>> Strategy().iterations, Strategy(growth=2.0).growth
    (40, 2.0)
    >>> Strategy(smallest_part=2.0)
    Traceback (most recent call last):
    evfem.errors.InputError: smallest_part: given 2.0; allowed: a fraction of a step, above 0, at most 1
    """

    iterations: Annotated[
        int, _COUNT, "most Newton iterations of a substep; half as many again if the end is near"
    ] = 40
    patience: Annotated[float, _PATIENCE, "iterations with a kept factorisation before it is renewed"] = 8.0
    smallest_part: Annotated[
        float, _PART, "smallest substep relative to what is left of a step; its square where time passes"
    ] = 1.0 / 1024.0
    easy: Annotated[int, _COUNT, "iterations of a substep after which the next one may be longer"] = 8
    growth: Annotated[float, _GROWTH, "factor by which a substep may be longer than the last one"] = 1.25
    reach: Annotated[
        float, _REACH, "predictor: so many of the last displacement increments ahead, 0: none"
    ] = 1.5
    hold: Annotated[
        float, _RATE, "first rate of drag continuation, where iterations came over an energy barrier"
    ] = 16.0
    relaxation: Annotated[bool, yes_or_no(), "pseudo-transient continuation where no equilibrium is near"] = (
        True
    )
    steps: Annotated[
        str,
        one_of("given", "auto"),
        "one substep each unless it fails, or substeps by the step error",
    ] = "given"
    path_error: Annotated[
        float, _ERROR, "step error of a substep, with steps = auto, relative to the force on the bone"
    ] = 1e-3

    def __post_init__(self) -> None:
        check_fields(self)


def stuck(history: Sequence[float]) -> bool:
    """Whether iterations with these residuals or changes (i,) stagnate: the last `STUCK` of them, after
    as many before, have none below `FALLING` times the least of those before.

    >>> stuck([0.5**i for i in range(30)]), stuck([1e-3, 2e-4] * 4), stuck([1e-3, 2e-4] * 9)
    (False, False, True)
    """
    return len(history) > 2 * STUCK and min(history[-STUCK:]) >= FALLING * min(history[:-STUCK])

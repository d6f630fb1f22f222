"""How hard steps are tried: the numbers behind globalisation and adaptive parts, all in one place.

A step is one equilibrium from one accepted state to the next. It is tried whole first. Where it
fails, it is cut into parts: half as long after each failure, longer again after easy ones. What
makes the iterations of one part hold is not a choice: contact is solved exactly in each of them,
cells cannot collapse, an attraction that the body cannot hold is followed in small moves or snaps,
and under a force the bone moves by limited strides. Where short parts fail too, stability is lost:
the finger is released and comes to rest at another equilibrium (`evfem.solver.relaxation`); if it
does not, still shorter parts are tried. What happens on the way needs physics instead: `dynamics`
"viscous" or "inertial" with a speed.

With steps "auto" the parts are as long as the error of the path allows (`evfem.solver.path`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

from evfem.common.checks import Within, check_fields, number, one_of, whole, yes_or_no
from evfem.common.constants import FALLING, LONGEST_CIRCLE, SAME, STUCK, WEAKENED

_COUNT = whole(10_000)
_PATIENCE = number("a number of iterations, not negative", Within(0.0))
_PART = number("a share of a step, above 0, at most 1", Within(0.0, 1.0, above=True))
_GROWTH = number("a factor from 1 to 10", Within(1.0, 10.0))
_ERROR = number("a share of a force, above 0, at most 1", Within(0.0, 1.0, above=True))
_REACH = number("a factor from 0 to 10", Within(0.0, 10.0))


@dataclass(frozen=True)
class Strategy:
    """How hard steps are tried; the defaults need no tuning in any scene of `evfem study stability`.

    >>> Strategy().iterations, Strategy(growth=2.0).growth
    (40, 2.0)
    >>> Strategy(smallest_part=2.0)
    Traceback (most recent call last):
    evfem.errors.InputError: smallest_part: given 2.0; allowed: a share of a step, above 0, at most 1
    """

    iterations: Annotated[
        int, _COUNT, "most of one part of a step; half as many again if the end is near"
    ] = 40
    patience: Annotated[float, _PATIENCE, "iterations with an old factorisation before it is renewed"] = 8.0
    smallest_part: Annotated[
        float,
        _PART,
        "of what is left of a step before it counts as not converged; its square if time passes",
    ] = 1.0 / 1024.0
    easy: Annotated[int, _COUNT, "iterations of a part after which the next one may be longer"] = 8
    growth: Annotated[float, _GROWTH, "by which factor"] = 1.25
    reach: Annotated[
        float, _REACH, "first guess: so many of the last part's displacements ahead, 0: none"
    ] = 1.5
    relaxation: Annotated[bool, yes_or_no(), "whether a finger without an equilibrium near is released"] = (
        True
    )
    steps: Annotated[
        str,
        one_of("given", "auto"),
        "one part each unless it fails, or parts as the error of the path allows",
    ] = "given"
    path_error: Annotated[float, _ERROR, "of a part, with steps = auto: a share of the force on the bone"] = (
        1e-3
    )

    def __post_init__(self) -> None:
        check_fields(self)


def stuck(history: Sequence[float], weakened: int = 0) -> bool:
    """Whether more iterations with these residuals or changes (i,) are in vain, where a shorter part
    ends soon: they come round in a circle, or the last ones are hardly below those before. Where
    so many contact problems were `weakened`, fewer are enough.

    >>> stuck([1e-3, 2e-4] * 4), stuck([0.5**i for i in range(30)])
    (False, False)
    >>> stuck([1e-3, 2e-4] * 5), stuck([1.0, 0.02, 0.05, 0.03, 0.07] + [0.02 + 1e-3 * i for i in range(12)])
    (True, True)
    >>> stuck([1e-1, 4e-3, 5e-3, 4e-3, 5e-3], weakened=2), stuck([1e-1, 4e-3, 5e-3, 4e-3, 5e-3], weakened=3)
    (False, True)
    """
    if any(_circle(history, period) for period in range(1, LONGEST_CIRCLE + 1)):
        return True
    last, least = (WEAKENED, WEAKENED + 1) if weakened >= WEAKENED else (STUCK, 2 * STUCK)
    return len(history) > least and min(history[-last:]) >= FALLING * min(history[:-last])


def _circle(history: Sequence[float], period: int) -> bool:
    """Whether the last residuals (i,), at least `STUCK`, are those one period before; a bone that is
    still on its way, 1 or more, is none.
    """
    count = max(2 * period, STUCK)
    if len(history) < count + period:
        return False
    last, before = history[-count:], history[-count - period : -period]
    return all(b < 1.0 and abs(a - b) <= SAME * a for a, b in zip(last, before, strict=True))

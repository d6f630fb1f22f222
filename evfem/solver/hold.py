r"""Drag continuation: follow the branch of equilibria that begins at the last state, where iterations have
jumped off it.

Iterations of the static problem may converge to an equilibrium behind a barrier (`evfem.solver`, which of
several states). Then the substep is solved again with artificial drag, proportional to the displacements
from the old state, whose rate is lowered until it vanishes (`held`)::

    rate <- the strategy's `hold`; last <- none; iterations begin at the old state, without extrapolation
    until the rate is below `SMALLEST_RATE`:
        new <- the equilibrium at the target with drag of this rate from the old state, found from `last`
        not found, or behind a barrier from `last`:
            no last: rate <- `RATE_FACTOR` rate; else the geometric mean with the last rate; if that is
            within `SMALLEST_RATIO` of it, the branch ends and the substep fails
        else: last <- new, rate <- rate / `RATE_FACTOR`
    new <- the equilibrium without drag, found from `last`; behind a barrier, the substep fails

Friction is counted from the old state too. Only the drag's rate over the substep enters, no time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evfem.newton.control import Target
from evfem.newton.state import State, StepFailed
from evfem.tissue.body import Body

#: largest and smallest rate of drag, the factor by which it changes, smallest ratio of two rates tried
LARGEST_RATE, SMALLEST_RATE, RATE_FACTOR, SMALLEST_RATIO = 1e4, 1e-3, 4.0, 1.05


def held(
    body: Body, reach: Callable[[State, Target, State], State], rate: float, state: State, target: Target
) -> State:
    """The equilibrium of `body` at `target` on the branch that begins at `state`, by drag continuation from
    this `rate`; `reach(old, target, start)` raises `StepFailed` behind a barrier, as does this function where
    the branch ends.
    """
    last, last_rate = replace(state, last_increment=np.zeros_like(state.last_increment)), 0.0
    try:
        while not 0.0 < last_rate <= SMALLEST_RATE:
            body.release(state.u, rate)
            try:
                last = reach(state, target, last)
            except StepFailed:
                rate = RATE_FACTOR * rate if last_rate == 0.0 else float(np.sqrt(last_rate * rate))
                if rate > LARGEST_RATE or (last_rate > 0.0 and last_rate < SMALLEST_RATIO * rate):
                    raise
                continue
            last_rate, rate = rate, rate / RATE_FACTOR
    finally:
        body.release(state.u, 0.0)
    return reach(state, target, last)

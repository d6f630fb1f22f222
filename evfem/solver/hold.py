r"""The branch of equilibria that begins at the last state, where iterations have jumped off it.

Iterations of the static problem may come to an equilibrium behind a barrier (`evfem.solver`, which of
several states). Then the part is solved again, held by drag that counts from the old state, as does
friction, and is taken away bit by bit (`held`)::

    rate <- the strategy's `hold`; last <- none; iterations begin at the old state, without extrapolation
    until the rate is below `LEAST`:
        new <- the equilibrium at the target with drag of this rate from the old state, found from `last`
        not found, or behind a barrier from `last`:
            no last: rate <- `FALL` rate; else the geometric mean with the last rate, and no further if
            that is within `STUCK` of it: the branch ends, the part fails
        else: last <- new, rate <- rate / `FALL`
    new <- the equilibrium without drag, found from `last`; behind a barrier, the part fails

Only the drag's rate over the part enters, no time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from evfem.newton.control import Target
from evfem.newton.state import State, StepFailed
from evfem.tissue.body import Body

#: the largest rate of drag and the least, by how much it falls, and when it falls no further
MOST, LEAST, FALL, STUCK = 1e4, 1e-3, 4.0, 1.05


def held(
    body: Body, reach: Callable[[State, Target, State], State], rate: float, state: State, target: Target
) -> State:
    """The equilibrium of `body` at `target` on the branch that begins at `state`, held at first by drag of
    this `rate`; `reach(old, target, start)` raises `StepFailed` behind a barrier, as this does where the
    branch ends.
    """
    last, before = replace(state, last_increment=np.zeros_like(state.last_increment)), 0.0
    try:
        while not 0.0 < before <= LEAST:
            body.release(state.u, rate)
            try:
                last = reach(state, target, last)
            except StepFailed:
                rate = FALL * rate if before == 0.0 else float(np.sqrt(before * rate))
                if rate > MOST or (before > 0.0 and before < STUCK * rate):
                    raise
                continue
            before, rate = rate, rate / FALL
    finally:
        body.release(state.u, 0.0)
    return reach(state, target, last)

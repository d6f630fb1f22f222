r"""The branch of equilibria that begins at the last state, where iterations have jumped off it.

Iterations of the static problem may come to an equilibrium behind a barrier (`evfem.solver`, which of
several states). Then the part is solved again, held by drag that counts from the old state, as does
friction, and is taken away bit by bit (`Hold.follow`)::

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
from dataclasses import dataclass, replace

import numpy as np

from evfem.newton.control import Target
from evfem.newton.state import State, StepFailed
from evfem.tissue.body import Body

#: the largest rate of drag and the least, by how much it falls, and when it falls no further
MOST, LEAST, FALL, STUCK = 1e4, 1e-3, 4.0, 1.05


@dataclass
class Hold:
    """Holds `body`: `reach(old, target, start)` raises `StepFailed` behind a barrier; `first` drag rate."""

    body: Body
    reach: Callable[[State, Target, State], State]
    first: float

    def follow(self, state: State, target: Target) -> State:
        """The equilibrium at `target` on the branch that begins at `state`; raises where that ends."""
        last = replace(state, last_increment=np.zeros_like(state.last_increment))
        rate, before = self.first, 0.0
        try:
            while not 0.0 < before <= LEAST:
                self.body.release(state.u, rate)
                try:
                    last = self.reach(state, target, last)
                except StepFailed:
                    rate = FALL * rate if before == 0.0 else float(np.sqrt(before * rate))
                    if rate > MOST or (before > 0.0 and before < STUCK * rate):
                        raise
                    continue
                before, rate = rate, rate / FALL
        finally:
            self.body.release(state.u, 0.0)
        return self.reach(state, target, last)

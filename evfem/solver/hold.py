r"""The branch of equilibria that begins at the last state, where iterations have jumped off it.

The answer of a step is the limit of vanishing drag: the finger moves along the branch that begins at the
last state, and snaps only where that branch ends [1]_ [2]_. Iterations of the static problem may come
to an equilibrium behind a barrier, which the potential with the loads of the end shows
(`evfem.simulation.barrier`). Then the part is solved again, held by drag that counts from the old state,
as does friction, and is taken away bit by bit (`Hold.follow`)::

    rate <- the strategy's `hold`; last <- none; iterations begin at the old state, without extrapolation
    until the rate is below `LEAST`:
        new <- the equilibrium at the target with drag of this rate from the old state, found from `last`
        not found, or behind a barrier from `last`:
            no last: rate <- `FALL` rate; else the geometric mean with the last rate, and no further if
            that is within `STUCK` of it: the branch ends, the part fails
        else: last <- new, rate <- rate / `FALL`
    new <- the equilibrium without drag, found from `last`; behind a barrier, the part fails

Only the drag's rate over the part enters, no time. With another first rate or factor the ends are the
same to the digits that iterations leave.

.. [1] M. A. Efendiev, A. Mielke, J. Convex Anal. 13 (2006) 151 (vanishing viscosity).
.. [2] L. Minotti, G. Savare, Arch. Ration. Mech. Anal. 227 (2018) 477, doi:10.1007/s00205-017-1165-5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from evfem.solver.control import Target
from evfem.solver.state import State, StepFailed
from evfem.tissue.body import Body

#: why an equilibrium is refused that lies behind a barrier
BARRIER = "the equilibrium that was found lies behind a barrier, which the finger would not climb"
#: the largest rate of drag and the least, by how much it falls, and when it falls no further
MOST, LEAST, FALL, STUCK = 1e4, 1e-3, 4.0, 1.05


@dataclass
class Hold:
    """Holds `body`; `find(old, target, start)` finds the equilibrium at a target, drag included, and
    `climbs(old, new)` says whether it lies behind a barrier; `first` is the first rate of the drag.
    """

    body: Body
    find: Callable[[State, Target, State], State]
    climbs: Callable[[State, State], bool]
    first: float

    def follow(self, state: State, target: Target) -> State:
        """The equilibrium at `target` on the branch that begins at `state`; raises `StepFailed` where that
        branch ends.
        """
        try:
            return self._follow(state, target)
        finally:
            self.body.release(state.u, 0.0)

    def _follow(self, state: State, target: Target) -> State:
        last = replace(state, last_increment=np.zeros_like(state.last_increment))
        rate, before = self.first, 0.0
        while not 0.0 < before <= LEAST:
            self.body.release(state.u, rate)
            try:
                new = self._found(state, target, last)
            except StepFailed:
                rate = FALL * rate if before == 0.0 else float(np.sqrt(before * rate))
                if rate > MOST or (before > 0.0 and before < STUCK * rate):
                    raise
                continue
            last, before, rate = new, rate, rate / FALL
        self.body.release(state.u, 0.0)
        return self._found(state, target, last)

    def _found(self, state: State, target: Target, last: State) -> State:
        new = self.find(state, target, last)
        if self.climbs(last, new):
            raise StepFailed(BARRIER, [])
        return new

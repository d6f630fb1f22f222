r"""Anderson's acceleration of iterations that use one factorisation for several steps.

An iteration with an older tangent is a fixed-point map, x -> g(x), that contracts slowly along the
few directions in which the tangent has changed. With the steps :math:`r_k = g(x_k) - x_k` of the
last iterations, the next iterate is the affine combination

.. math:: x_{k+1} = g_k - \sum_j \theta_j\,(g_{k-j+1} - g_{k-j}), \qquad
          \theta = \arg\min \| r_k - \sum_j \theta_j\,(r_{k-j+1} - r_{k-j}) \| .

Closed gaps, stick and slipping shear forces are linear relations between displacements and forces,
so a combination obeys them too as long as no status has changed. Source: D. G. Anderson, J. ACM 12
(1965) 547, doi:10.1145/321296.321305.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import ANDERSON_DEPTH, KILOVOLT
from evfem.solver.state import State


class Anderson:
    """Remembers the last iterations of a step, as long as they used the same map."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the iterations: the map has changed."""
        self._steps: list[Floats] = []
        self._images: list[Floats] = []

    def next_iterate(self, before: State, after: State) -> State:
        """A better iterate than `after`, to which the map has taken `before`; `after` itself while
        nothing is known of the map, or where a node has changed its status.
        """
        if not np.array_equal(before.status, after.status):
            self.reset()
            return after
        image = _vector(after)
        self._steps = [*self._steps[-ANDERSON_DEPTH:], (after.u - before.u).ravel()]
        self._images = [*self._images[-ANDERSON_DEPTH:], image]
        if len(self._steps) < 2:
            return after
        changes = np.diff(self._steps, axis=0)
        shares = np.linalg.lstsq(changes @ changes.T, changes @ self._steps[-1], rcond=1e-12)[0]
        return _state(after, image - shares @ np.diff(self._images, axis=0))


def _vector(state: State) -> Floats:
    squared = (state.voltage / KILOVOLT) ** 2
    parts = (state.u, state.contact_force, state.bone, state.pressure)
    return np.concatenate([*(part.ravel() for part in parts), [squared]])


def _state(state: State, vector: Floats) -> State:
    sizes = [state.u.size, state.contact_force.size, state.bone.size, state.pressure.size]
    u, force, bone, pressure, squared = np.split(vector, np.cumsum(sizes))
    return replace(
        state,
        u=u.reshape(state.u.shape),
        contact_force=force.reshape(state.contact_force.shape),
        bone=bone,
        pressure=pressure.reshape(state.pressure.shape),
        voltage=KILOVOLT * float(np.sqrt(max(squared[0], 0.0))),
    )

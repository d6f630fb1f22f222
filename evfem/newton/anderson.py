r"""Anderson's acceleration of iterations with an older tangent.

An iteration with an older tangent is a fixed-point map, x -> g(x), that contracts slowly along the
few directions in which the tangent has changed. With the steps :math:`r_k = g(x_k) - x_k` of the
last iterations, the next iterate is the affine combination

.. math:: x_{k+1} = g_k - \sum_j \theta_j\,(g_{k-j+1} - g_{k-j}), \qquad
          \theta = \arg\min \| r_k - \sum_j \theta_j\,(r_{k-j+1} - r_{k-j}) \| .

New tangents in iterations one after the other give maps that differ little: their iterates are combined
too. Closed gaps, stick and slipping shear forces are linear relations between displacements and forces,
so a combination obeys them as long as no status has changed. Source: D. G. Anderson, J. ACM 12 (1965)
547, doi:10.1145/321296.321305.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import ANDERSON_DEPTH, KILOVOLT
from evfem.newton.state import State

#: fields of a state that are combined, beside the squared voltage and the memory that iterations change
MIXED = ("u", "contact_force", "bone")


class Anderson:
    """Remembers a step's last iterations under one map: changes of steps and images."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = MIXED
        self.reset()

    def reset(self) -> None:
        """Forget the iterations: the map has changed."""
        self._last: tuple[Floats, Floats] | None = None
        self._changes: list[tuple[Floats, Floats]] = []

    def next_iterate(self, before: State, after: State) -> State:
        """A better iterate than `after`, the image of `before`; `after` itself while the map is unknown."""
        if not np.array_equal(before.status, after.status):
            self.reset()
            return after
        names = (*self._names, *(name for name in mixed(before, after) if name not in self._names))
        if names != self._names:  # an iteration may keep what another changes
            self.reset()
        self._names = names
        step, image = (after.u - before.u).ravel(), _vector(after, names)
        last, self._last = self._last, (step, image)
        if last is None:
            return after
        self._changes = [*self._changes, (step - last[0], image - last[1])][-ANDERSON_DEPTH:]
        steps, images = (np.stack(each) for each in zip(*self._changes, strict=True))
        theta = np.linalg.lstsq(steps @ steps.T, steps @ step, rcond=1e-12)[0]
        return _state(after, image - theta @ images, names)


def mixed(before: State, after: State) -> tuple[str, ...]:
    """Names of the memory of a state that an iteration has changed."""
    changed = (name for name, one in after.memory.items() if one is not before.memory[name])
    return tuple(f"memory.{name}" for name in changed)


def _vector(state: State, names: tuple[str, ...]) -> Floats:
    squared, values = np.copysign((state.voltage / KILOVOLT) ** 2, state.voltage), state.parts
    return np.concatenate([*(values[name].ravel() for name in names), [squared]])


def _state(state: State, vector: Floats, names: tuple[str, ...]) -> State:
    values = [state.parts[name] for name in names]
    *combined, (signed,) = np.split(vector, np.cumsum([value.size for value in values]))
    changed: dict[str, Any] = {
        n: one.reshape(value.shape) for n, one, value in zip(names, combined, values, strict=True)
    }
    squared = max(np.copysign(1.0, state.voltage) * signed, 0.0)
    voltage = float(np.copysign(KILOVOLT * np.sqrt(squared), state.voltage))
    return replace(state.with_parts(changed), voltage=voltage)

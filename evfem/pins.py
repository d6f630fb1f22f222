"""Nodes that a jump of the friction coefficient holds back.

A node slides up to a jump to higher friction and stays there, its shear force growing from the lower to the
higher limit, before it slides on. Taken at the node's own x the coefficient then has no consistent value on
either side: the iterations put the node before the jump, behind it, before it again. Such a node is pinned to
the jump, a hair inside the rougher side, where it sticks with the higher coefficient. It is released when its
shear force falls below the lower limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.mesh import Floats

#: how far inside the rougher side a node is pinned (mm): far above rounding, far below any mesh
HAIR = 1e-9
#: so many changes of side in one step show that neither side is consistent
CHANGES = 3


class Pins:
    """Which pad nodes (P,) are held at which jump during one step; `x` (P,) is nan for free nodes."""

    def __init__(self, jumps: Floats, size: int) -> None:
        """`jumps` (J, 3): position, coefficient before and behind."""
        self.jumps, self.size = jumps, size
        self.begin(np.zeros(size))

    def begin(self, x: Floats) -> None:
        """Forget everything: a new step starts with the nodes at x."""
        self.x = np.full(self.size, np.nan)
        self.lower = np.zeros(self.size)
        if len(self.jumps):
            self._side = np.searchsorted(self.jumps[:, 0], x, side="right")
            self._changes = np.zeros(self.size, dtype=np.int64)
            self._released = np.zeros(self.size, dtype=bool)

    @property
    def held(self) -> Any:
        """Which nodes are pinned (P,) bool."""
        return np.isfinite(self.x)

    def watch(self, x: Floats, touching: Any) -> None:
        """Look at the next iterate: count changes of side, and pin what keeps changing."""
        if not len(self.jumps):
            return
        side = np.searchsorted(self.jumps[:, 0], x, side="right")
        moved = touching & (side != self._side) & ~self._released
        self._changes += moved
        new = np.flatnonzero(moved & (self._changes >= CHANGES) & ~self.held)
        place, before, behind = self.jumps[np.maximum(side, self._side)[new] - 1].T
        self.x[new] = place + np.where(behind > before, HAIR, -HAIR)
        self.lower[new] = np.minimum(before, behind)
        self._side = side

    def release(self, normal: Floats, shear: Floats, weak: float) -> bool:
        """Let go of nodes whose shear force is below the lower limit; says whether there were any."""
        loose = self.held & (np.abs(shear) < self.lower * normal - weak)
        self.x[loose] = np.nan
        if loose.any():
            self._released |= loose
        return bool(loose.any())

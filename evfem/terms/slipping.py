r"""Nodes whose status or speed oscillates under a law of friction in the iterations of one step.

The contact problem has the tangent of a law at the iterate. If the law rises steeply from rest and levels
off, or has a kink, Newton's iterations may cycle: a node returns to an earlier speed. The root is then
bracketed with the values of the law found so far (`OscillatingNodes`).

At no force a law may be far steeper than under the next one: the bound of a `SlipMemory` is S, but no more
than 20 p. With the tangent there a node that closes again would wedge, lift its neighbour off, and so on from
node to node: it begins with the tangent from before it opened.

A node that its own friction T presses, N = N_0 + k T with 20 k > 1 and N_0 < 0, has the solutions T = S,
the unstable T = 20 N and open. Beyond :math:`S (k - 1/20) = |N_0|` only open is left, while the iterates go
to and fro between both tangents: a node that comes from one to the other a second time begins open.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import BACK, NEAR
from evfem.contact.signorini import FORWARD, OPEN, STICK
from evfem.protocols import FrictionLaw
from evfem.surface.friction import Linearised, Slipping

#: of an interval of speeds: to the last digit of a double
HALVINGS = 60


class OscillatingNodes:
    """Nodes that have slipped and stick again, or whose speed oscillates: `nodes` (P,) bool. The tangent of
    such a law, extrapolated to rest, overestimates static friction. The node is placed at the speed at which
    the law gives its present force, with the tangent there, or, if it sticks under more than static friction,
    with the chord from rest. If no speed so far gives that force, a slipping node has the steepest of chord,
    tangent and last slope, near the end the tangent; a sticking node has the last slope.
    """

    def __init__(self, size: int) -> None:
        self.nodes = np.zeros(size, dtype=bool)
        self._slipped = np.zeros(size, dtype=bool)
        self._speed, self._change = np.full(size, np.nan), np.zeros(size)
        self._slope, self._slip = np.zeros(size), np.full(size, np.nan)
        self._fastest, self._capped = np.zeros(size), np.zeros((2, size), dtype=bool)
        self._tangent = np.full((2, size), np.nan)

    def linearised(
        self, law: FrictionLaw, moving: Slipping, c: Ints, status: Ints, force: Floats
    ) -> Linearised:
        """The law linearised for nodes c (k,) at an iterate with statuses and shear forces (k,)."""
        found = self._bracketed(law, moving, c, status, force)
        was, now = self._tangent[:, c], np.array([found.slope, found.offset])
        self._tangent[:, c] = now = np.where((status == OPEN) & ~np.isnan(was), was, now)
        return replace(found, slope=now[0], offset=now[1])

    def wedges(self, law: FrictionLaw, moving: Slipping, c: Ints, status: Ints) -> Any:
        """Which nodes c (k,) come a second time from their bound to the most that their pressure bears."""
        now = moving.capped(law) & (status >= FORWARD)
        came, returned = self._capped[1, c], now & ~self._capped[0, c]
        self._capped[:, c] = now, came ^ returned
        return came & returned

    def _bracketed(
        self, law: FrictionLaw, moving: Slipping, c: Ints, status: Ints, force: Floats
    ) -> Linearised:
        """The same with the roots bracketed of nodes that oscillate."""
        self.watch(c, status, moving.speed)
        self._fastest[c] = np.maximum(self._fastest[c], moving.speed)
        here = moving.linearised(law)
        here = replace(here, by_speed=self.slopes(c, moving.speed, here.by_speed, moving.chord(law)))
        back = self.nodes[c] & (status != OPEN)
        if not back.any():
            return here
        speed = speed_under(law, moving, force, np.where(back, self._fastest[c], 0.0))
        there = replace(moving, speed=speed)
        tangent, bound = there.linearised(law), there.bound(law)
        sticks, slips = (speed > 0.0) & (status == STICK), (speed > 0.0) & (status >= FORWARD)
        # the bound extrapolated by the tangent to the present speed, relative to the bound there
        ratio = 1.0 + tangent.by_speed * (moving.speed - speed) / np.where(slips, bound, 1.0)
        slips &= (ratio > 0.0) & (tangent.by_speed > 0.0)
        return Linearised(
            np.where(slips, ratio * tangent.slope, here.slope),
            np.where(slips, ratio * tangent.offset, here.offset),
            np.select([slips, sticks], [tangent.by_speed, there.chord(law)], here.by_speed),
            np.where(slips, ratio * tangent.by_mu, here.by_mu),
        )

    def watch(self, c: Ints, status: Ints, speed: Floats) -> None:
        """Records statuses (k,) and speeds (k,) of the nodes c (k,) at an iterate."""
        self.nodes[c] |= self._slipped[c] & (status == STICK)
        self._slipped[c] |= status >= FORWARD
        change = np.where(status >= FORWARD, speed - self._speed[c], 0.0)
        self.nodes[c] |= change * self._change[c] < -BACK * self._change[c] ** 2
        self._speed[c] = np.where(status >= FORWARD, speed, np.nan)
        self._change[c] = np.nan_to_num(change)

    def slopes(self, c: Ints, slip: Floats, tangent: Floats, chord: Floats) -> Floats:
        """Slopes (k,) of friction by the slip of nodes c (k,), at slips (k,); 0 where they stick."""
        near = np.abs(slip - self._slip[c]) < NEAR * np.abs(slip)
        steepest = np.maximum(np.maximum(chord, tangent), self._slope[c])
        slope = np.where(self.nodes[c] & ~near, steepest, tangent)
        slips = slip != 0.0
        self._slip[c] = slip
        self._slope[c] = np.where(slips & (slope > 0.0), slope, self._slope[c])
        return np.where(slips, slope, np.where(self.nodes[c], self._slope[c], 0.0))


def speed_under(law: FrictionLaw, nodes: Slipping, force: Floats, fastest: Floats) -> Floats:
    """Speeds (k,) in mm/s, up to `fastest` (k,), of friction `force` (k,) in N/mm, by bisection; else 0."""
    low, high = np.zeros_like(force), np.array(fastest)
    within = (replace(nodes, speed=low).bound(law) < force) & (replace(nodes, speed=high).bound(law) >= force)
    for _ in range(HALVINGS if within.any() else 0):
        middle = 0.5 * (low + high)
        below = replace(nodes, speed=middle).bound(law) < force
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where(within, high, 0.0)

r"""Nodes that go to and fro under a law of friction, in the iterations of one step.

The contact problem takes a law by its tangent at the iterate. If the law rises steeply from rest and
levels off, or has a kink, a node may come back to where it has been: Newton's iterations cycle. The
values of the law found so far take the place of its tangents then (`Returned`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import BACK, NEAR
from evfem.contact.signorini import FORWARD, OPEN, STICK
from evfem.protocols import FrictionLaw
from evfem.surface.friction import Linearised, Slipping

#: of an interval of speeds: to the last digit of a double
HALVINGS = 60


class Returned:
    """Nodes that have slipped and stick again, or whose speed goes to and fro: `nodes` (P,) bool.

    The tangent of a law that rises steeply from rest and levels off overestimates static friction: the node
    would slip and stick by turns, and at a kink either side may lead to the other. It is placed at the speed
    at which the law gives its present force, with the tangent there; sticking under more than static
    friction, with the chord from rest. If no speed so far gives that force, a slipping node takes the
    steepest of chord, tangent and the slope of the last iteration, near the end the tangent; a sticking one
    the last slope.
    """

    def __init__(self, size: int) -> None:
        self.nodes = np.zeros(size, dtype=bool)
        self._slipped = np.zeros(size, dtype=bool)
        self._speed, self._change = np.full(size, np.nan), np.zeros(size)
        self._slope, self._slip = np.zeros(size), np.full(size, np.nan)
        self._fastest = np.zeros(size)

    def linearised(
        self, law: FrictionLaw, moving: Slipping, c: Ints, status: Ints, force: Floats
    ) -> Linearised:
        """The law as the nodes c (k,) shall see it at an iterate with statuses and shear forces (k,)."""
        self.watch(c, status, moving.speed)
        self._fastest[c] = np.maximum(self._fastest[c], moving.speed)
        seen = moving.linearised(law)
        seen = replace(seen, by_speed=self.slopes(c, moving.speed, seen.by_speed, moving.chord(law)))
        back = self.nodes[c] & (status != OPEN)
        if not back.any():
            return seen
        speed = speed_under(law, moving, force, np.where(back, self._fastest[c], 0.0))
        there = replace(moving, speed=speed)
        tangent, bound = there.linearised(law), there.bound(law)
        sticks, slips = (speed > 0.0) & (status == STICK), (speed > 0.0) & (status >= FORWARD)
        # what the tangent says of the present speed
        share = 1.0 + tangent.by_speed * (moving.speed - speed) / np.where(slips, bound, 1.0)
        slips &= (share > 0.0) & (tangent.by_speed > 0.0)
        return Linearised(
            np.where(slips, share * tangent.slope, seen.slope),
            np.where(slips, share * tangent.offset, seen.offset),
            np.select([slips, sticks], [tangent.by_speed, there.chord(law)], seen.by_speed),
            np.where(slips, share * tangent.by_mu, seen.by_mu),
        )

    def watch(self, c: Ints, status: Ints, speed: Floats) -> None:
        """Look at the statuses (k,) and speeds (k,) of the nodes c (k,) at an iterate."""
        self.nodes[c] |= self._slipped[c] & (status == STICK)
        self._slipped[c] |= status >= FORWARD
        change = np.where(status >= FORWARD, speed - self._speed[c], 0.0)
        self.nodes[c] |= change * self._change[c] < -BACK * self._change[c] ** 2
        self._speed[c] = np.where(status >= FORWARD, speed, np.nan)
        self._change[c] = np.nan_to_num(change)

    def slopes(self, c: Ints, slip: Floats, tangent: Floats, chord: Floats) -> Floats:
        """With which slopes (k,) friction of nodes c (k,) grows, at slips (k,); 0 where they stick."""
        near = np.abs(slip - self._slip[c]) < NEAR * np.abs(slip)
        steepest = np.maximum(np.maximum(chord, tangent), self._slope[c])
        slope = np.where(self.nodes[c] & ~near, steepest, tangent)
        slips = slip != 0.0
        self._slip[c] = slip
        self._slope[c] = np.where(slips & (slope > 0.0), slope, self._slope[c])
        return np.where(slips, slope, np.where(self.nodes[c], self._slope[c], 0.0))


def speed_under(law: FrictionLaw, seen: Slipping, force: Floats, fastest: Floats) -> Floats:
    """Speeds (k,) in mm/s, up to `fastest` (k,), of friction `force` (k,) in N/mm, by bisection; else 0."""
    low, high = np.zeros_like(force), np.array(fastest)
    within = (replace(seen, speed=low).bound(law) < force) & (replace(seen, speed=high).bound(law) >= force)
    for _ in range(HALVINGS if within.any() else 0):
        middle = 0.5 * (low + high)
        below = replace(seen, speed=middle).bound(law) < force
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return np.where(within, high, 0.0)

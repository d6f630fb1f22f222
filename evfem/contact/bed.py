r"""An elastic surface below the pad: how far it gives way under each node, and how it then slopes.

With the nodal forces F on the finger and the surface's compliance C (`evfem.surface.elastic`) the surface
gives way by -C F. Relative to it a node is, as it would be above a rigid one, at :math:`r_i = x_i + u_i + (C
F)_i`: gaps, slips, friction and attraction are functions of r. The energy :math:`F \cdot C F / 2` depends on
the places of the nodes too: so contact and attraction act along the normal of the sunk surface, whose tangent
is :math:`(1 + u_x', h' - w')`, with :math:`(-u_x', w')_i = \sum_j \partial_{x_i} C_{ij} F_j`.

Exact where the strain of the surface is small. A node's own length may change on the way, which moves the
surface by less than the strain of the finger over the number of its nodes; no force belongs to that.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.surface.pad import Pad

#: nodes with no force below which the surface counts, up to so many node distances above it
NEAR = 10.0
#: step (mm) of the slope of a compliance that does not say its own
STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Yielding:
    """The surface below P nodes in one place: `compliance` (2 P, 2 P) by forces on the finger along x and y,
    node by node, to what it adds to their places relative to it, and its derivative `slope` (2 P, 2 P) by the
    places of the displaced nodes.
    """

    compliance: Floats
    slope: Floats

    def given(self, force: Floats) -> Floats:
        """What the surface adds to the nodes' places (P, 2) under forces on the finger (P, 2)."""
        return (self.compliance @ force.ravel()).reshape(force.shape)

    def change(self, force: Floats) -> Floats:
        """Derivatives along x (P, 2) of what the surface adds: its shortening, and its sinking's slope."""
        return (self.slope @ force.ravel()).reshape(force.shape)

    def among(self, nodes: Any) -> Floats:
        """Compliance (2 k, 2 k) of these nodes."""
        rows = (2 * nodes[:, None] + np.arange(2)).ravel()
        return self.compliance[np.ix_(rows, rows)]


class Bed:
    """An elastic surface, `elastic`, below a `pad` with this `spacing` (mm); `least` is the shortest length
    (mm) of a node. Below nodes without force that are high above it is left out; under an attraction there
    are none.
    """

    def __init__(self, elastic: Any, pad: Pad, spacing: float, least: float) -> None:
        self.elastic, self.pad, self.least = elastic, pad, least
        self.reach = NEAR * spacing
        self._last: tuple[bytes, Yielding] | None = None

    def below(self, position: Floats, height: Floats) -> Yielding:
        """The surface below nodes at (P, 2), `height` (P,) above it at rest; kept, as many ask."""
        key = position[:, 0].tobytes() + height.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, self._made(position, height <= self.reach)
        return self._last[1]

    def _made(self, position: Floats, near: Any) -> Yielding:
        length = self.pad.tributary(position)
        over = np.flatnonzero((length > 0.0) & near)
        x, length, n = position[over, 0], np.maximum(length[over], self.least), over.size
        # forces on the surface are into it and along +x: F_y and -F_x of those on the finger
        rows = np.concatenate([2 * over + 1, 2 * over])
        signs = np.repeat([1.0, -1.0], n)
        compliance, slope = np.zeros((2, 2 * len(position), 2 * len(position)))
        both = signs[:, None] * signs
        compliance[np.ix_(rows, rows)] = both * self.elastic.compliance(x, length)
        slope[np.ix_(rows, rows)] = both * slopes(self.elastic, x, length)
        return Yielding(compliance, slope)


def slopes(elastic: Any, x: Floats, length: Floats) -> Floats:
    """`compliance_slope` (2 n, 2 n) of an elastic surface, differenced where it has none of its own."""
    own = getattr(elastic, "compliance_slope", None)
    if own is not None:
        return np.asarray(own(x, length))
    n, places = x.size, np.concatenate([x + STEP, x - STEP, x])
    found = np.asarray(elastic.compliance(places, np.tile(length, 3)))
    of, before, behind = (np.concatenate([np.arange(n), np.arange(3 * n, 4 * n)]) + i * n for i in (2, 1, 0))
    return np.asarray((found[np.ix_(behind, of)] - found[np.ix_(before, of)]) / (2.0 * STEP))

r"""An elastic surface below the pad: how far it gives way under each node, and how it then slopes.

With the nodal forces F on the finger and the surface's compliance C (`evfem.surface.elastic`) the surface
gives way by -C F. Relative to it a node is, as it would be above a rigid one, at :math:`r_i = x_i + u_i + (C
F)_i`: gaps, slips, friction and attraction are functions of r. The energy :math:`F \cdot C F / 2` depends on
the places of the nodes too: so contact and attraction act along the normal of the sunk surface, whose tangent
is :math:`(1 + u_x', h' - w')`, with :math:`(-u_x', w')_i = \sum_j \partial_{x_i} C_{ij} F_j`; in space
along x and along z.

Exact where the strain of the surface is small. A node's own length may change on the way, which moves the
surface by less than the strain of the finger over the number of its nodes; no force belongs to that.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.surface.pad import Pad
from evfem.surface.skin import Skin

#: nodes with no force below which the surface counts, up to so many node distances above it; in space also
#: those with an attraction
NEAR, NEAR_IN_SPACE = 10.0, 4.0
#: step (mm) of the slope of a compliance that does not say its own
STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Yielding:
    """The surface below k of P pad nodes, those `over` it (k,), in one place: `compliance` (dim k, dim k) by
    forces on the finger along x, y[, z], node by node, to what it adds to their places relative to it, and
    its derivatives `slope` (d, dim k, dim k) by the places of the displaced nodes along x[, z].
    """

    over: Ints
    compliance: Floats
    slope: Floats

    def given(self, force: Floats) -> Floats:
        """What the surface adds to the nodes' places (P, dim) under forces on the finger (P, dim)."""
        found = np.zeros_like(force)
        found[self.over] = (self.compliance @ force[self.over].ravel()).reshape(-1, force.shape[1])
        return found

    def change(self, force: Floats) -> Floats:
        """Derivatives of that (P, d, dim) along x[, z]: the surface's stretch, and its sinking's slope."""
        found = np.zeros((len(force), len(self.slope), force.shape[1]))
        moved = (self.slope @ force[self.over].ravel()).reshape(len(self.slope), -1, force.shape[1])
        found[self.over] = moved.transpose(1, 0, 2)
        return found

    def among(self, nodes: Ints) -> Floats:
        """Compliance (dim c, dim c) of these nodes, 0 of those that are not over the surface."""
        dim = len(self.slope) + 1
        (_, own, there) = np.intersect1d(nodes, self.over, assume_unique=True, return_indices=True)
        found = np.zeros((dim * nodes.size, dim * nodes.size))
        rows, columns = ((dim * at[:, None] + np.arange(dim)).ravel() for at in (own, there))
        found[np.ix_(rows, rows)] = self.compliance[np.ix_(columns, columns)]
        return found


class Bed:
    """An elastic surface, `elastic`, below a `pad` with this `spacing` (mm); `least` is the smallest length
    (mm), in space area, of a node. Below nodes without force that are high above it is left out; under an
    attraction there are none.
    """

    def __init__(self, elastic: Any, pad: Pad | Skin, spacing: float, least: float) -> None:
        self.elastic, self.pad, self.least = elastic, pad, least
        self.spacing, self.reach = spacing, NEAR * spacing
        self._last: tuple[bytes, Yielding] | None = None

    def below(self, position: Floats, height: Floats) -> Yielding:
        """The surface below nodes at (P, dim), `height` (P,) above it at rest; kept, as many ask."""
        key = position[:, ::2].tobytes() + height.tobytes()
        if self._last is None or self._last[0] != key:
            reach = self.reach if position.shape[1] == 2 else NEAR_IN_SPACE * self.spacing
            self._last = key, self._made(position, height <= reach)
        return self._last[1]

    def _made(self, position: Floats, near: Any) -> Yielding:
        length = self.pad.tributary(position)
        over = np.flatnonzero((length > 0.0) & near)
        flat, length, dim = position[over, ::2], np.maximum(length[over], self.least), position.shape[1]
        x = flat[:, 0] if dim == 2 else flat
        given, changed = self.elastic.compliance(x, length), slopes(self.elastic, x, length)
        compliance, *slope = (_by_nodes(np.asarray(each), dim) for each in (given, *changed))
        return Yielding(over, compliance, np.stack(slope))


def _by_nodes(found: Floats, dim: int) -> Floats:
    """A matrix (dim k, dim k) of a surface, for forces on the finger along x, y[, z] node by node: those on
    the surface, component by component, are into it and along +x[, +z], F_y, -F_x[, -F_z].
    """
    size, order, sign = len(found) // dim, np.array([1, 0, 2])[:dim], np.array([-1.0, 1.0, -1.0])[:dim]
    blocks = found.reshape(dim, size, dim, size)
    made = np.empty((size, dim, size, dim))
    for p, q in product(range(dim), repeat=2):
        np.multiply(blocks[order[p], :, order[q]], sign[p] * sign[q], out=made[:, p, :, q])
    return made.reshape(dim * size, dim * size)


def slopes(elastic: Any, x: Floats, length: Floats) -> Floats:
    """`compliance_slope` of an elastic surface, differenced where it has none of its own."""
    own = getattr(elastic, "compliance_slope", None)
    if own is not None:
        return np.asarray(own(x, length))
    n, flat, found = len(x), x.reshape(len(x), -1), []
    dim = flat.shape[1] + 1
    for way in STEP * np.eye(dim - 1):
        places = np.concatenate([flat + way, flat - way, flat]).reshape(-1, *x.shape[1:])
        given = np.asarray(elastic.compliance(places, np.tile(length, 3))).reshape(dim, 3, n, dim, 3, n)
        found.append((given[:, 0, :, :, 2] - given[:, 1, :, :, 2]).reshape(dim * n, dim * n) / (2.0 * STEP))
    return np.stack(found)

r"""The pad alone: where its nodes go under given forces, remembered from a few equilibria of the
finger.

At equilibrium k of the full model the pad nodes have moved by :math:`q_k` relative to the bone and
carry the forces :math:`f_k`; the condensed tangent gives their compliance
:math:`C_k = \partial q/\partial f`. The equilibria of a press are told apart by the downward force
N on the pad, those of a slide by the shear force T. With weights :math:`w_k(f)` that are linear
between neighbours on these two axes and add up to one,

.. math:: q(f) = \sum_k w_k \left(q_k - \tfrac12 C_k f_k\right) + \bar C\,\left(f - \tfrac12 \bar f\right),
          \qquad \bar C = \sum_k w_k C_k, \quad \bar f = \sum_k w_k f_k .

This is exact at the stored equilibria, to first order around them, and everywhere between them for
a pad whose compliance changes linearly with the force. What is left out is how the compliance
changes with the part of the force that differs from :math:`\bar f` though its sums are the same,
and beyond the outermost equilibria. Only the forces count, not where the finger is: the surface
must be flat.

Nodes near contact are kept one by one. The others are attracted but do not touch: their
displacements are interpolated along the outline between a few of them (knots), which take over
their forces.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evfem.common.arrays import Floats, Ints

#: along the outline, one far node in so many is a knot
SPACING = 8
#: nodes kept beyond those that have touched, on either side, as a share of these
MARGIN = 0.1
#: how far the compliance is extrapolated, in intervals between stored equilibria
BEYOND = 0.5


@dataclass(frozen=True, eq=False)
class Kept:
    """Which of P pad nodes are kept: `near` (k,) may touch, `knots` stand for the others, K in
    all.

    Every pad node moves like the mean of the kept nodes number `low` and `high` (P,), the second
    one with weight `share` (P,) and the first one with what `hold` (P,) leaves of it: hold is 1,
    or 0 for a node that is fixed to the bone.
    """

    near: Ints
    knots: Ints
    low: Ints
    high: Ints
    share: Floats
    hold: Floats

    @property
    def nodes(self) -> Ints:
        """Near nodes, then knots (K,), as numbers of pad nodes."""
        return np.concatenate([self.near, self.knots])

    @property
    def size(self) -> int:
        """Number of kept nodes K."""
        return self.near.size + self.knots.size

    @classmethod
    def along(cls, order: Ints, arc: Floats, touched: Ints, size: int) -> Kept:
        """From the free pad nodes in the `order` of the outline at the arc lengths `arc` (mm),
        those from the first to the last of the places `touched` in that order, with a margin;
        `size` is P.

        >>> kept = Kept.along(np.arange(40), np.arange(40.0), np.array([17, 22]), 40)
        >>> kept.near.size, kept.knots.tolist()
        (18, [0, 8, 31, 39])
        """
        margin = max(6, int(MARGIN * (touched[-1] - touched[0] + 1)))
        first, last = max(touched[0] - margin, 0), min(touched[-1] + margin, order.size - 1)
        left, right = np.arange(0, first, SPACING), np.arange(order.size - 1, last, -SPACING)
        place = np.concatenate([np.arange(first, last + 1), left, right[::-1]])
        column = np.empty(order.size, dtype=np.int64)
        column[place] = np.arange(place.size)
        support = np.sort(place)
        above = np.clip(np.searchsorted(support, np.arange(order.size)), 1, support.size - 1)
        before, behind = support[above - 1], support[above]
        low, high = np.zeros(size, dtype=np.int64), np.zeros(size, dtype=np.int64)
        share, hold = np.zeros(size), np.zeros(size)
        low[order], high[order] = column[before], column[behind]
        share[order] = (arc - arc[before]) / (arc[behind] - arc[before])
        hold[order] = 1.0
        near = order[first : last + 1]
        return cls(near, order[place[near.size :]], low, high, share, hold)

    def spread(self, moved: Floats) -> Floats:
        """Displacements (P, 2) of all pad nodes by those of the kept ones (2 K,), y before x."""
        y, x = moved.reshape(2, -1)
        kept = np.stack([x, y], axis=1)
        return (self.hold - self.share)[:, None] * kept[self.low] + self.share[:, None] * kept[self.high]

    def gather(self, force: Floats) -> Floats:
        """Forces (P, 2) of all pad nodes, handed to the kept ones (2 K,), y before x."""
        first, second = self.hold - self.share, self.share
        parts = [
            np.bincount(self.low, first * force[:, axis], self.size)
            + np.bincount(self.high, second * force[:, axis], self.size)
            for axis in (1, 0)
        ]
        return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class CondensedPad:
    """S equilibria of a pad with P nodes of which K are kept: displacements relative to the bone
    and forces (S, P, 2), compliances (S, 2 K, 2 K) of the kept nodes, y components before x.

    `press` numbers those along growing N, `slide` those along growing T; the last of `press` is in
    `slide`.
    """

    kept: Kept
    moved: Floats
    force: Floats
    compliance: Floats
    press: Ints
    slide: Ints

    @cached_property
    def sums(self) -> Floats:
        """Downward force N and shear force T of every equilibrium, (S, 2) in N/mm."""
        return np.array([sums(force) for force in self.force])

    @cached_property
    def gathered(self) -> Floats:
        """Forces on the kept nodes, (S, 2 K)."""
        return np.stack([self.kept.gather(force) for force in self.force])

    @cached_property
    def bases(self) -> Floats:
        """q_k - C_k f_k / 2 of all pad nodes, (S, P, 2)."""
        half = np.einsum("sij,sj->si", self.compliance, 0.5 * self.gathered)
        return np.stack([q - self.kept.spread(part) for q, part in zip(self.moved, half, strict=True)])

    @cached_property
    def axes(self) -> tuple[Floats, Floats, Floats]:
        """N of `press`, N and T of `slide`, in N/mm."""
        return self.sums[self.press, 0], self.sums[self.slide, 0], self.sums[self.slide, 1]

    def weights(self, force: Floats) -> Floats:
        """Weights (S,) of the equilibria for forces (P, 2) on the pad."""
        N, T = sums(force)
        pressed, loads, shears = self.axes
        weight = np.zeros(len(self.force))
        along = _hats(shears, T)
        # a slide at given indentation changes N a little: that is part of the slide
        drift = float(along @ loads) - pressed[-1]
        weight[self.slide] += along
        weight[self.press] += _hats(pressed, N - drift)
        weight[self.press[-1]] -= 1.0
        return weight

    def pressed(self, N: float) -> Floats:
        """Forces (P, 2) between those of the stored press, for the downward force N (N/mm)."""
        return np.tensordot(_hats(self.sums[self.press, 0], N), self.force[self.press], 1)

    def under(self, force: Floats) -> Floats:
        """Displacements relative to the bone (P, 2) under forces (P, 2)."""
        from scipy.linalg.blas import dsymv

        weight = self.weights(force)
        used = np.flatnonzero(weight)
        rest = self.kept.gather(force) - 0.5 * (weight[used] @ self.gathered[used])
        linear = np.zeros_like(rest)
        for k in used:
            # reads one triangle; the transposed view is the column order that BLAS wants
            linear = dsymv(weight[k], self.compliance[k].T, rest, 1.0, linear, overwrite_y=True)
        return np.tensordot(weight[used], self.bases[used], 1) + self.kept.spread(linear)

    def mean_compliance(self, weight: Floats) -> Floats:
        """Compliance (2 K, 2 K) with these weights (S,)."""
        used = np.flatnonzero(weight)
        mean = weight[used[0]] * self.compliance[used[0]]
        for k in used[1:]:
            mean += weight[k] * self.compliance[k]
        return np.asarray(mean)

    def beyond(self, force: Floats) -> float:
        """How far the sums of forces (P, 2) are beyond those of the equilibria, relative to their
        range.
        """
        N, T = sums(force)
        low, high = self.sums.min(axis=0), self.sums.max(axis=0)
        outside = np.maximum(np.maximum([N, T] - high, low - [N, T]), 0.0)
        return float(outside.max() / np.abs(self.sums).max())


def sums(force: Floats) -> Floats:
    """Downward force and shear force towards -x (2,) of forces (P, 2) on the pad, as the bone
    feels them.
    """
    x, y = force.sum(axis=0)
    return np.array([y, -x])


def _hats(nodes: Floats, x: float) -> Floats:
    """Weights of linear interpolation at x between growing nodes; beyond the ends linear for
    `BEYOND` of the last interval, then constant.
    """
    weight = np.ones(nodes.size)
    if nodes.size == 1:
        return weight
    weight[:] = 0.0
    right = min(max(int(np.searchsorted(nodes, x)), 1), nodes.size - 1)
    share = float((x - nodes[right - 1]) / (nodes[right] - nodes[right - 1]))
    share = min(max(share, -BEYOND), 1.0 + BEYOND)
    weight[right - 1], weight[right] = 1.0 - share, share
    return weight

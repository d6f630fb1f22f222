r"""The forces of nodes that are known to be open, to stick or to slip: one dense linear system.

An unknown x of a node loads the body there by `gives` x, and its equation weighs the node's gap and slip,
v = v_0 + C f, by `row`:

.. math:: \sum_a \mathrm{row}_a\,v_a + \mathrm{own}\,x = \mathrm{right}

=================================  ========================================  ===============  =============
unknown                            gives                                     row              own
=================================  ========================================  ===============  =============
pressing force of a closed node    1 and its friction, less the attraction   the gap          give of the
                                   that grows with it                                         interface
shear force of a sticking node     along each tangent                        its slip         the same
loss of attraction of an open one  1 along the normal                        the gap          -1 / k_e
shear force across a slip          along e_perp                              r_t m e_perp     1 - m
=================================  ========================================  ===============  =============

The last one turns a slip in three dimensions, by a shear force lam_e along e_perp:

.. math:: (1 - m)\,\lambda_e + m\,r_t\,(e_\perp \cdot s) = 0, \qquad m = \min(1, \mu p/|z|);

at the solution r_t drops out.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, product
from evfem.contact.signorini import OPEN, SLIP, STICK, ContactProblem, Forces, Projected, side, sizes


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums (u,) of the components of a `node` (u,) each, n of them, with `weights` (u, n), alike in each of
    the `spans`.
    """

    node: Ints
    weights: Floats
    spans: tuple[slice, ...] = (slice(None),)

    def __getitem__(self, part: slice) -> Sums:
        """Some of them."""
        return Sums(self.node[part], self.weights[part])

    @property
    def first(self) -> Ints:
        """The first component, of all nodes' (m,), that counts."""
        return np.asarray(self.weights.shape[1] * self.node + np.argmax(self.weights != 0.0, axis=1))

    def of(self, v: Any) -> Floats:
        """Sums (u, q) of components (m, q)."""
        n, first = self.weights.shape[1], self.first
        found, weights = v.take(first, axis=0), self.weights.astype(v.dtype, copy=False)
        weight = weights[np.arange(first.size), first % n]
        if (some := np.flatnonzero(weight != 1.0)).size:
            found[some] *= weight[some, None]
        for a in range(1, n):  # those beside the first
            if (some := np.flatnonzero((weights[:, a] != 0.0) & (first % n < a))).size:
                found[some] += v.take(n * self.node[some] + a, axis=0) * weights[some, a, None]
        return np.asarray(found)

    def of_columns(self, C: Any) -> Floats:
        """Sums (q, u) of columns (q, m)."""
        n, first = self.weights.shape[1], self.first
        found, weights = C.take(first, axis=1), self.weights.astype(C.dtype, copy=False)
        weight = weights[np.arange(first.size), first % n]
        if (weight != 1.0).any():
            found *= weight
        for a in range(1, n):
            beside = np.where(first % n < a, weights[:, a], C.dtype.type(0.0))
            for span in self.spans:  # columns side by side take a third of the time of some of them
                if beside[span].any():
                    found[:, span] += C.take(n * self.node[span] + a, axis=1) * beside[span]
        return np.asarray(found)

    def spread(self, x: Floats, nodes: int) -> Floats:
        """Components (m, q) of so many nodes that x (u, q) gives them, each with its weights."""
        found = np.zeros((nodes, self.weights.shape[1], x.shape[1]))
        np.add.at(found, self.node, self.weights[:, :, None] * x[:, None, :])
        return found.reshape(-1, x.shape[1])


class Equations:
    """Unknowns x (u,) and equations (head of this file) of nodes that have these statuses (k,); in
    `evfem.common.arrays.DenseSolver` their matrix.

    Known per node, (k, 1 + d): the force of a closed one with unit pressing force, `sheared`, the attraction
    that this adds, `gain`, and the constant `attraction_loss` and `shear`. Unknown, in this order: the
    pressing forces of the `closed` nodes, the shear forces of the `stick` ones, the losses of the `attracted`
    open ones, and the shear forces of the `turned` ones (t,) along `aside` (t, 2).
    """

    def __init__(
        self, problem: ContactProblem, status: Ints, along: Floats, turning: Floats | None = None
    ) -> None:
        n, opened, resists = problem.dim, (status == OPEN)[:, None], problem.resists
        along = np.where((status >= SLIP)[:, None], along, 0.0)
        self.sheared = np.hstack([np.ones(opened.shape), problem.friction[:, None] * along])
        self.gain, self.attraction_loss, self.shear = np.zeros((3, *self.sheared.shape))
        if problem.cohesion is not None:
            self.shear[:, 1:] = problem.cohesion[:, None] * along
        attracted = np.zeros(0, dtype=np.int64)
        if (attraction := problem.attraction) is not None:
            attracted = np.flatnonzero(opened[:, 0] & (attraction.negative_stiffness > 0.0))
            self.attraction_loss[:, 0] = np.where(opened[:, 0], 0.0, -attraction.gain_on_closing)
            self.gain = self.gain + attraction.by_force.gain
            self.attraction_loss += attraction.by_force.loss(opened)
        self.compliance, self.size, self.attracted = problem.compliance, status.size, attracted
        self.closed, self.stick = np.flatnonzero(status != OPEN), np.flatnonzero(status == STICK)
        self.turned = np.flatnonzero((status == SLIP) & resists & (turning is not None))
        self.aside = along[self.turned, ::-1] * np.array([-1.0, 1.0][: n - 1])
        self._pose(problem, np.ones(status.size) if turning is None else turning)

    def _pose(self, problem: ContactProblem, turning: Floats) -> None:
        """What the unknowns give, and their equations."""
        n, turned = problem.dim, self.turned
        held, m = np.tile(np.eye(n)[1:], (self.stick.size, 1)), turning[turned, None]
        normal = np.eye(n)[:1]
        across = np.pad(self.aside, ((0, 0), (1, 0)))
        node = np.concatenate([self.closed, np.repeat(self.stick, n - 1), self.attracted, turned])
        pulled = np.repeat(normal, self.attracted.size, axis=0)
        felt = (self.sheared - self.gain)[self.closed]
        parts = (felt, held, pulled, across)
        ends = np.cumsum([0, *map(len, parts)])
        spans = tuple(slice(begin, end) for begin, end in pairwise(ends))
        self.gives = Sums(node, np.concatenate(parts), spans)
        turns = m / problem.own[1][turned, None] * across
        rows = np.concatenate([np.repeat(normal, self.closed.size, axis=0), held, pulled, turns])
        self.row, self.own = Sums(node, rows), np.zeros(node.size)
        pressing, held_by, drop, aside = self.split(self.own)
        if problem.give is not None:
            give = problem.give.reshape(-1, n)
            pressing += give[self.closed, 0]
            held_by += give[self.stick, 1:].ravel()
        if self.attracted.size:
            drop -= 1.0 / problem.attraction.negative_stiffness[self.attracted]  # type: ignore[union-attr]
        aside += 1.0 - m[:, 0]

    def split(self, x: Floats) -> list[Floats]:
        """x (u,) as pressing forces, shears of sticking nodes, losses of attraction, and shears across."""
        held = self.aside.shape[1] * self.stick.size
        return np.split(x, np.cumsum([self.closed.size, held, self.attracted.size]))

    @property
    def names(self) -> tuple[bytes, int]:
        """What tells these unknowns from others."""
        return self.gives.first.tobytes(), self.turned.size

    def __len__(self) -> int:
        return self.own.size

    def __getitem__(self, part: slice) -> Floats:
        """Some rows (q, u) of the matrix, in the precision of the compliance, but for its diagonal."""
        return self.gives.of_columns(self.row[part].of(self.compliance))

    def __array__(self, dtype: Any = None, copy: Any = None) -> Floats:
        matrix = self.gives.of_columns(self.row.of(self.compliance.astype(float, copy=False)))
        matrix[np.diag_indices_from(matrix)] += self.own
        return matrix

    def __matmul__(self, x: Floats) -> Floats:
        """The matrix times x (u, q), without it."""
        moved = product(self.compliance, self.gives.spread(x, self.size))
        return self.row.of(moved) + self.own[:, None] * x

    def diagonal(self) -> Floats:
        """Its diagonal (u,)."""
        n, node = self.row.weights.shape[1], self.row.node
        blocks = self.compliance.reshape(self.size, n, self.size, n)[node, :, node]
        return np.einsum("ua,uab,ub->u", self.row.weights, blocks, self.gives.weights) + self.own

    def forces(self, x: Floats, extra: Floats) -> Forces:
        """Forces of all nodes with the unknowns (u,)."""
        pressing, held, drop, across = self.split(x)
        pressed = np.zeros((self.size, 1))
        pressed[self.closed, 0] = pressing
        force = self.shear + pressed * self.sheared
        attraction_loss = self.attraction_loss - pressed * self.gain
        force[self.stick, 1:] = held.reshape(-1, force.shape[1] - 1)
        force[self.turned, 1:] += across[:, None] * self.aside
        attraction_loss[self.attracted, 0] += drop
        return Forces(force.ravel(), attraction_loss.ravel(), extra)


def solve_statuses(
    problem: ContactProblem, status: Ints, along: Floats, turning: Floats | None = None
) -> Forces:
    """Forces of nodes that have these statuses (k,), slipping ones with a shear force `along` e (k, d), which
    in space turns with the weight m, `turning` (k,); raises `numpy.linalg.LinAlgError` where they have none.
    """
    extra, system = problem.extra_unknowns, Equations(problem, status, along, turning)
    steady = (system.attraction_loss + system.shear).ravel()
    start = problem.start + product(problem.compliance, steady) if steady.any() else problem.start
    right = -system.row.of(start[:, None])
    if system.attracted.size:
        system.split(right)[2][:, 0] += problem.attraction.reference_gap[system.attracted]  # type: ignore[union-attr]
    if extra is None:
        return system.forces(problem.dense.solve(system, right, system.names)[:, 0], np.zeros(0))
    balance, rest = system.gives.of_columns(extra.rows), extra.right - extra.rows @ steady
    both = problem.dense.solve(system, np.hstack([right, system.row.of(extra.columns)]), system.names)
    d = np.linalg.solve(extra.pivot - balance @ both[:, 1:], rest - balance @ both[:, 0])
    return system.forces(both[:, 0] - both[:, 1:] @ d, d)


def linearised(problem: ContactProblem, found: Projected) -> Forces:
    """The forces that solve the equations linearised where the laws were projected."""
    if problem.dim == 2:
        return solve_statuses(problem, found.status, side(found.status))
    size = np.maximum(sizes(found.z), 1e-200)
    limit = np.where(found.status == SLIP, np.maximum(problem.limit(found.p), 0.0), 0.0)
    return solve_statuses(problem, found.status, found.z / size[:, None], np.minimum(1.0, limit / size))

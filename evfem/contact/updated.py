r"""The closed nodes of a contact problem, solved again and again: one factorisation serves all statuses
that differ from its own in few nodes.

Forces p (2 k,) and extra unknowns d move gaps and slips by :math:`u = u_0 + C p + e\,d` and obey
:math:`r p + \rho\,d = b` (`evfem.contact.elimination`). The status of a node adds two equations:

========  ===================================
node      equations
========  ===================================
open      p_n = 0, p_t = 0
sticking  u_n = 0, u_t = 0
slipping  u_n = 0, p_t = ratio p_n + constant
========  ===================================

Of the statuses of the factorisation, components that are zero or follow from others are left out, and
:math:`A x = a` is what remains. Other statuses differ in m components. Each of them has one unknown w:
where the component is left out, what its force is beyond what follows from others, and where it is
not, what its equation is out of balance by. Then

.. math:: p = p^0 + P w, \quad d = d^0 + D w, \qquad u = u^0 + C P w + e D w,

with columns of P and D from :math:`A^{-1}`, which are known from then on, and the equations of the m
components are a small system for w (the identity of Sherman, Morrison and Woodbury, for rows and
columns). Where m is more than the share `UPDATED` of the unknowns, the present statuses are
factorised.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import UPDATED
from evfem.contact.elimination import Motions, bordered


@dataclass(frozen=True, eq=False)
class Relations:
    """What statuses ask of k nodes: which are `closed` and which `stick` (k,) bool, and shear
    forces `ratio` (k,) times the normal ones plus `constant` (k,) of those that slip, 0 for others.
    """

    closed: Ints
    stick: Ints
    ratio: Floats
    constant: Floats

    def differing(self, other: Relations) -> Ints:
        """Components, normal before tangential, with another equation than theirs."""
        normal = self.closed != other.closed
        slips = (self.ratio != other.ratio) | (self.constant != other.constant)
        return np.flatnonzero(np.concatenate([normal, (self.stick != other.stick) | slips]))


class ClosedNodes:
    """Forces of the closed nodes of the same `motions` for one set of statuses after the other."""

    def __init__(self, motions: Motions) -> None:
        self.motions = motions
        self._last: Factorised | None = None

    def solved(self, now: Relations) -> tuple[Floats, Floats]:
        """Forces (2 k,) and extra unknowns (p,); raises LinAlgError where there are none."""
        if self._last is not None:
            other = now.differing(self._last.relations)
            if other.size <= UPDATED * self._last.rows.size:
                return self._last.updated(now, other)
        self._last = None
        self._last = Factorised(self.motions, now)
        return self._last.force, self._last.extra


class Factorised:
    """The equations for `relations`, factorised, their solution, and the responses to components."""

    def __init__(self, motions: Motions, relations: Relations) -> None:
        C, k = motions.compliance, relations.closed.size
        self.motions, self.relations = motions, relations
        active = np.flatnonzero(relations.closed)
        self.rows = np.concatenate([active, k + np.flatnonzero(relations.stick)])
        self._slipping = np.flatnonzero(relations.ratio[active])
        self._shear = k + active[self._slipping]
        self._ratio = relations.ratio[active[self._slipping]]
        matrix, row = C[np.ix_(self.rows, self.rows)], motions.rows[:, self.rows]
        matrix[:, self._slipping] += C[np.ix_(self.rows, self._shear)] * self._ratio
        row[:, self._slipping] += motions.rows[:, self._shear] * self._ratio
        self._factorise(bordered(matrix, motions.columns[self.rows], row, motions.pivot))
        given = np.concatenate([np.zeros(k), relations.constant])
        moved, balance = motions.start[self.rows], motions.right
        if given.any():
            moved, balance = moved + (C @ given)[self.rows], balance - motions.rows @ given
        force, extra = self._answer(np.append(-moved, balance)[:, None])
        self.force, self.extra = given + force[0], extra[0]
        self.state = motions.start + C @ self.force + motions.columns @ self.extra
        self._known = np.full(2 * k, -1)
        self._forces, self._extras = np.zeros((0, 2 * k)), np.zeros((0, motions.columns.shape[1]))

    def _factorise(self, matrix: Floats) -> None:
        from scipy.linalg import lapack

        self._empty = not matrix.size
        if self._empty:
            return
        # the transpose is in the order that LAPACK wants: no copy
        self._factor, self._pivots, failed = lapack.dgetrf(matrix.T, overwrite_a=True)
        if failed:
            raise np.linalg.LinAlgError("Singular matrix")

    def _answer(self, right: Floats) -> tuple[Floats, Floats]:
        """Forces (m, 2 k) and extra unknowns (m, p) that right sides (n + p, m) ask for."""
        from scipy.linalg import lapack

        found = right.T if self._empty else lapack.dgetrs(self._factor, self._pivots, right, trans=True)[0].T
        force = np.zeros((len(found), self.motions.start.size))
        force[:, self.rows] = found[:, : self.rows.size]
        force[:, self._shear] = self._ratio * found[:, self._slipping]
        return force, found[:, self.rows.size :]

    def _responses(self, components: Ints) -> tuple[Floats, Floats]:
        """Forces (m, 2 k) and extra unknowns (m, p) by the unknowns of these components."""
        new = components[self._known[components] < 0]
        if new.size:
            right = -np.concatenate(
                [self.motions.compliance[np.ix_(self.rows, new)], self.motions.rows[:, new]]
            )
            place = np.full(self.motions.start.size, -1)
            place[self.rows] = np.arange(self.rows.size)
            kept = np.flatnonzero(place[new] >= 0)
            right[:, kept] = 0.0
            right[place[new[kept]], kept] = 1.0
            force, extra = self._answer(right)
            beyond = np.flatnonzero(place[new] < 0)
            force[beyond, new[beyond]] += 1.0
            self._known[new] = len(self._forces) + np.arange(new.size)
            self._forces, self._extras = np.vstack([self._forces, force]), np.vstack([self._extras, extra])
        known = self._known[components]
        return self._forces[known], self._extras[known]

    def updated(self, now: Relations, other: Ints) -> tuple[Floats, Floats]:
        """Forces (2 k,) and extra unknowns (p,) for statuses that differ in the components `other`
        (m,).
        """
        if not other.size:
            return self.force, self.extra
        k, motions = now.closed.size, self.motions
        P, D = self._responses(other)
        node = other % k
        tangential = other >= k
        ratio, constant = (np.where(tangential, each[node], 0.0) for each in (now.ratio, now.constant))
        matrix = (P[:, other] - P[:, node] * ratio).T
        right = constant - self.force[other] + ratio * self.force[node]
        moves = np.where(tangential, now.stick[node], now.closed[node])
        held = other[moves]
        matrix[moves] = motions.compliance[held] @ P.T + motions.columns[held] @ D.T
        right[moves] = -self.state[held]
        w = np.linalg.solve(matrix, right)
        return self.force + w @ P, self.extra + w @ D

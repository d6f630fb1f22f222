r"""Contact problems whose compliance stays the same for many solves: the factorisation is kept,
and rows of nodes that have changed status are exchanged by Woodbury's formula.

All statuses share one system M x = b in the pressing and shear forces x of every node (and the
extra unknowns); a status is a choice of the node's two rows:

========================  =====================================================
row                       equation
========================  =====================================================
closed gap, or stick      row of the compliance times x = -start
open                      x = 0
open and attracted           row of the compliance times x - x / stiffness = gap - start
slip                      shear force - ratio x pressing force = 0
========================  =====================================================

With rows exchanged, :math:`M = M_0 + E D`, a solve costs one back-substitution and one more for
every row that has not been exchanged before.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK, ContactNotSolved, ContactProblem

#: share of the rows that may be exchanged before the system is factorised again
MOST = 0.2
ZERO, FULL, ATTRACTED, SLIPPING = 0, 1, 2, 3


@dataclass(eq=False)
class Factors:
    """The factorised system of the statuses it was made for."""

    compliance: Floats | None = None
    matrix: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    lu: Any = None
    kinds: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    values: Floats = field(default_factory=lambda: np.zeros(0))
    _place: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    _columns: Floats = field(default_factory=lambda: np.zeros((0, 0)))

    def solve(self, problem: ContactProblem, kinds: Ints, values: Floats, right: Floats) -> Floats:
        """Forces and extra unknowns x (2 k + p,) for these rows (`row_kinds`) and right-hand side."""
        from scipy.linalg import lapack

        extra = right.size - kinds.size
        fresh = self.compliance is not problem.compliance or len(self.matrix) != right.size
        changed = np.zeros(0, dtype=np.int64)
        if not fresh:
            changed = np.flatnonzero((kinds != self.kinds) | (values != self.values))
            fresh = changed.size > MOST * right.size or not (self.kinds == FULL).any()
        if fresh:
            self._factorise(problem, kinds, values)
            changed = changed[:0]
        if not changed.size:
            return np.asarray(lapack.dgetrs(*self.lu, right)[0])
        columns = self._columns_of(changed)
        difference = _rows(problem, kinds, values, changed, extra) - self.matrix[changed]
        x = np.asarray(lapack.dgetrs(*self.lu, right)[0])
        try:
            share = np.linalg.solve(np.eye(changed.size) + difference @ columns, difference @ x)
        except np.linalg.LinAlgError as error:
            raise ContactNotSolved(str(error)) from error
        return np.asarray(x - columns @ share)

    def _columns_of(self, rows: Ints) -> Floats:
        """Columns of the inverse that belong to these rows (2 k + p, r); each is computed once."""
        from scipy.linalg import lapack

        missing = rows[self._place[rows] < 0]
        if missing.size:
            units = np.zeros((len(self.matrix), missing.size), order="F")
            units[missing, np.arange(missing.size)] = 1.0
            found = lapack.dgetrs(*self.lu, units, overwrite_b=True)[0]
            self._place[missing] = self._columns.shape[1] + np.arange(missing.size)
            self._columns = np.concatenate([self._columns, found], axis=1)
        return np.asarray(self._columns[:, self._place[rows]])

    def _factorise(self, problem: ContactProblem, kinds: Ints, values: Floats) -> None:
        from scipy.linalg import lapack

        extra_unknowns = problem.extra_unknowns
        extra = 0 if extra_unknowns is None else extra_unknowns.pivot.shape[0]
        matrix = _rows(problem, kinds, values, np.arange(kinds.size), extra)
        if extra_unknowns is not None:
            matrix = np.vstack([matrix, np.hstack([extra_unknowns.rows, extra_unknowns.pivot])])
        lu, pivots, failed = lapack.dgetrf(matrix)
        if failed:
            self.compliance = None
            raise ContactNotSolved("Singular matrix")
        self.compliance, self.matrix, self.lu = problem.compliance, matrix, (lu, pivots)
        self.kinds, self.values = kinds, values
        self._place, self._columns = np.full(len(matrix), -1), np.zeros((len(matrix), 0))


@dataclass(frozen=True)
class KeptProblem(ContactProblem):
    """A contact problem that is solved with `factors` of the problems before it."""

    factors: Factors = field(default_factory=Factors)

    def solved(self, status: Ints) -> tuple[Floats, Floats, Floats]:
        """Contact forces (2 k,), drops of the attraction (2 k,), extra unknowns (p,) for given
        statuses.
        """
        kinds, values = row_kinds(self, status)
        right, grown = _right(self, kinds)
        x, k = self.factors.solve(self, kinds, values, right), self.size
        attracted, both = kinds == ATTRACTED, x[: 2 * k]
        return np.where(attracted, 0.0, both), np.where(attracted, both, grown), x[2 * k :]


def row_kinds(problem: ContactProblem, status: Ints) -> tuple[Ints, Floats]:
    """Kind of every row (2 k,), and the number in it: 1 / negative stiffness of attracted nodes,
    ratio of slipping ones.
    """
    k = problem.size
    kinds, values = np.full(2 * k, ZERO), np.zeros(2 * k)
    kinds[:k][status != OPEN] = FULL
    kinds[k:][status == STICK] = FULL
    slips = k + np.flatnonzero(status >= FORWARD)
    sign = (status == BACKWARD).astype(float) - (status == FORWARD)
    kinds[slips], values[slips] = SLIPPING, (problem.friction * sign)[slips - k]
    if problem.attraction is not None:
        attracted = np.flatnonzero((status == OPEN) & (problem.attraction.negative_stiffness > 0.0))
        kinds[attracted], values[attracted] = (
            ATTRACTED,
            1.0 / problem.attraction.negative_stiffness[attracted],
        )
    return kinds, values


def _rows(problem: ContactProblem, kinds: Ints, values: Floats, which: Ints, extra: int) -> Floats:
    """Rows `which` of the system (r, 2 k + p); those without a compliance have the size of one."""
    k, place = problem.size, np.arange(which.size)
    rows = np.zeros((which.size, 2 * k + extra))
    unit = float(problem.compliance[0, 0])
    kind = kinds[which]
    full = (kind == FULL) | (kind == ATTRACTED)
    rows[full, : 2 * k] = problem.compliance[which[full]]
    if problem.extra_unknowns is not None:
        rows[full, 2 * k :] = problem.extra_unknowns.columns[which[full]]
    own = np.where(kind == ATTRACTED, -values[which], np.where(full, 0.0, unit))
    rows[place, which] += own
    slips = np.flatnonzero(kind == SLIPPING)
    rows[slips, which[slips] - k] = -unit * values[which[slips]]
    return rows


def _right(problem: ContactProblem, kinds: Ints) -> tuple[Floats, Floats]:
    """Right-hand side (2 k + p,), and the known drop of the attraction (2 k,) of nodes that have
    closed.
    """
    k = problem.size
    full = (kinds == FULL) | (kinds == ATTRACTED)
    right = np.where(full, -problem.start, 0.0)
    grown = np.zeros(2 * k)
    if problem.attraction is not None:
        grown[:k] = np.where(kinds[:k] == FULL, -problem.attraction.gain_on_closing, 0.0)
        right[:k] += np.where(kinds[:k] == ATTRACTED, problem.attraction.reference_gap, 0.0)
        some = np.flatnonzero(grown)
        right[full] -= (problem.compliance[:, some] @ grown[some])[full]
    if problem.extra_unknowns is not None:
        right = np.concatenate([right, problem.extra_unknowns.right - problem.extra_unknowns.rows @ grown])
    return right, grown

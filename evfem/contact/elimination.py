r"""What is linear whatever the statuses are, taken out of a contact problem once.

The attraction of a node weakens with its gap by the drop :math:`f = k_e (g - g_{ref})` as long as it
is open. Gaps and slips :math:`u_0 + C (\lambda + f) + e\,d` and the equations
:math:`r (\lambda + f) + \rho\,d = b` of the extra unknowns, with the drops of all k attracted nodes
taken along, open or not, are

.. math:: f = M^{-1} (g_{ref} - u_{0q} - C_q \lambda' - e_q d), \qquad M = C_{qq} - k_e^{-1},

.. math:: u = [u_0 + C_{:q} M^{-1} (g_{ref} - u_{0q})] + [C - C_{:q} M^{-1} C_{q:}] \lambda'
          + [e - C_{:q} M^{-1} e_q] d,

and the same of r. The forces :math:`\lambda'` push beside those drops: none on open nodes, and on a
closed one its contact force less what the attraction gains beyond the drop at g = 0. What is left
for an active set to solve, again and again, are the closed nodes alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Motions:
    """Gaps then slips (2 k,) by forces (2 k,) and p extra unknowns: `start` (2 k,), `compliance`
    (2 k, 2 k), `columns` (2 k, p); the equations of these: `rows` (p, 2 k), `pivot` (p, p), `right` (p,).
    """

    start: Floats
    compliance: Floats
    columns: Floats
    rows: Floats
    pivot: Floats
    right: Floats


@dataclass(frozen=True, eq=False)
class Elimination:
    """Motions `left` without the drops of the nodes `attracted` (q,), which follow from forces and
    extra unknowns: `constant` (q,) less `by_force` (q, 2 k) and `by_extra` (q, p) times them.
    """

    left: Motions
    attracted: Ints
    constant: Floats
    by_force: Floats
    by_extra: Floats

    @classmethod
    def of(cls, whole: Motions, stiffness: Floats, reference_gap: Floats) -> Elimination:
        """Of the drops by the negative `stiffness` (k,) from the reference gaps (k,); raises
        LinAlgError where it has exactly its critical value.
        """
        q, C = np.flatnonzero(stiffness > 0.0), whole.compliance
        missing = reference_gap[q] - whole.start[q]
        M = C[np.ix_(q, q)] - np.diag(1.0 / stiffness[q])
        found: Floats = np.linalg.solve(M, np.column_stack([missing, whole.columns[q], C[q]])).astype(float)
        p = whole.columns.shape[1]
        constant, by_extra, by_force = found[:, 0], found[:, 1 : 1 + p], found[:, 1 + p :]
        onto, r = C[:, q], whole.rows[:, q]
        left = Motions(
            whole.start + onto @ constant,
            C - onto @ by_force,
            whole.columns - onto @ by_extra,
            whole.rows - r @ by_force,
            whole.pivot - r @ by_extra,
            whole.right - r @ constant,
        )
        return cls(left, q, constant, by_force, by_extra)

    def drops(self, force: Floats, extra: Floats) -> Floats:
        """The drops (q,) under forces (2 k,) beside them and with the extra unknowns (p,)."""
        return np.asarray(self.constant - self.by_force @ force - self.by_extra @ extra)


def bordered(matrix: Floats, columns: Floats, rows: Floats, pivot: Floats) -> Floats:
    """A matrix (n, n) with p further columns, rows and their pivots: (n + p, n + p)."""
    n, p = columns.shape
    whole = np.empty((n + p, n + p))
    whole[:n, :n], whole[:n, n:], whole[n:, :n], whole[n:, n:] = matrix, columns, rows, pivot
    return whole

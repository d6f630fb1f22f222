r"""Stiffness of contact forces that turn with the profile, in the small block of the nodes near contact.

A node that moves along a profile, by dx[, dz], takes the direction of its contact force along, and at a
slope of the friction coefficient its size: :math:`df = T\,dx`. With the compliance C of the body that gives
:math:`u = C (f + T u)`, so :math:`(1 - C T)^{-1} C` takes the place of C, and the same of free motions.
Where the feedback C T exceeds 1, stability is lost: no solution, or one in the wrong direction.

Components are ordered per node, (y, x[, z]); axes (k, 1 + d, 1 + d) are rows n, t[, t2] in that order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class FollowerStiffness:
    """Forces (y, x[, z]) per displacement of nodes, `rate` (l, 1 + d): of the `loaded` nodes (l,) among the
    near ones, along x (`axis` 1) or z (2).
    """

    loaded: Ints
    axis: Ints
    rate: Floats

    @classmethod
    def of(cls, rate: Floats) -> FollowerStiffness:
        """From the rates of all nodes (k, 1 + d, d); on flat surfaces without slopes of friction none
        counts.
        """
        loaded, axis = np.nonzero(rate.any(axis=1))
        return cls(loaded, axis + 1, rate[loaded, :, axis])

    @property
    def _first(self) -> Ints:
        """Rows of the nodes' first components."""
        return self.rate.shape[1] * self.loaded

    def _through(self, C: Floats) -> Floats:
        """C (q, m) times the columns of T that are not zero."""
        each = (C[:, self._first + a] * self.rate[:, a] for a in range(self.rate.shape[1]))
        return np.asarray(sum(each))

    def apply(self, C: Floats, W: Floats) -> tuple[Floats, Floats]:
        """(1 - C T)^-1 applied to the compliance (m, m) and to motions (m, p): T has few columns."""
        if not self.loaded.size:
            return C, W
        x, B = self._first + self.axis, self._through(C)
        gain = B @ np.linalg.inv(np.eye(x.size) - B[x])
        return C + gain @ C[x], W + gain @ W[x]

    def force(self, moved: Floats) -> Floats:
        """Change of the forces (m,) by displacements (m,)."""
        change = np.zeros((moved.size // self.rate.shape[1], self.rate.shape[1]))
        np.add.at(change, self.loaded, self.rate * moved[self._first + self.axis, None])
        return change.ravel()

    def transposed(self, rows: Floats) -> Floats:
        """Rows (p, m) times T."""
        through = np.zeros_like(rows)
        through[:, self._first + self.axis] = self._through(rows)
        return through


def local(axes: Floats, columns: Floats) -> Floats:
    """Columns (m, p) of (y, x[, z]) as those along the `axes`; the same on a flat surface."""
    if not axes[:, 0, 1:].any():
        return columns
    by_node = columns.reshape(*axes.shape[:2], -1)
    return np.asarray(np.matmul(axes, by_node).reshape(columns.shape))

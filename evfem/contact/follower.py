r"""Stiffness of contact forces that turn with the profile, in the small block of the nodes near
contact.

A node that moves by dx along a profile takes the direction of its contact force along, and at a
slope of the friction coefficient its size: :math:`df = T\,dx`. With the compliance C of the body
that gives :math:`u = C (f + T u)`, so :math:`(1 - C T)^{-1} C` takes the place of C, and the same of
free motions.

Where the feedback C T of the slipping nodes exceeds 1, the forces push them aside harder than the
tissue holds them: stability is lost, and the linear problem has no solution, or one the wrong way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class FollowerStiffness:
    """Forces along x and y per x displacement, `rate` (l, 2), of the `loaded` ones (l,) among
    `size` = k nodes. Components of others come y before x.
    """

    size: int
    loaded: Ints
    rate: Floats

    @classmethod
    def of(cls, rate: Floats) -> FollowerStiffness:
        """From the rates of all nodes (k, 2); on a flat surface without slopes of friction no node
        is loaded.
        """
        loaded = np.flatnonzero(rate.any(axis=1))
        return cls(len(rate), loaded, rate[loaded])

    def apply(self, C: Floats, W: Floats) -> tuple[Floats, Floats]:
        """(1 - C T)^-1 applied to the compliance (2 k, 2 k) and to motions (2 k, p): a small
        system, T has few columns.
        """
        if not self.loaded.size:
            return C, W
        x, y = self.size + self.loaded, self.loaded
        B = C[:, x] * self.rate[:, 0] + C[:, y] * self.rate[:, 1]
        gain = B @ np.linalg.inv(np.eye(x.size) - B[x])
        return C + gain @ C[x], W + gain @ W[x]

    def force(self, moved: Floats) -> Floats:
        """Change of the forces (2 k,) by displacements (2 k,)."""
        change = np.zeros((2, self.size))
        change[:, self.loaded] = self.rate.T[::-1] * moved[self.size + self.loaded]
        return change.ravel()

    def transposed(self, rows: Floats) -> Floats:
        """Rows (p, 2 k) times T."""
        through, x = np.zeros_like(rows), self.size + self.loaded
        through[:, x] = rows[:, x] * self.rate[:, 0] + rows[:, self.loaded] * self.rate[:, 1]
        return through


def local(axes: Floats, columns: Floats) -> Floats:
    """Columns (2 k, m), y before x, as (all normal, all tangential) ones; the same on a flat
    surface.
    """
    if not axes[:, 0, 0].any():
        return columns
    k, found = len(axes), np.empty(columns.shape)
    y, x = columns[:k], columns[k:]
    for a, part in enumerate((found[:k], found[k:])):
        np.multiply(axes[:, a, :1], x, out=part)
        part += axes[:, a, 1:] * y
    return found

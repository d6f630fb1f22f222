r"""Stiffness of contact forces that turn with the profile, in the small block of the nodes near
contact.

A node that moves by dx along a profile takes the direction of its contact force along, and at a
slope of the friction coefficient its size: :math:`df = T\,dx`. With the compliance C of the body
that gives :math:`u = C (f + T u)`, so :math:`(1 - C T)^{-1} C` takes the place of C, and the same of
free motions.

Where the feedback C T of the slipping nodes exceeds 1, the forces push them aside harder than the
tissue holds them: stability is lost and the linear problem has no solution, or one the wrong way.
T is then scaled to `STABLE` of the critical value (`FollowerStiffness.weaker`), as the attraction's
negative stiffness is (`evfem.contact.signorini`): the iterations go the way the nodes are pushed,
in small steps, to where they are held again. Only where no time passes: a shorter time step is held
by viscosity and inertia. The equilibrium found there is that of the whole forces, since the
residual knows nothing of T.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import STABLE
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK


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

    def weaker(self, C: Floats, axes: Floats, status: Ints, friction: Floats) -> Iterator[FollowerStiffness]:
        """This stiffness scaled down to what the body with the compliance C (2 k, 2 k) holds: first
        with its touching nodes held by the surface as their `status` (k,) says, then free ones.

        `axes` (k, 2, 2) with the rows n and t of every node, `friction` coefficients (k,).
        """
        if not self.loaded.size:
            return
        x, y = self.size + self.loaded, self.loaded
        free = C[np.ix_(x, x)] * self.rate[:, 0] + C[np.ix_(x, y)] * self.rate[:, 1]
        for feedback in (self._held(C, axes, status, friction), free):
            largest = float(np.linalg.eigvals(feedback).real.max(initial=0.0))
            if largest > STABLE:
                yield replace(self, rate=STABLE / largest * self.rate)

    def _held(self, C: Floats, axes: Floats, status: Ints, friction: Floats) -> Floats:
        """Feedback among the s slipping nodes (s, s), which move along their tangents while closed
        gaps stay closed, sticking nodes where they are, and friction follows the pressing force.
        """
        k, slips = self.size, np.flatnonzero(status >= FORWARD)
        C = local(axes, local(axes, C).T).T
        # shear force per pressing force: against the slip
        ratio = friction * ((status == BACKWARD).astype(float) - (status == FORWARD))
        pressed = C.copy()
        pressed[:, :k] += C[:, k:] * ratio
        held = np.concatenate([np.flatnonzero(status != OPEN), k + np.flatnonzero(status == STICK)])
        t = k + slips
        try:
            back = np.linalg.solve(pressed[np.ix_(held, held)], C[np.ix_(held, t)])
        except np.linalg.LinAlgError:  # friction wedges the nodes: nothing tells how far they move
            return np.zeros((0, 0))
        compliance = C[np.ix_(t, t)] - pressed[np.ix_(t, held)] @ back
        rate = np.zeros((k, 2))
        rate[self.loaded] = self.rate
        normal, shear = np.einsum("kij,kj->ik", axes, rate)
        push = axes[:, 1, 0] * (shear - ratio * normal)
        return compliance * push[slips]


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

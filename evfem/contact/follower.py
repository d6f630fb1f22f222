r"""Candidates for contact; follower-load stiffness of contact forces that rotate with the profile, in the
block of active nodes.

As a node moves along a profile, by dx[, dz], its contact force rotates with the normal, and at a slope of
the friction coefficient changes its size: :math:`df = T\,dx`. With the compliance C of the body that gives
:math:`u = C (f + T u)`: :math:`(1 - C T)^{-1} C` replaces C, and likewise for motions without contact forces.
Where the feedback C T exceeds 1, stability is lost: no solution, or one in the wrong direction.

Components are ordered per node, (y, x[, z]); axes (k, 1 + d, 1 + d) are rows n, t[, t2] in that order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import STABLE
from evfem.contact.byforce import OF_GAP_ALONE, OfGapAlone
from evfem.contact.signorini import SLIP, side
from evfem.surface.pad import SurfaceState


@dataclass(frozen=True, eq=False)
class Candidates:
    """Data of the c candidate nodes at the iterate; d = 1 in the plane, 2 in space (forces there in N).

    The `surface` below them, slips since the last accepted state (c, d) in mm, contact forces (c, 1 + d) in
    N/mm, statuses (c,), friction coefficients (c,), their slopes (c, d) in 1/mm. `interface_compliance` (c,
    1 + d) in mm per N/mm: 0, or 1 / (penalty x tributary length). A law of friction gives its derivative by
    the contact force as the coefficient, `cohesion` (c,) in N/mm, and the growth with the slip,
    `slip_stiffness` (c,) in N/mm per mm. Attraction: see `AttractionStiffness`.
    """

    surface: SurfaceState
    slip: Floats
    force: Floats
    status: Ints
    friction: Floats
    interface_compliance: Floats
    negative_stiffness: Floats
    gain_on_closing: Floats
    friction_slope: Floats
    by_force: OfGapAlone = OF_GAP_ALONE
    cohesion: Floats | None = None
    slip_stiffness: Floats | None = None

    def __getitem__(self, nodes: Ints) -> Candidates:
        """The data of these candidates."""
        columns: Any = (None if column is None else column[nodes] for column in vars(self).values())
        return Candidates(*columns)

    def follower_rate(self, own: Floats) -> Floats:
        """Follower-load stiffness: change of the contact force (y, x[, z]) per displacement of its node along
        x[, z], (c, 1 + d, d), with the diagonal compliances `own` (c, d) along these.
        """
        rotated_force = self.surface.turned(self.force)
        grown = np.einsum("caj,cak->ckj", self.friction_growth(own), self.surface.axes[:, 1:])
        return np.asarray(rotated_force + grown)

    @property
    def shear_direction(self) -> Floats:
        """Unit vectors (c, d) of the friction of slipping nodes, 0 of others."""
        if self.force.shape[1] == 2:
            return side(self.status)
        shear = np.hypot(*self.force[:, 1:].T)
        slips = (self.status == SLIP) & (shear > 0.0)
        return np.where(slips[:, None], self.force[:, 1:], 0.0) / np.where(slips, shear, 1.0)[:, None]

    def secant_coefficients(self, compliance: Floats) -> Floats | None:
        """Secant friction coefficients (c,) of a friction law, bounded, or None under Coulomb's."""
        if self.cohesion is None:
            return None
        normal, along = np.maximum(self.force[:, 0], 0.0), self.shear_direction
        (c, n), every = self.force.shape, np.arange(len(normal))
        chord = self.friction + self.cohesion / np.where(normal > 0.0, normal, np.inf)
        blocks = compliance.reshape(c, n, c, n)[every, 0, every].astype(float)
        pressed = -blocks[:, 1:] / blocks[:, :1]
        on = np.where(along.any(axis=1), np.sum(pressed * along, axis=1), np.linalg.norm(pressed, axis=1))
        return np.where(chord * on > STABLE, STABLE / np.maximum(on, 1e-300), chord)

    def friction_growth(self, own: Floats) -> Floats:
        """The frictional contribution to it: change of the shear force (a) per displacement of the node along
        x[, z] (j), (c, d, d). Where friction falls faster than the tissue stiffens, a node snaps forward: its
        friction keeps the present coefficient.
        """
        direction = self.shear_direction
        if self.slip_stiffness is None and not self.friction_slope.any():
            return np.zeros((*direction.shape, direction.shape[1]))
        growth = direction[:, :, None] * (self.friction_slope * self.force[:, :1])[:, None, :]
        along = np.any(direction, axis=1, keepdims=True)
        if self.slip_stiffness is not None:
            # friction resists a slipping node along its slip, a sticking one in every direction
            held = np.where(
                along[:, :, None], direction[:, :, None] * direction[:, None, :], np.eye(direction.shape[1])
            )
            growth -= self.slip_stiffness[:, None, None] * (held @ self.surface.travel)
        steep = np.trace(growth, axis1=1, axis2=2)
        gives = np.sum(np.where(along, direction**2, 1.0 / direction.shape[1]) * own, axis=1)
        kept: Any = (steep < 0.0) | (steep * gives < STABLE)
        return np.asarray(np.where(kept[:, None, None], growth, 0.0))


@dataclass(frozen=True, eq=False)
class FollowerStiffness:
    """Follower-load stiffness: forces (y, x[, z]) per displacement, `rate` (l, 1 + d), of the nodes with
    force, `loaded` (l,), among the active ones, along x (`axis` 1) or z (2).
    """

    loaded: Ints
    axis: Ints
    rate: Floats

    @classmethod
    def of(cls, rate: Floats) -> FollowerStiffness:
        """From the rates of all nodes (k, 1 + d, d); none on flat surfaces with constant friction."""
        loaded, axis = np.nonzero(rate.any(axis=1))
        return cls(loaded, axis + 1, rate[loaded, :, axis])

    @property
    def _first(self) -> Ints:
        """Rows of the nodes' first components."""
        return self.rate.shape[1] * self.loaded

    def _low_rank_product(self, C: Floats) -> Floats:
        """C (q, m) times the columns of T that are not zero."""
        each = (C[:, self._first + a] * self.rate[:, a] for a in range(self.rate.shape[1]))
        return np.asarray(sum(each))

    def apply(self, C: Floats, W: Floats) -> tuple[Floats, Floats]:
        """(1 - C T)^-1 applied to the compliance (m, m) and to motions (m, p): T has few columns."""
        x, B = self._first + self.axis, self._low_rank_product(C)
        gain = B @ np.linalg.inv(np.eye(x.size) - B[x])
        return C + gain @ C[x], W + gain @ W[x]

    def force(self, moved: Floats) -> Floats:
        """Change of the forces (m,) by displacements (m,)."""
        change = np.zeros((moved.size // self.rate.shape[1], self.rate.shape[1]))
        np.add.at(change, self.loaded, self.rate * moved[self._first + self.axis, None])
        return change.ravel()

    def transposed(self, rows: Floats) -> Floats:
        """Rows (p, m) times T."""
        product = np.zeros_like(rows)
        product[:, self._first + self.axis] = self._low_rank_product(rows)
        return product


def local(axes: Floats, columns: Floats) -> Floats:
    """Columns (m, p) of (y, x[, z]) as those along the `axes`; the same on a flat surface."""
    if not axes[:, 0, 1:].any():
        return columns
    by_node = columns.reshape(*axes.shape[:2], -1)
    return np.asarray(np.matmul(axes, by_node).reshape(columns.shape))

r"""The linearised body as its contact candidates see it, in three dimensions: what differs from the
plane (`evfem.contact.condensed`).

Components are ordered per node: (x, y, z) in the laboratory frame, (n, t1, t2) in the frame of a
node, with :math:`n = (-h', 1, 0)/r`, :math:`t_1 = (1, h', 0)/r`, :math:`t_2 = (0, 0, 1)`,
:math:`r = \sqrt{1 + h'^2}` on a profile h(x). Contact is Coulomb's disc (`evfem.contact.disc`). As in
the plane a contact force turns with its node as that moves in x, and changes with a friction
coefficient that has a slope over x: :math:`df = T\,dx` with three components for each node.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import STABLE
from evfem.contact.attracted import AttractionStiffness
from evfem.contact.condensed import Candidates, LinearContactStep
from evfem.contact.coulomb import SLIP, DiscProblem, DiscSolution
from evfem.contact.disc import solve_attracted_disc


@dataclass(frozen=True, eq=False)
class SpatialCandidates(Candidates):
    """The same of candidates with two slips (c, 2); forces and the interface's compliance are (c,
    3).
    """

    @cached_property
    def axes(self) -> Floats:
        """Rows n, t1 and t2 of every node, (c, 3, 3)."""
        cos, sin = 1.0 / self.surface.stretch, self.surface.slope / self.surface.stretch
        axes = np.zeros((cos.size, 3, 3))
        axes[:, 0, 0], axes[:, 0, 1] = -sin, cos
        axes[:, 1, 0], axes[:, 1, 1] = cos, sin
        axes[:, 2, 2] = 1.0
        return axes

    def follower_rate(self, own: Floats) -> Floats:
        """Change of the contact force in the laboratory frame per x displacement of its node, (c,
        3); `own` (c,) is the compliance of each node along x.
        """
        axes, force = self.axes, self.force
        rate = self.surface.curvature / self.surface.stretch**2
        turned = rate[:, None] * (force[:, 1:2] * axes[:, 0] - force[:, :1] * axes[:, 1])
        shear = np.hypot(force[:, 1], force[:, 2])
        slips = (self.status == SLIP) & (shear > 0.0)
        along = np.where(slips[:, None], force[:, 1:], 0.0) / np.where(slips, shear, 1.0)[:, None]
        growth = self.friction_slope * force[:, 0]
        steep = growth * along[:, 0]  # a node of negative compliance is held by the others alone
        growth = np.where((steep <= 0.0) | (steep * own < STABLE), growth, 0.0)
        return turned + growth[:, None] * np.einsum("ca,cak->ck", along, axes[:, 1:])

    def friction_growth(self, own: Floats) -> Floats:
        """None (c,): in three dimensions the forces of a linear step are those at its beginning."""
        return np.zeros_like(own)


@dataclass(frozen=True, eq=False)
class Turning:
    """Forces (x, y, z) per x displacement, `rate` (l, 3), of the `loaded` ones (l,) among the nodes
    near contact.
    """

    loaded: Ints
    rate: Floats

    @classmethod
    def of(cls, rate: Floats) -> Turning:
        """From the rates of all nodes (k, 3)."""
        loaded = np.flatnonzero(rate.any(axis=1))
        return cls(loaded, rate[loaded])

    def apply(self, C: Floats, W: Floats) -> tuple[Floats, Floats]:
        """(1 - C T)^-1 applied to the compliance (3 k, 3 k) and to motions (3 k, p)."""
        if not self.loaded.size:
            return C, W
        x = 3 * self.loaded
        B = self._through(C)
        gain = B @ np.linalg.inv(np.eye(x.size) - B[x])
        return C + gain @ C[x], W + gain @ W[x]

    def _through(self, C: Floats) -> Floats:
        return np.asarray(sum(C[:, 3 * self.loaded + a] * self.rate[:, a] for a in range(3)))

    def force(self, moved: Floats) -> Floats:
        """Change of the forces (3 k,) by displacements (3 k,)."""
        change = np.zeros((moved.size // 3, 3))
        change[self.loaded] = self.rate * moved[3 * self.loaded, None]
        return change.ravel()

    def transposed(self, rows: Floats) -> Floats:
        """Rows (p, 3 k) times T."""
        through = np.zeros_like(rows)
        through[:, 3 * self.loaded] = self._through(rows)
        return through


@dataclass(frozen=True, eq=False)
class SpatialContactStep(LinearContactStep):
    """One linear step of the condensed body in three dimensions."""

    @staticmethod
    def _by_node(force: Floats) -> Floats:
        return force.reshape(-1, 3)

    def _solve_near(self, near: Ints, free: Floats, status: Ints) -> tuple[DiscSolution, Floats]:
        """Contact among the `near` nodes: solution in their frames, and the forces (3 k,) that move
        the body, those of the turning included.
        """
        own = np.diagonal(self.body.compliance)[0::3]
        turning = Turning.of(self.candidates.follower_rate(own)[near])
        known, rows = self.candidates, self.body.rows(near)
        C, W = turning.apply(self.body.among(near), free[rows])
        axes = known.axes[near]
        at_rest = np.column_stack([known.surface.normal_gap[near], known.slip[near]])
        start = in_frames(axes, W[:, :1])[:, 0] + at_rest.ravel()
        compliance = in_frames(axes, in_frames(axes, C).T).T
        if known.interface_compliance.any():
            compliance = compliance + np.diag(known.interface_compliance[near].ravel())
        extra = None
        if self.unknowns:
            row, pivot, value = self._balance(rows, free)
            through = turning.transposed(row)
            row, pivot, value = row + through @ C, pivot + through @ W[:, 1:], value - through @ W[:, 0]
            moved, pushed = in_frames(axes, W[:, 1:]), in_frames(axes, row.T).T
            extra = self._settling(moved, pushed, (pivot, value), free)
        cohesion = None if known.cohesion is None else known.cohesion[near]
        problem = DiscProblem(start, compliance, known.friction[near], extra, cohesion=cohesion)
        attraction = AttractionStiffness(
            known.negative_stiffness[near], known.surface.normal_gap[near], known.gain_on_closing[near]
        )
        present = np.where((status > 0)[:, None], known.force[near], 0.0).ravel()
        found = solve_attracted_disc(problem, attraction, status, present)
        pressed = (found.force + found.attraction_drop).reshape(-1, 3)
        force = np.einsum("ka,kab->kb", pressed, axes).ravel()
        if turning.loaded.size:
            force = force + turning.force(W[:, 0] + C @ force + W[:, 1:] @ found.extra)
        return found, force


def in_frames(axes: Floats, columns: Floats) -> Floats:
    """Columns (3 k, m) of (x, y, z) as those of (n, t1, t2), for axes (k, 3, 3)."""
    by_node = columns.reshape(len(axes), 3, -1)
    return np.asarray(np.matmul(axes, by_node).reshape(columns.shape))

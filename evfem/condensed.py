r"""The linearised body as its contact candidates see it: a dense compliance, and the contact problem posed on
it.

With the condensed tangent S, the attraction's stiffness G and the bone's step b (x known; y known, or the
unknown d under a prescribed force),

.. math:: (S_{cc} - G)\,\Delta u_c = g_c - f_c + f_c^+ - S_{cb} b, \qquad
          S_{yc}\Delta u_c + S_{yx} b_x + S_{yy} b_y = g_y + F_y .

:math:`C = (S_{cc} - G)^{-1}` is kept with the factorisation. On a curved profile the contact force turns with
the node: :math:`df = \phi'(-\lambda_n t + \lambda_t n)\,dx`, :math:`\phi' = h''/(1 + h'^2)`; that stiffness
changes in every iteration but touches only the nodes near contact, so it is put into their small block alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.contact import OPEN, Border, ContactProblem, ContactSolution, solve_contact
from evfem.mesh import Floats, Ints
from evfem.pad import Frame


@dataclass(frozen=True, eq=False)
class Candidates:
    """What is known of the c candidate nodes at the iterate: frame, slip since the last accepted state (c,),
    contact forces (c, 2) along normal and tangent, statuses (c,), friction coefficients (c,), and the
    interface's own compliance (c, 2) in mm per N/mm: 0 for exact contact, 1 / (penalty x tributary length)
    for the penalty variant, which thereby needs no other solver.
    """

    frame: Frame
    slip: Floats
    force: Floats
    status: Ints
    friction: Floats
    softness: Floats

    @property
    def axes(self) -> Floats:
        """Rows n and t of every node, (c, 2, 2)."""
        cos, sin = 1.0 / self.frame.stretch, self.frame.slope / self.frame.stretch
        return np.stack([np.stack([-sin, cos], axis=1), np.stack([cos, sin], axis=1)], axis=1)

    @property
    def turning(self) -> Floats:
        """Change of the contact force in the laboratory frame by the node's displacement, (c, 2, 2)."""
        axes = self.axes
        rate = self.frame.curvature / self.frame.stretch**2
        by_x = rate[:, None] * (self.force[:, 1:] * axes[:, 0] - self.force[:, :1] * axes[:, 1])
        return np.stack([by_x, np.zeros_like(by_x)], axis=2)


@dataclass(frozen=True, eq=False)
class Condensed:
    """Condensed tangent on (candidates, bone x, bone y) and the compliance of the candidates, attraction
    included.
    """

    schur: Floats
    compliance: Floats

    @classmethod
    def make(cls, schur: Floats, attraction: Floats | None) -> Condensed:
        """From S (m, m) and the attraction's stiffness on the candidates (m - 2, m - 2), or None."""
        inner = schur[:-2, :-2] if attraction is None else schur[:-2, :-2] - attraction
        return cls(schur, np.asarray(np.linalg.inv(inner), dtype=np.float64))


@dataclass(frozen=True, eq=False)
class Step:
    """One linear step of the condensed body: contact is solved on it, and the candidates' displacement comes
    back.

    `residual` g (m,) of the forward solve, `bone` (2,) the bone's step (y ignored if `load` is given), `load`
    the force on the bone along y.
    """

    body: Condensed
    candidates: Candidates
    residual: Floats
    bone: Floats
    load: float | None

    def solve(self) -> tuple[Floats, Floats, Ints, Floats, int]:
        """(displacement (c, 2), contact force (c, 2) along n and t, statuses (c,), bone step (2,), number
        of dense solves).
        """
        free, effect = self._free_motion()
        axes = self.candidates.axes
        gap = self.candidates.frame.normal_gap + np.einsum("ck,ck->c", axes[:, 0], free.reshape(-1, 2))
        status, solves = self.candidates.status.copy(), 0
        near = np.flatnonzero((status != OPEN) | (gap < 0.0))
        if self.load is not None and not near.size:
            near = np.array([np.argmin(gap)])
        while True:
            found, lab = self._solve_near(near, free, effect, status[near])
            solves += found.solves
            motion = free + self._columns(near) @ lab.ravel()
            if effect is not None:
                motion = motion + effect * found.extra
            moved = motion.reshape(-1, 2)
            new_gap = self.candidates.frame.normal_gap + np.einsum("ck,ck->c", axes[:, 0], moved)
            new_gap[near] = 0.0
            hit = np.flatnonzero(new_gap < -1e-12 * (1.0 + np.abs(self.candidates.frame.gap)))
            status[near] = found.status
            if not hit.size:
                break
            near = np.union1d(near, hit)
        k = near.size
        force = np.zeros_like(self.candidates.force)
        force[near] = np.stack([found.force[:k], found.force[k:]], axis=1)
        bone = self.bone if self.load is None else np.array([self.bone[0], found.extra])
        return moved, force, status, bone, solves

    def _free_motion(self) -> tuple[Floats, Floats | None]:
        """Candidates' motion without contact forces (2 c,), and per unit of the bone's unknown travel (2
        c,).
        """
        S, C = self.body.schur, self.body.compliance
        axes, force = self.candidates.axes, self.candidates.force
        present = np.einsum("ca,cak->ck", force, axes).ravel()
        right = self.residual[:-2] - present - S[:-2, -2] * self.bone[0]
        if self.load is None:
            return C @ (right - S[:-2, -1] * self.bone[1]), None
        both = C @ np.stack([right, -S[:-2, -1]], axis=1)
        return both[:, 0], both[:, 1]

    def _columns(self, near: Ints) -> Floats:
        c = self.candidates.status.size
        return self.body.compliance.reshape(2 * c, c, 2)[:, near].reshape(2 * c, -1)

    def _solve_near(
        self, near: Ints, free: Floats, effect: Floats | None, status: Ints
    ) -> tuple[ContactSolution, Floats]:
        """Contact among the `near` nodes: solution in their frames, and forces (k, 2) in the laboratory
        frame, turning included.
        """
        k, known = near.size, self.candidates
        rows = (2 * near[:, None] + np.array([0, 1])).ravel()
        columns = self._columns(near)
        C, w = columns[rows], free[rows]
        turning: Floats | None = None
        e = None if effect is None else effect[rows]
        if known.frame.curvature[near].any():
            turning = _blocks(known.turning[near])
            solved = np.linalg.solve(
                np.eye(2 * k) - C @ turning, np.column_stack([C, w] + ([] if e is None else [e]))
            )
            C, w = solved[:, : 2 * k], solved[:, 2 * k]
            e = None if e is None else solved[:, 2 * k + 1]
        to_local = _rotation(known.axes[near])
        start = to_local @ w + np.concatenate([known.frame.normal_gap[near], known.slip[near]])
        border = None
        if e is not None:
            border = self._border(free, effect, columns, (C, w, e), turning, to_local)
        softness = np.diag(known.softness[near].T.ravel())
        problem = ContactProblem(start, to_local @ C @ to_local.T + softness, known.friction[near], border)
        found = solve_contact(problem, status)
        lab = to_local.T @ found.force
        if turning is not None:
            lab = lab + turning @ (w + C @ lab + (0.0 if e is None else e * found.extra))
        return found, lab.reshape(-1, 2)

    def _border(
        self,
        free: Floats,
        effect: Floats | None,
        columns: Floats,
        near: tuple[Floats, Floats, Floats],
        turning: Floats | None,
        to_local: Floats,
    ) -> Border:
        """Balance of the bone along y as the extra equation for its travel."""
        assert effect is not None
        assert self.load is not None
        C, w, e = near
        S_y = self.body.schur[-1]
        row = S_y[:-2] @ columns
        pivot = float(S_y[-1] + S_y[:-2] @ effect)
        value = float(self.residual[-1] + self.load - S_y[-2] * self.bone[0] - S_y[:-2] @ free)
        if turning is not None:
            through = row @ turning
            row, pivot, value = row + through @ C, pivot + float(through @ e), value - float(through @ w)
        return Border(to_local @ e, to_local @ row, pivot, value)


def _rotation(axes: Floats) -> Floats:
    """(2 k, 2 k) from interleaved laboratory components to (all normal, all tangential) components."""
    k = len(axes)
    rotation = np.zeros((2, k, k, 2))
    rotation[:, np.arange(k), np.arange(k)] = np.swapaxes(axes, 0, 1)
    return rotation.reshape(2 * k, 2 * k)


def _blocks(blocks: Floats) -> Floats:
    """Block-diagonal (2 k, 2 k) matrix of (k, 2, 2) blocks."""
    k = len(blocks)
    matrix = np.zeros((k, 2, k, 2))
    matrix[np.arange(k), :, np.arange(k)] = blocks
    return matrix.reshape(2 * k, 2 * k)

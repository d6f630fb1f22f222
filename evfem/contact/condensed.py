r"""The linearised body condensed onto its contact candidates, and the contact problem on that compliance.

The compliance :math:`C = S_{cc}^{-1}` is kept with the factorisation. On a curved surface contact forces
rotate with the node: :math:`df = \phi'(-\lambda_n t + \lambda_t n)\,dx`, :math:`\phi' = h''/(1 + h'^2)`. This
follower-load stiffness changes in every iteration, and enters only the small block of the active nodes
(`evfem.contact.follower`).

Algorithm (`LinearContactStep.solve`)::

    unloaded motion <- candidates' displacements without contact forces, and per unit of each extra unknown
    active <- nodes that touch, would penetrate under the present forces, or are strongly attracted
    repeat
        solve Signorini-Coulomb on `active` (`evfem.contact.signorini`), follower stiffness included
        displacements <- unloaded motion + C (forces on `active`)
        penetrated <- other candidates that have penetrated; stop if there are none
        active <- active and penetrated
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import DenseSolver, Floats, Ints, Memory, block, inverse, product
from evfem.common.constants import DISC_OWN, LARGE_SYSTEM, ROUNDING, SMALLEST_PIVOT, STABLE, WEAK
from evfem.contact.below import LEVEL, RIGID_BELOW, Level, RigidBelow
from evfem.contact.follower import Candidates, FollowerStiffness, local
from evfem.contact.signorini import (
    OPEN,
    AttractionStiffness,
    ContactNotSolved,
    ContactProblem,
    ContactSolution,
    ExtraUnknowns,
    Unstable,
)
from evfem.contact.solve import solve_with_attraction
from evfem.tissue.kernels.blocks import contact_loop

#: y, x and z of a vector (x, y, z), and conversely
COMPONENTS = np.array([1, 0, 2])
#: why there is no solution where the compliance is not positive
LOST_STABILITY = "the body softens under its load"


#: displacements, forces on the body (dim c,), contact forces (c, dim), statuses (c,), extra unknowns (p,),
#: linear systems solved, whether the attraction was scaled down
ContactOfCandidates = tuple[Floats, Floats, Floats, Ints, Floats, int, bool]


@dataclass(frozen=True, eq=False)
class StepSolution:
    """A solved linear step: displacements, contact forces and statuses of candidates, extra unknowns; the
    increment of the displacement of the `foundation` (dim c,), 0 of a rigid one.
    """

    moved: Floats
    force: Floats
    status: Ints
    extra: Floats
    solves: int
    reduced: bool
    foundation: Any = 0.0


@dataclass(frozen=True, eq=False)
class CondensedTangent:
    """Condensed tangent on (candidates, bone x, y[, z]), compliance of the candidates, with attraction: in
    space of single precision where the tangent was factorised so. Its contact problems use `memory`.
    """

    schur: Floats
    compliance: Any
    dim: int = 2
    memory: Memory = field(default_factory=Memory, repr=False)
    _last: dict[bytes, Any] = field(default_factory=dict, repr=False)

    @classmethod
    def make(
        cls, schur: Floats, coupling: Floats | None, dim: int = 2, memory: Memory | None = None
    ) -> CondensedTangent:
        """From S (m, m) and the attraction's stiffness between nodes (m - dim, m - dim), or None."""
        nodal = schur[:-dim, :-dim] if coupling is None else schur[:-dim, :-dim] - coupling
        compliance = inverse(nodal, symmetric=coupling is None)
        if dim == 2:
            compliance = compliance.astype(float, copy=False)  # that of the compiled contact
        return cls(schur, compliance, dim, memory or Memory())

    @cached_property
    def dense(self) -> DenseSolver:
        """What solves its contact problems."""
        return DenseSolver(self.memory)

    def rows(self, nodes: Ints) -> Ints:
        """Rows of these candidates, (y, x[, z]) node by node."""
        return np.asarray((self.dim * nodes[:, None] + COMPONENTS[: self.dim]).ravel())

    def among(self, nodes: Ints) -> Any:
        """Compliance among these candidates, in the order of `rows`; often those of the last call. It is lost
        in a call with others.
        """
        key = nodes.tobytes()
        if key not in self._last:
            rows, kind = self.rows(nodes), self.compliance.dtype
            self._last.clear()
            out = self.memory.array("among", (rows.size, rows.size), kind)
            self._last[key] = block(self.compliance, rows, rows, out)
        return self._last[key]

    @cached_property
    def bone_rows(self) -> Floats:
        """Forces on the bone by forces on the candidates, (dim, m - dim)."""
        return product(self.compliance.T, self.schur[-self.dim :, : -self.dim].T).T


@dataclass(frozen=True, eq=False)
class Condition:
    """`row` (m,) times displacements of candidates and bone plus `by_unknowns` (p,) times unknowns is
    `wanted`.
    """

    row: Floats
    by_unknowns: Floats
    wanted: float


@dataclass(frozen=True, eq=False)
class ExtraUnknown:
    """A scalar unknown of a step beside the displacements, and its equation: a prescribed force on the bone,
    or another `condition`.

    `push` (m,): condensed forces per unit of it; `axis`: the bone's component (0 x, 1 y, 2 z) whose
    force shall be `force` (N/mm), or that `along` a unit vector (dim,).
    """

    push: Floats
    axis: int
    force: float
    condition: Condition | None = None
    along: Floats | None = None

    def component(self, components: Floats) -> Floats:
        """Component along the prescribed force (...) of quantities (dim, ...) of the bone, here last."""
        if self.along is None:
            return np.asarray(components[self.axis - len(components)])
        return np.asarray(np.tensordot(self.along, components, axes=1))


@dataclass(frozen=True, eq=False)
class LinearContactStep:
    """One linear step of the condensed body: `residual` g (m,) of the forward solve, the bone's known
    increment (dim,), the `unknowns` that also move the body, and the `tolerance` of `ContactProblem`.
    """

    body: CondensedTangent
    candidates: Candidates
    residual: Floats
    bone: Floats
    unknowns: tuple[ExtraUnknown, ...] = ()
    below: RigidBelow = RIGID_BELOW
    tolerance: float = ROUNDING

    @cached_property
    def relative_compliance(self) -> Any:
        """Compliance of the candidates' positions relative to the surface."""
        return self.below.relative(self.body.compliance)

    def solve(self) -> StepSolution:
        """Contact among the candidates, their motion, and the extra unknowns."""
        body_motion = self._free_motion()
        unloaded_motion = self.below.unloaded(body_motion)
        normal_gap = self.candidates.surface.normal_gap
        # under the present contact forces: without them the whole pad would sink
        gap = normal_gap + self._along_normal(
            unloaded_motion[:, 0] + product(self.relative_compliance, self._present)
        )
        status = self.candidates.status
        own = np.diagonal(self.relative_compliance)[1 :: self.body.dim]
        # in contact, in the surface, or attracted with a feedback on the node itself
        fed_back = self.candidates.negative_stiffness * own > WEAK[self.body.dim]
        active = (status != OPEN) | (gap < 0.0) | fed_back
        if not active.any():  # the dense problem has at least one node: the one with the smallest gap
            active[np.argmin(gap)] = True
        found = self._compiled(active, unloaded_motion, body_motion) if self.body.dim == 2 else None
        moved, whole, force, status, extra, solves, reduced = found or self._settled(
            active, unloaded_motion, body_motion
        )
        # the shear of closed nodes also changes with their position within the step, by the slope of friction
        horizontal = moved.reshape(-1, self.body.dim)[:, ::2]
        grown = np.einsum("caj,cj->ca", self.candidates.friction_growth(self._own), horizontal)
        force[:, 1:] += np.where((status != OPEN)[:, None], grown, 0.0)
        body, foundation = self.below.displacement(moved, whole)
        return StepSolution(body, force, status, extra, solves, reduced, foundation)

    def _settled(self, active: Any, unloaded_motion: Floats, body_motion: Floats) -> ContactOfCandidates:
        """Contact of the `active` nodes (c,) bool, to which penetrating ones are added until none is left."""
        known, solves, nodes = self.candidates, 0, np.flatnonzero(active)
        status = known.status.copy()
        while True:
            found, pushed = self._solve_active(nodes, unloaded_motion, body_motion, status[nodes])
            solves += found.solves
            status[nodes] = found.status
            whole = np.zeros(unloaded_motion.shape[0])
            whole[self.body.rows(nodes)] = pushed
            moved = unloaded_motion[:, 0] + unloaded_motion[:, 1:] @ found.extra
            moved += product(self.relative_compliance, whole)
            gap = known.surface.normal_gap + self._along_normal(self.below.moved(moved))
            gap[nodes] = 0.0  # solved in the dense problem
            penetrated = np.flatnonzero(gap < -ROUNDING * (1.0 + np.abs(known.surface.gap)))
            if not penetrated.size:
                break
            nodes = np.union1d(nodes, penetrated)
        force = np.zeros_like(known.force)
        force[nodes] = found.force.reshape(-1, self.body.dim)
        return moved, whole, force, status, found.extra, solves, found.reduced

    def _compiled(
        self, active: Any, unloaded_motion: Floats, body_motion: Floats
    ) -> ContactOfCandidates | None:
        """The same in the plane in compiled code; None without it, for large systems, which are solved faster
        otherwise, above surfaces that tilt, where statuses cycle, and where a pad may snap.
        """
        if (settle := contact_loop()) is None or active.sum() > LARGE_SYSTEM or self.below.tilts:
            return None
        known, c, p = self.candidates, len(active), len(self.unknowns)
        none = np.zeros(c)
        columns = (
            known.surface.normal_gap,
            known.slip,
            known.friction,
            none if known.cohesion is None else known.cohesion,
            known.interface_compliance,
            known.surface.axes[:, :, ::-1].reshape(c, -1),
            known.follower_rate(self._own)[:, ::-1, 0],
            known.negative_stiffness,
            known.gain_on_closing,
            *known.by_force.columns(c),
            -ROUNDING * (1.0 + np.abs(known.surface.gap)),
        )
        equations = np.column_stack(self._far_balance(body_motion)) if p else np.zeros((0, 2 * c + 2))
        marks, found = np.stack([known.status, active]).astype(np.int32), np.empty(8 * c + p)
        arrays = (
            self.relative_compliance,
            unloaded_motion,
            np.column_stack(columns),
            equations,
            marks,
            found,
        )
        solves = settle(c, p, known.by_force.acts, self.tolerance, STABLE, DISC_OWN, arrays)
        moved, whole, acts, extra = np.split(found, [2 * c, 4 * c, 8 * c])
        status = marks[0].astype(np.int64)
        return None if solves < 0 else (moved, whole, acts.reshape(c, 4)[:, :2], status, extra, solves, False)

    def among(self, nodes: Ints) -> Any:
        """`relative_compliance` among these candidates, in the order of `CondensedTangent.rows`."""
        return self.below.among(self.body.among(nodes), self.body.rows(nodes))

    def lacking(self, solution: StepSolution, travel: float) -> float:
        """Force residual (N/mm) of the bone along the first unknown's axis for a prescribed `travel`."""
        unknown = self.unknowns[0]
        bone = self.bone.copy()
        bone[unknown.axis] += travel
        axis = unknown.axis - self.body.dim
        S = self.body.schur[axis]
        own = travel * (unknown.push[axis] + S[axis])
        found = S @ np.concatenate([solution.moved, bone]) - self.residual[axis]
        return float(unknown.force + own - found)

    @cached_property
    def _own(self) -> Floats:
        """Diagonal compliance of each candidate along x[, z], (c, d)."""
        own = np.diagonal(self.relative_compliance).astype(float)
        return own.reshape(-1, self.body.dim)[:, ::2]

    def _along_normal(self, moved: Floats) -> Floats:
        normal, dim = self.candidates.surface.axes[:, 0], self.body.dim
        return np.einsum("ck,ck->c", normal, moved.reshape(-1, dim)[:, COMPONENTS[:dim]])

    def _free_motion(self) -> Floats:
        """Candidates' motion without contact forces, and per unit of each extra unknown: (dim c, 1 + p)."""
        dim = self.body.dim
        right = self.residual[:-dim] - self._present - self.body.schur[:-dim, -dim:] @ self.bone
        pushes = (unknown.push[:-dim] for unknown in self.unknowns)
        return product(self.body.compliance, np.column_stack([right, *pushes]))

    @cached_property
    def _present(self) -> Floats:
        """Present contact forces on the candidates (dim c,), in the laboratory frame."""
        force = np.einsum("ca,cak->ck", self.candidates.force, self.candidates.surface.axes)
        return force[:, COMPONENTS[: self.body.dim]].ravel()

    def _solve_active(
        self, active_nodes: Ints, unloaded_motion: Floats, body_motion: Floats, status: Ints
    ) -> tuple[ContactSolution, Floats]:
        """Contact among the `active_nodes`, from their `unloaded_motion` relative to the surface and that of
        the body alone: solution in their frames, and the forces (dim k,) on the body, with those of the
        follower stiffness.

        That stiffness may be large: it multiplies the motion beyond that under the `present` forces, which is
        small near the equilibrium, and not the whole unloaded motion.
        """
        known, rows, dim = self.candidates[active_nodes], self.body.rows(active_nodes), self.body.dim
        follower = FollowerStiffness.of(known.follower_rate(self._own[active_nodes]))
        C, W, present = self.among(active_nodes), unloaded_motion[rows], self._present[rows]
        tilt = self.tilt(active_nodes)
        if follower.loaded.size or self.below.tilts:
            W[:, 0] += product(C, present)
            C, W = follower.apply(tilt.compliance(C), tilt.motion(W))
            W[:, 0] -= C @ tilt.shift(present)  # the unknowns are whole forces again, not increments
        balance = self._bone_balance(rows, body_motion, (C, W), (follower, tilt))
        problem = self._problem(known, (C, W), balance)
        attraction = AttractionStiffness(
            known.negative_stiffness, known.surface.normal_gap, known.gain_on_closing, known.by_force
        )
        touching = np.where((status != OPEN)[:, None], known.force, 0.0).ravel()
        try:
            found = solve_with_attraction(problem, attraction, status, touching)
        except ContactNotSolved as error:
            if follower.loaded.size and problem.gives_way:
                raise Unstable(LOST_STABILITY) from error
            raise
        pressed = (found.force + found.attraction_drop).reshape(-1, dim)
        force = np.einsum("ka,kab->kb", pressed, known.surface.axes).ravel()
        if follower.loaded.size:
            force = force + follower.force(W[:, 0] + C @ force + W[:, 1:] @ found.extra)
        return found, tilt.force(force, present)

    def tilt(self, nodes: Ints) -> Level:
        """What tilts below these candidates."""
        if not self.below.tilts:
            return LEVEL
        known = self.candidates[nodes]
        turned = known.surface.turned_by_slope(known.force)
        return self.below.tilt(nodes, self.body.rows(nodes), turned)

    def _problem(
        self, known: Candidates, moved: tuple[Floats, Floats], balance: tuple[Floats, Floats, Floats] | None
    ) -> ContactProblem:
        """The contact problem of these nodes in their frames: compliance, and the motion by other forces."""
        (C, W), extra, axes = moved, None, known.surface.axes
        at_rest = np.column_stack([known.surface.normal_gap, known.slip])
        if balance is not None:
            row, pivot, right = balance
            own = np.flatnonzero([unknown.condition is not None for unknown in self.unknowns])
            extra = ExtraUnknowns(local(axes, W[:, 1:]), local(axes, row.T).T, pivot, right, own)
        compliance = local(axes, local(axes, C).T).T
        return ContactProblem(
            local(axes, W[:, :1])[:, 0] + at_rest.ravel(),
            compliance,
            known.friction,
            extra,
            secants=known.secant_coefficients(compliance),
            cohesion=known.cohesion,
            give=known.interface_compliance.ravel() if known.interface_compliance.any() else None,
            tolerance=self.tolerance,
            dense=self.body.dense,
        )

    def _far_balance(self, body_motion: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """The unknowns' equations without follower forces: by forces on candidates (p, dim c), by unknowns
        (p, p), right-hand sides (p,), and the least pivots (p,): a body without contact must move with its
        load, not against it.
        """
        (S, by_unknowns, wanted, carried), dim = self.equations, self.body.dim
        pivot = S[:, :-dim] @ body_motion[:, 1:] + by_unknowns
        value = wanted - S[:, -dim:] @ self.bone - S[:, :-dim] @ body_motion[:, 0]
        bone = np.array([unknown.condition is None for unknown in self.unknowns])
        bone_forces = np.stack([unknown.component(self.body.schur[-dim:]) for unknown in self.unknowns])[
            :, :-dim
        ]
        floor = SMALLEST_PIVOT * np.abs(bone_forces @ body_motion[:, 1:]).max(initial=0.0)
        return carried, pivot, value, np.where(bone, floor, 0.0)

    def _bone_balance(
        self,
        rows: Ints,
        body_motion: Floats,
        active: tuple[Floats, Floats],
        turns: tuple[FollowerStiffness, Level],
    ) -> tuple[Floats, Floats, Floats] | None:
        """These equations with the follower forces of the active nodes, at `rows` (dim k,)."""
        if not self.unknowns:
            return None
        (C, W), (follower, tilt) = active, turns
        carried, pivot, value, floor = self._far_balance(body_motion)
        row, value = tilt.equations(carried[:, rows], value, self._present[rows])
        if follower.loaded.size:
            through = follower.transposed(row)
            row, pivot, value = row + through @ C, pivot + through @ W[:, 1:], value - through @ W[:, 0]
        own = np.diagonal(pivot)
        least_pivots = np.diag(np.where(np.abs(own) < floor, floor - own, 0.0))
        return row, pivot + least_pivots, value

    @cached_property
    def equations(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Equations of the p unknowns, the bone's balance along their axes or a condition: coefficients of
        displacements (p, m) and unknowns (p, p), right-hand sides (p,), and coefficients of forces on the
        candidates (p, m - dim).
        """
        dim = self.body.dim
        pushes = np.stack([unknown.push[-dim:] for unknown in self.unknowns], axis=1)
        bone = (self.body.schur[-dim:], self.body.bone_rows, pushes, self.residual[-dim:])
        S, carried, pushed, residual = (
            np.stack([one.component(rows) for one in self.unknowns]) for rows in bone
        )
        by_unknowns, wanted = -pushed, residual + np.array([unknown.force for unknown in self.unknowns])
        for i, unknown in enumerate(self.unknowns):
            if (condition := unknown.condition) is not None:
                S[i], by_unknowns[i], wanted[i] = condition.row, condition.by_unknowns, condition.wanted
                carried[i] = product(self.body.compliance.T, condition.row[:-dim])
        return S, by_unknowns, wanted, carried

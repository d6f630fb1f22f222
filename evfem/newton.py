r"""One equilibrium step: outer Newton iterations on the whole body, contact solved exactly inside each of
them.

At the iterate u with contact forces lam and attraction f the out-of-balance forces are R = f_int(u) - f(u) -
lam. With the factorised (possibly older) tangent K of the tissue, condensed onto the candidates c and the
bone b,

.. math:: S_{cc}\,\Delta u_c + S_{cb}\,\Delta u_b - G\,\Delta u_c = g_c + \lambda^+ - \lambda, \qquad
          S_{yc}\,\Delta u_c + S_{yy}\,\Delta u_y = g_y - F - ... ,

where G is the attraction's stiffness. The compliance :math:`C' = (S_{cc} - G)^{-1}` turns this into a contact
problem for the new forces (`evfem.contact`); a prescribed force makes the bone's travel its extra unknown.
Then the interior follows by the backward solve. The factorisation is kept across iterations and steps and
renewed when the residual stalls or the iterations it would save cost more. A step is accepted only if
residual, gaps, penetration, stick, slip direction and cone all hold at the accepted positions.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evfem import pad as outline
from evfem.attraction import Attraction
from evfem.body import Body
from evfem.condensed import Candidates, Condensed, Step
from evfem.contact import BACKWARD, FORWARD, OPEN, STICK, ContactNotSolved
from evfem.linear import Singular, make_condensation
from evfem.mesh import Floats, Ints

#: renew the factorisation when more iterations than this would be needed with the old one
PATIENCE = 5
MAX_ITERATIONS = 40
SMALLEST_J = 0.05
SMALLEST_FORCE = 1e-6


class StepFailed(ArithmeticError):
    """An equilibrium was not found; `residuals` is the history, `reason` says what went wrong."""

    def __init__(self, reason: str, residuals: list[float]) -> None:
        super().__init__(reason)
        self.reason, self.residuals = reason, residuals


@dataclass(frozen=True, eq=False)
class State:
    """A converged configuration: displacements u (N, 2), contact forces on the pad nodes along the profile's
    normal and tangent (P, 2), their statuses (P,), the bone's translation (2,), voltage, attraction on the
    pad nodes (P, 2), forces on the bone (2,), nodal velocities (N, 2) in mm/s."""

    u: Floats
    contact_force: Floats
    status: Ints
    bone: Floats
    voltage: float
    attraction: Floats
    reaction: Floats
    velocity: Floats


@dataclass(frozen=True)
class Target:
    """Where a step goes: bone translation (2,) in mm, or its x and the downward force on it (N/mm);
    voltage (V); seconds it takes.
    """

    bone: Floats
    force: float | None
    voltage: float
    duration: float = 0.0


@dataclass
class Record:
    """Work done: iterations, factorisations and dense contact solves, counted since the start."""

    iterations: int = 0
    factorisations: int = 0
    contact_solves: int = 0
    backend: str = "none"
    residuals: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Balance:
    """Out-of-balance forces of the reduced unknowns (n,), their largest relative to the reaction, the
    prescribed force on the bone along y.
    """

    forces: Floats
    residual: float
    load: float | None


class Equilibrium:
    """Finds equilibria of a body on a surface, with or without attraction, one step after the other."""

    def __init__(
        self,
        body: Body,
        pad: outline.Pad,
        surface: Any,
        attraction: Attraction | None,
        tolerance: float,
        threads: int = 1,
    ) -> None:
        self.body, self.pad, self.surface, self.attraction = body, pad, surface, attraction
        self.tolerance, self.threads = tolerance, threads
        self.penalties: tuple[float, float] | None = None
        self.record = Record()
        self.points = body.space.mesh.points
        self.candidates: Ints = np.zeros(0, dtype=np.int64)
        self.length = float(
            np.median(
                np.hypot(
                    *(self.points[pad.nodes[pad.edges[:, 0]]] - self.points[pad.nodes[pad.edges[:, 1]]]).T
                )
            )
        )
        self._factor: Any = None
        self._condensed: Any = None
        self._touching: Any = np.zeros(pad.nodes.size, dtype=bool)
        self._frozen = False
        self._outdated = False

    # -- what a state is
    # ----------------------------------------------------------------------------------------------

    def rest(self, bone: Floats, voltage: float) -> State:
        """The undeformed body, translated by `bone`."""
        zero = np.zeros((self.pad.nodes.size, 2))
        u = np.broadcast_to(bone, self.points.shape).copy()
        state = State(
            u,
            zero,
            np.zeros(len(zero), dtype=np.int64),
            np.array(bone, dtype=float),
            voltage,
            zero,
            np.zeros(2),
            np.zeros_like(u),
        )
        return replace(state, attraction=self.attraction_at(state, state, voltage))

    def positions(self, u: Floats) -> Floats:
        """Current positions of the pad nodes (P, 2)."""
        return self.points[self.pad.nodes] + u[self.pad.nodes]

    def contact_forces(self, state: State) -> Floats:
        """Contact forces on the pad nodes in the laboratory frame (P, 2)."""
        frame = outline.frame(self.surface, self.positions(state.u))
        normal, shear = state.contact_force.T
        slope, stretch = frame.slope, frame.stretch
        return np.stack([shear - slope * normal, normal + slope * shear], axis=1) / stretch[:, None]

    # -- one step
    # -------------------------------------------------------------------------------------------------------

    def step(
        self, old: State, target: Target, frozen: Floats | None = None, start: State | None = None
    ) -> State:
        """Equilibrium at `target`, friction counted from `old`; `frozen` attraction (P, 2) instead of the
        current one if given; iterations begin at `start` (default `old`). Raises `StepFailed`."""
        travel = abs(target.bone[1] - old.bone[1]) if target.force is None else 0.0
        self._touching, self._frozen = old.status != OPEN, frozen is not None
        self.choose_candidates(old, 1.2 * travel)
        self._begin(old, target.duration)
        state = replace(start or old, voltage=target.voltage)
        history: list[float] = []
        for _ in range(MAX_ITERATIONS):
            state, balance = self._balance(old, state, target, frozen)
            arrived = target.bone[0] == state.bone[0] and (
                target.force is not None or target.bone[1] == state.bone[1]
            )
            history.append(balance.residual)
            self.record.residuals = history
            if not np.isfinite(balance.residual):
                raise StepFailed("the residual is not finite", history)
            if arrived and balance.residual <= self.tolerance and self.obeys_contact(old, state):
                return replace(state, velocity=self.body.velocity(state.u))
            if not arrived:
                history[-1] = max(history[-1], 1.0)
            if len(history) > 8 and history[-1] > 1e3 * min(history):
                raise StepFailed("the residual grows", history)
            self._renew(state, history)
            state = self._advance(old, state, target, balance)
            self.record.iterations += 1
        raise StepFailed(f"no equilibrium in {MAX_ITERATIONS} iterations", history)

    def _begin(self, old: State, duration: float) -> None:
        """Start the clock of a step; a factorisation made for a much longer or shorter one is of no use."""
        dynamics = self.body.dynamics
        if dynamics is None:
            return
        self._outdated = not 0.67 * dynamics.step <= duration <= 1.5 * dynamics.step
        dynamics.begin(old.u, old.velocity, duration)

    def _balance(
        self, old: State, state: State, target: Target, frozen: Floats | None
    ) -> tuple[State, Balance]:
        """Out-of-balance forces (n,) of the reduced unknowns, the forces that make them, and their
        relative size.
        """
        attraction = self.attraction_at(old, state, state.voltage) if frozen is None else frozen
        nodal = self.body.forces(state.u)
        nodal[self.pad.nodes] -= attraction + self.contact_forces(state)
        forces = self.body.reduce(nodal)
        reaction = forces[self.body.bone]
        load = -target.force if target.force is not None else None
        largest = max(np.abs(reaction).max(), SMALLEST_FORCE)
        sums = np.abs(forces[:-2].reshape(-1, 2).sum(axis=0)).max()
        free = max(np.abs(forces[:-2]).max(), sums)
        if load is not None:
            free = max(free, abs(reaction[1] - load))
        return replace(state, attraction=attraction, reaction=reaction), Balance(
            forces, float(free / largest), load
        )

    def attraction_at(self, old: State, state: State, voltage: float) -> Floats:
        """Attraction on the pad nodes (P, 2) in the configuration of `state`; who touches is taken from
        `old`, the last converged state.
        """
        if self.attraction is None:
            return np.zeros_like(state.contact_force)
        return self.attraction.forces(self.positions(state.u), voltage, old.status != OPEN)

    def forget(self) -> None:
        """Drop the factorisation, so that the next iteration starts from a fresh one."""
        self._factor = None

    def _advance(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """One outer iteration: solve the contact problem of the linearised body, move, shorten where
        cells would collapse.
        """
        saved, g = self._factor.forward(-balance.forces)
        c = self.candidates
        step = Step(self._condensed, self._describe(old, state), g, target.bone - state.bone, balance.load)
        try:
            found = step.solve()
        except ContactNotSolved as error:
            raise StepFailed(f"contact: {error}", self.record.residuals) from error
        self.record.contact_solves += found.solves
        kept = np.concatenate([found.moved, found.bone])
        delta = self.body.expand(self._factor.backward(saved, kept))
        share = self._largest_share(state.u, delta)
        force, status = np.zeros_like(state.contact_force), np.zeros_like(state.status)
        force[c], status[c] = found.force, found.status
        whole = share == 1.0 and balance.load is None
        return replace(
            state,
            u=state.u + share * delta,
            contact_force=state.contact_force + share * (force - state.contact_force),
            status=status,
            bone=target.bone.copy() if whole else state.bone + share * found.bone,
        )

    def _describe(self, old: State, state: State) -> Candidates:
        c = self.candidates
        position = self.positions(state.u)[c]
        frame = outline.frame(self.surface, position)
        softness = self._softness(old)[c]
        slip = (
            frame.stretch * (position[:, 0] - self.positions(old.u)[c, 0])
            - softness[:, 1] * old.contact_force[c, 1]
        )
        friction = self._friction(position[:, 0])
        return Candidates(frame, slip, state.contact_force[c], state.status[c], friction, softness)

    def _softness(self, old: State) -> Floats:
        """Compliance of the interface (P, 2) along normal and tangent in mm per N/mm; 0 where contact is
        exact.
        """
        if self.penalties is None:
            return np.zeros_like(old.contact_force)
        length = np.maximum(self.pad.length(self.positions(old.u)[:, 0]), 1e-3 * self.length)
        return 1.0 / np.outer(length, self.penalties)

    def _friction(self, x: Floats) -> Floats:
        return np.broadcast_to(np.asarray(self.surface.friction_coefficient(x), dtype=float), x.shape)

    def _largest_share(self, u: Floats, delta: Floats) -> float:
        share = 1.0
        while not self.body.tissue.smallest_J(u + share * delta) > SMALLEST_J:
            share *= 0.5
            if share < 1.0 / 64.0:
                raise StepFailed("cells would collapse", self.record.residuals)
        return share

    # -- candidates and factorisation
    # ---------------------------------------------------------------------------------

    def choose_candidates(self, state: State, reach: float) -> None:
        """Make every free pad node with a gap below `reach` (mm) a contact candidate, generously if the
        present set does not do.
        """
        gap = outline.frame(self.surface, self.positions(state.u)).gap
        needed = self.pad.free & ((gap <= reach) | (state.status != OPEN))
        if not needed.any():
            needed[np.argmin(np.where(self.pad.free, gap, np.inf))] = True
        if needed[self.candidates].sum() != needed.sum():
            wider = self.pad.free & ((gap <= max(2.0 * reach, 4.0 * self.length)) | needed)
            self.candidates = np.union1d(self.candidates, np.flatnonzero(wider))
            self._factor = None

    def _renew(self, state: State, history: list[float]) -> None:
        """Factorise at the present state where there is no factorisation, the old one stalls, or a new
        one saves iterations.
        """
        if self._factor is not None and not self._outdated and not self._stale(history):
            return
        self._outdated = False
        if self._factor is None:
            unknowns = self.body.unknowns[self.pad.nodes[self.candidates]].ravel()
            self._factor = make_condensation(
                self.body.pattern, np.concatenate([unknowns, self.body.bone]), self.threads
            )
            self.record.backend = type(self._factor).__name__
        try:
            self._factor.factorise(self.body.tangent(state.u))
        except Singular as error:
            raise StepFailed(f"the tangent is singular ({error})", history) from error
        self._condensed = Condensed.make(self._factor.schur, self._attraction_stiffness(state))
        self.record.factorisations += 1

    def _stale(self, history: list[float]) -> bool:
        if len(history) < 2:
            return False
        now, rate = history[-1], history[-1] / history[-2]
        if now > 0.1 or rate > 0.5:
            return True
        return bool(np.log(self.tolerance / now) / np.log(rate) > PATIENCE)

    def _attraction_stiffness(self, state: State) -> Floats | None:
        if self.attraction is None or state.voltage == 0.0 or self._frozen:
            return None
        whole = self.attraction.stiffness(self.positions(state.u), state.voltage, self._touching)
        unknowns = (2 * self.candidates[:, None] + np.array([0, 1])).ravel()
        rows = whole[unknowns]
        inner = np.asarray(rows[:, unknowns].toarray())
        # nodes beyond the candidates move along with their neighbours, so that sliding changes no tributary
        # length
        beyond = np.asarray(rows[:, 0::2].sum(axis=1)).ravel() - inner[:, 0::2].sum(axis=1)
        index = np.arange(unknowns.size)
        inner[index, 2 * (index // 2)] += beyond
        return inner

    # -- acceptance
    # -----------------------------------------------------------------------------------------------------

    def obeys_contact(self, old: State, state: State) -> bool:
        """Whether gaps, stick, slip and the friction cone hold at the present positions; admits new
        candidates where a node sinks in.
        """
        position = self.positions(state.u)
        frame = outline.frame(self.surface, position)
        short = self.tolerance * self.length
        sunk = self.pad.free & (state.status == OPEN) & (frame.gap < -short)
        if sunk.any():
            self.choose_candidates(state, max(0.0, float(frame.gap[sunk].max())))
            return False
        active = state.status != OPEN
        normal, shear = state.contact_force[active].T
        slip = (frame.stretch * (position[:, 0] - self.positions(old.u)[:, 0]))[active]
        softness = self._softness(old)[active]
        slip = slip + softness[:, 1] * (shear - old.contact_force[active, 1])
        limit = self._friction(position[active, 0]) * normal
        weak = self.tolerance * max(np.abs(state.contact_force).max(), SMALLEST_FORCE)
        status = state.status[active]
        sign = np.select([status == FORWARD, status == BACKWARD], [1.0, -1.0], 0.0)
        sticks = (status != STICK) | ((np.abs(slip) <= short) & (np.abs(shear) <= limit + weak))
        slips = (
            (status == STICK)
            | ((sign * slip >= -short) & (np.abs(shear + sign * limit) <= weak))
            | (limit == 0.0)
        )
        gap = frame.normal_gap[active] + softness[:, 0] * normal
        closed = (np.abs(gap) <= short) & (normal >= -weak)
        return bool((closed & sticks & slips).all())


class RigidOutline(Equilibrium):
    """The same questions asked of a pad that does not deform: it hovers, and the bone carries the
    attraction.
    """

    def step(
        self, old: State, target: Target, frozen: Floats | None = None, start: State | None = None
    ) -> State:
        """The translated outline under its attraction; raises `StepFailed` if it would touch."""
        state = replace(self.rest(target.bone, target.voltage), velocity=old.velocity)
        if outline.frame(self.surface, self.positions(state.u)).gap.min() <= 0.0 or target.force is not None:
            raise StepFailed("a rigid outline cannot touch", [1.0])
        return replace(state, reaction=-state.attraction.sum(axis=0))

r"""One equilibrium step: outer Newton iterations on the whole body, contact solved exactly inside each of
them.

At the iterate u with contact forces lam and attraction f the out-of-balance forces are R = f_int(u) - f(u) -
lam. With the factorised (possibly older) tangent K of the tissue, condensed onto the candidates c and the
bone b,

.. math:: S_{cc}\,\Delta u_c + S_{cb}\,\Delta u_b = g_c + \lambda^+ - \lambda + \Delta f, \qquad
          S_{bc}\,\Delta u_c + S_{bb}\,\Delta u_b = g_b + F_b .

The compliance :math:`C = S_{cc}^{-1}` turns this into a contact problem for the new forces (`evfem.contact`),
in which the attraction falls with the gap of open nodes; a prescribed force makes the bone's travel an extra
unknown. Then the interior follows by the backward solve. The factorisation is kept across iterations and
steps and renewed when the residual stalls or the iterations it would save cost more. A step is accepted only
if residual, gaps, penetration, stick, slip direction and cone all hold at the accepted positions.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem import pad as outline
from evfem.attraction import Attraction
from evfem.body import Body
from evfem.condensed import Condensed, Motion, Step, Unknown
from evfem.contact import OPEN, ContactNotSolved
from evfem.interface import Interface
from evfem.linear import Singular, make_condensation
from evfem.mesh import Floats, Ints
from evfem.state import KILOVOLT, SMALLEST_FORCE, Balance, Linearised, Record, State, StepFailed, Target

#: renew the factorisation when more iterations than this would be needed with the old one
PATIENCE = 5
MAX_ITERATIONS = 40
SMALLEST_J = 0.05
#: the voltage is given, at its lower or upper limit, or an unknown settled by the friction force
NONE, LOW, HIGH, FREE = "none", "low", "high", "free"


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
        self.interface = Interface(pad, body.space.mesh.points, surface, tolerance)
        self.record = Record()
        self.points = body.space.mesh.points
        self.candidates: Ints = np.zeros(0, dtype=np.int64)
        # attraction that falls more slowly than this share of the pad's foundation modulus is left to
        # iterations
        depth = float(np.ptp(self.points[:, 1]))
        self.stride = 0.05 * depth
        self.soft = 0.02 * min(law.shear_modulus for law, _ in body.tissue.groups) / depth
        self._factor: Any = None
        self._linearised: Linearised | None = None
        self._condensed: Any = None
        self._touching: Any = np.zeros(pad.nodes.size, dtype=bool)
        self._frozen = False
        self._outdated = False
        self._steering = NONE
        self._stiffest = 0.0

    # -- what a state is

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
        attraction = self.attraction_at(state, state, voltage)
        return replace(state, attraction=attraction, reaction=-attraction.sum(axis=0))

    def positions(self, u: Floats) -> Floats:
        """Current positions of the pad nodes (P, 2)."""
        return self.interface.positions(u)

    def contact_forces(self, state: State) -> Floats:
        """Contact forces on the pad nodes in the laboratory frame (P, 2)."""
        return self.interface.contact_forces(state)

    # -- one step

    def step(
        self, old: State, target: Target, frozen: Floats | None = None, start: State | None = None
    ) -> State:
        """Equilibrium at `target`, friction counted from `old`; `frozen` attraction (P, 2) instead of the
        current one if given; iterations begin at `start` (default `old`). Raises `StepFailed`."""
        travel = abs(target.bone[1] - old.bone[1]) if target.force is None else 0.0
        self._touching, self._frozen = old.status != OPEN, frozen is not None
        state = self._first_guess(start or old, target)
        self.choose_candidates(state, 1.2 * travel)
        self._begin(old, target.duration)
        self.interface.pins.begin(self.positions(old.u)[:, 0])
        self._steering = self._first_steering(old, target)
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
            if arrived and balance.residual <= self.tolerance and self._accepts(old, state, target):
                return replace(state, velocity=self.body.velocity(state.u))
            if not arrived:
                history[-1] = max(history[-1], 1.0)
            if len(history) > 8 and history[-1] > 1e3 * max(min(history), self.tolerance):
                raise StepFailed("the residual grows", history)
            self._renew(state, history)
            state = self._advance(old, state, target, balance)
            self.interface.pins.watch(self.positions(state.u)[:, 0], state.status != OPEN)
            self.record.iterations += 1
        raise StepFailed(f"no equilibrium in {MAX_ITERATIONS} iterations", history)

    @staticmethod
    def _first_guess(state: State, target: Target) -> State:
        """Where iterations begin: the present state, carried along with the bone if nothing touches."""
        if target.tangential_force is None:
            state = replace(state, voltage=target.voltage)
        if target.force is not None or (state.status != OPEN).any():
            return state
        return replace(state, u=state.u + (target.bone - state.bone), bone=target.bone.copy())

    @staticmethod
    def _first_steering(old: State, target: Target) -> str:
        if target.tangential_force is None:
            return NONE
        return LOW if old.voltage == 0.0 else FREE

    def _accepts(self, old: State, state: State, target: Target) -> bool:
        return self.obeys_contact(old, state) and self._wish_met(old, state, target)

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
        largest = max(np.abs(reaction).max(), SMALLEST_FORCE, self._rounding(state) / self.tolerance)
        sums = np.abs(forces[:-2].reshape(-1, 2).sum(axis=0)).max()
        free = max(np.abs(forces[:-2]).max(), sums)
        if target.force is not None:
            free = max(free, abs(reaction[1] + target.force))
        if self._steering == FREE:
            free = max(free, abs(reaction[0] - (target.tangential_force or 0.0)))
        return replace(state, attraction=attraction, reaction=reaction), Balance(
            forces, float(free / largest)
        )

    def _rounding(self, state: State) -> float:
        """Forces (N/mm) below which the balance is rounding of displacements that contain the bone's
        travel.
        """
        return 4.0 * float(np.finfo(float).eps) * self._stiffest * float(np.abs(state.bone).max())

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
        """One outer iteration: solve the contact problem of the linearised body, move, shorten where cells
        would collapse."""
        saved, g = self._factor.forward(-balance.forces)
        known = self.interface.describe(old, state, self.candidates, self._fall(state))
        bone = target.bone - state.bone
        unknowns: tuple[Unknown, ...] = ()
        if target.force is not None:
            bone = np.array([bone[0], 0.0])
            unknowns = (Unknown(-self._condensed.schur[:, -1], 1, -target.force),)
        step = Step(self._condensed, known, g, bone, unknowns)
        squared = 0.0
        if self._steering == FREE:
            found, saved, squared = self._steer(step, state, target, saved)
        else:
            found = self._solve(step)
        if target.force is not None:
            bone = np.array([bone[0], found.extra[0]])
            missing = -target.force - state.reaction[1]
            flies = not found.status.any() and bone[1] * missing < 0.0
            if abs(bone[1]) > self.stride or flies:
                # too far for a linear step, which may rest on a single node, or an attracted body that
                # nothing holds:
                # go part of the way, the way the missing force pushes
                bone[1] = np.copysign(self.stride, missing if flies else bone[1])
                found = self._solve(replace(step, bone=bone, unknowns=()))
        delta = self.body.expand(self._factor.backward(saved, np.concatenate([found.moved, bone])))
        share = self._largest_share(state.u, delta)
        c = self.candidates
        force, status = np.zeros_like(state.contact_force), np.zeros_like(state.status)
        force[c], status[c] = found.force, found.status
        whole = share == 1.0 and target.force is None
        voltage = state.voltage
        if squared:
            voltage = KILOVOLT * float(np.sqrt(max((voltage / KILOVOLT) ** 2 + share * squared, 0.0)))
        return replace(
            state,
            u=state.u + share * delta,
            contact_force=state.contact_force + share * (force - state.contact_force),
            status=status,
            bone=target.bone.copy() if whole else state.bone + share * bone,
            voltage=voltage,
        )

    def _solve(self, step: Step) -> Motion:
        try:
            found = step.solve()
        except ContactNotSolved as error:
            raise StepFailed(f"contact: {error}", self.record.residuals) from error
        self.record.contact_solves += found.solves
        return found

    def _steer(self, step: Step, state: State, target: Target, saved: Floats) -> tuple[Motion, Floats, float]:
        """A step with the squared voltage (kV^2) among its unknowns, kept between 0 and the largest allowed;
        returns the motion, the state for the backward solve and the change of the squared voltage.
        """
        assert self.attraction is not None
        assert target.tangential_force is not None
        nodal = np.zeros_like(state.u)
        nodal[self.pad.nodes] = self.attraction.forces(self.positions(state.u), KILOVOLT, self._touching)
        unit, push = self._factor.forward(self.body.reduce(nodal))
        steered = replace(step, unknowns=(*step.unknowns, Unknown(push, 0, target.tangential_force)))
        found = self._solve(steered)
        now, most = (state.voltage / KILOVOLT) ** 2, (target.voltage / KILOVOLT) ** 2
        change = float(found.extra[-1])
        if not 0.0 <= now + change <= most:
            self._steering = LOW if now + change < 0.0 else HIGH
            change = (0.0 if self._steering == LOW else most) - now
            found = self._solve(replace(step, residual=step.residual + change * push))
        return found, saved + change * unit, change

    def _wish_met(self, old: State, state: State, target: Target) -> bool:
        """Whether the friction force is as wished, or as near as the voltage's limits allow; if the limit is
        no longer needed, the voltage becomes an unknown again.
        """
        if target.tangential_force is None or self._steering == FREE:
            return True
        forward = np.sign(target.bone[0] - old.bone[0]) or 1.0
        lacking = forward * (target.tangential_force - state.reaction[0])
        slack = self.tolerance * max(np.abs(state.reaction).max(), SMALLEST_FORCE)
        if lacking > slack if self._steering == LOW else lacking < -slack:
            self._steering = FREE
            return False
        return True

    def _largest_share(self, u: Floats, delta: Floats) -> float:
        share = 1.0
        while not self.body.tissue.smallest_J(u + share * delta) > SMALLEST_J:
            share *= 0.5
            if share < 1.0 / 64.0:
                raise StepFailed("cells would collapse", self.record.residuals)
        return share

    # -- candidates and factorisation

    def choose_candidates(self, state: State, reach: float) -> None:
        """Make every free pad node with a gap below `reach` (mm) a contact candidate, generously if the
        present set does not do.
        """
        gap = outline.frame(self.surface, self.positions(state.u)).gap
        steep = self._fall(state) > self.soft * self.pad.length(self.positions(state.u)[:, 0])
        needed = self.pad.free & ((gap <= reach) | steep | (state.status != OPEN))
        if not needed.any():
            needed[np.argmin(np.where(self.pad.free, gap, np.inf))] = True
        if needed[self.candidates].sum() != needed.sum():
            wider = self.pad.free & ((gap <= max(2.0 * reach, 4.0 * self.interface.length)) | needed)
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
            upper = self.body.tangent(state.u)
            self._factor.factorise(upper)
        except Singular as error:
            raise StepFailed(f"the tangent is singular ({error})", history) from error
        self._condensed = Condensed.make(self._factor.schur, self._coupling(state))
        self._stiffest = float(upper[self.body.pattern.diagonal].max())
        dynamics = self.body.dynamics
        begin, seconds = (np.zeros_like(state.u), 0.0) if dynamics is None else dynamics.beginning
        self._linearised = Linearised(state.u, state.voltage, self._touching, self._frozen, begin, seconds)
        self.record.factorisations += 1

    @property
    def carried(self) -> Linearised | None:
        """Where the factorisation was made that the next step may use, if there is one."""
        return None if self._factor is None else self._linearised

    def linearise(self, state: State, at: Linearised) -> None:
        """Make the factorisation again that a run which goes on from `state` had made at `at`."""
        self._touching, self._frozen = at.touching, at.frozen
        if self.body.dynamics is not None:
            self.body.dynamics.begin(at.begin, np.zeros_like(at.begin), at.duration)
        self._renew(replace(state, u=at.u, voltage=at.voltage), [])

    def _stale(self, history: list[float]) -> bool:
        if len(history) < 2:
            return False
        before, now = history[-2:]
        if now > 0.1 or now > 0.5 * before:
            return True
        if now <= self.tolerance:
            return False
        return bool(np.log(self.tolerance / now) / np.log(now / before) > PATIENCE)

    def _fall(self, state: State) -> Floats:
        """How fast the attraction of every pad node falls with its gap (P,) in N/mm per mm."""
        if self.attraction is None or state.voltage == 0.0 or self._frozen:
            return np.zeros(self.pad.nodes.size)
        return self.attraction.fall(self.positions(state.u), state.voltage, self._touching)

    def _coupling(self, state: State) -> Floats | None:
        """The attraction's stiffness on the candidates but for its fall with a node's own gap, which belongs
        to the contact problem: what is left are changes of tributary lengths. None without attraction.
        """
        if self.attraction is None or state.voltage == 0.0 or self._frozen:
            return None
        position, c = self.positions(state.u), self.candidates
        whole = self.attraction.stiffness(position, state.voltage, self._touching)
        unknowns = (2 * c[:, None] + np.array([0, 1])).ravel()
        rows = whole[unknowns]
        inner = np.asarray(rows[:, unknowns].toarray())
        # nodes beyond the candidates move along with their neighbours, so that sliding changes no length
        beyond = np.asarray(rows[:, 0::2].sum(axis=1)).ravel() - inner[:, 0::2].sum(axis=1)
        index = np.arange(unknowns.size)
        inner[index, 2 * (index // 2)] += beyond
        normal = outline.normals(outline.frame(self.surface, position[c]))
        own = self._fall(state)[c, None, None] * normal[:, :, None] * normal[:, None, :]
        blocks = inner.reshape(c.size, 2, c.size, 2)
        blocks[np.arange(c.size), :, np.arange(c.size)] -= own
        return inner

    # -- acceptance

    def obeys_contact(self, old: State, state: State) -> bool:
        """Whether contact and friction hold at the present positions; a node that sinks in becomes a
        candidate.
        """
        sunk = self.interface.deepest(state)
        if sunk is not None:
            self.choose_candidates(state, max(0.0, sunk))
            return False
        return self.interface.obeyed(old, state)


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

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
from evfem.condensed import Motion, Step, Unknown
from evfem.contact import OPEN, STICK, ContactNotSolved
from evfem.findings import findings
from evfem.interface import Interface
from evfem.linearisation import Linearisation
from evfem.mesh import Floats
from evfem.mixing import Mixing
from evfem.state import KILOVOLT, SMALLEST_FORCE, Balance, Limits, State, StepFailed, Target

SMALLEST_J = 0.05
#: a bone that moved less than this share of its next way has not moved along it
ROUNDING = 1e-9
#: so many iterations in a row that cannot hold the attraction show that nodes are being lost to it
LOST = 3
#: under a prescribed force the bone moves at most this share of the body's height in one iteration
LONGEST_STRIDE = 0.05
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
        limits: Limits,
    ) -> None:
        self.body, self.pad, self.surface, self.attraction = body, pad, surface, attraction
        self.tolerance, self.strategy = limits.tolerance, limits.strategy
        self.interface = Interface(pad, body.space.mesh.points, surface, limits.tolerance)
        self.points = body.space.mesh.points
        self.linear = Linearisation(body, self.interface, attraction, limits)
        self.record = self.linear.record
        self.stride = LONGEST_STRIDE * float(np.ptp(self.points[:, 1]))
        self._mixing = Mixing()
        self._steering = NONE
        self._reduced = 0
        self._seen: tuple[State, Balance] | None = None

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
        current one if given; iterations begin at `start` (default `old`). A wished friction force that
        a sticking pad cannot give leaves the voltage as it is. Raises `StepFailed`."""
        try:
            found = self._try(old, target, frozen, start)
        except StepFailed:
            if target.tangential_force is None:
                raise
            found = None
        if found is not None and not (self._steering == HIGH and _sticks(found)):
            return found
        # friction hardly depends on the voltage of a pad that sticks: such a wish has no sensible answer, and
        # the voltage stays as it is
        held = self._try(old, replace(target, tangential_force=None, voltage=old.voltage), frozen, start)
        if not _sticks(held):
            raise StepFailed("the wished friction force was not found", self.record.residuals)
        return held

    def _try(self, old: State, target: Target, frozen: Floats | None, start: State | None) -> State:
        try:
            return self._find(old, target, frozen, start or old)
        except (ContactNotSolved, StepFailed) as error:
            self.linear.forget()
            reason = error.reason if isinstance(error, StepFailed) else f"contact: {error}"
            failed = StepFailed(reason, self.record.residuals)
            failed.findings = "" if self._seen is None else findings(self.body, *self._seen)
            raise failed from error

    def _find(self, old: State, target: Target, frozen: Floats | None, start: State) -> State:
        state = self._begin(old, target, frozen is not None, start)
        history: list[float] = []
        for _ in range(self.strategy.iterations):
            state, balance = self._balance(old, state, target, frozen)
            self._seen = state, balance
            arrived = target.bone[0] == state.bone[0] and (
                target.force is not None or target.bone[1] == state.bone[1]
            )
            history.append(balance.residual)
            self.record.residuals = history
            if not np.isfinite(balance.residual):
                raise StepFailed("the residual is not finite", history)
            if arrived and balance.residual <= self.tolerance and self._accepts(old, state, target):
                return replace(state, velocity=self.body.velocity(state.u), trend=state.u - old.u)
            if not arrived:
                history[-1] = max(history[-1], 1.0)
            if len(history) > 8 and history[-1] > 1e3 * max(min(history), self.tolerance):
                raise StepFailed("the residual grows", history)
            state = self._iterate(old, state, target, balance)
            self.interface.pins.watch(self.positions(state.u)[:, 0], state.status != OPEN)
            self.record.iterations += 1
        raise StepFailed(f"no equilibrium in {self.strategy.iterations} iterations", history)

    def _begin(self, old: State, target: Target, frozen: bool, start: State) -> State:
        """Prepare everything for a step, and say where its iterations start."""
        self.linear.begin(old, frozen)
        state = self._first_guess(start, target)
        travel = abs(target.bone[1] - old.bone[1]) if target.force is None else 0.0
        self.linear.choose_candidates(state, 1.2 * travel)
        self.linear.start_clock(old, target.duration)
        self._mixing.reset()
        self.interface.pins.begin(self.positions(old.u)[:, 0])
        self._steering, self._reduced = self._first_steering(old, target), 0
        return state

    def _iterate(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """The next iterate, with the factorisation at hand if that does and a new one if not."""
        if self.linear.renew(state, self.record.residuals):
            self._mixing.reset()
        try:
            after = self._advance(old, state, target, balance)
        except ContactNotSolved:
            # an older tangent may ask for what no contact can give
            if self.linear.made_at(state):
                raise
            self.linear.factorise(state)
            self._mixing.reset()
            after = self._advance(old, state, target, balance)
        mixed = self._mixing.next_iterate(state, after)
        # what is given is kept to the last digit
        bone = after.bone if target.force is None else np.array([after.bone[0], mixed.bone[1]])
        return replace(mixed, bone=bone, voltage=after.voltage if self._steering != FREE else mixed.voltage)

    def _first_guess(self, state: State, target: Target) -> State:
        """Where iterations begin: the present state moved on along its trend, or with the bone if nothing
        touches.
        """
        if target.tangential_force is None:
            state = replace(state, voltage=target.voltage)
        if (state.status != OPEN).any():
            return self._extrapolated(state, target)
        if target.force is not None:
            return state
        return replace(state, u=state.u + (target.bone - state.bone), bone=target.bone.copy())

    def _extrapolated(self, state: State, target: Target) -> State:
        """As far along the last step's displacements as the bone's next step is along its last one."""
        bone = self.body.space.mesh.node_sets["bone"][0]
        last, way = state.trend[bone], target.bone - state.bone
        axis = 0 if target.force is not None else int(np.argmax(np.abs(way)))
        # where the way turns off, the last step's part along it is rounding of either sign
        if way[axis] * last[axis] <= ROUNDING * way[axis] ** 2:
            return state
        share = min(float(way[axis] / last[axis]), self.strategy.reach)
        u = state.u + share * state.trend
        if not self.body.tissue.smallest_J(u) > SMALLEST_J:
            return state
        return replace(state, u=u, bone=u[bone].copy())

    @staticmethod
    def _first_steering(old: State, target: Target) -> str:
        if target.tangential_force is None:
            return NONE
        return LOW if old.voltage == 0.0 else FREE

    def _accepts(self, old: State, state: State, target: Target) -> bool:
        return self.obeys_contact(old, state) and self._wish_met(old, state, target)

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
        return 4.0 * float(np.finfo(float).eps) * self.linear.stiffest * float(np.abs(state.bone).max())

    def attraction_at(self, old: State, state: State, voltage: float) -> Floats:
        """Attraction on the pad nodes (P, 2) in the configuration of `state`; who touches is taken from
        `old`, the last converged state.
        """
        if self.attraction is None:
            return np.zeros_like(state.contact_force)
        return self.attraction.forces(self.interface.resting(state), voltage, old.status != OPEN)

    def _advance(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """One outer iteration: solve the contact problem of the linearised body, move, shorten where cells
        would collapse."""
        saved, g = self.linear.factor.forward(-balance.forces)
        pull = self.linear.fall(state), self.linear.closing(state)
        known = self.interface.describe(old, state, self.linear.candidates, *pull)
        bone = target.bone - state.bone
        unknowns: tuple[Unknown, ...] = ()
        if target.force is not None:
            bone = np.array([bone[0], 0.0])
            unknowns = (Unknown(-self.linear.condensed.schur[:, -1], 1, -target.force),)
        step = Step(self.linear.condensed, known, g, bone, unknowns, self._reduced >= LOST)
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
        delta = self.body.expand(self.linear.factor.backward(saved, np.concatenate([found.moved, bone])))
        share = self._largest_share(state.u, delta)
        c = self.linear.candidates
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
        found = step.solve()
        self.record.contact_solves += found.solves
        self._reduced = self._reduced + 1 if found.reduced else 0
        return found

    def _steer(self, step: Step, state: State, target: Target, saved: Floats) -> tuple[Motion, Floats, float]:
        """A step with the squared voltage (kV^2) among its unknowns, kept between 0 and the largest allowed;
        returns the motion, the state for the backward solve and the change of the squared voltage.
        """
        assert self.attraction is not None
        assert target.tangential_force is not None
        nodal = np.zeros_like(state.u)
        nodal[self.pad.nodes] = self.attraction.forces(
            self.interface.resting(state), KILOVOLT, self.linear.touching
        )
        unit, push = self.linear.factor.forward(self.body.reduce(nodal))
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

    # -- acceptance

    def obeys_contact(self, old: State, state: State) -> bool:
        """Whether contact and friction hold at the present positions; a node that sinks in becomes a
        candidate.
        """
        sunk = self.interface.deepest(state)
        if sunk is not None:
            self.linear.choose_candidates(state, max(0.0, sunk))
            return False
        return self.interface.obeyed(old, state)


def _sticks(state: State) -> bool:
    return bool((state.status == STICK).any())


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

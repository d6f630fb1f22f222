r"""Equilibrium steps of the condensed pad on a flat surface: contact, friction and attraction solved exactly,
the tissue only as the displacements its forces make (`evfem.fast.memory`).

With contact forces :math:`\lambda`, attraction a and the bone at b the pad nodes have moved by
:math:`b + q(\lambda + a)`. Each iteration solves Signorini-Coulomb (`evfem.contact.signorini`, with the fall
of the attraction with the gap of open nodes) for the linear change
:math:`\bar C(\lambda^+ - \lambda + a(g) - a)` of these positions and evaluates q again. The laws of contact
and the attraction hold at the accepted positions; what differs from the full model is q.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact import pad as outline
from evfem.contact.attraction import Attraction
from evfem.contact.condensed import Candidates
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    Border,
    ContactNotSolved,
    ContactProblem,
    ContactSolution,
    Pull,
    solve_pulled,
)
from evfem.fast.memory import CondensedPad, sums
from evfem.fast.woodbury import Factors, KeptProblem
from evfem.solver.interface import Interface
from evfem.solver.state import SMALLEST_FORCE, Limits, Record, State, StepFailed, Target

#: no step is solved to a smaller tolerance: what is remembered of the pad is off by more
FINEST = 1e-5
#: the mean compliance is kept while the weights have changed by less than this
FAR = 1.5
#: the attraction's fall is kept while the squared voltage has changed by less than this share
NEAR = 0.1
#: so many times more nodes are in play than touch, and so many more
SPARE, FEWEST = 1.2, 8
#: an attraction whose feedback on its own node is weaker than this share is left to the next iteration
WEAK = 1e-4
#: under a prescribed force the bone moves at most this share of the pad's height in one iteration
LONGEST_STRIDE = 0.1
#: stiffness of the spring that holds a pad without contact, relative to that of a node
WEAKEST = 1e-9


class PadEquilibrium:
    """Finds equilibria of a condensed pad, one step after the other; `evfem.solver.stepping` and the
    ledger use it like the full one. Displacements (P, 2) are those of the pad nodes alone.
    """

    def __init__(
        self,
        body: CondensedPad,
        pad: outline.Pad,
        points: Floats,
        surface: Any,
        attraction: Attraction | None,
        limits: Limits,
    ) -> None:
        self.body, self.pad, self.surface, self.attraction = body, pad, surface, attraction
        self.tolerance, self.strategy = max(limits.tolerance, FINEST), limits.strategy
        self.interface = Interface(pad, points, surface, self.tolerance)
        self.stride = LONGEST_STRIDE * float(np.ptp(self.interface.points[:, 1]))
        self.record = Record()
        self._weight = np.full(len(body.force), np.inf)
        self._factors = Factors()
        self._fall: tuple[float, Floats] = (np.nan, np.zeros(0))
        self._play: Ints = np.zeros(0, dtype=np.int64)
        self._near: Floats = np.zeros((0, 0))
        self._mean: Floats = np.zeros((0, 0))

    # -- what the full equilibrium solver offers too

    def rest(self, bone: Floats, voltage: float) -> State:
        """The undeformed pad, translated by `bone`."""
        zero = np.zeros((self.pad.nodes.size, 2))
        u = zero + bone
        status = np.zeros(len(zero), dtype=np.int64)
        state = State(u, zero, status, np.array(bone, dtype=float), voltage, zero, np.zeros(2), zero, zero)
        attraction = self.attraction_at(state, state, voltage)
        return replace(state, attraction=attraction, reaction=-attraction.sum(axis=0))

    def positions(self, u: Floats) -> Floats:
        """Current positions of the pad nodes (P, 2)."""
        return self.interface.positions(u)

    def contact_forces(self, state: State) -> Floats:
        """Contact forces on the pad nodes in the laboratory frame (P, 2)."""
        return state.contact_force[:, ::-1]

    def attraction_at(self, old: State, state: State, voltage: float) -> Floats:
        """Attraction on the pad nodes (P, 2) at the positions of `state`, touching as in `old`."""
        if self.attraction is None:
            return np.zeros_like(state.contact_force)
        return self.attraction.forces(self.interface.resting(state), voltage, old.status != OPEN)

    # -- one step

    def step(
        self, old: State, target: Target, frozen: Floats | None = None, start: State | None = None
    ) -> State:
        """Equilibrium at `target`, friction counted from `old`; `frozen` attraction (P, 2) instead of the
        current one if given; iterations begin at `start` (default `old`). Raises `StepFailed`."""
        if start is None and frozen is None and self._goes_on(old, target):
            return replace(
                old,
                u=old.u + np.array([target.bone[0] - old.bone[0], 0.0]),
                bone=np.array([target.bone[0], old.bone[1]]),
            )
        begin = start or self._first_guess(old, target)
        bone = target.bone.copy() if target.force is None else np.array([target.bone[0], begin.bone[1]])
        state = replace(begin, u=begin.u + (bone - begin.bone), bone=bone, voltage=target.voltage)
        self.interface.pins.begin(self.positions(old.u)[:, 0])
        self.record.residuals = []
        for _ in range(self.strategy.iterations):
            pull = self.attraction_at(old, state, target.voltage) if frozen is None else frozen
            if self._balanced(state, pull, target) and self._obeyed(old, state):
                reaction = -(self.contact_forces(state) + state.attraction).sum(axis=0)
                return replace(state, reaction=reaction)
            try:
                state = self._advance(old, state, pull, target, frozen is not None)
            except ContactNotSolved as error:
                raise StepFailed(f"contact: {error}", self.record.residuals) from error
            self.interface.pins.watch(self.positions(state.u)[:, 0], state.status != OPEN)
            self.record.iterations += 1
            if not np.isfinite(state.u).all():
                break
        reason = f"no equilibrium in {self.strategy.iterations} iterations"
        if self.interface.deepest(state) is not None:
            reason = "contact spreads beyond the nodes that the fast model keeps"
        raise StepFailed(reason, self.record.residuals)

    def _goes_on(self, old: State, target: Target) -> bool:
        """Whether the pad, in full slip already, is carried along as it is: a level surface with one
        coefficient of friction, and nothing else changes.
        """
        way = target.bone[0] - old.bone[0]
        if (
            way == 0.0
            or old.voltage != target.voltage
            or not isinstance(getattr(self.surface, "friction", None), float)
        ):
            return False
        if self.attraction is not None and not self.attraction.air_layer:
            return False
        if target.force is None:
            held = target.bone[1] == old.bone[1]
        else:
            held = abs(target.force + old.reaction[1]) <= self.tolerance * np.abs(old.reaction).max()
        touching = old.status[old.status != OPEN]
        return bool(held and touching.size and (touching == (FORWARD if way > 0.0 else BACKWARD)).all())

    def _first_guess(self, old: State, target: Target) -> State:
        """Where iterations begin: the old state, or for the first touch under a prescribed force the stored
        equilibria with that force.
        """
        if target.force is None or (old.status != OPEN).any():
            return old
        between = self.body.pressed(target.force)
        u = self.body.under(between)
        contact = np.where(between[:, 1:] > 0.0, between - old.attraction, 0.0)
        touching = self.pad.free & (contact[:, 1] > 0.0)
        if not touching.any():
            return old
        gap = outline.frame(self.surface, self.positions(u)).gap
        bone = np.array([old.bone[0], -gap[touching].mean()])
        force = np.where(touching[:, None], contact[:, ::-1], 0.0)
        status = np.where(touching, STICK, OPEN)
        return replace(old, u=u + bone, bone=bone, contact_force=force, status=status)

    def _balanced(self, state: State, pull: Floats, target: Target) -> bool:
        """Whether the attraction is that of the positions, and the prescribed force is there."""
        force = self.contact_forces(state) + state.attraction
        missing = float(np.abs(pull - state.attraction).max())
        if target.force is not None:
            missing = max(missing, abs(target.force - sums(force)[0]))
        residual = missing / max(np.abs(sums(force)).max(), SMALLEST_FORCE)
        self.record.residuals.append(residual)
        return residual <= self.tolerance

    def _obeyed(self, old: State, state: State) -> bool:
        sunk = self.interface.deepest(state)
        return sunk is None and self.interface.obeyed(old, state)

    def _advance(self, old: State, state: State, pull: Floats, target: Target, frozen: bool) -> State:
        """Solve contact for the linear change of the positions, then move as the pad does."""
        near_compliance, mean = self._compliance(state)
        near = self.body.kept.near[self._play]
        fall, closing = np.zeros((2, self.pad.nodes.size))
        if self.attraction is not None and not frozen:
            position = self.interface.resting(state)
            fall = self._fall_at(position, target.voltage, old)
            position[:, 1] = self.surface.y
            closed = self.attraction.forces(position, target.voltage, old.status != OPEN)
            closing = np.maximum(pull - closed, 0.0)[:, 1]
        known = self.interface.describe(old, state, near, fall, closing)
        change = pull - state.attraction
        moved = np.concatenate([known.frame.gap, known.slip]) - near_compliance @ known.force.T.ravel()
        if change.any():
            moved += mean @ self.body.kept.gather(change)
        lacking = None if target.force is None else target.force - float(pull[:, 1].sum())
        found = self._contact(known, moved, near_compliance, lacking)
        lift = float(found.extra.sum())
        if abs(lift) > self.stride or (lacking is not None and not found.status.any()):
            # too far for a linear step, which may rest on a single node
            lift = float(np.copysign(self.stride, lift))
            found = self._contact(known, moved + lift * self._upward(near.size), near_compliance, None)
        force, status = np.zeros_like(state.contact_force), np.zeros_like(state.status)
        force[near], status[near] = found.force.reshape(2, -1).T, found.status
        attraction = pull.copy()
        attraction[near] += found.relief.reshape(2, -1)[::-1].T
        bone = state.bone.copy()
        bone[1] += lift
        u = bone + self.body.under(force[:, ::-1] + attraction)
        return replace(state, u=u, contact_force=force, status=status, bone=bone, attraction=attraction)

    def _contact(
        self, known: Candidates, moved: Floats, compliance: Floats, lacking: float | None
    ) -> ContactSolution:
        """Contact among the near nodes; if their pressing forces shall add up to `lacking` (N/mm), the bone's
        height is one more unknown.
        """
        own = np.diagonal(compliance)[: known.slip.size]
        border = None
        if lacking is not None:
            lift = self._upward(known.slip.size)
            # a pad that touches nothing hangs on a spring too weak to count
            spring = np.array([[-WEAKEST / own.mean()]])
            border = Border(lift[:, None], lift[None].copy(), spring, np.array([lacking]))
        fall = np.where(known.fall * own > WEAK, known.fall, 0.0)
        problem = KeptProblem(moved, compliance, known.friction, border, factors=self._factors)
        pull = Pull(fall, known.frame.gap, known.closing)
        try:
            found = solve_pulled(problem, pull, known.status)
        except ContactNotSolved:
            # with less rounding
            exact = ContactProblem(moved, compliance, known.friction, border)
            found = solve_pulled(exact, pull, known.status)
        self.record.contact_solves += found.solves
        return found

    @staticmethod
    def _upward(near: int) -> Floats:
        """What a rise of the bone by 1 mm does to gaps and slips (2 k,) of the near nodes."""
        return np.repeat([1.0, 0.0], near)

    def _fall_at(self, position: Floats, voltage: float, old: State) -> Floats:
        """How fast the attraction of every pad node falls with its gap (P,), at or shortly before
        `position`: the contact problem's factors are kept with it.
        """
        assert self.attraction is not None
        made_at, fall = self._fall
        if not abs(voltage**2 - made_at**2) <= NEAR * made_at**2:
            fall = self.attraction.fall(position, voltage, old.status != OPEN)
            self._fall = voltage, fall
        return fall

    def _compliance(self, state: State) -> tuple[Floats, Floats]:
        """Compliance among the k nodes in play, near nodes that touch or may do so soon (2 k, 2 k), and from
        all kept nodes to them (2 k, 2 K).
        """
        weight = self.body.weights(self.contact_forces(state) + state.attraction)
        near = self.body.kept.near
        gap = outline.frame(self.surface, self.positions(state.u)).gap[near]
        needed = (state.status[near] != OPEN) | (gap < 0.0)
        if np.abs(weight - self._weight).sum() < FAR and needed[self._play].sum() == needed.sum():
            return self._near, self._mean
        enough = min(int(SPARE * needed.sum()) + FEWEST, near.size) - 1
        self._play = np.flatnonzero(needed | (gap <= np.partition(gap, enough)[enough]))
        k, size = self._play.size, self.body.kept.size
        mean = self.body.mean_compliance(weight).reshape(2, size, 2, size)[:, self._play]
        self._near = np.ascontiguousarray(mean[:, :, :, self._play]).reshape(2 * k, 2 * k)
        self._mean = mean.reshape(2 * k, 2 * size)
        self._weight, self._fall = weight, (np.nan, np.zeros(0))
        return self._near, self._mean

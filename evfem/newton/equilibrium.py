r"""One equilibrium step: iterations from one accepted state to the next.

At the iterate u with contact forces :math:`\lambda` and attraction f the out-of-balance forces are
:math:`R = f_{int}(u) - f(u) - \lambda`. Algorithm (`Equilibrium.step`)::

    state <- the body's first guess for the target
    repeat
        f <- attraction at the iterate
        R, residual <- balance of the body, with the shares of the controls (`evfem.newton.control`)
        accept if the bone is where it should be, the residual is below the tolerance, no open node has
            penetrated, closed gaps, stick, slip direction and friction cone hold, and the controls agree
        give up if what would be accepted has an outline that crosses itself, or is not stable
        give up if the residual is not finite or stagnates, or after the strategy's iterations
        state <- the body's next iterate: linearise, solve contact exactly, move
        nodes that keep crossing a jump of friction are pinned to it

The body is `evfem.newton.factorised.FactorisedBody`. Friction is counted from the last accepted
state; nothing is committed before acceptance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import SMALLEST_FORCE
from evfem.common.rooms import begun, ended
from evfem.contact.signorini import ContactNotSolved, Unstable
from evfem.newton.control import Force, Indentation, Target, Unsupported, sticks
from evfem.newton.factorised import FactorisedBody
from evfem.newton.interface import Interface
from evfem.newton.state import Balance, Folded, Limits, State, StepFailed
from evfem.newton.strategy import stuck
from evfem.terms.traction import TOUCHING, PadState, PadTraction

#: why an equilibrium is refused that the body leaves
NOT_STABLE = "the equilibrium that was found is not stable: {}, {:.3g} times as hard as its tissue holds it"
#: why an equilibrium is refused whose outline crosses itself; the place is its x in mm
FOLDED = "there is no equilibrium near here without the outline folding over itself, at x = {:.4g} mm"


class Equilibrium:
    """Finds equilibria of a body on a surface, with or without attraction, one step after the other."""

    def __init__(
        self, body: FactorisedBody, interface: Interface, attraction: PadTraction, limits: Limits
    ) -> None:
        self.interface, self.attraction, self._size = interface, attraction, body.size
        self.body, self.record = body, body.record
        self.rooms = (*body.body.rooms, body.pressure, *interface.rooms)
        self.tolerance, self.strategy = limits.tolerance, limits.strategy
        self._iterate: tuple[State, Balance] | None = None

    def rest(self, bone: Floats, voltage: float) -> State:
        """The undeformed body, translated by `bone` (dim,)."""
        nodes, dim = self.interface.pad.nodes.size, len(bone)
        zero, still = np.zeros((nodes, dim)), np.zeros((self._size, dim))
        state = State(
            u=still + bone,
            contact_force=zero,
            status=np.zeros(nodes, dtype=np.int64),
            bone=np.array(bone, dtype=float),
            voltage=voltage,
            attraction=zero,
            reaction=np.zeros(dim),
            last_increment=still,
        )
        for room in (*self.rooms, self.attraction):
            state = state.remembering(begun(room, state.memory, room.memory(state)))
        for traction in self.attraction.keeping:
            traction.begin(self.pad_state(state), 0.0)
        attraction = self.attraction_at(state, state, voltage)
        return replace(state, attraction=attraction, reaction=-attraction.sum(axis=0))

    def begin(self, old: State, target: Target) -> Target:
        """A trial from `old` begins: every room counts from there. Returns the target as it then is."""
        self.interface.begin(old, target.duration)
        for room in self.rooms:
            room.begin(old, target.duration)
        for traction in self.attraction.keeping:
            traction.begin(self.pad_state(old), target.duration)
        target.voltage.begin(old)
        return target.begun(old)

    def accept(self, old: State, state: State, target: Target) -> State:
        """The converged state with what every room keeps of it."""
        state = replace(state, last_increment=state.u - old.u)
        for room in self.rooms:
            state = state.remembering(ended(room, old.memory, room.accept(old, state)))
        for traction in self.attraction.keeping:
            ends = self.pad_state(old), self.interface.pad_state(state, old.touching)
            state = state.remembering(ended(traction, old.memory, traction.accept(*ends)))
        return state.remembering(target.drive.settled(state))

    def attraction_at(self, old: State, state: State, voltage: float) -> Floats:
        """Attraction on the pad nodes (P, 2) in `state`; who touches is taken from `old`, accepted last."""
        pad = replace(self.interface.pad_state(state, old.touching), voltage=voltage)
        return self.interface.tilted(state, self.attraction.forces(pad))

    def pad_state(self, state: State) -> PadState:
        """The pad of an accepted state."""
        return self.interface.pad_state(state, state.touching)

    def pulls(self, state: State) -> dict[str, Floats]:
        """Forces (P, dim) of every traction by name in an accepted state, as above a rigid surface."""
        rest, found = self.interface.bed.untilted(state, state.attraction), {}
        for part in self.attraction.parts[:0:-1]:
            found[part.name] = state.memory[f"forces.{part.name}"]
            rest = rest - found[part.name]
        first = self.attraction.parts[:1]
        return found | {one.name: rest if one.acts(state.voltage) else 0.0 * rest for one in first}

    def step(self, old: State, target: Target, start: State | None = None) -> State:
        """Equilibrium at `target`, friction counted from `old`; iterations begin at `start` (default `old`).
        A loose finger that is touched gives way. Raises `StepFailed`.
        """
        if not isinstance(target.height, Unsupported):
            return self._followed(old, target, start)
        held = replace(target, height=Indentation(float(old.bone[1])))
        found = self._followed(old, held, start)
        return self._given_way(old, held, found) if found.touching.any() else found

    def _given_way(self, old: State, target: Target, touched: State) -> State:
        """The equilibrium without a force of a finger touched at `target`, from the iterate `touched`: of all
        heights above, which are equilibria too, the one where its lowest node just does not touch.
        """
        lifted = self._followed(old, replace(target, height=Force(0.0)), touched)
        gap = float(self.interface.surface_at(lifted).gap.min())
        if gap <= TOUCHING:
            return lifted
        height = Indentation(float(lifted.bone[1]) - gap + TOUCHING)
        lowered = self._followed(old, replace(target, height=height), lifted)
        return lowered if abs(lowered.reaction[1]) < SMALLEST_FORCE else lifted

    def _followed(self, old: State, target: Target, start: State | None) -> State:
        """The equilibrium at `target`, with the voltage as its control wants it."""
        found = None
        try:
            found = self._try(old, target, start)
        except StepFailed:
            if target.voltage.fallback(old, None) is None:
                raise
        other = target.voltage.fallback(old, found)
        if found is not None and other is None:
            return found
        assert other is not None
        held = self._try(old, replace(target, voltage=other), start)
        if not sticks(held):
            raise StepFailed("the prescribed friction force was not found", self.record.residuals)
        return held

    def _try(self, old: State, target: Target, start: State | None) -> State:
        try:
            return self._find(old, target, start or old)
        except (ContactNotSolved, StepFailed) as error:
            self.body.discard()
            reason = error.reason if isinstance(error, StepFailed) else f"contact: {error}"
            kind = Folded if isinstance(error, Folded) else StepFailed
            failed = kind(reason, self.record.residuals)
            failed.unstable = isinstance(error, Unstable)
            failed.findings = "" if self._iterate is None else self.body.findings(*self._iterate)
            raise failed from error

    def _find(self, old: State, target: Target, start: State) -> State:
        """The iterations at the head of this file."""
        target = self.begin(old, target)
        state = self.body.begin(old, target, start)
        residuals: list[float] = []
        self.record.residuals, changed = residuals, 0
        for iteration in range(self.strategy.iterations):
            attraction = self.attraction_at(old, state, state.voltage)
            state, balance = self.body.balance(state, attraction, target)
            self._iterate = state, balance
            reached = target.reached(state.bone)
            residuals.append(balance.remaining if reached else max(balance.remaining, 1.0))
            if not np.isfinite(balance.residual):
                raise StepFailed("the residual is not finite", residuals)
            if reached and balance.residual <= self.tolerance:
                if self._accepts(old, state, target):
                    return self._accepted(old, state, target)
                if iteration > changed:  # other nodes are held or candidates: another problem begins
                    changed = iteration + 1
            if stuck(residuals[changed:]):
                break
            state = self.body.advance(old, state, target, balance)
            self.interface.jumps.watch(self.interface.on_display(state), state.touching)
            self.record.iterations += 1
        raise StepFailed(f"no equilibrium in {len(residuals)} iterations", residuals)

    def _accepted(self, old: State, state: State, target: Target) -> State:
        """The balanced state with memories of body, friction, hand; raises where crossed or not stable."""
        place = self.interface.fold(state)
        if place is not None:
            raise Folded(FOLDED.format(place), self.record.residuals)
        if (margin := self.body.leaves(old, state, target)) is not None:
            raise Unstable(NOT_STABLE.format(margin.cause, margin.ratio))
        return self.accept(old, state, target)

    def _accepts(self, old: State, state: State, target: Target) -> bool:
        if not self.obeys_contact(old, state):
            return False
        travel = target.place - old.bone[::2]
        slack = self.tolerance * max(np.abs(state.reaction).max(), SMALLEST_FORCE)
        return target.voltage.accepts(travel, state.reaction, slack)

    def obeys_contact(self, old: State, state: State) -> bool:
        """Whether contact and friction hold here; a node that penetrates becomes a candidate."""
        penetration = self.interface.shallowest_penetration(state)
        if penetration is not None:
            self.body.add_candidates(state, penetration)
            return False
        return self.interface.obeyed(old, state)

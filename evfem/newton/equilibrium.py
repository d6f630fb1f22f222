r"""One equilibrium step: iterations from one accepted state to the next.

At the iterate u with contact forces :math:`\lambda` and attraction f the out-of-balance forces are
:math:`R = f_{int}(u) - f(u) - \lambda`. Algorithm (`Equilibrium.step`)::

    state <- the predictor for the target
    repeat
        f <- attraction at the iterate
        R, residual <- balance of the body, with the equations of the controls (`evfem.newton.control`)
        accept if the bone is at its prescribed position, the residual is below the tolerance, no open node
            has penetrated, closed gaps, stick, slip direction and friction cone hold, and the controls agree
        fail if a converged state has an outline that crosses itself, or is not stable
        fail if the residual is not finite or stagnates, or after the strategy's iterations
        state <- the body's next iterate: linearise, solve contact exactly, move
        nodes that keep crossing a discontinuity of friction are pinned to it

The body is `evfem.newton.factorised.FactorisedBody`. Friction is counted from the last accepted
state; nothing is committed before acceptance.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import SMALLEST_FORCE
from evfem.common.notices import WITHIN
from evfem.common.rooms import begun, ended
from evfem.contact.signorini import ContactNotSolved, Unstable
from evfem.newton.control import Force, Indentation, Target, Unsupported, VoltageControl
from evfem.newton.factorised import FactorisedBody
from evfem.newton.interface import Interface
from evfem.newton.search import Trials, strength
from evfem.newton.state import Balance, Folded, Limits, OutOfReach, State, StepFailed
from evfem.newton.strategy import stuck
from evfem.terms.traction import TOUCHING, PadState, PadTraction

#: why an unstable equilibrium is refused
NOT_STABLE = "the equilibrium that was found is not stable: {}, {:.3g} times as hard as its tissue holds it"
#: how far a step is: its begin of iterations, and these
FAR = "%.3g %% of the step, iteration %d, residual %.1e"
#: why an equilibrium is refused whose outline crosses itself; at x in mm
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

    def restart(self, old: State, target: Target) -> State:
        """The accepted state where a requested step to `target` begins, whose prescribed speeds may jump."""
        return old.remembering(self.set_anew(old, target))

    def set_anew(self, old: State, target: Target) -> dict[str, Floats]:
        """What of its memory does not depend on the steps before."""
        rooms = (*self.rooms, self.attraction)
        return {name: kept for room in rooms for name, kept in room.restart(old, target).items()}

    def begin(self, old: State, target: Target) -> Target:
        """Start a trial step from `old`, from which every room takes its increments. Returns the target with
        the state of its drive.
        """
        self.interface.begin(old, target.duration)
        for room in self.rooms:
            room.begin(old, target.duration)
        for traction in self.attraction.keeping:
            traction.begin(self.pad_state(old), target.duration)
        target.voltage.begin(old, self.attraction)
        return target.begun(old)

    def accept(self, old: State, state: State, target: Target) -> State:
        """The converged state with the memory of every room."""
        state = replace(state, last_increment=state.u - old.u)
        for room in self.rooms:
            state = state.remembering(ended(room, old.memory, room.accept(old, state)))
        for traction in self.attraction.keeping:
            ends = self.pad_state(old), self.interface.pad_state(state, old.touching)
            state = state.remembering(ended(traction, old.memory, traction.accept(*ends)))
        return state.remembering(target.drive.accept(old, state))

    def attraction_at(self, old: State, state: State, voltage: float) -> Floats:
        """Attraction on the pad nodes (P, 2) in `state`; touching nodes are those of `old`, accepted last."""
        pad = replace(self.interface.pad_state(state, old.touching), voltage=voltage)
        return self.interface.foundation.turned(state, self.attraction.forces(pad))

    def pad_state(self, state: State) -> PadState:
        """The pad of an accepted state."""
        return self.interface.pad_state(state, state.touching)

    def pulls(self, state: State) -> dict[str, Floats]:
        """Forces (P, dim) of every traction by name in an accepted state, not tilted by surface strain."""
        rest, found = self.interface.foundation.turned_back(state, state.attraction), {}
        for traction in self.attraction.parts[:0:-1]:
            found[traction.name] = state.memory[f"forces.{traction.name}"]
            rest = rest - found[traction.name]
        first = self.attraction.parts[:1]
        return found | {one.name: rest if one.acts(state.voltage) else 0.0 * rest for one in first}

    def step(self, old: State, target: Target, start: State | None = None) -> State:
        """Equilibrium at `target`, friction counted from `old`; iterations begin at `start` (default `old`).
        An unloaded finger that is touched moves away without force. Raises `StepFailed`.
        """
        if not isinstance(target.height, Unsupported):
            return self._solve_with_voltage_control(old, target, start)
        at_fixed_height = replace(target, height=Indentation(float(old.bone[1])))
        found = self._solve_with_voltage_control(old, at_fixed_height, start)
        return self._find_first_touch(old, at_fixed_height, found) if found.touching.any() else found

    def _find_first_touch(self, old: State, target: Target, touched: State) -> State:
        """The equilibrium of an unloaded finger that was touched at `target`, found from the iterate
        `touched`: of all heights without contact the one where the lowest node just does not touch.
        """
        lifted = self._solve_with_voltage_control(old, replace(target, height=Force(0.0)), touched)
        gap = float(self.interface.surface_at(lifted).gap.min())
        if gap <= TOUCHING:
            return lifted
        height = Indentation(float(lifted.bone[1]) - gap + TOUCHING)
        lowered = self._solve_with_voltage_control(old, replace(target, height=height), lifted)
        return lowered if abs(lowered.reaction[1]) < SMALLEST_FORCE else lifted

    def _solve_with_voltage_control(self, old: State, target: Target, start: State | None) -> State:
        """Solve the step as the target's voltage control finds it. Raises `StepFailed`."""

        def solve(control: VoltageControl, begin: State | None = None) -> State:
            return self._attempt(old, replace(target, voltage=control), begin or start)

        unused = partial(self.interface.unused_friction, old)
        travel = target.place - old.bone[::2]
        return target.voltage.find(Trials(old, travel, self.tolerance, solve, unused))

    def _attempt(self, old: State, target: Target, start: State | None) -> State:
        try:
            return self._newton_iterations(old, target, start or old)
        except (ContactNotSolved, StepFailed) as error:
            self.body.discard()
            reason = error.reason if isinstance(error, StepFailed) else f"contact: {error}"
            kind = type(error) if isinstance(error, (Folded, OutOfReach)) else StepFailed
            failed = kind(reason, self.record.residuals)
            failed.unstable = isinstance(error, Unstable)
            failed.findings = "" if self._iterate is None else self.body.findings(*self._iterate)
            raise failed from error

    def _newton_iterations(self, old: State, target: Target, start: State) -> State:
        """Newton iterations (algorithm at the head of this file)."""
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
            WITHIN.debug(FAR, 100.0 * self.record.begun, iteration + 1, balance.residual)
            if not np.isfinite(balance.residual):
                raise StepFailed("the residual is not finite", residuals)
            if reached and balance.residual <= self.tolerance:
                if self._accepts(old, state, target):
                    return self._accepted(old, state, target)
                if iteration > changed:  # pins or candidates have changed: another problem begins
                    changed = iteration + 1
            if stuck(residuals[changed:]):
                break
            state = self.body.advance(old, state, target, balance)
            self.interface.jumps.watch(self.interface.on_display(state), state.touching)
            self.record.iterations += 1
        raise StepFailed(f"no equilibrium in {len(residuals)} iterations", residuals)

    def _accepted(self, old: State, state: State, target: Target) -> State:
        """The converged state with its memory; raises `Folded` or `Unstable`."""
        crossing = self.interface.fold(state)
        if crossing is not None:
            raise Folded(FOLDED.format(crossing), self.record.residuals)
        if (margin := self.body.leaves(old, state, target)) is not None:
            raise Unstable(NOT_STABLE.format(margin.cause, margin.ratio))
        return self.accept(old, state, target)

    def _accepts(self, old: State, state: State, target: Target) -> bool:
        if not self.obeys_contact(old, state):
            return False
        travel = target.place - old.bone[::2]
        slack = self.tolerance * strength(state)
        return target.voltage.accepts(travel, state.reaction, slack)

    def obeys_contact(self, old: State, state: State) -> bool:
        """Whether contact and friction hold here; a node that penetrates becomes a candidate."""
        penetration = self.interface.shallowest_penetration(state)
        if penetration is not None:
            self.body.add_candidates(state, penetration)
            return False
        return self.interface.obeyed(old, state)

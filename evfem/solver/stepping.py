"""Adaptive steps: a requested step is reached exactly, in as many parts as its equilibria need (1. of
`evfem.solver`).

A body that is released from the begin of a long part lags the loads of its end by all of it, and its edge
peels on the way: so the part is halved first. After a release the step goes on with the part that worked
before; its next release comes at a part `COARSER` times as long, so that a step in which the finger snaps
again and again comes to its end.

Where the error of the path is limited, a part is solved as two halves and accepted if one whole part
ends close enough to them; its length follows that error (`evfem.solver.path`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from evfem.common.constants import COARSER, RELEASED
from evfem.newton.control import Target
from evfem.newton.equilibrium import Equilibrium
from evfem.newton.state import Folded, LiftedOff, State, StepFailed
from evfem.solver.hold import held
from evfem.solver.path import Path, Whole
from evfem.solver.relaxation import Relaxation, pull
from evfem.tissue.body import Body

#: why an equilibrium is refused that lies behind a barrier
BARRIER = "the equilibrium that was found lies behind a barrier, which the finger would not climb"
#: a climb that is rounding, as a share of the stored energy
CLIMB = 1e-3


class Accounts(Protocol):
    """Receives every accepted substep: the bookkeeping of works and energies."""

    def accept(self, old: State, new: State) -> object:
        """A substep from `old` to `new` was accepted; returns whether stability was lost in it."""

    def mark(self) -> Any:
        """Present state of the accounts."""

    def back(self, mark: Any) -> None:
        """Discards the substeps accepted since `mark`."""


@dataclass
class Release:
    """`least`: substep length below which the body is released; `trusted`: length that worked last;
    `unstable`: a substep from the present state failed because the tangent was not positive definite.
    """

    least: float
    trusted: float
    unstable: bool = False


@dataclass
class Stepper:
    """Follows paths with an equilibrium solver; remembers the substep, as a fraction of a step, that worked
    last. `body` is what is released where no equilibrium is near; without it such a step fails. `snaps`:
    parts in which stability was lost without a release. The
    `scheme` says what a part is made of (`evfem.solver.path`).
    """

    equilibrium: Equilibrium
    substep: float = 1.0
    cuts: int = 0
    body: Body | None = None
    relaxations: int = 0
    snaps: int = 0
    scheme: Whole = field(default_factory=Whole)
    rise: Callable[[State, State, Target], float] | None = None
    barriers: int = 0
    held: int = 0
    releasing: bool = False

    def __post_init__(self) -> None:
        self._release = Release(RELEASED, self.substep)
        self.substep = self.scheme.first(self.substep)

    def follow(self, state: State, path: Path, accounts: Accounts) -> tuple[State, int]:
        """From `state` to the end of `path`; the accounts see every converged substep. Returns the end
        and the number of substeps.

        Raises `StepFailed` when the smallest substep fails; what was accepted before stays accepted.
        """
        done, substeps, strategy = 0.0, 0, self.equilibrium.strategy
        self._release = Release(max(RELEASED, strategy.smallest_part), self.substep)
        while done < 1.0:
            fraction = 1.0 if self.substep >= 1.0 - done - 1e-12 else done + self.substep
            before = self.equilibrium.record.iterations
            try:
                parts, error = self.scheme.solve(self.solve, state, path, (done, fraction))
            except StepFailed as failed:
                left, target = 1.0 - done, path(done, fraction)
                self.substep = 0.5 * (fraction - done)
                rest = self._shortened(state, target, left, accounts, failed)
                if rest is not None:
                    state, done, substeps = rest, fraction, substeps + 1
                continue
            shorter = self.scheme.refused(error, fraction - done, strategy)
            if shorter is not None:
                self.substep = shorter
                continue
            self._release = replace(self._release, trusted=self.substep, unstable=False)
            for target, new in parts:
                if len(parts) > 1:
                    # others were tried since: works are those of the trial that began last
                    self.equilibrium.begin(state, target)
                self.snaps += bool(accounts.accept(state, new))
                state, substeps = new, substeps + 1
            easy = self.equilibrium.record.iterations - before <= strategy.easy
            self.substep = self.scheme.following(self.substep, fraction - done, error, easy, strategy)
            done = fraction
        return state, substeps

    def _shortened(
        self, state: State, target: Target, left: float, accounts: Accounts, failed: StepFailed
    ) -> State | None:
        """Go on with half of the part that failed, or release the body where that is short enough: its rest
        is returned, and the part that worked before is tried next. Raises `failed` at the smallest part of
        what was `left` of the step, or `LiftedOff`.
        """
        release, half, least = self._release, self.substep, self._least(target) * left
        self.cuts += 1
        release.unstable = failed.unstable = release.unstable or failed.unstable
        if half >= release.least:
            return None
        rest = self._released(state, target, accounts, failed)
        if rest is None:
            if half < least:
                self._refuse_flight(state, target, failed)
                raise failed
            self.substep, release.least = half, least
            return None
        self.substep, release.unstable = min(1.0, max(release.trusted, release.least)), False
        release.least *= COARSER
        return rest

    def _least(self, target: Target) -> float:
        """The smallest part of what is left of a step: larger where it takes time, which stiffens tissue."""
        least = self.equilibrium.strategy.smallest_part
        timed = self.body is not None and not self._relaxation(self.body).applies(target)
        return least**2 if timed else least

    def _relaxation(self, body: Body) -> Relaxation:
        return Relaxation(body, self.solve, self.equilibrium.attraction.flows)

    def _released(self, state: State, target: Target, accounts: Accounts, failed: StepFailed) -> State | None:
        """Equilibrium that the body snaps to from `state`, or None; `Folded` or `LiftedOff` if impossible."""
        self.substep, failed.last = 1.0, (state, target)
        if self.body is None or not self.equilibrium.strategy.relaxation:
            return None
        relaxation = self._relaxation(self.body)
        if isinstance(failed, Folded):
            raise failed
        if not relaxation.applies(target):
            return None
        failed.released, mark, self.releasing = True, accounts.mark(), True
        try:
            rest = relaxation.follow(state, target, accounts.accept)
        except StepFailed as error:
            accounts.back(mark)
            if isinstance(error, Folded | LiftedOff):
                error.last = failed.last
                raise
            return None
        finally:
            self.releasing = False
        self.relaxations += 1
        return rest

    def _refuse_flight(self, state: State, target: Target, failed: StepFailed) -> None:
        """Raise `LiftedOff` where viscous tissue without mass was pulled off: in the air nothing slows it."""
        if self.body is None or not self.equilibrium.strategy.relaxation:
            return
        relaxation = self._relaxation(self.body)
        if relaxation.applies(target) or self.body.dynamics.mass is not None:
            return
        if pull(state, target) <= 0.0:
            return
        try:
            relaxation.follow(state, replace(target, duration=0.0), lambda old, new: None)
        except LiftedOff as lifted:
            lifted.last = failed.last
            raise
        except StepFailed:
            return

    def solve(self, state: State, target: Target, start: State | None = None) -> State:
        """One equilibrium that the body can reach from `state` without climbing, found from `start` (default
        `state`). Where iterations come to one behind a barrier the body is held (`evfem.solver.hold`); in a
        release the part fails; in time it fails down to `RELEASED` of a step, and then counts as a snap.
        """
        new = self._found(state, target, start)
        if not self._climbs(target, state, new):
            return new
        self.barriers += 1
        timed = self.body is None or not self._relaxation(self.body).applies(target)
        if timed and not self.releasing and self.substep < RELEASED:
            self.snaps += 1
            return new
        if self.body is None or timed or self.releasing:
            raise StepFailed(BARRIER, self.equilibrium.record.residuals)
        new = held(self.body, self._reached, self.equilibrium.strategy.hold, state, target)
        self.held += 1
        return new

    def _reached(self, old: State, target: Target, start: State) -> State:
        """The equilibrium found from `start`, which the body must reach from there without climbing."""
        new = self._found(old, target, start)
        if self._climbs(target, start, new):
            raise StepFailed(BARRIER, self.equilibrium.record.residuals)
        return new

    def _climbs(self, target: Target, old: State, new: State) -> bool:
        """Whether a barrier lies between two states; none without attraction, or with a sought voltage."""
        attraction = self.equilibrium.attraction
        if self.rise is None or not attraction.acts(new.voltage):
            return False
        return not target.voltage.sought and self.rise(old, new, target) > CLIMB

    def _found(self, state: State, target: Target, start: State | None = None) -> State:
        return self.equilibrium.step(state, target, start)

"""Adaptive steps: the target of a requested step is reached exactly, in as many substeps as its equilibria
need (1. of `evfem.solver`).

With pseudo-transient continuation (release) from the begin of a long substep the body starts far from
equilibrium with the loads of the end, and the edge of contact peels meanwhile: so the substep is halved
first. After a release the step goes on with the length that worked before; the next release comes at a
substep `COARSER` times as long, so that a step with repeated snaps comes to its end.

Where the step error is limited, a substep is solved as two halves and accepted if one whole substep ends
close enough to them; its length follows that error (`evfem.solver.path`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
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

#: fractions of a step closer than this are the same
SAME = 1e-12
#: why an equilibrium is refused that lies behind a barrier
BARRIER = "the equilibrium that was found lies behind a barrier, which the finger would not climb"
#: energy barriers below this fraction of the stored energy are rounding
SMALLEST_BARRIER = 1e-3


class Accounts(Protocol):
    """Receives every accepted substep: the bookkeeping of works and energies."""

    def add_substep(self, old: State, new: State) -> object:
        """A substep from `old` to `new` was accepted; returns whether stability was lost in it."""

    def snapshot(self) -> Any:
        """Snapshot of the accounts."""

    def restore(self, kept: Any) -> None:
        """Discards the substeps accepted since the snapshot `kept`."""


@dataclass
class Release:
    """Decision on pseudo-transient continuation. `least`: substep length below which it is tried;
    `last_successful`: length of the last accepted substep; `unstable`: a substep from the present state
    failed because the tangent was not positive definite.
    """

    least: float
    last_successful: float
    unstable: bool = False


@dataclass
class Stepper:
    """Follows load paths with an equilibrium solver; keeps the length of the next substep, as a fraction of a
    step. Without a `body` there is no pseudo-transient continuation, and a step without an equilibrium nearby
    fails. `snaps`: substeps in which stability was lost without it. `parts`: a substep is one equilibrium,
    or two halves (`evfem.solver.path`).
    """

    equilibrium: Equilibrium
    substep: float = 1.0
    cuts: int = 0
    body: Body | None = None
    relaxations: int = 0
    snaps: int = 0
    parts: Whole = field(default_factory=Whole)
    rise: Callable[[State, State, Target], float] | None = None
    barriers: int = 0
    held: int = 0
    releasing: bool = False

    def __post_init__(self) -> None:
        self._release = Release(RELEASED, self.substep)
        self.substep = self.parts.first(self.substep)

    def follow(
        self, state: State, path: Path, accounts: Accounts, turns: Iterable[float] = ()
    ) -> tuple[State, int]:
        """From `state` to the end of `path`, in substeps that end at the fractions `turns` too. Every
        converged one is added to the accounts. Returns the last state and the number of substeps.

        Raises `StepFailed` when the smallest substep fails; what was accepted before stays accepted.
        """
        done, substeps, strategy = 0.0, 0, self.equilibrium.strategy
        self._release = Release(max(RELEASED, strategy.smallest_part), self.substep)
        while done < 1.0:
            end = next((one for one in turns if one > done + SAME), 1.0)
            fraction = end if self.substep >= end - done - SAME else done + self.substep
            before, self.equilibrium.record.begun = self.equilibrium.record.iterations, done
            try:
                solved, error = self.parts.solve(self.solve, state, path, (done, fraction))
            except StepFailed as failed:
                left, target = 1.0 - done, path(done, fraction)
                self.substep = 0.5 * (fraction - done)
                rest = self._halve_or_release(state, target, left, accounts, failed)
                if rest is not None:
                    state, done, substeps = rest, fraction, substeps + 1
                continue
            shorter = self.parts.shorter_length(error, fraction - done, strategy)
            if shorter is not None:
                self.substep = shorter
                continue
            self._release = replace(self._release, last_successful=self.substep, unstable=False)
            for target, new in solved:
                if len(solved) > 1:
                    # other trials were begun since: rooms compute works of the trial that began last
                    self.equilibrium.begin(state, target)
                self.snaps += bool(accounts.add_substep(state, new))
                state, substeps = new, substeps + 1
            easy = self.equilibrium.record.iterations - before <= strategy.easy
            self.substep = self.parts.next_substep(self.substep, fraction - done, error, easy, strategy)
            done = fraction
        return state, substeps

    def _halve_or_release(
        self, state: State, target: Target, left: float, accounts: Accounts, failed: StepFailed
    ) -> State | None:
        """Halve the substep that failed, or, where that is short enough, try pseudo-transient continuation:
        the state at rest is returned, and the length that worked before is tried next. Raises `failed` at the
        smallest fraction of what was `left` of the step, or `LiftedOff`.
        """
        release, half, smallest = self._release, self.substep, self._smallest_substep(target) * left
        self.cuts += 1
        release.unstable = failed.unstable = release.unstable or failed.unstable
        if half >= release.least:
            return None
        rest = self._relaxed(state, target, accounts, failed)
        if rest is None:
            if half < smallest:
                self._raise_if_pulled_off(state, target, failed)
                raise failed
            self.substep, release.least = half, smallest
            return None
        self.substep, release.unstable = min(1.0, max(release.last_successful, release.least)), False
        release.least *= COARSER
        return rest

    def _smallest_substep(self, target: Target) -> float:
        """Smallest admissible substep, as a fraction of what is left of the step. Its square in
        time-dependent runs, where a shorter step stiffens the tissue and therefore helps.
        """
        least = self.equilibrium.strategy.smallest_part
        in_time = self.body is not None and not self._relaxation(self.body).applies(target)
        return least**2 if in_time else least

    def _relaxation(self, body: Body) -> Relaxation:
        return Relaxation(body, self.solve, self.equilibrium.attraction.flows)

    def _relaxed(self, state: State, target: Target, accounts: Accounts, failed: StepFailed) -> State | None:
        """Equilibrium by pseudo-transient continuation from `state`, or None; raises `LiftedOff`."""
        self.substep, failed.last = 1.0, (state, target)
        if self.body is None or not self.equilibrium.strategy.relaxation:
            return None
        relaxation = self._relaxation(self.body)
        if isinstance(failed, Folded):
            raise failed
        if not relaxation.applies(target):
            return None
        failed.released, kept, self.releasing = True, accounts.snapshot(), True
        try:
            rest = relaxation.follow(state, target, accounts.add_substep)
        except StepFailed as error:
            accounts.restore(kept)
            if isinstance(error, Folded | LiftedOff):
                error.last = failed.last
                raise
            return None
        finally:
            self.releasing = False
        self.relaxations += 1
        return rest

    def _raise_if_pulled_off(self, state: State, target: Target, failed: StepFailed) -> None:
        """Raise `LiftedOff` if viscous tissue without mass was pulled off: nothing resists rigid motion."""
        if self.body is None or not self.equilibrium.strategy.relaxation:
            return
        relaxation = self._relaxation(self.body)
        if relaxation.applies(target) or self.body.has_mass:
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
        """An equilibrium without an energy barrier from `state`, found from `start` (default `state`). If
        there is a barrier: drag continuation (`evfem.solver.hold`); in a release the substep fails; in time
        it fails down to `RELEASED` of a step, and then counts as a snap.
        """
        new = self._find_equilibrium(state, target, start)
        if not self._crosses_barrier(target, state, new):
            return new
        self.barriers += 1
        in_time = self.body is None or not self._relaxation(self.body).applies(target)
        if in_time and not self.releasing and self.substep < RELEASED:
            self.snaps += 1
            return new
        if self.body is None or in_time or self.releasing:
            raise StepFailed(BARRIER, self.equilibrium.record.residuals)
        new = held(self.body, self._reach_without_barrier, self.equilibrium.strategy.hold, state, target)
        self.held += 1
        return new

    def _reach_without_barrier(self, old: State, target: Target, start: State) -> State:
        """The equilibrium found from `start`; raises `StepFailed` if a barrier lies between them."""
        new = self._find_equilibrium(old, target, start)
        if self._crosses_barrier(target, start, new):
            raise StepFailed(BARRIER, self.equilibrium.record.residuals)
        return new

    def _crosses_barrier(self, target: Target, old: State, new: State) -> bool:
        """Whether an energy barrier lies between two states; not tested without attraction, or with an
        unknown voltage.
        """
        attraction = self.equilibrium.attraction
        if self.rise is None or not attraction.acts(new.voltage):
            return False
        return not target.voltage.sought and self.rise(old, new, target) > SMALLEST_BARRIER

    def _find_equilibrium(self, state: State, target: Target, start: State | None = None) -> State:
        return self.equilibrium.step(state, target, start)

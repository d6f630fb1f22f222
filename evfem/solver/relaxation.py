r"""From a lost equilibrium to the next one: the body is let go from where it is, and held back only
by drag.

Where a quasi-static way loses its stability, the equilibrium ends there however small the part:
an attraction that grows faster than the tissue's force pulls the finger over the gap, friction
that falls along the way lets a node go, a ridge jumps from one slope of a texture to the next. The
equilibrium after the snap may be far away, and iterations of a static problem seldom find it.
Algorithm (`Relaxation.follow`), pseudo-transient continuation with the loads of the part held::

    rate <- 1
    repeat, at most `DRAG_STEPS` times
        solve one equilibrium with drag of this rate (`evfem.tissue.drag`) from the last state
        if it failed: raise the rate, by twice the last factor; give up beyond `DRAG_MOST`
        else: accept; give up if a finger that is pulled has lost the surface
            if the body slows down and the rate is small: solve the equilibrium without drag; if it is
                found, it is the end
            lower the rate, or raise it if the speed grows; give up below `DRAG_LEAST`

Why so. *Drag, not inertia*: a release ends at rest only if something takes the energy away, and a
finger that swings may jump over the equilibrium next to it, so the way would depend on a density
and a time step; with drag the stored energy, less the work of the loads, can only fall. *Both
kinds of drag*: a viscous stress holds single nodes, but not a finger that moves as a whole; a mass
that stands still at the beginning of each step does. *No parameter*: only the ratio s of
relaxation time and pseudo-time step enters, which is chosen as steps succeed; the way is that of a
tissue with one relaxation time everywhere and low speed. The steps are equilibria of contact,
friction and attraction like any other, in the scene's own coupling and to its tolerance; friction
counts from step to step, and what is dissipated is counted by its definitions
(`evfem.simulation.works`). What comes out at the end is an equilibrium without drag, or nothing.

A hand with a mass or a damper goes on in its own time, and charge flows in its own: in the first step
of a release. Then the bone stays at that x, and each node keeps its charge, while the tissue, which has no
time of its own, comes to rest below.

With a traction that is the derivative of an energy, that energy can only fall on the way, and the
body comes to rest. The vertical attraction of the paper is none: a node that moves changes what its
neighbours carry without work (`evfem.contact.attraction`), and a finger without friction on slopes may go
round for ever, until the steps are used up.

A wished friction force is not followed on the way, where drag would be part of it: the voltage
stays as it is until the end.

Source: C. T. Kelley and D. E. Keyes, SIAM J. Numer. Anal. 35 (1998) 508,
doi:10.1137/S0036142996304796 (pseudo-transient continuation).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import (
    DRAG_CALMER,
    DRAG_CHANGE,
    DRAG_GROWTH,
    DRAG_LEAST,
    DRAG_MOST,
    DRAG_REST,
    DRAG_STEPS,
)
from evfem.solver.control import GivenVoltage, Target
from evfem.solver.state import Folded, LiftedOff, State, StepFailed
from evfem.tissue.body import Body

#: why a release ends in the air
LIFTED = (
    "there is no equilibrium near here: the finger is pulled with {:.3g} N/mm and lifts off, where the "
    "attraction holds {:.3g} N/mm"
)


@dataclass
class Relaxation:
    """Releases `body`; `solve` finds the equilibrium at a target from a state, drag included; `charged`
    where charge flows.
    """

    body: Body
    solve: Callable[[State, Target], State]
    charged: bool = False

    def applies(self, target: Target) -> bool:
        """Whether the tissue takes no time on its way to `target`, so that nothing but an equilibrium is
        asked for.
        """
        return target.duration == 0.0 or self.body.dynamics is None

    def follow(self, state: State, target: Target, accept: Callable[[State, State], None]) -> State:
        """The equilibrium at `target` where the body comes to rest when released at `state`;
        `accept(old, new)` sees every step on the way.

        Raises `StepFailed` where it does not come to rest.
        """
        try:
            return self._follow(state, target, accept)
        finally:
            self.body.release(state.u, 0.0)

    def _follow(self, state: State, target: Target, accept: Callable[[State, State], None]) -> State:
        passing = self.charged or (target.hand is not None and target.hand.hand.timed)
        end, held = target, target if passing else replace(target, duration=0.0)  # a snap takes no time
        if target.drive.follows:
            held = replace(held, drive=GivenVoltage(state.voltage))
        pace = Pace()
        for _ in range(DRAG_STEPS):
            self.body.release(state.u, pace.rate)
            try:
                new = self.solve(state, held)
            except Folded:
                raise
            except StepFailed:
                if pace.failed():
                    raise
                continue
            accept(state, new)
            if held.duration > 0.0:
                held, end = (_at_once(new.bone, each) for each in (held, end))
            _refuse_flight(new, held)
            slows = pace.went(float(np.abs(new.u - state.u).max()))
            state = new
            if slows and pace.rate < pace.quiet:
                rest = self._rest(state, end)
                if rest is not None:
                    accept(state, rest)
                    return rest
                pace.quiet = DRAG_CALMER * pace.rate
            pace.choose()
            if pace.rate < DRAG_LEAST:
                break
        raise StepFailed("the released finger does not come to rest", [])

    def _rest(self, state: State, target: Target) -> State | None:
        """The equilibrium without drag, if it is found from here."""
        self.body.release(state.u, 0.0)
        try:
            return self.solve(state, target)
        except StepFailed:
            return None


def _at_once(bone: Floats, target: Target) -> Target:
    """The target while no time passes: below a hand the bone (dim,) stays at the x where it is."""
    if target.hand is None:
        return replace(target, duration=0.0)
    return replace(target, x=float(bone[0]), duration=0.0, hand=None)


def _refuse_flight(state: State, target: Target) -> None:
    """Raise `LiftedOff` where nothing touches, the bone is pulled, and the attraction, which only
    falls on the way up, holds less than that.
    """
    held, force = -float(state.attraction[:, 1].sum()), pull(state, target)
    if force > max(held, 0.0) and not state.touching.any():
        raise LiftedOff(LIFTED.format(force, held), [])


def pull(state: State, target: Target) -> float:
    """Force (N/mm) upwards on the bone at `target`, negative where it is pressed, 0 where it is held."""
    return target.height.missing(float(state.bone[1]), np.zeros(2)) if target.height.free else 0.0


@dataclass
class Pace:
    """The `rate` of drag of the next step of a release, and below which rate the body may be at rest
    without, `quiet`.

    >>> pace = Pace()
    >>> pace.went(0.4), pace.choose(), pace.rate
    (False, None, 0.5)
    >>> pace.went(0.3), pace.failed(), pace.rate
    (True, False, 1.0)
    """

    rate: float = 1.0
    quiet: float = DRAG_REST
    slower: float = DRAG_CHANGE
    speed: float = 0.0
    growth: float = 0.0

    def failed(self) -> bool:
        """A step failed: the next one is slower. Whether drag holds the body by so much that this is no
        snap.
        """
        self.rate, self.slower = self.slower * self.rate, DRAG_CHANGE * self.slower
        return self.rate > DRAG_MOST

    def went(self, way: float) -> bool:
        """A step went so far (mm); whether that was not faster than the step before."""
        before, self.speed, self.slower = self.speed, self.rate * way, DRAG_CHANGE
        self.growth = self.speed / before if before > 0.0 else 0.0
        if self.speed > before:
            self.quiet = DRAG_REST
        return self.speed <= before

    def choose(self) -> None:
        """The rate after a step that succeeded: while an instability grows, drag stays above its rate."""
        if self.growth < DRAG_GROWTH[0]:
            self.rate /= DRAG_CHANGE
        elif self.growth >= DRAG_GROWTH[1]:
            self.rate *= DRAG_CHANGE

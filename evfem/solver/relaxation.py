r"""From a lost equilibrium to the next one: the body is let go from where it is, and held back only
by drag.

Where a quasi-static way loses its stability, the equilibrium ends there however small the part:
an attraction that grows faster than the tissue's force pulls the finger over the gap, friction
that falls along the way lets a node go, a ridge jumps from one slope of a texture to the next. The
equilibrium after the snap may be far away, and iterations of a static problem seldom find it.
Algorithm (`Relaxation.follow`), pseudo-transient continuation with the loads of the part held::

    rate <- 1
    repeat
        solve one equilibrium with drag of this rate (`evfem.tissue.drag`) from the last state; iterations
            begin ahead of it, as far along the last step's way as steps become shorter
        if it failed: a higher rate, slower
        else: accept; a lower rate, faster, but not while the speed grows, nor soon where lower ones have
            failed again and again
            give up where a finger that is pulled has lost the surface: nothing brings it back
        while it slows down, once the rate is small: solve the equilibrium without drag; it is the end if
            it is found; the body is nudged where it would leave that
        give up where even the least drag holds the body and none does not

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

*A nudge*: a symmetric finger on the middle of a crest has an equilibrium, and drag would lead it there,
but the least push makes it leave. In the plane such an equilibrium is refused
(`evfem.solver.equilibrium`), with drag as without. Drag of the next step then holds the body at a place
`NUDGE` aside, and the motion that is lost grows from there.

A hand with a mass or a damper goes on in its own time, and charge flows in its own: in the first step
of a release. Then the bone stays at that x, and each node keeps its charge, while the tissue, which has no
time of its own, comes to rest below.

*Circles*: with a traction that is the derivative of an energy, energy can only fall on the way, and the
body comes to rest. The vertical attraction of the paper is none: a node that moves changes what its
neighbours carry without work (`evfem.contact.attraction`), and a finger without friction on slopes may go
round for ever. A body whose pad has come back to where it was `ROUNDS` times is given up (`Rounds`).

A wished friction force is not followed on the way, where drag would be part of it: the voltage
stays as it is until the end.

Source: C. T. Kelley and D. E. Keyes, SIAM J. Numer. Anal. 35 (1998) 508,
doi:10.1137/S0036142996304796 (pseudo-transient continuation).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

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
    NOT_SMALLER,
    NUDGE,
    PATIENT,
    ROUND,
    ROUNDS,
    SMALLEST_J,
    STEADY,
)
from evfem.solver.control import GivenVoltage, Target
from evfem.solver.state import Circling, Folded, LiftedOff, State, StepFailed
from evfem.tissue.body import Body

#: why a release ends in the air
LIFTED = (
    "there is no equilibrium near here: the finger is pulled with {:.3g} N/mm and lifts off, where the "
    "attraction holds {:.3g} N/mm"
)


@dataclass
class Relaxation:
    """Releases `body`; `solve` finds the equilibrium at a target from a state, drag included, with
    iterations that begin at a third argument, or there if that is None; `charged` where charge flows.
    """

    body: Body
    solve: Callable[[State, Target, State | None], State]
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
        pace, rounds, pad = Pace(), Rounds(), self.body.space.mesh.node_sets["pad"]
        for _ in range(DRAG_STEPS):
            self.body.release(state.u + pace.nudge * self._aside, pace.rate)
            try:
                new = self.solve(state, held, self._ahead(state, pace.ahead))
            except Folded:
                raise
            except StepFailed as failed:
                if pace.failed(failed.unstable):
                    raise
                continue
            accept(state, new)
            if held.duration > 0.0:
                held, end = (_at_once(new.bone, each) for each in (held, end))
            _refuse_flight(new, held)
            calm = pace.went(float(np.abs(new.u - state.u).max()))
            state = new
            if rounds.closed(state.u[pad]):
                raise Circling("the released finger goes round in circles", [])
            if calm:
                rest, left = self._rest(state, end)
                if rest is not None:
                    accept(state, rest)
                    return rest
                pace.refused(left)
            pace.choose()
            if pace.rate < DRAG_LEAST:
                break
        raise StepFailed("the released finger does not come to rest", [])

    def _ahead(self, state: State, fraction: float) -> State | None:
        """Where iterations of the next step begin: a fraction of the last step's way ahead; None for the
        state itself.
        """
        u = state.u + fraction * state.last_increment
        if fraction == 0.0 or not self.body.tissue.smallest_J(u) > SMALLEST_J:
            return None
        return replace(state, u=u, bone=u[self.body.space.mesh.node_sets["bone"][0]].copy())

    @property
    def _aside(self) -> Floats:
        """A shear along x (N, dim) that leaves the top where it is, with more of it on the right, so that it
        has a part of symmetric motions and of antisymmetric ones.
        """
        points = self.body.space.mesh.points
        height, shear = float(np.ptp(points[:, 1])), np.zeros_like(points)
        shear[:, 0] = (points[:, 1].max() - points[:, 1]) * (1.0 + points[:, 0] / height) / height
        return shear

    def _rest(self, state: State, target: Target) -> tuple[State | None, bool]:
        """The equilibrium without drag, if it is found from here; if not, whether one is left."""
        self.body.release(state.u, 0.0)
        try:
            return self.solve(state, target, None), False
        except StepFailed as failed:
            return None, failed.unstable


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


class Rounds:
    """How often a released body came back to where it had been.

    >>> rounds, angles = Rounds(), np.linspace(0.0, 4.2 * np.pi, 43)
    >>> [rounds.closed(np.array([np.cos(angle), np.sin(angle)])) for angle in angles].index(True)
    40
    >>> rest = Rounds()
    >>> any(rest.closed(np.array([np.exp(-0.2 * step) * np.cos(step)])) for step in range(100))
    False
    """

    def __init__(self) -> None:
        self._places: list[Floats] = []
        self._away, self._farthest = np.zeros(0), np.zeros(0)
        self._came_back = np.zeros(0, dtype=int)

    def closed(self, u: Floats) -> bool:
        """Whether the pad, now at displacements u (P, dim), has come back somewhere `ROUNDS` times, to
        within the fraction `ROUND` of how far it had been away, and the rounds do not become smaller. A
        pad that sticks while the tissue above it moves goes no round, whatever its rounding.
        """
        apart = np.array([float(np.abs(u - place).max()) for place in self._places])
        back = (apart < ROUND * self._away) & (self._away > NUDGE)
        smaller = self._away < NOT_SMALLER * self._farthest
        self._came_back = np.where(back, np.where(smaller, 1, self._came_back + 1), self._came_back)
        self._farthest = np.where(back, self._away, self._farthest)
        self._away = np.where(back, 0.0, np.maximum(self._away, apart))
        self._places.append(u)
        self._away, self._farthest = np.append(self._away, 0.0), np.append(self._farthest, 0.0)
        self._came_back = np.append(self._came_back, 0)
        return bool((self._came_back >= ROUNDS).any())


@dataclass
class Patience:
    """For how many steps a rate of drag stays after a lower one has failed: twice as long each time
    that the next lower one fails at once. A front that peels node by node needs the same drag all the
    way; asked again after each step, whether less would do, most of the work is in vain.
    """

    longest: int = 0
    left: int = 0
    lowered: bool = False

    def failed(self) -> None:
        """A step failed."""
        self.longest = min(2 * self.longest, PATIENT) if self.lowered and self.longest else 1
        self.left, self.lowered = self.longest, False

    def least(self, change: float) -> float:
        """The least factor of the rate after a step that succeeded and would have it changed by the
        factor `change`.
        """
        if self.lowered:
            self.longest = 0
        self.left = max(self.left - 1, 0)
        self.lowered = change < 1.0 and not self.left
        return 1.0 if self.left else 0.0


@dataclass
class Pace:
    """How a release goes on: the `rate` of drag of the next step, how far `ahead` its iterations begin, as
    a fraction of the last one's way, and by how much it is nudged (mm).

    >>> pace = Pace()
    >>> pace.went(0.4), pace.choose(), pace.rate
    (False, None, 0.5)
    >>> pace.went(0.3), round(pace.ahead, 12)
    (False, 0.75)
    """

    rate: float = 1.0
    ahead: float = 0.0
    nudge: float = 0.0
    slower: float = DRAG_CHANGE
    way: float = 0.0
    speed: float = 0.0
    growth: float = 0.0
    quiet: float = DRAG_REST
    patience: Patience = field(default_factory=Patience)

    def failed(self, left: bool) -> bool:
        """A step failed: the next one is slower, and nudged where the body would leave. Whether drag holds
        it by so much that this is no snap.
        """
        self.patience.failed()
        self.nudge = NUDGE if left else self.nudge
        self.ahead, self.rate, self.slower = 0.0, self.slower * self.rate, DRAG_CHANGE * self.slower
        return self.rate > DRAG_MOST

    def went(self, way: float) -> bool:
        """A step went so far (mm). Whether the body may be at rest: it slows down, with hardly any drag."""
        before, self.speed = self.speed, self.rate * way
        self.growth = self.speed / before if before > 0.0 else 0.0
        self.ahead = min(way / self.way, 1.0) if way > STEADY * self.way > 0.0 else 0.0
        self.way, self.slower, self.nudge = way, DRAG_CHANGE, 0.0
        if self.speed > before:
            self.quiet = DRAG_REST
            return False
        return self.rate < self.quiet

    def refused(self, left: bool) -> None:
        """It was not at rest; nudged where that is because it would leave."""
        self.quiet, self.nudge = DRAG_CALMER * self.rate, NUDGE if left else 0.0

    def choose(self) -> None:
        """The rate after a step that succeeded."""
        change = _next(self.growth)
        self.rate *= max(change, self.patience.least(change))


def _next(growth: float) -> float:
    """What the rate of drag is multiplied with after a step whose speed was `growth` times the last
    one's: while an instability grows, drag stays above its rate.
    """
    if growth < DRAG_GROWTH[0]:
        return 1.0 / DRAG_CHANGE
    return 1.0 if growth < DRAG_GROWTH[1] else DRAG_CHANGE

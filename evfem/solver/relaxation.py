r"""Pseudo-transient continuation, called release: from a lost equilibrium the body moves to the next one,
held back only by artificial drag.

Algorithm (`Relaxation.follow`; [4] of `evfem.solver`) at constant loads, those of the substep's end::

    rate <- 1
    repeat, at most `DRAG_STEPS` times
        solve one equilibrium with drag of this rate (`evfem.tissue.body`) from the last state
        if it failed: raise the rate, by twice the last factor; fail beyond `DRAG_MOST`
        else: accept; fail if a finger that is pulled has lost the surface
            if the body slows down and the rate is small: solve the equilibrium without drag; if it is
                found, it is the end
            lower the rate, or raise it if the speed grows; fail below `DRAG_LEAST`

Drag, not inertia: with it the stored energy, less the work of the loads, can only fall, and the path depends
on no density. Viscosity damps relative motion, a mass at rest at the beginning of each step rigid motion.
Only the ratio s of relaxation time and pseudo-time step enters, chosen as steps succeed. Each step is an
equilibrium of contact, friction and attraction to the scene's tolerance.

In the first step of a release time passes for a hand with a mass or a damper, and for charge transport. Then
the bone keeps its x, and each node its charge, while the tissue comes to rest.

A symmetric finger on the middle of a crest has an unstable equilibrium there. The first step of a release
therefore begins with an imperfection, `IMPERFECTION`.

Under an attraction with an energy the body comes to rest. The paper's vertical one has none: a finger without
friction on slopes may move in circles until the steps are used up.

A prescribed friction force is not followed during a release, where it would contain drag: the voltage is
constant until the end.
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
    IMPERFECTION,
)
from evfem.newton.control import Target
from evfem.newton.state import Folded, LiftedOff, State, StepFailed
from evfem.tissue.body import Body

#: a speed (mm) that counts as zero
TINY = 1e-300
#: why a release ends in the air
LIFTED = (
    "there is no equilibrium near here: the finger is pulled with {:.3g} {unit} and lifts off, where the "
    "attraction holds {:.3g} {unit}"
)


@dataclass
class Relaxation:
    """Pseudo-transient continuation of `body`; `solve` finds an equilibrium with drag from a state;
    `flows`: under tractions that take time.
    """

    body: Body
    solve: Callable[[State, Target], State]
    flows: bool = False

    def applies(self, target: Target) -> bool:
        """Whether the step to `target` is quasi-static: neither viscosity nor inertia act."""
        return not self.body.takes_time(target.duration)

    def follow(self, state: State, target: Target, accept: Callable[[State, State], object]) -> State:
        """The equilibrium at `target` where the body comes to rest from `state`; `accept(old, new)` is called
        after every pseudo-time step.

        Raises `StepFailed` where it does not come to rest.
        """
        try:
            return self._follow(state, target, accept)
        finally:
            self.body.release(state.u, 0.0)

    def _follow(self, state: State, target: Target, accept: Callable[[State, State], object]) -> State:
        end, loads = target, self._held_loads(state, target)
        drag, begin = DragSchedule(), state.u + self._imperfection
        for _ in range(DRAG_STEPS):
            new = self._dragged(state, loads, begin, drag)
            if new is None:
                continue
            accept(state, new)
            if loads.duration > 0.0:
                loads, end = (each.at_once(new.bone) for each in (loads, end))
            _raise_if_pulled_off(new, loads)
            drag.moved(float(np.abs(new.u - state.u).max()))
            state, begin = new, new.u
            if drag.calm:
                rest = self._rest(state, end)
                if rest is not None:
                    accept(state, rest)
                    return rest
                drag.lower_test_rate()
            drag.choose()
            if drag.rate < DRAG_LEAST:
                break
        raise StepFailed("the released finger does not come to rest", [])

    def _held_loads(self, state: State, target: Target) -> Target:
        """The loads of the steps with drag: without time, unless drive or tractions depend on it."""
        target = replace(target, voltage=target.voltage.held(state))
        return (
            target
            if self.flows or target.drive.takes_time(target.duration)
            else replace(target, duration=0.0)
        )

    def _dragged(self, state: State, target: Target, begin: Floats, drag: DragSchedule) -> State | None:
        """The equilibrium with drag from `begin` (N, dim); None, and a larger rate, if it is not found."""
        self.body.release(begin, drag.rate)
        try:
            return self.solve(state, target)
        except Folded:
            raise
        except StepFailed:
            drag.failed()
            if drag.rate > DRAG_MOST:
                raise
            return None

    @property
    def _imperfection(self) -> Floats:
        """Imperfection that breaks symmetry: shear (N, dim) along x, fixed on top, larger on the right."""
        points = self.body.space.mesh.points
        height, shear = float(np.ptp(points[:, 1])), np.zeros_like(points)
        depth = (points[:, 1].max() - points[:, 1]) / height
        shear[:, 0] = IMPERFECTION * depth * (1.0 + points[:, 0] / height)
        return shear

    def _rest(self, state: State, target: Target) -> State | None:
        """The equilibrium without drag, if it is found from here."""
        self.body.release(state.u, 0.0)
        try:
            return self.solve(state, target)
        except StepFailed:
            return None


def _raise_if_pulled_off(state: State, target: Target) -> None:
    """Raise `LiftedOff` if contact is lost and the attraction is smaller than the pull."""
    held, force = -float(state.attraction[:, 1].sum()), pull(state, target)
    if force > max(held, 0.0) and not state.touching.any():
        raise LiftedOff(LIFTED.format(force, held, unit=state.unit), [])


def pull(state: State, target: Target) -> float:
    """Upward force (N/mm) on the bone at `target`, negative for a load, 0 at a prescribed height."""
    return target.height.missing(float(state.bone[1]), np.zeros(2)) if target.height.free else 0.0


@dataclass
class DragSchedule:
    """Drag of a release: the `rate` of the next step, the `rate_factor` by which it rises if that fails, the
    last step's `speed` (mm) and its `growth` over the step before. At rates below `rate_to_test_rest` an
    equilibrium without drag is sought. A rate that `failed` is tried again when the body has slowed down to
    `speed_to_retry`.

    >>> drag = DragSchedule()
    >>> drag.moved(0.5), drag.choose(), drag.moved(0.25), drag.rate, drag.growth
    (None, None, None, 0.5, 0.25)
    >>> drag.failed(), drag.rate, drag.failed(), drag.rate
    (None, 1.0, None, 4.0)
    >>> drag.moved(0.03), drag.choose(), drag.rate, drag.moved(0.05), drag.choose(), drag.rate
    (None, None, 2.0, None, None, 2.0)
    >>> drag.moved(0.03), drag.choose(), drag.rate
    (None, None, 1.0)
    """

    rate: float = 1.0
    rate_factor: float = DRAG_CHANGE
    speed: float = np.inf
    growth: float = 0.0
    rate_to_test_rest: float = DRAG_REST
    rate_failed: float = 0.0
    speed_to_retry: float = np.inf

    def failed(self) -> None:
        """A step failed: raise the rate."""
        self.rate_failed, self.speed_to_retry = self.rate, self.speed / DRAG_CHANGE
        self.rate, self.rate_factor = self.rate_factor * self.rate, DRAG_CHANGE * self.rate_factor

    def moved(self, distance: float) -> None:
        """A step moved the body by a distance (mm)."""
        before, self.speed, self.rate_factor = self.speed, self.rate * distance, DRAG_CHANGE
        self.growth = self.speed / max(before, TINY)
        if self.growth > 1.0:
            self.rate_to_test_rest = DRAG_REST

    @property
    def calm(self) -> bool:
        """Whether the body is nearly static: it slows down, and the drag is small."""
        return self.growth <= 1.0 and self.rate < self.rate_to_test_rest

    def lower_test_rate(self) -> None:
        """Without drag no equilibrium was found: try again at a lower rate."""
        self.rate_to_test_rest = DRAG_CALMER * self.rate

    def choose(self) -> None:
        """The rate after a step that succeeded: while an instability grows, drag stays above its rate."""
        lower = self.rate / DRAG_CHANGE
        if self.growth < DRAG_GROWTH[0] and (lower > self.rate_failed or self.speed <= self.speed_to_retry):
            self.rate = lower
        elif self.growth >= DRAG_GROWTH[1]:
            self.rate *= DRAG_CHANGE

r"""Search for the voltage of a wished friction force, by equilibria at given voltages.

Algorithm (`Search.nearest`), where Newton's method with the voltage as an unknown has found nothing. What
lacks at a squared voltage s is :math:`l(s)`, the wished less the present force; sticking nodes are below
their bounds of friction by :math:`r(s)` in all. l - r falls with s in a pad that slips or sticks, as the
bounds grow with the attraction, where l alone does not in one that sticks::

    begin at the last voltage
    l > 0 in a pad that sticks: keep it, as friction grows with the travel, not with the voltage
    l < 0: the wish is between 0 V and here, or 0 V is the nearest
    l - r > 0: raise s, by secants and at most fourfold increments, until l - r <= 0, or to the largest
    between two voltages: regula falsi (Illinois) for l = 0, or, where the pad sticks at the upper one,
        for l = r: the voltage at which it would slip at the wished force

A raised voltage without an equilibrium near is tried again nearer to the last one, at most `FAILURES` times;
then the last one is the nearest. At a jump of the force the nearer side is taken. No search needs more than
`RISES` + `TRIALS` + 2 equilibria.

Source of the Illinois rule: M. Dowell, P. Jarratt, BIT 11 (1971) 168-174, doi:10.1007/BF01934364.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import KILOVOLT, SMALLEST_FORCE
from evfem.contact.condensed import LinearContactStep, StepSolution
from evfem.contact.signorini import STICK
from evfem.newton.state import State, StepFailed

#: most equilibria at raised voltages, those of them that may fail, and most between two voltages
RISES, FAILURES, TRIALS = 24, 6, 40
#: first increment of the squared voltage, as a fraction of the largest; factors of the next ones: beyond a
#: secant, at most, and after a failure
FIRST, BEYOND, MOST, LESS = 0.01, 1.1, 4.0, 0.25
#: a pad sticks whose bounds of friction are unused by more than this fraction of the force on the bone
UNUSED = 0.01
#: relative width of squared voltages around a jump of the force
JUMP = 1e-9


@dataclass(frozen=True)
class Trial:
    """An equilibrium `state` at a `squared` voltage (kV^2), the friction force that is `lacking` there and
    `unused` by sticking nodes, and the accuracy `slack` of both (N/mm).
    """

    squared: float
    state: Any
    lacking: float
    unused: float
    slack: float

    @property
    def short(self) -> float:
        """What lacks beyond the bounds of friction (N/mm)."""
        return self.lacking - self.unused


@dataclass(frozen=True)
class Search:
    """`at(voltage, start)` is an equilibrium or raises `StepFailed`; `measure(state)` tells lacking, unused
    force and the largest force on the bone (N/mm), known to the relative `tolerance`; `begin` and `most` are
    the last and the largest voltage (V).
    """

    at: Callable[[float, Any], Any]
    measure: Callable[[Any], tuple[float, float, float]]
    begin: float
    most: float
    tolerance: float

    def nearest(self) -> Any:
        """The equilibrium whose friction force is nearest to the wish; raises `StepFailed` if there is none
        at the last voltage.
        """
        first = self._try(min(self.begin, self.most), None)
        waits = first.unused > UNUSED * first.slack / self.tolerance or first.short <= first.slack
        if abs(first.lacking) <= first.slack or (first.lacking > 0.0 and waits):
            return first.state
        if first.lacking > 0.0:
            return self._between(*self._raised(first)).state
        if first.squared == 0.0 or (unpowered := self._try(0.0, first.state)).lacking <= 0.0:
            return (first if first.squared == 0.0 else unpowered).state
        return self._between(unpowered, first).state

    def _try(self, voltage: float, start: Any) -> Trial:
        state = self.at(voltage, start)
        lacking, unused, largest = self.measure(state)
        return Trial((voltage / KILOVOLT) ** 2, state, lacking, unused, self.tolerance * largest)

    def _raised(self, low: Trial) -> tuple[Trial, Trial]:
        """Two trials with the wish between them, or twice the highest one."""
        largest, failures = (self.most / KILOVOLT) ** 2, 0
        step = FIRST * largest
        for _ in range(RISES):
            if low.squared >= largest:
                break
            try:
                voltage = min(KILOVOLT * float(np.sqrt(low.squared + step)), self.most)
                high = self._try(voltage, low.state)
            except StepFailed:
                failures += 1
                if failures > FAILURES:
                    break
                step *= LESS
                continue
            if high.short <= high.slack:
                return low, high
            gained, grown = low.short - high.short, high.squared - low.squared
            low = high
            step = grown * min(max(BEYOND * high.short / max(gained, 1e-300), 1.0), MOST)
        return low, low

    def _between(self, low: Trial, high: Trial) -> Trial:
        """The trial between two at which nothing lacks, or nothing beyond the bounds; else the nearer."""
        what = "lacking" if high.lacking <= high.slack else "short"
        value = lambda one: float(getattr(one, what))  # noqa: E731
        f, side, found = [value(low), value(high)], -1, high
        for _ in range(TRIALS):
            if abs(value(found)) <= found.slack or high.squared - low.squared <= JUMP * high.squared:
                break
            squared = (low.squared * f[1] - high.squared * f[0]) / (f[1] - f[0])
            start = low if squared - low.squared < high.squared - squared else high
            try:
                found = self._try(KILOVOLT * float(np.sqrt(squared)), start.state)
            except StepFailed:
                break
            now = int(value(found) <= 0.0)
            low, high = (low, found) if now else (found, high)
            f[1 - now] *= 0.5 if now == side else 1.0
            f[now], side = value(found), now
        return min(low, high, key=lambda one: abs(value(one)))


@dataclass(frozen=True)
class Wish:
    """A `force` (N/mm) on the bone along the unit vector `ahead` (d,) of its motion, from 0 to `most` V."""

    force: float
    ahead: Floats
    most: float

    def lacking(self, reaction: Floats) -> float:
        """Wished less present force (N/mm) at reactions (dim,)."""
        return self.force - float(reaction[::2] @ self.ahead)


@dataclass(frozen=True)
class Trials:
    """Equilibria of a step from `old` in which the bone moves by `travel`, x[, z] (d,) in mm, with a relative
    `tolerance`: `solve(control, start)`, by default from where the step begins, raises `StepFailed`;
    `unused(state, direction)` is the friction force (N/mm) along a unit vector (d,) by which sticking nodes
    are below their bounds.
    """

    old: State
    travel: Floats
    tolerance: float
    solve: Callable[..., State]
    unused: Callable[[State, Floats], float]

    def nearest(self, wish: Wish, given: Callable[[float], Any]) -> State:
        """The equilibrium nearest to a wish, by the controls `given` of prescribed voltages (V)."""

        def at(voltage: float, start: State | None) -> State:
            return self.solve(given(voltage), start)

        def measured(state: State) -> tuple[float, float, float]:
            return wish.lacking(state.reaction), self.unused(state, wish.ahead), strength(state)

        return Search(at, measured, self.old.voltage, wish.most, self.tolerance).nearest()


@dataclass(frozen=True)
class VoltageProblem:
    """Data for a voltage control: the present squared voltage (kV^2), a solved contact problem, state for the
    backward solve and condensed forces per kV^2 more; the same of forces on the pad nodes (P, dim), `pushed`;
    of a number with a gradient (P, dim), `measured`, the condensed row and its gains; the state of the `pad`
    and the `attraction`.
    """

    squared: float
    solve: Callable[[LinearContactStep], StepSolution]
    unit: Callable[[], tuple[Floats, Floats]]
    pushed: Any = None
    measured: Any = None
    pad: Any = None
    attraction: Any = None


@dataclass(frozen=True)
class VoltageStep:
    """A solved step, the change of the voltage's unknown (kV^2 or kV), the state for the backward solve."""

    solution: StepSolution
    change: float = 0.0
    unit: Floats | float = 0.0


def strength(state: State) -> float:
    """Largest force on the bone (N/mm), to which tolerances are relative."""
    return max(float(np.abs(state.reaction).max()), SMALLEST_FORCE)


def sticks(state: State) -> bool:
    """Whether any node sticks."""
    return bool((state.status == STICK).any())

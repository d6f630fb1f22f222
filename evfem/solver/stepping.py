"""Adaptive steps: a requested step is reached exactly, in as many parts as its equilibria need.

A part that fails is halved; after a part that took few iterations the next one grows. Nothing that has not
converged is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evfem.solver.equilibrium import Equilibrium
from evfem.solver.state import State, StepFailed, Target

#: from the share of the way that is done (0 to 1) and the next one to the target there
Path = Callable[[float, float], Target]


@dataclass
class Stepper:
    """Follows paths with an equilibrium solver; remembers the part of a step that worked last."""

    equilibrium: Equilibrium
    coupling: str = "monolithic"
    part: float = 1.0
    cuts: int = 0

    def follow(self, state: State, path: Path, accept: Callable[[State, State], None]) -> tuple[State, int]:
        """From `state` to the end of `path`; `accept(old, new)` sees every converged part. Returns the end
        and the number of parts.

        Raises `StepFailed` when the smallest part fails; what was accepted before stays accepted.
        """
        done, parts, strategy = 0.0, 0, self.equilibrium.strategy
        while done < 1.0:
            share = 1.0 if self.part >= 1.0 - done - 1e-12 else done + self.part
            before = self.equilibrium.record.iterations
            try:
                new = self.solve(state, path(done, share))
            except StepFailed:
                self.cuts += 1
                self.part = 0.5 * (share - done)
                if self.part < strategy.smallest_part:
                    self.part = 1.0
                    raise
                continue
            accept(state, new)
            state, done, parts = new, share, parts + 1
            if self.equilibrium.record.iterations - before <= strategy.easy:
                self.part = min(1.0, strategy.growth * self.part)
        return state, parts

    def solve(self, state: State, target: Target) -> State:
        """One equilibrium with the coupling asked for: all at once, or mechanics under attraction found
        beforehand.
        """
        equilibrium = self.equilibrium
        if self.coupling == "monolithic" or equilibrium.attraction is None:
            return equilibrium.step(state, target)
        frozen = equilibrium.attraction_at(state, state, target.voltage)
        new = equilibrium.step(state, target, frozen)
        if self.coupling == "staggered_once":
            return new
        for _ in range(200):
            frozen = equilibrium.attraction_at(state, new, target.voltage)
            change = np.abs(frozen - new.attraction).max()
            if change <= equilibrium.tolerance * max(np.abs(new.reaction).max(), 1e-6):
                return new
            new = equilibrium.step(state, target, frozen, start=new)
        raise StepFailed("the staggered coupling does not settle", equilibrium.record.residuals)

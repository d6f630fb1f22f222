"""Travel of the bone in one iteration, limited to the range where the linearised problem holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import SHORTEST_FLIGHT
from evfem.contact.condensed import LinearContactStep, StepSolution
from evfem.contact.signorini import ContactNotSolved
from evfem.newton.control import Target
from evfem.newton.interface import Interface
from evfem.newton.state import State

Solve = Callable[[LinearContactStep], StepSolution]


@dataclass(frozen=True)
class Travel:
    """Limits the increment of the bone; `longest` (mm): the largest one of a linear step."""

    interface: Interface
    longest: float

    def limited(
        self, step: LinearContactStep, found: StepSolution, state: State, target: Target, solve: Solve
    ) -> tuple[StepSolution, Floats]:
        """The contact solution and the increment of the bone (dim,); one that leaves the linear range is
        shortened, and contact solved again by `solve`.
        """
        if not step.unknowns:
            return found, step.bone
        bone = step.bone.copy()
        for unknown, travel in zip(step.unknowns, found.extra.tolist(), strict=False):
            bone[unknown.axis] += travel
        if not target.height.free:
            return found, bone
        missing = target.height.missing(float(state.bone[1]), state.reaction)
        leaves_linear_range = (
            not found.status.any() and bone[1] * missing < 0.0 and self._pulled_against_force(step, bone[1])
        )
        if abs(bone[1]) > self.longest or leaves_linear_range:
            # a long increment may rest on a single node, and a body whose attraction exceeds its stiffness
            # flies off: take a fraction of it, in the direction of the force residual
            longest = self.longest
            if leaves_linear_range:  # twice the gap, or a little
                gap = float(self.interface.surface_at(state).gap.min())
                longest = float(np.clip(2.0 * gap, SHORTEST_FLIGHT * longest, longest))
            bone[1] = np.copysign(longest, missing if leaves_linear_range else bone[1])
            found = solve(replace(step, bone=bone, unknowns=()))
        return found, bone

    def _pulled_against_force(self, step: LinearContactStep, travel: float) -> bool:
        """Whether this travel is opposite to the force residual without travel, or has no solution."""
        try:
            found = replace(step, unknowns=()).solve()
        except ContactNotSolved:
            return True
        return travel * step.lacking(found, 0.0) < 0.0

"""The surface below the candidates of a linear contact step: rigid, or a compliance in series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, block


class RigidBelow:
    """A rigid surface below the candidates of a linear step."""

    def relative(self, compliance: Floats) -> Floats:
        """Compliance of the candidates' positions relative to the surface."""
        return compliance

    def among(self, among: Floats, rows: Ints) -> Floats:
        """The same of some rows."""
        return among

    def unloaded(self, free: Floats) -> Floats:
        """Unloaded motion (dim C, 1 + p), without contact forces, relative to the surface."""
        return free

    def displacement(self, whole: Floats) -> Any:
        """Increment of the surface displacement (dim C,) under contact forces `whole` (dim C,)."""
        return 0.0


RIGID_BELOW = RigidBelow()


@dataclass(frozen=True, eq=False)
class BelowCandidates(RigidBelow):
    """An elastic surface below the candidates: its `compliance` (2 c, 2 c), in the order of the body's, and
    its increment without contact forces towards its displacement under the present attraction, `pulled`
    (2 c,) in mm.
    """

    compliance: Floats
    pulled: Floats

    def relative(self, compliance: Floats) -> Floats:
        return compliance + self.compliance

    def among(self, among: Floats, rows: Ints) -> Floats:
        return among + block(self.compliance, rows, rows)

    def unloaded(self, free: Floats) -> Floats:
        return free + np.pad(self.pulled[:, None], ((0, 0), (0, free.shape[1] - 1)))

    def displacement(self, whole: Floats) -> Any:
        return self.pulled + self.compliance @ whole

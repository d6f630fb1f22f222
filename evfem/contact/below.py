"""The foundation below the candidates of a linear contact step: rigid here, else a compliance in series."""

from __future__ import annotations

from typing import Any

from evfem.common.arrays import Floats, Ints


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

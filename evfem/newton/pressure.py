r"""Nearly incompressible tissue: the pressure as an unknown of the iterations, condensed at every point.

Newton's method for u alone fails as :math:`\nu \to 1/2` (docs, Theory, nearly incompressible tissue). With
the pressure q an iterate beside u, and index 0 where the tangent K was factorised,

.. math:: K_0\,\Delta u = -f(u, q(u)) - \int (q(u) - q)\,(\delta\theta_0 - \delta\theta)\,dX, \qquad
          q \leftarrow q(u) + q'_0\Delta u .

Only the curvature of theta in :math:`K_0` is weighted with :math:`q_0` instead of q(u_0). A state is accepted
by f(u, q(u)) alone. q has one value at each point (E, Q).

Sources: J. C. Simo, R. L. Taylor, K. S. Pister, Comput. Methods Appl. Mech. Eng. 51 (1985) 177-208,
doi:10.1016/0045-7825(85)90033-7 (pressure condensed per cell); D. Magisano, L. Leonetti, G. Garcea, Comput.
Methods Appl. Mech. Eng. 313 (2017) 986-1005 (stresses of displacement elements as iterates).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.rooms import Room
from evfem.errors import InputError
from evfem.newton.linearisation import Linearisation
from evfem.newton.state import State
from evfem.tissue.weakform import Tissue

#: the pressure between two substeps
NO_PRESSURE: Floats = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Pressure(Room):
    """The pressure as an unknown beside u, if nearly incompressible: `pressure` of an iterate's memory."""

    tissue: Tissue
    linearisation: Linearisation

    @property
    def active(self) -> bool:
        """Whether the pressure is an unknown."""
        return self.tissue.nearly_incompressible

    def check(self, q: Floats) -> None:
        """Refuse a pressure from a checkpoint that has not one value for each point."""
        expected = self.tissue.space.weight.shape if self.active else NO_PRESSURE.shape
        if q.shape != expected:
            raise InputError(
                "checkpoint", "no usable factor_memory.pressure", f"numbers of the shape {expected}"
            )

    def memory(self, state: Any) -> dict[str, Floats]:
        return {"pressure": NO_PRESSURE} if self.active else {}

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        return self.memory(new)

    def of(self, state: State) -> Floats | None:
        """The iterate's, None where it is no unknown."""
        found = state.memory.get("pressure", NO_PRESSURE)
        return found if found.size else None

    def first(self, u: Floats) -> dict[str, Floats]:
        """The first iterate of a step from an equilibrium at u (N, 2)."""
        return {"pressure": self.tissue.pressure(u)} if self.active else {}

    def misfit(self, state: State) -> Floats:
        """Residual of the pressure, q(u) - q."""
        return self.tissue.pressure(state.u) - state.memory["pressure"]

    def further_forces(self, state: State, misfit: Floats) -> Floats | None:
        """Forces (N, 2) of the misfit along the older tangent's volume less the present one's, or None."""
        at = self.linearisation.reusable
        if not self.active or at is None or at.state.u is state.u:
            return None
        return self.tissue.pressure_forces(at.state.u, misfit) - self.tissue.pressure_forces(state.u, misfit)

    def after(self, state: State, misfit: Floats, du: Floats, fraction: float) -> dict[str, Floats]:
        """The next iterate, after the fraction of an increment du (N, 2) of the displacements."""
        at = self.linearisation.reusable
        if not self.active or at is None:
            return {}
        change: Floats = misfit + self.tissue.pressure_change(at.state.u, du)
        return {"pressure": state.memory["pressure"] + fraction * change}

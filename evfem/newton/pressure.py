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

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.rooms import Room
from evfem.errors import InputError
from evfem.newton.linearisation import Linearisation
from evfem.newton.state import MixedBalance, State
from evfem.tissue.weakform import Tissue

#: the pressure between two substeps
NO_PRESSURE: Floats = np.zeros((0, 0))


@dataclass(frozen=True, eq=False)
class Unbalanced:
    """Out-of-balance forces (n,) and their residual; functions for the residual of other forces, and for the
    reduction of nodal forces (N, dim).
    """

    forces: Floats
    residual: float
    largest: Callable[[Floats], float]
    reduce: Callable[[Floats], Floats]


class NoPressure(Room):
    """Compressible tissue, whose pressure is no unknown; the same methods as `Pressure`."""

    shape: tuple[int, ...] = NO_PRESSURE.shape

    def check(self, q: Floats) -> None:
        """Raise `InputError` for a pressure from a checkpoint that has not one value per sample point."""
        if q.shape != self.shape:
            found = "no usable factor_memory.pressure"
            raise InputError("checkpoint", found, f"numbers of the shape {self.shape}")

    def first(self, u: Floats) -> dict[str, Floats]:
        """The first iterate of a step from an equilibrium at u (N, 2)."""
        return {}

    def balance(self, state: State, found: Unbalanced) -> MixedBalance:
        """The residual on which the iterations converge."""
        return MixedBalance(found.forces, found.residual, NO_PRESSURE)

    def after(self, state: State, misfit: Floats, du: Floats, fraction: float) -> dict[str, Floats]:
        """The next iterate, after the fraction of an increment du (N, 2) of the displacements."""
        return {}


@dataclass(frozen=True, eq=False)
class Pressure(NoPressure):
    """The pressure as an unknown beside u: `pressure` of an iterate's memory."""

    tissue: Tissue
    linearisation: Linearisation

    @property
    def shape(self) -> tuple[int, ...]:  # type: ignore[override]
        return self.tissue.space.weight.shape

    def memory(self, state: Any) -> dict[str, Floats]:
        return {"pressure": NO_PRESSURE}

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        return {"pressure": NO_PRESSURE}

    def first(self, u: Floats) -> dict[str, Floats]:
        return {"pressure": self.tissue.pressure(u)}

    def balance(self, state: State, found: Unbalanced) -> MixedBalance:
        """With the misfit q(u) - q, and the forces with the volumetric terms of the older tangent."""
        misfit = self.tissue.pressure(state.u) - state.memory["pressure"]
        forces, at = found.forces, self.linearisation.reusable
        if at is not None and at.state.u is not state.u:
            before, now = (self.tissue.pressure_forces(u, misfit) for u in (at.state.u, state.u))
            forces = forces + found.reduce(before - now)
        return MixedBalance(forces, found.largest(forces), misfit)

    def after(self, state: State, misfit: Floats, du: Floats, fraction: float) -> dict[str, Floats]:
        at = self.linearisation.reusable
        if at is None:
            return {}
        change: Floats = misfit + self.tissue.pressure_change(at.state.u, du)
        return {"pressure": state.memory["pressure"] + fraction * change}


def make_pressure(tissue: Tissue, linearisation: Linearisation) -> NoPressure:
    """The pressure of tissue, an unknown where it is nearly incompressible."""
    return Pressure(tissue, linearisation) if tissue.nearly_incompressible else NoPressure()

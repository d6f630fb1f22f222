r"""Nearly incompressible tissue: the pressure as an unknown of the iterations, condensed at every
point.

With :math:`S = \partial_F W` and the pressure :math:`q(u) = \partial_\theta W` of the laws (in
tension positive), equilibrium is :math:`f(u, q) = \int (S : \nabla v + q\,\delta\theta)\,dX` in
balance with :math:`q = q(u)`. Newton's method for u alone fails as :math:`\nu \to 1/2`: an
increment that keeps the volume to first order changes :math:`\theta` to second order, and the bulk
modulus makes of this a pressure that the next tangent takes at its word; under an older tangent
even a change of first order stays, as its rows of the volume are not those of the present state.
Hence q is an iterate beside u. Both equations linearised where the tangent :math:`K_0` was
factorised, at :math:`(u_0, q_0)`, with the derivative :math:`q'_0` of q(u) and the variation
:math:`\delta\theta_0` of the volume there, are

.. math:: \bigl(K_0\,\Delta u - \textstyle\int q'_0\Delta u\,\delta\theta_0\bigr)
          + \int \Delta q\,\delta\theta_0 = -f(u, q), \qquad \Delta q - q'_0\Delta u = q(u) - q .

As q is a number at each point, the second one gives :math:`\Delta q` at once. What is left has
the tangent of the displacements, in which only the curvature of theta is weighted with
:math:`q_0` instead of q(u_0), and forces that act along the older volume:

.. math:: K_0\,\Delta u = -f(u, q(u)) - \int (q(u) - q)\,(\delta\theta_0 - \delta\theta)\,dX, \qquad
          q \leftarrow q(u) + q'_0\Delta u .

The integral vanishes where the tangent is new. A state is accepted by f(u, q(u)) alone, so the
equilibria are those of the displacement formulation to the same tolerance. q has one value at
each point (E, Q); where a law's pressure depends on theta alone, it has the one coefficient per
cell of F-bar, or the three of Q2-P1.

Sources: J. C. Simo, R. L. Taylor, K. S. Pister, Comput. Methods Appl. Mech. Eng. 51 (1985)
177-208, doi:10.1016/0045-7825(85)90033-7 (pressure condensed per cell); D. Magisano, L. Leonetti,
G. Garcea, Comput. Methods Appl. Mech. Eng. 313 (2017) 986-1005 (stresses of displacement elements
as iterates).
"""

from __future__ import annotations

from dataclasses import dataclass

from evfem.common.arrays import Floats
from evfem.errors import InputError
from evfem.solver.linearisation import Linearisation
from evfem.solver.state import NO_PRESSURE, State
from evfem.tissue.weakform import Tissue


@dataclass(frozen=True, eq=False)
class Pressure:
    """The tissue's pressure as an unknown beside the displacements, if it is nearly incompressible
    and not without (0, 0) values.
    """

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
            raise InputError("checkpoint", "no usable factor_pressure", f"numbers of the shape {expected}")

    def begin(self, u: Floats) -> Floats:
        """Where the iterations of a step begin that comes from an equilibrium at u (N, 2)."""
        return self.tissue.pressure(u) if self.active else NO_PRESSURE

    def misfit(self, state: State) -> Floats:
        """Residual of the pressure, q(u) - q."""
        return self.tissue.pressure(state.u) - state.pressure if self.active else NO_PRESSURE

    def further_forces(self, state: State, misfit: Floats) -> Floats | None:
        """Nodal forces (N, 2) of the misfit along the older tangent's volume less those along the
        present one; None where both are the same.
        """
        at = self.linearisation.reusable
        if not self.active or at is None or at.u is state.u:
            return None
        return self.tissue.pressure_forces(at.u, misfit) - self.tissue.pressure_forces(state.u, misfit)

    def after(self, state: State, misfit: Floats, du: Floats, fraction: float) -> Floats:
        """The next pressure, after the fraction of an increment du (N, 2) of the displacements."""
        at = self.linearisation.reusable
        if not self.active or at is None:
            return state.pressure
        change: Floats = misfit + self.tissue.pressure_change(at.u, du)
        return state.pressure + fraction * change

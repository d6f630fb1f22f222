r"""Drag that holds a released body back: what a pseudo-time step of a relaxation adds to the
internal forces.

With the displacements u_0 before the step and its rate s, the relaxation time over the pseudo-time
step,

.. math:: P_d = 2\mu s\,F\,(E - E_0), \qquad f = s^2 M_d\,(u - u_0), \quad
          M_d = \int \frac{\mu}{H^2}\,N_i N_j\,dX .

The first is Kelvin-Voigt stress of one relaxation time everywhere; the second is inertia whose
speed is taken away at the beginning of each step, so a release never overshoots. Its density makes
a shear wave cross the height H of the body in the relaxation time. The stress holds what deforms,
down to single nodes; the mass holds what moves as a whole, a finger in the air under a force. Only
s enters, no time: there is nothing to choose. A large s leaves the body where it is; s = 0 is no
drag. Both dissipate, `dissipation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.tissue.dynamics import Dynamics
from evfem.tissue.pattern import Pattern
from evfem.tissue.space import Space


class Drag:
    """Kelvin-Voigt stress and mass of a relaxation; a term of the internal forces like any other.

    `groups` are laws with a shear modulus and the cells they hold for.
    """

    def __init__(self, space: Space, groups: Sequence[tuple[Any, Ints]]) -> None:
        modulus = np.zeros(len(space.nodes))
        for law, cells in groups:
            modulus[cells] = law.shear_modulus
        height = float(np.ptp(space.mesh.points[:, 1]))
        self._terms = Dynamics(space, modulus, modulus / height**2)

    def begin(self, u: Floats, rate: float) -> None:
        """Start a step of `rate` > 0 from displacements u (N, dim) at rest."""
        self._terms.begin(u, np.zeros_like(u), 1.0 / rate)

    def forces(self, u: Floats) -> Floats:
        """Nodal forces (N, dim)."""
        return self._terms.forces(u)

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats) -> None:
        """Add the tangent to the `data` of a pattern."""
        self._terms.add_tangent(u, pattern, data)

    def dissipation(self, u: Floats) -> float:
        """Dissipation by drag in the step that ends at u: N mm, in the plane per mm of depth."""
        moving = self._terms.kinetic_energy(self._terms.velocity(u))
        return self._terms.dissipation(u) + 2.0 * moving

r"""The foundation below the candidates of a linear contact step: rigid here, else a compliance in series.

An elastic surface is displaced by :math:`w_i = \sum_j C_{ij}(x_i - x_j)\,F_j`. In a linear step of a plane
pad its slopes change by :math:`S\,\delta F`, :math:`S = \partial_{x_i} C`, which turns the forces, and the
forces move with their nodes, which displaces it too:

.. math:: \delta F = f - F + K\,\delta F + t, \qquad r = C\,\delta F + L\,r, \qquad
          K_{ij} = -R_i S_{ij}, \qquad L_{ij} = -S_{ij} F_j

for forces f in the frames of the iterate, where R turns its forces F by a slope, and t by what its slopes
lack. So the compliance is :math:`(1 - L)^{-1} C\,(1 - K)^{-1}`. Without K and L a wavy surface as soft as the
finger tilts to and fro from iteration to iteration. Neglected is that slopes change as nodes move, of second
order in the strain of the surface; in space K and L too.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints


class Level:
    """Active nodes (m components) above a surface that does not tilt."""

    def compliance(self, C: Floats) -> Floats:
        """Compliance (m, m) from forces in the frames of the iterate to relative motions."""
        return C

    def motion(self, W: Floats) -> Floats:
        """Relative motions (m, p) as loads move with their nodes."""
        return W

    def equations(self, row: Floats, value: Floats, present: Floats) -> tuple[Floats, Floats]:
        """Equations row F = value, (p, m) and (p,), for forces in the frames of the iterate."""
        return row, value

    def shift(self, present: Floats) -> Any:
        """The forces (m,) in the frames of the iterate that are as if there were none; `present` (m,)."""
        return present

    def force(self, force: Floats, present: Floats) -> Floats:
        """Forces (m,) on the body for those in the frames of the iterate."""
        return force


@dataclass(frozen=True, eq=False)
class Tilt(Level):
    """Active nodes above a surface that tilts: (1 - K)^-1, (1 - L)^-1 (m, m), and t (m,)."""

    forces: Floats
    motions: Floats
    lacking: Floats

    def compliance(self, C: Floats) -> Floats:
        return np.asarray(self.motions @ C @ self.forces)

    def motion(self, W: Floats) -> Floats:
        return np.asarray(self.motions @ W)

    def equations(self, row: Floats, value: Floats, present: Floats) -> tuple[Floats, Floats]:
        turned = row @ self.forces
        return turned, value - row @ present + turned @ self.shift(present)

    def shift(self, present: Floats) -> Any:
        return present - self.lacking

    def force(self, force: Floats, present: Floats) -> Floats:
        return np.asarray(present + self.forces @ (force - self.shift(present)))


LEVEL = Level()


class RigidBelow:
    """A rigid surface below the candidates of a linear step."""

    tilts = False

    def relative(self, compliance: Floats) -> Floats:
        """Compliance of the candidates' positions relative to the surface."""
        return compliance

    def among(self, among: Floats, rows: Ints) -> Floats:
        """The same of some rows."""
        return among

    def unloaded(self, free: Floats) -> Floats:
        """Unloaded motion (dim C, 1 + p), without contact forces, relative to the surface."""
        return free

    def tilt(self, nodes: Ints, rows: Ints, turned: Floats) -> Level:
        """What tilts below active `nodes` (k,), whose forces are `turned` by a slope (k, 1 + d, d)."""
        return LEVEL

    def moved(self, motion: Floats) -> Floats:
        """Relative motion (dim C,) as loads move with their nodes."""
        return motion

    def displacement(self, motion: Floats, whole: Floats) -> tuple[Floats, Any]:
        """Motion of the body and increment of the surface displacement (dim C,) of a relative motion without
        loads that move, under contact forces `whole` (dim C,).
        """
        return motion, 0.0


RIGID_BELOW = RigidBelow()

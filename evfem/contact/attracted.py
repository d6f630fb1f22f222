r"""How the attraction of a node depends on its gap and on its contact force, as the contact problem
sees it (`evfem.contact.signorini`).

The attraction p of a node between rough faces grows with what presses it, the contact force
:math:`\lambda`. The problem knows p at no force, :math:`p_0`, and the tangent at the present force,
:math:`p + \kappa\,(\lambda' - \lambda)`. The tangent of a concave law is above p_0 at no force: a
node that it lifts off stays off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints


@dataclass(frozen=True)
class Roughness:
    """Attraction between rough faces, along normal and tangent: stronger by `gain` (k, 1 + d) times what a
    contact force has beyond `present` (k,), weaker by `loss_on_opening` (k, 1 + d) N/mm where open.
    """

    gain: Floats
    loss_on_opening: Floats
    present: Floats

    def of(self, nodes: Ints) -> Roughness:
        """The same of these nodes alone."""
        return Roughness(self.gain[nodes], self.loss_on_opening[nodes], self.present[nodes])


@dataclass(frozen=True)
class AttractionStiffness:
    """How the attraction of every node depends on its gap: it weakens by `negative_stiffness` (k,)
    per unit of gap from its value at `reference_gap` (k,) while open, and is stronger by
    `gain_on_closing` (k,) at g = 0. `roughness` says how it depends on the contact force there.
    """

    negative_stiffness: Floats
    reference_gap: Floats
    gain_on_closing: Floats
    roughness: Roughness | None = None


def feedback(compliance: Floats, held_by: Floats, gaps: Ints, held: Ints, stiffness: Floats) -> float:
    """Largest factor by which the attraction of open nodes returns to itself: from 1 on they snap.

    Their `gaps` (m,) are rows of the compliance, and the attraction weakens with them by `stiffness`
    (m,). The rows `held` (h,) of closed nodes do not move; `held_by` is the compliance to their forces.
    """
    if not gaps.size:
        return 0.0
    free = compliance[np.ix_(gaps, gaps)]
    if held.size:
        back = np.linalg.solve(held_by[np.ix_(held, held)], compliance[np.ix_(held, gaps)])
        free = free - compliance[np.ix_(gaps, held)] @ back
    root = np.sqrt(stiffness)
    gain = root[:, None] * free * root
    return float(np.linalg.eigvalsh(0.5 * (gain + gain.T))[-1])

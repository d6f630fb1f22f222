r"""The error of a path: how much the steps decide where friction and time make it matter.

Friction is counted from the last accepted state and viscosity goes by backward Euler, so a step of length h
errs by :math:`c h^2` locally: one part from a to b ends elsewhere than two halves do, and their difference
:math:`c h^2 - 2 c (h/2)^2 = c h^2 / 2` is the error of the two halves, which are kept. With inertia, of
second order in time, that is more than the error. The part that would just be allowed is
:math:`\sqrt{e_{allowed} / e}` times as long. Iterations of the one part begin at the end of the two, so that
asking costs little. The first part of a scene is a short one: from nothing, one part and two end alike where
in both every node slips, and neither sees the nodes that stick on a finer way.

The error is that of the forces on the bone, as a share of the largest, and of where the bone is,
as a share of how far it is from its rest. Errors of earlier parts fade where all slips.

Source: Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.4.
"""

from __future__ import annotations

import numpy as np

from evfem.common.constants import PATH_CHANGE, PATH_SAFETY, SMALLEST_FORCE
from evfem.newton.state import State


def relative_difference(once: State, twice: State) -> float:
    """Relative difference between the ends of one substep and of its two halves."""
    forces = np.abs(once.reaction - twice.reaction).max()
    places = np.abs(once.bone - twice.bone).max()
    moved = np.abs(twice.bone).max()
    relative = forces / max(np.abs(twice.reaction).max(), SMALLEST_FORCE)
    return float(max(relative, places / moved if places > 0.0 else 0.0))


def length_factor(error: float) -> float:
    """Length of the next part relative to one whose error is this fraction of the allowed one.

    >>> length_factor(0.0), round(length_factor(1.0), 3), length_factor(1e6)
    (4.0, 0.9, 0.25)
    """
    if error <= PATH_SAFETY**2 / PATH_CHANGE**2:
        return PATH_CHANGE
    return max(PATH_SAFETY / float(np.sqrt(error)), 1.0 / PATH_CHANGE)

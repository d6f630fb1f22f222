r"""The error of a path: how much the steps decide where friction and time make it matter.

Friction is counted from the last accepted state and time goes by backward Euler, so a step of length h errs
by :math:`c h^2` locally: one part from a to b ends elsewhere than two halves do, and their difference
:math:`c h^2 - 2 c (h/2)^2 = c h^2 / 2` is the error of the two halves [1]_, which are kept. The part that
would just be allowed is :math:`\sqrt{e_{allowed} / e}` times as long. Iterations of the one part begin at the
end of the two, so that asking costs little. The first part of a scene is a short one: from nothing, one part
and two end alike where in both every node slips, and neither sees the nodes that stick on a finer way.

The error is that of the forces on the bone, as a share of the largest, and of where the bone is,
as a share of how far it is from its rest. Errors of earlier parts fade where all slips.

.. [1] Hairer, Norsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.4.
"""

from __future__ import annotations

import numpy as np

from evfem.common.constants import PATH_CHANGE, PATH_SAFETY, SMALLEST_FORCE
from evfem.newton.state import State


def apart(once: State, twice: State) -> float:
    """Relative difference between the ends of one substep and of two halves."""
    forces = np.abs(once.reaction - twice.reaction).max()
    places = np.abs(once.bone - twice.bone).max()
    moved = np.abs(twice.bone).max()
    share = forces / max(np.abs(twice.reaction).max(), SMALLEST_FORCE)
    return float(max(share, places / moved if places > 0.0 else 0.0))


def longer(share: float) -> float:
    """The factor by which the next part may be longer, or this one must be shorter, whose error is
    this share of what is allowed.

    >>> longer(0.0), round(longer(1.0), 3), longer(1e6)
    (4.0, 0.9, 0.25)
    """
    if share <= PATH_SAFETY**2 / PATH_CHANGE**2:
        return PATH_CHANGE
    return max(PATH_SAFETY / float(np.sqrt(share)), 1.0 / PATH_CHANGE)

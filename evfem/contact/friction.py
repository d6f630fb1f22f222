"""Coulomb friction of a point: the cone, and its return map for the penalty variant.

In the plane there is one tangent. `slip` (mm) is how far the point has moved along the surface, `pressure`
(MPa) presses it on, `shear` (MPa) is the traction of the surface on the point along the same tangent: it
opposes the motion. Coulomb's law: abs(shear) <= mu pressure; the point slips only where equality holds,
against the shear.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evfem.tensor import Array, positive_part


class Shear(NamedTuple):
    """Result of `return_map`, all of one shape: traction, new history, the traction's derivatives, state."""

    shear: Array
    history: Array
    by_slip: Array
    by_pressure: Array
    slipping: Array


def cone_excess(shear: Array, pressure: Array, friction_coefficient: Array | float) -> Array:
    """abs(shear) - mu pressure in MPa: negative inside the cone of Coulomb's law, zero where the point may
    slip.

    >>> float(cone_excess(np.array(-0.5), np.array(2.0), 0.25))
    0.0
    """
    return np.where(np.real(shear) < 0.0, -shear, shear) - friction_coefficient * positive_part(pressure)


def return_map(
    slip: Array,
    history: Array,
    pressure: Array,
    friction_coefficient: Array | float,
    penalty: float,
) -> Shear:
    """Shear traction of Coulomb's law with an elastic stick of stiffness `penalty` (N/mm^3).

    history (mm) is the part of the slip that has been slipped for good; the stick carries
    -penalty (slip - history), projected onto the cone abs(shear) <= mu pressure. Beyond the cone the history
    follows so that the stick carries just the projected traction; a point without pressure carries nothing
    and its history follows the slip. Nothing is stored: commit the returned history once the step is
    accepted. Source: Wriggers, Computational Contact Mechanics, 2nd ed., 2006, doi:10.1007/978-3-540-32609-0.

    >>> stick, gone = return_map(np.array([0.1, 0.5]), np.zeros(2), np.ones(2), 0.3, penalty=1.0).shear
    >>> float(stick), float(gone)
    (-0.1, -0.3)
    """
    pressed = np.real(pressure) > 0.0
    limit = friction_coefficient * positive_part(pressure)
    trial = -penalty * (slip - history)
    direction = np.sign(np.real(trial))
    slipping = pressed & (np.real(trial) * direction > np.real(limit))
    shear = np.where(slipping, limit * direction, np.where(pressed, trial, 0.0))
    return Shear(
        shear=shear,
        history=np.where(slipping | ~pressed, slip + shear / penalty, history),
        by_slip=np.where(pressed & ~slipping, -penalty, 0.0),
        by_pressure=np.where(slipping, friction_coefficient * direction, 0.0),
        slipping=slipping,
    )

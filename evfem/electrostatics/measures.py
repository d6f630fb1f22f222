"""What a voltage may be asked to bring about (`evfem.solver.control.Met`): the electrode's charge and the
smallest gap of a pad, with their derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import KILOVOLT

#: gaps up to this (mm) count as closed
CLOSED = 1e-9


@dataclass(frozen=True, eq=False)
class Seen:
    """What the attraction sees of a state: positions (P, dim), the surface below them, voltage (V), contact
    forces along the normal (P,), and who touched when the step began (P,).
    """

    attraction: Any
    position: Floats
    surface: Any
    voltage: float
    pressing: Floats
    touching: Any

    @classmethod
    def of(cls, attraction: Any, interface: Any, state: Any, touching: Any) -> Seen:
        """Of a `state` on its `interface`, in a step that began with these nodes `touching` (P,)."""
        at = interface.resting(state), interface.surface_at(state)
        return cls(attraction, *at, state.voltage, state.contact_force[:, 0], touching)

    def forces(self, voltage: float) -> Floats:
        """Attraction (P, dim) of the pad nodes under a voltage (V)."""
        return np.asarray(self.attraction.forces(self.position, voltage, self.touching, self.pressing))

    @property
    def slope(self) -> Floats:
        """By how much the attraction (P, dim) grows with a kV: it is quadratic in the voltage."""
        more, less = (self.forces(self.voltage + change) for change in (KILOVOLT, -KILOVOLT))
        return 0.5 * (more - less)


@dataclass(frozen=True, eq=False)
class Reading:
    """A number that a state has, with its derivatives by a kV and by the positions (P, dim)."""

    value: float
    by_voltage: float
    by_position: Floats


def electrode_charge(seen: Seen) -> Reading:
    """Charge of the electrode over eps_0 (V, in space V mm): its derivative by the gap of a touching node is
    left out.
    """
    charging, surface = seen.attraction.charging, seen.surface
    at = seen.attraction.charged(seen.position, seen.voltage, seen.pressing)
    by_gap, by_length = charging.charge_slopes(at)
    by_gap = np.where(surface.gap > CLOSED, by_gap, 0.0)
    by_position = np.zeros_like(seen.position)
    by_position[:, 0], by_position[:, 1] = -by_gap * surface.slope, by_gap
    of, moved, value = seen.attraction.pad.tributary_gradient(seen.position)
    by_position += np.bincount(moved, by_length[of] * value, by_position.size).reshape(by_position.shape)
    return Reading(charging.electrode_charge(at), KILOVOLT * charging.capacity(at), by_position)


def smallest_gap(seen: Seen) -> Reading:
    """The smallest vertical gap of the pad (mm)."""
    least = int(np.argmin(seen.surface.gap))
    by_position = np.zeros_like(seen.position)
    by_position[least, :2] = -seen.surface.slope[least], 1.0
    return Reading(float(seen.surface.gap[least]), 0.0, by_position)

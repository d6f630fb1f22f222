"""Attraction by a voltage and by adhesion together: the sum of both, each of its own law.

The solver sees one attraction. Adhesion is always on: its law takes the strength `ON` in the place of a
voltage.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.contact.attraction import Attraction, Entries
from evfem.surface.adhesion import ON


@dataclass(frozen=True, eq=False)
class WithAdhesion(Attraction):
    """The `electric` attraction (None: none) and the `adhesive` one; law and charges are the voltage's."""

    electric: Attraction | None = None
    adhesive: Attraction | None = None

    @classmethod
    def of(cls, electric: Attraction | None, adhesive: Attraction) -> WithAdhesion:
        """Both, on the same pad."""
        a, law, layers, charging = adhesive, None, None, None
        if electric is not None:
            law, layers, charging = electric.law, electric.layers, electric.charging
        common = (a.pad, a.surface, a.direction, True, a.roughness)
        return cls(law, layers, *common, charging, electric, adhesive)

    def acts(self, voltage: float) -> bool:
        """Always."""
        return True

    def _parts(self, voltage: float) -> Iterator[tuple[Attraction, float]]:
        """What attracts at a voltage (V), and the voltage that it takes."""
        if self.electric is not None and self.electric.acts(voltage):
            yield self.electric, voltage
        assert self.adhesive is not None
        yield self.adhesive, ON

    def forces_along(
        self, positions: Floats, voltages: Floats, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        assert self.adhesive is not None
        on = np.full(voltages.shape, ON)
        found = self.adhesive.forces_along(positions, on, touching, pressing)
        if self.electric is None:
            return found
        return found + self.electric.forces_along(positions, voltages, touching, pressing)

    def restored(self, voltage: float) -> tuple[Floats, Floats] | None:
        found = [one for part, at in self._parts(voltage) if (one := part.restored(at)) is not None]
        if not found:
            return None
        withheld, left = np.sum(found, axis=0)
        return withheld, left

    def gain_on_pressing(self, position: Floats, voltage: float, touching: Any, pressing: Floats) -> Floats:
        each = (part.gain_on_pressing(position, at, touching, pressing) for part, at in self._parts(voltage))
        return np.asarray(sum(each))

    def negative_stiffness(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        each = (
            part.negative_stiffness(position, at, touching, pressing) for part, at in self._parts(voltage)
        )
        return np.asarray(sum(each))

    def stiffness(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Entries:
        found = [part.stiffness(position, at, touching, pressing) for part, at in self._parts(voltage)]
        return Entries.of(position.size, [one[1:] for one in found])

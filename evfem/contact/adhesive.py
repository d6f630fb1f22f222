"""Several attractions of a pad: their sum, which the solver sees as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.contact.attraction import Attraction, Entries, NoAttraction


def sum_of(parts: Sequence[Attraction]) -> Attraction | NoAttraction:
    """The sum of attractions on one pad."""
    if not parts:
        return NoAttraction()
    one = parts[0]
    return one if len(parts) == 1 and not one.always else Attractions.of(parts)


@dataclass(frozen=True, eq=False)
class Attractions(Attraction):
    """The sum of its `parts`; law, layers and charges are those of the first, the voltage's."""

    parts: tuple[Attraction, ...] = ()

    @classmethod
    def of(cls, parts: Sequence[Attraction]) -> Attractions:
        """Attractions on the same pad, that of a voltage first."""
        one = parts[0]
        common = (one.pad, one.surface, one.direction, True, one.roughness)
        always = any(part.always for part in parts)
        return cls(one.law, one.layers, *common, one.charging, always=always, parts=tuple(parts))

    def load(self, voltage: float) -> float:
        return voltage

    def _sum(self, voltage: float, of: Callable[[Attraction, float], Any]) -> Any:
        """The sum over the parts that act at a voltage (V), each at what its law takes."""
        return sum(of(part, part.load(voltage)) for part in self.parts if part.acts(voltage))

    def forces_along(
        self, positions: Floats, voltages: Floats, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        loads = [np.array([part.load(one) for one in voltages.tolist()]) for part in self.parts]
        each = zip(self.parts, loads, strict=True)
        return np.asarray(sum(part.forces_along(positions, at, touching, pressing) for part, at in each))

    def restored(self, voltage: float) -> tuple[Floats, Floats]:
        withheld, left = np.sum([part.restored(part.load(voltage)) for part in self.parts], axis=0)
        return withheld, left

    def gain_on_pressing(self, position: Floats, voltage: float, touching: Any, pressing: Floats) -> Floats:
        return np.asarray(
            self._sum(voltage, lambda part, at: part.gain_on_pressing(position, at, touching, pressing))
        )

    def negative_stiffness(
        self, position: Floats, voltage: float, touching: Any, pressing: Floats | None = None
    ) -> Floats:
        return np.asarray(
            self._sum(voltage, lambda part, at: part.negative_stiffness(position, at, touching, pressing))
        )

    def stiffness(self, position: Floats, voltage: float, touching: Any, pressing: Any = None) -> Entries:
        found = [
            part.stiffness(position, part.load(voltage), touching, pressing)
            for part in self.parts
            if part.acts(voltage)
        ]
        return Entries.of(position.size, [one[1:] for one in found])

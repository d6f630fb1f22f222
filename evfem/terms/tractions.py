"""Several tractions on a pad: their sum, which the solver sees as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.terms.traction import Entries, NoTraction, PadState, PadTraction


def sum_of(parts: Sequence[Any]) -> Any:
    """The sum of tractions on one pad: a voltage's alone is itself."""
    if not parts:
        return NoTraction()
    return parts[0] if len(parts) == 1 and not parts[0].always else Tractions(parts)


class Tractions(PadTraction):
    """The sum of its `parts`, a voltage's first; it keeps the forces (P, dim) of all others, by name."""

    def __init__(self, parts: Sequence[Any]) -> None:
        self._parts = tuple(parts)
        self.always = any(part.always for part in parts)
        self.rough = any(part.rough for part in parts)
        self.flows = any(part.flows for part in parts)
        self.direction = parts[0].direction

    @property
    def parts(self) -> tuple[Any, ...]:
        return self._parts

    @property
    def charging(self) -> Any:
        """Of the voltage's."""
        return self.parts[0].charging

    def acts(self, voltage: float) -> bool:
        return any(part.acts(voltage) for part in self.parts)

    def _sum(self, pad: PadState, of: Callable[[Any], Any]) -> Any:
        """The sum over the parts that act on the pad."""
        return np.asarray(sum(of(part) for part in self.parts if part.acts(pad.voltage)))

    def memory(self, state: Any) -> dict[str, Floats]:
        own = {f"forces.{part.name}": np.zeros_like(state.attraction) for part in self.parts[1:]}
        return own | {name: kept for part in self.parts for name, kept in part.memory(state).items()}

    def begin(self, old: PadState, seconds: float) -> None:
        for part in self.parts:
            part.begin(old, seconds)

    def accept(self, old: PadState, new: PadState) -> dict[str, Floats]:
        own = {f"forces.{part.name}": part.forces(new) for part in self.parts[1:]}
        return own | {name: kept for part in self.parts for name, kept in part.accept(old, new).items()}

    def forces(self, pad: PadState) -> Floats:
        return np.asarray(sum(part.forces(pad) for part in self.parts))

    def forces_along(self, path: PadState) -> Floats:
        return np.asarray(sum(part.forces_along(path) for part in self.parts))

    def weights(self, pad: PadState) -> Floats:
        return self.parts[0].weights(pad)

    def restored(self, voltage: float) -> tuple[Any, Any]:
        withheld, left = zip(*(part.restored(voltage) for part in self.parts), strict=True)
        return sum(withheld), sum(left)

    def gain_on_pressing(self, pad: PadState) -> Floats:
        return self._sum(pad, lambda part: part.gain_on_pressing(pad))

    def weakening(self, pad: PadState) -> Floats:
        return self._sum(pad, lambda part: part.weakening(pad))

    def stiffness(self, pad: PadState) -> Entries:
        found = [part.stiffness(pad) for part in self.parts if part.acts(pad.voltage)]
        return Entries.of(pad.position.size, [one[1:] for one in found])

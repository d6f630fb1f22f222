"""Several tractions on a pad: their sum, which the solver sees as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.rooms import begun, ended, shaped
from evfem.terms.traction import Entries, NoTraction, PadState, PadTraction

#: a finger that does not touch has come off when the attraction is below this fraction of its largest pull
LEFT = 0.01


@dataclass
class PullOff:
    """Pull-off of a finger under tractions without a voltage. `lift` (4,): the largest tension (N/mm or N) on
    it in the equilibria since it was last pressed, the height (mm) and tension of the last one, and the
    slope between the last two. `let_go`: the largest tension and a bound of it, of a pull-off in this step.
    `came_off`, rows (k, 3): step, largest tension and bound.
    """

    lift: Floats = field(default_factory=lambda: np.zeros(4))
    let_go: tuple[float, ...] = ()
    came_off: Floats = field(default_factory=lambda: np.zeros((0, 3)))

    def watch(self, state: Any, forces: dict[str, Floats], rests: bool) -> None:
        """An accepted state under these forces (P, dim) by name; `rests` without drag."""
        holds = -float(sum(force[:, 1].sum() for force in forces.values()))
        largest, below, last, slope = self.lift
        height, tension = float(state.bone[1]), float(state.reaction[1])
        if not state.touching.any() and largest > 0.0 and holds < LEFT * largest:
            self.let_go = largest, max(largest, last + slope * (height - below))
            self.lift = np.array([0.0, height, 0.0, 0.0])
        elif rests:
            held = (state.touching.any() or holds > 0.0) and tension > 0.0
            slope = (tension - last) / (height - below) if height != below else 0.0
            self.lift = np.array([max(largest, tension) if held else 0.0, height, tension, slope])

    def ends(self, step: int) -> None:
        """A step of that number is done."""
        if self.let_go:
            self.came_off, self.let_go = np.vstack([self.came_off, [step, *self.let_go]]), ()


class NoPullOff(PullOff):
    """Nothing holds the finger but a voltage."""

    def watch(self, state: Any, forces: dict[str, Floats], rests: bool) -> None:
        return


def pull_off_of(attraction: Any) -> PullOff:
    """What watches a finger under a sum of tractions."""
    return PullOff() if any(traction.always for traction in attraction.parts) else NoPullOff()


def sum_of(parts: Sequence[Any]) -> Any:
    """The sum of tractions on one pad: a voltage's alone is itself."""
    if not parts:
        return NoTraction()
    return parts[0] if len(parts) == 1 and not parts[0].always else Tractions(parts)


class Tractions(PadTraction):
    """The sum of its `parts`, a voltage's first; it keeps the forces (P, dim) of all others, by name."""

    def __init__(self, parts: Sequence[Any]) -> None:
        self._parts = tuple(parts)
        self.always = any(traction.always for traction in parts)
        self.flows = any(traction.flows for traction in parts)
        self.direction = parts[0].direction

    @property
    def parts(self) -> tuple[Any, ...]:
        return self._parts

    @property
    def charging(self) -> Any:
        """Of the voltage's."""
        return self.parts[0].charging

    def acts(self, voltage: float) -> bool:
        return any(traction.acts(voltage) for traction in self.parts)

    def _sum(self, pad: PadState, of: Callable[[Any], Any]) -> Any:
        """The sum over the tractions that act on the pad."""
        return np.asarray(sum(of(traction) for traction in self.parts if traction.acts(pad.voltage)))

    def memory(self, state: Any) -> dict[str, Floats]:
        found = {f"forces.{traction.name}": np.zeros_like(state.attraction) for traction in self.parts[1:]}
        for traction in self.parts:
            found |= begun(traction, found, traction.memory(state))
        return found

    def restart(self, old: Any, target: Any) -> dict[str, Floats]:
        return {name: kept for traction in self.parts for name, kept in traction.restart(old, target).items()}

    def begin(self, old: PadState, seconds: float) -> None:
        for traction in self.parts:
            traction.begin(old, seconds)

    def accept(self, old: PadState, new: PadState) -> dict[str, Floats]:
        found = {f"forces.{traction.name}": traction.forces(new) for traction in self.parts[1:]}
        for traction in self.parts:
            found |= ended(traction, old.memory, traction.accept(old, new))
        return found

    def forces(self, pad: PadState) -> Floats:
        return np.asarray(sum(shaped(one, "forces", one.forces(pad), pad.position) for one in self.parts))

    def forces_along(self, path: PadState) -> Floats:
        found = ((one, one.forces_along(path)) for one in self.parts)
        return np.asarray(sum(shaped(one, "forces_along", each, path.position) for one, each in found))

    def weights(self, pad: PadState) -> Floats:
        return self.parts[0].weights(pad)

    def restored(self, voltage: float) -> tuple[Any, Any]:
        withheld, left = zip(*(traction.restored(voltage) for traction in self.parts), strict=True)
        return sum(withheld), sum(left)

    def gain_on_pressing(self, pad: PadState) -> Floats:
        return self._sum(pad, lambda traction: traction.gain_on_pressing(pad))

    def weakening(self, pad: PadState) -> Floats:
        return self._sum(pad, lambda traction: traction.weakening(pad))

    def stiffness(self, pad: PadState) -> Entries:
        found = [traction.stiffness(pad) for traction in self.parts if traction.acts(pad.voltage)]
        return Entries.of(pad.position.size, [one[1:] for one in found])

"""How the tractions on candidates depend on the contact force: not at all, or to first order."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints


class OfGapAlone:
    """Tractions that contact forces do not change, on any number of nodes."""

    #: whether contact forces change them; growth per contact force, (k, 1 + d)
    acts: bool = False
    gain: Any = 0.0

    def __getitem__(self, nodes: Ints) -> OfGapAlone:
        """The same of these nodes alone."""
        return self

    def loss(self, opened: Any) -> Any:
        """What they lack (k, 1 + d) in N/mm beside `gain` times the whole contact force, of nodes that are
        `opened` (k, 1) bool, or closed.
        """
        return 0.0

    def columns(self, count: int) -> tuple[Floats, ...]:
        """`ByForce` as columns of so many nodes."""
        none = np.zeros((count, 2))
        return none, none, none[:, 0]


OF_GAP_ALONE = OfGapAlone()


@dataclass(frozen=True, eq=False)
class ByForce(OfGapAlone):
    """Tractions, along normal and tangents, increased by `gain` (k, 1 + d) times the contact force beyond
    `present` (k,), reduced by `on_opening` (k, 1 + d) N/mm where the node opens.
    """

    gain: Floats = field()
    on_opening: Floats
    present: Floats
    acts = True

    def __getitem__(self, nodes: Ints) -> ByForce:
        return ByForce(self.gain[nodes], self.on_opening[nodes], self.present[nodes])

    def loss(self, opened: Any) -> Floats:
        return np.where(opened, self.on_opening, self.gain * self.present[:, None])

    def columns(self, count: int) -> tuple[Floats, ...]:
        return self.gain, self.on_opening, self.present

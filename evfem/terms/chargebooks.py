"""Works and energy of charges that move in time, as columns of the history (`evfem.terms.charging`).

They are known under a law that is the pressure of the field in layers, Strong and Troxel's; 0 under another.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.common.quadrature import SHARE, WAY
from evfem.common.rooms import Column, Room
from evfem.terms.traction import PadPath


@dataclass(frozen=True)
class ChargeBooks(Room):
    """The balance of the source of a voltage, whose `attraction` it is, on the pad."""

    attraction: Any
    columns = (
        Column("source_work", "N", "of the voltage's source, where it is resolved in time"),
        Column("leakage_dissipation", "N", "by charge that crosses skin, gap, insulator"),
        Column("stretch_work", "N", "of the field on the pad's length, where it is resolved in time"),
        Column("field_energy", "N", "of the electric field, where it is resolved in time"),
    )

    @property
    def known(self) -> bool:
        """Whether the law is that of a field."""
        return bool(getattr(self.attraction.law, "of_a_field", False))

    def values(self, model: Any, state: Any) -> dict[str, float]:
        if not self.known:
            return {"field_energy": 0.0}
        charged = self.attraction.charged(model.equilibrium.pad_state(state))
        return {"field_energy": self.attraction.charging.field_energy(charged)}

    def works(self, substep: Any) -> dict[str, float]:
        if not self.known:
            return dict.fromkeys(("source_work", "leakage_dissipation", "stretch_work"), 0.0)
        source, leaked = self._flow(substep)
        return {
            "source_work": source,
            "leakage_dissipation": leaked,
            "stretch_work": self._stretching(substep),
        }

    def _flow(self, substep: Any) -> tuple[float, float]:
        """Work of the source and leakage; the first voltage is raised before anything moves."""
        charging = self.attraction.charging
        flow = charging.flow(self.attraction.charged(substep.pads[1]))
        raised = substep.old.voltage != charging.old.voltage
        return flow.source_work + (charging.field_energy(charging.old) if raised else 0.0), flow.leakage

    def _stretching(self, substep: Any) -> float:
        """Work of the field on the tributary lengths on the path of the charged pad."""
        (before, after), charging = substep.pads, self.attraction.charging
        lengths = self.attraction.pad.tributary
        grown = lengths(after.position) - lengths(before.position)
        volts, work = charging.old.voltage, 0.0
        none = np.zeros_like(before.position)
        path = PadPath(before, after, none, none, (none, none)).at(WAY, np.full(WAY.shape, volts))
        for pad, weight in zip(path.states(), SHARE, strict=True):
            carried = {"charges": charging.carried(lengths(pad.position))}
            at = self.attraction.charged(replace(pad, memory=carried))
            work += weight * float(charging.energy_density(at) @ grown)
        return work

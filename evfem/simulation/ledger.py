r"""What is reported of a run: one row per requested step, works and energies summed over its parts, and the
fields.

Works are trapezoidal over every accepted part: the bone's reaction on its travel, the attraction on the pad's
displacement (with the attraction the part begins with, at its own voltage), and friction
:math:`-\frac12(\lambda_t^0 + \lambda_t)\,s` on the slip along the profile.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.contact.pad import surface_state
from evfem.contact.signorini import FORWARD, OPEN, STICK
from evfem.simulation.model import Model
from evfem.simulation.result import Frame, Row
from evfem.solver.state import State

SUMS = ("external_work", "electrostatic_work", "friction_dissipation", "viscous_dissipation")


@dataclass
class Ledger:
    """Running sums of a run, by the names of the history's columns."""

    model: Model
    sums: dict[str, float] = field(default_factory=lambda: dict.fromkeys(SUMS, 0.0))

    def accept(self, old: State, new: State) -> None:
        """Add the works of one converged part."""
        model = self.model
        nodes = model.pad.nodes
        self.sums["external_work"] += float(0.5 * (old.reaction + new.reaction) @ (new.bone - old.bone))
        moved = new.u[nodes] - old.u[nodes]
        self.sums["electrostatic_work"] += float(np.sum(0.5 * (old.attraction + new.attraction) * moved))
        before, after = (surface_state(model.surface, model.equilibrium.positions(s.u)) for s in (old, new))
        slip = 0.5 * (before.stretch + after.stretch) * moved[:, 0]
        slip[(new.status == STICK) | (new.status == OPEN)] = 0.0
        shear = 0.5 * (old.contact_force[:, 1] + new.contact_force[:, 1])
        self.sums["friction_dissipation"] -= float(np.sum(shear * slip))
        if model.body.dynamics is not None:
            self.sums["viscous_dissipation"] += model.body.dynamics.dissipation(new.u)

    def row(self, state: State, step: int, motion_index: int, motion: str, time: float) -> dict[str, Any]:
        """The forces, widths and energies of a state; costs are added by the caller."""
        model, dynamics = self.model, self.model.body.dynamics
        position = model.equilibrium.positions(state.u)
        contact = model.equilibrium.contact_forces(state).sum(axis=0)
        attraction = state.attraction.sum(axis=0)
        width, real = model.pad.contact_widths(position[:, 0], state.status != OPEN)
        return {
            "step": step,
            "motion_index": motion_index,
            "motion": motion,
            "time": time,
            "position": float(state.bone[0]),
            "indentation": model.indentation(state.bone),
            "voltage": state.voltage,
            "applied_force": float(-state.reaction[1]),
            "applied_tangential_force": float(state.reaction[0]),
            "normal_force": float(contact[1]),
            "tangential_force": float(-contact[0]),
            "electrostatic_force": float(-attraction[1]),
            "electrostatic_force_x": float(attraction[0]),
            "contact_width": width,
            "real_contact_width": real,
            "min_gap": float(surface_state(model.surface, position).gap.min()),
            **self.sums,
            "stored_energy": model.body.energy(state.u),
            "kinetic_energy": 0.0 if dynamics is None else dynamics.kinetic_energy(state.velocity),
        }


def frame_of(model: Model, state: State, row: Row) -> Frame:
    """Fields of a state, as they go to ParaView."""
    size, nodes = model.body.space.size, model.pad.nodes
    position = model.equilibrium.positions(state.u)
    length = model.pad.length(position[:, 0])
    surface = surface_state(model.surface, position)
    share = np.where(length > 0, length, np.inf)

    def on_pad(values: Any, off: float) -> Any:
        field = np.full(size, off)
        field[nodes] = values
        return field

    stress, J = model.body.tissue.cell_stress(state.u)
    xx, yy, zz, xy = stress.T
    status = np.minimum(state.status, FORWARD)
    return Frame(
        step=row["step"],
        time=row["time"],
        position=row["position"],
        displacement=state.u.copy(),
        gap=on_pad(surface.gap, np.nan),
        contact_pressure=on_pad(state.contact_force[:, 0] / share, 0.0),
        shear_traction=on_pad(state.contact_force[:, 1] / share, 0.0),
        electrostatic_traction=on_pad(np.hypot(*state.attraction.T) / share, 0.0),
        contact_status=on_pad(status, 0).astype(np.int64),
        von_mises=np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * xy**2),
        cauchy_stress=stress,
        J=J,
    )

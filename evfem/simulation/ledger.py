"""Energy account and output of a run: a row per requested step, works and energies (`works`), fields."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial, reduce
from operator import or_
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.contact.signorini import FORWARD, OPEN, SLIP
from evfem.errors import InputError
from evfem.newton.control import VoltageControl
from evfem.newton.interface import Interface
from evfem.newton.state import State
from evfem.simulation.history import ADDED, SUMS, WIDTHS
from evfem.simulation.model import Model
from evfem.simulation.result import Frame, Row
from evfem.simulation.works import EnergyState, SubstepWork
from evfem.surface.pad import Pad, reach, surface_state
from evfem.terms.attraction import ELECTROSTATIC
from evfem.terms.traction import PadTraction
from evfem.terms.tractions import NoPullOff, PullOff


def unloaded(state: State) -> State:
    """The state before the first substep, without voltage, attraction and reaction."""
    attraction, reaction = np.zeros_like(state.attraction), np.zeros_like(state.reaction)
    return replace(state, voltage=0.0, attraction=attraction, reaction=reaction)


@dataclass
class EnergyAccount:
    """Energy account of a run: sums of works and dissipations by the history's columns, the energies at the
    end of its last substep, the pull-off force, and the `control` of the voltage in the present step.
    """

    model: Model
    sums: dict[str, float] = field(default_factory=dict)
    end: EnergyState | None = None
    pull_off: PullOff = field(default_factory=NoPullOff)
    control: VoltageControl = field(default_factory=VoltageControl)

    def __post_init__(self) -> None:
        names = (one.name for one in self.model.columns if one.name.endswith(ADDED))
        self.sums = dict.fromkeys((*SUMS, *names), 0.0) | self.sums

    def add_substep(self, old: State, new: State) -> bool:
        """Add the works of one converged substep; returns whether stability was lost in it."""
        begin = old if self.end else unloaded(old)
        substep = SubstepWork(self.model, begin, new, first=self.end is None, control=self.control)
        self._watch(new)
        account = self.end or EnergyState.nothing(old.u.shape)
        self.end = substep.end()
        works = substep.works(account, self.end)
        for name, work in works.items():
            self.sums[name] += work
        return works["snap_dissipation"] > 0.0

    def _watch(self, new: State) -> None:
        """Record the pull-off force of a finger under tractions without a voltage."""
        pulls, always = self.model.equilibrium.pulls(new), self.model.held_by
        self.pull_off.watch(new, {name: pulls[name] for name in always}, self.model.body.drag_rate == 0.0)

    def snapshot(self) -> tuple[dict[str, float], EnergyState | None]:
        """Snapshot of the sums and energies."""
        return self.sums.copy(), self.end

    def restore(self, kept: tuple[dict[str, float], EnergyState | None]) -> None:
        """Restore a snapshot."""
        self.sums, self.end = kept[0].copy(), kept[1]

    def row(self, state: State, step: int, motion_index: int, motion: str, time: float) -> dict[str, Any]:
        """The forces, widths and energies of a state; costs are added by the caller."""
        model, end = self.model, self.end
        assert end is not None
        self.pull_off.ends(step)
        interface = model.equilibrium.interface
        position, places = interface.positions(state.u), interface.places(state)
        contact, withheld = interface.contact_forces(state).sum(axis=0), interface.withheld(state)
        touching = state.status != OPEN
        pulls = self._pulls(state, withheld)
        real, extent = _extent(model, state, position, contact)
        pressing, (along, forward) = state.contact_force[:, 0] + withheld, self._forward(motion_index)
        row = {
            "step": step,
            "motion_index": motion_index,
            "motion": motion,
            "time": time,
            "position": float(state.bone[0]),
            "indentation": model.indentation(state.bone),
            "voltage": state.voltage,
            "applied_force": float(0.0 - state.reaction[1]),  # 0.0 - x: no -0.0
            "applied_tangential_force": float(state.reaction[along] @ forward),
            "normal_force": float(contact[1] + withheld.sum()),
            "tangential_force": float(0.0 - contact[along] @ forward),
            **{f"{name}_force": float(kept - pull[1]) for name, (pull, kept) in pulls.items()},
            **reduce(or_, (_components(f"{name}_force", pull) for name, (pull, _) in pulls.items())),
            **extent,
            "min_gap": float(surface_state(model.surface, places).gap.min()),
            "peak_contact_pressure": float(tractions(interface, state, pressing, pressing).max()),
            "mean_contact_pressure": float(pressing[touching].sum() / real) if real > 0.0 else 0.0,
            **self.sums,
            **end.columns,
        }
        return reduce(or_, (_values(room, model, state, row) for room in model.shown), row)

    def _pulls(self, state: State, withheld: Floats) -> dict[str, tuple[Floats, float]]:
        """Of every attraction by name: its force on the pad (dim,), and the force that its regularised law
        removes.
        """
        model, none = self.model, np.zeros(state.bone.size)
        found: dict[str, tuple[Floats, float]] = {ELECTROSTATIC: (none, 0.0)}
        pulls = model.equilibrium.pulls(state)
        interface, both = model.equilibrium.interface, model.attraction.restored(state.voltage)[0]
        removed = np.where(both > 0.0, both, np.inf)
        for traction in model.attraction.parts:
            fraction = traction.restored(state.voltage)[0] / removed
            pull = interface.foundation.turned(state, pulls[traction.name]).sum(axis=0)
            found[traction.name] = pull, float(np.sum(fraction * withheld))
        return found

    def _forward(self, motion_index: int) -> tuple[list[int], Floats]:
        """Axes in the plane of the display, and the direction of the last slide's angle, +x before."""
        courses, axes = self.model.scene.courses[: motion_index + 1], self.model.mesh.dim - 1
        slides = [course.direction for course in courses if course.distance]
        return [0, 2][:axes], np.array((slides[-1] if slides else (1.0, 0.0))[:axes])


def _values(room: Any, model: Model, state: State, row: Row) -> dict[str, float]:
    """What a room says of a state and its row: all of its columns that are no sums."""
    told = {**room.values(model, state), **room.of_row(row)}
    wanted = [one.name for one in room.columns if not one.name.endswith(ADDED)]
    if set(told) != set(wanted):
        raise InputError(f"{type(room).__name__}.values", f"{sorted(told)}", f"its columns {sorted(wanted)}")
    return {name: float(told[name]) for name in wanted}


def _components(name: str, force: Floats) -> dict[str, float]:
    """Columns of a force's components (dim,) along x, in space along z too."""
    return {f"{name}_{axis}": float(force[i]) for axis, i in zip("xz", range(0, force.size, 2), strict=False)}


def _extent(model: Model, state: State, position: Floats, contact: Floats) -> tuple[float, dict[str, float]]:
    """Columns of the widths or areas of contact, mm or mm2, in space those along z too; pad nodes are at
    `position` (P, dim), and gaps those to the surface that has given way.
    """
    pressure = state.contact_force[:, 0] / _positive(model.pad.tributary(position))
    places = model.equilibrium.interface.places(state)
    gap = surface_state(model.surface, places).normal_gap
    at = reach(gap, pressure, model.pad.spacing_at(position), model.shear_modulus)
    if isinstance(model.pad, Pad):
        width, real = model.pad.contact_widths(position, at)
        return real, {"contact_width": width, "real_contact_width": real}
    area, real = model.pad.areas(position, at)
    return real, {
        **dict.fromkeys(WIDTHS, float("nan")),
        "position_z": float(state.bone[2]),
        "applied_tangential_force_x": float(state.reaction[0]),
        "applied_tangential_force_z": float(state.reaction[2]),
        "tangential_force_x": float(0.0 - contact[0]),
        "tangential_force_z": float(0.0 - contact[2]),
        "contact_area": area,
        "real_contact_area": real,
    }


def tractions(interface: Interface, state: State, pressing: Floats, force: Floats) -> Floats:
    """Tractions (P,) in MPa of contact forces (P,) of pad nodes under pressing ones (P,), in N/mm or N: over
    what nodes stand for, above an elastic surface even along the facets of an outline.
    """
    length = _positive(interface.pad.tributary(interface.positions(state.u)))
    slips = state.status >= SLIP
    return np.asarray(interface.foundation.evened(pressing / length, force / length, slips))


def _positive(length: Floats) -> Floats:
    """Tributary lengths or areas (P,), infinite where there is none."""
    return np.where(length > 0, length, np.inf)


def frame_of(model: Model, state: State, row: Row) -> Frame:
    """Fields of a state, as they go to ParaView, made when they are read, unless the memory of the state
    takes more room than they do.
    """
    at = {name: row[name] for name in ("step", "time", "position")}
    kept = replace(state, last_increment=state.u)  # no field depends on it
    # of parts, not of the model or the body, whose factors and pattern would live as long as a result
    parts = model.body.tissue, model.body.whole, model.equilibrium.interface, model.attraction
    make = partial(_fields, *parts, kept)
    memory = sum(np.asarray(one).nbytes for one in state.memory.values())
    return Frame.later(make, **at) if memory <= state.u.nbytes else Frame(**at, **make())


def _fields(
    tissue: Any,
    whole: Callable[[Floats], Floats],
    interface: Interface,
    attraction: PadTraction,
    state: State,
) -> dict[str, Any]:
    """The fields of `Frame` in a state, by name."""
    size, nodes = len(state.u), interface.pad.nodes
    surface, withheld = surface_state(interface.surface, interface.places(state)), interface.withheld(state)
    pressing = state.contact_force[:, 0] + withheld
    pulled = _positive(attraction.weights(interface.pad_state(state, state.touching)))

    def on_pad(values: Any, off: float) -> Any:
        field = np.full(size, off)
        field[nodes] = values
        return field

    stress, J = tissue.cell_stress(state.u)
    status = np.minimum(state.status, FORWARD)
    return {
        "displacement": whole(state.u).copy(),
        "gap": on_pad(surface.gap, np.nan),
        "contact_pressure": on_pad(tractions(interface, state, pressing, pressing), 0.0),
        "shear_traction": on_pad(tractions(interface, state, pressing, _shear(state)), 0.0),
        "electrostatic_traction": on_pad(_electrostatic(interface, attraction, state) / pulled, 0.0),
        "surface_sink": on_pad(interface.foundation.sink(state), 0.0),
        "contact_status": on_pad(status, 0).astype(np.int64),
        "von_mises": _von_mises(stress),
        "cauchy_stress": stress,
        "J": J,
    }


def _electrostatic(interface: Interface, attraction: PadTraction, state: State) -> Floats:
    """Attraction (P,) of the voltage, N/mm or N, with what its regularised law removes; without adhesion."""
    pull = interface.foundation.turned_back(state, state.attraction)
    for other in attraction.parts[1:]:
        pull = pull - state.memory[f"forces.{other.name}"]
    for first in attraction.parts[:1]:
        if first.name == ELECTROSTATIC and first.acts(state.voltage):
            both = attraction.restored(state.voltage)[0]
            fraction = first.restored(state.voltage)[0] / np.where(both > 0.0, both, np.inf)
            return np.asarray(reduce(np.hypot, pull.T) + fraction * interface.withheld(state))
    return np.zeros(len(pull))


def _shear(state: State) -> Floats:
    """Shear forces (P,) along the profile; their magnitude in three dimensions."""
    shear = state.contact_force[:, 1:]
    return shear[:, 0] if shear.shape[1] == 1 else np.hypot(*shear.T)


def _von_mises(stress: Floats) -> Floats:
    """Equivalent stress (E,) of xx, yy, zz, xy[, yz, xz] (E, 4 or 6)."""
    xx, yy, zz, xy = stress.T[:4]
    shear = 3.0 * xy**2
    for out_of_plane in stress.T[4:]:
        shear = shear + 3.0 * out_of_plane**2
    return np.asarray(np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + shear))

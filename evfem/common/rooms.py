r"""Interface of a capability, so that solver, checkpoint, energy balance and history sum over lists.

A *room* holds one capability: its keys, equation, tangent, memory, energies and columns. The solver calls the
rooms of a scene in the order of a step and knows none by name (docs, Inside)::

    memory(state)           once, at rest            internal variables from substep to substep, by name
    restart(old, target)    a step is requested      what changes in memory where prescribed speeds jump
    begin(old, seconds)     a trial begins           any number of times from the same accepted state
    accept(old, new)        a substep is accepted    the room's memory at its end
    stored, kinetic         of an accepted state     energies
    work, dissipation       of an accepted substep   the balance of energy closes with them
    values, works, of_row   of a state, a substep,   the room's `columns` in the history
                            the rest of the row

Units: mm, N, MPa, s, V; in the plane per mm of depth. N nodes, P nodes of the pad, dim = 2 or 3.
A room without memory, energies and columns inherits all of this.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError


@dataclass(frozen=True)
class Column:
    """A column that a room adds to the history: its name, unit (per mm of depth in the plane) and meaning."""

    name: str
    unit: str
    meaning: str


class Room:
    """A capability without memory, energy and columns; subclasses answer what theirs has."""

    #: columns of the history in the order of `values`
    columns: tuple[Column, ...] = ()

    def memory(self, state: Any) -> dict[str, Floats]:
        """Memory of the undeformed `state`, by name; shapes stay the same from then on."""
        return {}

    def begin(self, old: Any, seconds: float) -> None:
        """A trial begins from the accepted state `old` and takes so many seconds, 0 without time."""

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        """The memory at the end of the trial that began last, accepted as `new`."""
        return {}

    def stored(self, state: Any) -> float:
        """Stored energy of an accepted state (N mm)."""
        return 0.0

    def kinetic(self, state: Any) -> float:
        """Kinetic energy of an accepted state (N mm)."""
        return 0.0

    def work(self, old: Any, new: Any) -> float:
        """Work that an actuator of the room does in a substep, beyond that on the bone (N mm)."""
        return 0.0

    def dissipation(self, old: Any, new: Any, seconds: float) -> float:
        """Energy that the room loses in a substep of so many seconds (N mm)."""
        return 0.0

    def potential(self, old: Any, new: Any, fractions: Floats) -> Floats:
        """Potential (w,) in N mm with the loads of the end, at fractions (w,) of the straight path from `old`
        to `new`, relative to that at the first one.
        """
        return np.zeros_like(fractions)

    def takes_time(self, seconds: float) -> bool:
        """Whether rates count in a substep of so many seconds: energy set free then is no snap, as of springs
        that relax without motion.
        """
        return False

    def outdates(self, made_for: float, seconds: float) -> bool:
        """Whether a tangent made for a substep of `made_for` seconds is too old for one of `seconds`."""
        return False

    def restart(self, old: Any, target: Any) -> dict[str, Floats]:
        """The part of its memory that changes where a requested step begins that leads to `target`, whose
        prescribed speeds may jump.
        """
        return {}

    def values(self, model: Any, state: Any) -> Mapping[str, float]:
        """Values in an accepted state of the `columns` that are no sums."""
        return {}

    def of_row(self, row: Mapping[str, Any]) -> Mapping[str, float]:
        """Values of the `columns` that follow from a row of `History` alone, without other rooms' columns."""
        return {}

    def doubts(self, scene: Any, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        """A sentence for each thing that the rows of a scene's run make doubtful."""
        yield from ()

    def works(self, substep: Any) -> Mapping[str, float]:
        """Contributions of a substep to the `columns` that end in _work or _dissipation (N mm)."""
        return {}


class BodyTerm(Room):
    """Forces within the body beside those of the tissue: springs, dampers, masses on its nodes.

    A user-defined term has `forces`, and `stiffness` where they depend on the displacements; `stored` and
    `dissipation` close the energy balance.
    """

    def placed(self, mesh: Any) -> None:
        """The term acts on a finger with this mesh (`points` (N, dim) in mm, `node_sets`, `region`)."""

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, dim) in N/mm at displacements u (N, dim), positive where they resist."""
        return np.zeros_like(u)

    def stiffness(self, u: Floats) -> Floats:
        """Their derivatives, each by its own displacement, (N, dim) in N/mm per mm; not negative."""
        return np.zeros_like(u)

    def potential(self, old: Any, new: Any, fractions: Floats) -> Floats:
        moved = new.u - old.u
        power = np.array([float(np.sum(self.forces(old.u + s * moved) * moved)) for s in fractions])
        return np.append(0.0, np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(fractions)))


class Foundation(Room):
    """An elastic foundation of the pad, which may have memory: for `elastic=` of any surface.

    `compliance` is that of the present step; the fraction `left` of the displacement before the step is added
    to the displacement under the present forces, as of a surface that creeps: a Kelvin-Voigt solid with the
    relaxation time T has the compliance C h/(h + T) in a step of h seconds and leaves T/(h + T).

    The states that `accept` and `dissipation` get have in memory the forces on the pad's nodes,
    `surface_force` (P, dim), and their contribution to the relative positions, `surface_displacement`
    (P, dim).
    """

    def compliance(self, x: Floats, lengths: Floats) -> Floats:
        """Mean displacements by forces on n strips (`evfem.protocols.Elastic`), (dim n, dim n)."""
        raise NotImplementedError

    @property
    def left(self) -> float:
        """Fraction of the displacement before the step that is left without forces, 0 to below 1."""
        return 0.0

    def energy(self, state: Any, force: Floats, displacement: Floats) -> float:
        """Stored energy (N mm) of a displacement (P, dim) under forces on the pad (P, dim)."""
        return 0.5 * float(np.sum(force * displacement))


def unchangeable(room: Any) -> bool:
    """Whether a room is a frozen dataclass with a `begin` of its own, which could keep nothing in it."""
    kind: Any = type(room)
    return bool(is_dataclass(room) and kind.__dataclass_params__.frozen and kind.begin is not Room.begin)


def shaped(room: Any, what: str, found: Any, wanted: Floats) -> Floats:
    """What a room answered, if it has the shape of `wanted`; else InputError, which names the room."""
    if np.shape(found) == wanted.shape:
        return np.asarray(found)
    given = f"{type(found).__name__} of shape {np.shape(found)}" if found is not None else "None"
    raise InputError(f"{type(room).__name__}.{what}", given, f"an array of shape {wanted.shape}")


def begun(room: Any, memory: Mapping[str, Any], kept: Mapping[str, Any]) -> Mapping[str, Any]:
    """What a room keeps at rest beside this `memory`, if the names are its own."""
    for name in kept:
        if name in memory:
            given = f"{name}, which another room keeps"
            raise InputError(f"{type(room).__name__}.memory", given, "a name of its own for all it keeps")
    return kept


def ended(room: Any, memory: Mapping[str, Any], kept: Mapping[str, Any]) -> Mapping[str, Any]:
    """What a room keeps at the end of a substep, if it kept the same, in the same shapes, before."""
    for name, value in kept.items():
        if name not in memory:
            raise InputError(f"{type(room).__name__}.accept", name, "names that its `memory` has at rest")
        if np.shape(value) != np.shape(memory[name]):
            given = f"{name} of shape {np.shape(value)}"
            raise InputError(f"{type(room).__name__}.accept", given, f"{np.shape(memory[name])} as at rest")
    return kept

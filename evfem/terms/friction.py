r"""Friction bounds: Coulomb's, and those of general friction laws.

Under Coulomb's law the bound of a node is :math:`\mu(x)\,\lambda_n`, which the contact problem solves
exactly. Another law (`evfem.surface.friction`) is linearised at each iterate, and has the contact time of
each node, `contact_time` (P,) in s, as memory. With interface compliance C and slip stiffness dF/ds = K of
the bound F(s), a node that moves by dx slips by ds = dx - C dF, and friction grows by K dx / (1 + K C): the
tangential compliance is scaled by 1 + K C (springs in series). A law that follows another over the slip
(`SlipMemory`) has the bound of each node, `friction_bound` (P,) in MPa, as a further memory; its slip counts
without time too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.rooms import Column, Room
from evfem.contact.condensed import Candidates
from evfem.contact.signorini import FORWARD, OPEN, STICK, sizes
from evfem.protocols import FrictionLaw
from evfem.surface.friction import Renewing, SlipMemory, Slipping
from evfem.tensor import derivative
from evfem.terms.slipping import OscillatingNodes

#: an accepted state, or an iterate (`evfem.newton.state.State`)
State = Any

#: steps of differences of a bound by contact forces (N/mm) and tributary lengths (mm)
FORCE_STEP, LENGTH_STEP = 1e-7, 1e-6
#: normal force (N/mm, N) below which there is no coefficient of friction: solved forces are known to it
LEAST = 1e-9


def coefficient(tangential: Any, normal: Any) -> Any:
    """Tangential over normal force, each a number or an array; NaN where nothing presses.

    >>> coefficient(np.array([0.5, 0.0, -1.0]), np.array([2.0, 0.0, -1.0])).tolist()
    [0.25, nan, nan]
    """
    presses = np.asarray(normal) > LEAST
    return np.where(presses, tangential / np.where(presses, normal, 1.0), np.nan)[()]


#: column -> the columns of which it is the quotient
COEFFICIENTS = {
    "friction": ("tangential_force", "normal_force"),
    "apparent_friction": ("applied_tangential_force", "applied_force"),
}


class OverallFriction(Room):
    """Columns of the friction coefficient of the whole contact, and of the fractions of its length or area
    that stick and slip (by tributary lengths or areas of nodes), NaN where nothing touches.
    """

    columns = (
        Column("friction", "", "tangential_force over normal_force; nan where nothing presses"),
        Column("stick_share", "", "fraction of the real contact that sticks"),
        Column("slip_share", "", "fraction of the real contact that slips"),
    )

    def values(self, model: Any, state: Any) -> Mapping[str, float]:
        length = model.pad.tributary(model.equilibrium.interface.positions(state.u))
        touches = float(length[state.status != OPEN].sum())
        parts = (state.status == STICK, state.status >= FORWARD)
        sticks, slips = (float(length[part].sum()) / touches if touches else np.nan for part in parts)
        return {"stick_share": sticks, "slip_share": slips}

    def of_row(self, row: Mapping[str, Any]) -> Mapping[str, float]:
        return {"friction": of_forces("friction", row)}


class ApparentFriction(Room):
    """Column of the friction relative to the load alone, where an attraction presses beside it."""

    columns = (
        Column("apparent_friction", "", "applied_tangential_force over applied_force; nan without a load"),
    )

    def of_row(self, row: Mapping[str, Any]) -> Mapping[str, float]:
        return {"apparent_friction": of_forces("apparent_friction", row)}


def of_forces(name: str, row: Any) -> Any:
    """One of `COEFFICIENTS`, of a row or of a whole history."""
    tangential, normal = COEFFICIENTS[name]
    return coefficient(row[tangential], row[normal])


@dataclass(frozen=True)
class BoundSlopes:
    """Bounds of friction of k nodes, their derivatives (k,) by contact force, coefficient, speed, length."""

    bound: Floats
    by_normal: Floats
    by_mu: Floats
    by_speed: Floats
    by_length: Floats | float


class ProportionalFriction(Room):
    """Coulomb's bound: mu times the contact force."""

    #: whether the bound may have a kink over the pressure
    nonsmooth = False

    def linearised(self, interface: Any, known: Candidates, old: State, state: State, c: Ints) -> Candidates:
        """The candidates c (C,) with the bound linearised at an iterate. With interface compliance C and slip
        stiffness K the tangential compliance is scaled by 1 + K C (springs in series).
        """
        return known

    def bound(self, interface: Any, old: State, state: State, nodes: Ints, mu: Floats, slip: Any) -> Floats:
        """Bounds (k,) in N/mm of some nodes (k,) with the coefficients mu (k,), slipping by (k,) mm."""
        return np.asarray(mu * state.contact_force[nodes, 0])

    def resistance(
        self, interface: Any, ends: tuple[State, State], position: Floats, normal: Floats, slip: Floats
    ) -> Floats:
        """Bounds (P,) of all nodes at (P, d) between two states, pressed by (P,) and slipping by (P,)."""
        mu = interface.friction(ends[0], np.arange(len(position)), position)
        return np.asarray(mu * normal)

    def slopes(
        self, interface: Any, old: State, state: State, c: Ints, mu: Floats, slip: Floats
    ) -> BoundSlopes:
        """The bounds of nodes c (k,) with their derivatives."""
        normal = np.maximum(state.contact_force[c, 0], 0.0)
        return BoundSlopes(mu * normal, mu, normal, 0.0 * mu, 0.0 * mu)


class LawFriction(ProportionalFriction):
    """The bound of a friction `law`; its pressure includes that which a regularised attraction removes."""

    nonsmooth = True

    def __init__(self, law: FrictionLaw, nodes: int) -> None:
        self.law, self.nodes = law, nodes
        self._oscillating, self._seconds = OscillatingNodes(nodes), 0.0

    def memory(self, state: Any) -> dict[str, Floats]:
        return {"contact_time": np.zeros(self.nodes)}

    def begin(self, old: Any, seconds: float) -> None:
        self._oscillating, self._seconds = OscillatingNodes(self.nodes), seconds

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        return {"contact_time": self.contact_time(old)}

    @property
    def _unit(self) -> float:
        """Seconds by which slips are divided, 0 where they do not count."""
        return self._seconds

    def contact_time(self, old: State) -> Floats:
        """Contact time (P,) in s of every pad node at the end of the step from `old`."""
        return np.where(old.touching, old.memory["contact_time"] + self._seconds, 0.0)

    def slipping(
        self, interface: Any, old: State, state: State, nodes: Ints, mu: Floats, slip: Floats
    ) -> Slipping:
        """Data of the law at these pad nodes (k,), with coefficients (k,) and slips (k,)."""
        speed = np.abs(slip) / self._unit if self._unit > 0.0 else np.zeros_like(slip)
        withheld, left = (each[nodes] for each in interface.core(state))
        length, age = interface.tributary(state)[nodes], self.contact_time(old)[nodes]
        return Slipping(state.contact_force[nodes, 0], length, mu, speed, age, withheld, left)

    def linearised(self, interface: Any, known: Candidates, old: State, state: State, c: Ints) -> Candidates:
        give, shear = known.interface_compliance[:, 1], sizes(known.force[:, 1:])
        size = sizes(known.slip + give[:, None] * known.force[:, 1:])
        slip = np.where(known.status >= FORWARD, size, 0.0)
        moving = self.slipping(interface, old, state, c, known.friction, slip)
        wedges = self._oscillating.wedges(self.law, moving, c, known.status)
        known = replace(known, status=np.where(wedges, OPEN, known.status))
        found = self._oscillating.linearised(self.law, moving, c, known.status, shear)
        if (
            interface.follows
        ):  # a slip that speeds up may turn: what falls with the speed goes by the iterate's
            found = replace(found, by_speed=np.maximum(found.by_speed, 0.0))
        by_speed = np.where(known.status == OPEN, 0.0, found.by_speed)
        timed = self._unit > 0.0
        by_slip = by_speed / self._unit if timed else np.zeros_like(slip)
        yielding = np.maximum(by_slip, 0.0) * give
        series = 1.0 / (1.0 + yielding)
        normal = np.maximum(known.force[:, 0], 0.0)
        by_position = np.where(normal > 0.0, found.by_mu / np.where(normal > 0.0, normal, 1.0), 0.0)
        along_normal, along_tangents = np.split(known.interface_compliance, [1], axis=1)
        return replace(
            known,
            slip=known.slip / series[:, None],
            interface_compliance=np.hstack([along_normal, along_tangents / series[:, None]]),
            friction=series * found.slope,
            cohesion=series * (found.offset + yielding * shear),
            slip_stiffness=series * by_slip if timed else None,
            friction_slope=(series * by_position)[:, None] * known.friction_slope,
        )

    def bound(self, interface: Any, old: State, state: State, nodes: Ints, mu: Floats, slip: Any) -> Floats:
        return self.slipping(interface, old, state, nodes, mu, slip).bound(self.law)

    def resistance(
        self, interface: Any, ends: tuple[State, State], position: Floats, normal: Floats, slip: Floats
    ) -> Floats:
        old, new = ends
        mu = interface.friction(old, nodes := np.arange(len(position)), position)
        nodal = self.slipping(interface, old, new, nodes, mu, slip)
        length = interface.tributary_at(ends, position)
        return replace(nodal, normal=normal, length=length).resistance(self.law)

    def slopes(
        self, interface: Any, old: State, state: State, c: Ints, mu: Floats, slip: Floats
    ) -> BoundSlopes:
        normal = np.maximum(state.contact_force[c, 0], 0.0)
        nodal = self.slipping(interface, old, state, c, mu, slip)
        found, law = nodal.linearised(self.law), self.law
        by_normal = derivative(lambda N: replace(nodal, normal=N).bound(law), normal, FORCE_STEP)
        by_length = derivative(lambda A: replace(nodal, length=A).bound(law), nodal.length, LENGTH_STEP)
        return BoundSlopes(nodal.bound(law), by_normal, found.by_mu, found.by_speed, by_length)


class RenewedFriction(LawFriction):
    """The bound of a `SlipMemory` on the pad of an `interface`."""

    def __init__(self, law: SlipMemory, interface: Any) -> None:
        super().__init__(law, interface.pad.nodes.size)
        self.interface = interface

    @property
    def _unit(self) -> float:
        return self._seconds or 1.0

    def memory(self, state: Any) -> dict[str, Floats]:
        return super().memory(state) | {"friction_bound": np.zeros(self.nodes)}

    def slipping(
        self, interface: Any, old: State, state: State, nodes: Ints, mu: Floats, slip: Floats
    ) -> Renewing:
        plain = super().slipping(interface, old, state, nodes, mu, slip)
        before = old.memory["friction_bound"][nodes]
        return Renewing(**vars(plain), before=before, seconds=self._seconds)

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        nodes, position = np.arange(self.nodes), self.interface.jumps.at(self.interface.on_display(new))
        mu = self.interface.friction(old, nodes, position)
        nodal = self.slipping(self.interface, old, new, nodes, mu, self._slipped(old, new))
        bound = np.where(new.touching, nodal.renewed(self.law), 0.0)
        return super().accept(old, new) | {"friction_bound": bound}

    def _slipped(self, old: State, new: State) -> Floats:
        """Slips (P,) in mm, from its pin of a node that is pinned to a jump of friction."""
        give = self.interface.compliance(old)[:, 1:]
        slip = self.interface.slip(old, new) + give * (new.contact_force - old.contact_force)[:, 1:]
        return np.where(new.status >= FORWARD, sizes(slip), 0.0)


def bounds_of(law: FrictionLaw, interface: Any) -> LawFriction:
    """The bounds of a law of friction on the pad of an interface. A length of slip that is shorter than slips
    are known to is none: the law is its equilibrium.
    """
    if isinstance(law, SlipMemory) and law.length > interface.tolerance * interface.length:
        return RenewedFriction(law, interface)
    return LawFriction(law, interface.pad.nodes.size)

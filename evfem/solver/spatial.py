r"""Where skin and surface meet in three dimensions: what differs from the plane
(`evfem.solver.interface`).

A touching node has two slips since the last accepted state, along the profile and along z,
:math:`s = (r\,\Delta x, \Delta z)` with the stretch r of the profile. A slipping node's shear force
is against its slip. Coefficients of friction may change over x, but not jump.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import SHORTEST_LENGTH, SMALLEST_FORCE
from evfem.contact.coulomb import SLIP
from evfem.contact.signorini import STICK
from evfem.contact.spatial import SpatialCandidates, SpatialContactStep
from evfem.protocols import FrictionLaw
from evfem.solver.interface import Interface, Pins, nothing_restored
from evfem.solver.state import State
from evfem.surface.pad import surface_state
from evfem.surface.skin import Skin


class SkinInterface(Interface):
    """The skin of a body and the surface below it; `points` (N, 3) of the undeformed mesh."""

    contact_step = SpatialContactStep
    follows = True  # a dense compliance of three unknowns each: only what is needed, and spare

    def __init__(self, pad: Skin, points: Floats, surface: Any, tolerance: float) -> None:
        self.pad, self.surface, self.tolerance = pad, surface, tolerance
        self.points = points[pad.nodes]
        self.length = pad.spacing(self.points)
        self._facing = pad.facing(self.points)
        self.pins = Pins(np.zeros((0, 3)), pad.nodes.size)
        self.law: FrictionLaw | None = None
        self.restored = nothing_restored
        self.duration = 0.0
        self.neighbourhood = 0.0

    def contact_forces(self, state: State) -> Floats:
        """Contact forces on the pad nodes in the laboratory frame (P, 3)."""
        surface = self.surface_at(state)
        normal, along, z = state.contact_force.T
        slope, stretch = surface.slope, surface.stretch
        x, y = (along - slope * normal) / stretch, (normal + slope * along) / stretch
        return np.stack([x, y, z], axis=1)

    def candidates(
        self, old: State, state: State, c: Ints, negative_stiffness: Floats, gain_on_closing: Floats
    ) -> SpatialCandidates:
        """What the contact problem has to know of the candidates c (numbers of pad nodes)."""
        position = self.positions(state.u)[c]
        friction = self.friction(old, c, position[:, 0])
        known = SpatialCandidates(
            surface=surface_state(self.surface, position),
            slip=self.slip(old, state)[c],
            force=state.contact_force[c],
            status=state.status[c],
            friction=friction,
            friction_slope=np.broadcast_to(self.surface.friction_slope(position[:, 0]), friction.shape),
            interface_compliance=np.zeros((c.size, 3)),
            negative_stiffness=negative_stiffness[c],
            gain_on_closing=gain_on_closing[c],
        )
        return known if self.law is None else self._under(self.law, known, old, state, c)

    def _under(
        self, law: FrictionLaw, known: SpatialCandidates, old: State, state: State, c: Ints
    ) -> SpatialCandidates:
        """The candidates c under a law of friction other than Coulomb's: linear in the contact force,
        by the speed of the iterate.
        """
        seen = self._slipping(old, state, c, known.friction, self._ways(known.slip, known.status))
        found = seen.linearised(law)
        normal = np.maximum(known.force[:, 0], 0.0)
        by_place = np.where(normal > 0.0, found.by_mu / np.where(normal > 0.0, normal, 1.0), 0.0)
        slope = known.friction_slope * by_place
        return replace(known, friction=found.slope, cohesion=found.offset, friction_slope=slope)

    @staticmethod
    def _ways(slip: Floats, status: Ints) -> Floats:
        """How far nodes (k,) slip in a step, of slips (k, 2)."""
        return np.where(status == SLIP, np.hypot(*slip.T), 0.0)

    def shares(self, state: State) -> Floats:
        """Tributary areas of the pad nodes (P,), nowhere quite nothing, in mm2."""
        return np.maximum(self.pad.tributary(self.positions(state.u)), (SHORTEST_LENGTH * self.length) ** 2)

    def shares_at(self, part: tuple[State, State], x: Floats) -> Floats:
        """Their mean over a part of a run."""
        old, new = part
        return 0.5 * (self.shares(old) + self.shares(new))

    def slip(self, old: State, state: State) -> Floats:
        """Slips of the pad nodes along the profile and along z (P, 2) in mm since the last accepted
        state.
        """
        position = self.positions(state.u)
        moved = (position - self.positions(old.u))[:, ::2]
        moved[:, 0] *= surface_state(self.surface, position).stretch
        return moved

    def fold(self, state: State) -> float | None:
        """x (mm) of a face that touches and has turned up although it faced down; None without."""
        position = self.positions(state.u)
        pressed = state.touching[self.pad.faces].all(axis=1)
        turned = np.flatnonzero(self._facing & pressed & ~self.pad.facing(position))
        return float(position[self.pad.faces[turned[0]], 0].mean()) if turned.size else None

    def obeyed(self, old: State, state: State) -> bool:
        """Whether closed gaps, stick, slip and the friction cone hold at the present positions."""
        position, active = self.positions(state.u), state.touching
        short = self.tolerance * self.length
        weak = self.tolerance * max(np.abs(state.contact_force).max(), SMALLEST_FORCE)
        normal, shear = state.contact_force[active, 0], state.contact_force[active, 1:]
        slip, status = self.slip(old, state)[active], state.status[active]
        nodes = np.flatnonzero(active)
        limit = (mu := self.friction(old, nodes, position[active, 0])) * normal
        if self.law is not None:
            limit = self._slipping(old, state, nodes, mu, self._ways(slip, status)).bound(self.law)
        way, size = np.hypot(*slip.T), np.hypot(*shear.T)
        sticks = (way <= short) & (size <= limit + weak)
        # a slip is known to `short`, and its direction accordingly
        against = shear + (limit / np.maximum(way, 1e-300))[:, None] * slip
        astray = np.where(way > short, np.hypot(*against.T) - limit * short / np.maximum(way, short), 0.0)
        slips = (limit == 0.0) | ((np.abs(size - limit) <= weak) & (astray <= weak))
        gap = surface_state(self.surface, position).normal_gap[active]
        closed = (np.abs(gap) <= short) & (normal >= -weak)
        return bool((closed & np.where(status == STICK, sticks, slips)).all())


def slipped(interface: SkinInterface, old: State, new: State) -> Floats:
    """Slips (P, 2) in mm of nodes that slip at the end, or did so before they left."""
    status = np.where(new.touching | (old.status == STICK), new.status, old.status)
    return np.where((status == SLIP)[:, None], interface.slip(old, new), 0.0)

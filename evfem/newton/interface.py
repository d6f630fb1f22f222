r"""Contact kinematics and conditions: gaps, slips and friction bounds of the pad nodes relative to the
surface; the nodal data of the linear contact problem; the test that a converged state satisfies Signorini
and Coulomb.

Signs: gap > 0 open, :math:`\lambda_n > 0` compression, shear opposes slip. Contact forces of a state are
along the surface's normal and tangents at the node's position (`evfem.surface.pad.SurfaceState`). Slip is
counted along the tangents, in the plane :math:`r\,\Delta x` with the profile's stretch r, from the last
accepted position, or from the discontinuity of friction at which the node is pinned (`FrictionJumps`). With
penalties the interface has a compliance, g + lam_n / (p_n A) = 0 and s + (lam_t - lam_t0) / (p_t A) = 0
instead of g = 0 and s = 0. They enter through `faces`, general friction laws through `bounds`
(`evfem.terms.friction`), what is below the faces through `foundation` (`evfem.terms.foundation`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from evfem.common import constants
from evfem.common.arrays import Floats, Ints
from evfem.common.rooms import Room
from evfem.contact.condensed import Candidates
from evfem.contact.signorini import FORWARD, OPEN, STICK, side, sizes
from evfem.newton.state import State
from evfem.surface.friction import with_core
from evfem.surface.pad import Pad, SurfaceState, surface_state
from evfem.surface.skin import Skin
from evfem.surface.ways import Steps
from evfem.terms.foundation import Exact, Rigid, in_laboratory
from evfem.terms.friction import ProportionalFriction
from evfem.terms.traction import PadState


class FrictionJumps:
    """Discontinuities of the friction coefficient, along x and in space along z, and the nodes pinned to them
    in a step that begins at the positions `begin` (P, d); `place`: positions of the pins (P, d), nan of nodes
    without.

    A node slides up to a jump to higher friction and stays there while its shear force grows from the lower
    to the higher limit; iterates alternate between its two sides. Such a node is pinned where its path
    crosses the discontinuity, `PIN_OFFSET` inside the rougher side, where it sticks with the higher
    coefficient, and is unpinned below the lower limit. A node that began the step on the rougher side is not
    pinned.
    """

    def __init__(self, steps: Sequence[Steps], begin: Floats) -> None:
        self.steps = steps
        self.begin(begin)

    def begin(self, position: Floats) -> None:
        """Starts a step with the nodes at these positions (P, d) in mm, none pinned."""
        self.place, self.lower = np.full(position.shape, np.nan), np.zeros(len(position))
        self._begin = position
        self._side = [self._sides(steps, position) for steps in self.steps]
        self._changes = np.zeros((len(self.steps), len(position)), dtype=np.int64)
        self._released = np.zeros(len(position), dtype=bool)

    @staticmethod
    def _sides(steps: Steps, position: Floats) -> Ints:
        """Number of discontinuities (P,) at smaller coordinates than a node, along the axis of `steps`."""
        return np.asarray(np.searchsorted(steps.place, position[:, steps.axis], side="right"))

    @property
    def held(self) -> Any:
        """Nodes pinned to a discontinuity, (P,) bool."""
        return np.isfinite(self.place[:, 0])

    def at(self, position: Floats) -> Floats:
        """Positions for friction (P, d): pinned nodes at their pin, others at `position`."""
        return np.where(np.isfinite(self.place), self.place, position)

    def watch(self, position: Floats, touching: Any) -> None:
        """Counts changes of side at the next iterate; pins a node after `CHANGES` of them."""
        for number, steps in enumerate(self.steps):
            side = self._sides(steps, position)
            moved = touching & (side != self._side[number]) & ~self._released
            self._changes[number] += moved
            new = np.flatnonzero(moved & (self._changes[number] >= constants.CHANGES) & ~self.held)
            self._pin(steps, new, np.maximum(side, self._side[number])[new] - 1, position)
            self._side[number] = side

    def _pin(self, steps: Steps, new: Ints, which: Ints, position: Floats) -> None:
        """Pins nodes `new` (k,) that reach the discontinuities `which` (k,) from their smoother side."""
        begin, axis = self._begin[new], steps.axis
        moved = position[new] - begin
        whole = np.where(moved[:, axis] == 0.0, 1.0, moved[:, axis])
        crossed = begin + moved * ((steps.place[which] - begin[:, axis]) / whole)[:, None]
        across = crossed[:, 1 - axis] if crossed.shape[1] > 1 else np.zeros(new.size)
        before, behind = steps.sides(which, across)
        inside = np.where(behind > before, constants.PIN_OFFSET, -constants.PIN_OFFSET)
        crossed[:, axis] = steps.place[which] + inside
        from_smoother = (steps.place[which] - begin[:, axis]) * inside > 0.0
        new = new[from_smoother]
        self.place[new] = crossed[from_smoother]
        self.lower[new] = np.minimum(before, behind)[from_smoother]

    def release(self, limit: Floats, shear: Floats, tolerance: float) -> bool:
        """Unpins nodes whose shear force is below the lower `limit` (P,); returns whether there were any."""
        return self.unpin(self.held & (np.abs(shear) < limit - tolerance))

    def unpin(self, loose: Any) -> bool:
        """Unpins these nodes (P,) bool for the rest of the step; returns whether there were any."""
        self.place[loose] = np.nan
        self._released |= loose
        return bool(loose.any())


class Interface:
    """Contact of the pad of a body with the surface; `points` (N, dim) of the undeformed mesh; `restored`:
    the traction that a regularised law removes and keeps at a voltage (V), `PadTraction.restored`.

    Nodes with a gap below `neighbourhood` (mm) become candidates together. In three dimensions, where the
    dense compliance is large, the candidates follow the contact: nodes far from it are dropped.
    """

    _pad_state: tuple[tuple[Any, ...], Any] = ((None,) * 4, None)
    _surfaces: tuple[tuple[Floats, Any, SurfaceState], ...] = ()

    def __init__(self, pad: Pad | Skin, points: Floats, surface: Any, tolerance: float) -> None:
        none = np.zeros(pad.nodes.size)
        self.restored: Callable[[float], tuple[Floats, Floats]] = lambda voltage: (none, none)
        self.pad, self.surface, self.tolerance = pad, surface, tolerance
        self.points = points[pad.nodes]
        self.dim = points.shape[1]
        self.follows = self.dim == 3
        self.length = pad.spacing(self.points)
        self._down = pad.facing(self.points)
        self.jumps = FrictionJumps(
            surface.friction_steps(constants.SHORT_RAMP * self.length), self.points[:, ::2]
        )
        self.least = (constants.SHORTEST_LENGTH * self.length) ** (self.dim - 1)
        self.bounds, self.faces = ProportionalFriction(), Exact()
        self.foundation: Any = Rigid()
        self.duration = 0.0
        self.neighbourhood = constants.NEIGHBOURS * self.length

    def begin(self, old: State, duration: float) -> None:
        """A step of so many seconds starts from `old`."""
        self.jumps.begin(self.on_display(old))
        self.duration = duration

    @property
    def rooms(self) -> tuple[Room, ...]:
        """Bounds of friction, the faces in contact, and the foundation below them."""
        return self.bounds, self.faces, self.foundation

    def positions(self, u: Floats) -> Floats:
        """Current positions of the pad nodes (P, dim) for displacements u (N, dim)."""
        return self.points + u[self.pad.nodes]

    def places(self, state: State) -> Floats:
        """Relative positions r of the pad nodes (P, dim), as above a rigid surface."""
        return self.foundation.places(self.positions(state.u), state)

    def on_display(self, state: State) -> Floats:
        """x of `places` (P, 1), in space x and z (P, 2)."""
        return self.places(state)[:, ::2]

    def surface_at(self, state: State) -> SurfaceState:
        """The surface below the pad nodes, cached for the last two states."""
        displacement = self.foundation.displacement(state)
        for u, before, found in self._surfaces:
            if u is state.u and before is displacement:
                return found
        found = self.foundation.sloped(surface_state(self.surface, self.places(state)), state)
        self._surfaces = ((state.u, displacement, found), *self._surfaces[:1])
        return found

    def resting(self, state: State) -> Floats:
        """Current positions of the pad nodes (P, dim), the touching ones exactly on the surface."""
        position = self.places(state)
        touching = state.status != OPEN
        position[touching, 1] -= self.surface_at(state).gap[touching]
        return position

    def pad_state(self, state: Any, touching: Any) -> PadState:
        """The pad in a state as tractions see it, in a step that began with these nodes `touching` (P,); the
        last one is kept, as several ask for it.
        """
        made_of = state.u, state.status, state.contact_force, state.memory
        last, found = self._pad_state
        same = all(one is other for one, other in zip(made_of, last, strict=True))
        if same and found.voltage == state.voltage and np.array_equal(found.touching, touching):
            return found
        position, pressing = self.resting(state), state.contact_force[:, 0]
        memory, below = state.memory, self.surface_at(state)
        found = PadState(self.pad, self.surface, position, state.voltage, pressing, touching, memory, below)
        self._pad_state = made_of, found
        return found

    def contact_forces(self, state: State) -> Floats:
        """Contact forces on the pad nodes in the laboratory frame (P, dim)."""
        return in_laboratory(state.contact_force, self.surface_at(state))

    def slip(self, old: State, state: State) -> Floats:
        """Slips of the pad nodes (P, dim - 1) in mm, along the surface's tangents."""
        moved = self.on_display(state) - self.jumps.at(self.on_display(old))
        return np.asarray(np.einsum("paj,pj->pa", self.surface_at(state).travel, moved))

    def candidates(
        self, old: State, state: State, c: Ints, negative_stiffness: Floats, gain_on_closing: Floats
    ) -> Candidates:
        """Data of the contact problem at candidates c, from the attraction's changes of all pad nodes."""
        position, surface = self.on_display(state), self.surface_at(state)[c]
        compliance = self.compliance(old)[c]
        slip = self.slip(old, state)[c] - compliance[:, 1:] * old.contact_force[c, 1:]
        friction = self.friction(old, c, self.jumps.at(position)[c])
        known = Candidates(
            surface=surface,
            slip=slip,
            force=state.contact_force[c],
            status=state.status[c],
            friction=friction,
            friction_slope=self.surface.friction_gradient(position[c]),
            interface_compliance=compliance,
            negative_stiffness=negative_stiffness[c],
            gain_on_closing=gain_on_closing[c],
        )
        return self.bounds.linearised(self, known, old, state, c)

    def withheld(self, state: State) -> Floats:
        """Attraction, and as much of the pressing force, that a regularised law removes at closed nodes (P,),
        N/mm.
        """
        length = self.tributary(state)
        pressure = np.maximum(state.contact_force[:, 0], 0.0) / length
        return np.where(state.touching, with_core(pressure, *self.core(state)) * length, 0.0)

    def core(self, state: State) -> tuple[Floats, Floats]:
        """Traction of closed nodes (P,) in MPa that a regularised law removes, and keeps (above 0)."""
        withheld, left = self.restored(state.voltage)
        return withheld, np.where(withheld > 0.0, left, 1.0)

    def tributary_of(self, position: Floats) -> Floats:
        """Tributary lengths (P,) in mm, in space areas in mm2, of nodes at positions (P, dim); above 0."""
        return np.maximum(self.pad.tributary(position), self.least)

    def tributary(self, state: State) -> Floats:
        """Tributary lengths or areas (P,) in a state."""
        return self.tributary_of(self.places(state))

    def tributary_at(self, ends: tuple[State, State], position: Floats) -> Floats:
        """Tributary lengths or areas (P,) at positions (P, d) in a substep."""
        begin, end = map(self.places, ends)
        return np.maximum(self.pad.tributary_between(begin, end, position), self.least)

    def resistance(self, ends: tuple[State, State], position: Floats, normal: Floats, slip: Floats) -> Floats:
        """Friction bounds (P,) at positions (P, d), with pressing forces and slips (P,), within a substep."""
        return self.bounds.resistance(self, ends, position, normal, slip)

    def limit(self, old: State, state: State, position: Floats, slip: Floats) -> Floats:
        """Bounds of friction (P,) in N/mm of the pad nodes at positions (P, d), slipping by (P,)."""
        mu = self.friction(old, nodes := np.arange(len(position)), position)
        return self._bound(old, state, nodes, mu, slip)

    def _bound(self, old: State, state: State, nodes: Ints, mu: Floats, slip: Any) -> Floats:
        """The same of some nodes (k,) with the coefficients mu (k,), slipping by (k,)."""
        return self.bounds.bound(self, old, state, nodes, mu, slip)

    def unused_friction(self, old: State, state: State, direction: Floats) -> float:
        """Friction force (N/mm) along a unit vector (d,) by which sticking nodes are below their bounds."""
        position, sticks = self.jumps.at(self.on_display(state)), state.status == STICK
        bound = self.limit(old, state, position, np.zeros(len(position)))
        return float((bound + state.contact_force[:, 1:] @ direction)[sticks].sum())

    def compliance(self, old: State) -> Floats:
        """Compliance of the faces (P, dim), normal and tangent, in mm per N/mm."""
        return self.faces.compliance(old)

    def friction(self, old: State, nodes: Ints, position: Floats) -> Floats:
        """Friction coefficient of these pad nodes (k,) at the positions (k, d) in mm after the state `old`,
        used by the contact problem and by acceptance.
        """
        return np.broadcast_to(np.asarray(self.surface.friction_at(position), dtype=float), len(position))

    def fold(self, state: State) -> float | None:
        """x (mm) where the pad has folded, or None."""
        return self.pad.fold(self.positions(state.u), state.touching, self._down)

    def shallowest_penetration(self, state: State) -> float | None:
        """Gap (mm) of the open node that penetrates least, or None if none penetrates."""
        gap = self.surface_at(state).gap
        penetrating = self.pad.free & (state.status == OPEN) & (gap < -self.tolerance * self.length)
        return float(gap[penetrating].max()) if penetrating.any() else None

    def _left_discontinuity(self, old: State, state: State, position: Floats) -> Any:
        """Pinned nodes (P,) that left their discontinuity: they slip where the coefficient is another one, or
        yield in the interface under more than its bound.
        """
        nodes = np.arange(len(position))
        pinned = self.friction(old, nodes, self.jumps.at(position))
        here, slips = self.friction(old, nodes, position), state.status >= FORWARD
        yielded = sizes(position - self.jumps.at(position)) > self.tolerance * self.length
        resting = self._bound(old, state, nodes, here, np.zeros(nodes.size))
        beyond = sizes(state.contact_force[:, 1:]) > resting + self._force_tolerance(state)
        return self.jumps.held & (pinned != here) & (slips | (yielded & beyond))

    def _force_tolerance(self, state: State) -> float:
        """Tolerance (N/mm) of the conditions of contact and friction."""
        return self.tolerance * max(float(np.abs(state.contact_force).max()), constants.SMALLEST_FORCE)

    def obeyed(self, old: State, state: State) -> bool:
        """Whether Signorini and Coulomb hold at the present positions: closed gaps, stick, slip directions
        and friction cones. Unpins nodes that left their discontinuity of friction.
        """
        position, surface = self.on_display(state), self.surface_at(state)
        short, tolerance = self.tolerance * self.length, self._force_tolerance(state)
        active = state.status != OPEN
        every, resting = np.arange(len(position)), np.zeros(len(position))
        lower = self._bound(old, state, every, self.jumps.lower, resting)
        if self.jumps.release(lower, sizes(state.contact_force[:, 1:]), tolerance):
            return False
        if self.jumps.unpin(self._left_discontinuity(old, state, position)):
            return False
        normal, shear = state.contact_force[active, 0], state.contact_force[active, 1:]
        compliance = self.compliance(old)[active]
        slip = self.slip(old, state)[active] + compliance[:, 1:] * (shear - old.contact_force[active, 1:])
        status, nodes = state.status[active], np.flatnonzero(active)
        slid, size = sizes(slip), sizes(shear)
        mu = self.friction(old, nodes, self.jumps.at(position)[active])
        limit = self._bound(old, state, nodes, mu, np.where(status == STICK, 0.0, slid))
        sticks = (slid <= short) & (size <= limit + tolerance)
        # a slip is known to `short`, and its direction accordingly
        against = sizes(shear + (limit / np.maximum(slid, 1e-300))[:, None] * slip)
        astray = np.where(slid > short, against - limit * short / np.maximum(slid, short), 0.0)
        slips = (limit == 0.0) | ((np.abs(size - limit) <= tolerance) & (astray <= tolerance))
        gap = surface.normal_gap[active] + compliance[:, 0] * normal
        closed = (np.abs(gap) <= short) & (normal >= -tolerance)
        return bool((closed & np.where(status == STICK, sticks, slips)).all())


def slipped(interface: Interface, old: State, new: State) -> Floats:
    """Slips (P, d) in mm, along the mean of the surface's tangents, of nodes that slip at the end, or did so
    before they opened.
    """
    moved = interface.on_display(new) - interface.on_display(old)
    travel = 0.5 * (interface.surface_at(old).travel + interface.surface_at(new).travel)
    yielded = interface.compliance(old)[:, 1:] * (new.contact_force - old.contact_force)[:, 1:]
    slip = np.einsum("paj,pj->pa", travel, moved) + yielded
    status = np.where(new.touching | (old.status == STICK), new.status, old.status)
    # a node may stick at a jump of friction that it has slipped up to
    carried = (status == STICK) & (sizes(slip) > interface.tolerance * interface.length)
    astray = (slip.shape[1] == 1) & (side(status) * slip > 0.0).any(axis=1)  # in the plane slips have a side
    return np.where((((status >= FORWARD) & ~astray) | carried)[:, None], slip, 0.0)

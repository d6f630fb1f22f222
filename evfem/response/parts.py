r"""The equations of an accepted part of a run, its nodes' statuses fixed, and their matrix.

With w = (u, bone, :math:`\lambda`) at the end of a part, the state z before it and the parameters p, a part
obeys R(w; z, p) = 0: the balance of the free unknowns; for every axis of the bone its place or the force on
it; and per pad node

=====  ========================================================
open   :math:`\lambda = 0`
stick  :math:`g = 0`, slip since z :math:`= 0`
slip   :math:`g = 0`, :math:`\lambda_t + b(\lambda_n, x, s)\,s/|s| = 0`
=====  ========================================================

with the bound b of friction, :math:`\mu(x)\lambda_n` under Coulomb's law. `Equations.residual` is evaluated by
the same code as the run's own balance, laws and works.

`matrix` is :math:`\partial R/\partial w` with the tissue's tangent in double precision. What it leaves out (an
attraction that grows with the gap, areas under rough faces, fringes of the full field) the refinement of
`evfem.response.sensitivities` puts right: the derivative is a zero of the exact directional derivative of R.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK, sizes
from evfem.simulation.model import Model
from evfem.newton.control import Target, Unsupported
from evfem.newton.interface import Interface
from evfem.newton.state import State

#: shares of a force and of a length by which the bound of friction is differenced for the matrix
SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class Equations:
    """R of one part of `model` from `old` to `target`; `begin` makes its clocks those of the part."""

    model: Model
    old: State
    target: Target

    @classmethod
    def begin(cls, model: Model, old: State, target: Target, pins: Floats) -> Equations:
        """Start the part from `old`: velocities, branches, charges and slips count from there; `pins` (P,)
        are x of nodes that a jump of friction holds, else nan.
        """
        target = target.begun(old)
        interface, attraction = model.equilibrium.interface, model.attraction
        interface.begin(old, target.duration)
        interface.pins.x = pins
        if model.body.dynamics is not None:
            model.body.dynamics.begin(old.u, old.velocity, target.duration, old.inner)
        if attraction is not None and attraction.charging is not None:
            pressing = old.contact_force[:, 0]
            charged = attraction.charged(interface.resting(old), old.voltage, pressing, old.charges)
            attraction.charging.begin(charged, target.duration)
        return cls(model, old, target)

    @property
    def interface(self) -> Interface:
        """Of the model."""
        return self.model.equilibrium.interface

    def loaded(self, state: State) -> tuple[State, Floats]:
        """The state with its attraction and reaction, and the reduced balance (n,)."""
        model, body = self.model, self.model.body
        attraction = model.equilibrium.attraction_at(self.old, state, state.voltage)
        nodal = body.forces(state.u)
        nodal[model.pad.nodes] -= attraction + self.interface.contact_forces(state)
        forces = body.reduce(nodal)
        return replace(state, attraction=attraction, reaction=forces[body.bone]), forces

    def ended(self, state: State) -> State:
        """The state as the run would accept it, with the history that it leaves behind."""
        state, attraction = self.loaded(state)[0], self.model.attraction
        state = self.interface.aged(self.old, self.model.equilibrium.body.accepted(self.old, state))
        if self.target.hand is not None:
            state = self.target.hand.settled(state)
        if attraction is None or attraction.charging is None:
            return state
        resting, pressing = self.interface.resting(state), state.contact_force[:, 0]
        return replace(state, charges=attraction.charged(resting, state.voltage, pressing).charges)

    def residual(self, state: State) -> Floats:
        """R (m,): balance of the free unknowns, bone, contact of all pad nodes."""
        loaded, forces = self.loaded(state)
        return np.concatenate(
            [forces[: -state.bone.size], self._bone(loaded), self._contact(state)[0].ravel()]
        )

    def _bone(self, state: State) -> Floats:
        """What the bone lacks (dim,): of its place in mm, or of the force on it in N/mm."""
        target, found = self.target, state.bone - self.target.bone(state.bone)
        if target.height.free:
            found[1] = target.height.missing(float(state.bone[1]), state.reaction)
        elif isinstance(target.height, Unsupported):
            found[1] = state.bone[1] - self.old.bone[1]
        if target.hand is not None:
            found[0] = target.hand.missing(float(state.bone[0]), state.reaction)
        return found

    def _slip(self, state: State) -> Floats:
        """Slips (P, dim - 1) in mm with what a penalty yields."""
        yields = self.interface.compliance(self.old)[:, 1:]
        return self.interface.slip(self.old, state) + yields * (
            state.contact_force[:, 1:] - self.old.contact_force[:, 1:]
        )

    def _bound(self, state: State, x: Floats, way: Floats) -> Floats:
        """Bound of friction (P,) in N/mm at x (P,) with slips of the size `way` (P,)."""
        held = self.interface.pins.held
        return self.interface.limit(self.old, state, np.where(held, self.interface.pins.x, x), way)

    def _contact(self, state: State) -> tuple[Floats, Floats, Floats]:
        """What contact lacks (P, dim), slips (P, dim - 1) and bounds of friction (P,)."""
        interface, status = self.interface, state.status
        normal, shear = np.split(state.contact_force, [1], axis=1)
        gap = interface.surface_at(state).normal_gap + interface.compliance(self.old)[:, 0] * normal[:, 0]
        slip, x = self._slip(state), interface.positions(state.u)[:, 0]
        way = np.where(status >= FORWARD, sizes(slip), 0.0)
        bound = self._bound(state, x, way)
        sliding = shear + bound[:, None] * directions(status, slip)
        along = np.where(
            (status == STICK)[:, None], slip, np.where((status >= FORWARD)[:, None], sliding, shear)
        )
        return np.column_stack([np.where(status == OPEN, normal[:, 0], gap), along]), slip, bound

    def margins(self, state: State) -> Floats:
        """How far nodes are from another status (P, 2): gap (mm) of open ones, contact force of closed ones;
        shear force below the bound of sticking ones, slip (mm) of slipping ones, inf of open ones.
        """
        slip, bound = self._contact(state)[1:]
        touching = state.status != OPEN
        gap = self.interface.surface_at(state).gap
        first = np.where(touching, state.contact_force[:, 0], np.where(self.interface.pad.free, gap, np.inf))
        left = bound - sizes(state.contact_force[:, 1:])
        second = np.where(state.status == STICK, left, sizes(slip))
        return np.column_stack([first, np.where(touching, second, np.inf)])

    # -- the matrix

    def matrix(self, state: State) -> Any:
        """dR/dw as sparse CSC (m, m) at an accepted state."""
        import scipy.sparse as sparse

        model, body = self.model, self.model.body
        tissue = body.pattern.full(body.tangent(state.u)).tocoo()
        triplets = [(tissue.row, tissue.col, tissue.data), *self._pad_forces(state)]
        size, dim = body.size, state.bone.size
        forces = _assembled(triplets, (size, size + state.contact_force.size))
        rows = _assembled(self._contact_rows(state), (state.contact_force.size, forces.shape[1]))
        bone = sparse.vstack([self._bone_row(forces, axis) for axis in range(dim)])
        return sparse.vstack([forces[: size - dim], bone, rows]).tocsc()

    def _bone_row(self, forces: Any, axis: int) -> Any:
        """Derivative (1, m) of what the bone lacks along an axis, from that of the balance (n, m)."""
        import scipy.sparse as sparse

        target, unknown = self.target, int(self.model.body.bone[axis])
        own = sparse.csr_matrix(([1.0], ([0], [unknown])), shape=(1, forces.shape[1]))
        if axis == 0 and target.hand is not None:
            return -target.hand.stiffness * own - forces[unknown]
        return -forces[unknown] if axis == 1 and target.height.free else own

    def _columns(self) -> tuple[Ints, Ints]:
        """Unknowns of the pad nodes' displacements and contact forces, (P, dim) each."""
        body, nodes = self.model.body, self.model.pad.nodes
        moves: Ints = body.unknowns[nodes]
        return moves, body.size + np.arange(moves.size).reshape(moves.shape)

    def _pad_forces(self, state: State) -> list[tuple[Any, Any, Any]]:
        """Derivative of the pad nodes' forces in the balance by displacements and contact forces."""
        moves, presses = self._columns()
        surface, force = self.interface.surface_at(state), state.contact_force
        n, t = axes(surface.slope, surface.stretch)
        turn = surface.curvature / surface.stretch**2
        found = []
        for axis in (0, 1):
            by_x = turn * (force[:, 1] * n[axis] - force[:, 0] * t[axis])
            found.append((moves[:, axis], moves[:, 0], -by_x))
            found.append((moves[:, axis], presses[:, 0], -n[axis]))
            found.append((moves[:, axis], presses[:, 1], -t[axis]))
        if state.bone.size == 3:
            found.append((moves[:, 2], presses[:, 2], -np.ones(len(moves))))
        attraction = self.model.attraction
        if attraction is None or not attraction.acts(state.voltage):
            return found
        seen = (self.interface.resting(state), state.voltage, self.old.touching, force[:, 0])
        pulled = attraction.stiffness(*seen).tocoo()
        found.append((moves.ravel()[pulled.row], moves.ravel()[pulled.col], -pulled.data))
        found.append((moves[:, 1], presses[:, 0], attraction.gain_on_pressing(*seen)))
        return found

    def _contact_rows(self, state: State) -> list[tuple[Any, Any, Any]]:
        """Derivative of what contact lacks."""
        moves, presses = self._columns()
        rows, status = np.arange(moves.size).reshape(moves.shape), state.status
        closed, dim = np.flatnonzero(status != OPEN), state.bone.size
        opened = np.flatnonzero(status == OPEN)
        surface, give = self.interface.surface_at(state), self.interface.compliance(self.old)
        # the gap over the stretch, whose own change counts for nothing at gap 0
        found = [(rows[opened, a], presses[opened, a], np.ones(opened.size)) for a in range(dim)]
        found.append((rows[closed, 0], moves[closed, 0], (-surface.slope / surface.stretch)[closed]))
        found.append((rows[closed, 0], moves[closed, 1], (1.0 / surface.stretch)[closed]))
        found.append((rows[closed, 0], presses[closed, 0], give[closed, 0]))
        stick, slips = np.flatnonzero(status == STICK), np.flatnonzero(status >= FORWARD)
        for a in range(1, dim):
            moved = surface.stretch if a == 1 else np.ones(len(moves))
            found.append((rows[stick, a], moves[stick, 2 * (a - 1)], moved[stick]))
            found.append((rows[stick, a], presses[stick, a], give[stick, a]))
        return [*found, *self._sliding_rows(state, slips)]

    def _sliding_rows(self, state: State, slips: Ints) -> list[tuple[Any, Any, Any]]:
        """Derivative of what friction lacks at slipping nodes."""
        moves, presses = self._columns()
        rows, dim = np.arange(moves.size).reshape(moves.shape), state.bone.size
        _, slip, bound = self._contact(state)
        way, e = np.maximum(sizes(slip), 1e-300), directions(state.status, slip)
        by_normal, by_x, by_way = self._bound_slopes(state, sizes(slip))
        stretch = self.interface.surface_at(state).stretch
        found = []
        for a in range(1, dim):
            along = e[:, a - 1]
            found.append((rows[slips, a], presses[slips, a], np.ones(slips.size)))
            found.append((rows[slips, a], presses[slips, 0], (by_normal * along)[slips]))
            found.append((rows[slips, a], moves[slips, 0], (by_x * along)[slips]))
            for b in range(1, dim):
                turns = bound / way * (float(a == b) - along * e[:, b - 1]) if dim == 3 else 0.0
                moved = stretch if b == 1 else 1.0
                share = (turns + by_way * along * e[:, b - 1]) * moved
                found.append((rows[slips, a], moves[slips, 2 * (b - 1)], share[slips]))
        return found

    def _bound_slopes(self, state: State, way: Floats) -> tuple[Floats, Floats, Floats]:
        """Derivatives (P,) of the bound of friction by contact force, x and size of the slip."""
        x, force = self.interface.positions(state.u)[:, 0], state.contact_force
        normal, length = SHARE * np.maximum(force[:, 0], 1e-12), SHARE * self.interface.length
        more, less = (
            replace(state, contact_force=force + sign * normal[:, None] * (np.arange(force.shape[1]) == 0))
            for sign in (1.0, -1.0)
        )
        by_normal = (self._bound(more, x, way) - self._bound(less, x, way)) / (2.0 * normal)
        by_x = (self._bound(state, x + length, way) - self._bound(state, x - length, way)) / (2.0 * length)
        further = SHARE * np.maximum(way, 1e-12)
        by_way = (self._bound(state, x, way + further) - self._bound(state, x, way - further)) / (
            2.0 * further
        )
        return by_normal, by_x, by_way


def axes(slope: Floats, stretch: Floats) -> tuple[Floats, Floats]:
    """x and y of the profile's normals and tangents, (2, P) each."""
    one = np.ones_like(slope)
    return np.stack([-slope, one]) / stretch, np.stack([one, slope]) / stretch


def directions(status: Ints, slip: Floats) -> Floats:
    """Unit vectors (P, dim - 1) along the slips of slipping nodes, else 0."""
    if slip.shape[1] == 1:
        return np.subtract(status == FORWARD, status == BACKWARD, dtype=float)[:, None]
    found = slip / np.maximum(sizes(slip), 1e-300)[:, None]
    return np.where((status >= FORWARD)[:, None], found, 0.0)


def _assembled(triplets: list[tuple[Any, Any, Any]], shape: tuple[int, int]) -> Any:
    """A sparse CSR matrix of (rows, columns, values), repeated entries added up."""
    import scipy.sparse as sparse

    rows, columns, values = (np.concatenate([np.ravel(one[k]) for one in triplets]) for k in range(3))
    return sparse.csr_matrix((values, (rows, columns)), shape=shape)

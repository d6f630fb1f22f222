r"""The matrix :math:`K = \partial R/\partial w` of a substep (`evfem.response.parts`), factorised.

The tissue's tangent, in double precision, is condensed onto the nodes near contact and the bone
(`evfem.newton.condensation`); what acts there, the attraction, the contact forces that turn with the profile,
gaps, sticking and friction with their statuses fixed, is added to the small dense matrix, unsymmetric as it
is.

What K leaves out (an attraction that grows with the gap, areas under rough faces, fringes of the full field,
the attraction far from contact) the refinement of `evfem.response.lines` puts right: the derivative is a zero
of the exact directional derivative of R, and K only decides how fast it is found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, linalg
from evfem.contact.condensed import COMPONENTS
from evfem.contact.signorini import FORWARD, OPEN, STICK, sizes
from evfem.newton.condensation import Condensation
from evfem.newton.state import State
from evfem.response.parts import Equations, directions

#: relative steps of force and length by which the bound of friction is differenced
RELATIVE_STEP = 1e-6
#: rows, columns and values of a sparse matrix
Triplet = tuple[Any, Any, Any]


@dataclass(frozen=True, eq=False)
class Tangent:
    """K of `equations` at an accepted `state`, with the tissue's tangent there in `factor`, condensed onto
    the unknowns `kept`, the bone's last.
    """

    equations: Equations
    state: State
    factor: Condensation
    kept: Ints

    @cached_property
    def _dense(self) -> Any:
        return linalg().lu_factor(self._condensed(), check_finite=False)

    @property
    def _closed(self) -> Ints:
        """Unknowns of the contact forces of touching nodes, by their numbers among all (t,)."""
        return np.flatnonzero(np.repeat(self.state.status != OPEN, self.state.bone.size))

    def _condensed(self) -> Floats:
        """The dense matrix of kept displacements, bone and contact forces of touching nodes."""
        kept, closed, size = self.kept, self._closed, self.equations.model.body.size
        number = np.full(size + self.state.contact_force.size, -1)
        number[kept], number[size + closed] = np.arange(kept.size), kept.size + np.arange(closed.size)
        count = kept.size + closed.size
        matrix = np.zeros((count, count))
        below = np.full(self.state.contact_force.size, -1)
        below[closed] = kept.size + np.arange(closed.size)
        _add(matrix, self._pad_forces(), number, number)
        _add(matrix, self._contact_rows(), below, number)
        if self.equations.interface.foundation.yields:
            self._add_foundation(matrix, number)
        matrix[: kept.size, : kept.size] += self.factor.schur
        for axis in range(self.state.bone.size):
            row = kept.size - self.state.bone.size + axis
            matrix[row] = self._bone_row(matrix[row], row, axis)
        return matrix

    def _add_foundation(self, matrix: Floats, number: Ints) -> None:
        """Add what an elastic surface gives way by, under the forces on the pad, to a matrix of the balance
        and of contact by these places.
        """
        moves = self._columns()[0]
        near = np.flatnonzero((number[moves] >= 0).all(axis=1))
        moved = number[moves[near]].ravel()
        interface = self.equations.interface
        below = interface.foundation.under(interface.positions(self.state.u), self.state)
        moved_surface = below.among(near) @ -matrix[moved]
        matrix += matrix[:, moved] @ np.linalg.solve(
            np.eye(moved.size) - moved_surface[:, moved], moved_surface
        )

    def _bone_row(self, balance: Floats, row: int, axis: int) -> Floats:
        """What the bone lacks along an axis by the dense unknowns, from the row of the `balance`."""
        target, own = self.equations.target, np.zeros_like(balance)
        own[row] = 1.0
        if (stiffness := target.drive.own_stiffness(axis)) is not None:
            return -stiffness * own - balance
        return -balance if self.equations.force_controlled(axis) else own

    def solve(self, right: Floats) -> Floats:
        """w (m,) with K w = `right` (m,)."""
        size, dim = self.equations.model.body.size, self.state.bone.size
        forces = right[:size].copy()
        forces[-dim:] = 0.0
        saved, condensed = self.factor.forward(forces)
        dense = np.concatenate([condensed, right[size + self._closed]])
        for axis in range(dim):
            row = self.kept.size - dim + axis
            lacking = right[size - dim + axis]
            dense[row] = lacking - condensed[row] if self.equations.force_controlled(axis) else lacking
        found = linalg().lu_solve(self._dense, dense, check_finite=False)
        pressing = right[size:].copy()  # of open nodes, as they are
        pressing[self._closed] = found[self.kept.size :]
        return np.concatenate([self.factor.backward(saved, found[: self.kept.size]), pressing])

    def _columns(self) -> tuple[Ints, Ints]:
        """Unknowns of the pad nodes' displacements and contact forces, (P, dim) each."""
        model = self.equations.model
        moves: Ints = model.body.unknowns[model.pad.nodes]
        return moves, model.body.size + np.arange(moves.size).reshape(moves.shape)

    def _pad_forces(self) -> list[Triplet]:
        """Derivative of the pad nodes' forces in the balance by displacements and contact forces."""
        state, (moves, presses) = self.state, self._columns()
        surface, force = self.equations.interface.surface_at(state), state.contact_force
        turned, found = surface.turned(force), []
        for row, axis in enumerate(COMPONENTS[: state.bone.size]):
            for a in range(state.bone.size):
                found.append((moves[:, axis], presses[:, a], -surface.axes[:, a, row]))
            for b in range(state.bone.size - 1):
                found.append((moves[:, axis], moves[:, 2 * b], -turned[:, row, b]))
        attraction = self.equations.model.attraction
        if not attraction.acts(state.voltage):
            return found
        seen = self.equations.interface.pad_state(state, self.equations.old.touching)
        pulled = attraction.stiffness(seen)
        found.append((moves.ravel()[pulled.row], moves.ravel()[pulled.column], -pulled.value))
        found.append((moves[:, 1], presses[:, 0], attraction.gain_on_pressing(seen)))
        return found

    def _contact_rows(self) -> list[Triplet]:
        """Derivative of what contact lacks."""
        state, (moves, presses), interface = self.state, self._columns(), self.equations.interface
        rows, status = np.arange(moves.size).reshape(moves.shape), state.status
        closed, dim = np.flatnonzero(status != OPEN), state.bone.size
        opened = np.flatnonzero(status == OPEN)
        surface, give = interface.surface_at(state), interface.compliance(self.equations.old)
        # the gap over the stretch, whose own change counts for nothing at gap 0
        found = [(rows[opened, a], presses[opened, a], np.ones(opened.size)) for a in range(dim)]
        for row, axis in enumerate(COMPONENTS[:dim]):
            found.append((rows[closed, 0], moves[closed, axis], surface.axes[closed, 0, row]))
        found.append((rows[closed, 0], presses[closed, 0], give[closed, 0]))
        stick, slips = np.flatnonzero(status == STICK), np.flatnonzero(status >= FORWARD)
        for a in range(1, dim):
            for b in range(1, dim):
                moved = surface.travel[stick, a - 1, b - 1]
                found.append((rows[stick, a], moves[stick, 2 * (b - 1)], moved))
            found.append((rows[stick, a], presses[stick, a], give[stick, a]))
        return [*found, *self._sliding_rows(slips)]

    def _sliding_rows(self, slips: Ints) -> list[Triplet]:
        """Derivative of the friction residual at slipping nodes."""
        state, (moves, presses) = self.state, self._columns()
        rows, dim = np.arange(moves.size).reshape(moves.shape), state.bone.size
        _, slip, bound = self.equations.contact(state)
        way, e = np.maximum(sizes(slip), 1e-300), directions(state.status, slip)
        by_normal, by_place, by_way = self._bound_slopes(sizes(slip))
        travel = self.equations.interface.surface_at(state).travel
        found = []
        for a in range(1, dim):
            along = e[:, a - 1]
            found.append((rows[slips, a], presses[slips, a], np.ones(slips.size)))
            found.append((rows[slips, a], presses[slips, 0], (by_normal * along)[slips]))
            turns = -along[:, None] * e * (bound / way)[:, None]
            turns[:, a - 1] += bound / way
            by_slip = (turns if dim == 3 else 0.0) + (by_way * along)[:, None] * e
            share = np.einsum("pb,pbk->pk", by_slip, travel) + by_place * along[:, None]
            for b in range(1, dim):
                found.append((rows[slips, a], moves[slips, 2 * (b - 1)], share[slips, b - 1]))
        return found

    def _bound_slopes(self, slip: Floats) -> tuple[Floats, Floats, Floats]:
        """Derivatives of the bound of friction by contact force, position (P, d) and size of the slip."""
        state, interface, bound = self.state, self.equations.interface, self.equations.bound
        position, force = interface.on_display(state), state.contact_force
        normal, length = RELATIVE_STEP * np.maximum(force[:, 0], 1e-12), RELATIVE_STEP * interface.length
        more, less = (
            replace(state, contact_force=force + sign * normal[:, None] * (np.arange(force.shape[1]) == 0))
            for sign in (1.0, -1.0)
        )
        by_normal = (bound(more, position, slip) - bound(less, position, slip)) / (2.0 * normal)
        shifts = length * np.eye(position.shape[1])
        by_place = [bound(state, position + one, slip) - bound(state, position - one, slip) for one in shifts]
        further = RELATIVE_STEP * np.maximum(slip, 1e-12)
        by_slip = (bound(state, position, slip + further) - bound(state, position, slip - further)) / (
            2.0 * further
        )
        return by_normal, np.stack(by_place, axis=1) / (2.0 * length), by_slip


def _add(matrix: Floats, triplets: list[Triplet], rows: Ints, columns: Ints) -> None:
    """Add triplets to a dense matrix at the numbers of their rows and columns, those without one left out."""
    for row, column, value in triplets:
        at, to = rows[row], columns[column]
        there = (at >= 0) & (to >= 0)
        np.add.at(matrix, (at[there], to[there]), np.broadcast_to(value, at.shape)[there])

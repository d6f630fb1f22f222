r"""The body linear about one state, condensed on the nodes that may touch (Guyan's reduction).

With the tangent K of a body in equilibrium at :math:`u_0`, p the nodes of its pad and i all others but the
bone's, and :math:`x = u_p - b` the displacements relative to the bone,

.. math:: f_p = f_{p0} + S\,(x - x_0), \qquad S = K_{pp} - K_{pi} K_{ii}^{-1} K_{ip}, \qquad
          f_b = -\textstyle\sum f_p, \qquad
          \psi = \psi_0 + f_{p0}\cdot(x - x_0) + \tfrac12 (x - x_0)\cdot S\,(x - x_0) .

It has the methods of a `Body`, so that contact, friction and attraction on it are exact, and the energy
balance of a run closes. Displacements are those of pad and bone alone, until `whole` computes the others.
The drag of pseudo-transient continuation is condensed likewise.

Source: R. J. Guyan, AIAA J. 3 (1965) 380, doi:10.2514/3.2874.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.newton.condensation import make_condensation
from evfem.tissue.body import Body
from evfem.tissue.pattern import Pattern


class LinearTissue:
    """Linear tissue: no cell collapses, the pressure is no unknown; stresses are those of `whole`."""

    nearly_incompressible = False
    #: no law is asked of it
    regions = ()

    def __init__(self, body: LinearBody) -> None:
        self.groups, self._body = body.full.tissue.groups, body

    def smallest_J(self, u: Floats) -> float:
        """1, for any u (N, dim)."""
        return 1.0

    def cell_stress(self, u: Floats) -> tuple[Floats, Floats]:
        """Stresses and volume ratios of the full body's law, with the displacements u on pad and bone."""
        return self._body.full.tissue.cell_stress(self._body.whole(u))


class LinearBody(Body):
    """`full` linear about displacements u (N, dim), on the nodes `pad` (P,)."""

    def __init__(self, full: Body, pad: Ints, u: Floats, threads: int = 1) -> None:
        self.full, self.pad, self.space = full, pad, full.space
        self.tissue: Any = LinearTissue(self)
        self.rooms, self.given, self.terms, self.drag_rate, self._own = (), (), (), 0.0, ()
        dim = full.space.dim
        own = full.unknowns[pad]
        kept = np.concatenate([own.ravel(), full.bone])
        self._factor = make_condensation(full.pattern, kept, threads)
        self._factor.factorise(full.tangent(u))
        self.matrix = self._factor.schur[:-dim, :-dim].copy()
        self.base, self._bone = u, int(full.space.mesh.node_sets["bone"][0])
        self.energy_at_base = full.energy(u)
        nodal = full.forces(u)
        self._at_base = nodal[pad]
        self._relative = (u[pad] - u[self._bone]).ravel()
        self._at: tuple[Any, Floats, Floats] = (None, self._relative, self._relative)
        self.size = own.size + dim
        self.bone = np.arange(own.size, self.size)
        # inner nodes move with the bone until `whole` computes them
        self.unknowns = np.broadcast_to(self.bone, full.unknowns.shape).copy()
        self.unknowns[pad] = np.arange(own.size).reshape(-1, dim)

    @cached_property
    def pattern(self) -> Pattern:
        """Every node of the pad with every other one, as if they were a cell."""
        return Pattern(np.arange(self.size // self.space.dim)[None], self.space.dim)

    def _strained(self, u: Floats) -> tuple[Floats, Floats]:
        """x - x_0 and S (x - x_0) of the pad, (dim P,) each; the last ones are kept for who asks again."""
        if u is not self._at[0]:
            strain = (u[self.pad] - u[self._bone]).ravel() - self._relative
            self._at = u, strain, self.matrix @ strain
        return self._at[1:]

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, dim), on the pad and the first node of the bone."""
        pulled = self._at_base + self._strained(u)[1].reshape(-1, self.space.dim)
        total = np.zeros_like(u)
        total[self._bone] = -pulled.sum(axis=0)
        total[self.pad] = pulled if self.drag_rate == 0.0 else pulled + self._drag_forces(u)
        return total

    def _drag_forces(self, u: Floats) -> Floats:
        """Drag (P, dim) on the pad."""
        return (self.drag_rate * self._drag @ self._since(u)).reshape(-1, self.space.dim)

    def _since(self, u: Floats) -> Floats:
        return u[self.pad].ravel() - self._released

    def release(self, u: Floats, rate: float) -> None:
        """Drag of this rate against displacements from u (N, dim) from now on; none if it is 0."""
        self.drag_rate, self._released = rate, u[self.pad].ravel()

    def drag_dissipation(self, u: Floats) -> float:
        """Dissipation by drag in the step that ends at u: N mm, in the plane per mm of depth."""
        if self.drag_rate == 0.0:
            return 0.0
        return float(self.drag_rate * self._since(u) @ self._drag @ self._since(u))

    def given_forces(self, u: Floats) -> Floats:
        """None: a form of the user is not linearised."""
        return np.zeros_like(u)

    def tangent(self, u: Floats, pressure: Floats | None = None) -> Floats:
        """Upper triangle of the reduced tangent, the same everywhere but for drag."""
        dim, m = self.space.dim, self.size
        whole = np.zeros((m, m))
        whole[:-dim, :-dim] = self.matrix
        to_bone = -self.matrix.reshape(m - dim, -1, dim).sum(axis=1)
        whole[:-dim, -dim:], whole[-dim:, :-dim] = to_bone, to_bone.T
        whole[-dim:, -dim:] = -to_bone.reshape(-1, dim, dim).sum(axis=0)
        if self.drag_rate > 0.0:
            whole[:-dim, :-dim] += self.drag_rate * self._drag
        return np.ascontiguousarray(whole[np.triu_indices(m)])

    def energy(self, u: Floats) -> float:
        """Stored energy: N mm, in the plane per mm of depth."""
        strain, pulled = self._strained(u)
        mean = self._at_base.ravel() + 0.5 * pulled
        return self.energy_at_base + float(mean @ strain)

    def energies(self, u: Floats, increment: Floats, fractions: Floats) -> Floats:
        more = (increment[self.pad] - increment[self._bone]).ravel()
        pulled = self._at_base.ravel() + self._strained(u)[1]
        return self.energy(u) + fractions * (pulled @ more) + 0.5 * fractions**2 * (more @ self.matrix @ more)

    @cached_property
    def _drag(self) -> Floats:
        """Tangent of the drag at rate 1, condensed (2 P, 2 P)."""
        full, dim = self.full, self.space.dim
        full.release(self.base, 1.0)
        data = full.pattern.zeros()
        full.drag.add_tangent(self.base, full.pattern, data)
        full.release(self.base, 0.0)
        sparse = full.pattern.full(full.pattern.finish(data))
        shapes = np.stack([self._solve(np.eye(1, self.size, k)[0]) for k in range(self.size - dim)], axis=1)
        return np.asarray(shapes.T @ (sparse @ shapes))

    @cached_property
    def _still(self) -> Floats:
        """The state of the factorisation's backward solve without forces within."""
        return self._factor.forward(np.zeros(self.full.size))[0]

    def _solve(self, kept: Floats) -> Floats:
        """Reduced displacements (n,) of the full body for displacements of the pad and the bone (m,)."""
        return self._factor.backward(self._still, kept)

    @property
    def whole(self) -> Callable[[Floats], Floats]:
        return self._whole

    def _whole(self, u: Floats) -> Floats:
        """Displacements (N, dim) of all nodes for the displacements u (N, dim) of pad and bone."""
        moved = np.concatenate([(u - self.base)[self.pad].ravel(), (u - self.base)[self._bone]])
        return self.base + self.full.expand(self._solve(moved))

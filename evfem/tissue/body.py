"""The deformable finger as one system: which unknowns it has, its internal forces and its tangent.

The bone is rigid and translates, so all its nodes share dim unknowns and the reduced unknowns are (free
nodes' displacements, bone x, y[, z]); forces of the bone's nodes add up to the reaction. User forms
(`evfem.tissue.forms`) and time (`evfem.tissue.dynamics`) are further terms of the internal forces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.rooms import BodyTerm, shaped
from evfem.tissue.dynamics import Dynamics, Static
from evfem.tissue.pattern import Pattern
from evfem.tissue.space import Space
from evfem.tissue.weakform import Tissue


class Body:
    """Tissue plus user terms on a space, reduced to the free nodes and the bone's translation."""

    def __init__(
        self,
        space: Space,
        laws: Mapping[str, Any],
        terms: Sequence[Any] = (),
        dynamics: Dynamics | Static | None = None,
        rooms: Sequence[BodyTerm] = (),
    ) -> None:
        self.space = space
        self.tissue = Tissue(space, laws)
        self.dynamics = dynamics or Static()
        self.given = tuple(terms)
        self.terms = (*terms, *self.dynamics.forms)
        #: its terms that keep something from substep to substep, or have energies of their own
        self.rooms: tuple[Any, ...] = (self.dynamics, *rooms)
        self._own = tuple(rooms)
        for room in self._own:
            room.placed(space.mesh)
        self.drag_rate = 0.0
        bone, dim = space.mesh.node_sets["bone"], space.mesh.dim
        held = np.zeros(space.size, dtype=bool)
        held[bone] = True
        free = np.flatnonzero(~held)
        self.size = dim * free.size + dim
        self.bone: Ints = np.arange(dim * free.size, self.size)
        self.unknowns: Ints = np.empty((space.size, dim), dtype=np.int64)
        self.unknowns[free] = np.arange(dim * free.size).reshape(-1, dim)
        self.unknowns[bone] = self.bone

    @cached_property
    def pattern(self) -> Pattern:
        """Pattern of the reduced tangent."""
        dim = self.space.mesh.dim
        return Pattern(self.unknowns[self.space.nodes, 0] // dim, dim)

    @cached_property
    def drag(self) -> Dynamics:
        """Kelvin-Voigt stress and mass of a release (docs, Theory), with one rate and no time.

        The stress holds what deforms, down to single nodes; the mass, by which a shear wave crosses the
        body's height in the relaxation time, what moves as a whole. Its speed is taken away at each step's
        beginning, so a release never overshoots. A large rate leaves the body where it is.
        """
        modulus = np.zeros(len(self.space.nodes))
        for law, cells in self.tissue.groups:
            modulus[cells] = law.shear_modulus
        return Dynamics(self.space, modulus, modulus / np.ptp(self.space.mesh.points[:, 1]) ** 2)

    def release(self, u: Floats, rate: float) -> None:
        """From now on drag of this rate holds the body back at u (N, dim); none if it is 0."""
        self.drag_rate = rate
        if rate > 0.0:
            self.drag.begin_from(u, np.zeros_like(u), 1.0 / rate)

    def drag_dissipation(self, u: Floats) -> float:
        """Dissipation by drag in the step that ends at u: N mm, in the plane per mm of depth."""
        if self.drag_rate == 0.0:
            return 0.0
        return self.drag.damping(u) + 2.0 * self.drag.kinetic_energy(self.drag.velocity(u))

    def reduce(self, nodal: Floats) -> Floats:
        """Nodal forces (N, dim) to reduced forces (n,): sums over the bone."""
        return np.bincount(self.unknowns.ravel(), nodal.ravel(), self.size).astype(float, copy=False)

    def expand(self, reduced: Floats) -> Floats:
        """Reduced displacements (n,) to nodal ones (N, dim)."""
        return reduced.take(self.unknowns)

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, dim)."""
        # without the bone's travel: its rounding would outweigh the small forces of a finger far from here
        total = self.tissue.forces(translated(u, -u[self.space.mesh.node_sets["bone"][0]]))
        for term in self._acting:
            total = total + term.forces(u)
        for room in self._own:
            total = total + shaped(room, "forces", room.forces(u), u)
        return total

    @property
    def _acting(self) -> tuple[Any, ...]:
        return self.terms if self.drag_rate == 0.0 else (*self.terms, self.drag)

    def given_forces(self, u: Floats) -> Floats:
        """The share (N, dim) of the user's forms in `forces`."""
        total = np.zeros_like(u)
        for term in self.given:
            total += term.forces(u)
        return total

    def tangent(self, u: Floats, pressure: Floats | None = None) -> Floats:
        """Upper triangle of the reduced tangent, in the order of `pattern` (all of it: the
        built-in terms are symmetric, a user's form gives its symmetric part); `pressure` (E, Q)
        takes the place of the tissue's own in its curvature.
        """
        data = self.pattern.zeros()
        self.tissue.add_tangent(u, self.pattern, data, pressure)
        for term in self._acting:
            term.add_tangent(u, self.pattern, data)
        for room in self._own:
            np.add.at(
                data, self.pattern.diagonal[self.unknowns], shaped(room, "stiffness", room.stiffness(u), u)
            )
        return self.pattern.finish(data)

    @property
    def whole(self) -> Callable[[Floats], Floats]:
        """What makes displacements (N, dim) of all nodes of a state's u; here they are the same."""
        return _itself

    def begin(self, old: Any, seconds: float) -> None:
        """A trial of so many seconds begins from an accepted state, or what is kept of it."""
        for room in self.rooms:
            room.begin(old, seconds)

    def takes_time(self, seconds: float) -> bool:
        """Whether rates count in a substep of so many seconds."""
        return any(room.takes_time(seconds) for room in self.rooms)

    def outdates(self, made_for: float, seconds: float) -> bool:
        """Whether a tangent made for a substep of `made_for` seconds is too old for one of `seconds`."""
        return any(room.outdates(made_for, seconds) for room in self.rooms)

    @property
    def has_mass(self) -> bool:
        """Whether it resists rigid motion by itself."""
        return self.dynamics.mass is not None

    @property
    def branches(self) -> Any:
        """The Maxwell branches of the tissue, or None."""
        return self.dynamics.branches

    def energy(self, u: Floats) -> float:
        """Stored energy of the tissue: N mm, in the plane per mm of depth."""
        return self.tissue.energy(u)

    def energies(self, u: Floats, way: Floats, places: Floats) -> Floats:
        """The same at u plus the shares `places` (w,) of a way (N, dim)."""
        return self.tissue.energies(u, way, places)


def _itself(u: Floats) -> Floats:
    return u


def translated(u: Floats, way: Floats) -> Floats:
    """u (N, dim) plus a translation (dim,), axis by axis: five times as fast as over short rows."""
    moved = np.empty_like(u)
    for axis, share in enumerate(way):
        np.add(u[:, axis], share, out=moved[:, axis])
    return moved

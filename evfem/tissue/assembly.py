r"""One engine for every weak form: nodal forces :math:`\sum_q w B^T s`, tangents
:math:`\sum_q w B^T D B`.

The fluxes s = df/d(v, grad v, theta(v)) of a form are its values at unit test functions
(`evfem.tissue.forms`); a complex step on each part of (u, grad u, theta) gives their derivatives D. The rows
B take the displacements of a cell's nodes to the parts. Where theta = Pi ln J is not linear in the
displacements, the curvature of ln J joins the tangent. Arrays: C cells or facets, n nodes each, Q quadrature
points, S samples of ln J, K parts, m of them per component; N nodes, E cells of the mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.tensor import Array, cofactor, complex_step, det, identity, trace, transpose
from evfem.tissue.forms import Field, Integrand, Parts, fluxes, fluxes_at_once
from evfem.tissue.pattern import Pattern
from evfem.tissue.space import Space, scatter


def volume_change(H: Array) -> Array:
    """J - 1 = det(1 + H) - 1 of H (dim, dim, ...), with the digits that J loses where it is nearly 1."""
    middle: Array | float = 0.0 if len(H) == 2 else trace(cofactor(H))
    return trace(H) + (middle + det(H))


def projected(projection: Floats | None, sampled: Floats) -> Floats:
    """Pi times values (C, S) at the samples: those at the points (C, Q); None is the unit matrix."""
    return sampled if projection is None else (projection @ sampled[..., None])[..., 0]


def gathered(projection: Floats | None, values: Floats) -> Floats:
    """Transpose of `projected`: what acts at the points (C, Q), where ln J is sampled (C, S)."""
    return values if projection is None else (values[:, None] @ projection)[:, 0]


@dataclass(frozen=True, eq=False)
class VolumeMeasure:
    """theta = Pi ln J of some cells: `gradient` (C, S, n, dim) of the shape functions where ln J
    is sampled; `projection` (C, Q, S) is Pi, None where the samples are the quadrature points. A
    measure of `small_strain` takes the trace of the strain for ln J.
    """

    gradient: Floats
    projection: Floats | None
    small_strain: bool

    def at_points(self, H: Floats) -> Floats:
        """theta (C, Q) from grad u (dim, dim, C, S) at the samples; nan where a cell is inverted."""
        with np.errstate(invalid="ignore", divide="ignore"):
            sampled = trace(H) if self.small_strain else np.log1p(volume_change(H))
        return projected(self.projection, sampled)

    def slope(self, H: Floats) -> Floats:
        """d ln J / dF = F^-T, or the unit matrix of a trace, (dim, dim, C, S)."""
        unit = identity(len(H), 2)
        if self.small_strain:
            return np.broadcast_to(unit, H.shape)
        with np.errstate(invalid="ignore", divide="ignore"):
            return cofactor(unit + H) / (1.0 + volume_change(H))

    @cached_property
    def to_gradient(self) -> Floats:
        """(C, S dim, n): displacements of one component to its gradient at the samples."""
        C, S, n, dim = self.gradient.shape
        return np.swapaxes(self.gradient, 2, 3).reshape(C, S * dim, n)

    def push(self, H: Floats) -> Floats:
        """d ln J by the nodal displacements, (C, S, n, dim)."""
        return self.gradient @ np.ascontiguousarray(self.slope(H).transpose(2, 3, 1, 0))

    def pressure_forces(self, H: Floats, q: Floats) -> Floats:
        """Nodal forces (C, n, dim) of q dtheta(v), from grad u (dim, dim, C, S), weighted q (C, Q)."""
        stress = (gathered(self.projection, q) * transpose(self.slope(H))).transpose(2, 3, 0, 1)
        return np.swapaxes(self.to_gradient, 1, 2) @ stress.reshape(len(q), -1, len(H))

    def rows(self, push: Floats) -> Floats:
        """d theta by the nodal displacements, (C, Q, n dim)."""
        flat = push.reshape(*push.shape[:2], -1)
        return flat if self.projection is None else self.projection @ flat

    def curvature(self, push: Floats, q: Floats) -> Floats:
        """Second derivative of ln J, -F^-T grad(du)^T F^-T : grad v, times q (C, Q): (C, n, dim, n, dim)."""
        C, S, n, dim = push.shape
        flat = push.reshape(C, S, n * dim)
        products = np.swapaxes(flat, 1, 2) @ (-gathered(self.projection, q)[..., None] * flat)
        return products.reshape(C, n, dim, n, dim).transpose(0, 1, 4, 3, 2)


@dataclass(frozen=True, eq=False)
class Points:
    """Quadrature points of some cells or facets: `cells` (C,) they lie in, `nodes` (C, n) of those, shape
    functions `value` (C, Q, n) with `gradient` (C, Q, n, dim), `weight` (C, Q), the place `x` (dim, C, Q); in
    cells the measure of `volume`, on facets the outward `normal` (dim, C, Q).
    """

    cells: Ints
    nodes: Ints
    value: Floats
    gradient: Floats
    weight: Floats
    x: Floats
    volume: VolumeMeasure | None = None
    normal: Floats | None = None

    def rows(self, parts: Parts) -> Floats:
        """(C, Q, m, n): displacements of one component to its parts."""
        wanted = [self.value[:, :, None]] if parts.value else []
        wanted += [np.swapaxes(self.gradient, 2, 3)] if parts.grad else []
        empty = np.zeros((*self.weight.shape, 0, self.nodes.shape[1]))
        return np.ascontiguousarray(np.concatenate([empty, *wanted], axis=2))


def points_of(space: Space, cells: Ints, small_strain: bool = False) -> Points:
    """The quadrature points of a space in some of its cells."""
    gradient = space.gradient[cells]
    sample = gradient if space.sampled is space.at else space.sample[cells]
    projection = None if space.projection is None else space.projection[cells]
    return Points(
        cells,
        space.nodes[cells],
        np.broadcast_to(space.value, (len(cells), *space.value.shape)),
        gradient,
        space.weight[cells],
        space.points[:, cells],
        VolumeMeasure(sample, projection, small_strain),
    )


@dataclass(frozen=True, eq=False)
class State:
    """Parts `x` (K, C, Q) of u, and grad u `sampled` (dim, dim, C, S) where ln J is, if theta is used."""

    x: Floats
    sampled: Floats


@dataclass(frozen=True, eq=False)
class Integral:
    """A weak form over `points`: its nodal forces and their derivative.

    `w` is the form's context. `moduli(u, w)` gives the fluxes' derivatives (K, K, C, Q) where they
    are known in a faster way than by complex steps. A form whose arrays may have one more axis
    before (C, Q) can be evaluated `at_once` for all test functions.
    """

    form: Integrand
    points: Points
    parts: Parts
    w: Any
    moduli: Callable[[Field, Any], Floats] | None = None
    at_once: bool = False

    @cached_property
    def _rows(self) -> Floats:
        """(C, Q, m, n): displacements of one component to its parts."""
        return self.points.rows(self.parts)

    @property
    def _volume(self) -> VolumeMeasure:
        assert self.points.volume is not None, "no volume measure on facets"
        return self.points.volume

    def _linear_parts(self, ue: Floats) -> Floats:
        """Value and gradient (m dim, C, Q) of displacements (C, n, dim) of the cells' nodes."""
        C, Q, m, n = self._rows.shape
        values = (self._rows.reshape(C, Q * m, n) @ ue).reshape(C, Q, m, -1)
        return values.transpose(2, 3, 0, 1).reshape(-1, C, Q)

    def state(self, u: Floats) -> State:
        """Fields of the form at the displacements u (N, dim)."""
        ue, parts = u[self.points.nodes], self.parts
        C, Q, m, _ = self._rows.shape
        x = np.empty((parts.size, C, Q))
        x[: m * parts.dim] = self._linear_parts(ue)
        if not parts.theta:
            return State(x, np.empty((parts.dim, parts.dim, C, 0)))
        volume = self._volume
        if parts.grad and volume.gradient is self.points.gradient:
            sampled = parts.field(x).grad
        else:
            there = (volume.to_gradient @ ue).reshape(C, -1, parts.dim, parts.dim)
            sampled = np.ascontiguousarray(there.transpose(3, 2, 0, 1))
        x[-1] = volume.at_points(sampled)
        return State(x, sampled)

    def field(self, u: Floats) -> Field:
        """The displacements u (N, dim) as the form sees them."""
        return self.parts.field(self.state(u).x)

    def smallest_J(self, u: Floats) -> float:
        """Smallest volume ratio at the samples of theta."""
        return 1.0 + float(volume_change(self.state(u).sampled).min())

    # -- at the points

    def fluxes(self, x: Array) -> Array:
        """s (K, C, Q) at the parts x (K, C, Q) of u."""
        evaluate = fluxes_at_once if self.at_once else fluxes
        return evaluate(self.form, self.parts, x, self.w)

    def derivatives(self, x: Floats) -> Floats:
        """D = ds/d(u, grad u, theta), (K, K, C, Q)."""
        if self.moduli is not None:
            return self.moduli(self.parts.field(x), self.w)
        return complex_step(self.fluxes, x, rank=1)

    # -- of the cells

    def cell_forces(self, u: Floats) -> Floats:
        """Forces on the nodes of each cell, sum of w B^T s, (C, n, dim)."""
        state = self.state(u)
        C, Q, m, n = self._rows.shape
        s = self.fluxes(state.x) * self.points.weight
        flux = s[: m * self.parts.dim].reshape(m, -1, C, Q).transpose(2, 3, 0, 1)
        fe = np.swapaxes(self._rows.reshape(C, Q * m, n), 1, 2) @ flux.reshape(C, Q * m, -1)
        if self.parts.theta:
            fe += self._volume.pressure_forces(state.sampled, s[-1])
        return fe

    def cell_tangents(self, u: Floats, pressure: Floats | None = None) -> Floats:
        """Derivatives of the cells' forces, (C, n dim, n dim), unknowns ordered (node, component).

        With a `pressure` (C, Q) of the iterations (`evfem.newton.pressure`), the curvature of ln J
        is weighted with it instead of the form's own flux of theta.
        """
        state, dim = self.state(u), self.parts.dim
        C, _, m, n = self._rows.shape
        D = self.derivatives(state.x) * self.points.weight
        K = self._gradient_products(D[: m * dim, : m * dim])
        if self.parts.theta:
            volume = self._volume
            push = volume.push(state.sampled)
            K += self._theta_products(D, volume.rows(push)).reshape(K.shape)
            if not volume.small_strain:
                q = self.fluxes(state.x)[-1] if pressure is None else pressure
                K += volume.curvature(push, q * self.points.weight)
        return K.reshape(C, n * dim, n * dim)

    # -- the pressure: the flux of theta

    def pressure(self, u: Floats) -> Floats:
        """Flux q of theta at the points (C, Q)."""
        return self.fluxes(self.state(u).x)[-1]

    def pressure_change(self, u: Floats, du: Floats) -> Floats:
        """Derivative of q at u along du (N, dim), (C, Q)."""
        state, volume = self.state(u), self._volume
        C = len(self.points.nodes)
        D, along = self.derivatives(state.x)[-1], du[self.points.nodes]
        theta = (volume.rows(volume.push(state.sampled)) @ along.reshape(C, -1, 1))[..., 0]
        change: Floats = D[-1] * theta
        return change + (D[:-1] * self._linear_parts(along)).sum(axis=0)

    def cell_pressure_forces(self, u: Floats, q: Floats) -> Floats:
        """What q (C, Q) alone does on the nodes of each cell: q dtheta(v) at u, (C, n, dim)."""
        return self._volume.pressure_forces(self.state(u).sampled, q * self.points.weight)

    def _gradient_products(self, D: Floats) -> Floats:
        """B^T D B of value and gradient, D (m dim, m dim, C, Q), as (C, n, dim, n, dim)."""
        (C, Q, m, n), dim = self._rows.shape, self.parts.dim
        ordered = D.reshape(m, dim, m, dim, C, Q).transpose(4, 5, 0, 1, 3, 2)
        right = ordered.reshape(C, Q, m * dim * dim, m) @ self._rows
        left = np.swapaxes(self._rows.reshape(C, Q * m, n), 1, 2)
        products = left @ right.reshape(C, Q * m, -1)
        return np.ascontiguousarray(products.reshape(C, n, dim, dim, n).swapaxes(3, 4))

    def _theta_products(self, D: Floats, rows: Floats) -> Floats:
        """B^T D B of theta with itself and with value and gradient, (C, n dim, n dim)."""
        right = D[-1, -1][..., None] * rows
        if D[-1, :-1].any():
            right += self._coupled(D[-1, :-1])
        K = np.swapaxes(rows, 1, 2) @ right
        if D[:-1, -1].any():
            K += np.swapaxes(self._coupled(D[:-1, -1]), 1, 2) @ rows
        return K

    def _coupled(self, c: Floats) -> Floats:
        """c (m dim, C, Q) times the rows of value and gradient, (C, Q, n dim)."""
        (C, Q, m, n), dim = self._rows.shape, self.parts.dim
        products = c.reshape(m, dim, C, Q).transpose(2, 3, 1, 0) @ self._rows
        return np.swapaxes(products, 2, 3).reshape(C, Q, n * dim)

    # -- of the mesh

    def forces(self, u: Floats) -> Floats:
        """Nodal forces (N, dim)."""
        return scatter(self.points.nodes, self.cell_forces(u), len(u))

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats) -> None:
        """Add the tangents to the `data` of a pattern."""
        pattern.add(self.cell_tangents(u), self.points.cells, data)


class UserIntegral(Integral):
    """The integral of a user's form; its tangents are the exact ones' symmetric part."""

    def cell_tangents(self, u: Floats, pressure: Floats | None = None) -> Floats:
        """(C, n dim, n dim), unknowns ordered (node, component)."""
        exact = super().cell_tangents(u, pressure)
        return 0.5 * (exact + np.swapaxes(exact, 1, 2))

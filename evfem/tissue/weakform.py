r"""The tissue: internal forces, tangent, energy and stresses of hyperelasticity, in plane strain or in space.

For the energy density :math:`W(F, \theta)`, where :math:`\theta` stands for :math:`\ln J` wherever
the law uses the volume change and is the measure of the element (`evfem.tissue.space`),

.. math:: \delta\Pi = \int (S : \nabla\delta u + q\,\delta\theta)\,dX, \qquad
          S = \partial_F W,\; q = \partial_\theta W .

Each region is an integral of one form: `neo_hookean` for that law, `hyperelastic` for every other,
or the user's own. In the plane forces are per mm of depth, in N/mm, and energies in N.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.mesh import Mesh
from evfem.tensor import det, identity
from evfem.tissue.assembly import Integral, UserIntegral, gathered, points_of, projected
from evfem.tissue.forms import Field, Parts, deformation_gradient, hyperelastic, neo_hookean
from evfem.tissue.kernels.blocks import LANES, loops, padded, unblocked
from evfem.tissue.pattern import Componentwise, Pattern
from evfem.tissue.space import Space, scatter
from evfem.tissue.splitlaw import nearly_incompressible

#: rows and columns of a Cauchy stress as it is stored: in the plane without those to z, which are 0
PLANE_STRESS = ((0, 0), (1, 1), (2, 2), (0, 1))
STRESS = (*PLANE_STRESS, (1, 2), (0, 2))


class Tissue:
    """Internal forces, tangent and stored energy of the regions' laws on a space.

    `laws` maps region names to laws (`evfem.tissue.laws`); built-in neo-Hookean tissue uses the
    compiled loops where they were built.
    """

    def __init__(self, space: Space, laws: Mapping[str, Any]) -> None:
        from evfem.tissue.laws import split

        self.space = space
        self.groups: list[tuple[Any, Ints]] = [
            (split(law, space.dim), space.mesh.cells_of(name)) for name, law in laws.items()
        ]
        self.mu, self.lmbda = _neo_hookean_moduli(space, laws)
        self.loops = loops(space.dim) if self.mu is not None else None

    @cached_property
    def regions(self) -> list[tuple[Any, Integral]]:
        """Law and form of each group."""
        return [make_region(self.space, law, cells) for law, cells in self.groups]

    @cached_property
    def nearly_incompressible(self) -> bool:
        """Whether the pressure of a region is worth an unknown of its own."""
        return any(nearly_incompressible(law, self.space.dim) for law, _ in self.groups)

    def smallest_J(self, u: Floats) -> float:
        """Smallest volume ratio over all sample points."""
        if self.loops is not None:
            return float(self.loops.smallest_J(self.space.cells, np.ascontiguousarray(u)))
        return min(integral.smallest_J(u) for _, integral in self.regions)

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, dim); nan where a cell is inverted."""
        if self.loops is not None:
            out = np.zeros_like(u)
            self.loops.forces(*self._request(u), out)
            return out
        fe = np.empty((*self.space.nodes.shape, self.space.dim))
        for _, integral in self.regions:
            fe[integral.points.cells] = integral.cell_forces(u)
        return scatter(self.space.nodes, fe, self.space.size)

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats, pressure: Floats | None = None) -> None:
        """Add all tangents to the `data` of a pattern; a `pressure` (E, Q) weights ln J's curvature."""
        if self.loops is not None:
            sampled = None if pressure is None else self._sampled_pressure(pressure)
            data += self._shear.data(pattern)
            self.loops.add_tangent(*self._request(u), sampled, pattern.blocks, data)
            return
        for _, integral in self.regions:
            cells = integral.points.cells
            tangents = integral.cell_tangents(u, None if pressure is None else pressure[cells])
            pattern.add(tangents, cells, data)

    def pressure(self, u: Floats) -> Floats:
        """q = dW/dtheta (E, Q) in MPa of the regions' laws, positive in tension."""
        if self.loops is not None:
            return self.lmbda[:, None] * self._theta(self.loops, u, None) - self.mu[:, None]
        q = np.empty(self.space.weight.shape)
        for _, integral in self.regions:
            q[integral.points.cells] = integral.pressure(u)
        return q

    def pressure_change(self, u: Floats, du: Floats) -> Floats:
        """Derivative (E, Q) of `pressure` at u along du (N, dim)."""
        if self.loops is not None:
            return self.lmbda[:, None] * self._theta(self.loops, u, np.ascontiguousarray(du))
        change = np.empty(self.space.weight.shape)
        for _, integral in self.regions:
            change[integral.points.cells] = integral.pressure_change(u, du)
        return change

    def pressure_forces(self, u: Floats, q: Floats) -> Floats:
        """Nodal forces (N, dim) of q (E, Q) alone: the integral of q dtheta(v) at u."""
        if self.loops is not None:
            out = np.zeros_like(u)
            self.loops.volume_forces(
                self.space.cells, np.ascontiguousarray(u), self._sampled_pressure(q), out
            )
            return out
        fe = np.empty((*self.space.nodes.shape, self.space.dim))
        for _, integral in self.regions:
            cells = integral.points.cells
            fe[cells] = integral.cell_pressure_forces(u, q[cells])
        return scatter(self.space.nodes, fe, self.space.size)

    def energy(self, u: Floats) -> float:
        """Stored energy: N mm, in the plane per mm of depth."""
        if self.loops is not None:
            return float(self.loops.forces(*self._request(u), np.zeros_like(u))[0])
        total = 0.0
        for law, integral in self.regions:
            field = integral.field(u)
            psi = law.split_energy(deformation_gradient(field), field.theta)
            total += float(np.sum(psi * integral.points.weight))
        return total

    def energies(self, u: Floats, way: Floats, places: Floats) -> Floats:
        """The same (w,) at u plus the shares `places` (w,) of a way (N, dim)."""
        if self.loops is None:
            return np.array([self.energy(u + s * way) for s in places])
        found, (cells, at, *moduli) = np.empty(len(places)), self._request(u)
        self.loops.energies(
            cells, at, np.ascontiguousarray(way), *moduli, np.ascontiguousarray(places), found
        )
        return found

    def cell_stress(self, u: Floats) -> tuple[Floats, Floats]:
        """Cell means of the Cauchy stress (E, 4) as xx, yy, zz, xy, in space (E, 6) yz, xz; of J (E,)."""
        E = len(self.space.nodes)
        sigma, J = np.empty((E, 4 if self.space.dim == 2 else 6)), np.empty(E)
        for law, integral in self.regions:
            cells, weight = integral.points.cells, integral.points.weight
            mean = weight / weight.sum(axis=1, keepdims=True)
            field = integral.field(u)
            stress = cauchy_stress(law, field)
            sigma[cells] = np.einsum("sdq,dq->ds", stress, mean)
            J[cells] = np.einsum("dq,dq->d", det(deformation_gradient(field)), mean)
        return sigma, J

    def _request(self, u: Floats) -> tuple[Any, ...]:
        """What the compiled loops read: the cells, u and the Lame moduli (B, L)."""
        return self.space.cells, np.ascontiguousarray(u), *self._moduli

    @cached_property
    def _moduli(self) -> tuple[Floats, Floats]:
        return padded(self.mu), padded(self.lmbda)

    def _theta(self, loops: Any, u: Floats, du: Floats | None) -> Floats:
        """theta (E, Q) at u by the compiled loops, or its change along du (N, dim)."""
        cells = self.space.cells
        sampled = np.empty((len(cells.weight), self.space.samples, LANES))
        loops.log_volumes(cells, np.ascontiguousarray(u), du, sampled)
        return projected(self.space.projection, unblocked(sampled, len(self.space.nodes)))

    def _sampled_pressure(self, q: Floats) -> Floats:
        """What a pressure q (E, Q) is at the samples of ln J, in blocks (B, S, L)."""
        return padded(gathered(self.space.projection, q * self.space.weight))

    @cached_property
    def _shear(self) -> Componentwise:
        """mu grad v : grad w, the fraction of the neo-Hookean tangent that does not change."""
        weighted = (self.space.weight * self.mu[:, None])[..., None, None] * self.space.gradient
        rows = np.swapaxes(self.space.gradient, 2, 3).reshape(len(weighted), -1, weighted.shape[2])
        return Componentwise(np.matmul(np.swapaxes(weighted, 2, 3).reshape(rows.shape).swapaxes(1, 2), rows))


def make_region(space: Space, law: Any, cells: Ints) -> tuple[Any, Integral]:
    """A law, and its weak form over some cells."""
    from evfem.tissue.laws import NeoHookean
    from evfem.tissue.splitlaw import FormLaw

    points = points_of(space, cells, small_strain=law.volume_measure == "trace")
    parts = Parts(space.dim, grad=True, theta=True)  # F, S by the gradient, and the volume measure
    if isinstance(law, FormLaw):
        w = SimpleNamespace(x=points.x, n=None, law=None)
        return FormLaw(law.form, w), UserIntegral(law.form, points, parts, w)
    if type(law) is NeoHookean:
        w = SimpleNamespace(law=law, mu=law.mu, lmbda=law.lmbda)
        return law, Integral(neo_hookean, points, parts, w, law_moduli, at_once=True)
    w = SimpleNamespace(law=law)
    return law, Integral(hyperelastic, points, parts, w, law_moduli, at_once=True)


def law_moduli(u: Field, w: Any) -> Floats:
    """Derivatives of the fluxes (S, q) of a law that knows them, (K, K, C, Q)."""
    A, c, k = w.law.split_tangent(deformation_gradient(u), u.theta)
    d, points = len(c), u.theta.shape
    D = np.empty((d * d + 1, d * d + 1, *points))
    # the stacked parts run through the transposed gradient
    D[:-1, :-1].reshape(d, d, d, d, *points)[:] = A.transpose(1, 0, 3, 2, 4, 5)
    D[:-1, -1].reshape(d, d, *points)[:] = np.swapaxes(c, 0, 1)
    D[-1, :-1], D[-1, -1] = D[:-1, -1], k
    return D


def cauchy_stress(law: Any, u: Field) -> Floats:
    """Cauchy stress as xx, yy, zz, xy (4, C, Q) in the plane, with yz, xz (6, C, Q) in space."""
    F, small = deformation_gradient(u), law.volume_measure == "trace"
    S, q = law.split_stress(F, u.theta)
    push, volume = (identity(len(F), 2), 1.0) if small else (F, det(F))

    def component(a: int, b: int) -> Floats:
        if a == len(F):
            return np.asarray(law.split_sigma_zz(F, u.theta))
        total = S[a, 0] * push[b, 0]
        for k in range(1, len(F)):
            total = total + S[a, k] * push[b, k]
        return np.asarray((total + q * (a == b)) / volume)

    return np.stack([component(a, b) for a, b in (PLANE_STRESS if len(F) == 2 else STRESS)])


def _neo_hookean_moduli(space: Space, laws: Mapping[str, Any]) -> tuple[Any, Any]:
    """Lame moduli per cell if every region is neo-Hookean, else (None, None)."""
    from evfem.tissue.laws import NeoHookean

    if not all(type(law) is NeoHookean for law in laws.values()):
        return None, None
    mu, lmbda = np.empty(len(space.nodes)), np.empty(len(space.nodes))
    for name, law in laws.items():
        cells = space.mesh.cells_of(name)
        mu[cells], lmbda[cells] = law.mu, law.lmbda
    return mu, lmbda


def check_laws(mesh: Mesh, laws: Mapping[str, Any]) -> None:
    """Every region needs a law and every law a region, or an `InputError` names the missing one."""
    names: Sequence[str] = sorted(mesh.region_names)
    for name in names:
        if name not in laws:
            raise InputError(
                "finger.materials", f"no material for region {name}", f"one for each of {', '.join(names)}"
            )
    for name in laws:
        if name not in mesh.region_names:
            raise InputError(
                f"finger.materials.{name}",
                describe_value(name),
                f"one of the mesh's regions: {', '.join(names)}",
            )

r"""Weak form of the tissue: internal forces and tangent of plane-strain hyperelasticity.

For the energy density :math:`\psi(F, \theta)`, where :math:`\theta` stands for :math:`\ln J` wherever the law
uses the volume change,

.. math:: \delta\Pi = \int (S : \nabla\delta u + q\,\delta\theta)\,dX, \qquad
          S = \partial_F\psi,\; q = \partial_\theta\psi .

Laws of small strain take the trace of the strain for ln J. The elements differ only in the volume measure:

=========  ====================================================  =============================
element    theta at a quadrature point                           locking at nu -> 1/2
=========  ====================================================  =============================
q1 q2 p2   ln J of that point                                    yes (q1), mild (q2, p2)
q1_fbar    ln J at the centroid, which is F-bar with             no
           Fbar = (J0/J)^(1/2) F (10.1016/0020-7683(95)00259-6)
q2p1       L2 projection of ln J onto {1, X, Y} of the cell      no
=========  ====================================================  =============================

`theta = Pi ln J(samples)` is linear in ln J, hence :math:`\delta\theta = \Pi\,(F^{-T}:\nabla\delta u)`, no
unknown is added, the tangent is symmetric and the forces have a potential. With rows B = (grad u, theta) per
quadrature point and the law's second derivatives D the tangent reads K = B^T D B + (curvature of ln J).
Arrays: E cells, n nodes per cell, Q quadrature points, S sample points of ln J; N nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.tissue.space import Space, scatter


class Tissue:
    """Internal forces, tangent and stored energy of the regions' laws on a space.

    `laws` maps region names to laws (`evfem.tissue.laws`); built-in neo-Hookean tissue uses compiled kernels
    when numba is there.
    """

    def __init__(self, space: Space, laws: Mapping[str, Any]) -> None:
        from evfem.tissue import laws as materials

        self.space = space
        self.groups: list[tuple[Any, Ints]] = [
            (materials.split(law), space.mesh.cells_of(name)) for name, law in laws.items()
        ]
        measures = [(law.volume_measure, cells) for law, cells in self.groups]
        self._small_strain = np.concatenate(
            [c for m, c in measures if m == "trace"] or [np.zeros(0, np.int64)]
        )
        self.mu, self.lmbda = _neo_hookean_moduli(space, laws)
        self.kernels = compiled_kernels("elastic") if self.mu is not None else None
        self._rows: Floats | None = None

    # -- kinematics
    # -------------------------------------------------------------------------------------------------

    def kinematics(self, u: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """F (2, 2, E, Q), theta (E, Q), J at the samples (E, S) and F^-T there (E, S, 4) for u (N, 2)."""
        space = self.space
        ue = np.swapaxes(u[space.nodes], 1, 2)[:, None]
        F = ue @ space.gradient
        Fs = F if space.sample is space.gradient else ue @ space.sample
        trace = Fs[..., 0, 0] + Fs[..., 1, 1]
        # J - 1 keeps the digits that J loses where tissue is nearly incompressible
        change = trace + (Fs[..., 0, 0] * Fs[..., 1, 1] - Fs[..., 0, 1] * Fs[..., 1, 0])
        J = 1.0 + change
        F[..., 0, 0] += 1.0
        F[..., 1, 1] += 1.0
        if Fs is not F:
            Fs[..., 0, 0] += 1.0
            Fs[..., 1, 1] += 1.0
        with np.errstate(invalid="ignore", divide="ignore"):
            log_J = np.log1p(change)
            cofactor = np.stack([Fs[..., 1, 1], -Fs[..., 1, 0], -Fs[..., 0, 1], Fs[..., 0, 0]], axis=-1)
            inverse = cofactor / J[..., None]
        small = self._small_strain
        log_J[small] = trace[small]
        inverse[small] = np.array([1.0, 0.0, 0.0, 1.0])
        theta = log_J if space.projection is None else (space.projection @ log_J[..., None])[..., 0]
        return np.moveaxis(F, (2, 3), (0, 1)), theta, J, inverse

    def smallest_J(self, u: Floats) -> float:
        """Smallest volume ratio over all sample points."""
        if self.kernels is not None:
            return self.kernels.smallest_J(u, self.space.cells)
        return float(self.kinematics(u)[2].min())

    # -- residual, tangent, energy
    # ----------------------------------------------------------------------------------

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, 2) in N per mm of depth; nan where a cell is inverted."""
        if self.kernels is not None:
            return self.kernels.forces(u, *self._blocks)
        F, theta, _, inverse = self.kinematics(u)
        S, q = self._stress(F, theta)
        space, w = self.space, self.space.weight
        fe = np.einsum("ijeq,eqnj,eq->eni", S, space.gradient, w, optimize=True)
        samples = self._to_samples(q * w)
        fe += np.einsum(
            "es,esij,esnj->eni",
            samples,
            inverse.reshape(*inverse.shape[:2], 2, 2),
            space.sample,
            optimize=True,
        )
        return scatter(self.space.nodes, fe, self.space.size)

    def tangent(self, u: Floats) -> Floats:
        """Tangents of all cells, (E, 2 n, 2 n), unknowns ordered (node, component)."""
        if self.kernels is not None:
            return self.kernels.tangent(u, *self._blocks, len(self.space.nodes))
        F, theta, _, inverse = self.kinematics(u)
        _, q = self._stress(F, theta)
        A, c, k = self._moduli(F, theta)
        E, Q = theta.shape
        D = np.empty((E, Q, 5, 5))
        D[..., :4, :4] = np.moveaxis(A.reshape(4, 4, E, Q), (2, 3), (0, 1))
        D[..., :4, 4] = D[..., 4, :4] = np.moveaxis(c.reshape(4, E, Q), 0, -1)
        D[..., 4, 4] = k
        D *= self.space.weight[..., None, None]
        B = self._gradient_rows()
        theta_rows = self._theta_rows(inverse)
        rows = np.concatenate([B, theta_rows[:, :, None]], axis=2)
        flat = rows.reshape(E, Q * 5, -1)
        K = np.swapaxes(flat, 1, 2) @ (D @ rows).reshape(E, Q * 5, -1)
        return K + self._log_curvature(self._to_samples(q * self.space.weight), inverse)

    def energy(self, u: Floats) -> float:
        """Stored energy in N mm per mm of depth."""
        if self.kernels is not None:
            return self.kernels.energy(u, *self._blocks)
        F, theta, _, _ = self.kinematics(u)
        psi = np.empty_like(theta)
        for law, cells in self.groups:
            psi[cells] = law.split_energy(F[:, :, cells], theta[cells])
        return float(np.sum(psi * self.space.weight))

    def cell_stress(self, u: Floats) -> tuple[Floats, Floats]:
        """Means over the reference cells of the Cauchy stress (E, 4) as xx, yy, zz, xy, and of J (E,)."""
        F, theta, _, _ = self.kinematics(u)
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        S, q = self._stress(F, theta)
        sigma = np.empty((*theta.shape, 4))
        push, volume, small = F.copy(), J.copy(), self._small_strain
        push[:, :, small], volume[small] = np.eye(2)[:, :, None, None], 1.0
        for i, a, b in ((0, 0, 0), (1, 1, 1), (3, 0, 1)):
            sigma[..., i] = (S[a, 0] * push[b, 0] + S[a, 1] * push[b, 1] + q * (a == b)) / volume
        for law, cells in self.groups:
            sigma[cells, :, 2] = law.split_sigma_zz(F[:, :, cells], theta[cells])
        w = self.space.weight / self.space.weight.sum(axis=1, keepdims=True)
        return np.einsum("eqs,eq->es", sigma, w), np.einsum("eq,eq->e", J, w)

    # -- pieces
    # -------------------------------------------------------------------------------------------------------

    @cached_property
    def _blocks(self) -> tuple[Any, ...]:
        """What the compiled loops read: Lame moduli (B, L) and the space's cells."""
        from evfem.tissue.kernels.lanes import blocked

        return blocked(self.mu), blocked(self.lmbda), self.space.cells

    def _stress(self, F: Floats, theta: Floats) -> tuple[Floats, Floats]:
        S, q = np.empty_like(F), np.empty_like(theta)
        for law, cells in self.groups:
            S[:, :, cells], q[cells] = law.split_stress(F[:, :, cells], theta[cells])
        return S, q

    def _moduli(self, F: Floats, theta: Floats) -> tuple[Floats, Floats, Floats]:
        A, c, k = np.zeros((2, 2, *F.shape)), np.zeros_like(F), np.empty_like(theta)
        for law, cells in self.groups:
            A[..., cells, :], c[..., cells, :], k[cells] = law.split_tangent(F[:, :, cells], theta[cells])
        return A, c, k

    def _to_samples(self, values: Floats) -> Floats:
        """Transpose of the projection: what acts on theta (E, Q), gathered where ln J is sampled (E, S)."""
        if self.space.projection is None:
            return values
        return (values[:, None] @ self.space.projection)[:, 0]

    def _gradient_rows(self) -> Floats:
        """(E, Q, 4, 2 n): nodal displacements to the components (i, J) of grad u; constant, so built once."""
        if self._rows is None:
            self._rows = gradient_rows(self.space.gradient)
        return self._rows

    def _theta_rows(self, inverse: Floats) -> Floats:
        """(E, Q, 2 n): nodal displacements to the change of theta."""
        space = self.space
        B = (
            self._rows
            if space.sample is space.gradient and self._rows is not None
            else gradient_rows(space.sample)
        )
        rows = (inverse[:, :, None] @ B)[:, :, 0]
        return rows if space.projection is None else space.projection @ rows

    def _log_curvature(self, q: Floats, inverse: Floats) -> Floats:
        """Second derivative of ln J: -F^-T grad(du)^T F^-T : grad(v), weighted with q (E, S)."""
        space = self.space
        q = q.copy()
        q[self._small_strain] = 0.0
        push = space.sample @ np.swapaxes(inverse.reshape(*inverse.shape[:2], 2, 2), -1, -2)
        blocks = -np.einsum("es,esak,esbi->eaibk", q, push, push, optimize=True)
        size = 2 * space.nodes.shape[1]
        return blocks.reshape(len(space.nodes), size, size)


def gradient_rows(gradient: Floats) -> Floats:
    """(E, Q, n, 2) shape gradients to the (E, Q, 4, 2 n) matrix from nodal displacements to grad u."""
    E, Q, n, _ = gradient.shape
    rows = np.zeros((E, Q, 2, 2, n, 2))
    rows[:, :, 0, :, :, 0] = rows[:, :, 1, :, :, 1] = np.swapaxes(gradient, 2, 3)
    return rows.reshape(E, Q, 4, 2 * n)


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


def compiled_kernels(name: str) -> Any:
    """A module of compiled loops of evfem[fast], or None where numba is not installed."""
    try:
        return import_module(f"evfem.tissue.kernels.{name}")
    except ImportError:
        return None


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
                f"finger.materials.{name}", name, f"one of the mesh's regions: {', '.join(names)}"
            )

r"""Time: objective Kelvin-Voigt stress and inertia over one step of backward Euler, as further internal
forces.

With the time step :math:`\Delta t`, the strain :math:`E = (F^T F - 1)/2` and the state (u_0, v_0) before the
step,

.. math:: P_v = F S_v, \quad S_v = 2\eta\,(E - E_0)/\Delta t, \quad \eta = \tau\mu; \qquad
          f = M\,(v - v_0)/\Delta t, \quad v = (u - u_0)/\Delta t .

Only the shear modulus enters the viscosity, so nothing locks. The step dissipates :math:`\int S_v : (E -
E_0)`. A step that takes no time has neither term.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.tissue.laws import split
from evfem.tissue.space import ELEMENTS, Space, scatter, scikit_mesh, shape_functions
from evfem.tissue.weakform import compiled_kernels, gradient_rows


class Dynamics:
    """Viscous and inertial forces of a body; `begin` sets the step, then it acts like any other term of
    the internal forces.
    """

    def __init__(self, space: Space, viscosity: Floats | None, density: Floats | None) -> None:
        """`viscosity` (E,) eta in MPa s per cell, `density` (E,) in t/mm3 per cell; None leaves the term
        out.
        """
        self.space = space
        self.viscosity = viscosity
        self.mass = None if density is None else mass_matrices(space) * density[:, None, None]
        self._inertia = None if self.mass is None else assembled(space, self.mass)
        self.kernels = compiled_kernels("viscous") if viscosity is not None else None
        self.step: float = 0.0
        self._u0 = self._v0 = np.zeros((space.size, 2))
        self._strain0: Floats = np.zeros((*space.weight.shape, 2, 2))

    def begin(self, u: Floats, velocity: Floats, step: float) -> None:
        """Start a step of `step` seconds (0: no time passes) from displacements and velocities (N, 2)."""
        self.step, self._u0, self._v0 = step, u, velocity
        if step > 0.0 and self.viscosity is not None:
            self._strain0 = self._strain(u)

    @property
    def beginning(self) -> tuple[Floats, float]:
        """Displacements (N, 2) that the step began with, and its seconds."""
        return self._u0, self.step

    def forces(self, u: Floats) -> Floats:
        """Nodal forces (N, 2) in N per mm of depth."""
        total = np.zeros_like(u)
        if self.step == 0.0:
            return total
        if self.viscosity is not None and self.kernels is not None:
            total += self.kernels.forces(u, *self._blocks())
        elif self.viscosity is not None:
            F = self._gradient(u)
            P = F @ self._stress(F) * self.space.weight[..., None, None]
            total += scatter(
                self.space.nodes,
                np.einsum("eqij,eqnj->eni", P, self.space.gradient, optimize=True),
                self.space.size,
            )
        if self._inertia is not None:
            total += self._inertia @ ((u - self._u0) / self.step**2 - self._v0 / self.step)
        return total

    def add_tangent(self, u: Floats, cells: Floats) -> None:
        """Add the terms' tangents to the cell matrices (E, 2 n, 2 n)."""
        if self.step == 0.0:
            return
        E, Q, n, _ = self.space.gradient.shape
        if self.viscosity is not None and self.kernels is not None:
            self.kernels.add_tangent(u, *self._blocks(), cells)
        elif self.viscosity is not None:
            F = self._gradient(u)
            S, rate = self._stress(F), (self.viscosity / self.step)[:, None, None, None, None, None]
            unit = np.eye(2)
            D = np.einsum("ik,eqjl->eqijkl", unit, S)
            D += rate * (
                np.einsum("eqil,eqkj->eqijkl", F, F)
                + np.einsum("eqim,eqkm,jl->eqijkl", F, F, unit, optimize=True)
            )
            D *= self.space.weight[..., None, None, None, None]
            rows = gradient_rows(self.space.gradient)
            flat = rows.reshape(E, Q * 4, 2 * n)
            cells += np.swapaxes(flat, 1, 2) @ (D.reshape(E, Q, 4, 4) @ rows).reshape(E, Q * 4, 2 * n)
        if self.mass is not None:
            cells[:, 0::2, 0::2] += self.mass / self.step**2
            cells[:, 1::2, 1::2] += self.mass / self.step**2

    def velocity(self, u: Floats) -> Floats:
        """Nodal velocities (N, 2) in mm/s at the end of the step; zero when no time passes."""
        return (u - self._u0) / self.step if self.step > 0.0 else np.zeros_like(u)

    def dissipation(self, u: Floats) -> float:
        """What the viscous stress dissipates in the step, N mm per mm of depth."""
        if self.step == 0.0 or self.viscosity is None:
            return 0.0
        change = self._strain(u) - self._strain0
        if self.kernels is not None:
            rate, cells, _ = self._blocks()
            squares = np.einsum("bqjl,bqjl,j->bql", change, change, np.array([1.0, 1.0, 2.0]))
            return float(np.einsum("bl,bql,bql->", 2.0 * rate, squares, cells.weight))
        squares = np.einsum("eqij,eqij->eq", change, change)
        return float(np.einsum("e,eq,eq->", 2.0 * self.viscosity / self.step, squares, self.space.weight))

    def kinetic_energy(self, velocity: Floats) -> float:
        """Kinetic energy of nodal velocities (N, 2), N mm per mm of depth."""
        if self._inertia is None:
            return 0.0
        return float(0.5 * np.sum(velocity * (self._inertia @ velocity)))

    def _gradient(self, u: Floats) -> Floats:
        """F (E, Q, 2, 2)."""
        F = np.swapaxes(u[self.space.nodes], 1, 2)[:, None] @ self.space.gradient
        F[..., 0, 0] += 1.0
        F[..., 1, 1] += 1.0
        return F

    def _strain(self, u: Floats) -> Floats:
        """Green strain of every point: (E, Q, 2, 2), or in blocks where the compiled loops read it."""
        return (
            strain(self._gradient(u)) if self.kernels is None else self.kernels.strains(u, self.space.cells)
        )

    def _blocks(self) -> tuple[Any, ...]:
        """What the compiled loops read: viscosity over the step (B, L), cells, strains before the step."""
        from evfem.tissue.kernels.lanes import blocked

        assert self.viscosity is not None
        return blocked(self.viscosity / self.step), self.space.cells, self._strain0

    def _stress(self, F: Floats) -> Floats:
        assert self.viscosity is not None
        return 2.0 * (self.viscosity / self.step)[:, None, None, None] * (strain(F) - self._strain0)


def strain(F: Floats) -> Floats:
    """Green strain (..., 2, 2) of F (..., 2, 2)."""
    return 0.5 * (np.swapaxes(F, -1, -2) @ F - np.eye(2))


def assembled(space: Space, matrices: Floats) -> Any:
    """Sparse matrix (N, N) of cell matrices (E, n, n)."""
    import scipy.sparse as sparse

    n = space.nodes.shape[1]
    rows, columns = np.repeat(space.nodes, n, axis=1).ravel(), np.tile(space.nodes, (1, n)).ravel()
    return sparse.coo_matrix((matrices.ravel(), (rows, columns)), (space.size, space.size)).tocsr()


def mass_matrices(space: Space) -> Floats:
    """Consistent mass matrices per unit density (E, n, n) in mm2."""
    import skfem

    kind, intorder, _ = ELEMENTS[space.element]
    shape = shape_functions(kind)
    basis = skfem.Basis(scikit_mesh(space.mesh), shape, intorder=intorder)
    N = np.stack([np.broadcast_to(basis.basis[a][0], basis.dx.shape) for a in range(basis.Nbfun)])
    return np.einsum("aeq,beq,eq->eab", N, N, basis.dx, optimize=True)


def make_dynamics(space: Space, laws: Mapping[str, Any], viscosity: float, inertia: bool) -> Dynamics | None:
    """The time-dependent terms that the laws ask for, or None if there are none; `viscosity` is the laws'
    default relaxation time (s).
    """
    eta, density = np.zeros(len(space.nodes)), np.zeros(len(space.nodes))
    for name, law in laws.items():
        cells = space.mesh.cells_of(name)
        own = getattr(law, "viscosity", None)
        tau = viscosity if own is None else own
        if tau:
            eta[cells] = tau * split(law).shear_modulus
        density[cells] = getattr(law, "density", 1e-9)
    if not eta.any() and not inertia:
        return None
    return Dynamics(space, eta if eta.any() else None, density if inertia else None)

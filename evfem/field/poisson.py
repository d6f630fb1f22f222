r"""Poisson's problem between a grounded body and an electrode under a slab, and forces by virtual work.

.. math:: \int \varepsilon\, \nabla\varphi\cdot\nabla v = 0, \qquad
          \varphi = 0 \text{ on the body}, \quad \varphi = U \text{ on the electrode},

with elements of order `ORDER` on the mapped quadrilaterals of `evfem.field.fieldmesh`.
The co-energy at unit voltage is half the capacitance,

.. math:: C = \varepsilon_0 \int \varepsilon\, |\nabla\varphi|^2 ,

from above, as the discrete potential is one of those over which the exact one is the minimum. The
force is its exact derivative at fixed potentials when the mesh moves with velocity V (Henrotte and
Hameyer 2004, doi:10.1016/j.cam.2003.06.012),

.. math:: F = -\int T : \nabla V, \qquad T = \varepsilon_0 \varepsilon\,
          (E \otimes E - \tfrac12 |E|^2 I), \qquad E = -\nabla\varphi,

never an integral of surface values, which corners would spoil.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sparse

from evfem.common.arrays import Floats, Ints, linalg
from evfem.electrostatics.laws import eps_0
from evfem.field.fieldmesh import FieldMesh
from evfem.tensor import dot, identity

#: polynomial order of the elements
ORDER = 3


def poisson(u: Any, v: Any, w: Any) -> Any:
    """eps grad u . grad v."""
    return w.eps * dot(u.grad, v.grad)


def virtual_work(w: Any) -> Any:
    """-T : grad V of the potential `w.phi` where the mesh moves up with the velocity `w.lift`."""
    E = -w.phi.grad
    T = w.eps * (E[:, None] * E[None] - 0.5 * dot(E, E) * identity(2, E.ndim - 1))
    return -dot(T[1], w.lift.grad)


@dataclass(frozen=True, eq=False)
class Potential:
    """A discrete potential: values `phi` of the unknowns of `space`, 1 on the electrode."""

    space: Space
    phi: Floats

    @classmethod
    def of(cls, space: Space) -> Potential:
        """The solution of Poisson's problem."""
        return cls(space, space.solve())

    @property
    def capacitance(self) -> float:
        """Capacitance in F per m of depth, numerically N/V^2."""
        return float(eps_0 * self.phi @ (self.space.stiffness @ self.phi))

    @property
    def force(self) -> float:
        """Force in N/mm at 1 V along y on the body, which moves with the mesh's `lift`."""
        import skfem

        space = self.space
        values = {
            "phi": space.basis.interpolate(self.phi),
            "lift": space.vertices.interpolate(space.mesh.lift),
        }
        return float(eps_0 * skfem.Functional(virtual_work).assemble(space.basis, eps=space.eps, **values))

    def values(self, x: Floats, y: Floats) -> Floats:
        """Potential (...) at places (...) in mm."""
        return self._sampled(x, y, 0)

    def gradients(self, x: Floats, y: Floats) -> Floats:
        """Gradient (2, ...) at places (...) in mm; above the air's upper end, at that end."""
        return self._sampled(x, y, 1)

    def in_cells(self) -> Floats:
        """Gradient (2, m) in the middle of each cell."""
        cells = np.arange(self.space.mesh.cells.shape[1])
        return self._shaped(cells, np.full((2, cells.size), 0.5), 1)

    def _sampled(self, x: Floats, y: Floats, order: int) -> Floats:
        cells, local = self.space.mesh.located(x.ravel(), y.ravel())
        found = self._shaped(cells, local, order)
        return found.reshape(((2,) if order else ()) + x.shape)

    def _shaped(self, cells: Ints, local: Floats, order: int) -> Floats:
        """Values (n,) or gradients (2, n) in cells (n,) at coordinates (2, n) in them."""
        basis = self.space.basis
        total = 0.0
        for k in range(basis.Nbfun):
            shape = basis.elem.gbasis(basis.mapping, local[:, :, None], k, tind=cells)[0]
            part = shape.grad if order else np.asarray(shape)
            total = total + self.phi[basis.element_dofs[k, cells]] * part[..., 0]
        return np.asarray(total)


class Space:
    """Elements on a field's mesh, assembled."""

    def __init__(self, mesh: FieldMesh, eps_r: float) -> None:
        import skfem

        self.mesh = mesh
        grid = skfem.MeshQuad(mesh.points, mesh.cells, sort_t=False, validate=False)
        self.basis = skfem.CellBasis(grid, skfem.ElementQuadP(ORDER), intorder=2 * ORDER)
        self.vertices = self.basis.with_element(skfem.ElementQuad1())
        points = self.basis.X.shape[1]
        self.eps = np.repeat(1.0 + (eps_r - 1.0) * mesh.in_slab, points).reshape(-1, points)

    @cached_property
    def stiffness(self) -> Any:
        """Matrix of `poisson`."""
        import skfem

        return skfem.BilinearForm(poisson).assemble(self.basis, eps=self.eps).tocsr()

    def solve(self) -> Floats:
        """Potential that is 0 on the body and 1 on the electrode."""
        phi, fixed, master = self.conditions()
        free = np.setdiff1d(master, fixed)
        slave = np.flatnonzero(np.isin(master, free))
        T = sparse.csr_matrix(
            (np.ones(slave.size), (slave, np.searchsorted(free, master[slave]))), shape=(phi.size, free.size)
        )
        return np.asarray(phi + T @ solve_spd(T.T @ self.stiffness @ T, -(T.T @ (self.stiffness @ phi))))

    def conditions(self) -> tuple[Floats, Ints, Ints]:
        """Values of the potential where held, and each unknown's master: itself, or its periodic twin."""
        mesh, grid = self.mesh, self.basis.mesh
        facets = grid.boundary_facets()
        row, line = mesh.row[grid.facets[:, facets]], mesh.line[grid.facets[:, facets]]
        rows, lines = mesh.shape
        left, right = (np.all(line == end, axis=0) for end in (0, lines))
        electrode = np.all(row == 0, axis=0)
        master = np.arange(self.basis.N)
        if mesh.periodic:
            twins = [facets[side][np.argsort(row[0, side])] for side in (left, right)]
            pairs = min(twin.size for twin in twins)
            self._join(master, *(twin[:pairs] for twin in twins))
            paired = np.isin(facets, np.concatenate([twin[:pairs] for twin in twins]))
        else:
            electrode |= left | right | np.all(row == rows, axis=0)
            paired = np.zeros(facets.size, dtype=bool)
        phi = np.zeros(self.basis.N)
        body = self.basis.get_dofs(facets[~(electrode | paired)]).all()
        plate = self.basis.get_dofs(facets[electrode]).all()
        phi[self.basis.nodal_dofs[0, np.unique(grid.facets[:, facets[electrode]])]] = 1.0
        return phi, np.union1d(body, plate), master

    def _join(self, master: Ints, left: Ints, right: Ints) -> None:
        """Tell the unknowns of the facets on the right end of a period their twins."""
        basis, grid = self.basis, self.basis.mesh
        master[basis.facet_dofs[:, right]] = basis.facet_dofs[:, left]
        for k in (0, 1):
            vertices = [np.sort(grid.facets[:, side], axis=0)[k] for side in (right, left)]
            master[basis.nodal_dofs[0, vertices[0]]] = basis.nodal_dofs[0, vertices[1]]


def solve_spd(matrix: Any, b: Floats) -> Floats:
    """Solution of a symmetric positive definite system."""
    linalg()  # whose BLAS SuperLU uses
    from scipy.sparse.linalg import splu

    factors = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
        options={"SymmetricMode": True, "Equil": False},
    )  # fmt: skip
    return np.asarray(factors.solve(b))

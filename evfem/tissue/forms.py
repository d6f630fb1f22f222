r"""A user's weak form as part of the internal forces: residual integrand only, exact tangent by complex step.

The integrand f(u, v, w) is linear in (v, grad v), so unit test values give its six fluxes :math:`s = \partial
f/\partial(v, \nabla v)`; a complex step on each of (u, grad u) gives their derivatives D (6 x 6). With rows B
from nodal displacements to (u, grad u) the cell forces and tangents are :math:`\sum_q w B^T s` and
:math:`\sum_q w B^T D B`, over a region or over a named boundary, in the reference configuration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.tissue.space import ELEMENTS, Space, scatter, scikit_mesh, shape_functions

STEP = 1e-30


@dataclass(frozen=True, eq=False)
class FormTerm:
    """A form on a space: `cells` (C,) it touches, `rows` (C, Q, 6, 2 n) to (u_x, u_y, du_x/dX, du_x/dY,
    du_y/dX, du_y/dY), `weight` (C, Q).
    """

    function: Callable[[Any, Any, Any], Any]
    cells: Ints
    nodes: Ints
    rows: Floats
    weight: Floats
    context: Any

    def forces(self, u: Floats) -> Floats:
        """Internal nodal forces (N, 2) of the form."""
        values = self._values(u)
        flux = np.stack([self._flux(values, k) for k in range(6)], axis=-1)
        fe = np.einsum("cq,cqk,cqkd->cd", self.weight, flux, self.rows, optimize=True).reshape(
            *self.nodes.shape, 2
        )
        return scatter(self.nodes, fe, len(u))

    def add_tangent(self, u: Floats, cells: Floats) -> None:
        """Add the form's tangents to the cell matrices (E, 2 n, 2 n) of the whole mesh."""
        values = self._values(u).astype(complex)
        D = np.empty((*self.weight.shape, 6, 6))
        for j in range(6):
            values[j] += 1j * STEP
            for i in range(6):
                D[..., i, j] = np.imag(self._flux(values, i)) / STEP
            values[j] -= 1j * STEP
        weighted = np.einsum("cq,cqij->cqij", self.weight, D)
        C, Q, _, d = self.rows.shape
        flat = self.rows.reshape(C, Q * 6, d)
        np.add.at(cells, self.cells, np.swapaxes(flat, 1, 2) @ (weighted @ self.rows).reshape(C, Q * 6, d))

    def _values(self, u: Floats) -> Any:
        ue = u[self.nodes].reshape(len(self.nodes), -1)
        return np.moveaxis(np.einsum("cqkd,cd->cqk", self.rows, ue), -1, 0).copy()

    def _flux(self, values: Any, k: int) -> Any:
        unit = np.zeros((6, *self.weight.shape))
        unit[k] = 1.0
        return np.broadcast_to(self.function(_field(values), _field(unit), self.context), self.weight.shape)


def _field(values: Any) -> Any:
    """Value (2, C, Q) with its gradient (2, 2, C, Q) beside it, as scikit-fem hands fields to forms."""
    from skfem.element import DiscreteField

    return DiscreteField(value=values[:2], grad=values[2:].reshape(2, 2, *values.shape[1:]))


def make_term(space: Space, function: Callable[[Any, Any, Any], Any], on: str, boundary: bool) -> FormTerm:
    """A form over the region, or over the outer edges of the boundary, called `on`."""
    import skfem

    kind, intorder, _ = ELEMENTS[space.element]
    shape = shape_functions(kind)
    mesh, grid = space.mesh, scikit_mesh(space.mesh)
    if boundary:
        if on not in mesh.node_sets:
            raise InputError(
                "boundary", on, f"one of the mesh's boundaries: {', '.join(sorted(mesh.node_sets))}"
            )
        basis = skfem.FacetBasis(grid, shape, facets=_facets(space, grid, on), intorder=intorder)
        cells = basis.tind
    else:
        if on not in mesh.region_names:
            raise InputError(
                "region", on, f"one of the mesh's regions: {', '.join(sorted(mesh.region_names))}"
            )
        cells = mesh.cells_of(on)
        basis = skfem.Basis(grid, shape, elements=cells, intorder=intorder)
    value = np.stack([np.broadcast_to(basis.basis[a][0], basis.dx.shape) for a in range(basis.Nbfun)])
    grad = np.stack(
        [np.broadcast_to(basis.basis[a][0].grad, (2, *basis.dx.shape)) for a in range(basis.Nbfun)]
    )
    rows = np.zeros((*basis.dx.shape, 6, basis.Nbfun, 2))
    rows[:, :, 0, :, 0] = rows[:, :, 1, :, 1] = np.moveaxis(value, 0, -1)
    for i in range(2):
        rows[:, :, 2 + i, :, 0] = rows[:, :, 4 + i, :, 1] = np.moveaxis(grad[:, i], 0, -1)
    normals = np.asarray(basis.normals) if boundary else None
    context = SimpleNamespace(x=np.asarray(basis.global_coordinates()), n=normals)
    flat = rows.reshape(*basis.dx.shape, 6, 2 * basis.Nbfun)
    return FormTerm(function, cells, space.nodes[cells], flat, np.asarray(basis.dx), context)


def _facets(space: Space, grid: Any, name: str) -> Ints:
    """scikit-fem facets of a named boundary: outer edges all of whose nodes belong to it."""
    ends = np.sort(space.mesh.edges_of(name)[:, :2], axis=1)
    vertices = np.unique(space.mesh.cells[:, : space.mesh.corners])
    ours = vertices[np.sort(grid.facets, axis=0)].T
    size = space.size
    facets = np.flatnonzero(np.isin(ours[:, 0] * size + ours[:, 1], ends[:, 0] * size + ends[:, 1]))
    if not facets.size:
        raise InputError("boundary", name, "a boundary with at least one outer edge")
    return facets

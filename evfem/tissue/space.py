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

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh

#: element -> (mesh kind, order of quadrature, how ln J is sampled)
ELEMENTS: Mapping[str, tuple[str, int, str]] = {
    "q1": ("quad", 3, "point"),
    "q1_fbar": ("quad", 3, "centroid"),
    "q2": ("quad9", 5, "point"),
    "q2p1": ("quad9", 5, "linear"),
    "p2": ("triangle6", 4, "point"),
}


def element_for(mesh: Mesh, element: str | None) -> str:
    """Name of the element to use on `mesh`: the given one if it fits the cells, else the recommended
    default.
    """
    if element is None:
        return "q2p1" if mesh.corners == 4 else "p2"
    if element not in ELEMENTS or (ELEMENTS[element][0].startswith("quad") != (mesh.corners == 4)):
        allowed = [
            name for name, (kind, *_) in ELEMENTS.items() if kind.startswith("quad") == (mesh.corners == 4)
        ]
        raise InputError("solver.element", element, f"on {mesh.kind} cells: {', '.join(allowed)}")
    return element


def scikit_mesh(mesh: Mesh) -> Any:
    """The same mesh as a scikit-fem mesh, its nodes where ours are (curved mid-nodes included)."""
    import skfem

    linear = {4: skfem.MeshQuad, 3: skfem.MeshTri}[mesh.corners]
    vertices, t = np.unique(mesh.cells[:, : mesh.corners], return_inverse=True)
    base = linear(
        np.ascontiguousarray(mesh.points[vertices].T), np.ascontiguousarray(t.reshape(-1, mesh.corners).T)
    )
    if mesh.order == 1:
        return base
    quadratic = {4: skfem.MeshQuad2, 3: skfem.MeshTri2}[mesh.corners].from_mesh(base)
    _, ours = cKDTree(straight_points(mesh)).query(quadratic.doflocs.T)
    return type(quadratic)(np.ascontiguousarray(mesh.points[ours].T), quadratic.t)


def straight_points(mesh: Mesh) -> Floats:
    """Where the nodes would be if every edge were straight, (N, 2); tells nodes apart whatever the
    curvature.
    """
    points = mesh.points.copy()
    if mesh.order == 2:
        m = mesh.corners
        corner = mesh.points[mesh.cells[:, :m]]
        points[mesh.cells[:, m : 2 * m]] = 0.5 * (corner + np.roll(corner, -1, axis=1))
        if m == 4:
            points[mesh.cells[:, 8]] = corner.mean(axis=1)
    return points


@dataclass(frozen=True, eq=False)
class Space:
    """Displacement space on a mesh: nodes of every cell, gradients of the shape functions, weights and ln J
    samples.

    `nodes` (E, n); `gradient` (E, Q, n, 2) with respect to the reference; `weight` (E, Q); `sample` (E, S, n,
    2) gradients where ln J is sampled; `projection` (E, Q, S), or None where theta is simply ln J of the
    quadrature point.
    """

    mesh: Mesh
    element: str
    nodes: Ints
    gradient: Floats
    weight: Floats
    sample: Floats
    projection: Floats | None

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.mesh.points)

    @cached_property
    def cells(self) -> Any:
        """The same arrays in blocks, for the compiled loops."""
        from evfem.tissue.kernels.lanes import Cells, blocked

        pointwise = np.zeros((len(self.nodes), 0, 0))
        sample = self.gradient[:, :0] if self.sample is self.gradient else self.sample
        projection = pointwise if self.projection is None else self.projection
        arrays = (self.nodes, self.gradient, self.weight, sample, projection)
        return Cells(*(blocked(array) for array in arrays))


def make_space(mesh: Mesh, element: str) -> Space:
    """Build the space of `element` on `mesh`, whose kind must fit; inverted cells are refused."""
    import skfem

    kind, intorder, sampling = ELEMENTS[element]
    if mesh.kind != kind:
        raise InputError("solver.element", element, f"cells of kind {kind}, the mesh has {mesh.kind}")
    shape = shape_functions(kind)
    grid = scikit_mesh(mesh)
    basis = skfem.Basis(grid, shape, intorder=intorder)
    _, node_of_dof = cKDTree(mesh.points).query(basis.doflocs.T)
    nodes = node_of_dof[basis.element_dofs].T
    gradient = _gradients(basis)
    check_orientation(mesh, basis)
    projection = None
    sample = gradient
    if sampling == "centroid":
        centre = skfem.Basis(grid, shape, quadrature=(np.array([[0.5], [0.5]]), np.array([1.0])))
        sample = _gradients(centre)
        projection = np.ones((len(nodes), gradient.shape[1], 1))
    elif sampling == "linear":
        projection = _linear_projection(np.asarray(basis.global_coordinates()), basis.dx)
    return Space(
        mesh,
        element,
        np.ascontiguousarray(nodes),
        gradient,
        np.ascontiguousarray(basis.dx),
        sample,
        projection,
    )


def shape_functions(kind: str) -> Any:
    """scikit-fem's shape functions on cells of a kind."""
    import skfem

    return {"quad": skfem.ElementQuad1, "quad9": skfem.ElementQuad2, "triangle6": skfem.ElementTriP2}[kind]()


def scatter(nodes: Ints, fe: Floats, size: int) -> Floats:
    """Sum of cell forces (E, n, 2) on the nodes (E, n) they belong to, (size, 2)."""
    flat = nodes.ravel()
    return np.stack([np.bincount(flat, fe[..., i].ravel(), size) for i in (0, 1)], axis=1)


def _gradients(basis: Any) -> Floats:
    """Shape gradients of a scalar basis as (E, Q, n, 2)."""
    fields = [basis.basis[a][0].grad for a in range(basis.Nbfun)]
    shape = np.broadcast_shapes(*(f.shape for f in fields))
    return np.ascontiguousarray(np.stack([np.broadcast_to(f, shape) for f in fields]).transpose(2, 3, 0, 1))


def check_orientation(mesh: Mesh, basis: Any) -> None:
    """Refuse inverted cells: scikit-fem takes the absolute determinant, so they would pass silently."""
    sign = np.sign(np.linalg.det(np.moveaxis(np.asarray(basis.mapping.DF(basis.X)), (0, 1), (2, 3))))
    bad = np.flatnonzero((sign * np.median(sign, axis=1, keepdims=True) <= 0).any(axis=1))
    if bad.size:
        centre = mesh.points[mesh.cells[bad[0]]].mean(axis=0)
        raise InputError(
            "finger.mesh",
            f"{bad.size} tangled cells, the first near ({centre[0]:.3g}, {centre[1]:.3g})",
            "cells with a positive Jacobian at every quadrature point",
        )


def _linear_projection(x: Floats, weight: Floats) -> Floats:
    """Per cell the (Q, Q) matrix that takes point values to their L2 projection onto {1, X, Y}, at the
    same points.
    """
    centred = x - x.mean(axis=2, keepdims=True)
    centred = centred / np.abs(centred).max(axis=(0, 2), keepdims=True)
    phi = np.stack([np.ones_like(weight), centred[0], centred[1]], axis=-1)
    weighted = phi * weight[..., None]
    mass = np.swapaxes(phi, 1, 2) @ weighted
    return np.ascontiguousarray(phi @ np.linalg.solve(mass, np.swapaxes(weighted, 1, 2)))

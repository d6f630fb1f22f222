r"""Displacement spaces: shape functions at quadrature points, and how an element measures its
volume.

An element sees the change of volume through `theta`, which stands for :math:`\ln J` in its weak
form (laws of small strain take the trace of the strain for ln J). The elements differ only in this
measure:

=========  ====================================================  =============================
element    theta at a quadrature point                           locking at nu -> 1/2
=========  ====================================================  =============================
q1 q2 p2   ln J of that point                                    yes (q1), mild (q2, p2)
q1_fbar    ln J at the centroid, which is F-bar with             no
           Fbar = (J0/J)^(1/2) F (10.1016/0020-7683(95)00259-6)
q2p1       L2 projection of ln J onto {1, X, Y} of the cell      no
=========  ====================================================  =============================

`theta = Pi ln J(samples)` is linear in ln J, hence
:math:`\delta\theta = \Pi\,(F^{-T}:\nabla\delta u)`, no unknown is added, the tangent is symmetric
and the forces have a potential. Arrays: E cells, n nodes per cell, Q quadrature points, S sample
points of ln J; N nodes; dim dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh
from evfem.tissue.elements import ELEMENTS


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
    ours = nodes_at(straight_points(mesh), quadratic.doflocs.T)
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


def nodes_at(points: Floats, places: Floats) -> Ints:
    """Numbers of the points (N, dim) that lie at the places (M, dim), where scikit-fem has its
    unknowns.

    Raises `RuntimeError` where none lies within 1e-9 of the mesh's size: then the two meshes
    differ.
    """
    distance, number = cKDTree(points).query(places)
    farthest, allowed = float(np.max(distance)), 1e-9 * float(np.ptp(points, axis=0).max())
    if not farthest <= allowed:
        raise RuntimeError(f"a node of scikit-fem's mesh is {farthest:g} mm away from the nearest of ours")
    return number


@dataclass(frozen=True, eq=False)
class Space:
    """Displacement space on a mesh: nodes of every cell, shape functions and their gradients,
    weights and ln J samples.

    `nodes` (E, n); `points` (dim, E, Q) the quadrature points; `value` (E, Q, n); `gradient` (E,
    Q, n, dim) with respect to the reference; `weight` (E, Q); `sample` (E, S, n, dim) gradients
    where ln J is sampled, the same array as `gradient` where those are the quadrature points;
    `projection` (E, Q, S), or None where theta is simply ln J of the quadrature point.
    """

    mesh: Mesh
    element: str
    nodes: Ints
    points: Floats
    value: Floats
    gradient: Floats
    weight: Floats
    sample: Floats
    projection: Floats | None

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.mesh.points)

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return self.mesh.points.shape[1]

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
    nodes = nodes_at(mesh.points, basis.doflocs.T)[basis.element_dofs].T
    gradient = shape_gradients(basis)
    check_orientation(mesh, basis)
    projection = None
    sample = gradient
    if sampling == "centroid":
        centre = skfem.Basis(grid, shape, quadrature=(np.array([[0.5], [0.5]]), np.array([1.0])))
        sample = shape_gradients(centre)
        projection = np.ones((len(nodes), gradient.shape[1], 1))
    elif sampling == "linear":
        projection = _linear_projection(np.asarray(basis.global_coordinates()), basis.dx)
    elif sampling != "point":
        raise ValueError(f"no such sampling of the volume: {sampling}")
    points, weight = np.asarray(basis.global_coordinates()), np.ascontiguousarray(basis.dx)
    return Space(
        mesh,
        element,
        np.ascontiguousarray(nodes),
        points,
        shape_values(basis),
        gradient,
        weight,
        sample,
        projection,
    )


def shape_functions(kind: str) -> Any:
    """scikit-fem's shape functions on cells of a kind."""
    import skfem

    return {"quad": skfem.ElementQuad1, "quad9": skfem.ElementQuad2, "triangle6": skfem.ElementTriP2}[kind]()


def scatter(nodes: Ints, fe: Floats, size: int) -> Floats:
    """Sum of cell forces (E, n, dim) on the nodes (E, n) they belong to, (size, dim)."""
    flat = nodes.ravel()
    return np.stack([np.bincount(flat, fe[..., i].ravel(), size) for i in range(fe.shape[2])], axis=1)


def shape_values(basis: Any) -> Floats:
    """Shape functions of a scalar basis as (E, Q, n)."""
    return np.stack([np.broadcast_to(basis.basis[a][0], basis.dx.shape) for a in range(basis.Nbfun)], axis=-1)


def shape_gradients(basis: Any) -> Floats:
    """Shape gradients of a scalar basis as (E, Q, n, dim)."""
    fields = [basis.basis[a][0].grad for a in range(basis.Nbfun)]
    shape = np.broadcast_shapes(*(f.shape for f in fields))
    return np.ascontiguousarray(np.stack([np.broadcast_to(f, shape) for f in fields]).transpose(2, 3, 0, 1))


def check_orientation(mesh: Mesh, basis: Any) -> None:
    """Refuse inverted cells: scikit-fem takes the absolute determinant, so they would pass
    silently.
    """
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
    """Per cell the (Q, Q) matrix that takes point values to their L2 projection onto {1, X, Y[,
    Z]}, at the same points x (dim, E, Q).
    """
    centred = x - x.mean(axis=2, keepdims=True)
    centred = centred / np.abs(centred).max(axis=(0, 2), keepdims=True)
    phi = np.stack([np.ones_like(weight), *centred], axis=-1)
    weighted = phi * weight[..., None]
    mass = np.swapaxes(phi, 1, 2) @ weighted
    return np.ascontiguousarray(phi @ np.linalg.solve(mass, np.swapaxes(weighted, 1, 2)))

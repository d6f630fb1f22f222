r"""Displacement spaces: shape functions at quadrature points, and how an element measures its volume.

An element sees the change of volume through `theta`, which stands for :math:`\ln J` in its weak form (laws of
small strain take the trace of the strain for ln J). The elements differ only in this measure:

=========  ====================================================  =============================
element    theta at a quadrature point                           locking at nu -> 1/2
=========  ====================================================  =============================
q1 q2 p2   ln J of that point                                    yes (q1), mild (q2, p2)
q1_fbar    ln J at the centroid, which is F-bar with             no
           Fbar = (J0/J)^(1/2) F (10.1016/0020-7683(95)00259-6)
q2p1       L2 projection of ln J onto {1, X, Y} of the cell      no
hex8       ln det of the mean of F over the cell                 no
hex27p1    L2 projection of ln J onto {1, X, Y, Z} of the cell   no
=========  ====================================================  =============================

On hexahedra that are no parallelepipeds, ln J at the centroid fails the patch test; the mean deformation
gradient does not (mean shape gradients of Flanagan and Belytschko, 10.1002/nme.1620170504).

Arrays: E cells, n nodes per cell, Q quadrature points, S sample points of ln J; N nodes; dim dimensions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints, gauss
from evfem.errors import InputError
from evfem.mesh import faces
from evfem.mesh.mesh import CELLS, Mesh
from evfem.tensor import det, inv
from evfem.tissue.kernels.blocks import Cells, blocked, loops

#: element -> (mesh kind, order of quadrature, how ln J is sampled)
ELEMENTS: Mapping[str, tuple[str, int, str]] = {
    "q1": ("quad", 3, "point"),
    "q1_fbar": ("quad", 3, "centroid"),
    "q2": ("quad9", 5, "point"),
    "q2p1": ("quad9", 5, "linear"),
    "p2": ("triangle6", 4, "point"),
    "hex8": ("hexahedron", 3, "mean"),
    "hex27p1": ("hexahedron27", 5, "linear"),
}


def elements_on(corners: int) -> tuple[str, ...]:
    """Names of the elements on cells with that many corners (3, 4 or 8).

    >>> elements_on(3), elements_on(4), elements_on(8)
    (('p2',), ('q1', 'q1_fbar', 'q2', 'q2p1'), ('hex8', 'hex27p1'))
    """
    return tuple(name for name, (kind, *_) in ELEMENTS.items() if CELLS[kind].corners == corners)


def elements_of_order(order: int) -> tuple[str, ...]:
    """Names of the elements with cells of that order (1 or 2).

    >>> elements_of_order(1)
    ('q1', 'q1_fbar', 'hex8')
    """
    return tuple(name for name, (kind, *_) in ELEMENTS.items() if CELLS[kind].order == order)


def points_per_cell(element: str) -> int:
    """Number of quadrature points of a cell.

    >>> points_per_cell("q2p1"), points_per_cell("p2")
    (9, 6)
    """
    return len(quadrature(element)[1])


def quadrature(element: str, facet: bool = False) -> tuple[Floats, Floats]:
    """Places (Q, dim) and weights (Q,) in the reference cell of an element, or its `facet`: Gauss's, in a
    triangle those of scikit-fem.
    """
    kind, order, _ = ELEMENTS[element]
    if CELLS[kind].corners == 3 and not facet:
        import skfem

        X, W = skfem.quadrature.get_quadrature(skfem.ElementTriP2.refdom, order)
        return X.T, W
    dim, along = CELLS[kind].dimension - facet, np.array(gauss(order // 2 + 1))
    places, weights = np.array([list(product(one, repeat=dim)) for one in along])
    return places, weights.prod(axis=1)


def shape_functions(kind: str, places: Floats) -> tuple[Floats, Floats]:
    """Values (Q, n) and derivatives (Q, n, dim) of the shape functions of a cell's nodes at places (Q, dim)
    in the reference cell, whose coordinates go from 0 to 1.
    """
    value, slope = faces.shape_functions(CELLS[kind].nodes, 2.0 * places - 1.0)
    return value, 2.0 * slope


def jacobians(mesh: Mesh, cells: Ints, slope: Floats) -> Floats:
    """dX/dxi (dim, dim, C, Q) in cells, from derivatives (Q, n, dim) there, or (C, Q, n, dim)."""
    nodes = np.swapaxes(mesh.points[mesh.cells[cells]], 1, 2)
    return (nodes[:, None] @ slope).transpose(2, 3, 0, 1)


@dataclass(frozen=True, eq=False)
class Gradients:
    """Shape gradients at points of cells: `reference` (Q, n, dim), `inverse` (E, Q, dim, dim) = d xi / dX."""

    reference: Floats
    inverse: Floats

    @property
    def of_mesh(self) -> Floats:
        """Gradients with respect to the reference configuration (E, Q, n, dim)."""
        return np.matmul(self.reference, self.inverse)

    @property
    def count(self) -> int:
        """Number of points in a cell."""
        return len(self.reference)


@dataclass(frozen=True, eq=False)
class MeanGradients:
    """Means of the shape gradients over every cell, `of_mesh` (E, 1, n, dim), as if at one point."""

    of_mesh: Floats
    count: int = 1


@dataclass(frozen=True, eq=False)
class Space:
    """Displacement space on a mesh: nodes of every cell, shape functions and their gradients,
    weights, and the element's measure of volume.

    `nodes` (E, n); `points` (dim, E, Q) the quadrature points; `value` (Q, n); `weight` (E, Q);
    `at` the gradients there; `sampled` those where ln J is, the same object if it is there, or
    their means if ln J is that of the mean deformation gradient.
    Without `modes` theta is simply ln J of the quadrature point; else theta = `modes` `psi` ln J
    with M functions `modes` (E, Q, M), orthonormal in each cell, and `psi` (E, M, S).
    """

    mesh: Mesh
    element: str
    nodes: Ints
    points: Floats
    value: Floats
    weight: Floats
    at: Gradients
    sampled: Gradients | MeanGradients
    modes: Floats | None = None
    psi: Floats | None = None

    @property
    def size(self) -> int:
        """Number of nodes."""
        return len(self.mesh.points)

    @property
    def dim(self) -> int:
        """Number of space dimensions."""
        return self.mesh.points.shape[1]

    @property
    def samples(self) -> int:
        """Number of points in a cell where ln J is sampled."""
        return self.sampled.count

    @property
    def gradient(self) -> Floats:
        """Shape gradients at the quadrature points (E, Q, n, dim)."""
        return self.at.of_mesh

    @property
    def sample(self) -> Floats:
        """Shape gradients where ln J is sampled (E, S, n, dim)."""
        return self.sampled.of_mesh

    @cached_property
    def cells(self) -> Cells:
        """The same in blocks, for the compiled loops."""
        return cells_of(self)

    @cached_property
    def projection(self) -> Floats | None:
        """Pi (E, Q, S), or None where theta is ln J of the quadrature point."""
        return None if self.modes is None or self.psi is None else self.modes @ self.psi


def cells_of(space: Space) -> Cells:
    """A space in blocks; what the loops read lies together."""
    (E, n), D, sampled = space.nodes.shape, space.dim, space.sampled
    modes = np.zeros((E, space.weight.shape[1], 0)) if space.modes is None else space.modes
    psi = np.zeros((E, 0, 0)) if space.psi is None else space.psi
    mean = np.einsum("eq,eqm->em", space.weight, modes)
    nodes, Q = blocked(space.nodes.astype(np.int32)), space.weight.shape[1]
    at_points = sampled is space.at if D == 3 else not mean.size
    if isinstance(sampled, MeanGradients):
        S, reference, inverse = 1, None, sampled.of_mesh[:, 0]
    else:
        S = 0 if at_points else len(sampled.reference)
        reference = np.ascontiguousarray(sampled.reference[:S])
        inverse = sampled.inverse[:, :S].reshape(E, S, D * D)
    return Cells(
        (space.size, len(nodes), n, Q, S, mean.shape[1]),
        loops(D).bounded(nodes, space.size),
        blocked(space.weight),
        space.at.reference,
        blocked(space.at.inverse.reshape(E, Q, D * D)),
        reference,
        blocked(inverse),
        blocked(psi),
        blocked(mean),
    )


def make_space(mesh: Mesh, element: str) -> Space:
    """Build the space of `element` on `mesh`, whose kind must fit; inverted cells are refused."""
    kind, _, sampling = ELEMENTS[element]
    if mesh.kind != kind:
        raise InputError("solver.element", element, f"cells of kind {kind}, the mesh has {mesh.kind}")
    places, W = quadrature(element)
    value, slope = shape_functions(kind, places)
    jacobian = jacobians(mesh, np.arange(len(mesh.cells)), slope)
    determinant = det(jacobian)
    check_orientation(mesh, determinant)
    weight = determinant * W
    points = np.ascontiguousarray((value @ mesh.points[mesh.cells]).transpose(2, 0, 1))
    at = _gradients(slope, jacobian)
    sampled: Gradients | MeanGradients = at
    modes = psi = None
    if sampling == "centroid":
        _, slope = shape_functions(kind, np.full((1, mesh.dim), 0.5))
        sampled = _gradients(slope, jacobians(mesh, np.arange(len(mesh.cells)), slope))
        modes, psi = _constant(weight)
    elif sampling == "mean":
        sampled = MeanGradients(_mean(at.of_mesh, weight))
        modes, psi = _constant(weight)
    elif sampling == "linear":
        modes = _linear(points, weight)
        psi = np.swapaxes(modes * weight[..., None], 1, 2)
    return Space(mesh, element, mesh.cells, points, value, weight, at, sampled, modes, psi)


def _gradients(slope: Floats, jacobian: Floats) -> Gradients:
    """From derivatives (Q, n, dim) of the shape functions in the reference cell, dX/dxi (dim, dim, E, Q)."""
    return Gradients(np.ascontiguousarray(slope), np.ascontiguousarray(inv(jacobian).transpose(2, 3, 0, 1)))


def scatter(nodes: Ints, fe: Floats, size: int) -> Floats:
    """Sum of cell forces (E, n, dim) on the nodes (E, n) they belong to, (size, dim)."""
    flat = nodes.ravel()
    return np.stack([np.bincount(flat, fe[..., i].ravel(), size) for i in range(fe.shape[2])], axis=1)


def check_orientation(mesh: Mesh, determinant: Floats) -> None:
    """Refuse inverted cells by det dX/dxi (E, Q)."""
    bad = np.flatnonzero((determinant <= 0.0).any(axis=1))
    if bad.size:
        centre = ", ".join(f"{x:.3g}" for x in mesh.points[mesh.cells[bad[0]]].mean(axis=0))
        problem = f"{bad.size} tangled cells, the first near ({centre})"
        raise InputError("finger.mesh", problem, "cells with a positive Jacobian at every quadrature point")


def _constant(weight: Floats) -> tuple[Floats, Floats]:
    """The constant as the only mode (E, Q, 1) and its psi (E, 1, 1), for one sample in each cell."""
    root = np.sqrt(weight.sum(axis=1))[:, None, None]
    return np.broadcast_to(1.0 / root, (*weight.shape, 1)), root


def _mean(gradient: Floats, weight: Floats) -> Floats:
    """Means (E, 1, n, dim) of gradients (E, Q, n, dim) over the cells."""
    mean = weight / weight.sum(axis=1, keepdims=True)
    return np.einsum("eq,eqnd->end", mean, gradient)[:, None]


def _linear(x: Floats, weight: Floats) -> Floats:
    """{1, X, Y[, Z]} at the points x (dim, E, Q), made orthonormal in each cell, (E, Q, dim + 1)."""
    centred = x - x.mean(axis=2, keepdims=True)
    centred = centred / np.abs(centred).max(axis=(0, 2), keepdims=True)
    phi = np.stack([np.ones_like(weight), *centred], axis=-1)
    mass = np.swapaxes(phi, 1, 2) @ (phi * weight[..., None])
    lower = np.linalg.cholesky(mass)
    return np.ascontiguousarray(np.swapaxes(np.linalg.solve(lower, np.swapaxes(phi, 1, 2)), 1, 2))

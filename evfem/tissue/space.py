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
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.hexahedron import EDGES, FACES, PLACES
from evfem.mesh.mesh import CELLS, Mesh
from evfem.tensor import det
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
    import skfem

    kind, intorder, _ = ELEMENTS[element]
    return int(skfem.quadrature.get_quadrature(shape_functions(kind).refdom, intorder)[1].size)


def scikit_mesh(mesh: Mesh) -> Any:
    """The same mesh as a scikit-fem mesh, its nodes where ours are (curved mid-nodes included)."""
    import skfem

    linear = {3: skfem.MeshTri, 4: skfem.MeshQuad, 8: skfem.MeshHex}[mesh.corners]
    corners = mesh.cells[:, : mesh.corners]
    used = np.zeros(len(mesh.points), dtype=bool)
    used[corners] = True
    vertices, t = np.flatnonzero(used), (np.cumsum(used) - 1)[corners].T
    if mesh.corners == 8:  # scikit-fem has its own order of the corners
        t = t[[int(np.flatnonzero((PLACES[:8] == 2 * p - 1).all(axis=1))[0]) for p in linear.elem.refdom.p.T]]
    base = linear(np.ascontiguousarray(mesh.points[vertices].T), np.ascontiguousarray(t))
    if mesh.order == 1:
        return base
    raised = {3: skfem.MeshTri2, 4: skfem.MeshQuad2, 8: skfem.MeshHex2}[mesh.corners]
    quadratic = raised.from_mesh(base)
    ours = nodes_at(straight_points(mesh), quadratic.doflocs.T)
    return type(quadratic)(np.ascontiguousarray(mesh.points[ours].T), quadratic.t)


def straight_points(mesh: Mesh) -> Floats:
    """Where the nodes would be if every edge were straight, (N, dim): tells them apart when curved."""
    points = mesh.points.copy()
    if mesh.order == 2 and mesh.corners == 8:
        corner = mesh.points[mesh.cells[:, :8]]
        points[mesh.cells[:, 8:20]] = corner[:, EDGES].mean(axis=2)
        points[mesh.cells[:, 20:26]] = corner[:, FACES].mean(axis=2)
        points[mesh.cells[:, 26]] = corner.mean(axis=1)
    elif mesh.order == 2:
        m = mesh.corners
        corner = mesh.points[mesh.cells[:, :m]]
        points[mesh.cells[:, m : 2 * m]] = 0.5 * (corner + np.roll(corner, -1, axis=1))
        if m == 4:
            points[mesh.cells[:, 8]] = corner.mean(axis=1)
    return points


def nodes_at(points: Floats, places: Floats) -> Ints:
    """Numbers of the points (N, dim) that lie at the places (M, dim), where scikit-fem has its unknowns.

    Equally many are paired in their order along an oblique line, which is theirs unless two lie
    at one place of it; a search tree finds the others. Raises `RuntimeError` where no point lies
    within 1e-9 of the mesh's size: then the two meshes differ.
    """
    allowed = 1e-9 * float(np.ptp(points, axis=0).max())
    if len(points) == len(places):
        oblique = np.sqrt([2.0, 3.0, 5.0])[: points.shape[1]]
        number = np.empty(len(points), dtype=np.int64)
        number[np.argsort(places @ oblique)] = np.argsort(points @ oblique)
        if np.abs(points[number] - places).max() <= allowed:
            return number
    from scipy.spatial import cKDTree

    distance, number = cKDTree(points).query(places)
    farthest = float(np.max(distance))
    if not farthest <= allowed:
        raise RuntimeError(f"a node of scikit-fem's mesh is {farthest:g} mm away from the nearest of ours")
    return number


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
    import skfem

    kind, intorder, sampling = ELEMENTS[element]
    if mesh.kind != kind:
        raise InputError("solver.element", element, f"cells of kind {kind}, the mesh has {mesh.kind}")
    shape = shape_functions(kind)
    grid = scikit_mesh(mesh)
    X, W = skfem.quadrature.get_quadrature(shape.refdom, intorder)
    mapping = grid.mapping()
    determinant = det(np.asarray(mapping.DF(X)))
    check_orientation(mesh, determinant)
    weight = np.abs(determinant) * W
    points = np.ascontiguousarray(mapping.F(X))
    at = _gradients(shape, mapping, X)
    sampled: Gradients | MeanGradients = at
    modes = psi = None
    if sampling == "centroid":
        sampled = _gradients(shape, mapping, np.array([[0.5], [0.5]]))
        modes, psi = _constant(weight)
    elif sampling == "mean":
        sampled = MeanGradients(_mean(at.of_mesh, weight))
        modes, psi = _constant(weight)
    elif sampling == "linear":
        modes = _linear(points, weight)
        psi = np.swapaxes(modes * weight[..., None], 1, 2)
    elif sampling != "point":
        raise ValueError(f"no such sampling of the volume: {sampling}")
    # one point is enough for the numbers of the unknowns
    dofs = skfem.Basis(grid, shape, mapping=mapping, quadrature=(X[:, :1], W[:1]))
    nodes = np.ascontiguousarray(nodes_at(mesh.points, dofs.doflocs.T)[dofs.element_dofs].T)
    value = np.stack([shape.lbasis(X, i)[0] for i in range(nodes.shape[1])], axis=1)
    return Space(mesh, element, nodes, points, value, weight, at, sampled, modes, psi)


def _gradients(shape: Any, mapping: Any, X: Floats) -> Gradients:
    """Gradients of scikit-fem's shape functions at the points X (dim, Q) of the reference cell."""
    count = shape.doflocs.shape[0]
    reference = np.stack([np.broadcast_to(shape.lbasis(X, i)[1], X.shape).T for i in range(count)], axis=1)
    inverse = mapping.invDF(X).transpose(2, 3, 0, 1)
    return Gradients(np.ascontiguousarray(reference), np.ascontiguousarray(inverse))


def shape_functions(kind: str) -> Any:
    """scikit-fem's shape functions on cells of a kind."""
    import skfem

    shapes = {
        "quad": skfem.ElementQuad1,
        "quad9": skfem.ElementQuad2,
        "triangle6": skfem.ElementTriP2,
        "hexahedron": skfem.ElementHex1,
        "hexahedron27": skfem.ElementHex2,
    }
    return shapes[kind]()


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


def check_orientation(mesh: Mesh, determinant: Floats) -> None:
    """Refuse inverted cells by the sign of det dX/dxi (E, Q), of which scikit-fem takes the size."""
    sign = np.sign(determinant)
    bad = np.flatnonzero((sign * np.median(sign, axis=1, keepdims=True) <= 0).any(axis=1))
    if bad.size:
        centre = ", ".join(f"{x:.3g}" for x in mesh.points[mesh.cells[bad[0]]].mean(axis=0))
        raise InputError(
            "finger.mesh",
            f"{bad.size} tangled cells, the first near ({centre})",
            "cells with a positive Jacobian at every quadrature point",
        )


def _constant(weight: Floats) -> tuple[Floats, Floats]:
    """The constant as the only mode (E, Q, 1) and its psi (E, 1, 1), for one sample in each cell."""
    root = np.sqrt(weight.sum(axis=1))[:, None, None]
    return np.broadcast_to(1.0 / root, (*weight.shape, 1)), root


def _mean(gradient: Floats, weight: Floats) -> Floats:
    """Means (E, 1, n, dim) of gradients (E, Q, n, dim) over the cells."""
    share = weight / weight.sum(axis=1, keepdims=True)
    return np.einsum("eq,eqnd->end", share, gradient)[:, None]


def _linear(x: Floats, weight: Floats) -> Floats:
    """{1, X, Y[, Z]} at the points x (dim, E, Q), made orthonormal in each cell, (E, Q, dim + 1)."""
    centred = x - x.mean(axis=2, keepdims=True)
    centred = centred / np.abs(centred).max(axis=(0, 2), keepdims=True)
    phi = np.stack([np.ones_like(weight), *centred], axis=-1)
    mass = np.swapaxes(phi, 1, 2) @ (phi * weight[..., None])
    lower = np.linalg.cholesky(mass)
    return np.ascontiguousarray(np.swapaxes(np.linalg.solve(lower, np.swapaxes(phi, 1, 2)), 1, 2))

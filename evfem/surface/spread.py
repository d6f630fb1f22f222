r"""How forces on a pad's nodes lie on an elastic surface, and what the nodes feel of its displacement.

A compliance C knows even pressures on strips, in space on squares (`evfem.surface.elastic`). A node stands
for one of them: on a quadratic edge of length h those are h/6, 4 h/6 and h/6 long, and in space the middle of
a face's side stands for h/3 x 2 h/3, two squares. Forces S on strips do the work :math:`F \cdot u` on a skin
displaced by :math:`\sum_j N_j u_j`, whose nodes so carry, and are displaced with the surface by,

.. math:: F = T^T S, \qquad w = T^{-1} C S = T^{-1} C\,T^{-T} F, \qquad T_{sj} = \frac{1}{A_s}\int_s N_j\,dA ,

which follows from the equality of works: the shape functions N with the values w have the means C S on the
strips. With T = 1 these means would be held against the places of the nodes, which an outline of radius R
leaves by :math:`h^2/216 R` below ends and :math:`h^2/54 R` below middles; nodal pressures then alternate, to
first order in h and the more the stiffer the upper layer is. Linear sides have equal strips, and T = 1.

A side of size a adds :math:`a\,Q_{sj} / A_s` to T, with the integrals Q of the N_j over its nodes' parts, all
of the undeformed pad: a and A_s stretch alike but for the gradient of the strain over a side, and a T that
follows every iterate makes frictionless ridges roll to and fro (1,400 iterations of a step, 22 with this).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.faces import PLACES, node_places, shape_functions
from evfem.surface.pad import Pad
from evfem.surface.skin import Skin

#: of an edge of length 1: integrals of its shape functions (ends, middle) over [0, 1/6], [5/6, 1] and between
PARTS = np.array([[83.0, -7.0, 32.0], [-7.0, 83.0, 32.0], [32.0, 32.0, 368.0]]) / 648.0
#: middles of a face's sides, between the corners
SIDES = ((4, 0, 1), (5, 1, 2), (6, 2, 3), (7, 3, 0))
#: of each of the components x, y, z the one of a surface's matrix, and its sign there
ORDER, SIGN = np.array([1, 0, 2]), np.array([-1.0, 1.0, -1.0])
#: a share of a side's size, and an angle (rad), that are none; and by how much smooth outlines bend at most
STRAIGHT, SMOOTH = 1e-8, 0.1


@dataclass(frozen=True, eq=False)
class Strips:
    """What a compliance is asked for below k nodes of linear sides: `places` (k,), in space x and z (k, 2),
    and `sizes` (k,) in mm, in space mm2.
    """

    places: Floats
    sizes: Floats

    @property
    def distribution(self) -> Floats:
        """Forces on the strips by those on the nodes, T^-T in strips (m, k)."""
        return np.eye(self.sizes.size)


@dataclass(frozen=True, eq=False)
class Spread(Strips):
    """Strips (m,) below k nodes of quadratic sides: `split` (k, m), the shares of a node's force on them, and
    T, `means` (k, k), in factors.
    """

    split: Any
    means: Any

    @property
    def distribution(self) -> Floats:
        return np.asarray(self.split.T @ self.means.solve(np.eye(self.split.shape[0]), "T"))


def strips_below(pad: Pad | Skin, position: Floats, rest: Floats, over: Ints, least: float) -> Strips:
    """The strips below nodes `over` (k,) of a pad at (P, dim), undeformed at `rest`, with tributary lengths
    (areas) of at least `least`.
    """
    from scipy.sparse.linalg import splu

    def at(points: Floats) -> tuple[Floats, Floats]:
        along = points[:, 0] if points.shape[1] == 2 else points[:, ::2]
        return along, np.maximum(pad.tributary(points)[over], least)

    sides, (place, length), (begun, own) = _sides(pad), at(position), at(rest)
    row = np.full(len(position), -1)
    row[over] = np.arange(over.size)
    whole = row[sides[(row[sides] >= 0).all(axis=1)]]
    if sides.shape[1] in (2, 4) or not len(whole):
        return Strips(place[over], length)
    places, sizes, split = _split(sides, place, row, length)
    return Spread(places, sizes, split, splu(_means(whole, begun[over], own)))


def _split(sides: Ints, place: Floats, row: Ints, length: Floats) -> tuple[Floats, Floats, Any]:
    """Places and sizes of the strips (m,) of nodes whose `row` is not -1, and the shares (k, m) of these: in
    space middles of sides have two squares.
    """
    from scipy.sparse import csr_matrix

    over, k = np.flatnonzero(row >= 0)[np.argsort(row[row >= 0])], length.size
    double = np.concatenate([sides[:, one] for one in SIDES if place.ndim == 2] or [np.zeros((0, 3), int)])
    double = double[np.unique(double[:, 0], return_index=True)[1]]
    middle, first, last = double[row[double[:, 0]] >= 0].T
    share, owner = np.ones(k), np.append(np.arange(k), row[middle])
    share[row[middle]] = 0.5
    places, way = place[over][owner], (place[last] - place[first]) / 6.0
    places[row[middle]] -= way
    places[k:] += way
    share = share[owner]
    return places, length[owner] * share, csr_matrix((share, (owner, np.arange(owner.size))))


def _means(sides: Ints, place: Floats, length: Floats) -> Any:
    """T (k, k) of sides among nodes at these places with these lengths (k,); 1 of what no side covers."""
    from scipy.sparse import coo_matrix, identity

    if place.ndim == 1:
        parts, size = PARTS, place[sides[:, 1]] - place[sides[:, 0]]
    else:
        first, second = np.array([0, 2, 1])[PLACES.astype(int) + 1].T
        parts = PARTS[np.ix_(first, first)] * PARTS[np.ix_(second, second)]
        (x, z), (u, v) = (
            (place[sides[:, 2]] - place[sides[:, 0]]).T,
            (place[sides[:, 3]] - place[sides[:, 1]]).T,
        )
        size = 0.5 * (x * v - z * u)
    less = parts - np.diag(parts.sum(axis=1))
    values = np.maximum(size, 0.0)[:, None, None] * less / length[sides][:, :, None]
    of, by = np.broadcast_arrays(sides[:, :, None], sides[:, None, :])
    found = coo_matrix((values.ravel(), (of.ravel(), by.ravel())), shape=(length.size, length.size))
    return (identity(length.size) + found).tocsc()


@dataclass(frozen=True, eq=False)
class Distribution:
    """How forces (k, dim) on the finger's nodes lie on m strips, `by_node` (m, k), and what a surface's
    matrices (dim m, dim m) are to them. Those are component by component, into the surface and along
    +x[, +z], of forces F_y, -F_x[, -F_z].
    """

    by_node: Floats

    def moved(self, found: Floats, force: Floats) -> Floats:
        """What such a matrix gives at the nodes (k, dim) under a force (k, dim)."""
        order, sign = ORDER[: force.shape[1]], SIGN[: force.shape[1]]
        on_strips = (self.by_node @ (force * sign)[:, order]).T.ravel()
        given = (found @ on_strips).reshape(force.shape[1], -1)
        return np.asarray((given @ self.by_node).T[:, order] * sign)

    def among(self, found: Floats, nodes: Ints, dim: int) -> Floats:
        """Such a matrix of some of the nodes (dim c, dim c), node by node along x, y[, z]."""
        by_node, (m, c) = np.ascontiguousarray(self.by_node[:, nodes]), (len(self.by_node), nodes.size)
        made = np.empty((c, dim, c, dim))
        for p, rows in enumerate(found.reshape(dim, m, dim * m)):
            blocks = ((by_node.T @ rows).reshape(c * dim, m) @ by_node).reshape(c, dim, c)
            made[:, ORDER[p], :, :] = (blocks.transpose(0, 2, 1) * SIGN[ORDER[p]])[:, :, ORDER[:dim]]
        made *= SIGN[:dim]
        return made.reshape(dim * c, dim * c)


class Facets:
    """Straight `sides` (K, m), as quadratic cells made of linear ones have, where the outline of a pad at
    `points` (P, dim) is smooth: it bends from side to side, by less than `SMOOTH`.

    Their middles lie inside of the smooth outline, by h^2/8R, and press less than their ends: the more the
    harder the upper layers are. Force and moment of a side are right, and `evened` keeps these alone.
    """

    def __init__(self, pad: Pad | Skin, points: Floats) -> None:
        sides, dim = _sides(pad), points.shape[1]
        corner, at = sides[:, : 2 ** (dim - 1)], node_places(sides.shape[1], dim - 1)
        linear = shape_functions(corner.shape[1], at)[0]
        weighed = linear.T * np.where(at == 0.0, 4.0, 1.0).prod(axis=1)
        self.even = linear @ np.linalg.solve(weighed @ linear, weighed)
        size, bend = _bends(points[corner], corner, len(points))
        sag = np.abs(points[sides] - linear @ points[corner]).max(axis=(1, 2))
        straight = (sag < (STRAIGHT + 0.01 * bend) * size ** (1.0 / (dim - 1))).all()
        facets = (bend > STRAIGHT) & (bend < SMOOTH) & (straight and corner.shape != sides.shape)
        self.sides, self.size = sides[facets], size[facets]

    def evened(self, pressure: Floats, traction: Floats, slips: Any) -> Floats:
        """A traction (P,) of nodes under a pressure (P,): on sides that touch as a whole the linear one of
        the same force and moment, at nodes the mean of their sides. Its ratio to the pressure is that of each
        node where one of a side `slips` (P,), else no larger than at a node of the side.
        """
        even = pressure[self.sides] @ self.even.T
        whole = np.flatnonzero((np.minimum(pressure[self.sides], even) > 0.0).all(axis=1))
        if not whole.size:
            return traction
        sides, even = self.sides[whole], even[whole]
        of, weight = sides.ravel(), np.repeat(self.size[whole], sides.shape[1])
        ratio = traction[sides] / pressure[sides]
        largest = np.abs(ratio).max(axis=1, keepdims=True) * even
        linear = np.clip(traction[sides] @ self.even.T, -largest, largest)
        values = np.where(slips[sides].any(axis=1, keepdims=True), ratio * even, linear).ravel()
        total, weights = (np.bincount(of, each, traction.size) for each in (weight * values, weight))
        return np.where(weights > 0.0, total / np.where(weights > 0.0, weights, 1.0), traction)


def _sides(pad: Pad | Skin) -> Ints:
    return pad.faces if isinstance(pad, Skin) else pad.edges


def _bends(corners: Floats, of: Ints, size: int) -> tuple[Floats, Floats]:
    """Sizes (K,) of sides with these corners (K, c, dim), numbered `of` (K, c) among so many nodes, and the
    largest angle (K,) by which the outline bends at one of them, in rad.
    """
    if corners.shape[2] == 2:
        normal = (corners[:, 1] - corners[:, 0])[:, ::-1] * [-1.0, 1.0]
    else:
        normal = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    sizes = np.linalg.norm(normal, axis=1)
    normal = normal / sizes[:, None]
    mean = np.zeros((size, corners.shape[2]))
    np.add.at(mean, of, normal[:, None, :])
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    return sizes, 2.0 * np.linalg.norm(mean[of] - normal[:, None, :], axis=2).max(axis=1)

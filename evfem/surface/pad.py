r"""The outline that faces the surface: pad nodes, tributary lengths projected on x, gaps, normals
and contact widths.

A pad edge with ends a, b carries :math:`\max(0, x_b - x_a)` of projected length, shared 1/2, 1/2
between its nodes, or 1/6, 4/6, 1/6 on quadratic edges (the outward normal faces down exactly where
x grows along the edge, the body being on its left). The vertical gap is :math:`g = y - h(x)`,
positive when open; normal and tangents of the surface are those of `SurfaceState`, in the plane
:math:`n = (-h', 1)/r`, :math:`t = (1, h')/r`, :math:`r = \sqrt{1 + h'^2}`. Arrays: P pad nodes in
ascending number.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh


def outline_nodes(mesh: Mesh) -> Ints:
    """Mesh numbers (P,) of the nodes on `pad` along the outline, in growing x on the side that faces down.

    On quadratic meshes ends and middles of edges alternate. Raises InputError where the pad is not
    one open line.

    >>> from evfem.finger.fingerpad import FingerPad
    >>> mesh = FingerPad(resolution="coarse").mesh(order=2)
    >>> nodes = outline_nodes(mesh)
    >>> len(nodes) == len(mesh.node_sets["pad"]), bool(mesh.points[nodes[0], 0] < 0)
    (True, True)
    """
    if mesh.dim == 3:
        raise InputError("finger.mesh", "a finger in three dimensions", "a plane finger")
    edges = mesh.sides_of("pad")
    follow = {int(edge[0]): [int(node) for node in (*edge[2:], edge[1])] for edge in edges}
    starts = set(follow) - {nodes[-1] for nodes in follow.values()}
    if len(starts) != 1:
        raise InputError("finger.mesh", f"a pad with {len(starts)} beginnings", "a pad that is one open line")
    nodes = list(starts)
    while nodes[-1] in follow:
        nodes += follow[nodes[-1]]
    return np.array(nodes, dtype=np.int64)


#: modulus of indentation over shear modulus of a body that keeps its volume
INDENTATION = 4.0
#: what an edge of contact from the nodes' `reach` is too far out, in spacings of nodes
OVERSHOT = 0.25
SHARES = {2: np.array([0.5, 0.5]), 3: np.array([1.0, 1.0, 4.0]) / 6.0}


@dataclass(frozen=True, eq=False)
class Pad:
    """Pad nodes of a mesh: mesh numbers `nodes` (P,), `edges` (K, 2|3) as indices into them: start, end[,
    middle], and which may touch (those not on the bone), `free` (P,) bool.
    """

    nodes: Ints
    edges: Ints
    free: Any

    @cached_property
    def segments(self) -> Ints:
        """Pairs (S, 2) of neighbouring nodes along the outline, as indices into `nodes`."""
        line = self.edges[:, [0, *range(2, self.edges.shape[1]), 1]]
        return np.stack([line[:, :-1], line[:, 1:]], axis=2).reshape(-1, 2)

    @cached_property
    def _ends(self) -> Ints:
        """The nodes of the edges, one after the other."""
        return self.edges.ravel()

    @property
    def shares(self) -> Floats:
        """Tributary fractions of an edge's projected length, one for each of its nodes."""
        return SHARES[self.edges.shape[1]]

    def spacing(self, points: Floats) -> float:
        """Median length (mm) of the edges; points (P, 2)."""
        ends = points[self.edges[:, :2]]
        return float(np.median(np.hypot(*(ends[:, 0] - ends[:, 1]).T)))

    def facing(self, position: Floats) -> Any:
        """Segments that face down, (S,) bool."""
        return np.diff(position[self.segments, 0], axis=1)[:, 0] > 0.0

    def fold(self, position: Floats, touching: Any, down: Any) -> float | None:
        """`fold` of nodes at (P, 2)."""
        return fold(position, self.segments, touching, down)

    def length(self, x: Floats) -> Floats:
        """Tributary length on x where the outline faces down, in mm: (..., P) for x (..., P)."""
        rows = x.reshape(-1, x.shape[-1])
        width = np.maximum(rows[:, self.edges[:, 1]] - rows[:, self.edges[:, 0]], 0.0)
        shared = width[:, :, None] * self.shares
        nodes = self._ends if len(rows) == 1 else self._ends + rows.shape[1] * np.arange(len(rows))[:, None]
        found = np.bincount(nodes.ravel(), shared.ravel(), rows.size)
        return found.astype(float, copy=False).reshape(x.shape)

    def tributary(self, position: Floats) -> Floats:
        """`length` of positions (..., P, 2); the name that `evfem.surface.skin.Skin` has for areas."""
        return self.length(position[..., 0])

    def tributary_between(self, begin: Floats, end: Floats, x: Floats) -> Floats:
        """`length` at x (P, 1) on the way from positions (P, 2) to others."""
        return self.length(x[:, 0])

    def tributary_gradient(self, position: Floats) -> tuple[Ints, Ints, Floats]:
        """Derivative of the tributary lengths as triplets (node, moved unknown 2 j + a, value)."""
        x, (start, end) = position[:, 0], np.split(self.edges[:, :2], 2, axis=1)
        facing = (x[end] > x[start]) * self.shares
        of, *moved = (np.broadcast_to(one, facing.shape).ravel() for one in (self.edges, start, end))
        return np.tile(of, 2), 2 * np.concatenate(moved), np.concatenate([-facing.ravel(), facing.ravel()])

    def tributary_curvature(self, position: Floats, weight: Floats) -> tuple[Ints, Ints, Floats]:
        """Second derivatives of the lengths, none: they are linear in x (`evfem.surface.skin.Skin`)."""
        none = np.zeros(0, dtype=np.int64)
        return none, none, np.zeros(0)

    def spacing_at(self, position: Floats) -> Floats:
        """Distance in x (P,) from node to node, the mean of both sides where the outline faces down."""
        x, (a, b) = position[:, 0], self.segments.T
        ends, lengths = np.concatenate([a, b]), np.tile(np.maximum(x[b] - x[a], 0.0), 2)
        sides = np.bincount(ends, lengths > 0.0, x.size)
        return np.asarray(np.bincount(ends, lengths, x.size) / np.maximum(sides, 1.0))

    def contact_widths(self, position: Floats, reach: Floats) -> tuple[float, float]:
        """Overall and real contact width (mm) of nodes at (P, 2) with this `reach` (P,).

        Between a node that touches and one that does not, contact ends where the linear reach is zero, less
        `OVERSHOT` of their distance, or of less where little touches beside the node.
        """
        x = position[:, 0]
        a, b = self.segments[x[self.segments[:, 1]] > x[self.segments[:, 0]]].T
        before, after = np.full((2, x.size), -1)
        before[b], after[a] = a, b
        inside = np.flatnonzero((before >= 0) & (after >= 0))
        reach = widened(reach, np.stack([before[inside], inside, after[inside]]))
        length, touches = x[b] - x[a], reach > 0.0
        mixed = touches[a] != touches[b]
        inner, outer = np.where(touches[a], a, b), np.where(touches[a], b, a)
        fraction = np.where(touches[a] & touches[b], 1.0, 0.0)
        fraction[mixed] = reach[inner[mixed]] / (reach[inner[mixed]] - reach[outer[mixed]])
        covered = np.bincount(np.concatenate([a, b]), np.tile(fraction * length, 2), x.size)
        space = self.spacing_at(position) * ((before >= 0) & (after >= 0))  # nothing to cut at the pad's end
        space = space[inner] + fraction * (space[outer] - space[inner])
        edge = fraction * length - OVERSHOT * mixed * np.minimum(space, 1.5 * covered[inner])
        rights = np.append((x[a] + edge)[mixed & touches[a]], x[touches & (after < 0) & (before >= 0)])
        lefts = np.append((x[b] - edge)[mixed & touches[b]], x[touches & (before < 0) & (after >= 0)])
        if not rights.size:
            return 0.0, 0.0
        return float(rights.max() - lefts.min()), float(edge.sum())


def widened(reach: Floats, rows: Ints) -> Floats:
    """The `reach` (P,) with that of nodes which touch alone in one of the `rows` (3, R), each a node
    between two neighbours.

    Hertz's contact of half width a below one node has a^2 = 4 P R / (pi E*), and beside it the gap is
    h^2 / 2 R less what P dents: a / h = 3/4 (r / (r + 9 pi / 16 g))^(1/2), with 3/4 where both
    neighbours come to touch. What is cut off of narrow contacts is added before.
    """
    before, node, after = rows[:, reach[rows[1]] > 0.0]
    own, beside = reach[node], reach[np.stack([before, after])]
    goes_on = (own / np.where(beside > 0.0, own, own - beside)).max(axis=0)
    gap = np.maximum(-beside, 1e-300).mean(axis=0)
    half = 0.75 * np.sqrt(own / (own + 9.0 * np.pi / 16.0 * gap))
    fraction = np.minimum(np.minimum(half + OVERSHOT, half / OVERSHOT), 1.0 - 1e-9)
    alone = np.where(goes_on < 1.0, gap * fraction / (1.0 - fraction), own)
    found = reach.copy()
    np.maximum.at(found, node, goes_on * own + (1.0 - goes_on) * alone)
    return found


def reach(gap: Floats, pressure: Floats, spacing: Floats, shear_modulus: Floats) -> Floats:
    """How far (mm, all (P,)) the nodes of a pad are in contact: twice their `pressure` times their
    `spacing` over the modulus of indentation 4 G where there is one, minus their gap where there is none.

    It passes zero continuously where a node begins or ceases to touch, and so does whatever is made of
    it. Along a line that ends like Hertz's, p ~ sqrt(d) and g ~ d^(3/2), the zero of its interpolation
    moves with the true edge to 0.02 spacings (0.04 on quadratic edges), a fourth of a spacing outside.
    """
    pressed = 2.0 * pressure * spacing / (INDENTATION * shear_modulus)
    return np.where(pressed > 0.0, pressed, -np.maximum(gap, 0.0))


def fold(position: Floats, segments: Ints, touching: Any, down: Any) -> float | None:
    """x (mm) where an outline crosses itself, or None where it does not.

    `position` (P, 2) of the nodes, `segments` (S, 2) of the outline from node to node, the body on
    their left; which nodes are `touching` (P,) a surface over x, and which segments faced `down`
    (S,) undeformed. As long as these still do, nothing has folded; elsewhere segments that touch
    must not face up, and no two may cross.

    >>> zigzag = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [1.5, -0.5], [3.0, 0.0]])
    >>> line = np.array([[0, 1], [1, 2], [2, 3], [3, 4]])
    >>> fold(zigzag, line, np.zeros(5, bool), np.ones(4, bool))
    1.25
    """
    begin, end = position[segments[:, 0]], position[segments[:, 1]]
    turned = down & (end[:, 0] <= begin[:, 0])
    if not turned.any():
        return None
    pressed = np.flatnonzero(turned & touching[segments].all(axis=1) & (end[:, 0] < begin[:, 0]))
    if pressed.size:
        return float(begin[pressed[0], 0])
    # the end points of b are on both sides of the line through a, and vice versa
    a, b = _near(begin, end)
    before, after = (_side(begin[a], end[a], point[b]) for point in (begin, end))
    back, forth = (_side(begin[b], end[b], point[a]) for point in (begin, end))
    crossed = np.flatnonzero((before * after < 0.0) & (back * forth < 0.0))
    if not crossed.size:
        return None
    first = crossed[0]
    fraction = before[first] / (before[first] - after[first])
    return float(begin[b[first], 0] + fraction * (end[b[first], 0] - begin[b[first], 0]))


def _near(begin: Floats, end: Floats) -> tuple[Ints, Ints]:
    """Pairs a < b of segments (S, 2), from begin to end, whose boxes overlap: (K,) and (K,), in order."""
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    order = np.argsort(low[:, 0])
    # behind each one, in order of their left ends, those that begin before it ends
    behind = np.searchsorted(low[order, 0], high[order, 0], side="right") - np.arange(1, order.size + 1)
    first = np.repeat(np.arange(order.size), behind)
    second = np.arange(first.size) - np.repeat(np.cumsum(behind) - behind, behind) + first + 1
    a, b = order[first], order[second]
    beside = (low[a, 1] <= high[b, 1]) & (low[b, 1] <= high[a, 1])
    a, b = np.sort(np.stack([a[beside], b[beside]]), axis=0)
    there = np.lexsort((b, a))
    return a[there], b[there]


def _side(begin: Floats, end: Floats, point: Floats) -> Floats:
    """On which side of segments (K, 2), from begin to end, the points (K, 2) are: (K,)."""
    fraction, to = end - begin, point - begin
    return fraction[:, 0] * to[:, 1] - fraction[:, 1] * to[:, 0]


def make_pad(mesh: Mesh) -> Pad:
    """The pad of a plane mesh; raises InputError where no outer edge belongs to it."""
    if mesh.dim == 3:
        raise InputError("finger.mesh", "a finger in three dimensions", "a plane finger")
    return Pad(*sides_of_pad(mesh))


def sides_of_pad(mesh: Mesh) -> tuple[Ints, Ints, Any]:
    """Pad nodes (P,), edges or faces among them, and who follow no bone (P,); InputError without a pad."""
    sides = mesh.sides_of("pad") if "pad" in mesh.node_sets else np.zeros((0, 2), dtype=np.int64)
    if not len(sides):
        missing = f"no outer {'edge' if mesh.dim == 2 else 'face'} whose nodes are all on `pad`"
        raise InputError("finger.mesh", missing, "point data or a physical group `pad`")
    nodes, local = np.unique(sides, return_inverse=True)
    free = ~np.isin(nodes, mesh.node_sets.get("bone", np.zeros(0, dtype=np.int64)))
    return nodes, local.reshape(sides.shape), free


@dataclass(frozen=True)
class SurfaceState:
    r"""The surface below (or above) the pad nodes: vertical gap (P,), slopes (P, d) and curvatures (P, d, d)
    along x, in space along x and z.

    With the slopes p, q and :math:`r_1 = \sqrt{1 + p^2}`, :math:`r = \sqrt{1 + p^2 + q^2}` a node's frame
    in (x, y, z) is :math:`n = (-p, 1, -q)/r`, :math:`t_1 = (1, p, 0)/r_1`,
    :math:`t_2 = (-pq, q, r_1^2)/(r_1 r)`.
    """

    gap: Floats
    slope: Floats
    curvature: Floats

    def __getitem__(self, nodes: Ints) -> SurfaceState:
        """At these of the nodes alone."""
        return SurfaceState(self.gap[nodes], self.slope[nodes], self.curvature[nodes])

    @cached_property
    def _sizes(self) -> tuple[Floats, Floats | float, Floats, Floats]:
        """Slopes p and q, 0 in the plane, and the lengths r_1 and r, (P,) each."""
        p, q = self.slope[:, 0], self.slope[:, 1] if self.slope.shape[1] > 1 else 0.0
        first = np.sqrt(1.0 + p**2)
        return p, q, first, np.sqrt(1.0 + p**2 + q**2)

    @property
    def stretch(self) -> Floats:
        """Length of the surface's upward vector (-p, 1, -q), in the plane arc length per unit of x."""
        return self._sizes[3]

    @cached_property
    def normal_gap(self) -> Floats:
        """Gap along the surface's normal at the node's position (first order)."""
        return self.gap / self.stretch

    @cached_property
    def axes(self) -> Floats:
        """Rows n, t1[, t2] of every node, in the order (y, x[, z]) of their components, (P, 1 + d, 1 + d)."""
        (p, q, first, r), n = self._sizes, 1 + self.slope.shape[1]
        axes = np.zeros((p.size, n, n))
        axes[:, 0, 0], axes[:, 0, 1] = 1.0 / r, -p / r
        axes[:, 1, 0], axes[:, 1, 1] = p / first, 1.0 / first
        if n == 3:
            axes[:, 0, 2] = -q / r
            axes[:, 2] = np.stack([q, -p * q, first**2], axis=1) / (first * r)[:, None]
        return axes

    @cached_property
    def travel(self) -> Floats:
        """Displacement along t1[, t2] per displacement along x[, z] on the surface, (P, d, d)."""
        (p, q, first, r), d = self._sizes, self.slope.shape[1]
        found = np.zeros((p.size, d, d))
        found[:, 0, 0] = first
        if d == 2:
            found[:, 0, 1], found[:, 1, 1] = p * q / first, r / first
        return found

    def turned(self, force: Floats) -> Floats:
        """Rotation of forces (P, 1 + d) along n, t1[, t2] with the surface: their change along (y, x[, z])
        per displacement of the node along x[, z], (P, 1 + d, d).
        """
        if not self.curvature.any():
            return np.zeros((*force.shape, self.slope.shape[1]))
        return np.asarray(self.turned_by_slope(force) @ self.curvature)

    def turned_by_slope(self, force: Floats) -> Floats:
        """The same per change of the slopes along x[, z], (P, 1 + d, d)."""
        (p, q, first, r), d = self._sizes, self.slope.shape[1]
        # rates at which n turns towards t1 and t2, and t1 towards t2, by p and by q
        a, b, c = (np.zeros((p.size, d)) for _ in range(3))
        a[:, 0] = -1.0 / (first * r)
        normal, one = force[:, :1], force[:, 1:2]
        changes = [-a * one, a * normal]
        if d == 2:
            b[:, 0], b[:, 1], c[:, 0] = p * q / (first * r**2), -first / r**2, q / (first**2 * r)
            two = force[:, 2:]
            changes = [changes[0] - b * two, changes[1] - c * two, b * normal + c * one]
        return np.asarray(np.einsum("paj,pak->pkj", np.stack(changes, axis=1), self.axes))


def surface_state(surface: Any, position: Floats) -> SurfaceState:
    """Surface frame at node positions (P, dim); h(x[, z]) = surface.y + surface.relief(x[, z])."""
    height, slope, curvature = surface.relief(position[:, ::2])
    return SurfaceState(position[:, 1] - surface.y - height, slope, curvature)

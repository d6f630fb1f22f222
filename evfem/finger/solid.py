r"""The mesh of a whole finger pad: layers between the lower halves of two ellipsoids, the finger's
and the bone's, or, with a nail, between the whole ones.

A point of either surface is named by a unit vector e with :math:`e_y \le 0`: :math:`(a e_x, b e_y,
c e_z)` for semi-axes a, b, c. Seen from below the vectors fill the unit disc :math:`(p, q) = (e_x,
e_z)`, which is divided into a rectangle of lines p = const and q = const, so that parallel ridges
follow the lines, and four sides whose lines go on to the rim along great circles (of another body than
an ellipsoid, `Body`, e is a point of the surface over its axes, and the great circles are those of its
rays):

    +---------+
    |\   q   /|
    | +-----+ |
    | |     | p
    | +-----+ |
    |/       \|
    +---------+

The skin's interfaces are true offsets of the smooth surface along its normals; straight lines to
the bone fill the hypodermis. Ridges are cut along the normals, and the columns below them merge
three to one (`evfem.finger.blocks`). With a nail the upper half is the same lattice with
:math:`e_y \ge 0`, without ridges; the nail replaces the outermost layer in those columns of
the rectangle that lie under it, and the nail bed, dermis, that of all below.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.finger.blocks import DIGITS, block
from evfem.finger.fingerprint import faded
from evfem.finger.layers import NAIL, NAIL_BED, TissueLayer
from evfem.finger.outline import Ellipse, Outline, layer_coordinates
from evfem.mesh.hexahedron import MIRRORED
from evfem.mesh.mesh import Mesh

#: half of the rectangle's sides over the semi-axes
RECTANGLE = 0.64
#: angles along and across on which the smallest radius of a body is sought, and the step to their neighbours
SAMPLES, STEP = 61, 1e-4
CIRCLE = Ellipse(1.0, 1.0)


@dataclass(frozen=True)
class Ellipsoid:
    """Semi-axes a (x), b (y), c (z) in mm around (0, `centre`, 0)."""

    a: float
    b: float
    c: float
    centre: float = 0.0

    @property
    def smallest_radius(self) -> float:
        """Smallest radius of curvature: normal offsets inwards must stay below it."""
        return min(self.a, self.b, self.c) ** 2 / max(self.a, self.b, self.c)

    def point(self, unit: Floats) -> Floats:
        """Points (N, 3) of the unit vectors (N, 3)."""
        return unit * [self.a, self.b, self.c] + [0.0, self.centre, 0.0]

    def normal(self, unit: Floats) -> Floats:
        """Outward unit normals (N, 3)."""
        n = unit / [self.a, self.b, self.c]
        return np.asarray(n / np.linalg.norm(n, axis=1)[:, None])

    def ray(self, unit: Floats) -> Floats:
        """Unit vectors (N, 3) towards the points `unit` in coordinates over the axes."""
        return unit

    def on(self, ray: Floats) -> Floats:
        """Where rays (N, 3) meet the surface, over the axes."""
        return ray

    def depth(self, p: Floats, q: Floats) -> Floats:
        """Depth (N,) of the surface below the middle at x = p a and z = q c, over b."""
        return np.asarray(np.sqrt(1.0 - p * p - q * q))

    def radial_projection(self, points: Floats) -> Floats:
        """Where the ways from points (N, 3) to the centre meet the surface."""
        centre = [0.0, self.centre, 0.0]
        away = points - centre
        return np.asarray(centre + away / np.linalg.norm(away / [self.a, self.b, self.c], axis=1)[:, None])


@dataclass(frozen=True)
class Body(Ellipsoid):
    r"""The body with the cross-section `section` (over its axes, of which the lower half counts) through
    its middle, and along it :math:`G^m + |z/c|^m = 1`, G the size of the section through a point over that
    in the middle: all sections have one shape. A superellipse with m its exponent makes a superellipsoid.
    """

    section: Outline = CIRCLE
    m: float = 2.0

    @property
    def smallest_radius(self) -> float:
        """Of curvature, on a grid of the lower half: the normals' derivatives by the points'."""
        angle = np.linspace(0.02, np.pi - 0.02, SAMPLES)
        s, t = (grid.ravel() for grid in np.meshgrid(angle, angle))
        ray = np.column_stack([np.sin(t) * np.cos(s), -np.sin(t) * np.sin(s), np.cos(t)])
        along = np.column_stack([-np.sin(s), -np.cos(s), 0.0 * s])
        ends = [ray + sign * STEP * way for way in (along, np.cross(ray, along)) for sign in (-1.0, 1.0)]
        moved = [self.on(one / np.linalg.norm(one, axis=1)[:, None]) for one in ends]
        point, normal = (
            np.stack([f(moved[1]) - f(moved[0]), f(moved[3]) - f(moved[2])], axis=2)
            for f in (self.point, self.normal)
        )
        across = np.swapaxes(point, 1, 2)
        shape = np.linalg.solve(across @ point, across @ normal)
        return 1.0 / float(np.linalg.eigvals(shape).real.max())

    def _size(self, points: Floats) -> tuple[Floats, Floats]:
        """G (N,) of points (N, 3) over the axes, and their angle in the section."""
        angle = np.arctan2(-np.abs(points[:, 1]), points[:, 0])
        return np.hypot(points[:, 0], points[:, 1]) / np.hypot(*self.section.point(angle).T), angle

    def ray(self, unit: Floats) -> Floats:
        return np.asarray(unit / np.linalg.norm(unit, axis=1)[:, None])

    def on(self, ray: Floats) -> Floats:
        gauge = self._size(ray)[0] ** self.m + np.abs(ray[:, 2]) ** self.m
        return np.asarray(ray * (gauge ** (-1.0 / self.m))[:, None])

    def depth(self, p: Floats, q: Floats) -> Floats:
        size = (1.0 - np.abs(q) ** self.m) ** (1.0 / self.m)
        return np.asarray(-size * self.section.point(self.section.angle_at(p / size))[:, 1])

    def normal(self, unit: Floats) -> Floats:
        size, angle = self._size(unit)
        out, at = self.section.normal(angle), self.section.point(angle)
        out *= (size ** (self.m - 1.0) / np.sum(out * at, axis=1))[:, None]
        out[:, 1] = np.where(unit[:, 1] > 0.0, -out[:, 1], out[:, 1])
        z = np.sign(unit[:, 2]) * np.abs(unit[:, 2]) ** (self.m - 1.0)
        return super().normal(np.column_stack([out, z]))


class Relief(Protocol):
    """Ridges over the smooth pad."""

    def depth(self, x: Floats, z: Floats) -> Floats:
        """Depth (mm) below the crests."""


@dataclass(frozen=True)
class Grid:
    """How the disc is divided, in quadratic cells (twice as many linear ones).

    `columns` of the rectangle at the bone; rows in which three columns merge across, `merging[0]`, and along,
    `merging[1]`; `sides`: cells from the rectangle, between `low` and `high`, each (p, q), to the rim.
    """

    columns: tuple[int, int]
    merging: tuple[tuple[int, ...], tuple[int, ...]]
    sides: int
    low: tuple[float, float] = (-RECTANGLE, -RECTANGLE)
    high: tuple[float, float] = (RECTANGLE, RECTANGLE)


@dataclass(frozen=True)
class Nail:
    """Thickness and width (mm); it is as long as it is wide, up to the rectangle's end."""

    thickness: float
    width: float


@dataclass(frozen=True)
class Solid:
    """Geometry of a whole pad (mm).

    `layers` from the surface to the bone, `thickness` of all of them but the innermost, `rows` of
    quadratic cells in each; with a `nail` the whole finger; `posture` in degrees turns the tip (+z) down.
    """

    outer: Ellipsoid
    bone: Ellipsoid
    layers: tuple[TissueLayer, ...]
    thickness: tuple[float, ...]
    rows: tuple[int, ...]
    grid: Grid
    relief: Relief | None = None
    rim_is_fixed: bool = True
    posture: float = 0.0
    nail: Nail | None = None

    def mesh(self, order: int) -> Mesh:
        """Hexahedra of `order` 1, or 2 with half the divisions and mid-nodes on the true surfaces."""
        per_cell = 3 - order
        rows = [n * per_cell for n in self.rows]
        places, cells, row = self._joined(sum(rows), per_cell, order)
        if self.nail is not None:
            places, cells, row = _doubled(places, cells, row)
        unit, r = places[:, :3], places[:, 3]
        starts = np.concatenate([[0], np.cumsum(rows)])
        points = self._turned(self._points(unit, np.interp(r, starts, np.arange(len(starts)))))
        layer = np.repeat(np.arange(len(rows)), rows)[row]
        region = np.array([one.number for one in self.layers])[layer]
        names = {one.name: one.number for one in self.layers}
        rim, bone = np.flatnonzero(unit[:, 1] == 0.0), np.flatnonzero(r == r.max())
        sets = {
            "pad": np.flatnonzero((r == 0.0) & (unit[:, 1] <= 0.0)),
            "bone": np.union1d(bone, rim) if self.rim_is_fixed else bone,
            "rim": rim,
        }
        if self.nail is not None:
            below = self._below_nail(unit[cells].mean(axis=1))
            names |= {NAIL.name: NAIL.number}
            region = np.where(below, np.where(layer == 0, NAIL.number, names[NAIL_BED]), region)
            sets["nail"] = np.intersect1d(np.flatnonzero(r == 0.0), cells[region == NAIL.number])
        kind = "hexahedron27" if order == 2 else "hexahedron"
        return Mesh(points, _right_handed(points, cells), kind, region, names, sets)

    def _joined(self, rows: int, per_cell: int, order: int) -> tuple[Floats, Ints, Ints]:
        """The five patches, common nodes once: places (N, 4) as (unit vector, row), cells, rows of cells."""
        grid = self.grid
        across, along = (n * per_cell for n in grid.columns)
        sides = grid.sides * per_cell
        # linear cells halve the rows, the first of each two merges
        merging = [[row * per_cell for row in rows] for rows in grid.merging]
        middle = block((across, along), rows, merging, order)
        over = block((across, sides), rows, [merging[0], []], order)
        beside = block((along, sides), rows, [merging[1], []], order)
        parts = [(middle, self._rectangle(middle.points))]
        parts += [(over, self._side(over.points, 1, end)) for end in (0, 1)]
        parts += [(beside, self._side(beside.points, 0, end)) for end in (0, 1)]
        places = np.vstack([np.column_stack([unit, mesh.points[:, 2]]) for mesh, unit in parts])
        first = np.cumsum([0] + [len(mesh.points) for mesh, _ in parts])
        cells = np.vstack([mesh.cells + start for (mesh, _), start in zip(parts, first, strict=False)])
        _, kept, number = np.unique(places.round(DIGITS), axis=0, return_index=True, return_inverse=True)
        row = np.concatenate([mesh.region for mesh, _ in parts])
        return places[kept], number.ravel()[cells], row

    def _rectangle(self, parameters: Floats) -> Floats:
        """Unit vectors (N, 3) of parameters (N, 3) of the middle patch."""
        low, high = np.array(self.grid.low), np.array(self.grid.high)
        p, q = (low + (high - low) * parameters[:, :2]).T
        return np.column_stack([p, -self.outer.depth(p, q), q])

    def _side(self, parameters: Floats, axis: int, end: int) -> Floats:
        """Unit vectors (N, 3) of the patch beyond the `end` (0 or 1) of an `axis` (0 x, 1 z), v outwards."""
        u, v = parameters[:, 0], parameters[:, 1]
        on_edge = np.full((len(u), 2), float(end))
        on_edge[:, 1 - axis] = u
        edge = self._rectangle(on_edge)
        start = self.outer.ray(edge)
        aside, out = 0.25 * np.pi * (2.0 * u - 1.0), 1.0 if end else -1.0
        rim = np.zeros_like(start)
        rim[:, 2 * axis], rim[:, 2 - 2 * axis] = out * np.cos(aside), np.sin(aside)
        angle = np.arccos(np.clip((start * rim).sum(axis=1), -1.0, 1.0))[:, None]
        t = v[:, None]
        ray = (np.sin((1.0 - t) * angle) * start + np.sin(t * angle) * rim) / np.sin(angle)
        ray[v == 1.0] = rim[v == 1.0]
        unit = self.outer.on(ray)
        unit[v == 0.0] = edge[v == 0.0]
        return unit

    def _points(self, unit: Floats, level: Floats) -> Floats:
        """Points (N, 3) at levels counted in layers: 0 the surface, 1 below the outermost ..."""
        foot, normal = self.outer.point(unit), self.outer.normal(unit)
        outermost, *deeper = (np.full(len(unit), depth) for depth in np.cumsum(self.thickness))
        if self.nail is not None:
            outermost += (self.nail.thickness - self.thickness[0]) * self._towards_nail(unit)
        depth = np.array([self._relief(unit, foot), outermost, *deeper])
        whole = self.nail is not None
        return layer_coordinates(
            foot,
            normal,
            depth,
            level,
            self.bone.radial_projection if whole else lambda _: self.bone.point(self.outer.ray(unit)),
        )

    def _relief(self, unit: Floats, foot: Floats) -> Floats:
        """Depth (N,) of the surface below the smooth surface."""
        if self.relief is None:
            return np.zeros(len(unit))
        low, high = np.array(self.grid.low), np.array(self.grid.high)
        share = (2.0 * unit[:, [0, 2]] - low - high) / (high - low)
        depth = faded(self.relief.depth(foot[:, 0], foot[:, 2]), share)
        return np.where(unit[:, 1] <= 0.0, depth, 0.0)

    def _below_nail(self, unit: Floats) -> Any:
        """Which of these vectors (N, 3) lie under the nail, (N,) bool."""
        assert self.nail is not None
        p, q, (low, high) = unit[:, 0], unit[:, 2], (self.grid.low[0], self.grid.high[0])
        across = (np.maximum(low, -self._half) < p) & (p < np.minimum(high, self._half))
        end = self.grid.high[1]
        return (unit[:, 1] > 0.0) & across & (end - self.nail.width / self.outer.c < q) & (q < end)

    @property
    def _half(self) -> float:
        """Half of the nail's width over the semi-axis."""
        return 0.0 if self.nail is None else 0.5 * self.nail.width / self.outer.a

    def _towards_nail(self, unit: Floats) -> Floats:
        """0 on the lower side, 1 on the nail, smooth in between."""
        corner = self.outer.depth(np.array([self._half]), np.array([self.grid.high[1]]))
        s = np.clip(unit[:, 1] / corner, 0.0, 1.0)
        return np.asarray(s * s * (3.0 - 2.0 * s))

    def _turned(self, points: Floats) -> Floats:
        """Points of the pad in its posture."""
        if self.posture == 0.0:
            return points
        c, s = math.cos(math.radians(self.posture)), math.sin(math.radians(self.posture))
        return points @ np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def _doubled(places: Floats, cells: Ints, row: Ints) -> tuple[Floats, Ints, Ints]:
    """The lower half's places (N, 4), cells and their rows, and those of its image above the rim."""
    above = np.flatnonzero(places[:, 1] != 0.0)
    number = np.arange(len(places))
    number[above] = len(places) + np.arange(above.size)
    upper = places[above] * [1.0, -1.0, 1.0, 1.0]
    return np.vstack([places, upper]), np.vstack([cells, number[cells]]), np.tile(row, 2)


def _right_handed(points: Floats, cells: Ints) -> Ints:
    """The cells, those of left-handed patches mirrored."""
    x = points[cells[:, [0, 1, 3, 4]]]
    edges = x[:, 1:] - x[:, :1]
    left = np.linalg.det(edges) < 0.0
    order = MIRRORED[: cells.shape[1]]
    return np.where(left[:, None], cells[:, order], cells)


def rows_that_merge(first: int, directions: Sequence[bool]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Rows, one after the other from `first`, that merge columns across and along: two for each of
    the `directions` that is finely divided, in turns.

    >>> rows_that_merge(1, (True, False)), rows_that_merge(1, (True, True))
    (((1, 2), ()), ((1, 3), (2, 4)))
    """
    chosen = [k for _ in range(2) for k in (0, 1) if directions[k]]
    across, along = ([first + i for i, k in enumerate(chosen) if k == axis] for axis in (0, 1))
    return tuple(across), tuple(along)

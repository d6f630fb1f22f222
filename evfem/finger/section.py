"""The mesh of a finger's cross-section: rings of layers between the outline and the bone.

The nodes of a column lie on one normal of the smooth outline, as far as the dermis reaches: there
the interfaces are true offsets of it. Straight lines towards the bone's centre
fill the hypodermis. Under the pad the columns are fine and merge three to one inwards.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from evfem.common.arrays import Floats
from evfem.finger.lattice import Lattice, ring
from evfem.finger.layers import NAIL, NAIL_BED, TissueLayer
from evfem.finger.outline import Ellipse, Outline, Ridges, layer_coordinates
from evfem.finger.scan import ScannedRidges
from evfem.mesh.mesh import Mesh

#: Over the semi-axis: where ridges begin to fade, where they end, and half the width of the finest zone with
#: and without ridges (6.00, 6.59, about 3.5 and 5.4 mm for the default width).
FULL, ZONE, FINE, FINE_SMOOTH = 0.72, 0.79, 0.42, 0.60
#: Pitch in which a smooth pad counts its columns, over the semi-axis (0.6 mm for the default width).
SMOOTH_PITCH = 0.072
#: Height of a transition row over the width of the columns that merge in it.
TRANSITION = 2.4


@dataclass(frozen=True)
class Divisions:
    """How finely to divide, in quadratic cells (twice as many linear ones).

    `per_ridge`: columns per ridge in the finest zone; `transitions`: rows in which columns merge, as (layer,
    row in it); base columns: `side` from the zone's end to the widest point, `upper` to the nail's edge,
    `nail` along it.
    """

    per_ridge: int
    transitions: tuple[tuple[str, int], tuple[str, int]]
    side: int
    upper: int
    nail: int


@dataclass(frozen=True)
class Section:
    """Geometry of a cross-section (mm).

    `layers` from the outline to the bone, `thickness` of all of them but the innermost, `rows` of
    quadratic cells in each; `nail` is the thickness of the nail.
    """

    outer: Outline
    bone: Ellipse
    layers: tuple[TissueLayer, ...]
    thickness: tuple[float, ...]
    rows: tuple[int, ...]
    nail: float
    nail_width: float
    ridges: Ridges | ScannedRidges | None
    divisions: Divisions

    def mesh(self, order: int) -> Mesh:
        """Quadrilaterals of `order` 1 or 2, the latter with half the divisions and mid-nodes on
        the true curves."""
        rows = [n * (3 - order) for n in self.rows]
        columns = Columns(self, order)
        names, start = [layer.name for layer in self.layers], np.concatenate([[0], np.cumsum(rows)])
        merging = tuple(
            int(start[names.index(name) + (row < 0)]) + row for name, row in self.divisions.transitions
        )
        lattice = ring(columns.splits, sum(rows), merging, order)
        depth = self._row_depths(rows, merging, columns.width)
        points = self._points(lattice, columns, depth)
        return self._named(points, lattice, columns, rows, order)

    def _row_depths(self, rows: list[int], merging: tuple[int, ...], width: float) -> Floats:
        """Depth of each line of the lattice, in layers: 0 the outline, 1 below the outermost ...,
        their number at the bone."""
        below = self.outer.b - self.bone.b + self.bone.centre - sum(self.thickness)
        thickness = [*self.thickness, below]
        wish = {row: TRANSITION * width * 3.0**i for i, row in enumerate(merging)}
        depths, first, size = [np.zeros(1)], 0, 1.5 * width
        for layer, (n, total) in enumerate(zip(rows, thickness, strict=True)):
            fixed = {row - first: height for row, height in wish.items() if first <= row < first + n}
            heights = _heights(n, total, size, fixed)
            depths.append(layer + np.cumsum(heights) / total)
            depths[-1][-1] = layer + 1.0
            first, size = first + n, float(heights[-1])
        return np.concatenate(depths)

    def _points(self, lattice: Lattice, columns: Columns, depth: Floats) -> Floats:
        foot, normal, interfaces = columns.at(lattice.u)
        level = np.interp(lattice.r, np.arange(len(depth)), depth)
        return layer_coordinates(foot, normal, interfaces, level, self.bone.radial_projection)

    def _named(self, points: Floats, lattice: Lattice, columns: Columns, rows: list[int], order: int) -> Mesh:
        numbers = {layer.name: layer.number for layer in (*self.layers, NAIL)}
        layer = np.repeat(np.arange(len(rows)), rows)[lattice.row]
        below_nail = np.where(layer == 0, NAIL.number, numbers[NAIL_BED])
        elsewhere = np.array([layer.number for layer in self.layers])[layer]
        region = np.where(columns.is_nail[lattice.column], below_nail, elsewhere)
        outline = np.flatnonzero(lattice.r == 0.0)
        sets = {
            "pad": outline[points[outline, 1] <= 1e-9 * self.outer.b],
            "bone": np.flatnonzero(lattice.r == lattice.r.max()),
            "nail": np.intersect1d(outline, lattice.cells[region == NAIL.number]),
        }
        kind = "quad9" if order == 2 else "quad"
        return Mesh(points, lattice.cells, kind, region, numbers, sets)


def _heights(n: int, total: float, first: float, fixed: Mapping[int, float]) -> Floats:
    """Heights of `n` rows: `fixed` ones (row -> height), the others in geometric progression from `first`."""
    heights = np.zeros(n)
    for row, height in fixed.items():
        heights[row] = np.clip(height, 0.4 * total / n, max(1.3 / n, 0.35) * total)
    free = np.setdiff1d(np.arange(n), list(fixed))
    if len(free):
        heights[free] = _progression(len(free), total - heights.sum(), first)
    return heights * total / heights.sum()


def _progression(n: int, total: float, first: float) -> Floats:
    """`n` terms with the sum `total` that start at about `first`; the last is at most eight times
    the first."""
    low, high = 8.0 ** (-1.0 / max(n - 1, 1)), 8.0 ** (1.0 / max(n - 1, 1))
    for _ in range(60):
        ratio = 0.5 * (low + high)
        terms = ratio ** np.arange(n)
        low, high = (low, ratio) if first * terms.sum() > total else (ratio, high)
    return terms * total / terms.sum()


class Columns:
    """Where the columns of the lattice stand: base columns from the nail's middle around the pad
    and back to it.

    In the zone of the pad they are equally wide in x, so that every ridge is divided in the same
    way; elsewhere equally long along the outline.
    """

    def __init__(self, section: Section, order: int) -> None:
        self.section = section
        outer, ridges, per_cell = section.outer, section.ridges, 3 - order
        pitch = ridges.pitch if ridges else SMOOTH_PITCH * outer.a
        offset = ((ridges.phase + 0.25) % 0.5 - 0.25) * pitch if ridges else 0.0
        coarsest = pitch * 9.0 / section.divisions.per_ridge
        half = per_cell * int(np.ceil((ZONE * outer.a + abs(offset)) / coarsest - 1e-9))
        fine = per_cell * max(round((FINE if ridges else FINE_SMOOTH) * outer.a / coarsest), 1)
        self.step = coarsest / per_cell
        self.width = self.step / 9.0
        self.first_x = offset - half * self.step
        around = section.divisions.side, section.divisions.upper, section.divisions.nail
        self.theta, counts = self._angles(2 * half, [n * per_cell for n in around])
        starts = np.cumsum(counts)
        number = np.arange(starts[-1])
        self.is_nail = (number < starts[0]) | (number >= starts[-2])
        self.zone = (int(starts[2]), int(starts[3]))
        middle = self.zone[0] + half
        self.splits = np.ones(len(number), dtype=np.int64)
        self.splits[self.zone[0] : self.zone[1]] = 3
        self.splits[middle - fine : middle + fine] = 9

    def _angles(self, base: int, around: list[int]) -> tuple[Floats, list[int]]:
        """Angles of the base columns' borders, and the number of columns of each stretch."""
        outer, edge = self.section.outer, self._edge
        x = self.first_x + self.step * np.arange(base + 1)
        pad = outer.angle_at(np.asarray(x, dtype=float))
        side, upper, nail = around
        left, right = nail // 2, nail - nail // 2
        right_stops = [float(pad[-1]), 0.0, edge, np.pi / 2]
        left_stops = [-1.5 * np.pi, -np.pi - edge, -np.pi, float(pad[0])]
        counts = [left, upper, side, base, side, upper, right]
        arcs = [
            outer.equal_arc_angles(*ends, n)[:-1]
            for ends, n in zip(pairwise(left_stops), counts[:3], strict=True)
        ]
        arcs.append(pad[:-1])
        arcs += [
            outer.equal_arc_angles(*ends, n)[:-1]
            for ends, n in zip(pairwise(right_stops), counts[4:], strict=True)
        ]
        return np.append(np.concatenate(arcs), np.pi / 2), counts

    @property
    def _edge(self) -> float:
        """Angle of the nail's right edge; the left one is its mirror image."""
        half = np.full(1, 0.5 * self.section.nail_width)
        return float(self.section.outer.angle_at(half, upper=True)[0])

    def at(self, u: Floats) -> tuple[Floats, Floats, Floats]:
        """Points (N, 2) and normals (N, 2) of the smooth outline, depths there of the outline and
        of the interfaces between the layers (number of layers, N)."""
        section = self.section
        first, last = self.zone
        theta = np.interp(u, np.arange(len(self.theta)), self.theta)
        inside = (u >= first) & (u <= last)
        x = self.first_x + (u[inside] - first) * self.step
        theta[inside] = section.outer.angle_at(x)
        foot, normal = section.outer.point(theta), section.outer.normal(theta)
        foot[inside, 0] = x
        foot[np.isin(theta, (0.0, -np.pi)), 1] = 0.0
        depth = section.ridges.depth(foot[:, 0]) if section.ridges else np.zeros(len(u))
        depth[foot[:, 1] >= 0.0] = 0.0
        outermost, *deeper = np.cumsum(section.thickness)
        below = outermost + (section.nail - outermost) * self._towards_nail(theta)
        return foot, normal, np.array([depth, below, *(np.full(len(u), whole) for whole in deeper)])

    def _towards_nail(self, theta: Floats) -> Floats:
        """0 on the lower side, 1 on the nail, smooth in between."""
        from_side = np.pi / 2 - np.abs((theta + np.pi / 2) % (2.0 * np.pi) - np.pi)
        s = np.clip(from_side / self._edge, 0.0, 1.0)
        return s * s * (3.0 - 2.0 * s)

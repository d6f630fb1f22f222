r"""Mapped quadrilaterals between an outline and the electrode below it.

Columns stand at the outline's points and grow away from its corners; rows follow the outline, so
that thin gaps need no small cells. From below: the slab, a block of rows up to the lower runs of
the outline, which goes on as a fraction of the height under the higher ones, a block above it, and
for a body that ends in the air a third one from its upper side to a box far away. The body itself
has no cells::

      high run       ____________          rows of block 2 end here
                    |            |
      low run  _____|- - - - - - |_____    rows of block 1 go on through the walls
      slab     -------------------------
      electrode ________________________
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.field.outlines import Outline, Run, corner_sizes, graded, right_angle, spread, spread_around

#: how fast cells grow away from a corner, per length
GROWTH = 0.7
#: width of a column on an inclined run, in lengths over which the distance to the electrode changes
WEDGE = 0.75
#: distance of the box around a body that ends in the air, in sizes of the body
BOX = 1000.0
#: how much slower they grow beside a body that ends, where the field's strength is asked for
BESIDE = 0.5
#: largest fraction of a block that one of its rows takes
ROW = 0.2


@dataclass(frozen=True, eq=False)
class FieldMesh:
    """Vertices `points` (2, n) in mm, at `line` and `row` (n,) of the grid, and `cells` (4, m) around.

    `in_slab` (m,) marks the slab's cells. `lift` (n,) is how far a vertex moves with the outline: 1
    on the body, 0 on slab and electrode. `rows` is the number of rows, `lines` that of lines.
    """

    points: Floats
    line: Ints
    row: Ints
    cells: Ints
    in_slab: Floats
    lift: Floats
    shape: tuple[int, int]
    periodic: bool

    def located(self, x: Floats, y: Floats) -> tuple[Ints, Floats]:
        """Cells (n,) and local coordinates (2, n) of points; above the air its end counts; or InputError."""
        order = np.lexsort((self.row[self.cells[0]], self.line[self.cells[0]]))
        cells = self.cells[:, order]
        column = self.line[cells[0]]
        start, first = np.unique(column, return_index=True)
        edges = np.append(self.points[0, cells[0, first]], self.points[0].max())
        if x.size and not (edges[0] <= x.min() and x.max() <= edges[-1]):
            raise InputError("x", float(x[np.argmax(np.abs(x))]), f"{edges[0]:g} to {edges[-1]:g} mm")
        at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, start.size - 1)
        ends = np.append(first, column.size)
        found = np.empty(x.size, dtype=int)
        local = np.empty((2, x.size))
        for k in range(x.size):
            own = slice(ends[at[k]], ends[at[k] + 1])
            fraction = (x[k] - edges[at[k]]) / (edges[at[k] + 1] - edges[at[k]])
            corners = self.points[1][cells[:, own]]
            low = (1.0 - fraction) * corners[0] + fraction * corners[1]
            high = (1.0 - fraction) * corners[3] + fraction * corners[2]
            row = min(int(np.searchsorted(low, y[k], side="right")) - 1, low.size - 1)
            if np.isinf(y[k]):  # the end of the air below the body, not of that above it
                gaps = np.flatnonzero(cells[3, own][:-1] != cells[0, own][1:])
                row = int(gaps[0]) if gaps.size else low.size - 1
            if row < 0 or (np.isfinite(y[k]) and y[k] > high[row]):
                raise InputError("y", float(y[k]), f"positions in slab or air: {low[0]:g} to {high[-1]:g} mm")
            found[k] = own.start + row
            local[:, k] = fraction, min(1.0, (y[k] - low[row]) / (high[row] - low[row]))
        return order[found], local


def fractions(low: float, high: float, growth: float) -> Floats:
    """Rows of a block as fractions of its height, with rows of the prescribed sizes at its two ends."""
    return graded(0.0, 1.0, (low, high), growth, ROW, 3)


def columns(run: Run, sizes: Floats, reduced: float, growth: float) -> Floats:
    """Lines of a run: at its points and, where cells must be smaller, between them."""
    lines = [run.x[:1]]
    distance = run.height + reduced
    slope = np.abs(np.diff(run.height) / np.diff(run.x))
    for k, rate in enumerate(slope):
        ends = np.minimum(sizes[k : k + 2], WEDGE * distance[k : k + 2] / rate if rate else np.inf)
        least = 2 if run.x.size == 2 else 1
        lines.append(graded(run.x[k], run.x[k + 1], tuple(ends), growth, np.inf, least)[1:])
    return np.concatenate(lines)


@dataclass(frozen=True)
class _Ends:
    """A body that ends in the air: `sizes` of the cells at its two ends and height of the `box` (mm); `foot`
    and `edge` are sizes at the lower and upper end of its end walls, relative to the two blocks beside them.
    """

    sizes: tuple[float, float]
    box: float
    foot: float = np.inf
    edge: float = np.inf

    @classmethod
    def of(cls, outline: Outline, runs: list[Run], near: list[Floats], slab: tuple[float, float]) -> _Ends:
        """Ends of an outline with cells of the sizes `near`, over a slab of (reduced) thickness."""
        thickness, reduced = slab
        box = BOX * (outline.length + float(outline.lid(outline.x).max()) + thickness)
        sizes, feet, edges = [], [np.inf], [np.inf]
        for end, run in ((0, 0), (-1, -1)):
            low, top = float(runs[run].height[end]), outline.tops[end]
            sizes.append(min(float(near[run][end]), low + reduced))
            if top > low:
                feet.append(sizes[-1] / (0.5 * (top - low)))
                edges.append(right_angle(top + reduced) / (0.5 * (top - low)))
        return cls((sizes[0], sizes[1]), box, min(feet), min(edges))


@dataclass(frozen=True, eq=False)
class Rows:
    """Shares of slab and blocks at which their rows stand."""

    slab: Floats
    blocks: tuple[Floats, ...]


def rows_of(runs: list[Run], corners: list[Floats], near: list[Floats], thickness: float, growth: float,
            ends: _Ends | None) -> Rows:  # fmt: skip
    """Rows that are small where corners are; `ends` are those of a body that ends in the air."""
    lower: float = np.inf
    above = [np.inf if ends is None else ends.foot, np.inf]
    for run, size in zip(runs, corners, strict=True):
        if run.rank == 1:
            lower = min(lower, float(np.min(size / run.height)))
            continue
        fraction = np.interp(run.x, run.x[[0, -1]], run.shares)
        block = run.height * (1.0 - fraction)
        high = block > 0.0
        above[1] = min(above[1], float((size[high] / block[high]).min()))
    for run, other, foot, end in _walls(runs, corners):
        above[0] = min(above[0], foot / (other.height[end] - run.height[-1 - end]))
    depth = min(float(np.maximum(run.height, size).min()) for run, size in zip(runs, near, strict=True))
    slab = np.zeros(1) if thickness == 0.0 else fractions(np.inf, depth / thickness, growth) - 1.0
    blocks = [fractions(np.inf, lower, growth)]
    if ends is not None or any(run.rank == 2 for run in runs):
        blocks.append(fractions(above[0], above[1], growth))
    if ends is not None:
        blocks.append(fractions(np.inf, ends.edge, growth))
        blocks.append(graded(0.0, 1.0, (min(ends.sizes) / ends.box, np.inf), growth, 1.0, 3))
    return Rows(slab * thickness, tuple(blocks))


def _walls(runs: list[Run], corners: list[Floats]) -> list[tuple[Run, Run, float, int]]:
    """Low run, high run, corner's size and the high run's end (0 or -1) of each wall."""
    walls = []
    for k, run in enumerate(runs):
        for end, step in ((0, -1), (-1, 1)):
            other = runs[(k + step) % len(runs)]
            if run.rank == 2 and run.shares[end] < 1.0:
                size = float(corners[(k + step) % len(runs)][-1 - end])
                walls.append((other, run, size, end))
    return walls


def make_mesh(outline: Outline, thickness: float, reduced: float, growth: float = GROWTH) -> FieldMesh:
    """Mesh of the air below `outline` and of a slab: `thickness` (mm), `reduced` over its permittivity."""
    runs = outline.runs()
    corners = corner_sizes(outline, runs, reduced)
    x = np.concatenate([run.x for run in runs])
    spreading = spread_around if outline.periodic else spread
    smallest = spreading(x, np.concatenate(corners), growth)
    near = np.split(smallest, np.cumsum([run.x.size for run in runs])[:-1])
    lines = [columns(run, size, reduced, growth) for run, size in zip(runs, near, strict=True)]
    ends = None if outline.periodic else _Ends.of(outline, runs, near, (thickness, reduced))
    rows = rows_of(runs, corners, near, thickness, growth, ends)
    grid = _Grid(rows, runs, lines, outline)
    if ends is not None:
        grid.surround(ends, growth)
    return grid.mesh()


class _Grid:
    """The grid while it is built: heights (rows + 1, lines + 1), not a number where no vertex is."""

    def __init__(self, rows: Rows, runs: list[Run], lines: list[Floats], outline: Outline) -> None:
        self.rows, self.outline = rows, outline
        self.x = np.concatenate([lines[0][:1], *(line[1:] for line in lines)])
        ends = np.cumsum([0, *(rows.slab.size - 1, *(block.size - 1 for block in rows.blocks))])
        self.tops = ends[1:]  # row at the top of slab, block 1, block 2, block 3
        self.y = np.full((ends[-1] + 1, self.x.size), np.nan)
        self.used = np.zeros((ends[-1], self.x.size - 1), dtype=bool)
        places = np.cumsum([0, *(line.size - 1 for line in lines)])
        order = sorted(range(len(runs)), key=lambda k: -runs[k].rank)
        for k in order:  # low runs last: walls end where they say
            self._add(runs[k], lines[k], slice(places[k], places[k + 1]))

    def _fill(self, block: int, at: slice, low: Floats, high: Floats) -> None:
        fraction = self.rows.blocks[block][:, None]
        self.y[self.tops[block] : self.tops[block + 1] + 1, at] = low + fraction * (high - low)

    def _add(self, run: Run, x: Floats, cells: slice) -> None:
        at = slice(cells.start, cells.stop + 1)
        height = np.interp(x, run.x, run.height)
        level = height * np.interp(x, run.x[[0, -1]], run.shares)
        self.y[: self.tops[0] + 1, at] = self.rows.slab[:, None]
        if run.rank == 2:
            self._fill(1, at, level, height)
        self._fill(0, at, np.zeros_like(x), level)
        self.used[: self.tops[run.rank], cells] = True

    def surround(self, ends: _Ends, growth: float) -> None:
        """Air beside and above a body that ends in the air."""
        top = ends.box
        self._fill(3, slice(None), self.outline.lid(self.x), np.full(self.x.size, top))
        self.used[self.tops[3] :, :] = True
        lid = np.array(self.outline.tops)
        low = self.y[self.tops[1], [0, -1]].copy()
        for end, size in zip((0, -1), ends.sizes, strict=True):
            away = graded(0.0, top, (size, np.inf), BESIDE * growth, np.inf, 3)[1:]
            self._beside(end, away, low[end], lid[end], top)

    def _beside(self, end: int, away: Floats, low: float, lid: float, top: float) -> None:
        """Columns beside an end; without a wall there the rows of the wall fan out from it."""
        away = np.append(0.0, away)
        fan = np.minimum(away, self.outline.length) if lid == low else 0.0 * away
        y = np.full((self.y.shape[0], away.size), np.nan)
        y[: self.tops[0] + 1] = self.rows.slab[:, None]
        levels = [0.0 * fan, low + 0.0 * fan, 0.5 * (low + lid + fan), lid + fan, top + 0.0 * fan]
        for k, fraction in enumerate(self.rows.blocks):
            rows = slice(self.tops[k], self.tops[k + 1] + 1)
            y[rows] = levels[k] + fraction[:, None] * (levels[k + 1] - levels[k])
        x = self.x[end] + (away if end else -away)
        self.y[:, end] = y[:, 0]
        order = slice(1, None) if end else slice(None, 0, -1)
        used = np.ones((self.used.shape[0], away.size - 1), dtype=bool)
        parts = [(self.x, x[order]), (self.y, y[:, order]), (self.used, used)]
        joined = [np.concatenate(pair if end else pair[::-1], axis=-1) for pair in parts]
        self.x, self.y, self.used = joined

    def mesh(self) -> FieldMesh:
        """The vertices and cells in use; cells of no height are left out."""
        y = self.y
        upper, lower = y[1:], y[:-1]
        with np.errstate(invalid="ignore"):
            open_left, open_right = (upper > lower)[:, :-1], (upper > lower)[:, 1:]
        row, line = np.nonzero(self.used & (open_left | open_right))
        number = np.arange(y.size).reshape(y.shape)
        corners = np.stack([number[row, line], number[row, line + 1], number[row + 1, line + 1],
                            number[row + 1, line]])  # fmt: skip
        kept, cells = np.unique(corners, return_inverse=True)
        at_row, at_line = np.divmod(kept, y.shape[1])
        points = np.stack([self.x[at_line], y[at_row, at_line]])
        in_slab = (row < self.tops[0]).astype(float)
        shape = (y.shape[0] - 1, y.shape[1] - 1)
        return FieldMesh(points, at_line, at_row, cells.reshape(4, -1), in_slab, self._lift(points), shape,
                         self.outline.periodic)  # fmt: skip

    def _lift(self, points: Floats) -> Floats:
        """1 on the body, 0 on the slab, falling over the distance to the nearest low point."""
        outline, x = self.outline, self.x
        low = np.full(x.size, np.inf)
        for piece in outline.pieces():
            inside = (x >= piece.x[0]) & (x <= piece.x[-1])
            low[inside] = np.minimum(low[inside], np.interp(x[inside], piece.x, piece.height))
        low[x < outline.x[0]], low[x > outline.x[-1]] = low[np.isfinite(low)][[0, -1]]
        if outline.periodic:
            low[[0, -1]] = min(low[0], low[-1])
        reach = (spread_around if outline.periodic else spread)(x, low, 1.0)
        return np.clip(points[1] / np.interp(points[0], x, reach), 0.0, 1.0)

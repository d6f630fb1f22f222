"""Outlines of grounded bodies above a slab: polylines with vertical walls, their ends and corners.

An outline is straight between its points, vertical where an x is repeated. A periodic one repeats from its
last x on, with a wall where its two heights differ. Another one ends in the open air: the body lies between
it and the straight line between its ends; ends steeper than `FLANK`, but no walls, are flanks of a body
symmetric about it.

At a corner whose air angle is w the potential grows like r^(pi/w), so the field is singular where
w > pi; `corner_sizes` says how small cells must be there.

The field's mesh has rows that follow the outline. They are pinned at walls: each wall parts a low
run (`rank` 1, one block of rows) from a high one (`rank` 2, two blocks, the lower of which goes on
through the wall). A run that is low at one end and high at the other is split in the middle.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, finite
from evfem.errors import InputError

#: ends of an outline steeper than this, ``|n_y| < 0.3``, are flanks of a body that goes on above
FLANK = 0.3
MONOTONE_WALLS = "walls that go one way"
#: heights closer than this share of the largest length are one height
SAME = 1e-12
#: fraction of the energy around a corner that its smallest cells may miss
CORNER = 1e-7
#: the same of what a corner close to the slab adds, whose own field ends at the gap
TIP = 1e-4
#: size of the smallest cells at a curve, in its radii
ROUND = 0.25
#: angle in rad below which a point is on the line between its neighbours
STRAIGHT = 1e-10
#: chords between two corners that are steeper than this are walls
WALL = 20.0
#: angle in rad below which a point is one of a curve, not a corner
TURN = np.radians(15.0)


@dataclass(frozen=True)
class Run:
    """A piece of an outline between walls: points `x`, `height` (mm); of rank 2 with block `shares`."""

    x: Floats
    height: Floats
    rank: int = 1
    shares: tuple[float, float] = (1.0, 1.0)


@dataclass(frozen=True)
class Outline:
    """A checked outline: points `x`, `height` in mm without repetitions but those of walls; those at
    x = `smooth[0]` are points of a curve with radii `smooth[1]` (M,) in mm, not corners.

    >>> Outline.of([0.0, 0.3, 0.3, 0.5], [0.05, 0.05, 2.0, 2.0]).runs()[1].rank
    2
    """

    x: Floats
    height: Floats
    periodic: bool
    smooth: Floats = field(default_factory=lambda: np.zeros((2, 0)))

    @classmethod
    def of(cls, x: Values, height: Values, periodic: bool = True) -> Outline:
        """The outline of these points; InputError for what is none."""
        x = np.atleast_1d(np.asarray(finite("x", x, "positions in mm, finite numbers"), dtype=float))
        height = np.atleast_1d(np.asarray(finite("height", height, "heights in mm"), dtype=float))
        if x.ndim != 1 or x.size < 2 or height.shape != x.shape:
            shapes = f"shapes {x.shape} and {height.shape}"
            raise InputError("x, height", shapes, "two rows of numbers, of the same length, at least 2")
        if np.any(np.diff(x) < 0.0) or x[-1] <= x[0]:
            raise InputError(
                "x", "positions that go back", "positions that do not decrease; equal ones are a wall"
            )
        if height.min() < 0.0:
            raise InputError("height", float(height.min()), "heights in mm above the slab, not negative")
        if periodic:
            x, height = _without_end_walls(x, height)
        x = _upright(x, height)
        keep = _without_repetitions(x, height)
        outline = cls(x[keep], height[keep], bool(periodic))
        if not periodic and any(top < end for top, end in zip(outline.tops, outline.feet, strict=True)):
            raise InputError("height", "a wall at an end that hangs down", "end walls that rise")
        return outline

    @property
    def length(self) -> float:
        """From the first to the last x: the period of a periodic outline."""
        return float(self.x[-1] - self.x[0])

    @property
    def tops(self) -> tuple[float, float]:
        """Heights of the two ends, above the walls that may stand there."""
        return float(self.height[0]), float(self.height[-1])

    @property
    def feet(self) -> tuple[float, float]:
        """Heights of the two ends, below the walls that may stand there."""
        walls = self.x[1] == self.x[0], self.x[-2] == self.x[-1]
        return float(self.height[int(walls[0])]), float(self.height[-1 - int(walls[1])])

    @property
    def is_flanked(self) -> bool:
        """Whether both ends are steep: flanks of a body that goes on above."""
        dx, dh = np.diff(self.x)[[0, -1]], np.diff(self.height)[[0, -1]] * [-1.0, 1.0]
        return bool(np.all(dh > 0.0) and np.all(dx > 0.0) and np.all(dx < FLANK * np.hypot(dx, dh)))

    def lid(self, x: Floats) -> Floats:
        """Upper side (mm) of a body that ends in the air: stretched over it, or its mirror image."""
        side = -1.0 if self.is_flanked else 1.0
        hull = side * np.interp(x, *_stretched(self.x, side * self.height))
        chord = np.interp(x, self.x[[0, -1]], self.height[[0, -1]])
        return np.asarray(2.0 * chord - hull if self.is_flanked else hull)

    def lifted(self, lowest: float) -> Outline:
        """The same outline, nowhere lower than `lowest`, with points where it leaves that height."""
        h, dh = self.height[:-1], np.diff(self.height)
        crossing = (h - lowest) * (self.height[1:] - lowest) < 0.0
        at = np.flatnonzero(crossing & (np.diff(self.x) > 0.0))
        new = self.x[at] + (lowest - h[at]) / dh[at] * (self.x[at + 1] - self.x[at])
        x, height = np.insert(self.x, at + 1, new), np.insert(self.height, at + 1, lowest)
        return Outline(x, np.maximum(height, lowest), self.periodic, self.smooth)

    def pieces(self) -> list[Run]:
        """The outline cut at its walls; walls at the two ends belong to no piece."""
        walls = np.flatnonzero(np.diff(self.x) == 0.0) + 1
        cuts = [0, *walls, self.x.size]
        pieces = [Run(self.x[a:b], self.height[a:b]) for a, b in pairwise(cuts)]
        return [piece for piece in pieces if piece.x.size > 1]

    def runs(self) -> list[Run]:
        """Pieces with their ranks, none of them low at one end and high at the other."""
        pieces = self.pieces()
        ends = [(piece.height[0], piece.height[-1]) for piece in pieces]
        left = [ends[i - 1][1] for i in range(len(ends))]
        right = [ends[(i + 1) % len(ends)][0] for i in range(len(ends))]
        if not self.periodic:
            left[0] = right[-1] = np.inf
        near = SAME * max(self.length, self.height.max())
        runs = []
        for piece, low, high in zip(pieces, left, right, strict=True):
            shares = tuple(
                float(other / own) if other < own - near else None
                for other, own in zip((low, high), (piece.height[0], piece.height[-1]), strict=True)
            )
            runs += _ranked(piece, *shares)
        return runs


def _stretched(x: Floats, height: Floats) -> tuple[Floats, Floats]:
    """Corners of the line stretched over points in ascending order of `x`."""
    corners: list[int] = []
    for k in range(x.size):
        while len(corners) > 1:
            a, b = corners[-2:]
            if (x[b] - x[a]) * (height[k] - height[a]) < (x[k] - x[a]) * (height[b] - height[a]):
                break
            corners.pop()
        if corners and x[k] == x[corners[-1]] and height[k] <= height[corners[-1]]:
            continue
        if len(corners) == 1 and x[k] == x[corners[0]]:
            corners.pop()
        corners.append(k)
    return x[corners], height[corners]


def _without_end_walls(x: Floats, height: Floats) -> tuple[Floats, Floats]:
    """A period whose wall, if there is one, is between its last and its first point."""
    first, last = int(np.searchsorted(x, x[0], "right")) - 1, int(np.searchsorted(x, x[-1]))
    seam = np.diff(np.concatenate([height[last:], height[: first + 1]]))
    if np.any(seam > 0.0) and np.any(seam < 0.0):
        raise InputError("height", "a wall that goes up and down where the period ends", MONOTONE_WALLS)
    return x[first : last + 1], height[first : last + 1]


def _upright(x: Floats, height: Floats) -> Floats:
    """The positions, with nearly vertical walls between two corners made vertical at their foot."""
    x, dx, dh = x.copy(), np.diff(x), np.diff(height)
    step = np.where(np.abs(dh) > WALL * dx, np.sign(dh), 0.0) * (dx > 0.0)
    cuts = np.flatnonzero(np.diff(step)) + 1
    for a, b in pairwise([0, *cuts, step.size]):
        if step[a] == 0.0:
            continue
        beyond = [(dx[k] + 1j * dh[k]) / (dx[own] + 1j * dh[own])
                  for k, own in ((a - 1, a), (b, b - 1)) if 0 <= k < step.size]  # fmt: skip
        if all(abs(np.angle(ratio)) >= TURN for ratio in beyond):
            x[a : b + 1] = x[a if step[a] > 0.0 else b]
    return x


def _straight(x: Floats, height: Floats) -> Any:
    """Inner points on the line between their neighbours."""
    step = np.diff(x) + 1j * np.diff(height)
    turned = np.abs((step[1:] * step[:-1].conj()).imag) <= STRAIGHT * np.abs(step[1:] * step[:-1])
    return turned & ((step[1:] * step[:-1].conj()).real > 0.0)


def _without_repetitions(x: Floats, height: Floats) -> Floats:
    """Points to keep: at most two of each x, none twice."""
    same = np.diff(x) == 0.0
    rises = np.sign(np.diff(height)) * same
    inner = same[:-1] & same[1:]
    if np.any(inner & (rises[:-1] * rises[1:] < 0)):
        raise InputError("height", "a wall that goes up and down at one x", MONOTONE_WALLS)
    keep = np.ones(x.size, dtype=bool)
    keep[1:-1] = ~inner & ~_straight(x, height)
    near = SAME * max(float(x[-1] - x[0]), float(height.max()))
    twice = np.append(same & (np.abs(np.diff(height)) <= near), False)
    return np.asarray(keep & ~twice)


def _ranked(piece: Run, left: float | None, right: float | None) -> list[Run]:
    """The piece with its rank; `left` and `right` are the shares of its height where lower neighbours end."""
    if left is None and right is None:
        return [piece]
    if left is not None and right is not None:
        return [replace(piece, rank=2, shares=(left, right))]
    middle = 0.5 * (piece.x[0] + piece.x[-1])
    nearest = float(piece.x[np.argmin(np.abs(piece.x - middle))])
    if abs(nearest - middle) < 0.1 * (piece.x[-1] - piece.x[0]):
        middle = nearest
    height = float(np.interp(middle, piece.x, piece.height))
    before, after = piece.x < middle, piece.x > middle
    first = Run(np.append(piece.x[before], middle), np.append(piece.height[before], height))
    last = Run(np.insert(piece.x[after], 0, middle), np.insert(piece.height[after], 0, height))
    if left is not None:
        return [replace(first, rank=2, shares=(left, 1.0)), last]
    assert right is not None
    return [first, replace(last, rank=2, shares=(1.0, right))]


def corner_sizes(outline: Outline, runs: list[Run], reduced: float) -> list[Floats]:
    """Sizes (mm) of the smallest cells at the points of each run; infinite where nothing turns.

    `reduced` is the slab's thickness over its permittivity, which adds to the gap.
    """
    x, h = (np.concatenate([getattr(run, name) for run in runs]) for name in ("x", "height"))
    if outline.periodic:
        before, after = (x[-1] - outline.length, h[-1]), (x[0] + outline.length, h[0])
    else:
        before, after = _beyond(outline, 0), _beyond(outline, -1)
    along = np.diff(np.concatenate([[before[0]], x, [after[0]]])) + 1j * np.diff(
        np.concatenate([[before[1]], h, [after[1]]])
    )
    into, out = along[:-1].copy(), along[1:].copy()
    still = SAME * max(outline.length, float(h.max()))
    for k in range(x.size):  # a run's end may repeat the point of its neighbour
        if abs(into[k]) <= still:
            into[k] = into[k - 1]
        if abs(out[-1 - k]) <= still:
            out[-1 - k] = out[-k]
    angle = np.pi + np.angle(out / into) if outline.periodic else np.pi + _turn(out / into)
    power = np.pi / np.maximum(angle, 1e-3)
    with np.errstate(divide="ignore", over="ignore"):
        wide, close = ((error / (power - 1.0) ** 2) ** (0.5 / power) for error in (CORNER, TIP))
        sizes = np.maximum(np.minimum((h + reduced) * wide, h * close), still)
    at, radius = outline.smooth
    known = np.isin(x, at)
    sizes[known] = ROUND * radius[np.searchsorted(at, x[known])]
    return np.split(sizes, np.cumsum([run.x.size for run in runs])[:-1])


def right_angle(distance: float) -> float:
    """Size (mm) of the smallest cells at the edge of a block, `distance` from the electrode."""
    return float(distance * (9.0 * CORNER) ** 0.75)


def _turn(ratio: Any) -> Floats:
    """Angles turned, where a full turn back is the edge of a sheet."""
    turned = np.angle(ratio)
    return np.where(turned < -np.pi + 1e-9, turned + 2.0 * np.pi, turned)


def _beyond(outline: Outline, end: int) -> tuple[float, float]:
    """The body's next point beyond an end: on its wall or its lid."""
    inner = 1 if end == 0 else -2
    if outline.x[inner] == outline.x[end]:
        return float(outline.x[end]), float(outline.height[end])
    x = np.asarray(outline.x[inner])
    return float(x), float(outline.lid(x))


def spread(x: Floats, values: Floats, growth: float) -> Floats:
    """The smallest of `values` + growth * distance over all points of ascending `x`, at each point: the
    highest curve below the values that is nowhere steeper than `growth`.

    >>> spread(np.array([0.0, 1.0, 2.0]), np.array([5.0, 1.0, 9.0]), 2.0).tolist()
    [3.0, 1.0, 3.0]
    """
    left = growth * x + np.minimum.accumulate(values - growth * x)
    right = np.minimum.accumulate((values + growth * x)[::-1])[::-1] - growth * x
    return np.asarray(np.minimum(values, np.minimum(left, right)))


def spread_around(x: Floats, values: Floats, growth: float) -> Floats:
    """`spread` over one period, from the first to the last `x`, of values that repeat."""
    ends = values.copy()
    for _ in range(2):  # the smallest value may stand right before the seam
        ends = spread(x, ends, growth)
        ends[[0, -1]] = ends[[0, -1]].min()
    return spread(x, ends, growth)


def graded(a: float, b: float, sizes: tuple[float, float], growth: float, most: float, least: int) -> Floats:
    """Places from `a` to `b`: cells of about `sizes` at the two ends grow by `growth` per length, to
    at most `most`; at least `least` cells.

    >>> np.round(graded(0.0, 1.0, (0.1, 1.0), 1.0, 1.0, 1), 3).tolist()
    [0.0, 0.123, 0.396, 1.0]
    """
    length = b - a
    small = [min(size, most, length) for size in sizes]
    if least == 1 and min(small) >= length:
        return np.array([a, b])
    half = [np.append(0.0, np.geomspace(1e-2 * size, length, 200)) for size in small]
    t = np.unique(np.concatenate([half[0], length - half[1]]).clip(0.0, length))
    width = np.minimum(np.minimum(small[0] + growth * t, small[1] + growth * (length - t)), most)
    number = np.append(0.0, np.cumsum(np.diff(t) * 0.5 * (1.0 / width[1:] + 1.0 / width[:-1])))
    cells = max(least, int(np.ceil(number[-1] - 1e-9)))
    places = a + np.interp(np.linspace(0.0, number[-1], cells + 1), number, t)
    places[0], places[-1] = a, b
    return places

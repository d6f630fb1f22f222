"""Directions in the plane of the display, and friction over x and z (mm) of it.

What varies along one direction of the display (`OneWay`) has `height`, `slope` and `curvature` of the
distance along that direction, and coefficients of friction over x. Places are (..., 1) in the plane, x
alone, and (..., 2) in space, x and z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.checks import Within, number, set_frozen
from evfem.common.tables import numbers
from evfem.errors import InputError

#: what the angle of a surface may be
ANGLE = number("an angle in degrees from -360 to 360", Within(-360.0, 360.0), "degrees")
MAP = (
    "x and z (mm) that do not decrease, each value at most twice and not at an end, within 1e6 mm, and "
    "coefficients from 0 to 100 in one row for each z, at most 1000000"
)
ROUGHEST, FARTHEST, MOST = 100.0, 1e6, 1_000_000


def direction(angle: float) -> tuple[float, float]:
    """x and z of the unit vector at an angle (degrees) from +x; quarter turns are exact.

    >>> direction(90.0), direction(-180.0)
    ((-0.0, 1.0), (-1.0, -0.0))
    """
    quarters, rest = divmod(angle, 90.0)
    x, z = math.cos(math.radians(rest)), math.sin(math.radians(rest))
    for _ in range(int(quarters) % 4):
        x, z = -z, x
    return x, z


class OneWay:
    """A surface that is the same across the direction of its `angle` (degrees from +x)."""

    angle: float = 0.0

    @property
    def crosses(self) -> bool:
        """Whether it does not vary along x alone, so that a finger in the plane cannot have it."""
        return self.angle != 0.0 or self._map is not None

    @property
    def _map(self: Any) -> FrictionMap | None:
        """Its coefficients over x and z, or None."""
        return self.friction if isinstance(self.friction, FrictionMap) else None

    def relief(self: Any, place: Floats) -> tuple[Floats, Floats, Floats]:
        """Heights (...) in mm at places (..., d), slopes (..., d) along x and z, and curvatures (..., d, d)
        in 1/mm.
        """
        way = np.array(direction(self.angle)[: place.shape[-1]])
        along = place @ way
        slope, curvature = np.asarray(self.slope(along)), np.asarray(self.curvature(along))
        return (
            np.asarray(self.height(along)),
            slope[..., None] * way,
            curvature[..., None, None] * np.outer(way, way),
        )

    def friction_at(self: Any, place: Floats) -> Floats:
        """Coefficients of friction (...) at places (..., d)."""
        if self._map is not None:
            return np.asarray(self._map.at(place))
        return np.asarray(self.friction_coefficient(place[..., 0]))

    def friction_gradient(self: Any, place: Floats) -> Floats:
        """Derivatives (..., d) of the coefficient along x and z, in 1/mm, jumps left out."""
        if self._map is not None:
            return np.asarray(self._map.gradient(place))
        found = np.zeros(place.shape)
        found[..., 0] = self.friction_slope(place[..., 0])
        return found

    def friction_steps(self: Any, short: float) -> tuple[Steps, ...]:
        """Jumps of the coefficient, in tables over x also ramps shorter than `short` (mm): a node that
        crosses such a ramp in one iteration sees a jump at its rougher end.
        """
        if self._map is not None:
            return tuple(self._map.steps)
        jumps, ramps = self.friction_jumps, getattr(self, "friction_ramps", np.zeros((0, 4)))
        begin, end, before, behind = ramps[ramps[:, 1] - ramps[:, 0] < short].T
        place = np.where(behind > before, end, begin)
        both = np.concatenate([jumps, np.stack([place, before, behind], axis=1)])
        place, before, behind = both[np.argsort(both[:, 0], kind="stable")].T
        return (Steps(0, place, before[:, None], behind[:, None], np.zeros(1)),) if place.size else ()


@dataclass(frozen=True, eq=False)
class Steps:
    """Where the coefficient jumps along x (`axis` 0) or z (1): `place` (J,) in mm, ascending, and the
    coefficients (J, M) `before` and `behind` at M positions `over` (mm) across, linear in between.
    """

    axis: int
    place: Floats
    before: Floats
    behind: Floats
    over: Floats

    def sides(self, which: Ints, across: Floats) -> tuple[Floats, Floats]:
        """Coefficients (k,) before and behind the jumps `which` (k,) at positions (k,) across."""
        right = np.clip(np.searchsorted(self.over, across), 1, max(self.over.size - 1, 1))
        left, right = right - 1, np.minimum(right, self.over.size - 1)
        length = self.over[right] - self.over[left]
        part = np.clip((across - self.over[left]) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        before, behind = (
            value[which, left] + part * (value[which, right] - value[which, left])
            for value in (self.before, self.behind)
        )
        return before, behind


@dataclass(frozen=True, eq=False)
class FrictionMap:
    """Coefficients of friction over the display: `friction` (rows z, columns x) at `x` and `z` (mm).

    Linear in between along both, constant beyond the ends. At an x (or z) that stands twice the coefficient
    jumps: the later column (or row) holds from there on.

    >>> tiles = FrictionMap([-1, 0, 0, 1], [0, 1], [[0.2, 0.2, 0.5, 0.5], [0.2, 0.2, 0.7, 0.7]])
    >>> tiles.at(np.array([[-0.5, 0.5], [0.0, 0.0], [2.0, 0.5]])).round(12).tolist()
    [0.2, 0.5, 0.6]
    """

    x: Any
    z: Any
    friction: Any

    def __post_init__(self) -> None:
        x, z = (numbers(f"surface.friction.{name}", getattr(self, name), MAP) for name in ("x", "z"))
        friction = numbers("surface.friction.friction", self.friction, MAP, axes=2)
        for name, grid in (("x", x), ("z", z)):
            way = np.diff(grid)
            twice = (way[1:] == 0.0) & (way[:-1] == 0.0)
            ends = way.size == 0 or way[0] == 0.0 or way[-1] == 0.0
            if ends or (way < 0.0).any() or twice.any() or np.abs(grid).max() > FARTHEST:
                raise InputError(f"surface.friction.{name}", f"{len(grid)} positions", MAP)
        if friction.shape != (len(z), len(x)) or friction.size > MOST:
            given = f"coefficients in {' x '.join(map(str, friction.shape))}"
            raise InputError("surface.friction.friction", given, MAP)
        if friction.min() < 0.0 or friction.max() > ROUGHEST:
            raise InputError("surface.friction.friction", f"{friction.min():g} to {friction.max():g}", MAP)
        set_frozen(self, x=x, z=z, friction=friction)

    def __repr__(self) -> str:
        span = f"x {self.x[0]:.4g} to {self.x[-1]:.4g} mm, z {self.z[0]:.4g} to {self.z[-1]:.4g} mm"
        low, high = self.friction.min(), self.friction.max()
        return f"FrictionMap({len(self.z)} x {len(self.x)} points, {span}, {low:.4g} to {high:.4g})"

    def at(self, place: Floats) -> Floats:
        """Coefficients (...) at places (..., 2), z = 0 at places (..., 1)."""
        value, _ = self._found(place)
        return value

    def gradient(self, place: Floats) -> Floats:
        """Derivatives (..., d) along x and z at places (..., d), in 1/mm, jumps left out."""
        return self._found(place)[1][..., : place.shape[-1]]

    def _found(self, place: Floats) -> tuple[Floats, Floats]:
        x = place[..., 0]
        z = place[..., 1] if place.shape[-1] > 1 else np.zeros_like(x)
        (i, t, dt), (k, s, ds) = _within(self.x, x), _within(self.z, z)
        f = self.friction
        low = f[k, i] + t * (f[k, i + 1] - f[k, i])
        high = f[k + 1, i] + t * (f[k + 1, i + 1] - f[k + 1, i])
        by_x = (1.0 - s) * (f[k, i + 1] - f[k, i]) + s * (f[k + 1, i + 1] - f[k + 1, i])
        return low + s * (high - low), np.stack([by_x * dt, (high - low) * ds], axis=-1)

    @cached_property
    def steps(self) -> tuple[Steps, ...]:
        """Its jumps along x and along z."""
        found = []
        ways = (0, self.x, self.z, self.friction.T), (1, self.z, self.x, self.friction)
        for axis, grid, over, value in ways:
            at = np.flatnonzero(np.diff(grid) == 0.0)
            at = at[(value[at] != value[at + 1]).any(axis=1)]
            if at.size:
                found.append(Steps(axis, grid[at], value[at], value[at + 1], over))
        return tuple(found)

    @property
    def columns(self) -> dict[str, Any]:
        """Its data as a scene file holds them."""
        return {"x": self.x.tolist(), "z": self.z.tolist(), "friction": self.friction.tolist()}


def _within(grid: Floats, at: Floats) -> tuple[Ints, Floats, Floats]:
    """Interval of the grid in which places lie, the part of it, and that part's growth per mm."""
    i = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    length = grid[i + 1] - grid[i]
    part = (at - grid[i]) / np.where(length > 0.0, length, 1.0)
    inside = (part >= 0.0) & (part < 1.0)
    return i, np.clip(part, 0.0, 1.0), np.where(inside, 1.0 / np.where(length > 0.0, length, 1.0), 0.0)

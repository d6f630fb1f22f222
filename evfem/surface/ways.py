"""Surfaces that vary along one direction of the display, and friction maps over x and z (mm).

A unidirectional surface has `height`, `slope` and `curvature` as functions of the distance along its
direction, and friction coefficients over x. Positions on the display are (..., 1) in the plane, x alone,
and (..., 2) in space, x and z.
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

#: admissible angles of a surface's direction
ANGLE = number("an angle in degrees from -360 to 360", Within(-360.0, 360.0), "degrees")
MAP = (
    "x and z (mm) strictly increasing, where a repeated value marks a discontinuity (not at the ends), "
    "within 1e6 mm, and coefficients from 0 to 100 in one row for each z, at most 1000000"
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


class Unidirectional:
    """A surface that varies along one direction, at `angle` (degrees from +x), and not across it."""

    angle: float = 0.0

    @property
    def crosses(self) -> bool:
        """Whether the surface varies along z too, so that it needs a model in space."""
        return self.angle != 0.0 or self._map is not None

    @property
    def _map(self: Any) -> FrictionMap | None:
        """The friction map over x and z; None without one."""
        return self.friction if isinstance(self.friction, FrictionMap) else None

    def relief(self: Any, position: Floats) -> tuple[Floats, Floats, Floats]:
        """Heights (...) in mm at positions (..., d), slopes (..., d) along x and z, and curvatures
        (..., d, d) in 1/mm.
        """
        axis_vector = np.array(direction(self.angle)[: position.shape[-1]])
        along = position @ axis_vector
        slope, curvature = np.asarray(self.slope(along)), np.asarray(self.curvature(along))
        return (
            np.asarray(self.height(along)),
            slope[..., None] * axis_vector,
            curvature[..., None, None] * np.outer(axis_vector, axis_vector),
        )

    def friction_at(self: Any, position: Floats) -> Floats:
        """Friction coefficients (...) at positions (..., d)."""
        if self._map is not None:
            return np.asarray(self._map.at(position))
        return np.asarray(self.friction_coefficient(position[..., 0]))

    def friction_gradient(self: Any, position: Floats) -> Floats:
        """Derivatives (..., d) of the coefficient along x and z, in 1/mm, without discontinuities."""
        if self._map is not None:
            return np.asarray(self._map.gradient(position))
        found = np.zeros(position.shape)
        found[..., 0] = self.friction_slope(position[..., 0])
        return found

    def friction_steps(self: Any, short: float) -> tuple[Steps, ...]:
        """Discontinuities of the coefficient; in tables over x also ramps shorter than `short` (mm), which
        a node crosses in one iteration: such a ramp counts as a discontinuity at its rougher end.
        """
        if self._map is not None:
            return tuple(self._map.steps)
        jumps, ramps = self.friction_jumps, getattr(self, "friction_ramps", np.zeros((0, 4)))
        begin, end, before, behind = ramps[ramps[:, 1] - ramps[:, 0] < short].T
        position = np.where(behind > before, end, begin)
        both = np.concatenate([jumps, np.stack([position, before, behind], axis=1)])
        position, before, behind = both[np.argsort(both[:, 0], kind="stable")].T
        return (Steps(0, position, before[:, None], behind[:, None], np.zeros(1)),) if position.size else ()


@dataclass(frozen=True, eq=False)
class Steps:
    """Discontinuities of the friction coefficient along x (`axis` 0) or z (1): positions `place` (J,) in mm,
    ascending, and coefficients (J, M) `before` and `behind` them at M positions `over` (mm) on the other
    axis, linear in between.
    """

    axis: int
    place: Floats
    before: Floats
    behind: Floats
    over: Floats

    def sides(self, which: Ints, across: Floats) -> tuple[Floats, Floats]:
        """Coefficients (k,) before and behind the discontinuities `which` (k,); `across` (k,): other axis."""
        right = np.clip(np.searchsorted(self.over, across), 1, max(self.over.size - 1, 1))
        left, right = right - 1, np.minimum(right, self.over.size - 1)
        length = self.over[right] - self.over[left]
        fraction = np.clip((across - self.over[left]) / np.where(length > 0.0, length, 1.0), 0.0, 1.0)
        before, behind = (
            value[which, left] + fraction * (value[which, right] - value[which, left])
            for value in (self.before, self.behind)
        )
        return before, behind


@dataclass(frozen=True, eq=False)
class FrictionMap:
    """Friction coefficients over the display: `friction` (rows z, columns x) at `x` and `z` (mm).

    Bilinear in between, constant beyond the ends. At a repeated x (or z) the coefficient is discontinuous:
    the later column (or row) holds from there on.

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
            spacing = np.diff(grid)
            thrice = (spacing[1:] == 0.0) & (spacing[:-1] == 0.0)
            ends = spacing.size == 0 or spacing[0] == 0.0 or spacing[-1] == 0.0
            if ends or (spacing < 0.0).any() or thrice.any() or np.abs(grid).max() > FARTHEST:
                raise InputError(f"surface.friction.{name}", f"{len(grid)} positions", MAP)
        if friction.shape != (len(z), len(x)) or friction.size > MOST:
            shape = f"coefficients in {' x '.join(map(str, friction.shape))}"
            raise InputError("surface.friction.friction", shape, MAP)
        if friction.min() < 0.0 or friction.max() > ROUGHEST:
            raise InputError("surface.friction.friction", f"{friction.min():g} to {friction.max():g}", MAP)
        set_frozen(self, x=x, z=z, friction=friction)

    def __repr__(self) -> str:
        span = f"x {self.x[0]:.4g} to {self.x[-1]:.4g} mm, z {self.z[0]:.4g} to {self.z[-1]:.4g} mm"
        low, high = self.friction.min(), self.friction.max()
        return f"FrictionMap({len(self.z)} x {len(self.x)} points, {span}, {low:.4g} to {high:.4g})"

    def at(self, position: Floats) -> Floats:
        """Coefficients (...) at positions (..., 2); z = 0 at positions (..., 1)."""
        value, _ = self._found(position)
        return value

    def gradient(self, position: Floats) -> Floats:
        """Derivatives (..., d) along x and z at positions (..., d), in 1/mm, without discontinuities."""
        return self._found(position)[1][..., : position.shape[-1]]

    def _found(self, position: Floats) -> tuple[Floats, Floats]:
        x = position[..., 0]
        z = position[..., 1] if position.shape[-1] > 1 else np.zeros_like(x)
        (i, t, dt), (k, s, ds) = _within(self.x, x), _within(self.z, z)
        f = self.friction
        low = f[k, i] + t * (f[k, i + 1] - f[k, i])
        high = f[k + 1, i] + t * (f[k + 1, i + 1] - f[k + 1, i])
        by_x = (1.0 - s) * (f[k, i + 1] - f[k, i]) + s * (f[k + 1, i + 1] - f[k + 1, i])
        return low + s * (high - low), np.stack([by_x * dt, (high - low) * ds], axis=-1)

    @cached_property
    def steps(self) -> tuple[Steps, ...]:
        """Its discontinuities along x and along z."""
        found = []
        axes = (0, self.x, self.z, self.friction.T), (1, self.z, self.x, self.friction)
        for axis, grid, over, value in axes:
            at = np.flatnonzero(np.diff(grid) == 0.0)
            at = at[(value[at] != value[at + 1]).any(axis=1)]
            if at.size:
                found.append(Steps(axis, grid[at], value[at], value[at + 1], over))
        return tuple(found)

    @property
    def columns(self) -> dict[str, Any]:
        """Its data for a scene file."""
        return {"x": self.x.tolist(), "z": self.z.tolist(), "friction": self.friction.tolist()}


def _within(grid: Floats, at: Floats) -> tuple[Ints, Floats, Floats]:
    """Interval of the grid that contains a position, the fraction of it passed, and its derivative (1/mm)."""
    i = np.clip(np.searchsorted(grid, at, side="right") - 1, 0, len(grid) - 2)
    length = grid[i + 1] - grid[i]
    fraction = (at - grid[i]) / np.where(length > 0.0, length, 1.0)
    inside = (fraction >= 0.0) & (fraction < 1.0)
    return i, np.clip(fraction, 0.0, 1.0), np.where(inside, 1.0 / np.where(length > 0.0, length, 1.0), 0.0)

"""Outline of a finger pad's cross-section: an ellipse, a superellipse or another curve around its middle,
with fingerprint ridges on its lower side.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats

#: how many angles look for the sharpest place of an outline, and iterations of Newton's method on one
SAMPLES, ITERATIONS = 721, 8


@dataclass(frozen=True)
class Outline:
    """A curve around (0, `centre`) with semi-axes a, b (mm); theta is the angle from the +x axis in the
    coordinates x/a, y/b, anticlockwise: 0 and -pi are its sides, -pi/2 is its lower side.
    """

    a: float
    b: float
    centre: float = 0.0

    def point(self, theta: Floats) -> Floats:
        """Points (N, 2)."""
        raise NotImplementedError

    def tangent(self, theta: Floats) -> Floats:
        """Derivatives (N, 2) of the points by theta."""
        raise NotImplementedError

    def bend(self, theta: Floats) -> Floats:
        """Second derivatives (N, 2)."""
        raise NotImplementedError

    def angle_at(self, x: Floats, upper: bool = False) -> Floats:
        """theta of the points at the abscissae `x` on the lower side, or on the upper one."""
        raise NotImplementedError

    def normal(self, theta: Floats) -> Floats:
        """Outward unit normals (N, 2)."""
        t = self.tangent(theta)
        return np.column_stack([t[:, 1], -t[:, 0]]) / np.hypot(t[:, 0], t[:, 1])[:, None]

    def curvature(self, theta: Floats) -> Floats:
        """Curvatures (N,), positive where the curve is convex."""
        t, s = self.tangent(theta), self.bend(theta)
        return np.asarray((t[:, 0] * s[:, 1] - t[:, 1] * s[:, 0]) / np.hypot(t[:, 0], t[:, 1]) ** 3)

    @property
    def smallest_radius(self) -> float:
        """Smallest radius of curvature; inward normal offsets must be smaller."""
        return 1.0 / float(self.curvature(np.linspace(-np.pi, np.pi, SAMPLES)).max())

    def below_ridges(self, x: float) -> float:
        """Curvature (1/mm) by which walls of ridges between -x and x count as steeper: the largest there."""
        return float(self.curvature(self.angle_at(np.linspace(-x, x, SAMPLES))).max())

    def foot_step(self, theta: Floats, x: Floats, y: Floats) -> Floats:
        """Newton's step (N,) from theta to the feet of the normals through points (x, y)."""
        away, t = np.column_stack([x, y]) - self.point(theta), self.tangent(theta)
        slope = np.sum(t * t, axis=1) - np.sum(away * self.bend(theta), axis=1)
        return np.asarray(np.sum(away * t, axis=1) / slope)

    def equal_arc_angles(self, start: float, end: float, count: int) -> Floats:
        """`count` + 1 angles from `start` to `end` at equal arc lengths."""
        fine = np.linspace(start, end, 2001)
        middle = 0.5 * (fine[1:] + fine[:-1])
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(*self.tangent(middle).T))])
        return np.interp(np.linspace(0.0, arc[-1], count + 1), arc, fine)


@dataclass(frozen=True)
class Ellipse(Outline):
    """Ellipse; theta is the eccentric angle."""

    @property
    def smallest_radius(self) -> float:
        return min(self.a**2 / self.b, self.b**2 / self.a)

    def below_ridges(self, x: float) -> float:
        """That of the apex: with it the steepest walls that can be meshed were found."""
        return self.b / self.a**2

    def point(self, theta: Floats) -> Floats:
        return np.column_stack([self.a * np.cos(theta), self.centre + self.b * np.sin(theta)])

    def tangent(self, theta: Floats) -> Floats:
        return np.column_stack([-self.a * np.sin(theta), self.b * np.cos(theta)])

    def bend(self, theta: Floats) -> Floats:
        return np.column_stack([-self.a * np.cos(theta), -self.b * np.sin(theta)])

    def normal(self, theta: Floats) -> Floats:
        n = np.column_stack([self.b * np.cos(theta), self.a * np.sin(theta)])
        return n / np.hypot(n[:, 0], n[:, 1])[:, None]

    def angle_at(self, x: Floats, upper: bool = False) -> Floats:
        angle = np.arccos(x / self.a)
        return angle if upper else -angle

    def foot_step(self, theta: Floats, x: Floats, y: Floats) -> Floats:
        cos, sin = np.cos(theta), np.sin(theta)
        to_x, to_y = x - self.a * cos, y - self.b * sin
        along = -to_x * self.a * sin + to_y * self.b * cos
        bend = (self.a * sin) ** 2 + (self.b * cos) ** 2 + to_x * self.a * cos + to_y * self.b * sin
        return np.asarray(along / bend)

    def radial_projection(self, points: Floats) -> Floats:
        """Radial projection (N, 2) of `points` (N, 2) from the centre onto the ellipse."""
        centre = np.array([0.0, self.centre])
        away = points - centre
        return centre + away / np.hypot(away[:, 0] / self.a, away[:, 1] / self.b)[:, None]


class PolarOutline(Outline):
    """Outline whose points are rho(theta) (a cos(theta), b sin(theta))."""

    def rho(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """rho (N,) and its first two derivatives."""
        raise NotImplementedError

    def _stretched(self, x: Floats, y: Floats) -> Floats:
        return np.column_stack([self.a * x, self.b * y])

    def point(self, theta: Floats) -> Floats:
        rho = self.rho(theta)[0]
        return self._stretched(rho * np.cos(theta), rho * np.sin(theta)) + np.array([0.0, self.centre])

    def tangent(self, theta: Floats) -> Floats:
        (r, d, _), c, s = self.rho(theta), np.cos(theta), np.sin(theta)
        return self._stretched(d * c - r * s, d * s + r * c)

    def bend(self, theta: Floats) -> Floats:
        (r, d, e), c, s = self.rho(theta), np.cos(theta), np.sin(theta)
        return self._stretched((e - r) * c - 2.0 * d * s, (e - r) * s + 2.0 * d * c)

    def angle_at(self, x: Floats, upper: bool = False) -> Floats:
        """By Newton's method, from the nearest of `SAMPLES` angles."""
        start, end = (np.pi, 0.0) if upper else (-np.pi, 0.0)
        fine = np.linspace(start, end, SAMPLES)
        across = self.point(fine)[:, 0]
        theta = np.interp(x, across, fine)
        for _ in range(ITERATIONS):
            theta = theta - (self.point(theta)[:, 0] - x) / self.tangent(theta)[:, 0]
        return np.asarray(theta)


@dataclass(frozen=True)
class Superellipse(PolarOutline):
    """abs(x/a)^n + abs(y/b)^n = 1 with the exponent n > 2; its apex has no curvature.

    >>> curve = Superellipse(2.0, 1.0, exponent=3.0)
    >>> float(np.sum((curve.point(np.array([0.7])) / [2.0, 1.0]) ** 3).round(12))
    1.0
    """

    exponent: float = 3.0

    def rho(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        n, c, s = self.exponent, np.cos(theta), np.sin(theta)
        p, q = np.abs(c) ** (n - 2.0), np.abs(s) ** (n - 2.0)
        total, first = p * c * c + q * s * s, n * c * s * (q - p)
        second = n * ((n - 1.0) * (p * s * s + q * c * c) - total)
        rho = total ** (-1.0 / n)
        slope = -first / (n * total)
        return rho, rho * slope, rho * (slope**2 - second / (n * total) + first**2 / (n * total**2))

    def angle_at(self, x: Floats, upper: bool = False) -> Floats:
        across = x / self.a
        up = (1.0 - np.abs(across) ** self.exponent) ** (1.0 / self.exponent)
        return np.arctan2(up if upper else -up, across)


@dataclass(frozen=True)
class Ridges:
    """Ridge profile: depth below the crest line as a function of the abscissa x of the smooth outline (mm).

    t = |x - crest| / (pitch/2) runs from 0 at a crest to 1 in a groove; crests at x = (k + phase) pitch.
    Rounded (`crest` = 0): depth = height * t**exponent. Flat-topped: crest and groove are flat over these
    fractions of the pitch, depth = height (1 - cos(pi s)) / 2 on the walls. Faded from |x| = `full` to `end`
    with a quintic step.
    """

    height: float
    pitch: float
    exponent: float
    phase: float
    crest: float
    groove: float
    full: float
    end: float

    @property
    def steepest(self) -> float:
        """Largest slope of the wall."""
        if self.crest == 0.0:
            return self.height * self.exponent * 2.0 / self.pitch
        return self.height * np.pi / self.pitch / (1.0 - self.crest - self.groove)

    def depth(self, x: Floats) -> Floats:
        """Depth below the crest line, along the smooth outline's normal (mm)."""
        return self.below(x) * quintic((self.end - np.abs(x)) / (self.end - self.full))

    def below(self, x: Floats) -> Floats:
        """The same without the fading towards the ends."""
        t = 2.0 * np.abs((x / self.pitch - self.phase + 0.5) % 1.0 - 0.5)
        if self.crest == 0.0:
            shape = t**self.exponent
        else:
            s = np.clip((t - self.crest) / (1.0 - self.crest - self.groove), 0.0, 1.0)
            shape = 0.5 * (1.0 - np.cos(np.pi * s))
        return np.asarray(self.height * shape)


def quintic(s: Floats) -> Floats:
    """A smooth step: 0 up to s = 0, 1 from s = 1 on, with level ends.

    >>> quintic(np.array([-1.0, 0.5, 2.0])).tolist()
    [0.0, 0.5, 1.0]
    """
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def layer_coordinates(
    foot: Floats, normal: Floats, depth: Floats, level: Floats, to_bone: Callable[[Floats], Floats]
) -> Floats:
    """Points (N, d) at layer coordinates `level` (N,): 0 on the surface, 1 on the first interface, and so on.

    Surface and interfaces lie at depths (layers, N) along the normals with feet (N, d) on the smooth
    outline; below the last interface points lie on straight lines `to_bone`.
    """
    innermost, index = len(depth) - 1, np.arange(len(level))
    layer = np.minimum(level.astype(int), innermost)
    fraction = (level - layer)[:, None]
    upper, lower = (depth[np.minimum(one, innermost), index][:, None] for one in (layer, layer + 1))
    skin = foot - ((1.0 - fraction) * upper + fraction * lower) * normal
    inside = foot - depth[innermost][:, None] * normal
    deep = inside + fraction * (to_bone(inside) - inside)
    return np.where((layer == innermost)[:, None], deep, skin)

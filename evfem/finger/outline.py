"""Outline of a finger pad's cross-section: an ellipse with fingerprint ridges on its lower side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats


@dataclass(frozen=True)
class Ellipse:
    """Ellipse with semi-axes a, b (mm) and centre (0, `centre`); eccentric angle theta from the +x axis."""

    a: float
    b: float
    centre: float = 0.0

    @property
    def smallest_radius(self) -> float:
        """Smallest radius of curvature; inward normal offsets must be smaller."""
        return min(self.a**2 / self.b, self.b**2 / self.a)

    def point(self, theta: Floats) -> Floats:
        """Points (N, 2) on the ellipse."""
        return np.column_stack([self.a * np.cos(theta), self.centre + self.b * np.sin(theta)])

    def normal(self, theta: Floats) -> Floats:
        """Outward unit normals (N, 2)."""
        n = np.column_stack([self.b * np.cos(theta), self.a * np.sin(theta)])
        return n / np.hypot(n[:, 0], n[:, 1])[:, None]

    def radial_projection(self, points: Floats) -> Floats:
        """Radial projection (N, 2) of `points` (N, 2) from the centre onto the ellipse."""
        centre = np.array([0.0, self.centre])
        away = points - centre
        return centre + away / np.hypot(away[:, 0] / self.a, away[:, 1] / self.b)[:, None]

    def equal_arc_angles(self, start: float, end: float, count: int) -> Floats:
        """`count` + 1 eccentric angles from `start` to `end` at equal arc lengths."""
        fine = np.linspace(start, end, 2001)
        middle = 0.5 * (fine[1:] + fine[:-1])
        speed = np.hypot(self.a * np.sin(middle), self.b * np.cos(middle))
        arc = np.concatenate([[0.0], np.cumsum(speed)])
        return np.interp(np.linspace(0.0, arc[-1], count + 1), arc, fine)


@dataclass(frozen=True)
class Ridges:
    """Ridge profile: depth below the crest line as a function of the abscissa x of the ellipse (mm).

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
        """Depth below the crest line, along the ellipse's normal (mm)."""
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

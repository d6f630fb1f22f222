r"""The outline of a finger: the exponent of a superellipse, or points of a measured cross-section.

Points are those of a scan in mm, in their order along the outline, y upwards, and either go all around or are
the pad alone, from one side of the finger to the other: its ends are then the widest place, and the upper
half the image of the lower one. Width and height of the finger are those of the outline, its middle is
that of the box around it (of a pad, between its ends). Around it the distance is a Fourier series in the
angle :math:`\theta` of the coordinates stretched to the box,

.. math:: \rho(\theta) = a_0 + \sum_{k=1}^{K} a_k \cos k\theta + b_k \sin k\theta,

fitted by least squares: K is at most 16, and such that a harmonic has four points or more everywhere. So
normals and curvature are smooth, and noise and ridges average out.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, real, set_frozen
from evfem.common.tables import numbers, read_headed
from evfem.errors import InputError, describe_value
from evfem.finger.outline import Ellipse, Outline, PolarOutline, Superellipse

KEY = "finger.outline"
EXPONENTS = Within(2.0, 4.0)
WIDTHS, HEIGHTS = Within(12.0, 24.0), Within(9.0, 20.0)
FORM = "a csv file with the header x,y in mm, the points in their order along the outline"
ALLOWED = f"2 to 4, or a measured cross-section: {FORM}"
#: fewest and most points, harmonics at most, and points for each of them
FEWEST, MOST, HARMONICS, POINTS_EACH = 12, 100_000, 16, 4
#: largest angle between neighbours, seen from the middle (degrees), and largest distance of a point from
#: the series (mm)
WIDEST, MISSED = 30.0, 0.15
#: a pad's ends are further apart than this share of its width, and level to this share of its depth
APART, LEVEL = 0.5, 0.1
#: share of the half width in which lower and upper side may not fold
GRAPH = 0.9
NEAREST, ROUNDS, FINE = 1e-6, 4, 20_001


@dataclass(frozen=True)
class SeriesOutline(PolarOutline):
    """rho(theta) as a Fourier series: `series` has the mean, then cosine and sine of each harmonic."""

    series: tuple[float, ...] = (1.0,)

    def rho(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        mean, harmonics = self.series[0], np.array(self.series[1:]).reshape(-1, 2)
        k = np.arange(1, len(harmonics) + 1)
        c, s = np.cos(np.multiply.outer(theta, k)), np.sin(np.multiply.outer(theta, k))
        p, q = harmonics.T
        wave, slope = c * p + s * q, (c * q - s * p) * k
        return mean + wave.sum(axis=-1), slope.sum(axis=-1), -(wave * k**2).sum(axis=-1)


@dataclass(frozen=True, eq=False)
class CrossSection:
    """Points `x`, `y` (N,) in mm of a measured cross-section.

    >>> theta = np.linspace(0.0, 2.0 * np.pi, 60)
    >>> CrossSection(8.0 * np.cos(theta), 6.0 * np.sin(theta))
    CrossSection(60 points, 16 x 12 mm)
    """

    x: Any
    y: Any

    def __post_init__(self) -> None:
        x, y = (numbers(f"{KEY}.{name}", getattr(self, name), "a list of mm") for name in ("x", "y"))
        if len(x) != len(y) or not FEWEST <= len(x) <= MOST:
            raise InputError(KEY, f"{len(x)} x and {len(y)} y", f"{FEWEST} to {MOST} points")
        set_frozen(self, x=x, y=y)
        _check_folds(self.curve)

    @classmethod
    def of(cls, source: Any) -> CrossSection:
        """A cross-section, or one made of points (k, 2), of the path of their file, or of columns x and y."""
        if isinstance(source, CrossSection):
            return source
        if isinstance(source, str | os.PathLike):
            return cls.from_csv(Path(source))
        if isinstance(source, Mapping) and set(source) == {"x", "y"}:
            return cls(**source)
        try:
            points = np.asarray(source, dtype=float)
        except (TypeError, ValueError):
            raise InputError(KEY, describe_value(source), ALLOWED) from None
        if points.ndim != 2 or points.shape[1] != 2:
            given = f"an array of shape {points.shape}" if points.ndim else describe_value(source)
            raise InputError(KEY, given, f"{ALLOWED}, or its points (k, 2)")
        return cls(*points.T)

    @classmethod
    def from_csv(cls, path: Path) -> CrossSection:
        """The points in a file with the header `x,y`, one (mm, or what the header says) in each line."""
        table = read_headed(path, KEY, FORM, gaps=False)
        if table.names != ["x", "y"]:
            raise InputError(KEY, f"{path.name} with the header {','.join(table.names)[:60]!r}", FORM)
        return cls(*(table.column(KEY, name, ("mm",)) for name in table.names))

    @property
    def columns(self) -> dict[str, list[float]]:
        """The two columns by name, as a scene file can hold them."""
        return {"x": self.x.tolist(), "y": self.y.tolist()}

    @property
    def width(self) -> float:
        """Full width (mm)."""
        return 2.0 * self.curve.a

    @property
    def height(self) -> float:
        """Full height (mm)."""
        return 2.0 * self.curve.b

    def __repr__(self) -> str:
        return f"CrossSection({len(self.x)} points, {self.width:.4g} x {self.height:.4g} mm)"

    @cached_property
    def curve(self) -> SeriesOutline:
        """The series through the points, around their middle."""
        points, half = _all_around(np.column_stack([self.x, self.y]))
        low, high = points.min(axis=0), points.max(axis=0)
        _check_size(float(np.ptp(points[:, 0])), float(np.ptp(points[:, 1])), half)
        for _ in range(ROUNDS):
            middle = 0.5 * (low + high) * [1.0, 0.0 if half else 1.0]
            axes = 0.5 * (high - low)
            series = _fitted((points - middle) / axes, axes)
            found = SeriesOutline(float(axes[0]), float(axes[1]), series=series)
            around = found.point(np.linspace(-np.pi, np.pi, FINE)) + middle
            low, high = around.min(axis=0), around.max(axis=0)
        return found


def _all_around(points: Floats) -> tuple[Floats, bool]:
    """Points once around the outline, and whether they were those of a pad alone, y then from its ends."""
    first, last = points[0], points[-1]
    if not np.hypot(*(last - first)) > APART * np.ptp(points[:, 0]):
        if len(points) > 1 and np.hypot(*(last - first)) < NEAREST:
            points = points[:-1]
        _check_apart(np.vstack([points, points[:1]]))
        return points, False
    _check_apart(points)
    ends, depth = 0.5 * (first[1] + last[1]), float(np.ptp(points[:, 1]))
    if abs(first[1] - last[1]) > LEVEL * depth or ends - points[:, 1].min() < (1.0 - LEVEL) * depth:
        given = f"points from ({first[0]:.4g}, {first[1]:.4g}) to ({last[0]:.4g}, {last[1]:.4g}) mm"
        allowed = "a closed outline, or the pad from one side to the other, its ends level and highest"
        raise InputError(KEY, given, allowed)
    points = points - [0.0, ends]
    return np.vstack([points, points[-2:0:-1] * [1.0, -1.0]]), True


def _check_apart(points: Floats) -> None:
    same = np.flatnonzero(np.hypot(*np.diff(points, axis=0).T) < NEAREST)
    if len(same):
        i = int(same[0])
        given = f"points {i + 1} and {i + 2} at the same place ({points[i, 0]:.4g}, {points[i, 1]:.4g}) mm"
        raise InputError(KEY, given, "each point once")


def _check_size(width: float, height: float, half: bool) -> None:
    if not (WIDTHS(width) and HEIGHTS(height)):
        given = f"an outline {width:.4g} mm wide and {height:.4g} mm high"
        given += ", twice the depth of its pad" if half else ""
        allowed = f"{WIDTHS.low:g} to {WIDTHS.high:g} mm wide, {HEIGHTS.low:g} to {HEIGHTS.high:g} mm high"
        raise InputError(KEY, given, f"{allowed}; other units stand in the header, as x [cm]")


def _fitted(unit: Floats, axes: Floats) -> tuple[float, ...]:
    """The series of points (N, 2) in lengths of the `axes` (mm)."""
    theta, rho = np.arctan2(unit[:, 1], unit[:, 0]), np.hypot(unit[:, 0], unit[:, 1])
    steps = _steps(theta)
    k = np.arange(1, min(HARMONICS, int(2.0 * np.pi / steps.max() / POINTS_EACH)) + 1)
    waves = np.stack([np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))], axis=2)
    matrix = np.column_stack([np.ones(len(unit)), waves.reshape(len(unit), -1)])
    weight = np.sqrt(0.5 * (steps + np.roll(steps, 1)))
    series = np.linalg.lstsq(weight[:, None] * matrix, weight * rho, rcond=None)[0]
    missed = np.abs(matrix @ series / rho - 1.0) * np.hypot(*(unit * axes).T)
    worst = int(missed.argmax())
    if missed[worst] > MISSED:
        given = f"an outline from whose smooth course point {worst + 1} is {missed[worst]:.2g} mm away"
        raise InputError(KEY, given, f"at most {MISSED:g} mm: a smoother one, or one with more points")
    return tuple(series.tolist())


def _steps(theta: Floats) -> Floats:
    """Angles (N,) from point to point, all positive; InputError where the outline goes back, or has a gap."""
    steps = np.diff(theta, append=theta[:1])
    steps = (steps + np.pi) % (2.0 * np.pi) - np.pi
    steps *= np.sign(steps.sum())
    back = int(steps.argmin())
    if not steps[back] > 0.0:
        given = f"points {back + 1} and {(back + 1) % len(theta) + 1}, which go back, seen from the middle"
        raise InputError(KEY, given, "points in their order along an outline that does not cross itself")
    gap = float(np.degrees(steps.max()))
    if gap > WIDEST:
        given = f"neighbours {gap:.3g} degrees apart, seen from the middle"
        raise InputError(KEY, given, f"at most {WIDEST:g} degrees all around, or from side to side")
    return steps


def _check_folds(curve: SeriesOutline) -> None:
    for sign, side in ((-1.0, "lower"), (1.0, "upper")):
        theta = sign * np.linspace(0.0, np.pi, FINE)
        x = curve.point(theta)[:, 0] / curve.a
        back = np.flatnonzero((np.diff(x) >= 0.0) & (np.abs(x[1:]) < GRAPH))
        if len(back):
            given = f"an outline that goes back at x = {curve.a * x[back[0]]:.3g} mm on its {side} side"
            raise InputError(KEY, given, "one height for each x, but for the sides")


def checked(key: str, value: Any) -> float | CrossSection:
    """An exponent, or a measured cross-section."""
    if isinstance(value, Real | np.bool_ | None):
        return real(key, value, ALLOWED, EXPONENTS)
    return CrossSection.of(value)


def outline_of(outline: Any, a: float, b: float) -> Outline:
    """The curve of an exponent or a cross-section with the semi-axes a, b (mm)."""
    if isinstance(outline, CrossSection):
        return SeriesOutline(a, b, series=outline.curve.series)
    return Ellipse(a, b) if outline == EXPONENTS.low else Superellipse(a, b, exponent=outline)


#: type of the parameter
FingerOutline = Annotated[
    float | CrossSection | str | os.PathLike[str],
    {"allowed": ALLOWED, "type": float | str | dict[str, list[float]], "file": True, "check": checked},
    "exponent n of abs(x/a)^n + abs(y/b)^n (+ abs(z/c)^n) = 1, 2: an ellipse; or points of a cross-section",
]

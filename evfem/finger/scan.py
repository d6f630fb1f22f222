"""Fingerprint ridges as they were scanned: a relief or an outline in a file, and how deep it lies
below the crest line.

A scan with heights has the form of the finger removed: x is the abscissa of the smooth outline, its highest
point lies on it. A scan with y is the outline itself, x = 0 in the middle, y upwards: points are projected
onto it along its normal (Newton's method on the angle), the highest crest touching it from
inside.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import set_frozen
from evfem.common.tables import numbers, read_headed
from evfem.errors import InputError, describe_value
from evfem.finger.outline import Outline, quintic

#: most points of a scan, and how near to each other they may be (mm)
MOST, NEAREST = 100_000, 1e-6
#: iterations of the projection and of the shift, and the error (mm) at which they end
ITERATIONS, EXACT = 50, 1e-12
ALLOWED = "a csv file with the header x,height or x,y in mm, x increasing, in at least three lines"


@dataclass(frozen=True, eq=False)
class RidgeScan:
    """A scan across the ridges of a pad: `x` (N,) increasing, and either `height` (N,), the relief
    on the smooth finger, or `y` (N,), its outline; all in mm.

    Beyond its ends the outline comes back to the crest line within half a ridge width.

    >>> scan = RidgeScan([-1.0, 0.0, 1.0], height=[0.0, 0.1, 0.0])
    >>> scan
    RidgeScan(3 points, x -1 to 1 mm, height 0 to 0.1 mm)
    >>> from evfem.finger.outline import Ellipse
    >>> x, depth = scan.depths(Ellipse(8.0, 6.0))
    >>> depth.tolist()
    [0.1, 0.0, 0.1]
    """

    x: Any
    height: Any = None
    y: Any = None

    def __post_init__(self) -> None:
        columns = [name for name in ("height", "y") if getattr(self, name) is not None]
        if len(columns) != 1:
            raise InputError(
                "finger.ridge_scan", " and ".join(columns) or "neither height nor y", "one of the two"
            )
        (name,) = columns
        x = numbers("finger.ridge_scan.x", self.x, "a list of positions in mm")
        values = numbers(f"finger.ridge_scan.{name}", getattr(self, name), "a list of lengths in mm")
        if not 3 <= len(x) <= MOST or len(x) != len(values):
            given_points = f"{len(x)} values of x, {len(values)} of {name}"
            raise InputError("finger.ridge_scan", given_points, f"3 to {MOST} points")
        wrong = np.flatnonzero(np.diff(x) < NEAREST)
        if len(wrong):
            found = f"x {x[wrong[0]]:g}, then {x[wrong[0] + 1]:g} (points {wrong[0] + 1}, {wrong[0] + 2})"
            raise InputError("finger.ridge_scan", found, "increasing x, in mm")
        set_frozen(self, x=x, **{name: values})

    @classmethod
    def from_csv(cls, path: str | Path) -> RidgeScan:
        """The scan in a file with the header `x,height` or `x,y` and one point (mm) in each line."""
        table = read_headed(Path(path), "finger.ridge_scan", ALLOWED, gaps=False)
        if table.names not in (["x", "height"], ["x", "y"]):
            problem = f"{Path(path).name} with the header {','.join(table.names)[:60]!r}"
            raise InputError("finger.ridge_scan", problem, ALLOWED)
        return cls(**{name: table.column("finger.ridge_scan", name, ("mm",)) for name in table.names})

    @classmethod
    def of(cls, source: Any) -> RidgeScan:
        """A scan, or one made of a texture of heights, whose middle comes below the middle of the finger, of
        the path of its file, or of its columns {"x": ..., "y": ...}.
        """
        if isinstance(source, RidgeScan):
            return source
        if is_texture(source):
            if source.quantity != "height":
                raise InputError("finger.ridges", f"a texture of {source.quantity}", "a texture of heights")
            x = np.asarray(source.x)
            return cls(x - 0.5 * (x[0] + x[-1]), height=source.values)
        if isinstance(source, (str, Path)):
            return cls.from_csv(source)
        if isinstance(source, Mapping) and set(source) in ({"x", "height"}, {"x", "y"}):
            return cls(**source)
        raise InputError("finger.ridge_scan", describe_value(source), f"a RidgeScan, or {ALLOWED}")

    @property
    def columns(self) -> dict[str, list[float]]:
        """The two columns by name, as a scene file can hold them."""
        columns = {"x": self.x, "height": self.height, "y": self.y}
        return {name: values.tolist() for name, values in columns.items() if values is not None}

    def __repr__(self) -> str:
        (name, values) = ("y", self.y) if self.height is None else ("height", self.height)
        span = f"{name} {values.min():.4g} to {values.max():.4g} mm"
        return f"RidgeScan({len(self.x)} points, x {self.x[0]:.4g} to {self.x[-1]:.4g} mm, {span})"

    def depths(self, outer: Outline) -> tuple[Floats, Floats]:
        """Abscissae (N,) of the feet on the smooth outline `outer`, increasing, and depths (N,) below it.

        Raises InputError for an outline that reaches beyond the lower half of it.
        """
        if self.height is not None:
            return self.x, self.height.max() - self.height
        if np.abs(self.x).max() >= outer.a:
            problem = f"x from {self.x[0]:g} to {self.x[-1]:g} mm"
            raise InputError(
                "finger.ridge_scan", problem, f"an outline within {outer.a:g} mm, half of finger.width"
            )
        lift = 0.0
        for _ in range(ITERATIONS):
            foot, below, down = _projected(outer, self.x, self.y + lift)
            crest = int(np.argmin(below))
            if abs(below[crest]) < EXACT:
                break
            lift -= below[crest] / down[crest]
        if (np.diff(foot) <= 0.0).any():
            problem = "an outline that is folded, seen from that of the finger"
            raise InputError(
                "finger.ridge_scan", problem, "one that fits finger.width and finger.height, smoothed"
            )
        return foot, below


def is_texture(source: Any) -> bool:
    """Whether this is what `evfem texture import` made of a file."""
    return all(hasattr(source, name) for name in ("quantity", "x", "values"))


def _projected(outer: Outline, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Foot of each point on the lower half of `outer`, depth below it, downward part of the normal there."""
    angle = outer.angle_at(np.clip(x, -outer.a, outer.a))
    for _ in range(ITERATIONS):
        step = outer.foot_step(angle, x, y)
        angle = angle + step
        if np.abs(step).max() < EXACT:
            break
    foot, normal = outer.point(angle), outer.normal(angle)
    below = np.sum((foot - np.column_stack([x, y])) * normal, axis=1)
    return foot[:, 0], below, -normal[:, 1]


@dataclass(frozen=True, eq=False)
class ScannedRidges:
    """Depths of a scan over the abscissa of the smooth outline, in place of the formula of
    `evfem.finger.outline.Ridges`.

    `pitch` (mm) says how finely the pad is divided, and over which length, half of it, a scan ends.
    """

    x: Floats
    below: Floats
    pitch: float
    full: float
    end: float
    phase: float = 0.0

    @property
    def height(self) -> float:
        """Depth of the deepest groove (mm)."""
        return float(self.below.max())

    @property
    def steepest(self) -> float:
        """Largest slope between two points."""
        return float(np.abs(np.diff(self.below) / np.diff(self.x)).max())

    def missed(self, spacing: float) -> float:
        """Largest depth (mm) that lies between nodes so far apart and is missed by them."""
        nodes = np.arange(np.ceil(self.x[0] / spacing), np.floor(self.x[-1] / spacing) + 1.0) * spacing
        if len(nodes) < 2:
            return self.height
        inside = (self.x >= nodes[0]) & (self.x <= nodes[-1])
        felt = np.interp(self.x[inside], nodes, self.depth(nodes))
        return float(np.abs(felt - self.depth(self.x[inside])).max(initial=0.0))

    def depth(self, x: Floats) -> Floats:
        """Depth below the crest line, along the smooth outline's normal (mm)."""
        half = 0.5 * self.pitch
        beyond = np.maximum(np.maximum(self.x[0] - x, x - self.x[-1]), 0.0)
        faded = quintic(1.0 - beyond / half) * quintic((self.end - np.abs(x)) / (self.end - self.full))
        return np.interp(x, self.x, self.below) * faded

r"""Fingerprint of a whole pad: depth below the crests as a function of x and z (mm) of the smooth pad.

A pattern is a phase :math:`\varphi(x, z)` that increases by one from crest to crest; the profile
across a ridge is that of the cross-section (`evfem.finger.outline`). With the pitch p:

=========  ================================================================================
along      :math:`\varphi = x/p`: the ridges run along the finger, as in its cross-section
across     :math:`\varphi = z/p`
whorl      distance from the core over p: circles
loop       distance from a ray over p, which begins at the core: ridges come in, turn
           round it and leave where they came from
arch       :math:`(z - h e^{-x^2/2w^2})/p`: ridges across that rise in the middle
=========  ================================================================================

The core is the lowest point of the pad; loop and arch have the sizes below (assumed).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import set_frozen
from evfem.common.foreign import read_grey
from evfem.common.tables import TABLES, gridded, numbers, read_columns
from evfem.errors import InputError
from evfem.finger.outline import Ridges, quintic

#: direction of a loop's ray from the bone's end, in degrees from -z towards +x
LOOP_TILT = 20.0
#: rise of an arch and its half width (mm)
ARCH_RISE, ARCH_WIDTH = 1.5, 2.5
#: fraction of the refined rectangle, from its middle, in which ridges have their full height
FULL = 0.875
#: largest number of values of a measured fingerprint, and its admissible values
MOST = 4_000_000
ALLOWED = "increasing x and z (mm), and finite heights (mm) in one row for each z"


def _loop(x: Floats, z: Floats) -> Floats:
    tilt = math.radians(LOOP_TILT)
    along, aside = x * math.sin(tilt) - z * math.cos(tilt), x * math.cos(tilt) + z * math.sin(tilt)
    return np.hypot(np.minimum(along, 0.0), aside)


def _arch(x: Floats, z: Floats) -> Floats:
    return z - ARCH_RISE * np.exp(-0.5 * (x / ARCH_WIDTH) ** 2)


#: pattern -> length (mm) whose multiples of the pitch are the crests
PATTERNS: Mapping[str, Callable[[Floats, Floats], Floats]] = {
    "along": lambda x, z: x,
    "across": lambda x, z: z,
    "whorl": np.hypot,
    "loop": _loop,
    "arch": _arch,
}


@dataclass(frozen=True)
class FingerprintPattern:
    """Ridges that follow a pattern, with the profile of the cross-section."""

    pattern: str
    profile: Ridges

    def depth(self, x: Floats, z: Floats) -> Floats:
        """Depth (mm) below the crests at x, z."""
        return self.profile.below(PATTERNS[self.pattern](x, z))


@dataclass(frozen=True, eq=False)
class HeightMap:
    """A measured fingerprint: `height` (rows, columns) in mm at `z` (rows,) and `x` (columns,), both
    increasing; bilinear in between, constant beyond its edges.

    >>> flat = HeightMap(x=[0.0, 1.0], z=[0.0, 2.0], height=[[0.0, 0.1], [0.0, 0.1]])
    >>> flat.depth(np.array([0.5, 3.0]), np.array([1.0, 1.0])).tolist()
    [0.05, 0.0]
    """

    x: Any
    z: Any
    height: Any

    def __post_init__(self) -> None:
        x, z = (numbers(f"finger.ridges.{name}", getattr(self, name), ALLOWED) for name in ("x", "z"))
        height = numbers("finger.ridges.height", self.height, ALLOWED, axes=2)
        if min(len(x), len(z)) < 2 or (np.diff(x) <= 0.0).any() or (np.diff(z) <= 0.0).any():
            raise InputError("finger.ridges", f"{len(x)} x and {len(z)} z", ALLOWED)
        if height.shape != (len(z), len(x)) or height.size > MOST:
            raise InputError("finger.ridges", f"heights in {' x '.join(map(str, height.shape))}", ALLOWED)
        set_frozen(self, x=x, z=z, height=height)

    def __repr__(self) -> str:
        """Size and range."""
        span = f"x {self.x[0]:.4g} to {self.x[-1]:.4g} mm, z {self.z[0]:.4g} to {self.z[-1]:.4g} mm"
        return f"HeightMap({len(self.z)} x {len(self.x)} points, {span}, {np.ptp(self.height):.4g} mm high)"

    @property
    def columns(self) -> dict[str, Any]:
        """Its data for a scene file."""
        return {"x": self.x.tolist(), "z": self.z.tolist(), "height": self.height.tolist()}

    def depth(self, x: Floats, z: Floats) -> Floats:
        """Depth (mm) below the highest point at x, z."""
        (i, s), (j, t) = _between(self.z, z), _between(self.x, x)
        h = self.height
        low, high = (h[k, j] * (1.0 - t) + h[k, j + 1] * t for k in (i, i + 1))
        return np.asarray(float(h.max()) - (low * (1.0 - s) + high * s))


def _between(grid: Floats, positions: Floats) -> tuple[Any, Floats]:
    """Interval of the grid that contains each position, and the fraction of it passed."""
    i = np.clip(np.searchsorted(grid, positions, side="right") - 1, 0, len(grid) - 2)
    return i, np.clip((positions - grid[i]) / (grid[i + 1] - grid[i]), 0.0, 1.0)


def faded(depth: Floats, fraction: Floats) -> Floats:
    """Depths that fade to 0 at the edge of the refined rectangle; `fraction` (..., 2): 0 in its middle, 1 at
    its edges.
    """
    fade = quintic((1.0 - np.abs(fraction)) / (1.0 - FULL))
    return np.asarray(depth * fade[..., 0] * fade[..., 1])


def read(path: Path, pixel: float, height: float, dark: str | None = None) -> HeightMap:
    """The print in a csv file (header x,z,height: every pair of some x and z, in mm), or in a grey
    image with `pixel` mm from point to point, whose darkest and brightest points are `height` mm apart.

    An image shows the pad from below, tip up, its middle at x = z = 0; `dark` says what is dark in
    it, "ridges" (ink, optical scanners) or "grooves" (a map of heights), which nothing in a picture
    does. Raises `InputError`.
    """
    if path.suffix.lower() in TABLES:
        return HeightMap(
            *gridded(
                "finger.ridges",
                *read_columns(path, dict.fromkeys(("x", "z", "height"), "mm"), "finger.ridges"),
            )
        )
    return _from_image(path, pixel, height, dark)


def _from_image(path: Path, pixel: float, height: float, dark: str | None) -> HeightMap:
    allowed = f"a grey image of at most {MOST} points, or a csv file with the header x,z,height"
    grey, _ = read_grey(path, "finger.ridges", allowed, MOST)
    if min(grey.shape) < 2 or not np.isfinite(grey).all() or not np.ptp(grey) > 0.0:
        raise InputError(
            "finger.ridges", f"{path.name} of one grey, one row or with transparent points", allowed
        )
    if dark is None:
        allowed = "ridges | grooves: what is dark in a picture of a print; scanners and ink show ridges dark"
        raise InputError("finger.ridge_dark", f"nothing for {path.name}", allowed)
    fraction = (grey[::-1] - grey.min()) / np.ptp(grey)
    rows, columns = grey.shape
    x, z = (pixel * (np.arange(n) - 0.5 * (n - 1)) for n in (columns, rows))
    return HeightMap(x, z, height * (1.0 - fraction if dark == "ridges" else fraction))

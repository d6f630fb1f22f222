r"""A surface with heights over x and z, for a finger in three dimensions.

Between its samples the height is the bicubic spline through them, with continuous slopes and curvatures;
beyond its edges it goes on level.
Source: P. Dierckx, *Curve and Surface Fitting with Splines*, Oxford 1993; `scipy.interpolate`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.checks import set_frozen
from evfem.common.tables import gridded, numbers, read_columns
from evfem.common.views import changed
from evfem.errors import InputError
from evfem.surface.surfaces import (
    FARTHEST,
    HIGHEST,
    NEAREST,
    Friction,
    GivesWay,
    Insulator,
    RigidSurface,
    Shift,
)
from evfem.tensor import Array

#: samples along a side that a cubic needs; most samples, and what they may be
LEAST, MOST = 4, 4_000_000
HEIGHTS = (
    f"at least four increasing x and z (mm), at least {NEAREST:g} mm apart, and finite heights (mm) in one "
    f"row for each z, at most {MOST} of them"
)
#: x and z derivatives of height, slopes and curvatures
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


@dataclass(frozen=True, eq=False, init=False)
class Relief(RigidSurface):
    """A sampled surface over the display: heights (rows z, columns x) at `x` and `z`, all in mm.

    >>> x = z = np.linspace(-1.0, 1.0, 9)
    >>> bowl = Relief(x, z, 0.1 * (x**2 + z[:, None] ** 2))
    >>> height, slope, curvature = bowl.relief(np.array([[0.3, -0.4], [5.0, 0.5]]))
    >>> height.round(12).tolist(), slope.round(12).tolist()
    ([0.025, 0.125], [[0.06, -0.08], [0.0, 0.1]])
    """

    x: Array
    z: Array
    samples: Array
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None

    def __init__(
        self,
        x: Any,
        z: Any,
        height: Any,
        friction: Any = 0.3,
        y: float | None = None,
        insulator: Any = None,
        elastic: Any = None,
    ) -> None:
        set_frozen(self, friction=friction, y=y, insulator=insulator, elastic=elastic)
        super().__post_init__()
        for name, entry in (("x", x), ("z", z)):
            grid = numbers(f"surface.{name}", entry, HEIGHTS)
            if grid.size < LEAST or (np.diff(grid) < NEAREST).any() or np.abs(grid).max() > FARTHEST:
                raise InputError(f"surface.{name}", f"{grid.size} positions", HEIGHTS)
            set_frozen(self, **{name: grid})
        samples = numbers("surface.height", height, HEIGHTS, axes=2)
        if samples.shape != (self.z.size, self.x.size) or samples.size > MOST:
            problem = f"heights in {' x '.join(map(str, samples.shape))}"
            raise InputError("surface.height", problem, HEIGHTS)
        if np.abs(samples).max() > HIGHEST:
            problem = f"{samples.ravel()[np.argmax(np.abs(samples))]:g}"
            raise InputError("surface.height", problem, f"heights in mm within {HIGHEST:g} mm")
        set_frozen(self, samples=samples)

    @classmethod
    def from_csv(cls, path: str | Path, **others: Any) -> Relief:
        """The surface in a file with the header `x,z,height`: every pair of some x and some z, in mm."""
        rows = read_columns(Path(path), dict.fromkeys(("x", "z", "height"), "mm"), "surface.file")
        return cls(*gridded("surface.file", *rows), **others)

    def __repr__(self) -> str:
        span = f"x {self.x[0]:.4g} to {self.x[-1]:.4g} mm, z {self.z[0]:.4g} to {self.z[-1]:.4g} mm"
        size = f"{self.z.size} x {self.x.size} points, {span}, {np.ptp(self.samples):.4g} mm high"
        more = [f"{key}={v!r}" for key, v in changed(self).items() if key not in ("x", "z", "samples")]
        return f"Relief({', '.join([size, *more])})"

    @property
    def columns(self) -> dict[str, Any]:
        """Its samples as a scene file holds them."""
        return {"x": self.x.tolist(), "z": self.z.tolist(), "height": self.samples.tolist()}

    @property
    def crosses(self) -> bool:
        """It does."""
        return True

    @cached_property
    def _spline(self) -> Any:
        """The bicubic spline, x before z."""
        from scipy.interpolate import RectBivariateSpline

        return RectBivariateSpline(self.x, self.z, self.samples.T)

    def relief(self, position: Array) -> tuple[Array, Array, Array]:
        """Heights (...), slopes (..., d) and curvatures (..., d, d) at positions (..., d)."""
        d = position.shape[-1]
        x, z = position[..., 0], position[..., 1] if d > 1 else np.zeros(position.shape[:-1])
        near_x, near_z = (np.clip(at, grid[0], grid[-1]) for at, grid in ((x, self.x), (z, self.z)))
        within = near_x == x, near_z == z
        found = []
        for by_x, by_z in ORDERS:
            value = self._spline.ev(near_x, near_z, dx=by_x, dy=by_z)
            found.append(np.where((within[0] | (by_x == 0)) & (within[1] | (by_z == 0)), value, 0.0))
        h, p, q, xx, xz, zz = found
        slope = np.stack([p, q], axis=-1)
        curvature = np.stack([np.stack([xx, xz], axis=-1), np.stack([xz, zz], axis=-1)], axis=-1)
        return h, slope[..., :d], curvature[..., :d, :d]

"""Completes a user's surface that only has a height: slope, curvature, friction for contact."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.common.checks import set_frozen
from evfem.errors import InputError, quoted
from evfem.protocols import CompleteSurface, Surface
from evfem.surface.surfaces import Flat
from evfem.surface.ways import OneWay
from evfem.tensor import Array, derivative, difference

#: step of differences in mm
LENGTH = 1e-4


def completed(surface: Surface) -> CompleteSurface:
    """The surface itself if it has everything, else an `OwnSurface` around it.

    Raises InputError for a class, for an object without `height(x)`, and for a friction, y or
    insulator that cannot be.

    >>> class Ramp:
    ...     friction = 0.3
    ...     def height(self, x): return 0.1 * x
    >>> ramp = completed(Ramp())
    >>> ramp.slope(np.array([2.0])).tolist(), ramp.friction_coefficient(np.array([2.0])).tolist()
    ([0.1], [0.3])
    """
    if isinstance(surface, type) and hasattr(surface, "height"):
        raise InputError("surface", f"the class {surface.__name__}", "an object of it")
    if isinstance(surface, CompleteSurface):
        return surface
    if not isinstance(surface, Surface):
        allowed = (
            "a surface of evfem, for instance Flat, Display or Grating, or an object with a method height(x)"
        )
        raise InputError("surface", quoted(surface), allowed)
    keys = ("friction", "y", "insulator", "elastic")
    plain = Flat(**{"friction": 0.0} | {key: getattr(surface, key) for key in keys if hasattr(surface, key)})
    return OwnSurface(surface, plain, plain.y)


@dataclass(frozen=True)
class OwnSurface(OneWay):
    """A user's surface `own` with derivatives, and with what it does not say itself taken from `plain`."""

    own: Any
    plain: Flat
    y: float | None = field(default=None)
    is_flat = False

    @property
    def angle(self) -> float:  # type: ignore[override]
        """The user's own direction in degrees from +x, or that of x."""
        return float(getattr(self.own, "angle", 0.0))

    @property
    def insulator(self) -> Any:
        """Layer over the electrode, or None."""
        return self.plain.insulator

    @property
    def elastic(self) -> Any:
        """How the surface gives way, or None."""
        return self.plain.elastic

    @property
    def friction(self) -> Any:
        """The user's number or table."""
        return self.plain.friction

    @property
    def has_friction(self) -> bool:
        """Whether the friction coefficient may be positive anywhere."""
        return self.plain.has_friction or hasattr(self.own, "friction_coefficient")

    @property
    def friction_jumps(self) -> Array:
        """Jumps of a table of friction; a method of the user's has none."""
        return self.plain.friction_jumps

    @property
    def friction_ramps(self) -> Array:
        """Ramps of a table of friction; a method of the user's has none."""
        return self.plain.friction_ramps

    def height(self, x: Array) -> Array:
        """Height (mm) of the unshifted profile at x (mm)."""
        return np.asarray(self.own.height(x))

    def slope(self, x: Array) -> Array:
        """The user's own slope, or the derivative of the height."""
        own = getattr(self.own, "slope", None)
        return np.asarray(own(x)) if own is not None else derivative(self.own.height, x, LENGTH)

    def curvature(self, x: Array) -> Array:
        """The user's own curvature, or the derivative of the slope (1/mm)."""
        own = getattr(self.own, "curvature", None)
        return np.asarray(own(x)) if own is not None else derivative(self.slope, x, LENGTH)

    def friction_coefficient(self, x: Array) -> Array:
        """The user's own coefficient, or that of the number or table."""
        own = getattr(self.own, "friction_coefficient", None)
        return np.asarray(own(x)) if own is not None else self.plain.friction_coefficient(x)

    def friction_slope(self, x: Array) -> Array:
        """Derivative of the friction coefficient (1/mm)."""
        own = getattr(self.own, "friction_coefficient", None)
        return difference(own, np.real(x), LENGTH) if own is not None else self.plain.friction_slope(x)

    def shifted(self, y: float) -> OwnSurface:
        """The same surface with its height shifted by `y` (mm)."""
        moved = copy(self)
        set_frozen(moved, y=y)
        return moved

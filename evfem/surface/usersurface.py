"""Completes a user's surface that only has a height: slope, curvature, friction for contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.errors import InputError, describe_value
from evfem.protocols import CompleteSurface, Surface
from evfem.surface.surfaces import Friction, GivesWay, Insulator, RigidSurface, Shift
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
        raise InputError("surface", describe_value(surface), allowed)
    keys = ("friction", "y", "insulator", "elastic")
    return OwnSurface(surface, **{key: getattr(surface, key) for key in keys if hasattr(surface, key)})


@dataclass(frozen=True)
class OwnSurface(RigidSurface):
    """A user's surface `own` with derivatives, and with what it says itself of the other fields."""

    own: Any
    friction: Friction = 0.0
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None

    @property
    def angle(self) -> float:  # type: ignore[override]
        """The user's own direction in degrees from +x, or that of x."""
        return float(getattr(self.own, "angle", 0.0))

    @property
    def has_friction(self) -> bool:
        """Whether the friction coefficient may be positive anywhere."""
        return super().has_friction or hasattr(self.own, "friction_coefficient")

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
        return np.asarray(own(x)) if own is not None else super().friction_coefficient(x)

    def friction_slope(self, x: Array) -> Array:
        """Derivative of the friction coefficient (1/mm)."""
        own = getattr(self.own, "friction_coefficient", None)
        return difference(own, np.real(x), LENGTH) if own is not None else super().friction_slope(x)

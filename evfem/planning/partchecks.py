"""Tests of a user's functions before a run, and the requirements of contact on a user's parts.

`evaluated` and its like say in a sentence what is wrong with a function; `check_surface`,
`check_friction_law` and `check_roughness` try a surface at a dozen places of the way, and laws at
three pressures.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import partial
from inspect import signature
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.roughness import WIDEST
from evfem.errors import InputError
from evfem.scene.scene import Scene
from evfem.tensor import Array, difference

#: what a user's function must be
FUNCTION = "a function that takes arrays with a value for every point"
#: contact pressures (MPa) at which laws are tried, and a bound of friction over the last one, at most: no
#: coefficient of a surface is larger
PRESSURES, GREATEST = np.array([0.0, 1e-4, 0.01]), 100.0
#: coefficient of friction at which laws are tried, and one that is negative by rounding
COEFFICIENT, ROUNDING = 0.3, 1e-9
#: places of a surface as shares of the way, where no kink of a profile is likely
PLACES = np.linspace(0.0371, 0.9643, 12)
#: steps (mm) of differences of a height, the largest slope that counts as none, and the median relative
#: error of a slope, at most: heights have kinks and noise
STEPS, LEVEL, SLOPE = (1e-4, 1e-2), 1e-4, 0.3


def evaluated(key: str, what: str, function: Callable[[Array], Any], at: Array) -> Array:
    """The values of a user's function; InputError where it raises anything, or they are not finite
    numbers.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            given = function(at)
        except Exception as error:  # whatever a user's code raises
            raise InputError(key, f"{what} that raises {type(error).__name__}: {error}", FUNCTION) from error
        if given is None:
            raise InputError(key, f"{what} that returns None", FUNCTION)
        try:
            value = np.asarray(given)
            finite = bool(np.isfinite(value).all())
        except (TypeError, ValueError) as error:  # ragged, or no numbers
            name = type(given).__name__
            raise InputError(
                key, f"{what} that returns a {name} and no array of numbers", FUNCTION
            ) from error
    if not finite:
        raise InputError(key, f"{what} that is infinite or no number", "finite values at rest and in contact")
    return value


def check_arguments(key: str, method: Any, called: tuple[str, ...], *, by_name: bool = False) -> None:
    """Whether a user's method takes the arguments of `called`, those `by_name` under these names."""
    name, *arguments = called
    try:
        own = signature(method)
    except (TypeError, ValueError):  # nothing to call, or compiled
        return
    try:
        own.bind(*arguments)
        order = own.bind(**dict(zip(arguments, arguments, strict=True))).args if by_name else ()
    except TypeError:
        order = ("others",)
    if order != tuple(arguments)[: len(order)]:  # fewer where a decorator takes any
        raise InputError(key, f"{name}{own}", f"{name}({', '.join(arguments)})")


def check_shape(key: str, what: str, found: Array, at: Array, *, one: bool = False) -> None:
    """Whether there is a value for every point, or `one` for all."""
    if found.shape != at.shape and not (one and found.shape == ()):
        given = f"{what} of shape {found.shape} for arrays of shape {at.shape}"
        raise InputError(key, given, f"an array of shape {at.shape}, with a value for every point")


def check_surface(scene: Scene) -> None:
    """Whether a user's surface is finite everywhere on the way, with the slopes of its height."""
    key, own, x = "surface", scene.surface, _places(scene)
    for name in ("height", "slope", "curvature", "friction_coefficient"):
        method = getattr(own, name, None)
        if method is None:
            continue
        check_arguments(key, method, (name, "x"))
        found = evaluated(key, f"{name}(x)", method, x)
        check_shape(key, f"{name}(x)", found, x, one=name == "friction_coefficient")
        if name == "friction_coefficient" and (found < -ROUNDING).any():
            raise InputError(key, f"a friction_coefficient(x) of {found.min():.3g}", "none that is negative")
    _check_slope(key, scene, x)


def _check_slope(key: str, scene: Scene, x: Floats) -> None:
    """Whether the slope that a run takes, given or derived, is near that of differences."""
    given = getattr(scene.surface, "slope", None) is not None
    slope = evaluated(key, "slope(x)" if given else "height(x)", scene.ground.slope, x)
    errors = []
    for step in STEPS:
        near = evaluated(key, "height(x)", partial(difference, scene.ground.height, step=step), x)
        size = np.maximum(np.abs(slope), np.abs(near))
        counts = size > max(LEVEL, LEVEL * size.max())
        errors.append(np.median(np.abs(slope - near)[counts] / size[counts]) if counts.any() else 0.0)
    if min(errors) <= SLOPE:
        return
    if given:
        raise InputError(
            key, "slope(x) that is not the derivative of height(x)", "its derivative, or no slope"
        )
    allowed = "functions of numpy that take complex numbers, or a method slope(x) too"
    raise InputError(key, "height(x) whose derivative is lost in a complex step", allowed)


def _places(scene: Scene) -> Floats:
    """A dozen x (mm) that the pad comes to."""
    width = getattr(scene.finger, "width", None)
    ends = np.array([-0.5, 0.5]) * width if width is not None else _pad_of(scene)
    first, last = ends.min() + scene.reach[0], ends.max() + scene.reach[1]
    return np.asarray(first + PLACES * (last - first))


def _pad_of(scene: Scene) -> Floats:
    """x (mm) of the pad of a finger that does not say how wide it is."""
    mesh = scene.finger.mesh(2)
    nodes = mesh.node_sets.get("pad", ())
    return np.asarray(mesh.points[nodes if len(nodes) else slice(None), 0])


def check_friction_law(scene: Scene) -> None:
    """Whether a user's bound is finite, not negative, in MPa, one value a node, at rest and all speeds."""
    key, law, names = "surface.friction_law", scene.friction_law, ("pressure", "mu", "speed", "age")
    check_arguments(key, law.bound, ("bound", *names), by_name=True)
    speeds = np.array(sorted({0.0, *(course.speed or 0.0 for course in scene.courses)}))
    p, speed = np.tile(PRESSURES, speeds.size), np.repeat(speeds, PRESSURES.size)
    nodes = dict(zip(names[1:], (COEFFICIENT + 0.0 * p, speed, 0.0 * p), strict=True))
    bound = evaluated(key, f"bound({', '.join(names)})", lambda at: law.bound(pressure=at, **nodes), p)
    check_shape(key, "a bound", bound, p, one=True)
    if (bound < 0.0).any():
        raise InputError(key, f"a bound of {bound.min():.3g} MPa", "values that are not negative")
    most = float(np.broadcast_to(bound, p.shape)[p == PRESSURES[-1]].max())
    if most > GREATEST * PRESSURES[-1]:
        given = f"a bound of {most:.3g} at a pressure of {PRESSURES[-1]:g} MPa"
        raise InputError(key, given, "a bound in MPa")


def check_roughness(law: Any) -> None:
    """Whether a user's separation is a length in mm for every pressure."""
    key = "electrostatics.roughness_gap"
    check_arguments(key, law.separation, ("separation", "pressure"))
    apart = evaluated(key, "separation(pressure)", law.separation, PRESSURES)
    check_shape(key, "separation(pressure)", apart, PRESSURES, one=True)
    for length in (float(apart.min()), float(apart.max())):
        if not 0.0 <= length <= WIDEST:
            given = f"a separation of {length:.3g} mm"
            raise InputError(key, given, f"lengths in mm from 0 to {WIDEST:g}")

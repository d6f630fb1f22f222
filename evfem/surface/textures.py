r"""Textures by their parameters: gratings, and self-affine roughness with an exact spectrum.

`Grating` is a periodic row of flat ridges and flat grooves with cosine-shaped walls between them::

    h(x) = -groove_depth (1 - cos(pi s)) / 2,   s from 0 to 1 over the width of a wall

`SelfAffine` is a sum of sines whose wavelengths are whole fractions of its period::

    h(x) = sum over k of a_k sin(q_k x + phi_k),   q_k = 2 pi k / period,   a_k ~ q_k^-(1/2 + H)

for all waves between `longest` and `shortest`, with phases phi_k drawn at random from a seed. The
amplitudes are not drawn: the power spectral density, a_k^2 / 2 in each interval of 2 pi / period,
falls exactly as q^-(1 + 2H), and the root mean square over the period, which is
sqrt(sum of a_k^2 / 2), is exactly `rms`. H is the Hurst exponent; so falls the spectrum of a
self-affine profile along a line (Jacobs, Junge and Pastewka 2017, doi:10.1088/2051-672X/aa51f8).
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from evfem.common.checks import SEED, Within, number, real, set_frozen
from evfem.errors import InputError
from evfem.surface.relief import Relief
from evfem.surface.surfaces import (
    FARTHEST,
    HIGHEST,
    MOST_TERMS,
    Angle,
    Flat,
    Friction,
    GivesWay,
    Insulator,
    Profile,
    RigidSurface,
    Shift,
    Sinusoid,
)
from evfem.tensor import Array

#: shortest length of a texture (mm)
FINEST = 1e-6
#: default width of a wall, as a fraction of the narrower one of ridge and groove
WALL = 0.5


def _length(most: float) -> dict[str, Any]:
    return number(f"a length in mm from {FINEST:g} to {most:g}", Within(FINEST, most), "mm")


# those whose bounds depend on others are checked where all are known
_GROOVE = {"allowed": "a width in mm at half depth, below the period", "unit": "mm"}
_WALL = {"allowed": "a width in mm up to that of ridge and groove", "unit": "mm"}
_SHORTEST = {"allowed": "a wavelength in mm up to the longest", "unit": "mm"}
_LONGEST = {"allowed": "a wavelength in mm up to the period", "unit": "mm"}
_PHASE = number("a fraction of the period, -1 to 1", Within(-1.0, 1.0), "periods")
_HURST = number("a Hurst exponent from 0 to 1", Within(0.0, 1.0))


@dataclass(frozen=True)
class Grating(RigidSurface):
    """A grating: flat ridges at height 0, flat grooves below, one of each per period.

    The middles of ridges are at x = (k + `phase`) `period`. The steepest slope is pi `groove_depth` / (2
    `wall_width`).

    >>> grating = Grating(period=2.0, groove_depth=0.1, groove_width=0.5, wall_width=0.2)
    >>> grating.height(np.array([0.0, 0.64, 0.75, 1.0, 2.0])).round(3).tolist()
    [0.0, 0.0, -0.05, -0.1, 0.0]
    >>> Grating(period=1.0, groove_depth=0.1, wall_width=0.6)
    Traceback (most recent call last):
    evfem.errors.InputError: surface.wall_width: given 0.6; allowed: a width in mm up to 0.5, ridge and groove being 0.5 and 0.5 wide
    """  # noqa: E501

    period: Annotated[float, _length(FARTHEST), "after which the surface repeats"]
    groove_depth: Annotated[float, _length(HIGHEST), "of the grooves below the ridges"]
    groove_width: Annotated[float | None, _GROOVE, "at half depth; without it half the period"] = None
    wall_width: Annotated[
        float | None, _WALL, "width of a wall along x; without it half of ridge or groove"
    ] = None
    phase: Annotated[float, _PHASE, "position of a ridge's middle"] = 0.0
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None
    angle: Angle = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        period = self.period
        groove = 0.5 * period if self.groove_width is None else self.groove_width
        allowed = f"a width in mm above 0 and below the period, {period:g}"
        groove = real("surface.groove_width", groove, allowed, lambda width: 0.0 < width < period, "mm")
        narrower = min(groove, period - groove)
        wall = WALL * narrower if self.wall_width is None else self.wall_width
        widths = f"ridge and groove being {period - groove:g} and {groove:g} wide"
        allowed = f"a width in mm up to {narrower:g}, {widths}"
        wall = real("surface.wall_width", wall, allowed, lambda width: FINEST <= width <= narrower, "mm")
        set_frozen(self, groove_width=groove, wall_width=wall)

    def _wall(self, x: Array) -> tuple[Array, Array, Array]:
        """Place s (...) on the wall, 0 on ridges, 1 in grooves; whether on a wall; sign (...) of ds/dx."""
        assert self.groove_width is not None
        assert self.wall_width is not None
        from_ridge = x - self.period * (np.round(np.real(x) / self.period - self.phase) + self.phase)
        side = np.where(np.real(from_ridge) < 0.0, -1.0, 1.0)
        flat = 0.5 * (self.period - self.groove_width - self.wall_width)
        s = (side * from_ridge - flat) / self.wall_width
        on = (np.real(s) > 0.0) & (np.real(s) < 1.0)
        return np.where(on, s, np.where(np.real(s) < 0.5, 0.0, 1.0)), on, side

    def height(self, x: Array) -> Array:
        """Height (mm) of the unshifted profile at x (mm)."""
        s, _, _ = self._wall(np.asarray(x))
        return 0.5 * self.groove_depth * (np.cos(np.pi * s) - 1.0)

    def slope(self, x: Array) -> Array:
        """Derivative of the height at x (mm)."""
        s, on, side = self._wall(np.asarray(x))
        assert self.wall_width is not None
        steepest = 0.5 * np.pi * self.groove_depth / self.wall_width
        return np.where(on, -side * steepest * np.sin(np.pi * s), 0.0)

    def curvature(self, x: Array) -> Array:
        """Second derivative (1/mm) of the height at x (mm); it jumps where walls begin and end."""
        s, on, _ = self._wall(np.asarray(x))
        assert self.wall_width is not None
        sharpest = 0.5 * self.groove_depth * (np.pi / self.wall_width) ** 2
        return np.where(on, -sharpest * np.cos(np.pi * s), 0.0)


@dataclass(frozen=True)
class SelfAffine(RigidSurface):
    """Self-affine roughness: every wave from `longest` to `shortest` that fits a whole number of times into
    `period`.

    The phases come from `seed`: the same numbers give the same profile on every machine, and a band that is
    wider keeps the waves that it had, but for their common factor.

    >>> rough = SelfAffine(hurst=0.8, rms=0.01, period=10.0, shortest=0.2, seed=1)
    >>> len(rough.terms), f"{np.std(rough.height(np.arange(0.0, 10.0, 0.05))):.6f}"
    (50, '0.010000')
    """

    hurst: Annotated[float, _HURST, "Hurst exponent"]
    rms: Annotated[float, _length(HIGHEST), "root mean square height"]
    period: Annotated[float, _length(FARTHEST), "after which the surface repeats"] = 10.0
    shortest: Annotated[float, _SHORTEST, "shortest wave"] = 0.2
    longest: Annotated[float | None, _LONGEST, "longest wave; without it the period"] = None
    seed: Annotated[int, SEED, "the same seed gives the same surface"] = 0
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None
    angle: Angle = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        period = self.period
        longest = period if self.longest is None else self.longest
        allowed = f"a wavelength in mm up to the period, {period:g}"
        longest = real("surface.longest", longest, allowed, _within(period), "mm")
        allowed = f"a wavelength in mm up to the longest, {longest:g}"
        shortest = real("surface.shortest", self.shortest, allowed, _within(longest), "mm")
        set_frozen(self, longest=longest, shortest=shortest)
        if not 1 <= len(self._waves) <= MOST_TERMS:
            problem = f"{len(self._waves)} waves between {longest:g} and {shortest:g} mm"
            raise InputError("surface.shortest", problem, f"1 to {MOST_TERMS} waves that fit into the period")

    @property
    def _waves(self) -> range:
        """Number of periods of each wave in the period of the surface."""
        assert self.longest is not None
        tiny = 1e-9  # a period of 10 mm has 50 waves of 0.2 mm, whatever the rounding
        first = int(np.ceil(self.period / self.longest * (1.0 - tiny)))
        return range(first, int(np.floor(self.period / self.shortest * (1.0 + tiny))) + 1)

    @property
    def terms(self) -> tuple[tuple[float, ...], ...]:
        """Rows [amplitude in mm, wavenumber in rad/mm, phase in rad], as `Sinusoid` takes them."""
        assert self._sines.terms is not None
        return tuple(map(tuple, self._sines.terms))

    @cached_property
    def _sines(self) -> Sinusoid:
        draw = random.Random(self.seed)  # its numbers are the same in every version of Python
        phases = [2.0 * np.pi * draw.random() for _ in range(1, self._waves.stop)]
        wavenumber = 2.0 * np.pi / self.period * np.array(self._waves)
        amplitude = wavenumber ** -(0.5 + self.hurst)
        amplitude *= self.rms / np.sqrt(0.5 * np.sum(amplitude**2))
        rows = np.column_stack([amplitude, wavenumber, phases[self._waves.start - 1 :]])
        return Sinusoid(terms=rows.tolist())

    def height(self, x: Array) -> Array:
        """Height (mm) of the unshifted profile at x (mm)."""
        return self._sines.height(x)

    def slope(self, x: Array) -> Array:
        """Derivative of the height at x (mm)."""
        return self._sines.slope(x)

    def curvature(self, x: Array) -> Array:
        """Second derivative (1/mm) of the height at x (mm)."""
        return self._sines.curvature(x)


def _within(most: float):  # type: ignore[no-untyped-def]
    return lambda length: FINEST <= length <= most * (1.0 + 1e-12)


#: the surfaces by their kinds in a file
SURFACES: Mapping[str, Any] = {
    "flat": Flat,
    "sinusoid": Sinusoid,
    "profile": Profile,
    "grating": Grating,
    "self_affine": SelfAffine,
    "relief": Relief,
}

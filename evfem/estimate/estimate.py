r"""The friction curve of a texture, estimated from the database in milliseconds.

The pad slides over all of the texture as if it yielded linearly (`sliding`), and this curve is
corrected as the model's curves of the database are (`correction`). For that the texture is reduced
to the two harmonics of the database that explain most of its heights::

    h(x) ~ a (sin(q (x - x0)) + c sin(2 q (x - x0)) + d cos(2 q (x - x0)))

For a texture that repeats, 2 pi / q is a whole fraction of its period; else the best one of `TRIED`
wavelengths. `notes` report heights that two harmonics do not explain, and parameters outside the range of the
database (they are moved to its nearest edge) or outside the convex hull of its points; how wrong such an
estimate is, is not known, and the finite element model has no such limits. A friction profile is used as it
is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats, blas_limits
from evfem.common.checks import choice
from evfem.errors import InputError
from evfem.estimate.correction import corrected
from evfem.estimate.database import reference_curves, shipped
from evfem.estimate.parametric import SPEED, Parametric, at
from evfem.estimate.pressed import shipped_pad
from evfem.estimate.sliding import slid
from evfem.estimate.touch import FrictionCurve, Touch, steps_over, surface_of
from evfem.textures.library import REFERENCES, reference
from evfem.textures.texture import Texture

#: wavelengths that are tried for a texture that ends, fraction of its waves' variance that is enough,
#: mm before and behind the slide over a texture that does not repeat within it
TRIED, ENOUGH, BESIDE = 300, 0.9, 0.125
#: error of an estimate, relative to the range of its curve, from which on a note reports it
MUCH = 0.5
#: relative distance from the speed of the database from which on a note reports it
OTHER_SPEED = 0.05


@dataclass(frozen=True)
class Reduced:
    """Two harmonics of a texture: wavelength, amplitude, `in_phase` and `in_quadrature` as in
    `Parametric`, the position `x0` (mm) where the first sine rises through zero, and the fraction of the
    heights' variance that both `explain`.
    """

    wavelength: float
    amplitude: float
    in_phase: float
    in_quadrature: float
    x0: float
    explain: float


def reduced(texture: Texture) -> Reduced:
    """The two harmonics that explain most of a texture's heights.

    >>> from evfem.textures.generate import Knobs, make
    >>> found = reduced(make("sinusoids", Knobs(0.5, 0.02, second=0.3)))
    >>> f"{found.wavelength:.4f} {found.amplitude:.4f} {found.in_phase:.2f} {found.explain:.3f}"
    '2.0000 0.0200 0.30 1.000'
    """
    if texture.quantity != "height":
        raise InputError("texture", f"{texture.name}, {texture.quantity}", "a texture of heights")
    size, start = int(np.clip(2 ** np.ceil(np.log2(texture.x.size)), 1024, 2048)), texture.x[0]
    x = start + np.arange(size) * (texture.length / size)
    height = np.interp(x, *texture.over(start, start + texture.length))
    if not np.ptp(height) > 1e-12:
        raise InputError("texture", f"{texture.name}, which is level", "heights that differ")
    height = height - height.mean()
    if texture.period is not None:
        power = np.abs(np.fft.rfft(height))[1 : size // 4] ** 2
        second = np.zeros_like(power)
        second[: power.size // 2] = power[1::2][: power.size // 2]
        second = np.minimum(second, power)  # a harmonic, not a wave of its own that hides the first
        found = [texture.period / (1 + int(np.argmax(power + second)))]
    else:
        found = list(np.geomspace(texture.length / 1.5, 8.0 * texture.length / size, TRIED))
    tried = [_harmonics(x, height, wavelength) for wavelength in found]
    # of twice the wavelength the second harmonic is the wave itself
    first = [one for one in tried if np.hypot(one.in_phase, one.in_quadrature) <= 1.0]
    return max(first or tried, key=lambda one: one.explain)


def _harmonics(x: Floats, height: Floats, wavelength: float) -> Reduced:
    """Least squares of both harmonics of one wavelength."""
    turn = 2.0 * np.pi / wavelength * x
    waves = np.stack([np.sin(turn), np.cos(turn), np.sin(2.0 * turn), np.cos(2.0 * turn)], axis=1)
    size, *_ = np.linalg.lstsq(waves, height, rcond=None)
    explain = 1.0 - float(np.sum((height - waves @ size) ** 2) / np.sum(height**2))
    amplitude = max(float(np.hypot(size[0], size[1])), 1e-12)
    phase = float(np.arctan2(size[1], size[0]))  # sin(turn + phase)
    cos, sin = np.cos(2.0 * phase), np.sin(2.0 * phase)
    in_phase = (size[2] * cos + size[3] * sin) / amplitude
    in_quadrature = (size[3] * cos - size[2] * sin) / amplitude
    x0 = -phase * wavelength / (2.0 * np.pi)
    return Reduced(wavelength, amplitude, float(in_phase), float(in_quadrature), x0, explain)


@dataclass(frozen=True, eq=False)
class Estimate:
    """An estimated friction curve with `notes` on what makes it doubtful. `curve.error` holds at every
    position for nine of ten textures that the database does not know; None outside what it covers, which a
    note says.
    """

    curve: FrictionCurve
    notes: tuple[str, ...]
    reduced: Reduced | None = None


def estimate(texture: Texture, touch: Touch) -> Estimate:
    """The apparent friction over `touch.length`."""
    if texture.quantity == "friction":
        x = np.linspace(0.0, touch.length, int(np.clip(200 * touch.length, 100, 4000)) + 1)
        values = np.interp(x, *texture.over(0.0, touch.length))
        return Estimate(FrictionCurve(x, values, "as measured"), ())
    found = reduced(texture)
    steep = 2.0 * np.pi * found.amplitude / found.wavelength
    c, d = (float(np.clip(ratio, -10.0, 10.0)) for ratio in (found.in_phase, found.in_quadrature))
    wanted = Parametric(found.wavelength, steep, c, d, touch.friction, touch.load, touch.ridged)
    location = np.clip(wanted.point(), 0.0, 1.0)
    near = at(location, touch.ridged)
    database = shipped(touch.ridged)
    x, mu, missing = _friction(texture, touch, near, database.estimator(location))
    notes = _notes(wanted, found, touch)
    if missing:
        notes.append(f"no equilibrium was found on {missing:.0%} of the slide")
    if not database.estimator.holds(location):
        notes.append("the texture is outside the hull of the database's points")
    error = None if notes else near.slope * database.error(location)
    if error is not None and error > MUCH * np.ptp(mu):
        notes.append("the error of the estimate is more than half of the range that it shows")
    curve = FrictionCurve(x, mu, "estimate", error)
    return Estimate(curve, tuple(f"{note}: the model has no such limit" for note in notes), found)


def _friction(
    texture: Texture, touch: Touch, near: Parametric, response: Floats
) -> tuple[Floats, Floats, float]:
    """x (n,) in mm, the corrected friction (n,), and the fraction without equilibrium, interpolated."""
    x, linear, period = linear_friction(texture, replace(touch, friction=near.friction, load=near.load))
    found = np.isfinite(linear)
    if not found.all():
        linear = np.interp(x, x[found], linear[found]) if found.any() else np.full_like(x, near.friction)
    mu = corrected(x, linear, response, near.slope, period) + (touch.friction - near.friction)
    along = np.linspace(0.0, touch.length, steps_over(touch.length) + 1)
    return along, np.interp(along, x, mu, period=period), 1.0 - float(found.mean())


def known_error(name: str, ridged: bool) -> float:
    """Rms error of the estimate of a reference texture, as a fraction of the range of the model's curve."""
    x, friction = reference_curves(ridged)[choice("texture", name, tuple(REFERENCES))]
    curve = estimate(reference(name), Touch(ridged=ridged)).curve
    wrong = np.interp(x, curve.x, curve.friction) - friction
    return float(np.sqrt(np.mean(wrong**2)) / np.ptp(friction))


def linear_friction(texture: Texture, touch: Touch) -> tuple[Floats, Floats, float]:
    """x (n,) in mm, the friction of a pad that yields linearly, NaN where not found, and its period in mm."""
    period = min(texture.period or np.inf, touch.length + 2.0 * BESIDE)
    steps = int(np.ceil(period * steps_over(touch.length) / touch.length))
    x = np.linspace(-BESIDE, period - BESIDE, steps, endpoint=False)
    pad = shipped_pad(touch.ridged).at(touch.load, touch.friction)
    with blas_limits():  # small dense solves lose more by sharing
        return x, slid(pad, surface_of(texture, touch, 0.0), touch.friction, x, touch.speed), period


def _notes(wanted: Parametric, found: Reduced, touch: Touch) -> list[str]:
    notes = [
        f"{name.replace('_', ' ')} {getattr(wanted, name):.3g} is outside the database, {low:g} to {high:g}"
        for name, (low, high) in wanted.beyond().items()
    ]
    if found.explain < ENOUGH:
        notes.append(
            f"two harmonics of {found.wavelength:.3g} mm hold {found.explain:.0%} of the heights' variance, "
            "the rest is not corrected"
        )
    if abs(touch.speed / SPEED - 1.0) > OTHER_SPEED:
        notes.append(f"the corrections were made at {SPEED:g} mm/s")
    return notes

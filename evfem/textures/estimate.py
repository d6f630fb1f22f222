r"""The friction curve of a texture, estimated from the database in milliseconds.

A texture is reduced to the two harmonics of the database that explain most of its heights::

    h(x) ~ a (sin(q (x - x0)) + c sin(2 q (x - x0)) + d cos(2 q (x - x0)))

For a texture that repeats, 2 pi / q is a whole fraction of its period; else the best one of
`TRIED` wavelengths. What the harmonics leave out is not estimated, and said. A place outside the
database is moved to its nearest edge, and said too, as is one outside the hull of its points, where
linear interpolation does not reach and the average stands in; the model has no such limits.
A friction profile is taken as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice
from evfem.errors import InputError
from evfem.textures.database import shipped
from evfem.textures.estimators import METHODS, NEAR, hull_weights
from evfem.textures.parametric import SAMPLES, SPEED, Parametric, at
from evfem.textures.texture import Texture
from evfem.textures.touch import FrictionCurve, Touch

#: wavelengths that are tried for a texture that ends, shares of its waves' variance that are enough
#: and hardly anything, samples per period of the curve
TRIED, ENOUGH, FINE = 300, 0.9, 96
#: error of an estimate, as a share of the range that it shows, that is said
MUCH = 0.5
#: relative distance from the speed of the database that is said
OTHER_SPEED = 0.05
#: methods to choose from: by name, or whatever is best
BEST = "best"
CHOICES = (BEST, *METHODS)
MODEL = "the model has no such limit"


@dataclass(frozen=True)
class Reduced:
    """Two harmonics of a texture: wavelength, amplitude, `in_phase` and `in_quadrature` as in
    `Parametric`, the place `x0` (mm) where the first sine rises through zero, and the share of the
    heights' variance that both `explain`.
    """

    wavelength: float
    amplitude: float
    in_phase: float
    in_quadrature: float
    x0: float
    explain: float

    def height(self, x: Floats) -> Floats:
        """The two harmonics (mm) at x (mm), without the mean of the texture."""
        turn = 2.0 * np.pi / self.wavelength * (x - self.x0)
        second = self.in_phase * np.sin(2.0 * turn) + self.in_quadrature * np.cos(2.0 * turn)
        return np.asarray(self.amplitude * (np.sin(turn) + second))


def reduced(texture: Texture) -> Reduced:
    """The two harmonics that explain most of a texture's heights.

    >>> from evfem.textures.generate import Knobs, make
    >>> found = reduced(make("sinusoids", Knobs(0.5, 0.02, second=0.3)))
    >>> f"{found.wavelength:.4f} {found.amplitude:.4f} {found.in_phase:.2f} {found.explain:.3f}"
    '2.0000 0.0200 0.30 1.000'
    """
    if texture.quantity != "height":
        raise InputError("texture", f"{texture.name}, {texture.quantity}", "a texture of heights")
    x, height = _even(texture)
    if not np.ptp(height) > 1e-12:
        raise InputError("texture", f"{texture.name}, which is level", "heights that differ")
    height = height - height.mean()
    length = texture.period or texture.length
    if texture.period is not None:
        power = np.abs(np.fft.rfft(height))[1 : x.size // 4] ** 2
        second = np.zeros_like(power)
        second[: power.size // 2] = power[1::2][: power.size // 2]
        second = np.minimum(second, power)  # a harmonic, not a wave of its own that hides the first
        found = [length / (1 + int(np.argmax(power + second)))]
    else:
        found = list(np.geomspace(length / 1.5, 8.0 * length / x.size, TRIED))
    tried = [_harmonics(x, height, wavelength) for wavelength in found]
    # of twice the wavelength the second harmonic is the wave itself
    first = [one for one in tried if np.hypot(one.in_phase, one.in_quadrature) <= 1.0]
    return max(first or tried, key=lambda one: one.explain)


def _even(texture: Texture) -> tuple[Floats, Floats]:
    """Heights at even spacing, 1024 or 2048 of them."""
    size = int(np.clip(2 ** np.ceil(np.log2(texture.x.size)), 1024, 2048))
    start = texture.x[0]
    x = start + np.arange(size) * (texture.length / size)
    rows = texture.over(start, start + texture.length)
    return x, np.interp(x, *rows)


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
    """An estimated friction curve, and what is to be said of it (`notes`, none where all is well).

    `curve.error` is the root mean square error of the points of the database nearby, left out in
    turn; it knows nothing of what the notes say.
    """

    curve: FrictionCurve
    method: str
    notes: tuple[str, ...]
    reduced: Reduced | None = None

    @property
    def trusted(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.notes


def estimate(texture: Texture, touch: Touch, method: str = BEST) -> Estimate:
    """The apparent friction over `touch.length` by a method of `estimators.METHODS`, or by the one
    that is best for this finger.
    """
    choice("method", method, CHOICES)
    if texture.quantity == "friction":
        x, values = _sampled(texture, touch)
        return Estimate(FrictionCurve(x, values, "as measured"), "as measured", ())
    found = reduced(texture)
    steep = 2.0 * np.pi * found.amplitude / found.wavelength
    c, d = (float(np.clip(share, -10.0, 10.0)) for share in (found.in_phase, found.in_quadrature))
    wanted = Parametric(found.wavelength, steep, c, d, touch.friction, touch.load, touch.ridged)
    place = np.clip(wanted.point(), 0.0, 1.0)
    near = at(place, touch.ridged)
    database = shipped(touch.ridged)
    method = database.best if method == BEST else method
    estimator = database.estimator
    inside = hull_weights(estimator.points * estimator.scale, place * estimator.scale) is not None
    response = estimator(place, method if inside or method != "linear" else "average")
    weight = estimator.near(place, NEAR)
    errors = database.errors[method]
    known = np.isfinite(errors)
    error = near.slope * float(np.sqrt(np.sum((weight * errors**2)[known]) / weight[known].sum()))
    size = int(np.clip(np.ceil(FINE * touch.length / found.wavelength), 200, 20_000))
    x = np.linspace(0.0, touch.length, size + 1)
    phase = (x - found.x0) / found.wavelength % 1.0
    mu = near.friction + near.slope * np.interp(
        phase, np.arange(SAMPLES + 1) / SAMPLES, np.append(response[-1], response)
    )
    curve = FrictionCurve(x, mu + (touch.friction - near.friction), f"estimate ({method})", error)
    notes = _notes(wanted, found, touch)
    if error > MUCH * np.ptp(mu):
        notes = (*notes, f"the error of the estimate is more than half of the range that it shows: {MODEL}")
    if not inside:
        notes = (*notes, f"the texture is outside the hull of the database's points: {MODEL}")
    return Estimate(curve, method, notes, found)


def _sampled(texture: Texture, touch: Touch) -> tuple[Floats, Floats]:
    x = np.linspace(0.0, touch.length, int(np.clip(200 * touch.length, 100, 4000)) + 1)
    return x, np.interp(x, *texture.over(0.0, touch.length))


def _notes(wanted: Parametric, found: Reduced, touch: Touch) -> tuple[str, ...]:
    notes = [
        f"{name.replace('_', ' ')} {getattr(wanted, name):.3g} is outside the database, "
        f"{low:g} to {high:g}: {MODEL}"
        for name, (low, high) in wanted.beyond().items()
    ]
    if found.explain < ENOUGH:
        notes.append(
            f"two harmonics of {found.wavelength:.3g} mm hold {found.explain:.0%} of the heights' variance, "
            f"the rest is not estimated: {MODEL}"
        )
    if abs(touch.speed / SPEED - 1.0) > OTHER_SPEED:
        notes.append(f"the database was made at {SPEED:g} mm/s: {MODEL}")
    return tuple(notes)

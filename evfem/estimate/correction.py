r"""Difference between the model's friction curve and that of a linear elastic pad.

The curve p of `sliding.slid`, with the mean m, is stretched, moved and lifted to come near that of the model,

.. math:: \mu(x) \approx m + s\,o + \alpha\,(p(x - \delta) - m),

s the slope of the texture: tissue that stiffens makes alpha less than one, and what it loses in
friction of its own lifts the mean. These three change slowly from texture to texture and are what
the database interpolates; the phases of the curve's waves, which change fast with the ratio of
contact width and wavelength, stand in p already.
"""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats

#: largest shift that is looked for (mm), and how many are tried
FARTHEST, TRIED = 0.06, 121


def corrections(friction: Floats, linear: Floats, wavelength: Floats, slope: Floats) -> Floats:
    """Offset o, stretch alpha and shift delta in mm, (N, 3), of periods (N, S) of both curves, by
    least squares; `wavelength` (N,) in mm, `slope` (N,).

    >>> x = np.arange(24) / 24
    >>> linear = 0.3 + 0.01 * np.sin(2.0 * np.pi * x)[None]
    >>> other = 0.3 + 0.1 * 0.05 + 0.9 * (np.roll(linear, 1) - 0.3)
    >>> corrections(other, linear, np.array([0.24]), np.array([0.1])).round(6).tolist()
    [[0.05, 0.9, 0.01]]
    """
    wanted, linearised = (np.fft.rfft(curve, axis=1) for curve in (friction, linear))
    offset = (wanted[:, 0] - linearised[:, 0]).real / friction.shape[1] / slope
    wanted, linearised = wanted[:, 1:], linearised[:, 1:]
    turn = -2j * np.pi * np.arange(1, linearised.shape[1] + 1) / wavelength[:, None]
    power = np.maximum(np.sum(np.abs(linearised) ** 2, axis=1), 1e-300)
    shifts = np.linspace(-FARTHEST, FARTHEST, TRIED)
    shared = np.array(
        [np.sum((wanted * np.conj(linearised * np.exp(turn * d))).real, axis=1) for d in shifts]
    )
    best = np.argmax(shared, axis=0)
    return np.stack([offset, shared[best, np.arange(len(best))] / power, shifts[best]], axis=1)


def importance(friction: Floats, linear: Floats, wavelength: Floats, slope: Floats) -> Floats:
    """Rms change of a curve for a unit of each, (N, 3), as a fraction of the range of `friction`."""
    linearised = np.abs(np.fft.rfft(linear, axis=1)[:, 1:]) * np.sqrt(2.0) / linear.shape[1]
    q = 2.0 * np.pi * np.arange(1, linearised.shape[1] + 1) / wavelength[:, None]
    sizes = [slope, np.linalg.norm(linearised, axis=1), np.linalg.norm(q * linearised, axis=1)]
    return np.stack(sizes, axis=1) / np.ptp(friction, axis=1)[:, None]


def corrected(x: Floats, linear: Floats, response: Floats, slope: float, period: float) -> Floats:
    """The curve (n,) at x (n,), one `period` (mm), with a correction (3,)."""
    offset, stretch, shift = response
    mean = linear.mean()
    moved = np.interp(x - shift, x, linear, period=period)
    return np.asarray(mean + slope * offset + stretch * (moved - mean))

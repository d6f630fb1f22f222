r"""Spectrum of a column of the history: which frequencies a force has, and with what amplitude.

The rows of N steps of dt stand for the time T = N dt, each at the end of its step. With
x_k = x(t_0 + k dt), k = 1 ... N, the one-sided amplitudes at the frequencies j / T are::

    a_j = (c_j / N) |sum_k w_k x_k exp(-2 pi i j k / N)|,    c_0 = c_{N/2} = 1, else 2

so that a_0 is the mean's magnitude and a sine of amplitude A whose periods fit T has a_j = A at its
frequency, exactly, and 0 elsewhere. Nothing is taken off: a straight line through a sine is not
level, and to take it off would falsify the amplitudes. Where no whole number of periods fits, or
the column drifts, the window w of Hann (with mean 1, applied to what differs from the mean) keeps
a line to its neighbours, at the price of up to 15 % of its height between two frequencies.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice
from evfem.errors import InputError, describe_value
from evfem.simulation.result import Result

WINDOWS = ("none", "hann")
#: largest difference of two steps, as a fraction of a step
EVEN = 1e-6
#: times that differ by less, as a fraction of the last one, are the same
ROUNDING = 1e-12


class Spectrum(NamedTuple):
    """Frequencies (Hz) from 0 to half the rate of the steps, and the amplitude at each, in the
    unit of the column.

    >>> Spectrum(np.array([0.0, 50.0, 100.0]), np.array([1.0, 3.0, 0.5]))
    Spectrum of 3 frequencies up to 100 Hz: mean 1, largest 3 at 50 Hz
    """

    frequency: Floats
    amplitude: Floats

    def __repr__(self) -> str:
        """Its size, the mean, and the largest amplitude beside it."""
        largest = 1 + int(np.argmax(self.amplitude[1:]))  # two rows at least: 0 and another frequency
        text = f"Spectrum of {self.frequency.size} frequencies up to {self.frequency[-1]:g} Hz"
        peak = f"{self.amplitude[largest]:.4g} at {self.frequency[largest]:g} Hz"
        return f"{text}: mean {self.amplitude[0]:.4g}, largest {peak}"


def spectrum(
    result: Result,
    column: str | Floats,
    *,
    start: float | None = None,
    stop: float | None = None,
    window: str = "none",
) -> Spectrum:
    """Frequencies and one-sided amplitudes of a column of the history.

    Parameters
    ----------
    result
        A result with time.
    column
        Name of a column of the history, or one value for each step (steps,), as of a point of a probe.
    start, stop
        Rows later than `start` and not later than `stop` (s) are used; without `start` those of the
        last motion.
    window
        none or hann, see the head of `evfem.simulation.spectrum`.

    Returns
    -------
    Spectrum
        Frequencies (Hz) and amplitudes in the unit of the column.

    Raises
    ------
    InputError
        Fewer than two rows, or rows that are not evenly spaced in time.
    """
    values = _values(result, column)
    choice("window", window, WINDOWS)
    used, before = _rows(result, start, stop)
    step, values = _step(result.time[used], before), values[used]
    if not np.isfinite(values).all():
        name = column if isinstance(column, str) else "values"
        raise InputError("column", f"{name}, not known in all rows", "a column of finite values")
    amplitude = amplitudes(values, window)
    return Spectrum(np.arange(amplitude.size) / (values.size * step), amplitude)


def _values(result: Result, column: str | Floats) -> Floats:
    """The values of a column, or those given in its place, one for each step."""
    if not isinstance(column, str):
        values = np.asarray(column)
        if values.dtype.kind not in "iuf" or values.shape != result.step.shape:
            allowed = f"the name of a column, or {len(result.step)} numbers, one for each step"
            raise InputError("column", f"values of shape {values.shape}, {values.dtype}", allowed)
        return values.astype(float)
    if column not in result.columns or column == "motion":
        allowed = ", ".join(name for name in result.columns if name != "motion")
        raise InputError("column", describe_value(column), allowed)
    return np.asarray(result[column], dtype=float)


def amplitudes(values: Floats, window: str) -> Floats:
    """One-sided amplitudes, from the mean's on, of evenly spaced values (n,).

    scipy.signal.periodogram would be as long, and its import takes half a second.
    """
    size, mean = values.size, values.mean()
    if window == "hann":
        values = mean + (values - mean) * (1.0 - np.cos(2.0 * np.pi * (np.arange(size) + 0.5) / size))
    amplitude = np.abs(np.fft.rfft(values)) * 2.0 / size
    amplitude[0] = abs(mean)
    if size % 2 == 0:
        amplitude[-1] *= 0.5
    return np.asarray(amplitude)


def _rows(result: Result, start: float | None, stop: float | None) -> tuple[Any, float]:
    """Rows in use, and the time of the row before them."""
    if not len(result.step):
        raise InputError("result", "no steps", "a result with steps in time")
    slack = ROUNDING * float(result.time[-1])
    first = result.motion_index == result.motion_index[-1] if start is None else result.time > start + slack
    used = first & (result.time <= (np.inf if stop is None else stop + slack))
    earlier = result.time[: int(np.argmax(used))] if used.any() else result.time
    return used, float(earlier[-1]) if earlier.size else 0.0


def _step(time: Floats, before: float) -> float:
    """The length of every step (s)."""
    if time.size < 2:
        raise InputError("start, stop", f"{time.size} rows", "at least two rows")
    steps = np.diff(np.concatenate([[before], time]))
    mean = float(steps.mean())
    if not mean > 0.0:
        raise InputError("time", "steps in which no time passes", "a Wait, or a motion with a speed")
    if np.abs(steps - mean).max() > EVEN * mean:
        given = f"steps of {steps.min():.6g} to {steps.max():.6g} s"
        raise InputError("time", given, "rows that are evenly spaced in time: choose start and stop")
    return mean

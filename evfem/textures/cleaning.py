"""From a raw profile to a usable one: cut, gaps filled, levelled, smoothed, and every step said.

Levelling subtracts the least-squares polynomial: a mean, a line or a parabola. Gaps are values that
are not finite; they are filled by straight lines, as long as they are not most of the profile.
Smoothing is the Gaussian profile filter with the cut-off wavelength of ISO 16610-21: a wave of that
length keeps half its amplitude.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, check_fields, number, one_of
from evfem.errors import InputError

LEVELS = ("none", "mean", "line", "parabola")
#: largest share of gaps that is filled
MOST_GAPS = 0.5


@dataclass(frozen=True)
class Cleaning:
    """What is done to a raw profile, in this order: cut to `start` ... `stop` (mm from its first
    point), gaps filled, levelled (none, mean, line or parabola), smoothed with the cut-off
    wavelength `smooth` (mm).

    >>> x = np.arange(5.0)
    >>> _, heights, notes = Cleaning(start=1.0)(x, np.array([9.0, 1.0, np.nan, 3.0, 4.0]))
    >>> heights.round(9).tolist()
    [0.0, 0.0, 0.0, 0.0]
    >>> notes[1:]
    ['1 of 4 values missing, filled by straight lines.', 'Levelled: line taken off.']
    """

    start: float | None = field(default=None, metadata=number("mm, not negative", Within(0.0)))
    stop: float | None = field(default=None, metadata=number("mm above zero", Within(0.0, above=True)))
    level: str = field(default="line", metadata=one_of(*LEVELS))
    smooth: float | None = field(default=None, metadata=number("mm above zero", Within(0.0, above=True)))

    def __post_init__(self) -> None:
        check_fields(self)

    def __call__(self, x: Floats, height: Floats) -> tuple[Floats, Floats, list[str]]:
        """x (n,), heights (n,), both mm, and what was done; x then begins at 0."""
        notes: list[str] = []
        inside = np.ones(x.size, bool)
        if self.start is not None or self.stop is not None:
            start, stop = self.start or 0.0, np.inf if self.stop is None else self.stop
            inside = (x - x[0] >= start) & (x - x[0] <= stop)
            notes.append(f"Cut to {start:g} ... {min(stop, float(np.ptp(x))):g} mm.")
        if inside.sum() < 4:
            given = f"{inside.sum()} of {x.size} points"
            raise InputError("start, stop", given, "a cut that leaves at least four points")
        x, height = x[inside] - x[inside][0], height[inside]
        height = _filled(x, height, notes)
        if self.level != "none":
            degree = LEVELS.index(self.level) - 1
            height = height - np.polynomial.Polynomial.fit(x, height, degree)(x)
            notes.append(f"Levelled: {self.level} taken off.")
        if self.smooth is not None:
            height = _smoothed(x, height, self.smooth)
            notes.append(f"Smoothed: Gaussian profile filter, cut-off {self.smooth:g} mm (ISO 16610-21).")
        return x, height, notes


def _filled(x: Floats, height: Floats, notes: list[str]) -> Floats:
    known = np.isfinite(height)
    missing = int((~known).sum())
    if missing > MOST_GAPS * x.size:
        raise InputError("heights", f"{missing} of {x.size} missing", f"at most {MOST_GAPS:.0%} of them")
    if missing:
        notes.append(f"{missing} of {x.size} values missing, filled by straight lines.")
    return np.interp(x, x[known], height[known])


def _smoothed(x: Floats, height: Floats, cutoff: float) -> Floats:
    from scipy.ndimage import gaussian_filter1d

    step = float(np.ptp(x)) / (x.size - 1)
    if np.abs(np.diff(x) - step).max() > 0.01 * step:
        raise InputError("smooth", "points that are not evenly spaced", "an even spacing, or no smoothing")
    alpha = np.sqrt(np.log(2.0) / np.pi)  # ISO 16610-21
    sigma = alpha * cutoff / np.sqrt(2.0 * np.pi) / step
    return np.asarray(gaussian_filter1d(height, sigma, mode="nearest"))

"""Textures from files of others: a class for each kind of file, with its endings and its options.

Whatever is assumed or done is in the texture's provenance. The annotated fields of a class are its
options: the command line and the studio's page have them from there. A class that derives from
`Importer` with a `kind` is all that a further one needs, here or in a module that has been imported.

Heights are cut, gaps filled, levelled, smoothed, in this order. Levelling subtracts the least-squares
polynomial: a mean, a line or a parabola. Gaps are values that are not finite, or a kilometre and more; they
are filled by straight lines, as long as they are not most of the profile. Smoothing is the Gaussian profile
filter with the cut-off wavelength of ISO 16610-21: a wave of that length keeps half its amplitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Checked, Within, instance, number, one_of
from evfem.common.tables import gridded, is_even
from evfem.errors import InputError
from evfem.textures.texture import Texture

LEVELS = ("none", "mean", "line", "parabola")
#: largest fraction of gaps that is filled, and rms slope of heights that no finger slides over
MOST_GAPS, STEEP = 0.5, 1.0
#: how far points are from a straight line, or from lines of a grid, as a fraction of the length
STRAIGHT, ON_GRID = 0.01, 1e-6
#: a height (mm) that none has: programs write the largest number of their kind where a point is missing
FAR = 1e6
#: kind -> class of its files, in the order in which they are asked
IMPORTERS: dict[str, type[Importer]] = {}

Text = instance("a text", str)
POSITIVE = Within(0.0, above=True)


@dataclass(frozen=True, kw_only=True)
class Importer(Checked):
    """What a file cannot say of itself, whatever its kind; called with a path it makes the texture."""

    licence: Annotated[str, instance('a text, such as "CC0-1.0"', str), "what others may do with it"]
    name: Annotated[str | None, Text, "what it is called; default: as its file"] = None
    note: Annotated[str | None, Text, "where it is from, a sentence"] = None

    endings: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, kind: str = "") -> None:
        if kind:
            IMPORTERS[kind] = cls

    @classmethod
    def takes(cls, path: Path) -> bool:
        """Whether a file is of this kind."""
        return path.suffix.lower() in cls.endings

    def __call__(self, path: str | Path) -> Texture:
        """The texture in a file."""
        raise NotImplementedError

    def texture(
        self, path: Path, kind: str, rows: tuple[Floats, Floats], notes: Sequence[str], quantity: str
    ) -> Texture:
        """The texture with these rows, and what was done to them."""
        said = (f"From {path.name[:200]}.", *([self.note] if self.note else []), *notes)
        name = self.name or path.stem[:100]
        return Texture(name, kind, *rows, self.licence, quantity=quantity, provenance=said)


@dataclass(frozen=True, kw_only=True)
class Heights(Importer):
    """How heights are cleaned.

    >>> x = np.arange(5.0)
    >>> cleaning = Heights(licence="CC0-1.0", start=1.0)
    >>> _, heights, notes = cleaning.cleaned(x, np.array([9.0, 1.0, np.nan, 3.0, 4.0]))
    >>> heights.round(9).tolist()
    [0.0, 0.0, 0.0, 0.0]
    >>> notes[1:]
    ['1 of 4 values missing, filled by straight lines.', 'Levelled: line taken off.']
    """

    level: Annotated[str, one_of(*LEVELS), "which polynomial is subtracted"] = "line"
    start: Annotated[float | None, number("not negative", Within(0.0), "mm"), "where to begin"] = None
    stop: Annotated[float | None, number("above zero", POSITIVE, "mm"), "where to end"] = None
    smooth: Annotated[
        float | None, number("above zero", POSITIVE, "mm"), "cut-off wavelength of smoothing"
    ] = None

    def cleaned(self, x: Floats, height: Floats) -> tuple[Floats, Floats, list[str]]:
        """x (n,), heights (n,), both mm, and what was done; x then begins at 0."""
        notes: list[str] = []
        if lost := int((~np.isfinite(x)).sum()):
            x, height = x[np.isfinite(x)], height[np.isfinite(x)]
            notes.append(f"{lost} rows without x left out.")
        inside = np.ones(x.size, bool)
        if self.start is not None or self.stop is not None:
            start, stop = self.start or 0.0, np.inf if self.stop is None else self.stop
            inside = (x - x[0] >= start) & (x - x[0] <= stop)
            notes.append(f"Cut to {start:g} ... {min(stop, float(np.ptp(x))):g} mm.")
        if inside.sum() < 4:
            problem = f"{inside.sum()} of {x.size} points"
            raise InputError("start, stop", problem, "at least four points between them")
        x, height = x[inside], height[inside]
        known = np.abs(height) < FAR
        seen = np.flatnonzero(known)
        some = slice(seen[0], seen[-1] + 1) if seen.size else slice(0)
        if cut := x.size - x[some].size:
            x, height, known = x[some], height[some], known[some]
            notes.append(f"{cut} missing values at the ends cut off.")
        if x.size < 4:
            raise InputError("heights", f"{x.size} values", "at least four")
        x = x - x[0]
        if missing := int((~known).sum()):
            if missing > MOST_GAPS * x.size:
                problem = f"{missing} of {x.size} missing"
                raise InputError("heights", problem, f"at most {MOST_GAPS:.0%} of them")
            notes.append(f"{missing} of {x.size} values missing, filled by straight lines.")
            height = np.interp(x, x[known], height[known])
        if self.level != "none":
            degree = LEVELS.index(self.level) - 1
            height = height - np.polynomial.Polynomial.fit(x, height, degree)(x)
            notes.append(f"Levelled: {self.level} taken off.")
        if self.smooth is not None:
            height = _smoothed(x, height, self.smooth)
            notes.append(f"Smoothed: Gaussian profile filter, cut-off {self.smooth:g} mm (ISO 16610-21).")
        return x, height, notes

    def heights(self, path: Path, kind: str, x: Floats, height: Floats, notes: list[str]) -> Texture:
        """The texture of raw heights; a note says if they are too steep to be meant."""
        x, height, done = self.cleaned(x, height)
        with np.errstate(all="ignore"):  # places that do not rise are refused below
            slope = float(np.sqrt(np.mean((np.diff(height) / np.diff(x)) ** 2)))
        if slope > STEEP:
            steeper = "steeper than any surface that a finger slides over: is each unit right?"
            done.append(f"Rms slope {slope:.3g}, {steeper}")
        return self.texture(path, kind, (x, height), [*notes, *done], "height")


def line_of(path: Path, rows: Floats, row: float) -> tuple[list[Floats], str]:
    """Places along a line and heights there, of rows (3, n) of x, y and height (mm), and where the line is:
    the one that the points are on, or the line `row` (0 to 1) of a grid.
    """
    rows = rows[:, np.isfinite(rows[:2]).all(axis=0)]
    places = (rows[:2] - rows[:2].mean(axis=1, keepdims=True)).T
    grain = ON_GRID * float(np.ptp(places, axis=0).max() or 1.0)
    with suppress(InputError):
        x, y = (np.rint(places / grain) * grain).T
        xs, ys, heights = gridded("file", x, y, rows[2])
        number = round(row * (len(ys) - 1))
        return [xs - xs[0], heights[number]], f"Line {number + 1} of {len(ys)} along x."
    direction = np.linalg.svd(places, full_matrices=False)[2]
    along, *beside = direction @ places.T
    if np.ptp(beside) > STRAIGHT * np.ptp(along):
        allowed = "points of x,y,z on one straight line, or on every place of a grid"
        raise InputError("file", f"{path.name}, {len(along)} points that are neither", allowed)
    x = (along - along[0]) * (1.0 if along[-1] > along[0] else -1.0)
    angle = float(np.degrees(np.arctan2(*np.abs(direction[0, ::-1]))))
    return [x, rows[2]], f"Along a line at {angle:.3g} degrees to x."


def _smoothed(x: Floats, height: Floats, cutoff: float) -> Floats:
    from scipy.ndimage import gaussian_filter1d

    step = float(np.ptp(x)) / (x.size - 1)
    if not is_even(x):
        raise InputError("smooth", "points that are not evenly spaced", "an even spacing, or no smoothing")
    alpha = np.sqrt(np.log(2.0) / np.pi)  # ISO 16610-21
    sigma = alpha * cutoff / np.sqrt(2.0 * np.pi) / step
    return np.asarray(gaussian_filter1d(height, sigma, mode="nearest"))

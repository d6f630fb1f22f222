"""Textures from files of others: csv, recordings of vibrations, grey images.

Whatever is assumed or done is in the texture's provenance. A recording becomes the spectrum of the
friction over the spatial frequency f / speed, never heights: an accelerometer does not feel them. A
grey image has no heights either: who imports one says how deep black lies below white.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import above, real
from evfem.common.pictures import read_grey
from evfem.common.tables import read_columns
from evfem.electrostatics import wav
from evfem.errors import InputError
from evfem.textures.cleaning import Cleaning
from evfem.textures.texture import QUANTITIES, Texture

#: units of length -> mm
LENGTHS = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "nm": 1e-6, "m": 1e3}
IMAGES = ("PNG", "JPEG", "TIFF", "BMP")
#: largest image in pixels
MOST_PIXELS = 40_000_000
#: frequencies of a spectrum that is kept, and the highest in 1/mm
MOST_LINES, HIGHEST_FREQUENCY = 400, 20.0


@dataclass(frozen=True)
class Source:
    """What a file cannot say of itself: the texture's `name` (None: the file's), its `licence`, and
    one more sentence of where it is from.
    """

    licence: str
    name: str | None = None
    note: str | None = None

    def texture(self, path: Path, kind: str, rows: tuple[Floats, Floats], notes: Sequence[str]) -> Texture:
        """The texture of heights with these rows."""
        return self.of(path, kind, rows, notes, "height")

    def of(
        self, path: Path, kind: str, rows: tuple[Floats, Floats], notes: Sequence[str], quantity: str
    ) -> Texture:
        """The texture of any quantity with these rows."""
        said = (f"From {path.name[:200]}.", *([self.note] if self.note else []), *notes)
        name = self.name or path.stem[:100]
        return Texture(name, kind, *rows, self.licence, quantity=quantity, provenance=said)


def from_csv(path: str | Path, source: Source, cleaning: Cleaning | None = None, unit: str = "mm") -> Texture:
    """A file with the header `x,height` (both in `unit`: mm, um, nm or m), `x,friction` (x in
    `unit`) or `frequency,amplitude` (1/mm).

    Heights are cleaned (None: levelled by a line), the others kept as they are.
    """
    path = Path(path)
    scale = _unit(unit)
    quantity = _quantity(path)
    first, second = read_columns(path, QUANTITIES[quantity][0], "file")
    if quantity == "friction_spectrum":
        return source.of(path, "measured", (first, second), [], quantity)
    notes = [] if scale == 1.0 else [f"Lengths were in {unit}."]
    if quantity == "friction":
        return source.of(path, "measured", (first * scale, second), notes, quantity)
    x, height, done = (cleaning or Cleaning())(first * scale, second * scale)
    return source.texture(path, "measured", (x, height), [*notes, *done])


def _quantity(path: Path) -> str:
    try:
        with path.open(encoding="utf-8-sig") as lines:
            words = [word.strip() for word in lines.readline(200).split(",")]
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError("file", f"{path} ({reason})", "a readable csv file") from None
    for quantity, (header, _) in QUANTITIES.items():
        if words == header:
            return quantity
    headers = " | ".join(",".join(header) for header, _ in QUANTITIES.values())
    raise InputError("file", f"{path}, which starts with {','.join(words)[:60]!r}", headers)


def _unit(unit: str) -> float:
    if unit not in LENGTHS:
        raise InputError("unit", repr(unit), " | ".join(LENGTHS))
    return LENGTHS[unit]


def from_recording(path: str | Path, source: Source, speed: float) -> Texture:
    """A WAV (one channel), or a csv file with the header `time,acceleration`, recorded while
    something slid at `speed` (mm/s): the spectrum of the friction, rms amplitude 1.

    The spectrum is the mean over half-overlapping windows of Hann (Welch 1967,
    doi:10.1109/TAU.1967.1161901). An acceleration is divided by the square of the frequency, as a
    displacement is. Size and phases are not known from such a file: `friction_profile` takes them.
    """
    path = Path(path)
    above("speed", speed, 0.0, "a speed in mm/s above zero")
    if path.suffix.lower() == ".wav":
        whole, stored, _ = wav.read(path, "file")
        rate, samples = float(whole), wav.shares(stored)
        notes = [f"Recorded at {rate:g} Hz, slid at {speed:g} mm/s."]
        frequency, amplitude = spectrum_of(samples, rate)
    else:
        time, samples = read_columns(path, ["time", "acceleration"], "file")
        rate = _rate(time)
        notes = [f"Acceleration at {rate:g} Hz, slid at {speed:g} mm/s, integrated twice."]
        frequency, amplitude = spectrum_of(samples, rate)
        amplitude = amplitude / (2.0 * np.pi * frequency) ** 2
    rows = _lines(frequency / speed, amplitude)
    return source.of(path, "recorded", rows, [*notes, "Rms amplitude set to 1."], "friction_spectrum")


def _rate(time: Floats) -> float:
    steps = np.diff(time)
    if time.size < 16 or not (steps > 0.0).all() or np.ptp(steps) > 0.01 * steps.mean():
        raise InputError("time", f"{time.size} rows", "at least 16 rows at an even spacing in s")
    return float(1.0 / steps.mean())


def spectrum_of(samples: Floats, rate: float) -> tuple[Floats, Floats]:
    """Frequencies (Hz, 0 left out) and one-sided amplitudes: the root of the mean power of each line.

    >>> time = np.arange(4096) / 1000.0
    >>> frequency, amplitude = spectrum_of(3.0 * np.sin(2.0 * np.pi * 125.0 * time), 1000.0)
    >>> float(frequency[np.argmax(amplitude)]), round(float(np.sqrt(np.sum(amplitude**2))), 3)
    (125.0, 3.0)
    """
    size = min(samples.size // 2 * 2, 2048)
    if size < 8 or not np.ptp(samples) > 0.0:
        raise InputError("file", f"{samples.size} samples", "at least 8 samples that differ")
    from scipy.signal import welch  # half a second

    frequency, density = welch(samples, rate, nperseg=size)
    return frequency[1:-1], np.sqrt(2.0 * rate / size * density[1:-1])


def _lines(frequency: Floats, amplitude: Floats) -> tuple[Floats, Floats]:
    """At most `MOST_LINES` lines below `HIGHEST_FREQUENCY`, neighbours put together by their power."""
    kept = (frequency > 0.05) & (frequency <= HIGHEST_FREQUENCY)
    if kept.sum() < 2:
        raise InputError("speed", "hardly a line between 0.05 and 20 per mm", "the speed of the recording")
    frequency, power = frequency[kept], amplitude[kept] ** 2
    width = -(-frequency.size // MOST_LINES)
    starts = np.arange(0, frequency.size, width)
    sizes = np.diff(np.append(starts, frequency.size))
    frequency = np.add.reduceat(frequency, starts) / sizes
    power = np.add.reduceat(power, starts)
    return frequency, np.sqrt(power / power.sum())


def friction_profile(spectrum: Texture, mean: float, rms: float, length: float, seed: int = 0) -> Texture:
    """A friction profile with this spectrum: `mean`, root mean square `rms` of what varies, over
    `length` (mm), with phases drawn from `seed`; it never falls below 0.
    """
    if spectrum.quantity != "friction_spectrum":
        raise InputError("texture", f"{spectrum.name}, {spectrum.quantity}", "a friction spectrum")
    real("mean", mean, "a friction coefficient from 0 to 10", lambda mu: 0.0 <= mu <= 10.0)
    real("rms", rms, "a number from 0 to the mean", lambda size: 0.0 <= size <= mean)
    above("length", length, 0.0, "a length in mm above zero")
    import random

    draw = random.Random(seed)
    phase = np.array([2.0 * np.pi * draw.random() for _ in spectrum.x])
    size = int(min(np.ceil(8.0 * length * spectrum.x[-1]), 20_000)) + 2
    x = np.linspace(0.0, length, size)
    waves = np.sin(2.0 * np.pi * np.outer(x, spectrum.x) + phase) @ spectrum.values
    waves *= np.sqrt(2.0) * rms / np.sqrt(np.sum(spectrum.values**2))
    note = f"Friction {mean:g} on average, rms {rms:g}, phases from seed {seed}."
    values = np.clip(mean + waves, 0.0, None)
    notes = (*spectrum.provenance, note)
    return Texture(
        spectrum.name, spectrum.kind, x, values, spectrum.licence, quantity="friction", provenance=notes
    )


def from_image(
    path: str | Path,
    source: Source,
    *,
    pixel: float,
    depth: float,
    row: float = 0.5,
    cleaning: Cleaning | None = None,
) -> Texture:
    """A line through a grey image (PNG, JPEG, TIFF, BMP), along its width: white lies `depth` (mm)
    above black, a pixel is `pixel` (mm) wide, `row` (0 top to 1 bottom) says where.

    Pictures of 8 and 16 bits, and those of floats and longer integers, whose smallest and largest
    value are then black and white (`evfem.common.pictures`); colours are turned to grey, transparent
    points are gaps. How deep something is cannot be read off a picture, and the provenance says that
    `depth` was set.
    """
    above("pixel", pixel, 0.0, "a width in mm above zero")
    above("depth", depth, 0.0, "a height in mm above zero")
    real("row", row, "a place from 0 (top) to 1 (bottom)", lambda place: 0.0 <= place <= 1.0)
    path = Path(path)
    allowed = f"an image ({', '.join(IMAGES)}) of up to {MOST_PIXELS} pixels, at least 4 wide"
    grey, numbers = read_grey(path, "file", allowed, MOST_PIXELS, IMAGES)
    if grey.shape[1] < 4:
        raise InputError("file", f"{path}, {grey.shape[1]} x {grey.shape[0]} pixels", allowed)
    line = round(row * (grey.shape[0] - 1))
    height = grey[line] * depth
    x, height, done = (cleaning or Cleaning())(np.arange(height.size) * pixel, height)
    notes = [
        f"Row {line + 1} of {grey.shape[0]}, {pixel:g} mm per pixel.",
        numbers,
        f"Heights are grey values, white set {depth:g} mm above black: they were not measured.",
        *done,
    ]
    return source.texture(path, "image", (x, height), notes)

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
from evfem.common.checks import above, choice, real
from evfem.common.pictures import read_grey
from evfem.common.tables import Headed, read_headed
from evfem.electrostatics import wav
from evfem.errors import InputError, quoted
from evfem.textures.cleaning import Cleaning
from evfem.textures.texture import QUANTITIES, Texture

#: units of length -> mm
LENGTHS = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "μm": 1e-3, "nm": 1e-6, "cm": 10.0, "m": 1e3}
#: names of columns that mean the same, and those that are no lengths
OTHER_NAMES, PURE = {"z": "height", "position": "x", "distance": "x"}, ("friction", "frequency", "amplitude")
#: endings of images, and of texts that may have a header
ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
TEXTS = (".csv", ".txt", ".tsv", ".dat", ".asc", ".prn", ".xyz")
#: what is recorded -> how often it is integrated, and how that is said
RECORDED = {"acceleration": 2, "velocity": 1, "displacement": 0, "height": 0, "friction": 0}
INTEGRATED = ("", ", integrated once", ", integrated twice")
#: longest wave (mm) of a recording unless another is said, and how many of them a window holds
LONGEST_WAVE, WAVES = 10.0, 10
#: rms slope of heights that no finger slides over
STEEP = 1.0
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
        """The texture of heights with these rows; a note says if they are too steep to be meant."""
        slope = float(np.sqrt(np.mean((np.diff(rows[1]) / np.diff(rows[0])) ** 2)))
        steep = (
            f"Rms slope {slope:.3g}, steeper than any surface that a finger slides over: is each unit right?"
        )
        return self.of(path, kind, rows, [*notes, *([steep] if slope > STEEP else [])], "height")

    def of(
        self, path: Path, kind: str, rows: tuple[Floats, Floats], notes: Sequence[str], quantity: str
    ) -> Texture:
        """The texture of any quantity with these rows."""
        said = (f"From {path.name[:200]}.", *([self.note] if self.note else []), *notes)
        name = self.name or path.stem[:100]
        return Texture(name, kind, *rows, self.licence, quantity=quantity, provenance=said)


def from_csv(
    path: str | Path, source: Source, cleaning: Cleaning | None = None, unit: str | None = None
) -> Texture:
    """A text file with columns x and height (or z), x and friction, or frequency and amplitude (1/mm).

    Each length has the unit that its header says, as in `x [mm], z [um]`, or without one `unit` (mm,
    um, nm or m; None: mm). Heights are cleaned (None: levelled by a line), the others kept as they
    are.
    """
    path, table = Path(path), _read(Path(path))
    quantity = _quantity_of(table.names)
    if quantity is None:
        headers = " | ".join(",".join(header) for header, _ in QUANTITIES.values())
        raise InputError("file", f"{path}, which starts with {','.join(table.names)[:60]!r}", headers)
    scales = [_scale(name, own, unit) for name, own in _units(table)]
    first, second = (column * scale for column, scale in zip(table.columns, scales, strict=True))
    notes = _said(table, unit)
    if quantity != "height":
        return source.of(path, "measured", (first, second), notes, quantity)
    x, height, done = (cleaning or Cleaning())(first, second)
    return source.texture(path, "measured", (x, height), [*notes, *done])


def kind_of(path: Path) -> str:
    """What a file is taken for: image, recording, csv or scan; by its ending, a text by its header."""
    ending = path.suffix.lower()
    if ending in ENDINGS:
        return "image"
    if ending == ".wav":
        return "recording"
    try:
        names = _read(path).names if ending in TEXTS else []
    except InputError:
        names = []  # whoever reads it says what is wrong
    if names[:1] == ["time"]:
        return "recording"
    return "csv" if ending == ".csv" or _quantity_of(names) else "scan"


def _read(path: Path) -> Headed:
    return read_headed(path, "file")


def _quantity_of(names: list[str]) -> str | None:
    """What columns of these names are."""
    usual = [OTHER_NAMES.get(name, name) for name in names]
    return next((quantity for quantity, (header, _) in QUANTITIES.items() if usual == header), None)


def _units(table: Headed) -> list[tuple[str, str | None]]:
    return list(zip(table.names, table.units, strict=True))


def _said(table: Headed, unit: str | None) -> list[str]:
    """In which units the lengths of a table were."""
    own = [(name, said) for name, said in _units(table) if said and name not in PURE]
    told = [f"{', '.join(f'{name} in {said}' for name, said in own)}, as the header says."] if own else []
    if unit not in (None, "mm") and len(own) < sum(name not in PURE for name in table.names):
        told.append(f"{'Other lengths' if own else 'Lengths'} were in {unit}.")
    return [*told, *(["Commas are decimal points."] if table.commas else [])]


def _scale(name: str, own: str | None, unit: str | None) -> float:
    """What makes mm of the numbers of a column, or 1/mm of a frequency."""
    units = dict.fromkeys(("1/mm", "1", "-", "mm^-1"), 1.0) if name in PURE else LENGTHS
    found = own or (unit if name not in PURE else None) or next(iter(units))
    if found not in units:
        raise InputError("unit", f"{name} in {found}", " | ".join(units))
    return units[found]


def from_recording(
    path: str | Path,
    source: Source,
    speed: float,
    *,
    quantity: str | None = None,
    longest: float = LONGEST_WAVE,
    channel: int | str | None = None,
) -> Texture:
    """A WAV, or a text file with a column time (s) and others at an even spacing, recorded while
    something slid at `speed` (mm/s): the spectrum of the friction, rms amplitude 1.

    `quantity` says what was recorded: acceleration, velocity, displacement, height or friction; a
    column of one of these names says so itself, a WAV never does. An acceleration is divided by the
    square of the frequency and a velocity by the frequency, as a displacement is. `channel` is the
    number of a WAV's channel, from 1, or the name or number of a column; needed where there are
    several. Waves longer than `longest` (mm) are left out: there an acceleration has mostly the drift
    of the hand.

    The spectrum is the mean over half-overlapping windows of Hann (Welch 1967,
    doi:10.1109/TAU.1967.1161901) as long as `WAVES` of the longest waves, or as the recording. Size
    and phases are not known from such a file: `friction_profile` takes them.
    """
    path = Path(path)
    above("speed", speed, 0.0, "a speed in mm/s above zero")
    above("longest", longest, 0.0, "a wavelength in mm above zero")
    rate, samples, column = _samples(path, channel)
    quantity = _recorded(path, quantity, column)
    size = int(np.ceil(WAVES * longest * rate / speed))
    frequency, amplitude = spectrum_of(samples, rate, size)
    rows = _lines(frequency / speed, amplitude / (2.0 * np.pi * frequency) ** RECORDED[quantity], longest)
    covered = samples.size / rate * speed
    notes = [
        f"{quantity.capitalize()} at {rate:g} Hz, slid at {speed:g} mm/s{INTEGRATED[RECORDED[quantity]]}.",
        f"Waves of up to {longest:g} mm.",
        *(
            [f"Recorded over {covered:.3g} mm, fewer than three of these waves."]
            if covered < 3 * longest
            else []
        ),
        "Rms amplitude set to 1.",
    ]
    return source.of(path, "recorded", rows, notes, "friction_spectrum")


def _samples(path: Path, channel: int | str | None) -> tuple[float, Floats, str]:
    """Rate (Hz), samples of one channel, and the name of its column, "" of a WAV."""
    if path.suffix.lower() == ".wav":
        whole, stored, _ = wav.read(path, "file", "a WAV", several=True)
        rate, names = float(whole), []
        columns = list(wav.shares(stored).reshape(len(stored), -1).T)
    else:
        table = _read(path)
        if table.names[0] != "time":
            raise InputError("file", f"{path}, which starts with {table.names[0]!r}", "a column time first")
        rate = _rate(table.columns[0] * _seconds(table.units[0] or "s"))
        columns, names = table.columns[1:], table.names[1:]
    which = _channel(channel, names, len(columns))
    if not np.isfinite(columns[which]).all():
        raise InputError("file", f"{path}, with gaps", "a recording without gaps")
    return rate, columns[which], names[which] if names else ""


def _seconds(unit: str) -> float:
    scales = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
    if unit not in scales:
        raise InputError("time", f"in {unit}", " | ".join(scales))
    return scales[unit]


def _channel(given: int | str | None, names: list[str], count: int) -> int:
    """Which of the channels, from 0."""
    called = [*names, *map(str, range(1, count + 1))]
    if given is None and count == 1:
        return 0
    if given is None or str(given).lower() not in called:
        said = f"nothing, of {count}" if given is None else quoted(str(given))
        raise InputError("channel", said, " | ".join(called))
    return called.index(str(given).lower()) % count


def _recorded(path: Path, given: str | None, column: str) -> str:
    """What a recording holds: what was said, unless its column says another."""
    if given is not None:
        choice("quantity", given, tuple(RECORDED))
    said = column if column in RECORDED else given
    if said is None or (given is not None and said != given):
        wrong = (
            f"nothing, and {path.name} does not say what it holds" if said is None else f"{given}, of {said}"
        )
        raise InputError("quantity", wrong, " | ".join(RECORDED))
    return said


def _rate(time: Floats) -> float:
    steps = np.diff(time)
    if time.size < 16 or not (steps > 0.0).all() or np.ptp(steps) > 0.01 * steps.mean():
        raise InputError("time", f"{time.size} rows", "at least 16 rows at an even spacing in s")
    return float(1.0 / steps.mean())


def spectrum_of(samples: Floats, rate: float, size: int) -> tuple[Floats, Floats]:
    """Frequencies (Hz, 0 left out) and one-sided amplitudes: the root of the mean power of each
    line, of windows of `size` samples, or of all if there are fewer.

    >>> time = np.arange(4096) / 1000.0
    >>> frequency, amplitude = spectrum_of(3.0 * np.sin(2.0 * np.pi * 125.0 * time), 1000.0, 2048)
    >>> float(frequency[np.argmax(amplitude)]), round(float(np.sqrt(np.sum(amplitude**2))), 3)
    (125.0, 3.0)
    """
    size = min(samples.size, max(size, 8)) // 2 * 2
    if size < 8 or not np.ptp(samples) > 0.0:
        raise InputError("file", f"{samples.size} samples", "at least 8 samples that differ")
    from scipy.signal import welch  # half a second

    frequency, density = welch(samples, rate, nperseg=size)
    return frequency[1:-1], np.sqrt(2.0 * rate / size * density[1:-1])


def _lines(frequency: Floats, amplitude: Floats, longest: float) -> tuple[Floats, Floats]:
    """At most `MOST_LINES` lines from waves of `longest` (mm) to `HIGHEST_FREQUENCY`, neighbours put
    together by their power.
    """
    lowest = (1.0 - 1e-9) / longest
    kept = (frequency >= lowest) & (frequency <= HIGHEST_FREQUENCY)
    if kept.sum() < 2:
        given = f"hardly a line between {lowest:.3g} and {HIGHEST_FREQUENCY:g} per mm"
        raise InputError("speed", given, "the speed of the recording, and a longest wave that it has")
    frequency, power = frequency[kept], amplitude[kept] ** 2
    width = -(-frequency.size // MOST_LINES)
    starts = np.arange(0, frequency.size, width)
    weight = power + 1e-12 * power.max()
    frequency = np.add.reduceat(frequency * weight, starts) / np.add.reduceat(weight, starts)
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

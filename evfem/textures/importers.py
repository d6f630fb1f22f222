"""Kinds of files that become textures: grey images, recordings of vibrations, tables, scans.

A recording has no heights: an accelerometer does not feel them. It becomes the spectrum of the friction
over the spatial frequency f / speed, the mean over half-overlapping windows of Hann (Welch 1967,
doi:10.1109/TAU.1967.1161901) as long as `WAVES` of the longest waves, or as the recording. Size and phases
are not known from such a file: `friction_profile` takes them.
"""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, above, instance, number, one_of, real
from evfem.common.foreign import read_grey
from evfem.common.notices import warn
from evfem.common.tables import TABLES, is_even, names_of, read_headed
from evfem.common.units import UNITS, factor
from evfem.electrostatics import wav
from evfem.errors import InputError, describe_value
from evfem.textures.generate import phases
from evfem.textures.importing import IMPORTERS, POSITIVE, Heights, Importer, line_of
from evfem.textures.scans import line_in
from evfem.textures.texture import QUANTITIES, Texture

#: units of length -> mm
LENGTHS = {name: size for name, (base, size) in UNITS.items() if base == "mm"}
#: units of columns that are no lengths
PURE = {"friction": ("1",), "frequency": ("1/mm", "1"), "amplitude": ("1",)}
#: endings of texts that may have a header
TEXTS = (*TABLES, ".txt", ".tsv", ".dat", ".asc", ".prn", ".xyz")
#: what is recorded -> how often it is integrated, and how that is said
RECORDED = {"acceleration": 2, "velocity": 1, "displacement": 0, "height": 0, "friction": 0}
INTEGRATED = ("", ", integrated once", ", integrated twice")
#: how many of the longest waves a window holds; frequencies that are kept, and the highest in 1/mm
WAVES, MOST_LINES, HIGHEST_FREQUENCY = 10, 400, 20.0
#: rows of a friction profile at most, and of each of its waves at least
MOST_ROWS, FEWEST = 20_000, 4
IMAGES = ("PNG", "JPEG", "TIFF", "BMP")
#: largest image in pixels; largest scan in bytes and in points
MOST_PIXELS, MOST_BYTES, MOST_POINTS = 40_000_000, 512_000_000, 50_000_000

Unit = Annotated[str | None, one_of(*LENGTHS), "of lengths for which the file names none; default: mm"]
_ROW = number("a fraction from 0 to 1", Within(0.0, 1.0))
Row = Annotated[float, _ROW, "which line, from the first to the last"]
Quantity = Annotated[str | None, one_of(*RECORDED), "what a recording holds"]
Longest = Annotated[float, number("a wavelength above zero", POSITIVE, "mm"), "longest wave of a recording"]
Channel = Annotated[
    int | str | None, instance("a number or a name", int, str), "of a WAV, from 1; or a column"
]


def importer_of(path: Path) -> tuple[str, type[Importer]]:
    """The kind of a file and its class, by its ending, of a text by its header; else it is a scan."""
    return next((one for one in IMPORTERS.items() if one[1].takes(path)), ("scan", Scan))


def header_of(path: Path) -> list[str]:
    """Names of the columns of a text, none where it cannot be read: whoever reads it says why."""
    return names_of(path) if path.suffix.lower() in TEXTS else []


@dataclass(frozen=True, kw_only=True)
class Image(Heights, kind="image"):
    """A line through a grey image, along its width: white lies `depth` above black.

    Pictures of 8 and 16 bits, and those of floats and longer integers, whose smallest and largest value are
    then black and white (`evfem.common.foreign`); colours are turned to grey, transparent points are gaps.
    How deep something is cannot be read off a picture, and the provenance says that `depth` was set.
    """

    pixel: Annotated[float, number("a width above zero", POSITIVE, "mm"), "width of a pixel of an image"]
    depth: Annotated[float, number("a height above zero", POSITIVE, "mm"), "how deep black lies below white"]
    row: Row = 0.5

    endings = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")

    def __call__(self, path: str | Path) -> Texture:
        path = Path(path)
        allowed = f"an image ({', '.join(IMAGES)}) of up to {MOST_PIXELS} pixels, at least 4 wide"
        grey, numbers = read_grey(path, "file", allowed, MOST_PIXELS, IMAGES)
        if grey.shape[1] < 4:
            raise InputError("file", f"{path.name}, {grey.shape[1]} x {grey.shape[0]} pixels", allowed)
        line = round(self.row * (grey.shape[0] - 1))
        height = grey[line] * self.depth
        white = f"white set {self.depth:g} mm above black: they were not measured."
        pixels = f"Row {line + 1} of {grey.shape[0]}, {self.pixel:g} mm per pixel."
        notes = [pixels, numbers, f"Heights are grey values, {white}"]
        return self.heights(path, "image", np.arange(height.size) * self.pixel, height, notes)


@dataclass(frozen=True, kw_only=True)
class Table(Heights, kind="csv"):
    """A text file with columns x and height (or z), x and friction, or frequency and amplitude (1/mm).

    Each length has the unit that its header says, as in `x [mm], z [um]`, or without one `unit`. Heights
    are cleaned, the others kept as they are. With a column y the heights are those of a straight line, which
    keeps its length, or of a grid, of which one line along x is taken. What has no such columns is another
    program's: a `Scan`, where SurfaceTopography is installed.
    """

    row: Row = 0.5
    unit: Unit = None

    endings = TABLES

    @classmethod
    def takes(cls, path: Path) -> bool:
        """By its ending, or a text by its header; one that begins with a time is a recording."""
        names = header_of(path)
        return names[:1] != ["time"] and (super().takes(path) or _quantity_of(names) is not None)

    def __call__(self, path: str | Path) -> Texture:
        path = Path(path)
        try:
            table = read_headed(path, "file")
        except InputError as error:
            return self._scanned(path, error)
        quantity = _quantity_of(table.names)
        if quantity is None:
            headers = " | ".join(",".join(header) for header, _ in QUANTITIES.values())
            value = f"{path.name}, which {table.start}"
            refusal = InputError("file", value, f"{headers}, so called in the file")
            return self._scanned(path, refusal, table.names[0] == "1")
        usual = [_usual(name) for name in table.names]
        across = ["y"] if quantity == "height" and usual.count("y") == 1 else []
        x, value = QUANTITIES[quantity][0]
        used = [usual.index(name) for name in (x, *across, value)]
        rows = [table.columns[i] * _scale(table.names[i], table.units[i], self.unit) for i in used]
        lengths = [(table.names[i], table.units[i]) for i in used if table.names[i] not in PURE]
        own = [f"{name} in {unit}" for name, unit in lengths if unit]
        notes = [f"{', '.join(own)}, as the header says."] if own else []
        if self.unit not in (None, "mm") and len(own) < len(lengths):
            notes.append(f"{'Other lengths' if own else 'Lengths'} were in {self.unit}.")
        notes += ["Commas are decimal points."] if table.commas else []
        if across:
            rows, note = line_of(path, np.array(rows), self.row)
            notes.append(note)
        if quantity != "height":
            return self.texture(path, "measured", (rows[0], rows[1]), notes, quantity)
        return self.heights(path, "measured", rows[0], rows[1], notes)

    def _scanned(self, path: Path, error: InputError, perhaps: bool = True) -> Texture:
        """The texture of another program's text, or the `error` that says what this one has."""
        if not perhaps or find_spec("SurfaceTopography") is None:
            raise error
        try:
            return Scan(**{spec.name: getattr(self, spec.name) for spec in fields(self)})(path)
        except InputError as other:
            raise (error if other.key == "file" else other) from None


def _quantity_of(names: list[str]) -> str | None:
    """What columns of these names are, perhaps among others."""
    usual = [_usual(name) for name in names]
    found = (q for q, (header, _) in QUANTITIES.items() if all(usual.count(name) == 1 for name in header))
    return next(found, None)


def _usual(name: str) -> str:
    return {"z": "height", "position": "x", "distance": "x"}.get(name, name)


def _scale(name: str, own: str | None, unit: str | None) -> float:
    """Factor from the numbers of a column to mm, or of a frequency to 1/mm."""
    return factor("unit", name, own or (None if name in PURE else unit), PURE.get(name, ("mm",)))


@dataclass(frozen=True, kw_only=True)
class Scan(Heights, kind="scan"):
    """A line along x through a scanned surface, or a scanned profile, in one of the forty formats of
    SurfaceTopography (extra `scans`), or what it leaves of .x3p and .tmd (`evfem.textures.scans`).
    """

    row: Row = 0.5
    unit: Unit = None

    endings = (".x3p", ".tmd", ".sur", ".al3d", ".nc", ".opd", ".plux", ".di")

    def __call__(self, path: str | Path) -> Texture:
        path = Path(path)
        if own := line_in(path, self.row) if path.is_file() else ():
            return self.heights(path, "scan", own[0], own[1], [own[2]])
        if find_spec("SurfaceTopography") is None:
            raise InputError("file", path.name, 'the extra scans: pip install "evfem[scans]"')
        topography = _topography(path)
        named, scale = _length(path, topography.unit, self.unit)
        note = f"In {named}."
        heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=float), np.nan) * scale
        if topography.dim == 1:
            x = np.asarray(topography.positions()).ravel() * scale
        else:
            step = topography.physical_sizes[0] * scale / heights.shape[0]
            x, line = (np.arange(heights.shape[0]) + 0.5) * step, round(self.row * (heights.shape[1] - 1))
            note = f"Line {line + 1} of {heights.shape[1]} along x, in {named}."
            heights = heights[:, line]
        return self.heights(path, "scan", x, heights.ravel(), [note])


def _length(path: Path, own: Any, unit: str | None) -> tuple[str, float]:
    """The unit of a scan and its size in mm: the file's, if SurfaceTopography knows it, or `unit`."""
    from SurfaceTopography.Support.UnitConversion import get_unit_conversion_factor, mangle_length_unit_utf8

    with suppress(ValueError, TypeError, AttributeError):  # no unit, an unknown one, one for each axis
        return str(own), float(get_unit_conversion_factor(mangle_length_unit_utf8(own), "mm"))
    if unit is None:
        value = f"{path.name}, {f'in {own}' if own else 'without a unit'}"
        raise InputError("unit", value, f"one of {', '.join(LENGTHS)}")
    return unit, LENGTHS[unit]


def _topography(path: Path) -> Any:
    allowed = "a scan that SurfaceTopography reads, of up to 50,000,000 points"
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError("file", f"{path.name}, which is too long", allowed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import SurfaceTopography

            reader = SurfaceTopography.open_topography(str(path))
            if np.prod(reader.default_channel.nb_grid_pts) > MOST_POINTS:
                raise InputError("file", f"{path.name}, with too many points", allowed)
            return reader.topography()
    except InputError:
        raise
    except Exception as error:  # forty readers, each with errors of its own
        reason = getattr(error, "strerror", None) or "of an unknown kind or damaged"
        raise InputError("file", f"{path.name} ({reason})", allowed) from None


@dataclass(frozen=True, kw_only=True)
class Haptics(Importer, kind="hjif"):
    """MPEG haptics (.hjif): the friction over x of its first friction perception."""

    endings = (".hjif",)

    def __call__(self, path: str | Path) -> Texture:
        path = Path(path)
        position, friction, told = wav.read_friction(path)
        note = f"Friction perception {str(told.get('description', ''))[:100]!r}"
        note += f", the first of {1 + told['others']}." if told["others"] else "."
        return self.texture(path, "measured", (position - position[0], friction), [note], "friction")


@dataclass(frozen=True, kw_only=True)
class Recording(Importer, kind="recording"):
    """A WAV, or a text file with a column time and others at an even spacing, recorded while something
    slid: the spectrum of the friction, rms amplitude 1.

    A column that is called as one of the quantities says itself what was recorded, a WAV never does. An
    acceleration is divided by the square of the frequency and a velocity by the frequency. `channel` is
    needed where there are several. Longer waves than `longest` are left out: there an acceleration has
    mostly the drift of the hand.
    """

    speed: Annotated[float, number("a speed in mm/s above zero", POSITIVE, "mm/s"), "of the recorded slide"]
    quantity: Quantity = None
    longest: Longest = 10.0
    channel: Channel = None

    endings = (".wav",)

    @classmethod
    def takes(cls, path: Path) -> bool:
        """By its ending, a text by its first column."""
        return super().takes(path) or header_of(path)[:1] == ["time"]

    def __call__(self, path: str | Path) -> Texture:
        path, speed, longest = Path(path), self.speed, self.longest
        rate, samples, column = _samples(path, self.channel)
        quantity = _recorded(path, self.quantity, column)
        frequency, amplitude = spectrum_of(samples, rate, int(np.ceil(WAVES * longest * rate / speed)))
        twice = RECORDED[quantity]
        amplitude = amplitude / (2.0 * np.pi * frequency) ** twice
        covered = samples.size / rate * speed
        short = f"Recorded over {covered:.3g} mm, fewer than three of these waves."
        notes = [
            f"{quantity.capitalize()} at {rate:g} Hz, slid at {speed:g} mm/s{INTEGRATED[twice]}.",
            f"Waves of up to {longest:g} mm.",
            *([short] if covered < 3 * longest else []),
            "Rms amplitude set to 1.",
        ]
        rows = _lines(frequency / speed, amplitude, longest)
        return self.texture(path, "recorded", rows, notes, "friction_spectrum")


def _samples(path: Path, channel: int | str | None) -> tuple[float, Floats, str]:
    """Rate (Hz), samples of one channel, and the name of its column, "" of a WAV."""
    if path.suffix.lower() == ".wav":
        whole, stored, _ = wav.read(path, "file", "a WAV", several=True)
        rate, names = float(whole), []
        columns = list(wav.normalised_samples(stored).reshape(len(stored), -1).T)
    else:
        table = read_headed(path, "file")
        if table.names[0] != "time":
            raise InputError("file", f"{path.name}, which {table.start}", "a column time first")
        time = table.column("time", 1, ("s",))
        if time.size < 16 or not is_even(time):
            raise InputError("time", f"{time.size} rows", "at least 16 rows at an even spacing in s")
        rate = float((time.size - 1) / (time[-1] - time[0]))
        columns, names = table.columns[1:], table.names[1:]
    which = _channel(channel, names, len(columns))
    if not np.isfinite(columns[which]).all():
        raise InputError("file", f"{path.name}, with gaps", "a recording without gaps")
    return rate, columns[which], names[which] if names else ""


def _channel(value: int | str | None, names: list[str], count: int) -> int:
    numbers = [*map(str, range(1, count + 1))]
    called = [*(name for name in names if names.count(name) == 1), *numbers]
    if value is None and count == 1:
        return 0
    if value is not None and str(value) in numbers:
        return int(value) - 1
    if value is None or str(value).lower() not in called:
        said = f"nothing, of {count}" if value is None else describe_value(str(value))
        raise InputError("channel", said, " | ".join(called))
    return names.index(str(value).lower())


def _recorded(path: Path, value: str | None, column: str) -> str:
    """What a recording holds: what was said, unless its column says another."""
    said = column if column in RECORDED else value
    if said is None:
        wrong = f"nothing, and {path.name} does not say what it holds"
        raise InputError("quantity", wrong, " | ".join(RECORDED))
    if value not in (None, said):
        raise InputError("quantity", f"{value}, of {said}", " | ".join(RECORDED))
    return said


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

    with np.errstate(over="ignore", invalid="ignore"):
        frequency, density = welch(samples, rate, nperseg=size)
    if not np.isfinite(density).all():
        raise InputError(
            "file", f"samples of {np.abs(samples).max():.3g}", "samples whose squares are numbers"
        )
    return frequency[1:-1], np.sqrt(2.0 * rate / size * density[1:-1])


def _lines(frequency: Floats, amplitude: Floats, longest: float) -> tuple[Floats, Floats]:
    """At most `MOST_LINES` lines from waves of `longest` (mm) on, neighbours put together by their power."""
    lowest = (1.0 - 1e-9) / longest
    kept = (frequency >= lowest) & (frequency <= HIGHEST_FREQUENCY)
    if kept.sum() < 2:
        problem = f"hardly a line between {lowest:.3g} and {HIGHEST_FREQUENCY:g} per mm"
        raise InputError("speed", problem, "the speed of the recording, and a longest wave that it has")
    frequency, power = frequency[kept], amplitude[kept] ** 2
    width = -(-frequency.size // MOST_LINES)
    starts = np.arange(0, frequency.size, width)
    weight = power + 1e-12 * power.max()
    frequency = np.add.reduceat(frequency * weight, starts) / np.add.reduceat(weight, starts)
    power = np.add.reduceat(power, starts)
    return frequency, np.sqrt(power / power.sum())


def friction_profile(spectrum: Texture, mean: float, rms: float, length: float, seed: int = 0) -> Texture:
    """A profile over `length` (mm) with this spectrum, phases by `seed`, nowhere below 0.

    Its rows have the `mean` and the `rms` (deviation from it) that are given, whatever the phases; where it
    would be below 0 it is cut off, and a warning and its provenance say what it has then. Raises InputError
    for what is no friction spectrum, and for a length whose `MOST_ROWS` rows do not hold its waves.
    """
    if spectrum.quantity != "friction_spectrum":
        raise InputError("texture", f"{spectrum.name}, {spectrum.quantity}", "a friction spectrum")
    if not spectrum.values.any():
        raise InputError("texture", f"{spectrum.name}, whose amplitudes are 0", "a spectrum with waves")
    real("mean", mean, "a friction coefficient from 0 to 10", lambda mu: 0.0 <= mu <= 10.0)
    real("rms", rms, "a number from 0 to the mean", lambda size: 0.0 <= size <= mean)
    above("length", length, 0.0, "a length in mm above zero")
    x = _rows_for(spectrum, length)
    phase = phases(seed, spectrum.x.size)
    waves = np.sin(2.0 * np.pi * np.outer(x, spectrum.x) + phase) @ spectrum.values
    waves -= waves.mean()
    waves /= waves.std()
    values = np.clip(mean + rms * waves, 0.0, None)
    note = f"Friction {mean:g} on average, rms {rms:g}, phases from seed {seed}."
    if cut := float(np.mean(mean + rms * waves < 0.0)):
        has = f"Friction {values.mean():.3g} on average, rms {values.std():.3g}"
        asked = f"cut off at 0 on {100.0 * cut:.2g} % of {length:g} mm, of mean {mean:g}, rms {rms:g}"
        note = f"{has}: {asked}, phases from seed {seed}."
        warn(f"{spectrum.name}: {note} Up to an rms of about {-mean / waves.min():.2g} nothing is cut off.")
    return replace(spectrum, x=x, values=values, quantity="friction", provenance=(*spectrum.provenance, note))


def _rows_for(spectrum: Texture, length: float) -> Floats:
    """Positions (mm) over `length` (mm): eight of the shortest wave, or as many as there may be. Raises
    InputError for less than `FEWEST` of the shortest wave that has a thousandth of the largest amplitude.
    """
    shortest = 1.0 / float(spectrum.x[spectrum.values > 1e-3 * spectrum.values.max()][-1])
    if length * FEWEST > shortest * MOST_ROWS:
        rows = f"of whose {MOST_ROWS} rows a wave of {shortest:.3g} mm has less than {FEWEST}"
        most, least = shortest * MOST_ROWS / FEWEST, FEWEST * length / MOST_ROWS
        allowed = f"at most {most:.4g} mm, or a spectrum without waves below {least:.3g} mm"
        raise InputError("length", f"{length:g} mm, {rows}", allowed)
    size = int(min(np.ceil(8.0 * length * spectrum.x[-1]), MOST_ROWS)) + 2
    return np.linspace(0.0, length, size)

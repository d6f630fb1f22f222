"""A texture, and its files: a `.json` beside its `.csv`, or a folder with both.

What is known over x is either the height of a surface or its friction coefficient. A recording of
vibrations gives neither: it is stored as the spectrum of the friction over the spatial frequency,
and converted to a friction profile with random phases and a given rms.
The `.json` has exactly the keys of `KEYS`; the licence is one of them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice, real, set_frozen
from evfem.common.storage import disk, replacing
from evfem.common.tables import csv_text, numbers, read_bytes, read_columns
from evfem.common.views import plus
from evfem.errors import InputError, describe_value

FORMAT = "evfem-texture-1"
#: what the `.json` is called in a folder
NAME = "texture.json"
#: quantity -> the header of its csv file and the units of both columns
QUANTITIES = {
    "height": (["x", "height"], ["mm", "mm"]),
    "friction": (["x", "friction"], ["mm", "1"]),
    "friction_spectrum": (["frequency", "amplitude"], ["1/mm", "1"]),
}
KEYS = ("format", "name", "kind", "quantity", "period", "length", "units", "licence", "provenance", "data")
#: what a texture may be at most: rows, mm of length, letters of a text, sentences of provenance, bytes of a
#: `.json`; and its least and largest values
MOST_ROWS, LONGEST, MOST_LETTERS, MOST_NOTES, MOST_BYTES = 200_000, 1e4, 400, 200, 200_000
ENDS = {"height": (-10.0, 10.0), "friction": (0.0, 100.0), "friction_spectrum": (0.0, 1.5)}


@dataclass(frozen=True, eq=False)
class Texture:
    """Heights (mm) or friction over x (mm), or the amplitudes of a friction spectrum over the
    spatial frequency (1/mm), rms amplitude of all together 1.

    `x`, `values`: arrays (n,), x rising. `period` (mm) is that of a texture that repeats, whose rows
    are one period without its end; None: it has an end. `kind` says what made it, `licence` what
    others may do with it, `provenance` what was done, a sentence each.

    >>> wave = Texture("wave", "drawn", [0.0, 1.0], [0.0, 0.01], "CC0-1.0", period=2.0)
    >>> wave
    Texture('wave', drawn, 2 heights, period 2 mm, 0.01 mm from lowest to highest)
    >>> wave.over(0.0, 4.0)[0].tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """

    name: str
    kind: str
    x: Any
    values: Any
    licence: str
    quantity: str = "height"
    period: float | None = None
    provenance: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        for key in ("name", "kind", "licence"):
            _text(key, getattr(self, key))
        choice("quantity", self.quantity, tuple(QUANTITIES))
        x = numbers("x", self.x, "a list of numbers")
        values = numbers(self.quantity, self.values, "a list of numbers")
        if not isinstance(self.provenance, (list, tuple)):
            raise InputError("provenance", describe_value(self.provenance), "a list of sentences")
        set_frozen(self, x=x, values=values, provenance=tuple(self.provenance))
        if len(self.provenance) > MOST_NOTES:
            raise InputError("provenance", f"{len(self.provenance)} sentences", f"at most {MOST_NOTES}")
        for note in self.provenance:
            _text("provenance", note)
        _check(self)
        if self.period is not None:
            period = real("period", self.period, "a length in mm above zero", lambda p: p > 0.0)
            if self.quantity == "friction_spectrum" or not x[-1] - x[0] < period <= LONGEST:
                problem = f"{period:g} mm, with rows over {x[-1] - x[0]:g}"
                allowed = f"more than the rows' length, up to {LONGEST:g} mm, and none for a spectrum"
                raise InputError("period", problem, allowed)
            set_frozen(self, period=period)

    def __repr__(self) -> str:
        if self.quantity == "friction_spectrum":
            what = f"{self.x.size} frequencies, {self.x[0]:.4g} to {self.x[-1]:.4g} per mm"
            return f"Texture({self.name!r}, {self.kind}, {what})"
        plural, unit = ("heights", " mm") if self.quantity == "height" else ("friction coefficients", "")
        size = f"length {self.length:.4g} mm" if self.period is None else f"period {self.period:.4g} mm"
        span = f"{plus(np.ptp(self.values)):.4g}{unit} from lowest to highest"
        return f"Texture({self.name!r}, {self.kind}, {self.x.size} {plural}, {size}, {span})"

    @property
    def length(self) -> float:
        """Length of the rows (mm), one period of a texture that repeats; 0 for a spectrum."""
        if self.quantity == "friction_spectrum":
            return 0.0
        return float(self.x[-1] - self.x[0]) if self.period is None else self.period

    def over(self, start: float, stop: float) -> tuple[Floats, Floats]:
        """Rows from `start` to `stop` (mm) or beyond them, periods repeated, without one mirrored."""
        if self.quantity == "friction_spectrum":
            allowed = (
                "heights or friction over x; `friction_profile`, or --friction-mean and --friction-rms, "
            )
            raise InputError("texture", f"{self.name}, a spectrum", f"{allowed}make some of a spectrum")
        x, values, period = self._repeated()
        first = int(np.floor((start - x[0]) / period))
        last = int(np.floor((stop - x[0]) / period)) + 1
        if (last - first + 1) * x.size > MOST_ROWS * 10:
            raise InputError("stop", f"{stop - start:g} mm", f"at most {MOST_ROWS * 10} rows")
        everywhere = np.concatenate([x + k * period for k in range(first, last + 1)])
        again = np.tile(values, last + 1 - first)
        before = max(int(np.searchsorted(everywhere, start + 1e-9, side="right")) - 1, 0)
        kept = slice(before, int(np.searchsorted(everywhere, stop - 1e-9)) + 1)
        return everywhere[kept], again[kept]

    def _repeated(self) -> tuple[Floats, Floats, float]:
        """Rows of what repeats, and its period."""
        if self.period is not None:
            return self.x, self.values, self.period
        back = self.x[-1] + np.cumsum(np.diff(self.x)[::-1])[:-1]
        x, values = np.concatenate([self.x, back]), np.concatenate([self.values, self.values[-2:0:-1]])
        return x, values, 2.0 * float(self.x[-1] - self.x[0])


def write(texture: Texture, path: str | Path) -> tuple[Path, Path]:
    """Write a `.json` and its `.csv`, or both into a folder (a path without ending).

    The `.json` is written last: without it there is no texture; an earlier texture stays whole until both
    are on the disk. Returns both paths. Raises InputError if the `.csv` was not written by evfem, such as
    a measurement of the same name, and StorageError when the disk refuses.

    >>> wave = Texture("wave", "drawn", [0.0, 1.0], [0.0, 0.01], "CC0-1.0", period=2.0)
    >>> [path.name for path in write(wave, "wave.json")], read("wave.json").period
    (['wave.json', 'wave.csv'], 2.0)
    """
    path = Path(path)
    if path.suffix not in ("", ".json"):
        raise InputError("path", str(path), "a file called .json, or a folder")
    if path.suffix == "":
        with disk(f"use {path}"):
            path.mkdir(parents=True, exist_ok=True)
        path = path / NAME
    data = path.with_suffix(".csv")
    if data.exists() and not is_data(data):
        problem = f"{path}, whose rows would replace {data.name}, which is no texture's"
        raise InputError("path", problem, f"another name, as {path.stem}-texture.json")
    header, units = QUANTITIES[texture.quantity]
    rows = zip(texture.x.tolist(), texture.values.tolist(), strict=True)
    document: dict[str, Any] = {"format": FORMAT, "data": data.name}
    document["units"] = dict(zip(header, units, strict=True))
    document = {key: document[key] if key in document else getattr(texture, key) for key in KEYS}
    with replacing(path) as head, replacing(data) as table:
        table.write_text(csv_text([header, *rows]), encoding="utf-8", newline="\n")
        head.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8", newline="\n")
    return path, data


def read(path: str | Path) -> Texture:
    """The texture in a `.json` with its `.csv`, or in a folder with both; InputError for anything else."""
    path = Path(path)
    path = path / NAME if path.is_dir() else path
    table = _table(path)
    if set(table) != set(KEYS) or table["format"] != FORMAT:
        odd = sorted(set(table) ^ set(KEYS)) or [f"format {describe_value(table['format'])}"]
        raise InputError("texture", f"{path}: {', '.join(odd)[:80]}", f"exactly the keys {', '.join(KEYS)}")
    quantity = choice("quantity", table["quantity"], tuple(QUANTITIES))
    header, units = QUANTITIES[quantity]
    if table["units"] != dict(zip(header, units, strict=True)):
        raise InputError(
            "units", describe_value(table["units"]), f"{', '.join(units)} for {', '.join(header)}"
        )
    data = table["data"]
    if not isinstance(data, str) or Path(data).name != data or not data.endswith(".csv"):
        raise InputError("data", describe_value(data), "the name of a csv file beside the .json")
    x, values = read_columns(path.with_name(data), dict(zip(header, units, strict=True)), "data")
    names = ("name", "kind", "licence", "quantity", "period", "provenance")
    found = Texture(x=x, values=values, **{name: table[name] for name in names})
    length = real("length", table["length"], "the length of the rows in mm")
    if abs(length - found.length) > 1e-6 * max(found.length, 1.0):
        raise InputError("length", describe_value(table["length"]), f"that of the rows, {found.length:g} mm")
    return found


def is_texture(path: Path) -> bool:
    """Whether a `.json` says that it is a texture."""
    with suppress(InputError):
        return _table(path).get("format") == FORMAT
    return False


def is_data(path: Path) -> bool:
    """Whether a `.csv` has the rows of the texture beside it."""
    with suppress(InputError):
        return _table(path.with_suffix(".json")).get("data") == path.name
    return False


def spared(key: str, path: Path) -> None:
    """InputError for a `.csv` that has the rows of the texture beside it."""
    if is_data(path):
        raise InputError(key, f"{path}, which has the rows of a texture", "another file")


def _table(path: Path) -> Mapping[str, Any]:
    allowed = "a readable texture: a .json beside its .csv, or a folder with both"
    data = read_bytes(path, "texture", allowed, MOST_BYTES, f"at most {MOST_BYTES} bytes")
    try:
        table = json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        raise InputError("texture", f"{path}, which is no JSON", allowed) from None
    if not isinstance(table, dict):
        raise InputError("texture", f"{path}, whose JSON is no object", allowed)
    return table


def _text(key: str, value: object) -> None:
    if not isinstance(value, str) or not value.strip() or len(value) > MOST_LETTERS or "\n" in value:
        raise InputError(key, describe_value(value), f"a line of 1 to {MOST_LETTERS} letters")


def _check(texture: Texture) -> None:
    """InputError for rows that do not fit, or beyond what a texture may have."""
    x, values, quantity = texture.x, texture.values, texture.quantity
    if x.size != values.size or not 2 <= x.size <= MOST_ROWS:
        problem = f"{x.size} and {values.size} numbers"
        raise InputError("x", problem, f"2 to {MOST_ROWS} rows of two numbers")
    falls = np.flatnonzero(np.diff(x) < 1e-9)
    if falls.size:
        n = int(falls[0])
        raise InputError("x", f"{x[n]:g}, then {x[n + 1]:g} (rows {n + 1}, {n + 2})", "rising numbers")
    if np.abs(x).max() > LONGEST:
        raise InputError("x", f"{x[np.argmax(np.abs(x))]:g}", f"numbers within {LONGEST:g}")
    low, high = ENDS[quantity]
    if values.min() < low or values.max() > high:
        wrong = values[int(np.argmax(np.maximum(low - values, values - high)))]
        raise InputError(quantity, f"{wrong:g}", f"values from {low:g} to {high:g}, lengths in mm")
    if quantity == "friction_spectrum" and x[0] <= 0.0:
        raise InputError("frequency", f"{x[0]:g}", "spatial frequencies in 1/mm above zero")

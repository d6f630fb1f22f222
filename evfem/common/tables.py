"""Tables of numbers: csv files in and out, and piecewise linear functions that may jump."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError, quoted, unknown

#: most rows of a csv file, and most bytes of one
MOST_ROWS, MOST_BYTES = 1_000_000, 200_000_000
#: unit -> the one that is meant without a word, and the number of these
UNITS: Mapping[str, tuple[str, float]] = {
    name: (base, size)
    for base, sizes in {
        "mm": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "μm": 1e-3, "nm": 1e-6, "cm": 10.0, "m": 1e3},
        "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
        "V": {"V": 1.0, "kV": 1e3},
        "N": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
        "N/mm": {"N/mm": 1.0},
        "mm2": {"mm2": 1.0},
        "MPa": {"MPa": 1.0, "kPa": 1e-3, "Pa": 1e-6},
    }.items()
    for name, size in sizes.items()
}
#: name of a column -> what it is in
IN = {"time": "s", "voltage": "V", **dict.fromkeys(("x", "y", "z", "height", "position"), "mm")}


def piecewise_linear(position: Floats, value: Floats, x: Any) -> Floats:
    """Value at x of rows (position, value): linear between them, constant beyond the ends; position must
    not decrease.

    At a repeated position the later row holds from there on. Only the real part of x counts.

    >>> piecewise_linear(np.array([0.0, 1.0, 1.0]), np.array([0.0, 4.0, 9.0]), [-1.0, 0.5, 1.0, 2.0]).tolist()
    [0.0, 2.0, 9.0, 9.0]
    """
    x = np.real(x)
    after = np.searchsorted(position, x, side="right")
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(position) - 1)
    length = np.where(position[right] > position[left], position[right] - position[left], 1.0)
    return value[left] + (value[right] - value[left]) * (x - position[left]) / length


def piecewise_slope(position: Floats, value: Floats, x: Any) -> Floats:
    """Slope at x of the same rows: 0 beyond the ends, jumps left out, on a row that of the piece behind it.

    >>> piecewise_slope(np.array([0.0, 1.0, 1.0]), np.array([0.0, 4.0, 9.0]), [-1.0, 0.5, 1.0, 2.0]).tolist()
    [0.0, 4.0, 0.0, 0.0]
    """
    after = np.searchsorted(position, np.real(x), side="right")
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(position) - 1)
    rises = position[right] > position[left]
    return np.where(rises, value[right] - value[left], 0.0) / np.where(
        rises, position[right] - position[left], 1.0
    )


def numbers(key: str, entry: Any, allowed: str, axes: int = 1) -> Floats:
    """`entry` as a new array of finite floats with that many axes, or `InputError`.

    >>> numbers("x", [1, float("nan")], "lengths")
    Traceback (most recent call last):
    evfem.errors.InputError: x: given a value that is not finite, number 2; allowed: lengths
    """
    try:
        array = np.array(entry)
    except ValueError:  # rows of unequal length
        raise InputError(key, quoted(entry), allowed) from None
    if array.dtype.kind not in "iuf" or array.ndim != axes:
        raise InputError(key, quoted(entry), allowed)
    if not np.isfinite(array).all():
        index = ", ".join(str(i + 1) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(key, f"a value that is not finite, number {index}", allowed)
    return array.astype(float)


def gridded(key: str, x: Floats, z: Floats, value: Floats) -> tuple[Floats, Floats, Floats]:
    """Rising x and z, and values (rows z, columns x), of rows in any order; no pair may be missing."""
    xs, zs = np.unique(x), np.unique(z)
    order = np.lexsort((x, z))
    full = len(xs) * len(zs) == len(x) and min(len(xs), len(zs)) > 1
    if not full or (x[order].reshape(len(zs), -1) != xs).any():
        problem = f"{len(x)} rows of {len(xs)} x and {len(zs)} z"
        raise InputError(key, problem, "one row for every pair of at least two x and two z")
    return xs, zs, value[order].reshape(len(zs), len(xs))


def frame(columns: Mapping[str, Any]) -> Any:
    """Columns of equal length as a `pandas.DataFrame`, without pandas as a numpy record array."""
    if find_spec("pandas") is not None:
        from pandas import DataFrame

        return DataFrame(columns)
    names: Any = list(columns)
    return np.rec.fromarrays([np.asarray(values) for values in columns.values()], names=names)


def dataset(variables: Mapping[str, Any], coordinates: Mapping[str, Any], attributes: Any) -> Any:
    """An `xarray.Dataset`; InputError where xarray is not installed."""
    try:
        from xarray import Dataset
    except ModuleNotFoundError as error:
        problem = f"a data set of xarray, and no {error.name}"
        raise InputError("to_xarray", problem, "pip install 'evfem[xarray]', or table()") from None
    return Dataset(variables, coordinates, attributes)


def aligned(lines: Sequence[Sequence[str]]) -> str:
    """Lines of cells as text, the first column to the left, the others to the right.

    >>> print(aligned([["a", "b"], ["long", "1"], ["c", "-10"]]))
    a       b
    long    1
    c     -10
    """
    first, *others = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join([line[0].ljust(first), *map(str.rjust, line[1:], others)]) for line in lines)


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as lines of a csv file: floats with every digit that counts, nothing for None.

    >>> csv_text([["x", "label"], [0.1, "a, b"], [None, "c"]])
    'x,label\\n0.1,"a, b"\\n,c\\n'
    """
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue()


def csv_rows(path: Path, key: str, allowed: str) -> list[list[str]]:
    """The lines of a csv file, the names first, then as many values in each; InputError for others."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            names, *body = [row for row in csv.reader(lines, strict=True) if row] or [[]]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(key, f"{path.name} ({reason})", allowed) from None
    odd = [row for row in body if len(row) != len(names)]
    if odd or len(set(names)) < len(names):
        reason = f"{','.join(odd[0])[:60]!r}" if odd else "a name twice"
        raise InputError(key, f"{path.name} with {','.join(names)[:60]!r}, then {reason}", allowed)
    if len(body) > MOST_ROWS:
        raise InputError(key, f"{path.name} with more rows", f"at most {MOST_ROWS} rows")
    return [names, *body]


def read_table(path: Path, key: str) -> dict[str, Any]:
    """Columns of a csv file by the names in its first line: arrays of numbers, or lists of words."""
    allowed = "a readable csv file: names in the first line, as many values in each other line"
    names, *body = csv_rows(path, key, allowed)
    if not body:
        raise InputError(key, f"{path.name} with {','.join(names)[:60]!r}, then no line of values", allowed)
    columns = zip(names, zip(*body, strict=True), strict=True)
    return {name.strip(): words_or_numbers(map(str.strip, column)) for name, column in columns}


@dataclass(frozen=True, eq=False)
class Headed:
    """Columns, NaN for gaps, with names and units; `commas`: whether numbers had decimal commas."""

    names: list[str]
    units: list[str | None]
    columns: list[Floats]
    commas: bool

    @property
    def start(self) -> str:
        """Its header in words."""
        bare = self.names == [str(i) for i in range(1, len(self.names) + 1)]
        return "has no header" if bare else f"starts with {','.join(self.names)[:60]!r}"

    def column(self, key: str, entry: int | str, bases: Collection[str | None]) -> Floats:
        """A column by its name or its number from 1, in one of the units `bases`."""
        called = [*self.names, *map(str, range(1, len(self.names) + 1))]
        if (name := str(entry).lower()) not in called:
            raise unknown(key, str(entry), called, f"{quoted(entry)}, which is no column")
        i = called.index(name) % len(self.names)
        unit = self.units[i]
        base, factor = (None, 1.0) if unit is None else UNITS.get(unit, (unit, 1.0))
        if unit is not None and base not in bases:
            rule = " | ".join(name for name, (base, _) in UNITS.items() if base in bases) or "no unit"
            raise InputError(key, f"{self.names[i]} in {unit}", rule)
        return self.columns[i] if factor == 1.0 else self.columns[i] * factor


def read_columns(path: Path, header: list[str], key: str) -> list[Floats]:
    """Columns of a text with exactly the names `header` and a number everywhere, in mm, s and V."""
    allowed = f"a readable csv file with the header {','.join(header)}"
    if path.suffix == ".json":
        allowed += f"; the rows of a texture stand in {path.stem}.csv"
    table = read_headed(path, key, allowed, gaps=False)
    if table.names != header:
        raise InputError(
            key, f"{path.name}, which {table.start}", f"{allowed}, or {' [UNIT],'.join(header)} [UNIT]"
        )
    return [table.column(f"{key}.{name}", name, (IN.get(name),)) for name in header]


#: a cell of a line of units
UNIT = re.compile(r"[\[(]?([cµμunm]?m|[mu]?s|[mk]?N|N/mm|mm2|k?V|[kM]?Pa|g|m/s\^?2|1/mm|1|-|)[\])]?")
#: name and unit in a header: x [mm], x (mm), x/mm, "x, mm", x_mm, x mm
NAMED = re.compile(r"(.+?)\s*(?:\[(.*)\]|\((.*)\)|[/,]\s*([^/,]+)|_([µμunm]?m|[mu]?s)|\s([µμunm]?m|[mk]?N))?")


def read_headed(
    path: Path, key: str, allowed: str = "a text file with columns of numbers below a header",
    gaps: bool = True,
) -> Headed:  # fmt: skip
    """Columns of a text file as instruments write it: below a header, with commas, semicolons, tabs or
    blanks between them, units beside the names or in a line of their own, UTF-8, Latin-1, or UTF-16 with
    its mark. Without a header columns are called 1, 2, ...

    The header is the last line above the numbers that has as many columns, with or without a # before
    it; other lines that begin with # or % are left out. Raises `InputError` with `key` for anything
    else, and for missing numbers without `gaps`.
    """
    text = enumerate(_text(path, key, allowed).split("\n"), 1)
    lines = [(n, stripped) for n, line in text if (stripped := line.strip(" \r"))]
    plain = [(n, line) for n, line in lines if line[0] not in "#%"]
    found = (_numbers(_cells(line, _separator(line))) for _, line in plain)
    first = next((i for i, row in enumerate(found) if len(row) > 1 and np.isfinite(row).any()), None)
    if first is None:
        start = lines[0][1][:40] if lines else ""
        raise InputError(key, f"{path.name} without a line of numbers (it starts with {start!r})", allowed)
    rows, separator = plain[first:], _separator(plain[first][1])
    if len(rows) > MOST_ROWS:
        raise InputError(key, f"{path.name} with more rows", f"at most {MOST_ROWS} rows")
    width = len(_cells(rows[0][1], separator))
    above = [_cells(line.lstrip("#% "), separator) for n, line in lines if n < rows[0][0]]
    heads = [cells for cells in above if len(cells) == width] or above
    parts = [_named(cell) for cell in heads[-1]] if heads else []
    if len(heads) > 1 and len(heads[-2]) == len(parts) and all(map(UNIT.fullmatch, heads[-1])):
        parts = [(name.lower(), unit.strip("[]()")) for name, unit in zip(*heads[-2:], strict=True)]
    parts = parts or [(str(i), None) for i in range(1, width + 1)]
    while len(parts) > 1 and not parts[-1][0]:  # a separator at the end of the header
        parts.pop()
    width = len(parts)
    values = []
    for number, line in rows:
        row = _numbers(_cells(line, separator))
        while len(row) > width and math.isnan(row[-1]):  # separators at the end of a line
            row.pop()
        if len(row) != width or not (gaps or all(map(math.isfinite, row))):
            rule = f"{width} {'' if gaps else 'finite '}numbers on each line"
            raise InputError(key, f"{path.name}, line {number}: {line[:60]!r}", rule)
        values.append(row)
    commas = separator != "," and any("," in line for _, line in rows)
    return Headed([name for name, _ in parts], [unit for _, unit in parts], list(np.array(values).T), commas)


def read_bytes(path: Path, key: str, allowed: str, most: int, limit: str) -> bytes:
    """A file of at most `most` bytes, which `limit` says; `InputError` for another or an unreadable one."""
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
    except OSError as error:
        raise InputError(key, f"{path.name} ({error.strerror or error})", allowed) from None
    if len(data) > most:
        raise InputError(key, f"{path.name}, which is too long", limit)
    return data


def _text(path: Path, key: str, allowed: str) -> str:
    data = read_bytes(path, key, allowed, MOST_BYTES, f"at most {MOST_BYTES // 10**6} MB")
    codings = ("utf-16",) if data.startswith((b"\xff\xfe", b"\xfe\xff")) else ("utf-8-sig", "latin-1")
    for coding in codings:
        with suppress(UnicodeDecodeError):
            if "\0" not in (text := data.decode(coding)):
                return text
    raise InputError(key, f"{path.name} (not a text file)", allowed)


def is_even(x: Floats) -> bool:
    """Whether places are evenly spaced, to a tenth of a step, as they are when they were rounded."""
    step = (x[-1] - x[0]) / max(x.size - 1, 1)
    return bool(step > 0.0 and np.abs(x - np.linspace(x[0], x[-1], x.size)).max() <= 0.1 * step)


def _separator(line: str) -> str | None:
    return next((one for one in "\t;," if one in line), None)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return re.sub(r"\s+(?=[\[(])", "", line).split()
    try:
        (cells,) = csv.reader([line], delimiter=separator)
    except (csv.Error, ValueError):  # a carriage return within, or nothing
        cells = line.split(separator)
    return [cell.strip() for cell in cells]


def _numbers(cells: list[str]) -> list[float]:
    """Numbers of a line, NaN for gaps; none where one is something else."""
    try:
        values = [float(cell.replace(",", ".") or "nan") for cell in cells]
    except ValueError:
        return []
    return [] if any(map(math.isinf, values)) else values


def _named(cell: str) -> tuple[str, str | None]:
    found = NAMED.fullmatch(cell)
    name, *units = found.groups() if found else (cell, None)
    return name.lower(), next((unit.strip() for unit in units if unit), None)


def words_or_numbers(words: Iterable[str]) -> Any:
    """A column of a table: an array of numbers, or a list of words."""
    words = list(words)
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        return words

"""Tables of numbers: csv files in and out, and piecewise linear functions that may jump."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common import units
from evfem.common.arrays import Floats
from evfem.common.foreign import BOOKS, cells_of
from evfem.common.units import cells_in, decimal_comma, first_row, numbers_in, separator_of, trimmed
from evfem.errors import InputError, describe_value, unknown

#: endings of tables
TABLES = (".csv", *BOOKS)
#: most rows of a csv file, and most bytes of one
MOST_ROWS, MOST_BYTES = 1_000_000, 200_000_000
#: bytes that are read of a file to know its header
BEGINNING = 65_536


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
        raise InputError(key, describe_value(entry), allowed) from None
    if array.dtype.kind not in "iuf" or array.ndim != axes:
        raise InputError(key, describe_value(entry), allowed)
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
    """An `xarray.Dataset`, its words as objects: zarr warns of numpy's texts of fixed length, which its third
    format does not specify. InputError where xarray is not installed.
    """
    try:
        from xarray import Dataset
    except ModuleNotFoundError as error:
        problem = f"a data set of xarray, and no {error.name}"
        raise InputError("to_xarray", problem, "pip install 'evfem[xarray]', or table()") from None
    found = Dataset(variables, coordinates, attributes)
    words = {name: one.astype(object) for name, one in found.variables.items() if one.dtype.kind == "U"}
    return found.assign(words) if words else found


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
        if path.suffix.lower() in BOOKS:
            names, *body = cells_of(path, key, allowed)
        else:
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
    """Columns, NaN for gaps, with their `heads`; `commas`: whether numbers had decimal commas."""

    heads: list[units.Head]
    columns: list[Floats]
    commas: bool

    @property
    def names(self) -> list[str]:
        """The names."""
        return [one.name for one in self.heads]

    @property
    def units(self) -> list[str | None]:
        """The units, None for none."""
        return [one.unit for one in self.heads]

    @property
    def start(self) -> str:
        """Its header in words."""
        bare = self.names == [str(i) for i in range(1, len(self.names) + 1)]
        return "has no header" if bare else f"starts with {','.join(self.names)[:60]!r}"

    def index(self, key: str, entry: int | str) -> int:
        """The place of a column that is called by its name, its whole cell or its number from 1."""
        numbers = [str(i) for i in range(1, len(self.names) + 1)]
        name = str(entry).lower()
        if name in numbers:
            return int(name) - 1
        found = [i for i, one in enumerate(self.heads) if name in (one.name, one.cell.lower())]
        found = found or [i for i, one in enumerate(self.heads) if name == one.above]
        if not found:
            raise unknown(
                key, str(entry), [*self.names, *numbers], f"{describe_value(entry)}, which is no column"
            )
        if len(found) > 1:
            which = " | ".join(str(i + 1) for i in found)
            raise InputError(
                key, f"{describe_value(entry)}, the name of {len(found)} columns", f"one by number: {which}"
            )
        return found[0]

    def column(
        self, key: str, entry: int | str, bases: Collection[str | None], factor: float | None = None,
        more: str = "", like: int | str | None = None,
    ) -> Floats:  # fmt: skip
        """A column in one of the units `bases`, or `factor` times it where that is given; without a unit of
        its own it has that of the column `like`. A message about its unit ends with `more`.
        """
        i = self.index(key, entry)
        name, unit = self._called(i, entry)
        if unit is None and like is not None:
            unit = self.unit(key, like)
        size = units.factor(key, name, unit, bases, more) if factor is None else factor
        with np.errstate(over="ignore"):  # infinite ones are refused
            return self.columns[i] if size == 1.0 else self.columns[i] * size

    def base(self, key: str, entry: int | str) -> str | None:
        """The unit that a column, whose own is known, is given in."""
        return units.UNITS.get(self.unit(key, entry) or "", (None,))[0]

    def unit(self, key: str, entry: int | str) -> str | None:
        """The unit that stands with a column, None for none."""
        return self._called(self.index(key, entry), entry)[1]

    def _called(self, i: int, entry: int | str) -> tuple[str, str | None]:
        """Name and unit of a column; below another text a cell is a name where it is called by it."""
        cell, name, unit, above = self.heads[i]
        called = str(entry).lower() in (cell.lower(), name)
        if unit is None and above and not (called and units.named_unit(above)[1] is None):
            return above, cell
        return name, unit


def read_columns(path: Path, header: Mapping[str, str], key: str) -> list[Floats]:
    """Columns of a text with exactly the names `header`, which has their units, and a number everywhere; of a
    file of MATLAB, whose variables have no order, those among others.
    """
    allowed = f"a readable csv file with the header {','.join(header)}"
    if path.suffix == ".json":
        allowed += f"; the rows of a texture stand in {path.stem}.csv"
    table = read_headed(path, key, allowed, gaps=False)
    loose = path.suffix.lower() == ".mat" and {*header} <= {*table.names}
    if table.names != [*header] and not loose:
        told = ",".join(name if unit == "1" else f"{name} [{unit}]" for name, unit in header.items())
        raise InputError(key, f"{path.name}, which {table.start}", f"{allowed}, or {told}")
    return [table.column(f"{key}.{name}", name, (unit,)) for name, unit in header.items()]


def read_headed(
    path: Path, key: str, allowed: str = "columns of numbers below a header, in a text file, .xlsx or .mat",
    gaps: bool = True, used: Mapping[str, int | str] | None = None,
) -> Headed:  # fmt: skip
    """Columns of a text file (or a workbook, or a file of MATLAB: `evfem.common.foreign`) as instruments
    write it: below a header, with commas, semicolons, tabs or blanks between them, units beside the names
    or in a line of their own, UTF-8, Latin-1, or UTF-16 with its mark. Without a header columns are called
    1, 2, ...

    The header is the last line above the numbers that has as many columns, with or without a # before
    it; other lines that begin with # or % are left out. Raises `InputError` with `key` for anything
    else, and for missing numbers without `gaps`. Where only some columns are `used` (key of a message: name
    or number), others may hold anything, are NaN, and have no say in what a comma is.
    """
    lines = _lines(_text(path, key, allowed))
    first, parts = _header(lines)
    if first == len(lines):
        start = lines[0][1][:40] if lines else ""
        raise InputError(key, f"{path.name} without a line of numbers (it starts with {start!r})", allowed)
    rows = [(number, line) for number, line in lines[first:] if line[0] not in "#%"]
    if len(rows) > MOST_ROWS:
        raise InputError(key, f"{path.name} with more rows", f"at most {MOST_ROWS} rows")
    head = Headed(parts, [], False)
    places = {head.index(*one) for one in used.items()} if used is not None else set(range(len(parts)))
    return _filled(head, rows, sorted(places), gaps, path.name, key)


def _filled(
    head: Headed, rows: list[tuple[int, str]], places: list[int], gaps: bool, name: str, key: str
) -> Headed:
    """A table with the numbers of `rows` (number and text of a line) in the columns `places`."""
    separator, width = separator_of(rows[0][1]), len(head.heads)
    lines = [cells_in(line, separator) for _, line in rows]
    lines = [cells if len(cells) <= width else cells[:width] + trimmed(cells[width:]) for cells in lines]
    whole = [[cells[i] for i in places] if len(cells) == width else [] for cells in lines]
    comma = decimal_comma([cell for cells in whole for cell in cells], separator)
    columns = np.full((width, len(rows)), math.nan)
    for j, cells in enumerate(whole):
        row = numbers_in(cells, comma)
        if not row or not (gaps or all(map(math.isfinite, row))):
            rule = f"{width} {'' if gaps else 'finite '}numbers on each line"
            if len(places) < width:
                which = " and ".join(str(i + 1) for i in places)
                rule = f"{width} columns on each line, numbers in {which}"
            raise InputError(key, f"{name}, line {rows[j][0]}: {rows[j][1][:60]!r}", rule)
        columns[places, j] = row
    return replace(head, columns=list(columns), commas=comma)


def names_of(path: Path) -> list[str]:
    """Names of the columns of a text, by its first lines; none where it cannot be read."""
    with suppress(OSError, InputError), path.open("rb") as file:
        book = path.suffix.lower() in BOOKS
        start = _text(path, "", "") if book else _decoded(file.read(BEGINNING)) or ""
        return [one.name for one in _header(_lines(start))[1]]
    return []


def _lines(text: str) -> list[tuple[int, str]]:
    """The lines of a text that are not empty, and their numbers."""
    return [(n, plain) for n, line in enumerate(text.split("\n"), 1) if (plain := line.strip(" \r"))]


def _header(lines: list[tuple[int, str]]) -> tuple[int, list[units.Head]]:
    """Which line is the first one of numbers, and the heads of the columns above."""
    first = first_row(lines)
    if first == len(lines):
        return first, []
    separator = separator_of(lines[first][1])
    row = cells_in(lines[first][1], separator)
    above = [trimmed(cells_in(one.lstrip("#% "), separator)) for _, one in lines[:first]]
    widths = {len(cells) for cells in above}
    width = next((one for one in (len(row), len(trimmed(row))) if one in widths), None)
    heads = above if width is None else [cells for cells in above if len(cells) == width]
    parts = units.header(heads) or [units.Head(str(i), str(i), None) for i in range(1, len(row) + 1)]
    last = max((i for i, cells in enumerate(above) if len(cells) == width), default=first)
    for cells, (_, line) in zip(above[last + 1 :], lines[last + 1 :], strict=False):
        sign = units.says_units(cells) if line[0] in "#%" else any(map(units.is_text, cells))
        if sign and len(cells) < len(parts):
            parts = units.below(parts, cells)
    return first, parts


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
    if path.suffix.lower() in BOOKS:
        return "\n".join("\t".join(row).replace('"', "") for row in cells_of(path, key, allowed))
    text = _decoded(read_bytes(path, key, allowed, MOST_BYTES, f"at most {MOST_BYTES // 10**6} MB"))
    if text is None:
        raise InputError(key, f"{path.name} (not a text file)", allowed)
    return text


def _decoded(data: bytes) -> str | None:
    """The text, None of what is none."""
    codings = ("utf-16",) if data.startswith((b"\xff\xfe", b"\xfe\xff")) else ("utf-8-sig", "latin-1")
    for coding in codings:
        with suppress(UnicodeDecodeError):
            if "\0" not in (text := data.decode(coding)):
                return text
    return None


def is_even(x: Floats) -> bool:
    """Whether places are evenly spaced, to a tenth of a step, as they are when they were rounded."""
    step = (x[-1] - x[0]) / max(x.size - 1, 1)
    return bool(step > 0.0 and np.abs(x - np.linspace(x[0], x[-1], x.size)).max() <= 0.1 * step)


def words_or_numbers(words: Iterable[str]) -> Any:
    """A column of a table: an array of numbers, or a list of words."""
    words = list(words)
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        return words

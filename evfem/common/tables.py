"""Tables of numbers: csv files in and out, and piecewise linear functions that may jump."""

from __future__ import annotations

import csv
import io
import math
import re
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError, quoted

#: most rows of a csv file
MOST_ROWS = 1_000_000


def piecewise_linear(place: Floats, value: Floats, x: Any) -> Floats:
    """Value at x of rows (place, value): linear between them, constant beyond the ends; place must
    not decrease.

    At a repeated place the later row holds from that place on. Only the real part of x counts.

    >>> piecewise_linear(np.array([0.0, 1.0, 1.0]), np.array([0.0, 4.0, 9.0]), [-1.0, 0.5, 1.0, 2.0]).tolist()
    [0.0, 2.0, 9.0, 9.0]
    """
    x = np.real(x)
    after = np.searchsorted(place, x, side="right")
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(place) - 1)
    length = np.where(place[right] > place[left], place[right] - place[left], 1.0)
    return value[left] + (value[right] - value[left]) * (x - place[left]) / length


def piecewise_slope(place: Floats, value: Floats, x: Any) -> Floats:
    """Slope at x of the same rows: 0 beyond the ends, jumps left out, on a row that of the piece behind it.

    >>> piecewise_slope(np.array([0.0, 1.0, 1.0]), np.array([0.0, 4.0, 9.0]), [-1.0, 0.5, 1.0, 2.0]).tolist()
    [0.0, 4.0, 0.0, 0.0]
    """
    after = np.searchsorted(place, np.real(x), side="right")
    left, right = np.maximum(after - 1, 0), np.minimum(after, len(place) - 1)
    rises = place[right] > place[left]
    return np.where(rises, value[right] - value[left], 0.0) / np.where(rises, place[right] - place[left], 1.0)


def numbers(key: str, given: Any, allowed: str, axes: int = 1) -> Floats:
    """`given` as a new array of finite floats with that many axes, or `InputError`.

    >>> numbers("x", [1, float("nan")], "lengths")
    Traceback (most recent call last):
    evfem.errors.InputError: x: given a value that is not finite, number 2; allowed: lengths
    """
    try:
        array = np.array(given)
    except ValueError:  # rows of unequal length
        raise InputError(key, quoted(given), allowed) from None
    if array.dtype.kind not in "iuf" or array.ndim != axes:
        raise InputError(key, quoted(given), allowed)
    if not np.isfinite(array).all():
        place = ", ".join(str(i + 1) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(key, f"a value that is not finite, number {place}", allowed)
    return array.astype(float)


def frame(columns: Mapping[str, Any]) -> Any:
    """Columns of equal length as a `pandas.DataFrame`, without pandas as a numpy record array."""
    if find_spec("pandas") is not None:
        from pandas import DataFrame

        return DataFrame(columns)
    arrays = {name: np.asarray(values) for name, values in columns.items()}
    length = len(next(iter(arrays.values())))
    records = np.recarray(length, [(name, values.dtype) for name, values in arrays.items()])
    for name, values in arrays.items():
        records[name] = values
    return records


def csv_text(rows: Iterable[Iterable[Any]]) -> str:
    """Rows as lines of a csv file: floats with every digit that counts, nothing for None.

    >>> csv_text([["x", "label"], [0.1, "a, b"], [None, "c"]])
    'x,label\\n0.1,"a, b"\\n,c\\n'
    """
    buffer = io.StringIO()
    csv.writer(buffer, lineterminator="\n").writerows(rows)
    return buffer.getvalue()


def read_columns(path: Path, header: list[str], key: str) -> list[Floats]:
    """Columns of a csv file whose first line is `header` and whose other lines hold one number per column.

    Raises `InputError` with `key` for a file that cannot be read or has anything else in it, or
    more than `MOST_ROWS` rows.
    """
    allowed = f"a readable csv file with the header {','.join(header)}"
    columns = [array("d") for _ in header]
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            rows = ((n, [cell.strip() for cell in row]) for n, row in enumerate(csv.reader(lines), 1) if row)
            _, first = next(rows, (0, []))
            if first != header:
                raise InputError(key, f"{path}, which starts with {','.join(first)[:60]!r}", allowed)
            for number, cells in rows:
                row = _row(cells, f"{path}, line {number}", len(header), key)
                if len(columns[0]) == MOST_ROWS:
                    raise InputError(key, f"{path} with more rows", f"at most {MOST_ROWS} rows")
                for column, value in zip(columns, row, strict=True):
                    column.append(value)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(key, f"{path} ({reason})", allowed) from None
    return [np.array(column) for column in columns]


def read_table(path: Path, key: str) -> dict[str, Any]:
    """All columns of a csv file by the names in its first line: arrays of numbers, or lists of words.

    Raises `InputError` with `key` for a file that cannot be read, has nothing below its first
    line, a name twice, or lines of another length.
    """
    allowed = "a readable csv file: names in the first line, as many values in each other line"
    try:
        with path.open(newline="", encoding="utf-8-sig") as lines:
            rows = [[cell.strip() for cell in row] for row in csv.reader(lines) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(key, f"{path} ({reason})", allowed) from None
    names, *body = rows or [[]]
    odd = [row for row in body if len(row) != len(names)]
    if odd or not body or len(set(names)) < len(names):
        reason = f"{','.join(odd[0])[:60]!r}" if odd else "no line of values" if not body else "a name twice"
        raise InputError(key, f"{path} with {','.join(names)[:60]!r}, then {reason}", allowed)
    if len(body) > MOST_ROWS:
        raise InputError(key, f"{path} with more rows", f"at most {MOST_ROWS} rows")
    return {
        name: _words_or_numbers(column) for name, column in zip(names, zip(*body, strict=True), strict=True)
    }


@dataclass(frozen=True, eq=False)
class Headed:
    """Columns of numbers, NaN where one is missing, with the names and units of their header: small
    letters, and None where no unit is said. `commas`: whether numbers had decimal commas.
    """

    names: list[str]
    units: list[str | None]
    columns: list[Floats]
    commas: bool


#: name and unit in a header: x [mm], x (mm), x/mm, "x, mm", x_mm
NAMED = re.compile(r"(.+?)\s*(?:\[(.*)\]|\((.*)\)|[/,]\s*([^/,]+)|_([µμunm]?m|[mu]?s))?")


def read_headed(path: Path, key: str) -> Headed:
    """Columns of a text file as instruments write it: below a header, with commas, semicolons, tabs or
    blanks between them, units beside the names or in a line of their own, UTF-8 or Latin-1.

    What stands above the header is left out. Raises `InputError` with `key` for anything else.
    """
    allowed = "a text file with columns of numbers below a header"
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(key, f"{path} ({error.strerror or error})", allowed) from None
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = [(n, line.strip(" \r")) for n, line in enumerate(text.split("\n"), 1) if line.strip()]
    first = next((i for i, (_, line) in enumerate(lines) if _numeric(_cells(line, _separator(line)))), None)
    if not first or "\0" in text:
        raise InputError(key, f"{path}, which starts with {text[:40]!r}", allowed)
    separator = _separator(lines[first][1])
    above = [_cells(line, separator) for _, line in lines[:first]]
    width = len(_cells(lines[first][1], separator))
    if len(above[-1]) != width or len(lines) - first > MOST_ROWS:
        given = f"{path}, {len(lines) - first} rows of {width} columns below {','.join(above[-1])[:60]!r}"
        raise InputError(key, given, f"{allowed}, at most {MOST_ROWS}, with a name for each column")
    values = []
    for number, line in lines[first:]:
        row = _cells(line, separator)
        if len(row) != width or not _numeric(row, gaps=True):
            raise InputError(key, f"{path}, line {number}: {line[:60]!r}", f"{width} numbers on each line")
        values.append([_real(cell) for cell in row])
    parts = [_named(cell) for cell in above[-1]]
    if len(above) > 1 and len(above[-2]) == width and all(_is_unit(cell) for cell in above[-1]):
        parts = [(name.lower(), unit.strip("[]()")) for name, unit in zip(*above[-2:], strict=True)]
    commas = separator != "," and any("," in line for _, line in lines[first:])
    return Headed([name for name, _ in parts], [unit for _, unit in parts], list(np.array(values).T), commas)


def _separator(line: str) -> str | None:
    return next((one for one in "\t;," if one in line), None)


def _cells(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return re.sub(r"\s+(?=[\[(])", "", line).split()
    (cells,) = csv.reader([line], delimiter=separator)
    return [cell.strip() for cell in cells]


def _numeric(cells: list[str], gaps: bool = False) -> bool:
    try:
        return all(gaps or math.isfinite(value) for value in map(_real, cells)) and (gaps or len(cells) > 1)
    except ValueError:
        return False


def _real(cell: str) -> float:
    value = float(cell.replace(",", ".") or "nan")
    if math.isinf(value):
        raise ValueError(cell)
    return value


def _named(cell: str) -> tuple[str, str | None]:
    found = NAMED.fullmatch(cell)
    name, *units = found.groups() if found else (cell, None)
    return name.lower(), next((unit.strip() for unit in units if unit), None)


def _is_unit(cell: str) -> bool:
    return re.fullmatch(r"[\[(]?([cµμunm]?m|[mu]?s|m?N|g|m/s\^?2|1/mm|1|-|)[\])]?", cell) is not None


def _words_or_numbers(words: Iterable[str]) -> Any:
    words = list(words)
    try:
        return np.array([float(word) for word in words])
    except ValueError:
        return words


def _row(cells: list[str], place: str, columns: int, key: str) -> list[float]:
    try:
        row = [float(cell) for cell in cells] if len(cells) == columns else []
    except ValueError:
        row = []
    if not row or not all(map(math.isfinite, row)):
        given = ",".join(cells)[:60]
        raise InputError(key, f"{place}: {given!r}", f"{columns} finite numbers on each line")
    return row

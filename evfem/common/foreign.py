"""Files of other programs that are no text: grey values of pictures, cells of Excel's and MATLAB's tables.

Pillow's own way to grey, `convert("L")`, has 8 bits: it clips what has more, and every number above
255 becomes white. openpyxl takes the number of rows that is written in the head of a sheet for true,
unless it is told not to, and knows values of formulas only where the writer has stored them.
"""

from __future__ import annotations

import itertools
import math
import struct
import warnings
import zlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError

#: largest file in bytes
MOST_BYTES = 64_000_000
#: endings of tables that are no text, and how many rows of one are read
BOOKS, MOST_ROWS = (".xlsx", ".xlsm", ".mat"), 1_000_001
#: bytes of numbers and texts that a file may declare: what nobody wrote, or is alike, takes no room in it
MOST_DECLARED = 10**9
#: types of parts of a file of MATLAB: of numbers and letters, of parts, and compressed
PLAIN, MATRIX, COMPRESSED = frozenset((*range(1, 8), 9, 12, 13, 16, 17, 18)), 14, 15
#: tag of TIFF that says whether 0 is white
PHOTOMETRIC = 262


class TooLong(ValueError):
    """Longer than is read."""


def check_declared(sizes: Iterable[int]) -> None:
    """Raise `TooLong` for parts of these sizes (bytes) that together are longer than is read."""
    declared = sum(sizes)
    if declared > MOST_DECLARED:
        raise TooLong(f"it declares {declared / 1e9:.3g} GB of numbers or texts; 1 GB is read")


def read_grey(
    path: Path, key: str, allowed: str, most_pixels: int, formats: tuple[str, ...] | None = None
) -> tuple[Floats, str]:
    """Grey values (rows, columns) from 0, black, to 1, white; NaN where a picture is transparent; and a
    sentence about the numbers in the file.

    Integers of 8 and 16 bits are shares of their largest; floats and longer integers have no white
    of their own: their smallest is black, their largest white. Colours become grey by their luma
    (ITU-R BT.601), of which Pillow reads 8 bits. Raises InputError with `key` and `allowed`.
    """
    from PIL import Image

    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(key, f"{path.name}, which is too long", allowed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow tells of tags that it skips
            with Image.open(path, formats=formats) as image:
                if image.width * image.height > most_pixels or min(image.size) < 1:
                    raise InputError(key, f"{path.name}, {image.width} x {image.height} pixels", allowed)
                values, white = _values(image)
    except InputError:
        raise
    except Exception as error:  # whatever the many decoders raise for a damaged file
        reason = getattr(error, "strerror", None) or "cut off, damaged or of another kind"
        raise InputError(key, f"{path.name} ({reason})", allowed) from None
    known = values[np.isfinite(values)]
    if not known.size:
        raise InputError(key, f"{path.name}, in which nothing is to be seen", allowed)
    low, high = float(known.min()), float(known.max())
    if white is None:
        told = f"Grey values {low:.6g} to {high:.6g}: black and white, as such numbers have no others."
        return (values - low) / (high - low or 1.0), told
    return values / white, f"Grey values {low:g} to {high:g} of {white:g}."


def _values(image: object) -> tuple[Floats, float | None]:
    """Stored values, NaN for transparent pixels, and the value of white, None if unknown."""
    from PIL import Image, ImageOps

    assert isinstance(image, Image.Image)
    inverted = getattr(image, "tag_v2", {}).get(PHOTOMETRIC) == 0
    upright = ImageOps.exif_transpose(image)
    if upright.mode.startswith("I;16") or (upright.mode == "I" and image.format in ("PNG", "PPM")):
        values, white = np.asarray(upright).astype(float), 65535.0
        return (white - values if inverted else values), white
    if upright.mode in ("I", "F"):
        values = np.asarray(upright).astype(float)
        values[~np.isfinite(values)] = np.nan
        return (-values if inverted else values), None
    values = np.asarray(upright.convert("L")).astype(float)
    if upright.has_transparency_data:
        values[np.asarray(upright.convert("RGBA").getchannel("A")) == 0] = np.nan
    return values, 255.0


def cells_of(path: Path, key: str, allowed: str) -> list[list[str]]:
    """Rows of cells, as text: of the sheet of a workbook that has numbers, or of the vectors of one length,
    below their names, in a file of MATLAB (up to version 7.2).

    Raises InputError with `key`, also for several sheets with numbers, and where openpyxl is not installed.
    """
    try:
        if path.stat().st_size > MOST_BYTES:
            raise InputError(key, f"{path.name}, which is too long", allowed)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _matlab(path, key) if path.suffix.lower() == ".mat" else _workbook(path, key)
    except InputError:
        raise
    except ModuleNotFoundError as error:
        raise InputError(key, path.name, f"pip install {error.name}, which reads it, or a csv file") from None
    except TooLong as error:
        raise InputError(key, f"{path.name} ({error})", allowed) from None
    except NotImplementedError:  # MATLAB's version 7.3
        problem, rule = f"{path.name}, of version 7.3", 'save("-v7", ...) in MATLAB, or a csv file'
        raise InputError(key, problem, rule) from None
    except Exception as error:  # whatever the decoders raise for a damaged file
        reason = getattr(error, "strerror", None) or "damaged or of another kind"
        raise InputError(key, f"{path.name} ({reason})", allowed) from None


def _workbook(path: Path, key: str) -> list[list[str]]:
    from zipfile import ZipFile

    from openpyxl import load_workbook

    with ZipFile(path) as parts:
        check_declared(one.file_size for one in parts.infolist())
    book, found = load_workbook(path, read_only=True, data_only=True), {}
    try:
        for sheet in book.worksheets:
            sheet.reset_dimensions()
            rows = [
                row
                for row in itertools.islice(sheet.iter_rows(values_only=True), MOST_ROWS)
                if any(map(_said, row))
            ]
            if any(isinstance(cell, (int, float)) for row in rows for cell in row):
                found[sheet.title] = rows
    finally:
        book.close()
    if len(found) != 1:
        sheets = f"{len(found)} sheets with numbers ({', '.join(found)})"[:80] if found else "no numbers"
        rule = "one sheet of numbers, or of formulas with the values that Excel stores; or a csv file"
        raise InputError(key, f"{path.name} with {sheets}", rule)
    (rows,) = found.values()
    width = max(map(len, rows))
    return [[*map(_said, row), *[""] * (width - len(row))] for row in rows]


def _said(cell: Any) -> str:
    """A cell as text, on one line."""
    if cell is None:
        return ""
    return (
        " ".join(str(cell).split())
        if isinstance(cell, str)
        else repr(cell)
        if isinstance(cell, (int, float))
        else str(cell)
    )


def _matlab(path: Path, key: str) -> list[list[str]]:
    from scipy.io import loadmat, whosmat

    check_declared(8 * math.prod(shape) for _, shape, _ in whosmat(path))
    _check_types(path.read_bytes())
    arrays: dict[str, Any] = {}
    for name, array in _arrays(loadmat(path, simplify_cells=True)):
        if name in arrays and array.dtype.kind in "iuf" and array.size > 1:
            rule = "one struct, or names of their own: save the run that is meant alone"
            raise InputError(key, f"{path.name} with two variables {name}", rule)
        arrays.setdefault(name, array)
    numbers = {name: array for name, array in arrays.items() if array.dtype.kind in "iuf" and array.size > 1}
    vectors = {name: array for name, array in numbers.items() if array.ndim == 1}
    lengths = [len(array) for array in vectors.values()]
    most = max(lengths, key=lambda length: (lengths.count(length), length), default=0)
    columns = {name: array for name, array in vectors.items() if len(array) == most}
    columns = dict(sorted(columns.items(), key=lambda one: not one[0].lower().startswith("time")))
    tables = {name: array for name, array in numbers.items() if array.ndim == 2}
    if len(columns) < 2 and len(tables) == 1:
        (table,) = tables.values()
        heads = (
            a
            for a in arrays.values()
            if a.shape == table.shape[1:] and all(isinstance(one, str) for one in a)
        )
        names = [str(name) for name in next(heads, ())]
        return [*([names] if names else []), *([repr(x) for x in row] for row in table.tolist())]
    if len(columns) < 2:
        rule = (
            "vectors of one length, in variables or a struct (of a table: table2struct(T, ToScalar=true)), "
        )
        raise InputError(
            key, f"{path.name} with {len(columns)} vectors and {len(tables)} matrices", f"{rule}or one matrix"
        )
    rows = zip(*(array.tolist() for array in columns.values()), strict=True)
    return [[*columns], *([repr(x) for x in row] for row in rows)]


def _check_types(data: bytes) -> None:
    """ValueError for a part of a type that is none of MATLAB's format (version 5), before scipy reads it."""
    if 0 in data[:4]:  # version 4
        return
    order = "<" if data[126:128] == b"IM" else ">"
    waiting = [*_parts(data[128:], order)]
    while waiting:
        kind, body = waiting.pop()
        if kind == MATRIX:
            waiting += _parts(body, order)
        elif kind == COMPRESSED:
            waiting += _parts(zlib.decompressobj().decompress(body, MOST_DECLARED), order)
        elif kind not in PLAIN:
            raise ValueError(f"a part of type {kind}")


def _parts(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and bytes of each part; up to 4 bytes stand within its head."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, at)
        short = kind >> 16
        start = at + (4 if short else 8)
        kind, size = (kind & 0xFFFF, short) if short else (kind, size)
        yield kind, data[start : start + size]
        at = at + 8 if short else start + size + (-size % 8 if kind != COMPRESSED else 0)


def _arrays(found: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Variables, and the fields of structs."""
    for name, value in found.items():
        if isinstance(value, Mapping):
            yield from _arrays(value)
        elif isinstance(value, np.ndarray) and not name.startswith("__"):
            yield name, value

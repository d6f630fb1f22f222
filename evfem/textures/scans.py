"""Scans that SurfaceTopography (1.27) does not read: `.x3p` with heights as text, profiles and lists of
points (ISO 25178-72, the schema `iso5436_2.xsd` of the openGPS library), and `.tmd` with other comments.

In an x3p all lengths are in metres, x runs fastest, an empty height is a missing point, and a height is its
number times the increment of the axis plus its offset. In a tmd they are in mm, heights follow row by row.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError
from evfem.textures.importing import line_of

if TYPE_CHECKING:
    import zipfile

#: bytes of a part of an x3p, and of a tmd; of XML, which takes ten times the memory
MOST_BYTES, MOST_XML = 512_000_000, 64_000_000
#: types of numbers in an x3p
TYPES = {"I": "<i2", "L": "<i4", "F": "<f4", "D": "<f8"}
#: of a tmd: what it begins with, 32 bytes with zeros, before a comment that ends with one
TMD = b"Binary TrueMap Data File v2.0"

#: x and heights (n,) in mm, and which line they are; () for what SurfaceTopography reads
Line = tuple[Floats, Floats, str] | tuple[()]


def line_in(path: Path, row: float) -> Line:
    """The line `row` (0 to 1) of a scan along x. Raises `InputError` for a damaged file."""
    with path.open("rb") as file:
        start = file.read(len(TMD))
    if start != TMD and path.suffix.lower() != ".x3p":
        return ()
    with _damaged(path):
        return _tmd(path.read_bytes()[:MOST_BYTES], row) if start == TMD else _x3p(path, row)


@contextmanager
def _damaged(path: Path) -> Iterator[None]:
    try:
        yield
    except InputError:
        raise
    except Exception:  # whatever zip, zlib, XML and numpy raise for a damaged file
        raise InputError("file", f"{path.name}, damaged or of another kind", "a whole scan") from None


def _of_grid(step: float, heights: Floats, row: float) -> Line:
    """A line of heights (rows, columns) in mm."""
    line = round(row * (len(heights) - 1))
    x = (np.arange(heights.shape[1]) + 0.5) * step
    return x.astype(np.float64), np.asarray(heights[line]), f"Line {line + 1} of {len(heights)} along x."


def _tmd(data: bytes, row: float) -> Line:
    end = data.index(b"\0", 32) + 1
    columns, rows, width, *_ = struct.unpack_from("<IIffff", data, end)
    heights = np.frombuffer(data, "<f4", rows * columns, end + 24).reshape(rows, columns)
    with np.errstate(invalid="ignore"):  # numbers that signal that they are none
        return _of_grid(width / columns, heights.astype(np.float64), row)


def _x3p(path: Path, row: float) -> Line:
    from xml.etree import ElementTree
    from zipfile import ZipFile

    with ZipFile(path) as parts:
        main = _part(parts, "main.xml", MOST_XML)
        if b"<!DOCTYPE" in main or b"<!ENTITY" in main:
            raise ValueError("a document type")
        tree = ElementTree.fromstring(main)
        kind, text = tree.findtext("Record1/FeatureType"), tree.find("Record3/DataList")
        if kind == "SUR" and text is None:
            return ()
        scales = [_scale(tree, axis) for axis in ("CX", "CY", "CZ")]
        if text is not None:
            numbers = [(one.text or "").split(";") for one in text.findall("Datum")]
        else:
            numbers = [[one] for one in _linked(parts, tree)]
    heights = np.array([float(one[-1] or "nan") for one in numbers]) * scales[2][0] + scales[2][1]
    absolute = tree.findtext("Record1/Axes/CX/AxisType") == "A"
    if kind == "PCL" or (kind == "PRF" and absolute):
        points = np.array(
            [[float(x) * size for x, (size, _) in zip(one[:2], scales, strict=False)] for one in numbers]
        )
        (x, height), note = line_of(path, 1e3 * np.vstack([points.T, heights]), row)
        return x, height, note
    columns, rows = (int(tree.findtext(f"Record3/MatrixDimension/Size{n}", "")) for n in "XY")
    if tree.findtext("Record1/Axes/CX/AxisType") != "I":
        raise ValueError("x that are no steps")
    return _of_grid(1e3 * scales[0][0], 1e3 * heights.reshape(rows, columns), row)


def _scale(tree: Any, axis: str) -> tuple[float, float]:
    """What the numbers of an axis are multiplied with, and what is added."""
    of = f"Record1/Axes/{axis}/"
    return float(tree.findtext(f"{of}Increment") or 1.0), float(tree.findtext(f"{of}Offset") or 0.0)


def _linked(parts: zipfile.ZipFile, tree: Any) -> list[str]:
    """Heights of a profile in a part of its own, "" for points that are not valid."""
    link = "Record3/DataLink/"
    kind = TYPES[tree.findtext("Record1/Axes/CZ/DataType")]
    found = np.frombuffer(_part(parts, tree.findtext(f"{link}PointDataLink")), kind).tolist()
    valid = tree.findtext(f"{link}ValidPointsLink")
    if valid is None:
        return [repr(one) for one in found]
    bits = np.unpackbits(np.frombuffer(_part(parts, valid), np.uint8), bitorder="little").tolist()
    return [repr(one) if bit else "" for one, bit in zip(found, bits, strict=False)]


def _part(parts: zipfile.ZipFile, name: str, most: int = MOST_BYTES) -> bytes:
    if parts.getinfo(name).file_size > most:
        raise ValueError("a part that is too long")
    with parts.open(name) as file:
        return file.read(most)

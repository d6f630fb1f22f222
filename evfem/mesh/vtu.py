"""Reads .vtu files: XML with numbers as text, or in binary, inline or appended, plain or
compressed.

Format: "VTK File Formats", https://docs.vtk.org/en/latest/design_documents/VTKFileFormats.html.
One piece; zlib and LZMA; both byte orders. Document types, and with them entities, are refused.
"""

from __future__ import annotations

import base64
import binascii
import lzma
import re
import zlib
from collections.abc import Mapping
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np

from evfem.common.arrays import Ints
from evfem.mesh.formats import LARGEST, MOST_ELEMENTS, Parts, Unreadable, integers, parsed
from evfem.mesh.mesh import CELLS

TYPES: Mapping[str, str] = {
    f"{name}{bits}": f"{code}{bits // 8}"
    for name, code in (("Int", "i"), ("UInt", "u"), ("Float", "f"))
    for bits in (8, 16, 32, 64)
    if name != "Float" or bits >= 32
}
#: VTK's numbers of the kinds of cells
KINDS: Mapping[int, str] = {kind.vtk: name for name, kind in CELLS.items()}
APPENDED = re.compile(rb"<AppendedData\b[^>]*>\s*_")
Element = ElementTree.Element


def read(content: bytes) -> Parts:
    """The parts of a .vtu file; raises `Unreadable`."""
    tree, appended = _split(content)
    if b"<!DOCTYPE" in tree or b"\0" in tree:
        raise Unreadable("a document type, or no UTF-8 text")
    if max(tree.count(b"<"), tree.count(b"=")) > 2 * MOST_ELEMENTS:
        raise Unreadable(f"more than {MOST_ELEMENTS} elements")
    try:
        root = ElementTree.fromstring(tree)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise Unreadable(f"no XML: {error}") from error
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise Unreadable("no unstructured grid of VTK")
    return _Reader(root, appended).parts()


def _split(content: bytes) -> tuple[bytes, bytes]:
    """The XML, and what is appended to it, which may be binary."""
    start = APPENDED.search(content)
    end = content.rfind(b"</AppendedData>")
    if start is None or end < start.end():
        return content, b""
    return content[: start.end()] + content[end:], content[start.end() : end]


class _Reader:
    """Decodes the arrays of one file; `left` bytes may still come out of it."""

    def __init__(self, root: Element, appended: bytes) -> None:
        self.root, self.appended = root, appended
        self.order: Literal["<", ">"] = ">" if root.get("byte_order") == "BigEndian" else "<"
        self.header = np.dtype(
            self.order + {"UInt32": "u4", "UInt64": "u8"}[_one_of(root, "header_type", HEADERS)]
        )
        self.compressor = _one_of(root, "compressor", COMPRESSORS)
        self.left = LARGEST

    def parts(self) -> Parts:
        grid = _only(self.root, "UnstructuredGrid")
        piece = _only(grid, "Piece")
        nodes, cells = (_count(piece, f"NumberOf{name}") for name in ("Points", "Cells"))
        points = self.array(_only(_only(piece, "Points"), "DataArray")).astype(float).ravel()
        if points.size != 3 * nodes:
            raise Unreadable(f"{points.size} coordinates of {nodes} points")
        kinds, blocks = self._blocks(_only(piece, "Cells"), cells)
        parts = Parts(points.reshape(nodes, 3), blocks)
        for name, values in self._data(piece, "PointData", nodes).items():
            parts.point_data[name] = values
        for name, values in self._data(piece, "CellData", cells).items():
            parts.cell_data[name] = [values[where] for where in kinds]
        for array in grid.iterfind("FieldData/DataArray"):
            parts.field_data[array.get("Name", "")] = self.array(array)
        return parts

    def _data(self, piece: Element, tag: str, size: int) -> dict[str, np.ndarray]:
        found = {}
        for element in piece.iterfind(f"{tag}/DataArray"):
            values, name = self.array(element), element.get("Name", "")
            if len(values) != size:
                raise Unreadable(f"{len(values)} values of {name} for {size}")
            found[name] = values
        return found

    def _blocks(self, element: Element, cells: int) -> tuple[list[Ints], list[tuple[str, Ints]]]:
        """Which cells are of each kind, and their nodes."""
        arrays = {a.get("Name", ""): a for a in element.iterfind("DataArray")}
        if not {"connectivity", "offsets", "types"} <= set(arrays):
            raise Unreadable("cells without connectivity, offsets or types")
        nodes, ends, types = (
            integers(self.array(arrays[name]).ravel()) for name in ("connectivity", "offsets", "types")
        )
        if len(ends) != cells or len(types) != cells:
            raise Unreadable(f"{len(ends)} offsets and {len(types)} types of {cells} cells")
        starts = np.concatenate([[0], ends[:-1]]).astype(np.int64)
        numbers, first = np.unique(types, return_index=True)
        where, blocks = [], []
        for number in numbers[np.argsort(first)].tolist():
            if number not in KINDS:
                raise Unreadable(f"cells of VTK's type {number}")
            chosen, n = np.flatnonzero(types == number), CELLS[KINDS[number]].nodes
            begin = starts[chosen]
            if (ends[chosen] - begin != n).any() or (begin < 0).any() or (ends[chosen] > nodes.size).any():
                raise Unreadable(f"offsets that do not fit cells of {n} nodes")
            where.append(chosen)
            blocks.append((KINDS[number], nodes[begin[:, None] + np.arange(n)]))
        return where, blocks

    def array(self, element: Element) -> np.ndarray:
        """The numbers of a DataArray, (n,) or (n, components)."""
        dtype = np.dtype(TYPES[_one_of(element, "type", tuple(TYPES))])
        form = element.get("format", "ascii")
        if form == "ascii":
            values = parsed(element.text or "", dtype)
        elif form == "binary":
            values = self._bytes((element.text or "").strip().encode("ascii", "replace"), 0, False, dtype)
        elif form == "appended":
            raw = self.root.find("AppendedData")
            is_raw = raw is not None and raw.get("encoding") == "raw"
            values = self._bytes(self.appended, _count(element, "offset"), is_raw, dtype)
        else:
            raise Unreadable(f"data in the format {form[:40]}")
        columns = element.get("NumberOfComponents")
        if not columns or columns == "1":
            return values
        width = _count(element, "NumberOfComponents")
        if width == 0 or values.size % width:
            raise Unreadable(f"{values.size} values in rows of {width}")
        return values.reshape(-1, width)

    def _bytes(self, text: bytes, at: int, is_raw: bool, dtype: np.dtype[Any]) -> np.ndarray:
        stream = _Raw(text, at) if is_raw else _Base64(text, at)
        data = self._plain(stream) if self.compressor == "none" else self._inflated(stream)
        if len(data) % dtype.itemsize:
            raise Unreadable("an array that ends within a number")
        return np.frombuffer(data, dtype.newbyteorder(self.order)).astype(dtype)

    def _numbers(self, data: bytes, count: int) -> list[int]:
        return [int(n) for n in np.frombuffer(data, self.header, count)]

    def _plain(self, stream: _Raw | _Base64) -> bytes:
        size = self.header.itemsize
        (length,) = self._numbers(stream.peek(size), 1)
        self._charge(length)
        return stream.after(size, length)

    def _charge(self, length: int) -> None:
        """Count what is decoded: arrays may share a place in the file, or be compressed."""
        self.left -= length
        if self.left < 0:
            raise Unreadable(f"more than {LARGEST // 2**20} MB of content")

    def _inflated(self, stream: _Raw | _Base64) -> bytes:
        size = self.header.itemsize
        (count,) = self._numbers(stream.peek(size), 1)
        if count == 0:
            return b""
        self._charge((3 + count) * size)
        sizes = self._numbers(stream.take((3 + count) * size), 3 + count)
        block, last, packed = sizes[1], sizes[2] or sizes[1], sizes[3:]
        self._charge((count - 1) * block + last + sum(packed))
        data, at, pieces = stream.take(sum(packed)), 0, []
        for k, length in enumerate(packed):
            pieces.append(
                _inflate(self.compressor, data[at : at + length], last if k + 1 == count else block)
            )
            at += length
        return b"".join(pieces)


HEADERS = ("UInt32", "UInt64")
COMPRESSORS = ("none", "vtkZLibDataCompressor", "vtkLZMADataCompressor")


class _Raw:
    """Bytes as they are."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at

    def peek(self, size: int) -> bytes:
        return _whole(self.data[self.at : self.at + size], size)

    def take(self, size: int) -> bytes:
        data = self.peek(size)
        self.at += size
        return data

    def after(self, header: int, length: int) -> bytes:
        """What follows the header in the same piece."""
        return self.take(header + length)[header:]


class _Base64:
    """Bytes in base64, in pieces that are padded one by one."""

    def __init__(self, text: bytes, at: int) -> None:
        self.text, self.at = text, at

    def peek(self, size: int) -> bytes:
        return self._decoded(size)[0]

    def take(self, size: int) -> bytes:
        data, self.at = self._decoded(size)
        return data

    def after(self, header: int, length: int) -> bytes:
        """What follows the header, which may be in the same piece or in one of its own."""
        if b"=" in self.text[self.at : self.at + -(-header // 3) * 4]:
            self.take(header)
            return self.take(length)
        return self.take(header + length)[header:]

    def _decoded(self, size: int) -> tuple[bytes, int]:
        end = self.at + -(-size // 3) * 4
        try:
            data = base64.b64decode(self.text[self.at : end], validate=True)
        except (binascii.Error, ValueError) as error:
            raise Unreadable(f"no base64: {error}") from error
        return _whole(data[:size], size), end


def _whole(data: bytes, size: int) -> bytes:
    if len(data) != size:
        raise Unreadable("an array that is cut off")
    return data


def _inflate(compressor: str, data: bytes, size: int) -> bytes:
    """A block of `size` bytes, inflated no further than that."""
    if size == 0:  # which would mean no limit
        return b""
    try:
        if compressor == "vtkZLibDataCompressor":
            return _whole(zlib.decompressobj().decompress(data, size), size)
        return _whole(lzma.LZMADecompressor(memlimit=LARGEST).decompress(data, size), size)
    except (zlib.error, lzma.LZMAError, EOFError) as error:
        raise Unreadable(f"damaged compression: {error}") from error


def _only(parent: Element, tag: str) -> Element:
    found = parent.findall(tag)
    if len(found) != 1:
        raise Unreadable(f"{len(found)} elements {tag} instead of one")
    return found[0]


def _count(element: Element, name: str) -> int:
    text = element.get(name, "").strip()
    if not (text.isascii() and text.isdigit() and len(text) < 16):
        raise Unreadable(f"{name} = {text[:40]!r}")
    return int(text)


def _one_of(element: Element, name: str, known: tuple[str, ...]) -> str:
    value = element.get(name, known[0])
    if value not in known:
        raise Unreadable(f"{name} = {value[:40]!r}")
    return value

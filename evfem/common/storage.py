"""Atomic writes: a file is written under a temporary name and then moved to its path in one step.

This holds when the process is killed at any moment and when the disk is full; nothing is forced
through the disk's own cache, so a power failure may cost the last steps. Text that grows with a run is
added to its file line by line (`GrowingText`). `alone_in` keeps other processes out of a folder.
"""

from __future__ import annotations

import errno
import json
import math
import os
import tempfile
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import evfem
from evfem.common.notices import LOG
from evfem.errors import InputError, StorageError

#: largest archive that is read, in bytes, and the most arrays in it
LARGEST_ARCHIVE, MOST_ARRAYS = 4 * 2**30, 10_000
#: endings that say what is in a file
FORMATS = (
    *(".csv", ".h5", ".hdf5", ".json", ".mat", ".msh", ".npy", ".npz", ".parquet", ".pdf", ".pkl", ".png"),
    *(".pvd", ".svg", ".toml", ".tsv", ".txt", ".vtk", ".vtu", ".xls", ".xlsx"),
)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path in the folder of `path`; the file written there replaces `path` at the end.

    On an error inside the block nothing changes. Raises StorageError when the disk or folder refuses.

    >>> with replacing("numbers.txt") as temporary:
    ...     _ = temporary.write_text("1 2 3")
    >>> Path("numbers.txt").read_text()
    '1 2 3'
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    with disk(f"write {target}"):
        try:
            yield temporary
            os.replace(temporary, target)
        except BaseException:  # Ctrl-C too leaves nothing behind
            with suppress(OSError):
                temporary.unlink()
            raise


def check_ending(path: str | Path, own: str, instead: str = "") -> None:
    """InputError for a path whose ending is that of another format than `own`; `instead` says what
    writes that.

    >>> check_ending("a.csv", ".npz", "to_csv writes that")
    Traceback (most recent call last):
    evfem.errors.InputError: path: given a.csv; allowed: a name that ends in .npz: to_csv writes that
    """
    ending = Path(path).suffix.lower()
    if ending in FORMATS and ending != own:
        raise InputError("path", str(path), f"a name that ends in {own}{f': {instead}' if instead else ''}")


def write_text(path: str | Path, text: str) -> None:
    """Write `text` to `path` in one step (UTF-8)."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


@dataclass
class GrowingText:
    """A text file that grows by lines at its end, so that a line costs the same however many there are.

    It is written whole, in one step, where it is not as it was left: at first, under another `head`, and
    where somebody else has changed its size. A line that the disk refuses is taken back; of a line in which
    a kill came a part may stay, which is beyond `size` (bytes), and `check` is the checksum of so many.
    """

    path: Path
    head: str = field(default="", init=False)
    lines: int = field(default=0, init=False)
    size: int = field(default=-1, init=False)
    check: int = field(default=0, init=False)

    def write(self, head: str, number: int, line: Callable[[int], str]) -> None:
        """The file has `head` and the lines 0 to `number`, ends included; what is there already is kept."""
        with disk(f"write {self.path}"):
            kept = self._kept(head, number)
            first = self.lines if kept else 0
            data = "".join(line(k) for k in range(first, number)).encode()
            if not kept:
                data = head.encode() + data
                with replacing(self.path) as temporary:
                    temporary.write_bytes(data)
            elif data:
                self._append(data)
        self.check = zlib.crc32(data, self.check if kept else 0)
        self.size = len(data) + (self.size if kept else 0)
        self.head, self.lines = head, number

    def _kept(self, head: str, number: int) -> bool:
        if head != self.head or number < self.lines:
            return False
        with suppress(FileNotFoundError):
            return self.path.stat().st_size == self.size
        return False

    def _append(self, data: bytes) -> None:
        try:
            with self.path.open("ab") as file:
                file.write(data)
        except BaseException:
            with suppress(OSError):
                os.truncate(self.path, self.size)
            raise


@contextmanager
def disk(doing: str) -> Iterator[None]:
    """Inside, errors of the disk become StorageError("cannot DOING: reason")."""
    try:
        yield
    except StorageError:
        raise
    except OSError as error:
        reason = "it is a file, not a folder" if error.errno == errno.EEXIST else error.strerror
        raise StorageError(f"cannot {doing}: {reason or error}") from error


@contextmanager
def passing_folder() -> Iterator[Path]:
    """A folder for temporary files, removed at the end; StorageError where the disk refuses, inside too."""
    with disk("use the folder for temporary files"), tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Inside, no other process works in `folder`, which is made, and removed if left empty."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    with disk(f"use {folder}"):
        folder.mkdir(parents=True, exist_ok=True)
        lock = _lock(folder)
    try:
        yield
    finally:
        with suppress(OSError):  # at the first one that is not empty
            for path in made:
                path.rmdir()
        if lock is not None:
            os.close(lock)


def _lock(folder: Path) -> int | None:
    """Descriptor of the folder, locked until it is closed; None, and a notice, where there are no locks."""
    try:
        from fcntl import LOCK_EX, LOCK_NB, flock
    except ModuleNotFoundError:  # Windows
        LOG.info("no locks on this system: start no second run into %s", folder)
        return None
    lock = os.open(folder, os.O_RDONLY)
    try:
        flock(lock, LOCK_EX | LOCK_NB)
    except BlockingIOError as error:
        os.close(lock)
        raise StorageError(f"cannot use {folder}: another run is at work in it") from error
    except OSError as error:  # some disks in a network
        LOG.info("no lock on %s (%s): start no second run into it", folder, error.strerror or error)
    return lock


def names_in(manifest: Path) -> list[str]:
    """The names in such a list; none where there is no list that can be read."""
    with suppress(OSError, UnicodeDecodeError):
        return manifest.read_text(encoding="utf-8").split("\n")
    return []


def refuse_others(manifest: Path, present: Iterable[str], owner: str) -> None:
    """InputError where one of the names `present` in the folder is not in its list."""
    foreign = [name for name in present if name not in names_in(manifest)]
    if foreign:
        given = f"{manifest.parent}, where {foreign[0]} was not written by {owner}"
        raise InputError("--out", given, "another folder, for files of others are never touched")


def save_arrays(path: str | Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays of numbers or text to one .npz file, in one step and without pickled objects."""
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise InputError(name, "an array of Python objects", "numbers or text")
    # older versions of `np.savez` leave the archive open where the disk fills up
    with replacing(path) as temporary, open(temporary, "wb") as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def packed(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays of numbers as two, the bytes of all and their `layout`, for a member of an archive costs more
    than what is in a small one; an array that is there twice, under two names, is kept once.
    """
    layout, parts, at = list[list[Any]](), dict[int, tuple[bytes, int]](), 0
    for name, array in arrays.items():
        if id(array) not in parts:
            parts[id(array)] = array.tobytes(), at
            at += array.nbytes
        layout.append([name, array.dtype.str, array.shape, parts[id(array)][1]])
    data = np.frombuffer(b"".join(part for part, _ in parts.values()), dtype=np.uint8)
    return {"layout": np.array(json.dumps(layout)), "data": data}


def unpacked(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What was `packed`; KeyError, TypeError or ValueError for anything else."""
    found, data = dict[str, np.ndarray](), arrays["data"].tobytes()
    for name, kind, shape, at in json.loads(str(arrays["layout"])):
        dtype = np.dtype(str(kind))
        count = math.prod(shape)
        if dtype.kind not in "biuf" or not all(type(size) is int and size >= 0 for size in (at, *shape)):
            raise ValueError(f"no plain array {name}")
        found[str(name)] = (
            np.frombuffer(data, dtype, count, at).reshape(shape).astype(dtype.newbyteorder("="))
        )
    return found


def begins(path: Path, begin: bytes) -> bool:
    """Whether a file begins with these bytes."""
    with disk(f"read {path.name}"), path.open("rb") as file:
        return file.read(len(begin)) == begin


def format_of(path: str | Path) -> str:
    """What the array `format` of such a file says; nothing where there is none to be read."""
    with suppress(Exception), zipfile.ZipFile(path) as archive:
        return str(_array(archive, archive.getinfo("format.npy")))
    return ""


def load_arrays(path: str | Path, key: str, form: str) -> dict[str, np.ndarray]:
    """All arrays of such a file whose array `format` says `form`.

    Takes no more memory than the file is long, and at most 4 GB: compressed members, objects and
    arrays that are not as long as their headers say are refused. Raises InputError(key, ...) for a
    missing, cut off, damaged or foreign file, StorageError when the disk refuses.
    """
    allowed = f"a file of the format {form}"
    try:
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            if os.fstat(file.fileno()).st_size > LARGEST_ARCHIVE or len(members) > MOST_ARRAYS:
                raise ValueError("too large")
            arrays = {info.filename.removesuffix(".npy"): _array(archive, info) for info in members}
    except FileNotFoundError as error:
        raise InputError(key, f"{path}, which does not exist", allowed) from error
    except Exception as error:  # whatever zipfile and numpy raise for a damaged file
        # EINVAL: a directory of the archive that points outside the file
        if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):
            raise StorageError(f"cannot read {path}: {error.strerror or error}") from error
        raise InputError(key, f"{path}, cut off or of another kind", allowed) from error
    if "format" not in arrays or arrays["format"].ndim or str(arrays["format"]) != form:
        by = f", written by evfem {str(arrays['version'])[:40]!r}" if "version" in arrays else ""
        told = f"{by}, not by {evfem.__version__!r}" if by else ""
        raise InputError(key, f"{path}, of another format{told}", allowed)
    return arrays


def _array(archive: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    """One array, its checksum compared."""
    if info.compress_type != zipfile.ZIP_STORED or info.compress_size != info.file_size:
        raise ValueError("compressed")
    with archive.open(info) as member, warnings.catch_warnings():
        warnings.simplefilter("error")  # of headers that numpy mends
        np.lib.format.read_magic(member)
        shape, by_columns, dtype = np.lib.format.read_array_header_1_0(member)
        data = member.read()
    if dtype.kind not in "biufU" or math.prod(shape) * dtype.itemsize != len(data):
        raise ValueError("no plain array, or not as long as its header says")
    return np.ndarray(shape, dtype, data, order="F" if by_columns else "C").astype(dtype.newbyteorder("="))

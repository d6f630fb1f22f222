"""Files that are either complete or untouched: written beside their place, then moved there in one step."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np

from evfem.errors import InputError, StorageError

#: what reading a cut off, damaged or foreign archive can raise
DAMAGE = (zipfile.BadZipFile, zlib.error, ValueError, TypeError, EOFError, NotImplementedError, MemoryError)


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """A temporary path in the folder of `path`; what was written there takes the place of `path` at the end.

    On an error inside the block nothing changes. Raises StorageError when the disk or folder refuses.

    >>> with replacing("numbers.txt") as temporary:
    ...     _ = temporary.write_text("1 2 3")
    >>> Path("numbers.txt").read_text()
    '1 2 3'
    """
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        os.replace(temporary, target)
    except OSError as error:
        _remove(temporary)
        if isinstance(error, StorageError):
            raise
        raise StorageError(f"cannot write {target}: {error.strerror or error}") from error
    except BaseException:
        _remove(temporary)
        raise


def write_text(path: str | Path, text: str) -> None:
    """Write `text` to `path` in one step (UTF-8)."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="\n")


def save_arrays(path: str | Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write named arrays of numbers or text to one .npz file, in one step and without pickled objects."""
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise InputError(name, "an array of Python objects", "numbers or text")
    with replacing(path) as temporary, open(temporary, "wb") as file, zipfile.ZipFile(file, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, array, allow_pickle=False)


def load_arrays(path: str | Path, key: str, form: str) -> dict[str, np.ndarray]:
    """All arrays of such a file whose array `format` says `form`.

    Raises InputError(key, ...) for a missing, cut off or foreign file, StorageError when the disk refuses.
    """
    allowed = f"a file of the format {form}"
    try:
        with open(path, "rb") as file, zipfile.ZipFile(file) as archive:
            arrays = {name.removesuffix(".npy"): _array(archive, name) for name in archive.namelist()}
    except FileNotFoundError as error:
        raise InputError(key, f"{path}, which does not exist", allowed) from error
    except DAMAGE as error:
        raise InputError(key, f"{path}, cut off or of another kind", allowed) from error
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror or error}") from error
    if "format" not in arrays or str(arrays["format"]) != form:
        raise InputError(key, f"{path}, of another format", allowed)
    return arrays


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray:
    with archive.open(name) as member:
        array = np.lib.format.read_array(member, allow_pickle=False)
        member.read()  # to the end of the member, where its checksum is compared
        return array


def _remove(path: Path) -> None:
    with suppress(OSError):
        path.unlink()

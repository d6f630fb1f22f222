"""A stable fingerprint of plain values: numbers, arrays, dataclasses, files, and the code of user functions.

Equal content has the same fingerprint in every process, so that a checkpoint of another scene can
be told apart.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import CodeType, FunctionType, MethodType

import numpy as np


def digest(value: object) -> str:
    """SHA-256 over the content of `value`, as 64 hexadecimal digits.

    Dataclasses count field by field (but those with `compare=False`), mappings in sorted order, paths by the
    content of the file, functions by their code, defaults and closure, other objects by class and attributes.

    >>> digest({"a": 1.0, "b": (2, 3)}) == digest({"b": (2, 3), "a": 1})
    True
    >>> digest({"a": 1.0}) == digest({"a": 1.0000000000000002})
    False
    """
    total = hashlib.sha256()
    for piece in _pieces(value, ()):
        total.update(len(piece).to_bytes(8, "little") + piece)
    return total.hexdigest()


def file_digest(path: Path) -> str:
    """SHA-256 of a file's bytes; of its name alone when it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return hashlib.sha256(path.name.encode()).hexdigest()


def _pieces(value: object, above: tuple[int, ...]) -> Iterator[bytes]:
    if id(value) in above:  # an object that contains itself
        yield b"cycle"
        return
    inside = (*above, id(value))
    if value is None or isinstance(value, (bool, str, bytes)):
        yield f"{type(value).__name__}:{value!r}".encode()
    elif isinstance(value, np.bool_):
        yield f"bool:{bool(value)!r}".encode()
    elif isinstance(value, (int, float, complex, np.number)):  # equal as they are in Python
        number = complex(value)
        yield repr(number.real if number.imag == 0.0 else number).encode()
    elif isinstance(value, np.ndarray):
        yield f"array:{value.dtype.str}:{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif isinstance(value, Path):
        yield f"file:{file_digest(value)}".encode()
    elif isinstance(value, Mapping):
        yield f"mapping:{len(value)}".encode()
        for key in sorted(value, key=str):
            yield from _pieces(key, inside)
            yield from _pieces(value[key], inside)
    elif isinstance(value, (tuple, list)):
        yield f"sequence:{len(value)}".encode()
        for item in value:
            yield from _pieces(item, inside)
    elif isinstance(value, (set, frozenset)):
        yield f"set:{sorted(digest(item) for item in value)}".encode()
    else:
        yield from _object_pieces(value, inside)


def _object_pieces(value: object, inside: tuple[int, ...]) -> Iterator[bytes]:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        yield f"object:{type(value).__qualname__}".encode()
        for spec in dataclasses.fields(value):
            if spec.compare:
                yield spec.name.encode()
                yield from _pieces(getattr(value, spec.name), inside)
        if not type(value).__module__.startswith("evfem."):
            yield from _class_code(type(value), inside)
    elif isinstance(value, MethodType):
        yield from _pieces(value.__func__, inside)
        yield from _pieces(value.__self__, inside)
    elif isinstance(value, FunctionType):
        yield from _code(value.__code__)
        yield from _pieces(value.__defaults__, inside)
        yield from _pieces([cell.cell_contents for cell in value.__closure__ or ()], inside)
    elif isinstance(value, CodeType):
        yield from _code(value)
    else:
        yield from _class_code(type(value), inside)
        yield from _pieces(getattr(value, "__dict__", {}), inside)


def _class_code(cls: type, inside: tuple[int, ...]) -> Iterator[bytes]:
    """A user's class counts by its name and the functions written in it."""
    yield f"class:{cls.__qualname__}".encode()
    for name, member in sorted(vars(cls).items()):
        if isinstance(member, FunctionType) and not name.startswith("__"):
            yield name.encode()
            yield from _pieces(member, inside)


def _code(code: CodeType) -> Iterator[bytes]:
    """Instructions, names and constants of a function, without file name and line numbers."""
    yield code.co_code
    yield repr(code.co_names).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant)
        else:
            yield f"constant:{constant!r}".encode()

"""Commented scene files to begin with (`evfem init`); they lie in `evfem/data`."""

from __future__ import annotations

from contextlib import ExitStack
from importlib import import_module
from pathlib import Path

import evfem
from evfem.errors import InputError, describe_value

#: template -> the file that its scene needs beside it, and the ready-made mesh that this is
TEMPLATES: dict[str, dict[str, str]] = {
    "display": {},
    "touchscreen": {},
    "texture": {},
    "mesh": {"pad.vtu": "benchmark-L0.vtu"},
    "hover": {},
    "fingertip": {},
}


def text(template: str) -> str:
    """The scene file of a template.

    >>> text("display").splitlines()[3]
    'version = 1'
    """
    if template not in TEMPLATES:
        raise InputError("--template", describe_value(template), " | ".join(TEMPLATES))
    path = Path(evfem.__file__).parent / "data" / f"template-{template}.toml"
    return path.read_text(encoding="utf-8")


def write(template: str, path: Path) -> list[Path]:
    """Write the scene of a template, and what it needs beside it; the files that were written.

    Raises InputError, with nothing written, where one of them exists; StorageError when the disk refuses.
    """
    from evfem.common.storage import replacing

    contents = {path: text(template).encode()}
    contents |= {path.with_name(name): _mesh(mesh) for name, mesh in TEMPLATES[template].items()}
    for file in contents:
        if file.exists():
            raise InputError("FILE", f"{file}, which exists", "a file that is not there yet")
    with ExitStack() as stack:  # all of them are on the disk before one has its name
        for file, content in contents.items():
            stack.enter_context(replacing(file)).write_bytes(content)
    return list(contents)


def _mesh(name: str) -> bytes:
    path: Path = import_module("evfem.meshes").path(name)
    return path.read_bytes()

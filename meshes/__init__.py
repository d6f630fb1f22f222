"""Ready-made finger meshes (`.vtu`, `.msh`) in an open format; the table of names is in the README
beside them.

>>> path("finger-coarse-ridged.vtu").name in names()
True
"""

from __future__ import annotations

from pathlib import Path

from evfem.errors import InputError

FOLDER = Path(__file__).resolve().parent


def names() -> list[str]:
    """Names of the mesh files that come with the package."""
    return sorted(file.name for file in FOLDER.iterdir() if file.suffix in (".vtu", ".msh"))


def path(name: str) -> Path:
    """Where the mesh file `name` lies, for `MeshedFinger` or `meshfile.read`."""
    if name not in names():
        raise InputError("mesh", name, " | ".join(names()))
    return FOLDER / name

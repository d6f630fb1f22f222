"""Sensitivities as a TOML file beside the scene, which names the scene, keys and columns."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from evfem.common.checks import instance
from evfem.errors import InputError
from evfem.scene import file as scenefile
from evfem.scene.keys import VERSION, read
from evfem.scene.scene import Scene


@dataclass(frozen=True)
class SensitivityTable:
    """The whole file."""

    version: Annotated[int, {"allowed": str(VERSION)}, "version of the format"]
    scene: Annotated[str, instance("the path of a scene file", str), "what is differentiated"]
    by: Annotated[
        list[str], instance("a list of dotted keys", list), "keys of the scene, as surface.friction"
    ]
    columns: Annotated[
        list[str] | None, instance("a list of columns", list), "columns of the history; all without it"
    ] = None


def load(path: str | Path) -> tuple[Scene, list[str], list[str] | None]:
    """Scene, keys and columns of such a file, whose paths start beside it; InputError for others."""
    path = Path(path)
    tables = scenefile.tables_of("sensitivities", scenefile.read_text("sensitivities", path))
    if "by" not in tables:
        raise InputError("by", "no keys", f"{path} with by = [KEY, ...], or a scene file and --by KEY ...")
    found = read(SensitivityTable, tables, "")
    return scenefile.load(path.parent / found.scene), found.by, found.columns

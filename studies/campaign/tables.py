"""The tables of a scene file as plain values: their text, and files beside them."""

from __future__ import annotations

import shutil
from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w
from evfem.meshes import FOLDER

from evfem.common.storage import disk, write_text
from evfem.common.tables import csv_text
from evfem.scene.file import loads
from evfem.scene.scene import Scene

Tables = dict[str, Any]


def text_of(tables: Tables) -> str:
    """The scene as TOML, complete in itself."""
    return tomli_w.dumps({key: value for key, value in tables.items() if value != {}})


def scene_of(tables: Tables) -> Scene:
    """The scene; raises InputError if it is none."""
    return loads(text_of(tables), FOLDER)


def with_files(tables: Tables, folder: Path) -> Tables:
    """The same scene with profile and voltage in csv files and its mesh in `folder`, as users have them."""
    tables = deepcopy(tables)
    put_mesh(tables, folder)
    surface, electrostatics = tables["surface"], tables.get("electrostatics", {})
    if "points" in surface:
        write_text(folder / "profile.csv", csv_text([["x", "height"], *surface.pop("points")]))
        surface["file"] = "profile.csv"
    if "voltage_profile" in electrostatics:
        rows = electrostatics.pop("voltage_profile")
        write_text(folder / "voltage.csv", csv_text([["position", "voltage"], *rows]))
        electrostatics["voltage_file"] = "voltage.csv"
    return tables


def put_mesh(tables: Tables, folder: Path) -> None:
    """Put the ready-made mesh of a scene, if it has one, into the folder of its file."""
    if "mesh" in tables["finger"]:
        with disk(f"write {folder}"):
            shutil.copy(FOLDER / tables["finger"]["mesh"], folder)

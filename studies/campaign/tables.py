"""The tables of a scene file as plain values: copies, text, files beside them, and their mirror
image.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import tomli_w
from evfem.meshes import FOLDER

from evfem.common.storage import disk, write_text
from evfem.common.tables import csv_text
from evfem.scene.file import loads
from evfem.scene.scene import Scene
from evfem.surface.textures import SelfAffine

Tables = dict[str, Any]
#: keys of a surface of the kind self_affine alone
ROUGH = ("hurst", "rms", "period", "shortest", "longest", "seed")
#: steps of a motion that does not say how many
USUAL_STEPS = {"press": 10, "slide": 100, "hover": 1, "voltage": 10, "wait": 100}


def copied(tables: Tables) -> Tables:
    """A copy that shares nothing."""
    return deepcopy(tables)


def text_of(tables: Tables) -> str:
    """The scene as TOML, complete in itself."""
    return tomli_w.dumps({key: value for key, value in tables.items() if value != {}})


def scene_of(tables: Tables, name: str = "scene") -> Scene:
    """The scene; raises InputError if it is none."""
    return loads(text_of(tables), FOLDER, name=name)


def with_files(tables: Tables, folder: Path) -> Tables:
    """The same scene with its profile and its voltage in csv files and its mesh in `folder`, as
    users have them.
    """
    tables = copied(tables)
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


def mirrored(tables: Tables) -> Tables:
    """The scene seen in a mirror: x becomes -x in finger, surface, friction, voltage and motion."""
    tables = copied(tables)
    finger, surface = tables["finger"], tables["surface"]
    if "ridge_phase" in finger:
        finger["ridge_phase"] = -finger["ridge_phase"]
    for rows in _along(tables):
        rows[:] = [[-x, value] for x, value in reversed(rows)]
    if surface["kind"] == "self_affine":
        _as_waves(surface)
    if "phase" in surface:
        surface["phase"] = -surface["phase"]
    if surface["kind"] == "sinusoid" and "terms" in surface:
        surface["terms"] = [[a, -k, phase] for a, k, phase in surface["terms"]]
    elif surface["kind"] == "sinusoid":
        surface["terms"] = [[0.025, -6.0, 0.0], [0.05 / 2.0, 12.0, 1.5707963267948966]]
        surface["terms"].append([-0.025, 0.0, 1.5707963267948966])
    for motion in tables["motion"]:
        if "angle" in motion:
            motion["angle"] = float(f"{180.0 - motion['angle']:.9g}")
        elif motion["kind"] == "slide":
            motion["distance"] = -motion["distance"]
    return tables


def _as_waves(surface: Tables) -> None:
    """Roughness as the waves that it is made of: no seed gives its mirror image."""
    own = {name: surface.pop(name) for name in ROUGH if name in surface}
    surface |= {"kind": "sinusoid", "terms": [list(row) for row in SelfAffine(**own).terms]}


def _along(tables: Tables) -> Iterator[list[list[float]]]:
    """Everything that is a table over x."""
    if isinstance(tables["surface"]["friction"], list):
        yield tables["surface"]["friction"]
    if "points" in tables["surface"]:
        yield tables["surface"]["points"]
    if "voltage_profile" in tables.get("electrostatics", {}):
        yield tables["electrostatics"]["voltage_profile"]


def steps_of(motion: Tables) -> int:
    """Requested steps of a motion's table."""
    return motion.get("steps", USUAL_STEPS[motion["kind"]])


def with_half_steps(tables: Tables) -> Tables:
    """The scene with steps half as long."""
    motions = [motion | {"steps": 2 * steps_of(motion)} for motion in tables["motion"]]
    return copied(tables | {"motion": motions})

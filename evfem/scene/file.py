"""Scene files: TOML to `Scene` and back; every mistake is one sentence that names the key in the file.

Relative paths in a file are relative to the file. Limits: a scene of 4 MB and one million steps,
csv files of 64 MB and one million rows, meshes of 128 MB (`evfem.mesh.file`). What is written
(`dump`) is in `evfem.scene.serialiser`, which needs none of this.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from evfem.common.checks import MOST_STEPS
from evfem.electrostatics.laws import FORCE_LAWS
from evfem.errors import ABSENT, InputError, Mistakes, StorageError, unknown
from evfem.finger.fingerpad import FingerPad, MeshedFinger
from evfem.finger.layers import TABLE_2
from evfem.scene.format import (
    HOMES,
    SURFACES,
    BesideFinger,
    BesideSurface,
    Electrostatics,
    Measured,
    SceneTable,
)
from evfem.scene.keys import VERSION, at, check_size, kind_of, names, read, read_kind, shown
from evfem.scene.motion import MOTIONS, Motion
from evfem.scene.scene import DEPTH, Output, Scene, Solver
from evfem.scene.serialiser import dump
from evfem.surface.adhesion import ADHESIONS
from evfem.surface.elastic import ElasticLayer, ElasticStack
from evfem.surface.friction import KINDS as FRICTIONS
from evfem.surface.surfaces import Display
from evfem.terms.hand import Hand

#: largest file in bytes
LARGEST_SCENE = 4 * 2**20

__all__ = ["dump", "load", "loads"]


def load(path: str | Path) -> Scene:
    """The scene in a TOML file, named like the file.

    Raises InputError for whatever cannot be used, StorageError when the disk refuses.
    """
    path = Path(path)
    return loads(read_text("scene", path), path.parent, path.stem)


def scene_at(given: object) -> Scene:
    """A scene itself, or the one in the file at a path."""
    if isinstance(given, Scene):
        return given
    if not isinstance(given, (str, PathLike)):
        raise InputError("scene", given, "a Scene, or the path of a scene file")
    return load(Path(given))


def read_text(key: str, path: Path) -> str:
    """The text of a TOML file; errors call the file `key`."""
    check_size(key, path, LARGEST_SCENE)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(key, f"{path}, which is not UTF-8 text", f"a {key} in TOML") from error
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror or error}") from error


def tables_of(key: str, text: str) -> dict[str, Any]:
    """The tables of a TOML text of our version; errors call the text `key`."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        more = "; each motion is a table [[motion]]" if "'motion'" in str(error) else ""
        more = "; each key once" if "Cannot overwrite a value" in str(error) else more
        raise InputError(key, f"no valid TOML: {error}", f"a {key} in TOML{more}") from error
    if type(version := tables.get("version", ABSENT)) is not int or version != VERSION:
        given = ABSENT if version is ABSENT else shown(version)
        raise InputError("version", given, f"version = {VERSION}")
    return tables


def loads(text: str, folder: str | Path = ".", name: str = "scene") -> Scene:
    """The scene in a TOML text; relative paths in it start at `folder`.

    Mistakes in different tables, or at different keys of one, are reported at once.

    >>> text = "version = 1\\n[surface]\\nkind = 'flat'\\n[[motion]]\\nkind = 'press'\\nforce = 0.05\\n"
    >>> loads(text).motion
    (Press(force=0.05, indentation=None, steps=10, speed=None),)
    """
    top = read(SceneTable, tables_of("scene", text), "", homes=HOMES)
    folder, mistakes = Path(folder), Mistakes()
    parts: dict[str, Any] = {}
    with mistakes.of_a_part():
        parts |= _finger({} if top.finger is None else top.finger, folder)
    of_motions = Mistakes()
    with of_motions.of_a_part():
        parts["motion"] = _motions(top.motion)
    insulated: dict[str, Any] = {}
    with mistakes.of_a_part():
        if top.electrostatics is not None:
            found, law = _electrostatics(top.electrostatics, folder)
            motions = parts.get("motion", ())
            ramped = not motions or any(one.course.largest_voltage is not None for one in motions)
            parts |= found.scene_keys(law, ramped)
            insulated = {"insulator": found.layer(), "electrodes": found.electrodes}
    with mistakes.of_a_part():
        parts |= _surface(top.surface, folder, **insulated)
    mistakes.found += of_motions.found
    for key, cls in (("hand", Hand), ("solver", Solver), ("output", Output)):
        with mistakes.of_a_part():
            if (table := getattr(top, key)) is not None:
                parts[key] = read(cls, table, key, homes=HOMES)
    with mistakes.of_a_part():
        if top.adhesion is not None:
            parts["adhesion"] = read_kind(top.adhesion, "adhesion", ADHESIONS, tag="law", homes=HOMES)
    mistakes.report()
    return Scene(**parts, name=name.translate(dict.fromkeys(map(ord, "\\:\n"), "_")))


def _electrostatics(table: Mapping[str, Any], folder: Path) -> tuple[Electrostatics, Any]:
    """The table, and the force law with those of its keys that are the law's."""
    laws = [cls for name, cls in FORCE_LAWS.items() if name == table.get("law")]
    own = [name for name in names(*laws or FORCE_LAWS.values()) if name not in names(Electrostatics)]
    mistakes, law, found = Mistakes(), None, None
    with mistakes.of_a_part():
        found = read(Electrostatics, table, "electrostatics", folder, beside=own, homes=HOMES)
    for cls in laws:
        with mistakes.of_a_part():
            law = read(cls, {name: table[name] for name in own if name in table}, "electrostatics")
    mistakes.report()
    return found, law


def _motions(tables: list[Any]) -> list[Motion]:
    mistakes, motions = Mistakes(), []
    for i, table in enumerate(tables):
        with mistakes.of_a_part():
            motions.append(read_kind(table, f"motion[{i}]", MOTIONS, homes=HOMES))
    mistakes.report()
    if not motions:
        raise InputError("motion", ABSENT, "one or more tables [[motion]]")
    if (total := sum(one.steps for one in motions)) > MOST_STEPS:
        raise InputError("motion", f"{total} steps in all", f"at most {MOST_STEPS} steps in all")
    return motions


def _surface(
    table: Mapping[str, Any], folder: Path, insulator: Any = None, electrodes: Any = None
) -> dict[str, Any]:
    mistakes, found = Mistakes(), dict[str, Any]()
    with mistakes.of_a_part():
        kind, kinds, more = kind_of(table, "surface", SURFACES), SURFACES, {"insulator": insulator}
        if "elastic" in table:
            more["elastic"] = _elastic(table["elastic"])
        if electrodes is not None and kind != "flat":
            given = f"beside a surface of kind {kind}"
            raise InputError("electrostatics.electrodes", given, "a flat surface")
        if insulator is not None and kind == "flat":
            kinds, more["electrodes"] = {"flat": Display}, electrodes
        beside = names(BesideSurface)
        with at("surface", {"surface.electrodes": "electrostatics.electrodes"}):
            found["surface"] = read_kind(table, "surface", kinds, folder, beside=beside, homes=HOMES, **more)
    with mistakes.of_a_part():
        if "friction_law" in table:
            found["friction_law"] = read_kind(table["friction_law"], "surface.friction_law", FRICTIONS)
    mistakes.report()
    return found


def _elastic(table: Any) -> Any:
    """The layer in a table, or the stack in several."""
    if not isinstance(table, list):
        return read(ElasticLayer, table, "surface.elastic", homes=HOMES)
    mistakes, layers = Mistakes(), []
    for i, one in enumerate(table):
        with mistakes.of_a_part():
            layers.append(read(ElasticLayer, one, f"surface.elastic[{i}]", homes=HOMES))
    mistakes.report()
    return ElasticStack(tuple(layers))


def _finger(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    mistakes, found = Mistakes(), dict[str, Any]()
    with mistakes.of_a_part(), at("finger"):
        if "depth" in table:
            found["depth"] = DEPTH["check"]("depth", table["depth"])
    with mistakes.of_a_part():
        found["finger"] = (_meshed if "mesh" in table else _parametric)(table, folder)
    mistakes.report()
    return found


def _meshed(table: Mapping[str, Any], folder: Path) -> MeshedFinger:
    geometry = {"kind", *names(Measured, FingerPad)} - {*names(MeshedFinger)}
    for name in table:
        if name in geometry:
            raise InputError(f"finger.{name}", "geometry beside a mesh", "no geometry keys beside mesh")
    return read(MeshedFinger, table, "finger", folder, beside=names(BesideFinger), homes=HOMES)


def _parametric(table: Mapping[str, Any], folder: Path) -> Any:
    from evfem.finger.fingertip import FINGERS

    cls = FINGERS[kind_of({"kind": "pad", **table}, "finger", FINGERS)]
    mistakes, sizes, found = Mistakes(), dict[str, Any](), None
    with mistakes.of_a_part(), at("finger"):
        if "participant" in table:
            sizes = cls.sizes_of(table["participant"])
    with mistakes.of_a_part():
        if isinstance(laws := table.get("materials"), Mapping):
            table = {**table, "materials": {name: _completed(name, law) for name, law in laws.items()}}
        more: dict[str, Any] = {
            "beside": [*names(Measured, BesideFinger), "mesh"],
            "homes": HOMES,
            "kinds": FINGERS,
        }
        found = read(cls, {**sizes, **table}, "finger", folder, tag="kind", **more)
    mistakes.report()
    return found


def _completed(name: str, table: Any) -> Any:
    """A layer of Table 2 whose table names no law is neo-Hookean, and keeps the moduli it does not name."""
    if not isinstance(table, Mapping) or "law" in table:
        return table
    if name not in TABLE_2:
        raise unknown(f"finger.materials.{name}", name, tuple(TABLE_2), "no such region")
    return {"law": "neo_hookean", **TABLE_2[name]._asdict(), **table}

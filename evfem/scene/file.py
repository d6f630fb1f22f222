"""Scene files: TOML to `Scene` and back; every mistake is one sentence that names the key in the
file.

Relative paths in a file are relative to the file. Limits: a scene of 4 MB and one million steps,
csv files of 64 MB and one million rows, meshes of 128 MB (`evfem.mesh.formats`). What is written
(`dump`) is in `evfem.scene.written`, which needs no models of the tables.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import fields
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any

from evfem.common.checks import MOST_STEPS
from evfem.contact.surfaces import Display, Flat, Profile, Sinusoid
from evfem.electrostatics.laws import INSULATORS, Layer
from evfem.errors import ABSENT, InputError, Mistakes, StorageError
from evfem.finger.fingerpad import Electrical, FingerPad, MeshedFinger, participant_sizes
from evfem.finger.layers import TABLE_2, Moduli
from evfem.mesh.formats import LARGEST
from evfem.scene.keys import (
    FRICTIONS,
    MOTIONS,
    ROUGHNESS,
    SURFACES,
    ElectricalTable,
    ElectrostaticsTable,
    HandTable,
    MeshTable,
    OutputTable,
    ProfileTable,
    SceneTable,
    SolverTable,
    StrategyTable,
    Table,
    at,
    check_size,
    columns,
    kind_of,
    parse,
    shown,
    unknown_key,
)
from evfem.scene.motion import Motion, VoltageRamp
from evfem.scene.scene import DEPTH, Output, Scene, Solver
from evfem.scene.voltage import drive_of, voltage_of
from evfem.scene.written import FORCE_LAWS, TEXTURES, VERSION, dump
from evfem.solver.hand import Hand
from evfem.solver.strategy import Strategy
from evfem.tissue.laws import from_table

#: largest files in bytes, and most steps of all motions together
LARGEST_SCENE = 4 * 2**20
LARGEST_TABLE = 64 * 2**20

__all__ = ["dump", "load", "loads"]


def load(path: str | Path) -> Scene:
    """The scene in a TOML file, named like the file.

    Raises InputError for whatever cannot be used, StorageError when the disk refuses.
    """
    path = Path(path)
    return loads(read_text("scene", path), path.parent, path.stem)


def scene_at(path: object) -> Scene:
    """The scene in the file at a path, where a scene or a path was asked for."""
    if not isinstance(path, (str, PathLike)):
        raise InputError("scene", path, "a Scene, or the path of a scene file")
    return load(Path(path))


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
        raise InputError(key, f"no valid TOML: {error}", f"a {key} in TOML") from error
    if tables.get("version") != VERSION or isinstance(tables["version"], bool):
        given = shown(tables["version"]) if "version" in tables else ABSENT
        raise InputError("version", given, f"version = {VERSION}")
    return tables


def loads(text: str, folder: str | Path = ".", name: str = "scene") -> Scene:
    """The scene in a TOML text; relative paths in it start at `folder`.

    Mistakes in different tables, or at different keys of one, are reported at once.

    >>> text = "version = 1\\n[surface]\\nkind = 'flat'\\n[[motion]]\\nkind = 'press'\\nforce = 0.05\\n"
    >>> loads(text).motion
    (Press(force=0.05, indentation=None, steps=10, speed=None),)
    """
    tables = tables_of("scene", text)
    top = parse(SceneTable, tables, "")
    folder, mistakes, electrostatics = Path(folder), Mistakes(), None
    parts: dict[str, Any] = {}
    with mistakes.of_a_part():
        parts["finger"] = _finger(top.finger, folder)
    with mistakes.of_a_part(), at("finger"):
        if "depth" in top.finger:
            parts["depth"] = DEPTH["check"]("depth", top.finger["depth"])
    with mistakes.of_a_part():
        if top.electrostatics is not None:
            electrostatics = parse(ElectrostaticsTable, top.electrostatics, "electrostatics")
            parts |= _attraction(electrostatics, top.motion, folder)
    with mistakes.of_a_part():
        parts["surface"] = _surface(top.surface, folder, electrostatics)
    with mistakes.of_a_part():
        if (law := top.surface.get("friction_law")) is not None:
            parts["friction_law"] = _friction_law(law)
    with mistakes.of_a_part():
        parts["motion"] = _motions(top.motion)
    with mistakes.of_a_part():
        if top.hand is not None:
            parts["hand"] = _build(Hand, parse(HandTable, top.hand, "hand"), "hand")
    with mistakes.of_a_part():
        parts["solver"] = _solver(parse(SolverTable, top.solver, "solver"))
    with mistakes.of_a_part():
        parts["output"] = _build(Output, parse(OutputTable, top.output, "output"), "output")
    mistakes.report()
    return Scene(**parts, name=name.translate(dict.fromkeys(map(ord, "\\:\n"), "_")))


def _solver(table: Any) -> Solver:
    key = "solver.strategy"
    strategy = _build(Strategy, parse(StrategyTable, table.strategy, key), key)
    return _build(Solver, table.model_copy(update={"strategy": strategy}), "solver")


def _build(cls: type, table: Table, prefix: str) -> Any:
    values = {name: getattr(table, name) for name in type(table).model_fields if name != "kind"}
    with at(prefix):
        return cls(**values)


def _motions(tables: list[dict[str, Any]]) -> list[Motion]:
    mistakes, motions = Mistakes(), []
    for i, table in enumerate(tables):
        with mistakes.of_a_part():
            model, cls = MOTIONS[kind_of(table, f"motion[{i}]", MOTIONS)]
            motions.append(_build(cls, parse(model, table, f"motion[{i}]"), f"motion[{i}]"))
    mistakes.report()
    if (total := sum(one.steps for one in motions)) > MOST_STEPS:
        raise InputError("motion", f"{total} steps in all", f"at most {MOST_STEPS} steps in all")
    return motions


def _surface(table: Mapping[str, Any], folder: Path, electrostatics: Any) -> Any:
    kind = kind_of(table, "surface", SURFACES)
    parsed: Any = parse(SURFACES[kind], table, "surface")
    insulator = None if electrostatics is None else _insulator(electrostatics)
    common = {"friction": parsed.friction, "y": parsed.y, "insulator": insulator}
    electrodes = getattr(electrostatics, "electrodes", None)
    if electrodes is not None and kind != "flat":
        raise InputError("electrostatics.electrodes", f"beside a surface of kind {kind}", "a flat surface")
    with at("surface"):
        if kind == "flat":
            return Flat(**common) if insulator is None else Display(**common, electrodes=electrodes)
        if kind == "sinusoid":
            return Sinusoid(terms=parsed.terms, **common)
        if kind in TEXTURES:
            return TEXTURES[kind](**parsed.model_dump(exclude={"kind", "friction_law", *common}), **common)
        if (parsed.file is None) == (parsed.points is None):
            given = ABSENT if parsed.file is None else "file and points"
            raise InputError("surface.file", given, ProfileTable.model_fields["file"].description or "")
        if parsed.points is not None:
            return Profile(*columns("surface.points", parsed.points), **common)
        path = folder / parsed.file
        check_size("surface.file", path, LARGEST_TABLE)
        return Profile.from_csv(path, **common)


def _friction_law(table: object) -> Any:
    """The law of friction of the table [surface.friction_law]."""
    key = "surface.friction_law"
    if not isinstance(table, Mapping):
        raise InputError(key, shown(table), "a table [surface.friction_law] with a kind")
    model, cls = FRICTIONS[kind_of(table, key, FRICTIONS)]
    return _build(cls, parse(model, table, key), key)


def _insulator(table: ElectrostaticsTable) -> Layer:
    """The insulator by its name, or by its thickness and permittivity."""
    own = {name: getattr(table, name) for name in ("insulator_thickness", "insulator_eps_r")}
    if table.insulator is not None:
        for name, value in own.items():
            if value is not None:
                given = f"{value:g} beside insulator = {table.insulator}"
                raise InputError(f"electrostatics.{name}", given, "one of the two")
        return INSULATORS[table.insulator]
    mistakes = Mistakes()
    for name, value in own.items():
        with mistakes.of_a_part():
            if value is None:
                allowed = ElectrostaticsTable.model_fields[name].description
                others = " | ".join(INSULATORS)
                raise InputError(f"electrostatics.{name}", ABSENT, f"{allowed}; or insulator = {others}")
    mistakes.report()
    prefix = "electrostatics.insulator_"
    with at("electrostatics", layer_thickness=f"{prefix}thickness", layer_eps_r=f"{prefix}eps_r"):
        return Layer(*own.values())


def _attraction(table: Any, motion: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
    """What a table [electrostatics] says of a scene."""
    with at("electrostatics"):
        law = FORCE_LAWS[table.law](gap_eps_r=table.gap_eps_r)
    ramped = any(one.get("kind") == VoltageRamp.kind for one in motion)
    voltage, drive = voltage_of(table, not ramped, folder), drive_of(table, folder)
    same = {
        name: getattr(table, name) for name in ("air_layer", "direction", "field", "grounded", "coupling")
    }
    same["roughness_gap"] = _roughness(table.roughness_gap)
    return {"law": law, "voltage": voltage, "drive": drive, **same}


def _roughness(given: float | Mapping[str, Any]) -> Any:
    """The gap between rough faces: a length, or a law by its name."""
    key = "electrostatics.roughness_gap"
    if not isinstance(given, Mapping):
        return given
    model, cls = ROUGHNESS[kind_of(given, key, ROUGHNESS, "law")]
    parsed: Any = parse(model, given, key)
    with at(key):
        return cls(**parsed.model_dump(exclude={"law"}))


def _finger(table: Mapping[str, Any], folder: Path) -> Any:
    parts = {name: value for name, value in table.items() if name != "depth"}  # the scene's
    electrical = parts.pop("electrical", {})
    if not isinstance(electrical, dict):
        raise InputError("finger.electrical", shown(electrical), "a table [finger.electrical]")
    parsed = parse(ElectricalTable, electrical, "finger.electrical")
    skin = _build(Electrical, parsed, "finger.electrical")
    if "mesh" in parts:
        return _meshed_finger(parts, skin, folder)
    finger, sizes = FINGERS[kind_of({"kind": "pad"} | parts, "finger", FINGERS)]()
    known = {spec.name: spec for spec in fields(finger) if spec.init}
    mistakes = Mistakes()
    mistakes.found += [
        unknown_key(f"finger.{name}", name, [*known, "kind", "participant", "mesh", "depth"])
        for name in parts
        if name not in (*known, "kind", "participant")
    ]
    laws, given = parts.pop("materials", {}), {name: parts[name] for name in parts if name in known}
    with mistakes.of_a_part():
        given["materials"] = _materials(laws, TABLE_2)
    with mistakes.of_a_part(), at("finger"):
        scan = "ridge_scan" if finger is FingerPad else "ridges"
        if isinstance(path := given.get(scan), str) and (finger is FingerPad or Path(path).suffix):
            check_size(f"finger.{scan}", folder / path, LARGEST_TABLE)
            given[scan] = folder / path
        if "participant" in parts:
            given = sizes(parts["participant"]) | given
        made = finger(**given, **({"electrical": skin} if electrical else {}))
    mistakes.report()
    return made


def _pad() -> tuple[Any, Callable[[str], dict[str, Any]]]:
    return FingerPad, participant_sizes


def _tip() -> tuple[Any, Callable[[str], dict[str, Any]]]:
    from evfem.finger.fingertip import Fingertip, tip_sizes

    return Fingertip, tip_sizes


#: kind of a finger -> its class, and the sizes of a participant's, loaded when they are asked for
FINGERS: Mapping[str, Callable[[], tuple[Any, Callable[[str], dict[str, Any]]]]] = {
    "pad": _pad,
    "fingertip": _tip,
}


def _meshed_finger(table: dict[str, Any], electrical: Electrical, folder: Path) -> MeshedFinger:
    geometry = [name for name in table if name in {"kind", *(spec.name for spec in fields(FingerPad))}]
    geometry = [name for name in geometry if name not in MeshTable.model_fields]
    if geometry:
        raise InputError(f"finger.{geometry[0]}", "geometry beside a mesh", "no geometry keys beside mesh")
    parsed = parse(MeshTable, table, "finger")
    path = folder / parsed.mesh
    check_size("finger.mesh", path, LARGEST)
    with at("finger"):
        materials = _materials(parsed.materials)
        return MeshedFinger(path, materials, electrical, parsed.viscosity, parsed.regions)


def _materials(tables: object, usual: Mapping[str, Moduli] = MappingProxyType({})) -> dict[str, Any]:
    """The laws of the regions; one of `usual` whose table names no law is neo-Hookean, and keeps
    the moduli that its table does not name.
    """
    if not isinstance(tables, dict):
        raise InputError("finger.materials", shown(tables), "a table [finger.materials.NAME] for a region")
    laws, mistakes = {}, Mistakes()
    for name, table in tables.items():
        key = f"finger.materials.{name}"
        with mistakes.of_a_part(), at("finger"):
            if not isinstance(table, dict):
                raise InputError(key, shown(table), "a table with a law and its parameters")
            if name in usual and "law" not in table:
                table = {"law": "neo_hookean", **usual[name]._asdict(), **table}
            laws[name] = from_table(table, key)
    mistakes.report()
    return laws

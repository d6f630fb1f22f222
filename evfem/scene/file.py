"""Scene files: TOML to `Scene` and back; every mistake is one sentence that names the key in the
file.

Relative paths in a file are relative to the file. Limits: a scene of 4 MB and one million steps,
csv files of 64 MB and one million rows, meshes of 128 MB (`evfem.mesh.formats`). Beyond what files
written by hand need, `dump` uses three keys so that a file stands alone: `points` of a profile,
`voltage_profile`, `gap_eps_r`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from types import MappingProxyType
from typing import Any

import tomli_w

from evfem.common.checks import MOST_STEPS
from evfem.common.views import changed
from evfem.contact.surfaces import Display, Flat, Profile, Sinusoid
from evfem.contact.textures import Grating, SelfAffine
from evfem.electrostatics.laws import INSULATORS, Kaczmarek, Layer, StrongTroxel
from evfem.errors import InputError, StorageError
from evfem.finger.fingerpad import Electrical, FingerPad, MeshedFinger, participant_sizes
from evfem.finger.layers import TABLE_2, Moduli
from evfem.mesh.formats import LARGEST
from evfem.scene.keys import (
    MOTIONS,
    SURFACES,
    ElectricalTable,
    ElectrostaticsTable,
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
    parse,
    shown,
    unknown,
)
from evfem.scene.motion import Motion, VoltageRamp
from evfem.scene.scene import COUPLINGS, DIRECTIONS, Output, Scene, Solver
from evfem.scene.voltage import read_voltage, voltage_keys
from evfem.solver.strategy import Strategy
from evfem.tissue.laws import LAWS, from_table

VERSION = 1
#: largest files in bytes, and most steps of all motions together
LARGEST_SCENE = 4 * 2**20
LARGEST_TABLE = 64 * 2**20
TEXTURES: Mapping[str, type] = {"grating": Grating, "self_affine": SelfAffine}
FORCE_LAWS: Mapping[str, type] = {"strong_troxel": StrongTroxel, "kaczmarek": Kaczmarek}


def load(path: str | Path) -> Scene:
    """The scene in a TOML file, named like the file.

    Raises InputError for whatever cannot be used, StorageError when the disk refuses.
    """
    path = Path(path)
    return loads(read_text("scene", path), path.parent, path.stem)


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
        given = shown(tables["version"]) if "version" in tables else "nothing"
        raise InputError("version", given, f"version = {VERSION}")
    return tables


def loads(text: str, folder: str | Path = ".", name: str = "scene") -> Scene:
    """The scene in a TOML text; relative paths in it start at `folder`.

    >>> text = "version = 1\\n[surface]\\nkind = 'flat'\\n[[motion]]\\nkind = 'press'\\nforce = 0.05\\n"
    >>> loads(text).motion
    (Press(force=0.05, indentation=None, steps=10, speed=None),)
    """
    tables = tables_of("scene", text)
    top = parse(SceneTable, tables, "")
    folder = Path(folder)
    table = top.electrostatics
    electrostatics = None if table is None else parse(ElectrostaticsTable, table, "electrostatics")
    motion = [_motion(table, f"motion[{i}]") for i, table in enumerate(top.motion)]
    if (total := sum(one.steps for one in motion)) > MOST_STEPS:
        raise InputError("motion", f"{total} steps in all", f"at most {MOST_STEPS} steps in all")
    law, voltage = _law_and_voltage(electrostatics, motion, folder)
    return Scene(
        finger=_finger(top.finger, folder),
        surface=_surface(top.surface, folder, electrostatics),
        law=law,
        voltage=voltage,
        motion=motion,
        air_layer=electrostatics.air_layer if electrostatics else True,
        direction=electrostatics.direction if electrostatics else DIRECTIONS[0],
        coupling=electrostatics.coupling if electrostatics else COUPLINGS[0],
        solver=_solver(parse(SolverTable, top.solver, "solver")),
        output=_build(Output, parse(OutputTable, top.output, "output"), "output"),
        name=name.translate(dict.fromkeys(map(ord, "\\:\n"), "_")),
    )


def _solver(table: Any) -> Solver:
    key = "solver.strategy"
    strategy = _build(Strategy, parse(StrategyTable, table.strategy, key), key)
    return _build(Solver, table.model_copy(update={"strategy": strategy}), "solver")


def _build(cls: type, table: Table, prefix: str) -> Any:
    values = {name: getattr(table, name) for name in type(table).model_fields if name != "kind"}
    with at(prefix):
        return cls(**values)


def _motion(table: Mapping[str, Any], prefix: str) -> Motion:
    kind = table.get("kind", "nothing")
    if not isinstance(kind, str) or kind not in MOTIONS:
        raise InputError(f"{prefix}.kind", _plain(kind), " | ".join(MOTIONS))
    model, cls = MOTIONS[kind]
    return _build(cls, parse(model, table, prefix), prefix)


def _plain(value: object) -> str:
    return value if isinstance(value, str) else shown(value)


def _surface(table: Mapping[str, Any], folder: Path, electrostatics: Any) -> Any:
    kind = table.get("kind", "nothing")
    if not isinstance(kind, str) or kind not in SURFACES:
        raise InputError("surface.kind", _plain(kind), " | ".join(SURFACES))
    parsed: Any = parse(SURFACES[kind], table, "surface")
    insulator = None if electrostatics is None else _insulator(electrostatics)
    common = {"friction": parsed.friction, "y": parsed.y, "insulator": insulator}
    with at("surface"):
        if kind == "flat":
            return Flat(**common) if insulator is None else Display(**common)
        if kind == "sinusoid":
            return Sinusoid(terms=parsed.terms, **common)
        if kind in TEXTURES:
            return TEXTURES[kind](**parsed.model_dump(exclude={"kind", *common}), **common)
        if (parsed.file is None) == (parsed.points is None):
            given = "nothing" if parsed.file is None else "file and points"
            raise InputError("surface.file", given, ProfileTable.model_fields["file"].description or "")
        if parsed.points is not None:
            return Profile(*columns("surface.points", parsed.points), **common)
        path = folder / parsed.file
        check_size("surface.file", path, LARGEST_TABLE)
        return Profile.from_csv(path, **common)


def _insulator(table: ElectrostaticsTable) -> Layer:
    """The insulator by its name, or by its thickness and permittivity."""
    own = {name: getattr(table, name) for name in ("insulator_thickness", "insulator_eps_r")}
    if table.insulator is not None:
        for name, value in own.items():
            if value is not None:
                given = f"{value:g} beside insulator = {table.insulator}"
                raise InputError(f"electrostatics.{name}", given, "one of the two")
        return INSULATORS[table.insulator]
    for name, value in own.items():
        if value is None:
            allowed = ElectrostaticsTable.model_fields[name].description
            others = " | ".join(INSULATORS)
            raise InputError(f"electrostatics.{name}", "nothing", f"{allowed}; or insulator = {others}")
    prefix = "electrostatics.insulator_"
    with at("electrostatics", layer_thickness=f"{prefix}thickness", layer_eps_r=f"{prefix}eps_r"):
        return Layer(*own.values())


def _law_and_voltage(table: Any, motion: list[Motion], folder: Path) -> tuple[Any, Any]:
    if table is None:
        return None, 0.0
    with at("electrostatics"):
        law = FORCE_LAWS[table.law](gap_eps_r=table.gap_eps_r)
    ramped = any(isinstance(one, VoltageRamp) for one in motion)
    return law, read_voltage(table, not ramped, folder)


def _finger(table: Mapping[str, Any], folder: Path) -> Any:
    parts: dict[str, Any] = dict(table)
    electrical = parts.pop("electrical", {})
    if not isinstance(electrical, dict):
        raise InputError("finger.electrical", shown(electrical), "a table [finger.electrical]")
    parsed = parse(ElectricalTable, electrical, "finger.electrical")
    skin = _build(Electrical, parsed, "finger.electrical")
    if "mesh" in parts:
        return _meshed_finger(parts, skin, folder)
    known = [spec.name for spec in fields(FingerPad) if spec.init]
    for name in parts:
        if name not in (*known, "participant"):
            raise unknown(f"finger.{name}", name, [*known, "participant", "mesh"])
    if "participant" in parts:
        parts = participant_sizes(parts.pop("participant")) | parts
    if "materials" in parts:
        parts["materials"] = _materials(parts["materials"], TABLE_2)
    if electrical:
        parts["electrical"] = skin
    with at("finger"):
        return FingerPad(**parts)


def _meshed_finger(table: dict[str, Any], electrical: Electrical, folder: Path) -> MeshedFinger:
    geometry = [name for name in table if name in {spec.name for spec in fields(FingerPad)}]
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
    laws = {}
    for name, table in tables.items():
        key = f"finger.materials.{name}"
        if not isinstance(table, dict):
            raise InputError(key, shown(table), "a table with a law and its parameters")
        if name in usual and "law" not in table:
            table = {"law": "neo_hookean", **usual[name]._asdict(), **table}
        with at("finger"):
            laws[name] = from_table(table, key)
    return laws


def dump(scene: Scene) -> str:
    """The scene as TOML; `loads` makes an equal scene of it.

    An insulator without a law has no effect and no place in a file. Raises InputError for what a
    file cannot hold: a mesh object, a law or a weak form of the user's own.
    """
    if scene.forms:
        raise InputError("forms", "weak forms of your own", "a scene without them, for a file")
    tables = {
        "version": VERSION,
        "finger": _finger_table(scene.finger),
        "surface": _surface_table(scene.surface),
    }
    if scene.law is not None:
        tables["electrostatics"] = _electrostatics_table(scene)
    solver = _changed(scene.solver)
    if "strategy" in solver:
        solver["strategy"] = _changed(scene.solver.strategy)
    tables["solver"] = solver
    tables["output"] = _changed(scene.output)
    tables["motion"] = [{"kind": motion.kind, **_changed(motion)} for motion in scene.motion]
    return tomli_w.dumps({name: table for name, table in tables.items() if table != {}})


def _changed(value: Any) -> dict[str, Any]:
    """The fields of a dataclass that differ from their defaults."""
    return {name: v for name, v in changed(value).items() if v is not None}


def _finger_table(finger: Any) -> dict[str, Any]:
    if isinstance(finger, MeshedFinger):
        if not isinstance(finger.source, (str, Path)):
            raise InputError("finger.mesh", "a mesh object", "a mesh in a file, for a file")
        table: dict[str, Any] = {"mesh": str(Path(finger.source).resolve()), "regions": finger.regions}
        table |= {
            "viscosity": finger.viscosity,
            "materials": finger.materials,
            "electrical": finger.electrical,
        }
    elif isinstance(finger, FingerPad):
        usual = FingerPad().materials
        table = _changed(finger)
        table["materials"] = {name: law for name, law in finger.materials.items() if law != usual[name]}
    else:
        raise InputError("finger", type(finger).__name__, "FingerPad or MeshedFinger, for a file")
    if "materials" in table:
        table["materials"] = {name: _law_table(name, law) for name, law in table["materials"].items()}
    if "electrical" in table:
        table["electrical"] = _changed(table["electrical"])
    return {
        name: dict(v) if isinstance(v, Mapping) else v for name, v in table.items() if v not in (None, {})
    }


def _law_table(region: str, law: Any) -> dict[str, Any]:
    names = [name for name, cls in LAWS.items() if type(law) is cls]
    if not names:
        raise InputError(f"finger.materials.{region}", type(law).__name__, f"{', '.join(LAWS)}, for a file")
    return {"law": names[0], **_changed(law)}


def _surface_table(surface: Any) -> dict[str, Any]:
    if type(surface) not in (Flat, Display, Sinusoid, Profile, *TEXTURES.values()):
        allowed = "Flat, Display, Sinusoid, Profile, Grating or SelfAffine, for a file"
        raise InputError("surface", type(surface).__name__, allowed)
    friction = (
        surface.friction if isinstance(surface.friction, float) else [list(row) for row in surface.friction]
    )
    table = {"friction": friction} | ({} if surface.y is None else {"y": float(surface.y)})
    if type(surface) in (Flat, Display):
        return {"kind": "flat", **table}
    if type(surface) is Sinusoid:
        return {"kind": "sinusoid", **table, "terms": [list(row) for row in surface.terms or ()]}
    for kind, cls in TEXTURES.items():
        if type(surface) is cls:
            own = {name: value for name, value in _changed(surface).items() if name != "insulator"}
            return {"kind": kind, **own, **table}
    rows = zip(surface.x.tolist(), surface.samples.tolist(), strict=True)
    return {"kind": "profile", **table, "points": [list(row) for row in rows]}


def _electrostatics_table(scene: Scene) -> dict[str, Any]:
    names = [name for name, cls in FORCE_LAWS.items() if type(scene.law) is cls]
    if not names:
        raise InputError(
            "electrostatics.law", type(scene.law).__name__, f"{' | '.join(FORCE_LAWS)}, for a file"
        )
    table: dict[str, Any] = {"law": names[0], **_changed(scene.law)}
    table |= voltage_keys(scene.voltage)
    insulator = scene.ground.insulator
    table |= {"insulator_thickness": insulator.thickness, "insulator_eps_r": insulator.eps_r}
    return table | {"air_layer": scene.air_layer, "direction": scene.direction, "coupling": scene.coupling}

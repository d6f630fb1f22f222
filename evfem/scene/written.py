"""A scene as TOML: what `evfem.scene.file` reads back.

Beyond what files written by hand need, three keys let a file stand alone: `points` of a profile,
`voltage_profile`, `gap_eps_r`. Every run keeps its scene this way, so nothing here loads the models
that check a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomli_w

from evfem.common.views import changed
from evfem.contact.friction import KINDS, Coulomb
from evfem.contact.surfaces import Display, Flat, Profile, Sinusoid
from evfem.contact.textures import Grating, SelfAffine
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.drive import Drive
from evfem.electrostatics.laws import Kaczmarek, StrongTroxel
from evfem.electrostatics.roughness import LAWS as ROUGHNESS_LAWS
from evfem.electrostatics.signals import VoltageProfile
from evfem.electrostatics.timesignals import Carrier, ChargeControl, OpenCircuit, Sampled, Sine, Square
from evfem.errors import InputError
from evfem.finger.fingerpad import FingerPad, MeshedFinger
from evfem.finger.scan import RidgeScan
from evfem.scene.scene import Scene
from evfem.tissue.laws import LAWS

VERSION = 1
#: kinds of textures and names of force laws in a file
TEXTURES: Mapping[str, type] = {"grating": Grating, "self_affine": SelfAffine}
FORCE_LAWS: Mapping[str, type] = {"strong_troxel": StrongTroxel, "kaczmarek": Kaczmarek}


def dump(scene: Scene) -> str:
    """The scene as TOML; `loads` makes an equal scene of it.

    An insulator without a law has no effect and no place in a file. Raises InputError for what a
    file cannot hold: a mesh object, a law or a weak form of the user's own.
    """
    if scene.forms:
        raise InputError("forms", "weak forms of your own", "a scene without them, for a file")
    tables = {
        "version": VERSION,
        "finger": _finger_table(scene.finger) | ({} if scene.depth is None else {"depth": scene.depth}),
        "surface": _surface_table(scene.surface) | _friction_law_key(scene.friction_law),
    }
    if scene.law is not None:
        tables["electrostatics"] = _electrostatics_table(scene)
    if scene.hand is not None:
        tables["hand"] = _changed(scene.hand)
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
    else:
        table = _parametric_finger(finger)
    if "materials" in table:
        table["materials"] = {name: _law_table(name, law) for name, law in table["materials"].items()}
    if "electrical" in table:
        table["electrical"] = _changed(table["electrical"])
    return {
        name: dict(v) if isinstance(v, Mapping) else v for name, v in table.items() if v not in (None, {})
    }


def _parametric_finger(finger: Any) -> dict[str, Any]:
    if isinstance(finger, FingerPad):
        table = _changed(finger)
        if isinstance(finger.ridge_scan, RidgeScan):
            table["ridge_scan"] = finger.ridge_scan.columns
    else:
        from evfem.finger.fingerprint import HeightMap
        from evfem.finger.fingertip import Fingertip

        if not isinstance(finger, Fingertip):
            allowed = "FingerPad, Fingertip or MeshedFinger, for a file"
            raise InputError("finger", type(finger).__name__, allowed)
        table = {"kind": "fingertip", **_changed(finger)}
        if isinstance(finger.ridges, HeightMap):
            table["ridges"] = finger.ridges.columns
    usual = type(finger)().materials
    table["materials"] = {name: law for name, law in finger.materials.items() if law != usual[name]}
    return table


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


def _friction_law_key(law: Any) -> dict[str, Any]:
    """The table of a law of friction in that of the surface; nothing for Coulomb's."""
    if type(law) not in KINDS.values():
        allowed = f"{', '.join(cls.__name__ for cls in KINDS.values())}, for a file"
        raise InputError("surface.friction_law", type(law).__name__, allowed)
    return {} if isinstance(law, Coulomb) else {"friction_law": {"kind": law.kind, **_changed(law)}}


def _electrostatics_table(scene: Scene) -> dict[str, Any]:
    names = [name for name, cls in FORCE_LAWS.items() if type(scene.law) is cls]
    if not names:
        raise InputError(
            "electrostatics.law", type(scene.law).__name__, f"{' | '.join(FORCE_LAWS)}, for a file"
        )
    table: dict[str, Any] = {"law": names[0], **_changed(scene.law)}
    table |= voltage_keys(scene.voltage)
    if scene.drive is not None:
        table |= _drive_keys(scene.drive) or {"drive": "mean"}
    insulator = scene.ground.insulator
    if not isinstance(insulator.eps_r, float):
        raise InputError("surface.insulator", "a permittivity that is no number", "a number, for a file")
    table |= {"insulator_thickness": insulator.thickness, "insulator_eps_r": insulator.eps_r}
    if (electrodes := getattr(scene.surface, "electrodes", None)) is not None:
        table["electrodes"] = [list(map(float, row)) for row in electrodes]
    if (rough := scene.roughness_gap) != 0.0:
        table["roughness_gap"] = _roughness_key(rough)
    same = ("air_layer", "direction", "coupling", *(() if scene.field == "local" else ("field", "grounded")))
    return table | {name: getattr(scene, name) for name in same}


def _drive_keys(drive: Drive) -> dict[str, Any]:
    """The keys of [electrostatics] that make this drive."""
    table = _changed(drive)
    if not isinstance(table.get("skin", ""), str):
        given = type(table["skin"]).__name__
        raise InputError("electrostatics.skin", given, f"{' | '.join(SKINS)}, for a file")
    if table.pop("resolved", False):
        table["drive"] = "resolved"
    return table


def _roughness_key(rough: Any) -> Any:
    if isinstance(rough, float):
        return rough
    if type(rough) not in ROUGHNESS_LAWS.values():
        allowed = f"a length or {', '.join(cls.__name__ for cls in ROUGHNESS_LAWS.values())}, for a file"
        raise InputError("electrostatics.roughness_gap", type(rough).__name__, allowed)
    return {"law": rough.law, **_changed(rough)}


#: signals that a file can have, and their names in a sentence
WRITTEN = (Sine, Square, Carrier, Sampled, OpenCircuit, ChargeControl)
_SIGNALS = f"{', '.join(cls.__name__ for cls in WRITTEN[:-1])} or {WRITTEN[-1].__name__}"


def voltage_keys(voltage: Any) -> dict[str, Any]:
    """The keys of [electrostatics] that give this voltage, without files."""
    if isinstance(voltage, VoltageProfile):
        rows = zip(voltage.position.tolist(), voltage.voltage.tolist(), strict=True)
        return {"voltage_profile": [list(row) for row in rows]}
    if isinstance(voltage, WRITTEN):
        return {"signal": _signal_table(voltage)}
    if not isinstance(voltage, float):
        allowed = f"a number, a VoltageProfile, {_SIGNALS} in a scene file"
        raise InputError("electrostatics.voltage", type(voltage).__name__, allowed)
    return {"voltage": voltage}


def _signal_table(signal: Any) -> dict[str, Any]:
    table = {"kind": signal.kind, **changed(signal)}
    if isinstance(signal, Sampled):
        return table | {"voltage": signal.voltage.tolist()}
    for name in ("envelope", "charge"):
        inner = getattr(signal, name, None)
        if isinstance(inner, WRITTEN):
            table[name] = _signal_table(inner)
        elif inner is not None and not isinstance(inner, float):
            given = f"a {signal.kind} whose {name} is of the class {type(inner).__name__}"
            raise InputError("electrostatics.voltage", given, f"{_SIGNALS} in a scene file")
    return table

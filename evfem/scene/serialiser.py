"""A scene as TOML: what `evfem.scene.file` reads back, by the same keys (`evfem.common.checks.Key`).

Beyond what files written by hand need, three keys let a file stand alone: `points` of a profile,
`voltage_profile`, `gap_eps_r`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from evfem.circuit.signals import FOUND, FollowForce, VoltageProfile
from evfem.common.checks import keys_of
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.drive import Drive
from evfem.electrostatics.laws import FORCE_LAWS, SOLID, LayerStack
from evfem.electrostatics.timesignals import SIGNALS
from evfem.errors import InputError
from evfem.finger.fingerpad import MeshedFinger
from evfem.scene.keys import VERSION
from evfem.scene.scene import Scene
from evfem.surface.adhesion import ADHESIONS
from evfem.surface.elastic import ElasticLayer, ElasticStack
from evfem.surface.friction import KINDS, Coulomb
from evfem.surface.relief import Relief
from evfem.surface.surfaces import Display, Profile
from evfem.surface.textures import SURFACES
from evfem.terms.hand import Hand


def dump(scene: Scene) -> str:
    """The scene as TOML; `loads` makes an equal scene of it.

    An insulator without a law has no effect and no place in a file. Raises InputError for what a
    file cannot hold: a mesh object, a law or a weak form of the user's own.
    """
    if scene.forms:
        raise InputError("forms", "weak forms of your own", "a scene without them, for a file")
    if scene.rooms:
        raise InputError("rooms", "rooms of your own", "a scene without them, for a file")
    if scene.hand is not None and type(scene.hand) is not Hand:
        raise InputError("hand", type(scene.hand).__name__, "Hand, for a file")
    kinds = {**SURFACES, "flat": Display} if type(scene.surface) is Display else SURFACES
    surface = _of_kind(scene.surface, kinds, "surface")
    if isinstance(scene.surface, Profile):
        rows = zip(scene.surface.x.tolist(), scene.surface.samples.tolist(), strict=True)
        surface["points"] = [list(row) for row in rows]
    if isinstance(scene.surface, Relief):
        surface |= scene.surface.columns
    if (elastic := scene.ground.elastic) is not None:
        if not isinstance(elastic, ElasticLayer | ElasticStack):
            allowed = "ElasticLayer, ElasticStack, for a file"
            raise InputError("surface.elastic", type(elastic).__name__, allowed)
        layers = [_keys(layer, "surface.elastic") for layer in elastic.layers]
        surface["elastic"] = layers[0] if isinstance(elastic, ElasticLayer) else layers
    if type(scene.friction_law) is not Coulomb:
        surface["friction_law"] = _of_kind(scene.friction_law, KINDS, "surface.friction_law")
    tables = {
        "version": VERSION,
        "finger": _finger(scene.finger) | ({} if scene.depth is None else {"depth": scene.depth}),
        "surface": surface,
        "electrostatics": {} if scene.law is None else _electrostatics(scene),
        "adhesion": (
            {} if scene.adhesion is None else _of_kind(scene.adhesion, ADHESIONS, "adhesion", "law")
        ),
        "hand": {} if scene.hand is None else _keys(scene.hand, "hand"),
        "solver": _keys(scene.solver, "solver"),
        "output": _keys(scene.output, "output"),
        "motion": [{"kind": motion.kind, **_keys(motion, "motion")} for motion in scene.motion],
    }
    return tomli_w.dumps({name: table for name, table in tables.items() if table != {}})


def _keys(value: Any, prefix: str) -> dict[str, Any]:
    """The keys of an object that differ from their defaults."""
    found = {}
    for key in keys_of(type(value)):
        one = getattr(value, key.field)
        if one is not None and (key.required or bool(np.any(one != key.default))):
            kinds = key.rule["kinds"]() if "kinds" in key.rule else {}
            found[key.name] = _plain(one, f"{prefix}.{key.name}", kinds, key.rule.get("tag", "kind"))
    return found


def _plain(value: Any, prefix: str, kinds: Mapping[str, Any], tag: str = "kind") -> Any:
    """A value as TOML has it."""
    if isinstance(value, Mapping):
        return {name: _plain(one, f"{prefix}.{name}", kinds, tag) for name, one in value.items()}
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, (tuple, list, np.ndarray)):
        return np.asarray(value).tolist()
    if isinstance(value, Path):
        return str(value.resolve())
    if hasattr(value, "columns"):  # measured ridges
        return value.columns
    return _of_kind(value, kinds, prefix, tag) if kinds else _keys(value, prefix)


def _of_kind(value: Any, kinds: Mapping[str, Any], prefix: str, tag: str = "kind") -> dict[str, Any]:
    """The table of an object that is one of `kinds`."""
    for name, cls in kinds.items():
        if type(value) is cls:
            return {tag: name, **_keys(value, prefix)}
    allowed = ", ".join(cls.__name__ for cls in kinds.values())
    raise InputError(prefix, type(value).__name__, f"{allowed}, for a file")


def _finger(finger: Any) -> dict[str, Any]:
    if isinstance(finger, MeshedFinger):
        if not isinstance(finger.source, (str, Path)):
            raise InputError("finger.mesh", "a mesh object", "a mesh in a file, for a file")
        return _keys(finger, "finger")
    from evfem.finger.fingertip import FINGERS

    table = _of_kind(finger, FINGERS, "finger")
    usual = replace(finger, materials={}).materials
    own = {name: table["materials"][name] for name, law in finger.materials.items() if law != usual[name]}
    table["materials"] = own
    return {name: v for name, v in table.items() if v != {} and (name, v) != ("kind", "pad")}


def _electrostatics(scene: Scene) -> dict[str, Any]:
    table = _of_kind(scene.law, FORCE_LAWS, "electrostatics.law", "law") | voltage_keys(scene.voltage)
    if scene.drive is not None:
        table |= _drive(scene.drive)
    insulator = scene.ground.insulator
    if not isinstance(insulator.eps_r, float):
        raise InputError("surface.insulator", "a permittivity that is no number", "a number, for a file")
    names = ("thickness", "eps_r", "strength")
    for name in names if any(one.strength != SOLID for one in insulator.parts) else names[:2]:
        each = [getattr(one, name) for one in insulator.parts]
        table[f"insulator_{name}"] = each if type(insulator) is LayerStack else each[0]
    if (electrodes := getattr(scene.surface, "electrodes", None)) is not None:
        table["electrodes"] = [list(map(float, row)) for row in electrodes]
    return table | _keys(scene, "electrostatics")


def _drive(drive: Drive) -> dict[str, Any]:
    """The keys of [electrostatics] that make this drive."""
    if not isinstance(drive.skin, str | None):
        allowed = f"{' | '.join(SKINS)}, for a file"
        raise InputError("electrostatics.skin", type(drive.skin).__name__, allowed)
    table = _keys(drive, "electrostatics")
    if table.pop("resolved", False):
        table["drive"] = "resolved"
    return table or {"drive": "mean"}


def voltage_keys(voltage: Any) -> dict[str, Any]:
    """The keys of [electrostatics] that give this voltage, without files."""
    if isinstance(voltage, VoltageProfile):
        rows = zip(voltage.position.tolist(), voltage.voltage.tolist(), strict=True)
        return {"voltage_profile": [list(row) for row in rows]}
    if isinstance(voltage, float):
        return {"voltage": voltage}
    if isinstance(voltage, FollowForce):
        return {"voltage": _of_kind(voltage, FOUND, "electrostatics.voltage")}
    return {"signal": _of_kind(voltage, SIGNALS, "electrostatics.voltage")}

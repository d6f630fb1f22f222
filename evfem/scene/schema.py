"""Every key of a scene file with type, unit, default, what is allowed, and meaning: as rows to read,
and as a JSON schema (draft 7) for editors.

Types, defaults and what is allowed are those of the models that read a file (`evfem.scene.keys`,
`FingerPad`, the material laws), units and meanings those of `evfem.scene.meanings`. An editor
completes and checks what the schema knows: each key by itself. What belongs together (a press to a
force or to an indentation) only the reader knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, get_type_hints

from pydantic import Field as Default
from pydantic import create_model

from evfem.common.checks import Within
from evfem.finger.fingerpad import RANGES, RESOLUTIONS, FingerPad
from evfem.scene import keys, meanings
from evfem.scene.keys import Table
from evfem.scene.meanings import Meanings, Text
from evfem.scene.voltage import MADE, SIGNALS
from evfem.tissue.laws import LAWS

DRAFT = "http://json-schema.org/draft-07/schema#"
#: how types of JSON are called in a table to read
SPOKEN = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true, false"}
SPOKEN |= {"object": "table", "array": "list"}
#: signals whose fields know their limits
CLASSES: Mapping[str, type | None] = {**MADE, "sampled": None}
#: a key of [finger] that belongs to the scene
DEPTH: Any = (float | None, Default(default=None))
Schema = dict[str, Any]


@dataclass(frozen=True)
class Key:
    """A key of a file: `default` as it would stand there, "" for none; `schema` is its JSON
    schema.
    """

    name: str
    type: str
    unit: str
    default: str
    required: bool
    allowed: str
    meaning: str
    schema: Schema = field(default_factory=dict, repr=False)


@dataclass(frozen=True)
class Section:
    """A table of a file, or one kind of it, with its keys."""

    name: str
    kind: str
    keys: tuple[Key, ...]

    def schema(self, **more: Schema) -> Schema:
        """JSON schema of the table; `more` replaces or adds keys."""
        own = {key.name: key.schema for key in self.keys} | more
        needed = [key.name for key in self.keys if key.required]
        named = {"title": self.kind} if self.kind else {}
        return named | {
            "type": "object",
            "additionalProperties": False,
            "properties": own,
            **({"required": needed} if needed else {}),
        }


def section(name: str, model: type[Table], texts: Meanings, kind: str = "", origin: Any = None) -> Section:
    """The keys of a table from its model and its texts; `origin` is the dataclass a model is made
    from, whose fields know their limits.
    """
    properties = model.model_json_schema()["properties"]
    rules = {spec.name: spec.metadata for spec in fields(origin)} if origin else {}
    return Section(
        name,
        kind,
        tuple(
            _key(key, spec, properties[key], texts.get(key, Text("", "")), rules.get(key, {}))
            for key, spec in model.model_fields.items()
            if key != "kind" or not kind
        ),
    )


def _key(name: str, spec: Any, found: Schema, text: Text, rule: Mapping[str, Any]) -> Key:
    shape = _shape(found)
    limits = rule.get("test") if isinstance(rule.get("test"), Within) else text.limits
    if isinstance(limits, Within):
        shape |= _limits(limits, shape.get("type") == "integer")
    if "names" in rule:
        shape["enum"] = list(rule["names"])
    allowed = text.allowed or spec.description or ""
    default = None if spec.is_required() else spec.get_default(call_default_factory=True)
    unit = f" ({text.unit})" if text.unit else ""
    shape["description"] = f"{text.meaning}{unit}. Allowed: {allowed}"
    if isinstance(default, (bool, int, float, str)):
        shape["default"] = default
    told = _toml(default)
    return Key(name, _spoken(shape), text.unit, told, spec.is_required(), allowed, text.meaning, shape)


def _shape(found: Schema) -> Schema:
    """The type of a property, without null, which TOML does not have."""
    options = [one for one in found.get("anyOf", [found]) if one.get("type") != "null"]
    kept = [{key: one[key] for key in ("type", "enum", "const", "items") if key in one} for one in options]
    return kept[0] if len(kept) == 1 else {"anyOf": kept}


def _limits(within: Within, whole: bool) -> Schema:
    def plain(value: float) -> float | int:
        return int(value) if whole else value

    found: Schema = {}
    if within.low > -math.inf:
        found["exclusiveMinimum" if within.above else "minimum"] = plain(within.low)
    if within.high < math.inf:
        found["maximum"] = plain(within.high)
    if within.not_zero:
        found["not"] = {"const": 0}
    return found


def _spoken(shape: Schema) -> str:
    if "anyOf" in shape:
        return " or ".join(dict.fromkeys(_spoken(one) for one in shape["anyOf"]))
    if shape.get("type") == "array" and shape.get("items", {}).get("type") == "array":
        return "rows"
    return SPOKEN[shape.get("type", "string")]


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"{value:.12g}" if isinstance(value, (int, float)) else ""


def _from_fields(cls: type, **own: Any) -> type[Table]:
    """The model of a dataclass whose constructor judges its values; `own` keys replace fields."""
    types = get_type_hints(cls)
    found: dict[str, Any] = {}
    for spec in fields(cls):
        if spec.init:
            default = ... if spec.default is MISSING else spec.default
            found[spec.name] = types[spec.name], Default(default=default)
    return create_model(f"{cls.__name__}Keys", __base__=Table, **(found | own))


def _pad() -> Section:
    scan = (str | dict[str, list[float]] | None, Default(default=None))
    kind = (str, Default(default="pad"))
    model = _from_fields(FingerPad, **_own_keys(), kind=kind, ridge_scan=scan)
    found = _ranged("parametric", model, meanings.FINGER, RANGES, tuple(RESOLUTIONS))
    return _kind_first(found, "kind", "pad")


def _tip() -> Section:
    from evfem.finger.fingertip import TIP_RANGES, TIP_RESOLUTIONS, Fingertip

    ridges = (bool | str | dict[str, list[Any]], Default(default="along"))
    model = _from_fields(Fingertip, **_own_keys(), kind=(str, ...), ridges=ridges)
    texts = meanings.FINGERTIP | {"kind": meanings.FINGER["kind"]._replace(allowed="fingertip")}
    found = _ranged("fingertip", model, texts, TIP_RANGES, tuple(TIP_RESOLUTIONS))
    return _kind_first(found, "kind", "fingertip")


def _own_keys() -> dict[str, Any]:
    """Keys of a parametric finger that are no fields, or other tables."""
    table: Any = (dict[str, Any], Default(default={}))
    return {
        "participant": (str | None, Default(default=None)),
        "materials": table,
        "electrical": table,
        "depth": DEPTH,
    }


def _ranged(
    kind: str, model: type[Table], texts: Meanings, ranges: Mapping[str, Any], resolutions: tuple[str, ...]
) -> Section:
    """The keys of a parametric finger with their ranges."""
    limited = {
        name: text._replace(allowed="{:g} to {:g}{}".format(*ranges[name]), limits=Within(*ranges[name][:2]))
        for name, text in texts.items()
        if name in ranges
    }
    told = {**texts, **limited}
    told["resolution"] = told["resolution"]._replace(allowed=" | ".join(resolutions))
    found = section("finger", model, told)
    for key in found.keys:
        if key.name == "resolution":
            key.schema["enum"] = list(resolutions)
    return Section("finger", kind, found.keys)


def _materials() -> list[Section]:
    found = []
    for name, law in LAWS.items():
        numbers = float | list[float]
        own = {key: (numbers, ...) for key in ("mu", "alpha") if key in {f.name for f in fields(law)}}
        model = create_model("Law", __base__=_from_fields(law, **own), law=(str, Default(description=name)))
        texts = meanings.MATERIAL | {"law": meanings.MATERIAL["law"]._replace(allowed=name)}
        found.append(section("finger.materials.NAME", model, texts, name))
        found[-1] = _kind_first(found[-1], "law", name)
    return found


def _kind_first(one: Section, key: str, name: str) -> Section:
    """The section with the key that says its kind in front, allowed to be that kind alone."""
    (chosen,) = (k for k in one.keys if k.name == key)
    chosen.schema.clear()
    chosen.schema.update({"const": name, "description": chosen.meaning})
    return Section(one.name, one.kind, (chosen, *(k for k in one.keys if k is not chosen)))


def _of_kind(name: str, kind: str, model: type[Table], texts: Meanings, origin: Any = None) -> Section:
    text = Text("", "which kind", kind)
    key = Key("kind", "text", "", "", True, kind, text.meaning, {"const": kind, "description": text.meaning})
    plain = section(name, model, texts, kind, origin)
    return Section(name, kind, (key, *plain.keys))


def sections() -> list[Section]:
    """All tables of a scene file, in the order in which one is written."""
    surfaces = [_of_kind("surface", kind, model, meanings.SURFACE) for kind, model in keys.SURFACES.items()]
    motions = [
        _of_kind("motion", kind, model, meanings.MOTION[kind], cls)
        for kind, (model, cls) in keys.MOTIONS.items()
    ]
    meshed = create_model("MeshKeys", __base__=keys.MeshTable, depth=DEPTH)
    signals = [
        _of_kind("electrostatics.signal", kind, model, meanings.SIGNAL, CLASSES[kind])
        for kind, model in SIGNALS.items()
    ]
    frictions = [
        _of_kind("surface.friction_law", kind, model, meanings.FRICTION, cls)
        for kind, (model, cls) in keys.FRICTIONS.items()
    ]
    return [
        section("", keys.SceneTable, meanings.SCENE),
        _pad(),
        _tip(),
        section("finger", meshed, meanings.MESHED_FINGER, "mesh"),
        *_materials(),
        section("finger.electrical", keys.ElectricalTable, meanings.ELECTRICAL),
        *surfaces,
        *frictions,
        section("electrostatics", keys.ElectrostaticsTable, meanings.ELECTROSTATICS),
        *signals,
        *_roughness(),
        section("hand", keys.HandTable, meanings.HAND, origin=keys.Hand),
        section("solver", keys.SolverTable, meanings.SOLVER, origin=keys.Solver),
        section("solver.strategy", keys.StrategyTable, meanings.STRATEGY, origin=keys.Strategy),
        section("output", keys.OutputTable, meanings.OUTPUT, origin=keys.Output),
        *motions,
    ]


def _roughness() -> list[Section]:
    found = []
    for name, (model, cls) in keys.ROUGHNESS.items():
        one = section("electrostatics.roughness_gap", model, meanings.ROUGHNESS, name, cls)
        found.append(_kind_first(one, "law", name))
    return found


def schema() -> Schema:
    """The JSON schema of a scene file.

    >>> made = schema()
    >>> made["properties"]["surface"]["oneOf"][0]["title"], made["required"]
    ('flat', ['version', 'surface', 'motion'])
    """
    tables: dict[str, list[Section]] = {}
    for one in sections():
        tables.setdefault(one.name, []).append(one)
    one_of = {name: {"oneOf": [one.schema() for one in found]} for name, found in tables.items()}
    electrical = tables["finger.electrical"][0].schema()
    pad, tip, mesh = tables["finger"]
    fingers = [
        pad.schema(materials=_by_region("layer"), electrical=electrical),
        tip.schema(materials=_by_region("layer"), electrical=electrical),
        mesh.schema(materials=_by_region("material"), electrical=electrical),
    ]
    strategy = tables["solver.strategy"][0].schema()
    friction = {"$ref": "#/definitions/friction"}
    top = tables[""][0].schema(
        version={"const": 1, "description": meanings.SCENE["version"].meaning},
        finger={"anyOf": fingers},
        surface={"oneOf": [one.schema(friction_law=friction) for one in tables["surface"]]},
        electrostatics=tables["electrostatics"][0].schema(
            signal={"$ref": "#/definitions/signal"},
            roughness_gap={"anyOf": [{"type": "number"}, one_of["electrostatics.roughness_gap"]]},
        ),
        hand=tables["hand"][0].schema(),
        solver=tables["solver"][0].schema(strategy=strategy),
        output=tables["output"][0].schema(),
        motion={"type": "array", "minItems": 1, "items": one_of["motion"]},
    )
    described = {name: {"description": text.meaning} for name, text in meanings.SCENE.items()}
    for name, table in top["properties"].items():
        table |= described[name]
    laws = tables["finger.materials.NAME"]
    definitions = {
        "friction": one_of["surface.friction_law"],
        "material": one_of["finger.materials.NAME"],
        "layer": {"anyOf": [_without_law(laws[0]), {"$ref": "#/definitions/material"}]},
        "signal": {"oneOf": [_modulated(one) for one in tables["electrostatics.signal"]]},
    }
    return {"$schema": DRAFT, "title": "evfem scene", **top, "definitions": definitions}


def _by_region(definition: str) -> Schema:
    return {"type": "object", "additionalProperties": {"$ref": f"#/definitions/{definition}"}}


def _without_law(neo_hookean: Section) -> Schema:
    """A layer of the parametric finger keeps the law and the moduli that its table does not name."""
    found = neo_hookean.schema()
    found["properties"].pop("law")
    return found | {"title": "moduli", "required": []}


def _modulated(signal: Section) -> Schema:
    """The envelope of a carrier is a signal too, and so is a charge over time."""
    found = signal.schema()
    for name in {"envelope", "charge"} & {*found["properties"]}:
        text = found["properties"][name]["description"]
        options = [{"type": "number"}, {"$ref": "#/definitions/signal"}]
        found["properties"][name] = {"anyOf": options, "description": text}
    return found

"""Every key of a scene file with type, unit, default, what is allowed, and meaning: as rows to read,
and as a JSON schema (draft 7) for editors, both from the fields of the dataclasses that a file describes
(`evfem.common.checks.Key`, `evfem.scene.format`).

An editor completes and checks what the schema knows: each key by itself. What belongs together (a press to
a force or to an indentation) only the reader knows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args, get_origin

from evfem.circuit.signals import FOUND
from evfem.common.checks import Key, Within, keys_of
from evfem.common.units import AMOUNT, can_be_text
from evfem.electrostatics.laws import FORCE_LAWS
from evfem.electrostatics.roughness import LAWS as ROUGHNESS
from evfem.finger.fingerpad import Electrical, MeshedFinger
from evfem.finger.fingertip import FINGERS
from evfem.newton.strategy import Strategy
from evfem.scene import format as file
from evfem.scene.keys import VERSION
from evfem.scene.motion import MOTIONS, VOLTAGE
from evfem.scene.probes import Probe
from evfem.scene.scene import Output, Solver
from evfem.surface.adhesion import ADHESIONS
from evfem.surface.elastic import ElasticLayer
from evfem.surface.friction import KINDS as FRICTIONS
from evfem.terms.hand import Hand
from evfem.tissue.laws import LAWS

DRAFT = "http://json-schema.org/draft-07/schema#"
#: how types of JSON are called in a table to read
SPOKEN = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true, false"}
SPOKEN |= {"object": "table", "array": "list"}
JSON = {float: "number", int: "integer", str: "string", Literal: "string", bool: "boolean", list: "array"}
Schema = dict[str, Any]


@dataclass(frozen=True)
class Entry:
    """A key of a file: `default` as it would stand there, "" for none; `schema` is its JSON schema."""

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
    keys: tuple[Entry, ...]

    def schema(self, **more: Schema) -> Schema:
        """JSON schema of the table; `more` replaces or adds keys."""
        needed = [key.name for key in self.keys if key.required]
        named = {"title": self.kind} if self.kind else {}
        return named | {
            "type": "object",
            "additionalProperties": False,
            "properties": {key.name: key.schema for key in self.keys} | more,
            **({"required": needed} if needed else {}),
        }


def section(name: str, *classes: Any, kind: str = "", tag: tuple[str, str] | None = None) -> Section:
    """The keys of a table from its dataclasses; a `tag` is the key that says its kind, and the kind."""
    own = [*{key.name: _entry(key) for cls in classes for key in keys_of(cls)}.values()]
    if tag is not None:
        key, meaning = tag
        needed = kind != "pad"
        shape = {"const": kind, "description": meaning}
        own = [Entry(key, "text", "", "" if needed else '"pad"', needed, kind, meaning, shape), *own]
    return Section(name, kind, tuple(own))


def _entry(key: Key) -> Entry:
    rule, unit = key.rule, key.rule.get("unit", "")
    shape = _shape(key.types)
    if isinstance(limits := rule.get("test"), Within):
        shape |= _limits(limits, shape.get("type") == "integer")
    if "names" in rule:
        shape["enum"] = list(rule["names"])
    shape["description"] = key.documented
    if not key.required and isinstance(key.default, (bool, int, float, str)) and key.default != math.inf:
        shape["default"] = key.default
    default, spoken = "" if key.required else _toml(key.default), _spoken(shape)
    if shape.get("type") == "number" and can_be_text(unit):
        shape |= {"type": ["number", "string"], "pattern": AMOUNT.pattern}
    return Entry(key.name, spoken, unit, default, key.required, key.allowed, key.meaning, shape)


def _shape(types: tuple[Any, ...]) -> Schema:
    """A type in JSON, one of several where there are."""
    options: list[Schema] = []
    for one in types:
        shape: Schema = {"type": JSON.get(get_origin(one) or one, "object")}
        if shape["type"] == "array":
            shape["items"] = _shape(get_args(one))
        options += [shape] if shape not in options else []
    return options[0] if len(options) == 1 else {"anyOf": options}


def _limits(within: Within, whole: bool) -> Schema:
    def plain(value: float) -> float | int:
        return int(value) if whole else value

    found: Schema = {}
    if within.low > -math.inf:
        found["exclusiveMinimum" if within.above else "minimum"] = plain(within.low)
    if within.high < math.inf:
        found["exclusiveMaximum" if within.below else "maximum"] = plain(within.high)
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


def sections() -> list[Section]:
    """All tables of a scene file, in the order in which one is written."""
    finger = "the cross-section of a finger, or a whole pad in space"

    def kinds(
        name: str, found: Mapping[str, Any], meaning: str, tag: str = "kind", *more: Any
    ) -> list[Section]:
        return [section(name, cls, *more, kind=kind, tag=(tag, meaning)) for kind, cls in found.items()]

    return [
        section("", file.SceneTable),
        *kinds("finger", FINGERS, finger, "kind", file.Measured, file.BesideFinger),
        section("finger", MeshedFinger, file.BesideFinger, kind="mesh"),
        *kinds("finger.materials.NAME", LAWS, "the law", "law"),
        section("finger.electrical", Electrical),
        *kinds("surface", file.SURFACES, "which kind", "kind", file.BesideSurface),
        *kinds("surface.friction_law", FRICTIONS, "which kind"),
        section("surface.elastic", ElasticLayer),
        section("electrostatics", file.Electrostatics, *FORCE_LAWS.values()),
        *kinds("electrostatics.voltage", FOUND, "which kind"),
        *kinds("electrostatics.signal", file.SIGNALS, "which kind"),
        *kinds(
            "electrostatics.roughness_gap",
            ROUGHNESS,
            "how the gap depends on a node's contact pressure",
            "law",
        ),
        *kinds("adhesion", ADHESIONS, "which law", "law"),
        section("hand", Hand),
        section("solver", Solver),
        section("solver.strategy", Strategy),
        section("output", Output),
        section("output.probes.NAME", Probe),
        *kinds("motion", MOTIONS, "which kind"),
    ]


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
    fingers = []
    for one in tables["finger"]:
        law = {"$ref": f"#/definitions/{'material' if one.kind == 'mesh' else 'layer'}"}
        laws_by_region = {"type": "object", "additionalProperties": law}
        fingers.append(one.schema(materials=laws_by_region, electrical=electrical))
    friction, layer = {"$ref": "#/definitions/friction"}, tables["surface.elastic"][0].schema()
    beside: dict[str, Schema] = {"friction_law": friction}
    beside["elastic"] = {"anyOf": [layer, {"type": "array", "minItems": 1, "items": layer}]}
    volts: Schema = {"type": "number"} | _limits(VOLTAGE["test"], whole=False)
    probe = {"anyOf": [_shape((list[list[float]],)), tables["output.probes.NAME"][0].schema()]}
    inner: dict[str, Schema] = {
        "version": {"const": VERSION},
        "finger": {"anyOf": fingers},
        "surface": {"oneOf": [one.schema(**beside) for one in tables["surface"]]},
        "electrostatics": tables["electrostatics"][0].schema(
            voltage={"anyOf": [volts, one_of["electrostatics.voltage"]]},
            signal={"$ref": "#/definitions/signal"},
            roughness_gap={"anyOf": [{"type": "number"}, one_of["electrostatics.roughness_gap"]]},
        ),
        "adhesion": one_of["adhesion"],
        "hand": tables["hand"][0].schema(),
        "solver": tables["solver"][0].schema(strategy=tables["solver.strategy"][0].schema()),
        "output": tables["output"][0].schema(probes={"type": "object", "additionalProperties": probe}),
        "motion": {"type": "array", "minItems": 1, "items": one_of["motion"]},
    }
    (top,) = tables[""]
    told = {key.name: inner[key.name] | {"description": key.meaning} for key in top.keys}
    laws = tables["finger.materials.NAME"]
    definitions = {
        "friction": {"oneOf": [_nested(one, "friction") for one in tables["surface.friction_law"]]},
        "material": one_of["finger.materials.NAME"],
        "layer": {"anyOf": [_without_law(laws[0]), {"$ref": "#/definitions/material"}]},
        "signal": {"oneOf": [_nested(one, "signal") for one in tables["electrostatics.signal"]]},
    }
    return {"$schema": DRAFT, "title": "evfem scene", **top.schema(**told), "definitions": definitions}


def _without_law(neo_hookean: Section) -> Schema:
    """A layer of the parametric finger keeps the law and the moduli that its table does not name."""
    found = neo_hookean.schema()
    found["properties"].pop("law")
    return found | {"title": "moduli", "required": []}


#: keys of a definition's tables that are a number or that definition again: the envelope of a carrier, a
#: charge over time, the friction that a memory follows
NESTED = {"signal": {"envelope", "charge"}, "friction": {"friction"}}


def _nested(one: Section, definition: str) -> Schema:
    found = one.schema()
    for name in NESTED[definition] & {*found["properties"]}:
        text = found["properties"][name]["description"]
        options = [{"type": "number"}, {"$ref": f"#/definitions/{definition}"}]
        found["properties"][name] = {"anyOf": options, "description": text}
    return found

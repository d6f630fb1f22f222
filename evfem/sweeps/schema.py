"""Every key of a sweep file with type, unit, default, what is allowed, and meaning: as rows to read,
and as a JSON schema for editors (`evfem.scene.schema`).
"""

from __future__ import annotations

from evfem.scene import schema as scenes
from evfem.scene.keys import VERSION
from evfem.scene.schema import DRAFT, Schema, Section, section
from evfem.sweeps.file import DistributionTable, SweepTable
from evfem.sweeps.samples import Samples


def sections() -> list[Section]:
    """All tables of a sweep file but those of its scene."""
    return [
        section("", SweepTable),
        section("samples", Samples),
        section("samples.parameters.KEY", DistributionTable),
    ]


def schema() -> Schema:
    """The JSON schema of a sweep file.

    >>> made = schema()
    >>> made["required"], sorted(made["properties"]["samples"]["properties"])
    (['version', 'scene'], ['count', 'method', 'parameters', 'seed'])
    """
    top, samples, distribution = sections()
    scene = scenes.schema()
    definitions = scene.pop("definitions") | {"distribution": distribution.schema()}
    tables = {name: table for name, table in scene["properties"].items() if name != "version"}
    needed = [name for name in scene["required"] if name != "version"]
    table = {"type": "object", "additionalProperties": False, "properties": tables, "required": needed}
    # keys of distributions may be dotted, which makes tables in tables
    told = {key.name: key.meaning for key in (*top.keys, *samples.keys)}
    parameters = {"type": "object", "description": told["parameters"]}
    made = top.schema(
        version={"const": VERSION, "description": told["version"]},
        scene={"description": told["scene"], "anyOf": [{"type": "string"}, table]},
        samples={"description": told["samples"], **samples.schema(parameters=parameters)},
    )
    return {"$schema": DRAFT, "title": "evfem sweep", **made, "definitions": definitions}

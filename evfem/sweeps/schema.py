"""Every key of a sweep file with type, unit, default, what is allowed, and meaning: as rows to read,
and as a JSON schema for editors (`evfem.scene.schema`).
"""

from __future__ import annotations

from evfem.common.checks import Within
from evfem.scene import schema as scenes
from evfem.scene.meanings import Text
from evfem.scene.schema import DRAFT, Schema, Section, section
from evfem.sweeps.file import DistributionTable, SamplesTable, SweepTable
from evfem.sweeps.samples import MOST_SAMPLES

SWEEP = {
    "version": Text("", "version of the format", "1"),
    "scene": Text("", "what is varied: a file, or the tables of one without its version"),
    "grid": Text("", "keys of the scene with lists of values, or named rows of several keys"),
    "samples": Text("", "random values of keys, for each point of the grid"),
    "outputs": Text("", "last, mean, min or max of columns, .N of motion N alone"),
}
SAMPLES = {
    "count": Text("", "number of samples", "", Within(1, MOST_SAMPLES)),
    "seed": Text("", "the same seed gives the same samples", "", Within(0)),
    "method": Text("", "how they are drawn"),
    "parameters": Text("", "a distribution for each key"),
}
DISTRIBUTION = {
    "uniform": Text("", "every value as likely as any other"),
    "normal": Text("", "instead: a normal distribution"),
    "between": Text("", "where a normal distribution is cut off"),
}


def sections() -> list[Section]:
    """All tables of a sweep file but those of its scene."""
    return [
        section("", SweepTable, SWEEP),
        section("samples", SamplesTable, SAMPLES),
        section("samples.parameters.KEY", DistributionTable, DISTRIBUTION),
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
    parameters = {"type": "object", "description": SAMPLES["parameters"].meaning}
    made = top.schema(
        version={"const": 1, "description": SWEEP["version"].meaning},
        scene={"description": SWEEP["scene"].meaning, "anyOf": [{"type": "string"}, table]},
        samples={"description": SWEEP["samples"].meaning, **samples.schema(parameters=parameters)},
    )
    return {"$schema": DRAFT, "title": "evfem sweep", **made, "definitions": definitions}

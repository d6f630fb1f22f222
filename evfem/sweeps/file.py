"""What a sweep varies: grids and samples of dotted keys of a scene file; from TOML or from Python.

A point of a sweep is a whole scene, as the text of a scene file: the base scene with some keys
replaced. A dotted key names them as they stand in the file, entries of lists by their number:
`surface.friction`, `finger.electrical.stratum_corneum_eps_r`, `motion.0.force`. Only the scene
reader (`evfem.scene.file`) judges the values.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from itertools import product
from math import prod
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

import tomli_w

from evfem.common.checks import instance, real, set_frozen
from evfem.errors import InputError, describe_value
from evfem.scene import schema as scenes
from evfem.scene.file import read_text, scene_at, tables_of
from evfem.scene.format import SceneTable, dotted
from evfem.scene.keys import VERSION, names, read, shown
from evfem.scene.scene import Scene
from evfem.scene.schema import DRAFT, Schema, Section, section
from evfem.scene.serialiser import dump
from evfem.simulation.history import ROOM_COLUMNS, SPATIAL, no_column
from evfem.simulation.result import COLUMNS
from evfem.sweeps.keyunits import in_its_unit
from evfem.sweeps.samples import Distribution, Normal, Samples, Uniform


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


#: most points of a sweep
MOST_POINTS = 100_000
#: most dots of a key of a distribution
DEEPEST = 20
STATISTICS = ("last", "mean", "min", "max")
OUTPUTS = (
    "applied_force.last",
    "normal_force.last",
    "tangential_force.last",
    "electrostatic_force.last",
    "contact_width.last",
)
#: keys that stand for each other: a scene has one of them
ALTERNATIVES = {
    "voltage": ("amplitude",),
    "amplitude": ("voltage",),
    "force": ("indentation",),
    "indentation": ("force",),
}
#: columns of the table that every sweep has, before and after its own
FIRST, LAST = ("point",), ("status", "seconds", "message")
TABLES = tuple(name for name in names(SceneTable) if name != "version")
Row = Mapping[str, Any]
Pair = tuple[float, float]


@dataclass(frozen=True)
class Point:
    """One scene of a sweep: the names of its rows, its parameters, and its text as a scene file."""

    index: int
    labels: dict[str, str]
    parameters: dict[str, Any]
    text: str


@dataclass(frozen=True)
class Sweep:
    """A scene and what is varied in it: every combination of the grid, each with every sample.

    `scene` is a `Scene` that a file can hold, the path of a scene file, or its tables, in which paths
    are relative to `folder`. An entry of `grid` is a dotted key with a list of its values, or a name
    of your own with rows {row: {key: value, ...}} of keys that change together. `outputs` are
    `COLUMN.STATISTIC`: a column of the history and last, mean, min or max over its steps,
    `COLUMN.STATISTIC.N` over those of motion N alone; over the depth where the scene has one.

    >>> from evfem.scene.scene import default_scene
    >>> sweep = Sweep(default_scene(), grid={"surface.friction": [0.2, 0.3], "motion.0.force": [0.1, 0.2]})
    >>> len(sweep.points()), sweep.points()[1].parameters
    (4, {'surface.friction': 0.2, 'motion.0.force': 0.2})
    """

    scene: Scene | str | PathLike[str] | Mapping[str, Any]
    grid: Mapping[str, Sequence[Any] | Mapping[str, Row]] = field(default_factory=dict)
    samples: Samples | None = None
    outputs: Sequence[str] = OUTPUTS
    name: str = "sweep"
    folder: Path = Path()
    axes: list[list[tuple[dict[str, str], Row]]] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if not isinstance(self.scene, Mapping):
            set_frozen(self, scene=scene_at(self.scene))
        axes, grid = {name: _axis(name, entry) for name, entry in self.grid.items()}, {}
        for name, rows in axes.items():  # in Python's own types
            named = {label[name]: row for label, row in rows if label}
            grid[name] = named or [row[name] for _, row in rows]
        set_frozen(self, grid=grid, outputs=tuple(self.outputs), folder=Path(self.folder).resolve())
        set_frozen(self, axes=list(axes.values()))
        motions = len(self.tables.get("motion", ()))
        for output in self.outputs:
            check_output(output, motions)
        for key in self.samples.parameters if self.samples else ():
            check_key(f"samples.parameters.{key}", key)
        count = prod(map(len, axes.values())) * (self.samples.count if self.samples else 1)
        if not self.grid and self.samples is None:
            raise InputError("sweep", "nothing that varies", "a grid or samples")
        if count > MOST_POINTS:
            raise InputError("sweep", f"{count} points", f"at most {MOST_POINTS} points")
        twice = [column for column, number in Counter(self.columns).items() if number > 1]
        if twice:
            raise InputError(twice[0], "the same column twice", "different names of rows, keys and outputs")

    @property
    def tables(self) -> dict[str, Any]:
        """The base scene as the tables of a scene file."""
        return scene_tables(self.scene)

    @property
    def columns(self) -> tuple[str, ...]:
        return (*FIRST, *self.labels, *self.parameters, *self.outputs, *LAST)

    @property
    def labels(self) -> list[str]:
        """Names of the grid's entries that are rows of several keys."""
        return [name for name, entry in self.grid.items() if isinstance(entry, Mapping)]

    @property
    def parameters(self) -> list[str]:
        """All keys that vary, those of the grid first."""
        sampled = [] if self.samples is None else list(self.samples.parameters)
        return [*(key for axis in self.axes for key in axis[0][1]), *sampled]

    def points(self) -> list[Point]:
        """All points, the samples varying fastest and then the grid's last entry."""
        tables, axes, points = self.tables, list(self.axes), []
        if self.samples is not None:
            drawn = {key: values.tolist() for key, values in self.samples.draw().items()}
            rows = zip(*drawn.values(), strict=True)
            axes.append([({}, dict(zip(drawn, row, strict=True))) for row in rows])
        for index, chosen in enumerate(product(*axes)):
            labels: dict[str, str] = {}
            parameters: dict[str, Any] = {}
            for label, row in chosen:
                labels |= label
                parameters |= row
            scene = deepcopy(tables)
            drop_alternatives(scene, parameters)
            for key, value in parameters.items():
                put_in(scene, key, value)
            points.append(Point(index, labels, parameters, tomli_w.dumps(scene)))
        return points


def scene_tables(scene: Any) -> dict[str, Any]:
    """A scene, or the tables of one, as the tables of a scene file, to be changed."""
    return tomllib.loads(dump(scene)) if isinstance(scene, Scene) else deepcopy(dict(scene))


def _axis(name: str, entry: Any) -> list[tuple[dict[str, str], Row]]:
    """One entry of the grid: (label, keys and values) of each of its rows."""
    entry = entry.tolist() if hasattr(entry, "tolist") else entry  # numpy
    if not isinstance(entry, (Mapping, Sequence)) or isinstance(entry, str) or not entry:
        problem = "no values" if isinstance(entry, (Mapping, Sequence)) and not entry else shown(entry)
        raise InputError(f"grid.{name}", problem, "a list of values, or a table of named rows {key = value}")
    if not isinstance(entry, Mapping):
        check_key(f"grid.{name}", name)
        return [({}, {name: _value(f"grid.{name}", name, value)}) for value in entry]
    rows: list[tuple[dict[str, str], Row]] = []
    for label, row in entry.items():
        key = f"grid.{name}.{label}"
        if not isinstance(row, Mapping) or not row:
            raise InputError(key, shown(row), "a table {key = value, ...}")
        if rows and list(row) != list(rows[0][1]):
            raise InputError(key, ", ".join(row), f"the keys of the first row: {', '.join(rows[0][1])}")
        for one in row:
            check_key(key, one)
        rows.append(({name: str(label)}, {one: _value(key, one, value) for one, value in row.items()}))
    return rows


def _value(where: str, key: str, value: Any) -> Any:
    return in_its_unit(where, key, plain_value(where, value))


def is_key(key: str) -> bool:
    """Whether it may be a dotted key of a scene file."""
    return key.split(".")[0] in TABLES and "." in key


def check_key(where: str, key: str) -> None:
    """InputError unless `key` may be a dotted key of a scene file."""
    if not is_key(key):
        meant = f"{dotted(key)}? " if dotted(key) else ""
        allowed = f"{meant}TABLE.KEY of a scene file, TABLE one of {', '.join(TABLES)}"
        raise InputError(where, shown(key), allowed)


def plain_value(where: str, value: Any) -> Any:
    """The value in Python's own types, as a scene file can hold it."""
    value = value.tolist() if hasattr(value, "tolist") else value  # numpy
    if isinstance(value, (tuple, list)):
        return [plain_value(where, one) for one in value]
    if not isinstance(value, (bool, int, float, str)):
        raise InputError(where, describe_value(value), "numbers, text, true or false, and lists of them")
    return value


def drop_alternatives(tables: Any, keys: Collection[str]) -> None:
    """Remove from the tables of a scene the keys that these dotted ones stand for."""
    for key in keys:
        *names, last = key.split(".")
        here = tables
        for name in names:
            if isinstance(here, list):
                here = here[int(name)] if name.isdecimal() and int(name) < len(here) else None
            else:
                here = here.get(name) if isinstance(here, dict) else None
        for other in ALTERNATIVES.get(last, ()):
            if isinstance(here, dict) and ".".join((*names, other)) not in keys:
                here.pop(other, None)


def put_in(tables: Any, key: str, value: Any) -> None:
    """Replace one dotted key of the tables of a scene; tables that are not there are made."""
    here, names = tables, key.split(".")
    for depth, name in enumerate(names, 1):
        where: Any = name
        so_far = ".".join(names[:depth])
        if isinstance(here, list):
            if not (name.isdecimal() and int(name) < len(here)):
                allowed = f"numbers from 0 to {len(here) - 1} for the entries of this list"
                raise InputError(so_far, "no such entry", allowed)
            where = int(name)
        elif not isinstance(here, dict):
            raise InputError(so_far, "a key inside a value that is no table", "a key of a table")
        else:
            _refuse_dots(here, names[depth - 1 :], key)
        if depth == len(names):
            here[where] = value
        else:
            here = here.setdefault(where, {}) if isinstance(here, dict) else here[where]


def _refuse_dots(table: Mapping[str, Any], names: Sequence[str], key: str) -> None:
    """InputError for a key that goes through an entry of the table whose own name has a dot."""
    rest = ".".join(names)
    for name in table:
        if "." in name and rest.startswith(f"{name}."):
            allowed = "another name of that region, without dots: dots part the names of a key"
            raise InputError(key, f"{describe_value(name)}, a name with a dot, within a dotted key", allowed)


def check_output(output: Any, motions: int) -> None:
    """InputError unless `output` is COLUMN.STATISTIC[.N] of a scene with so many motions."""
    words = output.split(".") if isinstance(output, str) else []
    columns = [name for name in (*COLUMNS, *ROOM_COLUMNS, *SPATIAL) if name != "motion"]
    allowed = f"COLUMN.STATISTIC, STATISTIC one of {', '.join(STATISTICS)}, and .N for motion N alone"
    if not 2 <= len(words) <= 3 or words[1] not in STATISTICS:
        raise InputError("outputs", shown(output), allowed)
    if words[0] not in columns:
        raise no_column(f"outputs: {output}", words[0], columns)
    if len(words) == 3 and not (words[2].isdecimal() and int(words[2]) < motions):
        raise InputError("outputs", describe_value(output), f"motions from 0 to {motions - 1}")


@dataclass(frozen=True)
class SweepTable:
    """The whole sweep file."""

    version: Annotated[int, {"allowed": str(VERSION)}, "version of the format"]
    scene: Annotated[
        str | dict[str, Any],
        instance("the path of a scene file, or a table [scene] like one", str, dict),
        "what is varied: a file, or the tables of one without its version",
    ]
    grid: Annotated[
        dict[str, Any] | None,
        instance("a table [grid]", dict),
        "keys of the scene with lists of values, or named rows of several keys",
    ] = None
    samples: Annotated[
        dict[str, Any] | None,
        instance("a table [samples]", dict),
        "random values of keys, for each point of the grid",
    ] = None
    outputs: Annotated[
        list[str] | None,
        instance("a list of texts COLUMN.STATISTIC", list),
        "last, mean, min or max of columns, .N of motion N alone",
    ] = None


def _pair(allowed: str) -> dict[str, Any]:
    def check(key: str, value: Any) -> Pair:
        if not isinstance(value, list) or len(value) != 2:
            raise InputError(key, shown(value), allowed)
        return real(key, value[0], allowed), real(key, value[1], allowed)

    return {"allowed": allowed, "check": check, "type": list[float]}


@dataclass(frozen=True)
class DistributionTable:
    """One parameter in [samples.parameters]."""

    uniform: Annotated[Pair | None, _pair("[low, high]"), "every value as likely as any other"] = None
    normal: Annotated[Pair | None, _pair("[mean, sd]"), "instead: a normal distribution"] = None
    between: Annotated[Pair | None, _pair("[low, high]"), "where a normal distribution is cut off"] = None

    def made(self) -> Distribution:
        """The distribution."""
        if self.uniform is not None and self.normal is not None:
            raise InputError("normal", "normal beside uniform", "exactly one of the two")
        if self.normal is not None:
            return Normal(*self.normal, self.between)
        if self.uniform is None:
            raise InputError("uniform", "neither uniform nor normal", "exactly one of the two")
        if self.between is not None:
            raise InputError("between", "between beside uniform", "between with normal alone")
        return Uniform(*self.uniform)


def load(path: str | Path) -> Sweep:
    """The sweep in a TOML file, named like it, and paths in it relative to it; or InputError."""
    path = Path(path)
    return loads(read_text("sweep", path), path.parent, path.stem)


def loads(text: str, folder: str | Path = ".", name: str = "sweep") -> Sweep:
    """The sweep in a TOML text; the path of its scene starts at `folder`."""
    top = read(SweepTable, tables_of("sweep", text), "")
    folder, scene = Path(folder), top.scene
    if isinstance(scene, str):
        path = folder / scene
        folder, scene = path.parent, tables_of("scene", read_text("scene", path))
    samples = None if top.samples is None else _samples(top.samples)
    outputs = OUTPUTS if top.outputs is None else top.outputs
    return Sweep({"version": VERSION, **scene}, _grid(top.grid or {}), samples, outputs, name, folder)


def _grid(table: Mapping[str, Any]) -> dict[str, Any]:
    """The grid with dotted keys, whether the file has them in quotes or as tables in tables."""
    grid: dict[str, Any] = {}
    for name, entry in table.items():
        if name not in TABLES and isinstance(entry, dict):
            rows = entry.items()
            grid[name] = {key: dict(_flat(row)) if isinstance(row, dict) else row for key, row in rows}
        else:
            grid |= _flat({name: entry})
    return grid


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys and values of tables in tables; distributions are values."""
    if prefix.count(".") > DEEPEST:
        raise InputError(shown(prefix[:40]), "tables in tables", f"keys of at most {DEEPEST} names")
    for name, value in table.items():
        if isinstance(value, dict) and not {*value} & {*names(DistributionTable)}:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _samples(table: Mapping[str, Any]) -> Samples:
    if isinstance(problem := table.get("parameters"), Mapping):
        found = {}
        for key, value in _flat(problem):
            where = f"samples.parameters.{key}"
            if not isinstance(value, Mapping):
                raise InputError(where, shown(value), "{ uniform = [low, high] } or { normal = [mean, sd] }")
            found[key] = read(DistributionTable, value, where)
        table = {**table, "parameters": found}
    return read(Samples, table, "samples")

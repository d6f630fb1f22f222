"""The tables and keys of a scene file: strict models, and mistakes in them as one sentence each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields
from typing import Any, Literal, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic import Field as Key

from evfem.errors import ABSENT, InputError, near, readable, together, unknown
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp
from evfem.scene.scene import COUPLINGS, DIRECTIONS, Output, Solver
from evfem.solver.strategy import Strategy

# A field's description is what an error says is allowed.


class Table(BaseModel):
    """A table whose unknown keys and wrong types are mistakes."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _optional(allowed: str, default: Any = None) -> Any:
    return Key(default=default, description=allowed)


def _required(allowed: str) -> Any:
    return Key(description=allowed)


def derived(cls: type, **own: Any) -> type[Table]:
    """The table of a dataclass: its fields' names, types and defaults, and what their rules allow.

    `own`: keys that are not in the file what they are in the dataclass. A class with a `kind` is
    chosen by that key, which the caller has looked at.
    """
    types = get_type_hints(cls)
    keys: dict[str, Any] = {"kind": (str, _required("a kind"))} if hasattr(cls, "kind") else {}
    for spec in fields(cls):
        default = ... if spec.default is MISSING else spec.default
        keys[spec.name] = types[spec.name], Key(default=default, description=spec.metadata.get("allowed"))
    return create_model(f"{cls.__name__}Table", __base__=Table, **(keys | own))


class SceneTable(Table):
    """The whole file."""

    version: int
    finger: dict[str, Any] = _optional("a table [finger]", {})
    surface: dict[str, Any] = _required("a table [surface] with a kind: flat | sinusoid | profile")
    electrostatics: dict[str, Any] | None = _optional("a table [electrostatics]")
    solver: dict[str, Any] = _optional("a table [solver]", {})
    output: dict[str, Any] = _optional("a table [output]", {})
    motion: list[dict[str, Any]] = Key(min_length=1, description="one or more tables [[motion]]")


class MeshTable(Table):
    """[finger] with a mesh of the user's own."""

    mesh: str = _required("the path of a mesh file")
    regions: dict[str, int] | None = _optional("a table name = number")
    materials: dict[str, dict[str, Any]] = _required("a table [finger.materials.NAME] for every region")
    electrical: dict[str, Any] = _optional("a table [finger.electrical]", {})
    viscosity: float = _optional("a relaxation time in s, not negative", 0.0)


class ElectricalTable(Table):
    """[finger.electrical]."""

    stratum_corneum_thickness: float | None = _optional("a thickness in mm, up to 10")
    stratum_corneum_eps_r: float = _optional("a relative permittivity, at least 1", 1650.0)


_FRICTION = "a number, not negative, or rows [[x, coefficient], ...]"


class FlatTable(Table):
    """[surface] of the kind flat; the other kinds have its keys too."""

    kind: Literal["flat"]
    friction: float | list[list[float]] = _optional(_FRICTION, 0.3)
    y: float | None = _optional("a height in mm")


class SinusoidTable(FlatTable):
    """[surface] of the kind sinusoid."""

    kind: Literal["sinusoid"]  # type: ignore[assignment]
    terms: list[list[float]] | None = _optional("rows [[amplitude in mm, wavenumber in 1/mm, phase], ...]")


class ProfileTable(FlatTable):
    """[surface] of the kind profile."""

    kind: Literal["profile"]  # type: ignore[assignment]
    file: str | None = _optional("the path of a csv file with the header x,height")
    points: list[list[float]] | None = _optional("rows [[x, height], ...] in mm")


class ElectrostaticsTable(Table):
    """[electrostatics]."""

    law: Literal["strong_troxel", "kaczmarek"] = _required("strong_troxel | kaczmarek")
    voltage: float | None = _optional("a voltage in V")
    voltage_file: str | None = _optional("the path of a csv file (header: position,voltage) or of a .wav")
    voltage_profile: list[list[float]] | None = _optional("rows [[position, voltage], ...] in mm and V")
    insulator_thickness: float = _required("a thickness in mm, not negative")
    insulator_eps_r: float = _required("a relative permittivity, at least 1")
    gap_eps_r: float = _optional("a relative permittivity, at least 1", 1.0)
    air_layer: bool = _optional("true | false", True)
    direction: Literal[DIRECTIONS] = _optional(" | ".join(DIRECTIONS), DIRECTIONS[0])  # type: ignore[valid-type]
    coupling: Literal[COUPLINGS] = _optional(" | ".join(COUPLINGS), COUPLINGS[0])  # type: ignore[valid-type]


SolverTable = derived(Solver, strategy=(dict[str, Any], _optional("a table [solver.strategy]", {})))
StrategyTable = derived(Strategy)
OutputTable = derived(Output)

SURFACES: Mapping[str, type[Table]] = {
    "flat": FlatTable,
    "sinusoid": SinusoidTable,
    "profile": ProfileTable,
}
MOTIONS: Mapping[str, tuple[type[Table], type]] = {
    cls.kind: (derived(cls), cls) for cls in (Press, Slide, Hover, VoltageRamp)
}

T = TypeVar("T", bound=Table)


def parse(model: type[T], table: Mapping[str, Any], prefix: str) -> T:
    """The checked table, or all mistakes in it, one of each key: first unknown keys, then others but
    the lack of what an unknown one may stand for.
    """
    try:
        return model.model_validate(table)
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=False)
    known = list(model.model_fields)
    mistakes: dict[str, InputError] = {}
    meant: set[str] = set()
    for one in sorted(found, key=lambda e: e["type"] != "extra_forbidden"):
        name, *deeper = map(str, one["loc"])
        key = _join(prefix, name) + "".join(f"[{part}]" for part in deeper if part.isdecimal())
        if one["type"] == "extra_forbidden":
            mistakes[name] = unknown(key, name, known)
            meant |= {*near(name, known)}
        elif name not in mistakes and not (one["type"] == "missing" and name in meant):
            given = ABSENT if one["type"] == "missing" else shown(one["input"])
            allowed = model.model_fields[name].description or "another value"
            mistakes[name] = InputError(key, given, allowed)
    raise together(list(mistakes.values()))


def _join(prefix: str, name: str) -> str:
    return f"{prefix}.{name}" if prefix else name


def shown(value: object) -> str:
    """A value as it stands in the file, cut to a readable length."""
    text = str(value).lower() if isinstance(value, bool) else readable(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _table_of(key: str) -> str:
    return re.split(r"[.\[]", key)[0]


@contextmanager
def at(prefix: str, **renamed: str) -> Iterator[None]:
    """Errors raised inside name the key as it stands in the file, under `prefix`."""
    try:
        yield
    except InputError as error:
        raise together([_moved(one, prefix, renamed) for one in error.mistakes]) from error


def _moved(mistake: InputError, prefix: str, renamed: Mapping[str, str]) -> InputError:
    key = renamed.get(mistake.key.replace(" ", "_").replace(".", "_"), mistake.key)
    key = key if _table_of(key) == _table_of(prefix) else _join(prefix, key)
    given = (
        mistake.given if mistake.given is ABSENT or isinstance(mistake.given, str) else shown(mistake.given)
    )
    return InputError(key, given, mistake.allowed)

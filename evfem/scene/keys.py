"""The tables and keys of a scene file: strict models, and mistakes in them as one sentence each."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic import Field as Key

from evfem.errors import InputError, readable
from evfem.scene.motion import HOLDS, Hover, Press, Slide, VoltageRamp
from evfem.scene.scene import CONTACTS, COUPLINGS, DIRECTIONS, DYNAMICS, ELEMENTS

# A field's description is what an error says is allowed.


class Table(BaseModel):
    """A table whose unknown keys and wrong types are mistakes."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def _optional(allowed: str, default: Any = None) -> Any:
    return Key(default=default, description=allowed)


def _required(allowed: str) -> Any:
    return Key(description=allowed)


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


class SolverTable(Table):
    """[solver]."""

    element: str | None = _optional(" | ".join(ELEMENTS))
    dynamics: str = _optional(" | ".join(DYNAMICS), "quasistatic")
    contact: str = _optional(" | ".join(CONTACTS), "exact")
    penalty_normal: float | None = _optional("a penalty in N/mm3, larger than 0")
    penalty_tangential: float | None = _optional("a penalty in N/mm3, larger than 0")
    tolerance: float = _optional("a relative residual from 1e-13 to 1e-3", 1e-8)
    threads: int = _optional("a whole number, at least 1", 1)
    strategy: dict[str, Any] = _optional("a table [solver.strategy]", {})


class StrategyTable(Table):
    """[solver.strategy]."""

    iterations: int = _optional("a whole number, at least 1", 40)
    patience: float = _optional("a number of iterations, not negative", 8.0)
    smallest_part: float = _optional("a share of a step, above 0, at most 1", 1.0 / 1024.0)
    easy: int = _optional("a whole number, at least 1", 8)
    growth: float = _optional("a factor from 1 to 10", 1.25)
    reach: float = _optional("a factor from 0 to 10", 1.5)


class OutputTable(Table):
    """[output]."""

    every: int = _optional("a whole number, at least 1", 1)


_STEPS = "a whole number, at least 1"
_SPEED = "a speed in mm/s, larger than 0"


class PressTable(Table):
    """[[motion]] of the kind press."""

    kind: Literal["press"]
    force: float | None = _optional("a force in N/mm, not negative")
    indentation: float | None = _optional("an indentation in mm between -200 and 200")
    steps: int = _optional(_STEPS, 10)
    speed: float | None = _optional(_SPEED)


class SlideTable(Table):
    """[[motion]] of the kind slide."""

    kind: Literal["slide"]
    distance: float = _required("a distance in mm, not 0")
    steps: int = _optional(_STEPS, 100)
    speed: float | None = _optional(_SPEED)
    hold: Literal[HOLDS] = _optional(" | ".join(HOLDS), HOLDS[0])  # type: ignore[valid-type]


class HoverTable(Table):
    """[[motion]] of the kind hover."""

    kind: Literal["hover"]
    gap: float = _required("a gap in mm, not negative")
    steps: int = _optional(_STEPS, 1)


class VoltageTable(Table):
    """[[motion]] of the kind voltage."""

    kind: Literal["voltage"]
    voltage: float = _required("a voltage in V")
    steps: int = _optional(_STEPS, 10)
    hold: Literal[HOLDS] = _optional(" | ".join(HOLDS), HOLDS[0])  # type: ignore[valid-type]


SURFACES: Mapping[str, type[Table]] = {
    "flat": FlatTable,
    "sinusoid": SinusoidTable,
    "profile": ProfileTable,
}
MOTIONS: Mapping[str, tuple[type[Table], type]] = {
    "press": (PressTable, Press),
    "slide": (SlideTable, Slide),
    "hover": (HoverTable, Hover),
    "voltage": (VoltageTable, VoltageRamp),
}

T = TypeVar("T", bound=Table)


def parse(model: type[T], table: Mapping[str, Any], prefix: str) -> T:
    """The checked table, or the first mistake in it; an unknown key comes before what it may stand for."""
    try:
        return model.model_validate(table)
    except ValidationError as error:
        found = error.errors(include_url=False, include_context=False)
    first = min(found, key=lambda e: e["type"] != "extra_forbidden")
    name, *deeper = first["loc"]
    key = _join(prefix, str(name)) + "".join(f"[{part}]" for part in deeper if isinstance(part, int))
    if first["type"] == "extra_forbidden":
        raise unknown(key, str(name), list(model.model_fields))
    allowed = model.model_fields[str(name)].description or "another value"
    raise InputError(key, "nothing" if first["type"] == "missing" else shown(first["input"]), allowed)


def unknown(key: str, name: str, known: list[str]) -> InputError:
    """The error for a key that does not exist, with the one that may have been meant."""
    close = difflib.get_close_matches(name[:40], known, n=1)
    hint = f"{close[0]}? (" if close else ""
    return InputError(key, "an unknown key", hint + ", ".join(known) + (")" if close else ""))


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
        key = renamed.get(error.key.replace(" ", "_").replace(".", "_"), error.key)
        key = key if _table_of(key) == _table_of(prefix) else _join(prefix, key)
        given = error.given if isinstance(error.given, str) else shown(error.given)
        raise InputError(key, given, error.allowed) from error

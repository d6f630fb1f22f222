"""The tables and keys of a scene file: strict models, and mistakes in them as one sentence each."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, Literal, TypeVar, get_type_hints

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic import Field as Key

from evfem.contact.friction import KINDS
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.drive import WAVEFORMS
from evfem.electrostatics.laws import INSULATORS
from evfem.electrostatics.roughness import LAWS as ROUGHNESS_LAWS
from evfem.electrostatics.timesignals import FASTEST
from evfem.errors import ABSENT, InputError, near, readable, together, unknown
from evfem.finger.fingerpad import FingerPad
from evfem.scene.motion import Hover, Press, Slide, VoltageRamp, Wait
from evfem.scene.scene import COUPLINGS, DIRECTIONS, FIELDS, Output, Solver
from evfem.solver.hand import Hand
from evfem.solver.strategy import Strategy

# A field's description is what an error says is allowed.


class Table(BaseModel):
    """A table whose unknown keys and wrong types are mistakes."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


def optional(allowed: str, default: Any = None) -> Any:
    """A key that may be left out."""
    return Key(default=default, description=allowed)


def required(allowed: str) -> Any:
    """A key that must be there."""
    return Key(description=allowed)


def derived(cls: type, **own: Any) -> type[Table]:
    """The table of a dataclass: its fields' names, types and defaults, and what their rules allow.

    `own`: keys that are not in the file what they are in the dataclass. A class with a `kind` is
    chosen by that key, which the caller has looked at.
    """
    types = get_type_hints(cls)
    keys: dict[str, Any] = {"kind": (str, required("a kind"))} if hasattr(cls, "kind") else {}
    for spec in fields(cls):
        default = ... if spec.default is MISSING else spec.default
        keys[spec.name] = types[spec.name], Key(default=default, description=spec.metadata.get("allowed"))
    return create_model(f"{cls.__name__}Table", __base__=Table, **(keys | own))


class SceneTable(Table):
    """The whole file."""

    version: int
    finger: dict[str, Any] = optional("a table [finger]", {})
    surface: dict[str, Any] = required(
        "a table [surface] with a kind: flat | sinusoid | profile | grating | self_affine"
    )
    electrostatics: dict[str, Any] | None = optional("a table [electrostatics]")
    hand: dict[str, Any] | None = optional("a table [hand]")
    solver: dict[str, Any] = optional("a table [solver]", {})
    output: dict[str, Any] = optional("a table [output]", {})
    motion: list[dict[str, Any]] = Key(min_length=1, description="one or more tables [[motion]]")


class MeshTable(Table):
    """[finger] with a mesh of the user's own."""

    mesh: str = required("the path of a mesh file")
    regions: dict[str, int] | None = optional("a table name = number")
    materials: dict[str, dict[str, Any]] = required("a table [finger.materials.NAME] for every region")
    electrical: dict[str, Any] = optional("a table [finger.electrical]", {})
    viscosity: float = optional("a relaxation time in s, not negative", 0.0)


class ElectricalTable(Table):
    """[finger.electrical]."""

    stratum_corneum_thickness: float | None = optional("a thickness in mm, up to 10")
    stratum_corneum_eps_r: float = optional("a relative permittivity, at least 1", 1650.0)


_FRICTION = "a number, not negative, or rows [[x, coefficient], ...]"


class FlatTable(Table):
    """[surface] of the kind flat; the other kinds have its keys too."""

    kind: Literal["flat"]
    friction: float | list[list[float]] = optional(_FRICTION, 0.3)
    friction_law: dict[str, Any] | None = optional("a table [surface.friction_law] with a kind")
    y: float | None = optional("a height in mm")


class SinusoidTable(FlatTable):
    """[surface] of the kind sinusoid."""

    kind: Literal["sinusoid"]  # type: ignore[assignment]
    terms: list[list[float]] | None = optional("rows [[amplitude in mm, wavenumber in 1/mm, phase], ...]")


class ProfileTable(FlatTable):
    """[surface] of the kind profile."""

    kind: Literal["profile"]  # type: ignore[assignment]
    file: str | None = optional("the path of a csv file with the header x,height")
    points: list[list[float]] | None = optional("rows [[x, height], ...] in mm")


class GratingTable(FlatTable):
    """[surface] of the kind grating."""

    kind: Literal["grating"]  # type: ignore[assignment]
    period: float = required("a length in mm, larger than 0")
    groove_depth: float = required("a depth in mm, larger than 0")
    groove_width: float | None = optional("a width in mm at half depth, below the period")
    wall_width: float | None = optional("a width in mm up to that of ridge and groove")
    phase: float = optional("a part of the period, -1 to 1", 0.0)


class SelfAffineTable(FlatTable):
    """[surface] of the kind self_affine."""

    kind: Literal["self_affine"]  # type: ignore[assignment]
    hurst: float = required("a Hurst exponent from 0 to 1")
    rms: float = required("a root mean square height in mm, larger than 0")
    period: float = optional("a length in mm after which it repeats", 10.0)
    shortest: float = optional("a wavelength in mm up to the longest", 0.2)
    longest: float | None = optional("a wavelength in mm up to the period")
    seed: int = optional("a whole number, not negative", 0)


class ElectrostaticsTable(Table):
    """[electrostatics]."""

    law: Literal["strong_troxel", "kaczmarek"] = required("strong_troxel | kaczmarek")
    voltage: float | None = optional("a voltage in V")
    amplitude: float | None = optional("a peak voltage in V, not negative")
    frequency: float | None = optional(f"a frequency in Hz, above 0, up to {FASTEST:g}")
    waveform: Literal[WAVEFORMS] = optional(" | ".join(WAVEFORMS), WAVEFORMS[0])  # type: ignore[valid-type]
    skin: str | None = optional(f"{' | '.join(SKINS)} | the path of a csv file")
    gap_conductivity: float = optional("a conductivity in S/m, not negative", 0.0)
    drive: Literal["mean", "resolved"] | None = optional("mean | resolved")
    voltage_file: str | None = optional(
        "the path of a csv file (header: position,voltage or time,voltage) or of a .wav"
    )
    voltage_profile: list[list[float]] | None = optional("rows [[position, voltage], ...] in mm and V")
    signal: dict[str, Any] | None = optional("a table [electrostatics.signal] with a kind")
    insulator: Literal[tuple(INSULATORS)] | None = optional(" | ".join(INSULATORS))  # type: ignore[valid-type]
    insulator_thickness: float | None = optional("a thickness in mm, not negative")
    insulator_eps_r: float | None = optional("a relative permittivity, at least 1")
    gap_eps_r: float = optional("a relative permittivity, at least 1", 1.0)
    air_layer: bool = optional("true | false", True)
    direction: Literal[DIRECTIONS] = optional(" | ".join(DIRECTIONS), DIRECTIONS[0])  # type: ignore[valid-type]
    field: Literal[FIELDS] = optional(" | ".join(FIELDS), FIELDS[0])  # type: ignore[valid-type]
    electrodes: list[list[float]] | None = optional("rows [[from, to, share], ...] in mm, with gaps between")
    grounded: bool = optional("true | false", True)
    coupling: Literal[COUPLINGS] = optional(" | ".join(COUPLINGS), COUPLINGS[0])  # type: ignore[valid-type]
    roughness_gap: float | dict[str, Any] = optional(
        "a length in mm from 0 to 1, or a table [electrostatics.roughness_gap] with a law", 0.0
    )


SolverTable = derived(Solver, strategy=(dict[str, Any], optional("a table [solver.strategy]", {})))
StrategyTable = derived(Strategy)
HandTable = derived(Hand)
OutputTable = derived(Output)

FRICTIONS: Mapping[str, tuple[type[Table], type]] = {kind: (derived(cls), cls) for kind, cls in KINDS.items()}
ROUGHNESS: Mapping[str, tuple[type[Table], type]] = {
    name: (derived(cls, law=(Literal[name], required("a law"))), cls) for name, cls in ROUGHNESS_LAWS.items()
}
SURFACES: Mapping[str, type[Table]] = {
    "flat": FlatTable,
    "sinusoid": SinusoidTable,
    "profile": ProfileTable,
    "grating": GratingTable,
    "self_affine": SelfAffineTable,
}
MOTIONS: Mapping[str, tuple[type[Table], type]] = {
    cls.kind: (derived(cls), cls) for cls in (Press, Slide, Hover, VoltageRamp, Wait)
}
#: tables that a key may have been meant for
HOMES: Mapping[str, Collection[str]] = {
    "[finger]": ("depth", *(spec.name for spec in fields(FingerPad))),
    "[finger.electrical]": ElectricalTable.model_fields,
    "[electrostatics]": ElectrostaticsTable.model_fields,
    "[surface]": FlatTable.model_fields,
    "[solver]": SolverTable.model_fields,
    "[output]": OutputTable.model_fields,
    "[[motion]]": {key for table, _ in MOTIONS.values() for key in table.model_fields},
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
            mistakes[name] = unknown_key(key, name, known)
            meant |= {*near(name, known)}
        elif name not in mistakes and not (one["type"] == "missing" and name in meant):
            given = ABSENT if one["type"] == "missing" else shown(one["input"])
            allowed = model.model_fields[name].description or "another value"
            mistakes[name] = InputError(key, given, allowed)
    raise together(list(mistakes.values()))


def unknown_key(key: str, name: str, known: Sequence[str]) -> InputError:
    """The error for a key that its table does not have, and which table has it.

    >>> raise unknown_key("surface.insulator_eps_r", "insulator_eps_r", ["kind", "friction"])
    Traceback (most recent call last):
    evfem.errors.InputError: surface.insulator_eps_r: given an unknown key; allowed: kind, friction; \
insulator_eps_r stands in [electrostatics]
    """
    mistake = unknown(key, name, known)
    home = next((table for table, keys in HOMES.items() if name in keys), "")
    here = re.sub(r"\[\d+\]", "", key.rpartition(".")[0])  # whose other kinds may have it
    if home.strip("[]") in ("", here) or near(name, known):
        return mistake
    return InputError(key, mistake.given, f"{mistake.allowed}; {name} stands in {home}")


def check_size(key: str, path: Path, most: int) -> None:
    """Raise InputError for a path that is no file, or a file of more than `most` bytes."""
    try:
        size = path.stat().st_size
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the path
        reason = getattr(error, "strerror", None) or "no path"
        given = f"{shown(str(path))} ({reason})"
        raise InputError(key, given, "a file that exists and can be read") from error
    if not path.is_file():
        raise InputError(key, f"{path}, which is no file", "a file")
    if size > most:
        raise InputError(key, f"{path} with {size / 2**20:.0f} MB", f"a file of at most {most // 2**20} MB")


def columns(key: str, rows: list[list[float]]) -> tuple[list[float], list[float]]:
    """Rows of two numbers as two columns."""
    for i, row in enumerate(rows):
        if len(row) != 2:
            raise InputError(f"{key}[{i}]", shown(row), "a row of two numbers")
    return [row[0] for row in rows], [row[1] for row in rows]


def kind_of(table: Mapping[str, Any], prefix: str, kinds: Mapping[str, Any], key: str = "kind") -> str:
    """The kind that a table says it is by its `key`, one of `kinds`."""
    kind = table.get(key, ABSENT)
    if not isinstance(kind, str) or kind not in kinds:
        given = ABSENT if kind is ABSENT else shown(kind)
        raise InputError(f"{prefix}.{key}", given, " | ".join(kinds))
    return kind


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

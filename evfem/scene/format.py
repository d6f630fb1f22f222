"""The tables of a scene file whose keys are not the fields of one object, and which tables there are.

Such a table is a dataclass like the others, with a method `made` that makes of its keys what they describe.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.circuit.signalfile import read_voltage
from evfem.circuit.signals import FOUND, FollowForce, VoltageProfile
from evfem.common.checks import Within, among, instance, keys_of, number, one_of, real, yes_or_no
from evfem.common.tables import TABLES
from evfem.electrostatics import timesignals
from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.drive import Conductivity, Drive, DriveFrequency, Skin, Waveform
from evfem.electrostatics.laws import FORCE_LAWS, INSULATORS, SOLID, STRENGTH, STRONG, Layer
from evfem.electrostatics.timesignals import RATE, START, Sampled
from evfem.errors import ABSENT, MEANT, InputError, Mistakes
from evfem.finger.fingerpad import Electrical, FingerPad
from evfem.scene.keys import VERSION, at, columns, names, shown
from evfem.scene.motion import MOTIONS, VOLTAGE
from evfem.scene.scene import (
    DEPTH,
    AirLayer,
    Breakdown,
    Coupling,
    Direction,
    FieldChoice,
    Grounded,
    Output,
    RoughnessGap,
    Solver,
)
from evfem.surface import textures
from evfem.surface.adhesion import ADHESIONS
from evfem.surface.relief import Relief
from evfem.surface.surfaces import Angle, Flat, Friction, GivesWay, Insulator, Profile, Shift

Table = Mapping[str, Any]
Pairs = list[list[float]]
_HEIGHTS = "the path of a csv file with the header x,height"
_RELIEF = "the path of a csv file with the header x,z,height"
_CSV = {"file": lambda name: name.lower().endswith(TABLES)}
_SIGNAL = instance(
    f"a table [electrostatics.signal] with kind = {' | '.join(timesignals.SIGNALS)}", timesignals.TimeSignal
)
_SIGNAL |= {"type": dict, "kinds": lambda: SIGNALS}
_VOLTAGE = number(f"{VOLTAGE['allowed']}, or a table with a kind: {' | '.join(FOUND)}", VOLTAGE["test"], "V")
_VOLTAGE |= {"type": float | dict, "kinds": lambda: FOUND}


def _layers(allowed: str, test: Within, unit: str = "") -> dict[str, Any]:
    """Rule of a number, or of one for each layer of an insulator."""
    allowed += ", or a list of them from the top"

    def check(key: str, value: Any) -> Any:
        if isinstance(value, list) and value:
            return [real(f"{key}.{i}", one, allowed, test, unit) for i, one in enumerate(value)]
        return real(key, value, allowed, test, unit)

    return {"allowed": allowed, "check": check, "test": test, "unit": unit}


def _rows(allowed: str, unit: str) -> dict[str, Any]:
    return instance(allowed, list, unit=unit)


def _path(allowed: str) -> dict[str, Any]:
    return {"file": True} | instance(allowed, str, Path)


def _table(name: str, more: str = "") -> dict[str, Any]:
    return {"allowed": f"a table [{name}]{more}"}


@dataclass(frozen=True, kw_only=True)
class SceneTable:
    """The whole file."""

    version: Annotated[int, {"allowed": str(VERSION)}, "version of the format"]
    finger: Annotated[
        Table | None, _table("finger"), "the finger; without it that of the paper's Table 2"
    ] = None
    surface: Annotated[
        Table, _table("surface", f" with a kind: {' | '.join(textures.SURFACES)}"), "what the finger touches"
    ]
    electrostatics: Annotated[
        Table | None, _table("electrostatics"), "insulator, voltage and force law; without it no attraction"
    ] = None
    adhesion: Annotated[
        Table | None,
        _table("adhesion", f" with a law: {' | '.join(ADHESIONS)}"),
        "what attracts without a voltage; without it nothing",
    ] = None
    hand: Annotated[
        Table | None, _table("hand"), "between drive and bone; without it the drive moves the bone itself"
    ] = None
    solver: Annotated[
        Table | None, _table("solver"), "how the scene is solved; the defaults are the recommended ones"
    ] = None
    output: Annotated[Table | None, _table("output"), "which fields are kept"] = None
    motion: Annotated[
        list[Table],
        instance("one or more tables [[motion]]", list),
        "what happens, one table [[motion]] after the other",
    ]


@dataclass(frozen=True)
class Measured:
    """The key of a parametric [finger] that is no parameter of its kind."""

    participant: Annotated[
        str | None, {"allowed": "i to xi"}, "sizes of one of Table 1's fingers; other keys go before"
    ] = None


@dataclass(frozen=True)
class BesideFinger:
    """The key of [finger] that is the scene's."""

    depth: Annotated[float | None, DEPTH, "of a finger in the plane; adds forces in N, areas in mm2"] = None


@dataclass(frozen=True)
class BesideSurface:
    """The keys of [surface] that stand in tables of their own."""

    friction_law: Annotated[
        Table | None,
        _table("surface.friction_law", " with a kind"),
        "what the coefficient means; without it Coulomb's law",
    ] = None
    elastic: Annotated[
        Table | list[Table] | None,
        {"allowed": "a table [surface.elastic], or several [[surface.elastic]] from the top"},
        "how the surface gives way; without it it is rigid",
    ] = None


@dataclass(frozen=True)
class ProfileTable:
    """[surface] of the kind profile."""

    file: Annotated[str | None, _path(_HEIGHTS), "heights over x"] = None
    points: Annotated[
        Pairs | None, _rows("rows [[x, height], ...] in mm", "mm"), "the same in the scene file"
    ] = None
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None
    angle: Angle = 0.0

    def made(self) -> Profile:
        """The profile of the file or of the points."""
        names = ("friction", "y", "insulator", "elastic", "angle")
        common: Any = {name: getattr(self, name) for name in names}
        if (self.file is None) == (self.points is None):
            given = ABSENT if self.file is None else "file and points"
            raise InputError("surface.file", given, _HEIGHTS)
        if self.points is not None:
            return Profile(*columns("surface.points", self.points), **common)
        return Profile.from_csv(self.file or "", **common)


@dataclass(frozen=True)
class ReliefTable:
    """[surface] of the kind relief."""

    file: Annotated[str | None, _path(_RELIEF), "heights over x and z"] = None
    x: Annotated[list[float] | None, instance("x in mm", list, unit="mm"), "of the heights' columns"] = None
    z: Annotated[list[float] | None, instance("z in mm", list, unit="mm"), "of the heights' rows"] = None
    height: Annotated[
        Pairs | None, _rows("heights in mm, a row for each z", "mm"), "the same in the scene file"
    ] = None
    friction: Friction = 0.3
    y: Shift = None
    insulator: Insulator = None
    elastic: GivesWay = None

    def made(self) -> Relief:
        """The surface of the file or of the heights."""
        common: Any = {name: getattr(self, name) for name in ("friction", "y", "insulator", "elastic")}
        here = [name for name in ("x", "z", "height") if getattr(self, name) is not None]
        if len(here) != (0 if self.file is not None else 3):
            given = " and ".join([*(["file"] if self.file is not None else []), *here]) or ABSENT
            raise InputError("surface.file", given, f"{_RELIEF}; or x, z and height")
        if self.file is not None:
            return Relief.from_csv(self.file, **common)
        return Relief(self.x, self.z, self.height, **common)


@dataclass(frozen=True)
class SampledTable:
    """[electrostatics.signal] of the kind sampled."""

    file: Annotated[
        str | None, _path("the path of a csv file with the header time,voltage, or of a .wav"), "the samples"
    ] = None
    full_scale: Annotated[
        float | None,
        number("the voltage of the largest sample of a .wav, 1.0 of floats", Within(), "V"),
        "of a .wav",
    ] = None
    voltage: Annotated[
        list[float] | None, instance("samples in V", list, unit="V"), "the samples in the scene file"
    ] = None
    rate: Annotated[float | None, RATE, "of the samples in the scene file"] = None
    start: Annotated[
        float | None,
        START | {"allowed": "the time of the first sample in s; not with a csv file"},
        "time of the first sample",
    ] = None
    repeat: Annotated[bool, yes_or_no(), "whether it begins anew at its end"] = False

    def made(self) -> Sampled:
        """The samples of the file, or as they stand in the table."""
        file = self.file if self.file is None else Path(self.file)
        wav = file is not None and file.suffix.lower() == ".wav"
        usable = {"repeat", "file"} | ({"full_scale", "start"} if wav else set())
        if file is None:
            usable = {"repeat", "voltage", "rate", "start"}
            if self.voltage is None or self.rate is None:
                raise InputError(
                    "electrostatics.signal", "neither file nor voltage with rate", "one of the two"
                )
        for name in (spec.name for spec in fields(self)):
            if (value := getattr(self, name)) is not None and name not in usable:
                beside = "voltage" if file is None else f"the file {file.name}"
                raise InputError(name, f"{shown(value)} beside {beside}", "nothing here")
        if file is None:
            return Sampled(self.voltage, self.rate or 0.0, self.start or 0.0, self.repeat)
        with at("electrostatics.signal", {"path": "electrostatics.signal.file"}):
            if wav:
                return Sampled.from_wav(file, self.full_scale, start=self.start or 0.0, repeat=self.repeat)
            return Sampled.from_csv(file, repeat=self.repeat)


SIGNALS: Mapping[str, Any] = {**timesignals.SIGNALS, "sampled": SampledTable}


@dataclass(frozen=True)
class Electrostatics:
    """[electrostatics]: law, voltage and drive of a scene, and the insulator of its surface."""

    law: Annotated[str, among(FORCE_LAWS), "force law of the paper, eqs (2) to (5)"]
    voltage: Annotated[
        float | FollowForce | None, _VOLTAGE, "effective, across skin and insulator, prescribed or found"
    ] = None
    amplitude: Annotated[
        float | None,
        number("a peak voltage in V, from 0 to 1e6", Within(0.0, 1e6), "V"),
        "peak, instead of voltage",
    ] = None
    frequency: DriveFrequency = None
    waveform: Waveform = "sine"
    skin: Annotated[Skin, instance(f"{' | '.join(SKINS)} | the path of a csv file", str, Path), _CSV] = None
    gap_conductivity: Conductivity = 0.0
    drive: Annotated[
        str | None,
        one_of("mean", "resolved"),
        "attraction by its mean over the cycle, or resolved in time with its charges",
    ] = None
    voltage_file: Annotated[
        str | None,
        _path("the path of a csv file (header: position,voltage or time,voltage) or of a .wav"),
        "voltage over the position, instead of a number",
    ] = None
    voltage_profile: Annotated[
        Pairs | None,
        _rows("rows [[position, voltage], ...] in mm and V", "mm, V"),
        "the same in the scene file",
    ] = None
    signal: Annotated[Any, _SIGNAL, "voltage over time, instead of a number"] = None
    insulator: Annotated[str | None, one_of(*INSULATORS), "a usual insulator by its name"] = None
    insulator_thickness: Annotated[
        float | list[float] | None,
        _layers("a thickness in mm, not negative", Within(0.0), "mm"),
        "of the display's insulator",
    ] = None
    insulator_eps_r: Annotated[
        float | list[float] | None,
        _layers("a relative permittivity, at least 1", Within(1.0)),
        "its relative permittivity",
    ] = None
    insulator_strength: Annotated[
        float | list[float] | None,
        _layers(STRENGTH, STRONG, "V/mm"),
        f"field above which it breaks down; {SOLID:g} without",
    ] = None
    air_layer: AirLayer = True
    direction: Direction = "vertical"
    field: FieldChoice = "local"
    electrodes: Annotated[
        Pairs | None,
        _rows("rows [[from, to, fraction], ...] in mm, with gaps between", "mm, 1"),
        "where electrodes end, and their fraction of the voltage; with field full",
    ] = None
    grounded: Grounded = True
    coupling: Coupling = "monolithic"
    breakdown: Breakdown = "warn"
    roughness_gap: RoughnessGap = 0.0

    def layer(self) -> Layer | list[Layer]:
        """The insulator by its name, or by thickness and permittivity of one layer or of several."""
        own = self._sizes()
        if self.insulator_strength is not None:
            own["insulator_strength"] = self.insulator_strength
        thickness = own["insulator_thickness"]
        several, count = np.ndim(thickness), np.size(thickness)
        for name, value in own.items():
            if (np.ndim(value), np.size(value)) != (several, count):
                given = f"{np.size(value)} beside {count} of insulator_thickness"
                raise InputError(f"electrostatics.{name}", given, "as many, from the top")
        names = [name.removeprefix("insulator_") for name in own]
        if not several:
            return Layer(**dict(zip(names, own.values(), strict=True)))
        return [Layer(**dict(zip(names, one, strict=True))) for one in zip(*own.values(), strict=True)]

    def _sizes(self) -> dict[str, Any]:
        """Thickness and permittivity as they are given, or those of the insulator with the given name."""
        own = {name: getattr(self, name) for name in ("insulator_thickness", "insulator_eps_r")}
        mistakes = Mistakes()
        for name, value in own.items():
            if self.insulator is not None and value is not None:
                told = value if isinstance(value, list) else f"{value:g}"
                given = f"{told} beside insulator = {self.insulator}"
                raise InputError(f"electrostatics.{name}", given, "one of the two")
            with mistakes.of_a_part():
                if self.insulator is None and value is None:
                    allowed = next(key.allowed for key in keys_of(Electrostatics) if key.name == name)
                    allowed = f"{allowed}; or insulator = {' | '.join(INSULATORS)}"
                    raise InputError(f"electrostatics.{name}", ABSENT, allowed)
        mistakes.report()
        if self.insulator is None:
            return own
        named = INSULATORS[self.insulator]
        return {"insulator_thickness": named.thickness, "insulator_eps_r": named.eps_r}

    def scene_keys(self, law: Any, ramped: bool) -> dict[str, Any]:
        """What it says of a scene beside its law; `ramped`: the voltage may begin without one."""
        names = ("air_layer", "breakdown", "direction", "field", "grounded", "roughness_gap")
        own = {"law": law, "voltage": self._voltage(not ramped)}
        return own | {"drive": self._drive()} | {name: getattr(self, name) for name in names}

    def _voltage(self, needed: bool) -> Any:
        names = ("voltage", "amplitude", "voltage_file", "voltage_profile", "signal")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) > 1 or (needed and not given):
            allowed = "exactly one of voltage (V), amplitude (V), voltage_file and signal"
            raise InputError("electrostatics.voltage", " and ".join(given) or ABSENT, allowed)
        key = "electrostatics.voltage_file"
        if self.voltage_file is not None:
            with at(key, {"voltage_file": key, "path": key}):
                return read_voltage(Path(self.voltage_file))
        if self.voltage_profile is not None:
            with at("electrostatics.voltage_profile"):
                return VoltageProfile(*columns("electrostatics.voltage_profile", self.voltage_profile))
        if self.amplitude is not None:
            return self.amplitude / timesignals.WAVEFORMS[self.waveform].crest
        return self.signal or self.voltage or 0.0

    def _drive(self) -> Drive | None:
        """The drive, None where no key asks for one; a number is its own mean over the cycle."""
        usual = {"frequency": None, "waveform": "sine", "skin": None, "gap_conductivity": 0.0, "drive": None}
        given = {name: getattr(self, name) for name in usual}
        if given == usual or (given == usual | {"drive": "mean"} and self.signal is None):
            return None
        with at("electrostatics"):
            return Drive(resolved=given.pop("drive") == "resolved", **given)


SURFACES: Mapping[str, Any] = {**textures.SURFACES, "profile": ProfileTable, "relief": ReliefTable}


#: tables that a key may have been meant for -> what has their keys
HOMES: Mapping[str, tuple[Any, ...]] = {
    "[finger]": (Measured, BesideFinger, FingerPad),
    "[finger.electrical]": (Electrical,),
    "[electrostatics]": (Electrostatics,),
    "[surface]": (BesideSurface, Flat),
    "[solver]": (Solver,),
    "[output]": (Output,),
    "[[motion]]": tuple(MOTIONS.values()),
}


def dotted(name: str) -> str:
    """The dotted key that a bare one may mean, or one in a table that there is not; nothing for none.

    >>> dotted("friction"), dotted("tilt"), dotted("speed"), dotted("colour")
    ('surface.friction', '', 'motion.0.speed', '')
    >>> dotted("display.insulator_thickness")
    'electrostatics.insulator_thickness'
    """
    name = name.rpartition(".")[2]
    for meant in (name, *MEANT.get(name.lower(), "").split()):
        for table, classes in HOMES.items():
            if meant in names(*classes):
                return f"{table.strip('[]')}.{meant}".replace("motion.", "motion.0.")
    return ""

"""The voltage of a scene file: a number, a file, rows over the position, or a signal over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from evfem.common.checks import Within, real
from evfem.electrostatics.dielectrics import SKINS, DielectricTable, dielectric
from evfem.electrostatics.drive import CREST, Drive
from evfem.electrostatics.signalfile import read_voltage
from evfem.electrostatics.signals import VoltageProfile
from evfem.electrostatics.timesignals import Carrier, ChargeControl, OpenCircuit, Sampled, Sine, Square
from evfem.errors import ABSENT, InputError
from evfem.protocols import TimeSignal
from evfem.scene.keys import (
    Table,
    at,
    check_size,
    columns,
    derived,
    kind_of,
    optional,
    parse,
    required,
    shown,
)

#: keys of [electrostatics] that give a voltage
KEYS = ("voltage", "amplitude", "voltage_file", "voltage_profile", "signal")
#: largest file in bytes
LARGEST = 64 * 2**20

SineTable = derived(Sine)
SquareTable = derived(Square)
OpenCircuitTable = derived(OpenCircuit)
ChargeTable = derived(
    ChargeControl, charge=(float | dict[str, Any], required("a charge in nC/mm, or a signal of charges"))
)
CarrierTable = derived(Carrier, envelope=(float | dict[str, Any], required("a voltage in V, or a signal")))


class SampledTable(Table):
    """A signal of the kind sampled."""

    kind: Literal["sampled"]
    file: str | None = optional("the path of a csv file with the header time,voltage, or of a .wav")
    full_scale: float | None = optional("the voltage of the largest sample of a .wav, in V")
    voltage: list[float] | None = optional("samples in V")
    rate: float | None = optional("a rate in Hz, with samples in voltage")
    start: float | None = optional("the time of the first sample in s; not with a csv file")
    repeat: bool = optional("true | false", False)


#: kind of a signal whose keys are its fields -> its class
MADE: Mapping[str, Any] = {cls.kind: cls for cls in (Sine, Square, Carrier, OpenCircuit, ChargeControl)}
SIGNALS: Mapping[str, type[Table]] = {
    "sine": SineTable,
    "square": SquareTable,
    "carrier": CarrierTable,
    "sampled": SampledTable,
    "open_circuit": OpenCircuitTable,
    "charge": ChargeTable,
}


def voltage_of(table: Any, needed: bool, folder: Path) -> Any:
    """The voltage of the table [electrostatics], 0 where none is given nor `needed`; paths start
    at `folder`.
    """
    if table.amplitude is not None:
        real(
            "electrostatics.amplitude",
            table.amplitude,
            "a peak voltage in V, from 0 to 1e6",
            Within(0.0, 1e6),
        )
    given = [name for name in KEYS if getattr(table, name) is not None]
    if len(given) > 1 or (needed and not given):
        allowed = "exactly one of voltage (V), amplitude (V), voltage_file and signal"
        raise InputError("electrostatics.voltage", " and ".join(given) or ABSENT, allowed)
    if table.voltage_file is not None:
        path = folder / table.voltage_file
        check_size("electrostatics.voltage_file", path, LARGEST)
        key = "electrostatics.voltage_file"
        with at(key, voltage_file=key, path=key):
            return read_voltage(path)
    if table.voltage_profile is not None:
        with at("electrostatics.voltage_profile"):
            return VoltageProfile(*columns("electrostatics.voltage_profile", table.voltage_profile))
    if table.signal is not None:
        return _signal(table.signal, "electrostatics.signal", folder)
    if table.amplitude is not None:
        return float(table.amplitude) / CREST[table.waveform]
    return table.voltage or 0.0


#: keys of [electrostatics] that make a drive of it, with what they are without one
DRIVE = {"frequency": None, "waveform": "sine", "skin": None, "gap_conductivity": 0.0, "drive": None}


def drive_of(table: Any, folder: Path) -> Drive | None:
    """The drive of the table [electrostatics], None where no key asks for one."""
    given = {name: getattr(table, name) for name in DRIVE}
    alone = {name: value for name, value in given.items() if value != DRIVE[name]}
    if not alone or (alone == {"drive": "mean"} and table.signal is None):
        return None
    resolved = given.pop("drive") == "resolved"
    with at("electrostatics"):
        if given["skin"] is not None and given["skin"] not in SKINS:
            path = folder / given["skin"]
            if path.suffix.lower() != ".csv":
                dielectric(given["skin"])
            check_size("electrostatics.skin", path, LARGEST)
            given["skin"] = DielectricTable.from_csv(path)
        return Drive(**given, resolved=resolved)


def _signal(table: Mapping[str, Any], prefix: str, folder: Path) -> TimeSignal:
    kind = kind_of(table, prefix, SIGNALS)
    parsed: Any = parse(SIGNALS[kind], table, prefix)
    values = {name: getattr(parsed, name) for name in SIGNALS[kind].model_fields if name != "kind"}
    if kind == "sampled":
        return _sampled(values, prefix, folder)
    for name in {"envelope", "charge"} & {*values}:
        if isinstance(values[name], dict):
            values[name] = _signal(values[name], f"{prefix}.{name}", folder)
    with at(prefix):
        return MADE[kind](**values)


def _sampled(values: dict[str, Any], prefix: str, folder: Path) -> Sampled:
    """Samples from a file, or as they stand in the table."""
    file, rate = values["file"], values["rate"]
    wav = file is not None and Path(file).suffix.lower() == ".wav"
    usable = {"repeat", "file"} | ({"full_scale", "start"} if wav else set())
    if file is None:
        usable = {"repeat", "voltage", "rate", "start"}
        if values["voltage"] is None or rate is None:
            raise InputError(prefix, "neither file nor voltage with rate", "one of the two")
    for name, value in values.items():
        if value is not None and name not in usable:
            beside = "voltage" if file is None else f"the file {file}"
            raise InputError(f"{prefix}.{name}", f"{shown(value)} beside {beside}", "nothing here")
    start = values["start"] or 0.0
    with at(prefix, path=f"{prefix}.file"):
        if file is None:
            return Sampled(values["voltage"], rate, start, values["repeat"])
        path = folder / file
        check_size(f"{prefix}.file", path, LARGEST)
        if wav:
            return Sampled.from_wav(path, values["full_scale"], start=start, repeat=values["repeat"])
        return Sampled.from_csv(path, repeat=values["repeat"])

"""Attraction drawn at random: law, insulator, and a voltage that is constant, ramped,
over the position or over time, below 60 V/um in the insulator and 3000 V.
"""

from evfem.electrostatics.dielectrics import SKINS
from evfem.electrostatics.laws import INSULATORS
from evfem.electrostatics.roughness import DISTRIBUTIONS

from .tables import Draw, Tables, six_digits

LARGEST_FIELD = 60e3  # V/mm
LARGEST_VOLTAGE = 3000.0
#: the random numbers that distributions of gaps are drawn with
LOCAL = 8
#: those of what breakdown does
SPARKS = 9


def electrostatics(random: Draw) -> Tables:
    """Everything but the voltage, which depends on the motions."""
    table: Tables = {"law": random.one_of("strong_troxel", "kaczmarek")}
    if random.chance(0.1):
        table["insulator"] = random.one_of(*INSULATORS)
    else:
        table["insulator_thickness"] = random.spread(0.005, 0.5)
        table["insulator_eps_r"] = random.spread(1.5, 20.0)
    if random.chance(0.15):
        table["air_layer"] = False
    if random.chance(0.15):
        table["direction"] = "normal"
    if random.chance(0.05):
        table["gap_eps_r"] = random.between(1.0, 5.0)
    if random.chance(0.15):
        random.one_of(1, 2, 3)  # was the coupling: scenes of a seed stay as they were
    return table


def add_roughness(random: Draw, tables: Tables) -> None:
    """Perhaps rough faces: a gap, or a law of the contact pressure."""
    if "electrostatics" not in tables or not random.chance(0.25):
        return
    law, gap = random.one_of("constant", "power", "exponential"), random.spread(2e-4, 0.01)
    found: Tables = {"law": law, "gap": gap}
    if law == "power":
        found |= {"pressure": random.spread(1e-3, 0.1), "exponent": random.spread(0.05, 1.0)}
        found["open_gap"] = six_digits(gap * random.between(1.5, 10.0))
    elif law == "exponential":
        found = {"law": law, "decay": gap, "pressure": random.spread(0.1, 10.0)}
        found["open_gap"] = six_digits(gap * random.between(2.0, 10.0))
    whole = gap if law == "constant" and random.chance(0.5) else found
    tables["electrostatics"]["roughness_gap"] = whole


def add_distribution(random: Draw, tables: Tables) -> None:
    """Perhaps local gaps around the mean ones, unless charges are resolved."""
    table = tables.get("electrostatics", {})
    rough = table.get("roughness_gap")
    if isinstance(rough, dict) and table.get("drive") != "resolved" and random.chance(0.5):
        rough["distribution"] = random.one_of(*DISTRIBUTIONS)


def add_breakdown(random: Draw, tables: Tables) -> None:
    """Perhaps air that is not looked at, or whose field is held where nothing alternates."""
    table = tables.get("electrostatics", {})
    if not table or not random.chance(0.3):
        return
    rough = table.get("roughness_gap")
    found = isinstance(table.get("voltage"), dict) or any("gap" in one for one in tables["motion"])
    spread = isinstance(rough, dict) and "distribution" in rough
    held = not (found or spread or {"drive", "frequency", "skin", "field"} & set(table))
    table["breakdown"] = random.one_of("limit", "warn", "off") if held else random.one_of("warn", "off")


def add_drive(random: Draw, tables: Tables) -> None:
    """Perhaps an alternating voltage with what conducts: by its mean, or resolved where time passes."""
    table, kinds = tables.get("electrostatics", {}), [one["kind"] for one in tables["motion"]]
    if table.get("signal", {}).get("kind") == "sine" and random.chance(0.3):
        kept = {name: table["signal"][name] for name in ("frequency", "amplitude")}
        table["signal"] = {"kind": "square", **kept}
    timed = "wait" in kinds and "voltage" not in kinds and table.get("direction") != "normal"
    if timed and table.get("signal", {}).get("kind") == "sine" and random.chance(0.3):
        table["signal"] = _charged(random, table["signal"], largest_voltage(table))
        table |= {"drive": "resolved", "gap_conductivity": random.spread(1e-10, 1e-6)}
        return
    if not table or not random.chance(0.25):
        return
    found: Tables = {"waveform": random.one_of("sine", "square"), "skin": random.one_of(*SKINS)}
    found |= {"gap_conductivity": random.spread(1e-10, 1e-6), "frequency": random.spread(10.0, 1e5)}
    signal = table.get("signal", {})
    if signal.get("kind") == "carrier" and not signal["resolved"]:
        del found["frequency"]
    elif timed and signal and signal["kind"] != "sampled":
        del found["frequency"]
        found["drive"] = "resolved"
    elif timed and "voltage" in table:
        wait = tables["motion"][kinds.index("wait")]
        found |= {"drive": "resolved", "frequency": six_digits(wait["steps"] / (20.0 * wait["duration"]))}
    elif signal.get("kind") == "carrier":
        return
    repeats = signal.get("kind") in ("sine", "square") or signal.get("repeat", False)
    if repeats and "drive" not in found:  # the mean is over its own cycle
        del found["frequency"]
    if "voltage" in table and "voltage" not in kinds and random.chance(0.5):
        table["amplitude"] = abs(table.pop("voltage"))
    table |= found


def _charged(random: Draw, signal: Tables, most: float) -> Tables:
    """An electrode that is disconnected, or has a charge: at 0.2 mm over 10 mm a nC takes 2260 V."""
    if random.chance(0.5):
        return {"kind": "open_circuit", "voltage": signal["amplitude"], "after": random.between(0.0, 0.01)}
    return {"kind": "charge", "charge": six_digits(random.between(0.02, 0.2) * most / 2260.0)}


def add_field(random: Draw, tables: Tables) -> None:
    """Perhaps the full field, where the scene has what it needs."""
    table = tables.get("electrostatics", {"law": ""})
    driven = {"frequency", "waveform", "drive", "skin", "gap_conductivity"} & set(table)
    if table["law"] != "strong_troxel" or driven or not table.get("air_layer", True):
        return
    if random.chance(0.2):
        table["field"] = random.one_of("auto", "full")


def largest_voltage(table: Tables) -> float:
    """The voltage below 3000 V with 60 V/um in the insulator (V)."""
    if "insulator" in table:
        return min(LARGEST_VOLTAGE, LARGEST_FIELD * float(INSULATORS[table["insulator"]].thickness))
    return min(LARGEST_VOLTAGE, LARGEST_FIELD * table["insulator_thickness"])


def add_voltage(random: Draw, tables: Tables) -> None:
    """A constant voltage, one along the way or over time, or the targets of the ramps."""
    if "electrostatics" not in tables:
        return
    table, ramps = tables["electrostatics"], [one for one in tables["motion"] if one["kind"] == "voltage"]
    most = largest_voltage(table)

    def volts() -> float:
        return six_digits(random.between(0.02, 1.0) * most * random.one_of(1.0, 1.0, -1.0))

    for ramp in ramps:
        ramp["voltage"] = 0.0 if random.chance(0.3) else volts()
    waits = [one for one in tables["motion"] if one["kind"] == "wait"]
    if waits and not ramps and random.chance(0.7):
        table["signal"] = _signal(random, waits[0], abs(volts()))
    elif ramps or random.chance(0.8):
        table["voltage"] = 0.0 if ramps and random.chance(0.5) else volts()
    else:
        places = random.places(random.whole(2, 12), -6.0, 6.0)
        kept = [x for i, x in enumerate(places) if i == 0 or x - places[i - 1] > 1e-3]
        table["voltage_profile"] = [[x, abs(volts())] for x in kept]


def _signal(random: Draw, wait: Tables, most: float) -> Tables:
    """A signal in time whose cycles the steps of a wait resolve."""
    kind, frequency = random.one_of("sine", "carrier", "sampled"), wait["steps"] / (8.0 * wait["duration"])
    share = random.between(0.05, 0.95)
    amplitude = six_digits(most * share)
    sine: Tables = {"kind": "sine", "frequency": six_digits(frequency), "amplitude": amplitude}
    sine |= {"bias": six_digits(most - amplitude), "phase": random.between(0.0, 6.28)}
    if kind == "sine":
        return sine
    if kind == "carrier":
        resolved = random.chance(0.5)
        table: Tables = {"kind": kind, "frequency": six_digits(frequency), "resolved": resolved}
        return table | {"envelope": most if resolved else sine | {"frequency": six_digits(0.3 * frequency)}}
    samples = [six_digits(most * random.between(0.0, 1.0)) for _ in range(random.whole(2, 12))]
    table = {"kind": kind, "rate": six_digits(2.0 * frequency), "voltage": samples}
    return table | {"start": six_digits(-0.3 / frequency), "repeat": random.chance(0.5)}

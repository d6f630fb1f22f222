"""What an amplifier sees of a finger, and whether the air holds, as columns of the history.

Under a drive by its mean the load is a sum of admittances (`evfem.electrostatics.alternating`), one of
each node of the pad with its own gap and tributary area, over the harmonics of the voltage. Of a bias
there is no current, and of a square wave, the drive's or a signal, the harmonics up to the 31st count: an
ideal edge has an infinite current, these have that of edges of 1/64 of the period. Samples are straight in
between, so that an edge takes one of them. Resolved in time all three are those of the charges, `current_rms`
and `power` over the step, which a jump takes.

The air between two faces holds up to Paschen's voltage (`evfem.electrostatics.breakdown`), which the peak
of the voltage across a gap must not reach, and a layer of the insulator up to the field of its `strength`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.rooms import Column, Room
from evfem.electrostatics.alternating import admittance, voltage_fraction
from evfem.electrostatics.breakdown import Limited, breakdown_voltage
from evfem.electrostatics.laws import eps_0
from evfem.electrostatics.localgaps import roughness_below
from evfem.electrostatics.timesignals import ChargeControl, OpenCircuit

#: of lengths in mm: C/mm2 per V/mm, and W per N mm/s
PER_MM, MILLI = 1e-3 * eps_0, 1e-3
COLUMNS = (
    Column("charge", "C/mm", "of the electrode, effective; of the moment where it is resolved in time"),
    Column("current_rms", "A/mm", "into the electrode, effective, from the amplifier"),
    Column("power", "W/mm", "mean, from the amplifier"),
)
#: relative rounding of times and charges; work of a source without current that is told, over the energy
SAME, OF_NO_CURRENT = 1e-9, 0.01
#: those that are means over each step where the voltage is resolved in time
STEP_MEANS = ("current_rms", "power")


def _fractions(model: Any, pad: Any) -> tuple[Any, Any]:
    """Fractions (P,) of the voltage of the electrodes below the nodes of a pad, and which have one below."""
    electrodes, x = getattr(model.surface, "electrodes", None), pad.position[:, 0]
    ones = None if electrodes is None else [(a, b, 1.0) for a, b, _ in electrodes]
    return voltage_fraction(electrodes, x), voltage_fraction(ones, x)


def finger_potential(model: Any, over: Floats, each: Any) -> Any:
    """Potential of the finger over the voltage: 0 where it is grounded, else where as much current leaves it
    as enters, by columns of the admittances `each` (P,) over the fractions `over` (P,) of the voltage.
    """
    return 0.0 if model.scene.grounded else np.sum(over * each) / np.sum(each)


def admittance_of(model: Any, attraction: Any, pad: Any, frequency: float) -> complex:
    """Current over voltage of a pad in S (in the plane S/mm), where electrodes have fractions of a source."""
    over, there = _fractions(model, pad)
    each = there * nodal_admittances(attraction, pad, model.closing.electrics, frequency)
    return complex(np.sum(over * (over - finger_potential(model, over, each)) * each))


def nodal_admittances(attraction: Any, pad: Any, electrics: Any, frequency: float) -> Any:
    """Current over voltage (P,), complex, in S (in the plane S/mm), of the nodes of a pad."""
    conductivity = 0.0 if electrics.drive is None else electrics.drive.gap_conductivity
    layers = electrics.layers_at(frequency)
    stack = frequency, layers, conductivity, electrics.gap_eps_r
    return attraction.carrying(pad) * attraction.over_gaps(pad, lambda gap: admittance(gap, *stack))


class Load(Room):
    """Charge, current and power of a drive by its mean over the cycle."""

    columns = COLUMNS

    def values(self, model: Any, state: Any) -> Mapping[str, float]:
        pad, electrics = model.equilibrium.pad_state(state), model.closing.electrics
        order, share = electrics.harmonics
        order, share = order[electrics.smooth], share[electrics.smooth]
        frequency = electrics.frequency * order
        found = np.array([admittance_of(model, model.attraction.parts[0], pad, one) for one in frequency])
        volts = abs(state.voltage)
        square = share * np.abs(found) ** 2
        return {
            "charge": volts * float(np.sqrt(np.sum(square / (2.0 * np.pi * frequency) ** 2))),
            "current_rms": volts * float(np.sqrt(np.sum(square))),
            "power": volts**2 * float(np.sum(share * found.real)),
        }


class Supply(Room):
    """Charge, current and power of a voltage that is resolved in time."""

    columns = COLUMNS

    def values(self, model: Any, state: Any) -> Mapping[str, float]:
        attraction = model.attraction.parts[0]
        charged = attraction.charged(model.equilibrium.pad_state(state))
        work, _, square, seconds = state.memory["supplied"].tolist()
        time = seconds if seconds > 0.0 else np.inf
        return {
            "charge": PER_MM * attraction.charging.electrode_charge(charged),
            "current_rms": PER_MM * _root(square / time),
            "power": MILLI * work / time,
        }

    def doubts(self, scene: Any, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        if not isinstance(scene.voltage, (ChargeControl, OpenCircuit)):
            return
        times, after = np.array([row["time"] for row in rows]), getattr(scene.voltage, "after", 0.0)
        late = np.flatnonzero((times[1:] > after * (1.0 + SAME)) & (times[:-1] < after * (1.0 - SAME)))
        for k in late[:1] + 1:
            yield (
                f"step {rows[k]['step']}: the electrode is disconnected at the end of this step, "
                f"{times[k]:g} s, not at {after:g} s within it: let a step end there"
            )
        yield from _of_no_current(rows, times >= after * (1.0 - SAME))


def _of_no_current(rows: Sequence[Mapping[str, Any]], kept: Any) -> Iterator[str]:
    """A sentence if the source works while the charge stays: the works of a step are those of the voltage
    that it began with.
    """
    charge, work, energy = (
        np.array([row.get(name, 0.0) for row in rows]) for name in ("charge", "source_work", "field_energy")
    )
    stays = np.abs(np.diff(charge)) <= SAME * np.abs(charge[1:])
    found = float(np.abs(np.diff(work)[stays & kept[:-1]]).sum())
    if found > OF_NO_CURRENT * float(energy.max()):
        unit = "N mm" if "contact_area" in rows[0] else "N mm/mm"
        yield (
            f"source_work changes by {found:.2g} {unit} although no charge flows, and electrostatic_work is "
            "wrong by as much, where the charge leaks the voltage too: both less with shorter steps in which "
            "the kept charge moves"
        )


def _root(mean_square: float) -> float:
    """Its square root; nan below 0, as differences for the derivatives of a current that is 0 may be."""
    return math.sqrt(mean_square) if mean_square >= 0.0 else math.nan


class Air(Room):
    """How near the air is to breakdown: the largest voltage of a gap over Paschen's."""

    columns = (
        Column("breakdown", "", "largest peak voltage of a gap over that at which air breaks down"),
        Column("breakdown_x", "mm", "x of the node above that gap, of the undeformed pad"),
    )

    def values(self, model: Any, state: Any) -> Mapping[str, float]:
        pad, attraction = model.equilibrium.pad_state(state), model.attraction.parts[0]
        gap = attraction.over_gaps(pad, lambda gap: gap)
        over = self._voltages(model, pad, gap) / np.asarray(breakdown_voltage(gap))
        over = np.where(attraction.weights(pad) > 0.0, over, 0.0)
        worst = int(over.argmax())
        place = float(model.mesh.points[pad.pad.nodes[worst], 0]) if over[worst] > 0.0 else 0.0
        return {"breakdown": float(over[worst]), "breakdown_x": place}

    def _voltages(self, model: Any, pad: Any, gap: Floats) -> Any:
        """Peak voltages of the gaps (P,)."""
        attraction, electrics = model.attraction.parts[0], model.closing.electrics
        if electrics.resolved:
            return np.abs(attraction.charging.across(attraction.charged(pad)))
        volts = abs(pad.voltage) * electrics.peak_across(gap, attraction.layers)
        over, there = _fractions(model, pad)
        if model.scene.grounded:
            return volts * np.abs(over)
        if electrics.conducts:
            each = nodal_admittances(attraction, pad, electrics, electrics.frequency)
        else:
            each = attraction.carrying(pad) / (gap + electrics.gap_eps_r * electrics.reduced)
        return volts * there * np.abs(over - finger_potential(model, over, there * each))

    def doubts(self, scene: Any, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        yield from self._sparks(scene, rows)
        yield from self._fails(scene, rows)

    def _sparks(self, scene: Any, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        over = np.array([row.get("breakdown", 0.0) for row in rows])
        worst = int(over.argmax())
        row = rows[worst]
        if over[worst] <= 1.0:
            return
        held = ", where the law holds the field" if scene.breakdown == "limit" else ""
        where = f"at x = {row['breakdown_x']:.2g} mm of the pad in step {row['step']}"
        much = f"at {over[worst]:.3g} times Paschen's voltage {where}"
        yield f"air breaks down{self._where(scene, row)}, {much}{held}"

    def _fails(self, scene: Any, rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
        """Layers of the insulator whose field exceeds their strength where the gap is smallest."""
        electrics = scene.electrics
        if electrics.resolved:
            return
        law, layers = electrics.attraction
        rough = roughness_below(law, layers, scene.roughness_gap)
        peaks = np.array([electrics.crest * abs(row["voltage"]) for row in rows])
        gaps = [smallest_gap(row, rough) for row in rows]
        for name, film in electrics.films.items():
            over = peaks * [electrics.field_in(film, gap) for gap in gaps] / film.strength
            worst = int(over.argmax())
            if over[worst] > 1.0 and film.thickness > 0.0:
                least = f"from {peaks[worst] / over[worst]:.3g} V on"
                much = f"{over[worst]:.3g} times its {1e-3 * film.strength:g} V/um"
                yield f"the {name} breaks down {least}, at {much} in step {rows[worst]['step']}"

    def _where(self, scene: Any, row: Mapping[str, Any]) -> str:
        """Gaps that break down at the voltage of a row, in words."""
        electrics = scene.electrics
        if electrics.resolved:
            return ""
        layers, volts = electrics.attraction[1], np.asarray(row["voltage"])
        if np.ndim(layers.reduced):
            return ""
        first, last = Limited(scene.law, electrics.crest).sparking(volts, layers)
        return f" in gaps of {1e3 * float(first):.3g} to {1e3 * float(last):.3g} um"


def smallest_gap(row: Mapping[str, Any], rough: Any) -> float:
    """The smallest gap (mm) of a row, with the air that rough faces keep under the largest pressure."""
    apart = 0.0 if rough is None else float(rough.separation(row["peak_contact_pressure"]))
    return max(float(row["min_gap"]), 0.0) + apart

"""What acts between finger and electrode: the voltage that a run follows, the layers that it crosses and the
law of the attraction, resolved from a scene once (`Scene.electrics`); which drives go with what, and which
scenes have no full field.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.circuit.signals import FollowForce, VoltageProfile, carrier_amplitude
from evfem.common.arrays import Floats, Ints
from evfem.common.checks import Values
from evfem.electrostatics.alternating import SINGLE
from evfem.electrostatics.breakdown import Limited, across_gap
from evfem.electrostatics.dielectrics import seen_at
from evfem.electrostatics.drive import Drive, mean_law, powers, spectrum, steady_layers, waveform
from evfem.electrostatics.laws import Layer, Layers, eps_0
from evfem.electrostatics.relaxation import Sandwich
from evfem.electrostatics.roughness import NONE, distribution_of
from evfem.electrostatics.timesignals import NANO, WAVEFORMS, Carrier, ChargeControl, OpenCircuit
from evfem.errors import ABSENT, InputError
from evfem.mesh.faces import layer_thickness
from evfem.protocols import TimeSignal

#: voltages that follow from the charge of the electrode
CHARGED = (OpenCircuit, ChargeControl)
#: samples of a period in which peaks are sought
SAMPLES = 1024
#: thickness of the stratum corneum (mm) where only the mesh knows it
SKIN = 0.4


@dataclass(frozen=True)
class Electrics:
    """Law, drive, voltages (V) and solid layers; the skin has a usual thickness until `above` a mesh."""

    law: Any
    drive: Drive | None
    given: Any
    ramps: tuple[float, ...]
    eps_r: float
    skin: Layer
    insulator: Layer
    limited: bool = False

    @classmethod
    def of(cls, scene: Any) -> Electrics:
        """Those of a `Scene`, which uses this file itself."""
        electrical = scene.finger.electrical
        thickness: Any = getattr(electrical, "stratum_corneum_thickness", None)
        if thickness is None:
            thickness = getattr(scene.finger, "stratum_corneum_thickness", SKIN)
        eps_r = float(getattr(electrical, "stratum_corneum_eps_r", 1650.0))
        skin = (scene.drive or Drive()).skin_layer(float(thickness), eps_r)
        ramps = tuple(found for one in scene.courses if (found := one.largest_voltage) is not None)
        limited = scene.breakdown == "limit"
        return cls(scene.law, scene.drive, scene.voltage, ramps, eps_r, skin, scene.ground.insulator, limited)

    def above(self, electrical: Any, mesh: Any, nodes: Ints) -> Electrics:
        """The same above the nodes of a pad, where the skin has its given thickness or that of the mesh."""
        thickness = None if electrical is None else electrical.stratum_corneum_thickness
        if thickness is None:
            if electrical is None or "stratum_corneum" not in mesh.region_names:
                allowed = (
                    "stratum_corneum_thickness and stratum_corneum_eps_r, or a region called stratum_corneum"
                )
                raise InputError("finger.electrical", "no thickness of the skin's insulating layer", allowed)
            thickness = layer_thickness(mesh, "stratum_corneum", nodes)
        return self.of_skin(np.broadcast_to(thickness, nodes.shape).astype(float))

    def of_skin(self, thickness: Values) -> Electrics:
        """The same below so much skin (mm)."""
        return replace(self, skin=(self.drive or Drive()).skin_layer(thickness, self.eps_r))

    @property
    def resolved(self) -> bool:
        """Whether charges flow in time."""
        return self.drive is not None and self.drive.resolved

    @cached_property
    def voltage(self) -> Any:
        """The scene's voltage in the run: constant, instantaneous (resolved drive) or rms (mean over the
        cycle of a periodic signal).
        """
        drive = self.drive
        if drive is None:
            return self.given
        if drive.resolved:
            return drive.signal(self.given) if isinstance(self.given, float) else self.given
        return self.given if (found := powers(self.given)) is None else found[0]

    @cached_property
    def frequency(self) -> float | None:
        """Frequency (Hz) at which dielectrics count: that of the drive, or of the scene's own signal."""
        drive, given = self.drive, self.given
        if drive is None or drive.frequency is not None:
            return None if drive is None else drive.frequency
        if isinstance(given, Carrier):
            return given.frequency
        if drive.resolved and isinstance(given, TimeSignal):
            return given.highest_frequency or None
        return getattr(given, "cycle", None)

    @cached_property
    def largest_voltage(self) -> float:
        """Largest magnitude of the voltage anywhere in the scene (V)."""
        own: Any = self.voltage
        if isinstance(own, VoltageProfile):
            own = own.voltage
        elif isinstance(own, FollowForce):
            own = own.largest_voltage
        elif isinstance(own, TimeSignal):
            own = own.largest
        return float(max([np.abs(own).max(), *map(abs, self.ramps)]))

    @property
    def acts(self) -> bool:
        """Whether anything attracts; a voltage over time may, whatever it says its `largest` is."""
        return self.law is not None and (self.largest_voltage != 0.0 or isinstance(self.voltage, TimeSignal))

    @cached_property
    def attraction(self) -> tuple[Any, Layers]:
        """Law and layers of the attraction: over the cycle, or, resolved, without what conducts."""
        solids = (self.skin, self.insulator)
        law = Limited(self.law, self.crest) if self.limited else self.law
        if self.drive is None:
            return law, Layers.of(*solids)
        if self.drive.resolved:
            thickness = np.asarray(self.skin.thickness) + self.insulator.thickness
            return self.law, Layers(self.sandwich.reference, thickness)
        return mean_law(law, self.drive, self.frequency, solids, self.given)

    @property
    def gap_eps_r(self) -> float:
        """Relative permittivity of what fills the gap."""
        return getattr(self.law, "gap_eps_r", 1.0)

    @cached_property
    def sandwich(self) -> Sandwich:
        """The layers of a resolved drive as its charges see them."""
        assert self.drive is not None
        gap = {"gap_conductivity": self.drive.gap_conductivity, "gap_eps_r": self.gap_eps_r}
        return Sandwich.of(self.skin, self.insulator, frequency=self.frequency, **gap)

    @property
    def parallel(self) -> float:
        """Capacitance beside the finger over eps_0 (in space mm)."""
        return NANO * getattr(self.given, "parallel_capacitance", 0.0) / eps_0

    @property
    def alternates(self) -> bool:
        """Whether the attraction is a mean over the cycle of an alternating voltage."""
        return self.acts and self.drive is not None and not self.drive.resolved

    @property
    def crest(self) -> float:
        """Peak of the scene's voltage over what a run has as voltage."""
        drive, given = self.drive, self.given
        if drive is None or drive.resolved:
            averaged = drive is None and isinstance(given, Carrier) and not given.resolved
            return float(carrier_amplitude(1.0)) if averaged else 1.0
        if (found := powers(given)) is not None:
            return float(given.largest / found[0])
        if isinstance(given, Carrier):
            return float(carrier_amplitude(1.0))
        return float(drive.peak(1.0))

    def peak_across(self, gap: Floats, layers: Layers) -> Floats:
        """Peak voltages (P,) of gaps (P,) in mm over what a run has as voltage. Under several harmonics a gap
        that leaks has the sum of what each leaves it, which may be twice the peak of the source.
        """
        several = self.alternates and spectrum(self.drive, self.given)[0].size > 1  # type: ignore[arg-type]
        if not (several and self.conducts):
            return np.asarray(self.crest * across_gap(gap, layers, self.gap_eps_r))
        return np.abs(self.period_across(gap)).max(axis=0)

    def period_across(self, gap: Floats) -> Floats:
        """Voltages (SAMPLES, P) of gaps (P,) in mm over a cycle of an alternating voltage, over its effective
        value.
        """
        amplitudes, stacks = self._period
        fractions = [0.0 * gap if one is None else gap / (gap + self.gap_eps_r * one) for one in stacks]
        return np.asarray(np.fft.irfft(amplitudes[:, None] * fractions, SAMPLES, axis=0))

    @cached_property
    def _period(self) -> tuple[Any, list[Any]]:
        """Complex amplitudes (h,) of an alternating voltage at its harmonics, over its effective value, and
        the complex reduced thicknesses (mm) of the layers there; None where the gap has no field.
        """
        drive, given, at = self.drive, self.given, self.frequency
        assert drive is not None
        assert at is not None
        found = powers(given)
        wave: Any = drive.signal(1.0) if found is None else given
        effective = 1.0 if found is None else found[0]
        volts = [wave((k + 0.5) / (SAMPLES * at)) / effective for k in range(SAMPLES)]
        still = steady_layers((self.skin, self.insulator), drive, self.gap_eps_r)
        layers = [still, *(self.layers_at(at * n) for n in range(1, SAMPLES // 2 + 1))]
        stacks = [None if one is None else one.reduced + 1j * np.asarray(one.loss) for one in layers]
        return np.fft.rfft(volts), stacks

    @cached_property
    def harmonics(self) -> tuple[Floats, Floats]:
        """Orders of an alternating voltage, and their fractions of its square; without a direct part."""
        assert self.drive is not None
        order, share = spectrum(self.drive, self.given)
        return order[order > 0.0], share[order > 0.0]

    @property
    def smooth(self) -> Any:
        """Which harmonics (H,) an amplifier with edges of its own has: of a voltage that jumps the first."""
        order = self.harmonics[0]
        assert self.drive is not None
        driven = WAVEFORMS[waveform(self.drive, self.given)]
        jumps = hasattr(driven if powers(self.given) is None else self.given, "jumps")
        return order < 2.0 * SINGLE if jumps else np.full(order.shape, True)

    def layers_at(self, frequency: float) -> Layers:
        """The solid layers at a frequency (Hz), with the gap that conducts."""
        leak = 0.0 if self.drive is None else self.drive.gap_conductivity
        solids = (self.skin, self.insulator)
        return Layers.of(*solids, frequency=frequency, gap_conductivity=leak, gap_eps_r=self.gap_eps_r)

    @property
    def conducts(self) -> bool:
        """Whether a drive's gap conducts, or one of the layers is a dielectric and no mere number."""
        layers = (self.skin, self.insulator)
        dielectrics = (callable(getattr(layer.eps_r, "permittivity", None)) for layer in layers)
        return self.drive is not None and (bool(self.drive.gap_conductivity) or any(dielectrics))

    @property
    def permittivities(self) -> list[tuple[float, complex, complex, complex]]:
        """Of a drive's harmonics: share of the squared voltage, complex eps_r of insulator, gap, skin."""
        drive, at, found = self.drive, self.frequency, []
        assert drive is not None
        assert at is not None
        for order, share in zip(*(part.tolist() for part in spectrum(drive, self.given)), strict=True):
            gap = self.gap_eps_r + drive.gap_conductivity / (2j * np.pi * at * order * eps_0)
            solid = [complex(layer.permittivity(at * order)) for layer in (self.insulator, self.skin)]
            found.append((share, solid[0], complex(gap), solid[1]))
        return found

    def lossless(self, layer: Layer) -> Layer:
        """A layer with its real permittivity alone, at the drive's frequency or static without one."""
        return Layer(layer.thickness, seen_at(layer, self.frequency)[0])

    @property
    def reduced(self) -> Any:
        """Reduced thickness (mm) of the solid layers without losses."""
        return sum(one.thickness / one.eps_r for one in map(self.lossless, (self.skin, self.insulator)))

    @property
    def films(self) -> dict[str, Layer]:
        """The layers of the insulator by their names in a sentence."""
        found = self.insulator.parts
        several = len(found) > 1
        return {f"insulator's layer {i}" if several else "insulator": one for i, one in enumerate(found, 1)}

    def field_in(self, layer: Layer, gap: Values) -> float:
        """Field (V/mm) in a solid layer per volt of the peak, below a `gap` (mm), where the layers are
        thinnest: under an alternating voltage at its frequency, otherwise of lossless layers.
        """
        at, solids, air = self.frequency, (self.skin, self.insulator), complex(self.gap_eps_r)
        if self.alternates and at is not None and self.drive is not None:
            air += self.drive.gap_conductivity / (2j * np.pi * at * eps_0)
            own, each = layer.permittivity(at), [one.thickness / one.permittivity(at) for one in solids]
        else:
            own, each = self.lossless(layer).eps_r, [self.attraction[1].reduced]
        return float(np.max(1.0 / np.abs(own * (gap / air + sum(each)))))


def check_drive(scene: Any) -> None:
    """Raise InputError where drive, law, voltage, breakdown and motions do not fit together."""
    drive = scene.drive
    if scene.breakdown == "limit":
        _check_limited(scene)
    if isinstance(scene.voltage, CHARGED) and (drive is None or not drive.resolved):
        raise InputError("electrostatics.voltage", type(scene.voltage).__name__, "with a resolved drive")
    if drive is None:
        return
    if scene.law is None:
        allowed = "a scene with an electrostatic law and a voltage"
        raise InputError("electrostatics.frequency", "a drive without a law", allowed)
    if scene.ground.insulator is not None:  # which is refused elsewhere
        (_check_resolved if drive.resolved else _check_mean)(scene, drive)
        _ = scene.electrics.attraction  # dielectrics that need a frequency say so


def _check_limited(scene: Any) -> None:
    """A law whose field is held needs one voltage of each gap, of which the peak is known."""
    drive, given = scene.drive, None
    if scene.field != "local":
        given = f"limit with the field {scene.field}"
    elif isinstance(scene.voltage, FollowForce) or any(one.gap is not None for one in scene.courses):
        given = "limit with a voltage that is found, which needs forces that go with its square"
    elif drive is not None and drive.resolved:
        given = "limit in a resolved drive"
    elif drive is not None and spectrum(drive, scene.voltage)[0].size > 1:
        given = "limit with a voltage of several harmonics"
    elif distribution_of(scene.roughness_gap) != NONE:
        given = "limit with a distribution of local gaps"
    if given is not None:
        raise InputError(
            "electrostatics.breakdown",
            given,
            "warn | off; or a prescribed voltage, direct or a sine, the field local, and even gaps",
        )


def _check_mean(scene: Any, drive: Drive) -> None:
    voltage = scene.voltage
    if isinstance(voltage, Carrier):
        if voltage.resolved:
            allowed = 'a carrier with resolved=False, or drive = "resolved"'
            raise InputError("electrostatics.signal", "a resolved carrier in a mean over the cycle", allowed)
        if drive.frequency is not None:
            given = f"{drive.frequency:g} beside a carrier of {voltage.frequency:g} Hz"
            raise InputError("electrostatics.frequency", given, "nothing here")
    elif drive.frequency is not None and powers(voltage) is not None:
        given = f"{drive.frequency:g} beside a signal over time, which has its own"
        raise InputError("electrostatics.frequency", given, "nothing here")
    elif scene.electrics.frequency is None:
        allowed = 'a frequency in Hz, needed for the mean over the cycle; or drive = "resolved"'
        raise InputError("electrostatics.frequency", ABSENT, allowed)


def _check_resolved(scene: Any, drive: Drive) -> None:
    voltage = scene.voltage
    if scene.direction == "normal":
        raise InputError("electrostatics.direction", "normal in a resolved drive", "vertical")
    if isinstance(voltage, (FollowForce, VoltageProfile)):
        allowed = "a number or a signal over time with a resolved drive"
        raise InputError("electrostatics.voltage", type(voltage).__name__, allowed)
    if isinstance(voltage, TimeSignal) and drive.frequency is not None:
        given = f"{drive.frequency:g} beside a signal over time, which is resolved itself"
        raise InputError("electrostatics.frequency", given, "nothing here")
    if isinstance(voltage, CHARGED) and np.any(seen_at(scene.ground.insulator, scene.electrics.frequency)[1]):
        allowed = "an insulator that does not conduct, with an open circuit or a prescribed charge"
        raise InputError("surface.insulator", "a conductor", allowed)
    if isinstance(voltage, Carrier) and not voltage.resolved:
        allowed = "a carrier with resolved=True in a resolved drive"
        raise InputError("electrostatics.signal", "the mean of a carrier", allowed)
    if (spread := distribution_of(scene.roughness_gap)) != NONE:
        allowed = '"none" in a resolved drive: the charges of a node are those of one gap'
        raise InputError("electrostatics.roughness_gap.distribution", spread, allowed)
    for i, course in enumerate(scene.courses):
        if course.largest_voltage is not None:
            raise InputError(f"motion[{i}]", "a voltage ramp in a resolved drive", "a signal over time")


def without_field(scene: Any) -> tuple[str, str] | None:
    """What of a scene goes with no Poisson problem, and what would; None where all of it does.

    - Kaczmarek's layers stretch when the gap opens: its force is no stress of the field between the
      layers as they are, and no limit of one. Nor are laws of one's own.
    - Without an air layer the force of nodes that do not touch is dropped; in the field they are
      pulled through the same air, and what remained would be the force of no body.
    - Resolved in time, charges are those of a node's own column, and would have to spread.
    - A direct part of a voltage at rest has the field of the conductivities.
    """
    if scene.law is None:
        return "no law", "StrongTroxel and a voltage"
    if not getattr(scene.law, "of_a_field", False):
        allowed = "StrongTroxel: of rigid layers alone the force is that of a field"
        return type(scene.law).__name__, allowed
    if not scene.air_layer:
        return "air_layer = false", "air_layer = true: the field pulls through the air beside the contact too"
    if scene.adhesion is not None:
        return "adhesion", "a scene without adhesion"
    if scene.ground.elastic is not None:
        return "an elastic surface", "a rigid surface: the field's insulator does not bend"
    if scene.drive is None:
        return None
    if scene.drive.resolved:
        return "a resolved drive", 'drive = "mean": charges are resolved column by column'
    if spectrum(scene.drive, scene.voltage)[0][0] == 0.0:
        return "a voltage with a direct component", "a voltage whose mean over the cycle is 0"
    return None

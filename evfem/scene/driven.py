"""What the drive of a scene means to its other parts: the voltage that a run sees, the layers and
the law of the attraction, and what does not go with it.

`scene` is a `Scene` throughout; it uses this file itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.checks import Values
from evfem.electrostatics.charges import Sandwich
from evfem.electrostatics.drive import Drive, mean_law, powers, spectrum
from evfem.electrostatics.laws import Layer, Layers, eps_0
from evfem.electrostatics.relaxation import RelaxingSandwich, seen_at, stack_of
from evfem.electrostatics.signals import FollowForce, VoltageProfile
from evfem.electrostatics.timesignals import Carrier, ChargeControl, OpenCircuit, Sampled, Sine, Square
from evfem.errors import ABSENT, InputError
from evfem.protocols import TimeSignal
from evfem.scene.motion import VoltageRamp

#: voltages that follow from the charge of the electrode
CHARGED = (OpenCircuit, ChargeControl)
#: thickness of the stratum corneum (mm) where only the mesh knows it
SKIN = 0.4


def applied(scene: Any) -> Any:
    """The voltage as the run follows it: the scene's own, or where its drive is resolved that of
    the moment, or of a signal that repeats the effective one for its mean over the cycle.
    """
    drive = scene.drive
    if drive is not None and not drive.resolved and (found := powers(scene.voltage)) is not None:
        return found[0]
    if drive is None or not drive.resolved or not isinstance(scene.voltage, float):
        return scene.voltage
    return drive.signal(scene.voltage)


def frequency(scene: Any) -> float | None:
    """Frequency (Hz) at which dielectrics count: that of the drive, or of the scene's own signal."""
    drive, voltage = scene.drive, scene.voltage
    if drive is None or drive.frequency is not None:
        return None if drive is None else drive.frequency
    if isinstance(voltage, Carrier):
        return voltage.frequency
    if drive.resolved and isinstance(voltage, TimeSignal):
        return voltage.highest_frequency or None
    if isinstance(voltage, Sampled) and voltage.repeat:
        return voltage.rate / voltage.voltage.size
    if isinstance(voltage, (Sine, Square)):
        return voltage.frequency
    return None


def skin_thickness(electrical: Any, mesh: Any, nodes: Ints) -> Floats:
    """Thickness (P,) in mm of the skin's insulating layer above pad nodes: a given one, or the local
    one of the mesh.
    """
    thickness = None if electrical is None else electrical.stratum_corneum_thickness
    if thickness is None:
        if electrical is None or "stratum_corneum" not in mesh.region_names:
            allowed = (
                "stratum_corneum_thickness and stratum_corneum_eps_r, or a region called stratum_corneum"
            )
            raise InputError("finger.electrical", "no thickness of the skin's insulating layer", allowed)
        from evfem.mesh import faces
        from evfem.mesh import mesh as edges

        kind = faces if mesh.dim == 3 else edges
        thickness = kind.layer_thickness(mesh, "stratum_corneum", nodes)
    return np.broadcast_to(thickness, nodes.shape).astype(float)


def solids(scene: Any, thickness: Values, eps_r: float) -> tuple[Layer, Layer]:
    """Stratum corneum, `thickness` in mm with the finger's `eps_r` or the drive's skin, and
    insulator.
    """
    drive = scene.drive or Drive()
    return drive.skin_layer(thickness, eps_r), scene.ground.insulator


def attracting(scene: Any, skin: Layer, insulator: Layer) -> tuple[Any, Layers]:
    """The law and the layers of the attraction: of the mean over the cycle, or where the drive is
    resolved without what conducts, which moves the charges instead.
    """
    drive, at = scene.drive, frequency(scene)
    if drive is None:
        return scene.law, Layers.of(skin, insulator)
    if drive.resolved:
        thickness = np.asarray(skin.thickness) + insulator.thickness
        return scene.law, Layers(sandwich(scene, skin, insulator).reference, thickness)
    return mean_law(scene.law, drive, at, (skin, insulator), scene.voltage)


def layers_of(scene: Any) -> Layers:
    """The solid layers, with a usual stratum corneum where only the mesh knows its thickness."""
    return attracting(scene, *solids(scene, *skin_of(scene)))[1]


def skin_of(scene: Any) -> tuple[float, float]:
    """Thickness (mm) and permittivity of the stratum corneum."""
    electrical = scene.finger.electrical
    thickness: Any = getattr(electrical, "stratum_corneum_thickness", None)
    if thickness is None:
        thickness = getattr(scene.finger, "stratum_corneum_thickness", SKIN)
    return float(thickness), float(getattr(electrical, "stratum_corneum_eps_r", 1650.0))


def largest_voltage(scene: Any) -> float:
    """Largest magnitude of the voltage anywhere in the scene (V)."""
    own: Any = applied(scene)
    if isinstance(own, VoltageProfile):
        own = own.voltage
    elif isinstance(own, FollowForce):
        own = own.largest_voltage
    elif isinstance(own, TimeSignal):
        own = own.largest
    ramps = [abs(motion.voltage) for motion in scene.motion if isinstance(motion, VoltageRamp)]
    return float(max([np.abs(own).max(), *ramps]))


def conducts(scene: Any, skin: Layer, insulator: Layer) -> bool:
    """Whether a drive's gap conducts, or one of the layers is a dielectric and no mere number."""
    given = (
        scene.drive.gap_conductivity,
        *(callable(getattr(layer.eps_r, "permittivity", None)) for layer in (skin, insulator)),
    )
    return any(given)


def permittivities(
    scene: Any, skin: Layer, insulator: Layer
) -> list[tuple[float, complex, complex, complex]]:
    """Of each harmonic of a drive its share of the squared effective voltage, and the complex relative
    permittivities of insulator, gap and skin at its frequency; for voltages without a direct part.
    """
    at, gap_eps_r = frequency(scene), getattr(scene.law, "gap_eps_r", 1.0)
    assert at is not None
    found = []
    for order, share in zip(*(part.tolist() for part in spectrum(scene.drive, scene.voltage)), strict=True):
        gap = gap_eps_r + scene.drive.gap_conductivity / (2j * np.pi * at * order * eps_0)
        solid = [complex(layer.permittivity(at * order)) for layer in (insulator, skin)]
        found.append((share, solid[0], complex(gap), solid[1]))
    return found


def lossless(scene: Any, layer: Layer) -> Layer:
    """A layer with its real permittivity alone, at the drive's frequency or static without one."""
    return Layer(layer.thickness, seen_at(layer, frequency(scene))[0])


def sandwich(scene: Any, skin: Layer, insulator: Layer) -> Sandwich | RelaxingSandwich:
    """The layers of a resolved drive as its charges see them."""
    gap = {"gap_conductivity": scene.drive.gap_conductivity}
    gap["gap_eps_r"] = getattr(scene.law, "gap_eps_r", 1.0)
    return stack_of(skin, insulator, frequency=frequency(scene), **gap)


def check_drive(scene: Any) -> None:
    """Raise InputError where drive, law, voltage and motions do not fit together."""
    drive = scene.drive
    if isinstance(scene.voltage, CHARGED) and (drive is None or not drive.resolved):
        raise InputError("electrostatics.voltage", type(scene.voltage).__name__, "with a resolved drive")
    if drive is None:
        return
    if scene.law is None:
        allowed = "a scene with an electrostatic law and a voltage"
        raise InputError("electrostatics.frequency", "a drive without a law", allowed)
    (_check_resolved if drive.resolved else _check_mean)(scene, drive)
    attracting(scene, *solids(scene, 0.3, 1650.0))  # dielectrics that need a frequency say so


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
    elif frequency(scene) is None:
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
    if isinstance(voltage, CHARGED) and np.any(seen_at(scene.ground.insulator, frequency(scene))[1]):
        allowed = "an insulator that does not conduct, with an open circuit or a given charge"
        raise InputError("surface.insulator", "a conductor", allowed)
    if isinstance(voltage, Carrier) and not voltage.resolved:
        allowed = "a carrier with resolved=True in a resolved drive"
        raise InputError("electrostatics.signal", "the mean of a carrier", allowed)
    for i, motion in enumerate(scene.motion):
        if isinstance(motion, VoltageRamp):
            raise InputError(f"motion[{i}]", "a voltage ramp in a resolved drive", "a signal over time")

r"""The voltage of a display for a friction curve, and the errors of this rendering.

The voltage is that of the closed forms (`rendering.voltage_for`), for an estimated, measured or
simulated curve; `exact_voltage` solves the coupled model instead. The friction on the display is
``mu = mu_d (1 + F_e / F_n)``, with the limits of the amplifier. Errors relative to the target are::

    force      ||F - F_target|| / ||F_target||
    changes    the same without both means: texture is felt by changes
    spectrum   ||a - a_target|| / ||a_target|| of the one-sided amplitudes, without the mean
    bands      the same within each band of frequencies, spatial frequency times speed

The target cannot be rendered where it is below the display's own friction, because attraction
only adds to it, and where the amplifier cannot follow.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np

from evfem.circuit.encoding import AreaLaw, Encoding, share_not_renderable
from evfem.circuit.signalfile import Playback
from evfem.circuit.signals import Amplifier, VoltageProfile
from evfem.common.arrays import Floats
from evfem.common.checks import Checked, among, between, one_of
from evfem.electrostatics.drive import Drive
from evfem.electrostatics.laws import FORCE_LAWS, INSULATORS, Layer, Layers
from evfem.electrostatics.roughness import WIDEST
from evfem.estimate import rendering
from evfem.estimate.touch import FrictionCurve, Touch, friction_of
from evfem.planning.attracted import broken_air, broken_down, touching
from evfem.simulation.spectrum import amplitudes
from evfem.surface.surfaces import Display

#: edges of the bands in Hz: slow changes, and what the receptors of the skin are tuned to
BANDS = (0.0, 5.0, 15.0, 50.0, 150.0, 500.0)
#: of the plane finger: area per load (mm2/N), and the stratum corneum of Table 2
AREA, SKIN = 112.0, Layer(0.38, 1650.0)
#: largest voltage (V) of the model on a display without an amplifier, and the fraction of a slide that may be
#: lost before it is worth a word
MOST_VOLTAGE, LOST = 10_000.0, 0.02


@dataclass(frozen=True)
class Device(Checked):
    """A display with its amplifier.

    >>> Device(law="coulomb")
    Traceback (most recent call last):
    evfem.errors.InputError: law: given "coulomb"; allowed: strong_troxel | kaczmarek
    """

    friction: Annotated[float, between(0.01, 3.0), "coefficient of the display"] = 0.25
    law: Annotated[str, among(FORCE_LAWS), "of the attraction"] = "kaczmarek"
    insulator: Annotated[str, one_of(*INSULATORS), "on the display"] = "film"
    roughness_gap: Annotated[float, between(0.0, WIDEST, "mm"), "air that touching rough faces keep"] = 0.0
    voltage_max: Annotated[float | None, between(1.0, 1e5, "V"), "largest effective voltage"] = None
    slew: Annotated[float | None, between(1.0, 1e9, "V/s"), "how fast that can change"] = None

    @property
    def encoding(self) -> Encoding:
        """Its closed forms."""
        layers = Layers.of(SKIN, INSULATORS[self.insulator])
        area, law = AreaLaw(AREA), FORCE_LAWS[self.law]()
        return Encoding(law, layers, area, self.friction, gap=self.roughness_gap)

    @property
    def largest_voltage(self) -> float:
        """Largest voltage (V) that the model may find."""
        return MOST_VOLTAGE if self.voltage_max is None else self.voltage_max

    def doubts(self, voltage: float) -> tuple[str, ...]:
        """What the plan of a scene says of so high a voltage (V), one sentence each.

        >>> [said[:43] for said in Device(law="strong_troxel", insulator="touchscreen").doubts(15.9)]
        ['5 um of air between rough faces leave 0.79%']
        """
        solids = {"stratum corneum": SKIN, "insulator": INSULATORS[self.insulator]}
        law, layers = self.encoding.law, self.encoding.layers
        near = self.roughness_gap + layers.reduced
        fields = {name: (one, 1.0 / (one.eps_r * near)) for name, one in solids.items()}
        air = broken_air(voltage, layers)
        felt = touching(law, layers, voltage, self.roughness_gap)
        return (*broken_down(voltage, fields), *([air] if air else []), *felt)

    @property
    def amplifier(self) -> Amplifier | None:
        """Its amplifier, None without limits."""
        if self.voltage_max is None and self.slew is None:
            return None
        return Amplifier(1e5 if self.voltage_max is None else self.voltage_max, self.slew)


@dataclass(frozen=True, eq=False)
class Rendering:
    """The voltage for a friction curve; the friction `felt` (n,) on the display; `lost` (n,) where it misses
    the target; errors as at the head of this file (NaN if there is nothing to compare with); and `bands`:
    rows (low Hz, high Hz, error, fraction of the target's power).
    """

    curve: FrictionCurve
    signal: rendering.Signal
    felt: Floats
    lost: Floats
    force_error: float
    change_error: float
    spectrum_error: float
    bands: tuple[tuple[float, float, float, float], ...]

    @property
    def share_lost(self) -> float:
        """Fraction of the path on which the target is missed."""
        return _share(self.curve.x, self.lost)

    @property
    def losses(self) -> tuple[str, ...]:
        """A sentence for each cause that loses more than `LOST` of the slide."""
        causes = {
            "is slipperier than the display: it cannot be rendered": self.signal.share_not_renderable,
            "is beyond the limits of the voltage or of how fast it changes": self.signal.share_limited,
        }
        return tuple(f"{lost:.0%} of the slide {text}" for text, lost in causes.items() if lost > LOST)


def _share(x: Floats, there: Any) -> float:
    """Fraction of a path at whose places (n,) in mm something is `there` (n,)."""
    return float(np.trapezoid(np.asarray(there, dtype=float), x) / (x[-1] - x[0]))


def render(curve: FrictionCurve, touch: Touch, device: Device) -> Rendering:
    """The voltage by the closed forms for a friction curve.

    >>> x = np.linspace(0.0, 8.0, 401)
    >>> curve = FrictionCurve(x, 0.35 + 0.02 * np.sin(np.pi * x), "made up")
    >>> found = render(curve, Touch(), Device(friction=0.25))
    >>> bool(found.lost.any()), found.change_error < 1e-9, round(found.signal.largest)
    (False, True, 3511)
    >>> worse = render(curve, Touch(), Device(friction=0.34))
    >>> round(worse.share_lost, 2), round(worse.change_error, 2)
    (0.33, 0.25)
    """
    load = np.full(curve.x.shape, touch.load)
    wish = rendering.ApparentFriction(curve.x, load, np.maximum(curve.friction, 0.0) * load)
    signal = rendering.voltage_for(wish, device.encoding, amplifier=device.amplifier, speed=touch.speed)
    felt = np.asarray(device.encoding.tangential_force(load, signal.profile(curve.x))) / load
    return _compared(curve, signal, felt, touch.speed)


def _compared(curve: FrictionCurve, signal: rendering.Signal, felt: Floats, speed: float) -> Rendering:
    frequency, wanted = spectrum_of(curve.x, curve.friction, speed)
    _, rendered = spectrum_of(curve.x, felt, speed)
    change = curve.friction - curve.friction.mean()
    bands = []
    for low, high in pairwise(BANDS):
        inside = (frequency > low) & (frequency <= high)
        fraction = float(np.sum(wanted[inside] ** 2) / max(np.sum(wanted**2), 1e-300))
        bands.append((low, high, _relative(rendered[inside], wanted[inside]), fraction))
    return Rendering(
        curve=curve,
        signal=signal,
        felt=felt,
        lost=_misses(felt, curve.friction),
        force_error=_relative(felt, curve.friction),
        change_error=_relative(felt - felt.mean(), change),
        spectrum_error=_relative(rendered, wanted),
        bands=tuple(bands),
    )


def _misses(felt: Floats, wanted: Floats) -> Any:
    """Where (n,) the friction on the display is another one than is wanted."""
    return np.abs(felt - wanted) > 10.0 * rendering.NOISE * np.abs(wanted).max()


def _relative(found: Floats, wanted: Floats) -> float:
    size = float(np.linalg.norm(wanted))
    return float(np.linalg.norm(found - wanted)) / size if size > 1e-12 else float("nan")


def spectrum_of(x: Floats, friction: Floats, speed: float) -> tuple[Floats, Floats]:
    """Frequencies (Hz) above 0 and amplitudes of a curve, at even spacing, with Hann's window."""
    even = np.interp(np.linspace(x[0], x[-1], x.size), x, friction)
    amplitude = amplitudes(even, "hann")[1:]
    period = float(x[-1] - x[0]) * x.size / (x.size - 1)
    return np.arange(1.0, amplitude.size + 1.0) * speed / period, amplitude


def playback(profile: VoltageProfile, touch: Touch, device: Device) -> Playback:
    """What a file of the voltage needs: as full scale the next power of ten times 1, 2 or 5."""
    largest = max(float(np.max(np.abs(profile.voltage))), 1.0)
    ten = 10.0 ** np.floor(np.log10(largest))
    full = next(float(ten * m) for m in (1.0, 2.0, 5.0, 10.0) if ten * m >= largest * (1.0 - 1e-12))
    felt = float(device.encoding.tangential_force(touch.load, full)) / touch.load
    return Playback(max(full, largest), touch.speed, (device.friction, felt))


@dataclass(frozen=True, eq=False)
class ExactCurve:
    """The coupled model's own voltage (n,) in V over x (n,) mm, and the `friction` (n,) with it."""

    x: Floats
    voltage: Floats
    friction: Floats


def render_exact(curve: FrictionCurve, found: ExactCurve, touch: Touch, device: Device) -> Rendering:
    """Friction of the coupled model under its own voltage, compared as by `render`."""
    felt = np.interp(curve.x, found.x, found.friction)
    voltage, profile = np.interp(curve.x, found.x, found.voltage), VoltageProfile(found.x, found.voltage)
    own = device.friction * (1.0 - rendering.NOISE)
    cut = (voltage >= device.largest_voltage * (1.0 - rendering.NOISE)) & _misses(felt, curve.friction)
    signal = rendering.Signal(
        profile=profile,
        share_not_renderable=share_not_renderable(curve.x, curve.friction, own),
        largest=float(found.voltage.max()),
        rms=profile.rms(float(curve.x[0]), float(curve.x[-1])),
        carrier=float(Drive().peak(found.voltage.max())),
        error_of_display=_relative(felt, curve.friction),
        share_limited=_share(curve.x, cut),
    )
    return _compared(curve, signal, felt, touch.speed)


def exact_voltage(reference: rendering.Recording, device: Device) -> tuple[ExactCurve, rendering.Comparison]:
    """The voltage that gives a recorded slide's force in each step (`rendering.exact`), and how well."""
    display = Display(INSULATORS[device.insulator], friction=device.friction)
    law, gap = FORCE_LAWS[device.law](), device.roughness_gap
    result = rendering.exact(reference, display, law, device.largest_voltage, roughness_gap=gap).result
    felt, voltage = friction_of(result), result.voltage[result.motion_index == 2]
    return ExactCurve(felt.x, voltage, felt.friction), rendering.compare(reference.result, result)

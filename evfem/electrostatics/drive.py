r"""The alternating voltage of a scene: waveform, conduction, and its effective value in a force law.

A voltage is the effective one (root mean square). Under a sine the mean attraction over the cycle is a law of
the complex length z (`evfem.electrostatics.laws`). A square wave of the same effective voltage U is the sum
of its odd harmonics, :math:`U_n^2 = 8 U^2 / (\pi n)^2`, whose mean pressures add up:

.. math:: \bar p = \sum_{n = 1, 3, ...} p(g, U_n, z(n \omega)) .

The first harmonics count one by one, those above in groups at two frequencies each: the mean of a square
wave over a leaking gap is right to 4e-5 down to a millionth of its corner frequency. A signal that repeats (a
sine with a bias B, samples) is such a sum too, with a direct part:
:math:`\bar p = p(g, B, z(0)) + p(g, A/\sqrt2, z(\omega))`. At no frequency a gap that leaks over an insulator
that does not has no field, and contributes nothing; a gap that does not leak has the whole voltage that
conductors leave it.

Resolved in time, the voltage of the moment charges the skin, the gap leaks
(`evfem.electrostatics.relaxation`), and the attraction swings with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import (
    Values,
    Within,
    among,
    check_fields,
    number,
    real,
    set_frozen,
    to_python,
    yes_or_no,
)
from evfem.electrostatics.dielectrics import SKINS, Permittivity, dielectric, seen_at
from evfem.electrostatics.laws import Layer, Layers, traction_derivative
from evfem.electrostatics.timesignals import FREQUENCY, WAVEFORMS
from evfem.protocols import ForceLaw, TimeSignal

# keys that a scene file has beside others in [electrostatics]
DriveFrequency = Annotated[float | None, FREQUENCY, "of the alternating voltage; without it a direct one"]
Waveform = Annotated[str, among(WAVEFORMS), "of the alternating voltage; a signal over time has its own"]
Skin = Annotated[
    Any,
    {"allowed": f"{' | '.join(SKINS)} | the path of a csv file", "type": str},
    "dielectric of the stratum corneum; without it stratum_corneum_eps_r",
]
Conductivity = Annotated[
    float,
    number("a conductivity in S/m, not negative", Within(0.0), "S/m"),
    "of what fills the gap: the leak",
]


@dataclass(frozen=True)
class Drive:
    """An alternating voltage and what conducts, for `Scene(drive=...)`; the scene's `voltage` is
    its effective value.

    `frequency` is None where the voltage is a signal over time that has its own, or a direct voltage that is
    resolved in time. `skin` may also be a `Dielectric`, a table or a number. The mean over the cycle is right
    where the finger is too slow to follow twice the frequency and slides too fast to stick within it;
    resolved, the steps follow the voltage of the moment, and charges move.

    >>> Drive(frequency=250.0, skin="gabriel_dry", gap_conductivity=1e-8).peak(50.0)
    70.71067811865476
    """

    frequency: DriveFrequency = None
    waveform: Waveform = "sine"
    skin: Skin = None
    gap_conductivity: Conductivity = 0.0
    resolved: Annotated[
        bool, yes_or_no(), "attraction by its mean over the cycle, or resolved in time with its charges"
    ] = False

    def __post_init__(self) -> None:
        check_fields(self)
        if self.skin is not None and not (isinstance(self.skin, str) and self.skin in SKINS):
            skin = dielectric(self.skin)
            if not isinstance(skin, Permittivity):
                allowed = "a name of a skin, a Dielectric, a DielectricTable or a permittivity of at least 1"
                skin = real("skin", skin, allowed, Within(1.0))
            set_frozen(self, skin=skin)

    def peak(self, effective: Values) -> Values:
        """Peak (V) of the waveform with this effective voltage (V)."""
        return to_python(WAVEFORMS[self.waveform].crest * np.asarray(effective))

    def signal(self, voltage: float) -> TimeSignal | float:
        """Voltage of the moment with this effective value (V), where resolved: a signal, or constant."""
        if self.frequency is None:
            return voltage
        return WAVEFORMS[self.waveform](self.frequency, abs(self.peak(voltage)))

    def skin_layer(self, thickness: Values, eps_r: float) -> Layer:
        """The stratum corneum, `thickness` in mm, of the drive's skin or of the finger's `eps_r`."""
        return Layer(thickness, eps_r if self.skin is None else dielectric(self.skin))


@dataclass(frozen=True)
class CycleMean:
    """A force law over a cycle of harmonics: tractions times `weights` (H,), the layers' first axis."""

    law: ForceLaw
    weights: Any

    def traction(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Mean attraction in MPa."""
        return self._sum(self.law.traction(gap, voltage, layers))

    def traction_derivative(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Its derivative by the gap in MPa/mm."""
        return self._sum(traction_derivative(self.law, gap, voltage, layers))

    def potential(self, gap: Values, voltage: Values, layers: Any) -> Values:
        """Its potential per area in N/mm."""
        of: Any = self.law
        return self._sum(of.potential(gap, voltage, layers))

    def _sum(self, values: Any) -> Values:
        return to_python(np.tensordot(self.weights, np.asarray(values), 1))


def powers(signal: Any) -> tuple[float, Floats, Floats] | None:
    """Effective voltage (V) of a signal that repeats, and the orders of its harmonics, 0 for its
    bias, with their fractions of the squared voltage; None for one that does not repeat.

    >>> from evfem.electrostatics.timesignals import Sine
    >>> effective, order, share = powers(Sine(50.0, 100.0, bias=50.0))
    >>> round(effective, 3), order.tolist(), share.round(4).tolist()
    (86.603, [0.0, 1.0], [0.3333, 0.6667])
    """
    own = getattr(signal, "powers", None)
    return None if own is None else own()


def spectrum(drive: Drive, signal: Any) -> tuple[Floats, Floats]:
    """Harmonics of a drive or a periodic `signal`: orders and fractions of the squared effective voltage."""
    found = powers(signal)
    if found is not None:
        return found[1:]
    return WAVEFORMS[waveform(drive, signal)].harmonics()


def waveform(drive: Drive, signal: Any) -> str:
    """Name of the waveform of a voltage: the drive's; a carrier has its own."""
    return str(getattr(signal, "waveform", drive.waveform))


def steady_layers(solids: tuple[Layer, ...], drive: Drive, gap_eps_r: float) -> Layers | None:
    """The layers under a direct voltage that has always been there; None where the gap has no field."""
    found = [(layer.thickness, *seen_at(layer, None)) for layer in solids]
    thickness = sum(d for d, _, _ in found)
    if drive.gap_conductivity > 0.0:
        if any(not np.all(sigma) for d, _, sigma in found if np.any(d)):
            return None
        leak = drive.gap_conductivity / gap_eps_r
        return Layers(sum(leak * d / np.asarray(sigma) for d, _, sigma in found if np.any(d)), thickness)
    return Layers(sum(np.where(sigma, 0.0, d / np.asarray(eps)) for d, eps, sigma in found), thickness)


def mean_law(
    law: ForceLaw, drive: Drive, frequency: float | None, solids: tuple[Layer, ...], signal: Any = None
) -> tuple[Any, Layers]:
    """Law and layers of the mean attraction over the cycle at `frequency` (Hz), of drive or `signal`."""
    gap_eps_r = getattr(law, "gap_eps_r", 1.0)
    gap_layer = {"gap_conductivity": drive.gap_conductivity, "gap_eps_r": gap_eps_r}
    single = powers(signal) is None and WAVEFORMS[waveform(drive, signal)].harmonics()[0].size == 1
    if frequency is None or single:
        return law, Layers.of(*solids, frequency=frequency, **gap_layer)
    order, weight = spectrum(drive, signal)
    steady = steady_layers(solids, drive, gap_eps_r) if 0.0 in order else None
    if 0.0 in order and steady is None:
        order, weight = order[1:], weight[1:]
    if not order.size:
        order, weight = np.ones(1), np.zeros(1)
    found = [] if steady is None else [steady]
    found += [Layers.of(*solids, frequency=frequency * n, **gap_layer) for n in order[len(found) :]]
    reduced, loss = (
        np.stack(np.broadcast_arrays(*(getattr(one, name) for one in found))) for name in ("reduced", "loss")
    )
    return CycleMean(law, weight), Layers(reduced, found[0].thickness, loss)

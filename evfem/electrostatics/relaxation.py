r"""Skin, gap and insulator in series whose dielectrics relax: Debye poles beside the conductivities.

A layer of the permittivity :math:`\varepsilon_\infty + \sum_k \Delta_k / (1 + i\omega\tau_k)` and the
conductivity sigma has a polarisation for each of its poles (over eps_0, as a field p_k)

.. math:: D = \varepsilon_\infty E + \sum_k p_k, \qquad \tau_k \dot p_k = \Delta_k E - p_k,

beside the charges x_1, x_2 over eps_0 on the two faces of the gap (`evfem.electrostatics.charges`),
with :math:`\kappa = \sigma/\varepsilon_0`

.. math:: D_1 = D_2 - x_1, \quad D_3 = D_2 + x_2, \qquad
          \dot x_1 = \kappa_1 E_1 - \kappa_2 E_2, \quad \dot x_2 = \kappa_2 E_2 - \kappa_3 E_3, \qquad
          \sum_j d_j E_j = U(t) .

For a fixed gap this is linear, with real, negative rates. Laplace's transform makes it algebra: with
the admittance :math:`Y_j(s) = \varepsilon_{\infty j} + \kappa_j/s + \sum_k \Delta_k/(1 + s\tau_k)`,
:math:`z_j = d_j/Y_j`, and what the state at the beginning, index 0, leaves behind,
:math:`h_j = \sum_k p_k^0\tau_k/(1 + s\tau_k)`,

.. math:: (z_1 + z_2 + z_3)\, Y_2 E_2 = U(s) + z_1 (h_1 + x_1^0/s) + z_3 (h_3 - x_2^0/s), \\
          Y_1 E_1 = Y_2 E_2 - h_1 - x_1^0/s, \qquad Y_3 E_3 = Y_2 E_2 - h_3 + x_2^0/s .

On the imaginary axis z_j are the complex lengths of a sine. The way back to the time h is Talbot's
contour around the negative real axis with Weideman's constants (doi:10.1137/050625837,
doi:10.1007/s10543-006-0077-9),

.. math:: f(h) = \frac{1}{iN}\sum_k e^{z_k} z'(\theta_k)\, f(s = z_k/h)/h, \qquad
          z(\theta) = N\,[0.5017\,\theta\cot(0.6407\,\theta) - 0.6122 + 0.2645\,i\theta],

right to 3.89^-N whatever the rates: rounding with N = 26. The voltage goes straight from its begin to
its end. Energy and loss per area over eps_0 are

.. math:: \tfrac12\sum_j d_j\Big(\varepsilon_\infty E^2 + \sum_k p_k^2/\Delta_k\Big)_j, \qquad
          \sum_j d_j\Big(\kappa E^2 + \sum_k \tau_k\dot p_k^2/\Delta_k\Big)_j .

A force law sees the layers with their permittivity at the voltage's frequency (static without one) and
the voltage that makes the same field in the gap. A dielectric that is no sum of Debye poles is fitted
by one (`Dielectric.debye`) over `BAND`. Lengths in mm, charges and polarisations over eps_0 in V/mm,
rates in 1/s. Arguments broadcast; gaps may have a small imaginary part (for derivatives).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values
from evfem.electrostatics.charges import Sandwich, constants
from evfem.electrostatics.dielectrics import Dielectric
from evfem.electrostatics.laws import Layer, eps_0
from evfem.errors import InputError, quoted

#: frequencies (Hz) over which a dielectric becomes a sum of Debye poles, widened to `WIDER` times either
#: side of the voltage's; largest relative error
BAND, WIDER, FITTED = (1.0, 1e5), 10.0, 2e-3
#: points of Talbot's contour, and Weideman's constants
POINTS, SCALE, TURN, SHIFT, RISE = 26, 0.5017, 0.6407, 0.6122, 0.2645


def _contour() -> tuple[Any, Any]:
    """Points z and weights of the upper half of Talbot's contour."""
    theta = np.pi * np.arange(1, POINTS, 2) / POINTS
    turned = TURN * theta
    z = POINTS * (SCALE * theta / np.tan(turned) - SHIFT + 1j * RISE * theta)
    slope = SCALE / np.tan(turned) - SCALE * turned / np.sin(turned) ** 2 + 1j * RISE
    return z, np.exp(z) * slope / 1j


@dataclass(frozen=True)
class Relaxing:
    """A layer: `thickness` (mm), permittivity at high frequency, conductivity over eps_0 `kappa`
    (1/s), and Debye poles as columns `strength` (K,) and `tau` (K,) in s.
    """

    thickness: Values
    eps_inf: Values
    kappa: float
    strength: Floats
    tau: Floats

    @classmethod
    def of(cls, layer: Layer) -> Relaxing:
        """From a layer with a number, or a `Dielectric` whose poles are Debye's."""
        eps: Any = layer.eps_r
        if not isinstance(eps, Dielectric):
            return cls(layer.thickness, eps, 0.0, np.zeros(0), np.zeros(0))
        strength, tau = np.array([pole[:2] for pole in eps.poles]).reshape(-1, 2).T
        return cls(layer.thickness, eps.eps_inf, eps.conductivity / eps_0, strength, tau)

    @property
    def static(self) -> Values:
        """Permittivity of a field that does not change."""
        return self.eps_inf + float(np.sum(self.strength))

    @property
    def fastest(self) -> float:
        """A rate (1/s) that none of its own exceeds."""
        lowest = float(np.min(self.eps_inf))
        return self.kappa / lowest + float(np.sum((1.0 + self.strength / lowest) / self.tau))

    def poles(self, like: Any) -> tuple[Any, Any]:
        """Strengths and times with axes for arrays of the shape of `like`."""
        shape = (-1,) + (1,) * np.ndim(like)
        return self.strength.reshape(shape), self.tau.reshape(shape)

    def admittance(self, s: Any) -> Any:
        """Y at the complex rates s (1/s)."""
        strength, tau = self.poles(s)
        return self.eps_inf + self.kappa / s + np.sum(strength / (1.0 + s * tau), axis=0)

    def left(self, s: Any, polarisation: Any) -> Any:
        """h (S, ...) at the complex rates s (S, ...), of polarisations (K, ...)."""
        tau = self.poles(s)[1]
        return np.einsum("ks...,k...->s...", tau / (1.0 + s * tau), polarisation)

    def polarised(self, s: Any, weight: Any, field: Any) -> Any:
        """Polarisations (K, ...) under a field with the transform (S, ...) at s, by their sum over
        the contour with the weight (S, ...).
        """
        strength, tau = self.poles(s)
        return np.einsum("ks...,s...->k...", weight * strength / (1.0 + s * tau), field)

    def energy(self, field: Any, polarisation: Any) -> Any:
        """Per area over eps_0, V^2/mm."""
        strength = self.poles(field)[0]
        return 0.5 * self.thickness * (self.eps_inf * field**2 + np.sum(polarisation**2 / strength, axis=0))

    def loss(self, field: Any, polarisation: Any) -> Any:
        """Power per area over eps_0 that conduction and relaxation dissipate, V^2/mm/s."""
        strength, tau = self.poles(field)
        relaxing = np.sum((strength * field - polarisation) ** 2 / (strength * tau), axis=0)
        return self.thickness * (self.kappa * field**2 + relaxing)


@dataclass(frozen=True)
class RelaxingSandwich:
    """What a `Sandwich` is to layers of constants, with dielectrics that relax: `skin`, `insulator`,
    the gap's conductivity over eps_0 `leak` (1/s), the reduced thickness (mm) of both that force
    laws see, `reference`, and the gap's permittivity.

    The state (M, ...) has the two charges, then the polarisations of skin and insulator.
    """

    skin: Relaxing
    insulator: Relaxing
    leak: float
    reference: Values
    gap_eps_r: float = 1.0

    @property
    def states(self) -> int:
        """M."""
        return 2 + self.skin.tau.size + self.insulator.tau.size

    @property
    def fastest(self) -> float:
        """A rate (1/s) that no charge and no polarisation exceeds."""
        return self.skin.fastest + self.leak / self.gap_eps_r + self.insulator.fastest

    def effective(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Voltage (V) that makes the same field in the gap of layers without charges."""
        return self.fields(gap, voltage, charges)[1] * (gap / self.gap_eps_r + self.reference)

    def fields(self, gap: Any, voltage: Values, charges: Any) -> tuple[Any, Any, Any]:
        """Displacements over eps_0 (V/mm) in skin, gap and insulator."""
        first, third = (np.sum(part, axis=0) for part in self._polarisations(charges))
        skin, film = (one.thickness / one.eps_inf for one in (self.skin, self.insulator))
        driven = voltage + skin * (charges[0] + first) - film * (charges[1] - third)
        middle = driven / (skin + gap / self.gap_eps_r + film)
        return middle - charges[0], middle, middle + charges[1]

    def crossing(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Current over eps_0 (V/mm/s) that is conducted through the skin."""
        return self.skin.kappa * self._electric(gap, voltage, charges)[0]

    def energy(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Energy of the field per area over eps_0, V^2/mm."""
        E_1, E_2, E_3 = self._electric(gap, voltage, charges)
        first, third = self._polarisations(charges)
        air = 0.5 * gap * self.gap_eps_r * E_2**2
        return self.skin.energy(E_1, first) + air + self.insulator.energy(E_3, third)

    def loss(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Power per area over eps_0 that leaks and relaxes, V^2/mm/s."""
        E_1, E_2, E_3 = self._electric(gap, voltage, charges)
        first, third = self._polarisations(charges)
        return self.skin.loss(E_1, first) + gap * self.leak * E_2**2 + self.insulator.loss(E_3, third)

    def after(self, gap: Any, charges: Any, before: Values, after: Values, seconds: Values) -> Any:
        """State (M, ...) that `charges` become at a fixed `gap` (mm) in so many `seconds`, the
        voltage going straight from `before` to `after` (V).
        """
        axes = np.broadcast(gap, before, after, seconds, charges[0]).ndim
        if not np.any(seconds):
            return np.array(charges, dtype=float)
        time, charges = _lifted(np.asarray(seconds, dtype=float), axes), np.asarray(charges)
        charges = np.stack([_lifted(one, axes) for one in charges])
        z, weight = (one.reshape((-1,) + (1,) * axes) for one in _contour())
        s = z / time
        volts = (before + (np.asarray(after) - before) / z) / s
        fields, slopes = self._fields(np.real(gap), charges, volts, s)
        value = self._moved(s, weight / time, fields)
        value = value + self._kept(charges, time)
        if np.iscomplexobj(gap):
            value = value + 1j * np.imag(gap) * self._moved(s, weight / time, slopes)
        return value

    def _kept(self, charges: Any, time: Any) -> Any:
        """What is left of a state (M, ...) after the `time` without fields."""
        tau = np.concatenate([one.poles(time)[1] for one in (self.skin, self.insulator)])
        polarised = charges[2:] * np.exp(-time / tau)
        return np.concatenate([np.broadcast_to(charges[:2], (2, *polarised.shape[1:])), polarised])

    def _fields(self, gap: Any, start: Any, volts: Any, s: Any) -> tuple[Any, Any]:
        """The transforms (S, ...) of the three fields at s under the voltage's, and their derivatives
        by the gap.
        """
        first, third = self._polarisations(start)
        left, right = self.skin.left(s, first) + start[0] / s, self.insulator.left(s, third) - start[1] / s
        Y_1, Y_3 = self.skin.admittance(s), self.insulator.admittance(s)
        Y_2 = self.gap_eps_r + self.leak / s
        z_1, z_3 = self.skin.thickness / Y_1, self.insulator.thickness / Y_3
        total = z_1 + gap / Y_2 + z_3
        through = (volts + z_1 * left + z_3 * right) / total
        steeper = -through / (Y_2 * total)
        fields = (through - left) / Y_1, through / Y_2, (through - right) / Y_3
        return fields, (steeper / Y_1, steeper / Y_2, steeper / Y_3)

    def _moved(self, s: Any, weight: Any, fields: tuple[Any, Any, Any]) -> Any:
        """What the transforms (S, ...) of the three fields add to the state (M, ...), by the sum over
        the contour with the `weight` (S, ...).
        """
        E_1, E_2, E_3 = fields
        share = weight / s
        first = np.sum(share * (self.skin.kappa * E_1 - self.leak * E_2), axis=0)
        second = np.sum(share * (self.leak * E_2 - self.insulator.kappa * E_3), axis=0)
        parts = [self.skin.polarised(s, weight, E_1), self.insulator.polarised(s, weight, E_3)]
        return 2.0 * np.real(np.concatenate([np.stack([first, second]), *parts]))

    def _polarisations(self, charges: Any) -> tuple[Any, Any]:
        """Those of skin and insulator (K, ...) in a state."""
        end = 2 + self.skin.tau.size
        return charges[2:end], charges[end:]

    def _electric(self, gap: Any, voltage: Values, charges: Any) -> tuple[Any, Any, Any]:
        """Fields (V/mm) in skin, gap and insulator."""
        D_1, D_2, D_3 = self.fields(gap, voltage, charges)
        first, third = (np.sum(part, axis=0) for part in self._polarisations(charges))
        return (D_1 - first) / self.skin.eps_inf, D_2 / self.gap_eps_r, (D_3 - third) / self.insulator.eps_inf


def _lifted(values: Any, axes: int) -> Any:
    """With so many axes, the further ones in front."""
    return values.reshape((1,) * (axes - values.ndim) + values.shape)


def stack_of(
    skin: Layer, insulator: Layer, *, frequency: float | None, gap_conductivity: float, gap_eps_r: float
) -> Sandwich | RelaxingSandwich:
    """The layers of a voltage that is resolved in time, as their charges see them: a `Sandwich` where
    nothing relaxes. `frequency` (Hz) is the voltage's, None of a direct one.
    """
    if not (relaxes(skin) or relaxes(insulator)):
        given = {"gap_conductivity": gap_conductivity, "gap_eps_r": gap_eps_r}
        return Sandwich.of(skin, insulator, frequency=frequency, **given)
    layers = [Relaxing.of(debye_layer(layer, frequency)) for layer in (skin, insulator)]
    reference = sum(layer.thickness / seen_at(layer, frequency)[0] for layer in (skin, insulator))
    return RelaxingSandwich(layers[0], layers[1], gap_conductivity / eps_0, reference, gap_eps_r)


def seen_at(layer: Layer, frequency: float | None) -> tuple[Values, Values]:
    """Relative permittivity and conductivity (S/m) of a layer at a `frequency` (Hz), those of direct
    current without one.

    >>> seen_at(Layer(0.3, Dielectric(4.0, [(100.0, 1e-3, 0.0)], 2e-4)), None)
    (104.0, 0.0002)
    """
    if frequency is not None or not relaxes(layer):
        return constants(layer, frequency)
    steady = debye_layer(layer, None)
    return Relaxing.of(steady).static, steady.eps_r.conductivity


def relaxes(layer: Layer) -> bool:
    """Whether the permittivity of a layer depends on the frequency by more than its conductivity."""
    return callable(getattr(layer.eps_r, "permittivity", None)) and getattr(layer.eps_r, "poles", None) != ()


def debye_layer(layer: Layer, frequency: float | None) -> Layer:
    """The layer with a sum of Debye poles for its dielectric: its own, or fitted over `BAND` around
    the `frequency` (Hz). Raises InputError for a dielectric that has none.

    >>> from evfem.electrostatics.dielectrics import SKINS
    >>> len(debye_layer(Layer(0.3, SKINS["gabriel_dry"]), 75.0).eps_r.poles)
    3
    """
    of: Any = layer.eps_r
    if not relaxes(layer) or _is_debye(of):
        return layer
    if not callable(getattr(of, "debye", None)):
        allowed = "a Dielectric or a DielectricTable where the voltage is resolved in time"
        raise InputError("eps_r", quoted(of), allowed)
    low, high = BAND
    if frequency is not None:
        low, high = min(low, frequency / WIDER), max(high, frequency * WIDER)
    return Layer(layer.thickness, _fitted(of, low, high))


def _is_debye(of: Any) -> bool:
    """Whether all poles are Debye's."""
    return isinstance(of, Dielectric) and all(not any(pole[2:]) and len(pole) == 3 for pole in of.poles)


@lru_cache(maxsize=32)
def _fitted(of: Any, low: float, high: float) -> Dielectric:
    found: Dielectric = of.debye(low, high, FITTED)
    return found

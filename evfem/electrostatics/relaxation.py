r"""Charge between skin, gap and insulator: three layers in series that conduct and relax.

Layers k = 1 (stratum corneum), 2 (gap), 3 (insulator) with thickness d, permittivity
:math:`\varepsilon_\infty + \sum_k \Delta_k / (1 + i\omega\tau_k)` (Debye poles) and conductivity
:math:`\sigma = \varepsilon_0 \kappa` have charges x_1, x_2 over eps_0 on the two faces of the gap, and a
polarisation p_k (over eps_0, a field) for each pole:

.. math:: D = \varepsilon_\infty E + \sum_k p_k, \qquad \tau_k \dot p_k = \Delta_k E - p_k, \qquad
          D_1 = D_2 - x_1, \quad D_3 = D_2 + x_2, \\
          \dot x_1 = \kappa_1 E_1 - \kappa_2 E_2, \quad \dot x_2 = \kappa_2 E_2 - \kappa_3 E_3, \qquad
          \sum_j d_j E_j = U(t) .

For a fixed gap this is linear, with real, negative rates. With given charges every force law stays what it
is, under the voltage of the same field in the gap.

Laplace's transform makes it algebra: with the admittance
:math:`Y_j(s) = \varepsilon_{\infty j} + \kappa_j/s + \sum_k \Delta_k/(1 + s\tau_k)`,
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

A force law sees the layers with their permittivity at the voltage's frequency (static without one). Other
dielectrics are fitted by Debye poles (`debye_layer`).
Lengths in mm, charges and polarisations over eps_0 in V/mm,
rates in 1/s. Arguments broadcast; gaps may have a small imaginary part (for derivatives).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values
from evfem.electrostatics.dielectrics import Dielectric, debye_layer, seen_at
from evfem.electrostatics.laws import Layer, eps_0

#: points of Talbot's contour, and Weideman's constants
POINTS, SCALE, TURN, SHIFT, RISE = 26, 0.5017, 0.6407, 0.6122, 0.2645


def contour() -> tuple[Any, Any]:
    """Points z and weights of the upper half of Talbot's contour."""
    theta = np.pi * np.arange(1, POINTS, 2) / POINTS
    turned = TURN * theta
    z = POINTS * (SCALE * theta / np.tan(turned) - SHIFT + 1j * RISE * theta)
    slope = SCALE / np.tan(turned) - SCALE * turned / np.sin(turned) ** 2 + 1j * RISE
    return z, np.exp(z) * slope / 1j


@dataclass(frozen=True)
class Relaxing:
    """A layer: `thickness` (mm), eps_r, `kappa` = sigma/eps_0 (1/s), Debye `strength`, `tau` (K,) in s."""

    thickness: Values
    eps_inf: Values
    kappa: Values
    strength: Floats = field(default_factory=lambda: np.zeros(0))
    tau: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, layer: Layer) -> Relaxing:
        """From a layer with a number, or a `Dielectric` whose poles are Debye's."""
        eps: Any = layer.eps_r
        if not isinstance(eps, Dielectric):
            return cls(layer.thickness, eps, 0.0)
        strength, tau = np.array([pole[:2] for pole in eps.poles]).reshape(-1, 2).T
        return cls(layer.thickness, eps.eps_inf, eps.conductivity / eps_0, strength, tau)

    @property
    def fastest(self) -> float:
        """A rate (1/s) that none of its own exceeds."""
        lowest = float(np.min(self.eps_inf))
        return float(np.max(self.kappa)) / lowest + float(np.sum((1.0 + self.strength / lowest) / self.tau))

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
        """Polarisations (K, ...) under a field with transform (S, ...), summed over the contour by weight."""
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
class Sandwich:
    """Layers in series as the charges see them: `skin`, `insulator`, the gap's conductivity over eps_0 `leak`
    (1/s) and permittivity, the reduced thickness (mm) that laws see, `reference`. The state (M, ...) has the
    two charges, then the polarisations of skin and insulator.
    """

    skin: Relaxing
    insulator: Relaxing
    leak: Values
    reference: Values
    gap_eps_r: float = 1.0

    @classmethod
    def of(
        cls, skin: Layer, insulator: Layer, *, frequency: float | None, gap_conductivity: float,
        gap_eps_r: float = 1.0,
    ) -> Sandwich:  # fmt: skip
        """Of two solid layers; `frequency` (Hz) is the voltage's, None of a direct one."""
        layers = [Relaxing.of(debye_layer(layer, frequency)) for layer in (skin, insulator)]
        reference = sum(layer.thickness / seen_at(layer, frequency)[0] for layer in (skin, insulator))
        return cls(layers[0], layers[1], gap_conductivity / eps_0, reference, gap_eps_r)

    @property
    def states(self) -> int:
        """M."""
        return 2 + self.skin.tau.size + self.insulator.tau.size

    @property
    def fastest(self) -> float:
        """A rate (1/s) that no charge and no polarisation exceeds."""
        return self.skin.fastest + float(np.max(self.leak)) / self.gap_eps_r + self.insulator.fastest

    def effective(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Voltage (V) that makes the same field in the gap of layers without charges, whatever the `gap`."""
        return self.fields(gap, voltage, charges)[1] * (gap / self.gap_eps_r + self.reference)

    def fields(self, gap: Any, voltage: Values, charges: Any) -> tuple[Any, Any, Any]:
        """Displacements over eps_0 (V/mm) in skin, gap and insulator."""
        first, third = (np.sum(part, axis=0) for part in self._polarisations(charges))
        skin, air, film = self.reduced(gap)
        driving = voltage + skin * (charges[0] + first) - film * (charges[1] - third)
        middle = driving / (skin + air + film)
        return middle - charges[0], middle, middle + charges[1]

    def reduced(self, gap: Any) -> tuple[Any, Any, Any]:
        """Thickness over permittivity (mm) at high frequency of skin, gap and insulator."""
        skin, film = (one.thickness / one.eps_inf for one in (self.skin, self.insulator))
        return skin, gap / self.gap_eps_r, film

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

    def after(self, gap: Any, charges: Any, before: Any, after: Any, seconds: Any, bent: Any = None) -> Any:
        """State (M, ...) of `charges` after `seconds` at `gap` (mm), voltage from `before` to `after` (V) on
        a straight line, and beyond that of the transform `bent` at complex rates (S, ...).
        """
        charges = np.asarray(charges, dtype=float)
        axes, lasts = np.broadcast(gap, before, after, seconds, charges[0]).ndim, np.asarray(seconds) > 0.0
        if not lasts.any():
            return charges.copy()
        time = _lifted(np.where(lasts, seconds, 1.0), axes)
        charges = np.stack([_lifted(one, axes) for one in charges])
        z, weight = (one.reshape((-1,) + (1,) * axes) for one in contour())
        s = z / time
        volts = (before + (np.asarray(after) - before) / z) / s + (bent(s) if bent else 0.0)
        fields, slopes = self._fields(np.real(gap), charges, volts, s)
        value = self._moved(s, weight / time, fields)
        value = value + self._kept(charges, time)
        if np.iscomplexobj(gap):
            value = value + 1j * np.imag(gap) * self._moved(s, weight / time, slopes)
        return np.where(lasts, value, charges)

    def _kept(self, charges: Any, time: Any) -> Any:
        """Decay of a state (M, ...) over the `time` without fields."""
        tau = np.concatenate([one.poles(time)[1] for one in (self.skin, self.insulator)])
        polarised = charges[2:] * np.exp(-time / tau)
        return np.concatenate([np.broadcast_to(charges[:2], (2, *polarised.shape[1:])), polarised])

    def _fields(self, gap: Any, start: Any, volts: Any, s: Any) -> tuple[Any, Any]:
        """Transforms (S, ...) at s of the three fields under the voltage's, and derivatives by the gap."""
        (left, right), (Y_1, Y_2, Y_3), total, own = self._series(gap, start, s)
        through = (volts + own) / total
        steeper = -through / (Y_2 * total)
        fields = (through - left) / Y_1, through / Y_2, (through - right) / Y_3
        return fields, (steeper / Y_1, steeper / Y_2, steeper / Y_3)

    def _series(self, gap: Any, start: Any, s: Any) -> tuple[Any, Any, Any, Any]:
        """What a state leaves in skin and film, admittances, the sum of z, the voltage of what is left."""
        first, third = self._polarisations(start)
        left, right = self.skin.left(s, first) + start[0] / s, self.insulator.left(s, third) - start[1] / s
        Y_1, Y_3 = self.skin.admittance(s), self.insulator.admittance(s)
        Y_2 = self.gap_eps_r + self.leak / s
        z_1, z_3 = self.skin.thickness / Y_1, self.insulator.thickness / Y_3
        return (left, right), (Y_1, Y_2, Y_3), z_1 + gap / Y_2 + z_3, z_1 * left + z_3 * right

    def on_electrode(self, gap: Any, start: Any, s: Any) -> tuple[Any, Any]:
        """Charge density over eps_0 below an insulator that does not conduct: by the voltage, without one."""
        _, _, total, own = self._series(gap, start, s)
        return 1.0 / total, own / total + start[1] / s

    def _moved(self, s: Any, weight: Any, fields: tuple[Any, Any, Any]) -> Any:
        """What transforms (S, ...) of the fields add to the state (M, ...), summed by `weight`."""
        E_1, E_2, E_3 = fields
        share = weight / s
        first = np.sum(share * (self.skin.kappa * E_1 - self.leak * E_2), axis=0)
        second = np.sum(share * (self.leak * E_2 - self.insulator.kappa * E_3), axis=0)
        parts = [self.skin.polarised(s, weight, E_1), self.insulator.polarised(s, weight, E_3)]
        return 2.0 * np.real(np.concatenate([np.stack([first, second]), *parts]))

    def _polarisations(self, charges: Any) -> tuple[Any, Any]:
        """Polarisations of skin and insulator (K, ...) in a state."""
        end = 2 + self.skin.tau.size
        return charges[2:end], charges[end:]

    def _electric(self, gap: Any, voltage: Values, charges: Any) -> tuple[Any, Any, Any]:
        """Fields (V/mm) in skin, gap and insulator."""
        D_1, D_2, D_3 = self.fields(gap, voltage, charges)
        first, third = (np.sum(part, axis=0) for part in self._polarisations(charges))
        return (D_1 - first) / self.skin.eps_inf, D_2 / self.gap_eps_r, (D_3 - third) / self.insulator.eps_inf

    @property
    def rates(self) -> tuple[Values, Values, Values]:
        """Conductivity over permittivity at high frequency (1/s) of skin, gap and insulator."""
        skin, film = (one.kappa / one.eps_inf for one in (self.skin, self.insulator))
        return skin, self.leak / self.gap_eps_r, film


def _lifted(values: Any, axes: int) -> Any:
    """With so many axes, the further ones in front."""
    return values.reshape((1,) * (axes - values.ndim) + values.shape)

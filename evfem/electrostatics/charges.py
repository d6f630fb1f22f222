r"""Charge between skin, gap and insulator: three conducting layers in series (Maxwell and Wagner).

Layers k = 1 (stratum corneum), 2 (gap), 3 (insulator) with thickness d, permittivity eps and
conductivity sigma carry the displacement :math:`D_k = D + \sum_{j<k} r_j` with the charges r_1, r_2
per area on the two faces of the gap. With x = r / eps_0, s_k = d_k / eps_k, S = s_1 + s_2 + s_3 and
the rates :math:`\kappa_k = \sigma_k / (\varepsilon_0 \varepsilon_k)`,

.. math:: \sum_k d_k E_k = U(t), \qquad \dot r_k = \sigma_k E_k - \sigma_{k+1} E_{k+1},
          \qquad E_k = D_k / (\varepsilon_0 \varepsilon_k)

is linear for a fixed gap,

.. math:: \dot x = A x + b U, \quad
   A = \frac1S \begin{pmatrix}
       -\kappa_1 (s_2 + s_3) - \kappa_2 s_1 & -(\kappa_1 - \kappa_2) s_3 \\
       (\kappa_2 - \kappa_3) s_1 & -\kappa_2 s_3 - \kappa_3 (s_1 + s_2) \end{pmatrix}, \quad
   b = \frac1S \begin{pmatrix} \kappa_1 - \kappa_2 \\ \kappa_2 - \kappa_3 \end{pmatrix},

with two real, negative rates :math:`\lambda`. Under a voltage that goes straight from U_0 to U_1 in
the time h the exponential integrator is exact,

.. math:: x(h) = e^{Ah} x_0 + h\,\varphi_1(Ah)\,b\,U_0 + h\,\varphi_2(Ah)\,b\,(U_1 - U_0),

with :math:`\varphi_1(z) = (e^z - 1)/z`, :math:`\varphi_2(z) = (\varphi_1(z) - 1)/z`, and functions
of A by their divided difference on the two rates. The field in the gap is that of a stack without
charges under the **effective voltage**

.. math:: V = U + s_1 x_1 - s_3 x_2, \qquad E_2 = V / (d_2 + \varepsilon_2 (s_1 + s_3)),

so that with given charges every force law stays what it is. Lengths in mm, charges over eps_0 in
V/mm (fields), rates in 1/s. All arguments broadcast; gaps may be complex (for derivatives).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.checks import Values
from evfem.electrostatics.laws import Layer, eps_0
from evfem.errors import InputError, quoted

#: magnitude of z below which phi_2 is summed as a series, and its terms
SMALL, TERMS = 0.2, 12


def _phi(z: Any) -> tuple[Any, Any, Any]:
    """exp(z), phi_1(z), phi_2(z) to rounding, for z with a real part up to 0."""
    small = np.abs(z) < SMALL
    safe, near = np.where(small, 1.0, z), np.where(small, z, 0.0)
    term = series = 0.5 * np.ones_like(near)
    for k in range(3, 3 + TERMS):
        term = term * near / k
        series = series + term
    second = np.where(small, series, (np.expm1(safe) / safe - 1.0) / safe)
    return np.exp(z), 1.0 + z * second, second


def _difference(f: tuple[Any, Any], rates: tuple[Any, Any]) -> Any:
    """Divided difference of a function over two rates; A is a multiple of one where they are one,
    and it does not count.
    """
    apart = rates[0] - rates[1]
    same = apart == 0.0
    return np.where(same, 0.0, (f[0] - f[1]) / np.where(same, 1.0, apart))


@dataclass(frozen=True)
class Sandwich:
    """Layers in series as the charges see them: reduced thicknesses (mm) of `skin` and `insulator`,
    relaxation rates (1/s) of skin, gap and insulator, and the gap's permittivity. Numbers, or
    arrays over nodes.
    """

    skin: Values
    insulator: Values
    rates: tuple[Values, Values, Values]
    gap_eps_r: float = 1.0

    @classmethod
    def of(
        cls, skin: Layer, insulator: Layer, *, frequency: Values | None, gap_conductivity: Values,
        gap_eps_r: float = 1.0,
    ) -> Sandwich:  # fmt: skip
        """From the two solid layers: dielectrics among them by permittivity and conductivity at
        `frequency` (Hz), or without one if they depend on it by their conductivity alone.
        """
        (eps_1, sigma_1), (eps_3, sigma_3) = (constants(layer, frequency) for layer in (skin, insulator))
        rates = (sigma_1 / (eps_0 * eps_1), gap_conductivity / (eps_0 * gap_eps_r), sigma_3 / (eps_0 * eps_3))
        return cls(skin.thickness / eps_1, insulator.thickness / eps_3, rates, gap_eps_r)

    #: charges of a node
    states = 2

    @property
    def reference(self) -> Any:
        """Reduced thickness (mm) of the solids, as force laws see them."""
        return self.skin + self.insulator

    @property
    def fastest(self) -> float:
        """A rate (1/s) that no charge exceeds."""
        return sum(float(np.max(rate)) for rate in self.rates)

    def effective(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Voltage (V) that makes the same field in the gap without charges, whatever the `gap`;
        `charges` (2, ...).
        """
        return voltage + self.skin * charges[0] - self.insulator * charges[1]

    def voltage_at(self, gap: Any, charges: Any, displacement: Values) -> Any:
        """Voltage (V) of an electrode that has the `displacement` over eps_0 (V/mm): an open circuit
        keeps that, and so the force, whatever the gap.
        """
        film, middle = displacement, displacement - charges[1]
        skin = middle - charges[0]
        return self.skin * skin + gap / self.gap_eps_r * middle + self.insulator * film

    def fields(self, gap: Any, voltage: Values, charges: Any) -> tuple[Any, Any, Any]:
        """Displacements over eps_0 (V/mm) in skin, gap and insulator."""
        total = self.skin + gap / self.gap_eps_r + self.insulator
        middle = self.effective(gap, voltage, charges) / total
        return middle - charges[0], middle, middle + charges[1]

    def crossing(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Current over eps_0 (V/mm/s) that is conducted through the skin."""
        return self.rates[0] * self.fields(gap, voltage, charges)[0]

    def energy(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Energy of the field per area over eps_0, V^2/mm."""
        return 0.5 * sum(s * D**2 for s, D in self._through(gap, voltage, charges))

    def loss(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Power per area over eps_0 that leaks, V^2/mm/s."""
        layers = zip(self.rates, self._through(gap, voltage, charges), strict=True)
        return sum(rate * s * D**2 for rate, (s, D) in layers)

    def _through(self, gap: Any, voltage: Values, charges: Any) -> Any:
        """Reduced thickness (mm) and displacement over eps_0 (V/mm) of each layer."""
        fields = self.fields(gap, voltage, charges)
        return zip((self.skin, gap / self.gap_eps_r, self.insulator), fields, strict=True)

    def after(self, gap: Any, charges: Any, before: Values, after: Values, seconds: Values) -> Any:
        """Charges (2, ...) that `charges` become at a fixed `gap` (mm) in so many `seconds`, the
        voltage going straight from `before` to `after` (V).
        """
        (a11, a12, a21, a22), (b1, b2) = self._system(gap)
        slow, fast = self.eigenvalues(gap)
        of_slow, of_fast = _phi(slow * seconds), _phi(fast * seconds)
        drive, ramp = seconds * before, seconds * (np.asarray(after) - before)
        inputs = ((charges[0], charges[1]), (b1 * drive, b2 * drive), (b1 * ramp, b2 * ramp))
        result: list[Any] = [0.0, 0.0]
        for f, g, (x, y) in zip(of_slow, of_fast, inputs, strict=True):
            slope = _difference((f, g), (slow, fast))
            result[0] = result[0] + f * x + slope * ((a11 - slow) * x + a12 * y)
            result[1] = result[1] + f * y + slope * (a21 * x + (a22 - slow) * y)
        return np.stack(np.broadcast_arrays(*result))

    def step_response(self, gap: Any, time: Values) -> Any:
        """Effective voltage at `time` (s) after a step of 1 V from no charge: straight from its
        start, its first slope and its end, so that it decays to rounding of itself.
        """
        k1, k2, k3 = self.rates
        slow, fast = self.eigenvalues(gap)
        total = self.skin + gap / self.gap_eps_r + self.insulator
        slope = (self.skin * (k1 - k2) - self.insulator * (k2 - k3)) / total
        product = self._determinant(gap) * total
        end = np.where(product > 0.0, k1 * k3 / np.where(product > 0.0, product, 1.0), 0.0) * total
        decay, faster = np.exp(slow * time), np.exp(fast * time)
        both = np.where(fast == slow, time * decay, _difference((decay, faster), (slow, fast)))
        return end + decay * (1.0 - end) + both * (slope - slow * (1.0 - end))

    def eigenvalues(self, gap: Any) -> tuple[Any, Any]:
        """The slower and the faster of the two rates (1/s, not positive) at a fixed `gap` (mm)."""
        (a11, a12, a21, a22), _ = self._system(gap)
        square = (0.5 * (a11 - a22)) ** 2 + a12 * a21
        root = np.sqrt(np.where(np.real(square) > 0.0, square, 0.0))
        fast = 0.5 * (a11 + a22) - root
        # the product of the rates is the determinant: so the slow one is right to rounding
        still = fast == 0.0
        return np.where(still, 0.0, self._determinant(gap) / np.where(still, 1.0, fast)), fast

    def _system(self, gap: Any) -> tuple[tuple[Any, Any, Any, Any], tuple[Any, Any]]:
        """A by rows, and b."""
        k1, k2, k3 = self.rates
        s1, s2, s3 = self.skin, gap / self.gap_eps_r, self.insulator
        total = s1 + s2 + s3
        rows = (-k1 * (s2 + s3) - k2 * s1, -(k1 - k2) * s3, (k2 - k3) * s1, -k2 * s3 - k3 * (s1 + s2))
        return tuple(entry / total for entry in rows), ((k1 - k2) / total, (k2 - k3) / total)

    def _determinant(self, gap: Any) -> Any:
        """Product of the two rates of A."""
        k1, k2, k3 = self.rates
        s1, s2, s3 = self.skin, gap / self.gap_eps_r, self.insulator
        return (k1 * k2 * s3 + k1 * k3 * s2 + k2 * k3 * s1) / (s1 + s2 + s3)


def constants(layer: Layer, frequency: Values | None) -> tuple[Values, Values]:
    """Relative permittivity and conductivity (S/m) of a layer at a frequency (Hz); without one
    those of a layer that does not depend on it.
    """
    of: Any = layer.eps_r
    if not callable(getattr(of, "permittivity", None)):
        return of, 0.0
    if frequency is not None:
        return np.real(of.permittivity(frequency)), of.conductivity_at(frequency)
    if getattr(of, "poles", None) == ():
        return of.eps_inf, of.conductivity
    raise InputError(
        "eps_r", quoted(of), "a dielectric without poles, or a frequency in Hz at which to take it"
    )

r"""Closed forms of a plate under alternating, stepped and square voltage, with layers that conduct,
and the harmonics of a voltage that repeats.

Under a sine of the effective voltage U and the angular frequency w, every layer j has the complex
length :math:`d_j / \varepsilon_j^*(\omega)` (`evfem.electrostatics.dielectrics`), and with the gap's
:math:`\varepsilon_g^* = 1 + \sigma_g / (i\omega\varepsilon_0)`

.. math:: z = \varepsilon_g^* \sum_j \frac{d_j}{\varepsilon_j^*} = z' + i z'', \qquad
          E_g = \frac{U}{g + z}, \qquad
          \bar p = \frac{\varepsilon_0 U^2}{2\,[(g + z')^2 + z''^2]} .

The pressure itself swings around its mean with twice the frequency,
:math:`p(t) = \bar p\,[1 + \cos(2\omega t + 2 \arg E_g)]`. After a step from no charge the field
decays with two rates (`evfem.electrostatics.relaxation`). A square wave +-U, slow enough for the skin
to be a conductor, leaks through the gap with :math:`\tau = (\varepsilon_0 / \sigma_g)(1 + g
\varepsilon_i / d_i)`, so that with a = 1 / (2 f tau)

.. math:: \bar p = p_0 \Big[\frac{2}{1 + e^{-a}}\Big]^2 \frac{1 - e^{-2a}}{2a}, \qquad
          p_0 = \frac{\varepsilon_0 U^2}{2 (g + d_i/\varepsilon_i)^2} .

The same stack is what an amplifier sees: over the area A the impedance

.. math:: Z A = \frac{g + z}{i\omega\varepsilon_0\varepsilon_g^*} .

Pressures in MPa, lengths in mm, V, Hz, s, S/m, ohm. All arguments broadcast; scalars give a number.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, above, at_least, finite, to_python
from evfem.electrostatics.dielectrics import constants, dielectric
from evfem.electrostatics.laws import Layer, Layers, StrongTroxel, eps_0, stacked
from evfem.electrostatics.relaxation import Relaxing, Sandwich
from evfem.errors import InputError, describe_value

_GAP, _SIGMA = "an air gap in mm, not negative", "a conductivity in S/m, not negative"


def complex_length(
    frequency: Values, *, skin: Any, skin_thickness: Values, insulator: Layer, gap_conductivity: Values = 0.0
) -> Values:
    """z in mm at `frequency` (Hz): what skin, insulator and a conducting gap add to the gap.

    `skin` is a name (`evfem.electrostatics.dielectrics.SKINS`), a file, a `Dielectric` or a number;
    `insulator` a `Layer`, or a list of them. Raises InputError for anything that is none of these.

    >>> from evfem import TOUCHSCREEN
    >>> skin = {"skin": "gabriel_dry", "skin_thickness": 0.3}
    >>> z = complex_length(1000.0, **skin, insulator=TOUCHSCREEN, gap_conductivity=1e-8)
    >>> f"{1e3 * z:.4f} um"
    '0.2940+0.0255j um'
    """
    layers = _layers(frequency, Layer(skin_thickness, dielectric(skin)), insulator, gap_conductivity)
    return to_python(np.asarray(layers.reduced) + 1j * np.asarray(layers.loss))


def alternating_pressure(
    gap: Values, voltage: Values, frequency: Values, *, skin: Any, skin_thickness: Values,
    insulator: Layer, gap_conductivity: Values = 0.0,
) -> Values:  # fmt: skip
    """Mean pressure in MPa on a plate over `gap` (mm) under a sine of the effective (rms) `voltage`
    in V at `frequency` in Hz.

    `skin`, `skin_thickness` (mm), `insulator` and `gap_conductivity` (S/m) as in `complex_length`.

    >>> from evfem import TOUCHSCREEN
    >>> given = {"skin": "gabriel_dry", "skin_thickness": 0.3, "insulator": TOUCHSCREEN}
    >>> round(1e6 * alternating_pressure(0.001, 100 / 2**0.5, 1000.0, **given), 1)     # Pa
    13455.5
    """
    gap = at_least("gap", gap, 0.0, _GAP)
    voltage = finite("voltage", voltage, "a voltage in V")
    layers = _layers(frequency, Layer(skin_thickness, dielectric(skin)), insulator, gap_conductivity)
    return StrongTroxel().traction(gap, voltage, layers)


def contact_impedance(
    gap: Values, area: Values, frequency: Values, *, skin: Any, skin_thickness: Values,
    insulator: Layer, gap_conductivity: Values = 0.0,
) -> Values:  # fmt: skip
    """Impedance in ohm, complex, of a plate with `area` (mm2) over `gap` (mm) at `frequency` (Hz).

    `skin`, `skin_thickness` (mm), `insulator` and `gap_conductivity` (S/m) as in `complex_length`.

    >>> from evfem import TOUCHSCREEN
    >>> given = {"skin": "gabriel_dry", "skin_thickness": 0.3, "insulator": TOUCHSCREEN}
    >>> Z = contact_impedance(0.001, 100.0, 1000.0, **given, gap_conductivity=1e-8)
    >>> f"{1e-3 * abs(Z):.3f} kohm at {np.degrees(np.angle(Z)):.3f} degrees"
    '228.973 kohm at -78.683 degrees'
    """
    gap = np.asarray(at_least("gap", gap, 0.0, _GAP))
    area = np.asarray(above("area", area, 0.0, "an area in mm2 above 0"))
    layers = _layers(frequency, Layer(skin_thickness, dielectric(skin)), insulator, gap_conductivity)
    return to_python(1.0 / (area * admittance(gap, frequency, layers, gap_conductivity)))


def admittance(
    gap: Any, frequency: Values, layers: Layers, gap_conductivity: Values = 0.0, gap_eps_r: float = 1.0
) -> Any:
    """Current over voltage per area, complex, in S/mm2, of a gap (mm) over `layers` at `frequency` (Hz)."""
    omega = 2.0 * np.pi * np.asarray(frequency)
    through = 1e-3 * (1j * omega * eps_0 * gap_eps_r + np.asarray(gap_conductivity))
    return through / (gap + gap_eps_r * (np.asarray(layers.reduced) + 1j * np.asarray(layers.loss)))


def _layers(frequency: Values, skin: Layer, insulator: Layer, gap_conductivity: Values) -> Layers:
    return Layers.of(skin, _layer(insulator), frequency=frequency, gap_conductivity=gap_conductivity)


def _layer(insulator: Any) -> Layer:
    found: Layer = stacked(insulator)
    if not isinstance(found, Layer):
        raise InputError(
            "insulator", describe_value(insulator), "a Layer(thickness, eps_r), or a list of them"
        )
    return found


def step_pressure(
    time: Values, gap: Values, voltage: Values, *, skin_eps_r: Values, skin_conductivity: Values,
    skin_thickness: Values, insulator: Layer, gap_conductivity: Values,
) -> Values:  # fmt: skip
    """Pressure in MPa on a plate over `gap` (mm), `time` seconds after a step from no charge to the
    direct `voltage` in V.

    It rises while the skin becomes a conductor, and decays while charge crosses the gap.

    >>> from evfem import TOUCHSCREEN
    >>> skin = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.3}
    >>> p = step_pressure([0.0, 1e-4, 1e-3], 0.001, 100.0, **skin, insulator=TOUCHSCREEN,
    ...                   gap_conductivity=1e-8)
    >>> (1e6 * p).round(1).tolist()                                                    # Pa
    [19149.1, 24709.9, 17508.2]
    """
    time = np.asarray(at_least("time", time, 0.0, "a time in s, not negative"))
    gap = np.asarray(at_least("gap", gap, 0.0, _GAP))
    voltage = np.asarray(finite("voltage", voltage, "a voltage in V"))
    stack = _sandwich(skin_eps_r, skin_conductivity, skin_thickness, insulator, gap_conductivity)
    layers = Layers(stack.reference, np.asarray(skin_thickness) + insulator.thickness)
    charges = stack.after(gap, np.zeros(2), voltage, voltage, time)
    return StrongTroxel().traction(gap, stack.effective(gap, voltage, charges), layers)


def step_rates(
    gap: Values, *, skin_eps_r: Values, skin_conductivity: Values, skin_thickness: Values,
    insulator: Layer, gap_conductivity: Values,
) -> tuple[Values, Values]:  # fmt: skip
    """The two rates in 1/s, the faster first, with which a step is followed at a fixed `gap` (mm).

    >>> from evfem import TOUCHSCREEN
    >>> skin = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.3}
    >>> rates = step_rates(0.001, **skin, insulator=TOUCHSCREEN, gap_conductivity=1e-8)
    >>> [round(rate, 3) for rate in rates]
    [16588.778, 228.292]
    """
    gap = np.asarray(at_least("gap", gap, 0.0, _GAP))
    stack = _sandwich(skin_eps_r, skin_conductivity, skin_thickness, insulator, gap_conductivity)
    (k1, k2, k3), (s1, s2, s3) = stack.rates, stack.reduced(gap)
    # sum of s_j r / (r - k_j) = 0: r^2 - a r + b = 0
    total = s1 + s2 + s3
    a = (s1 * (k2 + k3) + s2 * (k1 + k3) + s3 * (k1 + k2)) / total
    b = (s1 * k2 * k3 + s2 * k1 * k3 + s3 * k1 * k2) / total
    fast = 0.5 * (a + np.sqrt(np.maximum(a**2 - 4.0 * b, 0.0)))
    return to_python(np.asarray(fast)), to_python(np.asarray(b / np.where(fast > 0.0, fast, 1.0)))


def _sandwich(
    eps_r: Values, conductivity: Values, thickness: Values, insulator: Layer, gap_conductivity: Values
) -> Sandwich:
    """Skin by its constants, gap and insulator."""
    eps_r = np.asarray(at_least("skin_eps_r", eps_r, 1.0, "a relative permittivity of at least 1"))
    sigma = np.asarray(at_least("skin_conductivity", conductivity, 0.0, _SIGMA))
    leak = np.asarray(at_least("gap_conductivity", gap_conductivity, 0.0, _SIGMA))
    thickness = np.asarray(at_least("skin_thickness", thickness, 0.0, "a thickness in mm, not negative"))
    below, loss = constants(_layer(insulator), None)
    film = Relaxing(insulator.thickness, below, np.asarray(loss) / eps_0)
    reference = thickness / eps_r + insulator.thickness / below
    return Sandwich(Relaxing(thickness, eps_r, sigma / eps_0), film, leak / eps_0, reference)


def square_wave_pressure(
    frequency: Values, gap: Values, voltage: Values, *, insulator: Layer, gap_conductivity: Values
) -> Values:
    """Mean pressure in MPa over the cycle of a square wave of +-`voltage` (V), the skin a conductor
    and the insulator none.

    >>> from evfem import TOUCHSCREEN
    >>> film = {"insulator": TOUCHSCREEN, "gap_conductivity": 1e-8}
    >>> full = square_wave_pressure(1e9, 0.001, 100.0, **film)
    >>> round(square_wave_pressure(60.0, 0.001, 100.0, **film) / full, 6)
    0.775157
    """
    f = np.asarray(above("frequency", frequency, 0.0, "a frequency in Hz above 0"))
    gap = at_least("gap", gap, 0.0, _GAP)
    voltage = finite("voltage", voltage, "a voltage in V")
    leak = np.asarray(at_least("gap_conductivity", gap_conductivity, 0.0, _SIGMA))
    film = Layers.of(_layer(insulator))
    a = leak / (2.0 * f * eps_0 * (1.0 + np.asarray(gap) / film.reduced))
    charged = (2.0 / (1.0 + np.exp(-a))) ** 2
    safe = np.where(a > 0.0, a, 1.0)
    held = np.where(a > 0.0, -np.expm1(-2.0 * safe) / (2.0 * safe), 1.0)
    return to_python(StrongTroxel().traction(gap, voltage, film) * charged * held)


def corner_frequencies(
    gap: Values, *, skin_eps_r: Values, skin_conductivity: Values, skin_thickness: Values,
    insulator: Layer, gap_conductivity: Values,
) -> tuple[Values, Values]:  # fmt: skip
    """Frequencies in Hz below which the gap leaks, and below which the skin is a conductor, each
    with the other layers as capacitors beside it.

    >>> from evfem import TOUCHSCREEN
    >>> skin = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.3}
    >>> corners = corner_frequencies(0.001, **skin, insulator=TOUCHSCREEN, gap_conductivity=1e-8)
    >>> [round(f, 3) for f in corners]
    [36.684, 2614.987]
    """
    gap = np.asarray(at_least("gap", gap, 0.0, _GAP))
    stack = _sandwich(skin_eps_r, skin_conductivity, skin_thickness, insulator, gap_conductivity)
    (skin, leak, _), (solid, air, film) = stack.rates, stack.reduced(gap)
    of_gap, of_skin = leak / (1.0 + air / film), skin / (1.0 + solid / (air + film))
    return to_python(np.asarray(of_gap / (2.0 * np.pi))), to_python(np.asarray(of_skin / (2.0 * np.pi)))


#: odd harmonics of a square wave that count one by one, groups of those above, and the highest one
SINGLE, GROUPS, HIGHEST = 16, 20, 1_000_001
#: orders of samples that repeat: at least so many, and so many times the samples of a period
SMOOTH, PERIODS = 4096, 8


def square_harmonics() -> tuple[Floats, Floats]:
    """Orders and weights of the harmonics of a square wave, the sum of the weights being 1.

    >>> order, weight = square_harmonics()
    >>> order[:3].tolist(), weight[:2].round(4).tolist(), round(float(weight.sum()), 12)
    ([1.0, 3.0, 5.0], [0.8106, 0.0901], 1.0)
    """
    order = np.arange(1.0, HIGHEST, 2.0)
    weight = 8.0 / (np.pi * order) ** 2
    weight[-1] += 1.0 - weight.sum()
    return grouped(order, weight)


def grouped(order: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """The first `SINGLE` orders as they are, those above in at most `GROUPS` groups that are even in the
    logarithm, each at two orders: Gauss's rule for its weights, exact for cubics of the logarithm.
    """
    if order.size <= SINGLE:
        return order, weight
    ends = np.unique(np.geomspace(SINGLE, order.size, GROUPS + 1).astype(int))[:-1]
    parts = zip(np.split(order, ends), np.split(weight, ends), strict=True)
    (first, own), *groups = parts
    pairs = [_two(np.log(one), size) for one, size in groups]
    at, sizes = (np.concatenate(each) for each in zip(*pairs, strict=True))
    return np.concatenate([first, np.exp(at)]), np.concatenate([own, sizes])


def _two(x: Floats, weight: Floats) -> tuple[Floats, Floats]:
    """Gauss's rule with two points for a sum with weights that are not negative; one where x is one."""
    total = float(weight.sum())
    if total <= 0.0:
        return x[:1], np.zeros(1)
    mean = float(weight @ x) / total
    square, cube = (float(weight @ (x - mean) ** n) / total for n in (2, 3))
    if square <= 1e-24:
        return np.array([mean]), np.array([total])
    skew = cube / square
    away = 0.5 * (skew + np.array([-1.0, 1.0]) * np.sqrt(skew**2 + 4.0 * square))
    return mean + away, total * np.array([away[1], -away[0]]) / (away[1] - away[0])


def shares(order: Floats, square: Floats) -> tuple[float, Floats, Floats]:
    """Effective voltage (V) of squared ones (V^2) of some orders, and the orders with their shares of it."""
    total = float(square.sum())
    kept = square > 0.0
    return float(np.sqrt(total)), order[kept], square[kept] / (total if total > 0.0 else 1.0)


def voltage_fraction(electrodes: Any, x: Any) -> Any:
    """Fraction (...) of the voltage of the electrode below x (...) in mm, 0 where there is none, of
    `electrodes` as rows (from, to, fraction); 1 everywhere where they are None.

    >>> voltage_fraction([[-20.0, -0.1, 1.0], [0.1, 20.0, 0.0]], np.array([-1.0, 0.0, 1.0])).tolist()
    [1.0, 0.0, 0.0]
    """
    if electrodes is None:
        return np.ones_like(x)
    return np.asarray(sum(np.where((x >= a) & (x <= b), fraction, 0.0) for a, b, fraction in electrodes))

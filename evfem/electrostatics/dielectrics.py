r"""Dielectrics whose permittivity depends on the frequency, and those of skin.

With the time dependence exp(+i w t), w = 2 pi f, a dielectric has the complex relative permittivity

.. math:: \varepsilon^*(\omega) = \varepsilon_\infty
          + \sum_k \frac{\Delta\varepsilon_k}{(i\omega\tau_k)^{b_k} + (i\omega\tau_k)^{1-\alpha_k}}
          + \frac{\sigma}{i\omega\varepsilon_0},

with b = 0 the sum of Cole and Cole (K. S. Cole, R. H. Cole, J. Chem. Phys. 9 (1941) 341), as S. Gabriel, R.
W. Lau, C. Gabriel, Phys. Med. Biol. 41 (1996) 2271, use it for tissues; with b > 0 the function of V. Raicu,
N. Kitagawa, A. Irimajiri, Phys. Med. Biol. 45 (2000) L1, for skin. A pole with b = 0 and alpha = 0 is
Debye's: one relaxation in time. A sum of these with weights that are not negative, found by least squares at
given times :math:`\tau_k`, follows any passive dielectric over a band of frequencies (`Dielectric.debye`).

All presets were measured on the skin of the forearm; none is the stratum corneum of a fingertip.
Units: Hz, s, S/m.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, Within, above, at_least, real, set_frozen, to_python
from evfem.common.tables import TABLES, numbers, read_columns
from evfem.electrostatics.laws import Layer, eps_0
from evfem.errors import InputError, describe_value

HEADER = {"frequency": "Hz", "eps_r": "1", "conductivity": "S/m"}
_POLE = "(d_eps, tau in s, alpha), or with a fourth number for the lower exponent"
_TOLERANCE = "a relative error above 0, up to 0.5"
#: frequencies of a fit per decade; numbers of relaxation times that are tried, one after the other, and how
#: far (decades) they may reach beyond the band
PER_DECADE, BEYOND = 20, (0.0, 0.25, 0.5, 0.75, 1.0)
POLES = (1, 2, 3, 4, 6, 8, 10, 12, 14, 16, 20, 24, 32, 40)
#: frequencies (Hz) over which a dielectric becomes a sum of Debye poles, widened to `WIDER` times either
#: side of the voltage's; largest relative error
BAND, WIDER, FITTED = (1.0, 1e5), 10.0, 2e-3
#: the smallest number in a table, instead of 0 under a logarithm
LEAST = 1e-300


@runtime_checkable
class Permittivity(Protocol):
    """A dielectric as a layer uses it: permittivity at a frequency."""

    def permittivity(self, frequency: Any) -> Any:
        """Complex relative permittivity at frequencies in Hz, of their shape."""


class _Fitted:
    """Common methods of the dielectrics here."""

    def permittivity(self, frequency: Values) -> Values:
        raise NotImplementedError

    def conductivity_at(self, frequency: Values) -> Values:
        """All losses as a conductivity in S/m at frequencies in Hz: -w eps_0 Im(eps).

        >>> round(1e4 * SKINS["gabriel_dry"].conductivity_at(1000.0), 3)
        2.001
        """
        loss = np.imag(np.asarray(self.permittivity(frequency)))
        return to_python(-2.0 * np.pi * np.asarray(frequency) * eps_0 * loss)

    def debye(self, f_low: float, f_high: float, tolerance: float = 2e-3) -> Dielectric:
        """A sum of Debye poles that is this permittivity from `f_low` to `f_high` (Hz), within a
        relative error of `tolerance`.

        The fewest relaxation times, evenly spaced on a logarithmic scale, that reach it; weights,
        high-frequency permittivity and conductivity by non-negative least squares of the relative errors.
        Raises InputError where no sum of poles does, as for a table that no passive dielectric has.

        >>> skin = SKINS["gabriel_dry"].debye(1.0, 1e5, 2e-3)
        >>> sorted({pole[2] for pole in skin.poles})
        [0.0]
        """
        above("f_low", f_low, 0.0, "a frequency in Hz above 0")
        above("f_high", f_high, f_low, "a frequency in Hz above f_low")
        real("tolerance", tolerance, _TOLERANCE, Within(0.0, 0.5, above=True))
        best, decades = np.inf, float(np.log10(f_high / f_low))
        band = np.geomspace(f_low, f_high, 2 + int(np.ceil(PER_DECADE * decades)))
        ends = [
            (2.0 * np.pi * f_high * 10.0**beyond, 2.0 * np.pi * f_low / 10.0**beyond) for beyond in BEYOND
        ]
        for number in POLES:
            tried = [_fit(self, band, 1.0 / np.geomspace(*end, number)) for end in ends]
            found, error = min(tried, key=lambda one: one[1])
            if error <= tolerance:
                return found
            best = min(best, error)
        allowed = f"an error that Debye poles can reach; these come to {best:.2g}"
        raise InputError("tolerance", tolerance, allowed)


def _fit(of: _Fitted, frequency: Floats, times: Floats) -> tuple[Dielectric, float]:
    """The sum of Debye poles at these times closest to a permittivity, and its largest relative error."""
    from scipy.optimize import nnls

    wanted = np.asarray(of.permittivity(frequency))
    iw = 2j * np.pi * frequency
    parts = [np.ones_like(iw), 1.0 / (iw * eps_0), *(1.0 / (1.0 + iw * tau) for tau in times)]
    basis = np.stack(parts, axis=1) / np.abs(wanted)[:, None]
    scale = np.abs(basis).max(axis=0)
    rows = np.concatenate([basis.real, basis.imag]) / scale
    target = (wanted - 1.0) / np.abs(wanted)
    weight = nnls(rows, np.concatenate([target.real, target.imag]))[0] / scale
    poles = [(d, tau, 0.0) for d, tau in zip(weight[2:].tolist(), times.tolist(), strict=True) if d > 0.0]
    found = Dielectric(1.0 + float(weight[0]), poles, float(weight[1]))
    return found, float(np.max(np.abs(np.asarray(found.permittivity(frequency)) / wanted - 1.0)))


@dataclass(frozen=True)
class Dielectric(_Fitted):
    """A dielectric by its poles: permittivity at high frequency `eps_inf`, `poles` as rows (d_eps,
    tau in s, alpha) of Cole and Cole, and the `conductivity` (S/m) for direct current.

    A fourth number in a row is the lower exponent b of Raicu's function.

    >>> dry = Dielectric(4.0, [(32.0, 7.23e-12, 0.0), (1100.0, 32.48e-9, 0.2)], 2e-4)
    >>> round(dry.permittivity(1000.0).real, 2)
    1135.62
    """

    eps_inf: float = 1.0
    poles: Any = ()
    conductivity: float = 0.0

    def __post_init__(self) -> None:
        eps_inf = real("eps_inf", self.eps_inf, "a relative permittivity of at least 1", Within(1.0))
        allowed = "a conductivity in S/m, not negative"
        conductivity = real("conductivity", self.conductivity, allowed, Within(0.0))
        rows = tuple(_pole(f"poles[{i}]", row) for i, row in enumerate(self.poles))
        set_frozen(self, eps_inf=eps_inf, poles=rows, conductivity=conductivity)

    def permittivity(self, frequency: Values) -> Values:
        """Complex relative permittivity at `frequency` (Hz, any shape, above 0)."""
        f = np.asarray(above("frequency", frequency, 0.0, "a frequency in Hz above 0"))
        iw = 2j * np.pi * f
        value = self.eps_inf + self.conductivity / (iw * eps_0)
        for d_eps, tau, alpha, *lower in self.poles:
            low = (iw * tau) ** lower[0] if lower else 1.0
            value = value + d_eps / (low + (iw * tau) ** (1.0 - alpha))
        return to_python(value)


def _pole(key: str, row: Any) -> tuple[float, ...]:
    """A pole as floats, if it is one."""
    values = numbers(key, row, _POLE).tolist()
    if len(values) not in (3, 4):
        raise InputError(key, describe_value(row), _POLE)
    d_eps, tau, alpha, *lower = values
    if d_eps < 0.0 or not tau > 0.0 or not 0.0 <= alpha < 1.0 or not all(0.0 <= b < 1.0 for b in lower):
        allowed = "d_eps of at least 0, tau above 0, alpha (and the lower exponent) from 0 to below 1"
        raise InputError(key, describe_value(row), allowed)
    return tuple(values)


@dataclass(frozen=True, eq=False)
class DielectricTable(_Fitted):
    """A dielectric as it was measured: `frequency` (Hz), `eps_r` and `conductivity` (S/m, of all
    losses), straight lines between the rows on logarithmic scales, constant beyond them.

    >>> skin = DielectricTable([10.0, 1000.0], [2000.0, 500.0], [1e-4, 1e-4])
    >>> round(skin.permittivity(100.0).real, 9)
    1000.0
    """

    frequency: Any
    eps_r: Any
    conductivity: Any

    def __post_init__(self) -> None:
        columns = {name: numbers(name, getattr(self, name), f"a column of {name}") for name in HEADER}
        f, eps_r, sigma = columns.values()
        if not 0 < f.size == eps_r.size == sigma.size:
            sizes = " and ".join(str(column.size) for column in columns.values())
            raise InputError("frequency, eps_r, conductivity", f"{sizes} rows", "equally many, at least one")
        above("frequency", f, 0.0, "frequencies in Hz above 0")
        at_least("eps_r", eps_r, 1.0, "relative permittivities of at least 1")
        at_least("conductivity", sigma, 0.0, "conductivities in S/m, not negative")
        if np.any(np.diff(f) <= 0.0):
            raise InputError("frequency", "frequencies that do not grow", "frequencies in Hz that grow")
        set_frozen(self, **columns)

    def permittivity(self, frequency: Values) -> Values:
        """Complex relative permittivity at `frequency` (Hz, any shape, above 0)."""
        f = np.asarray(above("frequency", frequency, 0.0, "a frequency in Hz above 0"))
        place, at = np.log(self.frequency), np.log(f)
        eps_r, sigma = (
            np.exp(np.interp(at, place, np.log(np.maximum(column, LEAST))))
            for column in (self.eps_r, self.conductivity)
        )
        return to_python(eps_r + sigma / (2j * np.pi * f * eps_0))

    @classmethod
    def from_csv(cls, path: str | Path) -> DielectricTable:
        """Read a file with the header ``frequency,eps_r,conductivity``, a row in Hz and S/m each, or in the
        units of the header, ``frequency [kHz],eps_r,conductivity [S/cm]``.

        Raises InputError for a missing file, another header, and rows that are not three numbers.
        """
        return cls(*read_columns(Path(path), HEADER, "skin"))


#: skins by name: the constant that the package starts from, dry and wet skin after Gabriel et al. (1996),
#: and skin after Raicu et al. (2000), whose function has the frequency 2.51 MHz
SKINS: Mapping[str, Dielectric] = {
    "seed": Dielectric(1650.0),
    "gabriel_dry": Dielectric(4.0, [(32.0, 7.23e-12, 0.0), (1100.0, 32.48e-9, 0.2)], 2e-4),
    "gabriel_wet": Dielectric(
        4.0,
        [(39.0, 7.96e-12, 0.1), (280.0, 79.58e-9, 0.0), (3e4, 1.592e-6, 0.16), (3e4, 1.592e-3, 0.2)],
        4e-4,
    ),
    "raicu": Dielectric(61.0, [(2200.0, 1.0 / (2.0 * np.pi * 2.51e6), 0.152, 0.21)], 3.2e-5),
}


def dielectric(skin: Any) -> Any:
    """A skin by its name in `SKINS`, or by the path of its table; what is no text stays what it is.

    >>> dielectric("seed")
    Dielectric(eps_inf=1650.0, poles=(), conductivity=0.0)
    """
    if isinstance(skin, str) and skin in SKINS:
        return SKINS[skin]
    if isinstance(skin, Path) or (isinstance(skin, str) and skin.lower().endswith(TABLES)):
        return DielectricTable.from_csv(skin)
    if isinstance(skin, str):
        allowed = " | ".join([*SKINS, "a file .csv with the header " + ",".join(HEADER)])
        raise InputError("skin", describe_value(skin), allowed)
    return skin


def constants(layer: Layer, frequency: Values | None) -> tuple[Values, Values]:
    """Relative permittivity and conductivity (S/m) at a frequency (Hz) or, if constant, without."""
    of: Any = layer.eps_r
    if not callable(getattr(of, "permittivity", None)):
        return of, 0.0
    if frequency is not None:
        return np.real(of.permittivity(frequency)), of.conductivity_at(frequency)
    if getattr(of, "poles", None) == ():
        return of.eps_inf, of.conductivity
    raise InputError(
        "eps_r", describe_value(of), "a dielectric without poles, or a frequency in Hz at which to take it"
    )


def seen_at(layer: Layer, frequency: float | None) -> tuple[Values, Values]:
    """Relative permittivity and conductivity (S/m) of a layer at a `frequency` (Hz), those of direct
    current without one.

    >>> seen_at(Layer(0.3, Dielectric(4.0, [(100.0, 1e-3, 0.0)], 2e-4)), None)
    (104.0, 0.0002)
    """
    if frequency is not None or not relaxes(layer):
        return constants(layer, frequency)
    steady = debye_layer(layer, None)
    of: Any = steady.eps_r
    return of.eps_inf + float(np.sum([pole[0] for pole in of.poles])), of.conductivity


def relaxes(layer: Layer) -> bool:
    """Whether the permittivity of a layer depends on the frequency by more than its conductivity."""
    return callable(getattr(layer.eps_r, "permittivity", None)) and getattr(layer.eps_r, "poles", None) != ()


def debye_layer(layer: Layer, frequency: float | None) -> Layer:
    """The layer with a sum of Debye poles for its dielectric: its own, or fitted over `BAND` around
    the `frequency` (Hz). Raises InputError for a dielectric that has none.

    >>> len(debye_layer(Layer(0.3, SKINS["gabriel_dry"]), 75.0).eps_r.poles)
    3
    """
    of: Any = layer.eps_r
    own = isinstance(of, Dielectric) and all(not any(pole[2:]) and len(pole) == 3 for pole in of.poles)
    if not relaxes(layer) or own:
        return layer
    if not callable(getattr(of, "debye", None)):
        allowed = "a Dielectric or a DielectricTable where the voltage is resolved in time"
        raise InputError("eps_r", describe_value(of), allowed)
    low, high = BAND
    if frequency is not None:
        low, high = min(low, frequency / WIDER), max(high, frequency * WIDER)
    return Layer(layer.thickness, _remembered(of, low, high))


@lru_cache(maxsize=32)
def _remembered(of: Any, low: float, high: float) -> Dielectric:
    found: Dielectric = of.debye(low, high, FITTED)
    return found

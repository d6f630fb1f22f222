r"""Mean separation of rough faces under load from the waves of their roughness, by Persson's theory.

A surface of the two-dimensional isotropic power spectrum C(q), <h^2> = 2 pi int q C dq, that is pressed
with p against a soft plane of the modulus E* = E / (1 - nu^2), is flattened up to the wave number q on the
share :math:`P = \mathrm{erf}(p / E^* \sigma)` of the area, with :math:`\sigma^2 = \pi \int q^3 C dq` up to q,
half the mean square slope. The elastic energy of an area, Persson's (2007) with the factor of Yang and
Persson (2008),

.. math:: U = \frac{\pi}{2} E^* \int q^2 C\, P\, [\gamma + (1 - \gamma) P^2]\, dq, \qquad \gamma = 0.45,

is the work of the pressure, dU = -p du, so that the mean separation is

.. math:: u(p) = \frac{2}{\sqrt\pi} \int \frac{d\sigma}{q}\, J\Big(\frac{p}{E^* \sigma}\Big), \qquad
   J(x) = \int_x^\infty [\gamma + 3 (1 - \gamma)\, \mathrm{erf}^2 y]\, e^{-y^2}\, \frac{dy}{y},

the formula of both with w = 1 / sigma, where :math:`q^2 C w\, dq = 2\, d\sigma / \pi q`. A ring of
one q has the integral :math:`\sigma K(p / E^* \sigma)`, K(x) as J(x) with (y - x) / y^2 for 1 / y: a map,
whose waves lie in rings, needs no quadrature over q. A light load separates by :math:`u_0 \ln (1 / p)`,
:math:`u_0 = \sqrt\pi\, \gamma \int q^2 C w\, dq`, without bound: below `open_pressure` a tangent is followed.

The energy is that of the public code of Xu et al. (github.com/xylcsi/PerssonModelFudgeFactor,
`Persson_LE_SE_YP08.m`, `Variance_pressure.m`).

- B. N. J. Persson, Phys. Rev. Lett. 99 (2007) 125502, doi:10.1103/PhysRevLett.99.125502.
- C. Yang, B. N. J. Persson, J. Phys.: Condens. Matter 20 (2008) 215214,
  doi:10.1088/0953-8984/20/21/215214.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, above, real
from evfem.errors import InputError

#: share of the elastic energy in asperities that touch alone, fitted to simulations (Yang and Persson 2008)
GAMMA = 0.45
#: Gauss points over the reach of exp(-y^2)
_AT, _SHARE = np.polynomial.legendre.leggauss(48)
REACH = 6.5
#: wave numbers of a spectrum between its ends
FINE = 400
#: rows of a table, and the summits of a spectrum in rms heights
ROWS, APART = 80, 3.0
#: least pressure of a law over that of full contact
LEAST = 1e-20


class Waves(NamedTuple):
    """Rings of waves, from long to short: wave number q (n,) in 1/mm, rms slope (n,) of all waves up to
    each; rms height (mm) of all, and height (mm) of the highest summit above the mean plane.
    """

    q: Floats
    slope: Floats
    rms: float
    summit: float


def waves_of_map(heights: Any, pixel: float, periodic: bool) -> Waves:
    """Waves of heights (m, n) in mm on squares of `pixel` (mm): abs(FFT)^2 in rings as wide as 1 / length.

    A map that is not `periodic` is levelled by its plane and multiplied with Hann's window; the waves keep
    the rms height that it had before. Raises InputError for what is no such map.
    """
    allowed = "heights (m, n) in mm, at least 4 x 4, all there and not all the same"
    given = np.ma.asarray(heights)
    if given.ndim != 2 or min(given.shape) < 4 or given.dtype.kind not in "iuf":
        raise InputError("heights", f"an array of shape {given.shape}, {given.dtype}", allowed)
    if missing := np.ma.count_masked(np.ma.masked_invalid(given)):
        raise InputError("heights", f"{missing} of {given.size} points missing", allowed)
    step = real("pixel", pixel, "a length in mm above 0", Within(0.0, above=True))
    h = np.asarray(given, dtype=float)
    h = h - h.mean() if periodic else _levelled(h)
    rms = float(np.sqrt(np.mean(h**2)))
    if not rms > 1e-12 * np.abs(given).max():
        raise InputError("heights", f"heights of rms {rms:g} mm", allowed)
    summit = float(h.max())
    if not periodic:
        h = h * np.outer(*(np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2 for n in h.shape))
        h = h - h.mean()
    power = np.abs(np.fft.fft2(h)) ** 2
    power *= rms**2 / power.sum()
    q = 2.0 * np.pi * np.hypot(*np.meshgrid(*(np.fft.fftfreq(n, step) for n in h.shape), indexing="ij"))
    ring = np.rint(q / (2.0 * np.pi) * step * max(h.shape)).astype(int).ravel()
    q = q.ravel()
    heights_q, slopes = (np.asarray(np.bincount(ring, power.ravel() * q**n), float)[1:] for n in (1, 2))
    return _ordered(heights_q, slopes, rms, summit)


def _levelled(h: Floats) -> Floats:
    """Heights without their least-squares plane."""
    x, y = (np.arange(n) - 0.5 * (n - 1) for n in h.shape)
    tilt_x, tilt_y = (x @ h).sum() / (x @ x) / y.size, (h @ y).sum() / (y @ y) / x.size
    return np.asarray(h - h.mean() - tilt_x * x[:, None] - tilt_y * y)


def _ordered(heights_q: Floats, slopes: Floats, rms: float, summit: float) -> Waves:
    """Rings by their sums of q abs(h)^2 and q^2 abs(h)^2."""
    there = slopes > 0.0
    heights_q, slopes = heights_q[there], slopes[there]
    return Waves(slopes / heights_q, np.sqrt(np.cumsum(slopes)), rms, summit)


def rows(waves: Waves, modulus: float, open_gap: float | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Pressures (MPa) from none to complete contact, and separations (mm), from `open_gap` on or
    the summit's. The first step is along the tangent that reaches it. Raises InputError for what is no
    modulus or gap.
    """
    real("modulus", modulus, "a modulus E / (1 - nu^2) in MPa above 0", Within(0.0, above=True))
    gap = waves.summit if open_gap is None else real("open_gap", open_gap, "a length in mm above 0")
    load = np.geomspace(open_pressure(gap, waves, modulus), full_pressure(waves, modulus), ROWS - 1)
    return (0.0, *load.tolist()), (gap, *separation(load, waves, modulus).tolist())


def waves_of_spectrum(q: Any, C: Any) -> Waves:
    """Waves of a spectrum C (n,) in mm^4 at wave numbers q (n,) in 1/mm that grow; straight lines between
    them on logarithmic scales, nothing beyond. Raises InputError for what is no such spectrum.
    """
    numbers, densities = "two or more wave numbers in 1/mm above 0 that grow", "as many in mm^4 above 0"
    at = np.asarray(above("q", q, 0.0, numbers))
    density = np.asarray(above("C", C, 0.0, densities))
    if at.ndim != 1 or at.size < 2 or np.any(np.diff(at) <= 0.0):
        raise InputError("q", f"{at.size} wave numbers that do not grow", numbers)
    if density.shape != at.shape:
        raise InputError("C", f"an array of shape {density.shape}", f"{densities}: {at.size}")
    lines = np.log(at)
    fine = np.union1d(lines, np.linspace(lines[0], lines[-1], FINE))
    C, q = np.exp(np.interp(fine, lines, np.log(density))), np.exp(fine)
    heights, heights_q, slopes = (
        np.pi * np.diff(fine) * ((C * q**n)[1:] + (C * q**n)[:-1]) for n in (2, 3, 4)
    )
    rms = float(np.sqrt(heights.sum()))
    return _ordered(heights_q, slopes, rms, APART * rms)


def separation(pressure: Any, waves: Waves, modulus: float) -> Floats:
    """Mean separation u (P,) in mm at pressures (P,) in MPa above 0, of a plane of the modulus E* (MPa)."""
    return _over(_mean, pressure, waves, modulus)


def intercept(pressure: Any, waves: Waves, modulus: float) -> Floats:
    """u - p du/dp (P,) in mm: where the tangent at a pressure meets no pressure."""
    return _over(_tangent, pressure, waves, modulus)


def open_pressure(open_gap: float, waves: Waves, modulus: float) -> float:
    """Pressure (MPa) whose tangent reaches `open_gap` (mm) at no pressure."""
    from scipy.optimize import brentq

    full = full_pressure(waves, modulus)
    most = float(intercept([LEAST * full], waves, modulus)[0])
    if not 0.0 < open_gap < most:
        raise InputError("open_gap", open_gap, f"a length in mm above 0, below {most:.3g}")

    def above_it(load: float) -> float:
        return float(intercept([np.exp(load)], waves, modulus)[0]) - open_gap

    return float(np.exp(brentq(above_it, np.log(LEAST * full), np.log(full))))


def full_pressure(waves: Waves, modulus: float) -> float:
    """Pressure (MPa) above which contact is complete to rounding."""
    return float(REACH * modulus * waves.slope[-1] / np.sqrt(2.0))


def _over(kernel: Any, pressure: Any, waves: Waves, modulus: float) -> Floats:
    """2 / sqrt(pi) times the sum over rings of the growth of sigma kernel(p / E* sigma), over q."""
    sigma = waves.slope / np.sqrt(2.0)
    grown = sigma * kernel(np.asarray(pressure, dtype=float)[:, None] / (modulus * sigma))
    return np.asarray(2.0 / np.sqrt(np.pi) * (np.diff(grown, prepend=0.0) @ (1.0 / waves.q)))


def _mean(x: Floats) -> Floats:
    """K."""
    from scipy.special import erfc, exp1

    alone = 0.5 * exp1(x**2) - np.exp(-(x**2)) + np.sqrt(np.pi) * x * erfc(x)
    return np.asarray(GAMMA * alone + 3.0 * (1.0 - GAMMA) * _together(x, lambda y: (y - x) / y**2))


def _tangent(x: Floats) -> Floats:
    """J."""
    from scipy.special import exp1

    return np.asarray(0.5 * GAMMA * exp1(x**2) + 3.0 * (1.0 - GAMMA) * _together(x, lambda y: 1.0 / y))


def _together(x: Floats, weight: Any) -> Any:
    """Integral of erf^2 e^(-y^2) weight from x on."""
    from scipy.special import erf

    points = ((x + 0.5 * REACH * (1.0 + at), share) for at, share in zip(_AT, _SHARE, strict=True))
    return sum(0.5 * REACH * share * weight(y) * erf(y) ** 2 * np.exp(-(y**2)) for y, share in points)

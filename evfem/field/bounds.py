r"""Two-sided bounds of the capacitance between a grounded outline and an electrode, without solving.

With H = h + s, the gap plus the slab's reduced thickness s = t / eps,

.. math:: \int \frac{dx}{H} \;\le\; \frac{C}{\varepsilon_0} \;\le\;
          \int \Big[\frac1H + \frac{h'^2}{3}\Big(\frac1H + \frac{(\varepsilon^2 - 1) s^3}{H^4}\Big)\Big] dx .

The left side is the column law: a vertical flux 1/H is free of sources, and by Thomson's principle
no such flux has more co-energy than the field. The right side is the energy of the potential that
is linear in slab and air along each vertical, and by Dirichlet's principle none has less than the
field. It may take any outline below the body's own, as a larger body has the larger capacitance:
here the highest outline nowhere steeper than one of `SLOPES`, which takes walls too. Both integrals
are exact for polylines. Above an electrode and a slab that follow an uneven ground of slope q, along
which the potential changes too, the same potential has

.. math:: \int \Big[q^2 \frac1H + q\,h' \Big(\frac1H + \frac{(\varepsilon - 1) s^2}{H^3}\Big)\Big] dx

more.

A body that ends in the air has in its upper bound what surrounds it: a quarter of a disc around
each end, in which the potential grows with the angle, and the body's width above.
"""

from __future__ import annotations

import math

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.laws import eps_0
from evfem.field.outlines import Outline, spread, spread_around

#: steepest slopes of the lower envelopes that are tried for the upper bound
SLOPES = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 16.0)
#: power of the potential's decay around a body that ends in the air: the one with the least energy
DECAY = math.sqrt(12.0) / math.pi
#: radii tried for the region of constant potential around such a body, in shares of its size
RADII = (1.0, 2.0, 4.0)


def columns_sum(x: Floats, distance: Floats) -> float:
    """Integral of 1 / H over the polyline `distance` (mm)."""
    return float(np.sum(_columns(x, distance)))


def _columns(x: Floats, distance: Floats) -> Floats:
    """The integral of 1 / H over each piece of a polyline."""
    dx, a, b = np.diff(x), distance[:-1], distance[1:]
    ratio = (b - a) / a
    small = np.abs(ratio) < 1e-5
    safe = np.where(small, 1.0, ratio)
    mean = np.where(small, 1.0 - ratio / 2.0 + ratio**2 / 3.0, np.log1p(safe) / safe)
    return np.asarray(dx / a * mean)


def upper_sum(
    x: Floats, distance: Floats, reduced: float, eps_r: float, ground: Floats | None = None
) -> float:
    """The upper bound's integral over the polyline `distance` (mm), above flat or given ground (mm)."""
    dx, a, b = np.diff(x), distance[:-1], distance[1:]
    first = _columns(x, distance)
    slope, uneven = (_slopes(dx, y) for y in (distance, np.zeros_like(x) if ground is None else ground))
    third = dx * (a + b) / (2.0 * (a * b) ** 2)
    fourth = dx * (a * a + a * b + b * b) / (3.0 * (a * b) ** 3)
    spreading = (eps_r**2 - 1.0) * reduced**3 * float(np.sum(slope**2 * fourth)) / 3.0
    along = (eps_r - 1.0) * reduced**2 * float(np.sum(uneven * slope * third))
    return float(np.sum(first * (1.0 + slope**2 / 3.0 + uneven * (uneven + slope)))) + spreading + along


def _slopes(dx: Floats, y: Floats) -> Floats:
    """Slopes of the pieces of a polyline (mm/mm), 0 of upright ones."""
    return np.divide(np.diff(y), dx, out=np.zeros_like(dx), where=dx > 0.0)


def capacitance_bounds(outline: Outline, thickness: float = 0.0, eps_r: float = 1.0) -> tuple[float, float]:
    """Lower and upper bound in F per m of depth (N/V^2), above a slab of `thickness` (mm).

    >>> wave = Outline.of([0.0, 0.25, 0.5], [0.1, 0.15, 0.1])
    >>> [f"{1e12 * bound:.2f} pF/m" for bound in capacitance_bounds(wave)]
    ['35.90 pF/m', '36.38 pF/m']
    """
    reduced = thickness / eps_r
    lower = columns_sum(outline.x, outline.height + reduced)
    if outline.periodic:
        return eps_0 * lower, eps_0 * least_upper_sum(outline.x, outline.height, thickness, eps_r, True)
    uppers = []
    for slope in SLOPES:
        below = spread(outline.x, outline.height, slope)
        upper = upper_sum(outline.x, below + reduced, reduced, eps_r)
        uppers.append(upper + surroundings(outline, (float(below[0]), float(below[-1])), thickness, eps_r))
    return eps_0 * lower, eps_0 * min(uppers)


def least_upper_sum(
    x: Floats,
    height: Floats,
    thickness: float,
    eps_r: float,
    periodic: bool = False,
    ground: Floats | None = None,
) -> float:
    """Least `upper_sum` over lower envelopes of a polyline, mirrored or `periodic`, at `height` (L,)."""
    reduced, envelope = thickness / eps_r, spread_around if periodic else spread
    below = (envelope(x, height, slope) + reduced for slope in SLOPES)
    return min(upper_sum(x, distance, reduced, eps_r, ground) for distance in below)


def surroundings(outline: Outline, ends: tuple[float, float], thickness: float, eps_r: float) -> float:
    """Upper bound of C / eps_0 of what surrounds a body whose ends are at heights `ends` (mm)."""
    top = thickness + float(max(outline.lid(outline.x).max(), outline.height.max()))
    bounds = []
    for share in RADII:
        radius = share * max(top, outline.length)
        above = outline.length * DECAY**2 / ((2.0 * DECAY + 1.0) * radius)
        bounds.append(above + sum(_quarter(height, radius, thickness, eps_r) for height in ends))
    return min(bounds)


def _quarter(height: float, radius: float, thickness: float, eps_r: float) -> float:
    """Energy of q(r) 2 theta / pi beside an end: q as in its column, 1 to `radius`, then r^-DECAY."""
    reduced = thickness / eps_r
    distance = height + reduced
    points, weights = np.polynomial.legendre.leggauss(40)
    energy = 0.0
    if thickness > 0.0:
        energy = eps_r * (math.pi / 12.0 + 1.0 / math.pi) * (reduced / distance) ** 2
    foot = max(thickness, 1e-12 * radius)
    for start, end in ((thickness, thickness + height), (thickness + height, radius), (radius, 1e5 * radius)):
        low, high = math.log(max(start, foot)), math.log(end)
        parts = np.linspace(low, high, 9)
        u = (parts[:-1, None] + 0.5 * np.diff(parts)[:, None] * (1.0 + points)).ravel()
        w = (0.5 * np.diff(parts)[:, None] * weights).ravel()
        r = np.exp(u)
        if end <= thickness + height:
            q, rate = (r - thickness + reduced) / distance, r / distance  # rate: dq / d(ln r)
        elif end <= radius:
            q, rate = np.ones_like(r), np.zeros_like(r)
        else:
            q, rate = (r / radius) ** -DECAY, DECAY * (r / radius) ** -DECAY
        slab = np.arcsin(np.minimum(1.0, thickness / r))
        cubed = math.pi**3 / 24.0 + (eps_r - 1.0) * slab**3 / 3.0
        linear = math.pi / 2.0 + (eps_r - 1.0) * slab
        energy += float(np.sum(w * (2.0 / math.pi) ** 2 * (rate**2 * cubed + q**2 * linear)))
    return energy

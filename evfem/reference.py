"""Closed-form solutions with their sources: to check a simulation by, or to answer a question without one.

Units: mm, N, MPa, V; forces of plane problems per mm of depth (N/mm). E* = E / (1 - nu^2) is the plane-strain
modulus of an elastic body against a rigid one; for two elastic bodies 1/E* is the sum of (1 - nu^2)/E.
"Johnson" is K. L. Johnson, Contact Mechanics, Cambridge University Press 1985, doi:10.1017/CBO9781139171731.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evfem.common.checks import real
from evfem.electrostatics.laws import Layers, eps_0
from evfem.errors import InputError, describe_value
from evfem.tensor import Array


def _positive(**values: float) -> None:
    for key, value in values.items():
        real(key, value, "a positive number", lambda v: v > 0.0)


def plane_modulus(E: float, nu: float) -> float:
    """E* = E / (1 - nu^2) in MPa.

    >>> plane_modulus(3.0, 0.5)
    4.0
    """
    return E / (1.0 - nu * nu)


@dataclass(frozen=True)
class HertzLine:
    """A long cylinder of `radius` (mm) pressed on a half-space by `load` (N/mm), without friction.

    a = sqrt(4 P' R / (pi E*)), p0 = 2 P' / (pi a), p(x) = p0 sqrt(1 - (x/a)^2). `modulus` is E* (MPa).
    Source: H. Hertz, J. reine angew. Math. 92 (1882) 156-171; Johnson, equations (4.43) to (4.45).

    >>> contact = HertzLine(load=math.pi, radius=1.0, modulus=4.0)
    >>> contact.half_width, contact.peak_pressure
    (1.0, 2.0)
    """

    load: float
    radius: float
    modulus: float

    def __post_init__(self) -> None:
        _positive(load=self.load, radius=self.radius, modulus=self.modulus)

    @classmethod
    def from_half_width(cls, half_width: float, radius: float, modulus: float) -> HertzLine:
        """The contact that is 2 `half_width` (mm) wide."""
        return cls(math.pi * modulus * half_width**2 / (4.0 * radius), radius, modulus)

    @property
    def half_width(self) -> float:
        """Half the width a of the contact in mm."""
        return math.sqrt(4.0 * self.load * self.radius / (math.pi * self.modulus))

    @property
    def peak_pressure(self) -> float:
        """Pressure p0 in the middle in MPa."""
        return 2.0 * self.load / (math.pi * self.half_width)

    def pressure(self, x: Array) -> Array:
        """Pressure (MPa) at x (mm) from the middle; zero outside the contact."""
        return self.peak_pressure * np.sqrt(np.maximum(0.0, 1.0 - (np.asarray(x) / self.half_width) ** 2))


@dataclass(frozen=True)
class CattaneoMindlin:
    """The Hertz contact `normal` under a load Q (`tangential`, N/mm) that grew while the normal one was held.

    With friction coefficient mu and Q < mu P' the middle strip abs(x) < c sticks, c/a = sqrt(1 -
    Q/(mu P')), and q(x) = mu p0 (sqrt(1 - (x/a)^2) - (c/a) sqrt(1 - (x/c)^2)), the second root
    inside c only. Exact for bodies whose normal and tangential motions do not couple: equal ones,
    or an incompressible one on a rigid plane. Source: C. Cattaneo, Rend. Accad. Lincei 27 (1938);
    R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268; Johnson, section 7.2.

    >>> CattaneoMindlin(HertzLine(math.pi, 1.0, 4.0), 0.3, tangential=0.3 * math.pi * 0.75).stick_half_width
    0.5
    """

    normal: HertzLine
    friction_coefficient: float
    tangential: float

    def __post_init__(self) -> None:
        _positive(friction_coefficient=self.friction_coefficient)
        limit = self.friction_coefficient * self.normal.load
        allowed = f"at least 0 and below mu P' = {limit:g} N/mm, where all of the contact slips"
        real("tangential", self.tangential, allowed, lambda Q: 0.0 <= Q < limit)

    @property
    def stick_half_width(self) -> float:
        """Half the width c of the sticking strip in mm."""
        ratio = self.tangential / (self.friction_coefficient * self.normal.load)
        return self.normal.half_width * math.sqrt(1.0 - ratio)

    def shear(self, x: Array) -> Array:
        """Shear traction q (MPa) at x (mm) from the middle."""
        a, c = self.normal.half_width, self.stick_half_width
        x = np.asarray(x)
        stick = c / a * np.sqrt(np.maximum(0.0, 1.0 - (x / c) ** 2))
        return self.friction_coefficient * (self.normal.pressure(x) - self.normal.peak_pressure * stick)


@dataclass(frozen=True)
class BondedLayer:
    """A rigid cylinder of `radius` on an elastic layer of `thickness` (mm), bonded to a rigid base below.

    No friction between cylinder and layer, small strain. The contact is 2 `half_width` (mm) wide;
    E (MPa) and nu are the layer's. A pressure of wave number k on the layer moves its surface by 2
    M(kh) / (E* k) times its amplitude, with kappa = 3 - 4 nu and

        M(s) = (2 kappa sinh 2s - 4 s) / (2 kappa cosh 2s + 1 + kappa^2 + 4 s^2).

    With p(x) = sqrt(1 - xi^2) sum of c_n U_2n(xi), xi = x/a, the slope -x/R of the punch gives at abs(xi) < 1

        (2/E*) sum of c_n [T_(2n+1)(xi) - (-1)^n (2n+1) integral over s > 0 of (1 - M(s h/a)) J_(2n+1)(s)
        sin(s xi)/s ds] = a xi / R,

    which is solved by collocation. Source: P. Meijers, Appl. Sci. Res. 18 (1968) 353-383; Johnson,
    section 5.8.

    >>> layer = BondedLayer(half_width=1.0, thickness=1.0, radius=10.0, E=0.91, nu=0.3)  # E* = 1
    >>> round(layer.load * 10.0, 6), round(layer.indentation * 10.0, 6)
    (1.221797, 0.653997)
    """

    half_width: float
    thickness: float
    radius: float
    E: float
    nu: float

    def __post_init__(self) -> None:
        _positive(half_width=self.half_width, thickness=self.thickness, radius=self.radius, E=self.E)
        real("nu", self.nu, "a number from 0 to 0.5", lambda nu: 0.0 <= nu <= 0.5)

    @classmethod
    def from_load(cls, load: float, thickness: float, radius: float, E: float, nu: float) -> BondedLayer:
        """The contact under `load` (N/mm)."""
        from scipy.optimize import brentq

        _positive(load=load, thickness=thickness, radius=radius, E=E)
        widest = HertzLine(load, radius, plane_modulus(E, nu)).half_width  # the half-space is more compliant

        def excess(a: float) -> float:
            return cls(a, thickness, radius, E, nu).load - load

        return cls(brentq(excess, 1e-3 * widest, widest, xtol=1e-12 * widest), thickness, radius, E, nu)

    @property
    def load(self) -> float:
        """Load P' in N/mm."""
        return 0.5 * math.pi * self.half_width * float(self._coefficients[0])

    @property
    def indentation(self) -> float:
        """Depth (mm) of the cylinder's lowest point below the undeformed surface."""
        s, weight, remainder, bessel = self._spectrum
        n, c = np.arange(len(self._coefficients)), self._coefficients
        # (1 - e^-s) J_1/s^2 and J_(2n+1)/s^2 have integrals of their own; the rest decays exponentially
        known = np.array([0.5 * (math.sqrt(2.0) + math.asinh(1.0) - 1.0), *(0.25 / (n[1:] * (n[1:] + 1.0)))])
        rest = remainder * bessel
        rest[0] -= np.exp(-s) * bessel[0]
        depths = (2.0 * n + 1.0) * (-1.0) ** n * (known - rest @ (weight / s**2))
        return float(2.0 * self.half_width / plane_modulus(self.E, self.nu) * (c @ depths))

    def pressure(self, x: Array) -> Array:
        """Pressure (MPa) at x (mm) from the middle; zero outside the contact."""
        xi = np.clip(np.asarray(x, dtype=float) / self.half_width, -1.0, 1.0)
        angle = np.arccos(xi)[..., None]
        odd = 2 * np.arange(len(self._coefficients)) + 1
        return np.where(np.abs(xi) < 1.0, np.sin(odd * angle) @ self._coefficients, 0.0)

    @cached_property
    def _spectrum(self) -> tuple[Array, Array, Array, Array]:
        """Points s and weights of the integrals, 1 - M(s h/a), and J_(2n+1)(s) as (terms, points)."""
        from scipy.special import jv

        ratio = self.thickness / self.half_width
        end = max(40.0, 25.0 / ratio)
        terms = 12 + int(4.0 / ratio)
        nodes, weights = np.polynomial.legendre.leggauss(24)
        edges = np.linspace(0.0, end, 2 + int(end / 4.0))
        middle, half = 0.5 * (edges[1:] + edges[:-1]), 0.5 * (edges[1] - edges[0])
        s = (middle[:, None] + half * nodes).ravel()
        weight = np.tile(half * weights, len(middle))
        return s, weight, 1.0 - self._stiffening(s * ratio), jv(2 * np.arange(terms)[:, None] + 1, s)

    def _stiffening(self, s: Array) -> Array:
        """M(s), numerator and denominator divided by e^(2s)."""
        kappa = 3.0 - 4.0 * self.nu
        e = np.exp(-2.0 * s)
        top = kappa * (1.0 - e * e) - 4.0 * s * e
        return top / (kappa * (1.0 + e * e) + (1.0 + kappa * kappa + 4.0 * s * s) * e)

    @cached_property
    def _coefficients(self) -> Array:
        """c_n in MPa."""
        s, weight, remainder, bessel = self._spectrum
        n = np.arange(len(bessel))
        xi = np.cos(0.5 * math.pi * (n + 0.5) / len(n))
        odd = 2 * n + 1
        known = np.cos(odd * np.arccos(xi)[:, None])
        integral = np.sin(xi[:, None] * s) * (weight * remainder / s) @ bessel.T
        matrix = known - (-1.0) ** n * odd * integral
        right = 0.5 * plane_modulus(self.E, self.nu) * self.half_width / self.radius * xi
        return np.linalg.solve(matrix, right)


def tube_pressure(inner_radius: Array, inner: float, outer: float, mu: float) -> Array:
    """Pressure (MPa) that widens an incompressible neo-Hookean tube to `inner_radius`, in plane strain.

    p/mu = ln(B a / (A b)) + (a^2 - A^2)/2 (1/a^2 - 1/b^2), b^2 = B^2 + a^2 - A^2, for radii A (`inner`), B
    (`outer`) at rest and a, b under pressure in mm; mu in MPa. It is the integral of mu (l^2 - l^-2)/r over
    the wall, l = r/R the hoop stretch. Source: R. S. Rivlin, Phil. Trans. R. Soc. A 242 (1949) 173-195.

    >>> round(float(tube_pressure(1.5, inner=1.0, outer=2.0, mu=1.0)), 10)
    0.4282284091
    """
    _positive(inner=inner, mu=mu)
    real("outer", outer, "a radius above the inner one", lambda B: inner < B)
    a = np.asarray(inner_radius)
    swept = a * a - inner * inner
    b = np.sqrt(outer * outer + swept)
    return mu * (np.log(outer * a / (inner * b)) + 0.5 * swept * (1.0 / (a * a) - 1.0 / (b * b)))


def tube_inner_radius(pressure: float, inner: float, outer: float, mu: float) -> float:
    """Inner radius (mm) of the tube of `tube_pressure` under `pressure` (MPa), 0 to below mu ln(outer/inner).

    >>> round(tube_inner_radius(0.4282284091, inner=1.0, outer=2.0, mu=1.0), 8)
    1.5
    """
    from scipy.optimize import brentq

    limit = mu * math.log(outer / inner)
    real("pressure", pressure, f"0 to below mu ln(B/A) = {limit:g} MPa", lambda p: 0.0 <= p < limit)
    end = 2.0 * inner

    def excess(a: float) -> float:
        return float(tube_pressure(np.array(a), inner, outer, mu)) - pressure

    while excess(end) < 0.0:
        end *= 2.0
    return brentq(excess, inner, end, xtol=1e-14 * inner)


def cylinder_force(distance: Array, radius: float, voltage: Array) -> Array:
    """Attraction (N/mm) of a conducting cylinder and a conducting plane at `distance` (mm) in vacuum.

    F' = pi eps_0 U^2 / (sqrt(h^2 - R^2) arcosh(h/R)^2), h = R + d: minus the derivative by d of
    the energy, with the capacitance per length 2 pi eps_0 / arcosh(h/R). Source: W. R. Smythe,
    Static and Dynamic Electricity, 3rd ed. 1968, chapter 4.

    >>> f"{float(cylinder_force(0.25, radius=8.34, voltage=2000.0)):.6e}"
    '9.065966e-04'
    """
    _positive(radius=radius)
    d = np.asarray(distance)
    if not np.all(d > 0.0):
        raise InputError("distance", distance, "positive numbers")
    root = np.sqrt(d * (d + 2.0 * radius))  # sqrt(h^2 - R^2) without cancellation
    return math.pi * eps_0 * np.asarray(voltage) ** 2 / (root * np.log1p((d + root) / radius) ** 2)


@dataclass(frozen=True)
class PullIn:
    """Where a plate on a spring snaps shut: `travel` (mm) from its place without voltage, `voltage` (V)."""

    travel: float
    voltage: float


def pull_in_strong_troxel(stiffness: float, gap: float, area: float, layers: Layers) -> PullIn:
    """Snap of a plate of `area` (mm^2) on a spring (N/mm), `gap` (mm) above solid `layers`, law
    `StrongTroxel`.

    The force of the spring k x meets A p(g0 - x) for the last time at x = (g0 + s)/3, U = sqrt(8 k (g0 + s)^3
    / (27 eps_0 A)). It snaps only if x <= g0. Source: S. D. Senturia, Microsystem Design, 2001,
    doi:10.1007/b117574, section 6.4, with the layers' reduced thickness s added to the gap.

    >>> from evfem.electrostatics.laws import Layer
    >>> table_2 = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(pull_in_strong_troxel(stiffness=0.1, gap=0.25, area=100.0, layers=table_2).voltage, 3)
    843.789
    """
    _positive(stiffness=stiffness, gap=gap, area=area)
    a = gap + layers.reduced
    return _pull_in(a / 3.0, gap, math.sqrt(8.0 * stiffness * a**3 / (27.0 * eps_0 * area)))


def pull_in_kaczmarek(stiffness: float, gap: float, area: float, layers: Layers) -> PullIn:
    """The same as `pull_in_strong_troxel` for the law `Kaczmarek`.

    With a = g0 + s, b = g0 + D the voltage U = sqrt(2 k x (a - x)(b - x) / (eps_0 A)) that holds
    the plate at travel x is largest at x = ((a + b) - sqrt(a^2 - a b + b^2)) / 3.

    >>> from evfem.electrostatics.laws import Layer
    >>> table_2 = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    >>> round(pull_in_kaczmarek(stiffness=0.1, gap=0.25, area=100.0, layers=table_2).voltage, 3)
    1598.737
    """
    _positive(stiffness=stiffness, gap=gap, area=area)
    a, b = gap + layers.reduced, gap + layers.thickness
    x = ((a + b) - math.sqrt(a * a - a * b + b * b)) / 3.0
    return _pull_in(x, gap, math.sqrt(2.0 * stiffness * x * (a - x) * (b - x) / (eps_0 * area)))


def _pull_in(travel: float, gap: float, voltage: float) -> PullIn:
    if travel > gap:
        allowed = f"a gap of at least {travel:g} mm: at a smaller one the plate touches down without a snap"
        raise InputError("gap", gap, allowed)
    return PullIn(travel, voltage)


def sliding_force_ratio(slope: Array, friction_coefficient: Array, direction: int = 1) -> Array:
    """F_t/F_n of a point that slides over a profile of the given `slope` y'(x), without inertia.

    (mu + y') / (1 - mu y') towards +x, (-mu + y') / (1 + mu y') towards -x (`direction` -1); F_t is the force
    along x and F_n that along y that must be applied. Infinite where mu times the slope uphill reaches 1: the
    point jams. Source: balance of the forces n and mu n along normal and tangent of the profile.

    >>> float(sliding_force_ratio(0.0, 0.3)), float(sliding_force_ratio(0.5, 1.0))
    (0.3, 3.0)
    """
    if direction not in (1, -1):
        raise InputError("direction", describe_value(direction), "1 (towards +x) or -1 (towards -x)")
    uphill = direction * np.asarray(slope)
    lift = 1.0 - np.asarray(friction_coefficient) * uphill
    jams = lift <= 0.0
    ratio = (friction_coefficient + uphill) / np.where(jams, 1.0, lift)
    return direction * np.where(jams, np.inf, ratio)

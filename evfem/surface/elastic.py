r"""Elastic layers on a rigid base: compliance of their surface for forces on strips of it, in plane strain.

Under a pressure p into the surface and a shear traction q along x, both proportional to :math:`e^{ikx}`, the
surface is displaced by

.. math:: u_z = a_n p - i\,c\,q, \qquad u_x = a_t q + i\,c\,p .

The compliances :math:`a_n, a_t, c` of a stack follow layer by layer from the bottom, because the
state :math:`(u_x, u_z, \sigma_{xz}, \sigma_{zz})` at the top of a layer is a matrix exponential times that at
its bottom. For one layer of thickness H, with s = kH, :math:`\kappa = 3 - 4\nu` and
:math:`D = 2\kappa\cosh 2s + 1 + \kappa^2 + 4 s^2`, they are

.. math:: a_{n,t} = \frac{1-\nu}{\mu k}\,\frac{2\kappa\sinh 2s \mp 4 s}{D}, \qquad
          c = \frac{1}{2\mu k}\,\frac{2 (1-2\nu)\,\kappa\,(\cosh 2s - 1) - 4 s^2}{D} .

Their inverse Fourier transforms are kernels (Green's functions) of the distance x, which decay
exponentially. The singular terms, :math:`-2\ln|x|/(\pi E^*)` and :math:`\mathrm{sgn}(x)(1-2\nu)/(4\mu)` with
the moduli of the top layer, are known; the smooth remainder is tabulated once (`Kernels`). Forces act on
strips of prescribed lengths, and displacements are means over strips: second differences of the kernel's
second integral. As a Galerkin method this makes the compliance symmetric and positive definite. For
strips far apart the mean of the kernel's second-order Taylor polynomial is used instead.

Sources: K. L. Johnson, Contact Mechanics (1985), doi:10.1017/CBO9781139171731, ch. 2 and 5.8 (half-plane and
layer). Units: mm, N, MPa; compliances are mm per N/mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Checked, Within, number, set_frozen
from evfem.errors import InputError, describe_value
from evfem.protocols import Elastic
from evfem.surface.patches import Patches, assembled

#: table of a kernel: number of distances, and the largest one in decay lengths
TABULATED, FARTHEST = 1500, 36.0
#: the table's distances are end sinh(t) / sinh(SPREAD), with evenly spaced t
SPREAD = 8.0
#: largest wavenumber (over the top thickness) and layers of it that one exponential resolves
HIGHEST, RESOLVED = 45.0, 2.0
#: strips shorter than these fractions of the top thickness and of their distance use the kernel's Taylor
#: polynomial: errors of 1e-5 of a strip's own kernel
SHORT, FAR = 0.25, 0.1
#: the same two limits of kernels in space
IN_SPACE, SHORTEST = 24.0, 18.0
#: step (mm) of the slope of a compliance of one's own
SLOPE_STEP = 1e-4
#: most layers of a stack
MOST = 20

_MODULUS = number("a modulus in MPa, larger than 0, up to 1e15", Within(0.0, 1e15, above=True), "MPa")
_RATIO = number("a Poisson's ratio from 0 to 0.5", Within(0.0, 0.5))
_THICKNESS = number("a thickness in mm, larger than 0, up to 1e3", Within(0.0, 1e3, above=True), "mm")
ELASTIC = "ElasticLayer, ElasticStack, or an object with compliance(x, lengths)"


class Layered:
    """Base of layers and stacks: their compliance in plane strain and in space."""

    layers: tuple[ElasticLayer, ...]

    def compliance(self, x: Any, lengths: Any) -> Floats:
        """Mean displacements of n strips, in space of n squares, by forces on them.

        Parameters
        ----------
        x, lengths
            Middles (n,) and lengths (n,) of the strips in mm; in space x and z (n, 2) and areas (n,) in mm2.

        Returns
        -------
        array
            (2n, 2n) in mm per N/mm: first the n displacements into the surface, then the n along +x; columns
            in the same order, forces on the surface into it and along +x. In space (3n, 3n) in mm per N,
            last along +z.
        """
        return self._kernels(x).compliance(*strips(x, lengths))

    def compliance_slope(self, x: Any, lengths: Any) -> Floats:
        """Derivatives of `compliance` by the position of the displaced strip: (1, 2n, 2n) by x, in space
        (2, 3n, 3n) by x and z.
        """
        return self._kernels(x).slope(*strips(x, lengths))

    def _kernels(self, x: Any) -> Kernels | Patches:
        return (_kernels if np.ndim(x) < 2 else _patches)(self.layers)


@dataclass(frozen=True)
class ElasticLayer(Layered, Checked):
    """An elastic layer bonded to a rigid base: Young's modulus `E` in MPa, Poisson's ratio, thickness in mm.

    >>> gel = ElasticLayer(E=0.2, nu=0.48, thickness=2.0)
    >>> (gel.compliance([0.0, 0.1], [0.1, 0.1]).round(3) + 0.0)[0].tolist()      # mm per N/mm
    [8.806, 5.416, 0.0, -0.071]
    """

    E: Annotated[float, _MODULUS, "Young's modulus of the surface"]
    nu: Annotated[float, _RATIO, "its Poisson's ratio"]
    thickness: Annotated[float, _THICKNESS, "of the layer, down to a rigid base or the next layer"]
    _table = "surface.elastic."

    @property
    def layers(self) -> tuple[ElasticLayer, ...]:  # type: ignore[override]
        """Itself alone."""
        return (self,)


@dataclass(frozen=True)
class ElasticStack(Layered):
    """Elastic layers bonded to one another, the first on top, the last to a rigid base.

    >>> coating, bulk = ElasticLayer(1.0, 0.3, 0.2), ElasticLayer(0.08, 0.48, 5.0)
    >>> (ElasticStack([coating, bulk]).compliance([0.0], [0.1]).round(2) + 0.0).tolist()[0]
    [16.99, 0.0]
    """

    layers: tuple[ElasticLayer, ...]

    def __post_init__(self) -> None:
        found = tuple(self.layers) if isinstance(self.layers, (list, tuple)) else ()
        if not 1 <= len(found) <= MOST or not all(type(one) is ElasticLayer for one in found):
            allowed = f"1 to {MOST} ElasticLayer(E, nu, thickness), from the top"
            raise InputError("surface.elastic", describe_value(self.layers), allowed)
        set_frozen(self, layers=found)


def elastic_of(elastic: Any, key: str = "surface.elastic") -> Any:
    """The compliance of a surface: an `Elastic` object or None; InputError for anything else."""
    if isinstance(elastic, (list, tuple)):
        return ElasticStack(tuple(elastic))
    if elastic is not None and (isinstance(elastic, type) or not isinstance(elastic, Elastic)):
        raise InputError(key, describe_value(elastic), ELASTIC)
    return elastic


def strips(x: Any, lengths: Any) -> tuple[Floats, Floats]:
    """Middles (n,) or (n, 2) and lengths or areas (n,) as arrays; InputError for what is none."""
    found = np.atleast_1d(np.asarray(x, dtype=float))
    long = np.broadcast_to(np.asarray(lengths, dtype=float), found.shape[:1])
    flat = found.ndim == 1 or found.shape[1:] == (2,)
    if not flat or not np.isfinite(found).all() or not (np.isfinite(long) & (long > 0.0)).all():
        raise InputError(
            "lengths", describe_value(lengths), "positions in mm, and a length in mm above 0 for each"
        )
    return found, long


def transfer(layers: tuple[ElasticLayer, ...], k: Floats) -> tuple[Floats, Floats, Floats]:
    """Compliances a_n, a_t and c (K,) of a stack at wavenumbers k (K,) in 1/mm, above 0.

    >>> n, t, c = transfer((ElasticLayer(1.0, 0.3, 1.0),), np.array([0.5]))
    >>> s, kappa = 0.5, 1.8                                            # closed form of one layer
    >>> D = 2 * kappa * np.cosh(2 * s) + 1 + kappa**2 + 4 * s**2
    >>> closed = 0.7 * 2.6 / 0.5 * (2 * kappa * np.sinh(2 * s) - 4 * s) / D
    >>> abs(float(n[0] / closed) - 1.0) < 1e-12
    True
    """
    below = np.zeros((k.size, 2, 2))
    for layer in reversed(layers):
        below = _on_top(layer, k, below)
    return -below[:, 1, 1], -below[:, 0, 0], -below[:, 1, 0]


def shear_across(layers: tuple[ElasticLayer, ...], k: Floats) -> Floats:
    """Compliance a_s (K,) of a stack to shear across waves of these numbers k (K,) in 1/mm."""
    below = np.zeros(k.size)
    for layer in reversed(layers):
        stiff, grown = 0.5 * layer.E / (1.0 + layer.nu) * k, np.tanh(k * layer.thickness)
        below = (below + grown / stiff) / (1.0 + below * stiff * grown)
    return below


def _on_top(layer: ElasticLayer, k: Floats, below: Floats) -> Floats:
    """Displacements (U, W) by stresses (T, S), (K, 2, 2), on top of a layer whose bottom has those `below`.

    With u_x = i U, s_xz = i T the state's derivative downwards is real. Above so much of a layer that nothing
    of its bottom is left, the compliance is that of a half-plane, to which the steps come by themselves.
    """
    from scipy.linalg import expm

    nu, mu = layer.nu, 0.5 * layer.E / (1.0 + layer.nu)
    ratio, parts = nu / (1.0 - nu), max(1, int(np.ceil(min(k.max() * layer.thickness, HIGHEST) / RESOLVED)))
    h = np.minimum(layer.thickness, HIGHEST / k) / parts
    rate = np.zeros((k.size, 4, 4))  # of (U, W, T / mu, S / mu), over k
    rate[:, 0, 1], rate[:, 0, 2], rate[:, 1, 0] = -1.0, 1.0, ratio
    rate[:, 1, 3] = 0.5 * (1.0 - 2.0 * nu) / (1.0 - nu)
    rate[:, 2, 0], rate[:, 2, 3], rate[:, 3, 2] = 2.0 / (1.0 - nu), -ratio, 1.0
    up = expm(-rate * (k * h)[:, None, None])
    found = below * mu * k[:, None, None]
    for _ in range(parts):
        moved = up[:, :2, :2] @ found + up[:, :2, 2:]
        stress = up[:, 2:, :2] @ found + up[:, 2:, 2:]
        found = np.linalg.solve(stress.transpose(0, 2, 1), moved.transpose(0, 2, 1)).transpose(0, 2, 1)
    return np.asarray(found / (mu * k)[:, None, None])


@dataclass(frozen=True)
class Kernel:
    """A kernel over the distance in thicknesses of the top layer: singular term plus a spline of the smooth
    remainder, which vanishes beyond its end. `jump` None: even, with -ln|x|; else odd, with half of the jump
    at 0.
    """

    rest: Any
    jump: float | None = None

    def odd(self, order: int) -> bool:
        """Whether the kernel's integral of this order is odd."""
        return (order % 2 == 1) != (self.jump is not None)

    def singular(self, x: Floats, log: Floats, order: int) -> Floats:
        """First or second integral of the singular term at x above 0; `log` is ln x."""
        if self.jump is not None:
            return np.asarray(self.jump * (x if order == 1 else 0.5 * x**2))
        return np.asarray(x - x * log if order == 1 else 0.75 * x**2 - 0.5 * x**2 * log)


class Kernels:
    """Normal, tangential and coupling kernels of a stack over the distance in thicknesses of its top layer,
    the `unit` (mm), with their `sizes` in mm per N/mm; the table's distances grow as sinh(t), t <= `spread`.
    """

    def __init__(self, unit: float, kernels: tuple[Kernel, ...], sizes: Floats, spread: float) -> None:
        from scipy.interpolate import PPoly

        self.unit, self.kernels, self.sizes, self.spread = unit, kernels, sizes, spread
        self.places = kernels[0].rest.x
        self.rests = PPoly(np.stack([one.rest.c for one in kernels], axis=2), self.places)
        # polynomials of all first and second integrals, (pieces, 3 kernels x 2 orders) for each power
        integrals = [one.rest.antiderivative(order).c for one in kernels for order in (1, 2)]
        self._powers = [
            np.stack([c[max(k + len(c) - 6, 0)] * (k + len(c) >= 6) for c in integrals], axis=1)
            for k in range(6)
        ]
        self._last: tuple[bytes, Floats] | None = None

    def compliance(self, x: Floats, lengths: Floats) -> Floats:
        """`Layered.compliance` (2n, 2n)."""
        return self._assembled(x, lengths, 1, 1.0)

    def slope(self, x: Floats, lengths: Floats) -> Floats:
        """`Layered.compliance_slope` (1, 2n, 2n)."""
        return self._assembled(x, lengths, 0, -1.0)[None] / self.unit

    def _assembled(self, x: Floats, lengths: Floats, of: int, parity: float) -> Floats:
        normal, tangent, cross = self._means(x, lengths)[:, of]
        blocks = {(0, 0): normal, (1, 1): tangent, (0, 1): cross, (1, 0): -cross}
        return assembled(np.triu_indices(x.size), blocks, x.size, parity)

    def _means(self, x: Floats, lengths: Floats) -> Floats:
        """Slopes and means of the three kernels over each pair of strips, (3, 2, pairs); the last kept."""
        key = x.tobytes() + lengths.tobytes()
        if self._last is None or self._last[0] != key:
            i, j = np.triu_indices(x.size)
            long = lengths / self.unit
            found = self._over_strips((x[i] - x[j]) / self.unit, long[i], long[j])
            self._last = key, self.sizes[:, None, None] * found
        return self._last[1]

    def _over_strips(self, x: Floats, a: Floats, b: Floats) -> Floats:
        """Slopes and means (3, 2, k) of the kernels over strips a and b whose middles are x apart."""
        half, found = 0.5 * (a + b), np.empty((3, 2, x.size))
        far = half < np.minimum(SHORT, FAR * np.abs(x))
        found[:, :, far] = self._quadratic(x[far], (a[far] ** 2 + b[far] ** 2) / 24.0)
        x, a, b = x[~far], a[~far], b[~far]
        middle, end = 0.5 * np.abs(a - b), 0.5 * (a + b)
        ends = ((x + end, 1.0), (x + middle, -1.0), (x - middle, -1.0), (x - end, 1.0))
        found[:, :, ~far] = sum(sign * self._integrals(at) for at, sign in ends) / (a * b)
        return found

    def _quadratic(self, x: Floats, factor: Floats) -> Floats:
        """Slopes and kernels (3, 2, k) at x, and `share` times their second derivatives."""
        size, factor = np.minimum(np.abs(x), self.places[-1]), factor[:, None]
        value, slope, *more = (self.rests(size, order) for order in range(4))
        found = np.stack([slope + factor * more[1], value + factor * more[0]])
        log = np.array([-1.0 / size - 2.0 * factor[:, 0] / size**3, factor[:, 0] / size**2 - np.log(size)])
        found[:, :, :2] += log[:, :, None]
        found[1, :, 2] += self.kernels[2].jump
        found[[0, 0, 1], :, [0, 1, 2]] *= np.sign(x)
        return np.where(np.abs(x) > self.places[-1], 0.0, found.transpose(2, 0, 1))

    def _integrals(self, x: Floats) -> Floats:
        """First and second integrals (3, 2, k) of the kernels from 0 to x of either sign."""
        size, end = np.abs(x), self.places[-1]
        at = np.minimum(size, end)
        piece = (np.arcsinh(at / end * np.sinh(self.spread)) * ((self.places.size - 1) / self.spread)).astype(
            int
        )
        piece = np.minimum(piece, self.places.size - 2)
        offset, log = (at - self.places[piece])[:, None], np.log(np.where(at > 0.0, at, 1.0))
        found = self._powers[0][piece]
        for power in self._powers[1:]:
            found = found * offset + power[piece]
        rests = found.T.reshape(len(self.kernels), 2, -1)
        for kernel, (once, twice) in zip(self.kernels, rests, strict=True):
            once += kernel.singular(at, log, 1)
            twice += kernel.singular(at, log, 2) + (size - at) * once
            (twice if kernel.odd(2) else once)[x < 0.0] *= -1.0
        return rests


@lru_cache(maxsize=32)
def _kernels(layers: tuple[ElasticLayer, ...]) -> Kernels:
    """The kernels of a stack: sums over evenly spaced wavenumbers (periodic images lie beyond the table) of
    the difference to a function of known transform with the same decay.
    """
    top, unit = layers[0], layers[0].thickness
    end, mu, free = _end(layers) / unit, 0.5 * top.E / (1.0 + top.nu), 1.0 - 2.0 * top.nu
    step = np.pi / (1.5 * end)
    s = np.asarray(step * (np.arange(int(np.ceil(HIGHEST / step))) + 0.5), dtype=np.float64)
    normal, tangent, cross = (each * mu * s / unit for each in transfer(layers, s / unit))
    rests = np.stack([normal / (1.0 - top.nu) - np.tanh(s), tangent / (1.0 - top.nu) - np.tanh(s)])
    turned = 2.0 * cross - free * (1.0 - 1.0 / np.cosh(s))
    x = end * np.sinh(np.linspace(0.0, SPREAD, TABULATED)) / np.sinh(SPREAD)
    even, odd = np.zeros((2, x.size)), np.zeros(x.size)
    for chunk in np.array_split(np.arange(s.size), s.size // 1000 + 1):
        angle = np.outer(s[chunk], x)
        even += (rests[:, chunk] * (step / s[chunk])) @ np.cos(angle)
        odd += (turned[chunk] * (step / s[chunk])) @ np.sin(angle)
    ramp = np.tanh(0.25 * np.pi * x)
    even -= np.log(np.where(x > 0.0, ramp, 0.25 * np.pi) / np.where(x > 0.0, x, 1.0))
    odd -= 2.0 * free * np.arctan(ramp)
    kernels = (_kernel(x, even[0]), _kernel(x, even[1]), _kernel(x, odd, 0.5 * np.pi * free))
    own = (1.0 - top.nu) / (np.pi * mu)
    return Kernels(unit, kernels, np.array([own, own, 0.5 / (np.pi * mu)]), SPREAD)


@lru_cache(maxsize=32)
def _patches(layers: tuple[ElasticLayer, ...]) -> Patches:
    """The kernels of a stack in space."""
    top = layers[0]

    def compliances(k: Floats) -> Floats:
        return np.stack([*transfer(layers, k), shear_across(layers, k)])

    end = IN_SPACE / FARTHEST * _end(layers)
    return Patches(0.5 * top.E / (1.0 + top.nu), top.nu, compliances, SHORTEST / top.thickness, end)


def _end(layers: tuple[ElasticLayer, ...]) -> float:
    """Distance (mm) beyond which nothing is left of a stack's kernels."""
    soft = min(one.E for one in layers)
    return FARTHEST * sum(one.thickness * (one.E / soft) ** (1.0 / 3.0) for one in layers)


def _kernel(x: Floats, rest: Floats, jump: float | None = None) -> Kernel:
    """The kernel with the smooth remainder `rest` at x, which ends where the whole kernel vanishes."""
    from scipy.interpolate import CubicSpline

    ends = ((1, 0.0), (1, 1.0 / x[-1])) if jump is None else ((2, 0.0), (1, 0.0))
    return Kernel(CubicSpline(x, rest, bc_type=ends), jump)

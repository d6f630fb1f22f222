r"""Elastic layers in space: mean displacements of square patches of the surface by forces on patches.

With the compliances :math:`a_n, a_t, c` of `evfem.surface.elastic` along a wave, and :math:`a_s` of the shear
across it, Hankel's transforms give at the distance r, in the direction :math:`n = (\cos\theta, \sin\theta)`,

.. math:: u_z = N p + K\,n_i q_i, \qquad u_i = -K\,n_i\,p + A\,q_i + D\,(2 n_i n_j - \delta_{ij})\,q_j ,

N from :math:`a_n J_0`, A from :math:`(a_t + a_s) J_0 / 2`, D from :math:`(a_s - a_t) J_2 / 2` and K from
:math:`c J_1`. The kernels of a half-space of the top layer are proportional to 1/r: their means over two
squares are fourfold differences of closed forms (Love's patches). The remainder is smooth and tabulated over
r with its Laplacian: a mean over squares of sides a and b adds :math:`(a^2 + b^2)/24` times the Laplacian,
also for the singular term of patches far apart.

Sources: A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929) 377, doi:10.1098/rsta.1929.0009; K. L. Johnson,
Contact Mechanics (1985), doi:10.1017/CBO9781139171731, ch. 3. Units: mm, N, MPa; compliances are mm per N.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints

#: beyond this distance, in mean sides of the patches, the singular term's Taylor polynomial is used
FAR = 6.0
#: integration over the wavenumber: points of a panel, and k r (rad) at the largest r in the widest panel
POINTS, WIDEST = 16, 20.0
#: number of tabulated distances, end sinh(t) / sinh(SPREAD) with evenly spaced t
TABULATED, SPREAD = 600, 6.0
#: the six means: the kernel of N, A, D and K, times the angle of its cosine or (True) sine; and of those
#: of 1/r with the same angle
KERNELS = ((0, 0, False), (1, 0, False), (2, 2, False), (2, 2, True), (3, 1, False), (3, 1, True))
ANGLES = [0, 0, 1, 2, 3, 4]


class Patches:
    """Kernels of layers whose top one has `mu` (MPa) and `nu`, of what `transfer` says (a_n, a_t, c, a_s) at
    wavenumbers up to `highest` (1/mm), where only the top one is left; beyond `end` (mm) they vanish.
    """

    def __init__(
        self, mu: float, nu: float, transfer: Callable[[Floats], Floats], highest: float, end: float
    ) -> None:
        from scipy.interpolate import CubicSpline
        from scipy.special import j0, j1

        #: N, A, D and K of the half-space times the distance
        self.sizes = np.array([1.0 - nu, 1.0 - 0.5 * nu, 0.5 * nu, 0.5 - nu]) / (2.0 * np.pi * mu)
        point, weight = np.polynomial.legendre.leggauss(POINTS)
        edges = highest * np.linspace(0.0, 1.0, 20 + int(2.0 * highest * end / WIDEST)) ** 2
        half = 0.5 * np.diff(edges)[:, None]
        k = (edges[:-1, None] + half * (1.0 + point)).ravel()
        normal, along, cross, across = transfer(k) * k / (2.0 * np.pi)
        whole = np.stack([normal, 0.5 * (along + across), 0.5 * (across - along), cross])
        rest = (whole - self.sizes[:, None]) * (half * weight).ravel()
        self.places = end * np.sinh(np.linspace(0.0, SPREAD, TABULATED)) / np.sinh(SPREAD)
        found = np.zeros((TABULATED, 2, 4))
        for chunk in np.array_split(np.arange(k.size), k.size // 2000 + 1):
            angle, both = (
                np.outer(self.places, k[chunk]),
                np.stack([rest[:, chunk], -rest[:, chunk] * k[chunk] ** 2]),
            )
            zeroth, first = j0(angle), j1(angle)
            second = 2.0 * first / np.where(angle > 0.0, angle, 1.0) - zeroth * (angle > 0.0)
            for kernel, bessel in enumerate((zeroth, zeroth, second, first)):
                found[:, :, kernel] += bessel @ both[:, kernel].T
        self.rest = CubicSpline(self.places, found)

    def compliance(self, x: Floats, areas: Floats) -> Floats:
        """Mean displacements (3 n, 3 n) of squares of these areas (n,) at x (n, 2) by forces on them: first
        into the surface, then along both axes of x; forces likewise.
        """
        return matrix(self._means(*pairs(x, areas)), len(x), 1.0)

    def slope(self, x: Floats, areas: Floats) -> Floats:
        """Derivatives (2, 3 n, 3 n) of `compliance` by the position of the displaced square, both axes."""
        return np.stack([matrix(found, len(x), -1.0) for found in self._slopes(*pairs(x, areas))])

    def _means(self, x: Floats, a: Floats, b: Floats) -> Floats:
        """N, A, D cos 2 theta, D sin 2 theta, K cos theta and K sin theta (6, m), as means over squares of
        sides a and b (m,) that are x (m, 2) apart.
        """
        r, spread = np.hypot(*x.T), (a**2 + b**2) / 24.0
        near, angle = r < 0.5 * FAR * (a + b), np.arctan2(x[:, 1], x[:, 0])
        one, away = np.ones(r.size), np.where(near, 1.0, r)
        turned = np.stack([one, np.cos(2.0 * angle), np.sin(2.0 * angle), np.cos(angle), np.sin(angle)])
        singular = turned * (1.0 / away + np.outer([1.0, -3.0, -3.0, 0.0, 0.0], spread / away**3))
        singular[:, near] = love(x[near], a[near], b[near])
        value, curved = self.rest(np.minimum(r, self.places[-1])).transpose(1, 2, 0)
        of = [kernel for kernel, *_ in KERNELS]
        found = self.sizes[of, None] * singular[ANGLES] + (value + spread * curved)[of] * turned[ANGLES]
        return np.where(r > self.places[-1], 0.0, found)

    def _slopes(self, x: Floats, a: Floats, b: Floats) -> Floats:
        """Derivatives (2, 6, m) of `_means` by x.

        A kernel :math:`F(r) \\cos n\\theta` has :math:`F' \\cos n\\theta` along r and :math:`-n F
        \\sin n\\theta / r` across it.
        """
        r, spread = np.hypot(*x.T), (a**2 + b**2) / 24.0
        near, angle, end = r < 0.5 * FAR * (a + b), np.arctan2(x[:, 1], x[:, 0]), self.places[-1]
        away = np.where(near, 1.0, r)
        one, cubed = 1.0 / away**2, 3.0 * spread / away**4
        by_r = np.array([-one - cubed, -one - cubed, -one + 3.0 * cubed, -one])
        over_r = np.array([one, one, one - cubed, one])  # over r of what turns
        cut, factor = np.minimum(r, end), np.stack([np.ones(r.size), spread])
        values, slopes = (np.einsum("mak,am->km", self.rest(cut, order), factor) for order in (0, 1))
        across = np.divide(values, r, out=slopes.copy(), where=r > 0.0)
        by_r, over_r = (self.sizes[:, None] * np.where(near, 0.0, each) for each in (by_r, over_r))
        by_r, over_r = by_r + slopes, over_r + across
        found = np.stack([turning(by_r[of], over_r[of], n, angle, odd) for of, n, odd in KERNELS], axis=1)
        singular = love(x[near], a[near], b[near], _slopes)
        found[:, :, near] += self.sizes[[of for of, *_ in KERNELS], None] * singular[:, ANGLES]
        return np.where(r > end, 0.0, found)


def turning(by_r: Floats, over_r: Floats, n: int, angle: Floats, odd: bool) -> Floats:
    """Gradient (2, m) of F cos(n angle), if `odd` F sin(n angle), by dF/dr and F/r (m,)."""
    c, s = np.cos(angle), np.sin(angle)
    cosine, sine = np.cos(n * angle), np.sin(n * angle)
    own, other = (sine, n * cosine) if odd else (cosine, -n * sine)
    return np.stack([by_r * own * c - over_r * other * s, by_r * own * s + over_r * other * c])


def pairs(x: Floats, areas: Floats) -> tuple[Floats, Floats, Floats]:
    """Distances (m, 2) and sides (m,), (m,) of all pairs of squares at x (n, 2), each once."""
    (i, j), side = np.triu_indices(len(x)), np.sqrt(areas)
    return x[i] - x[j], side[i], side[j]


def matrix(means: Floats, n: int, parity: float) -> Floats:
    """The matrix (3 n, 3 n) of the six kernels' means (6, m) or their slopes over all `pairs` of n."""
    normal, mean, along, turned, first, second = means
    blocks = {(0, 0): normal, (1, 1): mean + along, (2, 2): mean - along, (1, 2): turned, (2, 1): turned}
    blocks |= {(0, 1): first, (0, 2): second, (1, 0): -first, (2, 0): -second}
    return assembled(np.triu_indices(n), blocks, n, parity)


def assembled(
    pairs: tuple[Ints, Ints], blocks: dict[tuple[int, int], Floats], n: int, parity: float
) -> Floats:
    """Matrix of the kernels' means (m,) from component q of force to p of displacement, `blocks` (p, q),
    between patches `pairs` (m,), (m,) of n: when the two are exchanged, normal-normal and
    tangential-tangential ones are multiplied by `parity`, the others by its opposite.
    """
    (i, j), size = pairs, 1 + max(p for p, _ in blocks)
    found = np.zeros((size, n, size, n))
    for (p, q), value in blocks.items():
        found[p, i, q, j] = value
        found[p, j, q, i] = value * (parity if (p == 0) == (q == 0) else -parity)
    return found.reshape(size * n, size * n)


def love(x: Floats, a: Floats, b: Floats, of: Callable[..., Floats] | None = None) -> Floats:
    """Means of 1/r, cos 2 theta / r, sin 2 theta / r, cos theta / r and sin theta / r (5, m) over two squares
    of sides a and b (m,) that are x (m, 2) apart; `of` `_slopes` their derivatives (2, 5, m) by x.

    >>> one = np.ones(1)
    >>> round(float(love(np.zeros((1, 2)), one, one)[0, 0] / np.pi), 10)  # E / (p L (1 - nu^2)), its own mean
    0.9464020088
    """
    half, middle = 0.5 * (a + b), 0.5 * np.abs(a - b)
    ends = ((half, 1.0), (middle, -1.0), (-middle, -1.0), (-half, 1.0))
    of = of or _integrals
    found = sum(m * n * of(x[:, 0] + p, x[:, 1] + q) for (p, m), (q, n) in product(ends, ends))
    return np.asarray(found) / (a * b) ** 2


def _terms(x: Floats, z: Floats) -> tuple[Floats, ...]:
    """|x|, |z|, r, its logarithm, the angle from the axis of z, and arsinh |x/z| and |z/x|, 0 on the axes."""
    u, v, r = np.abs(x), np.abs(z), np.hypot(x, z)
    log, angle = np.log(np.where(r > 0.0, r, 1.0)), np.arctan2(u, v)  # from the axis of z
    by_x, by_z = (
        np.arcsinh(np.divide(p, q, out=np.zeros_like(p), where=q > 0.0)) for p, q in ((u, v), (v, u))
    )
    return u, v, r, log, angle, by_x, by_z


def _integrals(x: Floats, z: Floats) -> Floats:
    """Second integrals over x and over z of what `love` takes the means of, but for what its differences
    cancel.
    """
    u, v, r, log, angle, by_x, by_z = _terms(x, z)
    over_x, over_z = r**3 / 6.0 + 0.5 * v**2 * (u * by_x - r), r**3 / 6.0 + 0.5 * u**2 * (v * by_z - r)
    mixed = -np.sign(x * z) * (2.0 * u * v * r + u**3 * by_z + v**3 * by_x) / 3.0
    ahead = (v**2 * u / 2.0 - u**3 / 6.0) * log + v**3 / 6.0 * angle + 0.5 * u**2 * v * (0.5 * np.pi - angle)
    aside = (u**2 * v / 2.0 - v**3 / 6.0) * log + u**3 / 6.0 * (0.5 * np.pi - angle) + 0.5 * v**2 * u * angle
    return np.stack([over_x + over_z, over_x - over_z, mixed, np.sign(x) * ahead, np.sign(z) * aside])


def _slopes(x: Floats, z: Floats) -> Floats:
    """Derivatives (2, 5, m) of `_integrals` by x and by z."""
    u, v, r, log, angle, by_x, by_z = _terms(x, z)
    side, height, both = np.sign(x), np.sign(z), np.sign(x * z)
    steep = np.array([side * 0.5 * (r * u + v**2 * by_x), height * v * (u * by_x - r)])  # of over_x
    flat = np.array([side * u * (v * by_z - r), height * 0.5 * (r * v + u**2 * by_z)])
    mixed = np.array([-height * (v * r + u**2 * by_z), -side * (u * r + v**2 * by_x)])
    turned = both * (u * v * log + 0.5 * v**2 * angle + 0.5 * u**2 * (0.5 * np.pi - angle))
    ahead = np.array([0.5 * (v**2 - u**2) * log + u * v * (0.5 * np.pi - angle), turned])
    aside = np.array([turned, 0.5 * (u**2 - v**2) * log + u * v * angle])
    return np.stack([steep + flat, steep - flat, mixed, ahead, aside], axis=1)

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
from functools import partial
from itertools import product

import numpy as np

from evfem.common.arrays import Floats, Ints

#: beyond this distance, in mean sides of the patches, the singular term's Taylor polynomial is used
FAR = 6.0
#: integration over the wavenumber: points of a panel, and k r (rad) at the largest r in the widest panel
POINTS, WIDEST = 16, 20.0
#: number of tabulated distances, end sinh(t) / sinh(SPREAD) with evenly spaced t
TABULATED, SPREAD = 600, 6.0
#: step of a slope (mm) per side of the smallest patch
STEP = 1e-5


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
        return self._matrix(x, areas, self._means, 1.0)

    def slope(self, x: Floats, areas: Floats) -> Floats:
        """Derivatives (2, 3 n, 3 n) of `compliance` by the position of the displaced square, both axes."""
        step = STEP * float(np.sqrt(areas.min()))

        def rate(shift: Floats, at: Floats, a: Floats, b: Floats) -> Floats:
            return (self._means(at + shift, a, b) - self._means(at - shift, a, b)) / (2.0 * step)

        return np.stack([self._matrix(x, areas, partial(rate, shift), -1.0) for shift in step * np.eye(2)])

    def _matrix(self, x: Floats, areas: Floats, of: Callable[..., Floats], parity: float) -> Floats:
        (i, j), side = np.triu_indices(len(x)), np.sqrt(areas)
        normal, mean, along, turned, first, second = of(x[i] - x[j], side[i], side[j])
        blocks = {(0, 0): normal, (1, 1): mean + along, (2, 2): mean - along, (1, 2): turned, (2, 1): turned}
        blocks |= {(0, 1): first, (0, 2): second, (1, 0): -first, (2, 0): -second}
        return assembled((i, j), blocks, len(x), parity)

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
        of, kind = [0, 1, 2, 2, 3, 3], [0, 0, 1, 2, 3, 4]
        found = self.sizes[of, None] * singular[kind] + (value + spread * curved)[of] * turned[kind]
        return np.where(r > self.places[-1], 0.0, found)


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


def love(x: Floats, a: Floats, b: Floats) -> Floats:
    """Means of 1/r, cos 2 theta / r, sin 2 theta / r, cos theta / r and sin theta / r (5, m) over two squares
    of sides a and b (m,) that are x (m, 2) apart.

    >>> one = np.ones(1)
    >>> round(float(love(np.zeros((1, 2)), one, one)[0, 0] / np.pi), 10)  # E / (p L (1 - nu^2)), its own mean
    0.9464020088
    """
    half, middle = 0.5 * (a + b), 0.5 * np.abs(a - b)
    ends = ((half, 1.0), (middle, -1.0), (-middle, -1.0), (-half, 1.0))
    found = sum(m * n * _integrals(x[:, 0] + p, x[:, 1] + q) for (p, m), (q, n) in product(ends, ends))
    return np.asarray(found) / (a * b) ** 2


def _integrals(x: Floats, z: Floats) -> Floats:
    """Second integrals over x and over z of what `love` takes the means of, but for what its differences
    cancel.
    """
    u, v, r = np.abs(x), np.abs(z), np.hypot(x, z)
    log, angle = np.log(np.where(r > 0.0, r, 1.0)), np.arctan2(u, v)  # from the axis of z
    by_x, by_z = (
        np.arcsinh(np.divide(p, q, out=np.zeros_like(p), where=q > 0.0)) for p, q in ((u, v), (v, u))
    )
    over_x, over_z = r**3 / 6.0 + 0.5 * v**2 * (u * by_x - r), r**3 / 6.0 + 0.5 * u**2 * (v * by_z - r)
    mixed = -np.sign(x * z) * (2.0 * u * v * r + u**3 * by_z + v**3 * by_x) / 3.0
    ahead = (v**2 * u / 2.0 - u**3 / 6.0) * log + v**3 / 6.0 * angle + 0.5 * u**2 * v * (0.5 * np.pi - angle)
    aside = (u**2 * v / 2.0 - v**3 / 6.0) * log + u**3 / 6.0 * (0.5 * np.pi - angle) + 0.5 * v**2 * u * angle
    return np.stack([over_x + over_z, over_x - over_z, mixed, np.sign(x) * ahead, np.sign(z) * aside])

r"""Quadrilaterals between grid lines and rows of the full field: matrices, potential and forces.

A cell of a layer between the curves y_l and y_{l+1}, from one line to the next one and from the
fraction :math:`\sigma` of the layer's height to :math:`\sigma + d`, has with the reference coordinates
:math:`\xi, \eta` the derivatives of its map

.. math:: x_\xi = X, \qquad y_\xi = Y(\eta) = y_l' + (\sigma + d\,\eta)(y_{l+1}' - y_l'), \qquad
          y_\eta = d\,h(\xi), \qquad h = y_{l+1} - y_l ,

so its energy is a sum of products of geometric factors and integrals of the reference cell,

.. math:: \int |\nabla\varphi|^2 = \int \frac{d h}{X} \varphi_\xi^2 - \frac{2 Y}{X} \varphi_\xi \varphi_\eta
          + \frac{X^2 + Y^2}{X d h} \varphi_\eta^2 \; d\xi\, d\eta ,

by two points of Gauss along either coordinate. All matrices are one product of arrays, and the
derivatives by X, h and Y at a fixed potential, which are virtual works, are read off. Of cells that lie
a little beside these the potential is, with the factorised matrix A and its derivative on the way there,

.. math:: \varphi - A^{-1}\, \delta\!A\, \varphi .

With complex permittivities the matrix is complex and symmetric, and the squares in forces are
:math:`|\varphi_\xi|^2`, :math:`\mathrm{Re}\,\varphi_\xi \bar\varphi_\eta`, :math:`|\varphi_\eta|^2`
with the real parts of the permittivities (`evfem.field.columns`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, lapack, linalg

#: nodes and weights of Gauss quadrature on (0, 1)
AT, WEIGHTS = np.array([0.5 - np.sqrt(1.0 / 12.0), 0.5 + np.sqrt(1.0 / 12.0)]), np.array([0.5, 0.5])
#: linear (2, q) and quadratic (3, q) shape functions there
_N, _DN = np.stack([1 - AT, AT]), np.outer([-1.0, 1.0], np.ones_like(AT))
_UP = np.stack([(1 - AT) * (1 - 2 * AT), 4 * AT * (1 - AT), AT * (2 * AT - 1)])
_DUP = np.stack([4 * AT - 3, 4 - 8 * AT, 4 * AT - 1])
#: derivatives of the six shape functions by xi and eta at the four points: (6, p, q)
_BY_XI = np.einsum("ip,jq->ijpq", _DN, _UP).reshape(6, 2, 2)
_BY_ETA = np.einsum("ip,jq->ijpq", _N, _DUP).reshape(6, 2, 2)
_WEIGHT = np.outer(WEIGHTS, WEIGHTS)
#: index of each shape function along the row and across it
_PLACES = [(i, j) for i in range(2) for j in range(3)]


def _products() -> Floats:
    """Integrals of the reference cell, (36, 8): for h at two points, Y at two and h and Y at four."""
    along = np.einsum("pq,apq,bpq->abp", _WEIGHT, _BY_XI, _BY_XI)
    mixed = np.einsum("pq,apq,bpq->abq", _WEIGHT, _BY_XI, _BY_ETA)
    across = np.einsum("pq,apq,bpq->abpq", _WEIGHT, _BY_ETA, _BY_ETA)
    parts = [along, mixed + mixed.swapaxes(0, 1), across.reshape(6, 6, 4)]
    return np.asarray(np.concatenate(parts, axis=2).reshape(36, 8))


_PRODUCTS = _products()


@dataclass(frozen=True, eq=False)
class Squares:
    """A potential's squared derivatives at the points (2, 2, E, R), weighted: by xi, xi and eta, eta."""

    along: Floats
    mixed: Floats
    across: Floats


class Cells:
    """Cells between L lines at `x` (L,), in layers between curves of heights `levels` (n + 1, L); the
    layer l has the permittivity `eps_r[l]`, real or complex, and rows at the `shares[l]` of its height.
    """

    def __init__(self, eps_r: Any, shares: tuple[Floats, ...], x: Floats, levels: Floats) -> None:
        self.levels = levels
        self.layer: Ints = np.repeat(np.arange(len(shares)), [fraction.size - 1 for fraction in shares])
        self.low = np.concatenate([fraction[:-1] for fraction in shares])
        self.rise = np.concatenate([np.diff(fraction) for fraction in shares])
        self.eps = np.asarray(eps_r)[self.layer]
        self.lines, self.rows = x.size, self.layer.size
        self.per_line = 2 * self.rows + 1
        # geometry, one array of (E, R) or (E, 1) for each point
        self.X = np.diff(x)[:, None]
        height, slope = np.diff(levels, axis=0), np.diff(levels, axis=1)
        at = height[:, :-1, None] * _N[0] + height[:, 1:, None] * _N[1]  # (n, E, 2)
        self.height = self.rise * at[self.layer].transpose(2, 1, 0)  # (2, E, R)
        self.share = self.low + self.rise * AT[:, None]  # (2, R)
        rising = (slope[1:] - slope[:-1])[self.layer].T
        self.Y = slope[:-1][self.layer].T + self.share[:, None] * rising  # (2, E, R)

    @cached_property
    def matrices(self) -> Any:
        """Cell matrices of eps grad u . grad v, (36, E, R)."""
        inverse = 1.0 / self.X
        slanted = self.X + self.Y**2 * inverse  # (2, E, R): at points across
        across = slanted[None] / self.height[:, None]
        return self._integrals(self.height * inverse, -self.Y * inverse, across)

    def rates(self, other: Cells) -> Any:
        """Derivative of `matrices`, (36, E, R), on the way to `other` cells."""
        inverse, height = 1.0 / self.X, self.height
        by_X, by_Y, by_height = other.X - self.X, other.Y - self.Y, other.height - self.height
        slope = self.Y * inverse
        slanted, turned = self.X + self.Y * slope, by_X + slope * (2.0 * by_Y - slope * by_X)
        across = (turned[None] - slanted[None] * (by_height / height)[:, None]) / height[:, None]
        return self._integrals(
            (by_height - height * inverse * by_X) * inverse, (slope * by_X - by_Y) * inverse, across
        )

    def _integrals(self, along: Floats, mixed: Floats, across: Floats) -> Any:
        """Matrices (36, E, R) from the geometry's factors (2, E, R), (2, E, R) and (2, 2, E, R)."""
        shape = across.shape[2:]
        geometry = np.concatenate([along, mixed, across.reshape(4, *shape)]) * self.eps
        return (_PRODUCTS @ geometry.reshape(8, -1)).reshape(36, *shape)

    def _part(self, values: Any, k: int) -> Any:
        """View (E, R) of values (L, rows) at the node of shape function `k` of all cells."""
        i, j = _PLACES[k]
        return values[i : i + self.lines - 1, j : j + 2 * self.rows - 1 : 2]

    def load(self, phi: Any, matrices: Any = None) -> Any:
        """Minus the matrix times a potential (L, rows), or minus one of other `matrices` (36, E, R)."""
        matrices = self.matrices if matrices is None else matrices
        result = np.zeros(phi.shape, dtype=matrices.dtype)
        for a in range(6):
            product = sum(matrices[6 * a + b] * self._part(phi, b) for b in range(6))
            self._part(result, a)[...] -= product
        return result

    def potential(self, strips: Any | None, floating: bool, near: Potentials | None = None) -> Any:
        """Potential (L, rows): 1 on the lowest curve (or strips), 0 on the highest; `floating`: no charge.
        With those of cells that differ little, `near`, to first order in the difference.
        """
        phi = self.potentials(strips, floating).values if near is None else self._moved(near, strips)
        if not floating:
            return phi[0]
        charges = [np.sum(self.load(one)[:, -1]) for one in phi]
        return phi[0] - charges[0] / charges[1] * phi[1]

    def potentials(self, strips: Any | None, floating: bool) -> Potentials:
        """The potentials of these cells, with their factorised matrix."""
        prescribed = np.zeros((2 if floating else 1, self.lines, self.per_line))
        prescribed[1:, :, -1] = 1.0
        prescribed[0, :, 0] = float(strips is None)
        held = [0, self.per_line - 1] if strips is None else [self.per_line - 1]
        load = np.stack([self.load(one) for one in prescribed])
        if strips is not None:
            load[0, :, 0] += strips.load()
        load[:, :, held] = 0.0
        divided = _divider(self._band(strips, held))
        return Potentials(prescribed + divided(load), held, divided, self, strips)

    def _moved(self, near: Potentials, strips: Any | None) -> Any:
        """Potentials (k, L, rows) to first order in the way from the cells of `near` to these."""
        rates = near.cells.rates(self)
        load = np.stack([near.cells.load(one, rates) for one in near.values])
        if strips is not None and near.strips is not None:
            bottom = near.values[:, :, 0]
            load[:, :, 0] -= strips.charges(bottom) - near.strips.charges(bottom)
            load[0, :, 0] += strips.load() - near.strips.load()
        load[:, :, near.held] = 0.0
        return near.values + near.divided(load)

    def _band(self, strips: Any | None, held: list[int]) -> Any:
        """The matrix as a lower band, (width, unknowns); the rows `held` of every line drop out."""
        width = self.per_line + 3
        band = np.zeros((width, self.lines, self.per_line), dtype=self.matrices.dtype)
        for a, (i, j) in enumerate(_PLACES):
            for b, (k, m) in enumerate(_PLACES):
                below = (i - k) * self.per_line + j - m
                if below >= 0:
                    self._part(band[below], b)[...] += self.matrices[6 * a + b]
        if strips is not None:
            diagonal, beside = strips.matrix()
            band[0, :, 0] += diagonal
            band[self.per_line, :-1, 0] += beside
        for row in held:  # what is known drops out
            band[:, :, row] = 0.0
            for k in range(1, row + 1):
                band[k, :, row - k] = 0.0
            for k in range(row + 1, min(width, row + self.per_line + 1)):
                band[k, :-1, row + self.per_line - k] = 0.0
            band[0, :, row] = 1.0
        return band.reshape(width, -1)

    def squares(self, phi: Any) -> Squares:
        """The products that the forces of a potential (L, rows), real or complex, are made of."""
        parts = np.stack([self._part(phi, k) for k in range(6)]).reshape(6, -1)
        shape = (2, 2, self.lines - 1, self.rows)
        by_xi = (_BY_XI.reshape(6, 4).T @ parts).reshape(shape)
        by_eta = (_BY_ETA.reshape(6, 4).T @ parts).reshape(shape)
        weight = WEIGHTS[0] * WEIGHTS[1] * self.eps.real
        along, across = (weight * (term * term.conj()).real for term in (by_xi, by_eta))
        return Squares(along, 2.0 * weight * (by_xi * by_eta.conj()).real, across)

    def energy(self, found: Squares) -> float:
        """The integral of `eps |grad phi|^2`."""
        X, Y, h = self.X, self.Y, self.height[:, None]
        parts = h / X * found.along - Y / X * found.mixed + (X + Y**2 / X) / h * found.across
        return float(np.sum(parts))

    def by_x(self, found: Squares, fraction: Floats, rise: Floats) -> Floats:
        """Derivative (L,) of the integral by displacements along x of the grid lines: all of a
        row, or between its lower and upper side growing `fraction` (2, R) of it, by `rise` (R,).
        """
        X, Y, h = self.X, self.Y, self.height[:, None]
        turned = found.across / h
        normal = 0.5 * (h / X * found.along - Y / X * found.mixed + (Y**2 / X - X) * turned)
        shear = 0.5 * found.mixed - Y * turned
        by_share = np.sum(-2.0 / X * fraction[:, None] * np.sum(normal, axis=0), axis=(0, 2))
        by_rise = np.sum(-2.0 * rise / h * (shear - Y / X * normal), axis=(1, 3))  # (2, E)
        left, right = (_N[end] @ by_rise for end in (0, 1))
        return np.append(left - by_share, 0.0) + np.append(0.0, right + by_share)

    def by_level(self, found: Squares) -> Floats:
        """Derivatives (n + 1, L) of the integral by the curves' heights."""
        X, Y, h = self.X, self.Y, self.height[:, None]
        steep = found.across / h
        by_height = self.rise * np.sum(found.along / X - (X + Y**2 / X) / h * steep, axis=1)  # (2, E, R)
        by_slope = np.sum(2.0 * Y * steep - found.mixed, axis=0) / X
        result = np.zeros(self.levels.shape)
        upper, lower = (np.sum(s[:, None] * by_slope, axis=0) for s in (self.share, 1.0 - self.share))
        for end, sign in ((0, -1.0), (1, 1.0)):
            own = np.tensordot(_N[end], by_height, 1)
            for k, term in ((1, own + sign * upper), (0, sign * lower - own)):
                for layer in range(len(self.levels) - 1):
                    at = self.layer == layer
                    result[layer + k, end : end + self.lines - 1] += term[:, at].sum(axis=1)
        return result

    def heights(self) -> Floats:
        """Heights (L, rows) of the unknowns."""
        y = np.empty((self.lines, self.per_line))
        for r, layer in enumerate(self.layer):
            for k, fraction in enumerate(self.low[r] + self.rise[r] * np.array([0.0, 0.5, 1.0])):
                y[:, 2 * r + k] = (1.0 - fraction) * self.levels[layer] + fraction * self.levels[layer + 1]
        return y


def _divider(band: Any) -> Callable[[Any], Any]:
    """Divides loads (k, L, rows) by a matrix's lower band: positive definite, or complex and symmetric."""
    width, size = band.shape
    if not np.iscomplexobj(band):
        factor = np.array(band.T, order="C")
        if lapack("dpbtrf", b"L", size, width - 1, factor, width):
            raise np.linalg.LinAlgError("the field's matrix is not positive definite")

        def divided(load: Floats) -> Floats:
            found = np.array(load, order="C")
            lapack("dpbtrs", b"L", size, width - 1, len(found), factor, width, found, size)
            return found

        return divided
    whole = np.zeros((2 * width - 1, size), dtype=complex)
    whole[width - 1 :] = band
    for k in range(1, width):
        whole[width - 1 - k, k:] = band[k, : size - k]
    ends = (width - 1, width - 1)

    def complex_divided(load: Any) -> Any:
        found = linalg().solve_banded(ends, whole, load.reshape(len(load), -1).T, check_finite=False)
        return found.T.reshape(load.shape)

    return complex_divided


@dataclass(frozen=True, eq=False)
class Potentials:
    """Potentials `values` (k, L, rows) of `cells`, above `strips` or a whole electrode: the second one, of a
    body without charge, is 0 on the electrode and 1 on the body. Rows `held` of each line are prescribed;
    `divided` solves for loads (k, L, rows).
    """

    values: Any
    held: list[int]
    divided: Callable[[Any], Any]
    cells: Cells
    strips: Any | None

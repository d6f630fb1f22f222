r"""Poisson's problem below a graph over x, in columns of layers: capacitance and its derivatives.

The layers (slab, air, skin) lie one above the other between curves y_l(x), l = 0 ... n, that are
straight between L vertical grid lines. Each layer has rows at fixed fractions of its height; between two
lines each row is a quadrilateral with straight sides, on which the potential is linear along the row (the
lines are as dense as the outline's own nodes) and quadratic across it,

.. math:: x = \sum_k N_k(\xi)\, x_k, \qquad
          y = (1 - \sigma) \sum_k N_k(\xi)\, y_{l,k} + \sigma \sum_k N_k(\xi)\, y_{l+1,k},

with the fraction :math:`\sigma` running over the row with :math:`\eta`. The potential is U on the
lowest curve and 0 on the highest one; on the two ends its normal derivative is zero. With unknowns
numbered along the lines the matrix of `evfem.field.poisson.poisson` is a narrow band: it
needs neither ordering nor symbolic analysis for any outline.

The derivatives of the discrete C = eps_0 times the minimal integral of ``eps |grad phi|^2`` by all
x_k and y_lk are exact: C is stationary in the potential, so they are virtual works
:math:`-2 \int T : \nabla V` of the mesh velocities V induced by moving a point of a curve.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.electrostatics.laws import eps_0
from evfem.field.columncells import AT, WEIGHTS, Cells, Potentials

#: fraction of the lowest layer that is replaced by a thin-layer expansion above finite electrodes
THIN = 0.2


@dataclass(frozen=True, eq=False)
class Capacitance:
    """C in F per m of depth (N/V^2) and its derivatives by the grid lines' `x` (L,) and by the `levels`
    (n + 1, L), in N/V^2 per mm; `phi` (L, rows) is the potential at 1 V at heights `y` (L, rows).
    """

    value: float
    by_x: Floats
    by_level: Floats
    phi: Floats
    y: Floats


@dataclass(frozen=True, eq=False)
class Columns:
    """Layers of relative permittivity `eps_r` (n,), upwards; rows at the `shares[l]` of the height."""

    eps_r: tuple[complex, ...]
    shares: tuple[Floats, ...]

    def solve(
        self,
        x: Floats,
        levels: Floats,
        electrodes: Floats | None = None,
        floating: bool = False,
        near: Potentials | None = None,
    ) -> Capacitance:
        """Solve between curves of heights `levels` (n + 1, L) at the lines `x` (L,) in mm.

        `electrodes` (K, 3) are pieces of the lowest curve, from and to in mm and their voltage over U;
        between them nothing crosses it. Without, all of it is one electrode. The highest curve is at
        0, or, `floating`, at the potential at which it has no charge. `near` are `potentials` of curves that
        differ little: the field is right to first order in the difference.

        >>> plate = Columns((1.0,), (np.array([0.0, 0.5, 1.0]),))
        >>> found = plate.solve(np.linspace(0.0, 1.0, 5), np.array([[0.0] * 5, [0.1] * 5]))
        >>> round(found.value / eps_0, 9), round(float(found.by_level[1].sum() / eps_0), 6)
        (10.0, -100.0)
        """
        cells, strips = self.cells(x, levels, electrodes)
        phi = cells.potential(strips, floating, near)
        found = cells.squares(phi)
        value = cells.energy(found)
        by_x = cells.by_x(found, np.ones_like(cells.share), np.zeros_like(cells.rise))
        by_level = cells.by_level(found)
        if strips is not None:
            held, moved = strips.energy(phi[:, 0])
            value, by_x = value + held, by_x + moved
            by_level[1] += THIN * by_level[0]
            by_level[0] *= 1.0 - THIN
        return Capacitance(eps_0 * value, eps_0 * by_x, eps_0 * by_level, phi, cells.heights())

    def potentials(self, x: Floats, levels: Floats, electrodes: Floats | None, floating: bool) -> Potentials:
        """The potentials, with what solves for those of other curves that differ little."""
        cells, strips = self.cells(x, levels, electrodes)
        return cells.potentials(strips, floating)

    def cells(self, x: Floats, levels: Floats, electrodes: Floats | None) -> tuple[Cells, Strips | None]:
        """The cells, and the thin-layer expansion below them for finite electrodes."""
        if electrodes is None:
            return Cells(self.eps_r, self.shares, x, levels), None
        depth = levels[1] - levels[0]
        strips = Strips(x, electrodes, THIN * float(np.mean(depth)), self.eps_r[0])
        return Cells(self.eps_r, self.shares, x, np.vstack([levels[:1] + THIN * depth, levels[1:]])), strips


class Strips:
    """Finite electrodes: in a fraction `THIN` of the lowest layer, of thickness d, the energy is eps times
    the integral of w (phi - V)^2 / d + (1 - 2 w / 3) d phi'^2, where w is the fraction of electrode within d
    to either side. Plates stay exact, edges are smoothed over d, and grid lines may move over them.
    """

    def __init__(self, x: Floats, electrodes: Floats, depth: float, eps_r: complex) -> None:
        self.pieces, self.depth = np.asarray(electrodes, dtype=float), depth
        begin, end, voltage = self.pieces.T
        ends = np.sort([begin - depth, begin + depth, end - depth, end + depth], axis=0)
        self.width = np.diff(x)
        low, high = (
            np.clip((edge.ravel()[:, None] - x[:-1]) / self.width, 0.0, 1.0) for edge in (ends[:-1], ends[1:])
        )  # (3 K, E)
        at = low[..., None] + (high - low)[..., None] * AT  # (3 K, E, q)
        overlap = self.overlap(x[:-1, None] + at * self.width[:, None], np.tile(np.arange(begin.size), 3))
        fraction = overlap * (high - low)[..., None] * WEIGHTS
        self.weight = eps_r / depth * fraction
        self.voltage = np.tile(voltage, 3)[:, None, None]
        self.shapes = np.stack([1.0 - at, at])  # (2, 3 K, E, q)
        whole = self.width * (1.0 - 2.0 / 3.0 * fraction.sum(axis=(0, 2)))
        self.along = eps_r * depth * whole / self.width**2  # (E,)
        every = np.arange(begin.size)
        lines = self.overlap(np.broadcast_to(x, (begin.size, x.size))[..., None], every)[..., 0]  # (K, L)
        self.at_lines = eps_r * depth * (1.0 - 2.0 / 3.0 * lines.sum(axis=0))  # (L,)
        self.at_ends = eps_r / depth * lines[:, [0, -1]]

    def overlap(self, x: Floats, electrode: Ints) -> Floats:
        """Overlap: the fraction of electrode k within the depth to either side of positions (k, ..., q)."""
        begin, end, _ = self.pieces[electrode].T[:, :, None, None]
        up, down = (np.clip((x - edge) / (2.0 * self.depth) + 0.5, 0.0, 1.0) for edge in (begin, end))
        return np.asarray(up - down)

    def matrix(self) -> tuple[Floats, Floats]:
        """Diagonal (L,) and off-diagonal (L - 1,) added to the matrix of the bottom row."""
        weight = self.weight * self.width[:, None]
        own = [np.sum(weight * shape**2, axis=(0, 2)) + self.along for shape in self.shapes]
        beside = np.sum(weight * np.prod(self.shapes, 0), axis=(0, 2)) - self.along
        return np.append(own[0], 0.0) + np.append(0.0, own[1]), beside

    def charges(self, phi: Any) -> Any:
        """What the matrix makes of potentials (..., L) of the bottom row."""
        diagonal, beside = self.matrix()
        result = diagonal * phi
        result[..., :-1] += beside * phi[..., 1:]
        result[..., 1:] += beside * phi[..., :-1]
        return result

    def load(self) -> Floats:
        """Contribution (L,) of the electrodes to the right-hand side of the bottom row."""
        weight = self.weight * self.width[:, None] * self.voltage
        own = [np.sum(weight * shape, axis=(0, 2)) for shape in self.shapes]
        return np.asarray(np.append(own[0], 0.0) + np.append(0.0, own[1]))

    def energy(self, phi: Floats) -> tuple[float, Floats]:
        """The energy for potentials (L,) of the bottom row, and its derivative by x (L,) of the lines."""
        beyond = phi[:-1, None] * self.shapes[0] + phi[1:, None] * self.shapes[1] - self.voltage
        rise = np.diff(phi)
        value = np.sum(self.weight * self.width[:, None] * beyond**2) + np.sum(self.along * rise**2)
        rate = [-2.0 * rise * np.sum(self.weight * beyond * shape, axis=(0, 2)) for shape in self.shapes]
        slope, longer = (rise / self.width) ** 2, 2.0 * self.along * rise**2 / self.width
        rate[0] += longer - slope * self.at_lines[:-1]
        rate[1] += slope * self.at_lines[1:] - longer
        by_x = np.append(rate[0], 0.0) + np.append(0.0, rate[1])
        beyond_ends = self.at_ends * (phi[[0, -1]] - self.pieces[:, 2:]) ** 2  # (K, 2): the area moves along
        by_x[[0, -1]] += np.array([-1.0, 1.0]) * beyond_ends.sum(axis=0)
        return float(value), by_x

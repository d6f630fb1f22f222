r"""Poisson's problem below a graph over x, in columns of layers: the capacitance and its derivative.

The layers (slab, air, skin) lie one above the other between curves y_l(x), l = 0 ... n, that are
straight between L lines. Each layer has rows at fixed shares of its height; between two lines each
row is a quadrilateral with straight sides, on which the potential is linear along the row (the
lines are as dense as the outline's own nodes) and quadratic across it,

.. math:: x = \sum_k N_k(\xi)\, x_k, \qquad
          y = (1 - \sigma) \sum_k N_k(\xi)\, y_{l,k} + \sigma \sum_k N_k(\xi)\, y_{l+1,k},

with the share :math:`\sigma` running over the row with :math:`\eta`. The potential is U on the
lowest curve and 0 on the highest one; on the two ends its normal derivative is zero. With unknowns
numbered along the lines the matrix of `evfem.electrostatics.poisson.poisson` is a narrow band: it
needs neither ordering nor symbolic analysis, whatever the outline does.

The derivatives of the discrete C = eps_0 times the minimal integral of ``eps |grad phi|^2`` by all
x_k and y_lk are exact: C is stationary in the potential, so they are virtual works
:math:`-2 \int T : \nabla V` of the velocities V with which a curve's point takes the cells along.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.electrostatics.laws import eps_0

#: places and weights of quadrature on (0, 1); linear (2, q) and quadratic (3, q) shape functions there
_AT, _WEIGHT = np.array([0.5 - np.sqrt(1.0 / 12.0), 0.5 + np.sqrt(1.0 / 12.0)]), np.array([0.5, 0.5])
_N, _DN = np.stack([1 - _AT, _AT]), np.outer([-1.0, 1.0], np.ones_like(_AT))
_UP = np.stack([(1 - _AT) * (1 - 2 * _AT), 4 * _AT * (1 - _AT), _AT * (2 * _AT - 1)])
_DUP = np.stack([4 * _AT - 3, 4 - 8 * _AT, 4 * _AT - 1])
#: share of the lowest layer that is taken to the second order on electrodes that end
THIN = 0.2
#: shape functions of a cell
_SHAPES = 6


@dataclass(frozen=True, eq=False)
class Capacitance:
    """C in F per m of depth (N/V^2) and its derivatives by the lines' `x` (L,) and by the `levels`
    (n + 1, L), in N/V^2 per mm; `phi` (L, rows) is the potential at 1 V, `y` (L, rows) where.
    """

    value: float
    by_x: Floats
    by_level: Floats
    phi: Floats
    y: Floats


@dataclass(frozen=True, eq=False)
class Columns:
    """Layers of relative permittivity `eps_r` (n,), from the electrode up, each with rows at the
    shares `shares[l]` of its height, from 0 to 1.
    """

    eps_r: tuple[float, ...]
    shares: tuple[Floats, ...]

    def solve(
        self, x: Floats, levels: Floats, electrodes: Floats | None = None, floating: bool = False
    ) -> Capacitance:
        """Solve between curves of heights `levels` (n + 1, L) at the lines `x` (L,) in mm.

        `electrodes` (K, 3) are pieces of the lowest curve, from and to in mm and their voltage over U;
        between them nothing crosses it. Without, all of it is one electrode. The highest curve is at
        0, or, `floating`, at the potential at which it has no charge.

        >>> plate = Columns((1.0,), (np.array([0.0, 0.5, 1.0]),))
        >>> found = plate.solve(np.linspace(0.0, 1.0, 5), np.array([[0.0] * 5, [0.1] * 5]))
        >>> round(found.value / eps_0, 9), round(float(found.by_level[1].sum() / eps_0), 6)
        (10.0, -100.0)
        """
        if electrodes is None:
            cells = _Cells(self, x, levels)
            return cells.capacitance(cells.potential(None, floating), None)
        raised = levels.copy()
        raised[0] += THIN * (levels[1] - levels[0])
        cells = _Cells(self, x, raised)
        strips = _Strips(x, electrodes, THIN * float(np.mean(levels[1] - levels[0])), self.eps_r[0])
        found = cells.capacitance(cells.potential(strips, floating), strips)
        found.by_level[1] += THIN * found.by_level[0]
        found.by_level[0] *= 1.0 - THIN
        return found


class _Strips:
    """Electrodes that end somewhere. A share `THIN` of the lowest layer, of thickness d, is taken to the
    second order in its thickness: where the potential above it is phi, and w is the share of electrode
    within d to either side, of voltage V, its energy is eps times the integral of
    w (phi - V)^2 / d + (1 - 2 w / 3) d phi'^2. So plates stay exact, the field at an edge is smoothed
    over that thickness, and the energy changes smoothly when lines move over an edge.
    """

    def __init__(self, x: Floats, electrodes: Floats, depth: float, eps_r: float) -> None:
        self.pieces, self.depth = np.asarray(electrodes, dtype=float), depth
        begin, end, voltage = self.pieces.T
        ends = np.sort([begin - depth, begin + depth, end - depth, end + depth], axis=0)
        self.width = np.diff(x)
        low, high = (
            np.clip((place.ravel()[:, None] - x[:-1]) / self.width, 0.0, 1.0)
            for place in (ends[:-1], ends[1:])
        )  # (3 K, E)
        at = low[..., None] + (high - low)[..., None] * _AT  # (3 K, E, q)
        over = self.over(x[:-1, None] + at * self.width[:, None], np.tile(np.arange(begin.size), 3))
        share = over * (high - low)[..., None] * _WEIGHT
        self.weight = eps_r / depth * share
        self.voltage = np.tile(voltage, 3)[:, None, None]
        self.shapes = np.stack([1.0 - at, at])  # (2, 3 K, E, q)
        whole = self.width * (1.0 - 2.0 / 3.0 * share.sum(axis=(0, 2)))
        self.along = eps_r * depth * whole / self.width**2  # (E,)
        every = np.arange(begin.size)
        lines = self.over(np.broadcast_to(x, (begin.size, x.size))[..., None], every).sum(axis=(0, 2))
        self.at_lines = eps_r * depth * (1.0 - 2.0 / 3.0 * lines)  # (L,)

    def over(self, x: Floats, electrode: Ints) -> Floats:
        """The share within the depth to either side of places (k, ..., q) that is electrode k."""
        begin, end, _ = self.pieces[electrode].T[:, :, None, None]
        up, down = (np.clip((x - place) / (2.0 * self.depth) + 0.5, 0.0, 1.0) for place in (begin, end))
        return np.asarray(up - down)

    def matrix(self) -> tuple[Floats, Floats]:
        """Diagonal (L,) and off-diagonal (L - 1,) of what joins the matrix of the lowest row."""
        weight = self.weight * self.width[:, None]
        own = [np.sum(weight * shape**2, axis=(0, 2)) + self.along for shape in self.shapes]
        beside = np.sum(weight * np.prod(self.shapes, 0), axis=(0, 2)) - self.along
        return np.append(own[0], 0.0) + np.append(0.0, own[1]), beside

    def load(self) -> Floats:
        """What joins the right-hand side of the lowest row (L,)."""
        weight = self.weight * self.width[:, None] * self.voltage
        own = [np.sum(weight * shape, axis=(0, 2)) for shape in self.shapes]
        return np.asarray(np.append(own[0], 0.0) + np.append(0.0, own[1]))

    def energy(self, phi: Floats) -> tuple[float, Floats]:
        """The integral for potentials (L,) of the lowest row, and its derivative by x (L,): the
        electrodes stay where they are when the lines move.
        """
        beyond = phi[:-1, None] * self.shapes[0] + phi[1:, None] * self.shapes[1] - self.voltage
        rise = np.diff(phi)
        value = np.sum(self.weight * self.width[:, None] * beyond**2) + np.sum(self.along * rise**2)
        rate = [-2.0 * rise * np.sum(self.weight * beyond * shape, axis=(0, 2)) for shape in self.shapes]
        slope, longer = (rise / self.width) ** 2, 2.0 * self.along * rise**2 / self.width
        rate[0] += longer - slope * self.at_lines[:-1]
        rate[1] += slope * self.at_lines[1:] - longer
        return float(value), np.append(rate[0], 0.0) + np.append(0.0, rate[1])


class _Cells:
    """Quadrilaterals (rows R, columns E) with four points each, and their shape functions."""

    def __init__(self, columns: Columns, x: Floats, levels: Floats) -> None:
        self.levels = levels
        self.layer = np.repeat(np.arange(len(columns.shares)), [s.size - 1 for s in columns.shares])
        low = np.concatenate([share[:-1] for share in columns.shares])
        rise = np.concatenate([np.diff(share) for share in columns.shares])
        self.low, self.rise = low, rise
        self.lines: Ints = np.arange(x.size - 1)[:, None] + np.arange(2)  # (E, 2)
        at = levels[:, self.lines]  # (n + 1, E, 2)
        value, slope = at @ _N, at @ _DN  # (n + 1, E, q)
        self.x_xi = (x[self.lines] @ _DN)[None, :, :, None]
        share = (low[:, None] + rise[:, None] * _AT)[:, None, None, :]  # (R, 1, 1, q)
        bottom, top = self.layer, self.layer + 1
        height = (value[top] - value[bottom])[..., None]
        self.share = share
        self.y_xi = slope[bottom][..., None] + share * (slope[top] - slope[bottom])[..., None]
        self.y_eta = rise[:, None, None, None] * height
        eps = np.array(columns.eps_r)[self.layer][:, None, None, None]
        self.weight = eps * self.x_xi * self.y_eta * np.outer(_WEIGHT, _WEIGHT)  # (R, E, q, q)
        self.by_x, self.by_y = self._gradients()

    def _gradients(self) -> tuple[Floats, Floats]:
        """Derivatives of the six shape functions by x and y: (R, E, q, q, 6)."""
        along = np.einsum("ip,jq->pqij", _DN, _UP).reshape(_AT.size, _AT.size, _SHAPES)
        up = np.einsum("ip,jq->pqij", _N, _DUP).reshape(_AT.size, _AT.size, _SHAPES)
        by_y = up / self.y_eta[..., None]
        return (along - self.y_xi[..., None] * by_y) / self.x_xi[..., None], by_y

    def _matrices(self) -> Floats:
        """Cell matrices of eps grad u . grad v, (R, E, 6, 6)."""
        shape = (*self.by_x.shape[:2], -1, _SHAPES)
        weight = self.weight[..., None]
        parts = [
            ((g * weight).reshape(shape).swapaxes(2, 3), g.reshape(shape)) for g in (self.by_x, self.by_y)
        ]
        return np.asarray(sum(left @ right for left, right in parts))

    @property
    def numbers(self) -> Ints:
        """Numbers (R, E, 6) of the cells' unknowns, along the lines."""
        rows = 2 * np.arange(self.layer.size)[:, None] + np.arange(3)  # (R, 3)
        per_line = 2 * self.layer.size + 1
        number = self.lines[None, :, :, None] * per_line + rows[:, None, None, :]
        return np.asarray(number.reshape(self.layer.size, self.lines.shape[0], _SHAPES))

    def potential(self, strips: _Strips | None, floating: bool) -> Floats:
        """Potential (L, rows): 1 on the lowest curve, or as the strips hold it, and 0 on the highest one,
        or constant there.
        """
        from scipy.linalg import cho_solve_banded, cholesky_banded

        self.matrices = self._matrices()
        per_line, lines = 2 * self.layer.size + 1, int(self.lines[-1, -1]) + 1
        given = np.zeros((2, lines, per_line))  # for the electrodes, and for 1 on the highest curve
        given[1, :, -1] = 1.0
        given[0, :, 0] = float(strips is None)
        load = np.stack([self._load(one) for one in given])
        held = [0, per_line - 1] if strips is None else [per_line - 1]
        band = self._band(strips, held)
        if strips is not None:
            load[0, :, 0] += strips.load()
        load[:, :, held] = 0.0
        factor = cholesky_banded(band, lower=True, check_finite=False)
        wanted = load[: 2 if floating else 1].reshape(-1, lines * per_line).T
        free = cho_solve_banded((factor, True), wanted, check_finite=False).T
        phi = free.reshape(-1, lines, per_line) + given[: len(free)]
        if not floating:
            return np.asarray(phi[0])
        charges = [float(np.sum(self._load(one)[:, -1])) for one in phi]
        return np.asarray(phi[0] - charges[0] / charges[1] * phi[1])

    def _load(self, phi: Floats) -> Floats:
        """Minus the matrix times a potential (L, rows)."""
        numbers = self.numbers
        local = self.matrices @ phi.ravel()[numbers][..., None]
        return np.asarray(
            -np.bincount(numbers.ravel(), local.ravel(), phi.size).reshape(phi.shape), dtype=float
        )

    def _band(self, strips: _Strips | None, held: list[int]) -> Floats:
        """The matrix as a lower band, (width, unknowns); the rows `held` of every line drop out."""
        numbers, per_line = self.numbers, 2 * self.layer.size + 1
        lines = int(self.lines[-1, -1]) + 1
        width, size = per_line + 3, per_line * lines
        first = np.broadcast_to(numbers[..., :, None], self.matrices.shape)
        second = np.broadcast_to(numbers[..., None, :], self.matrices.shape)
        below = first >= second
        place = ((first - second) * size + second)[below]
        band = np.asarray(np.bincount(place, self.matrices[below], width * size), dtype=float)
        band = band.reshape(width, -1)
        if strips is not None:
            diagonal, beside = strips.matrix()
            band[0, ::per_line] += diagonal
            band[per_line, :-per_line:per_line] += beside
        for row in held:  # what is known drops out
            known = np.arange(lines) * per_line + row
            band[:, known] = 0.0
            for k in range(1, width):
                band[k, known[known >= k] - k] = 0.0
            band[0, known] = 1.0
        return np.asarray(band)

    def capacitance(self, phi: Floats, strips: _Strips | None) -> Capacitance:
        """C and its derivatives for a potential (L, rows)."""
        local = phi.ravel()[self.numbers]
        value = float(np.sum(local * (self.matrices @ local[..., None])[..., 0]))
        Ex, Ey = (np.einsum("repqa,rea->repq", g, local) for g in (self.by_x, self.by_y))
        half = 0.5 * (Ex**2 + Ey**2)
        xx, xy, yy = (self.weight * t for t in (Ex * Ex - half, Ex * Ey, Ey * Ey - half))
        shape, slope = _N.T[None, None, :, None, :], _DN.T[None, None, :, None, :]  # (1, 1, q, 1, 2)
        y_xi, y_eta, x_xi = (v[..., None] for v in (self.y_xi, self.y_eta, self.x_xi))
        share, rise = self.share[..., None], self.rise[:, None, None, None, None]

        def work(along: Floats, up: Floats, shear: Floats, own: Floats) -> Floats:
            """Minus the stress times the gradient of a velocity with these derivatives by xi and eta."""
            by_x = (along - y_xi / y_eta * up) / x_xi
            return -2.0 * np.sum(shear[..., None] * by_x + own[..., None] * up / y_eta, axis=(2, 3))

        moved_x = work(slope + 0.0 * share, 0.0 * share * shape, xx, xy)  # (R, E, 2)
        lower = work(slope * (1.0 - share), -shape * rise, xy, yy)
        upper = work(slope * share, shape * rise, xy, yy)
        lines = phi.shape[0]
        by_x = np.bincount(self.lines.ravel(), moved_x.sum(axis=0).ravel(), lines).astype(float)
        by_level = np.zeros(self.levels.shape)
        for layer in range(len(self.levels) - 1):
            own = self.layer == layer
            for k, part in ((layer, lower), (layer + 1, upper)):
                by_level[k] += np.bincount(self.lines.ravel(), part[own].sum(axis=0).ravel(), lines)
        if strips is not None:
            held, moved = strips.energy(phi[:, 0])
            value, by_x = value + held, by_x + moved
        y = self._heights(phi.shape)
        return Capacitance(eps_0 * value, eps_0 * by_x, eps_0 * by_level, phi, y)

    def _heights(self, shape: tuple[int, ...]) -> Floats:
        y = np.empty(shape)
        for r, layer in enumerate(self.layer):
            for k, share in enumerate(self.low[r] + self.rise[r] * np.array([0.0, 0.5, 1.0])):
                y[:, 2 * r + k] = (1.0 - share) * self.levels[layer] + share * self.levels[layer + 1]
        return y

r"""The attraction of the pad from the full field instead of column by column.

Below the part of the outline that faces the display (its flanks keep the column law) Poisson's problem is
solved in insulator, air and stratum corneum, in columns that stand at the pad nodes, on quadratic edges
between them too, and move with them (`evfem.field.columns`). The electrode is at the voltage, living tissue
at 0. Nodes that touch keep `SERIES_GAP` of the insulator's reduced thickness, and what rough faces keep, as a
gap in series. Nodal forces are derivatives of the discrete energy

.. math:: W = \tfrac12 U^2 C(x, y), \qquad f_j = \frac{\partial W}{\partial (x_j, y_j)}.

The tangent of a step is that of the column law, between rough faces scaled by the ratio of the forces
(`tangent_factor`). Where iterations stagnate, among ridges or steep waves close to a thin insulator, it is
that of the field by differences (`full_stiffness`): the field of a node decays within a few nodes, so every
`APART`-th one is moved at once, with potentials to first order from one factorised matrix
(`evfem.field.columncells`). In every accepted state C lies between its bounds (`certificate`).
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sparse

from evfem.common.arrays import ENDS, Floats, Ints
from evfem.common.constants import FIELD_ROUNDING
from evfem.electrostatics.alternating import voltage_fraction
from evfem.electrostatics.laws import Layer, eps_0
from evfem.errors import Unresolved
from evfem.field.bounds import columns_sum, least_upper_sum
from evfem.field.columncells import Potentials
from evfem.field.columns import Capacitance, Columns
from evfem.surface.pad import Pad, surface_state
from evfem.terms.attraction import Attraction
from evfem.terms.traction import TOUCHING, Entries, PadPath, PadState

#: gap of touching nodes, as a fraction of the insulator's reduced thickness
SERIES_GAP = 1e-4
#: outer edges steeper than this, ``|n_y|`` below it, belong to the flanks
FLANK = 0.3
#: rows as fractions of the layers' heights: fine where insulator and skin meet the air
INSULATOR = 1.0 - np.linspace(1.0, 0.0, 5) ** 2
AIR = np.linspace(0.0, 1.0, 5)
SKIN = np.linspace(0.0, 1.0, 6) ** 2
#: fraction by which a discrete capacitance may miss its bounds
MARGIN = 1e-3
#: columns follow an outline up to this slope
STEEP = 6.0
#: columns below an edge with a middle node
PARTS = 4
#: solutions that are cached
KEPT = 3
#: nodes of a line that are moved at once for differences: one of so many, by this length (mm), small
#: beside the gap that touching nodes keep
APART, MOVED = 8, 1e-10

#: for each stack of layers the potentials that are corrected, or None to solve anew
Near = tuple[Potentials | None, ...]


def in_sight(points: Floats) -> Ints:
    """Numbers (K,) of the points (L, 2) of an outline, from left to right, that are visible from the display
    and have columns. Of two neighbours along a slope above `STEEP` the higher one is behind an overhang, or
    deep in a groove.

    >>> in_sight(np.array([[0.0, 0.0], [1.0, 0.0], [0.9, 0.5], [2.0, 0.0]])).tolist()
    [0, 1, 3]
    """
    apart, rise = np.diff(points, axis=0).T
    if np.all(apart > 0.0) and np.all(apart >= np.abs(rise) / STEEP):
        return np.arange(len(points))
    x, y = points.T.tolist()
    kept: list[int] = []
    for k in range(len(x)):
        while kept and x[k] - x[kept[-1]] < (y[kept[-1]] - y[k]) / STEEP and y[k] < y[kept[-1]]:
            kept.pop()
        if not kept or x[k] - x[kept[-1]] > max(0.0, (y[k] - y[kept[-1]]) / STEEP):
            kept.append(k)
    return np.array(kept)


def facing(pad: Pad, points: Floats) -> Ints:
    """Edges (K,), left to right, of the chain below the lowest node's flanks; `points` (P, 2) undeformed."""
    edge = points[pad.edges[:, 1]] - points[pad.edges[:, 0]]
    after = {int(edge[0]): k for k, edge in enumerate(pad.edges)}
    before = {int(edge[1]): k for k, edge in enumerate(pad.edges)}
    start = int(np.argmin(points[pad.edges[:, :2], 1].min(axis=1)))
    chain = [start]
    while (k := after.get(int(pad.edges[chain[-1], 1]))) is not None and edge[k, 0] > 0.0 and k != start:
        chain.append(k)
    while (k := before.get(int(pad.edges[chain[0], 0]))) is not None and edge[k, 0] > 0.0 and k != chain[-1]:
        chain.insert(0, k)
    flat = edge[chain, 0] >= FLANK * np.hypot(*edge[chain].T)
    flat[chain.index(start)] = True
    ends = np.flatnonzero(flat)[[0, -1]]
    return np.array(chain[ends[0] : ends[1] + 1])


def in_line(pad: Pad, edges: Ints) -> Ints:
    """Pad nodes (L,) of a chain of edges (K,) from left to right."""
    ends = pad.edges[edges]
    inner = ends[:, [0, *range(2, ends.shape[1])]].ravel()
    return np.append(inner, ends[-1, 1])


@dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of a capacitance in F per m of depth (N/V^2), the lower by the column law."""

    lower: float
    upper: float

    @property
    def spread(self) -> float:
        """By how much of itself the column law's energy may be too small."""
        return self.upper / self.lower - 1.0


def certificate(x: Floats, levels: Floats, insulator: Layer, skin: Floats, gap_eps_r: float = 1.0) -> Bounds:
    """Bounds for an outline without solving: points at `x` (L,), `levels` (2, L) of ground and outline in mm,
    the gap filled with `gap_eps_r`, an insulator below; `skin` (L,) is the skin's layer, reduced (mm).

    Below: the column law. Above: potentials linear along verticals, the skin's layer a conductor
    (`evfem.field.bounds`). C is proportional to all permittivities.
    """
    eps_r, gap = float(insulator.eps_r) / gap_eps_r, levels[1] - levels[0]
    lower = columns_sum(x, gap + float(insulator.thickness) / eps_r + skin * gap_eps_r)
    upper = least_upper_sum(x, gap, float(insulator.thickness), eps_r, ground=levels[0])
    return Bounds(eps_0 * gap_eps_r * lower, eps_0 * gap_eps_r * upper)


@dataclass(frozen=True, eq=False)
class FieldAttraction(Attraction):
    """The attraction of the full field: `edges` (K,) of the pad that face the display, from left to
    right, and the skin's layer under each pad node, `skin`; a `floating` finger has no charge.
    """

    edges: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    skin: Any = None
    floating: bool = False
    solved: OrderedDict[bytes, tuple[Capacitance | None, Floats]] = field(default_factory=OrderedDict)

    @property
    def _plane(self) -> Pad:
        assert isinstance(self.pad, Pad)
        return self.pad

    @cached_property
    def column_law(self) -> Attraction:
        """The column law on all edges, for the tangent."""
        return Attraction(**{each.name: getattr(self, each.name) for each in fields(Attraction)})

    @cached_property
    def flanks(self) -> Attraction:
        """The column law on the other edges."""
        others = np.setdiff1d(np.arange(len(self._plane.edges)), self.edges)
        return replace(self.column_law, pad=replace(self._plane, edges=self._plane.edges[others]))

    @cached_property
    def _lines(self) -> Any:
        """Sparse (L, P): from values of the pad nodes to those of the lines, from left to right."""
        ends = self._plane.edges[self.edges]
        if ends.shape[1] == 2:
            node = np.append(ends[:, 0], ends[-1, 1])
            every = np.arange(node.size)
            return sparse.csr_matrix((np.ones(node.size), (every, node)), (node.size, self._size))
        at = np.arange(PARTS) / PARTS
        shapes = np.stack([(1 - at) * (1 - 2 * at), at * (2 * at - 1), 4 * at * (1 - at)], axis=1)
        row = np.repeat(np.arange(PARTS * len(ends)), 3)
        values = np.append(np.tile(shapes.ravel(), len(ends)), 1.0)
        column = np.append(np.repeat(ends, PARTS, axis=0).ravel(), ends[-1, 1])
        size = (PARTS * len(ends) + 1, self._size)
        return sparse.csr_matrix((values, (np.append(row, size[0] - 1), column)), size)

    @property
    def _size(self) -> int:
        return int(self.pad.nodes.size)

    def forces_along(self, path: PadState) -> Floats:
        """Forces (W, P, 2) in the states of a path, each from its own solution."""
        fraction = voltage_fraction(self._electrodes, path.position[..., 0])[..., None]
        forces = fraction**2 * self.flanks.forces_along(path)
        for k, pad in enumerate(path.states()):
            if pad.voltage != 0.0:
                forces[k] += pad.voltage**2 * self._remembered(pad)[1]
        return forces

    def weights(self, pad: PadState) -> Floats:
        """Lengths (P,): half the distance to the next columns, on the flanks the columns' own."""
        lines = self.visible(pad.position)
        half = 0.5 * np.diff(lines @ pad.position[:, 0])
        own = lines.T @ (np.append(half, 0.0) + np.append(0.0, half))
        return np.asarray(own + self.flanks.pad.tributary(pad.position))

    has_fringes = True
    rounding = FIELD_ROUNDING

    @property
    def has_energy(self) -> bool:  # type: ignore[override]
        """Without rough faces, whose gap depends on the contact forces."""
        return self.roughness is None

    def tangent_factor(self, pad: PadState) -> Floats:
        """Factor (P,) of the column law's derivatives: the squared fraction of the voltage below a node,
        between rough faces the ratio of the field's force to the columns', at most 1: on a summit it gains
        less.
        """
        if self.roughness is None:
            return voltage_fraction(self._electrodes, pad.position[:, 0]) ** 2
        columns, forces = (law.forces(pad)[:, 1] for law in (self.column_law, self))
        pulled = columns < 0.0
        return np.where(pulled, np.clip(forces / np.where(pulled, columns, 1.0), 0.0, 1.0), 1.0)

    def gain_on_pressing(self, pad: PadState) -> Floats:
        """The column law's, times the `tangent_factor`."""
        return np.asarray(super().gain_on_pressing(pad) * self.tangent_factor(pad))

    def weakening(self, pad: PadState) -> Floats:
        """The column law's, times the `tangent_factor`."""
        return np.asarray(super().weakening(pad) * self.tangent_factor(pad))

    def work_along(self, path: PadPath) -> float:
        if not self.has_energy or not (path.old.voltage or path.new.voltage):
            return super().work_along(path)
        return path.trapezoidal + self._beyond_trapezoidal(path)

    def power_of_ends(self, path: PadPath, along: Floats) -> float:
        """Of the columns, as `powers` are."""
        return float(np.mean(self.powers(path, along, ENDS)))

    def released_work(
        self, path: PadPath, along: Floats, begin: Floats, fractions: Floats, control: Any
    ) -> Floats:
        """The columns', and the fringes' evenly."""
        work = super().released_work(path, along, begin, fractions, control)
        held = replace(path, old=replace(path.old, voltage=path.new.voltage))
        last = float(self.powers(held, along, fractions[-1:], begin)[0])
        return work + (float(np.sum(path.ends[1] * along)) - last) * fractions

    def _beyond_trapezoidal(self, path: PadPath) -> float:
        """Energy on the path beyond the trapezoidal work (N mm per mm of depth)."""
        begin, end = path.old.position, path.new.position
        self.check(end)
        squared = [pad.voltage**2 for pad in (path.old, path.new)]
        before, after = self.solve(begin), self.solve(end)
        energy = 0.25 * sum(squared) * (after.value - before.value)
        ends = zip(squared, (path.old, path.new), strict=True)
        forces = sum(square * self._remembered(pad)[1] for square, pad in ends)
        return energy - 0.5 * float(np.sum(forces * (end - begin)))

    def bare(self, position: Floats) -> PadState:
        """The pad at `position` (P, 2) under 1 V, not pressed."""
        return self.state(position, 1.0)

    def solve(self, position: Floats) -> Capacitance:
        """The field under the pad at `position` (P, 2), of smooth faces."""
        found = self._remembered(self.bare(position))[0]
        assert found is not None
        return found

    def _remembered(self, pad: PadState) -> tuple[Capacitance | None, Floats]:
        """Field and forces (P, 2) at 1 V, anew where they are not among the last `KEPT`."""
        key = pad.position.tobytes()
        if self.roughness is not None and pad.pressing is not None:
            key += pad.pressing.tobytes()
        found = self.solved.get(key)
        if found is None:
            self.solved[key] = found = self._above(pad, self.visible(pad.position))
            while len(self.solved) > KEPT:
                self.solved.popitem(last=False)
        return found

    def _above(self, pad: PadState, lines: Any, near: Near | None = None) -> tuple[Any, Floats]:
        """Field and forces (P, 2) at 1 V with columns at these lines (L, P)."""
        x, levels = self.outline(pad, lines)
        slope = surface_state(self.surface, lines @ pad.position).slope[:, 0]
        field, forces = self._solved(x, levels, slope, near or (None,) * len(self._stacks))
        return field, np.asarray(lines.T @ forces)

    def full_stiffness(self, pad: PadState) -> Entries:
        """Derivative of `forces` by positions (2 P, 2 P); touching nodes move along the surface."""
        position, voltage, frame = pad.position, pad.voltage, pad.frame
        lines, nodes = self.visible(position), in_line(self._plane, self.edges)
        closed = frame.gap <= TOUCHING
        stacks, electrodes = self._stacks, self._electrodes
        outline = self.outline(pad, lines)
        near = tuple(one.potentials(*outline, electrodes, self.floating) for one in stacks)
        start = self._above(pad, lines, near)[1]
        directions = np.zeros((2, self._size, 2))
        directions[0, :, 0] = 1.0
        directions[0, closed, 1], directions[1, ~closed, 1] = frame.slope[closed, 0], 1.0
        blocks = []
        for axis, first in product(range(2), range(min(APART, nodes.size))):
            moved = nodes[first::APART]
            shifted = position.copy()
            shifted[moved] += MOVED * directions[axis, moved]
            forces = self._above(replace(pad, position=shifted), lines, near)[1]
            rate = voltage**2 / MOVED * (forces - start)[nodes]
            nearest = np.clip(np.rint((np.arange(nodes.size) - first) / APART), 0, moved.size - 1)
            column = 2 * moved[nearest.astype(int)] + axis
            blocks += [(2 * nodes + k, column, rate[:, k]) for k in range(2)]
        outer = self.flanks.stiffness(replace(pad, touching=np.ones(self._size, dtype=bool)))
        fraction = voltage_fraction(self._electrodes, position[:, 0])[outer.row // 2] ** 2
        return Entries.of(outer.size, [*blocks, (outer.row, outer.column, fraction * outer.value)])

    def _solved(self, x: Floats, levels: Floats, slope: Floats, near: Near) -> tuple[Any, Floats]:
        """Field of an outline and forces (L, 2) on the lines at 1 V, above a surface of that slope (L,)."""
        found = self._columns.solve(x, levels, self._electrodes, self.floating, near[0])
        along = found.by_x + slope * (found.by_level[0] + found.by_level[1])
        return found, 0.5 * np.stack([along, found.by_level[2:].sum(axis=0)], axis=1)

    @property
    def _electrodes(self) -> Floats | None:
        """Electrodes that end, (K, 3), or None for one without end."""
        electrodes = getattr(self.surface, "electrodes", None)
        return None if electrodes is None else np.asarray(electrodes, dtype=float)

    @property
    def _columns(self) -> Columns:
        return self._stacks[0]

    @cached_property
    def _stacks(self) -> tuple[Columns, ...]:
        """Layers, one stack for each field that is solved."""
        gap = getattr(self.law, "gap_eps_r", 1.0)
        return (self.columns_of(self.insulator_eps_r, gap, self.skin.eps_r),)

    @property
    def insulator_eps_r(self) -> float:
        """Relative permittivity of the insulator."""
        return float(self.surface.insulator.eps_r)

    def columns_of(self, insulator: complex, gap: complex, skin: complex) -> Columns:
        """Columns of layers with these relative permittivities; no skin's layer where it has no thickness."""
        if np.max(self.skin.thickness) > 0.0:
            return Columns((insulator, gap, skin), (INSULATOR, AIR, SKIN))
        return Columns((insulator, gap), (INSULATOR, AIR))

    def visible(self, position: Floats) -> Any:
        """The lines (sparse, L x P) at which columns stand: those visible from the display."""
        kept = in_sight(self._lines @ position)
        return self._lines if kept.size == self._lines.shape[0] else self._lines[kept]

    def outline(self, pad: PadState, lines: Any) -> tuple[Floats, Floats]:
        """x (L,) of columns at `lines` (L, P), heights (n + 1, L) of electrode, insulator, skin, tissue."""
        position = lines @ pad.position
        frame = surface_state(self.surface, position)
        insulator = self.surface.insulator
        rough = self._separation(pad) * np.ones(self._size)
        lowest = SERIES_GAP * insulator.thickness / self.insulator_eps_r
        gap = np.maximum(np.maximum(frame.gap, 0.0) + np.maximum(lines @ rough, 0.0), lowest)
        ground = position[:, 1] - frame.gap
        levels = [ground - insulator.thickness, ground, ground + gap]
        if len(self._columns.eps_r) == 3:
            levels.append(ground + gap + lines @ self.skin.thickness)
        return position[:, 0], np.stack(levels)

    def bounds(self, x: Floats, levels: Floats) -> Bounds:
        """The bounds of C between these curves."""
        skin = (levels[3] - levels[2]) / self.skin.eps_r if len(levels) > 3 else np.zeros_like(x)
        return certificate(x, levels[1:3], self.surface.insulator, skin, self._columns.eps_r[1].real)

    def check(self, position: Floats) -> None:
        """Raise Unresolved if the capacitance at `position` (P, 2) is not between its bounds."""
        if self._electrodes is not None or self.floating:
            return  # the bounds are those of a grounded pad over one electrode
        bounds = self.bounds(*self.outline(self.bare(position), self.visible(position)))
        value = self.solve(position).value
        if not bounds.lower * (1.0 - MARGIN) <= value <= bounds.upper * (1.0 + MARGIN):
            raise Unresolved(
                f"the field's capacitance, {value:.6g} N/V^2, is not between its bounds "
                f"{bounds.lower:.6g} and {bounds.upper:.6g}; a finer mesh of the finger resolves it"
            )

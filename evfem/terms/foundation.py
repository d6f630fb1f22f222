r"""Elastic foundation below the pad: surface displacement w = -C F for nodal forces F on the finger, with the
compliance C of a layer (Green's function, `evfem.surface.elastic`).

Contact conditions, slips, friction and attraction are functions of the relative positions :math:`r = x + u +
C F`, which replace those above a rigid surface. The energy :math:`F \cdot C F / 2` depends on the positions
of the nodes too: so contact and attraction act along the normal of the deformed surface, whose tangent is
:math:`(1 + u_x', h' - w')`, with :math:`(-u_x', w')_i = \sum_j \partial_{x_i} C_{ij} F_j`; in space along x
and along z.

Valid for small surface strain. The tributary length of a node may change within a step, which moves the
surface by less than the strain of the finger over the number of its nodes; its reaction is neglected.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, block
from evfem.common.rooms import Column, Foundation, Room
from evfem.contact.below import RIGID_BELOW, Level, RigidBelow, Tilt
from evfem.contact.condensed import COMPONENTS
from evfem.surface.pad import Pad, SurfaceState, surface_state
from evfem.surface.skin import Skin
from evfem.surface.spread import Distribution, Facets, strips_below

#: height of the loaded zone in node distances: nodes above it have no foundation; in space with an attraction
#: too
NEAR, NEAR_IN_SPACE = 10.0, 4.0
#: step (mm) of the difference for a compliance without `compliance_slope`
STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Yielding:
    """An elastic surface below k of P pad nodes, those in the loaded zone, `over` (k,), at one configuration:
    the `compliance` (dim m, dim m) of its m strips, from forces on them to their contribution to the relative
    positions, and its derivatives `slope` (d, dim m, dim m) by the positions of the displaced strips along
    x[, z]; the `distribution` of forces on nodes to strips; what is `left` of both from before the step.
    """

    over: Ints
    compliance: Floats
    slope: Floats
    distribution: Distribution
    left: tuple[Any, Any] = (0.0, 0.0)

    def given(self, force: Floats) -> Floats:
        """Contribution C F to the relative positions (P, dim) by forces on the finger (P, dim)."""
        found = np.zeros_like(force) + self.left[0]
        found[self.over] += self.distribution.moved(self.compliance, force[self.over])
        return found

    def change(self, force: Floats) -> Floats:
        """Its derivatives (P, d, dim) along x[, z]: stretch and slope of the displaced surface."""
        found = np.zeros((len(force), len(self.slope), force.shape[1])) + self.left[1]
        for axis, slope in enumerate(self.slope):
            found[self.over, axis] += self.distribution.moved(slope, force[self.over])
        return found

    def among(self, nodes: Ints) -> Floats:
        """Compliance (dim c, dim c) of these nodes, 0 of those outside the loaded zone."""
        return self.picked(self.compliance, nodes)

    def picked(self, matrix: Floats, nodes: Ints) -> Floats:
        """The same of a matrix (dim m, dim m)."""
        dim = len(self.slope) + 1
        (_, own, there) = np.intersect1d(nodes, self.over, assume_unique=True, return_indices=True)
        found = np.zeros((dim * nodes.size, dim * nodes.size))
        rows = (dim * own[:, None] + np.arange(dim)).ravel()
        found[np.ix_(rows, rows)] = self.distribution.among(matrix, there, dim)
        return found


@dataclass(frozen=True, eq=False)
class BelowCandidates(RigidBelow):
    """An elastic surface below the candidates: its `compliance` (dim c, dim c), in the order of the body's,
    and its increment without contact forces towards its displacement under the present attraction, `pulled`
    (dim c,) in mm.
    """

    compliance: Floats
    pulled: Floats

    def relative(self, compliance: Floats) -> Floats:
        return compliance + self.compliance

    def among(self, among: Floats, rows: Ints) -> Floats:
        return among + block(self.compliance, rows, rows)

    def unloaded(self, free: Floats) -> Floats:
        return free + np.pad(self.pulled[:, None], ((0, 0), (0, free.shape[1] - 1)))

    def displacement(self, motion: Floats, whole: Floats) -> tuple[Floats, Any]:
        body = motion - self.pulled - self.compliance @ whole
        return body, self.moved(motion) - body


@dataclass(frozen=True, eq=False)
class TiltingBelow(BelowCandidates):
    """The same in the plane, with the derivatives S of the compliance by x, `slope` (2 c, 2 c), the present
    `force` of contact and attraction and the `attraction` alone (2 c,), and what the slopes lack of those
    under it, `lacking` (c,).
    """

    slope: Floats
    force: Floats
    attraction: Floats
    lacking: Floats
    tilts = True

    def tilt(self, nodes: Ints, rows: Ints, turned: Floats) -> Level:
        S, one = block(self.slope, rows, rows), np.eye(rows.size)
        by_slope = turned[:, :, 0].copy()  # along y and x
        by_slope[:, 1] -= self.attraction[2 * nodes + 1]
        K = -(by_slope[:, :, None] * S[::2][:, None, :]).reshape(S.shape)
        misfit = -(by_slope * self.lacking[nodes, None]).ravel()
        L = block(self._by_loads, rows, rows)
        return Tilt(np.linalg.inv(one - K), np.linalg.inv(one - L), misfit)

    def moved(self, motion: Floats) -> Floats:
        L = self._by_loads
        loaded = np.flatnonzero(L.any(axis=0))
        own = np.linalg.solve(np.eye(loaded.size) - block(L, loaded, loaded), motion[loaded])
        return np.asarray(motion + L[:, loaded] @ own)

    @cached_property
    def _by_loads(self) -> Floats:
        """L (2 c, 2 c) of the head of `evfem.contact.below`."""
        found, F = np.zeros_like(self.slope), self.force
        found[:, ::2] = -(self.slope[:, ::2] * F[::2] + self.slope[:, 1::2] * F[1::2])
        return found


#: names in a state's memory: C F, the contribution of the surface to the relative positions of the pad's
#: nodes, (P, dim) in mm, and its derivatives along x[, z] (P, d, dim)
DISPLACEMENT, GRADIENT = "surface_displacement", "surface_gradient"
#: of a foundation that remembers: the forces of contact and attraction on the pad's nodes (P, dim)
FORCE = "surface_force"


class Exact(Room):
    """Faces that touch without giving way, with the methods of all faces."""

    def compliance(self, old: Any) -> Floats:
        """Compliance (P, dim) along normal and tangents in mm per N/mm in a step from `old`, in series with
        that of pad and foundation.
        """
        return np.zeros_like(old.contact_force)


class Penalties(Exact):
    """Faces on springs: `penalties` in N/mm3 along normal and tangent, on the tributary lengths (P,) that
    nodes have where a step begins, by `length`.
    """

    def __init__(self, penalties: tuple[float, float], length: Callable[[Any], Floats]) -> None:
        self.penalties, self._length, self._old = penalties, length, None

    def begin(self, old: Any, seconds: float) -> None:
        self._old = old

    def compliance(self, old: Any) -> Floats:
        return 1.0 / np.outer(self._length(old), self.penalties)

    def stored(self, state: Any) -> float:
        return self._energy(self._old, state)

    def potential(self, old: Any, new: Any, fractions: Floats) -> Floats:
        return np.asarray((self._energy(old, new) - self._energy(old, old)) * fractions**2)

    def _energy(self, old: Any, state: Any) -> float:
        return 0.5 * float(np.sum(self.compliance(old) * state.contact_force**2))


class Rigid(Room):
    """A rigid foundation, with the methods of all below a pad (P nodes, C candidates)."""

    reach, yields = 0.0, False

    def displacement(self, state: Any) -> Any:
        """Contribution of the surface displacement to the relative positions, C F, (P, dim) in mm."""
        return 0.0

    def sink(self, state: Any) -> Any:
        """Displacements into the surface below the pad's nodes (P,) in mm."""
        return np.zeros(len(state.contact_force))

    def places(self, position: Floats, state: Any) -> Floats:
        """Relative positions (P, dim) of nodes at `position`, as above a rigid surface."""
        return position

    def sloped(self, found: SurfaceState, state: Any) -> SurfaceState:
        """The undeformed surface `found` with the slopes of the deformed one in `state`."""
        return found

    def turned(self, state: Any, force: Floats) -> Floats:
        """Attraction (P, dim) along the normal of the deformed surface of `state`."""
        return force

    def turned_back(self, state: Any, force: Floats) -> Floats:
        """The same attraction as above the undeformed surface, whose work is that of the field."""
        return force

    def evened(self, pressure: Floats, traction: Floats, slips: Any) -> Floats:
        """A traction (P,) of nodes under a pressure (P,), whether each `slips` (P,): without what facets of
        the outline make alternate.
        """
        return traction

    def missed(self, position: Floats, state: Any, force: Floats) -> float:
        """Relative residual of the surface displacement under the forces on the nodes (P, dim)."""
        return 0.0

    def of(self, position: Floats, state: Any, c: Ints) -> RigidBelow:
        """The surface below the candidates c (C,) of a linear step."""
        return RIGID_BELOW

    def sunk(
        self, position: Floats, state: Any, force: Callable[[], Floats], update: tuple[Ints, Any, float]
    ) -> dict[str, Floats]:
        """Memory of the next iterate: the surface displacement under `force` (P, dim), below the candidates
        of an `update` (C,) the applied fraction of that of the linear step.
        """
        return {}

    def relative_displacement(self, ends: tuple[Any, Any], moved: Floats) -> Floats:
        """Displacements relative to the surface of nodes that `moved` (P, dim)."""
        return moved

    def stretched(self, ends: tuple[Any, Any], displacement: Floats, length: Floats) -> Floats:
        """Slips (P,) along the stretched surface, for displacements (P, d) along it."""
        return length


class Memoryless(Foundation):
    """An elastic surface without memory: its displacement is that of the present forces."""


class ElasticFoundation(Rigid):
    """Elastic foundation: an elastic surface, `elastic`, below a `pad` whose nodes are at `rest` (P, dim) and
    `spacing` mm apart; `least` is the smallest tributary length (mm), in space area, of a node; `surface` the
    undeformed one. Nodes without force high above it are left out.
    """

    yields = True
    columns: tuple[Column, ...] = (
        Column("surface_sink", "mm", "largest displacement of an elastic surface into it"),
    )

    def __init__(self, surface: Any, pad: Pad | Skin, rest: Floats, spacing: float, least: float) -> None:
        self.rest = rest
        self.surface, self.elastic, self.pad, self.least = surface, surface.elastic, pad, least
        self.spacing, self.reach = spacing, NEAR * spacing
        self._last: tuple[bytes, Yielding] | None = None
        self._zone = np.zeros(len(rest), dtype=bool)
        own = deepcopy(self.elastic) if isinstance(self.elastic, Foundation) else None
        self.elastic, self._own = own or self.elastic, own or Memoryless()
        self._remembers = own is not None
        self.columns = (*ElasticFoundation.columns, *self._own.columns)
        self._left: tuple[Any, Any] = (0.0, 0.0)

    def begin(self, old: Any, seconds: float) -> None:
        self._own.begin(old, seconds)
        left = self._own.left
        self._left = left * old.memory[DISPLACEMENT], left * old.memory[GRADIENT]
        self._last = None
        self._zone[:] = False

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        if not self._remembers:
            return {}
        own = {FORCE: self.pushing(new)}
        return own | self._own.accept(old, new.remembering(own))

    def pushing(self, state: Any) -> Floats:
        """Forces of contact and attraction on the pad's nodes (P, dim)."""
        position = self.places(self.rest + state.u[self.pad.nodes], state)
        found = self.sloped(surface_state(self.surface, position), state)
        return in_laboratory(state.contact_force, found) + np.asarray(state.attraction)

    def stored(self, state: Any) -> float:
        own = self._own
        return own.energy(state, self.pushing(state), self.displacement(state)) + own.stored(state)

    def potential(self, old: Any, new: Any, fractions: Floats) -> Floats:
        (before, after), (w, v) = map(self.pushing, (old, new)), map(self.displacement, (old, new))
        begin, end = self._own.energy(old, before, w), self._own.energy(new, after, v)
        between = 0.5 * float(np.sum(before * v) + np.sum(after * w))
        left = 1.0 - fractions
        return np.asarray((left**2 - 1.0) * begin + left * fractions * between + fractions**2 * end)

    def kinetic(self, state: Any) -> float:
        return self._own.kinetic(state)

    def work(self, old: Any, new: Any) -> float:
        return self._own.work(old, new)

    def dissipation(self, old: Any, new: Any, seconds: float) -> float:
        return self._own.dissipation(old, new, seconds)

    def takes_time(self, seconds: float) -> bool:
        return self._own.takes_time(seconds)

    def values(self, model: Any, state: Any) -> dict[str, float]:
        own = {"surface_sink": max(0.0, float(self.sink(state).max(initial=0.0)))}
        return own | dict(self._own.values(model, state))

    def works(self, substep: Any) -> Mapping[str, float]:
        return self._own.works(substep)

    def memory(self, state: Any) -> dict[str, Floats]:
        nodes, dim = state.contact_force.shape
        own = {DISPLACEMENT: np.zeros((nodes, dim)), GRADIENT: np.zeros((nodes, dim - 1, dim))}
        if self._remembers:
            own[FORCE] = np.zeros((nodes, dim))
        return own | self._own.memory(state)

    def displacement(self, state: Any) -> Floats:
        return np.asarray(state.memory[DISPLACEMENT])

    def sink(self, state: Any) -> Floats:
        return self.displacement(state)[:, 1]

    def places(self, position: Floats, state: Any) -> Floats:
        return np.asarray(position + self.displacement(state))

    def sloped(self, found: SurfaceState, state: Any) -> SurfaceState:
        slope = np.linalg.solve(_kept(state), (found.slope - state.memory[GRADIENT][:, :, 1])[:, :, None])
        return replace(found, slope=np.asarray(slope[:, :, 0]))

    def turned(self, state: Any, force: Floats) -> Floats:
        found, pushed = force.copy(), force[:, ::2] + state.memory[GRADIENT][:, :, 1] * force[:, 1:2]
        found[:, ::2] = np.linalg.solve(_kept(state), pushed[:, :, None])[:, :, 0]
        return found

    def turned_back(self, state: Any, force: Floats) -> Floats:
        found, along = force.copy(), np.einsum("pkj,pj->pk", _kept(state), force[:, ::2])
        found[:, ::2] = along - state.memory[GRADIENT][:, :, 1] * force[:, 1:2]
        return found

    @cached_property
    def _facets(self) -> Facets:
        return Facets(self.pad, self.rest)

    def evened(self, pressure: Floats, traction: Floats, slips: Any) -> Floats:
        flat = not self.surface.relief(self.rest[:, ::2])[2].any()
        return self._facets.evened(pressure, traction, slips) if flat else traction

    def under(self, position: Floats, state: Any) -> Yielding:
        """The surface below nodes at `position` (P, dim) in a state."""
        return self.below(self.places(position, state), surface_state(self.surface, position).gap)

    def missed(self, position: Floats, state: Any, force: Floats) -> float:
        below = self.under(position, state)
        missing = np.abs(below.given(force) - self.displacement(state)).max() / self.spacing
        return float(max(missing, np.abs(below.change(force) - state.memory[GRADIENT]).max()))

    def of(self, position: Floats, state: Any, c: Ints) -> RigidBelow:
        below = self.under(position, state)
        pulled = (below.given(state.attraction) - self.displacement(state))[c].ravel()
        compliance = below.among(c)
        if len(below.slope) > 1:
            return BelowCandidates(compliance, pulled)
        force, slope = self.pushing(state), below.picked(below.slope[0], c)
        lacking = (below.change(force) - state.memory[GRADIENT])[c, 0, 1]
        return TiltingBelow(compliance, pulled, slope, force[c].ravel(), state.attraction[c].ravel(), lacking)

    def sunk(
        self, position: Floats, state: Any, force: Callable[[], Floats], update: tuple[Ints, Any, float]
    ) -> dict[str, Floats]:
        below, (c, gives, fraction), pushing = self.under(position, state), update, force()
        displacement_below = below.given(pushing)
        displacement_below[c] = self.displacement(state)[c] + fraction * np.asarray(gives).reshape(c.size, -1)
        return {DISPLACEMENT: displacement_below, GRADIENT: below.change(pushing)}

    def relative_displacement(self, ends: tuple[Any, Any], moved: Floats) -> Floats:
        return np.asarray(moved + self.displacement(ends[1]) - self.displacement(ends[0]))

    def stretched(self, ends: tuple[Any, Any], displacement: Floats, length: Floats) -> Floats:
        along = displacement / np.maximum(np.linalg.norm(displacement, axis=1, keepdims=True), 1e-300)
        stretch = 0.5 * (ends[0].memory[GRADIENT] + ends[1].memory[GRADIENT])[:, :, ::2]
        return np.asarray(length * (1.0 - np.einsum("pk,pkj,pj->p", along, stretch, along)))

    def below(self, position: Floats, height: Floats) -> Yielding:
        """Surface compliance and its derivatives for the nodes at (P, dim) that face the undeformed surface,
        `height` (P,) below, within `reach`, or did in an iterate of this step: a node at the limit that comes
        and goes would keep the step from its end. The last result is cached by position.
        """
        key = position[:, ::2].tobytes() + height.tobytes()
        if self._last is None or self._last[0] != key:
            reach = self.reach if position.shape[1] == 2 else NEAR_IN_SPACE * self.spacing
            self._zone |= (self.pad.tributary(position) > 0.0) & (height <= reach)
            self._last = key, self._made(position)
        return self._last[1]

    def _made(self, position: Floats) -> Yielding:
        over = np.flatnonzero(self._zone)
        below = strips_below(self.pad, position, self.rest, over, self.least)
        x, size = below.places, below.sizes
        compliance = np.asarray(self.elastic.compliance(x, size))
        return Yielding(
            over, compliance, slopes(self.elastic, x, size), Distribution(below.distribution), self._left
        )


def in_laboratory(force: Floats, surface: SurfaceState) -> Floats:
    """Contact forces (P, dim), along normal and tangents of the `surface`, along x, y[, z]."""
    return np.asarray(np.einsum("pa,pak->pk", force, surface.axes)[:, COMPONENTS[: force.shape[1]]])


def foundation_of(interface: Any) -> Rigid:
    """The foundation of the pad of an `evfem.newton.interface.Interface`: elastic, or rigid."""
    if getattr(interface.surface, "elastic", None) is None:
        return Rigid()
    sampled = interface.points, interface.length, interface.least
    return ElasticFoundation(interface.surface, interface.pad, *sampled)


def _kept(state: Any) -> Floats:
    """Surface stretch along x[, z], deformed over undeformed lengths, (P, d, d)."""
    return np.asarray(np.eye(state.memory[GRADIENT].shape[1]) - state.memory[GRADIENT][:, :, ::2])


def slopes(elastic: Any, x: Floats, length: Floats) -> Floats:
    """`compliance_slope` of an elastic surface, differenced where it has none of its own."""
    own = getattr(elastic, "compliance_slope", None)
    if own is not None:
        return np.asarray(own(x, length))
    n, flat, found = len(x), x.reshape(len(x), -1), []
    dim = flat.shape[1] + 1
    for step in STEP * np.eye(dim - 1):
        positions = np.concatenate([flat + step, flat - step, flat]).reshape(-1, *x.shape[1:])
        compliances = np.asarray(elastic.compliance(positions, np.tile(length, 3))).reshape(
            dim, 3, n, dim, 3, n
        )
        found.append(
            (compliances[:, 0, :, :, 2] - compliances[:, 1, :, :, 2]).reshape(dim * n, dim * n) / (2.0 * STEP)
        )
    return np.stack(found)

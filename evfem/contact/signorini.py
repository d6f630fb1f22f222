r"""Unilateral contact with Coulomb friction on the dense compliance of the contact candidates: the problem,
its laws, and its equations where every node has a status.

A node has a normal n and d tangents, one in the plane and two in three dimensions; components are ordered per
node. With the contact forces :math:`\lambda` the new gaps and slips are :math:`v = (g, s) = v_0 + C\lambda +
e\,d`, where d are extra unknowns (the bone's travel under a prescribed force) with the equations
:math:`r\lambda + \rho\,d = b`. Signorini and Coulomb ask, per node, for exactly one of

======  ==============================  =====================================================
status  equations                       stays if
======  ==============================  =====================================================
OPEN    lam_n = 0, lam_t = 0            g >= 0
STICK   g = 0, s = 0                    lam_n >= 0 and abs(lam_t) <= mu lam_n
slip    g = 0, lam_t = mu lam_n e       lam_n >= 0, s along -e
======  ==============================  =====================================================

In the plane a slip is FORWARD, e = -1, or BACKWARD, e = +1. In three dimensions it is SLIP, along
e = z/abs(z), and the direction is an unknown of its own (`solve_statuses`). The same laws as projections:

.. math:: \lambda_n = \max(0, p), \quad \lambda_t = \mathrm{proj}_{\mu\lambda_n}(z), \qquad
          p = \lambda_n - r_n g, \quad z = \lambda_t - r_t s,

for any positive r; taken is the inverse of the node's own compliance, bounded by what is usual among the
nodes where it vanishes or is negative.

The attraction of an open node weakens with its gap, a negative stiffness k_e: its drop is one more unknown,
f = k_e (g - g_ref). A closed node needs none, as its gap is known. Between rough faces the attraction also
grows with what presses the node (`Roughness`): a closed node moves the body with (1 - kappa) lam_n, and one
that opens loses what its contact force gained.

A bound of friction that is no multiple of the contact force (`evfem.surface.friction`) is linear
here: mu lam_n + c, with `cohesion` c, takes the place of mu lam_n.

Sources: A. Klarbring, Comput. Methods Appl. Mech. Eng. 58 (1986) 175, doi:10.1016/0045-7825(86)90095-2 (the
frictional problem as complementarity); P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991)
353, doi:10.1016/0045-7825(91)90022-X (projections and their linearisation).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import DenseSolver, Floats, Ints
from evfem.common.constants import BLOCK, DISC_OWN, ROUNDING


@dataclass(frozen=True)
class Roughness:
    """Attraction between rough faces, along normal and tangent: stronger by `gain` (k, 1 + d) times what a
    contact force has beyond `present` (k,), weaker by `loss_on_opening` (k, 1 + d) N/mm where open.
    """

    gain: Floats
    loss_on_opening: Floats
    present: Floats

    def __getitem__(self, nodes: Ints) -> Roughness:
        """The same of these nodes alone."""
        return Roughness(self.gain[nodes], self.loss_on_opening[nodes], self.present[nodes])


@dataclass(frozen=True)
class AttractionStiffness:
    """Linearised attraction of every node: it decreases by `negative_stiffness` (k,) per unit of gap from its
    value at `reference_gap` (k,), is larger by `gain_on_closing` (k,) at g = 0, and depends on contact there.
    """

    negative_stiffness: Floats
    reference_gap: Floats
    gain_on_closing: Floats
    roughness: Roughness | None = None


#: of a node; `FORWARD` or `BACKWARD` in the plane where it slips, `SLIP` in three dimensions
OPEN, STICK, FORWARD, BACKWARD, SLIP = 0, 1, 2, 3, 2
NO_NODES: Ints = np.zeros(0, dtype=np.int64)


class ContactNotSolved(ArithmeticError):
    """The sub-problem cycles: no solution near, or several. `softest` (k,): statuses, cycling ones open."""

    def __init__(self, message: str, softest: Ints = NO_NODES) -> None:
        super().__init__(message)
        self.softest = softest


class Unstable(ContactNotSolved):
    """No solution because the stiffness of the body is not positive definite."""


@dataclass(frozen=True)
class ExtraUnknowns:
    """p extra unknowns d: what they do to gaps and slips, `columns` (m, p) with m = (1 + d) k, and the
    equations that settle them, `rows` (p, m) lam + `pivot` (p, p) d = `right` (p,). Those `conditioned`
    follow what the body does even where its stability is asked for, as a voltage that keeps a charge.
    """

    columns: Floats
    rows: Floats
    pivot: Floats
    right: Floats
    conditioned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def followed(self) -> tuple[Floats, Any]:
        """Factors (m, c), (c, m) of what the conditioned components take off the compliance."""
        some = self.conditioned
        return self.columns[:, some], np.linalg.solve(self.pivot[np.ix_(some, some)], self.rows[some])


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces and drops of the attraction (m,), and extra unknowns (p,)."""

    contact: Floats
    drop: Floats
    extra: Floats


@dataclass(frozen=True)
class ContactProblem:
    """Gaps and slips without contact forces (m,), m = (1 + d) k, and compliance (m, m), both per node
    (n, t[, t2]), friction coefficients (k,), optional extra_unknowns and attraction, the shear force that
    friction has without a pressing one, `cohesion` (k,) in N/mm (N in three dimensions), and how far the
    interface itself gives way to contact forces, not to attraction, `give` (m,) in mm per N/mm.
    `chords` (k,): coefficients that take the place of tangents and cohesion of a friction law. The laws hold
    to `tolerance`, relative to the largest force; `dense` solves.
    """

    start: Floats
    compliance: Floats
    friction: Floats
    extra_unknowns: ExtraUnknowns | None = None
    attraction: AttractionStiffness | None = None
    cohesion: Floats | None = None
    give: Floats | None = None
    chords: Floats | None = None
    tolerance: float = ROUNDING
    dense: DenseSolver = field(default_factory=DenseSolver)

    @property
    def by_chords(self) -> ContactProblem:
        """The problem with the chords of its friction laws in the place of their tangents."""
        assert self.chords is not None
        return replace(self, friction=self.chords, cohesion=None, chords=None)

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size

    @property
    def dim(self) -> int:
        """Components of a node, 1 + d."""
        return self.start.size // self.friction.size

    @cached_property
    def under_forces(self) -> Floats:
        """Compliance (m, m) of body and interface to contact forces."""
        return self.compliance if self.give is None else self.compliance + np.diag(self.give)

    @cached_property
    def gives_way(self) -> bool:
        """Whether the body gives way the more, the more it is loaded: the compliance is not positive."""
        try:
            return not np.linalg.cholesky(self.under_forces + self.under_forces.T).size
        except np.linalg.LinAlgError:
            return True

    @property
    def resists(self) -> Any:
        """Nodes with friction, (k,) bool."""
        rough = self.friction > 0.0
        return rough if self.cohesion is None else rough | (self.cohesion > 0.0)

    def limit(self, normal: Floats) -> Floats:
        """Largest shear force (k,) under pressing forces (k,)."""
        limit = self.friction * normal
        return limit if self.cohesion is None else limit + self.cohesion

    @cached_property
    def own(self) -> tuple[Floats, Floats]:
        """Size of each node's own compliance, normal and tangent, (k,), at least `DISC_OWN` of the mean."""
        i, C = self.dim * np.arange(self.size), self.under_forces
        shear = np.abs(C[i + 1, i + 1])
        if self.dim == 3:
            a, b, c = C[i + 1, i + 1], C[i + 2, i + 2], 0.5 * (C[i + 1, i + 2] + C[i + 2, i + 1])
            shear = 0.5 * np.abs(a + b) + np.hypot(0.5 * (a - b), c)
        normal, shear = (np.maximum(a, max(DISC_OWN * a.mean(), 1e-300)) for a in (np.abs(C[i, i]), shear))
        return normal, shear

    def state(self, forces: Forces) -> Floats:
        """Gaps and slips (m,) under these forces."""
        v = self.start + self.compliance @ (forces.contact + forces.drop)
        if self.give is not None:
            v = v + self.give * forces.contact
        return v if self.extra_unknowns is None else v + self.extra_unknowns.columns @ forces.extra


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (m,), drops of the attraction (m,), statuses (k,), the extra unknowns (p,), new gaps and
    slips (m,), the number of dense solves, and whether the negative stiffness had to be scaled down.
    """

    force: Floats
    attraction_drop: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int
    reduced: bool = False


@dataclass(frozen=True, eq=False)
class Projected:
    """Projections of forces, gaps and slips onto the laws: p and z of every node, (k,) and (k, d), its status
    (k,), and the residual of the laws (k,), relative to the largest force.
    """

    p: Floats
    z: Floats
    status: Ints
    miss: Floats

    @classmethod
    def of(cls, problem: ContactProblem, forces: Forces) -> Projected:
        """Of these forces."""
        state, (normal_own, shear_own) = problem.state(forces), problem.own
        force, v, drop = (each.reshape(problem.size, -1) for each in (forces.contact, state, forces.drop))
        # trial forces: those that would close gap and slip if each node had its own compliance alone
        p = force[:, 0] - v[:, 0] / normal_own
        z = force[:, 1:] - v[:, 1:] / shear_own[:, None]
        limit, size = np.where(p > 0.0, problem.limit(p), 0.0), sizes(z)
        slip = np.where(z[:, 0] < 0.0, FORWARD, BACKWARD) if problem.dim == 2 else SLIP
        status = np.where(p <= 0.0, OPEN, np.where((size <= limit) & problem.resists, STICK, slip))
        # radial return onto the disc of friction: sticking keeps z, slipping scales it to the limit
        part = np.where(status == STICK, 1.0, limit / np.maximum(size, np.maximum(limit, 1e-300)))
        wanted = np.column_stack([np.maximum(p, 0.0), z * np.where(status == OPEN, 0.0, part)[:, None]])
        held = 1e-3 * v[:, 0] / normal_own  # what would close the gap, where no node presses
        scale = max(1e-300, *(np.abs(one).max(initial=0.0) for one in (wanted, force, drop, held)))
        return cls(p, z, status, np.abs(wanted - force).max(axis=1) / scale)


def side(status: Ints) -> Floats:
    """Side (k, 1) along which friction acts in the plane, against the slip; 0 where nothing slips."""
    return np.subtract(status == BACKWARD, status == FORWARD, dtype=float)[:, None]


def sizes(vectors: Floats) -> Floats:
    """Lengths (k,) of vectors (k, d) in the plane of contact."""
    return np.asarray(np.hypot(vectors[:, 0], vectors[:, 1] if vectors.shape[1] > 1 else 0.0))


class _Equations:
    """Unknowns and equations of nodes that have these statuses (k,).

    Per node, (k, 1 + d), are known: the force of a closed one that presses with 1, `sheared`, the attraction
    that this adds, `gain`, and the `drop` and `shear` that no unknown changes. Unknown are, at `place` of the
    m components, first the pressing forces of the `closed` nodes, which the body feels as `felt` (c, 1 + d),
    the shear forces of those that stick, and the drops of the `attracted` open ones; then the shear forces
    of the `turned` nodes (t,) along `aside` (t, 2), of which the fraction `kept` (t,) stays, the slip across
    counting `turns` (t,). All components that act with them are `whole` (w,), at `index` (m,) of these.
    """

    def __init__(
        self, problem: ContactProblem, status: Ints, along: Floats, turning: Floats | None = None
    ) -> None:
        n, opened, resists = problem.dim, (status == OPEN)[:, None], problem.resists
        along = np.where((status >= SLIP)[:, None], along, 0.0)
        self.sheared = np.hstack([np.ones(opened.shape), problem.friction[:, None] * along])
        self.gain, self.drop, self.shear = np.zeros((3, *self.sheared.shape))
        if problem.cohesion is not None:
            self.shear[:, 1:] = problem.cohesion[:, None] * along
        attracted = np.zeros(0, dtype=np.int64)
        if (attraction := problem.attraction) is not None:
            attracted = np.flatnonzero(opened[:, 0] & (attraction.negative_stiffness > 0.0))
            self.drop[:, 0] = np.where(opened[:, 0], 0.0, -attraction.gain_on_closing)
            if (rough := attraction.roughness) is not None:
                self.gain = rough.gain
                self.drop += np.where(opened, rough.loss_on_opening, rough.gain * rough.present[:, None])
        turned = np.flatnonzero((status == SLIP) & resists & (turning is not None))
        m = np.ones(status.size) if turning is None else turning
        self.attracted, self.turned, self.closed = attracted, turned, np.flatnonzero(status != OPEN)
        self.aside = along[turned, ::-1] * np.array([-1.0, 1.0]) if turned.size else np.zeros((0, n - 1))
        self.kept, self.turns = 1.0 - m[turned], m[turned] / problem.own[1][turned]
        self._find(n, status)

    def _find(self, n: int, status: Ints) -> None:
        """Where among the m components the unknowns are, and what acts with them."""
        closed, tangents = self.closed, np.arange(1, n)
        self.felt = (self.sheared - self.gain)[closed]
        sheared = closed[(status[closed] != STICK) & self.felt[:, 1:].any(axis=1)]
        beside = np.append(self.turned, np.setdiff1d(sheared, self.turned)) if self.turned.size else sheared
        held = (n * np.flatnonzero(status == STICK)[:, None] + tangents).ravel()
        self.place = np.concatenate([n * closed, held, n * self.attracted])
        self.whole = np.append(self.place, (tangents[:, None] + n * beside).ravel())
        self.index = np.zeros(n * status.size, dtype=np.int64)
        self.index[self.whole] = np.arange(self.whole.size)

    def matrix(self, compliance: Floats) -> Floats:
        """The equations (u, u) but for their diagonal, made of blocks of rows that the cache holds."""
        columns = np.empty((self.whole.size, self.place.size + self.turned.size))
        for begin in range(0, self.whole.size, BLOCK):
            rows = compliance.take(self.whole[begin : begin + BLOCK], axis=0)
            columns[begin : begin + BLOCK] = self.columns(rows.take(self.whole, axis=1))
        return self.rows(columns)

    def columns(self, C: Floats) -> Floats:
        """Effect of the unknowns (q, u) from that of the `whole` (q, w), which is overwritten."""
        n, first = self.felt.shape[1], C[:, : self.closed.size]
        if (self.felt[:, 0] != 1.0).any():
            first *= self.felt[:, 0]
        for a in range(1, n):
            if (some := np.flatnonzero(self.felt[:, a])).size:
                first[:, some] += C[:, self.index[n * self.closed[some] + a]] * self.felt[some, a]
        return self._across(C.T, self.aside).T

    def rows(self, v: Floats) -> Floats:
        """The equations' part (u, q) of gaps and slips of the `whole` (w, q), which are overwritten."""
        return self._across(v, self.turns[:, None] * self.aside)

    def _across(self, v: Floats, weight: Floats) -> Floats:
        """v (w, q) with the tangential components of turned nodes as one, by a `weight` (t, 2) of each."""
        size, end = self.place.size, self.place.size + self.turned.size
        if self.turned.size:
            v[size:end] *= weight[:, :1]
            v[size:end] += v[self.index[self.felt.shape[1] * self.turned + 2]] * weight[:, 1:]
        return v[:end]


def solve_statuses(
    problem: ContactProblem, status: Ints, along: Floats, turning: Floats | None = None
) -> Forces:
    r"""Forces of nodes that have these statuses (k,), slipping ones with a shear force `along` e (k, d): one
    dense linear system; raises `numpy.linalg.LinAlgError` where that is singular.

    In three dimensions the direction of a slip turns by a shear force lam_e along e_perp,

    .. math:: (1 - m)\,\lambda_e + m\,r_t\,(e_\perp \cdot s) = 0, \qquad m = \min(1, \mu p/|z|),

    with m given as `turning` (k,); at the solution r drops out.
    """
    extra, system = problem.extra_unknowns, _Equations(problem, status, along, turning)
    place, closed, attracted, whole = system.place, system.closed, system.attracted, system.whole
    steady = (system.drop + system.shear).ravel()
    start = problem.start + problem.compliance @ steady if steady.any() else problem.start
    right = -system.rows(start[whole, None])
    matrix = system.matrix(problem.compliance)
    pressed, own = np.split(np.arange(place.size), [place.size - attracted.size])
    last = np.arange(place.size, len(right))
    matrix[last, last] += system.kept
    if problem.give is not None:
        matrix[pressed, pressed] += problem.give[place[pressed]]
    if attracted.size:
        pull: Any = problem.attraction
        matrix[own, own] -= 1.0 / pull.negative_stiffness[attracted]
        right[own, 0] += pull.reference_gap[attracted]
    names = whole.tobytes(), last.size
    if extra is None:
        x, d = problem.dense.solve(matrix, right, names)[:, 0], np.zeros(0)
    else:
        balance, rest = system.columns(extra.rows[:, whole]), extra.right - extra.rows @ steady
        right = np.hstack([right, system.rows(extra.columns[whole])])
        both = problem.dense.solve(matrix, right, names)
        d = np.linalg.solve(extra.pivot - balance @ both[:, 1:], rest - balance @ both[:, 0])
        x = both[:, 0] - both[:, 1:] @ d
    pressing = np.zeros((problem.size, 1))
    pressing[closed, 0] = x[: closed.size]
    force, drop = system.shear + pressing * system.sheared, system.drop - pressing * system.gain
    force.ravel()[place[closed.size : pressed.size]] = x[closed.size : pressed.size]
    force[system.turned, 1:] += x[last, None] * system.aside
    drop[attracted, 0] += x[own]
    return Forces(force.ravel(), drop.ravel(), d)


def linearised(problem: ContactProblem, found: Projected) -> Forces:
    """The forces that solve the equations linearised where the laws were projected."""
    if problem.dim == 2:
        return solve_statuses(problem, found.status, side(found.status))
    size = np.maximum(sizes(found.z), 1e-200)
    limit = np.where(found.status == SLIP, np.maximum(problem.limit(found.p), 0.0), 0.0)
    return solve_statuses(problem, found.status, found.z / size[:, None], np.minimum(1.0, limit / size))

r"""Unilateral contact with Coulomb friction in three dimensions, solved exactly on the dense
compliance of the contact candidates. The twin of `evfem.contact.signorini`, for shear forces that
lie in a disc.

A node has a normal n and two tangents; components are ordered per node (n, t1, t2). With the
contact forces :math:`\lambda` the new gaps and slips are :math:`v = (g, s) = v_0 + W\lambda + e\,d`,
where d are optional extra unknowns (the bone's travel under a prescribed force, for example) with
the equations :math:`r\lambda + \rho\,d = b`. Signorini and Coulomb's disc ask, per node, for

.. math:: \lambda_n = \max(0, p), \quad \lambda_t = \mathrm{proj}_{\mu\lambda_n}(z), \qquad
          p = \lambda_n - r_n g, \quad z = \lambda_t - r_t s,

the same for all positive r; taken is the inverse of the node's own compliance. A node is open if
:math:`p \le 0`, sticks if :math:`|z| \le \mu p` and slips along :math:`d = z/|z|` else, e being
normal to d in the plane of contact. Linearised, exactly:

========  ========================================================================
status    equations
========  ========================================================================
OPEN      lam = 0
STICK     g = 0, s = 0
SLIP      g = 0, lam_t = mu lam_n d + lam_e e,
          (1 - m) lam_e + m r_t (e . s) = 0  with  m = min(1, mu p / abs(z))
========  ========================================================================

The last equation turns the direction of slip; at the solution r drops out. These are three
unknowns for a sticking node, two for a slipping one, one without friction. The attraction of an
open node weakens with its gap; its drop is one more unknown, as in `evfem.contact.signorini`.

Algorithm (`solve_disc`)::

    repeat
        sweeps: block Gauss-Seidel, each node projected with its own compliance; twice as many each time, none
            at first if the forces at hand are those of the last iteration
        Newton's method for the equations above, every extra unknown as one more row
        done where forces, gaps and slips obey the laws to rounding

Newton's method alone may cycle between statuses, sweeps alone take 500 to 1,500. Without a
sweep in which d changes, a prescribed force is met by Newton's method alone.

Sources: P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353,
doi:10.1016/0045-7825(91)90022-X (projections and their linearisation); M. Jean, Comput. Methods
Appl. Mech. Eng. 177 (1999) 235, doi:10.1016/S0045-7825(98)00383-1 (block Gauss-Seidel).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import DISC_FALL, DISC_NEWTON, DISC_ROUNDING, DISC_ROUNDS, DISC_SWEEPS, STABLE
from evfem.contact.signorini import OPEN, STICK, AttractionStiffness, ContactNotSolved, ExtraUnknowns

#: status of a node that slips in any direction
SLIP = 2


@dataclass(frozen=True)
class DiscProblem:
    """Gaps and slips without contact forces (3 k,), compliance (3 k, 3 k), both per node (n, t1,
    t2), friction coefficients (k,), and optional extra unknowns and attraction as in
    `evfem.contact.signorini`.
    """

    start: Floats
    compliance: Floats
    friction: Floats
    extra_unknowns: ExtraUnknowns | None = None
    attraction: AttractionStiffness | None = None

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size

    @property
    def own(self) -> tuple[Floats, Floats]:
        """Each node's own compliance along the normal and, the larger one, along the tangents,
        (k,).
        """
        i = 3 * np.arange(self.size)
        C = self.compliance
        a, b = C[i + 1, i + 1], C[i + 2, i + 2]
        c = 0.5 * (C[i + 1, i + 2] + C[i + 2, i + 1])
        return C[i, i], 0.5 * (a + b) + np.hypot(0.5 * (a - b), c)

    def state(self, forces: Forces) -> Floats:
        """Gaps and slips (3 k,) under these forces."""
        v = self.start + self.compliance @ (forces.contact + forces.drop)
        return v if self.extra_unknowns is None else v + self.extra_unknowns.columns @ forces.extra


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces and drops of the attraction (3 k,), and extra unknowns (p,)."""

    contact: Floats
    drop: Floats
    extra: Floats


@dataclass(frozen=True)
class DiscSolution:
    """Contact forces and drops of the attraction (3 k,), statuses (k,), the extra unknowns (p,),
    new gaps and slips (3 k,), the number of dense solves, and whether the negative stiffness had
    to be scaled down.
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
    """What the laws make of forces, gaps and slips: p and z of every node, (k,) and (k, 2), its
    status (k,), and by how much a force misses them, relative to the largest one.
    """

    p: Floats
    z: Floats
    status: Ints
    miss: float


def projected(problem: DiscProblem, forces: Forces, state: Floats) -> Projected:
    """Forces, gaps and slips against the laws of Signorini and Coulomb."""
    normal_own, shear_own = problem.own
    force, v = forces.contact.reshape(-1, 3), state.reshape(-1, 3)
    p = force[:, 0] - v[:, 0] / normal_own
    z = force[:, 1:] - v[:, 1:] / shear_own[:, None]
    limit, size = problem.friction * np.maximum(p, 0.0), np.hypot(*z.T)
    status = np.where(p <= 0.0, OPEN, np.where((size <= limit) & (problem.friction > 0.0), STICK, SLIP))
    shear = z * np.where(status == STICK, 1.0, limit / np.maximum(size, 1e-300))[:, None]
    shear[status == OPEN] = 0.0
    wanted = np.column_stack([np.maximum(p, 0.0), shear])
    drop = _drop(problem, status, v[:, 0]) - forces.drop[::3]
    scale = max(np.abs(wanted).max(initial=0.0), np.abs(force).max(initial=0.0), 1e-300)
    miss = max(np.abs(wanted - force).max(initial=0.0), np.abs(drop).max(initial=0.0))
    if problem.extra_unknowns is not None:
        miss = max(miss, np.abs(_lacking(problem.extra_unknowns, forces)).max(initial=0.0))
    return Projected(p, z, status, float(miss / scale))


def _drop(problem: DiscProblem, status: Ints, gap: Floats) -> Floats:
    """Drop of the attraction (k,) of nodes of these statuses at these gaps."""
    if problem.attraction is None:
        return np.zeros(problem.size)
    known = problem.attraction
    weaker = known.negative_stiffness * (gap - known.reference_gap)
    return np.where(status == OPEN, weaker, -known.gain_on_closing)


def _lacking(extra: ExtraUnknowns, forces: Forces) -> Floats:
    return extra.right - extra.rows @ (forces.contact + forces.drop) - extra.pivot @ forces.extra


def solve_disc(problem: DiscProblem, force: Floats) -> DiscSolution:
    """Signorini and Coulomb's disc on the candidates, started from contact forces (3 k,).

    Raises `ContactNotSolved` when Newton's method does not end after any round of sweeps.
    """
    count = 0 if problem.extra_unknowns is None else problem.extra_unknowns.right.size
    forces = Forces(force.copy(), np.zeros_like(force), np.zeros(count))
    solves = 0
    for attempt in range(DISC_ROUNDS):
        if attempt or not force.any():
            forces = sweeps(problem, forces, DISC_SWEEPS << attempt)
        forces, after, tries = _newton(problem, forces, damped=attempt > 0)
        solves += tries
        if after.miss <= DISC_ROUNDING:
            return _solution(problem, forces, after, solves)
    raise ContactNotSolved(f"forces miss the laws by {after.miss:.1e}")


def _solution(problem: DiscProblem, forces: Forces, found: Projected, solves: int) -> DiscSolution:
    return DiscSolution(
        forces.contact, forces.drop, found.status, forces.extra, problem.state(forces), solves
    )


def sweeps(problem: DiscProblem, forces: Forces, count: int) -> Forces:
    """Forces after so many sweeps of block Gauss-Seidel; the extra unknowns stay."""
    start = problem.start
    if problem.extra_unknowns is not None:
        start = start + problem.extra_unknowns.columns @ forces.extra
    nodes = [_Node.of(problem, i, start) for i in range(problem.size)]
    contact, drop = forces.contact.copy(), forces.drop.copy()
    total = contact + drop
    for _ in range(count):
        for node in nodes:
            own = node.place
            now = contact[own].tolist()
            new, fallen = node.solve((node.rows @ total).tolist(), now, float(drop[own.start]))
            contact[own], drop[own.start] = new, fallen
            total[own] = new
            total[own.start] += fallen
    return Forces(contact, drop, forces.extra)


@dataclass(frozen=True, eq=False)
class _Node:
    """One node of the sweeps: where its components are, its rows of the compliance, gap and slips
    without forces, and its own compliance.
    """

    place: slice
    rows: Floats
    start: list[float]
    own: list[list[float]]
    shear: float
    friction: float
    weakening: float
    reference: float
    gain: float

    @classmethod
    def of(cls, problem: DiscProblem, i: int, start: Floats) -> _Node:
        place, known = slice(3 * i, 3 * i + 3), problem.attraction
        rows = problem.compliance[place]
        own = rows[:, place]
        shear = float(np.linalg.eigvalsh(0.5 * (own[1:, 1:] + own[1:, 1:].T))[-1])
        pull = [0.0, 0.0, 0.0]
        if known is not None:
            pull = [float(a[i]) for a in (known.negative_stiffness, known.reference_gap, known.gain_on_closing)]
        friction = float(problem.friction[i])
        return cls(place, rows, start[place].tolist(), own.tolist(), shear, friction, *pull)

    def solve(self, moved: list[float], force: list[float], drop: float) -> tuple[list[float], float]:
        """New contact force and drop from the motion by all forces, those of this node included."""
        own, (n, t1, t2) = self.own, force
        held = n + drop
        g, s1, s2 = (
            self.start[a] + moved[a] - own[a][0] * held - own[a][1] * t1 - own[a][2] * t2 for a in range(3)
        )
        # open, the attraction weakened
        weaker = 1.0 - own[0][0] * self.weakening
        gap = g if weaker <= 1.0 - STABLE else (g - own[0][0] * self.weakening * self.reference) / weaker
        if gap >= 0.0:
            return [0.0, 0.0, 0.0], self.weakening * (gap - self.reference)
        n = max(0.0, n)
        for _ in range(3):
            n = max(0.0, self.gain - (g + own[0][1] * t1 + own[0][2] * t2) / own[0][0])
            pressed = n - self.gain
            z1 = t1 - (s1 + own[1][0] * pressed + own[1][1] * t1 + own[1][2] * t2) / self.shear
            z2 = t2 - (s2 + own[2][0] * pressed + own[2][1] * t1 + own[2][2] * t2) / self.shear
            size, limit = (z1 * z1 + z2 * z2) ** 0.5, self.friction * n
            part = 1.0 if size <= limit else limit / size
            t1, t2 = part * z1, part * z2
        return [n, t1, t2], -self.gain


def _newton(problem: DiscProblem, forces: Forces, damped: bool) -> tuple[Forces, Projected, int]:
    """Forces after Newton's iterations, what the laws make of them, and the number of solves; the
    best ones where it does not end. `damped` steps are the best of 1, 1/2, 1/4 ... of a whole one.
    """
    found = projected(problem, forces, problem.state(forces))
    best = forces, found
    for tries in range(1, DISC_NEWTON * (2 if damped else 1) + 1):
        try:
            new = _linearised(problem, found)
        except np.linalg.LinAlgError:
            return *best, tries
        after = projected(problem, new, problem.state(new))
        if damped and not after.miss < DISC_FALL * found.miss:
            new, after = min((_part(problem, forces, new, 0.5**n) for n in range(5)), key=lambda one: one[1].miss)
        forces, found = new, after
        if not np.isfinite(found.miss):
            return *best, tries
        if found.miss < best[1].miss:
            best = forces, found
        if found.miss <= DISC_ROUNDING:
            return forces, found, tries
    return *best, tries


def _part(problem: DiscProblem, old: Forces, new: Forces, fraction: float) -> tuple[Forces, Projected]:
    """This fraction of the way of the contact forces, and what the laws make of it."""
    contact = old.contact + fraction * (new.contact - old.contact)
    forces = Forces(contact, old.drop + fraction * (new.drop - old.drop), new.extra)
    return forces, projected(problem, forces, problem.state(forces))


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The unknowns x of a linearisation, forces = B x: of each its node, its two components of the
    forces, and the weights of normal, t1 and t2.

    A row of the equations is v of the node along `row` (m, 3), plus `keep` (m,) times x itself.
    """

    node: Ints
    force: Floats
    row: Floats
    keep: Floats

    @classmethod
    def of(cls, problem: DiscProblem, found: Projected) -> Unknowns:
        """Those of the statuses found: pressing forces, sticking nodes' shear, slipping ones' turn."""
        closed = np.flatnonzero(found.status != OPEN)
        stick = np.flatnonzero(found.status == STICK)
        slip = np.flatnonzero((found.status == SLIP) & (problem.friction > 0.0))
        size = np.maximum(np.hypot(*found.z[slip].T), 1e-300)
        along = found.z[slip] / size[:, None]
        aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
        shear = problem.friction[slip] * found.p[slip]
        m = np.minimum(1.0, shear / size)
        normal = np.zeros((problem.size, 3))
        normal[:, 0] = 1.0
        normal[slip, 1:] = problem.friction[slip, None] * along
        unit = np.zeros((closed.size, 3))
        unit[:, 0] = 1.0
        held = np.repeat(np.eye(3)[None, 1:], stick.size, axis=0).reshape(-1, 3)
        turned = np.column_stack([np.zeros(slip.size), aside])
        inverse = 1.0 / problem.own[1][slip]
        return cls(
            np.concatenate([closed, np.repeat(stick, 2), slip]),
            np.concatenate([normal[closed], held, turned]),
            np.concatenate([unit, held, (m * inverse)[:, None] * turned]),
            np.concatenate([np.zeros(closed.size + 2 * stick.size), 1.0 - m]),
        )

    def columns(self, C: Floats) -> Floats:
        """C B for a matrix (q, 3 k)."""
        by_node = C.reshape(len(C), C.shape[1] // 3, 3)[:, self.node]
        return np.asarray(np.einsum("qma,ma->qm", by_node, self.force))

    def rows(self, v: Floats) -> Floats:
        """The rows (m, ...) of gaps and slips (3 k, ...)."""
        by_node = v.reshape(len(v) // 3, 3, *v.shape[1:])[self.node]
        return np.asarray(np.einsum("ma...,ma->m...", by_node, self.row))

    def spread(self, x: Floats, size: int) -> Floats:
        """Forces (3 size,) of the unknowns' values x (m,)."""
        forces = np.zeros((size, 3))
        np.add.at(forces, self.node, x[:, None] * self.force)
        return forces.ravel()


def _linearised(problem: DiscProblem, found: Projected) -> Forces:
    """The forces that solve the equations linearised where the laws were projected."""
    unknowns, extra, C = Unknowns.of(problem, found), problem.extra_unknowns, problem.compliance
    m = unknowns.node.size
    drop = np.zeros(C.shape[0])
    attracted = np.zeros(0, dtype=np.int64)
    if problem.attraction is not None:
        closed = found.status != OPEN
        drop[::3] = np.where(closed, -problem.attraction.gain_on_closing, 0.0)
        attracted = 3 * np.flatnonzero(~closed & (problem.attraction.negative_stiffness > 0.0))
    pushed = np.hstack([unknowns.columns(C), C[:, attracted]])
    known = problem.start + (C @ drop if drop.any() else 0.0)
    matrix = np.vstack([unknowns.rows(pushed), pushed[attracted]])
    right = -np.concatenate([unknowns.rows(known), known[attracted]])
    matrix[np.arange(m), np.arange(m)] += unknowns.keep
    if attracted.size:
        assert problem.attraction is not None
        own = np.arange(m, m + attracted.size)
        matrix[own, own] -= 1.0 / problem.attraction.negative_stiffness[attracted // 3]
        right[own] += problem.attraction.reference_gap[attracted // 3]
    if extra is not None:
        moved = np.vstack([unknowns.rows(extra.columns), extra.columns[attracted]])
        balance = np.hstack([unknowns.columns(extra.rows), extra.rows[:, attracted]])
        matrix = np.block([[matrix, moved], [balance, extra.pivot]])
        right = np.append(right, extra.right - extra.rows @ drop)
    x = np.linalg.solve(matrix, right)
    end = m + attracted.size
    drop[attracted] = x[m:end]
    return Forces(unknowns.spread(x[:m], problem.size), drop, x[end:])


def solve_attracted_disc(
    problem: DiscProblem, attraction: AttractionStiffness, status: Ints, force: Floats
) -> DiscSolution:
    """Contact of a pad whose open nodes are attracted, from statuses (k,) and forces (3 k,).

    Where the attraction weakens with the gap faster than the tissue stiffens, its negative
    stiffness is scaled to `STABLE` of the critical value, which goes the right way in small steps.
    """
    stiffness = attraction.negative_stiffness
    if not stiffness.any():
        return solve_disc(problem, force)
    attracted = replace(problem, attraction=attraction)
    root = np.sqrt(stiffness)
    gain = root[:, None] * problem.compliance[::3, ::3] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return solve_disc(attracted, force)
    if feedback(problem, stiffness, status) < STABLE:
        try:
            found = solve_disc(attracted, force)
        except ContactNotSolved:
            pass
        else:
            if feedback(problem, stiffness, found.status) < 1.0:
                return found
    largest = max(feedback(problem, stiffness, way) for way in (np.full(problem.size, OPEN), status))
    scaled = replace(attraction, negative_stiffness=STABLE / max(STABLE, largest) * stiffness)
    return replace(solve_disc(replace(problem, attraction=scaled), force), reduced=True)


def feedback(problem: DiscProblem, stiffness: Floats, status: Ints) -> float:
    """Largest factor by which the attraction of the open nodes, weakening by `stiffness` (k,) per
    gap, returns to itself, the closed nodes held.
    """
    free = np.flatnonzero((status == OPEN) & (stiffness > 0.0))
    if not free.size:
        return 0.0
    C = problem.compliance
    held = C[np.ix_(3 * free, 3 * free)]
    stick = 3 * np.flatnonzero(status == STICK)
    rows = np.concatenate([3 * np.flatnonzero(status != OPEN), stick + 1, stick + 2])
    if rows.size:
        held = held - C[np.ix_(3 * free, rows)] @ np.linalg.solve(C[np.ix_(rows, rows)], C[np.ix_(rows, 3 * free)])
    root = np.sqrt(stiffness[free])
    gain = root[:, None] * held * root
    return float(np.linalg.eigvalsh(0.5 * (gain + gain.T))[-1])

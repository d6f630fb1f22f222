r"""Signorini and Coulomb's disc in three dimensions, solved exactly: sweeps, and Newton's method with
the direction of slip as an unknown.

The laws of `evfem.contact.coulomb`, linearised exactly where p and z have been projected; e is
normal to z in the plane of contact:

========  ========================================================================
status    equations
========  ========================================================================
OPEN      lam = 0
STICK     g = 0, s = 0
SLIP      g = 0, lam_t = mu lam_n z/abs(z) + lam_e e,
          (1 - m) lam_e + m r_t (e . s) = 0  with  m = min(1, mu p / abs(z))
========  ========================================================================

The last equation turns the direction of slip; at the solution r drops out. These are three
unknowns for a sticking node, two for a slipping one, one without friction, one for the drop of an
open node's attraction, and one more row for every extra unknown.

Algorithm (`solve_disc`)::

    Newton's method from what the laws make of the last iteration's forces after the motion, and from
        their statuses as they are: these first where some node's own compliance is negative;
        where there are none, from sweeps of block Gauss-Seidel (`evfem.contact.sweeps`)
    Newton's method from the nodes that touched, sticking; then from all nodes, sticking
    repeat
        sweeps, twice as many each time; where they diverge, no more of them, and this is the last time
        Newton's method, with steps shortened where the laws are missed by more
    done, at each of these, where forces, gaps and slips obey the laws to rounding

Newton's method alone may cycle between statuses, sweeps alone are slow. Under a strong attraction
friction holds nearly all that touches, and grows with the areas that follow the nodes: the
compliance is then far from symmetric and some of its diagonal negative. Sweeps diverge there and
slips found by chance drive Newton's method about, but nothing changes for nodes that stick. Extra
unknowns stay during sweeps.

Source: P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353,
doi:10.1016/0045-7825(91)90022-X (projections and their linearisation).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import (
    DISC_FALL,
    DISC_NEWTON,
    DISC_ROUNDING,
    DISC_ROUNDS,
    DISC_SWEEPS,
    ROUNDING,
    STABLE,
)
from evfem.contact.attracted import AttractionStiffness, feedback
from evfem.contact.coulomb import SLIP, DiscProblem, DiscSolution, Forces, Projected, projected
from evfem.contact.signorini import OPEN, STICK, ContactNotSolved
from evfem.contact.sweeps import sweeps


def solve_disc(problem: DiscProblem, force: Floats) -> DiscSolution:
    """Signorini and Coulomb's disc on the candidates, started from contact forces (3 k,).

    Raises `ContactNotSolved` when Newton's method ends from none of its starts.
    """
    count = 0 if problem.extra_unknowns is None else problem.extra_unknowns.right.size
    given = Forces(force.copy(), np.zeros_like(force), np.zeros(count))
    best, miss, solves, nowhere = given, np.inf, 0, ""
    for forces, found in _starts(problem, given):
        forces, after, tries = _newton(problem, forces, found)
        solves += tries
        if after.miss <= DISC_ROUNDING:
            return _solution(problem, forces, after, solves)
        if after.miss < miss:
            best, miss = forces, after.miss
    for attempt in range(1, DISC_ROUNDS):
        try:
            best = sweeps(problem, best, DISC_SWEEPS << attempt)
        except ContactNotSolved as error:
            nowhere = f", {error}"
        found = projected(problem, best, problem.state(best))
        best, after, tries = _newton(problem, best, found, damped=True)
        solves += tries
        if after.miss <= DISC_ROUNDING:
            return _solution(problem, best, after, solves)
        miss = min(miss, after.miss)
        if nowhere:
            break
    raise ContactNotSolved(f"forces miss the laws by {miss:.1e}{nowhere}")


def _starts(problem: DiscProblem, given: Forces) -> Iterator[tuple[Forces, Projected]]:
    """Where Newton's method starts, one after the other until it ends: forces, and what the laws make
    of them.
    """
    touched, extra = given.contact[::3] > 0.0, problem.extra_unknowns
    # sweeps leave the unknowns as they are: a voltage that keeps a charge would be one that is given
    if not touched.any() and not (extra is not None and extra.conditioned.size):
        with suppress(ContactNotSolved):
            given = sweeps(problem, given, DISC_SWEEPS)
    if problem.yields:
        yield given, projected(problem, given, problem.state(given))
    if touched.any():
        yield given, _as_they_are(problem, given)
    if not problem.yields:
        yield given, projected(problem, given, problem.state(given))
    if touched.any():
        yield given, _sticking(problem, touched)
    yield given, _sticking(problem, np.ones_like(touched))


def _as_they_are(problem: DiscProblem, given: Forces) -> Projected:
    """The statuses that forces at hand have by themselves, whatever moves now."""
    force = given.contact.reshape(-1, 3)
    p, z = force[:, 0], force[:, 1:]
    held = (np.hypot(*z.T) < (1.0 - ROUNDING) * problem.limit(p)) & problem.holds
    return Projected(p, z, np.where(p > 0.0, np.where(held, STICK, SLIP), OPEN), np.inf)


def _sticking(problem: DiscProblem, closed: Any) -> Projected:
    """As if the laws had made these nodes (k,) stick, the others open."""
    status = np.where(closed, np.where(problem.holds, STICK, SLIP), OPEN)
    return Projected(np.where(closed, 1.0, -1.0), np.zeros((problem.size, 2)), status, np.inf)


def _solution(problem: DiscProblem, forces: Forces, found: Projected, solves: int) -> DiscSolution:
    return DiscSolution(
        forces.contact, forces.drop, found.status, forces.extra, problem.state(forces), solves
    )


def _newton(
    problem: DiscProblem, forces: Forces, found: Projected, damped: bool = False
) -> tuple[Forces, Projected, int]:
    """Forces after Newton's iterations, what the laws make of them, and the number of solves; the
    best ones where it does not end. It starts from forces and what the laws made of them; `damped`
    steps are the best of 1, 1/2, 1/4 ... of a whole one.
    """
    best = forces, found
    for tries in range(1, DISC_NEWTON * (2 if damped else 1) + 1):
        try:
            new = _linearised(problem, found)
        except np.linalg.LinAlgError:
            return *best, tries
        after = projected(problem, new, problem.state(new))
        if damped and not after.miss < DISC_FALL * found.miss:
            new, after = min(
                (_part(problem, forces, new, 0.5**n) for n in range(5)), key=lambda one: one[1].miss
            )
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
    """The unknowns x of a linearisation, forces = B x + `given` (3 k,): of each its node, its two
    components of the forces, and the weights of normal, t1 and t2.

    A row of the equations is v of the node along `row` (m, 3), plus `keep` (m,) times x itself.
    """

    node: Ints
    force: Floats
    row: Floats
    keep: Floats
    given: Floats

    @classmethod
    def of(cls, problem: DiscProblem, found: Projected) -> Unknowns:
        """Those of the statuses found: pressing forces, sticking nodes' shear, slipping ones' turn."""
        closed = np.flatnonzero(found.status != OPEN)
        stick = np.flatnonzero(found.status == STICK)
        slip = np.flatnonzero((found.status == SLIP) & problem.holds)
        size = np.maximum(np.hypot(*found.z[slip].T), 1e-300)
        along = found.z[slip] / size[:, None]
        aside = np.stack([-along[:, 1], along[:, 0]], axis=1)
        shear = problem.limit(found.p)[slip]
        m = np.minimum(1.0, shear / size)
        normal = np.zeros((problem.size, 3))
        normal[:, 0] = 1.0
        normal[slip, 1:] = problem.friction[slip, None] * along
        given = np.zeros((problem.size, 3))
        if problem.cohesion is not None:
            given[slip, 1:] = problem.cohesion[slip, None] * along
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
            given.ravel(),
        )

    def columns(self, C: Floats) -> Floats:
        """C B for a matrix (q, 3 k)."""
        place = 3 * self.node
        total = C[:, place] * self.force[:, 0]
        for a in (1, 2):
            some = np.flatnonzero(self.force[:, a])
            total[:, some] += C[:, place[some] + a] * self.force[some, a]
        return total

    def rows(self, v: Floats) -> Floats:
        """The rows (m, q) of gaps and slips (3 k, q)."""
        place = 3 * self.node
        total = v[place] * self.row[:, :1]
        for a in (1, 2):
            some = np.flatnonzero(self.row[:, a])
            total[some] += v[place[some] + a] * self.row[some, a, None]
        return total

    def spread(self, x: Floats, size: int) -> Floats:
        """Forces (3 size,) of the unknowns' values x (m,)."""
        forces = np.zeros((size, 3))
        np.add.at(forces, self.node, x[:, None] * self.force)
        return forces.ravel() + self.given


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
    steady = drop + unknowns.given
    known = problem.start + (C @ steady if steady.any() else 0.0)
    matrix = np.vstack([unknowns.rows(pushed), pushed[attracted]])
    right = -np.concatenate([unknowns.rows(known[:, None])[:, 0], known[attracted]])
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
        right = np.append(right, extra.right - extra.rows @ steady)
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
    if _feedback(problem, stiffness, status) < STABLE:
        try:
            found = solve_disc(attracted, force)
        except ContactNotSolved:
            pass
        else:
            if _feedback(problem, stiffness, found.status) < 1.0:
                return found
    largest = max(_feedback(problem, stiffness, way) for way in (np.full(problem.size, OPEN), status))
    scaled = replace(attraction, negative_stiffness=STABLE / max(STABLE, largest) * stiffness)
    return replace(solve_disc(replace(problem, attraction=scaled), force), reduced=True)


def _feedback(problem: DiscProblem, stiffness: Floats, status: Ints) -> float:
    """`feedback` where the nodes have these statuses (k,)."""
    free, stick = np.flatnonzero((status == OPEN) & (stiffness > 0.0)), 3 * np.flatnonzero(status == STICK)
    held = np.concatenate([3 * np.flatnonzero(status != OPEN), stick + 1, stick + 2])
    compliance = problem.compliance
    if problem.extra_unknowns is not None:
        compliance = compliance - problem.extra_unknowns.followed
    return feedback(compliance, compliance, 3 * free, held, stiffness[free])

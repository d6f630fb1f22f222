r"""Unilateral contact with Coulomb friction, solved exactly on the dense compliance of the contact
candidates.

For k candidates in their local frames (n normal, t tangential), with the contact forces
:math:`\lambda` the new gaps and slips are :math:`(g, s) = (g, s)_0 + C\lambda + e\,d`, where d are
optional extra unknowns (the bone's travel under a prescribed force, the squared voltage under a
prescribed friction force) with the equations :math:`r\lambda + \rho\,d = b`. Signorini and Coulomb
ask, per node, for exactly one of

========  ==========================  =================================================
status    equations                   stays if
========  ==========================  =================================================
OPEN      lam_n = lam_t = 0           g >= 0
STICK     g = 0, s = 0                lam_n >= 0 and abs(lam_t) <= mu lam_n
FORWARD   g = 0, lam_t = -mu lam_n    lam_n >= 0 and s >= 0
BACKWARD  g = 0, lam_t = +mu lam_n    lam_n >= 0 and s <= 0
========  ==========================  =================================================

The attraction of an open node weakens with its gap: a negative stiffness k_e. How much weaker it
has become, its drop f, is one more unknown of the node, f = k_e (g - g_ref). A closed node needs
none, its gap is known: the attraction is what it is at g = 0. So a thin insulator's steep law acts
only where it can. Between rough faces it also grows with what presses the node (`Roughness`): a
closed node moves the body with (1 - kappa) lam_n, and one that opens loses what its contact force
gained. Tangent of a concave law, the first never falls below the second: one of the two holds; for
another law chords see to that (`evfem.contact.attracted`).

Algorithm (`solve_contact`), a primal-dual active set::

    status <- that of the last iteration
    repeat
        solve the equations of `status` (one dense linear system) for forces and extra unknowns
        gaps, slips <- start + C (forces + drops) + e d
        wanted <- the status that each node's forces, gap and slip ask for
        if wanted = status: done
        change all violated nodes, or one of them (`evfem.contact.changes`); give up where that goes
            round in a circle, or many are left when one at a time begins and the body gives way or
            the attraction grows with the contact forces
    start again from all nodes sticking, then from all open, before giving up

After a few solves the drops of the attraction are taken out of the equations
(`evfem.contact.elimination`), and the closed nodes are what is left to solve for, with one
factorisation for statuses that differ in few nodes (`evfem.contact.updated`); the solution that is
returned is always one of the whole equations.

A node goes from open to slip the way it is moving, from slip to open when it pulls, from stick to
slip with the sign of its force when it leaves the cone, from slip to stick (never straight to the
other slip) when it moves along its own friction. It passes through slip between open and stick:
one that sticks beside a pulling shear force would seem to open. No constant has to be chosen. What
has not converged is never used.

A bound of friction that is no multiple of the contact force (`evfem.contact.friction`) is linear
here: mu lam_n + c, with `cohesion` c, takes the place of mu lam_n.

If the attraction weakens with the gap faster than the tissue stiffens, the linear problem has no
solution; its negative stiffness is then scaled to 0.9 of the critical value
(`solve_with_attraction`).

Sources: A. Klarbring, Comput. Methods Appl. Mech. Eng. 58 (1986) 175,
doi:10.1016/0045-7825(86)90095-2 (the frictional problem as complementarity); P. Alart and A.
Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353, doi:10.1016/0045-7825(91)90022-X; S.
Hueeber, G. Stadler and B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572, doi:10.1137/060671061
(primal-dual active set).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import ACTIVE_SET_LIMIT, FEW_SOLVES, HOPELESS, ROUNDING, STABLE
from evfem.contact.attracted import AttractionStiffness
from evfem.contact.changes import Changes
from evfem.contact.elimination import Elimination, Motions, bordered
from evfem.contact.updated import ClosedNodes, Relations

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3


class ContactNotSolved(ArithmeticError):
    """The sub-problem cycles: it has no solution near the start, or several."""


class Unstable(ContactNotSolved):
    """It has none because the body gives way the more, the more it is loaded."""


@dataclass(frozen=True)
class ExtraUnknowns:
    """p extra unknowns d: what they do to gaps then slips, `columns` (2 k, p), and the equations
    that settle them, `rows` (p, 2 k) lam + `pivot` (p, p) d = `right` (p,).
    """

    columns: Floats
    rows: Floats
    pivot: Floats
    right: Floats


@dataclass(frozen=True)
class ContactProblem:
    """Gaps and slips without contact forces (2 k,), compliance (2 k, 2 k), friction coefficients
    (k,), optional extra_unknowns, the shear force that friction has without a pressing one,
    `cohesion` (k,) in N/mm, and how far the interface itself gives way to contact forces, not to
    attraction, `give` (2 k,) in mm per N/mm.

    The first k entries are normal (gap, pressing force), the last k tangential (slip, shear
    force).
    """

    start: Floats
    compliance: Floats
    friction: Floats
    extra_unknowns: ExtraUnknowns | None = None
    attraction: AttractionStiffness | None = None
    cohesion: Floats | None = None
    give: Floats | None = None

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size

    @cached_property
    def under_forces(self) -> Floats:
        """Compliance (2 k, 2 k) of body and interface to contact forces."""
        return self.compliance if self.give is None else self.compliance + np.diag(self.give)

    @cached_property
    def gives_way(self) -> bool:
        """Whether the body gives way the more, the more it is loaded: this compliance, which contains
        the forces that turn with the profile, is not positive.
        """
        try:
            return not np.linalg.cholesky(self.under_forces + self.under_forces.T).size
        except np.linalg.LinAlgError:
            return True

    @property
    def seldom_ends(self) -> bool:
        """Whether an active set seldom ends that has many violated nodes left when one at a time begins."""
        rough = None if self.attraction is None else self.attraction.roughness
        return self.gives_way or (rough is not None and bool(rough.gain.any()))

    @property
    def resists(self) -> Any:
        """Which nodes have friction (k,) bool."""
        rough = self.friction > 0.0
        return rough if self.cohesion is None else rough | (self.cohesion > 0.0)

    def limit(self, normal: Floats) -> Floats:
        """Largest shear force (k,) under pressing forces (k,)."""
        limit = self.friction * normal
        return limit if self.cohesion is None else limit + self.cohesion

    def solved(self, status: Ints) -> tuple[Floats, Floats, Floats]:
        """Contact forces (2 k,), drops (2 k,) and extra unknowns (p,) for given statuses."""
        return _solve_statuses(self, status)

    @cached_property
    def elimination(self) -> Elimination | None:
        """The problem without the drops of the attraction; None where it has none, rough faces make
        them depend on the contact forces, or the interface gives way.
        """
        attraction, extra, none = self.attraction, self.extra_unknowns, np.zeros((2 * self.size, 0))
        if attraction is None or attraction.roughness is not None or self.give is not None:
            return None
        if not attraction.negative_stiffness.any():
            return None
        bone = (none, none.T, np.zeros((0, 0)), np.zeros(0))
        if extra is not None:
            bone = (extra.columns, extra.rows, extra.pivot, extra.right)
        whole = Motions(self.start, self.compliance, *bone)
        try:
            return Elimination.of(whole, attraction.negative_stiffness, attraction.reference_gap)
        except np.linalg.LinAlgError:
            return None

    @cached_property
    def closed_nodes(self) -> ClosedNodes:
        """What solves for the closed nodes without the drops."""
        assert self.elimination is not None
        return ClosedNodes(self.elimination.left)


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (2 k,), drops of the attraction (2 k,), statuses (k,), the extra unknowns
    (p,), new gaps and slips (2 k,), the number of dense solves, and whether the negative stiffness
    had to be scaled down, or what turns with the profile.
    """

    force: Floats
    attraction_drop: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int
    reduced: bool = False
    weakened: bool = False


def solve_contact(problem: ContactProblem, status: Ints) -> ContactSolution:
    """Signorini-Coulomb, started from `status` (k,) and, should that cycle, from all nodes sticking
    or all open; raises `ContactNotSolved` when none of them ends within `ACTIVE_SET_LIMIT` solves and
    one per node, or the body gives way.
    """
    most, failed = ACTIVE_SET_LIMIT + problem.size, ContactNotSolved("")
    for start in (status, np.full(problem.size, STICK), np.full(problem.size, OPEN)):
        try:
            return _active_set(problem, start, most)
        except ContactNotSolved as error:
            failed = error
            if problem.gives_way:  # other starts rarely find more, and cost as much
                break
    raise failed


def _active_set(problem: ContactProblem, status: Ints, most: int) -> ContactSolution:
    status = np.where(~problem.resists & (status != OPEN), FORWARD, status)
    changes, violated, whole = Changes(), np.zeros(0, dtype=np.int64), False
    for solves in range(1, most + 1):
        fewer = not whole and solves > FEW_SOLVES and problem.elimination is not None
        solved = _solve_closed if fewer else _solve_statuses
        force, attraction_drop, extra = solved(problem, status)
        state = problem.start + problem.compliance @ (force + attraction_drop)
        if problem.give is not None:
            state = state + problem.give * force
        if problem.extra_unknowns is not None:
            state = state + problem.extra_unknowns.columns @ extra
        wanted, violation = _next_statuses(problem, status, force, state)
        violated = np.flatnonzero(wanted != status)
        if fewer and not violated.size:
            whole = True
            continue
        if not violated.size:
            return ContactSolution(force, attraction_drop, status, extra, state, solves)
        if solves == ACTIVE_SET_LIMIT // 3 and violated.size > HOPELESS and problem.seldom_ends:
            break
        picked = changes.picked(status, violated, violation)
        if not picked.size:
            break
        status = status.copy()
        status[picked] = wanted[picked]
    raise ContactNotSolved(f"{violated.size} of {problem.size} nodes keep changing")


def solve_with_attraction(
    problem: ContactProblem, attraction: AttractionStiffness, status: Ints, snap: bool = False
) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted.

    If the attraction weakens with the gap faster than the tissue stiffens (the pad snaps), the
    linear problem has no solution or the wrong one. Its negative stiffness is then scaled to
    `STABLE` of the critical value, which goes the right way in small steps: of the body as its
    closed nodes hold it, or where that does not do, of the much softer one without them. With
    `snap` the nodes that are being lost close instead.
    """
    if not attraction.negative_stiffness.any() and attraction.roughness is None:
        return solve_contact(problem, status)
    attracted = replace(problem, attraction=attraction)
    root = np.sqrt(attraction.negative_stiffness)
    gain = root[:, None] * problem.compliance[: problem.size, : problem.size] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return solve_contact(attracted, status)
    for start in (status, _snapped(problem, attraction, status)) if snap else (status,):
        try:
            found = _active_set(attracted, start, ACTIVE_SET_LIMIT)
        except ContactNotSolved:
            continue
        if _feedback(problem, attraction, found.status)[0] < 1.0:
            return found
    most = STABLE
    for way in (status, np.full(problem.size, OPEN)):
        most = max(most, _feedback(problem, attraction, way)[0])
        scaled = replace(attraction, negative_stiffness=STABLE / most * attraction.negative_stiffness)
        weaker = replace(problem, attraction=scaled)
        with suppress(ContactNotSolved):
            found = _active_set(weaker, status, ACTIVE_SET_LIMIT)
            if _feedback(problem, scaled, found.status)[0] < 1.0:
                return replace(found, reduced=True)
    if problem.gives_way:  # other starts rarely find more, and cost as much
        raise ContactNotSolved("the body gives way the more, the more it is loaded")
    return replace(solve_contact(weaker, status), reduced=True)


def _feedback(problem: ContactProblem, attraction: AttractionStiffness, status: Ints) -> tuple[float, Floats]:
    """Largest factor by which the attraction of the open nodes returns to itself, the closed nodes
    held, and the gaps (k,) that grow with it.
    """
    k, C, stiffness = problem.size, problem.compliance, attraction.negative_stiffness
    free, closed = np.flatnonzero((status == OPEN) & (stiffness > 0.0)), np.flatnonzero(status != OPEN)
    mode = np.zeros(k)
    if not free.size:
        return 0.0, mode
    held = C[np.ix_(free, free)]
    if closed.size:
        rows = np.concatenate([closed, k + np.flatnonzero(status == STICK)])
        own = problem.under_forces[np.ix_(rows, rows)]
        held = held - C[np.ix_(free, rows)] @ np.linalg.solve(own, C[np.ix_(rows, free)])
    root = np.sqrt(stiffness[free])
    gain = root[:, None] * held * root
    factors, modes = np.linalg.eigh(0.5 * (gain + gain.T))
    mode[free] = modes[:, -1] / root
    return float(factors[-1]), mode


def _snapped(problem: ContactProblem, attraction: AttractionStiffness, status: Ints) -> Ints:
    """Statuses (k,) with those open nodes closed that move most in the mode that is being lost, if
    it is on its way to the surface.
    """
    factor, mode = _feedback(problem, attraction, status)
    drift = solve_contact(problem, status).state[: problem.size] - attraction.reference_gap
    if factor < 1.0 or drift @ (attraction.negative_stiffness * mode**2) >= 0.0:
        return status
    lost = (np.abs(mode) > 0.5 * np.abs(mode).max()) & (drift < 0.0)
    return np.where(lost, STICK, status)


def _attracted(problem: ContactProblem, status: Ints) -> tuple[Ints, Floats, Floats]:
    """Open nodes that it pulls less with the gap, drops (2 k,) by status, gain per contact force (2 k,)."""
    k, attraction = problem.size, problem.attraction
    drop, gain = np.zeros(2 * k), np.zeros(2 * k)
    if attraction is None:
        return np.zeros(0, dtype=np.int64), drop, gain
    is_open = status == OPEN
    drop[:k] = np.where(is_open, 0.0, -attraction.gain_on_closing)
    if attraction.roughness is not None:
        rough, gain = attraction.roughness, attraction.roughness.gain
        drop += np.where(np.tile(is_open, 2), rough.loss_on_opening, gain * np.tile(rough.present, 2))
    return np.flatnonzero(is_open & (attraction.negative_stiffness > 0.0)), drop, gain


def _solve_statuses(problem: ContactProblem, status: Ints) -> tuple[Floats, Floats, Floats]:
    """Contact forces (2 k,), drops (2 k,) and extra unknowns (p,): one dense linear system."""
    k, C, extra, attraction = problem.size, problem.compliance, problem.extra_unknowns, problem.attraction
    active, stick = np.flatnonzero(status != OPEN), np.flatnonzero(status == STICK)
    against = (status == BACKWARD).astype(float) - (status == FORWARD)
    ratio = problem.friction * against  # shear force per pressing force of slipping nodes
    attracted, drop, gain = _attracted(problem, status)
    gain, aside = gain[active], gain[k + active]
    rows = np.concatenate([active, k + stick, attracted])
    matrix, right, known = C[np.ix_(rows, rows)], -problem.start[rows], drop
    matrix[:, : active.size] *= 1.0 - gain
    if problem.give is not None:
        pressed = np.arange(rows.size - attracted.size)
        matrix[pressed, pressed] += problem.give[rows[pressed]]
    sheared = ratio[active] - aside
    if (some := np.flatnonzero(sheared)).size:
        matrix[:, some] += C[np.ix_(rows, k + active[some])] * sheared[some]
    if attraction is not None:
        right -= C[rows] @ drop
        own = np.arange(rows.size - attracted.size, rows.size)
        matrix[own, own] -= 1.0 / attraction.negative_stiffness[attracted]
        right[own] += attraction.reference_gap[attracted]
    if problem.cohesion is not None:
        shear = np.concatenate([np.zeros(k), problem.cohesion * against])
        right -= C[rows] @ shear
        known = drop + shear
    if extra is not None:
        row = extra.rows[:, rows]
        row[:, : active.size] *= 1.0 - gain
        row[:, : active.size] += extra.rows[:, k + active] * sheared
        matrix = bordered(matrix, extra.columns[rows], row, extra.pivot)
        right = np.append(right, extra.right - extra.rows @ known)
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error)) from error
    force = np.zeros(2 * k)
    contact = rows.size - attracted.size
    force[rows[:contact]] = x[:contact]
    drop[attracted] += x[contact : rows.size]
    drop[np.append(active, k + active)] -= np.append(gain, aside) * np.tile(x[: active.size], 2)
    force[k:] += ratio * force[:k]
    if problem.cohesion is not None:
        force[k:] += problem.cohesion * against
    return force, drop, x[rows.size :]


def _solve_closed(problem: ContactProblem, status: Ints) -> tuple[Floats, Floats, Floats]:
    """The same as `_solve_statuses`, with the drops of the attraction eliminated."""
    elimination, attraction, k = problem.elimination, problem.attraction, problem.size
    assert elimination is not None
    assert attraction is not None
    against = (status == BACKWARD).astype(float) - (status == FORWARD)
    ratio = problem.friction * against
    # what a contact force is above the force that pushes beside the drops
    above = attraction.gain_on_closing - attraction.negative_stiffness * attraction.reference_gap
    shear = ratio * above if problem.cohesion is None else ratio * above + problem.cohesion * against
    try:
        force, extra = problem.closed_nodes.solved(Relations(status != OPEN, status == STICK, ratio, shear))
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error)) from error
    drop, active = np.zeros(2 * k), np.flatnonzero(status != OPEN)
    drop[elimination.attracted] = elimination.drops(force, extra)
    drop[active] = -attraction.gain_on_closing[active]
    force = force.copy()
    force[active] += above[active]
    return force, drop, extra


def _next_statuses(
    problem: ContactProblem, status: Ints, force: Floats, state: Floats
) -> tuple[Ints, Floats]:
    """Statuses that the solution asks for, and how far each node violates its own."""
    k, resists = problem.size, problem.resists
    normal, shear, gap, slip = force[:k], force[k:], state[:k], state[k:]
    own_compliance = np.maximum(np.abs(np.diagonal(problem.under_forces)[:k]), 1e-300)
    scale = max(np.abs(normal).max(initial=0.0), np.abs(gap / own_compliance).max(initial=0.0) * 1e-3, 1e-300)
    noise = ROUNDING * scale
    violation = np.zeros(k)
    wanted = status.copy()

    def change(where: Floats, to: Ints, amount: Floats) -> None:
        wanted[where] = to[where]
        violation[where] = amount[where]

    entering = np.where(resists & (slip == 0.0), STICK, np.where(slip < 0, BACKWARD, FORWARD))
    change((status == OPEN) & (gap / own_compliance < -noise), entering, -gap / own_compliance)
    beyond = np.abs(shear) - problem.limit(normal)
    change((status == STICK) & (beyond > noise), np.where(shear < 0, FORWARD, BACKWARD), beyond)
    along = np.where(status == BACKWARD, slip, -slip) / own_compliance
    change((status >= FORWARD) & resists & (along > noise), np.full(k, STICK), along)
    change((status >= FORWARD) & (normal < -noise), np.full(k, OPEN), -normal)
    return wanted, violation

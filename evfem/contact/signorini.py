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
gained. Tangent of a concave law, the first never falls below the second: one of the two holds.

Algorithm (`solve_contact`), a primal-dual active set::

    status <- that of the last iteration
    repeat
        solve the equations of `status` (one dense linear system) for forces and extra unknowns
        gaps, slips <- start + C (forces + drops) + e d
        wanted <- the status that each node's forces, gap and slip ask for
        if wanted = status: done
        change all violated nodes; from the first statuses on that have been met before, the worst one
            alone; give up where these go round in a circle

A node goes from open to slip the way it is moving, from slip to open when it pulls, from stick to
slip with the sign of its force when it leaves the cone, from slip to stick (never straight to the
other slip) when it moves along its own friction. It passes through slip between open and stick:
one that sticks beside a pulling shear force would seem to open. No constant has to be chosen. What
has not converged is never used.

A bound of friction that is no multiple of the contact force (`evfem.surface.friction`) is linear
here: mu lam_n + c, with `cohesion` c, takes the place of mu lam_n.

If the attraction weakens with the gap faster than the tissue stiffens, the linear problem has no
solution, or the wrong one; its negative stiffness is then scaled to 0.9 of the critical value
(`solve_with_attraction`).

Sources: A. Klarbring, Comput. Methods Appl. Mech. Eng. 58 (1986) 175,
doi:10.1016/0045-7825(86)90095-2 (the frictional problem as complementarity); P. Alart and A.
Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353, doi:10.1016/0045-7825(91)90022-X; S.
Hueeber, G. Stadler and B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572, doi:10.1137/060671061
(primal-dual active set).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import ACTIVE_SET_LIMIT, ROUNDING, STABLE
from evfem.contact.attracted import AttractionStiffness, feedback

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
#: how often the attraction's stiffness is scaled down, by at least which factor, before that of a pad
#: without closed nodes decides
SCALINGS, SOFTER = 2, 1.1


NO_NODES: Ints = np.zeros(0, dtype=np.int64)


class ContactNotSolved(ArithmeticError):
    """The sub-problem cycles: it has no solution near the start, or several. `softest` (k,): the last
    statuses, those that keep changing open.
    """

    def __init__(self, message: str, softest: Ints = NO_NODES) -> None:
        super().__init__(message)
        self.softest = softest


class Unstable(ContactNotSolved):
    """It has none because the body gives way the more, the more it is loaded."""


@dataclass(frozen=True)
class ExtraUnknowns:
    """p extra unknowns d: what they do to gaps then slips, `columns` (2 k, p), and the equations
    that settle them, `rows` (p, 2 k) lam + `pivot` (p, p) d = `right` (p,). Those `conditioned` follow what
    the body does even where its stability is asked for, as a voltage that keeps a charge.
    """

    columns: Floats
    rows: Floats
    pivot: Floats
    right: Floats
    conditioned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def followed(self) -> Floats:
        """What the conditioned ones take from the compliance (2 k, 2 k)."""
        some = self.conditioned
        return self.columns[:, some] @ np.linalg.solve(self.pivot[np.ix_(some, some)], self.rows[some])


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
    chords: Floats | None = None

    @property
    def by_chords(self) -> ContactProblem:
        """The problem with the chords of its friction laws in the place of their tangents."""
        assert self.chords is not None
        return replace(self, friction=self.chords, cohesion=None)

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
    def resists(self) -> Any:
        """Which nodes have friction (k,) bool."""
        rough = self.friction > 0.0
        return rough if self.cohesion is None else rough | (self.cohesion > 0.0)

    def limit(self, normal: Floats) -> Floats:
        """Largest shear force (k,) under pressing forces (k,)."""
        limit = self.friction * normal
        return limit if self.cohesion is None else limit + self.cohesion


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (2 k,), drops of the attraction (2 k,), statuses (k,), the extra unknowns
    (p,), new gaps and slips (2 k,), the number of dense solves, and whether the negative stiffness
    had to be scaled down.
    """

    force: Floats
    attraction_drop: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int
    reduced: bool = False


def solve_contact(problem: ContactProblem, status: Ints) -> ContactSolution:
    """Signorini-Coulomb, started from `status` (k,); raises `ContactNotSolved` when the active set does
    not end within `ACTIVE_SET_LIMIT` solves.
    """
    status = np.where(~problem.resists & (status != OPEN), FORWARD, status)
    met, alone, late, violated = set[bytes](), set[bytes](), False, np.zeros(0, dtype=np.int64)
    for solves in range(1, ACTIVE_SET_LIMIT + 1):
        force, attraction_drop, extra = _solve_statuses(problem, status)
        state = problem.start + problem.compliance @ (force + attraction_drop)
        if problem.give is not None:
            state = state + problem.give * force
        if problem.extra_unknowns is not None:
            state = state + problem.extra_unknowns.columns @ extra
        wanted, violation = _next_statuses(problem, status, force, state)
        violated = np.flatnonzero(wanted != status)
        if not violated.size:
            return ContactSolution(force, attraction_drop, status, extra, state, solves)
        key = status.tobytes()
        late = late or key in met
        if key in alone:
            break
        changed = violation.argmax() if late else violated
        (alone if late else met).add(key)
        status = status.copy()
        status[changed] = wanted[changed]
    raise ContactNotSolved(
        f"{violated.size} of {problem.size} nodes keep changing", np.where(wanted != status, OPEN, status)
    )


def solve_with_attraction(
    problem: ContactProblem, attraction: AttractionStiffness, status: Ints
) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted.

    If the attraction weakens with the gap faster than the tissue stiffens (the pad snaps), the
    linear problem has no solution or the wrong one. Its negative stiffness is then scaled to
    `STABLE` of the critical value, which goes the right way in small steps: of the body as its
    closed nodes hold it, then as those hold it that do not keep changing, at last of the much softer
    one without them. The law of friction is taken by its tangents first, then by its chords: the
    tangent of one that levels off soon grows so fast that there may be no solution.
    """
    laws = (problem,) if problem.chords is None else (problem, problem.by_chords)
    if not attraction.negative_stiffness.any() and attraction.roughness is None:
        return _first(laws, status)
    attracted = [replace(law, attraction=attraction) for law in laws]
    root = np.sqrt(attraction.negative_stiffness)
    gain = root[:, None] * problem.compliance[: problem.size, : problem.size] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return _first(attracted, status)

    def scaled(most: float) -> AttractionStiffness:
        return replace(attraction, negative_stiffness=STABLE / most * attraction.negative_stiffness)

    most = _feedback(problem, attraction, status)
    for law in (*laws, *[laws[-1]] * SCALINGS):
        pulled = scaled(most) if most >= 1.0 else attraction
        try:
            found = solve_contact(replace(law, attraction=pulled), status)
            softest = found.status
            if _feedback(problem, pulled, softest) < 1.0:
                return replace(found, reduced=most >= 1.0)
        except ContactNotSolved as error:
            softest = error.softest
        most = max(SOFTER * most, float(law is laws[-1]), _feedback(problem, attraction, softest))
    most = max(most, _feedback(problem, attraction, np.full(problem.size, OPEN)))
    return replace(_first([replace(law, attraction=scaled(most)) for law in laws], status), reduced=True)


def _first(problems: Sequence[ContactProblem], status: Ints) -> ContactSolution:
    """The solution of the first of these problems that has one."""
    for problem in problems[:-1]:
        with suppress(ContactNotSolved):
            return solve_contact(problem, status)
    return solve_contact(problems[-1], status)


def _feedback(problem: ContactProblem, attraction: AttractionStiffness, status: Ints) -> float:
    """`feedback` where the nodes have these statuses (k,)."""
    stiffness, open_nodes = attraction.negative_stiffness, status == OPEN
    gaps = np.flatnonzero(open_nodes & (stiffness > 0.0))
    held = np.concatenate([np.flatnonzero(~open_nodes), problem.size + np.flatnonzero(status == STICK)])
    taken: Any = 0.0 if problem.extra_unknowns is None else problem.extra_unknowns.followed
    return feedback(problem.compliance - taken, problem.under_forces - taken, gaps, held, stiffness[gaps])


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
        matrix = np.block([[matrix, extra.columns[rows]], [row, extra.pivot]])
        right = np.append(right, extra.right - extra.rows @ known)
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error), status) from error
    force = np.zeros(2 * k)
    contact = rows.size - attracted.size
    force[rows[:contact]] = x[:contact]
    drop[attracted] += x[contact : rows.size]
    drop[np.append(active, k + active)] -= np.append(gain, aside) * np.tile(x[: active.size], 2)
    force[k:] += ratio * force[:k]
    if problem.cohesion is not None:
        force[k:] += problem.cohesion * against
    return force, drop, x[rows.size :]


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

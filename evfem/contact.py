r"""Unilateral contact with Coulomb friction, solved exactly on the dense compliance of the contact
candidates.

For k candidates in their local frames (n normal, t tangential), with the contact forces :math:`\lambda` the
new gaps and slips are :math:`(g, s) = (g, s)_0 + C\lambda + e\,d`, where d are optional extra unknowns (the
bone's travel under a prescribed force, the squared voltage under a prescribed friction force) with the
equations :math:`r\lambda + \rho\,d = b`. Signorini and Coulomb ask, per node, for exactly one of

========  ==========================  =================================================
status    equations                   stays if
========  ==========================  =================================================
OPEN      lam_n = lam_t = 0           g >= 0
STICK     g = 0, s = 0                lam_n >= 0 and abs(lam_t) <= mu lam_n
FORWARD   g = 0, lam_t = -mu lam_n    lam_n >= 0 and s >= 0
BACKWARD  g = 0, lam_t = +mu lam_n    lam_n >= 0 and s <= 0
========  ==========================  =================================================

The attraction of an open node falls with its gap: its `relief` is one more unknown there, f = fall (g -
level). A closed node needs none, its gap is known; so a thin insulator's steep law acts only where it can.

A warm-started active set changes all violated nodes at once: open -> slip the way it is moving when the gap
closes, slip -> open when it pulls, stick -> slip with the sign of its force when it leaves the cone, slip ->
stick (never straight to the other slip) when it moves along its own friction. A node passes through slip
between open and stick: one that sticks beside a pulling shear force would seem to open. If a set of statuses
comes back, only the worst violated node changes per solve. No constant has to be chosen. What has not
converged is never used.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.mesh import Floats, Ints

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
#: feedback that an attraction is reduced to where its own fall cannot be held
STABLE = 0.9


class ContactNotSolved(ArithmeticError):
    """The sub-problem cycles: it has no solution near the start, or several."""


@dataclass(frozen=True)
class Border:
    """p extra unknowns d: `effect` (2 k, p) on gaps then slips, `row` (p, 2 k) lam + `pivot` (p, p) d =
    `value` (p,).
    """

    effect: Floats
    row: Floats
    pivot: Floats
    value: Floats


@dataclass(frozen=True)
class Pull:
    """An attraction of open nodes that falls by `fall` (k,) per unit of gap from its value at the gap
    `level` (k,).
    """

    fall: Floats
    level: Floats


@dataclass(frozen=True)
class ContactProblem:
    """Gaps and slips without contact forces (2 k,), compliance (2 k, 2 k), friction coefficients (k,),
    optional border.

    The first k entries are normal (gap, pressing force), the last k tangential (slip, shear force).
    """

    start: Floats
    compliance: Floats
    friction: Floats
    border: Border | None = None
    pull: Pull | None = None

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (2 k,), what open nodes are pulled less (2 k,), statuses (k,), the extra unknowns (p,),
    new gaps and slips (2 k,), and the number of dense solves.
    """

    force: Floats
    relief: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int


def solve_contact(problem: ContactProblem, status: Ints, limit: int = 60) -> ContactSolution:
    """Signorini-Coulomb on the candidates, started from `status` (k,) and, should that cycle, from all nodes
    sticking or all open; raises `ContactNotSolved` when none of them ends within `limit` solves and one per
    node.
    """
    for start in (status, np.full(problem.size, STICK)):
        try:
            return _active_set(problem, start, limit)
        except ContactNotSolved:
            continue
    return _active_set(problem, np.full(problem.size, OPEN), limit)


def _active_set(problem: ContactProblem, status: Ints, limit: int) -> ContactSolution:
    status = np.where((problem.friction == 0.0) & (status != OPEN), FORWARD, status)
    seen: set[bytes] = set()
    for solves in range(1, limit + problem.size + 1):
        force, relief, extra = _solve_statuses(problem, status)
        state = problem.start + problem.compliance @ (force + relief)
        if problem.border is not None:
            state = state + problem.border.effect @ extra
        wanted, violation = _next_statuses(problem, status, force, state)
        changes = np.flatnonzero(wanted != status)
        if not changes.size:
            return ContactSolution(force, relief, status, extra, state, solves)
        if status.tobytes() in seen or solves > limit // 3:
            changes = changes[[np.argmax(violation[changes])]] if solves < limit else changes[:1]
        seen.add(status.tobytes())
        status = status.copy()
        status[changes] = wanted[changes]
    raise ContactNotSolved(f"{changes.size} of {problem.size} nodes keep changing")


def solve_pulled(problem: ContactProblem, pull: Pull, status: Ints) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted. Where the body could not hold the attraction's fall
    (the pad snaps) the linearised problem has no solution or the wrong one; then the fall is reduced to what
    it can hold.
    """
    if not pull.fall.any():
        return solve_contact(problem, status)
    k = problem.size
    root = np.sqrt(pull.fall)
    gain = root[:, None] * problem.compliance[:k, :k] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return solve_contact(replace(problem, pull=pull), status)
    try:
        found = solve_contact(replace(problem, pull=pull), status)
        if _feedback(problem, pull, found.status) < 1.0:
            return found
    except ContactNotSolved:
        pass
    reduced = pull.fall * (STABLE / max(_feedback(problem, pull, np.full(k, OPEN)), STABLE))
    return solve_contact(replace(problem, pull=replace(pull, fall=reduced)), status)


def _feedback(problem: ContactProblem, pull: Pull, status: Ints) -> float:
    """Largest factor by which the attraction of the open nodes returns to itself, the closed nodes held."""
    k, C = problem.size, problem.compliance
    free, closed = np.flatnonzero((status == OPEN) & (pull.fall > 0.0)), np.flatnonzero(status != OPEN)
    held = C[np.ix_(free, free)]
    if closed.size:
        rows = np.concatenate([closed, k + np.flatnonzero(status == STICK)])
        held = held - C[np.ix_(free, rows)] @ np.linalg.solve(C[np.ix_(rows, rows)], C[np.ix_(rows, free)])
    root = np.sqrt(pull.fall[free])
    gain = root[:, None] * held * root
    return float(np.linalg.eigvalsh(0.5 * (gain + gain.T)).max(initial=0.0))


def _solve_statuses(problem: ContactProblem, status: Ints) -> tuple[Floats, Floats, Floats]:
    """Contact forces (2 k,), relief of the pull (2 k,) and extra unknowns (p,) for given statuses: one dense
    linear system.
    """
    k, C, border = problem.size, problem.compliance, problem.border
    active, stick = np.flatnonzero(status != OPEN), np.flatnonzero(status == STICK)
    # shear force per pressing force of slipping nodes: against the slip
    ratio = problem.friction * ((status == BACKWARD).astype(float) - (status == FORWARD))
    pulled = np.zeros(0, dtype=np.int64)
    if problem.pull is not None:
        pulled = np.flatnonzero((status == OPEN) & (problem.pull.fall > 0.0))
    rows = np.concatenate([active, k + stick, pulled])
    matrix = C[np.ix_(rows, rows)]
    slipping = np.flatnonzero(ratio[active])
    if slipping.size:
        matrix[:, slipping] += C[np.ix_(rows, k + active[slipping])] * ratio[active[slipping]]
    right = -problem.start[rows]
    if problem.pull is not None:
        own = np.arange(rows.size - pulled.size, rows.size)
        matrix[own, own] -= 1.0 / problem.pull.fall[pulled]
        right[own] += problem.pull.level[pulled]
    if border is not None:
        row = border.row[:, rows]
        row[:, : active.size] += border.row[:, k + active] * ratio[active]
        matrix = np.block([[matrix, border.effect[rows]], [row, border.pivot]])
        right = np.append(right, border.value)
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error)) from error
    force, relief = np.zeros(2 * k), np.zeros(2 * k)
    contact = rows.size - pulled.size
    force[rows[:contact]] = x[:contact]
    relief[pulled] = x[contact : rows.size]
    force[k:] += ratio * force[:k]
    return force, relief, x[rows.size :]


def _next_statuses(
    problem: ContactProblem, status: Ints, force: Floats, state: Floats
) -> tuple[Ints, Floats]:
    """Statuses that the solution asks for, and by how much each node violates its own, in comparable
    units.
    """
    k, mu = problem.size, problem.friction
    normal, shear, gap, slip = force[:k], force[k:], state[:k], state[k:]
    softness = np.maximum(np.abs(np.diagonal(problem.compliance)[:k]), 1e-300)
    scale = max(np.abs(normal).max(initial=0.0), np.abs(gap / softness).max(initial=0.0) * 1e-3, 1e-300)
    noise = 1e-12 * scale
    violation = np.zeros(k)
    wanted = status.copy()

    def change(where: Floats, to: Ints, amount: Floats) -> None:
        wanted[where] = to[where]
        violation[where] = amount[where]

    entering = np.where((mu > 0) & (slip == 0.0), STICK, np.where(slip < 0, BACKWARD, FORWARD))
    change((status == OPEN) & (gap / softness < -noise), entering, -gap / softness)
    beyond = np.abs(shear) - mu * normal
    change((status == STICK) & (beyond > noise), np.where(shear < 0, FORWARD, BACKWARD), beyond)
    along = np.where(status == BACKWARD, slip, -slip) / softness
    change((status >= FORWARD) & (mu > 0) & (along > noise), np.full(k, STICK), along)
    change((status >= FORWARD) & (normal < -noise), np.full(k, OPEN), -normal)
    return wanted, violation

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

A warm-started active set changes all violated nodes at once: open -> slip the way it is moving when the gap
closes, slip -> open when it pulls, stick -> slip with the sign of its force when it leaves the cone, slip ->
stick (never straight to the other slip) when it moves along its own friction. A node passes through slip
between open and stick: one that sticks beside a pulling shear force would seem to open. If a set of statuses
comes back, only the worst violated node changes per solve. No constant has to be chosen. What has not
converged is never used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.mesh import Floats, Ints

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3


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
class ContactProblem:
    """Gaps and slips without contact forces (2 k,), compliance (2 k, 2 k), friction coefficients (k,),
    optional border.

    The first k entries are normal (gap, pressing force), the last k tangential (slip, shear force).
    """

    start: Floats
    compliance: Floats
    friction: Floats
    border: Border | None = None

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (2 k,), statuses (k,), the extra unknowns (p,), new gaps and slips (2 k,), and the
    number of dense solves.
    """

    force: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int


def solve_contact(problem: ContactProblem, status: Ints, limit: int = 60) -> ContactSolution:
    """Signorini-Coulomb on the candidates, started from `status` (k,); raises `ContactNotSolved` after
    `limit` solves.
    """
    status = np.where((problem.friction == 0.0) & (status != OPEN), FORWARD, status)
    seen: set[bytes] = set()
    for solves in range(1, limit + problem.size + 1):
        force, extra = _solve_statuses(problem, status)
        state = problem.start + problem.compliance @ force
        if problem.border is not None:
            state = state + problem.border.effect @ extra
        wanted, violation = _next_statuses(problem, status, force, state)
        changes = np.flatnonzero(wanted != status)
        if not changes.size:
            return ContactSolution(force, status, extra, state, solves)
        if status.tobytes() in seen or solves > limit // 3:
            changes = changes[[np.argmax(violation[changes])]] if solves < limit else changes[:1]
        seen.add(status.tobytes())
        status = status.copy()
        status[changes] = wanted[changes]
    raise ContactNotSolved(f"{changes.size} of {problem.size} nodes keep changing")


def _solve_statuses(problem: ContactProblem, status: Ints) -> tuple[Floats, Floats]:
    """Forces (2 k,) and extra unknowns (p,) for given statuses: one dense linear system."""
    k, C, border = problem.size, problem.compliance, problem.border
    active, stick = np.flatnonzero(status != OPEN), np.flatnonzero(status == STICK)
    # shear force per pressing force of slipping nodes: against the slip
    ratio = problem.friction * ((status == BACKWARD).astype(float) - (status == FORWARD))
    rows = np.concatenate([active, k + stick])
    matrix = C[np.ix_(rows, rows)]
    slipping = np.flatnonzero(ratio[active])
    if slipping.size:
        matrix[:, slipping] += C[np.ix_(rows, k + active[slipping])] * ratio[active[slipping]]
    right = -problem.start[rows]
    if border is not None:
        row = border.row[:, rows]
        row[:, : active.size] += border.row[:, k + active] * ratio[active]
        matrix = np.block([[matrix, border.effect[rows]], [row, border.pivot]])
        right = np.append(right, border.value)
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error)) from error
    force = np.zeros(2 * k)
    force[rows] = x[: rows.size]
    force[k:] += ratio * force[:k]
    return force, x[rows.size :]


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

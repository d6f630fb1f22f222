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
level). A closed node needs none, its gap is known: the attraction is what it is at g = 0, its `closing` more
than at the present gap. So a thin insulator's steep law acts only where it can.

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

from evfem.common.arrays import Floats, Ints

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
#: solves of an active set, of which a third may change many nodes at once
LIMIT = 60
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
    `level` (k,), and grows by `closing` (k,) when the gap closes.
    """

    fall: Floats
    level: Floats
    closing: Floats


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

    def solved(self, status: Ints) -> tuple[Floats, Floats, Floats]:
        """Contact forces (2 k,), relief of the pull (2 k,) and extra unknowns (p,) for given statuses."""
        return _solve_statuses(self, status)


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (2 k,), what nodes are pulled less (2 k,), statuses (k,), the extra unknowns (p,), new
    gaps and slips (2 k,), the number of dense solves, and whether the attraction's fall had to be reduced.
    """

    force: Floats
    relief: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int
    reduced: bool = False


def solve_contact(problem: ContactProblem, status: Ints) -> ContactSolution:
    """Signorini-Coulomb on the candidates, started from `status` (k,) and, should that cycle, from all nodes
    sticking or all open; raises `ContactNotSolved` when none of them ends within `LIMIT` solves and one per
    node.
    """
    most = LIMIT + problem.size
    for start in (status, np.full(problem.size, STICK)):
        try:
            return _active_set(problem, start, most)
        except ContactNotSolved:
            continue
    return _active_set(problem, np.full(problem.size, OPEN), most)


def _active_set(problem: ContactProblem, status: Ints, most: int) -> ContactSolution:
    status = np.where((problem.friction == 0.0) & (status != OPEN), FORWARD, status)
    seen: set[bytes] = set()
    for solves in range(1, most + 1):
        force, relief, extra = problem.solved(status)
        state = problem.start + problem.compliance @ (force + relief)
        if problem.border is not None:
            state = state + problem.border.effect @ extra
        wanted, violation = _next_statuses(problem, status, force, state)
        changes = np.flatnonzero(wanted != status)
        if not changes.size:
            return ContactSolution(force, relief, status, extra, state, solves)
        if status.tobytes() in seen or solves > LIMIT // 3:
            changes = changes[[np.argmax(violation[changes])]] if solves < LIMIT else changes[:1]
        seen.add(status.tobytes())
        status = status.copy()
        status[changes] = wanted[changes]
    raise ContactNotSolved(f"{changes.size} of {problem.size} nodes keep changing")


def solve_pulled(problem: ContactProblem, pull: Pull, status: Ints, snap: bool = False) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted. Where the body could not hold the attraction's fall
    (the pad snaps) the linearised problem has no solution or the wrong one. Then the fall is reduced to what
    it can hold, which goes the right way in small steps, or with `snap` the nodes that are being lost close.
    """
    if not pull.fall.any():
        return solve_contact(problem, status)
    pulled = replace(problem, pull=pull)
    root = np.sqrt(pull.fall)
    gain = root[:, None] * problem.compliance[: problem.size, : problem.size] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return solve_contact(pulled, status)
    for start in (status, _snapped(problem, pull, status)) if snap else (status,):
        try:
            found = _active_set(pulled, start, LIMIT)
        except ContactNotSolved:
            continue
        if _feedback(problem, pull, found.status)[0] < 1.0:
            return found
    # the closed nodes hold a body whose own compliance the attraction has made negative
    ways = (np.full(problem.size, OPEN), status)
    share = STABLE / max(STABLE, *(_feedback(problem, pull, way)[0] for way in ways))
    held = replace(problem, pull=replace(pull, fall=share * pull.fall))
    return replace(solve_contact(held, status), reduced=True)


def _feedback(problem: ContactProblem, pull: Pull, status: Ints) -> tuple[float, Floats]:
    """Largest factor by which the attraction of the open nodes returns to itself, the closed nodes held, and
    the gaps (k,) that grow with it.
    """
    k, C = problem.size, problem.compliance
    free, closed = np.flatnonzero((status == OPEN) & (pull.fall > 0.0)), np.flatnonzero(status != OPEN)
    mode = np.zeros(k)
    if not free.size:
        return 0.0, mode
    held = C[np.ix_(free, free)]
    if closed.size:
        rows = np.concatenate([closed, k + np.flatnonzero(status == STICK)])
        held = held - C[np.ix_(free, rows)] @ np.linalg.solve(C[np.ix_(rows, rows)], C[np.ix_(rows, free)])
    root = np.sqrt(pull.fall[free])
    gain = root[:, None] * held * root
    factors, modes = np.linalg.eigh(0.5 * (gain + gain.T))
    mode[free] = modes[:, -1] / root
    return float(factors[-1]), mode


def _snapped(problem: ContactProblem, pull: Pull, status: Ints) -> Ints:
    """Statuses (k,) with those open nodes closed that move most in the mode that is being lost, if it is on
    its way to the surface.
    """
    factor, mode = _feedback(problem, pull, status)
    drift = solve_contact(problem, status).state[: problem.size] - pull.level
    if factor < 1.0 or drift @ (pull.fall * mode**2) >= 0.0:
        return status
    lost = (np.abs(mode) > 0.5 * np.abs(mode).max()) & (drift < 0.0)
    return np.where(lost, STICK, status)


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
    relief = np.zeros(2 * k)
    if problem.pull is not None:
        relief[active] = -problem.pull.closing[active]
        right -= C[rows] @ relief
        own = np.arange(rows.size - pulled.size, rows.size)
        matrix[own, own] -= 1.0 / problem.pull.fall[pulled]
        right[own] += problem.pull.level[pulled]
    if border is not None:
        row = border.row[:, rows]
        row[:, : active.size] += border.row[:, k + active] * ratio[active]
        matrix = np.block([[matrix, border.effect[rows]], [row, border.pivot]])
        right = np.append(right, border.value - border.row @ relief)
    try:
        x = np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError as error:
        raise ContactNotSolved(str(error)) from error
    force = np.zeros(2 * k)
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

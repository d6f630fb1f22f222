r"""Signorini and Coulomb on a dense compliance, solved exactly, in the plane and in three dimensions, and
under an attraction that decreases with the gap (`evfem.contact.signorini`).

Newton's method on the laws as projections, a primal-dual active set::

    status <- that of the last iteration
    repeat
        solve the equations of `status` (one dense linear system) for forces and extra unknowns
        wanted, z <- projection of each node's forces, gap and slip onto the laws: status and direction
        if wanted = status, and slips are along z: done
        change all violated nodes; from the first statuses on that were visited before, the worst one
            alone; fail where these cycle too

What has not converged is never used. After a cycle it restarts from the projection of the last iteration's
forces after the motion, then with the nodes that touched, and with all nodes, sticking: accidental slips may
keep it from converging, but nothing changes for nodes that stick. In the plane it restarts only if the
compliance is positive definite.

The projections' sources are in `evfem.contact.signorini`; primal-dual active set: S. Hueeber, G. Stadler,
B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572, doi:10.1137/060671061.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints, block
from evfem.common.constants import ACTIVE_SET_LIMIT, STABLE
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    SLIP,
    STICK,
    AttractionStiffness,
    ContactNotSolved,
    ContactProblem,
    ContactSolution,
    Forces,
    Projected,
)
from evfem.contact.statuses import linearised

#: how often the attraction's stiffness is scaled down, by at least which factor, before that of a pad
#: without closed nodes decides
SCALINGS, SOFTER = 2, 1.1


def solve_contact(problem: ContactProblem, status: Ints, force: Floats | None = None) -> ContactSolution:
    """Signorini and Coulomb from `status` (k,) and, in space, forces (m,); raises `ContactNotSolved`."""
    total, most_compliant = 0, status
    for start in _starts(problem, status, np.zeros(problem.start.size) if force is None else force):
        forces, found, solves, most_compliant = _newton(problem, start)
        total += solves
        if forces is not None:
            kept = forces.contact, forces.attraction_loss, found.status, forces.extra, problem.state(forces)
            return ContactSolution(*kept, total)
    keep = int((found.miss > problem.tolerance).sum())
    raise ContactNotSolved(f"{keep} of {problem.size} nodes keep changing", most_compliant)


def _starts(problem: ContactProblem, status: Ints, force: Floats) -> Iterator[Projected]:
    """Start values of Newton's method, tried one after the other until it converges."""
    held, slip = problem.resists, FORWARD if problem.dim == 2 else SLIP
    pressing, shear = np.split(force.reshape(problem.size, -1), [1], axis=1)
    none, touched = np.zeros(problem.size), status != OPEN
    present = np.where(touched & ~held, slip, status)
    if problem.dim == 2 or touched.any():
        yield Projected(pressing[:, 0], shear, present, none)
    if problem.dim == 2 and problem.gives_way:
        return  # solutions from other start values are seldom stable
    count = 0 if problem.extra_unknowns is None else problem.extra_unknowns.right.size
    yield Projected.of(problem, Forces(force, np.zeros_like(force), np.zeros(count)))
    for closed in ([touched] if touched.any() else []) + [np.ones_like(touched)]:
        sticking = np.where(closed, np.where(held, STICK, slip), OPEN)
        yield Projected(none, np.zeros_like(shear), sticking, none)


def _newton(problem: ContactProblem, found: Projected) -> tuple[Forces | None, Projected, int, Ints]:
    """Forces or None, their projections, the number of solves, the most compliant statuses (k,)."""
    visited, single_changes, after_cycling, most_compliant = set[bytes](), set[bytes](), False, found.status
    for solves in range(1, ACTIVE_SET_LIMIT + 1):
        try:
            forces = linearised(problem, found)
        except np.linalg.LinAlgError:
            break
        key = found.status.tobytes()
        after = Projected.of(problem, forces)
        if not (after_cycling or key in visited):
            after = _damped_status_change(found, after)
        changed = after.status != found.status
        rest = changed if problem.dim == 2 else changed | (after.status == SLIP)
        if not np.isfinite(after.miss).all():
            break
        if not (after.miss[rest] > problem.tolerance).any():
            return forces, found, solves, most_compliant
        if changed.any():
            most_compliant = np.where(changed, OPEN, found.status)
            # a cycle: from here on change only the node of the largest violation
            after_cycling = after_cycling or key in visited
            if key in single_changes:  # and that cycles too
                break
            if after_cycling:
                worst = np.where(changed, after.miss, -1.0).argmax()
                status = found.status.copy()
                status[worst] = after.status[worst]
                after = replace(after, status=status)
            (single_changes if after_cycling else visited).add(key)
        found = after
    return None, found, solves, most_compliant


def solve_with_attraction(
    problem: ContactProblem, attraction: AttractionStiffness, status: Ints, force: Floats | None = None
) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted, started from statuses (k,) and forces (m,).

    If the negative stiffness of the attraction exceeds the stiffness of the tissue (the pad snaps), it is
    scaled to `STABLE` of the critical value, which gives small steps in the right direction: with the closed
    nodes fixed, then those that no longer change, at last none. Friction is linearised by tangents first,
    then by secants: the tangent of a law that levels off soon may be too steep.
    """
    laws = (problem,) if problem.secants is None else (problem, problem.with_secants)
    if not attraction.negative_stiffness.any() and not attraction.by_force.acts:
        return _first(laws, status, force)
    root, n = np.sqrt(attraction.negative_stiffness), problem.dim
    gain = root[:, None] * problem.compliance[::n, ::n] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return _first([replace(law, attraction=attraction) for law in laws], status, force)

    def scaled(most: float) -> AttractionStiffness:
        return replace(attraction, negative_stiffness=STABLE / most * attraction.negative_stiffness)

    most = _feedback(problem, attraction, status)
    for law in (*laws, *[laws[-1]] * SCALINGS):
        pulled = scaled(most) if most >= 1.0 else attraction
        try:
            found = solve_contact(replace(law, attraction=pulled), status, force)
            most_compliant = found.status
            same = most < 1.0 and np.array_equal(most_compliant, status)
            if same or _feedback(problem, pulled, most_compliant) < 1.0:
                return replace(found, reduced=most >= 1.0)
        except ContactNotSolved as error:
            most_compliant = error.most_compliant
        most = max(SOFTER * most, float(law is laws[-1]), _feedback(problem, attraction, most_compliant))
    most = max(most, _feedback(problem, attraction, np.full(problem.size, OPEN)))
    last = [replace(law, attraction=scaled(most)) for law in laws]
    return replace(_first(last, status, force), reduced=True)


def _first(problems: Sequence[ContactProblem], status: Ints, force: Floats | None) -> ContactSolution:
    """The solution of the first of these problems that has one."""
    for problem in problems[:-1]:
        with suppress(ContactNotSolved):
            return solve_contact(problem, status, force)
    return solve_contact(problems[-1], status, force)


def _feedback(problem: ContactProblem, attraction: AttractionStiffness, status: Ints) -> float:
    """Largest feedback of the attraction of open nodes on itself for these statuses (k,), the ratio of its
    negative stiffness to that of the body, closed nodes fixed: from 1 on the pad snaps.
    """
    stiffness, opened, n = attraction.negative_stiffness, status == OPEN, problem.dim
    pulled, stick = np.flatnonzero(opened & (stiffness > 0.0)), np.flatnonzero(status == STICK)
    if not pulled.size:
        return 0.0
    gaps, held = (
        n * pulled,
        np.concatenate([n * np.flatnonzero(~opened), *(n * stick + a for a in range(1, n))]),
    )
    left, right = np.zeros((problem.start.size, 0)), np.zeros((0, problem.start.size))
    if problem.extra_unknowns is not None:
        left, right = problem.extra_unknowns.followed

    def coupled(compliance: Floats, rows: Ints, columns: Ints) -> Floats:
        return block(compliance, rows, columns) - left[rows] @ right[:, columns]

    C, under_forces = problem.compliance, problem.under_forces
    free = coupled(C, gaps, gaps)
    if held.size:
        back = np.linalg.solve(coupled(under_forces, held, held), coupled(C, held, gaps))
        free = free - coupled(C, gaps, held) @ back
    root = np.sqrt(stiffness[pulled])
    gain = root[:, None] * free * root
    return float(np.linalg.eigvalsh(0.5 * (gain + gain.T))[-1])


def _damped_status_change(before: Projected, after: Projected) -> Projected:
    """`after` with damped changes of status: in the plane closing nodes slip first, and slips change their
    side through stick. That is faster, but under a steep bound of friction a node may stick that can
    neither slip nor open.
    """
    if after.z.shape[1] == 2:
        return after
    trial = after.z[:, 0]
    enters = (before.status == OPEN) & (after.status == STICK) & (trial != 0.0)
    turns = (before.status >= SLIP) & (after.status >= SLIP) & (before.status != after.status)
    slip = np.where(trial < 0.0, FORWARD, BACKWARD)
    return replace(after, status=np.where(enters, slip, np.where(turns, STICK, after.status)))

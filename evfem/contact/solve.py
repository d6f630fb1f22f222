r"""Signorini and Coulomb on a dense compliance, solved exactly, in the plane and in three dimensions, and
under an attraction that weakens with the gap (`evfem.contact.signorini`).

Newton's method on the laws as projections, a primal-dual active set::

    status <- that of the last iteration
    repeat
        solve the equations of `status` (one dense linear system) for forces and extra unknowns
        wanted, z <- the status and direction that the laws make of each node's forces, gap and slip
        if wanted = status, and slips go along z: done
        change all violated nodes; the worst one alone where these statuses have been met before,
            and always after many solves; give up where these go round in a circle

No constant has to be chosen. What has not converged is never used. In three dimensions it begins again from
what the laws make of the last iteration's forces after the motion, then with the nodes that touched, and
with all nodes, sticking: slips found by chance may drive it about, but nothing changes for nodes that stick.

If the attraction weakens with the gap faster than the tissue stiffens, the linear problem has no
solution, or the wrong one; its negative stiffness is then scaled to 0.9 of the critical value
(`solve_with_attraction`).

Sources: P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353,
doi:10.1016/0045-7825(91)90022-X (projections and their linearisation); S. Hueeber, G. Stadler and
B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572,
doi:10.1137/060671061 (primal-dual active set).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import ACTIVE_SET_LIMIT, ROUNDING, STABLE
from evfem.contact.attracted import AttractionStiffness, feedback
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    SLIP,
    STICK,
    ContactNotSolved,
    ContactProblem,
    ContactSolution,
    Forces,
    Projected,
    linearised,
)


def solve_contact(problem: ContactProblem, status: Ints, force: Floats | None = None) -> ContactSolution:
    """Signorini and Coulomb, started from `status` (k,) and, in three dimensions, contact forces (m,); raises
    `ContactNotSolved` where no start ends.
    """
    total = 0
    for start in _starts(problem, status, np.zeros(problem.start.size) if force is None else force):
        forces, found, solves = _newton(problem, start)
        total += solves
        if forces is not None:
            return ContactSolution.of(problem, forces, found.status, total)
    keep = int((found.miss > ROUNDING).sum())
    raise ContactNotSolved(f"{keep} of {problem.size} nodes keep changing")


def _starts(problem: ContactProblem, status: Ints, force: Floats) -> Iterator[Projected]:
    """What Newton's method starts from, one after the other until it ends."""
    held, slip = problem.resists, FORWARD if problem.dim == 2 else SLIP
    pressing, shear = np.split(force.reshape(problem.size, -1), [1], axis=1)
    none, touched = np.zeros(problem.size), status != OPEN
    present = np.where(touched & ~held, slip, status)
    if problem.dim == 2 or touched.any():
        yield Projected(pressing[:, 0], shear, present, none)
    if problem.dim == 2:
        return
    count = 0 if problem.extra_unknowns is None else problem.extra_unknowns.right.size
    yield Projected.of(problem, Forces(force, np.zeros_like(force), np.zeros(count)))
    for closed in ([touched] if touched.any() else []) + [np.ones_like(touched)]:
        sticking = np.where(closed, np.where(held, STICK, slip), OPEN)
        yield Projected(none, np.zeros_like(shear), sticking, none)


def _newton(problem: ContactProblem, found: Projected) -> tuple[Forces | None, Projected, int]:
    """The forces, or None where it does not end within `ACTIVE_SET_LIMIT` solves and one per node, what the
    laws make of them, and the number of solves.
    """
    met, alone = set[bytes](), set[bytes]()
    for solves in range(1, ACTIVE_SET_LIMIT + problem.size + 1):
        try:
            forces = linearised(problem, found)
        except np.linalg.LinAlgError:
            break
        after = _passing(found, Projected.of(problem, forces))
        changed = after.status != found.status
        rest = changed if problem.dim == 2 else changed | (after.status == SLIP)
        if not np.isfinite(after.miss).all():
            break
        if not (after.miss[rest] > ROUNDING).any():
            return forces, found, solves
        if changed.any():
            late, key = solves > ACTIVE_SET_LIMIT // 3, found.status.tobytes()
            if late and key in alone:
                break
            if late or key in met:
                worst = np.where(changed, after.miss, -1.0).argmax()
                status = found.status.copy()
                status[worst] = after.status[worst]
                after = replace(after, status=status)
            (alone if late else met).add(key)
        found = after
    return None, found, solves


def solve_with_attraction(
    problem: ContactProblem, attraction: AttractionStiffness, status: Ints, force: Floats | None = None
) -> ContactSolution:
    """Contact of a pad whose open nodes are attracted, started from statuses (k,) and forces (m,).

    If the attraction weakens with the gap faster than the tissue stiffens (the pad snaps), the
    linear problem has no solution or the wrong one. Its negative stiffness is then scaled to
    `STABLE` of the critical value, which goes the right way in small steps: of the body as its
    closed nodes hold it, or where that does not do, of the much softer one without them.
    """
    if not attraction.negative_stiffness.any() and attraction.roughness is None:
        return solve_contact(problem, status, force)
    attracted = replace(problem, attraction=attraction)
    root, n = np.sqrt(attraction.negative_stiffness), problem.dim
    gain = root[:, None] * problem.compliance[::n, ::n] * root
    if np.abs(gain).sum(axis=1).max() < STABLE:
        return solve_contact(attracted, status, force)
    with suppress(ContactNotSolved):
        found = solve_contact(attracted, status, force)
        if _feedback(problem, attraction, found.status) < 1.0:
            return found

    def scaled(most: float) -> AttractionStiffness:
        return replace(attraction, negative_stiffness=STABLE / most * attraction.negative_stiffness)

    most = max(STABLE, _feedback(problem, attraction, status))
    with suppress(ContactNotSolved):
        found = solve_contact(replace(problem, attraction=scaled(most)), status, force)
        if _feedback(problem, scaled(most), found.status) < 1.0:
            return replace(found, reduced=True)
    most = max(most, _feedback(problem, attraction, np.full(problem.size, OPEN)))
    return replace(solve_contact(replace(problem, attraction=scaled(most)), status, force), reduced=True)


def _feedback(problem: ContactProblem, attraction: AttractionStiffness, status: Ints) -> float:
    """`feedback` where the nodes have these statuses (k,)."""
    stiffness, opened, n = attraction.negative_stiffness, status == OPEN, problem.dim
    gaps, stick = np.flatnonzero(opened & (stiffness > 0.0)), np.flatnonzero(status == STICK)
    held = np.concatenate([n * np.flatnonzero(~opened), *(n * stick + a for a in range(1, n))])
    taken: Any = 0.0 if problem.extra_unknowns is None else problem.extra_unknowns.followed
    return feedback(problem.compliance - taken, problem.under_forces - taken, n * gaps, held, stiffness[gaps])


def _passing(before: Projected, after: Projected) -> Projected:
    """The same, in the plane with nodes that pass through slip as they close, one that sticks beside a
    pulling shear force would seem to open, and through stick from one slip to the other.
    """
    if after.z.shape[1] == 2:
        return after
    way = after.z[:, 0]
    enters = (before.status == OPEN) & (after.status == STICK) & (way != 0.0)
    turns = (before.status >= SLIP) & (after.status >= SLIP) & (before.status != after.status)
    slip = np.where(way < 0.0, FORWARD, BACKWARD)
    return replace(after, status=np.where(enters, slip, np.where(turns, STICK, after.status)))

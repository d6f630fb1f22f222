r"""Signorini and Coulomb on a dense compliance, solved exactly: an active set in the plane, projections in
three dimensions, and an attraction that weakens with the gap (`evfem.contact.signorini`).

In the plane, a primal-dual active set::

    status <- that of the last iteration
    repeat
        solve the equations of `status` (one dense linear system) for forces and extra unknowns
        wanted <- the status that each node's forces, gap and slip ask for
        if wanted = status: done
        change all violated nodes; the worst one alone where these statuses have been met before,
            and always after many solves; give up where these go round in a circle

A node goes from open to slip the way it is moving, from slip to open when it pulls, from stick to
slip with the sign of its force when it leaves the cone, from slip to stick (never straight to the
other slip) when it moves along its own friction. It passes through slip between open and stick:
one that sticks beside a pulling shear force would seem to open. No constant has to be chosen. What
has not converged is never used.

In three dimensions::

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

If the attraction weakens with the gap faster than the tissue stiffens, the linear problem has no
solution, or the wrong one; its negative stiffness is then scaled to 0.9 of the critical value
(`solve_with_attraction`).

Source: S. Hueeber, G. Stadler and B. Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572,
doi:10.1137/060671061 (primal-dual active set).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import (
    ACTIVE_SET_LIMIT,
    DISC_FALL,
    DISC_NEWTON,
    DISC_ROUNDING,
    DISC_ROUNDS,
    DISC_SWEEPS,
    ROUNDING,
    STABLE,
)
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
    projected,
    solve_statuses,
)
from evfem.contact.sweeps import sweeps


def solve_contact(problem: ContactProblem, status: Ints, force: Floats | None = None) -> ContactSolution:
    """Signorini and Coulomb, started from `status` (k,) in the plane, from contact forces (m,) or none in
    three dimensions; raises `ContactNotSolved`.
    """
    if problem.dim == 2:
        return _active_set(problem, status)
    return _by_projection(problem, np.zeros(problem.start.size) if force is None else force)


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


def _active_set(problem: ContactProblem, status: Ints) -> ContactSolution:
    """In the plane, from statuses (k,); raises `ContactNotSolved` when it does not end within
    `ACTIVE_SET_LIMIT` solves and one per node.
    """
    status = np.where(~problem.resists & (status != OPEN), FORWARD, status)
    met, alone, violated = set[bytes](), set[bytes](), np.zeros(0, dtype=np.int64)
    for solves in range(1, ACTIVE_SET_LIMIT + problem.size + 1):
        against = (status == BACKWARD).astype(float) - (status == FORWARD)
        try:
            forces = solve_statuses(problem, status, against[:, None])
        except np.linalg.LinAlgError as error:
            raise ContactNotSolved(str(error)) from error
        found = ContactSolution.of(problem, forces, status, solves)
        wanted, violation = _next_statuses(problem, found)
        violated = np.flatnonzero(wanted != status)
        if not violated.size:
            return found
        late, key = solves > ACTIVE_SET_LIMIT // 3, status.tobytes()
        if late and key in alone:
            break
        changed = violation.argmax() if late or key in met else violated
        (alone if late else met).add(key)
        status = status.copy()
        status[changed] = wanted[changed]
    raise ContactNotSolved(f"{violated.size} of {problem.size} nodes keep changing")


def _next_statuses(problem: ContactProblem, found: ContactSolution) -> tuple[Ints, Floats]:
    """Statuses that a solution in the plane asks for, and how far each node violates its own."""
    k, resists, status = problem.size, problem.resists, found.status
    (normal, shear), (gap, slip) = found.force.reshape(-1, 2).T, found.state.reshape(-1, 2).T
    own_compliance = np.maximum(np.abs(np.diagonal(problem.under_forces)[::2]), 1e-300)
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


def _by_projection(problem: ContactProblem, force: Floats) -> ContactSolution:
    """In three dimensions, from contact forces (m,); raises `ContactNotSolved` when Newton's method ends from
    none of its starts.
    """
    count = 0 if problem.extra_unknowns is None else problem.extra_unknowns.right.size
    given = Forces(force.copy(), np.zeros_like(force), np.zeros(count))
    best, miss, solves, nowhere = given, np.inf, 0, ""
    for forces, found in _starts(problem, given):
        forces, after, tries = _newton(problem, forces, found)
        solves += tries
        if after.miss <= DISC_ROUNDING:
            return ContactSolution.of(problem, forces, after.status, solves)
        if after.miss < miss:
            best, miss = forces, after.miss
    for attempt in range(1, DISC_ROUNDS):
        try:
            best = sweeps(problem, best, DISC_SWEEPS << attempt)
        except ContactNotSolved as error:
            nowhere = f", {error}"
        best, after, tries = _newton(problem, best, projected(problem, best), damped=True)
        solves += tries
        if after.miss <= DISC_ROUNDING:
            return ContactSolution.of(problem, best, after.status, solves)
        miss = min(miss, after.miss)
        if nowhere:
            break
    raise ContactNotSolved(f"forces miss the laws by {miss:.1e}{nowhere}")


def _starts(problem: ContactProblem, given: Forces) -> Iterator[tuple[Forces, Projected]]:
    """Where Newton's method starts, one after the other until it ends: forces, and what the laws make
    of them.
    """
    touched, extra = given.contact[::3] > 0.0, problem.extra_unknowns
    # sweeps leave the unknowns as they are: a voltage that keeps a charge would be one that is given
    if not touched.any() and not (extra is not None and extra.conditioned.size):
        with suppress(ContactNotSolved):
            given = sweeps(problem, given, DISC_SWEEPS)
    if problem.yields:
        yield given, projected(problem, given)
    if touched.any():
        yield given, _as_they_are(problem, given)
    if not problem.yields:
        yield given, projected(problem, given)
    if touched.any():
        yield given, _sticking(problem, touched)
    yield given, _sticking(problem, np.ones_like(touched))


def _as_they_are(problem: ContactProblem, given: Forces) -> Projected:
    """The statuses that forces at hand have by themselves, whatever moves now."""
    force = given.contact.reshape(-1, 3)
    p, z = force[:, 0], force[:, 1:]
    held = (np.hypot(*z.T) < (1.0 - ROUNDING) * problem.limit(p)) & problem.resists
    return Projected(p, z, np.where(p > 0.0, np.where(held, STICK, SLIP), OPEN), np.inf)


def _sticking(problem: ContactProblem, closed: Any) -> Projected:
    """As if the laws had made these nodes (k,) stick, the others open."""
    status = np.where(closed, np.where(problem.resists, STICK, SLIP), OPEN)
    return Projected(np.where(closed, 1.0, -1.0), np.zeros((problem.size, 2)), status, np.inf)


def _newton(
    problem: ContactProblem, forces: Forces, found: Projected, damped: bool = False
) -> tuple[Forces, Projected, int]:
    """Forces after Newton's iterations, what the laws make of them, and the number of solves; the
    best ones where it does not end. It starts from forces and what the laws made of them; `damped`
    steps are the best of 1, 1/2, 1/4 ... of a whole one.
    """
    best = forces, found
    for tries in range(1, DISC_NEWTON * (2 if damped else 1) + 1):
        try:
            new = linearised(problem, found)
        except np.linalg.LinAlgError:
            return *best, tries
        after = projected(problem, new)
        if damped and not after.miss < DISC_FALL * found.miss:
            parts = [forces.towards(new, 0.5**n) for n in range(5)]
            new, after = min(
                ((part, projected(problem, part)) for part in parts), key=lambda one: one[1].miss
            )
        forces, found = new, after
        if not np.isfinite(found.miss):
            return *best, tries
        if found.miss < best[1].miss:
            best = forces, found
        if found.miss <= DISC_ROUNDING:
            return forces, found, tries
    return *best, tries

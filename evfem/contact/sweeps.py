r"""Sweeps over the nodes of a contact problem in three dimensions: block Gauss-Seidel.

Every node in turn takes the forces that its own laws ask for while all others stay: a contact force
projected with the node's own compliance (`evfem.contact.signorini`), or a gap with what its attraction
is there. Sweeps alone converge in 500 to 1,500 rounds; a few lead Newton's method to its start
(`evfem.contact.solve`). Where the attraction makes a node's own compliance negative, pressing it
opens no gap, and sweeps cannot begin; where it makes the compliance indefinite, they diverge.

Source: M. Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235,
doi:10.1016/S0045-7825(98)00383-1 (non-smooth contact dynamics).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import DIVERGED, STABLE
from evfem.contact.signorini import ContactNotSolved, ContactProblem, Forces


def sweeps(problem: ContactProblem, forces: Forces, count: int) -> Forces:
    """Forces after so many sweeps of block Gauss-Seidel; the extra unknowns stay.

    Raises `ContactNotSolved` where a node's own compliance is not positive, and when forces diverge.
    """
    if not problem.yields:
        raise ContactNotSolved("nodes give way against their own forces")
    start = problem.start
    if problem.extra_unknowns is not None:
        start = start + problem.extra_unknowns.columns @ forces.extra
    nodes = [_Node.of(problem, i, start) for i in range(problem.size)]
    contact, drop = forces.contact.copy(), forces.drop.copy()
    total = contact + drop
    most = DIVERGED * max(np.abs(total).max(), (np.abs(start) / np.diagonal(problem.compliance)).max())
    for _ in range(count):
        for node in nodes:
            own = node.place
            now = contact[own].tolist()
            new, fallen = node.solve((node.rows @ total).tolist(), now, float(drop[own.start]))
            contact[own], drop[own.start] = new, fallen
            total[own] = new
            total[own.start] += fallen
        if not np.abs(total).max() <= most:
            raise ContactNotSolved("sweeps diverge")
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
    cohesion: float
    weakening: float
    reference: float
    gain: float

    @classmethod
    def of(cls, problem: ContactProblem, i: int, start: Floats) -> _Node:
        place, known = slice(3 * i, 3 * i + 3), problem.attraction
        rows = problem.compliance[place]
        own = rows[:, place]
        shear = float(np.linalg.eigvalsh(0.5 * (own[1:, 1:] + own[1:, 1:].T))[-1])
        pull = [0.0, 0.0, 0.0]
        if known is not None:
            pull = [
                float(a[i]) for a in (known.negative_stiffness, known.reference_gap, known.gain_on_closing)
            ]
        friction = float(problem.friction[i])
        cohesion = 0.0 if problem.cohesion is None else float(problem.cohesion[i])
        return cls(place, rows, start[place].tolist(), own.tolist(), shear, friction, cohesion, *pull)

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
            size, limit = (z1 * z1 + z2 * z2) ** 0.5, self.friction * n + (self.cohesion if n > 0.0 else 0.0)
            part = 1.0 if size <= limit else limit / size
            t1, t2 = part * z1, part * z2
        return [n, t1, t2], -self.gain

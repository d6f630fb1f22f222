r"""Contact with Coulomb friction of nodes on a dense compliance in three dimensions: the problem,
and whether forces, gaps and slips obey its laws. The twin of `evfem.contact.signorini`.

A node has a normal n and two tangents; components are ordered per node (n, t1, t2). With the
contact forces :math:`\lambda` the new gaps and slips are :math:`v = (g, s) = v_0 + W\lambda + e\,d`,
where d are optional extra unknowns (the bone's travel under a prescribed force, for example) with
the equations :math:`r\lambda + \rho\,d = b`. Signorini and Coulomb's disc ask, per node, for

.. math:: \lambda_n = \max(0, p), \quad \lambda_t = \mathrm{proj}_{\mu\lambda_n}(z), \qquad
          p = \lambda_n - r_n g, \quad z = \lambda_t - r_t s,

the same for all positive r; taken is the inverse of the node's own compliance. Where the attraction
grows with areas that follow the nodes, that may vanish or be negative: r is then bounded by what is
usual among the nodes, and g = 0 to rounding stays a small p. A node is open if
:math:`p \le 0`, sticks if :math:`|z| \le \mu p`, and slips else. A law of friction other than Coulomb's,
linearised (`evfem.surface.friction`), makes the disc of a closed node :math:`\mu\lambda_n + c` wide, with
a `cohesion` c. The attraction of an open node
weakens with its gap; its drop is a force of its own, as in `evfem.contact.signorini`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import DISC_OWN
from evfem.contact.attracted import AttractionStiffness
from evfem.contact.signorini import OPEN, STICK, ExtraUnknowns

#: status of a node that slips in any direction
SLIP = 2


@dataclass(frozen=True)
class DiscProblem:
    """Gaps and slips without contact forces (3 k,), compliance (3 k, 3 k), both per node (n, t1,
    t2), friction coefficients (k,), and optional extra unknowns and attraction as in
    `evfem.contact.signorini`; `cohesion` (k,) in N is what friction of closed nodes has at no force.
    """

    start: Floats
    compliance: Floats
    friction: Floats
    extra_unknowns: ExtraUnknowns | None = None
    attraction: AttractionStiffness | None = None
    cohesion: Floats | None = None

    def limit(self, pressing: Floats) -> Floats:
        """Largest shear forces (k,) under pressing forces p (k,)."""
        limit = self.friction * np.maximum(pressing, 0.0)
        return limit if self.cohesion is None else limit + np.where(pressing > 0.0, self.cohesion, 0.0)

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size

    @property
    def holds(self) -> Any:
        """Which nodes have friction (k,) bool."""
        return self.friction > 0.0 if self.cohesion is None else (self.friction > 0.0) | (self.cohesion > 0.0)

    @cached_property
    def yields(self) -> bool:
        """Whether every node gives way to forces of its own, in their direction."""
        return bool((np.diagonal(self.compliance) > 0.0).all())

    @cached_property
    def own(self) -> tuple[Floats, Floats]:
        """Size of each node's own compliance along the normal and, the larger one, along the tangents,
        (k,), nowhere less than the fraction `DISC_OWN` of the mean.
        """
        i = 3 * np.arange(self.size)
        C = self.compliance
        a, b = C[i + 1, i + 1], C[i + 2, i + 2]
        c = 0.5 * (C[i + 1, i + 2] + C[i + 2, i + 1])
        shear = 0.5 * np.abs(a + b) + np.hypot(0.5 * (a - b), c)
        normal, shear = (np.maximum(a, max(DISC_OWN * a.mean(), 1e-300)) for a in (np.abs(C[i, i]), shear))
        return normal, shear

    def state(self, forces: Forces) -> Floats:
        """Gaps and slips (3 k,) under these forces."""
        v = self.start + self.compliance @ (forces.contact + forces.drop)
        return v if self.extra_unknowns is None else v + self.extra_unknowns.columns @ forces.extra


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces and drops of the attraction (3 k,), and extra unknowns (p,)."""

    contact: Floats
    drop: Floats
    extra: Floats


@dataclass(frozen=True)
class DiscSolution:
    """Contact forces and drops of the attraction (3 k,), statuses (k,), the extra unknowns (p,),
    new gaps and slips (3 k,), the number of dense solves, and whether the negative stiffness had
    to be scaled down.
    """

    force: Floats
    attraction_drop: Floats
    status: Ints
    extra: Floats
    state: Floats
    solves: int
    reduced: bool = False


@dataclass(frozen=True, eq=False)
class Projected:
    """What the laws make of forces, gaps and slips: p and z of every node, (k,) and (k, 2), its
    status (k,), and by how much a force misses them, relative to the largest one.
    """

    p: Floats
    z: Floats
    status: Ints
    miss: float


def projected(problem: DiscProblem, forces: Forces, state: Floats) -> Projected:
    """Forces, gaps and slips against the laws of Signorini and Coulomb."""
    normal_own, shear_own = problem.own
    force, v = forces.contact.reshape(-1, 3), state.reshape(-1, 3)
    p = force[:, 0] - v[:, 0] / normal_own
    z = force[:, 1:] - v[:, 1:] / shear_own[:, None]
    limit, size = problem.limit(p), np.hypot(*z.T)
    status = np.where(p <= 0.0, OPEN, np.where((size <= limit) & problem.holds, STICK, SLIP))
    part = limit / np.maximum(size, np.maximum(limit, 1e-300))
    shear = z * np.where(status == STICK, 1.0, part)[:, None]
    shear[status == OPEN] = 0.0
    wanted = np.column_stack([np.maximum(p, 0.0), shear])
    drop = _drop(problem, status, v[:, 0]) - forces.drop[::3]
    held = 1e-3 * np.abs(v[:, 0] / normal_own)  # what would close the gap, where no node presses
    scale = max(1e-300, *(np.abs(part).max(initial=0.0) for part in (wanted, force, forces.drop, held)))
    miss = max(np.abs(wanted - force).max(initial=0.0), np.abs(drop).max(initial=0.0))
    if problem.extra_unknowns is not None:
        miss = max(miss, np.abs(_lacking(problem.extra_unknowns, forces, scale)).max(initial=0.0))
    return Projected(p, z, status, float(miss / scale))


def _drop(problem: DiscProblem, status: Ints, gap: Floats) -> Floats:
    """Drop of the attraction (k,) of nodes of these statuses at these gaps."""
    if problem.attraction is None:
        return np.zeros(problem.size)
    known = problem.attraction
    weaker = known.negative_stiffness * (gap - known.reference_gap)
    return np.where(status == OPEN, weaker, -known.gain_on_closing)


def _lacking(extra: ExtraUnknowns, forces: Forces, scale: float) -> Floats:
    """What the equations lack (p,), a condition of its own as a share of its terms times the `scale`."""
    terms = np.hstack([extra.rows * (forces.contact + forces.drop), extra.pivot * forces.extra])
    lacking, own = extra.right - terms.sum(axis=1), extra.conditioned
    size = np.abs(terms[own]).sum(axis=1) + np.abs(extra.right[own])
    lacking[own] *= scale / np.maximum(size, 1e-300)
    return np.asarray(lacking)

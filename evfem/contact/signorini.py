r"""Unilateral contact with Coulomb friction on the dense compliance of the contact candidates: the problem
and its laws.

A node has a normal n and d tangents, one in the plane and two in three dimensions; components are ordered per
node. With the contact forces :math:`\lambda` the new gaps and slips are :math:`v = (g, s) = v_0 + C\lambda +
e\,d`, where d are extra unknowns (the bone's travel under a prescribed force) with the equations
:math:`r\lambda + \rho\,d = b`. Signorini and Coulomb require, per node, one of

======  ==============================  =====================================================
status  equations                       stays if
======  ==============================  =====================================================
OPEN    lam_n = 0, lam_t = 0            g >= 0
STICK   g = 0, s = 0                    lam_n >= 0 and abs(lam_t) <= mu lam_n
slip    g = 0, lam_t = mu lam_n e       lam_n >= 0, s along -e
======  ==============================  =====================================================

In the plane a slip is FORWARD, e = -1, or BACKWARD, e = +1. In three dimensions it is SLIP, along
e = z/abs(z), and the direction is an unknown of its own (`evfem.contact.statuses`). The same laws as
projections:

.. math:: \lambda_n = \max(0, p), \quad \lambda_t = \mathrm{proj}_{\mu\lambda_n}(z), \qquad
          p = \lambda_n - r_n g, \quad z = \lambda_t - r_t s,

for any positive r; here the inverse of the node's own compliance, bounded by a fraction of the mean over the
nodes where it vanishes or is negative.

The attraction of an open node decreases with its gap, a negative stiffness k_e: the loss of attraction is one
more unknown, f = k_e (g - g_ref). A closed node needs none, as its gap is known. An attraction may
also grow with the contact force (`evfem.contact.byforce`): a closed node then loads the body with
(1 - kappa) lam_n, and one that opens loses the gain by its contact force.

A bound of friction that is not proportional to the contact force (`evfem.surface.friction`) is linearised:
mu lam_n + c, with `cohesion` c, replaces mu lam_n.

Sources: A. Klarbring, Comput. Methods Appl. Mech. Eng. 58 (1986) 175, doi:10.1016/0045-7825(86)90095-2 (the
frictional problem as complementarity); P. Alart and A. Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991)
353, doi:10.1016/0045-7825(91)90022-X (projections and their linearisation).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import DenseSolver, Floats, Ints, product
from evfem.common.constants import DISC_OWN, ROUNDING
from evfem.contact.byforce import OF_GAP_ALONE, OfGapAlone


@dataclass(frozen=True)
class AttractionStiffness:
    """Linearised attraction of every node: it decreases by `negative_stiffness` (k,) per unit of gap from its
    value at `reference_gap` (k,), is larger by `gain_on_closing` (k,) at g = 0, and depends on contact there.
    """

    negative_stiffness: Floats
    reference_gap: Floats
    gain_on_closing: Floats
    by_force: OfGapAlone = OF_GAP_ALONE


#: of a node; `FORWARD` or `BACKWARD` in the plane where it slips, `SLIP` in three dimensions
OPEN, STICK, FORWARD, BACKWARD, SLIP = 0, 1, 2, 3, 2
NO_NODES: Ints = np.zeros(0, dtype=np.int64)


class ContactNotSolved(ArithmeticError):
    """The sub-problem cycles: no solution near, or several. `most_compliant` (k,): the last statuses, with
    the cycling nodes open.
    """

    def __init__(self, message: str, most_compliant: Ints = NO_NODES) -> None:
        super().__init__(message)
        self.most_compliant = most_compliant


class Unstable(ContactNotSolved):
    """No solution because the stiffness of the body is not positive definite."""


@dataclass(frozen=True)
class ExtraUnknowns:
    """p extra unknowns d: gaps and slips per unit of them, `columns` (m, p) with m = (1 + d) k, and their
    equations, `rows` (p, m) lam + `pivot` (p, p) d = `right` (p,). Those `conditioned` respond to the body
    in its stability analysis too, as a voltage at constant charge.
    """

    columns: Floats
    rows: Floats
    pivot: Floats
    right: Floats
    conditioned: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    @property
    def followed(self) -> tuple[Floats, Any]:
        """Factors (m, c), (c, m) of the reduction of the compliance by the conditioned unknowns."""
        some = self.conditioned
        return self.columns[:, some], np.linalg.solve(self.pivot[np.ix_(some, some)], self.rows[some])


@dataclass(frozen=True, eq=False)
class Forces:
    """Contact forces and losses of attraction (m,), and extra unknowns (p,)."""

    contact: Floats
    attraction_loss: Floats
    extra: Floats


@dataclass(frozen=True)
class ContactProblem:
    """Gaps and slips without contact forces (m,), m = (1 + d) k, and compliance (m, m), both per node
    (n, t[, t2]), friction coefficients (k,), optional extra_unknowns and attraction, the friction bound at
    zero contact force, `cohesion` (k,) in N/mm (N in three dimensions), and the compliance of the interface
    to contact forces, not to attraction, `give` (m,) in mm per N/mm. `secants` (k,): secant friction
    coefficients that replace tangent and cohesion of a friction law. The laws hold to `tolerance`, relative
    to the largest force; `dense` solves.
    """

    start: Floats
    compliance: Floats
    friction: Floats
    extra_unknowns: ExtraUnknowns | None = None
    attraction: AttractionStiffness | None = None
    cohesion: Floats | None = None
    give: Floats | None = None
    secants: Floats | None = None
    tolerance: float = ROUNDING
    dense: DenseSolver = field(default_factory=DenseSolver)

    @property
    def with_secants(self) -> ContactProblem:
        """The problem with secant friction coefficients instead of the tangents of the friction laws."""
        assert self.secants is not None
        return replace(self, friction=self.secants, cohesion=None, secants=None)

    @property
    def size(self) -> int:
        """Number of candidate nodes k."""
        return self.friction.size

    @property
    def dim(self) -> int:
        """Components of a node, 1 + d."""
        return self.start.size // self.friction.size

    @cached_property
    def under_forces(self) -> Floats:
        """Compliance (m, m) of body and interface to contact forces."""
        return self.compliance if self.give is None else self.compliance + np.diag(self.give)

    @cached_property
    def gives_way(self) -> bool:
        """Whether the compliance is not positive definite: the body yields against its load."""
        try:
            twice = np.add(self.under_forces, self.under_forces.T, dtype=float)
            return not np.linalg.cholesky(twice).size
        except np.linalg.LinAlgError:
            return True

    @property
    def resists(self) -> Any:
        """Nodes with friction, (k,) bool."""
        rubs = self.friction > 0.0
        return rubs if self.cohesion is None else rubs | (self.cohesion > 0.0)

    def limit(self, normal: Floats) -> Floats:
        """Largest shear force (k,) under pressing forces (k,)."""
        limit = self.friction * normal
        return limit if self.cohesion is None else limit + self.cohesion

    @cached_property
    def own(self) -> tuple[Floats, Floats]:
        """Diagonal compliance of each node, normal and tangent, (k,), at least `DISC_OWN` of the mean."""
        every, n = np.arange(self.size), self.dim
        C = self.under_forces.reshape(self.size, n, self.size, n)[every, :, every].astype(float)
        shear = np.abs(C[:, 1, 1])
        if n == 3:
            a, b, c = C[:, 1, 1], C[:, 2, 2], 0.5 * (C[:, 1, 2] + C[:, 2, 1])
            shear = 0.5 * np.abs(a + b) + np.hypot(0.5 * (a - b), c)
        normal, shear = (np.maximum(a, max(DISC_OWN * a.mean(), 1e-300)) for a in (np.abs(C[:, 0, 0]), shear))
        return normal, shear

    def state(self, forces: Forces) -> Floats:
        """Gaps and slips (m,) under these forces."""
        v = self.start + product(self.compliance, forces.contact + forces.attraction_loss)
        if self.give is not None:
            v = v + self.give * forces.contact
        return v if self.extra_unknowns is None else v + self.extra_unknowns.columns @ forces.extra


@dataclass(frozen=True)
class ContactSolution:
    """Contact forces (m,), losses of attraction (m,), statuses (k,), the extra unknowns (p,), new gaps and
    slips (m,), the number of dense solves, and whether the negative stiffness had to be scaled down.
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
    """Projections of forces, gaps and slips onto the laws: p and z of every node, (k,) and (k, d), its status
    (k,), and the violation of the laws, `miss` (k,), relative to the largest force.
    """

    p: Floats
    z: Floats
    status: Ints
    miss: Floats

    @classmethod
    def of(cls, problem: ContactProblem, forces: Forces) -> Projected:
        """Of these forces."""
        state, (normal_own, shear_own) = problem.state(forces), problem.own
        force, v, attraction_loss = (
            each.reshape(problem.size, -1) for each in (forces.contact, state, forces.attraction_loss)
        )
        # trial forces: those that would close gap and slip if each node had its own compliance alone
        p = force[:, 0] - v[:, 0] / normal_own
        z = force[:, 1:] - v[:, 1:] / shear_own[:, None]
        limit, size = np.where(p > 0.0, problem.limit(p), 0.0), sizes(z)
        slip = np.where(z[:, 0] < 0.0, FORWARD, BACKWARD) if problem.dim == 2 else SLIP
        status = np.where(p <= 0.0, OPEN, np.where((size <= limit) & problem.resists, STICK, slip))
        # radial return onto the disc of friction: sticking keeps z, slipping scales it to the limit
        fraction = np.where(status == STICK, 1.0, limit / np.maximum(size, np.maximum(limit, 1e-300)))
        wanted = np.column_stack([np.maximum(p, 0.0), z * np.where(status == OPEN, 0.0, fraction)[:, None]])
        closing_force = 1e-3 * v[:, 0] / normal_own  # what would close the gap, where no node presses
        scale = max(
            1e-300, *(np.abs(one).max(initial=0.0) for one in (wanted, force, attraction_loss, closing_force))
        )
        return cls(p, z, status, np.abs(wanted - force).max(axis=1) / scale)


def side(status: Ints) -> Floats:
    """Side (k, 1) along which friction acts in the plane, against the slip; 0 where nothing slips."""
    return np.subtract(status == BACKWARD, status == FORWARD, dtype=float)[:, None]


def sizes(vectors: Floats) -> Floats:
    """Lengths (k,) of vectors (k, d) in the plane of contact."""
    return np.asarray(np.hypot(vectors[:, 0], vectors[:, 1] if vectors.shape[1] > 1 else 0.0))

r"""Maxwell branches at finite strain: the overstress of tissue that relaxes, over one step in closed form.

A branch has the modulus m, a share of the law's initial shear modulus at rest, the relaxation time
:math:`\tau` and an inner variable :math:`C_i` (symmetric, of determinant 1). With
:math:`\bar C = J^{-2/3} F^T F`, J the point's own det F and F33 = 1 in the plane,

.. math:: \psi_i = \tfrac{m}{2}(\mathrm{tr}\,\bar C C_i^{-1} - 3), \qquad
          \dot C_i = [\bar C - \tfrac{1}{3}\mathrm{tr}(\bar C C_i^{-1})\,C_i]/\tau, \qquad
          D = \tfrac{m}{2\tau}\,\mathrm{tr}[\mathrm{dev}(C_i^{-1}\bar C)^2] \ge 0 .

A step of :math:`x = \Delta t/\tau` ends at :math:`C_i = M/\det(M)^{1/3}`, M = B + a C with

.. math:: B = e^{-y} C_{i,0} + \frac{f - e^{-y}}{h}\,\bar C_0, \quad a = \frac{1 - f}{h}, \quad
          f = \frac{1 - e^{-y}}{y}, \quad y = h x, \quad h = \tfrac{1}{3}\mathrm{tr}\,\bar C_0 C_{i,0}^{-1} .

This is of second order, exact for small strain that grows evenly or is held, and stable for any step;
its forces have the potential :math:`\tfrac{3m}{2a}\det(B + a\bar C)^{1/3}`. Their form is `maxwell` of
`evfem.tissue.forms`. Where the bulk relaxes too, a number :math:`\theta_v` follows the element's volume
measure in the same way, with the pressure :math:`K_i(\theta - \theta_v)`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.tensor import Array, det, inv, mul, trace
from evfem.tissue.assembly import Integral, points_of
from evfem.tissue.forms import Field, Parts, deformation_gradient, isochoric, maxwell
from evfem.tissue.kernels.blocks import LANES, blocked, loops, padded, unblocked
from evfem.tissue.ogden import shares_of
from evfem.tissue.pattern import Pattern
from evfem.tissue.space import Space
from evfem.tissue.splitlaw import split

#: entries of a symmetric matrix that are kept, in the plane without those out of it, which are 0
KEPT = {2: ((0, 0), (1, 1), (2, 2), (0, 1)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))}
#: bytes that a branch keeps at a point, by dimensions
KEPT_BYTES = {dim: 8 * (len(kept) + 1) for dim, kept in KEPT.items()}


@dataclass(frozen=True)
class Branch:
    """One branch over the cells (E,): moduli in MPa of shear and bulk, 0 where a region has none, and
    relaxation times in s.
    """

    shear: Floats
    bulk: Floats
    time: Floats


def branches_of(space: Space, laws: Mapping[str, Any], finger: Any) -> list[Branch]:
    """The branches of the laws on a space; a law without its own has those of the `finger`."""
    found: list[Branch] = []
    for name, law in laws.items():
        giver = _giver(finger, law)
        rows = shares_of(f"finger.materials.{name}.relaxation", branches_in(finger, law))
        bulk = _bulk_modulus(name, law) if rows and getattr(giver, "bulk_relaxation", False) else 0.0
        cells = space.mesh.cells_of(name)
        for i, (share, time) in enumerate(rows):
            if i == len(found):
                none = np.zeros(len(space.nodes))
                found.append(Branch(none, none.copy(), np.ones_like(none)))
            found[i].shear[cells] = share * split(law, space.dim).shear_modulus
            found[i].bulk[cells], found[i].time[cells] = share * bulk, time
    return found


def branches_in(finger: Any, law: Any) -> Any:
    """Rows (share, s) of a law's branches, or of those of its finger."""
    return getattr(_giver(finger, law), "relaxation", None) or ()


def _giver(finger: Any, law: Any) -> Any:
    """Which of the two says how the law's tissue relaxes."""
    return finger if getattr(law, "relaxation", None) is None else law


def _bulk_modulus(name: str, law: Any) -> float:
    """Initial bulk modulus (MPa) of a law whose bulk relaxes."""
    if hasattr(law, "bulk_modulus"):
        return float(law.bulk_modulus)
    raise InputError(f"finger.materials.{name}", type(law).__name__, "a law with bulk_modulus")


def make_branches(space: Space, branches: list[Branch]) -> Branches:
    """The branches in compiled loops, where there are some and only the shear modulus relaxes."""
    bulk = any(branch.bulk.any() for branch in branches)
    return Branches(space, branches) if bulk or loops(space.dim) is None else LoopedBranches(space, branches)


class Branches:
    """The branches' forces, energy and loss in one step; `begin` sets the step.

    What a step leaves behind is `inner` (n, k, C, Q) of n branches in the C cells that have any: k - 1
    entries of C_i, `KEPT`, and theta_v.
    """

    def __init__(self, space: Space, branches: list[Branch], wanted: Ints | None = None) -> None:
        """In the cells that have branches, or those of them that are `wanted`."""
        self.space, self.rows = space, branches
        cells = np.flatnonzero(sum(branch.shear for branch in branches))
        if wanted is not None:
            cells = np.intersect1d(cells, wanted)
        self.shear, self.bulk, self.time = (
            np.array([getattr(branch, name)[cells, None] for branch in branches])
            for name in ("shear", "bulk", "time")
        )
        parts = Parts(space.dim, grad=True, theta=bool(self.bulk.any()))
        w = SimpleNamespace(branches=(), has_bulk=parts.theta)
        self.integral = Integral(maxwell, points_of(space, cells), parts, w, at_once=True)
        self.step = 0.0

    def among(self, cells: Ints) -> tuple[Branches, Ints]:
        """The branches of those cells alone, and where these are in `inner`."""
        part = Branches(self.space, self.rows, cells)
        return part, np.searchsorted(self.integral.points.cells, part.integral.points.cells)

    def overstress(self, u: Floats, inner: Floats) -> tuple[Array, Array, Array]:
        """What the branches add at the points of their cells: the second Piola-Kirchhoff stress of the shear
        (3, 3, C, Q) and the pressure of the volume measure (C, Q), both MPa, and the energy (C, Q) in N/mm2.
        """
        field = self.integral.field(u - u[:1])
        F = deformation_gradient(field)
        bar, theta = isochoric(F), field.theta if self.integral.parts.theta else 0.0
        A: Any = np.zeros_like(bar)
        q, energy = np.zeros(bar.shape[2:]), np.zeros(bar.shape[2:])
        for m, K, kept in zip(self.shear, self.bulk, inner, strict=True):
            Ci, theta_v = self._unpacked(kept)
            A = A + m * inv(Ci)
            q = q + K * (theta - theta_v)
            energy = energy + 0.5 * m * (trace(mul(bar, inv(Ci))) - 3.0) + 0.5 * K * (theta - theta_v) ** 2
        stress = det(F) ** (-2.0 / 3.0) * (A - trace(mul(bar, A)) / 3.0 * inv(bar))
        return stress, q, energy

    @cached_property
    def at_rest(self) -> Floats:
        """`inner` of the undeformed body."""
        return self._relaxed(np.zeros((self.space.size, self.space.dim)))

    def begin(self, u: Floats, inner: Floats, step: float) -> None:
        """Start a step of `step` seconds (0: it ends at rest) from displacements (N, dim) and `inner`."""
        self.step, self._u0, self._inner0 = step, u, inner
        self._bar0, self._theta0 = self._strain(u)
        self.integral.w.branches = [self._branch(i) for i in range(len(inner))] if step > 0.0 else []

    def _branch(self, i: int) -> SimpleNamespace:
        """Branch i over the step: B and a, both over 1 + a, so that no length of a step overflows."""
        Ci, theta_v = self._unpacked(self._inner0[i])
        x = self.step / self.time[i]
        h = trace(mul(self._bar0, inv(Ci))) / 3.0
        f, rest, decay = _mean(h * x)
        a = rest / h
        before = decay * Ci + (f - decay) / h * self._bar0
        f, rest, decay = _mean(x)
        return SimpleNamespace(
            shear=self.shear[i],
            bulk=self.bulk[i],
            before=(before / (1.0 + a))[:, :, None],
            share=a / (1.0 + a),
            theta_before=decay * theta_v + (f - decay) * self._theta0,
            theta_share=rest,
        )

    def forces(self, u: Floats) -> Floats:
        """Nodal forces (N, dim)."""
        # without travel, whose rounding would outweigh small forces
        return self.integral.forces(u - u[:1]) if self.step > 0.0 else np.zeros_like(u)

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats) -> None:
        """Add the tangent to the `data` of a pattern."""
        if self.step > 0.0:
            self.integral.add_tangent(u - u[:1], pattern, data)

    def at_once(self, u: Floats, pattern: Pattern) -> dict[float, Floats]:
        """By relaxation time (s), the tangents at u (N, dim) of branches that are at rest there, to changes
        faster than they relax: added up like `Pattern.zeros`.
        """
        bar, theta = self._strain(u)
        found = {}
        for time in np.unique(self.time[self.shear > 0.0]):
            shear, bulk = ((each * (self.time == time)).sum(axis=0) for each in (self.shear, self.bulk))
            rest = {"before": bar[:, :, None], "share": 0.0, "theta_before": theta, "theta_share": 0.0}
            branch = SimpleNamespace(shear=shear, bulk=bulk, **rest)
            w = SimpleNamespace(branches=[branch], has_bulk=self.integral.parts.theta)
            found[float(time)] = pattern.zeros()
            replace(self.integral, w=w).add_tangent(u - u[:1], pattern, found[float(time)])
        return found

    def inner(self, u: Floats) -> Floats:
        """`inner` at the end of a step that ends at u (N, dim)."""
        if self.step == 0.0:
            return self._relaxed(u)
        bar, theta = self._strain(u)
        ends = []
        for branch in self.integral.w.branches:
            M = branch.before[:, :, 0] + branch.share * bar
            theta_v = branch.theta_before + branch.theta_share * theta
            ends.append(self._packed(M / _root(M), theta_v))
        return np.array(ends)

    def energy(self, u: Floats) -> float:
        """Energy stored at the end of a step that ends at u: N mm, in the plane per mm of depth."""
        return 0.0 if self.step == 0.0 else self._stored(self._strain(u), self.inner(u))

    def potential(self, u: Floats) -> float:
        """What `forces` are the derivative of: N mm, in the plane per mm of depth."""
        bar, theta = self._strain(u)
        total: Any = 0.0
        for branch in self.integral.w.branches:
            root = _root(branch.before[:, :, 0] + branch.share * bar)
            total = total + 1.5 * branch.shear / branch.share * root
            held = (1.0 - branch.theta_share) * theta - branch.theta_before
            total = total + 0.5 * branch.bulk / (1.0 - branch.theta_share) * held**2
        return float(np.sum(total * self.integral.points.weight))

    def dissipation(self, u: Floats) -> float:
        """What is lost in the step, exact at small strain; all that was stored where no time passes."""
        if self.step == 0.0:
            return self._stored((self._bar0, self._theta0), self._inner0)
        end, inner = self._strain(u), self.inner(u)
        total: Any = 0.0
        for i in range(len(inner)):
            x = self.step / self.time[i]
            before, after = (
                self._overstrain(strain, kept[i])
                for strain, kept in (((self._bar0, self._theta0), self._inner0), (end, inner))
            )
            shear, bulk = (_lost(x, e0, e1) for e0, e1 in zip(before, after, strict=True))
            total = total + 2.0 * self.shear[i] * shear + self.bulk[i] * bulk
        return float(np.sum(total * self.integral.points.weight))

    # -- at the points

    def _strain(self, u: Floats) -> tuple[Array, Array]:
        """Cbar (3, 3, C, Q) and the volume measure (C, Q), 0 where the bulk does not relax."""
        field: Field = self.integral.field(u - u[:1])
        bar = isochoric(deformation_gradient(field))
        return bar, field.theta if self.integral.parts.theta else np.zeros(bar.shape[2:])

    def _stored(self, strain: tuple[Array, Array], inner: Floats) -> float:
        total: Any = 0.0
        for m, K, kept in zip(self.shear, self.bulk, inner, strict=True):
            Ci, theta_v = self._unpacked(kept)
            total = total + 0.5 * m * (trace(mul(strain[0], inv(Ci))) - 3.0)
            total = total + 0.5 * K * (strain[1] - theta_v) ** 2
        return float(np.sum(total * self.integral.points.weight))

    def _overstrain(self, strain: tuple[Array, Array], kept: Floats) -> tuple[Array, Array]:
        """dev(C_i^-1 Cbar)/2 (3, 3, C, Q), and theta - theta_v (1, 1, C, Q)."""
        Ci, theta_v = self._unpacked(kept)
        product = mul(inv(Ci), strain[0])
        mean = trace(product) / 3.0
        return 0.5 * (product - mean * np.eye(3)[:, :, None, None]), (strain[1] - theta_v)[None, None]

    def _relaxed(self, u: Floats) -> Floats:
        one = self._packed(*self._strain(u))
        return np.repeat(one[None], len(self.shear), axis=0)

    def _packed(self, Ci: Array, theta_v: Array) -> Floats:
        return np.stack([*(Ci[i, j] for i, j in KEPT[self.space.dim]), theta_v])

    def _unpacked(self, kept: Floats) -> tuple[Floats, Floats]:
        Ci = np.zeros((3, 3, *kept.shape[1:]))
        for (i, j), entry in zip(KEPT[self.space.dim], kept, strict=False):
            Ci[i, j] = Ci[j, i] = entry
        return Ci, kept[-1]


class LoopedBranches(Branches):
    """Branches of the shear modulus whose steps go through compiled loops (`relaxing.h`), twins of the form.

    Arrays in blocks have B, n branches and L lanes: moduli (B, n, L), what is kept (B, Q, n, k - 1, L).
    """

    def __init__(self, space: Space, branches: list[Branch]) -> None:
        super().__init__(space, branches)
        self.loops = loops(space.dim)
        self._modulus = padded(np.stack([branch.shear for branch in branches], axis=1))
        self._time = blocked(np.stack([branch.time for branch in branches], axis=1))
        self._end: tuple[Any, ...] = ()

    def begin(self, u: Floats, inner: Floats, step: float) -> None:
        self._end, self._in_numpy = (), step == 0.0
        if step == 0.0:
            super().begin(u, inner, step)
            return
        self.step, self._inner0, self._u0 = step, inner, u - u[:1]
        self._kept0 = self._in_blocks(inner)
        blocks, points, n, kept, _ = self._kept0.shape
        self._before = np.empty((blocks, points, n, kept + 1, LANES))
        self.loops.begin_relaxing(self.space.cells, self._u0, step / self._time, self._kept0, self._before)

    def forces(self, u: Floats) -> Floats:
        total = np.zeros_like(u)
        if self.step > 0.0:
            self.loops.relaxing(self.space.cells, u - u[:1], self._modulus, self._before, total)
        return total

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats) -> None:
        if self.step > 0.0:
            begun = self.space.cells, u - u[:1], self._modulus, self._before
            self.loops.add_relaxing(*begun, pattern.blocks, data)

    def inner(self, u: Floats) -> Floats:
        return super().inner(u) if self.step == 0.0 else self._from_blocks(self._ended(u)[0])

    def energy(self, u: Floats) -> float:
        return 0.0 if self.step == 0.0 else float(self._ended(u)[1])

    def dissipation(self, u: Floats) -> float:
        return super().dissipation(u) if self.step == 0.0 else float(self._ended(u)[2])

    def potential(self, u: Floats) -> float:
        if not self._in_numpy:
            super().begin(self._u0, self._inner0, self.step)
            self._in_numpy = True
        return super().potential(u)

    def _ended(self, u: Floats) -> tuple[Floats, float, float]:
        """What is kept at the end, the stored energy and what was lost; once for each u."""
        if not self._end or self._end[0] is not u:
            kept = np.empty_like(self._kept0)
            begun = self.space.cells, u - u[:1], self._modulus, self._before
            numbers = np.stack(_loss(self.step / self._time), axis=2)
            found = self.loops.end_relaxing(*begun, self._u0, self._kept0, numbers, kept)
            self._end = u, kept, *found
        return self._end[1], self._end[2], self._end[3]

    def _in_blocks(self, inner: Floats) -> Floats:
        """C_i of `inner` in blocks, of rest in cells that have no branch."""
        cells, n, k, _, points = self.integral.points.cells, *inner.shape
        kept = np.zeros((len(self.space.nodes), points, n, k - 1))
        kept[..., :3] = 1.0
        kept[cells] = inner[:, :-1].transpose(2, 3, 0, 1)
        return blocked(kept)

    def _from_blocks(self, kept: Floats) -> Floats:
        """`inner` of C_i in blocks."""
        found = unblocked(kept, len(self.space.nodes))[self.integral.points.cells].transpose(2, 3, 0, 1)
        return np.concatenate([found, np.zeros_like(found[:, :1])], axis=1)


def _root(M: Array) -> Array:
    """Cube root of the determinant."""
    return det(M) ** (1.0 / 3.0)


def _mean(y: Floats) -> tuple[Floats, Floats, Floats]:
    """f = (1 - e^-y)/y, 1 - f and e^-y of y > 0, with the digits that 1 - f loses at small y."""
    decay, f = np.exp(-y), -np.expm1(-y) / y
    series = y / 2.0 * (1.0 - y / 3.0 * (1.0 - y / 4.0 * (1.0 - y / 5.0)))
    return f, np.where(y < 1e-3, series, 1.0 - f), decay


def _lost(x: Floats, e0: Array, e1: Array) -> Array:
    """Integral of tr(e e)/tau over the step of x relaxation times, e from e0 to e1 (n, n, C, Q) as under a
    strain that grows evenly.
    """
    decay, first, both, last = _loss(x)
    d = e1 - decay * e0
    return first * trace(mul(e0, e0)) + both * trace(mul(e0, d)) + last * trace(mul(d, d))


def _loss(x: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """e^-x, and the numbers of tr(e0 e0), tr(e0 d) and tr(d d) in what is lost, d = e1 - e^-x e0."""
    g, q = -np.expm1(-x), -0.5 * np.expm1(-2.0 * x)
    series = x**3 / 3.0 * (1.0 - x * (0.75 - 0.35 * x))
    rest = np.where(x < 1e-3, series, x - 2.0 * g + q)
    twice = 2.0 * np.where(x < 1e-6, 0.5 * x * x, g - q)
    return np.exp(-x), q, twice / g, rest / g**2

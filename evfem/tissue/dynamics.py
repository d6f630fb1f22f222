r"""Time: objective Kelvin-Voigt stress and inertia over one step of backward Euler, as further
internal forces.

With the time step :math:`\Delta t`, the strain :math:`E = (F^T F - 1)/2` and the state (u_0, v_0)
before the step,

.. math:: P_v = F S_v, \quad S_v = 2\eta\,(E - E_0)/\Delta t, \quad \eta = \tau\mu; \qquad
          f = M\,(v - v_0)/\Delta t, \quad v = (u - u_0)/\Delta t .

Only the shear modulus enters the viscosity, so nothing locks. The step dissipates
:math:`\int S_v : (E - E_0)`. A step that takes no time has neither term. The forms are
`kelvin_voigt` and `mass` of `evfem.tissue.forms`. Maxwell branches (`evfem.tissue.branches`) add their
own; after a step without time they are at rest. Drag holds a body back that is released.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.tensor import ddot
from evfem.tissue.assembly import Integral, points_of
from evfem.tissue.branches import Branches, branches_of
from evfem.tissue.forms import Parts, deformation_gradient, green_strain, kelvin_voigt, mass
from evfem.tissue.kernels.blocks import LANES, loops, padded
from evfem.tissue.laws import split
from evfem.tissue.pattern import Componentwise, Pattern
from evfem.tissue.space import Space

#: what branches keep where there are none
NO_BRANCHES: Floats = np.zeros(0)
#: `dynamics` of a scene -> its terms
DYNAMICS: dict[str, Any] = {"quasistatic": None}


class Dynamics:
    """Viscous and inertial forces of a body; `begin` sets the step, then it acts like any other
    term of the internal forces.

    A class with a `name` is one of `DYNAMICS`. `inertia`: whether tissue has mass. At the end of a step the
    velocity is v_0 + `slope` ((u - u_0)/dt - v_0).
    """

    inertia, slope, scheme = False, 1.0, "backward Euler"

    def __init_subclass__(cls, name: str) -> None:
        DYNAMICS[name] = cls

    def __init__(
        self,
        space: Space,
        viscosity: Floats | None,
        density: Floats | None,
        branches: Branches | None = None,
    ) -> None:
        """`viscosity` (E,) eta in MPa s per cell, `density` (E,) in t/mm3 per cell; None leaves
        the term out.
        """
        self.space, self.branches = space, branches
        self.viscosity = viscosity
        self.mass = None if density is None else Componentwise(mass_matrices(space) * density[:, None, None])
        self._inertia = None if self.mass is None else assembled(space, self.mass.matrices)
        self.loops = loops(space.dim) if viscosity is not None else None
        self.step: float = 0.0
        self._u0 = self._v0 = np.zeros((space.size, space.dim))
        self._inner0 = self.at_rest
        self._strain0: Any = None

    @property
    def at_rest(self) -> Floats:
        """What the branches keep of the undeformed body."""
        return NO_BRANCHES if self.branches is None else self.branches.at_rest

    def begin(self, u: Floats, velocity: Floats, step: float, inner: Floats = NO_BRANCHES) -> None:
        """Start a step of `step` seconds (0: no time passes) from displacements and velocities (N,
        dim), and what the branches kept.
        """
        self.step, self._u0, self._v0, self._inner0 = step, u, velocity, inner
        if self.branches is not None:
            self.branches.begin(u, inner, step)
        if step > 0.0 and self.viscosity is not None:
            self._strain0 = self._strain(u)
            if self.loops is None:
                self._damping.w.step, self._damping.w.strain0 = step, self._strain0

    @cached_property
    def _damping(self) -> Integral:
        """The Kelvin-Voigt form over the cells that have viscosity; its context is renewed by each step."""
        assert self.viscosity is not None
        cells = np.flatnonzero(self.viscosity)
        w = SimpleNamespace(eta=self.viscosity[cells, None], step=self.step, strain0=self._strain0)
        return Integral(
            kelvin_voigt, points_of(self.space, cells), Parts(self.space.dim, grad=True), w, at_once=True
        )

    @property
    def beginning(self) -> tuple[Floats, float, Floats]:
        """Displacements (N, dim) that the step began with, its seconds, and what the branches had kept."""
        return self._u0, self.step, self._inner0

    def forces(self, u: Floats) -> Floats:
        """Nodal forces (N, dim)."""
        total = np.zeros_like(u)
        if self.step == 0.0:
            return total
        if self.viscosity is not None and self.loops is not None:
            self.loops.viscous(*self._request(u), total)
        elif self.viscosity is not None:
            total += self._damping.forces(u)
        if self._inertia is not None:
            total += self._inertia @ (self.slope * ((u - self._u0) / self.step**2 - self._v0 / self.step))
        if self.branches is not None:
            total += self.branches.forces(u)
        return total

    def add_tangent(self, u: Floats, pattern: Pattern, data: Floats) -> None:
        """Add the terms' tangents to the `data` of a pattern."""
        if self.step == 0.0:
            return
        if self.viscosity is not None and self.loops is not None:
            self.loops.add_viscous(*self._request(u), pattern.blocks, data)
        elif self.viscosity is not None:
            self._damping.add_tangent(u, pattern, data)
        if self.mass is not None:
            data += self.slope * self.mass.data(pattern) / self.step**2
        if self.branches is not None:
            self.branches.add_tangent(u, pattern, data)

    def velocity(self, u: Floats) -> Floats:
        """Nodal velocities (N, dim) in mm/s at the end of the step; zero when no time passes."""
        if self.step == 0.0:
            return np.zeros_like(u)
        return self.slope * (u - self._u0) / self.step + (1.0 - self.slope) * self._v0

    def inner(self, u: Floats) -> Floats:
        """What the branches keep of a step that ends at u (N, dim)."""
        return NO_BRANCHES if self.branches is None else self.branches.inner(u)

    def branch_energy(self, u: Floats) -> float:
        """What the branches store at the end of the step: N mm, in the plane per mm of depth."""
        return 0.0 if self.branches is None else self.branches.energy(u)

    def dissipation(self, u: Floats) -> float:
        """What tissue loses in the step: N mm, in the plane per mm of depth."""
        damped = self.damping(u)
        return damped if self.branches is None else damped + self.branches.dissipation(u)

    def damping(self, u: Floats) -> float:
        """The share of the Kelvin-Voigt stress in `dissipation`."""
        if self.step == 0.0 or self.viscosity is None:
            return 0.0
        if self.loops is not None:
            return float(self.loops.viscous(*self._request(u), np.zeros_like(u)))
        damping, change = self._damping, self._strain(u) - self._strain0
        power = 2.0 * damping.w.eta / self.step * ddot(change, change)[0]
        return float(np.sum(power * damping.points.weight))

    def kinetic_energy(self, velocity: Floats) -> float:
        """Kinetic energy of nodal velocities (N, dim): N mm, in the plane per mm of depth."""
        if self._inertia is None:
            return 0.0
        return float(0.5 * np.sum(velocity * (self._inertia @ velocity)))

    def _strain(self, u: Floats) -> Floats:
        """Green strain of damped points: (dim, dim, 1, C, Q) for the form, in blocks for compiled loops."""
        if self.loops is not None:
            blocks, points = self.space.cells.weight.shape[:2]
            dim = self.space.dim
            strain = np.empty((blocks, points, dim * (dim + 1) // 2, LANES))
            self.loops.strains(self.space.cells, np.ascontiguousarray(u), strain)
            return strain
        return green_strain(deformation_gradient(self._damping.field(u)))[:, :, None]

    def _request(self, u: Floats) -> tuple[Any, ...]:
        """For the compiled loops: cells, u, viscosity over the step (B, L), strains before the step."""
        assert self.viscosity is not None
        rate = padded(self.viscosity / self.step)
        return self.space.cells, np.ascontiguousarray(u), rate, self._strain0


DYNAMICS["viscous"] = Dynamics


class Inertial(Dynamics, name="inertial"):
    """Dynamics with mass."""

    inertia = True


def assembled(space: Space, matrices: Floats) -> Any:
    """Sparse matrix (N, N) of cell matrices (E, n, n)."""
    import scipy.sparse as sparse

    n = space.nodes.shape[1]
    rows, columns = np.repeat(space.nodes, n, axis=1).ravel(), np.tile(space.nodes, (1, n)).ravel()
    return sparse.coo_matrix((matrices.ravel(), (rows, columns)), (space.size, space.size)).tocsr()


def mass_matrices(space: Space) -> Floats:
    """Consistent mass matrices per unit density (E, n, n) in mm^dim."""
    dim = space.dim
    cells = np.arange(len(space.nodes))
    w = SimpleNamespace(density=1.0)
    form = Integral(mass, points_of(space, cells), Parts(dim, value=True), w, at_once=True)
    return np.ascontiguousarray(form.cell_tangents(np.zeros((space.size, dim)))[:, ::dim, ::dim])


def make_dynamics(space: Space, laws: Mapping[str, Any], finger: Any, name: str) -> Dynamics | None:
    """The time-dependent terms of `DYNAMICS` that the laws ask for, or None if there are none; `viscosity`
    (s) and `relaxation` of the `finger` are those of laws without their own.
    """
    kind: type[Dynamics] | None = DYNAMICS[name]
    if kind is None:
        return None
    eta, density = np.zeros(len(space.nodes)), np.zeros(len(space.nodes))
    for region, law in laws.items():
        cells = space.mesh.cells_of(region)
        own = getattr(law, "viscosity", None)
        tau = finger.viscosity if own is None else own
        if tau:
            eta[cells] = tau * split(law, space.dim).shear_modulus
        density[cells] = getattr(law, "density", 1e-9)
    rows = branches_of(space, laws, finger)
    if not (eta.any() or rows or kind.inertia):
        return None
    branches = Branches(space, rows) if rows else None
    return kind(space, eta if eta.any() else None, density if kind.inertia else None, branches)

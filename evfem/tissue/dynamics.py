r"""Time: objective Kelvin-Voigt stress and inertia over one step, as further internal forces.

With the time step h, the strain :math:`E = (F^T F - 1)/2` and rates at the end of the step,

.. math:: P_v = F S_v, \quad S_v = 2\eta\,\dot E, \quad \eta = \tau\mu; \qquad
          f = M\,\dot v, \quad v = \dot u .

Rates are backward differences. From one part alone, backward Euler, :math:`\dot q = \Delta q/h` with the
change :math:`\Delta q` in the step: for tissue without mass, and wherever no part before counts. With mass
the part before counts, of length h' = h/r and mean rate :math:`\Delta q'/h'`,

.. math:: \dot q = \frac{1 + 2r}{1 + r}\frac{\Delta q}{h} - \frac{r}{1 + r}\frac{\Delta q'}{h'} ,

which is BDF2, of second order for steps of any length; it counts up to r = `LONGEST` (zero-stable below
1 + sqrt 2 [1]_), and where the bone's speed does not jump.

Contact, friction and attraction are those of the end of the step. The nodes of the pad have no mass, that
of their cells is moved to the other nodes [2]_: a node that lands then has no momentum to lose, and the
contact force follows the tissue behind it.

Only the shear modulus enters the viscosity, so nothing locks. The step dissipates
:math:`\int 2\eta |\Delta E|^2/h`. A step that takes no time has neither term. The forms are
`kelvin_voigt` and `mass` of `evfem.tissue.forms`. Maxwell branches (`evfem.tissue.branches`) add their
own; after a step without time they are at rest. Drag holds a body back that is released.

.. [1] Grigorieff, Numer. Math. 42 (1983) 359, doi:10.1007/BF01389580.
.. [2] Khenous, Laborde & Renard, Eur. J. Mech. A 27 (2008) 918, doi:10.1016/j.euromechsol.2008.01.001.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import SimpleNamespace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.constants import LONGER, SHORTER
from evfem.common.rooms import Room
from evfem.tensor import ddot
from evfem.tissue.assembly import Integral, points_of
from evfem.tissue.branches import Branches, branches_of, make_branches
from evfem.tissue.forms import Parts, deformation_gradient, green_strain, kelvin_voigt, mass
from evfem.tissue.kernels.blocks import LANES, loops, padded
from evfem.tissue.laws import split
from evfem.tissue.pattern import Componentwise, Pattern
from evfem.tissue.space import Space

#: what branches keep where there are none
NO_BRANCHES: Floats = np.zeros(0)
#: mean rates of a part where none count
NO_RATES: Floats = np.zeros(0)
#: a part may be so many times as long as the one before for that to count
LONGEST = 2.4
#: `dynamics` of a scene -> its terms
DYNAMICS: dict[str, Any] = {"quasistatic": None}


@dataclass(frozen=True, eq=False)
class Past:
    """The part before: its seconds, 0 where it does not count, and over it the mean velocities and
    accelerations (2, N, dim) of tissue with mass.
    """

    seconds: float = 0.0
    rates: Floats = field(default_factory=lambda: NO_RATES)


@dataclass(frozen=True)
class Difference:
    """A backward difference: the rate is `share` times the mean rate of the step, less `lag` times that of
    the part before.

    >>> Difference.over(0.1, 0.0), Difference.over(0.1, 0.1)
    (Difference(share=1.0, lag=0.0), Difference(share=1.5, lag=0.5))
    """

    share: float = 1.0
    lag: float = 0.0

    @classmethod
    def over(cls, step: float, before: float) -> Difference:
        """Of a step of `step` seconds after a part of `before` seconds, 0 where that does not count."""
        if not 0.0 < step <= LONGEST * before:
            return cls()
        ratio = step / before
        return cls((1.0 + 2.0 * ratio) / (1.0 + ratio), ratio / (1.0 + ratio))


class Static(Room):
    """Tissue without viscosity and mass: no time passes in it. Answers what `Dynamics` does."""

    acts, mass, branches, viscosity = False, None, None, None
    #: further terms of the internal forces
    forms: tuple[Any, ...] = ()


class Dynamics(Room):
    """Viscous and inertial forces of a body; `begin` sets the step, then it acts like any other
    term of the internal forces. Branches keep `branches` (`evfem.tissue.branches`) in a state's memory.

    A class with a `name` is one of `DYNAMICS`. `inertia`: whether tissue has mass; `difference` of the step.
    """

    inertia, scheme, difference, acts = False, "backward Euler", Difference(), True

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
        self.mass = None if density is None else Componentwise(self._masses() * density[:, None, None])
        self._inertia = None if self.mass is None else assembled(space, self.mass.matrices)
        self.loops = loops(space.dim) if viscosity is not None else None
        self.step: float = 0.0
        self._u0 = self._v0 = np.zeros((space.size, space.dim))
        self._start, self.past = self._v0, Past()
        self._strain0: Any = None  # what the stress counts from
        self._strain_begun: Any = None

    def _masses(self) -> Floats:
        """Mass matrices per unit density (E, n, n)."""
        return mass_matrices(self.space)

    @property
    def forms(self) -> tuple[Any, ...]:
        """Further terms of the internal forces."""
        return (self,)

    def outdates(self, made_for: float, seconds: float) -> bool:
        return not SHORTER * made_for <= seconds <= LONGER * made_for

    def memory(self, state: Any) -> dict[str, Floats]:
        return {} if self.branches is None else {"branches": self.branches.at_rest}

    def begin(self, old: Any, seconds: float) -> None:
        inner = old.memory.get("branches", NO_BRANCHES)
        self.begin_from(old.u, np.zeros_like(old.u), seconds, inner)

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        return {} if self.branches is None else {"branches": self.branches.inner(new.u)}

    def begin_from(
        self,
        u: Floats,
        velocity: Floats,
        step: float,
        inner: Floats = NO_BRANCHES,
        past: Past | None = None,
    ) -> None:
        """Start a step of `step` seconds (0: no time passes) from displacements and velocities (N,
        dim), what the branches kept, and the part before.
        """
        self.step, self._u0, self._v0 = step, u, velocity
        self.past = past or Past()
        if self.branches is not None:
            self.branches.begin(u, inner, step)
        if step == 0.0:
            return
        self.difference = Difference.over(step, self.past.seconds)
        lag, self._start = self.difference.lag, velocity / step
        if lag:
            means, accelerations = self.past.rates
            self._start = self._start + lag * (means / step + accelerations / self.difference.share)
        if self.viscosity is None:
            return
        self._strain_begun = self._strain0 = self._strain(u)
        if lag:
            earlier = self._strain(u - self.past.seconds * means)
            growth = (self._strain_begun - earlier) / self.past.seconds
            self._strain0 = self._strain_begun + lag * self._damped * growth
        if self.loops is None:
            self._damping.w.step, self._damping.w.strain0 = self._damped, self._strain0

    @property
    def _damped(self) -> float:
        """Seconds over which the strain counts."""
        return self.step / self.difference.share

    @cached_property
    def _damping(self) -> Integral:
        """The Kelvin-Voigt form over the cells that have viscosity; its context is renewed by each step."""
        assert self.viscosity is not None
        cells = np.flatnonzero(self.viscosity)
        w = SimpleNamespace(eta=self.viscosity[cells, None], step=self._damped, strain0=self._strain0)
        return Integral(
            kelvin_voigt, points_of(self.space, cells), Parts(self.space.dim, grad=True), w, at_once=True
        )

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
            share = self.difference.share
            total += self._momentum(share * (share * (u - self._u0) / self.step**2 - self._start))
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
            data += self.difference.share**2 * self.mass.data(pattern) / self.step**2
        if self.branches is not None:
            self.branches.add_tangent(u, pattern, data)

    def velocity(self, u: Floats) -> Floats:
        """Nodal velocities (N, dim) in mm/s at the end of the step; zero when no time passes."""
        if self.step == 0.0:
            return np.zeros_like(u)
        mean = (u - self._u0) / self.step
        lag = self.difference.lag
        return self.difference.share * mean - lag * self.past.rates[0] if lag else mean

    def stored(self, state: Any) -> float:
        return 0.0 if self.branches is None else self.branches.energy(state.u)

    def dissipation(self, old: Any, new: Any, seconds: float) -> float:
        damped = self.damping(new.u)
        return damped if self.branches is None else damped + self.branches.dissipation(new.u)

    def damping(self, u: Floats) -> float:
        """Dissipation by the Kelvin-Voigt stress in the step that ends at u (N mm)."""
        if self.step == 0.0 or self.viscosity is None:
            return 0.0
        return self._damping_from(self._strain_begun, self.step, u)

    def _damping_from(self, strain: Any, seconds: float, u: Floats) -> float:
        """Dissipation of strain that grows evenly to that of u in so many seconds."""
        assert self.viscosity is not None
        if self.loops is not None:
            begun = self.space.cells, np.ascontiguousarray(u), padded(self.viscosity / seconds), strain
            return float(self.loops.viscous(*begun, np.zeros_like(u)))
        damping, change = self._damping, self._strain(u) - strain
        power = 2.0 * damping.w.eta / seconds * ddot(change, change)[0]
        return float(np.sum(power * damping.points.weight))

    def potential(self, old: Any, new: Any, fractions: Floats) -> Floats:
        held = self.potential_along(old.u, new.u - old.u, fractions)
        return held - held[0]

    def takes_time(self, seconds: float) -> bool:
        return seconds > 0.0

    def potential_along(self, u: Floats, way: Floats, places: Floats) -> Floats:
        """What the forces of the step are the derivative of, at u plus the shares `places` (w,) of a way (N,
        dim): (w,) in N mm, in the plane per mm of depth.
        """
        if self.step == 0.0:
            return np.zeros_like(places)
        held = self._damped_potential(u, way, places)
        if self.branches is not None:
            held = held + [self.branches.potential(u + s * way) for s in places]
        rate = self.difference.share / self.step
        begun = self._u0 - u + self._start * (self.step / rate)
        return held + [self.kinetic_energy(rate * (s * way - begun)) for s in places]

    def _damped_potential(self, u: Floats, way: Floats, places: Floats) -> Floats:
        """Of the Kelvin-Voigt stress in `potential_along`, of strain that grows evenly."""
        return 0.5 * self.damping(u + way) * places**2

    def kinetic_energy(self, velocity: Floats) -> float:
        """Kinetic energy of nodal velocities (N, dim): N mm, in the plane per mm of depth."""
        if self._inertia is None:
            return 0.0
        return float(0.5 * np.sum(velocity * self._momentum(velocity)))

    def _momentum(self, velocity: Floats) -> Floats:
        """Mass times velocities (N, dim), axis by axis: faster than over short rows."""
        return np.stack([self._inertia @ each for each in velocity.T], axis=1)

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
        rate = padded(self.viscosity / self._damped)
        return self.space.cells, np.ascontiguousarray(u), rate, self._strain0


DYNAMICS["viscous"] = Dynamics


class Inertial(Dynamics, name="inertial"):
    """Dynamics with mass: backward differences of second order, and a pad whose nodes have no mass.

    Keeps the `velocity` (N, dim) at the end of a substep, its mean `rates` (2, N, dim) and its `seconds`, 0
    where the next one does not go on from it.
    """

    inertia, scheme = True, "backward differences of second order"

    def memory(self, state: Any) -> dict[str, Floats]:
        still = np.zeros_like(state.u)
        own = {"velocity": still, "rates": np.stack([still, still]), "seconds": np.zeros(())}
        return super().memory(state) | own

    def restart(self, old: Any, target: Any) -> dict[str, Floats]:
        if not old.memory["seconds"]:
            return {}
        before = old.memory["rates"][0][self.space.mesh.node_sets["bone"][0]]
        return {"seconds": np.zeros(())} if target.speed_jumps(old, before) else {}

    def begin(self, old: Any, seconds: float) -> None:
        kept = old.memory
        past = Past(float(kept["seconds"]), kept["rates"])
        self.begin_from(old.u, kept["velocity"], seconds, kept.get("branches", NO_BRANCHES), past)

    def accept(self, old: Any, new: Any) -> dict[str, Floats]:
        own = {"velocity": self.velocity(new.u), "rates": self.rates(new.u), "seconds": np.array(self.step)}
        return super().accept(old, new) | own

    def kinetic(self, state: Any) -> float:
        return self.kinetic_energy(state.memory["velocity"])

    def _masses(self) -> Floats:
        return without_pad(self.space, super()._masses())

    def rates(self, u: Floats) -> Floats:
        """Mean velocities and accelerations (2, N, dim) over a step that ends at u (N, dim)."""
        if self.step == 0.0:
            return np.zeros((2, *u.shape))
        return np.stack([u - self._u0, self.velocity(u) - self._v0]) / self.step

    def _damped_potential(self, u: Floats, way: Floats, places: Floats) -> Floats:
        if self.viscosity is None:
            return np.zeros_like(places)
        at = [self._damping_from(self._strain0, self._damped, u + s * way) for s in places]
        return 0.5 * np.array(at)


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


def without_pad(space: Space, matrices: Floats) -> Floats:
    """Mass matrices (E, n, n) without mass at the nodes of the pad: the others of each cell have it."""
    kept = ~np.isin(space.nodes, space.mesh.node_sets.get("pad", ()))
    kept[~kept.any(axis=1)] = True
    moved = matrices * kept[:, :, None] * kept[:, None, :]
    return np.asarray(moved * (matrices.sum(axis=(1, 2)) / moved.sum(axis=(1, 2)))[:, None, None])


def make_dynamics(space: Space, laws: Mapping[str, Any], finger: Any, name: str) -> Dynamics | Static:
    """The time-dependent terms of `DYNAMICS` that the laws ask for, `Static` if there are none; `viscosity`
    (s) and `relaxation` of the `finger` are those of laws without their own.
    """
    kind: type[Dynamics] | None = DYNAMICS[name]
    if kind is None:
        return Static()
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
        return Static()
    branches = make_branches(space, rows) if rows else None
    return kind(space, eta if eta.any() else None, density if kind.inertia else None, branches)

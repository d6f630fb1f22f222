r"""Works and dissipations of one accepted substep of a run, each from its own definition.

Between two equilibria 0 and 1, with :math:`\Delta` the change of a quantity and
:math:`\bar f = (f_0 + f_1)/2`: internal forces f (tissue, viscosity, mass), forms of the user
:math:`f_u`, attraction :math:`f_e`, contact :math:`\lambda` and the reaction r of the bone b
balance at both ends, :math:`f + f_u = f_e + \lambda + r`. So the trapezoidal works telescope to
the solver's tolerance,

.. math:: \bar r\cdot\Delta b - \bar f_u\cdot\Delta u + \bar f_e\cdot\Delta u
          = \bar f\cdot\Delta u - \bar\lambda\cdot\Delta u .

The history has

- ``external_work`` :math:`W = \bar r\cdot\Delta b - \bar f_u\cdot\Delta u + W_t`, done by bone and user's
  forms; :math:`W_t = -\tfrac{1}{2}\sum \Delta\lambda_t\,s` is of nodes that begin to slip in the substep, or
  reverse: their shear force changes while they stick and is constant while they slip;
- ``electrostatic_work`` :math:`W_e = \int f_e\cdot du` along the straight path in configuration space, the
  squared voltage growing evenly; the travel of open nodes with the bone counts trapezoidally, as the bone's
  does; ``adhesive_work`` likewise;
- ``stored_energy`` :math:`\psi` of the tissue, with penalties of the springs of the interface, of an elastic
  foundation (`evfem.terms.foundation`; displacements are then relative to its surface), and with a hand of
  its spring (``kinetic_energy``, ``viscous_dissipation`` and the work of the drive have its mass and damper);
- ``kinetic_energy`` :math:`T = v\cdot M v/2`;
- ``friction_dissipation`` :math:`D_f = \int \mu\lambda_n\,|ds|` (or the bound of another law of
  friction) over the slip s along the profile, with
  :math:`\lambda_n` growing evenly: never negative, and as exact where a node begins to slip as elsewhere;
- ``viscous_dissipation`` :math:`D_v = \int 2\eta|\Delta E|^2/\Delta t`, never negative, and what Maxwell
  branches lose (`evfem.tissue.branches`), whose energy is in ``stored_energy``; a substep without time, after
  which they are at rest, loses all of it.

Their difference is computed term by term without the work of the bone, so the balance is a check
that the forces of the accepted states are in equilibrium:

.. math:: L = (\bar f\cdot\Delta u - \Delta\psi - \Delta T - D_v) + (-\bar\lambda\cdot\Delta u - D_f)
          + (W_e - \bar f_e\cdot\Delta u) + W_t .

These are the quadrature error of the tissue, the numerical dissipation of backward differences, the work of
nodes that close, open or begin to slip, and the dependence of the attraction's work on the path. Over a
motion the sum falls with the square of the step, in time without inertia with the step, and is
``integrator_dissipation``.

A quasi-static substep may contain a **snap**: stability is lost within it (or speeds and viscous stresses
are, where time stops), and the end is far away however small the substep. Then L does not fall with the step.
It is the energy set free, and ``snap_dissipation``. A substep snaps if L > 0 and either the body, the loads
at their final values, moves along forces that grow faster than the tissue's, seen from the bone,

.. math:: \Delta f\cdot w < [f_e(u_1) - f_e(u_0 + \Delta b)]\cdot w + \text{(friction, likewise)}, \qquad
          w = \Delta u - \Delta b,

and from the surface, with u_0 and Delta u on the right (sticking nodes move relative to a pressing bone
only), or L exceeds the fraction `SNAP` of half the larger of :math:`|\Delta f\cdot w|` and of the change of
the nodes' shear times their slip. Under a prescribed charge f_e(u) is that of the voltage which keeps it, and
L is without :math:`W_e - \bar f_e\cdot\Delta u`, as W_e is that of the voltage at the begin. Both are right
in the limit of small substeps, and only decide which of two columns has L.

Where no equilibrium is near, pseudo-transient continuation leads to another one
(`evfem.solver.relaxation`). The energy set free there is the dissipation by drag,
:math:`D_d = \int S_d : \Delta E + |\Delta u|_{M_d}^2 s^2 \ge 0`, and the L of these steps, from which
:math:`D_d` is taken as :math:`D_v` is; both are ``snap_dissipation``. If their sum is negative, as it
can be in the first of these steps, which moves the loads, it is ``integrator_dissipation``.

Where the voltage is resolved in time (`evfem.terms.charging`) the pad first moves with the charges
and the voltage that it had, which is the path of :math:`W_e`, and then charge flows:
``source_work`` is the work of the source in both, ``leakage_dissipation`` that of conduction in the layers,
and

.. math:: W_s = \Delta W_f + D_l + W_e + W_a

with the ``field_energy`` of skin, gap and insulator, and with the ``stretch_work`` W_a of the field on
the tributary lengths A, :math:`\int w\,dA` with its energy w per area, which a vertical traction
leaves out. This holds for Strong and Troxel's law, which is the pressure of that field, and lacks the
work on a roughness gap that changes with the load.

Under another law these columns are 0. Kaczmarek's is the work of a source with the charge per area
eps_0 V ln[(g + D)/(g + s)]/(D - s), but leaves a closed gap a voltage across no thickness: with a leak no
displacement is both that of the law and that of layers that conduct.

The first substep begins without any load: voltage, adhesion and user's forms count as raised within it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from evfem.common.arrays import PART, SLIDE, Floats
from evfem.common.constants import SMALLEST_FORCE
from evfem.contact.signorini import STICK, sizes
from evfem.newton.control import VoltageControl
from evfem.newton.interface import slipped
from evfem.newton.state import State
from evfem.simulation.model import Model
from evfem.terms.traction import PadPath, PadState

#: fraction of the work of the change of internal forces or shear that a small smooth substep cannot set free
SNAP = 0.5
#: fraction of the work of the internal forces, absolute values added, that is the solver's tolerance; of
#: a body without forces `SMALLEST_FORCE` takes their place
NOISE = 1e-7
#: shear of a node relative to that after a substep below which it is none
UNSHEARED = 1e-6


@dataclass(frozen=True, eq=False)
class EnergyState:
    """Energy balance, data of an accepted state: internal forces and forces of user-supplied forms (N, dim),
    energies of tissue, springs, motion.
    """

    forces: Floats
    user_forces: Floats
    stored: float
    springs: float
    kinetic: float

    @property
    def energies(self) -> tuple[float, float, float]:
        """Energies of tissue, springs, motion."""
        return self.stored, self.springs, self.kinetic

    @property
    def energy(self) -> float:
        """Total energy."""
        return sum(self.energies)

    @property
    def columns(self) -> dict[str, float]:
        """The energies of the history."""
        return {"stored_energy": self.stored + self.springs, "kinetic_energy": self.kinetic}

    @classmethod
    def nothing(cls, shape: tuple[int, ...]) -> EnergyState:
        """Before the first substep, with displacements of this shape."""
        none = np.zeros(shape)
        return cls(none, none, 0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SubstepWork:
    """One accepted substep of a run of `model`, from `old` to `new`; the `first` begins without any load; of
    its target the `control` of the voltage.
    """

    model: Model
    old: State
    new: State
    first: bool = False
    control: VoltageControl = field(default_factory=VoltageControl)

    def end(self) -> EnergyState:
        """Forces and energies at the end of the substep."""
        body, new = self.model.body, self.new
        user_forces = body.given_forces(new.u)
        springs = float(sum(term.stored(new) for term in self.model.terms))
        kinetic = float(sum(term.kinetic(new) for term in self.model.terms))
        return EnergyState(
            body.forces(new.u) - user_forces, user_forces, body.energy(new.u), springs, kinetic
        )

    def works(self, begin: EnergyState, end: EnergyState) -> dict[str, float]:
        """Contributions of the substep to the columns that add up, N mm per mm of depth."""
        old, new, body = self.old, self.new, self.model.body
        moved, slip_onset = new.u - old.u, self._slip_onset_work()
        external_work = _mean_work(old.reaction, new.reaction, new.bone - old.bone) + slip_onset
        external_work -= _mean_work(begin.user_forces, end.user_forces, moved)
        pulled, friction = self.pulled(), self.friction()
        pulls = {f"{name}_work": work for name, work in pulled.items()}
        driven = float(sum(term.work(old, new) for term in self.model.terms))
        viscous = float(sum(term.dissipation(old, new, self._seconds) for term in self.model.terms))
        external_work += driven
        lost = slip_onset + sum(pulls.values()) - friction + driven
        lost += _mean_work(begin.forces, end.forces, moved) - (end.energy - begin.energy) - viscous
        lost -= _mean_work(*self._on_surface, moved[self.model.pad.nodes])
        lost -= (drag := body.drag_dissipation(new.u))
        free = lost - self._apart()
        snap = drag + lost > 0.0 and (body.drag_rate > 0.0 or self._snaps(begin.forces, end.forces, free))
        snapped = (0.0, drag + lost) if snap else (drag + lost, 0.0)
        own = {"electrostatic_work": 0.0, "external_work": external_work, "friction_dissipation": friction}
        own |= {"viscous_dissipation": viscous, "integrator_dissipation": snapped[0]}
        own |= {"snap_dissipation": snapped[1]} | pulls
        for room in self.model.shown:
            own |= room.works(self)
        return own

    def _slip_onset_work(self) -> float:
        """Correction of the boundary work for nodes that start to slip within the substep: their shear force
        changes while they stick and is constant while they slip.
        """
        old, new, slip = self.old, self.new, self._slip
        before, after = old.contact_force[:, 1:], new.contact_force[:, 1:]
        rounding = UNSHEARED * sizes(after) * sizes(slip)  # its sign says nothing
        begins = (old.status == STICK) | (old.touching & (np.sum(before * slip, axis=1) > rounding))
        return -0.5 * float(np.sum(((after - before) * slip)[begins & new.touching]))

    def pulled(self) -> dict[str, float]:
        """Works of the tractions by name, N mm per mm of depth."""
        return {one.name: one.work_along(path) for one, path in self._paths()}

    def _apart(self) -> float:
        """Work of the tractions in the books that is none of a snap: it is not on the path of the end forces,
        or of a traction that is there at once in the first substep, as a weight is that is let go.
        """
        paths = self._paths()
        if self.first:
            return float(sum(traction.work_apart(path) for traction, path in paths))
        return sum(self.control.apart(*each) for each in paths)

    def _paths(self) -> list[tuple[Any, PadPath]]:
        """The tractions with their paths."""
        before, after = (self.model.equilibrium.pulls(state) for state in (self.old, self.new))
        tractions = self.model.attraction.parts
        return [(one, self.path(before[one.name], after[one.name])) for one in tractions]

    @cached_property
    def pads(self) -> tuple[PadState, PadState]:
        """The pad before and after; in the first substep tractions without a voltage are raised from 0."""
        interface, touching = self.model.equilibrium.interface, self.old.touching
        before, after = (interface.pad_state(state, touching) for state in (self.old, self.new))
        return replace(before, load=0.0) if self.first else before, after

    def path(self, before: Floats, after: Floats) -> PadPath:
        """The path of the pad for the work of a traction with these forces (P, dim) at both ends."""
        if self.first:
            before = np.zeros_like(after)
        open_ = ~(self.old.touching | self.new.touching)
        # trapezoidal only for the travel with the bone, and only of nodes that the surface does not stop
        turned = self.relative_displacement - np.where(open_[:, None], self.new.bone - self.old.bone, 0.0)
        return PadPath(*self.pads, self.relative_displacement, turned, (before, after))

    def friction(self) -> float:
        """Dissipation by friction D_f, N mm per mm of depth."""
        length, (begin, end) = self.slip_length, self.positions
        if not length.any():
            return 0.0
        before, after = (np.maximum(state.contact_force[:, 0], 0.0) for state in (self.old, self.new))
        fractions = SLIDE[:, None]
        normal = (1.0 - fractions) * before + fractions * after
        ends, positions = (self.old, self.new), begin + fractions[..., None] * (end - begin)
        resists = self.model.equilibrium.interface.resistance
        limit = np.array([resists(ends, *each, length) for each in zip(positions, normal, strict=True)])
        slips = self._foundation.stretched(ends, end - begin, length)
        return float(PART @ np.sum(limit * slips, axis=1))

    @property
    def _seconds(self) -> float:
        return float(self.model.equilibrium.interface.duration)

    @cached_property
    def positions(self) -> tuple[Floats, Floats]:
        """x[, z] of the pad nodes (P, d) before and after."""
        begin, end = (self.model.equilibrium.interface.on_display(state) for state in (self.old, self.new))
        return begin, end

    @cached_property
    def relative_displacement(self) -> Floats:
        """Displacements of the pad's nodes relative to the surface (P, dim) in mm."""
        moved = (self.new.u - self.old.u)[self.model.pad.nodes]
        return self._foundation.relative_displacement((self.old, self.new), moved)

    @property
    def _foundation(self) -> Any:
        return self.model.equilibrium.interface.foundation

    @property
    def _on_surface(self) -> tuple[Floats, Floats]:
        """Forces of contact and attraction (P, dim) before and after."""
        contact = self.model.equilibrium.interface.contact_forces
        before, after = (contact(state) + state.attraction for state in (self.old, self.new))
        return before, after

    @cached_property
    def _slip(self) -> Floats:
        """Slips (P, d) in mm along the surface."""
        return slipped(self.model.equilibrium.interface, self.old, self.new)

    @cached_property
    def slip_length(self) -> Floats:
        """Slip of the pad nodes (P,), in mm."""
        return sizes(self._slip)

    def _friction_coefficient(self, position: Floats) -> Floats:
        """Friction coefficient of the pad nodes (P,) at the positions (P, d)."""
        return self.model.equilibrium.interface.friction(self.old, np.arange(len(position)), position)

    def _snaps(self, before: Floats, after: Floats, lost: float) -> bool:
        """Whether stability was lost in the substep, from the internal forces (N, dim) and L."""
        new, old = self.new, self.old
        rooms = (*self.model.terms, *self.model.attraction.parts)
        if any(room.takes_time(self._seconds) for room in rooms):
            return False
        moved = new.u - old.u
        along = moved - (new.bone - old.bone)
        balanced = np.abs(after * moved).sum() + SMALLEST_FORCE * np.abs(moved).max()
        if not lost > NOISE * float(balanced):
            return False
        work = float(np.sum((after - before) * along))
        changed = np.linalg.norm((new.contact_force - old.contact_force)[:, 1:], axis=1)
        if lost > 0.5 * SNAP * max(abs(work), float(changed @ self.slip_length)):
            return True
        carried = replace(old, u=old.u + (new.bone - old.bone))
        return all(work < self._growing_work(begin) for begin in (carried, old))

    def _growing_work(self, begin: State) -> float:
        """Work of the growth of attraction and friction from `begin` to the end, under the end loads."""
        model, old, new = self.model, self.old, self.new
        along = (new.u - begin.u)[model.pad.nodes]
        pads = [replace(model.equilibrium.pad_state(state), voltage=new.voltage) for state in (begin, new)]
        volts = self.control.along(model.attraction, pads)
        at = [model.equilibrium.attraction_at(old, *each) for each in zip((begin, new), volts, strict=True)]
        work = float(np.sum((at[1] - at[0]) * along))
        less = self._friction_coefficient(model.equilibrium.interface.on_display(begin))
        less = less - self._friction_coefficient(self.positions[1])
        return work + float(np.sum(less * new.contact_force[:, 0] * self._with_slip(along)))

    def _with_slip(self, along: Floats) -> Floats:
        """Component (P,) of the displacements `along` (P, dim) of the pad nodes in the direction of slip."""
        travel = self.model.equilibrium.interface.surface_at(self.new).travel
        way = self._slip / np.maximum(self.slip_length, 1e-300)[:, None]
        return np.einsum("pa,paj,pj->p", way, travel, along[:, ::2])


def _mean_work(before: Floats, after: Floats, moved: Floats) -> float:
    return float(0.5 * np.sum((before + after) * moved))

r"""Equilibrium steps of the condensed pad on a flat surface: contact, friction and attraction
solved exactly, the tissue only as the displacements its forces make (`evfem.fast.memory`).

With contact forces :math:`\lambda`, attraction a and the bone at b the pad nodes have moved by
:math:`b + q(\lambda + a)`. Each iteration solves Signorini-Coulomb (`evfem.contact.signorini`,
with the fall of the attraction with the gap of open nodes) for the linear change
:math:`\bar C(\lambda^+ - \lambda + a(g) - a)` of these positions and evaluates q again. The laws
of contact and the attraction hold at the accepted positions; what differs from the full model is
q.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import (
    PAD_BONE_INCREMENT,
    PAD_FEWEST,
    PAD_SPARE,
    PAD_SPRING,
    PAD_VOLTAGE_CHANGE,
    PAD_WEIGHT_CHANGE,
    SMALLEST_FORCE,
    WEAK,
)
from evfem.contact.attracted import AttractionStiffness
from evfem.contact.attraction import Attraction
from evfem.contact.condensed import Candidates
from evfem.contact.pad import surface_state
from evfem.contact.signorini import (
    BACKWARD,
    FORWARD,
    OPEN,
    STICK,
    ContactNotSolved,
    ContactProblem,
    ContactSolution,
    ExtraUnknowns,
    solve_with_attraction,
)
from evfem.fast.memory import CondensedPad
from evfem.fast.woodbury import Factors, KeptProblem
from evfem.solver.control import Force, Target
from evfem.solver.interface import Interface
from evfem.solver.state import Balance, Limits, Record, Reusable, State


class RememberedPad:
    """The remembered pad behind `evfem.solver.equilibrium.LinearisedBody`. Displacements (P, 2) of
    its states are those of the pad nodes alone.
    """

    def __init__(
        self, pad: CondensedPad, interface: Interface, attraction: Attraction | None, limits: Limits
    ) -> None:
        self.body, self.interface, self.attraction = pad, interface, attraction
        self.pad, self.surface, self.tolerance = interface.pad, interface.surface, limits.tolerance
        self.size, self.record = interface.pad.nodes.size, Record()
        self.largest_bone_increment = PAD_BONE_INCREMENT * float(np.ptp(interface.points[:, 1]))
        #: how far the pad nodes are beside what is remembered (P, 2), and where the next step ends, if known
        self._beside: Floats = np.zeros((self.size, 2))
        self._near_end: State | None = None
        self._moved = self._frozen = False
        self._iterated = True
        self._weight = np.full(len(pad.force), np.inf)
        self._factors = Factors()
        self._stiffness: tuple[float, Floats] = (np.nan, np.zeros(0))
        self._play: Ints = np.zeros(0, dtype=np.int64)
        self._near: Floats = np.zeros((0, 0))
        self._mean: Floats = np.zeros((0, 0))

    def correct(self, beside: Floats, near_end: State) -> None:
        """From the next step on, which ends near the state `near_end`, the pad nodes are `beside`
        (P, 2) what is remembered, in mm.
        """
        short = self.tolerance * self.interface.length
        self._moved = bool(np.abs(beside - self._beside).max() > short)
        self._beside, self._near_end = beside, near_end

    def known(self, old: State, target: Target) -> State | None:
        """The pad carried along as it is, where it is in full slip and nothing else changes."""
        if self._moved or not self._goes_on(old, target):
            return None
        moved = np.array([target.x - old.bone[0], 0.0])
        return replace(old, u=old.u + moved, bone=np.array([target.x, old.bone[1]]))

    def begin(self, old: State, target: Target, frozen: bool, start: State) -> State:
        """Where iterations start: `start`, near the end if that is known, or for the first touch
        under a force the stored equilibria.
        """
        self._frozen, self._iterated = frozen, False
        begin = start
        if start is old and self._near_end is not None:
            begin = replace(self._near_end, u=self._near_end.u + self._beside)
        elif start is old:
            begin = self._first_guess(old, target)
        bone = target.bone(begin.bone)
        voltage = target.drive.guess(begin.voltage)
        return replace(begin, u=begin.u + (bone - begin.bone), bone=bone, voltage=voltage)

    def leaves(self, old: State, state: State, target: Target) -> None:
        """The display is flat: nothing pushes the finger aside."""

    def accepted(self, old: State, state: State) -> State:
        """The converged state, which has the forces on the bone already."""
        return state

    def admit(self, state: State, gap: float) -> None:
        """The next iteration takes what has penetrated into play."""

    def forget(self) -> None:
        """Nothing that is kept from step to step can spoil the next one."""

    def findings(self, state: State, balance: Balance) -> str:
        """Whether contact has left the nodes that are remembered."""
        spread = self.interface.shallowest_penetration(state) is not None
        return "contact spreads beyond the nodes that the fast model keeps" if spread else ""

    def verge(self, state: State, target: Target) -> None:
        """Not known: the full model says it."""

    def reusable(self) -> Reusable:
        """Nothing that another run could use."""
        return Reusable(np.zeros(0, dtype=np.int64), None, 0.0)

    def resume(self, state: State, carried: Reusable) -> None:
        """Nothing to put back."""

    def _goes_on(self, old: State, target: Target) -> bool:
        """Whether the pad, in full slip already, is carried along as it is: a level surface with
        one coefficient of friction, and nothing else changes.
        """
        way = target.x - old.bone[0]
        if way == 0.0 or old.voltage != target.drive.voltage or not self._same_friction(old, way):
            return False
        if self.attraction is not None and not self.attraction.air_layer:
            return False
        if isinstance(target.height, Force):
            missing = target.height.missing(float(old.bone[1]), old.reaction)
            held = abs(missing) <= self.tolerance * np.abs(old.reaction).max()
        else:
            held = target.bone(old.bone)[1] == old.bone[1]
        touching = old.status[old.status != OPEN]
        return bool(held and touching.size and (touching == (FORWARD if way > 0.0 else BACKWARD)).all())

    def _same_friction(self, old: State, way: float) -> bool:
        """Whether one coefficient holds wherever the pad is and will be after `way` (mm)."""
        if not isinstance(getattr(self.surface, "friction", None), float):
            return False
        x = self.interface.positions(old.u)[:, 0]
        found = np.asarray(self.surface.friction_coefficient(np.concatenate([x, x + way])))
        return bool((found == found.flat[0]).all())

    def _first_guess(self, old: State, target: Target) -> State:
        """Where iterations begin: the old state, or for the first touch under a prescribed force
        the stored equilibria with that force.
        """
        if not isinstance(target.height, Force) or old.touching.any():
            return old
        between = self.body.pressed(target.height.force)
        u = self.body.under(between)
        contact = np.where(between[:, 1:] > 0.0, between - old.attraction, 0.0)
        touching = self.pad.free & (contact[:, 1] > 0.0)
        if not touching.any():
            return old
        gap = surface_state(self.surface, self.interface.positions(u)).gap
        bone = np.array([old.bone[0], -gap[touching].mean()])
        force = np.where(touching[:, None], contact[:, ::-1], 0.0)
        status = np.where(touching, STICK, OPEN)
        return replace(old, u=u + bone, bone=bone, contact_force=force, status=status)

    def balance(self, state: State, attraction: Floats, target: Target) -> tuple[State, Balance]:
        """Forces that the positions do not know of yet: the change of the attraction since they
        were found, node by node and in sum, and what a prescribed force lacks.

        A step is not accepted before its first iteration, however little it asks for: what is
        left out of one step is not known in the next one.
        """
        lacking = attraction - state.attraction
        state = replace(state, attraction=attraction)
        reaction = -on_pad(state).sum(axis=0)
        missing = target.height.missing(float(state.bone[1]), reaction)
        largest = max(np.abs(reaction).max(), SMALLEST_FORCE)
        free = max(np.abs(lacking).max(), np.abs(lacking.sum(axis=0)).max(), abs(missing))
        residual = float(free / largest) if self._iterated else max(float(free / largest), 1.0)
        return replace(state, reaction=reaction), Balance(lacking, residual, attraction)

    def advance(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """Solve contact for the linear change of the positions, then move as the pad does."""
        self._iterated = True
        attracted = balance.attraction
        near_compliance, mean = self._compliance(state)
        near = self.body.kept.near[self._play]
        stiffness, gain = self._attraction_stiffness(old, state, attracted)
        known = self.interface.candidates(old, state, near, stiffness, gain)
        change = balance.forces
        moved = np.concatenate([known.surface.gap, known.slip]) - near_compliance @ known.force.T.ravel()
        if change.any():
            moved += mean @ self.body.kept.gather(change)
        lacking = None
        if isinstance(target.height, Force):
            lacking = target.height.force - float(attracted[:, 1].sum())
        found = self._contact(known, moved, near_compliance, lacking)
        lift = float(found.extra.sum())
        if abs(lift) > self.largest_bone_increment or (lacking is not None and not found.status.any()):
            # too far for a linear step, which may rest on a single node
            lift = float(np.copysign(self.largest_bone_increment, lift))
            found = self._contact(known, moved + lift * self._upward(near.size), near_compliance, None)
        force, status = np.zeros_like(state.contact_force), np.zeros_like(state.status)
        force[near], status[near] = found.force.reshape(2, -1).T, found.status
        attraction = attracted.copy()
        attraction[near] += found.attraction_drop.reshape(2, -1)[::-1].T
        bone = state.bone.copy()
        bone[1] += lift
        u = bone + self.body.under(force[:, ::-1] + attraction) + self._beside
        return replace(state, u=u, contact_force=force, status=status, bone=bone, attraction=attraction)

    def _attraction_stiffness(self, old: State, state: State, attracted: Floats) -> tuple[Floats, Floats]:
        """How fast the attraction of every pad node weakens with its gap (P,), and what it gains
        on closing (P,); nothing where it is frozen.
        """
        stiffness, gain = np.zeros((2, self.size))
        if self.attraction is not None and not self._frozen:
            position = self.interface.resting(state)
            stiffness = self._stiffness_at(position, state.voltage, old)
            position[:, 1] = self.surface.y
            closed = self.attraction.forces(position, state.voltage, old.touching)
            gain = np.maximum(attracted - closed, 0.0)[:, 1]
        return stiffness, gain

    def _contact(
        self, known: Candidates, moved: Floats, compliance: Floats, lacking: float | None
    ) -> ContactSolution:
        """Contact among the near nodes; if their pressing forces shall add up to `lacking` (N/mm),
        the bone's height is one more unknown.
        """
        own = np.diagonal(compliance)[: known.slip.size]
        extra_unknowns = None
        if lacking is not None:
            lift = self._upward(known.slip.size)
            # a pad that touches nothing hangs on a spring too weak to count
            spring = np.array([[-PAD_SPRING / own.mean()]])
            extra_unknowns = ExtraUnknowns(lift[:, None], lift[None].copy(), spring, np.array([lacking]))
        stiffness = np.where(known.negative_stiffness * own > WEAK, known.negative_stiffness, 0.0)
        problem = KeptProblem(moved, compliance, known.friction, extra_unknowns, factors=self._factors)
        attraction = AttractionStiffness(stiffness, known.surface.gap, known.gain_on_closing)
        try:
            found = solve_with_attraction(problem, attraction, known.status)
        except ContactNotSolved:
            # with less rounding
            exact = ContactProblem(moved, compliance, known.friction, extra_unknowns)
            found = solve_with_attraction(exact, attraction, known.status)
        self.record.contact_solves += found.solves
        return found

    @staticmethod
    def _upward(near: int) -> Floats:
        """What a rise of the bone by 1 mm does to gaps and slips (2 k,) of the near nodes."""
        return np.repeat([1.0, 0.0], near)

    def _stiffness_at(self, position: Floats, voltage: float, old: State) -> Floats:
        """Negative stiffness of every pad node (P,), at or shortly before `position`: the contact
        problem's factors are kept with it.
        """
        assert self.attraction is not None
        made_at, stiffness = self._stiffness
        if not abs(voltage**2 - made_at**2) <= PAD_VOLTAGE_CHANGE * made_at**2:
            stiffness = self.attraction.negative_stiffness(position, voltage, old.touching)
            self._stiffness = voltage, stiffness
        return stiffness

    def _compliance(self, state: State) -> tuple[Floats, Floats]:
        """Compliance among the k nodes in play, near nodes that touch or may do so soon (2 k, 2
        k), and from all kept nodes to them (2 k, 2 K).
        """
        weight = self.body.weights(on_pad(state))
        near = self.body.kept.near
        gap = surface_state(self.surface, self.interface.positions(state.u)).gap[near]
        needed = (state.status[near] != OPEN) | (gap < 0.0)
        if (
            np.abs(weight - self._weight).sum() < PAD_WEIGHT_CHANGE
            and needed[self._play].sum() == needed.sum()
        ):
            return self._near, self._mean
        enough = min(int(PAD_SPARE * needed.sum()) + PAD_FEWEST, near.size) - 1
        self._play = np.flatnonzero(needed | (gap <= np.partition(gap, enough)[enough]))
        k, size = self._play.size, self.body.kept.size
        mean = self.body.mean_compliance(weight).reshape(2, size, 2, size)[:, self._play]
        self._near = np.ascontiguousarray(mean[:, :, :, self._play]).reshape(2 * k, 2 * k)
        self._mean = mean.reshape(2 * k, 2 * size)
        self._weight, self._stiffness = weight, (np.nan, np.zeros(0))
        return self._near, self._mean


def on_pad(state: State) -> Floats:
    """All forces on the pad nodes of a flat scene (P, 2)."""
    return state.contact_force[:, ::-1] + state.attraction

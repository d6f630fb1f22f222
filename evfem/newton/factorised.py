r"""The linearised body in an equilibrium step (`evfem.newton.equilibrium`): factorise, solve contact, update.

Algorithm (`FactorisedBody.advance`), one outer iteration::

    factorise at the iterate if the present factorisation is outdated
    g <- forward elimination of -R
    forces, statuses, extra unknowns <- contact of the linearised body, the voltage solved along if unknown
    if the bone would move too far for a linear step: shorten its travel and solve contact again
    du <- back-substitution; halve it while a sampled volume would shrink below J = 0.05
    next iterate <- Anderson's combination with those before (`evfem.newton.anderson`), unless it goes
        too far, or the attraction's negative stiffness had to be scaled down; restarted with a new
        tangent after an older one

If contact has no solution with an older tangent, the iteration is done again with a new one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evfem.common import constants
from evfem.common.arrays import Floats
from evfem.contact.condensed import LinearContactStep, StepSolution
from evfem.contact.signorini import FORWARD, ContactNotSolved
from evfem.contact.stability import SLOPES, StabilityRatio, stability_ratio
from evfem.newton.anderson import Anderson
from evfem.newton.control import Target
from evfem.newton.interface import Interface
from evfem.newton.linearisation import Linearisation
from evfem.newton.pressure import Unbalanced, make_pressure
from evfem.newton.search import VoltageProblem
from evfem.newton.state import (
    Balance,
    Collapsed,
    Limits,
    Reusable,
    State,
    findings,
)
from evfem.newton.travel import Travel
from evfem.terms.traction import PadTraction
from evfem.tissue.body import Body


@dataclass(frozen=True, eq=False)
class Update:
    """Increments of a linear step: contact, bone (2,), displacements (N, 2) in mm, voltage; the `fraction`
    of them that is applied.
    """

    contact: StepSolution
    bone: Floats
    u: Floats
    driven: float
    fraction: float


class FactorisedBody:
    """The linearised body: contact is solved on the condensed tangent of the finite elements."""

    def __init__(self, body: Body, interface: Interface, attraction: PadTraction, limits: Limits) -> None:
        self.body, self.interface, self.limits = body, interface, limits
        self.attraction = attraction
        self.size, self.pad = body.space.size, interface.pad
        self.linearisation = Linearisation(body, interface, self.attraction, limits)
        self.pressure = make_pressure(body.tissue, self.linearisation)
        self.record = self.linearisation.record
        longest = constants.LARGEST_BONE_INCREMENT * float(np.ptp(body.space.mesh.points[:, 1]))
        self.travel = Travel(interface, longest)
        self._anderson = Anderson()
        self._renewed = self._scaled_down = False

    # -- a step begins

    def begin(self, old: State, target: Target, start: State) -> State:
        """Prepare a step; returns the first iterate."""
        self.linearisation.begin(old)
        state = self._first_guess(start, target).remembering(self.pressure.first(start.u))
        travel = abs(target.bone(old.bone)[1] - old.bone[1])
        self.linearisation.choose_candidates(state, constants.REACH * travel)
        self.linearisation.begin_step(old, target.duration)
        self._anderson.reset()
        self._renewed = self._scaled_down = False
        return state

    def _first_guess(self, state: State, target: Target) -> State:
        """Predictor: the last increment once more, or the bone's translation if nothing touches."""
        state = replace(state, voltage=target.voltage.guess(state.voltage))
        if state.touching.any():
            return self._extrapolated(state, target)
        bone = target.bone(state.bone)
        return replace(state, u=state.u + (bone - state.bone), bone=bone)

    def _extrapolated(self, state: State, target: Target) -> State:
        """Predictor: repeat the last displacement increment, scaled so that the bone moves by its prescribed
        increment (at most `reach` times); none if the bone reverses or a cell would collapse.
        """
        node = self.body.space.mesh.node_sets["bone"][0]
        last, ahead = state.last_increment[node], target.increment(state.bone)
        axis = int(np.argmax(np.abs(ahead)))
        # where the bone turns, its last increment along the new direction is rounding of either sign
        if ahead[axis] * last[axis] <= constants.TURNED * ahead[axis] ** 2:
            return state
        fraction = min(float(ahead[axis] / last[axis]), self.limits.strategy.reach)
        u = state.u + fraction * state.last_increment
        if not self.body.tissue.smallest_J(u) > constants.SMALLEST_J:
            return state
        return replace(state, u=u, bone=u[node].copy())

    # -- how far from equilibrium

    def balance(self, state: State, attraction: Floats, target: Target) -> tuple[State, Balance]:
        """Out-of-balance forces of the reduced unknowns and their relative size."""
        nodal = self.body.forces(state.u)
        nodal[self.pad.nodes] -= (pad := attraction + self.interface.contact_forces(state))
        forces = self.body.reduce(nodal)
        state = replace(state, attraction=attraction, reaction=forces[self.body.bone])
        largest = lambda other: self._largest(state, target, other)  # noqa: E731
        missed = self.interface.foundation.missed(self.interface.positions(state.u), state, pad)
        residual = max(largest(forces), missed)
        mixed = self.pressure.balance(state, Unbalanced(forces, residual, largest, self.body.reduce))
        return state, Balance(forces, residual, attraction, mixed)

    def _largest(self, state: State, target: Target, forces: Floats) -> float:
        """The largest of the out-of-balance forces (n,), relative to the reaction in them."""
        reaction = forces[self.body.bone]
        rounding = self._rounding(state) / self.limits.tolerance
        largest = max(np.abs(reaction).max(), constants.SMALLEST_FORCE, rounding)
        dim = state.bone.size
        sums = max(abs(forces[axis:-dim:dim].sum()) for axis in range(dim))
        missing = [target.height.missing(float(state.bone[1]), reaction), target.voltage.missing(reaction)]
        missing.append(target.drive.unbalanced(state.bone[::2], reaction))
        free = max(np.abs(forces[:-dim]).max(), sums, *np.abs(missing))
        return max(
            float(free / largest),
            target.voltage.lacking(self.attraction, self.linearisation.pad_state(state)),
        )

    def _rounding(self, state: State) -> float:
        """Forces (N/mm) below which the balance is rounding: of displacements, stresses and attraction."""
        epsilon = float(np.finfo(float).eps)
        travel = max(4.0 * float(np.abs(state.bone).max()), self.interface.length)
        rounding = epsilon * self.linearisation.stiffest * travel
        if not self.attraction.rounding:
            return rounding
        return max(rounding, self.attraction.rounding * float(np.abs(state.attraction).max()))

    # -- one outer iteration

    def advance(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """The next iterate, with the present factorisation or, where that is outdated, a new one."""
        again = self._renewed
        self._renewed = self.linearisation.refactorise_if_needed(state, self.record.residuals)
        if self._renewed and not again:
            self._anderson.reset()
        try:
            after = self._linear_step(old, state, target, balance)
        except ContactNotSolved:
            if self.linearisation.is_tangent_of(state):
                raise
            self.linearisation.factorise(state)
            self._anderson.reset()
            after = self._linear_step(old, state, target, balance)
        after = self._with_new_candidates(old, state, target, balance, after)
        if self._scaled_down:  # a fraction of the update: no image of the fixed-point map
            self._anderson.reset()
            return after
        return self._accelerated(state, after, target)

    def _accelerated(self, state: State, after: State, target: Target) -> State:
        """Anderson's combination of `after` with earlier iterates; `after` itself if that is too far.
        Prescribed quantities keep their exact values.
        """
        combined = self._anderson.next_iterate(state, after)
        if combined is not after:
            travel = abs(float(combined.bone[1] - state.bone[1])) if target.height.free else 0.0
            # it may invert cells, or move a free bone too far
            if (
                travel > self.travel.longest
                or not self.body.tissue.smallest_J(combined.u) > constants.SMALLEST_J
            ):
                self._anderson.reset()
                return after
        voltage = combined.voltage if target.voltage.free else after.voltage
        return replace(combined, bone=np.where(target.free, combined.bone, after.bone), voltage=voltage)

    def _with_new_candidates(
        self, old: State, state: State, target: Target, balance: Balance, after: State
    ) -> State:
        """The next iterate; penetrating nodes become candidates, and many new ones repeat the linear step."""
        if not self.interface.follows:
            return after
        for _ in range(constants.CANDIDATE_ROUNDS):
            known = self.linearisation.candidates.size
            gap = self.interface.shallowest_penetration(after)
            if gap is None:
                break
            self.add_candidates(after, gap)
            if self.linearisation.candidates.size < constants.CANDIDATE_GROWTH * known:
                break
            self.linearisation.factorise(state)
            self._anderson.reset()
            after = self._linear_step(old, state, target, balance)
        return after

    def _linear_step(self, old: State, state: State, target: Target, balance: Balance) -> State:
        """Solve the contact problem of the linearised body and update; halved where cells would collapse."""
        factor = self.linearisation.factor
        saved, residual = factor.forward(-balance.of_tangent(self.linearisation.is_tangent_of(state)))
        step = self._contact_step(old, state, target, residual)
        driven = target.voltage.solve(step, self._problem(saved, state))
        found, bone = self.travel.limited(step, driven.solution, state, target, self._solve)
        if driven.change:
            saved = saved + driven.change * driven.unit
        delta = self.body.expand(factor.backward(saved, np.concatenate([found.moved, bone])))
        update = Update(found, bone, delta, driven.change, self._largest_fraction(state.u, delta))
        moved = self._updated(state, target, update)
        return moved.remembering(self.pressure.after(state, balance.mixed.misfit, delta, update.fraction))

    def _contact_step(self, old: State, state: State, target: Target, residual: Floats) -> LinearContactStep:
        """The linear contact problem at an iterate."""
        linearisation, tangent = self.linearisation, self.linearisation.tangent
        weakening, gain = linearisation.weakening(state), linearisation.gain_on_closing(state)
        known = self.interface.candidates(old, state, c := linearisation.candidates, weakening, gain)
        known = replace(known, by_force=linearisation.by_force(state)[c])
        # inexact where contact takes many solves: a fraction of the residual
        within = constants.INNER * self.record.residuals[-1] if self.interface.follows else 0.0
        return LinearContactStep(
            body=tangent,
            candidates=known,
            residual=residual,
            bone=target.bone(state.bone) - state.bone,
            unknowns=target.unknowns(tangent, state.bone),
            below=self.interface.foundation.of(self.interface.positions(state.u), state, c),
            tolerance=max(constants.ROUNDING, within),
        )

    def _solve(self, step: LinearContactStep) -> StepSolution:
        found = step.solve()
        self.record.contact_solves += found.solves
        self._scaled_down = found.reduced
        return found

    def _problem(self, saved: Floats, state: State) -> VoltageProblem:
        """Data for a voltage control; `saved` is the residual's state for the backward solve."""
        factor, pad, nodes = self.linearisation.factor, self.linearisation.pad_state(state), self.pad.nodes

        def pushed(forces: Floats) -> tuple[Floats, Floats]:
            nodal = np.zeros_like(state.u)
            nodal[nodes] = forces
            return factor.forward(self.body.reduce(nodal))

        def measured(gradient: Floats, unit: Floats) -> tuple[Floats, float, float]:
            row = pushed(gradient)[1]
            moved = [self.body.expand(factor.backward(each, np.zeros(row.size))) for each in (saved, unit)]
            still, own = (float(np.sum(gradient * each[nodes])) for each in moved)
            return row, still, own

        squared = (state.voltage / constants.KILOVOLT) ** 2
        unit = lambda: pushed(self.attraction.parts[0].unit(pad))  # noqa: E731
        return VoltageProblem(squared, self._solve, unit, pushed, measured, pad, self.attraction)

    def _updated(self, state: State, target: Target, update: Update) -> State:
        """The iterate after the fraction of an update that may be taken."""
        c, fraction = self.linearisation.candidates, update.fraction
        force, status = np.zeros_like(state.contact_force), np.zeros_like(state.status)
        force[c], status[c] = update.contact.force, update.contact.status
        whole = fraction == 1.0 and not target.free.any()
        voltage = state.voltage
        if update.driven:
            voltage = target.voltage.after(voltage, fraction * update.driven)
        after = replace(
            state,
            u=state.u + fraction * update.u,
            contact_force=state.contact_force + fraction * (force - state.contact_force),
            status=status,
            bone=target.bone(state.bone) if whole else state.bone + fraction * update.bone,
            voltage=voltage,
        )
        # below the candidates the foundation moves as the linear step found, which includes the change
        # of the attraction
        push = lambda: self.interface.contact_forces(replace(after, u=state.u)) + state.attraction  # noqa: E731
        found = c, update.contact.foundation, fraction
        return after.remembering(
            self.interface.foundation.sunk(self.interface.positions(state.u), state, push, found)
        )

    def _largest_fraction(self, u: Floats, delta: Floats) -> float:
        """Largest fraction 1, 1/2, 1/4 ... of an update that keeps every sampled volume."""
        fraction = 1.0
        while not self.body.tissue.smallest_J(u + fraction * delta) > constants.SMALLEST_J:
            fraction *= 0.5
            if fraction < constants.SHORTEST_FRACTION:
                raise Collapsed("cells would collapse", self.record.residuals)
        return fraction

    def stability_ratio(self, state: State, target: Target) -> StabilityRatio | None:
        """The larger stability ratio of the equilibrium `state` and of its prediction towards `target`, as
        the curvature of a profile may jump. None in three dimensions.
        """
        if state.bone.size == 3:
            return None
        ahead = self.begin(state, target, start=state)
        state = state.remembering(self.pressure.first(state.u))  # none is kept between steps
        self.linearisation.factorise(state)
        still = np.zeros(len(self.linearisation.tangent.schur))
        none, found = np.zeros(self.body.reduce(state.u).size), []
        for point in (state, ahead):
            step = self._contact_step(state, point, target, still)
            also = target.voltage.unknowns(step, self._problem(none, point))
            found.append(stability_ratio(replace(step, unknowns=(*step.unknowns, *also))))
        return max(found, key=lambda one: one.ratio)

    # -- a step ends

    def leaves(self, old: State, state: State, target: Target) -> StabilityRatio | None:
        """The stability ratio of the equilibrium `state` if contact forces on crests make it unstable, by the
        present tangent and by the one there, else None: iterations may come to such a state from afar. Not
        tested in time, in three dimensions, and for the attraction, whose instability the iterations show.
        """
        linearisation = self.linearisation
        crests = (state.status >= FORWARD) & (self.interface.surface_at(state).curvature[:, 0, 0] < 0.0)
        if self.body.takes_time(target.duration) or state.bone.size == 3 or not crests.any():
            return None
        if linearisation.outdated:
            linearisation.factorise(state)
        found = self._crest_instability(old, state, target)
        if found is not None and not linearisation.is_tangent_of(state):
            linearisation.factorise(state)
            found = self._crest_instability(old, state, target)
        return found

    def _crest_instability(self, old: State, state: State, target: Target) -> StabilityRatio | None:
        """Stability ratio by the present tangent without attraction, if it is above 1 because of contact
        forces on crests; else None.
        """
        step = self._contact_step(old, state, target, np.zeros(len(self.linearisation.tangent.schur)))
        unattracted = replace(step.candidates, negative_stiffness=np.zeros(step.candidates.status.size))
        try:
            found = stability_ratio(replace(step, candidates=unattracted), least=1.0)
        except np.linalg.LinAlgError:
            return None
        return found if found.cause == SLOPES and found.ratio > 1.0 else None

    def add_candidates(self, state: State, gap: float) -> None:
        """A node that was no candidate has penetrated by `gap` (mm, negative): it becomes one."""
        self.linearisation.choose_candidates(state, max(0.0, gap))

    def discard(self) -> None:
        """Drop the factorisation, so that the next step starts from a fresh one."""
        self.linearisation.factor = None

    def findings(self, state: State, balance: Balance) -> str:
        """The largest out-of-balance forces, the state of contact and the smallest volume ratio."""
        return findings(self.body, state, balance)

    def reusable(self) -> Reusable:
        """Candidates, the point of the factorisation and the precision that it needs."""
        of = self.linearisation
        return Reusable(of.candidates, of.reusable, of.inaccurate)

    def resume(self, carried: Reusable) -> None:
        """Repeat the factorisation that the interrupted run had."""
        self.linearisation.candidates = carried.candidates
        self.linearisation.inaccurate = carried.inaccurate
        if (at := carried.tangent_point) is not None:
            self.pressure.check(at.state.memory.get("pressure", np.zeros((0, 0))))
            self.linearisation.restore(at)

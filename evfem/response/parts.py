r"""The equations of an accepted substep of a run, its nodes' statuses fixed, and their matrix.

With w = (u, bone, :math:`\lambda`) at the end of a substep, the state z before it and the parameters p, a
substep obeys R(w; z, p) = 0: the balance of the free unknowns; for every axis of the bone its position or the
force on it; and per pad node

=====  ========================================================
open   :math:`\lambda = 0`
stick  :math:`g = 0`, slip since z :math:`= 0`
slip   :math:`g = 0`, :math:`\lambda_t + b(\lambda_n, x, s)\,s/|s| = 0`
=====  ========================================================

with the bound b of friction, :math:`\mu(x)\lambda_n` under Coulomb's law. The displacement of an elastic
surface follows from w (`Equations.surface_displacement`). `Equations` evaluates the components of the run's
model: tissue, attraction, surface, friction law, controls.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK, sizes
from evfem.newton.control import MET, ConstrainedVoltage, FollowFriction, KeptCharge, Target, Unsupported
from evfem.newton.interface import Interface
from evfem.newton.search import strength
from evfem.newton.state import State
from evfem.simulation.model import Model
from evfem.terms.traction import PadState

#: what determines a voltage: itself, that of the state before, its lower bound 0, a wished charge, gap or
#: friction force, or the bound of friction of a pad that sticks
GIVEN, KEPT, ZERO, WISH, BOUND = "given", "kept", "zero", "wish", "bound"


@dataclass(frozen=True, eq=False)
class Equations:
    """R of one substep of `model` from `old` to `target`; made by `begin`, which begins the substep."""

    model: Model
    old: State
    target: Target

    @classmethod
    def begin(cls, model: Model, old: State, target: Target, pins: Floats) -> Equations:
        """Begin the substep from `old`: velocities, branches, charges and slips count from there; `pins`
        (P, d) are positions of nodes pinned to a discontinuity of friction, else nan.
        """
        target = model.equilibrium.begin(old, target)
        model.equilibrium.interface.jumps.place = pins
        return cls(model, old, target)

    @property
    def interface(self) -> Interface:
        """Of the model."""
        return self.model.equilibrium.interface

    def _attracted(self, state: State) -> State:
        """The state with its attraction."""
        attraction = self.model.equilibrium.attraction_at(self.old, state, state.voltage)
        return replace(state, attraction=attraction)

    def surface_displacement(self, state: State) -> tuple[Floats, Floats]:
        """Contribution of an elastic surface to relative positions, and its gradient
        (`evfem.terms.foundation`).
        """
        force = self.interface.contact_forces(state) + self._attracted(state).attraction
        below = self.interface.foundation.under(self.interface.positions(state.u), state)
        return below.given(force), below.change(force)

    def accepted_state(self, state: State) -> State:
        """The state as the run would accept it, with its memory, but for its reaction."""
        return self.model.equilibrium.accept(self.old, self._attracted(state), self.target)

    def smooth(self, state: State) -> tuple[Floats, Floats]:
        """Smooth part of the residual R (m,), and its reaction (dim,)."""
        body = self.model.body
        forces = body.reduce(body.forces(state.u))
        contact = np.where(self._near(state), 0.0, self.contact(state)[0])
        reaction = forces[body.bone]
        bone = self._bone(replace(state, reaction=reaction))
        return np.concatenate([forces[: -state.bone.size], bone, contact.ravel()]), reaction

    def nonsmooth(self, state: State) -> tuple[Floats, Floats]:
        """Nonsmooth part of the residual R (m,): attraction, friction, contact on a profile; its reaction."""
        body, nodal = self.model.body, np.zeros_like(state.u)
        attraction = self._attracted(state).attraction
        nodal[self.model.pad.nodes] -= attraction + self.interface.contact_forces(state)
        forces = body.reduce(nodal)
        reaction = forces[body.bone]
        forces[body.bone] = [
            -reaction[axis] if self.force_controlled(axis) else 0.0 for axis in range(reaction.size)
        ]
        contact = np.where(self._near(state), self.contact(state)[0], 0.0)
        return np.concatenate([forces, contact.ravel()]), reaction

    def _near(self, state: State) -> Any:
        """Which residuals of contact are nonsmooth, (P, dim) bool."""
        slips = (state.status >= FORWARD)[:, None]
        return (slips & (np.arange(state.bone.size) > 0)) | (not self.interface.surface.is_flat)

    def lacking(self, state: State, slips: bool) -> float:
        """What the equation of a voltage that is found lacks: wished less present charge, gap or friction
        force; less also the friction that sticking nodes do not use, where it is that at which the pad slips.
        """
        control = self.target.voltage
        if isinstance(control, ConstrainedVoltage):
            reading, wanted = control.read(self.model.attraction, self._pad(state))
            return float(wanted - reading.value)
        assert isinstance(control, FollowFriction)
        wish = control.wish(self.target.place - self.old.bone[::2])
        unused = self.interface.unused_friction(self.old, state, wish.ahead) if slips else 0.0
        return wish.lacking(state.reaction) - unused

    def voltage_by(self, state: State) -> str:
        """What determines the voltage of the accepted `state`: one of the words at the head of this file."""
        control, tolerance = self.target.voltage, self.model.equilibrium.tolerance
        if not control.sought or isinstance(control, KeptCharge):
            return WISH if control.sought else GIVEN
        if state.voltage == 0.0:
            return ZERO
        if not isinstance(control, FollowFriction):
            return WISH
        if control.missed(state, tolerance) == 0.0:
            return WISH
        if state.voltage in (control.voltage, self.old.voltage):
            return GIVEN if state.voltage == control.voltage else KEPT
        slips = abs(self.lacking(state, slips=True)) <= MET * tolerance * strength(state)
        return BOUND if slips else ""

    def _pad(self, state: State) -> PadState:
        return self.interface.pad_state(state, self.old.touching)

    def force_controlled(self, axis: int) -> bool:
        """Whether the bone is force-controlled along an axis, not displacement-controlled."""
        return bool(self.target.free[axis])

    def _bone(self, state: State) -> Floats:
        """Residual of the bone (dim,): of its position in mm, or of the force on it in N/mm."""
        target, found = self.target, state.bone - self.target.bone(state.bone)
        if target.height.free:
            found[1] = target.height.missing(float(state.bone[1]), state.reaction)
        elif isinstance(target.height, Unsupported):
            found[1] = state.bone[1] - self.old.bone[1]
        found[::2] = target.drive.residual(state.bone, target.place, state.reaction)
        return found

    def _slip(self, state: State) -> Floats:
        """Slips (P, dim - 1) in mm, with the tangential yielding of a penalty."""
        yields = self.interface.compliance(self.old)[:, 1:]
        return self.interface.slip(self.old, state) + yields * (
            state.contact_force[:, 1:] - self.old.contact_force[:, 1:]
        )

    def held(self, state: State) -> State:
        """The state with nodes of zero slip as sticking: in space their slips have no direction."""
        still = sizes(self._slip(state)) <= self.interface.tolerance * self.interface.length
        status = np.where((state.status >= FORWARD) & still, STICK, state.status)
        return state if state.bone.size == 2 else replace(state, status=status)

    def bound(self, state: State, position: Floats, slip: Floats) -> Floats:
        """Bound of friction (P,) in N/mm at positions (P, d) with slips of the size `slip` (P,)."""
        return self.interface.limit(self.old, state, self.interface.jumps.at(position), slip)

    def contact(self, state: State) -> tuple[Floats, Floats, Floats]:
        """Residuals of contact (P, dim), slips (P, dim - 1) and bounds of friction (P,)."""
        interface, status = self.interface, state.status
        normal, shear = np.split(state.contact_force, [1], axis=1)
        gap = interface.surface_at(state).normal_gap + interface.compliance(self.old)[:, 0] * normal[:, 0]
        slip = self._slip(state)
        size = np.where(status >= FORWARD, sizes(slip), 0.0)
        bound = self.bound(state, interface.on_display(state), size)
        sliding = shear + bound[:, None] * directions(status, slip)
        along = np.where(
            (status == STICK)[:, None], slip, np.where((status >= FORWARD)[:, None], sliding, shear)
        )
        return np.column_stack([np.where(status == OPEN, normal[:, 0], gap), along]), slip, bound

    def margins(self, state: State) -> Floats:
        """How far nodes are from another status (P + 1, 2): gap (mm) of open ones, contact force of closed
        ones; shear force below the bound of sticking ones, slip (mm) of slipping ones, inf of open ones; at
        last a voltage that follows a force from its bounds, or at one of them the force from the wish.
        """
        slip, bound = self.contact(state)[1:]
        touching = state.status != OPEN
        gap = self.interface.surface_at(state).gap
        first = np.where(touching, state.contact_force[:, 0], np.where(self.interface.pad.free, gap, np.inf))
        left = bound - sizes(state.contact_force[:, 1:])
        second = np.where(state.status == STICK, left, sizes(slip))
        nodes = np.column_stack([first, np.where(touching, second, np.inf)])
        return np.vstack([nodes, self._voltage_margins(state)])

    def _voltage_margins(self, state: State) -> Floats:
        """How far the voltage of a friction force is from what else may determine it, (2,); inf of others."""
        control = self.target.voltage
        if not isinstance(control, FollowFriction):
            return np.full(2, np.inf)
        if 0.0 < state.voltage < control.voltage:
            return np.array([state.voltage, control.voltage - state.voltage])
        return np.array([self.lacking(state, slips=False), np.inf])


def directions(status: Ints, slip: Floats) -> Floats:
    """Unit vectors (P, dim - 1) along the slips of slipping nodes, else 0."""
    if slip.shape[1] == 1:
        return np.subtract(status == FORWARD, status == BACKWARD, dtype=float)[:, None]
    found = slip / np.maximum(sizes(slip), 1e-300)[:, None]
    return np.where((status >= FORWARD)[:, None], found, 0.0)

r"""Energy barrier between two equilibria.

A substep leads from u_0 to u_1. Under the constant loads of its END it has the potential

.. math:: \Phi(u) = \psi(u) - W_e(u_0 \to u;\,U_1) - r_1\cdot(b - b_0) + D_f(\lambda_1)
          + \Phi_t(u) ,

of which u_1 is a stationary point: tissue and springs, attraction, the reaction on the bone, friction under
the contact forces of the end, and of a step in time :math:`\Phi_t` of viscosity, branches, drag and inertia
(`evfem.tissue.dynamics`). Where it is convex it falls along the whole straight path in configuration space
from u_0 to u_1, however long the substep, whatever nodes slip, close or open. So a rise on that path (`rise`)
shows a barrier: iterations have crossed it, the body never would. The converse does not hold: several
equilibria may be reached without a barrier.

A bone with prescribed position is at its end position already: nodes that do not touch at both ends begin
translated with it, as far as they moved along: beside the contact the tissue below holds them back. Nodes
that touch at both ends follow the surface, not the chord; to first order that adds
:math:`-\lambda_1 g` on the chord. Slips are those along an elastic surface as it is stretched at the end. A
spring of the hand adds its stiffness. Charges are those of the end, and where that of the electrode is
prescribed, the voltage varies on the path (`VoltageControl.along`).
For an attraction without a potential (the vertical one on changing tributary lengths, that of touching
nodes alone, the full field beside its columns) the work along the straight path is taken; where another path
has another work, a barrier of that difference may be missed.

The potential with the loads of the end is the upper estimate of the energy in the theory of
rate-independent systems; evaluated along the path it selects the branch that begins at the last state. A.
Mielke, T. Roubicek, Rate-Independent Systems (2015), doi:10.1007/978-1-4939-2706-7.
"""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats
from evfem.newton.control import Target, VoltageControl
from evfem.simulation.works import SubstepWork
from evfem.surface.pad import surface_state

#: fractions of the path at which the potential is sampled, and, denser at its ends, the attraction
SAMPLES = np.linspace(0.0, 1.0, 9)
FINE_SAMPLES = np.linspace(0.0, 1.0, 33) ** 2 * (3.0 - 2.0 * np.linspace(0.0, 1.0, 33))
#: smallest stored energy (N mm) to which a barrier is related: below is the rounding of stiff cells
SMALLEST_ENERGY = 1e-6


def rise(substep: SubstepWork, target: Target) -> float:
    """Energy barrier: the largest rise of the potential on the straight path of a substep, relative to the
    stored energy.
    """
    body, old, new = substep.model.body, substep.old, substep.new
    increment = new.u - old.u
    stored = body.energies(old.u, increment, SAMPLES)
    rooms = substep.model.equilibrium.interface.rooms
    ends = [stored[i] + sum(room.stored(state) for room in rooms) for i, state in ((0, old), (-1, new))]
    carried = _moved_with_bone(substep, target)
    load_work = float(new.reaction @ (new.bone - old.bone)) + float(np.sum(new.attraction * carried))
    load_work = load_work - float(np.sum(body.given_forces(new.u) * increment))
    potential = stored - stored[0] + (_friction_work(substep) - load_work) * SAMPLES
    potential += _contact_work(substep) + _drag_potential(substep)
    potential -= _attraction_work(substep, carried, target.voltage)
    potential = potential + sum(term.potential(old, new, SAMPLES) for term in substep.model.terms)
    climbed = potential - np.minimum.accumulate(potential)
    return float(climbed.max()) / max(*ends, SMALLEST_ENERGY)


def _moved_with_bone(substep: SubstepWork, target: Target) -> Floats:
    """Displacements (P, dim), with a bone of prescribed position, of pad nodes that move along; 0 where they
    keep touching.
    """
    travel = substep.new.bone - substep.old.bone
    travel[target.free] = 0.0
    moved = (substep.new.u - substep.old.u)[substep.model.pad.nodes]
    along = np.clip(moved @ travel, 0.0, square := float(travel @ travel)) / (square or 1.0)
    sticks = any(one.always for one in substep.model.attraction.parts)  # what adheres is not carried off
    stays = substep.old.touching & (substep.new.touching | sticks)
    return np.where(stays[:, None], 0.0, along[:, None] * travel)


def _attraction_work(substep: SubstepWork, carried: Floats, control: VoltageControl) -> Floats:
    """Work of the attraction up to the `SAMPLES` under the end's voltage or charges, as the `control` of the
    voltage has them, after the translation `carried`.
    """
    attraction, old, new = substep.model.attraction, substep.old, substep.new
    if not attraction.acts(new.voltage):
        return np.zeros_like(SAMPLES)
    along, equilibrium = substep.relative_displacement - carried, substep.model.equilibrium
    begin = equilibrium.interface.resting(old) + carried
    begin[:, 1] -= np.minimum(surface_state(substep.model.surface, begin).gap, 0.0)
    ends = equilibrium.pulls(new)
    paths = [(one, substep.path(ends[one.name], ends[one.name])) for one in attraction.parts]
    work = sum(one.released_work(path, along, begin, FINE_SAMPLES, control) for one, path in paths)
    return np.asarray(np.interp(SAMPLES, FINE_SAMPLES, work))


def _friction_work(substep: SubstepWork) -> float:
    """Dissipation of the slips under the contact forces of the end."""
    length = substep.slip_length
    if not length.any():
        return 0.0
    interface, (begin, end) = substep.model.equilibrium.interface, substep.positions
    slips = interface.foundation.stretched((substep.new, substep.new), end - begin, length)
    return float(np.sum(interface.limit(substep.old, substep.new, end, length) * slips))


def _contact_work(substep: SubstepWork) -> Floats:
    """Work against the contact forces of nodes that touch at both ends, as they leave their chord."""
    model, old, new = substep.model, substep.old, substep.new
    touching = old.touching & new.touching
    if model.surface.is_flat or not touching.any():
        return np.zeros_like(SAMPLES)
    begin, end = (model.equilibrium.interface.places(state)[touching] for state in (old, new))
    normal = new.contact_force[touching, 0]
    lifts = [-normal @ surface_state(model.surface, begin + s * (end - begin)).gap for s in SAMPLES]
    return np.array(lifts) - lifts[0] * (1.0 - SAMPLES) - lifts[-1] * SAMPLES


def _drag_potential(substep: SubstepWork) -> Floats:
    """The potential of drag since the begin of the substep."""
    increment = substep.new.u - substep.old.u
    lost = substep.model.body.drag_dissipation
    drag = np.array([0.5 * lost(substep.old.u + s * increment) for s in SAMPLES])
    return drag - drag[0]

r"""Whether the finger could get from one equilibrium to the next without climbing.

A part leads from u_0 to u_1. With the loads of its END held it has the potential

.. math:: \Phi(u) = \psi(u) - W_e(u_0 \to u;\,U_1) - r_1\cdot(b - b_0) + D_f(\lambda_1)
          + \Phi_t(u) ,

of which u_1 is a stationary point: tissue and springs, attraction, the reaction on the bone, friction under
the contact forces of the end, and of a step in time :math:`\Phi_t` of viscosity, branches, drag and inertia
(`evfem.tissue.dynamics`). Where it is convex it falls all along the straight way from u_0 to u_1, however
long the part, whatever slips, lands or leaves. So a rise on that way (`rise`) shows a barrier: iterations
have come to u_1 over it, the body never would. The reverse does not hold: of several equilibria some may all
lie downhill.

A bone that is held and not loaded has its place at the end already: nodes that do not touch at both ends
begin where it carries them. Nodes that touch at both ends follow the surface, not the chord; to first
order that adds :math:`-\lambda_1 g` on the chord. A spring of the hand adds its own stiffness. Charges
are those of the end. An attraction without a potential (the vertical one on changing tributary lengths,
that of touching nodes alone, the full field beside its columns) is asked for its work along the straight
way alone; where another way would give another work, a barrier of that difference may be missed.

The potential with the loads of the end is the upper estimate of the energy in the theory of
rate-independent systems; asked along the way it selects the branch that begins at the last state. A.
Mielke, T. Roubicek, Rate-Independent Systems (2015), doi:10.1007/978-1-4939-2706-7.
"""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats
from evfem.newton.control import Target
from evfem.simulation.works import SubstepWork
from evfem.surface.pad import surface_state

#: where the potential is taken on the way, and, denser at its ends, the attraction
PLACES = np.linspace(0.0, 1.0, 9)
FINE = np.linspace(0.0, 1.0, 33) ** 2 * (3.0 - 2.0 * np.linspace(0.0, 1.0, 33))
#: stored energy (N mm) that a climb is compared with at least: below it is the rounding of stiff cells
LEAST = 1e-6


def rise(part: SubstepWork, target: Target) -> float:
    """The highest climb of the potential on the straight way of a part, as a share of the stored energy."""
    body, old, new = part.model.body, part.old, part.new
    way = new.u - old.u
    springs = [float(0.5 * np.sum(part.compliance * state.contact_force**2)) for state in (old, new)]
    stored = body.energies(old.u, way, PLACES) + springs[0] + (springs[1] - springs[0]) * PLACES**2
    before, between, after = part.yielded
    stored = stored + (1.0 - PLACES) ** 2 * before + (1.0 - PLACES) * PLACES * between + PLACES**2 * after
    carried = _carried(part, target)
    given = float(new.reaction @ (new.bone - old.bone)) + float(np.sum(new.attraction * carried))
    given = given - float(np.sum(body.given_forces(new.u) * way))
    potential = stored - stored[0] - _pulled(part, carried) + (_rubbed(part) - given) * PLACES
    potential = potential + _lifted(part) + _dragged(part)
    potential = potential + sum(term.potential(old, new, PLACES) for term in part.model.terms)
    climbed = potential - np.minimum.accumulate(potential)
    return float(climbed.max()) / max(stored[0], stored[-1], LEAST)


def _carried(part: SubstepWork, target: Target) -> Floats:
    """Displacements (P, dim) of pad nodes with a bone that is not loaded; 0 where they keep touching."""
    travel = part.new.bone - part.old.bone
    travel[target.free] = 0.0
    sticks = any(one.always for one in part.model.attraction.parts)  # what adheres is not carried off
    return np.where((part.old.touching & (part.new.touching | sticks))[:, None], 0.0, travel)


def _pulled(part: SubstepWork, carried: Floats) -> Floats:
    """Work of the attraction up to `PLACES` under the end's voltage or charges, after `carried`."""
    attraction, old, new = part.model.attraction, part.old, part.new
    if not attraction.acts(new.voltage):
        return np.zeros_like(PLACES)
    along, equilibrium = part.way - carried, part.model.equilibrium
    begin = equilibrium.interface.resting(old) + carried
    begin[:, 1] -= np.minimum(surface_state(part.model.surface, begin).gap, 0.0)
    ends = equilibrium.pulls(new)
    paths = [(one, part.path(ends[one.name], ends[one.name])) for one in attraction.parts]
    work = sum(one.released_work(path, along, begin, FINE) for one, path in paths)
    return np.asarray(np.interp(PLACES, FINE, work))


def _rubbed(part: SubstepWork) -> float:
    """Dissipation of the slips under the contact forces of the end."""
    length = part.slip_length
    if not length.any():
        return 0.0
    interface, normal = part.model.equilibrium.interface, np.maximum(part.new.contact_force[:, 0], 0.0)
    return float(np.sum(interface.resistance((part.old, part.new), part.places[1], normal, length) * length))


def _lifted(part: SubstepWork) -> Floats:
    """Work against contact forces of nodes that touch at both ends, off the chord of their places."""
    model, old, new = part.model, part.old, part.new
    touching = old.touching & new.touching
    if model.surface.is_flat or not touching.any():
        return np.zeros_like(PLACES)
    begin, end = (model.equilibrium.interface.places(state)[touching] for state in (old, new))
    normal = new.contact_force[touching, 0]
    lifts = [-normal @ surface_state(model.surface, begin + s * (end - begin)).gap for s in PLACES]
    return np.array(lifts) - lifts[0] * (1.0 - PLACES) - lifts[-1] * PLACES


def _dragged(part: SubstepWork) -> Floats:
    """The potential of drag, which counts from the release."""
    way = part.new.u - part.old.u
    held = np.array([0.5 * part.model.body.drag_dissipation(part.old.u + s * way) for s in PLACES])
    return held - held[0]

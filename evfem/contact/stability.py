r"""Stability of an equilibrium: how close it is to its loss, and which force causes it.

Closed nodes are fixed along the normal, sticking ones along the tangent too. Free are the slips of the
slipping nodes and the gaps of the open ones. With the compliance C of body and bone in local
frames, and :math:`m = \pm\mu` of the slipping nodes, forces along the slips move them by

.. math:: A = C_{tt} - (C_{tn} + C_{tt} m)\,(C_{nn} + C_{nt} m)^{-1} C_{nt},

gaps of open nodes likewise. Four forces grow with such a motion, with a destabilising stiffness D: contact
forces that turn with the profile, :math:`D = -\lambda_n (1 + \mu^2)\,h''/(1 + h'^2)^{3/2}`, positive on a
crest; friction whose coefficient falls along the path, :math:`D = -\lambda_n\,d\mu/ds`; friction that falls
with the speed, :math:`D = -(db/dv)/\Delta t`; the attraction of open nodes, :math:`D = -A\,dp/dg`.

`stability_ratio` is the ratio of destabilising to stabilising stiffness: the largest real eigenvalue
of A D. At 1 stability is lost; the cause named is the force that works most in the eigenvector.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evfem.common.arrays import Floats, Ints, block
from evfem.contact.condensed import Candidates, LinearContactStep
from evfem.contact.follower import local
from evfem.contact.signorini import FORWARD, OPEN, STICK, ExtraUnknowns

#: the forces, by what they do
SLOPES = "on the slopes of the profile the contact forces push the finger aside"
FALLING = "friction falls along the path"
FASTER = "friction falls with the speed"
ATTRACTION = "the attraction grows as the gap closes"


@dataclass(frozen=True)
class StabilityRatio:
    """The ratio of destabilising to stabilising stiffness, 1 at the loss of stability, and its cause, the
    force that works most in the unstable motion, in words.
    """

    ratio: float
    cause: str


def stability_ratio(step: LinearContactStep, least: float = 0.0) -> StabilityRatio:
    """Stability of the equilibrium that `step` begins at; 0 stands for a ratio below `least`."""
    held = (step.candidates.status != OPEN) | (step.candidates.negative_stiffness > 0.0)
    known = step.candidates[(nodes := np.flatnonzero(held))]
    surface = known.surface
    slipping = np.flatnonzero(known.status >= FORWARD)
    opened = np.flatnonzero((known.status == OPEN) & (known.negative_stiffness > 0.0))
    ratio = (known.friction * known.shear_direction[:, 0])[slipping]
    normal = np.maximum(known.force[slipping, 0], 0.0)
    turning = -normal * (1.0 + ratio**2) * (surface.curvature[:, 0, 0] / surface.stretch**3)[slipping]
    slope = known.friction_slope[slipping, 0] / surface.stretch[slipping]
    falling, none, far = np.sign(ratio) * normal * slope, np.zeros(slipping.size), np.zeros(opened.size)
    faster = none if known.slip_stiffness is None else -known.slip_stiffness[slipping]
    grows = {
        SLOPES: np.concatenate([turning, far]),
        FALLING: np.concatenate([falling, far]),
        FASTER: np.concatenate([faster, far]),
        ATTRACTION: np.concatenate([none, known.negative_stiffness[opened]]),
    }
    stiffness = sum(grows.values(), np.zeros(none.size + far.size))
    largest, motion = _largest_eigenvalue(_free_compliance(step, nodes, slipping, opened), stiffness, least)
    return StabilityRatio(largest, max(grows, key=lambda cause: float(grows[cause] @ motion**2)))


def _free_compliance(step: LinearContactStep, nodes: Ints, slipping: Ints, opened: Ints) -> Floats:
    """Compliance (f, f) of slips and gaps of these nodes, contact fixed, the bone free where it is loaded."""
    known, bone = step.candidates[nodes], _bone(step, nodes)
    axes, closed, stick = known.surface.axes, np.flatnonzero(known.status != OPEN), known.status == STICK
    C = step.tilt(nodes).compliance(step.among(nodes))
    C = local(axes, local(axes, C).T).T + np.diag(_interface_compliance(known).ravel())
    held, free = np.append(2 * closed, 2 * np.flatnonzero(stick) + 1), np.append(2 * slipping + 1, 2 * opened)
    ratio, moving = (known.friction * known.shear_direction[:, 0])[closed], np.vstack([C, bone.rows])
    pushes = moving[:, held]
    pushes[:, : closed.size] += moving[:, 2 * closed + 1] * ratio
    matrix = np.block([[pushes[held], bone.columns[held]], [pushes[len(C) :], bone.pivot]])
    moved = np.linalg.solve(matrix, np.vstack([block(C, held, free), bone.rows[:, free]]))
    return block(C, free, free) - np.hstack([pushes[free], bone.columns[free]]) @ moved


def _interface_compliance(known: Candidates) -> Floats:
    """Compliance of the interface (c, 2), along normal and tangent. Along the tangent a slipping node has one
    only if its friction falls with the speed of the slip: what turns with the profile or falls along the
    path depends on the node's position alone.
    """
    give = np.where((known.status == OPEN)[:, None], 0.0, known.interface_compliance)
    falls = np.zeros(known.status.size) if known.slip_stiffness is None else known.slip_stiffness
    give[:, 1] = np.where((known.status >= FORWARD) & (falls >= 0.0), 0.0, give[:, 1])
    return give


def _bone(step: LinearContactStep, nodes: Ints) -> ExtraUnknowns:
    """The bone's travel under a prescribed force as an extra unknown, with its equation, for these nodes."""
    rows, axes = step.body.rows(nodes), step.candidates.surface.axes[nodes]
    if not step.unknowns:
        none = np.zeros((0, rows.size))
        return ExtraUnknowns(none.T, none, np.zeros((0, 0)), np.zeros(0))
    pushes = np.column_stack([unknown.push for unknown in step.unknowns])
    moved = step.body.compliance @ pushes[:-2]
    S, by_unknowns, wanted, carried = step.equations
    tilt, pivot = step.tilt(nodes), S[:, :-2] @ moved + by_unknowns
    row, _ = tilt.equations(carried[:, rows], wanted, np.zeros(rows.size))
    carried = local(axes, row.T).T
    return ExtraUnknowns(local(axes, tilt.motion(moved[rows])), carried, pivot, np.zeros(wanted.size))


def _largest_eigenvalue(A: Floats, stiffness: Floats, least: float) -> tuple[float, Floats]:
    """Largest real eigenvalue of A times a diagonal stiffness, 0 if below `least` >= 0, and its vector."""
    if not stiffness.any() or (np.abs(A) @ np.abs(stiffness)).max() < least:  # no eigenvalue is above
        return 0.0, np.zeros_like(stiffness)
    values, vectors = np.linalg.eig(A * stiffness)
    fastest = int(np.argmax(values.real))
    return max(float(values[fastest].real), 0.0), np.abs(vectors[:, fastest])

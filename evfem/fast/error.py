r"""How far a fast run is from the full model, along its whole path.

The remembered pad (`evfem.fast.memory`) goes to :math:`q(f)` under the forces f, the pad of the
full model to :math:`q(f) + \delta`. Everything else, contact, friction and attraction, is solved
by both, so that :math:`\delta` is all that separates their paths. Algorithm (`stated_error`)::

    states <- a few of the path, the shape q of each as far as can be from those before it
    delta <- at these: the equilibrium of the finger under f, the bone held; its pad's u less q(f)
    delta <- at the others: interpolated over the shape
    run the path again, with q(f) + delta
    error <- `MARGIN` times the largest difference of the two runs

An error that friction remembers, or that a held indentation carries on, is thus an error of all
later steps, as it is in the full model. The interpolation leaves out some tenths of
:math:`\delta`, therefore `MARGIN`.

Shapes are the displacements q (P, 2) relative to the bone, :math:`|\cdot|` is their Euclidean
norm. :math:`\delta(q) = c + \sum_k c_k |q - q_k|` with :math:`\sum_k c_k = 0` is linear between two
states, and exact at all that are checked and at rest, where nothing has moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import SMALLEST_FORCE
from evfem.contact.pad import Pad
from evfem.contact.surfaces import Flat
from evfem.fast.memory import CondensedPad
from evfem.fast.run import FastRun, limits_of
from evfem.fast.step import on_pad
from evfem.fast.training import Memory
from evfem.scene.plan import scene_mesh
from evfem.scene.scene import Scene
from evfem.simulation.result import Row
from evfem.simulation.run import Request
from evfem.solver.control import Target
from evfem.solver.equilibrium import Equilibrium
from evfem.solver.factorised import FactorisedBody
from evfem.solver.interface import Interface
from evfem.solver.state import State, StepFailed
from evfem.solver.stepping import Unbooked
from evfem.tissue.body import Body
from evfem.tissue.space import make_space

#: forces that are compared
COMPARED = ("normal_force", "tangential_force", "electrostatic_force")
#: what is found is stated so many times, for the sake of what the interpolation leaves out
MARGIN = 1.5
#: the held finger's distance from a surface, in its heights
FAR = 10.0
#: shapes that differ by less than this fraction of the largest are one
SAME = 1e-9


class HeldFinger:
    """The finger of a scene, its bone held, under given forces on the pad: an equilibrium far
    above any surface.
    """

    def __init__(self, scene: Scene, pad: Pad) -> None:
        mesh, element = scene_mesh(scene)
        self.pad, self.limits = pad, limits_of(scene)
        body = Body(make_space(mesh, element), scene.finger.materials)
        low, high = mesh.points[:, 1].min(), mesh.points[:, 1].max()
        far = Flat(friction=0.0, y=float(low - FAR * (high - low)))
        # one contact candidate, always the same, so that the matrix is analysed once
        one = np.arange(pad.nodes.size) == np.argmax(pad.free)
        interface = Interface(replace(pad, free=one), mesh.points, far, self.limits.tolerance)
        self._solver = Equilibrium(
            FactorisedBody(body, interface, None, self.limits), interface, None, self.limits
        )

    def under(self, force: Floats, start: Floats) -> Floats:
        """Displacements (P, 2) of the pad nodes under forces (P, 2), sought from those of all nodes
        (N, 2). Raises `StepFailed`.
        """
        rest = self._solver.rest(np.zeros(2), 0.0)
        found = self._solver.step(rest, Target.held(rest.bone, 0.0), force, replace(rest, u=start))
        return np.asarray(found.u[self.pad.nodes])

    def forget(self) -> None:
        """Drop what is kept from one call of `under` to the next."""
        self._solver.body.forget()


class CorrectedRun(FastRun):
    """A fast run again, the pad `beside` (S, P, 2) what is remembered after its S steps; rows have
    the forces alone.
    """

    def __init__(self, run: FastRun, pad: CondensedPad, beside: Floats) -> None:
        super().__init__(pad, run.scene, run.model.mesh, run.whole)
        self.beside, self.near = beside, run.states[1:]

    def advance(self, request: Request) -> None:
        """Reach a request's target; raises `StepFailed`."""
        self.remembered.correct(self.beside[request.step - 1], self.near[request.step - 1])
        self.state, _ = self.stepper.follow(self.state, request.path, Unbooked())
        self.time += request.duration
        state, model = self.state, self.model
        contact, pull = model.equilibrium.contact_forces(state).sum(axis=0), state.attraction.sum(axis=0)
        forces = dict(zip(COMPARED, (contact[1], -contact[0], -pull[1]), strict=True))
        reached = {
            "position": float(state.bone[0]),
            "indentation": model.indentation(state.bone),
            "applied_force": float(-state.reaction[1]),
            "voltage": state.voltage,
        }
        self.rows.append(reached | forces)


def stated_error(
    run: FastRun, memory: Memory, finger: HeldFinger, checks: int
) -> tuple[dict[str, float], list[int]]:
    """How far each force of a fast `run` may be from the full model's at its worst step, as a
    share of its largest, and the steps (from 1) whose states were checked for it, at most `checks`
    of them. Infinite where one of them has no equilibrium in the full model.
    """
    shapes = np.array([state.u - state.bone for state in run.states])
    # at rest nothing has moved, and nothing is missing
    shapes[0] = 0.0
    chosen = farthest(shapes, checks + 1)
    steps = sorted(int(k) for k in chosen[1:])
    # what is stated of one run must not depend on others
    finger.forget()
    try:
        beside = [missing(memory, finger, run.states[k]) for k in chosen[1:]]
        known = np.array([np.zeros_like(shapes[0]), *beside])
        again = CorrectedRun(run, memory.pad, between(shapes, shapes[chosen], known)[1:])
        for request in again.requests():
            again.advance(request)
    except StepFailed:
        return dict.fromkeys(COMPARED, np.inf), steps
    return differences(run.rows, again.rows, run.scene.solver.tolerance), steps


def missing(memory: Memory, finger: HeldFinger, state: State) -> Floats:
    """How far (P, 2) the pad nodes of the full model are beside the remembered ones under the
    forces of a state; raises `StepFailed`.
    """
    force = on_pad(state)
    start = np.tensordot(memory.pad.weights(force), memory.whole, 1)
    return finger.under(force, start) - memory.pad.under(force)


def farthest(points: Floats, most: int) -> Ints:
    """Numbers of at most `most` points (S, ...): the first one, then each the farthest from those
    before it; none is taken twice.

    >>> farthest(np.array([[0.0], [0.1], [1.0], [0.9], [-0.5], [0.4]]), 4)
    array([0, 2, 4, 5])
    """
    apart, chosen = distances(points, points[:1])[:, 0], [0]
    same = SAME * apart.max()
    while len(chosen) < most and apart.max() > same:
        chosen.append(int(np.argmax(apart)))
        apart = np.minimum(apart, distances(points, points[chosen[-1:]])[:, 0])
    return np.array(chosen)


def between(points: Floats, known: Floats, values: Floats) -> Floats:
    """Values at points (S, ...) from `values` (K, ...) at the `known` ones (K, ...).

    >>> between(np.array([[1.0], [3.0]]), np.array([[0.0], [1.0], [4.0]]), np.array([0.0, 1.0, 2.5]))
    array([1., 2.])
    """
    count = len(known)
    system = np.ones((count + 1, count + 1))
    system[:-1, :-1] = distances(known, known)
    system[-1, -1] = 0.0
    right = np.vstack([values.reshape(count, -1), np.zeros((1, values[0].size))])
    share = np.linalg.solve(system, right)
    found = distances(points, known) @ share[:-1] + share[-1]
    return np.asarray(found.reshape(len(points), *values.shape[1:]))


def distances(points: Floats, others: Floats) -> Floats:
    """Euclidean distances (S, K) of points (S, ...) from others (K, ...)."""
    flat = points.reshape(len(points), -1)
    return np.stack([np.linalg.norm(flat - other.ravel(), axis=1) for other in others], axis=1)


def differences(rows: Sequence[Row], others: Sequence[Row], least: float) -> dict[str, float]:
    """`MARGIN` times the largest difference of each force between two runs, as a share of its
    largest (at least 1e-6 N/mm), and no less than `least`.
    """
    found = {}
    for name in COMPARED:
        one, other = (np.array([row[name] for row in run]) for run in (rows, others))
        largest = max(float(np.abs(one).max()), SMALLEST_FORCE)
        found[name] = max(MARGIN * float(np.abs(one - other).max()) / largest, least)
    return found

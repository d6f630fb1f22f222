"""A scene on its way without the tissue: the remembered pad in place of the body."""

from __future__ import annotations

import time as clock
from dataclasses import replace
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.contact.pad import Pad
from evfem.errors import NotConverged
from evfem.fast.memory import CondensedPad
from evfem.fast.step import RememberedPad
from evfem.mesh.mesh import Mesh
from evfem.scene.scene import Scene
from evfem.scene.way import allowed_error
from evfem.simulation.ledger import Ledger
from evfem.simulation.model import Model, make_attraction, placed
from evfem.simulation.result import Result, provenance
from evfem.simulation.run import Request, Run
from evfem.solver.equilibrium import Equilibrium
from evfem.solver.interface import Interface
from evfem.solver.state import Limits, State, StepFailed
from evfem.solver.stepping import Stepper

ADVICE = "a fast model made from a scene with more load or friction may go further"


def limits_of(scene: Scene) -> Limits:
    """What a scene asks of its solver."""
    solver = scene.solver
    return Limits(solver.tolerance, solver.strategy, solver.threads)


class NoTissue:
    """In place of the body: its forces and its energy are not known."""

    dynamics = None
    drag_rate = 0.0

    @staticmethod
    def drag_dissipation(u: Floats) -> float:
        """Nothing: it is not released."""
        return 0.0

    @staticmethod
    def forces(u: Floats) -> Floats:
        """Not numbers."""
        return np.full_like(u, np.nan)

    @staticmethod
    def given_forces(u: Floats) -> Floats:
        """Nothing: there are no forms of the user's."""
        return np.zeros_like(u)

    @staticmethod
    def energy(u: Floats) -> float:
        """Not a number."""
        return float("nan")


class FastRun(Run):
    """A scene followed by the `remembered` pad; `states` before the first and after every step."""

    def __init__(self, pad: CondensedPad, scene: Scene, mesh: Mesh, whole: Pad) -> None:
        self.scene, self.whole = scene, whole
        alone = replace(whole, nodes=np.arange(whole.nodes.size))
        points = mesh.points[whole.nodes]
        surface, first_gap = placed(scene.ground, points)
        attraction = None
        if scene.electrics.acts:
            attraction = make_attraction(scene, mesh, whole, surface)
            attraction = replace(attraction, pad=alone)
        limits = limits_of(scene)
        interface = Interface(alone, points, surface, limits.tolerance)
        self.remembered = RememberedPad(pad, interface, attraction, limits)
        equilibrium = Equilibrium(self.remembered, interface, attraction, limits)

        body: Any = NoTissue()
        self.model = Model(scene, mesh, body, alone, surface, attraction, equilibrium, first_gap)
        self.ledger = Ledger(self.model)
        self.stepper = Stepper(equilibrium, scene.coupling, allowed=allowed_error(scene))
        self.rows, self.frames, self.time = [], [], 0.0
        self.state = equilibrium.rest(self.model.bone(0.0, 0.0), self.voltage_at(0.0, 0.0))
        self.states: list[State] = [self.state]

    def advance(self, request: Request) -> None:
        """Reach a request's target exactly and record its row."""
        begin, record = clock.perf_counter(), self.model.equilibrium.record
        iterations = record.iterations
        try:
            self.state, substeps = self.stepper.follow(self.state, request.path, self.ledger)
        except StepFailed as error:
            advice = "; ".join(part for part in (error.reason, error.findings, ADVICE) if part)
            raise NotConverged(request.step, error.residuals, advice, self.result()) from error
        self.time += request.duration
        row = self._row(request)
        row |= {"substeps": substeps, "newton_iterations": record.iterations - iterations, "relaxations": 0}
        self.rows.append(row | {"seconds": clock.perf_counter() - begin})
        self.states.append(self.state)

    def _row(self, request: Request) -> dict[str, Any]:
        """The row of the present state; where only the place has changed, that of the step before
        serves.
        """
        before, now = self.states[-1], self.state
        place = (request.step, request.motion_index, request.kind, self.time)
        if not self.rows or before.contact_force is not now.contact_force:
            return self.ledger.row(now, *place)
        if before.attraction is not now.attraction or before.bone[1] != now.bone[1]:
            return self.ledger.row(now, *place)
        named = dict(zip(("step", "motion_index", "motion", "time"), place, strict=True))
        moved = {"position": float(now.bone[0]), "voltage": now.voltage}
        return self.rows[-1] | named | moved | self.ledger.sums

    def result(self) -> Result:
        """Everything up to the last converged step."""
        record = self.model.equilibrium.record
        solver = {"model": "fast", "iterations": record.iterations, "contact_solves": record.contact_solves}
        made = provenance(self.scene, self.model.mesh, solver | {"cuts": self.stepper.cuts})
        return Result.from_rows(self.rows, [], self.model.mesh, made)

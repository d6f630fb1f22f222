"""An accepted substep of a run that is differentiated, and perturbed runs beside it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.newton.state import State
from evfem.response.parameters import Parameter
from evfem.response.parts import GIVEN, Equations
from evfem.scene.scene import Scene
from evfem.simulation.ledger import EnergyAccount
from evfem.simulation.run import Request, Run
from evfem.simulation.works import EnergyState
from evfem.surface.ways import Steps

#: discontinuities of friction
Jumps = Sequence[Steps]


@dataclass(frozen=True, eq=False)
class Accepted:
    """An accepted substep of a run: its states and their margins, its span of the step, pins of nodes at
    discontinuities of friction (`pins`, (P, d) in mm, else nan), the energy balances before and after it, and
    what determines its `voltage` (`evfem.response.parts`).
    """

    old: State
    new: State
    margins: Floats
    span: tuple[float, float]
    pins: Floats
    books: tuple[EnergyState | None, EnergyState]
    sums: tuple[dict[str, float], dict[str, float]]
    voltage: str = GIVEN


@dataclass
class Beside:
    """A perturbed run, which is never solved: of the scene with its parameter changed by `way`."""

    run: Run
    way: float
    requests: Iterator[Request]
    request: Request | None = None

    @classmethod
    def of(cls, scene: Scene, parameter: Parameter | None, way: float) -> Beside:
        """Of a scene, without the warnings that the run itself has given."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = Run(scene if parameter is None else parameter.applied(scene, way), None)
        return cls(run, way, run.requests())

    def begin(self, substep: Accepted, jumps: Jumps, old: State) -> Equations:
        """The equations of a substep from `old`; `jumps`: discontinuities of friction at the centre."""
        assert self.request is not None
        pins, own = substep.pins.copy(), self.run.model.equilibrium.interface.jumps.steps
        for node in np.flatnonzero(np.isfinite(pins[:, 0])):
            away = [np.abs(pins[node, one.axis] - one.place) for one in jumps]
            nearest = int(np.argmin([each.min() for each in away]))
            jump, axis = int(away[nearest].argmin()), jumps[nearest].axis
            pins[node, axis] += own[nearest].place[jump] - jumps[nearest].place[jump]
        return Equations.begin(self.run.model, old, self.request.path(*substep.span), pins)

    def booked(
        self, old: State, new: State, begin: EnergyState | None, sums: dict[str, float]
    ) -> EnergyAccount:
        """The energy account after a substep that begins with these."""
        ledger = EnergyAccount(self.run.model, dict(sums), begin)
        ledger.add_substep(old, new)
        return ledger

    def row(self, state: State, books: EnergyState, sums: dict[str, float]) -> dict[str, Any]:
        """The row at the end of the present step."""
        assert self.request is not None
        return self.run.row(EnergyAccount(self.run.model, sums, books), self.request, state)

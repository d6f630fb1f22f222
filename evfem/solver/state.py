"""Configurations of a body and what is asked of the next one: the nouns of the equilibrium solver."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from evfem.common.arrays import Floats, Ints
from evfem.solver.strategy import Strategy

#: voltages are squared and counted in kV^2 where they are an unknown
KILOVOLT = 1000.0
#: forces are compared with the largest reaction, or with this (N/mm) where it is smaller
SMALLEST_FORCE = 1e-6


class StepFailed(ArithmeticError):
    """An equilibrium was not found; `residuals` is the history, `reason` says what went wrong, `findings` how
    the last iterate looked.
    """

    def __init__(self, reason: str, residuals: list[float]) -> None:
        super().__init__(reason)
        self.reason, self.residuals, self.findings = reason, residuals, ""


@dataclass(frozen=True, eq=False)
class State:
    """A converged configuration: displacements u (N, 2), contact forces on the pad nodes along the profile's
    normal and tangent (P, 2), their statuses (P,), the bone's translation (2,), voltage, attraction on the
    pad nodes (P, 2), forces on the bone (2,), nodal velocities (N, 2) in mm/s, and the displacements of the
    step that led here (N, 2)."""

    u: Floats
    contact_force: Floats
    status: Ints
    bone: Floats
    voltage: float
    attraction: Floats
    reaction: Floats
    velocity: Floats
    trend: Floats


@dataclass(frozen=True, eq=False)
class Linearised:
    """Where a tangent was taken: displacements u (N, 2), voltage, which pad nodes touched (P,), whether the
    attraction was frozen, and the step's displacements at its beginning (N, 2) and its seconds.
    """

    u: Floats
    voltage: float
    touching: Any
    frozen: bool
    begin: Floats
    duration: float


@dataclass(frozen=True)
class Target:
    """Where a step goes: bone translation (2,) in mm, or its x and the downward force on it (N/mm);
    voltage (V); seconds it takes. With a wished `tangential_force` (N/mm, along x on the bone) the voltage is
    found by the step, between 0 and `voltage`.
    """

    bone: Floats
    force: float | None
    voltage: float
    duration: float = 0.0
    tangential_force: float | None = None


@dataclass(frozen=True)
class Limits:
    """When a step counts as solved, how hard it is tried, and by how many threads."""

    tolerance: float
    strategy: Strategy = field(default_factory=Strategy)
    threads: int = 1


@dataclass
class Record:
    """Work done: iterations, factorisations and dense contact solves, counted since the start."""

    iterations: int = 0
    factorisations: int = 0
    contact_solves: int = 0
    backend: str = "none"
    residuals: list[float] = field(default_factory=list)


@dataclass(frozen=True)
class Balance:
    """Out-of-balance forces of the reduced unknowns (n,), and their largest relative to the
    reaction.
    """

    forces: Floats
    residual: float

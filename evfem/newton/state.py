"""Data of the equilibrium solver: the state of a body, what the next step reuses, residuals, failures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import NAMED
from evfem.contact.signorini import OPEN, STICK
from evfem.newton.strategy import Strategy
from evfem.tissue.body import Body

#: unit of forces by dimension
FORCES = {2: "N/mm", 3: "N"}
#: what rooms keep where none keeps anything
NOTHING: Mapping[str, Any] = MappingProxyType({})


class StepFailed(ArithmeticError):
    """An equilibrium was not found: its `residuals`, the `reason`, `findings` of the last iterate;
    `unstable`: the tangent was not positive definite. Of a step that failed: its first state and target,
    `last`; whether pseudo-transient continuation was tried from there, `released`.
    """

    def __init__(self, reason: str, residuals: list[float]) -> None:
        super().__init__(reason)
        self.reason, self.residuals, self.findings = reason, residuals, ""
        self.unstable = self.released = False
        self.last: tuple[State, Any] | None = None


class Folded(StepFailed):
    """The outline of the state found crosses itself: neither a smaller substep nor pseudo-transient
    continuation (`evfem.solver.relaxation`) helps.
    """


class Collapsed(StepFailed):
    """Every update, however short, would turn a cell inside out."""


class OutOfReach(StepFailed):
    """No voltage makes what is wished of it, and none at all is the nearest."""


class LiftedOff(StepFailed):
    """The finger came off the surface during pseudo-transient continuation: the pull is larger than the
    attraction.
    """


@dataclass(frozen=True, eq=False)
class State:
    """A configuration of a body with N nodes, P of them on the pad.

    Displacements u (N, 2) in mm, contact forces along normal and tangent (P, 2) in N/mm and statuses (P,),
    the bone's translation (2,), the voltage in V, the attraction (P, 2), the forces on the bone (2,), and the
    increment of the substep that led here (N, 2). What rooms keep from substep to substep is in `memory`, by
    the names that the rooms gave (`evfem.common.rooms`).
    """

    u: Floats
    contact_force: Floats
    status: Ints
    bone: Floats
    voltage: float
    attraction: Floats
    reaction: Floats
    last_increment: Floats
    memory: Mapping[str, Any] = field(default_factory=lambda: NOTHING)

    def remembering(self, kept: Mapping[str, Any]) -> State:
        """The state with what rooms keep of it."""
        return replace(self, memory=MappingProxyType({**self.memory, **kept})) if kept else self

    @property
    def parts(self) -> dict[str, Any]:
        """All fields by name, what rooms keep as `memory.name`."""
        own = {spec.name: getattr(self, spec.name) for spec in fields(self) if spec.name != "memory"}
        return own | {f"memory.{name}": kept for name, kept in self.memory.items()}

    def with_parts(self, parts: Mapping[str, Any]) -> State:
        """The state with some of its `parts` replaced."""
        kept = {name.partition(".")[2]: value for name, value in parts.items() if "." in name}
        own = {name: value for name, value in parts.items() if "." not in name}
        return replace(self, **own).remembering(kept)

    @property
    def unit(self) -> str:
        """Unit of its forces."""
        return FORCES[self.bone.size]

    @property
    def touching(self) -> Any:
        """Pad nodes in contact, (P,) bool."""
        return self.status != OPEN


@dataclass(frozen=True, eq=False)
class Beginning:
    """The state at the begin of a step, from which terms and tractions take increments: u (N, dim), contact
    forces (P, dim), statuses (P,), voltage and memory.
    """

    u: Floats
    contact_force: Floats
    status: Ints
    voltage: float
    memory: Mapping[str, Any]

    @classmethod
    def of(cls, state: State) -> Beginning:
        """What is kept of an accepted state."""
        return cls(state.u, state.contact_force, state.status, state.voltage, state.memory)

    @property
    def touching(self) -> Any:
        """Pad nodes in contact, (P,) bool."""
        return self.status != OPEN


@dataclass(frozen=True, eq=False)
class TangentPoint:
    """Where a tangent was evaluated: the iterate, the pad nodes that `touched` (P,) when the step began, the
    begin of that step, and its duration (s).
    """

    state: State
    touched: Any
    begin: Beginning
    duration: float


@dataclass(frozen=True, eq=False)
class Reusable:
    """What the next step reuses: candidates (pad nodes), point of the factorisation, and whether factors of
    single precision were `inaccurate`.
    """

    candidates: Ints
    tangent_point: TangentPoint | None
    inaccurate: bool = False


@dataclass(frozen=True)
class Limits:
    """Tolerance, strategy, threads, and the largest planned indentation in mm (0: unknown)."""

    tolerance: float
    strategy: Strategy = field(default_factory=Strategy)
    threads: int = 1
    deepest: float = 0.0


@dataclass
class Record:
    """Numbers of iterations, factorisations and dense contact solves, the residuals of the last step, and the
    fraction of the requested step that was done when it had `begun`.
    """

    iterations: int = 0
    factorisations: int = 0
    contact_solves: int = 0
    backend: str = "none"
    residuals: list[float] = field(default_factory=list)
    begun: float = 0.0


@dataclass(frozen=True)
class MixedBalance:
    """Residual of the mixed problem (`evfem.newton.pressure`): the forces (n,) with the volumetric terms of
    the older tangent, the largest relative to the reaction, and the pressure of the material laws minus that
    of the iterate (E, Q) in MPa.
    """

    forces: Floats
    residual: float
    misfit: Floats


@dataclass(frozen=True)
class Balance:
    """Residual of an iterate: out-of-balance forces (n,) in N/mm, the largest relative to the reaction, the
    attraction (P, 2), and the mixed problem's residual, the same where it is not solved.
    """

    forces: Floats
    residual: float
    attraction: Floats
    mixed: MixedBalance

    @property
    def remaining(self) -> float:
        """The residual of the unknowns that are iterated."""
        return self.mixed.residual

    def of_tangent(self, here: bool) -> Floats:
        """The forces (n,) that a tangent made at this iterate (`here`), or elsewhere, has to remove."""
        return self.forces if here else self.mixed.forces


def findings(body: Body, state: State, balance: Balance) -> str:
    """Largest out-of-balance forces and their positions, contact statuses, and smallest volume ratio."""
    free = balance.forces.copy()
    free[body.bone] = 0.0  # its motion balances these
    forces = body.expand(free)
    nodal = np.linalg.norm(np.where(np.isnan(forces), np.inf, forces), axis=1)
    worst = np.argsort(nodal)[::-1][:NAMED]
    positions = (body.space.mesh.points + state.u)[worst]
    at = [", ".join(f"{coordinate:.4g}" for coordinate in position) for position in positions]
    named = ", ".join(
        f"{nodal[node]:.1e} {state.unit} at ({position})" for node, position in zip(worst, at, strict=True)
    )
    opened, sticking = int((state.status == OPEN).sum()), int((state.status == STICK).sum())
    slipping = state.status.size - opened - sticking
    smallest = body.tissue.smallest_J(state.u)
    return (
        f"out of balance: {named}; contact: {opened} nodes open, {sticking} stick, {slipping} slip; "
        f"smallest J of a cell: {smallest:.2g}"
    )

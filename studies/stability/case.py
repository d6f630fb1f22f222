"""What a case of the study of stability is, how it is run, and what is recorded of it.

A case is a function of a `Log`: it simulates scenes through the log, which keeps their costs and balances,
and returns whether the physics is as expected and a sentence with the numbers. What it raises is recorded.
"""

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import NotConverged
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.simulation.run import simulate

#: smallest scale of forces (N/mm) and of energies (N): what is smaller is rounding
FORCE, ENERGY = 1e-6, 1e-9
KEPT = ("stored_energy", "kinetic_energy", "friction_dissipation")
KEPT += ("viscous_dissipation", "integrator_dissipation", "snap_dissipation")
#: warnings of what some cases are about: walls and noise finer than the nodes, loads that may drift, steps
#: longer than what swings, attractions beyond the load, plates of 1 mm
EXPECTED = (
    "the surface is (sharper|rougher) than the node spacing",
    "motion . slides at constant indentation",
    "motion . has steps of",
    "at .* V touching skin is attracted",
    "the mesh is .* mm across",
)

Verdict = tuple[bool, str]


@dataclass
class Costs:
    """Costs of simulations, and the largest errors of their balances."""

    steps: int = 0
    substeps: int = 0
    cuts: int = 0
    iterations: int = 0
    force_error: float = 0.0
    energy_error: float = 0.0


@dataclass
class Log(Costs):
    """Costs and balances of everything a case has simulated so far."""

    def simulate(self, scene: Scene) -> Result:
        """The result of a scene; a step that does not converge is logged and raised again."""
        try:
            result = simulate(scene)
        except NotConverged as error:
            if isinstance(error.result, Result):
                self._add(error.result, scene)
            raise
        self._add(result, scene)
        return result

    def _add(self, result: Result, scene: Scene) -> None:
        solver = result.provenance["solver"]
        self.steps += len(result.step)
        self.substeps += int(result.substeps.sum())
        self.cuts += int(solver["cuts"])
        self.iterations += int(solver["iterations"])
        if len(result.step):
            if scene.solver.dynamics != "inertial":  # there mass carries the difference
                self.force_error = max(self.force_error, float(out_of_balance(result).max()))
            self.energy_error = max(self.energy_error, lost_energy(result))


def out_of_balance(result: Result) -> Floats:
    """Sum of all forces of every row (rows, 2), relative to its largest force (at least 1e-6 N/mm)."""
    x = [result.applied_tangential_force, -result.tangential_force, result.electrostatic_force_x]
    y = [-result.applied_force, result.normal_force, -result.electrostatic_force]
    forces = np.array([x, y])
    return np.abs(forces.sum(axis=1) / np.maximum(np.abs(forces).max(axis=(0, 1)), FORCE)).T


def lost_energy(result: Result) -> float:
    """Largest energy of any row that no column has, relative to the largest of that row's."""
    given = np.array([result.external_work, result.electrostatic_work])
    kept = np.array([getattr(result, name) for name in KEPT])
    largest = np.abs(np.concatenate([given, kept])).max(axis=0)
    return float(np.max(np.abs(given.sum(axis=0) - kept.sum(axis=0)) / np.maximum(largest, ENERGY)))


def alike(log: Log, scenes: Iterable[Scene], columns: str, allowed: float) -> Verdict:
    """Whether scenes end in the last row of the first, in these columns."""
    first, *others = [log.simulate(one) for one in scenes]
    names = columns.split()
    off = max(
        abs(float(getattr(one, name)[-1] / getattr(first, name)[-1]) - 1.0)
        for one in others
        for name in names
    )
    return off < allowed, f"{', '.join(names)} within {off:.0e}".replace("_", " ")


@dataclass(frozen=True)
class Case:
    """A group and name, the expected physics in a sentence, and the function that finds out."""

    group: str
    name: str
    expected: str
    function: Callable[[Log], Verdict]
    quick: bool = False

    @property
    def key(self) -> str:
        """Its name among the numbers."""
        return f"{self.group}.{self.name}".replace(" ", "_")


@dataclass
class Group:
    """Cases of one kind, in the order in which they are declared."""

    name: str
    cases: list[Case] = field(default_factory=list)

    def case(self, name: str, expected: str, quick: bool = False) -> Callable[[Any], Any]:
        """Decorator that adds a case."""

        def add(function: Callable[[Log], Verdict]) -> Callable[[Log], Verdict]:
            self.cases.append(Case(self.name, name, expected, function, quick))
            return function

        return add


@dataclass(kw_only=True)
class Found(Costs):
    """What became of a case; `said` is its sentence, or the message with which it ended."""

    key: str
    group: str
    name: str
    expected: str
    outcome: str
    said: str
    cpu_s: float

    @property
    def good(self) -> bool:
        """Whether the outcome is the expected one."""
        return self.outcome == "passed"


def judge(case: Case) -> Found:
    """Run a case; nothing it raises gets lost."""
    warm_up()
    log, begin = Log(), time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for text in EXPECTED:
                warnings.filterwarnings("ignore", text)
            passed, said = case.function(log)
        outcome = "passed" if passed else "wrong"
    except NotConverged as error:
        outcome, said = "not converged", str(error)
    except Exception as error:  # an outcome like others: the table names it, the other cases go on
        outcome, said = "error", f"{type(error).__name__}: {error}"
    costs = {one.name: getattr(log, one.name) for one in fields(Costs)}
    about = {name: getattr(case, name) for name in ("key", "group", "name", "expected")}
    spent = time.process_time() - begin
    return Found(**about, outcome=outcome, said=" ".join(said.split()), cpu_s=spent, **costs)


@cache
def warm_up() -> None:
    """Load and compile what the first simulation of a process would have to pay for."""
    from evfem.electrostatics.laws import Kaczmarek
    from evfem.scene.motion import Hover, Press, Slide
    from evfem.surface.surfaces import Display

    from .scenes import block, finger

    motion = [Hover(0.1), Press(indentation=0.05, steps=1), Slide(0.1, steps=1)]
    simulate(Scene(finger(block()), Display(), Kaczmarek(), 100.0, motion))

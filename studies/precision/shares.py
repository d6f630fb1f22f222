"""Where the time of a press step and of a slide step goes, in units of one factorisation too.

Scene B at 23k nodes with the press in 20 steps, in a process of its own. The methods that do the
work are wrapped by clocks; time in one clock is not counted in the one around it. The yardstick is
one LDL^T factorisation (PARDISO, symmetric indefinite, float64, no Schur complement, analysis left
out) of the tangent at the end of the run, in the same process.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import wraps
from importlib.util import find_spec
from typing import Any
from unittest.mock import patch

import numpy as np

from ..common import markdown
from .growth import Clock
from .runs import warm_up
from .scenes import Case, build

SOLVERS = ("Pardiso", "Cholesky", "SuperLU")
PARTS = ("assembly", "factorisation", "solve", "contact", "output", "rest")
#: part -> module, class (or none) and functions that do its work
WORK: Mapping[str, tuple[tuple[str, str, str], ...]] = {
    "assembly": (("tissue.body", "Body", "forces tangent"), ("tissue.weakform", "Tissue", "smallest_J")),
    "factorisation": tuple(("newton.condensation", name, "factorise") for name in SOLVERS),
    "solve": tuple(("newton.condensation", name, "forward backward") for name in SOLVERS),
    "contact": (
        ("contact.condensed", "LinearContactStep", "solve"),
        ("contact.condensed", "", "inverse"),
        ("newton.interface", "Interface", "candidates obeyed shallowest_penetration contact_forces"),
        ("newton.linearisation", "Linearisation", "choose_candidates"),
    ),
    "output": (("simulation.ledger", "EnergyAccount", "add_substep row"), ("simulation.run", "", "frame_of")),
}
#: ways through the run: which steps; everything slips from s = 2.7 mm on, and the last step keeps its fields
PHASES = {"press": slice(0, 20), "stick_slip": slice(20, 44), "full_slip": slice(47, 49)}


class Parts(Clock):
    """CPU seconds of the parts of every step, noted between steps."""

    def __init__(self) -> None:
        super().__init__()
        self.spent = dict.fromkeys(PARTS, 0.0)
        self.steps: list[dict[str, float]] = []
        self._running: list[list[float]] = []

    def step(self, *_: Any) -> None:
        """A step has converged: its parts, and what none of the clocks has seen."""
        super().step()
        self.spent["rest"] = self.at[-1] - self.at[-2] - sum(self.spent.values())
        self.steps.append(self.spent)
        self.spent = dict.fromkeys(PARTS, 0.0)

    def timed(self, part: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function with the part's clock around it."""

        @wraps(function)
        def inner(*arguments: Any, **named: Any) -> Any:
            self._running.append([time.process_time(), 0.0])
            try:
                return function(*arguments, **named)
            finally:
                begin, within = self._running.pop()
                whole = time.process_time() - begin
                self.spent[part] += whole - within
                if self._running:
                    self._running[-1][1] += whole

        return inner

    @contextmanager
    def watching(self) -> Iterator[None]:
        """With clocks around everything in `WORK`."""
        from importlib import import_module

        with ExitStack() as patches:
            for part, places in WORK.items():
                for module, owner, names in places:
                    found: Any = import_module(f"evfem.{module}")
                    found = getattr(found, owner) if owner else found
                    for name in names.split():
                        timed = self.timed(part, getattr(found, name))
                        patches.enter_context(patch.object(found, name, timed))
            yield


def measured_alone(level: int) -> dict[str, float]:
    """The same in a process that has done nothing else."""
    warm_up()
    return measured(level)


def measured(level: int) -> dict[str, float]:
    """One run on a level of the benchmark."""
    from evfem.simulation.model import Model
    from evfem.simulation.run import Run

    begin = time.process_time()
    scene = build(Case("B", level, press=20))
    parts = Parts()
    with parts.watching():
        run = Run(scene, None)
        parts.spent = dict.fromkeys(PARTS, 0.0)  # what the set-up took
        parts.started()
        for request in run.requests():
            run.advance(request)
            parts.step()
    model: Model = run.model
    cost = np.diff(parts.at)
    setup = parts.at[0] - begin
    found = {"nodes": float(len(model.mesh.points))}
    found["setup_share_of_a_20_step_press"] = setup / (setup + cost[:20].sum())
    yardstick = factorisation_s(model, run.state.u)
    for phase, steps in PHASES.items():
        found[f"{phase}.step_s"] = float(cost[steps].mean())
        iterations = [row["newton_iterations"] for row in run.rows[steps]]
        found[f"{phase}.iterations"] = float(np.mean(iterations))
        if yardstick is not None:
            found[f"{phase}.factorisations"] = found[f"{phase}.step_s"] / yardstick
        for part in PARTS:
            spent = sum(one[part] for one in parts.steps[steps])
            found[f"{phase}.share.{part}"] = spent / cost[steps].sum()
    return found | ({} if yardstick is None else {"ldlt_s": yardstick})


def factorisation_s(model: Any, u: Any) -> float | None:
    """CPU seconds of an LDL^T factorisation of the tangent, the least of five; None without PARDISO."""
    if not find_spec("pypardiso"):
        return None
    import scipy.sparse as sparse
    from pypardiso.pardiso_wrapper import PyPardisoSolver

    pattern = model.body.pattern
    shape = (pattern.size, pattern.size)
    upper = sparse.csr_matrix((model.body.tangent(u), pattern.indices, pattern.indptr), shape=shape)
    solver, b, least = PyPardisoSolver(mtype=-2), np.zeros((pattern.size, 1)), np.inf
    solver.set_phase(11)
    solver._call_pardiso(upper, b)
    solver.set_phase(22)
    for _ in range(5):
        begin = time.process_time()
        solver._call_pardiso(upper, b)
        least = min(least, time.process_time() - begin)
    solver.free_memory(everything=True)
    return float(least)


def table(found: Mapping[str, float]) -> list[str]:
    """Phases by parts, as lines of a Markdown table."""
    rows = []
    for phase in PHASES:
        own = {key.removeprefix(f"shares.{phase}."): value for key, value in found.items()}
        cells = [phase.replace("_", " "), f"{own['step_s']:.3f}", f"{own.get('factorisations', np.nan):.2f}"]
        cells.append(f"{own['iterations']:.1f}")
        rows.append(cells + [f"{100 * own[f'share.{part}']:.0f} %" for part in PARTS])
    return markdown(("step", "CPU s", "factorisations", "iterations", *PARTS), rows)

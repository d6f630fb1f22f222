"""How a scene ends: run in this process, its invariants checked, put into a class of ends."""

from __future__ import annotations

import re
import time
import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from evfem.errors import InputError, NotConverged
from evfem.scene.file import loads
from evfem.simulation.result import Result
from evfem.simulation.run import simulate

from . import twins
from .invariants import Broken, broken, remainder
from .tables import Tables, mirrored, text_of, with_files, with_half_steps

#: classes of ends, the good ones first
GOOD = ("equilibrium", "explained")
OUTCOMES = (*GOOD, "not_converged", "invariants_broken", "timeout", "refused", "error")
#: what a sentence says that explains why a step has no solution
EXPLANATION = "there is no equilibrium"


@dataclass(frozen=True)
class Ending:
    """The class of an end, what was said, and what the run cost until then.

    `kind` is what was said without numbers, for counting; `steps` of `requested` were done;
    `remainder` is the largest one of the books in any row; `cpu_s` is that of the scene alone,
    without its twins.
    """

    outcome: str
    said: str = ""
    kind: str = ""
    requested: int = 0
    steps: int = 0
    unknowns: int = 0
    iterations: int = 0
    substeps: int = 0
    cuts: int = 0
    cpu_s: float = 0.0
    remainder: float = 0.0

    @property
    def good(self) -> bool:
        """Whether a scene may end so."""
        return self.outcome in GOOD


def judge(tables: Tables, with_twins: bool) -> Ending:
    """Run a scene, and with its twins the mirrored one and half the steps where they must agree."""
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        # surfaces finer than the nodes and the like are what a campaign is about
        warnings.simplefilter("ignore")
        ending = _judged(tables, Path(folder), with_twins)
    return replace(ending, said=" ".join(ending.said.split()))


def _judged(tables: Tables, folder: Path, with_twins: bool) -> Ending:
    try:
        scene = loads(text_of(with_files(tables, folder)), folder)
    except InputError as error:
        return Ending("refused", str(error), error.key)
    begin, requested = time.process_time(), scene.total_steps
    try:
        result = simulate(scene)
    except NotConverged as error:
        spent, partial = time.process_time() - begin, error.result
        found = broken(scene, partial) if isinstance(partial, Result) else []
        costs = _costs(partial, requested, spent)
        if found:  # what was accepted is worse than what was not
            return replace(costs, outcome="invariants_broken", said=_sentence(found), kind=_names(found))
        explained = EXPLANATION in error.advice
        outcome = "explained" if explained else "not_converged"
        return replace(costs, outcome=outcome, said=str(error), kind=kind(error.advice))
    except InputError as error:
        return Ending("refused", str(error), error.key, requested)
    except Exception as error:  # an end like others: the table names it, the campaign goes on
        said = f"{type(error).__name__}: {error}"
        return Ending("error", said, type(error).__name__, requested, cpu_s=time.process_time() - begin)
    costs = _costs(result, requested, time.process_time() - begin)
    found = broken(scene, result)
    if with_twins and not found:
        found = _twins(tables, folder, result)
    if found:
        return replace(costs, outcome="invariants_broken", said=_sentence(found), kind=_names(found))
    return costs


def _costs(result: Any, requested: int, cpu_s: float) -> Ending:
    if not isinstance(result, Result):
        return Ending("equilibrium", requested=requested, cpu_s=cpu_s)
    solver = result.provenance["solver"]
    return Ending(
        "equilibrium",
        requested=requested,
        steps=len(result.step),
        unknowns=int(solver["unknowns"]),
        iterations=int(solver["iterations"]),
        substeps=int(result.substeps.sum()),
        cuts=int(solver["cuts"]),
        cpu_s=cpu_s,
        remainder=float(np.abs(remainder(result)).max(initial=0.0)),
    )


def _twins(tables: Tables, folder: Path, result: Result) -> list[Broken]:
    """What the twins of a scene find; one that does not end says so by its own end."""
    if not twins.smooth(result):
        return []
    found: list[Broken | None] = []
    scene = loads(text_of(tables), folder)
    try:
        other = simulate(loads(text_of(mirrored(tables)), folder))
        found.append(twins.mirror_broken(result, other) if twins.smooth(other) else None)
        if twins.free_of_path(scene):
            finer = simulate(loads(text_of(with_half_steps(tables)), folder))
            found.append(twins.steps_broken(result, finer) if twins.smooth(finer) else None)
    except NotConverged as error:
        return [Broken("twin ends", error.step, 1.0, 0.0)]
    return [one for one in found if one is not None]


def _sentence(found: list[Broken]) -> str:
    return "; ".join(map(str, found))


def _names(found: list[Broken]) -> str:
    return ", ".join(one.name for one in found)


def kind(advice: str) -> str:
    """The reason in a message of a step that did not converge, without its numbers.

    >>> kind("contact: 1 of 12 nodes keep changing; out of balance: 1e-3 N/mm")
    'contact: N of N nodes keep changing'
    """
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "N", advice.split(";")[0]).strip()

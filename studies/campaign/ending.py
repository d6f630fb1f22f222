"""How a scene ends: run in this process, its invariants checked, put into a class of ends."""

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

from .invariants import broken, remainder
from .tables import Tables, text_of, with_files

#: classes of ends, the good ones first
GOOD = ("equilibrium", "explained")
OUTCOMES = (*GOOD, "not_converged", "invariants_broken", "timeout", "refused", "error")
#: what a sentence says that explains why a step has no solution
EXPLANATION = "there is no equilibrium"


@dataclass(frozen=True)
class Ending:
    """The class of an end, what was said, and what the run cost until then.

    `kind` is what was said without numbers, for counting; `steps` of `requested` were done;
    `remainder` is the largest one of the books in any row.
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


def judge(tables: Tables) -> Ending:
    """Run a scene and check its rows."""
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        # surfaces finer than the nodes and the like are what a campaign is about
        warnings.simplefilter("ignore")
        ending = _judged(tables, Path(folder))
    return replace(ending, said=" ".join(ending.said.split()))


def _judged(tables: Tables, folder: Path) -> Ending:
    begin, result = time.process_time(), None
    try:
        scene = loads(text_of(with_files(tables, folder)), folder)
        begin = time.process_time()
        result, end = simulate(scene), Ending("equilibrium")
    except InputError as error:
        return Ending("refused", str(error), error.key)
    except NotConverged as error:
        result, outcome = error.result, "explained" if EXPLANATION in error.advice else "not_converged"
        end = Ending(outcome, str(error), kind(error.advice))
    except Exception as error:  # an end like others: the table names it, the campaign goes on
        end = Ending("error", f"{type(error).__name__}: {error}", type(error).__name__)
    end = replace(end, cpu_s=time.process_time() - begin)
    if not isinstance(result, Result):
        return end
    if found := broken(scene, result):  # what was accepted is worse than what was not
        said, names = "; ".join(map(str, found)), ", ".join(one.name for one in found)
        end = replace(end, outcome="invariants_broken", said=said, kind=names)
    return replace(end, **_costs(result))


def _costs(result: Result) -> dict[str, Any]:
    solver = result.provenance["solver"]
    return {
        **{name: int(solver[name]) for name in ("unknowns", "iterations", "cuts")},
        "steps": len(result.step),
        "substeps": int(result.substeps.sum()),
        "remainder": float(np.abs(remainder(result)).max(initial=0.0)),
    }


def kind(advice: str) -> str:
    """The reason in a message of a step that did not converge, without its numbers.

    >>> kind("contact: 1 of 12 nodes keep changing; out of balance: 1e-3 N/mm")
    'contact: N of N nodes keep changing'
    """
    return re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "N", advice.split(";")[0]).strip()

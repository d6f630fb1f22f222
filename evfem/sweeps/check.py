r"""Check of uniqueness: final forces of a scene with other steps and solvers, which should not matter.

A scene is run as it is, in twice the steps, with other drag where an energy barrier was met
(`evfem.solver.hold`), with the other sparse solver, and with one input changed by 1e-9. Where an
attraction acts from the first row on, a finger that is pressed comes from afar too, and one that hovers,
which does, from first touch: between its release and its pull-in voltage it rests open or shut. Each final
state is compared with the scene's own: the largest difference of forces, relative to the largest force,
and of indentation. Agreement does not prove the answer: twice as many steps may miss the same branch.
Disagreement shows that it depends on the solution path.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from evfem.common import notices
from evfem.errors import NotConverged
from evfem.newton.condensation import other_solver
from evfem.scene.file import load
from evfem.scene.motion import Hover, Press
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.simulation.run import simulate
from evfem.terms.sources import source_of

#: what is compared, and by how much it may differ
FORCES = ("applied_force", "normal_force", "tangential_force", "electrostatic_force")
AGREE = 1e-3
#: initial rates of drag relative to the scene's own, and the relative change of an input
HOLDS, PERTURBATION = (0.25, 4.0), 1e-9
#: gaps (mm) from which a finger comes, and from which it lands, and steps between them
AFAR, NEAR, APPROACH = 2.0, 0.01, 8
#: an indentation (mm) below which differences are no longer relative to it
SMALL = 0.01


@dataclass(frozen=True, eq=False)
class Checked:
    """A row per variant (`way`): final forces (N/mm) and indentation (mm), and their `difference` from the
    scene's own; inf if the variant did not complete, with the reason in `why`.
    """

    rows: list[dict[str, Any]]

    @property
    def agrees(self) -> bool:
        """Whether all ends are the same to 1e-3."""
        return all(row["difference"] <= AGREE for row in self.rows)

    def table(self) -> str:
        """All ends side by side, as text."""
        names = ["way", *FORCES, "indentation", "difference"]
        lines = [[name.replace("_", " ") for name in names]]
        for row in self.rows:
            shown = [f"{row[name]:.6g}" if name in row else "-" for name in names[1:-1]]
            lines.append([row["way"], *shown, row["why"] or f"{row['difference']:.1e}"])
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(
            "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:-1], widths[1:-1]), line[-1]])
            for line in lines
        )

    def __str__(self) -> str:
        said = "the ends agree" if self.agrees else "the ends differ: the result depends on the solution path"
        return f"{self.table()}\n{said} (allowed: {AGREE:g})"


def check(scene: Scene | str | Path) -> Checked:
    """Run a scene with other steps and solvers and compare final forces; about five times as long as a run.

    Parameters
    ----------
    scene
        A `Scene`, or the path of a scene file.

    Returns
    -------
    Checked
        A row per run; `agrees` is true if all ends agree.

    Raises
    ------
    InputError
        The input is no scene.
    NotConverged
        The scene itself has no end.

    Examples
    --------
    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(resolution="coarse"), ev.Press(indentation=0.1, steps=1)
    >>> scene = ev.Scene(pad, ev.Display(), motion=[press])
    >>> ev.check(scene).agrees
    True
    """
    checked = scene if isinstance(scene, Scene) else load(scene)
    with notices.status("the scene"):
        own = simulate(checked)
    rows = [
        _row("the scene", own, own),
        *(_ended(variant, other, own) for variant, other in _others(checked, own)),
    ]
    with other_solver() as name:
        rows += [_ended(f"sparse solver {name}", checked, own)] if name else []
    return Checked(rows)


def _ended(variant: str, scene: Scene, own: Result) -> dict[str, Any]:
    """The row of a variant; its warnings are those of the scene and not repeated."""
    with notices.status(variant), catch_warnings():
        simplefilter("ignore", UserWarning)
        try:
            return _row(variant, simulate(scene), own)
        except NotConverged as error:
            return {"way": variant, "why": f"ends early: {error}", "difference": np.inf}


def _others(scene: Scene, own: Result) -> Iterator[tuple[str, Scene]]:
    """The variants of the scene, without that of the other sparse solver."""
    motions: tuple[Any, ...] = scene.motion
    yield "twice the steps", replace(scene, motion=[replace(one, steps=2 * one.steps) for one in motions])
    strategy = scene.solver.strategy
    for ratio in HOLDS if own.provenance["solver"]["barriers"] else ():
        hold = replace(strategy, hold=ratio * strategy.hold)
        yield f"held by {ratio:g} of the drag", replace(scene, solver=replace(scene.solver, strategy=hold))
    if acts_at_once(scene):
        first, rest = motions[0], motions[1:]
        if first.course.hovers:
            again = replace(first, steps=max(first.steps, APPROACH))
            yield "from first touch", replace(scene, motion=[Press(indentation=0.0, steps=1), again, *rest])
        else:
            yield "from afar", replace(scene, motion=[Hover(AFAR), Hover(NEAR, steps=APPROACH), *motions])
    for i, name in product(range(len(motions)), ("indentation", "force", "gap", "distance", "voltage")):
        if isinstance(value := getattr(motions[i], name, None), float | int) and value:
            other = replace(motions[i], **{name: value * (1.0 + PERTURBATION)})
            changed = replace(scene, motion=(*motions[:i], other, *motions[i + 1 :]))
            yield f"an input changed by {PERTURBATION:g}", changed
            return


def acts_at_once(scene: Scene) -> bool:
    """Whether something attracts a finger from the first row on."""
    return bool(scene.motion) and (
        scene.adhesion is not None or source_of(scene.electrics.voltage).start != 0.0
    )


def _row(variant: str, found: Result, own: Result) -> dict[str, Any]:
    """Final forces and indentation of a variant, and their difference from the scene's own."""
    end = {name: float(getattr(found, name)[-1]) for name in (*FORCES, "indentation")}
    known = {name: float(getattr(own, name)[-1]) for name in end}
    largest = max(abs(known[name]) for name in FORCES)
    off = [abs(end[name] - known[name]) / max(largest, 1e-12) for name in FORCES]
    deeper = abs(end["indentation"] - known["indentation"]) / max(abs(known["indentation"]), SMALL)
    return {"way": variant, **end, "why": "", "difference": max(*off, deeper)}

r"""Mesh, steps and tolerance for an error asked for: checked from the cheapest on, until the stated error is
no larger.

A try is a check (`evfem.sweeps.check`). What its error is made of says what comes next: the next finer mesh
where that of the mesh is too large, a hundredth of the tolerance, or as many steps as an error of first order
needs. A scene has at least its own steps, which are the rows that are wanted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any

from evfem.common import notices
from evfem.common.checks import Within, real
from evfem.common.tables import aligned
from evfem.errors import InputError
from evfem.scene.file import scene_at
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.simulation.run import simulate
from evfem.sweeps.accuracy import LEVELS, MESH, PATH, STEPS, TOLERANCE, Accuracy
from evfem.sweeps.check import SMALLEST, TIGHTER, Checked, checked_by, more_steps, other_levels, remeshed

#: residuals relative to the error asked for, at first
RESIDUAL = 1e-3
#: shares of the error asked for that mesh and tolerance may take
OF_MESH, OF_TOLERANCE = 0.75, 0.05
#: most tries, and most times as many steps from one to the next
MOST_TRIES, MOST_TIMES = 8, 8


@dataclass(frozen=True, eq=False)
class Try:
    """A scene that was tried, its check and its result."""

    scene: Scene
    checked: Checked
    result: Result

    @property
    def seconds(self) -> float:
        """What the run took, without those that say how accurate it is."""
        return float(self.result.seconds.sum())

    @property
    def worst(self) -> Accuracy:
        """The output with the largest error."""
        return max(self.checked.outputs, key=lambda one: one.sum)


@dataclass(frozen=True, eq=False)
class Accurate:
    """A `scene` whose mesh, steps and tolerance are chosen, its `result`, the stated `error` of each output,
    as a share of it, and `seconds` of its run; `tries` are all that were checked on the way.
    """

    asked: float
    tries: list[Try]

    @property
    def chosen(self) -> Try:
        """The last try; where it did not reach the error, that with the smallest one."""
        return min(reversed(self.tries), key=lambda one: max(one.worst.sum, self.asked))

    @property
    def scene(self) -> Scene:
        """The scene that was chosen."""
        return self.chosen.scene

    @property
    def result(self) -> Result:
        """Its result."""
        return self.chosen.result

    @property
    def error(self) -> dict[str, float]:
        """The stated error of each output, as a share of it: of mesh, steps, tolerance and path together."""
        return self.chosen.checked.error

    @property
    def seconds(self) -> float:
        """What its run took."""
        return self.chosen.seconds

    @property
    def reached(self) -> bool:
        """Whether the error is no larger than what was asked for, and all of it known."""
        outputs = self.chosen.checked.outputs
        return all(one.known and one.sum <= self.asked for one in outputs)

    def table(self) -> str:
        """Speed against error: a row per try."""
        lines = [["mesh", "nodes", "steps", "tolerance", "seconds", "error", "of"]]
        for one in self.tries:
            solver, finger = one.scene.solver, one.scene.finger
            size = getattr(finger, "resolution", "own"), str(len(one.result.mesh.points))
            cost = str(one.scene.total_steps), f"{solver.tolerance:g}", f"{one.seconds:.2g}"
            lines.append([*size, *cost, f"{100.0 * one.worst.sum:.2g} %", one.worst.output])
        return aligned(lines)

    def __repr__(self) -> str:
        """What was asked for, and the tries."""
        reached = "reached" if self.reached else "not reached"
        return f"Accurate to {100.0 * self.asked:g} %: {reached}\n{self.table()}"


def accurate(
    scene: Scene | str | PathLike[str], error: float = 1e-2, outputs: Sequence[str] | str | None = None
) -> Accurate:
    """Run a scene as cheaply as an error allows: choose mesh, steps and tolerance by their error.

    A `FingerPad` or `Fingertip` begins on its coarse mesh; with each mesh about six runs on it and one on the
    next finer one are needed. Of other fingers the mesh stays, and its error is not known.

    Parameters
    ----------
    scene
        A `Scene`, or the path of a scene file. It is run in its own steps or more.
    error
        The largest error of an output, as a share of it, from 1e-5 to 0.5.
    outputs
        Names of columns or COLUMN.STATISTIC[.MOTION], as in `ev.check`.

    Returns
    -------
    Accurate
        `scene`, `result`, `error[output]`, `seconds`, and a table of speed against error. Where the error is
        not reached, with a warning, it is the try with the smallest one.

    Raises
    ------
    InputError
        The input is no scene, an output no column of it, or the error out of range.
    NotConverged
        A try has no end.

    Examples
    --------
    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(ridges=False), ev.Press(indentation=0.1, steps=1)
    >>> found = ev.accurate(ev.Scene(pad, ev.Display(), motion=press), 0.1, "normal_force")
    >>> found.scene.finger.resolution, found.error["normal_force"] < 0.1
    ('coarse', True)
    """
    error = real("error", error, "a relative error from 1e-5 to 0.5", Within(1e-5, 0.5))
    run, scene = _remembering(), scene_at(scene)
    scene = _coarsest(scene) if other_levels(scene.finger) else scene
    tolerance = max(RESIDUAL * error, SMALLEST)
    following: Scene | None = replace(scene, solver=replace(scene.solver, tolerance=tolerance))
    tries: list[Try] = []
    while following is not None and len(tries) < MOST_TRIES:
        checked = checked_by(run, following, outputs, True)
        tries.append(Try(following, checked, run(following)))
        following = _next(following, checked, error)
    found = Accurate(error, tries)
    if not found.reached:
        notices.warn(_missed(found))
    return found


def _coarsest(scene: Scene) -> Scene:
    """On the coarsest mesh that the finger's ridges allow; its own is one of them."""
    for level in LEVELS:
        with suppress(InputError):
            return remeshed(scene, level)
    return scene


def _remembering() -> Callable[[Scene], Result]:
    """`simulate`, which runs the same scene once."""
    known: dict[str, Result] = {}

    def run(scene: Scene) -> Result:
        key = scene.digest()
        if key not in known:
            known[key] = simulate(scene)
        return known[key]

    return run


def _next(scene: Scene, checked: Checked, error: float) -> Scene | None:
    """What to try next; None where the error is reached, or nothing lowers it."""
    largest = {source: _largest(checked, source) for source in (MESH, STEPS, TOLERANCE, PATH)}
    if max(checked.error.values()) <= error or largest[PATH] > error:
        return None
    finer: list[Any] = [level for name, level in other_levels(scene.finger) if "finer" in name]
    if finer and largest[MESH] > OF_MESH * error:
        return remeshed(scene, finer[0])
    solver = scene.solver
    if largest[TOLERANCE] > OF_TOLERANCE * error and solver.tolerance > SMALLEST:
        return replace(scene, solver=replace(solver, tolerance=max(TIGHTER * solver.tolerance, SMALLEST)))
    left = error - largest[MESH] - largest[TOLERANCE] - largest[PATH]
    if left <= 0.0 or largest[STEPS] == 0.0:
        return None
    return more_steps(scene, min(max(math.ceil(1.2 * largest[STEPS] / left), 2), MOST_TIMES))


def _largest(checked: Checked, source: str) -> float:
    """The largest error by one source that is known."""
    found = [getattr(one, source) for one in checked.outputs]
    return max((each for each in found if math.isfinite(each)), default=0.0)


def _missed(found: Accurate) -> str:
    """Why an error is not reached, in a sentence."""
    chosen = found.chosen
    if not all(one.known for one in chosen.checked.outputs):
        told = "of the mesh where a finger has one alone"
        return f"an error by some source is not known, {told}: the stated one is without it (see ev.check)"
    worst = chosen.worst
    most = max((MESH, STEPS, TOLERANCE, PATH), key=lambda source: float(getattr(worst, source)))
    return (
        f"an error of {100.0 * found.asked:g} % is not reached: {worst.output} has one of "
        f"{100.0 * worst.sum:.2g} %, most of it by {most}"
    )

r"""Check of a run: does another way end elsewhere, and how accurate are its numbers?

A scene is run as it is, in twice the steps, with other drag where an energy barrier was met
(`evfem.solver.hold`), with the other sparse solver, and with one input changed by 1e-9. Where an
attraction acts from the first row on, a finger that is pressed comes from afar too, and one that hovers,
which does, from first touch: between its release and its pull-in voltage it rests open or shut. Each final
state is compared with the scene's own: the largest difference of forces, relative to the largest force there
(at least 1e-3 of that of the run), and of indentation. Agreement does not prove the answer: twice as many
steps may miss the same branch. Disagreement shows that it depends on the solution path.

It is also run on a finer and a coarser mesh, and to a hundredth of the tolerance. These and the runs before
give the error of each output by its source (`evfem.sweeps.accuracy`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from os import PathLike
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from evfem.common import notices
from evfem.errors import InputError, NotConverged
from evfem.finger.sizes import LayeredFinger
from evfem.newton.condensation import other_solver
from evfem.planning.resolution import AUTO
from evfem.scene.file import scene_at
from evfem.scene.motion import Hover, Press
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.simulation.run import simulate
from evfem.sweeps.accuracy import (
    FORCES,
    LEVELS,
    MESH,
    NEXT_TO,
    PATH,
    SOURCES,
    STEPS,
    TOLERANCE,
    Accuracy,
    accuracies,
    accuracy_table,
    asked,
    least_force,
)
from evfem.terms.sources import source_of

#: by how much ends may differ
AGREE = 1e-3
#: initial rates of drag relative to the scene's own, and the relative change of an input
HOLDS, PERTURBATION = (0.25, 4.0), 1e-9
#: gaps (mm) from which a finger comes, and from which it lands, and steps between them
AFAR, NEAR, APPROACH = 2.0, 0.01, 8
#: an indentation (mm) below which differences are no longer relative to it
SMALL = 0.01


#: factor of the tolerance
TIGHTER = 0.01
#: smallest tolerance that a scene may have
SMALLEST = 1e-13


@dataclass(frozen=True, eq=False)
class Variant:
    """A scene that should have the same end, the source of error that it differs in, and its name (`way`)."""

    source: str
    way: str
    scene: Callable[[], Scene]


@dataclass(frozen=True, eq=False)
class Checked:
    """A row per variant (`way`): final forces (N/mm) and indentation (mm), and their `difference` from the
    scene's own; inf if the variant did not complete, with the reason in `why`. `source` is what it varies:
    mesh, steps, tolerance or path. `outputs` has the error of each output by these sources.
    """

    rows: list[dict[str, Any]]
    outputs: list[Accuracy] = field(default_factory=list)

    @property
    def agrees(self) -> bool:
        """Whether all ends on the scene's mesh are the same to 1e-3, by whatever steps and path."""
        return all(row["difference"] <= AGREE for row in self.rows if row["source"] in (STEPS, PATH))

    @property
    def error(self) -> dict[str, float]:
        """The stated error of each output, as a share of it: the sum of what is known."""
        return {one.output: one.sum for one in self.outputs}

    def ends(self) -> list[list[str]]:
        """Heads, and a row per variant: forces (N/mm), indentation (mm) and difference."""
        names = ["way", *FORCES, "indentation", "difference"]
        lines = [[name.replace("_", " ") for name in names]]
        for row in self.rows:
            shown = [f"{row[name]:.6g}" if name in row else "-" for name in names[1:-1]]
            lines.append([row["way"], *shown, row["why"] or f"{row['difference']:.1e}"])
        return lines

    def table(self) -> str:
        """All ends side by side, as text."""
        lines = self.ends()
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        return "\n".join(
            "  ".join([line[0].ljust(widths[0]), *map(str.rjust, line[1:-1], widths[1:-1]), line[-1]])
            for line in lines
        )

    def error_table(self) -> str:
        """Value and errors of each output, as text."""
        unknown = "" if all(one.known for one in self.outputs) else "\na sum is without what is not known"
        return f"{accuracy_table(self.outputs)}{unknown}"

    @property
    def verdict(self) -> str:
        """Whether the ends agree, in words."""
        said = "the ends agree" if self.agrees else "the ends differ: the result depends on the solution path"
        return f"{said} (allowed: {AGREE:g})"

    def __str__(self) -> str:
        """Both tables, and in the last line whether the ends agree."""
        told = f"\n\nerrors\n{self.error_table()}\n" if self.outputs else ""
        return f"{self.table()}{told}\n{self.verdict}"


def check(
    scene: Scene | str | PathLike[str], outputs: Sequence[str] | str | None = None, *, mesh: bool = True
) -> Checked:
    """Run a scene with other steps and meshes; compare final forces, and state the errors of outputs.

    It takes about six times as long as a run, and with `mesh` a run on a mesh of two to five times the nodes
    more; the runs on a mesh cost most of it.

    Parameters
    ----------
    scene
        A `Scene`, or the path of a scene file.
    outputs
        Names of columns (`"tangential_force"`, at the end) or COLUMN.STATISTIC[.MOTION] as in sweeps
        (`"contact_width.max.0"`); without them the four forces and the extent of the contact.
    mesh
        Whether it is run on other meshes too: the next finer and the next coarser `resolution` of a
        `FingerPad` or `Fingertip`. A fine one has two coarser ones, a coarse one the next finer one alone.
        The mesh's error of a `MeshedFinger` is not known.

    Returns
    -------
    Checked
        A row per run; `agrees` is true if all ends on the scene's own mesh agree. `outputs` has a row per
        output, with its error by mesh, steps, tolerance and path, as shares of its value; `error` their sums.

    Raises
    ------
    InputError
        The input is no scene, or an output no column of it.
    NotConverged
        The scene itself has no end.

    Examples
    --------
    >>> import evfem as ev
    >>> pad, press = ev.FingerPad(resolution="coarse", ridges=False), ev.Press(indentation=0.1, steps=1)
    >>> found = ev.check(ev.Scene(pad, ev.Display(), motion=[press]), "normal_force")
    >>> found.agrees, 1e-4 < found.error["normal_force"] < 0.05
    (True, True)
    """
    return checked_by(simulate, scene_at(scene), outputs, mesh)


def checked_by(
    run: Callable[[Scene], Result], scene: Scene, outputs: Sequence[str] | str | None, mesh: bool
) -> Checked:
    """The check of a scene, whose variants are `run`."""
    asked(outputs, scene, 2)
    with notices.status("the scene"):
        own = run(scene)
    names = asked(outputs, scene, own.mesh.dim)
    rows = [_row(Variant(PATH, "the scene", partial(replace, scene)), own, own)]
    found: dict[str, list[Result | None]] = {source: [] for source in SOURCES}

    def add(variant: Variant, run: Callable[[Scene], Result]) -> None:
        row, result = _ended(variant, own, run)
        rows.append(row)
        found[variant.source].append(result)

    for variant in (*_others(scene, own), *_for_errors(scene, mesh)):
        add(variant, run)
    with other_solver() as there:
        if there:
            add(Variant(PATH, "another sparse solver", partial(replace, scene)), simulate)
    return Checked(rows, accuracies(names, own, found, scene))


def _ended(
    variant: Variant, own: Result, run: Callable[[Scene], Result]
) -> tuple[dict[str, Any], Result | None]:
    """Row and result of a variant; its warnings are those of the scene and not repeated."""
    with notices.status(variant.way), catch_warnings():
        simplefilter("ignore", UserWarning)
        try:
            result = run(variant.scene())
            return _row(variant, result, own), result
        except NotConverged as error:
            why = f"ends early: {error}"
        except InputError as error:
            why = f"refused: {error}"
    return {"source": variant.source, "way": variant.way, "why": why, "difference": np.inf}, None


def more_steps(scene: Scene, factor: int = 2) -> Scene:
    """The scene in so many times the steps; adaptive ones become shorter too."""
    motions: tuple[Any, ...] = scene.motion
    motion = [replace(one, steps=factor * one.steps) for one in motions]
    strategy = scene.solver.strategy
    if strategy.steps == AUTO:
        strategy = replace(strategy, path_error=strategy.path_error / factor**2)
    return replace(scene, motion=motion, solver=replace(scene.solver, strategy=strategy))


def _for_errors(scene: Scene, mesh: bool) -> Iterator[Variant]:
    """The variants that only the errors need: of the tolerance and of the mesh."""
    tolerance = max(TIGHTER * scene.solver.tolerance, SMALLEST)
    tighter = replace(scene.solver, tolerance=tolerance)
    yield Variant(TOLERANCE, f"a tolerance of {tolerance:g}", partial(replace, scene, solver=tighter))
    for name, level in other_levels(scene.finger) if mesh else ():
        yield Variant(MESH, f"{name} mesh", partial(remeshed, scene, level))


def remeshed(scene: Scene, resolution: str) -> Scene:
    """The scene with its finger on the mesh of another resolution."""
    finger: Any = scene.finger
    return replace(scene, finger=finger.at(resolution))


def other_levels(finger: Any) -> list[tuple[str, str]]:
    """Names and resolutions of the meshes beside a finger's own, none where there is one alone."""
    if not isinstance(finger, LayeredFinger):
        return []
    resolution = vars(finger)["resolution"]
    own = LEVELS.index(NEXT_TO.get(resolution, resolution))
    last = own == len(LEVELS) - 1
    numbers = (own - 1, own - 2) if last else (own + 1, own - 1)
    return [(f"a {'finer' if i > own else 'coarser'} ({LEVELS[i]})", LEVELS[i]) for i in numbers if i >= 0]


def _others(scene: Scene, own: Result) -> Iterator[Variant]:
    """The variants that should have the same end, without that of the other sparse solver."""
    motions: tuple[Any, ...] = scene.motion
    yield Variant(STEPS, "twice the steps", partial(more_steps, scene))
    strategy = scene.solver.strategy
    for ratio in HOLDS if own.provenance["solver"]["barriers"] else ():
        held = replace(scene.solver, strategy=replace(strategy, hold=ratio * strategy.hold))
        yield Variant(PATH, f"held by {ratio:g} of the drag", partial(replace, scene, solver=held))
    if acts_at_once(scene):
        first, rest = motions[0], motions[1:]
        way, motion = "from afar", [Hover(AFAR), Hover(NEAR, steps=APPROACH), *motions]
        if first.course.hovers:
            again = replace(first, steps=max(first.steps, APPROACH))
            way, motion = "from first touch", [Press(indentation=0.0, steps=1), again, *rest]
        yield Variant(PATH, way, partial(replace, scene, motion=motion))
    if (other := perturbed(scene)) is not None:
        yield Variant(PATH, f"an input changed by {PERTURBATION:g}", lambda: other)


def perturbed(scene: Scene) -> Scene | None:
    """The scene with the first amount of a motion changed by `PERTURBATION`; None without one."""
    motions: tuple[Any, ...] = scene.motion
    for i, name in product(range(len(motions)), ("indentation", "force", "gap", "distance", "voltage")):
        if isinstance(value := getattr(motions[i], name, None), float | int) and value:
            other = replace(motions[i], **{name: value * (1.0 + PERTURBATION)})
            return replace(scene, motion=[*motions[:i], other, *motions[i + 1 :]])
    return None


def acts_at_once(scene: Scene) -> bool:
    """Whether something attracts a finger from the first row on."""
    return bool(scene.motion) and (
        scene.adhesion is not None or source_of(scene.electrics.voltage).start != 0.0
    )


def _row(variant: Variant, found: Result, own: Result) -> dict[str, Any]:
    """Final forces and indentation of a variant, and their difference from the scene's own.

    Forces differ relative to the largest one at the end, but at least to `least_force`: a finger that ends
    free has rounding alone (1e-15 N/mm), while a finger that should be free and still bears 1e-3 of the
    largest force of the run is off by 1, and one that bears 1e-6 of it by what is allowed.
    """
    end = {name: float(getattr(found, name)[-1]) for name in (*FORCES, "indentation")}
    known = {name: float(getattr(own, name)[-1]) for name in end}
    largest = max(*(abs(known[name]) for name in FORCES), least_force(own), 1e-12)
    off = [abs(end[name] - known[name]) / largest for name in FORCES]
    deeper = abs(end["indentation"] - known["indentation"]) / max(abs(known["indentation"]), SMALL)
    about = {"source": variant.source, "way": variant.way, "why": "", "difference": max(*off, deeper)}
    return {**about, **end}

"""A scene pays only for what it contains: what leaving a term out saves, and what it changes.

Every row runs a scene as `plan` builds it and once with the term forced in where it can do
nothing, or next to nothing: 1e-6 V, a friction coefficient of 1e-12, a relaxation time of 1e-12 s,
a hovering finger that deforms. CPU seconds are the least of three runs that take turns, of one
where it takes long.
"""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, replace

import numpy as np

from evfem.electrostatics.laws import Kaczmarek
from evfem.finger.fingerpad import FingerPad
from evfem.scene.motion import Press
from evfem.scene.scene import Output, Scene
from evfem.simulation.result import Result
from evfem.solver.strategy import Strategy
from evfem.surface.surfaces import Display

from ..peers.problem import INSULATOR, PLANE
from .apart import import_s
from .runs import SHORT
from .scenes import GAP, Case, build

ROUNDS = 3
FORCES = ("normal_force", "tangential_force", "electrostatic_force")


@dataclass(frozen=True)
class Row:
    """A row of the table: scene, what is left out of it, and how both were computed."""

    name: str
    left_out: str
    without: Scene
    forced: Scene
    how: str


@dataclass(frozen=True)
class Saving:
    """CPU seconds without the term and with it, and the largest change of a force over the largest
    force.
    """

    name: str
    left_out: str
    how: str
    without_s: float
    forced_s: float
    change: float


def rows(level: int, preset: str) -> list[Row]:
    """The rows on a level of the benchmark and a preset of the finger pad."""
    press, slide = build(Case("A", level)), build(Case("B", level))
    hover = replace(build(Case("hover", level, rigid=True)))
    timed = replace(press, motion=[Press(indentation=1.5, steps=15, speed=1.0)])
    viscous = replace(timed.finger, viscosity=1e-12)
    tiny = replace(press, surface=Display(insulator=INSULATOR, friction=1e-12, y=PLANE))
    eager = replace(slide.solver, strategy=Strategy(patience=0.0))
    return [
        Row("no voltage", "electrostatics", press, _powered(press), "1e-6 V instead of none"),
        Row("no friction", "friction", press, tiny, "coefficient 1e-12 instead of 0"),
        Row(
            "hovering at 1 V",
            "mechanics",
            hover,
            replace(hover, motion=[Press(indentation=-GAP, steps=1)]),
            "deformable instead of rigid",
        ),
        Row(
            "no ridges",
            "the fine outline",
            _pad(preset, 0.0),
            _pad(preset, 0.02),
            "ridges of the least height, 0.02 mm: another finger",
        ),
        Row(
            "quasi-static",
            "time",
            timed,
            replace(timed, finger=viscous, solver=replace(timed.solver, dynamics="viscous")),
            "relaxation time 1e-12 s instead of 0",
        ),
        Row(
            "slowly changing tangent",
            "factorisations (and assembly)",
            slide,
            replace(slide, solver=eager),
            "a new one in every iteration",
        ),
        Row(
            "no fields wanted",
            "fields of every step",
            slide,
            replace(slide, output=Output(every=1)),
            "kept of every step",
        ),
    ]


def _powered(scene: Scene) -> Scene:
    return replace(scene, law=Kaczmarek(), voltage=1e-6)


def _pad(preset: str, height: float) -> Scene:
    finger = FingerPad(ridges=height > 0.0, ridge_height=height or 0.15, resolution=preset)
    display = Display(insulator=INSULATOR, friction=0.3)
    return Scene(finger, display, motion=[Press(indentation=0.5, steps=5)], output=Output(every=1000))


def measured(quick: bool) -> list[Saving]:
    """What every row saves; with the row of closed forms."""
    table = rows(0 if quick else 1, "coarse")
    chosen = table[:3] if quick else table
    savings = [saving(row, 1 if quick else ROUNDS) for row in chosen]
    return savings if quick else [*savings, closed_forms()]


def saving(row: Row, rounds: int) -> Saving:
    """Both scenes in turn."""
    from evfem.simulation.run import simulate

    def timed(scene: Scene) -> tuple[float, Result]:
        gc.collect()
        begin = time.process_time()
        result = simulate(scene)
        return time.process_time() - begin, result

    pairs = []
    for _ in range(rounds):
        pairs.append((timed(row.without), timed(row.forced)))
        if pairs[-1][0][0] > SHORT:
            break
    without, forced = (min(pair[i][0] for pair in pairs) for i in (0, 1))
    change = changed(pairs[0][0][1], pairs[0][1][1])
    return Saving(row.name, row.left_out, row.how, without, forced, change)


def changed(one: Result, other: Result) -> float:
    """The largest change of a force in any step over the largest force."""
    before, after = (np.stack([getattr(result, name) for name in FORCES]) for result in (one, other))
    return float(np.abs(after - before).max() / np.abs(before).max())


def closed_forms() -> Saving:
    """Importing the closed forms against importing what a simulation needs, each in new processes."""
    laws, everything = (
        ["evfem.electrostatics.forces"],
        ["evfem.simulation.model", "evfem.simulation.run", "skfem", "scipy.sparse.linalg"],
    )
    found = [import_s(laws) for _ in range(ROUNDS)]
    if any(heavy for _, heavy in found):
        raise RuntimeError(f"the closed forms import {found[0][1]}")
    without = min(seconds for seconds, _ in found)
    with_it = min(import_s(everything)[0] for _ in range(ROUNDS))
    return Saving("only closed forms", "meshes", "imports of a simulation", without, with_it, 0.0)


def numbers(savings: list[Saving]) -> dict[str, float]:
    """Seconds, the share that is saved, and the change."""
    found: dict[str, float] = {}
    for one in savings:
        key = f"plan.{one.name}".replace(" ", "_")
        found |= {f"{key}.without_s": one.without_s, f"{key}.forced_s": one.forced_s}
        found |= {f"{key}.saved_percent": 100.0 * (1.0 - one.without_s / one.forced_s)}
        found[f"{key}.change"] = one.change
    return found


def table(savings: list[Saving]) -> list[str]:
    """The rows as lines of a Markdown table."""
    lines = [
        "| the scene has | left out | compared with | CPU s | saved | change |",
        "|---|---|---|---|---|---|",
    ]
    for one in savings:
        seconds = f"{one.without_s:.3g} instead of {one.forced_s:.3g}"
        saved = f"{100.0 * (1.0 - one.without_s / one.forced_s):.0f} %"
        cells = [one.name, one.left_out, one.how, seconds, saved, f"{one.change:.0e}"]
        lines.append(f"| {' | '.join(cells)} |")
    return lines

"""Run a scene: build its model, follow its motions step by step, and hand every converged
step out.
"""

from __future__ import annotations

import time as clock
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common import notices
from evfem.common.arrays import Floats, GrowingRows, blas_limits
from evfem.common.constants import SMALLEST_FORCE
from evfem.common.notices import LOG
from evfem.common.rooms import begun
from evfem.errors import NotConverged, Unresolved
from evfem.newton import control
from evfem.newton.control import (
    Force,
    GivenGap,
    HeightControl,
    Indentation,
    Target,
    Unsupported,
    VoltageControl,
)
from evfem.newton.state import State, StepFailed
from evfem.planning.resolution import allowed_error, slip_scale
from evfem.protocols import Observer
from evfem.scene.file import scene_at
from evfem.scene.motion import Course
from evfem.scene.scene import Scene
from evfem.simulation.barrier import rise
from evfem.simulation.checkpoint import (
    PROBES,
    account_arrays,
    account_of,
    reusable_arrays,
    reusable_of,
    state_arrays,
    state_of,
    usable,
)
from evfem.simulation.doubtful import (
    advice,
    deepest_penetration,
    doubtful,
    free_nodes,
    lost_stresses,
    penetration,
    pull_offs,
    unstable_alone,
)
from evfem.simulation.history import ROOM_COLUMNS
from evfem.simulation.ledger import EnergyAccount, frame_of
from evfem.simulation.model import Model, linearised, make_model
from evfem.simulation.result import Frame, Result, Saved, provenance
from evfem.simulation.works import SubstepWork
from evfem.solver.path import Halves, Path, Whole
from evfem.solver.stepping import Stepper
from evfem.terms.sources import Moment, source_of
from evfem.terms.tractions import pull_off_of
from evfem.tissue.kernels.blocks import loops

if TYPE_CHECKING:
    from evfem.scene.probes import Probes

#: quantities of the initial state of a motion
Start = dict[str, float]
START_COLUMNS = ("position", "position_z", "indentation", "applied_force", "voltage", "min_gap", "loose")
#: first substep of a run under a voltage that can close nodes one by one: the voltage is raised in such ones
FIRST_PART = 0.125


@dataclass(frozen=True)
class Request:
    """One requested step: its number in the run, its motion, and the path to its exact target; fractions (k,)
    of it at which substeps with an admissible error end, for what is prescribed turns there.
    """

    step: int
    motion_index: int
    kind: str
    path: Path
    duration: float
    turns: Floats = field(default_factory=lambda: np.zeros(0))


def simulate(
    scene: Scene | str | PathLike[str],
    *,
    progress: bool = False,
    observers: Sequence[Observer] = (),
    resume: Saved | None = None,
) -> Result:
    """Run all motions of a scene.

    Parameters
    ----------
    scene
        A `Scene`, or the path of a scene file.
    progress
        Show a progress bar.
    observers
        Objects with any of `started(mesh, scene, total_steps)`, `step(row, frame, checkpoint)` after
        every converged step and `finished(result)`, see `evfem.protocols`. `frame` is None on steps
        without fields; `checkpoint()` gives the arrays to resume from. If `step` raises `StopRun`, the
        run ends after that step with the reason in the provenance under `stopped`.
    resume
        Arrays and rows to continue from, to the same numbers as without the interruption. The result
        has all rows, but fields only of the steps since.

    Returns
    -------
    Result
        The history, the fields of every n-th step and the provenance.

    Raises
    ------
    NotConverged
        A step has no solution. The error has the result so far; observers keep all good steps.
    InputError
        The scene cannot be run.
    """
    scene = scene_at(scene)
    # dense solves lose more by sharing than they gain, as idle threads of the BLAS spin, those of large ones
    # too where other processes run: the scene's threads are PARDISO's
    with blas_limits(), notices.shown(progress):
        return _simulate(scene, progress, observers, resume)


def _simulate(scene: Scene, progress: bool, observers: Sequence[Observer], resume: Saved | None) -> Result:
    notices.check_observers(observers)
    total = scene.total_steps
    # shown at once, for making the model takes seconds; no trace of it where the scene is refused
    bar = notices.bar(total, "step", len(resume.rows) if resume else 0, progress)
    bar.leave = False
    reasons: list[str] = []
    try:
        run = Run(scene, resume)
        notices.tell_observers(observers, "started", run.model.mesh, scene, total)
        bar.leave = True
        for request in run.requests():
            with notices.told_on(bar):
                frame = run.advance(request)
            reasons = notices.tell_observers(observers, "step", run.rows[-1], frame, run.checkpoint)
            bar.update(1)
            LOG.debug("step %d of %d", len(run.rows), total)
            if reasons:
                run.keep_last_frame()
                break
    finally:
        bar.close()
    result = run.result()
    if reasons:
        result.provenance["stopped"] = "; ".join(reasons)
    notices.tell_observers(observers, "finished", result)
    return result


def climb(model: Model, old: State, new: State, target: Target) -> float:
    """The energy barrier between two states; no method of a run, which would then refer to itself and keep
    its factors alive.
    """
    return rise(SubstepWork(model, old, new), target)


def _towards(begin: float, end: float | None, fraction: float) -> float:
    """The value at a fraction (0 to 1) of a motion, if there is one; exactly the end at 1."""
    return begin if end is None else end if fraction == 1.0 else begin + fraction * (end - begin)


class Run:
    """A simulation in progress: the model, the present state, the rows and frames so far."""

    def __init__(self, scene: Scene, resume: Saved | None) -> None:
        self.scene = scene
        self.source = source_of(scene.electrics.voltage)
        self.model: Model = make_model(scene)
        self.ledger = EnergyAccount(self.model, pull_off=pull_off_of(self.model.attraction))
        allowed, body = allowed_error(scene), self.model.body
        parts = Whole() if allowed is None else Halves(allowed)
        self.slip_scale = np.inf if allowed is None else slip_scale(scene, self.model.mesh)
        equilibrium = self.model.equilibrium
        self.stepper = Stepper(equilibrium, body=body, parts=parts, rise=partial(climb, self.model))
        if self.model.closing.trapped and self.source.start != 0.0:
            self.stepper.substep = FIRST_PART
        self.free_nodes, self.sunk = free_nodes(self.model), np.zeros(2)
        self.probes: Probes | None = None
        if scene.output.probes:
            from evfem.scene.probes import Probes

            self.probes = Probes(scene.output.probes, self.model.body)
        self.probed = GrowingRows(np.zeros((0, 0)) if self.probes is None else self.probes.none)
        self.rows: list[dict[str, Any]] = []
        self.frames: list[Frame] = []
        self.time = 0.0
        first = next(iter(scene.courses), Course())
        self.begin_at(-first.lift)
        if resume is not None:
            self.restore(resume)

    def begin_at(self, indentation: float) -> None:
        """Place the finger at rest before the first row. One that hovers first comes from afar, where nothing
        acts: it is at its gap before the voltage acts, and not at first touch.
        """
        rest = self.model.equilibrium.rest(self.model.bone(0.0, indentation), self.source.start)
        self.first_indentation = indentation
        self.state: State = rest.remembering(
            begun(self.model.drive, rest.memory, self.model.drive.memory(rest))
        )

    def linearised(self) -> Run:
        """Another run that goes on from here with tissue that is linear about the present state."""
        run = copy(self)
        run.model = model = linearised(self.model, self.state)
        ledger = self.ledger
        sums, pull_off = ledger.sums.copy(), replace(ledger.pull_off)
        run.ledger = replace(ledger, model=model, sums=sums, pull_off=pull_off)
        run.stepper = replace(
            self.stepper, equilibrium=model.equilibrium, body=model.body, rise=partial(climb, model)
        )
        run.rows, run.frames, run.probed = (
            self.rows.copy(),
            self.frames.copy(),
            GrowingRows(self.probed.values),
        )
        return run

    # -- from motions to targets

    def requests(self) -> Iterator[Request]:
        """The remaining steps; paths start from the state at the time of their request."""
        done, step = len(self.rows), 0
        before = Course()
        for index, motion in enumerate(self.scene.motion):
            course, last, first = motion.course, before, step
            before = course
            step += motion.steps
            if step <= done:
                continue
            start = self.start_of(first)
            gap_ended = last.gap is not None and course.gap is None
            if gap_ended and done <= first and (said := unstable_alone(self.model, self.state, self.rows)):
                notices.warn(f"motion {index}: {said}")
            for k in range(max(done - first, 0) + 1, motion.steps + 1):
                begun, reached, steps = motion.part(k)
                seconds = course.seconds(steps, start["indentation"])
                path = self.path(course, start, (begun, reached), seconds)
                turns = self.turns(course, start, (begun, reached), seconds)
                yield Request(first + k, index, motion.kind, path, seconds, turns)

    def path(self, course: Course, start: Start, fractions: tuple[float, float], seconds: float) -> Path:
        """The path of the next step, between two `fractions` (0 to 1) of a motion that began at `start`.

        The voltage acts in full from the first step on; only a first step in substeps raises it within.
        """
        now, (begun, reached) = self.time, fractions
        raised = not (self.rows or self.source.prescribed(seconds))

        def target(done: float, fraction: float) -> Target:
            time, reached_now = now + fraction * seconds, begun + fraction * (reached - begun)
            at = self._target(course, start, reached if fraction == 1.0 else reached_now, time)
            if raised and fraction < 1.0:
                end = self._target(course, start, reached, now + seconds).voltage
                at = replace(at, voltage=at.voltage.raised(end, fraction))
            return replace(at, duration=(fraction - done) * seconds)

        return target

    def turns(self, course: Course, start: Start, fractions: tuple[float, float], seconds: float) -> Floats:
        """Fractions (k,) of the next step at which the voltage turns, and so many that surface and friction
        do not turn unseen in between; none with prescribed steps.
        """
        if not self.stepper.parts.measures:
            return np.zeros(0)
        ends = [
            self._moment(course, start, part, self.time + spent)
            for part, spent in zip(fractions, (0.0, seconds), strict=True)
        ]
        length = abs(course.distance) * (fractions[1] - fractions[0])
        count = int(np.ceil(length / self.slip_scale)) if length else 1
        return np.union1d(self.source.turns(*ends), np.arange(1, count) / count)

    def start_of(self, rows_before: int) -> Start:
        """Initial state of a motion: bone, indentation, force, voltage, and whether it is unloaded."""
        start = dict.fromkeys(START_COLUMNS, 0.0)
        if rows_before == 0:
            return start | {"voltage": self.source.start, "indentation": self.first_indentation}
        row = self.rows[rows_before - 1]
        start |= {name: row[name] for name in START_COLUMNS if name in row}
        least = self.model.equilibrium.tolerance * SMALLEST_FORCE
        names = ("electrostatic", *(one.name for one in self.model.attraction.parts))
        pulled = any(row[f"{name}_force"] != 0.0 for name in names)
        start["loose"] = float(row["normal_force"] <= least and not pulled)
        return self.model.drive.begin_at(start, self._travelled(rows_before))

    def _travelled(self, rows_before: int) -> tuple[float, float]:
        """x and z of the drive (mm) at the end of the motions of so many rows."""
        x = z = 0.0
        done = 0
        for motion in self.scene.motion:
            done += motion.steps
            if done <= rows_before:
                x, z = x + motion.course.travel[0], z + motion.course.travel[1]
        return x, z

    def _moment(self, course: Course, start: Start, fraction: float, time: float) -> Moment:
        """What a source is evaluated at: `fraction` (0 to 1) of a motion, at `time` (s)."""
        x, z = (
            _towards(start[name], start[name] + distance, fraction)
            for name, distance in zip(("position", "position_z"), course.travel, strict=True)
        )
        heading = course.direction[: self.model.mesh.dim - 1]
        along = float(np.dot((x, z)[: len(heading)], heading))
        voltage = _towards(start["voltage"], course.voltage, fraction)
        return Moment(voltage, time, self.time, x, along, heading, bool(course.distance))

    def _target(self, course: Course, start: Start, fraction: float, time: float) -> Target:
        """The target at `fraction` (0 to 1) of a motion, to be reached at `time` (s)."""

        def towards(name: str, end: float | None) -> float:
            return _towards(start[name], end, fraction)

        moment = self._moment(course, start, fraction, time)
        position_z = towards("position_z", start["position_z"] + course.travel[1])
        bone = self.model.bone(moment.x, towards("indentation", course.indentation), position_z)
        height: HeightControl = Indentation(float(bone[1]))
        if course.force is not None:
            height = Force(towards("applied_force", course.force))
        elif course.hold == "force":
            loose = bool(start["loose"]) and course.gap is None and not self.source.pulls(moment)
            height = Unsupported(float(bone[1])) if loose else Force(start["applied_force"])
        voltage: VoltageControl = self.source.control(moment, control)
        if course.gap is not None:
            voltage = GivenGap(towards("min_gap", course.gap))
        return Target(moment.x, height, voltage, z=tuple(bone[2:].tolist()), drive=self.model.drive)

    # -- one requested step

    def advance(self, request: Request) -> Frame | None:
        """Reach a request's target exactly, record its row, and return its fields if they are wanted."""
        begin, iterations = clock.perf_counter(), self.model.equilibrium.record.iterations
        released, snapped = self.stepper.relaxations, self.stepper.snaps
        target = request.path(0.0, 1.0)
        self.state = self.model.equilibrium.restart(self.state, target)
        self.ledger.control = target.voltage
        try:
            self.state, substeps = self.stepper.follow(self.state, request.path, self.ledger, request.turns)
        except StepFailed as error:
            said = advice(self.scene, self.model, error)
            raise NotConverged(request.step, error.residuals, said, self.result()) from None
        except Unresolved as error:
            raise NotConverged(request.step, [], str(error), self.result()) from None
        self.sunk = max(
            self.sunk,
            deepest_penetration(self.model, self.free_nodes, self.state.u),
            key=lambda one: one[0],
        )
        row = self.row(self.ledger, request, self.state)
        self.time += request.duration
        row["substeps"] = substeps
        row["newton_iterations"] = self.model.equilibrium.record.iterations - iterations
        row["relaxations"] = self.stepper.relaxations - released
        row["jumps"] = row["relaxations"] + self.stepper.snaps - snapped
        row["seconds"] = clock.perf_counter() - begin
        self.rows.append(row)
        if self.probes is not None:
            self.probed.add(self.probes.at(self.model.body.whole(self.state.u), self.state.memory))
        if request.step % (self.scene.output.every or 1) and request.step != self.scene.total_steps:
            return None
        self.frames.append(frame_of(self.model, self.state, row))
        return self.frames[-1]

    def row(self, ledger: EnergyAccount, request: Request, state: State) -> dict[str, Any]:
        """The row of a state at the end of a request, without its costs."""
        at = request.step, request.motion_index, request.kind, self.time + request.duration
        voltage, tolerance = request.path(0.0, 1.0).voltage, self.model.equilibrium.tolerance
        row = ledger.row(state, *at) | {one.name: 0.0 for one in self.model.missed}
        return row | voltage.misses(row, state, tolerance)

    def keep_last_frame(self) -> None:
        """The fields of the last step, wanted or not."""
        if not self.frames or self.frames[-1].step != self.rows[-1]["step"]:
            self.frames.append(frame_of(self.model, self.state, self.rows[-1]))

    def result(self) -> Result:
        """Everything up to the last converged step."""
        record = self.model.equilibrium.record
        solver = {
            "element": self.model.body.space.element,
            "unknowns": self.model.body.size,
            "iterations": record.iterations,
            "factorisations": record.factorisations,
            "contact_solves": record.contact_solves,
            "cuts": self.stepper.cuts,
            "relaxations": self.stepper.relaxations,
            "barriers": self.stepper.barriers,
            "held": self.stepper.held,
            "candidates": int(self.model.equilibrium.body.reusable().candidates.size),
            "backend": record.backend,
            "cell_loops": "numpy" if loops() is None else "compiled",
            **self.stepper.parts.told,
        }
        about = provenance(self.scene, self.model.mesh, solver)
        if (core := self.model.closing.core) is not None:
            about["core"] = core.told
        said = (
            *penetration(self.model, self.sunk),
            *lost_stresses(self.model, self.state.u),
            *pull_offs(self.ledger.pull_off.came_off, self.model.mesh.dim),
        )
        if further := [one for one in self.model.columns if one.name not in ROOM_COLUMNS]:
            about["columns"] = [[one.name, one.unit, one.meaning] for one in further]
        about["warnings"] = [*said, *doubtful(self.scene, self.rows)]
        probes = None if self.probes is None else self.probes.histories(self.probed.values)
        return Result.from_rows(self.rows, self.frames, self.model.mesh, about, probes, self.scene)

    # -- checkpoints

    def checkpoint(self) -> dict[str, Any]:
        """Arrays from which the run can go on after its last converged step."""
        return {
            **state_arrays(self.state),
            **reusable_arrays(self.state, self.model.equilibrium.body.reusable()),
            "substep": np.array(self.stepper.substep),
            "time": np.array(self.time),
            "sunk": self.sunk,
            **({} if self.probes is None else {PROBES: self.probed.values}),
            **account_arrays(self.ledger, self.state),
        }

    def restore(self, saved: Saved) -> None:
        """Go on from what was saved. Raises InputError for what is no checkpoint of this scene."""
        columns = self.model.column_names
        arrays = usable(saved, self.checkpoint(), self.scene.total_steps, columns)
        self.state = state_of(arrays)
        self.model.equilibrium.body.resume(reusable_of(arrays))
        self.stepper.substep, self.time = float(arrays["substep"]), float(arrays["time"])
        self.ledger, self.sunk = account_of(self.model, arrays), arrays["sunk"]
        self.rows = list(saved.rows)
        self.probed = GrowingRows(arrays.get(PROBES, self.probed.values))

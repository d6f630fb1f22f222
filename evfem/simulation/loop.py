"""Interactive stepping: a run whose motion is decided while it goes on, one step after the other.

A step is the same as a step of a motion in `simulate`: its exact target is reached in as many substeps as
needed, and its row is that of the history. Quantities that are left out keep their last value: position,
voltage, and the load where a force was prescribed last, else the indentation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from os import PathLike
from types import SimpleNamespace
from typing import Annotated, Any, ClassVar

import numpy as np

from evfem.common import notices
from evfem.common.arrays import blas_limits, loaded_blas
from evfem.common.checks import Checked, Within, number, set_frozen
from evfem.errors import ABSENT, InputError, NotConverged, StopRun
from evfem.newton.control import Target
from evfem.planning.core import Closing
from evfem.protocols import Observer, TimeSignal
from evfem.scene.file import scene_at
from evfem.scene.motion import FORCE, INDENTATION, VOLTAGE, Course, Motion
from evfem.scene.scene import SIGNALS, Scene
from evfem.simulation.history import ROOM_COLUMNS
from evfem.simulation.result import Frame, Result, Saved
from evfem.simulation.run import Request, Run, Start
from evfem.solver.path import Path

#: forces that have an error; those below `FAINT` of the largest have none of their own
FORCES, FAINT = ("normal_force", "tangential_force", "electrostatic_force"), 1e-3

_PLACE = number("a position in mm between -1000 and 1000", Within(-1000.0, 1000.0), "mm")
_SECONDS = number("a time in s, not negative, up to 1e6", Within(0.0, 1e6), "s")
_LARGEST = number("the largest magnitude in V of the steps to come, from 0 to 1e6", Within(0.0, 1e6), "V")


@dataclass(frozen=True)
class StepRequest(Checked):
    """Targets of one step at its end; None leaves a quantity unchanged."""

    position: Annotated[float | None, _PLACE, "x of the bone, of the drive where there is a hand"] = None
    position_z: Annotated[float | None, _PLACE, "z of the bone, of a fingertip"] = None
    indentation: Annotated[float | None, INDENTATION, "travel of the bone beyond first touch"] = None
    force: Annotated[float | None, FORCE, "load on the bone"] = None
    voltage: Annotated[float | None, VOLTAGE, "at the end, from the present one"] = None
    duration: Annotated[float | None, _SECONDS, "how long the step takes; without it no time passes"] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.indentation is not None and self.force is not None:
            raise InputError("force", "indentation and force", "one of the two")


@dataclass(frozen=True)
class InteractiveMotion(Motion):
    """All steps of a loop as one motion: their number, and `did`: the last slide, the last press and the
    largest voltage of the completed steps.
    """

    kind: ClassVar[str] = "step"
    steps: int = 0
    did: Course = field(default_factory=Course)

    @property
    def course(self) -> Course:
        return self.did

    @property
    def takes_time(self) -> bool:
        return True  # as far as one knows beforehand

    def part(self, step: int) -> tuple[float, float, float]:
        return 0.0, 1.0, 1.0

    def and_then(self, course: Course) -> InteractiveMotion:
        """The same with the programme of one more step, which is not counted yet."""
        slide = course if course.distance else self.did
        press = course if course.depth is not None else self.did
        voltages = [one for one in (self.did.voltage, course.voltage) if one is not None]
        did = replace(
            press,
            distance=slide.distance,
            angle=slide.angle,
            voltage=max(voltages, key=abs, default=None),
            duration=max(self.did.duration, course.duration),
        )
        return replace(self, did=did)


class LoopRow(SimpleNamespace):
    """A row with its columns as attributes; one of a room of the package that the scene has not reads 0."""

    def __getattr__(self, name: str) -> float:
        if name in ROOM_COLUMNS:
            return 0.0
        raise AttributeError(f"a row has no column {name}")


class Loop:
    """A scene that is stepped interactively, made by `ev.loop`; its own motion is done."""

    def __init__(self, scene: Scene, observers: Sequence[Observer], largest_voltage: float | None) -> None:
        notices.check_observers(observers)
        if largest_voltage is not None:
            largest_voltage = _LARGEST["check"]("largest_voltage", largest_voltage)
        self.scene, self._observers = scene, observers
        self._own, self._interactive = scene.motion, InteractiveMotion(did=Course(voltage=largest_voltage))
        self._check(StepRequest(voltage=largest_voltage, duration=0.0))
        self._reasons: list[str] = []
        with blas_limits():
            self._run = Run(self._moved(self._interactive), None)
            self._tell("started", self._run.model.mesh, scene, scene.total_steps)
            self._blas = loaded_blas()
        self._largest = self._run.scene.electrics.largest_voltage
        with self._threads():
            for request in self._run.requests():
                self._reasons = self._told(self._run.advance(request))
                if self._reasons:
                    break
        last, rows = scene.courses[-1:], self._run.rows
        held = any(one.force is not None or one.hold == "force" for one in last)
        self._load: float | None = rows[-1]["applied_force"] if held else None
        self._true: Loop | None = None
        self._to_check: list[StepRequest] = []

    def linearised(self) -> Loop:
        """The same with tissue linear from now on; this one goes on behind it, when its error is read."""
        loop = copy(self)
        loop._run, loop._true, loop._reasons = self._run.linearised(), self, self._reasons.copy()
        self._observers = ()
        return loop

    def step(
        self,
        *,
        position: float | None = None,
        position_z: float | None = None,
        indentation: float | None = None,
        force: float | None = None,
        voltage: float | None = None,
        duration: float | None = None,
    ) -> LoopRow:
        """One step to an exact target.

        Parameters
        ----------
        position, position_z
            Absolute position of the bone (mm), along x and, of a fingertip, along z; with a hand that of
            the drive.
        indentation
            Travel of the bone beyond first touch (mm), negative when hovering. This or `force`.
        force
            Load on the bone (N/mm, of a fingertip N), which then stays.
        voltage
            At the end (V); within the step it changes evenly.
        duration
            Seconds. Without it no time passes; needed where something depends on time, where 0 stands
            for a step without time.

        Returns
        -------
        types.SimpleNamespace
            The row: the columns of the history as attributes, in its units.

        Raises
        ------
        NotConverged
            There is no such state. The loop is where it was, and another step may be tried.
        InputError
            The requested targets contradict each other or the scene.
        StopRun
            An observer raised it; the step is done.
        """
        wanted = StepRequest(position, position_z, indentation, force, voltage, duration)
        self._check(wanted)
        start = self._start(wanted)
        course = self._course(wanted, start)
        self._check_course(course)
        with self._threads():
            self._make_for(course)
            frame = self._advance(course, start, wanted)
        if course.force is not None:
            self._load = self._run.rows[-1]["applied_force"]
        elif course.indentation is not None:
            self._load = None
        if self._true is not None:
            self._to_check.append(wanted)
        reasons = self._told(frame)
        self._reasons += reasons
        if reasons:
            raise StopRun("; ".join(reasons))
        return LoopRow(**self._run.rows[-1])

    def result(self) -> Result:
        """All rows so far, with the fields of every n-th step (`Output.every`) and of the last."""
        frames = self._run.frames.copy()
        if self._run.rows:
            self._run.keep_last_frame()
        found = replace(self._run.result(), simulated=None)  # its steps are no motion to be run again
        self._run.frames = frames
        if self._reasons:
            found.provenance["stopped"] = "; ".join(self._reasons)
        self._tell("finished", found)
        return found

    @property
    def error(self) -> float:
        """Largest error of a force in any step so far, relative to its largest size; 0 unless linearised.

        Of the normal, the tangential and the electrostatic force. The steps since it was last read are done
        again without linearisation, which takes as long as that does. Infinite where one of them fails.
        """
        if self._true is None:
            return 0.0
        try:
            while self._to_check:
                self._true.step(**vars(self._to_check[0]))
                del self._to_check[0]
        except NotConverged:
            return math.inf
        runs = self._run, self._true._run
        found, true = (np.array([[row[name] for name in FORCES] for row in run.rows]) for run in runs)
        size = np.abs(true).max(axis=0)
        return float((np.abs(found - true).max(axis=0) / np.maximum(size, FAINT * size.max())).max())

    def __repr__(self) -> str:
        """Number of steps, position and forces."""
        rows = self._run.rows
        text = f"Loop of {self.scene.name!r}: {len(rows)} steps"
        names = ("position", "indentation", "voltage", "normal_force", "tangential_force")
        return ", ".join([text, *(f"{n.replace('_', ' ')} {rows[-1][n] + 0.0:.4g}" for n in names if rows)])

    # -- what a step is

    def _check(self, wanted: StepRequest) -> None:
        """Raise InputError for what the scene does not have."""
        scene = self.scene
        over_time = isinstance(scene.electrics.voltage, TimeSignal) or scene.electrics.resolved
        needing = scene.time_needed_by or ("a voltage over time",) * over_time
        if wanted.duration is None and needing:
            raise InputError("duration", ABSENT, f"a time in s, needed with {' and '.join(needing)}")
        if wanted.voltage is None:
            return
        if not scene.has_voltage:
            raise InputError("voltage", "a voltage without a law", "a scene with an electrostatic law")
        if isinstance(scene.electrics.voltage, SIGNALS):
            given = f"{wanted.voltage:g} beside the {type(scene.electrics.voltage).__name__} of the scene"
            raise InputError("voltage", given, "one of the two")

    def _check_course(self, course: Course) -> None:
        """Raise InputError for a step that no motion of the scene could be."""
        scene, needing = self.scene, " and ".join(self.scene.time_needed_by)
        if course.force == 0.0 and not scene.is_pulled:
            raise InputError("force", 0.0, "larger than 0 when nothing else pulls the finger down")
        if course.distance and needing and not course.duration:
            raise InputError("duration", 0.0, f"larger than 0 where the finger moves along, with {needing}")
        if not course.angle:
            return
        if self._run.model.mesh.dim == 2:
            raise InputError("position_z", "a displacement across x", "0 with a finger in the plane")

    def _start(self, wanted: StepRequest) -> Start:
        run = self._run
        if not run.rows:
            run.begin_at(min(wanted.indentation or 0.0, 0.0))
        start = run.start_of(len(run.rows))
        start |= run.model.drive.place(run.state)
        return start if self._load is None else start | {"applied_force": self._load}

    def _course(self, wanted: StepRequest, start: Start) -> Course:
        """The programme of the step; a slide along x has the angle 0 for either sign, as in the plane."""
        along, across = (
            0.0 if end is None else end - start[name]
            for name, end in (("position", wanted.position), ("position_z", wanted.position_z))
        )
        distance, angle = along, 0.0
        if across:
            angle = math.degrees(math.atan2(across, along))
            distance = math.hypot(along, across)
        if angle <= -90.0 or angle > 90.0:
            angle, distance = angle - math.copysign(180.0, angle), -distance
        return Course(
            distance=distance,
            angle=angle,
            indentation=wanted.indentation,
            force=wanted.force,
            hovers=(wanted.indentation or 0.0) < 0.0,
            hold="indentation" if self._load is None or wanted.indentation is not None else "force",
            voltage=wanted.voltage,
            duration=wanted.duration or 0.0,
        )

    # -- the run

    def _advance(self, course: Course, start: Start, wanted: StepRequest) -> Frame | None:
        """Do the step, or leave everything as it was."""
        run, before = self._run, self._interactive
        kept, substep = run.ledger.snapshot(), run.stepper.substep
        path = _exactly(run.path(course, start, (0.0, 1.0), course.duration), wanted)
        request = Request(len(run.rows) + 1, len(self._own), InteractiveMotion.kind, path, course.duration)
        self._move(before.and_then(course))
        try:
            frame = run.advance(request)
        except BaseException:
            self._move(before)
            run.ledger.restore(kept)
            run.stepper.substep = substep
            raise
        self._move(replace(self._interactive, steps=before.steps + 1))
        return frame

    def _moved(self, at_will: InteractiveMotion) -> Scene:
        """The scene with the steps so far behind its own motion; a copy that nobody else has."""
        return replace(self.scene, motion=(*self._own, at_will))

    def _move(self, at_will: InteractiveMotion) -> None:
        """Tell the run's scene what its steps are: checked anew, a long loop would slow down."""
        self._interactive = at_will
        set_frozen(self._run.scene, motion=(*self._own, at_will))

    def _make_for(self, course: Course) -> None:
        """Make the model anew where a voltage is larger than any before, or the finger hovers first, and that
        changes what it needs.
        """
        run, voltage = self._run, abs(course.voltage or 0.0)
        more, above = voltage > self._largest, course.hovers and not self._run.rows
        if not (more or above):
            return
        if more and self._true is not None:
            raise InputError("voltage", voltage, "at most `largest_voltage` of a loop that is linearised")
        scene = self._moved(self._interactive.and_then(course))
        cored = (Closing(scene, run.model.mesh).core is None) != (run.model.closing.core is None)
        if cored or not run.scene.electrics.acts:
            self._run = Run(scene, None)
            if run.rows:  # with the columns of what acts from now on
                none = dict.fromkeys(self._run.model.column_names, 0.0)
                self._run.restore(Saved(run.checkpoint(), [none | row for row in run.rows]))
            self._run.frames = run.frames
        self._largest = max(voltage, self._largest)

    def _threads(self) -> Any:
        """The BLAS has one, as in `simulate`."""
        return self._blas.limit(limits=1)

    def _tell(self, event: str, *arguments: Any) -> list[str]:
        return notices.tell_observers(self._observers, event, *arguments)

    def _told(self, frame: Frame | None) -> list[str]:
        """Tell the observers of the last step; the reasons of those who want to stop."""
        return self._tell("step", self._run.rows[-1], frame, self._run.checkpoint)


def _exactly(path: Path, wanted: StepRequest) -> Path:
    """The path with exactly the requested end."""
    across = None if wanted.position_z is None else (wanted.position_z,)
    coordinates: dict[str, Any] = {"x": wanted.position, "z": across}
    ends: dict[str, Any] = {name: one for name, one in coordinates.items() if one is not None}

    def exact(done: float, fraction: float) -> Target:
        target = path(done, fraction)
        return replace(target, **ends) if fraction == 1.0 else target

    return exact


def loop(
    scene: Scene | str | PathLike[str],
    *,
    linearised: bool = False,
    observers: Sequence[Observer] = (),
    largest_voltage: float | None = None,
) -> Loop:
    """Take a scene step by step: its own motion is done first, if it has one.

    Parameters
    ----------
    scene
        A `Scene`, whose `motion` may be empty, or the path of a scene file.
    linearised
        The tissue is linear from the end of the scene's motion on, which is quicker; contact, friction and
        attraction stay exact, and `Loop.error` tells what the forces lack. Not in time, and without forms
        of one's own.
    observers
        Told as in `simulate`: `started` at once, `step` after every step, `finished` with every
        `Loop.result()`.
    largest_voltage
        Largest magnitude of the steps to come (V, not negative), where it is more than the scene's: the
        model is made for it. A voltage beyond the largest so far may change what the model needs (a core,
        `Solver.core`); it is then made again, which takes as long as at the beginning.

    Returns
    -------
    Loop
        With `step(...)`, which returns a row, and `result()`.

    Examples
    --------
    >>> import evfem as ev
    >>> finger = ev.FingerPad(ridges=False, resolution="coarse")
    >>> steps = loop(ev.Scene(finger, ev.Flat(friction=0.3), motion=ev.Press(force=0.02, steps=1)))
    >>> row = steps.step(position=0.05)
    >>> f"{row.position} mm, {row.applied_force:.4f} N/mm"
    '0.05 mm, 0.0200 N/mm'
    >>> steps.step(indentation=0.1).motion, len(steps.result().rows)
    ('step', 3)
    """
    whole = Loop(scene_at(scene), observers, largest_voltage)
    return whole.linearised() if linearised else whole

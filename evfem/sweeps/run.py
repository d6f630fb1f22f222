"""Run a sweep: many scenes side by side, each recorded as soon as it is finished, in one table at the end."""

from __future__ import annotations

import math
import time as clock
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import evfem
from evfem.common import notices
from evfem.common.digest import digest
from evfem.common.notices import LOG
from evfem.common.pools import Died, Pool, open_pool
from evfem.common.storage import alone_in
from evfem.errors import InputError, NotConverged
from evfem.scene.file import loads
from evfem.scene.scene import Scene
from evfem.simulation.provenance import origin
from evfem.simulation.result import Result
from evfem.simulation.run import simulate
from evfem.sweeps.file import LAST, Sweep, load
from evfem.sweeps.folder import STATUS, Answer, SweepFolder
from evfem.sweeps.means import chosen, mean
from evfem.sweeps.table import SweepResult, Units, table_units, units_of

#: the table is written anew after so many seconds
EVERY = 5.0
#: columns of friction, and the share of the contact that sticks from which on they are not those of sliding
OF_FRICTION, STICKS = ("tangential_force", "friction", "apparent_friction"), 0.01
Job = tuple[str, str, tuple[str, ...]]  # scene as text, folder of its paths, outputs


def sweep(
    plan: Sweep | str | Path,
    out: str | Path | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: bool = False,
) -> SweepResult:
    """Run every point of a sweep.

    Parameters
    ----------
    plan
        A `Sweep`, or the path of a sweep file.
    out
        Folder for `sweep.csv`, `sweep.parquet` (with pyarrow), `sweep.json` and a file per point.
        Points that are finished there are not computed again.
    resume, overwrite
        Keep or remove the points of another sweep in the folder, which is refused otherwise.
    workers
        Number of processes; None: one per core, 1: this process only.
    scheduler
        Address of a Dask cluster instead of processes; "local" starts one. The numbers are the
        same.
    progress
        Show a progress bar.

    Returns
    -------
    SweepResult
        A row per point. One that is refused, does not converge or fails has its status and message;
        the message of one that is done has the warnings of its result.

    Raises
    ------
    InputError
        No point is a valid scene.
    StorageError
        The folder cannot be written, or another sweep is running in it.

    Examples
    --------
    >>> from evfem.sweeps.file import loads as read
    >>> text = '''
    ... version = 1
    ... [scene.finger]
    ... resolution = "coarse"
    ... [scene.surface]
    ... kind = "flat"
    ... [[scene.motion]]
    ... kind = "hover"
    ... gap = 0.5
    ... [grid]
    ... motion.0.gap = [0.25, 0.5, -1.0]
    ... '''
    >>> result = sweep(read(text), workers=1)
    >>> result
    SweepResult(3 points: 2 done, 1 refused)
    >>> result.rows[2]["message"]
    'motion[0].gap: given -1.0; allowed: a gap in mm from 0 to 200'
    """
    if isinstance(plan, (str, Path)):
        plan = load(plan)
    if not isinstance(plan, Sweep):
        allowed = "Sweep(scene, grid={key: values}), or the path of a sweep file"
        raise InputError("sweep", f"a {type(plan).__name__}", allowed)
    with ExitStack() as stack:
        pool = stack.enter_context(open_pool(workers, scheduler))
        folder = None if out is None else SweepFolder(Path(out), resume, overwrite)
        if folder is not None:
            stack.enter_context(alone_in(folder.path))
        run = _Run(plan, folder, progress)
        try:
            compute(evaluate, run.waiting(), pool, run.keep)
        finally:
            run.close()
        return run.result()


class _Run:
    """A running sweep: its points, the key of each, and the answers so far."""

    def __init__(self, plan: Sweep, folder: SweepFolder | None, progress: bool) -> None:
        self.plan, self.folder, self.began = plan, folder, clock.perf_counter()
        self.points = plan.points()
        self.answers: dict[str, Answer] = {}
        self.refusals: list[InputError] = []
        self.found: list[Units] = []
        with notices.status("reading the points") if progress else nullcontext():
            self.keys = [self._key(point.text) for point in self.points]
        refused = dict(self.answers)
        if len(refused) == len(set(self.keys)):
            first = self.refusals[0]
            if len({str(error) for error in self.refusals}) == 1:
                raise first
            raise InputError(first.key, first.given, f"{first.allowed} (no point of the sweep is valid)")
        self.units = table_units(plan.outputs, plan.parameters, self.found)
        self.digest = digest(sorted(set(self.keys)))
        if folder is not None:
            folder.open(set(self.keys), self.digest)
            kept = {key: folder.read(key) for key in set(self.keys) - set(self.answers)}
            self.answers |= {key: answer for key, answer in kept.items() if answer is not None}
        self.reused = len(self.answers) - len(refused)
        if progress and refused:
            count = sum(key in refused for key in self.keys)
            notices.tell(f"{count} of {len(self.keys)} points are no valid scene")
        if progress and folder is not None and not self.waiting():
            notices.tell(f"the sweep in {folder.path} is complete, nothing is left to compute")
        self.written = clock.perf_counter()
        if folder is not None:
            folder.write_provenance(self.result().provenance)
        bar = progress and notices.drawable()
        self.total, self.lines = len(set(self.keys)), progress and not bar
        self.bar = notices.bar(self.total, "point", len(self.answers), bar)

    def _key(self, text: str) -> str:
        """Fingerprint of a point's scene and outputs, or of its text when it is no scene."""
        try:
            scene = loads(text, self.plan.folder)
        except InputError as error:
            key = digest((text, "refused"))
            self.answers[key] = Answer("refused", 0.0, str(error), {})
            self.refusals.append(error)
            return key
        if (units := units_of(scene)) not in self.found:
            self.found.append(units)
        return digest((scene.digest(), self.plan.outputs, evfem.__version__))

    def waiting(self) -> dict[str, Job]:
        """Points to compute; equal points are computed once."""
        folder, outputs = str(self.plan.folder), tuple(self.plan.outputs)
        jobs = zip(self.keys, self.points, strict=True)
        return {key: (point.text, folder, outputs) for key, point in jobs if key not in self.answers}

    def keep(self, key: str, answer: Answer) -> None:
        """A point is finished: it goes to disk, and every few seconds so does the table."""
        if self.folder is not None:
            self.folder.write(key, answer)
        self.answers[key] = answer
        done, wrong = len(self.answers), sum(one.status != "done" for one in self.answers.values())
        self.bar.set_postfix_str(f"{wrong} without result" if wrong else "", refresh=False)
        self.bar.update(1)
        LOG.debug("point %d of %d", done, self.total)
        if self.lines:
            notices.milestone("point", done, self.total)
        if self.folder is not None and clock.perf_counter() - self.written > EVERY:
            self._write()

    def close(self) -> None:
        """The table of what is finished, however the sweep ended."""
        self.bar.close()
        if self.folder is not None:
            self._write()

    def _write(self) -> None:
        assert self.folder is not None
        result = self.result()
        self.folder.write_table(result.columns, result.rows, result.units)
        self.folder.write_provenance(result.provenance)
        self.written = clock.perf_counter()

    def result(self) -> SweepResult:
        """The table; points that are not finished are left out."""
        plan = self.plan
        rows = []
        for point, key in zip(self.points, self.keys, strict=True):
            if (answer := self.answers.get(key)) is not None:
                found = {name: answer.outputs.get(name) for name in plan.outputs}
                state = {name: getattr(answer, name) for name in LAST}
                rows.append({"point": point.index, **point.labels, **point.parameters, **found, **state})
        return SweepResult(plan.columns, rows, self._provenance(rows), self.units)

    def _means(self) -> dict[str, Any]:
        """What the means among the outputs are over, as far as points are done."""
        told: dict[str, set[str]] = {}
        for answer in self.answers.values():
            for name, over in answer.over.items():
                told.setdefault(name, set()).add(over)
        return {"means": {name: sorted(over) for name, over in told.items()}} if told else {}

    def _provenance(self, rows: list[dict[str, Any]]) -> dict[str, Any]:
        plan, samples = self.plan, self.plan.samples
        counted = Counter(row["status"] for row in rows)
        drawn = None
        if samples is not None:
            told = {name: repr(one) for name, one in samples.parameters.items()}
            drawn = {"count": samples.count, "seed": samples.seed, "method": samples.method, "of": told}
        return {
            "sweep": plan.name,
            "points": {"requested": len(self.points), **{name: counted[name] for name in STATUS}},
            "reused": self.reused,
            "digest": self.digest,
            "complete": len(rows) == len(self.points),
            "wall_seconds": clock.perf_counter() - self.began,
            **origin(),
            "scene": {"tables": plan.tables, "digest": digest(plan.tables)},
            "grid": plan.grid,
            "samples": drawn,
            "outputs": list(plan.outputs),
            **self._means(),
            "units": {
                "length": "mm",
                "force": self.found[0]["normal_force"],
                "voltage": "V",
                "energy": self.found[0]["stored_energy"],
                "time": "s",
                "outputs": self.units,
            },
        }


def evaluate(job: Job) -> Answer:
    """Run one point; whatever happens to it is in the answer."""
    text, folder, names = job

    over: dict[str, str] = {}
    sticks: list[str] = []

    def ask(result: Result) -> dict[str, float | None]:
        result = result if result.depth is None else result.total
        sticks.extend(sticking(result, names))
        over.update({name: mean(result, *_asked(name))[1] for name in names if ".mean" in name})
        return {name: output(result, name) for name in names}

    answer = answered(text, folder, ask, simulate)
    return replace(answer, over=over, message="; ".join([one for one in (answer.message, *sticks) if one]))


def sticking(result: Result, outputs: Sequence[str]) -> list[str]:
    """A sentence for each slide with an output of friction at its end, where part of the contact sticks:
    friction is below that of a pad that slides.
    """
    asked = [_asked(name) for name in outputs if name.split(".")[1] in ("last", "max")]
    motions = {motion for column, motion in asked if column in OF_FRICTION}
    found = {}
    for motion in motions if "stick_share" in result.columns else ():
        for last in np.flatnonzero(chosen(result, motion))[-1:]:
            if result.motion[last] == "slide" and result.stick_share[last] >= STICKS:
                found[int(result.motion_index[last])] = float(result.stick_share[last])
    return [
        f"{100.0 * share:.0f} % of the contact still sticks at the end of motion {motion}, so its friction "
        "is not that of sliding; a longer distance slides"
        for motion, share in sorted(found.items())
    ]


def answered(
    text: str,
    folder: str,
    ask: Callable[[Any], dict[str, float | None]],
    run: Callable[[Scene], Any] = simulate,
) -> Answer:
    """`run` the scene in a text and `ask` what comes of it; whatever happens is in the answer."""
    began = clock.perf_counter()
    outputs: dict[str, float | None] = {}
    status, message = "done", ""
    try:
        result = run(loads(text, folder))
        outputs, message = ask(result), "; ".join(result.warnings)
    except NotConverged as error:
        status, message = "not_converged", str(error)
    except InputError as error:
        status, message = "refused", str(error)
    except Exception as error:  # whatever a user's own part raises must not cost the other points
        status, message = "failed", f"{type(error).__name__}: {error}"
    return Answer(status, clock.perf_counter() - began, message, outputs)


def output(result: Result, name: str) -> float | None:
    """COLUMN.STATISTIC of a result, or COLUMN.STATISTIC.N over its motion N; None where it is no number."""
    (column, motion), statistic = _asked(name), name.split(".")[1]
    if statistic == "mean":
        found = mean(result, column, motion)[0]
    else:
        values = np.asarray(getattr(result, column), dtype=float)[chosen(result, motion)]
        values = values[-1:] if statistic == "last" else values[np.isfinite(values)]
        found = values[0] if len(values) == 1 else getattr(np, statistic)(values) if len(values) else math.nan
    return float(found) if math.isfinite(found) else None


def _asked(name: str) -> tuple[str, int | None]:
    """Column and motion (None: all) of an output."""
    column, _, *motion = name.split(".")
    return column, int(motion[0]) if motion else None


def compute(
    function: Callable[[Any], Answer],
    waiting: Mapping[str, Any],
    pool: Pool,
    keep: Callable[[str, Answer], None],
) -> None:
    """Give every job to a pool, every answer to `keep`; a job whose process died is tried again, alone."""
    again = []
    for key, found in pool(function, waiting):
        if isinstance(found, Died):
            again.append(key)
        else:
            keep(key, _answer(found))
    for one in again:
        for key, found in pool(function, {one: waiting[one]}):
            keep(key, _answer(found))


def _answer(found: Answer | Exception) -> Answer:
    if isinstance(found, Answer):
        return found
    message = str(found) if isinstance(found, Died) else f"{type(found).__name__}: {found}"
    return Answer("failed", 0.0, message, {})

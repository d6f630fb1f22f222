"""Fit parameters of a scene to measurements by least squares.

Minimised is the sum of squares of (run - measured) / sd over all measured numbers, by the trust
region reflective method (Branch, Coleman and Li 1999, doi:10.1137/S1064827595289108; scipy's
`least_squares` with bounds). Where a measurement has no sd, the root mean square of its values
takes its place: all its numbers weigh the same, and measurements of other units weigh alike.

The Jacobian is exact where all that is compared has derivatives (`evfem.response`), else of one-sided
differences in the unknowns (`evfem.calibration.parameters`), one step of `STEP` for each, computed side
by side. At the end one more run for each unknown, `FAR` steps away,
says whether its residuals are smooth: they are not where whole nodes, snaps or steps are counted, and
such a fit ends anywhere. A scene that the solver does not solve makes a trial step
shorter; one beside an accepted point is tried on the other side.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from evfem.calibration.confidence import confidence, few_runs
from evfem.calibration.measured import Measured, MeasuredCurve, MeasuredValues, Question, check_units
from evfem.calibration.parameters import Given, Parameters, number_at
from evfem.calibration.result import FitResult
from evfem.calibration.runs import Runs, derivative_of
from evfem.common import notices
from evfem.common.arrays import Floats
from evfem.common.digest import digest
from evfem.common.pools import open_pool
from evfem.common.storage import alone_in
from evfem.errors import InputError, describe_value, readable
from evfem.response.parameters import parameter_of
from evfem.scene.file import loads, read_text, tables_of
from evfem.scene.keys import VERSION
from evfem.scene.scene import Scene
from evfem.simulation.provenance import origin
from evfem.sweeps.file import scene_tables
from evfem.sweeps.folder import Answer, SweepFolder

#: step of a difference, in unknowns; relative changes of an unknown, and of the sum of squares, that end
#: the fit; most steps of it
STEP, UNKNOWNS, SQUARES, MOST_STEPS = 1e-3, 1e-5, 1e-6, 60
#: steps over which slopes must agree with that of one, and by how much of the larger one they may differ;
#: the change of the residuals, as a fraction of them, that is the solver's noise
FAR, ROUGH, NOISE = 10.0, 0.3, 1e-6
#: fraction of the distance between the bounds from which a parameter counts as at one
AT_BOUND = 1e-3
#: probability of so few runs of one sign below which residuals have a pattern, and residuals that are none
PATTERN, TINY = 0.01, 1e-3


def fit(
    scene: Scene | str | Path,
    data: Measured | Sequence[Measured],
    parameters: Mapping[str, Given],
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> FitResult:
    """Fit parameters of a scene to measurements by least squares.

    Parameters
    ----------
    scene
        A `Scene` that a file can hold, or the path of a scene file.
    data
        A `MeasuredCurve`, `MeasuredValues`, or several of them.
    parameters
        {dotted key of a scene file: (low, high)}, or `Parameter(low, high, start, apply)` in place of
        the pair.
    out
        Folder that keeps every run: the same fit, called again, continues an interrupted one.
    workers
        Number of processes; None: one per core, 1: this process only.
    progress
        Print a line per step of the fit.

    Returns
    -------
    FitResult
        Values with 95 % intervals, residuals, and the parameters that the data do not determine.

    Raises
    ------
    InputError
        Input that cannot be used, mostly before anything is computed, or a start at which the scene
        has no solution.

    Examples
    --------
    >>> from evfem.surface.surfaces import Display
    >>> from evfem.electrostatics.laws import Kaczmarek
    >>> from evfem.finger.fingerpad import FingerPad
    >>> from evfem.scene.motion import Hover
    >>> pad = FingerPad(ridges=False, resolution="coarse")
    >>> scene = Scene(pad, Display(), Kaczmarek(), 2000.0, Hover(gap=0.3))
    >>> gaps = {"motion.0.gap": [0.25, 0.3, 0.5]}
    >>> forces = MeasuredValues("electrostatic_force.last", [4.0e-4, 3.4e-4, 2.0e-4], gaps)
    >>> fit(scene, forces, {"electrostatics.insulator_thickness": (0.01, 0.2)}, workers=1)
    FitResult of 1 parameter to 3 values, rms residual 0.958 %
      electrostatics.insulator_thickness = 0.09818 (0.0833 to 0.116 with 95 % confidence)
    """
    problem = _Problem(scene, data, parameters)
    with ExitStack() as stack:
        pool = stack.enter_context(open_pool(workers, None))
        folder = None
        if out is not None:
            folder = SweepFolder(Path(out))
            stack.enter_context(alone_in(folder.path))
            try:
                folder.open((), problem.digest)
            except InputError as error:
                raise InputError("out", error.given, "another folder, or that of the same fit") from error
            folder.write_provenance({"digest": problem.digest, **problem.provenance})
        runs = Runs(pool, problem.paths, folder)
        result = _solve(problem, runs, progress)
    if folder is not None:
        result.save(folder.path / "fit.json")
    return result


class _Problem:
    """A fit before anything is run: its scene as tables, its data, its unknowns; its `runs`, the keys and the
    questions of each, and where each measured value is answered (`places`: number of the run, name).
    """

    def __init__(self, scene: Scene | str | Path, data: Any, parameters: Any) -> None:
        if isinstance(scene, Scene):
            self.tables, self.paths, self.name = scene_tables(scene), Path(), scene.name
        else:
            path = Path(scene)
            self.tables, self.paths = tables_of("scene", read_text("scene", path)), path.parent.resolve()
            self.name = path.stem
        self.output = {key: value for key, value in self.tables.items() if key == "output"}
        # fields are not needed, and no run ends between two of them
        self.tables = {"version": VERSION, **self.tables, "output": {"every": 10**6}}
        self.data: list[Measured] = [data] if isinstance(data, Measured) else list(data)
        self.parameters = Parameters.of(parameters)
        runs: dict[str, tuple[Mapping[str, Any], list[Question]]] = {}
        asked = []
        for one in self.data:
            if not isinstance(one, (MeasuredCurve, MeasuredValues)):
                raise InputError(
                    "data", describe_value(one), "MeasuredCurve, MeasuredValues, or a list of them"
                )
            one.check(len(self.tables.get("motion", ())))
            for keys, question in one.runs():
                key = digest(dict(keys))
                runs.setdefault(key, (keys, []))[1].append(question)
                asked += [(key, name) for name in question.names]
        self.runs = [(keys, tuple(questions)) for keys, questions in runs.values()]
        self.places = [(list(runs).index(key), name) for key, name in asked]
        if len({one.sd is None for one in self.data}) > 1:
            allowed = "an sd for each measurement, or for none: without one the sd is the rms of the values"
            raise InputError("data.sd", "one for some measurements and none for others", allowed)
        self.measured = np.concatenate([[], *(np.asarray(one.values) for one in self.data)])
        self.scale = np.concatenate([[], *(_scale(one) for one in self.data)])
        if len(self.measured) <= len(self.parameters.free):
            reason = f"{len(self.measured)} for {len(self.parameters.free)} parameters"
            raise InputError("data", reason, "more measured values than parameters")
        self._check_scenes()

    def _check_scenes(self) -> None:
        """Whether the scene can be read at start and bounds; `exact` are keys that have derivatives."""
        start = self.parameters.values(np.zeros(len(self.parameters.free)))
        scenes = [loads(self.text(keys, start), self.paths) for keys, _ in self.runs]
        for measured in self.data:
            check_units(measured, scenes[0])
        self.exact = []
        for key, one in self.parameters.free.items():
            for end in (one.low, one.high):
                try:
                    loads(self.text(self.runs[0][0], {**start, key: end}), self.paths)
                except InputError as error:
                    raise _of_a_bound(key, end, error) from error
            with suppress(InputError):
                parameter_of(scenes[0], key)
                self.exact.append(key)

    def text(self, keys: Mapping[str, Any], values: Mapping[str, float]) -> str:
        """The scene of one run as a text."""
        return tomli_w.dumps(self.parameters.applied(self.tables, keys, values))

    def fitted(self, values: Mapping[str, float]) -> dict[str, Any]:
        """The scene with these parameters as tables, with its own output, which the runs leave out."""
        tables = self.parameters.applied(self.tables, {}, values)
        return {key: value for key, value in tables.items() if key != "output"} | self.output

    @property
    def digest(self) -> str:
        """Fingerprint of everything that the fit's steps follow from."""
        return digest((self.tables, self.parameters, self.runs, self.places, self.measured, self.scale))

    @property
    def provenance(self) -> dict[str, Any]:
        return {
            "fit": self.name,
            **origin(),
            "sd": all(one.sd is not None for one in self.data),
            "scene": self.tables,
            "parameters": {key: vars(one) for key, one in self.parameters.free.items()},
        }


def _of_a_bound(key: str, end: float, error: InputError) -> InputError:
    """The mistake of a scene with a parameter at its bound `end`, as one of that bound."""
    own = re.sub(r"\[(\d+)\]", r".\1", error.key) == key
    said = error.given if isinstance(error.given, str) else readable(error.given)
    if own and said == readable(end):
        given = f"the bound {end:g}"
    elif own:  # of a factor or an offset
        given = f"the bound {end:g}, at which it is {said}"
    else:
        given = f"the bound {end:g}, with which {error.key} is refused (given {said})"
    return InputError(f"parameters.{key}", given, error.allowed)


def _scale(one: Measured) -> Floats:
    if one.sd is not None:
        return np.asarray(one.sd)
    size = float(np.sqrt(np.mean(np.square(one.values))))
    return np.full(len(one.values), size or 1.0)


class _Residuals:
    """The residuals and their Jacobian as functions of the unknowns."""

    def __init__(self, problem: _Problem, runs: Runs, progress: bool) -> None:
        self.problem, self.runs, self.progress = problem, runs, progress
        self.failed = ""
        self.told = np.zeros(0)
        self.exact = problem.exact

    def _answers(self, points: Sequence[Floats], by: Sequence[str]) -> list[list[Answer]]:
        """The answers of all runs at each point, differentiated `by` these keys."""
        problem = self.problem
        values = [problem.parameters.values(z) for z in points]
        wanted = [(problem.text(keys, one), asked) for one in values for keys, asked in problem.runs]
        answers, count = self.runs.ask(wanted, tuple(by)), len(problem.runs)
        return [answers[i : i + count] for i in range(0, len(answers), count)]

    def predicted(self, points: Sequence[Floats], by: Sequence[str] = ()) -> list[Floats]:
        """What the runs, differentiated `by` keys, say for each value at each point; NaN where unsolved."""
        found = self._answers(points, by)
        for one in (one for answers in found for one in answers if one.status != "done"):
            self.failed = one.message
        return [
            _numbers(answers[i].outputs.get(name) for i, name in self.problem.places) for answers in found
        ]

    def __call__(self, z: Floats) -> Floats:
        """(run - measured) / scale, (N,)."""
        residuals = self._residuals(*self.predicted([z], self.exact))
        if self.progress and not np.array_equal(z, self.told):  # the search asks for its start again
            self.told = z.copy()
            told = ", ".join(f"{k} {v:.5g}" for k, v in self.problem.parameters.values(z).items())
            size = math.sqrt(float(np.mean(residuals**2)))
            notices.tell(f"fit: {told}: rms residual {size:.4g}, {self.runs.computed} runs so far")
        return residuals

    def _residuals(self, predicted: Floats) -> Floats:
        return (predicted - self.problem.measured) / self.problem.scale

    def jacobian(self, z: Floats) -> Floats:
        """Derivatives of the residuals by the unknowns, (N, P)."""
        found = self._derivatives(z)
        self.exact = [name for name in self.exact if np.isfinite(found[name]).all()]
        rest = [i for i, name in enumerate(self.problem.parameters.names) if name not in self.exact]
        names = self.problem.parameters.names
        columns = np.column_stack([found.get(name, self.problem.scale) for name in names])
        if rest:
            columns[:, rest] = np.column_stack(self._differences(z, rest))
        return columns / self.problem.scale[:, None]

    def _derivatives(self, z: Floats) -> dict[str, Floats]:
        """Exact derivatives (N,) of what the runs say by the unknowns that have had them; NaN without."""
        problem, parameters = self.problem, self.problem.parameters
        if not self.exact:
            return {}
        (answers,), values, found = self._answers([z], self.exact), parameters.values(z), {}
        scenes = [parameters.applied(problem.tables, keys, values) for keys, _ in problem.runs]
        for name, u in zip(parameters.names, z.tolist(), strict=True):
            if name in self.exact:
                slopes = [parameters.free[name].slope(u, number_at(scene, name)) for scene in scenes]
                rates = (answers[i].outputs.get(derivative_of(each, name)) for i, each in problem.places)
                found[name] = np.array([slopes[i] for i, _ in problem.places]) * _numbers(rates)
        return found

    def _differences(self, z: Floats, which: Sequence[int]) -> list[Floats]:
        """Derivatives (N,) of what the runs say by some unknowns, by one-sided differences."""
        _, high = self.problem.parameters.bounds
        units = np.eye(len(z))
        steps = np.where(z + STEP <= high, STEP, -STEP)
        here, *there = self.predicted([z, *(z + steps[i] * units[i] for i in which)])
        columns = []
        for i, beside in zip(which, there, strict=True):
            step = steps[i]
            if not np.isfinite(beside).all():
                step, (beside,) = -step, self.predicted([z - step * units[i]])
            if not np.isfinite(beside).all():
                key, reason = self.problem.parameters.names[i], f"a scene that is not solved: {self.failed}"
                raise InputError(f"parameters.{key}", reason, "other bounds")
            columns.append((beside - here) / step)
        return columns

    def roughness(self, z: Floats, residuals: Floats, jacobian: Floats) -> list[str]:
        """A sentence for every unknown whose residuals change otherwise over `FAR` steps than over one."""
        low, high = self.problem.parameters.bounds
        up, down = (np.minimum(FAR * STEP, room) for room in (high - z, z - low))
        steps = np.where(high - z >= z - low, up, -down)
        ways = self.predicted([z + h * unit for h, unit in zip(steps, np.eye(len(z)), strict=True)])
        told = []
        for key, h, far, near in zip(self.problem.parameters.names, steps, ways, jacobian.T, strict=True):
            slope = (self._residuals(far) - residuals) / h
            size = max(np.linalg.norm(slope), np.linalg.norm(near))
            if size * abs(h) > NOISE * math.sqrt(len(z)) and np.linalg.norm(slope - near) > ROUGH * size:
                told.append(
                    f"what is compared is not smooth in {key}: over {FAR:g} steps of a difference it changes "
                    f"by {np.linalg.norm(slope):.2g} a unit, over one by {np.linalg.norm(near):.2g}; the fit "
                    "may end anywhere near, and its interval is no measure"
                )
        return told


def _numbers(values: Iterable[float | None]) -> Floats:
    return np.array(list(values), dtype=float)


def _solve(problem: _Problem, runs: Runs, progress: bool) -> FitResult:
    from scipy.optimize import least_squares

    residuals, parameters = _Residuals(problem, runs, progress), problem.parameters
    start, bounds = np.zeros(len(parameters.free)), parameters.bounds
    if not np.isfinite(residuals(start)).all():
        reason, _, allowed = residuals.failed.partition("; allowed: ")  # of a sentence of `InputError`
        raise InputError("scene", f"one that cannot be run at the start: {reason}", allowed or "one that can")
    ends = {"xtol": UNKNOWNS, "ftol": SQUARES, "gtol": 1e-12, "max_nfev": MOST_STEPS}
    found = least_squares(residuals, start, residuals.jacobian, bounds, **ends)
    known = confidence(found.jac, found.fun, parameters.names)
    warnings = [*([] if found.success else [f"not finished after {MOST_STEPS} steps"]), *known.warnings]
    warnings += residuals.roughness(found.x, found.fun, found.jac)
    patterns = _patterns(problem, found.fun)
    return FitResult(
        parameters=dict(parameters.free),
        values=parameters.values(found.x),
        unknowns=found.x,
        errors=known.errors,
        correlation=known.correlation,
        singular_values=known.singular_values,
        names=[name for one in problem.data for name in one.names],
        measured=problem.measured,
        predicted=problem.measured + found.fun * problem.scale,
        scale=problem.scale,
        warnings=(*warnings, *_at_bounds(parameters, found.x), *_misfit(problem, found.fun), *patterns),
        tables=problem.fitted(parameters.values(found.x)),
        paths=problem.paths,
        provenance={**problem.provenance, "runs": runs.computed, "finished": bool(found.success)},
    )


def _at_bounds(parameters: Parameters, z: Floats) -> list[str]:
    told = []
    for (key, one), u, low, high in zip(parameters.free.items(), z, *parameters.bounds, strict=True):
        near = AT_BOUND * (high - low)
        if min(u - low, high - u) < near:
            bound = one.low if u - low < near else one.high
            sticks = "; a finger that sticks feels no friction coefficient: see the column slip_share"
            more = sticks if key.startswith("surface.friction") else ""
            told.append(f"{key} is at its bound {bound:g}: its interval says nothing beyond it{more}")
    return told


def _patterns(problem: _Problem, residuals: Floats) -> Iterator[str]:
    """A warning for each curve whose residuals have too few runs of one sign to be errors (at 1 %)."""
    first = 0
    for one in problem.data:
        own, first = residuals[first : first + len(one.values)], first + len(one.values)
        if isinstance(one, MeasuredCurve) and np.abs(own).max() > TINY and few_runs(own) < PATTERN:
            runs = 1 + int(np.sum((own[1:] > 0.0) != (own[:-1] > 0.0)))
            yield (
                f"the {len(own)} residuals of {one.column} over {one.over} have {runs} runs of one sign, too "
                "few for errors of measurement: the scene has another shape, and intervals are too narrow"
            )


def _misfit(problem: _Problem, residuals: Floats) -> list[str]:
    """A warning if residuals are larger than the measured sd allow (chi-square test at 1 %)."""
    from scipy.stats import chi2

    if not problem.provenance["sd"]:
        return []
    freedom = len(residuals) - len(problem.parameters.free)
    ratio = float(residuals @ residuals) / freedom
    if ratio * freedom <= chi2.ppf(0.99, freedom):
        return []
    return [
        f"residuals are {math.sqrt(ratio):.2g} times the measured sd: the scene does not explain the data"
    ]

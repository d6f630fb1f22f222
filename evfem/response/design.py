"""Parameters of a scene that make a number of its run smallest, by scipy's L-BFGS-B with exact gradients.

Unknowns are the parameters over the distance of their bounds. A run that is not found, a scene that is
refused, or derivatives that end (a snap), end the search at the best run so far, and `told` says so.

Source: R. H. Byrd, P. Lu, J. Nocedal, C. Zhu, SIAM J. Sci. Comput. 16 (1995) 1190-1208,
doi:10.1137/0916069.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from evfem.common import notices
from evfem.common.arrays import Floats
from evfem.common.checks import real
from evfem.errors import InputError, NotConverged, describe_value, unknown
from evfem.response.lines import differentiable
from evfem.response.parameters import parameter_of, scene_of
from evfem.response.sensitivities import sensitivities
from evfem.scene.scene import Scene
from evfem.simulation.result import Result
from evfem.sweeps.file import check_output
from evfem.sweeps.run import output

#: most runs with their derivatives; relative change of the objective, and gradient in unknowns, that end it
MOST, SMALL, FLAT = 100, 1e-9, 1e-7
#: a parameter stays away from a bound of 0 by this fraction of its range, for steps are fractions of it
AWAY = 1e-4
#: why an objective cannot be followed
ROUGH = "the objective has no derivative: it is no number, or reads widths, areas or counts of a result"


@dataclass(frozen=True, eq=False)
class Design:
    """The best `parameters` by key, the `objective` there, its `scene` and `result`; `gradient` by key; the
    number of `runs`, and how it ended (`told`).
    """

    parameters: Mapping[str, float]
    objective: float
    scene: Scene
    result: Result
    gradient: Mapping[str, float]
    runs: int
    told: str

    def __repr__(self) -> str:
        """Objective and parameters."""
        values = ", ".join(f"{key} = {value:.6g}" for key, value in self.parameters.items())
        return f"Design after {self.runs} runs: objective {self.objective:.6g} at {values} ({self.told})"


class _Ends(Exception):
    """The search cannot go on."""


@dataclass
class _Search:
    """The objective and its gradient as functions of the unknowns (P,) from 0 to 1."""

    scene: Scene
    objective: Callable[[Result], float]
    keys: tuple[str, ...]
    bounds: Floats
    progress: bool
    best: Design | None = None
    runs: int = 0
    scale: float = 0.0

    def __call__(self, z: Floats) -> tuple[float, Floats]:
        scene, (low, high) = self.scene, self.bounds.T
        values = dict(zip(self.keys, (low + z * (high - low)).tolist(), strict=True))
        try:
            for key, value in values.items():
                one = parameter_of(scene, key)
                scene = one.applied(scene, value - one.value)
            found = sensitivities(scene, self.keys)
        except (InputError, NotConverged) as error:
            if self.best is None and isinstance(error, InputError):
                raise
            raise _Ends(str(error)) from None
        self.runs += 1
        value, slope = self._number(found.result), found.gradient(self._number)
        gradient = np.array([slope[key] for key in self.keys]) * (high - low)
        if not (np.isfinite(value) and np.isfinite(gradient).all()):
            raise _Ends("; ".join(filter(None, map(found.reasons.get, self.keys))) or ROUGH)
        if self.best is None or value < self.best.objective:
            self.best = Design(values, value, scene, found.result, slope, self.runs, "")
        if self.progress:
            notices.tell(f"design: run {self.runs}, objective {value:.6g}")
        self.scale = self.scale or abs(value) or 1.0
        return value / self.scale, gradient / self.scale

    def _number(self, result: Result) -> float:
        """The objective of a result; InputError where it is no number."""
        value = self.objective(result)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise InputError("objective", f"one that gives {describe_value(value)}", "a number") from None


def design(
    scene: Scene | Result | str | PathLike[str],
    objective: Callable[[Result], float] | str,
    parameters: Sequence[str],
    bounds: Mapping[str, Sequence[float]] | Sequence[Sequence[float]],
    progress: bool = False,
) -> Design:
    """The parameters within bounds that make a number of a scene's run smallest.

    Parameters
    ----------
    scene
        A `Scene`, the path of a scene file, or a result; its own parameters are the start.
    objective
        A smooth function from the columns of a `Result` to a number, or COLUMN.STATISTIC[.MOTION] as the
        outputs of a sweep, with a minus before it to make that largest. Widths, areas, counts, frames and
        probes have no derivatives.
    parameters
        Dotted keys of the scene.
    bounds
        {key: (low, high)}, or the pairs in the order of the keys. Steps are fractions of a parameter: a bound
        of 0 is kept off by 1e-4 of the range.
    progress
        Print a line per run.

    Returns
    -------
    Design
        `parameters`, `objective`, `scene` and `result` of the best run.

    Raises
    ------
    InputError
        What is no parameter, or starts out of its bounds, or a start that has no derivatives.

    Examples
    --------
    >>> from evfem import Display, FingerPad, Hover, Kaczmarek
    >>> pad = FingerPad(ridges=False, resolution="coarse")
    >>> scene = Scene(pad, Display(), Kaczmarek(), 500.0, Hover(gap=0.3, steps=1))
    >>> wanted = lambda run: (1e4 * run.electrostatic_force[0] - 0.5) ** 2
    >>> found = design(scene, wanted, ["electrostatics.voltage"], [(100.0, 1000.0)])
    >>> round(1e4 * float(found.result.electrostatic_force[0]), 4)
    0.5
    """
    from scipy.optimize import minimize

    scene = scene_of(scene)
    keys = (parameters,) if isinstance(parameters, str) else tuple(parameters)
    limits = _bounds(scene, keys, bounds)
    search = _Search(scene, _objective(scene, objective), keys, limits, progress)
    start = np.array([parameter_of(scene, key).value for key in keys])
    z = (start - limits[:, 0]) / np.diff(limits, axis=1)[:, 0]
    options = {"maxfun": MOST, "ftol": SMALL, "gtol": FLAT}
    try:
        ended = minimize(
            search, z, jac=True, method="L-BFGS-B", bounds=[(0.0, 1.0)] * len(z), options=options
        )
        told = str(ended.message).lower()
    except _Ends as reason:
        told = f"ended early: {reason}"
    if (best := search.best) is None:
        raise InputError("scene", told, "a start whose run has derivatives")
    return Design(best.parameters, best.objective, best.scene, best.result, best.gradient, search.runs, told)


def _bounds(scene: Scene, keys: tuple[str, ...], bounds: Any) -> Floats:
    """Bounds (P, 2) of the keys, the start within."""
    if not keys:
        raise InputError("parameters", "none", "at least one dotted key of the scene")
    if isinstance(bounds, Mapping) and (more := [key for key in bounds if key not in keys]):
        raise unknown("bounds", str(more[0]), keys)
    pairs: list[Any] = [bounds.get(key) for key in keys] if isinstance(bounds, Mapping) else list(bounds)
    if len(pairs) != len(keys):
        raise InputError("bounds", f"{len(pairs)} for {len(keys)} parameters", "a pair (low, high) for each")
    return np.array([_pair(scene, key, pair) for key, pair in zip(keys, pairs, strict=True)])


def _pair(scene: Scene, key: str, pair: Any) -> list[float]:
    """Bounds of a key around its value, none of them 0."""
    value = parameter_of(scene, key).value
    allowed = f"(low, high), two numbers around {value:g}, that of the scene"
    try:
        low, high = (real(f"bounds.{key}", float(one), allowed) for one in pair if not isinstance(one, str))
    except (TypeError, ValueError):
        raise InputError(f"bounds.{key}", describe_value(pair), allowed) from None
    if not low <= value <= high or low == high:
        raise InputError(f"bounds.{key}", describe_value(pair), allowed)
    away = min(AWAY * (high - low), abs(value))
    return [low or away, high or -away]


def _objective(scene: Scene, objective: Any) -> Callable[[Result], float]:
    """The objective as a function."""
    if callable(objective):
        return objective
    if not isinstance(objective, str):
        raise InputError(
            "objective", describe_value(objective), "a function of a result, or COLUMN.STATISTIC[.MOTION]"
        )
    sign, name = (-1.0, objective[1:]) if objective.startswith("-") else (1.0, objective)
    check_output(name, len(scene.motion))
    if not differentiable(name.split(".")[0]):
        raise InputError("objective", name, "a column that has derivatives: no width, area or count")

    def number(result: Result) -> float:
        found = output(result, name)
        return math.nan if found is None else sign * found

    return number

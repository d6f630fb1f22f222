r"""First-order uncertainty of a run from that of its parameters.

Parameters with standard deviations :math:`\sigma_k` and correlation :math:`\rho_{kl}`, which is 0 between
independent ones, give a column F the standard deviation

.. math:: \sigma_F^2 = \sum_{k, l} c_k\,\rho_{kl}\,c_l, \qquad c_k = \frac{dF}{dp_k}\,\sigma_k

(JCGM 100:2008, Guide to the expression of uncertainty in measurement, equation 13). That is the first term of
a series. One run with the most important parameter changed by its standard deviation says how much of it is
true there (`Check`). Samples (`evfem.sweeps.samples`) know no such limit, and need hundreds of runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import Any, NamedTuple

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Within, real
from evfem.errors import InputError, describe_value
from evfem.response.lines import differentiable
from evfem.response.parameters import parameter_of, scene_of
from evfem.response.sensitivities import Sensitivities, sensitivities
from evfem.scene.scene import Scene
from evfem.simulation.history import no_column
from evfem.simulation.result import Result
from evfem.simulation.run import simulate

#: by how much the entries of a correlation may be rounded
ROUNDED = 1e-6
#: fraction by which a run may be off its derivative before that is told
BENT = 0.2


class Check(NamedTuple):
    """Change of a column's last value with one parameter larger by its standard deviation: by its derivative
    and by a run; in the column's unit.
    """

    key: str
    column: str
    by_derivative: float
    by_run: float


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Standard deviations `sd[column]` (steps,) of a run, `contribution[column, key]` (steps,) of each
    parameter with its sign, and the `checked` contribution. Squares of contributions add up to those of `sd`
    where the parameters are independent. Columns `told` are printed.
    """

    result: Result
    sd: Mapping[str, Floats]
    contribution: Mapping[tuple[str, str], Floats]
    checked: Check
    found: Sensitivities
    told: tuple[str, ...] = ("normal_force", "tangential_force", "electrostatic_force")

    def effects(self, column: str, step: int = -1) -> tuple[dict[str, float], str]:
        """The contribution of every parameter to a column at a step, counted from 0, and what it is."""
        if column not in self.sd:
            raise no_column("column", column, tuple(self.sd))
        found = {key: float(self.contribution[column, key][step]) for key in self.found.parameters}
        return found, f"{column} for one sd ({self.result.units[column]})"

    def __repr__(self) -> str:
        """The check, and the standard deviations of the forces, or of what was asked for, at the end."""
        one = self.checked
        derived = "no derivative" if np.isnan(one.by_derivative) else f"{one.by_derivative:.4g} by derivative"
        lines = [
            f"Uncertainty of {len(self.result.step)} steps to first order; check of linearity: "
            f"+1 sd of {one.key} changes {one.column} at the end by {one.by_run:.4g} in a run ({derived})"
        ]
        lines += [f"  {key}: {self.found.reasons[key]}" for key in self.found.missing]
        if not abs(one.by_run - one.by_derivative) <= BENT * max(abs(one.by_run), abs(one.by_derivative)):
            lines.append("  not linear over one sd: take samples, as a sweep does")
        for name in self.told:
            if name in self.sd:
                found, unit = self.result[name][-1], self.result.units[name]
                lines.append(f"  {name}: {found:.6g} +- {self.sd[name][-1]:.2g} {unit}")
        return "\n".join(lines)


def uncertainty(
    scene: Scene | Result | str | PathLike[str],
    sd: Mapping[str, float],
    columns: Sequence[str] | None = None,
    progress: bool = False,
    correlation: Floats | Sequence[Sequence[float]] | None = None,
) -> Uncertainty:
    """Standard deviations of the history of a scene from those of its parameters, to first order.

    Parameters
    ----------
    scene
        A `Scene`, the path of a scene file, or a result, whose scene is run again.
    sd
        {dotted key of the scene: standard deviation of its number}.
    columns
        Columns of the history; None: all that have derivatives.
    progress
        Show a progress bar.
    correlation
        (P, P) of the parameters in the order of `sd`, as a fit has it: `uncertainty(fit.scene, fit.sd,
        correlation=fit.correlation)`. None: they are independent.

    Returns
    -------
    Uncertainty
        `sd[column]` and `contribution[column, key]`, one value a step, and what a run with the most important
        parameter changed says (`checked`).

    Raises
    ------
    InputError
        A parameter or a column that has no derivative, a standard deviation that is not above 0, or a matrix
        that is no correlation.

    Examples
    --------
    >>> from evfem import Display, FingerPad, Hover, Kaczmarek
    >>> pad = FingerPad(ridges=False, resolution="coarse")
    >>> scene = Scene(pad, Display(), Kaczmarek(), 100.0, Hover(gap=0.3, steps=1))
    >>> found = uncertainty(scene, {"electrostatics.voltage": 5.0}, ["electrostatic_force"])
    >>> round(float(found.sd["electrostatic_force"][0] / found.result.electrostatic_force[0]), 3)
    0.1
    """
    scene = scene_of(scene)
    if not isinstance(sd, Mapping) or not sd:
        raise InputError("sd", describe_value(sd), "{key of the scene: standard deviation}")
    for key, value in sd.items():
        real(f"sd.{key}", value, "a standard deviation larger than 0", Within(0.0, 1e12, above=True))
    together = _correlation(correlation, len(sd))
    found = sensitivities(scene, list(sd), columns, progress)
    names = [name for name in found.columns if differentiable(name)]
    if columns is not None and (rough := [name for name in found.columns if name not in names]):
        raise InputError(
            "columns", ", ".join(rough), "columns that have derivatives: no width, area or count"
        )
    parts = {(name, key): found[name, key] * float(sd[key]) for name in names for key in sd}
    total = {name: _total(np.array([parts[name, key] for key in sd]), together) for name in names}
    checked = _checked(scene, sd, parts, found, names)
    more = {} if columns is None else {"told": tuple(names)}
    return Uncertainty(found.result, total, parts, checked, found, **more)


def _total(parts: Floats, correlation: Floats) -> Floats:
    """The standard deviation (steps,) that contributions (P, steps) make together.

    >>> _total(np.array([[3.0, 3.0], [4.0, -3.0]]), np.array([[1.0, 1.0], [1.0, 1.0]])).tolist()
    [7.0, 0.0]
    """
    return np.sqrt(np.maximum(np.einsum("ks,kl,ls->s", parts, correlation, parts), 0.0))


def _correlation(given: Any, size: int) -> Floats:
    """A matrix of correlation (size, size); InputError for any other."""
    found = np.eye(size) if given is None else np.asarray(given, dtype=float)
    allowed = f"a symmetric matrix ({size}, {size}) of numbers from -1 to 1, with 1 on its diagonal"
    if found.shape != (size, size) or not np.isfinite(found).all():
        problem = f"one of shape {found.shape}" if found.shape != (size, size) else "nan"
        raise InputError("correlation", problem, allowed)
    symmetric = np.allclose(found, found.T, rtol=0.0, atol=ROUNDED) and np.allclose(np.diag(found), 1.0)
    if not symmetric or np.linalg.eigvalsh(found).min() < -ROUNDED * size:
        raise InputError("correlation", found.tolist(), f"{allowed}, that some parameters can have")
    return found


def _checked(
    scene: Scene, sd: Mapping[str, float], parts: Any, found: Sensitivities, names: list[str]
) -> Check:
    """The largest contribution to the end of the first force among the columns, and what a run says of it."""
    column = next((name for name in names if name.endswith("_force")), names[0])
    sizes = {key: abs(float(parts[column, key][-1])) for key in sd}
    key = max(sizes, key=lambda one: np.nan_to_num(sizes[one], nan=-1.0))
    changed = simulate(parameter_of(scene, key).applied(scene, float(sd[key])))
    by_run = float(changed[column][-1] - found.result[column][-1])
    return Check(key, column, float(parts[column, key][-1]), by_run)

r"""First-order uncertainty of a run from that of its parameters.

Independent parameters with standard deviations :math:`\sigma_k` give a column F the standard deviation

.. math:: \sigma_F^2 = \sum_k c_k^2, \qquad c_k = \frac{dF}{dp_k}\,\sigma_k .

That is the first term of a series. One run with the most important parameter changed by its standard
deviation says how much of it is true there (`Check`). Samples (`evfem.sweeps.samples`) know no such limit,
and need hundreds of runs.
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
    parameter with its sign, whose squares add up to those of `sd`, and the `checked` contribution.
    """

    result: Result
    sd: Mapping[str, Floats]
    contribution: Mapping[tuple[str, str], Floats]
    checked: Check
    found: Sensitivities

    def effects(self, column: str, step: int = -1) -> tuple[dict[str, float], str]:
        """The contribution of every parameter to a column at a step, counted from 0, and what it is."""
        if column not in self.sd:
            raise no_column("column", column, tuple(self.sd))
        found = {key: float(self.contribution[column, key][step]) for key in self.found.parameters}
        return found, f"{column} for one sd ({self.result.units[column]})"

    def __repr__(self) -> str:
        """The check, and the standard deviations of the forces at the end."""
        one = self.checked
        derived = f"{one.by_derivative:.4g} by its derivative"
        lines = [
            f"Uncertainty of {len(self.result.step)} steps to first order; check of linearity: "
            f"{one.key} larger by its sd changes {one.column} at the end by {one.by_run:.4g} in a run, "
            f"{'no derivative is there' if np.isnan(one.by_derivative) else derived}"
        ]
        lines += [f"  {key}: {self.found.reasons[key]}" for key in self.found.missing]
        for name in ("normal_force", "tangential_force", "electrostatic_force"):
            if name in self.sd:
                lines.append(f"  {name}: {self.result[name][-1]:.6g} +- {self.sd[name][-1]:.2g}")
        return "\n".join(lines)


def uncertainty(
    scene: Scene | Result | str | PathLike[str],
    sd: Mapping[str, float],
    columns: Sequence[str] | None = None,
    progress: bool = False,
) -> Uncertainty:
    """Standard deviations of the history of a scene from those of independent parameters, to first order.

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

    Returns
    -------
    Uncertainty
        `sd[column]` and `contribution[column, key]`, one value a step, and what a run with the most important
        parameter changed says (`checked`).

    Raises
    ------
    InputError
        A parameter that has no derivative, or a standard deviation that is not above 0.

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
    found = sensitivities(scene, list(sd), columns, progress)
    names = [name for name in found.columns if differentiable(name)]
    if not names:
        raise InputError("columns", describe_value(columns), "at least one column that has derivatives")
    parts = {(name, key): found[name, key] * float(sd[key]) for name in names for key in sd}
    total = {name: np.sqrt(sum(parts[name, key] ** 2 for key in sd)) for name in names}
    return Uncertainty(found.result, total, parts, _checked(scene, sd, parts, found, names), found)


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

r"""The mean of a column of the history over rows that stand apart unevenly.

Rows are ends of steps, as many as the scene asks for: their plain average depends on where they lie.
The mean of a column c is over the time t where time passes, else over the way s of the bone,

.. math:: \bar c = \sum_i \tfrac12 (c_{i-1} + c_i) \, \Delta_i \Big/ \sum_i \Delta_i,
   \qquad \Delta_i = t_i - t_{i-1} \;\text{or}\; |\vec s_i - \vec s_{i-1}| ,

with the column linear within each step, as the trapezoidal rule has it (error of second order in the steps).
The state before the first step of a run is in no row: that step counts with its end. A ramp of the voltage
is no way, and alone it counts by its equal steps; so do columns that count something of each step. Columns
that are means over each step, the supply of a drive resolved in time, count as such, and steps at whose ends
a column is no number do not count.
"""

from __future__ import annotations

import math

import numpy as np

from evfem.circuit.load import STEP_MEANS
from evfem.common.arrays import Floats
from evfem.simulation.history import INTEGERS, SAME
from evfem.simulation.result import Result

#: columns that belong to a step as a whole
PER_STEP = (*INTEGERS, "seconds")


def chosen(result: Result, motion: int | None) -> np.ndarray:
    """Which rows (N,) belong to a motion; all for None."""
    return np.full(len(result.step), True) if motion is None else result.motion_index == motion


def mean(result: Result, column: str, motion: int | None = None) -> tuple[float, str]:
    """The mean of a column over the run or one motion of it, and what it is over: time, path or steps.

    Raises InputError for a name that is no column.
    """
    values, rows = np.asarray(getattr(result, column), dtype=float), chosen(result, motion)
    weights, over = (np.ones(len(values)), "steps") if column in PER_STEP else weighed(result, rows)
    whole_step = over == "steps" or (column in STEP_MEANS and "source_work" in result.columns)
    before = values if whole_step else np.append(values[:1], values[:-1])
    each = 0.5 * (before + values)
    known = rows & np.isfinite(each) & (weights > 0.0)
    return float(np.average(each[known], weights=weights[known])) if known.any() else math.nan, over


def weighed(result: Result, rows: np.ndarray) -> tuple[Floats, str]:
    """The weight (N,) of each step, and whether it is its time, its way, or the same for all `rows`."""
    seconds = np.diff(result.time, prepend=0.0)
    if seconds[rows].sum() > 0.0:
        return seconds, "time"
    bone = np.column_stack([result.position, result.position_z, result.indentation])
    way = np.linalg.norm(np.diff(bone, axis=0, prepend=0.0), axis=1)
    way = np.where(np.asarray(result.motion) == "voltage", 0.0, way)
    return (way, "path") if way[rows].sum() > SAME else (np.ones(len(way)), "steps")

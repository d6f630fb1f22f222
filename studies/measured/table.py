"""A measurement of others beside its prediction, and what belongs to both: conditions, errors, objections."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Row:
    """One measured number beside the predicted one.

    `error` is the relative standard error of the prediction (the deviation of its logarithm): mesh, steps,
    and what was assumed, to first order. `low` and `high` are the ends of the measured scatter; nan where
    the source states none. `law`: "strong_troxel", "kaczmarek" or "" where both have the same.
    """

    name: str
    what: str
    unit: str
    predicted: float
    error: float
    measured: float
    low: float = np.nan
    high: float = np.nan
    law: str = ""

    @property
    def ratio(self) -> float:
        """Predicted over measured."""
        return self.predicted / self.measured


@dataclass(frozen=True)
class Sign:
    """A measured direction beside a predicted change (1: doubled), where no number is published to us."""

    name: str
    what: str
    predicted: float
    error: float
    measured: str


@dataclass(frozen=True)
class Experiment:
    """What one publication measured, and what is said of all its rows.

    `read`: what of the source was read. `doi` is a bare one.
    """

    title: str
    source: str
    doi: str
    read: str
    conditions: str
    assumed: str
    fitted: str
    reason: str
    sceptic: str
    answer: str
    rows: tuple[Row, ...] = ()
    signs: tuple[Sign, ...] = ()

    def told(self) -> dict[str, Any]:
        """The words, and the names of the rows, for the file of the study."""
        words = {key: value for key, value in asdict(self).items() if isinstance(value, str)}
        rows = [{"name": one.name, "what": one.what, "unit": one.unit, "law": one.law} for one in self.rows]
        signs = [{"name": one.name, "what": one.what, "measured": one.measured} for one in self.signs]
        return words | {"rows": rows, "signs": signs}


def numbers_of(experiments: Iterable[Experiment]) -> dict[str, float]:
    """`ROW.predicted`, `ROW.predicted_error` (in the row's unit), `ROW.measured`, `ROW.ratio` and, where the
    source states it, the scatter `ROW.measured_low` and `ROW.measured_high`.
    """
    found: dict[str, float] = {}
    for experiment in experiments:
        for row in experiment.rows:
            values = {"predicted": row.predicted, "predicted_error": row.error * row.predicted}
            values |= {"measured": row.measured, "ratio": row.ratio}
            if np.isfinite(row.low):
                values |= {"measured_low": row.low, "measured_high": row.high}
            found |= {f"{row.name}.{key}": value for key, value in values.items()}
        for sign in experiment.signs:
            found |= {f"{sign.name}.predicted": sign.predicted, f"{sign.name}.predicted_error": sign.error}
    return found


def spread(values: Iterable[float]) -> float:
    """Largest relative difference of the values from the last one, that of the finest mesh.

    >>> round(spread([1.1, 0.98, 1.0]), 3)
    0.1
    """
    *others, last = values
    return max((abs(one / last - 1.0) for one in others), default=0.0)


def together(*errors: float) -> float:
    """Independent relative errors in one.

    >>> round(together(0.03, 0.04), 3)
    0.05
    """
    return float(np.hypot.reduce(errors))

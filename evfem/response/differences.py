"""Central differences of fourth order of numbers, arrays, states and energy balances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import is_dataclass, replace
from typing import Any

import numpy as np

from evfem.newton.state import State

#: the samples in steps from the centre, and their weights
SAMPLES, WEIGHTS = (-2, -1, 1, 2), np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
#: derivatives of states and energy balances, by their fields
Change = dict[str, Any]


def difference(values: Sequence[Any], step: float) -> Any:
    """Derivative of numbers or arrays from values at the `SAMPLES`, a `step` apart.

    >>> round(float(difference([np.exp(0.01 * k) for k in SAMPLES], 0.01)), 8)
    1.0
    """
    return sum(weight * np.asarray(value) for weight, value in zip(WEIGHTS, values, strict=True)) / step


def changes(owners: Sequence[Any], step: float) -> Any:
    """Central difference (4th order) of arrays, or of every real field of a state or energy balance, over
    samples at -2, -1, 1, 2 steps.
    """
    if not is_dataclass(owners[0]):
        return difference(owners, step)
    each = [parts_of(one) for one in owners]
    real = [name for name, value in each[0].items() if np.asarray(value).dtype.kind == "f"]
    return {name: difference([one[name] for one in each], step) for name in real}


def parts_of(owner: Any) -> dict[str, Any]:
    """Fields of a state, or of an energy balance, by name."""
    return owner.parts if isinstance(owner, State) else vars(owner)


def added(first: Change, second: Change) -> Change:
    """The sum of two derivatives."""
    return {name: value + second[name] for name, value in first.items()}


def moved(owner: Any, change: Change, way: float) -> Any:
    """A state, or an energy balance, displaced along a derivative."""
    parts = parts_of(owner)
    further = {name: parts[name] + way * value for name, value in change.items()}
    return owner.with_parts(further) if isinstance(owner, State) else replace(owner, **further)

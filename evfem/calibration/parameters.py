"""Free parameters of a fit: keys of a scene with bounds, and the unknowns of the optimiser.

The unknown of a parameter that is positive between its bounds is z = ln(v / start): a fit takes steps by
factors, and the value cannot become negative. Any other parameter has z = (v - start) / (high - low).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice, real, set_frozen
from evfem.errors import InputError
from evfem.scene.keys import shown
from evfem.sweeps.file import check_key, put_in


@dataclass(frozen=True)
class Parameter:
    """A number that a fit may choose between `low` and `high`, from `start` on.

    Without a start it begins in the middle: that of the logarithms for a parameter that is positive, else
    that of the numbers. `apply` says what it does to its key: value replaces the number of the scene, factor
    multiplies it, offset is added to it (as an unknown error of a gap that was set).

    >>> Parameter(0.01, 1.0).start
    0.1
    >>> Parameter(-0.1, 0.1, apply="offset").start
    0.0
    """

    low: float
    high: float
    start: float | None = None
    apply: str = "value"

    def __post_init__(self) -> None:
        low = real("parameters.low", self.low, "a finite number")
        high = real("parameters.high", self.high, f"a number above {low:g}", lambda number: number > low)
        choice("parameters.apply", self.apply, ("value", "factor", "offset"))
        set_frozen(self, low=low, high=high)
        middle = math.sqrt(low * high) if self.logarithmic else 0.5 * (low + high)
        start, allowed = middle if self.start is None else self.start, f"a number from {low:g} to {high:g}"
        set_frozen(self, start=real("parameters.start", start, allowed, lambda v: low <= v <= high))

    @property
    def logarithmic(self) -> bool:
        """Whether its unknown is a logarithm."""
        return self.low > 0.0

    def unknown(self, value: float) -> float:
        """The unknown z of a value."""
        assert self.start is not None
        if self.logarithmic:
            return math.log(value / self.start)
        return (value - self.start) / (self.high - self.low)

    def slope(self, unknown: float, present: float) -> float:
        """Derivative of the number `present` that a scene has for it by its unknown z."""
        value = float(self.value(unknown))
        rate = value if self.logarithmic else self.high - self.low
        return present / value * rate if self.apply == "factor" else rate

    def value(self, unknown: Any) -> Any:
        """The value of an unknown z, numbers or arrays."""
        if self.logarithmic:
            with np.errstate(over="ignore"):
                return self.start * np.exp(unknown)
        return self.start + unknown * (self.high - self.low)


Given = Parameter | Sequence[float]


@dataclass(frozen=True)
class Parameters:
    """All free parameters by their keys."""

    free: Mapping[str, Parameter]

    @classmethod
    def of(cls, entry: Any) -> Parameters:
        """Parameters from {key: Parameter, or (low, high)}."""
        allowed = "{key: (low, high)} or {key: Parameter(low, high)} for one key of the scene or more"
        if not isinstance(entry, Mapping) or not entry:
            raise InputError("parameters", shown(entry), allowed)
        free = {}
        for key, one in entry.items():
            check_key(f"parameters.{key}", str(key))
            pair = isinstance(one, Sequence) and not isinstance(one, str) and len(one) == 2
            if not (pair or isinstance(one, Parameter)):
                raise InputError(f"parameters.{key}", shown(one), allowed)
            free[str(key)] = one if isinstance(one, Parameter) else Parameter(*one)
        return cls(free)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self.free)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest unknowns, (P,) each."""
        free = self.free.values()
        low, high = ([one.unknown(getattr(one, end)) for one in free] for end in ("low", "high"))
        return np.array(low), np.array(high)

    def values(self, z: Floats) -> dict[str, float]:
        """The values of the unknowns (P,), by key, never beyond their bounds by rounding."""
        return {
            key: min(max(float(one.value(u)), one.low), one.high)
            for (key, one), u in zip(self.free.items(), z, strict=True)
        }

    def applied(
        self, tables: Mapping[str, Any], where: Mapping[str, Any], values: Mapping[str, float]
    ) -> Any:
        """The tables of a scene with the keys `where`, and then the parameters, put in."""
        changed = deepcopy(dict(tables))
        for key, setting in where.items():
            if key in self.free and self.free[key].apply == "value":
                allowed = 'a key that is not measured at several values, or apply = "factor" or "offset"'
                raise InputError(f"parameters.{key}", "a key that the data set", allowed)
            put_in(changed, key, setting)
        for key, parameter in self.free.items():
            value = values[key]
            if parameter.apply != "value":
                present = number_at(changed, key)
                value = present * value if parameter.apply == "factor" else present + value
            put_in(changed, key, value)
        return changed


def number_at(tables: Any, key: str) -> float:
    """The number that the scene has under a dotted key."""
    here = tables
    try:
        for name in key.split("."):
            here = here[int(name) if isinstance(here, list) else name]
    except (KeyError, IndexError, TypeError, ValueError):
        here = None
    if isinstance(here, bool) or not isinstance(here, (int, float)):
        entry = "no number there" if here is None else shown(here)
        raise InputError(f"parameters.{key}", entry, "a number in the scene, for a factor or an offset")
    return float(here)

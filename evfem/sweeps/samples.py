"""Random parameters: distributions, and samples of them drawn at random or as a latin hypercube.

Every parameter has a random stream of its own, made of the seed and its name: the values of one do not change
when another is added or moved. Drawn at random, a longer sample begins with the shorter one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from statistics import NormalDist
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import SEED, Checked, one_of, real, set_frozen, whole
from evfem.errors import ABSENT, InputError, describe_value

METHODS = ("latin_hypercube", "random")
MOST_SAMPLES = 100_000


@dataclass(frozen=True)
class Uniform:
    """Every value from `low` to `high` is as likely as any other.

    >>> Uniform(1.0, 3.0).quantile(np.array([0.0, 0.5]))
    array([1., 2.])
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        set_frozen(self, low=_number("uniform", self.low), high=_number("uniform", self.high))
        if not self.low < self.high:
            raise InputError("uniform", f"{self.low:g} to {self.high:g}", "two numbers, the lower one first")

    def quantile(self, probability: Floats) -> Floats:
        """The value below which lies that fraction (0 to 1) of the probability."""
        return self.low + probability * (self.high - self.low)


@dataclass(frozen=True)
class Normal:
    """A normal distribution of this mean and standard deviation, cut off outside `between`.

    >>> Normal(0.3, 0.1, between=(0.0, 0.6)).quantile(np.array([0.0, 0.5, 1.0])).round(12)
    array([0. , 0.3, 0.6])
    """

    mean: float
    sd: float
    between: tuple[float, float] | None = field(default=None)

    def __post_init__(self) -> None:
        set_frozen(self, mean=_number("normal", self.mean), sd=_number("normal", self.sd))
        if not self.sd > 0.0:
            raise InputError(
                "normal", describe_value(self.sd), "a mean and a standard deviation larger than 0"
            )
        if self.between is None:
            return
        low, high = (_number("between", value) for value in self.between)
        set_frozen(self, between=(low, high))
        if not (low < high and low < self.mean + 6.0 * self.sd and high > self.mean - 6.0 * self.sd):
            allowed = "two numbers, the lower one first, within six standard deviations of the mean"
            raise InputError("between", f"{low:g} to {high:g}", allowed)

    def quantile(self, probability: Floats) -> Floats:
        """The value below which lies that fraction (0 to 1) of the probability."""
        normal = NormalDist(self.mean, self.sd)
        low, high = self.between or (-math.inf, math.inf)
        below, inside = normal.cdf(low), normal.cdf(high) - normal.cdf(low)
        tiny = 2.0**-53  # the tails of what cannot be told from 0 and 1
        values = [
            normal.inv_cdf(min(max(below + u * inside, tiny), 1.0 - tiny)) for u in probability.tolist()
        ]
        return np.clip(values, low, high)


Distribution = Uniform | Normal


def _parameters(key: str, entry: Any) -> dict[str, Distribution]:
    if not isinstance(entry, Mapping) or not entry:
        said = describe_value(entry) if entry else ABSENT
        raise InputError(key, said, "at least one parameter with a distribution")
    for name, distribution in entry.items():
        if not isinstance(distribution, Distribution):
            raise InputError(f"{key}.{name}", describe_value(distribution), "Uniform or Normal")
    return dict(entry)


_PARAMETERS = {"allowed": "a table [samples.parameters] of distributions", "check": _parameters}


@dataclass(frozen=True)
class Samples(Checked):
    """Values of every parameter, independent of each other.

    A latin hypercube (McKay, Beckman and Conover 1979, doi:10.2307/1268522) puts exactly one value of each
    parameter into each of `count` equally likely intervals; random draws them freely.

    >>> sample = Samples({"surface.friction": Uniform(0.0, 1.0)}, count=4, seed=1)
    >>> np.sort(np.floor(4 * sample.draw()["surface.friction"]))
    array([0., 1., 2., 3.])
    """

    parameters: Annotated[Mapping[str, Distribution], _PARAMETERS, "a distribution for each key"]
    count: Annotated[int, whole(MOST_SAMPLES), "number of samples"]
    seed: Annotated[int, SEED, "the same seed gives the same samples"]
    method: Annotated[str, one_of(*METHODS), "how they are drawn"] = METHODS[0]
    _table = "samples."

    def draw(self) -> dict[str, Floats]:
        """The values of every parameter, (count,) each, in the order of `parameters`."""
        return {name: one.quantile(self._shares(name)) for name, one in self.parameters.items()}

    def _shares(self, name: str) -> Floats:
        # scipy.stats.qmc draws all parameters from one stream, is no shorter, and takes half a second to load
        random = np.random.default_rng([self.seed, *name.encode()])
        if self.method == "random":
            return random.random(self.count)
        return (random.permutation(self.count) + random.random(self.count)) / self.count


def _number(key: str, value: object) -> float:
    return real(key, value, "a finite number")

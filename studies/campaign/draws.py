"""Random numbers as scenes need them: a generator with a few distributions."""

from __future__ import annotations

from typing import Any

import numpy as np

#: of the generator itself: another one draws other scenes
GENERATOR = 2


class Draw:
    """Random numbers of one scene: the same for the same seed, number and `further` ones."""

    def __init__(self, seed: int, number: int, *further: int) -> None:
        self._random = np.random.default_rng([GENERATOR, seed, number, *further])

    def chance(self, probability: float) -> bool:
        """True with that probability."""
        return bool(self._random.random() < probability)

    def between(self, low: float, high: float) -> float:
        """Evenly between two numbers, with six digits."""
        return six_digits(self._random.uniform(low, high))

    def spread(self, low: float, high: float) -> float:
        """Evenly on a logarithmic scale between two positive numbers, with six digits."""
        return six_digits(np.exp(self._random.uniform(np.log(low), np.log(high))))

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included; small ones are as likely as large ones."""
        return int(np.clip(np.rint(self.spread(max(low, 1) - 0.49, high + 0.49)), low, high))

    def sign(self) -> float:
        """1 or -1."""
        return 1.0 if self.chance(0.5) else -1.0

    def one_of(self, *choices: Any) -> Any:
        """One of the choices, each as likely."""
        return choices[int(self._random.integers(len(choices)))]

    def places(self, count: int, low: float, high: float) -> list[float]:
        """Increasing positions, with six digits."""
        return sorted(map(six_digits, self._random.uniform(low, high, count)))


def six_digits(value: float) -> float:
    """The number that stands in the file."""
    return float(f"{value:.6g}")

r"""Which places of an outline the display sees: at them stand the columns of the full field.

Between two neighbours one of which stands above the other, or nearly so (steeper than `STEEP`), the
higher one is behind an overhang, or deep in a groove, and has no column.

When a place comes into sight or goes out of it, the field is that of one column more or less, and its
forces jump by a little. Where the equilibrium with the column would be without it, and that without it
would have it, there is none, and iterations go to and fro for ever. So a step whose choice of places has
come back to an earlier one `RETURNS` times keeps the present one to its end, as long as its columns
are not steeper than `WORN` times that: both choices are discretisations of one field. The next step
chooses anew.
"""

from __future__ import annotations

import numpy as np

from evfem.common.arrays import Floats, Ints

#: columns follow an outline up to this slope
STEEP = 6.0
#: how much steeper those of a kept choice may become
WORN = 2.0
#: how often an earlier choice comes back before the present one is kept
RETURNS = 2


def no_steeper(places: Floats, slope: float) -> bool:
    """Whether places (L, 2) stand from left to right, and no two neighbours are steeper than this.

    >>> [no_steeper(np.array([[0.0, 0.0], [1.0, rise]]), 6.0) for rise in (3.0, 7.0)]
    [True, False]
    """
    apart, rise = np.diff(places, axis=0).T
    return bool(np.all(apart > 0.0) and np.all(apart >= np.abs(rise) / slope))


def in_sight(places: Floats) -> Ints:
    """Which of the places (L, 2) of an outline, from left to right, are seen from below (K,).

    >>> in_sight(np.array([[0.0, 0.0], [1.0, 0.0], [0.9, 0.5], [2.0, 0.0]])).tolist()
    [0, 1, 3]
    """
    if no_steeper(places, STEEP):
        return np.arange(len(places))
    x, y = places.T.tolist()
    kept: list[int] = []
    for k in range(len(x)):
        while kept and x[k] - x[kept[-1]] < (y[kept[-1]] - y[k]) / STEEP and y[k] < y[kept[-1]]:
            kept.pop()
        if not kept or x[k] - x[kept[-1]] > max(0.0, (y[k] - y[kept[-1]]) / STEEP):
            kept.append(k)
    return np.array(kept)


class Sight:
    """The choice of places during a step, and those before it."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """A step begins: every choice is free."""
        self.kept: Ints | None = None
        self._last, self._before, self._returns = b"", set[bytes](), 0

    def watch(self, places: Floats) -> bool:
        """See the places (L, 2) of an iterate; whether its choice is kept from now on."""
        if self.kept is not None:
            return False
        chosen = in_sight(places)
        key = chosen.tobytes()
        self._returns += int(key != self._last and key in self._before)
        self._before.add(key)
        self._last = key
        if self._returns < RETURNS:
            return False
        self.kept = chosen
        return True

    def of(self, places: Floats) -> Ints:
        """Which places (L, 2) have a column (K,): the kept ones, as long as they can."""
        if self.kept is not None and no_steeper(places[self.kept], WORN * STEEP):
            return self.kept
        return in_sight(places)

"""Which of the nodes that violate their statuses change them, so that an active set ends.

The next statuses follow from the present ones and from the rule that picks the nodes to change. Rules,
in this order::

    all violated nodes, where these statuses are met for the first time
    the worst one, where they have been met before, and always after many solves
    the first one, where that goes round in a circle
    none: give up, where that goes round too

A circle is known as soon as it closes: statuses are met again, and since they were met last every
change was that of the worst node, or of the only one. Where it was the only one all the way round, no
rule leads out of it, and the active set gives up at once.
"""

from __future__ import annotations

from evfem.common.arrays import Floats, Ints
from evfem.common.constants import ACTIVE_SET_LIMIT


class Changes:
    """Picks the nodes that change, one active set long."""

    def __init__(self) -> None:
        self._met: dict[bytes, int] = {}
        self._solves = self._settled = self._only = 0
        self._first = False

    def picked(self, status: Ints, violated: Ints, violation: Floats) -> Ints:
        """Of the `violated` nodes (m,) those that change, by how much each of all nodes violates its
        `status` (k,), `violation` (k,); none where statuses go round in a circle.

        >>> import numpy as np
        >>> changes, violation = Changes(), np.array([0.0, 2.0, 1.0])
        >>> one, other = np.array([0, 0, 0]), np.array([0, 1, 1])
        >>> both = np.array([1, 2])
        >>> [changes.picked(at, both, violation).tolist() for at in (one, other, one)]
        [[1, 2], [1, 2], [1]]
        """
        key = status.tobytes()
        self._solves += 1
        last = self._met.get(key)
        round_trip = 0 if last is None else self._solves - last
        self._met[key] = self._solves
        if round_trip and (self._first or self._only >= round_trip):
            return violated[:0]
        late = self._solves > ACTIVE_SET_LIMIT // 3
        if not self._first and (self._solves >= ACTIVE_SET_LIMIT or 0 < round_trip <= self._settled):
            self._first, self._met = True, {key: self._solves}
        if self._first:
            return violated[:1]
        worst = bool(round_trip) or late
        self._only = self._only + 1 if violated.size == 1 else 0
        self._settled = self._settled + 1 if worst or violated.size == 1 else 0
        return violated[[violation[violated].argmax()]] if worst else violated

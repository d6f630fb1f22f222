"""The front at which a finger peels off a surface, node by node.

The linear contact problem knows what the attraction of a node gains where it closes, but not what it
loses where it opens: of a finger that peels off one node snaps after the other, in iterations of their
own, and the residual stays as large as one node's attraction until the front rests. Such iterations
are not in vain: those that go to and fro close nodes again, a front goes on.
"""

from __future__ import annotations

from typing import Any

from evfem.common.constants import STUCK


class Front:
    """Which nodes touch, iteration after iteration of a step.

    >>> import numpy as np
    >>> front, touching = Front(), np.ones(20, dtype=bool)
    >>> for node in range(9):
    ...     front.watch(touching)
    ...     touching = touching & (np.arange(20) > node)
    >>> front.advances()
    True
    """

    def __init__(self) -> None:
        self._met: list[Any] = []

    def watch(self, touching: Any) -> None:
        """An iterate whose nodes (P,) bool touch or do not."""
        self._met.append(touching)

    def advances(self) -> bool:
        """Whether the last `STUCK` iterations have opened nodes and closed none."""
        if len(self._met) <= STUCK:
            return False
        before, now = self._met[-1 - STUCK], self._met[-1]
        return bool((before & ~now).any() and not (now & ~before).any())

"""The voltage that a given charge of the electrode takes.

Under a voltage u the pad settles, and then the charge would take the voltage w(u), which falls while
u rises, as the pad comes closer. Sought is w(u) = u::

    u <- w(u) while that settles fast
    else by the secant of what the last two lacked, w - u
    else, if that leaves the interval between the highest voltage that was too low and the lowest
        that was too high, its middle

A pad that snaps at a voltage between these two has no equilibrium in between: the search ends where
they are close and what they lack is not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: a change of the voltage that is rounding (relative), and a voltage that is none (V)
ROUNDING, TINY = 1e-14, 1e-300
#: a change that is more than this share of the one before is slow
SLOWLY = 0.1
#: voltages closer than this share of themselves between which what a charge takes jumps by more
JUMP = 1e-3


@dataclass
class VoltageSearch:
    """The search from a first `voltage` (V) on, to the relative `tolerance` of the equilibria.

    >>> search = VoltageSearch(0.0, 1e-8)
    >>> while not search.settles(100.0 - 3.0 * search.voltage):
    ...     pass
    >>> round(search.voltage, 6)
    25.0
    """

    voltage: float
    tolerance: float
    change: float = np.inf
    last: tuple[float, float] | None = None
    low: float = -np.inf
    high: float = np.inf

    def settles(self, found: float) -> bool:
        """Whether the charge takes the voltage, `found` (V), that there was; if not, sets the next one.
        As far as the equilibria are exact, to rounding where nothing deforms.
        """
        voltage, lacking, before = self.voltage, found - self.voltage, self.change
        self.change = abs(lacking) / max(abs(found), TINY)
        if self.change <= ROUNDING or (self.change <= self.tolerance and self.change > SLOWLY * before):
            return True
        if lacking > 0.0:
            self.low = max(self.low, voltage)
        else:
            self.high = min(self.high, voltage)
        following = found
        if self.last is not None and self.change > SLOWLY * before and lacking != self.last[1]:
            following = voltage - lacking * (voltage - self.last[0]) / (lacking - self.last[1])
        if not self.low < following < self.high:
            following = 0.5 * (self.low + self.high) if np.isfinite(self.high - self.low) else found
        self.last, self.voltage = (voltage, lacking), following
        return False

    @property
    def jumps(self) -> bool:
        """Whether equilibria at nearly the same voltage ask for different ones."""
        if not np.isfinite(self.high - self.low):
            return False
        near = self.high - self.low <= JUMP * max(abs(self.low), abs(self.high))
        return bool(near and self.change > JUMP)

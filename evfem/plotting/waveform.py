"""Voltages that jump: between two rows of a history, which are ends of steps, the edge stands where it is.

A signal or profile that jumps has `jumps(begin, end)`: the times (s) or positions (mm) in begin < x <= end,
and the voltages (V) before and after, arrays (k,) each.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np

from evfem.circuit.signals import VoltageProfile
from evfem.common.arrays import Floats
from evfem.electrostatics.timesignals import Carrier
from evfem.errors import InputError
from evfem.simulation.result import Result

#: edges of a picture; a waveform with more is not told apart, and is drawn from row to row
MOST = 10_000


def with_edges(result: Result, name: str, rows: Any, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """A curve through `rows` of a result, x and y (n,), of the column `name`: of a voltage with a vertical
    edge wherever its signal or its profile jumps between two of them; any other as it is.
    """
    if name != "voltage" or len(x) < 2 or (found := _jumps(result)) is None:
        return x, y
    jumps, along = found
    place = np.asarray(result[along], dtype=float)[rows]
    at: list[Floats] = []
    edges: list[Floats] = []
    for i, (begin, end) in enumerate(pairwise(place)):
        where, before, after = jumps(begin, end)
        if sum(map(len, at)) + len(where) > MOST:
            return x, y
        share = (where - begin) / (end - begin) if len(where) else where
        at.append(np.repeat(x[i] + share * (x[i + 1] - x[i]), 2))
        edges.append(np.column_stack([before, after]).ravel())
    which = np.repeat(np.arange(1, len(x)), [len(one) for one in at])
    return np.insert(x, which, np.concatenate(at)), np.insert(y, which, np.concatenate(edges))


def _jumps(result: Result) -> tuple[Callable[[float, float], Any], str] | None:
    """The jumps of what prescribes the voltage of a result, if it has any, and the column it goes along."""
    try:
        scene = result.scene
    except InputError:
        return None
    signal, factor = scene.electrics.voltage, 1.0
    if isinstance(signal, Carrier):  # as drawn only where it is averaged over its cycles
        signal, factor = None if signal.resolved else signal.envelope, float(np.sqrt(0.5))
    if not hasattr(signal, "jumps") or (isinstance(signal, VoltageProfile) and scene.hand is not None):
        return None  # with a hand a profile goes along its drive, which is in no column
    given: Any = signal

    def jumps(begin: float, end: float) -> Any:
        where, before, after = given.jumps(begin, end)
        return where, factor * before, factor * after

    return jumps, "position" if isinstance(given, VoltageProfile) else "time"

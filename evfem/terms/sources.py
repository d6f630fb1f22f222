"""Sources of the voltage: what each prescribes at a moment of a run, and the control that it makes.

===================  ===========================  ==========================================
source               prescribes                   control (`evfem.newton.control`)
===================  ===========================  ==========================================
`Source`             the voltage of ramps         `GivenVoltage`
`ProfileSource`      voltage over the position    `GivenVoltage`
`SignalSource`       voltage over time            `GivenVoltage`
`ChargeSource`       charge of the electrode      `KeptCharge`
`OpenSource`         voltage, then nothing        `GivenVoltage`, then `KeptCharge`
`ForceSource`        friction force in slides     `FollowFriction`, elsewhere `GivenVoltage`
===================  ===========================  ==========================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from evfem.circuit.signals import FollowForce, VoltageProfile
from evfem.common.arrays import Floats
from evfem.common.rooms import Column
from evfem.electrostatics.laws import Layers, eps_0
from evfem.electrostatics.timesignals import FLIP, NANO, ChargeControl, OpenCircuit
from evfem.errors import InputError
from evfem.protocols import TimeSignal

#: fraction of its range by which what is prescribed may leave the straight line in a substep
TURNED = 0.02
#: intervals between two rows of a table, samples of a signal in a period and their largest number
PARTS, SAMPLES, MOST = 4, 32, 100_000


@dataclass(frozen=True)
class Moment:
    """Of a target: the `voltage` (V) of ramps, the `time` (s) there and at the `begin` of the step, x of the
    drive, its position (mm) `along` the `direction` in which it moves, and whether it `slides`.
    """

    voltage: float
    time: float = 0.0
    begin: float = 0.0
    x: float = 0.0
    along: float = 0.0
    direction: tuple[float, ...] = (1.0,)
    slides: bool = False


def chords(x: Floats, value: Floats, whole: float) -> Floats:
    """Fractions (k,) of the path over positions or times x (n,) at which to stop for the values (n,) to
    differ by no more than `TURNED` of `whole` from the straight line between two stops: those of Ramer,
    Douglas and Peucker (doi:10.1016/S0146-664X(72)80017-0).

    >>> chords(np.linspace(0.0, 2.0, 5), np.array([0.0, 1.0, 2.0, 1.0, 0.0]), 2.0).tolist()
    [0.5]
    """
    kept, open_ = [], [(0, len(x) - 1)]
    while open_:
        first, last = open_.pop()
        ends = [first, last]
        off = np.abs(value[first : last + 1] - np.interp(x[first : last + 1], x[ends], value[ends]))
        worst = first + int(off.argmax())
        if last - first > 1 and off.max() > TURNED * whole:
            kept.append(worst)
            open_ += [(first, worst), (worst, last)]
    return np.sort((x[kept] - x[0]) / (x[-1] - x[0]))


def over_places(signal: Any, begin: float, end: float, power: int) -> Floats:
    """Stops on the path from `begin` to `end` along a table over the position; of a power of its values, that
    which acts.
    """
    low, high = min(begin, end), max(begin, end)
    if low == high:
        return np.zeros(0)
    knots = signal.position[(signal.position > low) & (signal.position < high)]
    edges = np.unique(np.concatenate([[low], knots, [high]]))
    position = np.interp(np.arange(PARTS * (len(edges) - 1) + 1) / PARTS, np.arange(len(edges)), edges)
    value = np.asarray(signal(position)) ** power
    found = chords(position, value, float(np.ptp(np.asarray(signal(signal.position)) ** power)))
    return found if end > begin else np.sort(1.0 - found)


@dataclass(frozen=True)
class Source:
    """A constant voltage, or that of ramps; `signal` is the scene's."""

    signal: Any = 0.0
    #: columns of the history, of what it misses
    columns: ClassVar[tuple[Column, ...]] = ()

    def at(self, moment: Moment) -> float:
        """The voltage (V) at a moment."""
        return moment.voltage

    @property
    def start(self) -> float:
        """The voltage (V) at the beginning of a run."""
        return self.at(Moment(float(self.signal)))

    def control(self, moment: Moment, controls: Any) -> Any:
        """The control of a target, made of those of `evfem.newton.control`."""
        return controls.GivenVoltage(self.at(moment))

    def prescribed(self, seconds: float) -> bool:
        """Whether the voltage changes by itself in a step of so many seconds."""
        return False

    def turns(self, begin: Moment, end: Moment) -> Floats:
        """Fractions (k,) of a step from `begin` to `end` at which what is prescribed turns."""
        return np.zeros(0)

    def pulls(self, moment: Moment) -> bool:
        """Whether anything may attract an unloaded finger at a moment."""
        return self.at(moment) != 0.0

    def check(self, scene: Any) -> None:
        """Raise InputError for a scene whose law it cannot have."""


class ProfileSource(Source):
    """A voltage over the position of the bone."""

    def at(self, moment: Moment) -> float:
        return float(self.signal(moment.x))

    @property
    def start(self) -> float:
        return self.at(Moment(0.0))

    def prescribed(self, seconds: float) -> bool:
        return True

    def turns(self, begin: Moment, end: Moment) -> Floats:
        return over_places(self.signal, begin.x, end.x, 2)


class SignalSource(Source):
    """A voltage over time."""

    def at(self, moment: Moment) -> float:
        return float(self.signal(moment.time))

    @property
    def start(self) -> float:
        return self.at(Moment(0.0))

    def prescribed(self, seconds: float) -> bool:
        return seconds > 0.0

    def turns(self, begin: Moment, end: Moment) -> Floats:
        frequency = max(self.signal.highest_frequency, getattr(self.signal, "rate", 0.0) / 4.0)
        count = (end.time - begin.time) * frequency * SAMPLES
        if not count:
            return np.zeros(0)
        times = np.linspace(begin.time, end.time, 2 + min(int(np.ceil(count)), MOST))
        value = np.asarray(self.signal(times)) ** 2
        return chords(times, value, float(np.ptp(value)))


class ChargeSource(SignalSource):
    """A charge of the electrode over time."""

    def control(self, moment: Moment, controls: Any) -> Any:
        return controls.KeptCharge(NANO * self.signal.charge_at(moment.time) / eps_0)

    def pulls(self, moment: Moment) -> bool:
        return bool(self.signal.charge_at(moment.time) != 0.0)


class OpenSource(SignalSource):
    """A voltage until the electrode is disconnected, then its charge."""

    def control(self, moment: Moment, controls: Any) -> Any:
        kept = moment.begin >= self.signal.after * (1.0 - FLIP)  # times are sums of steps
        return controls.KeptCharge() if kept else super().control(moment, controls)


class ForceSource(Source):
    """Whatever voltage makes the friction force follow a target in slides; elsewhere it stays."""

    columns = (Column("missed_force", "N/mm", "target less reached friction force on the bone"),)

    @property
    def start(self) -> float:
        return 0.0

    def control(self, moment: Moment, controls: Any) -> Any:
        if not moment.slides:
            return super().control(moment, controls)
        target, largest = float(self.signal(moment.along)), self.signal.largest_voltage
        return controls.FollowFriction(target, largest, moment.direction)

    def turns(self, begin: Moment, end: Moment) -> Floats:
        return over_places(self.signal, begin.along, end.along, 1) if end.slides else np.zeros(0)

    def pulls(self, moment: Moment) -> bool:
        return True

    def check(self, scene: Any) -> None:
        """The squared voltage can be an unknown only of laws that are proportional to it."""
        layers = Layers.of(scene.electrics.lossless(scene.electrics.insulator))
        once, twice = (scene.law.traction(0.1, voltage, layers) for voltage in (1.0, 2.0))
        if not np.isclose(twice, 4.0 * once, rtol=1e-9):
            allowed = "a law proportional to the squared voltage, to follow a force"
            raise InputError("electrostatics.law", scene.law, allowed)


#: columns of scenes in which a voltage makes gaps
GAP_COLUMNS = (Column("missed_gap", "mm", "target less reached smallest gap"),)
#: kinds of a scene's voltage, the particular ones first
KINDS = (
    (FollowForce, ForceSource),
    (ChargeControl, ChargeSource),
    (OpenCircuit, OpenSource),
    (VoltageProfile, ProfileSource),
    (TimeSignal, SignalSource),
)


def source_of(voltage: Any) -> Source:
    """The source of a scene's voltage.

    >>> source_of(100.0).start, source_of(VoltageProfile([0.0], [50.0])).start
    (100.0, 50.0)
    """
    return next((source(voltage) for kind, source in KINDS if isinstance(voltage, kind)), Source(voltage))

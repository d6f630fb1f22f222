r"""Voltage as a function of time: a sine, a carrier with an envelope, samples at a rate.

The force laws take the voltage of the moment, squared, so that the attraction has other frequencies
than the voltage. With w = 2 pi f, on a gap that does not change::

    Sine      U = B + A sin w t             U^2 = B^2 + A^2/2 + 2 A B sin w t - (A^2/2) cos 2 w t
    Square    U = B +- A                    U^2 = B^2 + A^2 +- 2 A B
    Carrier   U = E(t) sin w t              U^2 = (E^2/2) (1 - cos 2 w t)

A sine without bias attracts at twice its frequency; with the bias B the part at w is 4 B/A times
that at 2 w. A carrier whose cycles are much shorter than the steps acts by its mean, E^2/2; with
the envelope E = E_0 (1 + m sin W t), which is amplitude modulation, that is

    E^2/2 = (E_0^2/2) (1 + m^2/2 + 2 m sin W t - (m^2/2) cos 2 W t)

Units: V, s, Hz; phases in rad. Time is that of the run: 0 at its start, and standing still in
motions that take none. Any object with the methods of `evfem.protocols.TimeSignal` is a signal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import (
    Checked,
    Values,
    Within,
    above,
    check_fields,
    number,
    real,
    set_frozen,
    to_python,
    yes_or_no,
)
from evfem.common.storage import write_text
from evfem.common.tables import MOST_ROWS, numbers, read_columns
from evfem.electrostatics import wav
from evfem.electrostatics.alternating import PERIODS, SMOOTH, grouped, shares, square_harmonics
from evfem.errors import InputError
from evfem.protocols import TimeSignal

HEADER = {"time": "s", "voltage": "V"}
#: largest voltage (V), and frequency and rate (Hz)
LARGEST, FASTEST = 1e6, 1e9
#: coulombs, or farads, per metre of depth in a nanocoulomb, or nanofarad, per millimetre
NANO = 1e-6
#: largest charge (nC per mm of depth, in space nC)
MOST_CHARGE = 1e6
#: largest capacitance beside the finger (nF per mm of depth, in space nF)
MOST_CAPACITANCE = 1e3
#: fraction of the fluctuation's power that lies below the highest frequency of samples
POWER = 0.95
#: fraction of half a period that counts as rounding of a time
FLIP = 1e-9
#: largest difference of two spacings of evenly spaced times, as a fraction of the spacing
EVEN = 1e-3

FREQUENCY = number(f"a frequency in Hz, above 0, up to {FASTEST:g}", Within(0.0, FASTEST, above=True), "Hz")
_AMPLITUDE = number(f"a voltage in V from 0 to {LARGEST:g}", Within(0.0, LARGEST), "V")
_BIAS = number(f"a voltage in V between -{LARGEST:g} and {LARGEST:g}", Within(-LARGEST, LARGEST), "V")
_PHASE = number("a phase in rad", Within(), "rad")
RATE = number(f"a rate in Hz, above 0, up to {FASTEST:g}", Within(0.0, FASTEST, above=True), "Hz")
START = number("a time in s", Within(), "s")
_CHARGE = "a charge in nC per mm of depth (in space nC), or a signal in time that is called with times"
_ENVELOPE = "a voltage in V, or a signal in time that is called with times"
_NUMBER_OR_SIGNAL = {"type": float | dict, "kinds": lambda: SIGNALS, "tag": "kind"}
Frequency = Annotated[float, FREQUENCY, "of the sine, square wave or carrier"]
Parallel = Annotated[
    float,
    number(f"a capacitance in nF/mm from 0 to {MOST_CAPACITANCE:g}", Within(0.0, MOST_CAPACITANCE), "nF/mm"),
    "beside the finger, of cable, amplifier and the rest of the electrode; in space in nF",
]
Amplitude = Annotated[float, _AMPLITUDE, "of the sine or square wave"]


# A signal that repeats has `cycle`, its frequency (Hz), and `powers()`: its effective voltage (V), and the
# orders of its harmonics and their fractions of the squared voltage. One that a `Drive` has by the name of
# its kind also has `crest`, its peak over its effective voltage, and `harmonics()`, those without a bias.
# One that has `jumps` has ideal edges, whose current is infinite.


class _Periodic(Checked):
    """A signal that repeats with `frequency`."""

    frequency: float

    @property
    def cycle(self) -> float:
        """Its frequency (Hz)."""
        return self.frequency

    @property
    def highest_frequency(self) -> float:
        """Its frequency (Hz); flips have no time scale of their own."""
        return self.frequency


@dataclass(frozen=True)
class Sine(_Periodic):
    """`bias` + `amplitude` sin(2 pi `frequency` t + `phase`).

    >>> Sine(frequency=50.0, amplitude=100.0, bias=20.0)(0.005)
    120.0
    """

    frequency: Frequency
    amplitude: Amplitude
    bias: Annotated[float, _BIAS, "mean voltage"] = 0.0
    phase: Annotated[float, _PHASE, "at time 0"] = 0.0
    kind = "sine"
    crest = float(np.sqrt(2.0))

    @staticmethod
    def harmonics() -> tuple[Floats, Floats]:
        """Orders and weights."""
        return np.ones(1), np.ones(1)

    def powers(self) -> tuple[float, Floats, Floats]:
        """Effective voltage (V), orders and shares."""
        return shares(np.array([0.0, 1.0]), np.array([self.bias**2, 0.5 * self.amplitude**2]))

    @property
    def largest(self) -> float:
        """Largest magnitude (V)."""
        return abs(self.bias) + self.amplitude

    def __call__(self, time: Values) -> Values:
        """Voltage (V) at `time` (s, any shape)."""
        turns = 2.0 * np.pi * self.frequency * np.asarray(time) + self.phase
        return to_python(self.bias + self.amplitude * np.sin(turns))


@dataclass(frozen=True)
class Square(_Periodic):
    """`bias` + `amplitude` in the first half of each period and `bias` - `amplitude` in the second.

    Without a bias its square, and so the attraction, is constant. On and off is half the voltage as both.

    >>> Square(frequency=50.0, amplitude=100.0)([0.0, 0.009, 0.01, 0.02]).tolist()
    [100.0, 100.0, -100.0, 100.0]
    >>> Square(frequency=50.0, amplitude=40.0, bias=40.0)([0.0, 0.01]).tolist()
    [80.0, 0.0]
    """

    frequency: Frequency
    amplitude: Amplitude
    bias: Annotated[float, _BIAS, "mean voltage"] = 0.0
    kind = "square"
    crest = 1.0
    harmonics = staticmethod(square_harmonics)

    def powers(self) -> tuple[float, Floats, Floats]:
        """Effective voltage (V), orders and shares."""
        order, weight = self.harmonics()
        square = (self.amplitude / self.crest) ** 2 * weight
        return shares(np.append(0.0, order), np.append(self.bias**2, square))

    @property
    def largest(self) -> float:
        """Largest magnitude (V)."""
        return abs(self.bias) + self.amplitude

    def __call__(self, time: Values) -> Values:
        """Voltage (V) at `time` (s, any shape); a flip within rounding of a time has happened."""
        half = np.floor(2.0 * self.frequency * np.asarray(time) + FLIP)
        return to_python(self.bias + self.amplitude * (1.0 - 2.0 * np.mod(half, 2.0)))

    def jumps(self, begin: float, end: float) -> tuple[Floats, Floats, Floats]:
        """Times (s) in begin < t <= end at which it flips, and the voltages (V) before and after, (k,) each.

        >>> [one.tolist() for one in Square(frequency=50.0, amplitude=100.0).jumps(0.0, 0.025)]
        [[0.01, 0.02], [100.0, -100.0], [-100.0, 100.0]]
        """
        first, last = np.floor(2.0 * self.frequency * np.array([begin, end]) + FLIP)
        half = np.arange(first, last) + 1.0
        rise = 2.0 * self.amplitude * (1.0 - 2.0 * np.mod(half, 2.0))
        return half / (2.0 * self.frequency), self.bias - 0.5 * rise, self.bias + 0.5 * rise


@dataclass(frozen=True)
class OpenCircuit(Checked):
    """A direct voltage until the electrode is disconnected; then it keeps its charge, whatever that does to
    its voltage, together with a `parallel_capacitance`. For a resolved `Drive`.

    >>> OpenCircuit(100.0, after=0.1).largest
    100.0
    """

    voltage: Annotated[float, _BIAS, "of the source"]
    after: Annotated[float, START, "when the electrode is disconnected"] = 0.0
    parallel_capacitance: Parallel = 0.0
    highest_frequency = 0.0
    kind = "open_circuit"

    @property
    def largest(self) -> float:
        """Magnitude (V) while the electrode is connected."""
        return abs(self.voltage)

    def __call__(self, time: Values) -> Values:
        """Voltage (V) of the source at `time` (s, any shape)."""
        return to_python(np.full(np.shape(time), self.voltage))


@dataclass(frozen=True)
class ChargeControl:
    """The electrode has a charge, and the voltage that this takes. For a resolved `Drive`.

    A plate of the area A under the charge Q is pulled by Q^2 / (2 eps_0 A), however far it is. What is
    beside the finger, `parallel_capacitance`, takes a share of the charge, C_p U: a plate with the capacity
    C_0 that comes from the gap g on a spring is then stable up to the travel g/3 (1 + C_0 / C_p). A metre of
    coaxial cable, 100 pF, is 0.01 nF/mm over a depth of 10 mm, in space 0.1 nF: tens of times a finger's.

    >>> ChargeControl(0.02).charge_at(0.5)
    0.02
    """

    charge: Annotated[
        Any,
        {"allowed": "a charge in nC/mm, or a signal of charges", "unit": "nC/mm", **_NUMBER_OR_SIGNAL},
        "of the electrode, in space in nC: a number, or a signal of charges",
    ]
    parallel_capacitance: Parallel = 0.0
    kind = "charge"

    def __post_init__(self) -> None:
        check_fields(self)
        if not isinstance(self.charge, TimeSignal):
            allowed = f"{_CHARGE}, between -{MOST_CHARGE:g} and {MOST_CHARGE:g} nC/mm"
            set_frozen(self, charge=real("charge", self.charge, allowed, Within(-MOST_CHARGE, MOST_CHARGE)))

    @property
    def largest(self) -> float:
        """The largest voltage (V) that counts: how much a charge takes depends on the gap."""
        return LARGEST / 2.0

    @property
    def highest_frequency(self) -> float:
        """Frequency of the charge (Hz)."""
        return self.charge.highest_frequency if isinstance(self.charge, TimeSignal) else 0.0

    def charge_at(self, time: float) -> float:
        """Charge at `time` (s): nC, in the plane per mm of depth."""
        return float(self.charge(time) if isinstance(self.charge, TimeSignal) else self.charge)

    def __call__(self, time: Values) -> Values:
        """Voltage (V) before the charge is there, at `time` (s, any shape)."""
        return to_python(np.zeros(np.shape(time)))


@dataclass(frozen=True)
class Carrier:
    """`envelope` times sin(2 pi `frequency` t): a carrier, modulated where the envelope is a signal.

    With `resolved` False it is the root mean square over the carrier's cycles instead, envelope / sqrt(2):
    the steps need only resolve the envelope, and a law proportional to the squared voltage gives the mean
    attraction exactly.

    >>> hum = Carrier(10_000.0, envelope=Sine(75.0, amplitude=50.0, bias=100.0))
    >>> hum.largest, hum.highest_frequency
    (150.0, 10075.0)
    >>> mean = Carrier(10_000.0, envelope=Sine(75.0, amplitude=50.0, bias=100.0), resolved=False)
    >>> round(mean(0.0), 3), mean.highest_frequency
    (70.711, 75.0)
    """

    frequency: Frequency
    envelope: Annotated[
        Any,
        {"allowed": "a voltage in V, or a signal", "unit": "V", **_NUMBER_OR_SIGNAL},
        "height of the carrier: a number, or a signal that modulates it",
    ]
    resolved: Annotated[bool, yes_or_no(), "false: the root mean square over its cycles"] = True
    kind, waveform = "carrier", "sine"

    def __post_init__(self) -> None:
        check_fields(self)
        if not isinstance(self.envelope, TimeSignal):
            envelope = real("envelope", self.envelope, _ENVELOPE, Within(0.0, LARGEST), "V")
            set_frozen(self, envelope=envelope)

    @property
    def largest(self) -> float:
        """Largest magnitude (V)."""
        height = float(self.envelope.largest if isinstance(self.envelope, TimeSignal) else self.envelope)
        return height if self.resolved else height / np.sqrt(2.0)

    @property
    def highest_frequency(self) -> float:
        """Frequency of the envelope, plus the carrier's if it is resolved (Hz)."""
        slow = self.envelope.highest_frequency if isinstance(self.envelope, TimeSignal) else 0.0
        return float(slow + self.frequency * self.resolved)

    def __call__(self, time: Values) -> Values:
        """Voltage (V) at `time` (s, any shape)."""
        time = np.asarray(time)
        height = self.envelope(time) if isinstance(self.envelope, TimeSignal) else self.envelope
        swing = np.sin(2.0 * np.pi * self.frequency * time) if self.resolved else np.sqrt(0.5)
        return to_python(np.asarray(height * swing) + np.zeros_like(time, dtype=float))


@dataclass(frozen=True)
class Sampled:
    """Samples, linear between them and constant before the first and after the last; with `repeat` they start
    again one period after the last, as long as they last.

    >>> steps = Sampled([0.0, 100.0, 0.0], rate=1000.0)
    >>> steps(0.0005), steps(0.5)
    (50.0, 0.0)
    >>> Sampled([0.0, 100.0], rate=4.0, repeat=True)(100.125)
    50.0
    """

    voltage: Annotated[Any, {"allowed": "numbers in V"}, "the samples"]
    rate: Annotated[float, RATE, "of the samples"]
    start: Annotated[float, START, "time of the first sample"] = 0.0
    repeat: Annotated[bool, yes_or_no(), "whether it begins anew at its end"] = False
    kind = "sampled"

    def __post_init__(self) -> None:
        check_fields(self)
        voltage = numbers("voltage", self.voltage, "samples in V")
        if not 0 < voltage.size <= MOST_ROWS:
            raise InputError("voltage", f"{voltage.size} samples", f"1 to {MOST_ROWS} samples")
        if np.abs(voltage).max() > LARGEST:
            raise InputError("voltage", f"{voltage[np.argmax(np.abs(voltage))]:g}", _BIAS["allowed"])
        set_frozen(self, voltage=voltage)

    @property
    def cycle(self) -> float | None:
        """Frequency (Hz) at which it repeats."""
        return self.rate / self.voltage.size if self.repeat else None

    def powers(self) -> tuple[float, Floats, Floats] | None:
        """Effective voltage (V), orders and shares of straight lines between samples, repeated."""
        if not self.repeat:
            return None
        size = self.voltage.size
        above = np.arange(1.0, max(SMOOTH, PERIODS * size))
        transform = np.abs(np.fft.fft(self.voltage) / size) ** 2
        square = 2.0 * transform[above.astype(int) % size] * np.sinc(above / size) ** 4
        following = np.roll(self.voltage, -1)
        total = float(np.mean(self.voltage**2 + self.voltage * following + following**2)) / 3.0
        bias = float(self.voltage.mean()) ** 2
        square[-1] += total - bias - float(square.sum())
        order, square = grouped(above, square)
        return shares(np.concatenate([[0.0], order]), np.concatenate([[bias], square]))

    def __repr__(self) -> str:
        low, high = self.voltage.min(), self.voltage.max()
        text = f"{self.voltage.size} samples at {self.rate:g} Hz, {low:.4g} to {high:.4g} V"
        return f"Sampled({text}{', repeated' if self.repeat else ''})"

    @property
    def largest(self) -> float:
        """Largest magnitude (V)."""
        return float(np.abs(self.voltage).max())

    @property
    def highest_frequency(self) -> float:
        """Frequency (Hz) below which 95 % of the power of the fluctuation lies; 0 for a constant."""
        fluctuation = self.voltage - self.voltage.mean()
        power = np.abs(np.fft.rfft(fluctuation)) ** 2
        total = np.cumsum(power)
        if not total[-1] > 0.0:
            return 0.0
        return float(np.searchsorted(total, POWER * total[-1]) * self.rate / self.voltage.size)

    def __call__(self, time: Values) -> Values:
        """Voltage (V) at `time` (s, any shape)."""
        sample_index = (np.asarray(time, dtype=float) - self.start) * self.rate
        size = self.voltage.size
        return to_python(
            np.interp(sample_index, np.arange(size), self.voltage, period=size if self.repeat else None)
        )

    @classmethod
    def from_csv(cls, path: str | Path, *, repeat: bool = False) -> Sampled:
        """Read a file with the header ``time,voltage`` and a row for each sample, in s and V or in the units
        of the header, ``time [ms],voltage [kV]``.

        Raises InputError for a missing file, another header, a row that is not two numbers, and
        times that are not evenly spaced.
        """
        time, voltage = read_columns(Path(path), HEADER, "file")
        if time.size < 2:
            raise InputError("file", f"{path} with {time.size} rows", "at least two rows")
        spacing = float(time[-1] - time[0]) / (time.size - 1)
        if not (spacing > 0.0 and np.abs(np.diff(time) - spacing).max() <= EVEN * spacing):
            raise InputError("file", f"{path}, whose times are not evenly spaced", "times in equal steps")
        return cls(voltage, 1.0 / spacing, float(time[0]), repeat)

    @classmethod
    def from_wav(
        cls, path: str | Path, full_scale: float | None = None, *, start: float = 0.0, repeat: bool = False
    ) -> Sampled:
        """Read a WAV with one channel; `full_scale` (V) is the voltage of the largest sample that its
        integers can have, and of 1.0 in a file of floats, where a warning tells larger ones.

        A file that evfem wrote says so itself; one with a carrier is the voltage of the moment.
        Raises InputError for a missing, cut off or foreign file, for one without either full
        scale, and for more than 1,000,000 samples.
        """
        rate, volts = wav.voltages(Path(path), "path", full_scale)
        return cls(volts, rate, start, repeat)

    @classmethod
    def from_haptic(
        cls, path: str | Path, full_scale: float, *, rate: float = 1000.0, tap: float = 0.01
    ) -> Sampled:
        """Read the intensity of a haptic pattern (AHAP, Meta's `.haptic`, a waveform of Android) as a
        voltage: `full_scale` (V) times its root, for the attraction grows with the square.

        A transient event lasts `tap` s. Of its sharpness nothing is left: the voltage is that of an envelope,
        as `Carrier` takes it. Raises InputError as `evfem.electrostatics.wav.intensity`.
        """
        volts = above("full_scale", full_scale, 0.0, "a voltage in V above zero")
        above("rate", rate, 0.0, "a rate in Hz above zero")
        above("tap", tap, 0.0, "a time in s above zero")
        return cls(volts * np.sqrt(wav.intensity(Path(path), "path", rate, tap)), rate)

    #: its name in 0.3
    from_ahap = from_haptic

    def to_csv(self, path: str | Path) -> None:
        """Write the file that `from_csv` reads back."""
        time = self.start + np.arange(self.voltage.size) / self.rate
        rows = (f"{t!r},{u!r}\n" for t, u in zip(time.tolist(), self.voltage.tolist(), strict=True))
        write_text(path, ",".join(HEADER) + "\n" + "".join(rows))


#: kinds of signals in a file
SIGNALS: Mapping[str, Any] = {
    cls.kind: cls for cls in (Sine, Square, Carrier, Sampled, OpenCircuit, ChargeControl)
}
#: those that a drive can have
WAVEFORMS: Mapping[str, Any] = {kind: cls for kind, cls in SIGNALS.items() if hasattr(cls, "crest")}

r"""Voltage as a function of position, its effective value, and what a carrier and an amplifier make of it.

The laws need the effective voltage across skin and insulator. Units: V, mm (of bone position), s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import Values, Within, above, check_fields, number, set_frozen, to_python
from evfem.common.notices import warn
from evfem.common.storage import write_text
from evfem.common.tables import MOST_ROWS, numbers, piecewise_linear, read_columns
from evfem.common.views import plus
from evfem.errors import ABSENT, InputError

HEADER = {"position": "mm", "voltage": "V"}
#: largest magnitude of a position (mm) and of a voltage (V)
LARGEST = 1e6
#: share of the largest voltage by which a wave swings that matters
SWING = 0.05
#: of a position that is at a jump, in mm, beyond 1 mm as a fraction of it
ROUNDING = 1e-12
_POSITION = {"allowed": "positions in mm that never fall", "type": list[float], "unit": "mm"}
_FORCE = {"allowed": "as many forces in N/mm", "type": list[float], "unit": "N/mm"}
_LARGEST = number(f"a voltage in V, above 0, up to {LARGEST:g}", Within(0.0, LARGEST, above=True), "V")


@dataclass(frozen=True)
class VoltageProfile:
    """Voltage in V over the position in mm: linear between the rows, constant beyond the first and the last.

    Positions must not fall; at a repeated position the later row holds from that position on (a
    jump), to rounding and on the way back too. Calling the profile with positions gives voltages of
    the same shape.

    >>> profile = VoltageProfile([0.0, 5.0, 5.0], [0.0, 100.0, 400.0])
    >>> profile(2.5), profile(5.0), profile(9.0)
    (50.0, 400.0, 400.0)
    """

    position: Any
    voltage: Any

    def __post_init__(self) -> None:
        position, voltage = _over_position(
            self.position, self.voltage, ("voltage", "voltages", "V", "voltage profile")
        )
        set_frozen(self, position=position, voltage=voltage)

    def __repr__(self) -> str:
        x, U = self.position, self.voltage
        where = f"{x.size} rows, x {plus(x[0]):.4g} to {plus(x[-1]):.4g} mm"
        return f"VoltageProfile({where}, {plus(U.min()):.4g} to {plus(U.max()):.4g} V)"

    def __call__(self, position: Values) -> Values:
        """Voltage in V at `position` in mm."""
        return to_python(piecewise_linear(self.position, self.voltage, _at_jumps(self.position, position)))

    def jumps(self, begin: float, end: float) -> tuple[Floats, Floats, Floats]:
        """Positions (mm) at which it jumps on the way from `begin` to `end`, in their order, and the voltages
        (V) before and after, (k,) each; at the smaller of the two it has the later row's, either way.

        >>> profile = VoltageProfile([0.0, 5.0, 5.0], [0.0, 100.0, 400.0])
        >>> [one.tolist() for one in profile.jumps(6.0, 4.0)]
        [[5.0], [400.0], [100.0]]
        """
        x, (low, high) = self.position, sorted(_at_jumps(self.position, [begin, end]).tolist())
        row = np.flatnonzero((np.diff(x) == 0.0) & (x[1:] > low) & (x[1:] <= high))
        before, after = self.voltage[row], self.voltage[row + 1]
        return (x[row], before, after) if end >= begin else (x[row][::-1], after[::-1], before[::-1])

    @classmethod
    def from_csv(cls, path: str | Path) -> VoltageProfile:
        """Read a file with the header ``position,voltage`` and a row of numbers per point, in mm and V
        or in the units of the header, ``position [um],voltage [kV]``.

        Raises InputError for a missing file, another header, or a row that is not two numbers.
        """
        return cls(*read_columns(Path(path), HEADER, "voltage_file"))

    def to_csv(self, path: str | Path) -> None:
        """Write the file that `from_csv` reads back to the last bit."""
        rows = (f"{x!r},{u!r}\n" for x, u in zip(self.position.tolist(), self.voltage.tolist(), strict=True))
        write_text(path, ",".join(HEADER) + "\n" + "".join(rows))

    def rms(self, start: float, stop: float) -> float:
        """Root mean square in V over start <= position <= stop: exact, since the profile is piecewise linear.

        At constant speed this is the mean over time. The mean attraction follows rms(U)^2.
        """
        if not (np.isfinite([start, stop]).all() and start < stop):
            raise InputError("start, stop", (start, stop), "two positions in mm, the second one larger")
        return float(np.sqrt(mean_squares(self, np.array([start, stop], dtype=float))[0]))

    def steepest(self) -> float:
        """Largest change in V per mm, infinite at a jump; times the speed it is the slew rate in V/s."""
        rise, run = np.abs(np.diff(self.voltage)), np.diff(self.position)
        rise, run = rise[rise > 0], run[rise > 0]
        if rise.size == 0:
            return 0.0
        return float(np.max(rise / run)) if np.all(run > 0) else float("inf")


def _at_jumps(position: Floats, x: Values) -> Any:
    """Positions x (...) in mm, those within rounding of a jump of rows at `position` moved to it: steps of a
    slide miss it by a bit or two.
    """
    x, jumps = np.real(x), position[1:][np.diff(position) == 0.0]
    if jumps.size == 0:
        return x
    after = jumps[np.minimum(np.searchsorted(jumps, x), jumps.size - 1)]
    return np.where(np.abs(after - x) <= ROUNDING * np.maximum(np.abs(after), 1.0), after, x)


def mean_squares(profile: VoltageProfile, edges: Floats) -> Floats:
    """Mean of U^2 (V^2, one less than `edges`) between neighbours of rising `edges` (mm): exact by two points
    of Gauss on each straight piece, and U^2 itself where an interval is too narrow for its floats.
    """
    between = profile.position[(profile.position > edges[0]) & (profile.position < edges[-1])]
    x, width = np.union1d(edges, between), np.diff(edges)
    middle, half = 0.5 * (x[1:] + x[:-1]), 0.5 * np.diff(x)
    square = sum(np.asarray(profile(middle + side * half)) ** 2 for side in (-(3.0**-0.5), 3.0**-0.5))
    whole = np.add.reduceat(np.append(half * square, 0.0), np.searchsorted(x, edges[:-1]))
    return np.where(width > 0.0, whole / np.where(width > 0.0, width, 1.0), profile(edges[:-1]) ** 2)


def waves_in(profile: VoltageProfile) -> Floats:
    """Wave (mm) of each crest and trough that swings by at least `SWING` of the largest voltage:
    its width at half height and that of its wider neighbour, of at most three times that width.

    Jumps and ramps are none; a single pulse counts as half a wave.

    >>> waves_in(VoltageProfile([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 10.0, 0.0, 10.0, 0.0])).tolist()
    [2.0, 2.0, 2.0]
    """
    x, u = profile.position, profile.voltage
    passed = np.zeros(x.size, bool)  # the rows between two others at one position never hold
    passed[1:-1] = x[2:] == x[:-2]
    x, u, at = x[~passed], u[~passed], []
    for a, b in pairwise(_turns(u.tolist(), SWING * float(np.abs(u).max()))):
        middle, side = 0.5 * (u[a] + u[b]), np.sign(u[b] - u[a])
        i = a + int(np.argmax(side * (u[a + 1 : b + 1] - middle) >= 0.0))
        at.append(x[i] + (middle - u[i]) / (u[i + 1] - u[i]) * (x[i + 1] - x[i]))
    widths = np.diff(at)
    beside = np.pad(widths, 1)
    wider = np.maximum(beside[2:], beside[:-2]) if widths.size > 1 else widths
    return widths + np.minimum(wider, 3.0 * widths)


def warn_of_waves(file: str, profile: VoltageProfile, spacing: float, samples: str, closer: str) -> None:
    """A warning where a file whose `samples` are `spacing` (mm) apart has less than two in a wave of a
    profile; it says what spacing holds the waves, and what makes it.
    """
    waves = waves_in(profile)
    if lost := int(np.sum(waves < 2.0 * spacing * (1.0 - 1e-9))):
        short = (
            f"{lost} of {waves.size} crests and troughs of the signal, in waves down to {waves.min():.3g} mm"
        )
        few = f"have less than two {samples} of {spacing:.3g} mm in a wave, which do not hold them"
        warn(f"{file}: {short}, {few}; {samples} of at most {0.25 * waves.min():.3g} mm do ({closer})")


def _turns(voltage: list[float], least: float) -> list[int]:
    """The first row and those where a voltage turns, after and before a change of at least `least` (V)."""
    found, side = [0], 0.0
    for row, now in enumerate(voltage):
        change = now - voltage[found[-1]]
        if side * change > 0.0:
            found[-1] = row
        elif abs(change) >= least and change != 0.0:
            found.append(row)
            side = change
    return found


def _over_position(position: Any, values: Any, told: tuple[str, str, str, str]) -> tuple[Any, Any]:
    """Checked rows of a table over the position: positions in mm, and values by their key, name and unit;
    the last of `told` is at fault where there are not equally many.
    """
    key, name, unit, both = told
    position = numbers("position", position, "a list of positions in mm")
    values = numbers(key, values, f"a list of {name} in {unit}")
    if position.size == 0 or position.size != values.size:
        sizes = f"{position.size} positions and {values.size} {name}"
        raise InputError(both, sizes, f"equally many positions and {name}, at least one")
    if position.size > MOST_ROWS:
        raise InputError("position", f"{position.size} rows", f"at most {MOST_ROWS} rows")
    for one, found, of in (("position", position, "mm"), (key, values, unit)):
        if np.abs(found).max() > LARGEST:
            given = f"{found[np.argmax(np.abs(found))]:g}"
            raise InputError(one, given, f"numbers within {LARGEST:g} {of}")
    falls = np.flatnonzero(np.diff(position) < 0)
    if falls.size:
        row = int(falls[0])
        given = f"{position[row]} followed by {position[row + 1]}"
        raise InputError("position", given, "positions in mm that never fall")
    return position, values


@dataclass(frozen=True)
class FollowForce:
    """A voltage that is not given but found: whatever makes the friction force on the bone follow a target.

    `position` (mm) and `tangential_force` (N/mm, on the bone) are a table along the slide, in the
    plane along x, linear between its rows; during slides the effective voltage stays between 0 and
    `largest_voltage` (V), elsewhere it stays as it is. A force out of reach is followed as nearly as
    possible; the column `missed_force` and a warning tell it. For `Scene(voltage=...)`.

    >>> FollowForce([0.0, 1.0], [0.0, 0.02], largest_voltage=2000.0)(0.5)
    0.01
    """

    position: Annotated[Any, _POSITION, "of the bone, along the slide"]
    tangential_force: Annotated[Any, _FORCE, "on the bone at these positions, linear in between"]
    largest_voltage: Annotated[float, _LARGEST, "up to which it is sought"] = 10_000.0
    kind = "follow_force"

    def __post_init__(self) -> None:
        check_fields(self)
        told = ("tangential_force", "forces", "N/mm", "tangential_force")
        position, force = _over_position(self.position, self.tangential_force, told)
        set_frozen(self, position=position, tangential_force=force)

    def __call__(self, position: Values) -> Values:
        """Wished force in N/mm at `position` in mm."""
        return to_python(
            piecewise_linear(self.position, self.tangential_force, _at_jumps(self.position, position))
        )


#: kinds of voltages in a file that are found
FOUND: Mapping[str, Any] = {FollowForce.kind: FollowForce}


def carrier_amplitude(effective: Values) -> Values:
    """Amplitude in V of a sinusoidal carrier with the mean attraction of the `effective` voltage: sqrt(2) U.

    >>> round(carrier_amplitude(1000.0), 3)
    1414.214
    """
    return to_python(np.sqrt(2.0) * np.asarray(effective))


@dataclass(frozen=True)
class Amplifier:
    """What a display's amplifier can do: `voltage_max` in V, effective (200 V of peak are 141 under a sine),
    and, if given, `slew` in V/s (of the profile).

    Under an alternating voltage it also has a `largest_current` (effective, A) and a `slew_rate` (V/s, of the
    voltage of the moment) at the frequencies of its `load`, as `evfem.electrical_impedance` finds it.

    >>> Amplifier(voltage_max=200.0).limit(VoltageProfile([0.0, 4.0], [0.0, 400.0])).voltage.tolist()
    [0.0, 200.0, 200.0]
    >>> jump = VoltageProfile([0.0, 1.0, 1.0, 9.0], [0.0, 0.0, 100.0, 100.0])
    >>> slow = Amplifier(voltage_max=200.0, slew=500.0).limit(jump, speed=10.0)
    >>> slow.position.tolist(), slow.voltage.tolist()
    ([0.0, 1.0, 3.0, 9.0], [0.0, 0.0, 100.0, 100.0])
    """

    voltage_max: float
    slew: float | None = None
    largest_current: float | None = None
    slew_rate: float | None = None
    load: Any = None

    def __post_init__(self) -> None:
        above("voltage_max", self.voltage_max, 0.0, "a voltage in V above zero")
        if self.slew is not None:
            above("slew", self.slew, 0.0, "a rate in V/s above zero, or None")
        for key, value, unit in (
            ("largest_current", self.largest_current, "A"),
            ("slew_rate", self.slew_rate, "V/s"),
        ):
            if value is not None:
                above(key, value, 0.0, f"a number in {unit} above zero, or None")
        if self.load is not None:
            self._loaded()

    def _loaded(self) -> Any:
        """The load. Raises InputError where there is none in ohm."""
        if getattr(self.load, "unit", None) != "ohm":
            given = ABSENT if self.load is None else f"{type(self.load).__name__}, not in ohm"
            allowed = "what evfem.electrical_impedance finds of a finger in space, or of one with a depth"
            raise InputError("load", given, allowed)
        return self.load

    @property
    def limits(self) -> dict[str, float]:
        """Largest effective voltage (V) by the name of each limit. Raises InputError for a current or a rate
        without a load.
        """
        found = {"voltage_max": self.voltage_max}
        if self.largest_current is not None:
            found["largest_current"] = self.largest_current * float(np.abs(self._loaded().impedance).min())
        if self.slew_rate is not None:
            swing = float(carrier_amplitude(2.0 * np.pi * self._loaded().frequency.max()))
            found["slew_rate"] = self.slew_rate / swing
        return found

    def stops(self, profile: VoltageProfile, speed: float | None = None) -> str:
        """The names of the limits that act on a profile at `speed` (mm/s): the one that cuts it off, then
        `slew` where what is left is steeper, with a comma in between; empty if none does.
        """
        name = min(self.limits, key=lambda one: self.limits[one])
        found = [name] if np.abs(profile.voltage).max() > self.limits[name] else []
        if self.slew is not None and speed is not None:
            fastest = self._clipped(profile).steepest() * speed
            found += ["slew"] if fastest > self.slew * (1.0 + 1e-9) else []
        return ", ".join(found)

    def limit(self, profile: VoltageProfile, speed: float | None = None) -> VoltageProfile:
        """The profile cut off at the smallest of its `limits`, then followed no faster than `slew` at `speed`
        (mm/s), both exactly: with rows where it crosses the limit or catches up, which may be behind its last
        row. Raises InputError for a slew without a speed.
        """
        cut = self._clipped(profile)
        if self.slew is None:
            return cut
        if speed is None:
            raise InputError("speed", ABSENT, "a speed in mm/s, needed with a slew")
        return _no_steeper(cut, self.slew / above("speed", speed, 0.0, "a speed in mm/s above zero"))

    def _clipped(self, profile: VoltageProfile) -> VoltageProfile:
        x, u, most = profile.position, profile.voltage, min(self.limits.values())
        row = np.arange(x.size)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (np.array([[-most], [most]]) - u[:-1]) / np.diff(u)
        at = np.sort(np.append(row, (row[:-1] + share)[(share > 0.0) & (share < 1.0)]))
        return VoltageProfile(np.interp(at, row, x), np.clip(np.interp(at, row, u), -most, most))


def _no_steeper(profile: VoltageProfile, steepest: float) -> VoltageProfile:
    """The profile from its first row on, with its slope limited to `steepest` (V/mm); behind its last
    position it goes on to the last voltage, which holds there.
    """
    now = float(profile.voltage[0])
    rows = [(float(profile.position[0]), now)]
    for i in np.flatnonzero(np.diff(profile.position) > 0):
        (x, end), (target, last) = profile.position[i : i + 2], profile.voltage[i : i + 2]
        slope, lag = (last - target) / (end - x), now - target
        side = np.sign(lag)
        closing = steepest + side * slope
        if lag != 0.0 and abs(lag) >= closing * (end - x):  # never catches up on this piece
            now -= side * steepest * (end - x)
        else:
            if lag != 0.0:
                x += abs(lag) / closing
                now = target + abs(lag) / closing * slope
                rows.append((x, now))
            now = last if abs(slope) <= steepest else now + np.sign(slope) * steepest * (end - x)
        rows.append((end, now))
    return VoltageProfile(*np.array([*rows, *_settled(*rows[-1], profile, steepest)]).T)


def _settled(x: float, now: float, profile: VoltageProfile, steepest: float) -> list[tuple[float, float]]:
    """The row behind `x` (mm) where `now` (V) has come to the last voltage of the profile, none where it is
    there to rounding; at the largest position at most.
    """
    lag = float(profile.voltage[-1]) - now
    if abs(lag) <= 1e-12 * np.abs(profile.voltage).max():
        return []
    way = min(abs(lag) / steepest, LARGEST - x)
    return [(x + way, now + np.sign(lag) * min(steepest * way, abs(lag)))] if way > 0.0 else []

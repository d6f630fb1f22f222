r"""Voltage signals in files: csv, 16-bit WAV, friction map and MPEG haptics; all but the map are read back.

A WAV runs over time, a signal over position; the sliding speed turns one into the other. What a
file needs to be understood (volts of the largest sample, speed, first position) stands in its own
comment. Units: V, mm, mm/s, Hz.

**MPEG haptics** have friction over position in the JSON interchange file `.hjif` of ISO/IEC 23090-31:2025.

Names, types and limits follow MPEG's reference software, which is public under a BSD licence:
repository MPEGGroup/HapticReferenceSoftware, `source/IOHaptics/src/IOJson.cpp` and `source/Types`,
commit 2de9ff1. It counts friction among the spatial modalities, whose positions are lengths in
units of 10^unit_exponent m, and plays every band in ticks of 1 / timescale s. Here a tick is both:
one unit of length, and the time the finger needs for it.
"""

from __future__ import annotations

import io
import json
import re
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from evfem.circuit.signals import VoltageProfile, carrier_amplitude, mean_squares, warn_of_waves
from evfem.common.arrays import Floats
from evfem.common.checks import Within, among, check_fields, count, number, real, set_frozen
from evfem.common.storage import replacing, write_text
from evfem.common.tables import MOST_ROWS, names_of
from evfem.electrostatics import wav
from evfem.electrostatics.timesignals import Sampled
from evfem.errors import ABSENT, InputError, describe_value, readable

MAP_FORM = "evfem-friction-map-1"
MOST_COLUMNS, ROWS = 100_000, 64
#: what a friction perception of a .hjif says of its coefficients
FRICTIONS = re.compile(r"coefficient, (\S+) to (\S+),")


def _coefficients(key: str, entry: Any) -> tuple[float, float]:
    allowed = "two friction coefficients, at 0 V and at full scale, the second one larger"
    if not isinstance(entry, (tuple, list)) or len(entry) != 2:
        raise InputError(key, entry, allowed)
    natural = real(key, entry[0], allowed, lambda mu: mu >= 0.0)
    return natural, real(key, entry[1], allowed, lambda mu: mu > natural)


def _bits(key: str, value: Any) -> int:
    if value not in wav.LARGEST or isinstance(value, (bool, float)):
        raise InputError(key, describe_value(value), " | ".join(map(str, wav.LARGEST)))
    return int(value)


def _above(what: str) -> dict[str, Any]:
    """Rule of a number above zero."""
    return number(f"{what} above zero", Within(0.0, above=True))


#: what a file needs of a `Playback`
SPEED, NEEDED_FRICTION = "a speed in mm/s", "two friction coefficients, at 0 V and at full scale"
NEEDED = {".wav": {"speed": SPEED}, ".hjif": {"speed": SPEED, "friction": NEEDED_FRICTION}}


@dataclass(frozen=True)
class Playback:
    """What turns volts over millimetres into a file for a device: the scale, and how the finger slides.

    `full_scale` (V) is the largest voltage the file can hold; `speed` (mm/s) is needed for .wav and .hjif;
    `friction`, the coefficients at 0 V and at `full_scale`, for .hjif. `rate` (Hz) is the WAV's, `carrier`
    (Hz) modulates it: a sine of amplitude `carrier_amplitude(U)`, which attracts like the effective U; a
    .hjif names it. `pixel` (mm) is the width of a column of the friction map. A WAV has `bits` (16, 24 or 32)
    and perhaps a `second` channel: the "negative" of the first, for two amplifiers in opposition, or a
    "trigger", full scale for the first millisecond.

    >>> Playback(full_scale=2000.0, speed=-1.0)
    Traceback (most recent call last):
    evfem.errors.InputError: speed: given -1.0; allowed: a speed in mm/s above zero
    """

    full_scale: Annotated[float, _above("a voltage in V")]
    speed: Annotated[float | None, _above("a speed in mm/s")] = None
    friction: Annotated[tuple[float, float] | None, {"check": _coefficients}] = None
    rate: Annotated[int, {"check": count}] = 48_000
    carrier: float | None = None
    pixel: Annotated[float, _above("a width in mm")] = 0.1
    bits: Annotated[int, {"check": _bits}] = 16
    second: Annotated[str | None, among(wav.SECOND)] = None

    def __post_init__(self) -> None:
        check_fields(self)
        if self.carrier is not None:
            allowed = f"a frequency in Hz above 0 and below half the rate of {self.rate} Hz"
            set_frozen(
                self, carrier=real("carrier", self.carrier, allowed, lambda f: 0.0 < f < self.rate / 2)
            )


def write_signal(path: str | Path, profile: VoltageProfile, playback: Playback | None = None) -> None:
    """Write `profile` to `path` in one step; the suffix sets the format.

    - `.csv`: position,voltage, to the last bit; needs no `playback`.
    - `.wav`: PCM; sample k is the voltage at the first position + k speed / rate, rounded to full_scale /
      32767 (of 16 bit). Full scale, speed and first position stand in the comment (LIST/INFO/ICMT, JSON).
    - `.png`: friction map, 8-bit grey, columns along the slide: 0 natural friction, 255 that at full scale.
      It is 255 (U / full_scale)^2, as attraction grows with U^2: its mean over each column. The scale
      stands in the text chunk Comment (JSON), the size of a pixel in pHYs.
    - `.hjif`: MPEG haptics, see `haptics`.

    Waves with less than two samples, pixels or ticks, which do not hold them, are warned of.

    Parameters
    ----------
    path
        The file; its ending decides the format.
    profile
        The voltage (V) over the position (mm).
    playback
        Full scale, speed and rate of the device.

    Raises
    ------
    InputError
        Another ending, a profile without length, a voltage above full scale, or a value missing in
        `playback`.
    StorageError
        The file cannot be written.

    Examples
    --------
    >>> slope = VoltageProfile([0.0, 5.0, 10.0], [0.0, 1500.0, 1500.0])
    >>> write_signal("slope.wav", slope, Playback(full_scale=2000.0, speed=20.0, rate=8000))
    >>> back = read_signal("slope.wav")
    >>> float(abs(back(back.position) - slope(back.position)).max()) < 0.5 * 2000.0 / 32767
    True
    """
    if not isinstance(profile, VoltageProfile):
        raise InputError("profile", describe_value(profile), "a VoltageProfile")
    ending = Path(path).suffix.lower()
    if ending not in (".csv", ".wav", ".png", ".hjif"):
        raise InputError("path", str(path), "a file called .csv, .wav, .png or .hjif")
    if playback is not None:
        largest = float(np.max(np.abs(profile.voltage)))
        if largest > playback.full_scale:
            raise _too_much(f"{largest:g} V", playback)
    if ending == ".csv":
        profile.to_csv(path)
        return
    for key, what in ({"full_scale": "a voltage in V"} | NEEDED.get(ending, {})).items():
        if getattr(playback, key, None) is None:
            raise InputError(key, ABSENT, f"{what}, needed for {ending}")
    assert playback is not None
    if ending != ".wav" and (playback.bits, playback.second) != (16, None):
        raise InputError("path", str(path), "a file called .wav for bits or a second channel")
    if not np.ptp(profile.position) > 0.0:
        raise InputError("profile", f"{profile.position.size} rows at one position", "a signal with a length")
    if ending == ".hjif":
        scale: Any = playback.full_scale, playback.speed, playback.friction, playback.carrier
        write_text(path, json.dumps(haptics(profile, *scale), separators=(",", ":")) + "\n")
    else:
        data = _wav(profile, playback) if ending == ".wav" else _map(profile, playback)
        with replacing(path) as temporary:
            temporary.write_bytes(data)
    warn_of_waves(Path(path).name, profile, *_spaced(ending, profile, playback))


def _spaced(ending: str, profile: VoltageProfile, playback: Playback) -> tuple[float, str, str]:
    """Distance (mm) of the samples of a file, their name, and how they become closer."""
    if ending == ".png":
        return playback.pixel, "pixels", "a smaller `pixel`"
    speed = playback.speed or 0.0
    if ending == ".wav":
        return speed / playback.rate, "samples", f"a `rate` above {playback.rate} Hz, or a slower slide"
    return 10.0 ** (ticks(float(np.ptp(profile.position)), speed)[0] + 3), "ticks", "a shorter signal"


def read_signal(path: str | Path) -> VoltageProfile:
    """Read a voltage over the position.

    Parameters
    ----------
    path
        A `.wav` or `.hjif` of `write_signal`, or a csv file (any other ending).

    Returns
    -------
    VoltageProfile
        From a WAV a row per sample: the voltage within half a step (full_scale / 32767) at the
        samples, linear in between, so that a jump takes speed / rate mm. From a `.hjif` a row per
        keyframe: the magnitude that makes its friction, within 1 % of full scale.

    Raises
    ------
    InputError
        A `.png`, missing, cut off or foreign file, more than 1,000,000 rows, or a WAV with a
        carrier, whose samples are not the effective voltage.
    """
    ending = Path(path).suffix.lower()
    if ending == ".wav":
        return _from_wav(Path(path))
    if ending == ".hjif":
        return _from_hjif(Path(path))
    if ending == ".png":
        raise InputError("path", str(path), "a csv file, .wav or .hjif: a map does not keep the signal")
    return VoltageProfile.from_csv(path)


def read_voltage(path: str | Path) -> VoltageProfile | Sampled:
    """The voltage in a file: over time (csv with the header ``time,voltage``), else over the position."""
    path = Path(path)
    if path.suffix.lower() not in (".wav", ".hjif", ".png") and names_of(path)[:1] == ["time"]:
        return Sampled.from_csv(path)
    return read_signal(path)


def _too_much(problem: str, playback: Playback) -> InputError:
    return InputError("voltage", problem, f"at most the full scale of {playback.full_scale:g} V")


def _positions(number: int, start: float, spacing: float) -> Floats:
    """Positions of the samples, bitwise the same when written and when read."""
    with np.errstate(over="ignore"):  # infinite positions in a damaged file are refused by the profile
        return np.asarray(start + spacing * np.arange(number), dtype=np.float64)


def _number(profile: VoltageProfile, spacing: float, most: int, what: str) -> int:
    """Number of spacings that cover the profile."""
    number = float(np.ptp(profile.position)) / spacing
    if number > most:
        raise InputError("path", f"a file of {number:.3g} {what}", f"at most {most} of them")
    return max(int(np.ceil(number - 1e-9)), 1)


def _wav(profile: VoltageProfile, playback: Playback) -> bytes:
    assert playback.speed is not None
    spacing, start = playback.speed / playback.rate, float(profile.position[0])
    number = _number(profile, spacing, wav.MOST_SAMPLES - 1, "samples") + 1
    volts = profile(_positions(number, start, spacing))
    if playback.carrier is not None:
        volts = carrier_amplitude(volts)
        if np.max(np.abs(volts)) > playback.full_scale:
            raise _too_much(f"{np.max(np.abs(volts)):g} V at the carrier's peaks", playback)
        volts = volts * np.sin(2.0 * np.pi * playback.carrier / playback.rate * np.arange(number))
    scale: dict[str, Any] = {
        "full_scale_V": playback.full_scale,
        "speed_mm_per_s": playback.speed,
        "start_mm": start,
        "carrier_Hz": playback.carrier,
    }
    if playback.bits != 16:
        scale["bits"] = playback.bits
    if playback.second is not None:
        scale["second"] = playback.second
    return wav.encoded(volts / playback.full_scale, playback.rate, scale)


def _from_wav(path: Path) -> VoltageProfile:
    allowed = f"a WAV with evfem's comment ({wav.FORM}) in it"
    rate, samples, scale = wav.read(path, "path", allowed)
    if not scale or samples.dtype.kind != "i":
        raise InputError("path", f"{path}, of another kind or without the comment", allowed)
    if scale["carrier_Hz"] is not None:
        problem = f"{path}, with a carrier of {str(scale['carrier_Hz'])[:20]} Hz"
        allowed = "a WAV without a carrier, or Sampled.from_wav: its samples are the voltage of the moment"
        raise InputError("path", problem, allowed)
    if samples.size > MOST_ROWS:  # before they take four times the memory
        raise InputError("path", f"{path} with {samples.size} samples", f"at most {MOST_ROWS} of them")
    try:
        full_scale = _above("a voltage in V")["check"]("full_scale_V", scale["full_scale_V"])
        speed = _above(SPEED)["check"]("speed_mm_per_s", scale["speed_mm_per_s"])
        start = real("start_mm", scale["start_mm"], "a position in mm")
    except InputError as error:
        problem = f"{path}, whose {error.key} is {readable(error.given)}"
        raise InputError("path", problem, error.allowed) from None
    position = _positions(samples.size, start, speed / rate)
    return VoltageProfile(position, wav.normalised_samples(samples, scale.get("bits", 0)) * full_scale)


def _from_hjif(path: Path) -> VoltageProfile:
    position, friction, told = wav.read_friction(path)
    allowed = "a .hjif with the largest voltage and the friction without it, as evfem writes it"
    try:
        full_scale = float(told["reference_devices"][0]["maximum_voltage"])
        ((natural, largest),) = (map(float, pair) for pair in FRICTIONS.findall(told["description"]))
        with np.errstate(over="ignore"):
            fraction = (friction - natural) / (largest - natural)
        voltage = full_scale * np.sqrt(np.clip(fraction, 0.0, 1.0))
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, ZeroDivisionError):
        raise InputError("path", f"{path.name}, without them", allowed) from None
    return VoltageProfile(position, voltage)


def _map(profile: VoltageProfile, playback: Playback) -> bytes:
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    columns = _number(profile, playback.pixel, MOST_COLUMNS, "columns")
    start = float(profile.position[0])
    squares = mean_squares(profile, _positions(columns + 1, start, playback.pixel))
    fraction = np.minimum(squares / playback.full_scale**2, 1.0)
    grey = np.rint(255.0 * fraction).astype(np.uint8)
    natural, largest = playback.friction or (None, None)
    scale = {
        "format": MAP_FORM,
        "grey": "255 (U / full scale)^2, mean over a pixel: 0 natural friction, 255 friction at full scale",
        "full_scale_V": playback.full_scale,
        "pixel_mm": playback.pixel,
        "start_mm": start,
        "natural_friction": natural,
        "largest_friction": largest,
    }
    text, file = PngInfo(), io.BytesIO()
    text.add_text("Software", "evfem")
    text.add_text("Comment", json.dumps(scale))
    dots = min(max(25.4 / playback.pixel, 0.0254), 5e7)  # an inch; the file counts them in a metre
    picture = Image.fromarray(np.tile(grey, (ROWS, 1)))
    picture.save(file, "PNG", pnginfo=text, dpi=(dots, dots), compress_level=9)
    return file.getvalue()


#: limits of the main profile and of its binary twin: ticks per second, and ticks from the first keyframe on
MOST_TICKS_PER_SECOND, LAST_TICK = 48_000, 65_535
#: a tick is at most this share of the speed wrong, because ticks per second are whole
ROUNDING = 0.01
#: straight pieces stay this close to the parabola of friction over voltage, as a fraction of what is added
CHORD = 1e-4
#: ids 1 and up name avatars; 0 is none
NO_AVATAR, ANY_BODY_PART = 0, 0


def ticks(length: float, speed: float) -> tuple[int, int]:
    """Unit exponent and ticks per second for `length` (mm) passed at `speed` (mm/s): the finest that fit.

    >>> ticks(length=10.0, speed=20.0)  # micrometres
    (-6, 20000)

    The ticks per second are whole, so that time can be 1 % off, in signals of minutes; InputError
    where it would be more.
    """
    for exponent in range(-12, 1):
        unit = 10.0 ** (exponent + 3)
        per_second = round(min(speed / unit, MOST_TICKS_PER_SECOND + 1))
        if per_second <= MOST_TICKS_PER_SECOND and length / unit <= LAST_TICK - 1:
            if abs(per_second * unit - speed) <= ROUNDING * speed:
                return exponent, per_second
            break
    problem = f"{speed:g} mm/s over {length:g} mm"
    raise InputError("speed", problem, "a speed that passes the signal in ticks of a power of ten in metres")


def haptics(
    profile: VoltageProfile,
    full_scale: float,
    speed: float,
    friction: tuple[float, float],
    carrier: float | None = None,
) -> dict[str, Any]:
    r"""The file as Python objects: one friction perception with one curve band.

    .. math:: \mu(x) = \mu_0 + (\mu_1 - \mu_0) (U(x) / U_{full})^2

    `friction` is (mu_0, mu_1): the display's own coefficient, and that at `full_scale` volts,
    because attraction grows with the square of the voltage. A keyframe's amplitude times the
    channel's gain is mu; the `carrier` (Hz) of the display stands in the description. `profile`
    has a length, `speed` is in mm/s; `signalfile.write_signal` checks all this.

    >>> file = haptics(VoltageProfile([0.0, 10.0], [0.0, 2000.0]), 2000.0, 20.0, (0.5, 0.6))
    >>> channel = file["perceptions"][0]["channels"][0]
    >>> last = channel["bands"][0]["effects"][0]["keyframes"][-1]
    >>> last, last["relative_position"] / file["timescale"], channel["gain"]
    ({'relative_position': 10000, 'amplitude_modulation': 1.0}, 0.5, 0.6)
    """
    start, length = float(profile.position[0]), float(np.ptp(profile.position))
    exponent, timescale = ticks(length, speed)
    unit = 10.0 ** (exponent + 3)
    tick_times = _keyframes(profile, full_scale, unit)
    # on the later side of a jump, whatever the last bit of the position says
    fraction = (profile(start + (tick_times + 1e-6) * unit) / full_scale) ** 2
    natural, largest = friction
    amplitude = (natural + (largest - natural) * np.minimum(fraction, 1.0)) / largest
    keyframes = [
        {"relative_position": tick, "amplitude_modulation": round(value, 9)}
        for tick, value in zip(tick_times.tolist(), amplitude.tolist(), strict=True)
    ]
    band = {
        "band_type": "Curve",
        "curve_type": "Linear",
        "lower_frequency_limit": 0,
        "upper_frequency_limit": timescale // 2,
        "effects": [{"effect_type": "Basis", "position": 0, "keyframes": keyframes}],
    }
    perception = {
        "id": 0,
        "avatar_id": NO_AVATAR,
        "description": f"friction coefficient, {natural!r} to {largest!r}, over the position",
        "perception_modality": "Friction",
        "unit_exponent": exponent,
        "perception_unit_exponent": 0,
        "reference_devices": [
            {"id": 0, "name": "electrovibration display", "maximum_voltage": full_scale, "type": "Unknown"}
        ],
        "effect_library": [],
        "channels": [_channel(largest, band)],
    }
    on = "" if carrier is None else f", on a carrier of {carrier!r} Hz"
    return {
        "version": "2025",
        "profile": "Main",
        "level": 1,
        "date": date.today().isoformat(),
        "description": f"evfem: from {start!r} mm at {speed!r} mm/s, {full_scale!r} V full scale{on}",
        "timescale": timescale,
        "avatars": [],
        "perceptions": [perception],
        "syncs": [],
    }


def _channel(gain: float, band: dict[str, Any]) -> dict[str, Any]:
    return {
        "id": 0,
        "description": "finger pad",
        "gain": gain,
        "mixing_coefficient": 1.0,
        "body_part_mask": ANY_BODY_PART,
        "reference_device_id": 0,
        "bands": [band],
    }


def _keyframes(profile: VoltageProfile, full_scale: float, unit: float) -> Floats:
    """Ticks (n,), rising, between which friction is straight enough; a jump takes one tick."""
    tick_times = (profile.position - profile.position[0]) / unit
    jumps = tick_times[1:][np.diff(tick_times) == 0.0]
    rise = np.abs(np.diff(profile.voltage)) / full_scale
    pieces = np.maximum(np.ceil(rise / np.sqrt(4.0 * CHORD)), 1.0).astype(int)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    between = np.repeat(tick_times[:-1], pieces) + number * np.repeat(np.diff(tick_times) / pieces, pieces)
    last = np.ceil(tick_times[-1])
    # the middle: the reference software leaves out a curve of two keyframes
    parts = [
        np.floor(tick_times),
        np.ceil(tick_times),
        np.floor(jumps) - 1.0,
        np.rint(between),
        [last // 2.0],
    ]
    return np.unique(np.clip(np.concatenate(parts), 0.0, last)).astype(np.int64)

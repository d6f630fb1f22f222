"""WAV files with the scale of their samples in a comment; haptic patterns (AHAP, `.haptic`, Android's) and
MPEG haptics (.hjif) of other programs are read.

evfem writes PCM, and in the chunk LIST/INFO/ICMT a JSON text with the full scale in volts, the speed, the
first position and the carrier. scipy reads WAVs of any sample width (24 bits as 32, of which the lowest 8 are
0) but ignores comments, which are therefore written and read here.
"""

from __future__ import annotations

import io
import json
import re
import struct
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import above
from evfem.common.notices import warn
from evfem.common.tables import MOST_ROWS, read_bytes
from evfem.errors import ABSENT, InputError

FORM = "evfem-voltage-1"
#: fraction of a sample that counts as rounding of a time
EDGE = 1e-6
KEYS = {"full_scale_V", "speed_mm_per_s", "start_mm", "carrier_Hz"}
#: bits of a sample -> the largest one
LARGEST = {16: 2**15 - 1, 24: 2**23 - 1, 32: 2**31 - 1}
MOST_SAMPLES = 50_000_000
MOST_PATTERN = 1_000_000
#: events of an AHAP that are felt; parameters that shape them, and the value that does not
HAPTIC = ("HapticTransient", "HapticContinuous")
ENVELOPE = {"AttackTime": 0.0, "DecayTime": 0.0, "ReleaseTime": 0.0, "Sustained": 1.0}
PATTERN = "a haptic pattern: AHAP, .haptic of Meta, a waveform of Android (.xml, .json)"
#: start (s), end (s) and intensity; time (s) and intensity
Event = tuple[float, float, float]
Point = tuple[float, float]
#: comment and headers of a file on top of its samples
MOST_BYTES = 2 * MOST_SAMPLES + 1_000_000
#: exponent of a .hjif's unit of length (m) where it has none; straight pieces of a cubic
MILLIMETRE, PIECES = -3, 64
#: the first position in the description of a .hjif
FROM = re.compile(r"from (\S+) mm")


def encoded(fractions: Floats, rate: int, scale: dict[str, Any]) -> bytes:
    """A WAV of samples (n,) from -1 to 1 with the comment `scale`, which has the keys `KEYS`, and where they
    are not 16 and none the `bits` of a sample and what the `second` channel has (`SECOND`).
    """
    comment = json.dumps({"format": FORM, **scale}).encode("ascii") + b"\0"
    channels, bits = [fractions], scale.get("bits", 16)
    if "second" in scale:
        channels.append(SECOND[scale["second"]](fractions, rate))
    whole = np.rint(np.column_stack(channels) * LARGEST[bits]).astype("<i4")
    data = whole.view(np.uint8).reshape(-1, 4)[:, : bits // 8].tobytes()
    block = len(channels) * bits // 8
    header = struct.pack("<HHIIHH", 1, len(channels), rate, block * rate, block, bits)
    body = _riff_chunk(b"fmt ", header) + _riff_chunk(b"LIST", b"INFO" + _riff_chunk(b"ICMT", comment))
    return _riff_chunk(b"RIFF", b"WAVE" + body + _riff_chunk(b"data", data))


def _trigger(fractions: Floats, rate: int) -> Floats:
    """The largest sample for a millisecond from the start, then 0."""
    return (np.arange(fractions.size) < max(round(1e-3 * rate), 1)).astype(float)


#: what a second channel has
SECOND: dict[str, Callable[[Floats, int], Floats]] = {
    "negative": lambda fractions, rate: -fractions,
    "trigger": _trigger,
}


def _riff_chunk(name: bytes, content: bytes) -> bytes:
    """A RIFF chunk, padded to an even length."""
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)


def read(
    path: Path, key: str, allowed: str = "a WAV with one channel", *, several: bool = False
) -> tuple[int, Any, dict[str, Any]]:
    """Rate (Hz), samples as they are stored, and what evfem's comment says, {} without one; of
    `several` channels, if they are wanted, a column each.

    Raises InputError for a file that is missing, too long, cut off or of another kind.
    """
    from scipy.io import wavfile

    data = read_bytes(path, key, allowed, MOST_BYTES, f"at most {MOST_SAMPLES} samples")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # chunks that scipy does not know
            warnings.filterwarnings("error", "Reached EOF prematurely")
            rate, samples = wavfile.read(io.BytesIO(data))
    except Exception:  # whatever scipy raises for a damaged file
        raise InputError(key, f"{path.name}, cut off or of another kind", allowed) from None
    if scale := _comment(data):
        scale |= _stored_bits(data)
    if samples.ndim == 2 and "second" in scale:
        samples = samples[:, 0]
    if samples.ndim > 1 + several or samples.size == 0 or rate <= 0:
        raise InputError(key, f"{path.name}, with several channels or no samples", allowed)
    return int(rate), samples, scale


def _comment(data: bytes) -> dict[str, Any]:
    with suppress(ValueError, KeyError, TypeError, struct.error, RecursionError):
        at = data.index(b"ICMT")
        (size,) = struct.unpack_from("<I", data, at + 4)
        scale = json.loads(data[at + 8 : at + 8 + size].rstrip(b"\0"))
        if scale["format"] == FORM and set(scale) >= KEYS:
            return dict(scale)
    return {}


def _stored_bits(data: bytes) -> dict[str, int]:
    """The bits of a sample by the file itself: a converter keeps evfem's comment, and changes them."""
    at = data.find(b"fmt ")
    return {"bits": struct.unpack_from("<H", data, at + 22)[0]} if 0 <= at <= len(data) - 24 else {}


def normalised_samples(samples: Any, bits: int = 0) -> Floats:
    """Samples of any width as fractions of the largest one, -1 to 1; 24 `bits` are those above 8 zeros."""
    if bits == 24 and samples.dtype.kind == "i":
        return np.asarray(samples / (256.0 * LARGEST[24]))
    if samples.dtype.kind == "f":
        return np.asarray(samples, dtype=float)
    if samples.dtype.kind == "u":  # 8 bit, around 128
        return (samples.astype(float) - 128.0) / 127.0
    return np.asarray(samples / float(np.iinfo(samples.dtype).max))


def voltages(path: Path, key: str, full_scale: float | None) -> tuple[int, Floats]:
    """Rate (Hz) and voltages (n,) in V of a WAV with one channel, by `full_scale` (V) or evfem's comment;
    floats beyond 1.0, which is full scale, are kept and warned of.
    """
    rate, samples, scale = read(path, key)
    if samples.size > MOST_ROWS:
        raise InputError(key, f"{path} with {samples.size} samples", f"at most {MOST_ROWS} of them")
    if full_scale is None and not scale:
        needed = "the voltage of the largest sample, 1.0 of floats, in V, for a WAV that evfem did not write"
        raise InputError("full_scale", ABSENT, needed)
    given = scale["full_scale_V"] if full_scale is None else full_scale
    volts = above("full_scale", given, 0.0, "a voltage in V above zero")
    found = normalised_samples(samples, scale.get("bits", 0))
    beyond = np.abs(found)[np.abs(found) > 1.0]
    if samples.dtype.kind == "f" and beyond.size:
        many = f"{beyond.size} of {found.size} samples are beyond 1.0, which is full scale"
        warn(f"{path.name}: {many}, and make up to {volts * beyond.max():.6g} V")
    return rate, np.asarray(volts * found)


@contextmanager
def _parsed(path: Path, key: str, allowed: str) -> Iterator[Any]:
    """What a JSON or an Android's XML holds; InputError where it cannot be read, or lacks what is looked for
    inside.
    """
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES)
        yield _entries(data, path, key) if path.suffix.lower() == ".xml" else json.loads(data)
    except InputError:
        raise
    except OSError as error:
        raise InputError(key, f"{path.name} ({error.strerror or error})", allowed) from None
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError, SyntaxError):
        raise InputError(key, f"{path.name}, of another kind or damaged", allowed) from None


def intensity(path: Path, key: str, rate: float, tap: float) -> Floats:
    """Intensity (n,), 0 to 1, of a haptic pattern at `rate` (Hz) from time 0 on: at every moment that of its
    strongest event. Sharpness, frequency and audio are left out; a transient event, which has no
    duration, lasts `tap` s.

    - AHAP (JSON): times the value that its HapticIntensityControl then has.
    - Meta's `.haptic`, version 1 (JSON; `core/datamodel` of Lofelt's NiceVibrations, which Meta published):
      the amplitude between its breakpoints, from 0 at time 0; the emphasis of one is a transient event.
    - Waveforms of Android, `VibrationEffect.createWaveform`: XML, or JSON with its arguments.

    It is 0 from its end on. Events and crests between two samples, which do not hold them, are warned of.
    Raises InputError for a file that is missing, damaged, without events, with envelopes of events, parts
    that the device makes or that repeat, or longer than 1,000,000 samples.
    """
    with _parsed(path, key, PATTERN) as whole:
        events, points, controls = _pattern(whole, path, key, tap)
        ends = [*(end for _, end, _ in events), *(time for time, _ in points)]
        size = _sample(max(ends), rate) + 1
    if not 1 < size <= MOST_PATTERN:
        raise InputError(key, f"{path.name} with {size} samples", f"2 to {MOST_PATTERN} samples")
    time = np.arange(size) / rate
    found = np.interp(time, *np.array(points).T) if points else np.zeros(size)
    found[_sample(points[-1][0], rate) if points else size :] = 0.0
    for start, end, strength in events:
        inside = slice(_sample(start, rate), _sample(end, rate))
        found[inside] = np.maximum(found[inside], strength)
    _warn_of_lost(path.name, events, points, rate)
    return np.asarray(found * _control(controls, time))


def _sample(time: float, rate: float) -> int:
    """The first sample at a time (s) or after it, to rounding; from 0 on."""
    return max(int(np.ceil(time * rate - EDGE)), 0)


def _warn_of_lost(name: str, events: list[Event], points: list[Point], rate: float) -> None:
    """A warning where samples at `rate` (Hz) have nothing of an event, or less than half of a crest."""
    acting = [(start, end) for start, end, strength in events if strength > 0.0 and 0.0 <= start < end]
    short = [end - start for start, end in acting if _sample(start, rate) == _sample(end, rate)]
    if len(points) > 2:
        time, value = np.array(points).T
        beside = (np.interp(side(time * rate) / rate, time, value) for side in (np.floor, np.ceil))
        crests = (value > 2.0 * np.maximum(*beside))[1:-1]
        short += (0.5 * (time[2:] - time[:-2])[crests]).tolist()
    if short:
        lost = f"{len(short)} events or crests last less than a sample of {1e3 / rate:.4g} ms and are lost"
        warn(f"{name}: {lost}; a rate of {np.ceil(1.0 / max(min(short), 1e-9) - EDGE):.10g} Hz holds them")


def _pattern(whole: Any, path: Path, key: str, tap: float) -> tuple[list[Event], list[Point], list[Any]]:
    """Events, points of an amplitude that is straight in between, and those of an AHAP's controls."""
    if "timings" in whole:
        return _waveform(whole, path, key), [], []
    if "signals" in whole:
        if (version := whole["version"]["major"]) != 1:
            raise InputError(key, f"{path.name}, of version {version}", "a .haptic of version 1")
        return *_amplitude(whole["signals"]["continuous"]["envelopes"]["amplitude"], tap), []
    _check_envelopes(whole["Pattern"], path, key)
    events = [_event(one["Event"], tap) for one in whole["Pattern"] if "Event" in one]
    controls = [one.get("ParameterCurve") or one.get("Parameter") or {} for one in whole["Pattern"]]
    rows = [_points(one) for one in controls if one.get("ParameterID") == "HapticIntensityControl"]
    return [one for one in events if one[2] > 0.0], [], rows


def _amplitude(rows: list[dict[str, Any]], tap: float) -> tuple[list[Event], list[Point]]:
    """Emphases and breakpoints of a `.haptic`; ValueError for falling times, amplitudes beyond 0 to 1."""
    points = [(float(row["time"]), float(row["amplitude"])) for row in rows]
    strong = [
        (row["emphasis"], time) for row, (time, _) in zip(rows, points, strict=True) if row.get("emphasis")
    ]
    events = [(time, time + tap, float(one["amplitude"])) for one, time in strong]
    times = np.array([0.0, *(time for time, _ in points)])
    values = np.array([*(value for _, value in points), *(value for *_, value in events)])
    if not points or (np.diff(times) < 0.0).any() or not ((values >= 0.0) & (values <= 1.0)).all():
        raise ValueError("breakpoints")
    return events, points if points[0][0] == 0.0 else [(0.0, 0.0), *points]


def _waveform(told: dict[str, Any], path: Path, key: str) -> list[Event]:
    """Steps of a waveform of Android: durations (ms) and amplitudes, 0 to 255; without these off and on."""
    if told.get("repeat", -1) != -1:
        raise InputError(key, f"{path.name}, which repeats", "a waveform that ends")
    ends = np.cumsum([float(one) for one in told["timings"]]) / 1e3
    levels = told.get("amplitudes", [255 * (i % 2) for i in range(len(ends))])
    if any(level in (-1, "default") for level in levels):
        raise InputError(key, f"{path.name}, with the device's default amplitude", "amplitudes from 0 to 255")
    strength = np.array([float(level) for level in levels]) / 255.0
    if (np.diff(ends, prepend=0.0) < 0.0).any() or not ((strength >= 0.0) & (strength <= 1.0)).all():
        raise ValueError("timings and amplitudes")
    return list(zip([0.0, *ends[:-1].tolist()], ends.tolist(), strength.tolist(), strict=True))


def _entries(data: bytes, path: Path, key: str) -> dict[str, Any]:
    """The timings and amplitudes in an XML of Android."""
    from xml.etree import ElementTree

    if any(sign in data for sign in (b"<!DOCTYPE", b"<!ENTITY", b"\0")):
        raise ValueError("a document type")
    root = ElementTree.fromstring(data)  # its errors are SyntaxErrors
    others = [one.tag for one in root if one.tag != "waveform-effect"]
    if root.tag not in ("vibration-effect", "vibration"):
        raise ValueError(root.tag)
    if others:
        problem = f"{path.name}, with {others[0][:40]}, whose course the device makes"
        raise InputError(key, problem, "a waveform-effect alone")
    (wave,) = root
    entries = wave.findall("waveform-entry")
    told: dict[str, Any] = {} if wave.find("repeating") is None else {"repeat": len(entries)}
    names = {"timings": "durationMs", "amplitudes": "amplitude"}
    return told | {to: [one.attrib[name] for one in entries] for to, name in names.items()}


def _event(event: dict[str, Any], tap: float) -> tuple[float, float, float]:
    """Start (s), end (s) and intensity of a haptic event; 0 of any other."""
    start = float(event["Time"])
    if event["EventType"] not in HAPTIC:
        return start, start, 0.0
    lasts = tap if event["EventType"] == "HapticTransient" else float(event["EventDuration"])
    return start, start + lasts, float(np.clip(_own(event).get("HapticIntensity", 1.0), 0.0, 1.0))


def _own(event: dict[str, Any]) -> dict[str, float]:
    """Parameters of an event by their names."""
    return {one["ParameterID"]: float(one["ParameterValue"]) for one in event.get("EventParameters", ())}


def _check_envelopes(pattern: list[dict[str, Any]], path: Path, key: str) -> None:
    """InputError for a haptic event that rises, decays or fades: Apple draws its course, without numbers."""
    events = [one["Event"] for one in pattern if one.get("Event", {}).get("EventType") in HAPTIC]
    changed = [(name, value) for event in events for name, value in _own(event).items()]
    for chunk in pattern:
        control = chunk.get("ParameterCurve") or chunk.get("Parameter") or {}
        name = str(control.get("ParameterID")).removeprefix("Haptic").removesuffix("Control")
        changed += [(name, float(value)) for _, value in _points(control)] if name in ENVELOPE else []
    found = [name for name, value in changed if value != ENVELOPE.get(name, value)]
    if found:
        allowed = (
            "events without an envelope; HapticIntensityControl, a ParameterCurve, says the same in numbers"
        )
        raise InputError(key, f"{path.name}, with {found[0]} of an event", allowed)


def _points(control: dict[str, Any]) -> list[tuple[float, float]]:
    """Times (s) and values of a parameter, one, or of a parameter curve."""
    rows = control.get("ParameterCurveControlPoints", ())
    if "ParameterValue" in control:
        rows = [{"Time": 0.0, "ParameterValue": control["ParameterValue"]}]
    start = float(control["Time"]) if rows else 0.0
    points = [(start + float(row["Time"]), float(row["ParameterValue"])) for row in rows]
    return sorted(points, key=lambda point: point[0])


def _control(rows: list[list[Point]], time: Floats) -> Floats:
    """What all intensities are multiplied with: 1, until a value or a curve, straight between its points,
    replaces what was in force; the last point holds until the next one begins.
    """
    found = np.ones_like(time)
    for points in sorted(filter(None, rows), key=lambda points: points[0][0]):
        places, values = np.array(points).T
        later = time >= places[0]
        found[later] = np.interp(time[later], places, values)
    return np.clip(found, 0.0, 1.0)


def read_friction(path: Path) -> tuple[Floats, Floats, dict[str, Any]]:
    """Places (n,) in mm and coefficients (n,) of the first friction perception of a `.hjif`, and all that it
    says of that perception, with the number of `others` after it.

    As MPEG's reference software plays it (`source/Types`: `Effect::EvaluateKeyframes`): places count from the
    effect's position, exponents are -3 (mm) and 0 where there are none, and cubic pieces are level at their
    ends. Raises InputError for a file without one, or one that is not a curve over a length.
    """
    allowed = "a .hjif with a friction perception: a curve of two or more keyframes over a length"
    with _parsed(path, "path", allowed) as whole, np.errstate(all="ignore"):
        (told, *more) = (one for one in whole["perceptions"] if one["perception_modality"] == "Friction")
        channel, band, effect = _curve(told, path, allowed)
        frames = [frame for frame in effect["keyframes"] if "amplitude_modulation" in frame]
        ticks, fraction = (
            np.array([float(frame[name]) for frame in frames])
            for name in ("relative_position", "amplitude_modulation")
        )
        if ticks.size < 2 or not (np.diff(ticks) > 0.0).all():
            raise ValueError("keyframes")
        if band["curve_type"] == "Cubic":
            ticks, fraction = _smooth(ticks, fraction)
        found = FROM.search(str(whole.get("description")))
        start = float(found.group(1)) if found else 0.0
        ticks = ticks + float(effect["position"])
        position = start + ticks * 10.0 ** (int(told.get("unit_exponent", MILLIMETRE)) + 3)
        friction = float(channel["gain"]) * 10.0 ** int(told.get("perception_unit_exponent", 0)) * fraction
        if not (np.diff(position) > 0.0).all() or not np.isfinite([position, friction]).all():
            raise ValueError("keyframes")
    return position, friction, {**told, "others": len(more)}


def _curve(told: dict[str, Any], path: Path, allowed: str) -> tuple[dict[str, Any], ...]:
    """The only channel, band and effect of a perception; InputError that names what else is there."""

    def only(of: dict[str, Any], name: str) -> dict[str, Any]:
        if len(of[name]) != 1:
            raise InputError(
                "path", f"{path.name}, with {len(of[name])} {name} of friction", f"{allowed}, one of each"
            )
        found: dict[str, Any] = of[name][0]
        return found

    channel = only(told, "channels")
    band = only(channel, "bands")
    effect = only(band, "effects")
    curve = band.get("curve_type") if band["band_type"] == "Curve" else band["band_type"]
    if curve not in ("Linear", "Cubic"):
        what = f"a band of the type {band['band_type']}, curve {band.get('curve_type')}"
        raise InputError("path", f"{path.name}, with {what}", f"{allowed}, Linear or Cubic")
    if effect["effect_type"] != "Basis":
        problem = f"{path.name}, with an effect of the type {effect['effect_type']}"
        raise InputError("path", problem, f"{allowed} of its own, Basis")
    return channel, band, effect


def _smooth(ticks: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Rows on the cubics between keyframes, whose slope is 0 there; each straight to 2e-4 of its rise."""
    share = np.arange(PIECES) / PIECES
    rise = share**2 * (3.0 - 2.0 * share)
    places, found = (
        np.append((a[:-1, None] + np.diff(a)[:, None] * part).ravel(), a[-1])
        for a, part in ((ticks, share), (values, rise))
    )
    return places, found

"""WAV files: chunks, and the comment in which evfem says what a sample means.

A WAV is a RIFF file: chunks of a name of four letters, a length and a content. evfem writes 16 bit,
one channel, and in LIST/INFO/ICMT a JSON text with the volts of the largest sample, the speed, the
first position and the carrier. Other WAVs are read too, of any width, where only the samples are
asked for.
"""

from __future__ import annotations

import io
import json
import struct
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.errors import InputError

FORM = "evfem-voltage-1"
KEYS = {"full_scale_V", "speed_mm_per_s", "start_mm", "carrier_Hz"}
LARGEST_SAMPLE = 32_767
MOST_SAMPLES = 50_000_000
#: comment and headers of a file on top of its samples
MOST_BYTES = 2 * MOST_SAMPLES + 1_000_000
PCM, MONO, BITS = 1, 1, 16
ALLOWED = f"a 16-bit mono WAV with evfem's comment ({FORM}) in it"


def encoded(samples: Any, rate: int, scale: dict[str, Any]) -> bytes:
    """A WAV of 16-bit samples with the comment `scale`, which has the keys `KEYS`."""
    comment = json.dumps({"format": FORM, **scale}).encode("ascii") + b"\0"
    width = MONO * BITS // 8
    header = struct.pack("<HHIIHH", PCM, MONO, rate, rate * width, width, BITS)
    body = _part(b"fmt ", header) + _part(b"LIST", b"INFO" + _part(b"ICMT", comment))
    return _part(b"RIFF", b"WAVE" + body + _part(b"data", samples.astype("<i2").tobytes()))


def read_bytes(path: Path, allowed: str = ALLOWED) -> bytes:
    """The bytes of a file that is not too long."""
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise InputError("path", f"{path} ({error.strerror or error})", allowed) from None
    if len(data) > MOST_BYTES:
        raise InputError("path", f"{path}, which is too long", f"at most {MOST_SAMPLES} samples")
    return data


def decoded(data: bytes) -> tuple[int, dict[str, Any], Any]:
    """Rate, what the comment says, and samples of a file that evfem wrote; ValueError for anything
    else.
    """
    try:
        parts = _parts_of(data)
        kind, channels, rate, _, _, bits = struct.unpack_from("<HHIIHH", parts[b"fmt "])
        if (kind, channels, bits) != (PCM, MONO, BITS) or rate == 0:
            raise ValueError("another kind of WAV")
        scale = _comment(parts)
        samples = np.frombuffer(parts[b"data"], dtype="<i2")
    except (KeyError, TypeError, struct.error, RecursionError) as error:
        raise ValueError(str(error)) from error
    if samples.size == 0:
        raise ValueError("no samples")
    return rate, scale, samples


def full_scale(data: bytes) -> float | None:
    """The volts of the largest sample that evfem's comment names; None without the comment."""
    try:
        return float(_comment(_parts_of(data))["full_scale_V"])
    except (ValueError, KeyError, TypeError, struct.error, RecursionError):
        return None


def shares(data: bytes) -> tuple[int, Floats]:
    """Rate (Hz) and samples (-1 to 1) of any WAV with one channel; ValueError for anything else."""
    from scipy.io import wavfile

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # chunks that scipy does not know
            rate, samples = wavfile.read(io.BytesIO(data))
    except Exception as error:  # whatever scipy raises for a damaged file
        raise ValueError(str(error)) from error
    if samples.ndim != 1 or samples.size == 0 or rate <= 0:
        raise ValueError("several channels, or no samples")
    if samples.dtype.kind == "f":
        return int(rate), samples.astype(float)
    if samples.dtype.kind == "u":  # 8 bit, around 128
        return int(rate), (samples.astype(float) - 128.0) / 127.0
    return int(rate), samples / float(np.iinfo(samples.dtype).max)


def _part(name: bytes, content: bytes) -> bytes:
    """A RIFF chunk, padded to an even length."""
    return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)


def _parts(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """The chunks in `data`; ValueError for one that is longer than what is there."""
    at = 0
    while at + 8 <= len(data):
        (size,) = struct.unpack_from("<I", data, at + 4)
        content = data[at + 8 : at + 8 + size]
        if len(content) < size:
            raise ValueError("cut off")
        yield data[at : at + 4], content
        at += 8 + size + size % 2


def _parts_of(data: bytes) -> dict[bytes, bytes]:
    """The chunks of a whole WAV by name."""
    ((name, body),) = _parts(data)
    if name != b"RIFF" or body[:4] != b"WAVE":
        raise ValueError("not a WAV")
    return dict(_parts(body[4:]))


def _comment(parts: dict[bytes, bytes]) -> dict[str, Any]:
    """What evfem's comment says; ValueError or KeyError without it."""
    if parts[b"LIST"][:4] != b"INFO":
        raise ValueError("another kind of WAV")
    scale = json.loads(dict(_parts(parts[b"LIST"][4:]))[b"ICMT"].rstrip(b"\0"))
    if scale["format"] != FORM or not set(scale) >= KEYS:
        raise ValueError("another comment")
    return scale

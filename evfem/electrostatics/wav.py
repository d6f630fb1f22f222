"""WAV files, and the comment in which evfem says what a sample means.

evfem writes 16 bit, one channel, and in LIST/INFO/ICMT a JSON text with the volts of the largest
sample, the speed, the first position and the carrier. scipy reads WAVs of any width; it knows no
comments, which are therefore written and found here.
"""

from __future__ import annotations

import io
import json
import struct
import warnings
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.tables import read_bytes
from evfem.errors import InputError

FORM = "evfem-voltage-1"
KEYS = {"full_scale_V", "speed_mm_per_s", "start_mm", "carrier_Hz"}
LARGEST_SAMPLE = 32_767
MOST_SAMPLES = 50_000_000
#: comment and headers of a file on top of its samples
MOST_BYTES = 2 * MOST_SAMPLES + 1_000_000


def encoded(samples: Any, rate: int, scale: dict[str, Any]) -> bytes:
    """A WAV of 16-bit samples with the comment `scale`, which has the keys `KEYS`."""
    comment = json.dumps({"format": FORM, **scale}).encode("ascii") + b"\0"
    header = struct.pack("<HHIIHH", 1, 1, rate, 2 * rate, 2, 16)
    body = _part(b"fmt ", header) + _part(b"LIST", b"INFO" + _part(b"ICMT", comment))
    return _part(b"RIFF", b"WAVE" + body + _part(b"data", samples.astype("<i2").tobytes()))


def _part(name: bytes, content: bytes) -> bytes:
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
    if samples.ndim > 1 + several or samples.size == 0 or rate <= 0:
        raise InputError(key, f"{path.name}, with several channels or no samples", allowed)
    return int(rate), samples, _comment(data)


def _comment(data: bytes) -> dict[str, Any]:
    with suppress(ValueError, KeyError, TypeError, struct.error, RecursionError):
        at = data.index(b"ICMT")
        (size,) = struct.unpack_from("<I", data, at + 4)
        scale = json.loads(data[at + 8 : at + 8 + size].rstrip(b"\0"))
        if scale["format"] == FORM and set(scale) >= KEYS:
            return dict(scale)
    return {}


def shares(samples: Any) -> Floats:
    """Samples of any width as shares of the largest one, -1 to 1."""
    if samples.dtype.kind == "f":
        return np.asarray(samples, dtype=float)
    if samples.dtype.kind == "u":  # 8 bit, around 128
        return (samples.astype(float) - 128.0) / 127.0
    return np.asarray(samples / float(np.iinfo(samples.dtype).max))

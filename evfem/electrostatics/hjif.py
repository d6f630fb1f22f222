"""Friction over position as MPEG haptics: the JSON interchange file `.hjif` of ISO/IEC
23090-31:2025.

Names, types and limits follow MPEG's reference software, which is public under a BSD licence:
repository MPEGGroup/HapticReferenceSoftware, `source/IOHaptics/src/IOJson.cpp` and `source/Types`,
commit 2de9ff1. It counts friction among the spatial modalities, whose positions are lengths in
units of 10^unit_exponent m, and plays every band in ticks of 1 / timescale s. Here a tick is both:
one unit of length, and the time the finger needs for it.
"""

from __future__ import annotations

from datetime import date
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.electrostatics.signals import VoltageProfile
from evfem.errors import InputError

#: limits of the main profile and of its binary twin: ticks per second, and ticks from the first keyframe on
MOST_TICKS_PER_SECOND, LAST_TICK = 48_000, 65_535
#: a tick is at most this share of the speed wrong, because ticks per second are whole
ROUNDING = 0.01
#: straight pieces stay this close to the parabola of friction over voltage, as a share of what is added
CHORD = 1e-4
#: ids 1 and up name avatars; 0 is none
NO_AVATAR, ANY_BODY_PART = 0, 0


def ticks(length: float, speed: float) -> tuple[int, int]:
    """Unit exponent and ticks per second for `length` (mm) passed at `speed` (mm/s): the finest
    that fit.

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
    given = f"{speed:g} mm/s over {length:g} mm"
    raise InputError("speed", given, "a speed that passes the signal in ticks of a power of ten in metres")


def document(
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

    >>> file = document(VoltageProfile([0.0, 10.0], [0.0, 2000.0]), 2000.0, 20.0, (0.5, 0.6))
    >>> channel = file["perceptions"][0]["channels"][0]
    >>> last = channel["bands"][0]["effects"][0]["keyframes"][-1]
    >>> last, last["relative_position"] / file["timescale"], channel["gain"]
    ({'relative_position': 10000, 'amplitude_modulation': 1.0}, 0.5, 0.6)
    """
    start, length = float(profile.position[0]), float(np.ptp(profile.position))
    exponent, timescale = ticks(length, speed)
    unit = 10.0 ** (exponent + 3)
    place = _keyframes(profile, full_scale, unit)
    # on the later side of a jump, whatever the last bit of the position says
    share = (profile(start + (place + 1e-6) * unit) / full_scale) ** 2
    natural, largest = friction
    amplitude = (natural + (largest - natural) * np.minimum(share, 1.0)) / largest
    keyframes = [
        {"relative_position": tick, "amplitude_modulation": round(value, 9)}
        for tick, value in zip(place.tolist(), amplitude.tolist(), strict=True)
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
        "description": f"friction coefficient, {natural:g} to {largest:g}, over the position",
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
    place = (profile.position - profile.position[0]) / unit
    jumps = place[1:][np.diff(place) == 0.0]
    rise = np.abs(np.diff(profile.voltage)) / full_scale
    pieces = np.maximum(np.ceil(rise / np.sqrt(4.0 * CHORD)), 1.0).astype(int)
    number = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    between = np.repeat(place[:-1], pieces) + number * np.repeat(np.diff(place) / pieces, pieces)
    last = np.ceil(place[-1])
    # the middle: the reference software leaves out a curve of two keyframes
    parts = [np.floor(place), np.ceil(place), np.floor(jumps) - 1.0, np.rint(between), [last // 2.0]]
    return np.unique(np.clip(np.concatenate(parts), 0.0, last)).astype(np.int64)

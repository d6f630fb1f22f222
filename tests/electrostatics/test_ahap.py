"""Haptic patterns (AHAP, JSON of Apple's Core Haptics) as voltages: intensities by hand."""

import json

import numpy as np
import pytest

import evfem as ev
from evfem.errors import InputError

# structure and names: developer.apple.com/documentation/corehaptics, "Representing haptic patterns in AHAP
# files"
CONTINUOUS = {
    "EventType": "HapticContinuous",
    "Time": 0.1,
    "EventDuration": 0.4,
    "EventParameters": [
        {"ParameterID": "HapticIntensity", "ParameterValue": 0.64},
        {"ParameterID": "HapticSharpness", "ParameterValue": 0.5},
    ],
}
TAP = {"EventType": "HapticTransient", "Time": 0.2, "EventParameters": []}
AUDIO = {"EventType": "AudioCustom", "Time": 0.0, "EventDuration": 9.0}
CURVE = {
    "ParameterID": "HapticIntensityControl",
    "Time": 0.3,
    "ParameterCurveControlPoints": [
        {"Time": 0.0, "ParameterValue": 1.0},
        {"Time": 0.2, "ParameterValue": 0.0},
    ],
}


def pattern(path, *parts):
    path.write_text(json.dumps({"Version": 1.0, "Pattern": list(parts)}))
    return path


def test_the_voltage_is_the_root_of_the_intensity(tmp_path):
    parts = ({"Event": CONTINUOUS}, {"Event": TAP}, {"Event": AUDIO}, {"ParameterCurve": CURVE})
    found = ev.Sampled.from_ahap(pattern(tmp_path / "a.ahap", *parts), 100.0, rate=1000.0, tap=0.02)
    # before; 0.64 of the continuous event; 1 of the tap; 0.64 times 0.5 halfway down the curve
    assert found(np.array([0.05, 0.15, 0.21])).tolist() == [0.0, 80.0, 100.0]
    assert found(0.4) == pytest.approx(100.0 * np.sqrt(0.32), rel=1e-9)
    assert (found.voltage.size, found.rate) == (501, 1000.0)
    later = {"Parameter": {"ParameterID": "HapticIntensityControl", "ParameterValue": 0.25, "Time": 0.3}}
    found = ev.Sampled.from_ahap(pattern(tmp_path / "a.ahap", {"Event": CONTINUOUS}, later), 100.0)
    assert [found(0.2), found(0.4)] == pytest.approx([80.0, 40.0])


def test_what_is_no_pattern_gets_a_sentence(tmp_path):
    path = tmp_path / "a.ahap"
    for text in ("", "[]", '{"Pattern": [{"Event": {"Time": 0}}]}', '{"Pattern": []}', '{"Pattern": 3}'):
        path.write_text(text)
        with pytest.raises(InputError, match=r"a\.ahap, of another kind or damaged; allowed: an AHAP file"):
            ev.Sampled.from_ahap(path, 100.0)
    pattern(path, {"Event": CONTINUOUS | {"EventDuration": 1e9}})
    with pytest.raises(InputError, match="allowed: 2 to 1000000 samples"):
        ev.Sampled.from_ahap(path, 100.0)
    with pytest.raises(InputError, match="full_scale: given -1"):
        ev.Sampled.from_ahap(path, -1.0)
    with pytest.raises(InputError, match="No such file"):
        ev.Sampled.from_ahap(tmp_path / "none.ahap", 1.0)

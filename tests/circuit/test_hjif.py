"""Friction as MPEG haptics and as AHAP: the published structures, and the friction that is in them."""

import json
import re

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.circuit import signalfile
from evfem.circuit.encoding import AreaLaw, Encoding
from evfem.circuit.signalfile import Playback, write_signal
from evfem.circuit.signals import VoltageProfile
from evfem.electrostatics import wav
from evfem.electrostatics.laws import Kaczmarek, Layer, Layers
from evfem.errors import InputError
from evfem.textures.importers import Haptics

JUMP = VoltageProfile([1.0, 3.5, 6.0, 6.0, 11.0], [0.0, 2000.0, 500.0, 1500.0, -1500.0])
DEVICE = Playback(full_scale=2000.0, speed=20.0, friction=(0.5, 0.6))


# The structure of .hjif: fields, types and limits as MPEG's reference software reads and checks them. It is
# public under a BSD licence: MPEGGroup/HapticReferenceSoftware at 2de9ff1, source/IOHaptics/src/IOJson.cpp
# (loadFile and what it calls), the names of the kinds in source/Types/include, bits of the binary twin in
# source/IOHaptics/include/IOBinaryFields.h. MPEG's own JSON schema is not public; the ISO text was not used.
NUMBER = (int, float)
PERCEPTION = {
    "id": int,
    "avatar_id": int,
    "description": str,
    "perception_modality": str,
    "unit_exponent": int,
    "perception_unit_exponent": int,
    "reference_devices": list,
    "effect_library": list,
    "channels": list,
}
EXPERIENCE = {
    "version": str,
    "profile": str,
    "level": int,
    "date": str,
    "description": str,
    "timescale": int,
    "avatars": list,
    "perceptions": list,
    "syncs": list,
}
CHANNEL = {
    "id": int,
    "description": str,
    "gain": NUMBER,
    "mixing_coefficient": NUMBER,
    "body_part_mask": int,
    "reference_device_id": int,
    "bands": list,
}
BAND = {
    "band_type": str,
    "curve_type": str,
    "lower_frequency_limit": int,
    "upper_frequency_limit": int,
    "effects": list,
}
DEVICE_FIELDS = {"id": int, "name": str, "maximum_voltage": NUMBER, "type": str}
EFFECT = {"effect_type": str, "position": int, "keyframes": list}
KEYFRAME = {"relative_position": int, "amplitude_modulation": NUMBER}
CURVES = ("Unknown", "Cubic", "Linear", "Akima", "Bezier", "Bspline")
ACTUATORS = ("Unknown", "LRA", "VCA", "ERM", "Piezo")


def fits(thing, fields):
    """An object with just these fields, of these types (true is no number in JSON)."""
    assert set(thing) == set(fields)
    for name, kind in fields.items():
        assert isinstance(thing[name], kind), name
        assert not isinstance(thing[name], bool), name
    return thing


def check_structure(file):
    fits(file, EXPERIENCE)
    assert re.fullmatch(r"[0-9]{4}(-[1-9])?", file["version"])
    assert int(file["version"][:4]) >= 2023
    assert file["profile"] == "Main"  # the other profile has no friction
    assert file["level"] in (1, 2)
    assert re.fullmatch(r"[0-9]{4}-[01][0-9]-[0-3][0-9]", file["date"])
    assert 0 < file["timescale"] <= 48_000
    assert len(file["description"].encode()) < 256
    avatars = {avatar["id"] for avatar in file["avatars"]} | {0}
    for perception in file["perceptions"]:
        fits(perception, PERCEPTION)
        assert perception["perception_modality"] == "Friction"
        assert perception["avatar_id"] in avatars
        assert -128 <= perception["unit_exponent"] < 128
        assert len(perception["description"].encode()) < 256
        devices = {fits(device, DEVICE_FIELDS)["id"] for device in perception["reference_devices"]}
        assert {device["type"] for device in perception["reference_devices"]} <= set(ACTUATORS)
        assert 1 <= len(perception["channels"]) <= 127
        for channel in perception["channels"]:
            check_channel(fits(channel, CHANNEL), devices)


def check_channel(channel, devices):
    assert channel["reference_device_id"] in devices
    assert 1 <= len(channel["bands"]) <= 7
    for band in channel["bands"]:
        fits(band, BAND)
        assert band["band_type"] == "Curve"
        assert band["curve_type"] in CURVES
        assert 0 <= band["lower_frequency_limit"] <= band["upper_frequency_limit"] < 2**16
        for effect in band["effects"]:
            fits(effect, EFFECT)
            assert effect["effect_type"] == "Basis"
            assert 0 <= effect["position"] < 2**25
            frames = [fits(frame, KEYFRAME) for frame in effect["keyframes"]]
            places = np.array([frame["relative_position"] for frame in frames])
            assert 3 <= len(frames) < 2**16  # the software's synthesizer leaves out a curve of two
            assert np.all(np.diff(places) > 0)
            assert 0 <= places[0] <= places[-1] < 2**16
            assert all(-1.0 <= frame["amplitude_modulation"] <= 1.0 for frame in frames)


def curve_of(file):
    """Times in s, places in mm and coefficients of friction of the only curve in a file."""
    (perception,) = file["perceptions"]
    (channel,) = perception["channels"]
    (band,) = channel["bands"]
    (effect,) = band["effects"]
    ticks = np.array([frame["relative_position"] for frame in effect["keyframes"]])
    amplitude = np.array([frame["amplitude_modulation"] for frame in effect["keyframes"]])
    mu = amplitude * channel["gain"] * 10.0 ** perception["perception_unit_exponent"]
    return ticks / file["timescale"], ticks * 10.0 ** (perception["unit_exponent"] + 3), mu


def test_mpeg_haptics_has_the_published_structure_and_the_friction(tmp_path):
    path = tmp_path / "tone.hjif"
    write_signal(path, JUMP, DEVICE)
    file = json.loads(path.read_text(encoding="utf-8"))
    check_structure(file)
    time, place, mu = curve_of(file)
    (band,) = file["perceptions"][0]["channels"][0]["bands"]
    assert band["curve_type"] == "Linear"
    assert band["upper_frequency_limit"] == file["timescale"] / 2  # two samples for a period
    assert time[-1] == 0.5  # 10 mm at 20 mm/s
    assert place[-1] == pytest.approx(10.0, rel=1e-12)
    np.testing.assert_allclose(place, 20.0 * time, rtol=1e-12)
    x = np.linspace(0.0, 10.0, 4001)
    wish = 0.5 + 0.1 * (JUMP(1.0 + x) / 2000.0) ** 2
    off = np.abs(np.interp(x, place, mu) - wish)
    assert np.max(off[np.abs(x - 5.0) > 0.001]) < 1.1e-5  # a 1e-4th of the 0.1 that is added, and rounding
    # the jump takes one micrometre: 0.50625 just before 5 mm, 0.55625 from there on
    np.testing.assert_allclose(np.interp([4.999, 5.0], place, mu), [0.50625, 0.55625], atol=1e-4)


def test_the_coefficient_at_full_scale_comes_from_an_encoding():
    layers = Layers.of(Layer(0.20, 1650.0), Layer(0.09, 3.35))
    display = Encoding(Kaczmarek(), layers, AreaLaw(112.0), friction=0.5)
    top = display.tangential_force(0.5, 2000.0) / 0.5
    profile = VoltageProfile([0.0, 10.0], [0.0, 1776.73])
    _, _, mu = curve_of(signalfile.haptics(profile, 2000.0, 20.0, (0.5, top)))
    assert mu[-1] == pytest.approx(0.6, abs=1e-6)  # 1776.73 V feels like 0.6: the example of Encoding
    assert mu[0] == pytest.approx(0.5, rel=1e-9)


def test_ticks_are_the_finest_that_fit():
    assert signalfile.ticks(10.0, 20.0) == (-6, 20_000)
    assert signalfile.ticks(10.0, 48.1) == (-5, 4810)  # 48100 micrometres a second are more than 48000
    assert signalfile.ticks(70.0, 20.0) == (-5, 2000)  # 70000 micrometres are more than 16 bits hold
    assert signalfile.ticks(10.0, 12.34567) == (-6, 12_346)
    refuses(r"speed: given 0.014 mm/s over 500 mm", signalfile.ticks, 500.0, 0.014)


def test_the_carrier_stands_in_the_description():
    profile = VoltageProfile([0.0, 10.0], [0.0, 2000.0])
    given = (profile, 2000.0, 20.0, (0.5, 0.6))
    assert "carrier of 10000.0 Hz" in signalfile.haptics(*given, 10_000.0)["description"]
    assert "carrier" not in signalfile.haptics(*given)["description"]


def test_what_is_written_is_read_back_but_for_the_sign(tmp_path):
    """Friction is straight between keyframes: the squared voltage is right to a share of 1e-4 of that at full
    scale (`CHORD`), but for the tick that a jump takes.
    """
    path = tmp_path / "a.hjif"
    write_signal(path, JUMP, Playback(full_scale=2000.0, speed=20.0, friction=(1.0 / 3.0, 0.6)))
    back = signalfile.read_signal(path)
    x = np.linspace(1.0, 11.0, 4001)
    x = x[np.abs(x - 6.0) > 0.01]
    assert (back.position[0], back.position[-1]) == (1.0, pytest.approx(11.0))
    assert np.abs(back(x) ** 2 - JUMP(x) ** 2).max() < 1.1e-4 * 2000.0**2
    assert back.voltage.min() >= 0.0
    path.write_text(json.dumps(json.loads(path.read_text()) | {"description": "without a start"}))
    assert signalfile.read_signal(path).position[0] == 0.0
    texture = Haptics(licence="CC0-1.0")(path)
    share = (JUMP(x) / 2000.0) ** 2
    friction = 1.0 / 3.0 + (0.6 - 1.0 / 3.0) * share
    np.testing.assert_allclose(np.interp(x - 1.0, texture.x, texture.values), friction, atol=4e-5)
    assert texture.quantity == "friction"


def test_files_of_others_are_textures_or_get_a_sentence(tmp_path):
    """A friction perception without a voltage is a texture and no signal."""
    path = tmp_path / "a.hjif"
    write_signal(path, JUMP, DEVICE)
    file = json.loads(path.read_text())
    (perception,) = file["perceptions"]
    del perception["reference_devices"][0]["maximum_voltage"]
    perception["perception_modality"] = "Vibration"
    other = json.loads(json.dumps(perception)) | {"perception_modality": "Friction", "unit_exponent": -5}
    path.write_text(json.dumps(file | {"perceptions": [perception, other]}))
    refuses(r"a\.hjif, without them; allowed: a \.hjif with the largest", signalfile.read_signal, path)
    assert Haptics(licence="CC0-1.0")(path).length == pytest.approx(100.0)  # ten times as long
    path.write_text(json.dumps(file | {"perceptions": [other, perception, other, other]}))
    assert Haptics(licence="CC0-1.0")(path).provenance[-1].endswith(", the first of 3.")
    for text in ("", "[]", json.dumps(file | {"perceptions": [perception]}), '{"perceptions": [3]}'):
        path.write_text(text)
        refuses(r"path: given a\.hjif, of another kind or damaged; allowed: a", signalfile.read_signal, path)
    refuses("No such file", signalfile.read_signal, tmp_path / "none.hjif")


def changed(path, **at):
    """A file of 0.5 to 0.6 over 10 mm with other values in its perception, channel, band or effect."""
    file = signalfile.haptics(VoltageProfile([0.0, 10.0], [0.0, 2000.0]), 2000.0, 20.0, (0.5, 0.6))
    (perception,) = file["perceptions"]
    (channel,) = perception["channels"]
    (band,) = channel["bands"]
    (effect,) = band["effects"]
    places = {"perception": perception, "channel": channel, "band": band, "effect": effect}
    for name, values in at.items():
        places[name] |= values
        for key in [key for key, value in values.items() if value is None]:
            del places[name][key]
    path.write_text(json.dumps(file))
    return path


FRAMES = [{"relative_position": 10 * k, "amplitude_modulation": v} for k, v in enumerate((0.0, 1.0, 0.5))]


def test_exponents_positions_and_cubics_are_those_of_the_reference_software(tmp_path):
    """`Effect::EvaluateKeyframes` of MPEG's reference software, by its formula at places of its own."""
    path = tmp_path / "a.hjif"
    found = Haptics(licence="CC0-1.0")(changed(path, perception={"perception_unit_exponent": -1}))
    assert found.values.max() == pytest.approx(0.06)
    assert (
        Haptics(licence="CC0-1.0")(changed(path, perception={"perception_unit_exponent": None})).values[-1]
        == 0.6
    )
    whole = {"perception": {"unit_exponent": None}, "effect": {"position": 5, "keyframes": FRAMES}}
    place, friction, _ = wav.read_friction(changed(path, **whole))
    assert (place.tolist(), friction.tolist()) == ([5.0, 15.0, 25.0], [0.0, 0.6, 0.3])  # mm
    place, friction, _ = wav.read_friction(changed(path, band={"curve_type": "Cubic"}, **whole))
    for t, (t0, f0, f1) in {8.0: (5.0, 0.0, 0.6), 17.5: (15.0, 0.6, 0.3)}.items():
        h = 10.0
        right = f0 + (f1 - f0) * (3.0 * h + 2.0 * (t0 - t)) * (t - t0) ** 2 / h**3
        assert np.interp(t, place, friction) == pytest.approx(right, abs=2e-4 * abs(f1 - f0))


@pytest.mark.parametrize(
    ("at", "sentence"),
    [
        ({"band": {"band_type": "WaveletWave"}}, "a band of the type WaveletWave"),
        ({"band": {"band_type": "VectorialWave"}}, "a band of the type VectorialWave"),
        ({"band": {"band_type": "Transient"}}, "a band of the type Transient"),
        ({"band": {"curve_type": "Akima"}}, "a band of the type Curve, curve Akima"),
        ({"band": {"curve_type": None}}, "a band of the type Curve, curve None"),
        ({"effect": {"effect_type": "Reference"}}, "an effect of the type Reference"),
        ({"band": {"effects": [{}, {}]}}, "2 effects of friction; allowed: .*, one of each"),
        ({"channel": {"bands": [{}, {}, {}]}}, "3 bands of friction"),
        ({"perception": {"channels": []}}, "0 channels of friction"),
    ],
)
def test_what_else_a_file_may_hold_is_refused_by_name(tmp_path, at, sentence):
    refuses(sentence, Haptics(licence="CC0-1.0"), changed(tmp_path / "a.hjif", **at))


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


def control(start, *points):
    rows = [{"Time": t, "ParameterValue": v} for t, v in points]
    own = {"ParameterID": "HapticIntensityControl", "Time": start, "ParameterCurveControlPoints": rows}
    return {"ParameterCurve": own}


def test_a_later_curve_or_value_replaces_the_one_in_force(tmp_path):
    """Apple's page of CHHapticDynamicParameter: the value "is equal to the original event parameter value
    multiplied by the dynamic parameter value", which "changes abruptly at the specified time".
    """
    whole = {"Event": {"EventType": "HapticContinuous", "Time": 0.0, "EventDuration": 2.0}}
    value = {"Parameter": {"ParameterID": "HapticIntensityControl", "ParameterValue": 0.36, "Time": 1.5}}
    # in any order; the second begins within the first, whose rest is not played
    parts = (value, control(0.8, (0.0, 0.0), (0.4, 0.64)), control(0.1, (0.1, 1.0), (0.5, 0.5), (1.0, 0.2)))
    found = ev.Sampled.from_ahap(pattern(tmp_path / "a.ahap", whole, *parts), 100.0)
    share = (found(np.array([0.1, 0.3, 0.7, 0.8, 1.0, 1.4, 1.6])) / 100.0) ** 2
    np.testing.assert_allclose(share, [1.0, 0.875, 0.44, 0.0, 0.32, 0.64, 0.36], atol=1e-9)


def test_values_beyond_their_range_are_at_its_end(tmp_path):
    """Apple's page of the format: it "clamps out-of-range values"."""
    loud = [{"ParameterID": "HapticIntensity", "ParameterValue": 2.0}]
    parts = {"Event": CONTINUOUS | {"EventParameters": loud}}, control(0.0, (0.0, 0.25))
    found = ev.Sampled.from_ahap(pattern(tmp_path / "a.ahap", *parts), 100.0)
    assert found(0.2) == pytest.approx(50.0)


def test_envelopes_are_refused_by_name(tmp_path):
    path = tmp_path / "a.ahap"

    def shaped(kind=CONTINUOUS, **values):
        own = [{"ParameterID": name, "ParameterValue": value} for name, value in values.items()]
        return pattern(path, {"Event": CONTINUOUS}, {"Event": kind | {"EventParameters": own}})

    for name, value in {"AttackTime": 0.3, "DecayTime": 0.1, "ReleaseTime": 0.5, "Sustained": 0.0}.items():
        refuses(f"a.ahap, with {name} of an event", ev.Sampled.from_ahap, shaped(**{name: value}), 1.0)
    plain = shaped(AttackTime=0.0, DecayTime=0.0, ReleaseTime=0.0, Sustained=1.0)
    assert ev.Sampled.from_ahap(plain, 1.0)(0.2) == 1.0
    assert ev.Sampled.from_ahap(shaped(AUDIO, AttackTime=0.3), 1.0)(0.2) == pytest.approx(0.8)
    later = {"Parameter": {"ParameterID": "HapticAttackTimeControl", "ParameterValue": 0.5, "Time": 0.1}}
    refuses("with AttackTime", ev.Sampled.from_ahap, pattern(path, {"Event": CONTINUOUS}, later), 1.0)


def test_what_is_no_pattern_gets_a_sentence(tmp_path):
    path = tmp_path / "a.ahap"
    for text in ("", "[]", '{"Pattern": [{"Event": {"Time": 0}}]}', '{"Pattern": []}', '{"Pattern": 3}'):
        path.write_text(text)
        with pytest.raises(
            InputError, match=r"a\.ahap, of another kind or damaged; allowed: a haptic pattern: AHAP"
        ):
            ev.Sampled.from_ahap(path, 100.0)
    pattern(path, {"Event": CONTINUOUS | {"EventDuration": 1e9}})
    refuses("allowed: 2 to 1000000 samples", ev.Sampled.from_ahap, path, 100.0)
    refuses("full_scale: given -1", ev.Sampled.from_ahap, path, -1.0)
    refuses("No such file", ev.Sampled.from_ahap, tmp_path / "none.ahap", 1.0)


@pytest.mark.parametrize("lacking", [{}, {"Time": "a"}])
def test_a_control_without_a_time_is_damaged(tmp_path, lacking):
    one = {"Parameter": {"ParameterID": "HapticIntensityControl", "ParameterValue": 0.5} | lacking}
    refuses("of another kind or damaged", ev.Sampled.from_ahap, pattern(tmp_path / "a.ahap", one), 100.0)

"""Voltage signals in files: what other readers find in them, what comes back, and what is refused."""

import contextlib
import io
import json
import re
import struct
import wave

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.io import wavfile

from evfem import cli, hjif
from evfem.electrostatics import Kaczmarek, Layer, Layers
from evfem.encoding import AreaLaw, Encoding
from evfem.errors import InputError, StorageError
from evfem.fingerpad import FingerPad
from evfem.motion import Press
from evfem.scene import Scene
from evfem.signalfile import Playback, read_signal, write_signal
from evfem.signals import VoltageProfile
from evfem.surfaces import Display

JUMP = VoltageProfile([1.0, 3.5, 6.0, 6.0, 11.0], [0.0, 2000.0, 500.0, 1500.0, -1500.0])
DEVICE = Playback(full_scale=2000.0, speed=20.0, friction=(0.5, 0.6), rate=8000)
STEP = 2000.0 / 32767


def comment_of(path):
    """The WAV's LIST/INFO/ICMT as a plain search: another way to it than the package's."""
    data = path.read_bytes()
    at = data.index(b"ICMT")
    assert data[: data.index(b"LIST")].count(b"data") == 0
    (size,) = struct.unpack_from("<I", data, at + 4)
    return json.loads(data[at + 8 : at + 8 + size].rstrip(b"\0"))


def test_other_readers_find_the_samples_of_the_wav(tmp_path):
    path = tmp_path / "tone.wav"
    write_signal(path, JUMP, DEVICE)
    rate, samples = wavfile.read(path)
    with wave.open(str(path)) as reader:
        assert (reader.getnchannels(), reader.getsampwidth(), reader.getframerate()) == (1, 2, 8000)
        assert reader.readframes(reader.getnframes()) == samples.tobytes()
    assert rate == 8000
    assert samples.dtype == np.int16
    assert samples.size == 4001  # 10 mm at 20 mm/s and 8 kHz, both ends
    # at 0.125 s the finger is at 3.5 mm, at full scale; at the end at 11 mm
    assert samples[[0, 1000, 4000]].tolist() == [0, 32767, -round(0.75 * 32767)]
    assert comment_of(path) == {
        "format": "evfem-voltage-1",
        "full_scale_V": 2000.0,
        "speed_mm_per_s": 20.0,
        "start_mm": 1.0,
        "carrier_Hz": None,
    }


def test_a_wav_comes_back_as_a_voltage_for_a_scene(tmp_path):
    write_signal(tmp_path / "tone.wav", JUMP, DEVICE)
    back = read_signal(tmp_path / "tone.wav")
    np.testing.assert_allclose(back.position, 1.0 + 20.0 / 8000 * np.arange(4001), rtol=1e-15)
    assert np.max(np.abs(back.voltage - JUMP(back.position))) <= 0.5 * STEP * (1 + 1e-12)
    assert np.max(np.abs(back.voltage - JUMP(back.position))) > 0.4 * STEP  # a step is what is said
    # between the samples: the slope is at most 800 V/mm, a kink in the middle of 2.5 um costs 1 V
    between = np.setdiff1d(np.linspace(1.0, 11.0, 30_001), back.position)
    between = between[np.abs(between - 6.0) > 20.0 / 8000]
    assert np.max(np.abs(back(between) - JUMP(between))) < 1.0 + STEP
    scene = Scene(FingerPad(), Display(), law=Kaczmarek(), voltage=back, motion=[Press(force=0.05)])
    assert scene.voltage is back


@settings(max_examples=60, deadline=None)
@given(
    rows=st.lists(st.tuples(st.floats(0.0, 1.0), st.floats(-1.0, 1.0)), min_size=2, max_size=12),
    start=st.floats(-1e3, 1e3),
    full_scale=st.floats(1e-3, 1e5),
    speed=st.floats(5.0, 500.0),
    rate=st.integers(100, 9000),
)
def test_any_signal_comes_back_within_half_a_step(tmp_path_factory, rows, start, full_scale, speed, rate):
    x = start + np.cumsum([gap for gap, _ in rows])
    if not np.ptp(x) > 0.0:
        return
    profile = VoltageProfile(x, full_scale * np.array([u for _, u in rows]))
    path = tmp_path_factory.mktemp("signal") / "any.wav"
    write_signal(path, profile, Playback(full_scale=full_scale, speed=speed, rate=rate))
    back = read_signal(path)
    step = full_scale / 32767
    assert np.max(np.abs(back.voltage - profile(back.position))) <= 0.5 * step * (1 + 1e-9)
    assert back.position[0] == x[0]
    # the last sample is at the end or at most a sample behind it
    assert -1e-9 <= back.position[-1] - x[-1] <= speed / rate + 1e-9
    again = path.with_name("again.wav")
    write_signal(again, back, Playback(full_scale=full_scale, speed=speed, rate=rate))
    samples, repeated = wavfile.read(path)[1], wavfile.read(again)[1]
    assert np.max(np.abs(samples[: repeated.size].astype(int) - repeated[: samples.size])) <= 1


def test_csv_keeps_every_bit_and_needs_no_playback(tmp_path):
    write_signal(tmp_path / "v.csv", JUMP)
    back = read_signal(tmp_path / "v.csv")
    assert back.position.tolist() == JUMP.position.tolist()
    assert back.voltage.tolist() == JUMP.voltage.tolist()


def test_a_carrier_attracts_like_the_effective_voltage(tmp_path):
    path = tmp_path / "carrier.wav"
    level = VoltageProfile([0.0, 10.0], [700.0, 700.0])
    write_signal(path, level, Playback(full_scale=1000.0, speed=20.0, rate=48_000, carrier=12_000.0))
    samples = wavfile.read(path)[1] / 32767 * 1000.0
    # 24000 samples of four a period: the mean attraction goes with the mean square
    assert np.sqrt(np.mean(samples[:-1] ** 2)) == pytest.approx(700.0, rel=1e-4)
    assert comment_of(path)["carrier_Hz"] == 12_000.0
    with pytest.raises(InputError, match="without a carrier"):
        read_signal(path)
    with pytest.raises(InputError, match=r"carrier's peaks; allowed: at most the full scale of 900 V"):
        write_signal(path, level, Playback(full_scale=900.0, speed=20.0, carrier=12_000.0))
    with pytest.raises(InputError, match="below half the rate"):
        Playback(full_scale=900.0, rate=8000, carrier=4000.0)


def test_the_friction_map_is_linear_in_friction(tmp_path):
    path = tmp_path / "map.png"
    steps = VoltageProfile([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], [0.0, 0.0, -1000.0, -1000.0, 2000.0, 2000.0])
    write_signal(path, steps, Playback(full_scale=2000.0, friction=(0.5, 0.6), pixel=0.25))
    with Image.open(path) as picture:
        picture.load()
        grey = np.asarray(picture)
        comment, dots = json.loads(picture.text["Comment"]), picture.info["dpi"]
    assert (grey.dtype, grey.shape) == (np.uint8, (64, 12))
    # half the voltage gives a quarter of the added friction: 63.75
    assert grey[0].tolist() == [0] * 4 + [64] * 4 + [255] * 4
    assert np.all(grey == grey[0])
    np.testing.assert_allclose(dots, 25.4 / 0.25, rtol=1e-12)
    assert comment.pop("grey").startswith("255 (U / full scale)^2")
    assert comment == {
        "format": "evfem-friction-map-1",
        "full_scale_V": 2000.0,
        "pixel_mm": 0.25,
        "start_mm": 0.0,
        "natural_friction": 0.5,
        "largest_friction": 0.6,
    }


def test_a_column_has_the_voltage_in_its_middle(tmp_path):
    ramp = VoltageProfile([5.0, 15.0], [0.0, 100.0])
    write_signal(tmp_path / "map.png", ramp, Playback(full_scale=100.0, pixel=1.0))
    with Image.open(tmp_path / "map.png") as picture:
        grey = np.asarray(picture)[0]
    assert grey.tolist() == [round(255 * ((i + 0.5) / 10.0) ** 2) for i in range(10)]


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
    assert file["perceptions"][0]["channels"][0]["bands"][0]["curve_type"] == "Linear"
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
    _, _, mu = curve_of(hjif.document(profile, 2000.0, 20.0, (0.5, top)))
    assert mu[-1] == pytest.approx(0.6, abs=1e-6)  # 1776.73 V feels like 0.6: the example of Encoding
    assert mu[0] == pytest.approx(0.5, rel=1e-9)


@settings(max_examples=80, deadline=None)
@given(
    rows=st.lists(st.tuples(st.floats(0.0, 20.0), st.floats(-1.0, 1.0)), min_size=2, max_size=15),
    speed=st.floats(0.05, 5000.0),
    start=st.floats(-100.0, 100.0),
)
def test_any_signal_has_the_published_structure(rows, speed, start):
    x = start + np.cumsum([gap for gap, _ in rows])
    if not np.ptp(x) > 1.0:
        return
    profile = VoltageProfile(x, 300.0 * np.array([u for _, u in rows]))
    try:
        file = hjif.document(profile, 300.0, speed, (0.2, 0.9))
    except InputError:
        assert np.ptp(x) / speed > 100.0  # seconds: whole ticks a second were more than 1 % off
        return
    check_structure(json.loads(json.dumps(file, allow_nan=False)))
    time, place, mu = curve_of(file)
    assert place[-1] == pytest.approx(np.ptp(x), abs=place[-1] / time[-1] / file["timescale"] * 1.02)
    np.testing.assert_allclose(time * speed, place, rtol=0.0102)  # ticks per second are whole
    # at its own keyframes the curve is the friction of some place at most a tick away
    tick = 10.0 ** (file["perceptions"][0]["unit_exponent"] + 3)
    for at, value in zip(x[0] + place, mu, strict=True):
        rows_there = profile.voltage[np.abs(x - at) <= 1.000001 * tick]
        volts = np.concatenate([rows_there, profile(np.array([at - tick, at + tick]))])
        lowest = 0.0 if volts.min() <= 0.0 <= volts.max() else np.abs(volts).min()
        share = (np.array([lowest, np.abs(volts).max()]) / 300.0) ** 2
        assert 0.2 + 0.7 * share[0] - 1e-6 <= value <= 0.2 + 0.7 * share[1] + 1e-6


def test_ticks_are_the_finest_that_fit():
    assert hjif.ticks(10.0, 20.0) == (-6, 20_000)
    assert hjif.ticks(10.0, 48.1) == (-5, 4810)  # 48100 micrometres a second are more than 48000
    assert hjif.ticks(70.0, 20.0) == (-5, 2000)  # 70000 micrometres are more than 16 bits hold
    assert hjif.ticks(10.0, 12.34567) == (-6, 12_346)
    with pytest.raises(InputError, match=r"speed: given 0.014 mm/s over 500 mm"):
        hjif.ticks(500.0, 0.014)


@pytest.mark.parametrize(
    ("settings_", "says"),
    [
        ({"full_scale": 0.0}, "full_scale: given 0.0; allowed: a voltage in V above zero"),
        ({"full_scale": float("nan")}, "full_scale: given nan"),
        ({"full_scale": float("inf")}, "full_scale: given inf"),
        ({"full_scale": True}, "full_scale: given True"),
        ({"full_scale": 100.0, "speed": 0.0}, "speed: given 0.0; allowed: a speed in mm/s above zero"),
        ({"full_scale": 100.0, "speed": -20.0}, "speed: given -20.0"),
        ({"full_scale": 100.0, "speed": float("nan")}, "speed: given nan"),
        ({"full_scale": 100.0, "rate": 0}, "rate: given 0; allowed: a whole number from 1"),
        ({"full_scale": 100.0, "rate": 8000.0}, "rate: given 8000.0"),
        ({"full_scale": 100.0, "carrier": 30_000.0}, "below half the rate of 48000 Hz"),
        ({"full_scale": 100.0, "pixel": 0.0}, "pixel: given 0.0"),
        ({"full_scale": 100.0, "friction": (0.6, 0.5)}, "the second one larger"),
        ({"full_scale": 100.0, "friction": 0.6}, "two friction coefficients"),
    ],
)
def test_a_playback_that_cannot_be_is_refused(settings_, says):
    with pytest.raises(InputError, match=re.escape(says)):
        Playback(**settings_)


@pytest.mark.parametrize(
    ("name", "playback", "says"),
    [
        (
            "a.wav",
            Playback(1999.0, speed=20.0),
            "voltage: given 2000 V; allowed: at most the full scale of 1999",
        ),
        ("a.png", Playback(1999.0), "at most the full scale"),
        ("a.hjif", Playback(1999.0, speed=20.0, friction=(0.5, 0.6)), "at most the full scale"),
        ("a.csv", Playback(1999.0), "at most the full scale"),
        ("a.wav", Playback(2000.0), "speed: given nothing; allowed: a speed in mm/s, needed for .wav"),
        ("a.hjif", Playback(2000.0), "speed: given nothing"),
        ("a.hjif", Playback(2000.0, speed=20.0), "friction: given nothing"),
        ("a.wav", None, "full_scale: given nothing"),
        ("a.mp3", None, "a file called .csv, .wav, .png or .hjif"),
        ("a.wav", Playback(2000.0, speed=1e-4), "a file of 4.8e+09 samples; allowed: at most 49999999"),
        ("a.png", Playback(2000.0, pixel=1e-9), "a file of 1e+10 columns; allowed: at most 100000"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_is_written(tmp_path, name, playback, says):
    with pytest.raises(InputError, match=re.escape(says)):
        write_signal(tmp_path / name, JUMP, playback)
    assert list(tmp_path.iterdir()) == []


def test_a_signal_without_length_and_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="a signal with a length"):
        write_signal(tmp_path / "a.wav", VoltageProfile([1.0, 1.0], [0.0, 5.0]), DEVICE)
    (tmp_path / "kept.wav").write_bytes(b"before")
    with pytest.raises(InputError):
        write_signal(tmp_path / "kept.wav", JUMP, Playback(100.0, speed=20.0))
    assert (tmp_path / "kept.wav").read_bytes() == b"before"
    for ending in ("csv", "wav", "png", "hjif"):
        with pytest.raises(StorageError, match="cannot write"):
            write_signal(tmp_path / "none" / f"a.{ending}", JUMP, DEVICE)


def wav_with(comment, samples=b"\1\0\2\0", header=None):
    """A small WAV made by hand."""

    def part(name, content):
        return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)

    header = header or struct.pack("<HHIIHH", 1, 1, 8000, 16_000, 2, 16)
    info = part(b"LIST", b"INFO" + part(b"ICMT", comment))
    return part(b"RIFF", b"WAVE" + part(b"fmt ", header) + info + part(b"data", samples))


GOOD = {
    "format": "evfem-voltage-1",
    "full_scale_V": 100.0,
    "speed_mm_per_s": 20.0,
    "start_mm": 0.0,
    "carrier_Hz": None,
}


def changed(**values):
    return wav_with(json.dumps({**GOOD, **values}).encode())


def plain_wav():
    target = io.BytesIO()
    with wave.open(target, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(b"\0\0" * 10)
    return target.getvalue()


HOSTILE = {
    "empty": b"",
    "text": b"position,voltage\n0,1\n",
    "cut in the header": changed()[:30],
    "cut in the comment": changed()[:70],
    "cut in the samples": changed()[:-3],
    "of a length that is not there": b"RIFF\xff\xff\xff\xff" + changed()[8:],
    "big-endian": b"RIFX" + changed()[4:],
    "without a comment": plain_wav(),
    "without samples": wav_with(json.dumps(GOOD).encode(), samples=b""),
    "of half a sample": wav_with(json.dumps(GOOD).encode(), samples=b"\1\0\2"),
    "stereo": wav_with(json.dumps(GOOD).encode(), header=struct.pack("<HHIIHH", 1, 2, 8000, 32_000, 4, 16)),
    "of floats": wav_with(
        json.dumps(GOOD).encode(), header=struct.pack("<HHIIHH", 3, 1, 8000, 16_000, 2, 16)
    ),
    "8 bit": wav_with(json.dumps(GOOD).encode(), header=struct.pack("<HHIIHH", 1, 1, 8000, 8000, 1, 8)),
    "at rate 0": wav_with(json.dumps(GOOD).encode(), header=struct.pack("<HHIIHH", 1, 1, 0, 0, 2, 16)),
    "with a short header": wav_with(json.dumps(GOOD).encode(), header=b"\1\0"),
    "with prose": wav_with(b"recorded on a Tuesday"),
    "with bytes": wav_with(b"\xff\xfe\x00\x80"),
    "with a list": wav_with(b"[1, 2]"),
    "with a number": wav_with(b"7"),
    "with deep nesting": wav_with(b"[" * 200_000),
    "with too long a number": wav_with(b'{"format": ' + b"9" * 10_000 + b"}"),
    "with another format": changed(format="evfem-voltage-2"),
    "with a key missing": wav_with(json.dumps({k: v for k, v in GOOD.items() if k != "start_mm"}).encode()),
    "at no speed": changed(speed_mm_per_s=0.0),
    "going backwards": changed(speed_mm_per_s=-1.0),
    "at a speed in words": changed(speed_mm_per_s="20"),
    "at an infinite speed": changed(speed_mm_per_s=float("inf")),
    "starting nowhere": changed(start_mm=float("nan")),
    "of no volts": changed(full_scale_V=0),
    "of true volts": changed(full_scale_V=True),
    "too far away": wav_with(
        json.dumps({**GOOD, "speed_mm_per_s": 1e308, "start_mm": 1e308}).encode(),
        header=struct.pack("<HHIIHH", 1, 1, 1, 2, 2, 16),
    ),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_wav_is_refused_with_a_sentence(tmp_path, name):
    path = tmp_path / "x.wav"
    path.write_bytes(HOSTILE[name])
    with pytest.raises(InputError) as refused:
        read_signal(path)
    assert "; allowed: " in str(refused.value)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400


def test_the_wav_made_by_hand_is_fine_without_its_flaw(tmp_path):
    path = tmp_path / "x.wav"
    path.write_bytes(changed())
    back = read_signal(path)
    np.testing.assert_allclose(back.voltage, np.array([1, 2]) / 32767 * 100.0, rtol=1e-15)
    np.testing.assert_allclose(back.position, [0.0, 20.0 / 8000], rtol=1e-15)


def test_what_cannot_be_read_back_is_said(tmp_path):
    for ending in ("wav", "csv"):
        with pytest.raises(InputError, match="No such file"):
            read_signal(tmp_path / f"none.{ending}")
    with pytest.raises(InputError, match="do not keep the whole signal"):
        read_signal(tmp_path / "map.png")
    (tmp_path / "folder.wav").mkdir()
    with pytest.raises(InputError, match="directory"):
        read_signal(tmp_path / "folder.wav")


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 255)), min_size=1, max_size=4))
def test_changed_bytes_are_read_or_refused_never_more(tmp_path_factory, changes):
    data = bytearray(changed())
    for place, value in changes:
        data[place % len(data)] = value
    path = tmp_path_factory.mktemp("bytes") / "x.wav"
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        assert np.all(np.isfinite(read_signal(path).voltage))


def test_the_command_writes_what_it_is_asked_for(tmp_path, capsys):
    source, out = tmp_path / "v.csv", tmp_path / "tone.wav"
    write_signal(source, JUMP)
    scale = ["--full-scale", "2000", "--speed", "20"]
    assert cli.main(["signal", str(source), "--out", str(out), *scale, "--rate", "8000"]) == 0
    assert capsys.readouterr().out == f"1 to 11 mm, at most 2000 V; in {out}\n"
    direct = tmp_path / "direct.wav"
    write_signal(direct, JUMP, DEVICE)
    assert out.read_bytes() == direct.read_bytes()
    assert cli.main(["signal", str(out), "--out", str(tmp_path / "back.csv")]) == 0
    back = read_signal(tmp_path / "back.csv")
    assert back.voltage.tolist() == read_signal(out).voltage.tolist()
    hjif_file = tmp_path / "tone.hjif"
    assert cli.main(["signal", str(source), "--out", str(hjif_file), *scale, "--friction", "0.5", "0.6"]) == 0
    check_structure(json.loads(hjif_file.read_text()))
    assert cli.main(["signal", str(source), "--out", str(tmp_path / "a.wav"), "--full-scale", "nan"]) == 2
    assert capsys.readouterr().err == "evfem: full_scale: given nan; allowed: a voltage in V above zero\n"
    assert not (tmp_path / "a.wav").exists()

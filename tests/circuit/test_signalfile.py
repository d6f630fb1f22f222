"""Voltage signals in files: what other readers find in them, what comes back, and what is refused."""

import io
import json
import re
import struct
import wave
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from scipy.io import wavfile
from tools.refusals import refuses
from tools.scenes import PRESS, head

import evfem as ev
from evfem import cli
from evfem.circuit import signalfile
from evfem.scene.file import dump, loads

JUMP = ev.VoltageProfile([1.0, 3.5, 6.0, 6.0, 11.0], [0.0, 2000.0, 500.0, 1500.0, -1500.0])
DEVICE = ev.Playback(full_scale=2000.0, speed=20.0, friction=(0.5, 0.6), rate=8000)
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
    ev.write_signal(path, JUMP, DEVICE)
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


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("second", [None, "negative", "trigger"])
def test_wide_samples_and_a_second_channel_are_read_by_others_and_come_back(tmp_path, bits, second):
    """The standard library's `wave` and scipy 1.17, which puts 24 bits above 8 zeros."""
    path, largest = tmp_path / "tone.wav", 2 ** (bits - 1) - 1
    ev.write_signal(path, JUMP, replace(DEVICE, bits=bits, second=second))
    channels = 1 if second is None else 2
    with wave.open(str(path)) as reader:
        assert (reader.getnchannels(), reader.getsampwidth()) == (channels, bits // 8)
        data = reader.readframes(reader.getnframes())
    frames = np.frombuffer(data, np.uint8).reshape(-1, channels, bits // 8)
    numbers = [
        [int.from_bytes(one.tobytes(), "little", signed=True) for one in frames[i]]
        for i in (0, 1, 1000, 4000)
    ]
    expected = [0, round(JUMP(1.0025) / 2000.0 * largest), largest, -round(0.75 * largest)]
    assert [frame[0] for frame in numbers] == expected
    if second == "negative":
        assert [frame[1] for frame in numbers] == [-one for one in expected]
    if second == "trigger":  # 1 ms at 8 kHz
        assert [int.from_bytes(one.tobytes(), "little", signed=True) for one in frames[:9, 1]] == [
            largest
        ] * 8 + [0]
    _, samples = wavfile.read(path)
    assert samples.reshape(4001, channels)[1000, 0] == (largest << 8 if bits == 24 else largest)
    step = 0.5 * 2000.0 / largest * (1 + 1e-6)
    back = ev.read_signal(path)
    assert np.max(np.abs(back.voltage - JUMP(back.position))) <= step
    sampled = ev.Sampled.from_wav(path, 2000.0)
    assert np.max(np.abs(sampled.voltage - back.voltage)) < 1e-9 * 2000.0
    if (bits, second) == (16, None):
        assert not {"bits", "second"} & comment_of(path).keys()  # as 0.3 wrote it


@pytest.mark.parametrize(("kept", "stored"), [(24, 16), (16, 24), (32, 16)])
def test_bits_are_those_of_the_file_where_a_converter_kept_the_comment(tmp_path, kept, stored):
    """By the comment's bits 2000 V of 24 would be 0.03 V in 16."""
    paths, profile = (
        [tmp_path / f"{bits}.wav" for bits in (kept, stored)],
        ev.VoltageProfile([0, 5], [0, 2000]),
    )
    for path, bits in zip(paths, (kept, stored), strict=True):
        ev.write_signal(path, profile, ev.Playback(full_scale=2500.0, speed=20.0, bits=bits))
    chunks = [path.read_bytes().partition(b"LIST") for path in paths]
    comments = [b"LIST" + chunk[: 4 + int.from_bytes(chunk[:4], "little")] for _, _, chunk in chunks]
    whole = paths[1].read_bytes().replace(comments[1], comments[0])
    paths[1].write_bytes(b"RIFF" + (len(whole) - 8).to_bytes(4, "little") + whole[8:])
    assert ev.read_signal(paths[1]).voltage.max() == pytest.approx(2000.0, rel=1e-4)


@pytest.mark.others
@pytest.mark.parametrize("bits", [16, 24, 32])
def test_soundfile_reads_what_is_written(tmp_path, bits):
    """soundfile 0.14 with libsndfile: the kind of samples by its name, and the samples as fractions."""
    import soundfile

    ev.write_signal(tmp_path / "tone.wav", JUMP, replace(DEVICE, bits=bits, second="negative"))
    told = soundfile.info(tmp_path / "tone.wav")
    assert (told.subtype, told.channels, told.samplerate, told.frames) == (f"PCM_{bits}", 2, 8000, 4001)
    samples, _ = soundfile.read(tmp_path / "tone.wav")  # of 2 ** (bits - 1)
    at = 1.0 + 20.0 / 8000 * np.arange(4001)
    np.testing.assert_allclose(samples[:, 0] * 2000.0, JUMP(at), atol=2000.0 * 1.6 / 2 ** (bits - 1))
    np.testing.assert_array_equal(samples[:, 0], -samples[:, 1])


def test_a_wav_comes_back_as_a_voltage_for_a_scene(tmp_path):
    ev.write_signal(tmp_path / "tone.wav", JUMP, DEVICE)
    back = ev.read_signal(tmp_path / "tone.wav")
    np.testing.assert_allclose(back.position, 1.0 + 20.0 / 8000 * np.arange(4001), rtol=1e-15)
    assert np.max(np.abs(back.voltage - JUMP(back.position))) <= 0.5 * STEP * (1 + 1e-12)
    assert np.max(np.abs(back.voltage - JUMP(back.position))) > 0.4 * STEP  # a step is what is said
    # between the samples: the slope is at most 800 V/mm, a kink in the middle of 2.5 um costs 1 V
    between = np.setdiff1d(np.linspace(1.0, 11.0, 30_001), back.position)
    between = between[np.abs(between - 6.0) > 20.0 / 8000]
    assert np.max(np.abs(back(between) - JUMP(between))) < 1.0 + STEP
    scene = ev.Scene(
        ev.FingerPad(), ev.Display(), law=ev.Kaczmarek(), voltage=back, motion=[ev.Press(force=0.05)]
    )
    assert scene.voltage is back


def test_a_carrier_attracts_like_the_effective_voltage(tmp_path):
    path = tmp_path / "carrier.wav"
    level = ev.VoltageProfile([0.0, 10.0], [700.0, 700.0])
    ev.write_signal(path, level, ev.Playback(full_scale=1000.0, speed=20.0, rate=48_000, carrier=12_000.0))
    samples = wavfile.read(path)[1] / 32767 * 1000.0
    # 24000 samples of four a period: the mean attraction goes with the mean square
    assert np.sqrt(np.mean(samples[:-1] ** 2)) == pytest.approx(700.0, rel=1e-4)
    assert comment_of(path)["carrier_Hz"] == 12_000.0
    refuses("without a carrier", ev.read_signal, path)
    with pytest.raises(ev.InputError, match=r"carrier's peaks; allowed: at most the full scale of 900 V"):
        ev.write_signal(path, level, ev.Playback(full_scale=900.0, speed=20.0, carrier=12_000.0))
    refuses("below half the rate", ev.Playback, full_scale=900.0, rate=8000, carrier=4000.0)


def test_the_friction_map_is_linear_in_friction(tmp_path):
    path = tmp_path / "map.png"
    steps = ev.VoltageProfile([0.0, 1.0, 1.0, 2.0, 2.0, 3.0], [0.0, 0.0, -1000.0, -1000.0, 2000.0, 2000.0])
    ev.write_signal(path, steps, ev.Playback(full_scale=2000.0, friction=(0.5, 0.6), pixel=0.25))
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


def test_a_column_has_the_mean_square_of_its_voltage(tmp_path):
    """Of a ramp from i to i + 1 tenths: (i^2 + i + 1/3) / 100."""
    ramp = ev.VoltageProfile([5.0, 15.0], [0.0, 100.0])
    ev.write_signal(tmp_path / "map.png", ramp, ev.Playback(full_scale=100.0, pixel=1.0))
    with Image.open(tmp_path / "map.png") as picture:
        grey = np.asarray(picture)[0]
    assert grey.tolist() == [round(255 * (i**2 + i + 1 / 3) / 100) for i in range(10)]


def greys(path):
    with Image.open(path) as picture:
        return np.asarray(picture)[0]


def test_waves_finer_than_the_samples_are_their_mean_square_in_a_map_and_said(tmp_path):
    """|sin| of 0.1 mm is 1 in the middle of each pixel of 0.1 mm; the mean of its square is 1/2."""
    x = np.linspace(0.0, 2.0, 2001)
    fine = ev.VoltageProfile(x, 100.0 * np.abs(np.sin(np.pi * x / 0.1)))
    with pytest.warns(UserWarning, match="m.png: 39 of 39 crests and troughs") as warned:
        ev.write_signal(tmp_path / "m.png", fine, ev.Playback(full_scale=100.0, speed=20.0))
    (said,) = (str(one.message) for one in warned)
    assert said.endswith(
        "of the signal, in waves down to 0.1 mm, have less than two pixels of 0.1 mm in a wave, "
        "which do not hold them; pixels of at most 0.025 mm do (a smaller `pixel`)"
    )
    assert set(greys(tmp_path / "m.png").tolist()) <= {127, 128}
    ev.write_signal(tmp_path / "m.png", fine, ev.Playback(full_scale=100.0, pixel=0.025))  # without a word
    np.testing.assert_allclose(greys(tmp_path / "m.png")[:4] / 255, [0.182, 0.818, 0.818, 0.182], atol=3e-3)


def test_waves_of_a_wav_and_a_hjif_with_less_than_two_samples_are_said(tmp_path):
    """Of 10 um in a WAV of 10 um, which reads back as 60 V, and of 40 um in 0.1 mm, the ticks over 1 m."""
    x = np.linspace(0.0, 0.1, 1001)
    wave_ = ev.VoltageProfile(x, 60.0 + 20.0 * np.sin(2.0 * np.pi * x / 0.01))
    slow = ev.Playback(full_scale=100.0, speed=20.0, rate=2000, friction=(0.5, 0.6))
    with pytest.warns(
        UserWarning,
        match="down to 0.00917 mm, .* of at most 0.00229 mm do .*above 2000 Hz, or a slower slide",
    ):
        ev.write_signal(tmp_path / "a.wav", wave_, slow)
    ev.write_signal(tmp_path / "a.wav", wave_, replace(slow, rate=8000))  # without a word
    far = ev.VoltageProfile([*(4.0 * x), 1000.0], [*wave_.voltage, 60.0])
    with pytest.warns(UserWarning, match="two ticks of 0.1 mm in .*a shorter signal"):
        ev.write_signal(tmp_path / "a.hjif", far, slow)


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
        ({"full_scale": 100.0, "bits": 8}, "bits: given 8; allowed: 16 | 24 | 32"),
        ({"full_scale": 100.0, "bits": 24.0}, "bits: given 24.0"),
        ({"full_scale": 100.0, "second": "left"}, 'second: given "left"; allowed: negative | trigger'),
    ],
)
def test_a_playback_that_cannot_be_is_refused(settings_, says):
    refuses(re.escape(says), ev.Playback, **settings_)


@pytest.mark.parametrize(
    ("name", "playback", "says"),
    [
        (
            "a.wav",
            ev.Playback(1999.0, speed=20.0),
            "voltage: given 2000 V; allowed: at most the full scale of 1999",
        ),
        ("a.png", ev.Playback(1999.0), "at most the full scale"),
        ("a.hjif", ev.Playback(1999.0, speed=20.0, friction=(0.5, 0.6)), "at most the full scale"),
        ("a.csv", ev.Playback(1999.0), "at most the full scale"),
        ("a.wav", ev.Playback(2000.0), "speed: missing; allowed: a speed in mm/s, needed for .wav"),
        ("a.hjif", ev.Playback(2000.0), "speed: missing"),
        ("a.hjif", ev.Playback(2000.0, speed=20.0), "friction: missing"),
        ("a.wav", None, "full_scale: missing"),
        ("a.mp3", None, "a file called .csv, .wav, .png or .hjif"),
        ("a.wav", ev.Playback(2000.0, speed=1e-4), "a file of 4.8e+09 samples; allowed: at most 49999999"),
        ("a.png", ev.Playback(2000.0, pixel=1e-9), "a file of 1e+10 columns; allowed: at most 100000"),
    ],
)
def test_what_does_not_fit_is_refused_and_nothing_is_written(tmp_path, name, playback, says):
    refuses(re.escape(says), ev.write_signal, tmp_path / name, JUMP, playback)
    assert list(tmp_path.iterdir()) == []


def test_a_signal_without_length_and_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(ev.InputError, match="a signal with a length"):
        ev.write_signal(tmp_path / "a.wav", ev.VoltageProfile([1.0, 1.0], [0.0, 5.0]), DEVICE)
    (tmp_path / "kept.wav").write_bytes(b"before")
    with pytest.raises(ev.InputError):
        ev.write_signal(tmp_path / "kept.wav", JUMP, ev.Playback(100.0, speed=20.0))
    assert (tmp_path / "kept.wav").read_bytes() == b"before"
    for ending in ("csv", "wav", "png", "hjif"):
        with pytest.raises(ev.StorageError, match="cannot write"):
            ev.write_signal(tmp_path / "none" / f"a.{ending}", JUMP, DEVICE)


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
    refused = refuses("allowed", ev.read_signal, path)
    assert "; allowed: " in str(refused)
    assert "\n" not in str(refused)
    assert len(str(refused)) < 400


def test_a_wav_of_more_samples_than_a_signal_has_rows_is_refused_before_it_is_converted(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(signalfile, "MOST_ROWS", 1)
    (tmp_path / "x.wav").write_bytes(changed())
    refuses("with 2 samples; allowed: at most 1 of them", ev.read_signal, tmp_path / "x.wav")


def test_only_signals_are_written(tmp_path):
    refuses("a VoltageProfile", ev.write_signal, tmp_path / "x.csv", [0.0, 1.0])


def test_what_cannot_be_read_back_is_said(tmp_path):
    for ending in ("wav", "csv"):
        refuses("No such file", ev.read_signal, tmp_path / f"none.{ending}")
    refuses("a map does not keep the signal", ev.read_signal, tmp_path / "map.png")
    (tmp_path / "folder.wav").mkdir()
    refuses("directory", ev.read_signal, tmp_path / "folder.wav")


def test_the_command_writes_what_it_is_asked_for(tmp_path, capsys):
    source, out = tmp_path / "v.csv", tmp_path / "tone.wav"
    ev.write_signal(source, JUMP)
    scale = ["--full-scale", "2000", "--speed", "20"]
    assert cli.main(["signal", str(source), "--out", str(out), *scale, "--rate", "8000"]) == 0
    assert capsys.readouterr().out == f"1 to 11 mm, at most 2000 V; in {out}\n"
    direct = tmp_path / "direct.wav"
    ev.write_signal(direct, JUMP, DEVICE)
    assert out.read_bytes() == direct.read_bytes()
    wide = ["--rate", "8000", "--bits", "24", "--second", "trigger"]
    assert cli.main(["signal", str(source), "--out", str(out), *scale, *wide]) == 0
    ev.write_signal(direct, JUMP, replace(DEVICE, bits=24, second="trigger"))
    assert out.read_bytes() == direct.read_bytes()
    assert "at most 2000 V" in capsys.readouterr().out
    assert cli.main(["signal", str(out), "--out", str(tmp_path / "back.csv")]) == 0
    back = ev.read_signal(tmp_path / "back.csv")
    assert back.voltage.tolist() == ev.read_signal(out).voltage.tolist()
    assert cli.main(["signal", str(source), "--out", str(tmp_path / "a.wav"), "--full-scale", "nan"]) == 2
    assert capsys.readouterr().err == "evfem: full_scale: given nan; allowed: a voltage in V above zero\n"
    assert not (tmp_path / "a.wav").exists()


KEYS = 'law = "kaczmarek"\nvoltage_file = "voltage.wav"\ninsulator_thickness = 0.09\ninsulator_eps_r = 3.35'
WITH_WAV = head(KEYS) + PRESS


def test_a_voltage_file_may_be_a_wav(tmp_path):
    signal = ev.VoltageProfile([1.0, 2.0, 3.0], [0.0, 1000.0, 500.0])
    ev.write_signal(tmp_path / "voltage.wav", signal, ev.Playback(full_scale=1000.0, speed=20.0, rate=2000))
    scene = loads(WITH_WAV, tmp_path)
    x = np.linspace(0.0, 4.0, 41)
    assert np.abs(scene.voltage(x) - signal(x)).max() <= 0.51 * 1000.0 / 32767
    again = loads(dump(scene), tmp_path)
    assert again.digest() == scene.digest()


@pytest.mark.parametrize(
    ("carrier", "cut", "says"),
    [(500.0, 0, "with a carrier of 500.0 Hz"), (None, 3, "voltage.wav, cut off"), (None, 10**6, "cut off")],
)
def test_a_wav_that_is_no_voltage_is_refused_under_its_key(tmp_path, carrier, cut, says):
    playback = ev.Playback(full_scale=2000.0, speed=20.0, rate=2000, carrier=carrier)
    ev.write_signal(tmp_path / "voltage.wav", ev.VoltageProfile([0.0, 1.0], [0.0, 1000.0]), playback)
    data = (tmp_path / "voltage.wav").read_bytes()
    (tmp_path / "voltage.wav").write_bytes(data[: max(len(data) - cut, 0)])
    assert refuses(says, loads, WITH_WAV, tmp_path).key == "electrostatics.voltage_file"


def test_bits_and_a_second_channel_are_those_of_a_wav(tmp_path):
    wide = ev.Playback(full_scale=100.0, speed=20.0, bits=24)
    profile = ev.VoltageProfile([0, 5], [0, 50])
    refuses("path: given .*a file called .wav for bits", ev.write_signal, tmp_path / "a.png", profile, wide)

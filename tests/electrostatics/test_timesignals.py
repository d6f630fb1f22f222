"""Voltages over time: their values, the frequencies of their squares, and samples from files."""

import struct
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.io import wavfile
from tools.refusals import refuses

import evfem as ev
from evfem.protocols import TimeSignal

TIME = np.linspace(0.0, 1.0, 2000, endpoint=False)
SLOW = ev.Sine(10.0, amplitude=30.0, bias=50.0, phase=0.4)


def power_of(signal):
    """Mean, and cosine and sine amplitudes of the squared voltage over a second, by their
    integrals: {frequency: amplitude}.
    """
    square = signal(TIME) ** 2
    turns = np.exp(-2j * np.pi * np.outer(np.arange(1, 1000), TIME))
    found = {0: square.mean()}
    return found | {n: 2.0 * abs(z) for n, z in enumerate(turns @ square / TIME.size, 1) if abs(z) > 1e-9}


def test_amplitude_modulation_attracts_at_the_envelopes_frequency_and_twice_that():
    """p/p0 = 1 + m^2/2 + 2 m cos W t + (m^2/2) cos 2 W t of the carrier's mean."""
    m, height = 0.6, 50.0
    envelope = ev.Sine(10.0, amplitude=m * height, bias=height)
    parts = {0: 1.0 + m**2 / 2.0, 10: 2.0 * m, 20: m**2 / 2.0}
    mean = {n: part * height**2 / 2.0 for n, part in parts.items()}
    assert power_of(ev.Carrier(400.0, envelope, resolved=False)) == pytest.approx(mean, rel=1e-9)
    resolved = power_of(ev.Carrier(400.0, envelope))
    assert {n: resolved[n] for n in mean} == pytest.approx(mean, rel=1e-9)
    beside = {800: parts[0], 790: m, 810: m, 780: m**2 / 4.0, 820: m**2 / 4.0}
    beside = {n: part * height**2 / 2.0 for n, part in beside.items()}
    assert {n: resolved[n] for n in set(resolved) - set(mean)} == pytest.approx(beside, rel=1e-9)


def test_a_carrier_of_a_constant_height_is_a_sine_and_its_mean_a_number():
    np.testing.assert_allclose(ev.Carrier(40.0, 100.0)(TIME), ev.Sine(40.0, 100.0)(TIME), rtol=1e-12)
    mean = ev.Carrier(40.0, 100.0, resolved=False)
    np.testing.assert_allclose(mean(TIME), np.full(TIME.size, 100.0 / np.sqrt(2.0)), rtol=1e-12)
    assert (mean.highest_frequency, mean(0.3)) == (0.0, pytest.approx(70.71067811865476))


@pytest.mark.parametrize(
    ("signal", "largest", "highest"),
    [
        (SLOW, 80.0, 10.0),
        (ev.Sine(10.0, 30.0, -50.0), 80.0, 10.0),
        (ev.Square(10.0, 30.0, -50.0), 80.0, 10.0),
        (ev.Carrier(300.0, SLOW), 80.0, 310.0),
        (ev.Carrier(300.0, SLOW, resolved=False), 80.0 / np.sqrt(2.0), 10.0),
        (ev.Carrier(300.0, ev.Carrier(20.0, 10.0)), 10.0, 320.0),
        (ev.Sampled([1.0, -3.0, 1.0], 10.0), 3.0, 10.0 / 3.0),
        (ev.Sampled([2.0], 10.0), 2.0, 0.0),
    ],
    ids=repr,
)
def test_signals_say_how_large_and_how_fast_they_are(signal, largest, highest):
    assert isinstance(signal, TimeSignal)
    assert signal.largest == pytest.approx(largest)
    assert signal.highest_frequency == pytest.approx(highest)
    values = signal(np.linspace(0.0, 0.3, 7).reshape(7, 1))
    assert values.shape == (7, 1)
    assert np.abs(values).max() <= largest * (1 + 1e-12)
    assert type(signal(0.1)) is float


def test_a_square_wave_with_a_bias_is_on_and_off():
    """(B +- A)^2 is B^2 + A^2 in the mean, of which B^2 is direct and 8 / (pi n)^2 of A^2 at each odd n."""
    signal = ev.Square(50.0, 40.0, bias=40.0)
    assert signal([0.0, 0.0099, 0.01, 0.0199, 0.02]).tolist() == [80.0, 80.0, 0.0, 0.0, 80.0]
    effective, order, share = signal.powers()
    assert effective == pytest.approx(80.0 / np.sqrt(2.0), rel=1e-12)
    assert order[:3].tolist() == [0.0, 1.0, 3.0]
    assert share[:3] == pytest.approx([0.5, 4.0 / np.pi**2, 4.0 / (3.0 * np.pi) ** 2], rel=1e-12)
    assert ev.Square(50.0, 80.0).powers()[0] == pytest.approx(80.0, rel=1e-12)


def test_samples_are_linear_in_between_and_constant_outside():
    signal = ev.Sampled([0.0, 10.0, 4.0], rate=100.0, start=1.0)
    times = [0.0, 1.0, 1.005, 1.01, 1.015, 1.02, 5.0]
    np.testing.assert_allclose(signal(times), [0.0, 0.0, 5.0, 10.0, 7.0, 4.0, 4.0], rtol=1e-12, atol=1e-10)
    again = ev.Sampled([0.0, 10.0, 4.0], rate=100.0, start=1.0, repeat=True)
    np.testing.assert_allclose(again([1.02, 1.025, 1.03, 1.04, 0.99, -1.99]), [4, 2, 0, 10, 4, 10], atol=1e-9)


@pytest.mark.parametrize(("shape", "highest"), [("sine", 50.0), ("square", 450.0)])
def test_highest_frequency_of_samples_is_where_their_power_ends(shape, highest):
    """A sine has one line; the odd lines of a square have 8 / (pi n)^2 of the power, 95 % to n = 9."""
    turns = np.sin(2.0 * np.pi * 50.0 * (np.arange(40_000) + 0.5) / 40_000.0)
    odd = np.arange(1, 100, 2)
    share = np.cumsum(8.0 / (np.pi * odd) ** 2)
    assert odd[np.searchsorted(share, 0.95)] == 9
    signal = ev.Sampled(100.0 + (turns if shape == "sine" else np.sign(turns)), 40_000.0)
    assert signal.highest_frequency == pytest.approx(highest)


def test_samples_come_back_from_a_csv_file(tmp_path):
    signal = ev.Sampled([1.0, 0.1, -2.0 / 3.0], rate=300.0, start=0.5)
    signal.to_csv(tmp_path / "signal.csv")
    assert (tmp_path / "signal.csv").read_text().startswith("time,voltage\n0.5,1.0\n")
    back = ev.Sampled.from_csv(tmp_path / "signal.csv", repeat=True)
    assert back.voltage.tolist() == signal.voltage.tolist()
    assert back.rate == pytest.approx(300.0, rel=1e-12)
    assert (back.start, back.repeat) == (0.5, True)


@pytest.mark.parametrize("dtype", ["int16", "int32", "uint8", "float32"])
def test_any_wav_with_one_channel_is_read(tmp_path, dtype):
    shape = np.array([0.0, 0.5, 1.0, -1.0, -0.25])
    steps = {"int16": 2**15 - 1, "int32": 2**31 - 1, "uint8": 127, "float32": 2**24}[dtype]
    samples = np.rint(shape * steps) + 128 if dtype == "uint8" else shape * steps
    samples = shape if dtype == "float32" else samples
    wavfile.write(tmp_path / "own.wav", 8000, samples.astype(dtype))
    signal = ev.Sampled.from_wav(tmp_path / "own.wav", full_scale=200.0, start=0.25)
    assert (signal.rate, signal.start) == (8000.0, 0.25)
    np.testing.assert_allclose(signal.voltage, 200.0 * shape, atol=200.0 / steps)
    with pytest.raises(ev.InputError, match="full_scale: missing"):
        ev.Sampled.from_wav(tmp_path / "own.wav")


def test_floats_beyond_full_scale_are_larger_voltages_and_told(tmp_path):
    """1.0 is full scale in a WAV of floats, whether a sample has it or not."""
    for largest in (0.5, 2.0):
        samples = np.array([0.0, largest, -0.25], dtype="float32")
        wavfile.write(tmp_path / "own.wav", 8000, samples)
        loud = pytest.warns(UserWarning, match=r"own.wav: 1 of 3 samples are beyond 1.0, .* up to 400 V")
        with loud if largest > 1.0 else nullcontext():
            signal = ev.Sampled.from_wav(tmp_path / "own.wav", full_scale=200.0)
        assert signal.voltage.tolist() == [0.0, 200.0 * largest, -50.0]


def test_a_wav_of_evfem_says_its_full_scale_and_plays_with_its_carrier(tmp_path):
    slope = ev.VoltageProfile([0.0, 10.0], [0.0, 1000.0])
    playback = ev.Playback(full_scale=2000.0, speed=20.0, rate=8000, carrier=100.0)
    ev.write_signal(tmp_path / "tone.wav", slope, playback)
    signal = ev.Sampled.from_wav(tmp_path / "tone.wav")
    time = np.arange(signal.voltage.size) / 8000.0
    wanted = np.sqrt(2.0) * slope(20.0 * time) * np.sin(2.0 * np.pi * 100.0 * time)
    np.testing.assert_allclose(signal(time), wanted, atol=0.51 * 2000.0 / 32767)


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: ev.Sine(0.0, 1.0), "frequency"),
        (lambda: ev.Sine(1.0, -1.0), "amplitude"),
        (lambda: ev.Sine(1.0, 1.0, bias=np.nan), "bias"),
        (lambda: ev.Sine(1.0, 1.0, bias=2e6), "bias"),
        (lambda: ev.Sine(1.0, 1.0, phase="0"), "phase"),
        (lambda: ev.Carrier(1.0, -1.0), "envelope"),
        (lambda: ev.Carrier(1.0, ev.VoltageProfile([0.0], [1.0])), "envelope"),
        (lambda: ev.Carrier(1.0, 1.0, resolved=1), "resolved"),
        (lambda: ev.Carrier(2e9, 1.0), "frequency"),
        (lambda: ev.Sampled([], 1.0), "voltage"),
        (lambda: ev.Sampled([[1.0]], 1.0), "voltage"),
        (lambda: ev.Sampled([2e6], 1.0), "voltage"),
        (lambda: ev.Sampled([1.0], 0.0), "rate"),
        (lambda: ev.Sampled([1.0], 1.0, start=np.inf), "start"),
        (lambda: ev.Sampled([1.0], 1.0, repeat=0), "repeat"),
    ],
)
def test_what_is_no_signal_is_refused(make, key):
    assert refuses("allowed", make).key == key


@pytest.mark.parametrize(
    "text",
    [
        "position,voltage\n0,1\n1,2\n",
        "time,voltage\n0,1\n",
        "time,voltage\n0,1\n1,2\n3,4\n",
        "time,voltage\n1,1\n0,2\n",
    ],
    ids=["position", "one row", "uneven", "backwards"],
)
def test_csv_files_without_even_times_are_refused(tmp_path, text):
    (tmp_path / "signal.csv").write_text(text)
    assert refuses("allowed", ev.Sampled.from_csv, tmp_path / "signal.csv").key == "file"


@pytest.mark.parametrize("damage", ["cut", "other", "stereo", "missing", "silent"])
def test_what_is_no_wav_with_one_channel_is_refused(tmp_path, damage):
    path = tmp_path / "signal.wav"
    samples = np.zeros({"silent": 0}.get(damage, 100), dtype=np.int16)
    wavfile.write(path, 100, np.column_stack([samples, samples]) if damage == "stereo" else samples)
    if damage == "cut":
        path.write_bytes(path.read_bytes()[:30])
    elif damage == "other":
        path.write_bytes(struct.pack("<I", 7) * 50)
    elif damage == "missing":
        path.unlink()
    assert refuses("allowed", ev.Sampled.from_wav, path, 10.0).key == "path"

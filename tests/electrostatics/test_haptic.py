"""Haptic patterns of Meta and Android as voltages: `full_scale` times the root of the intensity.

Meta's `.haptic`: the data model 1.0.0 of Lofelt, `core/datamodel/README.md` of Lofelt/NiceVibrations (commit
349d026): amplitudes and emphases are 0 to 1 at times in s; `core/datamodel/src/emphasis.rs` (a9fa1cd)
interpolates them straight; the test of `clip-players` for a first breakpoint after 0 says that the amplitude
rises from 0, and that it ends with the last one. Android: `VibrationEffect.createWaveform` (API level 26)
takes durations in ms and amplitudes of 0 to 255, or durations alone, which begin with off; the XML is that of
`VibrationXmlParser` (Android 15).
"""

import json

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev


def meta(path, amplitude, major=1, **more):
    envelopes = {"amplitude": amplitude, "frequency": [{"time": 0.0, "frequency": 0.7}], **more}
    clip = {
        "version": {"major": major, "minor": 0, "patch": 0},
        "signals": {"continuous": {"envelopes": envelopes}},
    }
    path.write_text(json.dumps(clip))
    return path


def share(found, *times):
    """Intensity at times."""
    return (found(np.array(times)) / 100.0) ** 2


def test_a_clip_of_meta_is_straight_between_its_breakpoints(tmp_path):
    rows = [{"time": t, "amplitude": a} for t, a in ((0.1, 0.2), (0.3, 0.6), (0.5, 0.4))]
    rows[1]["emphasis"] = {"amplitude": 0.9, "frequency": 0.5}
    found = ev.Sampled.from_haptic(meta(tmp_path / "a.haptic", rows), 100.0, tap=0.02)
    times = (0.0, 0.05, 0.1, 0.2, 0.31, 0.4, 0.499, 0.5)
    expected = [0.0, 0.1, 0.2, 0.4, 0.9, 0.5, 0.401, 0.0]
    np.testing.assert_allclose(share(found, *times), expected, atol=1e-9)
    assert found.voltage.size == 501


ENTRIES = "".join(
    f'<waveform-entry durationMs="{ms}" amplitude="{level}"/><!-- then -->'
    for ms, level in ((0, 0), (12, 255), (250, 0), (8, 51))
)
XML = (
    f'<?xml version="1.0"?><vibration-effect><waveform-effect>{ENTRIES}</waveform-effect></vibration-effect>'
)
STEPS = {"timings": [0, 12, 250, 8], "amplitudes": [0, 255, 0, 51], "repeat": -1}


@pytest.mark.parametrize(("name", "text"), [("a.xml", XML), ("a.json", json.dumps(STEPS))])
def test_a_waveform_of_android_has_steps(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    found = ev.Sampled.from_haptic(tmp_path / name, 100.0)
    times = (0.0, 0.011, 0.013, 0.261, 0.263, 0.269)
    np.testing.assert_allclose(share(found, *times), [1.0, 1.0, 0.0, 0.0, 0.2, 0.2], atol=1e-9)
    assert found.voltage[-1] == 0.0
    assert found.voltage.size == 271


def transient(path, time):
    event = {"Time": time, "EventType": "HapticTransient", "EventParameters": []}
    path.write_text(json.dumps({"Version": 1.0, "Pattern": [{"Event": event}]}))
    return path


def test_a_pattern_ends_at_0(tmp_path):
    """Of 10 ms from a whole millisecond on ten samples are on, though 0.033 s + 0.01 s rounds up."""
    for start in range(0, 2000, 11):
        found = ev.Sampled.from_haptic(transient(tmp_path / "a.ahap", start / 1e3), 100.0)
        assert found.voltage.tolist() == [0.0] * start + [100.0] * 10 + [0.0]
        assert found(100.0) == 0.0
    rows = [{"time": t, "amplitude": 0.5} for t in (0.0, 0.033 + 0.01)]
    assert ev.Sampled.from_haptic(meta(tmp_path / "a.haptic", rows), 100.0)(1.0) == 0.0


PULSES = {"timings": [101, 5, 101, 5, 100], "amplitudes": [0, 255, 0, 255, 0]}
CREST = [{"time": t, "amplitude": a} for t, a in ((0.0, 0.0), (0.1002, 0.0), (0.1004, 1.0), (0.1006, 0.0))]


@pytest.mark.parametrize(
    ("name", "write", "rate", "holds"),
    [
        ("a.json", lambda path: path.write_text(json.dumps(PULSES)), 50.0, 200.0),
        ("a.ahap", lambda path: transient(path, 0.1003), 1000.0, 2000.0),
        ("a.haptic", lambda path: meta(path, CREST), 1000.0, 5000.0),
    ],
)
def test_events_between_two_samples_are_told_with_a_rate_that_holds_them(tmp_path, name, write, rate, holds):
    path = tmp_path / name
    write(path)
    told = rf"{name}: \d events or crests last .* {1e3 / rate:g} ms .*; a rate of {holds:g} Hz holds them"
    with pytest.warns(UserWarning, match=told):
        assert not ev.Sampled.from_haptic(path, 100.0, rate=rate, tap=5e-4).voltage.any()
    assert ev.Sampled.from_haptic(path, 100.0, rate=holds, tap=5e-4).largest > 70.0


def test_timings_alone_begin_with_off(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps({"timings": [10, 20, 30]}))
    found = ev.Sampled.from_haptic(tmp_path / "a.json", 100.0)
    np.testing.assert_allclose(share(found, 0.005, 0.015, 0.045), [0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("name", "text", "said"),
    [
        ("a.xml", XML.replace("waveform-effect", "predefined-effect"), "with predefined-effect, whose"),
        ("a.xml", XML.replace(ENTRIES, f"<repeating>{ENTRIES}</repeating>"), "a.xml, which repeats"),
        ("a.xml", XML.replace('"255"', '"default"'), "the device's default amplitude"),
        ("a.xml", XML.replace('"255"', '"256"'), "of another kind or damaged"),
        ("a.xml", XML.replace('"255"', '"nan"'), "of another kind or damaged"),
        ("a.xml", XML.replace(' amplitude="255"', ""), "of another kind or damaged"),
        ("a.xml", XML[:-10], "of another kind or damaged; allowed: a haptic pattern: AHAP, .haptic"),
        ("a.xml", XML.replace("<vib", '<!DOCTYPE x [<!ENTITY y "z">]><vib', 1), "of another kind or damaged"),
        ("a.xml", "<svg><g/></svg>", "of another kind or damaged"),
        ("a.json", json.dumps(STEPS | {"repeat": 1}), "which repeats; allowed: a waveform that ends"),
        ("a.json", json.dumps(STEPS | {"amplitudes": [1, 2]}), "of another kind or damaged"),
        ("a.json", json.dumps(STEPS | {"timings": [1, 2, -1, 4]}), "of another kind or damaged"),
        ("a.json", '{"timings": [1e999], "amplitudes": [1]}', "of another kind or damaged"),
        ("a.json", '{"timings": [1e12], "amplitudes": [1]}', "samples; allowed: 2 to 1000000 samples"),
        ("a.json", '{"timings": []}', "of another kind or damaged"),
    ],
)  # fmt: skip
def test_what_the_device_would_make_is_refused(tmp_path, name, text, said):
    (tmp_path / name).write_text(text)
    refuses(said, ev.Sampled.from_haptic, tmp_path / name, 100.0)


def test_a_clip_that_breaks_the_rules_of_the_format_is_refused(tmp_path):
    one = {"time": 0.0, "amplitude": 0.5}
    refuses("a.haptic, of version 2; allowed: a .haptic of version 1", ev.Sampled.from_haptic,
            meta(tmp_path / "a.haptic", [one], major=2), 1.0)  # fmt: skip
    loud = one | {"emphasis": {"amplitude": 1.1, "frequency": 0.5}}
    for rows in (
        [loud, {"time": 0.2, "amplitude": 0.5}],
        [],
        [one, {"time": 0.2, "amplitude": 1.5}],
        [{"time": 0.3, "amplitude": 0.1}, {"time": 0.2, "amplitude": 0.1}],
    ):
        refuses("of another kind or damaged", ev.Sampled.from_haptic, meta(tmp_path / "a.haptic", rows), 1.0)
    refuses("haptic patterns: `ev.Sampled.from_haptic`", ev.load, tmp_path / "a.haptic")

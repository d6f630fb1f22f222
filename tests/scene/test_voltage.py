"""Voltages in scene files: what is written is read back, and what is wrong is named by its key."""

import numpy as np
import pytest
from scipy.io import wavfile
from tools.refusals import refuses
from tools.scenes import HOVER, PRESS, WAIT, head

import evfem as ev
from evfem.errors import InputError
from evfem.planning.plan import plan
from evfem.scene.file import dump, loads

HEAD = head('law = "kaczmarek"\ninsulator_thickness = 0.001\ninsulator_eps_r = 3.9')
SINE = '[electrostatics.signal]\nkind = "sine"\nfrequency = 50\namplitude = 100\nbias = 20.0\n'
CARRIER = """[electrostatics.signal]
kind = "carrier"
frequency = 10000
resolved = false
envelope = { kind = "sine", frequency = 75.0, amplitude = 30.0, bias = 60.0 }
"""
SAMPLED = '[electrostatics.signal]\nkind = "sampled"\nrate = 1000.0\nvoltage = [0, 50.0]\nrepeat = true\n'


def scene_of(signal, folder="."):
    return loads(HEAD + signal + HOVER + WAIT, folder)


def test_the_kinds_of_signals_are_those_of_python():
    assert scene_of(SINE).voltage == ev.Sine(50.0, 100.0, 20.0)
    assert scene_of(CARRIER).voltage == ev.Carrier(10_000.0, ev.Sine(75.0, 30.0, 60.0), resolved=False)
    assert scene_of(CARRIER.replace("{", "70.0 #")).voltage == ev.Carrier(10_000.0, 70.0, resolved=False)
    sampled = scene_of(SAMPLED).voltage
    assert (sampled.voltage.tolist(), sampled.rate, sampled.repeat) == ([0.0, 50.0], 1000.0, True)
    assert scene_of(SINE).motion[1] == ev.Wait(0.1, steps=200)


@pytest.mark.parametrize("signal", [SINE, CARRIER, SAMPLED], ids=["sine", "carrier", "sampled"])
def test_what_is_written_is_read_back(signal):
    scene = scene_of(signal)
    text = dump(scene)
    assert loads(text).digest() == scene.digest()
    assert dump(loads(text)) == text
    for wrong, right in (("frequency = 50", "frequency = 60"), ("75.0", "76.0"), ("repeat = true", "")):
        if wrong in signal:
            assert scene_of(signal.replace(wrong, right)).digest() != scene.digest()


def test_samples_come_from_files(tmp_path):
    ev.Sampled([0.0, 10.0, 5.0], 100.0, start=0.02).to_csv(tmp_path / "signal.csv")
    wavfile.write(tmp_path / "signal.wav", 8000, np.array([0, 32767, -32767], dtype=np.int16))
    table = '[electrostatics.signal]\nkind = "sampled"\nfile = "signal.csv"\nrepeat = true\n'
    found = scene_of(table, tmp_path).voltage
    assert (found.voltage.tolist(), found.start, found.repeat) == ([0.0, 10.0, 5.0], 0.02, True)
    found = scene_of('voltage_file = "signal.csv"\n', tmp_path).voltage
    assert (found.voltage.tolist(), found.repeat) == ([0.0, 10.0, 5.0], False)
    table = table.replace(".csv", ".wav") + "full_scale = 120\nstart = 0.5\n"
    found = scene_of(table, tmp_path).voltage
    assert (found.voltage.tolist(), found.start, found.rate) == ([0.0, 120.0, -120.0], 0.5, 8000.0)
    # relative to the file, and whole in what is written
    assert loads(dump(scene_of(table, tmp_path))).voltage.voltage.tolist() == [0.0, 120.0, -120.0]


@pytest.mark.parametrize(
    ("signal", "old", "new", "key"),
    [
        (SINE, 'kind = "sine"', "", "electrostatics.signal.kind"),
        (SINE, 'kind = "sine"', 'kind = "triangle"', "electrostatics.signal.kind"),
        (SINE, "frequency = 50", "frequency = 0.0", "electrostatics.signal.frequency"),
        (SINE, "frequency = 50", "", "electrostatics.signal.frequency"),
        (SINE, "bias = 20.0", "offset = 20.0", "electrostatics.signal.offset"),
        (SINE, "[electrostatics.signal]", "voltage = 5.0\n[electrostatics.signal]", "electrostatics.voltage"),
        (SINE, SINE, "signal = 5.0\n", "electrostatics.signal"),
        (SINE, SINE, "", "electrostatics.voltage"),
        (CARRIER, "amplitude", "height", "electrostatics.signal.envelope.height"),
        (CARRIER, "30.0", "-30.0", "electrostatics.signal.envelope.amplitude"),
        (CARRIER, "resolved = false", "resolved = 0", "electrostatics.signal.resolved"),
        (SAMPLED, "rate = 1000.0", "", "electrostatics.signal"),
        (SAMPLED, "rate = 1000.0", "rate = -1.0", "electrostatics.signal.rate"),
        (SAMPLED, "voltage = [0, 50.0]", "", "electrostatics.signal"),
        (SAMPLED, "voltage = [0, 50.0]", "voltage = []", "electrostatics.signal.voltage"),
        (SAMPLED, "repeat = true", 'file = "a.csv"', "electrostatics.signal.file"),
        (SAMPLED, "repeat = true", "full_scale = 3.0", "electrostatics.signal.full_scale"),
        (SAMPLED, "rate = 1000.0\nvoltage = [0, 50.0]", 'file = "none.csv"', "electrostatics.signal.file"),
        (SAMPLED, "rate = 1000.0\nvoltage = [0, 50.0]", 'file = "bad.csv"', "electrostatics.signal.file"),
        (SAMPLED, "rate = 1000.0\nvoltage = [0, 50.0]", 'file = "bad.wav"', "electrostatics.signal.file"),
        (SAMPLED, "voltage = [0, 50.0]", 'file = "bad.csv"', "electrostatics.signal.rate"),
    ],
)
def test_a_mistake_is_named_by_its_key(tmp_path, signal, old, new, key):
    (tmp_path / "bad.csv").write_text("time,voltage\n0,1\n")
    (tmp_path / "bad.wav").write_bytes(b"RIFF")
    assert old in signal
    assert refuses("allowed", scene_of, signal.replace(old, new), tmp_path).key == key


def test_a_signal_needs_a_motion_that_takes_time():
    with pytest.raises(InputError, match=r"electrostatics.voltage: given a signal over time, and no motion"):
        loads(HEAD + SINE + PRESS)
    slide = '[[motion]]\nkind = "slide"\ndistance = 1.0\nsteps = 50\nspeed = 20.0\n'
    loads(HEAD + SINE + slide)
    with pytest.raises(InputError):
        loads(HEAD + SINE + slide.replace("speed = 20.0\n", ""))


def test_a_signal_of_ones_own_goes_into_a_scene_but_not_into_a_file():
    class Hum:
        largest, highest_frequency = 10.0, 50.0

        def __call__(self, time):
            return 10.0 * np.abs(np.sin(2 * np.pi * 50.0 * np.asarray(time)))

    for signal in (Hum(), ev.Carrier(1000.0, Hum(), resolved=False)):
        motion = [ev.Hover(0.5), ev.Wait(0.02, steps=20)]
        scene = ev.Scene(ev.FingerPad(), ev.Display(), ev.Kaczmarek(), signal, motion)
        assert scene.digest() == scene.digest()
        assert refuses("allowed", dump, scene).key.startswith("electrostatics.voltage")


def warned(signal, *motion):
    motion = ev.Press(indentation=0.3, steps=1), *motion
    scene = ev.Scene(scene_of(SINE).finger, ev.Display(), ev.Kaczmarek(), signal, motion)
    return plan(scene).warning or ""


def test_steps_that_cannot_follow_a_signal_are_warned_of():
    """20 steps in a period are enough; above a quarter of the steps' rate the square is aliased."""
    assert warned(ev.Sine(50.0, 10.0), ev.Wait(0.1, steps=100)) == ""
    few = warned(ev.Sine(50.0, 10.0), ev.Wait(0.1, steps=99))
    assert few == (
        "motion 1 has 19.8 steps in a period of the voltage (50 Hz): take at least 20, 100 steps in all"
    )
    assert "at a lower frequency" not in warned(ev.Sine(50.0, 10.0), ev.Wait(0.1, steps=20))
    aliased = warned(ev.Sine(50.0, 10.0), ev.Wait(0.1, steps=19))
    assert ", and shows what the attraction does above 95 Hz at a lower frequency: take" in aliased
    # the slower of two motions counts, and slides take the time of their speed
    slide = ev.Slide(-2.0, steps=100, speed=20.0)
    assert warned(ev.Sine(50.0, 10.0), slide, ev.Wait(0.1, steps=99)).startswith("motion 2 has")
    assert warned(ev.Sine(51.0, 10.0), slide).startswith("motion 1 has 19.6 steps")
    assert warned(ev.Sine(51.0, 10.0), ev.Wait(1e-4), ev.Slide(1.0, steps=1)) == ""

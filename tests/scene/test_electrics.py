"""Alternating voltage in scene files and plans: keys, mistakes, time scales."""

from dataclasses import replace

import numpy as np
import pytest
from tools.refusals import refuses
from tools.scenes import HOVER, WAIT, head

import evfem as ev
from evfem.errors import InputError
from evfem.scene.file import dump, loads


def thin(scene):
    """Below 0.3 mm of skin."""
    return scene.electrics.of_skin(0.3)


HEAD = head('law = "strong_troxel"\ninsulator = "touchscreen"')
MEAN = 'amplitude = 100.0\nfrequency = 250.0\nskin = "gabriel_dry"\ngap_conductivity = 1e-8\n'


def test_keys_make_a_drive_and_are_written_again():
    scene = loads(HEAD + MEAN + HOVER)
    assert scene.voltage == pytest.approx(100.0 / np.sqrt(2.0), rel=1e-15)
    assert scene.drive == ev.Drive(250.0, skin="gabriel_dry", gap_conductivity=1e-8)
    assert loads(dump(scene)) == scene
    assert loads(dump(scene)).digest() == scene.digest()
    square = loads(
        HEAD + 'amplitude = 90.0\nfrequency = 60.0\nwaveform = "square"\ndrive = "resolved"\n' + HOVER + WAIT
    )
    assert square.voltage == 90.0
    assert square.electrics.voltage == ev.Square(60.0, 90.0)
    assert square.electrics.largest_voltage == 90.0
    assert loads(dump(square)) == square
    plain = loads(HEAD + "voltage = 70.0\n" + HOVER)
    assert plain.drive is None
    assert "drive" not in dump(plain)
    assert [term.name for term in ev.plan(plain).terms].count("drive") == 0


def test_skin_from_a_table_stands_beside_the_scene(tmp_path):
    (tmp_path / "skin.csv").write_text("frequency,eps_r,conductivity\n10,2000,1e-4\n1000,1000,1e-4\n")
    text = HEAD + 'voltage = 70.0\nfrequency = 10.0\nskin = "skin.csv"\n' + HOVER
    scene = loads(text, tmp_path)
    layers = thin(scene).attraction[1]
    expected = ev.electrostatics.complex_length(
        10.0, skin=ev.Dielectric(2000.0, (), 1e-4), skin_thickness=0.3, insulator=ev.TOUCHSCREEN
    )
    assert layers.reduced + 1j * layers.loss == pytest.approx(expected, rel=1e-12)
    refuses(r"electrostatics\.skin", dump, scene)


@pytest.mark.parametrize(
    ("keys", "motion", "message"),
    [
        ("voltage = 70.0\namplitude = 100.0\nfrequency = 5.0\n", HOVER, "voltage and amplitude"),
        ('voltage = 70.0\nskin = "gabriel_dry"\n', HOVER, "frequency: missing"),
        ("voltage = 70.0\nfrequency = 0.0\n", HOVER, r"electrostatics\.frequency"),
        ('voltage = 70.0\nfrequency = 5.0\nskin = "leather"\n', HOVER, r"electrostatics\.skin"),
        ('voltage = 70.0\nfrequency = 5.0\nskin = "none.csv"\n', HOVER, r"electrostatics\.skin"),
        ('voltage = 70.0\nfrequency = 5.0\ndrive = "both"\n', HOVER, r"electrostatics\.drive"),
        ('voltage = 70.0\nfrequency = 5.0\ndrive = "resolved"\n', HOVER, "no motion that takes any"),
        ("amplitude = -1.0\nfrequency = 5.0\n", HOVER, r"electrostatics\.amplitude"),
        ("voltage = 70.0\nfrequency = 5.0\ngap_conductivity = -1.0\n", HOVER, "gap_conductivity"),
        (
            'voltage_profile = [[0.0, 1.0]]\nfrequency = 5.0\ndrive = "resolved"\n',
            HOVER + WAIT,
            "VoltageProfile",
        ),
        (
            'voltage = 1.0\nfrequency = 5.0\ndrive = "resolved"\n',
            HOVER + WAIT + '[[motion]]\nkind = "voltage"\nvoltage = 5.0\n',
            "a voltage ramp in a resolved drive",
        ),
    ],
)
def test_mistakes_are_named_by_their_key(keys, motion, message):
    refuses(message, loads, HEAD + keys + motion)


def test_what_does_not_go_together_in_python():
    scene = loads(HEAD + MEAN + HOVER + WAIT)
    slow = ev.Carrier(10_000.0, 100.0, resolved=False)
    assert replace(scene, voltage=slow, drive=ev.Drive(skin="raicu")).drive.skin == "raicu"
    for voltage, drive, message in (
        (slow, ev.Drive(50.0), "beside a carrier"),
        (ev.Carrier(10_000.0, 100.0), ev.Drive(), "a resolved carrier in a mean"),
        (slow, ev.Drive(resolved=True), "the mean of a carrier"),
        (ev.Sine(50.0, 100.0), ev.Drive(50.0, resolved=True), "resolved itself"),
        (ev.Sampled([0.0, 100.0], 50.0), ev.Drive(), "frequency: missing"),
        (ev.Sine(50.0, 100.0), ev.Drive(50.0), "which has its own"),
        (70.0, "mean", "a Drive, or None"),
    ):
        refuses(message, replace, scene, voltage=voltage, drive=drive)
    refuses("a drive without a law", replace, scene, law=None, voltage=0.0)
    for drive in (ev.Drive(50.0), ev.Drive(50.0, resolved=True)):
        refuses("a law and no insulator", replace, scene, surface=ev.Flat(), drive=drive)
    wave = ev.Sinusoid(terms=[[0.02, 1.0, 0.0]])
    refuses(r"surface\.insulator.*: Sinusoid with insulator=Layer", replace, scene, surface=wave)
    refuses("^adhesion: given 0.3; allowed: Dugdale", replace, scene, adhesion=0.3)
    with pytest.raises(InputError, match="normal in a resolved drive"):
        replace(scene, direction="normal", drive=ev.Drive(50.0, resolved=True))


def test_the_carriers_frequency_is_that_of_the_dielectrics():
    scene = loads(HEAD + MEAN + HOVER + WAIT)
    given = ev.Drive(skin="gabriel_dry", gap_conductivity=1e-8)
    carried = replace(scene, voltage=ev.Carrier(250.0, 100.0, resolved=False), drive=given)
    one, other = (thin(s).attraction[1] for s in (scene, carried))
    assert one == other


def test_the_plan_names_the_time_scales_and_what_is_left_out():
    scene = loads(HEAD + MEAN + HOVER)
    said = next(term.reason for term in ev.plan(scene).terms if term.name == "drive")
    assert "sine of 250 Hz, by its mean over the cycle" in said
    # sigma / (2 pi eps_0) = 180 Hz where the gap is closed; the skin's by its own constants at 250 Hz
    assert "the gap leaks below 180 Hz" in said
    assert "left out: the swing of the attraction at 500 Hz" in said
    resolved = loads(HEAD + MEAN.replace("250.0", "20.0") + 'drive = "resolved"\n' + HOVER + WAIT)
    said = next(term.reason for term in ev.plan(resolved).terms if term.name == "drive")
    assert "resolved in time with its charges" in said
    assert "3 Debye poles relax in 2.8e-07 to " in said
    assert "left out" not in said


def test_the_plan_warns_of_a_mean_that_the_tissue_would_follow():
    motion = [ev.Hover(0.5), ev.Wait(0.1, steps=10)]
    finger = ev.FingerPad(resolution="coarse", ridges=False, viscosity=1e-3)
    slow = ev.Scene(
        finger, ev.Display(insulator=ev.TOUCHSCREEN), ev.StrongTroxel(), 70.0, motion,
        drive=ev.Drive(50.0), solver=ev.Solver(dynamics="viscous"),
    )  # fmt: skip
    assert "swings at 100 Hz, and the tissue follows up to 159 Hz" in str(ev.plan(slow).warning)
    assert "swings" not in str(ev.plan(replace(slow, drive=ev.Drive(500.0))).warning)
    even, leaking = (ev.Drive(50.0, "square", gap_conductivity=sigma) for sigma in (0.0, 1e-8))
    assert "swing" not in str(ev.plan(replace(slow, drive=even)))  # its square is constant
    assert "swings at 100 Hz" in str(ev.plan(replace(slow, drive=leaking)).warning)
    signals = [replace(slow, voltage=ev.Square(50.0, 70.0, bias), drive=ev.Drive()) for bias in (0.0, 9.0)]
    assert "swing" not in str(ev.plan(signals[0]))
    assert "swings at 50 Hz" in str(ev.plan(signals[1]).warning)


def test_the_mean_of_a_signal_that_repeats_is_a_number_to_the_run():
    """A sine with a bias: no steps in time, the fundamental for the dielectrics, and both swings."""
    text = HEAD + 'signal = {kind = "sine", frequency = 75.0, amplitude = 100.0, bias = 60.0}\n'
    scene = loads(text + 'drive = "mean"\nskin = "gabriel_dry"\n' + HOVER)
    assert scene.electrics.voltage == pytest.approx(np.sqrt(60.0**2 + 5000.0))
    said = next(term.reason for term in ev.plan(scene).terms if term.name == "drive")
    assert "left out: the swing of the attraction at 75 Hz" in said
    plain = loads(text + 'drive = "mean"\n' + HOVER)
    assert plain.drive == ev.Drive()
    for one in (scene, plain):
        assert loads(dump(one)).digest() == one.digest()
    number = replace(plain, voltage=plain.electrics.voltage, drive=None)
    forces = [ev.simulate(one).electrostatic_force[-1] for one in (plain, number)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)
    samples = ev.Sampled([60.0, 160.0, 60.0, -40.0], 300.0, repeat=True)
    assert replace(plain, voltage=samples).electrics.frequency == 75.0


@pytest.mark.parametrize(
    ("signal", "voltage", "said"),
    [
        ('kind = "charge", charge = 0.02', ev.ChargeControl(0.02), "prescribed charge"),
        (
            'kind = "charge", charge = 0.02, parallel_capacitance = 0.01',
            ev.ChargeControl(0.02, parallel_capacitance=0.01),
            "prescribed charge",
        ),
        ('kind = "open_circuit", voltage = 80.0, after = 0.05', ev.OpenCircuit(80.0, 0.05), "disconnected"),
        (
            'kind = "charge", charge = {kind = "sine", frequency = 0.5, amplitude = 0.02}',
            ev.ChargeControl(ev.Sine(0.5, 0.02)),
            "prescribed charge",
        ),
    ],
)
def test_a_charge_and_an_open_circuit_have_keys(signal, voltage, said):
    made = loads(f'{HEAD}drive = "resolved"\nsignal = {{{signal}}}\n{HOVER}{WAIT}')
    assert made.voltage == voltage
    assert loads(dump(made)) == made
    assert said in next(term.reason for term in ev.plan(made).terms if term.name == "drive")

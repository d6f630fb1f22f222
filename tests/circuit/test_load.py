"""What an amplifier sees of a finger: columns and impedance against plates, capacitors, the source's work."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import exp1
from tools.builders import small_finger
from tools.domes import dome_scene
from tools.refusals import refuses

import evfem as ev
from evfem.circuit.load import Air, nodal_admittances
from evfem.finger.fingerpad import Electrical
from evfem.simulation.model import make_model
from evfem.simulation.run import Run

PAD, SMALL = ev.FingerPad(ridges=False, resolution="coarse"), small_finger(40, 3)
SCREEN = ev.Display(insulator=ev.TOUCHSCREEN, friction=0.3)
DRY = ev.Drive(frequency=1000.0, skin="gabriel_dry", gap_conductivity=1e-8)
PRESS = ev.Press(force=0.05, steps=1)
ROUGH = 0.003


def scene(drive=DRY, voltage=50.0, motion=PRESS, finger=SMALL, surface=SCREEN, **more):
    law = more.pop("law", ev.StrongTroxel())
    return ev.Scene(finger, surface, law, voltage, motion, drive=drive, **more)


@pytest.fixture(scope="module")
def pressed():
    return ev.simulate(scene(roughness_gap=ROUGH, depth=10.0))


def plates(result, frequency):
    """Admittance (S/mm, in space S) of plates that the end of a run is cut into: positions from its frame."""
    run = Run(result.scene, None)
    for request in run.requests():
        run.advance(request)
    model = run.model
    position = model.equilibrium.interface.positions(run.state.u)
    gap = np.maximum(position[:, 1] - model.surface.y, 0.0) + ROUGH
    skin = model.closing.electrics.skin.thickness
    area = model.pad.tributary(position)
    each = [
        0.0 if size == 0.0 else 1.0 / ev.electrostatics.contact_impedance(
            g, size, frequency, skin="gabriel_dry", skin_thickness=d, insulator=ev.TOUCHSCREEN,
            gap_conductivity=1e-8,
        )
        for g, size, d in zip(gap, area, np.broadcast_to(skin, gap.shape), strict=True)
    ]  # fmt: skip
    return sum(each)


def test_columns_are_those_of_plates_in_parallel(pressed):
    admittance = plates(pressed, 1000.0)
    assert pressed.current_rms[-1] == pytest.approx(50.0 * abs(admittance), rel=1e-10)
    assert pressed.power[-1] == pytest.approx(50.0**2 * admittance.real, rel=1e-10)
    assert pressed.charge[-1] == pytest.approx(50.0 * abs(admittance) / (2e3 * np.pi), rel=1e-10)
    assert pressed.total["current_rms"][-1] == pytest.approx(10.0 * pressed.current_rms[-1], rel=1e-14)


def test_the_impedance_is_that_of_the_columns(pressed):
    for given in (pressed, pressed.scene):
        found = ev.electrical_impedance(given, [75.0, 1000.0])
        assert found.unit == "ohm"
        assert found.current_rms(50.0)[1] == pytest.approx(10.0 * pressed.current_rms[-1], rel=1e-10)
        assert found.power(50.0)[1] == pytest.approx(10.0 * pressed.power[-1], rel=1e-10)
    assert 0.1 / found.impedance[0] == pytest.approx(plates(pressed, 75.0), rel=1e-10)
    plane = ev.electrical_impedance(scene(roughness_gap=ROUGH), 1000.0)
    assert (plane.unit, plane.impedance) == ("ohm mm", pytest.approx(10.0 * found.impedance[1:], rel=1e-12))


def test_local_gaps_of_rough_faces_are_in_parallel():
    """Closed faces of exponential gaps: <1/(u + s)> = e^x E1(x)/U with x = s/U (NIST DLMF 8.19.2)."""
    s, mean = 0.2 / 1650.0 + 0.001 / 3.9, 0.001
    pad = ev.FingerPad(ridges=False, resolution="coarse", electrical=Electrical(0.2, 1650.0))
    rough = {"roughness_gap": ev.ConstantRoughness(mean, distribution="exponential")}
    found = {}
    for name, gap in (("spread", rough), ("at", {"roughness_gap": 0.0})):
        one = scene(None, 0.0, ev.Press(indentation=0.1, steps=1), pad, air_layer=False, **gap)
        found[name] = 1.0 / ev.electrical_impedance(one, 1e3).impedance[0]
    ratio = s * np.exp(s / mean) * exp1(s / mean) / mean
    assert found["spread"] == pytest.approx(ratio * found["at"], rel=1e-6)


def test_in_space_areas_are_areas():
    press = ev.Press(indentation=0.2, steps=1)
    tip = dome_scene(
        press, law=ev.StrongTroxel(), voltage=50.0, surface=SCREEN, drive=DRY, roughness_gap=ROUGH
    )
    result = ev.simulate(tip)
    admittance = plates(result, 1000.0)
    assert result.current_rms[-1] == pytest.approx(50.0 * abs(admittance), rel=1e-10)
    found = ev.electrical_impedance(result, 1000.0)
    assert (found.unit, found.impedance[0]) == ("ohm", pytest.approx(1.0 / admittance, rel=1e-10))
    assert 0.0 < result.breakdown[-1] < 1.0


def test_without_losses_it_is_a_capacitor():
    lossless = ev.electrical_impedance(scene(drive=None, voltage=0.0, roughness_gap=ROUGH), [10.0, 1e5])
    assert not np.real(1.0 / lossless.impedance).any()
    farad = np.imag(1.0 / lossless.impedance) / (2.0 * np.pi * lossless.frequency)
    assert farad[0] == pytest.approx(farad[1], rel=1e-12)
    driven = ev.simulate(scene(drive=ev.Drive(frequency=500.0), roughness_gap=ROUGH))
    assert driven.power[-1] == 0.0
    assert driven.charge[-1] == pytest.approx(driven.current_rms[-1] / (1e3 * np.pi), rel=1e-12)


def test_a_cable_beside_the_finger_is_in_the_impedance_as_in_the_columns():
    """A charge of 0.02 nC/mm that swings; 0.01 nF/mm beside the finger are a capacitor, 0.1 nF over 10 mm."""
    found = []
    for beside in (0.0, 0.01):
        charge = ev.ChargeControl(ev.Sine(100.0, 0.02), parallel_capacitance=beside)
        approach = (ev.Hover(gap=0.05), ev.Wait(0.02, steps=80))
        result = ev.simulate(scene(ev.Drive(resolved=True), charge, approach, depth=10.0))
        volts, current = (np.sqrt((of[-40:] ** 2).mean()) for of in (result.voltage, result.current_rms))
        found.append(ev.electrical_impedance(result, 100.0))
        assert found[-1].current_rms(volts)[0] == pytest.approx(10.0 * current, rel=2e-3)
    alone, both = (1.0 / one.impedance[0] for one in found)
    assert both - alone == pytest.approx(2j * np.pi * 100.0 * 1e-10, rel=1e-9)


def test_in_space_a_charge_is_in_nanocoulombs_and_a_capacitance_in_nanofarads():
    found = []
    for beside in (0.0, 0.1):
        charge = ev.ChargeControl(0.02, parallel_capacitance=beside)
        motion = ev.Press(indentation=0.2, steps=1), ev.Wait(0.01, steps=1)
        tip = dome_scene(
            *motion, law=ev.StrongTroxel(), voltage=charge, surface=SCREEN, drive=ev.Drive(resolved=True)
        )
        result = ev.simulate(tip)
        assert result.charge[-1] == pytest.approx(0.02e-9, rel=1e-9)
        found.append(1.0 / ev.electrical_impedance(result, 100.0).impedance[0])
        assert found[-1].imag == pytest.approx(200.0 * np.pi * 0.02e-9 / result.voltage[-1], rel=1e-6)
    assert np.diff(found)[0] == pytest.approx(200j * np.pi * 0.1e-9, rel=1e-6)


def test_electrodes_that_end_and_a_finger_without_ground_are_capacitors_in_series():
    """Of two halves one is live: half of the current; without ground the finger joins both, with half of
    that, and half of the voltage over each gap.
    """
    halves = ev.Display(electrodes=[[-20.0, -0.1, 1.0], [0.1, 20.0, 0.0]])
    drive = ev.Drive(frequency=100.0, skin="gabriel_dry")
    runs = [
        scene(drive, finger=PAD, surface=one, motion=ev.Hover(0.1), field="full", grounded=ground)
        for one, ground in ((ev.Display(), True), (halves, True), (halves, False))
    ]
    whole, live, floating = (ev.simulate(one) for one in runs)
    assert live.current_rms[0] == pytest.approx(0.5 * whole.current_rms[0], rel=0.05)
    assert floating.current_rms[0] == pytest.approx(0.5 * live.current_rms[0], rel=0.005)
    assert floating.power[0] == pytest.approx(0.5 * live.power[0], rel=0.005)
    assert live.breakdown[0] == pytest.approx(whole.breakdown[0], rel=0.01)
    assert floating.breakdown[0] == pytest.approx(0.5 * live.breakdown[0], rel=0.005)
    for one, result in zip(runs, (whole, live, floating), strict=True):
        found = ev.electrical_impedance(one, [100.0]).current_rms(50.0)
        assert result.current_rms[0] == pytest.approx(found[0], rel=1e-9)


def test_a_finger_over_uneven_electrodes_joins_their_capacitors():
    """C_1 C_2 / (C_1 + C_2) of those over each electrode alone; the smaller has the larger voltage."""
    rows = np.array([[-20.0, 0.9, 0.0], [1.0, 20.0, 0.0]])
    drive, runs = ev.Drive(frequency=100.0), []
    for live, ground in (([1.0, 0.0], True), ([0.0, 1.0], True), ([1.0, 0.0], False)):
        display = ev.Display(electrodes=np.column_stack([rows[:, :2], live]).tolist())
        how = {"finger": PAD, "motion": ev.Hover(0.1), "field": "full", "grounded": ground}
        runs.append(ev.simulate(scene(drive, surface=display, **how)))
    first, second, joined = (one.current_rms[0] for one in runs)
    assert first > 1.3 * second
    assert joined == pytest.approx(first * second / (first + second), rel=0.01)
    over = first / (first + second)
    assert runs[2].breakdown[0] == pytest.approx(over * runs[1].breakdown[0], rel=0.02)


@pytest.mark.parametrize(
    ("wave", "voltage"),
    [
        ({"frequency": 200.0, "waveform": "square"}, 50.0),
        ({}, ev.Square(200.0, 50.0)),
        ({}, ev.Square(200.0, 50.0, bias=30.0)),
    ],
)
def test_a_square_wave_is_the_sum_of_its_first_sines(wave, voltage):
    """Of 50 V to both sides, whoever gives it; a bias has no current."""
    drive = ev.Drive(**wave, skin="gabriel_dry")
    square = ev.simulate(scene(drive=drive, voltage=voltage, roughness_gap=ROUGH))
    order = np.arange(1.0, 32.0, 2.0)
    admittance = 1.0 / ev.electrical_impedance(square, 200.0 * order).impedance
    volts = 50.0**2 * 8.0 / (np.pi * order) ** 2
    assert square.power[-1] == pytest.approx((volts * admittance.real).sum(), rel=1e-10)
    assert square.current_rms[-1] == pytest.approx(np.sqrt((volts * abs(admittance) ** 2).sum()), rel=1e-10)


@pytest.mark.parametrize("samples", [64, 256])
def test_edges_of_samples_take_one_of_them(samples):
    """A capacitor has C dU/dt, 2 U in 1/(N f), twice in a period: effective C 2 U f sqrt(2 N); with 64
    samples that is the current of a square wave.
    """
    steps = ev.Sampled(np.repeat([50.0, -50.0], samples // 2), 200.0 * samples, repeat=True)
    found = ev.simulate(scene(drive=ev.Drive(), voltage=steps, roughness_gap=ROUGH))
    farad = abs(1.0 / ev.electrical_impedance(found, 200.0).impedance[0]) / (2.0 * np.pi * 200.0)
    expected = farad * 2.0 * 50.0 * 200.0 * (2.0 * samples) ** 0.5
    assert found.current_rms[-1] == pytest.approx(expected, rel=5e-3)
    square = ev.simulate(scene(drive=ev.Drive(), voltage=ev.Square(200.0, 50.0), roughness_gap=ROUGH))
    assert square.current_rms[-1] == pytest.approx(expected * (64.0 / samples) ** 0.5, rel=2e-3)


RESOLVED = ev.Drive(skin="gabriel_dry", gap_conductivity=1e-8, resolved=True)
CYCLES = (ev.Press(indentation=0.3, steps=1), ev.Wait(duration=2e-3, steps=80))


@pytest.fixture(scope="module")
def swinging():
    sine = ev.Sine(1000.0, 50.0 * 2**0.5)
    return ev.simulate(scene(RESOLVED, sine, CYCLES, roughness_gap=ROUGH))


def test_power_and_current_of_a_resolved_drive_are_those_of_its_source(swinging):
    last = slice(-40, None)
    work = 1e-3 * (swinging.source_work[-1] - swinging.source_work[-41])
    assert swinging.power[last].mean() == pytest.approx(work / 1e-3, rel=1e-12)
    # the insulator does not conduct: the current is the rate of the electrode's charge
    rate = np.diff(swinging.charge[-41:]) / 2.5e-5
    assert swinging.current_rms[last] == pytest.approx(np.abs(rate), rel=1e-9, abs=1e-12)
    # with the mean over the cycle: 40 steps of a period, and the start has decayed to a part
    press = ev.Press(indentation=0.3, steps=1)
    mean = ev.simulate(scene(motion=press, roughness_gap=ROUGH))
    rms = np.sqrt((swinging.current_rms[last] ** 2).mean())
    assert rms == pytest.approx(mean.current_rms[-1], rel=5e-3)
    assert swinging.power[last].mean() == pytest.approx(mean.power[-1], rel=2e-2)
    assert swinging.breakdown[last].max() == pytest.approx(mean.breakdown[-1], rel=1e-2)


def test_a_step_in_several_substeps_has_the_power_of_all(swinging):
    run = Run(swinging.scene, None)
    for request, _ in zip(run.requests(), range(12), strict=False):
        run.advance(replace(request, turns=[0.3, 0.45]))
    result = run.result()
    assert result.substeps[-1] == 3
    work = 1e-3 * np.diff(result.source_work)
    assert result.power[-10:] == pytest.approx(work[-10:] / 2.5e-5, rel=1e-12)
    assert result.current_rms[-1] == pytest.approx(swinging.current_rms[11], rel=0.1)


def test_air_that_carries_no_force_breaks_down_all_the_same():
    whole = scene(drive=None, voltage=1000.0, surface=ev.Display(friction=0.3))
    found = [ev.simulate(replace(whole, air_layer=air)) for air in (True, False)]
    assert found[1].breakdown[-1] == pytest.approx(found[0].breakdown[-1], rel=0.05)
    assert any("air breaks down" in said for said in found[1].warnings)


def test_breakdown_is_the_largest_ratio_of_all_gaps():
    """A round pad has every gap, and with it nearly the worst one of the curve."""
    film = scene(drive=None, voltage=1000.0, surface=ev.Display(friction=0.3))
    result = ev.simulate(film)
    worst = 1000.0 / ev.electrostatics.inception_voltage(film.electrics.attraction[1])[0]
    assert 0.9 * worst < result.breakdown[-1] <= worst * (1.0 + 1e-12)
    (said,) = (one for one in result.warnings if "breaks down" in one)
    assert said.startswith("air breaks down in gaps of 12 to 80.8 um, at 1.2")
    assert f"at x = {result.breakdown_x[-1]:.2g} mm of the pad in step {result.step[-1]}" in said
    # the node there has that ratio by its own gap
    gap = result.frames[-1].gap[result.mesh.points[:, 0] == result.breakdown_x[-1]]
    own = gap[np.isfinite(gap)] / (gap[np.isfinite(gap)] + film.electrics.attraction[1].reduced)
    held = ev.electrostatics.breakdown_voltage(gap[np.isfinite(gap)])
    assert float(np.max(1000.0 * own / held)) == pytest.approx(result.breakdown[-1], rel=1e-9)
    assert "air breaks down from 790 V on (28.5 um)" in " ".join(str(ev.plan(film)).split())
    quiet = ev.simulate(scene(drive=None, voltage=700.0, surface=ev.Display(friction=0.3)))
    assert quiet.breakdown[-1] < 1.0
    assert not [one for one in quiet.warnings if "breaks down" in one]
    assert "breaks down" not in str(ev.plan(quiet.scene))
    # the peak of a sine is what counts
    sine = ev.simulate(scene(drive=ev.Drive(frequency=1e3), voltage=700.0, surface=ev.Display(friction=0.3)))
    assert sine.breakdown[-1] == pytest.approx(2**0.5 * quiet.breakdown[-1], rel=1e-6)


def test_a_scene_pays_only_for_what_is_in_it():
    names = ("charge", "current_rms", "power", "breakdown", "breakdown_x")
    without = ev.simulate(scene(law=None, voltage=0.0, drive=None))
    assert not set(names) & set(without.columns)
    assert not without.breakdown.any()
    direct = ev.simulate(scene(drive=None, roughness_gap=ROUGH))
    assert [name for name in names if name in direct.columns] == ["breakdown", "breakdown_x"]
    off = ev.simulate(scene(drive=None, roughness_gap=ROUGH, breakdown="off"))
    assert not set(names) & set(off.columns)
    assert off.applied_force[-1] == direct.applied_force[-1]


@pytest.mark.parametrize("direction", ["vertical", "normal"])
def test_a_limited_law_pulls_less_and_closes_the_balance(direction):
    film = {"drive": None, "finger": PAD, "surface": ev.Display(friction=0.3), "direction": direction}

    def runs(voltage, steps):
        motion = ev.Press(indentation=0.2, steps=steps)
        one = scene(voltage=voltage, motion=motion, **film)
        return [ev.simulate(replace(one, breakdown=kind)) for kind in ("warn", "limit")]

    free, held = runs(1777.0, 2)
    assert 0.7 < held.electrostatic_force[-1] / free.electrostatic_force[-1] < 0.99
    assert held.breakdown[-1] > 1.0
    assert [one for one in held.warnings if "the law holds the field" in one]
    lost = [abs(one.integrator_dissipation[-1]) / one.external_work[-1] for one in (free, held)]
    assert lost[1] < 1.2 * lost[0]
    free, held = runs(700.0, 1)
    assert held.electrostatic_force == pytest.approx(free.electrostatic_force, rel=1e-9)


def test_files_know_breakdown_and_refuse_what_has_no_limit(tmp_path):
    limited = scene(None, 900.0, PRESS, PAD, surface=ev.Display(friction=0.3), breakdown="limit")
    text = ev.scenefile.dump(limited)
    assert 'breakdown = "limit"' in text
    assert ev.scenefile.loads(text) == limited
    assert "breakdown" not in ev.scenefile.dump(scene(finger=PAD))
    refuses('electrostatics.breakdown: given "sparks"', scene, breakdown="sparks")
    refuses("electrostatics.breakdown: given limit in a resolved drive", scene, RESOLVED, breakdown="limit")
    square = ev.Drive(frequency=100.0, waveform="square")
    refuses("electrostatics.breakdown: given limit with a voltage of s", scene, square, breakdown="limit")
    wish = ev.FollowForce([0.0, 1.0], [0.0, 0.01])
    refuses(
        "electrostatics.breakdown: given limit with a voltage that is f", scene, None, wish, breakdown="limit"
    )
    refuses("scene: given no electrostatic law", ev.electrical_impedance, scene(None, 0.0, law=None), 1.0)
    refuses("frequencies: given 0", ev.electrical_impedance, scene(), 0.0)
    ev.electrical_impedance(scene(roughness_gap=ROUGH), [75.0, 1e3]).to_csv(tmp_path / "found.csv")
    rows = (tmp_path / "found.csv").read_text().splitlines()
    assert rows[0] == "frequency (Hz),impedance real (ohm mm),impedance imaginary (ohm mm)"
    assert len(rows) == 3


def test_no_doubt_below_breakdown():
    row = {"step": 1, "breakdown": 0.99, "breakdown_x": 0.0, "voltage": 1.0, "min_gap": 0.0}
    assert not list(Air().doubts(scene(), [row]))


def test_between_rough_faces_local_gaps_are_in_parallel():
    """Exponential gaps: <1/(g + u + s)> = exp((g + s)/U) E1((g + s)/U) / U, of each node with its own g."""
    volts, U = 50.0, 0.003
    even = scene(None, volts, roughness_gap=ev.ConstantRoughness(U))
    rough = replace(even, roughness_gap=ev.ConstantRoughness(U, "exponential"))
    found = []
    for one in (even, rough):
        model = make_model(one)
        pad = model.equilibrium.pad_state(model.equilibrium.rest(np.zeros(2), volts))
        of = model.attraction.parts[0], pad, model.closing.electrics, 1000.0
        found.append(nodal_admittances(*of))
    stack = pad.gap + model.closing.electrics.attraction[1].reduced
    near = (np.abs(found[0]) > 0.0) & (stack < 500.0 * U)  # farther out the exponentials overflow
    stack = stack[near]
    expected = np.exp(stack / U) * exp1(stack / U) / U * (stack + U)
    assert expected.max() > 1.5
    np.testing.assert_allclose((found[1] / found[0]).real[near], expected, rtol=1e-9)


def test_a_field_that_is_held_has_no_mean_over_local_gaps():
    rough = ev.ConstantRoughness(0.003, "gaussian")
    refuses("limit with a distribution of local gaps", scene, roughness_gap=rough, breakdown="limit")


def test_a_charge_without_a_current_has_derivatives_without_a_warning():
    """The voltage of a prescribed charge against two runs; a current that is 0 has a kink there."""
    motion, key = [ev.Hover(gap=0.5), ev.Wait(0.1, steps=2)], "electrostatics.insulator_thickness"

    def charged(thickness):
        surface = ev.Display(ev.Layer(thickness, ev.TOUCHSCREEN.eps_r))
        return scene(ev.Drive(resolved=True), ev.ChargeControl(0.02), motion, surface=surface)

    found = ev.sensitivities(charged(0.001), key, ["voltage", "current_rms"])
    wide, thin = (ev.simulate(charged(0.001 + step)).voltage for step in (1e-4, -1e-4))
    np.testing.assert_allclose(found["voltage", key], (wide - thin) / 2e-4, rtol=1e-6)
    assert found.result.current_rms.tolist() == [0.0, 0.0, 0.0]

"""Runs under alternating voltage: the mean over the cycle, and charges resolved in time."""

import re
from dataclasses import replace

import numpy as np
import pytest
from tools.builders import small_finger
from tools.meshes import block

import evfem as ev
from evfem.electrostatics import alternating_pressure, step_pressure
from evfem.planning.swings import spring_mean

SKIN = ev.Dielectric(1136.0, (), 2e-4)
SMOOTH = ev.FingerPad(resolution="coarse", ridges=False)
ELECTRICAL = ev.Electrical(0.30)
SCREEN = ev.Display(insulator=ev.TOUCHSCREEN, friction=0.4)
FREQUENCY = 75.0


def scene(drive, motion, voltage=70.0, finger=SMOOTH, **given):
    finger = replace(finger, electrical=ELECTRICAL)
    return ev.Scene(finger, SCREEN, ev.StrongTroxel(), voltage, motion, drive=drive, **given)


def closed(result):
    """What was given, and what became of it, relative to what the source gave: of the source, and of
    source and bone together.
    """
    source = result.source_work - result.electrostatic_work - result.stretch_work
    source = source - result.field_energy - result.leakage_dissipation
    bone = result.external_work + result.electrostatic_work
    names = "stored_energy kinetic_energy friction_dissipation viscous_dissipation integrator_dissipation"
    bone = bone - sum(result[name] for name in [*names.split(), "snap_dissipation"])
    return np.maximum(np.abs(source), np.abs(source + bone)) / np.abs(result.source_work).max()


def test_the_mean_of_a_hovering_pad_is_the_closed_form_at_its_nodes():
    """Far off, at the deformed gaps of its nodes."""
    drive = ev.Drive(frequency=FREQUENCY, skin="gabriel_dry", gap_conductivity=1e-8)
    far = scene(drive, [ev.Hover(2.0)])
    found = ev.simulate(far)
    frame, mesh = found.frames[-1], far.finger.mesh(2)
    gap = frame.gap[mesh.node_sets["pad"]]
    traction = frame.electrostatic_traction[mesh.node_sets["pad"]]
    given = {"skin": "gabriel_dry", "skin_thickness": 0.30, "insulator": ev.TOUCHSCREEN}
    expected = alternating_pressure(gap, 70.0, FREQUENCY, **given, gap_conductivity=1e-8)
    np.testing.assert_allclose(traction[traction > 0], expected[traction > 0], rtol=1e-12)
    assert (traction > 0).sum() > 50


def test_a_resolved_sine_has_the_mean_of_the_phasor():
    """A rigid pad whose charges follow within the cycle, beside the mean drive: the straight parts of
    the voltage cost (w h)^2 / 6.
    """
    steps, finger = 48, small_finger()
    drive = ev.Drive(frequency=FREQUENCY, skin=SKIN, gap_conductivity=1e-4, resolved=True)
    motion = [ev.Hover(2.0), ev.Wait(2.0 / FREQUENCY, steps=2 * steps)]
    resolved = ev.simulate(scene(drive, motion, finger=finger))
    mean = ev.simulate(scene(replace(drive, resolved=False), motion[:1], finger=finger))
    last = resolved.electrostatic_force[-steps:]
    assert last.mean() == pytest.approx(mean.electrostatic_force[-1], rel=(2.0 * np.pi / steps) ** 2 / 3.0)
    pulse = np.fft.rfft(last)
    assert np.argmax(np.abs(pulse[1:])) + 1 == 2  # the force swings at twice the frequency


def test_a_direct_voltage_leaks_as_the_closed_form_says():
    drive = ev.Drive(skin=SKIN, gap_conductivity=1e-7, resolved=True)
    waits = [ev.Hover(2.0), ev.Wait(1e-3, steps=5), ev.Wait(0.5, steps=5)]
    found = ev.simulate(scene(drive, waits, 100.0))
    pad = SMOOTH.mesh(2).node_sets["pad"]
    for frame in found.frames:
        gap, traction = frame.gap[pad], frame.electrostatic_traction[pad]
        on = traction > 0
        given = {"skin_eps_r": 1136.0, "skin_conductivity": 2e-4, "skin_thickness": 0.30}
        expected = step_pressure(
            frame.time, gap[on], 100.0, **given, insulator=ev.TOUCHSCREEN, gap_conductivity=1e-7
        )
        np.testing.assert_allclose(traction[on], expected, rtol=1e-6)  # its gaps open a little


def test_the_balance_of_a_soft_hovering_pad_closes_with_the_source():
    drive = ev.Drive(frequency=FREQUENCY, skin=SKIN, gap_conductivity=1e-8, resolved=True)
    found = ev.simulate(scene(drive, [ev.Hover(0.05), ev.Wait(1.0 / FREQUENCY, steps=20)]))
    assert closed(found).max() < 1e-9
    assert found.leakage_dissipation[-1] > 0.5 * found.source_work[-1] > 0.0
    assert np.abs(found.electrostatic_work).max() > 0.0


def test_without_time_or_leak_charges_change_nothing():
    """Lossless layers under a slow ramp are those of the direct voltage at every step."""
    wait = [ev.Hover(0.05), ev.Wait(0.1, steps=4)]
    signal = ev.Sine(2.0, 100.0)
    plain = ev.simulate(scene(None, wait, signal))
    charged = ev.simulate(scene(ev.Drive(resolved=True), wait, signal))
    np.testing.assert_allclose(charged.electrostatic_force, plain.electrostatic_force, rtol=1e-9)
    assert charged.leakage_dissipation[-1] == 0.0


def line(signal, drive):
    """Amplitudes of the friction force of a sliding pad at 150 Hz and below, over its mean."""
    motion = [ev.Press(force=0.05, steps=3), ev.Slide(1.6, steps=8)]
    motion.append(ev.Slide(40.0 / FREQUENCY, steps=48, speed=20.0))
    whole = replace(scene(drive, motion, signal), law=ev.Kaczmarek())
    frequency, amplitude = ev.spectrum(ev.simulate(whole), "applied_tangential_force")
    share = dict(zip(np.rint(frequency).tolist(), amplitude / amplitude[0], strict=True))
    return share[150.0], max(share[75.0], share[38.0])


@pytest.mark.slow
def test_a_sine_puts_twice_its_frequency_into_the_friction_and_a_square_wave_only_with_a_leak():
    """75 Hz on a sliding finger: a line at 150 Hz; a square wave attracts evenly without a leak."""
    given = {"skin": SKIN, "gap_conductivity": 1e-8, "resolved": True}
    sine, beside = line(70.7, ev.Drive(FREQUENCY, **given))
    assert sine > 5e-3
    assert sine > 4.0 * beside
    leaking, _ = line(100.0, ev.Drive(FREQUENCY, "square", **given))
    assert leaking > 5e-3
    even, _ = line(100.0, ev.Drive(FREQUENCY, "square", resolved=True))
    assert even < 1e-6


def test_an_open_circuit_keeps_the_force_on_a_flat_pad_whatever_the_gap():
    """The electrode is charged to 100 V over 0.2 mm and then disconnected: D stays, and so does the
    force, while the voltage grows with the gap.
    """
    flat = ev.MeshedFinger(block(8, 3), {"tissue": ev.NeoHookean(10.0, 0.3)}, ELECTRICAL)
    motion = [ev.Hover(0.2, steps=1), ev.Wait(1e-3, steps=1), ev.Hover(0.4, steps=1)]
    motion += [ev.Hover(1.7, steps=1), ev.Wait(0.1, steps=2)]
    drive = ev.Drive(skin=ev.Dielectric(1136.0), resolved=True)
    free = ev.Scene(flat, SCREEN, ev.StrongTroxel(), ev.OpenCircuit(100.0, 1e-3), motion, drive=drive)
    found = ev.simulate(free)
    np.testing.assert_allclose(found.electrostatic_force, found.electrostatic_force[0], rtol=1e-12)
    solids = 0.30 / 1136.0 + 0.001 / 3.9
    expected = 100.0 * (np.array([0.2, 0.2, 0.4, 1.7, 1.7, 1.7]) + solids) / (0.2 + solids)
    np.testing.assert_allclose(found.voltage, expected, rtol=2e-6)
    with pytest.raises(ev.InputError, match="with a resolved drive"):
        replace(free, drive=None)


def test_another_law_tells_no_balance_of_the_source():
    drive = ev.Drive(skin=SKIN, gap_conductivity=1e-7, resolved=True)
    waits = [ev.Hover(2.0), ev.Wait(1e-3, steps=2)]
    found = ev.simulate(replace(scene(drive, waits, 100.0), law=ev.Kaczmarek()))
    for name in ("source_work", "leakage_dissipation", "stretch_work", "field_energy"):
        np.testing.assert_array_equal(found[name], 0.0)
    said = next(
        term.reason
        for term in ev.plan(replace(scene(drive, waits), law=ev.Kaczmarek())).terms
        if term.name == "drive"
    )
    assert "no balance of the source" in said


PRESS = ev.Press(force=0.05, steps=2)
RATE = {"skin": "gabriel_dry", "gap_conductivity": 1e-8}


def slide(speed, distance=2.0, steps=10):
    return ev.Slide(distance, speed=speed, steps=steps, hold="force")


def swung(drive, motion, voltage=106.0, **given):
    """(friction, that of a pad without inertia) in N/mm as the run tells them, none where it does not."""
    found = ev.simulate(scene(drive, [PRESS, *motion], voltage, roughness_gap=0.005, **given))
    told = [re.findall(r"([\d.]+) N/mm", one) for one in found.warnings if "which swings" in one]
    return tuple(map(float, told[0])) if told else ()


def test_a_mean_drive_says_what_a_pad_without_inertia_has():
    """The mean of a run that resolves the voltage, whose mean attraction is the same."""
    n, voltage = 32, ev.Sine(30.0, 150.0)
    friction, alone = swung(ev.Drive(**RATE), [slide(20.0)], voltage)
    moment = scene(ev.Drive(resolved=True, **RATE), [PRESS, slide(20.0, steps=3 * n)], voltage)
    resolved = ev.simulate(replace(moment, roughness_gap=0.005)).tangential_force[-n:].mean()
    assert alone == pytest.approx(resolved, rel=3e-3)
    assert friction > 1.03 * resolved


def test_a_pad_that_slides_fast_misses_nothing():
    assert not swung(ev.Drive(frequency=30.0, **RATE), [slide(300.0)])


def test_a_square_wave_that_does_not_leak_does_not_swing():
    """As a sine it would; where the gap leaks it does (resolved: 0.0218)."""
    drive = ev.Drive(300.0, "square", skin="gabriel_dry")
    assert not swung(drive, [slide(60.0)])
    assert swung(replace(drive, waveform="sine"), [slide(60.0)])
    _, alone = swung(replace(drive, gap_conductivity=1e-7), [slide(60.0, steps=20)])
    assert alone == pytest.approx(0.0218, rel=0.01)


@pytest.mark.parametrize(
    ("motion", "voltage"),
    [
        ([slide(20.0), slide(20.0)], 106.0),
        ([slide(20.0, steps=20)], ev.VoltageProfile([0.0, 1.8, 1.9, 9.0], [106.0, 106.0, 0.0, 0.0])),
        (
            [slide(20.0, 3.0, 30)],
            ev.VoltageProfile([0, 1, 1, 1.2, 1.2, 9], [106, 106, 0, 0, 106, 106]),
        ),
        ([slide(20.0, -2.0)], 106.0),
    ],
    ids=["already slipping", "switched off at the end", "jumps", "backwards"],
)
def test_what_a_swing_leaves_out_is_that_of_the_slide_where_it_is_most(motion, voltage):
    """At 1 kHz and 20 mm/s nearly all of what the attraction adds: 0.02 N/mm are the friction without it."""
    friction, alone = swung(ev.Drive(frequency=1000.0, **RATE), motion, voltage)
    assert friction == pytest.approx(0.0234, abs=2e-4)
    assert alone == pytest.approx(0.0201, abs=1e-4)


def test_a_pad_that_sticks_is_a_spring_and_misses_nothing():
    assert not swung(ev.Drive(frequency=1000.0, **RATE), [slide(20.0, 0.1, 5)])


def test_a_soft_hand_lets_the_pad_stick_longer():
    """In series with the pad; a run that resolves the voltage has 0.0213."""
    drive, motion = ev.Drive(frequency=100.0, **RATE), [slide(100.0, 6.0, 40)]
    _, alone = swung(drive, motion, hand=ev.Hand(stiffness=0.01))
    assert alone == pytest.approx(0.0213, rel=0.01)
    _, firm = swung(drive, motion)
    assert firm == pytest.approx(0.0229, rel=0.01)


def test_friction_that_the_attraction_hardly_changes_misses_hardly_anything():
    """Of complete contact the strength counts, whatever presses."""
    law, drive = ev.AdhesiveFriction(0.01, full=0.003), ev.Drive(frequency=100.0, **RATE)
    made = scene(drive, [PRESS, slide(100.0)], 106.0, roughness_gap=0.005, friction_law=law)
    found = ev.simulate(replace(made, surface=replace(SCREEN, friction=0.0)))
    assert not any("which swings" in one for one in found.warnings)


def test_a_carrier_that_is_averaged_swings_as_a_sine():
    """Of the same frequency, with and without a drive that conducts nothing."""
    carried = swung(None, [slide(100.0)], ev.Carrier(100.0, 150.0, resolved=False))
    assert swung(ev.Drive(frequency=100.0), [slide(100.0)], 150.0 / np.sqrt(2.0)) == carried
    assert carried


def test_a_wave_on_and_off_lets_friction_rise_in_its_pauses():
    """The run that resolves it has 0.02112 N/mm (32 steps in a cycle)."""
    voltage = ev.Square(100.0, amplitude=50.0, bias=50.0)
    _, alone = swung(ev.Drive(), [slide(50.0)], voltage)
    assert alone == pytest.approx(0.02112, rel=3e-3)


def test_a_loop_tells_it_too():
    drive = ev.Drive(frequency=1000.0, **RATE)
    loop = ev.loop(scene(drive, [PRESS], 0.0, roughness_gap=0.005), largest_voltage=120.0)
    loop.step(voltage=106.0, position=0.0, duration=0.0)
    for k in range(10):
        loop.step(position=0.2 * (k + 1), duration=0.01)
    assert any("which swings" in one for one in loop.result().warnings)


@pytest.mark.parametrize(("frequency", "resolved"), [(100.0, 0.02086), (1000.0, 0.02031)])
def test_friction_with_a_memory_sticks_as_well(frequency, resolved):
    """Its bound rises only with slip, of which there is little while the spring is stretched, and falls in a
    snap: runs that resolve the voltage (40 and 32 steps in a cycle) have this mean.
    """
    law, drive = ev.SlipMemory(ev.Coulomb(), 0.0115), ev.Drive(frequency=frequency, **RATE)
    friction, alone = swung(drive, [slide(20.0, steps=20)], friction_law=law)
    assert friction == pytest.approx(0.0234, abs=1e-4)
    assert alone == pytest.approx(resolved, rel=5e-3)


def test_a_spring_under_a_triangle_has_a_closed_form():
    """A bound of 0 to 1 and back over a cycle of 2, stretched half as fast as it rises: F = t / 2 until the
    falling bound at t = 4/3, a triangle of height 2/3, whose mean is 1/3.
    """
    t = np.arange(30000) / 15000.0
    bound = np.minimum(t, 2.0 - t)
    assert spring_mean(bound, 0.5 / 15000.0) == pytest.approx(1.0 / 3.0, rel=1e-3)
    assert spring_mean(bound, 1.0) == pytest.approx(0.5, rel=1e-3)
    # a memory that follows never keeps the mean, and one that follows at rest is none
    assert spring_mean(bound[::100], 0.5 / 150.0, (1e-9, 1e9)) == pytest.approx(1.0 / 3.0, rel=1e-2)
    assert spring_mean(bound[::100], 1.0, (1e-9, 0.0)) == pytest.approx(0.5, rel=1e-3)

"""Charges of pad nodes in one step: conservation, open circuit, and the balance of energy."""

import numpy as np
import pytest
from tools.meshes import between, held

import evfem as ev
from evfem.electrostatics.laws import eps_0
from evfem.electrostatics.relaxation import Sandwich
from evfem.terms.charging import Charged, Charging

SKIN = ev.Layer(0.30, ev.Dielectric(1136.0, (), 2e-4))
STACK = Sandwich.of(SKIN, ev.TOUCHSCREEN, frequency=None, gap_conductivity=1e-8)
GAPS = np.array([0.0, 1e-3, 0.02, 0.3])
LENGTH = np.array([0.05, 0.06, 0.04, 0.05])
CHARGES = np.array([[4e3, 1e3, -50.0, 10.0], [-9e2, 2e4, 30.0, -5.0]])


def begun(seconds, voltage=80.0, charges=CHARGES, gap=GAPS, stack=STACK):
    charging = Charging(stack, GAPS.size)
    charging.begin(Charged(charges, voltage, gap, LENGTH), seconds)
    return charging


def test_charge_of_a_node_is_kept_while_its_length_changes():
    charging = begun(0.0)
    longer = 1.25 * LENGTH
    np.testing.assert_allclose(charging.after(GAPS, 80.0, longer) * longer, CHARGES * LENGTH, rtol=1e-15)
    np.testing.assert_array_equal(charging.after(GAPS, 80.0, LENGTH), CHARGES)


def test_without_time_a_voltage_changes_no_charge_and_the_law_sees_their_effective_voltage():
    charging = begun(0.0)
    seen = charging.effective(GAPS, 55.0, LENGTH)
    field = seen / (GAPS + STACK.reference)
    skin, gap, film = STACK.fields(GAPS, 55.0, CHARGES)
    np.testing.assert_allclose(field, gap, rtol=1e-14)
    np.testing.assert_allclose(gap - skin, CHARGES[0], rtol=1e-9)
    np.testing.assert_allclose(film - gap, CHARGES[1], rtol=1e-9)
    total = sum(length * one for length, one in zip(STACK.reduced(GAPS), (skin, gap, film), strict=True))
    np.testing.assert_allclose(total, 55.0, rtol=1e-12)


def test_open_circuit_force_does_not_depend_on_the_gap():
    """An electrode that keeps its charge, and layers that do not leak: the field in the gap stays."""
    gaps = np.geomspace(1e-6, 1.0, 40)
    displacement, charges = 3e4, np.array([2e3, -5e2])[:, None]
    # the electrode's own displacement fixes the field behind the second charge
    middle = displacement - charges[1]
    solid, air, film = STACK.reduced(gaps)
    volts = solid * (middle - charges[0]) + air * middle + film * displacement
    seen = STACK.effective(gaps, volts, charges)
    pressure = ev.StrongTroxel().traction(gaps, seen, ev.Layers(STACK.reference, 0.301))
    expected = 0.5 * eps_0 * (displacement + 5e2) ** 2
    np.testing.assert_allclose(pressure, expected, rtol=1e-12)
    assert np.ptp(volts) > 0.5 * np.max(volts)


def plate(depth=0.38):
    """A stiff plate of 4 mm with dry skin, whose motion changes no gap."""
    at = np.meshgrid(np.linspace(0.0, 4.0, 5), np.linspace(0.0, 2.0, 3))
    tissue = {"tissue": ev.LinearElastic(E=10.0, nu=0.0)}
    return ev.MeshedFinger(held(between(*at, "quad9")), tissue, ev.Electrical(depth, 1650.0))


def opened(motion, after=0.0, leak=1e-8, voltage=100.0):
    source, display = ev.OpenCircuit(voltage, after), ev.Display(ev.FILM, friction=0.0)
    drive = ev.Drive(gap_conductivity=leak, resolved=True)
    return ev.simulate(ev.Scene(plate(), display, ev.StrongTroxel(), source, motion, drive=drive))


@pytest.mark.parametrize("steps", [1, 3, 20])
def test_a_kept_charge_that_leaks_has_its_voltage_after_steps_of_any_length(steps):
    """U = D (s_1 + s_3 + g exp(-t / tau)) of the first displacement D, and what leaks is what the gap loses
    of its energy; steps of up to 11 tau, of which none has a current.
    """
    result = opened([ev.Hover(0.25), ev.Wait(0.01, steps=steps)])
    solid, tau = 0.38 / 1650.0 + ev.FILM.thickness / ev.FILM.eps_r, eps_0 / 1e-8
    left = np.exp(-result.time / tau)
    displacement = 100.0 / (solid + 0.25)
    np.testing.assert_allclose(result.voltage, displacement * (solid + 0.25 * left), rtol=1e-6)
    pull = 4.0 * 0.5 * eps_0 * (displacement * left) ** 2
    np.testing.assert_allclose(result.electrostatic_force, pull, rtol=1e-4, atol=1e-9 * pull[0])
    lost = 4.0 * 0.25 * 0.5 * eps_0 * displacement**2 * (1.0 - left[-1] ** 2)
    assert result.leakage_dissipation[-1] == pytest.approx(lost, rel=1e-5)
    assert np.ptp(result.source_work) < 1e-5 * lost
    assert not any("charge" in one for one in result.warnings)


@pytest.mark.parametrize("steps", [7, 10, 12])
def test_an_electrode_is_disconnected_at_its_time_however_that_is_summed(steps):
    """Ten tenths of 0.1 s are 0.09999999999999999 s."""
    result = opened([ev.Hover(0.5), ev.Wait(0.1, steps=steps), ev.Hover(0.25)], after=0.1, leak=0.0)
    capacity = 1.0 / (0.38 / 1650.0 + ev.FILM.thickness / ev.FILM.eps_r + result.min_gap[[-2, -1]])
    assert result.voltage[-1] == pytest.approx(100.0 * capacity[0] / capacity[1], rel=1e-6)
    assert result.charge[-1] == pytest.approx(result.charge[-2], rel=1e-9)


def test_a_disconnection_within_a_step_and_works_of_a_kept_charge_are_told():
    result = opened([ev.Hover(0.5), ev.Wait(0.2, steps=1), ev.Hover(0.1)], after=0.05, leak=0.0)
    late, works = result.warnings
    assert late.startswith(
        "step 2: the electrode is disconnected at the end of this step, 0.2 s, not at 0.05 s"
    )
    wrong = result.source_work[2] - result.source_work[1]
    assert works.startswith(f"source_work changes by {wrong:.2g} N mm/mm although no charge flows")
    fine = opened([ev.Hover(0.5), ev.Wait(0.05), ev.Hover(0.1, steps=200)], after=0.05, leak=0.0)
    assert not any("charge" in one for one in fine.warnings)
    pull = 0.4 * fine.electrostatic_force[1]
    assert fine.electrostatic_work[-1] - fine.electrostatic_work[1] == pytest.approx(pull, rel=0.01)


def test_derivatives_by_the_moment_of_disconnection_say_where_there_is_none():
    source, gap = ev.OpenCircuit(100.0, 0.01), [ev.Hover(0.5), ev.Wait(0.01, steps=3), ev.Hover(0.2)]
    display, drive = ev.Display(ev.FILM, friction=0.0), ev.Drive(resolved=True)
    scene = ev.Scene(plate(), display, ev.StrongTroxel(), source, gap, drive=drive)
    found = ev.sensitivities(scene, ["electrostatics.signal.after", "electrostatics.signal.voltage"])
    assert np.isnan(found["voltage", "electrostatics.signal.after"][-1])
    assert "no longer on the other" in found.reasons["electrostatics.signal.after"]
    by_voltage = found["voltage", "electrostatics.signal.voltage"]
    np.testing.assert_allclose(by_voltage, ev.simulate(scene).voltage / 100.0, rtol=1e-4)


#: a skin and an insulator with Debye poles, and their polarisations beside the charges
RELAXING = Sandwich.of(
    ev.Layer(0.30, ev.Dielectric(80.0, [(900.0, 2e-3, 0.0), (300.0, 2e-5, 0.0)], 2e-4)),
    ev.Layer(0.001, ev.Dielectric(3.0, [(0.9, 5e-4, 0.0)], 1e-10)),
    frequency=None, gap_conductivity=1e-8, gap_eps_r=1.0,
)  # fmt: skip
POLARISED = np.concatenate(
    [CHARGES, [[2e4, -3e3, 9e2, 10.0], [-1e3, 4e3, 80.0, 5.0], [500.0, 200.0, 9.0, 1.0]]]
)


@pytest.mark.parametrize("seconds", [1e-5, 1e-3, 0.1])
@pytest.mark.parametrize("volts", [80.0, -30.0])
@pytest.mark.parametrize(("stack", "charges"), [(STACK, CHARGES), (RELAXING, POLARISED)])
def test_source_work_is_field_energy_leakage_and_work_while_the_pad_moves(seconds, volts, stack, charges):
    """Every term from its own integral; the work by quadrature of the pressure."""
    from scipy.integrate import quad

    gaps = GAPS + np.array([2e-4, -5e-4, 0.01, -0.1])
    charging = begun(seconds, charges=charges, stack=stack)
    new = Charged(charging.after(gaps, volts, LENGTH), volts, gaps, LENGTH)
    flow = charging.flow(new)
    work = 0.0
    for i in range(GAPS.size):
        pressure = lambda g, x=charges[:, i]: 0.5 * eps_0 * stack.fields(g, 80.0, x)[1] ** 2  # noqa: E731
        work += LENGTH[i] * quad(pressure, gaps[i], GAPS[i], epsrel=1e-12)[0]
    stored = charging.field_energy(new) - charging.field_energy(charging.old)
    scale = max(abs(flow.source_work), flow.leakage, abs(stored))
    assert flow.source_work == pytest.approx(stored + flow.leakage + work, abs=1e-9 * scale)
    assert flow.leakage > 0.0


def test_longer_shares_take_the_fields_energy():
    """With given charges of the nodes and a given voltage the field's work per length is its energy."""
    charging = begun(0.0)
    shares = [LENGTH * (1.0 + h) for h in (-1e-4, 1e-4)]
    ends = [Charged(charging.carried(one), 80.0, GAPS, one) for one in shares]
    source = (
        eps_0
        * 80.0
        * sum(
            sign * float(np.sum(end.length * STACK.fields(GAPS, 80.0, end.charges)[0]))
            for sign, end in zip((-1.0, 1.0), ends, strict=True)
        )
    )
    stored = charging.field_energy(ends[1]) - charging.field_energy(ends[0])
    density = charging.energy_density(charging.old)
    assert source - stored == pytest.approx(float(density @ (shares[1] - shares[0])), rel=1e-7)


def test_derivative_by_the_gap_follows_the_charges():
    charging = begun(2e-4)
    step = 1e-30
    slope = charging.effective(GAPS + 1j * step, 60.0, LENGTH).imag / step
    low, high = (charging.effective(GAPS + d, 60.0, LENGTH) for d in (-1e-7, 1e-7))
    np.testing.assert_allclose(slope, (high - low) / 2e-7, rtol=1e-5)


def test_charges_that_pull_from_the_first_moment_are_no_snap():
    """Half of their work on a finger that comes from afar is left over, as of a weight that is let go."""
    pad = ev.FingerPad(resolution="coarse", ridges=False)
    motion = [ev.Hover(gap=0.5), ev.Wait(1.0, steps=1)]
    drive = ev.Drive(resolved=True)
    result = ev.simulate(ev.Scene(pad, ev.Display(), ev.StrongTroxel(), 1.0, motion, drive=drive))
    assert result.jumps.tolist() == [0, 0]
    assert result.snap_dissipation.tolist() == [0.0, 0.0]
    half = 0.5 * result.electrostatic_work[0]
    assert result.integrator_dissipation[0] == pytest.approx(half, rel=1e-3)
    assert not result.warnings

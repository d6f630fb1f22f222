"""Charges of pad nodes in one step: conservation, open circuit, and the balance of energy."""

import numpy as np
import pytest

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

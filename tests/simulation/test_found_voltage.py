"""Voltages that are found, of a charge and of a gap, against the closed forms of a plate on a spring.

Under a given voltage the plate snaps at a third of its gap; under a charge, or at a gap, it never does.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tools.pads import seen

import evfem as ev
from evfem.electrostatics.laws import eps_0
from evfem.mesh.mesh import Mesh
from evfem.simulation.barrier import rise
from evfem.simulation.run import Run
from evfem.simulation.works import SubstepWork
from evfem.terms.traction import smallest_gap

SKIN = ev.Electrical(stratum_corneum_thickness=0.01, stratum_corneum_eps_r=1e5)
SCREEN = ev.Display(ev.Layer(0.01, 3.0), friction=0.0)
#: gap (mm) from which the plate comes, and the reduced thickness of the solids
GAP, SOLIDS = 0.1, 0.01 / 3.0 + 1e-7
RESOLVED = ev.Drive(resolved=True)
ALONG = np.array([-8.0, -7.0, -1.0, 0.0, 1.0, 7.0, 8.0])


@cache
def plate(dim, apart=1.0):
    """A stiff bar or plate on far columns, so that it cannot tilt; its pad is the middle, 2 mm wide."""
    x, y = ALONG, np.array([0.0, 1.0, 2.0, 4.5, 7.0])
    grids = np.meshgrid(y, *[x] * (dim - 1), indexing="ij")
    points = np.column_stack([grids[-1].ravel(), grids[0].ravel(), *(g.ravel() for g in grids[1:-1])])
    number = np.arange(len(points)).reshape(grids[0].shape)
    cut = lambda *at: number[tuple(slice(a, a - 1 or None) for a in at)].ravel()  # noqa: E731
    if dim == 2:
        cells, kind = np.stack([cut(0, 0), cut(0, 1), cut(1, 1), cut(1, 0)], axis=1), "quad"
    else:
        below, above = ([(k, 0, 0), (k, 0, 1), (k, 1, 1), (k, 1, 0)] for k in (0, 1))
        cells, kind = np.stack([cut(*at) for at in [*below, *above]], axis=1), "hexahedron"
    middle = points[cells].mean(axis=1)
    far = (np.abs(middle[:, [0, 2][: dim - 1]]) > 7.0).all(axis=1)
    cells = cells[(middle[:, 1] < 2.0) | far]
    used, cells = np.unique(cells, return_inverse=True)
    points, cells = points[used], cells.reshape(-1, 2**dim)
    region = (points[cells].mean(axis=1)[:, 1] > 2.0).astype(int)
    inside = (np.abs(points[:, [0, 2][: dim - 1]]) <= 1.0).all(axis=1)
    sets = {
        "pad": np.flatnonzero((points[:, 1] == 0.0) & inside),
        "bone": np.flatnonzero(points[:, 1] == 7.0),
    }
    mesh = Mesh(points, cells, kind, region, {"plate": 0, "columns": 1}, sets)
    laws = {"plate": ev.LinearElastic(E=2e4, nu=0.0), "columns": ev.LinearElastic(E=0.1, nu=0.0)}
    return ev.MeshedFinger(mesh, laws, electrical=SKIN)


def scene(dim, voltage, motion, drive=None, **given):
    motion = [ev.Hover(GAP), *motion]
    return ev.Scene(plate(dim), SCREEN, ev.StrongTroxel(), voltage, motion, drive=drive, **given)


class Rising:
    """A charge (nC, per mm in the plane) whose square grows evenly to that of `last` in a second."""

    highest_frequency = 0.0

    def __init__(self, last):
        self.last, self.largest = last, abs(last)

    def __call__(self, time):
        return self.last * np.sqrt(time)


def spring(dim):
    """Stiffness (N/mm, N) of the columns, and the pad's width or area: 1 mm wide, 5 mm high."""
    return 0.1 * 2.0 ** (dim - 1) / 5.0, 2.0 ** (dim - 1)


def charging(dim, farthest=0.5):
    """A plate whose charge takes it to `farthest` of its gap, in equal parts of 1/8."""
    k, area = spring(dim)
    travel = farthest * GAP * np.arange(9) / 8.0
    charge = np.sqrt(2.0 * eps_0 * area * k * travel)
    signal = ev.ChargeControl(Rising(1e6 * charge[-1]))
    return scene(dim, signal, [ev.Wait(1.0, steps=8)], RESOLVED), travel, charge


@pytest.mark.parametrize("dim", [2, 3])
def test_a_charge_holds_a_plate_beyond_a_third_of_its_gap(dim):
    """x = Q^2 / (2 eps_0 A k), U = Q (g + s) / (eps_0 A), which falls beyond a third."""
    asked, travel, charge = charging(dim)
    found, (k, area) = ev.simulate(asked), spring(dim)
    np.testing.assert_allclose(GAP - found.min_gap, travel, rtol=2e-3, atol=1e-9)
    volts = charge * (found.min_gap + SOLIDS) / (eps_0 * area)
    np.testing.assert_allclose(found.voltage, volts, rtol=2e-4)
    assert found.voltage[-1] < found.voltage.max()
    assert found.relaxations.sum() == 0
    assert found.newton_iterations.max() <= 8
    # the balance of the source closes beyond a third too
    spent = found.field_energy + found.electrostatic_work + found.stretch_work
    np.testing.assert_allclose(found.source_work, spent, rtol=1e-5)
    # the columns store k x^2 / 2; the works of the bone are left out, whose remainder is a column itself
    np.testing.assert_allclose(found.stored_energy, 0.5 * k * travel**2, rtol=3e-3, atol=1e-12)
    # without leak the field's energy is Q U / 2
    np.testing.assert_allclose(2.0 * found.field_energy[1:], (charge * found.voltage)[1:], rtol=1e-7)


@pytest.mark.parametrize(("farthest", "steps"), [(0.5, 8), (0.9, 2), (0.9, 8)])
def test_a_plate_under_a_charge_passes_no_barrier(farthest, steps):
    """Its energy k x^2 / 2 + Q^2 (g + s - x) / (2 eps_0 A) is convex; under a voltage it would snap."""
    asked, travel, _ = charging(2, farthest)
    asked = replace(asked, motion=[ev.Hover(GAP), ev.Wait(1.0, steps=steps)])
    found = ev.simulate(asked)
    np.testing.assert_allclose(GAP - found.min_gap, travel[:: 8 // steps], rtol=2e-3, atol=1e-9)
    assert found.jumps.sum() == 0
    assert found.snap_dissipation[-1] == 0.0
    assert not [one for one in found.warnings if "snaps" in one or "pass an energy barrier" in one]


def test_the_barrier_under_a_charge_is_that_of_its_potential():
    """k x^2 / 2 + Q^2 / (2 (C + C_p)) with twice the plate's capacity beside it, between the stable height
    and the top, at 0.9 of the charge from which on it snaps; back from contact likewise.
    """
    k, area = spring(2)
    wide = GAP + SOLIDS
    parallel = 2.0 * eps_0 * area / wide
    x = np.linspace(0.0, GAP, 100_001)
    capacity = eps_0 * area / (wide - x)
    most = ((capacity + parallel) * (wide - x) * np.sqrt(2.0 * k * x / (eps_0 * area))).max()
    runs = []
    for charges in ([0.9], [1.2, 0.9]):
        times, charge = np.arange(1.0, 1.0 + len(charges)), 1e6 * most * np.array(charges)
        signal = ev.ChargeControl(Along(times, charge), parallel_capacitance=1e6 * parallel)
        asked = scene(2, signal, [ev.Wait(float(len(charges)), steps=10 * len(charges))], RESOLVED)
        run, target = through(asked)
        runs.append(run)
    hovering, closed = runs
    assert closed.state.touching.any() > hovering.state.touching.any()
    potential = 0.5 * k * x**2 + (0.9 * most) ** 2 / (2.0 * (capacity + parallel))
    stable, top = np.argmin(potential[:40_000]), np.argmax(potential[:90_000] * (x[:90_000] > 0.03))
    stored = closed.model.body.energy(closed.state.u)
    there = rise(SubstepWork(hovering.model, hovering.state, closed.state), target) * stored
    back = rise(SubstepWork(hovering.model, closed.state, hovering.state), target) * stored
    assert there == pytest.approx(potential[top] - potential[stable], rel=0.05)
    assert back == pytest.approx(potential[top] - potential[-1], rel=0.05)


def beside(share, farthest):
    """A plate whose capacity is so many times that beside it, with the charge of a travel (mm) in equal
    parts: with w = gap + solids, C = eps_0 A / (w - x), the force k x takes the charge
    Q = (C + C_p) (w - x) sqrt(2 k x / (eps_0 A)).
    """
    k, area = spring(2)
    wide = GAP + SOLIDS
    parallel = eps_0 * area / wide / share
    travel = farthest * np.arange(1, 9) / 8.0
    capacity = eps_0 * area / (wide - travel)
    charge = (capacity + parallel) * (wide - travel) * np.sqrt(2.0 * k * travel / (eps_0 * area))
    times = travel / farthest
    signal = ev.ChargeControl(Along(times, 1e6 * charge), parallel_capacitance=1e6 * parallel)
    return scene(2, signal, [ev.Wait(1.0, steps=8)], RESOLVED), travel, charge, parallel


class Along:
    """A charge (nC/mm) that is linear between times (s)."""

    highest_frequency = 0.0

    def __init__(self, times, charges):
        self.times, self.charges, self.largest = np.append(0.0, times), np.append(0.0, charges), max(charges)

    def __call__(self, time):
        return np.interp(time, self.times, self.charges)


def test_what_is_beside_the_finger_takes_a_share_of_the_charge():
    """With C_p = C_0 / 2 a plate is stable at every travel, g/3 (1 + 2) = g; the voltage is Q / (C + C_p)."""
    asked, travel, charge, parallel = beside(2.0, 0.6 * GAP)
    found, (_, area) = ev.simulate(asked), spring(2)
    np.testing.assert_allclose(GAP - found.min_gap[1:], travel, rtol=5e-3)
    capacity = eps_0 * area / (found.min_gap[1:] + SOLIDS)
    np.testing.assert_allclose(found.voltage[1:], charge / (capacity + parallel), rtol=2e-4)
    assert found.relaxations.sum() == 0
    spent = found.field_energy + found.electrostatic_work + found.stretch_work
    np.testing.assert_allclose(found.source_work, spent, rtol=1e-5)
    np.testing.assert_allclose(2.0 * found.field_energy[1:], charge * found.voltage[1:], rtol=1e-6)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("share", [0.05, 0.5])
def test_with_a_cable_beside_it_a_plate_under_a_charge_snaps(share):
    """At x = w / 3 (1 + C_0 / C_p) the charge that x takes is the largest. 2 % less has the travel of that
    charge; 2 % more has no equilibrium before the plate lands.
    """
    limit = (GAP + SOLIDS) / 3.0 * (1.0 + share)
    asked, travel, charge, _ = beside(share, limit)
    below, over = (ev.simulate(replace(asked, voltage=scaled(asked, f))) for f in (0.98, 1.02))
    taken = lambda x: np.interp(x, travel, charge) - 0.98 * charge[-2]  # noqa: E731
    assert taken(GAP - below.min_gap[-2]) == pytest.approx(0.0, abs=0.005 * charge[-1])
    assert GAP - below.min_gap[-1] < limit
    assert over.min_gap[-1] < 0.05 * GAP


def scaled(asked, factor):
    """The charge of a scene times a factor."""
    given = asked.voltage.charge
    return replace(asked.voltage, charge=Along(given.times[1:], factor * given.charges[1:]))


def test_a_disconnected_electrode_shares_its_charge_with_what_is_beside():
    """U (C + C_p) stays as the plate is lifted from 0.1 to 0.2 mm."""
    (_, area), parallel = spring(2), 1e-6
    signal = ev.OpenCircuit(20.0, after=0.1, parallel_capacitance=parallel)
    motion = [ev.Wait(0.1, steps=1), ev.Hover(2.0 * GAP), ev.Wait(0.1, steps=1)]
    found = ev.simulate(scene(2, signal, motion, RESOLVED))
    total = eps_0 * area / (found.min_gap + SOLIDS) + 1e-6 * parallel
    np.testing.assert_allclose(found.voltage * total, 20.0 * total[1], rtol=1e-3)
    assert found.voltage[-1] > 20.5


def test_a_charge_that_leaks_leaves_the_voltage_of_the_insulator():
    """Long after, no field is left in a skin and a gap that conduct: U = Q s_3 / (eps_0 A), no force."""
    leak = ev.Drive(skin=ev.Dielectric(1e5, conductivity=1e-3), gap_conductivity=1e-4, resolved=True)
    found = ev.simulate(scene(2, ev.ChargeControl(0.05), [ev.Wait(1.0, steps=4)], leak))
    charge, (_, area) = 0.05e-6, spring(2)
    assert found.electrostatic_force[0] == pytest.approx(charge**2 / (2.0 * eps_0 * area), rel=1e-3)
    assert found.electrostatic_force[-1] < 1e-9 * found.electrostatic_force[0]
    assert found.voltage[-1] == pytest.approx(charge * 0.01 / 3.0 / (eps_0 * area), rel=1e-6)


def test_a_charge_is_kept_by_a_finger_under_a_given_force():
    """Voltage and height of the bone are found together."""
    soft = ev.FingerPad(resolution="coarse", ridges=False, electrical=ev.Electrical(0.30))
    screen = ev.Display(insulator=ev.TOUCHSCREEN, friction=0.4)
    motion = [ev.Press(force=0.02, steps=2), ev.Wait(0.16, steps=2, hold="force")]
    asked = ev.ChargeControl(Rising(0.1))
    found = ev.simulate(ev.Scene(soft, screen, ev.StrongTroxel(), asked, motion, drive=RESOLVED))
    np.testing.assert_allclose(found.applied_force[1:], 0.02, rtol=1e-7)
    charge = 2e6 * found.field_energy[2:] / found.voltage[2:]
    np.testing.assert_allclose(charge, 0.1 * np.sqrt([0.08, 0.16]), rtol=1e-7)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_voltage_is_found_for_every_gap_through_the_pull_in_and_back(dim):
    """U^2 = 2 k x (g + s)^2 / (eps_0 A): up to a third of the gap, down beyond, and the same way back; at no
    force the square of the voltage has the error of the forces, 1e-8 of (853 V)^2 by default.
    """
    there = [ev.VoltageRamp(gap=0.02, steps=8), ev.VoltageRamp(gap=GAP, steps=2)]
    found = ev.simulate(scene(dim, 0.0, there, solver=ev.Solver(tolerance=1e-10)))
    k, area = spring(dim)
    gap = np.array([0.10, 0.09, 0.08, 0.07, 0.06, 0.05, 0.04, 0.03, 0.02, 0.06, 0.10])
    np.testing.assert_allclose(found.min_gap, gap, rtol=1e-8)
    expected = np.sqrt(2.0 * k * np.maximum(GAP - gap, 0.0) * (gap + SOLIDS) ** 2 / (eps_0 * area))
    np.testing.assert_allclose(found.voltage, expected, rtol=2e-3, atol=0.05)
    assert np.argmax(found.voltage) == 3
    assert found.voltage[9] == pytest.approx(found.voltage[4], rel=1e-6)
    assert found.relaxations.sum() == 0
    assert found.newton_iterations.max() <= 8


@pytest.mark.parametrize("dim", [2, 3])
def test_a_gap_that_its_voltage_does_not_hold_is_told_when_it_is_let_go(dim):
    """Beyond a third the equilibrium under the same voltage is not stable; before it is."""
    ramp = ev.VoltageRamp(gap=0.08, steps=2)
    ev.simulate(scene(dim, 0.0, [ramp, ev.Slide(0.01, steps=1)]))
    with pytest.warns(UserWarning, match="motion 2: the gap of 0.05 mm is prescribed, and .* do not hold it"):
        ev.simulate(scene(dim, 0.0, [replace(ramp, gap=0.05, steps=5), ev.Slide(0.01, steps=1)]))


@pytest.mark.parametrize("dim", [2, 3])
def test_of_a_wider_gap_than_without_a_voltage_the_nearest_is_taken_and_told(dim):
    """That of 0 V, also from a gap that only a voltage holds; the next ramp goes on from there."""
    motion = [
        ev.VoltageRamp(gap=0.06, steps=2),
        ev.VoltageRamp(gap=0.2, steps=1),
        ev.VoltageRamp(gap=0.08, steps=1),
    ]
    found = ev.simulate(scene(dim, 0.0, motion))
    np.testing.assert_allclose(found.min_gap, [0.1, 0.08, 0.06, 0.1, 0.08], rtol=1e-8)
    np.testing.assert_allclose(found.missed_gap, [0.0, 0.0, 0.0, 0.1, 0.0], rtol=1e-8)
    assert (found.voltage == 0.0).tolist() == [True, False, False, True, False]
    assert found.voltage[4] == pytest.approx(found.voltage[1], rel=1e-6)
    assert [one for one in found.warnings if "target" in one] == ["step 4: target 0.2, reached 0.1 mm at 0 V"]


def test_many_rows_that_miss_their_gap_are_told_in_one_sentence():
    found = ev.simulate(scene(2, 0.0, [ev.VoltageRamp(gap=0.2, steps=5), ev.VoltageRamp(gap=0.09, steps=1)]))
    (said,) = (one for one in found.warnings if "target" in one)
    assert said == "steps 2 to 6: target 0.12 to 0.2, reached 0.1 mm at 0 V"


def test_a_gap_that_is_missed_has_the_derivative_of_none():
    """Its voltage stays 0, and target less reached falls as the finger hovers higher."""
    hover = scene(2, 0.0, [ev.VoltageRamp(gap=0.2, steps=1)])
    found = ev.sensitivities(hover, ["motion.0.gap"], ["voltage", "min_gap"])
    assert found["voltage", "motion.0.gap"][-1] == 0.0
    assert found["min_gap", "motion.0.gap"][-1] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("seconds", [0.0, 1e-3])
@pytest.mark.parametrize("dim", [2, 3])
def test_derivatives_of_charge_and_gap_are_those_of_central_differences(dim, seconds):
    """At a pad that is out of shape, some nodes touching, with charges that leak."""
    leak = ev.Drive(skin=ev.Dielectric(1e5, conductivity=1e-4), gap_conductivity=1e-8, resolved=True)
    run = Run(scene(dim, 100.0, [ev.Wait(1.0, steps=1)], leak), None)
    attraction, rest = run.model.attraction, run.model.equilibrium.interface.positions(run.state.u)
    random = np.random.default_rng(3)
    position = rest + random.uniform(0.0, 0.05, rest.shape)
    position[0, 1] = -0.01
    charges = 1e3 * random.standard_normal((2, len(rest)))
    before = replace(seen(attraction, rest, 90.0), memory={"charges": charges})
    attraction.begin(before, seconds)

    def pad(place, voltage=120.0):
        return seen(attraction, place, voltage, pressing=np.zeros(len(rest)))

    for measure in (attraction.electrode_charge, smallest_gap):
        reading, step = measure(pad(position)), 1e-6
        for way in random.standard_normal((6, *rest.shape)):
            if measure is not smallest_gap:
                way[0, 1] = 0.0  # a touching node is held by contact
            ends = [measure(pad(position + side * step * way)).value for side in (1.0, -1.0)]
            slope = (ends[0] - ends[1]) / (2.0 * step)
            assert np.sum(reading.by_position * way) == pytest.approx(slope, rel=2e-5)
        volts = [measure(pad(position, 120.0 + side)).value for side in (1.0, -1.0)]
        assert reading.by_voltage == pytest.approx(500.0 * (volts[0] - volts[1]), rel=1e-9)


@cache
def column(dim):
    """A plate of 2 mm below a column, nothing far: the softest way from a gap to a snap."""
    y, ends = np.array([0.0, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5]), (-1.0, 1.0)
    if dim == 2:
        points, ring = np.array([[a, b] for b in y for a in ends]), np.array([0, 1, 3, 2])
        kind = "quad"
    else:
        points = np.array([[a, b, c] for b in y for c in ends for a in ends])
        ring, kind = np.array([0, 1, 3, 2, 4, 5, 7, 6]), "hexahedron"
    cells = 2 ** (dim - 1) * np.arange(6)[:, None] + ring
    sets = {"pad": np.flatnonzero(points[:, 1] == 0.0), "bone": np.flatnonzero(points[:, 1] == 5.5)}
    return Mesh(points, cells, kind, np.array([0, 1, 1, 1, 1, 1]), {"plate": 0, "column": 1}, sets)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("ratio", [2e3, 2e4, 2e5])
@pytest.mark.parametrize(("share", "steps"), [(0.3, 1), (0.9, 1), (0.9, 3)])
def test_a_stiff_plate_on_a_soft_column_stays_below_its_pull_in(dim, ratio, share, steps):
    """U^2 = 2 k x (g + s)^2 / (eps_0 A), its root below a third; factors of few digits lead to the snap."""
    area, far = 2.0 ** (dim - 1), GAP + SOLIDS
    k = area / (5.0 / 0.05 + 0.5 / (0.05 * ratio))
    volts = share * np.sqrt(8.0 * k * far**3 / (27.0 * eps_0 * area))
    roots = np.roots([2.0 * k, -4.0 * k * far, 2.0 * k * far**2, -eps_0 * area * volts**2])
    laws = {"plate": ev.LinearElastic(E=0.05 * ratio, nu=0.0), "column": ev.LinearElastic(E=0.05, nu=0.0)}
    finger = ev.MeshedFinger(column(dim), laws, electrical=SKIN)
    motion = [ev.Hover(GAP), ev.VoltageRamp(volts, steps=steps)]
    found = ev.simulate(ev.Scene(finger, SCREEN, ev.StrongTroxel(), motion=motion))
    assert GAP - found.min_gap[-1] == pytest.approx(roots.real.min(), rel=1e-4)
    assert found.relaxations.sum() == 0


def ended(motion, weight=0.0):
    """A run of the plate on its spring that is done, and its last target; the plate of 16 mm x 2 mm has a
    `weight` (N/mm).
    """
    per_area = weight / 32.0
    heavy = ev.form(lambda u, v, w: per_area * v[1])
    few = ev.Solver(strategy=ev.Strategy(smallest_part=1.0, relaxation=False))
    return through(scene(2, 0.0, motion, solver=few).with_term(heavy, on=ev.Region("plate")))


def through(asked):
    run, target = Run(asked, None), None
    for request in run.requests():
        target = request.path(0.0, 1.0)
        run.advance(request)
    return run, target


@pytest.mark.parametrize("share", [0.0, 0.2, -0.2])
def test_the_barrier_of_a_plate_is_that_of_its_potential(share):
    """k x^2 / 2 - W x - eps_0 A U^2 / (2 (g + s - x)) between the stable height and the top, at half the
    voltage of pull-in, found at nine places of the way; back from contact the closed plate has one of its
    own. A weight W moves the plate by this share of its gap.
    """
    k, area = spring(2)
    whole = GAP + SOLIDS
    pull_in = np.sqrt(8.0 * k * whole**3 / (27.0 * eps_0 * area))
    weight = share * k * GAP
    hovering, target = ended([ev.VoltageRamp(0.5 * pull_in)], weight)
    closed, _ = ended([ev.Hover(0.0), ev.VoltageRamp(0.5 * pull_in), ev.Hover(GAP)], weight)
    x = np.linspace(-0.5 * GAP, GAP, 150_001)
    potential = 0.5 * k * x**2 - weight * x - eps_0 * area * (0.5 * pull_in) ** 2 / (2.0 * (whole - x))
    stable = np.argmin(potential[:100_000])
    top = stable + np.argmax(potential[stable:])
    assert closed.state.touching.any() > hovering.state.touching.any()
    stored = closed.model.body.energy(closed.state.u)
    there = rise(SubstepWork(hovering.model, hovering.state, closed.state), target) * stored
    back = rise(SubstepWork(hovering.model, closed.state, hovering.state), target) * stored
    assert there == pytest.approx(potential[top] - potential[stable], rel=0.05)
    assert back == pytest.approx(potential[top] - potential[-1], rel=0.05)


def test_the_derivatives_of_the_voltage_of_a_gap_are_those_of_the_closed_form():
    """U^2 = 2 k x (g + s)^2 / (eps_0 A): by the columns' modulus U/2E, by the thickness U/3(g + s)."""
    asked = scene(2, 0.0, [ev.VoltageRamp(gap=0.04, steps=3)])
    modulus, thickness = keys = ["finger.materials.columns.E", "electrostatics.insulator_thickness"]
    found = ev.sensitivities(asked, keys, ["voltage", "min_gap"])
    U, gap = found.result.voltage[1:], found.result.min_gap[1:]
    np.testing.assert_allclose(found["voltage", modulus][1:], U / 0.2, rtol=2e-3)
    np.testing.assert_allclose(found["voltage", thickness][1:], U / 3.0 / (gap + SOLIDS), rtol=1e-5)
    np.testing.assert_allclose(found["min_gap", modulus][1:], 0.0, atol=1e-9)


@pytest.mark.parametrize("farthest", [0.35, 0.9])
def test_the_derivatives_of_the_voltage_of_a_charge_are_those_of_the_closed_form(farthest):
    """U = Q (g + s) / (eps_0 A), x = Q^2 / (2 eps_0 A k): stiffer columns leave x/E more of the gap, and a
    thicker insulator takes a third of its thickness of gap more; beyond a third of the gap too.
    """
    asked, travel, charge = charging(2, farthest)
    modulus, thickness = "finger.materials.columns.E", "electrostatics.insulator_thickness"
    found = ev.sensitivities(asked, [modulus, thickness], ["voltage", "min_gap"])
    _, area = spring(2)
    np.testing.assert_allclose(found["min_gap", modulus], travel / 0.1, rtol=3e-3, atol=1e-9)
    by_gap = charge / (eps_0 * area)
    np.testing.assert_allclose(found["voltage", modulus], by_gap * travel / 0.1, rtol=3e-3, atol=1e-6)
    np.testing.assert_allclose(found["voltage", thickness], by_gap / 3.0, rtol=1e-5, atol=1e-6)
    assert not found.reasons

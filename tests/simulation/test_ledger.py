"""Every column of the history and every field against a formula of its own, from displacements and
nodal forces alone.
"""

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from tools.builders import INSULATOR, SKIN, watched
from tools.grids import fine_points
from tools.meshes import block
from tools.pads import seen

import evfem as ev
from evfem.simulation.model import make_model

LAW = ev.NeoHookean(E=0.1, nu=0.4, density=1e-6)
MU, LAMBDA = 0.1 / 2.8, 0.1 * 0.4 / (1.4 * 0.2)
TAU, V, G0 = 2e-3, 2000.0, 0.03
WAVES = ev.Sinusoid(friction=0.3, terms=[[0.04, 5.0, 0.3]], insulator=INSULATOR)
#: hills that touch one by one, tissue with viscosity and mass, a voltage that changes in contact
MOTION = (
    ev.Hover(0.025),
    ev.Press(indentation=0.08, steps=4),
    ev.VoltageRamp(0.5 * V, steps=2),
    ev.Slide(0.4, steps=10, speed=20.0),
    ev.Press(indentation=0.03, steps=2),
)
FINGER = ev.MeshedFinger(block(20, 2, sag=0.05), {"tissue": LAW}, SKIN, TAU)


@cache
def run():
    """The result, the model, and the state before the first and after every step; no step in parts."""
    lowest = np.min(_outline()[:, 1] - WAVES.height(_outline()[:, 0]))
    surface = WAVES.shifted(lowest - G0)
    solver = ev.Solver(element="q2", dynamics="inertial")
    scene = ev.Scene(FINGER, surface, ev.Kaczmarek(), V, MOTION, direction="normal", solver=solver)
    result, kept = watched(scene)
    assert (result.substeps == 1).all()
    return result, make_model(scene), [_start(make_model(scene)), *(SimpleNamespace(**one) for one in kept)]


def _outline():
    mesh = FINGER.mesh(2)
    return mesh.points[mesh.node_sets["pad"]]


def _start(model):
    """Undeformed, at the gap of the first motion, without a load: the voltage counts as raised in the first
    step.
    """
    bone = np.array([0.0, MOTION[0].course.lift - G0])
    u = np.tile(bone, (len(model.mesh.points), 1))
    zero = np.zeros((model.pad.nodes.size, 2))
    return SimpleNamespace(
        u=u, bone=bone, contact_force=zero, status=np.zeros(len(zero), dtype=int), attraction=zero,
        reaction=np.zeros(2), time=0.0, voltage=0.0,
    )  # fmt: skip


def positions(state):
    model = run()[1]
    return model.mesh.points[model.pad.nodes] + state.u[model.pad.nodes]


def column(name, function):
    """A column beside a function of each step's (state before, state after)."""
    result, _, states = run()
    return getattr(result, name), np.array([function(*both) for both in pairwise(states)])


def forces(state):
    """Contact forces (P, 2) in the laboratory frame by the angle of the profile."""
    angle = np.arctan(WAVES.slope(positions(state)[:, 0]))
    normal, shear = state.contact_force.T
    x, y = -np.sin(angle) * normal + np.cos(angle) * shear, np.cos(angle) * normal + np.sin(angle) * shear
    return np.stack([x, y], axis=1)


def test_the_scene_has_everything_in_it():
    result = run()[0]
    for name in ("friction_dissipation", "viscous_dissipation", "kinetic_energy", "electrostatic_work"):
        assert abs(getattr(result, name)[-3]) > 1e-12, name
    # forces along x of both kinds, contact in islands, nodes that slip and nodes that stick
    assert np.abs(result.electrostatic_force_x).max() > 1e-3 * result.electrostatic_force.max()
    assert (result.real_contact_width < 0.8 * result.contact_width)[5:10].all()
    seen = np.unique(np.concatenate([state.status for state in run()[2]]))
    assert set(seen.tolist()) == {0, 1, 2, 3}


def test_where_the_bone_is_and_what_acts_on_it():
    for name, function in {
        "position": lambda _, s: s.bone[0],
        "indentation": lambda _, s: -s.bone[1] - G0,
        "applied_force": lambda _, s: -s.reaction[1],
        "applied_tangential_force": lambda _, s: s.reaction[0],
        "normal_force": lambda _, s: forces(s)[:, 1].sum(),
        "tangential_force": lambda _, s: -forces(s)[:, 0].sum(),
        "electrostatic_force": lambda _, s: -s.attraction[:, 1].sum(),
        "electrostatic_force_x": lambda _, s: s.attraction[:, 0].sum(),
        "min_gap": lambda _, s: (
            positions(s)[:, 1] - run()[1].surface.y - WAVES.height(positions(s)[:, 0])
        ).min(),
    }.items():
        found, expected = column(name, function)
        np.testing.assert_allclose(found, expected, atol=1e-12 * np.abs(expected).max(), err_msg=name)
    result = run()[0]
    np.testing.assert_allclose(result.indentation[0], -0.025, rtol=1e-13)
    np.testing.assert_allclose(result.indentation[4:17], 0.08, rtol=1e-13)  # held by ramp and slide
    np.testing.assert_allclose(result.voltage[[0, 5, 6]], [V, 0.75 * V, 0.5 * V], rtol=1e-13)
    np.testing.assert_allclose(result.time[[0, 6, 7, 16, 18]], [0.0, 0.0, 2e-3, 0.02, 0.02], rtol=1e-12)


@cache
def quadrature():
    _, weight, value, gradient, nodes = fine_points(run()[1].body.space)
    return weight, value, gradient, nodes


def seconds(before, after):
    return float(after.time - before.time)


@cache
def masses():
    """Mass matrices (E, a, a) by their integral; nodes of the pad have none, the cell's others have it."""
    weight, value, _, nodes = quadrature()
    consistent = 1e-6 * np.einsum("aeq,beq,eq->eab", value, value, weight)
    heavy = np.array([[node not in run()[1].pad.nodes for node in cell] for cell in nodes])
    rest = np.where(heavy[:, :, None] & heavy[:, None, :], consistent, 0.0)
    assert (rest[:, ~heavy.all(axis=0)] == 0.0).any()
    return rest * (consistent.sum(axis=(1, 2)) / rest.sum(axis=(1, 2)))[:, None, None]


@cache
def rates():
    """Velocities and accelerations (N, 2) at the end of each step: backward differences over one step where a
    motion begins, of second order after that.
    """
    result, _, states = run()
    found, still = [], 0.0 * states[0].u
    last_mean = last_change = still
    for k, (before, after) in enumerate(pairwise(states)):
        dt = seconds(before, after)
        if not dt:
            found.append((still, still))
            continue
        begins = result.motion_index[k] != result.motion_index[k - 1]
        v0 = found[-1][0]
        mean = (after.u - before.u) / dt
        if begins:
            found.append((mean, (mean - v0) / dt))
            last_mean, last_change = mean, found[-1][1]
            continue
        velocity = 1.5 * mean - 0.5 * last_mean
        change = (velocity - v0) / dt
        found.append((velocity, 1.5 * change - 0.5 * last_change))
        last_mean, last_change = mean, change
    return found


def test_the_bone_carries_contact_attraction_and_inertia():
    """Sum of forces on the whole finger = mass times acceleration, M = rho times the integral."""
    nodes = quadrature()[3]
    steady = np.array([-(forces(s) + s.attraction).sum(axis=0) for s in run()[2][1:]])
    inert = np.array([np.einsum("eab,ebi->i", masses(), a[nodes]) for _, a in rates()])
    result = run()[0]
    found = np.stack([result.applied_tangential_force, -result.applied_force], axis=1)
    expected = steady + inert
    np.testing.assert_allclose(found, expected, atol=1e-7 * np.abs(expected).max())
    # inertia is seen in that balance
    assert np.abs(found - steady).max() > 1e-4 * np.abs(found).max()


def test_velocities_and_the_kinetic_energy():
    nodes, states = quadrature()[3], run()[2][1:]
    expected = []
    for state, (velocity, _) in zip(states, rates(), strict=True):
        kept = vars(state)["memory.velocity"]
        np.testing.assert_allclose(kept, velocity, atol=1e-12 * max(1.0, np.abs(velocity).max()))
        there = velocity[nodes]
        expected.append(0.5 * np.einsum("eab,eai,ebi->", masses(), there, there))
    np.testing.assert_allclose(run()[0].kinetic_energy, expected, rtol=1e-9)


def gradients(state):
    """F (2, 2, E, Q) at the points of a quadrature of higher order than the solver's."""
    _, _, gradient, nodes = quadrature()
    F = np.einsum("ajeq,eai->ijeq", gradient, state.u[nodes])
    return F + np.eye(2)[:, :, None, None]


def test_the_stored_energy_is_that_of_the_law():
    weight = quadrature()[0]

    def stored(_, state):
        F = gradients(state)
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        psi = 0.5 * MU * (np.sum(F**2, axis=(0, 1)) - 2.0 - 2.0 * np.log(J)) + 0.5 * LAMBDA * np.log(J) ** 2
        return np.sum(psi * weight)

    found, expected = column("stored_energy", stored)
    np.testing.assert_allclose(found, expected, rtol=2e-3)


def test_the_viscous_dissipation_is_that_of_each_step():
    """2 eta (E - E0) : (E - E0) / dt, eta = tau mu."""
    weight = quadrature()[0]

    def strain(state):
        F = gradients(state)
        return 0.5 * (np.einsum("kieq,kjeq->ijeq", F, F) - np.eye(2)[:, :, None, None])

    def lost(before, after):
        dt = seconds(before, after)
        change = strain(after) - strain(before)
        return 2.0 * TAU * MU / dt * np.sum(np.sum(change**2, axis=(0, 1)) * weight) if dt else 0.0

    found, each = column("viscous_dissipation", lost)
    np.testing.assert_allclose(found, np.cumsum(each), rtol=2e-3)


def test_external_work_is_the_reaction_times_way_by_trapezoids():
    """The first part begins without any load; nodes that begin to slip carry a constant shear from there."""

    def given(before, after):
        first = 0.0 if before is run()[2][0] else before.reaction
        trapezoid = 0.5 * (first + after.reaction) @ (after.bone - before.bone)
        (x0, t0), (x1, t1) = ((positions(s)[:, 0], s.contact_force[:, 1]) for s in (before, after))
        slip = 0.5 * (np.hypot(1.0, WAVES.slope(x0)) + np.hypot(1.0, WAVES.slope(x1))) * (x1 - x0)
        slip = np.where((after.status == 2) & (slip > 0.0) | (after.status == 3) & (slip < 0.0), slip, 0.0)
        begins = (before.status == 1) | ((before.status > 0) & (t0 * slip > 0.0))
        return trapezoid - 0.5 * np.sum(((t1 - t0) * slip)[begins & (after.status > 0)])

    found, each = column("external_work", given)
    np.testing.assert_allclose(found, np.cumsum(each), atol=1e-12 * np.abs(found).max())


def test_electrostatic_work_is_the_attraction_along_the_straight_way():
    """The squared voltage grows evenly; nodes that stay open go with the bone by trapezoids."""
    model, states = run()[1:]
    s, weight = np.polynomial.legendre.leggauss(60)

    def pulled(before, after):
        first = before is states[0]
        squares = 0.0 if first else before.voltage**2, after.voltage**2
        ends = [positions(before), positions(after)]
        free = (before.status == 0) & (after.status == 0)
        carried = np.where(free[:, None], after.bone - before.bone, 0.0)
        total = 0.5 * np.sum(((0.0 if first else before.attraction) + after.attraction) * carried)
        for at, share in zip(0.5 + 0.5 * s, 0.5 * weight, strict=True):
            voltage = np.sqrt((1.0 - at) * squares[0] + at * squares[1])
            place = (1.0 - at) * ends[0] + at * ends[1]
            force = model.attraction.forces(seen(model.attraction, place, voltage, before.status > 0))
            total += share * np.sum(force * (ends[1] - ends[0] - carried))
        return total

    found, each = column("electrostatic_work", pulled)
    np.testing.assert_allclose(found, np.cumsum(each), atol=1e-6 * np.abs(found).max())


def test_friction_dissipates_on_the_way_along_the_profile():
    """The arc's length by Gauss's rule; nodes that stick, or have let go, dissipate nothing."""
    s, weight = (part[:, None] for part in np.polynomial.legendre.leggauss(8))

    def lost(before, after):
        x0, x1 = positions(before)[:, 0], positions(after)[:, 0]
        middle, half = 0.5 * (x0 + x1), 0.5 * (x1 - x0)
        way = half * np.sum(weight * np.sqrt(1.0 + WAVES.slope(middle + s * half) ** 2), axis=0)
        pressed = 0.5 * (before.contact_force[:, 0] + after.contact_force[:, 0])
        slips = (after.status >= 2) | ((after.status == 0) & (before.status >= 2))
        return np.sum((0.3 * pressed * np.abs(way))[slips])

    found, each = column("friction_dissipation", lost)
    np.testing.assert_allclose(found, np.cumsum(each), atol=1e-3 * found.max())
    assert (np.array(each) > 0.0).any()


def shares(state):
    """Left and right end of every pad node's share of the outline: 1/6, 4/6, 1/6 of each edge."""
    result, model, _ = run()
    left, right = np.full(len(model.mesh.points), np.inf), np.full(len(model.mesh.points), -np.inf)
    x = model.mesh.points[:, 0] + state.u[:, 0]
    for start, end, middle in result.mesh.sides_of("pad"):
        a, L = x[start], x[end] - x[start]
        for node, begin, finish in ((start, 0.0, 1 / 6), (middle, 1 / 6, 5 / 6), (end, 5 / 6, 1.0)):
            left[node] = min(left[node], a + begin * L)
            right[node] = max(right[node], a + finish * L)
    return left[model.pad.nodes], right[model.pad.nodes]


def test_contact_pressures_are_nodal_forces_over_their_shares():
    def peak(_, state):
        left, right = shares(state)
        return (state.contact_force[:, 0] / (right - left)).max()

    def load(_, state):
        return state.contact_force[state.status > 0, 0].sum()

    result, _, _ = run()
    found, expected = column("peak_contact_pressure", peak)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-14)
    mean, pressing = column("mean_contact_pressure", load)
    np.testing.assert_allclose(mean * result.real_contact_width, pressing, rtol=1e-9, atol=1e-14)
    for pressure in (found, mean):
        assert pressure[0] == 0.0
        assert pressure[-1] > 0.0
    for frame in result.frames:
        peak_now = result.peak_contact_pressure[frame.step - 1]
        assert frame.contact_pressure.max() == pytest.approx(peak_now, rel=1e-12, abs=1e-15)
    # of one node alone the peak is a mean over its share, which is wider than the contact
    assert (result.mean_contact_pressure <= result.peak_contact_pressure)[2:].all()


def each_frame():
    result, model, states = run()
    yield from zip(result.frames, states[1:], [model] * len(states), strict=False)


def test_fields_of_the_pad():
    for frame, state, model in each_frame():
        left, right = shares(state)
        x, y = positions(state).T
        expected = {
            "gap": y - model.surface.y - WAVES.height(x),
            "contact_pressure": state.contact_force[:, 0] / (right - left),
            "shear_traction": state.contact_force[:, 1] / (right - left),
            "electrostatic_traction": np.sqrt((state.attraction**2).sum(axis=1)) / (right - left),
            "contact_status": np.choose(state.status, [0, 1, 2, 2]),
        }
        off = np.setdiff1d(np.arange(len(model.mesh.points)), model.pad.nodes)
        for name, values in expected.items():
            field = getattr(frame, name)
            np.testing.assert_allclose(field[model.pad.nodes], values, rtol=1e-9, atol=1e-14, err_msg=name)
            assert (np.isnan(field[off]) if name == "gap" else field[off] == 0).all(), name
        np.testing.assert_array_equal(frame.displacement, state.u)
        assert frame.position == state.bone[0]


def test_stresses_are_the_means_of_cauchys_over_the_cells():
    """sigma = (mu (F F^T - 1) + lambda ln J) / J with F33 = 1."""
    weight = quadrature()[0]
    whole = weight.sum(axis=1)
    for frame, state, _ in each_frame():
        F = gradients(state)
        J = F[0, 0] * F[1, 1] - F[0, 1] * F[1, 0]
        b, volume = np.einsum("ikeq,jkeq->ijeq", F, F), LAMBDA * np.log(J)
        sigma = [
            (MU * (b[0, 0] - 1.0) + volume) / J,
            (MU * (b[1, 1] - 1.0) + volume) / J,
            volume / J,
            MU * b[0, 1] / J,
        ]
        expected = np.stack([(s * weight).sum(axis=1) / whole for s in sigma], axis=1)
        largest = np.abs(expected).max(axis=0)
        np.testing.assert_allclose(frame.cauchy_stress / largest, expected / largest, atol=2e-3)
        np.testing.assert_allclose(frame.J, (J * weight).sum(axis=1) / whole, rtol=1e-5)


def test_von_mises_is_the_length_of_the_deviator():
    """sqrt(3/2 s : s), s = sigma - tr(sigma)/3; a uniaxial stress is its own measure."""
    for frame, _, _ in each_frame():
        xx, yy, zz, xy = frame.cauchy_stress.T
        full = np.zeros((len(xx), 3, 3))
        full[:, 0, 0], full[:, 1, 1], full[:, 2, 2] = xx, yy, zz
        full[:, 0, 1] = full[:, 1, 0] = xy
        deviator = full - np.trace(full, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
        expected = np.sqrt(1.5 * np.einsum("eij,eij->e", deviator, deviator))
        np.testing.assert_allclose(frame.von_mises, expected, rtol=1e-12)
    assert frame.von_mises.max() > 0.0

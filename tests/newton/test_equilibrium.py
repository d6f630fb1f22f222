"""Equilibrium steps: balance, tangent, cut and failed steps, force control."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import INSULATOR, finger
from tools.grids import rectangle
from tools.meshes import block
from tools.pads import seen
from tools.steps import balanced

from evfem.contact.signorini import BACKWARD, FORWARD, OPEN, STICK
from evfem.electrostatics.laws import Kaczmarek
from evfem.newton.control import Target
from evfem.newton.state import State, StepFailed, findings
from evfem.newton.strategy import stuck
from evfem.scene.motion import Press, Slide
from evfem.scene.scene import Scene
from evfem.simulation.model import make_model
from evfem.simulation.run import simulate
from evfem.surface.surfaces import Display, Flat, Sinusoid
from evfem.tissue.body import Body
from evfem.tissue.laws import NeoHookean

ROUND = finger(block(8, 3, sag=0.4))
GENTLE = Sinusoid(friction=0.3, terms=[[0.02, 2.0, 0.4]], insulator=INSULATOR)


def run(surface, *motion, body=ROUND, law=None, voltage=0.0, **options):
    return simulate(Scene(body, surface, law, voltage, motion, **options))


def pressed(surface, depth=0.2, **options):
    """A model and its state after one step of press."""
    scene = Scene(ROUND, surface, motion=[Press(indentation=depth)], **options)
    model = make_model(scene)
    old = model.equilibrium.rest(model.bone(0.0, 0.0), float(scene.voltage))
    return model, model.equilibrium.step(old, Target.held(model.bone(0.0, depth), float(scene.voltage)))


@pytest.mark.parametrize("surface", [Display(), GENTLE], ids=["flat", "sinusoid"])
def test_nodal_forces_of_an_accepted_state_balance(surface):
    model, state = pressed(surface, law=Kaczmarek(), voltage=2000.0)
    nodes, position = model.pad.nodes, model.mesh.points[model.pad.nodes] + state.u[model.pad.nodes]
    # contact forces rebuilt from the profile: normal (-h', 1)/q, tangent (1, h')/q at the node's x
    slope = model.surface.slope(position[:, 0])
    q = np.sqrt(1.0 + slope**2)
    normal, tangent = np.array([-slope, np.ones_like(q)]) / q, np.array([np.ones_like(q), slope]) / q
    nodal = model.body.tissue.forces(state.u)
    np.add.at(nodal, nodes, -(state.contact_force[:, 0] * normal + state.contact_force[:, 1] * tangent).T)
    touching = np.ones(nodes.size, dtype=bool)
    np.add.at(nodal, nodes, -model.attraction.forces(seen(model.attraction, position, 2000.0, touching)))
    bone = model.mesh.node_sets["bone"]
    free = np.setdiff1d(np.arange(len(nodal)), bone)
    reaction = nodal[bone].sum(axis=0)
    assert np.abs(nodal[free]).max() <= 1e-8 * np.abs(reaction).max()
    np.testing.assert_allclose(state.reaction, reaction, atol=1e-8 * np.abs(reaction).max())
    # the bone moved as told, and rigidly
    np.testing.assert_allclose(state.u[bone], np.broadcast_to([0.0, -0.2], (bone.size, 2)), atol=1e-14)


@pytest.mark.parametrize("move", [(0.0, 1.0), (1.0, 0.0), (-0.5, 1.0)], ids=["down", "along", "back"])
@pytest.mark.parametrize(
    "options",
    [
        {"surface": Display(friction=1.0)},
        {"surface": Display(friction=1.0), "law": Kaczmarek(), "voltage": 2000.0},
        {"surface": Display(friction=1.0), "law": Kaczmarek(), "voltage": 2000.0, "direction": "normal"},
        {"surface": GENTLE},
        {"surface": GENTLE, "law": Kaczmarek(), "voltage": 2000.0, "direction": "normal"},
    ],
    ids=["contact", "vertical", "normal", "profile", "profile_normal"],
)
def test_one_iteration_of_the_whole_step_leaves_a_quadratic_rest(options, move):
    # with a fresh factorisation and every pad node a candidate, the step's tangent is complete: the first
    # iteration leaves a sixteenth for a quarter of the step; with any term missing it would leave a quarter
    model, state = pressed(**options)
    equilibrium, voltage = model.equilibrium, state.voltage
    equilibrium.body.linearisation.candidates = np.flatnonzero(model.pad.free)
    # settle what slides under the load, so that no status changes between the two steps, and begin them there
    state = equilibrium.step(state, Target.held(state.bone + 1e-2 * np.array(move) * [1.0, -1.0], voltage))
    rest = []
    for size in (2e-3, 5e-4):
        equilibrium.body.discard()
        equilibrium.step(
            replace(state, last_increment=0.0 * state.last_increment),
            Target.held(state.bone + size * np.array(move) * [1.0, -1.0], voltage),
        )
        rest.append(equilibrium.record.residuals[1])
    assert rest[1] < 0.1 * rest[0]


def test_a_failed_step_returns_nothing_and_leaves_its_start_alone():
    model, state = pressed(Flat())
    kept = {
        name: np.copy(getattr(state, name)) for name in ("u", "contact_force", "status", "bone", "reaction")
    }
    with pytest.raises(StepFailed) as caught:  # the bone would be below the surface
        model.equilibrium.step(state, Target.held(model.bone(0.0, 2.5), 0.0))
    assert caught.value.reason
    for name, before in kept.items():
        np.testing.assert_array_equal(getattr(state, name), before)
    # and the next possible step works as if nothing had happened
    after = model.equilibrium.step(state, Target.held(model.bone(0.0, 0.25), 0.0))
    fresh, start = pressed(Flat())
    expected = fresh.equilibrium.step(start, Target.held(fresh.bone(0.0, 0.25), 0.0))
    np.testing.assert_allclose(after.reaction, expected.reaction, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("options", [{}, {"law": Kaczmarek(), "voltage": 3000.0}], ids=["plain", "attracted"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_prescribed_force_equals_the_prescribed_indentation(friction, options):
    # the second press starts from the same state and takes one step either way, so friction has one history
    surface, first = Display(friction=friction), Press(indentation=0.25, steps=1)
    by_depth = run(surface, first, Press(indentation=0.3, steps=1), **options)
    by_force = run(surface, first, Press(force=float(by_depth.applied_force[1]), steps=1), **options)
    assert by_force.substeps.tolist() == [1, 1]
    for column in ("indentation", "applied_force", "normal_force", "electrostatic_force", "stored_energy"):
        np.testing.assert_allclose(getattr(by_force, column), getattr(by_depth, column), rtol=2e-7)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_unloading_leaves_nothing_behind(friction):
    motion = [Press(indentation=0.3, steps=3), Slide(0.3, steps=3), Press(indentation=-0.05, steps=4)]
    result = run(Flat(friction=friction), *motion)
    assert result.normal_force[5] > 0.01
    last = result.frames[-1]
    np.testing.assert_allclose(
        last.displacement, np.broadcast_to([0.3, 0.05], last.displacement.shape), atol=1e-7
    )
    assert abs(result.normal_force[-1]) < 1e-12
    assert abs(result.tangential_force[-1]) < 1e-12
    assert abs(result.stored_energy[-1]) < 1e-12
    assert (result.contact_width[-1], result.real_contact_width[-1]) == (0.0, 0.0)
    assert result.min_gap[-1] == pytest.approx(0.05, rel=1e-6)


def test_the_travel_of_the_bone_does_not_count_as_force():
    # rounding of 50 mm, times the stiffness, is more than the tolerance allows when nothing presses
    motion = [Press(indentation=0.2, steps=1), Slide(50.0, steps=2), Press(indentation=-0.2, steps=1)]
    result = run(Flat(friction=0.0), *motion, body=finger(block(8, 3, sag=0.4), E=17.0))
    assert result.substeps.tolist() == [1, 1, 1, 1]
    assert result.normal_force[2] > 1.0
    assert np.abs(result.applied_force[3]) < 1e-12


def test_iterations_that_go_to_and_fro_are_given_up_and_falling_ones_are_not():
    def given_up(one, other):
        return next(n for n in range(1, 41) if stuck([1.0, *[one, other] * 20][:n]))

    assert given_up(0.3, 0.01) == 17
    crawling = [0.09 * 0.97**i for i in range(40)]
    assert not any(stuck(crawling[:n]) for n in range(1, 41))
    wandering = [0.5, *(0.1 + 0.003 * (i * i % 17) for i in range(40))]
    assert next(n for n in range(1, 41) if stuck(wandering[:n])) == 17
    assert not any(stuck([0.95**i for i in range(n)]) for n in range(1, 60))
    assert not any(stuck([0.1] * 7 + [0.09**i for i in range(n)]) for n in range(1, 20))
    # a bone that goes its way in strides is not where it should be
    assert not any(stuck([1.0] * n) for n in range(1, 17))


def test_residuals_do_not_count_while_the_bone_is_on_its_way(monkeypatch):
    """Small ones that stay would end the step earlier."""
    model, old = pressed(Display())
    solver = model.equilibrium
    small = balanced(np.zeros(1), 0.01, old.attraction)
    monkeypatch.setattr(solver.body, "begin", lambda *_: old)
    monkeypatch.setattr(solver.body, "balance", lambda state, *_: (state, small))
    monkeypatch.setattr(solver.body, "advance", lambda old, state, *_: state)
    monkeypatch.setattr(solver.body, "findings", lambda *_: "")
    with pytest.raises(StepFailed, match="no equilibrium in"):
        solver.step(old, Target.held(model.bone(0.0, 0.3), 0.0))
    assert set(solver.record.residuals) == {1.0}


@pytest.fixture
def body():
    """A unit square of 2 x 2 cells whose upper side is the bone; nodes are numbered along x, then y."""
    space = rectangle("q1", (2, 2))
    space.mesh.node_sets["bone"] = space.mesh.node_sets["top"]
    return Body(space, {"lower": NeoHookean(E=1.0, nu=0.3)})


def described(body, forces, u=None, status=(OPEN,)):
    """Findings for nodal forces {node: (x, y)} and the bone's forces 1e3."""
    zero = np.zeros((body.space.size, 2))
    u = zero if u is None else u
    status = np.array(status)
    pad = np.zeros((status.size, 2))
    state = State(u, pad, status, zero[0], 0.0, pad, zero[0], zero, zero)
    reduced = np.zeros(body.size)
    reduced[body.bone] = 1e3
    for node, force in forces.items():
        reduced[body.unknowns[node]] = force
    return findings(body, state, balanced(reduced, 1.0, state.attraction))


def test_the_three_largest_forces_are_named_in_order_and_the_bones_are_left_out(body):
    text = described(body, {0: (1e-3, 0.0), 1: (0.0, -2e-3), 4: (3e-2, 4e-2), 5: (1e-5, 0.0)})
    expected = "5.0e-02 N/mm at (0.5, 0.5), 2.0e-03 N/mm at (0.5, 0), 1.0e-03 N/mm at (0, 0); contact"
    assert f"out of balance: {expected}" in text
    assert text.count("N/mm") == 3
    for none in (np.nan, -np.inf):  # is the largest
        text = described(body, {0: (1e6, 0.0), 5: (none, 0.0)})
        assert text.startswith("out of balance: inf N/mm at (1, 0.5), 1.0e+06 N/mm at (0, 0)")


def test_places_are_current_ones_and_statuses_counted(body):
    u, status = np.zeros((body.space.size, 2)), [OPEN] * 4 + [STICK] * 3 + [FORWARD] * 2 + [BACKWARD]
    u[4] = [0.125, -0.25]
    text = described(body, {4: (1.0, 0.0)}, u, status)
    assert "1.0e+00 N/mm at (0.625, 0.25)" in text
    assert "contact: 4 nodes open, 3 stick, 3 slip;" in text


def test_the_smallest_volume_ratio_is_that_of_the_deformation(body):
    x, y = body.space.mesh.points.T
    u = np.column_stack([0.1 * x, -0.4 * y])  # J = 1.1 x 0.6 everywhere
    assert described(body, {}, u).endswith("smallest J of a cell: 0.66")
    u[4] = [0.0, -0.45]  # the middle node alone goes further down: the cells below it are flatter
    assert float(described(body, {}, u).rsplit(" ", 1)[1]) < 0.66

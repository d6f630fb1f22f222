"""Finite elements behind the outer iteration: what counts as out of balance, and how far an update may go."""

from dataclasses import replace

import numpy as np
import pytest
from tools.builders import coarse_pad, finger
from tools.meshes import block

import evfem as ev
from evfem.newton.anderson import Anderson
from evfem.newton.control import FollowFriction, Force, GivenVoltage, Indentation, Target
from evfem.simulation.model import make_model

ROUND = finger(block(8, 3, sag=0.4))


@pytest.fixture(scope="module")
def pressed():
    """A model, its body, its state at 0.2 mm of indentation under 1000 V, and the target it was for."""
    scene = ev.Scene(ROUND, ev.Display(), ev.Kaczmarek(), 1000.0, [ev.Press(indentation=0.2)])
    model = make_model(scene)
    target = Target.held(model.bone(0.0, 0.2), 1000.0)
    state = model.equilibrium.step(model.equilibrium.rest(model.bone(0.0, 0.0), 1000.0), target)
    return model.equilibrium.body, state, target


def residual(pressed, state=None, **controls):
    body, accepted, target = pressed
    state = accepted if state is None else state
    return body.balance(state, accepted.attraction, replace(target, **controls))[1].residual


@pytest.mark.parametrize("missing", [0.01, -0.01])
def test_a_prescribed_force_counts_like_the_forces_of_the_nodes(pressed, missing):
    """Relative to the largest reaction, which is the vertical one."""
    reaction = pressed[1].reaction
    height = Force(float(-reaction[1] + missing))
    assert residual(pressed, height=height) == pytest.approx(0.01 / np.abs(reaction).max(), rel=1e-5)
    assert residual(pressed, height=Indentation(9.0)) < 1e-8


@pytest.mark.parametrize("missing", [0.01, -0.01])
def test_a_wished_friction_force_counts_while_the_voltage_is_free(pressed, missing):
    reaction = pressed[1].reaction
    control = FollowFriction(float(reaction[0] + missing), 2000.0)
    control.begin(pressed[1], None)
    assert residual(pressed, voltage=control) == pytest.approx(0.01 / np.abs(reaction).max(), rel=1e-5)
    control.begin(replace(pressed[1], voltage=0.0), None)  # at its lower bound
    assert residual(pressed, voltage=control) < 1e-8
    assert residual(pressed, voltage=GivenVoltage(5.0)) < 1e-8


def test_forces_that_add_up_count_by_their_sum(pressed):
    """Every touching node pushed with as little as can pass alone: together they are so many times more."""
    body, state, _ = pressed
    touching = state.touching
    extra = 1e-5 * touching[:, None] * [1.0, 0.0]
    found = residual(pressed, replace(state, contact_force=state.contact_force + extra))
    largest = np.abs(state.reaction).max()
    assert touching.sum() >= 3
    assert found == pytest.approx(1e-5 * touching.sum() / largest, rel=1e-3)
    assert body.size == len(state.u)


@pytest.mark.parametrize(("depth", "fraction"), [(0.3, 0.5), (0.4, 1.0), (0.55, 1.5), (0.19, 0.0)])
def test_iterations_begin_ahead_on_the_last_steps_way(pressed, depth, fraction):
    """The last step went 0.2 mm down: as far along its displacements as the bone goes now, at most
    1.5 times (`Strategy.reach`), and not at all back.
    """
    body, state, _ = pressed
    begun = body.begin(state, Target.held(np.array([0.0, -depth]), 1000.0), state)
    np.testing.assert_allclose(begun.u, state.u + fraction * state.last_increment, atol=1e-14)
    np.testing.assert_allclose(begun.bone, [0.0, -0.2 * (1.0 + fraction)], atol=1e-14)
    assert begun.contact_force is state.contact_force


@pytest.mark.filterwarnings("ignore:a finger of")
def test_forces_that_are_rounding_of_stiff_cells_are_no_imbalance():
    """A nail of 200 MPa above a finger that hovers: iterations that went on would shuffle its last
    digits, and the step would be cut. Whether the third or fourth is small enough is the machine's.
    """
    results = [
        ev.simulate(
            ev.Scene(
                coarse_pad(),
                ev.Display(),
                ev.Kaczmarek(),
                50.0,
                [ev.Hover(0.01, steps=1)],
                solver=ev.Solver(tolerance=tolerance),
            )
        )
        for tolerance in (1e-8, 1e-11)
    ]
    assert results[1].newton_iterations[0] <= 5
    assert results[1].substeps[0] == 1
    assert results[1].electrostatic_force[0] == pytest.approx(results[0].electrostatic_force[0], rel=1e-9)


def test_forces_that_are_rounding_of_the_attraction_are_no_imbalance(pressed, monkeypatch):
    """Contact carries the attraction, so the force on the bone may be much smaller than both."""
    body, accepted, target = pressed
    moved = replace(accepted, u=accepted.u + 1e-7 * np.random.default_rng(2).normal(size=accepted.u.shape))
    moved.u[body.body.space.mesh.node_sets["bone"]] = accepted.bone
    off, pulled = residual(pressed, moved), np.abs(accepted.attraction).max()
    reaction = np.abs(body.balance(moved, accepted.attraction, target)[0].reaction).max()
    monkeypatch.setattr(type(body.attraction), "rounding", 1e-3)
    rounding = 1e-3 * pulled / body.limits.tolerance
    assert rounding > reaction
    assert residual(pressed, moved) == pytest.approx(off * reaction / rounding, rel=1e-12)


@pytest.mark.parametrize(("squeeze", "taken"), [(0.9, True), (0.96, False), (1.2, False)])
def test_a_combination_of_iterates_that_collapses_cells_is_not_taken(pressed, monkeypatch, squeeze, taken):
    """A block pressed flat along y has J = 1 - squeeze everywhere, and 0.05 must be left."""
    body, state, target = pressed
    points = body.body.space.mesh.points
    flat = np.column_stack([np.zeros(len(points)), -squeeze * points[:, 1]])
    combined = replace(state, u=flat)
    monkeypatch.setattr(Anderson, "next_iterate", lambda self, before, after: combined)
    monkeypatch.setattr(body.record, "residuals", [1e-3, 2e-3])
    balance = body.balance(state, state.attraction, target)[1]
    begun, forgotten = body.begin(state, target, state), []
    monkeypatch.setattr(Anderson, "reset", lambda self: forgotten.append(1))
    after = body.advance(state, begun, target, balance)
    assert np.array_equal(after.u, flat) == taken
    assert body.body.tissue.smallest_J(after.u) > 0.05
    assert len(forgotten) == 1 + (not taken)  # once for the new tangent


@pytest.mark.parametrize(("far", "taken"), [(0.5, True), (2.0, False)])
def test_a_combination_of_iterates_whose_bone_leaves_is_not_taken(pressed, monkeypatch, far, taken):
    """It may go as far as a linear step; where its height is given it does not count."""
    body, state, target = pressed
    free = replace(target, height=Force(float(-state.reaction[1])))
    aside = np.array([0.0, far * body.travel.longest])
    combined = replace(state, u=state.u + aside, bone=state.bone + aside)
    monkeypatch.setattr(Anderson, "next_iterate", lambda self, before, after: combined)
    monkeypatch.setattr(body.record, "residuals", [1e-3, 2e-3])
    for asked, moved in ((free, taken), (target, True)):
        begun = body.begin(state, asked, state)
        balance = body.balance(state, state.attraction, asked)[1]
        after = body.advance(state, begun, asked, balance)
        assert np.array_equal(after.u, combined.u) == moved

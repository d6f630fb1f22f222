"""What the fast model says of its error: of the whole path, whatever the signal; and the signals
that it must follow.
"""

from dataclasses import replace

import numpy as np
import pytest
from tools import paths
from tools.builders import layered_finger
from tools.meshes import half_finger

import evfem as ev
from evfem.fast import error
from evfem.fast.error import (
    MARGIN,
    CorrectedRun,
    HeldFinger,
    between,
    differences,
    farthest,
    missing,
    stated_error,
)
from evfem.fast.run import FastRun
from evfem.fast.step import on_pad
from evfem.simulation.run import Run
from evfem.solver.state import StepFailed

FINGER = layered_finger(half_finger(80, 5, 1, free_ends=True))
STEPS = 30


@pytest.fixture(scope="module")
def fast():
    """The fast model at the largest load, friction and voltage, both ways."""
    return paths.trained(FINGER, way=1.5, steps=15)


def followed(fast, scene):
    """A fast run with all its states."""
    run = FastRun(fast.memory.pad, scene, *fast._parts_for(scene))
    for request in run.requests():
        run.advance(request)
    return run


# -- signals it must follow


def sine(bias, amplitude):
    """Six waves of twenty steps each over 2.4 mm."""
    places = np.linspace(0.0, 2.4, 2401)
    return ev.VoltageProfile(places, bias + amplitude * np.sin(2.0 * np.pi * places / 0.4))


@pytest.mark.parametrize(("bias", "amplitude"), [(60.0, 60.0), (1000.0, 10.0), (1250.0, 1250.0)])
@pytest.mark.parametrize("hold", ["force", "indentation"])
def test_small_modulations_are_followed_to_a_hundredth_of_the_modulation(fast, bias, amplitude, hold):
    slides = [ev.Slide(2.4, steps=120, hold=hold)]
    scene = paths.scene(FINGER, sine(bias, amplitude), slides)
    result, full = fast.simulate(scene, checks=0), ev.simulate(scene)
    for name in paths.FORCES:
        assert paths.modulation(result, full, name, steps=60) < 0.01


def test_steps_end_within_the_tolerance_of_the_scene(fast):
    scene = paths.scene(FINGER, sine(1000.0, 500.0), [ev.Slide(0.6, steps=12)])
    run = followed(fast, replace(scene, solver=ev.Solver(tolerance=1e-8)))
    assert run.model.equilibrium.record.residuals[-1] <= 1e-8


def test_a_signal_that_creeps_arrives_where_one_that_jumps_does(fast):
    """Steps that change the force by less than the tolerance add up."""
    solver = ev.Solver(tolerance=1e-3)

    def end(steps):
        display = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.4)
        motion = [ev.Press(force=0.05, steps=5), ev.VoltageRamp(300.0, steps=steps)]
        scene = ev.Scene(FINGER, display, law=ev.Kaczmarek(), voltage=0.0, motion=motion, solver=solver)
        run = followed(fast, scene)
        # what friction holds must not depend on the number of steps either
        return run.rows[-1]["electrostatic_force"], run.states[-1].u - run.states[-1].bone

    (force, shape), (crept, shape_crept) = end(1), end(60)
    assert force > 1e-5
    assert crept == pytest.approx(force, rel=1e-4)
    assert np.abs(shape_crept - shape).max() < 1e-6


# -- the error it states


@pytest.mark.parametrize("seed", range(12))
def test_the_stated_error_holds_along_random_paths(fast, seed):
    """Never below half of the true one, never far above it, unless it is the tolerance."""
    scene = paths.random_scene(seed, FINGER, STEPS)
    result, full = fast.simulate(scene, tolerance=1.0), ev.simulate(scene)
    stated, true = result.provenance["fast"]["error"], paths.errors(result, full)
    for name in paths.FORCES:
        assert 0.5 * true[name] < stated[name] < max(2.5 * true[name], 2.0 * scene.solver.tolerance)


def test_a_path_put_right_at_every_state_is_that_of_the_full_model(fast):
    """The error of the remembered displacements is all that there is."""
    scene = paths.random_scene(3, FINGER, STEPS)
    run, full = followed(fast, scene), ev.simulate(scene)
    held = HeldFinger(scene, run.whole)
    beside = np.array([missing(fast.memory, held, state) for state in run.states[1:]])
    again = CorrectedRun(run, fast.memory.pad, beside)
    for request in again.requests():
        again.advance(request)
    for name in paths.FORCES:
        one, other, true = (
            np.array([row[name] for row in rows]) for rows in (again.rows, run.rows, full.rows)
        )
        assert np.abs(one - true).max() < 0.05 * np.abs(other - true).max()


def test_the_held_finger_under_the_forces_of_an_equilibrium_is_in_it(fast):
    scene = paths.scene(FINGER, 1500.0, [ev.Slide(0.5, steps=5)])
    run = Run(scene, None)
    for request in run.requests():
        run.advance(request)
    state, pad = run.state, run.model.pad
    force = run.model.equilibrium.contact_forces(state) + state.attraction
    start = np.zeros_like(state.u)
    moved = HeldFinger(scene, pad).under(force, start)
    np.testing.assert_allclose(moved, (state.u - state.bone)[pad.nodes], atol=1e-6)


def test_a_finger_that_finds_no_equilibrium_says_so_and_the_scene_is_run_in_full(fast, monkeypatch):
    scene = paths.scene(FINGER, 1000.0, [ev.Slide(0.5, steps=5)])
    held = HeldFinger(scene, followed(fast, scene).whole)
    force = np.zeros((held.pad.nodes.size, 2))
    force[len(force) // 2, 1] = -100.0
    with pytest.raises(StepFailed):
        held.under(force, np.zeros_like(fast.memory.whole[0]))

    def fails(*_):
        raise StepFailed("no", [])

    monkeypatch.setattr(error, "missing", fails)
    with pytest.warns(UserWarning, match="finds no equilibrium"):
        result = fast.simulate(scene)
    assert result.provenance["fast"]["error"] == dict.fromkeys(paths.FORCES)
    assert result.provenance["fast"]["fallback"] is True


def test_as_many_states_are_checked_as_wanted_and_none_twice(fast):
    scene = paths.scene(FINGER, 1000.0, [ev.Slide(1.5, steps=10)], friction=0.2)
    run = followed(fast, scene)
    assert run.states[-1].contact_force is run.states[-2].contact_force
    held = HeldFinger(scene, run.whole)
    for checks in (1, 4):
        steps = stated_error(run, fast.memory, held, checks)[1]
        assert len(set(steps)) == len(steps) == checks
        assert set(steps) <= set(range(1, 16))
    # a pad that is carried along in full slip has one shape
    assert len(stated_error(run, fast.memory, held, 15)[1]) < 15


def test_states_that_are_checked_are_far_from_each_other():
    points = np.random.default_rng(1).random((200, 3, 2))
    chosen = farthest(points, 9)
    flat = points.reshape(200, -1)
    apart = np.linalg.norm(flat[:, None] - flat[chosen], axis=2)
    among = apart[chosen][~np.eye(9, dtype=bool)]
    assert chosen[0] == 0
    assert apart.min(axis=1).max() <= among.min() + 1e-12


def test_what_is_between_keeps_what_is_known_and_what_is_the_same_everywhere():
    rng = np.random.default_rng(2)
    known, values = rng.random((6, 4)), rng.random((6, 5, 2))
    np.testing.assert_allclose(between(known, known, values), values, atol=1e-12)
    same = np.broadcast_to(values[0], values.shape)
    np.testing.assert_allclose(between(rng.random((3, 4)), known, same), same[:3], atol=1e-12)


def test_a_difference_is_the_largest_of_all_steps_as_a_share_of_the_largest_force():
    rows = [dict.fromkeys(paths.FORCES, value) for value in (0.0, 2.0, -4.0)]
    others = [dict.fromkeys(paths.FORCES, value) for value in (0.2, 1.0, -4.0)]
    assert differences(rows, others, 1e-8) == dict.fromkeys(paths.FORCES, MARGIN * 0.25)
    assert differences(rows, rows, 1e-8) == dict.fromkeys(paths.FORCES, 1e-8)
    tiny = [dict.fromkeys(paths.FORCES, 1e-9)] * 3
    none = [dict.fromkeys(paths.FORCES, 0.0)] * 3
    assert differences(tiny, none, 1e-8) == dict.fromkeys(paths.FORCES, pytest.approx(MARGIN * 1e-3))


def test_forces_of_a_state_are_those_on_the_pad(fast):
    scene = paths.scene(FINGER, 1000.0, [ev.Slide(0.4, steps=4)])
    state = followed(fast, scene).states[-1]
    np.testing.assert_allclose(on_pad(state).sum(axis=0), -state.reaction, atol=1e-12)

"""One step of the remembered pad: where it begins, what is out of balance, when it is carried
along.
"""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from tools.builders import finger
from tools.meshes import block

import evfem as ev
from evfem.contact.signorini import BACKWARD, FORWARD, OPEN
from evfem.fast.run import FastRun
from evfem.solver.control import Force, GivenVoltage, Indentation, Target

FINGER = finger(block(12, 2, sag=0.4))
FRICTION = 0.4


def scene(friction=FRICTION, voltage=1000.0):
    motion = [ev.Press(force=0.02, steps=4), ev.Slide(0.6, steps=8)]
    surface = ev.Display(friction=friction)
    return ev.Scene(FINGER, surface, law=ev.Kaczmarek(), voltage=voltage, motion=motion)


def iterating(body, state):
    """The state after one iteration of a step that asks for nothing new."""
    held = outlook(state)
    begun = body.begin(state, held, False, state)
    return body.advance(state, begun, held, body.balance(begun, state.attraction, held)[1])


@pytest.fixture(scope="module")
def slid():
    """The pad of a fast run, its states, and how high the surface is."""
    run = FastRun(*_parts())
    for request in run.requests():
        run.advance(request)
    return run.model.equilibrium.body, run.states, run.model.surface.y


def _parts():
    fast = ev.reduce(scene())
    return fast.memory.pad, scene(), *fast._parts_for(scene())


def outlook(state, **changes):
    """What the state itself would be the answer to, with changes."""
    return replace(Target.held(state.bone, 1000.0), **changes)


def test_iterations_begin_with_a_pad_that_has_moved_with_the_bone(slid):
    body, states, _ = slid
    old = states[3]
    target = outlook(old, x=float(old.bone[0]) + 0.2, height=Indentation(float(old.bone[1]) - 0.1))
    begun = body.begin(old, target, False, old)
    np.testing.assert_array_equal(begun.bone, target.bone(old.bone))
    np.testing.assert_allclose(begun.u - begun.bone, old.u - old.bone, atol=1e-15)
    np.testing.assert_allclose(begun.bone - old.bone, [0.2, -0.1], rtol=1e-12)
    assert begun.contact_force is old.contact_force


def test_the_first_touch_under_a_force_begins_at_the_remembered_equilibria_with_that_force(slid):
    """Their forces on the pad add up to it, and the nodes that then touch lie on the surface in
    the mean.
    """
    body, states, level = slid
    for force in (0.003, 0.012):
        begun = body.begin(states[0], outlook(states[0], height=Force(force)), False, states[0])
        touching = begun.touching
        assert touching.any()
        pressed = body.body.pressed(force)
        assert pressed[:, 1].sum() == pytest.approx(force, rel=1e-9)
        np.testing.assert_allclose(begun.u - begun.bone, body.body.under(pressed), atol=1e-12)
        height = body.interface.positions(begun.u)[touching, 1]
        assert height.mean() == pytest.approx(level, abs=1e-12)
        assert begun.bone[1] < 0.0
        normal, shear = begun.contact_force[touching].T
        expected = (pressed - states[0].attraction)[touching]
        np.testing.assert_allclose(np.stack([shear, normal], axis=1), expected, atol=1e-15)


def test_a_pad_that_has_touched_begins_where_it_was(slid):
    body, states, _ = slid
    begun = body.begin(states[2], outlook(states[2], height=Force(0.02)), False, states[2])
    np.testing.assert_array_equal(begun.u, states[2].u)


def test_a_prescribed_force_and_the_attraction_of_the_positions_are_in_the_balance(slid):
    """Relative to the force on the bone, which is 0.02 N/mm downwards at the end of the press."""
    body, states, _ = slid
    state = states[4]
    largest = max(0.02, abs(float((state.contact_force[:, 1] + state.attraction[:, 0]).sum())))
    iterated = iterating(body, state)
    for force, missing in ((0.02, 0.0), (0.03, 0.01), (0.015, 0.005)):
        balance = body.balance(iterated, iterated.attraction, outlook(state, height=Force(force)))[1]
        assert balance.residual == pytest.approx(missing / largest, abs=1e-7)
    other = iterated.attraction.copy()
    other[5, 1] -= 0.004
    after, balance = body.balance(iterated, other, outlook(state))
    assert balance.residual == pytest.approx(0.004 / (largest - 0.004), rel=1e-6)
    assert balance.forces[5, 1] == pytest.approx(-0.004)
    np.testing.assert_allclose(after.reaction[1], state.reaction[1] + 0.004, rtol=1e-6)
    np.testing.assert_array_equal(after.attraction, other)
    # small ones of many nodes add up
    other = iterated.attraction + np.array([0.0, 1e-6])
    balance = body.balance(iterated, other, outlook(state))[1]
    assert balance.residual == pytest.approx(1e-6 * len(other) / largest, rel=0.05)


def test_no_step_is_accepted_before_its_first_iteration(slid):
    body, states, _ = slid
    state = states[4]
    held = outlook(state)
    body.begin(state, held, False, state)
    assert body.balance(state, state.attraction, held)[1].residual == 1.0
    after = iterating(body, state)
    assert body.balance(after, after.attraction, held)[1].residual < 1e-8


def test_a_pad_beside_what_is_remembered_begins_and_goes_there(slid):
    """Every node 2 um to the right of where the memory puts it, relative to the bone."""
    shared, states, _ = slid
    body, state = copy(shared), states[6]
    held, beside = outlook(state), np.broadcast_to([2e-3, 0.0], state.u.shape)
    body.correct(beside, state)
    begun = body.begin(states[5], held, False, states[5])
    np.testing.assert_allclose(begun.u - begun.bone, state.u - state.bone + beside, atol=1e-15)
    on = outlook(states[-1], x=float(states[-1].bone[0]) + 0.1)
    assert body.known(states[-1], on) is None
    after = body.advance(state, begun, held, body.balance(begun, begun.attraction, held)[1])
    force = after.contact_force[:, ::-1] + after.attraction
    np.testing.assert_allclose(after.u - after.bone, body.body.under(force) + beside, atol=1e-15)
    # nothing has changed since
    body.correct(beside, state)
    assert body.known(states[-1], on) is not None


def test_a_pad_in_full_slip_is_carried_along_as_it_is(slid):
    body, states, _ = slid
    old = states[-1]
    assert set(old.status.tolist()) == {OPEN, FORWARD}
    on = outlook(old, x=float(old.bone[0]) + 0.1)
    known = body.known(old, on)
    np.testing.assert_allclose(known.u - old.u, np.broadcast_to([0.1, 0.0], old.u.shape), atol=1e-14)
    np.testing.assert_array_equal(known.bone, [on.x, old.bone[1]])
    assert known.contact_force is old.contact_force
    # under the force that it carries as well
    force = Force(float(-old.reaction[1]))
    assert body.known(old, replace(on, height=force)) is not None


def test_a_pad_is_not_carried_along_where_anything_changes(slid):
    body, states, _ = slid
    old = states[-1]
    on = outlook(old, x=float(old.bone[0]) + 0.1)
    changed = [
        replace(on, x=float(old.bone[0])),
        replace(on, x=float(old.bone[0]) - 0.1),
        replace(on, drive=GivenVoltage(1001.0)),
        replace(on, height=Indentation(float(old.bone[1]) - 1e-6)),
        replace(on, height=Force(float(-old.reaction[1]) * 1.001)),
    ]
    for target in changed:
        assert body.known(old, target) is None
    touching = np.flatnonzero(old.touching)
    for status in (BACKWARD, 1):
        other = old.status.copy()
        other[touching[0]] = status
        assert body.known(replace(old, status=other), on) is None
    assert body.known(replace(old, status=np.zeros_like(old.status)), on) is None

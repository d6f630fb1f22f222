"""The body linear about a state: its forces are the derivative of its energy and those of the full body to
first order, and a loop with it lacks what it says, which falls with the square of the way.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from tools.domes import dome_scene
from tools.refusals import refuses

import evfem as ev
from evfem.simulation.run import Run
from evfem.solver.linearbody import LinearBody

PAD = ev.FingerPad(resolution="coarse", ridges=False)
PRESS = ev.Press(force=0.05, steps=2)


def scene(surface=None, law=None, voltage=0.0, **options):
    return ev.Scene(PAD, surface or ev.Flat(friction=0.3), law, voltage, PRESS, **options)


@pytest.fixture(scope="module")
def pressed():
    """A pressed finger: its model, its displacements, and the linear body there."""
    run = Run(scene(), None)
    for request in run.requests():
        run.advance(request)
    model, u = run.model, run.state.u
    return model, u, LinearBody(model.body, model.pad.nodes, u)


def ways(model, u, size):
    """Displacements of pad and bone of this size (mm), smooth along the pad."""
    moved = np.zeros_like(u)
    moved[model.pad.nodes] = size * np.sin(2.0 * model.mesh.points[model.pad.nodes] + [0.3, 1.1])
    return moved


def test_its_forces_are_those_of_the_full_body_to_first_order(pressed):
    model, u, body = pressed
    missing = []
    for size in (2e-3, 1e-3):
        at = u + ways(model, u, size)
        full = model.body.reduce(model.body.forces(body.whole(at)))
        own = body.forces(at)[model.pad.nodes]
        inner = np.ones(full.size, dtype=bool)
        inner[model.body.unknowns[model.pad.nodes].ravel()] = inner[model.body.bone] = False
        moved = np.abs(own - body.forces(u)[model.pad.nodes]).max()
        on_pad = np.abs(full[model.body.unknowns[model.pad.nodes]] - own).max()
        missing.append(np.array([np.abs(full[inner]).max(), on_pad]))
        assert (missing[-1] < 0.2 * moved).all()
    assert missing[0] / missing[1] == pytest.approx(4.0, rel=0.1)


def test_its_energy_tangent_and_forces_are_one(pressed):
    model, u, body = pressed
    way = ways(model, u, 1e-3)
    way[model.mesh.node_sets["bone"]] = [2e-3, -1e-3]
    at, h = u + way, 1e-3
    slope = (body.energy(at + h * way) - body.energy(at - h * way)) / (2.0 * h)
    assert slope == pytest.approx(float(np.sum(body.forces(at) * way)), rel=1e-9)
    along = [body.energy(at + s * way) for s in (0.0, 0.3, 1.0)]
    np.testing.assert_allclose(body.energies(at, way, np.array([0.0, 0.3, 1.0])), along, rtol=1e-13)
    matrix = body.pattern.full(body.tangent(at))
    reduced = np.zeros(body.size)
    reduced[body.unknowns[model.pad.nodes]] = way[model.pad.nodes]
    reduced[body.bone] = way[model.mesh.node_sets["bone"][0]]
    change = body.reduce(body.forces(u + way) - body.forces(u))
    assert np.abs(matrix @ reduced - change).max() < 1e-12 * np.abs(matrix.data).max()
    assert np.abs(body.reduce(body.forces(u + np.array([0.5, 0.2])) - body.forces(u))).max() < 1e-12


def test_its_drag_dissipates_and_does_not_hold_a_body_at_rest(pressed):
    model, u, body = pressed
    body.release(u, 2.0)
    try:
        at = u + ways(model, u, 1e-3)
        dragged, still, lost = body.forces(at), body.forces(u), body.drag_dissipation(at)
    finally:
        body.release(u, 0.0)
    assert np.array_equal(still, body.forces(u))
    held = (dragged - body.forces(at))[body.pad]
    assert lost == pytest.approx(float(np.sum(held * (at - u)[body.pad])), rel=1e-9)
    assert lost > 0.0


@pytest.mark.parametrize(
    "scene",
    [
        scene(),
        scene(ev.Sinusoid(terms=[[0.005, 12.0, 0.0]], friction=0.3)),
        scene(ev.Display(friction=0.3), ev.Kaczmarek(), 1000.0),
    ],
    ids=["flat", "texture", "voltage"],
)
def test_a_loop_with_it_has_the_error_that_it_tells_and_its_books_close(scene):
    loop, full = ev.loop(scene, linearised=True), ev.loop(scene)
    at = np.arange(1, 13) * 0.05
    rows = [(loop.step(position=x), full.step(position=x)) for x in at]
    missed = 0.0
    for name in ("normal_force", "tangential_force", "electrostatic_force"):
        pairs = np.array([[getattr(row, name) for row in pair] for pair in rows])
        missed = max(missed, np.abs(np.diff(pairs)).max() / max(np.abs(pairs[:, 1]).max(), 1e-9))
    assert loop.error == pytest.approx(missed, rel=1e-6)
    assert 1e-5 < loop.error < 0.01
    assert full.error == 0.0
    found = loop.result()
    gained = found.external_work + found.electrostatic_work - found.stored_energy
    lost = found.friction_dissipation + found.snap_dissipation + found.integrator_dissipation
    assert np.abs(gained - lost).max() < 1e-6 * found.stored_energy.max()


def test_its_error_falls_with_the_square_of_the_way():
    """A press deeper by d: the force of linear tissue lacks d^2."""
    errors = []
    for depth in (0.02, 0.01):
        loop = ev.loop(scene(), linearised=True)
        row = loop.result().rows[-1]
        for _ in range(2):
            row = vars(loop.step(indentation=row["indentation"] + depth / 2))
        errors.append(loop.error * row["normal_force"])
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)


def test_its_fields_are_those_of_all_nodes():
    loop, full = ev.loop(scene(), linearised=True), ev.loop(scene())
    for each in (loop, full):
        each.step(position=0.05)
    found, wanted = (each.result().frames[-1] for each in (loop, full))
    size = np.abs(wanted.displacement).max()
    assert np.abs(found.displacement - wanted.displacement).max() < 1e-3 * size
    assert np.abs(found.von_mises - wanted.von_mises).max() < 1e-2 * wanted.von_mises.max()


def test_what_is_not_linearised_is_refused():
    finger, slow = replace(PAD, viscosity=1e-3), ev.Press(indentation=0.3, steps=2, speed=10.0)
    timed = ev.Scene(finger, ev.Flat(), motion=slow, solver=ev.Solver(dynamics="viscous"))
    refuses("tissue without forms, at rest", ev.loop, timed, linearised=True)
    solid = dome_scene(ev.Press(indentation=0.05, steps=1))
    refuses("a finger in the plane", ev.loop, solid, linearised=True)
    loop = ev.loop(scene(ev.Display(), ev.Kaczmarek()), linearised=True)
    refuses("largest_voltage", loop.step, voltage=500.0)
    assert math.isfinite(loop.error)

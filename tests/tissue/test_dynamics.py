"""Viscous and inertial forces: objectivity, tangents, what they dissipate and carry, motions in
time, and the drag of a body that is released.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from tools.grids import CELLS, bend, columns_of, rectangle, solve, tangent_of, wavy
from tools.meshes import block

from evfem.tissue.body import Body
from evfem.tissue.dynamics import Dynamics, make_dynamics, mass_matrices
from evfem.tissue.laws import NeoHookean
from evfem.tissue.space import make_space
from evfem.tissue.weakform import Tissue

every_element = pytest.mark.parametrize("element", list(CELLS))
STEP = 2e-3


def dynamics_on(space, viscous=True, inertial=False, compiled=True):
    """Different viscosities and densities in every cell; one cell without viscosity."""
    E = len(space.nodes)
    eta = np.linspace(0.0, 0.3, E) if viscous else None
    term = Dynamics(space, eta, np.linspace(1.0, 2.0, E) * 1e-6 if inertial else None)
    if not compiled:
        term.loops = None
    return term


class Sum:
    """Tissue with further terms, as `solve` wants it."""

    def __init__(self, tissue, *terms):
        self.space, self.smallest_J, self.terms = tissue.space, tissue.smallest_J, (tissue, *terms)

    def forces(self, u):
        return sum(term.forces(u) for term in self.terms)


@every_element
@pytest.mark.parametrize("compiled", [True, False])
def test_rotation_is_not_resisted(element, compiled):
    """A deformed body turned by 40 degrees within the step feels nothing; a straining one turned
    with its frame feels the turned forces (objectivity)."""
    space = rectangle(element, (2, 2), warp=bend)
    X = space.mesh.points
    term = dynamics_on(space, compiled=compiled)
    start = wavy(X)
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s], [s, c]])

    def turned(u):
        return (X + u) @ R.T + [3.0, -1.0] - X

    term.begin_from(start, np.zeros_like(X), STEP)
    strained = term.forces(wavy(X, phase=0.3))
    assert np.abs(strained).max() > 0.1
    assert np.abs(term.forces(turned(start))).max() < 1e-12
    np.testing.assert_allclose(term.forces(turned(wavy(X, phase=0.3))), strained @ R.T, atol=1e-12)


@every_element
@pytest.mark.parametrize("kind", ["viscous", "compiled viscous", "inertial", "both"])
def test_tangent_is_the_derivative_of_the_forces(element, kind):
    """Central differences of every unknown; the terms add to what is there already."""
    space = rectangle(element, (2, 2), warp=bend)
    X = space.mesh.points
    term = dynamics_on(space, kind != "inertial", kind in ("inertial", "both"), kind != "viscous")
    term.begin_from(wavy(X), 5.0 * wavy(X, phase=1.0), STEP)
    u = wavy(X, phase=0.3)
    tissue = Tissue(space, {"lower": NeoHookean(E=1.0, nu=0.3)})
    K = (tangent_of(space, u, tissue, term) - tangent_of(space, u, tissue)).toarray()
    columns = columns_of(term.forces, u)
    np.testing.assert_allclose(K, columns, atol=1e-7 * np.abs(K).max())
    np.testing.assert_allclose(K, K.T, atol=1e-11 * np.abs(K).max())


def test_simple_shear_by_hand():
    """F = [[1, g], [0, 1]]: dE = [[0, g], [g, g^2]]/2, so P_v12 = eta g (1 + g^2)/dt on the lid,
    and dissipated is eta (g^2 + g^4/2)/dt times the area."""
    space = rectangle("q2", (2, 2), size=(3.0, 2.0))
    eta, g = 0.2, 0.25
    term = Dynamics(space, np.full(4, eta), None)
    u = space.mesh.points[:, 1:] * [g, 0.0]
    term.begin_from(np.zeros_like(u), np.zeros_like(u), STEP)
    lid = term.forces(u)[space.mesh.node_sets["top"]].sum(axis=0)
    assert lid[0] == pytest.approx(3.0 * eta * g * (1 + g * g) / STEP, rel=1e-12)
    assert term.damping(u) == pytest.approx(6.0 * eta * (g**2 + 0.5 * g**4) / STEP, rel=1e-12)


def test_free_fall():
    """Backward Euler by hand: after n steps v = n g dt and u = n (n + 1)/2 g dt^2, everywhere, unstrained."""
    space = rectangle("q1_fbar", (2, 2), jitter=0.2)
    law, gravity, dt = NeoHookean(E=0.05, nu=0.48), -9810.0, 1e-3
    term = make_dynamics(space, {"lower": law}, SimpleNamespace(viscosity=1e-3), "inertial")
    body = Sum(Tissue(space, {"lower": law}), term)
    weight = np.zeros((space.size, 2))
    np.add.at(weight[:, 1], space.nodes, gravity * law.density * mass_matrices(space).sum(axis=2))
    u = velocity = np.zeros((space.size, 2))
    for n in range(1, 6):
        term.begin_from(u, velocity, dt)
        u = solve(body, u, np.ones(u.shape, dtype=bool), weight)
        velocity = term.velocity(u)
        np.testing.assert_allclose(velocity, np.broadcast_to([0.0, n * gravity * dt], u.shape), atol=1e-9)
        expected = [0.0, 0.5 * n * (n + 1) * gravity * dt**2]
        np.testing.assert_allclose(u, np.broadcast_to(expected, u.shape), atol=1e-12)
        assert term.damping(u) < 1e-20


def test_only_what_is_asked_for():
    """No time, no forces; no relaxation time, no viscosity; neither viscosity nor inertia, no term at all."""
    space = rectangle("q1", (2, 2), split=lambda x, y: y > 0.5)
    laws = {
        "lower": NeoHookean(E=0.26, nu=0.3, viscosity=0.0, density=2e-9),
        "upper": NeoHookean(E=2.6, nu=0.3),
    }
    assert make_dynamics(space, laws, SimpleNamespace(viscosity=0.0), "viscous").acts is False
    viscous = make_dynamics(space, laws, SimpleNamespace(viscosity=0.5), "viscous")
    np.testing.assert_allclose(viscous.viscosity, [0.0, 0.0, 0.5, 0.5])  # tau times mu = 1 MPa
    assert viscous.mass is None
    inertial = make_dynamics(space, laws, SimpleNamespace(viscosity=0.0), "inertial")
    assert inertial.viscosity is None
    np.testing.assert_allclose(
        inertial.mass.matrices.sum(axis=(1, 2)), 0.25 * np.array([2e-9, 2e-9, 1e-9, 1e-9])
    )
    both = make_dynamics(space, laws, SimpleNamespace(viscosity=0.5), "inertial")
    u = wavy(space.mesh.points)
    both.begin_from(0 * u, 0 * u, 0.0)
    K = tangent_of(space, u, both)
    assert not both.forces(u).any() and not K.toarray().any() and not both.velocity(u).any()  # noqa: PT018
    assert both.dissipation(None, SimpleNamespace(u=u), 0.0) == 0.0


def test_the_travel_of_the_bone_leaves_no_rounding_in_the_forces():
    """A body carried along as it is has exactly the forces that it had before."""
    space = rectangle("q2p1", (2, 2), jitter=0.2)
    space.mesh.node_sets["bone"] = space.mesh.node_sets["top"]
    body = Body(space, {"lower": NeoHookean(E=1.0, nu=0.4)})
    here = body.forces(np.zeros((space.size, 2)))
    np.testing.assert_array_equal(body.forces(np.tile([50.0 / 3.0, -1e3 / 7.0], (space.size, 1))), here)


WIDTH, HEIGHT, MU = 4.0, 2.0, 0.03


LAW = NeoHookean(E=2.0 * MU * 1.4, nu=0.4)


def body():
    return Body(make_space(block(4, 2, WIDTH, HEIGHT), "q1"), {"tissue": LAW})


def waved(body, size=0.05):
    x, y = body.space.mesh.points.T
    return size * np.column_stack([np.sin(2 * x + y), np.cos(3 * x - y)])


def sheared(body, strain):
    return np.column_stack([strain * body.space.mesh.points[:, 1], np.zeros(body.space.size)])


@pytest.mark.parametrize("rate", [0.3, 2.0])
def test_a_block_that_moves_as_a_whole_feels_its_mass(rate):
    """mu/H^2 per volume times the square of the rate, and twice the kinetic energy is lost."""
    moving = body()
    begin = waved(moving)
    moving.release(begin, rate)
    still = moving.tissue.forces(begin)
    np.testing.assert_allclose(moving.forces(begin), still, atol=1e-15)
    end = begin + np.array([0.1, 0.0])
    total = (moving.forces(end) - still).sum(axis=0)
    mass = MU / HEIGHT**2 * WIDTH * HEIGHT * rate**2
    np.testing.assert_allclose(total, [0.1 * mass, 0.0], rtol=1e-12, atol=1e-15)
    assert moving.drag_dissipation(end) == pytest.approx(0.1**2 * mass, rel=1e-12)


def test_a_shear_is_held_by_its_viscous_stress():
    """E_xy = g/2, E_yy = g^2/2, and S_v : E with S_v = 2 mu s E; the mass adds s^2 mu/H^2 (g y)^2."""
    moving, g, rate = body(), 0.2, 0.7
    moving.release(np.zeros((moving.space.size, 2)), rate)
    viscous = 2.0 * MU * rate * (2.0 * (0.5 * g) ** 2 + (0.5 * g**2) ** 2) * WIDTH * HEIGHT
    carried = MU / HEIGHT**2 * rate**2 * g**2 * WIDTH * HEIGHT**3 / 3.0
    assert moving.drag_dissipation(sheared(moving, g)) == pytest.approx(viscous + carried, rel=1e-12)


def test_the_tangent_is_the_derivative_of_the_forces():
    moving = body()
    moving.release(waved(moving), 3.0)
    u, way = waved(moving, 0.08), moving.expand(np.sin(np.arange(moving.size)))
    whole = moving.pattern.full(moving.tangent(u))
    ends = [moving.reduce(moving.forces(u + h * way)) for h in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(whole @ np.sin(np.arange(moving.size)), slope, atol=1e-8)
    assert np.abs(slope).max() > 0.1

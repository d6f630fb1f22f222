"""Drag of a released body: no force where it begins, none of a rotation but that of the mass, its
tangent, and what it dissipates.
"""

import numpy as np
import pytest
from tools.meshes import block

from evfem.tissue.body import Body
from evfem.tissue.laws import NeoHookean
from evfem.tissue.space import make_space

WIDTH, HEIGHT, MU = 4.0, 2.0, 0.03
LAW = NeoHookean(E=2.0 * MU * 1.4, nu=0.4)


def body():
    return Body(make_space(block(4, 2, WIDTH, HEIGHT), "q1"), {"tissue": LAW})


def wavy(body, size=0.05):
    x, y = body.space.mesh.points.T
    return size * np.column_stack([np.sin(2 * x + y), np.cos(3 * x - y)])


def sheared(body, strain):
    return np.column_stack([strain * body.space.mesh.points[:, 1], np.zeros(body.space.size)])


@pytest.mark.parametrize("rate", [0.3, 2.0])
def test_a_block_that_moves_as_a_whole_feels_its_mass(rate):
    """mu/H^2 per volume times the square of the rate, and twice the kinetic energy is lost."""
    moving = body()
    begin = wavy(moving)
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
    moving.release(wavy(moving), 3.0)
    u, way = wavy(moving, 0.08), moving.expand(np.sin(np.arange(moving.size)))
    whole = moving.pattern.full(moving.tangent(u))
    ends = [moving.reduce(moving.forces(u + h * way)) for h in (1e-6, -1e-6)]
    slope = (ends[0] - ends[1]) / 2e-6
    np.testing.assert_allclose(whole @ np.sin(np.arange(moving.size)), slope, atol=1e-8)
    assert np.abs(slope).max() > 0.1

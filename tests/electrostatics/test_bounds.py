"""Bounds of a capacitance: the upper one is the energy of the potential that it is said to be."""

import numpy as np
import pytest

from evfem.field.bounds import columns_sum, upper_sum
from evfem.field.rigid import rigid_field

#: places and weights of Gauss's rule on 0 to 1
NODES, TWICE = np.polynomial.legendre.leggauss(24)
AT, WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * TWICE


def energy(x, gap, ground, thickness, eps_r):
    """The integral of eps |grad phi|^2 of the potential that is linear in slab and air along verticals."""
    total = 0.0
    for k in range(len(x) - 1):
        dx = x[k + 1] - x[k]
        rise, slope = (gap[k + 1] - gap[k]) / dx, (ground[k + 1] - ground[k]) / dx
        for share, weight in zip(AT, WEIGHTS, strict=True):
            h = gap[k] + share * dx * rise
            whole = h + thickness / eps_r
            for layer, eps, below in ((thickness, eps_r, 0.0), (h, 1.0, thickness / eps_r)):
                phi = (below + layer * AT / eps) / whole
                by_y = 1.0 / (eps * whole)
                by_x = -slope * by_y - phi * rise / whole  # at a height that stays where it is
                total += dx * weight * float(np.sum(WEIGHTS * layer * eps * (by_x**2 + by_y**2)))
    return total


@pytest.mark.parametrize("rough", [0.0, 0.03])
@pytest.mark.parametrize(("thickness", "eps_r"), [(0.0, 1.0), (0.05, 3.5), (0.2, 12.0)])
def test_the_upper_bound_is_the_energy_of_its_potential(rough, thickness, eps_r):
    """By Gauss's rule in both directions; a slab that follows its ground leans with it."""
    x = np.array([0.0, 0.2, 0.5, 0.6, 1.0])
    gap, ground = np.array([0.05, 0.1, 0.03, 0.08, 0.2]), rough * np.array([0.0, 1.0, -2.0, 0.5, 0.0])
    reduced = thickness / eps_r
    found = upper_sum(x, gap + reduced, reduced, eps_r, ground)
    assert found == pytest.approx(energy(x, gap, ground, thickness, eps_r), rel=1e-9)
    assert found > columns_sum(x, gap + reduced)


@pytest.mark.parametrize("first", [4, 11, 22])
def test_a_period_may_begin_at_any_of_its_points(first):
    """On a flank too, where the normals of both ends are those of one point."""
    x = 0.4 / 30.0 * (first + np.arange(31))
    crest, other = (
        rigid_field(at, 0.08 + 0.06 * np.cos(5.0 * np.pi * at)) for at in (x - 0.4 / 30.0 * first, x)
    )
    assert other.capacitance == pytest.approx(crest.capacitance, rel=3e-7, abs=0.0)
    assert other.force == pytest.approx(crest.force, rel=3e-7, abs=0.0)

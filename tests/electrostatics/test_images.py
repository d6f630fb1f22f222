"""Strips over a slab on an electrode, by line charges and their images."""

import numpy as np
import pytest
from tools.fields import FILM, numbers

from evfem import Layer
from evfem.electrostatics import rigid_field

GLASS = Layer(0.5, 7.0)


def images(slab):
    """Charges and depths below the slab's upper face of a line charge's images: the electrode's
    reflection through the slab, -(b + q) / (1 + b q) with q = exp(-2 k t), as a series in q.
    """
    b = (slab.eps_r - 1.0) / (slab.eps_r + 1.0)
    n = np.arange(1, 1 + int(np.ceil(-36.0 / np.log(b))))
    charge = np.append(-b, -((-b) ** (n - 1)) * (1.0 - b**2))
    return charge, np.append(0.0, 2.0 * n * slab.thickness)


def strip(width, height, slab, order=40):
    """C / eps_0 of a thin strip: its charge is a series of Chebyshev polynomials over sqrt(1 - x^2)."""
    angle, m = (np.arange(order) + 0.5) * np.pi / order, np.arange(order)
    x, waves = 0.5 * width * np.cos(angle), np.cos(np.outer(angle, m))
    matrix = waves * np.pi / np.maximum(m, 1)
    matrix[:, 0] = -np.pi * np.log(0.25 * width)
    for charge, depth in zip(*images(slab), strict=True):
        smooth = np.log(np.hypot(x[:, None] - x, 2.0 * height + depth))
        matrix -= charge * np.pi / order * smooth @ waves
    return 2.0 * np.pi**2 * np.linalg.solve(matrix, np.ones(order))[0]


def with_force(capacitance, gap):
    """C / eps_0 at a gap, and F / (eps_0 U^2), half of minus its slope, by differences."""
    step = 1e-3 * gap
    at = [capacitance(gap + k * step) for k in (-2, -1, 0, 1, 2)]
    return at[2], -0.5 * (at[0] - 8.0 * at[1] + 8.0 * at[3] - at[4]) / (12.0 * step)


@pytest.mark.parametrize(("width", "height", "slab"), [(1.0, 0.1, FILM), (0.2, 0.3, GLASS)])
def test_a_strip_over_a_slab(width, height, slab):
    exact = with_force(lambda h: strip(width, h, slab), height)
    solved = rigid_field([0.0, width], [height, height], slab=slab, periodic=False)
    assert numbers(solved) == pytest.approx(exact, rel=1e-5)

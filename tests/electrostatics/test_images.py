"""Bodies and strips over a slab on an electrode, by line charges and their images."""

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


def potential(at, source, slab):
    """2 pi eps_0 times the potential (m, n) at places (2, m) of unit line charges at (2, n)."""
    across = at[0][:, None] - source[0]
    down = at[1][:, None] + source[1]
    total = -np.log(np.hypot(across, at[1][:, None] - source[1]))
    for charge, depth in zip(*images(slab), strict=True):
        total -= charge * np.log(np.hypot(across, down + depth))
    return total


def ellipse(a, b, gap, slab):
    """C / eps_0 of an elliptical cylinder by charges inside it (a circle: a = b)."""
    t, s = (2.0 * np.pi * np.arange(n) / n for n in (200, 90))
    face = np.stack([a * np.cos(t), gap + b + b * np.sin(t)])
    residuals, found = [], []
    for share in (0.6, 0.75):
        inner = (share * a, share * b)
        if a > b:  # confocal
            focus, level = np.sqrt(a * a - b * b), share * np.arctanh(b / a)
            inner = (focus * np.cosh(level), focus * np.sinh(level))
        source = np.stack([inner[0] * np.cos(s), gap + b + inner[1] * np.sin(s)])
        matrix = potential(face, source, slab)
        charge = np.linalg.lstsq(matrix, np.ones(t.size), rcond=1e-15)[0]
        residuals.append(np.abs(matrix @ charge - 1.0).max())
        found.append(2.0 * np.pi * charge.sum())
    assert min(residuals) < 1e-8
    return found[int(np.argmin(residuals))]


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


@pytest.mark.parametrize(("a", "gap", "slab"), [(1.0, 0.1, FILM), (1.5, 0.3, GLASS)])
def test_a_cylinder_over_a_slab(a, gap, slab):
    angle = np.linspace(-np.pi / 2.0, np.pi / 2.0, 201)
    outline = a * np.sin(angle), gap + 1.0 - np.cos(angle)
    exact = with_force(lambda g: ellipse(a, 1.0, g, slab), gap)
    assert numbers(rigid_field(*outline, slab=slab, periodic=False)) == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize(("width", "height", "slab"), [(1.0, 0.1, FILM), (0.2, 0.3, GLASS)])
def test_a_strip_over_a_slab(width, height, slab):
    exact = with_force(lambda h: strip(width, h, slab), height)
    solved = rigid_field([0.0, width], [height, height], slab=slab, periodic=False)
    assert numbers(solved) == pytest.approx(exact, rel=1e-5)

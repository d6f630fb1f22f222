"""Poisson's problem in columns of layers: closed forms, its derivatives, the outlines of `rigid_field`."""

import numpy as np
import pytest

from evfem.electrostatics import eps_0
from evfem.field.columns import Columns

ROWS = np.linspace(0.0, 1.0, 5)
FINE = 1.0 - (1.0 - ROWS) ** 2


def wave(number, gap):
    """Half a period of a sinusoid above the film: its crest and groove are planes of symmetry."""
    x = np.linspace(0.0, 0.25, number)
    height = gap + 0.075 * (1.0 - np.cos(4.0 * np.pi * x))
    return x, np.stack([0.0 * x - 0.09, 0.0 * x, height])


FILM_AND_AIR = Columns((3.35, 1.0), (FINE, ROWS))


def test_half_a_wave_converges_to_its_closed_form():
    """Twice the lines, a quarter of the error in energy and force."""
    exact = np.array([7.53901511, 81.97857879])
    errors = []
    for number in (49, 97):
        found = FILM_AND_AIR.solve(*wave(number, 0.005))
        numbers = 2.0 * np.array([found.value, -0.5 * found.by_level[2].sum()]) / eps_0
        errors.append(numbers / exact - 1.0)
    assert np.abs(errors[1]).max() < 5e-4
    assert np.log2(np.abs(errors[0] / errors[1])) == pytest.approx([2.0, 2.0], abs=0.1)


def test_plates_in_series_are_exact():
    levels = np.array([[-0.09] * 3, [0.0] * 3, [0.05] * 3, [0.43] * 3])
    found = Columns((3.35, 1.0, 1650.0), (FINE, ROWS, ROWS)).solve(np.array([0.0, 0.3, 1.0]), levels)
    distance = 0.09 / 3.35 + 0.05 + 0.38 / 1650.0
    assert found.value / eps_0 == pytest.approx(1.0 / distance, rel=1e-12)
    up = found.by_level[2].sum() + found.by_level[3].sum()
    assert up / eps_0 == pytest.approx(-1.0 / distance**2, rel=1e-10)
    assert found.phi[0, [0, -1]].tolist() == [1.0, 0.0]


def halves(right):
    """Two electrodes with a gap in between, the right one at a share of the voltage."""
    return np.array([[-9.0, 0.09, 1.0], [0.16, 9.0, right]])


@pytest.mark.parametrize("skin", [1650.0, 1650.0 - 4e4j])
@pytest.mark.parametrize("electrodes", [(None, False), (halves(-0.5), False), (halves(-0.5), True)])
def test_a_field_near_another_is_right_to_first_order(electrodes, skin):
    """Every line and level moves, gaps by up to an eighth: half the way, a quarter of the error."""
    rng = np.random.default_rng(11)
    x, levels = wave(17, 0.005)
    levels = np.vstack([levels, levels[2] + 0.3])
    ways = 2e-4 * rng.normal(size=x.shape), 2e-4 * rng.normal(size=levels.shape)
    stack = Columns((3.35, 1.0, skin), (FINE, ROWS, ROWS))
    near = stack.potentials(x, levels, *electrodes)

    def potential(part, near=None):
        cells, strips = stack.cells(x + part * ways[0], levels + part * ways[1], electrodes[0])
        return cells.potential(strips, electrodes[1], near)

    errors, changes = [], []
    for part in (1.0, 0.5, 0.25):
        errors.append(np.abs(potential(part, near) - potential(part)).max())
        changes.append(np.abs(potential(part) - potential(0.0)).max())
    assert np.log2(np.divide(errors[:2], errors[1:])) == pytest.approx([2.0, 2.0], abs=0.2)
    assert errors[2] < 0.05 * changes[2]


@pytest.mark.parametrize("electrodes", [(), (halves(-0.5), False), (halves(-0.5), True)])
def test_derivatives_are_those_of_the_discrete_energy(electrodes):
    """By every x and every level at once, along a random way, on an uneven outline; over electrodes that
    end and stay, or float, the display moves as a whole.
    """
    rng = np.random.default_rng(7)
    x, levels = wave(17, 0.05)
    x = x + rng.uniform(-3e-3, 3e-3, x.size)
    dx, rise = rng.normal(size=x.shape), rng.normal(size=levels.shape)
    rise[:2] = 0.1 if electrodes else rise[:2]

    def energy(s):
        return FILM_AND_AIR.solve(x + s * dx, levels + s * rise, *electrodes).value

    found = FILM_AND_AIR.solve(x, levels, *electrodes)
    step = 2e-5
    quotients = [energy(k * step) - energy(-k * step) for k in (1, 2, 3)]
    slope = (45.0 * quotients[0] - 9.0 * quotients[1] + quotients[2]) / (60.0 * step)
    assert found.by_x @ dx + np.sum(found.by_level * rise) == pytest.approx(slope, rel=1e-7)


def strips_pressure(period, slab, gap, volts):
    """Mean pressure (MPa) of abutting strips at +-volts under a slab on a grounded plane: Fourier sum."""
    n = np.arange(1, 200, 2)
    k = 2.0 * np.pi * n / period
    thickness, eps_r = slab
    reach = np.cosh(k * thickness) + np.sinh(k * thickness) / np.tanh(k * gap) / eps_r
    return eps_0 / 4.0 * np.sum((k * 4.0 * volts / (np.pi * n) / reach / np.sinh(k * gap)) ** 2)


@pytest.mark.parametrize(("gap", "printed"), [(0.05, 932.68268), (0.5, 11.05853)])
def test_strips_of_two_voltages(gap, printed):
    """A quarter of a strip of either sign, the seam on a line."""
    exact = strips_pressure(4.0, (0.05, 3.0), gap, 1000.0)
    assert 1e6 * exact == pytest.approx(printed, rel=1e-6)
    errors = []
    for number in (60, 120):
        away = np.geomspace(1e-3, 1.0, number)
        x = np.unique(np.concatenate([1.0 - away, [1.0], 1.0 + away]))
        level, rows = 0.0 * x, np.linspace(0.0, 1.0, 9)
        levels = np.stack([level - 0.05, level, level + gap])
        voltages = np.array([[-1.0, 1.0, 1.0], [1.0, 3.0, -1.0]])
        found = Columns((3.0, 1.0), (rows, rows)).solve(x, levels, voltages)
        mean = -0.5 * found.by_level[2].sum() * 1e6 / np.ptp(x)
        errors.append(mean / exact - 1.0)
    assert abs(errors[1]) < 4e-5
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3

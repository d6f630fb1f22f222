"""The mean pull of fields in layers that conduct: a series, the law of plates, difference quotients."""

import numpy as np
import pytest

from evfem.electrostatics import eps_0
from evfem.field.columns import Columns
from evfem.field.meanattraction import mean_pull

ROWS = np.linspace(0.0, 1.0, 9)
INSULATOR, SKIN = 1.0 - (1.0 - ROWS) ** 2, ROWS**2


def over_strips(period, layers, order):
    """Mean pressure / (eps_0 U^2) on skin above abutting strips at +-U, through `layers` of (thickness,
    eps*) insulator, gap and skin below a conductor: admittances of the harmonics up to `order`.
    """
    (d, eps_i), (g, eps_g), (t, eps_s) = layers
    n = np.arange(1, order, 2)
    k = 2.0 * np.pi * n / period
    skin = eps_s * k / np.tanh(k * t)
    gap = eps_g * k * (skin + eps_g * k * np.tanh(k * g)) / (eps_g * k + skin * np.tanh(k * g))
    below = (4.0 / (np.pi * n)) / (np.cosh(k * d) + gap / (eps_i * k) * np.sinh(k * d))
    face = below / (np.cosh(k * g) + skin / (eps_g * k) * np.sinh(k * g))
    return 0.25 * np.sum((np.abs(skin / eps_g) ** 2 - k**2) * np.abs(face) ** 2)


@pytest.mark.parametrize("lossy", [(3.0, 1.0 - 2.0j, 20.0), (3.0 - 1.0j, 1.0 - 0.3j, 5.0 - 40.0j)])
def test_skin_over_strips_is_its_series(lossy):
    """Spreading in the skin, leaks of the gap, charges on the insulator; second order in the edge."""
    thickness, period = (0.05, 0.1, 0.3), 1.0
    exact = over_strips(period, list(zip(thickness, lossy, strict=True)), 400)
    errors = []
    for number in (30, 60):
        away = np.geomspace(1e-3, 0.25, number)
        x = np.unique(np.concatenate([0.25 - away, [0.25], 0.25 + away]))
        levels = np.repeat(np.cumsum([-0.05, *thickness])[:, None], x.size, axis=1)
        strips = np.array([[-1.0, 0.25, 1.0], [0.25, 2.0, -1.0]])
        pull = mean_pull(Columns(lossy, (INSULATOR, ROWS, SKIN)), x, levels, strips)
        errors.append(-pull.forces[:, 1].sum() / np.ptp(x) / eps_0 / exact - 1.0)
    assert abs(errors[1]) < 2e-4
    assert errors[0] / errors[1] > 3.0


def groove(number):
    """Half a groove of skin above the film."""
    x = np.linspace(0.0, 0.5, number)
    gap = 0.02 + 0.03 * (1.0 - np.cos(2.0 * np.pi * x))
    return x, np.stack([0.0 * x - 0.09, 0.0 * x, gap, gap + 0.38])


def test_without_conduction_it_is_the_derivative_of_the_energy():
    """Exactly across, in the third order along: there the lines lean instead of moving."""
    apart = []
    for number in (33, 65):
        columns = Columns((3.35, 1.0, 20.0), (INSULATOR, ROWS, SKIN))
        found, pull = columns.solve(*groove(number)), mean_pull(columns, *groove(number))
        up, along = 0.5 * found.by_level[2:].sum(axis=0), 0.5 * found.by_x
        assert pull.forces[:, 1] == pytest.approx(up, rel=1e-9)
        apart.append(np.abs(pull.forces[:, 0] - along).max() / np.abs(along).max())
    assert apart[0] < 1e-5
    assert np.log2(apart[0] / apart[1]) > 2.5

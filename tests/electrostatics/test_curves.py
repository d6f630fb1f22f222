"""Outlines by points of a curve, walls that are nearly upright, and the mean force of layers that conduct."""

import numpy as np
import pytest
from tools.fields import FILM, carter, cylinder, grooves, numbers, ridges, wave

from evfem import Layer
from evfem.electrostatics import eps_0, rigid_field
from evfem.field.bounds import columns_sum
from evfem.field.columns import Columns
from evfem.field.curves import curved
from evfem.field.fieldmesh import make_mesh
from evfem.field.meanattraction import mean_pull
from evfem.field.outlines import Outline
from evfem.field.poisson import Potential, Space


def bottom(radius, gap, points, by="angle"):
    """The lower half of a cylinder in points at even angles, or even places."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, points)
    x = radius * (np.sin(angle) if by == "angle" else np.linspace(-1.0, 1.0, points))
    return x, gap + radius - np.sqrt(np.maximum(radius**2 - x**2, 0.0))


@pytest.mark.parametrize("gap", [0.2, 0.05])
def test_points_of_a_curve_are_its_curve_in_the_fourth_order(gap):
    """Integral of 1/h over a sinusoid; chords have the second order."""
    exact, errors = 0.5 / np.sqrt(gap * (gap + 0.15)), []
    for points in (33, 65, 129):
        found = curved(Outline.of(*wave(gap, points)), 0.0)
        errors.append(columns_sum(found.x, found.height) / exact - 1.0)
    assert abs(errors[0]) < 5e-5
    assert np.all(np.log2(np.divide(errors[:-1], errors[1:])) > 3.8)


@pytest.mark.parametrize("by", ["angle", "place"])
@pytest.mark.parametrize(("radius", "gap"), [(8.34, 0.05), (8.34, 0.5), (0.1, 1.0)])
def test_cylinders_in_few_points(radius, gap, by):
    """Chords of 101 points err by up to two per cent."""
    solved = rigid_field(*bottom(radius, gap, 101, by), periodic=False)
    assert numbers(solved) == pytest.approx(cylinder(radius, gap), rel=5e-5)


@pytest.mark.parametrize(
    ("outline", "slab", "expected"),
    [
        (wave(0.05, 101), None, (5.507024468, 34.326092805)),
        (wave(0.1, 101), FILM, (2.91562519, 8.65459606)),
        (ridges(0.01, 101), FILM, (11.584984, 143.831401)),
        (ridges(0.05, 101), FILM, (5.915067, 35.495583)),
    ],
    ids=["wave .05", "wave .1 film", "ridges .01", "ridges .05"],
)
def test_ridges_in_few_points(outline, slab, expected):
    """Sinusoids and t^7 ridges, computed elsewhere by boundary integrals (each number twice)."""
    assert numbers(rigid_field(*outline, slab=slab)) == pytest.approx(expected, rel=3e-5)


@pytest.mark.parametrize(
    "points",
    [
        ([0.0, 1.0, 2.0], [1.0, 0.95, 1.0]),
        ([0.0, 0.1, 0.4, 0.5, 1.0], [0.105, 0.1, 0.1, 0.105, 0.105]),
        ([0.0, 0.1, 0.4, 0.5, 1.0], [0.2, 0.1, 0.1, 0.2, 0.2]),
    ],
    ids=["flat roof", "flat trapezoid", "trapezoid"],
)
@pytest.mark.parametrize("periodic", [True, False])
def test_corners_stay_corners(points, periodic):
    """Points that turn to and fro, pieces between two corners, large angles."""
    outline = Outline.of(*points, periodic)
    assert curved(outline, 0.01) is outline


@pytest.mark.parametrize("slope", [1e3, 1e8])
def test_steep_grooves_are_carters(slope):
    """A wall leans by as much as one chord of it says; in many points it is the same."""
    x, height = grooves(0.5, 0.2, 0.05)
    rise = (height[2] - height[1]) / slope
    x[2], x[3] = x[2] + rise, x[3] - rise
    few = numbers(rigid_field(x, height))
    assert few == pytest.approx(carter(0.5, 0.2, 0.05), rel=1e-5)
    many = np.unique(np.concatenate([x, np.linspace(0.0, 0.5, 101), np.linspace(x[1], x[2], 3)]))
    assert numbers(rigid_field(many, np.interp(many, x, height))) == pytest.approx(few, rel=1e-9)


def test_a_sphere_over_a_plane():
    """Around the axis x = 0 the integrals have the weight pi |x|: 2 kV, radius 8.34 mm, in mN."""
    outline = curved(Outline.of(*bottom(8.34, 0.25, 101), periodic=False), 0.0)
    space = Space(make_mesh(outline, 0.0, 0.0), 1.0)
    space.eps = space.eps * np.pi * np.abs(space.basis.mapping.F(space.basis.X)[0])
    force = -1e3 * Potential.of(space).force * 2000.0**2
    assert force == pytest.approx(3.52603445, rel=5e-5)


@pytest.mark.slow
def test_a_line_charge_over_a_half_space():
    """A thin wire at height 1 over a slab 10 m thick, at the charge that it has."""
    solved = rigid_field(*bottom(0.01, 0.99, 41), slab=Layer(1e4, 3.35), periodic=False)
    charge = 1e3 * solved.capacitance  # C per m at 1 V
    exact = charge**2 / (4.0 * np.pi * eps_0) * (3.35 - 1.0) / (3.35 + 1.0)
    assert solved.force == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize(
    ("x", "expected"),
    [
        ([0.0, 0.15, 0.15, 0.35, 0.35, 0.5], (5.63704355, 32.9360889)),
        ([0.0, 0.1, 0.2, 0.3, 0.4, 0.5], (4.98684381, 26.6880181)),
    ],
    ids=["upright", "leaning"],
)
def test_grooves_over_a_film_are_ngsolves(x, expected):
    """Recorded with NGSolve 6.2.2608 by `tools/with_ngsolve.py`: triangles of order 6."""
    solved = rigid_field(x, [0.05, 0.05, 0.25, 0.25, 0.05, 0.05], slab=FILM)
    assert numbers(solved) == pytest.approx(expected, rel=1e-5)


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

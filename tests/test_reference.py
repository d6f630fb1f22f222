"""Closed forms against printed numbers, limits and themselves (loads as integrals, forces as slopes)."""

import math
import re

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers, StrongTroxel, eps_0
from evfem.errors import InputError
from evfem.reference import (
    BondedLayer,
    CattaneoMindlin,
    HertzLine,
    cylinder_force,
    plane_modulus,
    pull_in_kaczmarek,
    pull_in_strong_troxel,
    sliding_force_ratio,
    tube_inner_radius,
    tube_pressure,
)

HERTZ = HertzLine(load=0.05, radius=8.34, modulus=plane_modulus(0.08, 0.48))
TABLE_2 = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))


def integral(function, start, stop, points=400):
    """Midpoint rule in t, x = middle - half cos t: roots at both ends become smooth functions."""
    t = (np.arange(points) + 0.5) * math.pi / points
    half = 0.5 * (stop - start)
    return np.sum(function(0.5 * (start + stop) - half * np.cos(t)) * half * np.sin(t)) * math.pi / points


def test_hertz_load_is_the_integral_of_its_pressure():
    a = HERTZ.half_width
    assert integral(HERTZ.pressure, -a, a) == pytest.approx(0.05, rel=1e-5)
    assert HERTZ.pressure(np.array([0.0, a, 2.0 * a])).tolist() == [HERTZ.peak_pressure, 0.0, 0.0]
    assert HertzLine.from_half_width(a, HERTZ.radius, HERTZ.modulus).load == pytest.approx(0.05, rel=1e-14)


def test_stick_zone_carries_the_tangential_load_within_the_cone():
    contact = CattaneoMindlin(HERTZ, friction_coefficient=0.4, tangential=0.015)
    a, c = HERTZ.half_width, contact.stick_half_width
    assert c / a == pytest.approx(math.sqrt(1.0 - 0.015 / (0.4 * 0.05)), rel=1e-14)  # = 0.5
    assert integral(contact.shear, -a, a, 4000) == pytest.approx(0.015, rel=1e-5)
    x = np.linspace(-a, a, 501)
    room = 0.4 * HERTZ.pressure(x) - contact.shear(x)
    assert (room[np.abs(x) < c] > 0.0).all()
    np.testing.assert_allclose(room[np.abs(x) > c], 0.0, atol=1e-17)


def test_bonded_layer_has_the_printed_numbers():
    layer = BondedLayer(half_width=0.7, thickness=0.7, radius=8.0, E=0.05, nu=0.3)
    modulus = plane_modulus(0.05, 0.3)
    assert layer.load * 8.0 / (modulus * 0.7**2) == pytest.approx(1.221797, abs=5e-7)
    assert layer.indentation * 8.0 / 0.7**2 == pytest.approx(0.653997, abs=5e-7)


@pytest.mark.parametrize(("ratio", "nu"), [(0.3, 0.3), (1.0, 0.3), (1.0, 0.5), (3.0, 0.45), (0.1, 0.4)])
def test_bonded_layer_load_is_the_slope_of_its_energy(ratio, nu):
    # U = 1/2 integral of p (delta - x^2/2R); growing the contact does the work P' d(delta)
    def state(a):
        layer = BondedLayer(a, ratio, 20.0, 1.0, nu)
        energy = 0.5 * integral(lambda x: layer.pressure(x) * (layer.indentation - x**2 / 40.0), -a, a)
        return energy, layer.indentation, layer

    (U1, d1, _), (U2, d2, _), (_, _, layer) = state(0.999), state(1.001), state(1.0)
    assert (U2 - U1) / (d2 - d1) == pytest.approx(layer.load, rel=1e-4)
    assert integral(layer.pressure, -1.0, 1.0) == pytest.approx(layer.load, rel=1e-4)
    assert (layer.pressure(np.linspace(-0.999, 0.999, 99)) > 0.0).all()


def test_bonded_layer_from_its_load():
    layer = BondedLayer(half_width=1.3, thickness=0.8, radius=20.0, E=0.06, nu=0.48)
    again = BondedLayer.from_load(layer.load, 0.8, 20.0, 0.06, 0.48)
    assert again.half_width == pytest.approx(1.3, rel=1e-9)


def test_tube_has_the_printed_number_and_rests_without_pressure():
    assert tube_pressure(1.5, 1.0, 2.0, 1.0) == pytest.approx(0.4282284091, abs=5e-11)
    assert tube_pressure(1.0, 1.0, 2.0, 1.0) == 0.0


def test_tube_radius_is_the_inverse_of_the_pressure():
    for a in (1.0, 1.2, 9.0):
        p = float(tube_pressure(a, 1.0, 2.0, 0.3))
        assert tube_inner_radius(p, 1.0, 2.0, 0.3) == pytest.approx(a, rel=1e-9)
    # ln 2 = 0.693: no radius carries more
    with pytest.raises(InputError, match=re.escape("0.207944")):
        tube_inner_radius(0.208, 1.0, 2.0, 0.3)


def test_cylinder_force_is_the_slope_of_the_capacitors_energy():
    def energy(d):
        return -0.5 * 2.0 * math.pi * eps_0 / np.arccosh((8.34 + d) / 8.34) * 2000.0**2

    h = 1e-4
    slope = (energy(0.25 + h) - energy(0.25 - h)) / (2 * h)
    assert cylinder_force(0.25, 8.34, 2000.0) == pytest.approx(slope, rel=1e-6)
    assert cylinder_force(0.25, 8.34, 2000.0) == pytest.approx(0.906597e-3, abs=5e-10)  # N/mm


@pytest.mark.parametrize(
    ("closed_form", "law", "volts"),
    [(pull_in_strong_troxel, StrongTroxel(), 843.789), (pull_in_kaczmarek, Kaczmarek(), 1598.737)],
)
def test_pull_in_is_where_spring_and_attraction_touch(closed_form, law, volts):
    k, g0, area = 0.1, 0.25, 100.0
    snap = closed_form(k, g0, area, TABLE_2)
    assert snap.voltage == pytest.approx(volts, abs=5e-4)
    gap = g0 - snap.travel
    assert area * law.traction(gap, snap.voltage, TABLE_2) == pytest.approx(k * snap.travel, rel=1e-12)
    assert -area * law.traction_derivative(gap, snap.voltage, TABLE_2) == pytest.approx(k, rel=1e-12)


def test_pull_in_of_one_layer_is_alike_for_thin_layers_and_none_when_the_gap_is_small():
    thin = Layers.of(Layer(1e-9, 1.0))
    one, other = (f(0.1, 0.25, 100.0, thin) for f in (pull_in_strong_troxel, pull_in_kaczmarek))
    assert one.voltage == pytest.approx(other.voltage, rel=1e-7)
    assert one.travel == pytest.approx(0.25 / 3.0, rel=1e-7)
    with pytest.raises(InputError, match="without a snap"):
        pull_in_strong_troxel(0.1, 0.01, 100.0, TABLE_2)  # (0.01 + 0.0271)/3 > 0.01


def test_sliding_point_is_an_inclined_plane():
    # tan(alpha + phi) uphill, tan(alpha - phi) downhill: school mechanics
    alpha, phi = 0.3, 0.2
    y, mu = math.tan(alpha), math.tan(phi)
    assert sliding_force_ratio(y, mu) == pytest.approx(math.tan(alpha + phi), rel=1e-14)
    assert sliding_force_ratio(-y, mu) == pytest.approx(math.tan(phi - alpha), rel=1e-13)
    assert sliding_force_ratio(y, mu, direction=-1) == pytest.approx(math.tan(alpha - phi), rel=1e-13)


def test_sliding_point_jams_where_friction_times_slope_reaches_one():
    ratio = sliding_force_ratio(np.array([0.0, 1.9, 2.0, 3.0]), 0.5)
    assert np.isinf(ratio).tolist() == [False, False, True, True]
    assert sliding_force_ratio(-3.0, 0.5, direction=-1) == -math.inf


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: HertzLine(load=-1.0, radius=1.0, modulus=1.0), "load"),
        (lambda: HertzLine(load=1.0, radius=float("nan"), modulus=1.0), "radius"),
        (lambda: CattaneoMindlin(HERTZ, 0.0, 0.0), "friction_coefficient"),
        (lambda: CattaneoMindlin(HERTZ, 0.4, 0.4 * 0.05), "tangential"),
        (lambda: BondedLayer(1.0, 1.0, 1.0, 1.0, 0.6), "nu"),
        (lambda: tube_pressure(1.5, 2.0, 1.0, 1.0), "outer"),
        (lambda: cylinder_force(0.0, 1.0, 1.0), "distance"),
        (lambda: pull_in_kaczmarek(0.0, 0.25, 1.0, TABLE_2), "stiffness"),
        (lambda: sliding_force_ratio(0.0, 0.3, direction=0), "direction"),
    ],
)
def test_impossible_input_is_refused_by_key(make, key):
    assert refuses("allowed", make).key == key

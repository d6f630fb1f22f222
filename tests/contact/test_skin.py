"""The skin's projected areas: integrals, derivatives, gross and real contact, attraction of an
ellipsoid against quadrature.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import dblquad
from tools.pads import seen
from tools.solids import bent, block, sheet

from evfem.electrostatics.laws import Kaczmarek, Layer, Layers
from evfem.errors import InputError
from evfem.mesh.faces import PLACES, shape_functions
from evfem.surface.skin import make_skin
from evfem.surface.surfaces import Flat
from evfem.terms.attraction import Attraction

FACES = {4: "bilinear", 9: "biquadratic"}


@pytest.mark.parametrize("m", FACES)
def test_shape_functions_are_one_at_their_node_and_sum_up(m):
    value, _ = shape_functions(m, PLACES[:m])
    assert_allclose(value, np.eye(m), atol=1e-15)
    places = np.random.default_rng(0).uniform(-1, 1, (5, 2))
    h = 1e-6
    value, slope = shape_functions(m, places)
    assert_allclose(value.sum(axis=1), 1.0)
    for i in (0, 1):
        d = h * np.eye(2)[i]
        differences = (shape_functions(m, places + d)[0] - shape_functions(m, places - d)[0]) / (2 * h)
        assert_allclose(slope[..., i], differences, atol=1e-9)


@pytest.mark.parametrize("m", FACES)
def test_areas_are_the_projection_and_shares_of_a_square_are_simpsons(m):
    skin, points = sheet(2, m, lambda p, q: (2.0 * p, 0.0 * p, 3.0 * q))
    area = skin.tributary(points)
    assert_allclose(area.sum(), 6.0)
    side = np.array([1.0, 2.0, 1.0]) / 4 if m == 4 else np.array([1.0, 4.0, 2.0, 4.0, 1.0]) / 12
    assert_allclose(area, 6.0 * np.outer(side, side).ravel())
    assert_allclose(skin.tributary(points * [1.0, 1.0, -1.0]), 0.0)  # seen from the other side


@pytest.mark.parametrize("m", FACES)
def test_derivative_of_the_areas_is_that_of_differences(m):
    skin, points = sheet(3, m, bent)
    of, unknown, value = skin.tributary_gradient(points)
    found = np.zeros((len(points), points.size))
    np.add.at(found, (of, unknown), value)
    expected, h = np.empty_like(found), 1e-6
    for i in range(points.size):
        d = h * np.eye(points.size)[i].reshape(points.shape)
        expected[:, i] = (skin.tributary(points + d) - skin.tributary(points - d)) / (2 * h)
    assert_allclose(found, expected, atol=1e-8)


def test_on_the_way_nodes_stand_for_the_mean_of_both_ends():
    """Twice as wide and thrice as long, 6 of 1: 3.5 on the way, wherever on it."""
    skin, points = sheet(2, 4, lambda p, q: (p, 0.0 * p, q))
    between = skin.tributary_between(points, points * [2.0, 1.0, 3.0], points[:, ::2])
    assert_allclose(between, 3.5 * skin.tributary(points), rtol=1e-14)


def test_several_places_at_once_are_each_place_alone():
    skin, points = sheet(3, 9, bent)
    both = np.stack([points, 1.3 * points])
    assert_allclose(skin.tributary(both), [skin.tributary(one) for one in both])


@pytest.mark.parametrize("m", FACES)
def test_areas_end_between_the_nodes(m):
    skin, points = sheet(10, m, lambda p, q: (4.0 * p, 0.0 * p, 4.0 * q))
    x, z = points[:, 0], points[:, 2]
    h = 0.4 if m == 4 else 0.2
    assert_allclose(skin.areas(points, np.ones(x.size)), (16.0, 16.0))
    assert skin.areas(points, -np.ones(x.size)) == (0.0, 0.0)
    assert_allclose(skin.areas(points, 1.83 - x), 4.0 * (1.83 - h / 4), rtol=1e-4)
    # a disc, less a fourth of a spacing around it; polygons between the nodes miss (h / r)^2 / 3 of it
    disc = np.pi * (1.3 - h / 4) ** 2
    assert_allclose(skin.areas(points, 1.3 - np.hypot(x - 2.03, z - 1.99)), disc, rtol=(h / 1.3) ** 2 / 3)
    # two discs apart: the hull spans what is open between them
    apart = np.minimum(np.hypot(x - 1.1, z - 2.0), np.hypot(x - 2.9, z - 2.0))
    r = 0.8 - h / 4
    expected = np.array([np.pi * r**2 + 1.8 * 2.0 * r, 2.0 * np.pi * r**2])
    assert_allclose(skin.areas(points, 0.8 - apart), expected, rtol=(h / r) ** 2 / 3)


@pytest.mark.parametrize("m", FACES)
@pytest.mark.parametrize("alone", [False, True])
def test_areas_pass_continuously_where_a_node_begins_to_touch(m, alone):
    skin, points = sheet(6, m, bent)
    reach = -0.5 - points[:, 0] if alone else 0.2 - np.hypot(points[:, 0] - 0.7, points[:, 2] - 1.0)
    node = np.argmin(np.abs(reach))
    ends = []
    for tiny in (1e-9, -1e-9):
        reach[node] = tiny
        ends.append(skin.areas(points, reach)[1])
    assert_allclose(*ends, atol=1e-4)  # the area below one node grows like the root of its reach


def test_a_skin_has_the_pad_s_faces_and_says_where_there_are_none():
    mesh = block((2, 3, 4), (2.0, 3.0, 4.0))
    mesh.node_sets["pad"], mesh.node_sets["bone"] = mesh.node_sets["bottom"], mesh.node_sets["left"]
    skin = make_skin(mesh)
    points = mesh.points[skin.nodes]
    assert (len(skin.faces), skin.free.sum()) == (8, 10)
    assert_allclose(skin.tributary(points).sum(), 8.0)
    assert skin.facing(points).all()
    assert skin.spacing(points) == 1.0
    mesh.node_sets["pad"] = mesh.node_sets["bottom"][:1]
    with pytest.raises(InputError, match="no outer face"):
        make_skin(mesh)


def ellipsoid(p, q, a=8.34, b=6.395, c=11.25):
    """Lower half of Table 2's ellipsoid, its lowest point at y = 0, on a disc mapped to a square."""
    u, v = 2.0 * p - 1.0, 2.0 * q - 1.0
    s, t = u * np.sqrt(1.0 - 0.5 * v**2), v * np.sqrt(1.0 - 0.5 * u**2)
    rest = np.sqrt(np.maximum(1.0 - s**2 - t**2, 0.0))
    return a * s, b * (1.0 - rest), c * t


@pytest.mark.parametrize("m", FACES)
def test_a_rigid_ellipsoid_hovers_under_the_quadrature_s_attraction(m):
    """0.5 mm above 2000 V, after Kaczmarek: 0.1 % of the double integral over the ellipse."""
    layers = Layers.of(Layer(0.38, 1650.0), Layer(0.09, 3.35))
    law, gap = Kaczmarek(), 0.5

    def ring(r, angle):
        y = 6.395 * (1.0 - np.sqrt(max(1.0 - r * r, 0.0)))
        return float(law.traction(gap + y, 2000.0, layers)) * 8.34 * 11.25 * r

    expected = dblquad(ring, 0.0, 0.5 * np.pi, 0.0, 1.0, epsrel=1e-6)[0] * 4.0
    skin, points = sheet(40 if m == 9 else 80, m, ellipsoid)
    skins = Layers.of(Layer(np.full(len(points), 0.38), 1650.0), Layer(0.09, 3.35))
    pull = Attraction(law, skins, skin, Flat(y=-gap))
    found = -pull.forces(seen(pull, points, 2000.0, np.zeros(len(points), bool))).sum(axis=0)
    assert_allclose(found, [0.0, expected, 0.0], rtol=1e-3)

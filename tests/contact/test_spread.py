"""Forces on nodes as pressures on strips, of closed forms on elastic surfaces; tractions along facets."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import j1
from tools.domes import Dome, dome, dome_scene
from tools.meshes import arc, contact_block
from tools.solids import bent, sheet

import evfem as ev
from evfem.contact.signorini import SLIP, STICK
from evfem.mesh.mesh import raised
from evfem.simulation.model import make_model
from evfem.surface.elastic import transfer
from evfem.surface.skin import make_skin
from evfem.surface.spread import Facets, strips_below


def edges():
    pad, points = arc(4, 1e3, 2.4)
    return pad, points * [1.0, 0.0]


PADS = {"edges": edges(), "faces": sheet(3, 9, lambda p, q: (1.8 * p, 0.0 * p, 1.8 * q))}
WARPED = {"edges": arc(4, 1.5, 2.4), "faces": sheet(3, 9, bent)}


def below(pad, points):
    strips = strips_below(pad, points, points, np.arange(len(points)), 0.0)
    return strips, np.linalg.inv(strips.means.solve(np.eye(len(points))))


@pytest.mark.parametrize("pads", [PADS, WARPED])
@pytest.mark.parametrize("name", PADS)
def test_strips_are_what_nodes_stand_for_and_carry_an_even_pressure(name, pads):
    pad, points = pads[name]
    strips, means = below(pad, points)
    size = pad.tributary(points)
    assert_allclose(strips.split.astype(bool) @ strips.sizes, size)
    assert_allclose(strips.split.sum(axis=1), 1.0)
    assert_allclose(means.sum(axis=1), 1.0)
    if pads is PADS:
        assert_allclose(means.T @ size, size)


@pytest.mark.parametrize("name", PADS)
def test_means_over_strips_are_those_of_quadratic_displacements(name):
    """The mean of x^2 over a length L is that of its middle and L^2 / 12, over squares along both axes."""
    pad, points = PADS[name]
    strips, means = below(pad, points)
    long = strips.sizes if name == "edges" else np.sqrt(strips.sizes)
    inner = np.abs(points - points.mean(axis=0)).max(axis=1) < 0.8
    for x, at in zip(strips.places.reshape(len(long), -1).T, points[:, ::2].T, strict=True):
        assert_allclose((strips.split @ (x**2 + long**2 / 12.0))[inner], (means @ at**2)[inner], atol=1e-12)


STACK = (ev.ElasticLayer(1.0, 0.3, 0.2), ev.ElasticLayer(0.08, 0.48, 2.0))
HARD = ev.LinearElastic(2e3, 0.3)


def sunk(x, peak=1e-4):
    """Depth of the coated surface in the middle of p = peak sqrt(1 - x^2), less that at x: peak / E* x^2 of a
    half-plane of the coating, and by a Fourier integral what the stack gives way more.
    """
    plane, (point, weight) = 1.0 / (1.0 - 0.3**2), np.polynomial.legendre.leggauss(8)
    half = 0.5 * np.diff(np.linspace(0.0, 40.0, 201))[:, None]
    k, dk = (half * (1.0 + point) + np.linspace(0.0, 40.0, 201)[:-1, None]).ravel(), (half * weight).ravel()
    more = (transfer(STACK, k)[0] - 2.0 / (plane * k)) * j1(k) / k * dk
    return peak * ((1.0 - np.cos(np.outer(x, k))) @ more + np.square(x) / plane)


@pytest.fixture(scope="module")
def outline():
    """Heights of a hard finger that such a pressure touches: above it beside the contact."""
    places = np.linspace(0.0, 1.5, 61)
    heights = sunk(places) + 1e-4 * np.maximum(places - 1.0, 0.0) ** 2
    return lambda x: np.interp(np.abs(x), places, heights)


def coated_press(size, outline, straight=False):
    """Places and contact pressures of nodes under that load, and the largest of the history."""
    x = np.linspace(-1.5, 1.5, round(3.0 / size) + 1)
    mesh = contact_block(x, np.array([0.0, 0.5, 1.0]), 1.5, outline, quadratic=not straight)
    motion = [ev.Press(indentation=1e-6, steps=1), ev.Press(force=0.5e-4 * np.pi, steps=1)]
    surface = ev.Flat(friction=0.0, elastic=list(STACK))
    result = ev.simulate(ev.Scene(ev.MeshedFinger(mesh, {"tissue": HARD}), surface, motion=motion))
    nodes = result.mesh.node_sets["pad"]
    x = result.mesh.points[nodes, 0]
    return x, result.frames[-1].contact_pressure[nodes], result.peak_contact_pressure[-1]


def error_of(x, pressure):
    inside = np.abs(x) < 0.6
    return np.abs(pressure[inside] / (1e-4 * np.sqrt(1.0 - x[inside] ** 2)) - 1.0).max()


@pytest.mark.filterwarnings("ignore:the shear modulus")
def test_pressures_on_a_coated_surface_are_those_of_the_closed_form(outline):
    """Of every node; held against the places of nodes, means over strips alternate by 8 and 4 %."""
    coarse, fine = (error_of(*coated_press(size, outline)[:2]) for size in (0.2, 0.1))
    assert fine < 1e-3
    assert coarse > 2.0 * fine


@pytest.mark.filterwarnings("ignore:the shear modulus")
def test_facets_do_not_alternate_on_a_coated_surface(outline):
    """Straight sides of 0.05 mm press less in their middle: nodes alone alternate by 14 % there."""
    x, pressure, peak = coated_press(0.05, outline, straight=True)
    assert error_of(x, pressure) < 5e-3
    assert peak == pytest.approx(1e-4, rel=5e-3)


@dataclass(frozen=True)
class Made(Dome):
    """A finger whose mesh is `shape` as it is."""

    def mesh(self, order=2):
        return self.shape


def hertz_error(cells, straight=False):
    """Largest error of a node's pressure within 0.6 contact radii, over Hertz's peak, of a hard paraboloid (R
    1 m) that is pressed 0.2 um into a half-space; contact has a radius of 0.447 mm.
    """
    shape = dome((cells, 1, cells), (1.6, 0.5, 1.6), 1e3, order=1 if straight else 2)
    finger = Made(raised(shape), HARD)
    surface = ev.Flat(friction=0.0, elastic=ev.ElasticLayer(0.08, 0.48, 1e3))
    given = {"surface": surface, "law": None, "voltage": 0.0, "solver": ev.Solver(element="hex27p1")}
    result = ev.simulate(dome_scene(ev.Press(indentation=2e-4, steps=1), finger=finger, **given))
    nodes, radius = result.mesh.node_sets["pad"], np.sqrt(0.2)
    far = np.hypot(*result.mesh.points[nodes][:, ::2].T) / radius
    peak = 2.0 / np.pi * 0.08 / (1.0 - 0.48**2) * radius / 1e3
    exact = np.sqrt(np.maximum(1.0 - far**2, 0.0))
    return np.abs(result.frames[-1].contact_pressure[nodes] / peak - exact)[far < 0.6].max()


@pytest.mark.filterwarnings("ignore:the shear modulus", "ignore:the mesh is")
def test_pressures_in_space_are_hertz_s():
    """Squares of the size of a side's middle, not two of them, would give 1.47 of the peak on every mesh."""
    coarse, fine = hertz_error(6), hertz_error(10)
    assert fine < 0.02
    assert coarse > (10.0 / 6.0) ** 1.5 * fine


def facets(order=1, radius=1e3, straight=True):
    """A paraboloid's skin in straight or in curved sides, and the places of its nodes."""
    mesh = dome((6, 1, 6), (3.0, 0.5, 3.0), radius, order=order)
    mesh = raised(mesh) if straight else mesh
    skin = make_skin(mesh)
    return skin, mesh.points[skin.nodes]


def test_linear_tractions_along_facets_stay_and_what_alternates_goes():
    skin, points = facets()
    size, even = skin.tributary(points), Facets(skin, points)
    linear = 2.0 + points @ [0.3, 0.0, -0.4]
    middle = np.isin(np.arange(len(points)), skin.faces[:, 8])
    alternating = np.where(middle, 0.2, 0.0) - 0.2 * 4.0 / 9.0  # of no force on a face
    none = np.zeros(linear.size, bool)
    assert_allclose(even.evened(linear, linear, none), linear)
    assert_allclose(even.evened(linear, linear + alternating, none), linear, atol=1e-12)
    drawn = linear + np.random.default_rng(2).uniform(-0.1, 0.1, linear.size)
    assert_allclose(size @ even.evened(drawn, drawn, none), size @ drawn)


def test_shear_of_sides_that_stick_stays_within_the_cone():
    """Two nodes of a side at the bound and one without shear: the linear one of their force is beyond it."""
    skin, points = facets()
    rng, even, none = np.random.default_rng(5), Facets(skin, points), np.zeros(len(points), bool)
    pressure, shear = rng.uniform(1.0, 1.1, len(points)), rng.choice([-0.2, 0.0, 0.2], len(points))
    bound = 0.2 * even.evened(pressure, pressure, none)
    found = even.evened(pressure, shear * pressure, none)
    assert np.abs(found).max() > 0.15
    assert_allclose(np.maximum(np.abs(found), bound), bound, rtol=1e-12)


def test_tractions_stay_where_a_side_touches_in_part():
    skin, points = facets()
    pressure = 1.0 + np.random.default_rng(3).uniform(0.0, 0.1, len(points))
    pressure[skin.faces[0, 8]] = 0.0
    lone = np.setdiff1d(skin.faces[0], skin.faces[1:])
    changed = Facets(skin, points).evened(pressure, pressure, pressure < 0.0) != pressure
    assert not changed[lone].any()
    assert changed.sum() > 0.8 * len(points)


OTHERS = {
    "curved": lambda: facets(order=2, straight=False),
    "flat": lambda: facets(radius=1e12),
    "ridged": lambda: facets(radius=2.0),
    "linear": lambda: facets(straight=False),
    "edges": lambda: arc(6, 8.0, 1.0),
}


@pytest.mark.parametrize("name", OTHERS)
def test_other_outlines_have_no_facets(name):
    """A curved, a flat and an edged one, and one of linear sides."""
    assert not len(Facets(*OTHERS[name]()).sides)


@pytest.mark.parametrize(
    ("surface", "evens"),
    [
        (ev.Flat(elastic=STACK[1]), True),
        (ev.Flat(), False),
        (ev.Sinusoid(0.3, [[0.01, 0.5, 0.0]], elastic=STACK[1]), False),
    ],
)
def test_tractions_are_even_above_flat_elastic_surfaces_alone(surface, evens):
    """On a rigid one they are what nodes carry, and hills may be as narrow as a side."""
    mesh = contact_block(np.linspace(-2.0, 2.0, 9), np.array([0.0, 1.0]), 2.0, lambda x: 0.01 * x**2, False)
    finger = ev.MeshedFinger(mesh, {"tissue": ev.LinearElastic(0.1, 0.3)})
    model = make_model(ev.Scene(finger, surface, motion=[ev.Press(indentation=0.01)]))
    drawn = np.random.default_rng(4).uniform(1.0, 1.1, len(model.pad.nodes))
    foundation = model.equilibrium.interface.foundation
    assert (foundation.evened(drawn, drawn, drawn < 0.0) != drawn).any() == evens


def test_shear_on_facets_is_within_the_cone_and_on_it_where_nodes_slip():
    """Evened along a side that sticks in part, it was twice the friction at the end that sticks."""
    x = np.linspace(-2.0, 2.0, 9)
    mesh = contact_block(x, np.array([0.0, 0.5, 1.0]), 2.0, lambda x: 0.03 * x**2, False)
    surface = ev.Flat(friction=0.2, elastic=ev.ElasticLayer(2.5, 0.3, 4.0))
    finger = ev.MeshedFinger(mesh, {"tissue": ev.NeoHookean(0.04, 0.45)})
    motion = [ev.Press(indentation=0.05, steps=3), ev.Slide(0.01, steps=3)]
    result = ev.simulate(ev.Scene(finger, surface, motion=motion))
    mixed = 0
    for frame in result.frames:
        shear, bound = np.abs(frame.shear_traction), 0.2 * frame.contact_pressure
        mixed += {STICK, SLIP} <= {*frame.contact_status}
        assert_allclose(np.maximum(shear, bound), bound, rtol=1e-9)
        slips = frame.contact_status == SLIP
        assert_allclose(shear[slips], bound[slips], rtol=1e-9)
    assert mixed

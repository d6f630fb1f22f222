"""Surfaces over x and z: heights and slopes, frames of nodes on them, maps of friction and their
jumps, the attraction along the normal.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.pads import seen
from tools.refusals import refuses
from tools.solids import bent, sheet

import evfem as ev
from evfem.common.constants import CHANGES, PIN_OFFSET
from evfem.errors import InputError
from evfem.newton.interface import FrictionJumps
from evfem.surface.pad import surface_state
from evfem.surface.surfaces import EQUATION_25
from evfem.terms.attraction import Attraction

GRID = np.linspace(-2.0, 2.0, 33)
#: two waves askew, the second one at 90 degrees from the first
EGGS = ev.Sinusoid(terms=[[0.3, 2.0, 0.3], [0.2, 1.5, 1.0, 90.0]], angle=25.0, y=-1.0)
PLACES = np.random.default_rng(2).uniform(-1.5, 1.5, (40, 2))


def sampled(surface, grid=GRID):
    """A relief through the heights of another surface."""
    x, z = np.meshgrid(grid, grid)
    return ev.Relief(grid, grid, surface.relief(np.stack([x, z], axis=-1))[0], y=surface.y)


def differences(function, at, h=1e-5):
    """Central differences of a function of places (P, 2) by x and by z, (P, ..., 2)."""
    ways = h * np.eye(2)
    return np.stack([(function(at + way) - function(at - way)) / (2.0 * h) for way in ways], axis=-1)


SURFACES = {
    "eggs": EGGS,
    "relief": sampled(EGGS),
    "profile": ev.Profile(GRID, np.sin(2.0 * GRID), angle=-40.0),
    "grating": ev.Grating(period=1.1, groove_depth=0.2, angle=200.0),
}


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_slopes_and_curvatures_are_derivatives(surface):
    _, slope, curvature = surface.relief(PLACES)
    assert_allclose(slope, differences(lambda at: surface.relief(at)[0], PLACES), atol=1e-7)
    near = differences(lambda at: surface.relief(at)[1], PLACES)
    smooth = np.abs(curvature - near).max(axis=(1, 2)) < 1e-6
    # curvatures of profiles and walls jump
    assert smooth.mean() > (0.9 if surface.crosses and "gr" not in type(surface).__name__.lower() else 0.8)


def test_a_turned_surface_has_the_heights_of_its_profile_along_its_direction():
    """At a place that lies s along the direction, whatever lies across."""
    for surface in (ev.Sinusoid, lambda **way: ev.Grating(1.1, 0.2, **way)):
        for angle in (0.0, 30.0, 90.0, -200.0):
            way = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
            s, across = PLACES.T
            place = s[:, None] * way + across[:, None] * np.array([-way[1], way[0]])
            height, slope, _ = surface(angle=angle).relief(place)
            assert_allclose(height, surface().height(s), atol=1e-14)
            assert_allclose(slope, surface().slope(s)[:, None] * way, atol=1e-13)
    assert_allclose(ev.Sinusoid().height(0.7), sum(a * np.sin(k * 0.7 + p) for a, k, p in EQUATION_25))


def test_a_relief_through_samples_comes_to_them_with_the_fourth_power_of_their_distance():
    """Heights of a cubic spline; through bilinear heights it is exact, and beyond its edges level."""
    wrong = []
    for n in (17, 33):
        found = sampled(EGGS, np.linspace(-2.0, 2.0, n)).relief(0.5 * PLACES)
        wrong.append(np.abs(found[0] - EGGS.relief(0.5 * PLACES)[0]).max())
    assert 12.0 < wrong[0] / wrong[1] < 24.0
    plane = ev.Relief(GRID, GRID, 0.1 + 0.2 * GRID - 0.05 * GRID[:, None] * (1.0 + GRID))
    height, slope, curvature = plane.relief(np.array([[0.4, -1.0], [3.0, 0.5]]))
    assert_allclose(height, [0.1 + 0.08 + 0.05 * 1.4, 0.1 + 0.4 - 0.025 * 3.0], atol=1e-13)
    assert_allclose(slope, [[0.2 + 0.05, -0.05 * 1.4], [0.0, -0.15]], atol=1e-12)
    assert_allclose(curvature[0], [[0.0, -0.05], [-0.05, 0.0]], atol=1e-11)
    assert_allclose(plane.height(np.array([0.5])), 0.2)


WRONG = {
    "surface.x": (GRID[::-1], GRID, np.zeros((33, 33))),
    "surface.z": (GRID, GRID[:3], np.zeros((3, 33))),
    "surface.height": (GRID, GRID[:5], np.zeros((33, 5))),
}


@pytest.mark.parametrize("key", WRONG)
def test_samples_that_are_no_grid_are_refused(key):
    assert str(refuses("increasing x and z", ev.Relief, *WRONG[key])).startswith(key)


def test_a_relief_from_a_file_has_its_rows_in_any_order(tmp_path):
    rows = [(x, z, 0.01 * x - 0.02 * z * z) for z in range(4) for x in range(5)]
    rng = np.random.default_rng(1)
    text = "\n".join(",".join(map(str, rows[i])) for i in rng.permutation(len(rows)))
    (tmp_path / "scan.csv").write_text(f"x,z,height\n{text}\n")
    found = ev.Relief.from_csv(tmp_path / "scan.csv", friction=0.1)
    assert (found.samples.shape, found.friction) == ((4, 5), 0.1)
    assert_allclose(found.relief(np.array([[2.0, 3.0], [4.0, 1.0]]))[0], [-0.16, 0.02], atol=1e-14)
    (tmp_path / "scan.csv").write_text("x,z,height\n0,0,0\n1,0,0\n1,1,0\n")
    refuses(r"surface\.file: given 3 rows of 2 x and 2 z", ev.Relief.from_csv, tmp_path / "scan.csv")


def state(at):
    """The frame of nodes on `EGGS` at these places."""
    return surface_state(EGGS, np.column_stack([at[:, 0], np.zeros(len(at)), at[:, 1]]))


def test_frames_are_orthonormal_and_their_ways_are_on_the_surface():
    """A way dx, dz on the surface rises by the slopes; its parts along both tangents are `travel`."""
    found = state(PLACES)
    assert_allclose(
        np.einsum("pak,pbk->pab", found.axes, found.axes), np.tile(np.eye(3), (40, 1, 1)), atol=1e-14
    )
    assert (np.linalg.det(found.axes[:, :, [1, 0, 2]]) < 0.0).all()  # x, y, z as n, t1, t2: left-handed
    for way in np.eye(2):
        moved = np.column_stack([found.slope @ way, np.tile(way, (40, 1))])
        parts = np.einsum("pak,pk->pa", found.axes, moved)
        assert_allclose(parts[:, 0], 0.0, atol=1e-14)
        assert_allclose(parts[:, 1:], found.travel @ way, atol=1e-14)


def test_forces_turn_with_their_nodes():
    """The derivative of a force that is constant in its frame, along x and z, is that of differences."""
    force = np.random.default_rng(4).normal(size=(40, 3))
    expected = differences(lambda at: np.einsum("pa,pak->pk", force, state(at).axes), PLACES)
    assert_allclose(state(PLACES).turned(force), expected, atol=1e-8)


def test_a_map_is_bilinear_between_its_rows_and_constant_beyond():
    table = ev.FrictionMap([0.0, 1.0, 3.0], [0.0, 2.0], [[0.1, 0.3, 0.3], [0.5, 0.3, 0.7]])
    at = np.array([[0.5, 1.0], [2.0, 1.0], [9.0, 9.0], [-1.0, 1.0]])
    assert_allclose(table.at(at), [0.3, 0.4, 0.7, 0.3], atol=1e-15)
    inside = at[:2]
    assert_allclose(table.gradient(inside), differences(table.at, inside), atol=1e-9)
    assert_allclose(table.gradient(at[2:]), [[0.0, 0.0], [0.0, 0.2]], atol=1e-15)
    assert table.steps == ()


def test_the_jumps_of_a_map_have_their_coefficients_on_both_sides():
    """Along x between columns that stand at one place, and along z between rows."""
    table = ev.FrictionMap(
        [-1.0, 0.5, 0.5, 1.0], [0.0, 1.0, 1.0, 2.0], [[0.2, 0.2, 0.5, 0.5]] * 2 + [[0.4, 0.4, 0.3, 0.3]] * 2
    )
    by_x, by_z = table.steps
    assert (by_x.axis, by_x.place.tolist(), by_z.axis, by_z.place.tolist()) == (0, [0.5], 1, [1.0])
    for across in (0.3, 1.7):
        near = np.array([[0.5 - 1e-12, across], [0.5, across]])
        found = by_x.sides(np.array([0]), np.array([across]))
        assert_allclose(np.ravel(found), table.at(near), atol=1e-10)
    found = by_z.sides(np.array([0, 0]), np.array([-0.7, 0.9]))
    assert_allclose(found, [[0.2, 0.5], [0.4, 0.3]], atol=1e-15)
    assert ev.Flat(friction=table).friction_steps(9.0) == table.steps


@pytest.mark.parametrize(
    "wrong",
    [([0.0, 0.0, 1.0], [0.0, 1.0]), ([0.0, 1.0], [0.0, 2.0, 1.0]), ([0.0, 1.0, 1.0, 1.0, 2.0], [0.0, 1.0])],
)
def test_positions_that_are_none_of_a_map_are_refused(wrong):
    with pytest.raises(InputError, match=r"surface\.friction\.[xz]: given . positions"):
        ev.FrictionMap(*wrong, np.full((len(wrong[1]), len(wrong[0])), 0.3))
    refuses(r"surface\.friction\.friction", ev.FrictionMap, [0.0, 1.0], [0.0, 1.0], [[0.1, -0.1], [0.2, 0.3]])


def test_a_node_that_comes_to_a_jump_askew_is_pinned_where_its_way_crosses_it():
    """From (-0.1, 0) towards (0.3, 0.8): it meets x = 0 at z = 0.2, a hair inside the rougher side."""
    steps = ev.Flat(friction=[[-9.0, 0.2], [0.0, 0.2], [0.0, 0.6]]).friction_steps(0.0)
    begin, beyond = np.array([[-0.1, 0.0]]), np.array([[0.3, 0.8]])
    pins = FrictionJumps(steps, begin)
    for k in range(CHANGES):
        pins.watch(beyond if k % 2 == 0 else begin, np.array([True]))
    assert pins.held.all()
    assert_allclose(pins.place, [[PIN_OFFSET, 0.2]], atol=1e-15)
    assert pins.lower.tolist() == [0.2]
    assert_allclose(pins.at(beyond), pins.place)
    assert pins.release(np.array([1.0]), np.array([0.9]), 0.0)
    assert_allclose(pins.at(beyond), beyond)


def pulled(surface, direction):
    """Attraction of a bent sheet of nine nodes a face, and its points."""
    skin, points = sheet(3, 9, bent)
    layers = ev.Layers.of(ev.Layer(np.full(len(points), 0.38), 1650.0), ev.Layer(0.09, 3.35))
    return Attraction(ev.Kaczmarek(), layers, skin, surface, direction), points


@pytest.mark.parametrize("surface", [ev.Flat(y=-0.2), EGGS], ids=["flat", "eggs"])
@pytest.mark.parametrize("direction", ["vertical", "normal"])
def test_the_traction_along_the_normal_is_minus_the_derivative_of_its_energy(surface, direction):
    """W = sum of Pi(g_j) A_j; the stiffness is the derivative of the forces, and symmetric there."""
    pull, points = pulled(surface, direction)
    far, h = np.zeros(len(points), bool), 1e-6
    gap = surface_state(surface, points).gap
    assert gap.min() > 0.0

    def energy(at):
        gaps = surface_state(surface, at).gap
        return float(pull.law.potential(gaps, 1000.0, pull.layers) @ pull.pad.tributary(at))

    forces, found = (
        pull.forces(seen(pull, points, 1000.0, far)),
        pull.stiffness(seen(pull, points, 1000.0, far)).toarray(),
    )
    for i in range(points.size):
        d = h * np.eye(points.size)[i].reshape(points.shape)
        ends = [pull.forces(seen(pull, points + sign * d, 1000.0, far)).ravel() for sign in (1, -1)]
        assert_allclose(found[:, i], (ends[0] - ends[1]) / (2 * h), atol=1e-7 * np.abs(found).max())
        if direction == "normal":
            slope = (energy(points + d) - energy(points - d)) / (2 * h)
            assert_allclose(forces.ravel()[i], -slope, atol=1e-7 * np.abs(forces).max())
    assert np.allclose(found, found.T, atol=1e-12 * np.abs(found).max()) is (direction == "normal")

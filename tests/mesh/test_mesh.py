"""The mesh container: edges, raising to quadratic cells, thickness of layers, shape of cells."""

from dataclasses import replace

import numpy as np
import pytest
from tools.meshes import between

from evfem.errors import InputError
from evfem.mesh.faces import layer_thickness
from evfem.mesh.mesh import Mesh, raised
from evfem.mesh.quality import scaled_jacobian


def strip(columns=4, order=1):
    """[0, 4] x [0, 3]: `under` (2 high) below `layer` (1 high)."""
    mesh = between(*np.meshgrid(np.linspace(0.0, 4.0, columns + 1), [0.0, 2.0, 3.0]))
    mesh = replace(mesh, region=np.repeat([7, 9], columns), region_names={"under": 7, "layer": 9})
    return raised(mesh) if order == 2 else mesh


def triangle(kind="triangle", apex=(0.5, 0.75**0.5)):
    points = np.array([[0.0, 0.0], [1.0, 0.0], apex])
    mesh = Mesh(points, np.array([[0, 1, 2]]), "triangle", np.zeros(1, int), {"skin": 0})
    return raised(mesh) if kind == "triangle6" else mesh


def test_outer_edges_run_around_the_body_with_the_body_on_the_left():
    for order in (1, 2):
        mesh = strip(order=order)
        start, end = mesh.points[mesh.outer_sides[:, 0]], mesh.points[mesh.outer_sides[:, 1]]
        assert len(mesh.outer_sides) == 12
        # Green: the integral of (x dy - y dx)/2 over the outline is plus the area
        assert 0.5 * np.sum(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]) == pytest.approx(12.0)


def test_new_nodes_join_the_sets_of_their_outer_edge_only():
    mesh = strip(order=2)
    np.testing.assert_allclose(mesh.points[mesh.node_sets["top"], 1], 3.0)
    assert len(mesh.node_sets["top"]) == 9
    two_sided = strip(columns=1)
    both = {"all": np.arange(len(two_sided.points))}
    two_sided = raised(
        Mesh(two_sided.points, two_sided.cells, "quad", two_sided.region, {"a": 7, "b": 9}, both)
    )
    # the edge at y = 2 lies inside although both of its ends are in the set
    middle = np.flatnonzero((two_sided.points == [2.0, 2.0]).all(axis=1))
    assert len(middle) == 1
    assert not np.isin(middle, two_sided.node_sets["all"]).any()
    assert len(two_sided.node_sets["all"]) == 6 + 6


@pytest.mark.parametrize("order", [1, 2])
def test_thickness_of_a_flat_layer_is_its_height(order):
    mesh = strip(order=order)
    nodes = np.append(mesh.node_sets["top"], mesh.node_sets["bottom"])
    thickness = layer_thickness(mesh, "layer", nodes)
    half = len(nodes) // 2
    np.testing.assert_allclose(thickness[:half], 1.0, rtol=1e-13)
    np.testing.assert_allclose(thickness[half:], 2.0, rtol=1e-13)


@pytest.mark.parametrize("kind", ["triangle", "triangle6"])
def test_equilateral_triangle_has_scaled_jacobian_one(kind):
    assert scaled_jacobian(triangle(kind))[0] == pytest.approx(1.0, rel=1e-12)
    # right angle with two equal sides: sin 45 / sin 60
    right = triangle(kind, apex=(0.0, 1.0))
    assert scaled_jacobian(right)[0] == pytest.approx(np.sqrt(0.5) / np.sqrt(0.75), rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_scaled_jacobian_of_a_parallelogram_is_the_sine_of_its_angle(order):
    angle = np.radians(25.0)
    points = np.array(
        [[0.0, 0.0], [3.0, 0.0], [3.0 + np.cos(angle), np.sin(angle)], [np.cos(angle), np.sin(angle)]]
    )
    mesh = Mesh(points, np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, int), {"skin": 0})
    mesh = raised(mesh) if order == 2 else mesh
    assert scaled_jacobian(mesh)[0] == pytest.approx(np.sin(angle), rel=1e-12)
    flipped = Mesh(points * [1.0, -1.0], np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, int), {"skin": 0})
    assert scaled_jacobian(flipped)[0] == pytest.approx(-np.sin(angle), rel=1e-12)


def test_scaled_jacobian_sees_a_mid_node_beyond_the_quarter_point():
    # x(s) = s + d (1 - s^2) folds where 1 - 2 d s <= 0: at s = 1 for d >= 1/2
    for shift, sign in ((0.45, 1.0), (0.55, -1.0)):
        mesh = strip(columns=1, order=2)
        points = mesh.points.copy()
        points[mesh.cells[0, 4], 0] += 2.0 * shift  # half width 2
        moved = Mesh(points, mesh.cells, mesh.kind, mesh.region, mesh.region_names)
        assert np.sign(scaled_jacobian(moved)[0]) == sign


@pytest.mark.parametrize("kind", ["quad", "quad9", "triangle", "triangle6"])
def test_a_point_lies_in_the_cell_around_it(kind):
    from matplotlib.path import Path

    rng = np.random.default_rng(0)
    mesh = strip(order=1)
    if kind.startswith("triangle"):
        cells = np.concatenate([mesh.cells[:, [0, 1, 2]], mesh.cells[:, [0, 2, 3]]])
        mesh = replace(mesh, cells=cells, kind="triangle", region=np.zeros(len(cells), int))
    mesh = mesh if kind in ("quad", "triangle") else raised(mesh)
    mesh = replace(mesh, points=mesh.points + rng.uniform(-0.15, 0.15, mesh.points.shape))  # slants, bends
    around = [cell[: mesh.corners] for cell in mesh.cells]
    if mesh.order == 2:
        m = mesh.corners
        around = [np.column_stack([cell[:m], cell[m : 2 * m]]).ravel() for cell in mesh.cells]
    points = rng.uniform([-0.5, -0.5], [4.5, 3.5], (500, 2))
    inside = np.array([Path(mesh.points[nodes]).contains_points(points) for nodes in around])
    assert inside.sum(axis=0).max() == 1
    np.testing.assert_array_equal(
        mesh.cells_at(points), np.where(inside.any(axis=0), inside.argmax(axis=0), -1)
    )
    np.testing.assert_array_equal(mesh.cells_at(mesh.centres), np.arange(len(mesh.cells)))


def test_the_middle_of_a_bent_triangle_is_that_of_its_coordinates():
    bent = raised(triangle())
    points = bent.points.copy()
    points[bent.cells[0, 3]] += [0.0, -0.3]  # N_3 = 4 r s is 4/9 in the middle
    moved = replace(bent, points=points).centres - bent.centres
    np.testing.assert_allclose(moved, [[0.0, -0.3 * 4.0 / 9.0]], atol=1e-15)


def test_a_point_on_an_edge_lies_in_one_of_its_cells():
    mesh = strip(columns=6, order=2)
    found = mesh.cells_at([[2.0, 1.0], [2.0, 2.0], [1.9, 2.0], [9.0, 9.0]])
    assert (found[:3] >= 0).all()
    assert found[3] == -1
    with pytest.raises(InputError, match=r"points: given shape \(2,\) in 2 dimensions; allowed: \(k, 2\)"):
        mesh.cells_at([1.0, 2.0])

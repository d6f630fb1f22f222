"""Hexahedra: faces with their normals outwards, what raising them adds, and sets of nodes."""

from dataclasses import replace

import meshio
import numpy as np
import pytest
from numpy.testing import assert_allclose
from tools.refusals import refuses
from tools.solids import SIDES, block

import evfem as ev
from evfem.mesh import file as meshfile
from evfem.mesh.faces import layer_thickness
from evfem.mesh.hexahedron import EDGES, FACES, MIRRORED, PLACES
from evfem.mesh.mesh import Mesh, raised
from evfem.mesh.quality import check


def test_outer_faces_of_a_block():
    """As many as its sides have, each on its side, areas and normals of the sides."""
    for mesh in (block((2, 3, 4), jitter=0.2), raised(block((2, 3, 4), jitter=0.2))):
        assert len(mesh.outer_sides) == 2 * (6 + 8 + 12)
        assert len(mesh.sides[0]) == (3 * 12 + 4 * 8 + 5 * 6)
        for k, name in enumerate(SIDES):
            corner = mesh.points[mesh.sides_of(name)[:, :4]]
            area = 0.5 * np.cross(corner[:, 2] - corner[:, 0], corner[:, 3] - corner[:, 1]).sum(axis=0)
            np.testing.assert_allclose(area, np.eye(3)[k // 2] * (1 if k % 2 else -1), atol=1e-15)


def test_raised_hexahedra():
    """Each node once, new ones halfway, sets grow by what their outer faces have."""
    mesh = block((2, 2, 1), jitter=0.2)
    mesh.node_sets["corner"] = np.array([0])
    solid = raised(mesh)
    assert solid.kind == "hexahedron27"
    assert len(solid.points) == 5 * 5 * 3
    assert len(np.unique(np.round(solid.points, 9), axis=0)) == len(solid.points)
    x = solid.points[solid.cells]
    np.testing.assert_allclose(x[:, 8:20], x[:, EDGES].mean(axis=2))
    np.testing.assert_allclose(x[:, 20:26], x[:, FACES].mean(axis=2))
    np.testing.assert_allclose(x[:, 26], x[:, :8].mean(axis=1))
    assert solid.node_sets["corner"].tolist() == [0]
    low = np.flatnonzero(solid.points[:, 1] == 0.0)
    np.testing.assert_array_equal(solid.node_sets["bottom"], low)
    assert raised(solid) is solid


def solid(order=1, divisions=(2, 2, 2), split=True):
    """A block of two materials with pad and bone, 2 mm wide."""
    upper = (lambda x, y, z: y > 1.0) if split else None
    mesh = block(divisions, (2.0, 2.0, 2.0), jitter=0.2, split=upper)
    sets = {"pad": mesh.node_sets["bottom"], "bone": mesh.node_sets["top"]}
    mesh = replace(mesh, node_sets=sets)
    return raised(mesh) if order == 2 else mesh


@pytest.mark.parametrize("ending", [".vtu", ".msh"])
@pytest.mark.parametrize("order", [1, 2])
def test_files_bring_back_what_was_written(order, ending, tmp_path):
    """Points, cells, names and sets; quadratic cells are untangled by the order of their nodes."""
    mesh = solid(order)
    meshfile.write(mesh, tmp_path / f"solid{ending}")
    read = meshfile.read(tmp_path / f"solid{ending}")
    np.testing.assert_allclose(read.points, mesh.points, atol=1e-14)
    np.testing.assert_array_equal(read.cells, mesh.cells)
    assert read.kind == mesh.kind
    assert set(read.region_names) == set(mesh.region_names)
    for name in mesh.region_names:
        np.testing.assert_array_equal(read.cells_of(name), mesh.cells_of(name))
    for name, nodes in mesh.node_sets.items():
        np.testing.assert_array_equal(read.node_sets[name], nodes)


def test_fingertips_pass_their_own_checks(tmp_path):
    for ridges, order in (("none", 2), ("along", 1)):
        mesh = ev.Fingertip(ridges=ridges, resolution="coarse").mesh(order)
        assert check(mesh).cells is mesh.cells
    meshfile.write(ev.Fingertip(ridges="none", resolution="coarse").mesh(), tmp_path / "tip.vtu")
    finger = ev.MeshedFinger(tmp_path / "tip.vtu", ev.Fingertip().materials)
    assert finger.mesh(2).kind == "hexahedron27"
    refuses("hex27p1 on hexahedra", finger.mesh, 1)


def test_cells_with_twenty_nodes_are_refused_with_the_reason(tmp_path):
    mesh = solid(2, (1, 1, 1), split=False)
    meshio.Mesh(mesh.points, [("hexahedron20", mesh.cells[:, :20])]).write(tmp_path / "serendipity.vtu")
    refuses("a pressure pulls at the corners", meshfile.read, tmp_path / "serendipity.vtu")


def test_mixtures_and_tetrahedra_are_refused(tmp_path):
    mesh = solid(1, (2, 1, 1), split=False)
    tetra = [("hexahedron", mesh.cells[:1]), ("tetra", mesh.cells[1:, [0, 1, 3, 4]])]
    for blocks in (tetra, tetra[1:]):
        meshio.Mesh(mesh.points, blocks).write(tmp_path / "mixed.vtu")
        refuses(r"one kind: .*hexahedron27", meshfile.read, tmp_path / "mixed.vtu")


def test_left_handed_cells_are_turned():
    for order in (1, 2):
        mesh = solid(order)
        turned = check(replace(mesh, cells=mesh.cells[:, MIRRORED[: mesh.cells.shape[1]]]))
        np.testing.assert_array_equal(turned.cells, mesh.cells)


def changed_cells(mesh, cell, nodes):
    cells = mesh.cells.copy()
    cells[cell] = nodes
    return replace(mesh, cells=cells)


def hanging():
    """A wide cell above two narrow ones that do not share its face; two more beside them join all."""
    spans = [((0, 1), (0, 1)), ((1, 2), (0, 1)), ((2, 3), (0, 1)), ((2, 3), (1, 2)), ((0, 2), (1, 2))]
    share = (PLACES[:8] + 1) // 2
    corners = np.array([[(x[i], y[j], k) for i, j, k in share] for x, y in spans], dtype=float)
    points, number = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    sets = {"pad": np.flatnonzero(points[:, 1] == 0.0), "bone": np.flatnonzero(points[:, 1] == 2.0)}
    cells, region = number.reshape(-1, 8), np.zeros(5, dtype=int)
    return Mesh(points, cells, "hexahedron", region, {"tissue": 0}, sets)


def loose_middle():
    """A mid-node that one of its cells has as another node in nearly the same place."""
    mesh = solid(2)
    inner = np.setdiff1d(mesh.cells[:, 8:20], mesh.outer_sides)[0]
    cell = np.flatnonzero((mesh.cells == inner).any(axis=1))[0]
    nodes = np.where(mesh.cells[cell] == inner, len(mesh.points), mesh.cells[cell])
    mesh = replace(mesh, points=np.vstack([mesh.points, mesh.points[inner] + 1e-3]))
    return changed_cells(mesh, cell, nodes)


def moved(node, by):
    mesh = solid()
    mesh.points[node] += by
    return mesh


def with_sets(**sets):
    mesh = solid()
    return replace(mesh, node_sets={**mesh.node_sets, **sets})


FAULTY = {
    "tangled cells": lambda: moved(13, [0.7, 0.7, 0.7]),
    "on the face of nodes": hanging,
    "different mid-nodes": loose_middle,
    "without a face": lambda: with_sets(pad=np.array([0, 1])),
    "a bone of 2 nodes": lambda: with_sets(bone=np.array([6, 7])),
}


@pytest.mark.parametrize("said", list(FAULTY))
def test_faults_have_a_sentence(said):
    assert refuses(said, check, FAULTY[said]()).key == "finger.mesh"


def test_a_pad_is_reduced_to_whole_faces():
    mesh = with_sets(pad=np.append(solid().node_sets["pad"], 26))
    np.testing.assert_array_equal(check(mesh).node_sets["pad"], solid().node_sets["pad"])


def test_sets_of_single_nodes_have_no_place_in_msh(tmp_path):
    refuses("no outer face of the set", meshfile.write, with_sets(tip=np.array([0])), tmp_path / "solid.msh")


@pytest.mark.vtk
def test_vtk_reads_the_cells_as_they_are_meant(tmp_path):
    """Positive volumes that add up, of linear and quadratic cells."""
    import pyvista

    for order in (1, 2):
        meshfile.write(solid(order), tmp_path / "solid.vtu")
        volumes = pyvista.read(tmp_path / "solid.vtu").compute_cell_sizes()["Volume"]
        assert volumes.min() > 0.0
        assert volumes.sum() == pytest.approx(8.0, rel=1e-6)


def shell(order):
    """A cap between spheres of 5 and 4 mm around the origin, the outer half millimetre its skin."""
    mesh = block((6, 4, 6), split=lambda x, y, z: y < 0.5)
    mesh = raised(mesh) if order == 2 else mesh
    p, r, q = mesh.points.T
    way = np.column_stack([p - 0.5, np.full_like(p, -2.0), q - 0.5])
    radius = 5.0 - r
    points = radius[:, None] * way / np.linalg.norm(way, axis=1)[:, None]
    return replace(mesh, points=points)


@pytest.mark.parametrize(("order", "error"), [(1, 4e-3), (2, 2e-5)])
def test_a_spherical_skin_is_as_thick_as_the_radii_differ(order, error):
    mesh = shell(order)
    nodes = mesh.node_sets["bottom"]
    inner = nodes[(np.abs(mesh.points[nodes][:, ::2]) < 0.8).all(axis=1)]
    assert_allclose(layer_thickness(mesh, "upper", inner), 0.5, atol=error)


def test_a_region_that_is_not_there_or_alone_is_refused():
    mesh = block((1, 1, 1))
    refuses('region: given "bone"', layer_thickness, mesh, "bone", np.array([0]))
    refuses("another one below", layer_thickness, mesh, "lower", np.array([0]))

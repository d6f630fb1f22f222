"""Hexahedra: faces with their normals outwards, what raising them adds, and sets of nodes."""

import numpy as np
from tools.solids import SIDES, block

from evfem.mesh.hexahedron import EDGES, FACES, MIRRORED, PLACES, face_nodes
from evfem.mesh.mesh import raised


def test_middles_lie_between_their_corners():
    for places, corners in ((PLACES[8:20], EDGES), (PLACES[20:26], FACES)):
        np.testing.assert_array_equal(places, PLACES[corners].mean(axis=1))
    assert len({tuple(place) for place in PLACES.tolist()}) == 27
    # VTK's order of the faces: -x, +x, -y, +y, -z, +z
    assert [tuple(place) for place in PLACES[20:26].tolist()] == [
        (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1)
    ]  # fmt: skip


def test_faces_are_seen_from_outside():
    """The normal of each face, from its corners' order, is the place of its middle; middles of its
    edges follow its corners.
    """
    x = PLACES[face_nodes(2)]
    normal = np.cross(x[:, 1] - x[:, 0], x[:, 3] - x[:, 0]) // 4
    np.testing.assert_array_equal(normal, PLACES[20:26])
    np.testing.assert_array_equal(x[:, 4:8], (x[:, :4] + np.roll(x[:, :4], -1, axis=1)) / 2)
    np.testing.assert_array_equal(face_nodes(1), face_nodes(2)[:, :4])


def test_mirrored_cells_turn_the_other_way_round():
    swapped = PLACES[MIRRORED][:, ::-1]
    np.testing.assert_array_equal(swapped, PLACES)


def test_outer_faces_of_a_block():
    """As many as its sides have, each on its side, areas and normals of the sides."""
    for mesh in (block((2, 3, 4), jitter=0.2), raised(block((2, 3, 4), jitter=0.2))):
        assert len(mesh.outer_faces) == 2 * (6 + 8 + 12)
        assert len(mesh.faces[0]) == (3 * 12 + 4 * 8 + 5 * 6)
        for k, name in enumerate(SIDES):
            corner = mesh.points[mesh.faces_of(name)[:, :4]]
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

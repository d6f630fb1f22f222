"""The outline that faces the surface: tributary lengths, contact widths and frames by hand."""

import numpy as np
import pytest
from tools.meshes import block

from evfem.errors import InputError
from evfem.mesh.mesh import Mesh, raised
from evfem.surface.pad import Pad, _near, fold, make_pad, reach, surface_state
from evfem.surface.surfaces import Sinusoid

CHAIN = np.array([[0, 1], [1, 2], [2, 3]])


def pad_of(edges):
    nodes = np.arange(np.max(edges) + 1)
    return Pad(nodes, np.array(edges), np.ones(nodes.size, dtype=bool))


def square(kind="quad"):
    points = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    names = {"tissue": 0}
    sets = {"pad": np.arange(4), "bone": np.array([3])}
    mesh = Mesh(points, np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, dtype=int), names, sets)
    return mesh if kind == "quad" else raised(mesh)


def test_linear_edges_give_half_of_their_projection_to_each_end():
    assert pad_of(CHAIN).length(np.array([0.0, 1.0, 3.0, 7.0])).tolist() == [0.5, 1.5, 3.0, 2.0]


def test_edges_that_face_up_carry_nothing():
    # the outline turns back at node 2: its last edge lies above itself, facing up
    assert pad_of(CHAIN).length(np.array([0.0, 1.0, 3.0, 2.5])).tolist() == [0.5, 1.5, 1.0, 0.0]


def test_quadratic_edges_share_one_four_one():
    pad = pad_of([[0, 1, 2], [1, 3, 4]])
    # the place of the middle nodes does not matter; 6 mm and 3 mm of projection
    length = pad.length(np.array([0.0, 6.0, 2.9, 9.0, 7.6]))
    np.testing.assert_allclose(length, [1.0, 1.5, 4.0, 0.5, 2.0], rtol=1e-15)


@pytest.mark.parametrize("kind", ["quad", "quad9"])
def test_only_the_lower_side_of_a_square_faces_down(kind):
    mesh = square(kind)
    pad = make_pad(mesh)
    length = pad.length(mesh.points[pad.nodes, 0])
    low = mesh.points[pad.nodes, 1] == 0.0
    assert length[~low].tolist() == [0.0] * int((~low).sum())
    assert length.sum() == pytest.approx(2.0, rel=1e-15)


def test_nodes_on_the_bone_are_not_free_but_carry_length():
    mesh = square()
    pad = make_pad(mesh)
    assert pad.nodes.tolist() == [0, 1, 2, 3]
    assert pad.free.tolist() == [True, True, True, False]


@pytest.mark.parametrize("sets", [{}, {"pad": np.array([0, 2])}])
def test_a_mesh_without_a_pad_edge_is_refused(sets):
    mesh = block(2, 2)
    with pytest.raises(InputError, match="pad"):
        make_pad(Mesh(mesh.points, mesh.cells, "quad", mesh.region, mesh.region_names, sets))


@pytest.mark.parametrize("edges", [CHAIN, [[0, 1, 2], [1, 3, 4]]], ids=["linear", "quadratic"])
def test_gradient_of_the_lengths_by_central_differences(edges):
    pad = pad_of(edges)
    x = np.array([0.0, 3.1, 1.2, 2.7, 5.0])[: pad.nodes.size]
    of, moved, value = pad.tributary_gradient(np.column_stack([x, x]))
    gradient = np.zeros((pad.nodes.size, pad.nodes.size))
    np.add.at(gradient, (of, moved // 2), value)
    h = 1e-4
    for i, unit in enumerate(np.eye(pad.nodes.size)):
        difference = (pad.length(x + h * unit) - pad.length(x - h * unit)) / (2 * h)
        np.testing.assert_allclose(gradient[:, i], difference, atol=1e-11)
    # the reversed edge must be among them, or the test would not see it
    assert (x[pad.edges[:, 1]] < x[pad.edges[:, 0]]).any()


def widths(edges, x, reach):
    return pad_of(edges).contact_widths(np.column_stack([x, 0.0 * x]), np.array(reach))


def test_contact_ends_between_the_nodes():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    assert widths(CHAIN, x, [-1.0, -1.0, -2.0, -1.0]) == (0.0, 0.0)
    # whole to the pad's left end; half way to node 2, less a fourth of the distance
    np.testing.assert_allclose(widths(CHAIN, x, [1.0, 1.0, -1.0, -1.0]), 1.25)
    # a node alone: Hertz's half width where next to nothing presses it, (r / pi g)^(1/2) each way
    np.testing.assert_allclose(
        widths(CHAIN, x, [-3.0, 1e-3, -3.0, -1.0]), 2.0 * np.sqrt(1e-3 / (3.0 * np.pi)), rtol=0.01
    )
    # first and last node: the open part between counts for the overall width alone
    np.testing.assert_allclose(widths(CHAIN, x, [1.0, -1.0, -1.0, 1.0]), (3.0, 0.75))


def test_contact_widths_on_quadratic_edges_see_every_node():
    linear, quadratic = [[k, k + 1] for k in range(4)], [[0, 2, 1], [2, 4, 3]]
    x, reach = np.arange(5.0), [-0.1, 0.3, 0.2, -0.4, -1.0]
    np.testing.assert_allclose(widths(quadratic, x, reach), widths(linear, x, reach))


@pytest.mark.parametrize("node", range(4))
def test_widths_pass_continuously_where_a_node_begins_to_touch(node):
    reach = np.array([-0.2, 0.5, 0.4, -0.3])
    ends = []
    for tiny in (1e-12, -1e-12):
        reach[node] = tiny
        ends.append(widths(CHAIN, np.array([0.0, 1.0, 2.1, 3.0]), reach)[1])
    np.testing.assert_allclose(*ends, atol=1e-10)


def test_reach_is_by_pressure_inside_and_by_the_gap_outside():
    found = reach(np.array([0.0, 0.2, -1e-9]), np.array([0.5, 0.0, 0.0]), 0.1 * np.ones(3), 0.05 * np.ones(3))
    np.testing.assert_allclose(found, [0.5, -0.2, 0.0])


def test_a_touching_node_that_faces_up_has_no_width():
    assert widths(CHAIN, np.array([0.0, 1.0, 3.0, 2.5]), [-1.0, -1.0, -1.0, 1.0]) == (0.0, 0.0)


def test_frame_on_a_sinusoid_by_hand():
    # h = 0.2 sin(3 x) at x = 0: slope 0.6, no curvature; at 3 x = pi/2: crest, curvature -0.2 * 9
    surface = Sinusoid(terms=[[0.2, 3.0, 0.0]], y=1.0)
    found = surface_state(surface, np.array([[0.0, 1.5], [np.pi / 6, 1.5]]))
    np.testing.assert_allclose(found.gap, [0.5, 0.3], rtol=1e-14)
    np.testing.assert_allclose(found.slope[:, 0], [0.6, 0.0], atol=1e-15)
    np.testing.assert_allclose(found.curvature[:, 0, 0], [0.0, -1.8], atol=1e-14)
    np.testing.assert_allclose(found.stretch, [np.sqrt(1.36), 1.0], rtol=1e-15)


def test_the_normal_gap_is_the_distance_along_the_normal_to_first_order():
    surface = Sinusoid(y=0.0)
    x = np.linspace(0.0, 1.0, 40)
    rest = []
    for gap in (1e-3, 1e-4):
        position = np.column_stack([x, surface.height(x) + gap])
        found = surface_state(surface, position)
        normal = np.column_stack([-found.slope[:, 0], np.ones_like(x)]) / found.stretch[:, None]
        foot = position - found.normal_gap[:, None] * normal
        # a tenth of the gap leaves a hundredth of the error
        rest.append(np.abs(foot[:, 1] - surface.height(foot[:, 0])).max())
    assert rest[1] < 0.0105 * rest[0]


LINE = np.column_stack([np.arange(6.0), np.zeros(6)])


@pytest.mark.parametrize("seed", range(12))
def test_segments_near_each_other_are_those_whose_boxes_overlap(seed):
    """All pairs against all, in order; on whole numbers many boxes touch."""
    random = np.random.default_rng(seed)
    line = np.cumsum(random.normal(size=(random.integers(2, 60), 2)), axis=0)
    line = np.round(line) if seed % 2 else line
    begin, end = line[:-1], line[1:]
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    expected = [
        (a, b)
        for a in range(len(begin))
        for b in range(a + 1, len(begin))
        if (low[a] <= high[b]).all() and (low[b] <= high[a]).all()
    ]
    assert list(zip(*(one.tolist() for one in _near(begin, end)), strict=True)) == expected


def folded(position, touching=(), edges=None):
    """Where a chain of nodes crosses itself that lay along x before; which of them touch."""
    segments = pad_of([[k, k + 1] for k in range(len(position) - 1)] if edges is None else edges).segments
    on = np.isin(np.arange(len(position)), touching)
    return fold(np.asarray(position, dtype=float), segments, on, np.ones(len(segments), dtype=bool))


def test_an_outline_may_bend_and_overhang_but_not_cross_itself():
    overhang = LINE.copy()
    overhang[2:, 1] += 1.0
    overhang[2:, 0] -= 1.5  # from (1, 0) back to (0.5, 1) and on above itself
    assert folded(LINE) is None
    assert folded(overhang) is None
    # a Z whose last stroke comes down through the first
    crossed = overhang.copy()
    crossed[3] = [0.4, -1.0]
    assert folded(crossed) == pytest.approx(0.45, rel=1e-12)


def test_a_stroke_beyond_the_end_of_another_crosses_nothing():
    """The last one comes down through the line of the first, but behind its end, far from it or near."""
    overhang = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.5, 1.0], [3.0, 1.0], [3.0, -2.0]]
    assert folded(overhang) is None
    near = [[0.0, 0.0], [2.0, 1.0], [3.0, -1.0], [4.0, -1.0], [4.0, 2.0], [1.9, 1.2], [2.6, 0.9]]
    assert folded(near) is None


def test_neighbours_that_touch_must_not_change_places():
    """On the surface itself a fold crosses nothing: there the order tells."""
    swapped = LINE.copy()
    swapped[[2, 3], 0] = swapped[[3, 2], 0]
    assert folded(swapped) is None
    assert folded(swapped, touching=[2]) is None
    assert folded(swapped, touching=[2, 3]) == 3.0


def test_what_did_not_face_down_before_is_not_asked():
    crossed = np.array([[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [1.5, -0.5], [3.0, 0.0]])
    segments = pad_of([[k, k + 1] for k in range(4)]).segments
    apart = np.zeros(5, dtype=bool)
    assert fold(crossed, segments, apart, np.array([True, True, True, True])) == 1.25
    assert fold(crossed, segments, apart, np.array([True, False, True, True])) is None


def test_the_middle_of_a_quadratic_edge_lies_between_its_ends():
    assert pad_of([[0, 2, 1], [2, 4, 3]]).segments.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]

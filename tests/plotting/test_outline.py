"""Fields of the pad on its outline: each node has its share of the edges, arrows are the tractions
on the finger.
"""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.quiver import Quiver
from tools.fakes import bar_of, fake_result
from tools.meshes import KINDS

from evfem.plotting import deformed
from evfem.plotting.figures import STATUS


def outline_of(ax):
    """The coloured outline is the first collection of lines, the borders are the second."""
    return next(c for c in ax.collections if type(c) is LineCollection)


def arrows_of(ax):
    (quiver,) = [c for c in ax.collections if isinstance(c, Quiver)]
    return quiver.XY, np.column_stack([quiver.U, quiver.V])


def pad_of(result):
    pad = result.mesh.node_sets["pad"]
    return pad, (result.mesh.points + result.frames[-1].displacement)[pad]


@pytest.mark.parametrize("kind", KINDS)
def test_each_node_colours_half_of_the_edges_beside_it(kind):
    result = fake_result(kind)
    lines = outline_of(deformed(result, "gap"))
    pad, place = pad_of(result)
    gap = result.frames[-1].gap[pad]
    length = np.zeros(len(pad))
    for path, value in zip(lines.get_paths(), lines.get_array(), strict=True):
        start, end = path.vertices
        nearest = np.argmin(np.minimum(*(np.linalg.norm(place - p, axis=1) for p in (start, end))))
        assert value == gap[nearest]
        length[nearest] += np.linalg.norm(end - start)
    half = 0.5 * np.linalg.norm(np.diff(place, axis=0), axis=1)
    np.testing.assert_allclose(length, np.concatenate([[0.0], half]) + np.concatenate([half, [0.0]]))


def test_statuses_have_their_colours_and_names():
    result = fake_result("quad9")
    ax = deformed(result, "contact_status")
    lines = outline_of(ax)
    lines.update_scalarmappable()
    pad, _ = pad_of(result)
    assert set(lines.get_array()) == set(result.frames[-1].contact_status[pad]) == {0, 2}
    colours = {0: to_rgba(STATUS["open"]), 2: to_rgba(STATUS["slip"])}
    for value, colour in zip(lines.get_array(), lines.get_colors(), strict=True):
        assert tuple(colour) == colours[value]
    assert [text.get_text() for text in bar_of(ax).get_yticklabels()] == ["open", "stick", "slip"]


def test_no_traction_has_no_colour():
    result = fake_result("quad9")
    frame = result.frames[-1]
    frame.contact_pressure[frame.contact_status == 0] = 0.0
    drawn = outline_of(deformed(result, "contact_pressure")).get_array()
    assert drawn.min() > 0.0
    assert drawn.max() == frame.contact_pressure.max()


def test_pressure_pushes_up_and_ends_on_the_surface():
    result = fake_result("quad9")
    frame = result.frames[-1]
    frame.gap[np.isfinite(frame.gap)] = 0.0  # the surface is the outline itself
    at, arrows = arrows_of(deformed(result, "contact_pressure"))
    pad, place = pad_of(result)
    pressure = frame.contact_pressure[pad]
    assert len(at) == np.count_nonzero(pressure)
    np.testing.assert_allclose(at, place[pressure > 0.0], atol=1e-12)
    assert np.all(arrows[:, 1] > 0.0)
    length = np.linalg.norm(arrows, axis=1)
    np.testing.assert_allclose(length / length.max(), pressure[pressure > 0.0] / pressure.max())


def test_pressure_acts_along_the_normal_of_a_slope():
    """On y = x / 2 arrows point along (-1, 2), shear along (2, 1)."""
    result = fake_result("quad9")
    frame = result.frames[-1]
    pad, place = pad_of(result)
    frame.gap[pad] = place[:, 1] - 0.5 * place[:, 0]
    _, pressing = arrows_of(deformed(result, "contact_pressure"))
    np.testing.assert_allclose(pressing[:, 0] / pressing[:, 1], -0.5)
    _, shearing = arrows_of(deformed(result, "shear_traction"))
    np.testing.assert_allclose(shearing[:, 1] / shearing[:, 0], 0.5)
    assert np.all(shearing[:, 0] > 0.0)
    frame.shear_traction[:] *= -1.0
    assert np.all(arrows_of(deformed(result, "shear_traction"))[1][:, 0] < 0.0)


def test_attraction_pulls_down_from_the_outline():
    result = fake_result("quad9")
    at, arrows = arrows_of(deformed(result, "electrostatic_traction"))
    np.testing.assert_array_equal(at, pad_of(result)[1])
    assert np.all(arrows[:, 0] == 0.0)
    assert np.all(arrows[:, 1] < 0.0)


def test_of_many_nodes_those_with_the_largest_traction_have_an_arrow():
    result = fake_result("quad9")
    pad, place = pad_of(result)
    pressure = result.frames[-1].contact_pressure[pad]
    wide = deformed(result, "contact_pressure", near=(-20.0, 20.0, -5.0, 5.0))
    at, _ = arrows_of(wide)
    assert len(at) < np.count_nonzero(pressure)
    assert place[np.argmax(pressure), 0] in at[:, 0]


def test_gap_and_status_have_no_arrows():
    for field in ("gap", "contact_status"):
        drawn = deformed(fake_result("quad9"), field).collections
        assert not [c for c in drawn if isinstance(c, Quiver)]

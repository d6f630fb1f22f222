"""The footprint shows what the result says of the skin, where it says it."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from tools.domes import Dome, dome, dome_scene
from tools.fakes import bar_of, fake_result
from tools.refusals import refuses

import evfem as ev
from evfem.plotting import animate, contact_area, contact_pressure, deformed, figures, footprint, forces
from evfem.plotting.fields import values_of
from evfem.plotting.footprint import fans
from evfem.simulation.run import simulate
from evfem.surface.skin import make_skin


@pytest.fixture(scope="module")
def result():
    shape = dome((7, 2, 6), (4.0, 2.0, 3.0), radius=3.0)
    motion = [ev.Press(indentation=0.15, steps=1), ev.Slide(0.2, steps=2, angle=60.0)]
    return simulate(dome_scene(*motion, finger=Dome(shape)))


def place_of(result):
    skin = make_skin(result.mesh)
    return skin, (result.mesh.points + result.frames[-1].displacement)[skin.nodes]


def test_smooth_colours_are_the_nodes_values_at_their_x_and_z(result):
    ax = footprint(result, "gap")
    skin, place = place_of(result)
    mesh = next(one for one in ax.collections if type(one).__name__ == "TriMesh")
    drawn = np.column_stack([mesh._triangulation.x, mesh._triangulation.y, mesh.get_array()])
    nodes = np.column_stack([place[:, ::2], result.frames[-1].gap[skin.nodes]])
    assert_allclose(cKDTree(drawn).query(nodes)[0], 0.0, atol=1e-12)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "z (mm)")
    assert ax.get_xlim()[0] < place[:, 0].min() < place[:, 0].max() < ax.get_xlim()[1]


def test_tractions_leave_the_untouched_skin_without_colour(result, monkeypatch):
    monkeypatch.setattr(figures, "FINEST", 1)
    mesh = next(c for c in footprint(result).collections if type(c).__name__ == "TriMesh")
    skin, _ = place_of(result)
    pressing = mesh.get_array()[mesh._triangulation.triangles]
    assert 0 < len(pressing) < 2 * len(skin.faces)
    assert (pressing != 0.0).any(axis=1).all()


def test_statuses_fill_the_shares_of_the_nodes_with_their_colour(result):
    ax = footprint(result, "contact_status", near="contact")
    shares = [c for c in ax.collections if isinstance(c, PolyCollection)][-1]
    skin, place = place_of(result)
    corners = np.array([path.vertices[:4] for path in shares.get_paths()])
    x, z = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs((x * np.roll(z, -1, axis=1) - z * np.roll(x, -1, axis=1)).sum(axis=1))
    status = values_of(result.frames[-1], "contact_status")[skin.nodes]
    touching = skin.tributary(place)[status > 0].sum()
    assert_allclose(area[shares.get_array() > 0].sum(), touching, rtol=0.02)
    assert_allclose(area.sum(), skin.tributary(place).sum(), rtol=1e-6)


def contour_of(ax):
    """Vertices (n, 2) of the contour of contact, if there is one."""
    found = [one for one in ax.collections if one.get_label() == "contour of contact"]
    return np.concatenate([path.vertices for one in found for path in one.get_paths()] or [np.zeros((0, 2))])


def test_a_line_is_the_contour_of_contact(result):
    """Each of its vertices is halfway between a node that touches and one that does not; one colour scale
    of a caller's serves panels side by side, with the field and its unit beside it.
    """
    skin, place = place_of(result)
    triangles = fans(skin.faces)
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    touching = result.frames[-1].contact_status[skin.nodes] > 0
    pairs = pairs[touching[pairs[:, 0]] != touching[pairs[:, 1]]]
    halfway = place[pairs].mean(axis=1)[:, ::2]
    ax = footprint(result, vmin=0.0, vmax=0.5)
    for drawn in (contour_of(ax), contour_of(footprint(result, "gap"))):
        assert len(drawn) > 8
        assert_allclose(cKDTree(halfway).query(drawn)[0], 0.0, atol=1e-9)
    mesh = next(one for one in ax.collections if type(one).__name__ == "TriMesh")
    assert mesh.get_clim() == (0.0, 0.5)
    assert bar_of(ax).get_ylabel() == "contact pressure (kPa)"
    assert not len(contour_of(footprint(result, "contact_status")))
    frame = replace(result.frames[-1], contact_status=0 * result.frames[-1].contact_status)
    assert not len(contour_of(footprint(replace(result, frames=[frame]))))


def test_shear_is_a_magnitude_and_has_colours_from_zero(result):
    bar = bar_of(footprint(result, "shear_traction"))
    assert bar.get_ylim()[0] == 0.0
    assert "shear traction (kPa)" in (bar.get_ylabel(), bar.get_xlabel())


def test_a_close_up_is_around_what_touches_or_is_nearest(result):
    close, whole = (footprint(result, near=near).get_xlim() for near in ("contact", None))
    assert whole[0] < close[0] < close[1] < whole[1]
    assert footprint(result, near=(-1.0, 1.0, -0.5, 0.5)).get_ylim() == (-0.5, 0.5)
    hover = simulate(dome_scene(ev.Hover(gap=0.3)))
    assert abs(sum(footprint(hover, "gap", near="contact").get_xlim())) < 0.1
    assert len(footprint(hover).collections) > 0  # nothing presses


def test_labels_of_a_narrow_window_stay_in_the_picture(result):
    figure = footprint(result, near=(-0.33, 0.33, -0.5, 0.5)).figure
    figure.savefig(io.BytesIO())
    assert figure.get_tightbbox().x0 > 0.0


def test_other_fields_fingers_and_pictures_are_refused(result, tmp_path):
    refuses("field", footprint, result, "von_mises")
    refuses("near", footprint, result, near="everything")
    refuses("plane finger", footprint, fake_result())
    refuses("three dimensions", contact_pressure, result)
    refuses("footprint", deformed, result, near="contact")
    refuses("field", animate, result, tmp_path / "stress.gif", "von_mises")


def test_curves_have_newtons_and_square_millimetres(result, tmp_path):
    assert "(N)" in forces(result).get_ylabel()
    assert contact_area(result).get_ylabel() == "area (mm²)"
    path = animate(result, tmp_path / "slide.gif", "contact_pressure", near="contact", progress=False)
    assert path.stat().st_size > 1000


def test_the_title_says_how_far_along_the_finger_it_is(result):
    """A slide of 0.2 mm at 60 degrees ends at x 0.1 and z 0.1732 mm."""
    for draw in (footprint, deformed):
        assert (
            draw(result)
            .get_title()
            .replace("\n", " ")
            .startswith("step 3: position 0.1 mm, z 0.1732 mm, load")
        )
    assert ", z " not in footprint(result, frame=0).get_title()  # the press

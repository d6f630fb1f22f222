"""A solid finger is drawn where it is, as it is deformed, with the colours of what the result says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree
from tools.domes import Dome, dome, dome_scene
from tools.fakes import bar_of

import evfem as ev
from evfem.plotting import FIELDS, deformed, figures
from evfem.plotting.meshes import EYE, cut_open
from evfem.simulation.run import simulate


@pytest.fixture(scope="module", params=["hex8", "hex27p1"])
def result(request):
    shape = dome((5, 2, 4), (4.0, 2.0, 3.0), radius=3.0)
    press, solver = ev.Press(indentation=0.15, steps=1), ev.Solver(element=request.param)
    return simulate(dome_scene(press, finger=Dome(shape), solver=solver))


def drawn(result, field, **options):
    """Places of corners (n, 2) and their values (n,)."""
    mesh = next(c for c in deformed(result, field, **options).collections if type(c).__name__ == "TriMesh")
    return np.column_stack([mesh._triangulation.x, mesh._triangulation.y]), mesh.get_array()


def projected(points):
    """Points (n, 3) seen along the eye's line, by Gram and Schmidt: y is up in the picture."""
    towards = EYE / np.linalg.norm(EYE)
    up = np.array([0.0, 1.0, 0.0]) - towards[1] * towards
    up /= np.linalg.norm(up)
    return np.column_stack([points @ np.cross(up, towards), points @ up])


def seen_nodes(result):
    return np.unique(cut_open(result.mesh)[0][:, :4])


def test_displacements_are_drawn_at_the_moved_nodes(result, monkeypatch):
    monkeypatch.setattr(figures, "FINEST", 1)
    places, values = drawn(result, "displacement")
    nodes, moved = seen_nodes(result), result.frames[-1].displacement
    known = np.column_stack([projected(result.mesh.points + moved), np.linalg.norm(moved, axis=1)])
    distance, _ = cKDTree(known[nodes]).query(np.column_stack([places, values]))
    assert_allclose(distance, 0.0, atol=1e-12)
    assert len(np.unique(places.round(9), axis=0)) > 0.3 * len(nodes)


def test_stress_is_the_mean_of_the_cells_around_a_node(result, monkeypatch):
    """Of a field that is one number in a region it is that number, on both sides of a border; in a region
    with the values of two layers it is these and, between the layers, their mean.
    """
    monkeypatch.setattr(figures, "FINEST", 1)
    x, y, _ = result.mesh.points[result.mesh.cells].mean(axis=1).T
    sides = replace(result.mesh, region=(x > 0.5).astype(int), region_names={"left": 0, "right": 1})
    frame = replace(result.frames[-1], von_mises=2.0 + (x > 0.5))
    _, values = drawn(replace(result, mesh=sides, frames=(frame,)), "von_mises")
    assert set(values.round(12)) == {2.0, 3.0}
    layers = replace(frame, von_mises=1.0 + 2.0 * (y > np.median(y)))
    for smooth, wanted in ((True, {1.0, 2.0, 3.0}), (False, {1.0, 3.0})):
        _, values = drawn(replace(result, frames=(layers,)), "von_mises", smooth=smooth)
        assert set(values.round(12)) == wanted


@pytest.mark.parametrize("field", FIELDS)
def test_every_field_has_its_picture_and_labels_stay_in_it(result, field):
    ax = deformed(result, field)
    ax.figure.draw_without_rendering()
    box, (width, height) = ax.figure.get_tightbbox(), ax.figure.get_size_inches()
    assert min(box.x0, box.y0, width - box.x1, height - box.y1) > 0.0
    label = bar_of(ax).get_ylabel()
    assert label.endswith((" (kPa)", " (MPa)", " (mm)")) or field in ("J", "contact_status")


def test_the_contour_of_contact_is_between_nodes_that_touch_and_others(result):
    frame = result.frames[-1]
    (line,) = (c for c in deformed(result).collections if c.get_label() == "contour of contact")
    faces = cut_open(result.mesh)[0][:, :4]
    pairs = np.concatenate([faces[:, [i, j]] for i in range(4) for j in range(i)])
    pairs = pairs[(frame.contact_status[pairs] > 0).sum(axis=1) == 1]
    halfway = projected(result.mesh.points + frame.displacement)[pairs].mean(axis=1)
    drawn = np.concatenate([path.vertices for path in line.get_paths()])
    assert len(drawn) > 2
    assert_allclose(cKDTree(halfway).query(drawn)[0], 0.0, atol=1e-9)


def test_skin_that_nothing_touches_has_no_colour(result, monkeypatch):
    monkeypatch.setattr(figures, "FINEST", 1)
    _, values = drawn(result, "contact_pressure")
    assert 0 < len(values) < len(drawn(result, "displacement")[1])
    assert values.max() == pytest.approx(
        result.frames[-1].contact_pressure[seen_nodes(result)].max(), rel=1e-12
    )

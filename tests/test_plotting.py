"""Pictures hold the numbers of the result, say their units, and leave matplotlib's state alone."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from tools.fakes import fake_result
from tools.meshes import KINDS, square_mesh

from evfem.errors import InputError
from evfem.plotting import FIELDS, contact_pressure, deformed, forces, regions


def lines_of(ax):
    return {line.get_label(): line for line in ax.get_lines()}


def test_forces_are_drawn_over_the_step_when_a_press_precedes_the_slide():
    result = fake_result()
    ax = forces(result)
    lines = lines_of(ax)
    np.testing.assert_array_equal(lines["normal (contact)"].get_ydata(), result.normal_force)
    np.testing.assert_array_equal(lines["normal (contact)"].get_xdata(), result.step)
    np.testing.assert_array_equal(lines["electrostatic"].get_ydata(), result.electrostatic_force)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("step", "force per depth (N/mm)")
    assert [text.get_text() for text in ax.texts] == ["press", "slide"]


def test_forces_are_drawn_over_what_is_asked_for():
    result = fake_result()
    ax = forces(result, over="position")
    np.testing.assert_array_equal(lines_of(ax)["tangential (contact)"].get_xdata(), result.position)
    assert ax.get_xlabel() == "position of the bone (mm)"
    with pytest.raises(InputError, match="position"):
        forces(result, over="normal_force")


def test_forces_that_are_zero_are_left_out():
    result = fake_result()
    result.electrostatic_force[:] = 0.0
    assert "electrostatic" not in lines_of(forces(result))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("field", FIELDS)
def test_every_field_is_drawn_on_every_kind_of_cell(field, kind):
    result = fake_result(kind)
    ax = deformed(result, field)
    ax.figure.canvas.draw()
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "y (mm)")
    assert len(ax.figure.axes) == 2
    assert "(" in ax.figure.axes[1].get_ylabel()


@pytest.mark.parametrize("kind", KINDS)
def test_cells_are_drawn_where_they_moved_with_their_values(kind):
    result = fake_result(kind)
    (cells,) = [c for c in deformed(result, "cauchy_stress_xy", 0).collections if type(c) is PolyCollection]
    np.testing.assert_array_equal(cells.get_array(), result.frames[0].cauchy_stress[:, 3])
    points = result.mesh.points + result.frames[0].displacement
    drawn = np.vstack([path.vertices for path in cells.get_paths()])
    corner = result.mesh.cells[-1, 0]
    assert np.any(np.all(np.isclose(drawn, points[corner]), axis=1))
    assert abs(area(cells) - 4.0) < 0.5  # the square of 2 x 2 mm, deformed by 4 %


def area(cells):
    """Sum of the polygon areas by the shoelace formula, positive only if nodes go round
    counter-clockwise.
    """
    total = 0.0
    for path in cells.get_paths():
        x, y = path.vertices.T
        total += 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return total


@pytest.mark.parametrize("kind", KINDS)
def test_borders_are_the_outline_and_the_line_between_regions(kind):
    result = fake_result(kind)
    result.frames[0].displacement[:] = 0.0
    (borders,) = [c for c in deformed(result, "J", 0).collections if type(c) is LineCollection]
    lengths = [np.linalg.norm(np.diff(path.vertices, axis=0), axis=1).sum() for path in borders.get_paths()]
    assert sum(lengths) == pytest.approx(8.0 + 2.0)  # mm of outline and between the regions
    assert len(lengths) == 4 * 2 + 2
    nodes = 3 if kind in ("quad9", "triangle6") else 2
    assert {len(path.vertices) for path in borders.get_paths()} == {nodes}


def test_nodal_fields_interpolate_the_nodal_values():
    result = fake_result("quad9")
    ax = deformed(result, "contact_pressure")
    triangles = ax.collections[0]
    np.testing.assert_array_equal(triangles.get_array(), result.frames[-1].contact_pressure)


@pytest.mark.parametrize("kind", KINDS)
def test_regions_have_their_cells_and_names(kind):
    mesh = replace(square_mesh(kind), region_names={"soft_tissue": 0, "hard": 1})
    ax = regions(mesh)
    ax.figure.canvas.draw()
    soft, hard = ax.collections
    assert [c.get_label() for c in (soft, hard)] == ["soft tissue", "hard"]
    # the lower half of the square and the upper one
    for drawn, low in ((soft, 0.0), (hard, 1.0)):
        corners = np.concatenate([path.vertices for path in drawn.get_paths()])
        assert len(drawn.get_paths()) == len(mesh.cells) // 2
        assert (corners[:, 1].min(), corners[:, 1].max()) == (low, low + 1.0)
    assert not np.array_equal(soft.get_facecolor(), hard.get_facecolor())


def test_contact_pressure_is_drawn_along_the_current_x_of_the_pad():
    result = fake_result("quad9")
    ax = contact_pressure(result, 0)
    lines = lines_of(ax)
    frame = result.frames[0]
    pad = result.mesh.node_sets["pad"]
    x = result.mesh.points[pad, 0] + frame.displacement[pad, 0]
    np.testing.assert_array_equal(lines["contact pressure"].get_xdata(), x)
    np.testing.assert_array_equal(lines["contact pressure"].get_ydata(), frame.contact_pressure[pad])
    assert set(lines) == {"contact pressure", "shear traction", "electrostatic traction"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "traction (MPa)")


def test_unknown_fields_and_frames_get_a_sentence():
    with pytest.raises(InputError, match="von_mises"):
        deformed(fake_result(), "stress")
    with pytest.raises(InputError, match="2 frames kept"):
        deformed(fake_result(), frame=2)
    with pytest.raises(InputError, match="2 frames kept"):
        contact_pressure(fake_result(), frame=-3)


def test_axes_that_are_given_are_used(tmp_path):
    from matplotlib.figure import Figure

    figure = Figure()
    left, right = figure.subplots(1, 2)
    assert forces(fake_result(), ax=left) is left
    assert contact_pressure(fake_result(), ax=right) is right
    figure.savefig(tmp_path / "both.png")


def test_matplotlib_is_loaded_only_when_something_is_drawn_and_pyplot_never(tmp_path):
    code = (
        "import sys, evfem.plotting as p; assert 'matplotlib' not in sys.modules\n"
        "from tools.fakes import fake_result; p.forces(fake_result()).figure.savefig('f.png')\n"
        "assert 'matplotlib' in sys.modules and 'matplotlib.pyplot' not in sys.modules"
    )
    command = [sys.executable, "-c", f"import sys; sys.path[:0] = {sys.path!r}\n{code}"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_total_is_drawn_in_newtons():
    result = fake_result(provenance={"scene": {"name": "fake", "total_steps": 4, "depth": 10.0}})
    labels = [forces(r).get_ylabel() for r in (result, result.total)]
    assert labels == ["force per depth (N/mm)", "force (N)"]
    (line,) = (line for line in forces(result.total).lines if line.get_label().startswith("normal"))
    np.testing.assert_array_equal(line.get_ydata(), 10.0 * result.normal_force)

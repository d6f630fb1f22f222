"""The deformed finger: what is drawn is what the result says, where it says it."""

import io
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from tools.fakes import bar_of, fake_result, lines_of
from tools.meshes import KINDS, square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.plotting import FIELDS, contact_pressure, deformed, figures, regions, side_by_side
from evfem.plotting.fields import TRACTIONS, patches, scale_of
from evfem.scene.file import dump
from evfem.simulation.model import placed

WINDOW = (-0.5, 0.7, -0.1, 0.4)


def current(result, frame=-1):
    return result.mesh.points + result.frames[frame].displacement


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("field", FIELDS)
def test_every_field_is_drawn_on_every_kind_of_cell(field, kind):
    ax = deformed(fake_result(kind), field)
    assert ax.get_aspect() == 1.0
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "y (mm)")
    label = bar_of(ax).get_ylabel()
    units = (" (kPa)" if field in TRACTIONS else " (MPa)", " (mm)")
    assert label.endswith(units) or field in ("J", "contact_status")
    assert label.split()[0].lower() in (field.split("_")[0].lower(), "volume")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("near", [None, "contact"])
def test_no_label_leaves_the_picture_and_the_bar_is_as_high_as_the_finger(kind, near):
    for field in ("cauchy_stress_xy", "electrostatic_traction", "contact_status"):
        ax = deformed(fake_result(kind), field, near=near)
        figure = ax.figure
        figure.draw_without_rendering()
        box, (width, height) = figure.get_tightbbox(), figure.get_size_inches()
        assert min(box.x0, box.y0, width - box.x1, height - box.y1) > 0.0
        finger, bar = ax.get_position(), bar_of(ax).get_position()
        assert (bar.y0, bar.y1) == pytest.approx((finger.y0, finger.y1), abs=1e-6)
        assert bar.x0 > finger.x1


@pytest.mark.parametrize("kind", KINDS)
def test_flat_cells_are_drawn_where_they_moved_with_their_values(kind):
    result = fake_result(kind)
    ax = deformed(result, "cauchy_stress_xy", 0, smooth=False)
    (cells,) = [c for c in ax.collections if type(c) is PolyCollection]
    np.testing.assert_array_equal(cells.get_array(), result.frames[0].cauchy_stress[:, 3])
    drawn = np.vstack([path.vertices for path in cells.get_paths()])
    corner = result.mesh.cells[-1, 0]
    assert np.any(np.all(np.isclose(drawn, current(result, 0)[corner]), axis=1))
    assert abs(area(cells) - 4.0) < 0.5  # the square of 2 x 2 mm, deformed by 4 %


def area(cells):
    """Sum of the polygon areas by the shoelace formula, positive only if nodes go round counter-clockwise."""
    total = 0.0
    for path in cells.get_paths():
        x, y = path.vertices.T
        total += 0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))
    return total


def test_a_flat_nodal_field_is_the_mean_of_each_cell():
    result = fake_result("quad")
    ax = deformed(result, "displacement", smooth=False)
    size = np.hypot(*result.frames[-1].displacement.T)
    means = [size[cell].mean() for cell in result.mesh.cells]
    np.testing.assert_allclose(ax.collections[0].get_array(), means)


@pytest.fixture
def undivided(monkeypatch):
    monkeypatch.setattr(figures, "FINEST", 1)


def test_large_triangles_of_smooth_colours_are_drawn_in_parts():
    """A linear field stays linear, on the same area: no colour is mixed from those of far corners."""
    points, corners = (
        np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]]),
        np.array([[0, 1, 2], [1, 3, 2]]),
    )
    drawn = figures.shaded(figures.new_figure().subplots(), points, corners, points @ [3.0, -1.0] + 0.5)
    mesh, values = drawn._triangulation, drawn.get_array()
    assert len(mesh.triangles) == 2 * figures.FINEST**2
    np.testing.assert_allclose(values, 3.0 * mesh.x - mesh.y + 0.5)
    x, y = mesh.x[mesh.triangles], mesh.y[mesh.triangles]
    twice = (x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])
    np.testing.assert_allclose(np.abs(twice), 4.0 / figures.FINEST**2)
    assert np.ptp(values[mesh.triangles], axis=1).max() < 1.01 * np.ptp(values) / figures.FINEST


@pytest.mark.parametrize("kind", KINDS)
def test_smooth_colours_are_averages_by_area_within_each_region(kind, undivided):
    """By hand, node by node: the cells of the same region around it, weighted by their areas."""
    result = fake_result(kind)
    mesh, frame = result.mesh, result.frames[-1]
    drawn = deformed(result, "von_mises").collections[0]
    ring = list(range(mesh.corners))
    if mesh.order == 2:
        ring = [n for i in ring for n in (i, mesh.corners + i)]
    size = []
    for cell in mesh.cells[:, ring]:
        x, y = current(result)[cell].T
        size.append(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    wanted = {}
    for region in (0, 1):
        for node in range(len(mesh.points)):
            around = [e for e, c in enumerate(mesh.cells) if node in c and mesh.region[e] == region]
            if around:
                weight = [size[e] for e in around]
                wanted[node, region] = np.average(frame.von_mises[around], weights=weight)
    pieces = patches(mesh)
    region = np.zeros(len(pieces.nodes), dtype=int)
    region[pieces.mesh.cells[mesh.region == 1]] = 1
    assert len(wanted) == len(pieces.nodes)
    keys = zip(pieces.nodes.tolist(), region.tolist(), strict=True)
    values = np.array([wanted[key] for key in keys])
    np.testing.assert_allclose(drawn.get_array(), values[pieces.triangles].ravel())


@pytest.mark.parametrize("kind", KINDS)
def test_triangles_cover_the_cells_once(kind):
    """Their areas, each positive, add up to that of the square of 2 x 2 mm."""
    mesh = square_mesh(kind)
    pieces = patches(mesh)
    a, b, c = (mesh.points[pieces.nodes[pieces.triangles[:, i]]] for i in range(3))
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert areas.min() > 0.0
    assert areas.sum() == pytest.approx(4.0)


@pytest.mark.parametrize("kind", KINDS)
def test_smooth_nodal_fields_are_the_nodal_values(kind, undivided):
    result = fake_result(kind)
    drawn = deformed(result, "displacement").collections[0]
    pieces = patches(result.mesh)
    corners = pieces.nodes[pieces.triangles].ravel()
    np.testing.assert_array_equal(drawn.get_array(), np.hypot(*result.frames[-1].displacement.T)[corners])


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


def test_the_scale_spans_what_is_shown():
    result = fake_result("quad9")
    frame = result.frames[-1]
    middles = current(result)[result.mesh.cells].mean(axis=1)
    window = (-2.0, 2.0, middles[:, 1].min() - 0.1, middles[:, 1].mean())
    lower = frame.von_mises[middles[:, 1] < window[3]]
    assert len(lower) == len(middles) // 2
    assert deformed(result).collections[0].get_clim() == (0.0, frame.von_mises.max())
    ax = deformed(result, near=window)
    assert ax.collections[0].get_clim() == (0.0, lower.max())
    assert (*ax.get_xlim(), *ax.get_ylim()) == window
    ax = deformed(result, near=window, vmin=0.1, vmax=0.2)
    assert ax.collections[0].get_clim() == (0.1, 0.2)
    assert ax.collections[0].colorbar.extend == "both"
    pressed = deformed(result, "gap", near=(-0.6, 0.6, -1.0, 3.0)).collections[1]
    inside = np.abs(current(result)[:, 0]) < 0.6
    assert pressed.get_clim() == (0.0, np.nanmax(frame.gap[inside]))


def test_a_field_with_a_sign_has_white_in_the_middle():
    values = np.array([-0.4, 0.1])
    assert scale_of("cauchy_stress_yy", values).low == -0.4
    assert scale_of("cauchy_stress_yy", values).high == 0.4
    wished = scale_of("cauchy_stress_yy", values, vmax=0.2)
    assert (wished.low, wished.high, wished.extend) == (-0.2, 0.2, "min")
    ratio = scale_of("J", np.array([0.98, 1.01]))
    assert (ratio.low + ratio.high) / 2.0 == pytest.approx(1.0)
    assert ratio.colour_map()(0.5)[:3] == pytest.approx((0.97, 0.97, 0.97), abs=0.01)


def test_one_value_throughout_has_a_scale_too():
    for field in ("von_mises", "cauchy_stress_xx", "displacement"):
        scale = scale_of(field, np.zeros(3))
        assert scale.low < scale.high
    assert scale_of("von_mises", np.zeros(0)).low == 0.0
    beyond = scale_of("von_mises", np.array([3.0]), vmin=5.0)
    assert (beyond.low, beyond.high, beyond.extend) == (5.0, 6.0, "min")


def with_scene(result, surface):
    """The result of a scene with that surface, as far as its provenance says."""
    scene = ev.Scene(ev.FingerPad(), surface, motion=ev.Press(force=0.1))
    return replace(result, provenance=result.provenance | {"parameters": dump(scene)})


def test_small_stresses_are_said_in_kPa_and_their_colours_stay_those_of_MPa():
    result = fake_result()
    ax = deformed(result, "contact_pressure", vmax=0.02)
    bar = bar_of(ax)
    assert bar.get_ylabel() == "contact pressure (kPa)"
    assert bar.get_ylim() == (0.0, 0.02)
    ax.figure.draw_without_rendering()
    said = [float(text.get_text()) for text in bar.get_yticklabels()]
    np.testing.assert_allclose(said, 1000.0 * bar.get_yticks())
    assert bar_of(deformed(result, "von_mises", vmin=0.0, vmax=3.0)).get_ylabel() == "von Mises stress (MPa)"


def test_the_surface_is_that_of_the_scene_where_it_touches_at_first():
    surface = ev.Sinusoid(friction=0.1)
    result = with_scene(fake_result("quad9"), surface)
    there, _ = placed(surface, result.mesh.points[result.mesh.node_sets["pad"]])
    (line,) = deformed(result, near=WINDOW).get_lines()
    x, y = line.get_data()
    assert (x[0], x[-1]) == WINDOW[:2]
    np.testing.assert_allclose(y, there.y + surface.height(x))


def test_a_surface_that_no_file_says_is_known_from_the_gaps():
    result = fake_result("quad9")
    pad = result.mesh.node_sets["pad"]
    nodes = current(result)[pad]
    (line,) = deformed(result).get_lines()
    found = np.interp(nodes[:, 0], *line.get_data())
    np.testing.assert_allclose(found, nodes[:, 1] - result.frames[-1].gap[pad], atol=1e-4)


def test_a_close_up_shows_all_that_touches():
    result = fake_result("quad9")
    touching = current(result)[result.frames[-1].contact_status > 0]
    for field in ("von_mises", "contact_pressure"):
        ax = deformed(result, field, near="contact")
        (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
        assert left < touching[:, 0].min() < touching[:, 0].max() < right
        assert bottom < touching[:, 1].min() <= touching[:, 1].max() < top
        assert right - left == pytest.approx(1.2 * np.ptp(touching[:, 0]))


def test_a_close_up_of_a_hovering_finger_shows_its_smallest_gap():
    result = fake_result("quad9")
    result.frames[-1].contact_status[:] = 0
    result.frames[-1].gap[:] += 0.2
    lowest = current(result)[np.nanargmin(result.frames[-1].gap)]
    ax = deformed(result, near="contact")
    assert np.mean(ax.get_xlim()) == pytest.approx(lowest[0])
    assert ax.get_ylim()[0] < lowest[1] - 0.2 < lowest[1] < ax.get_ylim()[1]


def test_the_title_says_where_the_finger_is():
    result = fake_result()
    title = deformed(result).get_title()
    assert title.startswith(f"step 4: position {result.position[3]:.4g} mm, ")
    assert f"load {result.applied_force[3]:.3g} N/mm" in title
    assert title.endswith(f"{result.voltage[3]:.4g} V")
    result.voltage[:] = 0.0
    assert not deformed(result).get_title().endswith("V")


def test_results_beside_each_other_have_one_scale():
    soft = fake_result("quad9")
    hard = fake_result("quad9")
    hard.frames[-1].von_mises[:] *= 2.0
    panels = side_by_side({"soft": soft, "hard": hard})
    assert [ax.get_title() for ax in panels[:2]] == ["soft", "hard"]
    assert len(panels) == 4
    mapped = [ax.collections[0] for ax in panels]
    assert {one.get_clim() for one in mapped} == {(0.0, hard.frames[-1].von_mises.max())}
    np.testing.assert_allclose(mapped[1].get_array(), 2.0 * mapped[0].get_array())
    assert panels[2].get_xlim() == deformed(soft, near="contact").get_xlim()
    assert len(panels.figure.axes) == 5
    moved = replace(soft.frames[-1], displacement=np.add(soft.frames[-1].displacement, [0.5, 0.0]))
    panels = side_by_side({"soft": soft, "moved": replace(soft, frames=(moved,))})
    for near, row in ((None, panels[:2]), ("contact", panels[2:])):  # both in the window around both
        (left, right), again = (ax.get_xlim() for ax in row)
        alone = deformed(soft, near=near).get_xlim()
        assert (left, right) == again == pytest.approx((alone[0], alone[1] + 0.5))
    assert len(side_by_side({"soft": soft, "hard": hard}, near=None)) == 2


def test_frames_of_a_result_stand_beside_each_other_on_one_scale():
    result = fake_result()
    first, last = result.frames[0].step, result.frames[-1].step
    result.frames[0].von_mises[:] *= 3.0
    panels = side_by_side(result, "von_mises", [0, -1])
    assert [ax.get_title() for ax in panels[:2]] == [f"step {first}", f"step {last}"]
    assert {ax.collections[0].get_clim() for ax in panels} == {(0.0, result.frames[0].von_mises.max())}
    both = side_by_side({"one": result, "two": result}, "von_mises", [0, -1], near=None)
    assert [ax.get_title().split(",")[0] for ax in both] == ["one", "one", "two", "two"]


@pytest.mark.parametrize("field", ["contact_pressure", "shear_traction", "electrostatic_traction"])
def test_arrows_of_panels_side_by_side_are_as_long_for_as_large_a_traction(field):
    """A finger with twice the tractions and less room below its surface has arrows twice as long."""
    result = fake_result()
    frame = result.frames[-1]
    twice = replace(frame, **{field: 2.0 * getattr(frame, field)}, gap=frame.gap + 0.1)
    both, window = {"one": result, "two": replace(result, frames=(twice,))}, (-0.9, 0.9, -0.5, 0.3)
    panels = side_by_side(both, field, near=window)
    longest = []
    for ax in panels[2:]:
        (arrows,) = [one for one in ax.collections if isinstance(one, Quiver)]
        longest.append(np.hypot(arrows.U, arrows.V).max() / np.ptp(ax.get_xlim()))
    assert longest[1] == pytest.approx(2.0 * longest[0], rel=1e-9)


def test_titles_are_no_wider_than_what_they_are_above():
    result = fake_result()
    long = replace(result, voltage=np.full(4, 1234.0))
    figure = Figure(figsize=(4.0, 3.0), layout="constrained")
    for ax in figure.subplots(1, 2):
        deformed(long, ax=ax)
        figure.draw_without_rendering()
        title, axes = ax.title.get_window_extent(), ax.get_window_extent()
        assert title.width <= 1.1 * axes.width + 1.0
        assert ax.get_title().replace("\n", " ").startswith("step 4: position ")
    wide = deformed(long)
    assert "\n" not in wide.get_title()


@pytest.mark.parametrize("kind", KINDS)
def test_regions_have_their_cells_and_names(kind):
    mesh = replace(square_mesh(kind), region_names={"soft_tissue": 0, "hard": 1})
    ax = regions(mesh)
    ax.figure.savefig(io.BytesIO())
    soft, hard = ax.collections
    assert [c.get_label() for c in (soft, hard)] == ["soft tissue", "hard"]
    # the lower half of the square and the upper one
    for drawn, low in ((soft, 0.0), (hard, 1.0)):
        corners = np.concatenate([path.vertices for path in drawn.get_paths()])
        assert len(drawn.get_paths()) == len(mesh.cells) // 2
        assert (corners[:, 1].min(), corners[:, 1].max()) == (low, low + 1.0)
    assert not np.array_equal(soft.get_facecolor(), hard.get_facecolor())


def test_ten_regions_are_told_apart():
    mesh = square_mesh("quad")
    names = {f"layer {i}": i for i in range(10)}
    many = replace(mesh, region=np.arange(len(mesh.cells)), region_names=names)
    drawn = [c for c in regions(many).collections if type(c) is PolyCollection]
    colours = np.array([c.get_facecolor()[0, :3] for c in drawn if len(c.get_facecolor())])
    apart = np.linalg.norm(colours[:, None] - colours, axis=2) + np.eye(len(colours))
    assert len(colours) == 10
    assert apart.min() > 0.1


def test_regions_stay_within_their_figure():
    """Labels and legend beside axes in true proportions are not cut off."""
    ax = regions(ev.FingerPad(resolution="coarse").mesh())
    figure = ax.figure
    figure.draw_without_rendering()
    box = figure.get_tightbbox()
    assert box.x0 >= 0.0
    assert box.y0 >= 0.0
    assert box.x1 <= figure.get_figwidth()
    assert box.y1 <= figure.get_figheight()


def test_contact_pressure_is_drawn_along_the_current_x_of_the_pad():
    result = fake_result("quad9")
    ax = contact_pressure(result, 0)
    lines = lines_of(ax)
    frame = result.frames[0]
    pad = result.mesh.node_sets["pad"]
    x = result.mesh.points[pad, 0] + frame.displacement[pad, 0]
    np.testing.assert_array_equal(lines["contact pressure"].get_xdata(), x)
    np.testing.assert_allclose(lines["contact pressure"].get_ydata(), 1000.0 * frame.contact_pressure[pad])
    assert set(lines) == {"contact pressure", "shear traction", "electrostatic traction"}
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "traction (kPa)")


def test_unknown_fields_frames_and_windows_get_a_sentence():
    result = fake_result()
    refuses("von_mises", deformed, result, "stress")
    refuses("2 frames kept", deformed, result, frame=2)
    refuses("2 frames kept", contact_pressure, result, frame=-3)
    for near in ("touch", (1.0, 0.0, 0.0, 1.0), (0.0, 1.0), (0.0, np.inf, 0.0, 1.0), 3.0):
        refuses(r"near: .*contact, or a window", deformed, result, near=near)
    with pytest.raises(ev.InputError, match=r"vmin: given 2\.0; allowed: a value below vmax, which is 1"):
        deformed(result, vmin=2.0, vmax=1.0)
    refuses("results: given nothing", side_by_side, {})


def test_probes_are_marked_where_they_are_and_only_in_the_window():
    law = ev.NeoHookean(E=0.1, nu=0.4)
    body = ev.MeshedFinger(square_mesh("quad9"), {"soft": law, "hard": law})
    output = ev.Output(probes={"merkel": [[0.1, 0.3], [0.4, 0.3]], "deep": ev.Probe(x=[0.0], depth=1.5)})
    result = ev.simulate(
        ev.Scene(body, ev.Flat(y=0.0), motion=[ev.Press(indentation=0.2, steps=2)], output=output)
    )
    for frame, top, names in ((0, 2.0, ["merkel", "deep"]), (1, 0.9, ["merkel"])):
        ax = deformed(result, frame=frame, near=(-1.0, 1.0, 0.0, top))
        marks = [line.get_xydata()[0] for line in ax.get_lines() if line.get_marker() == "o"]
        probes = [result.probes[name] for name in names]
        moved = np.concatenate([probe.position + probe.displacement[frame] for probe in probes])
        np.testing.assert_allclose(marks, moved)
        assert [text.get_text() for text in ax.texts] == names

"""Curves hold the numbers of the result and say their units."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure
from tools.domes import dome_scene
from tools.fakes import fake_result, fake_row, lines_of
from tools.meshes import square_mesh
from tools.refusals import refuses

from evfem import (
    TOUCHSCREEN,
    Carrier,
    Display,
    Drive,
    FingerPad,
    Hover,
    Scene,
    Sine,
    Slide,
    Square,
    StrongTroxel,
    VoltageProfile,
    Wait,
)
from evfem.errors import InputError
from evfem.plotting import (
    compare,
    contact_area,
    deformed,
    energies,
    figures,
    force_indentation,
    forces,
    friction,
    history,
    probes,
    signal,
    spectrum,
)
from evfem.plotting.curves import ENERGIES, abscissa
from evfem.plotting.labels import kind_of
from evfem.scene.motion import Press
from evfem.scene.probes import Probe, columns, histories
from evfem.simulation.result import COLUMNS, Result
from evfem.simulation.run import simulate


def assert_line(line, x, y):
    np.testing.assert_array_equal(line.get_xdata(), x)
    np.testing.assert_array_equal(line.get_ydata(), y)


def run_of(kinds, **columns):
    """A made-up result of motions, some columns given."""
    rows = [fake_row(step + 1) | {"motion": kind} for step, kind in enumerate(kinds)]
    result = Result.from_rows(rows, [], square_mesh(), {})
    return replace(result, **{name: np.array(values) for name, values in columns.items()})


def test_forces_are_drawn_over_the_step_when_a_press_precedes_the_slide():
    result = fake_result()
    ax = forces(result)
    lines = lines_of(ax)
    assert_line(lines["normal (contact)"], result.step, result.normal_force)
    assert_line(lines["electrostatic"], result.step, result.electrostatic_force)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("step", "force per depth (N/mm)")
    assert [text.get_text() for text in ax.texts] == ["press", "slide"]


def test_names_of_short_motions_do_not_run_into_each_other():
    kinds = ["press"] * 3 + ["slide"] * 16 + ["wait"] * 160
    numbers = [0] * 3 + [1] * 16 + [2] * 160
    result = replace(run_of(kinds), motion_index=np.array(numbers))
    ax = forces(result, over="step")
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert [text.get_text() for text in ax.texts] == ["press", "slide", "wait"]
    assert not any(one.overlaps(other) for i, one in enumerate(boxes) for other in boxes[:i])
    assert boxes[0].y0 == boxes[2].y0  # only where it must be is a name in a row of its own


def test_forces_are_drawn_over_what_is_asked_for():
    result = fake_result()
    ax = forces(result, over="position")
    assert_line(lines_of(ax)["tangential (contact)"], result.position, result.tangential_force)
    assert ax.get_xlabel() == "position of the bone (mm)"
    assert not list(ax.texts)
    refuses("position", forces, result, over="normal_force")


def test_forces_that_are_zero_are_left_out():
    result = fake_result()
    result.electrostatic_force[:] = 0.0
    result.tangential_force[:] = 1e-16  # as rounding leaves it
    assert not {"electrostatic", "tangential (contact)"} & set(lines_of(forces(result)))


@pytest.mark.parametrize(
    ("kinds", "columns", "over"),
    [
        (["press"] * 3, {"indentation": [0.1, 0.2, 0.3]}, "indentation"),
        (["press"] * 3, {"indentation": [0.1, 0.3, 0.2]}, "step"),
        (["slide"] * 3, {"position": [0.1, 0.2, 0.3]}, "position"),
        (["slide"] * 3, {"position": [-0.1, -0.2, -0.3]}, "position"),
        (["slide"] * 3, {"position": [0.1, 0.2, 0.1]}, "step"),
        (["press", "slide", "slide"], {"position": [0.0, 0.1, 0.2]}, "position"),
        (["press", "press", "slide"], {"position": [0.0, 0.0, 0.1]}, "step"),
        (["voltage"] * 3, {"voltage": [0.0, 10.0, 20.0]}, "voltage"),
        (["hover"], {}, "step"),
        (["press", "wait", "wait"], {"time": [0.1, 0.2, 0.3], "position": [0.0] * 3}, "time"),
    ],
)
def test_a_run_is_drawn_over_what_its_motions_change(kinds, columns, over):
    result = run_of(kinds, **columns)
    assert abscissa(result) == over
    ax = forces(result)
    assert_line(lines_of(ax)["normal (contact)"], getattr(result, over), result.normal_force)


def test_over_the_time_steps_that_take_none_are_one_moment():
    result = run_of(["press", "press", "wait", "wait"], time=[0.0, 0.0, 0.1, 0.2], position=[0.0] * 4)
    kept = [1, 2, 3]
    assert_line(lines_of(forces(result))["normal (contact)"], result.time[kept], result.normal_force[kept])
    (panel,) = history(result, ["voltage"])
    assert_line(panel.get_lines()[0], result.time[kept], result.voltage[kept])
    drawn = signal(result)[0].get_lines()[0]
    assert_line(drawn, result.time[kept], result.voltage[kept])


def test_energies_are_those_of_the_history():
    result = fake_result()
    ax = energies(result)
    lines = lines_of(ax)
    for name, (label, _, _) in ENERGIES.items():
        assert_line(lines[label], result.step, getattr(result, name))
    assert ax.get_ylabel() == "energy per depth (N)"


def test_a_history_has_a_panel_for_each_kind_of_column():
    result = fake_result()
    columns = ["applied_force", "voltage", "contact_width", "normal_force", "real_contact_width"]
    panels = history(result, columns, over="position")
    assert [list(lines_of(ax)) for ax in panels] == [
        ["applied force", "normal force"],
        ["voltage"],
        ["contact width", "real contact width"],
    ]
    for ax in panels:
        for label, line in lines_of(ax).items():
            assert_line(line, result.position, getattr(result, label.replace(" ", "_")))
    labels = ["force per depth\n(N/mm)", "voltage (V)", "width (mm)"]
    assert [ax.get_ylabel() for ax in panels] == labels
    assert panels[-1].get_xlabel() == "position of the bone (mm)"
    for wrong in ("voltage", [], ["motion"], ["force"]):
        refuses("column", history, result, wrong)


def test_several_results_are_compared_by_name():
    one, two = fake_result(), fake_result(steps=6)
    ax = compare({"one": one, "two": two}, "contact_width", "position")
    assert_line(lines_of(ax)["one"], one.position, one.contact_width)
    assert_line(lines_of(ax)["two"], two.position, two.contact_width)
    assert ax.get_ylabel() == "contact width (mm)"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["one", "two"]
    styles = [(line.get_color(), line.get_linestyle()) for line in ax.get_lines()]
    assert styles[0][0] != styles[1][0]
    assert styles[0][1] != styles[1][1]


def test_force_over_indentation_is_that_of_the_presses():
    result = fake_result()
    ax = force_indentation(result)
    assert_line(ax.get_lines()[0], result.indentation[:2], result.applied_force[:2])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("indentation (mm)", "force per depth (N/mm)")
    assert ax.get_legend() is None
    both = force_indentation({"a": result, "b": fake_result()})
    assert [text.get_text() for text in both.get_legend().get_texts()] == ["a", "b"]
    refuses("a run of slide; allowed: a run with a press", force_indentation, run_of(["slide"]))


def test_contact_over_load_has_both_widths():
    result = fake_result()
    ax = contact_area(result)
    lines = lines_of(ax)
    assert_line(lines["edge to edge"], result.applied_force[:2], result.contact_width[:2])
    assert_line(lines["touching"], result.applied_force[:2], result.real_contact_width[:2])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("applied force (N/mm)", "width (mm)")
    assert "pad, touching" in lines_of(contact_area({"pad": result, "other": result}))


def test_friction_is_the_ratio_on_the_bone_where_there_is_a_load():
    result = fake_result()
    result.applied_force[0] = 0.0
    ax = friction(result, "position")
    ratio = result.applied_tangential_force[1:] / result.applied_force[1:]
    assert_line(ax.get_lines()[0], result.position[1:], ratio)
    assert ax.get_ylabel() == "apparent friction coefficient"
    rows = result.position[1:] >= (start := result.position[2])
    assert_line(
        friction(result, "position", start=start).get_lines()[0], result.position[1:][rows], ratio[rows]
    )


def ran(voltage, *motion):
    pad = FingerPad(ridges=False, resolution="coarse")
    return simulate(Scene(pad, Display(friction=0.3), StrongTroxel(), voltage, motion, roughness_gap=0.005))


def edges(line):
    """Abscissae of vertical edges of a line, and their ends."""
    x, y = line.get_data()
    at = np.flatnonzero((np.diff(x) == 0.0) & (np.diff(y) != 0.0))
    return np.round(x[at], 12).tolist(), [(float(y[i]), float(y[i + 1])) for i in at]


@pytest.mark.filterwarnings("ignore:motion 1 has . steps in a period")
def test_a_square_wave_has_vertical_edges_where_it_flips():
    """0 to 80 V at 50 Hz, flips every 10 ms; steps of 4 ms: the second edge is at the end of a step, the
    others within one.
    """
    wait = Wait(0.04, steps=10)
    result = ran(Square(50.0, amplitude=40.0, bias=40.0), Hover(0.3, steps=1), wait)
    flips = [(80.0, 0.0), (0.0, 80.0), (80.0, 0.0), (0.0, 80.0)]
    for panels in (history(result, ["voltage"], "time"), signal(result, "time")):
        (line,) = panels[0].lines
        assert edges(line) == ([0.01, 0.02, 0.03, 0.04], flips)
    # over the steps an edge is as far within its step as in time
    (line,) = (one for one in history(result, ["voltage"], "step")[0].lines if len(one.get_xdata()) > 2)
    assert edges(line) == ([3.5, 6.0, 8.5, 11.0], flips)
    (force,) = history(result, ["electrostatic_force"], "time")[0].lines
    assert_line(force, result.time, result.electrostatic_force)


@pytest.mark.filterwarnings("ignore:motion 1 has . steps in a period")
def test_a_sine_has_no_edges_and_the_mean_of_a_modulated_carrier_has_those_of_its_envelope():
    wait = Wait(0.02, steps=5)
    result = ran(Sine(50.0, 100.0), Hover(0.3, steps=1), wait)
    assert_line(compare({"a": result}, "voltage", "time").lines[0], result.time, result.voltage)
    carried = Carrier(10e3, Square(50.0, amplitude=50.0, bias=50.0), resolved=False)
    at, ends = edges(signal(ran(carried, Hover(0.3, steps=1), wait), "time")[0].lines[0])
    assert at == [0.01, 0.02]
    assert ends[0] == (pytest.approx(100.0 / 2**0.5), 0.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_profile_that_jumps_has_a_vertical_edge(way):
    profile = VoltageProfile(*np.array([(-0.25, 30.0), (-0.25, 60.0), (0.25, 60.0), (0.25, 90.0)]).T)
    result = ran(profile, Press(indentation=0.1, steps=1), Slide(way * 0.6, steps=6))
    expected = (60.0, 90.0) if way > 0 else (60.0, 30.0)
    assert edges(signal(result, "position")[0].lines[0]) == ([0.25 * way], [expected])


def test_a_signal_stands_above_the_friction_that_it_makes():
    one, two = fake_result(), fake_result(steps=6)
    above, below = signal({"wish": one, "display": two}, over="position")
    assert_line(lines_of(above)["display"], two.position, two.voltage)
    assert_line(lines_of(below)["display"], two.position, two.applied_tangential_force)
    assert_line(lines_of(below)["wish"], one.position, one.applied_tangential_force)
    assert (above.get_ylabel(), below.get_ylabel()) == ("voltage (V)", "friction force (N/mm)")
    assert below.get_xlabel() == "position of the bone (mm)"


def test_forces_that_rounding_leaves_are_no_curve():
    one = fake_result()
    resting = replace(one, applied_tangential_force=1e-15 * one.normal_force)
    _, below = signal(resting)
    assert below.get_ylim()[1] == pytest.approx(np.abs(one.normal_force).max())


def test_a_spectrum_is_that_of_the_waiting_finger_without_its_mean():
    time = np.arange(1, 41) * 0.005  # 0.2 s: lines every 5 Hz up to 100 Hz
    force = 1.0 + 0.25 * np.sin(2.0 * np.pi * 20.0 * time)
    result = run_of(["wait"] * 40, time=time, tangential_force=force)
    result = replace(result, motion_index=np.zeros(40, dtype=int))
    ax = spectrum(result)
    frequency, amplitude = ax.get_lines()[0].get_data()
    np.testing.assert_allclose(frequency, np.arange(1, 21) * 5.0)
    np.testing.assert_allclose(amplitude, np.where(frequency == 20.0, 0.25, 0.0), atol=1e-12)
    labels = ("frequency (Hz)", "amplitude of tangential force (N/mm)")
    assert (ax.get_xlabel(), ax.get_ylabel()) == labels
    both = spectrum({"a": result, "b": result}, "normal_force", stop=0.1)
    assert both.get_lines()[1].get_xdata()[0] == pytest.approx(10.0)


def whole(steps=4):
    """A result of a finger 10 mm deep."""
    return fake_result(steps=steps, provenance={"scene": {"name": "fake", "depth": 10.0}})


def test_a_total_is_drawn_in_newtons_and_square_millimetres():
    result = whole()
    ax = forces(result.total)
    assert_line(lines_of(ax)["normal (contact)"], result.step, 10.0 * result.normal_force)
    assert ax.get_ylabel() == "force (N)"
    assert forces(result).get_ylabel() == "force per depth (N/mm)"
    ax = contact_area(result.total)
    rows = slice(2)
    assert_line(lines_of(ax)["touching"], 10.0 * result.applied_force[rows], result.real_contact_area[rows])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("applied force (N)", "area (mm²)")
    panels = history(result.total, ["contact_width", "stored_energy", "min_gap"])
    labels = ["contact area (mm²)", "stored energy (mJ)", "smallest gap (mm)"]
    assert [ax.get_ylabel() for ax in panels] == labels

    assert energies(result.total).get_ylabel() == "energy (mJ)"
    assert signal(result.total)[1].get_ylabel() == "friction force (N)"
    load = f"load {10.0 * result.applied_force[-1]:.3g} N,"
    assert load in deformed(result.total).get_title()


def test_totals_and_others_are_not_compared():
    result = whole()
    with pytest.raises(InputError, match="some per mm of depth, some in total; allowed: all of them"):
        compare({"a": result, "b": result.total}, "normal_force")
    # a fingertip is a total, and has other units for widths
    tip = simulate(dome_scene(Press(indentation=0.1, steps=1)))
    beside = compare({"a": result.total, "b": tip}, "normal_force")
    assert beside.get_ylabel() == "normal force (N)"
    with pytest.raises(InputError, match="contact_width, which these results do not have in one unit"):
        compare({"a": result.total, "b": tip}, "contact_width")
    both = compare({"a": result.total, "b": result.total}, "normal_force")
    assert both.get_ylabel() == "normal force (N)"


def test_every_column_has_a_kind_and_a_unit():
    """All but counts end in a word that says their unit."""
    counts = {"step", "motion_index", "motion", "substeps", "newton_iterations", "relaxations", "jumps"}
    assert {name for name in COLUMNS if not kind_of(name)[1]} == counts
    assert kind_of("electrostatic_force_x") == kind_of("normal_force") == ("force per depth", "N/mm")


def test_a_line_for_each_point_of_each_probe_over_its_steps():
    numbers = np.random.default_rng(1).normal(size=(4, 3, len(columns(2))))
    wanted = {"merkel": [[0.0, 1.0], [2.0, 3.0]], "deep": Probe(x=[0.0], depth=1.0)}
    result = replace(fake_result(), probes=histories(wanted, 2, numbers))
    ax = probes(result, "cauchy_stress_xy", over="step")
    first, second, deep = ax.get_lines()[:3]  # then lines where motions end
    at = columns(2).index("cauchy_stress_xy")
    for line, point in ((first, 0), (second, 1), (deep, 2)):
        np.testing.assert_array_equal(line.get_ydata(), numbers[:, point, at])
    assert deep.get_label().startswith("deep at (")
    assert deep.get_label().endswith(") mm")
    assert first.get_color() == second.get_color() != deep.get_color()
    assert ax.get_ylabel() == "Cauchy stress xy (MPa)"
    with pytest.raises(InputError, match=r"quantity: given .*allowed: cauchy_stress_xz. .displacement_x"):
        probes(result, "cauchy_stress_xw")
    refuses("a run without probes", probes, fake_result())


@pytest.mark.parametrize(
    "wanted",
    [
        {f"point {i}": [[0.1 * i, 1.0]] for i in range(9)},
        {"all": [[0.1 * i, 1.0] for i in range(9)]},
        {name: [[0.1 * i, 1.0] for i in range(5)] for name in "abcdefghi"},
    ],
)
def test_probes_are_told_apart(wanted):
    """No two curves have the same colour, style and marker; a probe's marks have its colour and marker."""
    count = sum(len(places) for places in wanted.values())
    numbers = np.random.default_rng(2).normal(size=(4, count, len(columns(2))))
    result = replace(fake_result(), probes=histories(wanted, 2, numbers))
    drawn = [line for line in probes(result, over="step").get_lines() if " at (" in line.get_label()]
    looks = {(line.get_color(), line.get_linestyle(), line.get_marker()) for line in drawn}
    assert len(looks) == len(drawn) == count
    marks = {(line.get_color(), line.get_marker()) for line in drawn[:: count // len(wanted)]}
    shown = deformed(result, near=(-9.0, 9.0, -9.0, 9.0)).get_lines()
    assert {
        (line.get_color(), line.get_marker()) for line in shown if line.get_linestyle() == "None"
    } >= marks


def test_a_legend_stands_beside_curves_that_fill_the_panel():
    waves = {f"wave {i}": np.sin(np.linspace(0.0, 60.0, 300) + i) for i in range(5)}
    lines = [(np.arange(300), y, look) for y, look in figures.styled(waves)]
    calm = [(x, 0.0 * y, look) for x, y, look in lines]
    for drawn, beside in ((lines, True), (calm, False)):
        ax = figures.curves(None, drawn, "", "")
        ax.figure.draw_without_rendering()
        legend, panel = ax.get_legend().get_window_extent(), ax.get_window_extent()
        assert (legend.x0 >= panel.x1) == beside
        assert legend.x1 <= ax.figure.bbox.x1


def test_a_history_is_drawn_in_given_axes_and_on_logarithmic_scales():
    result = fake_result()
    figure = Figure()
    left, right = figure.subplots(1, 2)
    panels = history(result, ["normal_force", "voltage"], "step", ax=[left, right], log="y")
    assert (panels[0], panels[1]) == (left, right)
    assert (left.get_xscale(), left.get_yscale(), right.get_yscale()) == ("linear", "log", "log")
    np.testing.assert_array_equal(lines_of(right)["voltage"].get_ydata(), result.voltage)
    assert history(result, ["voltage"], "step", ax=left)[0] is left
    refuses('"", "x", "y" or "xy"', history, result, ["voltage"], log="z")
    refuses("numbers above 0 along x", history, result, ["voltage"], "position", log="x")
    refuses("given 1 axes; allowed: 2", history, result, ["normal_force", "voltage"], ax=left)


def test_small_pressures_of_a_history_are_said_in_kPa():
    result = fake_result()
    small = replace(result, peak_contact_pressure=0.001 * result.step)
    for ax in (history(small, ["peak_contact_pressure"])[0], compare({"a": small}, "peak_contact_pressure")):
        assert ax.get_ylabel().replace("\n", " ") == "peak contact pressure (kPa)"
        np.testing.assert_allclose(ax.get_lines()[0].get_ydata(), small["step"])


def test_no_label_of_a_panel_is_cut_or_reaches_into_the_next():
    result = whole()
    columns = ["applied_tangential_force", "electrostatic_force", "real_contact_width"]
    columns += ["peak_contact_pressure", "viscous_dissipation", "indentation", "electrostatic_work"]
    for name in columns:
        panels = history(result, [name, "voltage"])
        figure = panels.figure
        figure.draw_without_rendering()
        for ax in panels:
            label, axes = ax.yaxis.label.get_window_extent(), ax.get_window_extent()
            assert label.x0 >= 0.0, name
            assert axes.y0 - 2.0 <= label.y0 < label.y1 <= axes.y1 + 2.0, name


def test_a_voltage_that_acts_by_its_mean_is_the_effective_one():
    """150 V of a sine's peak are 106 V in the history."""
    pad, screen = FingerPad(resolution="coarse", ridges=False), Display(insulator=TOUCHSCREEN)
    scene = Scene(pad, screen, StrongTroxel(), Sine(100.0, 150.0), Hover(gap=0.5, steps=1), drive=Drive())
    result = simulate(scene)
    assert result.voltage[0] == pytest.approx(150.0 / np.sqrt(2.0))
    assert signal(result)[0].get_ylabel() == "effective voltage (V)"
    ax = compare({"a": result}, "electrostatic_force", over="voltage")
    assert ax.get_xlabel() == "effective voltage (V)"
    direct = simulate(replace(scene, voltage=100.0, drive=None))
    assert signal(direct)[0].get_ylabel() == "voltage (V)"

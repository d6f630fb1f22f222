"""The table of a sweep: every point where its numbers are."""

import numpy as np
from tools.refusals import refuses

from evfem.plotting import sweep, sweep_histogram, sweep_map, sweep_scatter
from evfem.sweeps.table import SweepResult

GAP, LAW, OUT = "motion.0.gap", "electrostatics.law", "electrostatic_force.last"
GRID = [(gap, law, gap * 10 + (law == "b")) for gap in (0.5, 0.1, 0.3) for law in ("a", "b")]


def table(rows, names=(GAP, LAW, OUT), samples=None):
    columns = ("point", *names, "status", "seconds", "message")
    filled = [
        {"point": i, **dict(zip(names, row, strict=True)), "status": "done"} for i, row in enumerate(rows)
    ]
    return SweepResult(columns, filled, {"samples": samples, "points": {}})


def test_a_line_for_each_value_of_a_column_in_rising_order():
    ax = sweep(table(GRID), GAP, OUT, by=LAW)
    lines = {line.get_label(): line for line in ax.get_lines()}
    assert list(lines) == ["law a", "law b"]
    np.testing.assert_array_equal(lines["law b"].get_xdata(), [0.1, 0.3, 0.5])
    np.testing.assert_array_equal(lines["law b"].get_ydata(), [2.0, 4.0, 6.0])
    assert lines["law b"].get_linestyle() == "--"
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("gap (mm)", "electrostatic force, last (N/mm)")


def test_lines_of_numbers_say_their_unit():
    names = ("surface.friction", "electrostatics.voltage", OUT)
    rows = [(x, v, x * v) for x in (0.1, 0.2) for v in (100.0, 200.0)]
    ax = sweep(table(rows, names), names[0], OUT, by=names[1])
    assert [line.get_label() for line in ax.get_lines()] == ["voltage 100 V", "voltage 200 V"]


def test_names_are_words():
    rows = [(x, law, 1.0) for x in (0.1, 0.2) for law in ("strong_troxel", "kaczmarek")]
    lines = sweep(table(rows), GAP, OUT, by=LAW).get_lines()
    assert [line.get_label() for line in lines] == ["law strong troxel", "law kaczmarek"]
    ticks = sweep(table(rows), LAW, OUT).get_xticklabels()
    assert [text.get_text() for text in ticks] == ["strong troxel", "kaczmarek"]


def test_ticks_of_a_map_are_at_its_few_numbers():
    names = ("motion.0.force", "surface.friction", OUT)
    for count, marked in ((3, True), (20, False)):
        rows = [(0.02 * (1 + i), y, 1.0 * i) for i in range(count) for y in (0.1, 0.3)]
        ax = sweep_map(table(rows, names), names[0], names[1], OUT)
        assert (len(ax.get_xticks()) == count) == marked
        if marked:
            np.testing.assert_allclose(ax.get_xticks(), [0.02, 0.04, 0.06])
            assert [text.get_text() for text in ax.get_xticklabels()] == ["0.02", "0.04", "0.06"]


def test_axes_have_the_units_of_the_sweep():
    names = ("motion.0.force", "contact_width.max", OUT)
    rows = [(x, w, x * w) for x in (0.1, 0.2) for w in (1.0, 2.0)]
    plain = table(rows, names)
    units = {names[0]: "N", names[1]: "mm2", OUT: "N"}
    whole = SweepResult(plain.columns, plain.rows, plain.provenance, units)
    ax = sweep_map(whole, *names)
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("force (N)", "contact area, max (mm²)")
    assert ax.figure.axes[-1].get_ylabel() == "electrostatic force, last (N)"
    lines = sweep(whole, names[1], OUT, by=names[0]).get_lines()
    assert [line.get_label() for line in lines] == ["force 0.1 N", "force 0.2 N"]


def test_what_is_varied_beside_and_samples_are_points_without_a_line():
    for found, count in ((table(GRID), 6), (table(GRID[:2], samples={"count": 2}), 2)):
        (line,) = sweep(found, GAP, OUT).get_lines()
        assert (line.get_linestyle(), line.get_marker(), len(line.get_xdata())) == ("None", "o", count)


def test_names_stand_in_the_order_of_the_table():
    ax = sweep(table(GRID[:2]), LAW, OUT)
    assert [text.get_text() for text in ax.get_xticklabels()] == ["a", "b"]
    np.testing.assert_array_equal(ax.get_lines()[0].get_xdata(), [0, 1])
    np.testing.assert_array_equal(ax.get_lines()[0].get_ydata(), [5.0, 6.0])


def test_points_without_a_number_are_left_out():
    rows = [(0.1, "a", 1.0), (0.3, "a", None), (0.5, "a", 5.0)]
    (line,) = sweep(table(rows), GAP, OUT).get_lines()
    np.testing.assert_array_equal(line.get_xdata(), [0.1, 0.5])
    refuses("no point with", sweep, table(rows[1:2]), GAP, OUT)


def test_a_map_has_a_cell_around_each_point():
    rows = [(x, y, 10 * x + y) for x in (2.0, 1.0, 4.0) for y in (0.1, 0.3) if (x, y) != (4.0, 0.3)]
    names = ("motion.0.force", "surface.friction", OUT)
    ax = sweep_map(table([*rows, (4.0, 0.3, None)], names), names[0], names[1], OUT)
    cells = ax.collections[0].get_array()
    np.testing.assert_allclose(cells[0], [10.1, 20.1, 40.1])
    np.testing.assert_allclose(cells[1, :2], [10.3, 20.3])
    assert cells.mask.tolist() == [[False] * 3, [False, False, True]]
    edges = ax.collections[0].get_coordinates()
    np.testing.assert_allclose(edges[0, :, 0], [0.5, 1.5, 3.0, 5.0])
    np.testing.assert_allclose(edges[:, 0, 1], [0.0, 0.2, 0.4])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("force (N/mm)", "friction")
    (bar,) = [one for one in ax.figure.axes if one is not ax]
    assert bar.get_ylabel() == "electrostatic force, last (N/mm)"


def test_a_map_of_decades_has_cells_of_one_width_and_says_the_numbers():
    names = ("electrostatics.insulator_thickness", "surface.friction", OUT)
    rows = [(x, y, x * y) for x in (0.001, 0.01, 0.1) for y in (0.1, 0.3)]
    ax = sweep_map(table(rows, names), names[0], names[1], OUT)
    edges = ax.collections[0].get_coordinates()
    np.testing.assert_allclose(edges[0, :, 0], [-0.5, 0.5, 1.5, 2.5])
    np.testing.assert_allclose(edges[:, 0, 1], [0.0, 0.2, 0.4])
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0.001", "0.01", "0.1"]


def test_a_map_over_names_has_one_row_for_each():
    ax = sweep_map(table(GRID), GAP, LAW, OUT)
    np.testing.assert_allclose(ax.collections[0].get_array(), [[1.0, 3.0, 5.0], [2.0, 4.0, 6.0]])
    assert [text.get_text() for text in ax.get_yticklabels()] == ["a", "b"]


def test_ticks_of_a_map_are_short_and_do_not_overlap():
    rows = [(load / 7.1, "a", load) for load in (0.1, 0.2, 0.3, 0.5, 0.75, 1.0)]
    ax = sweep_map(table(rows), GAP, LAW, OUT)
    assert [text.get_text() for text in ax.get_xticklabels()][:2] == ["0.0141", "0.0282"]
    decades = [(10.0**k, "a", 1.0) for k in range(20)]
    ax = sweep_map(table(decades), GAP, LAW, OUT)
    assert [text.get_text() for text in ax.get_xticklabels()] == [
        "1",
        "1e+03",
        "1e+06",
        "1e+09",
        "1e+12",
        "1e+15",
        "1e+18",
    ]
    assert ax.get_xticks().tolist() == [0, 3, 6, 9, 12, 15, 18]


def test_what_is_no_map_gets_a_sentence():
    refuses("several points at one place", sweep_map, table(GRID), GAP, GAP, OUT)
    refuses(r'given "motion.1.gap"; allowed: motion.0.gap. .point, ', sweep, table(GRID), "motion.1.gap", OUT)


def test_lines_have_markers_of_their_own_and_axes_may_be_logarithmic():
    ax = sweep(table(GRID), GAP, OUT, by=LAW, log="xy")
    assert [line.get_marker() for line in ax.get_lines()] == ["o", "s"]
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    assert [text.get_text() for text in ax.get_xticklabels()] == ["0.1", "0.3", "0.5"]
    assert sweep(table(GRID), GAP, OUT, log="y").get_xscale() == "linear"
    for rows, log, rule in (
        (GRID, "z", '"", "x", "y" or "xy"'),
        ([(0.0, "a", 1.0)], "x", "numbers above 0 along x"),
        ([(1.0, "a", -1.0)], "xy", "numbers above 0 along y"),
    ):
        refuses(f"log: given .*; allowed: {rule}", sweep, table(rows), GAP, OUT, log=log)
    refuses("numbers above 0 along x", sweep, table(GRID), LAW, OUT, log="x")


def test_a_histogram_has_every_point_and_says_mean_and_spread():
    ax = sweep_histogram(table([(x, "a", x) for x in np.linspace(0.0, 1.0, 101).tolist()]), OUT)
    *bars, _ = ax.patches  # the last is the span
    assert sum(bar.get_height() for bar in bars) == 101
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    # of 101 even points from 0 to 1: deviation sqrt(sum (k - 50)^2 / 100) / 100 = 0.2930
    assert texts == ["mean 0.5 N/mm, deviation 0.293 N/mm", "90 % of the points: 0.05 to 0.95 N/mm"]
    refuses("a column of numbers", sweep_histogram, table(GRID), LAW)


def test_a_scatter_has_a_panel_for_each_number_that_is_varied():
    rows = [(x, "a", x**3) for x in (0.3, 0.1, 0.2)]
    (panel,) = sweep_scatter(table(rows), OUT, over=[GAP])
    assert panel.get_title() == "rank correlation 1.00"
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("gap (mm)", "electrostatic force, last (N/mm)")
    assert len(panel.get_lines()[0].get_xdata()) == 3
    refuses("no column of numbers that is varied", sweep_scatter, table(rows[:1]), OUT)

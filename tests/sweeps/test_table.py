"""The table of a sweep: units in its header, back from its files as it was, statistics, data sets."""

import json
import math

import numpy as np
import pytest
from scipy import stats
from tools.refusals import refuses

import evfem as ev
from evfem.common import tables
from evfem.simulation.history import UNITS
from evfem.sweeps.folder import STATUS
from evfem.sweeps.table import SweepResult, read, table_units, told

GAP, LAW, LABEL, OUT = "motion.0.gap", "electrostatics.law", "case", "electrostatic_force.last"
COLUMNS = ("point", LABEL, GAP, LAW, OUT, "status", "seconds", "message")


def made():
    """A table with a label that looks like a number, a list, a gap in the numbers and awkward words."""
    values = [
        (0, "1", 0.5, "kaczmarek", 0.1 + 0.2, "done", 1.5, ""),
        (1, "2", 0.25, "kaczmarek", 1e-300, "done", 2.0, 'said "no", twice;\nand went'),
        (2, "1", -1.0, "strong_troxel", None, "refused", 0.0, "motion[0].gap: given -1.0; allowed: a gap"),
        (3, "2", [0.1, 2.0], "strong_troxel", 3.0, "done", 1.0, ""),
    ]
    rows = [dict(zip(COLUMNS, row, strict=True)) for row in values]
    gaps = [row[GAP] for row in rows]
    provenance = {
        "points": {"requested": 4, "done": 3, "refused": 1, "not_converged": 0, "failed": 0},
        "grid": {LABEL: {"1": {}, "2": {}}, GAP: gaps, LAW: ["kaczmarek", "strong_troxel"]},
        "outputs": [OUT],
    }
    return SweepResult(COLUMNS, rows, provenance, table_units([OUT], [GAP, LAW], [UNITS]))


@pytest.fixture
def folder(tmp_path):
    made().to_csv(tmp_path / "sweep.csv")
    (tmp_path / "sweep.json").write_text(json.dumps(made().provenance))
    return tmp_path


def test_units_stand_in_the_header(folder):
    head = (folder / "sweep.csv").read_text().splitlines()[0]
    assert head == f"point,case,{GAP} (mm),{LAW},{OUT} (N/mm),status,seconds,message"


@pytest.mark.parametrize("name", ["", "sweep.csv", "sweep.json"])
def test_what_is_loaded_is_what_was_written(folder, name):
    found = ev.load(folder / name)
    wanted = made()
    assert found.rows == wanted.rows
    assert [list(map(type, row.values())) for row in found.rows] == [
        list(map(type, row.values())) for row in wanted.rows
    ]
    assert (found.columns, dict(found.units)) == (wanted.columns, dict(wanted.units))
    assert found.provenance == wanted.provenance
    assert repr(found) == "SweepResult(4 points: 3 done, 1 refused)"


def test_a_csv_alone_has_its_numbers_and_counts_its_points(tmp_path):
    made().to_csv(tmp_path / "mine.csv")
    found = ev.load(tmp_path / "mine.csv")
    assert found[OUT][[0, 1, 3]].tolist() == [0.1 + 0.2, 1e-300, 3.0]
    assert math.isnan(found[OUT][2])
    assert found.units[GAP] == "mm"
    assert told(found.provenance["points"]) == "3 done, 1 refused"


WRONG = {
    "point,case\n1,2\n": "starts with 'point,case'",
    "point,status,seconds,message\n1,done\n": "with 'point,status,seconds,message', then '1,done'",
}


def test_what_is_no_table_gets_a_sentence(folder):
    for text, sentence in WRONG.items():
        (folder / "sweep.csv").write_text(text)
        refuses(sentence, read, folder)
    (folder / "sweep.csv").unlink()
    refuses(r"path: given sweep\.csv \(No such file", read, folder)
    made().to_csv(folder / "sweep.csv")
    for text in ("{}", "[1", '{"points": 3, "outputs": []}'):
        (folder / "sweep.json").write_text(text)
        refuses(r"^path: given sweep\.json \(.*allowed: the sweep\.json of a", ev.load, folder)


def sampled(count=200):
    friction = np.linspace(0.1, 0.5, count)
    load = np.random.default_rng(1).uniform(0.01, 0.1, count)
    columns = ("point", "surface.friction", "motion.0.force", OUT, "status", "seconds", "message")
    rows = [
        {"point": i, columns[1]: float(mu), columns[2]: float(force), OUT: float(mu**2), "status": "done"}
        for i, (mu, force) in enumerate(zip(friction, load, strict=True))
    ]
    return SweepResult(
        columns, rows, {"samples": {"count": count}, "points": {}, "outputs": [OUT]}, {OUT: "N"}
    )


@pytest.mark.parametrize("pandas", [True, False])
def test_statistics_are_those_of_the_numbers(monkeypatch, pandas):
    """Mean of x over an even grid is its middle, its quantiles are even, its deviation by hand."""
    if not pandas:
        monkeypatch.setattr(tables, "find_spec", lambda name: None)
    count = 5
    found = sampled(count).statistics(quantiles=(0.0, 0.25, 1.0))
    assert list(found["column"]) == ["surface.friction", "motion.0.force", OUT]
    assert (found["unit"][2], found["points"][2]) == ("N", 5)
    assert found["mean"][0] == pytest.approx(0.3)
    assert found["deviation"][0] == pytest.approx(0.1 * math.sqrt(10.0 / 4.0))
    assert [found[name][0] for name in ("q0", "q0.25", "q1")] == pytest.approx([0.1, 0.2, 0.5])
    (one,) = made().statistics([OUT], quantiles=())["points"]
    assert one == 3  # the gap is left out
    assert math.isnan(sampled(1).statistics()["deviation"][0])


def test_statistics_of_words_or_beyond_the_table_are_refused():
    refuses(r'columns: given "electrostatics\.law"; allowed: columns of numbers', made().statistics, [LAW])
    refuses(r"quantiles: given \(1\.5,\); allowed: numbers from 0 to 1", made().statistics, quantiles=(1.5,))


def test_the_rank_correlation_is_spearmans():
    from evfem.plotting.sweeps import _ranked

    draw = np.random.default_rng(2)
    x, y = draw.integers(0, 9, 50), draw.normal(size=50)
    assert _ranked(x, y) == pytest.approx(stats.spearmanr(x, y).statistic, rel=1e-12)
    assert math.isnan(_ranked(np.ones(3), np.arange(3.0)))


CASES = {
    "a": {"finger.width": 16, "finger.ridges": True},
    "b": {"finger.width": 17, "finger.ridges": False},
}
DRAWN = ev.Samples({"surface.friction": ev.Uniform(0.1, 0.5)}, count=3, seed=1)


def swept(grid, samples=None, lost=()):
    """The table of a sweep whose output is the square of the point's number, without the points `lost`; the
    point 1 is refused.
    """
    plan = ev.Sweep(ev.default_scene(), grid, samples, [OUT])
    rows = []
    for point in plan.points():
        found = {OUT: float(point.index**2), "status": "done", "seconds": 1.0, "message": ""}
        if point.index == 1:
            found |= {OUT: None, "status": "refused", "message": "surface.friction: given"}
        rows.append({"point": point.index, **point.labels, **point.parameters, **found})
    provenance = {"grid": plan.grid, "points": {"requested": len(rows)}, "outputs": [OUT]}
    provenance["samples"] = {"count": samples.count} if samples else None
    kept = [row for row in rows if row["point"] not in lost]
    return SweepResult(plan.columns, kept, provenance, table_units([OUT], plan.parameters, [UNITS]))


@pytest.mark.xarray
@pytest.mark.parametrize("samples", [None, DRAWN])
def test_a_data_set_has_the_value_of_each_point_at_its_parameters(samples):
    forces = {"motion.0.force": [0.02, 0.05], "surface.y": [0, 1], "case": CASES}
    table = swept(forces, samples, lost=(4,))
    found = table.to_xarray()
    assert found.force.dims == ("force",)
    assert found.force.attrs == {"units": "N/mm", "long_name": "motion.0.force"}
    assert found[OUT].attrs == {"units": "N/mm", "long_name": "attraction, downwards, last"}
    for row in table.rows:
        at = {"force": row["motion.0.force"], "y": row["surface.y"], "case": row["case"]}
        one = found.sel(at).isel({"sample": row["point"] % 3} if samples else {})
        np.testing.assert_equal(float(one[OUT]), math.nan if row[OUT] is None else row[OUT])
        assert (one.point, one.status, one.message) == (row["point"], row["status"], row["message"])
        assert (one.width, one.ridges) == (row["finger.width"], row["finger.ridges"])
        assert not samples or one.friction == row["surface.friction"]
    lost = found.where(found.point == 4, drop=True).squeeze()
    assert (str(lost.status.values), str(lost.message.values)) == ("missing", "not computed")
    assert np.isnan(lost[OUT])
    assert (found.y.dtype, found.width.dtype, found.ridges.dtype) == (int, int, bool)


@pytest.mark.xarray
def test_a_sweep_of_one_parameter_is_a_curve_with_a_gap_where_a_point_failed(tmp_path):
    finger = ev.FingerPad(ridges=False, resolution="coarse")
    scene = ev.Scene(finger, ev.Display(), ev.Kaczmarek(), 1000.0, ev.Hover(gap=0.3))
    table = ev.sweep(ev.Sweep(scene, {GAP: [0.5, -1.0, 0.3]}, outputs=[OUT]), tmp_path / "out", workers=1)
    found = table.to_xarray()
    assert found[OUT].dims == ("gap",)
    assert found.gap.values.tolist() == [0.5, -1.0, 0.3]
    np.testing.assert_array_equal(found[OUT], table[OUT])
    assert np.isnan(found[OUT].values).tolist() == [False, True, False]
    assert found.status.values.tolist() == ["done", "refused", "done"]
    assert "allowed: a gap in mm" in str(found.message.sel(gap=-1.0).values)
    assert ev.load(tmp_path / "out").to_xarray().equals(found)


@pytest.mark.xarray
def test_what_is_no_grid_is_a_list_of_points(tmp_path):
    table = swept({}, DRAWN, lost=(2,))
    found = table.to_xarray()
    assert dict(found.sizes) == {"point": 3}
    np.testing.assert_array_equal(found.friction, [*table["surface.friction"], math.nan])
    np.testing.assert_array_equal(found[OUT], [0.0, math.nan, math.nan])
    assert found.status.values.tolist() == ["done", "refused", "missing"]
    made().to_csv(tmp_path / "alone.csv")
    alone = ev.load(tmp_path / "alone.csv").to_xarray()
    assert alone[OUT].dims == alone.gap.dims == ("point",)
    assert alone.gap.values.tolist() == ["0.5", "0.25", "-1.0", "[0.1, 2.0]"]
    table.rows.append(table.rows[0])
    refuses("to_xarray: given a table with a point twice", table.to_xarray)


@pytest.mark.parametrize(
    "change",
    [
        {"points": {"requested": 4}},
        {"points": dict.fromkeys(("requested", *STATUS), "4")},
        {"grid": {GAP: 1}},
    ],
)
def test_a_provenance_of_another_kind_is_refused(folder, change):
    (folder / "sweep.json").write_text(json.dumps(made().provenance | change))
    refuses(r"path: given sweep\.json \(.*\); allowed: the sweep\.json of a sweep", read, folder)


def test_a_cell_too_deep_for_json_is_text(folder):
    deep = "[" * 99_999
    table = folder / "sweep.csv"
    table.write_text(table.read_text().replace("kaczmarek", deep))
    assert read(folder).rows[0][LAW] == deep

"""The table of a sweep: units in its header, back from its files as it was, statistics of samples."""

import json
import math

import numpy as np
import pytest
from scipy import stats
from tools.refusals import refuses

import evfem as ev
from evfem.common import tables
from evfem.simulation.history import UNITS
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

"""What pages say of runs is written from files in docs/results: every block has its maker, the numbers are
the file's, and no page is older than studies and files.
"""

import csv
import json
import runpy
import sys
from pathlib import Path

import pytest

from evfem import studies
from evfem.studies import printed

DOCS = Path(__file__).parents[2] / "docs"
sys.path.insert(0, str(DOCS))
MEASURED = runpy.run_path(str(DOCS / "measured.py"))
NUMBERS = {
    "B.L2.evfem_q2p1.cpu_s": 3.21,
    "B.L2.evfem_q2p1.peak_MB": 250.4,
    "B.L2.evfem_q2p1.error_percent.Fn_at_1.5": -0.052,
    "B.L2.fenicsx_q2.cpu_s": 64.2,
    "B.L2.fenicsx_q2.peak_MB": 199.6,
    "B.L2.fenicsx_q2.error_percent.Fn_at_1.5": 0.031,
    "B.L2.fastest_over_evfem.q2p1.cpu_s": 20.0,
    "A.L2.fastest_over_evfem.q1.cpu_s": 31.0,
    "B.L2.fenicsx_over_evfem.q2p1.process_cpu_s": 14.6,
    "race.B.best.evfem.cpu_s": 0.25,
    "race.B.best.fenicsx.cpu_s": 5.0,
    "race.B.best.fastest_over_evfem.cpu_s": 20.0,
}
MADE = {"date": "2030-01-02T03:04:05", "versions": {"evfem": "9.9"}}
PEERS = {"numbers": NUMBERS, "assumptions": {"peers": {"dolfinx": "0.5"}}, "provenance": MADE}


def page(name):
    return (DOCS.parent / name).read_text(encoding="utf-8")


def test_every_block_of_the_pages_has_a_maker_and_every_maker_its_block():
    found = [
        name
        for path in MEASURED["PAGES"]
        for _, name, _ in MEASURED["BLOCK"].findall(path.read_text("utf-8"))
    ]
    assert sorted(found) == sorted(MEASURED["BLOCKS"])


@pytest.mark.parametrize("path", MEASURED["PAGES"], ids=lambda path: path.name)
def test_no_page_is_older_than_the_files(path):
    """`python docs/measured.py` writes it anew."""
    text = path.read_text(encoding="utf-8")
    assert MEASURED["renewed"](text) == text


def test_the_tables_have_the_numbers_of_the_file():
    costs, ratios, race, run = (
        MEASURED["benchmark"].__dict__[name](PEERS) for name in ("costs", "ratios", "race", "run")
    )
    assert "| quadratic | 0.05 %, 0.03 % | 3.2, 250 | 64, 200 | not run | not run | not run |" in costs
    assert "| B, quadratic | - | - | 20 |" in ratios
    assert "| A, linear | - | - | 31 |" in ratios
    assert "| B, quadratic, with imports | - | - | 15 |" in ratios
    assert "| B, friction force after 3 mm | each its best | 0.25 | 5 | - | - | - | 20 |" in race
    assert run == "One run on 2030-01-02, one thread: evfem 9.9, dolfinx 0.5.\n"


def test_a_campaign_of_the_same_seed_takes_the_place_of_the_older_one():
    numbers = dict.fromkeys(MEASURED["ENDS"], 7.0) | {
        "slowest_over_median": 105.4,
        "largest_remainder": 2.2e-6,
    }
    found = {
        "numbers": numbers,
        "provenance": MADE | {"parameters": {"seed": 5, "limit": 60}, "commit": "abc"},
    }
    rows = MEASURED["with_campaign"]([{"seed": "4"}, {"seed": "5"}], found)
    assert [row["seed"] for row in rows] == ["4", "5"]
    assert list(rows[1]) == page("docs/results/campaigns.csv").splitlines()[0].split(",")
    assert "| `timeout` | 7 |" in MEASURED["campaigns"](rows[1:])


def test_quick_runs_do_not_get_to_the_pages(tmp_path):
    quick = PEERS | {"provenance": MADE | {"quick": True}}
    (tmp_path / "peers.json").write_text(json.dumps(quick))
    before = page("docs/performance.md")
    with pytest.raises(SystemExit, match="--quick"):
        MEASURED["main"](tmp_path)
    assert page("docs/performance.md") == before


@pytest.mark.parametrize("value", [None, 0.123, 9.96, 12.4, 345.0])
def test_numbers_have_two_digits(value):
    said = {None: "-", 0.123: "0.12", 9.96: "10", 12.4: "12", 345.0: "345"}
    assert MEASURED["short"](value) == said[value]


PAPER = [name for name in studies.NAMES if getattr(studies.module(name), "PAPER", None)]
#: those that take seconds
SHORT = ("section321", "fig03", "fig06", "fig07", "fig08", "fig09", "fig10")


def kept(name):
    return json.loads((MEASURED["RESULTS"] / f"{name}.json").read_text(encoding="utf-8"))


def test_the_page_on_the_paper_is_that_of_the_files():
    """`python docs/measured.py FOLDER` writes it anew."""
    page = MEASURED["PAPER"].read_text(encoding="utf-8")
    assert page == MEASURED["page_on_the_paper"]()
    assert [name for name in PAPER if f"(pictures/{name}.png)" not in page] == []


@pytest.mark.parametrize("name", PAPER)
def test_a_kept_file_has_what_the_study_knows_of_the_paper(name):
    paper, result = studies.module(name).PAPER, kept(name)
    assert not result["provenance"]["quick"]
    assert result["assumptions"]["printed"] == {key: one.described() for key, one in paper.items()}
    assert [row.what for row in printed.rows_of(result) if row.why == printed.NO_REASON] == []


@pytest.mark.parametrize("name", SHORT)
def test_the_kept_numbers_are_those_of_today(name):
    result, today = kept(name), studies.run(name)["numbers"]
    for key in result["assumptions"]["printed"]:
        assert today[key] == pytest.approx(result["numbers"][key], rel=1e-6), key


def test_the_contradictions_of_the_paper_are_on_the_page():
    """Recomputed by hand: 1776.73 V is 2266.5 V with 0.38 mm of skin, (22) is twice 2.746 um, forces at
    2500 V are (2500/2000)^2 times those at 2000 V, and the layers' printed nodes add up to 23,139.
    """
    page = MEASURED["PAPER"].read_text(encoding="utf-8")
    for row in (
        "| 1776.73 V | 2266.459 | +28 % |",
        "| 2.74 um | 5.492 | +100 % |",
        "| 2.95 mN | 4.605 | +56 % |",
        "| 1911.12 V | 2477.535 | +30 % |",
    ):
        assert row in page
    assert 2240 + 10998 + 8208 + 1434 + 259 == 23139


def test_times_of_the_studies_are_those_of_the_files():
    text = MEASURED["TIMES"].read_text(encoding="utf-8")
    assert MEASURED["times"]({}, text) == text
    found = {"fig09": {"provenance": {"seconds": 123.4, "quick": False}}}
    rows = {row["study"]: row for row in csv.DictReader(MEASURED["times"](found, text).splitlines())}
    assert rows["fig09"]["whole"] == "120"

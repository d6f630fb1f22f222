"""Tables that are written from the studies' files: every block has its maker, and the numbers are
the file's.
"""

import json
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
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


def test_every_block_of_the_page_has_a_maker_and_every_maker_its_block():
    names = [name for _, name, _ in MEASURED["BLOCK"].findall(MEASURED["PAGE"].read_text("utf-8"))]
    assert sorted(names) == sorted(name for blocks in MEASURED["BLOCKS"].values() for name in blocks)


def test_the_tables_have_the_numbers_of_the_file():
    page = MEASURED["renewed"](MEASURED["PAGE"].read_text("utf-8"), {"peers": PEERS})
    assert "| B, L2 | quadratic | 0.05 %, 0.03 % | 3.2, 250 | 64, 200 | not run | not run |" in page
    assert "| B, quadratic | - | - | 20 |" in page
    assert "| A, linear | - | - | 31 |" in page
    assert "| B, quadratic, with imports | - | - | 15 |" in page
    assert "| B, friction force after 3 mm | each its best | 0.25 | 5 | - | - | 20 |" in page
    assert "One run on 2030-01-02, one thread: evfem 9.9, dolfinx 0.5." in page
    # what has no file stays
    before = MEASURED["PAGE"].read_text("utf-8")
    assert page.split("## Which element and mesh")[1] == before.split("## Which element and mesh")[1]


def test_the_rows_of_readme_are_those_of_the_file():
    text = MEASURED["rows_of_readme"](MEASURED["README"].read_text("utf-8"), PEERS)
    assert "| a slide on 23,000 nodes | error 0.05 %, 3.2 CPU s; fastest other package 64 s |" in text
    assert "| time to 0.1 % of the friction force | 0.25 CPU s; fastest other package 5 s |" in text
    assert "with version 9.9 on\n2030-01-02:" in text


def test_a_run_without_the_slide_leaves_the_readme_as_it_is():
    fewer = {key: value for key, value in NUMBERS.items() if not key.startswith("race.B")}
    text = MEASURED["README"].read_text("utf-8")
    assert MEASURED["rows_of_readme"](text, PEERS | {"numbers": fewer}) == text


def test_quick_runs_do_not_get_to_the_pages(tmp_path):
    quick = PEERS | {"provenance": MADE | {"quick": True}}
    (tmp_path / "peers.json").write_text(json.dumps(quick))
    before = MEASURED["PAGE"].read_text("utf-8")
    with pytest.raises(SystemExit, match="--quick"):
        MEASURED["main"](tmp_path)
    assert MEASURED["PAGE"].read_text("utf-8") == before


@pytest.mark.parametrize("value", [None, 0.123, 9.96, 12.4, 345.0])
def test_numbers_have_two_digits(value):
    said = {None: "-", 0.123: "0.12", 9.96: "10", 12.4: "12", 345.0: "345"}
    assert MEASURED["short"](value) == said[value]

"""Printed numbers beside computed ones: digits, ranges, reasons, and the page of a whole run."""

import doctest
import json

import pytest

from evfem import cli, studies
from evfem.studies import paper, printed
from evfem.studies.common import Study
from evfem.studies.printed import Printed, difference_of, rows_of, told


@pytest.mark.parametrize(
    ("digits", "here", "said"),
    [
        ("2.74", 2.7449, "as printed"),
        ("2.74", 2.7451, "+0.19 %"),
        ("8 to 10", 9.0, "within"),
        ("8 to 10", 11.0, "+10 %"),
        ("8 to 10", 7.6, "-5 %"),
        ("23,139", 23139.0, "as printed"),
        ("23,139", 23140.0, "+0.0043 %"),
    ],
)
def test_a_number_agrees_to_its_last_printed_digit_or_within_its_range(digits, here, said):
    assert difference_of(Printed(digits, ""), here) == said


def test_the_examples_run():
    for module in (printed, studies):
        failed, attempted = doctest.testmod(module)
        assert attempted
        assert not failed


def result_of(paper_numbers, numbers, quick=False):
    return Study("one", numbers, paper_numbers, {}, [], lambda: None).finish(None, quick)


def test_a_reason_stands_where_the_numbers_differ_and_once():
    known = {
        "a": Printed("1.0", "first", "mm", "caption", "rounded"),
        "b": Printed("2.0", "second", "mm", "caption", "rounded"),
        "c": Printed("3.0", "third", "", "text", "never told"),
        "d": Printed("4.0", "fourth"),
    }
    rows = rows_of(result_of(known, {"a": 1.2, "b": 2.2, "c": 3.01, "d": 5.0}))
    assert [row.why for row in rows] == ["rounded", "rounded", "", printed.NO_REASON]
    assert [row.here for row in rows] == ["1.20", "2.20", "3.01", "5.0"]
    lines = told(rows).splitlines()
    assert lines[0].split() == ["first", "paper", "1.0", "mm", "here", "1.20", "+20", "%", "[1]"]
    assert lines[4:] == ["[1] rounded", f"[2] {printed.NO_REASON}"]
    assert "never told" not in told(rows)


def test_a_number_computed_otherwise_stands_in_a_second_table(tmp_path):
    """And only there where the run has it: a quick one has no variants."""
    other = {"by (2)": "b", "by (3)": "gone"}
    known = {"a": Printed("1.0", "first", "mm", "caption", "other", other), "c": Printed("3.0", "third")}
    result = result_of(known, {"a": 1.2, "b": 1.01, "c": 3.0})
    (tmp_path / "fig09.json").write_text(json.dumps(result), encoding="utf-8")
    text = paper.page(paper.sections(tmp_path))
    assert "| what | paper | here | by (2) |\n" in text
    assert "| first | 1.0 mm | 1.20 | 1.01 |\n" in text
    assert "| third | 3.0 |" not in text
    assert "<td>1.01</td>" in paper.html(paper.sections(tmp_path))


def test_ranges_are_no_numbers_of_the_file():
    known = {"a": Printed("8 to 10", "width", "mm"), "b": Printed("1,000", "nodes")}
    result = result_of(known, {"a": 9.0, "b": 1000.0})
    assert result["paper"] == {"b": 1000.0}
    assert set(result["assumptions"]["printed"]) == {"a", "b"}


def test_all_studies_leave_one_page_in_two_formats(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(studies, "NAMES", ("section321", "fig09"))
    assert cli.main(["study", "all", "--quick", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr()
    assert out.out.splitlines()[-2:] == [str(tmp_path / "paper.md"), str(tmp_path / "paper.html")]
    assert "study fig09: " in out.err
    page, site = ((tmp_path / f"paper.{end}").read_text() for end in ("md", "html"))
    for name in ("section321", "fig09"):
        assert f"]({name}.png)" in page
        assert f'src="{name}.png"' in site
        seconds = json.loads((tmp_path / f"{name}.json").read_text())["provenance"]["seconds"]
        assert 0.0 <= seconds < 60.0
    assert "(--quick) with evfem" in page
    assert "(22) is misprinted" in site


def test_there_is_no_page_without_numbers_of_the_paper(tmp_path):
    assert paper.write(tmp_path) == []
    assert list(tmp_path.iterdir()) == []

"""The table of words: every name in it exists, and every public class that is a term has its row."""

import re

import pytest
from docs.test_pages import DOCS, resolved, rows

import evfem as ev
from evfem.scene import schema
from evfem.simulation.result import SPATIAL, UNITS

#: public classes that are no terms: errors, statistics of measurements and sweeps, what is kept and written
EXCEPTIONS = {
    *("EvfemError", "InputError", "NotConverged", "StopRun", "StorageError"),
    *("MeasuredCurve", "MeasuredValues", "Normal", "Parameter", "Samples", "Sweep", "Uniform"),
    *("Output", "Playback", "Result", "StopWhen"),
}
TABLE = list(rows((DOCS / "words.md").read_text(encoding="utf-8")))
NAMES = [name for *_, code in TABLE for name in re.findall(r"`(.+?)`", code)]


def exists(name):
    """A column of the history, a key of a scene file, or what a dotted name of the package leads to."""
    keys = {f"{table.name}.{key.name}" for table in schema.sections() for key in table.keys}
    if name in {*UNITS, *SPATIAL} | keys:
        return True
    if not name.startswith(("ev.", "evfem.")):
        return False
    return resolved(re.sub(r"^ev\b", "evfem", name)) is not None


def test_every_row_has_a_term_a_meaning_a_symbol_and_names():
    assert len(TABLE) > 40
    assert {len(cells) for cells in TABLE} == {4}
    terms = [re.sub(r"[*`]", "", cells[0]) for cells in TABLE]
    assert len(set(terms)) == len(terms)
    for term, meaning, symbol, code in TABLE:
        assert term
        assert 10 < len(meaning) < 110, term
        assert not meaning.endswith("."), term
        assert re.fullmatch(r"(\$.+?\$(, )?)*", symbol), term
        assert re.fullmatch(r"(`[\w.]+`(, )?)*", code), term


@pytest.mark.parametrize("name", sorted(set(NAMES)))
def test_a_name_of_the_table_is_in_the_code(name):
    assert exists(name)


def test_a_name_that_is_nowhere_is_seen():
    assert not exists("surface.kore")
    assert not exists("surface_snik")
    with pytest.raises(AttributeError):
        exists("ev.Kore")


def test_every_public_class_that_is_a_term_is_in_the_table():
    classes = {name for name in ev.__all__ if isinstance(getattr(ev, name), type)}
    told = {name.split(".")[1] for name in NAMES if name.startswith("ev.")}
    assert classes - told == EXCEPTIONS - told
    assert classes >= EXCEPTIONS


#: what newcomers search for -> the how-to page that answers
SEARCHED = {
    "posture": ("tilt", "pitch", "roll", "posture"),
    "moist": ("moist", "humidity", "sweat", "water"),
    "coat": ("silicone", "rubber", "glove", "screen protector"),
    "electrodes": ("two electrodes", "ground"),
    "rough": ("roughness",),
    "friction": ("friction laws",),
    "hand": ("grip", "robot", "hand"),
    "accuracy": ("accurate", "noise of the", "digits"),
}


@pytest.mark.parametrize(("page", "words"), SEARCHED.items())
def test_a_newcomers_words_lead_to_a_page_from_the_index_and_from_its_begin(page, words):
    """They are in the line of the index, or in the page's first paragraph."""
    index = (DOCS / "howto" / "index.md").read_text(encoding="utf-8")
    line = re.search(rf"^- \[[^]]+\]\({page}\.md\).*?(?=^- |^$)", index, re.M | re.S)[0].lower()
    begin = (DOCS / "howto" / f"{page}.md").read_text(encoding="utf-8").split("\n\n```")[0].lower()
    assert [word for word in words if word not in line + begin] == []
    assert any(word in line for word in words)

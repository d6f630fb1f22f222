"""What the documentation lists of keys and columns is what the package has."""

import runpy
from pathlib import Path

import evfem
from evfem.scene import schema
from evfem.simulation.history import MEANINGS
from evfem.simulation.result import COLUMNS, UNITS

DOCS = Path(__file__).parents[2] / "docs"
TABLES = runpy.run_path(str(DOCS / "tables.py"))


def test_the_page_of_keys_is_that_of_the_models():
    """`python docs/tables.py` writes it anew."""
    assert (DOCS / "reference" / "keys.md").read_text(encoding="utf-8") == TABLES["page"]()


def test_the_columns_are_those_of_the_history():
    text = (DOCS / "notation.md").read_text(encoding="utf-8")
    assert TABLES["columns"](text) == text
    for name in COLUMNS:
        unit = f" {UNITS[name]} " if UNITS[name] else " "
        assert f"| `{name}` |{unit}| {MEANINGS[name]} |\n" in text


def test_the_options_of_importers_are_their_fields():
    text = (DOCS / "howto" / "texture.md").read_text(encoding="utf-8")
    assert TABLES["importers"](text) == text
    assert "- `--pixel` (image): width of a pixel of an image in mm; a width above zero; needed.\n" in text


def test_an_entry_says_type_unit_default_range_and_meaning():
    width, _ = [key for one in schema.sections() for key in one.keys if key.name == "ridge_width"]
    assert TABLES["entry"](width) == (
        "- `ridge_width`: number in mm; default `0.5`; 0.3 to 0.8 mm.\n  The pitch, from crest to crest."
    )


def test_the_reference_has_every_public_name_on_the_page_of_its_module():
    text = (DOCS / "reference" / "index.md").read_text(encoding="utf-8")
    assert TABLES["public_names"](text) == text
    assert [name for name in evfem.__all__ if text.count(f"| `ev.{name}` |") != 1] == []

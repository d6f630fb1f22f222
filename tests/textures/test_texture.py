"""Textures and their files: what is kept, what is refused, and what repeats."""

import json

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.cli import main
from evfem.textures.library import find, names, reference
from evfem.textures.texture import KEYS, Texture, read, write

WAVE = Texture(
    "wave", "drawn", [0.0, 1.0, 2.0], [0.0, 0.1, 0.3], "CC0-1.0", period=4.0, provenance=("Drawn.",)
)


@pytest.mark.parametrize("name", ["wave.json", "folder"])
def test_a_texture_comes_back_to_the_last_bit(tmp_path, name):
    texture = Texture("t", "k", [0.0, 0.1, 1 / 3], [0.1, 2 / 3, 1e-17], "CC0-1.0", provenance=("a", "b"))
    paths = write(texture, tmp_path / name)
    assert all(path.exists() for path in paths)
    back = read(tmp_path / name)
    assert back.x.tolist() == texture.x.tolist()
    assert back.values.tolist() == texture.values.tolist()
    assert (back.name, back.kind, back.licence, back.period) == ("t", "k", "CC0-1.0", None)
    assert back.provenance == ("a", "b")


@pytest.mark.parametrize("key", KEYS)
def test_every_key_of_the_file_is_needed(tmp_path, key):
    path, _ = write(WAVE, tmp_path / "wave.json")
    table = json.loads(path.read_text())
    del table[key]
    path.write_text(json.dumps(table))
    refuses(key, read, path)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("licence", "", "licence: given"),
        ("licence", None, "licence: given None"),
        ("more", 1, "texture: given .* more"),
        ("units", {"x": "m", "height": "m"}, "units: given"),
        ("data", "../wave.csv", "data: given"),
        ("data", "other.csv", "data: given .*No such file"),
        ("period", -1.0, "period: given"),
        ("period", 2.0, "period: given 2 mm, with rows over 2"),
        ("quantity", "speed", "quantity: given"),
        ("length", 4.1, "length: given 4.1; allowed: that of the rows, 4 mm"),
        ("provenance", "a", "provenance: given"),
        ("provenance", [1], "provenance: given 1"),
        ("name", "x" * 401, "name: given"),
    ],
)
def test_what_is_wrong_in_the_file_is_named(tmp_path, key, value, message):
    path, _ = write(WAVE, tmp_path / "wave.json")
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
    refuses(message, read, path)


@pytest.mark.parametrize("text", ["", "[1]", "{", "[" * 100_000, "\x00", '"' + "a" * 300_000 + '"'])
def test_what_is_no_texture_is_refused(tmp_path, text):
    (tmp_path / "wave.json").write_text(text)
    refuses("texture: given", read, tmp_path / "wave.json")


@pytest.mark.parametrize(
    ("x", "values", "message"),
    [
        ([0.0], [0.0], "2 to 200000 rows"),
        ([0.0, 1.0], [0.0], "2 to 200000 rows"),
        ([0.0, 0.0], [0.0, 1.0], "rising numbers"),
        ([0.0, 2e4], [0.0, 1.0], "within 10000"),
        ([0.0, 1.0], [0.0, 50.0], "height: given 50; allowed: values from -10 to 10"),
        ([0.0, np.nan], [0.0, 1.0], "not finite"),
    ],
)
def test_rows_beyond_the_limits_are_refused(x, values, message):
    refuses(message, Texture, "t", "k", x, values, "CC0-1.0")


def test_periods_are_repeated_on_both_sides():
    x, values = WAVE.over(-4.0, 6.0)
    assert x.tolist() == [-4.0, -3.0, -2.0, 0.0, 1.0, 2.0, 4.0, 5.0, 6.0]
    assert values.tolist() == [0.0, 0.1, 0.3] * 3


def test_a_texture_that_ends_goes_on_as_its_mirror_image():
    ends = Texture("t", "k", [0.0, 1.0, 3.0], [0.0, 0.1, 0.3], "CC0-1.0")
    x, values = ends.over(0.0, 6.0)
    assert x.tolist() == [0.0, 1.0, 3.0, 5.0, 6.0]
    assert values.tolist() == [0.0, 0.1, 0.3, 0.1, 0.0]


def test_rows_beyond_both_ends_are_given_where_none_lie_on_them():
    x, _ = WAVE.over(0.5, 3.0)
    assert x[0] <= 0.5
    assert x[-1] >= 3.0


def test_twenty_textures_are_shipped_with_a_licence_and_are_the_same_every_time():
    assert len(names()) == 20
    for name in names():
        texture = reference(name)
        assert texture.licence == "CC0-1.0"
        assert texture.values.tolist() == reference(name).values.tolist()


def test_a_reference_texture_that_does_not_exist_is_refused_with_a_guess():
    refuses(r"allowed: weave\? \(", find, "waeve")


def test_a_measurement_of_the_same_name_is_not_replaced(tmp_path):
    mine = tmp_path / "wave.csv"
    mine.write_text("x,height\n0,1\n")
    said = r"whose rows would replace wave\.csv, .*as wave-texture\.json"
    refuses(said, write, WAVE, tmp_path / "wave.json")
    assert mine.read_text() == "x,height\n0,1\n"
    assert not (tmp_path / "wave.json").exists()
    mine.unlink()
    for _ in range(2):
        write(WAVE, tmp_path / "wave.json")
    assert read(tmp_path / "wave.json").length == 4.0


@pytest.mark.parametrize(("key", "out"), [("--out", "wave.csv"), ("--signal", "wave.csv")])
def test_results_go_to_no_texture_and_are_refused_before_the_slide(tmp_path, capsys, monkeypatch, key, out):
    monkeypatch.setattr("evfem.estimate.commands.record", lambda *_: pytest.fail("was run"))
    _, rows = write(WAVE, tmp_path / "wave.json")
    before = rows.read_text()
    given = ["texture", "simulate", str(tmp_path / "wave.json"), key, str(tmp_path / out)]
    assert main(given) == 2
    assert f"{key}: given" in capsys.readouterr().err
    assert rows.read_text() == before

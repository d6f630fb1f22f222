"""What the page may send, and what it gets: strict in, plain numbers out."""

import json
import math

import numpy as np
import pytest
from tools.refusals import refuses

from evfem.scene.file import loads
from evfem.studio import page
from evfem.studio.state import MOST_ROWS, parse, rows
from evfem.textures.generate import Knobs, make
from evfem.textures.library import reference
from evfem.textures.texture import Texture

DRAWN = {"x": [0.0, 0.5, 1.0, 1.5], "values": [0.0, 0.01, 0.0, -0.01], "licence": "CC0-1.0", "period": 2.0}


@pytest.mark.parametrize(
    ("state", "message"),
    [
        ("", "state: given no JSON"),
        ("[" * 100_000, "state: given no JSON"),
        ("[]", "state: given"),
        ({"other": 1}, 'state: given "other"'),
        ({"texture": {"reference": "no"}}, "texture: given"),
        ({"texture": {"reference": ["a"]}}, "texture: given"),
        ({"texture": {"reference": "weave", "x": []}}, 'texture: given "x"'),
        ({"texture": {"generator": "grating", "depth": 1}}, "texture.depth: given an unknown key"),
        ({"texture": {"generator": "grating", "frequency": 1e9}}, "frequency: given"),
        ({"texture": {}}, "texture: given no x"),
        ({"texture": {**DRAWN, "x": [0.0] * (MOST_ROWS + 1)}}, f"2 to {MOST_ROWS} rows"),
        ({"texture": {**DRAWN, "x": "abcd"}}, "0 rows"),
        ({"texture": {**DRAWN, "licence": ""}}, "licence: given"),
        ({"texture": {**DRAWN, "provenance": "a"}}, "provenance: given"),
        ({"touch": {"load": "1"}}, "load: given"),
        ({"touch": {"mass": 1.0}}, "touch.mass: given an unknown key"),
        ({"device": {"law": "ohm"}}, "law: given"),
        ({"model": {"x": [1.0], "friction": [1.0]}}, "model: given"),
        ({"model": {"x": list(range(20)), "friction": ["a"] * 20}}, "model: given"),
        ({"model": {"x": [0.0] * 20, "friction": [0.3] * 20}}, "model: given"),
        ({"model": {"x": list(range(20)), "friction": [1e9] * 20}}, "model: given"),
        ({"model": {"x": list(range(20)), "friction": [10**400] * 20}}, "model: given numbers out of range"),
        ({"exact": {"x": list(range(20)), "voltage": [1.0] * 20}}, "exact: given"),
        ({"exact": {"x": list(range(20)), "voltage": [1e6] * 20, "friction": [0.3] * 20}}, "exact: given"),
    ],
)
def test_what_the_page_never_sends_is_refused(state, message):
    text = state if isinstance(state, str) else json.dumps(state)
    refuses(message, parse, text)


def test_a_texture_travels_as_its_rows_and_back():
    texture = make("spectral", Knobs(irregularity=0.4, seed=3))
    back = parse(json.dumps({"texture": rows(texture)})).texture
    long = texture.x.size > MOST_ROWS
    assert back.x.size == (MOST_ROWS if long else texture.x.size)
    there = np.interp(back.x, texture.x, texture.values)
    np.testing.assert_allclose(back.values, there, atol=1e-6)
    assert back.period == pytest.approx(texture.period)
    assert ("kept by the studio" in back.provenance[-1]) == long


def test_an_answer_is_plain_json_with_curves_of_one_length():
    found = json.loads(page.text(page.answer(parse("{}"))))
    assert {len(found[key]) for key in ("x", "profile", "friction", "felt", "lost", "voltage")} == {
        page.POINTS
    }
    assert found["numbers"]["peak"] >= found["numbers"]["rms"] > 0.0
    assert found["x"][-1] == 8.0
    assert found["band"] > 0.0


def test_the_profile_of_an_answer_is_that_of_the_texture():
    found = page.answer(parse(json.dumps({"texture": DRAWN, "touch": {"length": 2.0}})))
    x = np.array(found["x"])
    wanted = np.interp(x % 2.0, [0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 10.0, 0.0, -10.0, 0.0])
    np.testing.assert_allclose(found["profile"], wanted, atol=1e-3)


def test_the_exact_voltage_takes_the_place_of_the_closed_forms():
    x = np.linspace(0.1, 4.0, 40)
    exact = {"x": x.tolist(), "voltage": (900.0 + 10.0 * x).tolist(), "friction": [0.31] * 40}
    text = json.dumps({"exact": exact, "touch": {"length": 4.0}})
    found = page.answer(parse(text))
    assert found["encoding"] == "model"
    assert page.answer(parse('{"touch": {"length": 4.0}}'))["encoding"] == "closed form"
    np.testing.assert_allclose(found["felt"], 0.31, atol=1e-5)
    assert found["numbers"]["peak"] == pytest.approx(940.0)
    assert page.file(parse(text), "csv") != page.file(parse('{"touch": {"length": 4.0}}'), "csv")


def test_the_models_curve_takes_the_place_of_the_estimate():
    x = np.linspace(0.1, 4.0, 40)
    model = {"x": x.tolist(), "friction": (0.35 + 0.01 * np.sin(x)).tolist()}
    found = page.answer(parse(json.dumps({"model": model, "touch": {"length": 4.0}})))
    assert (found["source"], found["band"]) == ("model", None)
    assert found["notes"] == ["air breaks down from 790 V on (28.5 um)"]
    np.testing.assert_allclose(found["friction"], np.interp(found["x"], x, model["friction"]), atol=1e-5)


def test_what_cannot_be_rendered_is_marked_and_warned_of():
    found = page.answer(parse('{"device": {"friction": 0.6}}'))
    assert all(found["lost"])
    assert any("slipperier than the display" in note for note in found["notes"])


def test_every_button_gives_its_file():
    state = parse('{"touch": {"length": 2.0}}')
    starts = {"wav": b"RIFF", "png": b"\x89PNG", "csv": b"position,voltage\n", "friction": b"x,friction\n"}
    for kind in page.FILES:
        assert page.file(state, kind).startswith(starts.get(kind, b"")), kind
    assert json.loads(page.file(state, "hjif"))["version"] == "2025"
    scene = loads(page.file(state, "toml").decode())
    assert scene.motion[2].distance == 2.0
    refuses("file: given", page.file, state, "exe")


def test_an_upload_is_read_by_the_importers_under_a_harmless_name():
    data = b"x,height\n" + b"".join(b"%g,%g\n" % (i * 0.1, 0.01 * (i % 7)) for i in range(50))
    found = page.uploaded(data, "../../etc/passwd.csv", {"licence": "CC0-1.0"})
    assert (found["name"], found["quantity"], len(found["x"])) == ("passwd", "height", 50)
    refuses("licence", page.uploaded, data, "a.csv", {})
    refuses("pixel: missing", page.uploaded, b"\x89PNG", "a.png", {"licence": "CC0-1.0"})
    refuses('smooth: given "x"', page.uploaded, data, "a.csv", {"licence": "CC0-1.0", "smooth": "x"})


def test_an_uploaded_recording_holds_what_is_said():
    rows = "".join(f"{i}e-3,{math.sin(0.2 * math.pi * i)},0\n" for i in range(2000))
    options = {"licence": "CC0-1.0", "speed": "50"}
    data = ("time,x,y\n" + rows).encode()
    for missing, more in (("channel", {}), ("quantity", {"channel": "x"})):
        refuses(f"{missing}: given nothing", page.uploaded, data, "a.csv", options | more)
    found = page.uploaded(data, "a.csv", options | {"channel": "x", "quantity": "velocity", "longest": "5"})
    assert found["quantity"] == "friction"
    assert "Waves of up to 5 mm." in found["provenance"]


@pytest.mark.parametrize("name", ["friction-steps", "grating-1mm", "cork"])
def test_reference_textures_have_answers(name):
    found = page.answer(parse(json.dumps({"texture": {"reference": name}})))
    assert found["quantity"] == reference(name).quantity
    json.dumps(found, allow_nan=False)


def test_a_level_drawing_gets_a_sentence():
    level = {**DRAWN, "values": [0.0] * 4}
    assert isinstance(parse(json.dumps({"texture": level})).texture, Texture)
    refuses("which is level", page.answer, parse(json.dumps({"texture": level})))


def test_the_page_warns_as_the_plan_does_and_has_the_rough_gap():
    """(g + s) / s times the voltage with 5 um of air."""
    device = {"law": "strong_troxel", "insulator": "touchscreen"}
    smooth, rough = (
        page.answer(parse(json.dumps({"device": device | {"roughness_gap": gap}}))) for gap in (0.0, 0.005)
    )
    reduced = 0.38 / 1650.0 + 0.001 / 3.9
    ratio = rough["numbers"]["peak"] / smooth["numbers"]["peak"]
    assert ratio == pytest.approx((0.005 + reduced) / reduced)
    assert [any("see roughness_gap" in note for note in one["notes"]) for one in (smooth, rough)] == [
        True,
        False,
    ]
    assert page.answer(parse('{"texture": {"reference": "paper"}}'))["band"] is None

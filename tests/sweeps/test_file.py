"""What a sweep varies: keys and rows, distributions by moments and strata, mistakes in a sentence."""

import math
import textwrap
import tomllib

import numpy as np
import pytest
from tools.refusals import refuses

import evfem as ev
from evfem.errors import InputError
from evfem.sweeps import file as sweepfile
from evfem.sweeps.keyunits import unit_of

SCENE = """
version = 1
[surface]
kind = "flat"
friction = 0.3
[[motion]]
kind = "press"
force = 0.05
[[motion]]
kind = "slide"
distance = 1.0
"""


def read(body, folder="."):
    scene = (
        SCENE.replace("version = 1", "").replace("[[motion", "[[scene.motion").replace("[surf", "[scene.surf")
    )
    head, sign, tables = f"\n{textwrap.dedent(body)}".partition("\n[")
    return sweepfile.loads(f"version = 1\n{head}\n{scene}{sign}{tables}", folder)


def test_a_grid_has_every_combination_and_rows_change_together():
    sweep = read("""
    [grid]
    "surface.friction" = [0.1, 0.2]
    [grid.grip]
    light = { "motion.0.force" = 0.05, "motion.1.distance" = 1.0 }
    firm = { motion.0.force = 0.5, motion.1.distance = 2.0 }
    """)
    points = sweep.points()
    assert [p.index for p in points] == [0, 1, 2, 3]
    assert sweep.labels == ["grip"]
    assert sweep.parameters == ["surface.friction", "motion.0.force", "motion.1.distance"]
    found = [(p.labels["grip"], *p.parameters.values()) for p in points]
    assert found == [
        ("light", 0.1, 0.05, 1.0),
        ("firm", 0.1, 0.5, 2.0),
        ("light", 0.2, 0.05, 1.0),
        ("firm", 0.2, 0.5, 2.0),
    ]
    scene = tomllib.loads(points[3].text)
    assert (scene["surface"]["friction"], scene["motion"][0]["force"]) == (0.2, 0.5)
    assert scene["motion"][1] == {"kind": "slide", "distance": 2.0}


def test_values_with_a_unit_are_numbers_of_the_key_s():
    """In the table too, not in the scene alone; in rows and lists."""
    sweep = read("""
    [grid]
    "motion.1.distance" = ["500 um", 1.5]
    [grid.skin.wet]
    "finger.materials.dermis.E" = "20 kPa"
    "electrostatics.insulator" = "film"
    "surface.x" = ["1 um", 2.0]
    """)
    given = sweep.points()[0].parameters
    assert given == {
        "motion.1.distance": 0.5,
        "finger.materials.dermis.E": pytest.approx(0.02),
        "electrostatics.insulator": "film",
        "surface.x": [0.001, 2.0],
    }
    assert [unit_of(f"{table}.phase") for table in ("surface", "electrostatics.signal")] == ["periods", "rad"]
    wrong = {"electrostatics.voltage": ["3 mm"]}
    refuses(
        r'electrostatics.voltage: given "3 mm"; .* with V \| mV \| kV',
        ev.Sweep,
        ev.scenefile.loads(SCENE),
        grid=wrong,
    )


def test_a_scene_object_is_swept_like_its_file():
    scene = ev.default_scene()
    sweep = ev.Sweep(scene, grid={"electrostatics.voltage": np.array([0.0, 500.0])})
    assert ev.scenefile.loads(sweep.points()[1].text).voltage == 500.0
    assert ev.scenefile.loads(ev.Sweep(scene, {"electrostatics.voltage": [1000.0]}).points()[0].text) == scene


def test_the_file_of_the_scene_is_found_beside_the_sweep(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "scene.toml").write_text(SCENE)
    (tmp_path / "many.toml").write_text(
        'version = 1\nscene = "deep/scene.toml"\n[grid]\nsurface.friction = [0.1]'
    )
    sweep = sweepfile.load(tmp_path / "many.toml")
    assert (sweep.name, sweep.folder) == ("many", (tmp_path / "deep").resolve())
    assert tomllib.loads(sweep.points()[0].text)["surface"]["friction"] == 0.1
    same = ev.Sweep(str(tmp_path / "deep" / "scene.toml"), grid={"surface.friction": [0.1]})
    assert tomllib.loads(same.points()[0].text)["surface"]["friction"] == 0.1
    refuses("scene: given 3; allowed: a Scene, or the path", ev.Sweep, 3, grid={"surface.friction": [0.1]})


def test_a_latin_hypercube_has_one_value_in_every_stratum_of_every_parameter():
    sample = ev.Samples({"a.b": ev.Uniform(2.0, 4.0), "a.c": ev.Normal(10.0, 3.0)}, count=200, seed=5)
    drawn = sample.draw()
    strata = [np.floor(200 * (drawn["a.b"] - 2.0) / 2.0)]
    share = [0.5 * (1.0 + math.erf((x - 10.0) / (3.0 * math.sqrt(2.0)))) for x in drawn["a.c"]]
    strata.append(np.floor(200 * np.array(share)))
    for found in strata:
        assert sorted(found) == list(range(200))
    assert not np.array_equal(*strata)
    # stratified: mean and deviation of 200 values far nearer than 1 / sqrt(200) of the deviation
    assert drawn["a.c"].mean() == pytest.approx(10.0, abs=0.02)
    assert drawn["a.c"].std() == pytest.approx(3.0, rel=0.02)


def test_random_samples_have_the_moments_of_a_truncated_normal():
    sample = ev.Samples(
        {"a.b": ev.Normal(0.0, 1.0, between=(-1.0, 1.0))}, count=100_000, seed=1, method="random"
    )
    x = sample.draw()["a.b"]
    # Johnson, Kotz and Balakrishnan: variance 1 - 2 phi(1) / (2 Phi(1) - 1)
    variance = 1.0 - 2.0 * math.exp(-0.5) / math.sqrt(2.0 * math.pi) / math.erf(math.sqrt(0.5))
    assert np.abs(x).max() <= 1.0
    assert x.mean() == pytest.approx(0.0, abs=4.0 * math.sqrt(variance / 1e5))
    assert x.var() == pytest.approx(variance, rel=0.02)


def test_a_stream_belongs_to_its_parameter_and_seed():
    one, two = ev.Uniform(0.0, 1.0), ev.Normal(0.0, 1.0)
    alone = ev.Samples({"a.b": one}, 10, seed=3, method="random").draw()["a.b"]
    beside = ev.Samples({"a.c": two, "a.b": one}, 20, seed=3, method="random").draw()["a.b"]
    np.testing.assert_array_equal(beside[:10], alone)
    assert not np.any(ev.Samples({"a.b": one}, 10, seed=4, method="random").draw()["a.b"] == alone)
    assert not np.any(ev.Samples({"a.d": one}, 10, seed=3, method="random").draw()["a.d"] == alone)


SAMPLED = "[samples]\ncount = 3\nseed = 1\n[samples.parameters]\n"
MISTAKES = [
    ("", "sweep: given nothing that varies; allowed: a grid or samples"),
    (
        "[grid]\nfriction = [0.1]",
        'grid.friction: given "friction"; allowed: surface.friction? TABLE.KEY of a scene file',
    ),
    ("[grid]\nsurface.friction = []", "grid.surface.friction: given no values; allowed: a list of values"),
    ("[grid]\nsurface.friction = 0.3", "grid.surface.friction: given 0.3; allowed: a list of values"),
    ("[grid]\nsurface.friction = [1979-05-27]", "allowed: numbers, text, true or false, and lists of them"),
    ("[grid]\ngrip = { a = 1 }", "grid.grip.a: given 1; allowed: a table {key = value, ...}"),
    ("[grid]\ngrip = { a = { x = 1 } }", 'grid.grip.a: given "x"; allowed: TABLE.KEY'),
    (
        "[grid.grip]\na = { surface.y = 1.0 }\nb = { surface.friction = 1.0 }",
        "grid.grip.b: given surface.friction; allowed: the keys of the first row: surface.y",
    ),
    (
        "[grid]\nsurface.friction = [0.1]\n[grid.grip]\na = { surface.friction = 1.0 }",
        "surface.friction: given the same column twice",
    ),
    ("[grid]\nsurface.friction = [0.1]\n[gird]", "gird: given an unknown key; allowed: grid?"),
    (
        "outputs = ['force.last']\n[grid]\nsurface.y = [0.1]",
        'outputs: force.last: given "force", no column; allowed: applied_force?',
    ),
    ("outputs = ['voltage']\n[grid]\nsurface.y = [0.1]", 'outputs: given "voltage"; allowed'),
    (
        "outputs = ['voltage.max.2']\n[grid]\nsurface.y = [0.1]",
        'given "voltage.max.2"; allowed: motions from 0 to 1',
    ),
    (SAMPLED, "samples.parameters: missing; allowed: at least one parameter"),
    (f"{SAMPLED}surface.y = 1.0", "samples.parameters.surface.y: given 1.0; allowed: { uniform"),
    (
        f"{SAMPLED}surface.y = {{ uniform = [2.0, 1.0] }}",
        "samples.parameters.surface.y.uniform: given 2 to 1",
    ),
    (f"{SAMPLED}surface.y = {{ normal = [2.0, 0.0] }}", "samples.parameters.surface.y.normal: given 0.0"),
    (f"{SAMPLED}surface.y = {{ normal = [2.0] }}", "samples.parameters.surface.y.normal: given [2.0]"),
    (
        f"{SAMPLED}surface.y = {{ between = [0.0, 1.0] }}",
        "samples.parameters.surface.y.uniform: given neither uniform nor normal",
    ),
    (SAMPLED.replace("seed = 1\n", "") + "surface.y = { normal = [0.0, 1.0] }", "samples.seed: missing"),
    (
        SAMPLED.replace("seed = 1", "seed = -1") + "surface.y = { normal = [0.0, 1.0] }",
        "samples.seed: given -1",
    ),
    (
        SAMPLED.replace("= 3", "= 300_000") + "surface.y = { normal = [0.0, 1.0] }",
        "samples.count: given 300000",
    ),
    (
        SAMPLED.replace("= 3", "= 60_000")
        + "surface.y = { normal = [0.0, 1.0] }\n[grid]\nfinger.width = [1, 2]",
        "sweep: given 120000 points; allowed: at most 100000 points",
    ),
]


@pytest.mark.parametrize(("body", "sentence"), MISTAKES)
def test_mistakes_are_one_sentence(body, sentence):
    caught = refuses("allowed", read, body)
    assert sentence in str(caught)
    assert "\n" not in str(caught)


@pytest.mark.parametrize(
    ("key", "sentence"),
    [
        ("motion.2.force", "motion.2: given no such entry; allowed: numbers from 0 to 1"),
        ("surface.friction.x", "surface.friction.x: given a key inside a value that is no table"),
    ],
)
def test_a_key_that_leads_nowhere(key, sentence):
    refuses(sentence, read(f'[grid]\n"{key}" = [1.0]').points)


def test_a_region_with_a_dot_in_its_name_is_told_so():
    """It was "finger.materials.pad: missing", of a region that the mesh does not have."""
    body = '[scene.finger.materials."pad.1"]\nE = 0.1\n[grid]\n"finger.materials.pad.1.E" = [0.1, 0.2]'
    sentence = (
        'finger.materials.pad.1.E: given "pad.1", a name with a dot, within a dotted key; allowed: anot'
    )
    refuses(f"^{sentence}", read(body).points)


@pytest.mark.parametrize(
    "text", ["version = 2", "scene = 3\nversion = 1", "version = 1", "[", "version = 1.0"]
)
def test_a_file_that_is_no_sweep(text):
    with pytest.raises(InputError):
        sweepfile.loads(text)


def test_a_key_that_varies_takes_the_place_of_what_it_is_given_instead_of():
    """A scene of Python has a voltage, and one of a file an amplitude, whatever the sweep asks for."""
    pad, screen = ev.FingerPad(ridges=False, resolution="coarse"), ev.Display(insulator=ev.TOUCHSCREEN)
    drive, press = ev.Drive(frequency=100.0), ev.Press(indentation=0.2, steps=1)
    scene = ev.Scene(pad, screen, ev.StrongTroxel(), 100.0, press, roughness_gap=0.005, drive=drive)
    grid = {"electrostatics.amplitude": [20.0], "motion.0.force": [0.07]}
    found = tomllib.loads(ev.Sweep(scene, grid=grid).points()[0].text)
    assert found["electrostatics"]["amplitude"] == 20.0
    assert "voltage" not in found["electrostatics"]
    assert found["motion"][0] == {"kind": "press", "steps": 1, "force": 0.07}
    both = ev.Sweep(scene, grid=grid | {"electrostatics.voltage": [10.0]})
    with pytest.raises(InputError, match="given voltage and amplitude"):
        ev.sweep(both, workers=1)

"""The keys of scenes and sweeps as rows and as JSON schemas: complete, and as strict as the reader
of the files, but not stricter.
"""

import importlib
import math
import pkgutil
import re
import tomllib
from contextlib import suppress
from dataclasses import fields, is_dataclass
from decimal import Decimal

import jsonschema
import pytest
import tomli_w
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem
from evfem import FingerPad, Grating, NeoHookean, Probe, templates
from evfem.common.checks import Within, keys_of
from evfem.common.units import SIZES, UNITS
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.scene import format as scenefile
from evfem.scene import schema as scenes
from evfem.scene.file import dump, load, loads
from evfem.scene.motion import MOTIONS
from evfem.scene.scene import default_scene
from evfem.sweeps import file as sweepfile
from evfem.sweeps import file as sweeps
from evfem.tissue.laws import LAWS

#: the largest seed of random numbers
SEEDS = 2**63 - 1
#: a scene for each table, with the dotted place of the table
SLIDE = """
version = 1
[finger]
[finger.electrical]
[surface]
kind = "sinusoid"
[electrostatics]
law = "kaczmarek"
voltage = 10.0
insulator_thickness = 0.1
insulator_eps_r = 3.0
[solver]
contact = "penalty"
penalty_normal = 1.0
penalty_tangential = 1.0
[solver.strategy]
[output]
[hand]
stiffness = 1.0
[[motion]]
kind = "press"
indentation = 0.1
[[motion]]
kind = "slide"
distance = 1.0
[[motion]]
kind = "hover"
gap = 0.1
[[motion]]
kind = "voltage"
voltage = 10.0
[[motion]]
kind = "wait"
duration = 1.0
"""
PLACES = {"press": 0, "slide": 1, "hover": 2, "voltage": 3, "wait": 4}
#: tables that `SLIDE` does not have
ELSEWHERE = ("finger.materials", "surface", "electrostatics.signal", "electrostatics.roughness_gap")
ELSEWHERE += ("electrostatics.voltage", "output.probes", "adhesion")


def judged(schema, text):
    """Mistakes that a schema finds in a TOML text."""
    return list(jsonschema.Draft7Validator(schema).iter_errors(tomllib.loads(text)))


@pytest.fixture(scope="module")
def scene_schema():
    jsonschema.Draft7Validator.check_schema(scenes.schema())
    return scenes.schema()


def test_every_key_says_what_it_is_and_what_is_allowed():
    for one in [*scenes.sections(), *sweeps.sections()]:
        for key in one.keys:
            assert key.meaning, key
            assert key.allowed, key


#: words that stand for a bound of 0
NOTHING = re.compile("not negative|above zero|positive|above 0|larger than 0")
#: keys whose words name a bound that is none of numbers: (class, key)
ELSE = {("Vibration", "friction_rms")}


def ranges():
    """(class, key) of every part of a scene, a sweep or a command, words and bounds of numbers in a range."""
    names = [one.name for one in pkgutil.walk_packages(evfem.__path__, "evfem.")]
    modules = [importlib.import_module(name) for name in names if "studies" not in name and "__" not in name]
    types = {part for module in modules for part in vars(module).values() if isinstance(part, type)}
    parts = [part for part in types if is_dataclass(part) and "Annotated" in str(fields(part))]
    for part in sorted(parts, key=lambda one: one.__name__):
        for key in keys_of(part):
            if isinstance(bounds := key.rule.get("test"), Within) and (part.__name__, key.name) not in ELSE:
                yield part.__name__, key.name, key.rule["allowed"], bounds


def test_the_words_of_a_range_have_its_bounds():
    tried = 0
    for part, key, words, bounds in ranges():
        if "whole number" in words and bounds.high == SEEDS:
            continue
        numbers = {float(one) for one in re.findall(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?", words)}
        numbers |= {-max(numbers)} if re.search("within|either way", words) else set()
        numbers |= {0.0} if NOTHING.search(words) else set()
        for bound in (bounds.low, bounds.high):
            assert math.isinf(bound) or bound in numbers, (part, key, words, bound)
        outside = bool(re.search("above|larger than|positive", words))
        assert bounds.above == outside, (part, key, words)
        tried += 1
    assert tried > 100


def test_the_defaults_are_those_of_a_scene(scene_schema):
    """Every default of the schema, written into a file, makes the scene that the bare file makes."""
    exact = SLIDE.replace('contact = "penalty"\npenalty_normal = 1.0\npenalty_tangential = 1.0\n', "")
    tried = 0
    for one in scenes.sections():
        elsewhere = one.name.startswith(ELSEWHERE) or one.kind == "mesh"
        bare = loads(put(one, "kind", "fingertip", exact) if one.kind == "fingertip" else exact)
        for key in () if elsewhere else one.keys:
            if "default" in key.schema:
                text = put(one, key.name, key.schema["default"], exact)
                assert loads(text) == bare, (one.name, key.name)
                assert judged(scene_schema, text) == []
                tried += 1
    assert tried > 40


def test_values_may_be_texts_with_a_unit(scene_schema):
    """Every number that has a length, time, voltage, ... may be a text with another unit of it: the same
    scene to the last bit, by the schema and by the reader.
    """
    tried = set()
    for one in scenes.sections():
        for key in () if one.name.startswith(ELSEWHERE) or one.kind == "mesh" else one.keys:
            if "string" not in key.schema.get("type", ()) or "minimum" not in key.schema:
                continue
            low, high = (Decimal(str(key.schema.get(side, 1e3))) for side in ("minimum", "maximum"))
            value = (3 * low + high) / 4
            with suppress(InputError):  # where one key is not enough, as for a voltage that changes
                scene = loads(put(one, key.name, float(value)))
                for unit, size in SIZES[UNITS[key.unit][0]].items():
                    if key.unit != "rad" and 1.0 / size % 10.0 in (0.0, 1.0):
                        text = put(one, key.name, f"{value / Decimal(str(size))} {unit}")
                        assert judged(scene_schema, text) == []
                        assert loads(text) == scene, (one.name, key.name, unit)
                        tried.add((one.name, one.kind, key.name))
    assert len(tried) > 30


@pytest.mark.parametrize(
    ("key", "text", "allowed"),
    [
        ("width", "18 furlong", "12 to 24 mm, with mm | um | "),
        ("width", "18 ms", "12 to 24 mm, with mm | um | "),
        ("width", "30 mm", "12 to 24 mm"),
        ("width", "18", "a number without quotes and unit, 12 to 24 mm"),
        ("ridge_phase", "0.1 mm", "a number without quotes and unit"),
    ],
)
def test_texts_of_another_unit_are_refused(key, text, allowed):
    assert refuses(re.escape(allowed), FingerPad, **{key: text}).key == f"finger.{key}"


def test_units_are_those_of_physics():
    """An angle, a field, a density, a conductivity against values that are known otherwise."""
    assert Grating(period="2 mm", groove_depth="0.1 mm", angle="0.5236 rad").angle == pytest.approx(30, 1e-4)
    water = NeoHookean(E="160 kPa", nu=0.45, density="1 g/cm3")
    assert (water.E, water.density) == (0.16, 1e-9)  # t/mm3
    assert Probe(x=["-150 um", 0.2], depth="1 mm").x == (-0.15, 0.2)


def put(section, key, value, text=SLIDE):
    """A scene's text with one key of a section set."""
    tables = tomllib.loads(text)
    table = tables["motion"][PLACES[section.kind]] if section.name == "motion" else tables
    for part in section.name.split(".") if section.name not in ("", "motion") else ():
        table = table[part]
    if section.kind == "fingertip":
        table["kind"] = "fingertip"
    table[key] = value
    return tomli_w.dumps(tables)


@pytest.mark.parametrize("side", ["minimum", "exclusiveMinimum", "maximum", "not"])
def test_what_the_schema_refuses_the_reader_refuses(scene_schema, side):
    """Beyond each limit both refuse; a schema that is stricter than the reader would be a lie."""
    tried = 0
    for one in scenes.sections():
        if one.name.startswith(ELSEWHERE) or one.kind == "mesh":
            continue
        for key in one.keys:
            if side not in key.schema:
                continue
            limit = 0 if side == "not" else key.schema[side]
            step = {"minimum": -1, "maximum": 1}.get(side, 0)
            text = put(one, key.name, limit + step)
            assert judged(scene_schema, text), (one.name, key.name)
            assert refuses("allowed", loads, text).key.endswith(key.name)
            tried += 1
    assert tried >= {"minimum": 30, "exclusiveMinimum": 5, "maximum": 30, "not": 1}[side]


def test_words_that_are_no_choice_are_refused_by_both(scene_schema):
    tried = 0
    for one in scenes.sections():
        for key in one.keys:
            if "enum" in key.schema and one.kind != "mesh" and not one.name.startswith(ELSEWHERE):
                assert key.allowed == " | ".join(key.schema["enum"]), key
                assert judged(scene_schema, put(one, key.name, "no such word"))
                with pytest.raises(InputError):
                    loads(put(one, key.name, "no such word"))
                tried += 1
    assert tried >= 8


def test_scenes_that_are_read_are_valid_and_misspelt_ones_are_not(scene_schema, tmp_path):
    meshfile.write(square_mesh("quad"), tmp_path / "pad.vtu")
    sine = '{ kind = "sine", frequency = 9, amplitude = 5 }'
    hum = f'signal = {{ kind = "carrier", frequency = 1e4, envelope = {sine} }}'
    texts = [
        SLIDE,
        SLIDE.replace("voltage = 10.0", hum, 1),
        SLIDE.replace("[finger]", "[finger]\nparticipant = 'ii'"),
    ]
    texts += [SLIDE + "[finger.materials.dermis]\nE = 0.1\n"]
    texts += [dump(default_scene()), *(templates.text(name) for name in templates.TEMPLATES)]
    assert [judged(scene_schema, text) for text in texts] == [[]] * len(texts)
    for wrong in ("frictoin = 0.3", "kind = 3"):
        assert judged(scene_schema, templates.text("hover").replace('kind = "flat"', wrong))
    for missing in ("version = 1", '[[motion]]\nkind = "hover"\ngap = 0.2', 'law = "strong_troxel"'):
        text = templates.text("hover").split('[[motion]]\nkind = "voltage"')[0].replace(missing, "")
        assert judged(scene_schema, text), missing


def test_sweeps_have_their_schema():
    schema = sweeps.schema()
    jsonschema.Draft7Validator.check_schema(schema)
    inner = SLIDE.replace("version = 1", "").replace("[[motion]]", "[[scene.motion]]")
    for table in ("finger", "surface", "electrostatics", "hand", "solver", "output"):
        inner = inner.replace(f"\n[{table}", f"\n[scene.{table}")
    grid = "[grid]\nsurface.friction = [0.1, 0.2]\n"
    samples = "[samples]\ncount = 3\nseed = 1\n[samples.parameters]\nsurface.y = { normal = [-9.0, 0.1] }\n"
    for text in (f"version = 1\n{inner}{grid}", f"version = 1\n{inner}{samples}"):
        assert judged(schema, text) == []
        sweepfile.loads(text)
    for wrong in (
        f"version = 1\n{inner}{samples}".replace("count = 3", "count = 0"),
        f"version = 1\n{inner}{grid}".replace("insulator_eps_r = 3.0", "insulator_eps_r = 0.3"),
        grid,
    ):
        assert judged(schema, wrong)


@pytest.mark.parametrize("name", templates.TEMPLATES)
def test_what_a_template_comments_out_is_a_default(name, tmp_path):
    """Each line `#key = value` names a key of its table, and its value is the default, if it has one."""
    section, checked = "", 0
    tables = {one.name: {} for one in scenes.sections()}
    for one in scenes.sections():
        for key in one.keys:
            tables[one.name].setdefault(key.name, []).append(key)
    for line in templates.text(name).splitlines():
        if line.startswith(("[", "#[")):
            section = line.lstrip("#").split("#")[0].strip().strip("[]")
            section = "finger.materials.NAME" if section.startswith("finger.materials.") else section
        elif line.startswith("#") and " = " in line and not line.startswith("# "):
            key, value = next(iter(tomllib.loads(line[1:]).items()))
            found = tables[section][key]
            defaults = [one.schema["default"] for one in found if "default" in one.schema]
            assert not defaults or value in defaults, line
            checked += 1
    assert checked >= 2


@pytest.mark.parametrize("name", templates.TEMPLATES)
def test_a_template_names_every_kind(name):
    """A comment `one | two | ...` beside a kind or a law has all there are."""
    text = templates.text(name)
    for kinds in (scenefile.SURFACES, MOTIONS, LAWS):
        for line in text.splitlines():
            told = set(re.findall(r"\w+", line.rpartition("#")[2])) & set(kinds)
            assert len(told) < 3 or told == set(kinds), line


def test_a_template_makes_a_scene_and_overwrites_nothing(tmp_path):
    for name in templates.TEMPLATES:
        path = tmp_path / f"{name}.toml"
        written = templates.write(name, path)
        assert load(path).total_steps > 5
        before = {file: file.read_bytes() for file in tmp_path.iterdir()}
        for file in written:
            others = [one for one in written if one != file]
            for one in others:
                one.unlink()
            refuses("which exists; allowed: a file that is not there yet", templates.write, name, path)
            assert all(not one.exists() for one in others)
            for one in others:
                one.write_bytes(before[one])
    refuses(r'--template: given "none"; allowed: display \| touchscreen', templates.text, "none")

"""Scene files: an example loads, what is written is read back, mistakes get one sentence."""

import pickle
import traceback
from dataclasses import replace

import numpy as np
import pytest
from tools.meshes import square_mesh
from tools.refusals import refuses

import evfem as ev
from evfem.mesh import file as meshfile
from evfem.scene.file import dump, load, loads

DISPLAY = """
version = 1
[finger]                          # all optional: Table 2
width = 16.68                     # full width and height of the cross-section
height = 12.79
ridges = true
ridge_height = 0.15
ridge_width = 0.50                # the pitch; crests lie on the ellipse, grooves ridge_height inside it
ridge_exponent = 7.0              # crest: depth = ridge_height * t**exponent, t = |x - crest| / (pitch/2)
ridge_phase = 0.0                 # in pitches: 0 = a crest in the middle, 0.5 = a groove
resolution = "medium"
[surface]
kind = "flat"                     # flat | sinusoid | profile
friction = 0.3                    # or [[x, mu], ...]
[electrostatics]                  # leave the table out when there is no voltage
law = "kaczmarek"                 # strong_troxel | kaczmarek
voltage = 1000.0                  # or voltage_file = "voltage.csv" (header: position,voltage)
insulator_thickness = 0.09
insulator_eps_r = 3.35
air_layer = true                  # false: only touching nodes carry force, eq. (10)
direction = "vertical"            # vertical (the paper) | normal
coupling = "monolithic"           # without effect, of files of 0.3
[[motion]]
kind = "press"                    # press | slide | hover | voltage
force = 0.05                      # or indentation = 1.5
steps = 10
[[motion]]
kind = "slide"
distance = 5.0
steps = 100
hold = "indentation"              # default; or "force"
"""

OWN_MESH = """
version = 1
[finger]
mesh = "pad.vtu"
[finger.regions]
tissue = 0
skin = 1
[finger.materials.tissue]
law = "neo_hookean"
E = 0.05
nu = 0.48
[finger.materials.skin]
law = "neo_hookean"
E = 1.0
nu = 0.30
[finger.electrical]
stratum_corneum_thickness = 0.38
stratum_corneum_eps_r = 1650.0
[surface]
kind = "flat"
y = -6.395
friction = 0.0
[solver]
element = "q1"
[[motion]]
kind = "press"
indentation = 1.5
steps = 15
"""

SHORT = "version = 1\n[surface]\nkind = 'flat'\n[[motion]]\nkind = 'press'\nforce = 0.05\n"
TEXTURE = SHORT + "[[motion]]\nkind = 'slide'\ndistance = 4.0\nspeed = 20.0\n"
TEXTURE += "[finger]\nviscosity = 1.0e-3\n[solver]\ndynamics = 'viscous'\n"
DEEP = "[finger]\ndepth = 10\n"


@pytest.fixture
def folder(tmp_path):
    """A folder with a mesh, a voltage and a profile."""
    meshfile.write(square_mesh("quad"), tmp_path / "pad.vtu")
    (tmp_path / "voltage.csv").write_text("position,voltage\n0,0\n5,100\n")
    (tmp_path / "scan.csv").write_text("x,height\n-10,0\n0,0.01\n10,0\n")
    return tmp_path


def test_the_first_example_is_the_default_scene():
    scene = loads(DISPLAY)
    assert scene.digest() == ev.default_scene().digest()
    assert scene.motion == (ev.Press(force=0.05, steps=10), ev.Slide(distance=5.0, steps=100))


def test_a_file_gives_its_name_and_folder(folder):
    (folder / "my scan.toml").write_text(
        "version = 1\n[surface]\nkind='profile'\nfile='scan.csv'\n[electrostatics]\nlaw='strong_troxel'\n"
        "voltage_file='voltage.csv'\ninsulator_thickness=0.1\ninsulator_eps_r=3\n[[motion]]\nkind='hover'\ngap=1\n"
    )
    scene = load(folder / "my scan.toml")
    assert scene.name == "my scan"
    assert scene.voltage(2.5) == 50.0
    assert float(scene.surface.height(np.array(0.0))) == 0.01
    assert (scene.law, scene.surface.insulator) == (ev.StrongTroxel(), ev.Layer(0.1, 3.0))
    assert scene.motion == (ev.Hover(gap=1.0),)


def test_a_participant_of_table_1_may_stand_in_a_file():
    """Other keys say what is different from it."""
    text = SHORT + "[finger]\nparticipant = 'iii'\nresolution = 'coarse'\nbone_offset = 0.5\n"
    assert loads(text).finger == replace(ev.FingerPad.participant("iii", "coarse"), bone_offset=0.5)


def test_a_material_of_table_2_may_be_changed_in_one_of_its_moduli():
    text = SHORT + "[finger.materials]\ndermis.E = 0.06\nnail.nu = 0.2\nhypodermis.viscosity = 0.1\n"
    laws = loads(text).finger.materials
    assert laws["dermis"] == ev.NeoHookean(E=0.06, nu=0.48)
    assert laws["nail"] == ev.NeoHookean(E=17.0, nu=0.2)
    assert laws["hypodermis"] == ev.NeoHookean(E=0.034, nu=0.48, viscosity=0.1)
    assert laws["epidermis"] == ev.FingerPad().materials["epidermis"]


def scenes(folder):
    """Scenes that use everything a file can hold."""
    laws = {"nail": ev.LinearElastic(E=20.0, nu=0.3), "dermis": ev.NeoHookean(E=0.1, nu=0.4, viscosity=1e-3)}
    press = ev.Press(indentation=1.0, steps=3, speed=2.0)
    profile = ev.Profile([0.0, 0.1, 1.0], [0.0, 0.2, 0.1], friction=[[0.0, 0.1], [0.0, 0.3]], y=-7.0)
    voltage = ev.VoltageProfile([0.0, 1.0, 1.0], [0.0, 100.0 / 3.0, 7.0])
    tissue = {
        "soft": ev.Yeoh(c1=0.1, c2=0.01, c3=0.001, nu=0.4),
        "hard": ev.Ogden(mu=[0.1], alpha=[2.0], nu=0.4),
    }
    own = ev.MeshedFinger(folder / "pad.vtu", tissue, ev.Electrical(0.4), viscosity=0.01)
    insulated = ev.Sinusoid(friction=0.1, terms=[[0.1, 2.0, 0.3]], insulator=ev.Layer(0.1 / 3, 3.0))
    yield ev.default_scene()
    yield ev.Scene(
        ev.FingerPad(width=16.0, ridges=False, materials=laws), ev.Flat(friction=0.0), motion=[press]
    )
    yield ev.Scene(
        ev.FingerPad(electrical=ev.Electrical(0.3)), profile, motion=[press, ev.Slide(-1.0, speed=3.0)]
    )
    yield ev.Scene(own, insulated, ev.Kaczmarek(gap_eps_r=2.0), voltage, [ev.Hover(0.5)], direction="normal")
    yield ev.Scene(
        ev.FingerPad(viscosity=0.1),
        ev.Display(friction=0.1 + 0.2),
        ev.StrongTroxel(),
        motion=[ev.VoltageRamp(0.1, steps=1)],
        air_layer=False,
        solver=ev.Solver("q1", "inertial", "penalty", 10.0, 2.0, 1e-6, 2),
        output=ev.Output(3),
    )
    grooves = ev.Grating(1.0, 0.05, groove_width=0.4, phase=0.1, insulator=ev.Layer(0.1, 3.0))
    closing = ev.VoltageRamp(gap=0.05, hold="force")
    yield ev.Scene(ev.FingerPad(), grooves, ev.Kaczmarek(), 100.0, [press, closing])
    rough = ev.SelfAffine(0.7, 0.01, 5.0, 0.2, longest=2.0, seed=4, friction=[[0.0, 0.1], [1.0, 0.2]], y=-7.0)
    yield ev.Scene(ev.FingerPad(), rough, motion=[press])
    ended = ev.Display(electrodes=[[-20.0, -0.1, 1.0], [0.1, 20.0, 0.0]])
    yield ev.Scene(ev.FingerPad(), ended, ev.StrongTroxel(), 10.0, [press], field="full", grounded=False)
    yield ev.Scene(ev.FingerPad(), ev.Display(), ev.StrongTroxel(), 10.0, [press], field="auto")


@pytest.mark.parametrize("number", range(9))
def test_what_is_written_is_read_back(folder, number):
    scene = list(scenes(folder))[number]
    text = dump(scene)
    assert loads(text).digest() == scene.digest()
    assert dump(loads(text)) == text


def test_the_depth_stands_with_the_finger(folder):
    for text in (SHORT, OWN_MESH):
        with_depth = text.replace("[finger]", "[finger]\ndepth = 10") if "[finger]" in text else text + DEEP
        scene = loads(with_depth, folder)
        assert scene.depth == 10.0
        assert replace(scene, depth=None).digest() == loads(text, folder).digest()
        assert loads(dump(scene)).digest() == scene.digest()
    with pytest.raises(ev.InputError, match=r"finger.depth: given -1; allowed: a depth in mm, larger than 0"):
        loads(SHORT + DEEP.replace("10", "-1"))


@pytest.mark.parametrize(("name", "layer"), [("film", (0.09, 3.35)), ("touchscreen", (0.001, 3.9))])
def test_insulators_have_names(name, layer):
    own = "insulator_thickness = 0.09\ninsulator_eps_r = 3.35\n"
    assert own in DISPLAY
    scene = loads(DISPLAY.replace(own, f'insulator = "{name}"\n'))
    assert scene.surface.insulator == ev.Layer(*layer)
    assert loads(dump(scene)).digest() == scene.digest()
    with pytest.raises(
        ev.InputError, match=f"electrostatics.insulator_eps_r: given 3 beside insulator = {name}"
    ):
        loads(DISPLAY.replace(own, f'insulator = "{name}"\ninsulator_eps_r = 3.0\n'))
    with pytest.raises(
        ev.InputError, match=r'electrostatics.insulator: given "glass"; allowed: film \| touchscreen'
    ):
        loads(DISPLAY.replace(own, 'insulator = "glass"\n'))


@ev.form
def spring(u, v, w):
    return u * v


class Own:
    """A user's law, of forces and of materials."""

    viscosity = None

    def traction(self, gap, voltage, layers):
        return gap

    def psi(self, F):
        return F


def test_what_a_file_cannot_hold_is_refused(folder):
    scene = ev.default_scene()
    mesh = square_mesh()
    law = ev.NeoHookean(E=1.0, nu=0.3)
    laws = {"soft": law, "hard": law}
    cannot = {
        "forms": scene.with_term(spring, on=ev.Boundary("nail")),
        "electrostatics.law": ev.Scene(scene.finger, scene.surface, Own(), 1.0, scene.motion),
        "finger.mesh": ev.Scene(ev.MeshedFinger(mesh, laws), ev.Flat(), motion=scene.motion),
        "finger.materials.hard": ev.Scene(
            ev.MeshedFinger(folder / "pad.vtu", laws | {"hard": Own()}), ev.Flat(), motion=scene.motion
        ),
    }
    for key, wrong in cannot.items():
        assert refuses("allowed", dump, wrong).key == key


FLAT, LOAD = "kind = 'flat'", "force = 0.05"
MESH, VOLTS, ROUGH = 'mesh = "pad.vtu"', "voltage = 1000.0", "electrostatics.roughness_gap"
PRESSED = "[[motion]]\nkind = 'press'\nforce = 0.05"
#: (example, what is replaced, by what, or by itself and more lines, the key in the sentence, words of the
#: sentence); limits and words of every key are those of `test_schema`
WRONG = [
    (SHORT, "version = 1", "", "version", "version: missing; allowed: version = 1"),
    (SHORT, "version = 1", "version = 2", "version", "given 2"),
    (SHORT, "version = 1", "version = true", "version", "given true"),
    (SHORT, "version = 1", "version = 1.0", "version", "given 1.0"),
    (SHORT, "version = 1", "\nspeed = 3", "speed", "an unknown key"),
    (SHORT, "version = 1", "\ndepth = 10", "depth", "allowed: depth in [finger]? (version"),
    (SHORT, "version = 1\n", "version = 1\nmotion = []\n", "scene", "TOML"),
    (SHORT, "version = 1", "version = ", "scene", "no valid TOML"),
    (SHORT, "version = 1", "\na = " + "[" * 5000, "scene", "no valid TOML"),
    (SHORT, "version = 1", "version = " + "1" * 5000, "scene", "no valid TOML"),
    (SHORT, "[surface]", "[surfaces]", "surfaces", "an unknown key; allowed: surface? (version"),
    (SHORT, "[surface]\nkind = 'flat'", "", "surface", "missing; allowed:"),
    (SHORT, "[surface]\nkind = 'flat'", "surface = 'flat'", "surface", 'given "flat"'),
    (SHORT, FLAT, "", "surface.kind", "flat | sinusoid | profile"),
    (SHORT, FLAT, "kind = 'round'", "surface.kind", 'given "round"'),
    (SHORT, FLAT, "kind = 3", "surface.kind", "given 3"),
    (SHORT, FLAT, "kind = 'grating'", "surface.period", "missing; allowed: a length in mm"),
    (SHORT, FLAT, "kind = 'self_affine'\nhurst = 2\nrms = 0.01", "surface.hurst", "a Hurst exponent from 0"),
    (SHORT, FLAT, "kind = 'self_affine'\nhurst = 0.5\nrms = 0.01\nseed = 0.5", "surface.seed", "given 0.5"),
    (SHORT, FLAT, "\nfrictoin = 0.3", "surface.frictoin", "allowed: friction?"),
    (SHORT, FLAT, "\nterms = []", "surface.terms", "an unknown key"),
    (SHORT, FLAT, "\ninsulator = 'film'", "surface.insulator", "insulator in [electrostatics]? ("),
    (SHORT, FLAT, "\nfriction = -0.3", "surface.friction", "given -0.3"),
    (SHORT, FLAT, "\nfriction = [[1, 1], [0, 1]]", "surface.friction", "not decreasing"),
    (SHORT, FLAT, "\nfriction_law = 0.3", "surface.friction_law", "given 0.3; allowed: a table"),
    (SHORT, FLAT, "\nfriction_law = {kind = 'glue'}", "surface.friction_law.kind", "coulomb | load_index | "),
    (SHORT, FLAT, "\nfriction_law = {kind = 'adhesive'}", "surface.friction_law.strength", "missing"),
    (SHORT, FLAT, "\nfriction_law = {kind = 'ageing', fresh = 2.0}", "surface.friction_law.fresh", "0 to 1"),
    (SHORT, FLAT, "kind = 'sinusoid'\nterms = [[1, 2]]", "surface.terms", "wavenumber"),
    (SHORT, FLAT, "kind = 'profile'", "surface.file", "missing; allowed:"),
    (SHORT, FLAT, "kind = 'profile'\nfile = 'none.csv'", "surface.file", "No such file"),
    (SHORT, FLAT, "kind = 'profile'\nfile = 'voltage.csv'", "surface.file", "x,height"),
    (SHORT, FLAT, "kind = 'profile'\nfile = '.'", "surface.file", "no file"),
    (SHORT, FLAT, "kind = 'profile'\nfile = 'pad.vtu'", "surface.file", "x,height"),
    (SHORT, FLAT, "kind = 'profile'\npoints = [[1]]", "surface.points[0]", "two numbers"),
    (SHORT, PRESSED, "", "motion", "missing; allowed:"),
    (SHORT, PRESSED, "[motion]\nkind = 'press'", "motion", "[[motion]]"),
    (SHORT, PRESSED, "[motion]\n[motion]", "scene", "; each motion is a table [[motion]]"),
    (SHORT, FLAT, "kind = 'profile'\nfile = 'voltage.csv'", "surface.file", ", or x [mm],height [mm]"),
    (SHORT, LOAD, "\n[[motion]]\nkind = 'jump'", "motion[1].kind", "press | slide"),
    (SHORT, LOAD, "", "motion[0].force", "neither force nor indentation"),
    (SHORT, LOAD, "\nindentation = 1", "motion[0].force", "force and indentation"),
    (SHORT, LOAD, "force = '0.05'", "motion[0].force", 'given "0.05"'),
    (SHORT, LOAD, "force = 1" + "0" * 400, "motion[0].force", "N/mm"),
    (SHORT, LOAD, "force = 1e999", "motion[0].force", "given inf"),
    (SHORT, LOAD, "force = 1979-05-27", "motion[0].force", "N/mm"),
    (SHORT, LOAD, "\nsteps = 2.5", "motion[0].steps", "given 2.5"),
    (SHORT, LOAD, "\ndistance = 2", "motion[0].distance", "an unknown key"),
    (SHORT, LOAD, "\n[solver]\ncontact='penalty'", "solver.penalty_normal", "missing"),
    (SHORT, LOAD, "\n[finger]\nwidht = 3", "finger.widht", "width?"),
    (SHORT, LOAD, "\n[finger]\nridges = 1", "finger.ridges", "given 1"),
    (SHORT, LOAD, "\n[finger]\nridges = 'whorl'", "finger.ridges", 'kind = "fingertip"'),
    (
        SHORT,
        LOAD,
        "\n[finger]\nwidth = '18'",
        "finger.width",
        "allowed: a number without quotes and unit, 12",
    ),
    (SHORT, LOAD, "\n[finger]\nwidth = 'wide'", "finger.width", "allowed: a number, 12 to 24 mm"),
    (SHORT, LOAD, "force = '0.5 N'", "motion[0].force", "allowed: a number without quotes and unit, a force"),
    (SHORT, LOAD, "load = 0.05", "motion[0].load", "allowed: force? (kind,"),
    (SHORT, LOAD, "\n[finger]\ntilt = 30", "finger.tilt", "posture with kind = fingertip? (kind, width"),
    (SHORT, FLAT, "\nperiod = 1.0", "surface.period", "period with kind = grating | self_affine? ("),
    (
        SHORT,
        FLAT,
        "\nfriction_law = {kind = 'ageing', index = 2}",
        "surface.friction_law.index",
        "load_index",
    ),
    (SHORT, LOAD, LOAD + "\n" + LOAD, "scene", "each key once"),
    (SHORT, LOAD, "\n[finger.materials.Dermis]\nE=1", "finger.materials.Dermis", "allowed: dermis? ("),
    (SHORT, LOAD, "\n[finger.materials.dermis]\ne=1", "finger.materials.dermis.e", "allowed: E? (law,"),
    (SHORT, LOAD, "\n[finger]\nmaterials = 3", "finger.materials", "given 3"),
    (SHORT, LOAD, "\n[finger]\nmesg = 'pad.vtu'", "finger.mesg", "mesh? (kind,"),
    (SHORT, LOAD, "\n[finger.materials]\ndermis=3", "finger.materials.dermis", "given 3"),
    (
        SHORT,
        LOAD,
        "\n[finger.materials.skin]\nlaw='neo_hookean'\nE=1\nnu=0.3",
        "finger.materials.skin",
        "dermis",
    ),
    (DISPLAY, 'law = "kaczmarek"', "", "electrostatics.law", "missing; allowed:"),
    (DISPLAY, 'law = "kaczmarek"', "gap_eps_r = 2.0", "electrostatics.law", "missing; allowed:"),
    (DISPLAY, "air_layer =", "air_laye =", "electrostatics.air_laye", "allowed: air_layer? (law, voltage,"),
    (DISPLAY, VOLTS, "", "electrostatics.voltage", "missing; allowed:"),
    (DISPLAY, VOLTS, "voltage = '1 kN'", "electrostatics.voltage", 'given "1 kN"'),
    (DISPLAY, VOLTS, "voltage = 1\nvoltage_file = 'voltage.csv'", "electrostatics.voltage", "exactly"),
    (DISPLAY, VOLTS, "voltage_file = 'scan.csv'", "electrostatics.voltage_file", "position,voltage"),
    (DISPLAY, "insulator_thickness = 0.09", "", "electrostatics.insulator_thickness", "missing; allowed:"),
    (DISPLAY, VOLTS, "\nroughness_gap = -0.1", "electrostatics.roughness_gap", "given -0.1; allowed: a"),
    (DISPLAY, VOLTS, "\nroughness_gap = {law = 'linear'}", f"{ROUGH}.law", "constant | power | exponential"),
    (DISPLAY, VOLTS, "\nroughness_gap = {law = 'power', gap = 0.1}", f"{ROUGH}.pressure", "missing"),
    (DISPLAY, VOLTS, "\nroughness_gap = {law = 'constant', gap = 5.0}", f"{ROUGH}.gap", "given 5"),
    (OWN_MESH, MESH, 'mesh = "none.vtu"', "finger.mesh", "No such file"),
    (OWN_MESH, MESH, "mesh = 3", "finger.mesh", "given 3"),
    (OWN_MESH, MESH, "\nwidth = 16.0", "finger.width", "no geometry keys"),
    (OWN_MESH, MESH, '\nparticipant = "i"', "finger.participant", "no geometry"),
    (OWN_MESH, "tissue = 0", "tissue = 'zero'", "finger.regions", "tissue = zero"),
    (OWN_MESH, "E = 0.05", "E = -0.05", "finger.materials.tissue.E", "given -0.05"),
    (OWN_MESH, "ness = 0.38", "ness = 0", "finger.electrical.stratum_corneum_thickness", "larger than 0"),
    (TEXTURE, "speed = 20.0", "", "motion[1].speed", "dynamics = viscous"),
    (TEXTURE, "viscosity = 1.0e-3", "", "finger.viscosity", "dynamics = viscous"),
]


@pytest.mark.parametrize(("text", "old", "new", "key", "words"), WRONG)
def test_each_mistake_gets_one_sentence_with_its_key(text, old, new, key, words, folder):
    assert old in text
    with pytest.raises(ev.InputError) as caught:
        loads(text.replace(old, old + new if new.startswith("\n") else new, 1), folder)
    sentence = str(caught.value)
    assert words in sentence
    assert "\n" not in sentence
    assert len(sentence) < 600
    assert caught.value.key == key


def test_mistakes_in_different_places_are_reported_at_once(folder):
    text = DISPLAY.replace("friction = 0.3", "frictoin = 0.3\ny = 'high'").replace(
        "force = 0.05", "force = -1"
    )
    text = text.replace('law = "kaczmarek"', "").replace(
        "distance = 5.0\nsteps = 100", "distance = 0\nsteps = 0"
    )
    text = text.replace("width = 16.68", "width = 500\nwidht = 3\nparticipant = 'xx'").replace(
        "height = 12.79", "height = '12'", 1
    )
    caught = refuses("allowed", loads, text, folder)
    keys = [mistake.key for mistake in caught.mistakes]
    assert keys == [
        *("finger.participant", "finger.widht", "finger.width", "finger.height", "electrostatics.law"),
        *("surface.frictoin", "surface.y", "motion[0].force", "motion[1].distance", "motion[1].steps"),
    ]
    sentence = str(caught)
    assert sentence.startswith('10 mistakes: (1) finger.participant: given "xx"; allowed: i | ii')
    assert "(2) finger.widht: given an unknown key; allowed: width?" in sentence
    assert sentence.endswith(" more")
    assert "\n" not in sentence
    again = pickle.loads(pickle.dumps(caught))
    assert (str(again), again.mistakes[4].given) == (sentence, caught.mistakes[4].given)


def test_what_an_unknown_key_may_stand_for_is_not_said_to_be_missing(folder):
    caught = refuses("allowed", loads, DISPLAY.replace("law =", "lwa ="), folder)
    assert [mistake.key for mistake in caught.mistakes] == ["electrostatics.lwa"]


def test_a_key_of_another_motion_is_not_told_that_it_stands_in_motion():
    caught = refuses("allowed", loads, SHORT + "distance = 1.0\n")
    assert caught.key == "motion[0].distance"
    assert "distance with kind = slide? (" in str(caught)


@pytest.mark.parametrize("text", ["finger = { width = -3.0 }", "finger = { mesh = 'none.vtu' }", ""])
def test_a_mistake_has_one_traceback_of_few_lines(text):
    """What found the mistake inside, and what was raised on the way, says nothing to who made it."""
    with pytest.raises(ev.InputError) as caught:
        loads(f"version = 1\nsurface = {{ kind = 'flat' }}\n{text}")
    told = "".join(traceback.format_exception(caught.value))
    assert told.count("Traceback") == 1
    assert told.count("File ") <= 5

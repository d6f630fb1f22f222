"""The recipes that change files of the package are put into a copy of it, which then runs.

A mark says where a block goes: `into FILE before WORDS` or `instead of WORDS`, the words being once in
the file, at the beginning of a line, however they are spaced there.
"""

import re
import shutil
from pathlib import Path
from textwrap import indent

import pytest
from docs.test_pages import DOCS, blocks
from tools.commands import printed

import evfem

PLACE = re.compile(r"not run: into (?P<file>\S+) (?P<how>before|instead of) (?P<words>.+)")
PAGE = "howto/extend.md"
RECIPES = [(found, text, line) for _, text, mark, line in blocks(PAGE) if (found := PLACE.match(mark or ""))]

LAYER = """
moduli = {"fascia": ev.NeoHookean(E=0.3, nu=0.4)}
for kind in (ev.FingerPad, ev.Fingertip):
    usual = kind(ridges=False, resolution="coarse")
    mesh = usual.mesh()
    assert mesh.region_names["fascia"] == 5 and (mesh.region == 5).any(), kind
    assert usual.materials["fascia"].E == 0.5
    kind(ridges=False, resolution="coarse", fascia_thickness=0.5, materials=moduli)
    try:
        kind(fascia_thickness=0.7)
    except ev.InputError as error:
        assert "finger.fascia_thickness: given 0.7; allowed: 0.1 to 0.6 mm" in str(error), error
    else:
        raise AssertionError("0.7 mm are taken")
tip = ev.Fingertip(ridges=False, resolution="coarse")
result = ev.simulate(ev.Scene(tip, ev.Flat(), motion=ev.Press(indentation=0.1, steps=1)))
assert result.normal_force[-1] > 0.0
"""
COLUMN = """
pad = ev.FingerPad(ridges=False, resolution="coarse")
surface = ev.Flat(friction=0.3, y=-7.0)
result = ev.simulate(ev.Scene(pad, surface, motion=[ev.Hover(gap=0.1), ev.Press(indentation=0.1, steps=1)]))
assert abs(result.lowest_point[-1] + 7.0) < 1e-9, result.lowest_point  # it lies on the surface
result.to_csv("history.csv")
assert "lowest_point" in open("history.csv").readline()
result.save("run.npz")
assert ev.load("run.npz").lowest_point[-1] == result.lowest_point[-1]
"""
WAVEFORM = """
import numpy as np
from evfem.electrostatics.timesignals import SIGNALS
wave = SIGNALS["triangle"](frequency=50.0, amplitude=3.0)
time = (np.arange(20000) + 0.5) / 20000 / 50.0
effective, order, share = wave.powers()
assert abs(np.sqrt(np.mean(wave(time) ** 2)) - effective) < 1e-6  # amplitude over the root of 3
assert abs(share.sum() - 1.0) < 1e-12
text = '''
version = 1
[finger]
ridges = false
resolution = "coarse"
[surface]
kind = "flat"
[electrostatics]
law = "strong_troxel"
insulator = "film"
voltage = 100.0
frequency = 50.0
waveform = "triangle"
[[motion]]
kind = "hover"
gap = 0.2
'''
scene = ev.scenefile.loads(text)
assert abs(scene.drive.peak(100.0) - 100.0 * 3**0.5) < 1e-9
assert ev.simulate(scene).electrostatic_force[-1] > 0.0
"""

OTHERS = """
import numpy as np
import evfem.plotting as plotting
pad = ev.FingerPad(ridges=False, resolution="coarse")
result = ev.simulate(ev.Scene(pad, ev.Flat(), motion=ev.Press(indentation=0.1, steps=2)))
ax = plotting.phase(result, "indentation", "normal_force")
assert (ax.get_xlabel(), ax.lines[0].get_ydata()[-1]) == ("indentation (mm)", result.normal_force[-1])

tip = ev.Fingertip(ridges="slanted", resolution="coarse")
assert tip._shape.relief.depth(np.array([0.25]), np.array([-0.25]))[0] == 0.0  # along a crest
assert ev.Drive(frequency=100.0, skin="moist").skin_layer(0.1, 1.0).eps_r.poles[0][0] == 1100.0

x, y = np.meshgrid(np.linspace(-1.0, 1.0, 5), np.linspace(0.0, 1.0, 3))
i = (np.arange(2)[:, None] * 5 + np.arange(4)).ravel()
quads, region = np.stack([i, i + 1, i + 6, i + 5], axis=1), np.zeros(8, dtype=np.int64)
sets = {"pad": np.arange(5), "bone": np.arange(10, 15)}
block = ev.Mesh(np.column_stack([x.ravel(), y.ravel()]), quads, "quad", region, {"block": 0}, sets)

from evfem.tissue.dynamics import DYNAMICS
from evfem.tissue.space import make_space
term = DYNAMICS["damped"](make_space(block, "q1"), None, np.full(8, 1e-9))
from types import SimpleNamespace
state = SimpleNamespace(u=np.zeros((15, 2)))
state.memory = term.memory(state)
for _ in range(5):  # 2 mm2 fall as after 1, 2, 3 ... steps of gravity
    term.begin(state, 0.01)
    none, one = (term.forces(state.u + far)[:, 1].sum() for far in (0.0, 1.0))
    new = SimpleNamespace(u=state.u + (2e-9 * 9.81e3 - none) / (one - none))
    new.memory = term.accept(state, new)
    state = new
np.testing.assert_allclose(state.u, 15 * 9.81e3 * 0.01**2)
assert state.memory["seconds"] == 0.0
solver = ev.Solver(dynamics="damped")
timed = ev.Scene(pad, ev.Flat(), motion=ev.Wait(duration=1e-3, steps=2), solver=solver)
timed = ev.scenefile.loads(ev.scenefile.dump(timed))
assert "damped, backward Euler" in " ".join(term.reason for term in ev.plan(timed).terms)
assert ev.simulate(timed).time[-1] == 1e-3

finger = ev.MeshedFinger(block, {"block": ev.NeoHookean(E=0.1, nu=0.4)})
scene = ev.Scene(finger, ev.Flat(friction=0.3), motion=[ev.Press(indentation=0.1), ev.Slide(0.2, steps=4)])
dense = ev.simulate(scene)
assert dense.provenance["solver"]["backend"] == "Dense", dense.provenance["solver"]["backend"]
from evfem.newton import linearisation
linearisation.make_condensation = evfem.newton.condensation.SuperLU
usual = ev.simulate(scene)
assert usual.provenance["solver"]["backend"] == "SuperLU"
np.testing.assert_allclose(dense.tangential_force, usual.tangential_force, rtol=1e-9, atol=1e-15)
"""


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """A folder with a copy of the package and all recipes in it."""
    folder = tmp_path_factory.mktemp("copy")
    package = Path(evfem.__file__).parent
    shutil.copytree(package, folder / "evfem", ignore=shutil.ignore_patterns("__pycache__"))
    for found, text, _ in RECIPES:
        put_in(folder / found["file"], found["how"], found["words"], text)
    return folder


def put_in(file, how, words, text):
    """Change a file as a mark says."""
    lines = file.read_text(encoding="utf-8")
    (place,) = re.finditer(r"^([ \t]*)" + r"\s*".join(map(re.escape, words.split())), lines, re.M)
    new = indent(text if how == "before" else text.rstrip("\n"), place[1])
    file.write_text(lines[: place.start()] + new + lines[place.start() if how == "before" else place.end() :])


def test_every_block_that_does_not_run_on_the_page_has_its_place():
    marks = [mark for kind, _, mark, _ in blocks(PAGE) if kind == "python" and mark]
    assert len(marks) == len(RECIPES) > 6


def test_the_table_says_how_many_files_each_change_touches():
    """Three at most: a fourth is a fact that stands at two places."""
    page = (DOCS / PAGE).read_text(encoding="utf-8").splitlines()
    headings = [(line, text[3:]) for line, text in enumerate(page) if text.startswith("## ")]
    touched = {text.lower().replace(" ", "-"): set() for _, text in headings}
    for found, _, line in RECIPES:
        heading = [text for at, text in headings if at < line][-1]
        touched[heading.lower().replace(" ", "-")] |= {found["file"]}
    told = {
        row[1]: int(row[2])
        for row in re.finditer(r"^\| \[.*?\]\(#(.*?)\) \| (\d+) \|$", "\n".join(page), re.M)
    }
    assert told == {place: len(touched[place]) for place in told}
    assert {place for place, named in touched.items() if named} <= set(told)
    assert max(told.values()) <= 3


def test_the_recipes_work_together_in_a_copy(copy):
    head = (
        f"sys.path.insert(0, {str(copy)!r})\nimport evfem, evfem as ev\nassert {str(copy)!r} in ev.__file__\n"
    )
    printed(head + LAYER + COLUMN + WAVEFORM + OTHERS, copy)

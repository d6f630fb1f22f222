"""Types reach the user: the stub is the package's list of names, and mypy refuses what the package would."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tools.commands import printed

import evfem

STUB = Path(evfem.__file__).with_suffix(".pyi")
RIGHT = '''\
"""A script as users write it."""

import evfem as ev

finger = ev.FingerPad(width=16.0, resolution="coarse")
display = ev.Display(insulator=ev.Layer(thickness=0.09, eps_r=3.35), friction=0.3)
motion = (ev.Press(force=0.05), ev.Slide(distance=1.0, steps=10))
scene = ev.Scene(finger, display, law=ev.Kaczmarek(), voltage=1000.0, motion=motion)
press = ev.Scene(finger, display, motion=[ev.Press(force=0.05), ev.Hover(gap=1.0)])
hover = ev.Scene(finger, display, motion=ev.Hover(gap=1.0))
result: ev.Result = ev.simulate(hover)
print(ev.scenefile.dump(scene), ev.materials.NeoHookean(E=1.0, nu=0.3), ev.meshfile.read)
print(scene.total_steps, press.digest(), [motion.steps for motion in hover.motion], result.normal_force[-1])
'''
#: line -> what mypy says of it
WRONG = {
    "ev.FingerPad(widht=3)": 'Unexpected keyword argument "widht" for "FingerPad"',
    'ev.Press(force="a")': 'Argument "force" to "Press" has incompatible type "str"',
    "ev.Scene(ev.FingerPad())": 'Missing positional argument "surface" in call to "Scene"',
    "ev.Scene(ev.FingerPad(), ev.Flat(), motion=3.0)": 'Argument "motion" to "Scene" has incompatible type',
    "ev.simulate_all": 'Module has no attribute "simulate_all"',
}


def stub_names():
    """Public name -> full name in the stub; a name with an underscore is an import, not a re-export."""
    private, listed = {}, {}
    for node in ast.parse(STUB.read_text()).body:
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                names = listed if alias.asname == alias.name else private
                names[alias.asname] = f"{node.module}.{alias.name}"
        elif isinstance(node, ast.Assign):
            listed[node.targets[0].id] = private.pop(node.value.id)
    assert not private
    return listed


def test_the_stub_lists_the_public_names_and_where_they_are():
    names = {name: f"evfem.{module}.{name}" for name, module in evfem._HOME.items()}
    modules = {name: f"evfem.{module}" for name, module in evfem._MODULES.items()}
    assert stub_names() == names | modules
    assert sorted(stub_names()) == evfem.__all__


def test_the_marker_of_typed_packages_is_installed():
    assert STUB.with_name("py.typed").is_file()


def test_only_public_names_are_shown():
    code = "import evfem as ev\nev.simulate, ev.plotting, ev.scenefile\nprint(*dir(ev))"
    assert printed(code).split() == sorted(["__version__", *evfem.__all__])


@pytest.mark.types
def test_mypy_takes_a_right_script_and_refuses_wrong_lines(tmp_path):
    (tmp_path / "right.py").write_text(RIGHT)
    wrong = ["import evfem as ev", *WRONG]
    (tmp_path / "wrong.py").write_text("\n".join(wrong) + "\n")
    words = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "right.py", "wrong.py"]
    root = STUB.parents[1]  # where mypy looks by itself, unless the package is installed to be edited
    place = {} if root.name == "site-packages" else {"MYPYPATH": str(root)}
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path, env=os.environ | place)
    said = done.stdout.splitlines()[:-1]  # the last line counts them
    for number, (line, words) in enumerate(WRONG.items(), start=2):
        found = [text for text in said if text.startswith(f"wrong.py:{number}: error: ")]
        assert len(found) == 1, f"{line}\n{done.stdout}{done.stderr}"
        assert words in found[0]
    assert not [text for text in said if not text.startswith("wrong.py:")]

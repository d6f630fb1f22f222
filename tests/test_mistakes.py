"""The table of mistakes fits the package: what each one changes is there, and the tests that see
it.
"""

import ast
from pathlib import Path

from tools.mistakes import mistakes

import evfem

PACKAGE, TESTS = Path(evfem.__file__).parent, Path(__file__).parent


def defined_in(file):
    tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_mistake_can_be_made():
    """`made_in` raises where the text to be changed is not there exactly once."""
    for one in mistakes():
        text = (PACKAGE / one.file).read_text(encoding="utf-8")
        damaged = one.made_in(text)
        if one.file.endswith(".h"):
            continue
        assert ast.dump(ast.parse(damaged)) != ast.dump(ast.parse(text)), f"{one.file}: {one.breaks}"


def test_the_tests_that_see_them_are_there():
    for one in mistakes():
        assert one.tests, one.breaks
        for test in one.tests:
            file, _, name = test.partition("::")
            assert (TESTS / file).is_file(), test
            assert not name or name.partition("[")[0] in defined_in(file), test


def test_every_room_has_its_mistakes():
    rooms = {path.parent.name for path in PACKAGE.glob("*/*.py")} - {"data", "meshes", "studies"}
    rooms = {room for room in rooms if any((PACKAGE / room).glob("[!_]*.py"))}
    assert rooms <= {one.file.split("/")[0] for one in mistakes()}

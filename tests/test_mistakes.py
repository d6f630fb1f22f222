"""The table of mistakes fits the package: what each one changes is there once, and the tests that see
it.
"""

import ast
from pathlib import Path

from tools.mistakes import mistakes

import evfem

PACKAGE, TESTS = Path(evfem.__file__).parent, Path(__file__).parent


def test_every_mistake_can_be_made():
    """`made` raises where the expression to be changed is not there exactly once."""
    for one in mistakes():
        file, damaged = one.made(PACKAGE)
        text = file.read_text(encoding="utf-8")
        if file.suffix == ".h":
            assert damaged != text, one.breaks
        else:
            assert ast.dump(ast.parse(damaged)) != ast.dump(ast.parse(text)), one.breaks


def test_the_tests_that_see_them_are_there():
    for one in mistakes():
        assert one.tests, one.breaks
        for test in one.tests:
            file, _, name = test.partition("::")
            tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
            names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
            assert not name or name.partition("[")[0] in names, test


def test_a_mistake_is_found_however_its_lines_are_broken(tmp_path):
    (tmp_path / "law.py").write_text("def force(k, u):\n    return (k\n            * u) + 0.0\n")
    one = mistakes()[0].__class__("force", "k*u", "-k * u", "the sign", ("x",))
    file, damaged = one.made(tmp_path)
    assert file.name == "law.py"
    assert ast.unparse(ast.parse(damaged)) == "def force(k, u):\n    return -k * u + 0.0"

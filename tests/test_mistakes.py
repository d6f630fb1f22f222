"""The table of mistakes fits the package: what each one changes is there once, and the tests that see it."""

import ast
from functools import cache
from pathlib import Path

import pytest
from tools.mistakes import Mistake, mistakes

import evfem

PACKAGE, TESTS = Path(evfem.__file__).parent, Path(__file__).parent


@cache
def names_in(file):
    tree = ast.parse((TESTS / file).read_text(encoding="utf-8"))
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def test_every_mistake_can_be_made():
    """`made` raises where the expression to be changed is not there exactly once."""
    for one in mistakes():
        file, damaged = one.made(PACKAGE)
        assert "".join(one.old.split()) != "".join(one.new.split()), one.breaks
        if file.suffix == ".py":
            ast.parse(damaged)


def test_the_tests_that_see_them_are_there():
    for one in mistakes():
        assert one.tests, one.breaks
        for test in one.tests:
            file, _, name = test.partition("::")
            assert not name or name.partition("[")[0] in names_in(file), test


def test_a_mistake_is_found_once_and_however_its_lines_are_broken(tmp_path):
    (tmp_path / "law.py").write_text("def force(k, u):\n    return (k\n            * u) + 0.0\n")
    file, damaged = Mistake("force", "k*u", "-k * u", "the sign", ("x",)).made(tmp_path)
    assert file.name == "law.py"
    assert ast.unparse(ast.parse(damaged)) == "def force(k, u):\n    return -k * u + 0.0"
    with pytest.raises(ValueError, match="force has 0 times what becomes: the sign"):
        Mistake("force", "u*k", "-k * u", "the sign", ("x",)).made(tmp_path)

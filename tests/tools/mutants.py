"""Mistakes that nobody chose: random single edits of the physics, and whether a test sees them.

    python tests/tools/mutants.py [--count N] [--seed S] [--out FILE] [--again]

1. Every operator, comparison, number, truth value, minimum and maximum of the `ROOMS` is a place of an edit;
   `count` of them are drawn with equal chances.
2. An edit is made in a copy of the package, and the test files of its room are run, first the one of the same
   name, until one fails or `PATIENCE` is over.
3. A line in `FILE` for each: what was changed, and the first test that fails or `survives`. Edits that are
   there already are not made again.
4. With `--again` the survivors of `FILE` are made once more: the examples of all docstrings are run, the test
   of what holds of every scene, those of its room (perhaps new) and of the others in the order of `USERS`.

What survives is no mistake (the same result on another way), or a test is missing; the ones worth it go into
`mistakes.toml`.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from mistakes import CHECKOUT, Copy, replaced

from evfem.common.storage import write_text

ROOMS = ("tissue", "surface", "field", "electrostatics", "circuit", "terms", "contact", "newton", "solver")
ROOMS += ("simulation",)
#: where the tests of rooms without a folder of their own are
HOMES = {
    "terms": ("contact", "newton"),
    "surface": ("contact", "scene"),
    "field": ("electrostatics", "contact"),
}
#: rooms whose tests run whole scenes, the quickest first
USERS = ("circuit", "solver", "newton", "simulation", "textures", "calibration", "response", "contact")
USERS += ("electrostatics", "tissue", "estimate", "sweeps", "scene", "finger")
#: pytest's status where all tests of a file have other marks
NO_TESTS = 5
#: what a line has where no test failed
SURVIVES = "\tsurvives\t"
#: seconds of tests after which an edit counts as not seen
PATIENCE = 240.0
#: operators and comparisons by what they are exchanged for, either way
PAIRS = [(ast.Add, ast.Sub), (ast.Mult, ast.Div), (ast.Lt, ast.GtE), (ast.Gt, ast.LtE), (ast.Eq, ast.NotEq)]
PAIRS += [(ast.Is, ast.IsNot), (ast.And, ast.Or)]
OTHER = {ast.MatMult: ast.Mult} | {a: b for pair in PAIRS for a, b in (pair, pair[::-1])}
NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
#: what says nothing about the physics
SILENT = (ast.Raise, ast.Assert, ast.JoinedStr)
#: what is joined by the operators of numbers
JOINED = ast.JoinedStr | ast.Tuple | ast.List


@dataclass(frozen=True)
class Edit:
    """An expression of a file becomes `new`."""

    file: str
    node: ast.expr
    new: str

    def made_in(self, text: str) -> str:
        """The text with the edit."""
        return replaced(text, self.node, self.new)

    def told(self) -> str:
        """The place, what stands there and what instead."""
        return f"{self.file}:{self.node.lineno}: {ast.unparse(self.node)}  ->  {self.new}"


def changed(node: ast.AST) -> ast.expr | None:
    """The expression with another operator, comparison, number, truth value, minimum or maximum."""
    match node:
        case ast.BinOp(left=a, op=op, right=b) if type(op) in OTHER and not isinstance(a, JOINED):
            return None if isinstance(b, JOINED) else ast.BinOp(a, OTHER[type(op)](), b)
        case ast.Compare(left=a, ops=[op], comparators=b) if type(op) in OTHER:
            return ast.Compare(a, [OTHER[type(op)]()], b)
        case ast.BoolOp(op=op, values=[a, b]):
            return ast.BoolOp(OTHER[type(op)](), [a, b])
        case ast.UnaryOp(op=ast.USub() | ast.Not(), operand=a):
            return a
        case ast.Constant(value=bool(value)):
            return ast.Constant(not value)
        case ast.Constant(value=int(value)):
            return ast.Constant(value + 1)
        case ast.Constant(value=float(value)):
            return ast.Constant(0.7 * value or 1.0)
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            return ast.Call(ast.Name(NAMES[name]), node.args, node.keywords)
        case ast.Call(func=ast.Attribute(value=a, attr=name)) if name in NAMES:
            return ast.Call(ast.Attribute(a, NAMES[name]), node.args, node.keywords)
    return None


def places(node: ast.AST) -> Iterator[tuple[ast.expr, str]]:
    """Every expression below a node that can be changed, and what it becomes; without what is silent."""
    if (new := changed(node)) is not None:
        assert isinstance(node, ast.expr)
        yield node, f"({ast.unparse(new)})"
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list") or getattr(node, "arg", "") == "strict":
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST) and not isinstance(part, SILENT):
                yield from places(part)


def edits() -> list[Edit]:
    """Every edit of the rooms."""
    found = []
    for room in ROOMS:
        for path in sorted((CHECKOUT / "evfem" / room).rglob("*.py")):
            file = path.relative_to(CHECKOUT / "evfem").as_posix()
            tree = ast.parse(path.read_text(encoding="utf-8"))
            found += [Edit(file, node, new) for node, new in places(tree)]
    return found


def seen(copy: Copy, test: str) -> str | None:
    """The first failure in a test file, None if there is none."""
    try:
        done = copy.run("-m", "pytest", "-q", "-x", "-n", "0", "-p", "no:cacheprovider", f"tests/{test}")
    except subprocess.TimeoutExpired:
        return f"{test}: no end"
    if done.returncode in (0, NO_TESTS):
        return None
    failed = re.search(r"^(?:FAILED|ERROR) tests/(.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return failed[1] if failed else f"{test}: status {done.returncode}"


def tests_of(edit: Edit, tests: Path, *, others: bool) -> list[Path]:
    """Test files of the edit's room, first the one of the same name, or examples and all rooms' files."""
    room, name = Path(edit.file).parts[0], f"test_{Path(edit.file).name}"
    own = HOMES.get(room, (room,))
    rooms = [*own, *(room for room in USERS if room not in own and others)]
    found = [path for room in rooms for path in sorted((tests / room).rglob("test_*.py"))]
    first = [tests / "test_docstrings.py", tests / "simulation/test_invariants.py"] if others else []
    return first + sorted(found, key=lambda path: path.name != name)


def judge(edit: Edit, copy: Copy, *, others: bool = False) -> str:
    """The edit and the test that sees it, or `survives`."""
    tests = tests_of(edit, copy.folder / "tests", others=others)
    file, began, failed = copy.package / edit.file, time.monotonic(), None
    text = file.read_text(encoding="utf-8")
    copy.write(file, edit.made_in(text))
    try:
        for test in tests:
            failed = seen(copy, test.relative_to(copy.folder / "tests").as_posix())
            if failed or time.monotonic() - began > PATIENCE:
                break
    finally:
        copy.write(file, text)
    return f"{edit.told()}\t{failed or 'survives'}\t{time.monotonic() - began:.0f} s"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Random mistakes, and which test sees them.")
    parser.add_argument("--count", type=int, default=200, help="how many (200)")
    parser.add_argument("--seed", type=int, default=0, help="which ones (0)")
    parser.add_argument("--out", type=Path, default="mutants.txt", help="where they are told (mutants.txt)")
    parser.add_argument("--again", action="store_true", help="survivors, with other rooms' tests")
    given = parser.parse_args()
    places = edits()
    chosen = random.Random(given.seed).sample(places, given.count)
    done = given.out.read_text(encoding="utf-8").splitlines() if given.out.exists() else []
    print(f"{len(places)} places, {len(chosen)} drawn, {len(done)} done")
    survivors = [i for i, line in enumerate(done) if SURVIVES in line]
    todo = survivors if given.again else range(len(done), len(chosen))
    with TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        for i in todo:
            done[i : i + 1] = [judge(chosen[i], copy, others=given.again)]
            print(done[i], flush=True)
            write_text(given.out, "".join(f"{line}\n" for line in done))
    survived = sum(SURVIVES in line for line in done)
    print(f"{len(done)} edits, {survived} survived")


if __name__ == "__main__":
    main()

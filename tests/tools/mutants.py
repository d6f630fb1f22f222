"""Mistakes that nobody chose: random single edits of the physics, and whether a test sees them.

    pip install pytest-cov
    pytest --cov=evfem --cov-context=test -m "not types"      # once: which test file runs which line
    python tests/tools/mutants.py [--count N] [--seed S] [--out FILE]

1. Every operator, comparison, number, truth value, minimum and maximum of the `ROOMS` is a place of an edit;
   `count` of them are drawn with equal chances.
2. All tests are run once in a copy of the package as it is: a file that fails there says nothing.
3. An edit is made in the copy, and the test files that run its line are run (where none is known to, as for
   constants, those that run anything of the file): first the file of the same name, then those of the same
   room, then the others, each group from the shortest to the longest, until one fails or `PATIENCE` is over.
4. A line in `FILE` for each: what was changed, and the first test that fails or `survives`. Edits that are
   there already are not made again.

What survives either is no mistake (the same result on another way), or a test is missing; the ones worth it
go into `mistakes.toml`.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import sqlite3
import subprocess
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from tempfile import TemporaryDirectory

from mistakes import CHECKOUT, LONGEST, Copy, replaced

ROOMS = ("tissue", "electrostatics", "contact", "solver", "simulation")
#: pytest's status where all tests of a file have other marks
NO_TESTS = 5
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


class Runs:
    """Which test files run which lines, and how long they take, from the data of coverage."""

    def __init__(self, data: Path, unsound: set[str]) -> None:
        from coverage.numbits import numbits_to_nums

        self._of_line: dict[tuple[str, int], set[str]] = defaultdict(set)
        self._of_file: dict[str, set[str]] = defaultdict(set)
        self._sizes: dict[str, int] = defaultdict(int)
        rows = sqlite3.connect(data).execute(
            "select file.path, context.context, numbits from line_bits "
            "join file on file.id = file_id join context on context.id = context_id"
        )
        for path, context, bits in rows:
            test = context.split("::")[0].removeprefix("tests/")
            module = path.partition("/evfem/")[2].rpartition("evfem/")[2]
            if not test.endswith(".py") or test in unsound:
                continue
            self._of_file[module].add(test)
            for line in numbits_to_nums(bits):
                self._of_line[module, line].add(test)
                self._sizes[test] += 1

    def of(self, edit: Edit) -> list[str]:
        """The test files that run its line, those nearest first."""
        room, name = edit.file.split("/")[0], Path(edit.file).name
        mirror = f"{room}/test_{name}"
        found = self._of_line.get((edit.file, edit.node.lineno)) or self._of_file[edit.file]
        return sorted(found, key=lambda test: (test != mirror, not test.startswith(room), self._sizes[test]))


#: the marks of the README's test command stay as they are
PYTEST = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "-n")


def unsound(copy: Copy, workers: int) -> set[str]:
    """The test files that fail without any edit."""
    told = copy.run(*PYTEST, str(workers), seconds=3600.0).stdout
    found = {match[1] for match in re.finditer(r"^(?:FAILED|ERROR) tests/([\w/]+\.py)", told, re.MULTILINE)}
    print(told.splitlines()[-1], *sorted(found), sep="\n", flush=True)
    return found


def seen(copy: Copy, test: str) -> str | None:
    """The first failure in a test file, None if there is none."""
    try:
        done = copy.run(*PYTEST, "0", "-x", f"tests/{test}")
    except subprocess.TimeoutExpired:
        return f"{test}: no end within {LONGEST:g} s"
    if done.returncode in (0, NO_TESTS):
        return None
    failed = re.search(r"^(?:FAILED|ERROR) tests/(.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
    return failed[1] if failed else f"{test}: status {done.returncode}"


def judge(edit: Edit, copies: SimpleQueue[Copy], runs: Runs) -> str:
    """The edit and the test that sees it, or `survives`."""
    copy = copies.get()
    file = copy.package / edit.file
    text = file.read_text(encoding="utf-8")
    began, failed = time.monotonic(), None
    try:
        copy.write(file, edit.made_in(text))
        for test in runs.of(edit):
            if (failed := seen(copy, test)) or time.monotonic() - began > PATIENCE:
                break
    finally:
        copy.write(file, text)
        copies.put(copy)
    return f"{edit.told()}\t{failed or 'survives'}\t{time.monotonic() - began:.0f} s"


def lines(chosen: list[Edit], workers: int) -> Iterator[str]:
    """What was said of each edit, in their order."""
    copies: SimpleQueue[Copy] = SimpleQueue()
    with TemporaryDirectory() as folder:
        made = [Copy(Path(folder) / str(number)) for number in range(workers)]
        runs = Runs(CHECKOUT / ".coverage", unsound(made[0], workers))
        for copy in made:
            copies.put(copy)
        with ThreadPoolExecutor(workers) as pool:
            yield from pool.map(partial(judge, copies=copies, runs=runs), chosen)


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description="Random mistakes, and which test sees them.")
    parser.add_argument("--count", type=int, default=200, help="how many (200)")
    parser.add_argument("--seed", type=int, default=0, help="which ones (0)")
    parser.add_argument("--workers", type=int, default=1, help="how many at a time (1)")
    parser.add_argument("--out", type=Path, default="mutants.txt", help="where they are told (mutants.txt)")
    given = parser.parse_args()
    places = edits()
    chosen = random.Random(given.seed).sample(places, given.count)
    done = given.out.read_text(encoding="utf-8").splitlines() if given.out.exists() else []
    print(f"{len(places)} places, {len(chosen)} drawn, {len(done)} done")
    with given.out.open("a", encoding="utf-8") as told:
        for line in lines(chosen[len(done) :], given.workers):
            print(line, flush=True)
            print(line, file=told, flush=True)
            done.append(line)
    survived = sum("\tsurvives\t" in line for line in done)
    print(f"{len(done)} edits, {survived} survived")


if __name__ == "__main__":
    main()

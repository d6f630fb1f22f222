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

from mistakes import CHECKOUT, LONGEST, Copy

ROOMS = ("tissue", "electrostatics", "contact", "solver", "simulation")
#: pytest's status where all tests of a file have other marks
NO_TESTS = 5
#: seconds of tests after which an edit counts as not seen
PATIENCE = 240.0
ARITHMETIC: dict[type, tuple[str, str]] = {
    ast.Add: ("+", "-"),
    ast.Sub: ("-", "+"),
    ast.Mult: ("*", "/"),
    ast.Div: ("/", "*"),
    ast.MatMult: ("@", "*"),
}
COMPARISONS: dict[type, tuple[str, str]] = {
    ast.Lt: ("<", ">="),
    ast.LtE: ("<=", ">"),
    ast.Gt: (">", "<="),
    ast.GtE: (">=", "<"),
    ast.Eq: ("==", "!="),
    ast.NotEq: ("!=", "=="),
    ast.Is: ("is", "is not"),
    ast.IsNot: ("is not", "is"),
}
LOGIC: dict[type, tuple[str, str]] = {ast.And: ("and", "or"), ast.Or: ("or", "and")}
NAMES = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}
#: what says nothing about the physics
SILENT = (ast.Raise, ast.Assert, ast.JoinedStr, ast.AnnAssign)


@dataclass(frozen=True)
class Edit:
    """Text of a file from `begin` to `end` (offsets) becomes `new`; `line` counts from 1."""

    file: str
    line: int
    begin: int
    end: int
    new: str

    def made_in(self, text: str) -> str:
        """The text with the edit."""
        return text[: self.begin] + self.new + text[self.end :]

    def told(self, text: str) -> str:
        """The place, the line as it was and as it is."""
        before, after = (one.splitlines()[self.line - 1].strip() for one in (text, self.made_in(text)))
        return f"{self.file}:{self.line}: {before}  ->  {after}"


class Places(ast.NodeVisitor):
    """Every edit of one file."""

    def __init__(self, file: str, text: str) -> None:
        self.file, self.text, self.edits = file, text, list[Edit]()
        lengths = [len(line) for line in text.splitlines(keepends=True)]
        self._begins = [sum(lengths[:number]) for number in range(len(lengths))]
        self.visit(ast.parse(text))

    def visit(self, node: ast.AST) -> None:
        """Leave out what is silent, and annotations."""
        if isinstance(node, ast.AnnAssign) and node.value is not None:
            self.visit(node.value)
        if not isinstance(node, SILENT):
            super().visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for part in node.body:
            self.visit(part)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        joined = ast.JoinedStr | ast.Tuple | ast.List
        if not isinstance(node.left, joined) and not isinstance(node.right, joined):
            self._between(node.left, node.right, ARITHMETIC.get(type(node.op)))
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        if len(node.ops) == 1:
            self._between(node.left, node.comparators[0], COMPARISONS.get(type(node.ops[0])))
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        if len(node.values) == 2:
            self._between(*node.values, LOGIC[type(node.op)])
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub | ast.Not):
            begin = self._offset(node.lineno, node.col_offset)
            self._add(node.lineno, begin, self._offset(node.operand.lineno, node.operand.col_offset), "")
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg != "strict":
            self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        values = {bool: "not {}", int: "{} + 1", float: "0.7 * {}"}
        if new := values.get(type(node.value)):
            old = ast.get_source_segment(self.text, node) or ""
            begin = self._offset(node.lineno, node.col_offset)
            new = "1.0" if node.value == 0.0 and isinstance(node.value, float) else f"({new.format(old)})"
            self._add(node.lineno, begin, begin + len(old), new)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func
        word = name.attr if isinstance(name, ast.Attribute) else getattr(name, "id", "")
        if word in NAMES:
            end = self._offset(name.end_lineno or 0, name.end_col_offset or 0)
            self._add(name.end_lineno or 0, end - len(word), end, NAMES[word])
        self.generic_visit(node)

    def _between(self, left: ast.expr, right: ast.expr, words: tuple[str, str] | None) -> None:
        """Exchange an operator, whose text stands between two expressions."""
        if words is None:
            return
        begin = self._offset(left.end_lineno or 0, left.end_col_offset or 0)
        end = self._offset(right.lineno, right.col_offset)
        at = self.text.find(words[0], begin, end)
        if at >= 0:
            line = self.text.count("\n", 0, at) + 1
            self._add(line, at, at + len(words[0]), words[1])

    def _add(self, line: int, begin: int, end: int, new: str) -> None:
        self.edits.append(Edit(self.file, line, begin, end, new))

    def _offset(self, line: int, column: int) -> int:
        """Offset of a place; columns of the syntax tree count bytes."""
        begin = self._begins[line - 1]
        row = self.text[begin:].split("\n", 1)[0]
        return begin + len(row.encode()[:column].decode())


def edits() -> list[Edit]:
    """Every edit of the rooms that still is Python."""
    found = []
    for room in ROOMS:
        for path in sorted((CHECKOUT / "evfem" / room).rglob("*.py")):
            text = path.read_text(encoding="utf-8")
            for edit in Places(path.relative_to(CHECKOUT / "evfem").as_posix(), text).edits:
                try:
                    ast.parse(edit.made_in(text))
                except SyntaxError:
                    continue
                found.append(edit)
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
        found = self._of_line.get((edit.file, edit.line)) or self._of_file[edit.file]
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
    return f"{edit.told(text)}\t{failed or 'survives'}\t{time.monotonic() - began:.0f} s"


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

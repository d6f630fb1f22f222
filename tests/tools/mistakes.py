"""Mistakes in the physics that the tests must see: each is made in a copy of the package, one at a time.

python tests/tools/mistakes.py [--only WORD]

The table is `mistakes.toml` beside this file. A mistake is one edit within one function or method: of the
package's functions called `where`, one has the expression `old` once, and there it becomes `new`. Expressions
are compared as Python reads them, so that lines may be broken otherwise and functions may move; `where` of a
C header is its name, and blanks do not count. `breaks` says what is wrong then, `tests` which tests must see
it. They run in a temporary folder with a copy of the package, first as it is, then with each mistake, one
process at a time. Exit status 1 if a mistake survives.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

CHECKOUT = Path(__file__).parents[2]
TABLE = Path(__file__).with_suffix(".toml")
#: tests that find no end within so many seconds have seen the mistake
LONGEST = 300.0


@dataclass(frozen=True)
class Mistake:
    """One edit of a function, what it breaks, and the tests in `tests/` that must see it."""

    where: str
    old: str
    new: str
    breaks: str
    tests: tuple[str, ...]

    def made(self, package: Path) -> tuple[Path, str]:
        """The file of the package that has the mistake, and its text with it; raises ValueError if the
        table does not fit the package.
        """
        made = self._made_in_header if self.where.endswith(".h") else self._made_in_python
        found = list(made(package))
        if len(found) != 1:
            raise ValueError(f"{self.where} has {len(found)} times what becomes: {self.breaks}")
        return found[0]

    def _made_in_header(self, package: Path) -> Iterator[tuple[Path, str]]:
        pattern = r"\s*".join(re.escape(word) for word in re.findall(r"\w+|\S", self.old))
        for path in package.rglob(self.where):
            text = path.read_text(encoding="utf-8")
            for found in re.finditer(pattern, text):
                yield path, text[: found.start()] + self.new + text[found.end() :]

    def _made_in_python(self, package: Path) -> Iterator[tuple[Path, str]]:
        old = ast.parse(self.old, mode="eval").body
        for path, function in functions(package).get(self.where, ()):
            for node in ast.walk(function):
                if type(node) is type(old) and ast.dump(node) == ast.dump(old):
                    yield path, replaced(path.read_text(encoding="utf-8"), node, f"({self.new})")

    @property
    def possible(self) -> bool:
        """Loops can be compiled only by a compiler."""
        return not self.where.endswith(".h") or shutil.which("cc") is not None


def replaced(text: str, node: ast.expr, new: str) -> str:
    """A text with another expression in place of a node of its tree."""
    lines = text.encode().splitlines(keepends=True)
    assert node.end_lineno is not None
    begin = sum(map(len, lines[: node.lineno - 1])) + node.col_offset
    end = sum(map(len, lines[: node.end_lineno - 1])) + (node.end_col_offset or 0)
    whole = b"".join(lines)
    return (whole[:begin] + new.encode() + whole[end:]).decode()


@cache
def functions(package: Path) -> dict[str, list[tuple[Path, ast.AST]]]:
    """The functions and methods of the package by their names, as `function` or `Class.method`."""
    found: dict[str, list[tuple[Path, ast.AST]]] = {}
    for path in sorted(package.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for prefix, body in [("", tree.body), *((f"{one.name}.", one.body) for one in classes)]:
            for node in body:
                if isinstance(node, ast.FunctionDef):
                    found.setdefault(prefix + node.name, []).append((path, node))
    return found


def mistakes() -> list[Mistake]:
    """The table."""
    tables = tomllib.loads(TABLE.read_text(encoding="utf-8"))["mistake"]
    return [Mistake(**{**one, "tests": tuple(one["tests"])}) for one in tables]


class Copy:
    """The package and its tests in a folder of their own, where they can be damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.package = folder, folder / "evfem"
        ignored = shutil.ignore_patterns("__pycache__")
        for name, place in (("evfem", ""), ("meshes", "evfem"), ("studies", "evfem"), ("tests", "")):
            shutil.copytree(CHECKOUT / name, folder / place / name, ignore=ignored)
        shutil.copy(CHECKOUT / "pyproject.toml", folder)
        self.environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1"}
        told = self.run("-c", "import evfem, evfem.meshes, evfem.studies; print(evfem.__file__)").stdout
        if Path(told.strip()).parent != self.package:
            raise SystemExit(f"the tests would run on {told.strip()} instead of the copy")

    def run(self, *arguments: str, seconds: float = LONGEST) -> subprocess.CompletedProcess[str]:
        """Python with these arguments in the copy."""
        words = [sys.executable, "-P", *arguments]
        return subprocess.run(
            words, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=seconds
        )

    def test(self, tests: tuple[str, ...], seconds: float = LONGEST) -> str | None:
        """The first test that fails, or None if all pass."""
        options = ("-x", "-q", "-n", "0", "-m", "not types", "-p", "no:cacheprovider")
        places = [f"tests/{test}" for test in tests]
        try:
            done = self.run("-m", "pytest", *options, *places, seconds=seconds)
        except subprocess.TimeoutExpired:
            return f"no end within {seconds:g} s"
        if done.returncode == 0:
            return None
        failed = re.search(r"^(?:FAILED|ERROR) tests/(.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
        if failed is None or done.returncode != 1:
            raise SystemExit(f"status {done.returncode} of {tests}\n{done.stdout}\n{done.stderr}")
        return failed[1]

    def test_with(self, mistake: Mistake) -> str | None:
        """The test that sees the mistake, or None."""
        file, damaged = mistake.made(self.package)
        text = file.read_text(encoding="utf-8")
        self.write(file, damaged)
        try:
            return self.test(mistake.tests)
        finally:
            self.write(file, text)

    def write(self, file: Path, text: str) -> None:
        """New text, and nothing left of what was compiled from the old one."""
        file.write_text(text, encoding="utf-8")
        if file.suffix == ".h":
            include = sysconfig.get_paths()["include"]
            for source in file.parent.glob("*.c"):
                compiled = source.with_suffix(".abi3.so")
                words = ["cc", "-O1", "-shared", "-fPIC", f"-I{include}", str(source), "-o", str(compiled)]
                subprocess.run(words, check=True, capture_output=True)
        shutil.rmtree(file.parent / "__pycache__", ignore_errors=True)


def survivors(chosen: list[Mistake]) -> int:
    """Make the mistakes one after the other, print a line for each, and count those that no test sees."""
    survived = 0
    with TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        tests = tuple(dict.fromkeys(test for one in chosen for test in one.tests))
        if failed := copy.test(tests, LONGEST * len(tests)):
            raise SystemExit(f"without any mistake {failed} fails")
        for number, mistake in enumerate(chosen, 1):
            began = time.perf_counter()
            seen = copy.test_with(mistake)
            survived += seen is None
            seconds = time.perf_counter() - began
            print(f"{number:3d} {seconds:5.1f} s  {mistake.where}: {mistake.breaks}", flush=True)
            print(f"              {seen or 'SURVIVES'}", flush=True)
    print(f"{len(chosen)} mistakes, {survived} survived")
    return survived


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Mistakes that the tests must see.")
    parser.add_argument("--only", default="", metavar="WORD", help="those whose place or text has the word")
    word = parser.parse_args().only
    chosen = [one for one in mistakes() if one.possible and word in f"{one.where} {one.breaks}"]
    if not chosen:
        parser.error(f"no mistake with {word!r} in it")
    return int(survivors(chosen) > 0)


if __name__ == "__main__":
    sys.exit(main())

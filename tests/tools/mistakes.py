"""Mistakes that the tests must see: each is made in a copy of the package, one at a time.

    python tests/tools/mistakes.py [--only WORD]

The table is `mistakes.toml` beside this file. A mistake is one edit of one file: `old` text, which
the file has exactly once, becomes `new`. `breaks` says what is wrong then, `tests` which tests
must see it. They run in a temporary folder with a copy of the package, first as it is, then with
each mistake, one process at a time. Exit status 1 if a mistake survives.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

CHECKOUT = Path(__file__).parents[2]
TABLE = Path(__file__).with_suffix(".toml")
#: tests that find no end within so many seconds have seen the mistake
LONGEST = 300.0


@dataclass(frozen=True)
class Mistake:
    """One edit of a `file` below `evfem/`, what it breaks, and the tests in `tests/` that must see
    it.
    """

    file: str
    old: str
    new: str
    breaks: str
    tests: tuple[str, ...]

    def made_in(self, text: str) -> str:
        """The text of the file with the mistake; raises ValueError if the table does not fit it."""
        if (count := text.count(self.old)) != 1:
            raise ValueError(f"{self.file} has {count} times what becomes: {self.breaks}")
        return text.replace(self.old, self.new)

    @property
    def possible(self) -> bool:
        """Loops can be compiled only by a compiler."""
        return not self.file.endswith(".h") or shutil.which("cc") is not None


def mistakes() -> list[Mistake]:
    """The table."""
    tables = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    return [
        Mistake(file, one["old"], one["new"], one["breaks"], tuple(one["tests"]))
        for file, several in tables.items()
        for one in several
    ]


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
        words = [sys.executable, *arguments]
        return subprocess.run(
            words,
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=seconds,
        )

    def test(self, tests: tuple[str, ...]) -> str | None:
        """The first test that fails, or None if all pass."""
        options = ("-x", "-q", "-n", "0", "-m", "not types", "-p", "no:cacheprovider")
        places = [f"tests/{test}" for test in tests]
        try:
            done = self.run("-m", "pytest", *options, *places)
        except subprocess.TimeoutExpired:
            return f"no end within {LONGEST:g} s"
        if done.returncode == 0:
            return None
        failed = re.search(r"^(?:FAILED|ERROR) tests/(.*?)(?: - .*)?$", done.stdout, re.MULTILINE)
        if failed is None or done.returncode != 1:
            raise SystemExit(f"status {done.returncode} of {tests}\n{done.stdout}\n{done.stderr}")
        return failed[1]

    def test_with(self, mistake: Mistake) -> str | None:
        """The test that sees the mistake, or None."""
        file = self.package / mistake.file
        text = file.read_text(encoding="utf-8")
        self.write(file, mistake.made_in(text))
        try:
            return self.test(mistake.tests)
        finally:
            self.write(file, text)

    def write(self, file: Path, text: str) -> None:
        """New text, and nothing left of what was compiled from the old one."""
        file.write_text(text, encoding="utf-8")
        if file.suffix == ".h":
            name = "solids.c" if file.name.startswith("solid") else "loops.c"
            source, include = file.with_name(name), sysconfig.get_paths()["include"]
            compiled = source.with_suffix(".abi3.so")
            words = ["cc", "-O1", "-shared", "-fPIC", f"-I{include}", str(source), "-o", str(compiled)]
            subprocess.run(words, check=True, capture_output=True)
        shutil.rmtree(file.parent / "__pycache__", ignore_errors=True)


def survivors(chosen: list[Mistake]) -> int:
    """Make the mistakes one after the other, print a line for each, and count those that no test
    sees.
    """
    survived = 0
    with TemporaryDirectory() as folder:
        copy = Copy(Path(folder))
        if failed := copy.test(tuple(dict.fromkeys(test for one in chosen for test in one.tests))):
            raise SystemExit(f"without any mistake {failed} fails")
        for number, mistake in enumerate(chosen, 1):
            began = time.perf_counter()
            seen = copy.test_with(mistake)
            survived += seen is None
            seconds = time.perf_counter() - began
            print(f"{number:3d} {seconds:5.1f} s  {mistake.file}: {mistake.breaks}", flush=True)
            print(f"              {seen or 'SURVIVES'}", flush=True)
    print(f"{len(chosen)} mistakes, {survived} survived")
    return survived


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Mistakes that the tests must see.")
    parser.add_argument("--only", default="", metavar="WORD", help="those whose file or text has the word")
    word = parser.parse_args().only
    chosen = [one for one in mistakes() if one.possible and word in f"{one.file} {one.breaks}"]
    if not chosen:
        parser.error(f"no mistake with {word!r} in it")
    return int(survivors(chosen) > 0)


if __name__ == "__main__":
    sys.exit(main())

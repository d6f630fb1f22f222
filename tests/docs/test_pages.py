"""The documentation: its examples run and print what stands below them, its links lead somewhere, it builds.

A page's Python blocks run in order, in one namespace and a folder of their own. A `text` block after one is
what it prints, `...` standing for anything. TOML blocks are scenes or sweeps, `evfem` lines in `sh` blocks
are understood by the command. `<!-- not run: reason -->` or `<!-- needs vtk -->` before a block says why it
does not run here.
"""

import doctest
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from evfem import cli
from evfem.scene import file as scenefile
from evfem.sweeps import file as sweepfile

DOCS = Path(__file__).parents[2] / "docs"
PAGES = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))
BLOCK = re.compile(r"^(?:<!-- (?P<mark>.+?) -->\n)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
LINK = re.compile(r"\]\(([^)\s]+)\)")
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def blocks(page):
    """Kind, text, mark and first line of each fenced block of a page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    for found in BLOCK.finditer(text):
        yield found["kind"], found["text"], found["mark"], text[: found.start("text")].count("\n")


def run(page, wanted, capsys):
    """Run the Python blocks whose mark is in `wanted`, compare what they print, read the other blocks."""
    namespace = {"__name__": "page"}
    printed = None
    for kind, text, mark, line in blocks(page):
        place = f"{page}:{line + 1}"
        if mark not in wanted:
            assert mark.startswith(("not run: ", "needs vtk")), place
            printed = None
        elif kind == "python":
            exec(compile("\n" * line + text, str(DOCS / page), "exec"), namespace)
            printed = capsys.readouterr().out
        elif kind == "text" and printed is not None:
            assert doctest.OutputChecker().check_output(text, printed, FLAGS), f"{place}\n{printed}"
        elif kind == "toml":
            (sweepfile if "\n[scene" in text else scenefile).loads(text, ".")
        elif kind == "sh":
            understood(text)


def understood(text):
    """The command knows all words of its lines."""
    for line in text.splitlines():
        if line.startswith("evfem "):
            cli.parser().parse_args(shlex.split(line, comments=True)[1:])


@pytest.mark.parametrize("page", PAGES)
def test_page_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(page, {None}, capsys)


def anchors(page):
    """What a link to a heading of the page may be called."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    text = re.sub(r"```.*?^```", "", (DOCS / page).read_text(encoding="utf-8"), flags=re.M | re.S)
    for link in LINK.findall(text):
        if not link.startswith("https://"):
            name, _, anchor = link.partition("#")
            target = (DOCS / page).parent / name if name else DOCS / page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", [page for page in PAGES if page != "index.md"])
def test_page_is_in_a_table_of_contents(page):
    for index in (DOCS / page).parent / "index.md", DOCS / "index.md":
        folder = index.parent
        trees = re.findall(r"```{toctree}\n(.*?)```", index.read_text(encoding="utf-8"), re.S)
        names = [re.sub(r".*<(.*)>", r"\1", line) for tree in trees for line in tree.splitlines()]
        if page.removesuffix(".md") in {(folder / name).relative_to(DOCS).as_posix() for name in names}:
            return
    raise AssertionError(f"{page} is in no table of contents")


@pytest.mark.site
def test_the_site_builds_without_a_warning(tmp_path):
    words = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path / "site")]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "index.html").is_file()

"""The gallery's examples: many, short, complete, and each beside the picture that it draws.

`test_pages` runs them; here is what can be read from them.
"""

import ast
import base64
import builtins
import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "gallery.md").read_text(encoding="utf-8")
EXAMPLE = re.compile(
    r'^<div class="example">\n\n(?:<!-- takes long -->\n)?```python\n(.*?)^```\n\n'
    r"!\[(.+?)\]\(pictures/gallery-(\w+)\.(png|gif)\)"
    r"\n\n</div>$",
    re.M | re.S,
)
EXAMPLES = {name: (code, alt, ending) for code, alt, name, ending in EXAMPLE.findall(PAGE)}


def test_there_are_many_examples_and_nothing_else_is_run():
    assert len(EXAMPLES) >= 15
    assert len(EXAMPLES) == PAGE.count("```python") == PAGE.count('<div class="example">')


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_short_and_complete_and_writes_its_picture(name):
    code, alt, ending = EXAMPLES[name]
    lines = code.splitlines()
    assert len(lines) < 30
    assert max(map(len, lines)) <= 68  # what stands beside a picture at 1366 pixels
    assert f'"{name}.{ending}"' in code
    assert len(alt.split()) > 3
    tree = ast.parse(code)
    known = set(dir(builtins))
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            known.add(node.id)
        elif isinstance(node, ast.FunctionDef):
            known |= {node.name, *(each.arg for each in node.args.args)}
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            known |= {alias.asname or alias.name for alias in node.names}
    used = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
    assert used <= known


def test_each_example_has_a_thumbnail_that_leads_to_it_and_its_code_to_download():
    text = runpy.run_path(str(DOCS / "thumbnails.py"))["with_thumbnails"](PAGE)
    grid, _, rest = text.partition("</nav>")
    shown = re.findall(r"\[!\[(.+?)\]\(pictures/gallery-(\w+)\.\w+\) (.+?)\]\(#([\w-]+)\)", grid)
    assert [name for _, name, _, _ in shown] == list(EXAMPLES)
    for alt, name, title, anchor in shown:
        assert EXAMPLES[name][1] == alt
        assert f"\n### {title}\n" in rest
        assert re.sub(r"[^a-z]+", "-", title.lower()).strip("-") == anchor
    files = re.findall(r'<a download="(\w+)\.py" href="data:text/x-python;base64,([\w+/=]+)">', rest)
    assert {name: base64.b64decode(code).decode() for name, code in files} == {
        name: code for name, (code, _, _) in EXAMPLES.items()
    }


def test_studies_stand_apart():
    assert "evfem study" not in PAGE
    assert "(studies.md)" in PAGE

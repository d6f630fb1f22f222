"""The documentation: its examples run and print what stands below them, its links lead somewhere, the names
that it uses exist, what it lists is complete, it builds.

A page's Python blocks run in order, in one namespace and a folder of their own. A `text` block after one is
what it prints, `...` standing for anything. TOML blocks are scenes, sweeps or
sensitivities, `evfem` lines in `sh` blocks
are understood by the command. `<!-- not run: reason -->` or `<!-- needs vtk -->` before a block says why it
does not run here, `<!-- needs xarray -->` that it runs with the tests of xarray, `<!-- takes long -->` with
the slow ones.
"""

import doctest
import json
import re
import runpy
import shlex
import subprocess
import sys
import tomllib
from contextlib import ExitStack
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import pytest

import evfem
from evfem import cli, studies
from evfem.electrostatics.laws import FORCE_LAWS
from evfem.planning.rooms import KINDS
from evfem.response.file import SensitivityTable
from evfem.scene import file as scenefile
from evfem.scene import keys, schema
from evfem.scene.motion import Motion
from evfem.simulation.history import MEANINGS, ROOM_COLUMNS
from evfem.simulation.result import COLUMNS, UNITS
from evfem.surface.friction import NamedFriction
from evfem.sweeps import file as sweepfile
from evfem.textures.importers import IMPORTERS
from evfem.tissue import space

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md"))
#: everything that is read beside the code
TEXTS = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "meshes/README.md",
    "studies/notebooks/README.md",
    *(f"docs/{p}" for p in PAGES),
]
BLOCK = re.compile(r"^(?:<!-- (?P<mark>.+?) -->\n)?^```(?P<kind>\w+)\n(?P<text>.*?)^```$", re.M | re.S)
FENCED = re.compile(r"^```\w+\n(.*?)^```$", re.M | re.S)
LINK = re.compile(r"\]\(([^)\s]+)\)")
FORMS, WORDS = "docs/howto/form.md", "docs/words.md"
#: pages with so much to compute that `.ci/run` alone runs them
HEAVY = ("element", "field", "fingertip", "fit", "friction", "pictures", "rough", "signal")
HEAVY += ("texture", "touchscreen")
LONG = {"gallery.md", *(f"howto/{p}.md" for p in HEAVY)}
#: pages with blocks that take long
SLOW = [page for page in PAGES if "<!-- takes long -->" in (DOCS / page).read_text(encoding="utf-8")]
#: pages that are still to be filled to the width of the others
UNFILLED = {"docs/theory.md"}
#: a public or a full name in a sentence: `ev.simulate(...)`, `evfem.surface.pad`
NAME = re.compile(r"`((?:ev|evfem)(?:\.\w+)+)")
DOI = re.compile(r"\b10\.\d{4,}/(?:[\w.-]|\(\w+\)|/)*\w")
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
            assert mark is None or mark.startswith(("not run: ", "needs ", "takes long")), place
            printed = None
        elif kind == "python":
            exec(compile("\n" * line + text, str(DOCS / page), "exec"), namespace)
            printed = capsys.readouterr().out
        elif kind == "text" and printed is not None:
            assert doctest.OutputChecker().check_output(text, printed, FLAGS), f"{place}\n{printed}"
        elif kind == "toml":
            if "\nby = " in text:
                keys.read(SensitivityTable, tomllib.loads(text), "")
            else:
                (sweepfile if "\n[scene" in text else scenefile).loads(text, ".")
        elif kind == "sh":
            understood(text)


def understood(text):
    """The command knows all words of its lines."""
    for line in text.replace("\\\n", " ").splitlines():
        if line.startswith("evfem "):
            cli.parser().parse_args(shlex.split(line, comments=True)[1:])


@pytest.mark.parametrize("page", [pytest.param(p, marks=pytest.mark.slow) if p in LONG else p for p in PAGES])
@pytest.mark.filterwarnings(
    "ignore:at .* V touching skin",  # told to users of smooth screens, too
    "ignore:5 um of air between rough faces",
)
def test_page_runs(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(space, "ELEMENTS", dict(space.ELEMENTS))  # a page adds one
    families = FORCE_LAWS, IMPORTERS, Motion.kinds, NamedFriction.kinds
    with ExitStack() as kept:  # what a page adds to a family goes with it
        for family in families:
            kept.enter_context(patch.dict(family))
        run(page, {None}, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("page", SLOW)
def test_blocks_that_take_long_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(page, {"takes long"}, capsys)
    assert [*tmp_path.iterdir()]


@pytest.mark.xarray
@pytest.mark.parametrize("page", ["howto/fields.md", "howto/sweep.md"])
def test_blocks_that_need_xarray_run(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(page, {None, "needs xarray"}, capsys)


def test_the_slider_of_a_notebook_steps_a_loop_and_draws_its_force(monkeypatch):
    """A stand-in for ipywidgets moves it twice."""
    from matplotlib import pyplot

    found, drawn, rows = list(blocks("howto/loop.md")), [], {}
    (code,) = [text for _, text, mark, _ in found if mark == "needs ipywidgets"]
    moved = SimpleNamespace(
        FloatSlider=lambda value, **_: value,
        interact=lambda move, **_: [move(position=x, voltage=1000.0) for x in (0.0, 0.4)],
    )
    monkeypatch.setitem(sys.modules, "ipywidgets", moved)
    monkeypatch.setattr(pyplot, "show", lambda: drawn.append(pyplot.gca().lines[0].get_xydata()))
    exec(found[0][1] + code, rows)
    pyplot.close("all")
    assert drawn[-1].tolist() == [[row.position, row.tangential_force] for row in rows["rows"]]
    assert [len(one) for one in drawn] == [1, 2]
    assert drawn[-1][1, 1] > 0.005


def anchors(page):
    """What a link to a heading of the page may be called."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def prose(text):
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)


def read(name):
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", TEXTS)
def test_links_lead_somewhere(name):
    for link in LINK.findall(prose(read(name))):
        if not link.startswith("https://"):
            path, _, anchor = link.partition("#")
            target = (ROOT / name).parent / path if path else ROOT / name
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("name", [name for name in TEXTS if name != "CHANGELOG.md"])
def test_files_in_sentences_exist(name):
    paths = re.findall(r"`((?:evfem|studies|tests|docs|meshes)/[\w./-]*)`", prose(read(name)))
    assert [path for path in paths if not (ROOT / path).exists()] == []


@pytest.mark.parametrize("name", [name for name in TEXTS if name not in UNFILLED])
def test_lines_fit_a_screen(name):
    """But for the rows of the table of words, which Markdown cannot break."""
    widest = 88 if name == "README.md" else 99
    lines = [line for line in read(name).splitlines() if name != WORDS or not line.startswith("|")]
    assert [line for line in lines if len(line) > widest] == []


@pytest.mark.parametrize("name", TEXTS)
def test_blocks_fit_the_page_beside_its_contents(name):
    """86 columns of code, without a bar to scroll."""
    lines = [line for found in FENCED.findall(read(name)) for line in found.splitlines()]
    assert [line for line in lines if len(line) > 86] == []


def resolved(dotted):
    """What a dotted name means: a module, or something in it; a dataclass's field counts."""
    parts = dotted.split(".")
    for end in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:end]))
        except ModuleNotFoundError:
            continue
        break
    for part in parts[end:]:
        if part in getattr(found, "__dataclass_fields__", ()):
            return found.__dataclass_fields__[part]
        found = getattr(found, part)
    return found


@pytest.mark.parametrize("name", [name for name in TEXTS if name != "CHANGELOG.md"])
def test_names_in_sentences_exist(name):
    for found in set(NAME.findall(prose(read(name)))):
        assert resolved(re.sub(r"^ev\b", "evfem", found)) is not None, found


def test_the_resolver_refuses_what_is_not_there():
    assert resolved("evfem.surface.pad.Pad.nodes").name == "nodes"
    assert resolved("evfem.Scene") is evfem.Scene
    for wrong in ("evfem.contact.pat", "evfem.surface.pad.Pad.knots"):
        with pytest.raises(AttributeError):
            resolved(wrong)


def rows(text):
    """Cells of the rows of all tables, without heads and rules."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    rules = [i for i, line in enumerate(lines) if set(line) <= set("|- ")]
    heads = {i - 1 for i in rules} | set(rules)
    for i, line in enumerate(lines):
        if i not in heads:
            yield [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]


def sections(text):
    """Heading and text of every section of the second and third level."""
    parts = re.split(r"^##+ (.+)$", text, flags=re.M)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def test_the_notation_names_what_is_in_the_code():
    checked = 0
    for heading, text in sections(read("docs/notation.md")).items():
        module = re.search(r"`(evfem\.[\w.]+)`", heading)
        for cells in rows(text) if module else ():
            for name in re.findall(r"`([A-Za-z_][\w.]*)", cells[1]):
                if not cells[1].startswith("argument"):
                    full = name if name.startswith("evfem.") else f"{module[1]}.{name}"
                    assert resolved(full) is not None
                    checked += 1
    assert checked > 30
    columns = rows(sections(read("docs/notation.md"))["Columns of the history"])
    assert tuple(name for cells in columns for name in re.findall(r"`(\w+)`", cells[0])) == (
        *COLUMNS,
        *ROOM_COLUMNS,
    )


def test_the_page_about_the_inside_has_every_room_and_names_what_there_is():
    """Rooms in the order of the data, modules of the walk, public modules at their places."""
    page, text = sections(read("docs/inside.md")), read("docs/inside.md")
    house = runpy.run_path(str(ROOT / "tests" / "test_architecture.py"))
    assert [cells[0].strip("`") for cells in rows(page["Rooms"])] == list(house["ROOMS"])
    picture, walk = (found["text"] for found in BLOCK.finditer(text))
    assert [room for room in house["ROOMS"] if room not in picture] == ["common"]  # below all the others
    steps = re.findall(r"^ *([a-z]+\.[a-z]+)  ?", walk, re.MULTILINE)
    assert len(steps) > 10
    assert set(steps) <= set(house["ORDER"])
    public = {cells[0].strip("`"): cells[1].strip("`") for cells in rows(page["Public names"])}
    assert {name: resolved(re.sub("^ev", "evfem", name)).__name__ for name in public} == public


def test_what_a_capability_touches_is_where_the_page_says():
    """Rows are those of the table of rooms; every place exists."""
    page = sections(read("docs/inside.md"))
    cells = [[one.strip("`") for one in row] for row in rows(page["What a capability touches"])]
    assert [row[:2] for row in cells] == [[kind.key, kind.module] for kind in KINDS]
    for _, module, maker, told in cells:
        for place in (module, maker, f"planning.plan.{told}"):
            resolved(f"evfem.{place}")


def dois(path):
    return set(DOI.findall(path.read_text(encoding="utf-8").replace("%28", "(").replace("%29", ")")))


def test_the_bibliography_has_exactly_the_dois_that_are_used():
    bibliography, used = DOCS / "bibliography.md", set()
    for folder in ("evfem", "studies", "tests", "docs"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in {".py", ".md", ".csv"} and path != bibliography:
                used |= dois(path)
    assert len(used) > 10
    assert dois(bibliography) == used


def test_the_page_on_the_command_line_has_all_commands_and_options():
    commands = next(a for a in cli.parser()._actions if isinstance(a.choices, dict)).choices
    options = {
        (name, o.option_strings[-1])
        for name, c in commands.items()
        for o in c._actions[1:]
        if o.option_strings
    }
    told, command = set(), ""
    for cells in rows(sections(read("docs/commandline.md"))["Commands"]):
        command = cells[0].strip("`") or command
        if len(cells) == 3:
            told.add((command, cells[1].strip("`").split()[0]))
        else:
            assert command.split()[1] in commands
    assert told == options


def test_every_study_is_on_its_pages_and_in_a_test():
    """A new word in `evfem.studies.NAMES` is told to the readers of two pages, and tried."""
    listed = re.search(r"^The studies are (.+?);", read("docs/commandline.md"), re.M | re.S)[1]
    assert tuple(re.findall(r"`(\w+)`", listed)) == studies.NAMES
    headings = " ".join(sections(read("docs/studies.md")))
    assert sorted(re.findall(r"`(\w+)`", headings)) == sorted(studies.NAMES)
    tests = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "tests/studies").glob("*.py"))
    assert [name for name in studies.NAMES if f'"{name}"' not in tests] == []


def test_tests_that_the_page_on_verification_names_are_there():
    names = set(re.findall(r"`(test_\w+)`", read("docs/verification.md")))
    assert names
    assert names <= {path.stem for path in (ROOT / "tests").rglob("test_*.py")}


def test_every_picture_has_a_recipe():
    """A study of its name draws it, or the code of a page, or the script of the pictures itself."""
    script = runpy.run_path(str(ROOT / "studies/pictures/make.py"), run_name="recipes")
    recipes = script["OF_PAGES"]
    pictures = {path.name for path in (DOCS / "pictures").iterdir()}
    assert pictures - set(recipes) <= {script["RELIEF"], *(f"{name}.png" for name in studies.NAMES)}
    assert set(recipes) <= pictures
    for picture, (page, written) in recipes.items():
        code = "".join(text for kind, text, _, _ in blocks(page) if kind == "python")
        assert f"pictures/{picture})" in read(f"docs/{page}"), picture
        assert f'"{written}"' in code, picture


def test_the_page_on_forms_names_the_regions_and_boundaries_of_the_finger():
    told = re.search(r"The regions of `FingerPad` are (.+?);.+?boundaries (.+?)\.", read(FORMS), re.S)
    mesh = evfem.FingerPad(resolution="coarse").mesh(1)
    regions, boundaries = (set(re.findall(r"`(\w+)`", names)) for names in told.groups())
    assert (regions, boundaries) == (set(mesh.region_names), set(mesh.node_sets))


def test_the_version_is_the_same_wherever_it_is_said():
    assert f"\nversion: {evfem.__version__}\n" in read("CITATION.cff")
    release, development, _ = evfem.__version__.partition(".dev")  # between releases that of the next one
    unreleased = " (unreleased)" if development else ""
    assert f"\n## {release}{unreleased}\n" in read("CHANGELOG.md")


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
    """Without the sources that it links to."""
    words = ["sphinx", "-W", "--keep-going", "-q", "-t", "quick", str(DOCS), str(tmp_path / "site")]
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "index.html").is_file()


@pytest.mark.site
def test_the_search_finds_no_internals(tmp_path):
    """Neither the words nor the names of a page that says so; its links stay."""
    module = "```{eval-rst}\n.. automodule:: evfem.%s\n```\n"
    pages = {
        "index": "# Start\n\n```{toctree}\nerrors\ninside\n```\n",
        "errors": "# Errors\n\n" + module % "errors",
        "inside": "---\nno-search: true\n---\n\n# Inside\n\n" + module % "simulation.ledger",
    }
    for name, text in pages.items():
        (tmp_path / f"{name}.md").write_text(text)
    out = tmp_path / "site"
    words = [sys.executable, "-m", "sphinx", "-Q", "-c", str(DOCS), str(tmp_path), str(out)]
    assert subprocess.run(words).returncode == 0
    index = (out / "searchindex.js").read_text(encoding="utf-8")
    found = {
        name: json.loads(index[index.index("{") : index.rindex("}") + 1])[name]
        for name in ("objects", "terms")
    }
    assert "evfem.errors" in found["objects"]
    assert "evfem.simulation.ledger" not in found["objects"]
    assert "admiss" in found["terms"]
    assert "ledger" not in found["terms"]
    assert 'id="evfem.simulation.ledger.EnergyAccount"' in (out / "inside.html").read_text(encoding="utf-8")


MAKER = runpy.run_path(str(DOCS / "notebooks.py"))


CELLS = """# ---
# jupyter: percent
# ---

# %% [markdown]
# # A title
#
# Some words.

# %%
import matplotlib.pyplot as plt

plt.plot([0.0, 1.0])
plt.show()
print("drawn")

# %%
a = 2
a + 1
"""


def test_a_cell_has_what_it_prints_its_value_and_its_picture_below(tmp_path):
    (tmp_path / "small.py").write_text(CELLS)
    text = MAKER["page"](tmp_path / "small.py")
    assert text.startswith("# A title\n\nSome words.\n\n```python\nimport matplotlib")
    code, drawn = text.split("```text\ndrawn\n```\n\n")
    assert code.count("```python") == 1
    assert drawn.startswith("![what the cell draws](data:image/png;base64,")
    assert text.endswith("```python\na = 2\na + 1\n```\n\n```text\n3\n```\n")


def test_every_notebook_has_its_page():
    pages = {path.stem for path in (DOCS / "notebooks").glob("*.md")} - {"index"}
    assert pages == {path.stem for path in MAKER["NOTEBOOKS"].glob("*.py")}


TABLES = runpy.run_path(str(DOCS / "tables.py"))


def test_the_page_of_keys_is_that_of_the_models():
    """`python docs/tables.py` writes it anew."""
    assert (DOCS / "reference" / "keys.md").read_text(encoding="utf-8") == TABLES["page"]()


def test_the_columns_are_those_of_the_history():
    text = (DOCS / "notation.md").read_text(encoding="utf-8")
    assert TABLES["columns"](text) == text
    for name in COLUMNS:
        unit = f" {UNITS[name]} " if UNITS[name] else " "
        assert f"| `{name}` |{unit}| {MEANINGS[name]} |\n" in text


def test_the_options_of_importers_are_their_fields():
    text = (DOCS / "howto" / "texture.md").read_text(encoding="utf-8")
    assert TABLES["importers"](text) == text
    assert "- `--pixel` (image): width of a pixel of an image in mm; a width above zero; needed.\n" in text


def test_an_entry_says_type_unit_default_range_and_meaning():
    width, _ = [key for one in schema.sections() for key in one.keys if key.name == "ridge_width"]
    assert TABLES["entry"](width) == (
        "- `ridge_width`: number in mm; default `0.5`; 0.3 to 0.8 mm.\n  The pitch, from crest to crest."
    )


def test_the_reference_has_every_public_name_on_the_page_of_its_module():
    text = (DOCS / "reference" / "index.md").read_text(encoding="utf-8")
    assert TABLES["public_names"](text) == text
    assert [name for name in evfem.__all__ if text.count(f"\n- `ev.{name}`: ") != 1] == []


def test_pages_of_the_reference_begin_with_what_a_user_makes():
    """Or leave the search: a page that it finds begins with a module of public names."""
    public = {*evfem._HOME.values(), *evfem._MODULES.values(), "field.rigid"}
    for page in (DOCS / "reference").glob("*.md"):
        text = page.read_text(encoding="utf-8")
        shown = re.findall(r"automodule:: evfem\.([\w.]+)", text)
        assert not shown or shown[0] in public or text.startswith("---\nno-search: true\n"), page.stem

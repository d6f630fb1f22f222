"""How the site is built: `sphinx-build -W docs build/docs`, then open `build/docs/index.html`."""

import sys
from importlib.util import find_spec
from pathlib import Path

from sphinx.domains.python import PythonDomain
from sphinx.ext.napoleon import Config, NumpyDocstring

import evfem

sys.path.insert(0, str(Path(__file__).parent))
from notebooks import NOTEBOOKS, page
from thumbnails import with_thumbnails

for name in evfem.__all__:
    getattr(evfem, name)  # and so has its parameters in its docstring

project = "evfem"
version = release = evfem.__version__
language = "en"

extensions = [
    "myst_parser",  # pages in Markdown
    "sphinx.ext.autodoc",  # reference from docstrings
    "sphinx-mathjax-offline",  # equations without a network
]
# highlighted sources, nearly half of the time, but with `-t quick`; sphinx knows `tags`
extensions += ["sphinx.ext.viewcode"] * ("quick" not in tags)  # noqa: F821
extensions += ["sphinx_copybutton"] * (find_spec("sphinx_copybutton") is not None)
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

default_role = "py:obj"  # `name` in a docstring links where it can
autodoc_default_options = {"members": True, "member-order": "bysource", "ignore-module-all": True}
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_use_unqualified_type_names = True
maximum_signature_line_length = 90
add_module_names = False

html_theme = "furo"
html_title = f"evfem {release}"
html_static_path = ["_static"]
html_css_files = ["site.css", "gallery.css"]
html_js_files = ["zoom.js", "access.js"]
copybutton_selector = "div:not(.highlight-text) > div.highlight > pre"  # what is printed is not copied
html_show_copyright = False
html_copy_source = False


def sections(app, what, name, obj, options, lines):
    """Sections Parameters, Returns, Raises, Examples of functions and classes; as an extension
    napoleon would take the first words of an attribute's docstring for its type.
    """
    if what in ("class", "exception", "function", "method"):
        lines[:] = NumpyDocstring(lines, Config(), app, what, name, obj, options).lines()


def notebook(app, name, source):
    """Pages in `notebooks` are the notebooks of their names, run."""
    folder, _, file = name.rpartition("/")
    if folder == "notebooks" and file != "index":
        source[0] = page(NOTEBOOKS / f"{file}.py")


class Searched(PythonDomain):
    """The search finds no names of a page that it leaves out; links to them stay."""

    def get_objects(self):
        for *found, priority in super().get_objects():
            hidden = "no-search" in self.env.metadata.get(found[3], {})
            yield *found, -1 if hidden else priority


def gallery(app, name, source):
    """The gallery with thumbnails and downloads."""
    if name == "gallery":
        source[0] = with_thumbnails(source[0])


def setup(app):
    app.add_domain(Searched, override=True)
    app.connect("autodoc-process-docstring", sections)
    app.connect("source-read", notebook)
    app.connect("source-read", gallery)

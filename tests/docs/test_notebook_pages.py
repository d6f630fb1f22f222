"""Notebooks become pages with what their cells print, give and draw."""

import runpy
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
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

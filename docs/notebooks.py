"""Notebooks as pages: each cell of a Python file in percent format, run, with what it prints, its last
value and its pictures below it. `conf.py` puts them in place of the pages in `docs/notebooks` when the site
is built.
"""

from __future__ import annotations

import ast
import base64
import io
import logging
import re
import sys
from contextlib import chdir, redirect_stdout
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

NOTEBOOKS = Path(__file__).resolve().parents[1] / "studies" / "notebooks"
CELL = re.compile(r"^# %%(.*)\n", re.M)


def page(path: Path) -> str:
    """The notebook as Markdown, run in a folder of its own and without sliders."""
    import matplotlib

    matplotlib.use("Agg")
    sys.modules["ipywidgets"] = None  # type: ignore[assignment]  # as where it is not installed
    logging.getLogger("skfem").setLevel(logging.WARNING)  # Sphinx shows the information of all loggers
    _, *cells = CELL.split(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "notebook"}
    parts = []
    with TemporaryDirectory() as folder, chdir(folder):
        for kind, text in zip(cells[::2], cells[1::2], strict=True):
            if "[markdown]" in kind:
                parts.append(re.sub(r"^# ?", "", text, flags=re.M).strip())
            elif text.strip():
                parts += [f"```python\n{text.strip()}\n```", *outputs(text, names)]
    return "\n\n".join(parts) + "\n"


def outputs(text: str, names: dict[str, Any]) -> list[str]:
    """Run a cell; blocks of what it prints, with the value of its last line, and of its pictures."""
    import matplotlib.pyplot as plt

    pictures: list[str] = []

    def show() -> None:
        for number in plt.get_fignums():
            file = io.BytesIO()
            plt.figure(number).savefig(file, format="png", dpi=90)
            coded = base64.b64encode(file.getvalue()).decode()
            pictures.append(f"![what the cell draws](data:image/png;base64,{coded})")
        plt.close("all")

    tree = ast.parse(text)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    with redirect_stdout(io.StringIO()) as printed, patch.object(plt, "show", show):
        exec(compile(tree, "cell", "exec"), names)
        if last is not None:
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
            if value is not None:
                print(repr(value))
        show()
    said = printed.getvalue().rstrip()
    return [f"```text\n{said}\n```"] * bool(said) + pictures

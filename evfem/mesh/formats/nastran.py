"""Decks of Nastran (`.bdf`, `.fem`, `.nas`): what meshio passes over in them is refused.

meshio wants BEGIN BULK, which Gmsh does not write. Source: MSC Nastran quick reference guide (2021).
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import meshio

#: axes of nodes (their third field), in three formats, and other files
REFUSED = re.compile(
    r"^(GRID)(?:\*[^,\n]{19} {0,15}|[^,*\n]{12} {0,7}|\*? *,[^,\n]*, *)[1-9]|^ *(INCLUDE|GRDSET)\b",
    re.I | re.M,
)
BULK = re.compile(r"^\s*BEGIN\s+BULK.*$", re.I | re.M)


def read(path: Path) -> meshio.Mesh:
    """What meshio reads of the bulk data. Raises ValueError that says what is not read."""
    from meshio.nastran import _nastran

    text = path.read_text(encoding="utf-8", errors="replace")
    if found := REFUSED.search(text):
        card = "GRID in axes of its own" if found[1] else found[2].upper()
        raise ValueError(f"{card}, which is not read: give nodes in the basic axes, in one file")
    begin = BULK.search(text)
    cards = text[begin.end() if begin else 0 :]
    if not has_cards(cards):
        raise ValueError("no cards")
    return _nastran.read_buffer(io.StringIO("BEGIN BULK\n" + cards))


def has_cards(text: str) -> bool:
    """Whether there is a line that is a card.

    >>> has_cards("$ a note\\nGRID,1,,0.,0.,0."), has_cards("$ a note")
    (True, False)
    """
    return any(len(line) > 3 and not line.startswith(("$", "//", "#")) for line in io.StringIO(text))

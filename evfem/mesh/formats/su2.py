"""SU2 (`.su2`): cells of the body, which have no names, and markers of its edges or faces by their tags.

Source: SU2 v7, Mesh File (the documentation of the format), and files of Gmsh 4.15, which writes second order
too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evfem.mesh.groups import Group

if TYPE_CHECKING:
    import meshio

#: kinds of cells by VTK's numbers, and their nodes; SU2 itself knows those of first order
KINDS: Mapping[int, tuple[str, int]] = {
    3: ("line", 2), 5: ("triangle", 3), 9: ("quad", 4), 10: ("tetra", 4), 12: ("hexahedron", 8),
    13: ("wedge", 6), 14: ("pyramid", 5), 21: ("line3", 3), 22: ("triangle6", 6), 28: ("quad9", 9),
    29: ("hexahedron27", 27),
}  # fmt: skip
Blocks = dict[str, list[list[int]]]


def read(path: Path) -> meshio.Mesh:
    """Points (N, 2 or 3), cells in one group without a name and with the number 0, markers as groups.

    Raises ValueError that says what is not read.
    """
    import meshio

    points: list[list[float]] = []
    parts: list[tuple[str | None, int, Blocks]] = []
    tag, dimension = "", 2
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = (line.partition("%")[0].strip() for line in file)  # without remarks
        lines = (line for line in lines if line)
        for line in lines:
            word, _, value = (part.strip() for part in line.partition("="))
            if word == "NZONE" and int(value) > 1:
                raise ValueError(f"{value} zones: keep one")
            if word == "NDIME":
                dimension = int(value)
            elif word == "NPOIN":
                rows = islice(lines, int(value.split()[0]))
                points = [[float(one) for one in row.split()[:dimension]] for row in rows]
            elif word == "NELEM":
                parts.append((None, 0, _cells(lines, int(value))))
            elif word == "MARKER_TAG":
                tag = value
            elif word == "MARKER_ELEMS":
                parts.append((*_label(tag, len(parts)), _cells(lines, int(value))))
    blocks = [(kind, name, number, rows) for name, number, of in parts for kind, rows in of.items()]
    raw = meshio.Mesh(np.array(points), [(kind, np.array(rows)) for kind, _, _, rows in blocks])
    raw.groups = [
        Group(name, number, k, np.arange(len(rows))) for k, (_, name, number, rows) in enumerate(blocks)
    ]
    return raw


def _label(tag: str, place: int) -> tuple[str | None, int]:
    """Name and number of a marker: a tag that is a number is no name."""
    return (None, int(tag)) if tag.isdigit() else (tag, place)


def _cells(lines: Iterator[str], count: int) -> Blocks:
    """Nodes by kind; what follows them in a line is the cell's number."""
    found: Blocks = {}
    for line in islice(lines, count):
        number, *nodes = (int(word) for word in line.split())
        if number not in KINDS:
            raise ValueError(f"cells of the type {number}, which are not read")
        kind, width = KINDS[number]
        if len(nodes) < width:
            raise ValueError(f"a {kind} of {len(nodes)} nodes")
        found.setdefault(kind, []).append(nodes[:width])
    return found

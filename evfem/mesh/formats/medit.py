"""Medit (`.mesh`, `.meshb`): numbers of regions and boundaries, first order alone.

meshio knows no kinds of second order, which Gmsh 4.15 writes as EdgesP2 and TrianglesP2, but quads and
hexahedra of 9 and 27 nodes below the keywords of 4 and 8.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import meshio

#: keywords of second order, or rows of more numbers than first order has
SECOND = re.compile(
    rb"^\s*[A-Z][a-z]+[PQ]2\s*$|^\s*(?:Quadrilaterals|Hexahedra)\s+\d+[ \t]*\r?\n[ \t]*(?:\d+[ \t]+){9}\d",
    re.M,
)


def read(path: Path) -> meshio.Mesh:
    """What meshio reads. Raises ValueError for second order."""
    import meshio

    if path.suffix.lower() == ".mesh" and SECOND.search(path.read_bytes()):
        raise ValueError("cells of second order, which are not read from .mesh: save as .msh")
    return meshio.read(path)

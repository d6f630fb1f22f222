"""What the readers of mesh files share: the parts of a file, and limits; and the files that meshio reads.

meshio reads every format but Gmsh's, for which there is a reader of our own (`evfem.mesh.msh`):
meshio's takes the last node for one that does not exist, keeps one physical group of two with the
same name, and refuses entities without a group. meshio knows no limits of memory: a compressed file
may inflate to far more than `LARGEST`, and should come from people one trusts.
"""

from __future__ import annotations

import contextlib
import io
import re
import warnings
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints

#: largest mesh file in bytes
LARGEST = 128 * 2**20
#: most physical names
MOST_NAMES = 1_000
#: a document type, and with it entities, in UTF-8 or UTF-16
DOCUMENT_TYPE = re.compile(rb"<\0?!\0?D")


class Unreadable(ValueError):
    """A file is not what its ending says, in words that can follow the file's name in brackets."""


@dataclass
class Parts:
    """Points (N, 3) as these formats have them, whose third column `evfem.mesh.file` checks and
    cuts off; blocks (kind, cells (E, n)) in the order of the file; data of points; data of cells
    as one array per block; named numbers; Gmsh's physical names by (dimension, number).
    """

    points: Floats
    blocks: list[tuple[str, Ints]]
    point_data: dict[str, np.ndarray] = field(default_factory=dict)
    cell_data: dict[str, list[np.ndarray]] = field(default_factory=dict)
    field_data: dict[str, np.ndarray] = field(default_factory=dict)
    names: dict[tuple[int, int], str] = field(default_factory=dict)


def parsed(text: str | bytes, dtype: Any = float) -> np.ndarray:
    """All numbers of a text, separated by blanks; raises `Unreadable` for anything else in it.

    >>> parsed(" 1 2.5\\n3 ").tolist()
    [1.0, 2.5, 3.0]
    """
    if not text.strip():
        return np.zeros(0, dtype)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(text, dtype, sep=" ")
        except (DeprecationWarning, ValueError, OverflowError) as error:
            raise Unreadable("something else where numbers should be") from error


def integers(values: np.ndarray) -> Ints:
    """The values as whole numbers; raises `Unreadable` where they are none."""
    if values.dtype.kind not in "iuf" or not np.isfinite(values).all() or (np.abs(values) > 2.0**53).any():
        raise Unreadable("numbers out of range")
    whole = values.astype(np.int64)
    if (whole != values).any():
        raise Unreadable("fractions where whole numbers should be")
    return whole


def read(path: Path) -> Parts:
    """The parts of a mesh file; raises `Unreadable` if meshio does not know its ending or cannot
    read it.
    """
    import meshio

    if path.suffix.lower() not in meshio.extension_to_filetypes:
        raise Unreadable(f"meshio knows no format {path.suffix or 'without an ending'}")
    if path.suffix.lower() == ".vtu" and DOCUMENT_TYPE.search(path.read_bytes()):
        raise Unreadable("a document type")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # its readers raise anything, and leave where the file is wrong
        reason = said.getvalue() if isinstance(error, SystemExit) else str(error)
        raise Unreadable(f"meshio misses {reason}" if isinstance(error, KeyError) else reason) from error
    return Parts(
        points=np.asarray(mesh.points, dtype=float),
        blocks=[(block.type, np.asarray(block.data)) for block in mesh.cells],
        point_data={name: np.asarray(values) for name, values in mesh.point_data.items()},
        cell_data={name: [np.asarray(one) for one in values] for name, values in mesh.cell_data.items()},
        field_data={name: np.asarray(values) for name, values in mesh.field_data.items()},
    )

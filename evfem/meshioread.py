"""Reads every other mesh format that meshio knows: VTK legacy, Abaqus, MED and so on.

These readers know no limits of memory and time, so such files should come from people one trusts; the strict
readers of `.vtu` and `.msh` (`evfem.vturead`, `evfem.mshread`) take files from anywhere.
"""

from __future__ import annotations

import contextlib
import io
from pathlib import Path

import numpy as np

from evfem.meshparts import Parts, Unreadable


def read(path: Path) -> Parts:
    """The parts of a mesh file; raises `Unreadable` if meshio does not know its ending or cannot read it."""
    import meshio

    if path.suffix.lower() not in meshio.extension_to_filetypes:
        raise Unreadable(f"meshio knows no format {path.suffix or 'without an ending'}")
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # its readers raise anything, and leave where the file is wrong
        raise Unreadable(str(error) if isinstance(error, Exception) else said.getvalue()) from error
    return Parts(
        points=np.asarray(mesh.points, dtype=float),
        blocks=[(block.type, np.asarray(block.data)) for block in mesh.cells],
        point_data={name: np.asarray(values) for name, values in mesh.point_data.items()},
        cell_data={name: [np.asarray(one) for one in values] for name, values in mesh.cell_data.items()},
        field_data={name: np.asarray(values) for name, values in mesh.field_data.items()},
    )

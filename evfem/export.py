"""ParaView series: one uncompressed .vtu per step and a .pvd index that is valid after every step.

Points are in the reference configuration (mm); displacement has three components, so that "Warp By
Vector" shows the deformed finger. Cells keep the VTK node order of the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from evfem.common.storage import replacing, write_text
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.simulation.result import CELL_FIELDS, POINT_FIELDS, Frame, Result, Row

#: steps at which neither time nor position advances are told apart by this much (s or mm)
INSTANT = 1e-9


def paraview(result: Result, path: str | Path) -> Path:
    """Write the frames of `result` as a series: `path` (.pvd) and one .vtu for each frame beside
    it.

    Returns the path of the index. Raises InputError for another ending, StorageError when the disk
    refuses.
    """
    series = ParaViewSeries(path)
    rows = {row["step"]: row for row in result.rows}
    for frame in result.frames:
        series.add(rows[frame.step], frame, result.mesh)
    series.write_index()
    return series.path


def write_frame(mesh: Mesh, frame: Frame, path: str | Path) -> None:
    """Write one step as a .vtu file: points, displacement and all fields of CONTRACT's names.

    Field data `region:NAME` hold the numbers of the regions, as in the files of `meshfile.write`.
    """
    import meshio
    from meshio.vtu import write as write_vtu

    point_data = {"displacement": _three(frame.displacement)}
    point_data |= {name: np.ascontiguousarray(getattr(frame, name)) for name in POINT_FIELDS}
    cell_data = {"region": [np.asarray(mesh.region)]}
    cell_data |= {name: [np.ascontiguousarray(getattr(frame, name))] for name in CELL_FIELDS}
    grid = meshio.Mesh(_three(mesh.points), [(mesh.kind, mesh.cells)], point_data, cell_data)
    with replacing(path) as temporary:
        write_vtu(str(temporary), grid, compression=None)
        meshfile.add_region_names(temporary, mesh)


class ParaViewSeries:
    """Writes a series while a run goes on: an observer of `evfem.simulation.run`, or fed by `add`.

    Files are named after the index: fields.pvd, fields_00001.vtu, ... The value of an entry is the
    time if time passes, else the position; see `instants`. `earlier` rows belong to a run that is
    continued: their .vtu files, where present, stay in the index.
    """

    def __init__(self, path: str | Path, earlier: Sequence[Row] = ()) -> None:
        self.path = Path(path)
        if self.path.suffix != ".pvd":
            raise InputError("path", str(path), "a file name that ends in .pvd")
        self._mesh: Mesh | None = None
        self._rows = [row for row in earlier if self.frame_path(int(row["step"])).exists()]

    def frame_path(self, step: int) -> Path:
        """Where the fields of a step go."""
        return self.path.with_name(f"{self.path.stem}_{step:05d}.vtu")

    def started(self, mesh: Mesh, scene: object, total_steps: int) -> None:
        """Observer of `simulate`: the mesh is known."""
        self._mesh = mesh

    def step(self, row: Row, frame: Frame | None, checkpoint: object = None) -> None:
        """Observer of `simulate`: a step has converged; its fields and the new index go to disk."""
        if frame is not None and self._mesh is not None:
            self.add(row, frame, self._mesh)
            self.write_index()

    def add(self, row: Row, frame: Frame, mesh: Mesh) -> None:
        """Write the fields of one step; the index follows with `write_index`."""
        write_frame(mesh, frame, self.frame_path(frame.step))
        self._rows = [old for old in self._rows if old["step"] < row["step"]] + [row]

    def write_index(self) -> None:
        """Write the .pvd file in one step; every file it names is complete."""
        root = ElementTree.Element("VTKFile", type="Collection", version="0.1", byte_order="LittleEndian")
        collection = ElementTree.SubElement(root, "Collection")
        for row, value in zip(self._rows, instants(self._rows), strict=True):
            name = self.frame_path(int(row["step"])).name
            ElementTree.SubElement(collection, "DataSet", timestep=repr(value), part="0", file=name)
        ElementTree.indent(root)
        write_text(
            self.path, '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
        )


def instants(rows: Sequence[Mapping[str, Any]]) -> list[float]:
    """A strictly increasing value for each step, as ParaView needs: time, or distance travelled.

    Time (s) if any passes, else the distance travelled (mm), which on a slide towards +x is the
    position. Steps in which neither advances follow each other by 1e-9.

    >>> instants([{"time": 0.0, "position": x} for x in (0.0, 0.0, 0.5, 1.0)])
    [0.0, 1e-09, 0.5, 1.0]
    >>> instants([{"time": t, "position": 0.0} for t in (0.1, 0.2)])
    [0.1, 0.2]
    """
    values = np.array([float(row["time"]) for row in rows])
    if not values.any():
        values = np.array([float(row["position"]) for row in rows])
        if np.any(np.diff(values) < 0.0):
            values = np.cumsum(np.abs(np.diff(values, prepend=0.0)))
    result: list[float] = []
    for value in values.tolist():
        result.append(max(value, result[-1] + INSTANT) if result else value)
    return result


def _three(vectors: np.ndarray) -> np.ndarray:
    """(N, 2) vectors with a zero third component."""
    return np.column_stack([vectors, np.zeros(len(vectors))])

"""VTK's files: `.vtu` with texts beside its numbers, and what VTK alone reads: LZ4, much of `.vtk`.

PyVista 0.49 writes the names of its bool arrays as a text. VTK 9.7 writes version 5.1 of `.vtk`, of which
meshio 5.3 knows neither long integers nor texts, and passes over scalars of UInt8, which are colours there;
VTK in turn reads no integers of meshio's `.vtk`, so that meshio is asked first.
"""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

if TYPE_CHECKING:
    import meshio

LZ4, TEXT, RAW, COLOURS = b"vtkLZ4DataCompressor", b'type="String"', b'encoding="raw"', b"COLOR_SCALARS"
#: texts where numbers are needed, which are not read
NAMED = re.compile(rb'type="String" Name="(region|pad|bone)"|^(region|pad|bone) \d+ \d+ string', re.MULTILINE)
#: seconds after which VTK is not waited for
LONGEST = 300.0
#: what to do without VTK
SAVE = {
    ".vtk": "a kind of .vtk that is read with VTK alone: pip install 'evfem[vtk]', or save as .vtu",
    ".vtu": "LZ4, or texts beside raw data, which are read with VTK alone: pip install 'evfem[vtk]', or save "
    "with SetCompressorTypeToZLib and EncodeAppendedDataOn",
}


def read(path: Path) -> meshio.Mesh:
    """What meshio reads of a file, or of what VTK makes of it, with the names of the `texts` that are missed.
    Raises ValueError that says what to do.
    """
    content = path.read_bytes()
    raw = _read(path, content)
    raw.texts = sorted({(one or other).decode() for one, other in NAMED.findall(content)})
    return raw


def _read(path: Path, content: bytes) -> meshio.Mesh:
    import meshio

    ending = path.suffix.lower()
    with TemporaryDirectory() as folder:
        clean = Path(folder, "mesh.vtu")
        if ending == ".vtk" and content.startswith(b"# vtk DataFile"):
            if COLOURS not in content:
                with suppress(Exception, SystemExit):
                    return meshio.read(path)
            _by_vtk(path, clean)
        elif ending == ".vtu" and (LZ4 in content[:1000] or (TEXT in content and RAW in content)):
            _by_vtk(path, clean)
        elif ending == ".vtu" and TEXT in content:
            _without_texts(content, clean)
        else:
            return meshio.read(path)
        return meshio.read(clean)


def _without_texts(content: bytes, clean: Path) -> None:
    """Write a `.vtu` without its arrays of texts."""
    root = ElementTree.fromstring(content)
    for parent in list(root.iter()):
        for child in parent.findall("Array[@type='String']"):
            parent.remove(child)
    ElementTree.ElementTree(root).write(clean)


def _by_vtk(path: Path, clean: Path) -> None:
    """Write a `.vtu` of numbers from what VTK reads, in a process of its own: damaged files end it."""
    if find_spec("vtkmodules") is None:
        raise ValueError(SAVE[path.suffix.lower()])
    command = [sys.executable, "-P", __file__, str(path.resolve()), str(clean)]
    run = subprocess.run(command, capture_output=True, timeout=LONGEST, check=False)
    if run.returncode or not clean.is_file():
        raise ValueError("damaged, or without cells")


def convert(path: str, clean: str) -> None:
    """Write a `.vtu` without texts; VTK writes none where nothing was read."""
    from vtkmodules.vtkFiltersCore import vtkAppendFilter
    from vtkmodules.vtkIOLegacy import vtkDataSetReader
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader, vtkXMLUnstructuredGridWriter

    legacy = path.lower().endswith(".vtk")
    reader: Any = vtkDataSetReader() if legacy else vtkXMLUnstructuredGridReader()
    if legacy:
        reader.ReadAllScalarsOn()
        reader.ReadAllFieldsOn()
    reader.SetFileName(path)
    append = vtkAppendFilter()  # makes other kinds of grids unstructured
    append.AddInputConnection(reader.GetOutputPort())
    append.Update()
    grid = append.GetOutput()
    for data in (grid.GetPointData(), grid.GetCellData(), grid.GetFieldData()):
        for name in [data.GetAbstractArray(k).GetName() for k in range(data.GetNumberOfArrays())]:
            if data.GetArray(name) is None:  # a text
                data.RemoveArray(name)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileName(clean)
    writer.Write()


if __name__ == "__main__":
    convert(*sys.argv[1:])

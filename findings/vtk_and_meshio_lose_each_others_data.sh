#!/usr/bin/env bash
# Guess: VTK reads legacy files (.vtk, version 5.1, the default of both) of meshio with all data, and meshio reads
# those of VTK or says that it does not.
# Seen with meshio 5.3.5 (numpy 2.3.5) and vtk 9.7.2, Python 3.11: of a file of meshio's VTK has the cells and
# none of its integers (a line on the standard error, "Unsupported data type: vtktypeint32", no failure). Of a
# text file of VTK's whose point data begin with unsigned bytes, which it writes as COLOR_SCALARS, meshio has the
# cells and no point data at all, without a word: it skips 8 bytes for each of the colours, as if they were
# binary, and with them the integers that follow.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet meshio==5.3.5 numpy==2.3.5 vtk==9.7.2
venv/bin/python - <<'CODE'
import meshio
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkIOLegacy import vtkUnstructuredGridReader, vtkUnstructuredGridWriter

x, y = np.meshgrid(np.arange(6.0), np.arange(6.0))
points = np.column_stack([x.ravel(), y.ravel(), 0.0 * x.ravel()])
first = (6 * np.arange(5)[:, None] + np.arange(5)).reshape(-1, 1)
region = {"region": [np.arange(25, dtype=np.int32)]}
meshio.Mesh(points, [("quad", first + [0, 1, 7, 6])], cell_data=region).write("meshio.vtk")
reader = vtkUnstructuredGridReader()
reader.SetFileName("meshio.vtk")
reader.ReadAllScalarsOn()
reader.ReadAllFieldsOn()
reader.Update()
grid = reader.GetOutput()
arrays = grid.GetCellData().GetNumberOfArrays()
print("of meshio's file VTK reads", grid.GetNumberOfCells(), "cells and", arrays, "arrays; right: 25 and 1")
assert (grid.GetNumberOfCells(), arrays) == (25, 0)

for name, values in (("pad", points[:, 1] == 0.0), ("layer", points[:, 1] > 3.0)):
    array = numpy_to_vtk(values.astype({"pad": np.uint8, "layer": np.int32}[name]), deep=True)
    array.SetName(name)
    grid.GetPointData().AddArray(array)
grid.GetPointData().SetActiveScalars("pad")
writer = vtkUnstructuredGridWriter()
writer.SetInputData(grid)
writer.SetFileName("vtk.vtk")
writer.Write()
found = meshio.read("vtk.vtk")
print("of VTK's file meshio reads", found.cells, "and the arrays", list(found.point_data), "; right: pad, layer")
assert len(found.cells) == 1 and not found.point_data
CODE

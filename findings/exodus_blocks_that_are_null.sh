#!/usr/bin/env bash
# Guess: an Exodus file that Sandia's exodus_helper writes has its cells in VTK, whose reader is the Exodus library.
# Seen with exodus_helper 1.6.0 (netCDF4 1.7.2, numpy 2.3.5) and vtk 9.7.2, Python 3.11: VTK names the block and
# reads no cell of it, with the exit status 0. exodus_helper sets the status of each block (eb_status) to 0, which
# the library takes for "null object"; with 1 instead VTK reads the cell. meshio 5.3.5 does not ask and reads both.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet exodus_helper==1.6.0 netCDF4==1.7.2 numpy==2.3.5 vtk==9.7.2 meshio==5.3.5
venv/bin/python - <<'CODE'
import shutil

import netCDF4
import numpy as np
from exodus_helper import Exodus

file = Exodus("null.exo", mode="w", numDims=3, numNodes=8, numElems=1, numBlocks=1, time_step=1)
file.put_coords(*np.array([[0, 1, 1, 0] * 2, [0, 0, 1, 1] * 2, [0] * 4 + [1] * 4], dtype=float))
file.put_elem_blk_info(1, "HEX8", 1, 8, 0)
file.put_elem_connectivity(1, np.arange(1, 9))
file.put_elem_blk_name(1, "body")
file.close()
shutil.copy("null.exo", "mended.exo")
with netCDF4.Dataset("mended.exo", "a") as mended:
    print("status of the block:", mended["eb_status"][:].tolist())
    mended["eb_status"][:] = 1
CODE
venv/bin/python - <<'CODE'
import meshio
from vtkmodules.vtkIOExodus import vtkExodusIIReader


def cells(name):
    reader = vtkExodusIIReader()
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutput().GetBlock(0).GetBlock(0).GetNumberOfCells()


found = {name: (cells(name), len(meshio.read(name).cells[0])) for name in ("null.exo", "mended.exo")}
print("cells that VTK and meshio read, right: 1 each:", found)
assert found == {"null.exo": (0, 1), "mended.exo": (1, 1)}
CODE

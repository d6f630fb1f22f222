#!/usr/bin/env bash
# Guess: a mesh of quadrilaterals of second order that Gmsh saves as a deck of Abaqus has elements of the
# plane (CPS8, CPE8) or is at least read by the usual reader.
# Seen with gmsh 4.15.0 and meshio 5.3.5 (numpy 2.3.5), Python 3.11: they are membranes with nine nodes,
# M3D9, and meshio ends the program (SystemExit) with "Element type not available: M3D9".
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet gmsh==4.15.0 meshio==5.3.5 numpy==2.3.5
venv/bin/python - <<'CODE'
import contextlib
import io

import gmsh
import meshio

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
gmsh.model.occ.synchronize()
gmsh.model.addPhysicalGroup(2, [1], name="body")
for name, value in (("RecombineAll", 1), ("ElementOrder", 2), ("MeshSizeMax", 0.5)):
    gmsh.option.setNumber(f"Mesh.{name}", value)
gmsh.model.mesh.generate(2)
gmsh.write("square.inp")
with open("square.inp") as file:
    kinds = {line.split("type=")[1].split(",")[0] for line in file if line.startswith("*ELEMENT")}
print("elements of the deck:", kinds)
assert kinds == {"M3D9"}
said = io.StringIO()
try:
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        meshio.read("square.inp")
except SystemExit:
    print("meshio leaves the program:", " ".join(said.getvalue().split()))
assert "Element type not available: M3D9" in said.getvalue()
CODE

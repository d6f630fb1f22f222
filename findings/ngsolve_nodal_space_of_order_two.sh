#!/usr/bin/env bash
# Guess: NodalFESpace(mesh, order=2), whose documentation calls `order` the order of the finite element space, has an
# unknown for each vertex and each edge, as H1 of order 2 has: the nodal elements that other packages call P2 and Q2.
# Seen with NGSolve 6.2.2608, Python 3.11: it has one for each vertex alone, on triangles and on quadrilaterals, while
# its elements have those of order 2; nothing is told until a matrix is assembled, which ends with an error
# ("Inconsistent number of degrees of freedom"). Order 1 is right.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet ngsolve==6.2.2608
venv/bin/python - <<'CODE'
import ngsolve as ng
from ngsolve.meshes import MakeStructured2DMesh

for quads in (False, True):
    mesh = MakeStructured2DMesh(quads=quads, nx=2, ny=2)
    whole = ng.H1(mesh, order=2).ndof
    nodal = ng.NodalFESpace(mesh, order=2)
    print("quadrilaterals" if quads else "triangles", end=": ")
    print("H1 of order 2 has", whole, "unknowns, NodalFESpace", nodal.ndof, "at", mesh.nv, "vertices")
    assert nodal.ndof == mesh.nv < whole
    u, v = nodal.TnT()
    try:
        ng.BilinearForm(u * v * ng.dx).Assemble()
    except Exception as error:
        print(str(error).splitlines()[-1])
        assert "Inconsistent number of degrees of freedom" in str(error)
    else:
        raise AssertionError("the matrix is assembled now")
    assert ng.NodalFESpace(mesh, order=1).ndof == mesh.nv
CODE

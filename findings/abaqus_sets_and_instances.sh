#!/usr/bin/env bash
# Guess: two cards *NSET of one name add up, as CalculiX and Abaqus read them, and the shift of an *INSTANCE
# moves its nodes.
# Seen with meshio 5.3.5 (numpy 2.3.5), Python 3.11: the last card of a name is the whole set, and the
# line below *INSTANCE is passed over; neither is told.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet meshio==5.3.5 numpy==2.3.5
body='*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 1., 1., 0.
4, 0., 1., 0.
*ELEMENT, TYPE=CPS4, ELSET=body
1, 1, 2, 3, 4'
printf '%s\n*NSET, NSET=held\n1, 2\n*NSET, NSET=held\n3\n' "$body" >sets.inp
{
    printf '*PART, NAME=P\n%s\n*END PART\n' "$body"
    printf '*ASSEMBLY, NAME=A\n*INSTANCE, NAME=I, PART=P\n5., 0., 0.\n*END INSTANCE\n*END ASSEMBLY\n'
} >shifted.inp
venv/bin/python - <<'CODE'
import meshio

held = meshio.read("sets.inp").point_sets["held"].tolist()
print("held, right: nodes 0, 1, 2; read:", held)
assert held == [2]
x = meshio.read("shifted.inp").points[:, 0].tolist()
print("x of the shifted part, right: 5, 6, 6, 5; read:", x)
assert x == [0.0, 1.0, 1.0, 0.0]
CODE

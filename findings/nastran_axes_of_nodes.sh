#!/usr/bin/env bash
# Guess: a node of Nastran that is given in a coordinate system of its own (field CP of GRID) is turned into
# the basic axes, or the reader refuses the deck.
# Seen with meshio 5.3.5 (numpy 2.3.5), Python 3.11: radius, angle and z of a cylindrical system are taken as
# x, y, z, without a word. A half circle of radius 2 mm becomes a straight line 180 mm long.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet meshio==5.3.5 numpy==2.3.5
cat >half_circle.bdf <<'DECK'
CEND
BEGIN BULK
CORD2C,1,,0.,0.,0.,0.,0.,1.
,1.,0.,0.
GRID,1,1,2.,0.,0.
GRID,2,1,2.,90.,0.
GRID,3,1,2.,180.,0.
CTRIA3,1,1,1,2,3
ENDDATA
DECK
venv/bin/python - <<'CODE'
import meshio

found = meshio.read("half_circle.bdf").points.tolist()
print("right: [2, 0, 0], [0, 2, 0], [-2, 0, 0]")
print("read: ", found)
assert found == [[2.0, 0.0, 0.0], [2.0, 90.0, 0.0], [2.0, 180.0, 0.0]]
CODE

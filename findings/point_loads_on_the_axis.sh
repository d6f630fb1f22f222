#!/usr/bin/env bash
# Guess: a point load on an axisymmetric body is multiplied by 2 pi, as its page says of `axisymmetric=True`, wherever
# it acts, so that what pushes on the axis, as the tip of an indenter does, pushes.
# Seen with felupe 11.3.0 (numpy 2.4.6, scipy 1.17.1), Python 3.11: it is multiplied by 2 pi r, r the distance of the
# point from the axis. A load on the axis is none, without a word: the solution is that of a body without loads. At
# r = 0.5 it is half of what the page says, at 2 twice. On the axis `axisymmetric=False` takes the whole force.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet felupe==11.3.0 numpy==2.4.6 scipy==1.17.1
venv/bin/python - <<'CODE'
import felupe
import numpy as np

FORCE = 0.01


def push(radius, axisymmetric):
    """Force on the foot of a cylinder of height 1 and radius 2, by its stresses, and how far the point goes down."""
    mesh = felupe.Rectangle(a=(0.0, 0.0), b=(1.0, 2.0), n=(11, 21))  # x along the axis, y the radius
    field = felupe.FieldContainer([felupe.FieldAxisymmetric(felupe.RegionQuad(mesh), dim=2)])
    solid = felupe.SolidBody(felupe.NeoHooke(mu=1.0, bulk=5.0), field)
    point = np.flatnonzero(np.isclose(mesh.points, (1.0, radius)).all(axis=1))
    load = felupe.PointLoad(field, point, values=[[-FORCE, 0.0]], axisymmetric=axisymmetric)
    step = felupe.Step(items=[solid, load], boundaries=felupe.dof.symmetry(field[0]))
    felupe.Job(steps=[step]).evaluate(verbose=0)
    foot = np.isclose(mesh.points[:, 0], 0.0)
    forces = solid.assemble.vector(field).toarray().reshape(-1, 2)
    return float(forces[foot, 0].sum()), float(0.0 - field[0].values[point[0], 0])


# nominal stress times the area: the forces of the body are those of the whole circumference
mesh = felupe.Rectangle(a=(0.0, 0.0), b=(1.0, 2.0), n=(3, 5))
field = felupe.FieldContainer([felupe.FieldAxisymmetric(felupe.RegionQuad(mesh), dim=2)])
field[0].values[:, 0] = 0.1 * mesh.points[:, 0]
solid = felupe.SolidBody(felupe.NeoHooke(mu=1.0, bulk=5.0), field)
top = np.isclose(mesh.points[:, 0], 1.0)
whole = float(solid.assemble.vector(field).toarray().reshape(-1, 2)[top, 0].sum())
nominal = float(solid.results.stress[0][0, 0].mean())
assert abs(whole / (nominal * np.pi * 2.0**2) - 1.0) < 1e-9

for radius in (0.0, 0.5, 1.0, 2.0):
    force, way = push(radius, True)
    said = 2.0 * np.pi * FORCE
    print(f"radius {radius:g}: by the page {said:.4f} acts, in fact {force:.4f}; the point goes down by {way:.4f}")
    assert abs(force - said * radius) < 1e-6
force, way = push(0.0, True)
assert force == way == 0.0
force, way = push(0.0, False)
print(f"axisymmetric=False on the axis: {force:.4f} acts, and the point goes down by {way:.4f}")
assert abs(force - FORCE) < 1e-6
assert way > 0.01
CODE

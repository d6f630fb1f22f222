#!/usr/bin/env bash
# Guess: a list of points x, y, z (.xyz, in m) is put where its x and y say, in whatever order it comes, and lines are
# as far apart as the points.
# Seen with surfalize 0.19.2 (numpy 2.4.6, scipy 1.17.1), Python 3.11: x and y serve for the numbers of points only.
# Heights are taken to come line by line of y, so that of a file by columns (y fastest, as a stage that scans along y
# writes it) the map is scrambled without a word: rms slope (Sdq) 0.126 instead of 0.091 and waves of 36 um instead of
# 50 um, with a right Sq. Points every 5 um are 4.875 um apart along 40 of them. SurfaceTopography 1.27.1 reads the same
# map from both files, every 5 um.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet surfalize==0.19.2 SurfaceTopography==1.27.1 numpy==2.4.6 scipy==1.17.1
venv/bin/python - <<'CODE'
import warnings

import numpy as np

warnings.simplefilter("ignore")
from surfalize import Surface
from SurfaceTopography import read_topography

NX, NY, STEP, WAVE = 40, 30, 5e-6, 50e-6  # m
x, y = np.meshgrid(STEP * np.arange(NX), STEP * np.arange(NY))
z = 1e-6 * np.cos(2.0 * np.pi * x / WAVE)
np.savetxt("lines.xyz", np.stack([one.ravel() for one in (x, y, z)], axis=1))
np.savetxt("columns.xyz", np.stack([one.T.ravel() for one in (x, y, z)], axis=1))

found = {}
for name in ("lines", "columns"):
    surface = Surface.load(f"{name}.xyz")
    found[name] = surface
    print(
        f"{name}: Sq {surface.Sq():.3f} um, Sdq {surface.Sdq():.3f}, waves of {surface.period():.2f} um,"
        f" steps {surface.step_x:.3f} and {surface.step_y:.3f} um"
    )
    other = read_topography(f"{name}.xyz")
    assert np.allclose(np.asarray(other.heights()), z.T, atol=1e-12)
    assert np.allclose(np.array(other.pixel_size), STEP, rtol=1e-6)
assert np.allclose(found["lines"].data, 1e6 * z, atol=1e-9)
assert np.allclose(found["columns"].data, 1e6 * z.T.reshape(NY, NX), atol=1e-9)
for surface in found.values():
    assert abs(surface.Sq() - np.sqrt(0.5)) < 1e-6
    assert abs(surface.step_x - 4.875) < 1e-9  # 39 steps of 5 um, divided by 40
    assert abs(surface.step_y - 29.0 / 30.0 * 5.0) < 1e-9
slope = 2.0 * np.pi / 50.0 / np.sqrt(2.0)  # of the sine: 0.0889
assert abs(found["lines"].Sdq() / slope - 1.0) < 0.03
assert found["columns"].Sdq() > 1.35 * found["lines"].Sdq()
assert abs(found["columns"].period() - 36.25) < 0.01
CODE

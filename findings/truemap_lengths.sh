#!/usr/bin/env bash
# Guess: readers of TrueMap files (.tmd), as GelSight's scanners of skin and prints write them, agree on the unit.
# Lengths and heights are in mm: GelSight's readtmd (gelsightinc/gsmatlab) gives "mmpp", mm per pixel.
# Seen with surfalize 0.19.2, SurfaceTopography 1.27.1 (numpy 2.3.5), Python 3.11: surfalize, whose lengths are all
# in um, takes the numbers of the file for them. A map of 0.8 mm x 0.6 mm with 5 um of amplitude has a width of
# 0.8 um and an Sq of 0.0035 um; slopes (Sdq) are right, so nothing looks wrong. What it saves as .tmd is a
# thousand times too large for the other, which takes mm.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet surfalize==0.19.2 SurfaceTopography==1.27.1 numpy==2.3.5
venv/bin/python - <<'CODE'
import struct
import warnings

import numpy as np

warnings.simplefilter("ignore")
from surfalize import Surface
from SurfaceTopography import read_topography


def by_surface_topography(name):
    """Width and rms height in um."""
    found = read_topography(name)
    factor = {"mm": 1e3, "m": 1e6, "um": 1.0, "µm": 1.0}[found.unit]
    return [round(factor * float(one), 4) for one in (found.physical_sizes[0], found.rms_height_from_area())]


def by_surfalize(name):
    found = Surface.load(name)
    return [round(float(one), 4) for one in (found.step_x * found.size.x, found.Sq())]


x = np.arange(80) * 0.01  # mm
heights = np.tile(0.005 * np.cos(2.0 * np.pi * x / 0.2), (60, 1)).astype("<f4")  # mm
comment = b"Created by TrueMap v6" + b"\r\n\0"
head = b"Binary TrueMap Data File v2.0\r\n\0" + comment + struct.pack("<IIffff", 80, 60, 0.8, 0.6, 0.0, 0.0)
with open("print.tmd", "wb") as file:
    file.write(head + heights.tobytes())
Surface(1e3 * heights.astype(float), 10.0, 10.0).save("saved.tmd")  # the same map, in um

right = [800.0, round(float(5.0 / np.sqrt(2.0)), 4)]
found = {
    "surfalize of the file": by_surfalize("print.tmd"),
    "SurfaceTopography of the file": by_surface_topography("print.tmd"),
    "SurfaceTopography of what surfalize saved": by_surface_topography("saved.tmd"),
}
print("width and rms height in um, right:", right)
for name, values in found.items():
    print(f"{name}: {values}")
assert found["SurfaceTopography of the file"] == right
assert found["surfalize of the file"] == [0.8, 0.0035]
assert np.allclose(found["SurfaceTopography of what surfalize saved"], [1e3 * one for one in right], rtol=1e-4)
CODE

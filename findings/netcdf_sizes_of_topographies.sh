#!/usr/bin/env bash
# Guess: a height map that SurfaceTopography writes to NetCDF and reads again has the sizes and heights that it
# had, to the last digit, as both are double there.
# Seen with SurfaceTopography 1.27.1 (numpy 2.3.5), Python 3.11: heights are kept to the last digit, physical
# sizes only to single precision: 1.2 by 0.8 mm come back as 1.2000000476837158 by 0.800000011920929 mm. Pixels
# of a map before and after differ by 4e-8, and what compares the sizes of two maps for equality says no.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet SurfaceTopography==1.27.1 numpy==2.3.5
venv/bin/python - <<'CODE'
import warnings

import numpy as np

warnings.simplefilter("ignore")
import SurfaceTopography

heights = np.random.default_rng(0).normal(size=(12, 8)) * 1e-3
written = SurfaceTopography.Topography(heights, (1.2, 0.8), periodic=True, unit="mm")
written.to_netcdf("map.nc")
read = SurfaceTopography.open_topography("map.nc").topography()
print("heights kept", np.array_equal(read.heights(), heights), "unit", read.unit)
print("sizes", tuple(float(one) for one in written.physical_sizes), "->", read.physical_sizes)
assert np.array_equal(read.heights(), heights) and read.unit == "mm"
assert read.physical_sizes == (float(np.float32(1.2)), float(np.float32(0.8)))
CODE

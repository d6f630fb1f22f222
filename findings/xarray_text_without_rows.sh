#!/usr/bin/env bash
# Guess: a data set of xarray that is written to a file and read again holds the kinds of values that it had, and
# `identical` would say so if not: text stays text where there are no rows yet, too.
# Seen with xarray 2026.9.0 (netCDF4 1.7.5.1, h5netcdf 1.8.2 with h5py 3.16.0, scipy 1.17.1, zarr 3.1.6, numpy
# 2.4.6), Python 3.11: a variable of text (objects) without rows comes back as float64 by all four engines, with
# one row as text, and `identical` says yes to both. What appends rows of words to such a
# file finds a column of numbers.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet xarray==2026.9.0 netCDF4==1.7.5.1.post1 h5netcdf==1.8.2 h5py==3.16.0 scipy==1.17.1 \
    zarr==3.1.6 numpy==2.4.6
venv/bin/python - <<'CODE'
import numpy as np
import xarray


def again(rows, engine):
    data = xarray.Dataset({"motion": ("step", np.array(rows, dtype=object))})
    path = f"{engine}{len(rows)}"
    if engine == "zarr":
        data.to_zarr(path, consolidated=False)
        found = xarray.load_dataset(path, engine=engine, consolidated=False)
    else:
        data.to_netcdf(path, engine=engine)
        found = xarray.load_dataset(path, engine=engine)
    assert found.identical(data)
    return found.motion.dtype


for engine in ("netcdf4", "h5netcdf", "scipy", "zarr"):
    kinds = again([], engine), again(["press"], engine)
    print(engine, *kinds)
    assert kinds[0] == np.float64
    assert kinds[1].kind in "OUT"
CODE

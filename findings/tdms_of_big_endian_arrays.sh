#!/usr/bin/env bash
# Guess: a force record that scipy reads from a NetCDF-3 file is written to TDMS, the format of NI's data
# acquisition, with its values; or an array in another byte order is refused.
# Seen with npTDMS 1.13.0, scipy 1.17.1, numpy 2.3.5, Python 3.11: numbers in NetCDF-3 are big-endian, and scipy
# hands them on as such. TdmsWriter writes their bytes as they are under the type of little-endian numbers, without
# a word: forces of up to 1 N come back as numbers from 3e-319 to 1e+294, and whole numbers below 100 as up to
# 1.7e+09. Through a list, or with .astype("f8"), they come back as they were.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet npTDMS==1.13.0 scipy==1.17.1 numpy==2.3.5
venv/bin/python - <<'CODE'
import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from scipy.io import netcdf_file

time = np.arange(100) / 1000.0
force = 0.5 + 0.5 * np.sin(2.0 * np.pi * 7.0 * time)
with netcdf_file("force.nc", "w") as file:
    file.createDimension("time", time.size)
    file.createVariable("force", "f8", ("time",))[:] = force
    file.createVariable("step", "i4", ("time",))[:] = np.arange(100)
with netcdf_file("force.nc", mmap=False) as file:
    read = {name: file.variables[name][:].copy() for name in ("force", "step")}
print("byte order of what scipy reads:", {name: one.dtype.str for name, one in read.items()})
assert read["force"].dtype.str == ">f8"
assert np.array_equal(read["force"], force)

ways = {"as read": lambda one: one, "as f8": lambda one: one.astype("f8"), "as a list": list}
for way, given in ways.items():
    with TdmsWriter("force.tdms") as writer:
        writer.write_segment([ChannelObject("finger", name, given(one)) for name, one in read.items()])
    with TdmsFile.open("force.tdms") as file:
        found = {name: file["finger"][name][:] for name in read}
    same = {name: bool(np.array_equal(found[name], read[name])) for name in read}
    ends = {name: (float(np.nanmin(np.abs(one))), float(np.nanmax(one))) for name, one in found.items()}
    print(f"{way}: the same {same}; smallest size and largest value {ends}")
    assert same == dict.fromkeys(read, way != "as read")
    if way == "as read":
        swapped = read["force"].view("<f8")
        assert np.array_equal(found["force"], swapped, equal_nan=True)
CODE

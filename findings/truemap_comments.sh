#!/usr/bin/env bash
# Guess: a reader of TrueMap files (.tmd) takes the comment after the 32 bytes of the head up to its zero byte,
# whatever its length, or says that it did not expect this one.
# Seen with SurfaceTopography 1.27.1 (numpy 2.3.5), Python 3.11: a comment of 24 bytes is taken for granted, as
# TrueMap 6 writes it. Files with a shorter one are said to be of no known format, not to have a comment of
# another length. GelSight's own writers (writetmd) leave the comment empty.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet SurfaceTopography==1.27.1 numpy==2.3.5
venv/bin/python - <<'CODE'
import struct
import warnings

import numpy as np

warnings.simplefilter("ignore")
import SurfaceTopography
from SurfaceTopography.Exceptions import CannotDetectFileFormat


def written(name, comment):
    heights = np.arange(48, dtype="<f4").reshape(6, 8) * 1e-3  # mm
    head = b"Binary TrueMap Data File v2.0\r\n\0" + comment + b"\0"
    sizes = struct.pack("<IIffff", 8, 6, 0.8, 0.6, 0.0, 0.0)
    with open(name, "wb") as file:
        file.write(head + sizes + heights.tobytes())
    return name


def read(name):
    try:
        return SurfaceTopography.open_topography(name).topography().nb_grid_pts
    except CannotDetectFileFormat:
        return "no known format"


found = {length: read(written(f"{length}.tmd", b"x" * (length - 1))) for length in (1, 8, 12, 24)}
print("right: 8 x 6 points each")
print("read: ", found)
assert found == {1: "no known format", 8: "no known format", 12: "no known format", 24: (8, 6)}
CODE

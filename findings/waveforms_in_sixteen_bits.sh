#!/usr/bin/env bash
# Guess: a voltage in double precision that Tektronix's own library writes as .csv, .mat or .wfm is read back by it
# with the digits of the file.
# Seen with tm_data_types 0.5.0 (numpy 1.26.4, scipy 1.17.1), Python 3.11: from .wfm it comes back bit for bit. The .csv has nine
# digits and the .mat all of them, and both come back as whole numbers of 16 bits times a step: a sine of 75 V has
# steps of 2.3 mV, and of its 1,000 samples 880 differ in the file but 251 in what is read. Whoever takes slopes or
# spectra of a driving voltage sees them; the class has float arrays all the same.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet tm_data_types==0.5.0 numpy==1.26.4 scipy==1.17.1
venv/bin/python - <<'CODE'
import warnings

import numpy as np

warnings.simplefilter("ignore")
from tm_data_types import AnalogWaveform, read_file, write_file

time = 1e-5 * np.arange(1000)
voltage = 75.0 * np.sin(2.0 * np.pi * 200.0 * time) + 5.0
worst = {}
for kind in ("wfm", "csv", "mat"):
    given = AnalogWaveform()
    given.y_axis_values, given.x_axis_spacing, given.trigger_index = voltage, 1e-5, 0.0
    write_file(f"drive.{kind}", given)
    found = np.asarray(read_file(f"drive.{kind}").normalized_vertical_values, dtype=float)
    worst[kind] = float(np.abs(found - voltage).max())
    print(f"{kind}: {len(np.unique(found))} values of {len(np.unique(voltage))}, at most {worst[kind]:.3g} V off")
rows = [line.split(",") for line in open("drive.csv").read().splitlines()]
first = next(k for k, row in enumerate(rows) if row[0] == "TIME") + 1
written = np.array([float(row[1]) for row in rows[first:] if len(row) > 1])
print(f"text of the .csv: at most {np.abs(written - voltage).max():.1g} V off")
assert worst["wfm"] == 0.0
assert np.abs(written - voltage).max() < 1e-6
assert all(1e-3 < worst[kind] < 3e-3 for kind in ("csv", "mat"))
CODE

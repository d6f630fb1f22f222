#!/usr/bin/env bash
# Guess: the samples of an oscilloscope's trace are as far apart as its file says.
# Seen with lecroyparser 1.4.2 (numpy 2.4.6), Python 3.11: they are spread evenly over all N intervals, although N samples have N - 1
# between them, so that each is N / (N - 1) times as long as the file's. Of 50 samples of 0.1 ms the last is 0.1 ms late,
# and 500 Hz are found as 490 Hz. Only in long traces is that nothing: a burst of a few cycles of a drive is none.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet lecroyparser==1.4.2 numpy==2.4.6
venv/bin/python - <<'CODE'
import struct

import lecroyparser
import numpy as np

N, INTERVAL, GAIN = 50, 1e-4, 0.01
voltage = np.round(75.0 * np.sin(2.0 * np.pi * 500.0 * INTERVAL * np.arange(N)) / GAIN).astype("<i2")
block = bytearray(346)  # the descriptor of the maker's template LECROY_2_3
for place, form, value in (
    (0, "16s", b"WAVEDESC"),
    (16, "16s", b"LECROY_2_3"),
    (32, "<h", 1),  # samples of 16 bits
    (34, "<h", 1),  # the least byte first
    (36, "<i", 346),
    (60, "<i", 2 * N),
    (76, "16s", b"LECROYHDO4034"),
    (116, "<i", N),
    (156, "<f", GAIN),
    (172, "<h", 12),
    (176, "<f", INTERVAL),
    (180, "<d", 0.0),
    (296, "<dbbbbh", (0.0, 0, 12, 1, 6, 2024)),
    (324, "<h", 27),
):
    struct.pack_into(form, block, place, *(value if isinstance(value, tuple) else (value,)))
with open("drive.trc", "wb") as file:
    file.write(bytes(block) + voltage.tobytes())

found = lecroyparser.ScopeData("drive.trc")
assert np.allclose(found.y, GAIN * voltage, atol=1e-4)
step = float(np.diff(found.x).mean())
print(f"interval: {found.horizInterval:.6g} s in the file, {step:.6g} s between samples, last at {found.x[-1]:.6g} s")
sine, fits = np.asarray(found.y), np.linspace(400.0, 600.0, 2001)
basis = [np.stack([np.sin(2 * np.pi * f * found.x), np.cos(2 * np.pi * f * found.x)], axis=1) for f in fits]
left = [np.linalg.norm(sine - b @ np.linalg.lstsq(b, sine, rcond=None)[0]) for b in basis]
print(f"frequency of the samples at these times: {fits[int(np.argmin(left))]:.1f} Hz of 500")
assert abs(found.horizInterval - INTERVAL) < 1e-10
assert abs(step / INTERVAL - N / (N - 1)) < 1e-6
assert abs(fits[int(np.argmin(left))] - 490.0) < 0.2
CODE

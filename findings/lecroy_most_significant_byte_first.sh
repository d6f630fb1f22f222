#!/usr/bin/env bash
# Guess: a LeCroy trace (.trc) of 16 bits whose bytes are in the other order (COMM_ORDER 0, the most significant first)
# gives the same voltages, since its head says so.
# Seen with lecroyscope 1.0.0 (numpy 2.4.6), Python 3.11: the head is read by its order, the samples by that of the
# machine, without a word. On a machine of least significant byte first a sine of 75 V becomes noise of up to 276 V.
# lecroyparser 1.4.2 gives the voltages of the sine for both orders.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet lecroyscope==1.0.0 lecroyparser==1.4.2 numpy==2.4.6
venv/bin/python - <<'CODE'
import struct
import sys

import lecroyparser
import lecroyscope
import numpy as np

N, INTERVAL, GAIN = 200, 1e-4, 0.01
counts = np.round(75.0 * np.sin(2.0 * np.pi * 250.0 * INTERVAL * np.arange(N)) / GAIN)


def write(name, order):
    """The descriptor of the maker's template LECROY_2_3, and the samples, bytes in the order '<' or '>'."""
    block = bytearray(346)
    for place, form, value in (
        (0, "16s", b"WAVEDESC"),
        (16, "16s", b"LECROY_2_3"),
        (32, "h", 1),  # samples of 16 bits
        (34, "h", {">": 0, "<": 1}[order]),
        (36, "i", 346),
        (60, "i", 2 * N),
        (76, "16s", b"LECROYHDO4034"),
        (116, "i", N),
        (144, "i", 1),
        (156, "f", GAIN),
        (172, "h", 12),
        (176, "f", INTERVAL),
        (180, "d", 0.0),
        (296, "dbbbbhh", (0.0, 0, 0, 12, 1, 2024, 0)),
        (324, "h", 27),
    ):
        struct.pack_into(order + form, block, place, *(value if isinstance(value, tuple) else (value,)))
    with open(name, "wb") as file:
        file.write(bytes(block) + counts.astype(order + "i2").tobytes())


own = {"little": "<", "big": ">"}[sys.byteorder]
other = {"<": ">", ">": "<"}[own]
found = {}
for order in (own, other):
    write("drive.trc", order)
    trace = lecroyscope.Trace("drive.trc")
    found[order] = trace.y
    print(f"order {order}: gain {trace.header['vertical_gain']:.3g} V, voltages up to {np.abs(trace.y).max():.1f} V")
    assert abs(trace.header["vertical_gain"] - GAIN) < 1e-9
    assert abs(trace.header["horiz_interval"] - INTERVAL) < 1e-10
    assert np.allclose(lecroyparser.ScopeData("drive.trc").y, GAIN * counts, atol=1e-4)
swapped = counts.astype("<i2").byteswap().astype(float)
assert np.allclose(found[own], GAIN * counts, atol=1e-4)
assert np.allclose(found[other], GAIN * swapped, atol=1e-4)
assert np.abs(found[other]).max() > 270.0
CODE

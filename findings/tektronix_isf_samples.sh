#!/usr/bin/env bash
# Guess: a Tektronix .isf of positive integers (BN_FMT RP) gives the voltages of the same trace in signed ones (RI),
# and all NR_PT samples come back.
# Seen with RigolWFM 1.6.0 (kaitaistruct 0.11, numpy 2.4.6), Python 3.11, both without a word: BN_FMT is passed over, so
# that counts above 127 are 256 too low: a sine of 100 V whose 0 V is count 128 becomes one of -256 V to -2 V, of 158 V
# rms instead of 70.7 V. And bytes 10 and 13 at the end of the samples are taken for the end of a line, although the
# file gives their number: a burst of 4 ms that is followed by 6 ms at a count of 10 lasts 4 ms in all, so that its rms
# is 70.7 V instead of 45.4 V. Right is YZERO + YMULT * (count - YOFF).
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet RigolWFM==1.6.0 kaitaistruct==0.11 numpy==2.4.6
venv/bin/python - <<'CODE'
import numpy as np
from RigolWFM.wfm import Wfm

N, INTERVAL = 1000, 1e-5
time = INTERVAL * np.arange(N)
sine = np.round(100.0 * np.sin(2.0 * np.pi * 250.0 * time)).astype(int)  # one count is 1 V
burst = np.where(time < 0.004, sine, 10)


def write(name, counts, form, offset):
    head = (
        f":WFMPRE:BYT_NR 1;BIT_NR 8;ENCDG BIN;BN_FMT {form};BYT_OR MSB;NR_PT {N};"
        f'WFID "Ch1, DC coupling";PT_FMT Y;XINCR {INTERVAL};PT_OFF 0;XZERO 0.0;XUNIT "s";'
        f'YMULT 1.0;YZERO 0.0;YOFF {offset};YUNIT "V";:CURVE #4{N}'
    )
    samples = (counts + offset).astype({"RI": "i1", "RP": "u1"}[form])
    assert np.array_equal(samples - float(offset), counts)
    with open(name, "wb") as file:
        file.write(head.encode() + samples.tobytes())


def read(name):
    channel = Wfm.from_file(name).channels[0]
    return channel.times, channel.volts


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


write("signed.isf", sine, "RI", 0)
write("positive.isf", sine, "RP", 128)
write("burst.isf", burst, "RI", 0)
signed, positive, (times, shortened) = read("signed.isf")[1], read("positive.isf")[1], read("burst.isf")
print(f"rms of the sine: {rms(sine):.1f} V; of signed {rms(signed):.1f} V, of positive integers {rms(positive):.1f} V")
print(f"positive integers: {positive.min():g} V to {positive.max():g} V")
print(f"burst: {len(shortened)} of {N} samples, rms {rms(shortened):.1f} V of {rms(burst):.1f} V")
assert np.array_equal(signed, sine)
assert np.array_equal(positive, np.where(sine < 0, sine, sine - 256))
assert len(shortened) == len(times) == 400
assert np.array_equal(shortened, burst[:400])
CODE

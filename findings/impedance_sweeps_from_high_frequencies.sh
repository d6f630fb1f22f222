#!/usr/bin/env bash
# Guess: a spectrum of impedance in a text file is read whole, in whatever order its frequencies come, as from CSV.
# Seen with impedancefitter 2.0.12 (lmfit 1.3.2, numpy 2.4.6, scipy 1.17.1), Python 3.11: from TXT the first and the
# last row are taken as the lowest and the highest frequency, and what is not between them is left out without a word.
# Of a sweep from 1 Hz to 100 kHz and back 2 of 52 rows stay, and their fit gives a capacitance twice too large. Of one
# that begins with a control at 1 kHz all below that is lost. Of one from 100 kHz to 1 Hz nothing stays, which the class
# for fits refuses; a lower bound of 0.5 Hz leaves one row of it. From CSV, which sorts, all rows come back.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet impedancefitter==2.0.12 lmfit==1.3.2 numpy==2.4.6 scipy==1.17.1
mkdir spectra
venv/bin/python - <<'CODE'
import warnings

import numpy as np

warnings.simplefilter("ignore")
from impedancefitter import Fitter
from impedancefitter.readin import readin_Data_from_collection, readin_Data_from_TXT_file

R0, R1, C = 100.0, 1e4, 1e-7
up = np.logspace(0.0, 5.0, 26)
sweeps = {
    "up": up,
    "down": up[::-1],
    "up and down": np.concatenate([up, up[::-1]]),
    "1 kHz, then up": np.concatenate([[1e3], up]),
}
start = {"f1_R": {"value": 50.0, "min": 1.0}, "f2_R": {"value": 5e3, "min": 1.0}, "C": {"value": 2e-7, "min": 1e-9}}


def write(name, frequency, separator):
    z = R0 + R1 / (1.0 + 2j * np.pi * frequency * R1 * C)
    head = "" if separator == "\t" else "frequency,real,imaginary"
    np.savetxt(name, np.stack([frequency, z.real, z.imag], axis=1), delimiter=separator, header=head, comments="")


def fit(frequency):
    """Rows that are used and the capacitance."""
    write("spectra/skin.txt", frequency, "\t")
    fitter = Fitter("TXT", directory="spectra/", LogLevel="ERROR", skiprows_txt=0)
    fitter.run("R_f1 + parallel(R_f2, C)", parameters=start)
    return fitter.omega_dict["skin.txt"].size, fitter.fit_data["skin.txt_0"]["C"]


rows = {}
for name, frequency in sweeps.items():
    write("one.txt", frequency, "\t")
    write("one.csv", frequency, ",")
    rows[name] = readin_Data_from_TXT_file("one.txt", 0)[0].size
    csv = readin_Data_from_collection("one.csv", "CSV")[0].size
    print(f"{name}: {frequency.size} rows, {rows[name]} from TXT, {csv} from CSV")
    assert csv == frequency.size
assert rows == {"up": 26, "down": 0, "up and down": 2, "1 kHz, then up": 12}
write("one.txt", sweeps["down"], "\t")
assert readin_Data_from_TXT_file("one.txt", 0, minimumFrequency=0.5)[0].size == 1
assert readin_Data_from_TXT_file("one.txt", 0, minimumFrequency=0.5, maximumFrequency=2e5)[0].size == 26

used, right = fit(sweeps["up"])
assert used == 26
assert abs(right / C - 1.0) < 1e-6
used, wrong = fit(sweeps["up and down"])
print(f"capacitance of the sweep up {right:.4g} F, up and down {wrong:.4g} F")
assert used == 2
assert wrong > 1.9 * C
CODE

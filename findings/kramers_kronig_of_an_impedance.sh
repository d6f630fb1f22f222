#!/usr/bin/env bash
# Guess: impedance.py's Kramers-Kronig check (linKK), the step before a skin's impedance is fitted, runs with what
# pip installs beside it.
# Seen with impedance 1.7.1, numpy 2.3.5, scipy 1.17.1, altair 5.5.0, Python 3.11: first, the package imports
# pandas and does not ask for it (altair, which it asks for, once did). With pandas 2.3.3 circuits are simulated and
# fitted, but linKK ends in a NameError for every spectrum: it writes its values into a text of Python, and numpy 2
# writes its numbers as np.float64(...). With numpy 1.26.4 it runs, and by its own default (c=0.85: four elements)
# finds that the exact spectrum of one resistor beside one capacitor is 30 % from any that obeys causality; with
# c=0.3 and up to 100 elements, 0.1 %.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
cat > check.py <<'CODE'
import sys

import numpy as np
from impedance.models.circuits import CustomCircuit
from impedance.validation import linKK

frequency = np.logspace(-1, 5, 25)
values = [100.0, 1e4, 1e-6]  # a dry patch of skin: ohm, ohm, F
circuit = CustomCircuit("R0-p(R1,C1)", initial_guess=[50.0, 5e3, 1e-7])
spectrum = values[0] + 1.0 / (1.0 / values[1] + 2j * np.pi * frequency * values[2])
circuit.fit(frequency, spectrum)
print("numpy", np.__version__, "fitted:", [float(f"{one:.6g}") for one in circuit.parameters_])
assert np.allclose(circuit.parameters_, values, rtol=1e-6)
try:
    off = {}
    for c, most in ((0.85, 50), (0.3, 100)):
        elements, _, _, real, imaginary = linKK(frequency, spectrum, c=c, max_M=most)
        off[c] = float(np.abs([real, imaginary]).max())
        print(f"linKK, c={c}: {elements} elements, residuals of at most {off[c]:.2g}")
    assert sys.argv[1] == "runs"
    assert off[0.85] > 0.2
    assert off[0.3] < 2e-3
except NameError as error:
    print("linKK:", error)
    assert sys.argv[1] == "fails"
    assert "'np'" in str(error)
CODE
python3 -m venv new
new/bin/pip install --quiet impedance==1.7.1 numpy==2.3.5 scipy==1.17.1 altair==5.5.0
if new/bin/python check.py fails 2> without.txt; then
    echo "it runs without pandas"
    exit 1
fi
tail -n 1 without.txt
grep -q "No module named 'pandas'" without.txt
new/bin/pip install --quiet pandas==2.3.3
new/bin/python check.py fails
python3 -m venv old
old/bin/pip install --quiet impedance==1.7.1 numpy==1.26.4 scipy==1.13.1 altair==5.5.0 pandas==2.3.3
old/bin/python check.py runs

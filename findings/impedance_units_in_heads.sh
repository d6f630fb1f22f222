#!/usr/bin/env bash
# Guess: a spectrum of skin whose head names its units comes back in hertz and ohm, or is refused.
# Seen with pyimpspec 5.1.3 (pandas 3.1.1), Python 3.11: the words are read, the units are not. Columns "f (kHz)", "Z' (kohm)" and
# "Z'' (kohm)" come back as hertz and ohm, a thousand times too small each, so that 1 kOhm beside 1 uF is fitted as
# 1 Ohm beside 1 F; a phase in radians is taken as degrees, and the capacitor is gone. The same head with "omega
# (rad/s)" is refused, which was the guess.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet pyimpspec==5.1.3 pandas==3.1.1
venv/bin/python - <<'CODE'
import numpy as np
import pyimpspec

frequency = np.logspace(4.0, 0.0, 9)
impedance = 1e3 + 1.0 / (2j * np.pi * frequency * 1e-6)


def read(name, head, *columns):
    rows = [head, *(",".join(f"{value:.12g}" for value in row) for row in zip(*columns))]
    with open(f"{name}.csv", "w") as file:
        file.write("\n".join(rows) + "\n")
    found = pyimpspec.parse_data(f"{name}.csv")[0]
    return found.get_frequencies(), found.get_impedances()


f, z = read("plain", "f (Hz),Z' (ohm),Z'' (ohm)", frequency, impedance.real, impedance.imag)
assert np.allclose(f, frequency) and np.allclose(z, impedance)
thousand = (frequency / 1e3, impedance.real / 1e3, impedance.imag / 1e3)
f, z = read("kilo", "f (kHz),Z' (kohm),Z'' (kohm)", *thousand)
capacitance = -1.0 / (2.0 * np.pi * f[-1] * z[-1].imag)
print(f"kHz and kohm: {f[0]:g} Hz, {z[0].real:g} ohm, {capacitance:.3g} F")
assert np.allclose(f, frequency / 1e3) and np.allclose(z, impedance / 1e3)
polar = (frequency, np.abs(impedance), np.angle(impedance))
f, z = read("radians", "f (Hz),|Z| (ohm),phase (rad)", *polar)
print(f"phase in rad at 1 Hz: {np.degrees(np.angle(z[-1])):.3g} degrees of {np.degrees(polar[2][-1]):.3g}")
assert np.allclose(np.degrees(np.angle(z)), polar[2])
try:
    read("omega", "omega (rad/s),Z' (ohm),Z'' (ohm)", 2.0 * np.pi * frequency, impedance.real, impedance.imag)
except ValueError as error:
    print(f"omega: {type(error).__name__}")
else:
    raise AssertionError("omega was read")
CODE

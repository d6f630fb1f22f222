#!/usr/bin/env bash
# Guess: an experiment whose deformation is given as "strain", by its page the Green-Lagrange strain E, stretches the
# sample by sqrt(1 + 2 E).
# Seen with pymecht 1.1.3 (numpy 2.4.6, scipy 1.17.1, pandas 3.0.0, pyDOE 0.3.8), Python 3.11: it stretches it by
# 1 + sqrt(E), without a word, in uniaxial and biaxial extension alike. At E = 0.02 the stretch is 1.141 instead of
# 1.020, so that the stress of a neo-Hookean solid is 7.2 times as large as it is. The other way round a stress of a
# tenth of mu gives E = 0.0011 instead of 0.0339. Compression (E < 0) is an error. By stretch all is right.
# (PyTorch, of which only the drawing of random parameters needs anything, is left out.)
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet numpy==2.4.6 scipy==1.17.1 pandas==3.0.0 pyDOE==0.3.8 tqdm==4.70.1
venv/bin/pip install --quiet --no-deps pymecht==1.1.3
mkdir torch
touch torch/__init__.py
echo "SobolEngine = None" >torch/quasirandom.py
venv/bin/python - <<'CODE'
import numpy as np
import pymecht

solid = pymecht.MatModel("nh")  # W = mu / 2 (I1 - 3) with mu = 1, incompressible


def uniaxial(measure, value):
    return pymecht.UniaxialExtension(solid, measure, "cauchy").disp_controlled(float(value))


def biaxial(measure, value):
    equal = np.array([[value, value]])
    return pymecht.PlanarBiaxialExtension(solid, measure, "cauchy").disp_controlled(equal)[0, 0]


for strain in (0.0, 0.005, 0.02, 0.105):
    stretch, taken = np.sqrt(1.0 + 2.0 * strain), 1.0 + np.sqrt(strain)
    right, found = stretch**2 - 1.0 / stretch, uniaxial("strain", strain)
    print(f"E = {strain:g}: stretch {stretch:.4f}, stress {right:.4f}; pymecht's by strain {found:.4f}")
    assert abs(uniaxial("stretch", stretch) - right) < 1e-12
    assert abs(found - (taken**2 - 1.0 / taken)) < 1e-12
    assert abs(biaxial("stretch", stretch) - (stretch**2 - stretch**-4)) < 1e-12
    assert abs(biaxial("strain", strain) - (taken**2 - taken**-4)) < 1e-12
assert uniaxial("strain", 0.02) > 7.0 * uniaxial("stretch", np.sqrt(1.04))

by_stress = {
    measure: pymecht.UniaxialExtension(solid, measure, "cauchy").force_controlled(np.array([0.1]))[0]
    for measure in ("strain", "stretch")
}
right = (by_stress["stretch"] ** 2 - 1.0) / 2.0
print(f"stress 0.1 mu: E = {by_stress['strain']:.4f}, by the stretch {by_stress['stretch']:.4f} it is {right:.4f}")
assert abs(by_stress["stretch"] ** 2 - 1.0 / by_stress["stretch"] - 0.1) < 1e-8
assert by_stress["strain"] < 0.04 * right
CODE

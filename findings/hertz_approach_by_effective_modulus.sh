#!/usr/bin/env bash
# Guess: the functions of `tribology` for Hertz's contact agree with each other if all get the modulus of its own `eeff`.
# Seen with tribology 0.5.16 (numpy 2.4.6, scipy 1.17.1), Python 3.11: area, pressure and the boundary elements take
# that modulus, which is twice E / (1 - nu^2) of a solid on a rigid one; `dhertz`, the approach of both bodies, takes it
# for once. A ball comes 0.900 um closer instead of 1.428 um, 37 % too little, without a word; the boundary elements of
# the same package find 1.426 um. Unlike radii add to that: of 10 mm and 1 mm it is 0.348 um instead of 1.956 um.
# (The package asks for numpy <= 1.16.1 and an OpenCV of 2018, and is installed with newer ones, which give the right
# area and boundary elements.)
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet numpy==2.4.6 scipy==1.17.1 numexpr==2.14.2 matplotlib==3.11.2 pillow==13.0.0 \
    opencv-python-headless==5.0.0.93 setuptools==80.9.0
venv/bin/pip install --quiet --no-deps tribology==0.5.16
venv/bin/python -W ignore - <<'CODE'
import numpy as np
import tribology
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

YOUNG, POISSON, FORCE, INFINITE = 200e3, 0.3, 50.0, float("inf")  # N and mm, on a rigid plane
plane = YOUNG / (1.0 - POISSON**2)
modulus = tribology.eeff(YOUNG, POISSON, 1e15, 0.0)
assert abs(modulus / plane - 2.0) < 1e-6


def hertz(large, small):
    """Half axes and approach of an ellipsoid on a plane by complete elliptic integrals (Johnson 1985, 4.2)."""
    if large == small:
        axis = (3.0 * FORCE * large / (4.0 * plane)) ** (1.0 / 3.0)
        return axis, axis, axis**2 / large

    def curvatures(m):
        return (ellipe(m) / (1.0 - m) - ellipk(m)) / (ellipk(m) - ellipe(m)) - large / small

    m = brentq(curvatures, 1e-4, 1.0 - 1e-6)
    axis = (3.0 * FORCE * (ellipk(m) - ellipe(m)) * large / (np.pi * plane * m)) ** (1.0 / 3.0)
    return axis, axis * np.sqrt(1.0 - m), 3.0 * FORCE * ellipk(m) / (2.0 * np.pi * axis * plane)


for radius, share in ((10.0, 0.630), (1.0, 0.178)):
    axis, other, approach = hertz(10.0, radius)
    found = tribology.dhertz(modulus, 10.0, radius, INFINITE, INFINITE, FORCE)
    area = tribology.ahertz(*tribology.reff(10.0, radius, 0.0, 0.0), modulus, FORCE)[2]
    print(f"radii 10 and {radius:g} mm: approach {1e3 * found:.3f} um, right {1e3 * approach:.3f} um")
    assert abs(area / (np.pi * axis * other) - 1.0) < 5e-3
    assert abs(found / approach - share) < 1e-3

axis, _, approach = hertz(10.0, 10.0)
x = np.linspace(-1.5 * axis, 1.5 * axis, 21)
step = x[1] - x[0]
ball = np.add.outer(x**2, x**2) / 20.0
matrix = tribology.beinflumatred(tribology.beinflumat(x, x, modulus))
by_elements = tribology.besolve(ball, 0.0 * ball, FORCE, matrix, step, step, norm_disp=0.8 * approach)[3]
print(f"boundary elements of the package, radii 10 and 10 mm: {1e3 * by_elements:.3f} um")
assert abs(by_elements / approach - 1.0) < 0.01
CODE

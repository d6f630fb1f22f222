#!/usr/bin/env bash
# Guess: ContactMechanics gives Hertz's displacements and stresses at 0, 1 and 2 contact radii alike, whether these
# places are an array of integers or of floats; both solutions in the solid are in equilibrium (they are, to 1e-7).
# Seen with ContactMechanics 1.8.3 (SurfaceTopography 1.27.1, numpy 2.4.6, scipy 1.17.1), Python 3.11: results have the
# type of the places, so those of integers are cut off to whole numbers without a word. The displacements -1.571, -0.785
# and -0.342 of the surface become -1, 0 and 0, and the stresses in the solid by Cartesian coordinates, all below the
# largest pressure, are 0 everywhere; by radius and depth they are right.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet ContactMechanics==1.8.3 SurfaceTopography==1.27.1 numpy==2.4.6 scipy==1.17.1
venv/bin/python - <<'CODE'
import numpy as np
from ContactMechanics.ReferenceSolutions import Hertz

places = np.array([0, 1, 2])
whole, real = Hertz.surface_displacements(places), Hertz.surface_displacements(places.astype(float))
by_hand = [-np.pi / 2.0, -np.pi / 4.0]  # within the contact: -(2 - r^2) pi / 4
print(f"displacements of floats {real.round(3).tolist()}, of integers {whole.tolist()}")
assert np.allclose(real[:2], by_hand, atol=1e-12)
assert whole.tolist() == [-1, 0, 0]

one = np.array([1, 2])
integers = np.array(Hertz.stress_Cartesian(one, one, one, poisson=0.3))
floats = np.array(Hertz.stress_Cartesian(*(1.0 * one,) * 3, poisson=0.3))
by_radius = Hertz.stress(np.hypot(one, one), 1.0 * one, poisson=0.3)[2]
print(f"normal stresses of floats {floats[2].round(4).tolist()}, of integers {integers[2].tolist()}")
assert np.allclose(floats[2], by_radius, rtol=1e-9)
assert np.abs(floats).min() > 1e-3
assert not integers.any()
CODE

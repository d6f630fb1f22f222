#!/usr/bin/env bash
# Guess: fourier_synthesis(..., rms_height=1.0) of SurfaceTopography makes a map whose rms height is 1, or near
# it, as its argument says ("root mean-squared height").
# Seen with SurfaceTopography 1.27.1 (numpy 2.3.5), Python 3.11: that is the mean over many maps. Amplitudes are
# random too, and with a Hurst exponent of 0.8 the few longest waves carry most of the height: forty maps of
# 128 x 128 points have rms heights from about 0.5 to 2. A map for one scene, with an attraction that goes with
# the inverse square of its gaps, must be scaled to the rms height that it is to have.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet SurfaceTopography==1.27.1 numpy==2.3.5
venv/bin/python - <<'CODE'
import warnings

import numpy as np

warnings.simplefilter("ignore")
from SurfaceTopography.Generation import fourier_synthesis

found = []
for seed in range(40):
    np.random.seed(seed)
    one = fourier_synthesis((128, 128), (1.0, 1.0), 0.8, rms_height=1.0, unit="mm")
    found.append(one.rms_height_from_area())
found = np.array(found)
print(f"asked for 1, forty maps have {found.min():.2f} to {found.max():.2f}")
print(f"root of their mean square {np.sqrt(np.mean(found**2)):.2f}")
assert found.min() < 0.7 and found.max() > 1.5
assert abs(np.sqrt(np.mean(found**2)) - 1.0) < 0.3
CODE

#!/usr/bin/env bash
# Guess: the spectral moments m0, m2, m4 that tamaas gives of a rough surface are those of Nayak and of Greenwood and
# Williamson, whose m2 is the mean square slope of a profile, as its own rms slope of the same surface has it.
# Seen with tamaas 2.9.0 (numpy 2.3.5), Python 3.11: moments count waves in cycles per length, the rms slope in radians.
# Of one surface the rms slope is 2 pi times the root of 2 m2, and a curvature from m4 is (2 pi)^2 = 39.5 times too
# small: asperities are as many times too blunt in a contact of Greenwood and Williamson, and their attraction at a
# gap with them. Bandwidths m0 m4 / m2^2 are right. The rms height divides by N - 1, the root of m0 by N.
# This script fails if that changes.
set -euo pipefail
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip install --quiet tamaas==2.9.0 numpy==2.3.5
venv/bin/python - <<'CODE'
import numpy as np
import tamaas as tm

n = 128
spectrum = tm.Isopowerlaw2D()
spectrum.q0, spectrum.q1, spectrum.q2, spectrum.hurst = 4, 4, 16, 0.8
generator = tm.SurfaceGeneratorRandomPhase2D([n, n])
generator.spectrum, generator.random_seed = spectrum, 1
surface = np.asarray(generator.buildSurface())
m0, m2, m4 = tm.Statistics2D.computeMoments(surface)
slope = tm.Statistics2D.computeSpectralRMSSlope(surface)
print(f"rms slope over the root of 2 m2: {slope / np.sqrt(2.0 * m2):.4f}, 2 pi is {2.0 * np.pi:.4f}")

# by hand: both derivatives of the Fourier series, wavenumbers in radians per side
k = 2.0 * np.pi * np.fft.fftfreq(n, 1.0 / n)
series = np.fft.fft2(surface)
by_hand = [np.fft.ifft2(1j * each * series).real for each in (k[:, None], k[None, :])]
mean_square = sum(float(np.mean(each**2)) for each in by_hand)
bends = [np.fft.ifft2(-(each**2) * series).real for each in (k[:, None], k[None, :])]
curvature = float(np.mean(np.array(bends) ** 2))
print(f"rms slope by hand {np.sqrt(mean_square):.4g}, of tamaas {slope:.4g}")
print(f"mean square curvature of profiles by hand {curvature:.4g}, m4 {m4:.4g}: {curvature / m4:.1f} times")
height = tm.Statistics2D.computeRMSHeights(surface)
print(f"rms height squared over m0: 1 + {height**2 / m0 - 1.0:.3g}, 1 / N is {1.0 / n**2:.3g}")
assert abs(slope / np.sqrt(mean_square) - 1.0) < 1e-6
assert abs(mean_square / (2.0 * m2) / (2.0 * np.pi) ** 2 - 1.0) < 1e-3
assert abs(curvature / m4 / (2.0 * np.pi) ** 4 - 1.0) < 0.1
assert 0.5 / n**2 < height**2 / m0 - 1.0 < 2.0 / n**2
CODE

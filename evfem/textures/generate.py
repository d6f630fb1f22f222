r"""Generators of synthetic textures, each with three main parameters: frequency, amplitude, irregularity.

- `grating`: ridges and grooves with cosine-shaped walls, irregularity moves every groove by up to
  an eighth of its period and changes its depth by up to half.
- `sinusoids`: a sine with a second harmonic; irregularity i spreads its power over waves whose
  frequencies are normally distributed with the standard deviation i/2 of the frequency.
- `self_affine`: power spectral density ``q^-(1 + 2H)`` (Jacobs, Junge and Pastewka 2017,
  doi:10.1088/2051-672X/aa51f8) from the frequency upwards; H is 1 - irregularity.
- `spectral`: ``q^-beta`` between one and eight times the frequency; beta is 3 (1 - irregularity), so that
  0 is smooth and 1 is white noise.

All repeat after a whole number of periods. Amplitude is that of the sine with the same root mean
square (half the depth of a grating); phases are drawn from a seed, the same on every machine.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from evfem.common.checks import SEED, Checked, Within, between, choice, number
from evfem.surface.textures import Grating
from evfem.tensor import Array
from evfem.textures.texture import Texture

#: licence of synthetic textures
FREE = "CC0-1.0"
#: periods of `frequency` in the period of a texture, samples of the shortest wave, highest over lowest
#: frequency of `spectral`
PERIODS, SAMPLES, BAND = 8, 32, 8
AMPLITUDE = "of the sine with the same root mean square; of a grating half of its depth"


@dataclass(frozen=True)
class Knobs(Checked):
    """Parameters of the generators; `hurst` and `beta`, None: set by the irregularity."""

    frequency: Annotated[float, between(0.05, 10.0, "1/mm"), "of the first wave, or the lowest"] = 0.5
    amplitude: Annotated[float, number("mm above 0, up to 1", Within(0.0, 1.0, True), "mm"), AMPLITUDE] = 0.02
    irregularity: Annotated[float, between(0.0, 1.0), "from regular to irregular"] = 0.0
    second: Annotated[
        float, between(0.0, 2.0), "amplitude of the second harmonic of sinusoids over the first"
    ] = 0.0
    phase: Annotated[float, between(-10.0, 10.0, "rad"), "of the second harmonic"] = 0.0
    hurst: Annotated[float | None, between(0.0, 1.0), "Hurst exponent of self_affine"] = None
    beta: Annotated[float | None, between(0.0, 6.0), "exponent of the spectrum of spectral"] = None
    seed: Annotated[int, SEED, "of the random numbers"] = 0


def make(kind: str, knobs: Knobs, name: str | None = None, licence: str = FREE) -> Texture:
    """The texture that a generator makes: grating, sinusoids, self_affine or spectral.

    >>> make("sinusoids", Knobs(frequency=0.5, amplitude=0.01))
    Texture('sinusoids', sinusoids, 256 heights, period 16 mm, 0.02 mm from lowest to highest)
    """
    choice("kind", kind, tuple(GENERATORS))
    x, height = GENERATORS[kind](knobs)
    said = ", ".join(f"{key} {value:g}" for key, value in vars(knobs).items() if value is not None)
    notes = (f"Made by evfem: {kind} with {said}.",)
    period = PERIODS / knobs.frequency
    return Texture(name or kind, kind, x, height, licence, period=period, provenance=notes)


def _grating(knobs: Knobs) -> tuple[Array, Array]:
    period, draw = 1.0 / knobs.frequency, random.Random(knobs.seed)
    x = np.arange(PERIODS * 64) * (period / 64)
    height = np.zeros_like(x)
    for k in range(PERIODS):
        moved = 0.125 * period * knobs.irregularity * (2.0 * draw.random() - 1.0)
        depth = 2.0 * knobs.amplitude * (1.0 + 0.5 * knobs.irregularity * (2.0 * draw.random() - 1.0))
        one = Grating(period=period, groove_depth=depth)
        inside = (x >= k * period) & (x < (k + 1) * period)
        height[inside] = one.height(x[inside] - k * period - moved)
    return x, height


def _sinusoids(knobs: Knobs) -> tuple[Array, Array]:
    numbers = np.arange(1, 2 * PERIODS + 1)
    width = max(0.5 * knobs.irregularity * PERIODS, 1e-3)
    power = np.exp(-0.5 * ((numbers - PERIODS) / width) ** 2)
    amplitude = knobs.amplitude * np.sqrt(power / power.sum())
    spread = knobs.irregularity > 0.0
    phase = phases(knobs.seed, numbers.size) if spread else np.zeros(numbers.size)
    waves = [(numbers, amplitude, phase)]
    if knobs.second > 0.0:
        waves.append((2 * numbers, knobs.second * amplitude, 2.0 * phase + knobs.phase))
    return _sum(waves, knobs.frequency)


def _self_affine(knobs: Knobs) -> tuple[Array, Array]:
    hurst = 1.0 - knobs.irregularity if knobs.hurst is None else knobs.hurst
    return _spectral(replace(knobs, beta=1.0 + 2.0 * hurst))


def _spectral(knobs: Knobs) -> tuple[Array, Array]:
    exponent = 3.0 * (1.0 - knobs.irregularity) if knobs.beta is None else knobs.beta
    numbers = np.arange(PERIODS, BAND * PERIODS + 1)
    amplitude = numbers ** (-0.5 * exponent)
    amplitude *= knobs.amplitude / np.sqrt(np.sum(amplitude**2))
    return _sum([(numbers, amplitude, phases(knobs.seed, numbers.size))], knobs.frequency)


def phases(seed: int, size: int) -> Array:
    """Angles (size,) from 0 to 2 pi."""
    draw = random.Random(seed)  # its numbers are the same in every version of Python
    return np.array([2.0 * np.pi * draw.random() for _ in range(size)])


def _sum(waves: list[tuple[Array, Array, Array]], frequency: float) -> tuple[Array, Array]:
    """x (n,) and height (n,) of sines: numbers of waves in the period, amplitudes, phases."""
    size = SAMPLES * int(max(number[size > 1e-9 * size.max()].max() for number, size, _ in waves))
    turn = 2.0 * np.pi * np.arange(size) / size
    height = np.zeros(size)
    for n, a, p in np.concatenate([np.column_stack(one) for one in waves]).tolist():
        height += a * np.sin(n * turn + p)
    return np.arange(size) * (PERIODS / frequency / size), height


GENERATORS: dict[str, Callable[[Knobs], tuple[Array, Array]]] = {
    "grating": _grating,
    "sinusoids": _sinusoids,
    "self_affine": _self_affine,
    "spectral": _spectral,
}

"""Ridges make a line in the spectrum of friction: a finger slides over a self-affine surface.

Scheibert et al. (2009) and Prevost et al. (2009) slid a tip with and without fingerprint ridges over
random roughness: with ridges the friction force fluctuates above all at v/pitch. A pressure that is
modulated with the pitch picks the wave of that length out of all that the surface has; a smooth
pressure lets them fade the more, the shorter they are. Nothing is built in for that here.

The surface repeats after 4 mm, and so does friction once the finger slides: its spectrum is that of
one period, without leakage. Every wave of the surface is known too: friction over height of each is
the gain of the finger.

Expected: at 20 mm/s over ridges of 0.5 mm a line at 40 Hz, at 40 mm/s at 80 Hz, several times its
neighbours; none without ridges.
"""

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .common import Series, Study
from .plots import COLOURS, Figure, new_figure

PITCH, PERIOD, RUN_IN, FRICTION = 0.5, 4.0, 1.0, 0.3
SPEEDS = (20.0, 40.0)
STEPS, QUICK_STEPS = 160, 64
FINGERS = {"ridges": True, "smooth": False}
ASSUMPTIONS = {
    "surface": "self-affine, Hurst exponent 0.8, rms 1 um, waves from 4 to 0.32 mm, Coulomb's friction 0.3",
    "finger": "Table 2 (coarse), ridges of 0.5 mm, relaxation time 1 ms, 0.05 N/mm of load",
    "spectrum": "of tangential over normal force, over one period of the surface after 1 mm of way",
    "plane": "ridges run across the slide",
}


def surface() -> ev.SelfAffine:
    """Roughness that repeats after `PERIOD`."""
    return ev.SelfAffine(hurst=0.8, rms=0.001, period=PERIOD, shortest=0.32, friction=FRICTION)


def slid(ridges: bool, speed: float, steps: int) -> Floats:
    """Tangential over normal force in each step of one period of the surface (steps,)."""
    before = max(2, round(steps * RUN_IN / PERIOD / 4.0))
    finger = ev.FingerPad(ridges=ridges, ridge_width=PITCH, resolution="coarse", viscosity=1e-3)
    motion = [ev.Press(force=0.05, steps=2)]
    for distance, count in ((RUN_IN, before), (PERIOD, steps)):
        motion.append(ev.Slide(distance, steps=count, speed=speed, hold="force"))
    how = {"solver": ev.Solver(dynamics="viscous"), "output": ev.Output(every=100_000)}
    result = ev.simulate(ev.Scene(finger, surface(), motion=motion, **how))
    return np.asarray((result.tangential_force / result.normal_force)[-steps:])


def amplitudes(values: Floats) -> Floats:
    """One-sided amplitudes of the waves that fit into a period, from the first on."""
    return np.asarray(2.0 * np.abs(np.fft.rfft(values))[1:-1] / values.size)


def main(quick: bool = False) -> Study:
    """Spectra with and without ridges, the line over its neighbours, and the gain of every wave."""
    steps, speeds = (QUICK_STEPS, SPEEDS[:1]) if quick else (STEPS, SPEEDS)
    heights = amplitudes(surface().height(PERIOD * np.arange(steps) / steps))
    waves = np.arange(1, heights.size + 1)
    there = heights > 1e-3 * heights.max()
    line = round(PERIOD / PITCH) - 1
    beside = [line - 2, line - 1, line + 1, line + 2]
    numbers, series = {}, []
    for speed in speeds:
        for name, ridges in FINGERS.items():
            found = amplitudes(slid(ridges, speed, steps))
            key = f"{name}.{speed:g}_mm_s"
            frequency = waves * speed / PERIOD
            gain = found[there] / heights[there]
            numbers |= {
                f"strongest_above_quarter_Hz.{key}": float(_strongest(frequency, found, line)),
                f"line_over_neighbours.{key}": float(found[line] / found[beside].mean()),
                f"line_gain_1_per_mm.{key}": float(gain[line]),
            }
            series.append(Series(f"friction.{key}", frequency, found, "1"))
            series.append(Series(f"gain.{key}", frequency[there], gain, "1/mm"))
        numbers[f"verdict.line_Hz.{speed:g}_mm_s"] = speed / PITCH
    parameters = {"steps": steps, "speeds": speeds}
    return Study("friction_spectrum", numbers, {}, ASSUMPTIONS, series, lambda: draw(series), parameters)


def _strongest(frequency: Floats, found: Floats, line: int) -> float:
    """Frequency (Hz) of the strongest wave below four pitches: longer ones lift the whole finger."""
    short = slice((line + 1) // 4, None)
    return float(frequency[short][np.argmax(found[short])])


def draw(series: list[Series]) -> Figure:
    """Spectra of friction, and friction over height, over the frequency."""
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    colours = {"ridges": COLOURS["kaczmarek"], "smooth": COLOURS["strong_troxel"]}
    for one in series:
        kind, name, speed = one.name.split(".")
        value = float(speed.split("_")[0])
        axes = left if kind == "friction" else right
        last = one.x <= 2.0 * value / PITCH
        style = {"color": colours[name], "ls": "-" if value == SPEEDS[0] else ":", "lw": 1.2}
        label = f"{'with' if name == 'ridges' else 'without'} ridges, {value:g} mm/s"
        axes.semilogy(one.x[last], one.y[last], marker="o", ms=2.5, label=label, **style)
    for axes in (left, right):
        for speed in sorted({float(one.name.split(".")[2].split("_")[0]) for one in series}):
            axes.axvline(speed / PITCH, color=COLOURS["neutral"], lw=0.6, zorder=0)
        axes.set(xlabel="frequency (Hz)")
    left.set(ylabel="amplitude of friction over load")
    right.set(ylabel="the same over the height (1/mm)", ylim=(0.03, 60.0))
    right.legend(fontsize=5.5, loc="upper left", ncols=2)
    return figure

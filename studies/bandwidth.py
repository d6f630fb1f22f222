"""How fast friction follows a voltage: gain over frequency and speed, and what a voltage does at rest.

A slab that hardly deforms is pressed with 0.04 N/mm and slid at 20, 60 and 100 mm/s over a display whose
squared voltage follows a cosine. Its friction is renewed by slip (`ev.SlipMemory`), over the length that is
read from a measured cut-off: friction under a modulated voltage is of first order, with 13.8 Hz per mm/s of
speed (Balasubramanian 2025, arXiv:2505.11162; ten people, 20 to 100 mm/s), so L = 1/(2 pi 13.8) mm = 11.5 um.

Expected: 1/(1 + 2 pi i f L/v). Nothing else is fitted, but the slope of the cut-off is put in: what the
measurement can contradict is that the cut-off over the speed is one number, without a part that stays at
rest, and the shape of the curve. Under Coulomb's law the gain is 1 at every frequency.

A step sees the pressure of its end, and is half a step early: that is taken off the phase.

Onset: a voltage that is switched on at rest leaves the tangential force as it is, and shows over the length
of slip, as a robot saw it (Sirin et al. 2019, arXiv:2104.01090: the friction changes in full slip only).
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .common import Series, Study
from .plots import COLOURS, FIRST, Figure, panels
from .stick_slip import slab

#: Hz per mm/s (arXiv:2505.11162), and mm
CUTOFF = 13.8
LENGTH = 1.0 / (2.0 * np.pi * CUTOFF)
LOAD, FRICTION, VOLTAGE = 0.04, 0.3, 60.0
SPEEDS, RATIOS = (20.0, 60.0, 100.0), (0.1, 0.3, 1.0, 2.0, 5.0)
QUICK_RATIOS = (0.3, 1.0, 3.0)
#: steps in a period, and in a length, at least; lengths of slip before the period that counts
PER_PERIOD, PER_LENGTH, SETTLED = 40, 4.0, 12.0
#: slips (mm) after a voltage is switched on at rest
SHOWN = (0.005, 0.02)
ASSUMPTIONS = {
    "load": "0.04 N/mm on 4 mm",
    "friction": "0.3, followed over 11.5 um of slip",
    "voltage": "60 V at most, on 1 um of permittivity 3.9; its square is the cosine",
    "length": "from the published cut-off, taken to vanish at rest; the authors speak of stiffness",
    "phase": "half a step is taken off, as a step sees the pressure of its end",
}


def scene(law: Any, voltage: Any, *motion: Any) -> ev.Scene:
    """The slab, pressed, and its motion."""
    display = ev.Display(insulator=ev.Layer(0.001, 3.9), friction=FRICTION)
    pressed = (ev.Press(force=LOAD, steps=1), *motion)
    how = {"friction_law": law, "output": ev.Output(every=100_000), "name": "bandwidth"}
    pad = replace(slab(), electrical=ev.Electrical(0.38, 1650.0))
    return ev.Scene(pad, display, ev.StrongTroxel(), voltage, pressed, **how)


def gain(speed: float, frequency: float) -> complex:
    """Friction over friction of Coulomb's law, complex, at a frequency (Hz) of the squared voltage."""
    period = speed / frequency  # mm
    steps = math.ceil(max(PER_PERIOD, PER_LENGTH * period / LENGTH))
    count = 1 + math.ceil(SETTLED * LENGTH / period)
    slide = ev.Slide(count * period, steps=count * steps, speed=speed, hold="force")
    wave = ev.Sine(0.5 * frequency, amplitude=VOLTAGE)
    result = ev.simulate(scene(ev.SlipMemory(ev.Coulomb(), LENGTH), wave, slide))
    last = slice(-steps, None)
    turn = np.exp(-2j * np.pi * frequency * result.time[last])
    force, drive = ((each[last] * turn).sum() for each in (result.tangential_force, result.normal_force))
    return complex(force / (FRICTION * drive) * np.exp(-1j * np.pi / steps))


def cutoff(frequencies: Floats, sizes: Floats) -> float:
    """Where the gain has fallen to 1/sqrt(2), between frequencies, in their logarithms (Hz)."""
    at = np.interp(-0.5 * np.log(2.0), np.log(sizes[::-1]), np.log(frequencies[::-1]))
    return float(np.exp(at))


def onset(law: Any) -> tuple[Floats, Floats, float]:
    """Slip (um) since a voltage was switched on at rest, and the friction (mN/mm) from before that on, and
    after a long slip.
    """
    settle = ev.Slide(40.0 * LENGTH, steps=20, hold="force")
    on, slides = ev.VoltageRamp(VOLTAGE, steps=1), ev.Slide(0.06, steps=24, hold="force")
    result = ev.simulate(scene(law, 0.0, settle, on, slides))
    begin = 20  # the row before the voltage
    slip, force = (1e3 * column[begin:] for column in (result.position, result.tangential_force))
    return slip - slip[0], force, 1e3 * FRICTION * float(result.normal_force[-1])


def main(quick: bool = False) -> Study:
    """The gain at every speed, its cut-off, and the onset."""
    speeds, ratios = (SPEEDS[:1], QUICK_RATIOS) if quick else (SPEEDS, RATIOS)
    numbers: dict[str, float] = {}
    series: list[Series] = []
    for speed in speeds:
        key, frequencies = f"{speed:g}_mm_s", CUTOFF * speed * np.array(ratios)
        found = np.array([gain(speed, frequency) for frequency in frequencies])
        exact = ev.forces.slip_memory_gain(frequencies, speed, LENGTH)
        numbers |= {
            f"cutoff_Hz.{key}": cutoff(frequencies, np.abs(found)),
            f"published.cutoff_Hz.{key}": CUTOFF * speed,
            f"verdict.largest_error_of_gain.{key}": float(np.abs(np.abs(found) - np.abs(exact)).max()),
            f"verdict.largest_error_degrees.{key}": float(np.abs(np.degrees(np.angle(found / exact))).max()),
        }
        series.append(Series(f"gain.{key}", frequencies, np.abs(found), ""))
        series.append(Series(f"phase.{key}", frequencies, np.degrees(np.angle(found)), "degrees"))
    for name, law in (("memory", ev.SlipMemory(ev.Coulomb(), LENGTH)), ("coulomb", ev.Coulomb())):
        slip, force, end = onset(law)
        series.append(Series(f"onset.{name}", slip[1:], force[1:], "mN/mm"))
        numbers[f"onset.change_at_rest.{name}"] = float(force[1] / force[0] - 1.0)
        for way in SHOWN:
            share = (np.interp(1e3 * way, slip[1:], force[1:]) - force[0]) / (end - force[0])
            numbers[f"onset.share_after_{1e3 * way:g}_um.{name}"] = float(share)
    numbers |= {f"reference.share_after_{1e3 * way:g}_um": -math.expm1(-way / LENGTH) for way in SHOWN}
    parameters = {"speeds": speeds, "ratios": ratios, "length": LENGTH}
    return Study("bandwidth", numbers, {}, ASSUMPTIONS, series, lambda: draw(series, speeds), parameters)


def draw(series: list[Series], speeds: tuple[float, ...]) -> Figure:
    """Gain and phase over the frequency with the closed form and the published cut-off; the onset."""
    figure, (size, phase, begin) = panels(3.4, 3)
    kept = {one.name: one for one in series}
    for speed, colour in zip(speeds, FIRST, strict=False):
        one = kept[f"gain.{speed:g}_mm_s"]
        f = np.geomspace(one.x[0] / 2.0, one.x[-1] * 2.0, 200)
        exact = ev.forces.slip_memory_gain(f, speed, LENGTH)
        size.loglog(f, np.abs(exact), color=colour, lw=0.8)
        size.plot(one.x, one.y, "o", color=colour, ms=3.5, label=f"{speed:g} mm/s")
        size.axvline(CUTOFF * speed, color=colour, lw=0.8, ls=":")
        phase.semilogx(f, np.degrees(np.angle(exact)), color=colour, lw=0.8)
        phase.plot(one.x, kept[f"phase.{speed:g}_mm_s"].y, "o", color=colour, ms=3.5)
    size.axhline(math.sqrt(0.5), color=COLOURS["neutral"], lw=0.6)
    size.set(xlabel="frequency (Hz)", ylabel="friction that follows")
    size.plot([], [], ":", color=COLOURS["neutral"], lw=0.8, label="published cut-off")
    figure.legend(*size.get_legend_handles_labels(), fontsize=7, loc="outside lower center", ncols=4)
    phase.set(xlabel="frequency (Hz)", ylabel="phase (degrees)")
    for name, said, colour in (("memory", "slip memory", FIRST[0]), ("coulomb", "Coulomb", FIRST[1])):
        begin.plot(kept[f"onset.{name}"].x, kept[f"onset.{name}"].y, color=colour, label=said)
    begin.set(xlabel="slip (um)", ylabel="friction (mN/mm)", ylim=(0.0, None))
    begin.legend(fontsize=7)
    return figure

"""Stiffness of the pad over the frequency, about three depths, normal and tangential.

The paper's pad with the illustrative branches of the study `relaxation` is pressed to 0.3, 0.6 and 1.0 mm and
shaken by an infinitely small motion of the bone (`ev.impedance`), while it sticks. Expected: at low frequency
the slope of the force of a slow press; then the spectrum of the branches; then the mass of the tissue, which
takes from the stiffness until the real part vanishes. How high that frequency is depends on how much tissue
moves along, in the plane more than in a fingertip.

The spectrum of the branches alone is beside it: with all layers alike and small loads the pad would follow it
but for its mass. Here the nail and the bulk do not relax.
"""

from typing import Any

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .common import Series, Study
from .plots import FIRST, Figure, panels
from .relaxation import SHARES, pad

DEPTHS = (0.3, 0.6, 1.0)
AXES = ("normal", "tangential")
STICKS, LITTLE = 50.0, 1e-4
ASSUMPTIONS = {
    "shares": "0.8, 0.5, 0.4 of the shear modulus at rest, illustrative; 4 ms, 70 ms, 1.4 s",
    "density": "1e-9 t/mm3",
    "friction": "50: the pad sticks",
    "plane strain": "per mm of depth; a whole fingertip has less tissue to move along",
}


def spectrum(frequency: Floats) -> Any:
    """Modulus of the branches over that at rest."""
    share, tau = np.array(SHARES).T
    turned = 2j * np.pi * frequency[:, None] * tau
    return 1.0 + (share * turned / (1.0 + turned)).sum(axis=1)


def pressed(finger: ev.FingerPad, depth: float) -> ev.Scene:
    """The pad at a depth."""
    motion = ev.Press(indentation=depth, steps=4)
    return ev.Scene(finger, ev.Flat(friction=STICKS), motion=motion, output=ev.Output(every=10_000))


def slope(finger: ev.FingerPad, depth: float) -> float:
    """Change of the force of a slow press by the depth, by differences over 0.2 um."""
    first = ev.Press(indentation=depth, steps=4)
    ends = []
    for change in (-LITTLE, LITTLE):
        scene = pressed(finger, depth)
        motion = [first, ev.Press(indentation=depth + change, steps=1)]
        ends.append(ev.simulate(ev.Scene(finger, scene.surface, motion=motion)).applied_force[-1])
    return float((ends[1] - ends[0]) / (2.0 * LITTLE))


def main(quick: bool = False) -> Study:
    """Stiffness by depth and axis, the frequency where its real part vanishes, and the slope of a press."""
    finger, depths = pad(quick), DEPTHS[1:2] if quick else DEPTHS
    frequency = np.geomspace(0.1, 300.0, 15 if quick else 30)
    alone = spectrum(frequency)
    numbers, series = {}, []
    for depth in depths:
        for axis in AXES:
            found, key = ev.impedance(pressed(finger, depth), frequency, axis), f"{axis}.{depth:g}_mm"
            real = found.stiffness.real
            numbers[f"stiffness_mN_per_mm2.{key}.0.1_Hz"] = 1e3 * real[0]
            numbers[f"vanishes_Hz.{key}.onset"] = vanishing(frequency, real)
            series.append(Series(f"real.{key}", frequency, 1e3 * real, "mN/mm2"))
            series.append(Series(f"imaginary.{key}", frequency, 1e3 * found.stiffness.imag, "mN/mm2"))
    slow = float(ev.impedance(pressed(finger, depths[-1]), 1e-6).stiffness[0].real)
    numbers |= {"slow.mN_per_mm2": 1e3 * slow, "slope_of_a_press.mN_per_mm2": 1e3 * slope(finger, depths[-1])}
    series += [
        Series("branches.real", frequency, alone.real, "1"),
        Series("branches.imaginary", frequency, alone.imag, "1"),
    ]
    parameters = {"depths_mm": depths, "frequencies": len(frequency)}
    return Study("impedance", numbers, {}, ASSUMPTIONS, series, lambda: draw(series, depths), parameters)


def vanishing(frequency: Floats, real: Floats) -> float:
    """Where the real part first becomes negative (Hz); nan where it does not."""
    below = np.flatnonzero(real < 0.0)
    if not below.size:
        return float("nan")
    i = int(below[0])
    return float(np.interp(0.0, [real[i], real[i - 1]], [frequency[i], frequency[i - 1]]))


def draw(series: list[Series], depths: tuple[float, ...]) -> Figure:
    """Real and imaginary part, normal and tangential, with the spectrum of the branches."""
    figure, axes = panels(5.6, 2, rows=2)
    kept = {one.name: one for one in series}
    for row, part in enumerate(("real", "imaginary")):
        for column, axis in enumerate(AXES):
            ax = axes[2 * row + column]
            for depth, colour in zip(depths, FIRST, strict=False):
                one = kept[f"{part}.{axis}.{depth:g}_mm"]
                ax.plot(one.x, one.y, color=colour, lw=1.2, label=f"{depth:g} mm")
            size = kept[f"real.{axis}.{depths[-1]:g}_mm"].y[0] / kept["branches.real"].y[0]
            one = kept[f"branches.{part}"]
            ax.plot(one.x, size * one.y, color="black", lw=0.8, ls="--", label="branches alone")
            top = 1.6 * size * max(one.y)
            ax.set(xscale="log", xlim=(0.08, 200.0), ylim=(-0.4 * top if part == "real" else 0.0, top))
            ax.set(xlabel="frequency (Hz)", ylabel=f"{axis}, {part} (mN/mm²)")
            ax.axhline(0.0, color="0.6", lw=0.6)
    axes[0].legend(fontsize=7, loc="lower left")
    return figure

"""Moisture: a film of water below a finger beside the voltage of a touchscreen.

The finger is pressed with 0.05 N/mm on a touchscreen at 100 V peak, whose faces stay 1 um apart, and slid.
Films of 0 to 10 um are as high as their menisci; three frequencies set the skin's permittivity and
conductivity (dry skin of Gabriel et al.).

Expected: the film's pull, 2 gamma cos(theta) = 0.11 J/m2 of work, is of the size of the voltage's and falls
with its height h0 as 1/h0 where it presses on what touches. Friction rises with it whether the voltage is
on or off, so that the share of the voltage falls: thresholds rise with moisture. What does not follow: that
moist skin is softer, that water conducts, and that a film flows and dries.
"""

from typing import Any

import evfem as ev

from .common import Series, Study
from .plots import FIRST, Figure, panels

FILMS, FREQUENCIES = (0.0, 2.0, 5.0, 10.0), (30.0, 250.0, 2000.0)
LOAD, AMPLITUDE, FRICTION, ROUGH = 0.05, 100.0, 0.3, 1e-3
TENSION, ANGLE = 0.0728, 40.0
ASSUMPTIONS = {
    "water": "0.0728 N/m, contact angle 40 degrees on both faces, one height everywhere",
    "faces": "1 um apart where they touch, whatever the pressure",
    "finger": "without ridges, coarse, plane strain, 0.05 N/mm",
    "skin": "permittivity and conductivity of dry skin at every film",
}


def slid(film: float, frequency: float | None) -> ev.Result:
    """Pressed and slid, below a film (um), without a voltage if there is no frequency (Hz)."""
    finger = ev.FingerPad(ridges=False, resolution="coarse")
    water = None if film == 0.0 else ev.Capillary(TENSION, ANGLE, 1e-3 * film)
    motion = [ev.Press(force=LOAD, steps=3), ev.Slide(distance=6.0, steps=5, hold="force")]
    more: dict[str, Any] = {"adhesion": water, "output": ev.Output(every=100)}
    display = ev.Display(ev.TOUCHSCREEN, friction=FRICTION)
    if frequency is None:
        rough = {} if water is None else {"roughness_gap": ROUGH}
        return ev.simulate(ev.Scene(finger, display, motion=motion, **more, **rough))
    drive = ev.Drive(frequency=frequency, skin="gabriel_dry")
    voltage = AMPLITUDE / 2.0**0.5
    more |= {"drive": drive, "roughness_gap": ROUGH}
    return ev.simulate(ev.Scene(finger, display, ev.StrongTroxel(), voltage, motion, **more))


def main(quick: bool = False) -> Study:
    """Friction, adhesion and attraction over the film, and what the voltage adds to friction."""
    films, frequencies = (FILMS[::2], FREQUENCIES[1:2]) if quick else (FILMS, FREQUENCIES)
    numbers, series = {}, []
    off = [slid(film, None) for film in films]
    friction = [float(one.tangential_force[-1]) for one in off]
    adhesion = [float(one.adhesive_force[-1]) for one in off]
    for film, shear, pull in zip(films, friction, adhesion, strict=True):
        numbers |= {f"off.{film:g}um.friction": shear, f"off.{film:g}um.adhesion": pull}
    series += [Series("off.friction", films, friction, "N/mm"), Series("adhesion", films, adhesion, "N/mm")]
    for frequency in frequencies:
        on = [slid(film, frequency) for film in films]
        gain = [
            100.0 * (float(one.tangential_force[-1]) / f - 1.0) for one, f in zip(on, friction, strict=True)
        ]
        key = f"{frequency:g}Hz"
        for film, one, more in zip(films, on, gain, strict=True):
            numbers |= {
                f"{key}.{film:g}um.attraction": float(one.electrostatic_force[-1]),
                f"{key}.{film:g}um.friction": float(one.tangential_force[-1]),
                f"{key}.{film:g}um.gain_percent": more,
            }
        series.append(
            Series(f"{key}.friction", films, [float(one.tangential_force[-1]) for one in on], "N/mm")
        )
        series.append(Series(f"{key}.gain", films, gain, "%"))
    parameters = {"films_um": films, "frequencies_Hz": frequencies, "load_N_per_mm": LOAD}
    return Study("moisture", numbers, {}, ASSUMPTIONS, series, lambda: draw(series), parameters)


def draw(series: list[Series]) -> Figure:
    """Friction with and without a voltage, and what the voltage adds."""
    figure, (left, right) = panels(3.0, 2)
    kept = {one.name: one for one in series}
    off = kept["off.friction"]
    left.plot(off.x, off.y, "o--", color="black", lw=1.0, ms=4, label="no voltage")
    keys = [name.removesuffix(".gain") for name in kept if name.endswith(".gain")]
    for key, colour, size in zip(keys, FIRST, (8, 4, 4), strict=False):
        label = key.replace("Hz", " Hz")
        one, gain = kept[f"{key}.friction"], kept[f"{key}.gain"]
        left.plot(one.x, one.y, "o-", color=colour, lw=1.2, ms=size, label=label)
        right.plot(gain.x, gain.y, "o-", color=colour, lw=1.2, ms=size, label=label)
    left.set(xlabel="film (um)", ylabel="friction (N/mm)", ylim=(0.0, None))
    right.set(xlabel="film (um)", ylabel="more friction by the voltage (%)", ylim=(0.0, None))
    left.legend(fontsize=7)
    return figure

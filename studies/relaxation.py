"""Tissue that relaxes: press and hold, creep, a stroke there and back, and a cylinder that is drawn.

The paper's pad has three Maxwell branches with the relaxation times that were measured on fingertips (4 ms,
70 ms, 1.4 s: D. T. V. Pawluk, R. D. Howe, J. Biomech. Eng. 121 (1999) 178-183, doi:10.1115/1.2835100). Their
shares, 0.8, 0.5 and 0.4 of the modulus at rest in all layers but the nail, are illustrative: none are
published as such.

- Press to 1 mm at three speeds and hold: a fast press needs a larger force, and all end at one.
- Press to 1 mm within 20 ms and hold the load: the bone sinks on.
- Push the pad that sticks 0.5 mm sideways and back at three speeds: with branches over three decades about a
  third of the work is lost at every speed.
- Hunter's problem on a block (`rolling`): a cylinder that is drawn without friction is resisted, and the
  contact lies ahead of it, as in closed form.
"""

from typing import Any

import numpy as np

import evfem as ev

from .common import Series, Study
from .plots import FIRST, Figure, panels
from .rolling import HALF_PLANE, Rolling, rolled

SHARES = ((0.8, 0.004), (0.5, 0.07), (0.4, 1.4))
DEPTH, STROKE, STICKS = 1.0, 0.5, 3.0
PRESSES = (2.0, 10.0, 50.0)  # mm/s
TRIES = (1.0, 10.0, 100.0)  # mm/s
NAIL = ev.NeoHookean(E=17.0, nu=0.3, relaxation=())
ASSUMPTIONS = {
    "shares": "0.8, 0.5, 0.4 of the shear modulus at rest, illustrative",
    "times": "4 ms, 70 ms, 1.4 s",
    "bulk": "does not relax",
    "nail": "without branches",
    "friction": "3 where the pad is to stick, 0.3 where it is pressed, none below the cylinder",
    "rolling": "E 0.03 MPa, nu 0.499 at rest, one branch of share 2 and 70 ms; 120 mm x 60 mm, bonded above",
}


def pad(quick: bool) -> ev.FingerPad:
    """The paper's finger, coarse, with branches; ridges left out where it is to be quick."""
    return ev.FingerPad(resolution="coarse", ridges=not quick, relaxation=SHARES, materials={"nail": NAIL})


def run(finger: ev.FingerPad, motion: list[Any], friction: float = 0.3, timed: bool = True) -> ev.Result:
    """Motions of a finger on a flat surface, in time or at rest in every step."""
    solver = ev.Solver(dynamics="viscous" if timed else "quasistatic")
    output = ev.Output(every=10_000)
    return ev.simulate(
        ev.Scene(finger, ev.Flat(friction=friction), motion=motion, solver=solver, output=output)
    )


def held(finger: ev.FingerPad, speed: float, hold: str, steps: int) -> ev.Result:
    """Press to `DEPTH` at a speed, then hold the indentation or the force for 10 s."""
    press = ev.Press(indentation=DEPTH, speed=speed, steps=steps)
    return run(finger, [press, ev.Wait(10.0, steps=2 * steps, spacing="log", hold=hold)])


def strokes(finger: ev.FingerPad, speed: float, steps: int) -> tuple[Any, Any, float]:
    """Places and tangential forces of a stroke there and back at a held depth, and the share that is lost."""
    there = [ev.Slide(way, speed=speed, steps=steps) for way in (STROKE, -STROKE)]
    found = run(finger, [ev.Press(indentation=DEPTH, steps=4), *there], STICKS)
    x = np.append(0.0, found.position[4:])
    force = np.append(found.applied_tangential_force[3], found.applied_tangential_force[4:])
    work = 0.5 * (force[1:] + force[:-1]) * np.diff(x)
    return x, force, float(work.sum() / work[:steps].sum())


def main(quick: bool = False) -> Study:
    """Peaks over the force at rest, creep, shares lost in strokes, the cylinder beside its closed form."""
    finger, steps = pad(quick), 10 if quick else 20
    speeds = (20.0,) if quick else tuple(HALF_PLANE)
    cell, step = (0.5, 0.5) if quick else (0.35, 0.15)
    at_rest = run(finger, [ev.Press(indentation=DEPTH, steps=4)], timed=False).applied_force[-1]
    numbers, series = {"rest.mN_per_mm": 1e3 * at_rest}, []
    for speed in PRESSES:
        found = held(finger, speed, "indentation", steps)
        force, key = found.applied_force / at_rest, f"{speed:g}_mm_s"
        numbers |= {f"peak_over_rest.{key}": force[steps - 1], f"end_over_rest.{key}": force[-1]}
        series.append(Series(f"held.{key}", found.time, force, "1"))
    creep = held(finger, 50.0, "force", steps)
    sunk = creep.indentation[steps - 1 :]
    numbers |= {"creep.mm_at_10_s": sunk[-1], "creep.load_mN_per_mm": 1e3 * creep.applied_force[-1]}
    series.append(Series("creep", creep.time[steps:] - creep.time[steps - 1], sunk[1:], "mm"))
    for speed in TRIES:
        x, force, lost = strokes(finger, speed, steps)
        numbers[f"lost_in_stroke.{speed:g}_mm_s"] = lost
        series.append(Series(f"stroke.{speed:g}_mm_s", x, 1e3 * force, "mN/mm"))
    for speed in speeds:
        found = rolled(speed, cell, step)
        numbers |= beside(found, speed)
        near = np.abs(found.place) < 6.0
        series.append(Series(f"rolling.{speed:g}_mm_s", found.place[near], 1e3 * found.pressure[near], "kPa"))
    parameters = {"steps": steps, "cell_mm": cell, "step_mm": step, "depth_mm": DEPTH}
    return Study("relaxation", numbers, {}, ASSUMPTIONS, series, lambda: draw(series), parameters)


def beside(found: Rolling, speed: float) -> dict[str, float]:
    """The cylinder's numbers, those of the half-plane, and where the pressure is largest."""
    key, names = f"{speed:g}_mm_s", ("half_width_mm", "middle_ahead_mm", "resistance")
    numbers = {f"rolling.{name}.{key}": value for name, value in zip(names, found[:3], strict=True)}
    exact = {f"half_plane.{name}.{key}": v for name, v in zip(names, HALF_PLANE[speed], strict=True)}
    return numbers | exact | {f"rolling.peak_ahead_mm.{key}": float(found.place[np.argmax(found.pressure)])}


def draw(series: list[Series]) -> Figure:
    """Forces held, creep, strokes, and pressure below the cylinder."""
    figure, (holding, sinking, sideways, rolling) = panels(5.2, 2, rows=2)
    groups: dict[str, list[Series]] = {}
    for one in series:
        groups.setdefault(one.name.split(".")[0], []).append(one)
    for name, ax in (("held", holding), ("stroke", sideways), ("rolling", rolling)):
        for one, colour in zip(groups[name], FIRST, strict=False):
            label = one.name.split(".", 1)[1].replace("_mm_s", " mm/s")
            ax.plot(one.x, one.y, color=colour, lw=1.2, label=label)
        ax.legend(fontsize=7)
    (creep,) = groups["creep"]
    sinking.plot(creep.x, creep.y, color=FIRST[0], lw=1.2)
    holding.set(xscale="log", xlabel="time since touch (s)", ylabel="force over that at rest")
    sinking.set(xscale="log", xlabel="time under the load (s)", ylabel="indentation (mm)")
    sideways.set(xlabel="bone's x (mm)", ylabel="tangential force (mN/mm)")
    rolling.set(xlabel="ahead of the lowest point (mm)", ylabel="pressure (kPa)")
    return figure

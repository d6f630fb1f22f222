"""Stick-slip: a mass on a spring, drawn over a surface whose friction falls with the speed.

A slab that hardly deforms is pressed with 0.04 N/mm, carries a mass of 1e-6 t behind a spring of 0.02 N/mm
(both per mm of depth, `evfem.terms.hand`) and is drawn at 1, 2 and 4 mm/s. Friction is Stribeck's: 0.4 at
rest, 0.2 of fast sliding, with the transition at 0.5 mm/s.

Expected: it sticks until the spring carries 0.4 times the load, slips, and sticks again. The reference is the
equation of motion m x'' = k (V t - x) - N mu(x'), integrated with events to ten digits; where friction falls
at once the period has a closed form, given beside it. Backward Euler takes from the swing of a slip what
falls with the step: the period comes out shorter, by less than 1 % with 600 steps in a slip.
"""

from typing import Any, NamedTuple

import numpy as np

import evfem as ev
from evfem.common.arrays import Floats

from .common import Series, Study
from .plots import COLOURS, FIRST, Figure, new_figure

LOAD, STATIC, FALL, AROUND = 0.04, 0.4, 0.5, 0.5
HAND = ev.Hand(stiffness=0.02, mass=1e-6)
SPEEDS = (1.0, 2.0, 4.0)
STEPS, QUICK_STEPS = (150, 300, 600), (40, 80)
ASSUMPTIONS = {
    "load": "0.04 N/mm",
    "friction": "0.4 at rest, 0.2 of fast sliding, exponential transition at 0.5 mm/s",
    "hand": "0.02 N/mm and 1e-6 t per mm of depth, no damper",
    "steps": "600 in a slip and the swing after it; a spring that is stretched is as straight as few steps",
}


class Cycle(NamedTuple):
    """Seconds of stick and of slip."""

    stick: float
    slip: float

    @property
    def period(self) -> float:
        """Both together."""
        return self.stick + self.slip


def reference(speed: float) -> tuple[Cycle, Floats, Floats]:
    """The cycle by the equation of motion, and times and forces of the spring in its slip."""
    from scipy.integrate import solve_ivp

    def motion(t: float, y: Floats) -> list[float]:
        mu = STATIC * (FALL + (1.0 - FALL) * np.exp(-max(y[1], 0.0) / AROUND))
        return [speed - y[1], (HAND.stiffness * y[0] - LOAD * mu) / HAND.mass]

    def stops(t: float, y: Floats) -> float:
        return float(y[1])

    stops.terminal, stops.direction = True, -1  # type: ignore[attr-defined]
    stretched = STATIC * LOAD / HAND.stiffness
    way = solve_ivp(motion, (0.0, 1.0), [stretched, 1e-9], events=stops, rtol=1e-10, atol=1e-13)
    left, slip = way.y_events[0][0][0], float(way.t_events[0][0])
    return Cycle(float(stretched - left) / speed, slip), way.t, HAND.stiffness * way.y[0]


def closed_form(speed: float) -> float:
    """The period where friction falls at once, by D = fall of the force and w^2 = k/m:
    2 D/(k V) + (2/w) (pi - atan(D w/(k V))).
    """
    omega, fall = np.sqrt(HAND.stiffness / HAND.mass), (1.0 - FALL) * STATIC * LOAD
    rate = HAND.stiffness * speed
    return float(2.0 * fall / rate + 2.0 / omega * (np.pi - np.arctan(fall * omega / rate)))


def slab() -> ev.MeshedFinger:
    """4 mm of 50 MPa, 0.02 mm high, as one quadrilateral."""
    points = np.array([[-2.0, 0.0], [2.0, 0.0], [-2.0, 0.02], [2.0, 0.02]])
    sets = {"pad": np.array([0, 1]), "bone": np.array([2, 3])}
    mesh = ev.Mesh(points, np.array([[0, 1, 3, 2]]), "quad", np.zeros(1, dtype=np.int64), {"tissue": 0}, sets)
    return ev.MeshedFinger(mesh, {"tissue": ev.NeoHookean(E=50.0, nu=0.0)})


def drawn(speed: float, steps: int) -> tuple[ev.Result, float]:
    """Two slips, each followed in so many steps, and the period between their beginnings (s)."""
    cycle, _, _ = reference(speed)
    first = STATIC * LOAD / HAND.stiffness / speed  # s
    fine = 1.3 * cycle.slip + 0.001 / speed
    pieces = [(first - 0.001 / speed, 3), (fine, steps), (0.98 * cycle.period - fine, 3), (fine, steps)]
    motion: list[Any] = [ev.Press(force=LOAD, steps=1)]
    motion += [ev.Slide(speed * t, steps=n, speed=speed, hold="force") for t, n in pieces]
    law, name = ev.RateFriction(speed=AROUND, ratio=FALL), "stick_slip"
    how = {"hand": HAND, "friction_law": law, "output": ev.Output(every=100_000), "name": name}
    scene = ev.Scene(slab(), ev.Flat(friction=STATIC), motion=motion, **how)
    result = ev.simulate(scene)
    held = 3 + steps  # row of the end of the first slip, where the mass sticks again
    lacking = STATIC * LOAD - result.applied_tangential_force[held]
    second = result.time[held] + lacking / (HAND.stiffness * speed)
    return result, float(second - first)


def main(quick: bool = False) -> Study:
    """Periods over the speed and over the step, and the forces of two slips."""
    speeds, counts = (SPEEDS[:1], QUICK_STEPS) if quick else (SPEEDS, STEPS)
    numbers, series = {}, []
    for speed in speeds:
        cycle, at, force = reference(speed)
        key = f"{speed:g}_mm_s"
        result, period = drawn(speed, counts[-1])
        numbers |= {
            f"period_s.{key}": period,
            f"reference.period_s.{key}": cycle.period,
            f"reference.stick_s.{key}": cycle.stick,
            f"reference.falls_at_once.period_s.{key}": closed_form(speed),
            f"verdict.error_percent.{key}": 100.0 * (period / cycle.period - 1.0),
            f"verdict.remainder_of_the_books.{key}": remainder(result),
        }
        begin = STATIC * LOAD / HAND.stiffness / speed
        spring = 1e3 * HAND.stiffness * (speed * result.time - result.position)
        series.append(Series(f"simulated.{key}", result.time, spring, "N/m"))
        series.append(Series(f"reference.{key}", begin + at, 1e3 * force, "N/m"))
    exact = reference(speeds[0])[0].period
    periods = [*(drawn(speeds[0], n)[1] for n in counts[:-1]), numbers[f"period_s.{speeds[0]:g}_mm_s"]]
    errors = [100.0 * abs(period / exact - 1.0) for period in periods]
    series.append(Series("error", counts, errors, "%"))
    numbers["verdict.rate"] = float(np.log(errors[-2] / errors[-1]) / np.log(counts[-1] / counts[-2]))
    parameters = {"steps": counts, "speeds": speeds}
    return Study("stick_slip", numbers, {}, ASSUMPTIONS, series, lambda: draw(series, speeds), parameters)


def remainder(result: ev.Result) -> float:
    """What is left of the books, relative to the work of the drive."""
    lost = result.friction_dissipation + result.integrator_dissipation + result.snap_dissipation
    kept = result.stored_energy + result.kinetic_energy + result.viscous_dissipation
    return float(np.abs(result.external_work - lost - kept).max() / np.abs(result.external_work).max())


def draw(series: list[Series], speeds: tuple[float, ...]) -> Figure:
    """Force of the spring over time, the first slip with the reference, and the error."""
    figure = new_figure(3.2)
    whole, slip, right = figure.subplots(1, 3, width_ratios=[3, 2, 2])
    kept = {one.name: one for one in series}
    for speed, colour in zip(speeds, FIRST, strict=False):
        one, exact = (kept[f"{kind}.{speed:g}_mm_s"] for kind in ("simulated", "reference"))
        whole.plot(one.x, one.y, color=colour, lw=1.2, label=f"{speed:g} mm/s")
        begin, end = exact.x[0], exact.x[-1]
        near = (one.x > begin - 0.004) & (one.x < end + 0.008)
        slip.plot(1e3 * (one.x[near] - begin), one.y[near], color=colour, lw=1.2)
        slip.plot(1e3 * (exact.x - begin), exact.y, color="black", lw=0.8, ls="--")
    whole.set(xlabel="time (s)", ylabel="force of the spring (N/m)", ylim=(0.0, 20.0))
    whole.legend(fontsize=7, loc="upper right")
    slip.plot([], [], color="black", lw=0.8, ls="--", label="equation of motion")
    slip.set(xlabel="time since the slip (ms)", ylim=(0.0, 20.0))
    slip.legend(fontsize=7, loc="upper right")
    error = kept["error"]
    right.plot(error.x, error.y, "o-", color=COLOURS["neutral"])
    right.axhline(1.0, color=COLOURS["measured"], lw=0.8)
    right.set(xlabel="steps in a slip", ylabel=f"error at {speeds[0]:g} mm/s (%)", ylim=(0.0, None))
    return figure

"""Surfaces drawn at random: flat, waves, profiles, gratings and roughness whose slopes are at most
0.4 or so, with friction from none to 1.5.
"""

import numpy as np

from .bodies import width
from .tables import Draw, Tables, six_digits

LARGEST_FRICTION = 1.5
STEEPEST = 0.4
#: lowest point (mm) of a finger that is not drawn: none is higher than 20 mm
DEEPEST = -6.395


def surface(random: Draw, finger: Tables) -> Tables:
    """The table [surface] below a finger."""
    kind = random.one_of(*["flat"] * 6, *["sinusoid"] * 2, *["profile"] * 2, "grating", "self_affine")
    table: Tables = {"kind": kind, "friction": _friction(random, 0.5 * width(finger))}
    highest = 0.0
    if kind == "sinusoid" and random.chance(0.8):
        table["terms"] = [_wave(random) for _ in range(random.whole(1, 3))]
        highest = sum(abs(term[0]) for term in table["terms"])
    elif kind == "profile":
        table["points"] = _points(random)
        highest = max(height for _, height in table["points"])
    elif kind == "grating":
        table |= _grating(random)
    elif kind == "self_affine":
        table |= _rough(random)
        highest = 5.0 * table["rms"]
    elif kind == "sinusoid":
        highest = 0.05
    if "participant" not in finger and random.chance(0.1):  # a finger that starts above the surface
        lowest = -0.5 * finger["height"] if "height" in finger else DEEPEST
        table["y"] = six_digits(lowest - highest - random.spread(1e-3, 0.5))
    return table


def add_both_ways(random: Draw, table: Tables) -> None:
    """Perhaps another surface below a coarse tip: waves, a profile, a grating or a relief in some direction,
    which its skin resolves, and friction over x and z, with jumps or without.
    """
    angle, amplitude = random.between(-180.0, 180.0), random.spread(0.002, 0.05)
    one, other = (2.0 * np.pi / random.spread(4.0, 12.0) for _ in range(2))
    kind = random.one_of("as it is", "sinusoid", "profile", "grating", "relief")
    if kind != "as it is":
        for key in ("terms", "y"):
            table.pop(key, None)
        table["kind"] = kind
    if kind == "sinusoid":
        table["terms"] = [[amplitude, six_digits(one), 0.0, 0.0], [amplitude, six_digits(other), 1.0, 90.0]]
    elif kind == "profile":
        x = np.linspace(-20.0, 20.0, 81)
        height = amplitude * np.sin(one * x)
        table["points"] = [[six_digits(a), six_digits(b)] for a, b in zip(x, height, strict=True)]
    elif kind == "grating":
        period = random.between(8.0, 12.0)
        table |= {"period": period, "groove_depth": amplitude, "wall_width": six_digits(0.45 * period)}
    elif kind == "relief":
        x = np.linspace(-20.0, 20.0, 41)
        height = amplitude * np.sin(one * x) * np.cos(other * x[:, None])
        table |= {"x": x.tolist(), "z": x.tolist(), "height": np.round(height, 6).tolist()}
    if kind in ("sinusoid", "profile", "grating"):
        table["angle"] = angle
    if random.chance(0.3):
        place = random.between(-2.0, 2.0)
        ends = [-20.0, place, place, 20.0] if random.chance(0.5) else [-20.0, place, place + 1.0, 20.0]
        mu = [random.between(0.05, 1.0) for _ in range(2)]
        rows = [[mu[0], mu[0], mu[1], mu[1]]] * 2 + [[mu[1], mu[1], mu[0], mu[0]]] * 2
        table["friction"] = {"x": ends, "z": ends, "friction": rows}


def add_friction_law(random: Draw, tables: Tables) -> None:
    """Perhaps a law of friction; where it asks for speeds, slides have them. Friction falls with the
    speed only where inertia holds it.
    """
    if not random.chance(0.2):
        return
    kind = random.one_of("load_index", "adhesive", "rate", "ageing")
    law: Tables = {"kind": kind}
    if kind == "load_index":
        law |= {"pressure": random.spread(3e-3, 0.05), "index": random.between(0.6, 1.3)}
    elif kind == "adhesive":
        law["strength"] = random.spread(5e-4, 0.01)
    elif kind == "rate":
        inertial = tables["solver"].get("dynamics") == "inertial"
        law |= {"speed": random.spread(1.0, 100.0), "ratio": random.between(0.5 if inertial else 1.0, 1.5)}
        law["exponent"] = random.between(0.0, 0.4)
    else:
        law |= {"fresh": random.between(0.1, 1.0), "time": random.spread(0.05, 10.0)}
    tables["surface"]["friction_law"] = law
    for motion in tables["motion"] if kind in ("rate", "ageing") else ():
        if motion["kind"] == "slide":
            motion.setdefault("speed", random.spread(1.0, 200.0))


def _wave(random: Draw) -> list[float]:
    """Amplitude, wavenumber and phase of a wave."""
    wavenumber = 2.0 * np.pi / random.spread(0.6, 12.0)
    amplitude = random.spread(0.002, min(0.1, STEEPEST / wavenumber))
    return [amplitude, six_digits(wavenumber), random.between(0.0, 6.28)]


def _points(random: Draw) -> list[list[float]]:
    """A profile at uneven distances."""
    apart = random.spread(0.2, 3.0)
    x, y, points = -25.0, 0.0, []
    while x < 25.0:
        points.append([six_digits(x), six_digits(y)])
        step = apart * random.between(0.5, 1.5)
        x += step
        change = random.between(-STEEPEST, STEEPEST) * min(step, 0.3)
        y = y + change if abs(y + change) < 0.15 else y - change
    return points


def _grating(random: Draw) -> Tables:
    period = random.spread(0.8, 6.0)
    table: Tables = {"period": period}
    groove, wall = 0.5 * period, 0.25 * period
    if random.chance(0.5):
        groove = table["groove_width"] = six_digits(period * random.between(0.3, 0.7))
        narrower = min(groove, period - groove)
        wall = table["wall_width"] = six_digits(narrower * random.between(0.4, 0.95))
        table["phase"] = random.between(-1.0, 1.0)
    # the steepest slope of a wall is pi depth / (2 wall)
    table["groove_depth"] = random.spread(0.003, max(0.004, min(0.1, 2.0 * STEEPEST * wall / np.pi)))
    return table


def _rough(random: Draw) -> Tables:
    """Roughness whose root mean square slope is at most 0.15."""
    hurst, shortest = random.between(0.5, 1.0), random.between(0.5, 2.0)
    table: Tables = {"hurst": hurst, "shortest": shortest, "seed": random.whole(0, 1000)}
    if random.chance(0.5):
        table["period"] = 8.0
        table["longest"] = random.between(4.0, 8.0)
    return table | {"rms": random.spread(5e-4, min(0.02, 0.15 * shortest / (2.0 * np.pi)))}


def _friction(random: Draw, half: float) -> float | list[list[float]]:
    """None, a coefficient, or a table with jumps and ramps from long ones down to 1 um."""
    if random.chance(0.2):
        return 0.0
    if random.chance(0.6):
        return random.between(0.05, LARGEST_FRICTION)
    rows: list[list[float]] = []
    mu = random.between(0.0, LARGEST_FRICTION)
    for place in random.places(random.whole(1, 6), -0.6 * half, 0.6 * half):
        if rows and place <= rows[-1][0]:  # within the ramp before
            continue
        rows.append([place, mu])
        mu = random.between(0.0, LARGEST_FRICTION)
        wide = random.one_of(0.0, random.spread(1e-3, 0.05), random.spread(0.05, 2.0))
        rows.append([float(f"{place + wide:.9g}"), mu])
    return rows

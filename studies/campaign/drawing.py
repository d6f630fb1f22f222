"""Scenes drawn at random from what a scene file can say; each is valid by construction.

Scene `number` of a seed is the same however many are drawn. Lengths in mm, forces in N/mm,
voltages in V. The ranges are those of coarse fingers: any size, smooth and ridged, all surfaces,
friction from 0 to 1.5, insulators of 5 um to 0.5 mm below 60 V/um and 3000 V. Sizes follow the
finger's: `scale` is its width over that of Table 2.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .tables import Tables, copied

#: of the generator itself: another one draws other scenes
GENERATOR = 1
TABLE_2_WIDTH = 16.68
LARGEST_FIELD = 60e3  # V/mm
LARGEST_VOLTAGE = 3000.0
LARGEST_FRICTION = 1.5


class Draw:
    """A generator of numbers with the few distributions that scenes need."""

    def __init__(self, seed: int, number: int) -> None:
        self._random = np.random.default_rng([GENERATOR, seed, number])

    def chance(self, probability: float) -> bool:
        """True with that probability."""
        return bool(self._random.random() < probability)

    def between(self, low: float, high: float) -> float:
        """Evenly between two numbers, with six digits."""
        return float(f"{self._random.uniform(low, high):.6g}")

    def spread(self, low: float, high: float) -> float:
        """Evenly on a logarithmic scale between two positive numbers, with six digits."""
        return float(f"{np.exp(self._random.uniform(np.log(low), np.log(high))):.6g}")

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included; small ones are as likely as large ones."""
        return int(np.clip(np.rint(self.spread(max(low, 1) - 0.49, high + 0.49)), low, high))

    def sign(self) -> float:
        """1 or -1."""
        return 1.0 if self.chance(0.5) else -1.0

    def one_of(self, *choices: Any) -> Any:
        """One of the choices, each as likely."""
        return choices[int(self._random.integers(len(choices)))]

    def places(self, count: int, low: float, high: float) -> list[float]:
        """Increasing positions, with six digits."""
        return sorted(float(f"{x:.6g}") for x in self._random.uniform(low, high, count))


def draw(seed: int, number: int) -> Tables:
    """The tables of scene `number` of a seed."""
    random = Draw(seed, number)
    tables: Tables = {"version": 1, "finger": _finger(random)}
    charged = random.chance(0.7)
    tables["surface"] = _surface(random, tables["finger"])
    if charged:
        tables["electrostatics"] = _electrostatics(random)
    tables["solver"] = _solver(random, tables)
    tables["motion"] = _motions(random, tables)
    _add_voltage(random, tables)
    return copied(tables)


# -- the finger


def _finger(random: Draw) -> Tables:
    width = random.between(12.0, 24.0) if random.chance(0.7) else TABLE_2_WIDTH
    height = float(f"{np.clip(width * random.between(0.7, 1.05), 9.0, 20.0):.6g}")
    finger: Tables = {"resolution": "coarse", "width": width, "height": height}
    finger |= _bone(width, height)
    finger["ridges"] = random.chance(0.5)
    if finger["ridges"]:
        finger |= _ridges(random, width)
    if random.chance(0.3):
        finger["materials"] = _materials(random)
    if random.chance(0.2):
        thickness = random.between(0.2, 0.6)
        finger["electrical"] = {"stratum_corneum_thickness": thickness}
        finger["electrical"]["stratum_corneum_eps_r"] = random.spread(10.0, 3000.0)
    return finger


def _bone(width: float, height: float) -> Tables:
    """A bone that leaves half a millimetre to the dermis of the default layers, and a nail that
    fits.
    """
    offset = float(f"{0.05 * (height - 6.0):.6g}")
    free = height - 2.0 * (0.38 + 0.47 + 1.0 + 0.5 + offset)
    wide = min(0.36 * width, 2.0 * free)
    return {
        "bone_height": float(f"{min(0.39 * height, free):.6g}"),
        "bone_width": float(f"{wide:.6g}"),
        "bone_offset": offset,
        "nail_width": float(f"{0.65 * width:.6g}"),
    }


def _ridges(random: Draw, width: float) -> Tables:
    """Ridges that are at most 0.3 of their pitch high, with walls that can be meshed."""
    pitch = random.between(0.3, min(0.8, 0.045 * width))
    ridges: Tables = {"ridge_width": pitch, "ridge_phase": random.between(-1.0, 1.0)}
    exponent = random.between(2.0, 8.0)
    ridges["ridge_exponent"] = exponent
    # the slope of the wall is at most about 2 exponent height / pitch
    steepest = min(0.3 * pitch, 0.25, 2.0 * pitch / exponent)
    ridges["ridge_height"] = random.between(0.02, max(0.021, steepest))
    return ridges


def _materials(random: Draw) -> Tables:
    """Some layers of another law or other moduli than in Table 2."""
    soft, materials = ("hypodermis", 0.034), {}
    for name, E in (soft, ("dermis", 0.080), ("stratum_corneum", 1.0)):
        if not random.chance(0.6):
            continue
        E = float(f"{E * random.spread(0.5, 2.0):.6g}")
        nu = random.one_of(0.3, 0.45, 0.48, 0.49, 0.495) if name != "stratum_corneum" else 0.3
        materials[name] = _law(random, E, nu)
    return materials


def _law(random: Draw, E: float, nu: float) -> Tables:
    mu = float(f"{E / (2.0 * (1.0 + nu)):.6g}")
    law = random.one_of("neo_hookean", "neo_hookean", "yeoh", "ogden")
    if law == "yeoh":
        return {"law": law, "c1": 0.5 * mu, "c2": float(f"{0.05 * mu:.6g}"), "nu": nu}
    if law == "ogden":
        return {"law": law, "mu": mu, "alpha": random.one_of(2.0, 4.0, 8.0), "nu": nu}
    return {"law": law, "E": E, "nu": nu}


# -- the surface


def _surface(random: Draw, finger: Tables) -> Tables:
    kind = random.one_of("flat", "flat", "flat", "sinusoid", "profile")
    surface: Tables = {"kind": kind, "friction": _friction(random, 0.5 * finger["width"])}
    highest = 0.0
    if kind == "sinusoid" and random.chance(0.8):
        surface["terms"] = [_wave(random) for _ in range(random.whole(1, 3))]
        highest = sum(abs(term[0]) for term in surface["terms"])
    elif kind == "profile":
        surface["points"] = _points(random)
        highest = max(height for _, height in surface["points"])
    elif kind == "sinusoid":
        highest = 0.05
    if random.chance(0.1):  # a finger that starts above the surface
        surface["y"] = float(f"{-0.5 * finger['height'] - highest - random.spread(1e-3, 0.5):.6g}")
    return surface


def _wave(random: Draw) -> list[float]:
    """Amplitude, wavenumber and phase of a wave whose slope is at most 0.4."""
    wavenumber = 2.0 * np.pi / random.spread(0.6, 12.0)
    amplitude = random.spread(0.002, min(0.1, 0.4 / wavenumber))
    return [amplitude, float(f"{wavenumber:.6g}"), random.between(0.0, 6.28)]


def _points(random: Draw) -> list[list[float]]:
    """A profile at uneven distances whose heights change by at most 0.4 of them."""
    apart = random.spread(0.2, 3.0)
    x, y, points = -25.0, 0.0, []
    while x < 25.0:
        points.append([float(f"{x:.6g}"), float(f"{y:.6g}")])
        step = apart * random.between(0.5, 1.5)
        x += step
        change = random.between(-0.4, 0.4) * min(step, 0.3)
        y = y + change if abs(y + change) < 0.15 else y - change
    return points


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
        width = random.one_of(0.0, random.spread(1e-3, 0.05), random.spread(0.05, 2.0))
        rows.append([float(f"{place + width:.9g}"), mu])
    return rows


# -- attraction and solver


def _electrostatics(random: Draw) -> Tables:
    """Everything but the voltage, which depends on the motions."""
    table: Tables = {
        "law": random.one_of("strong_troxel", "kaczmarek"),
        "insulator_thickness": random.spread(0.005, 0.5),
        "insulator_eps_r": random.spread(1.5, 20.0),
    }
    if random.chance(0.15):
        table["air_layer"] = False
    if random.chance(0.15):
        table["direction"] = "normal"
    if random.chance(0.05):
        table["gap_eps_r"] = random.between(1.0, 5.0)
    if random.chance(0.15):
        table["coupling"] = random.one_of("staggered", "staggered", "staggered_once")
    return table


def largest_voltage(table: Tables) -> float:
    """The voltage below 3000 V with 60 V/um in the insulator (V)."""
    return min(LARGEST_VOLTAGE, LARGEST_FIELD * table["insulator_thickness"])


def _solver(random: Draw, tables: Tables) -> Tables:
    solver: Tables = {}
    if random.chance(0.4):
        solver["element"] = random.one_of("q1", "q1_fbar", "q2", "q2p1")
    dynamics = random.one_of("quasistatic", "quasistatic", "quasistatic", "viscous", "inertial")
    if dynamics != "quasistatic":
        solver["dynamics"] = dynamics
        if dynamics == "viscous" or random.chance(0.7):
            tables["finger"]["viscosity"] = random.spread(1e-4, 2e-2)
    if random.chance(0.1):
        solver["contact"] = "penalty"
        solver["penalty_normal"] = random.spread(10.0, 1e4)
        solver["penalty_tangential"] = random.spread(10.0, 1e4)
    if random.chance(0.15):
        solver["tolerance"] = random.one_of(1e-6, 1e-7, 1e-9, 1e-10)
    return solver


# -- motions and voltage


def _motions(random: Draw, tables: Tables) -> list[Tables]:
    """Perhaps hovering first, a press, then slides, ramps and further presses in any order."""
    scale, charged = tables["finger"]["width"] / TABLE_2_WIDTH, "electrostatics" in tables
    dynamic = tables["solver"].get("dynamics", "quasistatic") != "quasistatic"
    motions: list[Tables] = []
    if random.chance(0.25):
        motions.append({"kind": "hover", "gap": random.spread(0.01, 1.0), "steps": random.whole(1, 4)})
        if charged and random.chance(0.4):
            motions.append({"kind": "voltage", "steps": random.whole(1, 10)})
    motions.append(_press(random, scale, dynamic))
    for _ in range(random.whole(1, 3)):
        kind = random.one_of("slide", "slide", "slide", "voltage" if charged else "slide", "press", "hover")
        if kind == "slide":
            motions.append(_slide(random, scale, dynamic))
        elif kind == "voltage":
            motions.append({"kind": "voltage", "steps": random.whole(1, 10)} | _hold(random))
        elif kind == "press":
            motions.append(_press(random, scale, dynamic))
        elif random.chance(0.5):
            motions.append({"kind": "hover", "gap": random.spread(0.01, 1.0), "steps": random.whole(1, 4)})
            motions.append(_press(random, scale, dynamic))
    return motions


def _press(random: Draw, scale: float, dynamic: bool) -> Tables:
    press: Tables = {"kind": "press", "steps": random.whole(1, 10)}
    if random.chance(0.5):
        return press | {"force": random.spread(1e-3, 0.15) * scale}
    press["indentation"] = random.spread(0.02, 1.8) * scale
    if dynamic and random.chance(0.7):
        press["speed"] = random.spread(1.0, 100.0)
    return press


def _slide(random: Draw, scale: float, dynamic: bool) -> Tables:
    slide: Tables = {"kind": "slide", "distance": random.sign() * random.spread(0.02, 6.0) * scale}
    slide["steps"] = random.whole(2, 40)
    if dynamic or random.chance(0.1):
        slide["speed"] = random.spread(1.0, 200.0)
    return slide | _hold(random)


def _hold(random: Draw) -> Tables:
    return {"hold": "force"} if random.chance(0.5) else {}


def _add_voltage(random: Draw, tables: Tables) -> None:
    """A constant voltage, one along the way, or the targets of the ramps, up and down."""
    if "electrostatics" not in tables:
        return
    table, ramps = tables["electrostatics"], [one for one in tables["motion"] if one["kind"] == "voltage"]
    most = largest_voltage(table)

    def volts() -> float:
        return random.between(0.02, 1.0) * most * random.one_of(1.0, 1.0, -1.0)

    for ramp in ramps:
        ramp["voltage"] = 0.0 if random.chance(0.3) else volts()
    if ramps or random.chance(0.8):
        table["voltage"] = 0.0 if ramps and random.chance(0.5) else volts()
        return
    places = random.places(random.whole(2, 12), -6.0, 6.0)
    kept = [x for i, x in enumerate(places) if i == 0 or x - places[i - 1] > 1e-3]
    table["voltage_profile"] = [[x, abs(volts())] for x in kept]

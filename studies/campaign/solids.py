"""Fingers in three dimensions drawn at random: smooth coarse tips in few steps, which cost about what
a finger in the plane does, in any direction over flat faces and long waves.
"""

from __future__ import annotations

from copy import deepcopy

from .attractions import add_voltage, electrostatics
from .bodies import LAYERS
from .draws import Draw, six_digits
from .tables import Tables

#: what a finger in three dimensions cannot do yet, of the keys that `electrostatics` draws
PLANE = ("direction",)


def draw_solid(random: Draw) -> Tables:
    """The tables of a scene with a finger in three dimensions."""
    finger = _tip(random)
    tables: Tables = {"version": 1, "finger": finger, "surface": _surface(random), "solver": {}}
    if random.chance(0.6):
        table = electrostatics(random)
        tables["electrostatics"] = {key: value for key, value in table.items() if key not in PLANE}
        if random.chance(0.2):
            tables["electrostatics"]["roughness_gap"] = random.spread(2e-4, 0.01)
    if random.chance(0.3):
        tables["solver"]["dynamics"] = random.one_of("viscous", "inertial")
        finger["viscosity"] = random.spread(1e-4, 2e-2)
    tables["motion"] = _motions(random, tables)
    add_voltage(random, tables)
    return deepcopy(tables)


def _tip(random: Draw) -> Tables:
    table: Tables = {"kind": "fingertip", "resolution": "coarse", "ridges": "none"}
    if random.chance(0.7):
        table["width"] = random.between(15.0, 18.0)
        table["height"] = six_digits(table["width"] * random.between(0.75, 0.85))
        table["length"] = six_digits(table["width"] * random.between(1.3, 1.5))
        table["bone_length"] = six_digits(0.75 * table["length"])
    if random.chance(0.2):
        table["posture"] = random.between(0.0, 25.0)
    if random.chance(0.2):
        table["rim"] = "free"
    if random.chance(0.3):
        name = random.one_of("hypodermis", "dermis")
        E = six_digits(LAYERS[name][1] * random.spread(0.7, 1.5))
        table["materials"] = {name: {"law": "neo_hookean", "E": E, "nu": random.one_of(0.45, 0.48)}}
    return table


def _surface(random: Draw) -> Tables:
    """Flat, or waves along x that a coarse skin resolves; friction without jumps."""
    friction = 0.0 if random.chance(0.2) else random.between(0.05, 1.0)
    table: Tables = {"kind": random.one_of("flat", "flat", "sinusoid"), "friction": friction}
    if random.chance(0.2):
        place, wide = random.between(-2.0, 2.0), random.spread(0.5, 2.0)
        table["friction"] = [[place, friction], [six_digits(place + wide), random.between(0.05, 1.0)]]
    if table["kind"] == "sinusoid":
        wavenumber = six_digits(6.2831853 / random.spread(4.0, 12.0))
        table["terms"] = [[random.spread(0.002, 0.05), wavenumber, random.between(0.0, 6.28)]]
    return table


def _motions(random: Draw, tables: Tables) -> list[Tables]:
    """A press, and slides in any direction or a ramp after it."""
    timed = "dynamics" in tables["solver"]
    press: Tables = {"kind": "press", "steps": random.whole(1, 3)}
    if random.chance(0.5):
        press["force"] = random.spread(0.02, 1.0)
    else:
        press["indentation"] = random.spread(0.05, 1.0)
        if timed:
            press["speed"] = random.spread(1.0, 100.0)
    motions = [press]
    if "electrostatics" in tables and random.chance(0.3):
        motions.append({"kind": "voltage", "steps": random.whole(1, 3)})
    for _ in range(random.whole(1, 2)):
        slide: Tables = {"kind": "slide", "distance": random.spread(0.02, 2.0), "steps": random.whole(1, 4)}
        slide["angle"] = random.one_of(0.0, 90.0, 180.0, random.between(-180.0, 180.0))
        if timed:
            slide["speed"] = random.spread(1.0, 200.0)
        if random.chance(0.5):
            slide["hold"] = "force"
        motions.append(slide)
    return motions

"""Scenes drawn at random from what a scene file can say; each is valid by construction.

Scene `number` of a seed is the same however many are drawn. Lengths in mm, forces in N/mm, voltages in V. The
ranges are those of coarse fingers: any size, smooth and ridged, ready-made meshes, all surfaces, friction
from 0 to 1.5, insulators of 5 um to 0.5 mm below 60 V/um and 3000 V. Sizes follow the finger's: `scale` is
its width over that of Table 2. One scene in ten has a finger in three dimensions: smooth coarse tips in few
steps, in any direction over flat faces and long waves along x, z and askew.
"""

from copy import deepcopy

from .attractions import (
    LOCAL,
    SPARKS,
    add_breakdown,
    add_distribution,
    add_drive,
    add_field,
    add_roughness,
    add_voltage,
    electrostatics,
)
from .bodies import LAYERS, TABLE_2_WIDTH, finger, width
from .grounds import add_both_ways, add_friction_law, surface
from .parts import MEMORIES, OUTLINES, PARTS, WISHES, add_memory, add_outline, add_parts, add_wish
from .tables import Draw, Tables, six_digits

#: share of the scenes whose finger has three dimensions, and the random numbers that these are drawn with
SHARE, SOLID = 0.1, 3


def draw(seed: int, number: int) -> Tables:
    """The tables of scene `number` of a seed."""
    other = Draw(seed, number, SOLID)
    if other.chance(SHARE):
        return _latest(seed, number, draw_solid(other))
    random = Draw(seed, number)
    tables: Tables = {"version": 1, "finger": finger(random)}
    charged = random.chance(0.7)
    tables["surface"] = surface(random, tables["finger"])
    if charged:
        tables["electrostatics"] = electrostatics(random)
    tables["solver"] = _solver(random, tables)
    tables["motion"] = _motions(random, tables)
    add_voltage(random, tables)
    if random.chance(0.1):
        precision = random.one_of("single", "double")
        tables["output"] = {"every": random.whole(1, 5), "precision": precision, "compression": True}
    add_roughness(random, tables)
    add_friction_law(random, tables)
    _add_hand(random, tables)
    add_drive(random, tables)
    add_field(random, tables)
    _add_path(other, tables)
    add_parts(Draw(seed, number, PARTS), tables)
    add_wish(Draw(seed, number, WISHES), tables)
    return deepcopy(_latest(seed, number, tables))


def _latest(seed: int, number: int, tables: Tables) -> Tables:
    """What came in last, in the plane and in space, each drawn with random numbers of its own."""
    add_distribution(Draw(seed, number, LOCAL), tables)
    add_memory(Draw(seed, number, MEMORIES), tables)
    add_breakdown(Draw(seed, number, SPARKS), tables)
    return add_outline(Draw(seed, number, OUTLINES), tables)


def _add_path(random: Draw, tables: Tables) -> None:
    """Perhaps parts as long as the error of the path allows."""
    if random.chance(0.05):
        strategy = tables["solver"].setdefault("strategy", {})
        strategy |= {"steps": "auto", "path_error": random.spread(1e-3, 0.1)}


def _add_hand(random: Draw, tables: Tables) -> None:
    """Perhaps a hand; it knows of time only where all slides do."""
    if not random.chance(0.12):
        return
    hand: Tables = {"stiffness": random.spread(0.02, 10.0)}
    if all("speed" in motion for motion in tables["motion"] if motion["kind"] == "slide"):
        hand |= {"damping": random.spread(1e-6, 1e-3), "mass": random.spread(1e-9, 1e-6)}
    tables["hand"] = hand


def _solver(random: Draw, tables: Tables) -> Tables:
    solver: Tables = {}
    if random.chance(0.4):
        triangles = "triangles" in tables["finger"].get("mesh", "")
        solver["element"] = "p2" if triangles else random.one_of("q1", "q1_fbar", "q2", "q2p1")
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
    if random.chance(0.05):
        solver["threads"] = 2
    if random.chance(0.05):
        solver["strategy"] = _strategy(random)
    return solver


def _strategy(random: Draw) -> Tables:
    """Trying as hard as usual, or harder."""
    return {
        "iterations": random.whole(40, 60),
        "patience": random.between(2.0, 20.0),
        "smallest_part": random.one_of(1.0 / 1024.0, 1.0 / 4096.0),
        "easy": random.whole(4, 12),
        "growth": random.between(1.1, 2.0),
        "reach": random.between(0.0, 1.5),
    }


# -- motions and voltage


def _motions(random: Draw, tables: Tables) -> list[Tables]:
    """Perhaps hovering first, a press, then slides, ramps and further presses in any order."""
    scale, charged = width(tables["finger"]) / TABLE_2_WIDTH, "electrostatics" in tables
    dynamic = tables["solver"].get("dynamics", "quasistatic") != "quasistatic"
    motions: list[Tables] = []
    if random.chance(0.25):
        motions.append({"kind": "hover", "gap": random.spread(0.01, 1.0), "steps": random.whole(1, 4)})
        if charged and random.chance(0.4):
            motions.append({"kind": "voltage", "steps": random.whole(1, 10)})
    motions.append(_press(random, scale, dynamic))
    for _ in range(random.whole(1, 3)):
        ramp = "voltage" if charged else "slide"
        kind = random.one_of("slide", "slide", "slide", "slide", ramp, "press", "hover", "wait")
        if kind == "slide":
            motions.append(_slide(random, scale, dynamic))
        elif kind == "voltage":
            motions.append({"kind": "voltage", "steps": random.whole(1, 10)} | _hold(random))
        elif kind == "wait":
            wait = {"kind": "wait", "duration": random.spread(1e-3, 0.3), "steps": random.whole(2, 20)}
            motions.append(wait | _hold(random))
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


# -- fingers in three dimensions


def draw_solid(random: Draw) -> Tables:
    """The tables of a scene with a finger in three dimensions."""
    finger = _tip(random)
    tables: Tables = {"version": 1, "finger": finger, "surface": _tip_surface(random), "solver": {}}
    if random.chance(0.6):
        tables["electrostatics"] = electrostatics(random)
        if random.chance(0.2):
            tables["electrostatics"]["roughness_gap"] = random.spread(2e-4, 0.01)
    if random.chance(0.3):
        tables["solver"]["dynamics"] = random.one_of("viscous", "inertial")
        finger["viscosity"] = random.spread(1e-4, 2e-2)
    tables["motion"] = _tip_motions(random, tables)
    add_voltage(random, tables)
    if random.chance(0.6):
        add_both_ways(random, tables["surface"])
        add_roughness(random, tables)
        add_friction_law(random, tables)
        _add_hand(random, tables)
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


def _tip_surface(random: Draw) -> Tables:
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


def _tip_motions(random: Draw, tables: Tables) -> list[Tables]:
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

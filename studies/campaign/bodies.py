"""Fingers drawn at random: sizes, layers, ridges, materials, participants, and ready-made meshes."""

import numpy as np

from .tables import Draw, Tables, six_digits

TABLE_2_WIDTH = 16.68
#: layers of the pad: default thickness (mm) and modulus (MPa) of Table 2
LAYERS = {
    "stratum_corneum": (0.38, 1.0),
    "epidermis": (0.47, 0.136),
    "dermis": (1.0, 0.080),
    "hypodermis": (None, 0.034),
}
PARTICIPANTS = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi")
#: ready-made meshes with their regions and moduli (MPa)
MESHES = {
    "benchmark-L0.vtu": {"tissue": 0.05, "skin": 1.0},
    "benchmark-L0-triangles.msh": {"tissue": 0.05, "skin": 1.0},
    "finger-coarse-smooth.vtu": {name: E for name, (_, E) in LAYERS.items()} | {"nail": 17.0},
}


def finger(random: Draw) -> Tables:
    """The table [finger]."""
    kind = random.one_of(*["own"] * 17, "participant", "mesh", "mesh")
    table = {"own": _sized, "participant": _participant, "mesh": _meshed}[kind](random)
    if random.chance(0.2):
        thickness = random.between(0.2, 0.6)
        table["electrical"] = {"stratum_corneum_thickness": thickness}
        table["electrical"]["stratum_corneum_eps_r"] = random.spread(10.0, 3000.0)
    elif "benchmark" in table.get("mesh", ""):
        table["electrical"] = {"stratum_corneum_thickness": 0.38}
    return table


def width(table: Tables) -> float:
    """Width (mm) of a finger; where it is not drawn, that of Table 2."""
    return table.get("width", TABLE_2_WIDTH)


def _sized(random: Draw) -> Tables:
    wide = random.between(12.0, 24.0) if random.chance(0.7) else TABLE_2_WIDTH
    height = six_digits(np.clip(wide * random.between(0.7, 1.05), 9.0, 20.0))
    table: Tables = {"resolution": "coarse", "width": wide, "height": height}
    layers = {name: thick for name, (thick, _) in LAYERS.items() if thick is not None}
    if random.chance(0.3):
        layers = {name: six_digits(thick * random.between(0.7, 1.02)) for name, thick in layers.items()}
        table |= {f"{name}_thickness": thick for name, thick in layers.items()}
        table["nail_thickness"] = random.between(0.4, 0.49)
    table |= _bone(wide, height, sum(layers.values()))
    table["ridges"] = random.chance(0.5)
    if table["ridges"]:
        table |= _ridges(random, wide, layers["stratum_corneum"])
    if random.chance(0.3):
        table["materials"] = _materials(random)
    return table


def _bone(wide: float, height: float, layers: float) -> Tables:
    """A bone that leaves half a millimetre to the dermis, and a nail that fits."""
    offset = six_digits(0.05 * (height - 6.0))
    free = height - 2.0 * (layers + 0.5 + offset)
    return {
        "bone_height": six_digits(min(0.39 * height, free)),
        "bone_width": six_digits(min(0.36 * wide, 2.0 * free)),
        "bone_offset": offset,
        "nail_width": six_digits(0.65 * wide),
    }


def _ridges(random: Draw, wide: float, skin: float) -> Tables:
    """Ridges up to 0.3 of their pitch high that leave 0.3 of the `skin` (mm), with walls to be meshed."""
    pitch = random.between(0.3, min(0.8, 0.045 * wide))
    table: Tables = {"ridge_width": pitch, "ridge_phase": random.between(-1.0, 1.0)}
    exponent = random.between(2.0, 8.0)
    table["ridge_exponent"] = exponent
    if exponent > 7.0:  # no draw of its own: the scenes of a seed stay what they are
        table["cells_per_ridge"] = 16
    # the slope of the wall is at most about 2 exponent height / pitch
    steepest = min(0.3 * pitch, 0.25, 2.0 * pitch / exponent)
    if random.chance(0.15):  # flat crests and grooves leave less to the wall
        crest, groove = random.between(0.0, 0.4), random.between(0.0, 0.3)
        table |= {"ridge_crest": crest, "ridge_groove": groove}
        steepest *= 0.7 * (1.0 - crest - groove)
    table["ridge_height"] = random.between(0.02, min(max(0.021, steepest), 0.699 * skin))
    return table


def _participant(random: Draw) -> Tables:
    return {"resolution": "coarse", "participant": random.one_of(*PARTICIPANTS)}


def _meshed(random: Draw) -> Tables:
    """A mesh beside the scene file, its regions by their numbers where the file has no names."""
    name = random.one_of(*MESHES)
    materials = {
        region: _law(random, six_digits(E * random.spread(0.7, 1.5)), 0.48 if E < 0.1 else 0.3)
        for region, E in MESHES[name].items()
    }
    table: Tables = {"mesh": name, "materials": materials}
    if name == "benchmark-L0.vtu" and random.chance(0.5):
        table["regions"] = {"tissue": 0, "skin": 1}
    return table


def _materials(random: Draw) -> Tables:
    """Some layers of another law or other moduli than in Table 2."""
    materials: Tables = {}
    for name, (_, E) in LAYERS.items():
        if not random.chance(0.6):
            continue
        E = six_digits(E * random.spread(0.5, 2.0))
        if random.chance(0.1):
            materials[name] = {"E": E}
            continue
        soft = name in ("hypodermis", "dermis")
        materials[name] = _law(random, E, random.one_of(0.3, 0.45, 0.48, 0.49, 0.495) if soft else 0.3)
    if random.chance(0.3):
        materials["nail"] = {"law": "linear_elastic", "E": random.between(5.0, 30.0), "nu": 0.3}
    return materials


def _law(random: Draw, E: float, nu: float) -> Tables:
    mu = six_digits(E / (2.0 * (1.0 + nu)))
    law = random.one_of("neo_hookean", "neo_hookean", "yeoh", "ogden")
    table: Tables = {"law": law, "E": E, "nu": nu}
    if law == "yeoh":
        table = {"law": law, "c1": 0.5 * mu, "c2": six_digits(0.05 * mu), "nu": nu}
    if law == "ogden":
        table = {"law": law, "mu": mu, "alpha": random.one_of(2.0, 4.0, 8.0), "nu": nu}
    if random.chance(0.1):
        table |= {"viscosity": random.spread(1e-4, 2e-2), "density": random.spread(5e-10, 2e-9)}
    return table

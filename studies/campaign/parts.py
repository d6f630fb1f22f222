"""Tissue that relaxes, probes, surfaces that give way, adhesion, friction that a voltage shall make or that
slip renews, what is beside a charge and flatter fingers, added to scenes that are drawn.

They have random numbers of their own: the rest of a scene is what it is without them.
"""

from .attractions import largest_voltage
from .tables import Draw, Tables, six_digits

#: the random numbers of these parts, of wishes, of outlines and of friction that remembers; the flattest
#: outline, which all drawn skins fit
PARTS, WISHES, OUTLINES, MEMORIES = 4, 5, 6, 7
FLATTEST = 2.9


def add_parts(random: Draw, tables: Tables) -> None:
    """Perhaps some of them, where the scene may have them."""
    finger, electric = tables["finger"], tables.get("electrostatics", {})
    if tables["solver"].get("dynamics") and random.chance(0.25):
        finger["relaxation"] = [
            [random.spread(0.1, 1.5), random.spread(1e-3, 1.0)] for _ in range(random.whole(1, 3))
        ]
        finger["bulk_relaxation"] = random.chance(0.2)
    if "mesh" not in finger and random.chance(0.05):
        tables.setdefault("output", {})["probes"] = {"below": {"x": [0.0, 0.3], "at": "epidermis"}}
    if electric.get("field", "local") != "local":
        return
    if random.chance(0.06) and not _sought(tables):
        layer = {"E": random.spread(0.2, 100.0), "nu": random.between(0.2, 0.49)}
        tables["surface"]["elastic"] = layer | {"thickness": random.spread(0.2, 5.0)}
    if random.chance(0.06):
        tables["adhesion"] = _adhesion(random)


def add_wish(random: Draw, tables: Tables) -> None:
    """Perhaps friction that a voltage shall make, from too little to too much; capacity beside a charge."""
    table, kinds = tables.get("electrostatics", {}), {one["kind"] for one in tables["motion"]}
    if table.get("signal", {}).get("kind") in ("charge", "open_circuit") and random.chance(0.5):
        table["signal"]["parallel_capacitance"] = random.spread(1e-5, 1e-2)
    unlike = {"drive", "frequency", "waveform", "gap_conductivity", "field"} & set(table)
    apart = "voltage" in kinds or "hand" in tables or "elastic" in tables["surface"]
    if "voltage" not in table or "slide" not in kinds or unlike or apart or not random.chance(0.3):
        return
    loads = [one["force"] for one in tables["motion"] if "force" in one]
    rubbed = tables["surface"]["friction"] if isinstance(tables["surface"]["friction"], float) else 0.3
    wished = max(rubbed, 0.05) * (loads[0] if loads else 0.05)
    places = random.places(random.whole(1, 4), -3.0, 3.0)
    forces = [six_digits(random.spread(0.5, 4.0) * wished) for _ in places]
    table["voltage"] = {"kind": "follow_force", "position": places, "tangential_force": forces}
    table["voltage"]["largest_voltage"] = six_digits(largest_voltage(table))


def add_outline(random: Draw, tables: Tables) -> Tables:
    """Perhaps a finger flatter than an ellipse."""
    if "mesh" not in tables["finger"] and random.chance(0.08):
        tables["finger"]["outline"] = random.between(2.0, FLATTEST)
    return tables


def add_memory(random: Draw, tables: Tables) -> Tables:
    """The tables, perhaps with friction that follows its law, or a coefficient, over slip, and over a time
    where that law knows of it.
    """
    if not random.chance(0.1):
        return tables
    law = tables["surface"].get("friction_law", {"kind": "coulomb"})
    memory: Tables = {"kind": "slip_memory", "friction": law if random.chance(0.8) else 0.5}
    memory["length"] = random.spread(1e-3, 0.3)
    if law["kind"] in ("rate", "ageing") and random.chance(0.5):
        memory["time"] = random.spread(0.05, 10.0)
    tables["surface"]["friction_law"] = memory
    return tables


def _sought(tables: Tables) -> bool:
    """Whether a voltage is sought, to keep a charge or a gap."""
    kind = tables.get("electrostatics", {}).get("signal", {}).get("kind")
    return kind in ("charge", "open_circuit") or any(
        "gap" in one for one in tables["motion"] if one["kind"] == "voltage"
    )


def _adhesion(random: Draw) -> Tables:
    if random.chance(0.5):
        return {"law": "dugdale", "stress": random.spread(1e-3, 0.05), "reach": random.spread(2e-3, 0.05)}
    film, angle = random.spread(5e-4, 0.01), random.between(0.0, 80.0)
    tension = random.between(0.02, 0.08)
    return {"law": "capillary", "surface_tension": tension, "contact_angle": angle, "film": film}

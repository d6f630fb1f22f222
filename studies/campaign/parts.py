"""Tissue that relaxes, probes, surfaces that give way and adhesion, added to scenes that are drawn.

They have random numbers of their own: the rest of a scene is what it is without them.
"""

from .tables import Draw, Tables

#: the random numbers of these parts
PARTS = 4


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

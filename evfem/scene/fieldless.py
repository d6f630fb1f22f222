"""Which scenes have no full field, and why; `scene` is a `Scene`, which uses this file itself."""

from __future__ import annotations

from typing import Any

from evfem.electrostatics.drive import spectrum


def without_field(scene: Any) -> tuple[str, str] | None:
    """What of a scene goes with no Poisson problem, and what would; None where all of it does.

    - Kaczmarek's layers stretch when the gap opens: its force is no stress of the field between the
      layers as they are, and no limit of one. Nor are laws of one's own.
    - Without an air layer the force of nodes that do not touch is dropped; in the field they are
      pulled through the same air, and what remained would be the force of no body.
    - Resolved in time, charges are those of a node's own column, and would have to spread.
    - A direct part of a voltage at rest has the field of the conductivities.
    """
    if scene.law is None:
        return "no law", "StrongTroxel and a voltage"
    if not getattr(scene.law, "of_a_field", False):
        allowed = "StrongTroxel: of rigid layers alone the force is that of a field"
        return type(scene.law).__name__, allowed
    if not scene.air_layer:
        return "air_layer = false", "air_layer = true: the field pulls through the air beside the contact too"
    if scene.drive is None:
        return None
    if scene.drive.resolved:
        return "a resolved drive", 'drive = "mean": charges are resolved column by column'
    if spectrum(scene.drive, scene.voltage)[0][0] == 0.0:
        return "a voltage with a direct part", "a voltage whose mean over the cycle is 0"
    return None

"""Units of a sweep's table: they follow its scenes.

Outputs of scenes with a depth are over that depth, in N, mm2 and mJ, as in `Result.total`; those of
a finger in three dimensions are so at once; others are per mm of depth. A table has one unit for
each column, so scenes of both kinds do not go into one sweep.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from evfem.errors import InputError, quoted
from evfem.finger.fingerpad import MeshedFinger
from evfem.finger.fingertip import Fingertip
from evfem.scene.scene import Scene
from evfem.simulation.history import SPATIAL, SPATIAL_UNITS, UNITS, WHOLE_UNITS

Units = Mapping[str, str]
#: what a plane finger with a depth has of the columns in three dimensions
AREAS = ("contact_area", "real_contact_area")
OVER_DEPTH: Units = {**WHOLE_UNITS, **{name: SPATIAL[name]["unit"] for name in AREAS}}


def units_of(scene: Scene) -> Units:
    """Unit of each column of which a sweep of such scenes can have outputs.

    >>> from evfem.scene.scene import default_scene
    >>> units_of(default_scene())["normal_force"]
    'N/mm'
    """
    finger = scene.finger
    if isinstance(finger, Fingertip) or (isinstance(finger, MeshedFinger) and finger.mesh().dim == 3):
        return SPATIAL_UNITS
    return UNITS if scene.depth is None else OVER_DEPTH


def table_units(
    outputs: Sequence[str], parameters: Sequence[str], found: Collection[Units]
) -> dict[str, str]:
    """Unit of each output, and of forces among the parameters, where `found` are the units of the
    scenes, each kind once.

    Raises InputError for an output that not every scene has, or whose unit is not that of all.

    >>> table_units(["normal_force.last"], ["motion.0.force"], [OVER_DEPTH])
    {'normal_force.last': 'N', 'motion.0.force': 'N/mm'}
    >>> table_units(["contact_area.last"], [], [UNITS])
    Traceback (most recent call last):
    evfem.errors.InputError: outputs: given "contact_area.last" of a finger without it; allowed: \
areas where every finger has a depth or is one in three dimensions
    """
    units = {}
    for output in outputs:
        kinds = {one.get(output.split(".")[0]) for one in found}
        if None in kinds:
            allowed = "areas where every finger has a depth or is one in three dimensions"
            raise InputError("outputs", f"{quoted(output)} of a finger without it", allowed)
        if len(kinds) > 1:
            given = f"{output} in {' and '.join(sorted(map(str, kinds)))}"
            raise InputError("finger.depth", given, "a depth for every finger in the plane, or for none")
        units[output] = str(kinds.pop())
    force = "N" if SPATIAL_UNITS in found else "N/mm"
    return units | {key: force for key in parameters if key.endswith(".force")}

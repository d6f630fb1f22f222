"""Columns of the history that the capabilities of the package add, and their attributes of a result."""

from __future__ import annotations

from typing import Any

import numpy as np

from evfem.circuit.load import Air, Load
from evfem.common.arrays import Floats
from evfem.terms.charging import ChargeBooks
from evfem.terms.foundation import ElasticFoundation
from evfem.terms.friction import COEFFICIENTS, ApparentFriction, OverallFriction, of_forces
from evfem.terms.sources import GAP_COLUMNS, ForceSource
from evfem.terms.traction import force_columns

#: by name: a run has those of its scene's rooms
COLUMNS = {
    one.name: one
    for one in (
        *OverallFriction.columns,
        *ApparentFriction.columns,
        *force_columns("adhesive", "adhesion"),
        *ElasticFoundation.columns,
        *ChargeBooks.columns,
        *Load.columns,
        *Air.columns,
        *ForceSource.columns,
        *GAP_COLUMNS,
    )
}


#: columns of which 0 would be a statement
UNKNOWN = ("stick_share", "slip_share")


def without(name: str, row: Any) -> Any:
    """A column of a room in a row, or a whole history, that has not the room: 0, or nan where that would be
    a statement; a coefficient of friction is that of the forces.
    """
    if name in COEFFICIENTS:
        return of_forces(name, row)
    return np.full_like(row["position"], np.nan if name in UNKNOWN else 0.0)[()]


def _of_room(name: str) -> Any:
    """A column as an attribute."""

    def found(result: Any) -> Floats:
        there = result.in_rooms
        return there[name] if name in there else without(name, result)

    unlike = (*COEFFICIENTS, *UNKNOWN)
    return property(found, doc=f"{COLUMNS[name].meaning}{'' if name in unlike else '; 0 without'}")


class OfRooms:
    """These columns as attributes of a result."""

    friction = _of_room("friction")
    stick_share = _of_room("stick_share")
    slip_share = _of_room("slip_share")
    apparent_friction = _of_room("apparent_friction")
    adhesive_force = _of_room("adhesive_force")
    adhesive_force_x = _of_room("adhesive_force_x")
    adhesive_force_z = _of_room("adhesive_force_z")
    adhesive_work = _of_room("adhesive_work")
    surface_sink = _of_room("surface_sink")
    source_work = _of_room("source_work")
    leakage_dissipation = _of_room("leakage_dissipation")
    stretch_work = _of_room("stretch_work")
    field_energy = _of_room("field_energy")
    charge = _of_room("charge")
    current_rms = _of_room("current_rms")
    power = _of_room("power")
    breakdown = _of_room("breakdown")
    breakdown_x = _of_room("breakdown_x")
    missed_force = _of_room("missed_force")
    missed_gap = _of_room("missed_gap")

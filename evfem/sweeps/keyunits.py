"""Units of the dotted keys of a scene file, and values with a unit as numbers of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from evfem.common.units import in_unit
from evfem.scene import schema

#: unit of a force of the plane, which is N of a finger in three dimensions
FORCE = "N/mm"


@cache
def _tables() -> Mapping[str, Mapping[tuple[str, ...], str]]:
    """Key -> the tables that have it, as words, and its unit there."""
    found: dict[str, dict[tuple[str, ...], str]] = {}
    for table in schema.sections():
        for key in table.keys:
            unit = "" if "," in key.unit else key.unit  # of rows of several numbers
            found.setdefault(key.name, {})[tuple(table.name.split("."))] = unit
    return found


def unit_of(key: str, force: str = FORCE) -> str:
    """Unit of a dotted key of a scene file, or of a number in its list, "" for none; `force` that of forces.

    >>> [unit_of(key) for key in ("motion.0.gap", "electrostatics.insulator_thickness.0", "solver.steps")]
    ['mm', 'mm', '']
    >>> unit_of("finger.materials.dermis.E"), unit_of("motion.0.force", "N")
    ('MPa', 'N')
    """
    *table, name = [word for word in key.split(".") if not word.isdigit()] or [""]
    for words, unit in _tables().get(name, {}).items():
        same = len(words) == len(table) and all(
            one in ("NAME", other) for one, other in zip(words, table, strict=True)
        )
        if same:
            return force if unit == FORCE and name.endswith("force") else unit
    return ""


def in_its_unit(where: str, key: str, value: Any) -> Any:
    """A value of this key, or each in a list of them, as a number of its unit where it is a text with one.

    >>> in_its_unit("grid", "motion.0.gap", "250 um"), in_its_unit("grid", "electrostatics.insulator", "film")
    (0.25, 'film')
    """
    if isinstance(value, list):
        return [in_its_unit(where, key, one) for one in value]
    return in_unit(where, value, unit_of(key), "a value of this key")

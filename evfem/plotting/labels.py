"""Names and units of what is drawn, the same in every picture."""

from __future__ import annotations

from typing import Any

from evfem.errors import InputError
from evfem.simulation.result import COLUMNS, UNITS, Result

#: last word of a column's name -> what it is; columns of one kind share an axis
KINDS = {
    "force": "force per depth",
    "width": "width",
    "work": "energy per depth",
    "energy": "energy per depth",
    "dissipation": "energy per depth",
    "pressure": "pressure",
}
#: columns with a name of their own in a picture
TEXTS = {"position": "position of the bone", "seconds": "computing time", "min_gap": "smallest gap"}
#: fields of a frame: unit if it is not MPa, and name where the underscores alone do not make one
FIELD_UNITS = {"displacement": "mm", "gap": "mm", "contact_status": "", "J": ""}
FIELD_TEXTS = {"von_mises": "von Mises stress", "J": "volume ratio J"}
FIELD_TEXTS |= {f"cauchy_stress_{c}": f"Cauchy stress {c}" for c in ("xx", "yy", "zz", "xy")}
#: last word of a key of a scene file -> its unit
KEY_UNITS = dict.fromkeys(("gap", "indentation", "thickness", "height", "width", "distance", "y"), "mm")
KEY_UNITS |= {"force": "N/mm", "voltage": "V", "amplitude": "V", "bias": "V", "E": "MPa", "mu": "MPa"}
KEY_UNITS |= {"speed": "mm/s", "viscosity": "s", "duration": "s", "frequency": "Hz"}


def with_unit(text: str, unit: str) -> str:
    """Text and unit of an axis.

    >>> with_unit("force", "N"), with_unit("step", "")
    ('force (N)', 'step')
    """
    return f"{text} ({unit})" if unit else text


def column_text(name: str) -> str:
    """A column in words, without its unit.

    >>> column_text("normal_force"), column_text("position")
    ('normal force', 'position of the bone')
    """
    return TEXTS.get(name, name.replace("_", " "))


def kind_of(name: str) -> tuple[str, str]:
    """Kind and unit of a column.

    >>> kind_of("electrostatic_force_x"), kind_of("contact_width"), kind_of("substeps")
    (('force per depth', 'N/mm'), ('width', 'mm'), ('substeps', ''))
    """
    word = name.removesuffix("_x").rsplit("_", 1)[-1]
    return KINDS.get(word, column_text(name)), UNITS[name]


def column_label(name: str) -> str:
    """A column with its unit, for an axis of its own.

    >>> column_label("min_gap"), column_label("step")
    ('smallest gap (mm)', 'step')
    """
    return with_unit(column_text(name), UNITS[name])


def axis_label(name: str) -> str:
    """The kind of a column with its unit, for an axis that it shares.

    >>> axis_label("stored_energy")
    'energy per depth (N)'
    """
    return with_unit(*kind_of(name))


def field_label(field: str) -> str:
    """A field of a frame with its unit.

    >>> field_label("von_mises"), field_label("contact_pressure")
    ('von Mises stress (MPa)', 'contact pressure (MPa)')
    """
    return with_unit(FIELD_TEXTS.get(field, field.replace("_", " ")), FIELD_UNITS.get(field, "MPa"))


def key_label(key: str) -> str:
    """A dotted key of a scene file, or an output of a sweep, with its unit.

    >>> key_label("motion.0.gap"), key_label("finger.materials.dermis.E")
    ('gap (mm)', 'dermis E (MPa)')
    >>> key_label("electrostatic_force.last"), key_label("surface.friction")
    ('electrostatic force, last (N/mm)', 'friction')
    """
    parts = key.split(".")
    if parts[0] in COLUMNS and parts[0] != "motion":
        return with_unit(", ".join([column_text(parts[0]), *parts[1:]]), UNITS[parts[0]])
    short = len(parts) > 1 and len(parts[-1]) <= 2
    text = " ".join(parts[-2:] if short else parts[-1:]).replace("_", " ")
    return with_unit(text, KEY_UNITS.get(parts[-1].rsplit("_", 1)[-1], ""))


def values_of(result: Result, name: str) -> Any:
    """A column of the history (steps,).

    Raises InputError for what is no column of numbers.
    """
    names = [column for column in COLUMNS if column != "motion"]
    if name not in names:
        raise InputError("column", name, " | ".join(names))
    return getattr(result, name)

"""Names and units of what is drawn, the same in every picture.

The last word of a column's name says what it is: every `..._force` is in N/mm, every `..._width`
in mm. A depth turns these into N and mm².
"""

from __future__ import annotations

from typing import Any

from evfem.errors import InputError
from evfem.simulation.result import COLUMNS, Result

#: last word of a column's name -> kind of quantity, its unit per mm of depth, its unit for a depth
KINDS = {
    "force": ("force", "N/mm", "N"),
    "width": ("width", "mm", "mm²"),
    "work": ("energy", "N mm/mm", "mJ"),
    "energy": ("energy", "N mm/mm", "mJ"),
    "dissipation": ("energy", "N mm/mm", "mJ"),
    "pressure": ("pressure", "MPa", "MPa"),
    "gap": ("gap", "mm", "mm"),
    "position": ("position of the bone", "mm", "mm"),
    "indentation": ("indentation", "mm", "mm"),
    "time": ("time", "s", "s"),
    "voltage": ("voltage", "V", "V"),
    "seconds": ("computing time", "s", "s"),
}
#: columns with a name of their own in a picture
TEXTS = {"position": "position of the bone", "seconds": "computing time"}
#: fields of a frame: unit, and name where the underscores alone do not make one
FIELD_UNITS = {"displacement": "mm", "gap": "mm", "contact_status": "", "J": ""}
FIELD_TEXTS = {"von_mises": "von Mises stress", "J": "volume ratio J"}
FIELD_TEXTS |= {f"cauchy_stress_{c}": f"Cauchy stress {c}" for c in ("xx", "yy", "zz", "xy")}
#: last word of a key of a scene file -> its unit, beside those of the columns
KEY_UNITS = {"thickness": "mm", "height": "mm", "distance": "mm", "y": "mm", "E": "MPa", "mu": "MPa"}
KEY_UNITS |= {"speed": "mm/s", "viscosity": "s", "frequency": "Hz", "duration": "s", "amplitude": "V"}


def column_text(name: str) -> str:
    """A column in words, without its unit.

    >>> column_text("normal_force"), column_text("position")
    ('normal force', 'position of the bone')
    """
    return TEXTS.get(name, name.replace("_", " "))


def kind_of(name: str, total: bool = False) -> tuple[str, str]:
    """Kind and unit of a column; columns of one kind share an axis.

    >>> kind_of("tangential_force"), kind_of("contact_width", total=True), kind_of("substeps")
    (('force per depth', 'N/mm'), ('area', 'mm²'), ('substeps', ''))
    """
    word = name.removesuffix("_x").rsplit("_", 1)[-1]
    kind, unit, whole = KINDS.get(word, (column_text(name), "", ""))
    if total:
        return ("area" if unit == "mm" and whole == "mm²" else kind), whole
    return (f"{kind} per depth" if unit == "N/mm" else kind), unit


def with_unit(text: str, unit: str) -> str:
    """Text and unit of an axis.

    >>> with_unit("force", "N"), with_unit("step", "")
    ('force (N)', 'step')
    """
    return f"{text} ({unit})" if unit else text


def column_label(name: str, total: bool = False) -> str:
    """A column with its unit, for an axis of its own.

    >>> column_label("min_gap"), column_label("step")
    ('min gap (mm)', 'step')
    """
    text = column_text(name)
    if total:
        text = text.replace("width", "area")
    return with_unit(text, kind_of(name, total)[1])


def axis_label(name: str, total: bool = False) -> str:
    """The kind of a column with its unit, for an axis that it shares."""
    return with_unit(*kind_of(name, total))


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
        return with_unit(", ".join([column_text(parts[0]), *parts[1:]]), kind_of(parts[0])[1])
    word = parts[-1].rsplit("_", 1)[-1]
    unit = KEY_UNITS.get(word, KINDS.get(word, ("", "", ""))[1])
    short = len(parts) > 1 and len(parts[-1]) <= 2
    return with_unit(" ".join(parts[-2:] if short else parts[-1:]).replace("_", " "), unit)


def values_of(result: Result, name: str, total: bool = False) -> Any:
    """A column of the history (steps,).

    Raises InputError for what is no column of numbers.
    """
    names = [column for column in COLUMNS if column != "motion"]
    if name not in names:
        raise InputError("column", name, " | ".join(names))
    return getattr(result, name)

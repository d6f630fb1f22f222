"""Names and units of what is drawn, the same in every picture.

`units` are those of a result: per mm of depth, or over a whole depth (`Result.total`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

from evfem.errors import InputError, quoted
from evfem.simulation.history import COLUMNS, SPATIAL, UNITS
from evfem.simulation.result import FIELD_UNITS, Result
from evfem.sweeps.table import unit_of

Units = Mapping[str, str]
Results = Result | Mapping[str, Result]

#: last word of a column's name -> what it is; columns of one kind share an axis
KINDS = {
    "force": "force",
    "width": "width",
    "area": "area",
    "work": "energy",
    "energy": "energy",
    "dissipation": "energy",
    "pressure": "pressure",
}
#: columns with a name of their own in a picture
TEXTS = {
    "position": "position of the bone",
    "position_z": "z of the bone",
    "seconds": "computing time",
    "min_gap": "smallest gap",
}
#: letters beside a panel of two inches
LINE = 20
#: fields of a frame: name where the underscores alone do not make one
FIELD_TEXTS = {"von_mises": "von Mises stress", "J": "volume ratio J"}
FIELD_TEXTS |= {f"cauchy_stress_{c}": f"Cauchy stress {c}" for c in ("xx", "yy", "zz", "xy")}
#: quantity of a probe -> its unit if it is not MPa
QUANTITY_UNITS = dict.fromkeys(("deformation_gradient", "green_strain", "principal_stretches", "J"), "")
QUANTITY_UNITS |= {"displacement": "mm", "strain_energy_density": "N/mm2", "branch_energy_density": "N/mm2"}


def with_unit(text: str, unit: str) -> str:
    """Text and unit of an axis.

    >>> with_unit("area", "mm2"), with_unit("step", "")
    ('area (mm²)', 'step')
    """
    return f"{text} ({unit.replace('mm2', 'mm²')})" if unit else text


def column_text(name: str, unit: str = "") -> str:
    """A column in words, without its unit: a width over a whole depth is an area.

    >>> column_text("normal_force"), column_text("contact_width", "mm2")
    ('normal force', 'contact area')
    """
    text = TEXTS.get(name, name.replace("_", " "))
    return text.replace("width", "area") if unit == "mm2" else text


def kind_of(name: str, units: Units = UNITS) -> tuple[str, str]:
    """Kind and unit of a column.

    >>> kind_of("electrostatic_force_x"), kind_of("contact_width"), kind_of("substeps")
    (('force per depth', 'N/mm'), ('width', 'mm'), ('substeps', ''))
    >>> from evfem.simulation.history import WHOLE_UNITS
    >>> kind_of("stored_energy", WHOLE_UNITS), kind_of("contact_width", WHOLE_UNITS)
    (('energy', 'mJ'), ('area', 'mm2'))
    """
    unit = units[name]
    kind = KINDS.get(name.removesuffix("_x").removesuffix("_z").rsplit("_", 1)[-1])
    if kind is None:
        return column_text(name, unit), unit
    if kind in ("force", "energy") and unit == UNITS.get(name):
        kind = f"{kind} per depth"
    return column_text(kind, unit), unit


def column_label(name: str, units: Units = UNITS) -> str:
    """A column with its unit, for an axis of its own.

    >>> from evfem.simulation.history import WHOLE_UNITS
    >>> column_label("min_gap"), column_label("step"), column_label("real_contact_width", WHOLE_UNITS)
    ('smallest gap (mm)', 'step', 'real contact area (mm²)')
    """
    return with_unit(column_text(name, units[name]), units[name])


def axis_label(name: str, units: Units = UNITS) -> str:
    """The kind of a column with its unit, for an axis that it shares.

    >>> from evfem.simulation.history import WHOLE_UNITS
    >>> axis_label("normal_force"), axis_label("normal_force", WHOLE_UNITS)
    ('force per depth (N/mm)', 'force (N)')
    """
    return with_unit(*kind_of(name, units))


def on_lines(label: str) -> str:
    """A label beside a low panel, on lines that are no longer than the panel is high.

    >>> on_lines("electrostatic force (N/mm)").split(chr(10)), on_lines("voltage (V)")
    (['electrostatic force', '(N/mm)'], 'voltage (V)')
    """
    return textwrap.fill(label, LINE, break_long_words=False, break_on_hyphens=False)


def field_label(field: str) -> str:
    """A field of a frame with its unit.

    >>> field_label("von_mises"), field_label("contact_pressure")
    ('von Mises stress (MPa)', 'contact pressure (MPa)')
    """
    return with_unit(FIELD_TEXTS.get(field, field.replace("_", " ")), FIELD_UNITS.get(field, "MPa"))


def quantity_label(name: str) -> str:
    """A quantity of a probe, or a component of it, with its unit.

    >>> quantity_label("cauchy_stress_yy"), quantity_label("J"), quantity_label("displacement_x")
    ('Cauchy stress yy (MPa)', 'volume ratio J', 'displacement x (mm)')
    """
    quantity = next((one for one in QUANTITY_UNITS if name.startswith(one)), "")
    text = FIELD_TEXTS.get(name, name.replace("_", " ").replace("cauchy", "Cauchy").replace("green", "Green"))
    return with_unit(text, QUANTITY_UNITS.get(quantity, "MPa"))


def _computed(key: str) -> bool:
    """Whether a column of a sweep is an output: one of a motion's keys is called as a column is."""
    name = key.split(".")[0]
    return name in (*COLUMNS, *SPATIAL) and name != "motion"


def key_unit(key: str, units: Units = UNITS) -> str:
    """Unit of a column of a sweep, which says its `units`."""
    usual = UNITS.get(key.split(".")[0], "") if _computed(key) else unit_of(key)
    return units.get(key) or usual


def key_label(key: str, units: Units = UNITS) -> str:
    """A dotted key of a scene file, or an output of a sweep, with its unit; `units` are those that
    the sweep says.

    >>> key_label("motion.0.gap"), key_label("finger.materials.dermis.E")
    ('gap (mm)', 'dermis E (MPa)')
    >>> key_label("electrostatic_force.last"), key_label("surface.friction")
    ('electrostatic force, last (N/mm)', 'friction')
    >>> key_label("contact_width.max", {"contact_width.max": "mm2"})
    'contact area, max (mm²)'
    """
    parts, unit = key.split("."), key_unit(key, units)
    if _computed(key):
        return with_unit(", ".join([column_text(parts[0], unit), *parts[1:]]), unit)
    short = len(parts) > 1 and len(parts[-1]) <= 2
    text = " ".join(parts[-2:] if short else parts[-1:]).replace("_", " ")
    return with_unit(text, unit)


def values_of(result: Result, name: str) -> Any:
    """A column of the history (steps,); InputError for what is no column of numbers."""
    names = [column for column in result.columns if column != "motion"]
    if name not in names:
        raise InputError("column", quoted(name), " | ".join(names))
    return result[name]


def named(results: Results) -> dict[str, Result]:
    """Results by their names; one alone has none."""
    found = {"": results} if isinstance(results, Result) else dict(results)
    if not found:
        raise InputError("results", "nothing", "a result, or {name: result, ...}")
    if any(result.units != units_of(found) for result in found.values()):
        raise InputError("results", "some per mm of depth, some in total", "all of them alike")
    return found


def units_of(found: Mapping[str, Result]) -> Units:
    """The units that all of these results have."""
    return next(iter(found.values())).units

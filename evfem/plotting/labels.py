"""Names and units of what is drawn, the same in every picture.

`units` are those of a result: per mm of depth, or over a whole depth (`Result.total`).
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from evfem.common.checks import choice
from evfem.errors import InputError
from evfem.scene import probes
from evfem.simulation.history import COLUMNS, ROOM_COLUMNS, SPATIAL, UNITS
from evfem.simulation.result import FIELD_UNITS, Result
from evfem.sweeps.keyunits import unit_of

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
#: unit of a field of a frame, or a quantity of a probe, if it is not MPa
OTHER_UNITS = {**FIELD_UNITS, **probes.UNITS}


def with_unit(text: str, unit: str) -> str:
    """Text and unit of an axis."""
    return f"{text} ({unit.replace('mm2', 'mm²')})" if unit else text


def column_text(name: str, unit: str = "") -> str:
    """A column in words, without its unit: a width over a whole depth is an area."""
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
    """A column with its unit, for an axis of its own; in space a position is the x of the bone alone."""
    text = "x of the bone" if name == "position" and "position_z" in units else column_text(name, units[name])
    return with_unit(text, units[name])


def axis_label(name: str, units: Units = UNITS) -> str:
    """The kind of a column with its unit, for an axis that it shares."""
    return with_unit(*kind_of(name, units))


def on_lines(label: str) -> str:
    """A label beside a low panel, on lines that are no longer than the panel is high."""
    return textwrap.fill(label, LINE, break_long_words=False, break_on_hyphens=False)


def shown_in(unit: str, *values: Any) -> tuple[str, float]:
    """Unit that values of a unit are drawn in, and what they are multiplied by: stresses below 1 MPa
    throughout, as those of soft bodies, are in kPa.

    >>> shown_in("MPa", [0.03, -0.2]), shown_in("MPa", [0.03], [2.0]), shown_in("mm", [0.03])
    (('kPa', 1000.0), ('MPa', 1.0), ('mm', 1.0))
    """
    if unit != "MPa" or any(np.abs(one).max(initial=0.0) >= 1.0 for one in map(np.asarray, values)):
        return unit, 1.0
    return "kPa", 1000.0


def field_unit(name: str) -> str:
    """Unit of a field of a frame, or of a quantity of a probe."""
    return next((unit for one, unit in OTHER_UNITS.items() if name.startswith(one)), "MPa")


def field_label(name: str, unit: str | None = None) -> str:
    """A field of a frame, or a quantity of a probe or a component of it, with its unit, or another one.

    >>> field_label("cauchy_stress_yy"), field_label("J"), field_label("displacement_x")
    ('Cauchy stress yy (MPa)', 'volume ratio J', 'displacement x (mm)')
    >>> field_label("von_mises", "kPa")
    'von Mises stress (kPa)'
    """
    text = name.replace("_", " ").replace("cauchy", "Cauchy").replace("green", "Green")
    text = {"von_mises": "von Mises stress", "J": "volume ratio J"}.get(name, text)
    return with_unit(text, field_unit(name) if unit is None else unit)


def _computed(key: str) -> bool:
    """Whether a column of a sweep is an output: one of a motion's keys is called as a column is."""
    return key.split(".")[0] in {*COLUMNS, *ROOM_COLUMNS, *SPATIAL} - {"motion"}


def key_unit(key: str, units: Units = UNITS) -> str:
    """Unit of a column of a sweep, which says its `units`."""
    return units.get(key) or (UNITS.get(key.split(".")[0], "") if _computed(key) else unit_of(key))


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


def key_texts(keys: Sequence[str]) -> list[str]:
    """Dotted keys in words, without units; as they are where two would have the same words.

    >>> key_texts(["finger.materials.dermis.E", "surface.friction"])
    ['dermis E', 'friction']
    >>> key_texts(["motion.0.force", "motion.1.force"])
    ['motion.0.force', 'motion.1.force']
    """
    texts = [key_label(key).partition(" (")[0] for key in keys]
    return [text if texts.count(text) == 1 else key for key, text in zip(keys, texts, strict=True)]


def values_of(result: Result, name: str) -> Any:
    """A column of the history (steps,); InputError for what is no column of numbers."""
    choice("column", name, [column for column in result.columns if column != "motion"])
    return result[name]


def check_result(given: object) -> None:
    """Raise InputError for what is no result."""
    if not isinstance(given, Result):
        kind = given.__name__ if isinstance(given, type) else type(given).__name__
        raise InputError("result", f"a {kind}", "a result, as ev.simulate(scene) or ev.load(folder) gives it")


def named(results: Results) -> dict[str, Result]:
    """Results by their names; one alone has none."""
    if not isinstance(results, Mapping):
        check_result(results)
    found = dict(results) if isinstance(results, Mapping) else {"": results}
    for result in found.values():
        check_result(result)
    if not found:
        raise InputError("results", "nothing", "a result, or {name: result, ...}")
    if len({result.units["normal_force"] for result in found.values()}) > 1:
        allowed = "all of them alike: result.total is in N"
        raise InputError("results", "some per mm of depth, some in total", allowed)
    return found


def units_of(found: Mapping[str, Result]) -> Units:
    """The units that all of these results have; InputError for a column where they differ, as the width of a
    section over its depth, in mm2, and that of a fingertip.
    """
    first, *others = (result.units for result in found.values())
    return _Alike(
        {name: unit for name, unit in first.items() if all(unit == one.get(name) for one in others)}
    )


def effective(name: str, results: Iterable[Result]) -> str:
    """What stands before a voltage that acts by its mean over the cycle: it is no peak."""
    scenes = (result.simulated for result in results if name == "voltage")
    return "effective " if any(scene is not None and scene.electrics.alternates for scene in scenes) else ""


class _Alike(dict[str, str]):
    """Units by column."""

    def __missing__(self, name: str) -> str:
        raise InputError("column", f"{name}, which these results do not have in one unit", "another column")

"""The history: one row for each requested step, its columns with their units and meanings.

In the plane model forces are per mm of depth (N/mm), works and energies too (N, that is N mm/mm).
Over a whole depth they are N and mJ, and widths are areas in mm2, under the same names. Of a finger
in three dimensions they are N and mJ at once; there are more columns (`SPATIAL`), and no widths. Its
tangential forces are those along the direction of the last slide's angle, +x before the first.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints, Words
from evfem.common.storage import write_text
from evfem.common.tables import csv_text, frame
from evfem.errors import InputError, closest_name, readable
from evfem.terms.columns import COLUMNS as OF_PACKAGE
from evfem.terms.columns import OfRooms, without

Row = Mapping[str, Any]
#: a drift of the load that is worth a word
DRIFT = 0.05
#: solved lengths (mm) and forces (N/mm, N) that differ by less are the same
SAME = 1e-9
#: unit per mm of depth -> unit over a depth
WHOLE_OF = {"N/mm": "N", "N": "mJ", "C/mm": "C", "A/mm": "A", "W/mm": "W"}


def column(unit: str, meaning: str, *traits: str, whole: str | None = None) -> dict[str, Any]:
    """Metadata of a field of `History`: its unit, what it is, its unit over a whole depth, and `traits`. A
    saved result without what is `needed` is none (what an older version did not write yet is else NaN, or 0
    if it counts something); of the last step what is `shown` is printed, and where the finger is.
    """
    return {"unit": unit, "meaning": meaning, "whole": whole or WHOLE_OF.get(unit, unit), "traits": traits}


#: words that people try -> the column that they mean, the first that is there
MEANT = {
    **dict.fromkeys(("mu", "cof", "coefficient", "friction_coefficient"), "friction"),
    "friction": "tangential_force",
    "felt_friction": "apparent_friction",
    **dict.fromkeys(("stick", "sticking", "stuck"), "stick_share"),
    **dict.fromkeys(("slip", "slipping", "sliding"), "slip_share"),
    "gap": "min_gap",
    "friction_force": "tangential_force",
    "shear_force": "tangential_force",
    "force": "applied_force",
    "load": "applied_force",
    "contact_force": "normal_force",
    "attraction": "electrostatic_force",
    "electric_force": "electrostatic_force",
    "pressure": "peak_contact_pressure",
    "area": "contact_area contact_width",
    "depth": "indentation",
    "displacement": "position",
    "x": "position",
}


def no_column(key: str, name: Any, columns: Sequence[str]) -> InputError:
    """The error for a name that is no column, with the one that was meant, by meaning or by letters.

    >>> raise no_column("column", "friction", ["position", "tangential_force"])
    Traceback (most recent call last):
    evfem.errors.InputError: column: given "friction", no column; allowed: tangential_force? (docs/notation)
    """
    word, *statistic = str(name).lower().split(".")
    meant = (".".join((one, *statistic)) for one in MEANT.get(word, "").split())
    close = [one for one in meant if one in columns] or closest_name(str(name), columns)
    known = f"{close[0]}? (docs/notation)" if close else f"{', '.join(columns)}"
    return InputError(key, f"{readable(name)}, no column", known)


class Values(dict[str, Any]):
    """One row by its columns; one of a room of the package that the scene has not is as `without` says."""

    def __missing__(self, name: str) -> float:
        if name in ROOM_COLUMNS:
            return float(without(name, self))
        raise KeyError(name)


@dataclass(frozen=True, eq=False)
class History:
    """Every column of the history as an array over the steps.

    A field is a column: of `COLUMNS`, of rows and `history.csv`, of saved results and checkpoints.
    `EnergyAccount.row` computes its value. Its unit and meaning are in `UNITS` and `MEANINGS`.
    `result["normal_force"]` is `result.normal_force`.
    """

    step: Ints = field(metadata=column("", "number of the step in the run, from 1", "needed"))
    motion_index: Ints = field(metadata=column("", "number of the motion, from 0", "needed"))
    motion: Words = field(metadata=column("", "kind of the motion", "needed"))
    time: Floats = field(metadata=column("s", "at the end of the step", "needed"))
    position: Floats = field(metadata=column("mm", "x of the bone", "needed"))
    indentation: Floats = field(metadata=column("mm", "travel of the bone beyond first touch", "needed"))
    voltage: Floats = field(
        metadata=column("V", "effective; of the moment where it is resolved in time", "needed")
    )
    applied_force: Floats = field(metadata=column("N/mm", "down, on the bone", "needed"))
    applied_tangential_force: Floats = field(
        metadata=column("N/mm", "along +x, in space along the slide's angle, on the bone")
    )
    normal_force: Floats = field(metadata=column("N/mm", "sum of contact forces, upwards", "shown"))
    tangential_force: Floats = field(
        metadata=column("N/mm", "contact, against +x, in space against the slide's angle", "shown")
    )
    electrostatic_force: Floats = field(metadata=column("N/mm", "attraction, downwards", "shown"))
    electrostatic_force_x: Floats = field(metadata=column("N/mm", "x component of the attraction"))
    contact_width: Floats = field(
        metadata=column("mm", "from the first to the last edge of contact", "shown", whole="mm2")
    )
    real_contact_width: Floats = field(
        metadata=column("mm", "sum of what touches, between edges", whole="mm2")
    )
    min_gap: Floats = field(metadata=column("mm", "smallest gap of the deformed pad"))
    peak_contact_pressure: Floats = field(metadata=column("MPa", "largest contact pressure of a node"))
    mean_contact_pressure: Floats = field(metadata=column("MPa", "pressing forces over what touches"))
    external_work: Floats = field(metadata=column("N", "done on the bone, and by forms of your own"))
    electrostatic_work: Floats = field(metadata=column("N", "done by the attraction of a voltage"))
    stored_energy: Floats = field(metadata=column("N", "tissue, elastic surface, hand's spring, penalties"))
    friction_dissipation: Floats = field(metadata=column("N", "by friction"))
    viscous_dissipation: Floats = field(metadata=column("N", "in tissue and the hand's damper"))
    kinetic_energy: Floats = field(metadata=column("N", "of tissue with inertia, and of the hand"))
    integrator_dissipation: Floats = field(metadata=column("N", "by the finite step, of either sign"))
    snap_dissipation: Floats = field(metadata=column("N", "set free where stability was lost"))
    substeps: Ints = field(metadata=column("", "substeps in which the step was solved", "needed"))
    newton_iterations: Ints = field(metadata=column("", "outer iterations of all substeps", "needed"))
    relaxations: Ints = field(metadata=column("", "releases where no equilibrium is near"))
    jumps: Ints = field(metadata=column("", "releases, and snaps that iterations made by themselves"))
    seconds: Floats = field(metadata=column("s", "wall time"))

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns."""
        return COLUMNS

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The history as one dictionary per step, plain Python numbers."""
        columns = [np.asarray(self[name]).tolist() for name in self.columns]
        return [Values(zip(self.columns, values, strict=True)) for values in zip(*columns, strict=True)]

    def __getitem__(self, name: str) -> Any:
        """A column by its name."""
        if name not in self.columns:
            raise no_column("column", name, self.columns)
        return getattr(self, name)

    def table(self) -> Any:
        """The history with a row for each step: a `pandas.DataFrame`, without pandas a numpy record array."""
        return frame({name: np.asarray(self[name]) for name in self.columns})

    def to_csv(self, path: str | Path) -> None:
        """Write the history as `evfem run` does (`history.csv`), whole or not at all."""
        write_text(path, csv_header(self.columns) + "".join(map(csv_line, self.rows)))


COLUMNS = tuple(spec.name for spec in fields(History))
#: what a value of a column is
KINDS: Mapping[str, type] = {
    spec.name: {"Words": str, "Ints": int}.get(str(spec.type), float) for spec in fields(History)
}
INTEGERS = tuple(name for name, kind in KINDS.items() if kind is int)
#: columns to which every substep adds
ADDED = ("_work", "_dissipation")
SUMS = tuple(name for name in COLUMNS if name.endswith(ADDED))
#: columns of the rooms of the package
ROOM_COLUMNS: Mapping[str, Mapping[str, Any]] = {
    name: column(one.unit, one.meaning) for name, one in OF_PACKAGE.items()
}
#: further columns of a finger in three dimensions
SPATIAL: Mapping[str, Mapping[str, Any]] = {
    "position_z": column("mm", "z of the bone"),
    "applied_tangential_force_x": column("N", "along +x, on the bone"),
    "applied_tangential_force_z": column("N", "along +z, on the bone"),
    "tangential_force_x": column("N", "sum of contact forces, against +x"),
    "tangential_force_z": column("N", "sum of contact forces, against +z", "shown"),
    "electrostatic_force_z": column("N", "z component of the attraction"),
    "contact_area": column("mm2", "of the convex hull of what touches", "shown"),
    "real_contact_area": column("mm2", "of all that touches", "shown"),
}
#: what is known of each column, of three dimensions too
ABOUT: Mapping[str, Mapping[str, Any]] = {
    **{spec.name: spec.metadata for spec in fields(History)},
    **ROOM_COLUMNS,
    **SPATIAL,
}
#: columns of every finger, by its dimension
EVERY: Mapping[int, tuple[str, ...]] = {2: COLUMNS, 3: (*COLUMNS, *SPATIAL)}
#: column -> its unit ("" for a number or a word), that over a whole depth, and what it is
UNITS, WHOLE_UNITS, MEANINGS = (
    {name: str(ABOUT[name][told]) for name in (*COLUMNS, *ROOM_COLUMNS)}
    for told in ("unit", "whole", "meaning")
)
#: columns that a finger in three dimensions leaves empty
WIDTHS = tuple(name for name in COLUMNS if WHOLE_UNITS[name] == "mm2")
SPATIAL_UNITS: Mapping[str, str] = {
    **WHOLE_UNITS,
    **dict.fromkeys(WIDTHS, "mm"),
    **{name: about["unit"] for name, about in SPATIAL.items()},
}
NEEDED, SHOWN = (
    tuple(name for name, about in ABOUT.items() if trait in about["traits"]) for trait in ("needed", "shown")
)


def _component(name: str) -> Any:
    """A column of three dimensions as an attribute; in the plane all is along x, and nothing along z."""

    def found(result: Any) -> Floats:
        if name in result.in_space:
            return result.in_space[name]
        return result[name.removesuffix("_x")] if name.endswith("_x") else np.zeros_like(result.position)

    return property(found, doc=f"{SPATIAL[name]['meaning']}; in the plane all is along x")


class FurtherColumns(OfRooms):
    """Columns of three dimensions and of rooms as attributes of a result."""

    position_z = _component("position_z")
    tangential_force_x = _component("tangential_force_x")
    tangential_force_z = _component("tangential_force_z")
    applied_tangential_force_x = _component("applied_tangential_force_x")
    applied_tangential_force_z = _component("applied_tangential_force_z")
    electrostatic_force_z = _component("electrostatic_force_z")


def columns_of(names: Iterable[str]) -> tuple[str, ...]:
    """The columns in their order if all of the plane or of space are among these names, those of rooms last;
    else nothing.
    """
    found = tuple(names)
    base = COLUMNS if set(SPATIAL).isdisjoint(found) else (*COLUMNS, *SPATIAL)
    further = tuple(name for name in found if name not in base)
    whole = set(base) <= set(found) and all(name.isidentifier() for name in further)
    return (*base, *further) if whole else ()


def over_depth(columns: Mapping[str, Any], depth: float) -> dict[str, Any]:
    """Columns, or one row of them, over a whole `depth` (mm): in N, mm2 and mJ.

    >>> over_depth({"normal_force": 0.05, "contact_width": 4.5, "min_gap": 0.1}, 10.0)
    {'normal_force': 0.5, 'contact_width': 45.0, 'min_gap': 0.1}
    """
    return {
        name: value if WHOLE_UNITS.get(name) == UNITS.get(name) else value * depth
        for name, value in columns.items()
    }


def load_drift(rows: Sequence[Row]) -> float:
    """Largest relative change of the load, `applied_force`, since the last press to a positive one,
    in rows that still have its indentation and do not wait, as tissue then relaxes; 0 without such rows.

    >>> held = {"motion": "slide", "indentation": 0.5, "applied_force": 0.06}
    >>> round(load_drift([held | {"motion": "press", "applied_force": 0.05}, held]), 3)
    0.2
    """
    largest, pressed = 0.0, None
    for row in (one for one in rows if one["motion"] != "wait"):
        if row["motion"] in ("press", "hover"):
            pressed = row if row["motion"] == "press" and row["applied_force"] > SAME else None
        elif pressed is not None and abs(row["indentation"] - pressed["indentation"]) <= SAME:
            largest = max(largest, abs(row["applied_force"] / pressed["applied_force"] - 1.0))
    return largest


def csv_line(row: Row) -> str:
    """One row of history.csv with its line end; floats with every digit that counts.

    >>> csv_line(dict.fromkeys(COLUMNS, 0) | {"step": 1, "motion": "press", "voltage": 0.1})[:25]
    '1,0,press,0.0,0.0,0.0,0.1'
    """
    return csv_text([[_plain_value(name, row[name]) for name in columns_of(row)]])


def csv_header(columns: Sequence[str] = COLUMNS) -> str:
    """The first line of history.csv."""
    return csv_text([columns])


def read_rows(text: str) -> list[dict[str, Any]]:
    """The rows of a `history.csv`; a column that an older version did not write yet is nan, or 0 if
    it counts something.

    Raises ValueError for any other text.

    >>> row = dict.fromkeys(COLUMNS, 0.5) | dict.fromkeys(INTEGERS, 1) | {"motion": "press"}
    >>> read_rows(csv_header() + csv_line(row)) == [row]
    True
    """
    found = csv.DictReader(text.splitlines(), strict=True)
    names = found.fieldnames or ()
    columns = COLUMNS if set(SPATIAL).isdisjoint(names) else (*COLUMNS, *SPATIAL)
    further = tuple(name for name in names if name not in columns)
    if not set(NEEDED) <= set(names) or not all(name.isidentifier() for name in further):
        raise ValueError("no history")
    columns = (*columns, *further)
    unknown_yet = {name: "0" if name in INTEGERS else "nan" for name in columns}
    return [
        {name: _value_of(name, row[name]) for name in columns} for row in (unknown_yet | row for row in found)
    ]


def _value_of(name: str, text: str) -> str | int | float:
    kind = KINDS.get(name, float)
    return kind(text or "nan") if kind is float else kind(text)


def _plain_value(name: str, value: Any) -> str | int | float:
    kind = KINDS.get(name, float)
    return "" if kind is float and np.isnan(value) else kind(value)


def column_of(name: str, values: list[Any]) -> Any:
    """A column from its values in the rows."""
    return np.array(values, dtype=KINDS.get(name, float))


#: column of the history -> its head in the table of forces, its width there, and its decimals
HEADS = {
    "position": ("position", 9, 3),
    "indentation": ("indent.", 8, 3),
    "voltage": ("voltage", 8, 0),
    "applied_force": ("applied", 10, 5),
    "normal_force": ("normal", 10, 5),
    "tangential_force": ("tangential", 11, 5),
    "electrostatic_force": ("electrost.", 11, 5),
}


#: rows in the table of forces, about
MOST = 12


def table(rows: Sequence[Row], most: int = MOST, depth: float | None = None) -> str:
    """At most about `most` rows of a history, always the last of each motion, in 80 columns; over
    a whole `depth` (mm), and of a finger in three dimensions, forces are in N.

    >>> row = dict.fromkeys(HEADS, 0.0) | {"step": 1, "motion": "press", "motion_index": 0}
    >>> print(table([row]))
    step motion  position indent. voltage   applied    normal tangential electrost.
                       mm      mm       V      N/mm      N/mm       N/mm       N/mm
       1 press      0.000   0.000       0   0.00000   0.00000    0.00000    0.00000
    """
    units = UNITS if depth is None and not any("contact_area" in row for row in rows) else WHOLE_UNITS
    heads = [head for head, *_ in HEADS.values()]
    lines = [_line("step", "motion", heads), _line("", "", [units[name] for name in HEADS])]
    for row in (rows[i] for i in chosen(rows, most)):
        row = row if depth is None else over_depth(row, depth)
        sizes = HEADS.items()
        numbers = [_number(float(row[name]), digits, width - 1) for name, (_, width, digits) in sizes]
        lines.append(_line(str(row["step"]), str(row["motion"]), numbers))
    return "\n".join(line.rstrip() for line in lines)


def chosen(rows: Sequence[Row], most: int) -> list[int]:
    """Numbers of the rows to show: about equally many of each motion, evenly spaced, with its
    last.

    >>> chosen([{"motion_index": int(i > 3)} for i in range(104)], 6)
    [0, 2, 3, 36, 70, 103]
    """
    index = [row["motion_index"] for row in rows]
    ends = [i + 1 for i in range(len(index)) if i + 1 == len(index) or index[i + 1] != index[i]]
    share = max(most // max(len(ends), 1), 1)
    picked = []
    for start, end in zip([0, *ends], ends, strict=False):
        count = min(share, end - start)
        picked += [start + round((k + 1) * (end - start) / count) - 1 for k in range(count)]
    return picked


def _line(step: str, motion: str, values: Sequence[str]) -> str:
    columns = zip(values, HEADS.values(), strict=True)
    return f"{step:>4} {motion:<7}" + "".join(f"{value:>{width}}" for value, (_, width, _) in columns)


def _number(value: float, digits: int, width: int) -> str:
    """With so many decimals, fewer where the column is too narrow for them, and no sign on what
    rounds to zero.

    >>> _number(-1e-7, 5, 9), _number(-12345.678, 5, 9), _number(-1e12, 5, 9), _number(1.0, 5, 9)
    ('0.00000', '-12345.68', '-1.00e+12', '1.00000')
    """
    for kept in range(digits, -1, -1):
        text = f"{round(value, kept) + 0.0:.{kept}f}"
        if len(text) <= width:
            return text
    return f"{value:.2e}" if width > 8 else f"{value:.0e}"

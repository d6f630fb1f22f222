"""The paper's tables and statements as csv files with units and source, and `load` to read them.

Only what the paper prints as a number is here: points that it merely plots are not.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from typing import Any

from evfem.common.tables import words_or_numbers
from evfem.errors import InputError, describe_value

#: what `load` accepts
NAMES = ("area_laws", "meyer", "others", "table1", "table2", "thresholds")


@dataclass(frozen=True)
class Table:
    """Columns by name (arrays of numbers or lists of words), `units` per column, and where they come from."""

    name: str
    title: str
    source: str
    columns: Mapping[str, Any]
    units: Mapping[str, str]

    def __getitem__(self, column: str) -> Any:
        if column not in self.columns:
            raise InputError(f"column of {self.name}", describe_value(column), ", ".join(self.columns))
        return self.columns[column]

    def value(self, key: str, column: str = "value") -> float:
        """The number in the row whose first column is `key`.

        >>> load("table2").value("d_sc")
        0.38
        """
        keys = next(iter(self.columns.values()))
        if key not in keys:
            raise InputError(f"row of {self.name}", describe_value(key), ", ".join(map(str, keys)))
        return float(self[column][keys.index(key)])


def load(name: str) -> Table:
    """The table `name`, one of `NAMES`.

    >>> table = load("table1")
    >>> table["participant"][0], float(table["HVLD"][0]), table.units["HVLD"]
    ('i', 4.0, 'mN')
    """
    if name not in NAMES:
        raise InputError("data", describe_value(name), ", ".join(NAMES))
    lines = (resources.files(__package__) / f"{name}.csv").read_text(encoding="utf-8").splitlines()
    notes = [line[1:].strip() for line in lines if line.startswith("#")]
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    columns = {key: words_or_numbers([row[i] for row in rows[1:]]) for i, key in enumerate(rows[0])}
    units = _tagged(notes, "units").split(",")
    given = dict(zip(rows[0], units, strict=True)) if len(units) == len(rows[0]) else {}
    return Table(name, notes[0], _tagged(notes, "source"), columns, given)


def _tagged(notes: list[str], tag: str) -> str:
    return next((note.split(":", 1)[1].strip() for note in notes if note.startswith(f"{tag}:")), "")

"""The table of a sweep: a row per point, with units, statistics of its columns, and back from its folder."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.storage import begins, write_text
from evfem.common.tables import csv_rows, dataset, frame
from evfem.errors import InputError, describe_value
from evfem.finger.fingerpad import MeshedFinger
from evfem.finger.fingertip import Fingertip
from evfem.scene.scene import Scene
from evfem.simulation.history import ABOUT, SPATIAL, SPATIAL_UNITS, UNITS, WHOLE_UNITS, no_column
from evfem.sweeps.file import FIRST, LAST, STATISTICS
from evfem.sweeps.folder import PROVENANCE, STATUS, TABLE, cell_of, sweep_csv
from evfem.sweeps.keyunits import unit_of

Units = Mapping[str, str]
#: what a plane finger with a depth has of the columns in three dimensions
AREAS = ("contact_area", "real_contact_area")
OVER_DEPTH: Units = {**WHOLE_UNITS, **{name: SPATIAL[name]["unit"] for name in AREAS}}
#: in a data set, the dimension of samples at each point of a grid, and what it says of a point not computed
SAMPLE, NOT_COMPUTED = "sample", {"status": "missing", "message": "not computed"}


def units_of(scene: Scene) -> Units:
    """Unit of each column of which a sweep of such scenes can have outputs."""
    finger = scene.finger
    if isinstance(finger, Fingertip) or (isinstance(finger, MeshedFinger) and finger.mesh().dim == 3):
        return SPATIAL_UNITS
    return UNITS if scene.depth is None else OVER_DEPTH


def table_units(
    outputs: Sequence[str], parameters: Sequence[str], found: Collection[Units]
) -> dict[str, str]:
    """Unit of each output, and of the parameters that have one, where `found` are the units of the scenes;
    InputError for an output that not every scene has in one unit.
    >>> table_units(["normal_force.last"], ["motion.0.force"], [OVER_DEPTH])
    {'motion.0.force': 'N/mm', 'normal_force.last': 'N'}
    >>> table_units(["contact_area.last"], [], [UNITS])
    Traceback (most recent call last):
    evfem.errors.InputError: outputs: given "contact_area.last" of a finger without it; allowed: \
areas where every finger has a depth or is one in three dimensions
    """
    force = "N" if SPATIAL_UNITS in found else "N/mm"
    units = {key: unit for key in parameters if (unit := unit_of(key, force))}
    for output in outputs:
        kinds = {one.get(output.split(".")[0]) for one in found}
        if None in kinds:
            allowed = "areas where every finger has a depth or is one in three dimensions"
            raise InputError("outputs", f"{describe_value(output)} of a finger without it", allowed)
        if len(kinds) > 1:
            problem = f"{output} in {' and '.join(sorted(map(str, kinds)))}"
            raise InputError("finger.depth", problem, "a depth for every finger in the plane, or for none")
        units[output] = str(kinds.pop())
    return units


@dataclass(frozen=True, eq=False)
class SweepResult:
    """The table of a sweep: `rows` in the order of the points, keys `columns`, and provenance."""

    columns: tuple[str, ...]
    rows: list[dict[str, Any]]
    provenance: dict[str, Any]
    units: Mapping[str, str] = field(default_factory=dict)

    def __getitem__(self, column: str) -> Any:
        """A column (points,): numbers as an array, NaN where there is none, else a list."""
        if column not in self.columns:
            raise no_column("column", column, self.columns)
        values = [row[column] for row in self.rows]
        if all(value is None or type(value) in (int, float) for value in values):
            return array_of(values)
        return values

    def table(self) -> Any:
        """A row for each point: a `pandas.DataFrame`, without pandas a numpy record array."""
        return frame({name: self[name] for name in self.columns})

    def to_xarray(self) -> Any:
        """The table as an `xarray.Dataset` with a dimension for each entry of the grid.

        A key's dimension is called by its last word (`gap` of `motion.0.gap`), or by more of them where two
        keys end alike; named rows are a dimension of their name, along which the keys that change together
        are coordinates. Samples at every point of a grid are the dimension `sample`. Samples alone, and a
        table that is no full grid or has lost its `sweep.json`, have the one dimension `point`.

        Variables have the names of the table: outputs and `seconds`, NaN where there is no number, `status`
        and `message`, which says why. A point that was not computed has the status "missing". Attributes are
        `units` and `long_name`, of a coordinate its dotted key.

        Returns
        -------
        xarray.Dataset
            Its coordinate `point` is the number of the point in the table.

        Raises
        ------
        InputError
            xarray is not installed (the extra `xarray`), or a point stands twice in the table.
        """
        places, axes = [row["point"] for row in self.rows], self._axes
        if len(set(places)) < len(places):
            raise InputError("to_xarray", "a table with a point twice", "one row for each point, or table()")
        dims, shape = [name for name, _, _ in axes], [size for _, size, _ in axes]
        coordinates: dict[str, Any] = {"point": (dims, np.arange(math.prod(shape)).reshape(shape))}
        names = short_names(self._varied)
        for name, _, varied in axes:
            for key, values in varied.items():
                about = {"units": self.units.get(key, ""), "long_name": key}
                coordinates[names[key]] = (name, array_of(values), about)
        variables = {}
        for name in (*self._outputs, *LAST):
            column = [NOT_COMPUTED.get(name)] * math.prod(shape)
            for place, row in zip(places, self.rows, strict=True):
                column[place] = row.get(name)
            variables[name] = (dims, array_of(column).reshape(shape), self._about(name))
        return dataset(variables, coordinates, {"provenance": json.dumps(self.provenance)})

    @property
    def _axes(self) -> list[tuple[str, int, dict[str, list[Any]]]]:
        """Each dimension of the grid: name, size, and by its key the values along it."""
        names, axes = short_names(self._varied), []
        for name, entry in (self.provenance.get("grid") or {}).items():
            varied = {name: list(entry)}
            for row in entry.values() if isinstance(entry, Mapping) else ():
                for key, value in row.items():
                    varied.setdefault(key, []).append(value)
            axes.append((names.get(name, name), len(entry), varied))
        count = max([self.provenance["points"].get("requested", 0), *(row["point"] + 1 for row in self.rows)])
        drawn = (self.provenance.get("samples") or {}).get("count", 1)
        if not axes or math.prod(size for _, size, _ in axes) * drawn != count:
            axes, drawn = [], count
        left = [key for key in self._varied if not any(key in varied for _, _, varied in axes)]
        if left or not axes:
            rows = {row["point"] % drawn: row for row in self.rows}
            found = {key: [rows.get(i, {}).get(key) for i in range(drawn)] for key in left}
            axes.append((SAMPLE if axes else FIRST[0], drawn, found))
        return axes

    def _about(self, name: str) -> dict[str, str]:
        """Attributes of an output, or of one of the last columns, in a data set."""
        column, *of = name.split(".")
        if not of:
            return {"units": "s" if name == "seconds" else "", "long_name": name}
        words = [str(ABOUT[column]["meaning"]), of[0], *(f"motion {motion}" for motion in of[1:])]
        return {"units": self.units.get(name, ""), "long_name": ", ".join(words)}

    @property
    def _outputs(self) -> list[str]:
        """Columns that are computed."""
        return [name for name in self.columns if {*name.split(".")[1:2]} & {*STATISTICS}]

    @property
    def _varied(self) -> list[str]:
        """Names of rows, and keys that are varied."""
        return [name for name in self.columns if name not in (*FIRST, *self._outputs, *LAST)]

    def statistics(
        self, columns: Sequence[str] | None = None, quantiles: Sequence[float] = (0.05, 0.5, 0.95)
    ) -> Any:
        """Of each column of numbers the points that have one, mean, standard deviation and quantiles.

        Parameters
        ----------
        columns
            Names of columns; None: what is varied, and the outputs.
        quantiles
            Shares of the points, 0 to 1, that are below; linear between two points.

        Returns
        -------
        pandas.DataFrame
            A row for each column, in its unit; a numpy record array without pandas. The deviation is that
            of a sample (its squares over one less than the points), and NaN of one point.

        Raises
        ------
        InputError
            A column that is none of numbers, or quantiles outside 0 to 1.

        Examples
        --------
        >>> rows = [{"point": i, "surface.friction": mu} for i, mu in enumerate((0.1, 0.2, 0.6))]
        >>> table = SweepResult(("point", "surface.friction"), rows, {})
        >>> found = table.statistics()
        >>> str(found["column"][0]), [round(float(found[name][0]), 3) for name in ("mean", "deviation")]
        ('surface.friction', [0.3, 0.265])
        """
        if not all(isinstance(q, (int, float)) and 0.0 <= q <= 1.0 for q in quantiles):
            raise InputError("quantiles", quantiles, "numbers from 0 to 1")
        rows: list[dict[str, Any]] = []
        for name in self._numeric if columns is None else columns:
            values = self[name]
            if isinstance(values, list):
                raise InputError(
                    "columns", describe_value(name), f"columns of numbers: {', '.join(self._numeric)}"
                )
            values = values[~np.isnan(values)]
            row: dict[str, Any] = {"column": name, "unit": self.units.get(name, ""), "points": values.size}
            row["mean"] = np.mean(values) if values.size else math.nan
            row["deviation"] = np.std(values, ddof=1) if values.size > 1 else math.nan
            row |= {f"q{q:g}": np.quantile(values, q) if values.size else math.nan for q in quantiles}
            rows.append(row)
        return frame({key: np.array([row[key] for row in rows]) for key in rows[0]} if rows else {})

    @property
    def _numeric(self) -> list[str]:
        """Columns of numbers that are varied, or outputs."""
        own = [name for name in self.columns if name not in (*FIRST, *LAST)]
        return [name for name in own if not isinstance(self[name], list)]

    def remarks(self, most: int = 3) -> list[str]:
        """What to know of points, by number and parameters: why they have no result and what to do, then what
        those that have one warn of; of either at most so many, and how many more there are.
        """
        wrong = [row for row in self.rows if row["status"] != "done"]
        doubtful = [row for row in self.rows if row["status"] == "done" and row["message"]]
        lines = []
        for rows, what in ((wrong, "without a result"), (doubtful, "with a warning")):
            lines += [f"point {row['point']}{self._varied_in(row)}: {_advised(row)}" for row in rows[:most]]
            if len(rows) > most:
                lines.append(f"{len(rows) - most} more {what}: column `message` of the table")
        return lines

    def _varied_in(self, row: Mapping[str, Any]) -> str:
        """The parameters of a row with their units, in brackets."""
        given = [(name, row[name], self.units.get(name, "")) for name in self._varied if name in row]
        told = ", ".join(f"{name} = {cell_of(value)} {unit}".rstrip() for name, value, unit in given)
        return f" ({told})" if told else ""

    def to_csv(self, path: str | Path) -> None:
        """Write the table as `evfem sweep` does (`sweep.csv`), whole or not at all."""
        write_text(path, sweep_csv(self.columns, self.rows, self.units))

    def __repr__(self) -> str:
        """Numbers of points by status."""
        return f"SweepResult({len(self.rows)} points: {told(self.provenance['points'])})"


def _advised(row: Mapping[str, Any]) -> str:
    """The message of a row; a run that did not end keeps its steps where it is alone."""
    alone = "; the scene with these values, run alone (evfem run), keeps the steps before"
    return f"{row['message']}{alone if row['status'] == 'not_converged' else ''}"


def short_names(keys: Sequence[str]) -> dict[str, str]:
    """The last word of each dotted key, or as many as tell it from the others.

    >>> short_names(["motion.0.gap", "finger.materials.skin.E", "finger.materials.dermis.E"])
    {'motion.0.gap': 'gap', 'finger.materials.skin.E': 'skin_E', 'finger.materials.dermis.E': 'dermis_E'}
    >>> short_names(["motion.0.force", "motion.1.force", "surface.terms.0.1"])
    {'motion.0.force': 'motion_0_force', 'motion.1.force': 'motion_1_force', 'surface.terms.0.1': 'terms_0_1'}
    """
    ends = {}
    for key in keys:
        words = key.split(".")
        ends[key] = ["_".join(words[i:]) for i in range(len(words))[::-1] if not words[i].isdigit()]
    counted = Counter([*FIRST, *LAST, SAMPLE, *(end for own in ends.values() for end in {*own})])
    return {key: next((end for end in own if counted[end] == 1), key) for key, own in ends.items()}


def array_of(values: Sequence[Any]) -> Any:
    """Numbers, NaN for None, or truth values as an array; anything else as its text in the table.

    >>> array_of([1, 2]), array_of([0.5, None]), array_of([True, False])
    (array([1, 2]), array([0.5, nan]), array([ True, False]))
    >>> array_of(["flat", [0.1, 2.0]])
    array(['flat', '[0.1, 2.0]'], dtype=object)
    """
    if all(value is None or type(value) in (int, float) for value in values):
        return np.array([math.nan if value is None else value for value in values])
    if all(type(value) is bool for value in values):
        return np.array(values)
    return np.array(["" if value is None else str(cell_of(value)) for value in values], dtype=object)


def is_table(path: Path) -> bool:
    """Whether a file begins as the table of a sweep does."""
    return begins(path, f"{FIRST[0]},".encode())


def read(path: Path) -> SweepResult:
    """The table of a sweep from its folder, `sweep.json`, or a csv file, which alone has no provenance."""
    table = path / TABLE if path.is_dir() else path
    told = table.parent / PROVENANCE
    if table.suffix == ".json":
        told, table = table, table.parent / TABLE
    provenance = _provenance(told) if told.is_file() else {}
    head, *body = csv_rows(table, "path", f"{TABLE} of a sweep, a point in each line")
    parts = [cell.removesuffix(")").partition(" (") for cell in head]
    names, units = [name for name, _, _ in parts], {name: unit for name, _, unit in parts if unit}
    if names[:1] != [*FIRST] or not set(LAST) <= set(names):
        problem = f"{path.name}, which starts with {','.join(head)[:60]!r}"
        raise InputError("path", problem, f"{TABLE} of a sweep, a point in each line")
    known = {name: _kept(provenance, name) for name in names}
    cells = (zip(names, row, strict=True) for row in body)
    rows = [{name: _value(name, cell, known[name]) for name, cell in row} for row in cells]
    counted = Counter(str(row["status"]) for row in rows)
    points = {"requested": len(rows), **{name: counted[name] for name in STATUS}}
    return SweepResult(tuple(names), rows, {"points": points, **provenance}, units)


def _provenance(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        counts = [found["points"][name] for name in ("requested", *STATUS)]
        values = [found["outputs"], *(found.get("grid") or {}).values()]
        if {*map(type, counts)} != {int} or not all(isinstance(one, (list, dict)) for one in values):
            raise ValueError("no sweep")
    except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError("path", f"{path.name} ({error})", f"the {PROVENANCE} of a sweep") from None
    return dict(found)


def _kept(provenance: Mapping[str, Any], name: str) -> dict[str, Any]:
    """The values of a column that the sweep was given, or names of its rows, by their text in the table."""
    return {str(cell_of(value)): value for value in (provenance.get("grid") or {}).get(name, ())}


def _value(name: str, cell: str, known: Mapping[str, Any]) -> Any:
    """The value in a cell; None where there is none."""
    if name in ("status", "message"):
        return cell
    try:
        return known[cell] if cell in known else json.loads(cell) if cell else None
    except (ValueError, RecursionError):
        return cell


def told(points: Mapping[str, int]) -> str:
    """What became of the points, in words."""
    words = [f"{points[name]} {name.replace('_', ' ')}" for name in STATUS if points[name]]
    missing = points["requested"] - sum(points[name] for name in STATUS)
    return ", ".join([*words, *([f"{missing} not computed"] if missing else [])])

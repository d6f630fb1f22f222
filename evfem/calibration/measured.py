"""Measured values and curves, and the values of a run at the same abscissae.

A `MeasuredCurve` belongs to one run: a column of its history over another one, as force over
indentation or friction over position. `MeasuredValues` belong to a run each: one output of it, and
the keys of the scene that differ from run to run, as hovering forces at some voltages and gaps.

Between the steps of a run a curve is interpolated by monotone cubics (Fritsch and Carlson 1980,
doi:10.1137/0717021), from the state before the motion on; steps at the measured points need none.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from evfem.common.arrays import Floats
from evfem.common.checks import choice, real, set_frozen
from evfem.common.tables import numbers, read_headed, read_table
from evfem.common.units import UNITS as KNOWN
from evfem.common.units import factor, named_unit
from evfem.errors import InputError, describe_value, readable, unknown
from evfem.scene.keys import shown
from evfem.scene.options import Solver
from evfem.scene.scene import DEPTH, Scene
from evfem.simulation.history import (
    ROOM_COLUMNS,
    SPATIAL,
    SPATIAL_UNITS,
    UNITS,
    WHOLE_UNITS,
    no_column,
    over_depth,
)
from evfem.simulation.result import COLUMNS, Result
from evfem.sweeps.file import check_key, check_output, is_key, plain_value
from evfem.sweeps.keyunits import unit_of
from evfem.sweeps.run import output
from evfem.sweeps.table import units_of

NUMBERS = tuple(name for name in (*COLUMNS, *ROOM_COLUMNS, *SPATIAL) if name != "motion")
#: most measured numbers of one kind
MOST = 100_000
#: error of a solved column relative to its largest value, in tolerances of the solver
SOLVED = 10.0


@dataclass(frozen=True)
class Along:
    """What is asked of a run: `column` where the column `over` is `at`, in motion `motion` or in all."""

    column: str
    over: str
    at: tuple[float, ...]
    motion: int | None

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each value."""
        where = "" if self.motion is None else f" in motion {self.motion}"
        return tuple(f"{self.column} at {self.over} {x!r}{where}" for x in self.at)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that the values follow from."""
        return (self.column, self.over)

    def answers(self, result: Result) -> dict[str, float | None]:
        """The values by name."""
        values = along(result, self.column, self.over, np.array(self.at), self.motion)
        return dict(zip(self.names, values.tolist(), strict=True))


@dataclass(frozen=True)
class Single:
    """What is asked of a run: COLUMN.STATISTIC, as the outputs of a sweep."""

    output: str

    @property
    def names(self) -> tuple[str, ...]:
        """The name of the value."""
        return (self.output,)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that the value follows from: a mean over a path depends on the path too."""
        column, statistic, *_ = self.output.split(".")
        return (column, *(("position", "indentation") if statistic == "mean" else ()))

    def answers(self, result: Result) -> dict[str, float | None]:
        """The value by name."""
        return {self.output: output(result, self.output)}


Question = Along | Single
#: a run that a measurement needs: keys of the scene that it sets, and what is asked of it
Run = tuple[Mapping[str, Any], Question]


@dataclass(frozen=True, eq=False)
class MeasuredCurve:
    """A column of the history measured along another one in one run.

    `values` (N,) of `column` where `over` is `at` (N,), growing or falling throughout: loading and
    unloading are a curve each; `motion` is the number of the motion (None: the whole run, in which
    `over` must grow or fall throughout, too). `where`: keys of the scene that this measurement sets,
    `sd` the standard deviation of a value, one for all or (N,). `units` are those of columns that a file
    says to be N or N/mm, and the like, of which the scene has one.

    >>> force = MeasuredCurve("normal_force", over="indentation", at=[0.2, 0.4], values=[0.01, 0.03])
    >>> force.names
    ('normal_force at indentation 0.2', 'normal_force at indentation 0.4')
    """

    column: str
    over: str
    at: Floats | Sequence[float]
    values: Floats | Sequence[float]
    motion: int | None = None
    sd: float | Floats | Sequence[float] | None = None
    where: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, column in (("column", str(self.column)), ("over", str(self.over))):
            if column not in NUMBERS:
                raise no_column(f"data.{name}", column, list(NUMBERS))
        set_frozen(self, at=numbers("data.at", self.at, f"a list of values of {self.over}"))
        set_frozen(self, **_measured(self.values, self.sd, len(self.at), "as many values as points"))
        if len(np.unique(self.at)) < len(self.at):
            raise InputError("data.at", "the same point twice", "each point once; the mean of its values")
        turn = np.flatnonzero(np.diff(np.sign(np.diff(self.at))))
        if turn.size:
            first, there, after = self.at[turn[0] : turn[0] + 3]
            problem = f"{self.over} {first:g}, {there:g}, then {after:g} (number {turn[0] + 3})"
            allowed = "growing or falling values: loading and unloading are a curve each, with its `motion`"
            raise InputError("data.at", problem, f"{allowed}; values that scatter, sorted")
        if self.motion is not None and (type(self.motion) is not int or self.motion < 0):
            raise InputError(
                "data.motion", describe_value(self.motion), "the number of a motion, from 0, or None"
            )
        set_frozen(self, where={key: _setting(key, value) for key, value in self.where.items()})

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        motion: int | None = None,
        sd: float | None = None,
        where: Mapping[str, Any] | None = None,
        depth: float | None = None,
        columns: Mapping[str, int | str] | None = None,
        zero: float = 0.0,
        branch: str | None = None,
        factors: Mapping[str, float] | None = None,
    ) -> MeasuredCurve:
        """The curve in a file with the header `OVER,COLUMN` or `OVER,COLUMN,sd`, two columns of the history:
        `indentation,normal_force`; or with others, of which `columns` names those that are meant, OVER first,
        by names or numbers from 1: {"indentation": "Travel", "normal_force": 3}.

        Units of the header are converted to mm, N, s, V and MPa; a unit that is not known is refused, unless
        `factors` has how many of these it is: {"normal_force": 9.80665e-3} for grams. `zero` is the OVER (in
        these) at which OVER shall be 0. `branch` is "loading", up to the largest OVER, or "unloading", from
        there on. Rows with gaps are left out, rows at the same point are averaged. With a `depth` (mm) the
        file is in N, mm2 and mJ over it, as `Result.total` is, and what depends on it is divided by it,
        `sd` too.
        """
        used = None if columns is None else {f"data.columns.{name}": one for name, one in columns.items()}
        table = read_headed(Path(path), "data", used=used)
        wanted = dict(zip(table.names, table.names, strict=True)) if columns is None else dict(columns)
        over, *others = (name for name in wanted if name != "sd")
        problem = f"{Path(path).name} with the header {','.join(table.names)[:60]}"
        if len(others) != 1 or (columns is None and len(set(table.names)) < len(table.names)):
            allowed = "two columns of the history, as indentation,normal_force; and sd; or `columns`"
            raise InputError("data", problem, allowed)
        if columns is None and not {over, *others} <= {*NUMBERS}:
            allowed = 'columns of the history, or columns={"indentation": %s, "normal_force": %s}'
            raise InputError("data", problem, allowed % tuple(map(readable, (over, *others))))
        for name in {over, *others} - {*NUMBERS}:
            raise no_column("data.columns", name, list(NUMBERS))
        sizes = _factors(factors, wanted)
        found: list[Floats] = []
        said: dict[str, str] = {}
        for name, of in zip((over, *others, "sd"), (over, *others, *others), strict=True):
            if name in wanted:  # per mm of depth, or in all
                bases = (UNITS.get(of), SPATIAL_UNITS.get(of)) if depth is None else (_whole(of),) * 2
                more = _hint(of) if depth is None else f"{_hint(of)}, in all, as a depth is given"
                more += f'; or factors={{"{name}": how many {bases[0] or bases[1] or 1} one of these is}}'
                key = f"data.columns.{name}"
                like = wanted[others[0]] if name == "sd" else None
                size = sizes.get(name, None if like is None else sizes.get(others[0]))
                found.append(table.column(key, wanted[name], bases, size, more, like))
                unit = table.base(key, wanted[name]) if name == of and size is None else None
                said |= {name: unit} if unit is not None and bases[0] != bases[1] else {}
        at, values, *spread = _branch(np.column_stack(found), branch).T
        curve = cls(
            others[0], over, at - zero, values, motion, spread[0] if spread else sd, where or {}, said
        )
        return curve if depth is None else curve._per_depth(DEPTH["check"]("data.depth", depth))

    def _per_depth(self, depth: float) -> MeasuredCurve:
        """Numbers over a depth (mm), per mm of it."""
        columns = {"at": self.over, "values": self.column, "sd": self.column}
        arrays = {key: getattr(self, key) for key in columns if getattr(self, key) is not None}
        divided = {key: over_depth({columns[key]: array}, 1.0 / depth) for key, array in arrays.items()}
        said = {name: UNITS[name] for name in (self.over, self.column) if _whole(name) != UNITS.get(name, "")}
        return replace(self, **{key: array[columns[key]] for key, array in divided.items()}, units=said)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each value."""
        return self.runs()[0][1].names

    def runs(self) -> list[Run]:
        """The one run."""
        at = tuple(np.asarray(self.at).tolist())
        return [(self.where, Along(self.column, self.over, at, self.motion))]

    def check(self, motions: int) -> None:
        """InputError for a motion that a scene with so many does not have."""
        if self.motion is not None and self.motion >= motions:
            raise InputError("data.motion", describe_value(self.motion), f"motions from 0 to {motions - 1}")


@dataclass(frozen=True, eq=False)
class MeasuredValues:
    """One output of each of N runs, which differ in some keys of the scene.

    `output` is COLUMN.STATISTIC as in a sweep, `values` (N,) its measured values, `where` the keys
    that differ, with N values each; `sd` the standard deviation, one for all or (N,); `units` as above.

    >>> gaps = {"motion.0.gap": [0.25, 0.5]}
    >>> MeasuredValues("electrostatic_force.last", values=[4.1e-4, 2.0e-4], where=gaps).names
    ('electrostatic_force.last, motion.0.gap 0.25', 'electrostatic_force.last, motion.0.gap 0.5')
    """

    output: str
    values: Floats | Sequence[float]
    where: Mapping[str, Sequence[Any]]
    sd: float | Floats | Sequence[float] | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not isinstance(self.where, Mapping) or not self.where:
            raise InputError("data.where", shown(self.where), "{key: list of its values} for one key or more")
        where = {key: _setting(key, value) for key, value in self.where.items()}
        count = len(np.atleast_1d(np.asarray(self.values, dtype=object)))
        for key, settings in where.items():
            if not isinstance(settings, list) or len(settings) != count:
                raise InputError(f"data.where.{key}", shown(settings), f"{count} values, one for each run")
        set_frozen(self, where=where, **_measured(self.values, self.sd, count, "a list of numbers"))

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        sd: float | None = None,
        depth: float | None = None,
        columns: Mapping[str, int | str] | None = None,
    ) -> MeasuredValues:
        """The values in a file with the header `KEY,...,OUTPUT[,sd]`, keys as `motion.0.gap`, perhaps with
        units: `motion.0.gap [um]`; or with another header, of which `columns` names those that are meant, the
        output last, by names or numbers from 1: {"motion.0.force": "Load", "tangential_force.last": 3}. With
        a `depth` (mm) its forces, areas and energies are over it, as those of `Result.total`, and are divided
        by it, `sd` too.
        """
        cells = read_table(Path(path), "data") if columns is None else _chosen(Path(path), columns)
        *keys, last = [name for cell in cells if (name := named_unit(cell)[0]) != "sd"] or [""]
        for name in (*(one for one in keys if not is_key(one)), *([] if "." in last else [last])):
            allowed = "keys of the scene, then an output: motion.0.force [N],tangential_force.last [N]"
            raise InputError("data", f"{Path(path).name} with the column {describe_value(name)}", allowed)
        table, said = _without_units(cells)
        if sd is not None and "sd" not in table:
            table["sd"] = np.asarray(sd)
        if depth is not None:
            table, said = _per_depth(table, said, DEPTH["check"]("data.depth", depth)), {}
        spread = table.pop("sd", None)
        *keys, last = table
        return cls(last, table[last], {key: table[key] for key in keys}, spread, said)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each value."""
        runs = [[f"{key} {shown(value)}" for key, value in keys.items()] for keys, _ in self.runs()]
        return tuple(", ".join([self.output, *keys]) for keys in runs)

    def runs(self) -> list[Run]:
        """A run for each value."""
        rows = zip(*self.where.values(), strict=True)
        return [(dict(zip(self.where, row, strict=True)), Single(self.output)) for row in rows]

    def check(self, motions: int) -> None:
        """InputError for an output that a scene with so many motions does not have."""
        check_output(self.output, motions)


Measured = MeasuredCurve | MeasuredValues


def along(result: Result, column: str, over: str, at: Floats, motion: int | None = None) -> Floats:
    """Values of a column where the column `over` is `at` (N,), in a motion or in all.

    Before the motion is the last state of the one before, before a first press without voltage zero. A place
    beyond the end by up to `SOLVED` tolerances is at it. InputError where `over` turns round, and beyond it.
    """
    from scipy.interpolate import PchipInterpolator

    rows = np.arange(len(result.step)) if motion is None else np.flatnonzero(result.motion_index == motion)
    x, y = (
        getattr(result, name)[max(rows[0] - 1, 0) : rows[-1] + 1].astype(float) for name in (over, column)
    )
    if rows[0] == 0 and result.motion[0] == "press" and not result.voltage.any():
        x, y = np.append(0.0, x), np.append(0.0, y)
    if len(x) > 1 and x[-1] < x[0]:
        x, y = x[::-1], y[::-1]
    tolerance = result.provenance.get("solver", {}).get("tolerance", Solver.tolerance)
    slack = 0.0 if over == "time" else SOLVED * tolerance * float(np.abs(x).max())
    if len(x) < 2 or not (np.diff(x) > slack).all():
        which = "the run" if motion is None else f"motion {motion}"
        raise InputError("data.over", f"{over}, which does not advance in {which}", "one that does")
    if at.min() < x[0] - slack or at.max() > x[-1] + slack:
        problem = f"{over} from {at.min():g} to {at.max():g}"
        raise InputError("data.at", problem, f"values within those of the run, {x[0]:g} to {x[-1]:g}")
    return PchipInterpolator(x, y)(np.clip(at, x[0], x[-1]))


def _measured(values: Any, sd: Any, count: int, allowed: str) -> dict[str, Floats | None]:
    found = numbers("data.values", values, allowed)
    if len(found) != count or not 0 < count <= MOST:
        raise InputError("data.values", f"{len(found)} values", f"{allowed}, from 1 to {MOST}")
    if sd is None:
        return {"values": found, "sd": None}
    rule = "a standard deviation larger than 0, one for all or one for each value"
    spread = numbers("data.sd", np.atleast_1d(sd), rule)
    if len(spread) not in (1, count) or not (spread > 0.0).all():
        raise InputError("data.sd", shown(sd), rule)
    return {"values": found, "sd": np.broadcast_to(spread, count).copy()}


def check_units(one: Measured, scene: Scene) -> None:
    """InputError for a measurement whose file says N where the `scene` has N/mm, or the other way round."""
    space = units_of(scene) is SPATIAL_UNITS
    for name, unit in one.units.items():
        columns = SPATIAL_UNITS if space else UNITS
        own = columns.get(name.split(".")[0]) or unit_of(name, "N" if space else "N/mm")
        if unit != own:
            kind = "in three dimensions" if space else "in the plane"
            over = f"{own}, or `depth`, the mm that it was measured over, in `from_csv`"
            raise InputError(f"data.{name}", f"{unit} for a finger {kind}", own if space else over)


def _whole(column: str) -> str | None:
    """Unit of a column over a whole depth."""
    return WHOLE_UNITS.get(column, SPATIAL_UNITS.get(column))


def _chosen(path: Path, columns: Mapping[str, int | str]) -> dict[str, Floats]:
    """Columns of a file with a header of its own, by the names that they have here, beside their units."""
    used = {f"data.columns.{name}": entry for name, entry in columns.items()}
    table = read_headed(path, "data", gaps=False, used=used)
    found = {}
    for (key, entry), name in zip(used.items(), columns, strict=True):
        unit = table.unit(key, entry)
        found[name if unit is None else f"{name} [{unit}]"] = table.columns[table.index(key, entry)]
    return found


def _without_units(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Columns of a table of runs without the units beside their names, in those of scenes and histories; a
    deviation is in the unit of the column before it. And units of those that differ with the scene.
    """
    found: dict[str, Any] = {}
    said: dict[str, str] = {}
    size, bases = 1.0, set[str | None]()
    for cell, values in table.items():
        name, unit = named_unit(cell)
        if name != "sd":
            column = name.split(".")[0]
            bases = {unit_of(name), unit_of(name, "N"), UNITS.get(column), SPATIAL_UNITS.get(column)}
        if name != "sd" or unit is not None:
            size = factor(f"data.{name}", name, unit, bases, _hint(name.split(".")[0]))
        if name != "sd" and unit is not None and unit in KNOWN and len(bases - {None, ""}) > 1:
            said[name] = KNOWN[unit][0]
        if size != 1.0 and isinstance(values, list):
            raise InputError(
                f"data.{name}", f"{describe_value(values)} in {unit or 'a unit'}", "a number in each row"
            )
        found[name] = values if size == 1.0 else values * size
    return found, said


def _per_depth(table: Mapping[str, Any], said: Mapping[str, str], depth: float) -> dict[str, Any]:
    """Columns of a table of runs over a depth (mm), per mm of it; a deviation is as the column before it."""
    found: dict[str, Any] = {}
    own = whole = ""
    for name, values in table.items():
        column = name.split(".")[0]
        if name != "sd":
            own = unit_of(name) or UNITS.get(column, "")
            whole = unit_of(name, "N") or _whole(column) or ""
        if own != whole and said.get(name) == own:
            raise InputError(f"data.{name}", f"{name} in {own}", f"{whole}, in all, as a depth is given")
        found[name] = values if own == whole else np.asarray(values) / depth
    return found


def _hint(column: str) -> str:
    """What a column with a unit may have been meant to be."""
    return "; a friction force is tangential_force" if column == "friction" else ""


def _factors(factors: Mapping[str, float] | None, wanted: Collection[str]) -> dict[str, float]:
    """Factors of columns to the units of the history; one of a value is that of its deviation."""
    found = {}
    for name, size in (factors or {}).items():
        if name not in wanted:
            raise unknown("data.factors", name, list(wanted), f"{describe_value(name)}, which is not read")
        found[name] = real(f"data.factors.{name}", size, "a number that is not 0", lambda x: x != 0.0)
    return found


def _branch(rows: Floats, branch: str | None) -> Floats:
    """Rows (n, 2 or 3) of abscissa, value and perhaps sd: one branch, no gaps, one row for each point."""
    rows = rows[np.isfinite(rows).all(axis=1)]
    if branch is not None and len(rows):
        choice("data.branch", branch, ("loading", "unloading"))
        top = np.flatnonzero(rows[:, 0] == rows[:, 0].max())
        rows = rows[: top[0] + 1] if branch == "loading" else rows[top[-1] :]
    starts = np.flatnonzero(np.diff(rows[:, 0], prepend=np.nan) != 0.0)
    number = np.diff(starts, append=len(rows))[:, None]
    mean = np.add.reduceat(rows, starts) / number if len(rows) else rows
    if rows.shape[1] == 3 and len(rows):
        with np.errstate(over="ignore"):  # infinite ones are refused
            mean[:, 2] = np.sqrt(np.add.reduceat(rows[:, 2] ** 2, starts)) / number[:, 0]
    return mean


def _setting(key: Any, value: Any) -> Any:
    check_key("data.where", str(key))
    found = plain_value(f"data.where.{key}", value)
    if any(
        isinstance(one, float) and not math.isfinite(one) for one in np.ravel(np.array(found, dtype=object))
    ):
        raise InputError(f"data.where.{key}", describe_value(value), "finite numbers")
    return found

"""What a sweep leaves on disk: a file per point, one table of all, and how they came about.

A point's file is named by the fingerprint of its scene, outputs and version: a sweep that goes on, or one
changed in other points, finds it again. Every file is written whole or not at all. The table is `sweep.csv`
(and `sweep.parquet` where pyarrow is installed), a row per point; `sweep.json` has the provenance, from the
start, so that the folder can tell which sweep was its last. Only files that a sweep wrote are ever replaced
or removed: `.evfem-sweep` lists their names (`Manifest`), a point's file says so itself.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import evfem
from evfem.common.storage import disk, refuse_others, replacing, write_text
from evfem.common.tables import csv_text
from evfem.errors import InputError
from evfem.sweeps.manifest import Manifest

POINTS, TABLE, PARQUET, PROVENANCE = "points", "sweep.csv", "sweep.parquet", "sweep.json"
MANIFEST = ".evfem-sweep"
FORMAT = "evfem-sweep-point-3"
POINT_FILE = re.compile(r"[0-9a-f]{64}\.json")
#: how the file of a point begins, of whatever version
POINT_BEGINS = b'{"format": "evfem-sweep-point-'
#: what a killed sweep was writing
LEFT = re.compile(r"\.([0-9a-f]{64}\.json|sweep\.(csv|json|parquet)|\.evfem-sweep)\.\d+\.tmp")
OURS = re.compile(r"sweep\.(csv|json|parquet)|points")
STATUS = ("done", "refused", "not_converged", "failed")


@dataclass(frozen=True)
class Answer:
    """What became of a point: done, refused, not_converged or failed, its outputs and its message, and what
    each mean among them is over (`evfem.sweeps.means`).
    """

    status: str
    seconds: float
    message: str
    outputs: dict[str, float | None]
    over: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class SweepFolder:
    """A folder of a sweep. `resume` keeps the points of another one in it, `overwrite` removes all points."""

    path: Path
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.resume and self.overwrite:
            raise InputError("overwrite", "resume and overwrite", "one of the two")

    def open(self, keys: Collection[str], plan: str) -> None:
        """Make or clear the folder of the sweep `plan`; InputError where files of others are in it."""
        with disk(f"use {self.path}"):
            self.path.mkdir(parents=True, exist_ok=True)
            listed, points = self._manifest, self._points()
            present = [name for name in (TABLE, PARQUET, PROVENANCE, POINTS) if (self.path / name).exists()]
            refuse_others(self.path / MANIFEST, present, "a sweep")
            _refuse_no_points(points)
            if not (self.resume or self.overwrite):
                self._refuse_another(keys, plan, points)
            for file in points if self.overwrite else ():
                file.unlink()
            if self.overwrite:
                listed.remove()
            listed.begin([POINTS])
            (self.path / POINTS).mkdir(exist_ok=True)
            for file in [*self.path.iterdir(), *(self.path / POINTS).iterdir()]:
                if LEFT.fullmatch(file.name):
                    file.unlink()

    @cached_property
    def _manifest(self) -> Manifest:
        return Manifest(self.path / MANIFEST, OURS)

    def _points(self) -> list[Path]:
        """The files in the folder of the points that have the name of one."""
        points = self.path / POINTS
        return [p for p in points.iterdir() if POINT_FILE.fullmatch(p.name)] if points.is_dir() else []

    def _refuse_another(self, keys: Collection[str], plan: str, points: Sequence[Path]) -> None:
        """InputError where the folder has points of another sweep; one that grew is no other."""
        others = sum(file.stem not in keys for file in points)
        last, version = self._last()
        if others and last != plan:
            other = "another sweep"
            if version not in (None, evfem.__version__):
                other = f"evfem {version!r}, not of {evfem.__version__!r}"
            problem = f"{self.path}, with {others} points of {other}"
            allowed = "another folder, --resume to keep them, --overwrite to remove them"
            raise InputError("--out", problem, allowed)

    def _last(self) -> tuple[str | None, str | None]:
        """Fingerprint of the sweep that was started last in the folder, and the version that did."""
        with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            told = json.loads((self.path / PROVENANCE).read_text(encoding="utf-8"))
            return told["digest"], str(told["versions"]["evfem"])[:40]
        return None, None

    def write(self, key: str, answer: Answer) -> None:
        """Keep a point, in one step."""
        text = json.dumps({"format": FORMAT, **vars(answer)}, allow_nan=False)
        write_text(self.path / POINTS / f"{key}.json", text + "\n")

    def read(self, key: str) -> Answer | None:
        """A point that is finished; None for one that is not, that failed (of memory, say) or is damaged."""
        with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            values = json.loads((self.path / POINTS / f"{key}.json").read_text(encoding="utf-8"))
            if values.pop("format") == FORMAT and _sound(answer := Answer(**values)):
                return answer if answer.status != "failed" else None
        return None

    def write_table(
        self, columns: Sequence[str], rows: Sequence[Mapping[str, Any]], units: Mapping[str, str]
    ) -> None:
        """The table of all points so far."""
        with self._manifest.writing(self.path / TABLE):
            write_text(self.path / TABLE, sweep_csv(columns, rows, units))
        if find_spec("pyarrow") is not None:
            file = self.path / PARQUET
            with self._manifest.writing(file), replacing(file) as temporary:
                _write_parquet(temporary, columns, rows)

    def write_provenance(self, provenance: Mapping[str, Any]) -> None:
        """Provenance of the table."""
        with self._manifest.writing(self.path / PROVENANCE):
            write_text(self.path / PROVENANCE, json.dumps(provenance, indent=1, allow_nan=False) + "\n")


def _refuse_no_points(files: Sequence[Path]) -> None:
    """InputError where one of the files with names of points was not written by a sweep."""
    for path in files:
        with path.open("rb") as file:
            if file.read(len(POINT_BEGINS)) != POINT_BEGINS:
                problem = f"{path.parent}, where {path.name} was not written by a sweep"
                raise InputError("--out", problem, "another folder, for files of others are never touched")


def _sound(answer: Answer) -> bool:
    if not isinstance(answer.outputs, dict) or not isinstance(answer.over, dict):
        return False
    numbers = [answer.seconds, *(value for value in answer.outputs.values() if value is not None)]
    told = (answer.message, *answer.over.values())
    words = answer.status in STATUS and all(isinstance(word, str) for word in told)
    if words:
        "".join(told).encode()  # ValueError for half a letter, which no table can hold
    return words and all(type(number) in (int, float) for number in numbers)


def sweep_csv(columns: Sequence[str], rows: Sequence[Mapping[str, Any]], units: Mapping[str, str]) -> str:
    """The table of a sweep as csv, with units behind the names: lists and truth values as in JSON."""
    heads = [f"{name} ({units[name]})" if units.get(name) else name for name in columns]
    return csv_text([heads, *([cell_of(row.get(name)) for name in columns] for row in rows)])


def cell_of(value: Any) -> Any:
    """A value as it stands in the table."""
    return json.dumps(value) if isinstance(value, (list, bool)) else value


def _write_parquet(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    from pyarrow import parquet, table

    values = {name: [row.get(name) for row in rows] for name in columns}
    for name, column in values.items():
        kinds = {type(value) for value in column if value is not None}
        if not (kinds <= {int, float} or len(kinds) == 1) or list in kinds:  # numbers beside tables, say
            values[name] = [None if value is None else str(cell_of(value)) for value in column]
        elif float in kinds or not kinds:
            values[name] = [None if value is None else float(value) for value in column]
    parquet.write_table(table(values), path)

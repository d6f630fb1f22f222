"""What a sweep leaves on disk: a file per point, one table of all, and how they came about.

A point's file is named by the fingerprint of its scene, outputs and version: a sweep that goes on,
or one changed in other points, finds it again. Every file is written whole or not at all. The
table is `sweep.csv` (and `sweep.parquet` where pyarrow is installed), a row per point;
`sweep.json` has the provenance, from the start, so that the folder can tell which sweep was its
last.
"""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from evfem.common.storage import disk, refuse_others, replacing, write_names, write_text
from evfem.common.tables import csv_text
from evfem.errors import InputError

POINTS, TABLE, PARQUET, PROVENANCE = "points", "sweep.csv", "sweep.parquet", "sweep.json"
MANIFEST = ".evfem-sweep"
FORMAT = "evfem-sweep-point-2"
POINT_FILE = re.compile(r"[0-9a-f]{64}\.json")
#: what a killed sweep was writing
LEFT = re.compile(r"\.([0-9a-f]{64}\.json|sweep\.(csv|json|parquet)|\.evfem-sweep)\.\d+\.tmp")
STATUS = ("done", "refused", "not_converged", "failed")


@dataclass(frozen=True)
class Answer:
    """What became of a point: `status` done, refused (by the scene reader), not_converged or
    failed, the outputs of a point that is done, and the message of one that is not.
    """

    status: str
    seconds: float
    message: str
    outputs: dict[str, float | None]

    @property
    def final(self) -> bool:
        """Whether computing it again would give the same: not so where a process died or the
        memory ended.
        """
        return self.status != "failed"


@dataclass(frozen=True)
class SweepFolder:
    """A folder of a sweep. `resume` keeps the points of another one in it, `overwrite` removes all
    points.
    """

    path: Path
    resume: bool = False
    overwrite: bool = False

    def __post_init__(self) -> None:
        if self.resume and self.overwrite:
            raise InputError("overwrite", "resume and overwrite", "one of the two")

    def open(self, keys: Collection[str], plan: str) -> None:
        """Make the folder of the sweep with these keys and the fingerprint `plan`, or clear it.

        Raises InputError, with nothing touched, where files of others are in the way, or points
        that this sweep does not have.
        """
        ours = (TABLE, PARQUET, PROVENANCE, POINTS)
        with disk(f"use {self.path}"):
            self.path.mkdir(parents=True, exist_ok=True)
            present = [name for name in ours if (self.path / name).exists()]
            refuse_others(self.path / MANIFEST, present, "a sweep")
            if not (self.resume or self.overwrite):
                self._refuse_another(keys, plan)
            write_names(self.path / MANIFEST, ours)
            (self.path / POINTS).mkdir(exist_ok=True)
            files = [p for folder in (self.path, self.path / POINTS) for p in folder.iterdir()]
            for file in files:
                old = file.name in ours or POINT_FILE.fullmatch(file.name)
                if LEFT.fullmatch(file.name) or (old and self.overwrite and file.name != POINTS):
                    file.unlink()

    def _refuse_another(self, keys: Collection[str], plan: str) -> None:
        """InputError where the folder has points of another sweep; one that grew is no other."""
        points = self.path / POINTS
        names = [p.name for p in points.iterdir() if POINT_FILE.fullmatch(p.name)] if points.exists() else []
        others = sum(name.removesuffix(".json") not in keys for name in names)
        if others and self._last() != plan:
            given = f"{self.path}, with {others} points of another sweep or version"
            raise InputError(
                "--out", given, "another folder, --resume to keep them, --overwrite to remove them"
            )

    def _last(self) -> str | None:
        """Fingerprint of the sweep that was started last in the folder."""
        with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            return json.loads((self.path / PROVENANCE).read_text(encoding="utf-8"))["digest"]
        return None

    def write(self, key: str, answer: Answer) -> None:
        """Keep a point, in one step."""
        text = json.dumps({"format": FORMAT, **vars(answer)}, allow_nan=False)
        write_text(self.path / POINTS / f"{key}.json", text + "\n")

    def read(self, key: str) -> Answer | None:
        """A point that is finished; None for one that is not, and for one whose file is damaged."""
        with suppress(OSError, ValueError, TypeError, KeyError, RecursionError):
            values = json.loads((self.path / POINTS / f"{key}.json").read_text(encoding="utf-8"))
            if values.pop("format") == FORMAT and _sound(answer := Answer(**values)) and answer.final:
                return answer
        return None

    def write_table(self, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
        """The table of all points so far."""
        write_text(self.path / TABLE, sweep_csv(columns, rows))
        if find_spec("pyarrow") is not None:
            with replacing(self.path / PARQUET) as temporary:
                _write_parquet(temporary, columns, rows)

    def write_provenance(self, provenance: Mapping[str, Any]) -> None:
        """How the table came about."""
        write_text(self.path / PROVENANCE, json.dumps(provenance, indent=1, allow_nan=False) + "\n")


def _sound(answer: Answer) -> bool:
    numbers = [answer.seconds, *(value for value in answer.outputs.values() if value is not None)]
    return (
        answer.status in STATUS
        and isinstance(answer.message, str)
        and all(type(number) in (int, float) for number in numbers)
    )


def sweep_csv(columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> str:
    """The table of a sweep as csv: lists and truth values as in JSON.

    >>> sweep_csv(["point", "status"], [{"point": 0, "status": "done"}])
    'point,status\\n0,done\\n'
    """
    return csv_text([columns, *([_cell(row.get(name)) for name in columns] for row in rows)])


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, (list, bool)) else value


def _write_parquet(path: Path, columns: Sequence[str], rows: Sequence[Mapping[str, Any]]) -> None:
    from pyarrow import parquet, table

    values = {name: [row.get(name) for row in rows] for name in columns}
    for name, column in values.items():
        kinds = {type(value) for value in column if value is not None}
        if not (kinds <= {int, float} or len(kinds) == 1) or list in kinds:  # numbers beside tables, say
            values[name] = [None if value is None else str(_cell(value)) for value in column]
        elif float in kinds or not kinds:
            values[name] = [None if value is None else float(value) for value in column]
    parquet.write_table(table(values), path)

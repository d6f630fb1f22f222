"""What a run leaves behind: a history with one row per step, fields of some steps, and how it came
about.

Units mm, N/mm, MPa, V, s; energies in N (N mm per mm of depth); N, mm2 and mJ in `Result.total`.
Files are .npz without pickled objects.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

import evfem
from evfem.common.arrays import Floats, Ints
from evfem.common.checks import plain
from evfem.common.storage import load_arrays, save_arrays
from evfem.common.views import curves, plus, table
from evfem.errors import ABSENT, InputError
from evfem.mesh.archive import mesh_arrays, mesh_of
from evfem.mesh.mesh import Mesh
from evfem.simulation.history import (
    COLUMNS,
    DRIFT,
    INTEGERS,
    NEEDED,
    RESUMED,
    SPATIAL,
    SPATIAL_UNITS,
    UNITS,
    WHOLE_UNITS,
    History,
    Row,
    column_of,
    columns_of,
    load_drift,
    over_depth,
)
from evfem.simulation.provenance import provenance as provenance

#: key of the provenance of a total, with its depth (mm)
WHOLE = "over_mm"
RESULT_FORMAT = "evfem-result-1"
CHECKPOINT_FORMAT = "evfem-checkpoint-5"
ANOTHER = "a run of another scene"
#: what is shown of the last step
SHOWN = (
    *("position", "indentation", "voltage"),
    *("normal_force", "tangential_force", "electrostatic_force", "contact_width"),
)
#: what is shown of it over a whole depth
SHOWN_WHOLE = SHOWN[3:]
#: and of a finger in three dimensions
SHOWN_SPATIAL = (
    *("position", "indentation", "voltage", "normal_force", "tangential_force", "tangential_force_z"),
    *("electrostatic_force", "contact_area", "real_contact_area"),
)


@dataclass(frozen=True, eq=False)
class Frame:
    """Fields of one step on N nodes and E cells; tractions in MPa, lengths in mm.

    `gap` is NaN and tractions are 0 off the pad; `contact_status` 0 open, 1 stick, 2 slip.
    `cauchy_stress` holds the components xx, yy, zz, xy of the cell means, in three dimensions yz and
    xz too; `J` is the volume ratio. There `shear_traction` is the magnitude of the shear. Tractions are
    nodal forces over the lengths, or areas, that these were made with: the current shares of the pad,
    for `electrostatic_traction` of the full field those of its columns.
    """

    step: int
    time: float
    position: float
    displacement: Floats
    gap: Floats
    contact_pressure: Floats
    shear_traction: Floats
    electrostatic_traction: Floats
    contact_status: Ints
    von_mises: Floats
    cauchy_stress: Floats
    J: Floats

    def __repr__(self) -> str:
        """Which step it is, where, and its size."""
        size = f"{len(self.displacement)} nodes, {len(self.J)} cells"
        return f"Frame of step {self.step} at {plus(self.position):.4g} mm, {plus(self.time):.4g} s: {size}"


POINT_FIELDS = ("gap", "contact_pressure", "shear_traction", "electrostatic_traction", "contact_status")
CELL_FIELDS = ("von_mises", "cauchy_stress", "J")
_SHAPES: dict[str, tuple[str, ...]] = {
    "displacement": ("N", "dim"),
    **dict.fromkeys(POINT_FIELDS, ("N",)),
}
_SHAPES |= {"von_mises": ("E",), "cauchy_stress": ("E", "stresses"), "J": ("E",)}


@dataclass(frozen=True, eq=False)
class Result(History):
    """Every column of the history as an array over the steps, the frames kept, the mesh and the
    provenance.

    Forces are per mm of depth; `total` has them in N where the scene says how deep the finger is.
    `applied_force` is the downward force on the bone; `normal_force` and `tangential_force` are
    the sums of the contact forces on the finger, +y and -x components; `electrostatic_force` is
    the downward attraction.

    Of a finger in three dimensions forces are in N, and `in_space` has its further columns
    (`SPATIAL`): `position_z`, `tangential_force_z` and the contact areas.
    """

    frames: list[Frame]
    mesh: Mesh
    provenance: dict[str, Any] = field(default_factory=dict)
    in_space: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def from_rows(
        cls, rows: Sequence[Row], frames: Sequence[Frame], mesh: Mesh, provenance: dict[str, Any]
    ) -> Result:
        """A result from rows as the solver reports them; each row has exactly the keys of
        `COLUMNS`.
        """
        for row in rows:
            if not columns_of(row):
                odd = sorted(set(row) ^ set(COLUMNS))
                raise InputError("row", f"missing or unknown {odd}", ", ".join(COLUMNS))
        columns = {name: column_of(name, [row[name] for row in rows]) for name in COLUMNS}
        further = SPATIAL if mesh.dim == 3 else ()
        in_space = {name: column_of(name, [row[name] for row in rows]) for name in further}
        return cls(**columns, frames=list(frames), mesh=mesh, provenance=provenance, in_space=in_space)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns."""
        return (*COLUMNS, *self.in_space)

    def __getitem__(self, name: str) -> Any:
        """A column by its name."""
        return self.in_space[name] if name in self.in_space else super().__getitem__(name)

    @property
    def position_z(self) -> Floats:
        """z of the bone (mm); that of a finger in the plane stays 0."""
        return self.in_space.get("position_z", np.zeros_like(self.position))

    @property
    def tangential_force_z(self) -> Floats:
        """Sum of the contact forces against +z; none on a finger in the plane."""
        return self.in_space.get("tangential_force_z", np.zeros_like(self.position))

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each column."""
        if self.in_space:
            return SPATIAL_UNITS
        return WHOLE_UNITS if WHOLE in self.provenance else UNITS

    @property
    def depth(self) -> float | None:
        """The scene's depth (mm), None without one."""
        return self.provenance.get("scene", {}).get("depth")

    @property
    def total(self) -> Result:
        """This result over the whole `depth`: under the same names forces in N, widths as areas in
        mm2, works and energies in mJ; lengths, pressures and fields are as they were.

        ``result.total.rows``, ``.table()``, ``.to_csv(path)`` and the plots then have these units too.
        Raises InputError where the scene says no depth. A finger in three dimensions is whole.
        """
        if self.in_space or WHOLE in self.provenance:
            return self
        depth = self._known_depth
        columns = over_depth({name: self[name] for name in COLUMNS}, depth)
        return replace(self, **columns, provenance={**self.provenance, WHOLE: depth})

    @property
    def load_drift(self) -> float:
        """Largest relative change of the load where the indentation was held after a press; 0 where
        the load was.
        """
        return load_drift(self.rows)

    @property
    def contact_area(self) -> Floats:
        """Gross contact area (mm2): `contact_width` over the depth. Raises InputError without one,
        unless the finger is one in three dimensions.
        """
        return self.in_space["contact_area"] if self.in_space else self.total.contact_width

    @property
    def real_contact_area(self) -> Floats:
        """Real contact area (mm2): `real_contact_width` over the depth. Raises InputError without
        one, unless the finger is one in three dimensions.
        """
        return self.in_space["real_contact_area"] if self.in_space else self.total.real_contact_width

    @property
    def _known_depth(self) -> float:
        if self.depth is None:
            allowed = "a depth in mm, by Scene(depth=...) or depth in [finger]"
            raise InputError("depth", ABSENT, allowed)
        return self.depth

    def summary(self) -> dict[str, Any]:
        """Sizes, the last row, extremes and costs, in plain numbers ready for JSON."""
        scene = self.provenance.get("scene", {})
        steps = len(self.step)
        extremes = {}
        if steps:
            peaks = (*self._shown[3:], "peak_contact_pressure")
            extremes = {name: float(np.max(np.abs(self[name]))) for name in peaks}
        found = {
            "scene": scene.get("name", "scene"),
            "complete": steps == scene.get("total_steps", steps),
            "steps": steps,
            "requested_steps": scene.get("total_steps", steps),
            "nodes": len(self.mesh.points),
            "cells": len(self.mesh.cells),
            "kind": self.mesh.kind,
            "last": {name: _json(value) for name, value in self.rows[-1].items()} if steps else {},
            "largest": extremes,
            "load_drift": self.load_drift,
            "substeps": int(self.substeps.sum()),
            "newton_iterations": int(self.newton_iterations.sum()),
            "relaxations": int(self.relaxations.sum()),
            "seconds": float(self.seconds.sum()),
            "units": {
                "length": "mm",
                "force": self.units["normal_force"],
                "stress": "MPa",
                "voltage": "V",
                "energy": self.units["stored_energy"],
            },
            "provenance": self.provenance,
        }
        if self._shows_total:
            whole = self.total.summary()
            found["total"] = {"depth": self.depth} | {key: whole[key] for key in ("last", "largest", "units")}
        return found

    def __repr__(self) -> str:
        """How far the run came, where it ended and with what forces."""
        last = self._last
        parts = last[:3], last[3:5], last[5:7], last[7:9], last[9:]
        lines = ["; ".join(f"{key} {text}" for key, text in part) for part in parts]
        lines[3] = f"over {self.depth:g} mm: {lines[3]}" if self._shows_total else lines[3]
        if (drift := self.load_drift) > DRIFT:
            lines.append(f"the load drifted by {drift:.1%} at a held indentation")
        return "\n  ".join([f"Result of {self._title}", *(line for line in lines if line)])

    def _repr_html_(self) -> str:
        """For notebooks: the end, and normal (blue) and tangential force (orange) over the steps."""
        forces = {
            "normal force": ("#0072B2", self.normal_force.tolist()),
            "tangential force": ("#E69F00", self.tangential_force.tolist()),
        }
        return table(f"Result of {self._title}", self._last, curves(forces) if len(self.step) > 1 else "")

    @property
    def _title(self) -> str:
        scene, steps = self.provenance.get("scene", {}), len(self.step)
        wanted = scene.get("total_steps", steps)
        text = f"{scene.get('name', 'scene')!r}: {steps} of {wanted} steps, {len(self.frames)} with fields"
        return f"{text}, {len(self.mesh.points)} nodes"

    @property
    def _last(self) -> list[tuple[str, str]]:
        if not len(self.step):
            return []
        return [*self._ends(self._shown), *(self.total._ends(SHOWN_WHOLE) if self._shows_total else [])]

    @property
    def _shown(self) -> tuple[str, ...]:
        return SHOWN_SPATIAL if self.in_space else SHOWN

    @property
    def _shows_total(self) -> bool:
        return self.depth is not None and WHOLE not in self.provenance and not self.in_space

    def _ends(self, names: Sequence[str]) -> list[tuple[str, str]]:
        """Columns of the last row, in words."""
        found = []
        for name in names:
            words = name.replace("_width", "_area") if self.units[name] == "mm2" else name
            found.append((words.replace("_", " "), f"{plus(self[name][-1]):.4g} {self.units[name]}"))
        return found

    def save(self, path: str | Path) -> None:
        """Write everything to one .npz file, in one step. Raises StorageError when the disk
        refuses.
        """
        arrays: dict[str, np.ndarray] = {"format": np.array(RESULT_FORMAT)}
        arrays |= {f"history/{name}": np.array(self[name]) for name in self.columns}
        for spec in fields(Frame):
            values = [getattr(frame, spec.name) for frame in self.frames]
            if values:
                arrays[f"frames/{spec.name}"] = np.stack([np.asarray(value) for value in values])
        arrays |= mesh_arrays(self.mesh)
        arrays["provenance"] = np.array(json.dumps(self.provenance))
        save_arrays(path, arrays)


def load(path: str | Path) -> Result:
    """Read what `Result.save` wrote. Raises InputError for any other, cut off or damaged file.

    A column that an older version did not write yet is NaN, or 0 if it counts something, unless it
    is one of `NEEDED`: a file without one of those is refused as of another version. No object is
    unpickled, and no more memory is taken than the file is long (at most 4 GB).
    """
    arrays = load_arrays(path, "result", RESULT_FORMAT)
    lacking = [f"history/{name}" for name in NEEDED if f"history/{name}" not in arrays]
    if lacking:
        given = f"{path}, of another version: without {', '.join(lacking)}"
        raise InputError("result", given, f"a file written by Result.save of evfem {evfem.__version__}")
    try:
        columns = {name: _column_of(arrays, name) for name in COLUMNS}
        mesh = mesh_of(arrays)
        in_space = {name: _column_of(arrays, name) for name in (SPATIAL if mesh.dim == 3 else ())}
        frames = _frames_from(arrays, mesh)
        provenance = json.loads(str(arrays["provenance"]))
        if len({len(column) for column in (*columns.values(), *in_space.values())}) > 1:
            raise ValueError("columns of different length")
        if not isinstance(provenance, dict):
            raise ValueError("no provenance")
        return Result(**columns, frames=frames, mesh=mesh, provenance=provenance, in_space=in_space)
    except (KeyError, ValueError, TypeError, IndexError, RecursionError) as error:
        raise InputError("result", f"{path}, damaged: {error}", "a file written by Result.save") from error


def _column_of(arrays: Mapping[str, np.ndarray], name: str) -> Any:
    column = arrays.get(f"history/{name}")
    if column is not None:
        return _checked_column(name, column)
    steps = len(arrays["history/step"])
    return np.zeros(steps, dtype=np.int64) if name in INTEGERS else np.full(steps, np.nan)


def _checked_column(name: str, column: np.ndarray) -> Any:
    kinds = "U" if name == "motion" else "iu" if name in INTEGERS else "f"
    if column.ndim != 1 or (column.size and column.dtype.kind not in kinds):
        raise ValueError(f"column {name}")
    return [str(kind) for kind in column] if name == "motion" else column


def _json(value: Any) -> Any:
    """The value itself, or None for a number that JSON does not know."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass(frozen=True)
class Saved:
    """What a checkpoint holds: the solver's state as arrays and the rows of the history so far."""

    arrays: dict[str, np.ndarray]
    rows: list[dict[str, Any]]


@dataclass(frozen=True)
class Checkpoint:
    """A file with the state after the last converged step of a run, from which the run can go on.

    The same object writes the rows of earlier steps again without making their text anew.
    """

    path: Path
    _texts: list[tuple[Row, str]] = field(default_factory=list, repr=False, compare=False)

    def write(self, scene_digest: str, arrays: Mapping[str, np.ndarray], rows: Sequence[Row]) -> None:
        """Store the state in one step; the file before stays as it is if the disk refuses
        (StorageError).
        """
        header = {"format": np.array(CHECKPOINT_FORMAT), "scene": np.array(scene_digest)}
        header["version"] = np.array(evfem.__version__)
        header["rows"] = np.array(self._text_of(rows))
        save_arrays(self.path, header | {f"state/{name}": np.asarray(a) for name, a in arrays.items()})

    def _text_of(self, rows: Sequence[Row]) -> str:
        """The rows as JSON."""
        pairs = zip(rows, self._texts, strict=False)
        same = next((i for i, (row, known) in enumerate(pairs) if row is not known[0]), len(self._texts))
        new = [(row, json.dumps({name: plain(v) for name, v in row.items()})) for row in rows[same:]]
        self._texts[same:] = new
        return f"[{', '.join(text for _, text in self._texts[: len(rows)])}]"

    def read(self, scene_digest: str) -> Saved:
        """The state of the same scene. Raises InputError for another scene's, another version's or
        a damaged file.
        """
        allowed = "a checkpoint of the same scene and version"
        arrays = load_arrays(self.path, "checkpoint", CHECKPOINT_FORMAT)
        try:
            owner, version = str(arrays["scene"]), str(arrays["version"])
            rows = json.loads(str(arrays["rows"]))
            odd = sorted({*COLUMNS} ^ {*rows[0]}) if rows and not columns_of(rows[0]) else []
            if owner == scene_digest and not odd:
                _check_rows(rows)
        except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
            raise InputError("checkpoint", f"{self.path}, damaged: {error}", allowed) from error
        if version != evfem.__version__:
            given = f"{self.path}, written by evfem {version[:40]!r}"
            raise InputError("checkpoint", given, f"a checkpoint of evfem {evfem.__version__}")
        if owner != scene_digest:
            raise InputError("checkpoint", f"{self.path}, {ANOTHER}", "the run of this scene")
        if odd:
            given = f"{self.path}, of another version: with missing or unknown columns {', '.join(odd)}"
            raise InputError("checkpoint", given, allowed)
        state = {key.removeprefix("state/"): a for key, a in arrays.items() if key.startswith("state/")}
        return Saved(state, rows)


def _check_rows(rows: Any) -> None:
    """Whether these are the rows of a history, from the first step on."""
    if not isinstance(rows, list) or not rows:
        raise ValueError("no rows")
    for step, row in enumerate(rows, 1):
        if not columns_of(row) or set(row) != set(rows[0]):
            raise ValueError(f"columns of row {step}")
        numbers = [value for name, value in row.items() if name != "motion"]
        if row["step"] != step or not isinstance(row["motion"], str):
            raise ValueError(f"row {step}")
        if not all(type(value) in (int, float) for value in numbers):
            raise ValueError(f"row {step}")
        if not all(math.isfinite(row[name]) for name in RESUMED):
            raise ValueError(f"row {step}")


def _frames_from(arrays: Mapping[str, np.ndarray], mesh: Mesh) -> list[Frame]:
    if "frames/step" not in arrays:
        return []
    columns = {spec.name: arrays[f"frames/{spec.name}"] for spec in fields(Frame)}
    size: dict[str, int] = {"N": len(mesh.points), "E": len(mesh.cells), "dim": mesh.dim}
    size["stresses"] = 6 if mesh.dim == 3 else 4
    count = len(columns["step"])
    for name, shape in _SHAPES.items():
        expected = (count, *(size[n] for n in shape))
        if columns[name].shape != expected:
            raise ValueError(f"{name} of shape {columns[name].shape} instead of {expected}")
    scalars = {"step": int, "time": float, "position": float}
    return [
        Frame(**{name: scalars[name](c[i]) if name in scalars else c[i] for name, c in columns.items()})
        for i in range(count)
    ]

"""What a run leaves behind: a history with one row per step, fields of some steps, and how it came
about.

Units mm, N/mm, MPa, V, s; energies in N (N mm per mm of depth). Files are .npz without pickled
objects.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from functools import cache
from importlib import metadata
from pathlib import Path
from platform import python_version
from typing import Any

import numpy as np

import evfem
from evfem.common.arrays import Floats, Ints
from evfem.common.checks import plain
from evfem.common.digest import digest
from evfem.common.storage import load_arrays, save_arrays
from evfem.common.tables import csv_text
from evfem.common.views import called, curves, table
from evfem.errors import InputError
from evfem.mesh.mesh import CELLS, KINDS, Mesh
from evfem.scene.scene import Scene

Row = Mapping[str, Any]
RESULT_FORMAT = "evfem-result-1"
CHECKPOINT_FORMAT = "evfem-checkpoint-4"
#: columns from which a run goes on
RESUMED = ("time", "position", "indentation", "voltage", "applied_force")
#: what is shown of the last step, with units
SHOWN = {"position": "mm", "indentation": "mm", "voltage": "V", "normal_force": "N/mm"}
SHOWN |= {"tangential_force": "N/mm", "electrostatic_force": "N/mm", "contact_width": "mm"}
INTEGERS = ("step", "motion_index", "substeps", "newton_iterations", "relaxations")
#: columns without which a saved result is none; where an older version did not write another one yet, it is
#: NaN, or 0 where it counts something
NEEDED = ("motion", "step", "motion_index", "substeps", "newton_iterations", *RESUMED)


@dataclass(frozen=True, eq=False)
class Frame:
    """Fields of one step on N nodes and E cells; tractions in MPa, lengths in mm.

    `gap` is NaN and tractions are 0 off the pad; `contact_status` 0 open, 1 stick, 2 slip.
    `cauchy_stress` holds the components xx, yy, zz, xy of the cell means; `J` is the volume ratio.
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


POINT_FIELDS = ("gap", "contact_pressure", "shear_traction", "electrostatic_traction", "contact_status")
CELL_FIELDS = ("von_mises", "cauchy_stress", "J")
_SHAPES: dict[str, tuple[str | int, ...]] = {
    "displacement": ("N", "dim"),
    **dict.fromkeys(POINT_FIELDS, ("N",)),
}
_SHAPES |= {"von_mises": ("E",), "cauchy_stress": ("E", 4), "J": ("E",)}


@dataclass(frozen=True, eq=False)
class Result:
    """Every column of the history as an array over the steps, the frames kept, the mesh and the
    provenance.

    A field before `frames` is a column of the history: of `COLUMNS`, of rows and `history.csv`, of
    saved results and checkpoints. `Ledger.row` computes its value; a whole number also stands in
    `INTEGERS`.

    `applied_force` is the downward force on the bone; `normal_force` and `tangential_force` are
    the sums of the contact forces on the finger, +y and -x components; `electrostatic_force` is
    the downward attraction.
    """

    step: Ints
    motion_index: Ints
    motion: list[str]
    time: Floats
    position: Floats
    indentation: Floats
    voltage: Floats
    applied_force: Floats
    applied_tangential_force: Floats
    normal_force: Floats
    tangential_force: Floats
    electrostatic_force: Floats
    electrostatic_force_x: Floats
    contact_width: Floats
    real_contact_width: Floats
    min_gap: Floats
    external_work: Floats
    electrostatic_work: Floats
    stored_energy: Floats
    friction_dissipation: Floats
    viscous_dissipation: Floats
    kinetic_energy: Floats
    integrator_dissipation: Floats
    snap_dissipation: Floats
    substeps: Ints
    newton_iterations: Ints
    relaxations: Ints
    seconds: Floats
    # a field before this line is a column of the history
    frames: list[Frame]
    mesh: Mesh
    provenance: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def from_rows(
        cls, rows: Sequence[Row], frames: Sequence[Frame], mesh: Mesh, provenance: dict[str, Any]
    ) -> Result:
        """A result from rows as the solver reports them; each row has exactly the keys of
        `COLUMNS`.
        """
        for row in rows:
            if set(row) != set(COLUMNS):
                odd = sorted(set(row) ^ set(COLUMNS))
                raise InputError("row", f"missing or unknown {odd}", ", ".join(COLUMNS))
        columns = {name: _column(name, [row[name] for row in rows]) for name in COLUMNS}
        return cls(**columns, frames=list(frames), mesh=mesh, provenance=provenance)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The history as one dictionary per step, plain Python numbers."""
        columns = [np.asarray(getattr(self, name)).tolist() for name in COLUMNS]
        return [dict(zip(COLUMNS, values, strict=True)) for values in zip(*columns, strict=True)]

    def summary(self) -> dict[str, Any]:
        """Sizes, the last row, extremes and costs, in plain numbers ready for JSON."""
        scene = self.provenance.get("scene", {})
        steps = len(self.step)
        extremes = {}
        if steps:
            peaks = ("normal_force", "tangential_force", "electrostatic_force", "contact_width")
            extremes = {name: float(np.max(np.abs(getattr(self, name)))) for name in peaks}
        return {
            "scene": scene.get("name", "scene"),
            "complete": steps == scene.get("total_steps", steps),
            "steps": steps,
            "requested_steps": scene.get("total_steps", steps),
            "nodes": len(self.mesh.points),
            "cells": len(self.mesh.cells),
            "kind": self.mesh.kind,
            "last": {name: _json(value) for name, value in self.rows[-1].items()} if steps else {},
            "largest": extremes,
            "substeps": int(self.substeps.sum()),
            "newton_iterations": int(self.newton_iterations.sum()),
            "relaxations": int(self.relaxations.sum()),
            "seconds": float(self.seconds.sum()),
            "units": {"length": "mm", "force": "N/mm", "stress": "MPa", "voltage": "V", "energy": "N"},
            "provenance": self.provenance,
        }

    def __repr__(self) -> str:
        """How far the run came, where it ended and with what forces."""
        last = self._last
        lines = ["; ".join(f"{key} {text}" for key, text in row) for row in (last[:3], last[3:5], last[5:])]
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
        return [
            (name.replace("_", " "), f"{getattr(self, name)[-1] + 0.0:.4g} {unit}")
            for name, unit in SHOWN.items()
        ]

    def save(self, path: str | Path) -> None:
        """Write everything to one .npz file, in one step. Raises StorageError when the disk
        refuses.
        """
        arrays: dict[str, np.ndarray] = {"format": np.array(RESULT_FORMAT)}
        arrays |= {f"history/{name}": np.array(getattr(self, name)) for name in COLUMNS}
        for spec in fields(Frame):
            values = [getattr(frame, spec.name) for frame in self.frames]
            if values:
                arrays[f"frames/{spec.name}"] = np.stack([np.asarray(value) for value in values])
        arrays |= _mesh_arrays(self.mesh)
        arrays["provenance"] = np.array(json.dumps(self.provenance))
        save_arrays(path, arrays)


_NAMES = [spec.name for spec in fields(Result)]
COLUMNS = tuple(_NAMES[: _NAMES.index("frames")])


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
        mesh = _mesh_from(arrays)
        frames = _frames_from(arrays, mesh)
        provenance = json.loads(str(arrays["provenance"]))
        if len({len(column) for column in columns.values()}) > 1:
            raise ValueError("columns of different length")
        if not isinstance(provenance, dict):
            raise ValueError("no provenance")
        return Result(**columns, frames=frames, mesh=mesh, provenance=provenance)
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


def csv_line(row: Row) -> str:
    """One row of history.csv with its line end; floats with every digit that counts.

    >>> csv_line(dict.fromkeys(COLUMNS, 0) | {"step": 1, "motion": "press", "voltage": 0.1})[:25]
    '1,0,press,0.0,0.0,0.0,0.1'
    """
    return csv_text([[_plain_value(name, row[name]) for name in COLUMNS]])


def csv_header() -> str:
    """The first line of history.csv."""
    return csv_text([COLUMNS])


def _plain_value(name: str, value: Any) -> str | int | float:
    if name == "motion":
        return str(value)
    return int(value) if name in INTEGERS else float(value)


def _column(name: str, values: list[Any]) -> Any:
    if name == "motion":
        return [str(value) for value in values]
    return np.array(values, dtype=np.int64 if name in INTEGERS else np.float64)


def _json(value: Any) -> Any:
    """The value itself, or None for a number that JSON does not know."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


@cache
def versions() -> dict[str, str]:
    """Versions of evfem, Python and the packages that compute, as far as they are installed."""
    found = {"evfem": evfem.__version__, "python": python_version()}
    for package in ("numpy", "scipy", "scikit-fem", "meshio", "numba", "pypardiso"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def origin() -> dict[str, Any]:
    """Versions and date, for the provenance of whatever is computed now."""
    return {"versions": dict(versions()), "date": datetime.now(UTC).isoformat(timespec="seconds")}


def provenance(scene: Scene, mesh: Mesh, solver: Mapping[str, Any]) -> dict[str, Any]:
    """Versions, parameters, fingerprints and the solver's own record, in plain values ready for
    JSON.

    `parameters` is the scene as TOML, or its representation where it holds a law or form of the
    user's own.
    """
    from evfem.scene.file import dump

    try:
        parameters = dump(scene)
    except InputError:
        parameters = called("Scene", {spec.name: getattr(scene, spec.name) for spec in fields(scene)})
    return {
        **origin(),
        "scene": {"name": scene.name, "digest": scene.digest(), "total_steps": scene.total_steps},
        "parameters": parameters,
        "mesh": {
            "digest": digest(mesh),
            "nodes": len(mesh.points),
            "cells": len(mesh.cells),
            "kind": mesh.kind,
        },
        "solver": dict(solver),
    }


@dataclass(frozen=True)
class Saved:
    """What a checkpoint holds: the solver's state as arrays and the rows of the history so far."""

    arrays: dict[str, np.ndarray]
    rows: list[dict[str, Any]]


@dataclass(frozen=True)
class Checkpoint:
    """A file with the state after the last converged step of a run, from which the run can go on."""

    path: Path

    def write(self, scene_digest: str, arrays: Mapping[str, np.ndarray], rows: Sequence[Row]) -> None:
        """Store the state in one step; the file before stays as it is if the disk refuses
        (StorageError).
        """
        header = {"format": np.array(CHECKPOINT_FORMAT), "scene": np.array(scene_digest)}
        header["version"] = np.array(evfem.__version__)
        plain_rows = [{name: plain(value) for name, value in row.items()} for row in rows]
        header["rows"] = np.array(json.dumps(plain_rows))
        save_arrays(self.path, header | {f"state/{name}": np.asarray(a) for name, a in arrays.items()})

    def read(self, scene_digest: str) -> Saved:
        """The state of the same scene. Raises InputError for another scene's, another version's or
        a damaged file.
        """
        allowed = "a checkpoint of the same scene and version"
        arrays = load_arrays(self.path, "checkpoint", CHECKPOINT_FORMAT)
        try:
            owner, version = str(arrays["scene"]), str(arrays["version"])
            rows = json.loads(str(arrays["rows"]))
            odd = sorted({*COLUMNS} ^ {*rows[0]}) if rows else []
            if owner == scene_digest and not odd:
                _check_rows(rows)
        except (KeyError, ValueError, TypeError, AttributeError, RecursionError) as error:
            raise InputError("checkpoint", f"{self.path}, damaged: {error}", allowed) from error
        if version != evfem.__version__:
            given = f"{self.path}, written by evfem {version[:40]!r}"
            raise InputError("checkpoint", given, f"a checkpoint of evfem {evfem.__version__}")
        if owner != scene_digest:
            raise InputError("checkpoint", f"{self.path}, written by another scene", allowed)
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
        if set(row) != set(COLUMNS):
            raise ValueError(f"columns of row {step}")
        numbers = [value for name, value in row.items() if name != "motion"]
        if row["step"] != step or not isinstance(row["motion"], str):
            raise ValueError(f"row {step}")
        if not all(type(value) in (int, float) for value in numbers):
            raise ValueError(f"row {step}")
        if not all(math.isfinite(row[name]) for name in RESUMED):
            raise ValueError(f"row {step}")


def _mesh_arrays(mesh: Mesh) -> dict[str, np.ndarray]:
    arrays = {"mesh/points": mesh.points, "mesh/cells": mesh.cells, "mesh/region": mesh.region}
    arrays |= {f"mesh/set/{name}": np.asarray(nodes) for name, nodes in mesh.node_sets.items()}
    return arrays | {
        "mesh/kind": np.array(mesh.kind),
        "mesh/region_names": np.array(json.dumps({name: int(i) for name, i in mesh.region_names.items()})),
    }


def _mesh_from(arrays: Mapping[str, np.ndarray]) -> Mesh:
    kind = str(arrays["mesh/kind"])
    if kind not in KINDS:
        raise ValueError("cells of an unknown kind")
    points, cells, region = (arrays[f"mesh/{name}"] for name in ("points", "cells", "region"))
    prefix = "mesh/set/"
    sets = {key.removeprefix(prefix): a for key, a in arrays.items() if key.startswith(prefix)}
    names = json.loads(str(arrays["mesh/region_names"]))
    if points.ndim != 2 or points.shape[1] != 2 or points.dtype.kind != "f":
        raise ValueError("points of the mesh")
    if region.ndim != 1 or cells.shape != (len(region), CELLS[kind].nodes) or region.dtype.kind not in "iu":
        raise ValueError("cells of the mesh")
    if not isinstance(names, dict) or not all(type(number) is int for number in names.values()):
        raise ValueError("names of regions")
    for nodes in (cells, *sets.values()):
        if nodes.dtype.kind not in "iu" or (nodes.size and not 0 <= nodes.min() <= nodes.max() < len(points)):
            raise ValueError("nodes that do not exist")
    return Mesh(points, cells, kind, region, names, sets)


def _frames_from(arrays: Mapping[str, np.ndarray], mesh: Mesh) -> list[Frame]:
    if "frames/step" not in arrays:
        return []
    columns = {spec.name: arrays[f"frames/{spec.name}"] for spec in fields(Frame)}
    size: dict[str | int, int] = {"N": len(mesh.points), "E": len(mesh.cells), "dim": mesh.dim}
    count = len(columns["step"])
    for name, shape in _SHAPES.items():
        expected = (count, *(size.get(n, n) for n in shape))
        if columns[name].shape != expected:
            raise ValueError(f"{name} of shape {columns[name].shape} instead of {expected}")
    scalars = {"step": int, "time": float, "position": float}
    return [
        Frame(**{name: scalars[name](c[i]) if name in scalars else c[i] for name, c in columns.items()})
        for i in range(count)
    ]

"""What a run leaves behind: a history with one row per step, fields of some steps, and how it came about.

Units mm, N/mm, MPa, V, s; energies in N (N mm per mm of depth); N, mm2 and mJ in `Result.total`.
Files are .npz without pickled objects.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

import evfem
from evfem.common.arrays import Floats, Ints, MadeLater
from evfem.common.storage import check_ending, load_arrays, save_arrays
from evfem.common.tables import dataset
from evfem.common.views import curves, plus, table
from evfem.errors import ABSENT, InputError
from evfem.mesh.archive import mesh_arrays, mesh_of
from evfem.mesh.mesh import Mesh
from evfem.scene.scene import Scene
from evfem.simulation.history import (
    ABOUT,
    COLUMNS,
    DRIFT,
    EVERY,
    KINDS,
    NEEDED,
    ROOM_COLUMNS,
    SHOWN,
    SPATIAL,
    SPATIAL_UNITS,
    UNITS,
    WHOLE_OF,
    WHOLE_UNITS,
    WIDTHS,
    FurtherColumns,
    History,
    Row,
    column_of,
    columns_of,
    load_drift,
    over_depth,
)
from evfem.simulation.history import (
    INTEGERS as INTEGERS,
)
from evfem.simulation.provenance import Told, sound
from evfem.simulation.provenance import provenance as provenance

#: components of a stress, in the plane without those across it
STRESSES = ("xx", "yy", "zz", "xy", "yz", "xz")
#: key of the provenance of a total, with its depth (mm)
WHOLE = "over_mm"
RESULT_FORMAT = "evfem-result-1"


@dataclass(frozen=True, eq=False)
class Frame(MadeLater):
    """Fields of one step on N nodes and E cells; tractions in MPa, lengths in mm.

    `gap` is NaN and tractions are 0 off the pad; `contact_status` 0 open, 1 stick, 2 slip. `cauchy_stress`
    holds xx, yy, zz, xy of the cell means, in three dimensions yz and xz too, where `shear_traction` is a
    magnitude; `J` is the volume ratio. Tractions are nodal forces over the current tributary lengths, of the
    full field over those of its columns. `surface_sink` is how far an elastic surface has sunk below a node.
    """

    step: int
    time: float
    position: float
    displacement: Floats = field(metadata={"shape": ("N", "dim")})
    gap: Floats = field(metadata={"shape": ("N",)})
    contact_pressure: Floats = field(metadata={"shape": ("N",)})
    shear_traction: Floats = field(metadata={"shape": ("N",)})
    electrostatic_traction: Floats = field(metadata={"shape": ("N",)})
    surface_sink: Floats = field(metadata={"shape": ("N",)})
    contact_status: Ints = field(metadata={"shape": ("N",)})
    von_mises: Floats = field(metadata={"shape": ("E",)})
    cauchy_stress: Floats = field(metadata={"shape": ("E", "stresses")})
    J: Floats = field(metadata={"shape": ("E",)})

    def __repr__(self) -> str:
        """Number of the step, position and size."""
        size = f"{len(self.displacement)} nodes, {len(self.J)} cells"
        return f"Frame of step {self.step} at {plus(self.position):.4g} mm, {plus(self.time):.4g} s: {size}"


_SHAPES: dict[str, tuple[str, ...]] = {
    spec.name: spec.metadata["shape"] for spec in fields(Frame) if spec.metadata
}
#: columns that are printed first
PLACES = ("position", "position_z", "indentation", "voltage")
#: of a warning in a printed result
WIDTH = 80
#: unit of a field that is not in MPa
FIELD_UNITS = {"displacement": "mm", "gap": "mm", "surface_sink": "mm", "contact_status": "", "J": ""}
#: size in a shape -> its name in a data set
DIMENSIONS = {"N": "node", "E": "cell", "dim": "axis", "stresses": "stress"}
POINT_FIELDS = tuple(name for name, shape in _SHAPES.items() if shape == ("N",))
#: fields of nodes that older versions did not write: they were 0
LATER_FIELDS = ("surface_sink",)


def stresses(dim: int) -> int:
    """Number of components of a stress that may differ from 0."""
    return 2 * dim


CELL_FIELDS = tuple(name for name, shape in _SHAPES.items() if shape[0] == "E")


@dataclass(frozen=True, eq=False)
class Result(History, FurtherColumns, Told):
    """Every column of the history as an array over the steps, the frames kept, the mesh and the provenance.

    Forces are per mm of depth; `total` has them in N where the scene says how deep the finger is.
    `applied_force` is the downward force on the bone; `normal_force` and `tangential_force` are the sums of
    the contact forces on the finger, +y and -x components; `electrostatic_force` is the downward attraction.

    Of a finger in three dimensions forces are in N, and `in_space` has its further columns
    (`SPATIAL`): `position_z`, components of forces along x and z, and the contact areas. There
    `tangential_force` and `applied_tangential_force` are along the direction of the last slide's
    angle (+x before the first), positive where a finger slides by a positive distance.

    `probes` has by name the histories at points requested by the scene (`evfem.scene.probes`).
    """

    frames: list[Frame]
    mesh: Mesh
    provenance: dict[str, Any] = field(default_factory=dict)
    in_space: Mapping[str, Floats] = field(default_factory=dict)
    in_rooms: Mapping[str, Floats] = field(default_factory=dict)
    probes: Mapping[str, Any] = field(default_factory=dict)
    simulated: Scene | None = None

    @classmethod
    def from_rows(
        cls,
        rows: Sequence[Row],
        frames: Sequence[Frame],
        mesh: Mesh,
        provenance: dict[str, Any],
        probes: Mapping[str, Any] | None = None,
        simulated: Scene | None = None,
    ) -> Result:
        """A result from rows as the solver reports them; each row has exactly the keys of `COLUMNS`."""
        for row in rows:
            if not columns_of(row):
                odd = sorted(set(row) ^ set(COLUMNS))
                raise InputError("row", f"missing or unknown {odd}", ", ".join(COLUMNS))
        columns = {name: column_of(name, [row[name] for row in rows]) for name in COLUMNS}
        further = EVERY[mesh.dim][len(COLUMNS) :]
        in_space = {name: column_of(name, [row[name] for row in rows]) for name in further}
        names = [name for name in (rows[0] if rows else ()) if name not in (*COLUMNS, *SPATIAL)]
        in_rooms = {name: column_of(name, [row[name] for row in rows]) for name in names}
        kept: dict[str, Any] = {"provenance": provenance, "in_space": in_space, "in_rooms": in_rooms}
        kept |= {"probes": probes or {}, "simulated": simulated}
        return cls(**columns, frames=list(frames), mesh=mesh, **kept)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns."""
        return (*COLUMNS, *self.in_space, *self.in_rooms)

    def __getitem__(self, name: str) -> Any:
        """A column by its name."""
        for further in (self.in_space, self.in_rooms):
            if name in further:
                return further[name]
        return getattr(self, name) if name in ROOM_COLUMNS else super().__getitem__(name)

    @property
    def units(self) -> Mapping[str, str]:
        """The unit of each column."""
        whole = bool(self.in_space) or WHOLE in self.provenance
        own = {name: WHOLE_OF.get(unit, unit) if whole else unit for name, unit, _ in self._room_columns}
        if self.in_space:
            return {**SPATIAL_UNITS, **own}
        return {**(WHOLE_UNITS if WHOLE in self.provenance else UNITS), **own}

    @property
    def _room_columns(self) -> list[tuple[str, str, str]]:
        """Name, unit per mm of depth and meaning of the columns of rooms that the package does not know."""
        return [tuple(one) for one in self.provenance.get("columns", [])]

    @property
    def total(self) -> Result:
        """This result over the whole `depth`: under the same names forces in N, widths as areas in
        mm2, works and energies in mJ; lengths, pressures and fields are as they were.

        ``result.total.rows``, ``.table()``, ``.to_csv(path)`` and the plots then have these units too.
        Raises InputError where the scene says no depth. A finger in three dimensions is whole.
        """
        if self.in_space or WHOLE in self.provenance:
            return self
        if (depth := self.depth) is None:
            raise InputError("depth", ABSENT, "a depth in mm, by Scene(depth=...) or depth in [finger]")
        columns = over_depth({name: self[name] for name in COLUMNS}, depth)
        longer = {name: depth if unit in WHOLE_OF else 1.0 for name, unit in self.units.items()}
        in_rooms = {name: longer.get(name, 1.0) * value for name, value in self.in_rooms.items()}
        about = {**self.provenance, WHOLE: depth}
        return replace(self, **columns, in_rooms=in_rooms, provenance=about)

    @property
    def load_drift(self) -> float:
        """Largest relative change of the load at held indentation after a press; 0 if it was held."""
        return load_drift(self.rows)

    @property
    def contact_area(self) -> Floats:
        """Gross contact area (mm2): in the plane `contact_width` times depth; InputError without a depth."""
        return self.in_space["contact_area"] if self.in_space else self.total.contact_width

    @property
    def real_contact_area(self) -> Floats:
        """Real contact area (mm2): in the plane `real_contact_width` times depth, or InputError."""
        return self.in_space["real_contact_area"] if self.in_space else self.total.real_contact_width

    def summary(self) -> dict[str, Any]:
        """Sizes, the last row, extremes and costs, in plain numbers ready for JSON."""
        scene = self.provenance.get("scene", {})
        steps = len(self.step)
        last, extremes = dict[str, Any](), dict[str, float]()
        if steps:
            last = self.rows[-1]
            last |= {name: None for name, v in last.items() if isinstance(v, float) and not math.isfinite(v)}
            peaks = (*self._shown_forces, "peak_contact_pressure")
            extremes = {name: float(np.max(np.abs(self[name]))) for name in peaks}
        found = {
            "scene": scene.get("name", "scene"),
            "complete": steps == scene.get("total_steps", steps),
            "steps": steps,
            "requested_steps": scene.get("total_steps", steps),
            "nodes": len(self.mesh.points),
            "cells": len(self.mesh.cells),
            "kind": self.mesh.kind,
            "last": last,
            "largest": extremes,
            "load_drift": self.load_drift,
            "warnings": self.warnings,
            "substeps": int(self.substeps.sum()),
            "newton_iterations": int(self.newton_iterations.sum()),
            "relaxations": int(self.relaxations.sum()),
            "jumps": int(self.jumps.sum()),
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
        """Number of steps, end position and end forces of the run."""
        last, at = self._last, len(PLACES) - (not self.in_space)
        parts = last[:at], last[at : at + 2], last[at + 2 : at + 4], last[at + 4 : at + 6], last[at + 6 :]
        lines = ["; ".join(f"{key} {text}" for key, text in part) for part in parts]
        lines[3] = f"over {self.depth:g} mm: {lines[3]}" if self._shows_total else lines[3]
        if (drift := self.load_drift) > DRIFT:
            lines.append(f"the load drifted by {drift:.1%} at a held indentation")
        lines += [part for said in self.warnings for part in wrap(said, WIDTH, subsequent_indent="  ")]
        return "\n  ".join([f"Result of {self._title}", *(line for line in lines if line)])

    def _repr_html_(self) -> str:
        """For notebooks: the end, and normal (blue) and tangential force (orange) over the steps."""
        colours = {"normal_force": "#0072B2", "tangential_force": "#E69F00"}
        forces = {name.replace("_", " "): (one, self[name].tolist()) for name, one in colours.items()}
        return table(f"Result of {self._title}", self._last, curves(forces) if len(self.step) > 1 else "")

    @property
    def _title(self) -> str:
        scene, steps = self.provenance.get("scene", {}), len(self.step)
        text = f"{scene.get('name', 'scene')!r}: {steps} of {scene.get('total_steps', steps)} steps"
        return f"{text}, {len(self.frames)} with fields, {len(self.mesh.points)} nodes"

    @property
    def _last(self) -> list[tuple[str, str]]:
        if not len(self.step):
            return []
        places = [name for name in PLACES if self.in_space or name not in SPATIAL]
        whole = self.total._ends(self._shown_forces) if self._shows_total else []
        return [*self._ends([*places, *self._shown_forces]), *whole]

    @property
    def _shown_forces(self) -> tuple[str, ...]:
        return tuple(name for name in SHOWN if name not in (WIDTHS if self.in_space else SPATIAL))

    @property
    def _shows_total(self) -> bool:
        return self.depth is not None and WHOLE not in self.provenance and not self.in_space

    def _ends(self, names: Sequence[str]) -> list[tuple[str, str]]:
        """Columns of the last row, in words."""
        units = {name: self.units[name] for name in names}
        words = [name.replace("_width", "_area") if units[name] == "mm2" else name for name in names]
        values = [f"{plus(self[name][-1]):.4g} {units[name]}" for name in names]
        return [(one.replace("_", " "), value) for one, value in zip(words, values, strict=True)]

    @property
    def meanings(self) -> dict[str, str]:
        """What each column is."""
        own = {name: meaning for name, _, meaning in self._room_columns}
        return {name: own[name] if name in own else str(ABOUT[name]["meaning"]) for name in self.columns}

    def to_xarray(self) -> Any:
        """The result as an `xarray.Dataset`: every column over `step`, the fields kept over `frame` (the
        number of its step) and `node` or `cell`, with `units` and `long_name`; positions of the undeformed
        nodes (mm) are the coordinates x, y and z. A field with the name of a column ends in `_of_nodes`.
        The histories of a probe are `probe_NAME_` and their name, over `step` and `probe_NAME_point`.

        Raises InputError where xarray is not installed (the extra `xarray`).
        """
        variables: dict[str, Any] = {
            name: ("step", self[name], {"units": self.units[name], "long_name": self.meanings[name]})
            for name in self.columns[1:]
        }
        for name, shape in _SHAPES.items() if self.frames else ():
            values = np.stack([np.asarray(getattr(frame, name)) for frame in self.frames])
            dims = ("frame", *(DIMENSIONS[size] for size in shape))
            words = {"units": FIELD_UNITS.get(name, "MPa"), "long_name": name.replace("_", " ")}
            variables[f"{name}_of_nodes" if name in variables else name] = (dims, values, words)
        for name, probe in self.probes.items():
            variables |= probe.variables(f"probe_{name}")
        axes = "xyz"[: self.mesh.dim]
        places = zip(axes, self.mesh.points.T, strict=True)
        coordinates = {
            "step": self.step,
            "frame": [frame.step for frame in self.frames],
            "axis": list(axes),
            "stress": list(STRESSES[: stresses(self.mesh.dim)]),
            "region": ("cell", self.mesh.region, {"names": json.dumps(dict(self.mesh.region_names))}),
            **{axis: ("node", place, {"units": "mm"}) for axis, place in places},
            **{axis: list("xyz") for axis in (("row", "column") if self.probes else ())},
        }
        return dataset(variables, coordinates, {"provenance": json.dumps(self.provenance)})

    def report(self, path: str | Path, checked: Any = None) -> None:
        """Write one page about the run, which needs no other file: see `evfem.report`."""
        evfem.report(self, path, checked)

    def save(self, path: str | Path) -> None:
        """Write one .npz file, in one step. Raises StorageError, and InputError for another ending."""
        check_ending(path, ".npz", "to_csv writes the history, export.paraview the fields")
        arrays: dict[str, np.ndarray] = {"format": np.array(RESULT_FORMAT)}
        arrays |= {f"history/{name}": np.array(self[name]) for name in self.columns}
        for spec in fields(Frame):
            values = [getattr(frame, spec.name) for frame in self.frames]
            if values:
                arrays[f"frames/{spec.name}"] = np.stack([np.asarray(value) for value in values])
        arrays |= mesh_arrays(self.mesh)
        for name, probe in self.probes.items():
            arrays |= {f"probes/{name}/{spec.name}": getattr(probe, spec.name) for spec in fields(probe)}
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
        in_space = {name: _column_of(arrays, name) for name in EVERY[mesh.dim][len(COLUMNS) :]}
        there = [key.removeprefix("history/") for key in arrays if key.startswith("history/")]
        names = [name for name in there if name not in (*COLUMNS, *SPATIAL)]
        in_rooms = {name: _column_of(arrays, name) for name in names}
        frames = _frames_from(arrays, mesh)
        provenance = sound(json.loads(str(arrays["provenance"])))
        if len({len(column) for column in (*columns.values(), *in_space.values(), *in_rooms.values())}) > 1:
            raise ValueError("columns of different length")
        probes = _probes_from(arrays, len(columns["step"]))
        kept: dict[str, Any] = {"provenance": provenance, "in_space": in_space, "in_rooms": in_rooms}
        kept["probes"] = probes
        return Result(**columns, frames=frames, mesh=mesh, **kept)
    except (KeyError, ValueError, TypeError, IndexError, RecursionError) as error:
        raise InputError("result", f"{path}, damaged: {error}", "a file written by Result.save") from error


def _probes_from(arrays: Mapping[str, np.ndarray], steps: int) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in dict.fromkeys(key.split("/")[1] for key in arrays if key.startswith("probes/")):
        from evfem.scene.probes import ProbeHistory

        own = {spec.name: arrays[f"probes/{name}/{spec.name}"] for spec in fields(ProbeHistory)}
        points = len(own["position"])
        for quantity, values in own.items():
            if values.dtype.kind != "f" or (quantity != "position" and values.shape[:2] != (steps, points)):
                raise ValueError(f"{quantity} of the probe {name}")
        found[name] = ProbeHistory(**own)
    return found


def _column_of(arrays: Mapping[str, np.ndarray], name: str) -> Any:
    kind, column = KINDS.get(name, float), arrays.get(f"history/{name}")
    if column is None:
        return np.full(len(arrays["history/step"]), 0 if kind is int else np.nan, dtype=kind)
    if column.ndim != 1 or (column.size and column.dtype.kind not in {str: "U", int: "iu", float: "f"}[kind]):
        raise ValueError(f"column {name}")
    return column.astype(str) if kind is str else column


@dataclass(frozen=True)
class Saved:
    """What a checkpoint holds: the solver's state as arrays and the rows of the history so far."""

    arrays: dict[str, np.ndarray]
    rows: list[dict[str, Any]]


def _frames_from(arrays: Mapping[str, np.ndarray], mesh: Mesh) -> list[Frame]:
    if "frames/step" not in arrays:
        return []
    none = {f"frames/{name}": np.zeros_like(arrays["frames/gap"]) for name in LATER_FIELDS}
    columns = {spec.name: (none | dict(arrays))[f"frames/{spec.name}"] for spec in fields(Frame)}
    size: dict[str, int] = {"N": len(mesh.points), "E": len(mesh.cells), "dim": mesh.dim}
    size["stresses"] = stresses(mesh.dim)
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

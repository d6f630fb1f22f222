"""ParaView series: one .vtu per step and a .pvd index that is valid after every step. Arrays for TouchSim.

Points are in the reference configuration (mm); displacement has three components, so that "Warp By
Vector" shows the deformed finger. Cells keep the VTK node order of the mesh.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.checks import Within, real
from evfem.common.storage import replacing, write_text
from evfem.errors import InputError
from evfem.mesh import file as meshfile
from evfem.mesh.mesh import Mesh
from evfem.mesh.split import nodal_means, split
from evfem.scene.scene import Scene
from evfem.simulation.result import CELL_FIELDS, LATER_FIELDS, POINT_FIELDS, Frame, Result, Row

#: what the files of a run may take (bytes) where the scene does not say how they are to be written
MOST = 25_000_000
#: largest ratio of compressed to uncompressed arrays; text and tags (bytes) of a file
COMPRESSED, TAGS = 0.6, 4_000
#: steps at which neither time nor position advances are told apart by this much (s or mm)
INSTANT = 1e-9


@dataclass(frozen=True)
class FieldFiles:
    """How the fields of a run are written, and how much they take.

    Every `every`-th step and the steps `ends`, in `single` or double precision, `compressed` or
    not: `number` files of `size` bytes in all, with compression at most.
    """

    every: int
    ends: frozenset[int]
    single: bool
    compressed: bool
    number: int
    size: int

    @classmethod
    def of(cls, scene: Scene, mesh: Mesh) -> FieldFiles:
        """What a scene says of its output, and for the rest what fits in 25 MB: double precision
        if it can be, then single, then fewer steps, but always the last one of each motion.

        >>> from evfem.scene.scene import default_scene
        >>> scene = default_scene()
        >>> print(FieldFiles.of(scene, scene.finger.mesh()))
        fields of every 4th step and the last of each motion, single precision: 29 files, 25 MB
        """
        output, steps = scene.output, scene.total_steps
        every, single = output.every or 1, output.precision == "single"
        sinks = scene.ground.elastic is not None
        lasts = accumulate(motion.steps for motion in scene.motion)
        ends = frozenset({steps} if output.every else lasts)

        def made() -> FieldFiles:
            number = len(ends.union(range(every, steps + 1, every)))
            size = number * frame_size(mesh, single, output.compression, sinks)
            return cls(every, ends, single, output.compression, number, size)

        if output.precision is None:
            single = made().size > MOST
        while output.every is None and made().size > MOST and every < steps:
            every += 1
        return made()

    def wants(self, step: int) -> bool:
        """Whether the fields of a step are written."""
        return step % self.every == 0 or step in self.ends

    def __str__(self) -> str:
        last = "last one" if len(self.ends) == 1 else "last of each motion"
        steps = "every step" if self.every == 1 else f"every {ordinal(self.every)} step and the {last}"
        how = f"{'single' if self.single else 'double'} precision"
        most = "compressed, at most " if self.compressed else ""
        return f"fields of {steps}, {how}: {self.number} files, {most}{self.size / 1e6:.0f} MB"


def ordinal(number: int) -> str:
    """The number of a thing in a row.

    >>> [ordinal(n) for n in (2, 3, 4, 11, 21, 112)]
    ['2nd', '3rd', '4th', '11th', '21st', '112th']
    """
    teens = number % 100 in (11, 12, 13)
    return f"{number}{'th' if teens else {1: 'st', 2: 'nd', 3: 'rd'}.get(number % 10, 'th')}"


def frame_size(mesh: Mesh, single: bool = False, compressed: bool = False, sinks: bool = False) -> int:
    """Size (bytes) of the file of one frame, except for its tags; with compression an upper bound. `sinks`:
    whether the surface is elastic.
    """
    real = 4 if single else 8
    stresses = 4 if mesh.dim == 2 else 6
    scalars = len(POINT_FIELDS) - 1 - (0 if sinks else len(LATER_FIELDS))
    nodes = len(mesh.points) * ((6 + scalars) * real + 1)  # a byte for the contact status
    cells = len(mesh.cells) * (
        4 * mesh.cells.shape[1] + 4 + 8 + 4 + (2 + stresses) * real
    )  # offset, type, region
    ratio = COMPRESSED if compressed else 1.0
    return round(ratio * (nodes + cells) * 4 / 3) + TAGS  # base64


def paraview(result: Result, path: str | Path, *, skin: bool = False, smooth: bool = False) -> Path:
    """Write the frames of `result` as a series: `path` (.pvd) and one .vtu for each frame beside
    it; of a finger in three dimensions the `skin` alone, if that is asked for.

    With `smooth` stresses stand at the points too (`nodal_von_mises`, `nodal_cauchy_stress`, `nodal_J`):
    means of the cells around them, within a region. Points where layers meet are there once for each.

    Returns the path of the index. Raises InputError for another ending, for the skin of a
    cross-section, and for a smooth skin; StorageError when the disk refuses.
    """
    if skin and smooth:
        raise InputError("smooth", "True, of a skin", "skin=True or smooth=True, in a series each")
    series = ParaViewSeries(path, skin=skin, smooth=smooth)
    rows = {row["step"]: row for row in result.rows}
    for frame in result.frames:
        series.add(rows[frame.step], frame, result.mesh)
    series.write_index()
    return series.path


def touchsim(
    result: Result, *, sample_rate: float = 5000.0, pin_radius: float | None = None
) -> dict[str, Any]:
    """Arrays for a stimulus of TouchSim, a model of afferents below an elastic half-space.

    Every node of the skin that the surface comes to is a pin, whose trace is how deep the surface stands in
    the undeformed skin there. Between frames it is linear in time, from nothing at time 0.

    Parameters
    ----------
    result
        A result whose frames have times, best one of every step.
    sample_rate
        Samples a second (Hz).
    pin_radius
        In mm; without it half the smallest distance of two pins, so that none overlap.

    Returns
    -------
    dict
        The arguments of `Stimulus` in Python's TouchSim (github.com/hsaal/touchsim): `trace` (pins, samples)
        in mm, `location` (pins, 2) in mm, of the undeformed nodes, x and z, in the plane z = 0; `fs` (Hz) and
        `pin_radius` (mm).

    Raises
    ------
    InputError
        Frames without time; a surface that comes to no skin; a rate or radius that is not positive.

    Notes
    -----
    TouchSim (doi:10.1073/pnas.1704856114) finds pressures of its own, of its own half-space. The pins of a
    section in the plane are a line: counts over an area need a finger in three dimensions.
    """
    rate = real("sample_rate", sample_rate, "a rate in Hz, from 1 to 1e6", Within(1.0, 1e6))
    time, depth = _stood(result)
    reached = np.flatnonzero((depth > 0.0).any(axis=0))
    if not reached.size:
        raise InputError("result", "a surface that comes to no skin", "a finger that is pressed on it")
    points = result.mesh.points[reached]
    location = np.column_stack(
        [points[:, 0], points[:, 2] if points.shape[1] == 3 else np.zeros(len(points))]
    )
    if pin_radius is None:
        pin_radius = 0.5 * _spacing(location)
    radius = real("pin_radius", pin_radius, "a radius in mm, larger than 0", Within(0.0, above=True))
    at = np.arange(int(np.floor(time[-1] * rate * (1.0 + 1e-12))) + 1) / rate
    trace = np.stack([np.interp(at, time, depth[:, node]) for node in reached])
    return {"trace": trace, "location": location, "fs": rate, "pin_radius": radius}


def _stood(result: Result) -> tuple[Floats, Floats]:
    """Times (T,) of the frames, from 0 on, and how deep the surface then stands in the skin (T, N)."""
    bone = result.mesh.node_sets["bone"][0]
    times, depths = [0.0], [np.zeros(len(result.mesh.points))]
    for frame in result.frames:
        # a touching node is where the surface is, an open one as far above it as its gap
        up = frame.displacement[:, 1] - frame.displacement[bone, 1]
        now = np.where(np.isfinite(frame.gap), np.maximum(up - np.nan_to_num(frame.gap), 0.0), 0.0)
        if frame.time > times[-1]:
            times.append(frame.time)
            depths.append(now)
        else:  # a motion without time: its end
            depths[-1] = now
    if len(times) < 2:
        raise InputError("result", "frames in which no time passes", "motions with a speed, or a Wait")
    return np.array(times), np.array(depths)


def _spacing(location: Floats) -> float:
    """Smallest distance (mm) of two of the points (P, 2); 0.1 of a single one."""
    from scipy.spatial import KDTree

    if len(location) < 2:
        return 0.1
    return float(KDTree(location).query(location, k=2)[0][:, 1].min())


def skin_of(mesh: Mesh) -> tuple[Mesh, Ints, Ints]:
    """The surface of the pad of hexahedra as a mesh of quads in space, its nodes (P,) in the solid's
    mesh, and the cell behind each face (K,).

    Raises InputError for the mesh of a cross-section.
    """
    if mesh.dim != 3:
        raise InputError("skin", f"the mesh of a cross-section ({mesh.kind})", "a finger in three dimensions")
    behind = np.nonzero(mesh.in_set("pad"))[0]
    outer = mesh.sides_of("pad")
    nodes, cells = np.unique(outer, return_inverse=True)
    kind = "quad" if mesh.order == 1 else "quad9"
    faces = cells.reshape(-1, outer.shape[1])
    return Mesh(mesh.points[nodes], faces, kind, mesh.region[behind], mesh.region_names), nodes, behind


def write_frame(
    mesh: Mesh,
    frame: Frame,
    path: str | Path,
    *,
    single: bool = False,
    compressed: bool = False,
    smooth: bool = False,
) -> None:
    """Write one step as a .vtu file: points, displacement and all fields of a `Frame`, `smooth` ones of the
    cells at the points too.

    Field data `region:NAME` hold the numbers of the regions, as in the files of `meshfile.write`.
    `single` precision halves the file.
    """
    import meshio
    from meshio.vtu import write as write_vtu

    def real(values: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(values, dtype=np.float32 if single else np.float64)

    point_data = {"displacement": real(meshfile.three(frame.displacement))}
    for name in POINT_FIELDS:
        if name not in LATER_FIELDS or getattr(frame, name).any():
            point_data[name] = real(getattr(frame, name))
    if smooth:
        point_data |= {f"nodal_{name}": real(nodal_means(mesh, getattr(frame, name))) for name in CELL_FIELDS}
    point_data["contact_status"] = np.asarray(frame.contact_status, dtype=np.int8)
    cell_data = {"region": [np.asarray(mesh.region, dtype=np.int32)]}
    cell_data |= {name: [real(getattr(frame, name))] for name in CELL_FIELDS}
    cells = np.asarray(mesh.cells, dtype=np.int32)
    grid = meshio.Mesh(real(meshfile.three(mesh.points)), [(mesh.kind, cells)], point_data, cell_data)
    with replacing(path) as temporary:
        write_vtu(str(temporary), grid, compression="zlib" if compressed else None)
        meshfile.add_region_names(temporary, mesh)


def frame_in(path: str | Path, row: Row, mesh: Mesh) -> Frame:
    """The fields that `write_frame` wrote of the step of a `row`, on the same mesh.

    Raises ValueError for any other file.
    """
    parts = meshfile.parts(Path(path))
    if len(parts.points) != len(mesh.points) or [block.type for block in parts.cells] != [mesh.kind]:
        raise ValueError(f"{path} on another mesh")
    data = {name: np.zeros(len(mesh.points)) for name in LATER_FIELDS} | parts.point_data
    nodal = {name: np.asarray(data[name]) for name in ("displacement", *POINT_FIELDS)}
    of_cells = {name: np.asarray(parts.cell_data[name][0], dtype=float) for name in CELL_FIELDS}
    values = {name: value.astype(int if name == "contact_status" else float) for name, value in nodal.items()}
    values["displacement"] = np.ascontiguousarray(values["displacement"][:, : mesh.dim])
    return Frame(row["step"], row["time"], row["position"], **values, **of_cells)


class ParaViewSeries:
    """Writes a series while a run goes on: an observer of `evfem.simulation.run`, or fed by `add`.

    Files are named after the index: fields.pvd, fields_00001.vtu, ... An entry's value is the time if time
    passes, else the position (`instants`). Files of `earlier` rows, of a run that is continued, stay in the
    index. `single` and `compressed` as in `write_frame`; with `skin` the pad's surface alone; with `smooth`
    regions that share no point, and their stresses at the points.
    """

    def __init__(
        self,
        path: str | Path,
        earlier: Sequence[Row] = (),
        *,
        single: bool = False,
        compressed: bool = False,
        skin: bool = False,
        smooth: bool = False,
    ) -> None:
        self.path = Path(path)
        self.single, self.compressed, self.skin, self.smooth = single, compressed, skin, smooth
        if self.path.suffix != ".pvd":
            raise InputError("path", str(path), "a file name that ends in .pvd")
        self._mesh: Mesh | None = None
        self.rows = [row for row in earlier if self.frame_path(int(row["step"])).exists()]

    def frame_path(self, step: int) -> Path:
        """File of the fields of a step."""
        return self.path.with_name(f"{self.path.stem}_{step:05d}.vtu")

    def started(self, mesh: Mesh, scene: object, total_steps: int) -> None:
        """Observer of `simulate`: the mesh is known."""
        self._mesh = mesh

    def step(self, row: Row, frame: Frame | None, checkpoint: object = None) -> None:
        """Observer of `simulate`: a step has converged; its fields and the new index go to disk."""
        if frame is not None and self._mesh is not None:
            self.add(row, frame, self._mesh)
            self.write_index()

    def add(self, row: Row, frame: Frame, mesh: Mesh) -> None:
        """Write the fields of one step; the index follows with `write_index`."""
        path = self.frame_path(frame.step)
        if self.skin:
            mesh, nodes, behind = skin_of(mesh)
            fields = {name: getattr(frame, name)[nodes] for name in ("displacement", *POINT_FIELDS)}
            frame = replace(frame, **fields, **{name: getattr(frame, name)[behind] for name in CELL_FIELDS})
        if self.smooth:
            mesh, nodes = split(mesh)
            frame = replace(
                frame, **{name: getattr(frame, name)[nodes] for name in ("displacement", *POINT_FIELDS)}
            )
        how = {"single": self.single, "compressed": self.compressed, "smooth": self.smooth}
        write_frame(mesh, frame, path, **how)
        self.rows = [old for old in self.rows if old["step"] < row["step"]] + [row]

    def write_index(self) -> None:
        """Write the .pvd file in one step; every file it names is complete."""
        stem = quoteattr(self.path.stem, {'"': "&quot;"})[1:-1]
        entries = "".join(
            f'    <DataSet timestep="{value!r}" part="0" file="{stem}_{int(row["step"]):05d}.vtu" />\n'
            for row, value in zip(self.rows, instants(self.rows), strict=True)
        )
        write_text(
            self.path,
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
            f"  <Collection>\n{entries}  </Collection>\n</VTKFile>\n",
        )


def instants(rows: Sequence[Mapping[str, Any]]) -> list[float]:
    """A strictly increasing value for each step, as ParaView needs: time, or distance travelled.

    Time (s) if any passes, else the distance travelled (mm), which on a slide towards +x is the
    position. Steps in which neither advances follow each other by 1e-9.

    >>> instants([{"time": 0.0, "position": x} for x in (0.0, 0.0, 0.5, 1.0)])
    [0.0, 1e-09, 0.5, 1.0]
    >>> instants([{"time": t, "position": 0.0} for t in (0.1, 0.2)])
    [0.1, 0.2]
    >>> instants([{"time": 0.0, "position": x, "position_z": 4.0} for x in (0.0, 3.0)])
    [4.0, 7.0]
    """
    values = np.array([float(row["time"]) for row in rows])
    if not values.any():
        values = np.array([float(row["position"]) for row in rows])
        along = np.array([float(row.get("position_z", 0.0)) for row in rows])
        if along.any() or np.any(np.diff(values) < 0.0):
            values = np.cumsum(np.hypot(np.diff(values, prepend=0.0), np.diff(along, prepend=0.0)))
    if (np.diff(values) >= 2.0 * INSTANT).all():
        return values.tolist()
    result: list[float] = []
    for value in values.tolist():
        result.append(max(value, result[-1] + INSTANT) if result else value)
    return result

"""Files of the full field for ParaView: potential at points, field in cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.storage import replacing
from evfem.errors import InputError
from evfem.field.rigid import FieldSolution
from evfem.mesh.file import three
from evfem.scene.scene import Scene
from evfem.simulation.model import make_model
from evfem.simulation.result import Result
from evfem.terms.fullfield import FieldAttraction


def full_field(solution: FieldSolution, path: str | Path) -> Path:
    """Write the field of a rigid outline as a .vtu file: `potential` (V) at points, `electric_field`
    (V/mm) in the middle of cells and `layer`, 0 in the slab and 1 in the air; lengths in mm.

    Raises InputError for another ending, StorageError when the disk refuses.
    """
    mesh, solved = solution.solved.space.mesh, solution.solved
    potential = solution.voltage * solved.phi[solved.space.basis.nodal_dofs[0]]
    field = -solution.voltage * solved.in_cells().T
    layer = 1 - mesh.in_slab.astype(int)
    return _write(path, mesh.points.T, mesh.cells.T, potential, field, layer)


def full_field_of_step(scene: Scene, result: Result, path: str | Path, step: int | None = None) -> Path:
    """Write the field below the pad of a run, in the deformed state of `step` (the last one with
    fields unless said): as `full_field`, with `layer` 0 in the insulator, 1 in the air, 2 in the skin.

    `scene` is the one that `result` was computed from. Raises InputError for scenes without full
    field or with rough faces, whose gap depends on contact forces, and for steps without fields.
    """
    frames = {frame.step: frame for frame in result.frames}
    step = max(frames, default=0) if step is None else step
    if step not in frames:
        raise InputError("step", step, "a step whose fields are kept: " + ", ".join(map(str, frames)))
    model = make_model(scene)
    attraction = model.attraction
    if not isinstance(attraction, FieldAttraction) or not attraction.has_energy:
        raise InputError("scene", f"field {scene.field!r}", "one with the full field and smooth faces")
    pad = model.pad.nodes
    position = model.mesh.points[pad] + frames[step].displacement[pad]
    x, levels = attraction.outline(attraction.bare(position), attraction.visible(position))
    found = attraction.solve(position)
    voltage = next(float(row["voltage"]) for row in result.rows if row["step"] == step)
    lines, rows = found.phi.shape
    points = np.stack([np.broadcast_to(x[:, None], found.y.shape), found.y], axis=-1).reshape(-1, 2)
    cells = _grid(lines, rows)
    potential = voltage * found.phi.ravel()
    middle = points[cells].mean(axis=1)
    at = [np.interp(middle[:, 0], x, level) for level in levels[1:-1]]
    layer = np.sum(middle[:, 1] > np.array(at), axis=0)
    return _write(path, points, cells, potential, -_gradients(points[cells], potential[cells]), layer)


def _grid(lines: int, rows: int) -> Ints:
    """Quads (m, 4) of points numbered along lines."""
    first = (np.arange(lines - 1)[:, None] * rows + np.arange(rows - 1)).ravel()
    return np.stack([first, first + rows, first + rows + 1, first + 1], axis=1)


def _gradients(corners: Floats, values: Floats) -> Floats:
    """Gradients (m, 2) in the middle of quads (m, 4, 2) of values at their corners (m, 4).

    >>> square = np.array([[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]])
    >>> _gradients(square, np.array([[0.0, 2.0, 5.0, 3.0]])).tolist()
    [[1.0, 3.0]]
    """
    slopes = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])
    return np.asarray(np.linalg.solve(slopes @ corners, (values @ slopes.T)[..., None])[..., 0])


def _write(path: str | Path, points: Floats, cells: Ints, potential: Floats, field: Floats,
           layer: Ints) -> Path:  # fmt: skip
    import meshio
    from meshio.vtu import write as write_vtu

    path = Path(path)
    if path.suffix != ".vtu":
        raise InputError("path", str(path), "a file name that ends in .vtu")
    data = {"electric_field": [three(field)], "layer": [layer.astype(np.int32)]}
    quads = [("quad", np.ascontiguousarray(cells, dtype=np.int32))]
    grid = meshio.Mesh(np.ascontiguousarray(three(points)), quads, {"potential": potential}, data)
    with replacing(path) as temporary:
        write_vtu(str(temporary), grid, compression=None)
    return path

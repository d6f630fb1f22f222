"""A user's mesh in, any finger mesh out: names, encoding and checks.

Encoding of `.vtu` files: integer cell data `region`, point data `pad`, `bone`, `nail` ...
(nonzero: belongs). Files written here also carry the names of the regions as field data
(`region:NAME` = number), so that no table is needed to read them back. Other formats:
`evfem.mesh.groups`.

Files are read by meshio, which knows no limits, and what it reads in part by `evfem.mesh.formats`: `parts`
bounds the file's size and turns all that is raised into one reason. A small file that was made to fill the
memory still may: see docs/commandline.md, "Nothing is trusted".
"""

from __future__ import annotations

import contextlib
import functools
import io
import os
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Ints
from evfem.common.storage import replacing
from evfem.errors import InputError, StorageError
from evfem.mesh import places
from evfem.mesh.groups import (
    NUMBERS,
    PHYSICAL,
    PREFIX,
    body_of,
    dimension_of,
    groups_in,
    regions_in,
    sets_in,
    unused_in,
)
from evfem.mesh.mesh import KINDS, Mesh
from evfem.mesh.quality import named, sound

if TYPE_CHECKING:
    import meshio

#: largest mesh file that is read, in bytes
LARGEST = 128 * 2**20
#: kinds of VTK's images -> what they are, with its nodes in order
PIXELS: Mapping[str, tuple[str, list[int]]] = {
    "pixel": ("quad", [0, 1, 3, 2]),
    "voxel": ("hexahedron", [0, 1, 3, 2, 4, 5, 7, 6]),
}
#: endings of the files that a module of `evfem.mesh.formats` reads
FORMATS: Mapping[str, str] = {
    ".inp": "abaqus",
    **dict.fromkeys((".e", ".exo", ".ex2", ".g", ".gen"), "exodus"),
    ".med": "med",
    **dict.fromkeys((".mesh", ".meshb"), "medit"),
    ".msh": "gmsh",
    **dict.fromkeys((".bdf", ".fem", ".nas"), "nastran"),
    ".su2": "su2",
    **dict.fromkeys((".vtk", ".vtu"), "vtk"),
    **dict.fromkeys((".xdmf", ".xmf"), "xdmf"),
}
#: the document type of FEniCSx, which declares nothing
DOCTYPE = re.compile(rb'<!DOCTYPE\s+Xdmf\s+SYSTEM\s+"Xdmf\.dtd"\s*(\[\s*\]\s*)?>')
#: counts of nodes and cells that Gmsh and VTK take memory for before they read on; each has a byte at least
COUNTS = re.compile(rb"^(?:\$(?:Nodes|Elements)\s+|POINTS |CELLS |CELL_TYPES )(\d{1,20})\s", re.MULTILINE)
#: how a file begins that Git LFS (version 1 of its pointers) has not fetched
POINTER = b"version https://git-lfs"
#: kinds that are refused for what they lack
_TETRAHEDRA = "Gmsh makes hexahedra of tetrahedra and wedges: docs/howto/mesh.md, From tetrahedra"
LACKING: Mapping[str, str] = {
    "quad8": "quad8 has no middle node: export quad9 or quad",
    "hexahedron20": "a pressure pulls at the corners of hexahedron20's faces, which contact cannot: export "
    "hexahedron27 or hexahedron",
    **dict.fromkeys(("tetra", "tetra10", "wedge", "pyramid"), _TETRAHEDRA),
}


def read(
    path: str | os.PathLike[str],
    regions: Mapping[str, Any] | None = None,
    boundaries: Mapping[str, Any] | None = None,
) -> Mesh:
    """The checked mesh, in mm, of a file of at most 128 MB that meshio reads: `.vtu`, `.msh` and
    others.

    `regions` maps a name to the name or number of a group of cells in the file, or to a place; it is not
    needed where each cell is in one group with a name. `boundaries` does it for sets of nodes. Nodes keep the
    numbers of the file, cells are turned counter-clockwise. Raises `InputError` naming `finger.mesh`,
    `finger.regions` or `finger.boundaries` for everything that cannot be a finger.
    """
    path = Path(path)
    return finger_of(path, _read(path), regions, boundaries)


def finger_of(
    path: Path, raw: meshio.Mesh, regions: Mapping[str, Any] | None, boundaries: Mapping[str, Any] | None
) -> Mesh:
    """The checked mesh of what was read of a file or is in memory; messages call it `path.name`."""
    body = body_of(raw)
    solid = [k for k, one in enumerate(raw.cells) if dimension_of(one.type, body) >= body and len(one)]
    kind = _one_kind(path, [raw.cells[k].type for k in solid])
    cells = np.vstack([raw.cells[k].data for k in solid]).astype(np.int64)
    try:
        groups = groups_in(raw)
    except ValueError as error:
        raise InputError("finger.mesh", f"{path.name} with {error}", "one integer per cell") from None
    points = raw.points.astype(float) if body == 3 else _plane(path, raw.points)
    mesh = Mesh(points, cells, kind, np.zeros(len(cells), np.int64), {})
    sizes = {k: len(raw.cells[k]) for k in solid}
    groups, regions = places.with_regions(groups, sizes, regions or {}, mesh)
    texts = [f"{one} as texts" for one in getattr(raw, "texts", ()) if one in NUMBERS]
    region, region_names = regions_in(path, groups, sizes, regions, [*raw.cell_data, *texts])
    mesh = sound(replace(mesh, region=region, region_names=region_names), path.name)
    below = [one for one in groups if one.block not in solid]
    sets = sets_in(path, raw, below, boundaries, functools.partial(places.nodes_at, mesh))
    return named(replace(mesh, node_sets=sets), path.name, unused_in(raw, groups, sets))


def _read(path: Path) -> meshio.Mesh:
    if not path.is_file():
        raise InputError("finger.mesh", path.name, "a mesh file that exists")
    try:
        raw = parts(path)
    except ValueError as error:
        allowed = "a readable mesh file: .vtu, .msh with physical groups, or another format of meshio's"
        raise InputError("finger.mesh", f"{path.name} ({error})", allowed) from error
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror or error}") from error
    return without_pixels(raw)


def teach_pixels(meshio: Any) -> None:
    """Tell the module of voxels, which it does not know, and of pixels, which it knows by name alone."""
    meshio._vtk_common.vtk_to_meshio_type[11] = "voxel"
    meshio._common.num_nodes_per_cell.update(pixel=4, voxel=8)
    meshio._mesh.topological_dimension.update(pixel=2, voxel=3)


def without_pixels(raw: meshio.Mesh) -> meshio.Mesh:
    """The same mesh, the cells of an image as quads and hexahedra."""
    for block in raw.cells:
        if block.type in PIXELS:
            block.type, order = PIXELS[block.type]
            block.data = block.data[:, order]
    return raw


def parts(path: Path) -> meshio.Mesh:
    """What is read of a file, as meshio has it: points, cells, data. Physical groups have positive numbers.

    Raises ValueError with a reason on one line for whatever meshio cannot read, OSError when the
    disk refuses.
    """
    if path.stat().st_size > LARGEST:
        raise ValueError(f"more than {LARGEST // 2**20} MB")
    ending = path.suffix.lower()
    _guard(path.read_bytes())
    import meshio

    if ending not in meshio.extension_to_filetypes and ending not in FORMATS:
        raise ValueError(f"no format {path.suffix or 'without an ending'} is known")
    said = io.StringIO()
    teach_pixels(meshio)
    # its messages are not searched for words to colour, which takes long in long ones
    console = meshio._common.Console
    meshio._common.Console = functools.partial(getattr(console, "func", console), highlighter=None)
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read")  # no number
            warnings.simplefilter("error", RuntimeWarning)  # numbers out of range
            known = import_module(f"evfem.mesh.formats.{FORMATS[ending]}") if ending in FORMATS else meshio
            raw = known.read(path)
        check_numbers(raw)
    except (Exception, SystemExit) as error:  # its readers raise anything, and leave where the file is wrong
        raise ValueError(_reason(error, said.getvalue(), path)) from error
    return raw


def _guard(content: bytes) -> None:
    """Refuse XML that declares a type of document or entities, wherever it does, in every coding, what stands
    for a file in a repository, and counts that no file of this length has.
    """
    if content.startswith(POINTER):
        raise ValueError("a pointer of Git LFS, not the file: git lfs pull")
    if max(map(int, COUNTS.findall(content)), default=0) > len(content):
        raise ValueError("it declares more nodes or cells than it has bytes")
    declared = b"<!ENTITY" in content or b"<!DOCTYPE" in DOCTYPE.sub(b"", content, count=1)
    if declared or content.startswith((b"\xff\xfe", b"\xfe\xff", b"<\0", b"\0<")):
        raise ValueError("a document type, or no UTF-8 text")


def check_numbers(raw: meshio.Mesh) -> None:
    """Raise ValueError for points of another dimension, for cells of another number of nodes than their kind
    has, and for cells and sets of nodes that do not exist.
    """
    import meshio

    widths = meshio._common.num_nodes_per_cell
    if raw.points.ndim != 2 or raw.points.shape[1] not in (2, 3):
        raise ValueError("no points in the plane or in space")
    for block in raw.cells:
        width = np.shape(block.data)[1:]
        if len(block) and width != (widths.get(block.type, *width),):
            raise ValueError(f"cells of the kind {block.type} with {width[-1]} nodes")
        if len(block) and not 0 <= np.min(block.data) <= np.max(block.data) < len(raw.points):
            raise ValueError("cells of nodes that do not exist")
    for nodes in raw.point_sets.values():
        if len(nodes) and not 0 <= np.min(nodes) <= np.max(nodes) < len(raw.points):
            raise ValueError("sets of nodes that do not exist")


def _reason(error: BaseException, said: str, path: Path) -> str:
    """Why meshio could not read a file, on one line, without the folder."""
    reason = (said if isinstance(error, SystemExit) else str(error)).replace(str(path), path.name)
    reason = re.sub(r"\b(Warning|Error): ", "", reason)  # as meshio prints them
    if isinstance(error, ModuleNotFoundError):
        reason = f"a format that needs {error.name}: pip install 'evfem[meshes]'"
    elif isinstance(error, KeyError):
        reason = f"{error.args[0]}, which is missing or not known"
    if PHYSICAL in reason:
        reason = "version 4.1 with elements outside of physical groups: save with Mesh.SaveAll = 0"
    return " ".join(reason.split())[:200] or "damaged, or of a kind that is not known"


def _one_kind(path: Path, kinds: list[str]) -> str:
    found = sorted(set(kinds))
    if len(found) == 1 and found[0] in KINDS:
        return found[0]
    allowed = f"cells of one kind: {', '.join(KINDS[:-1])} or {KINDS[-1]}"
    allowed += "".join(f" ({why})" for why in dict.fromkeys(LACKING[n] for n in found if n in LACKING))
    problem = f"{path.name} with " + (" and ".join(found) if found else "no two-dimensional") + " cells"
    raise InputError("finger.mesh", problem, allowed)


def _plane(path: Path, points: np.ndarray) -> np.ndarray:
    """x and y of points (N, 2 or 3): a finger in the plane has no z, and one that varies is refused."""
    points = np.asarray(points, dtype=float)
    extent = np.ptp(points[:, :2], axis=0).max() if len(points) else 0.0
    if points.shape[1] == 3 and len(points) and np.ptp(points[:, 2]) > places.SAME * extent:
        problem = f"{path.name} with z from {points[:, 2].min():g} to {points[:, 2].max():g}"
        raise InputError("finger.mesh", problem, "a plane mesh: the same z everywhere")
    return np.ascontiguousarray(points[:, :2])


def write(mesh: Mesh, path: str | os.PathLike[str]) -> None:
    """Write `.vtu` (binary, uncompressed) or `.msh` (2.2, named physical groups), the whole file or nothing.

    Raises `InputError` for a format that cannot carry the names, `StorageError` if the file cannot be made.
    """
    path = Path(path)
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise InputError(
            "--out",
            path.name,
            "a file that ends with "
            + " or ".join(WRITERS)
            + " (other formats cannot carry the names of regions and boundaries)",
        )
    with replacing(path) as temporary, contextlib.redirect_stderr(io.StringIO()):
        writer(mesh, temporary)


def three(vectors: np.ndarray) -> np.ndarray:
    """Vectors (N, 2 or 3) with three components."""
    if vectors.shape[1] == 3:
        return vectors
    return np.column_stack([vectors, np.zeros(len(vectors))])


def _write_vtu(mesh: Mesh, path: Path) -> None:
    import meshio

    point_data = {}
    for name, nodes in mesh.node_sets.items():
        point_data[name] = np.zeros(len(mesh.points), dtype=np.uint8)
        point_data[name][nodes] = 1
    out = meshio.Mesh(
        three(mesh.points),
        [(mesh.kind, mesh.cells.astype(np.int32))],
        point_data,
        {"region": [mesh.region.astype(np.int32)]},
    )
    out.write(path, file_format="vtu", compression=None)
    add_region_names(path, mesh)


def add_region_names(path: Path, mesh: Mesh) -> None:
    """Put the names of the regions into an uncompressed `.vtu` file, as field data `region:NAME` = number.

    The bytes are patched because meshio reads field data of this format but does not write them.
    """
    form = '<DataArray type="Int32" Name="{}{}" NumberOfTuples="1" format="ascii">{}</DataArray>'
    arrays = "".join(form.format(PREFIX, name, number) for name, number in mesh.region_names.items())
    tag = b"<UnstructuredGrid>"
    path.write_bytes(path.read_bytes().replace(tag, tag + f"<FieldData>{arrays}</FieldData>".encode(), 1))


def _write_msh(mesh: Mesh, path: Path) -> None:
    """Gmsh's 2.2, with a physical group for each region and for each set of outer edges or faces.

    The names are patched into the bytes because meshio keeps one group per name, while `nail` is
    both a region and a boundary.
    """
    import meshio

    below = {2: ("line", "line3"), 3: ("quad", "quad9")}[mesh.dim][mesh.order - 1]
    numbers = {name: i for i, name in enumerate(mesh.region_names, 1)}
    table = np.zeros(max(mesh.region_names.values()) + 1, dtype=np.int32)
    for name, number in mesh.region_names.items():
        table[number] = numbers[name]
    blocks, tags = [(mesh.kind, mesh.cells)], [table[mesh.region]]
    names = [f'{mesh.dim} {i} "{name}"' for name, i in numbers.items()]
    for i, name in enumerate(mesh.node_sets, len(numbers) + 1):
        facets = _all_facets(mesh, name)
        blocks.append((below, facets))
        tags.append(np.full(len(facets), i, dtype=np.int32))
        names.insert(0, f'{mesh.dim - 1} {i} "{name}"')
    data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
    meshio.Mesh(three(mesh.points), blocks, cell_data=data).write(path, file_format="gmsh22", binary=False)
    head = b"$EndMeshFormat\n"
    text = f"$PhysicalNames\n{len(names)}\n" + "\n".join(names) + "\n$EndPhysicalNames\n"
    path.write_bytes(path.read_bytes().replace(head, head + text.encode(), 1))


def _all_facets(mesh: Mesh, name: str) -> Ints:
    """The outer edges or faces of a set."""
    facets = mesh.sides_of(name)
    lost = np.setdiff1d(mesh.node_sets[name], facets)
    if len(lost):
        facet = "edge" if mesh.dim == 2 else "face"
        problem = f"a .msh file for the set {name} with node {lost[0]}, which no outer {facet} of the set has"
        raise InputError(
            "--out", problem, f".vtu, which carries sets of nodes (.msh: sets of outer {facet}s)"
        )
    return facets


WRITERS: Mapping[str, Callable[[Mesh, Path], None]] = {".vtu": _write_vtu, ".msh": _write_msh}

"""A user's mesh in, any finger mesh out: names, encoding and checks.

Encoding of `.vtu` files: integer cell data `region`, point data `pad`, `bone`, `nail` ... (nonzero: belongs).
Files written here also carry the names of the regions as field data (`region:NAME` = number), so that no
table is needed to read them back. Encoding of `.msh` files: physical groups of surfaces (regions) and of
lines or points (sets of nodes), or of volumes and surfaces.

Files are read by meshio, which knows no limits: `parts` bounds the file's size and turns all it
raises into one reason. A small file that was made to fill the memory still may: see
docs/commandline.md, "Nothing is trusted".
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evfem.common.arrays import Ints
from evfem.common.storage import replacing
from evfem.errors import InputError, StorageError
from evfem.mesh.mesh import CELLS, KINDS, Mesh
from evfem.mesh.quality import check

if TYPE_CHECKING:
    import meshio

#: largest mesh file that is read, in bytes
LARGEST = 128 * 2**20
#: meshio's name of the numbers of physical groups
PHYSICAL = "gmsh:physical"
#: Prefix of the field data that carry the names of regions in a `.vtu` file.
PREFIX = "region:"

#: what cells of a dimension are in physical groups of
GROUPS: Mapping[int, str] = {2: "surface", 3: "volume"}
#: kinds that are refused for what they lack
LACKING: Mapping[str, str] = {
    "quad8": "quad8 has no middle node: export quad9 or quad",
    "hexahedron20": "a pressure pulls at the corners of hexahedron20's faces, which contact cannot: export "
    "hexahedron27 or hexahedron",
}

_Names = dict[tuple[int, int], str]


def read(path: str | os.PathLike[str], regions: Mapping[str, int] | None = None) -> Mesh:
    """The checked mesh, in mm, of a file of at most 128 MB that meshio reads: `.vtu`, `.msh` and others.

    `regions` maps a name to its number in the cell data `region`; it is not needed for physical
    groups of gmsh or for files that `write` made. Nodes keep the numbers of the file, cells are
    turned counter-clockwise. Raises `InputError` naming `finger.mesh` or `finger.regions` for
    everything that cannot be a finger.
    """
    path = Path(path)
    raw, names = _read(path)
    body = _body(raw)
    solid = [k for k, one in enumerate(raw.cells) if _dimension(one.type, body) >= body and len(one)]
    kind = _one_kind(path, [raw.cells[k].type for k in solid])
    cells = np.vstack([raw.cells[k].data for k in solid]).astype(np.int64)
    if names:
        region, region_names = _groups(path, raw, solid, names, body)
        sets = _group_sets(raw, names, body)
    else:
        region, region_names = _numbers(path, raw, solid, regions)
        sets = {}
    sets.update(_point_sets(path, raw))
    points = raw.points.astype(float) if body == 3 else _plane(path, raw.points)
    mesh = Mesh(points, cells, kind, region, region_names, sets)
    return check(mesh, str(path))


def _read(path: Path) -> tuple[meshio.Mesh, _Names]:
    if not path.is_file():
        raise InputError("finger.mesh", str(path), "a mesh file that exists")
    try:
        raw = parts(path)
        return raw, _physical_names(path.read_bytes()) if path.suffix.lower() == ".msh" else {}
    except ValueError as error:
        allowed = "a readable mesh file: .vtu, .msh with physical groups, or another format of meshio's"
        raise InputError("finger.mesh", f"{path} ({error})", allowed) from error
    except OSError as error:
        raise StorageError(f"cannot read {path}: {error.strerror or error}") from error


def parts(path: Path) -> meshio.Mesh:
    """What meshio reads of a file: points, cells, data. Physical groups have positive numbers.

    Raises ValueError with a reason on one line for whatever meshio cannot read, OSError when the
    disk refuses.
    """
    if path.stat().st_size > LARGEST:
        raise ValueError(f"more than {LARGEST // 2**20} MB")
    with path.open("rb") as file:
        start = file.read(1000)
    if b"<!DOCTYPE" in start or b"<!ENTITY" in start or start.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise ValueError("a document type, or no UTF-8 text")
    import meshio

    if path.suffix.lower() not in meshio.extension_to_filetypes:
        raise ValueError(f"meshio knows no format {path.suffix or 'without an ending'}")
    said = io.StringIO()
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read")  # no number
            warnings.simplefilter("error", RuntimeWarning)  # numbers out of range
            raw = meshio.read(path)
        if raw.points.ndim != 2 or raw.points.shape[1] not in (2, 3):
            raise ValueError("no points in the plane or in space")
        for block in raw.cells:
            if len(block) and not 0 <= np.min(block.data) <= np.max(block.data) < len(raw.points):
                raise ValueError("cells of nodes that do not exist")
    except (Exception, SystemExit) as error:  # its readers raise anything, and leave where the file is wrong
        raise ValueError(_reason(error, said.getvalue())) from error
    return raw


def _reason(error: BaseException, said: str) -> str:
    """Why meshio could not read a file, on one line."""
    reason = said if isinstance(error, SystemExit) else str(error)
    if isinstance(error, KeyError):
        reason = f"unknown or missing: {reason}"
    if PHYSICAL in reason:
        reason = "version 4.1 with elements outside of physical groups: save without them, or as 2.2"
    return " ".join(reason.split())[:200] or "damaged, or of a kind that meshio does not know"


def _physical_names(content: bytes) -> _Names:
    """(dimension, number) -> name: meshio keeps one group per name, but `nail` may be a region and
    a boundary.
    """
    section = re.search(rb"\$PhysicalNames\s(.*?)\$EndPhysicalNames", content, re.DOTALL)
    row = re.compile(rb'^\s*([0-3])\s+(\d{1,9})\s+"(.*)"\s*$', re.MULTILINE)
    rows = row.findall(section[1]) if section else []
    return {(int(dimension), int(number)): name.decode(errors="replace") for dimension, number, name in rows}


def _one_kind(path: Path, kinds: list[str]) -> str:
    found = sorted(set(kinds))
    if len(found) == 1 and found[0] in KINDS:
        return found[0]
    allowed = f"cells of one kind: {', '.join(KINDS[:-1])} or {KINDS[-1]}"
    allowed += "".join(f" ({LACKING[name]})" for name in found if name in LACKING)
    given = f"{path} with " + (" and ".join(found) if found else "no two-dimensional") + " cells"
    raise InputError("finger.mesh", given, allowed)


def _body(raw: meshio.Mesh) -> int:
    """Dimension of the body's cells, 2 or 3; cells below it are kept only for the nodes of a
    physical group.
    """
    return max([2, *(CELLS[one.type].dimension for one in raw.cells if one.type in CELLS and len(one))])


def _dimension(kind: str, body: int) -> int:
    """Of a kind of cell; kinds that only meshio knows count as parts of the body, and are refused there."""
    return CELLS[kind].dimension if kind in CELLS else body


def _plane(path: Path, points: np.ndarray) -> np.ndarray:
    """x and y of points (N, 2 or 3): a finger in the plane has no z, and one that varies is refused."""
    points = np.asarray(points, dtype=float)
    if points.shape[1] == 3 and len(points) and np.ptp(points[:, 2]) > 1e-9:
        given = f"{path} with z from {points[:, 2].min():g} to {points[:, 2].max():g}"
        raise InputError("finger.mesh", given, "a plane mesh: the same z everywhere")
    return np.ascontiguousarray(points[:, :2])


def _groups(
    path: Path, raw: meshio.Mesh, solid: list[int], names: _Names, body: int
) -> tuple[Ints, dict[str, int]]:
    tag = np.concatenate([_tags(raw)[k] for k in solid])
    region_names = {name: number for (dimension, number), name in names.items() if dimension == body}
    lost = sorted(set(np.unique(tag).tolist()) - set(region_names.values()))
    if lost:
        given = f"{path} with {int(np.isin(tag, lost).sum())} cells outside every named group"
        raise InputError("finger.mesh", given, f"every cell in a physical {GROUPS[body]} with a name")
    present = set(np.unique(tag).tolist())
    return tag, {name: number for name, number in region_names.items() if number in present}


def _group_sets(raw: meshio.Mesh, names: _Names, body: int) -> dict[str, Ints]:
    sets: dict[str, Ints] = {}
    for block, tag in zip(raw.cells, _tags(raw), strict=True):
        dimension = _dimension(block.type, body)
        for number in np.unique(tag).tolist() if dimension < body else []:
            if name := names.get((dimension, number)):
                nodes = block.data[tag == number]
                sets[name] = np.union1d(sets.get(name, np.empty(0, np.int64)), nodes).astype(np.int64)
    return sets


def _tags(raw: meshio.Mesh) -> list[Ints]:
    """Numbers of physical groups, 0 for none; Gmsh gives negative ones to curves that run backwards."""
    tags = raw.cell_data.get(PHYSICAL)
    return [np.abs(tag) for tag in tags] if tags else [np.zeros(len(one), dtype=int) for one in raw.cells]


def _numbers(
    path: Path, raw: meshio.Mesh, solid: list[int], regions: Mapping[str, int] | None
) -> tuple[Ints, dict[str, int]]:
    if "region" not in raw.cell_data:
        raise InputError(
            "finger.mesh",
            f"{path} without region numbers",
            "integer cell data `region`, or a .msh file with named physical groups",
        )
    region = np.concatenate([np.asarray(raw.cell_data["region"][k]).reshape(-1) for k in solid])
    if not np.isfinite(region).all() or (region != np.round(region)).any():
        given = f"{path} with cell data `region` that are no integers"
        raise InputError("finger.mesh", given, "one integer per cell")
    region = region.astype(np.int64)
    if regions is None:
        regions = {
            name.removeprefix(PREFIX): int(np.ravel(number)[0])
            for name, number in raw.field_data.items()
            if name.startswith(PREFIX) and np.size(number) and np.isfinite(number).all()
        }
    return region, _checked_names(path, region, regions)


def _checked_names(path: Path, region: Ints, regions: Mapping[str, int]) -> dict[str, int]:
    present = np.unique(region).tolist()
    nameless = [n for n in present if n not in regions.values()]
    if nameless:
        raise InputError(
            "finger.regions",
            f"no name for {', '.join(map(str, nameless))} of {path}",
            "name = number for every number in the cell data `region`",
        )
    absent = [name for name, number in regions.items() if number not in present]
    if absent:
        raise InputError(
            "finger.regions",
            f"{absent[0]} = {regions[absent[0]]}",
            f"numbers that occur in {path}: {', '.join(map(str, present))}",
        )
    double = sorted(name for name, number in regions.items() if list(regions.values()).count(number) > 1)
    if double:
        given = f"{' and '.join(double)} with the same number"
        raise InputError("finger.regions", given, "one name per number")
    return dict(regions)


def _point_sets(path: Path, raw: meshio.Mesh) -> dict[str, Ints]:
    """`pad` and `bone` of any type, and every other point data that holds only the integers 0 and 1."""
    sets = {}
    for name, values in raw.point_data.items():
        values = np.asarray(values)
        values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        if values.ndim != 1:
            continue
        if name in ("pad", "bone"):
            if not np.isfinite(values).all():
                given = f"{path} with NaN in point data `{name}`"
                raise InputError("finger.mesh", given, "0 or 1 at every point")
        elif values.dtype.kind not in "iub" or not np.isin(values, (0, 1)).all():
            continue
        sets[name] = np.flatnonzero(values).astype(np.int64)
    return sets


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
    with replacing(path) as part, contextlib.redirect_stderr(io.StringIO()):
        writer(mesh, part)


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
    facets = mesh.edges_of(name) if mesh.dim == 2 else mesh.faces_of(name)
    lost = np.setdiff1d(mesh.node_sets[name], facets)
    if len(lost):
        facet = "edge" if mesh.dim == 2 else "face"
        given = f"a .msh file for the set {name} with node {lost[0]}, which no outer {facet} of the set has"
        raise InputError("--out", given, f".vtu, which carries sets of nodes (.msh: sets of outer {facet}s)")
    return facets


WRITERS: Mapping[str, Callable[[Mesh, Path], None]] = {".vtu": _write_vtu, ".msh": _write_msh}

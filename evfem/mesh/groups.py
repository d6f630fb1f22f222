"""Groups of cells and sets of nodes in mesh files: what becomes a region, and what a boundary.

Groups of cells of the body's dimension are regions, those of lower dimension, and sets of nodes, are
boundaries: physical groups (`.msh`), sets (`.inp`), families (`.med`), blocks and sets of nodes (`.e`),
numbers in cell data and sets in point data of all.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from evfem.common.arrays import Ints
from evfem.errors import InputError
from evfem.mesh.mesh import CELLS

if TYPE_CHECKING:
    import meshio

#: meshio's name of the numbers of physical groups
PHYSICAL = "gmsh:physical"
#: Prefix of the field data that carry the names of regions in a `.vtu` file.
PREFIX = "region:"

#: cell data that hold numbers of groups, in the order in which they are looked for
NUMBERS = ("region", PHYSICAL, "medit:ref", "nastran:ref", "su2:tag")
Name = str | int


class Group(NamedTuple):
    """Cells of one block that belong together: the group's name, where it has one, and number."""

    name: str | None
    number: int
    block: int
    cells: Ints


def dimension_of(kind: str, body: int) -> int:
    """Of a kind of cell; kinds that only meshio knows count as parts of the body, and are refused
    there.
    """
    return CELLS[kind].dimension if kind in CELLS else body


def groups_in(path: Path, raw: meshio.Mesh, body: int) -> list[Group]:
    """All groups of cells in a file: by numbers, else by sets. ValueError where numbers are none."""
    dimension = [dimension_of(one.type, body) for one in raw.cells]
    if path.suffix.lower() == ".med":
        return _families(raw)
    if path.suffix.lower() in (".e", ".exo", ".ex2"):
        return [Group(None, k + 1, k, np.arange(len(one))) for k, one in enumerate(raw.cells)]
    content = path.read_bytes() if PHYSICAL in raw.cell_data else b""
    names = _physical_names(content, raw)
    if entities := _entities(path, content):
        tags = [int(tag[0]) if len(tag) else 0 for tag in raw.cell_data["gmsh:geometrical"]]
        return [
            Group(names.get((d, abs(number))), abs(int(number)), k, np.arange(len(raw.cells[k])))
            for k, (d, tag) in enumerate(zip(dimension, tags, strict=True))
            for number in entities[d].get(tag, ())
        ]
    groups = []
    for key in [key for key in NUMBERS if key in raw.cell_data][:1]:
        for k, numbers in enumerate(raw.cell_data[key]):
            numbers = np.asarray(numbers).reshape(-1)
            if not np.isfinite(numbers).all() or (numbers != np.round(numbers)).any():
                raise ValueError(f"cell data `{key}` that are no integers")
            numbers = np.abs(numbers) if key == PHYSICAL else numbers  # curves may run backwards
            for number in np.unique(numbers).astype(int).tolist():
                if number or key != PHYSICAL:
                    cells = np.flatnonzero(numbers == number)
                    groups.append(Group(names.get((dimension[k], number)), number, k, cells))
    named = [name for name in raw.cell_sets if not name.startswith("gmsh:")]
    return groups or [
        Group(name, i, k, np.asarray(cells))
        for i, name in enumerate(named, 1)
        for k, cells in enumerate(raw.cell_sets[name])
        if cells is not None and len(cells) and np.max(cells) < len(raw.cells[k])
    ]


def _families(raw: meshio.Mesh) -> list[Group]:
    """Groups of a `.med`: a family of cells has the names of all groups that it is in."""
    families = sorted({name for names in raw.cell_tags.values() for name in names})
    return [
        Group(name, families.index(name) + 1, k, np.flatnonzero(tags == family))
        for k, tags in enumerate(raw.cell_data.get("cell_tags", ()))
        for family in np.unique(tags)
        for name in raw.cell_tags.get(family, ())
    ]


def _physical_names(content: bytes, raw: meshio.Mesh) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name, of a `.msh` or one of our `.vtu`: meshio keeps one group per name,
    but `nail` may be a region and a boundary.
    """
    section = re.search(rb"\$PhysicalNames\s(.*?)\$EndPhysicalNames", content, re.DOTALL)
    row = re.compile(rb'^\s*([0-3])\s+(\d{1,9})\s+"(.*)"\s*$', re.MULTILINE)
    rows = row.findall(section[1]) if section else []
    names = {(int(dimension), int(number)): name.decode(errors="replace") for dimension, number, name in rows}
    for key, number in raw.field_data.items():
        if key.startswith(PREFIX) and np.size(number) and np.isfinite(number).all():
            for dimension in (2, 3):
                names[dimension, int(np.ravel(number)[0])] = key.removeprefix(PREFIX)
    return names


def _entities(path: Path, content: bytes) -> Sequence[Mapping[int, Ints]]:
    """Numbers of all physical groups of each entity, by dimension; meshio keeps the first one. Empty
    for other versions than 4.1.
    """
    start = content.find(b"$Entities")
    head = re.match(rb"\s*\$MeshFormat\s+(?:4|4\.1)\s+([01])\s+([48])\s", content)
    if start < 0 or head is None:
        return ()
    from meshio.gmsh import _gmsh41

    with path.open("rb") as file:
        file.seek(start)
        file.readline()
        found: Sequence[Mapping[int, Ints]] = _gmsh41._read_entities(file, head[1] == b"0", int(head[2]))[0]
    return found


def regions_in(
    path: Path, groups: list[Group], sizes: Mapping[int, int], regions: Mapping[str, Name] | None
) -> tuple[Ints, dict[str, int]]:
    """The number of the region of each cell of the body's blocks, whose `sizes` are given, and the
    regions' names.
    """
    start = dict(zip(sizes, np.cumsum([0, *sizes.values()]), strict=False))
    solid = [one for one in groups if one.block in start]
    if not solid:
        allowed = "integer cell data `region`, or groups of cells with names (.msh, .inp, .med)"
        raise InputError("finger.mesh", f"{path.name} without region numbers", allowed)
    if not regions:
        regions = {one.name: one.name for one in solid if one.name is not None}
    region, owner = np.zeros(sum(sizes.values()), dtype=np.int64), np.full(sum(sizes.values()), "", object)
    found = {}
    for name, key in regions.items():
        for one in solid:
            if key in (one.name, one.number):
                cells, found[name] = start[one.block] + one.cells, one.number
                if both := next((other for other in owner[cells] if other not in ("", name)), None):
                    problem = f"{both} and {name} with the same cells"
                    allowed = f'one name per cell: those that count in [finger.regions], as {both} = "{both}"'
                    raise InputError("finger.regions", problem, allowed)
                region[cells], owner[cells] = one.number, name
        if name not in found:
            listed = dict.fromkeys(str(one.name or one.number) for one in solid)
            problem, allowed = f"{name} = {key}", f"groups that occur in {path.name}: {', '.join(listed)}"
            raise InputError("finger.regions", problem, allowed)
    nameless = {one.number for one in solid if (owner[start[one.block] + one.cells] == "").any()}
    if nameless:
        problem = f"no name for {', '.join(map(str, sorted(nameless)))} of {path.name}"
        allowed = "name = number (or name = group) for every cell of the mesh, as tissue = "
        raise InputError("finger.regions", problem, f"{allowed}{min(nameless)}")
    if (owner == "").any():
        problem = f"{path.name} with {(owner == '').sum()} cells outside every named group"
        raise InputError("finger.mesh", problem, "every cell in a group with a name")
    return region, found


def sets_in(
    path: Path, raw: meshio.Mesh, groups: list[Group], boundaries: Mapping[str, Name] | None
) -> dict[str, Ints]:
    """Sets of nodes: those of groups below the body's dimension, of the file, and of its point data."""
    sets: dict[Name, Ints] = {}

    def add(name: Name, nodes: Any) -> None:
        nodes = np.union1d(sets.get(name, np.empty(0, np.int64)), np.ravel(nodes))
        sets[name] = nodes.astype(np.int64)

    for one in groups:
        add(one.name or one.number, raw.cells[one.block].data[one.cells])
    for name, nodes in raw.point_sets.items():
        add(name, nodes)
    for family, names in getattr(raw, "point_tags", {}).items():
        for name in names:
            add(name, np.flatnonzero(raw.point_data["point_tags"] == family))
    raw.point_data.pop("point_tags", None)
    sets.update(_point_sets(path, raw))
    named = {name: nodes for name, nodes in sets.items() if isinstance(name, str)}
    for name, key in (boundaries or {}).items():
        if key not in sets:
            allowed = f"sets of {path.name}: {', '.join(map(str, sets)) or 'none'}"
            raise InputError("finger.boundaries", f"{name} = {key}", allowed)
        named[name] = sets[key]
    return named


def _point_sets(path: Path, raw: meshio.Mesh) -> dict[Name, Ints]:
    """`pad` and `bone` of any type, and every other point data that holds only the integers 0 and
    1.
    """
    sets: dict[Name, Ints] = {}
    for name, values in raw.point_data.items():
        values = np.asarray(values)
        values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        if values.ndim != 1 or name in NUMBERS:
            continue
        if name in ("pad", "bone"):
            if not np.isfinite(values).all():
                problem = f"{path.name} with NaN in point data `{name}`"
                raise InputError("finger.mesh", problem, "0 or 1 at every point")
        elif values.dtype.kind not in "iub" or not np.isin(values, (0, 1)).all():
            continue
        sets[name] = np.flatnonzero(values).astype(np.int64)
    return sets

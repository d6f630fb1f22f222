"""Gmsh's `.msh`, 2.2 and 4.1: physical groups, of which an element may be in several.

meshio keeps one group per name, although `nail` may be a region and a boundary, and of an entity in 4.1 its
first group; 2.2 has an element once for each of its groups. Source: Gmsh reference manual, MSH file format.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evfem.common.arrays import Ints
from evfem.mesh.groups import PHYSICAL, Group, body_of, dimension_of, numbered

if TYPE_CHECKING:
    import meshio


def read(path: Path) -> meshio.Mesh:
    """Points, cells, and physical groups with positive numbers; of Mesh.SaveAll = 1 version 2.2 has none."""
    import meshio

    content = path.read_bytes()
    if content.startswith(b"$NOD"):
        raise ValueError("version 1 of Gmsh's format: save as 2.2 or 4.1")
    raw = meshio.read(path)
    names, entities = _names(content), _entities(path, content)
    if entities:
        raw.groups = _groups_of_entities(raw, entities, names)
    else:
        raw = _once(raw, names)
    return raw


def _names(content: bytes) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name."""
    section = re.search(rb"\$PhysicalNames\s(.*?)\$EndPhysicalNames", content, re.DOTALL)
    row = re.compile(rb'^\s*([0-3])\s+(\d{1,9})\s+"(.*)"\s*$', re.MULTILINE)
    rows = row.findall(section[1]) if section else []
    return {(int(dimension), int(number)): name.decode(errors="replace") for dimension, number, name in rows}


def _entities(path: Path, content: bytes) -> Sequence[Mapping[int, Ints]]:
    """Numbers of all physical groups of each entity, by dimension. Empty for other versions than 4.1."""
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


def _groups_of_entities(
    raw: meshio.Mesh, entities: Sequence[Mapping[int, Ints]], names: Mapping[tuple[int, int], str]
) -> list[Group]:
    """Each block is of one entity."""
    body = body_of(raw)
    dimensions = [dimension_of(one.type, body) for one in raw.cells]
    tags = [int(tag[0]) if len(tag) else 0 for tag in raw.cell_data["gmsh:geometrical"]]
    return [
        Group(names.get((d, abs(number))), abs(int(number)), k, np.arange(len(raw.cells[k])))
        for k, (d, tag) in enumerate(zip(dimensions, tags, strict=True))
        for number in entities[d].get(tag, ())
    ]


def _once(raw: meshio.Mesh, names: Mapping[tuple[int, int], str]) -> meshio.Mesh:
    """One block for each kind of cell, in which each element stands once, with all its groups.

    Elements that stand twice in one group are left as they are.
    """
    import meshio

    kinds = list(dict.fromkeys(one.type for one in raw.cells))
    at = [[k for k, one in enumerate(raw.cells) if one.type == kind] for kind in kinds]
    cells = [np.vstack([raw.cells[k].data for k in some]) for some in at]
    data = {key: [np.concatenate([values[k] for k in some]) for some in at]
            for key, values in raw.cell_data.items() if key == PHYSICAL}  # fmt: skip
    groups = numbered(meshio.Mesh(raw.points, list(zip(kinds, cells, strict=True)), cell_data=data), names)
    for k in range(len(kinds)):
        cells[k], groups = _distinct(cells[k], k, groups)
    merged = meshio.Mesh(raw.points, list(zip(kinds, cells, strict=True)), raw.point_data)
    merged.groups = groups
    return merged


def _distinct(cells: Ints, block: int, groups: list[Group]) -> tuple[Ints, list[Group]]:
    """Cells (E, n) of a block without those that are there already, and the groups with their new places."""
    _, first, of = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)
    place = np.searchsorted(kept, first)[of.ravel()]
    if any(len(np.unique(place[one.cells])) < len(one.cells) for one in groups if one.block == block):
        return cells, groups
    return cells[kept], [
        one._replace(cells=np.sort(place[one.cells])) if one.block == block else one for one in groups
    ]

"""Groups of cells and sets of nodes in mesh files: what becomes a region, and what a boundary.

Groups of cells of the body's dimension are regions, those of lower dimension, and sets of nodes, are
boundaries. Readers that know the groups of their format (`evfem.mesh.formats`) give them as `groups` of the
mesh; others have numbers in cell data, and sets in point data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from evfem.common.arrays import Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.mesh import CELLS

if TYPE_CHECKING:
    import meshio

#: letters of a name that a message has
LETTERS = 60
#: meshio's name of the numbers of physical groups
PHYSICAL = "gmsh:physical"
#: Prefix of the field data that carry the names of regions in a `.vtu` file.
PREFIX = "region:"

#: cell data that hold numbers of groups, in the order in which they are looked for; the last is what Gmsh
#: writes into `.vtk`
NUMBERS = ("region", PHYSICAL, "medit:ref", "nastran:ref", "CellEntityIds")
#: what is 0 in point data: the rounding of a function that was interpolated
NOUGHT = 1e-9
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


def body_of(raw: meshio.Mesh) -> int:
    """Dimension of the body's cells, 2 or 3; cells below it are kept only for the nodes of a group."""
    return max([2, *(CELLS[one.type].dimension for one in raw.cells if one.type in CELLS and len(one))])


def groups_in(raw: meshio.Mesh) -> list[Group]:
    """All groups of cells in a file: those that its reader found, else by numbers and by sets."""
    if hasattr(raw, "groups"):
        found: list[Group] = raw.groups
        return found
    named = [(key.removeprefix(PREFIX), np.ravel(number)) for key, number in raw.field_data.items()
             if key.startswith(PREFIX) and np.size(number) and np.isfinite(number).all()]  # fmt: skip
    names = {(dimension, int(number[0])): name for name, number in named for dimension in (2, 3)}
    if PHYSICAL in raw.cell_data:  # of a meshio.Mesh in memory: name -> number, dimension
        own = {key: number for key, number in raw.field_data.items() if np.size(number) == 2}
        names = {(int(number[1]), int(number[0])): key for key, number in own.items()} | names
    found = numbered(raw, names)
    return found + _cell_sets(raw, names, max([0, *(one.number for one in found)]))


def _cell_sets(raw: meshio.Mesh, names: Mapping[tuple[int, int], str], last: int) -> list[Group]:
    """Named sets of cells. They stand beside the numbers, of which meshio keeps one per cell where Gmsh has
    it in several groups; those without a number of the file count from the `last` one.
    """
    numbers, body = {(dimension, name): number for (dimension, number), name in names.items()}, body_of(raw)
    return [
        Group(name, numbers.get((dimension_of(raw.cells[k].type, body), name), i), k, np.asarray(cells, int))
        for i, name in enumerate([one for one in raw.cell_sets if not one.startswith("gmsh:")], last + 1)
        for k, cells in enumerate(raw.cell_sets[name])
        if cells is not None and len(cells) and np.max(cells) < len(raw.cells[k])
    ]


def numbered(raw: meshio.Mesh, names: Mapping[tuple[int, int], str]) -> list[Group]:
    """Groups by the numbers in cell data, with names by dimension and number, or by texts, which are names.
    ValueError where they are neither.
    """
    groups, body = [], body_of(raw)
    for key in [key for key in NUMBERS if key in raw.cell_data][:1]:
        columns = [np.array(np.ravel(one).tolist()) for one in raw.cell_data[key]]
        if all(column.dtype.kind in "SU" for column in columns if len(column)):
            return _by_texts(columns)
        for k, numbers in enumerate(columns):
            whole = numbers.dtype.kind in "biuf" and np.isfinite(numbers).all()
            if not whole or (numbers != np.round(numbers)).any():
                raise ValueError(f"cell data `{key}` that are no integers")
            numbers = np.abs(numbers) if key == PHYSICAL else numbers  # curves may run backwards
            for number in np.unique(numbers).astype(int).tolist():
                if number or key != PHYSICAL:
                    name = names.get((dimension_of(raw.cells[k].type, body), number))
                    groups.append(Group(name, number, k, np.flatnonzero(numbers == number)))
    return groups


def _by_texts(columns: list[Any]) -> list[Group]:
    """Groups by a text for each cell of each block, counted from 1; an empty text is no name."""
    texts = [column.astype(str) for column in columns]
    return [
        Group(name or None, i, k, np.flatnonzero(column == name))
        for i, name in enumerate(np.unique(np.concatenate(texts)).tolist(), 1)
        for k, column in enumerate(texts)
        if (column == name).any()
    ]


def regions_in(
    path: Path,
    groups: list[Group],
    sizes: Mapping[int, int],
    regions: Mapping[str, Name] | None,
    others: Iterable[str] = (),
) -> tuple[Ints, dict[str, int]]:
    """The number of the region of each cell of the body's blocks, whose `sizes` are given, and the
    regions' names. `others` are the names of cell data for the sentence on a file without numbers.
    """
    start = dict(zip(sizes, np.cumsum([0, *sizes.values()]), strict=False))
    solid = [one for one in groups if one.block in start]
    if not solid:
        groups_of = ".msh saved with Mesh.SaveAll = 0, .inp, .med, .exo"
        allowed = f"integer cell data `region`, groups of cells with names ({groups_of}), or a place "
        allowed += 'in [finger.regions], as tissue = "rest" for the whole mesh'
        have = f" (its cell data: {', '.join(others)})" if others else ""
        raise InputError("finger.mesh", f"{path.name} without region numbers{have}", allowed)
    if not regions:
        regions = {one.name: one.name for one in solid if one.name is not None}
    region, owner = np.zeros(sum(sizes.values()), dtype=np.int64), np.full(sum(sizes.values()), "", object)
    found: dict[str, int] = {}
    for name, key in regions.items():
        for one in solid:
            if key in (one.name, one.number):
                cells, number = start[one.block] + one.cells, found.setdefault(name, one.number)
                if both := next((other for other in owner[cells] if other not in ("", name)), None):
                    problem, chosen = (
                        f"{both[:LETTERS]} and {name[:LETTERS]} with the same cells",
                        f"{both[:LETTERS]} = {describe_value(regions[both])}",
                    )
                    allowed = f"one name per cell: those that count in [finger.regions], as {chosen}"
                    raise InputError("finger.regions", problem, allowed)
                region[cells], owner[cells] = number, name
        if name not in found:
            listed = dict.fromkeys(str(one.name or one.number) for one in solid)
            problem = f"{name[:LETTERS]} = {str(key)[:LETTERS]}"
            allowed = f"groups that occur in {path.name}: {', '.join(listed)}"[: 10 * LETTERS]
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
    path: Path,
    raw: meshio.Mesh,
    groups: list[Group],
    boundaries: Mapping[str, Any] | None,
    at: Callable[[str, Any, str], Ints],
) -> dict[str, Ints]:
    """Sets of nodes: those of groups below the body's dimension, of the file, and of its point data; a
    number is also that of a set with a name. What `boundaries` calls neither is looked for `at` a place.
    """
    sets: dict[Name, Ints] = {}
    numbers: dict[Name, Name] = dict(getattr(raw, "numbers", {}))

    def add(name: Name, nodes: Any) -> None:
        nodes = np.union1d(sets.get(name, np.empty(0, np.int64)), np.ravel(nodes))
        sets[name] = nodes.astype(np.int64)

    body = body_of(raw)
    for one in sorted(groups, key=lambda one: -dimension_of(raw.cells[one.block].type, body)):
        add(one.name or one.number, raw.cells[one.block].data[one.cells])
        numbers.setdefault(one.number, one.name or one.number)  # sides before edges and points
    for name, nodes in raw.point_sets.items():
        add(name, nodes)
    sets.update(_point_sets(path, raw))
    named = {name: nodes for name, nodes in sets.items() if isinstance(name, str)}
    for name, key in (boundaries or {}).items():
        known = f"sets of {path.name}: {', '.join(map(str, sets)) or 'none'}"
        own = numbers.get(key, key) if isinstance(key, int) and key not in sets else key
        named[name] = sets[own] if isinstance(own, Name) and own in sets else at(name, key, known)
    return named


def _point_sets(path: Path, raw: meshio.Mesh) -> dict[Name, Ints]:
    """`pad` and `bone` of any type, in which less than `NOUGHT` is 0, and every other point data that holds
    only 0 and 1.
    """
    sets: dict[Name, Ints] = {}
    for name, values in raw.point_data.items():
        values = np.asarray(values)
        values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        if values.ndim != 1 or name in NUMBERS:
            continue
        if name in ("pad", "bone"):
            numbers = values.dtype.kind in "biuf"
            if not numbers or not np.isfinite(values).all():
                problem = f"{path.name} with {'NaN' if numbers else 'texts'} in point data `{name}`"
                raise InputError("finger.mesh", problem, "0 or 1 at every point")
        elif values.dtype.kind not in "biuf" or not np.isin(values, (0, 1)).all():
            continue
        sets[name] = np.flatnonzero(np.abs(values) > NOUGHT).astype(np.int64)
    return sets


def unused_in(raw: meshio.Mesh, groups: list[Group], sets: Mapping[str, Ints]) -> list[str]:
    """What else a file has that may have been meant as a boundary: numbers of groups below the body's
    dimension, and point data that are no sets.
    """
    body = body_of(raw)
    below = [one for one in groups if dimension_of(raw.cells[one.block].type, body) < body]
    numbers = sorted({one.number for one in below if one.name is None})
    data = [name for name in raw.point_data if name not in sets and name not in NUMBERS]
    return [
        *(f"the number {one}" for one in numbers),
        *(f"point data {one} that are not 0 and 1" for one in data),
        *(f"{one} as texts" for one in getattr(raw, "texts", ()) if one not in NUMBERS),
    ]

"""Exodus II (`.e`, `.exo`, `.ex2`, `.g`, `.gen`): blocks, side sets, node sets by names and numbers.

A name may be empty; the numbers (`eb_prop1`, `ss_prop1`, `ns_prop1`) are the writer's own choice and need not
be places in the file. Source: Schoof and Yarberry, Exodus II: a finite element data model, SAND92-2137
(1994); sides as in the library's ex_get_block_param, 27 nodes as in Sandia's exodus_helper 1.6.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.common.foreign import check_declared
from evfem.mesh.formats.classic import check_header
from evfem.mesh.groups import Group, Name
from evfem.mesh.mesh import sides_of

if TYPE_CHECKING:
    import meshio

_LINE = {2: "line", 3: "line3"}
_QUAD = {4: "quad", 8: "quad8", 9: "quad9"}
#: first three letters of an element's type -> its kind, by the number of its nodes
KINDS: Mapping[str, Mapping[int, str]] = {
    **dict.fromkeys(("BAR", "BEA", "TRU", "EDG"), _LINE),
    "SPH": {1: "vertex"},
    "TRI": {3: "triangle", 6: "triangle6"},
    "QUA": _QUAD,
    "SHE": _LINE | _QUAD,
    "HEX": {8: "hexahedron", 20: "hexahedron20", 27: "hexahedron27"},
    "TET": {4: "tetra", 10: "tetra10"},
    "WED": {6: "wedge", 15: "wedge15"},
    "PYR": {5: "pyramid", 13: "pyramid13"},
}
#: nodes of a hexahedron in VTK's order: Exodus has the middles of upright edges before those of the top, and
#: the centre before the middles of the faces -z, +z, -x, +x, -y, +y
ORDER = [*range(12), *range(16, 20), *range(12, 16), 23, 24, 25, 26, 21, 22, 20]
#: sides 1 to 6 of a hexahedron among the faces of VTK
SIDES = [2, 1, 3, 0, 4, 5]


def read(path: Path) -> meshio.Mesh:
    """Points (N, 2 or 3), cells, blocks as groups, side sets and node sets as sets of nodes.

    Raises ValueError that says what is not read.
    """
    import meshio
    import netCDF4

    check_header(path.read_bytes())
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        read = [one for name, one in file.variables.items() if not name.startswith("vals_")]
        check_declared(one.size * np.dtype(one.dtype).itemsize for one in read)
        points = _points(file)
        cells, sides, groups = list[tuple[str, Ints]](), list[list[Ints]](), list[Group]()
        for k, (name, number) in enumerate(_labels(file, "eb", "num_el_blk"), 1):
            if f"connect{k}" in file.variables:  # not of empty blocks
                kind, nodes, table = _block(file.variables[f"connect{k}"], points.shape[1])
                groups.append(Group(name or None, number, len(cells), np.arange(len(nodes))))
                cells.append((kind, nodes))
                sides.append([nodes[:, place] for place in table])
        sets, numbers = _sets(file, sides, [len(nodes) for _, nodes in cells])
        raw = meshio.Mesh(points, cells, point_sets=sets)
    raw.groups, raw.numbers = groups, numbers
    return raw


def _points(file: Any) -> Floats:
    if "coord" in file.variables:
        return np.array(file.variables["coord"][:], dtype=float).T
    axes = "xyz"[: len(file.dimensions["num_dim"])]
    return np.column_stack([file.variables[f"coord{axis}"][:] for axis in axes]).astype(float)


def _labels(file: Any, what: str, dimension: str) -> Iterator[tuple[str, int]]:
    """(name, "" where there is none, number) of the blocks (eb), side sets (ss) or node sets (ns)."""
    count = len(file.dimensions[dimension]) if dimension in file.dimensions else 0
    names = file.variables[f"{what}_names"][:] if f"{what}_names" in file.variables else [[]] * count
    numbers = file.variables[f"{what}_prop1"][:] if f"{what}_prop1" in file.variables else range(1, count + 1)
    for letters, number in zip(names, numbers, strict=True):
        text = b"".join(letters).split(b"\0")[0]
        yield text.decode("utf-8", "replace").strip(), int(number)


def _block(connect: Any, dim: int) -> tuple[str, Ints, list[Ints]]:
    """Kind, nodes (E, n) in VTK's order, and the places of the nodes of its sides 1, 2 ...

    Shells, and triangles in space, have their two faces before their edges. Sides of elements of which no
    finger is made are all of them.
    """
    name, nodes = str(connect.elem_type).strip("\0 ").upper(), np.array(connect[:], dtype=np.int64) - 1
    kind = KINDS.get(name[:3], {}).get(nodes.shape[1])
    if kind is None:
        raise ValueError(f"elements {name} of {nodes.shape[1]} nodes, which are not read")
    table, whole = sides_of(kind), np.arange(nodes.shape[1])
    if kind.startswith("hexahedron"):
        return kind, nodes[:, [place for place in ORDER if place < nodes.shape[1]]], list(table[SIDES])
    faces = "SHELL" in name or (name.startswith("TRI") and dim == 3)
    return kind, nodes, [*faces * [whole] * 2, *table] if len(table) else [whole] * 6


def _sets(file: Any, sides: list[list[Ints]], sizes: list[int]) -> tuple[dict[Name, Ints], dict[int, Name]]:
    """Nodes of the side sets and node sets by name, by number where they have none; and what each number is,
    of a side set before a node set.

    One whose name or number another one with other nodes has is called "node set 3" by its number.
    """
    found: dict[Name, Ints] = {}
    numbers: dict[int, Name] = {}
    for what, words, first in (("ss", "side set", "elem"), ("ns", "node set", "node")):
        for k, (name, number) in enumerate(_labels(file, what, f"num_{words.replace(' ', '_')}s"), 1):
            if f"{first}_{what}{k}" not in file.variables:
                continue  # an empty set
            of_nodes = what == "ns"
            nodes = file.variables[f"node_ns{k}"][:] - 1 if of_nodes else _side_nodes(file, k, sides, sizes)
            nodes = np.unique(np.asarray(nodes, dtype=np.int64))
            key: Name = name or number
            if not np.array_equal(found.setdefault(key, nodes), nodes):
                key = f"{words} {number}"
                found[key] = nodes
            numbers.setdefault(number, key)
    return found, numbers


def _side_nodes(file: Any, k: int, sides: list[list[Ints]], sizes: list[int]) -> Ints:
    """Nodes of side set k: elements count from 1 through all blocks, sides from 1."""
    element, side = (
        np.array(file.variables[f"{what}_ss{k}"][:], dtype=np.int64) for what in ("elem", "side")
    )
    start = np.cumsum([0, *sizes])
    block = np.searchsorted(start, element - 1, side="right") - 1
    found = [np.empty(0, dtype=np.int64)]
    for one, number in sorted(set(zip(block.tolist(), side.tolist(), strict=True))):
        if not (0 <= one < len(sizes) and 0 < number <= len(sides[one])):
            raise ValueError(f"side set {k} with side {number} of an element that has none of it")
        here = (block == one) & (side == number)
        found.append(sides[one][number - 1][element[here] - 1 - start[one]].ravel())
    return np.concatenate(found)

"""Reads Gmsh's .msh files, versions 2 and 4.1, written as text (Gmsh's own default).

Format: Gmsh reference manual, https://gmsh.info/doc/texinfo/gmsh.html#File-formats. Read are the
physical names, entities, nodes and elements; other sections are passed over. An element that is in
several physical groups belongs to the first.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.formats import MOST_NAMES, Parts, Unreadable, integers, parsed
from evfem.mesh.mesh import CELLS

#: Gmsh's numbers of the kinds of cells
KINDS: Mapping[int, str] = {kind.gmsh: name for name, kind in CELLS.items()}
#: nodes of its quadratic hexahedra in VTK's order; its other cells have VTK's
ORDER: Mapping[str, Ints] = {
    "hexahedron20": np.array([*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]),
    "hexahedron27": np.array(
        [*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25, 26]
    ),
}
PHYSICAL = "gmsh:physical"


def read(content: bytes) -> Parts:
    """The parts of a .msh file; raises `Unreadable`."""
    sections = _sections(content)
    head = sections.get(b"MeshFormat", b"").split()
    if len(head) < 3:
        raise Unreadable("no $MeshFormat")
    if head[1] != b"0":
        raise Unreadable("a binary .msh file: export it as text")
    if not {b"Nodes", b"Elements"} <= set(sections):
        raise Unreadable("no nodes or no elements")
    nodes, elements = parsed(sections[b"Nodes"]), parsed(sections[b"Elements"])
    if head[0] in (b"2", b"2.0", b"2.1", b"2.2"):
        tags, points = _nodes_2(nodes)
        rows = _elements_2(elements)
    elif head[0] in (b"4", b"4.1"):
        tags, points = _nodes_4(nodes)
        rows = _elements_4(elements, _entities(parsed(sections.get(b"Entities", b""))))
    else:
        raise Unreadable(f"version {head[0][:20].decode(errors='replace')} of the format")
    place = _Places(tags)
    parts = Parts(points, [], cell_data={PHYSICAL: []})
    for kind in dict.fromkeys(kind for kind, _, _ in rows):
        same = [(cells, physical) for name, cells, physical in rows if name == kind]
        cells = place(np.concatenate([cells for cells, _ in same]))
        parts.blocks.append((kind, cells[:, ORDER[kind]] if kind in ORDER else cells))
        parts.cell_data[PHYSICAL].append(np.concatenate([physical for _, physical in same]))
    parts.names = _names(sections.get(b"PhysicalNames", b""))
    return parts


def _sections(content: bytes) -> dict[bytes, bytes]:
    """What stands between $NAME and $EndNAME; of several the first."""
    content = b"\n" + content.replace(b"\r\n", b"\n")
    found: dict[bytes, bytes] = {}
    at = content.find(b"\n$")
    while at >= 0:
        stop = content.find(b"\n", at + 1)
        name = content[at + 2 : stop if stop >= 0 else len(content)].strip()
        end = content.find(b"\n$End" + name, at + 1)
        if stop < 0 or end < 0:
            raise Unreadable(f"${name[:40].decode(errors='replace')} without its end")
        found.setdefault(name, content[stop:end])
        at = content.find(b"\n$", end + 1)
    return found


def _names(text: bytes) -> dict[tuple[int, int], str]:
    """(dimension, number) -> name: numbers count per dimension."""
    names: dict[tuple[int, int], str] = {}
    for line in text.splitlines():
        if len(names) > MOST_NAMES:
            raise Unreadable(f"more than {MOST_NAMES} physical names")
        words = line.decode(errors="replace").strip().split(None, 2)
        if len(words) == 3:
            dimension, number = integers(parsed(" ".join(words[:2]))).tolist()
            names[dimension, number] = words[2].strip('"')
    return names


class _Places:
    """From Gmsh's tags of nodes to their places in the file."""

    def __init__(self, tags: Ints) -> None:
        self.order = np.argsort(tags, kind="stable")
        self.sorted = tags[self.order]
        if (np.diff(self.sorted) == 0).any():
            raise Unreadable("two nodes with the same tag")

    def __call__(self, cells: Ints) -> Ints:
        place = np.searchsorted(self.sorted, cells)
        known = self.sorted[np.minimum(place, len(self.sorted) - 1)] == cells if len(self.sorted) else False
        if not np.all(known):
            raise Unreadable("elements of nodes that do not exist")
        return np.asarray(self.order[place], dtype=np.int64)


def _nodes_2(values: Floats) -> tuple[Ints, Floats]:
    if not values.size or values[0] != (values.size - 1) / 4:  # no product, which may be infinite
        raise Unreadable("another number of nodes than announced")
    table = values[1:].reshape(-1, 4)
    return integers(table[:, 0]), table[:, 1:]


def _elements_2(values: Floats) -> list[tuple[str, Ints, Ints]]:
    """Rows of number, type, number of tags, tags, nodes; those of a kind make a block."""
    numbers = integers(values)
    starts, kinds, at = [], [], 1
    while at < numbers.size:
        kind = KINDS.get(int(numbers[at + 1])) if at + 2 < numbers.size else None
        if kind is None or numbers[at + 2] < 0:
            raise Unreadable("an element of an unknown type")
        starts.append(at)
        kinds.append(kind)
        at += 3 + int(numbers[at + 2]) + CELLS[kind].nodes
    if at != numbers.size or len(starts) != numbers[0]:
        raise Unreadable("another number of elements than announced")
    start, names = np.array(starts, dtype=np.int64), np.array(kinds)
    blocks = []
    for kind in dict.fromkeys(kinds):
        begin = start[names == kind]
        tags = numbers[begin + 2]
        nodes = numbers[(begin + 3 + tags)[:, None] + np.arange(CELLS[kind].nodes)]
        blocks.append((kind, nodes, np.where(tags > 0, numbers[begin + 3], 0)))
    return blocks


class _Walk:
    """Takes numbers off the front of a section."""

    def __init__(self, values: Floats) -> None:
        self.values, self.at = values, 0

    def take(self, count: int) -> Floats:
        if count < 0 or self.at + count > self.values.size:
            raise Unreadable("a section shorter than it says")
        self.at += count
        return self.values[self.at - count : self.at]

    def whole(self, count: int) -> list[int]:
        return [int(n) for n in integers(self.take(count))]


def _nodes_4(values: Floats) -> tuple[Ints, Floats]:
    walk = _Walk(values)
    tags, points = [np.zeros(0, np.int64)], [np.zeros((0, 3))]
    blocks, total, _, _ = walk.whole(4)
    while walk.at < values.size:
        _, _, parametric, count = walk.whole(4)
        if parametric:
            raise Unreadable("nodes with parametric coordinates")
        tags.append(integers(walk.take(count)))
        points.append(walk.take(3 * count).reshape(-1, 3))
    if len(tags) - 1 != blocks or sum(map(len, tags)) != total:
        raise Unreadable("another number of nodes than announced")
    return np.concatenate(tags), np.concatenate(points)


def _entities(values: Floats) -> dict[tuple[int, int], int]:
    """(dimension, entity) -> its first physical group."""
    if not values.size:
        return {}
    walk, groups = _Walk(values), {}
    counts = walk.whole(4)
    for dimension, count in enumerate(counts):
        for _ in range(count):
            (tag,) = walk.whole(1)
            walk.take(6 if dimension else 3)
            physical = walk.whole(*walk.whole(1))
            if dimension:
                walk.take(*walk.whole(1))
            if physical:
                groups[dimension, tag] = abs(physical[0])
    return groups


def _elements_4(values: Floats, groups: Mapping[tuple[int, int], int]) -> list[tuple[str, Ints, Ints]]:
    walk, rows = _Walk(values), []
    blocks, total, _, _ = walk.whole(4)
    while walk.at < values.size:
        dimension, entity, number, count = walk.whole(4)
        if number not in KINDS:
            raise Unreadable("an element of an unknown type")
        kind = KINDS[number]
        table = integers(walk.take(count * (1 + CELLS[kind].nodes))).reshape(count, -1)
        rows.append((kind, table[:, 1:], np.full(count, groups.get((dimension, entity), 0))))
    if len(rows) != blocks or sum(len(cells) for _, cells, _ in rows) != total:
        raise Unreadable("another number of elements than announced")
    return rows

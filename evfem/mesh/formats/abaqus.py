"""The body of a deck of Abaqus or CalculiX (`.inp`), as meshio has those of other formats.

A deck may have parts: of those the one instance that has elements is the body, shifted and turned into its
place. Source of the nodes and faces of elements: Abaqus elements guide (2017).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.mesh.formats.deck import ASSEMBLY, Deck, Scope, Surface, cards, existing, nodes_of
from evfem.mesh.mesh import CELLS, sides_of

if TYPE_CHECKING:
    import meshio

#: kinds whose nodes Abaqus has in another order -> VTK's: lines with the middle between their ends,
#: hexahedra with the centre before the middles of faces 1 to 6
ORDER: Mapping[str, list[int]] = {
    "line3": [0, 2, 1],
    "hexahedron27": [*range(20), 26, 24, 23, 25, 21, 22, 20],
}
#: faces 1 to 6 of a solid element among those of VTK
FACES = [4, 5, 2, 1, 3, 0]
#: what to do with several bodies; Abaqus/CAE has it among the attributes of a model
FLATTEN = 'flatten the assembly ("Do not use parts and assemblies in input files")'


class Body(NamedTuple):
    """The instance that has elements ("" where a deck has none), its scope, and that scope's name."""

    instance: str
    scope: Scope
    name: str


def read(path: Path) -> meshio.Mesh:
    """Points (N, 3) in mm, cells and sets of the body in a deck; nodes of no element are left out.

    Raises ValueError that says what is not read, or what does not fit together.
    """
    import meshio

    deck = Deck()
    with path.open(encoding="utf-8", errors="replace") as lines:
        for card in cards(lines):
            deck.take(card)
    body = body_of(deck)
    nodes = body.scope.nodes
    used = {node for block in body.scope.blocks for cell in block for node in cell}
    existing(sorted(used), nodes, "*ELEMENT: node")
    row = {number: i for i, number in enumerate(number for number in nodes if number in used)}
    points = moved(np.array([nodes[number] for number in row]), deck.places.get(body.instance.upper(), []))
    cells = [
        np.array([[row[node] for node in cell] for cell in block])[:, ORDER.get(kind, slice(None))]
        for kind, block in zip(body.scope.kinds, body.scope.blocks, strict=True)
    ]
    cell_sets = _cell_sets(deck, body)
    return meshio.Mesh(
        points,
        list(zip(body.scope.kinds, cells, strict=True)),
        point_sets=_point_sets(deck, body, row, cells, cell_sets),
        cell_sets=cell_sets,
    )


def body_of(deck: Deck) -> Body:
    """What has elements, which must be one."""
    instances = list(deck.instances.values()) or [("", name) for name in deck.scopes if name != ASSEMBLY]
    found = [Body(one, deck.scopes[name], name) for one, name in (*instances, ("", ASSEMBLY))
             if name in deck.scopes and deck.scopes[name].blocks]  # fmt: skip
    if len(found) == 1:
        return found[0]
    if not found:
        raise ValueError("no *ELEMENT that is part of a body")
    names = " and ".join(one.instance or one.name for one in found)
    raise ValueError(f"several *PART or *INSTANCE with elements, {names}: {FLATTEN}")


def moved(points: Floats, place: list[list[float]]) -> Floats:
    """Points (N, 3) of a part where the data of *INSTANCE put them: shifted, then turned by an angle in
    degrees around the axis from one point to another.

    >>> moved(np.array([[1.0, 0.0, 0.0]]), [[1.0, 0.0, 0.0], [0, 0, 0, 0, 0, 1, 90]]).round(9).tolist()
    [[0.0, 2.0, 0.0]]
    """
    for numbers in place:
        if len(numbers) == 7:
            start, end = np.reshape(numbers[:6], (2, 3))
            length, angle = np.linalg.norm(end - start), np.radians(numbers[6])
            if length == 0.0:
                raise ValueError("*INSTANCE that is turned around two points in one place: give an axis")
            axis, away = (end - start) / length, points - start
            along, across = (away @ axis)[:, None] * axis, np.cross(axis, away)
            points = start + along + np.cos(angle) * (away - along) + np.sin(angle) * across
        elif len(numbers) <= 3:
            points = points + (numbers + 3 * [0.0])[:3]
        else:
            raise ValueError("*INSTANCE with data that are no shift (3 numbers) and turn (7)")
    return points


def _sets(deck: Deck, body: Body, what: str) -> Iterator[tuple[str, str, list[int]]]:
    """(name in capitals, name, numbers in the body) of its sets and of the assembly's.

    A part's set whose name the assembly has too is called as it is there, F1.pad. Sets of elements that
    Abaqus/CAE made for a surface are left out.
    """
    above = deck.scopes.get(ASSEMBLY, Scope()).sets[what] if body.name != ASSEMBLY else {}
    table = body.scope.nodes if what == "NSET" else body.scope.elements
    for sets in (body.scope.sets[what], above):
        for key, one in sets.items():
            numbers = [n for scope, some in one.members if scope == body.name
                       for n in existing(some, table, f"{what} {one.name}: number")]  # fmt: skip
            if numbers and not (what == "ELSET" and one.internal and key in deck.in_surfaces):
                shared = sets is not above and key in above
                yield key, f"{body.instance}.{one.name}" if shared else one.name, numbers


def _cell_sets(deck: Deck, body: Body) -> dict[str, list[Ints]]:
    """Places of the cells of each set in each block; sets with a card of their own first."""
    found = {}
    for _, name, numbers in sorted(_sets(deck, body, "ELSET"), key=lambda one: one[0] not in deck.cards):
        at = np.array([body.scope.elements[number] for number in numbers])
        found[name] = [np.unique(at[at[:, 0] == k, 1]) for k in range(len(body.scope.blocks))]
    return found


def _point_sets(
    deck: Deck, body: Body, row: Mapping[int, int], cells: list[Ints], cell_sets: Mapping[str, list[Ints]]
) -> dict[str, Ints]:
    """Rows of the nodes of each set and surface.

    A set of nodes gives way to the cells of lower dimension that have its name where cells of the body have
    it too (Gmsh saves the nodes of both as one); a surface to a set of nodes of its name.
    """
    found = {}
    for _, name, numbers in _sets(deck, body, "NSET"):
        parts = zip(body.scope.kinds, cell_sets[name], strict=True) if name in cell_sets else ()
        of = {_dimension(kind) for kind, some in parts if len(some)}
        if len(of) < 2 and (rows := [row[number] for number in numbers if number in row]):
            found[name] = np.unique(rows)
    for scope in (body.scope, deck.scopes.get(ASSEMBLY, Scope())):
        for one in scope.surfaces.values():
            if len(nodes := _surface(one, body, row, cells)):
                found.setdefault(one.name, nodes)
    return found


def _surface(one: Surface, body: Body, row: Mapping[int, int], cells: list[Ints]) -> Ints:
    """Rows of the nodes of a surface."""
    found, chosen = [np.empty(0, dtype=np.int64)], list[tuple[int, int]]()
    for (scope, numbers), face in one.faces:
        if scope != body.name:
            continue
        if one.of == "NSET":
            numbers = existing(numbers, body.scope.nodes, f"*SURFACE {one.name}: node")
            found.append(np.array([row[number] for number in numbers if number in row], dtype=np.int64))
            continue
        numbers = existing(numbers, body.scope.elements, f"*SURFACE {one.name}: element")
        at = [body.scope.elements[number] for number in numbers]
        if face:
            found += [cells[k][place][_side(body.scope.kinds[k], face, one.name)] for k, place in at]
        else:
            chosen += at
    return np.unique(np.concatenate([*found, *_exposed(chosen, body.scope.kinds, cells)]))


def _side(kind: str, face: str, name: str) -> Ints:
    """Places in a cell of the nodes of its face S1 ...; all of a shell's, and of kinds of no finger."""
    sides = _sides_of(kind)
    if face in ("SPOS", "SNEG") or not len(sides):
        return np.arange(nodes_of(kind))
    if re.fullmatch(r"S\d", face) and 0 < int(face[1]) <= len(sides):
        return sides[int(face[1]) - 1]
    raise ValueError(f"*SURFACE {name} with the face {face} of a {kind}, which it does not have")


def _sides_of(kind: str) -> Ints:
    """Places of the nodes of the faces S1 ... of a cell (m, k), corners first."""
    sides = sides_of(kind)
    return sides[FACES] if kind.startswith("hexahedron") else sides


def _exposed(chosen: list[tuple[int, int]], kinds: list[str], cells: list[Ints]) -> Iterator[Ints]:
    """Nodes of the faces of chosen cells (block, place) that no other cell has, or of shells all nodes: what
    a surface of elements without faces is.
    """
    corners = [4 if kind.startswith("hexahedron") else 2 for kind in kinds]
    count: Counter[tuple[int, ...]] = Counter()
    for kind, one, k in zip(kinds, cells, corners, strict=True) if chosen else ():
        sides = np.sort(one[:, _sides_of(kind)][..., :k], axis=2)
        count.update(map(tuple, sides.reshape(-1, sides.shape[2]).tolist()))
    for block, place in chosen:
        cell = cells[block][place]
        if _dimension(kinds[block]) < max(map(_dimension, kinds)):
            yield cell
        for side in cell[_sides_of(kinds[block])]:
            if count[tuple(sorted(side[: corners[block]].tolist()))] == 1:
                yield side


def _dimension(kind: str) -> int:
    return CELLS[kind].dimension if kind in CELLS else 3  # others are solids

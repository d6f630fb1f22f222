"""Boundaries and regions by their place: for meshes of formats that have no names.

A boundary is a set of whole outer sides (edges of the outline, faces of the surface): those in a
box, those round a cavity (`inside`), or those that face one way, joined to the outermost of them
(`lowest` is the lower side of a finger or a block). A region is what has the centres of its cells
in a box, or the `rest`.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError, describe_value
from evfem.mesh.groups import Group
from evfem.mesh.mesh import Mesh, joined

#: sides of a body -> the axis and the way that they face
FACING: Mapping[str, tuple[int, float]] = {
    "lowest": (1, -1.0), "highest": (1, 1.0), "left": (0, -1.0), "right": (0, 1.0),
    "back": (2, -1.0), "front": (2, 1.0),
}  # fmt: skip
INSIDE, REST = "inside", "rest"
BOX = "a box as {box = [[0, -1], [5, 0]]}, two corners in mm"
PLACES = f"{' | '.join(FACING)} | {INSIDE}, or {BOX}"
#: sine of the angle by which a side must at least face a way, and what counts as the same place, over the
#: extent of the body: coordinates in files are rounded
LEAST, SAME = 0.01, 1e-6


def nodes_at(mesh: Mesh, name: str, place: Any, known: str) -> Ints:
    """Nodes of the outer sides of a sound mesh at the place that a boundary `name` is said to have.

    Raises `InputError` where no side is there, and for what is neither a place nor among the `known` sets.
    """
    key, told = "finger.boundaries", f"{name} = {_told(place)}"
    if isinstance(place, Mapping):
        found = _within(mesh.points, key, place, mesh)[mesh.outer_sides].all(axis=1)
    elif place == INSIDE:
        part = joined(mesh.outer_sides)
        found = part != part[mesh.points[mesh.outer_sides, 1].min(axis=1).argmin()]
    elif place in FACING:
        if FACING[place][0] >= mesh.dim:
            raise InputError(
                key, f"{told} of a mesh in the plane", "lowest | highest | left | right | inside"
            )
        found = _facing(mesh, *FACING[place])
    else:
        raise InputError(key, told, f"{known}; or a place: {PLACES}")
    if not found.any():
        side = "edge of the outline" if mesh.dim == 2 else "face of the surface"
        raise InputError(
            key, f"{told}, where no whole {side} is", f"a place of the body, which has {extent(mesh)}"
        )
    return np.unique(mesh.outer_sides[found])


def with_regions(
    groups: list[Group], sizes: Mapping[int, int], regions: Mapping[str, Any], body: Mesh
) -> tuple[list[Group], dict[str, Any]]:
    """The groups of cells, with those that `regions` has by place, and the regions by names and numbers.

    `sizes` has the number of cells of each block of the `body`. A box takes its cells out of the groups
    of the file. Raises `InputError` for a place without cells.
    """
    boxes = {name: place for name, place in regions.items() if isinstance(place, Mapping)}
    listed = {one.name for one in groups}
    rest = [name for name, place in regions.items() if place == REST and REST not in listed]
    if not boxes and not rest:
        return groups, dict(regions)
    block = np.repeat([*sizes], [*sizes.values()])
    local = np.concatenate([np.arange(size) for size in sizes.values()])
    start = dict(zip(sizes, np.cumsum([0, *sizes.values()]), strict=False))
    placed = {name: _cells_in(body, name, box) for name, box in boxes.items()}
    _refuse_common(placed, rest)
    taken = np.any([np.zeros(len(block), bool), *placed.values()], axis=0)
    keys = {key for key in regions.values() if not isinstance(key, Mapping)}
    groups = [
        one._replace(cells=one.cells[~taken[start[one.block] + one.cells]]) if one.block in start else one
        for one in groups
    ]
    for one in groups:
        if one.block in start and not keys.isdisjoint((one.name, one.number)):
            taken[start[one.block] + one.cells] = True
    for name in rest:
        placed[name] = ~taken
        if taken.all():
            given = f"{name} = {REST}, of which no cell is left"
            raise InputError("finger.regions", given, "regions that leave some cells")
    found, last = dict(regions), max([0, *(one.number for one in groups)])
    for number, (name, cells) in enumerate(placed.items(), last + 1):
        found[name] = number
        groups += [Group(None, number, k, local[cells & (block == k)]) for k in sizes]
    return groups, found


def _refuse_common(boxes: Mapping[str, Any], rest: list[str]) -> None:
    """Raise `InputError` where two boxes, whose cells (E,) bool are given, or the rest go to two regions."""
    if len(rest) > 1:
        raise InputError("finger.regions", f"{' and '.join(rest)} = {REST}", "one region that is the rest")
    for (first, one), (second, other) in combinations(boxes.items(), 2):
        if (one & other).any():
            given = f"{first} and {second} with {(one & other).sum()} cells in both boxes"
            raise InputError("finger.regions", given, "boxes that have no centre of a cell in common")


def _cells_in(body: Mesh, name: str, box: Mapping[str, Any]) -> Any:
    """Which cells have their centres in the box of a region, (E,) bool."""
    found = _within(body.centres, "finger.regions", box, body)
    if not found.any():
        given = f"{name} = {_told(box)}, where no cell has its centre"
        raise InputError("finger.regions", given, f"a part of the body, which has {extent(body)}")
    return found


def extent(mesh: Mesh) -> str:
    """From where to where a mesh goes."""
    ends = zip("xyz", mesh.points.min(axis=0), mesh.points.max(axis=0), strict=False)
    return ", ".join(f"{axis} from {low:g} to {high:g}" for axis, low, high in ends)


def _facing(mesh: Mesh, axis: int, sign: float) -> Any:
    """Which outer sides (K,) face that way and are joined by such ones to the outermost of them."""
    sides = mesh.outer_sides
    corners = mesh.points[sides[:, : 2 * mesh.dim - 2]]
    if mesh.dim == 2:
        along = corners[:, 1] - corners[:, 0]
        normal = np.column_stack([along[:, 1], -along[:, 0]])
    else:
        normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    facing = np.flatnonzero(sign * normal[:, axis] > LEAST * np.linalg.norm(normal, axis=1))
    part, far = joined(sides[facing]), (sign * corners[facing, :, axis]).max(axis=1)
    outermost = part[far >= far.max() - SAME * np.ptp(mesh.points, axis=0).max()]
    found = np.zeros(len(sides), dtype=bool)
    found[facing[np.isin(part, outermost)]] = True
    return found


def _within(points: Floats, key: str, place: Mapping[str, Any], body: Mesh) -> Any:
    """Which points (N, dim) are in a box, its faces included, (N,) bool."""
    near = SAME * np.ptp(body.points, axis=0).max()
    try:
        low, high = np.array(place["box"] if set(place) == {"box"} else (), dtype=float)
    except (TypeError, ValueError):
        low = high = np.array([])
    if low.shape != (body.dim,) or not (low <= high).all():
        axes = "three coordinates each" if body.dim == 3 else "two coordinates each"
        raise InputError(key, _told(place), f"{BOX} with {axes}, the smaller numbers first")
    return ((points >= low - near) & (points <= high + near)).all(axis=1)


def _told(place: Any) -> str:
    """A place as a scene file has it."""
    if not isinstance(place, Mapping):
        return str(place)
    return "{" + ", ".join(f"{axis} = {describe_value(ends)}" for axis, ends in place.items()) + "}"

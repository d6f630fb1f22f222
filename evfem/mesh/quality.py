"""Checks of a mesh before anything is computed on it.

`check` asks one question after the other, in the order of the file, and every fault becomes one
sentence; what it asks of hexahedra alone is in `evfem.mesh.solids`. The shape of cells is their
scaled Jacobian, at the end.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh import solids
from evfem.mesh.faces import node_places, shape_functions
from evfem.mesh.hexahedron import EDGES
from evfem.mesh.mesh import CELLS, KINDS, Mesh, joined, once
from evfem.mesh.solids import Refuse, listed, some, turned

#: Extent of a finger's outline in mm: other numbers mean other units.
SMALLEST, LARGEST = 1.0, 200.0
#: Two nodes closer than this fraction of the outline's extent coincide.
SAME_PLACE = 1e-7
#: Pairs of nodes or edges near each other: 4,000 edges of the outline, one of them as long as the finger.
MOST_PAIRS = 8_000_000
#: a direction along which few nodes of a regular mesh are level
ACROSS = np.sqrt([2.0, 3.0, 5.0])


def check(mesh: Mesh, source: str = "mesh", others: Sequence[str] = ()) -> Mesh:
    """The same mesh, its cells counter-clockwise (hexahedra right-handed) and its set `pad` reduced
    to the outline or surface.

    `source` names the mesh in messages, `others` what else its file has. Raises `InputError` (key
    `finger.mesh`) for the first fault found: those of the body (`sound`), then those of its names (`named`).
    """
    return named(sound(mesh, source), source, others)


def sound(mesh: Mesh, source: str) -> Mesh:
    """The same mesh, its cells turned. Raises `InputError` for values, numbers of nodes, units, double and
    unused nodes, shapes, connection, overlap.
    """
    refuse = _refusing(source)
    _arrays(mesh, refuse)
    _extent(mesh, refuse)
    _nodes(mesh, refuse)
    oriented, surface = (_oriented, _outline) if mesh.dim == 2 else (solids.oriented, solids.surface)
    mesh = oriented(mesh, refuse)
    _shapes(mesh, refuse)
    _connection(mesh, refuse)
    surface(mesh, refuse)
    return mesh


def named(mesh: Mesh, source: str, others: Sequence[str] = ()) -> Mesh:
    """The same mesh, its set `pad` reduced. Raises `InputError` for a lack of `pad` or `bone`."""
    refuse = _refusing(source)
    _names(mesh, others, refuse)
    return solids.with_sets(mesh, refuse)


def _refusing(source: str) -> Refuse:
    def refuse(fault: str, allowed: str) -> None:
        raise InputError("finger.mesh", f"{source} with {fault}", allowed)

    return refuse


def _arrays(mesh: Mesh, refuse: Refuse) -> None:
    if mesh.kind not in KINDS or mesh.dim != CELLS[mesh.kind].dimension:
        refuse(f"{mesh.kind} cells", "cells of one kind: " + ", ".join(KINDS))
    bad = np.flatnonzero(~np.isfinite(mesh.points).all(axis=1))
    if len(bad):
        refuse(f"no finite coordinates at node {some(bad)}", "finite numbers")
    if not len(mesh.cells):
        refuse("no cells", "at least one cell")
    if mesh.cells.min() < 0 or mesh.cells.max() >= len(mesh.points):
        refuse(f"cells of node {mesh.cells.max()}", f"node numbers from 0 to {len(mesh.points) - 1}")
    ordered = np.sort(mesh.cells, axis=1)
    bad = np.flatnonzero((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))
    if len(bad):
        refuse(f"the same node twice in cell {some(bad)}", "different nodes in a cell")
    bad = np.setdiff1d(mesh.region, list(mesh.region_names.values()))
    if len(mesh.region) != len(mesh.cells) or len(bad):
        refuse(f"cells in the nameless region {some(bad)}", "a named region for every cell")


def _extent(mesh: Mesh, refuse: Refuse) -> None:
    extent = float(np.ptp(mesh.points, axis=0).max())
    if not SMALLEST <= extent <= LARGEST:
        allowed = f"an outline between {SMALLEST:g} and {LARGEST:g} mm (lengths are in mm)"
        refuse(f"an extent of {extent:.4g} mm", allowed)


def _nodes(mesh: Mesh, refuse: Refuse) -> None:
    unused = np.flatnonzero(np.bincount(mesh.cells.ravel(), minlength=len(mesh.points)) == 0)
    if len(unused):
        refuse(f"{len(unused)} nodes that no cell uses (node {some(unused)})", "only nodes of cells")
    radius = SAME_PLACE * float(np.ptp(mesh.points, axis=0).max())
    pairs = _pairs_within(mesh.points, radius)
    apart = "one node per position: merge double nodes, or the bodies come apart"
    if pairs is None:
        refuse("too many nodes at the same position", apart)
    elif len(pairs):
        first, second = pairs[0]
        refuse(f"{len(pairs)} pairs of nodes at the same position (nodes {first} and {second})", apart)


def _oriented(mesh: Mesh, refuse: Refuse) -> Mesh:
    """Each cell counter-clockwise."""
    corner = mesh.points[mesh.cells[:, : mesh.corners]]
    x, y = corner[..., 0], corner[..., 1]
    area = 0.5 * np.sum(x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y, axis=1)
    m = mesh.corners
    order = [0, *range(m - 1, 0, -1)]
    if mesh.order == 2:
        order += [m + i for i in range(m - 1, -1, -1)] + ([8] if m == 4 else [])
    return turned(mesh, area, order, refuse)


def _shapes(mesh: Mesh, refuse: Refuse) -> None:
    shape = scaled_jacobian(mesh)
    bad = np.flatnonzero(shape <= 1e-6)
    if len(bad):
        fault = f"tangled cells (cell {some(bad)}, scaled Jacobian {shape.min():.3g})"
        refuse(fault, "convex cells with mid-nodes near the middle of their edges")


def _connection(mesh: Mesh, refuse: Refuse) -> None:
    """Refuse cells that overlap, neighbours with different mid-nodes, and separate parts."""
    (sides, of_cell), apart = mesh.sides, "cells that do not overlap"
    side, sharing = ("edge", "their common edge") if mesh.dim == 2 else ("face", "a common edge or face")
    cells_of_side = np.bincount(of_cell.ravel())
    if (cells_of_side > 2).any():
        nodes = listed(sides[np.argmax(cells_of_side > 2)])
        refuse(f"more than two cells on the {side} of nodes {nodes}", apart)
    turns = np.bincount(of_cell.ravel(), _turns(mesh.cell_sides[..., : sides.shape[1]]).ravel())
    folded = (cells_of_side == 2) & (turns != 0.0)
    if folded.any():
        nodes = listed(sides[np.argmax(folded)])
        refuse(f"two cells on the same side of the {side} of nodes {nodes}", apart)
    if mesh.order == 2:
        middles = [(sides, mesh.cell_sides[..., -1])]
        if mesh.dim == 3:
            middles.append((once(mesh.cells[:, EDGES])[0], mesh.cells[:, 8:20]))
        if any(len(np.unique(nodes)) != len(parts) for parts, nodes in middles):
            fault = f"neighbouring cells with different mid-nodes on {sharing}"
            refuse(fault, "one mid-node per edge" + (" and face" if mesh.dim == 3 else ""))
    lowest = joined(of_cell)
    if lowest.any():
        refuse(f"{len(np.unique(lowest))} separate parts", f"one body, its cells joined by common {side}s")


def _turns(corners: Ints) -> Floats:
    """1 or -1 (E, m): which way round the corners (E, m, 2 or 4) go from the one with the lowest number."""
    count = corners.shape[2]
    first = corners.argmin(axis=2)
    if count == 2:
        return 1.0 - 2.0 * first
    after, before = (
        np.take_along_axis(corners, (first[..., None] + sense) % count, axis=2)[..., 0] for sense in (1, -1)
    )
    return np.where(after < before, 1.0, -1.0)


def _outline(mesh: Mesh, refuse: Refuse) -> None:
    """The outline must not cross or touch itself: else cells overlap, or nodes hang on another
    cell's edge.
    """
    edges = mesh.outer_sides
    if not len(edges):
        refuse("no outline", "a body with an outline")
    if mesh.order == 2:
        edges = np.vstack([edges[:, [0, 2]], edges[:, [2, 1]]])
    pairs = _near_pairs(mesh.points[edges], refuse)
    apart = (edges[pairs[:, 0]][:, :, None] != edges[pairs[:, 1]][:, None, :]).all(axis=(1, 2))
    a, b = mesh.points[edges[pairs[:, 0]]], mesh.points[edges[pairs[:, 1]]]
    (across, along), (back, _) = _across_and_along(a, b), _across_and_along(b, a)
    in_line = (across == 0.0).all(axis=1)
    overlapping = (along.max(axis=1) > 1e-9) & (along.min(axis=1) < 1.0 - 1e-9)
    crossing = apart & ~in_line & (across.prod(axis=1) <= 0.0) & (back.prod(axis=1) <= 0.0)
    crossing |= in_line & overlapping
    if crossing.any():
        first = pairs[np.argmax(crossing)]
        fault = f"an outline that crosses or touches itself near node {edges[first[0]][0]}"
        refuse(fault, "cells that do not overlap, and no node on another cell's edge")


def _near_pairs(segments: Floats, refuse: Refuse) -> Ints:
    """Pairs of segments (K, 2, 2) whose middles are near enough for them to meet."""
    half, middle = 0.5005 * np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1), segments.mean(axis=1)
    pairs = _pairs_within(middle, 2.0 * float(half.max()))
    if pairs is None:
        refuse(
            "edges of the outline too close for their lengths", "edges of similar lengths along the outline"
        )
        return np.zeros((0, 2), dtype=np.int64)
    distance = np.linalg.norm(middle[pairs[:, 0]] - middle[pairs[:, 1]], axis=1)
    return pairs[distance <= half[pairs].sum(axis=1)]


def _pairs_within(points: Floats, reach: float) -> Ints | None:
    """Pairs (K, 2) of points (N, dim) at most `reach` apart; None where more than `MOST_PAIRS` are so near
    along `ACROSS` alone.
    """
    along = points @ ACROSS[: points.shape[1]] / np.linalg.norm(ACROSS[: points.shape[1]])
    order, count = np.argsort(along), np.arange(len(points))
    near = np.searchsorted(along[order], along[order] + 1.0001 * reach) - count - 1
    if near.sum() > MOST_PAIRS:
        return None
    first = np.repeat(count, near)
    second = first + 1 + np.arange(first.size) - np.repeat(np.cumsum(near) - near, near)
    pairs = np.sort(np.column_stack([order[first], order[second]]), axis=1)
    pairs = pairs[np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1) <= reach]
    return pairs[np.lexsort(pairs.T[::-1])]


def _across_and_along(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Ends of the segments b (K, 2, 2) across and along the segments a, in lengths of a, (K, 2) each."""
    direction = a[:, 1] - a[:, 0]
    away = b - a[:, :1]
    square = (direction**2).sum(axis=1)[:, None]
    across = (direction[:, None, 0] * away[..., 1] - direction[:, None, 1] * away[..., 0]) / square
    across[np.abs(across) < 1e-9] = 0.0
    return across, (away * direction[:, None]).sum(axis=-1) / square


def _names(mesh: Mesh, others: Sequence[str], refuse: Refuse) -> None:
    have = ", ".join([*sorted(mesh.node_sets), *others]) or "none"
    for name in ("pad", "bone"):
        if not len(mesh.node_sets.get(name, ())):
            fault = f"no node in {name}" if name in mesh.node_sets else f"no boundary {name} (it has {have})"
            refuse(fault, "sets of nodes `pad` and `bone`, or [finger.boundaries] with their names or places")


def scaled_jacobian(mesh: Mesh) -> Floats:
    """Smallest scaled Jacobian of each cell, (E,), over all its nodes: 1 for a square, a cube or an
    equilateral triangle.

    det(t1, t2[, t3]) / (|t1| |t2| [|t3|]) with the tangents of the cell's own, possibly curved,
    coordinate lines at the node; in triangles the longest two of the three directions count, and sin 60
    degrees is divided out. Zero or less: the cell is degenerate or turned inside out.

    >>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> square = Mesh(corners, np.array([[0, 1, 2, 3]]), "quad", np.zeros(1, dtype=int), {"skin": 0})
    >>> scaled_jacobian(square).tolist()
    [1.0]
    """
    x, nodes = mesh.points[mesh.cells], mesh.cells.shape[1]
    slopes = np.swapaxes(shape_functions(nodes, node_places(nodes, mesh.dim))[1], 1, 2)
    smallest = np.full(len(x), np.inf)
    for slope in slopes:
        t = slope @ x
        length = np.linalg.norm(t, axis=2)
        lengths = length.prod(axis=1)
        if mesh.corners == 3:
            third = np.linalg.norm(t[:, 1] - t[:, 0], axis=1)
            lengths = np.maximum(lengths, third * length.max(axis=1)) * np.sqrt(0.75)
        smallest = np.minimum(smallest, np.linalg.det(t) / np.maximum(lengths, 1e-300))
    return smallest

r"""Where contact begins and ends between two nodes: the edge of a smooth contact, interpolated
from the gap.

The nodes that touch tell the width of contact only to about one element per contact, too much for
fingerprint ridges that are a dozen elements wide. Beyond the edge a of a smooth contact the gap
opens like :math:`(x - a)^{3/2}` (Hertz; Johnson, Contact Mechanics, doi:10.1017/CBO9781139171731,
ch. 4), so :math:`y = g^{2/3}` starts linearly. Where the outline curves away, y grows faster: an
exponential through the first three open nodes, :math:`y = y_1 + b (e^{k (x - x_1)} - 1)`, has its
zero at the edge; its limit k = 0 is the straight line. Lengths in mm.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from evfem.common.arrays import Floats, Ints
from evfem.errors import InputError
from evfem.mesh.mesh import Mesh

Flags = npt.NDArray[np.bool_]


def outline_nodes(mesh: Mesh) -> Ints:
    """Mesh numbers (P,) of the nodes on `pad` along the outline, in growing x on the side that
    faces down.

    On quadratic meshes ends and middles of edges alternate. Raises InputError where the pad is not
    one open line.

    >>> from evfem.finger.fingerpad import FingerPad
    >>> mesh = FingerPad(resolution="coarse").mesh(order=2)
    >>> nodes = outline_nodes(mesh)
    >>> len(nodes) == len(mesh.node_sets["pad"]), bool(mesh.points[nodes[0], 0] < 0)
    (True, True)
    """
    if mesh.dim == 3:
        raise InputError("finger.mesh", "a finger in three dimensions", "a plane finger")
    edges = mesh.edges_of("pad")
    follow = {int(edge[0]): [int(node) for node in (*edge[2:], edge[1])] for edge in edges}
    starts = set(follow) - {nodes[-1] for nodes in follow.values()}
    if len(starts) != 1:
        raise InputError("finger.mesh", f"a pad with {len(starts)} beginnings", "a pad that is one open line")
    nodes = list(starts)
    while nodes[-1] in follow:
        nodes += follow[nodes[-1]]
    return np.array(nodes, dtype=np.int64)


def contact_spans(x: Floats, gap: Floats, touching: Flags) -> Floats:
    """Begin and end (K, 2) of every contact, as fractional indices into the nodes of the outline.

    `x`, `gap`, `touching` (P,) are current abscissa, gap and contact of the nodes in the order of
    `outline_nodes`. Use it as ``np.interp(spans, np.arange(P), x)`` for abscissae; any other
    quantity along the outline goes the same way. Raises InputError for arrays of other shapes.

    >>> x = np.arange(-5.0, 6.0)
    >>> gap = np.maximum(np.abs(x) - 1.75, 0.0) ** 1.5       # touches from -1.75 to 1.75
    >>> np.interp(contact_spans(x, gap, gap == 0.0), np.arange(11), x).round(12).tolist()
    [[-1.75, 1.75]]
    """
    x, gap, touching = np.asarray(x), np.asarray(gap), np.asarray(touching)
    if x.ndim != 1 or not x.shape == gap.shape == touching.shape:
        raise InputError(
            "x, gap, touching", f"shapes {x.shape}, {gap.shape}, {touching.shape}", "one value per node"
        )
    change = np.flatnonzero(np.diff(np.concatenate([[False], touching, [False]]).astype(int)))
    begins, ends = change[0::2], change[1::2] - 1
    spans = np.empty((len(begins), 2))
    for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        spans[k, 0] = begin - _reach(x, gap, touching, begin, -1, end > begin)
        spans[k, 1] = end + _reach(x, gap, touching, end, 1, end > begin)
    return spans


def _reach(x: Floats, gap: Floats, touching: Flags, last: int, step: int, wide: bool) -> float:
    """How far contact reaches beyond the node `last`, in spacings of nodes: from -1/2 (0 for a
    lone node) to 1.
    """
    outside: list[int] = []
    for node in range(last + step, last + 4 * step, step):
        if not 0 <= node < x.size or touching[node]:
            break
        outside.append(node)
    if not outside:
        return 0.0
    if len(outside) == 1:
        return 0.5
    distance = np.abs(x[outside] - x[last])
    found = _zero(distance, gap[outside] ** (2.0 / 3.0))
    inner = abs(x[last] - x[last - step]) if wide else distance[0]
    spacing = distance[0] if found > 0.0 else inner
    return float(np.clip(found / spacing, -0.5 if wide else 0.0, 1.0))


def _zero(x: Floats, y: Floats) -> float:
    """Zero of the exponential through three points, or of the line through the first two."""
    slope = [(y1 - y0) / (x1 - x0) for (x0, y0), (x1, y1) in pairwise(zip(x, y, strict=True))]
    if slope[0] <= 0.0:
        return float(0.5 * x[0])
    rate = np.log(slope[1] / slope[0]) / (0.5 * (x[2] - x[0])) if slope[-1] > slope[0] else 0.0
    if rate * x[0] < 1e-9:
        return float(x[0] - y[0] / slope[0])
    scale = (y[1] - y[0]) / np.expm1(rate * (x[1] - x[0]))
    return float(x[0] + np.log(max(1.0 - y[0] / scale, 1e-12)) / rate)
